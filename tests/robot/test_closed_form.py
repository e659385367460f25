"""Closed-form inverses: EAIK and the robot's own pose are the referees, and det J the witness of the signs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from holokin.base.errors import BranchError, JointLimitError
from holokin.base.types import Array
from holokin.robot import Robot
from holokin.robot.closed_form import ArmClass, ClosedInverse, NoClass, arm_class
from holokin.robot.closed_form.closed_inverse import SIGNS
from holokin.robot.closed_form.six_hinges import Wave, _root_of_degree_four
from holokin.robot.joints import Coordinate, Joint, Tip
from holokin.symbolic import Function, symbol, vertcat
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
FOURTH = [("panda", (4,)), ("fr3", (4,)), ("xarm7", (4,))]
"""Those that leave a step of degree four."""
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


@pytest.mark.parametrize("name", ["gen3", "sawyer", "yumi-arm", "rizon4"])
def test_other_arms_have_no_class_whichever_joint_is_held(name):
    assert not any(isinstance(arm_class(hk.load(name), (k,)), ArmClass) for k in range(7))


@sampled(14, ("name", "held"), PAIRS + SIX + FOURTH)
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
        Q, theirs = np.asarray(solver.IK(turned[i]).Q), np.repeat(q[:1], 0, axis=0)
        if len(Q):
            theirs = np.repeat(q[:1], len(Q), axis=0)
            theirs[:, rest] = Q[:, rest] if Q.shape[1] == robot.n else Q
        # What EAIK offers for a step of degree four has some that miss the pose by centimetres.
        Q = theirs[np.abs(robot.pose(theirs) - poses[i]).max(axis=(1, 2)) < 1e-6][:, rest]
        ours = found[i][answers[i, :, REAL] > 0][:, rest]
        if (np.abs(answers[i, :, REAL]) < 1e-6).any():
            continue  # two postures meet
        assert len(ours) == len(Q), (i, len(ours), len(Q))
        assert apart(ours[:, None], Q[None]).min(axis=0).max() < 1e-8
        compared += 1
    assert compared > 0.9 * count


@pytest.mark.parametrize(("name", "held"), [("panda", (6,)), ("iiwa14", (2,)), ("xarm7", (5,)), ("ur5e", ()), *FOURTH])
def test_postures_and_their_number_are_those_of_eaik(name, held):
    check_with_eaik(name, held, 40)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "held"), PAIRS + SIX[:3] + FOURTH)
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
    elif kind == "three meet":
        steps += [place(turn(), anywhere()), place(turn(), anywhere())]
    if kind == "three parallel":
        steps += [place(turn(), anywhere()), place(parallel, anywhere()), place(parallel, anywhere())]
        steps += [place(turn(), anywhere()), place(turn(), along())]
    else:
        steps += [place(turn(), anywhere()), place(turn(), np.zeros(3)), place(turn(), np.array([slip, slip, 0.0]))]
    joints = [Joint(f"j{i}", "revolute", i - 1, T, np.array([0.0, 0.0, 1.0]), i) for i, T in enumerate(steps)]
    coordinates = tuple(Coordinate(joint.name, "revolute") for joint in joints)
    return Robot(kind, coordinates, tuple(joints), (Tip("tool", 5, place(turn(), anywhere())),))


KINDS = ("pair meets", "pair parallel", "inner pair", "three parallel", "three meet")


def check_random_arms(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for i in range(count):
        robot = random_arm(rng, KINDS[i % 5])
        q, poses = poses_of(robot, 20, i)
        found, answers = postures_of(inverse_of(robot, ()), q, poses)
        real = answers[:, :, REAL] > 1e-8
        clear = (np.abs(answers[:, :, REAL]) > 1e-7).all(axis=1)  # elsewhere two postures nearly meet
        assert np.where(real, apart(found, q[:, None]), np.inf).min(axis=1)[clear].max() < 1e-4
        assert clear.mean() > 0.9
        assert np.abs(robot.pose(found[real]) - np.repeat(poses, real.sum(axis=1), axis=0)).max() < 1e-9


def test_random_arms_of_each_class_are_recognised_and_solved_whatever_their_frames():
    check_random_arms(15, 3)


@pytest.mark.campaign
def test_many_random_arms_of_each_class_are_recognised_and_solved():
    check_random_arms(1000, 4)


def test_near_misses_are_refused_with_their_distance_and_slips_of_a_file_are_snapped_and_polished():
    rng = np.random.default_rng(5)
    for kind in (*KINDS[:3], KINDS[4]):
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


@pytest.mark.parametrize("turn", [[0, np.pi / 2, 0], [0.3, -0.7, 1.1]], ids=["upright", "aslant"])
def test_a_mounting_a_tool_and_names_change_nothing(turn):
    panda, mount = hk.load("panda"), np.eye(4)
    mount[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    mount[:3, 3] = [1 / 3, -np.sqrt(2), 1.1]
    moved = hk.robot.with_base_pose(panda, mount)
    tool = np.eye(4)
    tool[:3, 3] = [0.01, 0.02, 0.123]
    held = hk.robot.with_tool(moved, tool)
    assert inverse_of(held, (6,)).arm.exact
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


def with_spin(robot: Robot, axis: Array) -> Robot:
    """The robot with a hinge more, about an axis (3,) of its tool: a task that does not see the spin leaves it free."""
    tip = robot.tips[0]
    spin = Joint("spin", "revolute", tip.joint, tip.placement, axis, robot.n)
    tips = (Tip("spinning tool", len(robot.joints), np.eye(4)),)
    return replace(
        robot, coordinates=(*robot.coordinates, Coordinate("spin", "revolute")), joints=(*robot.joints, spin), tips=tips
    )


SPINS = [
    ("ur5e", 0.0, {5: True, 6: True}),
    ("ur5e", 0.6, {4: True, 6: True}),
    ("irb140", 0.0, {5: True, 6: True}),
    ("irb140", 0.6, {6: True}),
]


@pytest.mark.parametrize(("name", "tilt", "classes"), SPINS)
def test_a_free_spin_is_a_last_hinge_about_the_tools_axis(name, tilt, classes):
    """The spin itself is held, or the last joint if the tool is straight, or joint 5 of a UR with a bent tool."""
    robot = with_spin(hk.load(name), np.array([np.sin(tilt), 0.0, np.cos(tilt)]))
    found = {k: arm_class(robot, (k,)) for k in range(robot.n)}
    assert {k: arm.form.family.quadratic for k, arm in found.items() if isinstance(arm, ArmClass)} == classes
    q, poses = poses_of(robot, 30, 8)
    for k in classes:
        postures, answers = postures_of(inverse_of(robot, (k,)), q, poses)
        gap = np.where(answers[:, :, REAL] > 1e-9, apart(postures, q[:, None]), np.inf).min(axis=1)
        assert gap.max() < 1e-6


def test_an_arm_on_a_rail_with_a_free_spin_has_a_class_with_both_held():
    robot = with_spin(hk.load("rail-ur10e"), np.array([0.0, 0.6, 0.8]))
    q, poses = poses_of(robot, 30, 9)
    postures, answers = postures_of(inverse_of(robot, (0, 7)), q, poses)
    gap = np.where(answers[:, :, REAL] > 1e-9, apart(postures, q[:, None]), np.inf).min(axis=1)
    assert gap.max() < 1e-6
    assert isinstance(arm_class(robot, (0,)), NoClass)


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


WAVES = {
    "general": lambda W: W,
    "a circle, so two lines are one at infinity": lambda W: (
        W * [[1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 1]] + [[0, 0.7, 0], [0, 0, 0.7], [0, 0, 0], [0, 0, 0]]
    ),
    "nearly one wave": lambda W: W * [[1, 1, 1], [1, 1e-3, 1e-3], [1, 1e-3, 1e-3], [1, 1, 1]],
    "roots in pairs q and -q": lambda W: W * [[1, 1, 0]] * np.ones((4, 1)),
    "roots in pairs q and pi - q": lambda W: W * [[1, 0, 1]] * np.ones((4, 1)),
}


@pytest.mark.parametrize("kind", WAVES)
def test_all_real_roots_of_the_step_of_degree_four_are_found(kind):
    """u^2 + v^2 + w^2 = k, each mean + a cos q + b sin q. Referee: NumPy's roots of the polynomial in exp(i q)."""
    waves, signs = symbol("waves", 12), symbol("signs", 2)
    every = [Wave(*(waves[3 * i + j] for j in range(3))) for i in range(4)]
    root = _root_of_degree_four(every[:3], every[3], [signs[0], signs[1]])
    solve = Function("root", {"w": waves, "s": signs}, {"y": vertcat(root.turn.cos, root.turn.sin, root.share)})
    rng, counts = np.random.default_rng(6), set()
    for trial in range(100):
        W, q = WAVES[kind](rng.normal(size=(4, 3))), rng.uniform(-3, 3)
        values = W @ [1, np.cos(q), np.sin(q)]
        if trial % 2:
            W[3, 0] += np.sum(values[:3] ** 2) - values[3]  # q is a root
        cosine, sine, share = np.array([solve(W.ravel(), s[1:]) for s in SIGNS[:4]]).reshape(4, 3).T
        powers = np.column_stack([(W[:, 1] - 1j * W[:, 2]) / 2, W[:, 0], (W[:, 1] + 1j * W[:, 2]) / 2])
        polynomial = sum(np.convolve(row, row) for row in powers[:3]) - np.pad(powers[3], 1)
        z = np.roots(polynomial)
        if np.abs(share).min() < 1e-6:
            continue  # two roots meet
        theirs, ours = np.angle(z[np.abs(np.abs(z) - 1) < 1e-6]), np.arctan2(sine, cosine)[share > 0]
        assert len(ours) == len(theirs)
        assert all(apart(ours[:, None], np.array([angle])).min() < 1e-9 for angle in theirs)
        angles = np.arctan2(sine, cosine)
        apart_on_line = np.sin((angles[[0, 2]] - angles[[1, 3]]) / 2) ** 2
        assert np.abs(np.where(share > 0, np.repeat(apart_on_line, 2) - share, 0)).max() < 1e-8
        counts.add(len(ours))
    assert counts == ({0, 2} if "circle" in kind else {0, 2, 4})


def test_where_a_closed_form_tells_that_a_posture_exists_a_refusal_searches_for_none(monkeypatch):
    def search(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("holokin.motion.self_motions.pose_reach.nearest_postures", search)
    robot, refused = hk.load("ur5e"), 0
    ik = hk.ik(hk.moore_penrose(hk.pose(robot)), [0.0, -1.2, 1.5, -1.8, -1.5, 0.3])
    for pose in poses_of(robot, 20, 9)[1]:
        assert len(ik.all(pose))
        try:
            ik(pose)
        except BranchError as problem:
            refused += "leads no farther" in str(problem)
        except JointLimitError:
            continue
    assert refused > 3
