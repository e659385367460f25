"""The length at which the tool's path repeats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Matrix
from .arcs import ToolMotion, ToolPath, tool_path

CLOSE = 0.05
"""Two visits closer than this share of the loop's size may be visits of one point."""

ALIKE = 0.02
"""A path repeats when the median distance between its rounds is below this share of the loop's size."""

SURE = ALIKE / 8
"""Rounds as alike as this are taken without looking for a longer stretch that is more alike."""

STRETCHES = ((1, 60_000), (1, 240_000), (4, 240_000), (16, 240_000))
"""Stretches of the path in which a period is looked for, one kind after the other: their step, in the finest ones, and
how many steps they have at most. The work, and what is in memory, grow with that. With steps of a 25th of the tool's
extent, the longest, a path is just known."""

_VISITS = 40  # of a point, that propose lags
_FEW = 8  # visits that make a close lag worth a look


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
    found: list[Period] = []
    for coarser, most in STRETCHES:
        first = tool_path(motion, finest * coarser, noise, most=most)
        rows = int(first.index[-1])
        for start in [0] if first.ends else [(len(motion) - rows) // 2, 0, len(motion) - rows]:
            path = tool_path(motion, finest * coarser, noise, start=start, most=most) if start else first
            period = _period(path, most, first.ends) if len(path.index) >= 16 else None
            found += [period] if period is not None else []
            if period is not None and period.residual <= SURE:
                break
        if first.ends or (found and found[-1].residual <= SURE):
            break
    if not found:
        return None
    best = min(period.residual for period in found)
    return min((p for p in found if p.residual <= max(3 * best, SURE)), key=lambda p: p.length)


def _period(path: ToolPath, most: int, whole: bool) -> Period | None:
    """The shortest period of a path.

    Lags are proposed by points that are visited again, and accepted when a whole round is the same.
    """
    count = int(np.clip(np.ceil(path.length / path.step), 16, most))
    grid = np.linspace(0.0, path.length, count)
    z = _reduced(path.point(grid))
    tested = [(lag, *run) for lag in _lags(z) for run in [repeating(z, lag)] if run is not None]
    if not tested:
        return None
    best = min(residual for *_, residual in tested)
    if best > ALIKE:
        return None
    lag, first, _, residual = next(item for item in tested if item[3] <= max(3 * best, SURE))
    begin, end = path.sample(grid[[first, first + lag]])
    return Period(float(begin), float(end), float(lag * grid[1]), residual, whole)


def _reduced(z: Matrix) -> Matrix:
    """The same points in the few directions in which they vary."""
    centered = z - z.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centered.T @ centered)
    keep = np.sqrt(sizes / max(sizes[0], 1e-300)) > 1e-4
    return centered @ axes[keep].T


def _lags(z: Matrix, references: int = 64, most: int = 20) -> list[int]:
    """Lags at which many of the reference points are visited again, or some most closely, shortest first."""
    found: list[tuple[int, float]] = []
    for start in np.unique(np.linspace(0, 0.97 * len(z), references).astype(int)):
        d = np.linalg.norm(z[start:] - z[start], axis=1)
        near = d < CLOSE * np.maximum.accumulate(d)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
        visits = edges.reshape(-1, 2)
        visits = visits[visits[:, 0] > 0]
        if len(visits) > _VISITS:  # the next ones, and the closest: beside a point run the rows of a fine raster
            closest = np.minimum.reduceat(np.append(d, np.inf), visits.ravel())[::2]
            order = np.argsort(closest[_VISITS // 2 :], kind="stable")[: _VISITS // 2] + _VISITS // 2
            visits = np.vstack([visits[: _VISITS // 2], visits[order]])
        for a, b in visits:
            lag = int(a + np.argmin(d[a:b]))
            found.append((lag, float(d[lag])))
    groups: list[list[tuple[int, float]]] = []
    for lag in sorted(found):
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
