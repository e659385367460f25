"""One case of a survey: a strategy or control law follows a loop, and what happened becomes a row."""

from __future__ import annotations

import importlib
import json
import math
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import regular_starts
from ...base.errors import KEPT, ArgumentError, HolokinError, JointLimitError, PathError, SingularityError
from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Vector
from ...motion import follow, simulate
from ...motion.control import ControlLaw
from ...motion.follow_path import build_native
from ...motion.trajectory import Status, Trajectory, over_least_speed
from ...path import Path
from ...robot import Robot, beside, without_speed_limit
from ...robot.chains import longest_reach
from ...strategies import Strategy
from ...strategies.tasks.task import Task
from ...symbolic.rotations import frame_about
from ..job.job_parts import build_paths
from ..job.strategy_tables import StrategyTable
from ..job.tables import PathTable, RobotTable, TaskTable, robot_of_job
from . import survey_file
from .cases import Case, Cases, robot_table
from .survey_file import given

# --- Loops of a survey: what is left to chance is drawn, and each becomes a [path] table as of a job.

PLANES = {"xy": (0.0, 0.0, 1.0), "yz": (1.0, 0.0, 0.0), "xz": (0.0, -1.0, 0.0)}
"""The normal of a plane."""

LINES = 4
"""Lines of a raster."""

WAVES, POINTS = 3, 12
"""Harmonics of a smooth random curve, and points of the spline through it."""

DIGITS = 12
"""Digits of what is drawn, so that a job file that repeats a case can be read."""


def drawn(table: survey_file.LoopTable, length: float, planar: bool, rng: np.random.Generator) -> dict[str, Any]:
    """A [path] table of a loop that begins at the tool.

    Args:
        length: of the arm [m], of which `share` is one. planar: the loop lies in the plane of the robot.
    """
    size = _number(table.size, rng) if table.size is not None else _number(table.share, rng) * length
    speed = _number(table.speed, rng)
    normal, turned = _normal(table, planar, rng), rng.uniform(0, 2 * np.pi)
    clockwise = table.direction == "clockwise" or (table.direction == "random" and bool(rng.integers(2)))
    # not by rotations of a library, whose last digits may differ from version to version
    a, b = np.asarray(frame_about(normal))[:, :2].T
    u, v = np.cos(turned) * a + np.sin(turned) * b, np.cos(turned) * b - np.sin(turned) * a
    if clockwise:
        v = -v
    path: dict[str, Any] = {"relative": True, "speed": _short(speed)}
    if table.kind == "circle":
        path |= {"kind": "circle", "center": _shorts(size / 2 * u), "normal": _shorts(normal)}
        return path | {"clockwise": clockwise}
    if table.kind == "smooth":
        return path | {"kind": "spline", "points": _points(_smooth(size, rng), u, v), "closed": True}
    corners = {
        "square": lambda: size / 2**0.5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]),
        "raster": lambda: _raster(size),
        "figure-eight": lambda: _eight(size),
    }[table.kind]()
    kind = "spline" if table.kind == "figure-eight" else "polyline"
    return path | {"kind": kind, "points": _points(corners, u, v), "closed": True}


def _number(value: float | tuple[float, float] | None, rng: np.random.Generator) -> float:
    low, high = value if isinstance(value, tuple) else (value or 0.0, value or 0.0)
    return float(rng.uniform(low, high))


def _normal(table: survey_file.LoopTable, planar: bool, rng: np.random.Generator) -> Vector:
    towards = rng.normal(size=3)
    if planar:
        return np.array(PLANES["xy"])
    if table.plane == "random":
        return towards / np.linalg.norm(towards)
    given = np.array(PLANES[table.plane] if isinstance(table.plane, str) else table.plane)
    return given / np.linalg.norm(given)


def _raster(size: float) -> Matrix:
    """Lines there and back, and a straight path home beside them."""
    side = size / 2**0.5
    rows = []
    for k in range(LINES):
        y = side * k / (LINES - 1)
        ends = [[0.05 * side, y], [side, y]]
        rows += ends if k % 2 == 0 else ends[::-1]
    rows[0] = [0.0, 0.0]
    return np.array([*rows, [0.0, side]])


def _eight(size: float) -> Matrix:
    """Points of a figure of eight that begins at its crossing."""
    t = 2 * np.pi * np.arange(16) / 16
    return size / 2 * np.column_stack([np.sin(t), 0.5 * np.sin(2 * t)])


def _smooth(size: float, rng: np.random.Generator) -> Matrix:
    """Points of a closed curve of a few random harmonics, whose largest extent is about `size`."""
    t = 2 * np.pi * np.arange(POINTS) / POINTS
    curve = np.zeros((POINTS, 2))
    for k in range(1, WAVES + 1):
        a, b = rng.normal(size=(2, 2)) / k**2
        curve += np.outer(np.cos(k * t), a) + np.outer(np.sin(k * t), b)
    apart = np.linalg.norm(curve[:, None] - curve[None], axis=2).max()
    return size / apart * (curve - curve[0])


def _points(flat: Matrix, u: Vector, v: Vector) -> list[list[float]]:
    return [_shorts(x * u + y * v) for x, y in flat - flat[0]]


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _shorts(values: Vector) -> list[float]:
    return [_short(value) + 0.0 if abs(value) > 1e-12 else 0.0 for value in values]


KEPT_LAWS = 64
"""Strategies whose functions a process keeps: some tens of megabytes."""

LOST = 0.05
"""Distance of the tool from its path [m] at which a control law has lost it: it would go on, but no work would."""


class CaseStatus(StrEnum):
    """What became of a case; its words are those of the files."""

    COMPLETE = "complete"
    LIMIT = "limit"
    OUT_OF_REACH = "out of reach"
    SINGULAR = "singular"
    BRANCH = "branch"
    JUMP = "jump"
    LOST = "lost"
    FAULT = "fault"


METRICS = {
    "cycles": "complete cycles before it stopped",
    "drift": "largest joint error after the first cycle [rad, m]",
    "drift_mean": "the same, mean over its cycles",
    "drift_last": "the same of its last complete cycle: what is left when a law has converged",
    "drift_total": "largest joint error between the start and the end of its last cycle [rad, m]",
    "tracking": "largest error of the tool's position [m]",
    "sigma": "smallest singular value of J on its way",
    "margin": "smallest distance of a joint to its limits, as a share of its range",
    "joint_path": "length of the joints' path in the first cycle [rad, m]",
    "cost": "the same as a multiple of the least: of the pseudo-inverse at the same postures",
    "peak_speed": "largest joint speed as a share of its limit",
}


Ready = tuple[Task, Vector, Strategy | ControlLaw]
"""Task, start posture (n,) and strategy of a case."""


@dataclass(frozen=True)
class Row:
    """What became of a case."""

    id: str
    number: int
    names: dict[str, str]
    status: CaseStatus
    reason: str
    metrics: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0


def fault(case: Case, reason: str, seconds: float = 0.0) -> Row:
    """The row of a case that could not be run."""
    return Row(case.id, case.number, case.names, CaseStatus.FAULT, reason, {}, seconds)


@lru_cache(maxsize=8)
def _robot(table: str, folder: FilePath) -> Robot:
    content = robot_table(json.loads(table))
    if str(content.get("name", "")).startswith(survey_file.OBJECT):
        return given(content["name"])
    return robot_of_job(RobotTable.model_validate(content), folder / "survey.toml")


@lru_cache(maxsize=16)
def _starts(robot: str, task: str, folder: FilePath) -> np.ndarray:
    arm = _robot(robot, folder)
    middle = np.clip(0.0, arm.lower, arm.upper)
    return regular_starts(TaskTable.model_validate_json(task).tasks(arm, middle)[0])


def start_of(case: Case, folder: FilePath) -> Vector:
    """The start posture (n,). Raises: ArgumentError: there is none of this kind."""
    robot, task = json.dumps(case.robot, sort_keys=True), json.dumps(case.task, sort_keys=True)
    arm, index = _robot(robot, folder), case.start["index"]
    if case.start["kind"] == "regular":
        starts = _starts(robot, task, folder)
        if index >= len(starts):
            raise ArgumentError("regular", index + 1, f"{arm.name} has {len(starts)} such start postures")
        return starts[index]
    rng = np.random.default_rng([case.start["seed"], zlib.crc32(robot.encode()), index])
    lower, upper = (np.clip(b, -np.pi, np.pi) for b in (arm.lower, arm.upper))
    margin = case.start["margin"]
    return np.round(lower + (upper - lower) * rng.uniform(margin, 1 - margin, arm.n), 4)


def _path_table(case: Case, folder: FilePath) -> dict[str, Any]:
    """The [path] table of its loop, drawn from what tells the loop, not from its place in the survey."""
    arm = _robot(json.dumps(case.robot, sort_keys=True), folder)
    text = json.dumps([case.robot, case.task, case.start, case.loop["table"]], sort_keys=True)
    rng = np.random.default_rng([case.loop["seed"], zlib.crc32(text.encode()), case.loop["index"]])
    length = longest_reach(arm)
    table = survey_file.LoopTable.model_validate(case.loop["table"])
    keys = drawn(table, length if np.isfinite(length) else 1.0, arm.planar, rng)
    return keys | {"samples": case.rest["samples"], "cycles": case.rest["cycles"]}


def repeating_job(case: Case, cases: Cases) -> tuple[dict[str, Any], str]:
    """(a job of a case, why it does not repeat the case); files of robots count from the root, not from the survey.

    Jobs do not run control laws: in place of one the job has the pseudo-inverse, and says so.

    Raises:
        HolokinError: there is no robot, task or start of the case, or its loop is of a survey in Python.
    """
    task = _task(json.dumps([case.robot, case.task], sort_keys=True), cases.folder)
    if case.loop["table"]["kind"] == "given":
        raise ArgumentError("the loop", case.names["loop"], "a survey in Python was given it: go round it there")
    q0, robot = start_of(case, cases.folder), case.names["robot"]
    law = survey_file.resolved(cases.table.laws, case.law, task, q0)[case.law]
    strategies, head = {"moore-penrose": {"kind": "moore-penrose"}}, {"title": f"case {case.id}: {case.law} on {robot}"}
    if isinstance(law, StrategyTable):
        strategies, why = {case.law: law.model_dump(exclude_unset=True)}, ""
    else:
        why = (
            f"Jobs do not run control laws or functions of yours, as {case.law!r}: this job has the pseudo-inverse, "
            "round the same loop from the same start. "
        )
        by = f"In Python holokin.app.survey.repeat(RESULTS, {case.id!r}) runs the law itself."
        why += "A survey in Python was given the law: run it there." if isinstance(law, survey_file.Given) else by
        head = {"title": f"not case {case.id}, but its loop with the pseudo-inverse, on {robot}", "about": why}
    job = head | {"robot": _anywhere(robot_table(case.robot), cases.folder), "task": case.task}
    job |= {"start": {"q": q0.tolist()}, "path": _path_table(case, cases.folder), "strategies": strategies}
    return job, why


def _anywhere(robot: dict[str, Any], folder: FilePath) -> dict[str, Any]:
    """A [robot] table whose files are found from any folder."""
    placed = dict(robot)
    if placed.get("name"):
        placed["name"] = str(beside(placed["name"], folder.absolute()))
    if placed.get("parts"):
        placed["parts"] = [_anywhere(part, folder) for part in placed["parts"]]
    return placed


def repeat_case(case: Case, cases: Cases) -> tuple[Trajectory, str]:
    """(what the joints did, why it stopped; empty where it did not) of a case, as `run_case` has it in its row.

    Raises:
        HolokinError: what its row gives as the reason.
    """
    (walk, reason, _), _ = _walk(case, cases)
    return walk, reason


def run_case(case: Case, cases: Cases, ready: Ready | None = None) -> Row:
    """A case from its start to the end of its loop or to where it stops. What fails is said in the row."""
    began = time.perf_counter()
    # The motion, or why there is none.
    try:
        walk, task = _walk(case, cases, ready)
    except HolokinError as problem:
        cause = problem.__cause__ or problem
        status = CaseStatus.SINGULAR if isinstance(cause, SingularityError) else CaseStatus.FAULT
        status = CaseStatus.LIMIT if isinstance(cause, JointLimitError) else status
        return Row(case.id, case.number, case.names, status, str(problem), {}, time.perf_counter() - began)
    walk, reason, cause = walk
    # The metrics of the survey, and the user's own.
    metrics = _metrics(walk, task)
    status = CaseStatus[(walk.status if cause is None else cause).name]
    try:
        own, problems = survey_file.own_metrics(cases.table.metrics, walk, cases.folder)
    except HolokinError as problem:
        own, problems = {}, [problem]
    if problems:  # a fault, so that --again does it again once the function is right
        status, reason = CaseStatus.FAULT, "; ".join([*filter(None, [reason]), *map(str, problems)])
    return Row(case.id, case.number, case.names, status, reason, metrics | own, time.perf_counter() - began)


def prepare(case: Case, cases: Cases) -> Ready | None:
    """What `run_case` takes: robot, task, strategy and native code are built, if later cases share them, and kept.

    None where it fails: `run_case` tells why.
    """
    importlib.import_module("scipy.spatial.transform")  # paths load it when they are first sampled
    with suppress(HolokinError):
        return _set_up(case, cases)
    return None


def _walk(case: Case, cases: Cases, ready: Ready | None = None) -> tuple[tuple[Trajectory, str, Status | None], Task]:
    task, q0, law = ready or _set_up(case, cases)
    return _run(law, task, _path(case, task, q0, cases.folder), q0, case.rest), task


def _set_up(case: Case, cases: Cases) -> Ready:
    """Task, start posture and strategy of a case; task and strategy, with its native code, are kept."""
    q0 = start_of(case, cases.folder)
    of_task = json.dumps([case.robot, case.task], sort_keys=True)
    task = _task(of_task, cases.folder)
    laws = survey_file.resolved(cases.table.laws, case.law, task, q0)
    key = [
        of_task,
        str(cases.folder),
        *map(repr, laws.items()),
        *(q0.tolist() if survey_file.of_the_start(laws) else []),
    ]

    def make() -> Strategy | ControlLaw:
        law = survey_file.built(laws, case.law, task, q0, cases.folder)
        if isinstance(law, Strategy):
            build_native(law)
        return law

    return task, q0, _law(str(key), make)


@lru_cache(maxsize=16)
def _task(of_task: str, folder: FilePath) -> Task:
    robot, task = json.loads(of_task)
    arm = _robot(json.dumps(robot, sort_keys=True), folder)
    middle = np.clip(0.0, arm.lower, arm.upper)
    redundant = TaskTable.model_validate(task).tasks(arm, middle)[0]
    if redundant.n <= redundant.m:
        fact, cure = (
            f"{redundant.n} joints for {redundant.m} rows",
            "no joint is redundant: choose a task of fewer rows",
        )
        raise ArgumentError(f"the task {redundant.name!r}", fact, cure)
    return redundant


_laws: dict[str, Strategy | ControlLaw] = {}


def _law(key: str, make: Callable[[], Strategy | ControlLaw]) -> Strategy | ControlLaw:
    """A strategy, kept while it is among the last ones that were asked for."""
    known = _laws.pop(key, None)
    if known is None:
        known = make()
    _laws[key] = known
    while len(_laws) > KEPT_LAWS:
        del _laws[next(iter(_laws))]
    return known


@survey_file.when_replaced
def forget_built() -> None:
    """Build anew what cases share: robots, tasks, strategies and paths."""
    for known in (_robot, _starts, _task, _drawn_path):
        known.cache_clear()
    _laws.clear()


def _path(case: Case, task: Task, q0: Vector, folder: FilePath) -> Path:
    if case.loop["table"]["kind"] == "given":
        return survey_file.given_path(case.loop["table"]["key"], task.pose(q0))
    table = json.dumps(_path_table(case, folder), sort_keys=True)
    return _drawn_path(task, tuple(q0.tolist()), table, folder)


@lru_cache(maxsize=4)
def _drawn_path(task: Task, start: tuple[float, ...], table: str, folder: FilePath) -> Path:
    """A path, kept for all strategies of a loop: the length of a spline takes longer than a strategy to go round it."""
    path = PathTable.model_validate_json(table)
    return build_paths(path, task, np.array(start), folder / "survey.toml")  # type: ignore[return-value]


def _run(
    law: Strategy | ControlLaw, task: Task, path: Path, q0: Vector, rest: dict[str, Any]
) -> tuple[Trajectory, str, Status | None]:
    """(what the joints did, why it stopped, how it ended where the record does not know)."""
    try:
        if isinstance(law, Strategy):
            walk = follow(
                law, path, q0, samples=rest["samples"], cycles=rest["cycles"], limits=rest["limits"], native=True
            )
            return walk, "", None
        # Longest step of a control law [s]: a large, slow loop gets more of them than samples.
        steps = rest["samples"] * math.ceil(path.duration / rest["samples"] / 0.02)
        walk = simulate(law, task, path, q0, dt=path.duration / steps, cycles=rest["cycles"])
    except PathError as problem:
        if problem.trajectory is None:
            raise
        return problem.trajectory, str(problem).removesuffix(f"; {KEPT}"), None
    return _while_it_holds(walk, task.robot, rest["limits"])


def _while_it_holds(walk: Trajectory, robot: Robot, limits: bool) -> tuple[Trajectory, str, Status | None]:
    """What a control law did until it first left the joint limits, or the path; and which."""
    beyond = robot.beyond(walk.q) > TOLERANCES.limit
    metres = [i for i, unit in enumerate(walk.row_units) if unit == "m"]
    off = np.linalg.norm(walk.error[:, metres], axis=1) > LOST
    ended = (beyond.any(axis=1) & limits) | off
    if not ended.any():
        return walk, "", None
    k = int(np.argmax(ended))
    if limits and beyond[k].any():
        joint = robot.joint_names[int(np.argmax(beyond[k]))]
        return walk.until(k), f"went beyond a limit of {joint!r}, which nothing stopped", Status.LIMIT
    return walk.until(k), f"the tool was more than {LOST:g} m away from the path", Status.LOST


def _metrics(walk: Trajectory, task: Task) -> dict[str, float]:
    robot = task.robot
    metrics = dict.fromkeys(METRICS, float("nan")) | {"cycles": float(walk.cycles)}
    if walk.cycles:
        each = np.abs(walk.drift()).max(axis=1)
        metrics |= {
            "drift": float(each[0]),
            "drift_mean": float(each.mean()),
            "drift_last": float(each[-1]),
            "drift_total": float(np.abs(walk.drift_since_start()[-1]).max()),
        }
    once = walk.until(walk.marks[1] + 1) if walk.cycles else walk
    q = once.q
    bounded = np.isfinite(robot.upper - robot.lower)
    if bounded.any():
        room = np.minimum(walk.q - robot.lower, robot.upper - walk.q)[:, bounded]
        metrics["margin"] = float((room / (robot.upper - robot.lower)[bounded]).min())
    if len(q) > 1:
        metrics |= {
            "joint_path": float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
            "cost": over_least_speed(task, once),
            "sigma": float(once.sigma.min()),
        }
        if not without_speed_limit(robot):
            metrics["peak_speed"] = float((np.abs(once.dq) / robot.max_velocity).max())
    metrics["tracking"] = walk.tracking_error("m")
    return metrics
