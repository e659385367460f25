"""The general inverse of six hinges. Referees: a published arm, Newton's method from anywhere, closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from holokin.base.types import Array, Matrix
from holokin.robot import Robot
from holokin.robot.closed_form import (
    ArmClass,
    ClosedInverse,
    GeneralInverse,
    GeneralPostures,
    NoClass,
    arm_class,
    general_inverse,
)
from holokin.robot.joints import Coordinate, Joint, Tip

SEVEN = ("gen3", "sawyer", "yumi-arm", "rizon4")
EVERY = [(name, (k,)) for name in SEVEN for k in range(7)]
OTHERS = [(name, (k,)) for name in ("panda", "fr3", "xarm7") for k in (0, 1, 2, 4)]
"""Arms that have a class when another of their joints is held."""

DEGREE = np.pi / 180


def table(rows: list, convention: Literal["standard", "modified"] = "standard") -> Robot:
    """An arm of rows (a, alpha, d, theta) [m, rad]."""
    return hk.robot.from_dh([dict(zip(("a", "alpha", "d", "theta"), row, strict=True)) for row in rows], convention)


GOFA = [
    (0, 0, 0.265, 0),
    (0, -np.pi / 2, 0, -np.pi / 2),
    (0.444, 0, 0, 0),
    (0.110, -np.pi / 2, 0.470, 0),
    (0, np.pi / 2, 0, 0),
    (0.080, -np.pi / 2, 0.101, np.pi),
]
"""ABB CRB 15000-5, from its data sheet."""

CRX = [
    (0, 0, 0.245, 0),
    (0, -np.pi / 2, 0, -np.pi / 2),
    (0.54, 0, 0, 0),
    (0, -np.pi / 2, 0.54, 0),
    (0, np.pi / 2, -0.15, 0),
    (0, -np.pi / 2, 0.16, 0),
]
"""Fanuc CRX-10iA, from its maker's URDF."""


def inverse_of(robot: Robot, held: tuple[int, ...]) -> GeneralInverse:
    inverse = general_inverse(robot, held)
    assert isinstance(inverse, GeneralInverse), inverse
    return inverse


def random_postures(robot: Robot, count: int, seed: int) -> Matrix:
    """Postures (count, n), hinges anywhere on their circle, slides within 1 m."""
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, robot.n))
    return q / np.where(robot.hinges, 1.0, np.pi)


def apart(q: Array, other: Array, joints: list[int]) -> Array:
    """Largest difference (...,) of some joints of postures (..., n), whole turns aside."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi)[..., joints].max(axis=-1)


def gaps(postures: GeneralPostures, q: Matrix, joints: list[int]) -> Array:
    """How far (k,) joints of the nearest posture of each pose are from those of q (k, n)."""
    out = np.full(len(q), np.inf)
    np.minimum.at(out, postures.row, apart(postures.q, q[postures.row], joints))
    return out


def check(robot: Robot, held: tuple[int, ...], count: int, seed: int) -> GeneralPostures:
    """Random postures are found again, all that are told have the pose, and their number is even."""
    inverse, q = inverse_of(robot, held), random_postures(robot, count, seed)
    poses = robot.pose(q)
    postures = inverse.postures(poses, q[:, list(held)])
    sure = ~postures.doubtful
    assert gaps(postures, q, inverse.others)[sure].max() < 1e-6
    assert np.count_nonzero(~sure) <= count / 1000
    assert np.abs(robot.pose(postures.q) - poses[postures.row]).max() < 1e-10
    assert (postures.q[:, list(held)] == q[postures.row][:, list(held)]).all()
    each = np.bincount(postures.row, minlength=count)
    assert each.max() <= 16 and not (each[sure & ~postures.curve] % 2).any()
    return postures


def test_the_arm_of_manocha_and_canny_has_sixteen_postures_at_its_pose():
    """Table I of [MC94], found by [MD89]; its pose has six digits, so it is one of a rotation nearby."""
    a, d = [0.3, 1, 0, 1.5, 0, 0], [0, 0, 0.2, 0, 0, 0]
    robot = table([(x, y * DEGREE, z, 0) for x, y, z in zip(a, [90, 1, 90, 1, 90, 1], d, strict=True)])
    pose = np.eye(4)
    pose[:3] = [
        [-0.760117, -0.641689, 0.102262, -1.140175],
        [0.133333, 0.0, 0.991071, 0.0],
        [-0.635959, 0.766965, 0.085558, 0.0],
    ]
    postures = inverse_of(robot, ()).postures(pose[None], [])
    assert len(postures.q) == 16 and not postures.doubtful.any() and postures.rcond.min() > 0.1
    away = apart(postures.q[:, None], postures.q, list(range(6))) + 10 * np.eye(16)
    assert away.min() > 0.3
    # The table by its own formula.
    for q in postures.q:
        T = np.eye(4)
        for angle, x, y, z in zip(q, a, [90, 1, 90, 1, 90, 1], d, strict=True):
            turn, twist = Rotation.from_euler("z", angle).as_matrix(), Rotation.from_euler("x", y * DEGREE).as_matrix()
            link = np.eye(4)
            link[:3, :3], link[:3, 3] = turn @ twist, turn @ [x, 0, 0] + [0, 0, z]
            T = T @ link
        assert np.abs(T - pose).max() < 2e-6


def random_starts(robot: Robot, joints: list[int], pose: Matrix, q: Array, starts: int, seed: int) -> Matrix:
    """The postures at a pose that damped Newton steps find from random values of some joints, the others as in q."""
    rng, goal = np.random.default_rng(seed), pose[None]
    Q = np.tile(q, (starts, 1))
    Q[:, joints] = rng.uniform(-np.pi, np.pi, (starts, len(joints)))
    for step in range(60):
        T, J = robot.pose(Q), robot.jacobian(Q)[:, :, joints]
        turn = Rotation.from_matrix(goal[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)).as_rotvec()
        error = np.concatenate([goal[:, :3, 3] - T[:, :3, 3], turn], axis=1)
        size = np.linalg.norm(error, axis=1)
        if step % 10 == 9:  # those that are far away by now are at a lowest point of the error
            Q, J, error, size = (x[size < (1 if step < 20 else 0.1)] for x in (Q, J, error, size))
        damping = np.minimum(1e-3, size**2)[:, None, None] * np.eye(len(joints))
        across = J.transpose(0, 2, 1)
        move = np.linalg.solve(across @ J + damping + 1e-16 * np.eye(len(joints)), (across @ error[:, :, None]))[
            :, :, 0
        ]
        Q[:, joints] += move * np.minimum(1, 0.7 / np.linalg.norm(move, axis=1).clip(1e-300))[:, None]
    Q = Q[np.abs(robot.pose(Q) - goal).max(axis=(1, 2)) < 1e-9]
    out: list[Array] = []
    for one in Q:
        if not out or apart(np.array(out), one, joints).min() > 1e-4:
            out.append(one)
    return np.array(out).reshape(-1, robot.n)


def check_with_random_starts(robot: Robot, held: tuple[int, ...], poses: int, starts: int) -> None:
    """No posture that random starts find is missing, and they find most of those that are told."""
    inverse, q = inverse_of(robot, held), random_postures(robot, poses, 1)
    targets = robot.pose(q)
    postures = inverse.postures(targets, q[:, list(held)])
    assert not (postures.doubtful | postures.curve).any()
    searched = told = 0
    for i in range(poses):
        ours, theirs = postures.at(i), random_starts(robot, inverse.others, targets[i], q[i], starts, i)
        gap = apart(theirs[:, None], ours[None], inverse.others).min(axis=1)
        assert gap.max() < 1e-5, (i, gap)
        searched, told = searched + len(theirs), told + len(ours)
    assert searched > (0.99 if starts > 5000 else 0.8) * told


@sampled(1, ("name", "held"), [("gen3", (3,)), ("sawyer", (4,)), ("yumi-arm", (3,))])
def test_no_posture_that_random_starts_find_is_missing(name, held):
    check_with_random_starts(hk.load(name), held, 2, 300)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "held"), EVERY + OTHERS)
def test_no_posture_that_ten_thousand_random_starts_find_is_missing(name, held):
    check_with_random_starts(hk.load(name), held, 5, 10_000)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "held"), EVERY + OTHERS)
def test_random_postures_are_found_again_whichever_joint_is_held(name, held):
    check(hk.load(name), held, 2000, 2)


@pytest.mark.parametrize("rows", [GOFA, CRX], ids=["gofa", "crx"])
def test_six_axis_arms_with_an_offset_wrist_have_all_their_postures(rows):
    robot = table(rows, "modified")
    assert isinstance(arm_class(robot, ()), NoClass)
    check(robot, (), 200, 3)
    check_with_random_starts(robot, (), 1, 300)


@pytest.mark.parametrize(
    ("name", "held"), [("panda", (6,)), ("fr3", (4,)), ("xarm7", (3,)), ("irb140", ()), ("ur5e", ())]
)
def test_where_there_is_a_closed_form_the_postures_are_its_own(name, held):
    robot = hk.load(name)
    q = random_postures(robot, 100, 4)
    poses = robot.pose(q)
    found = arm_class(robot, held)
    assert isinstance(found, ArmClass)
    closed = ClosedInverse(found, limits=False)
    answers = closed.answers(poses, q[:, list(held)])
    inverse = inverse_of(robot, held)
    postures = inverse.postures(poses, q[:, list(held)])
    compared = 0
    for i in range(100):
        if (np.abs(answers[i, :, 9]) < 1e-6).any():
            continue  # two postures meet
        theirs, ours = answers[i, answers[i, :, 9] > 0, :6], postures.at(i)[:, inverse.others]
        assert len(theirs) == len(ours) and not postures.doubtful[i]
        assert apart(theirs[:, None], ours[None], list(range(6))).min(axis=1).max() < 1e-6
        compared += 1
    assert compared > 90


def random_arm(rng: np.random.Generator, held: int) -> Robot:
    """Six hinges in frames of any direction, with axes, signs and offsets of any kind, mounted, with a tool; among them
    joints to be held, hinges with a gear and slides, and one more off the chain."""

    def place() -> Array:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.4, 0.4, 3)
        return T

    joints, coordinates = [], []
    extra = set(rng.permutation(6 + held)[:held].tolist())
    for i in range(6 + held):
        slides = i in extra and bool(rng.integers(2))
        gain = float(rng.choice([0.5, -2.0])) if i in extra else float(rng.choice([1.0, -1.0]))
        axis = rng.normal(size=3) if rng.integers(3) else np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
        name = f"held {i}" if i in extra else f"j{i}"
        kind = "prismatic" if slides else "revolute"
        offset = rng.uniform(-1, 1)
        joints.append(Joint(name, kind, i - 1, place(), axis / np.linalg.norm(axis), i, multiplier=gain, offset=offset))
        coordinates.append(Coordinate(name, kind))
    joints.append(Joint("aside", "revolute", 2, place(), np.array([0.0, 0.0, 1.0]), len(joints)))
    coordinates.append(Coordinate("aside", "revolute"))
    return Robot("any", tuple(coordinates), tuple(joints), (Tip("tool", 5 + held, place()),))


@given(st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_random_arms_are_solved_whatever_their_frames_signs_offsets_and_held_joints(seed, held):
    robot = random_arm(np.random.default_rng(seed), held)
    fixed = tuple(i for i, c in enumerate(robot.coordinates) if c.name.startswith("held"))
    check(robot, fixed, 20, seed)


def test_a_mounting_and_a_tool_move_no_posture():
    gen3, mount, tool = hk.load("gen3"), np.eye(4), np.eye(4)
    mount[:3, :3], mount[:3, 3] = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix(), [1 / 3, -np.sqrt(2), 1.1]
    tool[:3, 3] = [0.01, 0.02, 0.123]
    moved = hk.robot.with_tool(hk.robot.with_base_pose(gen3, mount), tool)
    q = random_postures(gen3, 30, 5)
    plain = inverse_of(gen3, (2,)).postures(gen3.pose(q), q[:, [2]])
    other = inverse_of(moved, (2,)).postures(moved.pose(q), q[:, [2]])
    for i in range(30):
        assert len(plain.at(i)) == len(other.at(i))
        assert apart(plain.at(i)[:, None], other.at(i), list(range(7))).min(axis=1).max() < 1e-8


def test_values_are_at_the_turn_nearest_to_the_middle_of_their_range():
    robot = hk.load("sawyer")
    limits = [replace(c, lower=3.0, upper=15.0) if i == 4 else c for i, c in enumerate(robot.coordinates)]
    wide = replace(robot, coordinates=tuple(limits))
    q = random_postures(robot, 20, 6)
    postures = inverse_of(wide, (0,)).postures(robot.pose(q), q[:, [0]])
    assert np.abs(postures.q[:, 4] - 9.0).max() <= np.pi < np.abs(postures.q[:, 4]).max()
    assert gaps(postures, q, list(range(7))).max() < 1e-6


def test_poses_of_single_precision_are_those_of_a_rotation_nearby():
    robot = hk.load("rizon4")
    q = random_postures(robot, 100, 7)
    postures = inverse_of(robot, (2,)).postures(robot.pose(q).astype(np.float32), q[:, 2:3])
    assert postures.residual.max() < 1e-10
    clear = np.linalg.cond(robot.jacobian(q)[:, :, [0, 1, 3, 4, 5, 6]]) < 300
    assert gaps(postures, q, list(range(7)))[clear].max() < 1e-3 and clear.sum() > 80


def test_a_fold_has_a_double_root_and_the_poses_beside_it_two_or_none():
    """Where det J = 0 along a line of postures, two postures meet: s apart along it, as sqrt(s) of the pose."""
    robot = hk.load("sawyer")
    joints = [i for i in range(7) if i != 2]
    det = lambda q: float(np.linalg.det(robot.jacobian(q)[:, joints]))  # noqa: E731
    rng = np.random.default_rng(8)
    checked = 0
    while checked < 5:
        a, b = rng.uniform(-2, 2, (2, 7))
        b[2] = a[2]
        if det(a) * det(b) > 0:
            continue
        for _ in range(60):
            middle = (a + b) / 2
            a, b = (middle, b) if det(a) * det(middle) > 0 else (a, middle)
        U, size, _ = np.linalg.svd(robot.jacobian(a)[:, joints])
        if size[-2] < 1e-2:
            continue
        # The pose itself, and poses a step away along the direction that is lost: on one side two, on the other none.
        pose, inverse = robot.pose(a), inverse_of(robot, (2,))
        double = inverse.postures(pose[None], a[2:3])
        near = apart(double.q, a, joints) < 1e-5
        assert near.sum() == 1 and double.rcond[near] < 1e-6 and not double.curve.any()
        counts = []
        for step in (1e-8, -1e-8):
            beside = pose.copy()
            beside[:3, 3] += step * U[:3, -1]
            beside[:3, :3] = Rotation.from_rotvec(step * U[3:, -1]).as_matrix() @ pose[:3, :3]
            postures = inverse.postures(beside[None], a[2:3])
            close = postures.q[apart(postures.q, a, joints) < 1e-2]
            counts.append(len(close))
            if len(close) == 2:
                assert 1e-5 < apart(close[0], close[1], joints) < 1e-2
        assert sorted(counts) == [0, 2]
        checked += 1


def test_a_curve_of_postures_at_a_pose_is_told_with_points_on_it():
    """YuMi's axes 1 and 3 are the same at q2 = 0, whatever the others are: joints 1 and 3 turn against each other."""
    robot = hk.load("yumi-arm")
    q = random_postures(robot, 10, 9)
    q[5:, 1] = 0.0
    poses = robot.pose(q)
    postures = inverse_of(robot, (6,)).postures(poses, q[:, [6]])
    assert (postures.curve == (np.arange(10) >= 5)).all()
    assert np.abs(robot.pose(postures.q) - poses[postures.row]).max() < 1e-10
    for i in range(5, 10):
        on = np.abs(postures.at(i)[:, 1]) < 1e-6
        assert on.any() and apart(postures.at(i)[on], q[i], [1, 3, 4, 5, 6]).min() < 1e-4
        total = postures.at(i)[on][:, 0] + postures.at(i)[on][:, 2]
        assert np.isfinite(total).all()


@pytest.mark.parametrize(("name", "k"), [("panda", 1), ("panda", 3), ("gen3", 0), ("sawyer", 0)])
def test_postures_of_right_angles_are_found_again_or_what_is_singular_is_told(name, k):
    """Half of the joints at multiples of 45 degrees: axes that are the same or parallel, equations that are singular.

    A Panda's axes 1 and 3 are the same, and all its postures singular, where joint 2 is held at 0.
    """
    robot = hk.load(name)
    inverse, q = inverse_of(robot, (k,)), random_postures(robot, 128, 10)
    rng = np.random.default_rng(11)
    q = np.where(rng.random(q.shape) < 0.5, rng.integers(-3, 4, q.shape) * np.pi / 4, q)
    poses = robot.pose(q)
    postures = inverse.postures(poses, q[:, [k]])
    assert np.abs(robot.pose(postures.q) - poses[postures.row]).max() < 1e-12
    again = gaps(postures, q, inverse.others) < 1e-5
    assert (again | postures.doubtful | postures.curve).all()
    if name == "panda" and k == 1:
        assert postures.doubtful[q[:, 1] == 0].all() and (q[:, 1] == 0).sum() > 5
    condition = np.linalg.cond(robot.jacobian(q)[:, :, inverse.others])
    assert again[condition < 1e4].all() and (condition < 1e4).sum() > 60


def test_where_all_equations_are_singular_regular_postures_are_found_from_poses_beside():
    """At these poses the elimination fails from whichever joint it starts; the postures themselves are regular."""
    right = np.pi / 4
    for name, k, turns, count in (
        ("sawyer", 0, [0.3 / right, 2, 1, 0, -3, 2, -2], 4),
        ("gen3", 0, [2, 2, -3, -2, 2, -1, 3], 8),
    ):
        robot, q = hk.load(name), right * np.array(turns, dtype=float)
        inverse, pose = inverse_of(robot, (k,)), robot.pose(q)
        postures = inverse.postures(pose[None], q[[k]])
        assert postures.doubtful.all() and len(postures.q) == count
        assert gaps(postures, q[None], inverse.others) < 1e-6
        theirs = random_starts(robot, inverse.others, pose, q, 200, 12)
        assert apart(theirs[:, None], postures.q, inverse.others).min(axis=1).max() < 1e-5


def test_where_no_root_can_be_polished_the_pose_is_doubtful():
    """An xArm's file misses the axes' meeting by 1e-6, so with joint 4 held all its postures are singular to 1e-8."""
    robot = hk.load("xarm7")
    q = np.array([2.2144, 1.0683, -2.5758, -3.0538, 2.5959, 2.8772, -0.9589])
    q = q + np.random.default_rng(13).uniform(-1e-3, 1e-3, (40, 7))
    postures = inverse_of(robot, (3,)).postures(robot.pose(q), q[:, [3]])
    again = gaps(postures, q, [0, 1, 2, 4, 5, 6]) < 1e-3
    assert (again | postures.doubtful).all() and not again.all()


def test_three_axes_that_are_parallel_at_one_value_alone_are_solved_there_too():
    """Axes 2, 3 and 4 of a UR with a joint between them that tilts them."""
    ur = hk.load("ur5e")
    tilt = Joint("tilt", "revolute", 1, np.eye(4), np.array([1.0, 0.0, 0.0]), 6)
    joints = [*ur.joints[:2], tilt, *(replace(j, parent=j.parent + 1) for j in ur.joints[2:])]
    tips = tuple(replace(tip, joint=tip.joint + 1) for tip in ur.tips)
    robot = replace(ur, joints=tuple(joints), tips=tips, coordinates=(*ur.coordinates, Coordinate("tilt", "revolute")))
    robot = replace(robot, bodies=(), shapes=(), visuals=())
    assert isinstance(arm_class(robot, (6,)), NoClass)
    inverse, q = inverse_of(robot, (6,)), random_postures(robot, 60, 11)
    q[30:, 6] = 0.0
    postures = inverse.postures(robot.pose(q), q[:, [6]])
    assert gaps(postures, q, inverse.others)[~postures.doubtful].max() < 1e-6 and postures.doubtful.sum() < 3


def test_what_is_no_arm_of_it_is_told_with_the_reason():
    singular = general_inverse(hk.load("iiwa14"), (3,))
    assert isinstance(singular, NoClass) and singular.singular and "cannot move the tool in all" in singular.reason
    for robot, held, reason in (
        (hk.load("panda"), (), "7 joints are left"),
        (hk.load("panda"), (1, 2), "5 joints are left"),
        (hk.load("rail-ur10e"), (6,), "a slide is left"),
    ):
        none = general_inverse(robot, held)
        assert isinstance(none, NoClass) and reason in none.reason
    flat = table([(0.3, 0, 0.1 * i, 0) for i in range(6)])
    none = general_inverse(flat, ())
    assert isinstance(none, NoClass) and none.singular
