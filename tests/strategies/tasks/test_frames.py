"""Tasks of an axis free to spin, of one tool in another's frame, of a line of sight, of an expression of one's own."""

from __future__ import annotations

import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START, IRB_START, PANDA_START
from holokin.app.job import job_strategy, open_job, run_job
from holokin.app.report.job_figures import figures
from holokin.robot import Capsule, Joint, Robot, Tip, servo, to_mjcf, to_urdf, with_capsules, with_shape
from holokin.strategies.tasks.frame_task import FrameTask
from holokin.symbolic import lie_bracket


@pytest.fixture(scope="module")
def both_hands() -> Robot:
    """Two Pandas on one base, 0.6 m apart, turned towards each other."""
    arm = hk.load("panda")
    sides = (np.eye(4), np.eye(4))
    sides[0][1, 3], sides[1][1, 3] = 0.3, -0.3
    sides[1][:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    joints, coordinates, tips = [], [], []
    for name, side in zip(("left", "right"), sides, strict=True):
        first = len(joints)
        for joint in arm.joints:
            parent = joint.parent + first if joint.parent >= 0 else -1
            placement = side @ joint.placement if parent < 0 else joint.placement
            joints.append(
                Joint(f"{name}_{joint.name}", joint.kind, parent, placement, joint.axis, joint.coordinate + first)
            )
        coordinates += [type(c)(f"{name}_{c.name}", c.kind, c.lower, c.upper, c.max_velocity) for c in arm.coordinates]
        tips.append(Tip(name, arm.tips[0].joint + first, arm.tips[0].placement))
    return Robot("two pandas", tuple(coordinates), tuple(joints), tuple(tips))


def slope_of(task: hk.Task, q: np.ndarray, h: float = 1e-6) -> np.ndarray:
    return np.array([(task(q + h * e) - task(q - h * e)) / (2 * h) for e in np.eye(len(q))]).T


def torch(tilt_deg: float = 35.0) -> Robot:
    """An IRB 140 with a torch that is bent by an angle against its last axis, as welding torches are."""
    arm = hk.load("irb140")
    bend = np.eye(4)
    bend[:3, :3] = Rotation.from_euler("y", tilt_deg, degrees=True).as_matrix()
    bend[:3, 3] = [0.08, 0.0, 0.25]
    tip = arm.tips[0]
    return Robot("torch", arm.coordinates, arm.joints, (Tip("wire", tip.joint, tip.placement @ bend),))


@pytest.mark.parametrize("axis", ["x", "y", "z", (0.6, 0.0, 0.8)])
def test_the_axis_coordinates_are_the_turn_that_takes_the_reference_direction_to_that_of_the_tool(axis: object) -> None:
    """SciPy's rotation vectors are the referee: a turn about a line across the reference direction."""
    robot = torch()
    task = hk.pose(robot, "axis", axis=axis)
    a = np.asarray(task.axis)
    for q in IRB_START + np.random.default_rng(1).uniform(-0.8, 0.8, (20, 6)):
        direction, down = robot.pose(q)[:3, :3] @ a, np.array([0.0, 0.0, -1.0])
        assert np.abs(task.reference @ a - down).max() < 1e-12
        ax, ay = task(q)[3:]
        turn = Rotation.align_vectors([direction], [down])[0].magnitude()
        assert np.hypot(ax, ay) == pytest.approx(turn, abs=1e-9)
        assert np.linalg.norm(np.cross(down, direction)) == pytest.approx(np.sin(np.hypot(ax, ay)), abs=1e-9)
        assert np.abs(task.jacobian(q) - slope_of(task, q)).max() < 1e-7


def test_straight_down_is_as_good_as_any_direction_and_straight_up_is_refused() -> None:
    robot = torch(0.0)
    task, down = hk.pose(robot, "axis"), np.deg2rad([0, 40, -10, 0, -30, 0])
    assert np.abs(robot.pose(down)[:3, 2] - [0, 0, -1]).max() < 1e-12
    assert np.abs(task(down)[3:]).max() < 1e-12
    assert np.abs(task.jacobian(down) - slope_of(task, down)).max() < 1e-7
    with pytest.raises(hk.HolokinError, match="representation"):
        hk.pose(robot, "axis", reference=np.eye(3)).jacobian(down)


def test_a_spin_of_the_tool_about_its_axis_is_a_self_motion() -> None:
    robot = torch()
    task = hk.pose(robot, "axis")
    J = robot.jacobian(IRB_START)
    spin = np.linalg.solve(J, np.append(np.zeros(3), robot.pose(IRB_START)[:3, 2]))
    assert np.abs(task.jacobian(IRB_START) @ spin).max() < 1e-12
    assert np.abs(spin).max() > 0.5


def test_a_welder_by_the_pseudo_inverse_drifts_and_one_on_a_leaf_returns() -> None:
    robot = torch()
    task = hk.pose(robot, "axis")
    p = robot.pose(IRB_START)[:3, 3]
    seam = hk.circle(p, p - [0.06, 0.0, 0.0])
    drift = hk.drift(hk.moore_penrose(task), seam, IRB_START, cycles=2)
    assert drift.largest[0] > 1e-3
    for law in (hk.holonomic(task, hk.lock(3)), hk.holonomic(task, hk.lock(5))):
        found = hk.follow(law, seam, IRB_START, samples=200, cycles=2)
        assert found.status is hk.motion.Status.COMPLETE
        assert np.abs(found.drift()).max() < 1e-12
        wanted, got = robot.pose(IRB_START)[:3, 2], robot.pose(found.q[70])[:3, 2]
        assert np.abs(wanted - got).max() < 1e-12


def test_inverse_kinematics_of_an_axis_is_that_of_following(panda: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for two poses
    task = hk.pose(panda, "axis")
    law = hk.holonomic(task, hk.lock(2, 6))
    ik, pose = hk.ik(law, PANDA_START), panda.pose(PANDA_START)
    pose[:3, 3] += [0.1, -0.15, 0.05]
    pose[:3, :3] = Rotation.from_rotvec([0.3, -0.2, 0.0]).as_matrix() @ pose[:3, :3]
    q = ik(pose)
    assert np.abs(panda.pose(q)[:3, 3] - pose[:3, 3]).max() < 1e-9
    assert np.abs(panda.pose(q)[:3, 2] - pose[:3, 2]).max() < 1e-9
    assert np.abs(q[[2, 6]] - PANDA_START[[2, 6]]).max() < 1e-12
    spun = pose.copy()
    spun[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec([0, 0, 0.4]).as_matrix()
    assert np.abs(ik(spun) - q).max() < 1e-9  # the spin asked for is not the task's


def test_one_tool_in_the_frame_of_another_moves_as_their_poses_say(both_hands: Robot) -> None:
    task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
    rng = np.random.default_rng(2)
    for q in np.tile(PANDA_START, 2) + rng.uniform(-0.5, 0.5, (5, 14)):
        left, right = both_hands.pose(q, "left"), both_hands.pose(q, "right")
        assert np.abs(task.pose(q) - np.linalg.solve(right, left)).max() < 1e-12
        dq, h = rng.uniform(-1, 1, 14), 1e-6
        after, before = task.pose(q + h * dq), task.pose(q - h * dq)
        v = (after[:3, 3] - before[:3, 3]) / (2 * h)
        w = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec() / (2 * h)
        assert np.abs(task.jacobian(q) @ dq - np.append(v, w)).max() < 1e-7


@pytest.mark.campaign
def test_two_arms_repeat_what_one_does_on_the_other(both_hands: Robot) -> None:
    """r = 8: the right arm and the left one's third joint are held by rules."""
    task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
    q0 = np.tile(PANDA_START, 2)
    p = task.pose(q0)[:3, 3]
    loop = hk.circle(p, p + [0.0, 0.06, 0.0])
    assert hk.drift(hk.moore_penrose(task), loop, q0).largest[0] > 1e-3
    apart = np.delete(np.eye(7), 2, axis=0)
    rules = hk.strategies.constraints.stack(hk.lock(2, 9), hk.linear(np.hstack([apart, apart])))
    found = hk.follow(hk.holonomic(task, rules), loop, q0, samples=100)
    assert found.status is hk.motion.Status.COMPLETE
    assert np.abs(found.drift()).max() < 1e-12
    assert np.ptp(found.q[:, 7:]) > 0.01


@pytest.mark.campaign
def test_a_camera_looks_at_a_point_where_its_line_of_sight_is_zero(panda: Robot) -> None:
    point = np.array([0.7, 0.2, 0.1])
    task = hk.strategies.tasks.line_of_sight(panda, point)
    assert task.m == 2
    assert task.units == ("rad", "rad")
    rates = np.random.default_rng(3).uniform(-1, 1, (3, 7))
    for q in PANDA_START + 0.4 * rates:
        T = panda.pose(q)
        seen = T[:3, :3].T @ (point - T[:3, 3])
        angle = np.arctan2(np.hypot(seen[0], seen[1]), seen[2])
        assert np.linalg.norm(task(q)) == pytest.approx(angle, abs=1e-12)
        assert np.abs(task.jacobian(q) - slope_of(task, q)).max() < 1e-7
    x = task(PANDA_START)
    law = hk.holonomic(task, hk.lock(0, 1, 2, 3, 6))
    found = hk.follow(law, hk.line(np.append(x, 0), np.zeros(3)), PANDA_START, samples=100)
    T = panda.pose(found.q[-1])
    assert np.linalg.norm(np.cross(T[:3, 2], point - T[:3, 3])) < 1e-9


def test_an_expression_of_ones_own_is_a_task(panda: Robot) -> None:
    """The tool's distance from the base axis and its height: m = 2, J = df/dq, and a leaf that is returned to."""

    def cylinder(q: ca.SX) -> ca.SX:
        p = panda.kinematics(q).position
        return ca.vertcat(ca.sqrt(p[0] ** 2 + p[1] ** 2), p[2])

    task = hk.custom_task(panda, cylinder, units=("m", "m"), names=("radius", "height"), name="cylinder")
    p = panda.pose(PANDA_START)[:3, 3]
    assert task(PANDA_START) == pytest.approx([np.hypot(p[0], p[1]), p[2]], abs=1e-12)
    assert task.row_names == ("radius", "height")
    assert np.abs(task.jacobian(PANDA_START) - slope_of(task, PANDA_START)).max() < 1e-7
    x = np.append(task(PANDA_START), 0)
    law = hk.holonomic(task, hk.lock(0, 2, 4, 5, 6))
    found = hk.follow(law, hk.circle(x, x + [0.05, 0, 0]), PANDA_START, samples=100)
    assert np.abs(found.drift()).max() < 1e-12
    assert np.abs(found.error).max() < 1e-9
    assert hk.drift(hk.moore_penrose(task), hk.circle(x, x + [0.05, 0, 0]), PANDA_START).largest[0] > 1e-3


def test_bad_frames_are_refused_with_their_cure(panda: Robot, both_hands: Robot) -> None:
    with pytest.raises(hk.HolokinError, match="axis of the tool"):
        hk.pose(panda, "axis", axis="w")
    with pytest.raises(hk.HolokinError, match="must not vanish"):
        hk.pose(panda, "axis", axis=(0, 0, 0))
    with pytest.raises(hk.HolokinError, match="relative to"):
        hk.strategies.tasks.relative_pose(both_hands, "left", "left")
    with pytest.raises(hk.HolokinError, match="a unit of each row"):
        hk.custom_task(panda, lambda q: q[:4], units=())
    with pytest.raises(hk.HolokinError, match="8"):
        hk.custom_task(panda, lambda q: ca.vertcat(q, q[0]), units=("rad",) * 8)
    with pytest.raises(hk.HolokinError, match="units="):
        hk.custom_task(panda, lambda q: q[:2], units=("rad",))
    with pytest.raises(hk.HolokinError, match="rows of a task"):
        FrameTask(panda, "axis", (0, 5), np.eye(3))


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
@pytest.mark.parametrize("kind", ["axis", "relative"])
def test_exported_c_does_what_python_does(kind: str, both_hands: Robot, tmp_path: Path) -> None:
    """The self-test of an export compares every function with vectors from Python, within its tolerances."""
    if kind == "axis":
        law, start = hk.holonomic(hk.pose(torch(), "axis"), hk.lock(3)), IRB_START
    else:
        task = hk.strategies.tasks.relative_pose(both_hands, "left", "right")
        law, start = hk.holonomic(task, hk.lock(*range(7, 14), 2)), np.tile(PANDA_START, 2)
    written = hk.export.export_c(law, tmp_path, q0=start, name="law", vectors_count=8)
    assert all(line.endswith("passed") for line in hk.export.check(written))


# --- Geometric Jacobians and the couplings built on them, against closed forms. Sources: [ZR11] and theory.md (T4, T5).


def geometric_brackets(robot: hk.Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """G = J_geo^-1 (6, 6) and [G_i, G_j] for the angular columns, by CasADi's own inverse and our bracket."""
    x = ca.SX.sym("q", 6)
    G = ca.solve(robot.kinematics(x).jacobian, ca.SX.eye(6))
    brackets = [lie_bracket(G[:, 3 + i], G[:, 3 + j], x) for i, j in ((0, 1), (1, 2), (2, 0))]
    f = ca.Function("b", [x], [G, ca.horzcat(*brackets)])
    out = f(q)
    return np.array(out[0]), np.array(out[1])


def test_brackets_of_a_geometric_inverse_are_minus_epsilon_G(irb140: hk.Robot) -> None:
    """T4: n = m = 6, holonomic, yet its brackets do not vanish: [G_i, G_j] = -eps_ijk G_k."""
    G, brackets = geometric_brackets(irb140, IRB_START)
    assert np.abs(brackets - (-G[:, [5, 3, 4]])).max() < 1e-12
    assert np.abs(brackets).max() > 0.5
    verdict = hk.involutivity(hk.moore_penrose(hk.pose(irb140)), hk.around(IRB_START, 0.3))
    assert verdict.holonomic
    assert verdict.relative < 1e-12


def test_a_body_frame_twist_turns_the_sign() -> None:
    """Theory 1.1: for body-frame omega c_ij^k = +eps_ijk, on a wrist alone (n = m = 3)."""
    rows = [{"alpha": np.pi / 2}, {"alpha": -np.pi / 2}, {}]
    robot = hk.from_dh(rows)
    x = ca.SX.sym("q", 3)
    k = robot.kinematics(x)
    for frame, sign in ((ca.SX.eye(3), -1.0), (k.rotation.T, 1.0)):
        G = ca.solve(frame @ k.jacobian[3:, :], ca.SX.eye(3))
        value = ca.Function("b", [x], [lie_bracket(G[:, 0], G[:, 1], x), G[:, 2]])([0.3, 0.8, -0.4])
        assert np.abs(np.array(value[0]) - sign * np.array(value[1])).max() < 1e-13


@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_coupling_with_the_geometric_jacobian_has_curvature_lambda_squared(irb140: hk.Robot, gain: float) -> None:
    """T5, E3: (J_w + lambda J_p)[G_i, G_j] = -lambda^2 eps_ijk e_k for every posture."""
    strategy = hk.strategies.coupled_twist(hk.position(irb140), gain)
    for q in IRB_START + np.random.default_rng(6).uniform(-0.4, 0.4, (10, 6)):
        J = irb140.jacobian(q)
        A = J[3:] + gain * J[:3]
        F = hk.curvature(strategy, q)
        epsilon = np.zeros((3, 3, 3))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            epsilon[k, i, j], epsilon[k, j, i] = 1, -1
        assert np.abs(np.einsum("kq,qij->kij", A, F) + gain**2 * epsilon).max() < 1e-11
        assert np.abs(np.einsum("kq,qij->kij", J[:3], F)).max() < 1e-12
        assert np.abs(A @ strategy(q)).max() < 1e-12  # w + lambda v = 0


def test_the_geometric_coupling_is_found_out_and_the_euler_angle_one_is_not(irb140: hk.Robot) -> None:
    task, region = hk.position(irb140), hk.around(IRB_START, 0.2)
    assert hk.involutivity(hk.holonomic(task, hk.coupled(1.0)), region).holonomic
    verdict = hk.involutivity(hk.strategies.coupled_twist(task, 1.0), region)
    assert not verdict.holonomic
    J = irb140.jacobian(verdict.witness)
    i, j = verdict.plane
    closed_form = np.linalg.solve(
        np.vstack([J[:3], J[3:] + J[:3]]), np.r_[0, 0, 0, -np.cross(np.eye(3)[i], np.eye(3)[j])]
    )
    assert pytest.approx(closed_form, abs=1e-12) == verdict.direction
    assert hk.involutivity(hk.strategies.coupled_twist(task, 0.0), region).holonomic  # J_w alone: constant orientation


def test_the_euler_angle_coupling_in_closed_form_E5(irb140: hk.Robot) -> None:
    """G = J_geo^-1 [1; -T], omega = T phi', for ZYZ angles."""
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(1.0))
    for q in IRB_START + np.random.default_rng(7).uniform(-0.3, 0.3, (10, 6)):
        phi, theta, _ = hk.pose(irb140, "zyz")(q)[3:]
        T = np.array(
            [
                [0, -np.sin(phi), np.cos(phi) * np.sin(theta)],
                [0, np.cos(phi), np.sin(phi) * np.sin(theta)],
                [1, 0, np.cos(theta)],
            ]
        )
        closed = np.linalg.solve(irb140.jacobian(q), np.vstack([np.eye(3), -T]))
        assert np.abs(strategy(q) - closed).max() < 1e-11


def test_the_packaged_irb140_job_is_27_with_28_and_29() -> None:
    """N = null(J_p), N_G = null(J_o + J_p), H = [N_G N] by SciPy, G by (7); J_A = [1 0; 1 1] J with ZYZ angles."""
    _, job, file = open_job("irb140-half-square")
    _, strategy, start = job_strategy(job, file, "coupled")
    zyz = hk.pose(strategy.task.robot, "zyz")
    for q in start + np.random.default_rng(5).uniform(-0.2, 0.2, (5, 6)):
        J = zyz.jacobian(q)
        H = np.hstack([null_space(J[3:] + J[:3]), null_space(J[:3])])
        W = H @ H.T
        G = W @ J[:3].T @ np.linalg.inv(J[:3] @ W @ J[:3].T)  # (27)
        assert strategy(q) == pytest.approx(G, abs=1e-10)
        assert np.abs((J[:3] + J[3:]) @ strategy(q)).max() < 1e-12  # (28)
        J_A = hk.analysis.curvature.general_form(strategy, q).J_A
        one = np.eye(3)
        assert pytest.approx(np.block([[one, 0 * one], [one, one]]) @ J, abs=1e-13) == J_A  # (29)
        assert abs(np.linalg.det(J_A)) == pytest.approx(abs(np.linalg.det(J)))


def test_the_papers_example_has_the_wrist_singularity_as_an_algorithmic_one_E5(irb140: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(1.0))
    near = IRB_START.copy()
    near[4] = 1e-6
    assert np.linalg.svd(irb140.jacobian(near)[:3])[1][-1] > 0.1
    assert np.abs(strategy(near)).max() > 1e5
    near[4] = 0.0
    with pytest.raises(hk.base.errors.SingularityError) as caught:
        strategy(near)
    assert caught.value.kind is hk.base.errors.SingularityKind.ALGORITHMIC


def test_at_the_zyz_singularity_the_coupling_stays_bounded_and_is_refused_E5(irb140: hk.Robot) -> None:
    """theta = 0: G is bounded nearby but depends on the direction of approach."""
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(1.0))
    down = np.array([0.1, np.pi / 2, -np.pi / 2 - 0.5, 0.0, 0.5, 0.2])  # the tool axis along -z
    assert irb140.pose(down)[2, 2] == pytest.approx(-1.0)
    with pytest.raises(hk.base.errors.SingularityError) as caught:
        strategy(down)
    assert caught.value.kind is hk.base.errors.SingularityKind.REPRESENTATION
    beside = [strategy(down + 1e-4 * step) for step in (np.eye(6)[3], np.eye(6)[4])]
    assert max(np.abs(G).max() for G in beside) < 50
    assert np.abs(beside[0] - beside[1]).max() > 0.1


def test_a_jacobian_of_sub_rows_of_angular_velocity_breaks_lemma_III_1_E2(irb140: hk.Robot) -> None:
    """ker of all three angular rows is involutive, and ker of two (turns about one fixed axis, a subgroup);
    ker of a single row is not: turns about x and y generate those about z."""
    x = ca.SX.sym("q", 6)
    J_w = irb140.kinematics(x).jacobian[3:, :]

    def kernel(rows: ca.SX) -> ca.SX:
        r = rows.shape[0]
        left = ca.solve(rows[:, 3 : 3 + r], rows[:, [i for i in range(6) if not 3 <= i < 3 + r]])
        basis = ca.SX.zeros(6, 6 - r)
        basis[[i for i in range(6) if not 3 <= i < 3 + r], :] = ca.SX.eye(6 - r)
        basis[list(range(3, 3 + r)), :] = -left
        return basis

    def involutive(rows: ca.SX) -> bool:
        function = ca.Function("k", [x], [kernel(rows)])
        return hk.analysis.curvature.involutivity_of(lambda q: function(q), 6, hk.around(IRB_START, 0.2)).holonomic

    assert involutive(J_w)  # constant orientation: leaves R = const
    assert involutive(J_w[:2, :])
    assert not involutive(J_w[2, :])


# --- Tasks x = f(u) of coordinates without a robot: the thrusters of a ship; and tasks of more than three rows.


K = np.array([3.0, 3.0, 4.2, 6.55])
AT_X, AT_Y = np.array([37.0, 35.0, -41.5, -41.5]), np.array([0.0, 0.0, 7.0, -7.0])
"""Largest thrusts [100 kN] and places [m] of two bow and two stern thrusters, osv.m of the MSS toolbox [Fos21]."""
U0 = np.array([0.3, 0.3, 0.4, 0.4, 0.5, 0.5])
Q0 = IIWA_START + [0, 0, 0.2, 0, 0.3, 0, 0.1]


@pytest.fixture(scope="module")
def ship() -> Robot:
    return hk.robot.coordinates(
        ("bow1", "bow2", "stern1", "stern2", "a1", "a2"), lower=[-1, -1, -1, -1, -1.5, -1.5], upper=1.5,
        max_velocity=0.2, units=["1", "1", "1", "1", "rad", "rad"], name="ship",
    )  # fmt: skip


@pytest.fixture(scope="module")
def force(ship: Robot) -> hk.Task:
    """Surge, sway, yaw / 41.5 m."""

    def tau(u: ca.SX) -> ca.SX:
        T = [u[i] * K[i] for i in range(4)]
        x = [0, 0, T[2] * ca.cos(u[4]), T[3] * ca.cos(u[5])]
        y = [T[0], T[1], T[2] * ca.sin(u[4]), T[3] * ca.sin(u[5])]
        yaw = sum(AT_X[i] * y[i] - AT_Y[i] * x[i] for i in range(4))
        return ca.vertcat(sum(x), sum(y), yaw / 41.5)

    return hk.custom_task(ship, tau, units=("100 kN",) * 3, names=("surge", "sway", "yaw"), name="force")


@pytest.fixture(scope="module")
def pairs(force: hk.Task) -> hk.Strategy:
    """Bow thrusters alike, stern thrusters alike, azimuths alike."""
    rows = np.kron(np.eye(3), [1.0, -1.0])
    return hk.holonomic(force, hk.linear(rows))


@pytest.fixture(scope="module")
def six() -> hk.Task:
    """Position and the z axis of an iiwa's tool, as five rows of one's own."""
    robot = hk.load("iiwa14")

    def rows(q: ca.SX) -> ca.SX:
        k = robot.kinematics(q)
        return ca.vertcat(k.position, k.rotation[0, 2], k.rotation[1, 2])

    return hk.custom_task(robot, rows, units=("m", "m", "m", "1", "1"), names=("x", "y", "z", "ax", "ay"))


def closed_form(wanted: np.ndarray) -> np.ndarray:
    """Equal pairs: surge, sway and yaw are linear in the bow's share s and the stern's t (cos a, sin a)."""
    stern = K[2] + K[3]
    A = np.array([
        [0.0, stern, 0.0],
        [K[0] + K[1], 0.0, stern],
        [(AT_X[:2] @ K[:2]) / 41.5, -(AT_Y[2:] @ K[2:]) / 41.5, (AT_X[2:] @ K[2:]) / 41.5],
    ])  # fmt: skip
    s, along, aside = np.linalg.solve(A, wanted)
    t, a = np.hypot(along, aside), np.arctan2(aside, along)
    return np.array([s, s, t, t, a, a])


def test_thrusts_that_follow_a_force_round_a_loop_return_on_a_leaf_alone(force: hk.Task, pairs: hk.Strategy) -> None:
    at = force(U0)
    loop = hk.circle(at, at - [0, 1.0, 0], [1, 0, -1], speed=0.2)
    assert hk.drift(hk.moore_penrose(force), loop, U0).largest[0] > 0.03
    assert hk.drift(pairs, loop, U0, cycles=2).largest.max() < 1e-12
    assert not hk.involutivity(hk.moore_penrose(force), hk.around(U0, 0.1)).holonomic
    assert hk.involutivity(pairs, hk.around(U0, 0.1)).holonomic


def test_the_inverse_of_an_allocation_is_its_closed_form(force: hk.Task, pairs: hk.Strategy) -> None:
    ik, rng = hk.ik(pairs, U0), np.random.default_rng(0)
    wanted = force(U0) + rng.uniform(-0.5, 0.5, (20, 3))
    for x, u in zip(wanted, ik.batch(wanted).q, strict=True):
        assert np.abs(u - closed_form(x)).max() < 1e-9
        assert np.abs(force(u) - x).max() < 1e-9


def test_the_jacobian_of_an_allocation_is_its_slope(force: hk.Task) -> None:
    rng, h = np.random.default_rng(1), 1e-6
    for u in U0 + rng.uniform(-0.2, 0.2, (5, 6)):
        dq = rng.uniform(-1, 1, 6)
        assert np.abs((force(u + h * dq) - force(u - h * dq)) / (2 * h) - force.jacobian(u) @ dq).max() < 1e-7
    assert force.units == ("100 kN",) * 3


def test_a_controller_of_thrusters_keeps_their_rates(force: hk.Task, pairs: hk.Strategy) -> None:
    c = hk.controller(pairs, dt=0.1, q0=U0)
    x = force(U0)
    du = c.step(U0, x + [0.1, 0, 0], np.array([1.0, 0, 0]))
    assert c.scale == 1.0
    assert np.abs(force.jacobian(U0) @ du - [1.0, 0, 0]).max() < 1e-9
    c.step(U0, x, np.array([9.0, 0, 0]))
    assert c.status.name == "SLOWED"
    walk = hk.simulate(c, force, hk.line(x, x + [0.3, 0.2, 0.1], speed=0.05), U0, dt=0.1)
    assert np.abs(walk.q[-1] - closed_form(x + [0.3, 0.2, 0.1])).max() < 1e-3
    assert walk.tracking_error("100 kN") > 0


def test_coordinates_have_no_pose_and_say_so(ship: Robot, force: hk.Task) -> None:
    for asked in (
        lambda: ship.pose(U0), lambda: ship.jacobian(U0), lambda: hk.pose(ship), lambda: hk.position(ship),
        lambda: to_urdf(ship), lambda: to_mjcf(ship), lambda: servo(ship, "position", U0), lambda: with_capsules(ship),
        lambda: with_shape(ship, "ball", Capsule(0.1)), lambda: hk.check(U0[None], hk.Scene(floor=0.0), robot=ship),
    ):  # fmt: skip
        with pytest.raises(hk.HolokinError, match="no links"):
            asked()
    assert ship.skeleton(U0) == []
    assert repr(ship) == "Robot('ship', n=6)"
    with pytest.raises(hk.HolokinError, match="lower of the coordinates"):
        hk.robot.coordinates(("a", "b"), lower=[0.0])
    with pytest.raises(hk.HolokinError, match="at least one"):
        hk.robot.coordinates(())
    with pytest.raises(hk.HolokinError, match="units of the coordinates"):
        hk.robot.coordinates(("a", "b"), units=["N"])
    with pytest.raises(hk.HolokinError, match="two joints"):
        hk.robot.coordinates(("a", "a"))
    with pytest.raises(hk.HolokinError, match="limits"):
        hk.follow(hk.moore_penrose(force), hk.line(force(U0), [0, 0, 0]), U0 + 2)


def test_a_check_of_thrusts_looks_at_their_limits_and_says_that_it_knows_no_distances(ship: Robot) -> None:
    report = hk.check(np.array([U0, U0 + [9.0, 0, 0, 0, 0, 0]]), robot=ship)
    assert [finding.kind for finding in report.findings] == [hk.motion.checks.FindingKind.POSITION]
    assert "distances were not looked at" in report.table()


def test_a_task_of_five_rows_of_ones_own_is_that_of_its_formulas(six: hk.Task) -> None:
    robot, rng, h = hk.load("iiwa14"), np.random.default_rng(2), 1e-6
    assert (six.m, six._point, six.row_names) == (5, 5, ("x", "y", "z", "ax", "ay"))
    for q in Q0 + rng.uniform(-0.2, 0.2, (5, 7)):
        T, dq = robot.pose(q), rng.uniform(-1, 1, 7)
        assert np.abs(six(q) - [*T[:3, 3], *T[:2, 2]]).max() < 1e-12
        assert np.abs((six(q + h * dq) - six(q - h * dq)) / (2 * h) - six.jacobian(q) @ dq).max() < 1e-7
    assert np.abs(six[[4, 0]](Q0) - six(Q0)[[4, 0]]).max() == 0.0


def test_paths_lead_through_points_of_five_coordinates(six: hk.Task, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    law, x = hk.holonomic(six, hk.lock(0, 6)), six(Q0)
    points = np.array([x, x + [0.05, 0, 0, 0, 0.02], x + [0.05, 0.05, 0.02, 0.03, 0]])
    loop = hk.path.through(points, closed=True, seconds=[1.0, 2.0, 1.5])
    assert loop.duration == 4.5
    assert np.abs(loop.at(2.0).position[0, :5] - points[1:].mean(axis=0)).max() < 1e-12
    walk = hk.follow(law, loop, Q0, samples=60)
    assert np.abs(walk.drift()).max() < 1e-12
    assert np.abs(six.value_batch(walk.q)[walk.t == 1.0] - points[1]).max() < 1e-9
    assert hk.drift(hk.moore_penrose(six), loop, Q0, samples=100).largest[0] > 1e-5
    ik = hk.ik(law, Q0)
    assert np.abs(six(ik(points[2])) - points[2]).max() < 1e-9
    assert hk.path.through(points, speed=0.1).duration == pytest.approx(
        np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / 0.1
    )
    for bad, fault in (([points[0]], "at least two"), (points[[0, 0]], "points that differ")):
        with pytest.raises(hk.HolokinError, match=fault):
            hk.path.through(bad)
    with pytest.raises(hk.HolokinError, match=r"\(5,\)"):
        ik(points[2][:4])
    c = hk.controller(law, dt=0.01, q0=Q0)
    assert np.abs(six.jacobian(Q0) @ c.step(Q0, x, np.array([0.1, 0, 0, 0, 0])) - [0.09, 0, 0, 0, 0]).max() < 1e-9


@pytest.mark.campaign
def test_seven_joints_hold_a_pose_written_as_six_rows_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of one's own that are a pose give the joints of the pose task itself."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # two calls take less time than a compiler
    robot = hk.load("iiwa14")
    reference = robot.pose(Q0)[:3, :3]

    def rows(q: ca.SX) -> ca.SX:
        k = robot.kinematics(q)
        M = ca.SX(reference).T @ k.rotation
        return ca.vertcat(k.position, M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1])

    own = hk.custom_task(robot, rows, units=("m", "m", "m", "rad", "rad", "rad"))
    pose, target = hk.pose(robot), robot.pose(Q0)
    target[:3, 3] += [0.05, -0.05, 0.05]
    target[:3, :3] = target[:3, :3] @ Rotation.from_rotvec([0.1, 0.0, -0.2]).as_matrix()
    M = reference.T @ target[:3, :3]
    x = np.array([*target[:3, 3], M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
    a, b = (hk.ik(hk.holonomic(task, hk.lock(2)), Q0) for task in (own, pose))
    assert np.abs(a(x) - b(target)).max() < 1e-9


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_exported_c_of_an_allocation_and_of_five_rows_does_what_python_does(
    pairs: hk.Strategy, six: hk.Task, tmp_path: Path
) -> None:
    for name, law, start in (("ship", pairs, U0), ("five", hk.moore_penrose(six), Q0)):
        written = hk.export.export_c(law, tmp_path / name, q0=start, name=name, vectors_count=4)
        assert all(line.endswith("passed") for line in hk.export.check(written))
    assert "a point of the task's coordinates, 5 numbers" in (tmp_path / "five" / "five.hpp").read_text("utf-8")


def test_a_job_allocates_without_a_robot(tmp_path: Path) -> None:
    file = tmp_path / "ship.toml"
    file.write_text(
        """title = "Thrusters"
[robot]
name = "ship"
[robot.coordinates]
names = ["bow", "stern", "azimuth"]
lower = [-1, -1, -1.5]
upper = 1.5
units = ["1", "1", "rad"]
[task]
kind = "custom"
expressions = ["10.75*stern*cos(azimuth)", "6*bow + 10.75*stern*sin(azimuth)"]
units = ["100 kN", "100 kN"]
[start]
q = [0.3, 0.4, 0.5]
[path]
kind = "circle"
center = [0, 1.0, 0]
relative = true
speed = 0.2
samples = 40
[strategies.moore-penrose]
kind = "moore-penrose"
[strategies.alike]
kind = "custom"
g = ["bow - stern"]
[expect.moore-penrose]
holonomic = false
drift = { above = 0.01 }
[expect.alike]
drift = { below = 1e-12 }
tracking = { below = 1e-9 }
""",
        "utf-8",
    )
    result = run_job(*open_job(str(file)))
    assert result.passed
    assert result.strategies[0].metrics["tracking"] > 0  # in units of the task's own
    assert "robot" not in [stem for stem, _, _ in figures(result)]
    file.write_text(file.read_text("utf-8").replace("[robot]\n", '[robot]\ntip = "a"\n'), "utf-8")
    with pytest.raises(hk.HolokinError, match="tip stands beside coordinates"):
        run_job(*open_job(str(file)))
