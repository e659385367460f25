"""Closed-form inverses: EAIK and the robot's own pose are the referees, and det J the witness of the signs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import BranchError, JointLimitError
from holokin.base.types import Array
from holokin.robot import Robot
from holokin.robot.closed_form import ArmClass, ClosedInverse, NoClass, arm_class
from holokin.robot.joints import Coordinate, Joint, Tip
from holokin.symbolic.native import compiler

REAL = 9
"""The column of an answer that says how real it is."""

PROVEN = {
    "panda": (3, 5, 6),
    "fr3": (3, 5, 6),
    "xarm7": (3, 5, 6),
    "iiwa7": (0, 1, 2, 4, 5, 6),
    "iiwa14": (0, 1, 2, 4, 5, 6),
    "openarm-left": (0, 1, 2, 4, 5, 6),
}
"""Joints that, held, leave steps of degree two: 27 of 42 of these arms [theory of subproblems, Elias and Wen 2022]."""

PAIRS = [(name, (k,)) for name, joints in PROVEN.items() for k in joints]
SIX = [("ur5e", ()), ("ur10e", ()), ("irb140", ()), ("rail-ur10e", (0,))]


def poses_of(robot: Robot, count: int, seed: int) -> tuple[Array, Array]:
    """Random postures (k, n), slides within 1 m, and their tool poses (k, 4, 4)."""
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, robot.n)) / np.where(robot.hinges, 1.0, np.pi)
    return q, robot.pose(q)


def apart(q: Array, other: Array) -> Array:
    """Largest difference of joints (...,) of postures, whole turns aside."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def inverse_of(robot: Robot, held: tuple[int, ...]) -> ClosedInverse:
    found = arm_class(robot, held)
    assert isinstance(found, ArmClass), found
    return ClosedInverse(found, limits=False)


def postures_of(inverse: ClosedInverse, q: Array, poses: Array) -> tuple[Array, Array]:
    """All postures (k, 8, n) at poses, with the held joints as they are in q, and the answers (k, 8, 12)."""
    answers = inverse.answers(poses, q[:, list(inverse.arm.held)])
    out = np.repeat(q[:, None], 8, axis=1)
    out[:, :, inverse.others] = answers[:, :, :6]
    return out, answers


def test_27_of_42_held_joints_leave_a_class_and_the_others_say_why_not():
    for name, joints in PROVEN.items():
        robot = hk.load(name)
        found = [k for k in range(7) if isinstance(arm_class(robot, (k,)), ArmClass)]
        assert tuple(found) == joints
    singular = arm_class(hk.load("iiwa14"), (3,))
    assert isinstance(singular, NoClass) and "singular" in singular.reason


@pytest.mark.parametrize("name", ["gen3", "sawyer", "yumi-arm", "rizon4"])
def test_other_arms_have_no_class_whichever_joint_is_held(name):
    assert not any(isinstance(arm_class(hk.load(name), (k,)), ArmClass) for k in range(7))


@pytest.mark.parametrize(("name", "held"), PAIRS + SIX)
def test_every_posture_is_found_again_every_answer_has_the_pose_and_the_signs_are_those_of_the_determinant(name, held):
    robot = hk.load(name)
    q, poses = poses_of(robot, 200, 1)
    inverse = inverse_of(robot, held)
    found, answers = postures_of(inverse, q, poses)
    real = answers[:, :, REAL] > 1e-9
    gap = np.where(answers[:, :, REAL] > -1e-9, apart(found, q[:, None]), np.inf).min(axis=1)
    # Where two postures nearly meet the angles are known to the root of round-off alone.
    assert gap[(np.abs(answers[:, :, REAL]) > 1e-7).all(axis=1)].max() < 1e-6
    assert gap.max() < 1e-3 and np.median(gap) < 1e-13
    reached = robot.pose(found[real])
    assert np.abs(reached - np.repeat(poses, real.sum(axis=1), axis=0)).max() < 1e-12
    rest = [i for i in range(robot.n) if i not in held]
    det = np.linalg.det(robot.jacobian(found[real])[:, :, rest])
    product = answers[real][:, 6:9].prod(axis=1)
    ratio = det / product
    assert np.abs(np.abs(ratio) - 1).max() < 1e-6 and (ratio > 0).all() in (True, False)
    assert len(np.unique(np.sign(ratio))) == 1


def eaik_of(robot: Robot, held: dict[int, float]):
    """The same arm as EAIK has it: axes and points between them at q = 0, in the base frame."""
    eaik = pytest.importorskip("eaik.IK_HP", reason="EAIK: pip install EAIK")
    pose, axes, points = np.eye(4), [], []
    for joint in robot.joints:
        pose = pose @ joint.placement
        axes.append(pose[:3, :3] @ joint.axis)
        points.append(pose[:3, 3])
    points = [np.zeros(3), *points, robot.pose(np.zeros(robot.n))[:3, 3]]
    steps = np.array([b - a for a, b in pairwise(points)])
    return eaik.HPRobot(np.array(axes), steps, list(held.items())), robot.pose(np.zeros(robot.n))[:3, :3]


def check_with_eaik(name: str, held: tuple[int, ...], count: int) -> None:
    robot = hk.load(name)
    q, _ = poses_of(robot, count, 2)
    q[:, list(held)] = q[0, list(held)]
    poses = robot.pose(q)
    found, answers = postures_of(inverse_of(robot, held), q, poses)
    solver, home = eaik_of(robot, {k: float(q[0, k]) for k in held})
    turned = poses.copy()
    turned[:, :3, :3] = poses[:, :3, :3] @ home.T
    rest = [i for i in range(robot.n) if i not in held]
    compared = 0
    for i in range(count):
        theirs = solver.IK(turned[i])
        Q = np.asarray(theirs.Q)[~np.asarray(theirs.is_LS, dtype=bool)]
        Q = Q[:, rest] if Q.shape[1] == robot.n else Q
        ours = found[i][answers[i, :, REAL] > 0][:, rest]
        if (np.abs(answers[i, :, REAL]) < 1e-6).any():
            continue  # two postures meet
        assert len(ours) == len(Q), (i, len(ours), len(Q))
        assert apart(ours[:, None], Q[None]).min(axis=0).max() < 1e-8
        compared += 1
    assert compared > 0.9 * count


@pytest.mark.parametrize(("name", "held"), [("panda", (6,)), ("iiwa14", (2,)), ("xarm7", (5,)), ("ur5e", ())])
def test_postures_and_their_number_are_those_of_eaik(name, held):
    check_with_eaik(name, held, 40)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "held"), PAIRS + SIX[:3])
def test_postures_and_their_number_are_those_of_eaik_for_every_arm(name, held):
    check_with_eaik(name, held, 1000)


def random_arm(rng: np.random.Generator, kind: str, slip: float = 0.0) -> Robot:
    """Six hinges of a class, in frames of any direction, mounted and with a tool; `slip` [m] moves one axis away.

    Consecutive frames differ by a turn, of two decimals in each angle, and a shift in whole millimetres: along the axis
    before where two axes meet, by none where three do.
    """

    def turn() -> Array:
        from scipy.spatial.transform import Rotation

        return Rotation.from_euler("xyz", rng.uniform(-1.5, 1.5, 3).round(2)).as_matrix()

    def place(R: Array, shift: Array) -> Array:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, np.round(shift, 3)
        return T

    anywhere = lambda: rng.uniform(-0.5, 0.5, 3)  # noqa: E731
    along = lambda: np.array([0.0, 0.0, rng.uniform(0.1, 0.5)])  # noqa: E731
    parallel = np.eye(3)
    steps = [place(turn(), anywhere())]
    if kind == "pair meets":
        steps += [place(turn(), along()), place(turn(), anywhere())]
    elif kind == "pair parallel":
        steps += [place(parallel, anywhere()), place(turn(), anywhere())]
    elif kind == "inner pair":
        steps += [place(turn(), anywhere()), place(turn(), along())]
    if kind == "three parallel":
        steps += [place(turn(), anywhere()), place(parallel, anywhere()), place(parallel, anywhere())]
        steps += [place(turn(), anywhere()), place(turn(), along())]
    else:
        steps += [place(turn(), anywhere()), place(turn(), np.zeros(3)), place(turn(), np.array([slip, slip, 0.0]))]
    joints = [Joint(f"j{i}", "revolute", i - 1, T, np.array([0.0, 0.0, 1.0]), i) for i, T in enumerate(steps)]
    coordinates = tuple(Coordinate(joint.name, "revolute") for joint in joints)
    return Robot(kind, coordinates, tuple(joints), (Tip("tool", 5, place(turn(), anywhere())),))


KINDS = ("pair meets", "pair parallel", "inner pair", "three parallel")


def check_random_arms(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for i in range(count):
        robot = random_arm(rng, KINDS[i % 4])
        q, poses = poses_of(robot, 20, i)
        found, answers = postures_of(inverse_of(robot, ()), q, poses)
        real = answers[:, :, REAL] > 1e-8
        assert np.where(real, apart(found, q[:, None]), np.inf).min(axis=1).max() < 1e-4
        assert np.abs(robot.pose(found[real]) - np.repeat(poses, real.sum(axis=1), axis=0)).max() < 1e-9


def test_random_arms_of_each_class_are_recognised_and_solved_whatever_their_frames():
    check_random_arms(12, 3)


@pytest.mark.campaign
def test_many_random_arms_of_each_class_are_recognised_and_solved():
    check_random_arms(1000, 4)


def test_near_misses_are_refused_with_their_distance_and_slips_of_a_file_are_snapped_and_polished():
    rng = np.random.default_rng(5)
    for kind in KINDS[:3]:
        missed = arm_class(random_arm(rng, kind, slip=3e-3), ())
        assert isinstance(missed, NoClass) and 1e-4 < missed.miss < 5e-3, kind
    panda = hk.load("panda")
    placement = panda.joints[1].placement.copy()
    placement[0, 3] += 8e-6  # axis 2 no longer meets axes 1 and 3
    joints = (panda.joints[0], replace(panda.joints[1], placement=placement), *panda.joints[2:])
    slipped = replace(panda, joints=joints)
    found = arm_class(slipped, (6,))
    assert isinstance(found, ArmClass) and 7e-6 < found.distance < 1e-4
    q, poses = poses_of(slipped, 50, 6)
    postures, answers = postures_of(ClosedInverse(found, limits=False), q, poses)
    clear = answers[:, :, REAL] > 1e-3
    missing = np.abs(slipped.pose(postures[clear]) - np.repeat(poses, clear.sum(axis=1), axis=0)).max(axis=(1, 2))
    assert missing.max() < 1e-9 and np.median(missing) < 1e-12


def test_a_mounting_a_tool_and_names_change_nothing():
    panda, mount = hk.load("panda"), np.eye(4)
    mount[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    mount[:3, 3] = [0.2, -0.4, 1.1]
    moved = hk.robot.with_base_pose(panda, mount)
    tool = np.eye(4)
    tool[:3, 3] = [0.01, 0.02, 0.123]
    held = hk.robot.with_tool(moved, tool)
    q, poses = poses_of(held, 30, 7)
    found, answers = postures_of(inverse_of(held, (6,)), q, poses)
    real = answers[:, :, REAL] > 1e-9
    assert np.where(real, apart(found, q[:, None]), np.inf).min(axis=1).max() < 1e-5


@pytest.mark.skipif(compiler() is None, reason="no C compiler here")
@pytest.mark.parametrize(("name", "held"), [("panda", (3,)), ("panda", (6,)), ("iiwa14", (2,)), *SIX])
def test_answers_without_a_compiler_are_those_of_native_code(name, held, monkeypatch):
    q, poses = poses_of(hk.load(name), 40, 8)
    native = inverse_of(hk.load(name), held)
    many, one = postures_of(native, q, poses)[1], native.at(q[0, list(held)]).one(poses[0])
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    machine = inverse_of(hk.load(name), held)
    assert machine.kernel is None and native.kernel is None
    for same, answers in ((many, postures_of(machine, q, poses)[1]), (one, machine.at(q[0, list(held)]).one(poses[0]))):
        real = answers[..., REAL] > 1e-3  # nearer to 0 two postures meet, and round-off counts more
        assert apart(answers[real][:, :6], same[real][:, :6]).max() < 1e-12
        assert np.abs(answers[real][:, 6:9] - same[real][:, 6:9]).max() < 1e-12
        assert np.abs(answers[..., [REAL, 11]] - same[..., [REAL, 11]]).max() < 1e-12
        assert real.sum() >= (1 if real.ndim == 1 else 80)


def test_a_matrix_that_is_no_pose_is_refused_by_a_closed_form_too():
    panda, start = hk.load("panda"), [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    pose = panda.pose(start)
    mirrored, lost = pose @ np.diag([1.0, 1.0, -1.0, 1.0]), pose.copy()
    lost[0, 3] = np.nan
    ik = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(6)), start)
    assert ik.all(pose.astype(np.float32)).closed and len(ik.all(pose)) + ik.all(pose).outside == 8
    for bad in (mirrored, 1.01 * pose, pose.T, lost):
        with pytest.raises(hk.HolokinError, match="a tool pose"):
            ik.all(bad)


def test_where_a_closed_form_tells_that_a_posture_exists_a_refusal_searches_for_none(monkeypatch):
    def search(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("holokin.motion.ik.pose_paths.nearest_postures", search)
    robot, refused = hk.load("ur5e"), 0
    ik = hk.ik(hk.moore_penrose(hk.pose(robot)), [0.0, -1.2, 1.5, -1.8, -1.5, 0.3])
    for pose in poses_of(robot, 20, 9)[1]:
        assert len(ik.all(pose))
        try:
            ik(pose)
        except BranchError as problem:
            refused += "ends" in str(problem)
        except JointLimitError:
            continue
    assert refused > 3
