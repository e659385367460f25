"""`survey`: the same from Python, with robots, laws and paths as objects."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.progress import progress
from ...motion.trajectory import Trajectory
from ...path import Path
from ...robot import Robot
from ...strategies import Strategy

if TYPE_CHECKING:
    from .findings import Findings

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
    """Send every robot, with every law, round every loop; what fails is a row, too.

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
        workers: processes, by default one for each processor; 0 for this one, in which nothing ends a law that sleeps,
            or hangs in native code.
        out: a results file to keep. resume: go on with what it holds, where objects are told by their names alone:
            after a change of one take another file. again: the same, and do its faults again.

    Returns:
        A row for each case: `.frame()` for pandas, `.table()` by law, `.columns`.

    Raises:
        JobError: a table that makes no sense. SurveyError, WriteError: of the file. UnknownNameError: of a robot.
    """
    from .findings import Findings
    from .objects import OBJECT
    from .resumable_run import run_survey
    from .store import Store
    from .survey_file import survey_of

    objects: dict[str, Any] = {}
    names: list[str] = []
    for k, robot in enumerate(robots):
        if isinstance(robot, Robot):
            names.append(
                f"{OBJECT}{robot.name}" if f"{OBJECT}{robot.name}" not in objects else f"{OBJECT}{robot.name}-{k}"
            )
            objects[names[-1]] = robot
        else:
            names.append(robot)
    content = {
        "title": "survey", "seed": seed, "robots": names,
        "tasks": {tasks: {"kind": tasks}} if isinstance(tasks, str) else {k: dict(v) for k, v in tasks.items()},
        "loops": {name: _named(f"loop:{name}", loop, objects) for name, loop in loops.items()},
        "laws": {name: _named(f"law:{name}", law, objects) for name, law in laws.items()},
        "cycles": cycles, "samples": samples, "limits": limits, "time_limit": float(time_limit),
    }  # fmt: skip
    if metrics:
        content["metrics"] = {name: {"kind": "given", "key": f"metric:{name}"} for name in metrics}
        objects |= {f"metric:{name}": function for name, function in metrics.items()}
    if starts is not None:
        content["starts"] = dict(starts)
    if cases is not None:
        content["cases"] = cases
    table = survey_of(content, "survey")
    with tempfile.TemporaryDirectory(prefix="holokin-") as folder, progress("survey", 1.0, words=True) as report:
        file = FilePath(folder) / "survey.sqlite" if out is None else FilePath(out)
        done = run_survey(
            table, FilePath(), file, workers=workers, resume=resume, again=again, objects=objects,
            say=lambda found: report(found.share, str(found)),
        )  # fmt: skip
        if done.fewer:
            logging.getLogger("holokin").warning("%s", done.fewer)
        with Store.opened(file, None) as store:
            return Findings.of(store.rows())


def _named(key: str, thing: Any, objects: dict[str, Any]) -> dict[str, Any]:
    """A table, as it is given; an object by its key."""
    what, law = key.replace(":", " ", 1), key.startswith("law:")
    if isinstance(thing, Mapping):
        if thing.get("kind") == "given":
            raise ArgumentError(
                f"the kind of {what}", "given", "give the object itself, or a table as of a survey file"
            )
        return dict(thing)
    if isinstance(thing, Path) and not law:
        if not thing.closed:
            raise ArgumentError(
                what, "an open path", "give one that ends where it begins, as polyline(..., closed=True)"
            )
    elif isinstance(thing, Strategy) or not isinstance(thing, Callable):
        kinds = "a function of the task" if law else "a closed path, a function of the tool pose"
        raise ArgumentError(what, thing, f"give {kinds}, or a table as of a survey file")
    objects[key] = thing
    return {"kind": "given", "key": key}
