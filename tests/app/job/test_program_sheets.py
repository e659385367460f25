"""A job's path over its sheets as a robot program: with its change at rest, or refused with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partialmethod
from pathlib import Path

import numpy as np
import pytest
import yaml

import holokin as hk
from conftest import Command, assert_refused, write_job
from handmade_sheets import LIMIT, map_of, planar_task
from holokin.analysis.sheets import Sheet, Sheets

PARTS = {
    "robot": f'[robot]\nname = "planar-3r"\nlower = {-LIMIT}\nupper = {LIMIT}\n',
    "start": "[start]\nq = [0.0, 0.3, 0.3]\n",
    "path": '[path]\nkind = "polyline"\npoints = [[2.7, 0], [0.5, 0]]\nspeed = 0.6\nentry = "joints"\n',
    "timing": "[timing]\nacceleration = 5\ndt = 0.02\n",
    "strategies": '[strategies.lock]\nkind = "lock"\njoints = [2]\n',
    "sheets": '[sheets]\nfile = "map.npz"\n',
}
"""Along a ray from far to near: with q3 = 0.3 the arm reaches from 1.0 to 3.0 m, with q3 = 2.4 from 0.3 to 1.7 m."""


def job(folder: Path, starts: Sequence[Sequence[float]], **changed: str) -> Path:
    """A job with a map of sheets on which q3 is locked, through some postures."""
    task = planar_task()
    law, keys = hk.holonomic(task, hk.lock(2)), {"kind": "lock", "joints": [2]}
    sheets = [Sheet(law, np.array(q), keys=keys) for q in starts]
    hk.analysis.sheets.write_sheets(
        map_of(task, hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0)), sheets, 40), folder / "map.npz"
    )
    return write_job(folder, **(PARTS | changed))


BOTH = ([-0.6, 0.9, 0.3], [-0.6, 0.9, 2.4])


def test_the_program_goes_along_the_path_and_changes_its_sheet_with_the_tool_at_rest(
    tmp_path: Path, holokin: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Sheets, "follow", partialmethod(Sheets.follow, samples=100))  # of 500: so many are looked at
    run = holokin("export", "ros", job(tmp_path, BOTH), "--sheets", "--out", tmp_path / "program")
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
    file = job(tmp_path, ([0.9, 0.9, 0.3], [-0.9, -0.9, -0.3]), path=round_base, start="[start]\nq = [0.0, 0.9, 0.9]\n")
    run = holokin("export", "ros", file, "--sheets", "--out", tmp_path / "none")
    assert_refused(run, "divided at", "limits")
    alone = job(tmp_path, BOTH[:1])
    run = holokin("export", "ros", alone, "--sheets", "--out", tmp_path / "none")
    assert_refused(run, "left out", "no sheet serves its poses")
    assert not (tmp_path / "none").exists()


def test_what_sheets_cannot_do_is_refused_by_name(tmp_path: Path, holokin: Command) -> None:
    file = job(tmp_path, BOTH, sheets="")
    assert_refused(holokin("export", "ros", file, "--sheets", "--out", tmp_path / "none"), "[sheets]", "--strategy")
    both = holokin("export", "ros", file, "--sheets", "--strategy", "lock", "--out", tmp_path / "none")
    assert_refused(both, "--strategy", "leave one out")
