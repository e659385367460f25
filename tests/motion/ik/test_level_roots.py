"""All postures of a pose at a level as roots along its self-motions. Referee: Newton's method from random starts."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import holokin as hk
from conftest import sampled
from holokin.motion.ik import all_postures
from holokin.strategies import HolonomicStrategy
from holokin.strategies.constraints import linear

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


def apart(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of joints (...,), whole turns aside."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def newton_postures(strategy: HolonomicStrategy, pose: np.ndarray, level: float, starts: int, turns: float):
    """Postures (k, n) to which Newton's method on [pose; g] leads from random ones, so many turns wide each way."""
    task = strategy.task
    q = np.random.default_rng(0).uniform(-2 * np.pi * turns, 2 * np.pi * turns, (starts, task.n))
    size = np.full(starts, np.inf)
    for _ in range(50):
        gap = strategy.constraint.nearest(level - strategy.constraint_value.batch(q)[:, None])
        error = task._error_function.batch(q, pose[:3, 3], pose[:3, :3])
        A = np.concatenate([task.jacobian_batch(q)[0], strategy._planes.batch(q).reshape(len(q), 1, -1)], axis=1)
        sound = np.abs(np.linalg.det(np.nan_to_num(A))) > 1e-12
        q, A, wanted = q[sound], A[sound], np.concatenate([error, gap], axis=1)[sound]
        step = np.linalg.solve(A, wanted[:, :, None])[:, :, 0]
        size = np.abs(step).max(axis=1)
        q = q + step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))[:, None]
    return q[size < 1e-11]


STRATEGIES = {
    "arm angle": lambda: hk.arm_angle(),
    "conventional": lambda: hk.arm_angle(definition="conventional"),
    "q1 - q3": lambda: linear([1, 0, -1, 0, 0, 0, 0]),
    "4 q1 + 3 q3": lambda: linear([4, 0, 3, 0, 0, 0, 0]),
    "formula": lambda: hk.custom(lambda q: ca.sin(q[0] - q[4]) + ca.cos(q[1] + q[6]) * ca.sin(q[3])),
    "turns count": lambda: hk.custom(lambda q: q[0] * (1.5 + ca.sin(q[1])) + q[4]),
    "stationary": lambda: hk.stationary(lambda q: ca.sum1(ca.cos(q)) + ca.cos(q[1] - q[3])),
}


def made(name: str, arm: str) -> HolonomicStrategy:
    return hk.holonomic(hk.pose(hk.load(arm)), STRATEGIES[name]())


ARMS = ["panda", "fr3", "iiwa14", "xarm7", "gen3", "sawyer"]


@sampled(2, ("arm", "name"), [(arm, name) for arm in ARMS for name in STRATEGIES if name != "turns count"])
def test_each_posture_of_random_starts_is_a_root_along_a_self_motion(arm: str, name: str) -> None:
    strategy = made(name, arm)
    robot, q = strategy.task.robot, np.random.default_rng(len(arm) + len(name)).uniform(-2.5, 2.5, 7)
    pose, level = robot.pose(q), strategy.g(q)[0]
    found = all_postures(strategy, pose, level, limits=False)
    gap = strategy.constraint.nearest(strategy.constraint_value.batch(found.q)[:, None] - level)
    assert np.abs(gap).max() < 1e-9 and np.abs(robot.pose(found.q) - pose).max() < 1e-9
    assert (apart(found.q[:, None], found.q) + 9 * np.eye(len(found.q))).min() > 1e-6
    assert not (found.doubt or found.starts or found.closed or (found.family > 0).any())
    for other in [q, *newton_postures(strategy, pose, level, 150, 1.0)]:
        assert apart(found.q, other).min() < 1e-6, (q.tolist(), other.tolist())


def test_two_roots_beside_an_extremum_of_g_are_two_and_where_they_meet_they_are_told() -> None:
    strategy = made("formula", "panda")
    curve = hk.strategies.self_motion_curve(strategy.task, PANDA, step=0.05, limits=False)
    pose, g = strategy.task.robot.pose(PANDA), strategy.constraint_value.batch(curve.q)
    k = 1 + int(np.argmax(g[1:-1]))
    best: Any = minimize_scalar(
        lambda s: -strategy.g(curve.at(s))[0], bounds=(curve.s[k - 1], curve.s[k + 1]), options={"xatol": 1e-9}
    )
    top, q = -best.fun, curve.at(best.x)
    bend = abs(strategy.g(curve.at(best.x + 1e-3))[0] - top) / 1e-6
    for below in (1e-2, 1e-4, 1e-6, 1e-8):
        found = all_postures(strategy, pose, top - below, limits=False)
        distance = np.linalg.norm((found.q - q + np.pi) % (2 * np.pi) - np.pi, axis=1)
        near = distance[distance < 2.0 * np.sqrt(below / bend)]
        assert len(near) == 2 and near == pytest.approx(np.sqrt(below / bend), rel=0.2) and not found.singular
        assert np.abs(strategy.constraint_value.batch(found.q) - top + below).max() < 1e-9
    for above in (1e-8, 1e-4):
        found = all_postures(strategy, pose, top + above, limits=False)
        assert apart(found.q, q).min() > 0.1 and not found.singular
    found = all_postures(strategy, pose, top, limits=False)
    assert found.singular and "two postures meet here" in found.sentence and apart(found.q, q).min() > 1e-3


@sampled(1, "name", ["q1 - q3", "4 q1 + 3 q3", "turns count"])
def test_whole_turns_that_g_counts_are_on_the_leaf_where_their_level_is_and_nowhere_else(name: str) -> None:
    """xArm 7: joints 1, 3, 5 and 7 have two turns each. Referee: starts in all of them."""
    strategy = made(name, "xarm7")
    robot = strategy.task.robot
    q = np.random.default_rng(len(name)).uniform(robot.lower, robot.upper)
    pose, level = robot.pose(q), strategy.g(q)[0]
    found = all_postures(strategy, pose, level, near=q)
    assert np.abs(found.q - q).max(axis=1).min() < 1e-9  # itself, not another turn of it
    assert robot.within(found.q).all() and np.abs(strategy.constraint_value.batch(found.q) - level).max() < 1e-9
    others = newton_postures(strategy, pose, level, 400, 1.0)
    hidden = [k for k in range(7) if strategy.rows(q)[0, k] == 0]  # g does not see these: any turn will do
    within = others.copy()
    within[:, hidden] = robot.lower[hidden] + (others[:, hidden] - robot.lower[hidden]) % (2 * np.pi)
    within = within[robot.within(within)]
    assert len(within) > 1
    for other in within:
        assert apart(found.q, other).min() < 1e-6


def test_where_g_stands_still_along_a_self_motion_one_posture_stands_for_it() -> None:
    """Joint 4 of an arm with a shoulder and a wrist in a point: the distance of these gives it."""
    robot = hk.load("iiwa14")
    strategy, q = hk.holonomic(hk.pose(robot), hk.lock(3)), np.array([0.3, -0.7, 0.4, -1.1, 0.5, 0.6, 0.2])
    found = all_postures(strategy, robot.pose(q), q[3], limits=False)
    assert len(found) and (found.family > 5.0).all() and "a part of a curve that is on the leaf" in found.sentence
    assert np.abs(found.q[:, 3] - q[3]).max() < 1e-9
    assert not len(all_postures(strategy, robot.pose(q), q[3] + 0.1, limits=False))


def test_an_upright_upper_arm_whose_axes_1_and_3_are_one_line_has_the_postures_on_that_curve() -> None:
    """They differ in q1 - q3 alone, and no joint by which the curves are cut moves along it."""
    strategy = made("q1 - q3", "iiwa14")
    q = np.array([0.3, 0.0, 0.4, -1.1, 0.5, 0.6, 0.2])
    pose = strategy.task.robot.pose(q)
    for turn in (0.0, 0.7):
        found = all_postures(strategy, pose, -0.1 + 2 * turn, limits=False)
        upright = found.q[np.abs(found.q[:, 1]) < 1e-9]
        assert apart(found.q, q + turn * np.array([1, 0, -1, 0, 0, 0, 0])).min() < 1e-9
        assert len(upright) == 8  # by two signs of the elbow, two of the wrist, and half a turn of q1 and q3


def test_a_jump_of_g_over_the_level_is_no_root() -> None:
    panda = hk.load("panda")
    strategy = hk.holonomic(hk.pose(panda), hk.custom(lambda q: q[0] + ca.if_else(ca.sin(q[0] + q[2]) > 0, 3.0, -3.0)))
    found = all_postures(strategy, panda.pose(PANDA), 1.5, limits=False)
    assert np.abs(strategy.constraint_value.batch(found.q) - 1.5).max(initial=0) < 1e-9
    smooth = [hk.holonomic(hk.pose(panda), hk.custom(lambda q, c=c: q[0] + c)) for c in (3.0, -3.0)]
    both = np.concatenate([all_postures(one, panda.pose(PANDA), 1.5, limits=False).q for one in smooth])
    real = both[np.abs(strategy.constraint_value.batch(both) - 1.5) < 1e-9]
    assert len(real) == len(found) < len(both)


def test_a_six_axis_arm_whose_tool_may_spin_has_the_postures_of_every_spin() -> None:
    """Referee: the closed form of the arm at the spin that a posture has."""
    robot = hk.load("irb140")
    strategy = hk.holonomic(hk.pose(robot, "axis", axis="x"), hk.custom(lambda q: q[0] + ca.sin(q[3])))
    q = np.array([0.3, 0.6, -0.4, 0.7, 0.9, 0.2])
    found = all_postures(strategy, robot.pose(q), strategy.g(q), limits=False)
    assert found.curves and not found.searched and apart(found.q, q).min() < 1e-9
    for posture in found.q:
        assert np.abs(strategy.task.error(posture, *strategy.task._place(q))).max() < 1e-9
        same = all_postures(hk.moore_penrose(hk.pose(robot)), robot.pose(posture), limits=False)
        assert same.closed and apart(same.q, posture).min() < 1e-9
    for other in newton_postures(strategy, robot.pose(q), strategy.g(q)[0], 150, 0.5):
        assert apart(found.q, other).min() < 1e-6


def test_where_six_hinges_are_left_without_a_closed_form_eigenvalues_give_all() -> None:
    gen3 = hk.load("gen3")
    strategy = hk.holonomic(hk.pose(gen3), hk.lock(2))
    q = np.array([0.3, -0.7, 0.4, -1.1, 0.5, 0.6, 0.2])
    found = all_postures(strategy, gen3.pose(q), q[2], limits=False)
    assert found.closed and "by the eigenvalues" in found.sentence and apart(found.q, q).min() < 1e-9
    for other in newton_postures(strategy, gen3.pose(q), q[2], 150, 0.5):
        assert apart(found.q, other).min() < 1e-6


def test_with_two_redundant_joints_a_search_says_so() -> None:
    robot = hk.load("panda")
    strategy = hk.holonomic(hk.pose(robot, "axis"), hk.custom(lambda q: [q[0] - q[2], q[4] + q[6]], rows=2))
    q = PANDA
    found = all_postures(strategy, robot.pose(q), strategy.g(q), near=q)
    assert found.starts and found.curves is None and "no proof that there are no others" in found.sentence
    assert np.abs(found.q - q).max(axis=1).min() < 1e-9 and 0 <= found.unseen <= 1
