"""The built site: every public name has its place, and errors in docstrings become cross references."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import holokin as hk
from conftest import sampled

ROOT = Path(__file__).parents[2]
SHOWN = {name for name in hk.__all__ if not isinstance(getattr(hk, name), ModuleType)}
ROOMS = (
    "analysis.audit", "analysis.audit.logs", "analysis.coverage", "analysis.curvature", "analysis.design",
    "analysis.sheets", "export", "learning", "motion", "motion.checks", "motion.control", "motion.ik", "path", "proof",
    "robot", "strategies", "strategies.constraints", "strategies.tasks",
)  # fmt: skip
"""Folders whose names are on pages of their own."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built strictly: no broken link, no page outside the contents, no docstring that cannot be read.

    Without an index for the search, and with signatures on one line each: breaking them takes a process for each.
    """
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings_handlers.python")
    folder = tmp_path_factory.mktemp("site")
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    for whole, short in (("  - search\n", ""), ("line_length: 80\n", "line_length: 9999\n")):
        assert settings.count(whole) == 1
        settings = settings.replace(whole, short)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder), "--config-file", "-"]
    done = subprocess.run(command, cwd=ROOT, input=settings, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.campaign
def test_every_name_of_every_room_is_on_its_page(site: Path) -> None:
    for room in ROOMS:
        name = room.split(".")[-1]
        page = (site / "api" / name / "index.html").read_text("utf-8")
        exported = importlib.import_module(f"holokin.{room}").__all__
        missing = [name for name in exported if f'id="holokin.{room}.{name}"' not in page]
        assert not missing, f"{room}: {missing}: a docstring is missing, or docs/api/{name}.md leaves it out"


@pytest.mark.campaign
def test_every_core_name_is_in_the_overview_and_leads_somewhere(site: Path) -> None:
    """A cross reference that leads nowhere would have failed the strict build; here it must be one."""
    page = (site / "api" / "index.html").read_text("utf-8")
    linked = set(re.findall(r'href="[^"]+#holokin[^"]+"><code>hk\.(\w+)</code></a>', page))
    assert linked == SHOWN


@pytest.mark.campaign
def test_errors_in_docstrings_become_a_list_of_cross_references(site: Path) -> None:
    page = (site / "api" / "constraints" / "index.html").read_text("utf-8")
    part = page[page.index('id="holokin.strategies.constraints.posture_cost"') :]
    part = part[: part.index('id="holokin.strategies.constraints.stack"')]
    for error in ("NotFiniteError", "ArgumentError", "ShapeError"):
        assert f'href="../errors/#holokin.base.errors.{error}"' in part, error


@pytest.mark.campaign
def test_brackets_of_a_formula_are_no_links(site: Path) -> None:
    """[G v, G e](q(t)) is a vector field at a posture."""
    page = (site / "theory" / "index.html").read_text("utf-8")
    assert "[G v, G e](q(t)) dt" in page
    assert 'href="q(t)' not in page


@sampled(1, "name", ["self_motion", "leaf_on_self_motions", "planar_loops", "leaves"])
def test_a_picture_of_the_concepts_can_be_drawn_again(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import pictures

    monkeypatch.setattr(pictures, "OUT", tmp_path)
    getattr(pictures, name)()
    (drawn,) = tmp_path.glob("*.png")
    assert drawn.stat().st_size > 0.5 * (ROOT / "docs" / "pictures" / drawn.name).stat().st_size
