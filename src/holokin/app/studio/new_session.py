"""`open_session`: a session of a job, or of a robot with strategies and a loop to begin with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import fitting_task, regular_starts
from ...analysis.coverage.pose_postures import chain_to_tool
from ...base.errors import ArgumentError, HolokinError
from ...base.types import ArrayLike, Matrix, Vector
from ...motion import drift, follow
from ...path import Path
from ...path.editing import AnyPath
from ...robot import Robot, is_model, joints_above
from ...strategies import moore_penrose
from ...strategies.tasks.frame_task import stacked
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose
from ..job import Job, is_job, open_one_job
from ..job.job_parts import build_begin, build_paths, build_strategy, build_tasks, naming
from ..job.runner import sheets_of_job
from .followers import Loop, circle_loop, entered, loop_start
from .session import Session
from .states import Origin
from .strategies import NamedStrategy, default_strategies, redundant

TRIED = 4  # start postures that are tried for a robot; half of them with two hands, where each takes twice the time
# of so many of the most regular postures those are preferred in which the tool's z axis points down: its z
AMONG, DOWN = 300, -0.8
FLOOR = 0.02  # how far below the floor of its base an arm may reach [m] in a start posture that is preferred
# radii of the circles that are tried, as shares of how far the tool is from the base: a Panda's first is 0.1 m
SHARES = (0.15, 0.08, 0.04, 0.02)
LARGEST = 0.15  # largest radius of such a circle [m]
LOOK, TRY = 100, 40  # steps a circle with which loops are compared, and strategies are tried
# drift [rad or m] that is well seen; drift that is none; and cycles that are played at most to see it
VISIBLE, UNSEEN, MOST = 0.1, 1e-6, 5
CYCLES = 3  # of a robot's loop, as of the packaged job
ARM = 4  # joints of its own that a hand has whose arm is one of two
LASTING = 8  # cycles that the pseudo-inverse makes of a loop to begin with before its drift takes it to a joint limit


def open_session(name: str, *, tip: str | None = None, base: str | None = None, trust_units: bool = False) -> Session:
    """A session of a job (packaged, or a file), or of a robot (of the catalogue, or a file).

    A job gives its robot, task, start, path and strategies. A robot gets the task that leaves joints free, a start in
    the middle of its joint limits, `default_strategies`, and a circle that they follow to the end, in the plane in which the
    pseudo-inverse drifts most.

    Args:
        name: as of `holokin run` or of `hk.load`. tip, base, trust_units: of a robot, as of `hk.load`; of a model the
            tool at the end of its longest arm by default.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: what reading jobs and robots raises.
    """
    if is_job(name):
        short, job, file = open_one_job(name)
        return session_of_job(short, job, file)
    chain = chain_to_tool(name, tip, base, trust_units)
    given = {"name": name, "tip": chain.tip if is_model(name) else tip, "base": chain.base}
    given |= {"trust_units": True} if trust_units else {}
    return session_of_robot(chain.robot, source=name, origin={k: v for k, v in given.items() if v is not None})


def session_of_job(name: str, job: Job, file: FilePath) -> Session:
    """A session of a job that was read.

    A strategy that cannot begin, because it is singular at the start or its leaf is not found, is left out.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: as `run_job`; of no strategy that can begin, the first's
            reason.
    """
    _, start, tasks = build_tasks(job, file)
    redundant(tasks[0])
    with naming(file, "path"):
        path = build_paths(job.path, tasks[0], start, file)
    strategies: list[NamedStrategy] = []
    first: HolokinError | None = None
    for (label, table), task in product(job.strategies.items(), tasks):
        title = label if len(tasks) == 1 else f"{label} ({task.orientation})"
        try:
            with naming(file, "strategies", label):
                G = build_strategy(job, label, task, start, title)
                G(build_begin(table, G, start)[0])
        except HolokinError as problem:
            first = first or problem
            continue
        keys = table.model_dump(exclude_unset=True)
        level = np.atleast_1d(np.array(keys["level"], dtype=float)) if keys.get("level") is not None else None
        strategies.append(NamedStrategy(title, len(strategies), G, task, level, keys, label))
    if not strategies and first is not None:
        raise first
    keys = job.path.model_dump(exclude_unset=True, exclude={"samples", "cycles"})
    loop = Loop(job.path.kind, path, _based(keys, path), job.path.samples, bool(job.path.clockwise))
    robot, work = (part.model_dump(exclude_unset=True, exclude_none=True) for part in (job.robot, job.task))
    origin = Origin(robot, work, file.parent.absolute())
    cycles = max(job.path.cycles, visible_cycles(strategies, loop, start))
    session = Session(strategies, start, loop, title=job.title, source=name, cycles=cycles, origin=origin)
    if job.sheets is None or tasks[0].frames > 1:
        return session
    return session.with_sheets(lambda say: sheets_of_job(job, tasks[0], start, file, say))


def visible_cycles(strategies: Sequence[NamedStrategy], loop: Loop, q0: Vector) -> int:
    """After how many cycles of a loop, begun from a posture (n,), the largest drift of its strategies is seen; at most MOST.

    One for an open path, and where no strategy drifts. A strategy that does not get round so often does not count.
    """
    largest = np.zeros(MOST)
    for strategy in strategies if loop.path.closed else ():
        if strategy.G is None or strategy.holonomic:
            continue
        try:
            start = loop_start(strategy, loop, q0)
            drifts = drift(strategy.G, loop.path, start, samples=LOOK, cycles=MOST)
        except HolokinError:
            continue
        largest = np.maximum(largest, drifts.largest)
    if not largest.max() > UNSEEN:
        return 1
    return int(np.argmax(largest >= VISIBLE)) + 1 if largest.max() >= VISIBLE else MOST


def _based(keys: dict[str, Any], path: AnyPath) -> dict[str, Any]:
    """The keys of a circle whose center counts from the tool, with its place in the base: a page moves it there."""
    if keys["kind"] != "circle" or not keys.get("relative") or not isinstance(path, Path) or len(path.segments) != 1:
        return keys
    center = path.segments[0].center
    return {key: value for key, value in keys.items() if key != "relative"} | {"center": center.tolist()}


def session_of_robot(
    robot: Robot,
    task: Task | None = None,
    q0: ArrayLike | None = None,
    *,
    source: str = "",
    origin: dict[str, Any] | None = None,
) -> Session:
    """A session of a robot, with strategies and a loop to begin with.

    Args:
        task: by default the pose, of each hand of a robot with two arms, or else the position, or less, so that a joint
            is to spare.
        q0: by default a regular posture in the middle of the joint limits, with the tool down where there is one.
        origin: what a job says of the robot: its [robot]. With a task of your own no job can be written.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: no strategy is defined at the start.
    """
    chosen = _task_of(robot) if task is None else task
    redundant(chosen)
    tried = TRIED // chosen.frames
    starts = _start_postures(chosen)[:tried] if q0 is None else robot.checked(q0, "the start posture")[None]
    if not len(starts):
        raise ArgumentError(f"the start of {robot.name!r}", None, "no posture within its limits was found: give one")
    job_origin = None if origin is None or task is not None else Origin(origin, _task_keys(chosen), FilePath.cwd())
    known: dict[int, tuple[NamedStrategy, ...]] = {}
    for i, loop in _loops(chosen, starts):
        strategies = known[i] = known.get(i) or default_strategies(chosen, starts[i])
        if all(_follows(strategy, loop, starts[i], 1 if strategy.holonomic else LASTING) for strategy in strategies):
            return Session(
                strategies, starts[i], loop, title=robot.name, source=source, origin=job_origin, cycles=CYCLES
            )
    strategies = default_strategies(chosen, starts[0])
    return Session(strategies, starts[0], title=robot.name, source=source, origin=job_origin, cycles=CYCLES)


def _task_of(robot: Robot) -> Task:
    """The task that leaves joints free: the poses of the hands of two arms, else as `fitting_task`."""
    arms = [_moving(robot, tip.joint) for tip in robot.tips]
    apart = len(arms) == 2 and min(len(arms[0] - arms[1]), len(arms[1] - arms[0])) >= ARM
    if apart and robot.n > 12:
        return stacked(*(pose(robot, tip=tip.name) for tip in robot.tips))
    return fitting_task(robot)


def _moving(robot: Robot, joint: int) -> set[int]:
    """The coordinates that move a joint."""
    return {robot.joints[above].coordinate for above in joints_above(robot.joints, joint)}


def _start_postures(task: Task) -> Matrix:
    """Regular postures (k, n); of arms in space first those above the floor, the tool down in front of the base."""
    starts = regular_starts(task)
    if task.robot.planar or not len(starts):
        return starts
    some = starts[:AMONG]
    p, R = task._poses(some)
    front = (p[:, 0] > 0) & (R[:, 2, 2] < DOWN)
    above = np.array([min(points[:, 2].min() for points in task.robot.skeleton(q)) > -FLOOR for q in some])
    return np.vstack([some[front & above], some[front], some[above], starts])


def _loops(task: Task, starts: Matrix) -> Iterator[tuple[int, Loop]]:
    """Circles from the tool at start postures (k, n), each with the index of its start: of each size, the largest
    first, in the order in which the pseudo-inverse drifts."""
    given = moore_penrose(task)
    far = float(np.linalg.norm(task._poses(starts)[0][:, :3], axis=1).max())
    normals = np.eye(3)[2:] if task.robot.planar else np.eye(3)[::-1]
    for share in SHARES:
        radius = float(f"{min(LARGEST, share * far):.1g}")
        candidates: list[tuple[float, int, Loop]] = []
        for i, normal in product(range(len(starts)), normals):
            tool = task.pose(starts[i]).reshape(-1, 4, 4)[0][:3, 3]
            for inward in _inward(tool, normal):
                loop = entered(circle_loop(tool + radius * inward, radius, normal, near=tool), task, starts[i])
                try:
                    size = float(drift(given, loop.path, starts[i], samples=LOOK).largest[0])
                except HolokinError:
                    continue
                candidates.append((size, i, loop))
        candidates.sort(key=lambda candidate: -candidate[0])
        yield from ((i, loop) for _, i, loop in candidates)


def _inward(tool: Vector, normal: Vector) -> list[Vector]:
    """Unit directions in a plane from the tool to the center of a circle: towards the base, up and down."""
    flat = [-np.sign(tool[0] or 1.0) * np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]]
    return [d for d in flat if abs(float(d @ normal)) < 0.5][:2]


def _follows(strategy: NamedStrategy, loop: Loop, q: Vector, cycles: int) -> bool:
    """Whether a strategy follows some cycles of a loop."""
    if strategy.G is None:
        return True
    try:
        follow(strategy.G, loop.path, q, samples=TRY, cycles=cycles)
    except HolokinError:
        return False
    return True


def _task_keys(task: Task) -> dict[str, Any]:
    """[task] of a job, for what is chosen for a robot."""
    if task.frames > 1:
        return {"kind": "stacked", "parts": [{"kind": "pose", "tip": tip.name} for tip in task.robot.tips]}
    if task.orientation is not None:
        return {"kind": "pose", "orientation": "twist"}
    if task.m == (2 if task.robot.planar else 3):
        return {"kind": "position"}
    return {"kind": "position", "rows": list(task.rows)}
