"""`approach`: from any posture to the start of a path."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, PathError, SingularityError
from ..base.poses import pose_from
from ..base.tolerances import TOLERANCES
from ..base.types import ArrayLike, Matrix, Vector, positive, whole
from ..path import Path, line_segment
from ..path.straight_path import straight
from ..strategies import HolonomicStrategy, Strategy
from ..strategies.tasks.task import of_one_tool
from .follow_path import follow
from .ik.leaf import leaf_value, move_to_leaf
from .ik.posture_search import all_postures
from .ik.reach import nearest_postures
from .trajectory import Measures, Status, Trajectory

Way = Literal["joints", "tool"]
"""What goes straight: the joints, or the tool."""

NEAR = 1e-12
"""Way [m or rad] that is none."""


@typed
def approach(
    strategy: Strategy,
    path: Path,
    q0: ArrayLike,
    *,
    by: Way = "joints",
    level: ArrayLike | None = None,
    samples: int = 100,
    speed: float = 0.5,
) -> Trajectory:
    """From any posture to one with the tool at the start of a path: `follow(strategy, path, approach(...).q[-1])`.

    The posture that is gone to is the one to which the strategy leads along the straight line of the tool: on the leaf
    through q0, or on the leaf asked for, to which the self-motion leads first. Where no straight line leads there, it
    is the nearest one that is found on the leaf; of a strategy without leaves, at the pose.

    Args:
        by: "joints" moves all joints evenly, as a robot's point-to-point motion does, wherever the tool then goes;
            "tool" moves the tool along the straight line.
        level: c (r,) of a strategy with leaves, as of `move_to_leaf`.
        samples: steps, at least. speed: of the fastest joint [joint units per s].

    Raises:
        PathError, SingularityError: the start of the path was not reached; by="tool": not along the straight line.
        JointLimitError: q0 is outside the limits. ArgumentError, ShapeError, NotFiniteError.
    """
    if by not in get_args(Way):
        raise ArgumentError("by", by, f"use one of {', '.join(get_args(Way))}")
    task, count = strategy.task, whole("samples", samples)
    of_one_tool(task, "an approach")
    robot = task.robot
    start = robot.checked(q0, "the start posture")
    robot.check_limits(start)
    positive("speed", speed, "give a positive speed of the joints")
    if level is not None and not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("level", level, f"{strategy.name!r} has none: leave it out, or {HolonomicStrategy.cure}")
    rows = [start]
    if level is not None and isinstance(strategy, HolonomicStrategy):
        at = leaf_value(strategy, start)
        far = strategy.constraint.nearest(leaf_value(strategy, move_to_leaf(strategy, start, level)) - at)
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            rows.append(move_to_leaf(strategy, rows[-1], at + share * far))
    pose = task.pose(rows[-1])
    rotation = pose[:3, :3] if path.rotation is None else path.rotation
    way = straight(pose[:3, 3], pose[:3, :3], path.start, rotation)
    if np.abs(task.error(rows[-1], path.start, rotation)).max() <= NEAR:
        reached = np.array(rows)
    else:
        entry = Path((line_segment(pose[:3, 3], path.start, way.turn),), rotation=pose[:3, :3])
        try:
            reached = np.array([*rows[:-1], *follow(strategy, entry, rows[-1], samples=count).q])
        except (PathError, SingularityError):
            goal = _found(strategy, path.start, rotation, rows[-1]) if by == "joints" else None
            if goal is None:
                raise
            reached = np.array([start, goal])
    if by == "joints":
        reached = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (reached[-1] - start)
        reached[0] = start
    robot.check_limits(reached[-1])
    return _recorded(strategy, reached, speed)


def _found(strategy: Strategy, p: Vector, R: Matrix, near: Vector) -> Vector | None:
    """The posture nearest to another (n,) of those found at a pose, on the same leaf; None if there is none."""
    task = strategy.task
    if isinstance(strategy, HolonomicStrategy):
        found = all_postures(strategy, pose_from(p, R), leaf_value(strategy, near), limits=True, near=near).q
        return found[np.argmin(np.abs(found - near).max(axis=1))] if len(found) else None
    nearest = nearest_postures(task, p[None], R[None], near[None], limits=True)
    return nearest.q[0] if nearest.reached[0] and nearest.missing[0] <= TOLERANCES.start else None


def _recorded(strategy: Strategy, q: Matrix, speed: float) -> Trajectory:
    """Postures (k, n) one after the other, the fastest joint at a speed."""
    task = strategy.task
    moves = np.abs(np.diff(q, axis=0)).max(axis=1)
    q = q[np.concatenate([[True], moves > NEAR])]
    steps = np.abs(np.diff(q, axis=0)).max(axis=1) / speed
    t = np.concatenate([[0.0], np.cumsum(steps)])
    rates = np.vstack([np.diff(q, axis=0) / steps[:, None], np.zeros((1, task.n))])
    if len(q) > 1:
        rates[-1] = rates[-2]

    def sigma(samples: int) -> Vector:
        return np.asarray(np.linalg.svd(task.jacobian_batch(q[:samples])[0], compute_uv=False)[:, -1], dtype=float)

    measures = Measures(
        dq=lambda samples: rates[:samples], x=lambda samples: task.value_batch(q[:samples]),
        error=lambda samples: np.zeros((samples, task.m)), sigma=sigma, residual=np.zeros,
    )  # fmt: skip
    return Trajectory(
        joint_names=task.robot.joint_names, joint_units=tuple(c.unit for c in task.robot.coordinates),
        row_names=task.row_names, row_units=task.units, t=t, q=q, marks=(0, len(q) - 1) if len(q) > 1 else (0,),
        status=Status.COMPLETE, measures=measures,
    )  # fmt: skip
