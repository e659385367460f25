"""`with_limits`: a robot with limits of its joints that its model does not have, or with others than it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, ShapeError
from ..base.types import ArrayLike, Vector, numbers, one_or_each
from .model import Robot
from .units import TRUST, check_limits_of_hinges

FASTEST = 50.0
"""Speed [rad/s, m/s] beyond which a limit is doubted: eight turns a second; limits in deg/s are beyond it."""

GIVE_SPEEDS = "give the robot its limits: hk.with_limits(robot, max_velocity=...), or max_velocity in [robot] of a job"
"""What to do about a joint without a speed limit."""

JointValues = ArrayLike | Mapping[str, float]
"""One number for all joints, one for each (n,), or those of some joints by name."""


@typed
def with_limits(
    robot: Robot,
    *,
    lower: JointValues | None = None,
    upper: JointValues | None = None,
    max_velocity: JointValues | None = None,
    trust_units: bool = False,
) -> Robot:
    """The robot with other limits of its joints; those that are not given stay. `math.inf` is no limit.

    MJCF has no speed limits, and DH tables and URDFs of users often lack them; whatever times a motion needs them. The
    limits that a follower has of its own are not looked at again.

    Args:
        lower, upper: positions [rad; m of a prismatic joint]: one number for all joints, one for each (n,), or a
            mapping from the names of some.
        max_velocity: speeds [rad/s; m/s], likewise.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        ArgumentError: lower above upper, a speed that is not positive, or limits that seem to be in degrees:
        a hinge of more than 50 rad/s, or most hinges of more than two turns.
        UnknownNameError: a joint that there is not. ShapeError: not one number for each joint.
    """
    given = {"lower": lower, "upper": upper, "max_velocity": max_velocity}
    known = {what: _each(robot, what, value) for what, value in given.items() if value is not None}
    rows = [{what: float(values[i]) for what, values in known.items()} for i in range(robot.n)]
    limited = tuple(replace(c, **row) for c, row in zip(robot.coordinates, rows, strict=True))
    found = replace(robot, coordinates=limited)
    for c, before in zip(limited, robot.coordinates, strict=True):
        doubted = FASTEST < c.max_velocity < np.inf and c.max_velocity != before.max_velocity
        if doubted and c.unit == "rad" and not trust_units:
            cure = f"give rad/s, as np.deg2rad({c.max_velocity:g}), math.inf for none{TRUST}"
            raise ArgumentError(f"max_velocity of joint {c.name!r}", f"{c.max_velocity:g} rad/s", cure)
    if not trust_units and (lower is not None or upper is not None):
        check_limits_of_hinges(found)
    return found


def without_speed_limit(robot: Robot) -> str:
    """The joints that have no speed limit, in words; empty where all have one. With one of them no time is known."""
    names = [name for name, most in zip(robot.joint_names, robot.max_velocity, strict=True) if not np.isfinite(most)]
    return ", ".join(names)


def speed_limits(robot: Robot, cure: str = GIVE_SPEEDS) -> Vector:
    """The speed limits (n,) of all joints. Raises: ArgumentError: a joint has none; `cure` says what else may be given.

    Whatever turns a motion into time asks here: without the limit of one joint, no time of the motion is known.
    """
    if missing := without_speed_limit(robot):
        raise ArgumentError(f"the speed limit of {missing} of {robot.name!r}", None, cure)
    return robot.max_velocity


def _each(robot: Robot, what: str, value: JointValues) -> Vector:
    """(n,) of a number, of n numbers, or of those of some joints, where the others stay."""
    if isinstance(value, Mapping):
        values = getattr(robot, what).copy()
        for name, one in value.items():
            values[robot.joint_index(name)] = _number(f"{what} of joint {name!r}", one)
        return values
    return one_or_each(what, value, robot.n).copy()


def _number(what: str, value: float) -> float:
    found = numbers(what, value)
    if found.shape != ():
        raise ShapeError(what, "()", found.shape)
    return float(found)
