"""Version, day and what else a release says stand alike wherever they stand."""

from __future__ import annotations

import json
import re
import tomllib
from datetime import date, datetime
from pathlib import Path

import pytest

import holokin as hk

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml")
pytestmark = pytest.mark.skipif(not (ROOT / ".github").is_dir(), reason="an sdist has not these files")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]

PACKAGE = Path(hk.__file__).parent
RELEASES = re.compile(r"^## (\d+\.\d+\.\d+)(?:: [\w ]+)? \((unreleased|\d{4}-\d\d-\d\d)\)$", re.MULTILINE)
SAYING = ("CITATION.cff", ".zenodo.json", "paper.md", "recipe.yaml", "meta.yaml")
"""Files for others, in the first folder or at most two below it, where there are such."""
VERSION = re.compile(r"""^[\s{%"]*(?:set )?version"?\s*[:=]\s*["'](\d[^"']*)["']""", re.MULTILINE)
DAY = re.compile(r"""^[\s{"]*(?:date-released|publication_date|date)"?\s*:\s*["']?(\d[\w -]+)""", re.MULTILINE)


def read(file: str) -> dict:
    return yaml.safe_load((ROOT / file).read_text("utf-8"))


def names(requirements: list[str]) -> set[str]:
    """Packages with their least versions; matplotlib is matplotlib-base for conda."""
    return {"".join(one.split()).replace("matplotlib-base", "matplotlib") for one in requirements}


def test_the_archive_and_the_citation_say_the_same() -> None:
    archive, citation = json.loads((ROOT / ".zenodo.json").read_text("utf-8")), read("CITATION.cff")
    assert archive["creators"] == citation["authors"] == PROJECT["authors"]
    assert archive["description"] == citation["abstract"].strip()
    assert [archive[key] for key in ("title", "keywords", "license")] == [
        citation[key] for key in ("title", "keywords", "license")
    ]


def test_each_python_that_is_promised_is_tried_before_a_release_and_in_the_hosted_checks() -> None:
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    steps = read(".github/workflows/release.yml")["jobs"]["release"]["steps"]
    assert f">={promised[0]}" == PROJECT["requires-python"]
    assert steps[1]["with"]["python-version"].split() == promised
    assert steps[2]["run"].split()[1:] == [f"python{version}" for version in promised]
    assert read(".github/workflows/ci.yml")["jobs"]["run"]["strategy"]["matrix"]["python"] == promised


def test_the_conda_recipe_is_of_this_version_and_needs_what_the_command_line_needs() -> None:
    recipe = read("recipe/recipe.yaml")
    wanted = PROJECT["dependencies"] + PROJECT["optional-dependencies"]["app"]
    assert recipe["context"]["version"] == hk.__version__
    assert names(recipe["requirements"]["run"]) == names(wanted) | {f"python{PROJECT['requires-python']}"}
    assert recipe["build"]["python"]["entry_points"] == [f"{k} = {v}" for k, v in PROJECT["scripts"].items()]


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
