"""`holokin new`: writes a job file to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...base.errors import ArgumentError
from .outcome import Base, MaybeRobot, Tip, TrustUnits, show


def new(
    file: Annotated[Path, typer.Argument(help="The job file to write, ending in .toml.")],
    template: Annotated[
        str | None, typer.Option("--from", help="The packaged job to copy; by default panda-circle.")
    ] = None,
    robot: MaybeRobot = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
) -> None:
    """Write a job file of your own: a copy of a packaged one, or a small circle for a robot, given by --robot."""
    from ..job import new_job, new_job_for

    if robot is not None and template is not None:
        raise ArgumentError("--robot beside --from", template, "give one of them")
    for option, link in (("--tip", tip), ("--base", base)):
        if robot is None and link is not None:
            raise ArgumentError(f"{option} without --robot", link, "give the robot, too")
    if robot is not None:
        new_job_for(file, robot, tip, base, trust_units)
    else:
        new_job(file, template or "panda-circle")
    show(f"wrote {file}; edit it, then: holokin run {file}")
