"""The loop that all laws of a session run round: a path, and the [path] table of a job that says it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...base.tolerances import TOLERANCES
from ...base.types import ArrayLike, Matrix, Value, Vector, finite, positive
from ...path import Path, arc, figure_eight, polyline
from ...path.synchronized_paths import AnyPath, synchronized
from ...strategies.tasks.task import Task

SAMPLES = 500
"""Steps a cycle, as of `hk.drift`."""

SPEED = 0.1
"""Of the tool [m/s]."""


@dataclass(frozen=True, eq=False)
class Loop(Value):
    """A path of the tool in the base frame, and how a job says it.

    Make one with `circle_loop`, `polygon_loop`, `eight_loop`; those of jobs come with their session.

    Attributes:
        kind: as of [path] in a job. path: what is run round. samples: steps a cycle.
        keys: the table [path] without samples and cycles. clockwise: whether it runs the other way round than drawn.
    """

    kind: str
    path: AnyPath
    keys: Mapping[str, Any]
    samples: int = SAMPLES
    clockwise: bool = False

    def points(self, count: int = 200) -> Matrix:
        """Points (F, count, 3) of the curves of the F frames, to draw them."""
        at = self.path.at(np.linspace(0.0, self.path.duration, count)).position
        return np.ascontiguousarray(at.reshape(count, -1, 3).swapaxes(0, 1))


def circle_loop(
    center: ArrayLike, radius: float, normal: ArrayLike = (0.0, 0.0, 1.0), *, near: ArrayLike | None = None,
    clockwise: bool = False, speed: float = SPEED, samples: int = SAMPLES,
) -> Loop:  # fmt: skip
    """A circle about a center (3,) [m]; it begins at its point nearest to `near` (3,), such as the tool's place.

    Raises:
        ArgumentError: no radius or no normal.
    """
    c, n, r = finite("center", center, (3,)), _unit(normal), positive("radius", radius)
    towards = np.zeros(3) if near is None else finite("near", near, (3,)) - c
    flat = towards - (towards @ n) * n
    if np.linalg.norm(flat) < 1e-9 * max(1.0, r):
        flat = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0])
    start = c + r * flat / np.linalg.norm(flat)
    path = arc(start, c, -2 * np.pi if clockwise else 2 * np.pi, n, speed=positive("speed", speed))
    keys = {"kind": "circle", "center": c.tolist(), "normal": n.tolist(), "clockwise": clockwise, "speed": float(speed)}
    keys["at"] = start.tolist()
    return Loop("circle", path, keys, samples, clockwise)


def polygon_loop(points: ArrayLike, *, speed: float = SPEED, samples: int = SAMPLES, clockwise: bool = False) -> Loop:
    """A closed polyline through points (k, 3), such as those of clicks; it begins at the first one.

    Raises:
        ArgumentError, ShapeError: fewer than three points, or points that repeat.
    """
    given = finite("the points of a polygon", points, ("k", 3), "give points in space")
    if len(given) < 3:
        raise ArgumentError("the number of points of a polygon", len(given), "give at least three")
    order = np.vstack([given[:1], given[:0:-1]]) if clockwise else given
    path = polyline(order, closed=True, speed=positive("speed", speed))
    keys = {"kind": "polyline", "points": order.tolist(), "closed": True, "speed": float(speed)}
    return Loop("polyline", path, keys, samples, clockwise)


def eight_loop(
    crossing: ArrayLike, width: float, height: float | None = None, normal: ArrayLike = (0.0, 0.0, 1.0), *,
    along: ArrayLike | None = None, speed: float = SPEED, samples: int = SAMPLES, clockwise: bool = False,
) -> Loop:  # fmt: skip
    """A figure eight that begins where it crosses itself, as `hk.figure_eight`."""
    at, n = finite("crossing", crossing, (3,)), _unit(normal)
    flat = np.array([1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0]) if along is None else _unit(along)
    flat = flat - (flat @ n) * n
    wide = (-1.0 if clockwise else 1.0) * flat / np.linalg.norm(flat)
    path = figure_eight(at, width, height, n, along=wide, speed=speed)
    keys: dict[str, Any] = {"kind": "figure-eight", "at": at.tolist(), "width": float(width)}
    keys |= {} if height is None else {"height": float(height)}
    keys |= {"normal": n.tolist(), "along": wide.tolist(), "speed": float(speed)}
    return Loop("figure-eight", path, keys, samples, clockwise)


def reversed_loop(loop: Loop) -> Loop:
    """The same curve the other way round, begun at the same place.

    Raises:
        ArgumentError: a job's path of another kind, which no job file says the other way round.
    """
    found, *others = (_reversed(loop.kind, keys) for keys in (loop.keys, *(loop.keys.get("others") or ())))
    keys = {**found, "others": others} if others else found
    return Loop(loop.kind, loop.path.reversed(), keys, loop.samples, not loop.clockwise)


def _reversed(kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """[path] of one tool the other way round. Raises: ArgumentError: as `reversed_loop`."""
    keys, kind = dict(given), given.get("kind", kind)
    if kind in ("circle", "spiral"):
        keys["clockwise"] = not keys.get("clockwise", False)
    elif kind == "polyline" and keys.get("closed") and not {"turns_deg", "blend"} & keys.keys():
        keys["points"] = [keys["points"][0], *keys["points"][:0:-1]]
    elif kind == "figure-eight" and keys.get("along"):
        keys["along"] = [-v for v in keys["along"]]
    else:
        cure = "it has one direction only: circles, polygons and figure eights have two"
        raise ArgumentError("the way round of the path", kind, cure)
    return keys


def _unit(direction: ArrayLike) -> Vector:
    """A direction (3,) of length 1. Raises: ArgumentError: it is zero."""
    found = finite("direction", direction, (3,))
    size = float(np.linalg.norm(found))
    if not size > 0:
        raise ArgumentError("direction", found.tolist(), "it may not vanish")
    return found / size


def _for_tools(loop: Loop, places: Matrix) -> Loop:
    """The same curve for several tools at once, each from its own place (F, 3) [m], as hands that carry a tray do."""
    first = loop.points(2)[0, 0]
    tables = [_shifted(loop.keys, place - first) for place in places]
    paths = [loop.path.starting_at(place) for place in places]  # type: ignore[union-attr]  of one tool, so a Path
    return replace(loop, path=synchronized(*paths), keys={**tables[0], "others": tables[1:]})


def _shifted(keys: Mapping[str, Any], by: Vector) -> dict[str, Any]:
    """[path] of the curve moved by a vector (3,) [m]."""
    found = dict(keys)
    for key in ("center", "at", "points"):
        if found.get(key) is not None:
            found[key] = (np.asarray(found[key], dtype=float) + by).tolist()
    return found


def entered(loop: Loop, task: Task, home: Vector) -> Loop:
    """The loop as laws begin it at a posture (n,): with the entry of a job where it begins away from the tool.

    A task of several tools has no entry: the curve begins where each of them is.
    """
    if task.frames > 1 and isinstance(loop.path, Path):
        return _for_tools(loop, task.pose(home).reshape(-1, 4, 4)[:, :3, 3])
    if task.frames > 1 or not isinstance(loop.path, Path):
        return loop
    R = task.pose(home)[:3, :3] if loop.path.rotation is None else loop.path.rotation
    away = bool(np.abs(task.error(home, loop.path.start, R)).max() > TOLERANCES.start)
    if away == (loop.keys.get("entry") is not None):
        return loop
    return replace(loop, keys={**loop.keys, "entry": "joints" if away else None})
