"""The scatter of postures at equal tool poses over the cycles of a log, and shapes that it would not take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Matrix, Vector
from .visits import Visits

CONFIDENCE = 0.99
"""Two-sided, for all phases, directions and groups of cycles of a log together: of a hundred logs in which nothing
changes one may show a change. Less would find drifts in a fleet's daily logs; more needs longer logs."""

LEAF_SLOPE = 1.5
"""How far spare joints may move beside those that follow a tool path which itself shifts. A law that repeats moves them
too: with up to 1.76 times the least joint speed (docs/drift.md), so sqrt(1.76^2 - 1) times as far."""

SHIFT = 2.0
"""Deviations of the noise in the moves to a pose up to which they do not show a shift of the tool's path."""

SHAPES = 6
"""Independent shapes over the cycles that noise can take for a change: the fitted curves run from a jump in the first
cycle through a drift to an alternation, and the tube about such a curve holds as much noise as six directions do."""

STEPS = 2
"""Steps, one after each cycle, are worth one more such direction for so many cycles: in white noise of 5 to 80 cycles
the largest of all shapes is as large as that of SHAPES + k / STEPS, or of fewer, with an error of 1 % or 0.1 %."""

PRIOR = 2
"""Degrees of freedom that the encoder noise, known from all samples, is worth beside the scatter of few cycles."""

FEWEST = 5
"""Cycles from which their scatter about a fit of four numbers can be measured; with fewer, encoder noise stands in."""

THIRD = 20.0
"""Sum of the squared binomials of a third difference: the variance that white noise of variance 1 gives it."""

ALIKE_THIRDS = 2.3
"""Third differences of white noise that are worth one degree of freedom: 1 + 2 (0.75^2 + 0.3^2 + 0.05^2)."""

ALIKE = 0.5
"""Correlation of the scatter of successive cycles beyond which they may be steps of a random walk, which looks like a
trend of its sums but not of its steps."""

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
    found = [(left, float(k - 4), float(k - 4)) for left in (residual(y), y - np.outer(step, step @ y))]
    found += [(third, float(k - 3), (k - 3) / ALIKE_THIRDS)]
    found += [(late, float(len(late)), len(late) / ALIKE_THIRDS)] if len(third) >= FEWEST else []
    sizes = [float((left**2).sum()) / count * quantile(1 - CONFIDENCE, dof + PRIOR) ** 2 for left, count, dof in found]
    left, count, dof = found[int(np.argmin(sizes))]
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
            size, left = float(series @ series), float(_misfits(series, ratios).min())
        explained = np.sqrt(max(size - left, 0.0) / max(left / free, 1e-300))
        if explained > quantile(error / number, free):
            return True
    return False


def _misfits(series: Vector, ratios: Vector) -> Vector:
    """Sum of squares that the best a + b (1 - r^c) / (1 - r) leaves of a series without mean (k,), for each r."""
    c = np.arange(len(series), dtype=float)
    shapes = shapes_of(ratios, c)
    return series @ series - (shapes @ series) ** 2 / (shapes**2).sum(axis=1)


def quantile(error: float, dof: float) -> float:
    """Deviations that noise exceeds with the probability `error`, both sides together."""
    from scipy.special import ndtri, stdtrit

    return float(-ndtri(error / 2) if np.isinf(dof) else -stdtrit(dof, error / 2))
