"""Frames of a robot's joints at many postures at once, in NumPy: without CasADi and without a compiler."""

from __future__ import annotations

import numpy as np

from ..base.types import Array, Matrix
from .model import Robot
from .tree import turn_matrix

Frames = list[tuple[Matrix, Array]]
"""(positions (k, 3), rotations (k, 3, 3)) of frames at k postures."""


def joint_frames(robot: Robot, Q: Matrix) -> Frames:
    """The moving frame of every joint in the base frame, at postures Q (k, n)."""
    frames: Frames = []
    for joint in robot.joints:
        p, R = placed(frames, joint.parent, joint.placement, len(Q))
        value = joint.multiplier * Q[:, joint.coordinate] + joint.offset
        if joint.kind == "prismatic":
            p = p + (R @ joint.axis) * value[:, None]
        else:
            R = R @ turn_matrix(joint.axis, value)
        frames.append((p, R))
    return frames


def placed(frames: Frames, joint: int, T: Matrix, count: int) -> tuple[Matrix, Array]:
    """A frame T (4, 4) on a joint's moving side (joint -1: the base), at all `count` postures."""
    if joint < 0:
        return np.broadcast_to(T[:3, 3], (count, 3)), np.broadcast_to(T[:3, :3], (count, 3, 3))
    p, R = frames[joint]
    return p + R @ T[:3, 3], R @ T[:3, :3]
