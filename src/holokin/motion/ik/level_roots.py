"""Roots of g = level along the self-motions of a tool pose: all postures of the pose on a leaf, one row redundant.

Between neighbouring postures of a curve g is taken as the cubic of its values and slopes there. Its four coefficients
over that stretch bound it: where they have one sign it has no root, where they change sign once it has one. Else the
stretch is cut in two, where the cubic has its extremum, by a posture of the curve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...strategies import HolonomicStrategy
from ...strategies.radial_strategy import joint_gap
from ...symbolic import Function
from ...symbolic.linear import least_norm, null_space_expression
from .leaf import leaf_step
from .posture_search import EXACT, newton
from .self_motions import SelfMotions

LONGEST_STRETCH = 0.6
"""Joint motion [joint units] of a stretch that gets a posture between: a cubic says nothing of so much."""

STRAIGHT = 0.8
"""Cosine between a stretch and the curve at its ends, below which it gets a posture between."""

FILL, FILLS = 0.3, 40
"""Joint motion to such a posture at most [joint units], and how many one after the other."""

WIDER = 0.25
"""Share of its own range by which the range of a cubic is widened before it is said to be away from a level."""

FINEST = 1e-3
"""Joint motion [joint units] of a stretch that is cut no more."""

MEET = 1e-10
"""Of an extremum of g from the level, over 1 + its size: two postures meet there, nearer to each other than 1e-4."""

SAME = 1e-6
"""Joints [joint units] that differ less are one posture."""

CUTS = 24
"""Rounds of cutting stretches in two."""

NATIVE_ROWS = 20_000
"""Postures from which native code is worth a compiler's second."""


@dataclass(frozen=True, eq=False)
class LevelRoots(Value):
    """Postures q (k, n), regular ones, where g is at the level, less `shift` (k,); see `roots_along`.

    rcond (k,): of [J; J_g]. family (k,): arc length [joint units] of the stretch on which g is at the level, of which a
    posture is one; 0 for one that is alone. singular: places where two of them meet. doubt: stretches, `FINEST` long,
    of which it stays open whether they have one. step: the longest stretch [joint units] between two looks at g.
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


@kept
def _looks(strategy: HolonomicStrategy) -> list[int]:
    """How many postures were looked at."""
    return [0]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Stretches, each with one shift: between points i and j (k,), where g - level - shift is a and b (k,).

    error (k,): about how far the cubic is from g between them.
    """

    i: Indices
    j: Indices
    a: Vector
    b: Vector
    shift: Vector
    error: Vector

    def __getitem__(self, which: Flags | Indices) -> _Pairs:
        return _Pairs(*(getattr(self, name)[which] for name in ("i", "j", "a", "b", "shift", "error")))


def _one_after_the_other(parts: list[_Pairs]) -> _Pairs:
    names = ("i", "j", "a", "b", "shift", "error")
    return _Pairs(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


class _Search:
    """The points of the curves that were looked at, and what was found so far.

    v (N, n): unit vectors along the curves, the same way as their points follow each other.
    """

    def __init__(self, strategy: HolonomicStrategy, motions: SelfMotions, level: float, shifts: Vector) -> None:
        self.strategy, self.level, self.shifts = strategy, level, shifts
        self.p, self.R = motions.p[0], motions.R[0]
        self.angular = any(strategy.constraint.angular)
        self.curve = motions.curve
        self.q = motions.q
        _, self.v, self.g, self.slope, self.sound = self._at(motions.q)
        self.singular, self.doubt, self.step = 0, 0, 0.0
        self.found: list[tuple[Matrix, Vector, Vector]] = []
        self.families: list[tuple[Vector, float, float]] = []

    def _at(self, q: Matrix) -> tuple[Matrix, Matrix, Vector, Vector, Flags]:
        used = _looks(self.strategy)
        used[0] += len(q)
        native = 1 if used[0] > NATIVE_ROWS else None
        move, v, g, slope, margin = _look(self.strategy).batch(q, self.p, self.R, native_from=native, threads=1)
        n = q.shape[1]
        g, slope, margin = g.reshape(-1), slope.reshape(-1), margin.reshape(-1)
        with np.errstate(invalid="ignore"):
            sound = np.isfinite(g + slope) & (margin > TOLERANCES.representation)
        return move.reshape(-1, n), v.reshape(-1, n), g, slope, sound

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
        with np.errstate(invalid="ignore"):
            straight = (np.minimum(first, last) > STRAIGHT * h) & (h < LONGEST_STRETCH)
            return d, h, h * self.slope[i], h * self.slope[j], straight

    def roots(self) -> LevelRoots:
        """All of them."""
        pairs = self._first_pairs()
        for _ in range(CUTS):
            if not len(pairs.i):
                break
            single, cut = self._sorted_out(pairs)
            missed = self._refined(pairs[single])
            pairs = self._cut(_one_after_the_other([pairs[cut], missed]))
        self.doubt += len(pairs.i)
        return self._together()

    def _neighbours(self) -> tuple[Indices, Indices]:
        """Neighbours i and j (k,) on the curves, with points between them until they are straight stretches."""
        linked = self.curve[1:] == self.curve[:-1]
        # The vectors v, by the chord to a neighbour that is best along them.
        chord = np.diff(self.q, axis=0)
        length = np.sqrt(np.einsum("kn,kn->k", chord, chord))
        chord *= np.where(linked, 1 / np.maximum(length, 1e-300), 0.0)[:, None]
        none = np.zeros((1, self.q.shape[1]))
        before, after = np.vstack([none, chord]), np.vstack([chord, none])
        best = np.abs(np.einsum("kn,kn->k", self.v, after)) >= np.abs(np.einsum("kn,kn->k", self.v, before))
        self._turn(slice(None), np.where(best[:, None], after, before))
        i = np.flatnonzero(linked & (self.sound[1:] | self.sound[:-1]))
        j, done = i + 1, []
        for _ in range(FILLS):
            _, h, first, last, straight = self._stretch(i, j)
            rough = ~straight
            if self.angular:
                with np.errstate(invalid="ignore"):
                    rise = self._nearest(self.g[j] - self.g[i])
                    rough |= np.abs(rise - 0.5 * (first + last)) > 1.0
            rough &= h > FINEST
            done.append((i[~rough], j[~rough]))
            if not rough.any():
                i = j = i[:0]
                break
            i, j = self._filled(i[rough], j[rough], h[rough])
        self.doubt += len(i)
        return np.concatenate([a for a, _ in done]), np.concatenate([b for _, b in done])

    def _filled(self, i: Indices, j: Indices, h: Vector) -> tuple[Indices, Indices]:
        """Stretches (k,) with a posture of the curve in each: a step from the one end where it is bent less."""
        d = self.q[j] - self.q[i]
        first, last = np.einsum("kn,kn->k", self.v[i], d), np.einsum("kn,kn->k", self.v[j], d)
        ahead = first >= last
        size = np.minimum(0.5 * h, FILL) * np.where(ahead, 1.0, -1.0)
        along = self.v[np.where(ahead, i, j)]
        new, sound = self._added(self.q[np.where(ahead, i, j)] + size[:, None] * along, 0.5 * np.abs(size))
        self._turn(new, along[sound])
        self.doubt += int(np.sum(~sound))
        return np.concatenate([i[sound], new]), np.concatenate([new, j[sound]])

    def _added(self, q: Matrix, far: Vector) -> tuple[Indices, Flags]:
        """(new points, which (k,) there are) on the curve next to postures, at most so far (k,) from them."""
        begun, going = q, np.arange(len(q))
        q, v, g, slope, sound = q.copy(), np.zeros_like(q), np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q), bool)
        for _ in range(8):
            move, v[going], g[going], slope[going], sound[going] = self._at(q[going])
            size = np.abs(move).max(axis=1)
            on = np.isfinite(size) & (size > 1e-11)
            going, move = going[on], move[on]
            q[going] += move
            left = np.abs(q[going] - begun[going]).max(axis=1) > far[going]
            if left.any() or not len(going):
                q[going[left]] = np.nan
                going = going[~left]
                if not len(going):
                    break
        q[going] = np.nan
        there = np.isfinite(q).all(axis=1)
        new = len(self.q) + np.arange(int(there.sum()))
        self.q, self.v = np.vstack([self.q, q[there]]), np.vstack([self.v, v[there]])
        self.g, self.slope = np.append(self.g, g[there]), np.append(self.slope, slope[there])
        self.sound = np.append(self.sound, sound[there])
        return new, there

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
        # The range of the cubic, widened.
        with np.errstate(invalid="ignore"):
            inner = a + first / 3, b - last / 3
            low, high = (
                np.minimum(np.minimum(a, b), np.minimum(*inner)),
                np.maximum(np.maximum(a, b), np.maximum(*inner)),
            )
            wider = WIDER * (high - low)
            low, high = low - wider, high + wider
        # Where g has a value at one end alone, the levels that lie ahead.
        one = ~(self.sound[i] & self.sound[j])
        if one.any():
            start, rise = np.where(self.sound[i], a, b), np.where(self.sound[i], first, -last)
            low = np.where(one, np.minimum(start, start + 2 * rise), low)
            high = np.where(one, np.maximum(start, start + 2 * rise), high)
        place, shift = np.nonzero((low[:, None] <= self.shifts) & (self.shifts <= high[:, None]))
        t = self.shifts[shift]
        return _Pairs(i[place], j[place], a[place] - t, b[place] - t, t, self._error(i[place], j[place]))

    def _error(self, i: Indices, j: Indices) -> Vector:
        """About how far (k,) the cubics between rows i and i + 1 are from g: from what those over two stretches miss."""
        error, last = np.zeros(len(i)), len(self.curve) - 1
        for left, own in ((i - 1, 1), (i, 0)):
            middle, right = left + 1, left + 2
            known = (left >= 0) & (right <= last) & (j == i + 1) & (i < last)
            left, middle, right = np.where(known, (left, middle, right), 0)
            known &= self.curve[left] == self.curve[right]
            d0, d1 = self.q[middle] - self.q[left], self.q[right] - self.q[middle]
            h0, h1 = np.sqrt(np.einsum("kn,kn->k", d0, d0)), np.sqrt(np.einsum("kn,kn->k", d1, d1))
            with np.errstate(all="ignore"):
                h, x = h0 + h1, h0 / (h0 + h1)
                wanted = self._nearest(self.g[middle] - self.g[left])
                rise = wanted + self._nearest(self.g[right] - self.g[middle])
                miss = np.abs(_cubic(0.0, rise, self.slope[left] * h, self.slope[right] * h, x) - wanted)
                miss = miss * (h1 if own else h0) ** 4 / (16 * h0**2 * h1**2)
            error = np.maximum(error, np.where(known & np.isfinite(miss), miss, 0.0))
        return error

    def _sorted_out(self, pairs: _Pairs) -> tuple[Flags, Flags]:
        """Which pairs (k,) have one root, and which are to be cut; families and places where two meet are taken."""
        _, h, first, last, straight = self._stretch(pairs.i, pairs.j)
        sound = self.sound[pairs.i] & self.sound[pairs.j]
        a, b = pairs.a, pairs.b
        with np.errstate(invalid="ignore"):
            inner = a + first / 3, b - last / 3
            signs = np.array([a >= 0, inner[0] >= 0, inner[1] >= 0, b >= 0])
            changes = (signs[1:] != signs[:-1]).sum(axis=0)
            away = np.minimum(np.minimum(np.abs(a), np.abs(b)), np.minimum(np.abs(inner[0]), np.abs(inner[1])))
            error = 4 * pairs.error + 1e-14
            clear = sound & straight & (changes == 0) & (away > error)
            single = sound & straight & (changes == 1) & (4 * pairs.error <= WIDER * np.abs(b - a))
            # A stretch from which g ends: whether it may pass the level before.
            one = self.sound[pairs.i] ^ self.sound[pairs.j]
            start, rise = np.where(self.sound[pairs.i], a, b), np.where(self.sound[pairs.i], first, -last)
            clear |= one & ~(start * (start + 2 * rise) <= 0)
            clear |= ~self.sound[pairs.i] & ~self.sound[pairs.j]
        cut = ~clear & ~single
        if cut.any():
            small = h < FINEST
            over = cut & small
            if over.any():
                # At the finest: a change of sign is a root or a jump, which Newton's method tells; else it is open.
                passes = over & sound & ((a >= 0) != (b >= 0))
                single |= passes
                self.doubt += int(np.sum(over & sound & ~passes & (away <= error)))
                cut &= ~over
        return single, cut

    def _refined(self, pairs: _Pairs) -> _Pairs:
        """Takes the roots of pairs with one each; returns those where Newton's method does not stay on the stretch."""
        if not len(pairs.i):
            return pairs
        d, h, first, last, _ = self._stretch(pairs.i, pairs.j)
        x = _root_of_cubic(pairs.a, pairs.b, first, last)
        begun = self._between(pairs, d, h, x)
        step, rcond = leaf_step(self.strategy), np.zeros(len(begun))
        c = (self.level + pairs.shift)[:, None]
        native = 1 if _looks(self.strategy)[0] > NATIVE_ROWS else None

        def correct(q: Matrix, k: Indices) -> tuple[Matrix, Flags]:
            dq, quality, margin, _ = step.batch(q, self.p, self.R, c[k], native_from=native, threads=1)
            rcond[k] = quality.reshape(-1)
            return dq.reshape(q.shape), margin.reshape(-1) > TOLERANCES.representation

        q, arrived = newton(correct, begun, steps=60, longest=0.5, exact=EXACT)
        there = arrived & (np.abs(q - begun).max(axis=1) <= 0.25 * h + 1e-6)
        self.found.append((q[there], rcond[there], pairs.shift[there]))
        return pairs[~there & (h >= FINEST)]

    def _between(self, pairs: _Pairs, d: Matrix, h: Vector, x: Vector) -> Matrix:
        """Postures (k, n) near the curve, at shares x (k,) of the stretches."""
        h, x = h[:, None], x[:, None]
        return self.q[pairs.i] + _cubic(0.0, d, h * self.v[pairs.i], h * self.v[pairs.j], x)

    def _cut(self, pairs: _Pairs) -> _Pairs:
        """The pairs cut in two: where their cubic has an extremum, or in the middle."""
        if not len(pairs.i):
            return pairs
        d, h, first, last, _ = self._stretch(pairs.i, pairs.j)
        rise = pairs.b - pairs.a
        x = _extremum(rise, first, last, pairs.a, pairs.b)
        new, there = self._added(self._between(pairs, d, h, x), 0.5 * h)
        self.doubt += int(np.sum(~there))
        pairs = pairs[there]
        d, h, first, last, rise, x = (w[there] for w in (d, h, first, last, rise, x))
        self._turn(new, d)
        # g there, counted from the end where it has a value.
        ahead = self.sound[pairs.i]
        with np.errstate(invalid="ignore"):
            seen = self._nearest(self.g[new] - self.g[np.where(ahead, pairs.i, pairs.j)])
            missed = np.abs(_cubic(np.where(ahead, 0.0, -rise), rise, first, last, x) - seen)
            seen += np.where(ahead, pairs.a, pairs.b)
            error = np.nan_to_num(missed / (16 * (4 * x * (1 - x)) ** 2))
            # Two postures meet where g only touches the level.
            touch = self.sound[new] & (np.abs(seen) <= MEET * (1 + abs(self.level)))
            touch &= (np.abs(self.slope[new]) * h < 1e-4) & ((pairs.a >= 0) == (pairs.b >= 0))
        self.singular += int(touch.sum())
        halves = [
            _Pairs(pairs.i, new, pairs.a, seen, pairs.shift, error)[~touch],
            _Pairs(new, pairs.j, seen, pairs.b, pairs.shift, error)[~touch],
        ]
        return _one_after_the_other(halves)

    def _together(self) -> LevelRoots:
        """What was found, each posture once."""
        n = self.q.shape[1]
        parts = self.found or [(np.zeros((0, n)), np.zeros(0), np.zeros(0))]
        q, rcond, shift = (np.concatenate([part[k] for part in parts]) for k in range(3))
        regular = rcond > TOLERANCES.singular
        each = _each_once(self.strategy, q)
        self.singular += int(np.sum(each & ~regular))
        each &= regular
        return LevelRoots(q[each], rcond[each], shift[each], np.zeros(each.sum()), self.singular, self.doubt, self.step)


def _each_once(strategy: HolonomicStrategy, q: Matrix) -> Flags:
    """Which postures (k,) are no others before them, but for whole turns."""
    if len(q) < 2:
        return np.ones(len(q), dtype=bool)
    gap = np.abs(joint_gap(strategy.task.robot, q[:, None], q[None])).max(axis=2)
    return ~np.tril(gap < SAME, -1).any(axis=1)


def _cubic(low: Array | float, rise: Array, first: Array, last: Array, x: Array) -> Array:
    """At shares x the cubic from `low` by `rise`, with its slopes at both ends."""
    return low + x * (first + x * (3 * rise - 2 * first - last + x * (first + last - 2 * rise)))


def _root_of_cubic(a: Vector, b: Vector, first: Vector, last: Vector) -> Vector:
    """The share (k,) where a cubic from a to b, of other sign, is 0."""
    rise, low, high = b - a, np.zeros(len(a)), np.ones(len(a))
    c2, c3 = 3 * rise - 2 * first - last, first + last - 2 * rise
    x = np.where(rise != 0, -a / np.where(rise != 0, rise, 1.0), 0.5)
    for _ in range(6):
        f = a + x * (first + x * (c2 + x * c3))
        below = (f >= 0) == (a >= 0)
        low, high = np.where(below, x, low), np.where(below, high, x)
        slope = first + x * (2 * c2 + 3 * c3 * x)
        with np.errstate(all="ignore"):
            x = x - f / slope
        x = np.where((x >= low) & (x <= high), x, 0.5 * (low + high))
    return x


def _extremum(rise: Vector, first: Vector, last: Vector, a: Vector, b: Vector) -> Vector:
    """The share (k,) of the extremum of a cubic that is nearest to 0 in value; 1/2 where it has none well inside."""
    c2, c3 = 3 * rise - 2 * first - last, first + last - 2 * rise
    with np.errstate(all="ignore"):
        root = np.sqrt(c2 * c2 - 3 * c3 * first)
        big = -(c2 + np.copysign(root, c2))
        options = np.array([big / (3 * c3), first / big])
        inside = (options > 0.02) & (options < 0.98)
        value = np.abs(a + options * (first + options * (c2 + options * c3)))
        value = np.where(inside, value, np.inf)
        best = value.argmin(axis=0)
    x = options[best, np.arange(len(rise))]
    return np.where(inside[best, np.arange(len(rise))], x, 0.5)
