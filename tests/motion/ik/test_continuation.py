"""Paths gone by continuation, and poses refused at once. Paths that are shown to keep to the branch are the referee."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, campaign
from holokin.base.errors import BranchError, OutOfReachError, SingularityError
from holokin.base.types import Array, Matrix
from holokin.motion.ik import InverseKinematics, InverseStatus, all_postures
from holokin.motion.ik.continuation import continuation_code
from holokin.robot import Robot
from holokin.strategies import HolonomicStrategy
from holokin.strategies.constraints import centring_cost, posture_cost, tilted
from holokin.symbolic.native import enabled

pytestmark = pytest.mark.skipif(not enabled(), reason="no compiler")

REACHED, ENDS = InverseStatus.REACHED, InverseStatus.LEAF_ENDS
E = np.eye(7)


def of_pose(x: ca.SX) -> ca.SX:
    """A polynomial of a tool pose, as of a designed strategy."""
    return 0.4 * x[0] + 0.3 * x[1] * x[2] + 0.2 * x[3] * x[4] + 0.2 * x[5]


CONSTRAINTS: dict[str, Callable[[], hk.Constraint]] = {
    "arm angle": hk.arm_angle,
    "conventional arm angle": lambda: hk.arm_angle(definition="conventional"),
    "q1 - q3": lambda: hk.linear(E[0] - E[2]),
    "q1 + q3": lambda: hk.linear(E[0] + E[2]),
    "q3 + q5": lambda: hk.linear(E[2] + E[4]),
    "centred": lambda: hk.stationary(centring_cost()),
    "preferred": lambda: hk.stationary(posture_cost(np.full(7, 0.3))),
    "designed": lambda: tilted(hk.linear(E[0] - E[2]), of_pose),
    "designed angle": lambda: tilted(hk.arm_angle(), of_pose),
    "own": lambda: hk.custom(lambda q: q[2] + 0.3 * ca.sin(q[4]) + 0.2 * q[0] * q[5]),
}
ROBOTS = ("panda", "fr3", "iiwa14", "xarm7", "openarm-left")


def mounted(robot: Robot, rng: np.random.Generator) -> Robot:
    """A robot that stands anywhere and carries a tool."""
    base, tool = np.eye(4), np.eye(4)
    for T, size in ((base, 0.5), (tool, 0.15)):
        T[:3, :3] = Rotation.from_quat(rng.normal(size=4)).as_matrix()
        T[:3, 3] = rng.normal(0, size, 3)
    return hk.with_tool(hk.with_base_pose(robot, base), tool)


def anywhere(robot: Robot, rng: np.random.Generator, count: int) -> Matrix:
    """Postures (count, n) of the whole arm."""
    return rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (count, robot.n))


def started(strategy: HolonomicStrategy, rng: np.random.Generator) -> InverseKinematics:
    """From a random start that is not singular."""
    while True:
        q0 = anywhere(strategy.task.robot, rng, 1)[0]
        try:
            return hk.ik(strategy, q0, limits=False)
        except SingularityError:
            continue


def agree(ik: InverseKinematics, poses: Array) -> int:
    """How many poses are reached: those of shown paths, with their joints, and none where these come to a fold."""
    p, R = ik._given_poses.places(poses)
    q, status = ik._paths.go_paths(p, R, None)
    shown, became = ik._paths.go_paths(p, R, None, shown=True)
    reached = status == REACHED
    assert reached[became == REACHED].all()
    assert not (became[reached] == ENDS).any()
    both = reached & (became == REACHED)
    assert np.abs(q - shown)[both].max(initial=0) < 1e-9
    return int(both.sum())


def agreement(name: str, kind: str, blocks: int, count: int) -> int:
    """Of so many starts and poses each over the whole arm: how many are reached."""
    rng, robot, reached = np.random.default_rng(4), hk.load(name), 0
    for block in range(blocks):
        robot = mounted(hk.load(name), rng) if block % 5 == 3 else robot
        ik = started(hk.holonomic(hk.pose(robot), CONSTRAINTS[kind]()), rng)
        Q = anywhere(robot, rng, count)
        Q[: count // 4] = ik.q0 + rng.normal(0, 0.3, (count // 4, robot.n))
        reached += agree(ik, robot.pose(Q))
    return reached


def test_continuation_comes_to_the_postures_of_paths_that_are_shown() -> None:
    assert agreement("panda", "q1 - q3", 2, 40) > 20


@pytest.mark.campaign
@pytest.mark.parametrize("kind", list(CONSTRAINTS))
@pytest.mark.parametrize("name", ROBOTS)
def test_it_does_so_for_ten_thousand_poses(name: str, kind: str) -> None:
    """Joints of several turns have the same turn."""
    assert agreement(name, kind, 20, 500) > 1000


def test_most_poses_need_no_shown_path(panda: hk.Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    ik, asked = hk.ik(hk.holonomic(hk.pose(panda), hk.arm_angle()), PANDA_START, limits=False), []
    cold = InverseKinematics._cold
    monkeypatch.setattr(InverseKinematics, "_cold", lambda self, pose: asked.append(pose) or cold(self, pose))
    poses = panda.pose(PANDA_START + np.random.default_rng(0).uniform(-0.5, 0.5, (100, 7)))
    reached = ik.batch(poses).status == REACHED
    for pose in poses[reached]:
        ik(pose)
    assert reached.sum() > 90 and len(asked) <= 3


@pytest.mark.parametrize("width", [0.1, campaign("width", 0.01), campaign("width", 0.001)])
def test_a_fold_narrower_than_a_step_is_not_jumped(width: float) -> None:
    """The PPR arm with g = q3^3 - 3 w^2 q3 + x: beyond the fold at q3 = w lies another part of the leaf, on which det
    [J; J_g] has the same sign, and a step from one to the other is three times as long as the rates at its ends say."""
    law = hk.custom(lambda q: q[2] ** 3 - 3 * width**2 * q[2] + q[0] + ca.cos(q[2]))
    strategy, rng, reached = hk.holonomic(hk.position(hk.load("ppr")), law), np.random.default_rng(2), 0
    assert continuation_code(strategy)
    for start in ([-0.233, -0.641, -0.186], [-0.233, -0.641, 0.3]):
        ik = hk.ik(strategy, start, limits=False)
        reached += agree(ik, strategy.task.robot.pose(rng.uniform(-1, 1, (400, 3))))
    assert reached > 100


def test_a_singular_posture_ahead_is_not_passed_in_one_step(panda: hk.Robot) -> None:
    """q1 - q3 of a Panda whose second joint comes to 0: the leaf folds, and goes on nearly where it ended, with the
    same sign of det [J; J_g] and nearly the same rates. rcond falls evenly to 0 before."""
    start = np.array([1.04930195, 0.47884383, -0.06521377, -2.89307408, -1.83160836, 1.70575652, -0.08333469])
    q = np.array([0.96668366, 1.07470101, -0.0252698, -3.38632038, -1.58376812, 1.517582, 0.49608445])
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.linear(E[0] - E[2])), start, limits=False)
    found = ik.batch(panda.pose(q)[None])
    assert found.status.tolist() == [ENDS] and abs(found.last[0, 1]) < 0.02
    with pytest.raises(BranchError):
        ik(panda.pose(q))


@pytest.mark.parametrize("kind", ["arm angle", campaign("kind", "q1 - q3"), campaign("kind", "designed angle")])
def test_so_it_is_on_other_levels(panda: hk.Robot, kind: str) -> None:
    strategy, rng = hk.holonomic(hk.pose(panda), CONSTRAINTS[kind]()), np.random.default_rng(1)
    ik, reached = hk.ik(strategy, PANDA_START, limits=False), 0
    poses = panda.pose(PANDA_START + rng.uniform(-0.6, 0.6, (60, 7)))
    for change in (-0.6, 0.3, 1.0):
        level = ik._paths.level + change
        q, status = ik._at_level(level).go_paths(*ik._given_poses.places(poses), 1)
        shown, became = ik._at_level(level).go_paths(*ik._given_poses.places(poses), 1, shown=True)
        both = (status == REACHED) & (became == REACHED)
        assert (status[became == REACHED] == REACHED).all() and not (became[status == REACHED] == ENDS).any()
        assert np.abs(q - shown)[both].max() < 1e-9
        assert np.abs(ik(poses[both][0], level=level) - q[both][0]).max() < 1e-12
        reached += int(both.sum())
    assert reached > 50


def test_formulas_that_may_bend_within_a_step_are_left_to_shown_paths(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    for kind, make in CONSTRAINTS.items():
        assert bool(continuation_code(hk.holonomic(task, make()))), kind
    others = {
        "narrow waves": hk.custom(lambda q: q[2] - 0.0015 * ca.sin(q[2] / 0.001)),
        "a bump": hk.custom(lambda q: q[2] + ca.exp(-((q[4] / 0.01) ** 2))),
        "a jump": hk.custom(lambda q: q[2] + ca.if_else(q[4] > 0, 0.1, 0.0)),
        "a quotient": hk.custom(lambda q: q[2] + 1e-4 / (1e-3 + q[4] ** 2)),
        "waves of the pose": tilted(hk.lock(2), lambda x: ca.sin(50 * x[0])),
        "an own cost": hk.stationary(lambda q: ca.log(1 + q[2] ** 2)),
    }
    for what, constraint in others.items():
        assert not continuation_code(hk.holonomic(task, constraint)), what


# --- Poses that no posture has.

ARMS = ("panda", "iiwa14", "xarm7", "openarm-left", "ur5e", "irb140")


def whole_arm(name: str, rng: np.random.Generator) -> InverseKinematics:
    robot = mounted(hk.load(name), rng)
    task = hk.pose(robot)
    strategy = hk.holonomic(task, hk.linear(E[0] - E[2])) if robot.n == 7 else hk.moore_penrose(task)
    return hk.ik(strategy, np.array([0.3, 0.6, 0.4, -1.1, 0.5, 0.8, 0.2])[: robot.n], limits=False)


@pytest.mark.parametrize("name", ["panda", *(campaign("name", name) for name in ARMS[1:])])
def test_a_pose_that_a_posture_has_is_never_refused_at_once(name: str) -> None:
    """Also at the edge of reach, with the elbow stretched."""
    rng = np.random.default_rng(3)
    ik = whole_arm(name, rng)
    robot, elbow = ik.strategy.task.robot, 3 if ik.strategy.task.n == 7 else 2
    Q = rng.uniform(-np.pi, np.pi, (3000, robot.n))
    Q[:1000, elbow] = rng.choice([0.0, 1e-9, 1e-6, 1e-3, -1e-3], 1000)
    assert not any(ik._paths.nowhere(pose) for pose in robot.pose(Q))


@pytest.mark.parametrize("name", ["panda", *(campaign("name", name) for name in ARMS[1:])])
def test_what_is_refused_at_once_has_no_posture(name: str) -> None:
    """Poses farther and farther out: no posture with the last joint held at any of 20 values has one."""
    rng = np.random.default_rng(3)
    ik = whole_arm(name, rng)
    robot = ik.strategy.task.robot
    poses = robot.pose(rng.uniform(-np.pi, np.pi, (60, robot.n)))
    out = poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0)
    poses[:, :3, 3] += rng.uniform(0.0, 1.0, (60, 1)) * out / np.linalg.norm(out, axis=1)[:, None]
    refused = [pose for pose in poses if ik._paths.nowhere(pose)]
    assert 5 < len(refused) < 60
    held = hk.holonomic(hk.pose(robot), hk.lock(robot.n - 1)) if robot.n == 7 else ik.strategy
    for pose in refused[:4]:
        for level in np.linspace(-np.pi, np.pi, 20) if robot.n == 7 else [[]]:
            assert len(all_postures(held, pose, level, limits=False)) == 0
        with pytest.raises(OutOfReachError, match="no posture has the pose"):
            ik(pose)
        found = ik.batch(pose[None])
        assert found.status.tolist() == [ENDS] and np.isnan(found.last).all()
    far = np.eye(4)
    far[:3, 3] = 10.0
    assert ik._paths.nowhere(far)
