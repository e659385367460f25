"""Jobs with a [sheets] table: what `holokin run` finds, shows and writes, and the map that it reads."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partialmethod
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import holokin as hk
from conftest import Command, assert_refused, write_job
from handmade_sheets import LIMIT, map_of, planar_task
from holokin.analysis.audit.logs import read_recording
from holokin.analysis.sheets import PoseRest, Sheet, Sheets
from holokin.app.job import open_job, run_job
from holokin.app.job.runner import saved_map
from holokin.app.report.job_figures import figures
from holokin.app.report.job_report import whole_verdict, write_report
from holokin.app.report.job_result import JobResult
from holokin.app.report.sheets_plots import sheet_motion_figure
from holokin.base.errors import JobError
from sketches import Sketch

PARTS = {
    "robot": f'[robot]\nname = "planar-3r"\nlower = {-LIMIT}\nupper = {LIMIT}\n',
    "start": "[start]\nq = [-1.1, 0.9, 0.7]\n",
    "path": '[path]\nkind = "circle"\ncenter = [0, 0]\nsamples = 24\n',
    "workspace": '[workspace]\nkind = "cylinder"\ncenter = [0, 0]\nradius = 3\nhalf_height = 0\n'
    "samples = 20\nslices = 0\n",
    "sheets": '[sheets]\nsamples = 60\nshare = 0.9\nfile = "map.npz"\n',
    "strategies": '[strategies.lock]\nkind = "lock"\njoints = [2]\n[expect.lock]\ncompletes = false\n',
}
"""A circle round the base, which no strategy can close: no joint turns so far."""


@pytest.fixture(scope="module")
def mapped() -> Sheets:
    """Two sheets: q2 = q3 with the elbows to one side and to the other."""
    task = hk.position(hk.with_limits(hk.load("planar-3r"), lower=-LIMIT, upper=LIMIT))
    disc = hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0))
    tied = hk.holonomic(task, hk.linear([0, 1, -1]))
    return map_of(task, disc, [Sheet(tied, np.array(q)) for q in ([0.2, 0.9, 0.9], [0.4, -0.9, -0.9])], 60)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, mapped: Sheets) -> Path:
    """A job, and the map that it names."""
    place = tmp_path_factory.mktemp("job")
    keys = {"kind": "linear", "matrix": [[0, 1, -1]]}
    named = replace(mapped, sheets=tuple(replace(one, keys=keys) for one in mapped.sheets))
    hk.analysis.sheets.write_sheets(named, place / "map.npz")
    write_job(place, **PARTS)
    return place


@pytest.fixture(scope="module")
def result(folder: Path) -> JobResult:
    """With 80 samples of the path: in all that two sheets have in common a change may be as fast."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sheets, "follow", partialmethod(Sheets.follow, samples=80))
        return run_job(*open_job(str(folder / "job.toml")))


def test_a_saved_map_answers_in_a_job_as_where_it_was_made(folder: Path, mapped: Sheets) -> None:
    _, job, file = open_job(str(folder / "job.toml"))
    found = saved_map(job, mapped.task, file)
    assert found is not None
    for point in ([0.4, -1.3], [1.5, 0.8], [-2.0, 0.1]):
        (sheet, q), (other, p) = mapped(point), found(point)
        assert sheet == other
        np.testing.assert_allclose(q, p, atol=1e-9)


def test_a_circle_round_the_base_is_served_by_sheets_and_divided_where_the_base_cannot_go_on(result: JobResult) -> None:
    over = result.sheets
    assert over is not None and over.along is not None
    assert over.passed and result.exit_code == 0
    assert len(over.along.left_out) == 0
    assert over.along.changes + len(over.along.divisions) >= 1
    total = sum(one.stop - one.start for one in over.along.pieces)
    assert total == pytest.approx(1.0)
    robot = over.found.task.robot
    radius = np.linalg.norm(hk.position(robot)([-1.1, 0.9, 0.7]))
    for walk in over.motions.values():
        tools = np.array([robot.pose(q)[:3, 3] for q in walk.q])
        np.testing.assert_allclose(np.linalg.norm(tools, axis=1), radius, atol=1e-6)
        assert robot.within(walk.q).all()
    assert "sheets are to serve" in whole_verdict(result)


def of_sheets(result: JobResult) -> list[tuple[str, str, Any]]:
    """The figures of a job, the other ones than those of its sheets as sketches."""
    return [
        (stem, caption, figure if stem.startswith("sheets") else Sketch()) for stem, caption, figure in figures(result)
    ]


def test_the_report_says_and_draws_what_the_sheets_do_and_keeps_map_and_motion(
    out: Path, result: JobResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("holokin.app.report.job_report.figures", of_sheets)
    place, over = write_report(result, out, "0"), result.sheets
    assert over is not None and over.along is not None
    page = re.sub(r"data:image/svg[^']*", "", (place / "report.html").read_text("utf-8"))
    assert "<h2>Sheets</h2>" in page and "the map was read from map.npz" in page
    assert f"{over.along.changes} change" in page and f"{len(over.along.divisions)} division" in page
    for one in over.along.divisions:
        assert one.reason in page
    assert (place / "sheets.png").stat().st_size > 10_000 and (place / "sheets-joints.png").stat().st_size > 10_000
    facts = json.loads((place / "result.json").read_text("utf-8"))["sheets"]
    assert facts["passed"] and facts["share"] == over.found.share
    assert len(facts["path"]["divisions"]) == len(over.along.divisions)
    for name, walk in over.motions.items():
        np.testing.assert_allclose(read_recording(place / f"{name}.csv", over.found.task.robot).q, walk.q, atol=1e-9)
    again = hk.read_sheets(place / "sheets.npz", over.found.task)
    assert len(again) == len(over.found)


@pytest.mark.usefixtures("sketched")
def test_a_share_of_sheets_that_is_not_reached_fails_the_job(folder: Path, out: Path, holokin: Command) -> None:
    task = hk.position(hk.with_limits(hk.load("planar-3r"), lower=-LIMIT, upper=LIMIT))
    whole = hk.read_sheets(folder / "map.npz", task)
    less = whole.labels != 0
    assert less.sum() > 0.1 * len(less)
    rest = np.where(less, int(PoseRest.NOT_COVERED), whole.rest)
    half = replace(whole, sheets=whole.sheets[:1], q=whole.q[:1], labels=np.where(less, -1, whole.labels), rest=rest)
    hk.analysis.sheets.write_sheets(half, folder / "half.npz")
    file = write_job(folder, "half.toml", **(PARTS | {"sheets": PARTS["sheets"].replace("map", "half")}))
    run = holokin("run", file, "--out", out)
    assert run.code == 1 and "is not reached" in run.out and "the job's path:" in run.out
    assert not json.loads((out / "half" / "result.json").read_text("utf-8"))["passed"]


def test_the_picture_of_a_motion_has_a_line_for_each_change_and_division(result: JobResult) -> None:
    over = result.sheets
    assert over is not None and over.along is not None
    figure = sheet_motion_figure(over.along, result.robot)
    axes, bar = figure.axes
    upright = [line for line in axes.lines if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2]
    assert len(upright) == over.along.changes + len(over.along.divisions)
    assert len(bar.patches) == len(over.along.pieces) + len(over.along.left_out)


def test_a_map_that_is_missing_or_of_another_robot_is_refused_before_the_work(
    folder: Path, out: Path, holokin: Command
) -> None:
    missing = write_job(folder, "missing.toml", **(PARTS | {"sheets": '[sheets]\nfile = "none.npz"\n'}))
    assert_refused(holokin("run", missing, "--out", out), "sheets.file", "none.npz", "holokin sheets")
    narrow = PARTS["robot"].replace(f"lower = {-LIMIT}", "lower = -0.5")
    other = write_job(folder, "other.toml", **(PARTS | {"robot": narrow, "start": "[start]\nq = [0.3, 0.9, 0.7]\n"}))
    with pytest.raises(JobError, match=r"sheets\.file"):
        run_job(*open_job(str(other)))


# --- A job's path over its sheets as a robot program: with its change at rest, or refused with the reason.

RAY = {
    "robot": f'[robot]\nname = "planar-3r"\nlower = {-LIMIT}\nupper = {LIMIT}\n',
    "start": "[start]\nq = [0.0, 0.3, 0.3]\n",
    "path": '[path]\nkind = "polyline"\npoints = [[2.7, 0], [0.5, 0]]\nspeed = 0.6\nentry = "joints"\n',
    "timing": "[timing]\nacceleration = 5\ndt = 0.02\n",
    "strategies": '[strategies.lock]\nkind = "lock"\njoints = [2]\n',
    "sheets": '[sheets]\nfile = "map.npz"\n',
}
"""Along a ray from far to near: with q3 = 0.3 the arm reaches from 1.0 to 3.0 m, with q3 = 2.4 from 0.3 to 1.7 m."""


def ray_job(folder: Path, starts: Sequence[Sequence[float]], **changed: str) -> Path:
    """A job with a map of sheets on which q3 is locked, through some postures."""
    task = planar_task()
    lock, keys = hk.holonomic(task, hk.lock(2)), {"kind": "lock", "joints": [2]}
    sheets = [Sheet(lock, np.array(q), keys=keys) for q in starts]
    hk.analysis.sheets.write_sheets(
        map_of(task, hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0)), sheets, 40), folder / "map.npz"
    )
    return write_job(folder, **(RAY | changed))


BOTH = ([-0.6, 0.9, 0.3], [-0.6, 0.9, 2.4])


def test_the_program_goes_along_the_path_and_changes_its_sheet_with_the_tool_at_rest(
    tmp_path: Path, holokin: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Sheets, "follow", partialmethod(Sheets.follow, samples=100))  # of 500: so many are looked at
    run = holokin("export", "ros", ray_job(tmp_path, BOTH), "--sheets", "--out", tmp_path / "program")
    assert run.code == 0, run.err
    assert "2 sheets, 1 change, 0 divisions" in run.out and "the motion begins at" in run.out
    message = yaml.load((tmp_path / "program" / "joint_trajectory.yaml").read_text("utf-8"), yaml.CSafeLoader)
    points = message["points"]
    Q = np.array([point["positions"] for point in points])
    t = np.array([point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points])
    robot = planar_task().robot
    x, y = np.array([robot.pose(q)[:2, 3] for q in Q]).T
    np.testing.assert_allclose(y, 0, atol=1e-5)
    assert x[0] == pytest.approx(2.7, abs=1e-6) and x[-1] == pytest.approx(0.5, abs=1e-6)
    assert Q[0, 2] == pytest.approx(0.3) and Q[-1, 2] == pytest.approx(2.4)
    between = (Q[:, 2] > 0.35) & (Q[:, 2] < 2.35)
    assert between.sum() > 5
    assert np.ptp(x[between]) < 1e-5  # q3 turns while the tool rests
    assert robot.within(Q).all()
    rates = np.abs(np.diff(Q, axis=0)) / np.diff(t)[:, None]
    assert (rates <= robot.max_velocity * (1 + 1e-5)).all()


@pytest.mark.campaign
def test_a_divided_path_has_no_program_and_the_reason_is_said(tmp_path: Path, holokin: Command) -> None:
    round_base = '[path]\nkind = "circle"\ncenter = [0, 0]\nsamples = 40\n'  # q1 cannot go on
    file = ray_job(
        tmp_path, ([0.9, 0.9, 0.3], [-0.9, -0.9, -0.3]), path=round_base, start="[start]\nq = [0.0, 0.9, 0.9]\n"
    )
    run = holokin("export", "ros", file, "--sheets", "--out", tmp_path / "none")
    assert_refused(run, "divided at", "limits")
    alone = ray_job(tmp_path, BOTH[:1])
    run = holokin("export", "ros", alone, "--sheets", "--out", tmp_path / "none")
    assert_refused(run, "left out", "no sheet serves its poses")
    assert not (tmp_path / "none").exists()


def test_what_sheets_cannot_do_is_refused_by_name(tmp_path: Path, holokin: Command) -> None:
    file = ray_job(tmp_path, BOTH, sheets="")
    assert_refused(holokin("export", "ros", file, "--sheets", "--out", tmp_path / "none"), "[sheets]", "--strategy")
    both = holokin("export", "ros", file, "--sheets", "--strategy", "lock", "--out", tmp_path / "none")
    assert_refused(both, "--strategy", "leave one out")
