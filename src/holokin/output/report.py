"""Writing a job's folder: report.html (self-contained), figures, trajectories, result.json; whole or not at all."""

from __future__ import annotations

import base64
import json
import shutil
import tempfile
from collections.abc import Callable
from html import escape
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import ArgumentError
from .figures import figures, slug
from .result import FIGURES, JobResult
from .table import COLUMNS, row

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #22262e; max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }}
h1 {{ font-size: 1.7rem; margin-bottom: .2rem; }} h2 {{ margin-top: 2.2rem; font-size: 1.25rem; }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; font-variant-numeric: tabular-nums; }}
th, td {{ text-align: left; padding: .4rem .6rem; border-bottom: 1px solid #e5e7eb; vertical-align: top; }}
th {{ color: #4b5563; font-weight: 600; }} .yes {{ color: #1c7c43; font-weight: 600; }}
.no {{ color: #b3261e; font-weight: 600; }} figure {{ margin: 1.2rem 0; }} img {{ max-width: 100%; }}
figcaption, .small {{ color: #4b5563; font-size: .9rem; }} .wide {{ overflow-x: auto; }}
</style></head><body>
{body}
</body></html>
"""


def write_report(
    result: JobResult, out: FilePath, version: str, extra: Callable[[FilePath], None] | None = None
) -> FilePath:
    """Write `out/<job>/` and return it; `extra` may add files before it is put in place.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made.
    """
    target = out / result.name
    if target.exists() and not (target / "result.json").is_file():
        raise ArgumentError("the output folder", str(target), "it is not one of holokin's; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        work = FilePath(tempfile.mkdtemp(prefix=f".{result.name}-", dir=out))
    except OSError as problem:
        raise ArgumentError("the output folder", str(out), f"cannot be made: {problem.strerror}") from None
    try:
        _fill(result, work, version)
        if extra is not None:
            extra(work)
        work.chmod(0o755)
        if target.exists():
            shutil.rmtree(target)
        work.rename(target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return target


def _fill(result: JobResult, folder: FilePath, version: str) -> None:
    shown: list[tuple[str, str]] = []
    for stem, caption, figure in figures(result):
        figure.savefig(folder / f"{stem}.png", dpi=130, facecolor="white")
        figure.savefig(folder / f"{stem}.svg", facecolor="white", metadata={"Date": None})
        shown.append((stem, caption))
    for strategy in result.strategies:
        for key, walk in strategy.trajectories().items():
            walk.save(folder / f"{slug(strategy.name)}-{key}.csv")
    facts = {
        "job": result.name, "title": result.title, "passed": result.passed, "robot": result.robot.name,
        "robot_source": result.robot.source, "task": result.task, "start": result.start.tolist(),
        "joint_names": list(result.robot.joint_names), "path_length_m": result.path.length,
        "path_duration_s": result.path.duration, "cycles": result.cycles, "seconds": result.seconds,
        "holokin": version, "strategies": [s.summary() for s in result.strategies],
    }  # fmt: skip
    (folder / "result.json").write_text(json.dumps(facts, indent=2, allow_nan=False) + "\n", "utf-8")
    (folder / "report.html").write_text(_page(result, folder, shown, version), "utf-8")


def _page(result: JobResult, folder: FilePath, shown: list[tuple[str, str]], version: str) -> str:
    robot = result.robot
    start = ", ".join(f"{name} {value:.6g}" for name, value in zip(robot.joint_names, result.start, strict=True))
    parts = [
        f"<h1>{escape(result.title)}</h1>",
        f"<p>{escape(' '.join(result.about.split()))}</p>",
        f"<p class='small'>{escape(robot.name)}, {robot.n} joints ({escape(robot.source)}); "
        f"task: {escape(result.task)}; path {result.path.length:.4g} m in {result.path.duration:.4g} s, "
        f"{result.cycles} cycle(s); start: {escape(start)} [rad, m]. "
        f"holokin {escape(version)}, {result.seconds:.1f} s.</p>",
        "<h2>Verdicts and numbers</h2>",
        _html_table([title for title, _ in COLUMNS], [[_cell(c) for c in row(s)] for s in result.strategies]),
        "<ul class='small'>",
        *(f"<li>{escape(str(s.verdict))}</li>" for s in result.strategies),
        *(f"<li>{escape(s.name)}: {escape(s.trouble)}</li>" for s in result.strategies if s.trouble),
        "</ul>",
        "<h2>Figures</h2>",
        *(_figure(folder, stem, caption) for stem, caption in shown),
        "<h2>Everything measured</h2>",
        _all_figures(result),
        "<h2>Expectations</h2>",
        _expectations(result),
    ]
    return _PAGE.format(title=escape(result.title), body="\n".join(parts))


def _cell(text: str) -> str:
    mark = {"holonomic": "yes", "ok": "yes", "NOT holonomic": "no", "FAILED": "no"}.get(text)
    return f"<span class='{mark}'>{escape(text)}</span>" if mark else escape(text)


def _figure(folder: FilePath, stem: str, caption: str) -> str:
    data = base64.b64encode((folder / f"{stem}.svg").read_bytes()).decode("ascii")
    image = f"<img alt='{escape(caption, quote=True)}' src='data:image/svg+xml;base64,{data}'>"
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _all_figures(result: JobResult) -> str:
    rows: list[list[str]] = []
    for key, meaning in FIGURES.items():
        values = [s.figures.get(key, np.nan) for s in result.strategies]
        if any(np.isfinite(values)):
            cells = [f"{value:.6g}" if np.isfinite(value) else "" for value in values]
            rows.append([escape(meaning), *cells])
    return _html_table(["", *(escape(s.name) for s in result.strategies)], rows)


def _expectations(result: JobResult) -> str:
    rows = [
        [escape(s.name), escape(c.figure), escape(c.wanted), escape(c.found), _cell("ok" if c.passed else "FAILED")]
        for s in result.strategies
        for c in s.checks
    ]
    return _html_table(["strategy", "figure", "wanted", "found", ""], rows)


def _html_table(head: list[str], rows: list[list[Any]]) -> str:
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in r) + "</tr>" for r in rows)
    return f"<div class='wide'><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
