"""A survey from its file to its results: what is done already is left out, what comes is kept at once."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from .batches import Batches
from .cases import Cases
from .cluster import Cluster
from .engine import Here, Pool
from .objects import forks, keep, sendable
from .store import Store
from .tables import SurveyTable

MOST_WORKERS = 1024
"""Processes on one machine."""

Say = Callable[["Progress"], None]


@dataclass(frozen=True)
class Progress:
    """How far a survey is."""

    done: int
    total: int
    faults: int
    seconds: float
    resumed: int

    @property
    def remaining(self) -> float:
        """Seconds to the end [s] at the speed so far; NaN before the first row."""
        new = self.done - self.resumed
        return self.seconds / new * (self.total - self.done) if new else float("nan")


def run_survey(
    table: SurveyTable, folder: Path, out: Path, *, workers: int | None = None, scheduler: str | None = None,
    resume: bool = False, objects: Mapping[str, Any] | None = None, say: Say = lambda _progress: None,
) -> Progress:  # fmt: skip
    """Do the cases of a survey that have no row yet; rows are kept as they come.

    Args:
        folder: from which files of robots count. out: the results file.
        objects: what the survey names by keys: see `survey`.
        workers: processes, by default one for each processor; 0 for this one. scheduler: of a Dask cluster instead.

    Raises:
        SurveyError, WriteError: of the results file. UnknownNameError: of a robot.
    """
    cases = Cases(table, folder.absolute())
    total = len(cases)
    with Store.opened(out, table, cases.folder, resume=resume) as store:
        known = store.done()
        left = (n for n in range(total) if cases.case(n).id not in known) if known else range(total)
        began, done, faults = time.monotonic(), min(len(known), total), 0
        resumed = done
        engine = _engine(table, cases.folder, workers, scheduler, objects or {})
        say(Progress(done, total, faults, 0.0, resumed))
        with closing(engine.run(Batches(left, total - done, len(table.laws)))) as stream:
            for rows in stream:
                store.add(rows)
                done += len(rows)
                faults += sum(row.status == "fault" for row in rows)
                say(Progress(done, total, faults, time.monotonic() - began, resumed))
        return Progress(done, total, faults, time.monotonic() - began, resumed)


def _engine(
    table: SurveyTable, folder: Path, workers: int | None, scheduler: str | None, objects: Mapping[str, Any]
) -> Here | Pool | Cluster:
    keep(objects)
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise ArgumentError("workers", workers, f"give 0 to {MOST_WORKERS}")
    if scheduler is not None:
        return Cluster(table, folder, scheduler)
    if workers == 0 or not (sendable(objects) or forks()):
        return Here(table, folder)
    return Pool(table, folder, workers or os.cpu_count() or 1, objects)
