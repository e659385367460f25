"""How the joints at equal tool poses go on over the cycles of a log: the trend, judged on the last third."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.types import Array, Matrix, NoTruthValue, Vector
from ...symbolic.linear import null_space

# --- Postures at equal tool poses, cycle by cycle: the directions in which they can differ, and the noise there.

# Encoder noise along the path, times how fast the spare joints run beside the tool, is taken to grow by no more than
# this: at the tips of a path the tool's direction, and with it the gain, is not known.
MOST_GAIN = 3.0


@dataclass(frozen=True, eq=False)
class Visits:
    """Postures `joints` (k, P, n) at P tool poses, visited in the cycles number `when` (k,).

    axes (P, n, d): spare directions, orthonormal; moves (k, P, n): joint moves that brought the postures to the
    poses; noise (P, d), move_noise (P,): standard deviation of encoder noise along the axes, and in the moves (of all
    joints together).
    """

    joints: Array
    axes: Array
    when: Vector
    moves: Array
    noise: Matrix
    move_noise: Vector

    def __len__(self) -> int:
        return len(self.joints)

    @cached_property
    def y(self) -> Array:
        """Coordinates along the axes (k, P, d), less their mean over the cycles."""
        return np.einsum("kpn,pnd->kpd", self.joints - self.joints.mean(axis=0), self.axes)

    @property
    def slope(self) -> Vector:
        """Weights (k,) of the cycles in the slope of the straight line through their coordinates."""
        since = self.when - self.when.mean()
        return since / (since @ since)

    @property
    def lever(self) -> Matrix:
        """Largest joint's share in each axis (P, d)."""
        return np.abs(self.axes).max(axis=1)

    def last(self, count: int) -> Visits:
        """The last cycles alone."""
        when = self.when[-count:] - self.when[-count]
        return Visits(self.joints[-count:], self.axes, when, self.moves[-count:], self.noise, self.move_noise)


def spare_axes(jacobian: Array) -> Array:
    """Orthonormal null spaces (P, n, d) of Jacobians (P, m, n), turned as little as can be from one to the next.

    Where no direction is spare, all joints are: whatever differs at equal tool poses is then looked for in each.
    """
    count, m, n = jacobian.shape
    if n <= m:
        return np.tile(np.eye(n), (count, 1, 1))
    axes = null_space(jacobian).copy()
    if n - m == 1:
        signs = np.sign(np.einsum("pn,pn->p", axes[1:, :, 0], axes[:-1, :, 0]))
        axes[1:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0))[:, None, None]
        return axes
    for p in range(1, count):
        u, _, v = np.linalg.svd(axes[p].T @ axes[p - 1])
        axes[p] = axes[p] @ u @ v
    return axes


def encoder_noise(
    jacobian: Array, axes: Array, rate: Matrix, weights: Vector, level: Vector
) -> tuple[Matrix, Matrix, Vector]:
    r"""Standard deviations (P, d) along the axes and (P, n) of the joints that encoder noise leaves at a tool pose, and
    (P,) of the move there, all joints together.

    The pose is looked for along the path, so noise e moves the visit by $-q' (q'^T M e) / (q'^T M q')$ with
    $M = J^T W J$; what is off the path is taken out by the pseudo-inverse.

    Args:
        jacobian (P, m, n), rate (P, n): dq by phase. weights (m,): of the task rows in the distance of two poses.
        level (n,): of the joints' encoders [joint units].
    """
    towards = np.einsum("pmn,m,pml,pl->pn", jacobian, weights, jacobian, rate)
    size = np.maximum(np.einsum("pn,pn->p", rate, towards), 1e-300)
    ahead = np.einsum("pnd,pn->pd", axes, rate) / size[:, None]
    across = axes.transpose(0, 2, 1) - ahead[:, :, None] * towards[:, None, :]  # (P, d, n)
    plain = np.sqrt(np.einsum("pnd,n->pd", axes**2, level**2))
    along = np.sqrt(np.einsum("pdn,n->pd", across**2, level**2))
    capped = np.minimum(along, MOST_GAIN * plain)
    scale = capped / np.maximum(along, 1e-300)
    joints = np.einsum("pnd,pd,pdl->pnl", axes, scale, across)
    n = len(level)
    whole = np.eye(n) - rate[:, :, None] * (towards / size[:, None])[:, None, :]
    off = whole - axes @ (axes.transpose(0, 2, 1) @ whole) if axes.shape[2] < n else np.zeros_like(whole)
    moves = np.minimum(np.sqrt(np.einsum("pnl,l->p", off**2, level**2)), MOST_GAIN * np.linalg.norm(level))
    return capped, np.sqrt(np.einsum("pnl,l->pn", joints**2, level**2)), moves


# --- The scatter of postures at equal tool poses over the cycles of a log, and shapes that it would not take.

# Two-sided, for all phases, directions and groups of cycles of a log together: of a hundred logs in which nothing
# changes one may show a change. Less would find drifts in a fleet's daily logs; more needs longer logs.
CONFIDENCE = 0.99

# How far spare joints may move beside those that follow a tool path which itself shifts. A strategy that repeats moves
# them too: with up to 1.76 times the least joint speed (docs/measured.md), so sqrt(1.76^2 - 1) times as far.
LEAF_SLOPE = 1.5

SHIFT = 2.0  # deviations of the noise in the moves to a pose up to which they do not show a shift of the tool's path

# Independent shapes over the cycles that noise can take for a change: the fitted curves run from a jump in the first
# cycle through a drift to an alternation, and the tube about such a curve holds as much noise as six directions do.
SHAPES = 6

# Steps, one after each cycle, are worth one more such direction for so many cycles: in white noise of 5 to 80 cycles
# the largest of all shapes is as large as that of SHAPES + k / STEPS, or of fewer, with an error of 1 % or 0.1 %.
STEPS = 2

# Degrees of freedom that the encoder noise, known from all samples, is worth beside the scatter of few cycles.
PRIOR = 2

# Cycles from which their scatter about a fit of four numbers can be measured; with fewer, encoder noise stands in.
FEWEST = 5

THIRD = 20.0  # sum of the squared binomials of a third difference: the variance that white noise of variance 1 gives it

# Third differences of white noise that are worth one degree of freedom: 1 + 2 (0.75^2 + 0.3^2 + 0.05^2).
ALIKE_THIRDS = 2.3

# Correlation of the scatter of successive cycles beyond which they may be steps of a random walk, which looks like a
# trend of its sums but not of its steps.
ALIKE = 0.5

RATIOS = np.concatenate([-1 + np.linspace(0, 1, 41), 1 - np.logspace(-0.01, -5, 80), [1.0, 1.01, 1.02, 1.05]])
_BENT = 0.999  # ratios up to this differ from a straight line by more than round-off


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations: of each visit (P, d) and of their average over the phases (d,), with their degrees of
    freedom; of the joint moves to the pose (P,)."""

    each: Matrix
    dof: float
    average: Vector
    average_dof: float
    moves: Vector
    alike: float = 0.0  # correlation of the scatter of successive cycles


def shapes_of(ratios: Vector, c: Vector) -> Matrix:
    """For each r, sums of a drift that changes by the factor r from cycle to cycle, after c cycles, less their mean."""
    r = np.asarray(ratios)[:, None]
    even = np.abs(1 - r) < 1e-9
    f = np.where(even, c, (1 - np.sign(r) ** c * np.abs(r) ** c) / np.where(even, 1.0, 1 - r))
    return f - f.mean(axis=1, keepdims=True)


def steps_of(k: int) -> Matrix:
    """Steps after each of k cycles but the last (k - 1, k), without mean, of length 1."""
    after = (np.arange(k) >= np.arange(1, k)[:, None]) * 1.0
    after -= after.mean(axis=1, keepdims=True)
    return after / np.linalg.norm(after, axis=1, keepdims=True)


def shifts(shapes: Matrix, moves: Array, scatter: Vector) -> Matrix:
    """Size of each shape (R, k) in the moves (k, P, n), beyond `SHIFT` of their scatter (P,) -> (R, P)."""
    k, phases, n = moves.shape
    along = (shapes @ moves.reshape(k, -1)).reshape(len(shapes), phases, n)
    squares = np.einsum("rpn,rpn->rp", along, along) - np.outer((shapes**2).sum(axis=1), (SHIFT * scatter) ** 2)
    return np.sqrt(np.maximum(squares, 0.0))


def scatter(visits: Visits) -> Noise:
    """What smooth curves over the cycles leave (`left_over`), at least the encoder noise."""
    k, phases, d = visits.y.shape
    encoder = np.sqrt((visits.noise**2).mean(axis=0) / phases)
    if k < FEWEST:
        return Noise(visits.noise, np.inf, encoder, np.inf, visits.move_noise)
    fit = residual(visits.y.reshape(k, -1))
    alike = float((fit[1:] * fit[:-1]).sum()) / max(float((fit**2).sum()), 1e-300)
    alike = min(alike + (2 + 4 * max(alike, 0.0)) / k, 0.95) if k >= 8 else 0.0  # what the fit took away
    serial = (1 + alike) / (1 - alike) if alike > 0 else 1.0
    left, free = left_over(visits.y.reshape(k, -1))
    rest, total = left.reshape(len(left), phases, d), max(float((left**2).sum()), 1e-300)
    own, pooled = serial * (rest**2).sum(axis=0), serial * total / (phases * d)
    waves = np.abs(np.fft.fft(rest, axis=1)) ** 2
    correlation = np.fft.ifft(waves.sum(axis=(0, 2))).real / total  # of phases at each distance
    alone = max(float((correlation**2).sum()), 1.0)  # 1 at distance 0, unless nothing at all is left over
    dof = max(free, free * phases / alone) + PRIOR
    each = np.sqrt(np.maximum(np.maximum(own, pooled), visits.noise**2))
    average = np.sqrt(np.maximum(serial * (rest.mean(axis=1) ** 2).sum(axis=0), encoder**2))
    moves = residual(visits.moves.reshape(k, -1) - visits.moves.reshape(k, -1).mean(axis=0))
    scattered = np.sqrt((moves.reshape(visits.moves.shape) ** 2).sum(axis=(0, 2)) / (k - 4))
    return Noise(each, dof, average, free + PRIOR, scattered, alike)


def left_over(y: Matrix) -> tuple[Matrix, float]:
    """What a smooth curve leaves of columns without mean (k, s), k >= `FEWEST`, so that its sums of squares are
    variances, and its degrees of freedom.

    The least of what b c + e r^c leaves, what a step leaves, and of the third differences, of all cycles and of the
    later half: a drift whose rate changes slowly is no such curve, and a quick decay has large third differences while
    it lasts.
    """
    k = len(y)
    third = np.diff(y, 3, axis=0) / np.sqrt(THIRD)
    late = third[-max(3, len(third) // 2) :]
    steps = steps_of(k)
    step = steps[int(np.argmax(((steps @ y) ** 2).sum(axis=1)))]
    candidates = [(left, float(k - 4), float(k - 4)) for left in (residual(y), y - np.outer(step, step @ y))]
    candidates += [(third, float(k - 3), (k - 3) / ALIKE_THIRDS)]
    candidates += [(late, float(len(late)), len(late) / ALIKE_THIRDS)] if len(third) >= FEWEST else []
    sizes = [
        float((left**2).sum()) / count * quantile(1 - CONFIDENCE, dof + PRIOR) ** 2 for left, count, dof in candidates
    ]
    left, count, dof = candidates[int(np.argmin(sizes))]
    return left / np.sqrt(count), dof


def residual(y: Matrix) -> Matrix:
    """What the best b c + e r^c, with one r, leaves of columns without mean (k, s)."""
    c = np.arange(len(y), dtype=float)
    line = (c - c.mean()) / np.linalg.norm(c - c.mean())
    rest = y - np.outer(line, line @ y)

    def across(ratios: Vector) -> Matrix:
        curves = shapes_of(ratios, c)
        curves = curves - np.outer(curves @ line, line)
        return curves / np.linalg.norm(curves, axis=1, keepdims=True)

    tries, ratio = np.sort(RATIOS[RATIOS < _BENT]), 0.0
    for _ in range(4):  # a coarse ratio would leave more than noise does
        held = across(tries) @ rest
        best = int(np.argmax((held**2).sum(axis=1)))
        ratio = tries[best]
        tries = np.linspace(tries[max(best - 1, 0)], tries[min(best + 1, len(tries) - 1)], 21)
    curve = across(np.array([ratio]))[0]
    return rest - np.outer(curve, curve @ rest)


def shaped(series: Vector, error: float, walks: bool) -> bool:
    """Whether a change (k,) has a shape that scatter of unknown size would not take.

    What a drift, a jump after the first cycle or an alternation leaves of it, or with more cycles the best decay, is
    small beside it. Where the joints may walk at random, the same is asked of their steps.
    """
    k = len(series)
    if k < 3:
        return False
    tests = [(np.array([1.0, 0.0, -1.0]), k - 2, 3), (RATIOS, k - 3, SHAPES)]
    for ratios, free, number in tests[:1] if k < 4 else tests[1:] if walks else tests:
        if walks:
            steps = np.sign(ratios[:, None]) ** np.arange(k - 1) * np.abs(ratios[:, None]) ** np.arange(k - 1)
            size = float(np.diff(series) @ np.diff(series))
            left = size - float(((steps @ np.diff(series)) ** 2 / (steps**2).sum(axis=1)).max())
        else:
            # What the best a + b (1 - r^c) / (1 - r) leaves, for each r.
            curves = shapes_of(ratios, np.arange(k, dtype=float))
            size = float(series @ series)
            left = float((size - (curves @ series) ** 2 / (curves**2).sum(axis=1)).min())
        explained = np.sqrt(max(size - left, 0.0) / max(left / free, 1e-300))
        if explained > quantile(error / number, free):
            return True
    return False


def quantile(error: float, dof: float) -> float:
    """Deviations that noise exceeds with the probability `error`, both sides together."""
    from scipy.special import ndtri, stdtrit

    return float(-ndtri(error / 2) if np.isinf(dof) else -stdtrit(dof, error / 2))


# Cycles within which a steady drift must reach the tolerance to count: a day or two of a usual robot's work.
HORIZON = 1000

# A drift goes on when the second half of the last third of the cycles drifts by no less than this share of the first
# half. Joints that converge like 1/k have 0.7 there, a decay of the drift to a half over the log 0.9.
LASTING = 0.95

# It fades when that share is no more than this, and that of the stretch before, too: at least like 1/sqrt(k).
FADING = 0.75

# And when it does not fall faster and faster, as a drift does that is about to turn round: each share is at least
# this share of the one before. A decay has the same share again and again, and sums of decays, and powers, a growing
# one.
STEADY = 0.9


class Trend(NoTruthValue, Enum, ask="`is Trend.GOES_ON`"):
    """How the joints at equal tool poses go on over the cycles, as the last third of them shows it."""

    NONE = "no change beyond tolerance and noise"
    GOES_ON = "the drift goes on"
    FADES = "the drift fades"
    ALTERNATES = "the joints alternate from cycle to cycle"
    CANNOT_TELL = "the log does not tell how the change goes on"


@dataclass(frozen=True, eq=False)
class DriftTrend:
    """Trend of cycles of one kind, judged at all phases.

    change: largest joint change over the cycles [joint units], 0 where none is seen, within `change_range`; beyond:
    whether it exceeds the tolerance, and not by noise; ratio: factor from one cycle's drift to the next in the last
    third, within `ratio_range`, NaN where no drift is seen there; latest: differences that were judged, 0 where none
    were; phase: index of the phase that shows the change best; rates, errors, bends (P, n): drift of the last third of
    the cycles at each phase, its half interval, and how much it changed since the last two thirds [joint units a
    cycle]; detectable: smallest drift at a single phase that these cycles would surely show [joint units a cycle];
    creep: part of it that is due to shifts of the tool's own path; cycles_needed: cycles that would show a drift of
    the tolerance, or decide how a change goes on.
    """

    trend: Trend
    change: float
    change_range: tuple[float, float]
    beyond: bool
    ratio: float
    ratio_range: tuple[float, float]
    latest: int
    phase: int
    rates: Matrix
    errors: Matrix
    bends: Matrix
    detectable: float
    creep: float
    cycles_needed: int

    @property
    def rate(self) -> Vector:
        """Drift of the last third of the cycles where it shows best (n,) [joint units a cycle]."""
        return self.rates[self.phase]

    @property
    def rate_error(self) -> Vector:
        """Half interval of `rate` (n,)."""
        return self.errors[self.phase]


@dataclass(frozen=True, eq=False)
class _Change:
    """The change over cycles that shows best: over noise (1 is the bound), at which phase, in which pattern (P, d) over
    the phases; its largest joint's size, and within which ends noise leaves it; the most by which any change surely
    exceeds noise [joint units]."""

    seen: float
    phase: int
    pattern: Matrix
    size: float
    ends: tuple[float, float]
    sure: float


def judge(
    visits: Visits, tolerance: float, *, floor: float = 0.0, share: float = 1.0, rounding: float = 0.0
) -> DriftTrend:
    """Judge how visits at equal tool poses go on over the cycles.

    A change over the cycles is looked for in the shapes of a step, a decay, a drift and an alternation. It must exceed
    the noise at one phase, or in the average of all, with `CONFIDENCE`, and have such a shape. How it goes on is told
    by the differences of successive cycles in the last third alone (`_latest`).

    Args:
        tolerance: joint distance that counts as equal, and drift per cycle that must be excluded for `Trend.NONE`.
        floor: joint distance that noise explains, where fewer than `FEWEST` cycles do not show their scatter.
        share: of the error probability 1 - `CONFIDENCE` that these visits may use.
        rounding: of the joints' numbers, which may hide as much.
    """
    # The change that stands out of the noise most, and the least drift that would.
    k, phases, d = visits.y.shape
    error = (1 - CONFIDENCE) * share / 2  # half for single phases, half for their average
    noise = scatter(visits)
    shapes = SHAPES + k // STEPS
    limit = quantile(error / (shapes * phases * d), noise.dof)
    seen = _change(visits, noise, error, steps=True)
    line = visits.slope
    deviation = float((noise.each * visits.lever).max())
    creep = LEAF_SLOPE * shifts(line[None], visits.moves, noise.moves)[0]
    detectable = max(float(creep.max()) + limit * deviation * float(np.linalg.norm(line)), rounding)
    needed = _needed(deviation, tolerance, error / (shapes * phases * d), float(np.mean(np.diff(visits.when))))

    def result(trend: Trend, change: float, latest: _Latest | None = None, more: int = 0) -> DriftTrend:
        rates, errors, bends = _rates(visits, noise.each, limit, creep)
        ratio, among, count = (np.nan, (np.nan, np.nan), 0) if latest is None else latest.facts
        return DriftTrend(
            trend, change, seen.ends if change else (0.0, 0.0), seen.sure > tolerance, ratio, among, count,
            seen.phase, rates, errors, bends, detectable, float(creep.max()), max(needed, more),
        )  # fmt: skip

    # Is there a change, and of a shape that scatter has not?
    if seen.seen <= 1 or (k < FEWEST and seen.size <= tolerance + floor):
        return result(Trend.NONE, 0.0) if detectable <= tolerance else result(Trend.CANNOT_TELL, 0.0, more=k + k // 2)
    small = max(seen.ends[1], seen.sure) <= tolerance and detectable <= tolerance
    series = visits.y.reshape(k, -1) @ seen.pattern.ravel()
    if k < 4 or not shaped(series, error, walks=noise.alike > ALIKE):
        return result(Trend.NONE if small else Trend.CANNOT_TELL, seen.size, more=0 if small else 2 * k)
    # How it goes on.
    latest = _latest(visits, noise, error, tolerance)
    if latest.trend is Trend.CANNOT_TELL and not small:
        return result(Trend.CANNOT_TELL, seen.size, latest, more=2 * k)
    if latest.trend in (Trend.GOES_ON, Trend.ALTERNATES) or small:
        lasts = latest.trend is Trend.GOES_ON or (latest.trend is Trend.ALTERNATES and not small)
        return result(latest.trend if lasts else Trend.NONE, seen.size, latest)
    return result(Trend.FADES, seen.size, latest)  # of its own, or since the last third rests


class _Latest(NamedTuple):
    """What the last third of the cycles shows: factor from one cycle's drift to the next, its interval, and the number
    of differences."""

    trend: Trend
    facts: tuple[float, tuple[float, float], int]


def _latest(visits: Visits, noise: Noise, error: float, tolerance: float) -> _Latest:
    """The trend of the last third.

    There, and in the stretch before, the differences of successive cycles, along the pattern of the change, are
    averaged in halves: M before, A, B. The drift goes on when their average is not 0 and B >= `LASTING` A; it fades
    when B <= `FADING` A and A <= `FADING` M, by more than noise, and B / A >= `STEADY` A / M, as A / M to the ratio
    before. Where
    differences with changing signs are larger, these are looked at, and what goes on alternates.
    """
    # Does the last third change at all, or may a change be hidden in the noise?
    k = len(visits)
    count = max(3, -(-(k - 1) // 3))
    tail = visits.last(count + 1)
    line = tail.slope
    seen = _change(tail, noise, error)
    limit = quantile(error / (SHAPES * noise.each.size), noise.dof)
    hidden = limit * float((noise.each * visits.lever).max()) * float(np.linalg.norm(line))
    hidden += float((LEAF_SLOPE * shifts(line[None], tail.moves, noise.moves)).max())
    nothing = (np.nan, (np.nan, np.nan), count)
    most = hidden * count + (seen.size if seen.seen > 1 else 0.0)
    rest = Trend.NONE if most <= tolerance else Trend.CANNOT_TELL
    if seen.seen <= 1:
        return _Latest(rest, nothing)
    # The change over all cycles along its pattern, and how much of a weighted sum of it is noise.
    series = visits.y.reshape(k, -1) @ seen.pattern.ravel()
    level, dof = float(((seen.pattern * noise.each) ** 2).sum()), noise.dof  # if phases scatter each by itself
    if k >= FEWEST:
        left, few = left_over(series[:, None])
        level, dof = max(float((left**2).sum()), float(((seen.pattern * visits.noise) ** 2).sum())), few + PRIOR
    deviation, times = np.sqrt(level), quantile(error, dof)
    weight = np.abs(seen.pattern).sum(axis=1)

    def bound(w: Vector) -> float:
        """What noise and shifts of the tool's path make of w . series."""
        by_shifts = LEAF_SLOPE * float(weight @ shifts(w[None], visits.moves, noise.moves)[0])
        return times * float(deviation * np.linalg.norm(w)) + by_shifts

    # The differences of successive cycles, or with changing signs where these are larger, averaged in halves.
    steps = np.diff(np.eye(k), axis=0)
    swings = steps * (-1.0) ** np.arange(k - 1)[:, None]
    alternates = abs(swings[-count:].mean(axis=0) @ series) > abs(steps[-count:].mean(axis=0) @ series)
    steps = swings if alternates else steps
    half, apart = count // 2, count - count // 2
    whole, late, early = steps[-count:].mean(axis=0), steps[-half:].mean(axis=0), steps[-count:][:half].mean(axis=0)
    sign = np.sign(whole @ series)
    a, b = float(sign * early @ series), float(sign * late @ series)
    if sign * whole @ series <= bound(whole) or a <= 0:
        return _Latest(rest, nothing)
    # The factor from one difference to the next, with its interval.
    error_of = bound(late - b / a * early) / a
    factors = [float(max(share, 0.0) ** (1 / apart)) for share in (b / a - error_of, b / a, b / a + error_of)]
    low, ratio, high = [-f for f in factors[::-1]] if alternates else factors
    facts = (ratio, (low, high), count)
    speed = float(np.abs(np.einsum("pnd,pd->pn", visits.axes, seen.pattern)).max() * (sign * whole @ series))
    # It goes on when the second half is nearly as large as the first; it fades when three stretches fall steadily.
    lasting = late - LASTING * early
    if sign * lasting @ series >= bound(lasting):
        if not alternates and speed * HORIZON <= tolerance:
            return _Latest(Trend.NONE, facts)
        return _Latest(Trend.ALTERNATES if alternates else Trend.GOES_ON, facts)
    if k - 1 >= count + apart:
        starts = range(k - 1 - count - apart, -1, -apart)
        before = [steps[i : i + half].mean(axis=0) for i in starts[:2]]  # as far apart as A and B
        means = [b, a, *(float(sign * w @ series) for w in before)]
        convex = all(x * z >= STEADY * y * y for x, y, z in zip(means, means[1:], means[2:], strict=False))
        falls = [FADING * early - late, FADING * before[0] - early]
        if convex and all(sign * w @ series >= bound(w) for w in falls):
            return _Latest(Trend.FADES, facts)
    return _Latest(rest, facts)


def _change(visits: Visits, noise: Noise, error: float, *, steps: bool = False) -> _Change:
    """The change over the cycles, of the shapes of `RATIOS` and of steps, that stands out of the noise most.

    Its size is that of its shape. What is sure whatever the shape is a difference of two weighted averages of cycles:
    visits along s, |s| = 1, differ by |s . y| range(s) if they change as s does, and surely by 2 |s . y| / sum |s|.
    """
    k, phases, d = visits.y.shape
    count = SHAPES + k // STEPS if steps else SHAPES
    limit = quantile(error / (count * phases * d), noise.dof)
    shapes = shapes_of(RATIOS, np.arange(k, dtype=float))
    shapes = np.vstack([shapes, steps_of(k)]) if steps else shapes
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    ranges = np.ptp(shapes, axis=1)
    moved = LEAF_SLOPE * shifts(shapes, visits.moves, noise.moves)
    along = np.abs(np.einsum("rk,kpd->rpd", shapes, visits.y)) - moved[:, :, None]
    held = np.maximum(along, 0.0) / np.maximum(limit * noise.each, 1e-300)
    surely = ((along - limit * noise.each) * visits.lever).max(axis=(1, 2))
    mean = np.zeros((len(shapes), d))
    if np.isfinite(noise.average_dof):
        bound = quantile(error / (count * d), noise.average_dof) * noise.average
        along = np.abs(shapes @ visits.y.mean(axis=1)) - moved.mean(axis=1)[:, None]
        mean = np.maximum(along, 0.0) / np.maximum(bound, 1e-300)
        surely = np.maximum(surely, ((along - bound) * visits.lever.min(axis=0)).max(axis=1))
    seen = np.maximum(held.max(axis=(1, 2)), mean.max(axis=1))
    best = int(np.argmax(seen))
    pattern = np.einsum("k,kpd->pd", shapes[best], visits.y)  # of the change over the phases, where it is seen
    size = float(np.abs(np.einsum("pd,pnd->pn", pattern, visits.axes)).max() * ranges[best])
    most = (np.abs(pattern) + moved[best][:, None] + limit * noise.each) * visits.lever
    ends = (min(max(float(surely[best] * ranges[best]), 0.0), size), float(most.max() * ranges[best]))
    sure = max(float((2 * surely / np.abs(shapes).sum(axis=1)).max()), ends[0])
    single = held[best].max() >= mean[best].max()
    pattern = pattern * (held[best] >= 0.5 * seen[best]) if single else pattern
    pattern = pattern / max(float(np.linalg.norm(pattern)), 1e-300)
    return _Change(float(seen[best]), int(np.argmax(held[best].max(axis=1))), pattern, size, ends, sure)


def _rates(visits: Visits, deviation: Matrix, limit: float, creep: Vector) -> tuple[Matrix, Matrix, Matrix]:
    """Drift of the last third of the cycles at each phase (P, n), its half interval by noise and by what shifts of the
    tool's path make of it, `creep`, and how much it changed since the last two thirds [joint units a cycle]."""
    k = len(visits)
    third = max(3, -(-(k - 1) // 3))

    tail, longer = visits.last(min(third + 1, k)), visits.last(min(2 * third + 1, k))
    rates, before = (np.einsum("k,kpn->pn", part.slope, part.joints) for part in (tail, longer))
    spread = limit * np.einsum("pnd,pd->pn", np.abs(visits.axes), deviation)
    return rates, float(np.linalg.norm(tail.slope)) * spread + creep[:, None], np.abs(rates - before)


def _needed(deviation: float, tolerance: float, error: float, stride: float) -> int:
    """Cycles, `stride` apart, that show a drift of the tolerance a cycle in noise of this deviation."""
    ratio = 12 * (quantile(error, np.inf) * deviation / (tolerance * stride)) ** 2
    return max(2, int(np.ceil(ratio ** (1 / 3))) + 1)
