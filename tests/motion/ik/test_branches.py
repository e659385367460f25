"""A walk on a leaf keeps to its branch: against closed forms, and along folds that are narrower than a sample."""

from __future__ import annotations

import re
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.base.errors import BranchError, HolokinError, PathError
from holokin.motion.ik.branch import lay_tube
from holokin.strategies import Strategy
from holokin.symbolic.native import enabled

ENGINES = [pytest.param(500, id="machine"), pytest.param(6000, id="native")]
"""Samples of a walk: from 5,000 on it is native code."""

R3_START = np.array([0.3, 0.8, 0.5])


def locked() -> Strategy:
    return hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))


def two_link_answer(start: np.ndarray, target: np.ndarray) -> np.ndarray | None:
    """q of planar-3r, unit links, q3 locked, along the straight line from the start; None where it leaves the annulus.

    Joint 3 locked, the last two links are one of length b = |1 + exp(i q3)|; the elbow keeps its side while the
    distance from the base stays between |1 - b| and 1 + b.
    """
    q1, q2, q3 = start
    last = 1 + np.exp(1j * q3)
    b, skew = abs(last), np.angle(last)
    wrist = lambda q: np.exp(1j * q[0]) * (1 + b * np.exp(1j * (q[1] + skew)))  # noqa: E731
    here, there = wrist(start), target[0] + 1j * target[1]
    along = np.clip(-((there - here).conjugate() * here).real / abs(there - here) ** 2, 0, 1)
    nearest, farthest = abs(here + along * (there - here)), max(abs(here), abs(there))
    if nearest <= abs(1 - b) or farthest >= 1 + b:
        return None
    side = np.sign(np.sin(q2 + skew))
    cosine = (abs(there) ** 2 - 1 - b * b) / (2 * b)
    bent = side * np.arccos(cosine)
    turn = np.angle(there / here)  # of the tool about the base: a straight line turns by less than half a round
    heading = lambda bend: np.angle(1 + b * np.exp(1j * bend))  # noqa: E731
    before = q2 + skew - 2 * np.pi * np.round((q2 + skew) / (2 * np.pi))
    return np.array([q1 + turn - heading(bent) + heading(before), q2 + bent - before, q3])


@pytest.mark.campaign
def test_inverse_settle_and_few_samples_answer_what_the_closed_form_does() -> None:
    strategy = locked()
    task = strategy.task
    ik, rng = hk.ik(strategy, R3_START), np.random.default_rng(3)
    start = task.robot.pose(R3_START)[:3, 3]
    refused = reached = 0
    for target in rng.uniform(-2.6, 2.6, (150, 2)):
        wanted = two_link_answer(R3_START, target)
        ways: list[Callable[[], np.ndarray]] = [lambda target=target: ik(target)]
        if wanted is not None or refused < 10:
            line = hk.line(start, [*target, 0.0])
            ways.append(lambda line=line: hk.follow(strategy, line, R3_START, samples=2, limits=False).q[-1])
        for way in ways:
            try:
                q = way()
            except (BranchError, PathError):
                refused += 1
                assert wanted is None
                continue
            assert wanted is not None
            reached += 1
            assert q == pytest.approx(wanted, abs=1e-9)
    assert refused > 30
    assert reached > 60
    with pytest.raises(BranchError):
        ik([-2.2058, -0.617])  # the line passes 0.873 m from the base, the hole's radius is 0.938 m
    inside = hk.motion.ik.move_to_leaf(strategy, R3_START, 0.9)
    assert two_link_answer(inside, start[:2]) == pytest.approx(inside, abs=1e-12)


@pytest.mark.campaign
def test_moving_to_a_level_that_the_self_motion_does_not_reach_is_refused() -> None:
    """planar-3r holding its tool: joint 2 can be as small as the tool's distance allows, which is known."""
    strategy = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(1))
    distance = float(np.linalg.norm(strategy.task(R3_START)))
    farthest = brentq(lambda q2: abs(1 + np.exp(1j * q2)) + 1 - distance, 0.0, np.pi)  # joint 3 is straight there
    for level in np.linspace(R3_START[1], 2.6, 80):
        if abs(level - farthest) < 1e-6:
            continue
        if level < farthest:
            assert hk.motion.ik.move_to_leaf(strategy, R3_START, level)[1] == pytest.approx(level, abs=1e-12)
        else:
            with pytest.raises(HolokinError):
                hk.motion.ik.move_to_leaf(strategy, R3_START, level)


def ppr_leaf(h: Callable[[ca.SX], ca.SX]) -> Strategy:
    """The PPR arm with g = h(q3) + x: on a leaf h(q3) = h(q3(0)) + x(0) - x, so its folds are the extremes of h."""
    return hk.holonomic(hk.position(hk.load("ppr")), hk.custom(lambda q: h(q[2]) + q[0] + ca.cos(q[2])))


def walk(strategy: Strategy, q3: float, dx: float, samples: int) -> hk.Trajectory:
    q0 = np.array([0.3, 0.2, q3])
    start = strategy.task.robot.pose(q0)[:3, 3]
    return hk.follow(strategy, hk.line(start, start + [dx, 0, 0]), q0, samples=samples)


FOLDS = {
    "cubic": (lambda w: lambda s: s**3 - 3 * w * w * s, lambda w: w),
    "gauss": (lambda w: lambda s: s - 1.5 * w * ca.exp(-((s / w) ** 2)), None),
    "tanh": (lambda w: lambda s: s - 2 * w * ca.tanh(s / w), lambda w: w * np.arctanh(np.sqrt(0.5))),
    "sine": (lambda w: lambda s: s - 1.5 * w * ca.sin(s / w), lambda w: w * (2 * np.pi - np.arccos(1 / 1.5))),
}


def last_fold(kind: str, w: float, above: float) -> float:
    """The largest q3 below `above` at which h' = 0."""
    if kind == "gauss":  # s + ... : h' = 1 + 3 (s/w) exp(-(s/w)^2), zero for s < 0
        return w * float(brentq(lambda u: 1 + 3 * u * np.exp(-u * u), -0.70710678, 0.0))
    if kind == "sine":  # cos(s/w) = 1/1.5, the largest below
        turn = np.arccos(1 / 1.5)
        k = np.floor((above / w + turn) / (2 * np.pi))
        lower, upper = 2 * np.pi * k - turn, 2 * np.pi * k + turn
        return w * (upper if upper * w < above else lower)
    return float(FOLDS[kind][1](w))


@pytest.mark.parametrize("samples", ENGINES)
@pytest.mark.parametrize("kind", list(FOLDS))
@sampled(1, "width", [0.0316, 1e-2, 1e-3, 1e-4])
def test_a_fold_however_narrow_ends_the_walk(kind: str, width: float, samples: int) -> None:
    """From q3 well above the folds towards them: the leaf ends where h' = 0, and the joint is there."""
    if samples > 5000 and not enabled():
        pytest.skip("no compiler")
    begin = 0.2
    if kind == "sine":  # h has folds all along: begin within one wave, on the side that rises
        begin = width * (2 * np.pi * 3 + np.pi)
    strategy = ppr_leaf(FOLDS[kind][0](width))
    fold = last_fold(kind, width, begin)
    with pytest.raises(BranchError) as caught:
        walk(strategy, begin, 0.5, samples)
    message = str(caught.value)
    assert "leads no farther than" in message
    reached = float(re.search(r", q3 ([^:]+):", message).group(1))
    assert reached == pytest.approx(fold, abs=1e-5 * max(width, 1e-2) + 2e-6)


@pytest.mark.parametrize("kind", ["gauss", "tanh"])
def test_a_bend_that_is_no_fold_is_passed(kind: str) -> None:
    """The same shapes, too shallow to fold: the walk goes through and ends where h says."""
    for w in (1e-2, 1e-3, 1e-4):
        shape = {
            "gauss": lambda s, w=w: s - 0.6 * w * ca.exp(-((s / w) ** 2)),
            "tanh": lambda s, w=w: s - 0.6 * w * ca.tanh(s / w),
        }[kind]
        end = walk(ppr_leaf(shape), 0.2, 0.4, 500).q[-1, 2]
        h = ca.Function("h", [s := ca.SX.sym("s")], [shape(s)])
        assert end == pytest.approx(
            brentq(lambda u, h=h: float(h(u)) - float(h(0.2)) + 0.4, -1, 1, xtol=1e-15), abs=1e-9
        )


@pytest.mark.parametrize("samples", ENGINES)
def test_a_start_next_to_a_fold_may_go_the_way_that_is_open(samples: int) -> None:
    strategy = ppr_leaf(lambda s: s**3 - 3 * 0.0316**2 * s)
    for off in (1e-3, 1e-5, 1e-6):
        assert walk(strategy, 0.0316 + off, -0.1, samples).status is hk.motion.Status.COMPLETE
        with pytest.raises(BranchError):
            walk(strategy, 0.0316 + off, 0.1, samples)


@pytest.mark.parametrize("samples", [50, campaign("samples", 500), campaign("samples", 6000)])
def test_a_formula_that_switches_is_no_fold(samples: int) -> None:
    """g = q3 + x/2 + f(q3 - 0.45), regular everywhere; enclosures of f have no bound where it switches."""
    if samples > 5000 and not enabled():
        pytest.skip("no compiler")
    switches = {
        "cube": lambda s: 0.3 * ca.fmax(s, 0) ** 3,
        "flat": lambda s: 0.3 * ca.if_else(s > 0, ca.exp(-1 / s), 0),
        "power": lambda s: 0.3 * ca.fmax(s, 0) ** 2.5,
        "base": lambda s: 0.3 * 2**s,
    }
    for f in switches.values():
        law = lambda q, f=f: q[2] + 0.5 * (q[0] + ca.cos(q[2])) + f(q[2] - 0.45)  # noqa: E731
        strategy = hk.holonomic(hk.position(hk.load("ppr")), hk.custom(law))
        start = np.array([0.3, 0.2, 0.6])
        tool = strategy.task.robot.pose(start)[:3, 3]
        end = hk.follow(strategy, hk.line(tool, tool + [0.7, 0, 0]), start, samples=samples).q[-1, 2]
        h = ca.Function("h", [s := ca.SX.sym("s")], [s + f(s - 0.45)])
        wanted = float(brentq(lambda u, h=h: float(h(u)) - float(h(0.6)) + 0.35, 0.0, 1.0, xtol=1e-14))
        assert end == pytest.approx(wanted, abs=1e-9)


def test_a_loop_within_one_sample_is_gone_round() -> None:
    """A circle in one step ends where it begins, and its joints a turn further, or the leaf does not reach round."""
    strategy = locked()
    tool = strategy.task.robot.pose(R3_START)[:3, 3]
    round_base = hk.follow(strategy, hk.circle(tool, [0, 0, 0]), R3_START, samples=1, limits=False)
    assert round_base.q[-1] - R3_START == pytest.approx([2 * np.pi, 0, 0], abs=1e-9)
    with pytest.raises(PathError):
        hk.follow(strategy, hk.circle(tool, tool + [1, 0, 0]), R3_START, samples=1, limits=False)


def test_an_angle_is_settled_by_its_shorter_way() -> None:
    strategy = hk.holonomic(hk.position(hk.load("ppr")), hk.custom(lambda q: 8 * q[2], angular=True))
    for level in (8.0, 5.0, -6.0, 12.5):
        away = (level - 1.6 + np.pi) % (2 * np.pi) - np.pi
        assert hk.motion.ik.move_to_leaf(strategy, [0.3, 0.2, 0.2], level)[2] == pytest.approx(
            0.2 + away / 8, abs=1e-12
        )


@pytest.mark.campaign
def test_a_tube_holds_one_posture_of_each_pose(panda: hk.Robot) -> None:
    """What a tube claims: ||1 - Y A|| within it, at a thousand postures of it, and at its ends."""
    rng = np.random.default_rng(0)
    for constraint in (
        hk.lock(2),
        hk.arm_angle(),
        hk.strategies.constraints.height("panda_joint4"),
        hk.stationary(hk.strategies.constraints.centring_cost()),
    ):
        strategy = hk.holonomic(hk.pose(panda), constraint)
        for _ in range(4):
            q, half = PANDA_START + rng.uniform(-0.3, 0.3, 7), rng.normal(size=7)
            half *= 10 ** rng.uniform(-3.5, -1.5) / np.linalg.norm(half)
            tube = lay_tube(strategy, q, half)
            if not np.isfinite(tube.change):
                continue
            off = rng.normal(size=(1000, 7))
            off *= tube.radius * rng.uniform(size=(1000, 1)) / np.linalg.norm(off, axis=1, keepdims=True)
            share = rng.uniform(-1, 1, (1000, 1))
            share[:2], off[:2] = [[-1.0], [1.0]], 0.0
            Y = np.linalg.inv(np.vstack([strategy.task.jacobian(q), strategy.rows(q)]))
            worst = 0.0
            for p in q + share * half + off:
                A = np.vstack([strategy.task.jacobian(p), strategy.rows(p)])
                worst = max(worst, float(np.linalg.norm(np.eye(7) - Y @ A, 2)))
            assert 0 < worst <= tube.change


@pytest.mark.campaign
@sampled(2, "scale", [1e-11, 1e-5, 1.0, 1e11])
def test_the_scale_of_a_constraint_is_no_matter_of_its_leaves(panda: hk.Robot, scale: float) -> None:
    plain = hk.holonomic(hk.pose(panda), hk.linear([1.0, 0, -1, 0, 0, 0, 0]))
    scaled = hk.holonomic(hk.pose(panda), hk.linear(scale * np.array([1.0, 0, -1, 0, 0, 0, 0])))
    assert scaled(PANDA_START) == pytest.approx(plain(PANDA_START), rel=1e-12)
    assert scaled.gain(PANDA_START)[1] == pytest.approx(plain.gain(PANDA_START)[1], rel=1e-9)
    assert hk.involutivity(scaled, hk.around(PANDA_START, 0.2)).holonomic
    assert (
        hk.analysis.curvature.filtration(scaled, PANDA_START).integrability
        is hk.analysis.curvature.Integrability.HOLONOMIC
    )
    point = panda.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    ends = [hk.follow(s, loop, PANDA_START, samples=60).q for s in (plain, scaled)]
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)
