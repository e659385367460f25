"""Batches of cases in this process, or in processes of this machine; a case that kills or hangs costs one row."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from queue import SimpleQueue
from types import MappingProxyType
from typing import Any

from .batches import Batch, Batches, lasting
from .guarded_process import Guarded, run_batch
from .one_case import Row
from .survey_tables import SurveyTable

AHEAD = 2
"""Batches that wait for each worker, so that none is idle."""


class Here:
    """This process: for what cannot be sent to others. A case that hangs in native code is not ended."""

    def __init__(self, table: SurveyTable, folder: Path) -> None:
        self.text, self.folder = table.model_dump_json(exclude_unset=True), str(folder)

    def run(self, batches: Batches) -> Generator[list[Row], None, None]:
        """The rows of each batch."""
        while batch := batches.take(1):
            rows = list(run_batch(self.text, self.folder, batch))
            batches.came(batch, rows)
            yield rows


class Pool:
    """The processes of this machine; a thread waits for each."""

    def __init__(
        self, table: SurveyTable, folder: Path, workers: int, objects: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self.text, self.folder, self.workers = table.model_dump_json(exclude_unset=True), str(folder), workers
        self.objects = dict(objects)

    def run(self, batches: Batches) -> Generator[list[Row], None, None]:
        """Rows as they come: of all batches that are done. Close it to end the processes."""
        guarded = [Guarded(self.objects) for _ in range(self.workers)]
        free: SimpleQueue[Guarded] = SimpleQueue()
        for process in guarded:
            free.put(process)

        def rows(batch: Batch) -> list[Row]:
            process = free.get()
            try:
                return process.rows(self.text, self.folder, batch, lasting(self.workers))
            finally:
                free.put(process)

        threads = ThreadPoolExecutor(self.workers, "survey")
        running: dict[Future[list[Row]], Batch] = {}
        try:
            while True:
                while len(running) < AHEAD * self.workers and (batch := batches.take(self.workers)):
                    running[threads.submit(rows, batch)] = batch
                if not running:
                    return
                found: list[Row] = []
                for done in wait(running, return_when=FIRST_COMPLETED).done:
                    batch, new = running.pop(done), done.result()
                    batches.came(batch, new)
                    found += new
                yield found
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in guarded:
                process.close()
