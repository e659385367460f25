"""Whether a pose can be reached, and which joint is in the way: postures found by Newton's method are the referees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import IIWA_START, PANDA_START, sampled
from holokin.base.errors import OutOfReachError
from holokin.base.types import Array, Matrix, Vector
from holokin.motion.ik import all_postures
from holokin.motion.self_motions.least_squares import nearest_postures
from holokin.motion.self_motions.pose_reach import Reach, all_known, at_best_turns, reach_of
from holokin.motion.self_motions.posture_search import postures_from, spread
from holokin.motion.self_motions.self_motions import cut_class
from holokin.robot import Robot
from holokin.strategies import self_motion_curve

SEVEN = ["panda", "iiwa14", "xarm7", "openarm-left", "gen3", "sawyer"]


def poses_of(robot: Robot, q: Matrix) -> tuple[Matrix, Array]:
    T = robot.pose(q)
    return np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3])


def with_limits(robot: Robot, lower: Vector, upper: Vector) -> Robot:
    limits = zip(robot.coordinates, lower, upper, strict=True)
    return replace(robot, coordinates=tuple(replace(c, lower=float(a), upper=float(b)) for c, a, b in limits))


def narrowed(robot: Robot, rng: np.random.Generator) -> Robot:
    """The same robot with limits of its own: some joints with narrow ranges, some with several turns, or without."""
    middle, half = rng.uniform(-4, 4, robot.n), rng.uniform(0.05, 2.5, robot.n)
    half[rng.integers(robot.n)] = 7.0
    lower, upper = middle - half, middle + half
    free = rng.integers(robot.n)
    lower[free], upper[free] = -np.inf, np.inf
    return with_limits(robot, lower, upper)


def reached(robot: Robot, q: Matrix) -> Reach:
    """What is told of the tool poses at postures."""
    return reach_of(hk.pose(robot), *poses_of(robot, q), near=q)


def beyond(robot: Robot, q: Matrix) -> Vector:
    """How far postures (k, n) are beyond the limits, whatever turn each joint is at: by trying them."""
    turns = 2 * np.pi * np.arange(-4, 5)[:, None, None]
    return np.maximum(robot.lower - (q + turns), (q + turns) - robot.upper).min(axis=0).max(axis=1)


@sampled(1, ("name", "seed"), [(name, seed) for seed in range(3) for name in SEVEN])
def test_no_posture_that_newtons_method_finds_or_a_walk_along_a_self_motion_meets_is_less_beyond_the_limits(
    name: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    robot = narrowed(hk.load(name), rng)
    task, q = hk.pose(robot), rng.uniform(-np.pi, np.pi, (4, robot.n))
    p, R = poses_of(robot, q)
    found = reach_of(task, p, R, near=q)
    assert found.complete and found.anyhow.all()
    assert np.abs(task.error(found.q, p, R)).max() < 1e-9
    assert found.beyond == pytest.approx(beyond(robot, found.q), abs=1e-12)
    for i in range(len(q)):
        if found.beyond[i] <= 0 and cut_class(task) is None:
            continue  # of an arm without a closed form any posture within the limits will do
        every, arrived = postures_from(task, spread(robot, 150), np.tile(p[i], (150, 1)), np.tile(R[i], (150, 1, 1)))
        assert arrived.sum() > 10
        assert beyond(robot, every[arrived]).min() > found.beyond[i] - 1e-9
        # Along the curve of one of them, whole, and finely at the best posture.
        walk = self_motion_curve(task, every[arrived][0], step=0.2, length=20.0, limits=False).q
        near = self_motion_curve(task, found.q[i], step=5e-4, length=5e-3, limits=False).q
        assert min(beyond(robot, walk).min(), beyond(robot, near).min()) > found.beyond[i] - 1e-9


def test_the_joint_in_the_way_is_named_with_what_it_lacks(iiwa14: Robot) -> None:
    """The elbow of an iiwa is told by the distance from shoulder to wrist, but for its sign; limits exclude both."""
    elbow = abs(IIWA_START[3]) - 0.12
    upper = np.where(np.arange(7) == 3, elbow, 3.2)
    robot = with_limits(iiwa14, -upper, upper)
    found = reached(robot, np.array([IIWA_START, IIWA_START + 0.3 * np.eye(7)[0]]))
    name = robot.joint_names[3]
    assert found.joint.tolist() == [3, 3]
    assert found.beyond == pytest.approx(0.12, abs=1e-9)
    assert found.obstacle(0) == f"every posture is beyond the joint limits: {name} by 0.12 rad at best"
    assert found.obstacles(np.arange(2)) == [(found.obstacle(0), 2)]
    assert str(found) == "0 of 2 poses are reached within the joint limits, 2 at all"


@sampled(1, "name", ["panda", "iiwa14", "xarm7"])
def test_a_posture_in_a_corner_of_limits_without_width_is_met(name: str) -> None:
    """Ranges of no width round one posture: it alone is within, at any turn, and no search need be lucky."""
    robot, rng = hk.load(name), np.random.default_rng(1)
    for _ in range(3):
        q, turns = rng.uniform(-np.pi, np.pi, 7), 2 * np.pi * rng.integers(-2, 3, 7)
        corner = with_limits(robot, q + turns, q + turns)
        found = reached(corner, q[None])
        assert found.within[0]
        assert found.q[0] == pytest.approx(q + turns, abs=1e-8)


def test_a_joint_with_one_limit_has_a_turn_within_it_and_a_slide_has_none(panda: Robot) -> None:
    one_sided = with_limits(panda, np.where(np.arange(7) == 2, 8.0, -np.inf), np.full(7, np.inf))
    q = at_best_turns(one_sided, np.random.default_rng(2).uniform(-9, 9, (100, 7)))
    assert one_sided.within(q).all()
    free = np.arange(7) != 2
    assert (np.abs(q[:, free]) <= np.pi).all()
    assert reached(one_sided, PANDA_START[None]).within[0]


@sampled(1, "name", ["ur5e", "irb140", "general"])
def test_an_arm_of_six_joints_has_the_best_of_its_postures(name: str) -> None:
    """Of all postures within the limits, narrowed to a turn, the one with the largest margin."""
    rng = np.random.default_rng(3)
    rows = [{"a": a, "d": d, "alpha": alpha} for a, d, alpha in rng.uniform([0.1, 0.1, 0.4], [0.4, 0.3, 1.4], (6, 3))]
    robot = hk.from_dh(rows) if name == "general" else hk.load(name)
    robot = with_limits(robot, np.full(6, -np.pi), rng.uniform(0.5, 3.0, 6))
    q = rng.uniform(-np.pi, np.pi, (4, 6))
    found, any_strategy = reached(robot, q), hk.moore_penrose(hk.pose(robot))
    assert found.complete
    for i, pose in enumerate(robot.pose(q)):
        postures = all_postures(any_strategy, pose, limits=False).q
        assert found.beyond[i] == pytest.approx(beyond(robot, postures).min(), abs=1e-9)
        assert np.abs(hk.pose(robot).error(found.q[i], pose[:3, 3], pose[:3, :3])).max() < 1e-9


@sampled(1, "name", ["panda", "iiwa14", "xarm7", "ur5e"])
def test_what_is_out_of_reach_no_search_reaches_and_what_is_not_has_a_posture(name: str) -> None:
    robot, rng = hk.load(name), np.random.default_rng(4)
    task, q = hk.pose(robot), rng.uniform(-np.pi, np.pi, (60, robot.n))
    p, R = poses_of(robot, q)
    p[::2] *= rng.uniform(1.0, 1.8, (30, 1))
    found, searched = reach_of(task, p, R, near=q), nearest_postures(task, p, R, q, limits=False)
    assert found.anyhow[1::2].all() and 5 < (~found.anyhow).sum() < 30
    assert (searched.missing[~found.anyhow] > 1e-8).all()
    assert np.abs(task.error(found.q[found.anyhow], p[found.anyhow], R[found.anyhow])).max() < 1e-9


def test_poses_of_single_precision_are_reached_as_others_are(panda: Robot) -> None:
    q = np.random.default_rng(5).uniform(panda.lower, panda.upper, (20, 7))
    p, R = poses_of(panda, q)
    rough = reach_of(hk.pose(panda), p.astype(np.float32).astype(float), R.astype(np.float32).astype(float), near=q)
    assert rough.beyond == pytest.approx(reached(panda, q).beyond, abs=1e-4)


def test_a_task_of_positions_is_searched_and_says_so(planar_3r: Robot) -> None:
    robot = with_limits(planar_3r, np.full(3, -0.4), np.full(3, 0.4))
    task = hk.position(robot)
    assert not all_known(task)
    p = np.array([[3.0, 0, 0], [1.0, 0, 0], [7.5, 0, 0]]) * robot.pose(np.zeros(3))[0, 3] / 3
    found = reach_of(task, 0.999 * p, np.tile(np.eye(3), (3, 1, 1)), near=np.full((3, 3), 0.1))
    assert found.within.tolist() == [True, False, False] and found.anyhow.tolist() == [True, True, False]
    assert found.obstacle(0) is None and found.obstacle(2) == "no posture was found"
    assert (found.obstacle(1) or "").startswith("every posture found is beyond the joint limits: ")
    (limits, one), (none, other) = found.obstacles(np.array([1, 2]))
    assert (limits, none, one, other) == (found.obstacle(1), found.obstacle(2), 1, 1)


def test_inverse_kinematics_and_following_say_what_is_in_the_way(panda: Robot) -> None:
    """A pose that the arm never has, by a rule without a closed form; and a line down to where a joint is beyond."""
    far = panda.pose(PANDA_START)
    far[:3, 3] *= 3.0
    with pytest.raises(OutOfReachError, match=r"no posture has the pose; it is .* give a pose nearer to the base"):
        hk.ik(hk.holonomic(hk.pose(panda), hk.arm_angle()), PANDA_START)(far)
    ready = np.array([0, -0.7854, 0, -2.3562, 0, 1.5708, 0.7854])
    point, law = panda.pose(ready)[:3, 3], hk.holonomic(hk.pose(panda), hk.lock("panda_joint3"))
    with pytest.raises(
        OutOfReachError, match=r"every posture is beyond the joint limits: panda_joint2 by 0\.0\d+ rad"
    ) as e:
        hk.follow(law, hk.line(point, point - [0.0, 0.0, 0.9]), ready, samples=50)
    beyond = float(str(e.value).split("panda_joint2 by ")[1].split()[0])
    below = panda.pose(ready)
    below[2, 3] -= 0.9
    assert beyond == pytest.approx(
        reach_of(hk.pose(panda), below[None, :3, 3], below[None, :3, :3], ready[None]).beyond[0], rel=0.05
    )
