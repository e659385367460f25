"""A survey from its file to its results: what is done already is left out, what comes is kept at once."""

from __future__ import annotations

import logging
import os
import tempfile
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import timedelta
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from ...base.arguments import typed
from ...base.errors import ArgumentError, MissingExtraError
from ...base.progress import progress
from ...motion.control.libraries import LIBRARIES
from ...motion.trajectory import Trajectory
from ...path import Path
from ...robot import Robot
from ...strategies import Strategy
from .cases import Cases
from .engine import InProcess, Pool, forget_cases
from .one_case import Row
from .store import COLUMNS, Store
from .survey_file import Library, Own, SurveyTable, forks, imported, keep, sendable

if TYPE_CHECKING:
    from .findings import Findings

# --- What would be a fault of every case of a strategy is said before anything runs.


def check_laws(cases: Cases) -> None:
    """Check what strategies import, and that libraries are asked for whole poses alone.

    Raises:
        ArgumentError: a function that cannot be imported; a metric with the name of a column; a task that is no whole
            pose. MissingExtraError.
    """
    asked = {law for stratum in cases.strata for law in stratum.laws}
    for name, law in cases.table.laws.items():
        if name in asked and isinstance(law, Own):
            imported(law.function, cases.folder)
        if name in asked and isinstance(law, Library) and find_spec(law.kind) is None:
            raise MissingExtraError(LIBRARIES[law.kind].package, law.kind)
    for name, metric in cases.table.metrics.items():
        if name in COLUMNS:
            raise ArgumentError("the name of a metric", name, f"take another one than {', '.join(COLUMNS)}")
        if isinstance(metric, str):
            imported(metric, cases.folder)
    for task, name in dict.fromkeys((stratum.task, law) for stratum in cases.strata for law in stratum.laws):
        table = cases.table.tasks[task]
        whole = table.kind == "pose" and table.orientation == "twist" and table.rows is None
        if isinstance(cases.table.laws[name], Library) and not whole:
            cure = f"it follows whole poses alone: leave it out, [[without]] law = {name!r}, task = {task!r}"
            raise ArgumentError(f"the task of the strategy {name!r}", task, cure)


MOST_WORKERS = 1024
"""Processes on one machine."""


@dataclass(frozen=True)
class Progress:
    """How far a survey is: `str` says it in a line.

    `done` of `total` cases have a row, `resumed` of them from a run before; `faults` of this run; `speed` is that of
    the last minute [cases/s], NaN in the first seconds; `again` cases were faults of a run before; `stale` rows are of
    cases that are asked no more: there were more cases, or the file of a robot or of a strategy was another one.
    `fewer` says why there are fewer cases than were asked for.
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
        # Seconds over which the speed of a survey is told: robots and strategies differ in what they cost.
        while len(self._recent) > 2 and self._recent[1][0] < now - 60.0:
            self._recent.popleft()
        then, before = self._recent[0] if rows else (now, self._done)
        # Seconds of rows before a speed is told.
        speed = (self._done - before) / (now - then) if now - then > 1.0 else float("nan")
        return Progress(self._done, self._total, self._faults, now - self._began, self._resumed, speed, self._again)


def run_survey(
    table: SurveyTable,
    folder: FilePath,
    out: FilePath,
    *,
    workers: int | None = None,
    resume: bool = False,
    again: bool = False,
    objects: Mapping[str, Any] | None = None,
    progress: Callable[[Progress], None] = lambda _progress: None,
) -> Progress:
    """Do the cases of a survey that have no row yet; rows are kept as they come.

    Args:
        folder: from which files of robots count. out: the results file.
        resume: go on with what the file holds. again: the same, and do again what is a fault there: these rows stay
            until new ones take their place.
        objects: what the survey names by keys: see `survey`.
        workers: processes, by default one for each processor; 0 for this one.

    Raises:
        FileError, WriteError: of the results file. UnknownNameError: of a robot. MissingExtraError, ArgumentError:
        of a strategy that no case could have.
    """
    # The cases, and what would be a fault of each of them.
    forget_cases()
    cases = Cases(table, folder.absolute())
    total = len(cases)
    keep(objects or {})
    check_laws(cases)
    engine = _engine(table, cases.folder, workers, objects or {})
    # The file last: what is wrong with the others leaves none.
    with Store.opened(out, table, cases.folder, resume=resume or again) as store:
        # Those that have no row yet.
        before, known = store.done(), store.done(faults=not again)
        faults = store.faults() if again else {}
        asked = cases.ids if before else []
        left = [n for n, case in enumerate(asked) if case not in known] if known else range(total)
        done = total - len(left)
        # Their rows, kept as they come.
        clock = _Clock(total, done, len(faults))
        state = clock.after(())
        progress(state)
        with closing(engine.run(left)) as stream:
            for new in stream:
                store.add(new, faults)
                state = clock.after(new)
                progress(state)
        stale = len(store.done().difference(asked)) if before else 0
        return replace(state, stale=stale, fewer=cases.fewer)


def _engine(table: SurveyTable, folder: FilePath, workers: int | None, objects: Mapping[str, Any]) -> InProcess | Pool:
    if workers is not None and not 0 <= workers <= MOST_WORKERS:
        raise ArgumentError("workers", workers, f"give 0 to {MOST_WORKERS}")
    if workers == 0 or not (sendable(objects) or forks()):
        return InProcess(table, folder)
    return Pool(table, folder, workers or os.cpu_count() or 1, objects)


Kind = Mapping[str, Any]


@typed
def survey(
    robots: Sequence[str | Robot],
    laws: Mapping[str, Any],
    loops: Mapping[str, Any],
    *,
    tasks: Mapping[str, Kind] | Literal["position", "pose"] = "position",
    starts: Kind | None = None,
    metrics: Mapping[str, Callable[[Trajectory], Any]] | None = None,
    cycles: int = 10,
    samples: int = 200,
    limits: bool = True,
    cases: int | None = None,
    seed: int = 0,
    time_limit: float = 60.0,
    workers: int | None = None,
    out: str | FilePath | None = None,
    resume: bool = False,
    again: bool = False,
) -> Findings:
    """Send every robot, with every strategy, round every loop; what fails is a row, too.

    Args:
        robots: names of the catalogue (also patterns, as "ur*"), files, or robots.
        laws: name -> a function of the task, or of the task and the start posture (n,), which gives a strategy or a
            control law, as `hk.moore_penrose`; or a table as of a survey file.
        loops: name -> a table as of a survey file; a closed path, which is moved to begin at the tool; or a function of
            the tool pose (4, 4) that gives a path.
        tasks: name -> a table [task] as of a job; or one word for one of them.
        starts: as [starts] of a survey file; by default one regular posture.
        metrics: name -> a function of the trajectory (to where the case ended) that gives a number, or None; each has a
            column. What raises, or gives no finite number, makes its case a fault, and its reason says so.
        cycles, samples, limits, cases, seed, time_limit: as of a survey file.
        workers: processes, by default one for each processor; 0 for this one, in which nothing ends a strategy that
            sleeps, or hangs in native code.
        out: a results file to keep. resume: go on with what it holds, where objects are told by their names alone:
            after a change of one take another file. again: the same, and do its faults again.

    Returns:
        A row for each case: `.frame()` for pandas, `.table()` by strategy, `.columns`.

    Raises:
        JobError: a table that makes no sense. FileError, WriteError: of the file. UnknownNameError: of a robot.
    """
    from .findings import Findings
    from .store import Store
    from .survey_file import OBJECT, survey_of

    # Objects by their keys.
    objects: dict[str, Any] = {}
    names: list[str] = []
    for k, robot in enumerate(robots):
        if isinstance(robot, Robot):
            key = f"{OBJECT}{robot.name}"
            names.append(key if key not in objects else f"{key}-{k}")
            objects[names[-1]] = robot
        else:
            names.append(robot)
    # The content of a survey file.
    content: dict[str, Any] = {"title": "survey", "seed": seed, "robots": names}
    content["tasks"] = {tasks: {"kind": tasks}} if isinstance(tasks, str) else {k: dict(v) for k, v in tasks.items()}
    content["loops"] = {name: _named(f"loop:{name}", loop, objects) for name, loop in loops.items()}
    content["laws"] = {name: _named(f"law:{name}", law, objects) for name, law in laws.items()}
    content |= {"cycles": cycles, "samples": samples, "limits": limits, "time_limit": float(time_limit)}
    if metrics:
        content["metrics"] = {name: {"kind": "given", "key": f"metric:{name}"} for name in metrics}
        objects |= {f"metric:{name}": function for name, function in metrics.items()}
    if starts is not None:
        content["starts"] = dict(starts)
    if cases is not None:
        content["cases"] = cases
    # The run.
    table = survey_of(content, "survey")
    with tempfile.TemporaryDirectory(prefix="holokin-") as folder, progress("survey", 1.0, words=True) as report:
        file = FilePath(folder) / "survey.sqlite" if out is None else FilePath(out)
        asked = {"workers": workers, "resume": resume, "again": again, "objects": objects}
        done = run_survey(table, FilePath(), file, **asked, progress=lambda state: report(state.share, str(state)))
        if done.fewer:
            logging.getLogger("holokin").warning("%s", done.fewer)
        with Store.opened(file, None) as store:
            return Findings.of(store.rows())


def _named(key: str, given: Any, objects: dict[str, Any]) -> dict[str, Any]:
    """A table, as it is given; an object by its key."""
    what, law = key.replace(":", " ", 1), key.startswith("law:")
    if isinstance(given, Mapping):
        if given.get("kind") == "given":
            cure = "give the object itself, or a table as of a survey file"
            raise ArgumentError(f"the kind of {what}", "given", cure)
        return dict(given)
    if isinstance(given, Path) and not law:
        if not given.closed:
            cure = "give one that ends where it begins, as polyline(..., closed=True)"
            raise ArgumentError(what, "an open path", cure)
    elif isinstance(given, Strategy) or not isinstance(given, Callable):
        kinds = "a function of the task" if law else "a closed path, a function of the tool pose"
        raise ArgumentError(what, given, f"give {kinds}, or a table as of a survey file")
    objects[key] = given
    return {"kind": "given", "key": key}
