"""The kinds of a `Task`: `FrameTask` of one frame, `StackedTask` of several, each with rows and a target of its own.

Rows are position first, then orientation, of the pose of a frame: the tool's, or another one, see `frames`. `twist` has
the geometric Jacobian, whose angular rows are not the derivative of any coordinates; the other representations have
x = f(q) and J = df/dq.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import final

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, ShapeError, TaskTooLargeError, UnknownNameError, shown
from ...base.types import Matrix, Vector, finite
from ...robot import Kinematics, Robot
from ...symbolic import SX, fmin, jacobian, vertcat
from .frames import Frame, TipFrame
from .orientation_rows import ORIENTATIONS, UP, Representation, representation
from .task import Task


@final
@dataclass(frozen=True, eq=False, repr=False)
class FrameTask(Task):
    """Rows chosen from (x, y, z) and three orientation rows, or two of an axis, of one frame.

    `orientation` is one of "twist", "zyz", "rpy", "rotation-vector", "axis", or None for position only.
    `reference` (3, 3) is the rotation that "rotation-vector" counts from, log(R reference^T), and that "axis" does: the
    direction R a of the axis a of the tool is reached from `reference` a by a turn about (ax, ay), which are
    perpendicular to it. `axis` (3,) is a, in the tool's frame.
    """

    robot: Robot
    orientation: str | None
    rows: tuple[int, ...]
    reference: Matrix
    frame: Frame = field(default_factory=TipFrame)
    axis: Vector = field(default_factory=lambda: np.array(UP))

    def __post_init__(self) -> None:
        kinds = {"robot": Robot, "orientation": str | None, "rows": tuple[int, ...], "frame": Frame}
        for what, kind in kinds.items():
            check(f"the {what} of a task", kind, getattr(self, what))
        if self.orientation not in (None, *ORIENTATIONS):
            raise UnknownNameError("orientation", shown(self.orientation), ORIENTATIONS)
        last = 2 + len(self.representation.row_names)
        if not self.rows or not set(self.rows) <= set(range(last + 1)) or len(set(self.rows)) < len(self.rows):
            cure = f"name each of 0 to {last} at most once, and at least one"
            raise ArgumentError("the rows of a task", self.rows, cure)
        finite("the reference of a task", self.reference, (3, 3))
        finite("the axis of a task", self.axis, (3,))
        super().__post_init__()
        if self.m > self.n:
            raise TaskTooLargeError(self.m, self.n, self.robot.name)
        angular = sum(self.angular)
        if self.orientation == "twist" and angular in (1, 2) and not self.robot.planar:
            cure = "one or two angular velocities give no orientation to return to: keep all three, none, or take 'rpy'"
            raise ArgumentError("the number of angular rows of a twist task", angular, cure)

    def with_rows(self, rows: tuple[int, ...]) -> FrameTask:
        """The same task with other rows."""
        return replace(self, rows=rows)

    @property
    def name(self) -> str:
        """For instance "pose (zyz) of panda"."""
        kind = "position" if self.orientation is None else f"pose ({self.orientation})"
        return f"{self.frame.title or kind} of {self.robot.name}"

    @property
    def row_names(self) -> tuple[str, ...]:
        """Name of each row."""
        names = (*self.frame.labels, *self.representation.row_names)
        return tuple(names[i] for i in self.rows)

    @property
    def units(self) -> tuple[str, ...]:
        """Of each row: "m" or "rad", or what an expression of the user's own is in."""
        return tuple(self.frame.units[i] if i < 3 else "rad" for i in self.rows)

    @property
    def tip(self) -> str | None:
        """The tip of the robot that shows where the frame is; None is the robot's first one."""
        return self.frame.tip

    @property
    def frames(self) -> int:
        """1."""
        return 1

    @property
    def point(self) -> int:
        """3."""
        return 3

    @property
    def spatial(self) -> bool:
        """True of a frame of a tool."""
        return self.frame.spatial

    @property
    def has_hessians(self) -> bool:
        """Whether its frame has."""
        return self.frame.has_hessians

    def hessians(self, q: SX) -> list[SX]:
        """Those of its frame."""
        every = self.frame.hessians(self.robot, q)
        return [every[row] for row in self.rows]

    @cached_property
    def representation(self) -> Representation:
        """That of the orientation; of a task of positions alone the geometric one, of which it has no row."""
        return representation(self.orientation or "twist", self.reference, self.axis)

    @property
    def geometric(self) -> bool:
        """True when J is of the geometric rows: no representation by angles has a part in it."""
        return self.orientation in (None, "twist")

    @property
    def exact(self) -> bool:
        """True when J = df/dq: all representations but angular rows of a twist (a plane's single one is exact)."""
        return self.orientation != "twist" or not any(self.angular) or self.robot.planar

    @property
    def rotations(self) -> tuple[int, ...]:
        """The first angular row, where all three belong to the task."""
        return (self.angular.index(True),) if sum(self.angular) == 3 else ()

    @property
    def geometric_twin(self) -> FrameTask:
        """The same task with "twist" for a full orientation, which has no singular angles."""
        return replace(self, orientation="twist") if self.rotations else self

    def chart(self, rotations: Matrix) -> FrameTask:
        """With "twist", counted from the rotation (3, 3), for a full orientation.

        Along such a line the twist (v, w) is constant, so the geometric Jacobian serves.
        """
        if self.rotations or self.robot.planar:
            return replace(self, orientation="twist", reference=rotations)
        return self

    def counted_from(self, rotations: Matrix) -> FrameTask:
        """With another reference (3, 3), where there is such a one."""
        return replace(self, reference=rotations) if self.orientation in ("twist", "rotation-vector") else self

    def kinematics(self, q: SX) -> Kinematics:
        """The expressions of the frame."""
        return self.frame.kinematics(self.robot, q)

    def value_expression(self, k: Kinematics) -> SX:
        """x = f(q) as an expression (m,)."""
        return self._select(vertcat(k.position, self.representation.value(k.rotation)))  # (1)

    def jacobian_expression(self, k: Kinematics, q: SX) -> SX:
        """J as an expression (m, n): the geometric rows, or df/dq of a representation."""
        if self.geometric:
            return self._select(k.jacobian)  # (2)
        return self._select(vertcat(k.jacobian[:3, :], jacobian(self.representation.value(k.rotation), q)))  # (2), (26)

    def error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        """`error` as an expression (m,)."""
        return self._select(vertcat(position - k.position, self.representation.error(rotation, k.rotation)))

    def rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        """x' (m,) of a tool turned by R (3, 3) that moves with v (3,), w (3,)."""
        return self._select(vertcat(v, self.representation.rates(R, w)))

    def margin_expression(self, rotation: SX) -> SX:
        """Distance of the representation from its singularity; 1 where there is none."""
        return self.representation.margin(rotation) if any(self.angular) else SX(1)

    def _select(self, six: SX) -> SX:
        return six[list(self.rows), :]


@final
@dataclass(frozen=True, eq=False, repr=False)
class StackedTask(Task):
    """Rows of several tasks of one robot, x = [x_1; x_2; ...], each about a frame of its own.

    Its rows are those of the `parts`, numbered 6 f and on for frame f. `title` names it; `point` is how many numbers
    say where all frames are, when none has an orientation.
    """

    robot: Robot
    orientation: str | None
    rows: tuple[int, ...]
    parts: tuple[FrameTask, ...]
    title: str
    size: int

    def __post_init__(self) -> None:
        kinds = {"robot": Robot, "parts": tuple[FrameTask, ...], "rows": tuple[int, ...], "title": str, "size": int}
        for what, kind in kinds.items():
            check(f"the {what} of a stacked task", kind, getattr(self, what))
        if len(self.parts) < 2 or any(part.robot != self.robot for part in self.parts):
            raise ArgumentError("the parts of a stacked task", self.parts, "give two tasks or more, of one robot")
        every = [6 * f + row for f, part in enumerate(self.parts) for row in part.rows]
        if not self.rows or not set(self.rows) <= set(every) or len(set(self.rows)) < len(self.rows):
            raise ArgumentError("the rows of a stacked task", self.rows, f"name each of {every} at most once")
        super().__post_init__()
        if self.m > self.n:
            raise TaskTooLargeError(self.m, self.n, self.robot.name)
        for f, part in enumerate(self.parts):
            kept = sum(row // 6 == f and row % 6 > 2 for row in self.rows)
            if part.orientation == "twist" and 0 < kept < sum(part.angular):
                cure = "keep all three angular rows of a twist, none, or take 'rpy'"
                raise ArgumentError("the number of angular rows of a twist task", kept, cure)

    def with_rows(self, rows: tuple[int, ...]) -> StackedTask:
        """The same task with other rows; its targets are of all frames still."""
        return replace(self, rows=rows)

    @property
    def name(self) -> str:
        """For instance "pose (twist) of left and pose (twist) of right of yumi"."""
        return f"{self.title} of {self.robot.name}"

    @property
    def row_names(self) -> tuple[str, ...]:
        """Name of each row, of tips with the tip before it."""
        return self._each(lambda part: [f"{part.tip}.{name}" if part.tip else name for name in part.row_names])

    @property
    def units(self) -> tuple[str, ...]:
        """Of each row."""
        return self._each(lambda part: part.units)

    @property
    def tip(self) -> str | None:
        """That of the first part."""
        return self.parts[0].tip

    @property
    def frames(self) -> int:
        """One a part."""
        return len(self.parts)

    @property
    def point(self) -> int:
        """The size that was given."""
        return self.size

    @property
    def spatial(self) -> bool:
        """True when all parts are."""
        return all(part.spatial for part in self.parts)

    @property
    def has_hessians(self) -> bool:
        """Whether all parts have."""
        return all(part.has_hessians for part in self.parts)

    def hessians(self, q: SX) -> list[SX]:
        """Those of the parts."""
        every = [H for part in self.parts for H in part.hessians(q)]
        return [every[i] for i in self._places]

    @property
    def geometric(self) -> bool:
        """True when all parts are."""
        return all(part.geometric for part in self.parts)

    @property
    def exact(self) -> bool:
        """True when all parts are."""
        return all(part.exact for part in self.parts)

    @property
    def rotations(self) -> tuple[int, ...]:
        """The first angular row of each part that has all three of them among the rows."""
        found = []
        for f in range(self.frames):
            mine = [i for i, row in enumerate(self.rows) if row // 6 == f and row % 6 > 2]
            if len(mine) == 3:
                found.append(mine[0])
        return tuple(found)

    @property
    def geometric_twin(self) -> StackedTask:
        """That of geometric parts."""
        return replace(self, parts=tuple(part.geometric_twin for part in self.parts))

    def chart(self, rotations: Matrix) -> StackedTask:
        """Those of the parts."""
        each = finite("the rotations", rotations, (3 * self.frames, 3)).reshape(-1, 3, 3)
        return replace(self, parts=tuple(part.chart(R) for part, R in zip(self.parts, each, strict=True)))

    def counted_from(self, rotations: Matrix) -> StackedTask:
        """Those of the parts."""
        each = finite("the rotations", rotations, (3 * self.frames, 3)).reshape(-1, 3, 3)
        return replace(self, parts=tuple(part.counted_from(R) for part, R in zip(self.parts, each, strict=True)))

    def kinematics(self, q: SX) -> Kinematics:
        """Those of the parts, one below the other."""
        each = [part.kinematics(q) for part in self.parts]
        p, R, J = (vertcat(*(getattr(k, what) for k in each)) for what in ("position", "rotation", "jacobian"))
        return Kinematics(p, R, J, each[0].origins)

    def value_expression(self, k: Kinematics) -> SX:
        """The values of the parts."""
        return self._stack(lambda part, f: part.value_expression(_frame(k, f)))

    def jacobian_expression(self, k: Kinematics, q: SX) -> SX:
        """The Jacobians of the parts."""
        return self._stack(lambda part, f: part.jacobian_expression(_frame(k, f), q))

    def error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        """The errors of the parts."""
        return self._stack(
            lambda part, f: part.error_expression(_frame(k, f), _three(position, f), _three(rotation, f))
        )

    def rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        """The rates of the parts."""
        return self._stack(lambda part, f: part.rates_expression(_three(R, f), _three(v, f), _three(w, f)))

    def margin_expression(self, rotation: SX) -> SX:
        """The least of the parts."""
        margin = SX(1)
        for f, part in enumerate(self.parts):
            if any(row // 6 == f and row % 6 > 2 for row in self.rows):
                margin = fmin(margin, part.margin_expression(_three(rotation, f)))
        return margin

    def _stack(self, of: Callable[[FrameTask, int], SX]) -> SX:
        return vertcat(*(of(part, f) for f, part in enumerate(self.parts)))[self._places, :]

    def _each(self, of: Callable[[FrameTask], tuple[str, ...] | list[str]]) -> tuple[str, ...]:
        every = [word for part in self.parts for word in of(part)]
        return tuple(every[i] for i in self._places)

    @cached_property
    def _places(self) -> list[int]:
        """Where each row stands among those of all parts."""
        every = [6 * f + row for f, part in enumerate(self.parts) for row in part.rows]
        return [every.index(row) for row in self.rows]


def _three(rows: SX, f: int) -> SX:
    """What belongs to frame f of what has three rows a frame. Raises: ShapeError."""
    if rows.shape[0] < 3 * f + 3:
        raise ShapeError("an expression of several frames", ("3F", rows.shape[1]), rows.shape)
    return rows[3 * f : 3 * f + 3, :]


def _frame(k: Kinematics, f: int) -> Kinematics:
    """The expressions of one frame of several."""
    return Kinematics(_three(k.position, f), _three(k.rotation, f), k.jacobian[6 * f : 6 * f + 6, :], k.origins)


@typed
def stacked(*tasks: Task) -> Task:
    """Several tasks of one robot at once, x = [x_1; x_2; ...]: each hand of a two-armed robot at its own pose.

    A target has a pose for each frame, in the order of the tasks: (F, 4, 4), twists (F, 6), or points (F, 3) where no
    task has an orientation. Paths run together by `synchronized`. What is stacked may itself be stacked.

    Raises:
        ArgumentError: no tasks, or not of one robot. TaskTooLargeError: m > n.
    """
    parts = [part for task in tasks for part in parts_of(task)]
    if not parts:
        raise ArgumentError("the tasks to stack", tasks, "give at least one")
    if len(tasks) == 1:
        return tasks[0]
    rows, first = [], 0
    for task in tasks:
        rows += [6 * first + row for row in task.rows]
        first += task.frames
    title = " and ".join(f"{task.name.removesuffix(f' of {task.robot.name}')}{_of(task)}" for task in tasks)
    return stack(parts, tuple(rows), title, 3 * first)


def stack(parts: list[FrameTask], rows: tuple[int, ...], title: str, size: int) -> StackedTask:
    """Parts of one robot as one task of some of their rows."""
    robot = parts[0].robot
    kinds = dict.fromkeys(part.orientation for part in parts if part.orientation is not None)
    return StackedTask(robot, " and ".join(kinds) or None, rows, tuple(parts), title, size)


def parts_of(task: Task) -> tuple[FrameTask, ...]:
    """The tasks of single frames that a task is made of."""
    if isinstance(task, StackedTask):
        return task.parts
    return (task,) if isinstance(task, FrameTask) else ()


def _of(task: Task) -> str:
    return f" of {task.tip}" if task.frames == 1 and task.tip and task.tip not in task.name else ""
