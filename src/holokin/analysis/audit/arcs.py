"""The tool's path by arc length, free of pauses and encoder noise; a long log is looked at a block at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.types import Array, Flags, Indices, Matrix, Vector, frozen, runs
from ...robot import Robot

NOISE_STEPS = 12.0  # anchors are this many noise levels apart or more, so that noise adds no length
BLOCK = 50_000  # samples whose tool poses are in memory at one time: five megabytes


# Axes of the tool (3, a), as columns, whose directions belong to its path: all, of a pose; none, of a position.
WHOLE, FREE = frozen(np.eye(3)), frozen(np.zeros((3, 0)))


def tool_points(position: Matrix, rotation: Array, axes: Matrix, length_scale: float) -> Matrix:
    """Poses as points (k, d) whose distance is sqrt(|dp|^2 + (l 2 sin(angle/2))^2), l the length scale [m/rad].

    A rotation enters by its nine entries, since |R - S|_F = 2 sqrt(2) sin(angle/2), and one axis a by the direction
    R a, since |R a - S a| = 2 sin(angle/2).
    """
    if not axes.shape[1]:
        return position
    weight = length_scale / np.sqrt(2) if axes.shape[1] == 3 else length_scale
    turned = rotation if axes is WHOLE else rotation @ axes
    return np.hstack([position, weight * turned.reshape(len(position), 3 * axes.shape[1])])


def noise_level(x: Matrix) -> float:
    """Size (rms norm) of white noise on samples (k, d) of a smooth motion: sixth differences forget the motion."""
    return _noise_of(_sixth_differences(x)) if len(x) >= 8 else 0.0


def _sixth_differences(x: Matrix) -> Vector:
    return np.linalg.norm(np.diff(x, 6, axis=0), axis=1)


def _noise_of(sixth_differences: Vector) -> float:
    return float(np.median(sixth_differences)) / np.sqrt(924.0)


def encoder_levels(q: Matrix) -> Vector:
    """Standard deviation of white noise on each joint of a log q (k, n).

    sigma = median |d^6 q| / (0.6745 sqrt(924)); 924 is the sum of the squared binomials, 0.6745 the median of
    |N(0, 1)|.
    """
    return np.array([noise_level(column[:, None]) for column in q.T]) / 0.6745


def rounding_of(q: Matrix) -> float:
    """To how much the numbers of a log q (k, n) are rounded [rad or m]: the last decimal that they have in rad, or in
    degrees, or single precision; else what double precision leaves of a sum of some joints."""
    rows = q[:: max(1, len(q) // 300)]
    if np.array_equal(rows, rows.astype(np.float32)):
        return float(np.abs(rows).max() * np.finfo(np.float32).eps)
    for decimals in range(1, 12):
        for unit in (1.0, 180 / np.pi):
            scaled = rows * unit * 10.0**decimals
            if (np.abs(scaled - np.round(scaled)) <= 1e-3 + 1e-14 * np.abs(scaled)).all():
                return 10.0**-decimals / unit
    return 1e-12


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Tool points of postures q (k, n), computed when they are asked for: those of a long log fill the memory.

    q may be in single precision, too.
    """

    robot: Robot
    q: Matrix
    tip: str | None
    axes: Matrix
    length_scale: float

    def __len__(self) -> int:
        return len(self.q)

    @cached_property
    def _all(self) -> Matrix | None:
        return self._points(slice(None)) if len(self.q) <= BLOCK else None

    def _points(self, rows: slice | NDArray[np.integer[Any]]) -> Matrix:
        position, rotation = self.robot.pose_batch(self.q[rows].astype(float, copy=False), self.tip)
        return tool_points(position, rotation, self.axes, self.length_scale)

    def at(self, rows: slice | NDArray[np.integer[Any]]) -> Matrix:
        """Tool points of some samples."""
        if self._all is not None:
            return self._all[rows]
        if isinstance(rows, slice) or len(rows) <= BLOCK:
            return self._points(rows)
        return np.vstack([self._points(rows[i : i + BLOCK]) for i in range(0, len(rows), BLOCK)])

    def blocks(self, start: int = 0, stop: int | None = None, before: int = 0) -> Iterator[tuple[int, Matrix]]:
        """(first sample, points) of successive blocks; each begins `before` samples early, where there are any."""
        end = len(self) if stop is None else stop
        for i in range(start, end, BLOCK):
            first = max(i - before, start)
            yield first, self.at(slice(first, min(i + BLOCK, end)))

    def extent_and_noise(self) -> tuple[float, float]:
        """Size of the box that the tool points fill, and their noise level [m]."""
        differences, low, high = [], np.inf, -np.inf
        for _, z in self.blocks(before=6):
            low, high = np.minimum(low, z.min(axis=0)), np.maximum(high, z.max(axis=0))
            differences.append(_sixth_differences(z) if len(z) > 6 else np.empty(0))
        noise = _noise_of(np.concatenate(differences)) if len(self) >= 8 else 0.0
        return float(np.linalg.norm(high - low)), noise


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Anchors: samples `index` (k,) at arc lengths s (k,) with tool points z (k, d); `joints`: all postures; `ends`:
    whether the path goes on to the end of the log; beyond: how far the tool runs between the last two samples [m], and
    may have run on after the last."""

    index: Indices
    s: Vector
    z: Matrix
    joints: Matrix
    step: float
    ends: bool = True
    beyond: float = 0.0

    @property
    def length(self) -> float:
        """Distance travelled [m]."""
        return float(self.s[-1])

    @cached_property
    def point(self) -> Curve:
        """z of s, a smooth curve through the anchors that does not swing at corners (Akima)."""
        return Curve(self.s, self.z)

    @cached_property
    def posture(self) -> Curve:
        """q of s."""
        return Curve(self.s, self.joints[self.index])

    def sample(self, s: Vector) -> Vector:
        """Sample positions at arc lengths."""
        return np.interp(s, self.s, self.index.astype(float))

    def arc(self, samples: Vector) -> Vector:
        """Arc lengths at sample positions."""
        return np.interp(samples, self.index.astype(float), self.s)


@dataclass(frozen=True, eq=False)
class Curve:
    """A smooth curve through values (k, d) at rising s (k,), which runs on straight beyond its ends."""

    s: Vector
    values: Matrix

    @cached_property
    def _akima(self) -> Any:
        from scipy.interpolate import Akima1DInterpolator

        return Akima1DInterpolator(self.s, self.values)

    def __call__(self, s: Vector | float) -> Array:
        """Values (..., d) at s (...); beyond the ends along the tangents there."""
        inside = np.clip(np.asarray(s, dtype=float), self.s[0], self.s[-1])
        values, over = self._akima(inside), s - inside
        return values + over[..., None] * self._akima(inside, 1) if over.any() else values

    def slope(self, s: Vector | float) -> Array:
        """Derivatives (..., d) at s (...), beyond the ends those there."""
        return self._akima(np.clip(np.asarray(s, dtype=float), self.s[0], self.s[-1]), 1)


def tool_path(motion: ToolMotion, step: float, noise: float, *, start: int = 0, most: int | None = None) -> ToolPath:
    """Keep samples a step [m] apart, corners and tips of turns; what happens while the tool rests is left out.

    Args:
        start: the first sample looked at. most: end after so many anchors, and so many steps of length.
    """
    margin = NOISE_STEPS / 2 * noise
    index, ends = _anchors(motion, step, max(margin, 1e-3 * step), start, most)
    for _ in range(2):
        index = _with_corners(motion, index, max(margin, 0.02 * step))
    z = motion.at(index)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(z, axis=0), axis=1))])
    if most is not None and s[-1] > most * step:
        ends, keep = False, max(int(np.searchsorted(s, most * step)), 2)
        index, s, z = index[:keep], s[:keep], z[:keep]
    last = motion.at(np.array([len(motion) - 2, len(motion) - 1])) if len(motion) > 1 else z[:2]
    beyond = float(np.linalg.norm(last[1] - last[0])) if ends and len(s) > 1 else 0.0
    return ToolPath(index, s, z, motion.q, step, ends, min(beyond, float(np.median(np.diff(s)))) if len(s) > 1 else 0.0)


def _anchors(motion: ToolMotion, step: float, margin: float, start: int, most: int | None) -> tuple[Indices, bool]:
    """The first sample that is `step` [m] from the last one kept, again and again; at the end the farthest, if it is
    over a margin away. And whether that end was reached."""
    anchors, anchor = [start], motion.at(slice(start, start + 1))[0]
    farthest, tip = 0.0, -1  # since the last anchor
    for first, z in motion.blocks(start, before=1):
        far = (np.linalg.norm(np.diff(z, axis=0), axis=1) > step).tolist()
        i, chunk = (0 if first == start else 1), 32
        while i < len(z):
            # The sample after an anchor is often far enough; else the next `chunk` samples are looked at together.
            next_is_far = i > 0 and first + i - 1 == anchors[-1] and far[i - 1]
            if not next_is_far:
                gap = z[i : i + chunk] - anchor
                squares = np.einsum("ij,ij->i", gap, gap)
                beyond = int(np.argmax(squares > step * step))
                if not squares[beyond] > step * step:
                    best = int(np.argmax(squares))
                    if squares[best] > farthest:
                        farthest, tip = float(squares[best]), first + i + best
                    i, chunk = i + chunk, min(2 * chunk, 8192)
                    continue
                i += beyond
            anchors.append(first + i)
            anchor, farthest, chunk, i = z[i], 0.0, 32, i + 1
        if most is not None and len(anchors) >= most:
            return np.array(anchors), False
    if farthest > margin * margin:
        anchors.append(tip)
    return np.array(anchors), True


def _with_corners(motion: ToolMotion, index: Indices, margin: float) -> Indices:
    """Anchors, and between two of them the sample farthest from their chord, if over a margin [m] off it."""
    ends = motion.at(index)
    worst, corner = np.full(len(index) - 1, margin), np.full(len(index) - 1, -1)
    for first, z in motion.blocks(int(index[0]), int(index[-1])):
        samples = np.arange(first, first + len(z))
        interval = np.searchsorted(index, samples, side="right") - 1
        start, chord = ends[interval], ends[interval + 1] - ends[interval]
        squared = np.maximum(np.einsum("ij,ij->i", chord, chord), 1e-300)
        lever = z - start
        share = np.clip(np.einsum("ij,ij->i", lever, chord) / squared, 0.0, 1.0)
        off = np.linalg.norm(lever - share[:, None] * chord, axis=1)
        begins = np.flatnonzero(np.diff(interval, prepend=-1))
        intervals = interval[begins]
        most = np.maximum.reduceat(off, begins)
        over = intervals[most > worst[intervals]]
        if len(over):
            worst[intervals] = np.maximum(worst[intervals], most)
            rows = np.flatnonzero((off == worst[interval]) & np.isin(interval, over))[::-1]
            corner[interval[rows]] = samples[rows]  # the first of equals
    return np.sort(np.concatenate([index, corner[corner >= 0]]))


# --- The length at which the tool's path repeats.

CLOSE = 0.05  # two visits closer than this share of the loop's size may be visits of one point
ALIKE = 0.02  # a path repeats when the median distance between its rounds is below this share of the loop's size
SURE = ALIKE / 8  # rounds as alike as this are taken without looking for a longer stretch that is more alike

# Stretches of the path in which a period is looked for, one kind after the other: their step, in the finest ones, and
# how many steps they have at most. The work, and what is in memory, grow with that. With steps of a 25th of the
# tool's extent, the longest, a path is just known.
STRETCHES = ((1, 60_000), (1, 240_000), (4, 240_000), (16, 240_000))

_VISITS = 40  # of a point, that propose lags
_FEW = 8  # visits that make a close lag worth a look


def with_gaps_closed(flags: Flags, reach: int) -> Flags:
    """Flags (k,) that are true as well in gaps of at most 2 `reach` between runs of True, as at a corner of a path."""
    from scipy.ndimage import binary_closing

    patch = np.ones(2 * max(1, reach) + 1, dtype=bool)
    return np.asarray(binary_closing(np.pad(flags, len(patch)), patch)[len(patch) : -len(patch)], dtype=bool)


@dataclass(frozen=True)
class Period:
    """Samples between which the first whole round of a repeating stretch runs, and how well it repeats.

    `begin`, `end`: sample positions; `length` [m] of the round; `residual`: median distance between successive rounds,
    across the path, over the loop's size; `whole`: the stretch looked at was the whole log, so nothing repeats before.
    """

    begin: float
    end: float
    length: float
    residual: float
    whole: bool


def find_period(motion: ToolMotion, noise: float, finest: float) -> Period | None:
    """The shortest round after which the tool runs the same path again in the same direction, or None.

    A path of many rounds is looked at in stretches, since a grid over all of it would be too coarse: in the middle, at
    the beginning and at the end, at the finest step; where none surely repeats, in longer ones (`STRETCHES`).

    Args:
        noise: of the tool points [m]. finest: step of the finest stretch [m].
    """
    periods: list[Period] = []
    for coarser, most in STRETCHES:
        first = tool_path(motion, finest * coarser, noise, most=most)
        rows = int(first.index[-1])
        for start in [0] if first.ends else [(len(motion) - rows) // 2, 0, len(motion) - rows]:
            path = tool_path(motion, finest * coarser, noise, start=start, most=most) if start else first
            period = _period(path, most, first.ends) if len(path.index) >= 16 else None
            if period is not None:
                periods.append(period)
                if period.residual <= SURE:
                    break
        if first.ends or (periods and periods[-1].residual <= SURE):
            break
    if not periods:
        return None
    best = min(period.residual for period in periods)
    return min((p for p in periods if p.residual <= max(3 * best, SURE)), key=lambda p: p.length)


def _period(path: ToolPath, most: int, whole: bool) -> Period | None:
    """The shortest period of a path.

    Lags are proposed by points that are visited again, and accepted when a whole round is the same.
    """
    count = int(np.clip(np.ceil(path.length / path.step), 16, most))
    grid = np.linspace(0.0, path.length, count)
    # The points in the few directions in which they vary.
    z = path.point(grid)
    z = z - z.mean(axis=0)
    _, sizes, axes = np.linalg.svd(z.T @ z)
    z = z @ axes[np.sqrt(sizes / max(sizes[0], 1e-300)) > 1e-4].T
    tested = [(lag, *run) for lag in _lags(z) for run in [repeating(z, lag)] if run is not None]
    if not tested:
        return None
    best = min(residual for *_, residual in tested)
    if best > ALIKE:
        return None
    lag, first, _, residual = next(item for item in tested if item[3] <= max(3 * best, SURE))
    begin, end = path.sample(grid[[first, first + lag]])
    return Period(float(begin), float(end), float(lag * grid[1]), residual, whole)


def _lags(z: Matrix, references: int = 64, most: int = 20) -> list[int]:
    """Lags at which many of the reference points are visited again, or some most closely, shortest first."""
    revisits: list[tuple[int, float]] = []
    for start in np.unique(np.linspace(0, 0.97 * len(z), references).astype(int)):
        d = np.linalg.norm(z[start:] - z[start], axis=1)
        near = d < CLOSE * np.maximum.accumulate(d)
        visits = runs(near)
        visits = visits[visits[:, 0] > 0]
        if len(visits) > _VISITS:  # the next ones, and the closest: beside a point run the rows of a fine raster
            closest = np.minimum.reduceat(np.append(d, np.inf), visits.ravel())[::2]
            order = np.argsort(closest[_VISITS // 2 :], kind="stable")[: _VISITS // 2] + _VISITS // 2
            visits = np.vstack([visits[: _VISITS // 2], visits[order]])
        for a, b in visits:
            lag = int(a + np.argmin(d[a:b]))
            revisits.append((lag, float(d[lag])))
    groups: list[list[tuple[int, float]]] = []
    for lag in sorted(revisits):
        if groups and lag[0] <= 1.02 * groups[-1][0][0] + 1:
            groups[-1].append(lag)
        else:
            groups.append([lag])
    best = [_densest(np.array(group)) for group in groups]
    often = sorted(best, key=lambda item: -item[0])[:most]
    closely = sorted((item for item in best if item[0] >= _FEW), key=lambda item: item[1])[: most // 2]
    return sorted({lag for _, _, lag in (*often, *closely)})


def _densest(visits: Matrix) -> tuple[int, float, int]:
    """(number, median distance, median lag) of those of the visits (k, 2), by rising lag, whose lags agree: a round
    has one lag from all its points, a row of a raster and its neighbour another one from each."""
    lags = visits[:, 0]
    last = np.searchsorted(lags, lags + 2 + lags[0] // 1000, side="right")
    i = int(np.argmax(last - np.arange(len(lags))))
    lag, distance = np.median(visits[i : last[i]], axis=0)
    return int(last[i] - i), float(distance), int(lag)


def repeating(z: Matrix, lag: int) -> tuple[int, int, float] | None:
    """(first, last, residual) of the longest stretch in which points z (k, d) have z(i + lag) = z(i), if a whole round
    long."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    if not 8 <= lag < len(z) - 4:
        return None
    gap = z[lag:] - z[:-lag]
    window = {"size": lag, "axis": 0, "mode": "nearest", "origin": -((lag - 1) // 2)}
    size = np.linalg.norm(maximum_filter1d(z, **window) - minimum_filter1d(z, **window), axis=1)[: len(gap)]
    distance = np.linalg.norm(gap, axis=1)
    alike = runs(with_gaps_closed(distance < CLOSE * size, lag // 100))
    if not len(alike):
        return None
    first, last = alike[np.argmax(alike[:, 1] - alike[:, 0])]
    if last - first < 0.97 * lag:
        return None
    tangent = np.gradient(z, axis=0)[: len(gap)]
    along = np.einsum("ij,ij->i", gap, tangent) / np.maximum(np.linalg.norm(tangent, axis=1), 1e-300)
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    stretch = slice(first, last)
    return int(first), int(last + lag), float(np.median(across[stretch] / size[stretch]))
