"""The pages as a whole: none longer than a reader bears, and old names of pages lead to the new ones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
FRONT, PAGE, ALL = 600, 2_000, 45_000
"""Words at most, as `wc -w` counts them: of the README, of a page of guide or handbook, of README and all pages."""
LONGER = {"job-keys.md", "measured.md", "references.md", "theory.md"}
"""Pages in which one looks something up."""


def words(page: Path) -> int:
    return len(page.read_text("utf-8").split())


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
