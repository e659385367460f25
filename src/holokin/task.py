"""`Task`: what the tool must do, x = f(q), with its Jacobian, its error and the unit of each row.

Rows are position first, then orientation, of the pose of a frame: the tool's, or another one, see `frames`. `twist` has
the geometric Jacobian, whose angular rows are not the derivative of any coordinates; the other representations have
x = f(q) and J = df/dq.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .arguments import check, typed
from .errors import ArgumentError, SingularityError, SingularityKind, TaskTooLargeError, UnknownNameError, shown
from .frames import Frame, TipFrame
from .representations import ORIENTATIONS, UP, Representation, representation
from .robot import Kinematics, Robot
from .symbolic import SX, Evaluator, Function, horzcat, jacobian, symbol, vertcat
from .symbolic.null_space import minors, null_space
from .tolerances import TOLERANCES
from .types import Array, ArrayLike, Matrix, Value, Vector, finite, numbers


@dataclass(frozen=True, eq=False)
class Task(Value):
    """x = f(q), of m rows chosen from (x, y, z) and three orientation rows, or two of an axis.

    `orientation` is one of "twist", "zyz", "rpy", "rotation-vector", "axis", or None for position only.
    `reference` (3, 3) is the rotation that "rotation-vector" counts from, log(R reference^T), and that "axis" does: the
    direction R a of the axis a of the tool is reached from `reference` a by a turn about (ax, ay), which are
    perpendicular to it. `axis` (3,) is a, in the tool's frame.
    `task[[0, 1]]` keeps the first two rows; iterating gives the tasks of single rows.
    """

    robot: Robot
    orientation: str | None
    rows: tuple[int, ...]
    reference: Matrix
    frame: Frame = field(default_factory=TipFrame)
    axis: Vector = field(default_factory=lambda: np.array(UP))

    def __init_subclass__(cls) -> None:
        cure = "tasks are final: use hk.position or hk.pose, rows= of them, and a constraint for a quantity of your own"
        raise ArgumentError("a subclass of Task", cls.__name__, cure)

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
        angular = sum(i > 2 for i in self.rows)
        if self.orientation == "twist" and angular in (1, 2) and not self.robot.planar:
            cure = "one or two angular velocities give no orientation to return to: keep all three, none, or take 'rpy'"
            raise ArgumentError("the number of angular rows of a twist task", angular, cure)

    def __repr__(self) -> str:
        return f"Task({self.name}, m={self.m}, n={self.n})"

    @typed
    def __getitem__(self, index: int | slice | Sequence[int]) -> Task:
        """The task of some rows only. Raises: UnknownNameError for a row that does not exist, ArgumentError."""
        return replace(self, rows=chosen_rows(self.rows, index))

    def __iter__(self) -> Iterator[Task]:
        """The tasks of the single rows. Raises: ArgumentError at an angular row of a twist, which cannot be alone."""
        return (self[i] for i in range(self.m))

    @property
    def m(self) -> int:
        """Number of rows."""
        return len(self.rows)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.robot.n

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
        return self.orientation != "twist" or all(i < 3 for i in self.rows) or self.robot.planar

    @property
    def turns(self) -> bool:
        """True when all three angular rows belong to the task, so that it knows the tool's rotation."""
        return self.orientation is not None and sum(i > 2 for i in self.rows) == 3

    def __call__(self, q: ArrayLike) -> Vector:
        """x = f(q), (n,) -> (m,) [m, rad]. The angular rows of a twist task show log(R reference^T).

        Raises:
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._value_at.call(q)

    def jacobian(self, q: ArrayLike) -> Matrix:
        """Task Jacobian J, (n,) -> (m, n).

        Raises:
            SingularityError: the orientation representation is singular at q.
        """
        return self._jacobian_at.call(q)

    def null_space(self, q: ArrayLike) -> Matrix:
        """A basis N of ker J, (n,) -> (n, r).

        r = 1: the signed minors of J, smooth in q, with |N|^2 = det(J J^T) and det [J; N^T] > 0 [ZR11, (19)].
        r > 1: an orthonormal basis from the singular value decomposition, which may jump between postures.
        """
        J = self.jacobian(q)
        return minors(J)[:, None] if self.n - self.m == 1 else null_space(J)

    def error(self, q: ArrayLike, position: ArrayLike, rotation: ArrayLike) -> Array:
        """Task error (m,) from the pose at q (n,) to a target position (3,) and rotation (3, 3) [m, rad].

        Position p_d - p; twist log(R_d R^T); other representations x_d - f(q), angles in (-pi, pi]. At many postures
        (k, n), to targets (k, 3), (k, 3, 3) or to one for all, it is (k, m).

        Raises:
            ShapeError, NotFiniteError, ArgumentError.
        """
        at = numbers("q", q)
        if at.ndim == 2:
            return self.error_function.batch(self.robot.postures(at), position, rotation).reshape(len(at), self.m)
        p, R = finite("the position", position, (3,)), finite("the rotation", rotation, (3, 3))
        return np.atleast_1d(self.error_function(self.robot.checked(at), p, R))

    def pose(self, q: ArrayLike) -> Matrix:
        """Pose (4, 4) of the frame at q (n,).

        Raises:
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._pose_at.call(q)

    def poses(self, Q: Matrix) -> tuple[Matrix, Array]:
        """Positions (k, 3) and rotations (k, 3, 3) of the frame at postures (k, n)."""
        T = self._pose.batch(self.robot.postures(Q)).reshape(-1, 4, 4)
        return T[:, :3, 3], T[:, :3, :3]

    def value_batch(self, Q: Matrix) -> Matrix:
        """f at postures (k, n) -> (k, m)."""
        Q = self.robot.postures(Q)
        return self._value.batch(Q).reshape(len(Q), self.m)

    def jacobian_batch(self, Q: Matrix) -> tuple[Array, Vector]:
        """J at postures (k, n) -> (k, m, n), unchecked, with the representation's margins (k,)."""
        Q = self.robot.postures(Q)
        J, margin = self._jacobian.batch(Q)
        return J.reshape(len(Q), self.m, self.n), margin

    def rates(self, rotation: ArrayLike, velocity: ArrayLike, angular: ArrayLike) -> tuple[Matrix, Vector]:
        """x' of a tool turned by R (k, 3, 3) that moves with v (k, 3), w (k, 3) -> (k, m), unchecked.

        And the margins (k,) of the representation, for `check_representation`. Raises: ShapeError.
        """
        out, margins = self._rates.batch(finite("the rotations", rotation, ("k", 3, 3)), velocity, angular)
        return out.reshape(-1, self.m), margins

    def check_representation(self, q: Vector, margin: float) -> None:
        """Raises: SingularityError when the margin of the representation is used up."""
        if not margin > TOLERANCES.representation:
            raise SingularityError(SingularityKind.REPRESENTATION, q, self.name, margin)

    # --- expressions -----------------------------------------------------------------------------------------

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
        return SX(1) if all(i < 3 for i in self.rows) else self.representation.margin(rotation)

    def _select(self, six: SX) -> SX:
        return six[list(self.rows), :]

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
        outputs = {"J": self.jacobian_expression(k, q), "margin": self.margin_expression(k.rotation)}
        return Function("task_jacobian", {"q": q}, outputs)

    @cached_property
    def _pose(self) -> Function:
        q, k = self._symbols
        return Function("pose", {"q": q}, {"T": vertcat(horzcat(k.rotation, k.position), SX([[0, 0, 0, 1]]))})

    @cached_property
    def _pose_at(self) -> Evaluator:
        return self._pose.checked((4, 4), self.robot.checked, self._doubtful)

    @cached_property
    def _value_at(self) -> Evaluator:
        return self._value.checked((self.m,), self.robot.checked, self._doubtful)

    @cached_property
    def _jacobian_at(self) -> Evaluator:
        bounds = (TOLERANCES.representation,)
        return self._jacobian.checked((self.m, self.n), self.robot.checked, self._doubtful, bounds)

    def _doubtful(self, q: Vector, found: Array, margin: float = np.inf) -> Array:
        """What was found at q, unless q is not finite or the representation is singular there."""
        self.check_representation(self.robot.checked(q), margin)
        return found

    @cached_property
    def error_function(self) -> Function:
        """(q, p, R) -> `error`, unchecked."""
        inputs, e = self._error
        return Function("task_error", inputs, {"e": e})

    @cached_property
    def error_and_slope(self) -> Function:
        """(q, p, R) -> (`error`, its derivative by q (m, n)), unchecked."""
        inputs, e = self._error
        return Function("task_error_slope", inputs, {"e": e, "slope": jacobian(e, inputs["q"])})

    @cached_property
    def _error(self) -> tuple[dict[str, SX], SX]:
        (q, k), p, R = self._symbols, symbol("p", 3), symbol("R", 3, 3)
        return {"q": q, "p": p, "R": R}, self.error_expression(k, p, R)

    @cached_property
    def _rates(self) -> Function:
        R, v, w = symbol("R", 3, 3), symbol("v", 3), symbol("w", 3)
        outputs = {"dx": self.rates_expression(R, v, w), "margin": self.margin_expression(R)}
        return Function("task_rates", {"R": R, "v": v, "w": w}, outputs)


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
