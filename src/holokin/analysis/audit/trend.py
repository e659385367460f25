"""How the joints at equal tool poses go on over the cycles of a log: the trend, judged on the last third."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ...base.types import Matrix, NoTruthValue, Vector
from .scatter import (
    ALIKE,
    CONFIDENCE,
    FEWEST,
    LEAF_SLOPE,
    PRIOR,
    RATIOS,
    SHAPES,
    STEPS,
    Noise,
    left_over,
    quantile,
    scatter,
    shaped,
    shapes_of,
    shifts,
    steps_of,
)
from .visits import Visits

HORIZON = 1000
"""Cycles within which a steady drift must reach the tolerance to count: a day or two of a usual robot's work."""

LASTING = 0.95
"""A drift goes on when the second half of the last third of the cycles drifts by no less than this share of the first
half. Joints that converge like 1/k have 0.7 there, a decay of the drift to a half over the log 0.9."""

FADING = 0.75
"""It fades when that share is no more than this, and that of the stretch before, too: at least like 1/sqrt(k)."""

STEADY = 0.9
"""And when it does not fall faster and faster, as a drift does that is about to turn round: each share is at least this
share of the one before. A decay has the same share again and again, and sums of decays, and powers, a growing one."""


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
    k, phases, d = visits.y.shape
    error = (1 - CONFIDENCE) * share / 2  # half for single phases, half for their average
    noise = scatter(visits)
    shapes = SHAPES + k // STEPS
    limit = quantile(error / (shapes * phases * d), noise.dof)
    seen = _change(visits, noise, error, steps=True)
    line = (visits.when - visits.when.mean()) / ((visits.when - visits.when.mean()) ** 2).sum()
    deviation = float((noise.each * visits.lever).max())
    creep = LEAF_SLOPE * shifts(line[None], visits.moves, noise.moves)[0]
    detectable = max(float(creep.max()) + limit * deviation * float(np.linalg.norm(line)), rounding)
    needed = _needed(deviation, tolerance, error / (shapes * phases * d), float(np.mean(np.diff(visits.when))))

    def found(trend: Trend, change: float, latest: _Latest | None = None, more: int = 0) -> DriftTrend:
        rates, errors, bends = _rates(visits, noise.each, limit, creep)
        ratio, among, count = (np.nan, (np.nan, np.nan), 0) if latest is None else latest.facts
        return DriftTrend(
            trend, change, seen.ends if change else (0.0, 0.0), seen.sure > tolerance, ratio, among, count,
            seen.phase, rates, errors, bends, detectable, float(creep.max()), max(needed, more),
        )  # fmt: skip

    if seen.seen <= 1 or (k < FEWEST and seen.size <= tolerance + floor):
        return found(Trend.NONE, 0.0) if detectable <= tolerance else found(Trend.CANNOT_TELL, 0.0, more=k + k // 2)
    small = max(seen.ends[1], seen.sure) <= tolerance and detectable <= tolerance
    series = visits.y.reshape(k, -1) @ seen.pattern.ravel()
    if k < 4 or not shaped(series, error, walks=noise.alike > ALIKE):
        return found(Trend.NONE if small else Trend.CANNOT_TELL, seen.size, more=0 if small else 2 * k)
    latest = _latest(visits, noise, error, tolerance)
    if latest.trend is Trend.CANNOT_TELL and not small:
        return found(Trend.CANNOT_TELL, seen.size, latest, more=2 * k)
    if latest.trend in (Trend.GOES_ON, Trend.ALTERNATES) or small:
        lasts = latest.trend is Trend.GOES_ON or (latest.trend is Trend.ALTERNATES and not small)
        return found(latest.trend if lasts else Trend.NONE, seen.size, latest)
    return found(Trend.FADES, seen.size, latest)  # of its own, or since the last third rests


@dataclass(frozen=True, eq=False)
class _Latest:
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
    k = len(visits)
    count = max(3, -(-(k - 1) // 3))
    tail = visits.last(count + 1)
    line = (tail.when - tail.when.mean()) / ((tail.when - tail.when.mean()) ** 2).sum()
    seen = _change(tail, noise, error)
    limit = quantile(error / (SHAPES * noise.each.size), noise.dof)
    hidden = limit * float((noise.each * visits.lever).max()) * float(np.linalg.norm(line))
    hidden += float((LEAF_SLOPE * shifts(line[None], tail.moves, noise.moves)).max())
    nothing = (np.nan, (np.nan, np.nan), count)
    most = hidden * count + (seen.size if seen.seen > 1 else 0.0)
    rest = Trend.NONE if most <= tolerance else Trend.CANNOT_TELL
    if seen.seen <= 1:
        return _Latest(rest, nothing)
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
    error_of = bound(late - b / a * early) / a
    factors = [float(max(share, 0.0) ** (1 / apart)) for share in (b / a - error_of, b / a, b / a + error_of)]
    low, ratio, high = [-f for f in factors[::-1]] if alternates else factors
    facts = (ratio, (low, high), count)
    speed = float(np.abs(np.einsum("pnd,pd->pn", visits.axes, seen.pattern)).max() * (sign * whole @ series))
    kept = late - LASTING * early
    if sign * kept @ series >= bound(kept):
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
    least = ((along - limit * noise.each) * visits.lever).max(axis=(1, 2))
    mean = np.zeros((len(shapes), d))
    if np.isfinite(noise.average_dof):
        bound = quantile(error / (count * d), noise.average_dof) * noise.average
        along = np.abs(shapes @ visits.y.mean(axis=1)) - moved.mean(axis=1)[:, None]
        mean = np.maximum(along, 0.0) / np.maximum(bound, 1e-300)
        least = np.maximum(least, ((along - bound) * visits.lever.min(axis=0)).max(axis=1))
    seen = np.maximum(held.max(axis=(1, 2)), mean.max(axis=1))
    best = int(np.argmax(seen))
    pattern = np.einsum("k,kpd->pd", shapes[best], visits.y)  # of the change over the phases, where it is seen
    size = float(np.abs(np.einsum("pd,pnd->pn", pattern, visits.axes)).max() * ranges[best])
    most = (np.abs(pattern) + moved[best][:, None] + limit * noise.each) * visits.lever
    ends = (min(max(float(least[best] * ranges[best]), 0.0), size), float(most.max() * ranges[best]))
    sure = max(float((2 * least / np.abs(shapes).sum(axis=1)).max()), ends[0])
    single = held[best].max() >= mean[best].max()
    pattern = pattern * (held[best] >= 0.5 * seen[best]) if single else pattern
    pattern = pattern / max(float(np.linalg.norm(pattern)), 1e-300)
    return _Change(float(seen[best]), int(np.argmax(held[best].max(axis=1))), pattern, size, ends, sure)


def _rates(visits: Visits, deviation: Matrix, limit: float, creep: Vector) -> tuple[Matrix, Matrix, Matrix]:
    """Drift of the last third of the cycles at each phase (P, n), its half interval by noise and by what shifts of the
    tool's path make of it, `creep`, and how much it changed since the last two thirds [joint units a cycle]."""
    k = len(visits)
    third = max(3, -(-(k - 1) // 3))

    def slope(latest: int) -> tuple[Matrix, float]:
        when = visits.when[-latest:] - visits.when[-latest:].mean()
        rates = np.einsum("k,kpn->pn", when / (when @ when), visits.joints[-latest:])
        return rates, 1 / float(np.linalg.norm(when))

    (rates, share), (before, _) = slope(third + 1), slope(2 * third + 1)
    spread = limit * np.einsum("pnd,pd->pn", np.abs(visits.axes), deviation)
    return rates, share * spread + creep[:, None], np.abs(rates - before)


def _needed(deviation: float, tolerance: float, error: float, stride: float) -> int:
    """Cycles, `stride` apart, that show a drift of the tolerance a cycle in noise of this deviation."""
    ratio = 12 * (quantile(error, np.inf) * deviation / (tolerance * stride)) ** 2
    return max(2, int(np.ceil(ratio ** (1 / 3))) + 1)
