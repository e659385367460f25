"""The paper, equation by equation, with SymPy and closed forms as referees. Sources: [ZR11] and theory.md."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START
from holokin.analysis.curvature import curvature_function
from holokin.symbolic import lie_bracket
from sympy_bridge import to_sympy

Q = sp.symbols("q1 q2 q3", real=True)
S3, C3 = sp.sin(Q[2]), sp.cos(Q[2])
J18 = sp.Matrix([[1, 0, -S3], [0, 1, C3]])
N19 = sp.Matrix([S3, -C3, 1])
NG20 = sp.Matrix([[C3**2, 0], [0, 1], [-S3, 0]])
G22 = sp.Matrix([[C3**2, 0], [S3 * C3, 1], [-S3, 0]])
G23 = sp.Matrix([[1 + S3, S3], [-C3, 1 - C3], [1, 1]])
NG25 = sp.Matrix([[1, 0], [-1, 1 + S3 - C3], [0, 1]])


def paper_frame(q: ca.SX) -> list:
    """(20)"""
    return [[ca.cos(q[2]) ** 2, 0], [0, 1], [-ca.sin(q[2]), 0]]


def de_luca_frame(q: ca.SX) -> list:
    """(25)"""
    return [[1, 0], [-1, 1 + ca.sin(q[2]) - ca.cos(q[2])], [0, 1]]


def de_luca_g(q: ca.SX) -> ca.SX:
    return q[0] + q[1] - q[2] + ca.sin(q[2]) + ca.cos(q[2])


def bracket(A: sp.Matrix, B: sp.Matrix) -> sp.Matrix:
    """(5), by SymPy."""
    return (B.jacobian(Q) * A - A.jacobian(Q) * B).applyfunc(sp.simplify)


def numeric(M: sp.Matrix, q: np.ndarray) -> np.ndarray:
    return np.array(M.subs(dict(zip(Q, q, strict=True))).evalf(), dtype=float)


def seven(J: np.ndarray, H: np.ndarray) -> np.ndarray:
    """(7) as printed: G = H H^T J^T (J H H^T J^T)^-1."""
    W = H @ H.T
    return W @ J.T @ np.linalg.inv(J @ W @ J.T)


# --- T1: the planar arm, (18) to (25), symbolically exact ---


def test_the_robot_ppr_has_the_papers_jacobian_18(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    q = ca.SX.sym("q", 3)
    J = to_sympy(task.jacobian_expression(ppr.kinematics(q), q), q, Q)
    assert (J - J18).applyfunc(sp.simplify) == sp.zeros(2, 3)


def test_the_null_space_of_ppr_is_the_papers_19(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    for q3 in (-2.0, 0.0, 0.4, np.pi / 2, 3.0):
        q = np.array([0.3, -0.1, q3])
        assert task.null_space(q)[:, 0] == pytest.approx([np.sin(q3), -np.cos(q3), 1.0], abs=1e-15)


def test_brackets_of_20_and_25_and_of_22_and_23_vanish_exactly() -> None:
    for frame in (NG20, G22, G23):
        assert bracket(frame[:, 0], frame[:, 1]) == sp.zeros(3, 1)
    # (25) is involutive without commuting: its bracket lies in its span, which ker J_G is.
    gradient = sp.Matrix([[1, 1, -1 + C3 - S3]])
    assert (gradient * NG25).applyfunc(sp.simplify) == sp.zeros(1, 2)
    assert (gradient * bracket(NG25[:, 0], NG25[:, 1])).applyfunc(sp.simplify) == sp.zeros(1, 1)


def test_our_lie_bracket_agrees_with_sympy(ppr: hk.Robot) -> None:
    q = ca.SX.sym("q", 3)
    A = ca.vertcat(ca.sin(q[1]) * q[2], q[0] ** 2, ca.cos(q[0] * q[2]))
    B = ca.vertcat(q[1] * q[2], ca.sin(q[0]), q[2] ** 3)
    ours = to_sympy(lie_bracket(A, B, q), q, Q)
    theirs = bracket(to_sympy(A, q, Q), to_sympy(B, q, Q))
    assert (ours - theirs).applyfunc(sp.simplify) == sp.zeros(3, 1)


def test_H_of_20_has_determinant_one_everywhere_21(ppr: hk.Robot) -> None:
    assert sp.simplify(NG20.row_join(N19).det()) == 1
    strategy = hk.null_basis(hk.position(ppr), paper_frame)
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 3)):
        assert np.linalg.det(strategy.H(q)) == pytest.approx(1.0, abs=1e-14)


def test_seven_gives_22_and_23_symbolically() -> None:
    for frame, G in ((NG20, G22), (NG25, G23)):
        H = frame.row_join(N19)
        W = H * H.T
        assert (W * J18.T * (J18 * W * J18.T).inv() - G).applyfunc(sp.simplify) == sp.zeros(3, 2)


def test_det_of_the_extended_jacobian_24_is_minus_one_and_of_H_hat_is_one() -> None:
    gradient = sp.Matrix([[1, 1, -1 + C3 - S3]])
    assert sp.simplify(J18.col_join(gradient).det()) == -1
    assert sp.simplify(NG25.row_join(N19).det()) == 1
    assert (gradient * G23).applyfunc(sp.simplify) == sp.zeros(1, 2)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_our_strategies_are_22_and_23(q: list[float]) -> None:
    task = hk.position(hk.load("ppr"))
    posture = np.array(q)
    paper = hk.null_basis(task, paper_frame)
    assert paper(posture) == pytest.approx(numeric(G22, posture), abs=1e-13)
    for strategy in (hk.null_basis(task, de_luca_frame), hk.holonomic(task, hk.custom(de_luca_g))):
        assert strategy(posture) == pytest.approx(numeric(G23, posture), abs=1e-13)


def test_the_paper_strategies_are_holonomic_and_the_pseudo_inverse_is_not(ppr: hk.Robot) -> None:
    task, region = hk.position(ppr), hk.around(PPR_START, 0.5)
    for strategy in (
        hk.null_basis(task, paper_frame),
        hk.null_basis(task, de_luca_frame),
        hk.holonomic(task, hk.custom(de_luca_g)),
    ):
        verdict = hk.involutivity(strategy, region)
        assert verdict.holonomic
        assert verdict.relative < 1e-13
    verdict = hk.involutivity(hk.moore_penrose(task), region)
    assert not verdict.holonomic
    assert verdict.defect == pytest.approx(np.sqrt(2) / 4, rel=1e-12)  # |N| / 4 with |N|^2 = 2
    F = hk.curvature(hk.moore_penrose(task), verdict.witness)[:, 0, 1]
    assert pytest.approx(verdict.direction) == F


def test_curvature_of_the_pseudo_inverse_of_ppr_is_a_quarter_of_N(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    for q in np.random.default_rng(2).uniform(-3, 3, (10, 3)):
        F = hk.curvature(hk.moore_penrose(task), q)
        assert F[:, 0, 1] == pytest.approx(task.null_space(q)[:, 0] / 4, abs=1e-14)
        assert pytest.approx(-F.transpose(0, 2, 1)) == F


@pytest.mark.parametrize("w3", [0.25, 1.0, 4.0, 1e4])
@pytest.mark.parametrize("link", [0.5, 1.0, 2.0])
def test_units_mix_in_the_pseudo_inverse_of_ppr_E7(w3: float, link: float) -> None:
    rows = [
        {"kind": "prismatic", "theta": np.pi / 2, "alpha": np.pi / 2},
        {"kind": "prismatic", "theta": np.pi / 2, "alpha": np.pi / 2},
        {"a": link},
    ]
    base = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    task = hk.position(hk.from_dh(rows, base=base))
    assert task.m == 2
    strategy = hk.weighted(task, np.diag([1, 1, 1 / w3]))
    drift_per_area = hk.curvature(strategy, [0.1, 0.2, 0.7])[2, 0, 1]
    assert drift_per_area == pytest.approx(1 / (link + w3 / link) ** 2, rel=1e-12)


# --- the general form: T2, T3, Theorem III.2 ---


def arms() -> list[tuple[str, hk.Strategy, np.ndarray]]:
    ppr, irb, panda = hk.load("ppr"), hk.load("irb140"), hk.load("panda")
    return [
        ("ppr (20)", hk.null_basis(hk.position(ppr), paper_frame), PPR_START),
        ("ppr g", hk.holonomic(hk.position(ppr), hk.custom(de_luca_g)), PPR_START),
        ("irb140 coupled", hk.holonomic(hk.position(irb), hk.coupled(1.0)), IRB_START),
        ("panda lock", hk.holonomic(hk.pose(panda), hk.lock("panda_joint3")), PANDA_START),
        ("panda linear zyz", hk.holonomic(hk.pose(panda, "zyz"), hk.linear([1, 0, -1, 0, 0.3, 0, 0])), PANDA_START),
    ]


@pytest.mark.parametrize(("name", "strategy", "start"), arms(), ids=[a[0] for a in arms()])
def test_seven_equals_the_frame_form_and_the_extended_jacobian(name: str, strategy: hk.Strategy, start) -> None:
    rng = np.random.default_rng(3)
    task = strategy.task
    for q in start + rng.uniform(-0.3, 0.3, (10, task.n)):
        J, G, H = task.jacobian(q), strategy(q), strategy.H(q)
        frame = strategy.distribution(q)
        scale = np.linalg.cond(H) ** 2 * np.abs(G).max()
        assert np.abs(seven(J, H) - G).max() < 1e-15 * scale * 10
        assert np.abs(frame @ np.linalg.inv(J @ frame) - G).max() < 1e-11
        # determinant identity of theory 1.3
        N = task.null_space(q)
        left = np.linalg.det(H) * np.linalg.det(np.vstack([J, N.T]))
        right = np.linalg.det(J @ frame) * np.linalg.det(N.T @ N)
        assert left == pytest.approx(right, rel=1e-10)
        assert strategy.weight(q) == pytest.approx(H @ H.T)


@pytest.mark.parametrize(("name", "strategy", "start"), arms()[1:], ids=[a[0] for a in arms()[1:]])
def test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold(name: str, strategy: hk.Strategy, start) -> None:
    """Theorem III.2, 1 => 2: from G to J_G, N_G, H and back."""
    task = strategy.task
    q_symbol = strategy.expressions.q
    rows = ca.Function("J_G", [q_symbol], [strategy.expressions.planes])
    for q in start + np.random.default_rng(4).uniform(-0.2, 0.2, (5, task.n)):
        J, G, J_G = task.jacobian(q), strategy(q), np.array(rows(q))
        assert np.abs(J_G @ G).max() < 1e-12  # (10) along dq = G dx
        J_A = np.vstack([J, J_G])  # (11)
        N_G = np.linalg.svd(J_G)[2][J_G.shape[0] :].T
        H = np.hstack([N_G, task.null_space(q)])
        block = J_A @ H  # (13)
        assert np.abs(block[: task.m, task.m :]).max() < 1e-12
        assert np.abs(block[task.m :, : task.m]).max() < 1e-12
        assert abs(np.linalg.det(H)) > 1e-6
        assert np.abs(seven(J, H) - G).max() < 1e-9
        identity = np.vstack([np.eye(task.m), np.zeros((task.n - task.m, task.m))])
        assert np.abs(J_A @ seven(J, H) - identity).max() < 1e-9  # (14)


def test_the_frame_form_keeps_the_digits_that_seven_loses() -> None:
    """Theory 1.3: with N_G at an angle of 1e-6 to ker J, (7) keeps four digits and N_G (J N_G)^-1 ten."""
    rng = np.random.default_rng(5)
    losses = []
    for _ in range(20):
        J = rng.normal(size=(6, 7))
        N = np.linalg.svd(J)[2][6:].T
        N_G = np.linalg.qr(rng.normal(size=(7, 6)))[0]
        N_G[:, 0] = N[:, 0] + 1e-6 * N_G[:, 0]
        frame, *_ = np.linalg.qr(N_G)
        truth = sp.Matrix(frame.tolist())  # exact rational arithmetic on the doubles
        inverse = (sp.Matrix(J.tolist()).applyfunc(sp.Rational) * truth.applyfunc(sp.Rational)).inv()
        G = np.array((truth.applyfunc(sp.Rational) * inverse).evalf(17), dtype=float)
        ours = frame @ np.linalg.inv(J @ frame)
        size = np.abs(G).max()
        losses.append((np.abs(seven(J, np.hstack([frame, N])) - G).max() / size, np.abs(ours - G).max() / size))
        if len(losses) == 3:
            break
    squared, plain = np.median(losses, axis=0)
    assert plain < 1e-9
    assert squared > 1e3 * plain


# --- T4, T5: geometric Jacobians ---


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
    strategy = hk.coupled_twist(hk.position(irb140), gain)
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
    verdict = hk.involutivity(hk.coupled_twist(task, 1.0), region)
    assert not verdict.holonomic
    J = irb140.jacobian(verdict.witness)
    i, j = verdict.plane
    closed_form = np.linalg.solve(
        np.vstack([J[:3], J[3:] + J[:3]]), np.r_[0, 0, 0, -np.cross(np.eye(3)[i], np.eye(3)[j])]
    )
    assert pytest.approx(closed_form, abs=1e-12) == verdict.direction
    assert hk.involutivity(hk.coupled_twist(task, 0.0), region).holonomic  # J_w alone: constant orientation


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


def test_the_papers_example_has_the_wrist_singularity_as_an_algorithmic_one_E5(irb140: hk.Robot) -> None:
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(1.0))
    near = IRB_START.copy()
    near[4] = 1e-6
    assert np.linalg.svd(irb140.jacobian(near)[:3])[1][-1] > 0.1
    assert np.abs(strategy(near)).max() > 1e5
    near[4] = 0.0
    with pytest.raises(hk.errors.SingularityError) as caught:
        strategy(near)
    assert caught.value.kind is hk.errors.SingularityKind.ALGORITHMIC


def test_at_the_zyz_singularity_the_coupling_stays_bounded_and_is_refused_E5(irb140: hk.Robot) -> None:
    """theta = 0: G is bounded nearby but depends on the direction of approach."""
    strategy = hk.holonomic(hk.position(irb140), hk.coupled(1.0))
    down = np.array([0.1, np.pi / 2, -np.pi / 2 - 0.5, 0.0, 0.5, 0.2])  # the tool axis along -z
    assert irb140.pose(down)[2, 2] == pytest.approx(-1.0)
    with pytest.raises(hk.errors.SingularityError) as caught:
        strategy(down)
    assert caught.value.kind is hk.errors.SingularityKind.REPRESENTATION
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
        return hk.involutivity_of(lambda q: function(q), 6, hk.around(IRB_START, 0.2)).holonomic

    assert involutive(J_w)  # constant orientation: leaves R = const
    assert involutive(J_w[:2, :])
    assert not involutive(J_w[2, :])


# --- Lemma III.1 and its proof, with the errata E1 ---


def exact_jacobian() -> tuple[sp.Matrix, sp.Matrix, list[sp.Symbol]]:
    """A random exact J (2 x 4) = df/dq and a smooth basis N = [-J_a^-1 J_b; 1]."""
    q = list(sp.symbols("u1:5", real=True))
    f = sp.Matrix([q[0] + q[1] * q[2] + sp.sin(q[3]), q[1] + q[0] * q[3] + q[2] ** 2])
    J = f.jacobian(q)
    N = (-J[:, :2].inv() * J[:, 2:]).col_join(sp.eye(2))
    return J, N, q


def test_a_null_space_basis_is_involutive_lemma_III_1_36() -> None:
    J, N, q = exact_jacobian()
    value = N[:, 1].jacobian(q) * N[:, 0] - N[:, 0].jacobian(q) * N[:, 1]
    assert (J * value).applyfunc(sp.simplify) == sp.zeros(2, 1)


def test_equation_34_needs_its_brackets_and_35_is_J_times_the_bracket_E1() -> None:
    J, N, q = exact_jacobian()
    point = dict(zip(q, (0.3, -0.2, 0.5, 0.7), strict=True))
    i, j = 0, 1
    terms = np.zeros((2, 4))
    for k in range(2):
        for u in range(4):
            for s in range(4):
                dJ, dNi, dNj = J[k, s].diff(q[u]), N[s, i].diff(q[u]), N[s, j].diff(q[u])
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
    reverse = N[:, i].jacobian(q) * N[:, j] - N[:, j].jacobian(q) * N[:, i]  # [N_j, N_i]
    assert second - fourth == pytest.approx(np.array((J * reverse).subs(point), dtype=float)[:, 0], abs=1e-12)


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
        strategy = hk.weighted(task, weight)
        assert hk.involutivity(strategy, region).holonomic is expected
        assert hk.involutivity_of(lambda q, weight=weight: weight(q) @ J(q).T, 3, region).holonomic is expected


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


# --- T14, T16 ---


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8))
def test_every_transport_gives_zero_curvature_T14(c: list[float]) -> None:
    """Theory 1.6 on ppr: K = (x - cos z, y - sin z, z), Phi(x, z0) = a(x) + e^{b(x)} z0."""
    task = hk.position(hk.load("ppr"))

    def G(q: ca.SX) -> ca.SX:
        x = ca.vertcat(q[0] + ca.cos(q[2]), q[1] + ca.sin(q[2]))
        X = ca.SX.sym("X", 2)
        a = c[0] * X[0] + c[1] * X[1] ** 2 + c[2] * ca.sin(X[0] * X[1]) + c[3] * X[0] * X[1]
        b = c[4] * X[0] + c[5] * X[1] + c[6] * ca.cos(X[0] + c[7] * X[1])
        z0 = ca.SX.sym("z0")
        Phi = a + ca.exp(b) * z0
        slope = ca.Function("slope", [X, z0], [ca.jacobian(Phi, X), a, b])
        a_value, b_value = slope(x, 0)[1:]
        dPhi = slope(x, (q[2] - a_value) / ca.exp(b_value))[0]
        K_x = ca.vertcat(ca.horzcat(1, 0), ca.horzcat(0, 1), ca.horzcat(0, 0))
        K_z = ca.vertcat(ca.sin(q[2]), -ca.cos(q[2]), 1)
        return K_x + K_z @ dPhi

    strategy = hk.null_basis(task, G)
    verdict = hk.involutivity(strategy, hk.around(PPR_START, 0.5))
    assert verdict.holonomic
    given_G = ca.Function("G", [q := ca.SX.sym("q", 3)], [G(q)])
    assert np.abs(strategy(PPR_START) - np.array(given_G(PPR_START))).max() < 1e-12  # J G = 1: it is its own strategy


def test_the_transport_of_20_reproduces_22(ppr: hk.Robot) -> None:
    """Theory 1.6: Phi = 2 atan(tan(z0 / 2) e^-x) gives (22), since dPhi/dx = -sin z."""
    x, z0 = sp.symbols("x z0", real=True)
    Phi = 2 * sp.atan(sp.tan(z0 / 2) * sp.exp(-x))
    slope = Phi.diff(x) + sp.sin(Phi)
    for values in ((0.3, 0.7), (-1.2, 1.5), (2.0, -0.4)):
        assert abs(float(slope.subs(dict(zip((x, z0), values, strict=True))).evalf())) < 1e-15
    K_x = sp.Matrix([[1, 0], [0, 1], [0, 0]])
    assert (K_x + N19 * sp.Matrix([[-S3, 0]]) - G22).applyfunc(sp.simplify) == sp.zeros(3, 2)


def test_millimetres_with_the_gain_scaled_leave_the_joints_alone_T16() -> None:
    """E6: Lambda has a unit, rad/m. In mm with Lambda / 1000 the joint path is the same."""
    metres = hk.load("irb140")
    scaled = [
        {"a": 1e3 * a, "d": 1e3 * d, "alpha": np.deg2rad(alpha)}
        for a, d, alpha in ((0.07, 0, 90), (0.36, 0, 0), (0, 0, 90), (0, 0.38, -90), (0, 0, 90), (0, 0.065, 0))
    ]
    millimetres = hk.from_dh(scaled)
    corners = np.array([[0, 0, 0], [0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1]])
    walks = []
    for robot, scale in ((metres, 1.0), (millimetres, 1e3)):
        strategy = hk.holonomic(hk.position(robot), hk.coupled(1.0 / scale))
        path = hk.polyline(robot.pose(IRB_START)[:3, 3] + scale * corners, closed=True)
        walks.append(hk.follow(strategy, path, IRB_START, samples=40).q)
    assert np.abs(walks[0] - walks[1]).max() < 1e-12
    # The paper's formula with the units forgotten is another strategy: 1 rad/mm instead of 1 rad/m.
    plain, forgotten = (
        np.abs(hk.holonomic(hk.position(r), hk.coupled(1.0))(IRB_START)).max() for r in (metres, millimetres)
    )
    assert plain < 5
    assert 1e3 * forgotten > 500


def test_curvature_does_not_depend_on_how_the_planes_are_written(ppr: hk.Robot) -> None:
    """By a frame and by rows: (20) spans the kernel of d(q1 + cos q3 + ln tan(q3/2)) = (1, 0, cos^2/sin)."""
    task = hk.position(ppr)
    by_rows = hk.pfaffian(task, lambda q: [[ca.sin(q[2]), 0, ca.cos(q[2]) ** 2]])  # a multiple of the gradient
    by_frame = hk.null_basis(task, paper_frame)
    assert by_rows(PPR_START) == pytest.approx(by_frame(PPR_START), abs=1e-14)
    skewed = hk.pfaffian(task, lambda q: [[ca.sin(q[2]) + q[1], 0, 1]])
    n = ca.SX.sym("q", 3)
    rows = skewed.planes(task, ppr.kinematics(n), n)
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
