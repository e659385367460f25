"""One posture for each tool position of a planar arm: `hk.sheets` beside minimum cuts on a grid, in one run.

    python -m benchmarks.grids                          # three links of 1 m, joints within +-150 degrees
    python -m benchmarks.grids --post 1.2 0.9 0.3       # with an obstacle: a round post (x, y, radius)

Each method gives the positions of a grid a posture. Two positions beside each other are cut where a joint changes by
more than 10 rad for each metre between them. The length of the cuts is the number of cut pairs times the step of the
grid: a cut along the diagonal counts sqrt 2 of its length. Paths are straight, 2 m long and wholly in reach; a grid is
asked at the nearest position every 5 mm.

The referee has nothing of holokin. The self-motion of a position is a curve in the three joints, in closed form: one
joint is given, the two others follow from a triangle. Each position gets some hundred postures of it within the limits,
and one is chosen, by the search of image labelling: a proposal gives every position a posture (the one nearest to a
random target, alone or spread from the middle with the fewest cuts); each position of a cut takes the posture that cuts
least; two answers are mixed by a minimum cut of a graph, which never is worse than the first.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow
from scipy.spatial import KDTree

import holokin as hk

REACH = 3.0
"""Of the arm, three links of 1 m [m]."""

LIMIT = np.radians(150)
"""Of each joint, both ways [rad]."""

SPEED = 10.0
"""A pair is cut where a joint changes by more for each metre between its positions [rad/m]."""

LENGTH, SPACING = 2.0, 0.005
"""Of a path, and between its samples [m]."""

SIDES = ((0, 1), (2, 1), (1, 0), (1, 2))
CUT, EVEN = 1000, 20
"""Costs in a minimum cut: of a cut pair, and at most of the joints' change over a kept one."""

HEAD = "| method | positions | with a posture | cuts | their length | changes a path | median rad/m | time |"
Free = Callable[[np.ndarray], np.ndarray]
"""Postures (k, 3) -> (k,) True where an obstacle leaves them."""


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The same angles within +-pi [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def self_motions(points: np.ndarray, count: int) -> np.ndarray:
    """Postures (3, k, 6 count) of positions (k, 2): each joint takes `count` values within its limits; NaN beyond."""
    target = (points[:, 0] + 1j * points[:, 1])[:, None]
    distance, given, pairs = np.abs(target), np.linspace(-LIMIT, LIMIT, count)[None], []
    with np.errstate(invalid="ignore", divide="ignore"):
        for sign in (1, -1):
            # Joint 1 is given: the two outer links reach from its elbow to the tool.
            rest = target * np.exp(-1j * given) - 1
            q3 = sign * np.arccos((np.abs(rest) ** 2 - 2) / 2)
            pairs.append((np.angle(rest) - np.angle(1 + np.exp(1j * q3)), q3))
            # Joint 2 or joint 3 is given: two links are one stiff bar, which makes a triangle with the third.
            bar = 1 + np.exp(1j * given)
            far = np.abs(bar)
            bend = sign * np.arccos((distance**2 - far**2 - 1) / (2 * far))
            pairs.append((given + 0 * bend, np.angle(bar) + bend - given))
            pairs.append((bend - np.angle(bar), given + 0 * bend))
    q2, q3 = (wrapped(np.concatenate([pair[k] for pair in pairs], 1)) for k in (0, 1))
    q1 = wrapped(np.angle(target) - np.angle(1 + np.exp(1j * q2) * (1 + np.exp(1j * q3))))
    q = np.stack([q1, q2, q3])
    return np.where((np.abs(q) <= LIMIT + 1e-9).all(0), q, np.nan).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Grid:
    """The positions of a grid that some posture within the limits reaches, and their postures."""

    points: np.ndarray
    """(k, 2) [m]"""
    labels: np.ndarray
    """(3, k, s) postures, NaN where there is none [rad]"""
    beside: np.ndarray
    """(k, 4) the positions beside each, -1 where there is none"""
    step: float

    @cached_property
    def pairs(self) -> np.ndarray:
        """(e, 2) positions beside each other, each pair once."""
        pairs = np.stack([np.repeat(np.arange(len(self.points)), 4), self.beside.ravel()], 1)
        return pairs[pairs[:, 0] < pairs[:, 1]]

    @cached_property
    def odd(self) -> np.ndarray:
        """(k,) the black squares of a chess board."""
        return (np.rint(self.points / self.step - 0.5).sum(1) % 2).astype(bool)

    @property
    def threshold(self) -> float:
        """A pair is cut where a joint changes by more [rad]."""
        return SPEED * self.step

    def jumps(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """(e,) how much a joint changes from one end of each pair, of `first`, to the other, of `second` [rad]."""
        return np.abs(first[self.pairs[:, 0]] - second[self.pairs[:, 1]]).max(1)

    def cut(self, q: np.ndarray) -> np.ndarray:
        """(e,) True where a pair is cut."""
        return self.jumps(q, q) > self.threshold


def planar_grid(cells: int, count: int = 40, free: Free | None = None) -> Grid:
    """The grid of cells x cells positions over the square round the disc of reach, and their postures."""
    step = 2 * REACH / cells
    axis = -REACH + step * (np.arange(cells) + 0.5)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    inside = np.flatnonzero(np.hypot(*points.T) <= REACH)
    labels = self_motions(points[inside], count)
    if free is not None:
        flat = labels.reshape(3, -1)
        there = np.flatnonzero(np.isfinite(flat[0]))
        flat[:, there[~free(flat[:, there].T)]] = np.nan
    reached = np.isfinite(labels[0]).any(1)
    number = np.full(cells * cells, -1)
    number[inside[reached]] = np.arange(int(reached.sum()))
    framed = np.pad(number.reshape(cells, cells), 1, constant_values=-1)
    beside = np.stack([framed[i : i + cells, j : j + cells].ravel() for i, j in SIDES], 1)[inside[reached]]
    return Grid(points[inside[reached]], labels[:, reached], beside, step)


def _largest(labels: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(k, s) the largest change of a joint from q (k, 3) to each posture (3, k, s).

    NumPy's maximum along an axis of three numbers takes ten times as long.
    """
    change = np.abs(labels[0] - q[:, 0, None])
    for joint in (1, 2):
        np.maximum(change, np.abs(labels[joint] - q[:, joint, None]), out=change)
    return change


def _nearest(grid: Grid, away: np.ndarray) -> np.ndarray:
    """The posture (k, 3) of each position that is the least far (k, s)."""
    return grid.labels[:, np.arange(away.shape[0]), away.argmin(1)].T


def _chosen(grid: Grid, positions: np.ndarray, q: np.ndarray, cost: np.ndarray | None) -> np.ndarray:
    """Of these positions the posture that cuts the fewest pairs with those beside it, then that of least cost."""
    labels = grid.labels[:, positions]
    score = np.zeros(labels.shape[1:], np.float32) if cost is None else 1e-3 * cost[positions]
    for side in range(4):
        other = grid.beside[positions, side]
        there = np.flatnonzero(other >= 0)
        there = there[np.isfinite(q[other[there], 0])]
        jump = _largest(labels[:, there], q[other[there]])
        score[there] += (jump > grid.threshold) + (1e-3 * jump if cost is None else 0)
    score[~np.isfinite(labels[0])] = np.inf
    return labels[:, np.arange(len(positions)), score.argmin(1)].T


def _spread(grid: Grid, start: int, cost: np.ndarray) -> np.ndarray:
    """Postures of all positions, ring by ring about `start`; a part that is apart begins with its cheapest posture."""
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
    """The positions at cuts take in turn, black squares before white ones, the posture that cuts least."""
    q = q.copy()
    for _ in range(rounds):
        for side in (grid.odd, ~grid.odd):
            positions = np.unique(grid.pairs[grid.cut(q)])
            positions = positions[side[positions]]
            if len(positions):
                q[positions] = _chosen(grid, positions, q, None)
    return q


def mixed(grid: Grid, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Of the two postures of each position one, so that the pairs cost least together: a minimum cut of a graph.

    A pair that is cut in both answers and in no mixture of them is beyond such a cut; its mixtures cost more here.
    """

    def cost(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        jump = grid.jumps(one, other)
        return CUT * (jump > grid.threshold) + np.minimum(EVEN * jump / grid.threshold, EVEN).astype(np.int64)

    # The cost of a pair by which answers its ends take; made submodular, so that a minimum cut is the least sum.
    a, b = grid.pairs.T
    both, none = cost(second, second), cost(first, first)
    left, right = cost(first, second), cost(second, first)
    lack = np.maximum(both + none - left - right, 0)
    left, right = left + (lack + 1) // 2, right + lack // 2

    # The graph: an arc a pair for what its mixture costs, one to source or sink for what a position costs alone.
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

    # A position keeps its first posture where the source still reaches it past the minimum cut.
    left_over = csr_array(graph - maximum_flow(graph, source, sink).flow)
    left_over.data[left_over.data < 0] = 0
    left_over.eliminate_zeros()
    stays = np.zeros(len(first) + 2, bool)
    stays[breadth_first_order(left_over, source, return_predecessors=False)] = True
    return np.where(stays[:-2, None], first, second)


def _target(grid: Grid, rng: np.random.Generator) -> np.ndarray:
    """(k, s) the squared distance of each posture from a random target, which may turn with the polar angle."""
    middle = rng.uniform(-1, 1, 3) * LIMIT * rng.uniform()
    weight = rng.exponential(1.0, 3) ** 2
    seam = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else np.pi + rng.uniform(-0.5, 0.5)
    angle = (np.arctan2(grid.points[:, 1], grid.points[:, 0]) - seam) % (2 * np.pi) - np.pi
    grows = np.minimum(1, np.hypot(*grid.points.T) / rng.uniform(0.02, 0.8) / REACH)
    share = np.array([rng.uniform(0.3, 1), *rng.uniform(-0.3, 0.3, 2)])
    target = middle + (grows * angle)[:, None] * share
    return _away(grid, target, weight / weight.sum())


def _away(grid: Grid, target: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k, s) the squared distance of each posture from the target (k, 3) of its position, inf where there is none."""
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


def cut_pieces(middles: np.ndarray, step: float) -> int:
    """How many pieces cut pairs form, by the points (c, 2) midway: those within 1.5 steps are one."""
    if not len(middles):
        return 0
    near = KDTree(middles).query_pairs(1.5 * step, output_type="ndarray")
    graph = coo_array((np.ones(len(near)), near.T), shape=(len(middles),) * 2)
    return int(connected_components(graph, directed=False)[0])


def minimum_cuts(cells: int, proposals: int, free: Free | None = None, seed: int = 0) -> tuple[Grid, np.ndarray]:
    """(a grid, the postures (k, 3) of its positions with the shortest cuts found).

    Most proposals are tried on a grid of half the cells each way; their best is carried over, and a few more are tried.
    """
    rng = np.random.default_rng(seed)
    coarse = planar_grid(cells // 2, free=free)
    rough = searched(coarse, proposals, rng)
    grid = planar_grid(cells, free=free)
    away = _away(grid, rough[KDTree(coarse.points).query(grid.points)[1]], np.ones(3))
    spread = _spread(grid, int(np.hypot(*grid.points.T).argmin()), away)
    best = min((settled(grid, q, 20) for q in (_nearest(grid, away), spread)), key=lambda q: int(grid.cut(q).sum()))
    return grid, settled(grid, searched(grid, max(1, proposals // 10), rng, best), 20)


@dataclass(frozen=True)
class Post:
    """A round post (x, y, radius) [m] that the links, as lines, keep out of."""

    x: float
    y: float
    radius: float

    def free(self, q: np.ndarray) -> np.ndarray:
        """(k,) True where the three links keep out of it at postures (k, 3)."""
        turned = np.cumsum(q, -1)
        ends = np.cumsum(np.stack([np.cos(turned), np.sin(turned)], -1), 1)
        begin = np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], 1)
        along, to = ends - begin, np.array([self.x, self.y]) - begin
        share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
        return np.linalg.norm(to - share[..., None] * along, axis=-1).min(1) >= self.radius

    @property
    def scene(self) -> hk.Scene:
        """The same for holokin: in the plane of the arm a ball is a disc."""
        ball = hk.obstacle("post", hk.robot.Ellipsoid((self.radius,) * 3), (self.x, self.y, 0.0))
        return hk.Scene([ball], clearance=0.0, self_collision=False)


def in_reach(points: np.ndarray, free: Free | None = None) -> np.ndarray:
    """(k,) True where some posture has its tool at a point (k, 2)."""
    parts = []
    for part in np.array_split(points, 1 + len(points) // 4096):
        q = np.moveaxis(self_motions(part, 60), 0, -1)
        there = np.isfinite(q[..., 0])
        if free is not None:
            there[there] = free(q[there])
        parts.append(there.any(1))
    return np.concatenate(parts)


def random_paths(count: int, free: Free | None = None) -> np.ndarray:
    """Straight paths (count, s, 2), each sample in reach."""
    rng, paths = np.random.default_rng(0), []
    share = np.linspace(0, 1, round(LENGTH / SPACING) + 1)[:, None]
    while len(paths) < count:
        begin, turn = rng.uniform(-REACH, REACH, 2), rng.uniform(0, 2 * np.pi)
        path = begin + LENGTH * share * [np.cos(turn), np.sin(turn)]
        if in_reach(path[::50], free).all() and in_reach(path, free).all():
            paths.append(path)
    return np.array(paths)


def changes(grid: Grid, q: np.ndarray, paths: np.ndarray) -> np.ndarray:
    """(p,) how often the posture of the nearest position jumps along each path (p, s, 2)."""
    nearest, counts = KDTree(grid.points), []
    for path in paths:
        place = np.asarray(nearest.query(path)[1])
        place = place[np.concatenate([[True], np.diff(place) != 0])]
        place = place[np.isfinite(q[place, 0])]
        step = np.linalg.norm(np.diff(grid.points[place], axis=0), axis=1)
        counts.append(int((np.abs(np.diff(q[place], axis=0)).max(1) > SPEED * step).sum()))
    return np.array(counts)


def row(name: str, grid: Grid, q: np.ndarray, paths: np.ndarray, seconds: float) -> str:
    """A row of the table, for postures (k, 3) of the positions of a grid, NaN where there is none."""
    jumps = grid.jumps(q, q)
    cut = jumps > grid.threshold
    pieces = cut_pieces(grid.points[grid.pairs[cut]].mean(1), grid.step)
    even = jumps[np.isfinite(jumps) & ~cut] / grid.step
    cells = (
        name,
        len(q),
        f"{np.isfinite(q[:, 0]).mean():.2%}",
        pieces,
        f"{cut.sum() * grid.step:.2f} m",
        f"{changes(grid, q, paths).mean():.3f}",
        f"{np.median(even):.2f}",
        f"{seconds:.0f} s",
    )
    return f"| {' | '.join(map(str, cells))} |"


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=200, help="positions along a side of the grid")
    parser.add_argument("--paths", type=int, default=1000)
    parser.add_argument("--post", type=float, nargs=3, metavar=("X", "Y", "RADIUS"), help="an obstacle [m]")
    parser.add_argument("--quick", action="store_true", help="coarse grids, few paths")
    given = parser.parse_args(arguments)
    cells, count, samples, proposals = (40, 20, 64, 2) if given.quick else (given.cells, given.paths, 1024, 60)
    post = Post(*given.post) if given.post else None
    free, scene = (post.free, post.scene) if post else (None, None)
    paths = random_paths(count, free)
    print(f"{HEAD}\n|---|{'---:|' * (HEAD.count('|') - 2)}")

    # The sheets answer at the positions of the referee's grid.
    began = time.process_time()
    task = hk.position(hk.with_limits(hk.load("planar-3r"), lower=-LIMIT, upper=LIMIT))
    disc = hk.workspace(cylinder=([0, 0, 0], REACH, 0.0))
    sheets = hk.sheets(task, disc, samples=samples, seconds=5 if given.quick else 280, scene=scene)
    seconds = time.process_time() - began
    grid = planar_grid(cells, free=free)
    poses = np.tile(np.eye(4), (len(grid.points), 1, 1))
    poses[:, :2, 3] = grid.points
    print(row(f"`hk.sheets`: {len(sheets)} sheets", grid, sheets.batch(poses).q, paths, seconds), flush=True)

    began = time.process_time()
    grid, q = minimum_cuts(cells, proposals, free)
    print(row("minimum cuts on the grid", grid, q, paths, time.process_time() - began))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
