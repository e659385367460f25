"""A referee without holokin: the shortest cuts of a planar arm with one posture for each pose of a grid.

Part of `python -m benchmarks.sheets`. The arm has three links.

A pose is a position p of the tool in the plane. Its self-motion is a curve in the three joints, in closed form: one
joint is given, the two others follow from a triangle. Each grid pose gets some hundred postures of that curve, those
within the limits, and one of them is chosen. Two poses beside each other are cut where a joint changes by more than
`speed` times the step between them, and the length of the cuts is the number of these pairs times the step: a cut
along the diagonal counts sqrt 2 of its length.

The search for the fewest pairs is that of image labelling: a proposal gives every pose a posture (the one nearest to
a random target, pose by pose or spread from the middle with the fewest cuts); each pose of a cut takes the posture
that cuts least; two answers are mixed by a minimum cut of a graph, which never is worse than the first. What it finds
is an upper bound of the optimum; `least_cut` and `single_jump` are the lower ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import gcd

import contourpy
import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra, maximum_flow
from scipy.spatial import KDTree

SIDES = ((0, 1), (2, 1), (1, 0), (1, 2))
CUT, EVEN = 1000, 20
"""Costs in a minimum cut: of a cut pair, and at most of the joints' change over a kept one."""
Limits = Sequence[tuple[float, float]]
Free = Callable[[np.ndarray], np.ndarray]


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The same angles within +-pi [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def forward(links: Sequence[float], q: np.ndarray) -> np.ndarray:
    """The tool (..., 2) of a planar arm at q (..., n) [m]."""
    turned = np.cumsum(q, -1)
    return np.stack([np.cos(turned) @ np.asarray(links), np.sin(turned) @ np.asarray(links)], -1)


def self_motions(links: Sequence[float], limits: Limits, points: np.ndarray, count: int) -> np.ndarray:
    """Postures (3, k, 6 count) of k poses: each joint takes `count` values within its limits; NaN beyond them."""
    a, b, c = links
    target = (points[:, 0] + 1j * points[:, 1])[:, None]
    distance, turn = np.abs(target), np.angle(target)
    given = [np.linspace(*limit, count)[None] for limit in limits]
    found = []
    with np.errstate(invalid="ignore", divide="ignore"):
        for sign in (1, -1):
            rest = target * np.exp(-1j * given[0]) - a
            q3 = sign * np.arccos((np.abs(rest) ** 2 - b**2 - c**2) / (2 * b * c))
            found.append((np.angle(rest) - np.angle(b + c * np.exp(1j * q3)), q3))
            elbow = a + b * np.exp(1j * given[1])
            far = np.abs(elbow)
            bend = sign * np.arccos((distance**2 - far**2 - c**2) / (2 * c * far))
            found.append((given[1] + 0 * bend, np.angle(elbow) + bend - given[1]))
            fore = b + c * np.exp(1j * given[2])
            far = np.abs(fore)
            bend = sign * np.arccos((distance**2 - far**2 - a**2) / (2 * a * far))
            found.append((bend - np.angle(fore), given[2] + 0 * bend))
    q2, q3 = (wrapped(np.concatenate([pair[k] for pair in found], 1)) for k in (0, 1))
    q1 = wrapped(turn - np.angle(a + np.exp(1j * q2) * (b + c * np.exp(1j * q3))))
    q = np.stack([q1, q2, q3])
    low, high = np.transpose(limits)[:, :, None, None]
    within = ((q >= low - 1e-9) & (q <= high + 1e-9)).all(0)
    return np.where(within, q, np.nan).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Grid:
    """The poses of a grid that some posture within the limits reaches, and their postures."""

    links: tuple[float, ...]
    limits: tuple[tuple[float, float], ...]
    points: np.ndarray
    """(k, 2) [m]"""
    labels: np.ndarray
    """(3, k, s) postures, NaN where there is none [rad]"""
    beside: np.ndarray
    """(k, 4) the poses beside each, -1 where there is none"""
    step: float
    threshold: float
    """A pair is cut where a joint changes by more [rad]."""

    @cached_property
    def pairs(self) -> np.ndarray:
        """(e, 2) poses beside each other, each pair once."""
        first = np.repeat(np.arange(len(self.points)), 4)
        pairs = np.stack([first, self.beside.ravel()], 1)
        return pairs[pairs[:, 0] < pairs[:, 1]]

    @cached_property
    def odd(self) -> np.ndarray:
        """(k,) the black squares of a chess board."""
        return (np.rint(self.points / self.step - 0.5).sum(1) % 2).astype(bool)

    def jumps(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """(e,) how much a joint changes from one end of each pair, of `first`, to the other, of `second` [rad]."""
        return np.abs(first[self.pairs[:, 0]] - second[self.pairs[:, 1]]).max(1)

    def cut(self, q: np.ndarray) -> np.ndarray:
        """(e,) True where a pair is cut."""
        return self.jumps(q, q) > self.threshold


def planar_grid(
    links: Sequence[float], limits: Limits, cells: int, count: int = 40, speed: float = 10.0, free: Free | None = None
) -> Grid:
    """The grid of cells x cells poses over the square round the disc of reach, and the postures of its poses."""
    reach = float(sum(links))
    step = 2 * reach / cells
    axis = -reach + step * (np.arange(cells) + 0.5)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    inside = np.flatnonzero(np.hypot(*points.T) <= reach)
    labels = self_motions(links, limits, points[inside], count)
    if free is not None:
        flat = labels.reshape(3, -1)
        there = np.flatnonzero(np.isfinite(flat[0]))
        flat[:, there[~free(flat[:, there].T)]] = np.nan
    kept = np.isfinite(labels[0]).any(1)
    number = np.full(cells * cells, -1)
    number[inside[kept]] = np.arange(int(kept.sum()))
    framed = np.pad(number.reshape(cells, cells), 1, constant_values=-1)
    beside = np.stack([framed[i : i + cells, j : j + cells].ravel() for i, j in SIDES], 1)[inside[kept]]
    ranges = tuple((float(low), float(high)) for low, high in limits)
    return Grid(tuple(links), ranges, points[inside[kept]], labels[:, kept], beside, step, speed * step)


def _largest(labels: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(k, s) the largest change of a joint from q (k, 3) to each posture (3, k, s).

    NumPy's maximum along an axis of three numbers takes ten times as long.
    """
    change = np.abs(labels[0] - q[:, 0, None])
    for joint in (1, 2):
        np.maximum(change, np.abs(labels[joint] - q[:, joint, None]), out=change)
    return change


def _nearest(grid: Grid, away: np.ndarray) -> np.ndarray:
    """The posture (k, 3) of each pose that is the least far (k, s)."""
    return grid.labels[:, np.arange(away.shape[0]), away.argmin(1)].T


def _chosen(grid: Grid, poses: np.ndarray, q: np.ndarray, cost: np.ndarray | None) -> np.ndarray:
    """The posture of each of these poses that cuts the fewest pairs with those beside it, then that of least cost."""
    labels = grid.labels[:, poses]
    score = np.zeros(labels.shape[1:], np.float32) if cost is None else 1e-3 * cost[poses]
    for side in range(4):
        other = grid.beside[poses, side]
        there = np.flatnonzero(other >= 0)
        there = there[np.isfinite(q[other[there], 0])]
        jump = _largest(labels[:, there], q[other[there]])
        score[there] += (jump > grid.threshold) + (1e-3 * jump if cost is None else 0)
    score[~np.isfinite(labels[0])] = np.inf
    return labels[:, np.arange(len(poses)), score.argmin(1)].T


def _spread(grid: Grid, start: int, cost: np.ndarray) -> np.ndarray:
    """Postures of all poses, ring by ring about `start`; a part that is apart begins with its cheapest posture."""
    q = np.full((len(grid.points), 3), np.nan, np.float32)
    done = np.zeros(len(q), bool)
    front = np.array([start])
    while True:
        q[front], done[front] = _chosen(grid, front, q, cost), True
        front = np.unique(grid.beside[front])
        front = front[(front >= 0)]
        front = front[~done[front]]
        if not len(front):
            if done.all():
                return q
            front = np.flatnonzero(~done)[:1]


def settled(grid: Grid, q: np.ndarray, rounds: int = 8) -> np.ndarray:
    """The poses at cuts take in turn, black squares before white ones, the posture that cuts least."""
    q = q.copy()
    for _ in range(rounds):
        for side in (grid.odd, ~grid.odd):
            poses = np.unique(grid.pairs[grid.cut(q)])
            poses = poses[side[poses]]
            if len(poses):
                q[poses] = _chosen(grid, poses, q, None)
    return q


def mixed(grid: Grid, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Of the two postures of each pose one, so that the pairs cost least together: a minimum cut of a graph.

    A pair that is cut in both answers and in no mixture of them is beyond such a cut; its mixtures cost more here.
    """

    def cost(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        jump = grid.jumps(one, other)
        return CUT * (jump > grid.threshold) + np.minimum(EVEN * jump / grid.threshold, EVEN).astype(np.int64)

    a, b = grid.pairs.T
    both, none = cost(second, second), cost(first, first)
    left, right = cost(first, second), cost(second, first)
    lack = np.maximum(both + none - left - right, 0)
    left, right = left + (lack + 1) // 2, right + lack // 2
    alone = np.zeros(len(first), np.int64)
    np.add.at(alone, a, right - none)
    np.add.at(alone, b, both - right)
    weight = left + right - both - none
    source, sink = len(first), len(first) + 1
    joined, dear, cheap = np.flatnonzero(weight), np.flatnonzero(alone > 0), np.flatnonzero(alone < 0)
    rows = np.concatenate([a[joined], np.full(len(dear), source), cheap])
    columns = np.concatenate([b[joined], dear, np.full(len(cheap), sink)])
    room = np.concatenate([weight[joined], alone[dear], -alone[cheap]]).astype(np.int32)
    graph = csr_array((room, (rows, columns)), shape=(len(first) + 2,) * 2)
    left_over = csr_array(graph - maximum_flow(graph, source, sink).flow)
    left_over.data[left_over.data < 0] = 0
    left_over.eliminate_zeros()
    stays = np.zeros(len(first) + 2, bool)
    stays[breadth_first_order(left_over, source, return_predecessors=False)] = True
    return np.where(stays[:-2, None], first, second)


def _target(grid: Grid, rng: np.random.Generator) -> np.ndarray:
    """(k, s) the squared distance of each posture from a random target, which may turn with the polar angle."""
    widest = max(high for _, high in grid.limits)
    middle = rng.uniform(-1, 1, 3) * widest * rng.uniform()
    weight = rng.exponential(1.0, 3) ** 2
    seam = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else np.pi + rng.uniform(-0.5, 0.5)
    angle = (np.arctan2(grid.points[:, 1], grid.points[:, 0]) - seam) % (2 * np.pi) - np.pi
    grows = np.minimum(1, np.hypot(*grid.points.T) / rng.uniform(0.02, 0.8) / sum(grid.links))
    share = np.array([rng.uniform(0.3, 1), *rng.uniform(-0.3, 0.3, 2)])
    target = middle + (grows * angle)[:, None] * share
    return _away(grid, target, weight / weight.sum())


def _away(grid: Grid, target: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k, s) the squared distance of each posture from the target (k, 3) of its pose, inf where there is none."""
    target = target.astype(np.float32)
    away = sum(np.float32(weight[j]) * (grid.labels[j] - target[:, j, None]) ** 2 for j in range(3))
    return np.where(np.isfinite(away), away, np.inf)


def searched(grid: Grid, proposals: int, rng: np.random.Generator, best: np.ndarray | None = None) -> np.ndarray:
    """The postures (k, 3) with the fewest cut pairs that these many proposals of each kind find [rad]."""
    middle = int(np.hypot(*grid.points.T).argmin())
    best = settled(grid, _nearest(grid, _target(grid, rng))) if best is None else best
    for _ in range(max(1, proposals)):
        away = _target(grid, rng)
        for proposal in (_nearest(grid, away), _spread(grid, middle, away)):
            answer = settled(grid, proposal)
            tried = [best, answer, settled(grid, mixed(grid, best, answer))]
            best = min(tried, key=lambda q: int(grid.cut(q).sum()))
    return best


@dataclass(frozen=True, eq=False)
class Resolution:
    """One posture for each pose of a grid, and where neighbours are cut."""

    grid: Grid
    q: np.ndarray
    """(k, 3) [rad]"""
    seconds: float

    @cached_property
    def middles(self) -> np.ndarray:
        """(c, 2) the points between the poses of each cut pair [m]."""
        return self.grid.points[self.grid.pairs[self.grid.cut(self.q)]].mean(1)

    @property
    def cut_length(self) -> float:
        """Cut pairs times the step [m]."""
        return len(self.middles) * self.grid.step

    @property
    def pieces(self) -> int:
        """How many cuts that is, those that touch counted as one."""
        return cut_pieces(self.middles, self.grid.step)

    @property
    def resolved(self) -> float:
        """The share of the reachable poses that have a posture: all of them."""
        return float(np.isfinite(self.q[:, 0]).mean())

    @property
    def speed(self) -> float:
        """The largest change of a joint over a pair that is not cut, by the step [rad/m]."""
        jumps = self.grid.jumps(self.q, self.q)
        return float(jumps[jumps <= self.grid.threshold].max() / self.grid.step)


def cut_pieces(middles: np.ndarray, step: float) -> int:
    """How many pieces cut pairs form, with the points (c, 2) between their poses: those within 1.5 steps are one."""
    if not len(middles):
        return 0
    near = KDTree(middles).query_pairs(1.5 * step, output_type="ndarray")
    graph = coo_array((np.ones(len(near)), near.T), shape=(len(middles),) * 2)
    return int(connected_components(graph, directed=False)[0])


def grid_resolution(
    links: Sequence[float] = (1.0, 1.0, 1.0), limits: Limits = ((-2.618, 2.618),) * 3, cells: int = 200,
    proposals: int = 60, count: int = 40, speed: float = 10.0, free: Free | None = None, seed: int = 0,
) -> Resolution:  # fmt: skip
    """The shortest cuts found on a grid.

    Most proposals are tried on a grid of half the cells each way; their best is carried over, and a few more are tried.

    Args:
        links: lengths of the three links [m].
        limits: (lower, upper) of the three joints, each within +-pi [rad].
        cells: poses along a side of the grid.
        proposals: how many random targets are tried.
        count: how many values each joint takes in turn along a self-motion.
        speed: a pair is cut where a joint changes by more than this times the step [rad/m].
        free: postures (k, 3) -> (k,) True where an obstacle leaves them.
        seed: of the random targets.
    """
    began, rng = time.process_time(), np.random.default_rng(seed)
    coarse = planar_grid(links, limits, cells // 2, count, speed, free)
    rough = searched(coarse, proposals, rng)
    grid = planar_grid(links, limits, cells, count, speed, free)
    wanted = rough[KDTree(coarse.points).query(grid.points)[1]]
    away = _away(grid, wanted, np.ones(3))
    spread = _spread(grid, int(np.hypot(*grid.points.T).argmin()), away)
    best = min((settled(grid, q, 20) for q in (_nearest(grid, away), spread)), key=lambda q: int(grid.cut(q).sum()))
    best = settled(grid, searched(grid, max(1, proposals // 10), rng, best), 20)
    return Resolution(grid, best, time.process_time() - began)


# --- How short can the cuts of a planar arm of three links be? Part of `python -m benchmarks.sheets`.
#
# The tool stands at p = exp(i q1) w(q2, q3), w = a + exp(i q2) (b + c exp(i q3)). A function of p that is continuous on
# a whole circle about the base comes back to its q1, and w goes once round zero. So the joints follow a closed curve
# |w| = r within the limits of joints 2 and 3 that encloses a zero of w. Where the limits cut every such curve, each
# function has a cut on that circle, and the cuts are as long as all these radii together: that is `least_cut`.
#
# With one jump on the circle, at the polar angle s, the joints follow a connected piece of |w| = r. Let arg w run from
# u to v on it and q1 from l to h: then u + l <= s <= v + h - 2 pi. `single_jump` is the shortest curve through these
# (r, s), from the circles that need no cut to those that are not wholly in reach. It bounds functions with one jump on
# each circle, and no others.


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


# --- Our rerun of a published method, global redundancy resolution, for planar arms; it is not the authors' code.
#
# Hauser and Emmons (2018, and Hauser 2016) give each node of a grid of tool positions many sampled postures. Two
# postures of neighbouring nodes are joined when the straight line between them, moved onto the straight line of the
# tool, makes no large step. One posture a node is then chosen so that the most pairs stay joined: first the nodes with
# the fewest postures left that fit all neighbours, then by turns each node in conflict takes the posture with the
# fewest conflicts. Here that is done in short form: postures are sampled at all nodes at once and then from their
# neighbours', and each posture is tried with the nearest few of a neighbour's. Their code is public under GPL-3.0.


NEAREST = 5
"""Postures of the neighbour that each posture is tried with."""
PARTS = 8
"""Parts of the straight line between two postures."""
GUESSES, ROUNDS = 4, 30
"""Random choices that the descent begins with, beside the heuristic one; its rounds."""


@dataclass(frozen=True, eq=False)
class Roadmap:
    """One posture for each node of a grid, and which pairs it joins."""

    points: np.ndarray
    """(k, 2) [m]"""
    q: np.ndarray
    """(k, n) [rad], NaN where no posture was found"""
    pairs: np.ndarray
    """(e, 2) neighbours, both with a posture"""
    joined: np.ndarray
    """(e,)"""
    step: float
    seconds: float


def moved_to(links: Sequence[float], limits: Limits, q: np.ndarray, points: np.ndarray, rounds: int) -> np.ndarray:
    """Postures (..., n) near q with the tool at points (..., 2), by Newton steps of least norm within the limits."""
    low, high = np.transpose(limits)
    for _ in range(rounds):
        turned = np.cumsum(q, -1)
        bars = np.stack([-np.sin(turned) * links, np.cos(turned) * links], -2)
        J = np.flip(np.cumsum(np.flip(bars, -1), -1), -1)
        a, b, c = (J[..., 0, :] ** 2).sum(-1), (J[..., 0, :] * J[..., 1, :]).sum(-1), (J[..., 1, :] ** 2).sum(-1)
        off = points - forward(links, q)
        scale = np.maximum(a * c - b * b, 1e-9)
        u, v = (c * off[..., 0] - b * off[..., 1]) / scale, (a * off[..., 1] - b * off[..., 0]) / scale
        q = np.clip(q + np.clip(J[..., 0, :] * u[..., None] + J[..., 1, :] * v[..., None], -0.5, 0.5), low, high)
    return q


def _samples(
    links: Sequence[float], limits: Limits, points: np.ndarray, beside: np.ndarray, count: int,
    rng: np.random.Generator, free: Free | None,
) -> np.ndarray:  # fmt: skip
    """(k, count, n) postures, NaN where the search failed: half from random ones, half from those of the neighbours."""
    low, high = np.transpose(limits)
    goal = points[:, None]
    q = moved_to(links, limits, rng.uniform(low, high, (len(points), count, len(links))), goal, 25)
    half, k = count // 2, np.arange(len(points))[:, None]
    other = beside[k, rng.integers(0, 4, (len(points), half))]
    other = np.where(other >= 0, other, k)
    q[:, half : 2 * half] = moved_to(links, limits, q[other, rng.integers(0, half, other.shape)], goal, 15)
    q[np.abs(forward(links, q) - goal).max(-1) > 1e-6] = np.nan
    if free is not None:
        known = np.isfinite(q[..., 0])
        q[known] = np.where(free(q[known])[:, None], q[known], np.nan)
    return q


def _joined(
    links: Sequence[float], limits: Limits, ends: np.ndarray, points: np.ndarray, free: Free | None
) -> np.ndarray:
    """(c,) whether straight lines between postures (2, c, n), moved onto those of points (2, c, 2), stay whole."""
    share = np.arange(1, PARTS)[:, None, None] / PARTS
    line = (1 - share) * ends[0] + share * ends[1]
    goal = (1 - share) * points[0] + share * points[1]
    on = moved_to(links, limits, line, goal, 3)
    exact = np.abs(forward(links, on) - goal).max((0, 2)) < 1e-3
    if free is not None:
        exact &= free(on.reshape(-1, on.shape[-1])).reshape(on.shape[:2]).all(0)
    steps = np.diff(np.concatenate([ends[:1], on, ends[1:]]), axis=0)
    far = np.linalg.norm(ends[1] - ends[0], axis=-1)
    return exact & (np.linalg.norm(steps, axis=-1).max(0) <= len(links) * far / PARTS + 1e-3)


def _network(
    links: Sequence[float], limits: Limits, points: np.ndarray, pairs: np.ndarray, q: np.ndarray, free: Free | None
) -> np.ndarray:
    """(e, count, count) which posture of the first node is joined with which of the second."""
    network = np.zeros((len(pairs), q.shape[1], q.shape[1]), bool)
    for part in np.array_split(np.arange(len(pairs)), 1 + len(pairs) // 256):
        i, j = pairs[part].T
        far = np.sqrt(sum((q[i][:, :, None, k] - q[j][:, None, :, k]) ** 2 for k in range(q.shape[2])))
        far[~np.isfinite(far)] = np.inf
        near = np.argpartition(far, NEAREST, axis=2)[:, :, :NEAREST]
        e, a, _ = (places.ravel() for places in np.indices(near.shape))
        b = near.ravel()
        there = np.isfinite(far[e, a, b])
        e, a, b = e[there], a[there], b[there]
        ends, places = np.stack([q[i[e], a], q[j[e], b]]), np.stack([points[i[e]], points[j[e]]])
        whole = _joined(links, limits, ends, places, free)
        network[part[e[whole]], a[whole], b[whole]] = True
    return network


class _Choice:
    """One posture a node so that the most pairs are joined."""

    def __init__(self, network: np.ndarray, pairs: np.ndarray, known: np.ndarray) -> None:
        self.known, self.count = known, known.shape[1]
        self.pairs, self.network = pairs, network
        self.around: list[list[tuple[int, np.ndarray]]] = [[] for _ in known]
        for e, (i, j) in enumerate(pairs):
            self.around[i].append((int(j), network[e].T))
            self.around[j].append((int(i), network[e]))

    def votes(self, node: int, chosen: np.ndarray) -> np.ndarray:
        """(count,) with how many of its neighbours each posture of a node is joined."""
        found = np.zeros(self.count)
        for other, joins in self.around[node]:
            if chosen[other] >= 0:
                found += joins[chosen[other]]
        return np.where(self.known[node], found, -1)

    def heuristic(self) -> np.ndarray:
        """By turns the node with the fewest postures left that fit; of these, the one that leaves others most."""
        chosen = np.full(len(self.known), -1)
        left = self.known.sum(1).astype(float)
        left[left == 0] = np.inf
        offers = [sum((joins.sum(0) for _, joins in near), np.zeros(self.count)) for near in self.around]
        while np.isfinite(left).any():
            node = int(left.argmin())
            left[node] = np.inf
            chosen[node] = int((self.votes(node, chosen) + 1e-4 * offers[node]).argmax())
            for other, _ in self.around[node]:
                if np.isfinite(left[other]):
                    votes = self.votes(other, chosen)
                    left[other] = (votes == votes.max()).sum() - 0.01 * votes.max()
        return chosen

    def joined(self, chosen: np.ndarray) -> np.ndarray:
        """(e,) which pairs are joined."""
        i, j = self.pairs.T
        return self.network[np.arange(len(self.pairs)), chosen[i], chosen[j]]

    def descended(self, chosen: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Nodes in conflict take by turns a posture with the fewest conflicts, until nothing gets better."""
        chosen, best = chosen.copy(), -1
        for _ in range(ROUNDS):
            joined = self.joined(chosen)
            if joined.sum() <= best:
                break
            best = int(joined.sum())
            for node in rng.permutation(np.unique(self.pairs[~joined])):
                votes = self.votes(node, chosen)
                chosen[node] = rng.choice(np.flatnonzero(votes == votes.max()))
        return chosen


def grid_roadmap(
    links: Sequence[float], limits: Limits, cells: int = 50, count: int = 50, seed: int = 0, free: Free | None = None
) -> Roadmap:
    """A resolution of the disc of reach of a planar arm by the published method.

    Args:
        links: lengths of the links [m].
        limits: (lower, upper) of each joint [rad].
        cells: nodes along a side of the square round the disc.
        count: postures sampled at each node.
        seed: of the random numbers.
        free: postures (k, n) -> (k,) True where an obstacle leaves them.
    """
    began, rng = time.process_time(), np.random.default_rng(seed)
    reach = float(sum(links))
    step = 2 * reach / cells
    axis = -reach + step * (np.arange(cells) + 0.5)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    points = points[np.hypot(*points.T) <= reach]
    number = {tuple(place): k for k, place in enumerate(np.rint(points / step - 0.5).astype(int).tolist())}
    beside = np.array(
        [[number.get((i + a, j + b), -1) for a, b in ((-1, 0), (1, 0), (0, -1), (0, 1))] for i, j in number]
    )
    q = _samples(links, limits, points, beside, count, rng, free)
    known: np.ndarray = np.isfinite(q[..., 0])
    some: np.ndarray = np.asarray(known.any(axis=1))
    first = np.repeat(np.arange(len(points)), 4)
    pairs = np.stack([first, beside.ravel()], 1)
    pairs = pairs[(pairs[:, 0] < pairs[:, 1]) & some[pairs].all(1)]
    choice = _Choice(_network(links, limits, points, pairs, q, free), pairs, known)
    begin = [choice.heuristic()]
    begin += [np.array([rng.choice(np.flatnonzero(row)) if row.any() else -1 for row in known]) for _ in range(GUESSES)]
    answers = [choice.descended(one, rng) for one in begin]
    best = max(answers, key=lambda one: int(choice.joined(one).sum()))
    found = np.where(some[:, None], q[np.arange(len(q)), best], np.nan)
    return Roadmap(points, found, pairs, choice.joined(best), step, time.process_time() - began)
