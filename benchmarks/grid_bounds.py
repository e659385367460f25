"""How short can the cuts of a planar arm of three links be? Part of `python -m benchmarks.sheets`.

The tool stands at p = exp(i q1) w(q2, q3), w = a + exp(i q2) (b + c exp(i q3)). A function of p that is continuous on
a whole circle about the base comes back to its q1, and w goes once round zero. So the joints follow a closed curve
|w| = r within the limits of joints 2 and 3 that encloses a zero of w. Where the limits cut every such curve, each
function has a cut on that circle, and the cuts are as long as all these radii together: that is `least_cut`.

With one jump on the circle, at the polar angle s, the joints follow a connected piece of |w| = r. Let arg w run from u
to v on it and q1 from l to h: then u + l <= s <= v + h - 2 pi. `single_jump` is the shortest curve through these
(r, s), from the circles that need no cut to those that are not wholly in reach. It bounds functions with one jump on
each circle, and no others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import contourpy
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

FINE = 501
"""Points along each of joints 2 and 3 at which |w| is taken."""
RADII = 601
ANGLES = np.linspace(-np.pi, np.pi, 1440, endpoint=False)


@dataclass(frozen=True)
class LeastCut:
    """The radii that every function must cut [m]. A circle that needs k jumps counts k times in the length."""

    inner: float
    outer: float
    length: float


@dataclass(frozen=True)
class SingleJump:
    """The shortest curve of single jumps [m], and what it counts in pairs of grid neighbours times the step."""

    length: float
    pairs: float


@dataclass(frozen=True)
class _Circle:
    """What the postures of one circle allow."""

    closed: bool
    """Some closed curve of postures serves the whole circle."""
    whole: bool
    """Every pose of the circle is in reach."""
    span: float
    """The longest arc that one connected piece of postures serves [rad]."""
    jumps: tuple[tuple[float, float], ...]
    """(least, most) polar angle of a single jump [rad], the least within +-pi"""


def _circles(links: Sequence[float], limits: Sequence[tuple[float, float]], radii: np.ndarray) -> list[_Circle]:
    a, b, c = links
    low, high = limits[0]
    q2, q3 = (np.linspace(*limit, FINE) for limit in limits[1:])

    def w(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return a + np.exp(1j * first) * (b + c * np.exp(1j * second))

    levels = contourpy.contour_generator(q2, q3, np.abs(w(q2[None], q3[:, None])))
    circles = []
    for radius in radii:
        closed, reached, span, jumps = False, np.zeros(len(ANGLES), bool), 0.0, []
        for points in levels.lines(float(radius)):
            line = np.asarray(points)
            turned = np.unwrap(np.angle(w(*line.T)))
            ends = bool(np.allclose(line[0], line[-1]))
            closed |= ends and abs(turned[-1] - turned[0]) > np.pi
            least, most = turned.min() + low, turned.max() + high
            reached |= (ANGLES - least) % (2 * np.pi) <= most - least
            span = max(span, float(most - least))
            if most - 2 * np.pi >= least:
                start = (least + np.pi) % (2 * np.pi) - np.pi
                jumps.append((start, start + most - 2 * np.pi - least))
        circles.append(_Circle(closed, bool(reached.all()), span, tuple(jumps)))
    return circles


def _radii(links: Sequence[float]) -> np.ndarray:
    return (np.arange(RADII) + 0.5) / RADII * sum(links)


def least_cut(links: Sequence[float], limits: Sequence[tuple[float, float]]) -> LeastCut:
    """Which circles every function cuts: those wholly in reach that no closed curve of postures serves.

    Args:
        links: lengths of the three links [m].
        limits: (lower, upper) of the three joints, each within +-pi [rad].
    """
    radii = _radii(links)
    circles = _circles(links, limits, radii)
    jumps = np.array([np.ceil(2 * np.pi / c.span - 1e-9) if c.whole and not c.closed else 0 for c in circles])
    if not jumps.any():
        return LeastCut(0.0, 0.0, 0.0)
    half, cut = sum(links) / RADII / 2, radii[jumps > 0]
    return LeastCut(float(cut[0] - half), float(cut[-1] + half), float(jumps.mean() * sum(links)))


def single_jump(links: Sequence[float], limits: Sequence[tuple[float, float]], cells: int = 200) -> SingleJump:
    """The shortest curve of jumps when each circle has one: a shortest path over the corners of the cells of a grid.

    Args:
        links: lengths of the three links [m].
        limits: (lower, upper) of the three joints, each within +-pi [rad].
        cells: poses along a side of the grid, an even number.
    """
    circles, size, reach = _circles(links, limits, _radii(links)), cells + 1, float(sum(links))
    axis = np.linspace(-reach, reach, size)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    rung = np.minimum((np.hypot(x, y) / reach * RADII).astype(int), RADII - 1)
    angle = np.arctan2(y, x)
    cut = np.array([c.whole and not c.closed for c in circles])
    if not cut.any():
        return SingleJump(0.0, 0.0)
    first, last = (int(np.flatnonzero(cut)[end]) for end in (0, -1))
    allowed = np.zeros(len(x), bool)
    wide = 0.5 * (axis[1] - axis[0]) / np.maximum(np.hypot(x, y), 1e-9)
    for at in np.flatnonzero((rung >= first) & (rung <= last)):
        spans = circles[rung[at]].jumps
        allowed[at] = any((angle[at] - lo + wide[at]) % (2 * np.pi) <= hi - lo + 2 * wide[at] for lo, hi in spans)
    inside, outside = np.flatnonzero(rung < first), np.flatnonzero(rung > last)
    allowed[inside] = allowed[outside] = True

    def shortest(moves: Sequence[tuple[int, int]]) -> float:
        rows, columns, weights = [], [], []
        place = np.arange(size * size).reshape(size, size)
        for i, j in moves:
            here = place[: size - i, max(0, -j) : size - max(0, j)].ravel()
            there = place[i:, max(0, j) : size + min(0, j)].ravel()
            open_ = allowed[here] & allowed[there]
            for part in np.arange(1, 2 * max(i, abs(j))) / (2 * max(i, abs(j))):
                open_ &= allowed[here + round(part * i) * size + round(part * j)]
            free = np.isin(here[open_], inside) & np.isin(there[open_], inside)
            rows.append(here[open_])
            columns.append(there[open_])
            weights.append(np.where(free, 1e-12, np.hypot(i, j) * (axis[1] - axis[0])))
        graph = csr_array(
            (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(size**2,) * 2
        )
        return float(dijkstra(graph, directed=False, indices=inside, min_only=True)[outside].min())

    fan = [(i, j) for i in range(6) for j in range(-5, 6) if gcd(i, j) == 1 and (i > 0 or j > 0)]
    return SingleJump(shortest(fan), shortest([(0, 1), (1, 0)]))
