"""Lemma III.1, Proposition 1 and Theorem III.3, every transport, units and bases. Sources: [ZR11] and theory.md."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy as sp

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START
from holokin.analysis.curvature.curvature_of_planes import curvature_function
from holokin.symbolic import directional, jacobian, lie_bracket, pairwise_brackets
from papers_arm import paper_frame
from sympy_bridge import to_sympy

# --- Lemma III.1 and its proof, with the errata E1 ---


U = sp.symbols("u1:5", real=True)


def exact_jacobian() -> tuple[ca.SX, ca.SX, ca.SX]:
    """An exact J (2, 4) = df/dq and a smooth basis N (4, 2) = [-J_a^-1 J_b; 1] M of its kernel, over q.

    The columns of [-J_a^-1 J_b; 1] commute, so M(q) is there to give N a bracket.
    """
    q = ca.SX.sym("u", 4)
    J = jacobian(ca.vertcat(q[0] + q[1] * q[2] + q[3] ** 3, q[1] + q[0] * q[3] + q[2] ** 2), q)
    a, b, c, d = J[0, 0], J[0, 1], J[1, 0], J[1, 1]
    inverse = ca.vertcat(ca.horzcat(d, -b), ca.horzcat(-c, a)) / (a * d - b * c)
    M = ca.vertcat(ca.horzcat(1, q[2]), ca.horzcat(q[0], 2))
    return J, ca.vertcat(-inverse @ J[:, 2:], ca.SX.eye(2)) @ M, q


def test_a_null_space_basis_is_involutive_lemma_III_1_36() -> None:
    """J [N_1, N_2] = 0 of our brackets, in exact fractions; and our test of a bare distribution finds it."""
    J, N, q = exact_jacobian()
    (ours,) = pairwise_brackets(N, q).values()
    J_exact, N_exact, value = to_sympy(J, q, U), to_sympy(N, q, U), to_sympy(ours, q, U)
    theirs = N_exact[:, 1].jacobian(U) * N_exact[:, 0] - N_exact[:, 0].jacobian(U) * N_exact[:, 1]
    for values in ((1, 2, 3, 4), (5, -7, 2, 3), (-2, 3, 11, 5)):
        point = {u: sp.Rational(v, 10) for u, v in zip(U, values, strict=True)}
        J_here, N_here, here = (M.subs(point) for M in (J_exact, N_exact, value))
        assert J_here * N_here == sp.zeros(2, 2)  # (30)
        assert here == theirs.subs(point) != sp.zeros(4, 1)
        assert J_here * here == sp.zeros(2, 1)  # (36)
    basis = ca.Function("N", [q], [N])
    assert hk.analysis.curvature.involutivity_of(basis, 4, hk.around(np.zeros(4), 0.3)).holonomic


def test_equation_34_needs_its_brackets_and_35_is_J_times_the_bracket_E1() -> None:
    """Each term of (34) by SymPy; the second less the fourth is J times our bracket, of the sign opposite to (36)."""
    J_ours, N_ours, q = exact_jacobian()
    J, N = to_sympy(J_ours, q, U), to_sympy(N_ours, q, U)
    values = (0.3, -0.2, 0.5, 0.7)
    point = dict(zip(U, values, strict=True))
    i, j = 0, 1
    terms = np.zeros((2, 4))
    for k in range(2):
        for u in range(4):
            for s in range(4):
                dJ, dNi, dNj = J[k, s].diff(U[u]), N[s, i].diff(U[u]), N[s, j].diff(U[u])
                four = [
                    N[u, j] * dJ * N[s, i],
                    N[u, j] * J[k, s] * dNi,
                    N[u, i] * dJ * N[s, j],
                    N[u, i] * J[k, s] * dNj,
                ]
                terms[k] += [float(t.subs(point)) for t in four]
    first, second, third, fourth = terms.T
    assert first - third == pytest.approx([0, 0], abs=1e-12)  # "vanish" means: cancel each other
    assert first + second - third - fourth == pytest.approx([0, 0], abs=1e-12)
    assert np.abs(first + second - third + fourth).max() > 0.1  # (34) as printed
    turned = ca.Function("turned", [q], [directional(J_ours, q, N_ours[:, j]) @ N_ours[:, i]])
    assert np.array(turned(values))[:, 0] == pytest.approx(first, abs=1e-12)
    reverse = ca.Function("reverse", [q], [lie_bracket(N_ours[:, j], N_ours[:, i], q)])
    value = np.array(reverse(values))[:, 0]  # [N_j, N_i]
    assert np.array(J.subs(point), dtype=float) @ value == pytest.approx(second - fourth, abs=1e-12)  # (35): zero
    inner = N[:, i].jacobian(U) * N[:, j] - N[:, j].jacobian(U) * N[:, i]  # sum over u of (35), for each s
    assert value == pytest.approx(np.array(inner.subs(point), dtype=float)[:, 0], abs=1e-12)
    assert np.abs(value).max() > 0.01  # not zero by itself, so that its sign is seen


@pytest.mark.parametrize("exact", [True, False])
def test_the_bracket_of_a_kernel_needs_the_rows_derivative_only_33_to_35(planar_3r: hk.Robot, exact: bool) -> None:
    """A [G_i, G_j] = -(DA[G_i] G_j - DA[G_j] G_i): the proof of Lemma III.1 read backwards; 0 when A is a gradient."""
    task = hk.position(planar_3r)

    def rows(q: ca.SX) -> ca.SX:
        g = ca.sin(q[0]) * q[1] + q[2] ** 2 + q[1] * q[2]
        return jacobian(g, q) if exact else ca.horzcat(ca.sin(q[1]) * q[2], 1 + q[0], q[0] * q[2])

    strategy = hk.strategies.pfaffian(task, rows)
    q, h = np.array([0.3, 0.9, 0.7]), 1e-5
    slopes = np.stack([(strategy(q + e) - strategy(q - e)) / (2 * h) for e in np.eye(3) * h], axis=2)  # (3, 2, 3)
    G = strategy(q)
    bracket = slopes[:, 1, :] @ G[:, 0] - slopes[:, 0, :] @ G[:, 1]  # [G_1, G_2] by central differences
    A = strategy.rows(q)
    assert A @ hk.curvature(strategy, q, method="ad")[:, 0, 1] == pytest.approx(A @ bracket, abs=1e-7)
    assert bool(np.abs(A @ bracket).max() < 1e-7) is exact


# --- Proposition 1 of [RM93], Theorem III.3 ---


def test_a_weighted_strategy_is_involutive_exactly_when_W_JT_is(ppr: hk.Robot) -> None:
    """Proposition 1, on which the paper's proofs rest."""
    task, region = hk.position(ppr), hk.around(PPR_START, 0.4)

    def J(q: ca.SX) -> ca.SX:
        return task.jacobian_expression(ppr.kinematics(q), q)

    def involutive_weight(q: ca.SX) -> ca.SX:
        H = ca.horzcat(hk.symbolic.as_expression(paper_frame(q)), ca.vertcat(ca.sin(q[2]), -ca.cos(q[2]), 1))
        return H @ H.T

    for weight, expected in ((lambda q: ca.SX.eye(3), False), (involutive_weight, True)):
        strategy = hk.weighted(task, lambda q, W=weight: ca.inv(W(q)))
        assert hk.involutivity(strategy, region).holonomic is expected
        assert (
            hk.analysis.curvature.involutivity_of(lambda q, weight=weight: weight(q) @ J(q).T, 3, region).holonomic
            is expected
        )


@pytest.mark.parametrize("orientation", ["zyz", "rpy", "rotation-vector"])
def test_the_planes_do_not_depend_on_the_representation_of_orientation_III_3(panda: hk.Robot, orientation: str) -> None:
    """(15) to (17): one H, two Jacobians; range G is the same, so is the verdict, and the joint paths (E4)."""

    def frame(q: ca.SX) -> ca.SX:
        N_G = ca.SX.zeros(7, 6)
        for column, row in enumerate((0, 1, 3, 4, 5, 6)):
            N_G[row, column] = 1
        N_G[2, 2] = 0.3 * ca.cos(q[3])
        return N_G

    start = PANDA_START - np.array([0, 0, 0, 0, 0, 0.5, 0])
    reference = panda.pose(start)[:3, :3]
    a = hk.null_basis(hk.pose(panda), frame)
    b = hk.null_basis(hk.pose(panda, orientation, reference=reference), frame)
    assert hk.involutivity(a, hk.around(start, 0.1)).holonomic
    assert hk.involutivity(b, hk.around(start, 0.1)).holonomic
    for q in start + np.random.default_rng(8).uniform(-0.1, 0.1, (5, 7)):
        stacked = np.linalg.svd(np.hstack([a(q), b(q)]), compute_uv=False)
        assert stacked[6] < 1e-12 * stacked[0]
        T = b.task.jacobian(q) @ a(q)  # J_b G_a is the change of coordinates
        assert np.abs(b(q) @ T - a(q)).max() < 1e-10


@pytest.mark.parametrize("orientation", ["zyz", "rpy", "rotation-vector"])
def test_a_representation_changes_the_geometric_jacobian_by_a_square_matrix_15_to_17(
    panda: hk.Robot, orientation: str
) -> None:
    """J_w = T J, with T^-1 from how the angles change as the tool turns: no joint is in it. ZYZ has a closed T."""
    start = PANDA_START - np.array([0, 0, 0, 0, 0, 0.5, 0])
    task = hk.pose(panda, orientation, reference=panda.pose(start)[:3, :3])
    for q in start + np.random.default_rng(3).uniform(-0.1, 0.1, (5, 7)):
        geometric, J, R = panda.jacobian(q), task.jacobian(q), panda.pose(q)[:3, :3]
        inverse = task._tool_rates(np.broadcast_to(R, (6, 3, 3)), np.eye(6)[:, :3], np.eye(6)[:, 3:])[
            0
        ].T  # T^-1 (6, 6)
        assert np.abs(inverse @ geometric - J).max() < 1e-13  # (15), (17)
        T = np.linalg.inv(inverse)
        assert np.abs(geometric.T @ np.linalg.inv(T.T) - J.T).max() < 1e-12  # (16)
        if orientation == "zyz":
            phi, theta, _ = task(q)[3:]
            closed = np.array(
                [
                    [0, -np.sin(phi), np.cos(phi) * np.sin(theta)],
                    [0, np.cos(phi), np.sin(phi) * np.sin(theta)],
                    [1, 0, np.cos(theta)],
                ]
            )
            assert T[3:, 3:] == pytest.approx(closed, abs=1e-12)


# --- T14, T16 ---


def test_decimetres_with_the_gain_scaled_leave_the_joints_alone_T16() -> None:
    """E6: Lambda has a unit, rad/m. In decimetres with Lambda / 10 the joint path is the same."""
    metres = hk.load("irb140")
    scaled = [
        {"a": 10 * a, "d": 10 * d, "alpha": np.deg2rad(alpha)}
        for a, d, alpha in ((0.07, 0, 90), (0.36, 0, 0), (0, 0, 90), (0, 0.38, -90), (0, 0, 90), (0, 0.065, 0))
    ]
    decimetres = hk.from_dh(scaled)
    corners = np.array([[0, 0, 0], [0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1]])
    walks = []
    for robot, scale in ((metres, 1.0), (decimetres, 10.0)):
        strategy = hk.holonomic(hk.position(robot), hk.coupled(1.0 / scale))
        path = hk.polyline(robot.pose(IRB_START)[:3, 3] + scale * corners, closed=True)
        walks.append(hk.follow(strategy, path, IRB_START, samples=40).q)
    assert np.abs(walks[0] - walks[1]).max() < 1e-12
    # The paper's formula with the units forgotten is another strategy: 1 rad/mm instead of 1 rad/m, here 1 rad/dm.
    plain, forgotten = (
        np.abs(hk.holonomic(hk.position(r), hk.coupled(1.0))(IRB_START)).max() for r in (metres, decimetres)
    )
    assert plain < 5
    assert 10 * forgotten > 2 * plain, (plain, forgotten)


def test_curvature_does_not_depend_on_how_the_planes_are_written(ppr: hk.Robot) -> None:
    """By a frame and by rows: (20) spans the kernel of d(q1 + cos q3 + ln tan(q3/2)) = (1, 0, cos^2/sin)."""
    task = hk.position(ppr)
    by_rows = hk.strategies.pfaffian(
        task, lambda q: [[ca.sin(q[2]), 0, ca.cos(q[2]) ** 2]]
    )  # a multiple of the gradient
    by_frame = hk.null_basis(task, paper_frame)
    assert by_rows(PPR_START) == pytest.approx(by_frame(PPR_START), abs=1e-14)
    skewed = hk.strategies.pfaffian(task, lambda q: [[ca.sin(q[2]) + q[1], 0, 1]])
    n = ca.SX.sym("q", 3)
    rows = skewed.annulling(task, ppr.kinematics(n), n)
    basis = ca.Function("b", [n], [ca.horzcat(ca.vertcat(0, 1, 0), ca.vertcat(1, 0, -rows[0]))])
    other = hk.null_basis(task, lambda q: basis(q))
    q = np.array([0.2, 0.3, 0.9])
    assert hk.curvature(skewed, q) == pytest.approx(hk.curvature(other, q), abs=1e-13)
    assert np.abs(hk.curvature(other, q)).max() > 0.1
    assert curvature_function(other).name == "curvature"


def test_a_basis_from_an_svd_jumps_and_ours_does_not_E11(planar_3r: hk.Robot) -> None:
    """Along a short smooth joint path the SVD's null vector flips its sign; the signed minors vary smoothly."""
    task = hk.position(planar_3r)
    path = np.array([0.3, 0.5, 0.4]) + np.linspace(0, 1, 400)[:, None] * np.array([2.0, -2.5, 2.0])
    raw = np.array([np.linalg.svd(task.jacobian(q))[2][2] for q in path])
    ours = np.array([task.null_space(q)[:, 0] for q in path])
    assert np.abs(np.diff(raw, axis=0)).max() > 0.5
    assert np.abs(np.diff(ours, axis=0)).max() < 0.05
