"""Figures can be read on a page: no letter is too small after a figure is made as narrow as the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import drift
from benchmarks.drift import COLORS, drift_picture
from benchmarks.league.league_page import league_figure
from benchmarks.league.played import ENTRIES, Played
from benchmarks.league.scores import Score
from matplotlib.figure import Figure
from matplotlib.text import Text

import holokin as hk
from conftest import campaign, sampled
from holokin.analysis.coverage import coverage_slices
from holokin.app.report.job_figures import figures
from holokin.app.report.plots import region_figure, write_figure
from holokin.app.report.section import drawn
from holokin.app.report.sheets_plots import coverage_figure
from holokin.app.survey import Findings
from holokin.app.survey import coverage_figure as map_of_laws
from holokin.app.survey.findings import boxes_figure, drift_figure, survival_figure
from holokin.app.survey.one_case import METRICS
from short_jobs import shortened

PAGE = 700 / 96
"""Inches: 700 pixels of CSS, of which an inch has 96."""

SMALLEST = 7.99
"""Points."""


def smallest(figure: Any) -> tuple[float, str]:
    """The size [points] of the smallest letters on the page, with their text."""
    figure.canvas.draw()
    share = min(1.0, PAGE / figure.get_figwidth())
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    return min((share * text.get_fontsize(), text.get_text()) for text in shown)


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, str]]:
    """The smallest letters of each figure that is written from now on."""
    found: list[tuple[float, str]] = []
    write = Figure.savefig

    def measured(figure: Figure, *given: Any, **how: Any) -> None:
        found.append(smallest(figure))
        write(figure, *given, **how)

    monkeypatch.setattr(Figure, "savefig", measured)
    return found


def a_survey() -> Findings:
    """Cases of eleven laws on thirty arms, with every number that a figure shows."""
    rng, rows = np.random.default_rng(0), []
    for robot in range(30):
        for law in range(11):
            rows.append(dict.fromkeys(METRICS, 0.0) | {
                "robot": f"arm_{robot}_of_a_long_name left_gripper", "law": f"law {law} with feedback",
                "status": ("complete", "limit")[law % 2], "drift_last": float(10 ** rng.uniform(-12, 0)),
                "cost": float(1 + rng.random()), "margin": float(rng.random()), "cycles": float(robot),
            })  # fmt: skip
    return Findings.of(rows)


def a_league() -> list[Played]:
    """Every library as its example, off the path, and at its best, on two arms."""
    kept = {"later": 0.0, "tracking": 0.1, "turn": 0.0, "within": True, "hurry": 0.5, "call_us": 20.0}
    played = []
    for k, entry in enumerate(ENTRIES):
        scores = []
        for arm in ("panda", "iiwa14"):
            scores.append(Score(entry.name, "as shown", True, arm, **kept | {"ways": 10.0**-k}))
            scores.append(Score(entry.name, "soft", True, arm, **kept | {"ways": 10.0**-k, "tracking": 30.0}))
            scores.append(Score(entry.name, "tuned", False, arm, **kept | {"ways": 10.0 ** -(k + 2)}))
        played.append(Played(entry, scores=tuple(scores)))
    return played


def a_drift_benchmark() -> list[drift.Row]:
    """Thirty laws, six of each kind."""
    kinds = [kind for kind in COLORS for _ in range(6)]
    same = {"first": 1.0, "later": 1.0, "speeds": 0.1, "tracking": 1.0, "effort": 1.0, "within": True}
    return [
        drift.Row(f"a law of a rather long name, {k}", kind, ways=10.0**-k, history=np.full(10, 10.0**-k), **same)
        for k, kind in enumerate(kinds)
    ]


@pytest.mark.campaign
@pytest.mark.parametrize("draw", [lambda: league_figure(a_league()), lambda: drift_picture(a_drift_benchmark())])
def test_the_pictures_of_the_benchmarks_can_be_read_on_a_page(
    draw: Any, tmp_path: Path, saved: list[tuple[float, str]]
) -> None:
    write_figure(draw, tmp_path / "benchmark.png")
    assert len(saved) == 1
    assert min(saved)[0] > SMALLEST, min(saved)


@pytest.mark.parametrize(
    ("job", "laws"), [("ppr-cycle", 1), *(campaign(("job", "laws"), (job, 3)) for job in ("ppr-cycle", "panda-circle"))]
)
def test_the_pictures_of_a_job_can_be_read_on_a_page(job: str, laws: int) -> None:
    whole = shortened(job, samples=20)
    for stem, _, figure in figures(replace(whole, strategies=whole.strategies[:laws])):
        size, text = smallest(figure)
        assert size > SMALLEST, (stem, text)


@pytest.mark.campaign
def test_the_pictures_of_a_workspace_and_of_a_region_can_be_read_on_a_page(
    tmp_path: Path, saved: list[tuple[float, str]]
) -> None:
    law = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([[0.3, 0, 1]]))
    box, q0 = hk.workspace(box=([0.8, 1.2], [2.0, 2.0])), [0.3, 0.9, 0.7]
    found = hk.unique_region(law, q0, box, limits=False)
    covers, slices = hk.coverage(law, box, q0, samples=16), coverage_slices(law, box, q0, steps=4)
    write_figure(lambda: region_figure(found, 8), tmp_path / "region.png")
    drawn(lambda: coverage_figure(covers, slices), "coverage")
    assert len(saved) == 2
    assert min(saved)[0] > SMALLEST, min(saved)


@pytest.mark.campaign
@sampled(1, "draw", [drift_figure, survival_figure, map_of_laws, boxes_figure])
def test_the_pictures_of_a_survey_can_be_read_in_a_report_and_in_a_notebook(
    draw: Any, saved: list[tuple[float, str]]
) -> None:
    found = a_survey()
    drawn(lambda: draw(found), "survey")
    draw(found)._repr_png_()
    assert len(saved) == 2
    assert min(saved)[0] > SMALLEST, min(saved)


def test_a_figure_wider_than_the_page_has_larger_letters(tmp_path: Path, saved: list[tuple[float, str]]) -> None:
    def wide() -> Figure:
        figure = Figure(figsize=(14.6, 4.0))
        axes = figure.subplots()
        axes.plot([0, 1], label="small")
        axes.tick_params(labelsize=5)
        axes.text(0.5, 0.5, "tiny", fontsize=3)
        axes.legend(fontsize=4)
        return figure

    write_figure(wide, tmp_path / "wide.png")
    drawn(wide, "wide")
    assert [size for size, _ in saved] == pytest.approx([8.0, 8.0], abs=0.02)
    assert smallest(wide())[0] < 2.0
