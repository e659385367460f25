"""A survey from its file to its results: what is done already is left out, what comes is kept at once."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from ...base.errors import ArgumentError
from .batches import Batches
from .cases import Cases
from .cluster import Cluster, reached
from .engine import Here, Pool
from .guarded_process import forget_cases
from .law_faults import check_laws
from .objects import forks, keep, sendable
from .one_case import Row
from .store import Store
from .survey_tables import SurveyTable

MOST_WORKERS = 1024
"""Processes on one machine."""

Say = Callable[["Progress"], None]


WINDOW = 60.0
"""Seconds over which the speed of a survey is told: robots and laws differ in what they cost."""

AT_LEAST = 1.0
"""Seconds of rows before a speed is told."""


@dataclass(frozen=True)
class Progress:
    """How far a survey is: `str` says it in a line.

    `done` of `total` cases have a row, `resumed` of them from a run before; `faults` of this run; `speed` is that of
    the last minute [cases/s], NaN in the first seconds; `again` cases were faults of a run before; `stale` rows are of
    cases that are asked no more: there were more cases, or the file of a robot or of a law was another one. `fewer`
    says why there are fewer cases than were asked for.
    """

    done: int
    total: int
    faults: int
    seconds: float
    resumed: int
    speed: float = float("nan")
    again: int = 0
    stale: int = 0
    fewer: str = ""

    @property
    def share(self) -> float:
        """What is done of all, 0 to 1."""
        return self.done / max(self.total, 1)

    @property
    def remaining(self) -> float:
        """Seconds to the end [s] at the speed of the last minute; NaN in the first seconds."""
        return (self.total - self.done) / self.speed if self.speed > 0 else float("nan")

    def __str__(self) -> str:
        parts = [f"{self.done:,} of {self.total:,} cases"]
        parts += [f"{self.resumed:,} of them before"] if self.resumed else []
        parts += [f"{self.again:,} faults again"] if self.again else []
        parts += [f"{self.faults:,} faults"] if self.faults else []
        if self.speed > 0:
            left = timedelta(seconds=round(self.remaining))
            parts += [f"{self.speed:.3g} cases/s", f"about {left} left"]
        return ", ".join(parts)


class _Clock:
    """The progress of a run, by the rows that come; what it takes until the first ones come is no speed."""

    def __init__(self, total: int, resumed: int, again: int = 0) -> None:
        self._began, self._total, self._resumed, self._again = time.monotonic(), total, resumed, again
        self._done, self._faults = resumed, 0
        self._recent: deque[tuple[float, int]] = deque()

    def after(self, rows: Sequence[Row]) -> Progress:
        """With some more rows."""
        now = time.monotonic()
        self._done += len(rows)
        self._faults += sum(row.status == "fault" for row in rows)
        if rows:
            self._recent.append((now, self._done))
        while len(self._recent) > 2 and self._recent[1][0] < now - WINDOW:
            self._recent.popleft()
        then, before = self._recent[0] if rows else (now, self._done)
        speed = (self._done - before) / (now - then) if now - then > AT_LEAST else float("nan")
        return Progress(self._done, self._total, self._faults, now - self._began, self._resumed, speed, self._again)


def run_survey(
    table: SurveyTable, folder: Path, out: Path, *, workers: int | None = None, scheduler: str | None = None,
    resume: bool = False, again: bool = False, objects: Mapping[str, Any] | None = None,
    say: Say = lambda _progress: None,
) -> Progress:  # fmt: skip
    """Do the cases of a survey that have no row yet; rows are kept as they come.

    Args:
        folder: from which files of robots count. out: the results file.
        resume: go on with what the file holds. again: the same, and do again what is a fault there: these rows stay
            until new ones take their place.
        objects: what the survey names by keys: see `survey`.
        workers: processes, by default one for each processor; 0 for this one. scheduler: of a Dask cluster instead.

    Raises:
        SurveyError, WriteError: of the results file. UnknownNameError: of a robot. MissingExtraError, ArgumentError:
        of a law that no case could have.
    """
    forget_cases()
    cases = Cases(table, folder.absolute())
    total = len(cases)
    keep(objects or {})
    check_laws(cases, here=scheduler is None)
    with (  # the file last: what is wrong with the others leaves none
        _engine(table, cases.folder, workers, scheduler, objects or {}) as engine,
        Store.opened(out, table, cases.folder, resume=resume or again) as store,
    ):
        before, known = store.done(), store.done(faults=not again)
        faults = store.faults() if again else {}
        asked = cases.ids if before else []
        left = [n for n, case in enumerate(asked) if case not in known] if known else range(total)
        done = total - len(left)
        clock = _Clock(total, done, len(faults))
        found = clock.after(())
        say(found)
        with closing(engine.run(Batches(left, total - done, len(table.laws)))) as stream:
            for new in stream:
                store.add(new, faults)
                found = clock.after(new)
                say(found)
        stale = len(store.done().difference(asked)) if before else 0
        return replace(found, stale=stale, fewer=cases.fewer)


@contextmanager
def _engine(
    table: SurveyTable, folder: Path, workers: int | None, scheduler: str | None, objects: Mapping[str, Any]
) -> Iterator[Here | Pool | Cluster]:
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise ArgumentError("workers", workers, f"give 0 to {MOST_WORKERS}")
    if scheduler is not None:
        with reached(scheduler) as client:
            yield Cluster(table, folder, scheduler, client)
    elif workers == 0 or not (sendable(objects) or forks()):
        yield Here(table, folder)
    else:
        yield Pool(table, folder, workers or os.cpu_count() or 1, objects)
