"""`retime`: the joint curve of a trajectory and the scalings of time along it, within the limits of the joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import HUGE, ArrayLike, Flags, Indices, Matrix, Value, Vector, numbers, positive, whole
from ..path.path import Poses, distinct
from ..robot import GIVE_SPEEDS, speed_limits
from .timed_trajectory import RATES, Limits, Profile, Slowdown, TimedTrajectory
from .trajectory import Status, Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 5
"""Of the splines: up to the third derivative they have no jumps, so that jerks are defined."""

CLOSED = 1e-12
"""Difference [joint units] between the starts of cycles up to which one cycle stands for all: that of round-off. A
controller at 1 kHz sees it as an acceleration of 1e-6."""


@dataclass(frozen=True, eq=False)
class Stretch(Value):
    """A smooth part of a curve: a spline through samples q (k, n) at s (k,), from 0; `round`: its end is its start.

    s is the time of the untimed trajectory: s runs as a clock when the tool keeps the speed of its path.
    """

    s: Vector
    q: Matrix
    round: bool = False

    def __post_init__(self) -> None:
        from scipy.interpolate import make_interp_spline

        super().__post_init__()
        degree = min(DEGREE, len(self.s) - 1)
        q, bounds = self.q, None
        if self.round and degree == DEGREE:
            q, bounds = np.vstack([self.q[:-1], self.q[:1]]), "periodic"
        odd = degree - (degree in (2, 4))  # even splines are not uniquely given by their samples
        object.__setattr__(self, "_spline", make_interp_spline(self.s, q, odd, bc_type=bounds))

    @property
    def length(self) -> float:
        """Where s ends [s]."""
        return float(self.s[-1])

    def derivatives(self, s: Vector, most: int = 3) -> list[Matrix]:
        """[q, dq/ds, ... to the order `most`], each (k, n); a round stretch goes on from its start beyond its end."""
        inside = np.clip(s - self.length * np.floor(s / self.length) * self.round, 0.0, self.length)
        spline: BSpline = self.__dict__["_spline"]
        return [np.asarray(spline(inside, order)) for order in range(most + 1)]

    def motion(self, s: Vector, rates: list[Vector]) -> list[Matrix]:
        """[q, dq, ddq, dddq] of q(s(t)) from s and its three derivatives in time, by the chain rule."""
        q, d1, d2, d3 = self.derivatives(s)
        v, a, j = (rate[:, None] for rate in rates)
        return [q, d1 * v, d2 * v**2 + d1 * a, d3 * v**3 + 3 * d2 * v * a + d1 * j]

    def __setstate__(self, state: dict[str, object]) -> None:
        super().__setstate__(state)
        self.__post_init__()


@dataclass(frozen=True, eq=False)
class JointCurve(Value):
    """The stretches of one cycle, or of all cycles where no two are alike; between them the joints must stand still."""

    stretches: tuple[Stretch, ...]
    repeats: bool

    @property
    def smooth(self) -> bool:
        """True of a cycle that can be run again and again without a stop."""
        return len(self.stretches) == 1 and self.stretches[0].round


def joint_curve(trajectory: Trajectory) -> JointCurve:
    """The curve of a trajectory. Raises: ArgumentError: it did not reach its end, or has no two samples."""
    if trajectory.status is not Status.COMPLETE:
        cure = "time one that was followed to its end"
        raise ArgumentError("the trajectory", trajectory.status.cause, cure)
    if len(trajectory) < 2:
        raise ArgumentError("the samples of the trajectory", len(trajectory), "give at least two")
    if not np.ptp(trajectory.q, axis=0).any():
        raise ArgumentError("the motion of the joints", 0.0, "they all stand still: there is nothing to time")
    # One cycle where all are alike, else all of it.
    marks = list(trajectory.marks)
    repeats = len(marks) > 1 and bool(np.abs(trajectory.q[marks] - trajectory.q[0]).max() <= CLOSED)
    last = marks[1] if repeats else len(trajectory) - 1
    t, q = trajectory.t[: last + 1], trajectory.q[: last + 1]
    # Without samples that repeat the one before, as of a piece of path that is very short.
    rows = distinct(Poses(q, None), t)[1]
    rows[-1] = last
    # Stretches from corner to corner.
    corners = np.searchsorted(rows, [k for k in trajectory.corners if 0 < k < last], side="right") - 1
    ends = np.unique([0, *corners, len(rows) - 1]).tolist()
    turns_round = repeats and len(ends) == 2 and 0 not in trajectory.corners
    t, q = t[rows], q[rows]
    stretches = [Stretch(t[a : b + 1] - t[a], q[a : b + 1], turns_round) for a, b in pairwise(ends)]
    return JointCurve(tuple(stretches), repeats)


# --- `TimeScaling`: how far along a curve one is at a time, s(t): quintic, time-optimal, and smoothed for jerk.
#
# All scalings but the quintic one have path accelerations that are constant, or linear in time, in pieces.

FINEST = 2_000
"""Most points a cycle at which the time-optimal scaling looks at the limits. Twice as many change the time by 1e-5."""


@dataclass(frozen=True, eq=False)
class TimeScaling(Value):
    """Polynomials in pieces: s = sum of c[j, i] (t - t_i)^j on [t_i, t_(i+1)], with t (pieces + 1,) from 0 [s]."""

    t: Vector
    c: Matrix

    @property
    def duration(self) -> float:
        """Seconds that the scaling takes."""
        return float(self.t[-1])

    def slower(self, factor: float) -> TimeScaling:
        """The same scaling in `factor` times the time."""
        return replace(self, t=factor * self.t, c=self.c / factor ** np.arange(len(self.c))[:, None])

    def at(self, t: Vector) -> list[Vector]:
        """[s, ds/dt, second, third derivative] at times (k,); before the start and after the end it rests."""
        index = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        derivatives = self._on(index, np.clip(t, 0.0, self.duration) - self.t[index])
        rest = (t < 0.0) | (t > self.duration)
        return [derivatives[0], *(np.where(rest, 0.0, f) for f in derivatives[1:])]

    def within(self, count: int) -> tuple[Vector, list[Vector]]:
        """(t, `at`) at some `count` times, both ends of every piece among them, each as the piece itself has it."""
        h = np.diff(self.t)
        inner = np.maximum(5, np.ceil(count * h / self.duration).astype(int))
        index = np.repeat(np.arange(len(h)), inner)
        share = (np.arange(len(index)) - np.repeat(np.cumsum(inner) - inner, inner)) / (inner[index] - 1)
        return self.t[index] + share * h[index], self._on(index, share * h[index])

    def _on(self, index: Indices, x: Vector) -> list[Vector]:
        c, derivatives = self.c, []
        for _ in range(4):
            value = np.zeros(len(x))
            for row in c[::-1]:
                value = value * x + row[index]
            derivatives.append(value)
            c = c[1:] * np.arange(1, len(c))[:, None] if len(c) > 1 else np.zeros_like(c)
        return derivatives


def quintic(length: float) -> TimeScaling:
    """s = L (10 x^3 - 15 x^4 + 6 x^5) with x = t: at rest, and without acceleration, at both ends; takes one second."""
    return TimeScaling(np.array([0.0, 1.0]), length * np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])[:, None])


def smoothed(scaling: TimeScaling, window: float) -> TimeScaling:
    """The moving average of a scaling of constant accelerations over a window [s]: its accelerations change evenly.

    It ends where the scaling ends, takes `window` longer, and its path jerk is at most the largest jump of two
    accelerations a window apart, divided by the window.
    """
    t = np.unique(np.concatenate([scaling.t, scaling.t + window]))
    t = t[np.concatenate([[True], np.diff(t) > 1e-12 * t[-1]])]
    t[-1] = scaling.duration + window
    middle = (t[:-1] + t[1:]) / 2
    jerk = (scaling.at(middle)[2] - scaling.at(middle - window)[2]) / window
    start = np.concatenate([[0.0], np.cumsum(jerk * np.diff(t))[:-1]])
    return _of_accelerations(t, start, jerk, float(scaling.at(scaling.t[-1:])[0][0]))


def time_optimal(
    stretch: Stretch,
    laps: int,
    velocity: Vector,
    acceleration: Vector,
    jerk: Vector,
    speed: float,
    bare: TimeScaling | None = None,
) -> TimeScaling:
    """The fastest scaling from rest to rest over some laps of a stretch, by reachability [PP18], that keeps ds/dt <=
    speed.

    Where the curve alone, at even ds/dt, would take more than half of a joint's jerk, ds/dt is bounded so that it
    does not: |d^3 q / ds^3| (ds/dt)^3 <= jerk / 2.

    Args:
        bare: the scaling without a limit of jerk: then accelerations are bounded to what is worth while under one,
            see `_gentle`.

    Raises:
        ArgumentError: none was found.
    """
    # The slowest bound of the rate on the grid, in which a rate is measured where nothing is limited.
    grid = _grid(stretch)
    _, d1, d2, d3 = stretch.derivatives(grid)
    with np.errstate(divide="ignore"):
        bounds = np.minimum(_caps(d1, d3, velocity, jerk, speed), np.sqrt(acceleration / np.abs(d2)).min(axis=1))
        unit = 1.0 / float(bounds.min())
    unit = unit if unit > 0.0 else float(np.sqrt((np.abs(d1) / acceleration).max() / stretch.length))
    # All laps, with more points where the motion begins and ends; the fastest rates there.
    s = np.concatenate([[0.0], *(grid[1:] + lap * stretch.length for lap in range(laps))])
    s = _graded(stretch, s, velocity, acceleration, jerk, speed)
    _, d1, d2, d3 = stretch.derivatives(s)
    caps = _caps(d1, d3, velocity, jerk, speed)
    share = np.ones(len(s)) if bare is None else _gentle(bare, s, d1, jerk)
    rates = _fastest(s, d1, d2, share[:, None] * acceleration, np.minimum(caps, 1e6 / unit))
    if not np.isfinite(rates).all() or not (rates[:-1] + rates[1:]).min() > 0:
        raise ArgumentError("the limits", acceleration.tolist(), "no motion was found within them: give larger ones")
    h = 2 * np.diff(s) / (rates[:-1] + rates[1:])
    t = np.concatenate([[0.0], np.cumsum(h)])
    c = np.vstack([s[:-1], rates[:-1], np.diff(rates) / h / 2])
    return TimeScaling(t, c)


def _caps(d1: Matrix, d3: Matrix, velocity: Vector, jerk: Vector, speed: float) -> Vector:
    with np.errstate(divide="ignore"):
        most = np.minimum(speed, (velocity / np.abs(d1)).min(axis=1))
        return np.minimum(most, np.cbrt(0.5 * jerk / np.abs(d3)).min(axis=1))


def _graded(stretch: Stretch, s: Vector, velocity: Vector, acceleration: Vector, jerk: Vector, speed: float) -> Vector:
    """The grid with more points where a scaling begins and ends, dense enough for the ramps there.

    A ramp at the least acceleration of the joints to the rate v that is allowed takes v^2 / (2 a) of the way. The grid
    begins with a share of that, and each interval is longer than the last one by the same factor.
    """
    points = [s]
    _, d1, _, d3 = stretch.derivatives(s[[0, -1]])
    for end, rate, fall in zip((0, 1), _caps(d1, d3, velocity, jerk, speed), np.abs(d1), strict=True):
        ramp = rate**2 * float((fall / acceleration).max()) / 2
        widest = s[1] if end == 0 else s[-1] - s[-2]
        first, growth = ramp / 64, 1.12
        if 0.0 < first < widest:
            steps = np.cumsum(first * growth ** np.arange(int(np.log(widest / first) / np.log(growth)) + 1))
            steps = steps[steps < s[-1] / 2]
            points.append(s[-1] - steps if end else steps)
    joined = np.unique(np.concatenate(points))
    return joined[np.concatenate([[True], np.diff(joined) > 1e-13 * joined[-1]])]


def _gentle(bare: TimeScaling, s: Vector, d1: Matrix, jerk: Vector) -> Vector:
    """Shares (k,) of the accelerations to which a scaling is bounded before it is smoothed.

    A change of the rate by v at the acceleration a, smoothed over a / j, takes v / a + a / j: least at a = sqrt(v j).
    More acceleration is no gain; so it is bounded by that in each part of the scaling that only speeds up, or slows
    down.
    """
    h, a = np.diff(bare.t), 2 * bare.c[2]
    start = bare.c[0]
    with np.errstate(divide="ignore"):
        allowed = (jerk / np.abs(d1)).min(axis=1)
    # The parts that only speed up, or slow down.
    side = np.sign(a) * (np.abs(a) > 1e-6 * np.abs(a).max())
    edges = np.flatnonzero(np.diff(side)) + 1
    shares = np.ones(len(s))
    for part in np.split(np.arange(len(a)), edges):
        if side[part[0]] == 0:
            continue
        # sqrt(v j) over the largest acceleration of the part, for it and what is near.
        v, peak = abs(float((a[part] * h[part]).sum())), float(np.abs(a[part]).max())
        low, high = start[part[0]], start[part[-1] + 1] if part[-1] + 1 < len(start) else s[-1]
        inside = (s >= low) & (s <= high)
        share = min(1.0, float(np.sqrt(v * allowed[inside].min())) / peak)
        reach = (high - low) / share
        shares[(s >= low - reach) & (s <= high + reach)] *= share
    return np.maximum(shares, 1e-6)


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
    """Points of s: all samples with as many between as make 600; evenly spread where the samples are too many."""
    count = len(stretch.s) - 1
    if count > FINEST:
        return np.linspace(0.0, stretch.length, FINEST + 1)
    parts = -(-600 // count)
    share = np.arange(parts) / parts
    inner = stretch.s[:-1, None] + share * np.diff(stretch.s)[:, None]
    return np.append(inner.ravel(), stretch.length)


def _of_accelerations(t: Vector, a: Vector, jerk: Vector, length: float) -> TimeScaling:
    """The scaling from rest of accelerations a + jerk (t - t_i) in pieces, made to end at s = length."""
    h = np.diff(t)
    v = np.concatenate([[0.0], np.cumsum(h * (a + h * jerk / 2))[:-1]])
    s = np.concatenate([[0.0], np.cumsum(h * (v + h * (a / 2 + h * jerk / 6)))])
    return TimeScaling(t, np.vstack([s[:-1], v, a / 2, jerk / 6]) * (length / s[-1]))


# --- `_fastest_trapezoid`: one ramp up, a constant rate, one ramp down; each ramp is as short as its own place allows.
#
# A ramp takes T seconds from rest to the path rate V, over the length V T / 2. Its acceleration rises for a share w of
# T, stays, and falls for the same share; w = 0 is even acceleration, for where no jerk is limited. On a straight curve
# this is T = V/a + a/j, or 2 sqrt(V/j) where the limit a of the acceleration is not reached.

RISES = np.concatenate([np.geomspace(0.01, 0.2, 7), np.linspace(0.225, 0.5, 12)])
"""Shares of a ramp in which its acceleration rises; the one with the shortest ramp is taken: 5 % lie between two."""

LADDER = 24
"""Times of a ramp that are tried at first, evenly spread by their logarithms; the shortest that holds is refined."""


def _fastest_trapezoid(stretch: Stretch, laps: int, bounds: tuple[Vector, Vector, Vector], speed: float) -> TimeScaling:
    """The fastest such scaling over some laps of a stretch, within limits (n,) of speed, acceleration and jerk.

    Raises:
        ArgumentError: none was found.
    """
    length = laps * stretch.length
    rises = RISES if np.isfinite(bounds[2]).any() else np.zeros(1)
    # The greatest rate at each place that a constant rate allows.
    grid = np.linspace(0.0, stretch.length, 2 * FINEST + 1)
    _, d1, d2, d3 = stretch.derivatives(grid)
    with np.errstate(divide="ignore"):
        caps = np.minimum(speed, (bounds[0] / np.abs(d1)).min(axis=1))
        caps = np.minimum(caps, np.sqrt(bounds[1] / np.abs(d2)).min(axis=1))
        caps = np.minimum(caps, np.cbrt(bounds[2] / np.abs(d3)).min(axis=1))
        liveliest = (bounds[1] / np.abs(d1)).min(axis=1)
    s = np.concatenate([grid[:-1] + lap * stretch.length for lap in range(laps)])
    caps_all = np.tile(caps[:-1], laps)
    top = min(float(caps.max()), 2.0 * float(np.sqrt(length * liveliest[np.isfinite(liveliest)].max())))

    def best_of(rates: Vector, rises: Vector) -> tuple[float, float, tuple[float, float], tuple[float, float]]:
        """(seconds, rate, ramps (T, w) at both ends) of the fastest of some rates; infinite where none holds."""
        up, down = (_ramps(stretch, length, bounds, rates, rises, end) for end in (False, True))
        best = np.inf, 0.0, (0.0, 0.0), (0.0, 0.0)
        for k, rate in enumerate(rates.tolist()):
            first, last = rate * up[0][k] / 2, length - rate * down[0][k] / 2
            cap = caps_all[(s >= first) & (s <= last)].min(initial=np.inf)
            if not first <= last * (1 + 1e-12) or rate > (1.0 + 1e-9) * cap:  # but for round-off of the derivatives
                continue
            seconds = length / rate + (up[0][k] + down[0][k]) / 2
            if seconds < best[0]:
                best = seconds, rate, (up[0][k], up[1][k]), (down[0][k], down[1][k])
        return best

    # The greatest rate, if its ramps take little of the time.
    at_once = best_of(np.array([top, min(top, float(caps.min()))]), rises)
    if sum(ramp[0] for ramp in at_once[2:]) < at_once[0] / 4 < np.inf:  # ramps do not pay for a lower rate
        return _scaling(length, *at_once[1:])
    # Else look for the best rate, coarsely, 24 at once and six times, then ever finer.
    for attempt in range(6):
        rates = np.geomspace(1.0, 1.0 / 50.0, 24) * top / 50.0**attempt
        best = best_of(rates, rises[::3])
        if np.isfinite(best[0]):
            break
    else:
        raise ArgumentError("the limits", bounds[1].tolist(), "no trapezoidal motion keeps them: give larger ones")
    step = rates[0] / rates[1]
    while step > 1.003:
        finer = best[1] * np.geomspace(1 / step, step, 9)
        best = min(best, best_of(finer[finer <= rates[0]], rises), key=lambda candidate: candidate[0])
        step **= 1 / 4
    return _scaling(length, *best[1:])


def _ramps(
    stretch: Stretch, length: float, bounds: tuple[Vector, Vector, Vector], rates: Vector, rises: Vector, end: bool
) -> tuple[Vector, Vector]:
    """(T, w) of the shortest ramp to each rate (k,) that is within its limits; T is infinite where there is none."""
    # Times of the ramps from the shortest that may be, by steps of equal ratio.
    V, w = (x.ravel() for x in np.meshgrid(rates, rises, indexing="ij"))
    longest = 2 * length / V
    d1 = stretch.derivatives(np.array([stretch.length if end else 0.0]), 1)[1][0]
    shortest = np.clip(0.25 * V * float((np.abs(d1) / bounds[1]).max()), 1e-9 * longest, 0.5 * longest)
    ladder = shortest[:, None] * (longest / shortest)[:, None] ** np.linspace(0.0, 1.0, LADDER)
    each = [np.repeat(x, LADDER) for x in (V, w)]
    holds = _holds(stretch, length, bounds, each[0], each[1], ladder.ravel(), end).reshape(ladder.shape)
    # The first that holds, halved to a 4,096th of the step before it; of all rises the shortest ramp.
    first = holds.argmax(axis=1)
    rows = np.arange(len(V))
    low, high = ladder[rows, np.maximum(first - 1, 0)], ladder[rows, first]
    for _ in range(12):
        middle = np.sqrt(low * high)
        good = _holds(stretch, length, bounds, V, w, middle, end)
        low, high = np.where(good, low, middle), np.where(good, middle, high)
    times = np.where(holds.any(axis=1), high, np.inf).reshape(len(rates), len(rises))
    best = times.argmin(axis=1)
    return times[np.arange(len(rates)), best], rises[best]


def _holds(
    stretch: Stretch, length: float, bounds: tuple[Vector, Vector, Vector], V: Vector, w: Vector, T: Vector, end: bool
) -> Flags:
    """Which ramps (k,) are within all limits, looked at at nine points of each of their three pieces."""
    # Acceleration, rate and way of a ramp of one second to the rate 1, at the places x of its time.
    share = np.linspace(0.0, 1.0, 9)
    rise, height = w[:, None], (1.0 / (1.0 - w))[:, None]
    x = np.hstack([rise * share, rise + (1 - 2 * rise) * share, 1 - rise + rise * share])
    piece = np.repeat([0, 1, 2], len(share))
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(rise > 0, height / rise, 0.0)
    near = np.where(piece == 2, 1 - x, x)  # the last piece is the first one, turned
    early = np.array([height * near, slope * near**2 / 2, slope * near**3 / 6])
    early[0] = np.where(rise > 0, slope * near, height)
    late = [height + 0 * x, height * (rise / 2 + x - rise), height * (rise**2 / 6 + (x - rise) * x / 2)]
    bend = np.where(piece == 1, late[0], early[0])
    fast = np.where(piece == 0, early[1], np.where(piece == 1, late[1], 1 - early[1]))
    way = np.where(piece == 0, early[2], np.where(piece == 1, late[2], x - 0.5 + early[2]))
    jump = slope * np.where(piece == 0, 1.0, np.where(piece == 1, 0.0, -1.0))
    # Those of the ramp itself, and what they make of the joints.
    V, T = V[:, None], T[:, None]
    s, a = V * T * way, V / T * bend
    s, a = (length - s, -a) if end else (s, a)
    rates = [V * fast, a, V / T**2 * jump]
    rates_of_joints = stretch.motion(s.ravel(), [x.ravel() for x in rates])[1:]
    worst = np.max([np.abs(x / limit).max(axis=1) for x, limit in zip(rates_of_joints, bounds, strict=True)], axis=0)
    return (worst <= 1.0).reshape(x.shape).all(axis=1)


def _scaling(length: float, rate: float, up: tuple[float, float], down: tuple[float, float]) -> TimeScaling:
    steps: list[tuple[float, float, float]] = []  # (seconds, acceleration at the start, jerk) of each piece
    for sign, (T, w) in ((1.0, up), (0.0, (length / rate - (up[0] + down[0]) / 2, 0.0)), (-1.0, down)):
        if sign == 0.0:
            steps.append((T, 0.0, 0.0))
            continue
        a = sign * rate / (T * (1 - w))
        slope = a / (w * T) if w else 0.0
        steps += [(w * T, 0.0, slope), ((1 - 2 * w) * T, a, 0.0), (w * T, a, -slope)]
    total = sum(h for h, _, _ in steps)
    pieces = np.array([step for step in steps if step[0] > 1e-12 * total]).T
    return _of_accelerations(np.concatenate([[0.0], np.cumsum(pieces[0])]), pieces[1], pieces[2], length)


WINDOWS = 12
"""Windows of smoothing between a step and half of the time, of which the fastest is taken; twice as many more are tried
about it: 3 % lie between the last ones."""

STEADY = 1e-6
"""Relative difference of the path speeds at both ends of a cycle up to which it may be repeated;
that of accelerations may be a thousand times as large, for they are its differences on the grid."""

SLOW = 2e-3
"""Share by which the path speed is below the one asked for before it is called slower: rounding up to whole steps of a
controller takes a thousandth of it."""


GIVE_VELOCITY = f"{GIVE_SPEEDS}, or give the motion its own: velocity= here or in [timing], where inf is no limit"
"""What to do about a joint without a speed limit in a motion that is to be timed."""


@typed
def retime(
    trajectory: Trajectory,
    *,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    profile: Profile = "time-optimal",
    speed: float | None = None,
    cycles: int | None = None,
    endless: bool = False,
    dt: float = 0.001,
) -> TimedTrajectory:
    """Time a trajectory under limits of joint speed, acceleration and jerk, from rest to rest, at a controller's step.

    The joints take the curve through the samples of the trajectory, quintic splines between the corners of the
    path; at a corner they rest. Where all cycles are alike, as those of a holonomic strategy, one is timed for all.
    The start and the end of every cycle, and every corner, are samples: the trajectory's own, to the last bit.

    s(t) runs through the curve q(s) by one of three profiles, within every limit at every sample, by exact derivatives
    and by differences of samples:

    - "time-optimal": the fastest scaling under speed and acceleration, by reachability, TOPP-RA [PP18].
    - "trapezoidal": a ramp up, a constant rate of s, a ramp down; each ramp is as short as its own place allows.
    - "quintic": s = 10 x^3 - 15 x^4 + 6 x^5 of the time's share x, slowed until the limits hold.

    A limit of the jerk gives trapezoids ramps whose acceleration rises and falls evenly. Time-optimal scalings keep it
    by a moving average of s(t), over the window that is the fastest in the end: the curve stays the same, since only
    the time along it is smoothed. That is not the least time under a limit of jerk.

    Args:
        trajectory: whose robot's limits of position, and of speed, hold.
        acceleration: largest accelerations [rad/s^2 or m/s^2], one for all joints or (n,), which no model of a robot
            has; needed for "time-optimal" and "trapezoidal".
        jerk: the same of the jerks; None for no limit.
        velocity: the same of the speeds; by default the robot's `max_velocity`, of which no joint may lack one.
            `math.inf` is no limit.
        speed: a bound of the tool's speed, as a share of the speed with which the trajectory was followed: 1 keeps
            the path's constant speed wherever the limits allow it. None for as fast as the limits allow.
        cycles: runs of the cycle; by default as many as the trajectory has.
        endless: three cycles of which the middle one may be repeated without end; see `TimedTrajectory.loop`. With a
            corner in the path the joints rest in every cycle, and any cycle can be repeated.
        dt: the controller's step [s].

    Returns:
        The motion at every step.

    Raises:
        ArgumentError: bad limits, or a joint without a speed limit; a trajectory that did not reach its end; cycles of
        one that does not repeat.
        ShapeError: limits that are not n numbers.
    """
    robot, n = trajectory.robot, trajectory.robot.n
    if profile not in get_args(Profile):
        raise ArgumentError("profile", profile, f"use one of {', '.join(get_args(Profile))}")
    # The limits that hold, and whether they are enough for the profile.
    speeds = speed_limits(robot, GIVE_VELOCITY) if velocity is None else velocity
    named = {"velocity": speeds, "acceleration": acceleration, "jerk": jerk}
    limits = Limits(robot.lower, robot.upper, *(_limit(what, given, n) for what, given in named.items()))
    if profile != "quintic" and not np.isfinite(limits.acceleration).all():
        form = "hk.retime(trajectory, acceleration=5.0) [rad/s^2 or m/s^2]"
        cure = f'a {profile} profile needs that of every joint: {form}, or profile="quintic", which does without'
        raise ArgumentError("acceleration", acceleration, cure)
    if not any(np.isfinite(getattr(limits, rate)).any() for rate in RATES) and speed is None:
        raise ArgumentError("the limits", None, "give at least one of velocity, acceleration, jerk and speed")
    most = np.inf if speed is None else positive("speed", speed)
    # The curve, how often it is run through, and each of its stretches timed.
    curve = joint_curve(trajectory)
    recorded = max(1, trajectory.cycles) if curve.repeats else 1
    count = 3 if endless else recorded if cycles is None else whole("cycles", cycles)
    if (endless or count > 1) and not curve.repeats:
        raise ArgumentError("cycles", count, "the trajectory does not end where it started; retime it as a whole")
    laps = count if curve.smooth else 1
    plan = _Plan(limits, profile, most, positive("dt", dt))
    open_ones = [s if laps > 1 or not s.round else Stretch(s.s, s.q) for s in curve.stretches]
    return _joined(trajectory, plan, [plan.timed(stretch, laps) for stretch in open_ones], count // laps, endless)


@dataclass(frozen=True, eq=False)
class _Part:
    """Samples of a stretch: [q, dq, ddq, dddq] (k, n), path speed (k,), indices of the laps' ends, seconds smoothed.

    `shares` (k, 2): the largest share of a limit used within half a step of a sample, and which one, counted through
    rates and joints. It is known where the path speed is below that asked for.
    """

    rows: list[Matrix]
    speed: Vector
    shares: Matrix
    ends: list[int]
    window: float


@dataclass(frozen=True)
class _Plan:
    limits: Limits
    profile: Profile
    speed: float
    dt: float

    def timed(self, stretch: Stretch, laps: int) -> _Part:
        """A stretch, run through from rest to rest some laps long: with as few steps as keep the limits."""
        # As fast as the limits allow, in whole steps; 4e6 are an hour at 1 kHz, and a gigabyte for seven joints.
        run = min(laps, 3)
        scaling, window = self._scaling(stretch, run)
        ends = _lap_ends(scaling, stretch.length, run)
        base = scaling.duration if run < 3 else ends[1] - ends[0]
        wanted = self._slowing(stretch, scaling) * base / self.dt
        if not wanted * laps <= 4_000_000:  # NaN and infinity included
            cure = f"it takes {wanted * laps:.3g} steps: give a longer one, or larger limits"
            raise ArgumentError("dt", self.dt, cure)
        steps = max(2, int(np.ceil(wanted * (1 - 1e-12))))
        part = self._sampled(stretch, scaling, steps * self.dt / base, laps, window)
        # Slower where a sample exceeds a limit: no or one time is needed. What is left after 20 is the round-off of
        # differences, 2e-9 rad/s^2 at 1 kHz, which no slower motion has less of.
        for _ in range(20):
            worst = max(self.worst(part.rows[1:]), self.worst(_differences(part.rows[0], self.dt)))
            if worst <= 1.0:
                break
            steps += 1 + int(steps * (worst - 1.0) / 4)
            part = self._sampled(stretch, scaling, steps * self.dt / base, laps, window)
        return part

    def _scaling(self, stretch: Stretch, laps: int) -> tuple[TimeScaling, float]:
        if self.profile == "quintic":
            return quintic(laps * stretch.length), 0.0
        if self.profile == "trapezoidal":
            return _fastest_trapezoid(stretch, laps, self._bounds, self.speed), 0.0
        bare = time_optimal(stretch, laps, *self._bounds, self.speed)
        if not np.isfinite(self.limits.jerk).any():
            return bare, 0.0
        # The window of smoothing, a share w of the time, that makes the fastest motion: coarsely, then ever finer.
        gentle = time_optimal(stretch, laps, *self._bounds, self.speed, bare)
        scaling, w = bare, 0.5
        narrowest = min(0.1, self.dt / bare.duration)
        windows = np.geomspace(narrowest, 0.5, WINDOWS).tolist()
        candidates = [(scaling, w) for scaling in (bare, gentle) for w in windows]
        step = (0.5 / narrowest) ** (1 / (WINDOWS - 1))
        for _ in range(3):
            seconds = []
            for scaling, w in candidates:
                smooth = smoothed(scaling, w * scaling.duration)
                seconds.append(self._slowing(stretch, smooth, 500) * scaling.duration * (1 + w))
            scaling, w = candidates[int(np.argmin(seconds))]
            wider = (w * np.geomspace(1 / step, step, WINDOWS)).tolist()
            candidates = [(scaling, w), *((scaling, x) for x in wider if x <= 0.5)]
            step **= 2 / (WINDOWS - 1)
        return smoothed(scaling, w * scaling.duration), w * scaling.duration

    def _slowing(self, stretch: Stretch, scaling: TimeScaling, count: int = 2 * FINEST) -> float:
        """The factor of time by which every limit just holds, looked at at all pieces of the scaling and between."""
        _, (s, *rates) = scaling.within(count)
        joint_rates = stretch.motion(s, rates)[1:]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            ratios = [
                float(np.abs(x / limit).max()) ** (1.0 / order)
                for order, (x, limit) in enumerate(zip(joint_rates, self._bounds, strict=True), 1)
            ]
        return max(*ratios, float(rates[0].max()) / self.speed)

    @property
    def _bounds(self) -> tuple[Vector, Vector, Vector]:
        return self.limits.velocity, self.limits.acceleration, self.limits.jerk

    def worst(self, rates: list[Matrix]) -> float:
        """The largest share of a limit taken."""
        pairs = zip(rates, self._bounds, strict=False)
        return max(float(np.abs(x / limit).max()) for x, limit in pairs if len(x))

    def _sampled(self, stretch: Stretch, scaling: TimeScaling, factor: float, laps: int, window: float) -> _Part:
        """Samples at every step and at the end of every lap; the first and the last step may rest for a while."""
        # The times: every step, and the ends of the laps.
        scaling = scaling.slower(factor)
        run = min(laps, 3)
        inner = _lap_ends(scaling, stretch.length, run)
        if not inner:
            count = round(scaling.duration / self.dt)
            times = [np.append(np.arange(count) * self.dt, scaling.duration)]
        else:
            before, after = (int(np.ceil(x / self.dt - 1e-9)) for x in (inner[0], scaling.duration - inner[-1]))
            middle = [a + self.dt * np.arange(1, 1 + round((b - a) / self.dt)) for a, b in pairwise(inner)]
            first = np.append(inner[0] - self.dt * np.arange(before, 0, -1), inner[0])
            times = [
                first,
                *middle * (laps - 2),
                np.append(inner[-1] + self.dt * np.arange(1, after), scaling.duration),
            ]
        ends = np.cumsum([len(part) for part in times]) - 1
        # The motion there, at rest at both ends; the ends of the laps to the last bit.
        t = np.concatenate(times)
        s, *rates = scaling.at(t)
        shares = self._limit_shares(stretch, scaling, t, rates[0])
        rates[0][[0, -1]] = 0.0
        rows = stretch.motion(s, rates)
        rows[0][0], rows[0][ends] = stretch.q[0], stretch.q[-1]
        return _Part(rows, rates[0], shares, [int(i) for i in ends], factor * window)

    def _limit_shares(self, stretch: Stretch, scaling: TimeScaling, t: Vector, rate: Vector) -> Matrix:
        """See `_Part`: looked at between the samples too, for a ramp may be shorter than a step."""
        greatest = np.zeros((len(t), 2))
        slow = np.flatnonzero(rate < (1.0 - SLOW) * self.speed) if np.isfinite(self.speed) else np.zeros(0, dtype=int)
        for part in np.split(slow, range(10_000, len(slow), 10_000)):
            if not len(part):
                continue
            near = np.clip(t[part, None] + self.dt * np.linspace(-0.5, 0.5, 17), 0.0, scaling.duration)
            s, *rates = scaling.at(near.ravel())
            joint_rates = stretch.motion(s, rates)[1:]
            shares = np.stack([np.abs(x / b) for x, b in zip(joint_rates, self._bounds, strict=True)], axis=1)
            shares = shares.reshape(len(part), 17, -1).max(axis=1)
            greatest[part] = np.column_stack([shares.max(axis=1), shares.argmax(axis=1)])
        return greatest


def _limit(what: str, given: ArrayLike | None, n: int) -> Vector:
    """Limits (n,), infinite where there are none. Raises: ArgumentError, ShapeError."""
    if given is None:
        return np.full(n, np.inf)
    array = numbers(what, given)
    if array.shape not in ((), (n,)) or not ((array > 0) & ((array <= HUGE) | (array == np.inf))).all():
        raise ArgumentError(what, given, f"give one positive number, or {n} of them, at most {HUGE:g}")
    return np.broadcast_to(array, (n,))


def _lap_ends(scaling: TimeScaling, length: float, laps: int) -> list[float]:
    """Times at which all laps but the last end."""
    from scipy.optimize import brentq

    def past(t: float, lap: int) -> float:
        return float(scaling.at(np.array([t]))[0][0]) - lap * length

    ends = [brentq(past, 0.0, scaling.duration, args=(lap,), xtol=1e-15) for lap in range(1, laps)]
    return [float(t) for t in ends]  # type: ignore[arg-type]  no RootResults, which are given when asked for


def _differences(q: Matrix, dt: float) -> list[Matrix]:
    """First and second differences of samples that begin and end at rest; the third drown in round-off."""
    held = np.vstack([q[:1], q[:1], q, q[-1:], q[-1:]])
    return [np.diff(held, order, axis=0) / dt**order for order in (1, 2)]


def _joined(trajectory: Trajectory, plan: _Plan, parts: list[_Part], times: int, endless: bool) -> TimedTrajectory:
    """One stretch after the other, the whole `times` times; the end of one is the start of the next."""
    columns: list[list[Matrix]] = [[] for _ in range(6)]
    stops, marks, count = [], [0], 1
    for part in parts * times:
        for column, rows in zip(columns, [*part.rows, part.speed, part.shares], strict=True):
            column.append(rows[int(count > 1) :])
        if part is parts[-1]:
            marks += [count - 1 + end for end in part.ends]
        count += part.ends[-1]
        stops.append(count - 1)
    q, dq, ddq, dddq, speed, shares = (np.concatenate(column) for column in columns)
    if len(marks) == max(2, len(trajectory.marks)):
        q[marks[-1]] = trajectory.q[-1]
    t = np.asarray(np.arange(len(q)) * plan.dt, dtype=float)
    # A loop that may be repeated has the same speed and accelerations at both ends.
    loop = (marks[1], marks[2]) if endless else None
    if loop is not None:
        jumps = [float(np.abs(x[loop[1]] - x[loop[0]]).max() / np.abs(x).max()) for x in (speed, ddq)]
        if jumps[0] > STEADY or jumps[1] > 1e3 * STEADY:
            cure = f"the second of three {plan.profile} cycles is not steady: give larger accelerations, or cycles="
            raise ArgumentError("the jump of an endless cycle", max(jumps), cure)
    motion = t, q, dq, ddq, dddq, speed
    inner_stops, window = tuple(k for k in stops if k < len(q) - 1), max(part.window for part in parts)
    slow, ends = _slowdowns(trajectory, plan, t, speed, shares), (tuple(marks), inner_stops)
    return TimedTrajectory(trajectory, plan.limits, plan.profile, plan.dt, *motion, *ends, loop, slow, window)


def _slowdowns(trajectory: Trajectory, plan: _Plan, t: Vector, speed: Vector, shares: Matrix) -> tuple[Slowdown, ...]:
    """Where the path speed is below that asked for; a constant speed has a reason of its own, its ramps have theirs."""
    if not np.isfinite(plan.speed):
        return ()
    # Parts that are slow at an even speed, and others that are slow.
    slow = speed < (1.0 - SLOW) * plan.speed
    still = np.concatenate([[False], np.abs(np.diff(speed)) <= 1e-6 * plan.speed])
    even = still & np.concatenate([still[1:], [False]]) & (speed > SLOW * plan.speed)
    kind = np.where(slow, 1 + even, 0)
    edges = np.flatnonzero(np.diff(kind)) + 1
    slowdowns = []
    for part in np.split(np.arange(len(t)), edges):
        if not kind[part[0]]:
            continue
        # The limit of which most samples of the part use almost the largest share (the last half step is also the next
        # part's); below nine tenths of it, it is the shape of the profile that takes the time.
        share = shares[part, 0].max()
        binding = shares[part[shares[part, 0] >= 0.99 * share], 1].astype(int)
        rate, joint = divmod(int(np.bincount(binding).argmax()), len(trajectory.joint_names))
        slowest = float(speed[part].min() / plan.speed)
        binds = share >= 0.9
        name, limit = (trajectory.joint_names[joint], RATES[rate]) if binds else ("", f"{plan.profile} profile")
        slowdowns.append(Slowdown(float(t[part[0]]), float(t[part[-1]]), slowest, name, limit))
    return tuple(slowdowns)
