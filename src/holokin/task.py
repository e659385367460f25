"""`Task`: what the tool must do, x = f(q), with its Jacobian, its error and the unit of each row.

Rows are position first, then orientation. `twist` uses the geometric Jacobian, whose angular rows are
not the derivative of any coordinates; the other representations have x = f(q) and J = df/dq. `axis` keeps the direction
of one axis of the tool, which may spin about it: welding, drilling, spraying, milling.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .arguments import check, typed
from .errors import (
    ArgumentError,
    SingularityError,
    SingularityKind,
    TaskTooLargeError,
    UnknownNameError,
    shown,
)
from .robot import Kinematics, Robot
from .symbolic import (
    SX,
    Evaluator,
    Function,
    cos,
    fmax,
    if_else,
    jacobian,
    norm_2,
    sin,
    sumsqr,
    symbol,
    vec,
    vertcat,
    wrapped,
)
from .symbolic.geometry import frame_about, log_s2, log_so3, rpy_angles, skew, zyz_angles
from .symbolic.null_space import minors, null_space
from .tolerances import TOLERANCES
from .types import Array, ArrayLike, Matrix, Value, Vector, finite, numbers

ORIENTATIONS = ("twist", "zyz", "rpy", "rotation-vector", "axis")
_ANGLES = {"zyz": zyz_angles, "rpy": rpy_angles, "rotation-vector": log_so3}
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_ROW_NAMES = {
    "twist": ("wx", "wy", "wz"),
    "zyz": ("phi", "theta", "psi"),
    "rpy": ("roll", "pitch", "yaw"),
    "rotation-vector": ("rx", "ry", "rz"),
    "axis": ("ax", "ay"),
}


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
    tip: str | None = None
    axis: Vector = field(default_factory=lambda: np.array(_AXES["z"]))

    def __init_subclass__(cls) -> None:
        cure = "tasks are final: use hk.position or hk.pose, rows= of them, and a constraint for a quantity of your own"
        raise ArgumentError("a subclass of Task", cls.__name__, cure)

    def __post_init__(self) -> None:
        kinds = {"robot": Robot, "orientation": str | None, "rows": tuple[int, ...], "tip": str | None}
        for what, kind in kinds.items():
            check(f"the {what} of a task", kind, getattr(self, what))
        if self.orientation not in (None, *ORIENTATIONS):
            raise UnknownNameError("orientation", shown(self.orientation), ORIENTATIONS)
        last = 4 if self.orientation == "axis" else 5
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
        return replace(self, rows=_chosen(self.rows, index))

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
        return f"{kind} of {self.robot.name}"

    @property
    def row_names(self) -> tuple[str, ...]:
        """Name of each row."""
        names = ("x", "y", "z", *_ROW_NAMES[self.orientation or "twist"])
        return tuple(names[i] for i in self.rows)

    @property
    def units(self) -> tuple[str, ...]:
        """ "m" or "rad" of each row."""
        return tuple("m" if i < 3 else "rad" for i in self.rows)

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

    def value_expression(self, k: Kinematics) -> SX:
        """x = f(q) as an expression (m,)."""
        return self._select(vertcat(k.position, self._angles(k.rotation)))  # (1)

    def jacobian_expression(self, k: Kinematics, q: SX) -> SX:
        """J as an expression (m, n): the geometric rows, or df/dq of a representation."""
        if self.geometric:
            return self._select(k.jacobian)  # (2)
        return self._select(vertcat(k.jacobian[:3, :], jacobian(self._angles(k.rotation), q)))  # (2), (26)

    def error_expression(self, k: Kinematics, position: SX, rotation: SX) -> SX:
        """`error` as an expression (m,)."""
        if self.geometric:
            angular = log_so3(rotation @ k.rotation.T)
        elif self.orientation == "rotation-vector":
            here = self._angles(k.rotation)
            angular = _nearest_turn(self._angles(rotation), here) - here
        elif self.orientation == "axis":
            angular = self._angles(rotation) - self._angles(k.rotation)
        else:
            angular = wrapped(self._angles(rotation) - self._angles(k.rotation))
        return self._select(vertcat(position - k.position, angular))

    def rates_expression(self, R: SX, v: SX, w: SX) -> SX:
        """x' (m,) of a tool turned by R (3, 3) that moves with v (3,), w (3,)."""
        angular = w
        if not self.geometric:
            # d/dt of the coordinates along R' = [w]x R
            turn = vertcat(*(vec(skew(SX(np.eye(3)[:, i])) @ R).T for i in range(3))).T
            angular = jacobian(self._angles(R), R) @ turn @ w  # (15), (16), (17): x' = T^-1 w
        return self._select(vertcat(v, angular))

    def margin_expression(self, rotation: SX) -> SX:
        """Distance of the representation from its singularity; 1 where there is none."""
        if self.geometric or all(i < 3 for i in self.rows):
            return SX(1)
        if self.orientation == "axis":  # half of what is left: angles of an even turn bend up to four times as much
            return (np.pi - norm_2(self._angles(rotation))) / 2
        return representation_margin(self.orientation or "twist", self._angles(rotation))

    def _angles(self, R: SX) -> SX:
        if self.orientation in ("zyz", "rpy"):
            return orientation_angles(self.orientation, R)
        if self.orientation == "axis":
            frame = frame_about(self.axis)
            return log_s2(SX((self.reference @ frame).T) @ (R @ SX(self.axis)))
        return orientation_angles("rotation-vector", R @ SX(self.reference.T))

    def _select(self, six: SX) -> SX:
        return six[list(self.rows), :]

    # --- numeric functions, built once -------------------------------------------------------------------------

    @cached_property
    def _symbols(self) -> tuple[SX, Kinematics]:
        q = symbol("q", self.n)
        return q, self.robot.kinematics(q, self.tip)

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


def _nearest_turn(w: SX, here: SX) -> SX:
    """The rotation vector of the same rotation as w, w or w - 2 pi w/|w|, that lies nearer to another one."""
    angle = norm_2(w)
    other = w * (1 - 2 * np.pi / fmax(angle, 1e-3))  # a turn below 1e-3 rad has no near double
    return if_else(sumsqr(other - here) < sumsqr(w - here), other, w)


def orientation_angles(kind: str, R: SX) -> SX:
    """Three angles (3,) of a rotation: "zyz", "rpy" or "rotation-vector". Raises: UnknownNameError."""
    if kind not in _ANGLES:
        raise UnknownNameError("representation of orientation by angles", kind, tuple(_ANGLES))
    return _ANGLES[kind](R)


def representation_margin(kind: str, angles: SX) -> SX:
    """How far angles are from where their representation is singular: sin theta, cos pitch, pi - angle."""
    return {"zyz": sin(angles[1]), "rpy": cos(angles[1]), "rotation-vector": np.pi - norm_2(angles)}[kind]


@typed
def position(robot: Robot, tip: str | None = None, *, rows: Sequence[int] | None = None) -> Task:
    """The tool's position: m = 3, or m = 2 for a planar robot; or some `rows` of it.

    Raises:
        TaskTooLargeError, UnknownNameError, ArgumentError.
    """
    robot.pose(np.zeros(robot.n), tip)
    every = (0, 1) if robot.planar else (0, 1, 2)
    return Task(robot, None, every if rows is None else _chosen(every, rows), np.eye(3), tip)


@typed
def pose(
    robot: Robot,
    orientation: str = "twist",
    *,
    reference: ArrayLike | None = None,
    axis: str | ArrayLike = "z",
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
        UnknownNameError: an unknown orientation, tip, axis or row. TaskTooLargeError: m > n. ArgumentError: a bad
            reference or axis.
    """
    if orientation not in ORIENTATIONS:
        raise UnknownNameError("orientation", orientation, ORIENTATIONS)
    robot.pose(np.zeros(robot.n), tip)
    along = _direction(axis)
    if reference is not None:
        base = finite("reference", reference, (3, 3))
    elif orientation == "axis":
        base = np.diag([1.0, -1.0, -1.0]) @ frame_about(along).T
    else:
        base = _upright(robot, tip)
    if not np.allclose(base @ base.T, np.eye(3), atol=1e-9) or np.linalg.det(base) < 0:
        raise ArgumentError("reference", base.tolist(), "give a rotation matrix (3, 3)")
    if robot.planar and orientation in ("zyz", "axis"):
        cure = f"use 'twist': the tool of a plane turns about one axis, and {orientation!r} is singular there"
        raise ArgumentError("orientation of a planar robot", orientation, cure)
    every = (0, 1, 5) if robot.planar else tuple(range(5 if orientation == "axis" else 6))
    return Task(robot, orientation, every if rows is None else _chosen(every, rows), base, tip, along)


def _direction(axis: str | ArrayLike) -> Vector:
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


def _upright(robot: Robot, tip: str | None) -> Matrix:
    """The identity; for a planar robot with a tilted tool its rotation at q = 0, so that it turns in the plane."""
    R = robot.pose(np.zeros(robot.n), tip)[:3, :3]
    return R if robot.planar and R[2, 2] < 1 - 1e-12 else np.eye(3)


def _chosen(rows: tuple[int, ...], index: int | slice | Sequence[int]) -> tuple[int, ...]:
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
