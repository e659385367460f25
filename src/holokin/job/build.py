"""From the tables of a job to the nouns: robot, tasks, path, strategies."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np

from ..constraint import (
    Cost,
    arm_angle,
    centring_cost,
    coupled,
    custom,
    height,
    linear,
    lock,
    manipulability_cost,
    posture_cost,
    stack,
    stationary,
)
from ..errors import ArgumentError, JobError, JointLimitError, StartError
from ..path import Path, arc, as_point, circle, polyline
from ..robot import Robot, load
from ..strategy import Strategy, coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, radial, weighted
from ..symbolic import SX, Function, horzcat, parse, symbol, vertcat
from ..task import Task, pose, position
from ..types import Vector
from .schema import Formula, Job, StrategyTable


def build_robot(job: Job, file: FilePath) -> Robot:
    """The robot of a job; a path counts from the job file's folder."""
    table = job.robot
    name = FilePath(table.name)
    if name.suffix and not name.is_absolute():
        name = file.parent / name
    return load(name, tip=table.tip, base=table.base, locked=table.locked or None)


def build_start(job: Job, robot: Robot, file: FilePath) -> Vector:
    """The start posture (n,) in rad and m, within the limits. Raises: JobError."""
    q = np.array(job.start.q, dtype=float)
    if len(q) != robot.n:
        names = ", ".join(robot.joint_names)
        raise JobError(file, "start.q", f"has {len(q)} numbers", f"give {robot.n}, for {names}")
    turned = np.array([np.deg2rad(v) if c.unit == "rad" else v for v, c in zip(q, robot.coordinates, strict=True)])
    if job.start.degrees:
        q = turned
    try:
        robot.check_limits(q)
    except JointLimitError as problem:
        cure = problem.cure
        if not job.start.degrees and ((turned >= robot.lower) & (turned <= robot.upper)).all():
            cure = "if these are degrees, set degrees = true; else " + cure
        raise JobError(file, "start.q", problem.fact, cure) from problem
    return q


def build_tasks(job: Job, robot: Robot, start: Vector) -> list[Task]:
    """One task, or one for each orientation of a list; rotation vectors count from the start orientation."""
    table = job.task
    if table.kind == "position":
        return [position(robot, rows=table.rows)]
    kinds = table.orientation if isinstance(table.orientation, list) else [table.orientation]
    return [pose(robot, kind, reference=robot.pose(start)[:3, :3], rows=table.rows) for kind in kinds]


def build_path(job: Job, tool: Vector, file: FilePath) -> Path:
    """The path, beginning at the tool's start point (3,). Raises: JobError, ArgumentError."""
    table = job.path
    origin = tool if table.relative else np.zeros(3)

    def placed(point: list[float]) -> Vector:
        return origin + as_point(point)

    if table.kind == "polyline":
        points = np.array([placed(p) for p in table.points or []])
        turns = None if table.turns_deg is None else np.deg2rad(table.turns_deg)
        return polyline(points, turns=turns, closed=table.closed, speed=table.speed)
    center = placed(table.center or [])
    normal = np.array(table.normal)
    off = float((tool - center) @ normal) / max(float(np.linalg.norm(normal)), 1e-300)
    if not table.relative and abs(off) > 1e-9 * np.linalg.norm(tool - center):
        fact = f"is {abs(off):.6g} m off the plane through the tool, {_typed(tool)}, that is normal to {table.normal}"
        inside = center - tool + off * normal / np.linalg.norm(normal)
        cure = f"set relative = true and count center from the tool: center = {_typed(inside)}"
        raise JobError(file, "path.center", fact, cure)
    sign = -1.0 if table.clockwise else 1.0
    if table.kind == "circle":
        return circle(tool, center, table.normal, clockwise=table.clockwise, speed=table.speed)
    return arc(tool, center, sign * np.deg2rad(table.angle_deg or 0.0), table.normal, speed=table.speed)


def build_strategy(name: str, table: StrategyTable, task: Task, start: Vector) -> Strategy:
    """A strategy of a job for one task; `start` is the centre of a radial twin."""
    names = task.robot.joint_names
    match table.kind:
        case "moore-penrose":
            return moore_penrose(task, name=name)
        case "weighted":
            return weighted(task, _matrix(table.W or [], names), name=name)
        case "null-basis":
            return null_basis(task, _matrix(table.N_G or [], names), name=name)
        case "pfaffian":
            return pfaffian(task, _matrix(table.A or [], names), name=name)
        case "coupled-twist":
            return coupled_twist(task, _gain(table), name=name)
        case "custom":
            rows = table.g or []
            constraint = custom(_column(rows, names), len(rows))
        case "linear":
            constraint = linear(table.matrix or [])
        case "lock":
            constraint = lock(*(table.joints or []))
        case "coupled":
            constraint = coupled(_gain(table), table.orientation or "zyz")
        case "arm-angle":
            constraint = arm_angle(kind=table.arm or "stereographic", joints=_three(table.joints))
        case "height":
            constraint = stack(*(height(joint) for joint in table.joints or []))
        case "stationary":
            constraint = stationary(_cost(table), free=tuple(table.free) if table.free else None)
        case "radial":
            given = moore_penrose(task) if table.W is None else weighted(task, _matrix(table.W, names))
            return radial(given, start, steps=table.steps or 4, name=name)
    return holonomic(task, constraint, name=name)


def build_invariant(table: StrategyTable, robot: Robot) -> Function | None:
    """q -> the invariants (k,) that a strategy's paths must keep, if the job names any."""
    if not table.invariant:
        return None
    q = symbol("q", robot.n)
    return Function("invariant", {"q": q}, {"value": _column(table.invariant, robot.joint_names)(q)})


def _three(joints: list[str] | None) -> tuple[str, str, str] | None:
    if joints is None:
        return None
    if len(joints) != 3:
        raise ArgumentError("the joints of an arm angle", joints, "name three: shoulder, elbow, wrist")
    return joints[0], joints[1], joints[2]


def _cost(table: StrategyTable) -> Cost:
    match table.cost:
        case "centring":
            return centring_cost()
        case "manipulability":
            return manipulability_cost()
        case _:
            return posture_cost(table.preferred or [])


def _gain(table: StrategyTable) -> float | list[list[float]]:
    return 1.0 if table.gain is None else table.gain


def _names(q: SX, joints: tuple[str, ...]) -> dict[str, SX]:
    """The joints' names, and q1, q2, ... unless a joint is called like that, and perhaps not in this order."""
    named = {name: q[i] for i, name in enumerate(joints) if name.isidentifier()}
    if any(re.fullmatch(r"q\d+", name) for name in joints):
        return named
    return {f"q{i + 1}": q[i] for i in range(len(joints))} | named


def _typed(point: Vector) -> str:
    """A point as one types it in a job file, with more digits than any start needs."""
    return "[" + ", ".join(f"{value:.9g}" for value in point + 0.0) + "]"


def off_path(problem: StartError, job: Job, file: FilePath) -> JobError:
    """What a start posture off the path is to the writer of a job file."""
    first = "points begin" if job.path.kind == "polyline" else "the path begins"
    fact = f"{first} {problem.distance:.3g} m away from the tool at the start posture"
    cure = f"set relative = true, or make {_typed(np.array(problem.tool))} the first point"
    return JobError(file, "path", fact, cure)


def _column(rows: list[Formula], joints: tuple[str, ...]) -> Callable[[SX], SX]:
    return lambda q: vertcat(*(parse(row, _names(q, joints)) for row in rows))


def _matrix(rows: list[list[Formula]], joints: tuple[str, ...]) -> Callable[[SX], SX]:
    return lambda q: vertcat(*(horzcat(*(parse(x, _names(q, joints)) for x in row)) for row in rows))
