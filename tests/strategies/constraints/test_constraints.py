"""Arm angle, height, stationary: against closed forms, their singular sets, and the leaves they hold."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import holokin as hk
from conftest import IIWA_START, IRB_START, PANDA_START, urdf
from holokin.base.errors import (
    ArgumentError,
    NoArmError,
    RowsError,
    ShapeError,
    SingularityError,
    SingularityKind,
    UnknownNameError,
)
from holokin.strategies.constraints import Constraint
from holokin.symbolic import Function, jacobian, symbol
from holokin.symbolic.linear import null_vector_expression

R3_START = np.array([0.3, 0.9, 0.7])


def value_and_gradient(robot: hk.Robot, constraint: hk.Constraint) -> Function:
    task = hk.pose(robot) if robot.n == 7 else hk.position(robot)
    q = symbol("q", robot.n)
    g = constraint.bind(task, robot.kinematics(q), q)
    return Function("g", {"q": q}, {"g": g, "J": jacobian(g, q)})


def elias_wen(robot: hk.Robot, q: np.ndarray, V: np.ndarray, R: np.ndarray) -> tuple[float, np.ndarray]:
    """psi and its Jacobian in the closed form of [EW23], from joint positions and axes alone (theory 2i)."""
    (line,) = robot.skeleton(q)
    S, E, W = line[2], line[4] - line[2], line[6] - line[2]
    w = W / np.linalg.norm(W)
    n_ref = np.cross(w - R, V)
    n_sew = np.cross(W, E)
    psi = np.arctan2(n_sew @ np.cross(w, n_ref), n_sew @ n_ref)
    P = E - w * (w @ E)
    p = P / np.linalg.norm(P)
    a = np.linalg.norm(np.cross(n_ref, W))
    x = np.cross(n_ref, W) / a
    y = np.cross(w, x)
    J_e = np.cross(w, p) / np.linalg.norm(P)
    J_w = (
        (w @ V) / a * y
        + (w @ np.cross(R, V)) / a * x
        - (w @ E) / (np.linalg.norm(W) * np.linalg.norm(P)) * np.cross(w, p)
    )

    def moves(point: np.ndarray, joints: int) -> np.ndarray:
        columns = np.zeros((3, 7))
        for i in range(joints):
            locked = hk.load("iiwa14")
            axis = locked.jacobian(q)[3:, i]
            columns[:, i] = np.cross(axis, point - line[i + 1])
        return columns

    shoulder = moves(S, 2)
    return psi, J_e @ (moves(S + E, 4) - shoulder) + J_w @ (moves(S + W, 6) - shoulder)


def test_the_stereographic_arm_angle_and_its_jacobian_are_elias_and_wens_T13(iiwa14: hk.Robot) -> None:
    V, R = np.array([0, 0, 1.0]), np.array([-1.0, 0, 0])
    f = value_and_gradient(iiwa14, hk.arm_angle())
    for q in np.random.default_rng(0).uniform(-1.2, 1.2, (10, 7)):
        psi, J = elias_wen(iiwa14, q, V, R)
        value, gradient = f(q)
        assert value == pytest.approx(psi, abs=1e-13)
        assert np.abs(gradient - J).max() < 1e-11


@pytest.mark.parametrize("kind", ["stereographic", "conventional"])
def test_turning_the_arm_about_its_line_turns_the_arm_angle_as_much(iiwa14: hk.Robot, kind: str) -> None:
    """Along the self-motion the elbow circles about the line shoulder-wrist: d psi = circle angle."""
    constraint = hk.arm_angle(definition=kind)
    f = value_and_gradient(iiwa14, constraint)
    task = hk.pose(iiwa14)
    q = IIWA_START + 0.1
    psi, gradient = f(q)
    N = task.null_space(q)[:, 0]
    (line,) = iiwa14.skeleton(q)
    h = 1e-6
    (after,) = iiwa14.skeleton(q + h * N)
    w = (line[6] - line[2]) / np.linalg.norm(line[6] - line[2])
    arm = (line[4] - line[2]) - w * (w @ (line[4] - line[2]))
    circled = np.cross(arm, after[4] - line[4]) @ w / (arm @ arm) / h
    assert gradient @ N == pytest.approx(circled, rel=1e-5)
    assert isinstance(psi, float)


@pytest.mark.campaign
def test_the_arm_angle_is_kept_round_a_circle_and_the_arm_comes_home(iiwa14: hk.Robot, panda: hk.Robot) -> None:
    for robot, start in ((iiwa14, np.array([0.1, 0.6, 0.1, -1.4, 0.0, 0.6, 0.0])), (panda, PANDA_START)):
        strategy = hk.holonomic(hk.pose(robot), hk.arm_angle())
        point = robot.pose(start)[:3, 3]
        result = hk.drift(strategy, hk.circle(point, point - [0.08, 0, 0]), start, cycles=3, samples=80)
        assert result.largest.max() < 1e-12
        assert result.trajectory.residual.max() < 1e-12
        assert hk.involutivity(strategy, hk.around(start, 0.1)).relative < 1e-12


def test_the_arm_angles_singular_sets(iiwa14: hk.Robot) -> None:
    """Wrist above the shoulder: conventional about z is undefined, stereographic is not; along the pole the reverse."""
    task = hk.pose(iiwa14)
    q4 = 1.2
    # bend the elbow and tilt the shoulder so that the wrist is straight above
    alpha = np.arctan2(0.40 * np.sin(q4), 0.42 + 0.40 * np.cos(q4))
    above = np.array([0.0, alpha, 0.0, q4, 0.3, 0.6, 0.1])
    (line,) = iiwa14.skeleton(above)
    assert line[6][:2] == pytest.approx([0, 0], abs=1e-12)
    hk.holonomic(task, hk.arm_angle())(above)
    with pytest.raises(SingularityError) as caught:
        hk.holonomic(task, hk.arm_angle(definition="conventional"))(above)
    assert caught.value.kind is SingularityKind.REPRESENTATION
    behind = above + np.array([0, -np.pi / 2, 0, 0, 0, 0, 0])  # the wrist along -x, the pole
    (line,) = iiwa14.skeleton(behind)
    assert (line[6] - line[2])[1:] == pytest.approx([0, 0], abs=1e-12)
    assert (line[6] - line[2])[0] < 0
    with pytest.raises(SingularityError) as caught:
        hk.holonomic(task, hk.arm_angle())(behind)
    assert caught.value.kind is SingularityKind.REPRESENTATION
    hk.holonomic(task, hk.arm_angle(definition="conventional"))(behind)
    ahead = above + np.array([0, np.pi / 2, 0, 0, 0, 0, 0])
    hk.holonomic(task, hk.arm_angle())(ahead)  # the other end of the pole is sound: a half line only


def test_the_height_of_the_elbow_is_held(panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    start = PANDA_START + np.array([0, 0, 0.7, 0, 0, 0, 0])  # the elbow aside: at its top the height cannot steer it
    point = panda.pose(start)[:3, 3]
    walk = hk.follow(strategy, hk.circle(point, point - [0.02, 0, 0]), start, samples=60)
    heights = [panda.skeleton(q)[0][4, 2] for q in walk.q]
    assert np.ptp(heights) < 1e-13
    assert np.abs(walk.drift()).max() < 1e-12


@pytest.mark.parametrize(
    "cost",
    [
        hk.strategies.constraints.posture_cost(R3_START + 0.2, [1.0, 2.0, 0.5]),
        hk.strategies.constraints.centring_cost(),
        hk.strategies.constraints.manipulability_cost(),
        lambda q: ca.dot(q, q),
    ],
    ids=["posture", "centring", "manipulability", "custom"],
)
def test_on_the_zero_leaf_the_cost_is_stationary_along_self_motions(planar_3r: hk.Robot, cost) -> None:
    """An independent search along the self-motion (scipy) finds the same posture; the leaf then holds it."""
    task = hk.position(planar_3r)
    constraint = hk.stationary(cost)
    strategy = hk.holonomic(task, constraint)
    q = symbol("q", 3)
    U = (
        cost.expression(task, planar_3r.kinematics(q), q)
        if isinstance(cost, hk.strategies.constraints.Cost)
        else cost(q)
    )
    energy = Function("U", {"q": q}, {"U": U})
    x = task(R3_START)
    found = minimize(
        lambda p: energy(p), R3_START, method="SLSQP", tol=1e-15,
        constraints={"type": "eq", "fun": lambda p: task(p) - x, "jac": lambda p: task.jacobian(p)},
        options={"maxiter": 300},
    ).x  # fmt: skip
    g = strategy.constraint_value
    assert abs(g(found)) < 1e-5
    point = planar_3r.pose(found)[:3, 3]
    walk = hk.follow(strategy, hk.circle(point, point - [0.1, 0, 0]), found, samples=60)
    assert np.abs(walk.drift()).max() < 1e-12
    for posture in walk.q[::10]:
        N, h = task.null_space(posture)[:, 0], 1e-6
        assert (energy(posture + h * N) - energy(posture - h * N)) / (2 * h) == pytest.approx(0.0, abs=2e-5)


def test_baillieuls_and_changs_forms_share_the_zero_leaf(planar_3r: hk.Robot) -> None:
    cost = hk.strategies.constraints.posture_cost([0.1, 0.4, 0.9])
    a = value_and_gradient(planar_3r, hk.stationary(cost))
    b = value_and_gradient(planar_3r, hk.stationary(cost, free=("q3",)))
    for q in np.random.default_rng(2).uniform(-1, 1, (10, 3)) + R3_START:
        n = hk.position(planar_3r).null_space(q)[:, 0]
        unit = n / np.linalg.norm(n)
        assert a(q)[0] == pytest.approx(unit @ (q - [0.1, 0.4, 0.9]), abs=1e-13)
        assert b(q)[0] == pytest.approx(a(q)[0] / unit[2], rel=1e-10)


def test_the_unit_null_vector_is_smooth_with_a_right_derivative(panda: hk.Robot) -> None:
    q = symbol("q", 7)
    n = null_vector_expression(hk.pose(panda).jacobian_expression(panda.kinematics(q), q))
    f = Function("n", {"q": q}, {"n": n, "dn": jacobian(n, q)})
    h = 1e-6
    for posture in PANDA_START + np.random.default_rng(3).uniform(-0.3, 0.3, (4, 7)):
        value, slope = f(posture)
        assert np.abs(panda.jacobian(posture) @ value).max() < 1e-14
        numeric = np.column_stack([(f(posture + e)[0] - f(posture - e)[0]) / (2 * h) for e in np.eye(7) * h])
        assert np.abs(slope - numeric).max() < 1e-7


def test_changs_basis_serves_several_free_joints(irb140: hk.Robot) -> None:
    task = hk.position(irb140)
    strategy = hk.holonomic(
        task, hk.stationary(hk.strategies.constraints.posture_cost(IRB_START + 0.1), free=("q4", "q5", "q6"))
    )
    assert hk.involutivity(strategy, hk.around(IRB_START, 0.1)).relative < 1e-10


@pytest.mark.parametrize(
    ("constraint", "error"),
    [
        (lambda: hk.arm_angle(definition="swivel"), UnknownNameError),
        (lambda: hk.arm_angle(pole=[0, 0, 1]), ArgumentError),
        (lambda: hk.arm_angle(reference=[0, 0, 0]), ArgumentError),
        (lambda: hk.arm_angle(joints=("a", "b", "c")), UnknownNameError),
        (lambda: hk.strategies.constraints.height("elbow"), UnknownNameError),
        (lambda: hk.stationary(hk.strategies.constraints.posture_cost([0.0, 0.0])), ShapeError),
        (lambda: hk.stationary(lambda q: q), ShapeError),
        (
            lambda: hk.stationary(hk.strategies.constraints.centring_cost(), free=("panda_joint1", "panda_joint2")),
            RowsError,
        ),
        (lambda: hk.strategies.constraints.posture_cost([np.nan]), hk.base.errors.NotFiniteError),
    ],
)
def test_constraints_that_make_no_sense_are_refused(panda: hk.Robot, constraint, error: type[Exception]) -> None:
    with pytest.raises(error):
        hk.holonomic(hk.pose(panda), constraint())


def test_a_tilt_never_changes_algorithmic_singularities(panda: hk.Robot, irb140: hk.Robot) -> None:
    """det [J; J_a - rho' J] = det [J; J_a] (theory 2e), and the leaves do change."""
    cases = [
        (hk.pose(panda), hk.arm_angle(), lambda x: 0.7 * x[0] ** 2 - ca.sin(x[4]), PANDA_START),
        (hk.position(irb140), hk.coupled(1.0), lambda x: [x[0] * x[1], ca.cos(x[2]), x[0]], IRB_START),
    ]
    for task, a, rho, start in cases:
        plain, tilted = hk.holonomic(task, a), hk.holonomic(task, hk.strategies.constraints.tilted(a, rho))
        for q in start + np.random.default_rng(6).uniform(-0.3, 0.3, (5, task.n)):
            one, other = (np.linalg.det(np.vstack([task.jacobian(q), s.rows(q)])) for s in (plain, tilted))
            assert other == pytest.approx(one, rel=1e-9)
        assert np.abs(plain(start) - tilted(start)).max() > 1e-3
    with pytest.raises(ShapeError, match="tilt"):
        hk.holonomic(hk.pose(panda), hk.strategies.constraints.tilted(hk.arm_angle(), lambda x: [x[0], x[1]]))


def test_sums_and_weights_of_constraints(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    mixed = hk.holonomic(
        task, hk.strategies.constraints.total(hk.lock(2), hk.linear([1, 0, 0, 0, 0, 0, -1]), weights=[2.0, 0.5])
    )
    assert mixed.rows(PANDA_START)[0] == pytest.approx([0.5, 0, 2, 0, 0, 0, -0.5])
    assert hk.strategies.constraints.total(hk.arm_angle(), hk.lock(2)).angular == (True,)
    for constraints, weights in (
        ((hk.lock(1), hk.lock(1, 2)), None),
        ((hk.lock(1),), [1.0, 2.0]),
        ((hk.lock(1),), [np.nan]),
        ((hk.arm_angle(),), [0.5]),
        ((), None),
    ):
        with pytest.raises(ArgumentError):
            hk.strategies.constraints.total(*constraints, weights=weights)


def test_angles_are_coupled_as_the_gain_says(irb140: hk.Robot) -> None:
    """phi + 2 y, theta + x / 2 and psi + z stay as they are."""
    gain = np.array([[0, 2.0, 0], [0.5, 0, 0], [0, 0, 1.0]])
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(gain))
    point = irb140.pose(IRB_START)[:3, 3]
    walk = hk.follow(strategy, hk.circle(point, point - [0.03, 0, 0]), IRB_START, samples=40)
    full = hk.pose(irb140, "zyz")
    kept = np.array([full(q)[3:] + gain @ full(q)[:3] for q in walk.q])
    assert np.ptp(kept, axis=0).max() < 1e-12
    assert np.ptp(walk.q[:, 3]) > 1e-3
    with pytest.raises(ShapeError):
        hk.coupled(np.eye(2))


def test_centring_leaves_out_joints_without_limits_and_warns_of_nothing(panda: hk.Robot) -> None:
    """A continuous joint has no middle: the cost does not depend on it, and the others' is as with limits."""
    free = replace(panda.coordinates[2], lower=-np.inf, upper=np.inf)
    other = replace(panda, coordinates=(*panda.coordinates[:2], free, *panda.coordinates[3:]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        G = hk.holonomic(hk.pose(other), hk.stationary(hk.strategies.constraints.centring_cost()))
        G(PANDA_START)
    cost = hk.strategies.constraints.centring_cost()
    q = hk.symbolic.symbol("q", 7)
    slope = hk.symbolic.jacobian(cost.expression(hk.pose(other), other.kinematics(q), q), q)
    usual = hk.symbolic.jacobian(cost.expression(hk.pose(panda), panda.kinematics(q), q), q)
    f, g = (hk.symbolic.Function("slope", {"q": q}, {"s": s}) for s in (slope, usual))
    expected = np.array(g(PANDA_START)).ravel()
    expected[2] = 0.0
    assert np.array(f(PANDA_START)).ravel() == pytest.approx(expected, abs=1e-15)


def test_settled_against_gravity_the_self_motion_carries_no_weight() -> None:
    """At the leaf 0 of the gravity cost, moving the elbow changes no potential energy: by Pinocchio."""
    pin = pytest.importorskip("pinocchio")

    from conftest import urdf

    robot = hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    strategy = hk.holonomic(hk.pose(robot), hk.stationary(hk.strategies.constraints.gravity_cost()))
    q = hk.motion.ik.move_to_leaf(strategy, PANDA_START + np.array([0, 0, 0.5, 0, 0, 0, 0]))
    model = pin.buildModelFromUrdf(str(urdf("panda.urdf")))
    data = model.createData()
    N = hk.pose(robot).null_space(q)[:, 0]
    padded = np.append(q, np.zeros(model.nq - 7))
    weight = pin.computeGeneralizedGravity(model, data, padded)[:7]
    assert abs(weight @ N) / np.linalg.norm(N) < 1e-9
    assert np.abs(weight).max() > 1


def test_a_given_inverse_must_be_one(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    sound = hk.strategies.right_inverse(task, lambda q: [[1, 0], [0, 1], [0, 0]])  # the hinge held
    assert np.abs(sound(R3_START) - hk.holonomic(task, hk.lock(2))(R3_START)).max() < 1e-14
    with pytest.raises(ArgumentError, match="J G - 1"):
        hk.strategies.right_inverse(task, lambda q: [[1, 0], [0, 1], [1, 1]])


# --- Shoulder, elbow and wrist are found by how the axes meet, or asked for.


def angle(robot: hk.Robot, constraint: Constraint) -> Function:
    """q -> the arm angle (1,), whatever the redundancy."""
    q = symbol("q", robot.n)
    g = constraint.expand(hk.position(robot), robot.kinematics(q), q)
    return Function("angle", {"q": q}, {"g": g})


def postures(robot: hk.Robot, count: int = 5) -> np.ndarray:
    low, high = np.maximum(robot.lower, -1.5), np.minimum(robot.upper, 1.5)
    return np.random.default_rng(3).uniform(low, high, (count, robot.n))


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_the_arm_of_seven_joints_is_its_second_fourth_and_sixth(name: str) -> None:
    robot = hk.load(name)
    found = angle(robot, hk.arm_angle())
    by_index = angle(robot, hk.arm_angle(joints=(1, 3, 5)))
    by_name = angle(robot, hk.arm_angle(joints=tuple(robot.joint_names[i] for i in (1, 3, 5))))
    for q in postures(robot):
        assert found(q) == by_index(q) == by_name(q)


def test_where_along_its_axes_a_file_puts_the_frames_does_not_matter(panda: hk.Robot) -> None:
    """The same arm, its frames slid along their axes: the same angle, though the origins are elsewhere."""
    joints, slid = [], np.eye(4)
    for i, joint in enumerate(panda.joints):
        shift, back = np.eye(4), np.eye(4)
        shift[:3, 3] = (0.05 + 0.02 * i) * joint.axis
        back[:3, 3] = -shift[:3, 3]
        joints.append(replace(joint, placement=slid @ joint.placement @ shift))
        slid = back
    tips = tuple(replace(tip, placement=slid @ tip.placement) for tip in panda.tips)
    other = replace(panda, joints=tuple(joints), tips=tips)
    f, g = angle(panda, hk.arm_angle()), angle(other, hk.arm_angle())
    apart = angle(other, hk.arm_angle(joints=(1, 3, 5)))
    for q in postures(panda):
        assert other.pose(q) == pytest.approx(panda.pose(q), abs=1e-12)
        assert g(q) == pytest.approx(f(q), abs=1e-9)
        assert abs(apart(q) - f(q)) > 1e-3


@pytest.mark.parametrize("file", ["simple_humanoid.urdf", "icub.urdf", "human.urdf"])
def test_a_humanoids_shoulder_is_the_arms_and_not_the_waists(file: str) -> None:
    """The shoulder's own joints do not move it, the waist's do; the arm angle does not feel the wrist's joints."""
    tip = {"simple_humanoid.urdf": "l_wrist", "icub.urdf": "l_gripper", "human.urdf": "left_hand"}[file]
    robot = hk.from_urdf(urdf(file), tip=tip)
    shoulder = next(i for i, name in enumerate(robot.joint_names) if "shoulder" in name.lower())
    f = angle(robot, hk.arm_angle())
    named = angle(robot, hk.arm_angle(joints=(shoulder + 1, shoulder + 3, shoulder + 5)))
    waist = angle(robot, hk.arm_angle(joints=(1, 3, 5)))  # the second, fourth and sixth joint of the tree
    for q in postures(robot):
        assert f(q) == pytest.approx(named(q), abs=1e-9)
        assert abs(f(q) - waist(q)) > 1e-2
        for i in range(shoulder + 6, robot.n):
            assert f(q + 0.3 * np.eye(robot.n)[i]) == pytest.approx(f(q), abs=1e-9)


def test_a_shoulder_whose_axes_do_not_meet_is_asked_for_by_name() -> None:
    """A G1's shoulder axes pass each other by millimetres: behind a waist no silent choice, all joints are listed."""
    robot = hk.from_urdf(urdf("g1_29dof_rev_1_0.urdf"), tip="left_rubber_hand")
    with pytest.raises(NoArmError, match=r"joints=\(shoulder, elbow, wrist\)") as caught:
        angle(robot, hk.arm_angle())
    assert caught.value.chain == robot.joint_names
    for name in robot.joint_names:
        assert name in str(caught.value)
    locked = {f"waist_{axis}_joint": 0.0 for axis in ("yaw", "roll", "pitch")}
    arm = hk.from_urdf(urdf("g1_29dof_rev_1_0.urdf"), tip="left_rubber_hand", locked=locked)
    named = hk.arm_angle(joints=("left_shoulder_roll_joint", "left_elbow_joint", "left_wrist_pitch_joint"))
    q = np.array([0.2, 0.4, 0.3, 0.9, 0.2, 0.3, 0.4])
    for constraint in (named, hk.arm_angle()):  # seven hinges alone have points by the rule for those
        G = hk.holonomic(hk.pose(arm), constraint)
        assert hk.pose(arm).jacobian(q) @ G(q) == pytest.approx(np.eye(6), abs=1e-9)


OFFSETS = {  # (axes, steps from each joint to the next) at q = 0, [m], and where shoulder, elbow and wrist are then
    "Sawyer": (
        "z y x y x y x",
        [(0, 0, 0.317), (0.081, 0.1925, 0), (0, 0, 0), (0.4, -0.1685, 0), (0, 0, 0), (0.4, 0.1363, 0), (0, 0, 0)],
        [(0, 0, 0.317), (0.481, 0.024, 0.317), (0.881, 0.1603, 0.317)],
    ),
    "SIA50D": (  # the shoulder's second axis passes the first, the third passes the second
        "z -y z -y z -y z",
        [(0, 0, 0.54), (0.145, 0, 0), (0, 0, 0.875), (0, 0, 0), (0, 0, 0), (0, 0, 0.61), (0, 0, 0)],
        [(0, 0, 0.54), (0.145, 0, 1.415), (0.145, 0, 2.025)],
    ),
    "two pairs and a spherical wrist": (  # the third axis 12 mm beside the first, as on a Gen3
        "z y z y z y z",
        [(0, 0, 0.28), (0, 0, 0), (0, 0.012, 0.42), (0, 0, 0), (0, -0.012, 0.31), (0, 0, 0), (0, 0, 0)],
        [(0, 0, 0.28), (0, 0.012, 0.70), (0, 0, 1.01)],
    ),
}


@pytest.mark.parametrize("name", OFFSETS)
def test_an_arm_of_seven_hinges_whose_axes_pass_each_other_has_the_points_of_elias_and_wen(
    name: str, tmp_path: Path
) -> None:
    axes, steps, known = OFFSETS[name]
    directions = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "-y": "0 -1 0"}
    links = "".join(f'<link name="l{i}"/>' for i in range(8))
    joints = "".join(
        f'<joint name="j{i + 1}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{" ".join(map(str, step))}"/><axis xyz="{directions[axis]}"/></joint>'
        for i, (axis, step) in enumerate(zip(axes.split(), steps, strict=True))
    )
    file = tmp_path / "arm.urdf"
    file.write_text(f'<robot name="arm">{links}{joints}</robot>')
    robot = hk.load(file)
    arm = hk.strategies.constraints.find_arm(hk.pose(robot))
    assert arm.places(hk.pose(robot))(np.zeros(7)) == pytest.approx(np.array(known), abs=1e-9)
    G = hk.holonomic(hk.pose(robot), hk.arm_angle())
    q = np.array([0.2, -0.5, 0.3, 0.9, 0.4, -0.8, 0.1])
    assert hk.pose(robot).jacobian(q) @ G(q) == pytest.approx(np.eye(6), abs=1e-9)


def test_a_gripper_behind_six_hinges_makes_no_arm_of_seven() -> None:
    """Three of a Z1's axes are parallel: no elbow between them."""
    with pytest.raises(NoArmError):
        hk.strategies.constraints.find_arm(hk.pose(hk.load(urdf("z1.urdf"))))


def test_joints_go_by_name_or_by_index_from_0(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    pairs = [
        (hk.lock(2), hk.lock("panda_joint3")),
        (hk.lock(-1), hk.lock("panda_joint7")),
        (hk.strategies.constraints.height(3), hk.strategies.constraints.height("panda_joint4")),
    ]
    for by_index, by_name in pairs:
        a, b = hk.holonomic(task, by_index), hk.holonomic(task, by_name)
        assert np.array_equal(a(PANDA_START), b(PANDA_START))
    for wrong in (hk.lock(7), hk.strategies.constraints.height(-8), hk.arm_angle(joints=(1, 3, 9))):
        with pytest.raises(UnknownNameError, match=r"unknown index of a joint.*0 \(panda_joint1\)"):
            hk.holonomic(task, wrong)
    with pytest.raises(UnknownNameError, match="unknown joint 'panda_joint8'"):
        hk.holonomic(task, hk.strategies.constraints.height("panda_joint8"))


def test_the_heights_of_two_joints_are_two_rows(irb140: hk.Robot) -> None:
    both = hk.strategies.constraints.height(3, "q6")
    assert (both.rows, both.name) == (2, "height of q[3], q6")
    q = np.array([0.1, 0.9, 0.2, 0.3, 0.4, 0.5])
    f = angle(irb140, both)
    (line,) = irb140.skeleton(q)  # begins at the base
    assert f(q) == pytest.approx([line[4][2], line[6][2]], abs=1e-12)
