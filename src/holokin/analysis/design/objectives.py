"""`Objective`: what a section q(x) of a workspace should be good at, as a cost of its postures and their slopes.

A section is given at S tool poses: postures Q (S, n), slopes G (S, n, d) = dq/dx along the d directions in which the
workspace reaches, rcond (S,) of the extended Jacobian. Every cost comes with its exact derivatives by these three; it
knows nothing of constraints, levels or polynomials.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from ...base.arguments import check
from ...base.errors import ArgumentError, OwnFunctionError, ShapeError, UnknownNameError
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Matrix,
    Value,
    Vector,
    finite,
    frozen,
    kept,
    not_negative,
    own_number,
    positive,
)
from ...motion.checks.motion_checks import Clearances
from ...robot import Robot, speed_limits
from ...symbolic import SX, Function, gradient, symbol, written


@dataclass(frozen=True, eq=False)
class OwnCost(Value):
    """The mean over the poses of c(q), a number of the joints (n,) that a design makes less.

    Give one of the two: expression: a CasADi expression of q, as for `hk.custom`, with exact derivatives. function: of
    numbers, q (n,) -> a float; its slope takes 2 n calls for each posture.
    """

    name: str
    expression: Callable[[SX], Any] | None = None
    function: Callable[[Vector], Any] | None = None
    weight: float = 1.0

    def __post_init__(self) -> None:
        check("the name of a cost", str, self.name)
        if (self.expression is None) is (self.function is None):
            raise ArgumentError(f"what the cost {self.name!r} is of", None, "give it expression= or function=")
        check("expression", Callable[..., Any] | None, self.expression)
        check("function", Callable[..., Any] | None, self.function)
        positive(f"the weight of {self.name}", self.weight)
        super().__post_init__()

    def values(self, Q: Matrix) -> Vector:
        """c at postures (k, n) -> (k,). Raises: OwnFunctionError: it is no finite number there."""
        if self.function is not None:
            return np.array([self._number(q) for q in Q]).reshape(len(Q))
        return self._checked(Q, _expressed(self, Q.shape[1]).batch(Q)[0])

    def slopes(self, Q: Matrix) -> Matrix:
        """dc/dq at postures (k, n) -> (k, n). Raises: as `values`."""
        if self.function is None:
            return self._checked(Q, np.reshape(_expressed(self, Q.shape[1]).batch(Q)[1], Q.shape))
        h = 1e-6  # of the differences [joint units]
        steps = h * np.eye(Q.shape[1])
        ahead, behind = (np.column_stack([self.values(Q + side * step) for step in steps]) for side in (1.0, -1.0))
        return (ahead - behind) / (2 * h)

    def _number(self, q: Vector) -> float:
        number = own_number(f"the cost {self.name!r}", self.function or float, q.copy())
        if number is None:
            raise OwnFunctionError(f"the cost {self.name!r}", f"gives None at q = {q.tolist()}", "give a number")
        return number

    def _checked(self, Q: Matrix, values: Array) -> Array:
        finite = np.isfinite(values.reshape(len(Q), -1)).all(axis=1)
        if not finite.all():
            fact = f"gives a number or a slope that is not finite at q = {Q[int(np.argmin(finite))].tolist()}"
            raise OwnFunctionError(f"the cost {self.name!r}", fact, "look for a division by zero, a log or a sqrt")
        return values


@kept
def _expressed(cost: OwnCost, n: int) -> Function:
    """q -> (c, dc/dq (n,)). Raises: ExpressionError, ShapeError."""
    q, what = symbol("q", n), f"the cost {cost.name!r}"
    c = written(what, cost.expression or abs, q)
    if c.shape != (1, 1):
        raise ShapeError(what, (1, 1), c.shape, "give one number")
    return Function("own_cost", {"q": q}, {"c": c, "slope": gradient(c, q)})


POWER = 24
"""Exponent of the smooth greatest value, (mean a^p)^(1/p): of 256 numbers one of which stands out it is 21 % too low,
of a smooth function over a box a few per cent."""


Cost = Literal["squared_speed", "worst_speed", "joint_limits", "rcond", "travel", "clearance"]
"""The names of the costs."""


@dataclass(frozen=True, eq=False)
class Objective(Value):
    """The cost of a section: a weighted sum of six and of your `own`, each divided by its value before the design, but
    for `clearance`.

    squared_speed: mean squared joint speed, mean over the poses of |G|_F^2, for a tool that moves at 1 m/s along each
        direction [rad^2/m^2]. worst_speed: greatest share of a joint's speed limit that a tool speed of 1 m/s in any
        direction asks for [s/m]. joint_limits: greatest |q - middle| over half the joint's range, 1 at a limit. rcond:
        greatest 1 / rcond. travel: mean squared distance of the joints between two poses of the workspace [rad^2].
    clearance: greatest share 1 - d / D, at least 0, over the pairs of shapes at distances d [m], with D =
        `enough_clearance` [m]: 1 where two touch, 0 where all are D or more apart. Pairs that are always nearer than D
        do not count.
    joint_weights: what a squared joint speed counts (n,), 1 each by default; a sliding joint [m] then counts as a
        hinge [rad] that uses the same share of its speed limit.
    length: metres of tool motion that count as one radian of turning; by default the spread of the workspace's
        positions over that of its directions.
    own: costs that you write, an `OwnCost` or several, each with its weight.
    """

    squared_speed: float = 0.0
    worst_speed: float = 0.0
    joint_limits: float = 0.0
    rcond: float = 0.0
    travel: float = 0.0
    clearance: float = 0.0
    enough_clearance: float = field(default=0.1, kw_only=True)
    joint_weights: ArrayLike | None = field(default=None, kw_only=True)
    length: float | None = field(default=None, kw_only=True)
    own: OwnCost | tuple[OwnCost, ...] = field(default=(), kw_only=True)

    NAMES: ClassVar[tuple[Cost, ...]] = get_args(Cost)

    def __post_init__(self) -> None:
        object.__setattr__(self, "own", (self.own,) if isinstance(self.own, OwnCost) else tuple(self.own))
        names = [*self.NAMES, *(cost.name for cost in self.costs)]
        if len(set(names)) < len(names):
            raise ArgumentError("the names of the costs", names, "give each of your own another name")
        for name in self.NAMES:
            not_negative(f"the weight of {name}", getattr(self, name))
        if not any(self.weights.values()):
            raise ArgumentError("the objective", "nothing", f"give a positive weight to one of {', '.join(self.NAMES)}")
        positive("enough_clearance", self.enough_clearance)
        if self.length is not None:
            positive("the length of an objective", self.length)
        if self.joint_weights is not None:
            weights = finite("the joint weights", self.joint_weights, ("n",))
            if not (weights > 0).all():
                raise ArgumentError("the joint weights", weights.tolist(), "give positive numbers, one a joint")
            object.__setattr__(self, "joint_weights", frozen(weights))
        super().__post_init__()

    @property
    def weights(self) -> dict[str, float]:
        """The weights of the costs that count."""
        own = {cost.name: float(cost.weight) for cost in self.costs}
        return {name: float(w) for name in self.NAMES if (w := getattr(self, name))} | own

    @property
    def costs(self) -> tuple[OwnCost, ...]:
        """Those of your own."""
        return (self.own,) if isinstance(self.own, OwnCost) else self.own


def as_objective(given: Objective | OwnCost | str) -> Objective:
    """An objective, also of one cost or its name. Raises: UnknownNameError, ArgumentError."""
    check("the objective", Objective | OwnCost | str, given)
    if isinstance(given, OwnCost):
        return Objective(own=given)
    if isinstance(given, Objective):
        return given
    name = given.replace(" ", "_").replace("-", "_")
    if name not in Objective.NAMES:
        raise UnknownNameError("objective", given, Objective.NAMES)
    weights: dict[str, Any] = {name: 1.0}
    return Objective(**weights)


@dataclass(frozen=True)
class Slopes:
    """A cost and its derivatives by Q (S, n), G (S, n, d) and rcond (S,), 0 where it does not depend on one."""

    value: float
    Q: Any = 0.0
    G: Any = 0.0
    rcond: Any = 0.0

    def plus(self, other: Slopes, weight: float) -> Slopes:
        """This one and another one times a weight."""
        parts = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Slopes(*(own + weight * others for own, others in parts))


@dataclass(frozen=True, eq=False)
class Costs(Value):
    """The six costs for one robot and one workspace.

    joints: weights (n,). speeds: 1 / max_velocity (n,), 0 where it is not known. columns: what a unit of each moving
    direction counts (d,), 1 for metres, 1 / length for radians. apart: the pairs of shapes whose clearance counts, if
    it does, up to the distance that is wanted there.
    """

    joints: Vector
    speeds: Vector
    middle: Vector
    half: Vector
    columns: Vector
    own: tuple[OwnCost, ...] = ()
    apart: Clearances | None = None

    @cached_property
    def known(self) -> dict[str, Callable[[Array, Array, Array], Slopes]]:
        """The costs by name."""
        costs = {name: getattr(self, name) for name in Objective.NAMES}
        return costs | {cost.name: partial(_of_own, cost) for cost in self.own}

    def squared_speed(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """mean sum_ij w_i G_ij^2 c_j^2."""
        weighted = G * self.joints[:, None] * self.columns**2 / len(Q)
        return Slopes(float(np.sum(weighted * G)), G=2 * weighted)

    def worst_speed(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """Smooth greatest |G_i c| / max_velocity_i."""
        squares = np.sum((G * self.columns) ** 2, axis=2) * self.speeds**2
        value, slope = _smooth_greatest(squares, POWER / 2)
        value = float(np.sqrt(value))
        outer = slope * self.speeds**2 / (2 * value)
        return Slopes(value, G=outer[:, :, None] * 2 * G * self.columns**2)

    def joint_limits(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """Smooth greatest |q_i - middle_i| / half_i."""
        off = (Q - self.middle) / self.half
        value, slope = _smooth_greatest(off**2, POWER / 2)
        value = float(np.sqrt(value))
        return Slopes(value, Q=slope * off / self.half / value)

    def rcond(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """Smooth greatest 1 / rcond."""
        value, slope = _smooth_greatest(1 / rcond, POWER)
        return Slopes(value, rcond=-slope / rcond**2)

    def travel(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """mean over pairs of sum_i w_i (q_i - q'_i)^2, which is twice the variance."""
        off = (Q - Q.mean(axis=0)) * self.joints / len(Q)
        return Slopes(float(2 * np.sum(off * (Q - Q.mean(axis=0)))), Q=4 * off)

    def clearance(self, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
        """Smooth greatest max(0, 1 - d / D)."""
        if self.apart is None:
            return Slopes(0.0)
        enough = self.apart.wanted
        distances, slopes = self.apart.slopes(Q, enough)
        value, outer = _smooth_greatest(np.maximum(0.0, 1 - distances / enough), POWER)
        return Slopes(value, Q=np.einsum("sp,spn->sn", -outer / enough, slopes))


def _of_own(cost: OwnCost, Q: Matrix, G: Array, rcond: Vector) -> Slopes:
    """mean c(q) of a cost of the user's own."""
    return Slopes(float(np.mean(cost.values(Q))), Q=cost.slopes(Q) / len(Q))


def _smooth_greatest(values: Array, power: float) -> tuple[float, Array]:
    """((mean over the first axis of the sum over the others of a^p)^(1/p), its derivative) of numbers a >= 0."""
    top = float(values.max(initial=0.0))
    if not top:
        return 0.0, np.zeros_like(values)
    share = values / top
    total = float(np.sum(share**power)) / len(values)
    return top * total ** (1 / power), total ** (1 / power - 1) * share ** (power - 1) / len(values)


def costs_of(
    robot: Robot, objective: Objective, turns: Flags, spread: Vector, apart: Clearances | None = None
) -> Costs:
    """The costs for a robot and the moving directions of a workspace.

    Args:
        turns: which of the d directions are turns [rad]. spread: rms spread of the workspace along each (d,).
        apart: what tells how far apart shapes are; without it clearance costs nothing.

    Raises:
        ArgumentError: weights that do not fit, or limits that a cost needs and the robot has not.
    """
    limited = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    cure = "give them in the robot description, or weigh another cost"
    if objective.joint_limits and not limited.any():
        raise ArgumentError("the joints with finite limits", 0, cure)
    if objective.worst_speed:
        speed_limits(robot, cure)
    lower, upper = np.where(limited, robot.lower, -1.0), np.where(limited, robot.upper, 1.0)
    length = length_of(objective, turns, spread)
    return Costs(
        joints=joint_weights(robot, objective),
        speeds=1 / robot.max_velocity,
        middle=(lower + upper) / 2,
        half=np.where(limited, (upper - lower) / 2, np.inf),
        columns=np.where(turns, 1 / length, 1.0),
        own=objective.costs,
        apart=None if apart is None else apart.free,
    )


def length_of(objective: Objective, turns: Flags, spread: Vector) -> float:
    """Metres of tool motion that count as one radian of turning; 1 where the workspace has only one of the two."""
    if objective.length is not None:
        return objective.length
    if turns.all() or not turns.any():
        return 1.0
    return float(np.sqrt(np.mean(spread[~turns] ** 2) / np.mean(spread[turns] ** 2)))


def joint_weights(robot: Robot, objective: Objective) -> Vector:
    """What a squared joint speed counts (n,): as given, or 1 for hinges and (hinges' speed limit / own)^2 for sliders.

    Raises:
        ArgumentError: joints in m and in rad without speed limits, or weights that do not fit. ShapeError.
    """
    if objective.joint_weights is not None:
        return finite("the joint weights", objective.joint_weights, (robot.n,))
    hinges, speeds = robot.hinges, robot.max_velocity
    weights = np.ones(robot.n)
    if hinges.all() or not hinges.any():
        return weights
    speed_limits(robot, "give joint_weights= in the objective: the robot has joints in m and in rad")
    weights[~hinges] = np.mean(speeds[hinges]) ** 2 / speeds[~hinges] ** 2
    return weights
