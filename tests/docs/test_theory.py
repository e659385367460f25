"""docs/theory.md holds every section, erratum and oracle that code, tests and documents refer to."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "theory.md").read_text("utf-8")
PLACE = r"(?:\d(?:\.\d)?[a-i]?|[ET]\d{1,2})(?![\w.]*\d)"
CITED = re.compile(
    rf"[Tt]heory(?:\.md)?(?:\]\((?:docs/)?theory\.md\))?,? (?:section )?({PLACE}(?:(?:,| and|, and) {PLACE})*)"
)
MARK = re.compile(r"(?<![A-Za-z0-9.^])[ET](?:[1-9]|1\d)(?![0-9A-Za-z_])")  # not columns T00 to T23
INNER = re.compile(rf"\(({PLACE}(?:, {PLACE})*)(?:, variant \w+)?\)|\b(?:by|of|see) ([1-9](?:\.\d|[a-i]))(?=[ .,:;])")


def defined() -> set[str]:
    """Sections, errata and oracles of the page."""
    sections = re.findall(r"^#{2,3} (\d(?:\.\d|[a-i])?) ", PAGE, re.MULTILINE)
    errata, oracles = (
        re.findall(r"^- \*\*(E\d+)\*\* ", PAGE, re.MULTILINE),
        re.findall(r"^\| (T\d+) \|", PAGE, re.MULTILINE),
    )
    every = [*sections, *errata, *oracles]
    assert len(every) == len(set(every))
    return set(every)


def cited(text: str) -> set[str]:
    """What a text refers to: "theory 2a, 5.3", "theory, section 4", "[theory](theory.md) 5.4", T7 or E3, in names."""
    flat = re.sub(r"\s+(?:# )?", " ", text)
    found = {place for places in CITED.findall(flat) for place in re.findall(PLACE, places)}
    return found | set(MARK.findall(flat)) | set(re.findall(r"_([ET]\d{1,2})\b", flat))


def files() -> list[Path]:
    """Everything that may refer to the theory."""
    folders = [f for name in ("src", "tests", "docs", "benchmarks", "examples") for f in (ROOT / name).rglob("*")]
    texts = [f for f in folders if f.suffix in (".py", ".md", ".toml") and f.name != "theory.md"]
    return [*texts, ROOT / "README.md", ROOT / "CHANGELOG.md"]


def test_every_citation_of_the_theory_is_defined() -> None:
    known, seen = defined(), set()
    for file in files():
        text = file.read_text("utf-8")
        if not re.search(r"heory|[ET]\d", text):
            continue  # it refers to nothing
        places = cited(text)
        assert places <= known, f"{file.relative_to(ROOT)}: {sorted(places - known)}"
        seen |= places
    assert {"1.1", "2a", "2i", "4", "5.3", "7.2", "E13", "T5", "T16"} <= seen
    assert len(seen) > 40


def test_the_page_refers_to_what_it_has() -> None:
    known = defined()
    assert {f"E{k}" for k in range(1, 14)} | {f"T{k}" for k in range(1, 17)} <= known
    pairs = INNER.findall(re.sub(r"\s+", " ", re.sub(r"`[^`]*`", "", PAGE)))
    places = {place for pair in pairs for group in pair for place in re.findall(PLACE, group)}
    inner = {place for place in places if not place.isdigit()} | set(MARK.findall(PAGE))  # (7) is an equation
    assert {"1.4", "2c", "5.3", "7.1"} <= inner
    assert inner <= known, sorted(inner - known)
    keys = set(re.findall(r"\[([A-Z][A-Za-z]*\d\d)\]", PAGE))
    page = (ROOT / "docs" / "references.md").read_text("utf-8")
    assert {key for key in keys if f"**[{key}]**" not in page} == set()


def test_every_oracle_has_a_test_that_exists() -> None:
    rows = re.findall(r"^\| (T\d+) \|.*\| `(tests/[^`:]+)::([^`]+)` \|$", PAGE, re.MULTILINE)
    assert [name for name, *_ in rows] == [f"T{k}" for k in range(1, 17)]
    for name, file, test in rows:
        tree = ast.parse((ROOT / file).read_text("utf-8"))
        assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, name
