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
WorkspaceWords = Annotated[
    str | None,
    typer.Option(help='Like "box X Y Z HX HY HZ tilt DEG spin DEG", or a .toml or .csv file: docs/workspaces.md.'),
]
Tip = Annotated[str | None, typer.Option(help="The link that is the tool; by default the palm of the arm.")]
Base = Annotated[str | None, typer.Option(help="The link that stands still; by default the root.")]
TrustUnits = Annotated[
    bool, typer.Option("--trust-units", help="The robot's numbers are in rad and m, whatever they look like.")
]
Task = Annotated[
    TaskKind | None, typer.Option(help="What the tool must hold: axis is its point and the direction of an axis.")
]
Tool = Annotated[str | None, typer.Option(help='The tool on the tip, "X Y Z rpy R P Y" in m and degrees.')]
BasePose = Annotated[
    str | None, typer.Option(help='Where the base of the robot stands, "X Y Z rpy R P Y" in m and degrees.')
]
JointLimits = Annotated[
    list[str] | None, typer.Option(help='Other limits of a joint, "JOINT LOWER UPPER"; may be given again.')
]
Floor = Annotated[float | None, typer.Option(help="Height of the floor [m].")]
Obstacles = Annotated[
    list[str] | None,
    typer.Option(help='Like "table box X Y Z SX SY SZ" (centre, sides) [m]; may be given again.'),
]
