"""Joints at equal tool poses over the cycles of a log: equal, drifting, converging, alternating, undecided."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..types import Array, Matrix, Vector
from .visits import Visits

CONFIDENCE = 0.99
"""Two-sided, for all phases, directions and groups of cycles of a log together: of a hundred logs in which nothing
changes one may show a change. Less would find drifts in a fleet's daily logs; more needs longer logs."""

HORIZON = 1000
"""Cycles within which a steady drift must reach the tolerance to count: a day or two of a usual robot's work."""

LEAF_SLOPE = 1.5
"""How far spare joints may move beside those that follow a tool path which itself shifts. A law that repeats moves them
too: with up to 1.76 times the least joint speed (docs/drift.md), so sqrt(1.76^2 - 1) times as far."""

SHIFT = 2.0
"""Deviations of the noise in the moves to a pose up to which they do not show a shift of the tool's path."""

SHAPES = 6
"""Independent shapes over the cycles that noise can take for a change: the fitted curves run from a jump in the first
cycle through a drift to an alternation, and the tube about such a curve holds as much noise as six directions do."""

PRIOR = 2
"""Degrees of freedom that the encoder noise, known from all samples, is worth beside the scatter of few cycles."""

FEWEST = 5
"""Cycles from which their scatter about a fit of four numbers can be measured; with fewer, encoder noise stands in."""

FADED = 0.5
"""A drift that is less than this share of the first cycle's at the end of the log fades; one that is not goes on."""

ALIKE = 0.5
"""Correlation of the scatter of successive cycles beyond which they may be steps of a random walk, which looks like a
trend of its sums but not of its steps."""

_RATIOS = np.concatenate([-1 + np.linspace(0, 1, 41), 1 - np.logspace(-0.01, -5, 80), [1.0, 1.01, 1.02, 1.05]])
_BENT = 0.999  # ratios up to this differ from a straight line by more than round-off


class Trend(Enum):
    """How the joints at equal tool poses go on over the cycles."""

    ZERO = "no change beyond tolerance and noise"
    DECAYS = "the drift fades: the cycles converge"
    CONSTANT = "the drift goes on"
    ALTERNATES = "the joints alternate from cycle to cycle"
    UNDECIDED = "the log does not decide"


@dataclass(frozen=True, eq=False)
class DriftTrend:
    """Trend of cycles of one kind, judged at all phases.

    ratio: factor from one cycle's drift to the next, NaN where nothing changes, within `ratio_range`; phase: index of
    the phase that shows the change best; rates, errors (P, n): drift of the latest cycles at each phase and its half
    interval [joint units a cycle]; remaining (n,): what a fading drift has still to come at `phase`; change: largest
    joint change over the cycles; detectable: smallest drift at a single phase that these cycles would surely show
    [joint units a cycle]; creep: part of it that is due to shifts of the tool's own path; cycles_needed: cycles that
    would show a drift of the tolerance, or decide how a change goes on.
    """

    trend: Trend
    ratio: float
    ratio_range: tuple[float, float]
    phase: int
    rates: Matrix
    errors: Matrix
    remaining: Vector
    change: float
    detectable: float
    creep: float
    cycles_needed: int

    @property
    def rate(self) -> Vector:
        """Drift of the latest cycles where it shows best (n,) [joint units a cycle]."""
        return self.rates[self.phase]

    @property
    def rate_error(self) -> Vector:
        """Half interval of `rate` (n,)."""
        return self.errors[self.phase]


@dataclass(frozen=True, eq=False)
class _Noise:
    """Standard deviations: of each visit (P, d) and of their average over the phases (d,), with their degrees of
    freedom; of the joint moves to the pose (P,)."""

    each: Matrix
    dof: float
    average: Vector
    average_dof: float
    moves: Vector
    alike: float = 0.0  # correlation of the scatter of successive cycles


def judge(visits: Visits, tolerance: float, *, floor: float = 0.0, share: float = 1.0) -> DriftTrend:
    r"""Judge how visits at equal tool poses go on over the cycles.

    They are fitted by $a + b (1 - r^c) / (1 - r)$ over the cycle number c, with a and b of each phase and one r, since
    the map from one cycle to the next has the same factor at every phase: r = 1 is a steady drift, |r| < 1 converges,
    r = -1 alternates. A change must exceed the noise at one phase, or in the average of all, with `CONFIDENCE`. Noise
    is the scatter about the best a + b c + e r^c, at least that of the encoders, and more where successive cycles
    scatter alike. The interval of r then tells the trend; where it holds several, the trend is undecided.

    Args:
        tolerance: joint distance that counts as equal, and drift per cycle that must be excluded for `Trend.ZERO`.
        floor: joint distance that noise explains, where fewer than `FEWEST` cycles do not show their scatter.
        share: of the error probability 1 - `CONFIDENCE` that these visits may use.
    """
    k, phases, d = visits.y.shape
    c = np.arange(k, dtype=float)
    error = (1 - CONFIDENCE) * share / 2  # half for single phases, half for their average
    noise = _noise(visits)
    limit = quantile(error / (SHAPES * phases * d), noise.dof)
    shapes = _shapes(_RATIOS, c)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    shifts = LEAF_SLOPE * _shifts(shapes, visits.moves, noise.moves)
    along = np.abs(np.einsum("rk,kpd->rpd", shapes, visits.y)) - shifts[:, :, None]
    held = np.maximum(along, 0.0) / np.maximum(limit * noise.each, 1e-300)
    mean = np.zeros((len(shapes), d))
    if k >= FEWEST:
        bound = quantile(error / (SHAPES * d), noise.average_dof) * noise.average
        along = np.abs(shapes @ visits.y.mean(axis=1)) - shifts.mean(axis=1)[:, None]
        mean = np.maximum(along, 0.0) / np.maximum(bound, 1e-300)
    seen = np.maximum(held.max(axis=(1, 2)), mean.max(axis=1))
    best = int(np.argmax(seen))
    at = int(np.argmax(held[best].max(axis=1)))
    fit = np.einsum("k,kpd,pnd->pn", shapes[best], visits.y, visits.axes)
    change = float(np.abs(fit).max() * np.ptp(shapes[best]))
    line = (visits.when - visits.when.mean()) / ((visits.when - visits.when.mean()) ** 2).sum()
    deviation = float((noise.each * visits.lever).max())
    creep = LEAF_SLOPE * _shifts(line[None], visits.moves, noise.moves)[0]
    detectable = float(creep.max()) + limit * deviation * float(np.linalg.norm(line))
    needed = _needed(deviation, tolerance, error / (SHAPES * phases * d), float(np.mean(np.diff(visits.when))))

    def found(trend: Trend, ratio: float = np.nan, among: tuple[float, float] = (-1.0, 1.05), more: int = 0,
              left: Vector | None = None) -> DriftTrend:  # fmt: skip
        remaining = np.zeros(visits.axes.shape[1]) if left is None else left
        rates, errors = _rates(visits, noise.each, limit, creep, at)
        facts = (change, detectable, float(creep.max()), max(needed, more))
        return DriftTrend(trend, ratio, among, at, rates, errors, remaining, *facts)

    nothing = found(Trend.ZERO) if detectable <= tolerance else found(Trend.UNDECIDED, more=k + max(k // 2, 2))
    if seen[best] <= 1 or (k < FEWEST and change <= tolerance + floor):
        return nothing
    pattern = np.einsum("k,kpd->pd", shapes[best], visits.y)  # of the change over the phases, where it is seen
    pattern *= held[best] >= max(0.5 * seen[best], 1e-300) if held[best].max() >= mean[best].max() else 1.0
    pattern /= np.linalg.norm(pattern)
    series = visits.y.reshape(k, -1) @ pattern.ravel()
    ratio, (low, high), beneath, hidden = _ratio(visits, series, pattern, noise, share)
    if not _shaped(series, error, ratio, walks=noise.alike > ALIKE):
        return found(Trend.UNDECIDED, ratio, (low, high), more=2 * k)
    fading = FADED ** (1 / (k - 1))
    if low >= fading and not beneath:
        speed = change / (k - 1)
        return found(Trend.CONSTANT, ratio, (low, high)) if speed * HORIZON > tolerance else nothing
    later = judge(visits.tail, tolerance, floor=floor, share=share) if k >= FEWEST else None
    if later is not None and later.trend is Trend.CONSTANT:
        return found(Trend.CONSTANT, ratio, (low, high))
    if change <= tolerance:
        return nothing
    if beneath and hidden * HORIZON > tolerance:  # it fades, and something lasting or slower is seen beneath
        return found(Trend.UNDECIDED, ratio, (low, high), more=2 * k)
    if high <= -fading:
        return found(Trend.ALTERNATES, ratio, (low, high))
    converged = later is None or later.trend in (Trend.ZERO, Trend.DECAYS) or hidden <= tolerance
    if -fading <= low and high <= fading and converged:
        f = _shapes(np.array([ratio]), c)[0]
        b = f @ visits.y[:, at] / (f @ f)
        left = visits.axes[at] @ b * ratio ** (k - 1) / (1 - ratio)
        return found(Trend.DECAYS, ratio, (low, high), left=left)
    return found(Trend.UNDECIDED, ratio, (low, high), more=2 * k)


def _shapes(ratios: Vector, c: Vector) -> Matrix:
    """For each r, sums of a drift that changes by the factor r from cycle to cycle, after c cycles, less their mean."""
    r = np.asarray(ratios)[:, None]
    even = np.abs(1 - r) < 1e-9
    f = np.where(even, c, (1 - np.sign(r) ** c * np.abs(r) ** c) / np.where(even, 1.0, 1 - r))
    return f - f.mean(axis=1, keepdims=True)


def _shifts(shapes: Matrix, moves: Array, scatter: Vector) -> Matrix:
    """Size of each shape (R, k) in the moves (k, P, n), beyond `SHIFT` of their scatter (P,) -> (R, P)."""
    k, phases, n = moves.shape
    along = (shapes @ moves.reshape(k, -1)).reshape(len(shapes), phases, n)
    squares = np.einsum("rpn,rpn->rp", along, along) - np.outer((shapes**2).sum(axis=1), (SHIFT * scatter) ** 2)
    return np.sqrt(np.maximum(squares, 0.0))


def _noise(visits: Visits) -> _Noise:
    """Scatter about the best a + b c + e r^c, at least the encoder noise."""
    k, phases, d = visits.y.shape
    encoder = np.sqrt((visits.noise**2).mean(axis=0) / phases)
    if k < FEWEST:
        return _Noise(visits.noise, np.inf, encoder, np.inf, visits.move_noise)
    left, _ = _residual(visits.y.reshape(k, -1))
    free, total = k - 4, max(float((left**2).sum()), 1e-300)
    alike = float((left[1:] * left[:-1]).sum()) / total
    alike = min(alike + (2 + 4 * max(alike, 0.0)) / k, 0.95) if k >= 8 else 0.0  # what the fit took away
    serial = (1 + alike) / (1 - alike) if alike > 0 else 1.0
    rest = left.reshape(k, phases, d)
    own, pooled = serial * (rest**2).sum(axis=0) / free, serial * total / (free * phases * d)
    waves = np.abs(np.fft.fft(rest, axis=1)) ** 2
    correlation = np.fft.ifft(waves.sum(axis=(0, 2))).real / total  # of phases at each distance
    dof = max(free, free * phases / float((correlation**2).sum())) + PRIOR
    each = np.sqrt(np.maximum(np.maximum(own, pooled), visits.noise**2))
    average = np.sqrt(np.maximum(serial * (rest.mean(axis=1) ** 2).sum(axis=0) / free, encoder**2))
    moves, _ = _residual(visits.moves.reshape(k, -1) - visits.moves.reshape(k, -1).mean(axis=0))
    moves = moves.reshape(visits.moves.shape)
    scatter = np.sqrt((moves**2).sum(axis=(0, 2)) / free)
    return _Noise(each, dof, average, free + PRIOR, scatter, alike)


def _residual(y: Matrix) -> tuple[Matrix, float]:
    """What the best b c + e r^c, with one r, leaves of columns without mean (k, s), and its sum of squares."""
    c = np.arange(len(y), dtype=float)
    line = (c - c.mean()) / np.linalg.norm(c - c.mean())
    rest = y - np.outer(line, line @ y)

    def across(ratios: Vector) -> Matrix:
        curves = _shapes(ratios, c)
        curves = curves - np.outer(curves @ line, line)
        return curves / np.linalg.norm(curves, axis=1, keepdims=True)

    tries, ratio = np.sort(_RATIOS[_RATIOS < _BENT]), 0.0
    for _ in range(4):  # a coarse ratio would leave more than noise does
        held = across(tries) @ rest
        best = int(np.argmax((held**2).sum(axis=1)))
        ratio = tries[best]
        tries = np.linspace(tries[max(best - 1, 0)], tries[min(best + 1, len(tries) - 1)], 21)
    curve = across(np.array([ratio]))[0]
    rest = rest - np.outer(curve, curve @ rest)
    return rest, float((rest**2).sum())


def _shaped(series: Vector, error: float, ratio: float, walks: bool) -> bool:
    """Whether a change (k,) has a shape that scatter of unknown size would not take.

    What a drift, a jump after the first cycle or an alternation leaves of it, or with more cycles the best ratio, is
    small beside it. Where the joints may walk at random, the same is asked of their steps.
    """
    k = len(series)
    if k < 3:
        return False
    tests = [(np.array([1.0, 0.0, -1.0]), k - 2, 3), (np.append(_RATIOS, ratio), k - 3, SHAPES)]
    for ratios, free, number in tests[:1] if k < 4 else tests[1:] if walks else tests:
        if walks:
            steps = np.sign(ratios[:, None]) ** np.arange(k - 1) * np.abs(ratios[:, None]) ** np.arange(k - 1)
            size = float(np.diff(series) @ np.diff(series))
            left = size - float(((steps @ np.diff(series)) ** 2 / (steps**2).sum(axis=1)).max())
        else:
            size, left = float(series @ series), float(_misfits(series, ratios).min())
        explained = np.sqrt(max(size - left, 0.0) / max(left / free, 1e-300))
        if explained > quantile(error / number, free):
            return True
    return False


def _ratio(
    visits: Visits, series: Vector, pattern: Matrix, noise: _Noise, share: float
) -> tuple[float, tuple[float, float], bool, float]:
    """r of the change (k,) in a pattern (P, d) over the phases, and its interval; whether a drift beneath what fades is
    seen, a + b c + e r^c; the largest such drift that the data allow [joint units a cycle]."""
    k = len(series)
    tries = np.unique(np.concatenate([_RATIOS, np.linspace(-1, 1.05, 206)]))
    misfits = _misfits(series, tries)
    for _ in range(4):
        best = int(np.argmin(misfits))
        finer = np.linspace(tries[max(best - 1, 0)], tries[min(best + 1, len(tries) - 1)], 41)
        tries, order = np.unique(np.concatenate([tries, finer]), return_index=True)
        misfits = np.concatenate([misfits, _misfits(series, finer)])[order]
    best = int(np.argmin(misfits))
    variance, dof, left = float(((pattern * noise.each) ** 2).sum()), noise.dof, np.inf
    if k >= FEWEST:
        left = _residual(series[:, None])[1]
        variance, dof = max(variance, left / (k - 4)), float(k - 4 + PRIOR)
    bound = quantile((1 - CONFIDENCE) * share, dof) ** 2 * variance
    inside = tries[misfits <= misfits[best] + bound]
    hidden = np.inf
    if k >= FEWEST and inside[-1] < _BENT:
        c = np.arange(k, dtype=float)
        curves = _shapes(inside, c)
        line = c - c.mean()
        line = line - curves * ((curves @ line) / (curves**2).sum(axis=1))[:, None]  # across each curve
        sizes = (line**2).sum(axis=1)
        most = (np.abs(line @ series) / sizes + np.sqrt(bound / sizes)).max()
        hidden = float(most * np.abs(np.einsum("pd,pnd->pn", pattern, visits.axes)).max())
    return float(tries[best]), (float(inside[0]), float(inside[-1])), bool(misfits[best] - left > bound), hidden


def _misfits(series: Vector, ratios: Vector) -> Vector:
    """Sum of squares that the best a + b (1 - r^c) / (1 - r) leaves of a series without mean (k,), for each r."""
    c = np.arange(len(series), dtype=float)
    shapes = _shapes(ratios, c)
    return series @ series - (shapes @ series) ** 2 / (shapes**2).sum(axis=1)


def _rates(visits: Visits, deviation: Matrix, limit: float, creep: Vector, at: int) -> tuple[Matrix, Matrix]:
    """Drift at each phase (P, n) and its half interval [joint units a cycle].

    Of the latest quarter of the cycles, with what it changed since the latest half; of all cycles where the quarter
    does not show it at the phase `at`. Either may be off by what shifts of the tool's path make of it, `creep`.
    """
    k = len(visits)
    spread = limit * np.einsum("pnd,pd->pn", np.abs(visits.axes), deviation)

    def slope(latest: int) -> tuple[Matrix, float]:
        when = visits.when[-latest:] - visits.when[-latest:].mean()
        rates = np.einsum("k,kpn->pn", when / (when @ when), visits.joints[-latest:])
        return rates, 1 / float(np.linalg.norm(when))

    (rates, share), (before, _) = slope(max(4, k // 4 + 1)), slope(max(4, k // 2 + 1))
    errors = share * spread + np.abs(rates - before) + creep[:, None]
    if (np.abs(rates[at]) > errors[at]).any():
        return rates, errors
    rates, share = slope(k)
    return rates, share * spread + creep[:, None]


def _needed(deviation: float, tolerance: float, error: float, stride: float) -> int:
    """Cycles, `stride` apart, that show a drift of the tolerance a cycle in noise of this deviation."""
    ratio = 12 * (quantile(error, np.inf) * deviation / (tolerance * stride)) ** 2
    return max(2, int(np.ceil(ratio ** (1 / 3))) + 1)


def quantile(error: float, dof: float) -> float:
    """Deviations that noise exceeds with the probability `error`, both sides together."""
    from scipy.special import ndtri, stdtrit

    return float(-ndtri(error / 2) if np.isinf(dof) else -stdtrit(dof, error / 2))
