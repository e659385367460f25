"""Are joints in rad, and places in metres? What is far beyond all limits and all reach is in other units."""

from __future__ import annotations

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Array, ArrayLike, Matrix, Vector
from .joints import WOUND, foot_of
from .longest_span import LONGEST, longest_reach, mean_link, with_near_frames
from .model import Robot

FAR = 100.0
"""Reaches of an arm from its base at which a place is not in metres: millimetres make a thousand of one."""

TURN = 2 * np.pi * 1.001
"""Angles [rad] of a frame beyond which radians are doubted: a full turn more changes nothing."""

WIDEST = 4 * np.pi
"""Limits [rad] of most hinges at which radians are doubted: single joints turn further, no whole arm does."""

TRUST = ", or trust_units=True (--trust-units, trust_units = true of a robot in a file) if they are"
"""How to overrule a doubt, behind the cure."""

START = "choose another start posture, widen the limits by hk.with_limits, or ask with limits=False"
"""The cure of a start posture beyond the joint limits."""

SHARE = 10.0
"""Reaches of an arm at which a tool on it is not in metres."""


def start_posture(robot: Robot, q: ArrayLike, limits: bool, what: str = "the start posture") -> Vector:
    """q as (n,) finite floats: a posture to begin from, which keeps the joint limits unless `limits` is False.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: as `Robot.checked`. JointLimitError: with limits, a joint is beyond
        them; without, more than two turns beyond them, as degrees are.
    """
    start = robot.checked(q, what)
    if limits or robot.beyond(start).max() > WOUND:
        robot.check_limits(start, START)
    return start


def doubtful_unit(robot: Robot, places: Matrix, tip: str | None = None) -> str:
    """What to say of places (k, 3) that are all too far from the base to be in metres; empty of others."""
    away = places - foot_of(robot.joints, robot.tip(tip).joint)
    least, reach = float(np.linalg.norm(away, axis=-1).min()), longest_reach(robot, tip)
    if not FAR * reach < least < np.inf:
        return ""
    return f"at least {least:.4g} m from the base, where {robot.name} reaches {reach:.3g} m: give metres"


def check_metres(robot: Robot, poses: Array, tip: str | None = None) -> None:
    """Raises: ArgumentError where the poses (k, 4, 4) of a workspace are too far away to be in metres."""
    if said := doubtful_unit(robot, poses[:, :3, 3], tip):
        first = poses[0, :3, 3].tolist()
        raise ArgumentError("the position of the first pose of the workspace", first, f"all are {said}")


def check_radians(what: str, angles: Vector, overruled: str = "") -> None:
    """Raises: ArgumentError where an angle of a frame is over a turn, as degrees are; `overruled`: how to say so."""
    if (np.abs(angles) > TURN).any():
        cure = f"this looks like degrees: give radians, np.deg2rad(...){overruled}"
        raise ArgumentError(what, np.asarray(angles).tolist(), cure)


def plausible(robot: Robot) -> Robot:
    """The robot, as every reader finishes it, with its frames near its links.

    Raises:
        ArgumentError: it seems to be in millimetres, or its limits in degrees. What is asked are the links of each arm,
        wherever a file puts its frames on the axes, and the limits of its hinges.
    """
    lengths = np.abs([frame.placement[:3, 3] for frame in (*robot.joints, *robot.tips)])
    if lengths.max(initial=0.0) > LONGEST / 2:  # else the average is no longer
        for tip in robot.tips:
            if (length := mean_link(robot, tip)) > LONGEST:
                cure = f"this looks like millimetres: give metres{TRUST}"
                raise ArgumentError(f"the average link up to {tip.name!r} [m]", float(f"{length:.3g}"), cure)
        robot = with_near_frames(robot)
    check_limits_of_hinges(robot)
    return robot


def check_limits_of_hinges(robot: Robot) -> None:
    """Raises: ArgumentError where the limits of most hinges that have some are many turns, as degrees are."""
    hinges = [(abs(c.lower), abs(c.upper)) for c in robot.coordinates if c.unit == "rad"]
    widest = [max(ends) for pair in hinges if (ends := [v for v in pair if 0 < v < np.inf])]
    wide = sum(most > WIDEST for most in widest)
    if wide > 1 and 2 * wide > len(widest):
        fact = f"{wide} of {len(widest)} hinges turn by over two turns, which looks like degrees"
        cure = f"{fact}: give radians, np.deg2rad(...){TRUST}"
        raise ArgumentError(f"the widest limit of {robot.name!r} [rad]", max(widest), cure)


def check_tool(robot: Robot, xyz: Vector, tip: str | None = None) -> None:
    """Raises: ArgumentError where a tool is many times longer than the arm that carries it, as in millimetres."""
    reach, size = longest_reach(robot, tip), float(np.linalg.norm(xyz))
    if size > (max(SHARE * reach, 1.0) if np.isfinite(reach) else LONGEST):
        cure = f"this looks like millimetres, {robot.name} reaches {reach:.3g} m: give metres"
        raise ArgumentError("xyz of a tool", np.asarray(xyz).tolist(), cure)
