"""Where a cycle's tool path meets itself: one pose, reached by two paths within the cycle."""

from __future__ import annotations

import numpy as np

from ...base.types import Vector
from .cycles import Cycles, nearest

_POINTS = 512
_APART = 0.03  # share of a cycle by which two passes lie apart at least: less is the path's own neighbourhood
_MEETS = 2e-3  # share of the path's size up to which two passes meet; the rest is corrected and counted as noise
_MOST = 64


def crossings(cycles: Cycles) -> tuple[Vector, Vector]:
    """Arc lengths (k,), (k,) of the two passes of each crossing in the last cycle; none for a retraced path.

    Candidates are local minima of the distance between two points of the cycle, refined by stepping from one pass
    to the nearest point of the other until both rest.
    """
    none = np.empty(0)
    path = cycles.path
    begin, end = sorted((float(cycles.s[-1, 0]), float(cycles.s[-1, -1])))
    spacing = (end - begin) / _POINTS
    if cycles.mirror is not None or spacing <= 0:
        return none, none
    s = np.asarray(begin + spacing * np.arange(_POINTS), dtype=float)
    z = path.point(s)
    squares = (z**2).sum(axis=1)
    d = np.sqrt(np.maximum(squares[:, None] + squares - 2 * z @ z.T, 0.0))
    low = np.ones_like(d, dtype=bool)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            low &= d <= np.roll(d, (i, j), axis=(0, 1))
    lag = np.arange(_POINTS) - np.arange(_POINTS)[:, None]
    apart = (lag > _APART * _POINTS) & (lag < (1 - _APART) * _POINTS)
    a, b = np.nonzero(low & apart & (d < 2 * spacing))
    chosen = np.argsort(d[a, b], kind="stable")[:_MOST]
    first, second = s[a[chosen]], s[b[chosen]]
    for _ in range(12):
        first = np.asarray(np.clip(nearest(path, path.point(second), first, 2 * spacing), begin, end), dtype=float)
        second = np.asarray(np.clip(nearest(path, path.point(first), second, 2 * spacing), begin, end), dtype=float)
    gap = np.linalg.norm(path.point(first) - path.point(second), axis=1)
    meets = gap < max(_MEETS * cycles.size, float(cycles.residual.max()))
    return first[meets], second[meets]
