"""`open_session`: a session of a job, or of a robot with strategies and a loop to begin with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.coverage import fitting_task, regular_starts
from ...analysis.coverage.tool_chain import chain_to_tool
from ...base.errors import ArgumentError, HolokinError
from ...base.types import ArrayLike, Matrix, Vector
from ...motion import drift, follow
from ...path import Path
from ...robot import Robot, is_model, joints_above
from ...strategies import moore_penrose
from ...strategies.tasks.frame_task import stacked
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose
from ..job import Job, is_job, open_one_job
from ..job.job_parts import build_begin, build_paths, build_strategy, build_tasks, naming, title_of
from ..job.runner import alone_says, sheets_of_job
from ..job.templates import task_keys
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
    the middle of its joint limits, `default_strategies`, and a circle that they follow to the end, in the plane in
    which the pseudo-inverse drifts most.

    Args:
        name: as of `holokin run` or of `hk.load`. tip, base, trust_units: of a robot, as of `hk.load`; of a model the
            tool at the end of its longest arm by default.

    Raises:
        ArgumentError: no joint is to spare. HolokinError: what reading jobs and robots raises.
    """
    if is_job(name):
        alone_says(name, {"--tip": tip, "--base": base, "--trust-units": trust_units})
        return session_of_job(*open_one_job(name))
    chain = chain_to_tool(name, tip, base, trust_units)
    keys = {"name": name, "tip": chain.tip if is_model(name) else tip, "base": chain.base}
    keys |= {"trust_units": True} if trust_units else {}
    origin = {key: value for key, value in keys.items() if value is not None}
    return session_of_robot(chain.robot, source=name, origin=origin)


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
        path = build_paths(job.only_path, tasks[0], start, file)
    # The strategies that can begin, for each task.
    strategies: list[NamedStrategy] = []
    first: HolokinError | None = None
    for (label, table), task in product(job.strategies.items(), tasks):
        title = title_of(label, task, tasks)
        try:
            with naming(file, "strategies", label):
                G = build_strategy(job, label, task, start, title)
                G(build_begin(table, G, start)[0])
        except HolokinError as problem:
            first = first or problem
            continue
        keys = table.model_dump(exclude_unset=True)
        level = np.atleast_1d(np.array(keys["level"], dtype=float)) if keys.get("level") is not None else None
        strategies.append(NamedStrategy(title, G, task, level, keys, label))
    if not strategies and first is not None:
        raise first
    # The loop. The centre of a circle that counts from the tool is told in the base: a page moves it there.
    keys = job.only_path.model_dump(exclude_unset=True, exclude={"samples", "cycles"})
    if job.only_path.kind == "circle" and job.only_path.relative and isinstance(path, Path) and len(path.segments) == 1:
        del keys["relative"]
        keys["center"] = path.segments[0].center.tolist()
    loop = Loop(job.only_path.kind, path, keys, job.only_path.samples, bool(job.only_path.clockwise))
    # The session, with what a job says of it.
    robot, work = (part.model_dump(exclude_unset=True, exclude_none=True) for part in (job.robot, job.task))
    origin = Origin(robot, work, file.parent.absolute())
    cycles = max(job.only_path.cycles, visible_cycles(strategies, loop, start))
    session = Session(strategies, start, loop, title=job.title, source=name, cycles=cycles, origin=origin)
    if job.sheets is None or tasks[0].frames > 1:
        return session
    return session.with_sheets(lambda progress: sheets_of_job(job, tasks[0], start, file, progress))


def visible_cycles(strategies: Sequence[NamedStrategy], loop: Loop, q0: Vector) -> int:
    """After how many cycles of a loop, begun from a posture (n,), the largest drift is seen; at most MOST.

    One for an open path, and where no strategy drifts. A strategy that does not get round so often does not count.
    """
    largest = np.zeros(MOST)
    for strategy in strategies if loop.path.closed else ():
        if strategy.G is None or strategy.holonomic:
            continue
        with suppress(HolokinError):
            start = loop_start(strategy, loop, q0)
            drifts = drift(strategy.G, loop.path, start, samples=LOOK, cycles=MOST)
            largest = np.maximum(largest, drifts.largest)
    if not largest.max() > UNSEEN:
        return 1
    return int(np.argmax(largest >= VISIBLE)) + 1 if largest.max() >= VISIBLE else MOST


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
    starts = _start_postures(chosen) if q0 is None else robot.checked(q0, "the start posture")[None]
    if not len(starts):
        raise ArgumentError(f"the start of {robot.name!r}", None, "no posture within its limits was found: give one")
    starts = starts[: TRIED // chosen.frames]
    job_origin = None if origin is None or task is not None else Origin(origin, task_keys(chosen), FilePath.cwd())
    facts: dict[str, Any] = {"title": robot.name, "source": source, "origin": job_origin, "cycles": CYCLES}
    # The first circle that all strategies follow to the end.
    known: dict[int, tuple[NamedStrategy, ...]] = {}
    for i, loop in _loops(chosen, starts):
        strategies = known[i] = known.get(i) or default_strategies(chosen, starts[i])
        if all(_follows(strategy, loop, starts[i]) for strategy in strategies):
            return Session(strategies, starts[i], loop, **facts)
    return Session(default_strategies(chosen, starts[0]), starts[0], **facts)


def _task_of(robot: Robot) -> Task:
    """The task that leaves joints free: the poses of the hands of two arms, else as `fitting_task`."""
    arms = [{robot.joints[j].coordinate for j in joints_above(robot.joints, tip.joint)} for tip in robot.tips]
    apart = len(arms) == 2 and min(len(arms[0] - arms[1]), len(arms[1] - arms[0])) >= ARM
    if apart and robot.n > 12:
        return stacked(*(pose(robot, tip=tip.name) for tip in robot.tips))
    return fitting_task(robot)


def _start_postures(task: Task) -> Matrix:
    """Regular postures (k, n); of arms in space first those above the floor, the tool down in front of the base."""
    starts = regular_starts(task)
    if task.robot.planar or not len(starts):
        return starts
    candidates = starts[:AMONG]
    p, R = task._poses(candidates)
    front = (p[:, 0] > 0) & (R[:, 2, 2] < DOWN)
    above = np.array([min(points[:, 2].min() for points in task.robot.skeleton(q)) > -FLOOR for q in candidates])
    return np.vstack([candidates[front & above], candidates[front], candidates[above], starts])


def _loops(task: Task, starts: Matrix) -> Iterator[tuple[int, Loop]]:
    """Circles from the tool at start postures (k, n), each with the index of its start.

    Of each size, the largest first, in the order in which the pseudo-inverse drifts.
    """
    pinv = moore_penrose(task)
    far = float(np.linalg.norm(task._poses(starts)[0][:, :3], axis=1).max())
    normals = np.eye(3)[2:] if task.robot.planar else np.eye(3)[::-1]
    for share in SHARES:
        radius = float(f"{min(LARGEST, share * far):.1g}")
        candidates: list[tuple[float, int, Loop]] = []
        for i, normal in product(range(len(starts)), normals):
            tool = task.pose(starts[i]).reshape(-1, 4, 4)[0][:3, 3]
            # The centre lies in the plane: towards the base, up or down.
            inward = [-np.sign(tool[0] or 1.0) * np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2]]
            for direction in [d for d in inward if abs(float(d @ normal)) < 0.5][:2]:
                loop = entered(circle_loop(tool + radius * direction, radius, normal, near=tool), task, starts[i])
                with suppress(HolokinError):
                    size = float(drift(pinv, loop.path, starts[i], samples=LOOK).largest[0])
                    candidates.append((size, i, loop))
        candidates.sort(key=lambda candidate: -candidate[0])
        yield from ((i, loop) for _, i, loop in candidates)


def _follows(strategy: NamedStrategy, loop: Loop, q: Vector) -> bool:
    """Whether a strategy follows a cycle of a loop, or as many as one that drifts must last."""
    try:
        if strategy.G is not None:
            follow(strategy.G, loop.path, q, samples=TRY, cycles=1 if strategy.holonomic else LASTING)
    except HolokinError:
        return False
    return True
