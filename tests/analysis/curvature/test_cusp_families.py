"""Every cusp is one by differences of positions alone; orthogonal arms have as many families as algebra counts."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.analysis.curvature import cuspidal_leaf, witness_between
from holokin.analysis.curvature.cusp_search import CuspPoints, symmetric_joints
from holokin.analysis.curvature.cuspidal_leaf import candidates
from holokin.base.errors import ArgumentError, SingularityError

Lengths = tuple[float, float, float, float]

RATES = np.array([1.3, -0.7, 0.9, 1.1, -1.2])


def orthogonal(d2: float, d3: float, d4: float, r2: float, before: int = 0) -> hk.Robot:
    """Three hinges at right angles to one another; `before` it other hinges with the axis of the first."""
    tool = np.eye(4)
    tool[0, 3] = d4
    rows = [
        *[{"a": 0, "alpha": 0, "d": 0}] * (before + 1),
        {"a": d2, "alpha": -np.pi / 2, "d": r2},
        {"a": d3, "alpha": np.pi / 2, "d": 0},
    ]
    return hk.from_dh(rows, "modified", name="orthogonal", tool=tool)


def triple_roots(d2: float, d3: float, d4: float, r2: float) -> np.ndarray:
    """(k, 2) the last two joints where three postures of an orthogonal arm come together, from a polynomial.

    With F = d3 + d4 cos q3 and s = sin q3 its tool is at rho^2 = (d2 + F cos q2)^2 + (r2 + d4 s)^2, z = -F sin q2.
    L = 2 d2 F cos q2 is K - 2 d3 d4 cos q3 - 2 r2 d4 s, where K depends on rho and z alone. So q3 solves
    p(q3) = z^2 + (L / 2 d2)^2 - F^2 = 0, and three of its roots are one where p = p' = p'' = 0. L from p' = 0, put into
    p'' = 0, leaves L'^3 + 4 d2^2 (F F' L'' - (F'^2 + F F'') L') = 0, of degree six in tan(q3 / 2).
    """
    P = np.polynomial.Polynomial
    c, s, w = P([1, 0, -1]), P([0, 2]), P([1, 0, 1])
    F, F1, F2 = d3 * w + d4 * c, -d4 * s, -d4 * c
    L1, L2 = 2 * d4 * (d3 * s - r2 * c), 2 * d4 * (d3 * c + r2 * s)
    t = (L1**3 + 4 * d2**2 * (F * F1 * L2 - (F1**2 + F * F2) * L1)).roots()
    t = t[np.abs(t.imag) < 1e-7].real
    F, F1, L1 = F(t) / w(t), F1(t) / w(t), L1(t) / w(t)
    cosine = 2 * d2 * F1 / L1
    q2, q3 = np.arccos(cosine[np.abs(cosine) < 1]), 2 * np.arctan(t[np.abs(cosine) < 1])
    return np.vstack([np.column_stack([q2, q3]), np.column_stack([-q2, q3])])


def domain(d2: float, d3: float, d4: float, r2: float) -> int:
    """1 to 5, [BWC04]: which of the arms with 0, 4, 2, 4 and 0 cusps in a half plane through the first axis it is."""
    d3, d4, r2 = d3 / d2, d4 / d2, r2 / d2
    A, B, square = np.hypot(d3 + 1, r2), np.hypot(d3 - 1, r2), d3**2 + r2**2
    if d4 < np.sqrt((square - (square**2 - d3**2 + r2**2) / (A * B)) / 2):
        return 1
    if d4 < d3 / (1 + d3) * A:
        return 2
    if d4 < d3 / abs(d3 - 1) * B:
        return 3
    return 4 if d3 > 1 else 5


ARMS: list[Lengths] = [  # three or four in each domain
    (1.0, 0.5, 0.2, 0.4), (1.0, 1.5, 0.15, 0.3), (2.0, 0.6, 0.4, 0.3), (1.0, 0.9, 0.3, 0.1),
    (1.0, 2.0, 1.5, 1.0), (1.0, 1.2, 0.7, 0.5), (1.5, 2.5, 1.6, 0.4),
    (1.0, 0.6, 0.9, 0.5), (1.0, 1.1, 2.0, 0.6), (2.0, 1.0, 1.2, 1.0),
    (1.0, 2.0, 3.5, 1.0), (1.0, 1.6, 4.0, 0.5), (0.5, 1.0, 2.0, 0.2), (1.0, 3.0, 5.5, 2.0),
    (1.0, 0.5, 2.0, 0.5), (1.0, 0.3, 1.1, 0.2), (2.0, 0.8, 4.0, 0.6),
]  # fmt: skip
CASES = [(lengths, 0) for lengths in ARMS]


@pytest.mark.parametrize(
    ("lengths", "before"),
    [*(CASES[k] for k in (0, 4, 7, 10, 14)), (ARMS[8], 1), *(campaign(("a", "b"), case) for case in CASES),
     *(campaign(("a", "b"), (one, 1)) for one in ARMS)],
)  # fmt: skip
def test_orthogonal_arms_in_five_domains_have_0_4_2_4_and_0_families_of_cusps(
    lengths: Lengths, before: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A family is a circle about the first axis. Of an arm with a second hinge there, its angle given by a sum of the
    others, no joint alone leads along it, and the circles are followed."""
    monkeypatch.setattr(cuspidal_leaf, "first_witness", lambda *_: None)  # whose loops take longer
    robot, wanted = orthogonal(*lengths, before=before), triple_roots(*lengths)
    assert len(wanted) == (0, 4, 2, 4, 0)[domain(*lengths) - 1]
    law = hk.holonomic(hk.position(robot), hk.linear([1, -1, 1, 0])) if before else hk.moore_penrose(hk.position(robot))
    cusps = hk.cusps(law, RATES[: robot.n], starts=150)
    assert cusps.families is not None and len(cusps.families) == len(wanted)
    if len(wanted):
        assert f"of {len(wanted)} families" in cusps.sentence
        assert not symmetric_joints(cusps.strategy, cusps.level, cusps.q)[1:].any()
        assert symmetric_joints(cusps.strategy, cusps.level, cusps.q)[0] == (not before)
    for family in cusps.families:
        gap = (cusps.q[family][:, None, -2:] - wanted + np.pi) % (2 * np.pi) - np.pi
        away = np.abs(gap).max(axis=2)
        assert away.min(axis=1).max() < 1e-7 and len(np.unique(away.argmin(axis=1))) == 1


@pytest.mark.parametrize(("first", "count"), [(0, 200), campaign(("first", "count"), (200, 2_800))])
def test_triple_roots_are_as_many_as_the_domain_of_the_lengths_says(first: int, count: int) -> None:
    """Two sources that know nothing of each other: a polynomial, and the surfaces between the domains."""
    for lengths in np.random.default_rng(0).uniform(0.1, 4.0, (first + count, 4))[first:]:
        assert len(triple_roots(*lengths)) == (0, 4, 2, 4, 0)[domain(*lengths) - 1]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_random_orthogonal_arms_have_as_many_families_as_their_polynomial_has_triple_roots(seed: int) -> None:
    lengths: Lengths = (1.0, *np.random.default_rng(seed).uniform(0.1, 4.0, 3))
    """And where there are cusps, a loop that does not bring the joints back is found."""
    cusps = hk.cusps(hk.moore_penrose(hk.position(orthogonal(*lengths))), RATES[:3], starts=600)
    assert cusps.families is not None and len(cusps.families) == len(triple_roots(*lengths))
    assert cusps.cuspidal == bool(len(cusps))


def random_law(seed: int, m: int) -> tuple[hk.Strategy, np.ndarray, np.ndarray]:
    """(a strategy for m rows of the position of an arm of hinges and slides, in a plane or in space; the rows C of its
    constraint C q = c; a posture)."""
    rng = np.random.default_rng(seed)
    r, bent = int(rng.integers(0 if m > 1 else 1, 3)), float(m == 3 or rng.random() < 0.5)
    slide = int(rng.integers(m + r)) if bent and rng.random() < 0.5 else -1
    rows = [
        {
            "a": rng.uniform(0.3, 1.0),
            "alpha": bent * rng.uniform(-2, 2),
            "d": bent * rng.uniform(0, 0.5),
            "kind": "prismatic" if k == slide else "revolute",
        }
        for k in range(m + r)
    ]
    task = hk.position(hk.from_dh(rows, name="random"), rows=list(range(m)))
    C = rng.integers(-2, 3, (r, m + r)) + np.eye(r, m + r)
    law = hk.holonomic(task, hk.linear(C)) if r else hk.moore_penrose(task)
    return law, C, rng.uniform(-1, 1, m + r)


def extended(law: hk.Strategy, C: np.ndarray, q: np.ndarray) -> np.ndarray:
    """[J; C] (n, n) by central differences of the tool's position."""
    robot, h = law.task.robot, 1e-5
    ends = [[robot.pose(q + k * h * e)[: len(q) - len(C), 3] for k in (-1, 1)] for e in np.eye(len(q))]
    return np.vstack([np.diff(ends, axis=1)[:, 0].T / (2 * h), C])


def lost(law: hk.Strategy, C: np.ndarray, q: np.ndarray, like: np.ndarray | None) -> tuple[np.ndarray, float]:
    """(the direction v that is lost, or nearly, turned as another one; the slope of det [J; C] along it)."""
    v, h = np.linalg.svd(extended(law, C, q))[2][-1], 1e-4
    v = v if like is None or v @ like > 0 else -v
    low, high = (np.linalg.det(extended(law, C, q + k * h * v)) for k in (-1, 1))
    return v, float(high - low) / (2 * h)


def differences(robot: hk.Robot, q: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The largest joint's, whole turns of hinges left out."""
    gap = q - others
    return np.abs(np.where(robot.hinges, (gap + np.pi) % (2 * np.pi) - np.pi, gap)).max(axis=-1)


NAMES = ("seed", "m")


@pytest.mark.parametrize(NAMES, [c if c[0] < 2 else campaign(NAMES, c) for c in product(range(60), (1, 2, 3))])
def test_every_cusp_of_a_random_arm_is_one_by_differences_of_positions(seed: int, m: int) -> None:
    """It is on the leaf; one direction v is lost, and only one; det [J; C] has no slope along v, but one along the
    leaf; and its slope along v has no double zero there."""
    law, C, q0 = random_law(seed, m)
    try:
        cusps = hk.cusps(law, q0, starts=40)
    except SingularityError:  # the constraint holds what the task moves, wherever the arm is
        return
    if m == 1:
        assert not len(cusps) and not cusps.double and not cusps.cuspidal and cusps.starts == 0
        assert "a curve, which has no cusp" in cusps.sentence and "search" not in cusps.sentence
    robot, null, h = law.task.robot, np.linalg.svd(C)[2][len(C) :] if len(C) else np.eye(len(q0)), 1e-4
    apart = differences(robot, cusps.q[:, None], cusps.q) + 9 * np.eye(len(cusps))
    assert apart.min(initial=1.0) > 1e-6  # each is told once
    for q in cusps.q[:4]:
        assert np.abs(C @ (q - q0)).max(initial=0.0) < 1e-8
        sigma = np.linalg.svd(extended(law, C, q), compute_uv=False)
        assert sigma[-1] < 1e-7 * sigma[0] and sigma[-2] > 1e-4 * sigma[0]
        v, slope = lost(law, C, q, None)
        det = [[np.linalg.det(extended(law, C, q + k * h * e)) for k in (-1, 1)] for e in null]
        ends = [lost(law, C, q + k * 10 * h * v, v)[1] for k in (-1, 1)]
        scale = np.prod(sigma[:-1])
        assert abs(slope) < 1e-5 * scale
        assert np.linalg.norm(np.diff(det)) / (2 * h) > 1e-4 * scale
        assert abs(ends[1] - ends[0]) / (20 * h) > 1e-6 * scale
    for one in cusps.witnesses:
        assert 0.02 < differences(robot, one.second, one.first) == pytest.approx(one.apart)


def test_a_whole_turn_of_the_base_is_no_other_posture() -> None:
    """The tool goes once round the base, and the joints are a whole turn further: nothing is else than before."""
    law, q = hk.moore_penrose(hk.position(orthogonal(*ARMS[4]))), RATES[:3]
    with pytest.raises(ArgumentError, match="whole turns left out"):
        witness_between(law, q, q + [2 * np.pi, 0, 0])
    found = hk.cusps(law, q, starts=1)
    turn = CuspPoints(q[None], np.zeros((1, 3)), np.array([[np.pi / 0.8, 0.0, 0.0]]))
    assert not len(candidates(found.strategy, found.level, turn, False)[0].first)
