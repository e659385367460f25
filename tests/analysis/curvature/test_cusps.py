"""Cusps: leaves with two postures of one tool pose, joined without a singular posture. Theory 7.3."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from benchmarks.cusps import questions, text

import holokin as hk
from conftest import campaign, fails, sampled
from holokin.analysis.curvature import cuspidal_leaf, why_elsewhere, witness_between
from holokin.analysis.curvature.cusp_search import CuspPoints, cusp_functions, seek_cusps, symmetric_joints
from holokin.analysis.curvature.cuspidal_leaf import candidates
from holokin.app.job import open_job, run_job
from holokin.base.errors import ArgumentError, SingularityError
from holokin.motion.ik import leaf_value
from holokin.motion.self_motions.posture_search import spread
from holokin.strategies import HolonomicStrategy

PANDA = np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])
IIWA = np.array([0.1, 0.4, 0.2, -1.2, 0.1, 1.2, 0.8])
Q1_Q3 = (1, 0, -1, 0, 0, 0, 0)


def law(name: str, constraint: hk.Constraint) -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load(name)), constraint)


def three_joints(first: float) -> hk.Strategy:
    """Wenger's arm of three joints: d3, d4, r2, r3 = 2, 1.5, 1, 0, alpha = -90, 90 degrees; `first` is its d2."""
    tool = np.eye(4)
    tool[0, 3] = 1.5
    rows = [
        {"a": 0, "alpha": 0, "d": 0},
        {"a": first, "alpha": -np.pi / 2, "d": 1},
        {"a": 2, "alpha": np.pi / 2, "d": 0},
    ]
    return hk.moore_penrose(hk.position(hk.from_dh(rows, "modified", name="three", tool=tool)))


LAWS = {"q1 - q3": hk.linear(Q1_Q3), "lock 3": hk.lock(2), "arm angle": hk.arm_angle()}


@cache
def found(name: str) -> hk.analysis.curvature.Cusps:
    """Those of a Panda, searched once."""
    return hk.cusps(law("panda", LAWS[name]), PANDA, starts=100)


@pytest.mark.parametrize(
    ("name", "steps"), [("lock 3", 400), *(campaign(("name", "steps"), (name, 2_000)) for name in LAWS)]
)
def test_round_a_cusp_the_joints_of_a_panda_do_not_come_back(name: str, steps: int) -> None:
    """Pinocchio and small Newton steps of our own go the tool path, regular all along, to the other posture."""
    cusps = found(name)
    strategy, robot = cusps.strategy, cusps.strategy.task.robot
    small, regular = cusps.witness, cusps.most_regular
    assert cusps.cuspidal and small is not None and regular is not None
    assert regular.rcond >= small.rcond and small.size <= regular.size
    for one in cusps.witnesses:
        assert one.path.closed and one.apart > 0.02 and one.margin > 0
        assert one.path.gap < 1e-12
        assert np.abs(strategy.task.pose(one.first) - strategy.task.pose(one.second)).max() < 1e-9
        assert np.abs(strategy.g(one.first) - strategy.g(one.second)).max() < 1e-9
        model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
        end, signs = continued(model, model.getFrameId(robot.tip), strategy, one, steps)
        assert np.abs(end - one.second).max() < 1e-7
        assert len(signs) == 1


def continued(
    model: Any, frame: int, strategy: HolonomicStrategy, one: hk.analysis.curvature.CuspWitness, steps: int
) -> tuple[np.ndarray, set[float]]:
    """(the posture at the end of the path, the signs of det [J; J_g] on it) by Pinocchio and small steps."""
    data, q, signs = model.createData(), one.first.copy(), set()
    level, samples = strategy.g(one.first), one.path.at(np.linspace(0, one.path.duration, steps + 1))
    begun = strategy.task.pose(one.first)[:3, :3]
    rotations = samples.rotation @ (samples.rotation[0].T @ begun)
    for p, R in zip(samples.position, rotations, strict=True):
        for _ in range(3):
            pin.framesForwardKinematics(model, data, q)
            M = data.oMf[frame]
            J = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            E = np.vstack([J, slope(strategy.g, q)])
            error = np.concatenate([p - M.translation, pin.log3(R @ M.rotation.T)])
            gap = np.atleast_1d(strategy.constraint.nearest(level - strategy.g(q)))
            q = q + np.linalg.solve(E, np.concatenate([error, gap]))
            signs.add(float(np.sign(np.linalg.det(E))))
    return q, signs


def slope(g: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    h = 1e-6
    return np.array([(g(q + h * e) - g(q - h * e)) / (2 * h) for e in np.eye(len(q))]).T


@sampled(1, "name", ["lock 3", "q1 - q3"])
def test_a_controller_led_round_a_cusp_comes_to_rest_at_the_other_posture(name: str) -> None:
    """At 0.01 m/s, within the joints' speeds and limits. Its error of tracking, 1e-5 at the end, fades to round-off."""
    cusps = found(name)
    strategy, task = cusps.strategy, cusps.strategy.task
    for one in cusps.witnesses:
        path = one.path.at_speed(0.01)
        dt = path.duration / 5_000
        law = hk.controller(strategy, dt=dt, q0=one.first)
        walk = hk.simulate(law, task, path, one.first, dt=dt)
        q, pose = walk.q[-1], task.pose(one.first)
        assert (np.abs(np.diff(walk.q, axis=0)).max(axis=0) <= task.robot.max_velocity * dt * (1 + 1e-9)).all()
        assert np.abs(q - one.second).max() < 1e-5 and np.abs(walk.q[0] - one.first).max() == 0.0
        for _ in range(300):  # the tool is held where the path ends, and began
            q = q + dt * law.step(q, pose, np.zeros(6))
        assert np.abs(q - one.second).max() < 1e-9 and np.abs(q - one.first).max() > 0.9


@sampled(1, ("name", "joint", "q0"), [("panda", 6, PANDA), ("iiwa14", 2, IIWA)])
def test_crossing_singular_sheets_are_no_cusps(name: str, joint: int, q0: np.ndarray) -> None:
    """A spherical wrist or shoulder splits det [J; J_g] in factors: many starts end where both are zero. So there is no
    cusp, which is proven and needs no search; one that is made all the same finds none."""
    strategy = law(name, hk.lock(joint))
    cusps = hk.cusps(strategy, q0, starts=200)
    assert len(cusps) == 0 and not cusps.cuspidal and cusps.witness is None and cusps.starts == 0
    assert cusps.sentence.startswith("no cusp: proven on the whole arm") and "search" not in cusps.sentence
    found, double, _ = seek_cusps(strategy, leaf_value(strategy, q0), spread(strategy.task.robot, 200))
    assert not len(found.q) and double > 50


def test_of_an_arm_that_is_nearly_of_a_class_none_is_proven_and_the_search_says_how_near() -> None:
    panda = hk.load("panda")
    placement = panda.joints[1].placement.copy()
    placement[0, 3] += 8e-6  # axis 2 no longer meets axes 1 and 3
    slipped = replace(panda, joints=(panda.joints[0], replace(panda.joints[1], placement=placement), *panda.joints[2:]))
    said = hk.cusps(hk.holonomic(hk.pose(slipped), hk.lock(6)), PANDA, starts=8).sentence
    assert "a search; on the whole arm it is proven of an exact model" in said and "8.0e-06 m" in said


def test_wengers_arm_is_cuspidal_and_one_whose_first_axes_meet_is_not() -> None:
    """[Wen07]: four postures at rho = 2.5, z = 0.6, two of each sign of det J, joined two by two."""
    strategy, pose = three_joints(1.0), np.eye(4)
    pose[:3, 3] = 2.5, 0.0, 0.6
    cusps = hk.cusps(strategy, [0.1, 0.3, 0.6], starts=80)
    assert cusps.cuspidal
    postures = hk.motion.ik.all_postures(cusps.strategy, pose)
    signs = [np.sign(np.linalg.det(strategy.task.jacobian(q))) for q in postures.q]
    assert sorted(signs) == [-1, -1, 1, 1]
    assert not hk.cusps(three_joints(0.0), [0.1, 0.3, 0.6], starts=80).cuspidal


def test_a_planar_arm_with_two_joints_tied_has_none() -> None:
    strategy = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([0, 1, -1]))
    assert len(hk.cusps(strategy, [0.1, 0.5, 0.4], starts=200)) == 0


def test_at_a_cusp_three_postures_of_one_pose_come_together() -> None:
    """The tool pose along the lost direction v changes as s^3: not with s, and not with s^2."""
    cusps = found("lock 3")
    strategy = cusps.strategy
    extended, slopes = cusp_functions(strategy)
    for q in cusps.q[:20]:
        E = extended(q)[0]
        U, S, Vt = np.linalg.svd(E)
        kappa = slopes(q, U[:, -1], Vt[-1])[2]
        assert S[-1] < 1e-8 and S[-2] > 1e-4
        assert abs(kappa) < 1e-7
        h = 1e-3  # the same second derivative by differences of E itself
        change = U[:, -1] @ (extended(q + h * Vt[-1])[0] - extended(q - h * Vt[-1])[0]) @ Vt[-1] / (2 * h)
        assert abs(change) < 1e-5


def test_what_cannot_be_searched_is_refused() -> None:
    panda = hk.pose(hk.load("panda"))
    fails(ArgumentError, "leaves", lambda: hk.cusps(hk.moore_penrose(panda), PANDA))
    cusps = found("lock 3")
    fails(SingularityError, "", lambda: hk.cusps(cusps.strategy, cusps.q[0]))
    fails(ArgumentError, "starts", lambda: hk.cusps(hk.holonomic(panda, hk.lock(2)), PANDA, starts=0))


def test_ctrl_c_keeps_the_cusps_that_were_found(monkeypatch: pytest.MonkeyPatch) -> None:
    seek, calls = cuspidal_leaf.seek_cusps, []

    def twice(*args: Any) -> Any:
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return seek(*args)

    monkeypatch.setattr(cuspidal_leaf, "seek_cusps", twice)
    monkeypatch.setattr(cuspidal_leaf, "first_witness", lambda *_: None)  # whose loops take longer
    cusps = hk.cusps(law("panda", hk.lock(2)), PANDA, starts=400)
    assert cusps.stopped and cusps.starts == cuspidal_leaf.CHUNK and len(cusps)
    assert "Ctrl-C" in cusps.sentence


def test_after_a_step_of_degree_four_nothing_is_said_to_be_proven() -> None:
    panda, start = hk.load("panda"), [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    proven = hk.cusps(hk.holonomic(hk.pose(panda), hk.lock(6)), start)
    assert "proven on the whole arm" in proven.sentence and not len(proven)
    searched = hk.cusps(hk.holonomic(hk.pose(panda), hk.lock(4)), start, starts=8)
    assert "whole arm" not in searched.sentence


def test_the_page_of_the_catalogue_says_what_the_rows_say() -> None:
    """Rows as the benchmark makes them: a loop for one lock, cusps for another, else none."""
    rows = []
    for one in questions():
        if one.arm in ("panda", "ur5e"):
            rows.append({"arm": one.arm, "law": one.law, "joint": one.joint, "cusps": 0})
            rows[-1] |= {"cusps": 5, "length": 0.031, "apart": 0.5} if (one.law, one.joint) == ("lock", 2) else {}
            rows[-1] |= {"cusps": 7} if one.law == "arm angle" else {}
    assert len(rows) == 9
    page = " ".join("\n".join(text(rows, 1000)).split())
    row = "|Panda|none|none|**3.1 cm**, 0.50|proven none|none|proven none|proven none|7 cusps|"
    assert row in page and "UR5e (proven none)." in page
    assert "Of 8 rules 1 have such a loop; for 6 no cusp was found. The shortest loop is 3.1 cm" in page


def test_where_no_two_postures_part_there_is_no_motion() -> None:
    """Directions of length zero: both sides come to one posture. Levels that no posture has: none is found at all."""
    strategy = law("panda", hk.lock(2))
    still = CuspPoints(PANDA[None], np.zeros((1, 7)), np.zeros((1, 7)))
    for level in (np.array([0.2]), np.array([np.nan])):
        motions, measures = candidates(strategy, level, still, True)
        assert len(motions.first) == 0 and measures.shape == (0, 3)


@pytest.mark.campaign
def test_two_postures_far_apart_are_joined_by_a_closed_tool_path() -> None:
    """A posture of a Panda with q1 - q3 held, whose pose has another one 2.705 rad away (theory 7.3). Not every pair
    is joined: across the singular postures there is no path."""
    strategy = law("panda", LAWS["q1 - q3"])
    first = np.array([2.778185, 1.133355, 2.251297, -1.304203, 1.262484, 1.838727, 2.005767])
    pose, level = strategy.task.pose(first), strategy.constraint_value(first)
    found = hk.motion.ik.all_postures(strategy, pose, level, limits=True, near=first).q
    apart = np.abs(found - first).max(axis=1)
    (second,) = found[np.abs(apart - 2.705) < 1e-3]
    one = witness_between(strategy, first, second)
    assert one is not None and one.path.closed and one.margin > 0 and one.rcond > 1e-3
    walk = hk.follow(strategy, one.path, first, samples=2000)
    assert np.abs(walk.q[-1] - second).max() < 1e-9
    other = found[(apart > 0.1) & (np.abs(apart - 2.705) > 1e-3)]
    assert len(other) and witness_between(strategy, first, other[0], via=60) is None
    fails(ArgumentError, "another posture of the same tool pose", lambda: witness_between(strategy, first, first))
    fails(ArgumentError, "same leaf", lambda: witness_between(strategy, first, PANDA))


# --- Every cusp is one by differences of positions alone; orthogonal arms have as many families as algebra counts.


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
    [*(CASES[k] for k in (0, 4, 7)), (ARMS[8], 1), *(campaign(("a", "b"), case) for case in CASES),
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


@pytest.mark.parametrize(NAMES, [c if c[0] < 1 else campaign(NAMES, c) for c in product(range(60), (1, 2, 3))])
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
    fails(ArgumentError, "whole turns left out", lambda: witness_between(law, q, q + [2 * np.pi, 0, 0]))
    found = hk.cusps(law, q, starts=1)
    turn = CuspPoints(q[None], np.zeros((1, 3)), np.array([[np.pi / 0.8, 0.0, 0.0]]))
    assert not len(candidates(found.strategy, found.level, turn, False)[0].first)


# --- A closed path on a regular leaf that ends elsewhere, by a cusp, a hole or a turn; and leaves with many postures.


@pytest.mark.campaign
def test_the_cusp_round_which_a_panda_went_is_named() -> None:
    """The loop is about a cusp by construction; the one that is named lies within its size of it."""
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    found = hk.cusps(strategy, PANDA, starts=60).witness
    assert found is not None
    said = why_elsewhere(strategy, hk.follow(strategy, found.path, found.first, samples=300))
    away, *at = (float(x) for x in re.search(r"lies (\S+) m .* \[(.*)\]", said).expand(r"\1, \2").split(", "))
    tool = strategy.task.pose(found.first)[:3, 3]
    assert away < found.size + 0.02 and np.linalg.norm(at - tool) < found.length + 0.02
    assert f"is {found.apart:.3g} rad" in said or f"is {-found.apart:.3g} rad" in said


def test_nothing_is_said_where_the_joints_come_back_or_the_path_was_not_gone() -> None:
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    tool = strategy.task.pose(PANDA)[:3, 3]
    assert why_elsewhere(strategy, hk.follow(strategy, hk.circle(tool, tool - [0.05, 0, 0]), PANDA, samples=100)) == ""


def test_the_leaf_of_a_held_joint_has_many_postures_of_one_tool_pose_and_small_loops_return_to_each() -> None:
    """A Panda, joint 3 held: ten without the joint limits. Pinocchio sees the tool at one pose."""
    q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    G = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    T = G.task.robot.pose(q0)
    Q = hk.motion.ik.all_postures(G, T, G.constraint_value(q0), limits=False).q
    assert len(Q) >= 10 and np.abs(Q[:, 2] - q0[2]).max() < 1e-9
    gap = np.abs((Q[:, None] - Q + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    assert (gap + 9 * np.eye(len(Q)) > 0.1).all()
    assert np.abs(poses_by_pinocchio(G.task.robot, Q) - T).max() < 1e-9
    loop = hk.circle(T[:3, 3], T[:3, 3] - [0.001, 0, 0])
    assert max(np.abs(hk.drift(G, loop, q, limits=False).since_start[0]).max() for q in Q) < 1e-9


def poses_by_pinocchio(robot: hk.Robot, Q: np.ndarray) -> np.ndarray:
    """Tool poses (k, 4, 4) of postures (k, n)."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame, poses = model.createData(), model.getFrameId(robot.tip), []
    for q in Q:
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[frame].homogeneous.copy())
    return np.array(poses)


def test_a_loop_round_a_hole_ends_elsewhere_though_no_posture_is_singular() -> None:
    """PPR, k q3 - s atan2(y, x) held, (x, y) the tool: |det [J; J_g]| = k everywhere, so there is no cusp. A round of
    the origin turns joint 3 by 2 pi s / k, a loop beside it by nothing. The verdict promises small loops alone.
    """
    rng, ppr = np.random.default_rng(9), hk.load("ppr")
    for k, s in [(2, 1), *rng.integers(1, 6, (2, 2))]:
        q0 = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-np.pi, np.pi)])
        g = hk.custom(lambda q, k=int(k), s=int(s): k * q[2] - s * ca.atan2(q[1] + ca.sin(q[2]), q[0] + ca.cos(q[2])),
                      angular=True)  # fmt: skip
        G = hk.holonomic(hk.position(ppr), g)
        tool = ppr.pose(q0)[:3, 3]
        walk = hk.follow(G, hk.circle(tool, [0, 0, 0]), q0, limits=False)
        E = np.concatenate([G.task.jacobian(walk.q), G.rows(walk.q)], axis=1)
        assert np.abs(np.linalg.det(E)) == pytest.approx(k)
        assert walk.drift()[0][2] == pytest.approx(2 * np.pi * s / k, abs=1e-8)
        said = why_elsewhere(G, walk)
        assert "cannot be shrunk to a point" in said and ("no cusp was found" in said) == (s % k != 0)
        beside = hk.circle(tool, tool + 0.4 * tool / np.linalg.norm(tool))
        assert np.abs(hk.drift(G, beside, q0, limits=False).since_start[0]).max() < 1e-8
        assert not len(hk.cusps(G, q0, starts=20, limits=False))
        assert "small closed paths" in hk.involutivity(G, hk.around(q0, 0.01)).sentence


def test_a_whole_turn_of_the_tool_is_a_loop_that_turns_the_last_joint() -> None:
    """The tool of a Panda turns once about the axis of joint 7, which alone moves: no hole, and no cusp."""
    G = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    T, c, s = G.task.robot.pose(PANDA), np.cos, np.sin
    turn = [[[c(a), -s(a), 0, 0], [s(a), c(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] for a in np.arange(4) * np.pi / 2]
    walk = hk.follow(G, hk.polyline(T @ np.array(turn), closed=True), PANDA, limits=False)
    assert walk.drift()[0] == pytest.approx([0, 0, 0, 0, 0, 0, 2 * np.pi], abs=1e-8)
    assert "whole turns further" in why_elsewhere(G, walk)


@pytest.mark.campaign
@pytest.mark.parametrize(("spin", "proven"), [(np.pi, False), (2.8, True)])
def test_a_box_of_poses_with_a_whole_turn_is_not_proven_and_one_with_almost_a_turn_is(
    spin: float, proven: bool
) -> None:
    G = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    T = G.task.robot.pose(PANDA)
    box = hk.workspace(box=(T[:3, 3], [1e-5] * 3), rotation=T[:3, :3], spin=spin)
    assert hk.certify(G, box, PANDA, limits=False, budget=400).whole is proven


def test_a_job_says_why_a_loop_round_the_base_does_not_bring_the_joints_back(tmp_path: Path) -> None:
    """A locked joint, two links: joint 1 has turned once. The pseudo-inverse has no leaf, and gets no such sentence."""
    file = tmp_path / "round.toml"
    file.write_text("""
title = "Round the base"
[robot]
name = "planar-3r"
lower = [-9, -9, -9]
upper = [9, 9, 9]
[task]
kind = "position"
[start]
q = [0.3, 0.9, 0.7]
[path]
kind = "circle"
center = [0.0, 0.0]
relative = false
samples = 200
cycles = 1
[strategies.lock]
kind = "lock"
joints = ["q2"]
[strategies.plain]
kind = "moore-penrose"
""")
    lock, plain = run_job(*open_job(str(file))).strategies
    assert "whole turns further" in lock.trouble and "6.28 rad" in lock.trouble and plain.trouble == ""
