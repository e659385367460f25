"""`fastest_trapezoid`: one ramp up, a constant rate, one ramp down; each ramp is as short as its own place allows.

A ramp takes T seconds from rest to the path rate V, over the length V T / 2. Its acceleration rises for a share w of
T, stays, and falls for the same share; w = 0 is even acceleration, for where no jerk is limited. On a straight curve
this is T = V/a + a/j, or 2 sqrt(V/j) where the limit a of the acceleration is not reached.
"""

from __future__ import annotations

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Flags, Vector
from .joint_curve import Stretch
from .time_law import FINEST, TimeLaw, of_accelerations

RISES = np.concatenate([np.geomspace(0.01, 0.2, 7), np.linspace(0.225, 0.5, 12)])
"""Shares of a ramp in which its acceleration rises; the one with the shortest ramp is taken: 5 % lie between two."""

LADDER = 24
"""Times of a ramp that are tried at first, evenly spread by their logarithms; the shortest that holds is refined."""

HALVINGS = 12
"""Of the interval between two of them: the last one is narrower by 4,096."""

RATES_TRIED, NARROWER, ROUNDS = 24, 50.0, 6
"""Constant rates tried at once, the greatest over the least of them, and rounds before it is given up."""

ROUND_OFF = 1.0 + 1e-9
"""By which a rate may be above what a straight curve allows, whose derivatives are known to so much."""


def fastest_trapezoid(stretch: Stretch, laps: int, bounds: tuple[Vector, Vector, Vector], speed: float) -> TimeLaw:
    """The fastest such law over some laps of a stretch, within limits (n,) of speed, acceleration and jerk.

    Raises:
        ArgumentError: none was found.
    """
    length = laps * stretch.length
    rises = RISES if np.isfinite(bounds[2]).any() else np.zeros(1)
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

    def tried(rates: Vector, rises: Vector) -> tuple[float, float, tuple[float, float], tuple[float, float]]:
        """(seconds, rate, ramps (T, w) at both ends) of the fastest of some rates; infinite where none holds."""
        up, down = (_ramps(stretch, length, bounds, rates, rises, end) for end in (False, True))
        best = np.inf, 0.0, (0.0, 0.0), (0.0, 0.0)
        for k, rate in enumerate(rates.tolist()):
            first, last = rate * up[0][k] / 2, length - rate * down[0][k] / 2
            if not first <= last * (1 + 1e-12) or rate > ROUND_OFF * caps_all[(s >= first) & (s <= last)].min(
                initial=np.inf
            ):
                continue
            seconds = length / rate + (up[0][k] + down[0][k]) / 2
            if seconds < best[0]:
                best = seconds, rate, (up[0][k], up[1][k]), (down[0][k], down[1][k])
        return best

    at_once = tried(np.array([top, min(top, float(caps.min()))]), rises)
    if sum(ramp[0] for ramp in at_once[2:]) < at_once[0] / 4 < np.inf:  # ramps do not pay for a lower rate
        return _law(length, *at_once[1:])
    for attempt in range(ROUNDS):
        rates = np.geomspace(1.0, 1.0 / NARROWER, RATES_TRIED) * top / NARROWER**attempt
        best = tried(rates, rises[::3])
        if np.isfinite(best[0]):
            break
    else:
        raise ArgumentError("the limits", bounds[1].tolist(), "no trapezoidal motion keeps them: give larger ones")
    step = rates[0] / rates[1]
    while step > 1.003:
        finer = best[1] * np.geomspace(1 / step, step, 9)
        best = min(best, tried(finer[finer <= rates[0]], rises), key=lambda found: found[0])
        step **= 1 / 4
    return _law(length, *best[1:])


def _ramps(
    stretch: Stretch, length: float, bounds: tuple[Vector, Vector, Vector], rates: Vector, rises: Vector, end: bool
) -> tuple[Vector, Vector]:
    """(T, w) of the shortest ramp to each rate (k,) that is within its limits; T is infinite where there is none."""
    V, w = (x.ravel() for x in np.meshgrid(rates, rises, indexing="ij"))
    longest = 2 * length / V
    d1 = stretch.derivatives(np.array([stretch.length if end else 0.0]), 1)[1][0]
    shortest = np.clip(0.25 * V * float((np.abs(d1) / bounds[1]).max()), 1e-9 * longest, 0.5 * longest)
    ladder = shortest[:, None] * (longest / shortest)[:, None] ** np.linspace(0.0, 1.0, LADDER)
    each = [np.repeat(x, LADDER) for x in (V, w)]
    holds = _holds(stretch, length, bounds, each[0], each[1], ladder.ravel(), end).reshape(ladder.shape)
    at = holds.argmax(axis=1)
    rows = np.arange(len(V))
    low, high = ladder[rows, np.maximum(at - 1, 0)], ladder[rows, at]
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        good = _holds(stretch, length, bounds, V, w, middle, end)
        low, high = np.where(good, low, middle), np.where(good, middle, high)
    found = np.where(holds.any(axis=1), high, np.inf).reshape(len(rates), len(rises))
    best = found.argmin(axis=1)
    return found[np.arange(len(rates)), best], rises[best]


def _holds(
    stretch: Stretch, length: float, bounds: tuple[Vector, Vector, Vector], V: Vector, w: Vector, T: Vector, end: bool
) -> Flags:
    """Which ramps (k,) are within all limits, looked at at nine points of each of their three pieces."""
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
    V, T = V[:, None], T[:, None]
    s, a = V * T * way, V / T * bend
    s, a = (length - s, -a) if end else (s, a)
    rates = [V * fast, a, V / T**2 * jump]
    found = stretch.motion(s.ravel(), [x.ravel() for x in rates])[1:]
    worst = np.max([np.abs(x / limit).max(axis=1) for x, limit in zip(found, bounds, strict=True)], axis=0)
    return (worst <= 1.0).reshape(x.shape).all(axis=1)


def _law(length: float, rate: float, up: tuple[float, float], down: tuple[float, float]) -> TimeLaw:
    steps: list[tuple[float, float, float]] = []  # (seconds, acceleration at the start, jerk) of each piece
    for sign, (T, w) in ((1.0, up), (0.0, (length / rate - (up[0] + down[0]) / 2, 0.0)), (-1.0, down)):
        if sign == 0.0:
            steps.append((T, 0.0, 0.0))
            continue
        a = sign * rate / (T * (1 - w))
        slope = a / (w * T) if w else 0.0
        steps += [(w * T, 0.0, slope), ((1 - 2 * w) * T, a, 0.0), (w * T, a, -slope)]
    total = sum(h for h, _, _ in steps)
    kept = np.array([step for step in steps if step[0] > 1e-12 * total]).T
    return of_accelerations(np.concatenate([[0.0], np.cumsum(kept[0])]), kept[1], kept[2], length)
