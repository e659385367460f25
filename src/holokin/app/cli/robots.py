"""`holokin robots`: lists the catalogue, the chains of a model, or the joints and tool frames of one robot."""

from __future__ import annotations

from typing import Annotated

import typer

from .outcome import Base, MaybeRobotOrJob, TrustUnits, show


def robots(
    robot: MaybeRobotOrJob = None,
    tip: Annotated[
        list[str] | None, typer.Option(help="Of a model: describe the robot that ends here; may be given again.")
    ] = None,
    base: Base = None,
    trust_units: TrustUnits = False,
) -> None:
    """List the robots of the catalogue with joints and reach, the chains of a model, or what one robot is.

    Of a model it lists the tips and the joints that lead there; with --tip, and of other robots and of jobs, it says
    what this robot is.
    The reach is the largest distance of the (first) tip from the base's origin within the joint limits, as computed.
    """
    from ...base.errors import ArgumentError
    from ...robot import catalogue, is_model, load, model_tips, reach
    from ..job import robot_of_file
    from ..report.advice_report import robot_section

    # The catalogue, the chains of a model, or one robot.
    if robot is None:
        if tip or base:
            raise ArgumentError("--tip or --base", tip or base, "give the file of a model, too")
        for name, source in catalogue().items():
            arm = load(name)
            show(f"{name:13} {arm.n:2} joints   reach {reach(arm):6.3f} m   {source}")
    elif is_model(robot) and not tip:
        for end, joints in model_tips(robot, base).items():
            show(f"{end}: {len(joints)} moving joints{': ' if joints else ''}{', '.join(joints)}")
    else:
        show(str(robot_section(robot_of_file(robot, tip, base, trust_units))))
