"""Timing: limits hold at 1 kHz, the time is that of toppra and of closed forms, the joints pass where they passed."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_START, sampled
from holokin.analysis.sheets import self_motion_between
from holokin.app.job import open_job, run_job
from holokin.app.report.job_report import strategy_verdicts
from holokin.base.errors import ArgumentError, JobError, ShapeError
from holokin.motion import TimedTrajectory, hand_follower
from holokin.motion.timing import Stretch, TimeScaling, time_optimal
from holokin.motion.trajectory import Trajectory

ACCELERATION, JERK = 10.0, 500.0
KEPT = 1e-9
"""Share by which a limit may be exceeded."""


@pytest.fixture(scope="module")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.fixture(scope="module")
def circle(panda: hk.Robot) -> Trajectory:
    """Two cycles of a Panda with a holonomic strategy."""
    G = hk.holonomic(hk.pose(panda), hk.linear([1, 0, -1, 0, 0, 0, 0]))
    start = panda.pose(PANDA_START)[:3, 3]
    return hk.follow(G, hk.circle(start, start - [0.1, 0.0, 0.0]), PANDA_START, samples=300, cycles=2)


@pytest.fixture(scope="module")
def square(panda: hk.Robot) -> Trajectory:
    G = hk.holonomic(hk.pose(panda), hk.linear([1, 0, -1, 0, 0, 0, 0]))
    start = panda.pose(PANDA_START)[:3, 3]
    corners = start + np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])
    return hk.follow(G, hk.polyline(corners, closed=True), PANDA_START, samples=160)


@pytest.fixture(scope="module")
def slide(ppr: hk.Robot) -> Trajectory:
    """The first joint of a PPR arm moves by 0.5 m; the others stand still."""
    G = hk.holonomic(hk.position(ppr), hk.lock(2))
    start = ppr.pose(PPR_START)[:3, 3]
    return hk.follow(G, hk.line(start, start + ppr.jacobian(PPR_START)[:3, 0] * 0.5), PPR_START, samples=20)


@pytest.fixture(scope="module")
def fastest(circle: Trajectory, panda: hk.Robot) -> TimedTrajectory:
    return hk.retime(circle, acceleration=ACCELERATION, cycles=1)


def assert_within(timed: TimedTrajectory) -> None:
    """Speeds and accelerations, by derivatives and as differences of what is played; jerks by derivatives."""
    assert max(timed.excess().values()) <= KEPT
    seen = timed.excess("difference")
    assert max(seen["velocity"], seen.get("acceleration", -1.0)) <= KEPT
    round_off = 8 * np.spacing(np.abs(timed.q).max()) / timed.dt**3 / timed.limits.jerk.min()
    assert seen.get("jerk", -1.0) <= round_off


def test_the_time_is_that_of_toppra_within_two_percent(fastest: TimedTrajectory, circle: Trajectory) -> None:
    """Its own spline through the same postures, its own constraints, on a finer grid."""
    toppra = pytest.importorskip("toppra")  # it has wheels for Linux alone
    from toppra import algorithm, constraint

    k = circle.marks[1] + 1
    limits = fastest.limits
    both = [np.column_stack([-x, x]) for x in (limits.velocity, limits.acceleration)]
    curve = toppra.SplineInterpolator(circle.t[:k], circle.q[:k])
    constraints = [constraint.JointVelocityConstraint(both[0]), constraint.JointAccelerationConstraint(both[1])]
    solver = algorithm.TOPPRA(
        constraints, curve, np.linspace(0, circle.t[k - 1], 3001), parametrizer="ParametrizeSpline"
    )
    optimum = solver.compute_trajectory(0, 0).duration
    assert 0.999 * optimum < fastest.duration < 1.005 * optimum  # 2 % are asked for


@sampled(2,
    "how",
    [
        {}, {"jerk": JERK}, {"endless": True}, {"jerk": JERK, "endless": True}, {"cycles": 5, "dt": 0.004},
        {"profile": "trapezoidal"}, {"profile": "trapezoidal", "jerk": JERK}, {"profile": "quintic", "jerk": JERK},
        {"speed": 1.5}, {"profile": "trapezoidal", "speed": 1.0, "endless": True},
    ],
    ids=str,
)  # fmt: skip
def test_no_limit_is_exceeded_and_the_ends_are_those_of_the_path_to_the_last_bit(
    how: dict[str, object], circle: Trajectory, panda: hk.Robot
) -> None:
    timed = hk.retime(circle, acceleration=ACCELERATION, **how)  # type: ignore[arg-type]
    assert_within(timed)
    assert (timed.q[0] == circle.q[0]).all()
    assert (timed.q[-1] == circle.q[-1 if len(timed.marks) == 3 else circle.marks[1]]).all()
    assert not timed.dq[[0, -1]].any()
    np.testing.assert_allclose(np.diff(timed.t), timed.dt, rtol=1e-9)
    if timed.loop is not None:
        first, last = timed.loop
        assert (timed.q[first] == timed.q[last]).all()
        np.testing.assert_allclose(timed.dq[last], timed.dq[first], atol=1e-6)
        assert np.abs(timed.dq[first]).max() > 0.1  # it runs on at speed


def test_derivatives_are_those_of_the_samples(fastest: TimedTrajectory) -> None:
    """Central differences; where the path acceleration jumps they are between the two values."""
    dq = np.gradient(fastest.q, fastest.dt, axis=0)
    assert np.abs(dq - fastest.dq)[1:-1].max() < 2 * ACCELERATION * fastest.dt
    ddq = np.gradient(fastest.dq, fastest.dt, axis=0)
    assert np.median(np.abs(ddq - fastest.ddq)) < 1e-3 * ACCELERATION
    smooth = hk.retime(fastest.untimed, acceleration=ACCELERATION, profile="quintic", cycles=1)
    for lower, upper in ((smooth.q, smooth.dq), (smooth.dq, smooth.ddq), (smooth.ddq, smooth.dddq)):
        error = np.gradient(lower, smooth.dt, axis=0) - upper
        assert np.abs(error)[2:-2].max() < 1e-4 * np.abs(upper).max()


def test_at_every_instant_some_joint_is_at_a_limit_of_the_fastest_motion(fastest: TimedTrajectory) -> None:
    limits = fastest.limits
    share = np.maximum(np.abs(fastest.dq) / limits.velocity, np.abs(fastest.ddq) / limits.acceleration).max(axis=1)
    assert np.quantile(share, 0.02) > 0.98


def test_the_tool_stays_on_its_circle(fastest: TimedTrajectory, panda: hk.Robot) -> None:
    points, _ = panda.pose_batch(fastest.q)
    center = panda.pose(PANDA_START)[:3, 3] - [0.1, 0.0, 0.0]
    assert np.abs(np.linalg.norm(points - center, axis=1) - 0.1).max() < 1e-8


def test_the_tool_keeps_the_speed_of_its_path_but_where_it_is_said(circle: Trajectory, panda: hk.Robot) -> None:
    timed = hk.retime(circle, acceleration=ACCELERATION, speed=6.0, cycles=1)  # 0.6 m/s
    points, _ = panda.pose_batch(timed.q)
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / timed.dt
    middle = timed.t[:-1] + timed.dt / 2
    slow = np.any([(s.start - timed.dt <= middle) & (middle <= s.stop + timed.dt) for s in timed.slowdowns], axis=0)
    assert 0.2 < slow.mean() < 0.8
    np.testing.assert_allclose(speed[~slow], 0.6, rtol=2e-3)
    assert speed.max() < 0.6 * (1 + 1e-5)
    assert {s.joint for s in timed.slowdowns} <= set(panda.joint_names)


@pytest.mark.campaign
def test_the_joints_rest_in_each_corner_exactly_there(square: Trajectory, panda: hk.Robot) -> None:
    assert len(square.corners) == 5  # the start is one of them
    timed = hk.retime(square, acceleration=ACCELERATION, profile="trapezoidal", cycles=2)
    assert_within(timed)
    assert len(timed.stops) == 7
    assert not timed.dq[list(timed.stops)].any()
    assert (timed.q[list(timed.stops)] == square.q[[*square.corners[1:], *square.corners[1:4]]]).all()


@pytest.mark.parametrize("v, a", [(0.2, 1.0), (5.0, 1.0)])
def test_one_joint_takes_the_time_of_the_closed_form(slide: Trajectory, ppr: hk.Robot, v: float, a: float) -> None:
    """L/v + v/a with a phase of constant speed, 2 sqrt(L/a) without."""
    wanted = 0.5 / v + v / a if v < np.sqrt(0.5 * a) else 2 * np.sqrt(0.5 / a)
    for profile, more in (("trapezoidal", 2e-2), ("time-optimal", 2e-3)):
        timed = hk.retime(slide, velocity=v, acceleration=a, profile=profile)
        assert wanted * (1 - 1e-9) <= timed.duration <= wanted * (1 + more), profile
    timed = hk.retime(slide, velocity=v, profile="quintic")
    assert timed.duration == pytest.approx(15 / 8 * 0.5 / v, abs=2e-3)  # its peak is 15/8 of its mean


def test_a_law_that_drifts_is_timed_as_a_whole(ppr: hk.Robot) -> None:
    center = PPR_CENTER
    loops = hk.circle(ppr.pose(PPR_START)[:3, 3], center)
    drifting = hk.follow(hk.moore_penrose(hk.position(ppr)), loops, PPR_START, samples=100, cycles=2)
    timed = hk.retime(drifting, velocity=1.0, acceleration=1.0, profile="trapezoidal")
    assert_within(timed)
    assert (timed.q[-1] == drifting.q[-1]).all()
    with pytest.raises(ArgumentError, match="does not end where it started"):
        hk.retime(drifting, velocity=1.0, acceleration=1.0, profile="trapezoidal", endless=True)


def test_the_table_names_each_joint_and_the_nearest_limit(fastest: TimedTrajectory, panda: hk.Robot) -> None:
    gap = np.minimum(fastest.q - panda.lower, panda.upper - fastest.q).min(axis=0)
    assert fastest.nearest_limit.joint == panda.joint_names[int(gap.argmin())]
    assert fastest.nearest_limit.distance == gap.min()
    lines = fastest.table().splitlines()
    assert [line.split()[0] for line in lines[2:9]] == list(panda.joint_names)
    assert max(load.shares[1] for load in fastest.loads) == pytest.approx(1.0, abs=5e-3)


def test_a_file_of_it_says_names_and_units(fastest: TimedTrajectory, tmp_path) -> None:
    fastest.save(tmp_path / "joints.csv")
    header, *rows = (tmp_path / "joints.csv").read_text("utf-8").splitlines()
    assert header.split(",")[:2] == ["time [s]", "panda_joint1 [rad]"]
    assert header.split(",")[-1] == "dd_panda_joint7 [rad/s^2]"
    read = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert (read[:, 1:8] == fastest.q).all()
    again = pickle.loads(pickle.dumps(fastest))
    assert (again.q == fastest.q).all()


@pytest.mark.parametrize(
    "how, says",
    [
        ({"acceleration": None}, "needs that of every joint"), ({"acceleration": -1.0}, "positive number"),
        ({"acceleration": 1.0, "jerk": [1.0, 2.0]}, "7 of them"), ({"acceleration": 1.0, "dt": 0.0}, "positive"),
        ({"acceleration": 1.0, "profile": "cubic"}, "time-optimal"), ({"acceleration": 1.0, "speed": 0.0}, "positive"),
        ({"acceleration": 1.0, "dt": 1e-9}, "longer"), ({"acceleration": 1.0, "cycles": 0}, "at least 1"),
        ({"profile": "quintic", "endless": True}, "not steady"),
    ],
    ids=str,
)  # fmt: skip
def test_senseless_limits_are_refused(how: dict[str, object], says: str, circle: Trajectory, panda: hk.Robot) -> None:
    with pytest.raises((ArgumentError, ShapeError), match=says):
        hk.retime(circle, **how)  # type: ignore[arg-type]


# --- The time-optimal law on random curves of joints: its time is that of toppra, and the limits hold on a finer grid.


SEEDS = [*range(4), *(pytest.param(k, marks=pytest.mark.campaign) for k in range(4, 120))]


def drawn(seed: int) -> tuple[Stretch, np.ndarray, np.ndarray, float]:
    """A curve of 1 to 8 joints, revolute and prismatic, some at rest, with limits of speed and acceleration; with or
    without a bound of ds/dt."""
    draw = np.random.default_rng(seed)
    n, k = int(draw.integers(1, 9)), int(draw.integers(8, 60))
    s = np.linspace(0, 10 ** draw.uniform(-1, 1.5), k)
    waves = np.sin(s[:, None] / s[-1] * draw.uniform(0.5, 12, n) + draw.uniform(0, 6, n))
    q = waves * 10 ** draw.uniform(-2, 0.5, n) * (draw.random(n) < 0.85) + s[:, None] * draw.normal(size=n) / s[-1]
    speed = 10 ** draw.uniform(-1, 1) if draw.random() < 0.5 else np.inf
    velocity = np.where(draw.random(n) < 0.8, 10 ** draw.uniform(-0.5, 1, n), np.inf)
    return Stretch(s, q), velocity, 10 ** draw.uniform(-0.5, 1.5, n), float(speed)


def by_toppra(
    stretch: Stretch, s: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, speed: float, mean: float
) -> float:
    """Seconds that toppra finds for the same curve on a grid s. It gets s / mean: it works best at rates near 1."""
    pytest.importorskip("toppra")  # it has wheels for Linux alone
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    base: Any = AbstractGeometricPath

    class Curve(base):  # with s as one more joint, whose speed is the rate
        dof = stretch.q.shape[1] + 1
        path_interval = np.array([0.0, stretch.length / mean])
        waypoints = None

        def __call__(self, s: Any, order: int = 0) -> np.ndarray:
            at = np.atleast_1d(np.asarray(s, dtype=float))
            more = (at, np.ones_like(at), np.zeros_like(at))[order]
            known = stretch.derivatives(np.minimum(mean * at, stretch.length))[order]
            found = np.column_stack([mean**order * known, more])
            return found if np.ndim(s) else found[0]

    most = np.minimum(np.append(velocity, speed / mean), 1e3)
    bounds = [np.column_stack([-x, x]) for x in (most, np.append(acceleration, 1e6))]
    constraints = [
        JointVelocityConstraint(bounds[0]),
        JointAccelerationConstraint(bounds[1], DiscretizationType.Interpolation),
    ]
    grid = s / mean
    rates: Any = TOPPRA(constraints, Curve(), gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0, 0)[
        1
    ]
    return float((2 * np.diff(grid) / (rates[:-1] + rates[1:])).sum())


@pytest.mark.parametrize("seed", SEEDS)
def test_no_law_is_faster_and_none_of_the_limits_is_exceeded(seed: int) -> None:
    stretch, velocity, acceleration, speed = drawn(seed)
    scaling: TimeScaling = time_optimal(stretch, 1, velocity, acceleration, np.full(len(velocity), np.inf), speed)
    _, (s, *rates) = scaling.within(20_000)
    _, dq, ddq, _ = stretch.motion(s, rates)
    assert rates[0].max() <= speed * (1 + 1e-9) and s[-1] == pytest.approx(stretch.length, rel=1e-12)
    assert (np.abs(dq) / velocity).max() < 1.01
    share = np.abs(ddq) / acceleration
    assert np.quantile(share.max(axis=1), 0.999) < 1.01  # between the points of the grid; `retime` slows down by that
    grid = np.append(scaling.c[0], stretch.length)
    optimum = by_toppra(stretch, grid, velocity, acceleration, speed, stretch.length / scaling.duration)
    assert scaling.duration == pytest.approx(optimum, rel=1e-3)


# --- Where a joint has no speed limit no motion is timed, and no share of a speed is told, at any door.


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
