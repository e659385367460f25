"""Roots of g = level along the self-motions of a tool pose: all postures of the pose on a leaf, one row redundant.

Between neighbouring postures of a curve g is taken as the cubic of its values and slopes there. Its four Bernstein
coefficients bound it: where they have one sign it has no root, where they change sign once it has one. Else the stretch
is cut in two by a posture of the curve, where the cubic has its extremum.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...strategies import HolonomicStrategy
from ...strategies.self_motion_curves import joint_gap
from ...symbolic import Function
from ...symbolic.linear import least_norm, null_space_expression
from ...symbolic.native import allowed
from ..self_motions.posture_search import EXACT, newton
from ..self_motions.self_motions import SelfMotions
from ..self_motions.stretches import cubic, extremum_of_cubic, root_of_cubic
from .leaf import leaf_step

LONGEST = 0.6
"""Joint motion [joint units] of a stretch that gets a posture between: a cubic says nothing of so much."""

STRAIGHT = 0.8
"""Cosine between a stretch and the curve at its ends, below which it gets a posture between."""

TURNED = 1.0
"""How far [rad] the rise of an angle may differ from the mean of its slopes: more, and it may be a turn more."""

FILL, FILLS = 0.3, 40
"""Joint motion to a posture between at most [joint units], and how many one after the other."""

WIDER = 0.25
"""Share of its own range by which the range of a cubic is widened before it is said to be away from a level."""

FINEST = 1e-3
"""Joint motion [joint units] of a stretch that is cut no more."""

CUTS = 24
"""Times that stretches are cut in two, one after the other."""

MEET, LEVEL = 1e-10, 1e-4
"""How near the level, over 1 + its size, an extremum of g is where two postures are said to meet, whose distance is the
square root of that; and the slope of g there, which is not quite the extremum."""

ROUND_OFF = 1e-7
"""rcond of [J; J_g] below which two roots are one to round-off, whose square root tells them apart."""

BESIDE = 0.25
"""Share of a stretch by which a root may be beside the one of the cubic."""

SAME = 1e-6
"""Joints [joint units] that differ less are one posture."""

NATIVE_FROM = 20_000_000
"""Operations of the virtual machine, a quarter of a second, from which native code is worth a compiler's second."""


@dataclass(frozen=True, eq=False)
class LevelRoots(Value):
    """Postures q (k, n) with g = level + shift (k,), see `roots_along`, each once; rcond (k,): of [J; J_g].

    Where g is at the level all along a part of a curve, one posture stands for it, and `family` (k,) is the length of
    that part [joint units]; else 0. singular: roots where [J; J_g] is singular, as where two meet; they are not among
    the postures. doubt: places where it stays open whether there is one. step: the longest stretch [joint units]
    between two looks at g.
    """

    q: Matrix
    rcond: Vector
    shift: Vector
    family: Vector
    singular: int
    doubt: int
    step: float


def roots_along(strategy: HolonomicStrategy, motions: SelfMotions, level: float, shifts: Vector) -> LevelRoots:
    """The postures on the curves of one pose with g = level + shift, for each of some shifts, one row redundant."""
    return _Search(strategy, motions, level, shifts).roots()


@kept
def _look(strategy: HolonomicStrategy) -> Function:
    """(q, p, R) -> (least motion to the pose, unit vector along the self-motion, g, its slope along it, margin)."""
    strategy = strategy.looped
    e, task = strategy.expressions, strategy.task
    p, R = task._target_symbols()
    along = null_space_expression(e.J)
    outputs = {
        "move": least_norm(e.J, task._error_expression(e.kinematics, p, R)).X,
        "along": along,
        "g": strategy.constraint_expression,
        "slope": e.planes @ along,
        "margin": strategy._margin_expression,
    }
    return Function("level_along", {"q": e.q, "p": p, "R": R}, outputs, None, strategy.transport)


class _Rows:
    """A strategy's functions at postures (k, n) and one pose: by native code once they were called often."""

    def __init__(self, strategy: HolonomicStrategy) -> None:
        self.strategy, self.operations = strategy, 0

    def __call__(self, function: Function, q: Matrix, *others: Array) -> tuple[Array, ...]:
        """The results (k, ...) of arguments (k, ...)."""
        self.operations += len(q) * function.program.instructions
        kernel = function._native() if self.operations > NATIVE_FROM and allowed() else None
        if kernel is None:
            return function.batch(q, *others)
        results = [np.empty((len(q), *shape)) for shape in function.output_shapes.values()]
        kernel([q, *others], results, 1)
        return tuple(results)

    @cached_property
    def look(self) -> Function:
        """As `_look`."""
        return _look(self.strategy)

    @cached_property
    def step(self) -> Function:
        """As `leaf_step`."""
        return leaf_step(self.strategy)


@kept
def _rows(strategy: HolonomicStrategy) -> _Rows:
    return _Rows(strategy)


def postures_near(
    strategy: HolonomicStrategy, starts: Matrix, p: Vector, R: Matrix, steps: int = 20, exact: float = EXACT
) -> Matrix:
    """The postures (k, n) at a tool pose p (3,), R (3, 3) to which Newton's method leads from some starts (s, n)."""
    rows = _rows(strategy)

    def correct(q: Matrix, k: Indices) -> tuple[Matrix, Flags]:
        target = np.broadcast_to(p, (len(q), *p.shape)), np.broadcast_to(R, (len(q), *R.shape))
        return rows(rows.look, q, *target)[0].reshape(q.shape), np.ones(len(q), dtype=bool)

    q, arrived = newton(correct, starts, steps=steps, longest=LONGEST, exact=exact)
    return q[arrived]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Stretches between points i and j (k,), with g - level - shift at both, a and b (k,).

    error (k,): about how far the cubic is from g between them.
    """

    i: Indices
    j: Indices
    a: Vector
    b: Vector
    shift: Vector
    error: Vector

    def __getitem__(self, which: Flags | Indices) -> _Pairs:
        return _Pairs(self.i[which], self.j[which], self.a[which], self.b[which], self.shift[which], self.error[which])

    def __add__(self, other: _Pairs) -> _Pairs:
        parts: Any = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return _Pairs(*map(np.concatenate, parts))


class _Search:
    """The points of the curves that were looked at, and what was found so far.

    v (N, n): unit vectors along the curves, the same way as their points follow each other. slope (N,): of g along v.
    sound (N,): where g has a value and a slope. The first `given` ones are those of the curves, one after another.
    """

    def __init__(self, strategy: HolonomicStrategy, motions: SelfMotions, level: float, shifts: Vector) -> None:
        self.strategy, self.level, self.shifts = strategy, level, shifts
        self.p, self.R, self.curve, self.q = motions.p[0], motions.R[0], motions.curve, motions.q
        self.given, self.angular, self.rows = len(motions.q), any(strategy.constraint.angular), _rows(strategy)
        _, self.v, self.g, self.slope, self.sound = self._at(motions.q)
        self.doubt, self.step, self.near = 0, 0.0, MEET * (1 + abs(level))
        n = motions.q.shape[1]
        self.meetings = [np.zeros((0, n))]
        self.found = [(np.zeros((0, n)), np.zeros(0), np.zeros(0), np.zeros(0))]

    def roots(self) -> LevelRoots:
        """All of them."""
        pairs = self._first_pairs()
        for _ in range(CUTS):
            if not len(pairs.i):
                break
            single, cut = self._sorted_out(pairs)
            missed = self._refined(pairs[single])
            pairs = self._cut(pairs[cut] + missed)
        self.doubt += len(pairs.i)
        # Each posture once, those of families first, and not two that meet.
        q, rcond, shift, family = (np.concatenate([part[k] for part in self.found[::-1]]) for k in range(4))
        gap = self._gaps(q, q)
        beside = ((gap < np.sqrt(MEET)) & ~np.eye(len(q), dtype=bool)).any(axis=1)
        meet = (rcond < ROUND_OFF) | ((rcond < np.sqrt(MEET)) & beside)
        each = ~np.tril(gap < SAME, -1).any(axis=1) & ~(meet & (family == 0))
        meetings = np.concatenate([*self.meetings, q[meet & (family == 0)]])
        singular = int(np.sum(~np.tril(self._gaps(meetings, meetings) < FINEST, -1).any(axis=1)))
        return LevelRoots(q[each], rcond[each], shift[each], family[each], singular, self.doubt, self.step)

    def _gaps(self, q: Matrix, others: Matrix) -> Matrix:
        """The largest difference of joints, whole turns aside, between postures (k, n) and others (m, n)."""
        return np.abs(joint_gap(self.strategy.task.robot, q[:, None], others)).max(axis=2)

    # --- Points of the curves.

    def _at(self, q: Matrix) -> tuple[Matrix, Matrix, Vector, Vector, Flags]:
        k, n = q.shape
        p, R = np.broadcast_to(self.p, (k, *self.p.shape)), np.broadcast_to(self.R, (k, *self.R.shape))
        move, v, g, slope, margin = self.rows(self.rows.look, q, p, R)
        g, slope = g.reshape(k), slope.reshape(k)
        with np.errstate(invalid="ignore"):
            sound = np.isfinite(g + slope) & (margin.reshape(k) > TOLERANCES.representation)
        return move.reshape(k, n), v.reshape(k, n), g, slope, sound

    def _added(self, q: Matrix, far: Vector, beside: Indices) -> tuple[Indices, Flags]:
        """(new points, which (k,) there are) at most so far (k,) from postures, on the curves of points beside them."""
        begun, going = q, np.arange(len(q))
        q, v, g, slope, sound = q.copy(), np.zeros_like(q), np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q), bool)
        for _ in range(8):
            move, v[going], g[going], slope[going], sound[going] = self._at(q[going])
            size = np.abs(move).max(axis=1)
            on = size > 1e-11
            q[going[np.isnan(size)]] = np.nan
            going, move = going[on], move[on]
            if not len(going):
                break
            q[going] += move
            near = np.abs(q[going] - begun[going]).max(axis=1) <= far[going]
            q[going[~near]] = np.nan
            going = going[near]
        q[going] = np.nan
        there: Flags = np.array(np.isfinite(q).all(axis=1), dtype=bool)
        new = len(self.q) + np.arange(int(there.sum()))
        self.q, self.v = np.vstack([self.q, q[there]]), np.vstack([self.v, v[there]])
        self.g, self.slope = np.append(self.g, g[there]), np.append(self.slope, slope[there])
        self.sound, self.curve = np.append(self.sound, sound[there]), np.append(self.curve, self.curve[beside[there]])
        return new, there

    def _turn(self, which: Indices | slice, along: Matrix) -> None:
        """Turns the vectors v of points to the side of others."""
        side = np.where(np.einsum("kn,kn->k", self.v[which], along) < 0, -1.0, 1.0)
        self.v[which] *= side[:, None]
        self.slope[which] *= side

    def _nearest(self, gap: Vector) -> Vector:
        return (gap + np.pi) % (2 * np.pi) - np.pi if self.angular else gap

    def _stretch(self, i: Indices, j: Indices) -> tuple[Matrix, Vector, Vector, Vector, Flags]:
        """(motion d (k, n), its length, slopes of g over it at both ends, whether the curve is straight enough)."""
        d = self.q[j] - self.q[i]
        h = np.sqrt(np.einsum("kn,kn->k", d, d))
        first, last = np.einsum("kn,kn->k", self.v[i], d), np.einsum("kn,kn->k", self.v[j], d)
        straight = (np.minimum(first, last) > STRAIGHT * h) & (h < LONGEST)
        return d, h, h * self.slope[i], h * self.slope[j], straight

    def _neighbours(self) -> tuple[Indices, Indices]:
        """Neighbours i and j (k,) on the curves, with points between them until they are straight stretches."""
        linked = self.curve[1:] == self.curve[:-1]
        # The vectors v, by the chord to a neighbour that is best along them.
        chord = np.diff(self.q, axis=0)
        length = np.sqrt(np.einsum("kn,kn->k", chord, chord))
        chord *= np.where(linked, 1 / np.maximum(length, 1e-300), 0.0)[:, None]
        along = np.einsum("kn,kn->k", self.v[:-1], chord), np.einsum("kn,kn->k", self.v[1:], chord)
        after, before = np.append(along[0], 0.0), np.append(0.0, along[1])
        side = np.where(np.where(np.abs(after) >= np.abs(before), after, before) < 0, -1.0, 1.0)
        self.v, self.slope = self.v * side[:, None], self.slope * side
        # Stretches that are bent, or on which an angle may make a turn more, get points between.
        i = np.flatnonzero(linked & (self.sound[1:] | self.sound[:-1]))
        j, done = i + 1, []
        for _ in range(FILLS):
            _, h, first, last, straight = self._stretch(i, j)
            rough = ~straight
            if self.angular:
                with np.errstate(invalid="ignore"):
                    rough |= np.abs(self._nearest(self.g[j] - self.g[i]) - 0.5 * (first + last)) > TURNED
            rough &= h > FINEST
            if not rough.any():
                break
            done.append((i[~rough], j[~rough]))
            i, j = self._filled(i[rough], j[rough], h[rough])
        else:
            self.doubt += len(i)
        if not done:
            return i, j
        return np.concatenate([*(a for a, _ in done), i]), np.concatenate([*(b for _, b in done), j])

    def _filled(self, i: Indices, j: Indices, h: Vector) -> tuple[Indices, Indices]:
        """Stretches (k,) with a posture of the curve in each: a step from the end where it is bent less."""
        d = self.q[j] - self.q[i]
        ahead = np.einsum("kn,kn->k", self.v[i], d) >= np.einsum("kn,kn->k", self.v[j], d)
        size = np.minimum(0.5 * h, FILL) * np.where(ahead, 1.0, -1.0)
        begin = np.where(ahead, i, j)
        new, there = self._added(self.q[begin] + size[:, None] * self.v[begin], 0.5 * np.abs(size), begin)
        self._turn(new, self.v[begin[there]])
        self.doubt += int(np.sum(~there))
        return np.concatenate([i[there], new]), np.concatenate([new, j[there]])

    # --- Stretches that g may pass the level on.

    def _first_pairs(self) -> _Pairs:
        """The stretches between neighbours on the curves, with the shifts whose level they may pass."""
        i, j = self._neighbours()
        if not len(i):
            none = np.zeros(0)
            return _Pairs(i, i, none, none, none, none)
        _, h, first, last, _ = self._stretch(i, j)
        self.step = float(h.max())
        a = self._nearest(self.g[i] - self.level)
        b = a + self._nearest(self.g[j] - self.g[i])
        # The range of the cubic, widened; where g has a value at one end alone, what may lie ahead of that.
        inner, outer = a + first / 3, b - last / 3
        low = np.minimum(np.minimum(a, b), np.minimum(inner, outer))
        high = np.maximum(np.maximum(a, b), np.maximum(inner, outer))
        wider = WIDER * (high - low) + self.near
        low, high = low - wider, high + wider
        one = ~(self.sound[i] & self.sound[j])
        if one.any():
            start, rise = np.where(self.sound[i], a, b), np.where(self.sound[i], first, -last)
            low = np.where(one, np.minimum(start, start + 2 * rise), low)
            high = np.where(one, np.maximum(start, start + 2 * rise), high)
        shifts = self.shifts[(self.shifts >= low.min()) & (self.shifts <= high.max())]
        place, shift = np.nonzero((low[:, None] <= shifts) & (shifts <= high[:, None]))
        t = shifts[shift]
        pairs = _Pairs(i[place], j[place], a[place] - t, b[place] - t, t, np.zeros(len(t)))
        flat = (high - low < 4 * self.near)[place] & (np.maximum(np.abs(pairs.a), np.abs(pairs.b)) <= self.near)
        if flat.any():
            self._take_families(pairs[flat], h[place[flat]])
            pairs = pairs[~flat]
        return _Pairs(pairs.i, pairs.j, pairs.a, pairs.b, pairs.shift, self._error(pairs.i, pairs.j))

    def _take_families(self, flat: _Pairs, h: Vector) -> None:
        """Takes one posture of each curve that has stretches (k,) along which g is at the level."""
        order = np.lexsort((flat.i, flat.shift, self.curve[flat.i]))
        flat, h, curve = flat[order], h[order], self.curve[flat.i[order]]
        firsts = np.flatnonzero(np.append(True, (np.diff(curve) != 0) | (np.diff(flat.shift) != 0)))
        middle = (firsts + np.append(firsts[1:], len(h))) // 2
        q = self.q[flat.i[middle]]
        rcond = np.array([float(self.strategy.gain(posture)[1]) for posture in q])
        self.found.append((q, rcond, flat.shift[middle], np.add.reduceat(h, firsts)))

    def _error(self, i: Indices, j: Indices) -> Vector:
        """About how far (k,) the cubics between rows i, i + 1 are from g: by what those over two stretches miss."""
        count, last = len(i), self.given - 1
        left = np.concatenate([i - 1, i])
        known = (left >= 0) & (left + 2 <= last) & np.tile((j == i + 1) & (j <= last), 2)
        left = np.where(known, left, 0)
        middle, right = np.minimum(left + 1, last), np.minimum(left + 2, last)
        known &= self.curve[left] == self.curve[right]
        d0, d1 = self.q[middle] - self.q[left], self.q[right] - self.q[middle]
        h0, h1 = np.sqrt(np.einsum("kn,kn->k", d0, d0)), np.sqrt(np.einsum("kn,kn->k", d1, d1))
        with np.errstate(all="ignore"):
            h = h0 + h1
            seen = self._nearest(self.g[middle] - self.g[left])
            rise = seen + self._nearest(self.g[right] - self.g[middle])
            miss = np.abs(cubic(rise, self.slope[left] * h, self.slope[right] * h, h0 / h) - seen)
            own = np.concatenate([h1[:count], h0[count:]])
            miss = np.where(known, miss * own**4 / (16 * h0**2 * h1**2), 0.0)
        return np.nan_to_num(np.maximum(miss[:count], miss[count:]))

    def _sorted_out(self, pairs: _Pairs) -> tuple[Flags, Flags]:
        """Which pairs (k,) have one root, and which are to be cut; the others have none."""
        _, h, first, last, straight = self._stretch(pairs.i, pairs.j)
        begins, ends = self.sound[pairs.i], self.sound[pairs.j]
        a, b, inner, outer = pairs.a, pairs.b, pairs.a + first / 3, pairs.b - last / 3
        with np.errstate(invalid="ignore"):
            signs = np.array([a >= 0, inner >= 0, outer >= 0, b >= 0])
            changes = (signs[1:] != signs[:-1]).sum(axis=0)
            away = np.abs([a, inner, outer, b]).min(axis=0)
            error, known = 4 * pairs.error + 1e-14, begins & ends & straight
            none = known & (changes == 0) & (away > error)
            # Where g comes so near the level as to round-off, and is level there, two postures meet.
            closest = np.where(np.abs(a) < np.abs(b), pairs.i, pairs.j)
            meet = known & (changes == 0) & (away <= self.near) & (np.abs(self.slope[closest]) < LEVEL)
            single = known & (changes == 1) & (error <= WIDER * np.abs(b - a))
            # A stretch from which g ends: whether it may pass the level before.
            start, rise = np.where(begins, a, b), np.where(begins, first, -last)
            none |= (begins ^ ends) & ~(start * (start + 2 * rise) <= 0)
        self.meetings.append(self.q[closest[meet]])
        cut = ~none & ~single & ~meet & (begins | ends)
        over = cut & (h < FINEST)
        if over.any():
            # At the finest a change of sign is a root, or a jump, which Newton's method tells.
            passes = over & begins & ends & (signs[0] != signs[3])
            self.doubt += int(np.sum(over & begins & ends & ~passes & ~(away > error)))
            single, cut = single | passes, cut & ~over
        return single, cut

    def _refined(self, pairs: _Pairs) -> _Pairs:
        """Takes the roots of pairs with one each; returns those where Newton's method does not stay on the stretch."""
        if not len(pairs.i):
            return pairs
        d, h, first, last, _ = self._stretch(pairs.i, pairs.j)
        begun = self._between(pairs, d, h, root_of_cubic(pairs.a, pairs.b, first, last))
        p, R = np.broadcast_to(self.p, (len(h), *self.p.shape)), np.broadcast_to(self.R, (len(h), *self.R.shape))
        rcond, c = np.zeros(len(h)), (self.level + pairs.shift)[:, None]

        def correct(q: Matrix, k: Indices) -> tuple[Matrix, Flags]:
            dq, quality, margin, _ = self.rows(self.rows.step, q, p[: len(k)], R[: len(k)], c[k])
            rcond[k] = quality.reshape(-1)
            return dq.reshape(q.shape), margin.reshape(-1) > TOLERANCES.representation

        q, arrived = newton(correct, begun, steps=60, longest=0.5, exact=EXACT)
        there = arrived & (np.abs(q - begun).max(axis=1) <= BESIDE * h + SAME)
        self.found.append((q[there], rcond[there], pairs.shift[there], np.zeros(int(there.sum()))))
        return pairs[~there & (h >= FINEST)]

    def _between(self, pairs: _Pairs, d: Matrix, h: Vector, x: Vector) -> Matrix:
        """Postures (k, n) near the curve, at shares x (k,) of the stretches."""
        h, x = h[:, None], x[:, None]
        return self.q[pairs.i] + cubic(d, h * self.v[pairs.i], h * self.v[pairs.j], x)

    def _cut(self, pairs: _Pairs) -> _Pairs:
        """The pairs cut in two: where their cubic has an extremum, or in the middle."""
        if not len(pairs.i):
            return pairs
        d, h, first, last, _ = self._stretch(pairs.i, pairs.j)
        x = extremum_of_cubic(pairs.a, pairs.b, first, last)
        new, there = self._added(self._between(pairs, d, h, x), 0.5 * h, pairs.i)
        self.doubt += int(np.sum(~there))
        pairs, d, h, first, last, x = pairs[there], d[there], h[there], first[there], last[there], x[there]
        self._turn(new, d)
        # g there, counted from an end where it has a value, and what the cubic missed.
        begins, rise = self.sound[pairs.i], pairs.b - pairs.a
        with np.errstate(invalid="ignore"):
            seen = self._nearest(self.g[new] - self.g[np.where(begins, pairs.i, pairs.j)])
            missed = np.abs(cubic(rise, first, last, x) - np.where(begins, 0.0, rise) - seen)
            seen += np.where(begins, pairs.a, pairs.b)
            error = np.nan_to_num(missed / (16 * np.maximum(4 * x * (1 - x), 0.5) ** 2))
            # Where g only touches the level two postures meet.
            touch = (np.abs(seen) <= self.near) & ((pairs.a >= 0) == (pairs.b >= 0))
            touch &= self.sound[new] & (np.abs(self.slope[new]) < LEVEL)
        self.meetings.append(self.q[new[touch]])
        halves = (pairs.i, new, pairs.a, seen, pairs.shift, error), (new, pairs.j, seen, pairs.b, pairs.shift, error)
        return (_Pairs(*halves[0]) + _Pairs(*halves[1]))[np.tile(~touch, 2)]
