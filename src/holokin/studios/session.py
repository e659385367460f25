"""`Session`: a robot, several laws, and one target or loop that all of them follow. The page of the studio draws it.

All that changes is in a `Session`, behind one lock; what it tells are frozen values. It knows nothing of browsers.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..errors import ArgumentError, HolokinError, OpenPathError, UnknownNameError
from ..motion import move_to_leaf
from ..robot import Robot
from ..task import Task
from ..types import Array, ArrayLike, Vector, finite, frozen, not_negative, positive, whole
from ..workspaces import Workspace
from .clouds import default_workspace
from .following import Move, poses_of
from .laws import Law, rebuilt
from .loops import Loop, entered, reversed_loop
from .playing import Playing, begin, gather, go, target_of
from .runs import Run, level_slider_of, move_across, new_run, put_on_leaf, slide, slider_of, state_of
from .sliders import Slider, leaves_of
from .spreading import WIDTH, TwoWays, two_ways
from .states import Cloud, LawStatus, Origin, Phase, Snapshot
from .walking import leaf_start
from .working import Shared, Worker, cover, look_after

SAMPLES = 512
"""Poses of a cloud."""


class Session:
    """Several laws of one robot on one tool target. Make one with `open_session`.

    Threads may share it: every method takes its lock, and `snapshot` gives a value that never changes. What changes
    something returns the new snapshot.

    Attributes:
        title, source: for people; `source` is the job or robot that it was opened with.
        robot: whose joints they are. task: of the first law. home: the posture (n,) at which all laws begin.
        limits: whether joint limits stop laws. origin: what a job says of robot and task, None where none can.
    """

    def __init__(
        self, laws: Iterable[Law], home: ArrayLike, loop: Loop | None = None, *, title: str = "", source: str = "",
        limits: bool = True, cycles: int | None = None, origin: Origin | None = None,
    ) -> None:  # fmt: skip
        """A session of laws (of one robot) at a posture.

        Args:
            home: where all laws begin (n,). loop, cycles: as of `set_loop`, `set_cycles`.

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
        self.title, self.source, self.limits, self.origin = title or self.task.name, source, limits, origin
        self.home: Vector = frozen(self.robot.checked(home, "the start posture"))
        if limits:
            self.robot.check_limits(self.home)
        self._runs: dict[str, Run] = {}
        self._playing = Playing(cycles=cycles)
        self._loop: Loop | None = None
        self._loops, self._number, self._message = 0, 0, ""
        self._known: Snapshot | None = None
        self._cloud: Cloud | None = None
        self._shared = Shared(self._lock, lambda: list(self._runs.values()), lambda: self.home, self._changed)
        self._worker: Worker | None = None
        self._covering: Worker | None = None
        self._target: Array = frozen(self._home_target())
        for law in given:
            self.add_law(law)
        if loop is not None:
            self.set_loop(loop)

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
            self._playing.stop()
            run = self._runs[law.name] = new_run(law, leaf_start(law, self.home), self.limits)
            if not np.array_equal(self._target, self._home_target()):
                run.put(run.follow(run.q, self._target, self._native(run)))
            return self._changed()

    def remove_law(self, name: str) -> Snapshot:
        """One law less. Raises: UnknownNameError; ArgumentError: it is the last one."""
        with self._lock:
            self._run(name)
            if len(self._runs) == 1:
                raise ArgumentError("the law to remove", name, "it is the last one: add another first")
            del self._runs[name]
            return self._changed()

    def drag(self, pose: ArrayLike) -> Snapshot:
        """All laws follow to a tool pose (4, 4), or (F, 4, 4) of a task of F frames; a running loop stops.

        Holonomic laws go where `InverseKinematics.near` leads, others by small velocity steps along the straight way. A
        law that cannot get there stays where it is, and its status and sentence say why; it goes on as soon as the
        target is within its reach again. Nothing is raised for such a pose.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: what is no pose.
        """
        poses = poses_of(self.task, pose)
        with self._lock:
            self._playing.stop()
            self._target, self._message = frozen(poses), ""
            for run in self._runs.values():
                run.put(run.follow(run.q, self._target, self._native(run)))
            return self._changed()

    def reset(self) -> Snapshot:
        """All laws at their home again, each on its leaf; the loop stops, and what was recorded is forgotten."""
        with self._lock:
            self._playing.stop()
            self._target, self._message = frozen(self._home_target()), ""
            for run in self._runs.values():
                try:
                    run.put(Move(leaf_start(run.law, self.home), LawStatus.FOLLOWING))
                except HolokinError as problem:
                    run.put(Move(run.q, LawStatus.STOPPED, f"Its leaf has no posture at home: {problem}."))
                run.forget()
            return self._changed()

    def set_home(self, q: ArrayLike) -> Snapshot:
        """Another posture (n,) at which all laws begin; all go there, on their leaves through it.

        Laws made about the start, radial and fitted ones, are made anew.

        Raises:
            JointLimitError: it is beyond the limits. HolokinError: a law is not defined there; nothing changes then.
            ArgumentError: a task whose angles count from the start.
        """
        home = frozen(self.robot.checked(q, "the start posture"))
        if self.limits:
            self.robot.check_limits(home)
        if self.origin is not None and "rotation-vector" in str(self.origin.task.get("orientation", "")):
            raise ArgumentError("the start posture", home.tolist(), "the task's angles count from it: write a new job")
        with self._lock:
            laws = [replace(rebuilt(law, self.laws, home), level=None) for law in self.laws]
            self._runs = {law.name: new_run(law, home, self.limits) for law in laws}
            self.home, self._message = home, ""
            self._target = frozen(self._home_target())
            self.set_loop(self._loop)
            return self._changed()

    @property
    def loop(self) -> Loop | None:
        """The loop, or None."""
        with self._lock:
            return self._loop

    def set_loop(self, loop: Loop | None) -> Snapshot:
        """Another loop; one that runs stops. It may begin away from home: laws enter it as a job's `entry` does."""
        with self._lock:
            self._playing.stop()
            self._loop, self._message = None if loop is None else entered(loop, self.task, self.home), ""
            self._loops += 1
            for run in self._runs.values():
                run.forget()
            return self._changed()

    def play(self) -> Snapshot:
        """Begin the loop, or go on with it after `pause`.

        The joints first go to where each law begins it (`Phase.GATHERING`), in under a second. A law that does not get
        there, or stops on the way, says why, and the others go on.

        Raises:
            ArgumentError: there is no loop. OpenPathError: more than one cycle of an open path.
        """
        with self._lock:
            playing = self._playing
            if playing.phase is Phase.PAUSED:
                playing.phase = Phase.RUNNING
            elif playing.phase in (Phase.IDLE, Phase.DONE):
                loop = self._needed()
                if not loop.path.closed and playing.cycles != 1:
                    raise OpenPathError(f"{playing.cycles or 'endless'} cycles", loop.path.gap)
                self._message = begin(playing, self._runs.values(), loop, self.home, self.limits)
                self._aim()
            return self._changed()

    def pause(self) -> Snapshot:
        """Hold the loop where it is; `play` goes on."""
        with self._lock:
            if self._playing.phase is Phase.RUNNING:
                self._playing.phase = Phase.PAUSED
            return self._changed()

    def stop(self) -> Snapshot:
        """End the loop; the laws stay where they are, and what was recorded stays to be seen."""
        with self._lock:
            self._playing.stop()
            return self._changed()

    def set_speed(self, factor: float) -> Snapshot:
        """How many times as fast as its own speed the loop runs. Raises: ArgumentError: not positive."""
        with self._lock:
            self._playing.factor = positive("the speed factor", factor)
            return self._changed()

    def set_cycles(self, cycles: int | None) -> Snapshot:
        """After how many cycles the loop ends, None for never. Raises: ArgumentError."""
        with self._lock:
            self._playing.cycles = None if cycles is None else whole("cycles", cycles)
            return self._changed()

    def set_clockwise(self, clockwise: bool) -> Snapshot:
        """Which way round the loop runs; it stops. Raises: ArgumentError: there is none, or it has one way only."""
        with self._lock:
            loop = self._needed()
            return self.snapshot() if loop.clockwise == clockwise else self.set_loop(reversed_loop(loop))

    def advance(self, dt: float) -> Snapshot:
        """All laws go on along the loop by a time [s], in whole steps of its `samples`; see `Loop`.

        These are the steps of `hk.follow`, so the drift of each cycle is that of `hk.drift` of the same law, path,
        posture and samples. Where nothing runs nothing happens. Raises: ArgumentError: a bad time.
        """
        not_negative("dt", dt)
        with self._lock:
            if self._playing.phase is Phase.GATHERING:
                gather(self._playing, self._runs.values(), dt)
            elif self._playing.phase is Phase.RUNNING:
                go(self._playing, self._runs.values(), dt * self._playing.factor, self._worker is None)
                self._aim()
            else:
                return self.snapshot()
            return self._changed()

    def two_ways(self, pose: ArrayLike, *, width: float = WIDTH, samples: int = 200) -> TwoWays:
        """Each law by two ways from its posture to a tool pose (4, 4), and how far its joints end apart.

        As `hk.path_spread` along polylines with a corner `width` [m] to either side. The session does not change.

        Raises:
            ArgumentError, ShapeError, NotFiniteError: what is no pose; a task of several tools.
        """
        wanted = poses_of(self.task, pose)[0]
        with self._lock:
            runs = [(run.law, run.q, run.status) for run in self._runs.values()]
        return two_ways(runs, wanted, positive("width", width), whole("samples", samples), self.limits)

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
            self._playing.stop()
            return self._changed()

    def level_slider(self, name: str, row: int = 0) -> Slider:
        """The slider of a row of the level of a holonomic law, with the tool still; degrees for an angle of the arm.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves, or no such row.
        """
        with self._lock:
            return level_slider_of(self._run(name), row, self.limits)

    def move_level(self, name: str, value: float, row: int = 0) -> Snapshot:
        """One law goes to a value of its slider, in the slider's unit, through all between. As `set_level`."""
        with self._lock:
            move_across(self._run(name), row, value, self.limits)
            self._playing.stop()
            return self._changed()

    def set_level(self, name: str, level: ArrayLike) -> Snapshot:
        """One holonomic law goes to another leaf g(q) = level (r,), the tool still, and keeps it. The loop stops.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves. SingularityError, BranchError, JointLimitError: the
                self-motion does not lead there; nothing changes then. ShapeError, NotFiniteError.
        """
        with self._lock:
            run = self._run(name)
            q = move_to_leaf(leaves_of(run.law), run.q, np.atleast_1d(finite("level", level)))
            if self.limits:
                self.robot.check_limits(q)
            put_on_leaf(run, q, self.limits)
            self._playing.stop()
            return self._changed()

    def start_work(self) -> None:
        """Compile and judge the laws in a thread, and keep the curvature at their postures: `LawState.judgement`.

        Until a law is compiled it follows more slowly. Call `close` in the end.
        """
        with self._lock:
            if self._worker is None:
                self._worker = look_after(self._shared)

    def start_cloud(self, name: str, region: Workspace | None = None, *, samples: int = SAMPLES) -> Snapshot:
        """The coverage of a workspace by the leaf on which a holonomic law stands, in a thread: `Snapshot.cloud`.

        Args:
            region: by default a box about the tool at home, with the rotation that it has there.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves, or a bad number of samples.
        """
        self.cancel_cloud()
        with self._lock:
            run = self._run(name)
            strategy, count = leaves_of(run.law), whole("samples", samples)
            where = default_workspace(run.law.task, self.home) if region is None else region
            q = leaf_start(run.law, self.home)
            self._covering = cover(self._shared, name, strategy, q, where, count, self.limits, self._keep)
            return self._changed()

    def cancel_cloud(self) -> Snapshot:
        """Look at no more poses; those that are known stay."""
        if self._covering is not None:
            self._covering.close()
        return self.snapshot()

    def close(self) -> None:
        """End all threads of the session."""
        for worker in (self._worker, self._covering):
            if worker is not None:
                worker.close()
        self._worker = self._covering = None

    def snapshot(self) -> Snapshot:
        """All that a page draws, as a value that never changes; the same one until something changes."""
        with self._lock:
            if self._known is None or self._known.number != self._number:
                playing, loop = self._playing, self._loop
                states, way = tuple(map(state_of, self._runs.values())), loop is not None and loop.clockwise
                self._known = Snapshot(
                    self._number, playing.phase, states, self._target, self._loops, playing.progress, playing.cycle,
                    playing.time, playing.factor, playing.cycles, way, self._message, self._cloud,
                )  # fmt: skip
            return self._known

    def _changed(self) -> Snapshot:
        self._number += 1
        return self.snapshot()

    def _keep(self, cloud: Cloud) -> None:
        self._cloud = cloud

    def _needed(self) -> Loop:
        if self._loop is None:
            raise ArgumentError("the loop", None, "set one first")
        return self._loop

    def _run(self, name: str) -> Run:
        if name not in self._runs:
            raise UnknownNameError("law", name, list(self._runs))
        return self._runs[name]

    def _native(self, run: Run) -> bool:
        """Whether a law may wait for its compiler: not while the worker is about to do it."""
        return run.ready or self._worker is None

    def _home_target(self) -> Array:
        return self.task.pose(self.home).reshape(-1, 4, 4)

    def _aim(self) -> None:
        target = target_of(self._playing, self._runs.values())
        self._target = self._target if target is None else target
