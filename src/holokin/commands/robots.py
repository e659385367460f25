"""`holokin robots`: lists the catalogue, or the chains of a model."""

from __future__ import annotations

from typing import Annotated

import typer

from .outcome import show


def robots(
    model: Annotated[
        str | None,
        typer.Argument(help="A URDF, xacro or MJCF file: list its tips and the joints that lead there."),
    ] = None,
) -> None:
    """List the robots of the catalogue with joints and reach, or the chains of a model.

    The reach is the largest distance of the (first) tip from the base's origin within the joint limits, as computed.
    """
    from ..robot import catalogue, load, model_tips, reach

    if model is not None:
        for tip, joints in model_tips(model).items():
            show(f"{tip}: {len(joints)} moving joints{': ' if joints else ''}{', '.join(joints)}")
        return
    for name, source in catalogue().items():
        robot = load(name)
        show(f"{name:12} {robot.n:2} joints   reach {reach(robot):6.3f} m   {source}")
