"""`holokin sheets`: the fewest leaves that serve a workspace."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import Base, Box, RobotOrJob, Task, Tilt, Tip, TrustUnits, ending, show


def sheets(
    robot: RobotOrJob,
    box: Box = None,
    tilt: Tilt = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    task: Task = None,
    share: Annotated[
        float | None, typer.Option(help="Share to serve of the poses that the arm reaches; 0.995 by default.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(help="Poses of the workspace that are looked at; 4096 by default.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Seconds after which the search for leaves ends; 280 by default.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file to write, ending in .npz; with a picture of its name.")
    ] = None,
) -> None:
    """Find the fewest sheets that serve a workspace: leaves, each with the tool poses that it serves.

    Prints which share they serve and why the rest is not served, and writes them to a file that hk.read_sheets reads,
    by default the one that a job's [sheets] name or
    sheets-<robot>.npz, with a picture. Exits 0 if the share was reached, 1 if not, 2 on bad input.
    Ctrl-C ends the search; what was found is written.
    """
    from ..job.advice_job import question
    from ..job.sheets_job import sheets_command
    from ..report.plots import write_figure
    from ..report.sheets_plots import sheets_figure

    # The search, and the picture.
    given = {"share": share, "samples": samples, "seconds": seconds}
    options = {key: value for key, value in given.items() if value is not None}
    with ending().telling() as say:
        asked = question(
            robot,
            box=box,
            tilt=tilt,
            tip=tip,
            base=base,
            task=None if task is None else task.value,
            trust_units=trust_units,
        )
        result, file = sheets_command(robot, asked, out, options, say.tell, say.announce)
        picture = file.with_suffix(".png")
        say.tell("drawing")
        write_figure(lambda: sheets_figure(result.found), picture)
    # What was found.
    show("\n".join([*result.map_lines(), *result.path_lines()]))
    show(f"wrote {file} and {picture}")
    if not result.passed:
        raise typer.Exit(1)
