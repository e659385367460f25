"""Random arms with shapes on their links among random obstacles, each written down twice: for holokin, and for Coal.

The referee is `random_arms`' (products of matrices, Newton's method with complex steps) and Coal, whose shapes are made
here from the same numbers. Besides its arms of Denavit and Hartenberg there are chains as a URDF has them: any origins,
any axes, some with a joint that follows another one; and tasks of five rows, the tool's point and axis.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import holokin as hk
from benchmarks.random_arms import Arm, Array, Problem, random_arm, random_law
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape
from holokin.robot.tree import joint_frames

coal: Any = import_module("coal")

KINDS = ("capsule", "ball", "box", "cylinder", "ellipsoid", "hull", "mesh")
CHAINS, AXES, FOLLOWING = 0.5, 0.3, 0.3
"""Shares of chains, of tasks of five rows where six could be held, and of chains with a joint that follows."""


@dataclass(frozen=True, eq=False)
class Chain(Arm):
    """Joints at `origins` (m, 4, 4) that turn about or slide along `axes` (m, 3) by gears q[drivers] + offsets (m,).

    Its `rows` are zero; `slides` and limits are of the n coordinates.
    """

    origins: Array
    axes: Array
    drivers: Array
    gears: Array
    offsets: Array

    @cached_property
    def robot(self) -> hk.Robot:
        """For holokin, by a URDF."""
        text = '<robot name="chain"><link name="world"/>'
        for i, (T, axis, k) in enumerate(zip(self.origins, self.axes, self.drivers.tolist(), strict=True)):
            own = k not in self.drivers[:i].tolist()
            kind = "prismatic" if self.slides[k] else "revolute"
            low, high = np.clip([self.lower[k], self.upper[k]], -100.0, 100.0).tolist()
            if kind == "revolute" and (not own or np.isinf(self.lower[k])):
                kind = "continuous"
            limit = f'<limit lower="{low!r}" upper="{high!r}" velocity="1" effort="1"/>' if kind != "continuous" else ""
            mimic = f'<mimic joint="j{k}" multiplier="{float(self.gears[i])!r}" offset="{float(self.offsets[i])!r}"/>'
            xyz = " ".join(map(repr, T[:3, 3].tolist()))
            rpy = " ".join(map(repr, Rotation.from_matrix(T[:3, :3]).as_euler("xyz").tolist()))
            name = f"j{k}" if own else f"follower{i}"
            text += (
                f'<link name="link{i + 1}"/><joint name="{name}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
                f'<parent link="{f"link{i}" if i else "world"}"/><child link="link{i + 1}"/>'
                f'<axis xyz="{" ".join(map(repr, axis.tolist()))}"/>{limit}{"" if own else mimic}</joint>'
            )
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "chain.urdf"
            file.write_text(text + "</robot>", "utf-8")
            return hk.load(file)

    def frames(self, q: Array) -> Array:
        """The base and the links (k, m + 1, 4, 4) at q (k, n), which may be complex."""
        found = [np.broadcast_to(np.eye(4, dtype=q.dtype), (len(q), 4, 4))]
        joints = zip(self.origins, self.axes, self.drivers, self.gears, self.offsets, strict=True)
        for T, axis, k, gear, offset in joints:
            value, step = gear * q[:, k] + offset, np.tile(np.eye(4, dtype=q.dtype), (len(q), 1, 1))
            if self.slides[k]:
                step[:, :3, 3] = value[:, None] * axis
            else:
                K = np.cross(np.eye(3), axis)
                step[:, :3, :3] += np.sin(value)[:, None, None] * K + (1 - np.cos(value))[:, None, None] * (K @ K)
            found.append(found[-1] @ T @ step)
        return np.stack(found, axis=1)


@dataclass(frozen=True, eq=False)
class Pointing(Problem):
    """The tool's point and the direction of its z axis are held: five rows."""

    @cached_property
    def strategy(self) -> hk.strategies.HolonomicStrategy:
        """For holokin."""
        return hk.holonomic(hk.pose(self.arm.robot, "axis"), self.law[1])

    def residual(self, q: Array, p: Array, R: Array, c: Array) -> Array:
        """The tool's position less p, its axis across that of R, the constraint."""
        T = self.arm.frames(q)
        across = np.einsum("kji,kj->ki", R[:, :, :2], T[:, -1, :3, 2])
        return np.hstack([T[:, -1, :3, 3] - p, across, super().residual(q, p, R, c)[:, 5:]])


def random_chain(rng: np.random.Generator) -> Chain:
    """4 to 8 coordinates."""
    n = int(rng.integers(4, 9))
    drivers = np.arange(n)
    if rng.random() < FOLLOWING:
        k = int(rng.integers(1, n - 1))
        drivers = np.insert(drivers, k + 1, k)
    m = len(drivers)
    followers = np.r_[False, drivers[1:] == drivers[:-1]]
    slides = rng.random(n) < (0.2 if rng.random() < 0.4 else 0.0)
    unit = np.eye(3)[rng.integers(0, 3, m)] * rng.choice([-1, 1], (m, 1))
    axes = unit if rng.random() < 0.6 else rng.normal(size=(m, 3))
    origins = np.tile(np.eye(4), (m, 1, 1))
    origins[:, :3, 3] = rng.uniform(-0.1, 0.4, (m, 3))
    square = np.pi / 2 * rng.integers(-1, 3, (m, 3))
    turns = square if rng.random() < 0.6 else rng.uniform(-np.pi, np.pi, (m, 3)) * [1, 0.45, 1]
    turns[:, 1] = np.where(np.abs(turns[:, 1]) > 1.5, 0.0, turns[:, 1])  # where roll and yaw are one
    origins[:, :3, :3] = Rotation.from_euler("xyz", turns).as_matrix()
    limited = rng.random() < 0.5
    far = np.where(slides, 1.0, np.inf)
    low = np.where(slides, -rng.uniform(0.2, 1, n), -rng.uniform(1, 3, n)) if limited else -far
    high = np.where(slides, rng.uniform(0.2, 1, n), rng.uniform(1, 3, n)) if limited else far
    gears = np.where(followers, rng.uniform(-1.5, 1.5, m), 1.0)
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    held = tuple(range(6 if n > 5 and rng.random() < 0.5 else 3))
    offsets = np.where(followers, rng.uniform(-0.3, 0.3, m), 0.0)
    return Chain(np.zeros((n, 4)), slides, low, high, held, origins, axes, drivers, gears, offsets)


def random_case(rng: np.random.Generator) -> Problem:
    """An arm of either kind with a task and a constraint."""
    while True:
        arm = random_chain(rng) if rng.random() < CHAINS else random_arm(rng)
        pointing = arm.n > 5 and not arm.planar and rng.random() < AXES
        if pointing:
            arm = replace(arm, held=tuple(range(5)))
        law = random_law(arm, rng)
        if law is None or arm.robot.planar != arm.planar or (law[0] == "height" and isinstance(arm, Chain)):
            continue
        return (Pointing if pointing else Problem)(arm, law)


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape of holokin's, Coal's of the same numbers, and a ball about `middle` (3,) that holds it."""

    kind: str
    shape: Shape
    coal: Any
    middle: Array
    radius: float


def _convex(points: Array) -> Any:
    hull = ConvexHull(points)
    place = np.full(len(points), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    corners, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in points[hull.vertices]:
        corners.append(corner)
    for face in place[hull.simplices].tolist():
        faces.append(coal.Triangle(*face))
    return coal.Convex(corners, faces)


def random_solid(rng: np.random.Generator, size: float, folder: Path, kind: str = "") -> Solid:
    """Of some `size` [m], half of its length or less. folder: where files of meshes go."""
    kind = kind or str(rng.choice(KINDS))
    a, b, c = size * rng.uniform(0.15, 1.0, 3)
    zero = np.zeros(3)
    if kind == "capsule":
        return Solid(kind, Capsule(a / 2, 2 * b), coal.Capsule(a / 2, 2 * b), zero, a / 2 + b)
    if kind == "ball":
        return Solid(kind, Capsule(a), coal.Sphere(a), zero, a)
    if kind == "box":
        return Solid(kind, Box(np.array([a, b, c])), coal.Box(a, b, c), zero, float(np.linalg.norm([a, b, c])) / 2)
    if kind == "cylinder":
        return Solid(kind, Cylinder(a / 2, b), coal.Cylinder(a / 2, b), zero, float(np.hypot(a / 2, b / 2)))
    if kind == "ellipsoid":
        return Solid(kind, Ellipsoid(np.array([a, b, c]) / 2), coal.Ellipsoid(a / 2, b / 2, c / 2), zero, size / 2)
    points = rng.normal(size=(int(rng.choice([5, 12, 40, 120])), 3)) * [a, b, c] / 3
    middle = points.mean(axis=0)
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    if kind == "hull":
        return Solid(kind, Hull(points), _convex(points), middle, radius)
    file, hull = folder / f"{rng.integers(2**60)}.obj", ConvexHull(points)  # obstacles that are not convex are refused
    place = np.full(len(points), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points[hull.vertices].tolist()]
    lines += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in place[hull.simplices].tolist()]
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return Solid(kind, Mesh(file), _convex(points), middle, radius)


def random_place(rng: np.random.Generator, middle: Array) -> Array:
    """A pose (4, 4) at a point, turned at random."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=rng).as_matrix(), middle
    return T


@dataclass(frozen=True, eq=False)
class Part:
    """A solid on a frame of the arm, 0 for the base, or of an obstacle; the link's or the obstacle's name."""

    name: str
    frame: int
    place: Array
    solid: Solid


def placed(parts: list[Part], frames: Array) -> list[Array]:
    """Their poses (k, 4, 4)."""
    return [frames[:, part.frame] @ part.place for part in parts]


def distance(one: Solid, T: Array, other: Solid, S: Array) -> tuple[float, Array]:
    """Coal's distance, below 0 how deep they are in each other, and the direction from the one to the other."""
    asked, answer = coal.DistanceRequest(), coal.DistanceResult()
    asked.enable_signed_distance = True
    ends = coal.Transform3s(T[:3, :3], T[:3, 3]), coal.Transform3s(S[:3, :3], S[:3, 3])
    found = float(coal.distance(one.coal, ends[0], other.coal, ends[1], asked, answer))
    return found, np.asarray(answer.normal)


def least_distances(one: Solid, T: Array, other: Solid, S: Array, near: Array) -> Array:
    """Of poses (k, 4, 4) each; where their balls are `near` (k,) apart or more, only that of the balls."""
    a = T[:, :3, :3] @ one.middle + T[:, :3, 3]
    b = S[:, :3, :3] @ other.middle + S[:, :3, 3]
    found = np.linalg.norm(a - b, axis=1) - one.radius - other.radius
    for i in np.flatnonzero(found < near):
        found[i] = distance(one, T[i], other, S[i])[0]
    return found


def lowest(part: Part, T: Array) -> Array:
    """Heights (k,) of the lowest points of a solid at poses (k, 4, 4), by Coal's distance from a deep box."""
    ground = Solid("box", Box(np.ones(3)), coal.Box(200.0, 200.0, 200.0), np.zeros(3), 200.0)
    far, below = T.copy(), np.eye(4)
    below[2, 3] = -200.0  # its top is at -100
    far[:, :2, 3] = 0.0  # how high it is does not depend on where
    return np.array([distance(part.solid, M, ground, below)[0] for M in far]) - 100.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A problem with shapes on its links, obstacles around it, perhaps a floor; pairs that touch at the start."""

    problem: Problem
    robot: hk.Robot
    links: list[Part]
    things: list[Part]
    floor: float | None
    ignored: list[tuple[str, str]]

    @property
    def obstacles(self) -> list[LinkShape]:
        """For holokin."""
        return [LinkShape(p.name, -1, p.place, p.solid.shape, obstacle=True) for p in self.things]

    @cached_property
    def strategy(self) -> hk.strategies.HolonomicStrategy:
        """That of the problem, of the robot with its shapes."""
        arm = replace(self.problem.arm)
        vars(arm)["robot"] = self.robot
        return replace(self.problem, arm=arm).strategy

    def at(self, clearance: float) -> hk.Scene:
        """For holokin, with a clearance [m]."""
        return hk.Scene(self.obstacles, self.floor, clearance, allowed=self.ignored)

    def parts(self, name: str) -> list[Part]:
        """Those of a link or an obstacle."""
        return [part for part in (*self.links, *self.things) if part.name == name]


def corrections(arm: Arm, rng: np.random.Generator) -> list[Array]:
    """Of each frame of the referee its pose (4, 4) in holokin's of the same joint, the same at two postures."""
    if isinstance(arm, Chain):
        return [np.eye(4)] * (len(arm.origins) + 1)
    q = rng.uniform(-1, 1, (2, arm.n))
    own = joint_frames(arm.robot, q)
    found = [np.eye(4)]
    for (p, R), T in zip(own, np.moveaxis(arm.frames(q)[:, 1:], 1, 0), strict=True):
        S = np.tile(np.eye(4), (2, 1, 1))
        S[:, :3, :3], S[:, :3, 3] = R, p
        both = np.linalg.solve(S, T)
        if not np.abs(both[0] - both[1]).max() < 1e-12:
            raise ArithmeticError("frames of one joint move against each other")
        found.append(both[0])
    return found


def random_scene(problem: Problem, q: Array, rng: np.random.Generator, folder: Path, clearance: float) -> Scene:
    """Shapes on most links and one to four obstacles, which at q are farther away than the clearance."""
    frames = problem.arm.frames(q[None])
    count, links = frames.shape[1], []
    for i in range(count):
        if rng.random() < 0.8 or i == count - 1:
            ahead = problem.arm.frames(q[None])[0, min(i + 1, count - 1), :3, 3]
            middle = np.linalg.solve(frames[0, i], [*ahead, 1.0])[:3] * rng.uniform(0, 1)
            for _ in range(1 if rng.random() < 0.8 else 2):
                solid = random_solid(rng, float(rng.uniform(0.02, 0.2)), folder)
                links.append(Part(f"link{i}", i, random_place(rng, middle), solid))
    at, here = corrections(problem.arm, rng), placed(links, frames)
    shapes = [LinkShape(p.name, p.frame - 1, at[p.frame] @ p.place, p.solid.shape) for p in links]
    ignored = set()
    for (one, T), (other, S) in combinations(zip(links, here, strict=True), 2):
        if one.name != other.name and distance(one.solid, T[0], other.solid, S[0])[0] < clearance + 1e-3:
            ignored.add((one.name, other.name))
    things: list[Part] = []
    for k in range(int(rng.integers(1, 5))):
        solid = random_solid(rng, float(rng.uniform(0.05, 0.6)), folder)
        for _ in range(20):
            by = here[int(rng.integers(len(here)))][0, :3, 3]
            one = Part(f"thing{k}", 0, random_place(rng, by + rng.normal(size=3) * 0.3), solid)
            gaps = [
                distance(p.solid, T[0], solid, one.place)[0] for p, T in zip(links, here, strict=True) if p.frame > 0
            ]
            if min(gaps, default=1.0) > clearance + rng.uniform(0.002, 0.05):
                things.append(one)
                break
    floor = None
    if rng.random() < 0.5:
        low = [lowest(p, T)[0] for p, T in zip(links, here, strict=True) if p.frame > 0]
        floor = float(min(low)) - clearance - float(rng.uniform(0.002, 0.1))
    return Scene(problem, replace(problem.arm.robot, shapes=tuple(shapes)), links, things, floor, sorted(ignored))
