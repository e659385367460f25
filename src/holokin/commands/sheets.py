"""`holokin sheets`: the fewest leaves that serve a workspace."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .advise import TaskKind
from .outcome import ending, show


def sheets(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|JOB", help="Catalogue name, model (.urdf, .xacro, .xml) or .toml file; or a job."
        ),
    ],
    workspace: Annotated[
        str | None,
        typer.Option(help='Like "box X Y Z HX HY HZ tilt DEG spin DEG", or a .toml or .csv file: docs/workspaces.md.'),
    ] = None,
    tip: Annotated[str | None, typer.Option(help="The link that is the tool; by default the palm of the arm.")] = None,
    base: Annotated[str | None, typer.Option(help="The link that stands still; by default the root.")] = None,
    task: Annotated[
        TaskKind | None, typer.Option(help="What the tool must hold: axis is its point and the direction of an axis.")
    ] = None,
    tool: Annotated[str | None, typer.Option(help='The tool on the tip, "X Y Z rpy R P Y" in m and degrees.')] = None,
    base_pose: Annotated[
        str | None, typer.Option(help='Where the base of the robot stands, "X Y Z rpy R P Y" in m and degrees.')
    ] = None,
    limit: Annotated[
        list[str] | None, typer.Option(help='Other limits of a joint, "JOINT LOWER UPPER"; may be given again.')
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="--limit is in degrees and m.")] = False,
    floor: Annotated[float | None, typer.Option(help="Height of the floor [m].")] = None,
    obstacle: Annotated[
        list[str] | None,
        typer.Option(help='Like "table box X Y Z SX SY SZ" (centre, sides) [m]; may be given again.'),
    ] = None,
    share: Annotated[
        float | None, typer.Option(help="Share to serve of the poses that the arm reaches; 0.995 by default.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(help="Poses of the workspace that are looked at; 1024 by default.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Seconds after which the search for leaves ends; 180 by default.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file to write, ending in .npz; with a picture of its name.")
    ] = None,
) -> None:
    """Find the fewest sheets that serve a workspace: leaves on which the joints are a function of the tool pose.

    Prints which share they serve and why the rest is not served, and writes them to a file that hk.read_sheets reads,
    by default sheets-<robot>.npz, with a picture. Exits 0 if the share was reached, 1 if not, 2 on bad input.
    Ctrl-C ends the search; what was found is written.
    """
    from ..job.advice_question import Typed
    from ..job.sheets_job import sheets_command
    from ..output.plots import write_figure
    from ..output.sheets_plot import sheets_figure

    typed = Typed(
        workspace, tip, base, task.value if task else None, None, None, degrees, tool, base_pose, tuple(limit or ()),
        floor, tuple(obstacle or ()),
    )  # fmt: skip
    given = {"share": share, "samples": samples, "seconds": seconds}
    options = {key: value for key, value in given.items() if value is not None}
    with ending().telling() as say:
        found, file, wanted, along = sheets_command(robot, typed, out, options, say, say.announce)
        picture = file.with_suffix(".png")
        say("drawing")
        write_figure(lambda: sheets_figure(found), picture)
    show(str(found))
    if along is not None:
        show(f"the job's path: {along}")
    show(f"wrote {file} and {picture}")
    if found.share < wanted:
        raise typer.Exit(1)
