"""`holokin advise`: finds the strategy for a robot and its work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import Base, Box, RobotOrJob, Task, Tilt, Tip, TrustUnits, ending, show, show_rich


def advise(
    robot: RobotOrJob,
    box: Box = None,
    tilt: Tilt = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    task: Task = None,
    levels: Annotated[
        bool, typer.Option("--levels", help="Also say which levels of the best strategy serve the workspace.")
    ] = False,
    any_start: Annotated[
        bool, typer.Option("--any-start", help="Of a job: it may begin in another posture, with the tool where it was.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="The job file to write, ending in .toml; with a picture of its name.")
    ] = None,
) -> None:
    """Find the strategy for a robot and its work: all that fit are compared on a workspace.

    Of a job it takes the robot, its tool and mounting, the task, the start, the path or the workspace, and the
    obstacles. Prints a table and why the best is, and writes a job with it, by default advice-<robot>.toml, and a
    picture. Exits 0 when that is done, 2 on bad input.
    """
    from ..job.advice_job import advise_command, proof_command, question
    from ..report.advice_report import advice_figure, print_advice
    from ..report.plots import write_figure

    # The comparison, and the job that is written and tried.
    with ending().telling() as say:
        asked = question(
            robot,
            box=box,
            tilt=tilt,
            tip=tip,
            base=base,
            task=None if task is None else task.value,
            trust_units=trust_units,
            any_start=any_start,
        )
        advice, write = advise_command(robot, asked, out, say, say.announce, levels)
        show_rich(lambda console: print_advice(advice, console))
        say("trying the job")
        job, remark = write()
        picture = job.with_suffix(".png")
        say("drawing")
        write_figure(lambda: advice_figure(advice, asked.shown), picture)
    # What to do next.
    if remark:
        show(f"  Note: {remark}")
    show(f"wrote {job} and {picture} after {advice.seconds:.0f} s; then: holokin run {job}")
    if proof := proof_command(advice, asked, job):
        show(f"certify it by: {proof}")
