"""Batches of cases on a Dask cluster; its workers need `holokin[cluster]`, and robot files at the same places."""

from __future__ import annotations

import asyncio
import re
import threading
import time
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...base.errors import SchedulerError
from ...base.extra_module import extra_module
from .batches import SECONDS, Batch, Batches, lasting
from .cases import Cases
from .engine import AHEAD
from .guarded_process import Guarded, forget_cases
from .one_case import Row, fault
from .survey_tables import SurveyTable

PATIENCE = 6.0
"""Seconds to wait for a scheduler and its first worker: with what loads before, an answer comes within ten."""

ADDRESS = re.compile(r"(\w+://)?(\[[0-9a-fA-F:.]+\]|[\w.-]+):\d{1,5}")
"""Of a scheduler: host and port, with or without the path there."""

LOST = 60.0
"""Seconds to wait for another worker after the last one was lost."""

PAUSE = 0.01
"""Seconds between two looks at what came: workers have more than one batch, so that none waits for it."""

_guarded: dict[int, Guarded] = {}


def run_guarded(table: str, folder: str, batch: Batch, lasts: float = SECONDS) -> list[Row]:
    """On a worker: the rows of a batch, from a process that belongs to this thread of the worker."""
    process = _guarded.setdefault(threading.get_ident(), Guarded())
    return process.rows(table, folder, batch, lasts)


def _end_guarded() -> None:
    """On a worker: end the processes of its threads."""
    forget_cases()
    while _guarded:
        _guarded.popitem()[1].close()


class Cluster:
    """The workers of a Dask scheduler."""

    def __init__(self, table: SurveyTable, folder: Path, scheduler: str, client: Any) -> None:
        self.client = client
        self.text, self.folder, self.scheduler = table.model_dump_json(exclude_unset=True), str(folder), scheduler
        self.cases = Cases(table, folder)

    def run(self, batches: Batches) -> Generator[list[Row], None, None]:
        """Rows as they come: of all batches that are done. What its workers do not survive is done case by case.

        Raises:
            SchedulerError: it was lost, or has no workers any more.
        """
        import distributed

        client = self.client
        flow = distributed.as_completed(loop=client.loop)
        running: dict[Any, Batch] = {}
        alone: list[Batch] = []
        workers, looked = 1, 0.0
        while True:
            if time.monotonic() - looked > 1.0:
                workers, looked = max(1, sum(client.nthreads().values())), time.monotonic()
            while len(running) < AHEAD * workers and (batch := alone.pop() if alone else batches.take(workers)):
                future = client.submit(run_guarded, self.text, self.folder, batch, lasting(workers), pure=False)
                running[future] = batch
                flow.add(future)
            if not running:
                return
            found: list[Row] = []
            for future in self._came(client, flow):
                batch = running.pop(future)
                if future.status == "finished":
                    new = self._checked(batch, future.result())
                    batches.came(batch, new)
                    found += new
                elif future.cancelled():
                    raise SchedulerError(self.scheduler, "was lost")
                elif not isinstance(problem := future.exception(), distributed.KilledWorker):
                    raise SchedulerError(self.scheduler, f"did not do a batch ({problem!r})", WORKERS)
                elif len(batch) == 1:
                    found += [fault(self.cases.case(number), "its workers died") for number in batch]
                else:
                    alone += [(number,) for number in batch]
                future.release()
            yield found

    def _came(self, client: Any, flow: Any) -> list[Any]:
        """What is done, after a wait."""
        began = time.monotonic()
        while not flow.has_ready():
            time.sleep(PAUSE)
            if time.monotonic() - began > PATIENCE:
                _wait_for_workers(client, self.scheduler, LOST)
                began = time.monotonic()
        return flow.next_batch(block=False)

    def _checked(self, batch: Batch, rows: list[Row]) -> list[Row]:
        """Rows of the cases that were asked for. Raises: SchedulerError: robots are others there."""
        if rows and rows[0].id != self.cases.case(rows[0].number).id:
            fact = f"has workers that read other robots for {rows[0].names['robot']!r}"
            raise SchedulerError(self.scheduler, fact, "put the same robot files at the same places on all machines")
        return rows


WORKERS = "install the same holokin[cluster] on its workers"


def _wait_for_workers(client: Any, scheduler: str, seconds: float) -> None:
    """Raises: SchedulerError: there is none for so many seconds, or no scheduler any more."""
    try:
        client.wait_for_workers(1, timeout=seconds)
    except TimeoutError:
        fact = f"has had no workers for {seconds:g} s"
        raise SchedulerError(scheduler, fact, f"start some: dask worker {scheduler}") from None
    except OSError as problem:
        raise SchedulerError(scheduler, f"was lost ({problem})") from None


async def _greet(scheduler: str) -> None:
    """Whether a scheduler of Dask answers. Raises: OSError, TimeoutError: it does not."""
    from distributed.comm.core import connect
    from distributed.security import Security

    await (await connect(scheduler, timeout=PATIENCE / 2, **Security().get_connection_args("client"))).close()


@contextmanager
def reached(scheduler: str) -> Iterator[Any]:
    """A client of a scheduler that has workers.

    Raises:
        MissingExtraError. SchedulerError: no address, or it cannot be reached, or has no workers.
    """
    if not ADDRESS.fullmatch(scheduler):
        raise SchedulerError(scheduler, "is no address", "give one as tcp://host:8786")
    distributed = extra_module("distributed", "cluster")
    until = time.monotonic() + PATIENCE
    try:
        with ThreadPoolExecutor(1) as thread:  # first, since a client that reaches nothing complains for long
            thread.submit(asyncio.run, asyncio.wait_for(_greet(scheduler), PATIENCE / 2)).result()
        client = distributed.Client(scheduler, timeout=until - time.monotonic(), set_as_default=False)
    except (OSError, TimeoutError, OverflowError, MemoryError, ValueError) as problem:
        fact = f"cannot be reached within {PATIENCE:g} s ({str(problem) or 'no answer'})"
        raise SchedulerError(scheduler, fact) from None
    try:
        _wait_for_workers(client, scheduler, max(PATIENCE / 2, until - time.monotonic()))
        yield client
    finally:
        with suppress(Exception):
            client.run(_end_guarded, on_error="ignore")
        with suppress(OSError, TimeoutError):
            client.close(timeout=2)
