"""`TimeLaw`: how far along a curve one is at a time, s(t): quintic, time-optimal, and smoothed for jerk.

All laws but the quintic one have path accelerations that are constant, or linear in time, in pieces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Indices, Matrix, Value, Vector
from .joint_curve import Stretch

FINEST = 2_000
"""Most points a cycle at which the time-optimal law looks at the limits. Twice as many change the time by 1e-5."""

COARSEST = 600
"""Fewest of them; joint curves with fewer samples get points between these."""

FASTEST = 1e6
"""Rate over the slowest bound of it at which the law passes where nothing moves, and nothing is limited."""

STEPS_OF_RAMP, GROWTH = 64, 1.12
"""First interval of a grid as a share of the shortest ramp, and each interval over the one before."""


@dataclass(frozen=True, eq=False)
class TimeLaw(Value):
    """Polynomials in pieces: s = sum of c[j, i] (t - t_i)^j on [t_i, t_(i+1)], with t (pieces + 1,) from 0 [s]."""

    t: Vector
    c: Matrix

    @property
    def duration(self) -> float:
        """Seconds that the law takes."""
        return float(self.t[-1])

    def slower(self, factor: float) -> TimeLaw:
        """The same law in `factor` times the time."""
        return replace(self, t=factor * self.t, c=self.c / factor ** np.arange(len(self.c))[:, None])

    def at(self, t: Vector) -> list[Vector]:
        """[s, ds/dt, second, third derivative] at times (k,); before the start and after the end it rests."""
        index = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        found = self._on(index, np.clip(t, 0.0, self.duration) - self.t[index])
        rest = (t < 0.0) | (t > self.duration)
        return [found[0], *(np.where(rest, 0.0, f) for f in found[1:])]

    def within(self, count: int) -> tuple[Vector, list[Vector]]:
        """(t, `at`) at some `count` times, both ends of every piece among them, each as the piece itself has it."""
        h = np.diff(self.t)
        inner = np.maximum(5, np.ceil(count * h / self.duration).astype(int))
        index = np.repeat(np.arange(len(h)), inner)
        share = (np.arange(len(index)) - np.repeat(np.cumsum(inner) - inner, inner)) / (inner[index] - 1)
        return self.t[index] + share * h[index], self._on(index, share * h[index])

    def _on(self, index: Indices, x: Vector) -> list[Vector]:
        c, found = self.c, []
        for _ in range(4):
            value = np.zeros(len(x))
            for row in c[::-1]:
                value = value * x + row[index]
            found.append(value)
            c = c[1:] * np.arange(1, len(c))[:, None] if len(c) > 1 else np.zeros_like(c)
        return found


def quintic(length: float) -> TimeLaw:
    """s = L (10 x^3 - 15 x^4 + 6 x^5) with x = t: at rest, and without acceleration, at both ends; takes one second."""
    return TimeLaw(np.array([0.0, 1.0]), length * np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])[:, None])


def smoothed(law: TimeLaw, window: float) -> TimeLaw:
    """The moving average of a law of constant accelerations over a window [s]: its accelerations change evenly.

    It ends where the law ends, takes `window` longer, and its path jerk is at most the largest jump of two
    accelerations a window apart, divided by the window.
    """
    t = np.unique(np.concatenate([law.t, law.t + window]))
    t = t[np.concatenate([[True], np.diff(t) > 1e-12 * t[-1]])]
    t[-1] = law.duration + window
    middle = (t[:-1] + t[1:]) / 2
    jerk = (law.at(middle)[2] - law.at(middle - window)[2]) / window
    start = np.concatenate([[0.0], np.cumsum(jerk * np.diff(t))[:-1]])
    return of_accelerations(t, start, jerk, float(law.at(law.t[-1:])[0][0]))


def time_optimal(
    stretch: Stretch,
    laps: int,
    velocity: Vector,
    acceleration: Vector,
    jerk: Vector,
    speed: float,
    bare: TimeLaw | None = None,
) -> TimeLaw:
    """The fastest law from rest to rest over some laps of a stretch, by reachability [PP18], that keeps ds/dt <= speed.

    Where the curve alone, at even ds/dt, would take more than half of a joint's jerk, ds/dt is bounded so that it
    does not: |d^3 q / ds^3| (ds/dt)^3 <= jerk / 2.

    Args:
        bare: the law without a limit of jerk: then accelerations are bounded to what is worth while under one,
            see `_gentle`.

    Raises:
        ArgumentError: none was found.
    """
    grid = _grid(stretch)
    _, d1, d2, d3 = stretch.derivatives(grid)
    with np.errstate(divide="ignore"):
        unit = 1.0 / float(
            np.minimum(_caps(d1, d3, velocity, jerk, speed), np.sqrt(acceleration / np.abs(d2)).min(axis=1)).min()
        )
    unit = unit if unit > 0.0 else float(np.sqrt((np.abs(d1) / acceleration).max() / stretch.length))
    s = np.concatenate([[0.0], *(grid[1:] + lap * stretch.length for lap in range(laps))])
    s = _graded(stretch, s, velocity, acceleration, jerk, speed)
    _, d1, d2, d3 = stretch.derivatives(s)
    caps = _caps(d1, d3, velocity, jerk, speed)
    less = np.ones(len(s)) if bare is None else _gentle(bare, s, d1, jerk)
    rates = _fastest(s, d1, d2, less[:, None] * acceleration, np.minimum(caps, FASTEST / unit))
    if not np.isfinite(rates).all() or not (rates[:-1] + rates[1:]).min() > 0:
        raise ArgumentError("the limits", acceleration.tolist(), "no motion was found within them: give larger ones")
    h = 2 * np.diff(s) / (rates[:-1] + rates[1:])
    t = np.concatenate([[0.0], np.cumsum(h)])
    c = np.vstack([s[:-1], rates[:-1], np.diff(rates) / h / 2])
    return TimeLaw(t, c)


def _caps(d1: Matrix, d3: Matrix, velocity: Vector, jerk: Vector, speed: float) -> Vector:
    with np.errstate(divide="ignore"):
        most = np.minimum(speed, (velocity / np.abs(d1)).min(axis=1))
        return np.minimum(most, np.cbrt(0.5 * jerk / np.abs(d3)).min(axis=1))


def _graded(stretch: Stretch, s: Vector, velocity: Vector, acceleration: Vector, jerk: Vector, speed: float) -> Vector:
    """The grid with more points where a law begins and ends, dense enough for the ramps there.

    A ramp at the least acceleration of the joints to the rate v that is allowed takes v^2 / (2 a) of the way. The grid
    begins with a share of that, and each interval is longer than the last one by the same factor.
    """
    found = [s]
    _, d1, _, d3 = stretch.derivatives(s[[0, -1]])
    for end, rate, fall in zip((0, 1), _caps(d1, d3, velocity, jerk, speed), np.abs(d1), strict=True):
        ramp = rate**2 * float((fall / acceleration).max()) / 2
        widest = s[1] if end == 0 else s[-1] - s[-2]
        first = ramp / STEPS_OF_RAMP
        if 0.0 < first < widest:
            steps = first * GROWTH ** np.arange(int(np.log(widest / first) / np.log(GROWTH)) + 1)
            off = np.cumsum(steps)
            off = off[off < s[-1] / 2]
            found.append(s[-1] - off if end else off)
    joined = np.unique(np.concatenate(found))
    return joined[np.concatenate([[True], np.diff(joined) > 1e-13 * joined[-1]])]


def _gentle(bare: TimeLaw, s: Vector, d1: Matrix, jerk: Vector) -> Vector:
    """Shares (k,) of the accelerations to which a law is bounded before it is smoothed.

    A change of the rate by v at the acceleration a, smoothed over a / j, takes v / a + a / j: least at a = sqrt(v j).
    More acceleration is no gain; so it is bounded by that in each part of the law that only speeds up, or slows down.
    """
    h, a = np.diff(bare.t), 2 * bare.c[2]
    start = bare.c[0]
    with np.errstate(divide="ignore"):
        allowed = (jerk / np.abs(d1)).min(axis=1)
    side = np.sign(a) * (np.abs(a) > 1e-6 * np.abs(a).max())
    edges = np.flatnonzero(np.diff(side)) + 1
    less = np.ones(len(s))
    for part in np.split(np.arange(len(a)), edges):
        if side[part[0]] == 0:
            continue
        v, peak = abs(float((a[part] * h[part]).sum())), float(np.abs(a[part]).max())
        low, high = start[part[0]], start[part[-1] + 1] if part[-1] + 1 < len(start) else s[-1]
        inside = (s >= low) & (s <= high)
        share = min(1.0, float(np.sqrt(v * allowed[inside].min())) / peak)
        longer = (high - low) / share
        less[(s >= low - longer) & (s <= high + longer)] *= share
    return np.maximum(less, 1e-6)


def _fastest(s: Vector, d1: Matrix, d2: Matrix, acceleration: Matrix, most: Vector) -> Vector:
    """ds/dt (k,) at s (k,), the greatest from rest to rest with |q''| <= acceleration (k, n) and ds/dt <= most [PP18].

    With an even path acceleration u between two points, x = (ds/dt)^2 goes over into y = x + 2 h u, and the joints have
    q'' = d1 u + d2 x at the first point and d1 u + d2 y at the second: |a x + b y| <= 1, a row a joint and a point. All
    such rows hold for x = y = 0. So from 0 to some greatest x the end can be reached at rest.
    """
    h = 2 * np.diff(s)[:, None]
    e1, e2 = d1 / acceleration, d2 / acceleration
    a = np.hstack([e2[:-1] - e1[:-1] / h, -e1[1:] / h])
    b = np.hstack([e1[:-1] / h, e2[1:] + e1[1:] / h])
    with np.errstate(divide="ignore", invalid="ignore"):
        p, q = 1 / np.abs(a), 1 / np.abs(b)
        r, w = np.where(a == 0, 0.0, b / a), np.where(b == 0, 0.0, a / b)
    bound = most**2

    # The greatest x of each interval, whatever follows: that which two rows allow, or one and the bounds of x and y.
    x = np.minimum(bound[:-1], np.maximum(p, p - r * bound[1:, None]).min(axis=1))
    for k in range(1, a.shape[1]):
        crossed = np.abs(a[:, k:] * b[:, :-k] - a[:, :-k] * b[:, k:])
        both = np.abs(b[:, k:]) + np.abs(b[:, :-k])
        x = np.minimum(x, np.divide(both, crossed, out=np.full_like(both, np.inf), where=crossed > 0).min(axis=1))
    # The least y that it goes over into: up to there a greater y allows a greater x.
    y = np.clip(np.where(b == 0, 0.0, -q - w * x[:, None]).max(axis=1), 0.0, bound[1:])

    # Backward: the greatest x from which the next point's can be reached.
    reach = np.append(x, 0.0)
    for i in range(len(h) - 1, -1, -1):
        reach[i] = min(x[i], np.minimum.reduce(p[i] - r[i] * min(y[i], reach[i + 1])))
    # Forward: the greatest x that can be reached.
    x = np.zeros(len(s))
    for i in range(len(h)):
        x[i + 1] = max(0.0, min(reach[i + 1], np.minimum.reduce(q[i] - w[i] * x[i])))
    return np.sqrt(x)


def _grid(stretch: Stretch) -> Vector:
    """Points of s: all samples with as many between as make it fine; evenly spread where the samples are too many."""
    count = len(stretch.s) - 1
    if count > FINEST:
        return np.linspace(0.0, stretch.length, FINEST + 1)
    parts = -(-COARSEST // count)
    share = np.arange(parts) / parts
    inner = stretch.s[:-1, None] + share * np.diff(stretch.s)[:, None]
    return np.append(inner.ravel(), stretch.length)


def of_accelerations(t: Vector, a: Vector, jerk: Vector, length: float) -> TimeLaw:
    """The law from rest of accelerations a + jerk (t - t_i) in pieces, made to end at s = length."""
    h = np.diff(t)
    v = np.concatenate([[0.0], np.cumsum(h * (a + h * jerk / 2))[:-1]])
    s = np.concatenate([[0.0], np.cumsum(h * (v + h * (a / 2 + h * jerk / 6)))])
    return TimeLaw(t, np.vstack([s[:-1], v, a / 2, jerk / 6]) * (length / s[-1]))
