"""One map for a whole disc: `hk.sheets` beside the published ways to give each tool position a posture, in one run.

    python -m benchmarks.sheets                                # a planar arm, links of 1 m, +-150 deg
    python -m benchmarks.sheets --limit 114.592                # +-2 rad: the arm of a published example
    python -m benchmarks.sheets --post 1.2 0.9 0.3             # with an obstacle: a round post
    python -m benchmarks.sheets --answer "their code=FILE"     # and an answer that other code has written

Each method gives the positions of a grid a posture. Two positions beside each other are cut where a joint changes by
more than 10 rad for each metre between them. The length of the cuts is the number of cut pairs times the length that
a pair stands for, 2 A / (sum of the lengths of all pairs) with A the area in reach: on a square grid, the step. So
each method is judged by one rule, on the grid that it works on; what it has not joined by its own is said, too.

The paths are straight, 2 m long, and wholly in reach. A grid is asked at the nearest position every 5 mm. The last
lines have the fewest changes of these sheets, and of any postures (IKLink's problem), by dynamic programming at every
2 cm: over the sheets that serve, and over some hundred postures of the self-motion, without holokin.

With a post, the links of the arm are lines that keep out of a disc (x, y, radius): each method has the same rule.

FILE is a JSON object: points [[x, y], ...], q [[...] or null, ...], edges [[i, j], ...], connected [true, ...] and
seconds.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

import holokin as hk
from holokin.path.workspaces import pose_cloud

from .disc_law import disc_law, disc_starts
from .grid_bounds import least_cut, single_jump
from .grid_resolution import Free, cut_pieces, grid_resolution, planar_grid, self_motions
from .grid_roadmap import grid_roadmap
from .reconfigurations import fewest_changes

LINKS = (1.0, 1.0, 1.0)
LIMIT = np.radians(150)
SPEED = 10.0
"""A pair is cut where a joint changes by more for each metre between its poses [rad/m]."""
LENGTH, SPACING, EVERY = 2.0, 0.005, 4
"""Of a path, and between its samples [m]; every which sample is looked at where that takes long."""
HEAD = (
    "method | positions | with a posture | cuts | their length [m] | by its own rule [m] | changes a path "
    "| rad/m, median | rad/m, largest | time [s]"
)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method gives the positions of its grid."""

    name: str
    points: np.ndarray
    """(k, 2) positions in reach [m]"""
    q: np.ndarray
    """(k, 3) [rad], NaN where there is none"""
    pairs: np.ndarray
    """(e, 2) positions beside each other"""
    joined: np.ndarray | None
    """(e,) which pairs the method says it joins; None where it does not say"""
    seconds: float

    def measured(self, area: float) -> tuple[np.ndarray, float]:
        """(jump over length of each pair [rad/m], NaN where a posture lacks; what a cut pair counts [m])."""
        i, j = self.pairs.T
        long = np.linalg.norm(self.points[i] - self.points[j], axis=1)
        return np.abs(self.q[i] - self.q[j]).max(1) / long, 2 * area / float(long.sum())

    def changes(self, paths: np.ndarray) -> np.ndarray:
        """How often the posture of the nearest position jumps along each path (p, s, 2)."""
        near = KDTree(self.points)
        found = []
        for path in paths:
            at = near.query(path)[1]
            at = np.asarray(at)[np.concatenate([[True], np.diff(at) != 0])]
            q, here = self.q[at], self.points[at]
            known = np.isfinite(q[:, 0])
            q, here = q[known], here[known]
            long = np.linalg.norm(np.diff(here, axis=0), axis=1)
            found.append(int((np.abs(np.diff(q, axis=0)).max(1) > SPEED * long).sum()))
        return np.array(found)


def limits_of(limit: float) -> tuple[tuple[float, float], ...]:
    """The same limit for each joint, both ways [rad]."""
    return ((-limit, limit),) * 3


@dataclass(frozen=True)
class Post:
    """A round post (x, y, radius) [m] that the links keep out of."""

    x: float
    y: float
    radius: float

    def free(self, q: np.ndarray) -> np.ndarray:
        """(k,) True where the three links, as lines, keep out of it at postures (k, 3)."""
        turned = np.cumsum(q, -1)
        ends = np.cumsum(np.stack([np.cos(turned), np.sin(turned)], -1), 1)
        begin = np.concatenate([np.zeros_like(ends[:, :1]), ends[:, :-1]], 1)
        along, to = ends - begin, np.array([self.x, self.y]) - begin
        share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
        return np.linalg.norm(to - share[..., None] * along, axis=-1).min(1) >= self.radius

    @property
    def shape(self) -> hk.robot.LinkShape:
        """The same for holokin: in the plane of the arm a ball is a disc."""
        return hk.obstacle("post", hk.robot.Ellipsoid((self.radius,) * 3), (self.x, self.y, 0.0))


def in_reach(points: np.ndarray, limit: float = LIMIT, free: Free | None = None) -> np.ndarray:
    """(k,) True where some posture has its tool at a point (k, 2)."""
    found = []
    for part in np.array_split(points, 1 + len(points) // 4096):
        q = np.moveaxis(self_motions(LINKS, limits_of(limit), part, 60), 0, -1)
        there = np.isfinite(q[..., 0])
        if free is not None:
            there[there] = free(q[there])
        found.append(there.any(1))
    return np.concatenate(found)


def random_paths(count: int, limit: float = LIMIT, seed: int = 0, free: Free | None = None) -> np.ndarray:
    """Straight paths (count, s, 2) of 2 m, each sample in reach."""
    rng, found = np.random.default_rng(seed), []
    share = np.linspace(0, 1, round(LENGTH / SPACING) + 1)[:, None]
    while len(found) < count:
        begin, turn = rng.uniform(-3, 3, 2), rng.uniform(0, 2 * np.pi)
        path = begin + LENGTH * share * [np.cos(turn), np.sin(turn)]
        if in_reach(path[::50], limit, free).all() and in_reach(path, limit, free).all():
            found.append(path)
    return np.array(found)


def planar_task(limit: float = LIMIT) -> hk.Task:
    """The position of the tool of the arm."""
    return hk.position(hk.with_limits(hk.load("planar-3r"), lower=-limit, upper=limit))


def poses_of(points: np.ndarray) -> np.ndarray:
    """Poses (k, 4, 4) at points (k, 2) of the plane."""
    poses = np.tile(np.eye(4), (len(points), 1, 1))
    poses[:, :2, 3] = points
    return poses


def sheets_answer(
    s: hk.analysis.sheets.Sheets,
    cells: int,
    seconds: float,
    limit: float = LIMIT,
    name: str = "hk.sheets",
    free: Free | None = None,
) -> Answer:
    """What the sheets give the positions of the referee's grid."""
    grid = planar_grid(LINKS, limits_of(limit), cells, free=free)
    return Answer(f"{name}: {len(s)}", grid.points, s.batch(poses_of(grid.points)).q, grid.pairs, None, seconds)


def grid_workspace(cells: int) -> hk.Workspace:
    """The disc, by the positions of a grid: a cut then runs between its squares."""
    axis = 6.0 / cells * (np.arange(cells) + 0.5) - 3.0
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    return pose_cloud(poses_of(points[np.hypot(*points.T) <= 3.0]), "grid")


def others(
    limit: float, cells: int, proposals: int, nodes: int, count: int, free: Free | None = None
) -> Iterator[Answer]:
    """The referee's answer, and that of the rerun of the published method."""
    best = grid_resolution(LINKS, limits_of(limit), cells, proposals, free=free)
    cut = best.grid.cut(best.q)
    yield Answer("minimum cuts on a grid", best.grid.points, best.q, best.grid.pairs, ~cut, best.seconds)
    road = grid_roadmap(LINKS, limits_of(limit), nodes, count, free=free)
    kept = in_reach(road.points, limit, free)
    yield _kept("sampled roadmap, our rerun", kept, road.points, road.q, road.pairs, road.joined, road.seconds)


def _kept(
    name: str, kept: np.ndarray, points: np.ndarray, q: np.ndarray, pairs: np.ndarray, joined: np.ndarray,
    seconds: float,
) -> Answer:  # fmt: skip
    """The answer at the positions in reach, those `kept` (k,)."""
    number = np.cumsum(kept) - 1
    both = kept[pairs].all(1)
    return Answer(name, points[kept], q[kept], number[pairs[both]], joined[both], seconds)


def read_answer(name: str, file: str | Path, limit: float = LIMIT) -> Answer:
    """An answer that other code has written; a coordinate that is the same everywhere is left out."""
    found = json.loads(Path(file).read_text("utf-8"))
    points = np.asarray(found["points"], float)
    points = points[:, np.ptp(points, axis=0) > 0][:, :2]
    q = np.array([row[:3] if row else [np.nan] * 3 for row in found["q"]], float)
    pairs = np.asarray(found["edges"], int)
    kept, joined = in_reach(points, limit), np.asarray(found["connected"], bool)
    return _kept(name, kept, points, q, pairs, joined, float(found["seconds"]))


def line(answer: Answer, area: float, paths: np.ndarray) -> str:
    """A row of the table."""
    speed, weight = answer.measured(area)
    known = np.isfinite(speed)
    cut, kept = known & (speed > SPEED), speed[known & (speed <= SPEED)]
    middles = answer.points[answer.pairs[cut]].mean(1)
    step = float(np.median(np.linalg.norm(np.diff(answer.points[answer.pairs], axis=1)[:, 0], axis=1)))
    own = "" if answer.joined is None else f"{(known & ~answer.joined).sum() * weight:.2f}"
    cells = (
        answer.name, len(answer.points), f"{np.isfinite(answer.q[:, 0]).mean():.2%}", cut_pieces(middles, step),
        f"{cut.sum() * weight:.2f}", own, f"{answer.changes(paths).mean():.3f}", f"{np.median(kept):.2f}",
        f"{kept.max():.1f}", f"{answer.seconds:.0f}",
    )  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


def of_these_sheets(s: hk.analysis.sheets.Sheets, paths: np.ndarray) -> np.ndarray:
    """Changes (3, p) along each path that sheets serve wholly: of a loop that stays on its sheet while it serves, of
    `follow`, and the fewest of all choices."""
    found = []
    for path in paths[:, ::EVERY]:
        poses = poses_of(path)
        q = s.postures(poses)
        known = np.isfinite(q[..., 0])
        if not known.any(0).all():
            continue
        fewest = fewest_changes([q[known[:, k], k] for k in range(len(poses))], np.full(3, SPEED * SPACING * EVERY))
        motion = s.follow(hk.polyline(poses[[0, -1], :3, 3]), samples=len(poses) - 1)
        sheet, here = s(poses[0])
        loop = 0
        for pose in poses[1:]:
            before = sheet
            try:
                sheet, here = s.near(pose, here)
                loop += sheet != before
            except hk.base.errors.BranchError:  # it would have to stop, and go to s(pose)
                sheet, here = s(pose)
                loop += 1
        found.append((loop, motion.changes + len(motion.divisions), fewest.changes))
    return np.array(found, int).reshape(-1, 3).T


def any_postures(paths: np.ndarray, limit: float = LIMIT, count: int = 48, free: Free | None = None) -> np.ndarray:
    """The fewest changes along each path of a choice among postures some spacing apart."""
    spacing = 2 * limit / (count - 1)
    found = []
    for path in paths[:, ::EVERY]:
        labels = np.moveaxis(self_motions(LINKS, limits_of(limit), path, count), 0, -1)
        layers = [one[np.isfinite(one[:, 0])].astype(float) for one in labels]
        layers = layers if free is None else [one[free(one)] for one in layers]
        found.append(fewest_changes(layers, np.full(3, SPEED * SPACING * EVERY + spacing)).changes)
    return np.array(found)


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--limit", type=float, default=150.0, help="of each joint, both ways [deg]")
    parser.add_argument("--cells", type=int, default=200, help="positions along a side of the grid")
    parser.add_argument("--paths", type=int, default=1000)
    parser.add_argument("--post", type=float, nargs=3, metavar=("X", "Y", "RADIUS"), help="an obstacle [m]")
    parser.add_argument("--answer", action="append", default=[], metavar="NAME=FILE", help="an answer of other code")
    parser.add_argument("--quick", action="store_true", help="coarse grids, few paths")
    asked = parser.parse_args(arguments)
    cells, samples, proposals, nodes, count = (40, 64, 2, 16, 20) if asked.quick else (asked.cells, 1024, 60, 50, 100)
    limit = np.radians(asked.limit)
    post = None if asked.post is None else Post(*asked.post)
    free = None if post is None else post.free
    if post is not None and asked.answer:
        parser.error("an answer of other code is of the arm without a post")
    paths = random_paths(20 if asked.quick else asked.paths, limit, free=free)
    grid = planar_grid(LINKS, limits_of(limit), cells, 12 if free is None else 40, free=free)
    area = len(grid.points) * grid.step**2
    print(f"| {HEAD} |\n|---|{'---:|' * HEAD.count('|')}")
    disc = hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0))
    scene = None if post is None else hk.Scene([post.shape], clearance=0.0, self_collision=False)
    began = time.process_time()
    s = hk.sheets(planar_task(limit), disc, samples=samples, seconds=5 if asked.quick else 280, scene=scene)
    print(line(sheets_answer(s, cells, time.process_time() - began, limit, free=free), area, paths), flush=True)
    if limit == LIMIT and post is None:
        began = time.process_time()  # the leaf through q0 alone, from both sides
        one = hk.sheets(
            planar_task(), grid_workspace(cells), [disc_law(planar_task())], q0=disc_starts()[[0, 2]], share=0.9975,
            samples=cells**2, search=False,
        )  # fmt: skip
        made = sheets_answer(one, cells, time.process_time() - began, limit, "hk.sheets, a law for this disc")
        print(line(made, area, paths), flush=True)
    for answer in others(limit, cells, proposals, nodes, count, free):
        print(line(answer, area, paths), flush=True)
    for given in asked.answer:
        name, _, file = given.partition("=")
        print(line(read_answer(name, file, limit), area, paths), flush=True)
    some = paths[:: max(1, len(paths) // 100)]
    loop, followed, fewest = of_these_sheets(s, paths)
    if post is None:
        least, jump = least_cut(LINKS, limits_of(limit)), single_jump(LINKS, limits_of(limit), cells)
        print(
            f"\nNo function has less than {least.length:.2f} m of cuts; one with a single jump on each circle about "
            f"the base has {jump.length:.2f} m at least, {jump.pairs:.2f} m in pairs of the {cells} x {cells} grid "
            f"(inf: one jump is not enough)."
        )
    print(
        f"Changes on each of {len(loop)} paths of {len(paths)} wholly served: {loop.mean():.3f} of a loop that stays "
        f"on its sheet, {followed.mean():.3f} with follow, {fewest.mean():.3f} at least over them (follow has more on "
        f"{(followed > fewest).sum()}); {any_postures(some, limit, free=free).mean():.3f} at least over any postures, "
        f"on {len(some)} paths.\n\n{s}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
