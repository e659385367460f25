"""docs/measured.md: a section for each part of the benchmarks, and a head that says what each was run with."""

from __future__ import annotations

import datetime
import importlib
import os
import platform
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import holokin as hk

ROOT = Path(__file__).resolve().parents[1]
PARTS = {
    "speed": "benchmarks.speed",
    "drift": "benchmarks.drift",
    "league": "benchmarks.league.league_page",
    "rivals": "benchmarks.rivals",
    "inverse": "benchmarks.inverse",
    "survey": "benchmarks.survey",
    "cusps": "benchmarks.cusps",
    "accuracy": "benchmarks.accuracy",
    "reliability": "benchmarks.reliability",
}
"""The module of each part; its `section` measures, and gives its blocks."""

HEAD = """
# Measured

This page holds the numbers that the other pages link to: how fast holokin is, which laws and libraries return the
joints, what was searched for and not found, and what was tried to break it. `python -m benchmarks` measures all of it
again and writes the page; `python -m benchmarks drift cusps` does so for two sections. A section is always the work of
one run. All of it takes some 90 minutes, half of them the league; it needs `pip install -e ".[rivals,test]"` and a C
compiler. Times differ between machines; ratios differ less. Differences of joints are those of the joint that differs
most.
"""

SECTION = re.compile(r"<!-- begin (\w+) -->\n(.*?)\n<!-- end \1 -->", re.DOTALL)
RAN = re.compile(r"^\| ?\[(\w+)\]\(#\1\) ?\|(.*)\|$", re.MULTILINE)


@dataclass(frozen=True)
class Given:
    """What a part is told. out: the folder of the page, and of pictures. quick: little of all, to try it.

    answers: where the league keeps what libraries answered, and looks for it. environments: those of libraries.
    """

    out: Path
    quick: bool = False
    answers: Path | None = None
    environments: Path = field(default_factory=Path)


def run(name: str, given: Given) -> None:
    """Measure a part, and put its section in the place of the one before."""
    given.out.mkdir(parents=True, exist_ok=True)
    blocks, packages = importlib.import_module(PARTS[name]).section(given)
    page = given.out / "measured.md"
    before = page.read_text("utf-8") if page.exists() else ""
    sections = dict(SECTION.findall(before)) | {name: "\n\n".join(blocks)}
    ran = {part: [*map(str.strip, cells.split("|"))] for part, cells in RAN.findall(before)} | {
        name: [packages, machine()]
    }
    parts = [name for name in PARTS if name in sections]
    rows = [[f"[{part}](#{part})", *ran[part]] for part in parts]
    day = f"Last written on {datetime.date.today():%d %B %Y}. Each section ran with:"
    text = [HEAD.strip(), day, table(("section", "versions", "machine"), rows, 3)]
    text += [f"<!-- begin {part} -->\n{sections[part]}\n<!-- end {part} -->" for part in parts]
    page.write_text("\n\n".join(text) + "\n", "utf-8")
    print(f"wrote the section {name} of {page}", flush=True)


def machine() -> str:
    """The system, the processor where the system tells, its cores, and how busy they are."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    name = next(named, platform.processor() or platform.machine())
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{platform.system()}, {name}, {os.cpu_count()} cores{load}"


def versions(*packages: str) -> str:
    """holokin's, Python's, and those of packages that are installed here."""
    out = [f"holokin {hk.__version__}", f"Python {platform.python_version()}"]
    for package in packages:
        try:
            out.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return ", ".join(out)


def table(head: Sequence[str], rows: Iterable[Sequence[object]], left: int = 1) -> str:
    """A table; what follows the first columns is at the right."""
    lines = [list(head), ["---"] * left + ["---:"] * (len(head) - left), *([str(c) for c in row] for row in rows)]
    return "\n".join(f"|{'|'.join(cells)}|" for cells in lines)


def wrapped(words: str, indent: str = "") -> str:
    """Words in lines of one length; the later ones are indented."""
    how = {"subsequent_indent": indent, "break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(" ".join(words.split()), 118, **how)


def us(seconds: float) -> str:
    """A time in us, with three digits."""
    value = 1e6 * seconds
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"
