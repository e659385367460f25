"""The paper's planar arm and general form, equation by equation, with SymPy and closed forms as referees. [ZR11]"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START
from holokin.symbolic import lie_bracket
from papers_arm import C3, G22, G23, J18, N19, NG20, NG25, S3, Q, de_luca_frame, de_luca_g, paper_frame
from sympy_bridge import to_sympy


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
    strategy = hk.weighted(task, np.diag([1, 1, w3]))
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
