"""Maps of whole arms without closed forms: rules for a joint, fitted to where it may be on branches over sampled poses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.types import Array, Indices, Matrix, Vector
from ...motion.ik.arm_map import monomials
from ...motion.ik.leaf import leaf_step
from ...motion.self_motions.self_motions import SelfMotions, self_motions_at
from ...motion.ik.stations import Hand, StationMap, strategy_of
from ...robot import with_limits
from ...strategies.tasks import pose
from ...strategies.tasks.task import Task
from ..coverage.starts import Candidate
from .level_ranges import Branch, branches_by_curves, widest
from .sheet import nearby, turn_length

SAMPLES, TRIED_ON, NEIGHBOURS = 1_200, 200, 6
"""Poses of postures, evenly drawn within the limits; those by which the joint is chosen; neighbours of each."""

LEAST = 0.01
"""Share of the poses below which a branch has no sheet."""

DEGREE = 2
"""Of a rule's monomials, 28."""

SHEETS, GAIN = 16, 0.002
"""The most of a map, and the share of the poses that each must add."""

TRIED, SERVED = 3, 0.02
"""Branches to which a rule is fitted for the next sheet: those with most to gain; weight of a pose served before."""

ROUNDS, FIRST, CLOSER, INSIDE = 7, 1.0, 0.6, 0.9
"""Rounds of a fit, how far off [rad] a level stops to count at first, how that shrinks, and the share of an interval in
which it is to lie."""


def make_station_map(
    task: Task, samples: int = SAMPLES, progress: Callable[[str], None] = lambda _text: None
) -> StationMap:
    """The map of an arm, made anew: the same of the same joints and limits."""
    robot, rng = task.robot, np.random.default_rng(0)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    free = np.arange(robot.n) == 0
    # Nothing that is fitted depends on the first joint: it is taken to turn freely, and the hand to one side.
    arm = with_limits(robot, lower=np.where(free, -np.inf, robot.lower), upper=np.where(free, np.inf, robot.upper))
    whole, hand = pose(arm, tip=task.tip), Hand(task)
    q = np.where(free, 0.0, rng.uniform(low, high, (samples, robot.n)))
    q[:, 0] = _aside(hand, robot.pose(q, task.tip))
    T = robot.pose(q, task.tip)
    progress("self-motions")
    motions = self_motions_at(whole, np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3]))
    progress("the joint that follows")
    few = _first(motions, TRIED_ON)
    room = [np.median(widest(strategy_of(whole, k), few)) for k in range(1, robot.n)]
    joint = 1 + int(np.argmax(room))
    strategy = strategy_of(whole, joint)
    progress(f"branches of {robot.joint_names[joint]}")
    near = nearby(T, turn_length(task), NEIGHBOURS)
    branches = branches_by_curves(Candidate("", {}, whole, strategy), T, near, None, motions, LEAST)
    f = np.array(monomials(list(hand.seen(hand.arrows(T)).T), DEGREE)).T
    # Sheet after sheet, each of which serves the most of what those before do not.
    left, rules, stations = np.ones(samples, dtype=bool), [], []
    while len(rules) < SHEETS:
        progress(f"{len(rules)} sheets serve {1 - left.mean():.1%}")
        weights = np.where(left, 1.0, SERVED)
        best, most = None, 0.0
        for i in np.argsort([-weights[b.pose].sum() for b in branches], kind="stable")[:TRIED].tolist():
            rule = _fitted(f, branches[i], weights)
            postures = _stations(f, branches[i], rule)
            gain = weights @ np.isfinite(postures).all(axis=1)
            if gain > most:
                best, most = (rule, postures), gain
        if best is None or (left & np.isfinite(best[1]).all(axis=1)).sum() < GAIN * samples:
            break
        rules.append(best[0])
        stations.append(best[1])
        left &= ~np.isfinite(best[1]).all(axis=1)
    every = np.array(stations)
    some = np.isfinite(every).all(axis=2).any(axis=0)
    sides = []
    for postures in every:
        i = np.flatnonzero(np.isfinite(postures).all(axis=1))[0]
        sides.append(float(leaf_step(strategy)(postures[i], T[i, :3, 3], T[i, :3, :3], postures[i, joint : joint + 1])[3]))
    share = float(1 - left.mean())
    return StationMap(task, joint, DEGREE, np.array(rules), np.array(sides), every[:, some], share)


def _aside(hand: Hand, T: Array) -> Vector:
    """How far (k,) the first joint has to turn from 0 for the hand to be on one side."""
    place = hand.arrows(T)[:, 0]
    across = np.linalg.svd(hand.axis[None])[2][1:]
    return -np.arctan2(place @ np.cross(hand.axis, across[0]), place @ across[0])


def _first(motions: SelfMotions, count: int) -> SelfMotions:
    """Those of the first poses."""
    rows = motions.pose < count
    curves = motions.curve[rows].max(initial=-1) + 1
    p, R = motions.p[:count], motions.R[:count]
    return SelfMotions(
        motions.task, p, R, motions.q[rows], motions.pose[rows], motions.curve[rows], motions.closed[:curves]
    )


def _fitted(f: Matrix, branch: Branch, weights: Vector) -> Vector:
    """The rule (m,) whose level lies in the branch's intervals at most of the poses' weight.

        min   sum  w  z^2 / (z^2 + d^2),     z: how far the level is outside the interval

    with a d that shrinks from round to round: by L-BFGS, from the best constant. f: of all poses (k, m).
    """
    from scipy.optimize import minimize

    f, w, scale = f[branch.pose], weights[branch.pose] / len(branch.pose), np.abs(f).max(axis=0)
    middle, half = (branch.low + branch.high) / 2, (branch.high - branch.low) / 2
    levels = np.linspace(branch.low.min(), branch.high.max(), 64)
    rule = np.zeros(f.shape[1])
    rule[0] = scale[0] * levels[np.argmax([w @ (np.abs(c - middle) <= half) for c in levels])]
    f = f / scale
    for round_ in range(ROUNDS):
        d = FIRST * CLOSER**round_

        def loss(x: Vector) -> tuple[float, Vector]:
            off = f @ x - middle
            z = np.sign(off) * np.maximum(np.abs(off) - INSIDE * half, 0)
            bound = z * z + d * d
            return float((w * z * z / bound).sum() + 1e-7 * (x @ x)), f.T @ (w * 2 * z * d * d / bound**2) + 2e-7 * x

        options = {"maxiter": 60, "ftol": 1e-6, "gtol": 1e-7}
        rule = minimize(loss, rule, jac=True, method="L-BFGS-B", options=options).x
    return np.array([float(f"{x:.6g}") for x in rule / scale])


def _stations(f: Matrix, branch: Branch, rule: Vector) -> Matrix:
    """The postures (k, n) of a sheet at the poses; NaN where it has none."""
    poses: Indices = np.arange(len(f))
    return branch.postures(poses, f @ rule)
