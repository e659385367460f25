"""Jobs: the packaged ones show what the paper shows, a report is whole, and a copied job with a URDF works."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import campaign, urdf
from holokin.app.job import PAPER, expand, new_job, open_job, packaged_jobs, run_job
from holokin.app.job.metrics import METRICS
from holokin.app.job.schema import Bound, Job
from holokin.app.report import animation as films
from holokin.app.report.animation import animate
from holokin.app.report.job_figures import figures
from holokin.app.report.job_report import number, print_result, rows, write_report
from holokin.app.report.job_result import JobResult
from sketches import sketches

RESULTS = (Path(__file__).parents[3] / "docs" / "paper.md").read_text("utf-8")


@cache
def done(job: str) -> JobResult:
    """A packaged job, run once for all statements about it."""
    return run_job(*open_job(job))


@pytest.mark.parametrize("job", [campaign("job", job) if job == "orientation" else job for job in packaged_jobs()])
def test_every_packaged_job_shows_what_it_expects(job: str) -> None:
    result = done(job)
    assert result.passed, [c for s in result.strategies for c in s.checks if not c.passed]
    assert all(s.checks for s in result.strategies)
    assert {s.verdict.holonomic for s in result.strategies} == {True, False}
    for strategy in result.strategies:
        assert set(strategy.metrics) == set(METRICS)
        home = strategy.metrics["drift_total"] < 1e-9
        assert home is strategy.verdict.holonomic


@pytest.mark.parametrize("job", [campaign("job", job) if job == "orientation" else job for job in PAPER])
def test_the_tables_shown_are_what_the_jobs_print_today(job: str) -> None:
    """Every printed cell that is not round-off."""
    printed = [{cell.strip() for cell in line.split("│")} for line in RESULTS.splitlines() if "│" in line]
    for shown in rows(done(job)):
        wanted = [cell for cell in shown[1:] if not ("e-" in cell and float(cell) < 1e-9)]
        assert any(set(wanted) <= cells for cells in printed), wanted
    assert f"report: out/{job}/report.html" in RESULTS


def test_paper_is_the_name_of_four_jobs() -> None:
    assert expand(["paper", "panda-circle"]) == [*PAPER, "panda-circle"]
    assert set(PAPER) | {"panda-circle"} == set(packaged_jobs())


def test_an_expectation_that_is_wrong_fails(tmp_path: Path) -> None:
    name, job, file = open_job("irb140-half-square")
    wrong = job.expect | {
        "coupled": job.expect["coupled"].model_copy(update={"holonomic": False, "drift": Bound(above=1)})
    }
    wrong, laws = {"coupled": wrong["coupled"]}, {"coupled": job.strategies["coupled"]}
    result = run_job(name, job.model_copy(update={"expect": wrong, "strategies": laws}), file)
    failed = [c.metric for s in result.strategies for c in s.checks if not c.passed]
    assert failed == ["holonomic", "drift"]
    assert not result.passed


def test_a_report_is_one_folder_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = done("ppr-half-circle")
    result = replace(whole, strategies=whole.strategies[:2])
    folder = write_report(result, tmp_path / "out", "0")
    names = {p.name for p in folder.iterdir()}
    assert {"report.html", "result.json", "robot.png", "robot.svg", "paths-paper.png", "paper-clockwise.csv"} <= names
    facts = json.loads((folder / "result.json").read_text())
    assert facts["passed"] is True
    assert facts["strategies"][0]["metrics"]["spread"] == pytest.approx(0.1428034, abs=1e-6)
    assert facts["strategies"][0]["metrics"]["residual"] is None
    page = (folder / "report.html").read_text()
    assert not re.findall(r"(?:src|href)=['\"](?!data:)", page)  # self-contained
    assert page.count("<img") == len(list(folder.glob("*.png")))
    for strategy in result.strategies:
        assert strategy.name in page
    monkeypatch.setattr("holokin.app.report.job_report.figures", sketches)
    again = write_report(result, tmp_path / "out", "0")  # its own folder may be written again
    assert again == folder
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["ppr-half-circle"]


def test_figures_show_the_data_they_are_of() -> None:
    whole = done("ppr-cycle")
    result = replace(whole, strategies=whole.strategies[:2])
    made = {stem: figure for stem, _, figure in figures(result)}
    assert set(made) == {"robot", "cycles", "drift", "ranges", *(f"paths-{s.name}" for s in result.strategies)}
    pseudo = result.strategies[0]
    for joint, axes in enumerate(made["paths-moore-penrose"].axes[: pseudo.two_paths[0].q.shape[1]]):
        ends = [line.get_ydata()[-1] for line in axes.lines if "clockwise" in str(line.get_label())]
        assert ends == [walk.q[-1, joint] for walk in pseudo.two_paths]
        styles = [line.get_linestyle() for line in axes.lines if "clockwise" in str(line.get_label())]
        assert styles == ["-", "--"]  # clockwise solid, counter-clockwise dashed
    drift = made["drift"].axes[0].lines[0].get_ydata()
    assert drift == pytest.approx(np.abs(pseudo.cycles.drift_since_start()).max(axis=1))


def test_clockwise_is_clockwise() -> None:
    """From the circle's rightmost point, clockwise (seen against z) goes down first."""
    result = done("ppr-half-circle")
    clockwise, counter = result.strategies[0].two_paths
    assert clockwise.x[10, 1] < clockwise.x[0, 1]
    assert counter.x[10, 1] > counter.x[0, 1]


@pytest.mark.campaign
def test_films_without_ffmpeg_are_moving_gifs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL import Image

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(films, "WIDTH", 140)
    monkeypatch.setattr(films, "FRAMES", 10)
    name, job, file = open_job("ppr-cycle")
    path = job.path.model_copy(update={"cycles": 2, "samples": 60})
    laws = {"moore-penrose": job.strategies["moore-penrose"]}
    result = run_job(name, job.model_copy(update={"path": path, "strategies": laws, "expect": {}}), file)
    assert [file for file, _ in animate(result, tmp_path)] == ["cycles.gif", "paths.gif"]
    assert {p.name for p in tmp_path.iterdir()} == {"cycles.gif", "paths.gif"}
    with Image.open(tmp_path / "cycles.gif") as picture:
        assert picture.n_frames > 50
        first = np.asarray(picture.convert("RGB"), dtype=int)
        picture.seek(30)
        assert np.abs(np.asarray(picture.convert("RGB"), dtype=int) - first).max() > 50


@pytest.mark.campaign
def test_a_copied_job_pointed_at_a_urdf_gives_the_same_numbers(tmp_path: Path) -> None:
    file = tmp_path / "my-job.toml"
    new_job(file, "panda-circle")
    text = file.read_text().replace(
        'name = "panda"\n', f'name = "{urdf("panda.urdf").as_posix()}"\ntip = "panda_hand_tcp"\n', 1
    )
    file.write_text(text)
    name, job, path = open_job(str(file))
    result = run_job(name, job, path)
    assert name == "my-job"
    assert result.passed
    assert result.strategies[0].metrics["drift"] == pytest.approx(0.16348, abs=1e-5)


def test_a_robot_path_counts_from_the_job_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Path(hk.__file__).parent / "robot" / "data" / "ppr.toml"
    (tmp_path / "mine.toml").write_text(robot.read_text())
    job = tmp_path / "app.job.toml"
    new_job(job, "ppr-half-circle")
    job.write_text(job.read_text().replace('name = "ppr"', 'name = "mine.toml"'))
    monkeypatch.chdir("/")
    assert run_job(*open_job(str(job))).passed


def test_a_strategy_that_hits_a_limit_is_a_result_and_fails_unless_expected() -> None:
    name, job, file = open_job("panda-circle")
    path = job.path.model_copy(update={"cycles": 60, "samples": 40})
    strategies = {"moore-penrose": job.strategies["moore-penrose"]}
    long = job.model_copy(update={"path": path, "strategies": strategies, "expect": {}})
    result = run_job(name, long, file)
    assert result.strategies[0].status is hk.motion.Status.LIMIT
    assert "outside its limits" in result.strategies[0].trouble
    assert not result.passed
    table = job.expect["moore-penrose"].model_copy(update={"completes": False, "drift": None, "drift_total": None})
    assert run_job(name, long.model_copy(update={"expect": {"moore-penrose": table}}), file).passed


def test_an_open_path_has_no_ways_and_no_drift() -> None:
    name, job, file = open_job("ppr-half-circle")
    arc = {"kind": "arc", "center": [1.2070, 0.4036], "angle_deg": 90, "samples": 50}
    table = job.model_dump(exclude_defaults=True) | {"path": arc, "expect": {}}
    result = run_job(name, Job.model_validate(table), file)
    assert result.strategies[0].two_paths is None
    assert np.isnan(result.strategies[0].metrics["spread"])
    assert {stem for stem, _, _ in figures(result)} == {"robot", "ranges"}


def test_the_table_says_it_all() -> None:
    from io import StringIO

    from rich.console import Console

    result = done("ppr-half-circle")
    text = StringIO()
    print_result(result, Console(file=text, width=120))
    for word in (
        "NOT holonomic",
        "holonomic",
        "drift / cycle",
        "[m or rad]",
        "two paths apart",
        "tracking",
        "sigma",
        "speed",
        "peak",
        "0.143",
    ):
        assert word in text.getvalue()
    assert number(float("nan")) == "-"


def test_bounds() -> None:
    assert Bound(above=1, below=2).holds(1.5)
    assert not Bound(above=1, below=2).holds(2.5)
    assert not Bound(below=2).holds(float("nan"))
    assert Bound(value=1, within=0.1).holds(1.05)
    assert not Bound(value=1, within=0.1).holds(1.2)
    assert "+-" in str(Bound(value=1, within=0.1))
