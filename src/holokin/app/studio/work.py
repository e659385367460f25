"""Work in the background of a session: verdicts, clouds, and the arm that follows a map of sheets."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...analysis.sheets import Sheets, StillMotion, self_motion_between
from ...analysis.sheets.still_motion import SAME
from ...base.errors import HolokinError, OutOfReachError, brief
from ...base.types import Array, Matrix, Value, Vector
from .followers import Move, Run, follower, put_on_leaf
from .states import StrategyStatus

LONGEST = 200  # characters of a foreign error's own words


def failure(what: str, problem: Exception) -> str:
    """The sentence of an error: that of holokin's own says what helps, another one is a fault of holokin."""
    if isinstance(problem, HolokinError):
        return f"{what}: {problem}"
    return f"{what}: holokin failed where it should not, {type(problem).__name__}: {brief(problem, LONGEST)}"


class Worker:
    """A thread of a session, until it is closed; a program that ends does not wait for it."""

    def __init__(self, name: str, work: Callable[[threading.Event], None], failed: Callable[[Exception], None]) -> None:
        def run() -> None:
            try:
                work(self._closed)
            except Exception as problem:  # noqa: BLE001  a thread has nobody who could catch it
                failed(problem)

        self._closed = threading.Event()
        self._thread = threading.Thread(target=run, name=name, daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True while it works."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """Have it end, and do not wait."""
        self._closed.set()

    def close(self, patience: float = 10.0) -> None:
        """Have it end, and wait for that."""
        self.cancel()
        if threading.current_thread() is not self._thread:
            self._thread.join(patience)


FASTEST_CHANGE = 0.6  # seconds in which a change is shown at least: a faster one would not be seen
LOOKED_FOR = "Why no sheet serves this pose is being looked for."

Search = Callable[[Callable[[str], None]], Sheets]  # what makes or reads the map; it tells a function what it does


class _EndedError(Exception):
    """The session was closed while sheets were searched for."""


@dataclass(frozen=True, eq=False)
class SheetState(Value):
    """What a page is told of the sheets of a session.

    count: sheets of the map, 0 while there is none. strategy: the one whose arm follows them, or empty. sheet: that
    which serves the target, -1 for none. sentence: what the arm does; why: why no sheet serves the target. searching:
    what goes on while the map is made. about: what the map serves.
    """

    count: int
    strategy: str
    sheet: int
    sentence: str
    why: str
    searching: str
    about: str


@dataclass(eq=False)
class _Change:
    """A self-motion that is shown, at a time [s] of it and so at a posture q (n,); then the arm goes on to poses."""

    motion: StillMotion
    target: Array
    q: Vector
    time: float = 0.0


class SheetFollower:
    """The map of a session, and the strategy whose arm follows it. Its session calls it under its lock."""

    def __init__(
        self,
        lock: threading.RLock,
        runs: Mapping[str, Run],
        changed: Callable[[], object],
        failed: Callable[[str, Exception], None],
        search: Search,
    ) -> None:
        """No map yet: `find` makes it, in a thread.

        Args:
            lock, runs: of the session, as they change. changed: told of each change. failed: told of what was not done.
        """
        self._lock, self._runs, self._changed, self._failed, self._search = lock, runs, changed, failed, search
        self.sheet_map: Sheets | None = None
        self._change: _Change | None = None
        self._known: dict[tuple[bytes, int], StillMotion] = {}  # from where the arm rests
        self._why: tuple[bytes, str] = (b"", "")
        self._state = SheetState(0, "", -1, "", "", "", "")
        self._finder: Worker | None = None
        self._asker: Worker | None = None

    @property
    def state(self) -> SheetState:
        """What there is now, as a value."""
        run = self._run
        return replace(self._state, strategy="" if run is None else run.strategy.name)

    @property
    def _run(self) -> Run | None:
        """The strategy whose arm follows the sheets; none once a slider or another start has given it its leaf back."""
        return next((run for run in self._runs.values() if run.follow == self._move), None)

    def find(self) -> None:
        """Make the map in a thread; nothing happens while that is done, or where there is one."""
        if self.sheet_map is None and (self._finder is None or not self._finder.alive):
            self._tell(searching="The sheets are looked for.")
            self._finder = Worker("holokin-studio-sheets", self._find, self._lost)

    def _find(self, closed: threading.Event) -> None:
        def progress(text: str) -> None:
            if closed.is_set():
                raise _EndedError
            with self._lock:
                self._tell(searching=f"{text.removeprefix('sheets: ')} ...")

        sheets = self._search(progress)
        with self._lock:
            if not closed.is_set():
                self.sheet_map = sheets
                self._tell(count=len(sheets), searching="", about=sheets.sentence)

    def _lost(self, problem: Exception) -> None:
        with self._lock:
            sentence = "" if isinstance(problem, _EndedError) else failure("The sheets were not found", problem)
            self._tell(searching=sentence)

    def look(self, poses: Array) -> None:
        """Which sheet serves tool poses (1, 4, 4) to which no arm was taken by them."""
        if self.sheet_map is not None and self._run is None:
            try:
                sheet = self.sheet_map(poses[0])[0]
            except OutOfReachError:
                self._unserved(poses[0])
            else:
                self._tell(sheet=sheet, sentence="", why="")

    def take(self, run: Run, target: Array) -> None:
        """A strategy's arm follows the sheets from now on: it goes to them by a self-motion, or is put there."""
        self.release()
        if self.sheet_map is None:
            return
        run.follow = self._move
        run.put(self._move(run.q, target, True))
        if self._change is None and run.status is not StrategyStatus.FOLLOWING and self._state.sheet < 0:
            try:
                sheet, q = self.sheet_map(target[0])
            except OutOfReachError:
                return
            self._tell(sheet=sheet, sentence=f"No self-motion led to sheet {sheet}: the arm was put there.")
            run.put(Move(q, StrategyStatus.FOLLOWING))

    def release(self, limits: bool = True) -> None:
        """The arm follows its strategy again, on the leaf through the posture where it stands."""
        run, self._change = self._run, None
        if run is not None:
            run.follow = follower(run.strategy, run.q, limits)
            put_on_leaf(run, run.q, limits)
            run.put(Move(run.q, StrategyStatus.FOLLOWING))
            self._tell(sentence="")

    def advance(self, dt: float) -> bool:
        """A change that is shown goes on by a time [s]; whether there was one."""
        change, run = self._change, self._run
        if change is None or run is None or not np.array_equal(run.q, change.q):  # it was moved by somebody
            self._change = None
            return False
        seconds = change.motion.seconds
        change.time += dt * seconds / max(seconds, FASTEST_CHANGE)
        if change.time < seconds:
            # The joints (n,) of a motion at a time [s], even between its rows.
            change.q = np.array([np.interp(change.time, change.motion.t, column) for column in change.motion.q.T])
            run.put(Move(change.q, StrategyStatus.STOPPED, self._state.sentence))
            return True
        self._change, self._known = None, {}
        run.put(self._move(change.motion.q[-1], change.target, True))
        return True

    def _move(self, q: Vector, poses: Array, _wait: bool) -> Move:
        """The joints of the sheet on which the arm stands; another one only where that does not serve, by a change."""
        if self._change is not None and np.array_equal(q, self._change.q):
            self._change.target = poses
            return Move(q, StrategyStatus.STOPPED, self._state.sentence)
        self._change, sheets = None, self.sheet_map
        if sheets is None:
            return Move(q, StrategyStatus.STOPPED, "There is no map of sheets.")
        try:
            wanted, posture = sheets.near(poses[0], q)
            if wanted in sheets.of(q):  # the arm stands on it, and it leads there
                self._tell(sheet=wanted, sentence=f"Sheet {wanted} serves.", why="")
                return Move(posture, StrategyStatus.FOLLOWING)
            return self._begin(sheets, q, poses, wanted)
        except OutOfReachError:
            self._unserved(poses[0])
            return Move(q, StrategyStatus.OUT_OF_REACH, "No sheet serves this pose; drag the tool back.")
        except HolokinError as problem:
            self._tell(sheet=-1, sentence=str(problem), why="")
            return Move(q, StrategyStatus.STOPPED, str(problem))

    def _begin(self, sheets: Sheets, q: Vector, poses: Array, wanted: int) -> Move:
        """Begin a self-motion to a sheet that serves the target, at the pose where the arm rests; or say why not."""
        resting, serving = (sheets.postures(T[None])[:, 0] for T in (sheets.task.pose(q), poses[0]))
        serves, reason = np.flatnonzero(np.isfinite(serving).all(axis=1)), ""
        for sheet in sorted(serves.tolist(), key=lambda s: s != wanted):
            # The sheet serves the pose where the arm rests, and leads straight from there to the target.
            if not np.isfinite(resting[sheet]).all():
                reason = reason or f"sheet {sheet} does not serve the pose where the arm rests"
                continue
            reached, _ = sheets.sheets[sheet].reached(resting[[sheet]], poses, sheets.clear)
            if not np.abs(reached[0] - serving[sheet]).max() < SAME:  # NaN is not
                reason = reason or f"sheet {sheet} does not lead straight from there to the tool"
                continue
            # A self-motion leads to it.
            key = (q.tobytes(), sheet)
            if key not in self._known:
                self._known = {k: v for k, v in self._known.items() if k[0] == key[0]}
                self._known[key] = self_motion_between(sheets.task, q, resting[sheet], sheets.clearances)
            motion = self._known[key]
            if motion.hindrance is None:
                self._change = _Change(motion, poses, q)
                first = min(sheets.of(q), default=-1)
                way = f"Goes to sheet {sheet}" if first < 0 else f"Changes from sheet {first} to sheet {sheet}"
                self._tell(sheet=sheet, sentence=f"{way}, the tool at rest: {motion.seconds:.2f} s.", why="")
                return Move(q, StrategyStatus.STOPPED, self._state.sentence)
            reason = reason or motion.reason
        fact = f"it would have to change to sheet {wanted}, and no self-motion leads there"
        sentence = f"The arm rests: {fact}: {reason}."
        self._tell(sheet=-1, sentence=sentence, why="")
        return Move(q, StrategyStatus.STOPPED, sentence)

    def _unserved(self, pose: Matrix) -> None:
        """No sheet serves a pose (4, 4): why, is looked for in a thread, the last pose first."""
        key = pose.tobytes()
        self._tell(sheet=-1, sentence="No sheet serves this pose.", why=LOOKED_FOR if self._why[0] != key else "")
        if self._why[0] == key:
            self._tell(why=self._why[1])
            return
        self._why = (key, LOOKED_FOR)
        if self._asker is None or not self._asker.alive:
            self._asker = Worker("holokin-studio-why", self._ask, self._unknown)

    def _ask(self, closed: threading.Event) -> None:
        while not closed.is_set():
            with self._lock:
                (key, known), sheets = self._why, self.sheet_map
                if known != LOOKED_FOR or sheets is None:
                    self._asker = None
                    return
            text = sheets.reason(np.frombuffer(key).reshape(4, 4))
            with self._lock:
                if self._why[0] == key:
                    self._why = (key, text)
                    if self._state.sheet < 0 and self._state.why:
                        self._tell(why=f"{text[:1].upper()}{text[1:]}.")

    def _unknown(self, problem: Exception) -> None:
        self._failed("Why no sheet serves the pose was not found", problem)

    def _tell(self, **changed: object) -> None:
        self._state = replace(self._state, **changed)  # type: ignore[arg-type]
        self._changed()

    def close(self) -> None:
        """End its threads; a search ends at its next step."""
        for worker in (self._finder, self._asker):
            if worker is not None:
                worker.close(patience=2.0)
