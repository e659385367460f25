"""The tool's path by arc length, free of pauses and encoder noise, and the length at which it repeats."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..types import Array, Indices, Matrix, Vector

NOISE_STEPS = 12.0
"""Anchors are this many noise levels apart or more, so that noise adds no length."""

CLOSE = 0.05
"""Two visits closer than this share of the loop's size may be visits of one point."""

ALIKE = 0.02
"""A path repeats when the median distance between its rounds is below this share of the loop's size."""


def tool_points(position: Matrix, rotation: Array | None, length_scale: float) -> Matrix:
    """Poses as points (k, d) whose distance is sqrt(|dp|^2 + (l 2 sin(angle/2))^2), l the length scale [m/rad].

    The rotation enters by its nine entries, since |R - S|_F = 2 sqrt(2) sin(angle/2); None leaves it out.
    """
    if rotation is None:
        return position
    return np.hstack([position, length_scale / np.sqrt(2) * rotation.reshape(len(position), 9)])


def noise_level(x: Matrix) -> float:
    """Size (rms norm) of white noise on samples (k, d) of a smooth motion: sixth differences forget the motion."""
    if len(x) < 8:
        return 0.0
    sixth = np.diff(x, 6, axis=0)
    return float(np.median(np.linalg.norm(sixth, axis=1))) / np.sqrt(924.0)


def encoder_levels(q: Matrix) -> Vector:
    """Standard deviation of white noise on each joint of a log q (k, n).

    sigma = median |d^6 q| / (0.6745 sqrt(924)); 924 is the sum of the squared binomials, 0.6745 the median of
    |N(0, 1)|.
    """
    return np.array([noise_level(column[:, None]) for column in q.T]) / 0.6745


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Anchors: samples `index` (k,) at arc lengths s (k,) with tool points z (k, d) and postures q (k, n)."""

    index: Indices
    s: Vector
    z: Matrix
    q: Matrix
    step: float

    @property
    def length(self) -> float:
        """Distance travelled [m]."""
        return float(self.s[-1])

    @cached_property
    def point(self) -> Any:
        """z of s, a smooth curve through the anchors that does not swing at corners (Akima)."""
        return _curve(self.s, self.z)

    @cached_property
    def posture(self) -> Any:
        """q of s."""
        return _curve(self.s, self.q)

    @cached_property
    def slope(self) -> Any:
        """dz/ds of s."""
        return self.point.derivative()


def _curve(s: Vector, values: Matrix) -> Any:
    from scipy.interpolate import Akima1DInterpolator

    return Akima1DInterpolator(s, values, axis=0)


def tool_path(z: Matrix, q: Matrix, step: float, noise: float) -> ToolPath:
    """Keep samples a step [m] apart, corners and tips of turns; what happens while the tool rests is left out."""
    margin = NOISE_STEPS / 2 * noise
    index = _anchors(z, step, max(margin, 1e-3 * step))
    for _ in range(2):
        index = _with_corners(z, index, max(margin, 0.02 * step))
    chords = np.linalg.norm(np.diff(z[index], axis=0), axis=1)
    return ToolPath(index, np.concatenate([[0.0], np.cumsum(chords)]), z[index], q[index], step)


def _anchors(z: Matrix, step: float, margin: float) -> Indices:
    """The first sample that is `step` [m] from the last one kept, again and again; at the end the farthest, if it is
    over a margin away."""
    kept, here, count = [0], 0, len(z)
    far = (np.linalg.norm(np.diff(z, axis=0), axis=1) > step).tolist()
    while True:
        while here < len(far) and far[here]:
            here += 1
            kept.append(here)
        start, chunk, found = here + 1, 32, -1
        while start < count and found < 0:
            gap = z[start : start + chunk] - z[here]
            hit = np.einsum("ij,ij->i", gap, gap) > step * step
            i = int(np.argmax(hit))
            found = start + i if hit[i] else -1
            start, chunk = start + chunk, min(2 * chunk, 8192)
        if found < 0:
            break
        kept.append(found)
        here = found
    left = np.linalg.norm(z[here:] - z[here], axis=1)
    if left.max() > margin:
        kept.append(here + int(np.argmax(left)))
    return np.array(kept)


def _with_corners(z: Matrix, index: Indices, margin: float) -> Indices:
    """Anchors, and between two of them the sample farthest from their chord, if over a margin [m] off it."""
    interval = np.repeat(np.arange(len(index) - 1), np.diff(index))
    samples = np.arange(index[0], index[-1])
    start, chord = z[index[:-1]], np.diff(z[index], axis=0)
    squared = np.maximum(np.einsum("ij,ij->i", chord, chord), 1e-300)
    lever = z[samples] - start[interval]
    share = np.clip(np.einsum("ij,ij->i", lever, chord[interval]) / squared[interval], 0.0, 1.0)
    off = np.linalg.norm(lever - share[:, None] * chord[interval], axis=1)
    worst = np.maximum.reduceat(off, index[:-1] - index[0])
    at = np.flatnonzero((off == worst[interval]) & (off > margin))
    return np.union1d(index, samples[at])


@dataclass(frozen=True)
class Period:
    """Arc length of one round, where the repeating stretch begins and ends [m], and how well it repeats.

    `residual`: median distance between successive rounds, across the path, over the loop's size.
    """

    length: float
    begin: float
    end: float
    residual: float


def find_period(path: ToolPath, most: int = 60_000) -> Period | None:
    """The shortest arc length after which the tool runs the same path again in the same direction, or None.

    Lags are proposed by points that are visited again, and accepted when a whole round is the same.
    """
    count = int(np.clip(np.ceil(path.length / path.step), 16, most))
    grid = np.linspace(0.0, path.length, count)
    z = _reduced(path.point(grid))
    tested = [(lag, *run) for lag in _lags(z) for run in [_repeating(z, lag)] if run is not None]
    if not tested:
        return None
    best = min(residual for *_, residual in tested)
    if best > ALIKE:
        return None
    lag, first, last, residual = next(item for item in tested if item[3] <= max(3 * best, ALIKE / 8))
    unit = grid[1]
    return Period(lag * unit, first * unit, last * unit, residual)


def _reduced(z: Matrix) -> Matrix:
    """The same points in the few directions in which they vary."""
    centered = z - z.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centered.T @ centered)
    keep = np.sqrt(sizes / max(sizes[0], 1e-300)) > 1e-4
    return centered @ axes[keep].T


def _lags(z: Matrix, references: int = 64, most: int = 30) -> list[int]:
    """Lags at which many of the reference points are visited again, shortest first."""
    found: list[int] = []
    for start in np.unique(np.linspace(0, 0.97 * len(z), references).astype(int)):
        d = np.linalg.norm(z[start:] - z[start], axis=1)
        near = d < CLOSE * np.maximum.accumulate(d)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        for a, b in edges.reshape(-1, 2)[:40]:
            if a > 0:
                found.append(int(a + np.argmin(d[a:b])))
    groups: list[list[int]] = []
    for lag in sorted(found):
        if groups and lag <= 1.02 * groups[-1][0] + 1:
            groups[-1].append(lag)
        else:
            groups.append([lag])
    chosen = sorted(groups, key=len, reverse=True)[:most]
    return sorted(int(np.median(group)) for group in chosen)


def _repeating(z: Matrix, lag: int) -> tuple[int, int, float] | None:
    """(first, last, residual) of the longest stretch in which z(i + lag) = z(i), if a whole round long."""
    from scipy.ndimage import binary_closing, maximum_filter1d, minimum_filter1d

    if not 8 <= lag < len(z) - 4:
        return None
    gap = z[lag:] - z[:-lag]
    window = {"size": lag, "axis": 0, "mode": "nearest", "origin": -((lag - 1) // 2)}
    size = np.linalg.norm(maximum_filter1d(z, **window) - minimum_filter1d(z, **window), axis=1)[: len(gap)]
    distance = np.linalg.norm(gap, axis=1)
    patch = np.ones(2 * max(1, lag // 100) + 1, dtype=bool)
    alike = binary_closing(np.pad(distance < CLOSE * size, len(patch)), patch)[len(patch) : -len(patch)]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], alike, [False]]).astype(int))).reshape(-1, 2)
    if not len(edges):
        return None
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    if last - first < 0.97 * lag:
        return None
    tangent = np.gradient(z, axis=0)[: len(gap)]
    along = np.einsum("ij,ij->i", gap, tangent) / np.maximum(np.linalg.norm(tangent, axis=1), 1e-300)
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    here = slice(first, last)
    return int(first), int(last + lag), float(np.median(across[here] / size[here]))
