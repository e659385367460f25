"""Batches of cases in this process, or in processes of this machine; a case that kills or hangs costs one row."""

from __future__ import annotations

import ctypes
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import SimpleQueue
from types import MappingProxyType, ModuleType
from typing import Any

from ...base.errors import FileError
from .cases import Cases
from .one_case import Row, fault, forget_built, prepare, run_case
from .survey_file import SurveyTable, forget_imported, keep, sendable

# --- Which cases are sent together.

MOST = 100
"""Cases of a batch."""

Batch = tuple[int, ...]
"""Numbers of cases."""


def batches(numbers: Sequence[int], laws: int, workers: int) -> Generator[Batch, None, None]:
    """Cases in batches, of whole loops with all strategies if there are few; smaller in the end, so that all end
    together."""
    begin = 0
    while begin < len(numbers):
        size = max(1, min(MOST, (len(numbers) - begin) // (4 * workers)))
        size -= size % laws if size > laws else 0
        yield tuple(numbers[begin : begin + size])
        begin += size


# --- Cases in a process of their own: one that kills it, or hangs, becomes a row, and the next process does the others.

HARD, MORE = 2.0, 1.0
"""Time limits, and seconds more, after which a process that does not answer, in native code, is killed."""

LOOK = 0.25
"""Seconds between two looks at whether a case takes too long."""

ROWS, CHUNK = 50, 0.2
"""Rows sent together at most, 10 kB: one write of a pipe, so that none is sent in part by a process that is killed; and
seconds of cases whose rows are sent together: what a case that kills its process may cost its neighbours."""

TRIES = 3
"""Processes that die of a case before it is a fault: one may be killed by chance, or for want of memory."""

UNBORN, PAUSE = 6, 0.05
"""Processes that die before their first case until the survey ends; pauses [s] grow by one each time."""

SEE = "say --workers 0, in Python workers=0, to see why; rows that came are kept"


class _Late(BaseException):
    """The case takes too long."""


_board: Any = [-1.0, 0.0, 0.0]
"""The number of the case that is done now, since when, how long it may take; a process for cases shares it."""


class _Watch:
    """Ends by an exception what takes too long in Python.

    One thread watches all cases of a batch: one for each would cost more than a short case.
    """

    def __init__(self, seconds: float) -> None:
        self._look_again = min(LOOK, seconds / 4)
        self._thread, self._lock = ctypes.c_ulong(threading.get_ident()), threading.Lock()
        self._until, self._over = math.inf, threading.Event()

    def __enter__(self) -> _Watch:
        threading.Thread(target=self._look, daemon=True).start()
        return self

    def __exit__(self, *_problem: object) -> None:
        self._over.set()

    def _look(self) -> None:
        while not self._over.wait(self._look_again):
            with self._lock:
                if time.monotonic() > self._until:
                    self._until = math.inf
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, ctypes.py_object(_Late))

    @contextmanager
    def limited(self, number: int, seconds: float) -> Iterator[None]:
        """Around what may take so many seconds of a case. Raises: _Late."""
        now = time.monotonic()
        _board[:] = number, now, seconds
        with self._lock:
            self._until = now + seconds
        try:
            yield
        finally:
            with self._lock:  # from here on nothing rings; what was rung and not heard yet is taken back
                self._until = math.inf
                ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, None)


_cases: dict[tuple[str, str], Cases] = {}


def forget_cases() -> None:
    """Look at the files of robots and strategies anew: they may be others in the next survey."""
    _cases.clear()
    if forget_imported():
        forget_built()


def _cases_of(table: str, folder: str) -> Cases:
    """The cases of a survey, kept: a process does one survey after the other."""
    key = table, folder
    if key not in _cases:
        _cases.clear()
        _cases[key] = Cases(SurveyTable.model_validate_json(table), Path(folder))
    return _cases[key]


def _rows(table: str, folder: str, numbers: Iterable[int]) -> Iterator[Row]:
    """The rows of cases; what goes wrong with a case is said in its row."""
    cases = _cases_of(table, folder)
    limit = cases.table.time_limit
    with _Watch(limit) as watch:
        for number in numbers:
            # Robot, strategy and native code may take a minute to build: no time of the case that is the first.
            case, allowed = cases.case(number), max(limit, 60.0)
            try:
                with watch.limited(number, allowed):
                    ready = prepare(case, cases)
                allowed = limit
                with watch.limited(number, allowed):
                    row = run_case(case, cases, ready)
            except _Late:
                row = fault(case, f"took longer than {allowed:g} s", allowed)
            except (Exception, SystemExit, KeyboardInterrupt) as problem:  # a row, whatever a law of the user's throws
                if isinstance(problem, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
                    raise  # the user's own
                row = fault(case, f"{type(problem).__name__}: {problem}")
            yield row


def _in_time(rows: Iterator[Row]) -> list[Row]:
    """The next rows, as many as come in CHUNK seconds, and no more than ROWS; none where all have come."""
    some, began = list[Row](), time.monotonic()
    for row in rows:
        some.append(row)
        if len(some) == ROWS or time.monotonic() - began > CHUNK:
            break
    return some


def _serve(pipe: Connection, board: Any, objects: Mapping[str, Any], environment: dict[str, str]) -> None:
    """What a process for cases does. Ctrl-C is not for it, and it ends with the one that began it."""
    global _board
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    multiprocessing.current_process().daemon = False  # laws may have processes of their own
    os.environ.update(environment)
    keep(objects)
    _board = board
    parent = multiprocessing.parent_process()

    def follow_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow_parent, daemon=True).start()
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what goes wrong is said in rows
    with suppress(OSError, EOFError):
        while True:
            pipe.send(_first_rows(*pipe.recv()))


def _first_rows(table: str, folder: str, batch: Batch) -> list[Row] | str:
    """The rows of the first cases of a batch; or why there are none."""
    try:
        return _in_time(_rows(table, folder, batch))
    except Exception as problem:  # noqa: BLE001  it is told where the rows are awaited
        return f"its processes fail beside its cases ({type(problem).__name__}: {problem})"


_starting = threading.Lock()
"""One process starts at a time: what it is to find of this one is arranged for it meanwhile."""


class Guarded:
    """A process for cases; a new one takes its place when it dies. For one thread at a time.

    A pool of several, of the standard library or of pebble, ends with all its processes when one of them is killed at
    a bad moment, and neighbours would begin again.
    """

    def __init__(self, objects: Mapping[str, Any] = MappingProxyType({})) -> None:
        self._objects, self._closed, self._unborn = dict(objects), False, 0
        self._board: Any = multiprocessing.RawArray("d", 3)
        self._running: tuple[BaseProcess, Connection] | None = None

    def rows(self, table: str, folder: str, batch: Batch) -> Iterator[list[Row]]:
        """The rows of a batch, as they come.

        Raises:
            FileError: process after process dies before it begins, or fails beside its cases.
        """
        left, deaths = list(batch), Counter[int]()
        while left and not self._closed:
            self._board[:] = -1, 0.0, 0.0
            try:
                rows = self._answer(table, folder, tuple(left))
                self._unborn = 0
            except (OSError, EOFError):  # it died; or the server that forks did, and a new one begins with the next try
                rows = self._after_death(table, folder, left, deaths)
            if isinstance(rows, str):
                raise FileError("survey", rows, SEE)
            for row in rows:
                left.remove(row.number)
            yield rows

    def _answer(self, table: str, folder: str, batch: Batch) -> list[Row] | str:
        """As `_first_rows`, of the process; it is killed if native code hangs. Raises: OSError, EOFError: it died."""
        process, pipe = self._running or self._start_process()
        pipe.send((table, folder, batch))
        while not (ready := wait((pipe, process.sentinel), LOOK)):
            number, since, allowed = self._board
            if number >= 0 and time.monotonic() - since > HARD * allowed + MORE:
                process.kill()
        if pipe not in ready:
            raise EOFError
        return pipe.recv()

    def _start_process(self) -> tuple[BaseProcess, Connection]:
        """A new process, and the path to it. Raises: OSError, EOFError: it did not begin, or is closed."""
        context: Any = multiprocessing.get_context(_start_method(self._objects))
        objects = self._objects if context.get_start_method() != "fork" else {}  # what is forked has them already
        with _starting, _without_main():
            pipe, its = context.Pipe()
            process = context.Process(target=_serve, args=(its, self._board, objects, dict(os.environ)), daemon=True)
            process.start()
            its.close()
        self._running = process, pipe
        if self._closed:
            raise EOFError
        return self._running

    def _after_death(self, table: str, folder: str, left: list[int], deaths: Counter[int]) -> list[Row]:
        """The row of the case at which the process died, if it is a fault now. Raises: FileError."""
        end, (number, since, allowed) = self._end_process(), self._board
        if self._closed:
            return []
        if number not in left:
            self._unborn += 1
            if self._unborn == UNBORN:
                raise FileError("survey", f"its processes die before they begin ({end})", SEE)
            time.sleep(PAUSE * self._unborn)  # until the system has taken a server away that was killed
            return []
        deaths[int(number)] += 1
        seconds = time.monotonic() - since
        if seconds > HARD * allowed:
            why = f"hung in native code for {seconds:.0f} s"
        elif deaths[int(number)] == TRIES:
            why = f"its process died {TRIES} times ({end})"
        else:
            return []
        return [fault(_cases_of(table, folder).case(int(number)), why, seconds)]

    def _end_process(self) -> str:
        """How the process died, in a word; nothing of it is left."""
        running, self._running = self._running, None
        if running is None:
            return "it did not start"
        process, pipe = running
        process.kill()  # it may be alive, and the server that forked it dead
        process.join()
        pipe.close()
        code = process.exitcode or 0
        with suppress(ValueError):
            return signal.Signals(-code).name
        return f"exit code {code}"

    def close(self) -> None:
        """End the process, whatever it is at, or as soon as it has begun; from any thread. No more rows come."""
        self._closed = True
        if (running := self._running) is not None:
            running[0].kill()


@contextmanager
def _without_main() -> Iterator[None]:
    """A process that is begun now does not run the user's script again: it needs nothing of it."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _start_method(objects: Mapping[str, Any]) -> str:
    """Forked from a server that has loaded what is needed; or from this process, which has what cannot be sent."""
    if not sendable(objects):
        return "fork"
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return "spawn"
    multiprocessing.set_forkserver_preload(["holokin.app.survey.engine"])
    return "forkserver"


class InProcess:
    """This process: for what cannot be sent to others. A case that hangs in native code is not ended."""

    def __init__(self, table: SurveyTable, folder: Path) -> None:
        self.text, self.folder = table.model_dump_json(exclude_unset=True), str(folder)

    def run(self, numbers: Sequence[int]) -> Generator[list[Row], None, None]:
        """Rows of cases, as they come."""
        rows = _rows(self.text, self.folder, numbers)
        while some := _in_time(rows):
            yield some


class Pool:
    """The processes of this machine; a thread waits for each."""

    def __init__(
        self, table: SurveyTable, folder: Path, workers: int, objects: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self.text, self.folder, self.laws = table.model_dump_json(exclude_unset=True), str(folder), len(table.laws)
        self.workers, self.objects = workers, dict(objects)

    def run(self, numbers: Sequence[int]) -> Generator[list[Row], None, None]:
        """Rows of cases, as they come. Close it to end the processes."""
        waiting, taking = batches(numbers, self.laws, self.workers), threading.Lock()
        came: SimpleQueue[list[Row] | Exception | None] = SimpleQueue()

        def work(process: Guarded) -> None:
            try:
                while True:
                    with taking:
                        batch = next(waiting, ())
                    if not batch:
                        return came.put(None)
                    for rows in process.rows(self.text, self.folder, batch):
                        came.put(rows)
            except Exception as problem:  # noqa: BLE001  it is raised where the rows are awaited
                came.put(problem)

        guarded = [Guarded(self.objects) for _ in range(self.workers)]
        running = len(guarded)
        try:
            for process in guarded:
                threading.Thread(target=work, args=(process,), name="survey", daemon=True).start()
            while running:
                new = [came.get()]
                while not came.empty():
                    new.append(came.get())
                running -= new.count(None)
                yield [row for rows in new if isinstance(rows, list) for row in rows]
                for problem in new:
                    if isinstance(problem, Exception):
                        raise problem
        finally:
            with taking:
                waiting.close()
            for process in guarded:
                process.close()
