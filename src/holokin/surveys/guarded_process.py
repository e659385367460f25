"""Cases in a process of their own: one that kills it, or hangs, becomes a row, and the next process does the others."""

from __future__ import annotations

import ctypes
import faulthandler
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from ..errors import HolokinError, SurveyError
from .batches import SECONDS, Batch
from .cases import Cases
from .objects import keep, sendable
from .one_case import Row, fault, forget_built, prepare, run_case
from .survey_tables import SurveyTable
from .user_functions import forget_imported

HARD = 2.0
"""Time limits after which a process that does not answer, in native code, ends."""

BUILDING = 60.0
"""Seconds at least that robot, law and native code may take to build: no time of the case that is the first."""

LOOK = 0.25
"""Seconds between two looks at whether a case takes too long."""

CHUNK = 0.2
"""Seconds of cases whose rows are sent together: what a case that kills its process may cost its neighbours."""

ROWS = 50
"""Rows sent together at most, 10 kB: one write of a pipe, so that none is sent in part by a process that is killed."""

TRIES = 3
"""Processes that die of a case before it is a fault: one may be killed by chance, or for want of memory."""

UNBORN, PAUSE = 6, 0.05
"""Processes that die before their first case until the survey ends; pauses [s] grow by one each time."""

SEE = "say --workers 0, in Python workers=0, to see why; rows that came are kept"

LATE = 2.0
"""Times the seconds of a batch after which a worker hands back the rest of it."""


class _Late(BaseException):
    """The case takes too long."""


class _Watch:
    """Ends what takes too long: in Python by an exception, in native code, if `hard`, with the process.

    One thread watches all cases of a batch: one for each would cost more than a short case.
    """

    def __init__(self, seconds: float, hard: bool) -> None:
        self._look_again, self._hard, self._armed = min(LOOK, seconds / 4), hard, (-math.inf, 0.0)
        self._thread, self._lock = ctypes.c_ulong(threading.get_ident()), threading.Lock()
        self._until, self._over = math.inf, threading.Event()

    def __enter__(self) -> _Watch:
        threading.Thread(target=self._look, daemon=True).start()
        return self

    def __exit__(self, *_problem: object) -> None:
        self._over.set()
        if self._hard:
            faulthandler.cancel_dump_traceback_later()

    def _look(self) -> None:
        while not self._over.wait(self._look_again):
            with self._lock:
                if time.monotonic() > self._until:
                    self._until = math.inf
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, ctypes.py_object(_Late))

    @contextmanager
    def limited(self, seconds: float) -> Iterator[None]:
        """Around what may take so many seconds. Raises: _Late."""
        now, (since, allowed) = time.monotonic(), self._armed
        if self._hard and (now - since > LOOK or allowed != seconds):
            self._armed = now, seconds
            faulthandler.dump_traceback_later(HARD * seconds + 1.0, exit=True, file=2)
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
    """Look at the files of robots and laws anew: they may be others in the next survey."""
    _cases.clear()
    if forget_imported():
        forget_built()


def cases_of(table: str, folder: str) -> Cases:
    """The cases of a survey, kept: a process does one survey after the other."""
    key = table, folder
    if key not in _cases:
        _cases.clear()
        _cases[key] = Cases(SurveyTable.model_validate_json(table), Path(folder))
    return _cases[key]


def run_batch(
    table: str, folder: str, batch: Batch, seconds: float = SECONDS, *,
    hard: bool = False, at: Callable[[int, float], None] = lambda _number, _seconds: None,
) -> Iterator[Row]:  # fmt: skip
    """The rows of a batch, up to where it takes too long; what goes wrong with a case is said in its row.

    Args:
        seconds: that the batch is to take; after twice as many the rest of it is handed back.
        hard: end the process where native code hangs. at: is told the number of each case, and
            the seconds that it may take, before it begins, and before what it shares with others is built.
    """
    cases, began = cases_of(table, folder), time.monotonic()
    limit = cases.table.time_limit
    with _Watch(limit, hard) as watch:
        for k, number in enumerate(batch):
            if k and time.monotonic() - began > LATE * seconds:
                return
            case, allowed = cases.case(number), max(limit, BUILDING)
            try:
                at(number, allowed)
                with watch.limited(allowed):
                    ready = prepare(case, cases)
                allowed = limit
                at(number, allowed)
                with watch.limited(allowed):
                    row = run_case(case, cases, ready)
            except _Late:
                row = fault(case, f"took longer than {allowed:g} s", allowed)
            except Exception as problem:  # noqa: BLE001  whatever a law of the user's own throws is a row
                row = fault(case, f"{type(problem).__name__}: {problem}")
            except (SystemExit, KeyboardInterrupt) as problem:
                if isinstance(problem, KeyboardInterrupt) and not hard:  # the user's, in this process
                    raise
                row = fault(case, f"{type(problem).__name__}: {problem}")
            yield row


_board: Any = None
"""Of a process for cases: the number of its case, since when, how long it may take."""


def _begin(board: Any, objects: Mapping[str, Any], environment: dict[str, str]) -> None:
    """The first a process does. Ctrl-C is not for it, and it ends with the one that began it."""
    global _board
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the stack of a case that is ended by force is nobody's


def _run_some(table: str, folder: str, batch: Batch) -> list[Row]:
    """The rows of the first cases of a batch, as many as take CHUNK seconds, and no more than ROWS."""

    def at(number: int, seconds: float) -> None:
        _board[:] = number, time.monotonic(), seconds

    return list(islice(run_batch(table, folder, batch, CHUNK / LATE, hard=True, at=at), ROWS))


_starting = threading.Lock()
"""One process starts at a time: what it is to find of this one is arranged for it meanwhile."""


class Guarded:
    """A process for cases; a new one takes its place when it dies. For one thread at a time.

    It is a pool of one: of a pool all processes end with the first that dies, and neighbours would begin again.
    """

    def __init__(self, objects: Mapping[str, Any] = MappingProxyType({})) -> None:
        self._objects, self._closed, self._unborn = dict(objects), False, 0
        self._board: Any = multiprocessing.RawArray("d", 3)
        self._pool: ProcessPoolExecutor | None = None
        self._process: BaseProcess | None = None

    def rows(self, table: str, folder: str, batch: Batch, lasts: float = SECONDS) -> list[Row]:
        """The rows of a batch: all, or up to where it took too long.

        Raises:
            SurveyError: process after process dies before it begins, or fails beside its cases.
        """
        left, found, deaths, began = list(batch), [], Counter[int](), time.monotonic()
        while left and not self._closed and (deaths or time.monotonic() - began < LATE * lasts):
            self._board[:] = -1, 0.0, 0.0
            try:
                rows = self._some(table, folder, tuple(left))
                self._unborn = 0
            except BrokenExecutor:
                rows = self._after_death(table, folder, left, deaths)
            for row in rows:
                left.remove(row.number)
                deaths.pop(row.number, None)
            found += rows
        return found

    def _after_death(self, table: str, folder: str, left: list[int], deaths: Counter[int]) -> list[Row]:
        """The row of the case at which the process died, if it is a fault now. Raises: SurveyError."""
        end = self._ended()
        number, since, allowed = int(self._board[0]), self._board[1], self._board[2]
        if self._closed:
            return []
        if number not in left:
            self._unborn += 1
            if self._unborn == UNBORN:
                raise SurveyError("survey", f"its processes die before they begin ({end})", SEE)
            time.sleep(PAUSE * self._unborn)  # until the system has taken a server away that was killed
            return []
        deaths[number] += 1
        seconds = time.monotonic() - since
        if seconds > HARD * allowed:
            why = f"hung in native code for {seconds:.0f} s"
        elif deaths[number] == TRIES:
            why = f"its process died {TRIES} times ({end})"
        else:
            return []
        return [fault(cases_of(table, folder).case(number), why, seconds)]

    def _some(self, table: str, folder: str, batch: Batch) -> list[Row]:
        """The rows of the first cases of a batch. Raises: BrokenExecutor: the process died. SurveyError."""
        try:
            pool = self._begun()
        except (OSError, EOFError) as problem:  # the server that forks was killed; a new one begins with the next try
            raise BrokenExecutor from problem
        try:
            return pool.submit(_run_some, table, folder, batch).result()
        except (BrokenExecutor, HolokinError):
            raise
        except Exception as problem:
            fact = f"its processes fail beside its cases ({type(problem).__name__}: {problem})"
            raise SurveyError("survey", fact, SEE) from problem

    def _begun(self) -> ProcessPoolExecutor:
        """The pool, whose process is ready. Raises: BrokenExecutor, OSError: it is not, or is closed."""
        if self._pool is not None:
            return self._pool
        context: Any = multiprocessing.get_context(_start_method(self._objects))
        objects = self._objects if context.get_start_method() != "fork" else {}  # what is forked has them already
        with _starting:
            multiprocessing.current_process().daemon = False  # of Dask's: those that are daemons have no children
            begin = (self._board, objects, dict(os.environ))
            self._pool = pool = ProcessPoolExecutor(1, context, initializer=_begin, initargs=begin)
            with _without_main():
                first = pool.submit(os.getpid)
        begun = first.result()
        self._process = next((child for child in multiprocessing.active_children() if child.pid == begun), None)
        if self._closed:
            raise BrokenExecutor
        return pool

    def _ended(self) -> str:
        """How the process died, in a word; nothing of it is left."""
        process, pool, self._pool, self._process = self._process, self._pool, None, None
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)
        if process is None:
            return "it did not start"
        process.join()
        code = process.exitcode or 0
        with suppress(ValueError):
            return signal.Signals(-code).name
        return f"exit code {code}"

    def close(self) -> None:
        """End the process, whatever it is at, or as soon as it has begun; from any thread.

        A thread that waits for rows gets those there are.
        """
        self._closed = True
        if (process := self._process) is not None:
            process.kill()


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
    multiprocessing.set_forkserver_preload(["holokin.surveys.guarded_process"])
    return "forkserver"
