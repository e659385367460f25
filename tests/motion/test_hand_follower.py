"""A hand followed within limits of speed, acceleration and jerk: whatever it does, and at rest where it belongs."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.base.errors import ArgumentError, JointLimitError, ShapeError
from holokin.motion import hand_follower
from holokin.motion.ik import InverseStatus

STARTS = {"panda": [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5], "iiwa14": [0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0]}


def hand(kind: str, p: np.ndarray, dt: float, rng: np.random.Generator) -> list[np.ndarray]:
    """Places of a hand: a smooth way out of reach and back, jumps, or trembling; then rest near the start."""
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)
    t = np.arange(int(1.5 / dt)) * dt
    if kind == "smooth":
        moved = p + 0.9 * np.sin(np.pi * t / 1.5)[:, None] ** 2 * away
    elif kind == "jumps":
        moved = p + np.where((t // 0.3 % 2)[:, None] > 0, 0.15 * away, 0.0)
    else:
        moved = p + 0.01 * rng.normal(size=(len(t), 3))
    rest = np.tile(p + 0.02 * rng.normal(size=3), (int(3.0 / dt), 1))
    return list(np.vstack([moved, rest]))


@pytest.mark.campaign
@sampled(1, "kind", ["smooth", "jumps", "noise"])
@pytest.mark.parametrize(("name", "dt"), [campaign(("name", "dt"), ("panda", 0.002)), ("iiwa14", 0.008)])
def test_joints_keep_their_limits_and_rest_where_the_hand_does(name: str, dt: float, kind: str) -> None:
    rng = np.random.default_rng([len(name), len(kind)])
    robot, q0 = hk.load(name), np.array(STARTS[name])
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock(2)), q0, limits=True)
    acceleration, jerk = rng.uniform(5.0, 15.0, 7), rng.uniform(200.0, 1000.0, 7)
    follow = hand_follower(ik, dt=dt, max_acceleration=acceleration, max_jerk=jerk).begin(q0)
    pose, Q, last = robot.pose(q0), [q0, q0, q0, q0], None
    for place in hand(kind, pose[:3, 3], dt, rng):
        wanted = pose.copy()
        wanted[:3, 3] = place
        last = follow(wanted)
        Q.append(last.q)
    Q = np.array(Q)
    for order, limit in ((1, robot.max_velocity), (2, acceleration), (3, jerk)):
        rates = np.abs(np.diff(Q, n=order, axis=0)) / dt**order
        assert (rates <= limit * (1 + 1e-6) + 1e-9 / dt**order).all(), (order, (rates / limit).max())
    assert (robot.beyond(Q).max(axis=1) <= 1e-9).all()
    assert last is not None and last.resting
    assert last.q == pytest.approx(ik(wanted), abs=1e-6)


def test_a_pose_that_is_none_keeps_the_last_target(panda: hk.Robot) -> None:
    q0 = np.array(STARTS["panda"])
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), q0)
    follow = hand_follower(ik, dt=0.01, max_acceleration=10.0).begin(q0)
    goal = panda.pose(q0)
    goal[0, 3] += 0.05
    for _ in range(100):
        found = follow(goal)
    lost = follow(np.full((4, 4), np.nan))
    assert lost.nearest.status is InverseStatus.NOT_FINITE
    assert lost.q == pytest.approx(found.q, abs=1e-9)


def test_limits_that_are_missing_or_none_are_told(panda: hk.Robot) -> None:
    q0 = np.array(STARTS["panda"])
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), q0)
    bare = hk.with_limits(panda, max_velocity=np.inf)
    bare_ik = hk.ik(hk.holonomic(hk.pose(bare), hk.lock(2)), q0)
    with pytest.raises(ArgumentError, match=r"hk\.with_limits"):
        hand_follower(bare_ik, dt=0.002, max_acceleration=10.0)
    with pytest.raises(ArgumentError, match="2 ms is"):
        hand_follower(ik, dt=2.0, max_acceleration=10.0)
    with pytest.raises(ArgumentError, match="positive"):
        hand_follower(ik, dt=0.002, max_acceleration=0.0)
    with pytest.raises(ShapeError):
        hand_follower(ik, dt=0.002, max_acceleration=[1.0, 2.0])
    with pytest.raises(JointLimitError):
        hand_follower(ik, dt=0.002, max_acceleration=10.0).begin(q0 + 10)
