"""The equation of a leaf over a family of tool poses, E(q, y) = [f(q) - x(y); g(q) - c] = 0, and its enclosures.

The rows of an orientation are polynomials of rotations, so that no logarithm is enclosed: with M = R_d R^T they are the
skew part of M, 1/2 (M_32 - M_23, M_13 - M_31, M_21 - M_12), which vanishes where R = R_d, and where R is R_d turned by
pi, which `facing` > 0 excludes; of an axis the two components of R a across R_d a. At a root D_q E is [J; J_g], its
orientation rows up to sign and the coordinates of the orientation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..errors import ArgumentError
from ..representations import AxisDirection
from ..strategies import HolonomicStrategy
from ..symbolic import SX, jacobian, substitute, symbol, vertcat
from ..symbolic.geometry import frame_about
from ..symbolic.interval_function import IntervalFunction, operation_list
from ..symbolic.separated import Separated
from ..task import Task
from ..task_kinds import FrameTask
from ..types import Value, Vector
from .targets import Family


def one_frame(task: Task) -> FrameTask:
    """The task, of one tool. Raises: ArgumentError for one of several frames."""
    if not isinstance(task, FrameTask):
        cure = "prove it of one tool: a task of several frames has no proof yet"
        raise ArgumentError("the task to certify", task.name, cure)
    return task


def turned(task: FrameTask) -> bool:
    """Whether its angular rows are those of a twist: of a full orientation, or the one of a plane."""
    return task.turns or (task.geometric and any(task.angular))


def rows_of(task: FrameTask, position: SX, rotation: SX, wanted_position: SX, wanted_rotation: SX) -> tuple[SX, SX]:
    """(f(q) - x (m,), what must be positive so that no half turn is taken for none)."""
    six = [position[i] - wanted_position[i] for i in range(3)]
    facing = SX(1)
    kind = task.representation
    if turned(task):
        M = wanted_rotation @ rotation.T
        six += [(M[1, 2] - M[2, 1]) / 2, (M[2, 0] - M[0, 2]) / 2, (M[0, 1] - M[1, 0]) / 2]
        facing = M[0, 0] + M[1, 1] + M[2, 2] + 1
    elif isinstance(kind, AxisDirection) and sum(i > 2 for i in task.rows) == 2:
        a = SX(kind.axis)
        across = (wanted_rotation @ SX(frame_about(kind.axis)))[:, :2].T @ (rotation @ a)
        six += [across[0], across[1]]
        facing = (wanted_rotation @ a).T @ (rotation @ a)
    elif task.orientation is not None:
        gap = kind.value(rotation) - kind.value(wanted_rotation)
        six += [gap[i] for i in range(gap.shape[0])]
    return vertcat(*(six[i] for i in task.rows)), facing


@dataclass(frozen=True, eq=False)
class Equation(Value):
    """E(q, y) (n,) of a holonomic strategy on the leaf c (r,), over a family of tool poses.

    Each enclosure below takes its arguments one below the other, in the order named.
    """

    strategy: HolonomicStrategy
    family: Family

    @property
    def n(self) -> int:
        """Joints, and rows."""
        return self.strategy.task.n

    @property
    def d(self) -> int:
        """Parameters of the family."""
        return self.family.dimension

    @cached_property
    def _symbols(self) -> tuple[dict[str, SX], SX, SX]:
        """(inputs, E, facing)."""
        if self.strategy.constraint.looped is not None:
            cure = "its leaves are carried by a differential equation: prove the polynomial that `fitted` makes of it"
            raise ArgumentError("the strategy to certify", self.strategy.name, cure)
        e, task = self.strategy.expressions, one_frame(self.strategy.task)
        y, numbers, c = symbol("y", self.d), symbol("numbers", self.family.numbers), symbol("c", self.n - task.m)
        k = e.kinematics
        rows, facing = rows_of(task, k.position, k.rotation, *self.family.pose(y, numbers))
        inputs = {"q": e.q, "y": y, "numbers": numbers, "c": c}
        return inputs, vertcat(rows, self.strategy.constraint_expression - c), facing

    @cached_property
    def operations(self) -> list[list[Any]]:
        """E, `facing` and what of the tool pose enters E, of (q, y, numbers, c), as a list of operations."""
        inputs, E, facing = self._symbols
        return operation_list(inputs, vertcat(E, facing, self._target(inputs["y"], inputs["numbers"])))

    def _target(self, y: SX, numbers: SX) -> SX:
        """What of the tool pose enters E; of a turn R_d itself, whose change bounds that of its rows twice over."""
        p, R = self.family.pose(y, numbers)
        task = one_frame(self.strategy.task)
        if turned(task) or isinstance(task.representation, AxisDirection):
            return vertcat(p, R.reshape((9, 1)))
        return p if task.orientation is None else vertcat(p, task.representation.value(R))

    def periodic(self, turns: Vector) -> bool:
        """Whether E stays as it is, but for whole turns of its angles, when the joints go on by whole turns (n,).

        By the list of operations: each value is followed by what it goes on by, in turns, where that is known.
        """
        shifts: list[float | None] = []
        known: dict[int, float] = {}
        rows: list[float | None] = []
        for name, *of in self.operations:
            given = [shifts[i] for i in of] if name not in ("const", "input") else []
            moved = any(s != 0 for s in given)
            found: float | None = None
            if name == "input":
                found = float(turns[of[0]]) if of[0] < self.n else 0.0
            elif name == "const":
                known[len(shifts)], found = of[0], 0.0
            elif name == "output":
                rows.append(given[0])
                continue
            elif not moved or (name in ("sin", "cos") and given[0] is not None and given[0] % 1 == 0):
                found = 0.0
            elif None not in given and name in ("add", "sub", "neg", "twice"):
                a, b = (float(s or 0.0) for s in (given[0], given[-1]))
                found = {"add": a + b, "sub": a - b, "neg": -a, "twice": 2 * a}[name]
            elif None not in given and name == "mul" and any(i in known for i in of):
                factor, other = (of[0], 1) if of[0] in known else (of[1], 0)
                found = known[factor] * float(given[other] or 0.0) if known[factor] % 1 == 0 else None
            shifts.append(found)
        angular = [*self.angular, *[False] * (len(rows) - self.n)]
        return all(s == 0 or (a and s is not None and s % 1 == 0) for s, a in zip(rows, angular, strict=True))

    @property
    def angular(self) -> tuple[bool, ...]:
        """(n,) which rows of E count but for whole turns."""
        return (False,) * self.strategy.task.m + tuple(self.strategy.constraint.angular)

    @cached_property
    def _separated(self) -> Separated:
        """E and `facing`, for derivatives that are exact."""
        inputs, E, facing = self._symbols
        return Separated.of(inputs, vertcat(E, facing), [*self.angular, False])

    def _enclosed(self, name: str, inputs: dict[str, SX], output: SX) -> IntervalFunction:
        return IntervalFunction(name, inputs, output, (self._separated.symbols, self._separated.values))

    @cached_property
    def guards(self) -> int:
        """How many expressions must not vanish, for E to be smooth."""
        return self._separated.guards.shape[0]

    @cached_property
    def value(self) -> IntervalFunction:
        """(q, y, numbers, c) -> E, and D_q E column by column."""
        inputs, E = self._symbols[0], self._separated.output[: self.n]
        A = jacobian(E, inputs["q"])
        return self._enclosed("E", inputs, vertcat(E, A.reshape((-1, 1))))

    @cached_property
    def curvature(self) -> IntervalFunction:
        """(q, y, numbers, c) -> facing, the guards, columns (j, k), j <= k, of D_q^2 E.

        Where the tool turns the columns of D_y D_q E follow.
        """
        inputs, both = self._symbols[0], self._separated
        E, facing = both.output[: self.n], both.output[self.n]
        q, y = inputs["q"], inputs["y"]
        A = jacobian(E, q)
        found = [facing, both.guards]
        for j in range(self.n):
            found.append(jacobian(A[:, j], q)[:, j:].reshape((-1, 1)))
        if self.family.turning:
            found += [jacobian(A[:, j], y).reshape((-1, 1)) for j in range(self.n)]
        return self._enclosed("the second derivatives of E", inputs, vertcat(*found))

    @cached_property
    def along(self) -> IntervalFunction:
        """(y, q0, V, Q, numbers, c) -> first derivatives by y of E(q0 + V y + 1/2 Q y y, y), and second ones, i <= j.

        V (n, d) and Q (n, d (d + 1) / 2), of the pairs i <= j, column by column.
        """
        inputs, E = self._symbols[0], self._separated.output[: self.n]
        n, d = self.n, self.d
        y, q0, V = inputs["y"], symbol("q0", n), symbol("V", n, d)
        Q = symbol("Q", n, d * (d + 1) // 2)
        way = q0 + V @ y
        pairs = [(i, j) for i in range(d) for j in range(i, d)]
        for k, (i, j) in enumerate(pairs):
            way += Q[:, k] * y[i] * y[j] * (0.5 if i == j else 1.0)
        F = substitute(E, inputs["q"], way)
        first = jacobian(F, y)
        second = [jacobian(first[:, i], y)[:, i:].reshape((-1, 1)) for i in range(d)]
        taken = {"y": y, "q0": q0, "V": V, "Q": Q, "numbers": inputs["numbers"], "c": inputs["c"]}
        return self._enclosed("E along the predictor", taken, vertcat(first.reshape((-1, 1)), *second))

    @cached_property
    def seam(self) -> IntervalFunction:
        """(numbers, others) -> by what E changes from the end of one member to the beginning of another."""
        one, other = symbol("numbers", self.family.numbers), symbol("others", self.family.numbers)
        change = self._target(SX([1.0]), one) - self._target(SX([-1.0]), other)
        return IntervalFunction("the poses at a seam", {"numbers": one, "others": other}, change)
