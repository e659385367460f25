"""Is a black box dq = G(q) x'? Reversed and slower loops and stairs tell, not the curvature at the start."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.analysis.audit.questions import AuditSetup, ask_small_loops
from holokin.motion.control import as_control_law
from holokin.motion.control.control_law import Step


def rowed(robot: hk.Robot, joint: int, row) -> Step:
    """dq with J dq = x' and dq_joint = row(x, x'), in plain NumPy."""

    def law(q, pose, twist, dt):
        e = np.eye(robot.n)[joint]
        at = robot.pose(q)[:3, 3]
        return np.linalg.solve(np.vstack([robot.jacobian(q), e]), np.append(twist, row(at, twist)))

    return law


def asked(robot: hk.Robot, law: Step, q0: np.ndarray, plane: tuple[int, int]) -> tuple[str, dict[str, float]]:
    return ask_small_loops(AuditSetup(as_control_law(law), hk.pose(robot), q0, 0.02, 3, 2.0, 1e-3), plane)


@sampled(2, "seed", range(6))
def test_a_law_whose_curvature_is_zero_at_the_start_is_of_the_form_g_of_q(
    panda: hk.Robot, iiwa14: hk.Robot, seed: int
) -> None:
    """dq_j = k (x_a - x0_a)^p dx_b: curvature k p (x_a - x0_a)^(p - 1), which is 0 at the start for p > 1."""
    rng = np.random.default_rng(seed)
    robot = (panda, iiwa14)[seed % 2]
    q0 = PANDA_START + rng.uniform(-0.2, 0.2, 7)
    a, b = rng.choice(3, 2, replace=False)
    power, k = int(rng.integers(1, 5)), rng.uniform(0.3, 1.0)
    start = robot.pose(q0)[:3, 3].copy()

    def row(x, twist):
        return k * ((x[a] - start[a]) / 0.05) ** power * twist[b] / 0.5

    said, metrics = asked(robot, rowed(robot, int(rng.choice((0, 2, 4))), row), q0, (min(a, b), max(a, b)))
    assert "a local strategy" in said and "not of the form" not in said, said
    assert metrics["ratio"] == pytest.approx(2.0 ** (power + 1), rel=0.15)
    assert metrics["turned"] < 0.1 and metrics["hurried"] < 0.01


@sampled(
    4,
    ("kind", "changed"),
    [("length", "turned"), ("time", "hurried"), ("odd", "stairs"), ("curved", "stairs"), ("square", "turned")],
)
@sampled(1, "seed", range(2))
def test_a_law_that_is_not_linear_in_the_twist_is_not_of_that_form(
    panda: hk.Robot, kind: str, changed: str, seed: int
) -> None:
    """Each has dq_j = h(x'), the odd ones linear along the axes, so that loops of four sides look like a strategy's."""
    k = np.random.default_rng(seed).uniform(0.5, 1.5)
    x0 = panda.pose(PANDA_START)[0, 3]
    rows = {
        "length": lambda x, v: k * np.linalg.norm(v[:3]),
        "time": lambda x, v: 0.02 * k,
        "odd": lambda x, v: 10 * k * (x[0] - x0) * v[1] ** 3 / max(v[:2] @ v[:2], 1e-12),
        "curved": lambda x, v: 200 * k * (x[0] - x0) ** 2 * v[1] * abs(v[1]) / max(np.linalg.norm(v[:2]), 1e-9),
        "square": lambda x, v: 20 * k * (v[:3] @ v[:3]),
    }
    said, metrics = asked(panda, rowed(panda, 2, rows[kind]), PANDA_START, (0, 1))
    assert "not of the form dq = G(q) x'" in said, said
    assert metrics[changed] > {"turned": 0.5, "hurried": 0.05, "stairs": 0.05}[changed]


@sampled(1, "width", [0.02, 0.018, 0.03])
def test_a_curvature_that_changes_its_sign_within_the_loop_is_no_other_form(panda: hk.Robot, width: float) -> None:
    x0 = panda.pose(PANDA_START)[0, 3]
    law = rowed(panda, 2, lambda x, v: np.sin((x[0] - x0) / width) * v[1])
    said, metrics = asked(panda, law, PANDA_START, (0, 1))
    assert "a local strategy" in said, said
    assert metrics["ratio"] < 2.8 and "changes within the loops" in said
