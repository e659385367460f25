"""The kinds of a `Task`, and their rows of orientation: `FrameTask` of one frame, `StackedTask` of several.

Rows are position first, then orientation, of the pose of a frame: the tool's, or another one, see `frames`. `twist` has
the geometric Jacobian, whose angular rows are not the derivative of any coordinates; the other representations have
x = f(q) and J = df/dq.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal, final, get_args

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, ShapeError, UnknownNameError, shown
from ...base.types import ArrayLike, Matrix, Value, Vector, finite, kept
from ...robot import Kinematics
from ...symbolic import SX, Function, cos, fmax, fmin, if_else, jacobian, norm_2, sin, sumsqr, vec, vertcat, wrapped
from ...symbolic.rotations import (
    exp_so3,
    frame_about,
    log_s2,
    log_so3,
    rotation_about,
    rpy_angles,
    shortest_turn,
    skew,
    zyz_angles,
)
from .task import Frame, Task, TipFrame

# --- The orientation rows of a task: coordinates of a rotation R, or its angular velocity; three rows, or two of an
# axis.
#
# Coordinates w(R) have an exact Jacobian dw/dq and a place where they are singular, told by `margin`; the geometric
# rows of `twist` have neither.

Angles = Literal["zyz", "rpy", "rotation-vector"]
"""Coordinates of a rotation by three angles."""

Orientation = Literal["twist", "zyz", "rpy", "rotation-vector", "axis"]
"""The kinds of orientation rows."""

ORIENTATIONS: tuple[Orientation, ...] = get_args(Orientation)

X, Y, Z = np.eye(3)

UP = (0.0, 0.0, 1.0)
"""The z axis of the tool, which an axis task keeps unless told otherwise."""


@dataclass(frozen=True, eq=False)
class Representation(Value, ABC):
    """Rows (k,) of a rotation R (3, 3): w(R), the error to a wanted rotation, the rates of a turning one."""

    row_names: ClassVar[tuple[str, ...]]
    geometric: ClassVar[bool] = False

    @abstractmethod
    def value(self, R: SX) -> SX:
        """w (k,) [rad]."""

    @abstractmethod
    def margin(self, R: SX) -> SX:
        """How far w is from where it is singular; 1 where it never is."""

    def error(self, wanted: SX, R: SX) -> SX:
        """What w lacks to that of a wanted rotation (k,) [rad]."""
        return wrapped(self.value(wanted) - self.value(R))

    def rates(self, R: SX, angular: SX) -> SX:
        """w' (k,) of a rotation that turns with an angular velocity (3,)."""
        turn = vertcat(*(vec(skew(SX(np.eye(3)[:, i])) @ R).T for i in range(3))).T  # R' = [angular]x R
        return jacobian(self.value(R), R) @ turn @ angular  # (15), (16), (17): x' = T^-1 w

    @abstractmethod
    def rotation(self, w: SX) -> SX:
        """R (3, 3) of coordinates: what `value` undoes."""

    def completed(self, wanted: SX, rows: Sequence[int], present: SX) -> SX:
        """The rotation (3, 3) that has some rows of a wanted one, and all else as it is in `present`.

        Where the rows tell a direction of the tool, or of the base seen by the tool, it is `present` turned to it by
        the smallest angle; else the other coordinates are those of `present`.
        """
        if len(rows) == 3:
            return wanted
        if not rows:
            return present
        direction = self.directions.get(tuple(rows))
        if direction is None:
            return self._mixed(wanted, rows, present)
        fixed, of_base = direction
        if of_base:
            return present @ shortest_turn(wanted.T @ SX(fixed), present.T @ SX(fixed))
        return shortest_turn(present @ SX(fixed), wanted @ SX(fixed)) @ present

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Rows that tell a direction (3,) and nothing else: one fixed in the tool, or, with True, in the base."""
        return {}

    def _mixed(self, wanted: SX, rows: Sequence[int], present: SX) -> SX:
        """The rotation with some coordinates of a wanted one and the others of `present`."""
        w, goal = self.value(present), self.value(wanted)
        for row in rows:
            w[row] = goal[row]
        return self.rotation(w)


@dataclass(frozen=True, eq=False)
class EulerZYZ(Representation):
    """(phi, theta, psi) with R = Rz(phi) Ry(theta) Rz(psi)."""

    row_names = ("phi", "theta", "psi")

    def value(self, R: SX) -> SX:
        """phi, theta, psi."""
        return zyz_angles(R)

    def margin(self, R: SX) -> SX:
        """sin theta."""
        return sin(self.value(R)[1])

    def rotation(self, w: SX) -> SX:
        """Rz(phi) Ry(theta) Rz(psi)."""
        return rotation_about(Z, w[0]) @ rotation_about(Y, w[1]) @ rotation_about(Z, w[2])

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Without psi the z axis of the tool; without phi that of the base."""
        return {(0, 1): (Z, False), (1, 2): (Z, True)}


@dataclass(frozen=True, eq=False)
class RollPitchYaw(Representation):
    """(roll, pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll)."""

    row_names = ("roll", "pitch", "yaw")

    def value(self, R: SX) -> SX:
        """roll, pitch, yaw."""
        return rpy_angles(R)

    def margin(self, R: SX) -> SX:
        """cos pitch."""
        return cos(self.value(R)[1])

    def rotation(self, w: SX) -> SX:
        """Rz(yaw) Ry(pitch) Rx(roll)."""
        return rotation_about(Z, w[2]) @ rotation_about(Y, w[1]) @ rotation_about(X, w[0])

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """Without roll the x axis of the tool; without yaw the z axis of the base."""
        return {(1, 2): (X, False), (0, 1): (Z, True)}


@dataclass(frozen=True, eq=False)
class RotationVector(Representation):
    """log(R reference^T), axis times angle."""

    reference: Matrix
    row_names = ("rx", "ry", "rz")

    def value(self, R: SX) -> SX:
        """log(R reference^T)."""
        return log_so3(R @ SX(self.reference.T))

    def margin(self, R: SX) -> SX:
        """What the angle has left to pi."""
        return np.pi - norm_2(self.value(R))

    def error(self, wanted: SX, R: SX) -> SX:
        """The difference to the nearer of the two rotation vectors of the wanted rotation."""
        present, goal = self.value(R), self.value(wanted)
        angle = norm_2(goal)
        other = goal * (1 - 2 * np.pi / fmax(angle, 1e-3))  # a turn below 1e-3 rad has no near double
        return if_else(sumsqr(other - present) < sumsqr(goal - present), other, goal) - present

    def rotation(self, w: SX) -> SX:
        """exp(w) reference."""
        return exp_so3(w) @ SX(self.reference)


@dataclass(frozen=True, eq=False)
class Turn(RotationVector):
    """The angular velocity itself, and log(R_d R^T) for its error; its value shows log(R reference^T)."""

    row_names = ("wx", "wy", "wz")
    geometric = True

    def margin(self, R: SX) -> SX:
        """1: angular velocities are nowhere singular."""
        return SX(1)

    def error(self, wanted: SX, R: SX) -> SX:
        """log(R_d R^T) (3,)."""
        return log_so3(wanted @ R.T)

    def rates(self, R: SX, angular: SX) -> SX:
        """The angular velocity."""
        return angular

    def _mixed(self, wanted: SX, rows: Sequence[int], present: SX) -> SX:
        """exp of some rows of the error: of the tool of a plane, its turn in the plane."""
        gap, w = self.error(wanted, present), SX.zeros(3)
        for row in rows:
            w[row] = gap[row]
        return exp_so3(w) @ present


@dataclass(frozen=True, eq=False)
class AxisDirection(Representation):
    """(ax, ay): the direction R a is that of the reference, turned by them about lines perpendicular to it.

    Singular at one direction, that against the reference's, as two coordinates of a sphere must be somewhere.
    """

    reference: Matrix
    axis: Vector
    row_names = ("ax", "ay")

    def value(self, R: SX) -> SX:
        """ax, ay."""
        return log_s2(SX((self.reference @ frame_about(self.axis)).T) @ (R @ SX(self.axis)))

    def margin(self, R: SX) -> SX:
        """Half of what the turn has left to pi: coordinates of an even turn bend by up to 4.3 / left^2 of its rate."""
        return (np.pi - norm_2(self.value(R))) / 2

    def error(self, wanted: SX, R: SX) -> SX:
        """The difference."""
        return self.value(wanted) - self.value(R)

    def rotation(self, w: SX) -> SX:
        """That of least angle from the reference; of one row alone `completed` takes its axis."""
        reference = SX(self.reference @ frame_about(self.axis))
        return reference @ exp_so3(vertcat(w, 0)) @ SX(frame_about(self.axis)).T

    @property
    def directions(self) -> dict[tuple[int, ...], tuple[ArrayLike, bool]]:
        """The axis."""
        return {(0, 1): (self.axis, False)}

    def _mixed(self, wanted: SX, rows: Sequence[int], present: SX) -> SX:
        """The direction of one row of the wanted one and of the other one of `present`."""
        return super().completed(super()._mixed(wanted, rows, present), (0, 1), present)


_KINDS: dict[str, Callable[[Matrix, Vector], Representation]] = {
    "twist": lambda reference, _axis: Turn(reference),
    "zyz": lambda _reference, _axis: EulerZYZ(),
    "rpy": lambda _reference, _axis: RollPitchYaw(),
    "rotation-vector": lambda reference, _axis: RotationVector(reference),
    "axis": AxisDirection,
}


def representation(kind: Orientation, reference: Matrix | None = None, axis: Vector | None = None) -> Representation:
    """The representation of a kind: "twist", "zyz", "rpy", "rotation-vector" or "axis". Raises: UnknownNameError.

    Args:
        reference: rotation (3, 3) to count from, the identity by default. axis: unit vector (3,) of the tool.
    """
    if kind not in _KINDS:
        raise UnknownNameError("representation of orientation", kind, ORIENTATIONS)
    return _KINDS[kind](np.eye(3) if reference is None else reference, np.array(UP) if axis is None else axis)


def three_angles(kind: Angles) -> Representation:
    """One of three coordinates: "zyz", "rpy" or "rotation-vector". Raises: UnknownNameError."""
    if kind not in get_args(Angles):
        raise UnknownNameError("representation of orientation by angles", kind, get_args(Angles))
    return representation(kind)


@final
@dataclass(frozen=True, eq=False, repr=False)
class FrameTask(Task):
    """Rows chosen from (x, y, z) and three orientation rows, or two of an axis, of one frame.

    `orientation` is one of "twist", "zyz", "rpy", "rotation-vector", "axis", or None for position only.
    `reference` (3, 3) is the rotation that "rotation-vector" counts from, log(R reference^T), and that "axis" does: the
    direction R a of the axis a of the tool is reached from `reference` a by a turn about (ax, ay), which are
    perpendicular to it. `axis` (3,) is a, in the tool's frame.
    """

    orientation: Orientation | None
    reference: Matrix
    frame: Frame = field(default_factory=TipFrame)
    axis: Vector = field(default_factory=lambda: np.array(UP))

    def _check(self) -> None:
        check("the frame of a task", Frame, self.frame)
        if self.orientation not in (None, *ORIENTATIONS):
            raise UnknownNameError("orientation", shown(self.orientation), ORIENTATIONS)
        last = 2 + len(self.representation.row_names)
        if not self.rows or not set(self.rows) <= set(range(last + 1)) or len(set(self.rows)) < len(self.rows):
            cure = f"name each of 0 to {last} at most once, and at least one"
            raise ArgumentError("the rows of a task", self.rows, cure)
        finite("the reference of a task", self.reference, (3, 3))
        finite("the axis of a task", self.axis, (3,))
        angular = sum(self._angular)
        if self.orientation == "twist" and angular in (1, 2) and not self.robot.planar:
            cure = "one or two angular velocities give no orientation to return to: keep all three, none, or take 'rpy'"
            raise ArgumentError("the number of angular rows of a twist task", angular, cure)

    @property
    def name(self) -> str:
        """For instance "pose (zyz) of panda"."""
        kind = "position" if self.orientation is None else f"pose ({self.orientation})"
        return f"{self.frame.title or kind} of {self.robot.name}"

    @cached_property
    def row_names(self) -> tuple[str, ...]:
        """Name of each row."""
        names = (*self.frame.labels, *self.representation.row_names)
        return tuple(names[i] for i in self.rows)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Of each row: "m" or "rad", or what an expression of the user's own is in."""
        return tuple(self.frame.units[i] if i < 3 else "rad" for i in self.rows)

    @property
    def tip(self) -> str | None:
        """The tip of the robot that shows where the frame is; None is the robot's first one."""
        return self.frame.tip

    @cached_property
    def frames(self) -> int:
        """1."""
        return 1

    @property
    def _point(self) -> int:
        return 3

    @property
    def _spatial(self) -> bool:
        return self.frame.spatial

    @property
    def _has_hessians(self) -> bool:
        return self.frame._has_hessians

    def _hessians(self, q: SX) -> list[SX]:
        every = self.frame._hessians(self.robot, q)
        return [every[row] for row in self.rows]

    @cached_property
    def representation(self) -> Representation:
        """That of the orientation; of a task of positions alone the geometric one, of which it has no row."""
        return representation(self.orientation or "twist", self.reference, self.axis)

    @property
    def _geometric(self) -> bool:
        return self.orientation in (None, "twist")

    @property
    def _exact(self) -> bool:
        return self.orientation != "twist" or not any(self._angular) or self.robot.planar

    @cached_property
    def _rotations(self) -> tuple[int, ...]:
        return (self._angular.index(True),) if sum(self._angular) == 3 else ()

    @cached_property
    def _geometric_twin(self) -> FrameTask:
        return replace(self, orientation="twist") if self._rotations and not self._geometric else self

    def _chart(self, rotations: Matrix) -> FrameTask:
        """With "twist", counted from the rotation (3, 3), for a full orientation.

        Along such a line the twist (v, w) is constant, so the geometric Jacobian serves.
        """
        if self._rotations or self.robot.planar:
            return replace(self, orientation="twist", reference=rotations)
        return self

    def _counted_from(self, rotations: Matrix) -> FrameTask:
        return replace(self, reference=rotations) if self.orientation in ("twist", "rotation-vector") else self

    def kinematics(self, q: SX) -> Kinematics:
        """The expressions of the frame."""
        return self.frame.kinematics(self.robot, q)

    def value_expression(self, k: Kinematics) -> SX:
        """x = f(q) as an expression (m,)."""
        return self._select(vertcat(k.position, self.representation.value(k.rotation)))  # (1)

    def jacobian_expression(self, k: Kinematics, q: SX) -> SX:
        """J as an expression (m, n): the geometric rows, or df/dq of a representation."""
        if self._geometric:
            return self._select(k.jacobian)  # (2)
        return self._select(vertcat(k.jacobian[:3, :], jacobian(self.representation.value(k.rotation), q)))  # (2), (26)

    def _error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        return self._select(vertcat(position - k.position, self.representation.error(rotation, k.rotation)))

    def _rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        return self._select(vertcat(v, self.representation.rates(R, w)))

    def _margin_expression(self, rotation: SX) -> SX:
        return self.representation.margin(rotation) if any(self._angular) else SX(1)

    def _select(self, six: SX) -> SX:
        return six[list(self.rows), :]


@final
@dataclass(frozen=True, eq=False, repr=False)
class StackedTask(Task):
    """Rows of several tasks of one robot, x = [x_1; x_2; ...], each about a frame of its own.

    Its rows are those of the `parts`, numbered 6 f and on for frame f. `title` names it; `point` is how many numbers
    say where all frames are, when none has an orientation.
    """

    parts: tuple[FrameTask, ...]
    title: str
    size: int

    def _check(self) -> None:
        for what, kind in {"parts": tuple[FrameTask, ...], "title": str, "size": int}.items():
            check(f"the {what} of a stacked task", kind, getattr(self, what))
        if len(self.parts) < 2 or any(part.robot != self.robot for part in self.parts):
            raise ArgumentError("the parts of a stacked task", self.parts, "give two tasks or more, of one robot")
        every = [6 * f + row for f, part in enumerate(self.parts) for row in part.rows]
        if not self.rows or not set(self.rows) <= set(every) or len(set(self.rows)) < len(self.rows):
            raise ArgumentError("the rows of a stacked task", self.rows, f"name each of {every} at most once")
        for f, part in enumerate(self.parts):
            angular_rows = sum(row // 6 == f and row % 6 > 2 for row in self.rows)
            if part.orientation == "twist" and 0 < angular_rows < sum(part._angular):
                cure = "keep all three angular rows of a twist, none, or take 'rpy'"
                raise ArgumentError("the number of angular rows of a twist task", angular_rows, cure)

    @property
    def name(self) -> str:
        """For instance "pose (twist) of left and pose (twist) of right of yumi"."""
        return f"{self.title} of {self.robot.name}"

    @cached_property
    def row_names(self) -> tuple[str, ...]:
        """Name of each row, of tips with the tip before it."""
        return self._each(lambda part: [f"{part.tip}.{name}" if part.tip else name for name in part.row_names])

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Of each row."""
        return self._each(lambda part: part.units)

    @property
    def tip(self) -> str | None:
        """That of the first part."""
        return self.parts[0].tip

    @cached_property
    def frames(self) -> int:
        """One a part."""
        return len(self.parts)

    @property
    def _point(self) -> int:
        return self.size

    @property
    def _spatial(self) -> bool:
        return all(part._spatial for part in self.parts)

    @property
    def _has_hessians(self) -> bool:
        return all(part._has_hessians for part in self.parts)

    def _hessians(self, q: SX) -> list[SX]:
        every = [H for part in self.parts for H in part._hessians(q)]
        return [every[i] for i in self._places]

    @property
    def _geometric(self) -> bool:
        return all(part._geometric for part in self.parts)

    @property
    def _exact(self) -> bool:
        return all(part._exact for part in self.parts)

    @cached_property
    def _rotations(self) -> tuple[int, ...]:
        firsts = []
        for f in range(self.frames):
            mine = [i for i, row in enumerate(self.rows) if row // 6 == f and row % 6 > 2]
            if len(mine) == 3:
                firsts.append(mine[0])
        return tuple(firsts)

    @cached_property
    def _geometric_twin(self) -> StackedTask:
        return self if self._geometric else replace(self, parts=tuple(part._geometric_twin for part in self.parts))

    def _chart(self, rotations: Matrix) -> StackedTask:
        return self._by_part(rotations, FrameTask._chart)

    def _counted_from(self, rotations: Matrix) -> StackedTask:
        return self._by_part(rotations, FrameTask._counted_from)

    def _by_part(self, rotations: Matrix, of: Callable[[FrameTask, Matrix], FrameTask]) -> StackedTask:
        each = finite("the rotations", rotations, (3 * self.frames, 3)).reshape(-1, 3, 3)
        return replace(self, parts=tuple(of(part, R) for part, R in zip(self.parts, each, strict=True)))

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

    def _error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        return self._stack(
            lambda part, f: part._error_expression(_frame(k, f), _three(position, f), _three(rotation, f))
        )

    def _rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        return self._stack(lambda part, f: part._rates_expression(_three(R, f), _three(v, f), _three(w, f)))

    def _margin_expression(self, rotation: SX) -> SX:
        margin = SX(1)
        for f, part in enumerate(self.parts):
            if any(row // 6 == f and row % 6 > 2 for row in self.rows):
                margin = fmin(margin, part._margin_expression(_three(rotation, f)))
        return margin

    def _stack(self, of: Callable[[FrameTask, int], SX]) -> SX:
        return vertcat(*(of(part, f) for f, part in enumerate(self.parts)))[self._places, :]

    def _each(self, of: Callable[[FrameTask], tuple[str, ...] | list[str]]) -> tuple[str, ...]:
        every = [word for part in self.parts for word in of(part)]
        return tuple(every[i] for i in self._places)

    @cached_property
    def _places(self) -> list[int]:
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
        ArgumentError: no tasks, or not of one robot. RowsError: m > n.
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
    titles = []
    for task in tasks:
        name_tip = task.frames == 1 and task.tip and task.tip not in task.name
        titles.append(task.name.removesuffix(f" of {task.robot.name}") + (f" of {task.tip}" if name_tip else ""))
    return stack(parts, tuple(rows), " and ".join(titles), 3 * first)


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


# --- What a task leaves free: motions of its frames that no row of it sees. They are no demand.
#
# A pose that is asked for of such a task says more than is meant: a spin about a free axis, a height where only x and y
# count. What is meant is `completed` from where the frames are: the pose that the task cannot tell from the one asked
# for, whose free part is that of a pose at hand. Straight paths lead to it, so that they hold no free motion.

Place = tuple[Vector, Matrix]
"""Positions (3F,) and rotations (3F, 3) of F frames."""


def asks_whole_pose(task: Task) -> bool:
    """Whether a task asks for all six rows of the pose of one tip."""
    return isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) == set(range(6))


@kept
def leaves_free(task: Task) -> bool:
    """Whether a task has not all six rows of all its frames."""
    return not all({0, 1, 2} <= rows and len(rows) == 6 for _, rows in _rows(task))


def completed(task: Task, place: Place, present: Place) -> Place:
    """The place that a task cannot tell from the one that is given, and whose free part is that of another, `present`.

    Coordinates of positions that the task has no rows of are those of `present`; a rotation is that of `present`,
    turned no farther than the task asks.
    """
    return completing(task)(*present, *place) if leaves_free(task) else place


@kept
def completing(task: Task) -> Function:
    """(p0, R0, p, R) -> (p, R) `completed` from p0, R0: positions (3F,) and rotations (3F, 3)."""
    (p0, R0), (p, R) = task._target_symbols(), task._target_symbols()
    positions, rotations = [], []
    for f, (part, rows) in enumerate(_rows(task)):
        of_frame = slice(3 * f, 3 * f + 3)
        positions += [p[3 * f + i] if i in rows else p0[3 * f + i] for i in range(3)]
        angular = sorted(row - 3 for row in rows if row > 2)
        rotations.append(part.representation.completed(R[of_frame, :], angular, R0[of_frame, :]))
    inputs = {"p0": p0, "R0": R0, "p": p, "R": R}
    return Function("completed", inputs, {"p": vertcat(*positions), "R": vertcat(*rotations)})


@kept
def free_directions(task: Task) -> list[tuple[Vector, bool] | None]:
    """Of each frame the axis (3,) about which it may spin, fixed in it, or, with True, in the base; None where none."""
    directions: list[tuple[Vector, bool] | None] = []
    for part, rows in _rows(task):
        direction = part.representation.directions.get(tuple(sorted(row - 3 for row in rows if row > 2)))
        directions.append(None if direction is None else (np.asarray(direction[0], dtype=float), direction[1]))
    return directions


def _rows(task: Task) -> list[tuple[FrameTask, set[int]]]:
    """The part of each frame, and which of its six rows the task has."""
    return [(part, {row % 6 for row in task.rows if row // 6 == f}) for f, part in enumerate(parts_of(task))]
