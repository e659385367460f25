"""How far apart shapes are over whole cells: planes between them, and how far the cells' postures can push them.

Over a cell the joints are q = q0 + D with D = V y + 1/2 Q y y + d, |d| <= r, y in [-1, 1]^d. Of two shapes A and B,
the hulls of points a and b with radii r_A and r_B, and a unit vector m fixed to A, w_b(q) = m . b(q) in A's frame is

    w_b(q) = w_b(q0) + grad w_b . D + 1/2 D^T H D,   grad w_b = m . (z_i x (b - o_i)) for a hinge, m . z_i for a slider,

and |H_ij| is at most the largest distance of b from the origin of that joint of i and j which is nearer to B, or 0 or 1
where sliders are among them. So everywhere in the cell

    distance >= min_b w_b(q0) - |grad w_b V|_1 - |grad w_b Q|_w - |grad w_b| r - max_a m . a - r_A - r_B - 1/2 R^T K R

with R_i >= |D_i|. The plane m is only a witness: any one gives a bound. Frames at q0 are enclosed by interval
arithmetic, and their half width is taken off; what follows are some thousand roundings of numbers no larger than a
size, for which some of it is taken off, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from ..base.errors import ArgumentError, brief
from ..base.types import Array, Matrix, Value, Vector, some
from ..base.units import at_least
from ..motion.checks.check_report import counted, left_out_words
from ..motion.checks.clearance import POSTURES, FloorGap, Gap, LinkGap, Pairs, segment_step
from ..robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Robot, Shape, joints_above
from ..symbolic import symbol, vertcat
from ..symbolic.interval_function import IntervalFunction
from .tube import Cells, Findings, pair_weights

# --- Convex shapes as points and a radius: all points within the radius of the hull of a few points.
#
# A capsule, a ball, a box and the hull of points are such shapes. Of others one is taken that holds them. So a plane
# that separates two shapes is tested by their points alone, whatever the shapes were.

AROUND = 16
"""Sides of the prism that holds a cylinder: it is 2 % wider at its edges."""

MOST_POINTS = 48
"""Points of a hull or a mesh that are kept; of more, some stand for their neighbours, and the radius grows."""


@dataclass(frozen=True, eq=False)
class Convex(Value):
    """All points within `radius` [m] of the hull of `points` (p, 3) [m], in the frame of joint `joint` (-1: base).

    `holds` (c, 3) are corners of a mesh or hull that it stands for, where it has fewer points than these. `normal` (3,)
    is that of a half space, what is below the plane across it through the point; of all other shapes it is empty.
    """

    link: str
    joint: int
    points: Matrix
    radius: float
    holds: Matrix = field(default_factory=lambda: np.zeros((0, 3)))
    normal: Vector = field(default_factory=lambda: np.zeros(0))

    @property
    def size(self) -> float:
        """How far its farthest point is from the origin of the joint's frame [m]."""
        return float(np.linalg.norm(self.points, axis=1).max()) + self.radius


def convex(shape: LinkShape) -> Convex:
    """A convex shape that holds the shape of a link. Raises: RobotFileError: a mesh that cannot be read."""
    T, solid = shape.placement, shape.shape
    holds = np.zeros((0, 3))
    if isinstance(solid, Mesh | Hull):
        corners = solid.hull.corners if isinstance(solid, Mesh) else solid.corners
        points, radius = _fewer(corners)
        holds = corners if len(points) < len(corners) else holds
    else:
        points, radius = _holding(solid)
    points, holds = (rows @ T[:3, :3].T + T[:3, 3] for rows in (points, holds))
    slack = 1e-9 * (1 + np.abs(points).max() + radius)  # for the rounding of the points
    return Convex(shape.link, shape.joint, points, radius + slack, holds)


def _holding(shape: Shape) -> tuple[Matrix, float]:
    """The points and the radius of a shape that is no mesh."""
    if isinstance(shape, Capsule):
        ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * shape.length / 2
        return (ends if shape.length else ends[:1]), shape.radius
    if isinstance(shape, Box):
        return _corners(shape.sides / 2), 0.0
    if isinstance(shape, Cylinder):
        angles = 2 * np.pi * np.arange(AROUND) / AROUND
        ring = np.column_stack([np.cos(angles), np.sin(angles)]) * shape.radius / np.cos(np.pi / AROUND)
        ends = [np.column_stack([ring, np.full(AROUND, z)]) for z in (shape.length / 2, -shape.length / 2)]
        return np.vstack(ends), 0.0
    if isinstance(shape, Ellipsoid):  # a ball of the least half axis, moved over a box of what the others have more
        least = float(shape.radii.min())
        return _corners(shape.radii - least), least
    raise ArgumentError("a shape to prove clear of", type(shape).__name__, "give boxes, capsules, cylinders, or hulls")


def _corners(half: Vector) -> Matrix:
    """Those of a box, once where it is flat."""
    return np.unique(np.array(list(product(*([-h, h] for h in half)))), axis=0)


def _fewer(corners: Matrix) -> tuple[Matrix, float]:
    """Some of the corners, and the distance from them within which all others are."""
    if len(corners) <= MOST_POINTS:
        return corners, 0.0
    chosen = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[chosen[0]], axis=1)
    while len(chosen) < MOST_POINTS:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(corners - corners[chosen[-1]], axis=1))
    return corners[chosen], float(away.max())


# --- Distances over cells.


@dataclass(frozen=True, eq=False)
class ShapePair(Value):
    """Two shapes that are to keep `wanted` [m] apart; `other` is no half space."""

    names: tuple[str, str]
    one: Convex
    other: Convex
    wanted: float


def shape_pairs(gaps: Sequence[Gap], wanted: Sequence[float]) -> tuple[ShapePair, ...]:
    """Of every gap all pairs of its shapes. The floor is a half space."""
    pairs = []
    made: dict[int, Convex] = {}
    grounds: dict[float, Convex] = {}

    def of(shape: LinkShape) -> Convex:
        if id(shape) not in made:
            made[id(shape)] = convex(shape)
        return made[id(shape)]

    for gap, distance in zip(gaps, wanted, strict=True):
        if isinstance(gap, FloorGap):
            point, up = np.array([[0.0, 0.0, gap.height]]), np.array([0.0, 0.0, 1.0])
            ground = grounds.setdefault(gap.height, Convex(gap.names[1], -1, point, 0.0, normal=up))
            pairs += [ShapePair(gap.names, ground, of(shape), distance) for shape in gap.link.shapes]
        elif isinstance(gap, LinkGap):
            sides = [[of(s) for s in link.shapes] for link in (gap.one, gap.other)]
            pairs += [ShapePair(gap.names, a, b, distance) for a, b in product(*sides)]
    return tuple(pairs)


@dataclass(frozen=True, eq=False)
class Apart(Value):
    """Of k cells and P pairs (k, P): lower bounds of the distances over the cells; the planes (k, P, 3) that show them,
    in the frame of the pair's one shape; what of a bound is the cell's motion [m]; the distances at the postures that
    are predicted for the middles, infinite where a far pair was not looked at closely."""

    least: Matrix
    planes: Array
    motion: Matrix
    middle: Matrix


@dataclass(frozen=True, eq=False)
class ClearCells(Value):
    """What tells how far apart the pairs of shapes of a robot are over cells."""

    robot: Robot
    pairs: tuple[ShapePair, ...]
    looked_at: Pairs
    """With what is left out, and why."""

    def distances(self, Q: Matrix, close: Vector | None = None) -> Matrix:
        """Of each pair at postures Q (k, n): a distance (k, P) that is surely there, exact but for rounding if near.

        close: as of `over`.
        """
        k, n = Q.shape
        cells = Cells(Q, np.zeros((k, n, 1)), np.zeros((k, n, 1)), np.zeros((k, 0)), np.zeros(k))
        return self.over(cells, np.zeros(k), close).least

    def words(self, apart: Matrix) -> str:
        """The least distance that is proven over cells (k, P), in words."""
        # The pairs that keep the clearance, and those that are only shown not to touch.
        names, nearest = dict.fromkeys(pair.names for pair in self.pairs), self.nearest(apart)
        touch = len({pair.names for pair in self.pairs if pair.wanted < self.looked_at.wanted})
        near = f"{touch} of them, which are near at each of {POSTURES} random postures, are only shown not to touch"
        parts = [f"the shapes of {len(names)} pairs keep apart"]
        if nearest is not None:
            (one, other), bound = nearest
            parts = [f"{parts[0]}, {one} and {other} {self.as_nearest} by {at_least(bound)} m or more"]
        parts += [near] if touch else []
        # What is left out.
        left_out = left_out_words([left for left in self.looked_at.left_out if left.pair not in names])
        parts += ["; ".join(left_out)] if left_out else []
        bare = sorted({link.link for link in self.looked_at.unseen})
        parts += [f"nothing is said of {brief(', '.join(bare))}, without a shape to look at"] if bare else []
        return ", ".join(parts)

    def nearest(self, apart: Matrix) -> tuple[tuple[str, str], float] | None:
        """The pair that keeps the least over what is asked of it over cells (k, P), and the distance [m] that is proven
        of it; None where there is none."""
        bounds = self.judged(apart) if len(apart) else np.zeros(0)
        if not np.isfinite(bounds).any():
            return None
        p = int(np.argmin(bounds))
        return self.pairs[p].names, float(apart[:, p].min())

    @property
    def as_nearest(self) -> str:
        """What that pair is called: where links are padded, another one may be nearer."""
        padded = (self.wanted > self.looked_at.wanted).any()
        return "with the least room over what is asked" if padded else "as the nearest"

    def judged(self, apart: Matrix) -> Vector:
        """(P,) what is proven over cells (k, P) at least [m]; infinite of pairs that need not keep the clearance."""
        return counted(apart.min(axis=0), self.wanted, self.looked_at.wanted)

    def described(self) -> dict[str, Any]:
        """What the checker reads: the joints, the shapes, and the pairs with the distance that is claimed of each."""
        shapes = {id(shape): shape for pair in self.pairs for shape in (pair.one, pair.other)}
        rows = {key: row for row, key in enumerate(shapes)}
        pairs = [
            {"names": list(p.names), "shapes": [rows[id(p.one)], rows[id(p.other)]], "apart": p.wanted}
            for p in self.pairs
        ]
        return {"joints": joints_of(self.robot), "shapes": [shape_of(s) for s in shapes.values()], "pairs": pairs}

    @cached_property
    def wanted(self) -> Vector:
        """(P,) the distances that are asked for."""
        return np.array([pair.wanted for pair in self.pairs])

    @cached_property
    def _frame_numbers(self) -> IntervalFunction:
        q = symbol("q", self.robot.n)
        numbers = vertcat(*(vertcat(p, R.reshape((-1, 1))) for p, R in self.robot._frames(q)))
        return IntervalFunction("the frames of the joints", {"q": q}, numbers)

    def _frames(self, q: Matrix) -> tuple[list[tuple[Matrix, Array]], Vector]:
        """(of each joint, and last of the base, positions (k, 3) and rotations (k, 3, 3); half width (k,))."""
        numbers, k = self._frame_numbers(q.T, q.T), len(q)
        width = (numbers.high - numbers.low).max(axis=0, initial=0.0) / 2
        each = numbers.middle.reshape(len(self.robot.joints), 12, k)
        frames = [(rows[:3].T, np.swapaxes(rows[3:].T.reshape(k, 3, 3), 1, 2)) for rows in each]
        return [*frames, (np.zeros((k, 3)), np.tile(np.eye(3), (k, 1, 1)))], width

    def over(self, cells: Cells, r: Vector, close: Vector | None = None) -> Apart:
        """The bounds over cells whose roots are within r (k,) of their predictors.

        close (P,): pairs are looked at closely where a first plane does not show this distance; by default the wanted.
        """
        # How far the joints go from the middle of a cell, and those of the tree from their zero.
        close = self.wanted if close is None else close
        k, P, n, joints = len(cells), len(self.pairs), self.robot.n, self.robot.joints
        frames, width = self._frames(cells.q0[:, :n])
        moved = cells.reach[:, :n] + r[:, None]
        farthest = (np.abs(cells.q0[:, :n]) + moved).max(axis=0, initial=0.0)
        travel = np.array([abs(j.multiplier) * farthest[j.coordinate] + abs(j.offset) for j in joints])
        # What a bound is off where numbers of the frames are, over its size: 3 times for a point, 12 for a slope.
        gear = max(1.0, *(abs(joint.multiplier) for joint in joints))
        off = 50 * width * gear * (1 + moved.sum(axis=1))
        # Pair by pair.
        least, planes = np.full((k, P), -np.inf), np.zeros((k, P, 3))
        motion, middle = np.zeros((k, P)), np.full((k, P), np.inf)
        steps = cells.V[:, :n], cells.Q[:, :n] * pair_weights(cells.V.shape[2])
        for p, pair in enumerate(self.pairs):
            bounds, size = _pair_cells(self.robot, pair, frames, steps, moved, r, travel)
            slack = 1e-10 * size  # 10^5 roundings of numbers of that size are less
            bound, planes[:, p], motion[:, p], middle[:, p] = bounds.least(pair, float(close[p]), slack)
            bound = bound - off * size
            least[:, p] = np.where(np.isnan(bound), -np.inf, bound)
        return Apart(least, planes, motion, middle)

    def sharpened(self, cells: Cells, findings: Findings) -> Findings:
        """The findings with bounds as large as they are found to be, of the pairs that come nearest."""
        apart, planes = findings.apart.copy(), findings.planes.copy()
        sharp = np.zeros(apart.shape, dtype=bool)
        if not apart.size:
            return findings
        while True:
            # Bounds that are lower than the sharp ones of their pair, and within 5 cm of the least of all.
            best = np.where(sharp, apart, np.inf).min(axis=0)
            low = ~sharp & (apart < np.minimum(best, best.min() + 0.05))
            if not low.any():
                return replace(findings, apart=apart, planes=planes)
            # The lowest 256 of each pair are looked at closely.
            ranked = np.argsort(np.where(low, apart, np.inf), axis=0)[:256]
            chosen = np.unique(ranked[np.take_along_axis(low, ranked, axis=0)])
            close = np.where(low[chosen].any(axis=0), np.inf, -np.inf)
            new = self.over(some(cells, chosen), findings.r[chosen], close)
            better = new.least > apart[chosen]
            apart[chosen] = np.maximum(apart[chosen], new.least)
            planes[chosen] = np.where(better[:, :, None], new.planes, planes[chosen])
            sharp[np.ix_(chosen, np.isposinf(close))] = True


def joints_of(robot: Robot) -> list[dict[str, Any]]:
    """The tree of joints, as the checker reads it."""
    return [
        {
            **{name: getattr(joint, name) for name in ("parent", "kind", "coordinate", "multiplier", "offset")},
            "placement": joint.placement[:3, :3].tolist(),
            "origin": joint.placement[:3, 3].tolist(),
            "axis": joint.axis.tolist(),
        }
        for joint in robot.joints
    ]


def shape_of(shape: Convex) -> dict[str, Any]:
    """A shape, as the checker reads it."""
    return {
        "link": shape.link,
        "joint": shape.joint,
        "points": shape.points.tolist(),
        "radius": shape.radius,
        "holds": shape.holds.tolist(),
        "normal": shape.normal.tolist(),
    }


@dataclass(frozen=True, eq=False)
class _PairCells:
    """A pair of shapes over k cells, in the base frame at their middles: r (k,) about the predictor, V and Q of its
    steps, what the bend of the heights takes off (k,), the rotation R of the one shape's frame, the points a (k, p, 3)
    of the one and b (k, s, 3) of the other shape, and the columns d b / dq (k, s, 3, n) as seen from the one."""

    r: Vector
    V: Array
    Q: Array
    bend: Vector
    R: Array
    a: Array
    b: Array
    columns: Array

    def least(self, pair: ShapePair, close: float, slack: float) -> tuple[Vector, Matrix, Vector, Vector]:
        """(bound (k,), planes (k, 3), motion (k,), distance in the middle (k,)); below `close` by nearest points."""
        radius = slack + pair.one.radius + pair.other.radius
        if len(pair.one.normal):
            bound, planes, motion = self._by_planes(np.einsum("kij,j->ki", self.R, pair.one.normal), radius)
            return bound, planes, motion, bound + motion
        # Planes across the way from one middle to the other; where they show too little, between the nearest points.
        best = self._by_planes(_unit(self.b.mean(axis=1) - self.a.mean(axis=1)), radius)
        middle = np.full(len(self.r), np.inf)
        near = np.flatnonzero(best[0] < close)
        if len(near):
            steps = _nearest_steps(self.a[near], self.b[near])
            middle[near] = np.linalg.norm(steps, axis=1) - pair.one.radius - pair.other.radius
            nearer = some(self, near)._by_planes(_unit(steps), radius)
            better = nearer[0] > best[0][near]
            for values, new in zip(best, nearer, strict=True):
                values[near[better]] = new[better]
        return *best, middle

    def _by_planes(self, m: Matrix, radius: float) -> tuple[Vector, Matrix, Vector]:
        """(bound (k,), planes in the one shape's frame (k, 3), motion (k,)) by planes m (k, 3) of length 1.

        radius: that of both shapes, and what is taken off for rounding.
        """
        slope = np.einsum("ki,kbin->kbn", m, self.columns)
        spread = np.abs(slope @ self.V).sum(axis=2) + np.abs(slope @ self.Q).sum(axis=2)
        spread += np.linalg.norm(slope, axis=2) * self.r[:, None]
        heights = np.einsum("ki,kbi->kb", m, self.b)
        behind = np.einsum("ki,kai->ka", m, self.a).max(axis=1) + radius
        bound = (heights - spread).min(axis=1) - behind - self.bend
        return bound, np.einsum("kji,kj->ki", self.R, m), heights.min(axis=1) - behind - bound


def _pair_cells(
    robot: Robot, pair: ShapePair, frames: list[tuple[Matrix, Array]], steps: tuple[Array, Array], moved: Matrix,
    r: Vector, travel: Vector,
) -> tuple[_PairCells, float]:  # fmt: skip
    """(a pair over cells, the size of what the bounds are computed from [m])."""
    # The joints between the shapes: from the one's up to the last before a common one, and down to the other's.
    one_up, other_up = (joints_above(robot.joints, shape.joint) for shape in (pair.one, pair.other))
    between = [(j, -1.0) for j in one_up if j not in other_up] + [(j, 1.0) for j in other_up[::-1] if j not in one_up]
    # How far each is from the other's points at most, and what second derivatives take off.
    arms, arm = [], pair.other.size
    for index, sign in reversed(between):
        joint = robot.joints[index]
        sliding = float(travel[index]) if joint.kind == "prismatic" else 0.0
        step = float(np.linalg.norm(joint.placement[:3, 3])) * (1 + 1e-12) + sliding
        arms.insert(0, (index, arm if sign > 0 else arm + step))
        arm += step
    bend = 0.5 * np.einsum("ki,ij,kj->k", moved, _bends(robot, arms), moved)
    # The points in the base frame, and how the other's move as seen from the one.
    (p, R), (x, S) = (frames[shape.joint] for shape in (pair.one, pair.other))
    a, b = p[:, None] + pair.one.points @ np.swapaxes(R, 1, 2), x[:, None] + pair.other.points @ np.swapaxes(S, 1, 2)
    columns = np.zeros((*b.shape, robot.n))
    for index, sign in between:
        joint, (o, turn) = robot.joints[index], frames[index]
        axis = (turn @ joint.axis)[:, None]
        motion = np.broadcast_to(axis, b.shape) if joint.kind == "prismatic" else np.cross(axis, b - o[:, None])
        columns[..., joint.coordinate] += sign * joint.multiplier * motion
    size = 1.0 + max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    size += max((arm for _, arm in arms), default=0.0) + max(pair.one.size, pair.other.size)
    return _PairCells(r, *steps, bend, R, a, b, columns), size


def _bends(robot: Robot, arms: list[tuple[int, float]]) -> Matrix:
    """K (n, n), |H| at most, of joints in order from the one shape to the other with their arms."""
    K = np.zeros((robot.n, robot.n))
    for a, (i, _) in enumerate(arms):
        first = robot.joints[i]
        if first.kind == "prismatic":
            continue
        for b, (j, arm) in enumerate(arms[a:], a):
            second = robot.joints[j]
            size = abs(first.multiplier * second.multiplier) * (1.0 if second.kind == "prismatic" else arm)
            K[first.coordinate, second.coordinate] += size
            if a != b:
                K[second.coordinate, first.coordinate] += size
    return K


def _nearest_steps(a: Array, b: Array) -> Matrix:
    """From the hull of points a (k, p, 3) to that of b (k, s, 3) the shortest step (k, 3)."""
    if a.shape[1] <= 2 and b.shape[1] <= 2:
        segments = [(x.mean(axis=1), (x[:, -1] - x[:, 0]) / 2) for x in (b, a)]
        return segment_step(*segments[0], *segments[1])
    from scipy.optimize import nnls

    count = a.shape[1]
    steps = np.empty((len(a), 3))
    for i in range(len(a)):
        # The shares of the points add up to 1: a condition of weight 1000, over their size.
        size = 1e3 * max(np.abs(a[i]).max(), np.abs(b[i]).max(), 1e-3)
        A = np.zeros((5, count + b.shape[1]))
        A[:3, :count], A[:3, count:] = -a[i].T, b[i].T
        A[3, :count] = A[4, count:] = size
        shares = nnls(A, np.array([0.0, 0.0, 0.0, size, size]))[0]
        steps[i] = A[:3] @ shares
    return steps


def _unit(v: Matrix) -> Matrix:
    size = np.linalg.norm(v, axis=1, keepdims=True)
    return np.where(size > 1e-12, v / np.where(size > 1e-12, size, 1.0), [0.0, 0.0, 1.0])
