"""How far apart shapes are over whole cells: planes between them, and how far the cells' postures can push them.

Over a cell the joints are q = q0 + D with D = V y + 1/2 Q y y + d, |d| <= r, y in [-1, 1]^d. Of two shapes A and B,
the hulls of points a and b with radii r_A and r_B, and a unit vector m fixed to A, w_b(q) = m . b(q) in A's frame is

    w_b(q) = w_b(q0) + grad w_b . D + 1/2 D^T H D,   grad w_b = m . (z_i x (b - o_i)) for a hinge, m . z_i for a slider,

and |H_ij| is at most the largest distance of b from the origin of that joint of i and j which is nearer to B, or 0 or 1
where sliders are among them. So everywhere in the cell

    distance >= min_b w_b(q0) - |grad w_b V|_1 - |grad w_b Q|_w - |grad w_b| r - max_a m . a - r_A - r_B - 1/2 R^T K R

with R_i >= |D_i|. The plane m is only a witness: any one gives a bound. Frames at q0 are enclosed by interval
arithmetic, and their half width is taken off; what follows are some thousand roundings of numbers no larger than
`_OnePair.size`, for which `SLACK` is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from ..base.errors import ArgumentError, brief
from ..base.types import Array, Indices, Matrix, Value, Vector, some
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

WIDER = 1 + 1e-9
"""By how much a shape is made larger, for the rounding of its points."""


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
    T, corners = shape.placement, _corners_of(shape.shape)
    points, radius = _holding(shape.shape) if corners is None else _fewer(corners)
    held = np.zeros((0, 3)) if corners is None or len(points) == len(corners) else corners
    placed, holds = (those @ T[:3, :3].T + T[:3, 3] for those in (points, held))
    slack = (WIDER - 1) * (1 + np.abs(placed).max())
    return Convex(shape.link, shape.joint, placed, radius * WIDER + slack, holds)


def _corners_of(shape: Shape) -> Matrix | None:
    """The corners of the hull of a mesh or of points; None of other shapes."""
    if isinstance(shape, Mesh):
        return shape.hull.corners
    return shape.corners if isinstance(shape, Hull) else None


def _holding(shape: Shape) -> tuple[Matrix, float]:
    if isinstance(shape, Capsule):
        ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * shape.length / 2
        return (ends if shape.length else ends[:1]), shape.radius
    if isinstance(shape, Box):
        return _box(shape.sides / 2), 0.0
    if isinstance(shape, Cylinder):
        angles = 2 * np.pi * np.arange(AROUND) / AROUND
        ring = np.column_stack([np.cos(angles), np.sin(angles)]) * shape.radius / np.cos(np.pi / AROUND)
        ends = [np.column_stack([ring, np.full(AROUND, z)]) for z in (shape.length / 2, -shape.length / 2)]
        return np.vstack(ends), 0.0
    if isinstance(shape, Ellipsoid):  # a ball of the least half axis, moved over a box of what the others have more
        least = float(shape.radii.min())
        return _box(shape.radii - least), least
    raise ArgumentError("a shape to prove clear of", type(shape).__name__, "give boxes, capsules, cylinders, or hulls")


def _box(half: Matrix) -> Matrix:
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


SLACK = 1e-10
"""What is taken off a bound, over the size of what it was computed from: 10^5 roundings are less."""

OFF = 50.0
"""By how much a bound is off where numbers of frames are, over that size: 3 for a point, 12 for a slope by a joint."""

HEAVY = 1e3
"""Weight of the condition that shares of points add up to 1, over their size, where the nearest points are sought."""

NEARLY, AT_ONCE = 0.05, 256
"""Pairs that are farther apart than the nearest by this [m] are not looked at closely; cells of a pair done at once."""

UPWARD = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class ShapePair(Value):
    """Two shapes that are to keep `wanted` [m] apart; `other` is no half space."""

    names: tuple[str, str]
    one: Convex
    other: Convex
    wanted: float


def shape_pairs(gaps: Sequence[Gap], wanted: Sequence[float]) -> tuple[ShapePair, ...]:
    """Of every gap all pairs of its shapes. The floor is a half space."""
    found = []
    made: dict[int, Convex] = {}
    grounds: dict[float, Convex] = {}

    def of(shape: LinkShape) -> Convex:
        if id(shape) not in made:
            made[id(shape)] = convex(shape)
        return made[id(shape)]

    for gap, apart in zip(gaps, wanted, strict=True):
        if isinstance(gap, FloorGap):
            at = np.array([[0.0, 0.0, gap.height]])
            ground = grounds.setdefault(gap.height, Convex(gap.names[1], -1, at, 0.0, normal=UPWARD))
            bodies = [of(s) for s in gap.link.shapes]
            found += [ShapePair(gap.names, ground, body, apart) for body in bodies]
        elif isinstance(gap, LinkGap):
            sides = [[of(s) for s in link.shapes] for link in (gap.one, gap.other)]
            found += [ShapePair(gap.names, a, b, apart) for a in sides[0] for b in sides[1]]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Chain(Value):
    """The joints between two shapes, from the one to the other, with how far each is from the other's points, at most.

    up: joints from the one's up to the last before a common one; down: those from there to the other's, in that order.
    """

    up: tuple[int, ...]
    down: tuple[int, ...]

    @staticmethod
    def between(robot: Robot, one: int, other: int) -> Chain:
        """Of two joints (-1: the base)."""
        a, b = joints_above(robot.joints, one), joints_above(robot.joints, other)
        return Chain(tuple(j for j in a if j not in b), tuple(j for j in reversed(b) if j not in a))

    def arms(self, robot: Robot, size: float, travel: Vector) -> list[tuple[int, float]]:
        """(joint, largest distance [m] of its origin from points that are within `size` of the other's frame)."""
        found, arm = [], size
        for index in reversed(self.down):
            found.append((index, arm))
            arm += _step(robot, index, travel)
        for index in reversed(self.up):
            arm += _step(robot, index, travel)
            found.append((index, arm))
        return found[::-1]


def _step(robot: Robot, index: int, travel: Vector) -> float:
    joint = robot.joints[index]
    sliding = float(travel[index]) if joint.kind == "prismatic" else 0.0
    return float(np.linalg.norm(joint.placement[:3, 3])) * (1 + 1e-12) + sliding


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

    def distances(self, Q: Matrix) -> Matrix:
        """Of each pair at postures Q (k, n): a distance (k, P) that is surely there, exact but for rounding if near."""
        return self.over(self.still(Q), np.zeros(len(Q))).least

    @staticmethod
    def still(Q: Matrix) -> Cells:
        """Cells of a single posture each."""
        k, n = Q.shape
        return Cells(Q, np.zeros((k, n, 1)), np.zeros((k, n, 1)), np.zeros((k, 0)), np.zeros(k))

    def words(self, apart: Matrix) -> str:
        """The least distance that is proven over cells, in words."""
        least, names = self.judged(apart), dict.fromkeys(pair.names for pair in self.pairs)
        touch = len({pair.names for pair in self.pairs if pair.wanted < self.looked_at.wanted})
        out = left_out_words([one for one in self.looked_at.left_out if one.pair not in names])
        parts, at = [f"the shapes of {len(names)} pairs keep apart"], f"at each of {POSTURES} random postures"
        if np.isfinite(least).any():
            one, other = self.pairs[int(np.argmin(least))].names
            far = at_least(float(least.min()))
            parts = [f"{parts[0]}, {one} and {other} as the nearest by {far} m or more"]
        parts += [f"{touch} of them, which are near {at}, are only shown not to touch"] if touch else []
        parts += ["; ".join(out)] if out else []
        bare = sorted({one.link for one in self.looked_at.unseen})
        parts += [f"nothing is said of {brief(', '.join(bare))}, without a shape to look at"] if bare else []
        return ", ".join(parts)

    def judged(self, apart: Matrix) -> Vector:
        """(P,) what is proven over cells (k, P) at least [m]; infinite of pairs that need not keep the clearance."""
        return counted(apart.min(axis=0), self.wanted, self.looked_at.wanted)

    def described(self) -> dict[str, Any]:
        """What the checker reads: the joints, the shapes, and the pairs with the distance that is claimed of each."""
        shapes: dict[int, int] = {}
        kinds = [shape for pair in self.pairs for shape in (pair.one, pair.other)]
        for shape in kinds:
            shapes.setdefault(id(shape), len(shapes))
        once = {shapes[id(shape)]: shape for shape in kinds}
        return {
            "joints": joints_of(self.robot),
            "shapes": [shape_of(s) for _, s in sorted(once.items())],
            "pairs": [
                {"names": list(pair.names), "shapes": [shapes[id(pair.one)], shapes[id(pair.other)]],
                 "apart": pair.wanted} for pair in self.pairs
            ],
        }  # fmt: skip

    @cached_property
    def wanted(self) -> Vector:
        """(P,) the distances that are asked for."""
        return np.array([pair.wanted for pair in self.pairs])

    @cached_property
    def _frames(self) -> IntervalFunction:
        q = symbol("q", self.robot.n)
        numbers = vertcat(*(vertcat(p, R.reshape((-1, 1))) for p, R in self.robot._frames(q)))
        return IntervalFunction("the frames of the joints", {"q": q}, numbers)

    def frames(self, q: Matrix) -> tuple[list[tuple[Matrix, Array]], Vector]:
        """(of the base, joint -1, and then of each joint positions (k, 3) and rotations (k, 3, 3); half width (k,))."""
        found = self._frames(q.T, q.T)
        middle, width = found.middle, (found.high - found.low).max(axis=0, initial=0.0) / 2
        k = len(q)
        base = np.zeros((k, 3)), np.tile(np.eye(3), (k, 1, 1))
        each = [middle[12 * i : 12 * i + 12] for i in range(len(self.robot.joints))]
        return [(a[:3].T, np.swapaxes(a[3:].T.reshape(k, 3, 3), 1, 2)) for a in each] + [base], width

    def over(self, cells: Cells, r: Vector, close: Vector | None = None) -> Apart:
        """The bounds over cells whose roots are within r (k,) of their predictors.

        close (P,): pairs are looked at closely where a first plane does not show this distance; by default the wanted.
        """
        close = self.wanted if close is None else close
        k, P, n = len(cells), len(self.pairs), self.robot.n
        frames, width = self.frames(cells.q0[:, :n])
        moved = cells.reach[:, :n] + r[:, None]
        travel = self._travel(np.abs(cells.q0[:, :n]) + moved)
        gear = max(1.0, *(abs(joint.multiplier) for joint in self.robot.joints))
        off = OFF * width * gear * (1 + moved.sum(axis=1))
        least, planes, motion = np.full((k, P), -np.inf), np.zeros((k, P, 3)), np.zeros((k, P))
        middle = np.full((k, P), np.inf)
        steps = cells.V[:, :n], cells.Q[:, :n] * pair_weights(cells.V.shape[2])
        for p, pair in enumerate(self.pairs):
            one = _OnePair(self.robot, pair, frames, steps, moved, r, travel)
            found, planes[:, p], motion[:, p], middle[:, p] = one.bounds(float(close[p]))
            bound = found - off * one.size
            least[:, p] = np.where(np.isnan(bound), -np.inf, bound)
        return Apart(least, planes, motion, middle)

    def sharpened(self, cells: Cells, found: Findings) -> Findings:
        """The findings with bounds as large as they are found to be, of the pairs that come nearest."""
        apart, planes, sharp = found.apart.copy(), found.planes.copy(), np.zeros(found.apart.shape, dtype=bool)
        if not apart.size:
            return found
        while True:
            best = np.where(sharp, apart, np.inf).min(axis=0)
            low = ~sharp & (apart < np.minimum(best, best.min() + NEARLY))
            if not low.any():
                return replace(found, apart=apart, planes=planes)
            ranked = np.argsort(np.where(low, apart, np.inf), axis=0)[:AT_ONCE]
            chosen = np.unique(ranked[np.take_along_axis(low, ranked, axis=0)])
            close = np.where(low[chosen].any(axis=0), np.inf, -np.inf)
            new = self.over(some(cells, chosen), found.r[chosen], close)
            better = new.least > apart[chosen]
            apart[chosen] = np.maximum(apart[chosen], new.least)
            planes[chosen] = np.where(better[:, :, None], new.planes, planes[chosen])
            sharp[np.ix_(chosen, np.isposinf(close))] = True

    def _travel(self, most: Matrix) -> Vector:
        """How far each joint of the tree is from its zero at most, of joints whose absolute values are given (k, n)."""
        top = most.max(axis=0, initial=0.0)
        return np.array([abs(j.multiplier) * top[j.coordinate] + abs(j.offset) for j in self.robot.joints])


def joints_of(robot: Robot) -> list[dict[str, Any]]:
    """The tree of joints, as the checker reads it."""
    return [
        {"parent": j.parent, "kind": j.kind, "coordinate": j.coordinate, "multiplier": j.multiplier,
         "offset": j.offset, "placement": j.placement[:3, :3].tolist(), "origin": j.placement[:3, 3].tolist(),
         "axis": j.axis.tolist()} for j in robot.joints
    ]  # fmt: skip


def shape_of(shape: Convex) -> dict[str, Any]:
    """A shape, as the checker reads it."""
    return {
        "link": shape.link, "joint": shape.joint, "points": shape.points.tolist(), "radius": shape.radius,
        "holds": shape.holds.tolist(), "normal": shape.normal.tolist(),
    }  # fmt: skip


class _OnePair:
    """The bounds of one pair over k cells."""

    def __init__(
        self, robot: Robot, pair: ShapePair, frames: list[tuple[Matrix, Array]], steps: tuple[Array, Array],
        moved: Matrix, r: Vector, travel: Vector,
    ):  # fmt: skip
        self.pair, self.r, self.steps = pair, r, steps
        chain = Chain.between(robot, pair.one.joint, pair.other.joint)
        arms = chain.arms(robot, pair.other.size, travel)
        self.bend = 0.5 * np.einsum("ki,ij,kj->k", moved, _bends(robot, arms), moved)
        self.R = frames[pair.one.joint][1]
        self.a, self.b = (_placed(frames[s.joint], s.points) for s in (pair.one, pair.other))
        self.size = (
            1.0
            + max(np.abs(self.a).max(initial=0.0), np.abs(self.b).max(initial=0.0))
            + max((arm for _, arm in arms), default=0.0)
            + max(pair.one.size, pair.other.size)
        )
        self.columns = self._columns(robot, chain, frames)

    def _columns(self, robot: Robot, chain: Chain, frames: list[tuple[Matrix, Array]]) -> Array:
        """d b / dq (k, points, 3, n), as seen from the one shape."""
        k, count = self.b.shape[:2]
        out = np.zeros((k, count, 3, robot.n))
        for side, sign in ((chain.up, -1.0), (chain.down, 1.0)):
            for index in side:
                joint, (o, R) = robot.joints[index], frames[index]
                axis = R @ joint.axis
                if joint.kind == "prismatic":
                    moved = np.broadcast_to(axis[:, None], (k, count, 3))
                else:
                    moved = np.cross(axis[:, None], self.b - o[:, None])
                out[..., joint.coordinate] += sign * joint.multiplier * moved
        return out

    def bounds(self, close: float) -> tuple[Vector, Matrix, Vector, Vector]:
        """(least (k,), planes (k, 3), motion (k,), distance in the middle (k,)); below `close` by nearest points."""
        if len(self.pair.one.normal):
            least, planes, motion = self._tested(np.einsum("kij,j->ki", self.R, self.pair.one.normal))
            return least, planes, motion, least + motion
        best = self._tested(_unit(self.b.mean(axis=1) - self.a.mean(axis=1)))
        middle = np.full(len(self.r), np.inf)
        near = np.flatnonzero(best[0] < close)
        if len(near):
            steps = _nearest_steps(self.a[near], self.b[near])
            middle[near] = np.linalg.norm(steps, axis=1) - self.pair.one.radius - self.pair.other.radius
            nearer = self._only(near)._tested(_unit(steps))
            better = nearer[0] > best[0][near]
            for kept, new in zip(best, nearer, strict=True):
                kept[near[better]] = new[better]
        return *best, middle

    def _only(self, chosen: Indices) -> _OnePair:
        found = object.__new__(_OnePair)
        found.pair, found.size = self.pair, self.size
        for name in ("r", "bend", "R", "a", "b", "columns"):
            setattr(found, name, getattr(self, name)[chosen])
        found.steps = self.steps[0][chosen], self.steps[1][chosen]
        return found

    def _tested(self, m: Matrix) -> tuple[Vector, Matrix, Vector]:
        """The bound by planes m (k, 3) of length 1, in the base frame."""
        slope = np.einsum("ki,kbin->kbn", m, self.columns)
        spread = np.abs(slope @ self.steps[0]).sum(axis=2) + np.abs(slope @ self.steps[1]).sum(axis=2)
        spread += np.linalg.norm(slope, axis=2) * self.r[:, None]
        here = np.einsum("ki,kbi->kb", m, self.b)
        behind = np.einsum("ki,kai->ka", m, self.a).max(axis=1) + self.pair.one.radius + self.pair.other.radius
        least = (here - spread).min(axis=1) - behind - self.bend - SLACK * self.size
        return least, np.einsum("kji,kj->ki", self.R, m), here.min(axis=1) - behind - least


def _placed(frame: tuple[Matrix, Array], points: Matrix) -> Array:
    """(k, p, 3) points of a frame, in that of the base."""
    p, R = frame
    return p[:, None] + np.einsum("kij,pj->kpi", R, points)


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
        ends = [(x.mean(axis=1), (x[:, -1] - x[:, 0]) / 2) for x in (b, a)]
        return segment_step(*ends[0], *ends[1])
    from scipy.optimize import nnls

    count = a.shape[1]
    out = np.empty((len(a), 3))
    for i in range(len(a)):
        size = HEAVY * max(np.abs(a[i]).max(), np.abs(b[i]).max(), 1e-3)
        A = np.zeros((5, count + b.shape[1]))
        A[:3, :count], A[:3, count:] = -a[i].T, b[i].T
        A[3, :count] = A[4, count:] = size
        shares = nnls(A, np.array([0.0, 0.0, 0.0, size, size]))[0]
        out[i] = A[:3] @ shares
    return out


def _unit(v: Matrix) -> Matrix:
    size = np.linalg.norm(v, axis=1, keepdims=True)
    return np.where(size > 1e-12, v / np.where(size > 1e-12, size, 1.0), UPWARD)
