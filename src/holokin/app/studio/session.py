"""`Session`: a robot, several laws, and one target or loop that all of them follow. The page of the studio draws it.

All that changes is in a `Session`, behind one lock; what it tells are frozen values. It knows nothing of browsers.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, OpenPathError
from ...base.poses import PoseLike
from ...base.types import ArrayLike, not_negative, positive, whole
from ...path.workspaces import Workspace
from ...strategies import HolonomicStrategy
from ..job.tables import MOST_STEPS
from ..job.templates import table, toml
from .followers import Loop, Run, entered, leaf_start, reversed_loop, state_of
from .laws import Law, leaves_of
from .loop import LawGroup, Playing, begin, gather, go, target_of
from .states import Cloud, CloudStatus, LeafCusps, Origin, Phase, Snapshot, default_workspace
from .work import Search, Shared, SheetFollower, Worker, cover, look_after, look_for_cusps

SAMPLES = 512
"""Poses of a cloud."""


class Session(LawGroup):
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
        super().__init__(given, home, limits)
        self.title, self.source, self.origin = title or self.task.name, source, origin
        self._playing = Playing(cycles=cycles)
        self._loop: Loop | None = None
        self._loops, self._number = 0, 0
        self._fault, self._loop_fault = "", ""
        self._known: Snapshot | None = None
        self._cloud: Cloud | None = None
        self._cusps: LeafCusps | None = None
        self._shared = Shared(
            self._lock, lambda: list(self._runs.values()), lambda: self.home, self._changed, self._failed,
            self._unseen_loop, self._looked_at, limits,
        )  # fmt: skip
        self.sheets: SheetFollower | None = None
        self._looked = 0
        self._worker: Worker | None = None
        self._covering: Worker | None = None
        self._seeking: list[Worker] = []  # of which the last one is listened to; the others end soon
        for law in given:
            self.add_law(law)
        if loop is not None:
            self.set_loop(loop)

    @property
    def loop(self) -> Loop | None:
        """The loop, or None."""
        with self._lock:
            return self._loop

    def set_loop(self, loop: Loop | None) -> Snapshot:
        """Another loop; one that runs stops. It may begin away from home: laws enter it as a job's `entry` does.

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
            elif self.sheets is None or not self.sheets.advance(dt):
                return self.snapshot()
            return self._changed()

    def with_sheets(self, search: Search) -> Session:
        """The session with a map of sheets, which `find_sheets` makes or reads by this function."""
        self.sheets = SheetFollower(self._shared, search)
        return self

    def find_sheets(self) -> Snapshot:
        """Make the map of the session's sheets in a thread: `sheets.state`. Raises: ArgumentError: it has none."""
        with self._lock:
            self._mapped().find()
            return self._changed()

    def follow_sheets(self, name: str | None) -> Snapshot:
        """The arm of a law takes the joints of the sheets when the tool is dragged; of None every arm those of its law.

        Raises:
            ArgumentError: the session has no sheets. UnknownNameError.
        """
        with self._lock:
            sheets, run = self._mapped(), None if name is None else self._run(name)
            self._halt()
            if run is None:
                sheets.release(self.limits)
            else:
                sheets.take(run, self._target)
            return self._changed()

    def _mapped(self) -> SheetFollower:
        if self.sheets is None:
            raise ArgumentError("the sheets of the session", None, "open a job with a table [sheets]")
        return self.sheets

    def drag(self, pose: PoseLike) -> Snapshot:
        """As `LawGroup.drag`; where no arm follows the sheets it is told which of them serves."""
        with self._lock:
            snap = super().drag(pose)
            if self.sheets is not None:
                self.sheets.look(self._target)
                snap = self._changed()
            return snap

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
        with self._lock:
            run = self._run(name)
            strategy, count = leaves_of(run.law), whole("samples", samples)
            where = default_workspace(run.law.task, self.home) if region is None else region
            q = leaf_start(run.law, self.home)
            self.cancel_cloud()
            self._covering = cover(self._shared, name, strategy, q, where, count, self.limits, self._keep)
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
        """Look for cusps of the leaf on which a holonomic law stands, in a thread: `Snapshot.cusps`.

        Raises:
            UnknownNameError; ArgumentError: a law without leaves.
        """
        with self._lock:
            run = self._run(name)
            strategy = leaves_of(run.law)
            self.cancel_cusps()
            self._cusps = LeafCusps(name, run.level, True, f"{name}: cusps are looked for.", None, np.zeros((0, 3)))
            self._seeking.append(look_for_cusps(self._shared, name, strategy, run.q, self._keep_cusps))
            return self._changed()

    def cancel_cusps(self) -> Snapshot:
        """Forget the cusps; where they are still looked for, what is found is dropped."""
        with self._lock:
            for worker in self._seeking:
                worker.cancel()
            self._seeking, self._cusps = [worker for worker in self._seeking if worker.alive], None
            return self._changed()

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
                playing, loop = self._playing, self._loop
                states, way = tuple(map(state_of, self._runs.values())), loop is not None and loop.clockwise
                self._known = Snapshot(
                    self._number, playing.phase, states, self._target, self._loops, playing.progress, playing.cycle,
                    playing.time, playing.factor, playing.cycles, way, self._message, self._cloud, self._cusps,
                    self._loop_fault, self._fault,
                )  # fmt: skip
            return self._known

    def _changed(self) -> Snapshot:
        self._number += 1
        return self.snapshot()

    def _halt(self) -> None:
        self._playing.stop()

    def _keep(self, cloud: Cloud) -> None:
        self._cloud = cloud

    def _keep_cusps(self, found: LeafCusps | None) -> None:
        self._cusps = found

    def _failed(self, sentence: str) -> None:
        self._fault = sentence

    def _unseen_loop(self) -> tuple[int, Loop] | None:
        """The loop, and its number, that nobody has looked at yet."""
        return None if self._loop is None or self._looked == self._loops else (self._loops, self._loop)

    def _looked_at(self, number: int, sentence: str) -> None:
        """What was found on the loop of a number; another loop may be there by now."""
        if number == self._loops:
            self._looked, self._loop_fault = number, sentence

    def _needed(self) -> Loop:
        if self._loop is None:
            raise ArgumentError("the loop", None, "set one first")
        return self._loop

    def _native(self, run: Run) -> bool:
        """Whether a law may wait for its compiler: not while the worker is about to do it."""
        return run.ready or self._worker is None

    def _aim(self) -> None:
        target = target_of(self._playing, self._runs.values())
        self._target = self._target if target is None else target


FILES = ("name", "file")
"""Keys of a job that may hold the name of a file."""


def to_job(session: Session, title: str | None = None) -> str:
    """The TOML text of a job: the robot, task, home, loop and laws of a session, on their leaves.

    `holokin run` of it follows the same steps from the same postures, so its drifts are those that the session shows.
    Laws that no job can say, such as control laws of your own, are left out and named in a comment.

    Files of the robot and the path are named by their full names.

    Raises:
        ArgumentError: no loop is set; no law that a job can say; or the robot was made in Python, so that no file or
            name of the catalogue tells it.
    """
    loop, laws, home = session.loop, session.laws, session.home
    if loop is None:
        raise ArgumentError("the loop", None, "set one first: a job has a path")
    if session.origin is None:
        cure = "a job names a robot of the catalogue or a file: open the session with that name"
        raise ArgumentError("the robot of the session", session.robot.name, cure)
    told = [law for law in laws if law.keys is not None]
    if not told:
        raise ArgumentError("the laws that a job can say", 0, "add one of the kinds that jobs have")
    snapshot = session.snapshot()
    cycles = snapshot.cycles or max(1, snapshot.cycle)
    path = {**loop.keys, "samples": loop.samples}
    if loop.path.closed:
        path["cycles"] = max(1, min(cycles, MOST_STEPS // loop.samples))
    lines = [f"title = {toml(title or session.title)}\n"]
    lines += [f"# {law.name} is a control law of your own: a job cannot say it." for law in laws if law.keys is None]
    lines.append(_part("robot", _placed(session.origin.robot, session.origin.folder)))
    lines.append(_part("task", session.origin.task))
    lines.append(f"# {', '.join(session.robot.joint_names)}\n{_part('start', {'q': home.tolist()})}")
    lines.append(_part("path", _placed(path, session.origin.folder)))
    written: set[str] = set()
    for law in told:
        label = law.label or law.name
        if label not in written:
            lines.append(_part(f"strategies.{toml(label)}", _keys(law)))
        written.add(label)
    return "\n".join(lines)


def _keys(law: Law) -> dict[str, Any]:
    """What a job says of a law, on its leaf."""
    keys = dict(law.keys or {})
    if law.level is not None and isinstance(law.rule, HolonomicStrategy):
        keys["level"] = float(law.level[0]) if len(law.level) == 1 else np.asarray(law.level).tolist()
    return keys


def _part(name: str, keys: Mapping[str, Any]) -> str:
    return table(name, {key: value for key, value in keys.items() if value is not None})


def _placed(keys: Mapping[str, Any], source: FilePath) -> dict[str, Any]:
    """The keys with the full names of files."""
    found: dict[str, Any] = {}
    for key, value in keys.items():
        if isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            value = [_placed(one, source) for one in value]
        elif key in FILES and isinstance(value, str) and FilePath(value).suffix:
            value = FilePath(os.path.normpath(source / value)).as_posix()
        found[key] = value
    return found
