"""Leaves with a closed inverse where something is special: levels, poses, limits, slides, two held joints."""

from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.base.errors import ArgumentError, HolokinError, NoProofError, NotFiniteError, OutOfReachError
from holokin.motion.ik import InverseStatus, all_postures
from holokin.motion.ik.closed_leaf import closed_leaf, leaf_class
from holokin.robot import Robot
from holokin.robot.closed_form import ArmClass, NoClass
from holokin.robot.joints import Coordinate, Joint
from holokin.strategies import HolonomicStrategy

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
IIWA = np.array([0.3, 0.5, 0.4, -1.1, 0.5, 0.6, 0.2])


def lock(robot: Robot, *joints: int) -> HolonomicStrategy:
    return hk.holonomic(hk.pose(robot), hk.lock(*[robot.joint_names[k] for k in joints]))


def apart(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of joints (...,), whole turns aside."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


SINGULAR = [
    pytest.param("panda", 3, 0.0, id="stretched: axes 3 and 5 are one line"),
    pytest.param("iiwa14", 1, 0.0, id="axes 1 and 3 are one line"),
    pytest.param("iiwa14", 5, 1e-12, id="axes 5 and 7 nearly are"),
]
SPECIAL = [
    pytest.param("panda", 5, 0.0, id="axes 5 and 7 are parallel"),
    pytest.param("panda", 5, np.pi, id="axes 5 and 7 are opposite"),
    pytest.param("panda", 4, 0.0, id="degree four: axes 4 and 6 are parallel"),
    pytest.param("iiwa14", 2, 0.0, id="axes 2 and 4 are parallel"),
    pytest.param("xarm7", 5, 0.0, id="axes 5 and 7 of an arm with two elbows are parallel"),
]


@sampled(1, ("name", "joint", "level"), SINGULAR)
def test_where_every_posture_of_a_level_is_singular_no_closed_form_speaks(name, joint, level):
    robot = hk.load(name)
    strategy = lock(robot, joint)
    assert isinstance(leaf_class(strategy), ArmClass)  # at other levels it does
    assert closed_leaf(strategy, np.array([level]), True) is None
    q = np.where(robot.hinges, 0.4, 0.0)
    q[joint] = level
    found = all_postures(strategy, robot.pose(q), level, limits=False)
    assert not found.closed and len(found) and (found.family > 1.0).all()  # curves of postures, along which it stays
    assert np.abs(found.q[:, joint] - level).max() < 1e-9 and np.abs(robot.pose(found.q) - robot.pose(q)).max() < 1e-9


@sampled(2, ("name", "joint", "level"), SPECIAL)
def test_at_levels_where_axes_are_parallel_that_are_not_elsewhere_every_posture_is_found(name, joint, level):
    robot = hk.load(name)
    strategy = lock(robot, joint)
    for q in np.random.default_rng(1).uniform(-2, 2, (20, 7)):
        q[joint] = level
        found = all_postures(strategy, robot.pose(q), level, limits=False)
        assert found.closed and apart(found.q, q).min() < 1e-9
        assert np.abs(robot.pose(found.q) - robot.pose(q)).max() < 1e-12


MEETING = [
    pytest.param("iiwa14", (2,), 5, 0.0, id="wrist"),
    pytest.param("panda", (6,), 1, 0.0, id="shoulder"),
    pytest.param("panda", (6,), 3, -np.arctan2(0.1155, 0.2290755), id="elbow: |WS| is largest"),
    pytest.param("ur5e", (), 2, 0.0, id="stretched elbow of three parallel axes"),
    pytest.param("ur5e", (), 4, 0.0, id="axes 4 and 6 are parallel"),
]


@pytest.mark.parametrize(("name", "held", "joint", "value"), MEETING)
def test_where_two_postures_meet_they_are_told_and_not_counted(name, held, joint, value):
    robot = hk.load(name)
    strategy = lock(robot, *held) if held else hk.moore_penrose(hk.pose(robot))
    q = np.array([0.3, -0.7, 0.4, -1.1, 0.5, 0.6, 0.2])[: robot.n]
    q[joint] = value
    pose = robot.pose(q)
    found = all_postures(strategy, pose, [q[k] for k in held], limits=False)
    assert found.closed and found.singular == 1 and "two postures meet here" in found.sentence
    if len(found):
        assert np.abs(robot.pose(found.q) - pose).max() < 1e-9 and apart(found.q, q).min() > 1e-3


def test_limits_narrower_than_a_root_leave_out_what_is_beyond_them_and_no_more():
    """Referee: the postures without limits, of which those within are counted."""
    panda = hk.load("panda")
    pose, free = panda.pose(PANDA), all_postures(lock(panda, 6), panda.pose(PANDA), 0.5, limits=False)
    assert len(free) == 8
    for k, width in ((0, 1e-9), (2, 1e-3), (5, 0.5)):
        limits = [
            replace(c, lower=PANDA[k] - width, upper=PANDA[k] + width) if i == k else c
            for i, c in enumerate(panda.coordinates)
        ]
        narrow = replace(panda, coordinates=tuple(limits))
        found = all_postures(lock(narrow, 6), pose, 0.5)
        within = [q for q in free.q if (narrow.beyond(q) <= 1e-9).all()]
        assert len(found) == len(within) >= 1 and found.outside == 8 - len(within)
        assert np.abs(hk.ik(lock(narrow, 6), PANDA)(pose) - PANDA).max() < 1e-12
    shut = replace(panda, coordinates=tuple(replace(c, lower=-0.01, upper=0.01) for c in panda.coordinates))
    assert len(all_postures(lock(shut, 6), pose, 0.0)) == 0


BAD_POSES = [
    pytest.param(np.diag([-1.0, 1.0, 1.0, 1.0]), InverseStatus.NOT_A_ROTATION, ArgumentError, id="mirrored"),
    pytest.param(np.diag([1.01, 1.01, 1.01, 1.0]), InverseStatus.NOT_A_ROTATION, ArgumentError, id="scaled"),
    pytest.param(np.full((4, 4), np.nan), InverseStatus.NOT_FINITE, NotFiniteError, id="NaN"),
]


@pytest.mark.parametrize(("change", "status", "error"), BAD_POSES)
@pytest.mark.parametrize("joint", [campaign("joint", 4), 6])
def test_what_is_no_pose_is_refused_by_every_door(joint, change, status, error):
    robot = hk.load("panda")
    ik, pose = hk.ik(lock(robot, joint), PANDA), robot.pose(PANDA) @ change
    for door in (ik, ik.all):
        with pytest.raises(error):
            door(pose)
    assert ik.batch(pose[None]).status.tolist() == [status]


@pytest.mark.parametrize("joint", [4, 6])
def test_poses_of_single_precision_have_the_joints_of_double_ones(joint):
    robot = hk.load("panda")
    ik, pose = hk.ik(lock(robot, joint), PANDA), robot.pose(PANDA).astype(np.float32)
    assert np.abs(ik(pose) - PANDA).max() < 1e-5 and apart(ik.all(pose).q, PANDA).min() < 1e-5


def on_rail(robot: Robot, axis: list[float]) -> Robot:
    """A robot on a slide along an axis of its base."""
    slide = Joint("slide", "prismatic", -1, np.eye(4), np.array(axis), 0)
    joints = [replace(j, parent=j.parent + 1, coordinate=j.coordinate + 1) for j in robot.joints]
    tips = tuple(replace(t, joint=t.joint + 1) for t in robot.tips)
    coordinates = (Coordinate("slide", "prismatic", -1.0, 1.0), *robot.coordinates)
    return replace(robot, name="on a rail", coordinates=coordinates, joints=(slide, *joints), tips=tips)


def test_a_slide_is_held_with_a_joint_of_the_arm_and_not_left_among_the_six():
    """Referee: the arm itself, its poses moved by the slide."""
    panda = hk.load("panda")
    moved = on_rail(panda, [0.6, 0.8, 0.0])
    assert isinstance(leaf_class(lock(moved, 0, 7)), ArmClass)
    pose = moved.pose(np.array([0.35, *PANDA]))
    found = all_postures(lock(moved, 0, 7), pose, [0.35, PANDA[6]])
    alone = all_postures(lock(panda, 6), panda.pose(PANDA), PANDA[6])
    assert found.closed and np.abs(found.q[:, 1:] - alone.q).max() < 1e-12 and (found.q[:, 0] == 0.35).all()
    left = leaf_class(lock(moved, 6, 7))
    assert isinstance(left, NoClass) and "slide" in left.reason


def test_a_rail_square_to_two_parallel_axes_does_not_change_the_arm():
    """A rail along x, square to axes 2 and 3. Referee: the arm itself, its poses moved by the slide."""
    arm = hk.load("irb140")
    moved, q = on_rail(arm, [1.0, 0.0, 0.0]), np.array([0.2, -0.4, 0.3, 0.5, 0.6, -0.3])
    found = all_postures(lock(moved, 0), moved.pose(np.array([0.35, *q])), 0.35, limits=False)
    alone = all_postures(hk.moore_penrose(hk.pose(arm)), arm.pose(q), limits=False)
    assert found.closed and len(found) == len(alone) > 1 and np.abs(found.q[:, 1:] - alone.q).max() < 1e-12


def test_after_a_step_of_degree_four_the_path_tells_the_posture_and_no_proof_is_given():
    """Joint 5 of a Panda held: signs do not tell postures apart there. Referee: paths alone."""
    robot = hk.load("panda")
    strategy = lock(robot, 4)
    with pytest.raises(NoProofError, match="no signs"):
        hk.certify(strategy)
    ik, rng = hk.ik(strategy, PANDA), np.random.default_rng(3)
    poses = robot.pose(PANDA + np.where(np.arange(7) == 4, 0.0, rng.uniform(-0.4, 0.4, (16, 7))))
    q, status = ik._paths.go_paths(*ik._given_poses.places(poses), None)
    found = ik.batch(poses)
    assert (found.status == status).all() and np.abs(found.q - q)[found.reached].max() < 1e-12
    assert found.reached.sum() > 8
    for pose, posture in zip(poses[found.reached], q[found.reached], strict=True):
        assert np.abs(ik(pose) - posture).max() < 1e-12 and apart(ik.all(pose).q, posture).min() < 1e-9
    far = robot.pose(PANDA)
    far[:3, 3] = [0.0, 0.0, 1.4]
    with pytest.raises(OutOfReachError, match="no posture has the pose"):
        ik(far)


@pytest.mark.parametrize(
    ("name", "joint", "q0"),
    [
        ("panda", 6, PANDA),
        campaign(("name", "joint", "q0"), ("panda", 5, PANDA)),
        campaign(("name", "joint", "q0"), ("iiwa14", 2, IIWA)),
    ],
)
def test_other_levels_have_the_posture_of_the_straight_path(name, joint, q0):
    """Referee: the paths, wherever they arrive."""
    robot = hk.load(name)
    ik, rng = hk.ik(lock(robot, joint), q0), np.random.default_rng(5)
    poses = robot.pose(q0 + rng.uniform(-0.3, 0.3, (24, 7)))
    for level in q0[joint] + np.array([-0.5, 0.2]):
        found, paths = ik.batch(poses, level=level), ik._at_level(level)
        q, status = paths.go_paths(*ik._given_poses.places(poses), None)
        arrived = status == InverseStatus.REACHED
        assert arrived.sum() > 4 and found.reached[arrived].all()
        assert np.abs(found.q - q)[arrived].max() < 1e-9
        for i in np.flatnonzero(found.reached)[:10]:
            assert (ik(poses[i], level=level) == found.q[i]).all()
    wide = robot.upper[joint] + 0.2
    for i in range(5):
        with pytest.raises(HolokinError):
            ik(poses[i], level=wide)
