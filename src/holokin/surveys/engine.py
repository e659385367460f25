"""Batches of cases on the processes of this machine, or of a Dask cluster; a case that kills or hangs costs one row."""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

from .cases import Cases
from .objects import keep, sendable
from .running import Row, fault, prepare, run_case
from .tables import SurveyTable

AHEAD = 2
"""Batches that wait for each worker, so that none is idle."""

HARD = 2.0
"""Time limits after which a process that does not answer, in native code, ends."""

BUILDING = 60.0
"""Seconds at least that robot, law and native code may take to build: no time of the case that is the first."""

Batch = tuple[int, ...]
"""Numbers of cases."""


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


def _cases_of(table: str, folder: str) -> Cases:
    """The cases of a survey, kept: a process does one survey after the other."""
    if table not in _cases:
        _cases.clear()
        _cases[table] = Cases(SurveyTable.model_validate_json(table), Path(folder))
    return _cases[table]


def run_batch(table: str, folder: str, batch: Batch, hard: bool) -> list[Row]:
    """The rows of a batch; what goes wrong with a case is said in its row."""
    cases = _cases_of(table, folder)
    rows = []
    for number in batch:
        case, allowed = cases.case(number), 0.0
        try:
            allowed = max(cases.table.time_limit, BUILDING)
            with _limited(allowed, hard):
                prepare(case, cases)
            allowed = cases.table.time_limit
            with _limited(allowed, hard):
                rows.append(run_case(case, cases))
        except _Late:
            rows.append(fault(case, f"took longer than {allowed:g} s", allowed))
        except Exception as problem:  # noqa: BLE001  whatever a law of the user's own throws is a row
            rows.append(fault(case, f"{type(problem).__name__}: {problem}"))
    return rows


def _begin_worker(objects: Mapping[str, Any]) -> None:
    """Ctrl-C is for the process that asked, and no worker outlives it."""
    keep(objects)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow_parent, daemon=True).start()
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the stack of a case that is ended by force is nobody's


class Here:
    """This process: for what cannot be sent to others. A case that hangs in native code is not ended."""

    def __init__(self, table: SurveyTable, folder: Path) -> None:
        self.text, self.folder = table.model_dump_json(exclude_unset=True), str(folder)

    def run(self, batches: Iterator[Batch]) -> Iterator[list[Row]]:
        """The rows of each batch."""
        for batch in batches:
            yield run_batch(self.text, self.folder, batch, False)


class Pool:
    """The processes of this machine."""

    def __init__(
        self, table: SurveyTable, folder: Path, workers: int, objects: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self.text, self.folder, self.workers = table.model_dump_json(exclude_unset=True), str(folder), workers
        self.cases, self.objects = Cases(table, folder), dict(objects)

    def run(self, batches: Iterator[Batch]) -> Iterator[list[Row]]:
        """The rows of each batch, as they are done. A batch whose process died is done again, case by case."""
        waiting: deque[Batch] = deque()
        while True:
            lost: list[Batch] = []
            with self._processes(self.workers) as executor:
                running: dict[Future[list[Row]], Batch] = {}
                try:
                    while True:
                        waiting.extend(islice(batches, max(0, AHEAD * self.workers - len(running) - len(waiting))))
                        while waiting and len(running) < AHEAD * self.workers:
                            running[self._submitted(executor, waiting[0])] = waiting[0]
                            waiting.popleft()
                        if not running:
                            return
                        for done in wait(running, return_when=FIRST_COMPLETED).done:
                            rows = done.result()
                            del running[done]
                            yield rows
                except BrokenProcessPool:
                    for future, batch in running.items():
                        if future.done() and not future.cancelled() and future.exception() is None:
                            yield future.result()
                        else:
                            lost.append(batch)
            for batch in lost:
                yield from self._one_by_one(batch)

    def _one_by_one(self, batch: Batch) -> Iterator[list[Row]]:
        """Each case alone: the one that its process does not survive becomes a row."""
        left = deque(batch)
        while left:
            with self._processes(1) as executor:
                try:
                    while left:
                        rows = self._submitted(executor, (left[0],)).result()
                        left.popleft()
                        yield rows
                except BrokenProcessPool:
                    yield [fault(self.cases.case(left.popleft()), "its process died, or hung in native code")]

    @contextmanager
    def _processes(self, count: int) -> Iterator[ProcessPoolExecutor]:
        """Fresh processes, which are gone at the end, whatever they are at."""
        start = "spawn" if sendable(self.objects) else "fork"
        context = multiprocessing.get_context(start)
        objects = self.objects if start == "spawn" else {}  # what is forked has them already
        executor = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker, initargs=(objects,))
        try:
            yield executor
        finally:
            at_work = list((getattr(executor, "_processes", None) or {}).values())
            executor.shutdown(wait=False, cancel_futures=True)
            for process in at_work:
                with suppress(OSError, ValueError):
                    process.terminate()

    def _submitted(self, executor: ProcessPoolExecutor, batch: Batch) -> Future[list[Row]]:
        return executor.submit(run_batch, self.text, self.folder, batch, True)


def batched(numbers: Iterable[int], size: int) -> Iterator[Batch]:
    """So many numbers at a time."""
    stream = iter(numbers)
    while batch := tuple(islice(stream, size)):
        yield batch
