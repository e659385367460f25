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
is an upper bound of the optimum; `grid_bounds` has the lower ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow
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
