"""Clearances: which pairs of shapes are looked at, how far they are apart, and how near they come in a motion."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, final

import numpy as np

from ...base.errors import RobotFileError, UnknownNameError
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, frozen
from ...robot import Capsule, LinkShape, Robot, Shape, Unread, joints_above
from ...robot.shapes.link_shapes import coal_package, lowest
from ...robot.tree import Frames, joint_frames, placed
from .check_report import LeftOut, Unseen, cannot_tell
from .scene import DisabledPairs, Scene

FLOOR = "floor"
"""The name of the floor in findings."""

UP = np.array([0.0, 0.0, 1.0])
"""The direction taken for two axes that meet, which have none."""


@final
@dataclass(frozen=True, eq=False)
class Link(Value):
    """The shapes of one link; all are on the moving side of one joint (-1: the base)."""

    name: str
    joint: int
    shapes: tuple[LinkShape, ...]

    @cached_property
    def radius(self) -> float:
        """Of the ball about the origin of its joint's frame that holds it [m]."""
        return max(float(np.linalg.norm(_middle(s))) + s.shape.ball[1] for s in self.shapes)

    @cached_property
    def ball(self) -> tuple[Vector, float]:
        """Centre (3,) in its joint's frame, and radius, of a ball that holds it [m]."""
        middles = np.array([_middle(s) for s in self.shapes])
        center = (middles.min(axis=0) + middles.max(axis=0)) / 2
        radii = [float(np.linalg.norm(m - center)) + s.shape.ball[1] for m, s in zip(middles, self.shapes, strict=True)]
        return frozen(center), max(radii)


def links_of(shapes: Sequence[LinkShape]) -> list[Link]:
    """The links that have shapes. Links of one name on several joints, as a robot of parts may have, stay apart."""
    links: dict[tuple[str, int], list[LinkShape]] = {}
    for shape in shapes:
        links.setdefault((shape.link, shape.joint), []).append(shape)
    return [Link(name, joint, tuple(of)) for (name, joint), of in links.items()]


@dataclass(frozen=True, eq=False)
class Nearest(Value):
    """Where two things are nearest at k postures.

    distance (k,) [m], infinite where it was not looked at; away (k, 3), of length 1, from the other to the one; on_one,
    on_other (k, 3) [m], points of them, or of the axes of capsules, by whose motion along `away` the distance changes.
    """

    distance: Vector
    away: Matrix
    on_one: Matrix
    on_other: Matrix

    @staticmethod
    def of(columns: Matrix, near: float) -> Nearest:
        """Of (k, 10) numbers, those fields side by side; only what is nearer than `near` counts."""
        far = columns[:, 0] >= near
        return Nearest(np.where(far, np.inf, columns[:, 0]), columns[:, 1:4], columns[:, 4:7], columns[:, 7:])


@dataclass(frozen=True, eq=False)
class Gap(Value, ABC):
    """What the distance of two things is at a posture, and how fast it can change. Abstract.

    weights (n,): metres by which any points of the two can come nearer per joint unit that a joint moves.
    """

    names: tuple[str, str]
    weights: Vector

    @abstractmethod
    def distances(self, frames: Frames, rows: Indices, near: float) -> Vector:
        """Distance [m] at some rows of frames, negative for how deep one is in the other; 0 for meshes that meet.

        That of meshes is the distance of their convex hulls, which is no larger; where this is below `near`, their own.
        """

    @abstractmethod
    def nearest(self, frames: Frames, near: float) -> Nearest:
        """Where the two are nearest at all postures of frames, if nearer than `near`; of meshes their convex hulls."""

    @property
    @abstractmethod
    def joints(self) -> tuple[int, int]:
        """On whose moving sides the two are; -1 for the base."""


@final
@dataclass(frozen=True, eq=False)
class FloorGap(Gap):
    """A link above the floor, the plane z = height."""

    link: Link
    height: float

    def distances(self, frames: Frames, rows: Indices, near: float) -> Vector:
        """Height of the lowest point over the floor."""
        heights = [lowest(s.shape, *_pose(frames, s, rows))[:, 2] for s in self.link.shapes]
        return np.min(heights, axis=0) - self.height

    def nearest(self, frames: Frames, near: float) -> Nearest:
        """The lowest point, and that of the floor below it."""
        count = len(frames[0][0])
        low = np.array([lowest(s.shape, *_pose(frames, s, np.arange(count))) for s in self.link.shapes])
        point = low[low[:, :, 2].argmin(axis=0), np.arange(count)]
        below = point * [1.0, 1.0, 0.0] + [0.0, 0.0, self.height]
        columns = point[:, 2] - self.height, np.tile(UP, (count, 1)), point, below
        return Nearest.of(np.column_stack(columns), near)

    @property
    def joints(self) -> tuple[int, int]:
        """That of the link; the floor stands still."""
        return self.link.joint, -1


@final
@dataclass(frozen=True, eq=False)
class LinkGap(Gap):
    """Two links, or a link and an obstacle."""

    one: Link
    other: Link

    def distances(self, frames: Frames, rows: Indices, near: float) -> Vector:
        """The least over pairs of their shapes; those whose balls are farther apart than another pair are left out."""
        least = np.full(len(rows), np.inf)
        for a, b, bound in self._pairs(frames, rows):
            undecided = np.flatnonzero(bound < least)
            if len(undecided):
                least[undecided] = np.minimum(least[undecided], _distance(a, b, undecided, near))
        return least

    def nearest(self, frames: Frames, near: float) -> Nearest:
        """Of the pair of their shapes that is nearest."""
        count = len(frames[0][0])
        best = np.zeros((count, 10))
        best[:, 0] = near
        for a, b, bound in self._pairs(frames, np.arange(count)):
            rows = np.flatnonzero(bound < best[:, 0])
            if len(rows):
                columns = _nearest(a, b, rows)
                nearer = columns[:, 0] < best[rows, 0]
                best[rows[nearer]] = columns[nearer]
        return Nearest.of(best, near)

    def _pairs(self, frames: Frames, rows: Indices) -> list[tuple[Posed, Posed, Vector]]:
        """Each shape of one link with each of the other, and how far apart their balls are; the nearest first."""
        sides = [[(s.shape, *_pose(frames, s, rows)) for s in link.shapes] for link in (self.one, self.other)]
        pairs = [(a, b, _ball_gap(a, b)) for a, b in product(*sides)]
        return sorted(pairs, key=lambda pair: pair[2].min())

    @property
    def joints(self) -> tuple[int, int]:
        """Those of the links."""
        return self.one.joint, self.other.joint


def link_gap(robot: Robot, one: Link, other: Link, travel: Vector) -> LinkGap:
    """The gap of two links; `travel` (joints,): the farthest that sliders are from their zero [m]."""
    ups = [joints_above(robot.joints, link.joint) for link in (one, other)]
    shared = set(ups[0]) & set(ups[1])
    weights = sum(_weights(robot, link, shared, travel) for link in (one, other))
    return LinkGap((one.name, other.name), np.asarray(weights), one, other)


def floor_gap(robot: Robot, link: Link, height: float, travel: Vector) -> FloorGap:
    """The gap of a link and the floor."""
    return FloorGap((link.name, FLOOR), _weights(robot, link, set(), travel), link, height)


def _weights(robot: Robot, link: Link, shared: set[int], travel: Vector) -> Vector:
    """How far a point of the link can move per joint unit: the length of the arm from the joint to it, at most."""
    weights, arm = np.zeros(robot.n), link.radius
    for index in joints_above(robot.joints, link.joint):
        if index in shared:
            break
        joint = robot.joints[index]
        sliding = joint.kind == "prismatic"
        weights[joint.coordinate] += abs(joint.multiplier) * (1.0 if sliding else arm)
        arm += float(np.linalg.norm(joint.placement[:3, 3])) + (float(travel[index]) if sliding else 0.0)
    return weights


Posed = tuple[Shape, Matrix, Array]
"""A shape with the positions (k, 3) and rotations (k, 3, 3) of its frame."""


def _pose(frames: Frames, shape: LinkShape, rows: Indices) -> tuple[Matrix, Array]:
    if shape.joint < 0:
        return placed([], -1, shape.placement, len(rows))
    p, R = frames[shape.joint]
    return placed([(p[rows], R[rows])], 0, shape.placement, len(rows))


def _middle(shape: LinkShape) -> Vector:
    return shape.placement[:3, :3] @ shape.shape.ball[0] + shape.placement[:3, 3]


def _ball_gap(one: Posed, other: Posed) -> Vector:
    """How far apart the balls round two shapes are (k,): no more than the shapes."""
    (a, p, R), (b, x, S) = one, other
    centers = [p + R @ a.ball[0], x + S @ b.ball[0]]
    return np.linalg.norm(centers[0] - centers[1], axis=1) - a.ball[1] - b.ball[1]


def _distance(one: Posed, other: Posed, rows: Indices, near: float) -> Vector:
    (a, p, R), (b, x, S) = one, other
    if isinstance(a, Capsule) and isinstance(b, Capsule):
        steps = [R[rows, :, 2] * a.length / 2, S[rows, :, 2] * b.length / 2]
        return segment_distance(p[rows], steps[0], x[rows], steps[1]) - a.radius - b.radius
    distances = _coal_distance(a.solid, b.solid, one, other, rows)[:, 0]
    if a.surface is not None or b.surface is not None:
        close = np.flatnonzero(distances < near)
        c, d = (shape.solid if shape.surface is None else shape.surface for shape in (a, b))
        distances[close] = np.maximum(_coal_distance(c, d, one, other, rows[close])[:, 0], 0.0)
    return distances


def _coal_distance(a: Any, b: Any, one: Posed, other: Posed, rows: Indices, columns: int = 1) -> Matrix:
    """What coal finds of its shapes a and b, which are where `one` and `other` are: distances (k, 1), or with them
    where the two are nearest (k, 10), the fields of `Nearest`."""
    coal = coal_package()
    (_, p, R), (_, x, S) = one, other
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    values = np.empty((len(rows), columns))
    for k, row in enumerate(rows):
        result.clear()
        ends = coal.Transform3s(R[row], p[row]), coal.Transform3s(S[row], x[row])
        values[k, 0] = coal.distance(a, ends[0], b, ends[1], request, result)
        if columns > 1:
            values[k, 1:] = np.concatenate([-result.normal, result.getNearestPoint1(), result.getNearestPoint2()])
    return values


def _nearest(one: Posed, other: Posed, rows: Indices) -> Matrix:
    """Where two shapes, meshes as their hulls, are nearest at some rows: (k, 10), the fields of `Nearest`."""
    (a, p, R), (b, x, S) = one, other
    if isinstance(a, Capsule) and isinstance(b, Capsule):
        p, R, x, S = p[rows], R[rows], x[rows], S[rows]
        u, v = R[:, :, 2] * a.length / 2, S[:, :, 2] * b.length / 2
        s, t = _segment_places(p, u, x, v)
        ends = p + s[:, None] * u, x + t[:, None] * v
        step = ends[0] - ends[1]
        size = np.linalg.norm(step, axis=1)
        across = np.where(size[:, None] > 0, step / np.where(size > 0, size, 1.0)[:, None], UP)
        return np.column_stack([size - a.radius - b.radius, across, *ends])
    return _coal_distance(a.solid, b.solid, one, other, rows, 10)


def segment_distance(p: Matrix, u: Matrix, x: Matrix, v: Matrix) -> Vector:
    """Distances (k,) of the segments p +- u and x +- v."""
    return frozen(np.linalg.norm(segment_step(p, u, x, v), axis=1))


def segment_step(p: Matrix, u: Matrix, x: Matrix, v: Matrix) -> Matrix:
    """The shortest p + s u - x - t v (k, 3) over s, t in [-1, 1], of the segments p +- u and x +- v."""
    s, t = _segment_places(p, u, x, v)
    return p - x + s[:, None] * u - t[:, None] * v


def _segment_places(p: Matrix, u: Matrix, x: Matrix, v: Matrix) -> tuple[Vector, Vector]:
    """s, t (k,) in [-1, 1] of the shortest p + s u - x - t v, of the segments p +- u and x +- v.

    Its length is convex in (s, t), so it is least at the free optimum, if that is inside, or on one of the four edges.
    """
    w = p - x
    a, b, c = (np.einsum("ki,ki->k", *pair) for pair in ((u, u), (u, v), (v, v)))
    d, e = np.einsum("ki,ki->k", u, w), np.einsum("ki,ki->k", v, w)
    best, least = (np.zeros(len(p)), np.zeros(len(p))), np.full(len(p), np.inf)

    def meet(s: Vector, t: Vector) -> None:
        step = w + s[:, None] * u - t[:, None] * v
        length = np.linalg.norm(step, axis=1)
        shorter = length < least
        best[0][shorter], best[1][shorter], least[shorter] = s[shorter], t[shorter], length[shorter]

    with np.errstate(divide="ignore", invalid="ignore"):
        det = a * c - b * b
        s = np.nan_to_num((b * e - c * d) / det, posinf=0.0, neginf=0.0)
        s = np.clip(s, -1, 1)
        meet(s, np.clip(np.nan_to_num((b * s + e) / c, posinf=0.0, neginf=0.0), -1, 1))
        for end in (-1.0, 1.0):
            ends = np.full(len(p), end)
            meet(ends, np.clip(np.nan_to_num((b * end + e) / c, posinf=0.0, neginf=0.0), -1, 1))
            meet(np.clip(np.nan_to_num((b * end - d) / a, posinf=0.0, neginf=0.0), -1, 1), ends)
    return best


# --- Distances along a whole motion: at few instants, and bounded between them.

ACCURACY = 1e-3
"""How much less [m] than the least distance found it may be anywhere on the motion: a millimetre."""

TOUCH = float(np.nextafter(0.0, 1.0))
"""The least distance [m] of two things that do not touch."""


@dataclass(frozen=True, eq=False)
class Swept(Value):
    """A gap along a motion.

    s (k,): where it was looked at, as numbers of samples from 0, rising; d (k,): the distances there [m];
    bound: what the distance is at least on the whole motion, joints going straight from sample to sample [m].
    """

    gap: Gap
    s: Vector
    d: Vector
    bound: float

    @property
    def least(self) -> float:
        """The least distance [m]."""
        return float(self.d.min())

    @property
    def least_at(self) -> float:
        """Where it is, as a number of a sample."""
        return float(self.s[int(np.argmin(self.d))])


def stretches(wrong: Flags, size: Vector) -> Iterator[tuple[int, int, int]]:
    """(first, last, worst) sample of each stretch that is wrong; the worst has the largest size."""
    edges = np.diff(np.concatenate([[0], wrong, [0]]).astype(int))
    for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        yield int(a), int(b) - 1, int(a) + int(np.argmax(size[a:b]))


def sweep(robot: Robot, gaps: Sequence[Gap], q: Matrix, limits: Sequence[float], wanted: float) -> list[Swept]:
    """Every gap along the joints q (k, n), which go straight from sample to sample.

    Between two postures whose distances are d and e, and over which points of the two things move by S at most towards
    each other, the distance is at least (d + e - S) / 2. An interval is halved until that is no less than its limit
    [m] and than the least distance less `ACCURACY`, that of the pairs of which at least the clearance `wanted` is
    asked: those with a smaller limit are not held against it, and do not tell it.
    """
    if not gaps:
        return []
    near = max(*limits, TOUCH)
    judged = [i for i, limit in enumerate(limits) if limit >= min(wanted, max(limits))]
    # How far points of each pair can have come nearer, up to each sample.
    ways = [np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)) @ gap.weights)]) for gap in gaps]
    samples = np.arange(len(q))
    # The distances at the ends of 16 intervals.
    starts = np.unique(np.linspace(0, len(q) - 1, 17).astype(int)).astype(float)
    known = [dict.fromkeys(starts.tolist(), 0.0) for _ in gaps]
    _look(robot, gaps, q, known, [starts for _ in gaps], near)
    bounds = np.full(len(gaps), np.inf)
    waiting = [(starts[:-1], starts[1:]) for _ in gaps]
    if len(q) == 1:
        bounds = np.array([distances[0.0] for distances in known])
    while any(len(a) for a, _ in waiting):
        best = min(min(known[i].values()) for i in judged)
        middles: list[Vector] = []
        for i, (a, b) in enumerate(waiting):
            # Bounds of the distance over each interval.
            d, e = (np.array([known[i][s] for s in ends.tolist()]) for ends in (a, b))
            step = np.interp(b, samples, ways[i]) - np.interp(a, samples, ways[i])
            bound, limit = (d + e - step) / 2, max(limits[i], TOUCH)
            inside = (d < limit) & (e < limit) & ((d + e + step) / 2 < limit)
            own = min(known[i].values()) - ACCURACY
            least = max(limit, best - ACCURACY) if i in judged else limit
            undecided = np.where(inside, bound < own, bound < least)
            # Halve those that do not tell, between two samples down to a motion of which half is a tenth of `ACCURACY`.
            crosses = (step > ACCURACY / 5) & ((bound < own) | ((d >= limit) & (e >= limit)))
            split = undecided & ((b - a > 1) | crosses)
            bounds[i] = min(bounds[i], float(bound[~split].min(initial=np.inf)))
            middle = (a[split] + b[split]) / 2
            middle = np.where(b[split] - a[split] > 1, np.floor(middle), middle)
            middles.append(middle)
            waiting[i] = (np.concatenate([a[split], middle]), np.concatenate([middle, b[split]]))
        _look(robot, gaps, q, known, middles, near)
    swept = []
    for gap, distances, bound in zip(gaps, known, bounds, strict=True):
        s = np.array(sorted(distances))
        d = np.array([distances[x] for x in s.tolist()])
        swept.append(Swept(gap, s, d, min(float(bound), float(d.min()))))
    return swept


def postures_at(q: Matrix, s: Vector) -> Matrix:
    """The joints at numbers of samples s (k,), which need not be whole."""
    low = np.minimum(np.floor(s).astype(int), max(len(q) - 2, 0))
    high = np.minimum(low + 1, len(q) - 1)
    share = (s - low)[:, None]
    return (1 - share) * q[low] + share * q[high]


def _look(
    robot: Robot, gaps: Sequence[Gap], q: Matrix, known: list[dict[float, float]], places: list[Vector], near: float
) -> None:
    """Find the distances of each gap at its places, and note them."""
    together = np.unique(np.concatenate(places))
    if not len(together):
        return
    frames = joint_frames(robot, postures_at(q, together))
    for gap, distances, s in zip(gaps, known, places, strict=True):
        if len(s):
            rows: Indices = np.searchsorted(together, s)
            distances.update(zip(s.tolist(), gap.distances(frames, rows, near).tolist(), strict=True))


POSTURES = 200
"""Random postures within the limits at which pairs are looked at, to find those that always touch."""

ADJACENT = "parent and child"
ALWAYS = f"they touch at each of {POSTURES} random postures"
ASKED = "allowed to touch"

LEVEL = 1e-9
"""By how much a plane for which a floor stands may be tilted [-], or be above it [m]: round-off."""

ALL = "*"
"""In a pair that may touch: all other things."""


@dataclass(frozen=True, eq=False)
class Pairs(Value):
    """Gaps to look at, the distance asked of each [m], what is not looked at, and the clearance that was wanted [m]."""

    gaps: tuple[Gap, ...]
    limits: tuple[float, ...]
    left_out: tuple[LeftOut, ...]
    unseen: tuple[Unseen, ...]
    wanted: float

    @property
    def unread(self) -> str:
        """That nothing can be told of links whose shapes could not be read, and why; empty where all were read."""
        reason = next((link.reason for link in self.unseen if link.unread), "")
        return f"{cannot_tell(self.unseen)} ({reason})" if reason else ""


class _PairList:
    """The pairs as they are gathered: gaps with the distance asked of each, and what is left out."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.allowed = {frozenset(pair) for pair in scene.allowed}
        self.disabled = {frozenset(pair) for pair in scene.disabled.pairs} if scene.disabled is not None else set()
        self.gaps: list[tuple[Gap, float]] = []
        self.left_out: list[LeftOut] = []

    def may_touch(self, names: tuple[str, str]) -> bool:
        """Whether the scene allows it, by name or for all others."""
        asked = (names, *((name, ALL) for name in names)) if self.allowed else ()
        return any(frozenset(pair) in self.allowed for pair in asked)

    def leaves_out(self, names: tuple[str, str]) -> bool:
        """Whether the scene or its SRDF says that two may touch; then they are told among those left out."""
        if self.may_touch(names):
            self.left_out.append(LeftOut(names, ASKED))
            return True
        if frozenset(names) in self.disabled and self.scene.disabled is not None:
            self.left_out.append(LeftOut(names, f"disabled in {self.scene.disabled.file}"))
            return True
        return False

    def add(self, gap: Gap) -> None:
        """A gap to look at, unless the two may touch."""
        if not self.leaves_out(gap.names):
            self.gaps.append((gap, self.scene.asked(*gap.names)))


def _readable(shapes: Sequence[LinkShape]) -> tuple[list[LinkShape], list[tuple[LinkShape, str]]]:
    """The shapes that can be looked at, and the others with the reason."""
    faults = [(shape, shape.shape.fault) for shape in shapes]
    return [s for s, fault in faults if not fault], [(s, fault) for s, fault in faults if fault]


def pairs_of(robot: Robot, scene: Scene, q: Matrix) -> Pairs:
    """The pairs of a robot in a scene, for a motion q (k, n). Raises: UnknownNameError: an unknown link.

    Links that do not move against each other are no pair, nor are such links and what stands still.
    """
    every, clearance, floor = [*robot.shapes, *scene.obstacles], scene.clearance, scene.floor
    good, faulty = _readable(every)
    links = links_of([shape for shape in good if not shape.obstacle])
    things = links_of([shape for shape in good if shape.obstacle])
    names = [link.name for link in (*links, *things)] + [shape.link for shape, _ in faulty]
    _known([*scene.allowed, *((name, ALL) for name in scene.padding)], names if floor is None else [*names, FLOOR])
    if scene.disabled is not None:
        _check_srdf(robot, scene.disabled, names)
    pairs = _PairList(scene)
    unseen = [Unseen(shape.link, fault, _asked_about(shape, every, pairs, scene)) for shape, fault in faulty]
    if not all(isinstance(shape.shape, Capsule) for shape in robot.shapes):  # a link without length has no capsule
        bare = sorted({*range(len(robot.joints))} - {shape.joint for shape in robot.shapes})
        unseen += [Unseen(robot.joints[j].name, "no shape moves with this joint") for j in bare]
    # How far joints are from their zeros in the motion.
    values = [np.abs(joint.multiplier * q[:, joint.coordinate] + joint.offset).max() for joint in robot.joints]
    travel, parents = np.array(values), [_parent(robot, links, link) for link in links]
    # Links and obstacles, and two links that are not parent and child.
    tested: list[LinkGap] = []
    for i, link in enumerate(links):
        for thing in things if link.joint >= 0 else ():
            pairs.add(link_gap(robot, link, thing, travel))
        for j, other in enumerate(links[:i] if scene.self_collision else ()):
            names = (other.name, link.name)
            if link.joint == other.joint:
                continue  # they never move against each other
            if pairs.leaves_out(names):
                continue
            if other is parents[i] or link is parents[j]:
                pairs.left_out.append(LeftOut(names, ADJACENT))
            else:
                tested.append(link_gap(robot, other, link, travel))
    # Links that touch, or are too near, at every random posture.
    for gap, distances in zip(
        tested,
        _at_random(robot, tested, max((scene.asked(*gap.names) for gap in tested), default=clearance)),
        strict=True,
    ):
        nearest, wanted = distances.max(initial=-np.inf), scene.asked(*gap.names)
        if nearest <= 0:
            pairs.left_out.append(LeftOut(gap.names, ALWAYS))
            continue
        if nearest < wanted:
            reason = f"nearer than the clearance at each of {POSTURES} random postures, so only collisions are told"
            pairs.left_out.append(LeftOut(gap.names, reason))
        pairs.gaps.append((gap, 0.0 if nearest < wanted else wanted))
    # Links and the floor.
    for link in links:
        if floor is not None and link.joint >= 0:
            pairs.add(floor_gap(robot, link, floor, travel))
    gaps, limits = tuple(gap for gap, _ in pairs.gaps), tuple(limit for _, limit in pairs.gaps)
    return Pairs(gaps, limits, tuple(pairs.left_out), tuple(unseen), clearance)


def _asked_about(shape: LinkShape, every: Sequence[LinkShape], pairs: _PairList, scene: Scene) -> bool:
    """Whether a shape may meet a thing that it may not touch."""
    (up, height), floor = shape.placement[2, 2:], scene.floor
    level = isinstance(shape.shape, Unread) and shape.shape.plane and up > 1 - LEVEL
    if level and floor is not None and floor >= height - LEVEL:
        return False  # the floor stands for it
    rivals = [FLOOR] if floor is not None and not shape.obstacle and shape.joint >= 0 else []
    for other in every:
        if shape.obstacle or other.obstacle:
            meet = shape.obstacle != other.obstacle and max(shape.joint, other.joint) >= 0
        else:
            meet = scene.self_collision and shape.joint != other.joint
        rivals += [other.link] if meet else []
    return any(not pairs.may_touch((shape.link, name)) for name in rivals)


def _known(pairs: Sequence[tuple[str, str]], names: Sequence[str]) -> None:
    for name in (name for pair in pairs for name in pair):
        if name != ALL and name not in names:
            raise UnknownNameError("link or obstacle", name, tuple(dict.fromkeys(names)))


def _check_srdf(robot: Robot, disabled: DisabledPairs, names: Sequence[str]) -> None:
    """Raises: RobotFileError: the SRDF is of another robot."""
    known = any(name in names for pair in disabled.pairs for name in pair)
    if disabled.robot == robot.name and (known or not disabled.pairs):
        return
    fact = f"is of the robot {disabled.robot!r}, and this is {robot.name!r}"
    if disabled.robot == robot.name:
        fact = f"names no link with shapes of {robot.name!r}, but {', '.join(disabled.pairs[0])}"
    raise RobotFileError(disabled.file, fact, "give the SRDF of this robot, or the pairs by allowed=")


def _parent(robot: Robot, links: Sequence[Link], link: Link) -> Link | None:
    """The link with shapes on which one hangs, if only links without shapes are between. See `LinkShape.parent`."""
    own, others = link.shapes[0], [other for other in links if not other.shapes[0].carried]
    if own.carried and any(other.joint == link.joint for other in others):
        return None  # it is fixed to that
    for joint in [*joints_above(robot.joints, link.joint)[1:], -1] if link.joint >= 0 else ():
        on_joint = [other for other in others if other.joint == joint]
        named = [other for other in on_joint if other.name == own.parent]
        if named:
            return named[0]
        if on_joint and (own.parent is None or on_joint[0].shapes[0].parent is None):
            return on_joint[0] if len(on_joint) == 1 else None
    return None


def _at_random(robot: Robot, gaps: Sequence[Gap], near: float) -> list[Vector]:
    """Distances of each gap at random postures; a hinge without limits turns once round, a slider stays in 1 m."""
    lower, upper = robot.ranges(np.where(robot.hinges, np.pi, 0.5))
    Q = np.random.default_rng(0).uniform(lower, upper, (POSTURES, robot.n))
    frames = joint_frames(robot, Q)
    return [gap.distances(frames, np.arange(POSTURES), near) for gap in gaps]
