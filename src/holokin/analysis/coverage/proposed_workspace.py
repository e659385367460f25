"""What `advise` proposes where it is not told: a start, a workspace; and which poses of one any posture reaches."""

from __future__ import annotations

import numpy as np

from ...base.types import Array, Matrix, Vector
from ...motion.ik.reach import nearest_postures, surely_beyond
from ...path.workspaces import PoseRange
from ...path.workspaces import workspace as pose_range
from ...strategies.tasks.task import Task
from .coverage_result import Reach
from .starts import comfort, regular_starts

POSES = 64
"""Poses by which a workspace is proposed."""

SIDES = (0.15, 0.1, 0.07, 0.05)
"""Half sides of a workspace that is proposed, over the length of the arm: the first one nearly all in reach."""

NEARLY = 0.97
"""Share of its poses that are reached then within the joint limits, by some posture."""

TILT, SPIN = 0.25, 0.5
"""Its turns [rad]: those of a tool that follows a gently curved surface."""


def first_start(task: Task) -> Vector:
    """The most comfortable of the regular start postures."""
    found = regular_starts(task)
    return found[int(np.argmax([comfort(task, q) for q in found]))]


def proposed_workspace(task: Task, q0: Vector) -> PoseRange:
    """A box round the tool at a start posture, with turns about its orientation there."""
    robot, at = task.robot, task.pose(q0)
    length = sum(float(np.linalg.norm(joint.step)) for joint in robot.joints[1:]) or 1.0
    tilt, spin = (0.0, 0.0) if robot.planar or task.orientation is None else (TILT, SPIN)

    def box(side: float) -> PoseRange:
        half = side * length * np.array([1.0, 1.0, 0.0 if robot.planar else 1.0])
        return pose_range(box=(at[:3, 3].round(3), half.round(3)), rotation=at[:3, :3], tilt=tilt, spin=spin)

    for side in SIDES[:-1]:
        if reached(task, box(side).poses(POSES), q0)[1].within.mean() >= NEARLY:
            return box(side)
    return box(SIDES[-1])


def reached(task: Task, T: Array, start: Vector | None) -> tuple[Matrix, Reach]:
    """Postures (k, n) at poses (k, 4, 4), within the limits if there are such, NaN where there are none."""
    p, R = np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3])
    near = np.tile(regular_starts(task)[0] if start is None else start, (len(T), 1))
    Q, found_with = np.full_like(near, np.nan), {}
    rest = np.flatnonzero(~surely_beyond(task, p, R))
    for limits in (True, False):
        found_with[limits] = np.isfinite(Q).all(axis=1)
        if len(rest):
            found = nearest_postures(task, p[rest], R[rest], near[rest], limits=limits)
            Q[rest[found.reached]] = found.q[found.reached]
            found_with[limits][rest] = found.reached
            rest = rest[~found.reached]
    return Q, Reach(found_with[False], found_with[True])
