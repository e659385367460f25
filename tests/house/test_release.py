"""Version and day of the release stand alike wherever they stand; the changelog begins with them."""

from __future__ import annotations

import re
from datetime import date, datetime
from pathlib import Path

import holokin as hk

ROOT = Path(__file__).parents[2]
PACKAGE = Path(hk.__file__).parent
RELEASES = re.compile(r"^## (\d+\.\d+\.\d+)(?:: [\w ]+)? \((unreleased|\d{4}-\d\d-\d\d)\)$", re.MULTILINE)
SAYING = ("CITATION.cff", ".zenodo.json", "paper.md", "recipe.yaml", "meta.yaml")
"""Files for others, in the first folder or at most two below it, where there are such."""
VERSION = re.compile(r"""^[\s{%"]*(?:set )?version"?\s*[:=]\s*["'](\d[^"']*)["']""", re.MULTILINE)
DAY = re.compile(r"""^[\s{"]*(?:date-released|publication_date|date)"?\s*:\s*["']?(\d[\w -]+)""", re.MULTILINE)


def day(text: str) -> date:
    """2026-11-30, or 30 November 2026."""
    return date.fromisoformat(text) if "-" in text else datetime.strptime(text, "%d %B %Y").date()


def test_the_version_is_written_in_one_place_of_the_package() -> None:
    wanted = re.compile(rf"(?<![\d.]){re.escape(hk.__version__)}(?![\d.])")
    files = [ROOT / "pyproject.toml", ROOT / "mkdocs.yml", *PACKAGE.rglob("*.py")]
    assert [str(f) for f in files if wanted.search(f.read_text("utf-8"))] == [str(PACKAGE / "version.py")]


def test_the_changelog_begins_with_this_version() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    releases = RELEASES.findall(text)
    assert len(releases) == text.count("\n## ")
    assert releases[0][0] == hk.__version__


def test_version_and_day_are_those_of_the_changelog_wherever_they_stand() -> None:
    (version, released), *_ = RELEASES.findall((ROOT / "CHANGELOG.md").read_text("utf-8"))
    files = {file for deep in ("", "*/", "*/*/") for name in SAYING for file in ROOT.glob(f"{deep}{name}")}
    texts = {str(file.relative_to(ROOT)): file.read_text("utf-8") for file in files}
    versions = {(name, found) for name, text in texts.items() for found in VERSION.findall(text)}
    days = {(name, day(found)) for name, text in texts.items() for found in DAY.findall(text)}
    assert ("CITATION.cff", version) in versions and {found for _, found in versions} == {version}, versions
    if released != "unreleased":
        assert ("CITATION.cff", day(released)) in days and {found for _, found in days} == {day(released)}, days
