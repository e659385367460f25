"""Where a field of tangent directions on the sphere has its poles, and the index of each, by angles along edges.

The sphere is cut into triangles. Along an edge the direction turns by an angle against one that is carried along
without turning (parallel transport). Round a region of area A these angles add up to 2 pi k - A, and the whole number k
is the index of the region: the sum of the indices of the poles in it, 0 where the field goes on without a jump. Over
the whole sphere the angles cancel and the areas are 4 pi, so the indices add up to 2 (Poincare and Hopf) [Mil65].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import atan2, sqrt
from typing import Any

import numpy as np

from ...base.types import Indices, Matrix, Vector

TURN = np.pi / 2
"""Angle [rad] that a direction may turn between two samples of an edge: half a turn could be either way."""

ASIDE = 1e-4
"""Step [rad] to the side of an edge by which it is seen how near a pole is. A direction that makes one whole turn as it
passes a pole of index 2 looks the same before and after; how fast it turns across the edge tells."""


class TangentField(ABC):
    """Tangent vectors (3,) of the sphere, known by going there from where they are known."""

    @abstractmethod
    def step(self, state: Any, u: Vector) -> tuple[Any, Vector] | None:
        """(state, vector) at u (3,), from the state at a place nearby; None where that is too far or there is none."""


@dataclass(frozen=True)
class Pole:
    """A region of the sphere that has an index: its middle (3,), the angle [rad] from there to its farthest corner.

    triangles: how many it is of; many where the field is not known in a hole.
    """

    direction: tuple[float, float, float]
    radius: float
    index: int
    triangles: int


@dataclass(frozen=True)
class Poles:
    """The regions with an index, how many of the directions looked at were reached, the largest turn [rad] between two
    samples, along an edge or, as it turns there, across, and the least length of a vector at any of them."""

    found: tuple[Pole, ...]
    directions: int
    reached: int
    largest: float
    least: float

    @property
    def total(self) -> int:
        """The sum of the indices."""
        return sum(pole.index for pole in self.found)


def poles(tangent: TangentField, state: Any, u: Vector, fineness: int, accuracy: float) -> Poles:
    """The poles of a field that is known at u (3,), by a state there.

    Args:
        fineness: the sphere is cut into 20 4^fineness triangles at first.
        accuracy: radius [rad] down to which regions with an index are cut finer.
    """
    mesh, triangles, directions = _reached(tangent, state, u, fineness)
    reached = sum(corner in mesh.known for corner in range(directions))
    if not reached:
        return Poles((), directions, 0, 0.0, mesh.least)
    # Regions of up to 24 triangles are cut finer: a pole on an edge joins 2, one on a corner 6. More are a hole
    regions: list[Pole] = []
    waiting = [part for part, index in mesh.regions(triangles) if index]
    while waiting:
        part = waiting.pop()
        pole = mesh.pole(part)
        if pole.radius > accuracy and pole.triangles <= 24:
            finer = mesh.finer(part)
            mesh.reach(finer, [corner for corner in np.unique(part).tolist() if corner in mesh.known])
            parts = mesh.regions(finer)
            if all(index is not None for _, index in parts):
                waiting += [part for part, index in parts if index]
                continue
        regions.append(pole)
    regions.sort(key=lambda pole: pole.direction)
    return Poles(tuple(regions), directions, reached, mesh.largest, mesh.least)


def spread(tangent: TangentField, state: Any, u: Vector, fineness: int) -> tuple[list[Any], int, float]:
    """The states at the corners of triangles that can be reached from one at u, how many corners there are, and the
    least length of a vector."""
    mesh, _, directions = _reached(tangent, state, u, fineness)
    return [mesh.known[corner][0] for corner in range(directions) if corner in mesh.known], directions, mesh.least


def _reached(tangent: TangentField, state: Any, u: Vector, fineness: int) -> tuple[_Mesh, Indices, int]:
    """(the mesh with the state at u (3,) carried to all corners that can be reached, its triangles, its corners)."""
    points, triangles = icosphere(fineness)
    mesh, nearest = _Mesh(tangent, [*points, u]), int(np.argmax(points @ u))
    start = mesh.step(state, u)
    if start is not None:
        mesh.known[len(points)] = start
        first = mesh.walk(len(points), nearest)
        if first is not None:
            mesh.known[nearest] = first[:2]
            mesh.reach(triangles, [nearest])
    return mesh, triangles, len(points)


@dataclass
class _Mesh:
    """Triangles' corners, with states and unit directions e where they are known, and how far e turns along the edges.

    largest: turn between two samples; least: length of the field's vectors.
    """

    tangent: TangentField
    points: list[Vector]
    known: dict[int, tuple[Any, Vector]] = field(default_factory=dict)
    turns: dict[tuple[int, int], float | None] = field(default_factory=dict)
    halves: dict[tuple[int, int], int] = field(default_factory=dict)
    largest: float = 0.0
    least: float = np.inf

    def step(self, state: Any, u: Vector) -> tuple[Any, Vector] | None:
        """(state, e) at u, from a state nearby."""
        result = self.tangent.step(state, u)
        if result is None:
            return None
        state, vector = result
        size = float(np.linalg.norm(vector))
        self.least = min(self.least, size)
        return state, vector / size

    def reach(self, triangles: Indices, first: Iterable[int]) -> None:
        """Carry the states of some corners to all others that can be reached along edges, near ones before far ones."""
        beside: dict[int, set[int]] = defaultdict(set)
        for a, b in _edges(triangles):
            beside[a].add(b)
            beside[b].add(a)
        waiting = deque(first)
        while waiting:
            i = waiting.popleft()
            for j in sorted(beside[i]):
                if j not in self.known and (end := self.walk(i, j)) is not None:
                    self.known[j] = end[:2]
                    self.turns[min(i, j), max(i, j)] = end[2] if i < j else -end[2]
                    waiting.append(j)

    def walk(self, i: int, j: int) -> tuple[Any, Vector, float] | None:
        """(state, e, how far e has turned [rad]) at corner j, carried along the edge from i; None where that fails."""
        (state, e), u, total = self.known[i], self.points[i], 0.0
        share, width, normal = 0.0, 1.0, np.cross(self.points[i], self.points[j])
        length, normal = angle_between(self.points[i], self.points[j]), normal / float(np.linalg.norm(normal))
        slope = self._slope(state, e, u, normal)
        while share < 1.0:
            # A step to a share of the edge: how far e turns along it, or as fast as it turns across the edge
            goal = min(1.0, share + width)
            v = between(self.points[i], self.points[j], goal)
            end, angle, after, size = self.step(state, v), 0.0, np.inf, np.inf
            if end is not None:
                angle, after = turn(u, e, v, end[1]), self._slope(*end, v, normal)
                size = max(abs(angle), (goal - share) * length * max(slope, after))
            # Too far: a shorter step; where the field still turns on a 4096th of an edge there is a pole
            if end is None or not size < TURN:
                width /= 2
                if width < 2.0**-12:
                    return None
                continue
            self.largest = max(self.largest, size)
            total += angle
            (state, e), u, share, slope = end, v, goal, after
            width *= 2
        return state, e, total

    def _slope(self, state: Any, e: Vector, u: Vector, normal: Vector) -> float:
        """How fast e turns across the edge [rad/rad]: as 1 / distance to a pole that lies ahead."""
        v = u + ASIDE * normal
        v /= float(np.linalg.norm(v))
        end = self.step(state, v)
        return np.inf if end is None else abs(turn(u, e, v, end[1])) / ASIDE

    def edge(self, i: int, j: int) -> float | None:
        """How far e turns from i to j [rad]; None where it cannot be followed, or leads to another e than it has."""
        a, b = min(i, j), max(i, j)
        if (a, b) not in self.turns:
            end = self.walk(a, b) if a in self.known and b in self.known else None
            same = end is not None and np.linalg.norm(end[1] - self.known[b][1]) < 1e-5
            self.turns[a, b] = end[2] if end is not None and same else None
        angle = self.turns[a, b]
        return angle if angle is None or i < j else -angle

    def finer(self, triangles: Indices) -> Indices:
        """Each triangle cut into four."""
        out: list[tuple[int, int, int]] = []
        for i, j, k in triangles.tolist():
            a, b, c = self._middle(i, j), self._middle(j, k), self._middle(k, i)
            out += [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]
        return np.array(out)

    def _middle(self, i: int, j: int) -> int:
        key = min(i, j), max(i, j)
        if key not in self.halves:
            self.halves[key] = len(self.points)
            self.points.append(between(self.points[i], self.points[j], 0.5))
        return self.halves[key]

    def regions(self, triangles: Indices) -> list[tuple[Indices, int | None]]:
        """(triangles, index) of the regions: triangles joined across the edges that cannot be followed."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        owner = {edge: t // 3 for t, edge in enumerate(_edges(triangles))}
        pairs = [(t, owner[b, a]) for (a, b), t in owner.items() if (b, a) in owner and self.edge(a, b) is None]
        rows, columns = np.array(pairs, dtype=int).reshape(-1, 2).T
        graph = coo_array((np.ones(len(pairs)), (rows, columns)), shape=(len(triangles),) * 2)
        count, labels = connected_components(graph, directed=False)
        parts = [triangles[labels == label] for label in range(count)]
        return [(part, self._index(part)) for part in parts]

    def _index(self, part: Indices) -> int | None:
        """Of a region, by the edges round it; None where one of these cannot be followed, or where there are none."""
        edges = _edges(part)
        inner, total = set(edges), sum(area(*(self.points[i] for i in corners)) for corners in part.tolist())
        rim = [(a, b) for a, b in edges if (b, a) not in inner]
        for a, b in rim:
            angle = self.edge(a, b)
            if angle is None:
                return None
            total += angle
        return round(total / (2 * np.pi)) if rim else None

    def pole(self, part: Indices) -> Pole:
        """A region without its index."""
        corners = np.array([self.points[i] for i in np.unique(part).tolist()])
        middle = corners.mean(axis=0)
        x, y, z = (middle / max(float(np.linalg.norm(middle)), 1e-300)).tolist()
        radius = float(np.arccos(np.clip(corners @ [x, y, z], -1, 1)).max())
        return Pole((x, y, z), radius, self._index(part) or 0, len(part))


def _edges(triangles: Indices) -> list[tuple[int, int]]:
    return [(a, b) for i, j, k in triangles.tolist() for a, b in ((i, j), (j, k), (k, i))]


def icosphere(fineness: int) -> tuple[Matrix, Indices]:
    """Corners (k, 3) and triangles (20 4^fineness, 3), counter-clockwise from outside, of an icosahedron cut finer."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.transform import Rotation

    golden = (1 + 5**0.5) / 2
    points = np.array([[0.0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    points = np.vstack([np.roll(points, i, axis=1) for i in range(3)]) / np.hypot(1, golden)
    # Out of line with all axes, since poles tend to lie on these
    points = Rotation.from_rotvec([0.234, -0.611, 0.377]).apply(points)
    faces = ConvexHull(points).simplices.astype(int)
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    mesh = _Mesh(_Nothing(), list(points))
    for _ in range(fineness):
        faces = mesh.finer(faces)
    return np.array(mesh.points), faces


class _Nothing(TangentField):
    def step(self, state: Any, u: Vector) -> None:
        """No field: of triangles that are only cut."""


def between(u: Vector, v: Vector, share: float) -> Vector:
    """The direction (3,) at a share of the great circle from u to v."""
    angle = angle_between(u, v)
    w = np.sin((1 - share) * angle) * u + np.sin(share * angle) * v
    return w / float(np.linalg.norm(w))


def angle_between(u: Vector, v: Vector) -> float:
    """The angle [rad] between two directions."""
    apart, together = u - v, u + v
    return 2 * atan2(sqrt(apart @ apart), sqrt(together @ together))


def turn(u: Vector, e: Vector, v: Vector, f: Vector) -> float:
    """How far a tangent direction turns, from e at u to f at v, against one carried along [rad], in (-pi, pi]."""
    carried = e - (v @ e) / (1 + u @ v) * (u + v)
    return atan2(_triple(v, carried, f), carried @ f)


def _triple(a: Vector, b: Vector, c: Vector) -> float:
    """a . (b x c), written out: it is asked for often, and np.cross is slow on single vectors."""
    (x, y, z), (p, q, r), (s, t, u) = a.tolist(), b.tolist(), c.tolist()
    return x * (q * u - r * t) + y * (r * s - p * u) + z * (p * t - q * s)


def area(u: Vector, v: Vector, w: Vector) -> float:
    """The area of a triangle on the unit sphere."""
    return 2 * atan2(_triple(u, v, w), 1 + u @ v + v @ w + w @ u)
