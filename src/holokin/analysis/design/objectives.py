"""`Objective`: what a section q(x) of a workspace should be good at, as a cost of its postures and their slopes.

A section is given at S tool poses: postures Q (S, n) and slopes G (S, n, d) = dq/dx along the d directions in which the
workspace reaches. Every cost comes with its exact derivatives by these two; it knows nothing of constraints, levels or
polynomials.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from ...base.arguments import check
from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import Array, Flags, Matrix, Value, Vector, not_negative, positive
from ...robot import Robot, speed_limits

POWER = 24
"""Exponent of the smooth greatest value, (mean a^p)^(1/p): of 256 numbers one of which stands out it is 21 % too low,
of a smooth function over a box a few per cent."""


Cost = Literal["squared_speed", "joint_limits"]
"""The names of the costs."""


@dataclass(frozen=True, eq=False)
class Objective(Value):
    """The cost of a section: one of two, or their weighted sum, each divided by its value before the design.

    squared_speed: mean squared joint speed, mean over the poses of |G|_F^2, for a tool that moves at 1 m/s along each
        direction [rad^2/m^2]; a sliding joint [m] counts as a hinge [rad] that uses the same share of its speed limit.
    joint_limits: greatest |q - middle| over half the joint's range, 1 at a limit.
    length: metres of tool motion that count as one radian of turning; by default the spread of the workspace's
        positions over that of its directions.
    """

    squared_speed: float = 0.0
    joint_limits: float = 0.0
    length: float | None = field(default=None, kw_only=True)

    NAMES: ClassVar[tuple[Cost, ...]] = get_args(Cost)

    def __post_init__(self) -> None:
        for name in self.NAMES:
            not_negative(f"the weight of {name}", getattr(self, name))
        if not self.weights:
            raise ArgumentError("the objective", "nothing", f"give a positive weight to one of {', '.join(self.NAMES)}")
        if self.length is not None:
            positive("the length of an objective", self.length)
        super().__post_init__()

    @property
    def weights(self) -> dict[str, float]:
        """The weights of the costs that count."""
        return {name: float(w) for name in self.NAMES if (w := getattr(self, name))}


def as_objective(given: Objective | str) -> Objective:
    """An objective, also of the name of a cost. Raises: UnknownNameError."""
    check("the objective", Objective | str, given)
    if isinstance(given, Objective):
        return given
    name = given.replace(" ", "_").replace("-", "_")
    if name not in Objective.NAMES:
        raise UnknownNameError("objective", given, Objective.NAMES)
    weights: dict[str, Any] = {name: 1.0}
    return Objective(**weights)


@dataclass(frozen=True)
class Slopes:
    """A cost and its derivatives by Q (S, n) and G (S, n, d), 0 where it does not depend on one."""

    value: float
    Q: Any = 0.0
    G: Any = 0.0

    def plus(self, other: Slopes, weight: float) -> Slopes:
        """This one and another one times a weight."""
        parts = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Slopes(*(own + weight * others for own, others in parts))


@dataclass(frozen=True, eq=False)
class Costs(Value):
    """The costs for one robot and one workspace.

    joints: weights (n,) of squared joint speeds. middle, half: of the joints' ranges (n,). columns: what a unit of each
    moving direction counts (d,), 1 for metres, 1 / length for radians.
    """

    joints: Vector
    middle: Vector
    half: Vector
    columns: Vector

    @cached_property
    def known(self) -> dict[str, Callable[[Matrix, Array], Slopes]]:
        """The costs by name."""
        return {name: getattr(self, name) for name in Objective.NAMES}

    def squared_speed(self, Q: Matrix, G: Array) -> Slopes:
        """mean sum_ij w_i G_ij^2 c_j^2."""
        weighted = G * self.joints[:, None] * self.columns**2 / len(Q)
        return Slopes(float(np.sum(weighted * G)), G=2 * weighted)

    def joint_limits(self, Q: Matrix, G: Array) -> Slopes:
        """Smooth greatest |q_i - middle_i| / half_i."""
        off = (Q - self.middle) / self.half
        value, slope = _smooth_greatest(off**2, POWER / 2)
        value = float(np.sqrt(value))
        return Slopes(value, Q=slope * off / self.half / value)


def _smooth_greatest(values: Array, power: float) -> tuple[float, Array]:
    """((mean over the first axis of the sum over the others of a^p)^(1/p), its derivative) of numbers a >= 0."""
    top = float(values.max(initial=0.0))
    if not top:
        return 0.0, np.zeros_like(values)
    share = values / top
    total = float(np.sum(share**power)) / len(values)
    return top * total ** (1 / power), total ** (1 / power - 1) * share ** (power - 1) / len(values)


def costs_of(robot: Robot, objective: Objective, turns: Flags, spread: Vector) -> Costs:
    """The costs for a robot and the moving directions of a workspace.

    Args:
        turns: which of the d directions are turns [rad]. spread: rms spread of the workspace along each (d,).

    Raises:
        ArgumentError: limits that a cost needs and the robot has not.
    """
    limited = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    if objective.joint_limits and not limited.any():
        cure = "give them in the robot description, or weigh another cost"
        raise ArgumentError("the joints with finite limits", 0, cure)
    lower, upper = np.where(limited, robot.lower, -1.0), np.where(limited, robot.upper, 1.0)
    return Costs(
        joints=joint_weights(robot),
        middle=(lower + upper) / 2,
        half=np.where(limited, (upper - lower) / 2, np.inf),
        columns=np.where(turns, 1 / length_of(objective, turns, spread), 1.0),
    )


def length_of(objective: Objective, turns: Flags, spread: Vector) -> float:
    """Metres of tool motion that count as one radian of turning; 1 where the workspace has only one of the two."""
    if objective.length is not None:
        return objective.length
    if turns.all() or not turns.any():
        return 1.0
    return float(np.sqrt(np.mean(spread[~turns] ** 2) / np.mean(spread[turns] ** 2)))


def joint_weights(robot: Robot) -> Vector:
    """What a squared joint speed counts (n,): 1 for hinges and (hinges' speed limit / own)^2 for sliders.

    Raises:
        ArgumentError: joints in m and in rad without speed limits.
    """
    hinges, speeds = robot.hinges, robot.max_velocity
    weights = np.ones(robot.n)
    if hinges.all() or not hinges.any():
        return weights
    speed_limits(robot, "give them in the robot description: the robot has joints in m and in rad")
    weights[~hinges] = np.mean(speeds[hinges]) ** 2 / speeds[~hinges] ** 2
    return weights
