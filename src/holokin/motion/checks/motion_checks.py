"""`check`: limits, singularities, self-collision, the floor and obstacles, for a whole motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import not_negative, number
from ...robot import LinkShape, Robot, chain_length, with_capsules
from ...robot.capsules import SLENDER
from ...strategies.tasks.task import Task
from .check_report import CheckReport, Clearance, Finding, FindingKind
from .checked_samples import Motion, motion_of
from .joint_findings import limit_findings, singular_findings, unjudged_speeds
from .pairs import Pairs, pairs_of
from .posture_jumps import jump_findings, large_steps, self_motions
from .sweep import Swept, sweep

CLEARANCE = 0.01
"""What is wanted between links by default [m]: more than a robot's and its model's errors together, as a rule."""

RCOND = 0.01
"""Smallest over largest singular value of J below which a posture is told: rates are 100 times those elsewhere."""

_CAPSULES = "{} has no shapes: capsules of radius {:.3f} m from joint to joint stand for its links"


@typed
def check(
    motion: Any,
    robot: Robot,
    *,
    task: Task | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    obstacles: Sequence[LinkShape] = (),
    ignore: Sequence[tuple[str, str]] = (),
    limits: bool = True,
    margin: float = 0.0,
    rcond: float = RCOND,
) -> CheckReport:
    """Look at a motion for what a robot should not do: exceed limits, meet a singularity, touch itself or the floor.

    Distances are those of the robot's shapes: the <collision> elements of a URDF, the geoms of MJCF that collide, or
    capsules between the frames of the joints for a robot without any, see `with_capsules`. Meshes are their convex
    hulls, and where these are nearer than the clearance, themselves. Left out are parent and child in the robot's tree,
    links without shapes between counted out, pairs that touch at each of 200 random postures, and those of `ignore`.
    Links beside the chain stand where their joints are at zero, or at the `locked` value of `load`.

    What is found of distances holds for the whole motion, with the joints going straight from one sample to the next:
    between two postures with distances d and e, over which points move by S at most, the distance is at least
    (d + e - S) / 2, and the interval is halved until that tells. Limits and singularities are looked at at the samples.

    Args:
        motion: a Trajectory, a TimedTrajectory, a Recording, or postures (k, n).
        robot: whose motion it is.
        task: whose Jacobian must not be singular; None leaves singularities aside.
        floor: height of the floor z [m] in the frame of the base; None for no floor. What does not move stands on it.
        clearance: the least distance wanted [m].
        self_collision: whether links are held against each other.
        obstacles: shapes that stand still, see `obstacle`.
        ignore: pairs of names that may touch: of two links, of a link and an obstacle, or of a link and "floor"; "*"
            stands for all others.
        limits: whether limits of the joints are looked at: of position and speed, and of a TimedTrajectory those of
            acceleration and jerk.
        margin: how far joints must keep from limits of their positions [joint units].
        rcond: the least that the smallest singular value of J over the largest may be.

    Returns:
        All that was found, and all that was not looked at.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: it is no motion of this robot; a floor or obstacles for
            `coordinates`, which have no links. UnknownNameError: no such link.
        MissingExtraError: coal is not installed, and shapes other than capsules meet.
    """
    found = motion_of(motion, robot)
    if not len(found.t):
        raise ArgumentError("the samples of the motion", 0, "give at least one")
    wanted, edge = not_negative("clearance", clearance), not_negative("margin", margin)
    level = None if floor is None else number("floor", floor)
    if level is not None and not np.isfinite(level):
        raise ArgumentError("floor", level, "give its height in m, or None")
    remarks = list(found.remarks)
    findings: list[Finding] = []
    if limits:
        findings += limit_findings(robot, found, edge)
        remarks += unjudged_speeds(robot, found)
    seen: list[str] = []
    jumps: list[Finding] | None = None
    if task is not None:
        J = task.jacobian_batch(found.q)[0]
        findings += singular_findings(task, found, J, not_negative("rcond", rcond))
        if task.spatial:
            jumps = list(jump_findings(task, found))
            findings += jumps
            seen += self_motions(task, found, J)
    else:
        remarks.append("singularities were not looked at: no task was given")
    seen += large_steps(robot, found, jumps)
    swept: list[Swept] = []
    pairs = Pairs((), (), (), (), wanted)
    if level is not None or obstacles:
        robot.check_links()
    if not robot.tips:
        remarks.append(f"{robot.name} has no links: distances were not looked at")
    elif self_collision or level is not None or obstacles:
        if all(shape.obstacle for shape in robot.shapes):
            robot = with_capsules(robot)
            remarks.append(_CAPSULES.format(robot.name, chain_length(robot) / SLENDER))
        pairs = pairs_of(
            robot, obstacles, found.q, clearance=wanted, floor=level, self_collision=self_collision, ignore=ignore
        )
        swept = sweep(robot, pairs.gaps, found.q, pairs.limits)
        findings += _distance_findings(found, swept, pairs)
    near = [
        Clearance(one.gap.names, one.least, _time(found, one.least_at), one.bound, limit)
        for one, limit in sorted(zip(swept, pairs.limits, strict=True), key=lambda pair: pair[0].least)
    ]
    return CheckReport(
        tuple(sorted(findings, key=lambda f: (f.start, f.time))), len(found.t), float(found.t[-1] - found.t[0]), wanted,
        tuple(near), pairs.left_out, pairs.unseen, tuple(remarks), tuple(seen),
    )  # fmt: skip


def _distance_findings(motion: Motion, swept: Sequence[Swept], pairs: Pairs) -> Iterator[Finding]:
    for one, limit in zip(swept, pairs.limits, strict=True):
        for first, last, least, at in one.stretches(limit):
            kind = FindingKind.COLLISION if least <= 0 else FindingKind.CLEARANCE
            times = (_time(motion, first), _time(motion, last), _time(motion, at))
            yield Finding(kind, one.gap.names, *times, int(at), least, limit, "m")


def _time(motion: Motion, s: float) -> float:
    return float(np.interp(s, np.arange(len(motion.t)), motion.t))
