"""Geometric Jacobians and the couplings built on them, against closed forms. Sources: [ZR11] and theory.md (T4, T5)."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import null_space

import holokin as hk
from conftest import IRB_START
from holokin.app.job import job_strategy, open_job
from holokin.symbolic import lie_bracket


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
