"""Where a strategy jumps: places at which an if_else, a floor, ... of its formula turns over, and what it does there.

Let s(q) = 0 be such a place, and G-, G+ the strategy on its two sides. A path of the tool that crosses it at one point
and comes back at another brings the joints back only if both sides take them along it alike:

    (G+ - G-) v = 0   for every v with  ds/dq G- v = 0,

as where g is continuous and only its slopes change. Else a loop across drifts in proportion to its length along s = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import SingularityError
from ..base.types import Array, Matrix, Result, Value, Vector, kept
from ..symbolic import SX, Formula, Function, jacobian, switches, switches_of, vertcat
from .strategy import HolonomicStrategy, Strategy

BESIDE = 1e-7
"""Distance [joint units] of the two sides that are compared: well over the round-off of a posture, and so small that
slopes change G by far less than `JUMP`."""

JUMP = 1e-4
"""Relative change of G from one side to the other that counts as a jump."""

ROUND_OFF = 1e-9
"""Jump of g, over 1 + its size, that is none; what its slopes make over the distance of the sides is taken off."""

NEAR = 0.02
"""How far [joint units] from a posture a jump may be that ends a walk there: about a step of one."""


@dataclass(frozen=True, eq=False)
class Jump(Result, Value):
    """A place q (n,) where the formula of a strategy turns over, by the operation `what`, and jumps.

    level: jump of g [its unit], of a constraint; 0 of another strategy. planes: how far the two sides disagree on where
    the joints go along the place, relative; 0 where they agree, so that joints return across it, too.
    """

    what: str
    q: Vector
    level: float
    planes: float

    def __str__(self) -> str:
        jumps = f"g jumps by {self.level:.3g}" if self.level else "the planes jump" if self.planes else "no jump"
        return f"{jumps} ({self.what}) at q = {np.array2string(self.q, precision=3)}"


@kept
def _switches(strategy: Strategy) -> tuple[tuple[str, ...], SX, SX]:
    """(words, gaps, states) of the switches of g, if there is one, else of the planes; none of a strategy with a loop,
    as `radial`, whose g is integrated from the planes of another strategy."""
    e = strategy.expressions
    if strategy.transport is not None or strategy.looped is not strategy:
        return (), SX(0, 1), SX(0, 1)
    if isinstance(strategy, HolonomicStrategy):
        c, k = strategy.constraint, e.kinematics
        whole = Formula(strategy.constraint_expression, e.q, e.q, c.angular)
        formulas = [whole] if c.formulas is None else c.formulas(strategy.task, k, e.q)
        switched = [switch for formula in formulas for switch in switches_of(formula)]
    else:
        switched = [switches(e.planes, e.q, reflected=True)]
    words = tuple(word for switch in switched for word in switch.words)
    return (
        words,
        vertcat(SX(0, 1), *(switch.gap for switch in switched)),
        vertcat(SX(0, 1), *(switch.state for switch in switched)),
    )


def may_jump(strategy: Strategy) -> tuple[str, ...]:
    """The operations of g, or of the planes of a strategy without one, that may jump; () for most strategies."""
    return tuple(dict.fromkeys(_switches(strategy)[0]))


@kept
def _state(strategy: Strategy) -> Function:
    return Function("switches", {"q": strategy.expressions.q}, {"state": _switches(strategy)[2]})


@kept
def _gap(strategy: Strategy) -> Function:
    q, gap = strategy.expressions.q, _switches(strategy)[1]
    return Function("switch_gaps", {"q": q}, {"gap": gap, "slope": jacobian(gap, q)})


def states(strategy: Strategy, Q: Matrix) -> Matrix:
    """The places of the k switches at postures (N, n), whole numbers (N, k); another one on the other side of each."""
    return _state(strategy).batch(Q).reshape(len(Q), -1)


def jumps_of(strategy: Strategy, Q: Matrix, low: Vector, high: Vector) -> tuple[Jump, ...]:
    """Jumps within a box, the largest of each operation: sought from postures (N, n) by Newton's method."""
    jumps: dict[str, Jump] = {}
    words = _switches(strategy)[0]
    gaps, slopes = _gaps_at(strategy, Q) if words else (Q, Q)
    for i, what in enumerate(words):
        for q, normal in _places(strategy, i, Q, gaps[:, i], slopes[:, i], low, high):
            jump = _jump(strategy, what, q - BESIDE * normal, q + BESIDE * normal, normal)
            largest = jumps.get(what)
            if jump and (largest is None or (jump.planes, jump.level) > (largest.planes, largest.level)):
                jumps[what] = jump
    return tuple(jumps.values())


def _gaps_at(strategy: Strategy, X: Matrix) -> tuple[Matrix, Array]:
    """(gaps (N, k), their slopes (N, k, n)) of all switches at postures (N, n)."""
    gap, slope = _gap(strategy).batch(X)
    return gap.reshape(len(X), -1), slope.reshape(len(X), -1, X.shape[1])


def _places(
    strategy: Strategy, i: int, Q: Matrix, gap: Vector, slope: Matrix, low: Vector, high: Vector
) -> list[tuple[Vector, Vector]]:
    """(q, unit normal) at places of a box where switch i turns over; gap (N,) and slope (N, n) are those at Q."""

    def gap_at(X: Matrix) -> tuple[Vector, Matrix]:
        gaps, slopes = _gaps_at(strategy, X)
        return gaps[:, i], slopes[:, i]

    with np.errstate(all="ignore"):
        # Begin at the eight postures that are nearest to the switch by its slope, no farther than the box is wide.
        distance = np.abs(gap) / np.linalg.norm(slope, axis=1)
        near = np.flatnonzero(distance <= np.linalg.norm(high - low))
        X = Q[near[np.argsort(distance[near], kind="stable")[:8]]]
        if not len(X):
            return []
        # At most 20 steps of Newton's method on gap(q) = 0 within the box, of those that still move.
        moving = np.arange(len(X))
        for _ in range(20):
            gap, slope = gap_at(X[moving])
            move = gap[:, None] * slope / np.sum(slope**2, axis=1)[:, None]
            posture = np.clip(X[moving] - np.where(np.isfinite(move), move, 0.0), low, high)
            motion = np.abs(posture - X[moving]).max(axis=1)
            X[moving] = posture
            moving = moving[motion > 1e-4 * BESIDE]
            if not len(moving):
                break
        gap, slope = gap_at(X)
        size = np.linalg.norm(slope, axis=1)
        X, slope = (part[np.abs(gap) <= 1e-3 * BESIDE * size] for part in (X, slope))
    if not len(X):
        return []
    # Keep at most eight places on whose two sides the state is another one.
    normals = slope / np.linalg.norm(slope, axis=1)[:, None]
    sides = states(strategy, np.vstack([X - BESIDE * normals, X + BESIDE * normals])).reshape(2, len(X), -1)[:, :, i]
    switched = np.flatnonzero(sides[0] != sides[1])
    some = np.linspace(0, max(len(switched) - 1, 0), min(8, len(switched))).astype(int)
    return [(X[k], normals[k]) for k in switched[some]]


def _jump(strategy: Strategy, what: str, a: Vector, b: Vector, normal: Vector) -> Jump | None:
    """The jump between two postures beside a place; None where there is none."""
    level = _level(strategy, a, b)
    try:
        G = strategy.batch(np.array([a, b]))
    except SingularityError:
        return Jump(what, (a + b) / 2, level, 0.0) if level else None
    along = normal @ G[0]
    away = float(along @ along)
    off = (G[1] - G[0]) @ (np.eye(len(along)) - np.outer(along, along) / away) if away > BESIDE else 0.0 * G[0]
    planes = float(np.linalg.norm(off) / np.linalg.norm(G))
    planes = planes if planes > JUMP else 0.0
    return Jump(what, (a + b) / 2, level, planes) if level or planes else None


def _level(strategy: Strategy, a: Vector, b: Vector) -> float:
    """The jump of g between two postures that are very near to each other."""
    if not isinstance(strategy, HolonomicStrategy):
        return 0.0
    c = strategy.constraint_value.batch(np.array([a, b])).reshape(2, strategy.constraint.rows)
    gap = np.abs(strategy.constraint.nearest(c[1] - c[0]))
    slopes = np.linalg.norm(strategy.rows(a), axis=1) + np.linalg.norm(strategy.rows(b), axis=1)
    counts = gap > 1.01 * slopes * np.linalg.norm(b - a) + ROUND_OFF * (1.0 + np.abs(c).max(axis=0))
    return float(np.max(np.where(counts, gap, 0.0), initial=0.0))


def jump_near(strategy: HolonomicStrategy, q: Vector) -> Jump | None:
    """A jump of g next to a posture (n,), within `NEAR` of each joint."""
    if not may_jump(strategy):
        return None
    jumps = [jump for jump in jumps_of(strategy, q[None], q - NEAR, q + NEAR) if jump.level]
    return max(jumps, key=lambda jump: jump.level, default=None)


def first_jump(strategy: HolonomicStrategy, Q: Matrix) -> tuple[int, Jump] | None:
    """(k, jump): the first one of g on the straight paths between postures (N, n), between rows k and k + 1."""
    if not may_jump(strategy) or len(Q) < 2:
        return None
    places = states(strategy, Q)
    for k in np.flatnonzero((places[1:] != places[:-1]).any(axis=1)):
        jump = _between(strategy, Q[k], Q[k + 1], places[k], places[k + 1])
        if jump is not None:
            return int(k), jump
    return None


def _between(strategy: HolonomicStrategy, a: Vector, b: Vector, state_a: Vector, state_b: Vector) -> Jump | None:
    """A jump of g on the straight path from a to b; every switch that turns over is halved to where it does."""
    words = _switches(strategy)[0]
    for i in np.flatnonzero(state_a != state_b):
        low, high = a, b
        for _ in range(40):  # to 1e-12 of the path
            middle = (low + high) / 2
            if states(strategy, middle[None])[0, i] == state_a[i]:
                low = middle
            else:
                high = middle
        size = float(np.linalg.norm(b - a))
        beside = (b - a) / size * min(BESIDE, size / 4) if size else 0.0 * a
        level = _level(strategy, low - beside, high + beside)
        if level:
            return Jump(words[i], (low + high) / 2, level, 0.0)
    return None
