"""From [path] of a job to the path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from ...base.errors import ArgumentError, JobError
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Vector
from ...path import (
    Path,
    Waypoints,
    arc,
    as_point,
    blended,
    figure_eight,
    passes,
    polyline,
    raster,
    read_svg,
    read_waypoints,
    spiral,
    spline,
    with_leads,
)
from ...path.straight_path import rotation_vector
from ...strategies.tasks.task import Task
from ...symbolic import Function, parse, symbol
from .path_tables import PathTable


def build_path(table: PathTable, task: Task, q0: Vector, file: FilePath) -> Path:
    """The path of a table. It begins at the tool's start point unless an entry leads to it.

    Raises:
        JobError, RecordingError, and what the shapes raise.
    """
    tool, F = task.pose(q0), table.frame_pose
    local = np.linalg.inv(F) @ tool if table.frame is not None else tool
    path = _curve(table, local[:3, 3], file)
    if table.file:
        path = replace(path, notes=tuple(f"{table.file}: {note}" for note in path.notes))
    if table.blend is not None:
        path = blended(path, table.blend, keep_start=table.entry is None)
    if table.passes > 1:
        turns = None if not table.same_way else False
        path = passes(path, table.passes, offset=table.offset, lift=table.lift, back_and_forth=turns)
    if table.lead_in or table.lead_out or table.retract:
        path = with_leads(path, table.lead_in, table.lead_out, retract=table.retract, retract_speed=table.retract_speed)
    if table.frame is not None:
        path = path.in_frame(F)
    if table.cycles > 1 and not path.closed:
        fact = f"asks for {table.cycles} cycles of a path that ends {path.gap:.3g} (m or rad) from its start"
        raise JobError(file, "path.cycles", fact, "close the path, or leave out cycles")
    if table.entry is None:
        _check_begin(path, table, tool, task, q0, file)
    return path


def _curve(table: PathTable, tool: Vector, file: FilePath) -> Path:
    """The bare curve, in its frame, in which the tool's start point is `tool`."""
    origin = tool if table.relative else np.zeros(3)

    def placed(point: list[float]) -> Vector:
        return origin + as_point(point)

    kind, speed = table.kind, table.speed
    if kind in ("polyline", "spline"):
        points = np.array([placed(p) for p in table.points or []])
        if kind == "spline":
            return spline(points, times=table.times, closed=table.closed, speed=speed)
        turns = None if table.turns_deg is None else np.deg2rad(table.turns_deg)
        return polyline(points, turns=turns, closed=table.closed, speed=speed)
    if kind in ("circle", "arc"):
        return _arc(table, placed(table.center or []), tool if table.at is None else placed(table.at), file)
    if kind in ("poses", "waypoints"):
        return _through(table, origin, file)
    at = tool if table.at is None and table.frame is None else placed(table.at or [0.0, 0.0, 0.0])
    if kind == "svg":
        return _outline(table, at, file)
    if kind == "figure-eight":
        return figure_eight(at, table.width or 0.0, table.height, table.normal, along=table.along, speed=speed)
    surface = None if table.surface is None else _surface(table.surface)
    if kind == "raster":
        sides = table.along or [], table.across or []
        return raster(at, *sides, table.spacing or 0.0, surface=surface, tool=table.tool, speed=speed)
    return spiral(
        at, table.radius or 0.0, table.spacing or 0.0, table.normal, inward=table.inward, clockwise=table.clockwise,
        along=table.along, surface=surface, tool=table.tool, speed=speed,
    )  # fmt: skip


def _arc(table: PathTable, center: Vector, q0: Vector, file: FilePath) -> Path:
    """The arc that begins at a point (3,): where the tool is, or `at`."""
    angle = 360.0 if table.angle_deg is None else table.angle_deg
    try:
        return arc(q0, center, np.deg2rad(-angle if table.clockwise else angle), table.normal, speed=table.speed)
    except ArgumentError as problem:
        if problem.what != "normal" or table.relative:
            raise
        fact = f"is {problem.value}, {'the tool' if table.at is None else 'it'} starts at {_typed(q0)}"
        cure = f"{problem.cure}; set relative = true, then the center counts from the tool"
        raise JobError(file, "path.normal", fact, cure) from None


def _through(table: PathTable, origin: Vector, file: FilePath) -> Path:
    """Through poses or a file's waypoints: a spline, or lines."""
    if table.kind == "poses":
        matrices = np.array([pose.matrix for pose in table.poses or []]).reshape(-1, 4, 4)
        read = Waypoints(matrices[:, :3, 3], matrices[:, :3, :3])
    else:
        read = read_waypoints(
            file.parent / (table.file or ""),
            units=table.units,
            angles=table.angles,
            order=table.order,
            ignore=table.ignore,
        )
    targets = replace(read, points=read.points + origin)
    if table.through == "lines":
        return polyline(targets, closed=table.closed, speed=table.speed)
    return spline(targets, times=table.times, closed=table.closed, speed=table.speed)


def _outline(table: PathTable, at: Vector, file: FilePath) -> Path:
    found = read_svg(file.parent / (table.file or ""), pixel=table.pixel, speed=table.speed)
    if table.outline is None and len(found) > 1:
        lengths = ", ".join(f"{k + 1}: {path.length:.3g} m" for k, path in enumerate(found[:12]))
        fact = f"names none of the {len(found)} outlines ({lengths})"
        raise JobError(file, "path.outline", fact, "say which one")
    index = (table.outline or 1) - 1
    if index >= len(found):
        raise JobError(file, "path.outline", f"is {table.outline}", f"the drawing has {len(found)}")
    if table.at is None and table.frame is None:
        return found[index].starting_at(at)
    return found[index].in_frame(pose_from(at))


def _surface(formula: str | float) -> Callable[[float, float], float]:
    """z(u, v) of a formula of u and v."""
    u, v = symbol("u", 1), symbol("v", 1)
    height = Function("surface", {"u": u, "v": v}, {"z": parse(formula, {"u": u, "v": v})})
    return lambda a, b: float(np.ravel(height([a], [b]))[0])


def _check_begin(path: Path, table: PathTable, tool: Matrix, task: Task, q0: Vector, file: FilePath) -> None:
    """Raises: JobError when a path begins elsewhere than at the tool, in the rows of the task."""
    R = tool[:3, :3] if path.rotation is None else path.rotation
    off = np.abs(task.error(q0, path.start, R))
    if off.max(initial=0.0) <= TOLERANCES.start:
        return
    rows = [row for row in task.rows if row < 3]
    gap = float(np.abs((path.start - tool[:3, 3])[rows]).max(initial=0.0))
    where = f"the tool at the start posture, {_typed(tool[:3, 3])},"
    if gap <= TOLERANCES.start:
        turned = np.degrees(np.linalg.norm(rotation_vector(R @ tool[:3, :3].T)))
        fact = f"{where} is turned by {turned:.3g} degrees from the start of the path"
        raise JobError(file, "path", fact, 'set entry = "joints" to go there first, or choose another start posture')
    fact = f"{where} is {gap:.3g} m away from the start of the path"
    if table.kind == "polyline" and table.frame is None:
        first = "set relative = true, or make the tool's point the first one"
        cure = "begin with [0, 0, 0]" if table.relative else first
        raise JobError(file, "path.points.0", fact, f'{cure}, or set entry = "joints" to go there first')
    raise JobError(file, "path", f"{fact}, {_typed(path.start)}", 'set entry = "joints" to go there first, or move it')


def _typed(point: Vector) -> str:
    """A point as one would type it into a job, within the tolerance of a start."""
    return "[" + ", ".join(f"{round(float(v), 9) + 0.0:.10g}" for v in point) + "]"
