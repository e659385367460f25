"""`Frame`: whose pose a task is about: a tool, a tool in the frame of another one, an expression of your own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

from ...base.arguments import Made
from ...base.errors import ShapeError
from ...base.types import Value
from ...robot import Kinematics, Robot, hessian_expression
from ...symbolic import SX, cross, densify, horzcat, jacobian, symbol, vertcat, written


@dataclass(frozen=True, eq=False)
class Frame(Value, ABC):
    """A pose that depends on the joints: position (3,), rotation (3, 3) and geometric Jacobian (6, n)."""

    has_hessians: ClassVar[bool] = False
    """Whether the derivatives of its Jacobian have a closed form."""
    spatial: ClassVar[bool] = True
    """Whether its coordinates are places of a tool in metres."""

    @abstractmethod
    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """Its expressions. Raises: UnknownNameError: the robot lacks a tip that it names."""

    def hessians(self, robot: Robot, q: SX) -> list[SX]:
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
    has_hessians = True

    def kinematics(self, robot: Robot, q: SX) -> Kinematics:
        """Those of the robot."""
        return robot.kinematics(q, self.name)

    def hessians(self, robot: Robot, q: SX) -> list[SX]:
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
        away = t.position - o.position
        columns = [
            vertcat(
                o.rotation.T @ (t.jacobian[:3, i] - o.jacobian[:3, i] - cross(o.jacobian[3:, i], away)),
                o.rotation.T @ (t.jacobian[3:, i] - o.jacobian[3:, i]),
            )
            for i in range(robot.n)
        ]
        J = SX.zeros(6, robot.n)
        for i, column in enumerate(columns):
            J[:, i] = column
        return replace(t, position=o.rotation.T @ away, rotation=o.rotation.T @ t.rotation, jacobian=densify(J))

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

    def in_threes(self) -> list[ExpressionFrame]:
        """Frames of three rows each, and one of the rest."""
        if len(self.row_units) <= 3:
            return [self]

        return [
            ExpressionFrame(
                self.name,
                partial(_three, self.name, self.expression, i),
                self.row_units[i : i + 3],
                self.row_names[i : i + 3],
            )
            for i in range(0, len(self.row_units), 3)
        ]

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
