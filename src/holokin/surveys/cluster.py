"""Batches of cases on a Dask cluster; its workers need `holokin[cluster]`, and robot files at the same places."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

from ..errors import MissingExtraError, SchedulerError
from .cases import Cases
from .engine import AHEAD, Batch, run_batch
from .running import Row, fault
from .tables import SurveyTable

PATIENCE = 8.0
"""Seconds to wait for a scheduler."""


class Cluster:
    """The workers of a Dask scheduler."""

    def __init__(self, table: SurveyTable, folder: Path, scheduler: str) -> None:
        self.text, self.folder, self.scheduler = table.model_dump_json(exclude_unset=True), str(folder), scheduler
        self.cases = Cases(table, folder)

    def run(self, batches: Iterator[Batch]) -> Iterator[list[Row]]:
        """The rows of each batch, as they are done. One that its workers do not survive is done case by case.

        Raises:
            MissingExtraError. SchedulerError: it cannot be reached, or was lost.
        """
        with _client(self.scheduler) as (client, distributed):
            flow, lost = distributed.as_completed(loop=client.loop), deque()
            running: dict[Any, Batch] = {}
            left = True
            while left or running:
                room = max(1, AHEAD * sum(client.nthreads().values())) - len(running)
                new = [lost.popleft() for _ in range(min(room, len(lost)))]
                new += list(islice(batches, max(0, room - len(new))))
                left = bool(new) or bool(lost)
                for batch in new:
                    future = client.submit(run_batch, self.text, self.folder, batch, False, pure=False)
                    running[future] = batch
                    flow.add(future)
                if not running:
                    continue
                future = next(flow)
                batch = running.pop(future)
                if future.status == "finished":
                    yield future.result()
                elif isinstance(problem := future.exception(), distributed.KilledWorker):
                    if len(batch) > 1:
                        lost.extend((number,) for number in batch)
                    else:
                        yield [fault(self.cases.case(number), "its workers died") for number in batch]
                else:
                    raise SchedulerError(self.scheduler, f"a batch failed ({problem!r})")
                future.release()


@contextmanager
def _client(scheduler: str) -> Iterator[tuple[Any, Any]]:
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("distributed", "cluster") from None
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as problem:
        raise SchedulerError(scheduler, f"cannot be reached within {PATIENCE:g} s ({problem})") from None
    try:
        yield client, distributed
    finally:
        with suppress(OSError, TimeoutError):
            client.close(timeout=2)
