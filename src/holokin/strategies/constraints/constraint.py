"""`Constraint`: g(q) of r = n - m rows. Near a regular posture of a leaf g(q) = c the tool pose decides the joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from ...base.arguments import Made, made, typed
from ...base.errors import ArgumentError, RowsError, ShapeError
from ...base.types import Array, ArrayLike, ByValue, Value, Vector, finite, frozen, whole
from ...robot import Kinematics
from ...symbolic import (
    SX,
    Formula,
    Transport,
    as_expression,
    fmin,
    jacobian,
    norm_2,
    symbol,
    vec,
    vertcat,
    wrapped,
    written,
)
from ..tasks.frame_task import AxisDirection, FrameTask, RotationVector
from ..tasks.task import Field, Task


@dataclass(frozen=True, eq=False)
class Implicit(Value):
    """g(q) = g(q, z(q)) with unknowns z (k,) that solve as many equations h(q, z) = 0.

    A null vector by Householder reflections has kinks where a sign changes, though it is smooth itself. As an unknown
    of J z = 0, |z|^2 = 1 it is the root of polynomials of J.

    size: k of a task. rows: (task, kinematics, q, z) -> (g (rows,), h (k,)), where d h / d z is regular wherever g is
    smooth. at: (task, q) -> z (k,) at a posture (n,).
    """

    size: Callable[[Task], int]
    rows: Callable[[Task, Kinematics, SX, SX], tuple[SX, SX]]
    at: Callable[[Task, Vector], Vector]


@dataclass(frozen=True, eq=False)
class Tilt(Value):
    """g(q) = a(q) - h(x): the constraint a, and h (rows,), a function of the pose x of the task's frames.

    pose: (task, kinematics) -> h, an expression of the position and the rotation of the kinematics alone.
    turn: the same of how far [rad] the tool may turn from there before coordinates that h takes may jump.
    """

    base: Constraint
    pose: Callable[[Task, Kinematics], SX]
    turn: Callable[[Task, Kinematics], SX]


class ChartFunction(Value, ABC):
    """h (rows,), a function of the tool's pose in coordinates of its own."""

    @property
    @abstractmethod
    def chart(self) -> Task:
        """The task whose coordinates x (m,) it takes."""

    @abstractmethod
    def __call__(self, x: SX) -> SX:
        """h as an expression of x."""


Levels = TypeVar("Levels", SX, Array)


@dataclass(frozen=True, eq=False)
class Constraint(Made, ByValue):
    """g(q), written down when a task (and so a robot) is known.

    `expression(task, kinematics, q)` gives g (rows,). `angular` says which rows are angles, whose
    difference g - c counts in (-pi, pi]. `margin`, likewise an expression, is how far the posture is from
    where an orientation representation that g uses is singular; `places`, if given, names the distances that it is
    the least of, for messages. `derivative` is J_g where it is known better than by differentiating g. `looped` is the
    same constraint with its numbers left to a loop, `transport`: for what is evaluated and not differentiated.
    `implicit` is the same constraint without the kinks of its expression, by auxiliary unknowns: for proofs.
    `formulas` gives those parts of g that may jump, as what a user wrote; without it all of g is looked at.
    `tilt` takes g apart where it is another constraint less a function of the tool's pose.
    """

    name: str
    rows: int
    expression: Field
    angular: tuple[bool, ...]
    margin: Field | None = None
    derivative: Field | None = None
    looped: Constraint | None = None
    transport: Transport | None = None
    places: tuple[tuple[str, Field], ...] = ()
    implicit: Implicit | None = None
    formulas: Callable[[Task, Kinematics, SX], list[Formula]] | None = None
    tilt: Tilt | None = None

    @typed
    def bind(self, task: Task, k: Kinematics, q: SX) -> SX:
        """g (r,) for a task. Raises: RowsError unless it has r = n - m rows; ShapeError."""
        if self.rows != task.n - task.m:
            raise RowsError(self.name, self.rows, task.n, task.m)
        return self.expand(task, k, q)

    @typed
    def expand(self, task: Task, k: Kinematics, q: SX) -> SX:
        """g (rows,) for a task, whatever its number of rows. Raises: ShapeError."""
        g = as_expression(self.expression(task, k, q))
        if g.shape != (self.rows, 1):
            raise ShapeError(f"constraint {self.name!r}", (self.rows, 1), g.shape, "rows= must match what it returns")
        return g

    @typed
    def slopes(self, task: Task, k: Kinematics, q: SX) -> SX:
        """J_g = dg/dq (r, n). Raises: as `bind`."""
        g = self.bind(task, k, q)
        return jacobian(g, q) if self.derivative is None else self.derivative(task, k, q)  # (10)

    def nearest(self, gap: Levels) -> Levels:
        """A difference of levels, numbers (..., r) or an expression (r, 1), its angles in (-pi, pi]."""
        if isinstance(gap, SX):
            return vertcat(SX(0, 1), *(wrapped(gap[i]) if flag else gap[i] for i, flag in enumerate(self.angular)))
        return np.where(np.array(self.angular, dtype=bool), wrapped(gap), gap) if any(self.angular) else gap


@made
def custom(
    expression: Callable[[SX], Any], rows: int = 1, *, name: str = "custom", angular: bool = False
) -> Constraint:
    """g(q) of your own: a CasADi expression of q, or a list of them.

    Args:
        expression: q (n,) -> g (rows,).
        rows: r = n - m, 0 for an arm without redundancy.
        angular: True when every row is an angle that may wrap.
    """
    whole("rows", rows, 0)
    return Constraint(name, rows, lambda _task, _k, q: written(name, expression, q), (angular,) * rows)


@made
def linear(matrix: ArrayLike, *, name: str = "linear") -> Constraint:
    """g(q) = A q with A (r, n), or (n,) for one row.

    Raises:
        NotFiniteError: A is not finite. ShapeError (when bound): A has not n columns.
    """
    A = frozen(np.atleast_2d(finite("the matrix of a linear constraint", matrix)))
    if A.ndim != 2 or not A.size:
        raise ShapeError("the matrix of a linear constraint", ("r", "n"), A.shape)

    def expression(task: Task, _k: Kinematics, q: SX) -> SX:
        if A.shape[1] != task.n:
            joints = ", ".join(task.robot.joint_names)
            raise ShapeError("the matrix of a linear constraint", (len(A), task.n), A.shape, f"the joints are {joints}")
        return SX(A) @ q

    return Constraint(name, len(A), expression, (False,) * len(A), formulas=nothing_jumps)


@made
def lock(
    *joints: str | int, follows: Callable[[SX, SX], Any] | ChartFunction | None = None, name: str = "lock"
) -> Constraint:
    """g(q) = (q_j, ...) or, with follows, (q_j, ...) - h(p, R): holds joints, or lets them follow the tool's pose.

    A joint stays where it stands at the start posture, or as far from h as it is there. Singular where N_j = 0,
    whatever h is: det [J; e_j - h' J] = det [J; e_j], for a task of the whole pose.

    Args:
        joints: by name, or by index in q, counted from 0 (-1 is the last).
        follows: h, (position (3,), rotation (3, 3)) of the tool -> a CasADi expression, or a list of as many as there
            are joints [rad or m]; or the `polynomial` of a `design`.

    Raises:
        UnknownNameError (when bound): the robot has no such joint.
        ShapeError (when bound): h has not one row a joint.
    """
    if not joints:
        raise ArgumentError("the joints to lock", joints, "name at least one")

    def expression(task: Task, _k: Kinematics, q: SX) -> SX:
        return vertcat(*(q[task.robot.joint_index(joint)] for joint in joints))

    plain = Constraint(name, len(joints), expression, (False,) * len(joints), formulas=nothing_jumps)
    if follows is None:
        return plain
    what = f"what {name!r} follows"
    if isinstance(follows, ChartFunction):
        return _of_chart(plain, what, follows, follows.chart, name)
    return _less(plain, what, follows, lambda _task, k: [k.position, k.rotation], lambda _task, _k: SX(np.inf), name)


@made
def stack(*constraints: Constraint) -> Constraint:
    """Several constraints one below the other: rows add up."""
    if not constraints:
        raise ArgumentError("the constraints to stack", constraints, "give at least one")
    name, angular = " over ".join(c.name for c in constraints), tuple(flag for c in constraints for flag in c.angular)
    return _combined(constraints, name, angular, lambda _task, _k, values: vertcat(*values))


@made
def total(*constraints: Constraint, weights: Sequence[float] | None = None) -> Constraint:
    """g(q) = sum_i w_i g_i(q), row by row, of constraints with the same number of rows.

    Args:
        weights: w_i, ones by default. Rows that are angles take whole numbers, so that a full turn stays one.

    Raises:
        ArgumentError: nothing to add, rows or weights that do not match, a broken weight on an angle.
    """
    factors = [1.0] * len(constraints) if weights is None else [float(w) for w in weights]
    rows = {c.rows for c in constraints}
    if len(rows) != 1 or len(factors) != len(constraints) or not np.isfinite(factors).all():
        facts = ([c.rows for c in constraints], factors)
        raise ArgumentError("the rows and weights of a sum", facts, "give constraints of equal rows, a weight for each")
    for c, w in zip(constraints, factors, strict=True):
        if any(c.angular) and w != round(w):
            raise ArgumentError(f"the weight of {c.name!r}", w, "its rows are angles: give a whole number")

    def sum_of(_task: Task, _k: Kinematics, values: list[SX]) -> SX:
        terms = [w * value for value, w in zip(values, factors, strict=True)]
        return sum(terms[1:], terms[0])

    angular = tuple(any(flags) for flags in zip(*(c.angular for c in constraints), strict=True))
    name = " + ".join(c.name if w == 1 else f"{w:g} {c.name}" for c, w in zip(constraints, factors, strict=True))
    return _combined(constraints, name, angular, sum_of)


def _combined(
    constraints: Sequence[Constraint],
    name: str,
    angular: tuple[bool, ...],
    together: Callable[[Task, Kinematics, list[SX]], SX],
) -> Constraint:
    """The constraint whose g `together` makes of the values of several, a linear map."""

    def expression(task: Task, k: Kinematics, q: SX) -> SX:
        return together(task, k, [c.expand(task, k, q) for c in constraints])

    def of_pose(task: Task, k: Kinematics) -> SX:
        return together(task, k, [SX.zeros(c.rows, 1) if c.tilt is None else c.tilt.pose(task, k) for c in constraints])

    margins = [c.margin for c in constraints if c.margin is not None]
    bases = [c if c.tilt is None else c.tilt.base for c in constraints]
    tilts = [c.tilt for c in constraints if c.tilt is not None]
    return Constraint(
        name,
        len(angular),
        expression,
        angular,
        least(margins) if margins else None,
        places=tuple(place for c in constraints for place in c.places),
        implicit=joined(constraints, together),
        formulas=formulas_of(constraints),
        tilt=Tilt(_combined(bases, name, angular, together), of_pose, _least_turn(tilts)) if tilts else None,
    )


@made
def tilted(
    constraint: Constraint, rho: Callable[[SX], Any], *, chart: Task | None = None, name: str | None = None
) -> Constraint:
    """g(q) = a(q) - rho(f(q)): the leaves of a constraint a, tilted by a function of the tool's pose.

    det [J; J_a - rho' J] = det [J; J_a]: the tilt never changes algorithmic singularities (theory 2e). With one
    redundant joint every holonomic strategy near a leaf of a is of this form.

    Args:
        rho: x (m,) -> CasADi expression (rows,), in the task's own coordinates (m, rad); rotation vectors, also those
            of a twist task, count from its `reference` and jump half a turn from it.
        chart: a task of the same robot whose coordinates rho takes instead, for instance one with another reference.

    Raises:
        ShapeError (when bound): rho has another number of rows.
    """

    return _of_chart(constraint, f"the tilt of {constraint.name!r}", rho, chart, name or f"tilted {constraint.name}")


def _of_chart(constraint: Constraint, what: str, rho: Callable[[SX], Any], chart: Task | None, name: str) -> Constraint:
    """A constraint less a function of the coordinates of a chart, by default of the task."""

    def coordinates(task: Task, k: Kinematics) -> list[SX]:
        return [(chart or task).value_expression(k)]

    def turn(task: Task, k: Kinematics) -> SX:
        x = symbol("x", (chart or task).m)
        slopes = jacobian(written(what, rho, x), x)
        turns = any(flag and not slopes[:, i].is_zero() for i, flag in enumerate((chart or task)._angular))
        return _turn_before_jump(chart or task, k) if turns else SX(np.inf)

    return _less(constraint, what, rho, coordinates, turn, name)


def _less(
    constraint: Constraint,
    what: str,
    h: Callable[..., Any],
    coordinates: Callable[[Task, Kinematics], list[SX]],
    turn: Callable[[Task, Kinematics], SX],
    name: str,
) -> Constraint:
    """A constraint less a function h of coordinates of the pose, `turn` as in `Tilt`; messages call it `what`."""

    # The tilt as an expression, with that of the constraint itself, its slope, and the formula in which it may jump.
    def tilt(task: Task, k: Kinematics) -> SX:
        value = written(what, h, *coordinates(task, k))
        if value.shape != (constraint.rows, 1):
            raise ShapeError(what, (constraint.rows, 1), value.shape)
        return value

    def whole(task: Task, k: Kinematics) -> SX:
        return tilt(task, k) if constraint.tilt is None else constraint.tilt.pose(task, k) + tilt(task, k)

    def slopes(task: Task, k: Kinematics, q: SX) -> SX:
        return constraint.slopes(task, k, q) - jacobian(tilt(task, k), q)

    def formula(task: Task, k: Kinematics) -> Formula:
        at = coordinates(task, k)
        x = [symbol("x", *part.shape) for part in at]
        return Formula(written(what, h, *x), vertcat(*map(vec, x)), vertcat(*map(vec, at)), constraint.angular)

    before = constraint.tilt
    both = Tilt(constraint, whole, turn) if before is None else Tilt(before.base, whole, _least_turn([before], turn))
    return Constraint(
        name,
        constraint.rows,
        lambda task, k, q: constraint.expand(task, k, q) - tilt(task, k),
        constraint.angular,
        constraint.margin,
        slopes if constraint.derivative is not None else None,
        constraint.looped and _less(constraint.looped, what, h, coordinates, turn, name),
        constraint.transport,
        constraint.places,
        joined([constraint], lambda task, k, values: values[0] - tilt(task, k)),
        formulas_of([constraint], lambda task, k, _q: [formula(task, k)]),
        both,
    )


def _turn_before_jump(chart: Task, k: Kinematics) -> SX:
    """How far [rad] the tool may turn before coordinates jump: rotation vectors do half a turn from their reference."""
    kind = chart.representation if isinstance(chart, FrameTask) else None
    if isinstance(kind, RotationVector | AxisDirection):
        return np.pi - norm_2(kind.value(k.rotation))
    return SX(0)  # three angles wrap, wherever


def _least_turn(tilts: Sequence[Tilt], *more: Callable[[Task, Kinematics], SX]) -> Callable[[Task, Kinematics], SX]:
    turns = [*(tilt.turn for tilt in tilts), *more]
    return lambda task, k: reduce(fmin, (turn(task, k) for turn in turns))


def nothing_jumps(_task: Task, _k: Kinematics, _q: SX) -> list[Formula]:
    """The formulas of a constraint that the library writes down, and that is continuous wherever it is defined."""
    return []


def formulas_of(
    constraints: Sequence[Constraint], more: Callable[[Task, Kinematics, SX], list[Formula]] = nothing_jumps
) -> Callable[[Task, Kinematics, SX], list[Formula]]:
    """The formulas of several constraints, and more of them: `Constraint.formulas` of what they make together."""

    def formulas(task: Task, k: Kinematics, q: SX) -> list[Formula]:
        more_formulas = more(task, k, q)
        for c in constraints:
            more_formulas += (
                [Formula(c.expand(task, k, q), q, q, c.angular)] if c.formulas is None else c.formulas(task, k, q)
            )
        return more_formulas

    return formulas


def least(margins: Sequence[Field]) -> Field:
    """The least of several distances, as an expression."""
    return lambda task, k, q: reduce(fmin, (margin(task, k, q) for margin in margins), SX(np.inf))


def as_gain(gain: ArrayLike, shape: Sequence[int]) -> np.ndarray:
    """A matrix of the given shape from a scalar (times the identity) or a matrix; finite."""
    value = finite("the gain", gain)
    if value.ndim == 0:
        value = float(value) * np.eye(shape[0], shape[1])
    return frozen(finite("the gain", value, tuple(shape), "give a number or a matrix, in rad/m"))


def joined(constraints: Sequence[Constraint], together: Callable[[Task, Kinematics, list[SX]], SX]) -> Implicit | None:
    """The unknowns of several constraints, one after the other, and what is made of their values; or nothing."""
    parts = [c.implicit for c in constraints if c.implicit is not None]
    if not parts:
        return None

    def rows(task: Task, k: Kinematics, q: SX, z: SX) -> tuple[SX, SX]:
        ends = np.cumsum([0, *(part.size(task) for part in parts)]).tolist()
        parts_rows = [part.rows(task, k, q, z[a:b]) for part, (a, b) in zip(parts, pairwise(ends), strict=True)]
        values = iter(g for g, _ in parts_rows)
        g = [c.expand(task, k, q) if c.implicit is None else next(values) for c in constraints]
        return together(task, k, g), vertcat(*(h for _, h in parts_rows))

    return Implicit(
        lambda task: sum(part.size(task) for part in parts),
        rows,
        lambda task, q: np.concatenate([part.at(task, q) for part in parts]),
    )
