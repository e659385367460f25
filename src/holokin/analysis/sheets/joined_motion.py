"""Trajectories of pieces joined with the tool at rest: along a path on a sheet, and at one pose between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Matrix, Value, Vector
from ...motion.trajectory import Measures, Status, Trajectory
from ...strategies.tasks.task import Task
from .still_motion import StillMotion


@dataclass(frozen=True, eq=False)
class Stage(Value):
    """A piece of a motion: times t (k,) [s] from 0, joints q and rates dq (k, n), wanted poses (k, 4, 4), |g - c| (k,).

    corners: samples within it at which the tool's direction jumps.
    """

    t: Vector
    q: Matrix
    dq: Matrix
    poses: Array
    residual: Vector
    corners: tuple[int, ...] = ()

    @classmethod
    def still(cls, pose: Matrix, motion: StillMotion) -> Stage:
        """That of a motion with the tool still at a pose (4, 4)."""
        k = len(motion.t)
        dq = np.gradient(motion.q, motion.t, axis=0) if k > 1 else np.zeros_like(motion.q)
        return cls(motion.t, motion.q, dq, np.repeat(pose[None], k, axis=0), np.zeros(k))


def still_trajectory(task: Task, pose: Matrix, motion: StillMotion) -> Trajectory:
    """That of a motion with the tool still at a pose (4, 4)."""
    return joined(task, [Stage.still(pose, motion)])


def joined(task: Task, stages: Sequence[Stage]) -> Trajectory:
    """Stages one after the other, each beginning at the posture with which the one before ends; between them all rests.

    The sample between two stages is that of the later one.
    """
    t = [one.t for one in stages]
    starts = np.concatenate([[0.0], np.cumsum([one[-1] for one in t])])
    first = np.concatenate([[0], np.cumsum([len(one) - 1 for one in t])]).astype(int)

    def put(parts: Sequence[Array]) -> Array:
        return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]])

    corners = set(first[1:-1].tolist())
    corners |= {int(a) + c for a, stage in zip(first, stages, strict=False) for c in stage.corners}
    joints, rates = put([one.q for one in stages]), put([one.dq for one in stages])
    T, off, robot = put([one.poses for one in stages]), put([one.residual for one in stages]), task.robot
    measures = Measures(
        dq=lambda k: rates[:k],
        x=lambda k: task.value_batch(joints[:k]),
        error=lambda k: task.error(joints[:k], T[:k, :3, 3], T[:k, :3, :3]),
        sigma=lambda k: np.asarray(
            np.linalg.svd(task.jacobian_batch(joints[:k])[0], compute_uv=False)[:, -1], dtype=float
        ),
        residual=lambda k: off[:k],
    )
    return Trajectory(
        robot.joint_names, tuple(c.unit for c in robot.coordinates), task.row_names, task.units,
        put([one + start for one, start in zip(t, starts, strict=False)]), joints, (0, len(joints) - 1),
        Status.COMPLETE, measures, tuple(sorted(corners)),
    )  # fmt: skip
