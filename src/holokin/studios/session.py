"""`Session`: a robot, several laws, and one target or loop that all of them follow. The page of the studio draws it.

All that changes is in a `Session`, behind one lock; what it tells are frozen values. It knows nothing of browsers.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ArgumentError, HolokinError, OpenPathError, UnknownNameError
from ..motion.leaf import leaf_value
from ..robot import Robot
from ..strategies import HolonomicStrategy
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Array, ArrayLike, Vector, finite, frozen, not_negative, positive, tool_pose, whole
from .following import Follower, Move, follower
from .history import History
from .laws import Law
from .loops import Loop, reversed_loop
from .states import Judgement, LawState, LawStatus, Phase, Snapshot
from .walking import Walk, leaf_start, loop_start, target_at, walk

GATHER = 0.8
"""Seconds in which the joints go to where a loop begins."""


@dataclass(eq=False)
class _Run:
    """What a session knows of one law now."""

    law: Law
    q: Vector
    follow: Follower
    history: History
    status: LawStatus = LawStatus.FOLLOWING
    sentence: str = ""
    level: Vector = field(default_factory=lambda: np.zeros(0))
    begin: Vector | None = None  # of the loop
    walk: Walk | None = None
    whole: bool = True  # it has made every step of the loop
    drifts: list[Vector] = field(default_factory=list)
    judgement: Judgement | None = None

    def put(self, move: Move) -> None:
        """Where it stands from now on."""
        self.q, self.status, self.sentence = frozen(move.q), move.status, move.sentence


class Session:
    """Several laws of one robot on one tool target. Make one with `open_session`.

    Threads may share it: every method takes its lock, and `snapshot` gives a value that never changes.

    Attributes:
        title, source: for people; `source` is the job or robot that it was opened with.
        robot: whose joints they are. home: the posture (n,) at which all laws begin. limits: joint limits stop laws.
    """

    def __init__(
        self, laws: Iterable[Law], home: ArrayLike, loop: Loop | None = None, *, title: str = "", source: str = "",
        limits: bool = True, cycles: int | None = None,
    ) -> None:  # fmt: skip
        """A session of laws (of one robot) at a posture.

        Args:
            home: where all laws begin (n,). loop: as of `set_loop`. limits: False leaves joint limits aside.
            cycles: after which the loop ends, None for never.

        Raises:
            ArgumentError: no law, laws of several robots, or two of one name. HolokinError: a law is not defined at
                `home`, or it is beyond the limits.
        """
        given = tuple(laws)
        if not given:
            raise ArgumentError("the laws of a session", 0, "give at least one")
        self._lock = threading.RLock()
        self.task: Task = given[0].task
        self.robot: Robot = self.task.robot
        self.title, self.source, self.limits = title or self.task.name, source, limits
        self.home: Vector = frozen(self.robot.checked(home, "the start posture"))
        if limits:
            self.robot.check_limits(self.home)
        self._runs: dict[str, _Run] = {}
        self._number, self._known = 0, None
        self._phase, self._message = Phase.IDLE, ""
        self._factor, self._cycles, self._time, self._step, self._cycle = 1.0, cycles, 0.0, 0, 0
        self._gathered, self._ends = 0.0, np.zeros(1)
        self._loop: Loop | None = None
        self._loops = 0
        self._target: Array = frozen(self._home_target())
        for law in given:
            self.add_law(law)
        if loop is not None:
            self.set_loop(loop)

    # --- laws ------------------------------------------------------------------------------------------------

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws, in order."""
        with self._lock:
            return tuple(run.law for run in self._runs.values())

    def add_law(self, law: Law) -> Snapshot:
        """One more law; it begins at home, and the loop stops.

        Raises:
            ArgumentError: its name is taken, or its robot another one. HolokinError: it is not defined at home.
        """
        with self._lock:
            if law.name in self._runs:
                raise ArgumentError("the name of a law", law.name, "it is taken: give another one")
            if law.task.robot is not self.robot:
                raise ArgumentError("the robot of the law", law.task.robot.name, "take that of the session")
            self._stop()
            begin = leaf_start(law, self.home)
            if law.strategy is not None:
                law.strategy(begin)
            run = _Run(law, frozen(begin), follower(law, begin, self.limits), History(self.robot.n))
            run.level = _level(law, begin)
            self._runs[law.name] = run
            if not np.array_equal(self._target, self._home_target()):
                run.put(run.follow(run.q, self._target))
            return self._changed()

    def remove_law(self, name: str) -> Snapshot:
        """One law less. Raises: UnknownNameError; ArgumentError: it is the last one."""
        with self._lock:
            self._run(name)
            if len(self._runs) == 1:
                raise ArgumentError("the law to remove", name, "it is the last one: add another first")
            del self._runs[name]
            return self._changed()

    # --- the tool in the hand --------------------------------------------------------------------------------

    def drag(self, pose: ArrayLike) -> Snapshot:
        """All laws follow to a tool pose (4, 4), or (F, 4, 4) of a task of F frames; a running loop stops.

        Holonomic laws go where `InverseKinematics.near` leads, others by small velocity steps along the straight way. A
        law that cannot get there stays where it is, and its status and sentence say why; it goes on as soon as the
        target is within its reach again. Nothing is raised for such a pose.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: what is no pose.
        """
        frames = self.task.frames
        given = finite("a tool pose", pose)
        poses = given.reshape(frames, 4, 4) if given.size == 16 * frames else finite("a tool pose", given, (4, 4))
        for one in poses:
            tool_pose("a tool pose", one)
        with self._lock:
            self._stop()
            self._target, self._message = frozen(poses), ""
            for run in self._runs.values():
                run.put(run.follow(run.q, self._target))
            return self._changed()

    def reset(self) -> Snapshot:
        """All laws back at home, each on its leaf; the loop stops, and what was recorded is forgotten."""
        with self._lock:
            self._stop()
            self._target, self._message = frozen(self._home_target()), ""
            for run in self._runs.values():
                begin = leaf_start(run.law, self.home)
                run.put(Move(begin, LawStatus.FOLLOWING))
                self._forget(run)
            return self._changed()

    # --- the loop --------------------------------------------------------------------------------------------

    @property
    def loop(self) -> Loop | None:
        """The loop, or None."""
        with self._lock:
            return self._loop

    def set_loop(self, loop: Loop | None) -> Snapshot:
        """Another loop; one that runs stops. It may begin away from home: laws then enter it as a job's `entry` does."""
        with self._lock:
            self._stop()
            if loop is not None and loop.keys.get("entry") is None and self.task.frames == 1:
                tool, path = self.task.pose(self.home), loop.path
                R = tool[:3, :3] if getattr(path, "rotation", None) is None else path.rotation  # type: ignore[union-attr]
                if np.abs(self.task.error(self.home, path.start, R)).max() > TOLERANCES.start:
                    loop = replace(loop, keys={**loop.keys, "entry": "joints"})
            self._loop, self._message = loop, ""
            self._loops += 1
            for run in self._runs.values():
                self._forget(run)
            return self._changed()

    def play(self) -> Snapshot:
        """Begin the loop, or go on with it after `pause`.

        The joints first go to where each law begins it (`Phase.GATHERING`), in under a second. A law that does not get
        there, or stops on the way, says why, and the others go on.

        Raises:
            ArgumentError: there is no loop. OpenPathError: more than one cycle of an open path.
        """
        with self._lock:
            if self._phase is Phase.PAUSED:
                self._phase = Phase.RUNNING
                return self._changed()
            if self._phase in (Phase.RUNNING, Phase.GATHERING):
                return self.snapshot()
            if self._loop is None:
                raise ArgumentError("the loop", None, "set one first")
            if not self._loop.path.closed and self._cycles != 1:
                raise OpenPathError(f"{self._cycles or 'endless'} cycles", self._loop.path.gap)
            self._message, plans = "", []
            for run in self._runs.values():
                self._forget(run)
                try:
                    run.begin = frozen(loop_start(run.law, self._loop, self.home))
                    run.walk = walk(run.law, self._loop, run.begin, self.limits)
                    plans.append(run.walk.plan)
                except HolokinError as problem:
                    run.status, run.sentence, run.whole = LawStatus.STOPPED, str(problem), False
            if not plans:
                self._message = next(run.sentence for run in self._runs.values())
                return self._changed()
            self._ends = np.cumsum(plans[0].h)
            self._time, self._step, self._cycle, self._gathered = 0.0, 0, 0, 0.0
            self._aim(0)
            self._phase = Phase.GATHERING
            return self._changed()

    def pause(self) -> Snapshot:
        """Hold the loop where it is; `play` goes on."""
        with self._lock:
            if self._phase is Phase.RUNNING:
                self._phase = Phase.PAUSED
            return self._changed()

    def stop(self) -> Snapshot:
        """End the loop; the laws stay where they are, and what was recorded stays to be seen."""
        with self._lock:
            self._stop()
            return self._changed()

    def set_speed(self, factor: float) -> Snapshot:
        """How many times as fast as its own speed the loop runs. Raises: ArgumentError: not positive."""
        with self._lock:
            self._factor = positive("the speed factor", factor)
            return self._changed()

    def set_cycles(self, cycles: int | None) -> Snapshot:
        """After how many cycles the loop ends, None for never. Raises: ArgumentError."""
        with self._lock:
            self._cycles = None if cycles is None else whole("cycles", cycles)
            return self._changed()

    def set_clockwise(self, clockwise: bool) -> Snapshot:
        """Which way round the loop runs; it stops. Raises: ArgumentError: there is none, or it has one way only."""
        with self._lock:
            if self._loop is None:
                raise ArgumentError("the loop", None, "set one first")
            return self.snapshot() if self._loop.clockwise == clockwise else self.set_loop(reversed_loop(self._loop))

    def advance(self, dt: float) -> Snapshot:
        """All laws go on along the loop by a time [s], in whole steps of its `samples`; see `Loop`.

        These are the steps of `hk.follow`, so the drift of each cycle is that of `hk.drift` of the same law, path,
        posture and samples, to the last bit. Where nothing runs nothing happens. Raises: ArgumentError: a bad time.
        """
        not_negative("dt", dt)
        with self._lock:
            if self._phase is Phase.GATHERING:
                self._gather(dt)
            elif self._phase is Phase.RUNNING:
                self._go(dt * self._factor)
            else:
                return self.snapshot()
            return self._changed()

    # --- what a page draws -----------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """All that a page draws, as a value that never changes."""
        with self._lock:
            if self._known is None or self._known.number != self._number:
                steps = len(self._ends)
                self._known = Snapshot(
                    self._number, self._phase, tuple(_state(run) for run in self._runs.values()), self._target,
                    self._loops, self._step / steps if self._phase is not Phase.DONE else 1.0, self._cycle, self._time,
                    self._factor, self._cycles, self._loop is not None and self._loop.clockwise, self._message,
                )  # fmt: skip
            return self._known

    # --- within ----------------------------------------------------------------------------------------------

    def _changed(self) -> Snapshot:
        self._number += 1
        return self.snapshot()

    def _run(self, name: str) -> _Run:
        if name not in self._runs:
            raise UnknownNameError("law", name, list(self._runs))
        return self._runs[name]

    def _home_target(self) -> Array:
        return self.task.pose(self.home).reshape(-1, 4, 4)

    def _forget(self, run: _Run) -> None:
        run.begin, run.walk, run.whole, run.drifts = None, None, True, []
        run.history = History(self.robot.n)

    def _stop(self) -> None:
        if self._phase is not Phase.IDLE:
            self._phase = Phase.IDLE

    def _aim(self, step: int) -> None:
        plan = next(run.walk.plan for run in self._runs.values() if run.walk is not None)
        p, R = target_at(plan, step)
        poses = np.tile(np.eye(4), (plan.task.frames, 1, 1))
        poses[:, :3, 3], poses[:, :3, :3] = p.reshape(-1, 3), R.reshape(-1, 3, 3)
        self._target = frozen(poses)

    def _gather(self, dt: float) -> None:
        before, self._gathered = self._gathered, min(GATHER, self._gathered + dt)
        there = self._gathered >= GATHER
        share = 1.0 if there else (self._gathered - before) / (GATHER - before)
        for run in self._runs.values():
            if run.walk is not None and run.begin is not None:
                q = run.begin if there else run.q + share * (run.begin - run.q)
                run.put(Move(q, LawStatus.FOLLOWING))
                if there:
                    run.history.add(np.zeros(1), run.begin[None])
        if there:
            self._phase = Phase.RUNNING

    def _go(self, dt: float) -> None:
        steps, before = len(self._ends), self._time
        length = float(self._ends[-1])
        self._time = before + dt
        lap, rest = divmod(self._time, length)
        goal = int(lap) * steps + int(np.searchsorted(self._ends, rest + 1e-9 * length, side="right"))
        last = None if self._cycles is None else self._cycles * steps
        if last is not None and goal >= last:
            goal, self._time = last, self._cycles * length  # type: ignore[operator]
        done = self._cycle * steps + self._step
        while done < goal:
            first = done % steps
            until = min(steps, first + goal - done)
            for run in self._runs.values():
                if run.walk is not None:
                    self._steps(run, run.walk, first, until)
            done += until - first
            self._cycle, self._step = divmod(done, steps)
        self._aim(self._step if self._step or not self._cycle else steps)
        if last is not None and done >= last:
            self._phase = Phase.DONE

    def _steps(self, run: _Run, walked: Walk, first: int, until: int) -> None:
        """Steps of one law in one cycle, and its drift where the cycle ends."""
        if run.status is LawStatus.FOLLOWING:
            rows, (status, sentence) = walked.run(run.q, first, until)
            if len(rows):
                run.q = frozen(rows[-1])
                t = self._cycle * self._ends[-1] + self._ends[first : first + len(rows)]
                run.history.add(t, rows)
            run.status, run.sentence, run.whole = status, sentence, run.whole and status is LawStatus.FOLLOWING
        else:
            p, R = target_at(walked.plan, until)
            poses = np.tile(np.eye(4), (walked.plan.task.frames, 1, 1))
            poses[:, :3, 3], poses[:, :3, :3] = p.reshape(-1, 3), R.reshape(-1, 3, 3)
            run.put(run.follow(run.q, poses))
        if until == len(self._ends) and run.begin is not None:
            run.drifts.append(run.q - run.begin if run.whole else np.full(len(run.q), np.nan))


def _level(law: Law, q: Vector) -> Vector:
    return leaf_value(law.rule, q) if isinstance(law.rule, HolonomicStrategy) else np.zeros(0)


def _state(run: _Run) -> LawState:
    drifts = np.array(run.drifts).reshape(len(run.drifts), len(run.q))
    strategy = run.law.strategy
    rcond = np.nan if strategy is None else float(strategy.gain(run.q)[1])
    return LawState(
        run.law.name, run.law.colour, run.law.holonomic, run.q, run.status, run.sentence, rcond, run.level,
        np.abs(drifts).max(axis=1, initial=0.0) if len(drifts) else np.zeros(0), drifts, *run.history.view(),
        run.judgement,
    )  # fmt: skip
