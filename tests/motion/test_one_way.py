"""Paths that lead to a pose by one way only, and laws that stop: nothing is said of what was not compared or seen."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from conftest import sampled
from holokin.app.job import open_job, run_job
from holokin.app.report.job_report import print_result, rows, write_report
from holokin.app.report.job_result import JobResult
from holokin.motion.trajectory import Status

JOB = """
title = "a path"
[robot]
name = "planar-3r"
[start]
q = [0.3, 0.8, 0.5]
[path]
kind = "polyline"
points = {points}
relative = true
samples = 40
{more}
[strategies.pseudo-inverse]
kind = "moore-penrose"
[verdict]
samples = 8
[checks]
self_collision = false
limits = false
"""


def done(folder: Path, points: np.ndarray, more: str = "") -> JobResult:
    file = folder / "job.toml"
    file.write_text(JOB.format(points=[[*map(float, point), 0.0] for point in points], more=more))
    return run_job(*open_job(str(file)))


def written(result: JobResult, folder: Path) -> tuple[str, str, dict]:
    """The report, what is printed, and the facts."""
    at = write_report(result, folder, "0")
    out = io.StringIO()
    print_result(result, Console(file=out, width=300))
    facts = json.loads((at / "result.json").read_text("utf-8"))
    return (at / "report.html").read_text("utf-8"), out.getvalue(), facts


@pytest.mark.campaign
@sampled(1, "more", ["", "passes = 2", "closed = true"])
def test_a_path_is_not_compared_with_itself(more: str, tmp_path: Path) -> None:
    """Random points: an open path, the same to and fro, and closed. The pseudo-inverse depends on the way."""
    rng = np.random.default_rng(3)
    points = np.vstack([[0.0, 0.0], rng.uniform(-0.25, 0.0, (3, 2))])
    result = done(tmp_path, points, more)
    (strategy,) = result.strategies
    assert strategy.status is Status.COMPLETE
    page, printed, facts = written(result, tmp_path)
    compared = more == "closed = true"
    assert (strategy.two_paths is not None) == compared == np.isfinite(strategy.metrics["spread"])
    assert (rows(result)[0][3] == "-") != compared
    assert ("do not depend on the path" in page) == compared == (facts["two_paths"] == "compared")
    for text in (page, printed):
        assert ("Two paths were not compared: the path" in text) != compared
        assert ("draw a closed path whose halves" in text) != compared
    if compared:
        assert strategy.metrics["spread"] > 1e-6
    else:
        assert ("runs back on itself" in printed) == (more == "passes = 2")


@pytest.mark.campaign
@sampled(1, "far", [2.5, 6.0])
def test_a_check_of_a_law_that_stopped_says_what_it_saw_and_is_not_green(far: float, tmp_path: Path) -> None:
    """The arm reaches 3 m."""
    result = done(tmp_path, np.array([[0.0, 0.0], [far, 0.0], [0.0, 0.3]]), "closed = true")
    (strategy,) = result.strategies
    assert strategy.status is not Status.COMPLETE and strategy.motion_check is not None
    run = np.linalg.norm(np.diff(strategy.cycles.x[:, :2], axis=0), axis=1).sum()
    assert strategy.followed == pytest.approx(run / result.path.length, abs=0.01) and 0 < strategy.followed < 0.5
    page, printed, facts = written(result, tmp_path)
    said = f"only the first {strategy.followed:.1%} of the path was looked at: there the law stopped"
    assert said in printed and "<p class='no'>" in page and said in page
    assert "<p class='yes'>nothing found" not in page and not result.passed
    assert facts["strategies"][0]["followed"] == pytest.approx(strategy.followed)
    assert ("nothing found, but only" in page) == strategy.motion_check.passed
