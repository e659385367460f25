"""`holokin run`: does jobs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...base.errors import ArgumentError
from ...version import build
from .outcome import ending, print_as, show, show_rich

if TYPE_CHECKING:
    from ..job import Job


def run(
    jobs: Annotated[
        list[str], typer.Argument(metavar="JOB...", help="Packaged jobs (`holokin jobs`), 'paper', or .toml files.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out"),
    units: Annotated[
        str | None, typer.Option(help='Print in these units: "degrees", "mm" or "degrees,mm"; by default rad and m.')
    ] = None,
    animate: Annotated[bool, typer.Option("--animate", help="Make films of the two paths and of the cycles.")] = False,
) -> None:
    """Do jobs: a table each in the terminal, figures, trajectories and a report in OUT/<job>/.

    Exits 0 when every expectation of every job holds, 1 when one fails, 2 when a strategy cannot be run, after the
    others have been, and on bad input: of the command or of a job file before anything runs, else of the jobs that
    cannot be done or written, after the others have been; 3 where holokin itself failed at one.
    """
    from ...base.units import printed_units
    from ..job import run_job, run_paths
    from ..report.animation import animate as draw
    from ..report.job_report import print_result, write_report
    from ..report.job_result import check_folder
    from ..report.paths_report import print_paths, write_paths_report

    # All jobs are read before anything runs.
    opened, code = _opened(jobs), 0
    if units is not None:
        printed_units(units)
        opened = [(name, job.model_copy(update={"units": units}), file) for name, job, file in opened]
    for name, _, _ in opened:
        check_folder(out, name)
    # One after the other; whatever happens to one, the others are done.
    for name, job, file in opened:
        print_as(job, file)
        with ending().telling(name) as say:
            try:
                if job.paths:
                    several = run_paths(name, job, file, say)
                    folder = write_paths_report(several, out, build())
                    show_rich(lambda console, several=several: print_paths(several, console))
                    show(f"  {several.seconds:.1f} s, report: {folder / 'report.html'}\n")
                    code = max(code, several.exit_code)
                    continue
                result = run_job(name, job, file, say)
                say("drawing")
                extra = (lambda folder, result=result, say=say: draw(result, folder, say)) if animate else None
                folder = write_report(result, out, build(), extra)
                show_rich(lambda console, result=result: print_result(result, console))
                show(f"  {result.seconds:.1f} s, report: {folder / 'report.html'}\n")
                code = max(code, result.exit_code)
            except Exception as problem:  # noqa: BLE001  whatever happens to one job, the others are done
                ending().check()
                code = max(code, ending().tell(problem, name if len(opened) > 1 else ""))
    raise typer.Exit(code)


def _opened(names: list[str]) -> list[tuple[str, Job, Path]]:
    """(short name, job, file) of each job, once. Raises: ArgumentError when two would write one folder."""
    from ..job import expand, open_job

    unique: dict[str, tuple[str, Job, Path]] = {}
    for name, job, file in map(open_job, expand(names)):
        other = unique.setdefault(name.casefold(), (name, job, file))[2]
        if other.absolute() != file.absolute():
            cure = f"{other} and {file} would write into one folder: rename one, or run them with an --out each"
            raise ArgumentError("the name of two jobs", name, cure)
    return list(unique.values())
