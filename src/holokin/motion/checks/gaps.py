"""`Gap`: the distance of a link from another one, from an obstacle or from the floor, at many postures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from ...base.types import Array, Indices, Matrix, Value, Vector, frozen
from ...robot import Capsule, LinkShape, Robot, Shape, joints_above
from ...robot.numeric import Frames, placed
from ...robot.shapes.link_shapes import coal_package, lowest

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


def links_of(shapes: Sequence[LinkShape]) -> list[Link]:
    """The links that have shapes. Links of one name on several joints, as a robot of parts may have, stay apart."""
    found: dict[tuple[str, int], list[LinkShape]] = {}
    for shape in shapes:
        found.setdefault((shape.link, shape.joint), []).append(shape)
    return [Link(name, joint, tuple(of)) for (name, joint), of in found.items()]


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
        found = [lowest(s.shape, *_pose(frames, s, rows))[:, 2] for s in self.link.shapes]
        return np.min(found, axis=0) - self.height

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
        sides = [[(s.shape, *_pose(frames, s, rows)) for s in link.shapes] for link in (self.one, self.other)]
        pairs = [(a, b) for a in sides[0] for b in sides[1]]
        least = np.full(len(rows), np.inf)
        bounds = [_ball_gap(a, b) for a, b in pairs]
        for i in np.argsort([bound.min() for bound in bounds]):
            open_rows = np.flatnonzero(bounds[i] < least)
            if len(open_rows):
                found = _distance(pairs[i][0], pairs[i][1], open_rows, near)
                least[open_rows] = np.minimum(least[open_rows], found)
        return least

    def nearest(self, frames: Frames, near: float) -> Nearest:
        """Of the pair of their shapes that is nearest."""
        count = len(frames[0][0])
        sides = [
            [(s.shape, *_pose(frames, s, np.arange(count))) for s in link.shapes] for link in (self.one, self.other)
        ]
        pairs = [(a, b) for a in sides[0] for b in sides[1]]
        bounds, best = [_ball_gap(a, b) for a, b in pairs], np.zeros((count, 10))
        best[:, 0] = near
        for i in np.argsort([bound.min() for bound in bounds]):
            rows = np.flatnonzero(bounds[i] < best[:, 0])
            if len(rows):
                found = _nearest(pairs[i][0], pairs[i][1], rows)
                nearer = found[:, 0] < best[rows, 0]
                best[rows[nearer]] = found[nearer]
        return Nearest.of(best, near)

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
    found = _coal_distance(a.solid, b.solid, one, other, rows)
    if a.surface is not None or b.surface is not None:
        close = np.flatnonzero(found < near)
        c, d = (shape.solid if shape.surface is None else shape.surface for shape in (a, b))
        found[close] = np.maximum(_coal_distance(c, d, one, other, rows[close]), 0.0)
    return found


def _coal_distance(a: Any, b: Any, one: Posed, other: Posed, rows: Indices) -> Vector:
    """What coal finds of its shapes a and b, which are where `one` and `other` are."""
    coal = coal_package()
    (_, p, R), (_, x, S) = one, other
    asked, answer = coal.DistanceRequest(), coal.DistanceResult()
    asked.enable_signed_distance = True
    found = np.empty(len(rows))
    for k, row in enumerate(rows):
        answer.clear()
        ends = coal.Transform3s(R[row], p[row]), coal.Transform3s(S[row], x[row])
        found[k] = coal.distance(a, ends[0], b, ends[1], asked, answer)
    return found


def _nearest(one: Posed, other: Posed, rows: Indices) -> Matrix:
    """Where two shapes, meshes as their hulls, are nearest at some rows: (k, 10), the fields of `Nearest`."""
    (a, p, R), (b, x, S) = one, other
    p, R, x, S = p[rows], R[rows], x[rows], S[rows]
    if isinstance(a, Capsule) and isinstance(b, Capsule):
        u, v = R[:, :, 2] * a.length / 2, S[:, :, 2] * b.length / 2
        s, t = _segment_places(p, u, x, v)
        ends = p + s[:, None] * u, x + t[:, None] * v
        step = ends[0] - ends[1]
        size = np.linalg.norm(step, axis=1)
        across = np.where(size[:, None] > 0, step / np.where(size > 0, size, 1.0)[:, None], UP)
        return np.column_stack([size - a.radius - b.radius, across, *ends])
    coal = coal_package()
    asked, answer = coal.DistanceRequest(), coal.DistanceResult()
    asked.enable_signed_distance = True
    found = np.empty((len(rows), 10))
    for k in range(len(rows)):
        answer.clear()
        places = coal.Transform3s(R[k], p[k]), coal.Transform3s(S[k], x[k])
        found[k, 0] = coal.distance(a.solid, places[0], b.solid, places[1], asked, answer)
        found[k, 1:] = np.concatenate([-answer.normal, answer.getNearestPoint1(), answer.getNearestPoint2()])
    return found


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
