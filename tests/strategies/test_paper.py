"""The paper's planar arm and general form, equation by equation, with SymPy and closed forms as referees. [ZR11]"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import subspace_angles

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START
from holokin.app.job import job_strategy, open_job
from holokin.symbolic import lie_bracket, pairwise_brackets, solve
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


def test_the_robot_ppr_has_the_papers_jacobian_18() -> None:
    """The forward kinematics (1) and their derivative (2) of the packaged robot."""
    ppr = hk.load("ppr")
    task = hk.position(ppr)
    q = ca.SX.sym("q", 3)
    J = to_sympy(task.jacobian_expression(ppr.kinematics(q), q), q, Q)
    assert (J - J18).applyfunc(sp.simplify) == sp.zeros(2, 3)
    x = to_sympy(task.value_expression(ppr.kinematics(q)), q, Q)
    assert (x - sp.Matrix([Q[0] + C3, Q[1] + S3])).applyfunc(sp.simplify) == sp.zeros(2, 1)
    assert (x.jacobian(Q) - J).applyfunc(sp.simplify) == sp.zeros(2, 3)


def test_an_orientation_stands_below_the_position_and_its_rows_are_derivatives_26(irb140: hk.Robot) -> None:
    """J = [J_p; J_o], J_o of ZYZ angles by central differences of the angles of the rotation, written out here."""
    task, h = hk.pose(irb140, "zyz"), 1e-6

    def zyz(q: np.ndarray) -> np.ndarray:
        R = irb140.pose(q)[:3, :3]
        return np.array([np.arctan2(R[1, 2], R[0, 2]), np.arccos(R[2, 2]), np.arctan2(R[2, 1], -R[2, 0])])

    J = task.jacobian(IRB_START)
    assert J[:3] == pytest.approx(irb140.jacobian(IRB_START)[:3], abs=1e-14)
    slopes = np.column_stack([(zyz(IRB_START + e) - zyz(IRB_START - e)) / (2 * h) for e in np.eye(6) * h])
    assert J[3:] == pytest.approx(slopes, abs=1e-8)
    assert task(IRB_START)[3:] == pytest.approx(zyz(IRB_START), abs=1e-12)


def test_joint_rates_are_G_times_the_tools_rates_3(ppr: hk.Robot) -> None:
    strategy = hk.null_basis(hk.position(ppr), paper_frame)
    for q, dx in np.random.default_rng(8).uniform(-1, 1, (5, 2, 3)):
        dq = strategy.rate(q, dx[:2])[0]
        assert dq == pytest.approx(numeric(G22, q) @ dx[:2], abs=1e-13)
        assert numeric(J18, q) @ dq == pytest.approx(dx[:2], abs=1e-13)


def test_the_null_space_of_ppr_is_the_papers_19(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    for q3 in (-2.0, 0.0, 0.4, np.pi / 2, 3.0):
        q = np.array([0.3, -0.1, q3])
        assert task.null_space(q)[:, 0] == pytest.approx([np.sin(q3), -np.cos(q3), 1.0], abs=1e-15)


def fields(rows: list) -> ca.SX:
    """A frame (3, 2) of nested lists as an expression."""
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def inverse_22(q: ca.SX) -> list:
    return [[ca.cos(q[2]) ** 2, 0], [ca.sin(q[2]) * ca.cos(q[2]), 1], [-ca.sin(q[2]), 0]]


def inverse_23(q: ca.SX) -> list:
    return [[1 + ca.sin(q[2]), ca.sin(q[2])], [-ca.cos(q[2]), 1 - ca.cos(q[2])], [1, 1]]


def test_our_brackets_of_20_22_23_and_25_vanish_exactly() -> None:
    q = ca.SX.sym("q", 3)
    for frame, exact in ((paper_frame, NG20), (inverse_22, G22), (inverse_23, G23), (de_luca_frame, NG25)):
        B = fields(frame(q))
        assert (to_sympy(B, q, Q) - exact).applyfunc(sp.simplify) == sp.zeros(3, 2)
        (ours,) = pairwise_brackets(B, q).values()
        value = to_sympy(ours, q, Q)
        assert (value - bracket(exact[:, 0], exact[:, 1])).applyfunc(sp.simplify) == sp.zeros(3, 1)
        assert value.applyfunc(sp.simplify) == sp.zeros(3, 1)
        assert hk.analysis.curvature.involutivity_of(frame, 3).holonomic


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


def test_seven_by_our_weighted_pseudo_inverse_gives_22_and_23(ppr: hk.Robot) -> None:
    """(6) with W = H H^T is (7), and gives the paper's G; SymPy does the same in fractions."""
    task = hk.position(ppr)
    for frame, exact, G in ((paper_frame, NG20, G22), (de_luca_frame, NG25, G23)):
        H = exact.row_join(N19)
        W = H * H.T
        for sine, cosine in ((3, 4), (-5, 12), (8, -15)):  # over 5, 13, 17: angles with exact fractions
            size = sp.sqrt(sine**2 + cosine**2)
            W_here, J_here, G_here = (M.subs({S3: sine / size, C3: cosine / size}) for M in (W, J18, G))
            assert W_here * J_here.T * (J_here * W_here * J_here.T).inv() == G_here

        def weight(q: ca.SX, frame=frame) -> ca.SX:
            h = ca.horzcat(fields(frame(q)), ca.vertcat(ca.sin(q[2]), -ca.cos(q[2]), 1))
            return solve(h @ h.T, ca.SX.eye(3))  # W^-1

        seven_as_six, by_frame = hk.weighted(task, weight), hk.null_basis(task, frame)
        for q in np.random.default_rng(6).uniform(-1.2, 1.2, (5, 3)):
            assert seven_as_six(q) == pytest.approx(numeric(G, q), abs=1e-12)
            assert by_frame.inverse_weight(q) == pytest.approx(numeric(W, q), abs=1e-13)
            assert seven(task.jacobian(q), by_frame.H(q)) == pytest.approx(numeric(G, q), abs=1e-12)


def test_our_extended_jacobian_is_24_its_determinant_minus_one_and_its_kernel_25(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    J24 = J18.col_join(sp.Matrix([[1, 1, -1 + C3 - S3]]))
    assert sp.simplify(J24.det()) == -1
    assert sp.simplify(NG25.row_join(N19).det()) == 1
    strategy, by_frame = hk.holonomic(task, hk.custom(de_luca_g)), hk.null_basis(task, de_luca_frame)
    for q in np.random.default_rng(7).uniform(-3, 3, (10, 3)):
        form = hk.analysis.curvature.general_form(strategy, q)
        assert pytest.approx(numeric(J24, q), abs=1e-14) == form.J_A
        assert np.linalg.det(form.J_A) == pytest.approx(-1, abs=1e-13)
        assert np.abs(form.J_G @ numeric(NG25, q)).max() < 1e-14
        assert subspace_angles(form.N_G, numeric(NG25, q)).max() < 1e-7
        assert np.linalg.det(by_frame.H(q)) == pytest.approx(1, abs=1e-13)


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_our_strategies_are_22_and_23(q: list[float]) -> None:
    task = hk.position(hk.load("ppr"))
    posture = np.array(q)
    paper = hk.null_basis(task, paper_frame)
    assert paper(posture) == pytest.approx(numeric(G22, posture), abs=1e-13)
    for strategy in (hk.null_basis(task, de_luca_frame), hk.holonomic(task, hk.custom(de_luca_g))):
        assert strategy(posture) == pytest.approx(numeric(G23, posture), abs=1e-13)


def test_the_packaged_job_holds_20_with_its_22_and_23_with_its_24() -> None:
    _, job, file = open_job("ppr-half-circle")
    _, paper, _ = job_strategy(job, file, "paper")
    _, de_luca, _ = job_strategy(job, file, "de-luca-oriolo")
    J24 = J18.col_join(sp.Matrix([[1, 1, -1 + C3 - S3]]))
    for q in np.random.default_rng(9).uniform(-3, 3, (10, 3)):
        assert paper.distribution(q) == pytest.approx(numeric(NG20, q), abs=1e-14)
        assert paper(q) == pytest.approx(numeric(G22, q), abs=1e-13)
        assert de_luca.rows(q) == pytest.approx(numeric(J24, q)[2:], abs=1e-14)
        assert de_luca(q) == pytest.approx(numeric(G23, q), abs=1e-13)


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


def arm(name: str) -> tuple[hk.Strategy, np.ndarray]:
    """(a holonomic strategy, a start posture)"""
    robot = hk.load(name.split()[0])
    return {
        "ppr by (20)": lambda: (hk.null_basis(hk.position(robot), paper_frame), PPR_START),
        "ppr by g": lambda: (hk.holonomic(hk.position(robot), hk.custom(de_luca_g)), PPR_START),
        "irb140 coupled": lambda: (hk.holonomic(hk.position(robot), hk.coupled(1.0)), IRB_START),
        "panda lock": lambda: (hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), PANDA_START),
        "panda linear zyz": lambda: (
            hk.holonomic(hk.pose(robot, "zyz"), hk.linear([1, 0, -1, 0, 0.3, 0, 0])),
            PANDA_START,
        ),
    }[name]()


BY_G = ["ppr by g", "irb140 coupled", "panda lock", "panda linear zyz"]


@pytest.mark.parametrize("name", ["ppr by (20)", *BY_G])
def test_seven_equals_the_frame_form_and_the_extended_jacobian(name: str) -> None:
    strategy, start = arm(name)
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
        assert strategy.inverse_weight(q) == pytest.approx(H @ H.T)


@pytest.mark.parametrize("name", BY_G)
def test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold(name: str) -> None:
    """Theorem III.2, 1 => 2: from G to J_G, N_G, H and back."""
    strategy, start = arm(name)
    task = strategy.task
    q_symbol = strategy.expressions.q
    rows = ca.Function("J_G", [q_symbol], [strategy.expressions.planes])
    for q in start + np.random.default_rng(4).uniform(-0.2, 0.2, (5, task.n)):
        J, G, J_G = task.jacobian(q), strategy(q), np.array(rows(q))
        assert np.abs(J_G @ G).max() < 1e-12  # (10) along dq = G dx
        J_A = np.vstack([J, J_G])  # (11)
        N_G = np.linalg.svd(J_G)[2][J_G.shape[0] :].T
        H = np.hstack([N_G, task.null_space(q)])
        form = hk.analysis.curvature.general_form(strategy, q)
        assert subspace_angles(form.N_G, N_G).max() < 1e-7
        assert pytest.approx(np.hstack([form.N_G, task.null_space(q)]), abs=1e-15) == form.H
        assert pytest.approx(J_A, abs=1e-13) == form.J_A
        block = J_A @ H  # (13)
        assert np.abs(block[: task.m, task.m :]).max() < 1e-12
        assert np.abs(block[task.m :, : task.m]).max() < 1e-12
        assert abs(np.linalg.det(H)) > 1e-6
        assert np.abs(seven(J, H) - G).max() < 1e-9
        identity = np.vstack([np.eye(task.m), np.zeros((task.n - task.m, task.m))])
        assert np.abs(J_A @ seven(J, H) - identity).max() < 1e-9  # (14)
        found = form.residuals()
        assert max(found[key] for key in ("(7)", "(8)", "(10)", "(13)", "(14)")) < 1e-9
        sizes = {"(9)": J @ form.N_G, "(11)": J_A, "H": form.H}
        assert {key: found[key] for key in sizes} == pytest.approx({k: np.linalg.norm(M, -2) for k, M in sizes.items()})
        assert found["(12)"] == pytest.approx(np.sin(subspace_angles(task.null_space(q), N_G).min()))


def test_our_strategy_keeps_the_digits_that_seven_loses(panda: hk.Robot) -> None:
    """Theory 1.3: with N_G at an angle of 1e-6 to ker J, (7) keeps four digits and N_G (J N_G)^-1 ten."""
    task, q = hk.pose(panda), PANDA_START
    J = task.jacobian(q)
    J_exact = sp.Matrix(J.tolist()).applyfunc(sp.Rational)  # exact rational arithmetic on the doubles
    squared, plain = [], []
    for seed in range(3):
        N_G = np.linalg.qr(np.random.default_rng(seed).normal(size=(7, 6)))[0]
        N_G[:, 0] = np.linalg.svd(J)[2][6] + 1e-6 * N_G[:, 0]
        N_G, *_ = np.linalg.qr(N_G)
        frame = sp.Matrix(N_G.tolist()).applyfunc(sp.Rational)
        G = np.array((frame * (J_exact * frame).inv()).evalf(17), dtype=float)
        strategy = hk.null_basis(task, lambda _q, N_G=N_G: N_G.tolist())
        plain.append(np.abs(strategy(q) - G).max() / np.abs(G).max())
        squared.append(np.abs(seven(J, strategy.H(q)) - G).max() / np.abs(G).max())
    assert np.median(plain) < 1e-9
    assert np.median(squared) > 1e3 * np.median(plain)
