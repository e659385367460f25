"""All postures at a pose on a leaf: each is there, within the limits, and the one that was asked with is among them."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError, HolokinError
from holokin.symbolic import wrapped

TASKS = {
    "yumi-arm": hk.pose,
    "panda": hk.pose,
    "iiwa14": hk.pose,
    "planar-3r": hk.position,
    "ppr": hk.position,
}


def laws(name: str, rng: np.random.Generator) -> list[hk.Strategy]:
    """A strategy for each kind of dependence on whole turns: none, on one joint, on sums, on half turns, on all."""
    task = TASKS[name](hk.load(name))
    n, j = task.n, int(rng.integers(task.n))
    whole, half = rng.integers(-2, 3, n).astype(float), rng.normal(size=n)
    whole[j], a, b = 1.0, *rng.choice(n, 2, replace=False)
    made = [
        hk.holonomic(task, g)
        for g in (
            hk.lock(j),
            hk.linear(whole),
            hk.linear(half),
            hk.custom(lambda q: 0.5 * q[int(a)] + 0.3 * q[int(b)] ** 2, name="half turns"),
            hk.custom(lambda q: q[int(a)] + q[int(b)], angular=True, name="an angle"),
        )
    ]
    return [*made, hk.holonomic(task, hk.arm_angle())] if n == 7 else made


@sampled(2, "name", TASKS)
@pytest.mark.parametrize("seed", range(1))
def test_every_posture_that_is_found_is_on_the_leaf_and_at_the_pose_and_q_is_among_them(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(name)])
    made = laws(name, rng)
    for law in rng.permutation(np.array(made, dtype=object))[: 2 if made[0].task.n == 7 else None]:
        task, robot = law.task, law.task.robot
        low, high = np.maximum(robot.lower, -6.0), np.minimum(robot.upper, 6.0)
        q = rng.uniform(low, high)
        try:
            if np.linalg.cond(np.vstack([task.jacobian(q), law.rows(q)])) > 1e3:
                continue
            c = law.g(q)
        except HolokinError:
            continue
        for limits, near in ((False, None), (True, None), (True, q), (False, q)):
            found = hk.motion.ik.all_postures(law, robot.pose(q), c, limits=limits, near=near, starts=256)
            for i, one in enumerate(found.q):
                assert np.abs(law.constraint.nearest(law.g(one) - c)).max() < 1e-8 * (1 + np.abs(c).max()), law.name
                assert np.abs(task.error(one, *task._place(q))).max() < 1e-8
                others = np.where(robot.hinges, wrapped(found.q[:i] - one), found.q[:i] - one)
                assert not len(others) or np.abs(others).max(axis=1).min() > 1e-6
                if limits:
                    robot.check_limits(one)
            away = found.q - q
            if near is None:  # it is there, perhaps at other turns, which then keep pose and level, too
                away = np.where(robot.hinges, wrapped(away), away)
            assert np.abs(away).max(axis=1).min(initial=np.inf) < 1e-6, (law.name, limits, near)


@pytest.mark.campaign
def test_a_locked_joint_of_more_than_a_turn_stays_where_it_is_locked() -> None:
    """Whole turns that looked for limits alone had it at 2.8803 - 2 pi = -3.4029."""
    robot = hk.load("yumi-arm")
    law = hk.holonomic(hk.pose(robot), hk.lock(4))
    for level in (2.8803, -3.4, 4.5, -5.0):
        q = np.array([0.3, -0.8, 0.4, 0.2, level, 0.5, 1.0])
        found = hk.motion.ik.all_postures(law, robot.pose(q), level, limits=True)
        assert found.q[:, 4] == pytest.approx(np.full(len(found), level), abs=1e-9)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-9


def test_of_several_turns_the_nearest_to_a_posture_is_given() -> None:
    """The hinges of a UR10e have two turns each: of each answer one is given."""
    robot = hk.load("ur10e")
    law = hk.holonomic(hk.pose(robot), hk.custom(lambda q: q[0:0], rows=0))
    for seed in range(3):
        q = np.random.default_rng(seed).uniform(-6.2, 6.2, 6)
        q[2] = wrapped(q[2])
        found = hk.motion.ik.all_postures(law, robot.pose(q), np.zeros(0), limits=True, near=q)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-8
        assert len(found) <= 8


@pytest.mark.parametrize("name", ["irb140", "ur10e"])
def test_an_arm_without_redundancy_needs_no_constraint(name: str) -> None:
    """Referees: the robot's own posture, and of a spherical wrist that each posture has one with its wrist flipped."""
    robot, rng = hk.load(name), np.random.default_rng(len(name))
    law, count = hk.moore_penrose(hk.pose(robot)), []
    for _ in range(4):
        q = rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi))
        pose = robot.pose(q)
        found = hk.motion.ik.all_postures(law, pose, limits=False, starts=512)
        within = hk.motion.ik.all_postures(law, pose, near=q, starts=512)
        assert np.abs(wrapped(found.q - q)).max(axis=1).min() < 1e-8 and np.abs(within.q - q).max(axis=1).min() < 1e-8
        assert robot.within(within.q).all() and "leaf" not in found.sentence
        assert max(np.abs(robot.pose(one) - pose).max() for one in found.q) < 1e-8
        flipped = found.q + np.array([0, 0, 0, np.pi, 0, np.pi])
        flipped[:, 4] *= -1
        if name == "irb140":
            assert all(np.abs(wrapped(found.q - one)).max(axis=1).min() < 1e-7 for one in flipped)
        count.append(len(found))
    assert set(count) <= {2, 4, 6, 8} and 8 in count


def test_a_redundant_arm_needs_one(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="holonomic"):
        hk.motion.ik.all_postures(hk.moore_penrose(hk.pose(panda)), np.eye(4))
