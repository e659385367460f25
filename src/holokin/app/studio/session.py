"""`Session`: a robot, several strategies, and one target or loop that all of them follow, for the page to draw.

All that changes is in a `Session`, behind one lock; what it tells are frozen values. It knows nothing of browsers.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, TypeVar

import numpy as np

from ...base.errors import ArgumentError, HolokinError, OpenPathError, UnknownNameError
from ...base.poses import PoseLike
from ...base.types import Array, ArrayLike, Vector, frozen, not_negative, positive, whole
from ...motion import path_spread
from ...motion.drift_and_spread import Spread
from ...path import Path
from ...path.workspaces import Workspace
from ...robot import Robot, start_posture
from ...strategies.tasks.task import Task
from ..job.tables import MOST_STEPS
from ..job.templates import table, toml
from .followers import (
    Loop,
    Move,
    Run,
    compiled,
    entered,
    leaf_start,
    loop_fault,
    new_run,
    poses_of,
    put_on_leaf,
    reversed_loop,
    state_of,
)
from .loop import Playing, begin, gather, go, target_of
from .states import (
    Cloud,
    CloudStatus,
    LeafCusps,
    Origin,
    Phase,
    Snapshot,
    StrategyStatus,
    covered,
    default_workspace,
    failed_cloud,
    judged,
    largest_curvature,
    leaf_cusps,
)
from .strategies import (
    NamedStrategy,
    Slider,
    across,
    along,
    leaves_of,
    level_slider,
    paths_to,
    self_motion_curve,
    self_slider,
)
from .work import Search, SheetFollower, Worker, failure

SAMPLES = 512  # poses of a cloud
REST = 0.3  # seconds between two looks at the postures: no number on a page need change faster than one can read it

T = TypeVar("T")


class Session:
    """Several strategies of one robot on one tool target. Make one with `open_session`.

    Threads may share it: every method takes its lock, and `snapshot` gives a value that never changes. What changes
    something returns the new snapshot.

    Attributes:
        title, source: for people; `source` is the job or robot that it was opened with.
        robot: whose joints they are. task: of the first strategy. home: the posture (n,) at which all strategies begin.
        limits: whether joint limits stop strategies. origin: what a job says of robot and task, None where none can.
    """

    def __init__(
        self,
        strategies: Iterable[NamedStrategy],
        home: ArrayLike,
        loop: Loop | None = None,
        *,
        title: str = "",
        source: str = "",
        limits: bool = True,
        cycles: int | None = None,
        origin: Origin | None = None,
    ) -> None:
        """A session of strategies (of one robot) at a posture.

        Args:
            home: where all strategies begin (n,). loop, cycles: as of `set_loop`, `set_cycles`.

        Raises:
            ArgumentError: no strategy, strategies of several robots, or two of one name. HolokinError: a strategy is
                not defined at `home`, or it is beyond the limits.
        """
        given = tuple(strategies)
        if not given:
            raise ArgumentError("the strategies of a session", 0, "give at least one")
        self._lock = threading.RLock()
        self.task: Task = given[0].task
        self.robot: Robot = self.task.robot
        self.limits = limits
        self.home: Vector = frozen(start_posture(self.robot, home, limits))
        self._runs: dict[str, Run] = {}
        self._message = ""
        self._target: Array = frozen(self._home_target())
        self.title, self.source, self.origin = title or self.task.name, source, origin
        self._playing = Playing(cycles=cycles)
        self._loop: Loop | None = None
        self._loops, self._number = 0, 0
        self._fault, self._loop_fault = "", ""
        self._known: Snapshot | None = None
        self._cloud: Cloud | None = None
        self._cusps: LeafCusps | None = None
        self.sheets: SheetFollower | None = None
        self._looked = 0
        self._worker: Worker | None = None
        self._covering: Worker | None = None
        self._seeking: list[Worker] = []  # of which the last one is listened to; the others end soon
        for strategy in given:
            self.add_strategy(strategy)
        if loop is not None:
            self.set_loop(loop)

    @property
    def strategies(self) -> tuple[NamedStrategy, ...]:
        """The strategies, in order."""
        with self._lock:
            return tuple(run.strategy for run in self._runs.values())

    def add_strategy(self, strategy: NamedStrategy) -> Snapshot:
        """One more strategy, from home; the loop stops. Raises: ArgumentError: its name, its robot. HolokinError."""
        with self._lock:
            if strategy.name in self._runs:
                raise ArgumentError("the name of a strategy", strategy.name, "it is taken: give another one")
            if strategy.task.robot is not self.robot:
                raise ArgumentError("the robot of the strategy", strategy.task.robot.name, "take that of the session")
            self._playing.stop()
            run = self._runs[strategy.name] = new_run(strategy, leaf_start(strategy, self.home), self.limits)
            if not np.array_equal(self._target, self._home_target()):
                run.put(run.follow(run.q, self._target, self._native(run)))
            return self._changed()

    def drag(self, pose: PoseLike) -> Snapshot:
        """All strategies follow to a tool pose (4, 4), or (F, 4, 4) of a task of F frames; a running loop stops.

        Holonomic strategies go where `InverseKinematics.near` leads, others by small velocity steps along the straight
        path. A strategy that cannot get there stays where it is, and its status and sentence say why; it goes on as
        soon as the target is within its reach again. Nothing is raised for such a pose. Where no arm follows the sheets
        it is told which of them serves.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: what is no pose.
        """
        poses = poses_of(self.task, pose)
        with self._lock:
            self._playing.stop()
            self._target, self._message = frozen(poses), ""
            for run in self._runs.values():
                run.put(run.follow(run.q, self._target, self._native(run)))
            if self.sheets is not None:
                self.sheets.look(self._target)
            return self._changed()

    def reset(self) -> Snapshot:
        """All strategies at their home again, each on its leaf; the loop stops, and what was recorded is forgotten."""
        with self._lock:
            self._playing.stop()
            self._target, self._message = frozen(self._home_target()), ""
            for run in self._runs.values():
                try:
                    run.put(Move(leaf_start(run.strategy, self.home), StrategyStatus.FOLLOWING))
                except HolokinError as problem:
                    run.put(Move(run.q, StrategyStatus.STOPPED, f"Its leaf has no posture at home: {problem}."))
                run.forget()
            return self._changed()

    def two_paths(self, name: str, pose: PoseLike) -> tuple[Spread, tuple[Path, Path]]:
        """One strategy by two paths from its posture to a tool pose (4, 4), as `hk.motion.path_spread`, and the paths.

        They are polylines with a corner to either side; the session stays as it is.

        Raises:
            UnknownNameError; ArgumentError, ShapeError, NotFiniteError: what is no pose; a task of several tools, a
                control law. HolokinError: the strategy does not get there on both.
        """
        wanted = poses_of(self.task, pose)[0]
        with self._lock:
            strategy, q = self._run(name).strategy, self._run(name).q
        if strategy.G is None:
            raise ArgumentError("the strategy", name, "two paths are followed by strategies, not by control laws")
        paths = paths_to(strategy.task, q, wanted)
        return path_spread(strategy.G, *paths, q, samples=200, limits=self.limits), paths

    def self_motion(self, name: str) -> Slider:
        """The slider of one strategy along its self-motion, from where it stands; see `move_self`.

        Raises: UnknownNameError.
        """
        with self._lock:
            run = self._run(name)
            if run.curve is None:
                run.curve = self_motion_curve(run.strategy.task, run.q, self.limits), 0.0
            return self_slider(run.strategy, *run.curve)

    def move_self(self, name: str, s: float) -> Snapshot:
        """One strategy goes to the place s of its slider (arc length from where it stood when the slider was made).

        The tool stays where it is, to 1e-9. A holonomic strategy is then on another leaf, and keeps it. The loop stops.

        Raises:
            UnknownNameError; ArgumentError: the slider does not go so far. HolokinError: the strategy is not defined
                there.
        """
        with self._lock:
            self.self_motion(name)
            run = self._run(name)
            if run.curve is not None:
                curve = run.curve[0]
                put_on_leaf(run, along(curve, s), self.limits)
                run.curve = curve, s
            self._playing.stop()
            return self._changed()

    def level_slider(self, name: str) -> Slider:
        """The slider of the level of a holonomic strategy, the tool still; degrees for an angle of the arm.

        Raises:
            UnknownNameError; ArgumentError: a strategy without leaves.
        """
        with self._lock:
            run = self._run(name)
            if run.level_slider is None:  # angles count on through whole turns from here
                run.level_slider = level_slider(run.strategy, run.q, self.limits)
            return run.level_slider

    def move_level(self, name: str, value: float) -> Snapshot:
        """One strategy goes to a value of its slider, in the slider's unit, through all between, and keeps that leaf.

        Raises:
            UnknownNameError; ArgumentError: a strategy without leaves. SingularityError, BranchError, JointLimitError:
                the self-motion does not lead there; nothing changes then.
        """
        with self._lock:
            slider, run = self.level_slider(name), self._run(name)
            q = across(run.strategy, run.q, slider, value)
            if self.limits:
                self.robot.check_limits(q)
            put_on_leaf(run, q, self.limits)
            run.level_slider = replace(slider, value=value)
            self._playing.stop()
            return self._changed()

    def _run(self, name: str) -> Run:
        if name not in self._runs:
            raise UnknownNameError("strategy", name, list(self._runs))
        return self._runs[name]

    def _home_target(self) -> Array:
        return self.task.pose(self.home).reshape(-1, 4, 4)

    @property
    def loop(self) -> Loop | None:
        """The loop, or None."""
        with self._lock:
            return self._loop

    def set_loop(self, loop: Loop | None) -> Snapshot:
        """Another loop; one that runs stops. It may begin away from home: strategies enter it as a job's `entry` does.

        The message says what was left out of its path.
        """
        with self._lock:
            self._playing.stop()
            self._loop = None if loop is None else entered(loop, self.task, self.home)
            self._message = " ".join(f"{note}." for note in (loop.path.notes if loop else ()))
            self._loops += 1
            self._loop_fault = ""
            for run in self._runs.values():
                run.forget()
            return self._changed()

    def play(self) -> Snapshot:
        """Begin the loop, or go on with it after `pause`.

        The joints first go to where each strategy begins it (`Phase.GATHERING`), in under a second. A strategy that
        does not get there, or stops on the way, says why, and the others go on.

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
        """End the loop; the strategies stay where they are, and what was recorded stays to be seen."""
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
        """All strategies go on along the loop by a time [s], in whole steps of its `samples`; see `Loop`.

        These are the steps of `hk.follow`, so the drift of each cycle is that of `hk.drift` of the same strategy, path,
        posture and samples. Where nothing runs nothing happens. Raises: ArgumentError: a bad time.
        """
        not_negative("dt", dt)
        with self._lock:
            if self._playing.phase is Phase.GATHERING:
                gather(self._playing, self._runs.values(), dt)
            elif self._playing.phase is Phase.RUNNING:
                go(self._playing, self._runs.values(), dt * self._playing.factor, self._worker is None)
                self._aim()
            elif self.sheets is None or not self.sheets.advance(dt):
                return self.snapshot()
            return self._changed()

    def with_sheets(self, search: Search) -> Session:
        """The session with a map of sheets, which `find_sheets` makes or reads by this function."""
        self.sheets = SheetFollower(self._lock, self._runs, self._changed, self._tell_failure, search)
        return self

    def find_sheets(self) -> Snapshot:
        """Make the map of the session's sheets in a thread: `sheets.state`. Raises: ArgumentError: it has none."""
        with self._lock:
            self._mapped().find()
            return self._changed()

    def follow_sheets(self, name: str | None) -> Snapshot:
        """The arm of a strategy follows the sheets when the tool is dragged; of None every arm its own strategy.

        Raises:
            ArgumentError: the session has no sheets. UnknownNameError.
        """
        with self._lock:
            sheets, run = self._mapped(), None if name is None else self._run(name)
            self._playing.stop()
            if run is None:
                sheets.release(self.limits)
            else:
                sheets.take(run, self._target)
            return self._changed()

    def _mapped(self) -> SheetFollower:
        if self.sheets is None:
            raise ArgumentError("the sheets of the session", None, "open a job with a table [sheets]")
        return self.sheets

    def start_work(self) -> None:
        """Compile and judge the strategies in a thread, and keep the curvature at their postures.

        What is found is in `StrategyState.judgement`. Until a strategy is compiled it follows more slowly. Call
        `close` in the end.
        """
        with self._lock:
            if self._worker is None:
                self._worker = Worker(
                    "holokin-studio",
                    self._look_after,
                    lambda problem: self._tell_failure("The background work ended", problem),
                )

    def start_cloud(self, name: str, region: Workspace | None = None, *, samples: int = SAMPLES) -> Snapshot:
        """The coverage of a workspace by the leaf on which a holonomic strategy stands, in a thread: `Snapshot.cloud`.

        Args:
            region: by default a box about the tool at home, with the rotation that it has there.

        Raises:
            UnknownNameError; ArgumentError: a strategy without leaves, or a bad number of samples.
        """
        with self._lock:
            run = self._run(name)
            G, count = leaves_of(run.strategy), whole("samples", samples)
            space = default_workspace(run.strategy.task, self.home) if region is None else region
            q = leaf_start(run.strategy, self.home)
            self.cancel_cloud()

            def keep(cloud: Cloud) -> None:
                self._cloud = cloud

            def failed(problem: Exception) -> None:
                self._cloud = failed_cloud(name, failure("The coverage was not found", problem))

            clouds = covered(G, name, q, space, count, self.limits)
            self._covering = self._in_thread("holokin-studio-cloud", clouds, keep, failed)
            return self._changed()

    def cancel_cloud(self) -> Snapshot:
        """Look at no more poses, and wait for nothing; those that are known stay."""
        with self._lock:
            if self._covering is None:
                return self.snapshot()
            self._covering.cancel()
            self._covering = None
            if self._cloud is not None and self._cloud.status is CloudStatus.RUNNING:
                self._cloud = replace(self._cloud, status=CloudStatus.CANCELLED)
            return self._changed()

    def start_cusps(self, name: str) -> Snapshot:
        """Look for cusps of the leaf on which a holonomic strategy stands, in a thread: `Snapshot.cusps`.

        Raises:
            UnknownNameError; ArgumentError: a strategy without leaves.
        """
        with self._lock:
            run = self._run(name)
            G, q = leaves_of(run.strategy), run.q
            self.cancel_cusps()
            self._cusps = LeafCusps(name, run.level, True, f"{name}: cusps are looked for.", None, np.zeros((0, 3)))

            def keep(cusps: LeafCusps | None) -> None:
                self._cusps = cusps

            def failed(problem: Exception) -> None:
                keep(None)
                self._tell_failure("The cusps were not found", problem)

            search = (leaf_cusps(name, G, q) for _ in range(1))  # in the thread
            self._seeking.append(self._in_thread("holokin-studio-cusps", search, keep, failed))
            return self._changed()

    def cancel_cusps(self) -> Snapshot:
        """Forget the cusps; where they are still looked for, what is found is dropped."""
        with self._lock:
            for worker in self._seeking:
                worker.cancel()
            self._seeking, self._cusps = [worker for worker in self._seeking if worker.alive], None
            return self._changed()

    def _in_thread(
        self, title: str, results: Iterator[T], keep: Callable[[T], None], failed: Callable[[Exception], None]
    ) -> Worker:
        """Results are found in a thread and kept under the lock, one after the other, until the worker is cancelled."""

        def work(closed: threading.Event) -> None:
            for result in results:
                with self._lock:
                    if closed.is_set():
                        return
                    keep(result)
                    self._changed()

        def lost(problem: Exception) -> None:
            with self._lock:
                failed(problem)
                self._changed()

        return Worker(title, work, lost)

    def close(self) -> None:
        """End all threads of the session."""
        if self.sheets is not None:
            self.sheets.close()
        for worker in (self._worker, self._covering, *self._seeking):
            if worker is not None:
                worker.close()
        self._worker, self._covering, self._seeking = None, None, []

    def snapshot(self) -> Snapshot:
        """All that a page draws, as a value that never changes; the same one until something changes."""
        with self._lock:
            if self._known is None or self._known.number != self._number:
                self._known = Snapshot(
                    number=self._number,
                    phase=self._playing.phase,
                    strategies=tuple(map(state_of, self._runs.values())),
                    target=self._target,
                    loop=self._loops,
                    progress=self._playing.progress,
                    cycle=self._playing.cycle,
                    cycles=self._playing.cycles,
                    clockwise=self._loop is not None and self._loop.clockwise,
                    message=self._message,
                    cloud=self._cloud,
                    cusps=self._cusps,
                    loop_fault=self._loop_fault,
                    fault=self._fault,
                )
            return self._known

    def _changed(self) -> Snapshot:
        self._number += 1
        return self.snapshot()

    def _tell_failure(self, what: str, problem: Exception) -> None:
        """Something was not done by a thread, and why."""
        with self._lock:
            self._fault = failure(what, problem)
            self._changed()

    def _look_after(self, closed: threading.Event) -> None:
        """Compile the strategies, judge them, and keep the curvature at their postures, until the session is closed.

        Between these each new loop is tried: which strategy does not get round it? A thread reads what it needs under
        the lock, works without it, and tells under it again.
        """
        while not closed.is_set():
            with self._lock:
                loop = None if self._looked == self._loops else self._loop
                number, runs = self._loops, list(self._runs.values())
                waiting = [run for run in runs if not run.ready or run.due]
                run = min(waiting, key=lambda run: (run.ready, run.judgement is not None), default=None)
                q = self.home if run is None else run.q
            if loop is not None:
                self._try_loop(number, loop, runs)
            elif run is None:
                closed.wait(REST)
            else:
                again = run.judgement is not None
                self._look_at(run, q)
                if again:  # while strategies move there is always one that is due: leave time for what draws them
                    closed.wait(REST / len(runs))

    def _try_loop(self, number: int, loop: Loop, runs: list[Run]) -> None:
        """Tell of the first strategy that does not get round the loop of a number; another may be there by now."""
        try:
            faults = (loop_fault(run.strategy, loop, self.home, self.limits) for run in runs)
            fault = next(filter(None, faults), "")
        except Exception as problem:  # noqa: BLE001  its thread goes on
            fault = failure("The loop could not be tried", problem)
        with self._lock:
            if number == self._loops:
                self._looked, self._loop_fault = number, fault
            self._changed()

    def _look_at(self, run: Run, q: Vector) -> None:
        """Compile a strategy, or judge it at a posture (n,): all are compiled first, the loop is smooth then."""
        G, judgement = run.strategy.G, run.judgement
        if not run.ready:
            try:
                compiled(run.strategy, self.home)
            except Exception as problem:  # noqa: BLE001  its thread goes on, with the other strategies
                self._tell_failure(f"{run.strategy.name} could not be compiled, and follows more slowly", problem)
        elif G is not None and judgement is None:
            judgement = judged(G, self.home, q)
        elif G is not None and judgement is not None:
            judgement = replace(judgement, curvature=largest_curvature(G, q), q=q)
        with self._lock:
            if judgement is not run.judgement:
                run.judgement, run.state = judgement, None
            run.ready = True
            self._changed()

    def _needed(self) -> Loop:
        if self._loop is None:
            raise ArgumentError("the loop", None, "set one first")
        return self._loop

    def _native(self, run: Run) -> bool:
        """Whether a strategy may wait for its compiler: not while the worker is about to do it."""
        return run.ready or self._worker is None

    def _aim(self) -> None:
        target = target_of(self._playing, self._runs.values())
        self._target = self._target if target is None else target


def to_job(session: Session, title: str | None = None) -> str:
    """The TOML text of a job: the robot, task, home, loop and strategies of a session, on their leaves.

    `holokin run` of it follows the same steps from the same postures, so its drifts are those that the session shows.
    What no job can say, such as control laws of your own, is left out and named in a comment.

    Files of the robot and the path are named by their full names.

    Raises:
        ArgumentError: no loop is set; no strategy that a job can say; or the robot was made in Python, so that no file
            or name of the catalogue tells it.
    """
    loop, origin = session.loop, session.origin
    in_job = [strategy for strategy in session.strategies if strategy.keys is not None]
    if loop is None:
        raise ArgumentError("the loop", None, "set one first: a job has a path")
    if origin is None:
        cure = "a job names a robot of the catalogue or a file: open the session with that name"
        raise ArgumentError("the robot of the session", session.robot.name, cure)
    if not in_job:
        raise ArgumentError("the strategies that a job can say", 0, "add one of the kinds that jobs have")
    # The path, with as many cycles as are asked for, or were done.
    path = {**loop.keys, "samples": loop.samples}
    if loop.path.closed:
        snapshot = session.snapshot()
        cycles = snapshot.cycles or max(1, snapshot.cycle)
        path["cycles"] = max(1, min(cycles, MOST_STEPS // loop.samples))
    # Its tables; a strategy that is run for several tasks stands once.
    lines = [f"title = {toml(title or session.title)}\n"]
    left_out = [strategy.name for strategy in session.strategies if strategy.keys is None]
    lines += [f"# {name} is a control law of your own: a job cannot say it." for name in left_out]
    lines.append(_toml_table("robot", _with_full_names(origin.robot, origin.folder)))
    lines.append(_toml_table("task", origin.task))
    lines.append(f"# {', '.join(session.robot.joint_names)}\n{_toml_table('start', {'q': session.home.tolist()})}")
    lines.append(_toml_table("path", _with_full_names(path, origin.folder)))
    labelled: dict[str, NamedStrategy] = {}
    for strategy in in_job:
        labelled.setdefault(strategy.label or strategy.name, strategy)
    for label, strategy in labelled.items():
        keys = dict(strategy.keys or {})
        if strategy.level is not None and strategy.holonomic:
            keys["level"] = (
                float(strategy.level[0]) if len(strategy.level) == 1 else np.asarray(strategy.level).tolist()
            )
        lines.append(_toml_table(f"strategies.{toml(label)}", keys))
    return "\n".join(lines)


def _toml_table(name: str, keys: Mapping[str, Any]) -> str:
    return table(name, {key: value for key, value in keys.items() if value is not None})


def _with_full_names(keys: Mapping[str, Any], source: FilePath) -> dict[str, Any]:
    """The keys with the full names of files, which `name` and `file` may hold."""
    placed: dict[str, Any] = {}
    for key, value in keys.items():
        if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
            value = [_with_full_names(entry, source) for entry in value]
        elif key in ("name", "file") and isinstance(value, str) and FilePath(value).suffix:
            value = FilePath(os.path.normpath(source / value)).as_posix()
        placed[key] = value
    return placed
