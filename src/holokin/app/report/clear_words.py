"""What a certificate says of distances, in words: shapes, pairs, the nearest place, and postures that are too near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ...base.types import Matrix, Vector, kept
from ...motion.checks.gaps import FLOOR, FloorGap, LinkGap
from ...path.workspaces import PoseRange
from ...proof import Certificate
from ...proof.clear_cells import ClearCells
from ...proof.convex_shapes import AROUND, MOST_POINTS
from ...proof.proven_region import region_of
from ...proof.too_near import TooNear, gap_distances, too_near_along
from ...robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape


@final
@dataclass(frozen=True, eq=False)
class Nearest:
    """Where the least distance is proven that was asked for: the pair, the bound, the tool pose (4, 4) and posture (n,)
    in the middle of its cell, and the distance at this posture."""

    names: tuple[str, str]
    bound: float
    pose: Matrix
    q: Vector
    distance: float


@kept
def refuted_by(found: Certificate) -> TooNear | None:
    """A posture that is nearer than was asked, where what was asked is not proven; None where none was found."""
    if found.whole or found.demands.clear is None:
        return None
    return region_of(found).parts.worst if isinstance(found.asked, PoseRange) else too_near_along(found)


def shapes_of(clear: ClearCells) -> list[LinkShape]:
    """All shapes that the proof is about, obstacles first."""
    gaps = [gap for gap in clear.looked_at.gaps if isinstance(gap, (LinkGap, FloorGap))]
    links = [link for gap in gaps for link in ((gap.link,) if isinstance(gap, FloorGap) else (gap.one, gap.other))]
    once = {id(shape): shape for link in links for shape in link.shapes}
    return sorted(once.values(), key=lambda shape: (not shape.obstacle, shape.joint))


def obstacles_of(clear: ClearCells) -> list[LinkShape]:
    """Those that stand around the robot."""
    return [shape for shape in shapes_of(clear) if shape.obstacle]


def floor_of(clear: ClearCells) -> float | None:
    """Its height; None where there is none."""
    return next((gap.height for gap in clear.looked_at.gaps if isinstance(gap, FloorGap)), None)


def size_words(shape: Shape) -> str:
    """The kind of a shape, and its sizes."""
    if isinstance(shape, Box):
        return f"box, {_lengths(shape.sides, ' x ')} m"
    if isinstance(shape, Capsule):
        return f"capsule, radius {shape.radius:.4g} m, length {shape.length:.4g} m without its round ends" if (
            shape.length
        ) else f"sphere, radius {shape.radius:.4g} m"  # fmt: skip
    if isinstance(shape, Cylinder):
        return f"cylinder, radius {shape.radius:.4g} m, length {shape.length:.4g} m"
    if isinstance(shape, Ellipsoid):
        return f"ellipsoid, half axes {_lengths(shape.radii, ', ')} m"
    corners = shape.hull.corners if isinstance(shape, Mesh) else shape.corners if isinstance(shape, Hull) else None
    if corners is None:
        return type(shape).__name__.lower()
    kind = f"mesh {shape.file.name}" if isinstance(shape, Mesh) else "convex hull of points"
    return f"{kind}, {_lengths(np.ptp(corners, axis=0), ' x ')} m"


def stand_in_words(shape: Shape) -> str:
    """What stands for a shape in the proof."""
    if isinstance(shape, Cylinder):
        return f"a prism of {AROUND} sides that holds it"
    if isinstance(shape, Ellipsoid):
        return "a box with round edges that holds it"
    corners = shape.hull.corners if isinstance(shape, Mesh) else shape.corners if isinstance(shape, Hull) else ()
    hull = ""
    if isinstance(shape, Mesh):
        hull = (
            "its convex hull" if shape.convex else "its convex hull: the mesh is NOT convex, its hollows count as full"
        )
    grown = f"{MOST_POINTS} of its {len(corners)} corners, with a radius that holds the others"
    return "; ".join([hull] * bool(hull) + [grown] * (len(corners) > MOST_POINTS)) or "as it is"


def _lengths(values: Sequence[float] | Vector, between: str) -> str:
    return between.join(f"{float(x):.4g}" for x in values)


def nearest_of(found: Certificate) -> Nearest | None:
    """Where the least distance is proven; None where nothing is, or no pair is held against the clearance."""
    clear = found.demands.clear
    if clear is None or not len(found):
        return None
    apart, least = found.findings.apart, clear.judged(found.findings.apart)
    p = int(np.argmin(least))
    if not np.isfinite(least[p]):
        return None
    i = int(np.argmin(apart[:, p]))
    task, q = found.equation.strategy.task, found.cells.q0[i, : found.equation.joints]
    names = clear.pairs[p].names
    those = [g for g, gap in enumerate(clear.looked_at.gaps) if gap.names == names]
    return Nearest(names, float(least[p]), task.pose(q), q, float(gap_distances(clear, q[None])[0, those].min()))


def least_of_pairs(found: Certificate) -> list[tuple[tuple[str, str], float, float]]:
    """(names, asked, proven at least) of each pair of things, the nearest first."""
    clear = found.demands.clear
    if clear is None or not len(found):
        return []
    listed: dict[tuple[str, str], tuple[float, float]] = {}
    for pair, least in zip(clear.pairs, found.findings.apart.min(axis=0).tolist(), strict=True):
        listed[pair.names] = pair.wanted, min(least, listed.get(pair.names, (0.0, np.inf))[1])
    return sorted(((names, *of) for names, of in listed.items()), key=lambda row: row[2])


def assumed_words(found: Certificate) -> str:
    """What is said of the links of a robot whose model has no shapes."""
    if found.demands.clear is None or any(not shape.obstacle for shape in found.equation.strategy.task.robot.shapes):
        return ""
    return (
        "The model of the robot has no shapes: capsules about the lines from joint to joint stand for its links. That "
        "they hold the real links is assumed, and not proven: compare their radius with the robot"
    )


def floor_words(clear: ClearCells) -> str:
    """The floor, where there is one."""
    height = floor_of(clear)
    return "" if height is None else f"{FLOOR}: all below z = {height:.6g} m in the frame of the base"
