"""The pages as a whole: none longer than a reader bears, and old names of pages lead to the new ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
FRONT, PAGE, ALL = 600, 2_000, 45_000
"""Words at most of the README, of a page of guide or handbook, of README and all pages; bars of tables are none."""
LONGER = {"job-keys.md", "measured.md", "references.md", "theory.md"}
"""Pages in which one looks something up."""
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")


def words(page: Path) -> int:
    return sum(any(c.isalnum() for c in word) for word in page.read_text("utf-8").split())


def pages(nav: Any) -> Iterator[str]:
    """The files of a part of the contents, which is a name, a list, or a title with either."""
    if isinstance(nav, str):
        yield nav
    else:
        for part in nav.values() if isinstance(nav, dict) else nav:
            yield from pages(part)


def part(title: str) -> list[str]:
    (found,) = (entry[title] for entry in SITE["nav"] if title in entry)
    return list(pages(found))


def redirects() -> dict[str, str]:
    (found,) = (plugin["redirects"] for plugin in SITE["plugins"] if "redirects" in plugin and isinstance(plugin, dict))
    return found["redirect_maps"]


def test_the_guide_and_the_handbook_are_about_twenty_pages() -> None:
    assert len(part("Guide")) == 11 and len(part("Handbook")) == 10
    assert {*part("Handbook")} > LONGER


@pytest.mark.parametrize("page", [name for name in part("Guide") + part("Handbook") if name not in LONGER])
def test_a_page_has_at_most_2000_words(page: str) -> None:
    assert words(DOCS / page) <= PAGE


def test_the_readme_has_at_most_600_words() -> None:
    assert words(ROOT / "README.md") <= FRONT


def test_the_readme_and_all_pages_have_at_most_45000_words() -> None:
    counts = {str(page.relative_to(ROOT)): words(page) for page in (ROOT / "README.md", *DOCS.rglob("*.md"))}
    assert sum(counts.values()) <= ALL, sorted(counts.items(), key=lambda entry: -entry[1])[:12]


def test_every_page_beside_the_contents_is_gone() -> None:
    """Pages are in the contents; what was renamed or taken into another one is not left behind."""
    assert {page.name for page in DOCS.glob("*.md")} <= {*pages(SITE["nav"])}


@pytest.mark.parametrize(("old", "new"), redirects().items())
def test_an_old_name_leads_to_a_page_of_today(old: str, new: str) -> None:
    assert not (DOCS / old).exists() and (DOCS / new).is_file()
    assert new in {*pages(SITE["nav"])}


def digits(number: str) -> int:
    return len(re.sub(r"e.*|[.,]", "", number).lstrip("0"))


def test_the_numbers_of_the_readme_beside_other_libraries_are_rounded_from_the_page_of_measurements() -> None:
    """Each stands there in a row that begins with the name of its library."""
    head, _, *rows = [line for line in (ROOT / "README.md").read_text("utf-8").splitlines() if line.startswith("|")]
    measured = (DOCS / "measured.md").read_text("utf-8").splitlines()
    compared = 0
    for cells in (row.split("|")[1:-1] for row in rows if "measured.md" in row):
        for library, cell in zip(map(str.strip, head.split("|")[2:-1]), cells[1:], strict=True):
            lines = [line for line in measured if line.lstrip("| ").startswith(library)]
            there = [float(number.replace(",", "")) for line in lines for number in NUMBER.findall(line)]
            for shown in NUMBER.findall(cell):
                rounded = {float(f"{number:.{digits(shown)}g}") for number in there}
                assert float(shown.replace(",", "")) in rounded, f"{library}: {shown} is not on the page"
                compared += 1
    assert compared >= 20
