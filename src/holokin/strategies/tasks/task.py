"""`Task`: what the tool must do, x = f(q), with its Jacobian, its error and the unit of each row.

A task is about one frame or several: the poses of F frames, six rows each. Its kinds are in `frame_task`. A target is
the positions p (3F,) and the rotations R (3F, 3) of all frames, one below the other: p (3,) and R (3, 3) of one frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np

from ...base.arguments import Made, check, type_methods, typed
from ...base.errors import (
    ArgumentError,
    RowsError,
    ShapeError,
    SingularityError,
    SingularityKind,
    UnknownNameError,
    shown,
)
from ...base.poses import PoseLike, pose_cure, pose_numbers
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, ByValue, Matrix, Value, Vector, finite, numbers
from ...robot import Kinematics, Robot, hessian_expression
from ...symbolic import (
    SX,
    Evaluator,
    Function,
    check_length,
    cross,
    densify,
    horzcat,
    jacobian,
    symbol,
    vertcat,
    written,
)
from ...symbolic.linear import minors, null_space


@dataclass(frozen=True, eq=False)
class Frame(Value, ABC):
    """A pose that depends on the joints: position (3,), rotation (3, 3) and geometric Jacobian (6, n)."""

    _has_hessians: ClassVar[bool] = False
    """Whether the derivatives of its Jacobian have a closed form."""
    spatial: ClassVar[bool] = True
    """Whether its coordinates are places of a tool in metres."""

    @abstractmethod
    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """Its expressions. Raises: UnknownNameError: the robot lacks a tip that it names."""

    def _hessians(self, robot: Robot, q: SX) -> list[SX]:
        """H_i (n, n) of the six rows of the Jacobian, dJ_ia / dq_b, in closed form; none where there is none."""
        return []

    @property
    def tip(self) -> str | None:
        """Name of the tip that draws it; None is the robot's first one."""
        return None

    @property
    def title(self) -> str:
        """What a task of it is called; empty of a tip, whose task is named after its rows."""
        return ""

    @property
    def units(self) -> tuple[str, ...]:
        """Of its coordinates."""
        return ("m", "m", "m")

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of its coordinates."""
        return ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class TipFrame(Frame):
    """A tip of the robot in the base frame; None is its first one."""

    name: str | None = None
    _has_hessians = True

    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """Those of the robot."""
        return robot.kinematics(q, self.name)

    def _hessians(self, robot: Robot, q: SX) -> list[SX]:
        """Cross products of the columns of the Jacobian."""
        return hessian_expression(robot, q, self.name)

    @property
    def tip(self) -> str | None:
        """The tip itself."""
        return self.name


@dataclass(frozen=True, eq=False)
class RelativeFrame(Frame):
    """A tip in the frame of another tip: p = R_o^T (p_t - p_o), R = R_o^T R_t.

    Its velocities are those that somebody on the other tip sees: R_o^T (v_t - v_o - w_o x (p_t - p_o)) and
    R_o^T (w_t - w_o).
    """

    name: str
    other: str

    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """Those of both tips, put together."""
        t, o = robot.kinematics(q, self.name), robot.kinematics(q, self.other)
        gap = t.position - o.position
        J = SX.zeros(6, robot.n)
        for i in range(robot.n):
            J[:3, i] = o.rotation.T @ (t.jacobian[:3, i] - o.jacobian[:3, i] - cross(o.jacobian[3:, i], gap))
            J[3:, i] = o.rotation.T @ (t.jacobian[3:, i] - o.jacobian[3:, i])
        return replace(t, position=o.rotation.T @ gap, rotation=o.rotation.T @ t.rotation, jacobian=densify(J))

    @property
    def tip(self) -> str | None:
        """The tip that is looked at."""
        return self.name

    @property
    def title(self) -> str:
        """Names both tips."""
        return f"pose of {self.name} in {self.other}"


@dataclass(frozen=True, eq=False)
class ExpressionFrame(Made, Frame):
    """A point whose coordinates (rows,) are expressions of the joints; it does not turn.

    `row_units` and `row_names` are those of the rows.
    """

    name: str
    expression: Callable[[SX], Any]
    row_units: tuple[str, ...]
    row_names: tuple[str, ...]
    spatial = False

    def check(self, robot: Robot) -> None:
        """Raises: ShapeError: the expression has not as many rows as units."""
        shape, rows = written(self.name, self.expression, symbol("q", robot.n)).shape, len(self.row_units)
        if shape != (rows, 1):
            raise ShapeError(f"the expression of {self.name!r}", (rows, 1), shape, "units= has one entry a row")

    def parts_of_three_rows(self) -> list[ExpressionFrame]:
        """Frames of three rows each, and one of the rest."""
        if len(self.row_units) <= 3:
            return [self]
        frames = []
        for i in range(0, len(self.row_units), 3):
            some, rows = slice(i, i + 3), partial(_three, self.name, self.expression, i)
            frames.append(ExpressionFrame(self.name, rows, self.row_units[some], self.row_names[some]))
        return frames

    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """The point, and its slope by q."""
        x, rows = written(self.name, self.expression, q), len(self.row_units)
        J = vertcat(densify(jacobian(x, q)), SX.zeros(6 - rows, robot.n))
        return Kinematics(vertcat(x, SX.zeros(3 - rows, 1)), SX.eye(3), J, robot.origins(q))

    @property
    def title(self) -> str:
        """The name of the expression."""
        return self.name

    @property
    def units(self) -> tuple[str, ...]:
        """Those given."""
        return self.row_units

    @property
    def labels(self) -> tuple[str, ...]:
        """Those given."""
        return self.row_names


def _three(name: str, expression: Callable[[SX], Any], first: int, q: SX) -> SX:
    """Three rows of an expression, or those that are left."""
    rows = written(name, expression, q)
    return rows[first : min(first + 3, rows.shape[0])]


def poses_expression(k: Kinematics) -> SX:
    """The poses of all frames, one below the other, (4F, 4)."""
    each = range(0, k.position.shape[0], 3)
    last = SX([[0, 0, 0, 1]])
    return vertcat(*(vertcat(horzcat(k.rotation[i : i + 3, :], k.position[i : i + 3]), last) for i in each))


@dataclass(frozen=True, eq=False, repr=False)
class Task(ByValue, ABC):
    """x = f(q), of m rows: a `FrameTask` of one frame, or a `StackedTask` of several.

    Make one with `position`, `pose`, `relative_pose`, `line_of_sight`, `custom_task`, and put them together with
    `stacked`. `task[[0, 1]]` keeps the first two rows; iterating gives the tasks of single rows.
    """

    robot: Robot
    orientation: str | None
    """The kind of its orientation rows, None for positions alone."""
    rows: tuple[int, ...]
    """Which rows of the frames it has, six each: 6 f to 6 f + 2 the position of frame f, then its orientation."""

    def __init_subclass__(cls) -> None:
        if cls.__module__ != f"{__package__}.frame_task":
            cure = "tasks are final: use hk.pose, hk.custom_task, ..., and a constraint for a quantity of your own"
            raise ArgumentError("a subclass of Task", cls.__name__, cure)
        type_methods(cls)

    def __post_init__(self) -> None:
        check("the robot of a task", Robot, self.robot)
        check("the rows of a task", tuple[int, ...], self.rows)
        self._check()
        super().__post_init__()
        if self.m > self.n:
            raise RowsError(self.robot.name, self.m, self.n)

    @abstractmethod
    def _check(self) -> None:
        """Raises: ArgumentError, ...: its fields do not fit each other."""

    def __repr__(self) -> str:
        return f"Task({self.name}, m={self.m}, n={self.n})"

    @typed
    def __getitem__(self, index: int | slice | Sequence[int]) -> Self:
        """The task of some rows only; its targets are of all frames still.

        Raises: UnknownNameError for a row that does not exist, ArgumentError.
        """
        return replace(self, rows=chosen_rows(self.rows, index))

    def __iter__(self) -> Iterator[Self]:
        """The tasks of the single rows. Raises: ArgumentError at an angular row of a twist, which cannot be alone."""
        return (self[i] for i in range(self.m))

    @cached_property
    def joint_units(self) -> tuple[str, ...]:
        """Units of the joints: "rad" or "m", of `coordinates` their own."""
        return tuple(c.unit for c in self.robot.coordinates)

    @property
    def m(self) -> int:
        """Number of rows."""
        return len(self.rows)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.robot.n

    @property
    @abstractmethod
    def name(self) -> str:
        """For instance "pose (zyz) of panda"."""

    @cached_property
    @abstractmethod
    def row_names(self) -> tuple[str, ...]:
        """Name of each row."""

    @cached_property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """Of each row: "m" or "rad", or what an expression of the user's own is in."""

    @property
    @abstractmethod
    def tip(self) -> str | None:
        """The tip of the robot that shows where the frame is, the first one of several; None is the robot's first."""

    @cached_property
    @abstractmethod
    def frames(self) -> int:
        """How many frames F it is about."""

    @property
    @abstractmethod
    def _point(self) -> int:
        """Numbers that say where all its frames are, when it has no orientation rows: 3F, fewer of some expressions."""

    @property
    @abstractmethod
    def _spatial(self) -> bool:
        """True when its targets are places of tools in metres."""

    @property
    @abstractmethod
    def _has_hessians(self) -> bool:
        """Whether the derivatives of its geometric Jacobian have a closed form."""

    @abstractmethod
    def _hessians(self, q: SX) -> list[SX]:
        """H_i (n, n) of its rows, dJ_ia / dq_b, in closed form, where there is one."""

    @property
    @abstractmethod
    def _geometric(self) -> bool:
        """True when J is of the geometric rows: no representation by angles has a part in it."""

    @property
    @abstractmethod
    def _exact(self) -> bool:
        """True when J = df/dq: all representations but angular rows of a twist (a plane's single one is exact)."""

    @cached_property
    @abstractmethod
    def _rotations(self) -> tuple[int, ...]:
        """Where all three angular rows of a frame belong to the task: the first of them, among its rows."""

    @cached_property
    @abstractmethod
    def _geometric_twin(self) -> Self:
        """The same task with "twist" for each full orientation, which has no singular angles."""

    @abstractmethod
    def _chart(self, rotations: Matrix) -> Self:
        """The same rows in coordinates whose straight lines from rotations (3F, 3) are p0 + t v, exp(t w) R0."""

    @abstractmethod
    def _counted_from(self, rotations: Matrix) -> Self:
        """The same with rotation vectors, and values of twists, that count from rotations (3F, 3)."""

    @cached_property
    def _angular(self) -> tuple[bool, ...]:
        """Which rows are of an orientation."""
        return tuple(row % 6 > 2 for row in self.rows)

    @property
    def _turns(self) -> bool:
        """True when there are angular rows, all of full orientations: it knows the tool's rotation."""
        return 0 < sum(self._angular) == 3 * len(self._rotations)

    @property
    def _by_angles(self) -> bool:
        """True when some angular rows are not those of a full orientation."""
        return sum(self._angular) > 3 * len(self._rotations)

    def __call__(self, q: ArrayLike) -> Vector:
        """x = f(q) [m, rad], (n,) -> (m,) or (k, n) -> (k, m). Angular rows of a twist task show log(R reference^T).

        Raises:
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._value_at.call(q)

    def jacobian(self, q: ArrayLike) -> Matrix:
        """Task Jacobian J, (n,) -> (m, n), or (k, n) -> (k, m, n).

        Raises: SingularityError: the orientation representation is singular at q, of many at the first such posture.
        """
        return self._jacobian_at.call(q)

    def null_space(self, q: ArrayLike) -> Matrix:
        """A basis N of ker J, (n,) -> (n, r).

        r = 1: the signed minors of J, smooth in q, with |N|^2 = det(J J^T) and det [J; N^T] > 0 [ZR11, (19)].
        r > 1: an orthonormal basis from the singular value decomposition, which may jump between postures.
        """
        J = self.jacobian(self.robot.checked(q))
        return minors(J)[:, None] if self.n - self.m == 1 else null_space(J)

    def error(self, q: ArrayLike, position: ArrayLike, rotation: ArrayLike) -> Array:
        """Task error (m,) from the pose at q (n,) to a target position (3,) and rotation (3, 3) [m, rad].

        Position p_d - p; twist log(R_d R^T); other representations x_d - f(q), angles in (-pi, pi]. At many postures
        (k, n), to targets (k, 3), (k, 3, 3) or to one for all, it is (k, m).

        Of F frames positions are (3F,) or (F, 3), and rotations (3F, 3) or (F, 3, 3).

        Raises:
            ShapeError, NotFiniteError, ArgumentError.
        """
        joints = numbers("q", q, self.robot.joint_names)
        p, R = self._target(position, (3,)), self._target(rotation, (3, 3))
        if joints.ndim == 2:
            return self._error_function.batch(self.robot.postures(joints), p, R).reshape(len(joints), self.m)
        p, R = finite("the position", p, (3 * self.frames,)), finite("the rotation", R, (3 * self.frames, 3))
        return np.atleast_1d(self._error_function(self.robot.checked(joints), p, R))

    def _target(self, given: ArrayLike, each: tuple[int, ...]) -> Array:
        """Positions or rotations of all frames, where they stand side by side, one below the other."""
        array = numbers("a target", given)
        side = (self.frames, *each)
        if self.frames > 1 and array.shape[-len(side) :] == side:
            return array.reshape(*array.shape[: -len(side)], 3 * self.frames, *each[1:])
        return array

    def pose(self, q: ArrayLike) -> Matrix:
        """Pose (4, 4) of the frame at q (n,), or those of several (F, 4, 4); at many postures (k, n) one in a row each.

        Raises:
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._pose_at.call(q)

    def _poses(self, Q: Matrix) -> tuple[Matrix, Array]:
        """Positions (k, 3F) and rotations (k, 3F, 3) of the frames at postures (k, n)."""
        return _targets_of(self._pose.batch(self.robot.postures(Q)).reshape(-1, self.frames, 4, 4))

    def _place(self, q: ArrayLike) -> tuple[Vector, Matrix]:
        """The target at which its frames are at q (n,): positions (3F,) and rotations (3F, 3)."""
        p, R = _targets_of(self.pose(self.robot.checked(q)).reshape(1, self.frames, 4, 4))
        return p[0], R[0]

    def target(self, pose: PoseLike) -> tuple[Vector, Matrix]:
        """Positions (3F,), rotations (3F, 3) of a pose (4, 4), or of (F, 4, 4). Raises: ShapeError, ArgumentError."""
        shape, given = (4, 4) if self.frames == 1 else (self.frames, 4, 4), pose_numbers("a pose", pose)
        if given.shape not in (shape, (self.frames, 4, 4)):
            raise ShapeError("a pose", shape, given.shape, pose_cure(given))
        p, R = _targets_of(given.reshape(1, self.frames, 4, 4))
        return p[0], R[0]

    def value_batch(self, Q: Matrix) -> Matrix:
        """f at postures (k, n) -> (k, m), unchecked."""
        Q = self.robot.postures(Q)
        return self._value.batch(Q).reshape(len(Q), self.m)

    def jacobian_batch(self, Q: Matrix) -> tuple[Array, Vector]:
        """J at postures (k, n) -> (k, m, n), unchecked, with the representation's margins (k,)."""
        Q = self.robot.postures(Q)
        J, margin = self._jacobian.batch(Q)
        return J.reshape(len(Q), self.m, self.n), margin

    def _tool_rates(self, rotation: ArrayLike, velocity: ArrayLike, angular: ArrayLike) -> tuple[Matrix, Vector]:
        """x' of tools turned by R (k, 3F, 3) that move with v (k, 3F), w (k, 3F) -> (k, m), unchecked.

        And the margins (k,) of the representation. Raises: ShapeError.
        """
        R = finite("the rotations", rotation, ("k", 3 * self.frames, 3))
        out, margins = self._rates.batch(R, velocity, angular)
        return out.reshape(-1, self.m), margins

    # --- expressions -----------------------------------------------------------------------------------------

    @abstractmethod
    def kinematics(self, q: SX) -> Kinematics:
        """The expressions of the frame; of several, one below the other."""

    @abstractmethod
    def value_expression(self, k: Kinematics) -> SX:
        """x = f(q) as an expression (m,)."""

    @abstractmethod
    def jacobian_expression(self, k: Kinematics, q: SX) -> SX:
        """J as an expression (m, n): the geometric rows, or df/dq of a representation."""

    @abstractmethod
    def _error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        """`error` as an expression (m,)."""

    @abstractmethod
    def _rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        """x' (m,) of tools turned by R (3F, 3) that move with v (3F,), w (3F,)."""

    @abstractmethod
    def _margin_expression(self, rotation: SX) -> SX:
        """Distance of the representations from their singularities; 1 where there is none."""

    def _turning_expression(self, k: Kinematics, J: SX) -> SX:
        """J with the geometric rows of each full orientation, whatever its representation."""
        if not self._rotations:
            return J
        turning = SX(J)
        for first in self._rotations:
            for row in range(first, first + 3):
                turning[row, :] = k.jacobian[self.rows[row], :]
        return turning

    @typed
    def _velocities(self, twist: SX) -> tuple[SX, SX]:
        """v (3F,) and w (3F,) of twists, one after the other (6F,)."""
        check_length("twist", twist, 6 * self.frames)
        each = range(0, 6 * self.frames, 6)
        return vertcat(*(twist[i : i + 3] for i in each)), vertcat(*(twist[i + 3 : i + 6] for i in each))

    def _target_symbols(self) -> tuple[SX, SX]:
        """Symbols of a target: p (3F,) and R (3F, 3)."""
        return symbol("p", 3 * self.frames), symbol("R", 3 * self.frames, 3)

    # --- numeric functions, built once -------------------------------------------------------------------------

    @cached_property
    def _symbols(self) -> tuple[SX, Kinematics]:
        q = symbol("q", self.n)
        return q, self.kinematics(q)

    @cached_property
    def _value(self) -> Function:
        q, k = self._symbols
        return Function("task", {"q": q}, {"x": self.value_expression(k)})

    @cached_property
    def _jacobian(self) -> Function:
        q, k = self._symbols
        outputs = {"J": self.jacobian_expression(k, q), "margin": self._margin_expression(k.rotation)}
        return Function("task_jacobian", {"q": q}, outputs)

    @cached_property
    def _pose(self) -> Function:
        q, k = self._symbols
        return Function("pose", {"q": q}, {"T": poses_expression(k)})

    @cached_property
    def _pose_at(self) -> Evaluator:
        shape = (4, 4) if self.frames == 1 else (self.frames, 4, 4)
        return self._pose.checked(shape, self.robot.checked, self._doubtful)

    @cached_property
    def _value_at(self) -> Evaluator:
        return self._value.checked((self.m,), self.robot.checked, self._doubtful)

    @cached_property
    def _jacobian_at(self) -> Evaluator:
        bounds = (TOLERANCES.representation,)
        return self._jacobian.checked((self.m, self.n), self.robot.checked, self._doubtful, bounds)

    def _doubtful(self, q: Vector, result: Array, margin: float = np.inf) -> Array:
        """The result at q, unless q is not finite or the representation is singular there."""
        check_representation(self, self.robot.checked(q), margin)
        return result

    @cached_property
    def _error_function(self) -> Function:
        """(q, p, R) -> `error`, unchecked."""
        inputs, e = self._error
        return Function("task_error", inputs, {"e": e})

    @cached_property
    def _error_and_slope(self) -> Function:
        """(q, p, R) -> (`error`, its derivative by q (m, n)), unchecked."""
        inputs, e = self._error
        return Function("task_error_slope", inputs, {"e": e, "slope": jacobian(e, inputs["q"])})

    @cached_property
    def _error(self) -> tuple[dict[str, SX], SX]:
        (q, k), (p, R) = self._symbols, self._target_symbols()
        return {"q": q, "p": p, "R": R}, self._error_expression(k, p, R)

    @cached_property
    def _rates(self) -> Function:
        R, v, w = self._target_symbols()[1], symbol("v", 3 * self.frames), symbol("w", 3 * self.frames)
        outputs = {"dx": self._rates_expression(R, v, w), "margin": self._margin_expression(R)}
        return Function("task_rates", {"R": R, "v": v, "w": w}, outputs)


Field = Callable[[Task, Kinematics, SX], SX]
"""An expression of the posture: (task, kinematics, q) -> matrix."""


def check_representation(task: Task, q: Vector, margin: float) -> None:
    """Raises: SingularityError when the margin of the representation is used up."""
    if not margin > TOLERANCES.representation:
        raise SingularityError(SingularityKind.REPRESENTATION, q, task.name, margin)


def of_one_tool(task: Task, what: str) -> None:
    """Raises: ArgumentError: what is asked for serves one tool alone, and this task has several frames or none."""
    if task.frames > 1 or not task.robot.tips:
        cure = "take the task of one" if task.robot.tips else "coordinates without links have none"
        raise ArgumentError(f"the task of {what}", task.name, f"it serves one tool of a robot: {cure}")


def _targets_of(poses: Array) -> tuple[Matrix, Array]:
    """Positions (k, 3F) and rotations (k, 3F, 3) of poses (k, F, 4, 4)."""
    k, frames = poses.shape[:2]
    return poses[..., :3, 3].reshape(k, 3 * frames), poses[..., :3, :3].reshape(k, 3 * frames, 3)


def chosen_rows(rows: tuple[int, ...], index: int | slice | Sequence[int]) -> tuple[int, ...]:
    """Some of the rows, by index. Raises: UnknownNameError, ArgumentError."""
    count = len(rows)
    if isinstance(index, slice):
        for part in (index.start, index.stop, index.step):
            check("the slice of task rows", int | None, part)
        wanted = list(range(count)[index])
    else:
        wanted = [index] if isinstance(index, int | np.integer) else [*index]
    for i in wanted:
        if not -count <= i < count:
            raise UnknownNameError("task row", shown(i), [str(k) for k in range(count)])
    if not wanted or len({i % count for i in wanted}) != len(wanted):
        raise ArgumentError("the choice of task rows", index, "name each row once, and at least one")
    return tuple(rows[i] for i in wanted)
