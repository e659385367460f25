"""The loop of a session as it runs: its clock, and the steps that all laws make in a time."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import ArgumentError, HolokinError, UnknownNameError
from ...base.poses import PoseLike
from ...base.types import Array, ArrayLike, Vector, frozen, positive, whole
from ...robot import Robot, start_posture
from ...strategies.tasks.task import Task
from .followers import (
    Loop,
    Move,
    Run,
    Walk,
    leaf_start,
    level_slider_of,
    loop_start,
    move_across,
    new_run,
    poses_at,
    poses_of,
    slide,
    slider_of,
    walk,
)
from .laws import WIDTH, Law, Slider, TwoPaths, two_paths
from .states import LawStatus, Phase, Snapshot

# --------------------------------------------------------------------------------------------------
# `LawGroup`: several laws of one robot at one tool target: where each stands, and what moves it
# there.
# --------------------------------------------------------------------------------------------------


class LawGroup(ABC):
    """The part of a `Session` that knows of no loop: laws, the target of their tools, and sliders.

    Attributes:
        robot: whose joints they are. task: of the first law. home: the posture (n,) at which all laws begin.
        limits: whether joint limits stop laws.
    """

    def __init__(self, laws: Iterable[Law], home: ArrayLike, limits: bool) -> None:
        """Laws at a posture (n,); none of them is in the group yet: `add_law`. Raises: as `Session`."""
        given = tuple(laws)
        if not given:
            raise ArgumentError("the laws of a session", 0, "give at least one")
        self._lock = threading.RLock()
        self.task: Task = given[0].task
        self.robot: Robot = self.task.robot
        self.limits = limits
        self.home: Vector = frozen(start_posture(self.robot, home, limits))
        self._runs: dict[str, Run] = {}
        self._message = ""
        self._target: Array = frozen(self._home_target())

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """All that a page draws, as a value that never changes; the same one until something changes."""

    @abstractmethod
    def _changed(self) -> Snapshot:
        """Something changed: what there is now."""

    @abstractmethod
    def _halt(self) -> None:
        """No loop runs any more."""

    @abstractmethod
    def _native(self, run: Run) -> bool:
        """Whether a law may wait for its compiler."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws, in order."""
        with self._lock:
            return tuple(run.law for run in self._runs.values())

    def add_law(self, law: Law) -> Snapshot:
        """One more law, from home; the loop stops. Raises: ArgumentError: its name, its robot. HolokinError."""
        with self._lock:
            if law.name in self._runs:
                raise ArgumentError("the name of a law", law.name, "it is taken: give another one")
            if law.task.robot is not self.robot:
                raise ArgumentError("the robot of the law", law.task.robot.name, "take that of the session")
            self._halt()
            run = self._runs[law.name] = new_run(law, leaf_start(law, self.home), self.limits)
            if not np.array_equal(self._target, self._home_target()):
                run.put(run.follow(run.q, self._target, self._native(run)))
            return self._changed()

    def drag(self, pose: PoseLike) -> Snapshot:
        """All laws follow to a tool pose (4, 4), or (F, 4, 4) of a task of F frames; a running loop stops.

        Holonomic laws go where `InverseKinematics.near` leads, others by small velocity steps along the straight path.
        A law that cannot get there stays where it is, and its status and sentence say why; it goes on as soon as the
        target is within its reach again. Nothing is raised for such a pose.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: what is no pose.
        """
        poses = poses_of(self.task, pose)
        with self._lock:
            self._halt()
            self._target, self._message = frozen(poses), ""
            for run in self._runs.values():
                run.put(run.follow(run.q, self._target, self._native(run)))
            return self._changed()

    def reset(self) -> Snapshot:
        """All laws at their home again, each on its leaf; the loop stops, and what was recorded is forgotten."""
        with self._lock:
            self._halt()
            self._target, self._message = frozen(self._home_target()), ""
            for run in self._runs.values():
                try:
                    run.put(Move(leaf_start(run.law, self.home), LawStatus.FOLLOWING))
                except HolokinError as problem:
                    run.put(Move(run.q, LawStatus.STOPPED, f"Its leaf has no posture at home: {problem}."))
                run.forget()
            return self._changed()

    def two_paths(self, pose: PoseLike, *, width: float = WIDTH, samples: int = 200) -> TwoPaths:
        """Each law by two paths from its posture to a tool pose (4, 4), and how far its joints end apart.

        As `path_spread` along polylines with a corner `width` [m] to either side. The session does not change.

        Raises:
            ArgumentError, ShapeError, NotFiniteError: what is no pose; a task of several tools.
        """
        wanted = poses_of(self.task, pose)[0]
        with self._lock:
            runs = [(run.law, run.q, run.status) for run in self._runs.values()]
        return two_paths(runs, wanted, positive("width", width), whole("samples", samples), self.limits)

    def self_motion(self, name: str, direction: int = 0) -> Slider:
        """The slider of one law along its self-motion, from where it stands; see `move_self`.

        direction: which one, from 0 to n - m - 1, where several joints are to spare.

        Raises: UnknownNameError; ArgumentError: no such direction.
        """
        with self._lock:
            return slider_of(self._run(name), direction, self.limits)

    def move_self(self, name: str, s: float, direction: int = 0) -> Snapshot:
        """One law goes to the place s of its slider (arc length from where it stood when the slider was made).

        The tool stays where it is, to 1e-9. A holonomic law is then on another leaf, and keeps it. The loop stops.

        Raises:
            UnknownNameError; ArgumentError: the slider does not go so far. HolokinError: the law is not defined there.
        """
        with self._lock:
            run = self._run(name)
            slide(run, direction, s, self.limits)
            self._halt()
            return self._changed()

    def level_slider(self, name: str, row: int = 0) -> Slider:
        """The slider of a row of the level of a holonomic law, with the tool still; degrees for an angle of the arm.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves, or no such row.
        """
        with self._lock:
            return level_slider_of(self._run(name), row, self.limits)

    def move_level(self, name: str, value: float, row: int = 0) -> Snapshot:
        """One law goes to a value of its slider, in the slider's unit, through all between, and keeps that leaf.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves. SingularityError, BranchError, JointLimitError: the
                self-motion does not lead there; nothing changes then.
        """
        with self._lock:
            move_across(self._run(name), row, value, self.limits)
            self._halt()
            return self._changed()

    def _run(self, name: str) -> Run:
        if name not in self._runs:
            raise UnknownNameError("law", name, list(self._runs))
        return self._runs[name]

    def _home_target(self) -> Array:
        return self.task.pose(self.home).reshape(-1, 4, 4)


GATHER = 0.8
"""Seconds in which the joints go to where a loop begins."""

RETRY = 8
"""Frames after which a law that stopped tries to take part again."""


@dataclass(eq=False)
class Playing:
    """Where a loop is. `ends`: the time at the end of each step of a cycle [s]."""

    phase: Phase = Phase.IDLE
    factor: float = 1.0
    cycles: int | None = None
    time: float = 0.0
    step: int = 0
    cycle: int = 0
    frames: int = 0
    gathered: float = 0.0
    ends: Vector = field(default_factory=lambda: np.zeros(1))

    @property
    def progress(self) -> float:
        """Share of the cycle that is done."""
        return 1.0 if self.phase is Phase.DONE else self.step / len(self.ends)

    def stop(self) -> None:
        """The loop runs no more."""
        self.phase = Phase.IDLE


def begin(playing: Playing, runs: Iterable[Run], loop: Loop, home: Vector, limits: bool) -> str:
    """Get the laws ready for a loop. A law that cannot begin says why; the sentence of the first where none can."""
    plans, first = [], ""
    for run in runs:
        run.forget()
        try:
            start: Vector = frozen(loop_start(run.law, loop, home))
            run.q0, run.walk = start, walk(run.law, loop, start, limits)
            plans.append(run.walk.plan)
        except HolokinError as problem:
            run.status, run.sentence, run.whole = LawStatus.STOPPED, f"It cannot begin the loop: {problem}.", False
            first = first or run.sentence
    if not plans:
        return first
    playing.ends = np.cumsum(plans[0].h)
    playing.time, playing.step, playing.cycle, playing.gathered = 0.0, 0, 0, 0.0
    playing.phase = Phase.GATHERING
    return ""


def target_of(playing: Playing, runs: Iterable[Run]) -> Array | None:
    """Where the tools are wanted now (F, 4, 4); None where no law takes part."""
    plan = next((run.walk.plan for run in runs if run.walk is not None), None)
    if plan is None:
        return None
    return frozen(poses_at(plan, playing.step if playing.step or not playing.cycle else len(playing.ends)))


def gather(playing: Playing, runs: Iterable[Run], dt: float) -> None:
    """The joints go evenly to where each law begins the loop; then it runs."""
    before, playing.gathered = playing.gathered, min(GATHER, playing.gathered + dt)
    there = playing.gathered >= GATHER
    share = 1.0 if there else (playing.gathered - before) / (GATHER - before)
    for run in runs:
        if run.walk is not None and run.q0 is not None:
            run.put(Move(run.q0 if there else run.q + share * (run.q0 - run.q), LawStatus.FOLLOWING))
            if there:
                run.history.add(np.zeros(1), run.q0[None])
    if there:
        playing.phase = Phase.RUNNING


def go(playing: Playing, runs: Iterable[Run], dt: float, wait: bool) -> None:
    """All laws go on by a time of the loop [s], in whole steps; `wait`: as of a `Follower`, of laws not compiled."""
    steps, length = len(playing.ends), float(playing.ends[-1])
    playing.time += dt
    playing.frames += 1
    lap, rest = divmod(playing.time, length)
    goal = int(lap) * steps + int(np.searchsorted(playing.ends, rest + 1e-9 * length, side="right"))
    last = np.inf if playing.cycles is None else playing.cycles * steps
    if goal >= last:
        goal, playing.time = int(last), length * last / steps
    done = playing.cycle * steps + playing.step
    while done < goal:
        first = done % steps
        until = min(steps, first + goal - done)
        for run in runs:
            if run.walk is not None:
                _steps(playing, run, run.walk, (first, until), wait)
        done += until - first
        playing.cycle, playing.step = divmod(done, steps)
    if done >= last:
        playing.phase = Phase.DONE


def _steps(playing: Playing, run: Run, walked: Walk, steps: tuple[int, int], wait: bool) -> None:
    """Steps of one law in one cycle, and its drift where the cycle ends."""
    first, until = steps
    run.curves, run.levels, run.state = {}, {}, None
    if run.status is LawStatus.FOLLOWING:
        rows, (run.status, run.sentence) = walked.run(run.q, first, until)
        if len(rows):
            run.q = frozen(rows[-1])
            run.history.add(playing.cycle * playing.ends[-1] + playing.ends[first : first + len(rows)], rows)
        run.whole &= run.status is LawStatus.FOLLOWING
    elif playing.frames % RETRY == 0:
        run.put(run.follow(run.q, poses_at(walked.plan, until), wait or run.ready))
    if until == len(playing.ends) and run.q0 is not None:
        error = run.q - run.q0 if run.whole else np.full(len(run.q), np.nan)
        run.drifts = frozen(np.vstack([run.drifts, error]))
