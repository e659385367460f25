"""Cases in a process of their own: one that kills it, or hangs, becomes a row, and the next process does the others."""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from ..errors import SurveyError
from .batches import SECONDS, Batch
from .cases import Cases
from .objects import keep, sendable
from .running import Row, fault, run_case
from .tables import SurveyTable

HARD = 2.0
"""Time limits after which a process that does not answer, in native code, ends."""

TRIES = 3
"""Processes that die of a case before it is a fault: one may be killed by chance, or for want of memory."""

LATE = 2.0
"""Times the seconds of a batch after which a worker hands back the rest of it."""


class _Late(BaseException):
    """The case takes too long."""


@contextmanager
def _limited(seconds: float, hard: bool) -> Iterator[None]:
    """Ends what takes too long: in Python by an exception, in native code, if `hard`, with the process."""
    thread, lock, over = ctypes.c_ulong(threading.get_ident()), threading.Lock(), False

    def ring() -> None:
        with lock:
            if not over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(_Late))

    timer = threading.Timer(seconds, ring)
    timer.daemon = True
    timer.start()
    if hard:
        faulthandler.dump_traceback_later(HARD * seconds + 1.0, exit=True, file=2)
    try:
        try:
            yield
        finally:
            with lock:  # from here on nothing rings; what was rung and not heard yet is taken back
                over = True
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, None)
    finally:
        timer.cancel()
        if hard:
            faulthandler.cancel_dump_traceback_later()


_cases: dict[str, Cases] = {}


def cases_of(table: str, folder: str) -> Cases:
    """The cases of a survey, kept: a process does one survey after the other."""
    if table not in _cases:
        _cases.clear()
        _cases[table] = Cases(SurveyTable.model_validate_json(table), Path(folder))
    return _cases[table]


def run_batch(table: str, folder: str, batch: Batch, *, hard: bool = False) -> Iterator[Row]:
    """The rows of a batch, up to where it takes too long; what goes wrong with a case is said in its row."""
    cases, began = cases_of(table, folder), time.monotonic()
    for k, number in enumerate(batch):
        if k and time.monotonic() - began > LATE * SECONDS:
            return
        case = cases.case(number)
        try:
            with _limited(cases.table.time_limit, hard):
                row = run_case(case, cases)
        except _Late:
            row = fault(case, f"took longer than {cases.table.time_limit:g} s", cases.table.time_limit)
        except Exception as problem:  # noqa: BLE001  whatever a law of the user's own throws is a row
            row = fault(case, f"{type(problem).__name__}: {problem}")
        yield row


def _serve(pipe: Connection, objects: Mapping[str, Any], environment: dict[str, str]) -> None:
    """Batches in, rows out, one by one. Ctrl-C is for the process that asked; this one ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(environment)
    keep(objects)
    parent = multiprocessing.parent_process()

    def follow_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow_parent, daemon=True).start()
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the stack of a case that is ended by force is nobody's
    with suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            for row in run_batch(*pipe.recv(), hard=True):
                pipe.send(row)
            pipe.send(None)


_starting = threading.Lock()
"""One process starts at a time: a second one that is forked meanwhile would hold ends of the first one's pipe."""


class Guarded:
    """A process for cases; a new one takes its place when it dies. For one thread at a time."""

    def __init__(self, objects: Mapping[str, Any] = MappingProxyType({})) -> None:
        self._objects, self._closed, self._unborn = dict(objects), False, 0
        self._pipe: Connection | None = None
        self._process: BaseProcess | None = None

    def rows(self, table: str, folder: str, batch: Batch) -> list[Row]:
        """The rows of a batch: all, or up to where it took too long.

        Raises:
            SurveyError: process after process dies before it begins.
        """
        left, found, deaths = deque(batch), [], Counter[int]()
        while left and not self._closed:
            began = None
            try:
                pipe = self._begun()
                pipe.send((table, folder, tuple(left)))
                began = time.monotonic()
                while (row := pipe.recv()) is not None:
                    found.append(row)
                    left.popleft()
                    began = time.monotonic()
                return found
            except (EOFError, OSError):
                end = self._ended()
            if began is None:
                self._unborn += 1
                if self._unborn == TRIES and not self._closed:
                    raise SurveyError(
                        "survey", f"its processes die before they begin ({end})", "say workers = 0 to see why"
                    )
                continue
            deaths[left[0]] += 1
            cases, seconds = cases_of(table, folder), time.monotonic() - began
            hung = seconds > HARD * cases.table.time_limit
            if (hung or deaths[left[0]] == TRIES) and not self._closed:
                why = f"hung in native code for {seconds:.0f} s" if hung else f"its process died {TRIES} times ({end})"
                found.append(fault(cases.case(left.popleft()), why, seconds))
        return found

    def _begun(self) -> Connection:
        """The pipe to a process that is ready. Raises: EOFError, OSError: it is not. SurveyError: none ever is."""
        if self._pipe is not None:
            return self._pipe
        context: Any = multiprocessing.get_context(_start_method(self._objects))
        objects = self._objects if context.get_start_method() != "fork" else {}  # what is forked has them already
        with _starting:
            if self._closed:
                raise EOFError
            multiprocessing.current_process().daemon = (
                False  # of Dask's: none but those that are none may have children
            )
            pipe, end = context.Pipe()
            self._pipe = pipe
            arguments = (end, objects, dict(os.environ))
            process = context.Process(target=_serve, args=arguments, name="holokin survey", daemon=True)
            self._process = process
            try:
                with _without_main():
                    process.start()
            finally:
                end.close()
        pipe.recv()
        self._unborn = 0
        return pipe

    def _ended(self) -> str:
        """How the process died, in a word; nothing of it is left."""
        if self._pipe is not None:
            self._pipe.close()
        process, self._pipe, self._process = self._process, None, None
        if process is None or process.pid is None:
            return "it did not start"
        process.kill()
        process.join()
        code = process.exitcode or 0
        with suppress(ValueError):
            return signal.Signals(-code).name
        return f"exit code {code}"

    def close(self) -> None:
        """End the process, whatever it is at; from any thread. A thread that waits for rows gets those there are."""
        with _starting:
            self._closed = True
            if self._process is not None:
                self._process.kill()


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
    multiprocessing.set_forkserver_preload(["holokin.surveys.guarded"])
    return "forkserver"
