"""The functions that make a task: position, pose, relative pose, line of sight, custom, its tool moved.

Representations of orientation are in `frame_task.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RowsError, UnknownNameError, shown
from ...base.types import ArrayLike, Vector, finite
from ...robot import Robot
from ...symbolic import SX, norm_2
from ...symbolic.rotations import frame_about, log_s2
from .frame_task import ORIENTATIONS, UP, FrameTask, Orientation, stack
from .task import ExpressionFrame, Frame, RelativeFrame, Task, TipFrame, chosen_rows

Axis = Literal["x", "y", "z"]
"""An axis of the tool by its name."""

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": UP}


@typed
def position(robot: Robot, tip: str | None = None, *, rows: Sequence[int] | None = None) -> Task:
    """The tool's position: m = 3, or m = 2 for a planar robot; or some `rows` of it.

    Raises:
        RowsError, UnknownNameError, ArgumentError.
    """
    robot.pose(np.zeros(robot.n), tip)
    every = (0, 1) if robot.planar else (0, 1, 2)
    return FrameTask(robot, None, every if rows is None else chosen_rows(every, rows), np.eye(3), TipFrame(tip))


@typed
def pose(
    robot: Robot,
    orientation: Orientation = "twist",
    *,
    reference: ArrayLike | None = None,
    axis: Axis | ArrayLike = "z",
    tip: str | None = None,
    rows: Sequence[int] | None = None,
) -> Task:
    """The tool's pose: m = 6, or m = 3 (x, y, turn) for a planar robot; or some `rows` of it.

    With "axis" the tool is free to spin about one of its axes, m = 5: the tool's point and the direction of that axis.
    The two rows of the direction are singular only where the axis points against that of the reference.

    Args:
        orientation: "twist" (geometric Jacobian), "zyz", "rpy" (fixed axes x, y, z), "rotation-vector" or "axis".
        reference: rotation (3, 3) that "rotation-vector" counts from, the identity by default; and "axis", by default
            one with the axis straight down.
        axis: of an "axis" task, "x", "y", "z" of the tool or any direction (3,) in its frame.

    Raises:
        UnknownNameError: an unknown orientation, tip, axis or row. RowsError: m > n. ArgumentError: a bad
            reference or axis.
    """
    robot.pose(np.zeros(robot.n), tip)
    return _pose_of(robot, TipFrame(tip), orientation, reference, axis, rows)


@typed
def relative_pose(
    robot: Robot,
    tip: str,
    other: str,
    orientation: Orientation = "twist",
    *,
    reference: ArrayLike | None = None,
    axis: Axis | ArrayLike = "z",
    rows: Sequence[int] | None = None,
) -> Task:
    """The pose of one tip in the frame of another, for two arms that work on one thing: m = 6, or some `rows` of it.

    Paths, targets and twists are then in the frame of `other`, as somebody who stands on it sees them.

    Args:
        tip: the tip that moves over the other one. other: the tip whose frame counts.
        orientation, reference, axis, rows: as of `pose`.

    Raises:
        UnknownNameError: an unknown orientation, tip, axis or row. RowsError: m > n. ArgumentError.
    """
    for name in (tip, other):
        robot.pose(np.zeros(robot.n), name)
    if tip == other:
        cure = f"name two of {', '.join(each.name for each in robot.tips)}"
        raise ArgumentError("the tip that a tip is relative to", other, cure)
    return _pose_of(robot, RelativeFrame(tip, other), orientation, reference, axis, rows)


def _pose_of(
    robot: Robot,
    frame: Frame,
    orientation: Orientation,
    reference: ArrayLike | None,
    axis: Axis | ArrayLike,
    rows: Sequence[int] | None,
) -> Task:
    if orientation not in ORIENTATIONS:
        raise UnknownNameError("orientation", orientation, ORIENTATIONS)
    along = _direction(axis)
    if reference is not None:
        base = finite("reference", reference, (3, 3))
    elif orientation == "axis":
        base = np.diag([1.0, -1.0, -1.0]) @ frame_about(along).T
    else:
        # The identity; for a planar robot with a tilted tool its rotation at q = 0, so that it turns in the plane.
        R = robot.pose(np.zeros(robot.n), frame.tip)[:3, :3]
        base = R if robot.planar and R[2, 2] < 1 - 1e-12 else np.eye(3)
    if not np.allclose(base @ base.T, np.eye(3), atol=1e-9) or np.linalg.det(base) < 0:
        raise ArgumentError("reference", base.tolist(), "give a rotation matrix (3, 3)")
    if robot.planar and orientation in ("zyz", "axis"):
        cure = f"use 'twist': the tool of a plane turns about one axis, and {orientation!r} is singular there"
        raise ArgumentError("orientation of a planar robot", orientation, cure)
    every = (0, 1, 5) if robot.planar else tuple(range(5 if orientation == "axis" else 6))
    return FrameTask(robot, orientation, every if rows is None else chosen_rows(every, rows), base, frame, along)


@typed
def custom_task(
    robot: Robot,
    expression: Callable[[SX], Any],
    *,
    units: Sequence[str],
    names: Sequence[str] | None = None,
    name: str = "custom",
) -> Task:
    """x = f(q) of your own: m CasADi expressions of q, for instance of `robot.kinematics(q)`, or of `coordinates`.

    Its Jacobian is df/dq, its error x_d - x. A target is a point: (3,) of up to three rows, of which those of the task
    count, and (m,) of more. Paths lead through such points, at a speed in the units of the rows: any `Path` of up to
    three rows, `through(points)` or `synchronized` paths of three rows each of more.

    Args:
        expression: q (n,) -> x (m,).
        units: of each row, for instance ("m", "rad").
        names: of each row; "x1", "x2", ... by default.

    Raises:
        ArgumentError: no rows. ShapeError: the expression has other rows. RowsError: m > n.
    """
    labels = tuple(f"x{i + 1}" for i in range(len(units))) if names is None else tuple(names)
    if not units or len(labels) != len(units):
        cure = "give a unit of each row, and as many names"
        raise ArgumentError("the units and names of a task", (tuple(units), labels), cure)
    whole = ExpressionFrame(name, expression, tuple(units), labels)
    whole.check(robot)  # so that an expression that does not fit is refused here
    if len(units) > robot.n:
        raise RowsError(robot.name, len(units), robot.n)
    parts = [
        FrameTask(robot, None, tuple(range(len(frame.row_units))), np.eye(3), frame)
        for frame in whole.parts_of_three_rows()
    ]
    if len(parts) == 1:
        return parts[0]
    # A stacked task counts six rows a frame: three of position, three of orientation.
    rows = tuple(6 * f + row for f, part in enumerate(parts) for row in part.rows)
    return stack(parts, rows, name, len(units))


@typed
def line_of_sight(
    robot: Robot, point: ArrayLike, *, tip: str | None = None, axis: Axis | ArrayLike = "z", name: str = "line of sight"
) -> Task:
    """The direction of a fixed point from a camera on the tool, m = 2: (ax, ay) [rad], (0, 0) where it looks at it.

    The camera's axis is turned by them, about lines perpendicular to it, to the direction of the point.

    Args:
        point: (3,) [m], in the base frame. tip: the camera's frame.
        axis: that the camera looks along: "x", "y", "z" of the tip or a direction (3,) in its frame.

    Raises:
        UnknownNameError: an unknown tip or axis. RowsError: m > n. ShapeError, NotFiniteError.
    """
    seen, along = finite("the point to look at", point, (3,)), frame_about(_direction(axis))
    robot.pose(np.zeros(robot.n), tip)

    def direction(q: SX) -> SX:
        k = robot.kinematics(q, tip)
        d = SX(along.T) @ (k.rotation.T @ (SX(seen) - k.position))
        return log_s2(d / norm_2(d))

    return custom_task(robot, direction, units=("rad", "rad"), names=("ax", "ay"), name=name)


def _direction(axis: Axis | ArrayLike) -> Vector:
    """A unit vector (3,) in the tool's frame. Raises: UnknownNameError, ArgumentError, ShapeError."""
    if isinstance(axis, str):
        if axis not in _AXES:
            raise UnknownNameError("axis of the tool", shown(axis), tuple(_AXES))
        return np.array(_AXES[axis])
    given = finite("the axis of the tool", axis, (3,))
    size = float(np.linalg.norm(given))
    if not size > 0:
        raise ArgumentError("the axis of the tool", given.tolist(), "give a direction: its length must not vanish")
    return given / size
