"""Where a joint has no speed limit no motion is timed, and no share of a speed is told, at any door."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.analysis.sheets import self_motion_between
from holokin.app.job import open_job, run_job
from holokin.app.report.job_report import strategy_verdicts
from holokin.base.errors import ArgumentError, JobError
from holokin.motion import hand_follower

Q0 = np.array([0.3, 0.8, -0.9])
SPEEDS = np.array([1.0, 1.5, 2.0])


def lacking(count: int) -> np.ndarray:
    """Which of three joints lack a limit: so many of them, drawn at random."""
    return np.random.default_rng(48).permutation(3) < count


MISSING = [lacking(count) for count in (1, 2, 3)]

GOOD = np.zeros(3, dtype=bool)
JOB = """
title = "a line"
[robot]
name = "planar-3r"
max_velocity = 1.5
[start]
q = [0.3, 0.8, -0.9]
[task]
kind = "position"
rows = [0, 1]
[path]
kind = "polyline"
points = [[0, 0, 0], [-0.2, -0.1, 0.0]]
relative = true
samples = 10
[timing]
profile = "quintic"
[strategies.a]
kind = "linear"
matrix = [[1.0, 0.0, -1.0]]
"""


def task_of(missing: np.ndarray) -> hk.Task:
    """The position of a planar arm of three hinges that lacks the speed limits of some."""
    arm = hk.with_limits(hk.load("planar-3r"), max_velocity=np.where(missing, np.inf, SPEEDS))
    return hk.position(arm, rows=(0, 1))


def walk_of(task: hk.Task) -> hk.motion.Trajectory:
    start = task.robot.pose(Q0)[:3, 3]
    return hk.follow(hk.holonomic(task, hk.linear([1, 0, -1])), hk.line(start, start - [0.2, 0.1, 0.0]), Q0, samples=20)


def mirrored(task: hk.Task) -> np.ndarray:
    """The other posture of the tool's position: the arm mirrored in the line from its base to its tool."""
    x, y = task.robot.pose(Q0)[:2, 3]
    return np.array([2 * np.arctan2(y, x), 0.0, 0.0]) - Q0


DOORS = {
    "its fastest": lambda task: hk.retime(walk_of(task), profile="quintic", acceleration=5.0),
    "the path's speed": lambda task: hk.retime(walk_of(task), profile="quintic", speed=1.0),
    "a hand": lambda task: hand_follower(hk.ik(hk.holonomic(task, hk.lock(2)), Q0), dt=0.01, max_acceleration=5.0),
    "a self-motion": lambda task: self_motion_between(task, Q0, mirrored(task)),
    "the least worst speed": lambda task: hk.design(
        task, BOX, Q0, degree=1, objective=hk.analysis.design.Objective(worst_speed=1.0), samples=8
    ),
}
BOX = hk.workspace(box=([1.7, 1.3, 0.0], [0.1, 0.1, 0.0]))


@pytest.mark.parametrize("door", DOORS)
def test_what_times_a_motion_asks_for_the_speed_limit_of_every_joint(door: str) -> None:
    DOORS[door](task_of(GOOD))
    for missing in MISSING:
        task = task_of(missing)
        names = ", ".join(name for name, gone in zip(task.robot.joint_names, missing, strict=True) if gone)
        with pytest.raises(ArgumentError, match=f"speed limit of {names} of .*not given"):
            DOORS[door](task)


@pytest.mark.parametrize("missing", MISSING)
def test_what_judges_a_speed_says_whose_it_cannot_tell(missing: np.ndarray) -> None:
    task = task_of(missing)
    names = ", ".join(name for name, gone in zip(task.robot.joint_names, missing, strict=True) if gone)
    walk = walk_of(task)
    assert f"cannot tell whether {names} can be so fast" in hk.check(walk, robot=task.robot).table()
    timed = hk.retime(walk, profile="quintic", acceleration=5.0, velocity=np.inf)
    assert np.isinf(timed.limits.velocity).all()
    assert "cannot tell" in hk.check(timed, robot=task.robot).table()
    assert "cannot tell" not in hk.check(walk, robot=task.robot, limits=False).table()
    assert "cannot tell" not in hk.check(walk_of(task_of(GOOD)), robot=task_of(GOOD).robot).table()
    found = hk.design(task, BOX, Q0, degree=1, samples=8).checked
    assert np.isnan(found.worst_speed)
    assert "speed limit" not in str(found)
    rates = hk.proof.JointRates(np.ones(3), np.zeros(3), task.robot.max_velocity)
    assert np.isnan(rates.tool_speed)
    assert replace(rates, limits=SPEEDS).tool_speed == pytest.approx(1.0)


def test_a_job_times_nothing_without_speed_limits_unless_it_is_told_to(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_text(JOB)
    kept = run_job(*open_job(str(tmp_path / "job.toml")))
    (tmp_path / "arm.urdf").write_text(
        hk.robot.to_urdf(hk.with_limits(hk.load("planar-3r"), max_velocity={"q2": np.inf}))
    )
    assert kept.strategies[0].metrics["peak_speed"] < 1.0
    text = JOB.replace('"planar-3r"\nmax_velocity = 1.5', '"arm.urdf"')
    (tmp_path / "job.toml").write_text(text)
    with pytest.raises(JobError, match=r"timing\.velocity.*q2"):
        run_job(*open_job(str(tmp_path / "job.toml")))
    (tmp_path / "job.toml").write_text(text.replace("[timing]", "[timing]\nvelocity = inf"))
    told = run_job(*open_job(str(tmp_path / "job.toml")))
    assert np.isnan(told.strategies[0].metrics["peak_speed"])
    assert "Cannot tell whether speed limits are kept" in str(strategy_verdicts(told))
