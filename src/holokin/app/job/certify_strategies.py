"""The strategies of a job, certified along its path or over the box of its [workspace]."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path as FilePath
from typing import Any

from ...base.errors import ExpressionError, HolokinError, JobError, NoProofError
from ...path import Path
from ...path.workspaces import PoseRange
from ...proof import Certificate, certify, unique_region
from ...strategies import HolonomicStrategy
from .cover_strategies import build_workspace
from .job_parts import build_begin, build_strategy, build_tasks, naming
from .path_building import build_path
from .path_entry import build_entry
from .runner import OF_ONE_STRATEGY
from .schema import Job


def certify_job(
    job: Job, file: FilePath, *, workspace: bool = False, part: bool = False, budget: int | None = None,
    cells_file: Callable[[str], FilePath | None] = lambda _title: None,
    say: Callable[[str], None] = lambda _text: None,
) -> Iterator[tuple[str, Certificate | str]]:  # fmt: skip
    """(name, certificate, or why there is none) of each strategy of a job, one after the other.

    What its [checks] ask for is to be proven, too: shapes apart, joints within their limits.

    Args:
        workspace: over the box of the job's [workspace] instead of along its path.
        part: of a workspace, as much as can be proven, as of `unique_region`.
        budget: cells that may be examined for each; by default as `certify`.
        cells_file: name of a strategy -> the file that keeps its cells, as `keep_in` of `certify`, or None.
        say: hears what is going on.

    Raises:
        HolokinError: bad input.
    """
    robot, start, tasks = build_tasks(job, file)
    if not workspace:
        with naming(file, "path"):
            where = build_path(job.path, tasks[0], start, file)
    elif job.workspace is None:
        raise JobError(file, "workspace", "is missing", 'add a table [workspace] of kind "box"')
    elif job.workspace.kind != "box":
        raise JobError(file, "workspace.kind", f"is {job.workspace.kind!r}", 'only a "box" can be certified')
    else:
        where = build_workspace(job.workspace, robot.pose(start)[:3, :3], file)
    more: dict[str, Any] = {} if budget is None else {"budget": budget}
    if job.checks is not None:
        with naming(file, "checks"):
            more |= job.checks.proven(robot)
    for label, table in job.strategies.items():
        for task in tasks:
            title = label if len(tasks) == 1 else f"{label} ({task.orientation})"
            say(title)
            try:
                with naming(file, "strategies", label):
                    strategy = build_strategy(job, label, task, start, title)
                    if not isinstance(strategy, HolonomicStrategy):
                        raise NoProofError(title, f"it has no leaves: {HolonomicStrategy.cure}")
                    begin, _ = build_begin(table, strategy, start)
                    if isinstance(where, Path):
                        begin = build_entry(job, strategy, where, begin).q0
                    told = {"say": lambda text, title=title: say(f"{title}: {text}"), "keep_in": cells_file(title)}
                    if part and isinstance(where, PoseRange):
                        found = unique_region(strategy, begin, where, **told, **more).certificate
                    else:
                        found = certify(strategy, where, begin, **told, **more)
            except HolokinError as problem:
                cause = problem.__cause__ or problem
                if isinstance(cause, NoProofError):
                    yield title, cause.cure
                    continue
                if not isinstance(cause, (*OF_ONE_STRATEGY, ExpressionError)):
                    raise
                yield title, f"{problem.fact}; {problem.cure}" if isinstance(problem, JobError) else str(problem)
            else:
                yield title, found
