"""Options of the subcommands that ask about a robot, or a job, and its work."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class TaskKind(StrEnum):
    """What the tool must hold."""

    POSE = "pose"
    AXIS = "axis"
    POSITION = "position"


RobotOrJob = Annotated[
    str,
    typer.Argument(metavar="ROBOT|JOB", help="Catalogue name, model (.urdf, .xacro, .xml) or .toml file; or a job."),
]
Box = Annotated[
    str | None,
    typer.Option(help='Where the tool works: "X Y Z HX HY HZ", centre and half sides [m]; tool down.'),
]
Tilt = Annotated[
    float | None, typer.Option(min=0.0, max=180.0, help="With --box: how far the tool leans to all sides [degrees].")
]
Tip = Annotated[str | None, typer.Option(help="The link that is the tool; by default the palm of the arm.")]
Base = Annotated[str | None, typer.Option(help="The link that stands still; by default the root.")]
TrustUnits = Annotated[
    bool, typer.Option("--trust-units", help="The robot's numbers are in rad and m, whatever they look like.")
]
Task = Annotated[
    TaskKind | None, typer.Option(help="What the tool must hold: axis is its point and the direction of an axis.")
]
