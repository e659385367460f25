"""Timing: limits hold at 1 kHz, the time is that of toppra and of closed forms, the joints pass where they passed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_START, sampled
from holokin.base.errors import ArgumentError, ShapeError
from holokin.motion import TimedTrajectory
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
