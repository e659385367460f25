"""`holokin advise`: finds the law for a robot and its work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import ending, show, show_rich


def advise(
    robot: Annotated[str, typer.Argument(help="Catalogue name, model (.urdf, .xacro, .xml) or .toml file.")],
    workspace: Annotated[
        str | None,
        typer.Option(help='Like "box X Y Z HX HY HZ tilt DEG spin DEG", or a .toml or .csv file: docs/workspaces.md.'),
    ] = None,
    tip: Annotated[str | None, typer.Option(help="The link that is the tool; by default the palm of the arm.")] = None,
    base: Annotated[str | None, typer.Option(help="The link that stands still; by default the root.")] = None,
    position: Annotated[bool, typer.Option("--position", help="The tool's orientation is free.")] = False,
    q0: Annotated[
        str | None, typer.Option(help="The posture to begin at, in rad and m, like '0 -0.8 0 -2.4 0 1.6 0.8'.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The job file to write, ending in .toml; with a picture of its name.")
    ] = None,
) -> None:
    """Find the law for a robot and its work: all that fit are compared on a workspace.

    Prints a table and why the best law is, and writes a job with it, by default advice-<robot>.toml, and a picture.
    Exits 0 when that is done, 2 on bad input.
    """
    from ..job.advice_job import advise_command
    from ..output.advice_report import advice_figure, print_advice
    from ..output.plots import write_figure

    with ending().telling() as say:
        task = "position" if position else None
        found, write = advise_command(robot, workspace, tip, base, task, q0, out, say, say.announce)
        show_rich(lambda console: print_advice(found, console))
        say("trying the job")
        job = write()
        picture = job.with_suffix(".png")
        say("drawing")
        write_figure(lambda: advice_figure(found), picture)
    show(f"wrote {job} and {picture} after {found.seconds:.0f} s; then: holokin run {job}")
