"""What a package says of itself: its version in one place, that it is typed, a changelog that is ready for a tag."""

from __future__ import annotations

import re
from pathlib import Path

import holokin as hk

ROOT = Path(__file__).parents[1]
PACKAGE = Path(hk.__file__).parent


def test_the_version_is_written_in_one_place() -> None:
    wanted = re.compile(rf"(?<![\d.]){re.escape(hk.__version__)}(?![\d.])")
    files = [ROOT / "pyproject.toml", ROOT / "CITATION.cff", ROOT / "mkdocs.yml", *PACKAGE.rglob("*.py")]
    assert [str(f) for f in files if wanted.search(f.read_text("utf-8"))] == [str(PACKAGE / "version.py")]


def test_the_package_says_that_it_is_typed() -> None:
    assert (PACKAGE / "py.typed").is_file()


def test_the_changelog_begins_with_this_version_and_only_known_sections() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    versions = re.findall(r"^## \[(.+?)\] - (\S+)$", text, re.MULTILINE)
    assert versions[0][0] == hk.__version__
    assert re.fullmatch(r"unreleased|\d{4}-\d\d-\d\d", versions[0][1])
    kinds = set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_the_readme_claims_no_more_than_is_tested() -> None:
    text = (ROOT / "README.md").read_text("utf-8").lower()
    for claim in ("proves", "prove ", "to the last bit", "comes home", "come home", "guarantee"):
        assert claim not in text, claim


def test_no_page_names_an_address_of_a_project_that_does_not_exist_yet() -> None:
    for file in ("pyproject.toml", "mkdocs.yml", "CITATION.cff", "README.md"):
        text = (ROOT / file).read_text("utf-8")
        assert not re.search(r"repo_url|site_url|project\.urls|repository-code|github\.com/\w*holokin", text), file
