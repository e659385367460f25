"""The coverage of a workspace by one law, piece by piece, as points to draw."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...analysis.coverage import Coverage, coverage
from ...base.errors import HolokinError
from ...base.types import Matrix, Vector
from ...path.workspaces import Workspace, pose_cloud, workspace
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from .states import Cloud, CloudStatus

PIECE = 32
"""Poses between two looks at whether to go on: some 50 ms where the arm is searched for other postures."""

SHARE, LEAST, MOST = 0.5, 0.1, 0.6
"""Half sides of the box that is looked at by default, as a share of the tool's distance from the base; [m]; [m]."""


def default_workspace(task: Task, home: Vector) -> Workspace:
    """A box of tool positions about the tool at a posture (n,), with the rotation that it has there."""
    tool = task.pose(home).reshape(-1, 4, 4)[0]
    half = np.full(3, np.clip(SHARE * float(np.linalg.norm(tool[:3, 3])), LEAST, MOST))
    if task.robot.planar:
        half[2] = 0.0
    return workspace(box=(tool[:3, 3], half), rotation=tool[:3, :3])


def covered(
    strategy: HolonomicStrategy, name: str, q0: Vector, region: Workspace, samples: int, limits: bool,
    tell: Callable[[Cloud], bool],
) -> None:  # fmt: skip
    """The coverage of a workspace by the leaf through a posture (n,); `tell` hears of each piece, and says to go on."""
    try:
        poses = region.poses(samples)
        parts: list[Coverage] = []
        if not tell(_cloud(name, parts, len(poses), CloudStatus.RUNNING)):
            return
        for first in range(0, len(poses), PIECE):
            some = poses[first : first + PIECE]
            parts.append(coverage(strategy, pose_cloud(some), q0, samples=len(some), limits=limits))
            ended = CloudStatus.RUNNING if first + PIECE < len(poses) else CloudStatus.DONE
            if not tell(_cloud(name, parts, len(poses), ended)):
                return
    except HolokinError as problem:
        tell(failed_cloud(name, str(problem)))


def _cloud(name: str, parts: list[Coverage], total: int, status: CloudStatus) -> Cloud:
    """What the pieces so far show."""
    if not parts:
        none = np.zeros(0)
        return Cloud(name, 0, total, status, "", np.zeros((0, 3)), none > 0, none, none, none.astype(int))
    poses, q = np.concatenate([part.poses for part in parts]), np.concatenate([part.q for part in parts])
    why = np.concatenate([part.status for part in parts])
    reached = np.concatenate([part.reached for part in parts])
    margin = np.where(reached, _margins(q, parts[0].lower, parts[0].upper), np.nan)
    rcond = np.where(reached, np.concatenate([part.rcond for part in parts]), np.nan)
    return Cloud(name, len(poses), total, status, "", poses[:, :3, 3].copy(), reached, margin, rcond, why)


def failed_cloud(name: str, sentence: str) -> Cloud:
    """That of a coverage that could not be found."""
    none = np.zeros(0)
    return Cloud(name, 0, 0, CloudStatus.FAILED, sentence, np.zeros((0, 3)), none > 0, none, none, none.astype(int))


def _margins(q: Matrix, lower: Vector, upper: Vector) -> Vector:
    """Least distance to a joint limit over half the joint's range (k,): 1 in the middle of all; 1 without limits."""
    half = (upper - lower) / 2
    bounded = np.isfinite(half) & (half > 0)
    shares = np.minimum(q - lower, upper - q)[:, bounded] / half[bounded]
    return shares.min(axis=1, initial=1.0)
