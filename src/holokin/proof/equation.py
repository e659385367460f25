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

import numpy as np

from ..base.types import Flags, Matrix, Value, Vector
from ..strategies import HolonomicStrategy
from ..symbolic import SX, jacobian, substitute, symbol, vertcat
from ..symbolic.interval_function import IntervalFunction, operation_list
from ..symbolic.rotations import one_formula
from ..symbolic.separated import Separated
from .targets import Family
from .task_rows import reached_by, rows_of, target_of

ROOM = 6_000_000
"""Numbers of intervals that may be in memory at once: 100 MB."""


@dataclass(frozen=True, eq=False)
class Equation(Value):
    """E(q, y) (n,) of a holonomic strategy on the leaf c (r,), over a family of tool poses.

    Where its constraint is `implicit`, q holds the joints and then its unknowns, and E their equations at the end.
    Each enclosure below takes its arguments one below the other, in the order named.
    """

    strategy: HolonomicStrategy
    family: Family

    @property
    def joints(self) -> int:
        """Joints: the first of the unknowns."""
        return self.strategy.task.n

    @cached_property
    def n(self) -> int:
        """Unknowns, and rows."""
        implicit = self.strategy.constraint.implicit
        return self.joints + (implicit.size(self.strategy.task) if implicit else 0)

    @cached_property
    def at_once(self) -> int:
        """Cells whose second derivatives are enclosed at once, in `ROOM`."""
        return max(1, ROOM // (self.curvature.operations + 4 * self.n**3))

    @property
    def d(self) -> int:
        """Parameters of the family."""
        return self.family.dimension

    def level(self, q0: Vector) -> Vector:
        """The c of E: the leaf through a posture (joints,)."""
        return np.atleast_1d(self.strategy.g(q0))

    def completed(self, q: Matrix) -> Matrix:
        """All unknowns (k, n) at postures (k, joints)."""
        implicit, task = self.strategy.constraint.implicit, self.strategy.task
        if implicit is None or not len(q):
            return q
        return np.hstack([q, [implicit.at(task, one) for one in q]])

    @cached_property
    def _symbols(self) -> tuple[dict[str, SX], SX, SX]:
        """(inputs, E, facing)."""
        e, task, constraint = self.strategy.expressions, self.strategy.task, self.strategy.constraint
        y, numbers, c = symbol("y", self.d), symbol("numbers", self.family.numbers), symbol("c", constraint.rows)
        k, others = e.kinematics, symbol("others", self.n - self.joints)
        rows, facing = rows_of(task, k.position, k.rotation, *self.family.pose(y, numbers))
        with one_formula():
            if constraint.implicit is None:
                g, h = constraint.bind(task, k, e.q), SX(0, 1)
            else:
                g, h = constraint.implicit.rows(task, k, e.q, others)
        inputs = {"q": vertcat(e.q, others), "y": y, "numbers": numbers, "c": c}
        return inputs, vertcat(rows, g - c, h), facing

    @cached_property
    def positive(self) -> int:
        """How many numbers `facing` has, one a frame."""
        return self._symbols[2].shape[0]

    @cached_property
    def operations(self) -> list[list[Any]]:
        """E, `facing` and what of the tool pose enters E, of (q, y, numbers, c), as a list of operations."""
        inputs, E, facing = self._symbols
        return operation_list(inputs, vertcat(E, facing, self._target(inputs["y"], inputs["numbers"])))

    def _target(self, y: SX, numbers: SX) -> SX:
        return target_of(self.strategy.task, *self.family.pose(y, numbers))

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
                found = float(turns[of[0]]) if of[0] < self.joints else 0.0
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
        task, constraint = self.strategy.task, self.strategy.constraint
        return (False,) * task.m + tuple(constraint.angular) + (False,) * (self.n - self.joints)

    @property
    def derivative(self) -> str:
        """What D_q E is, in words of the theorem: with auxiliary unknowns among q it is not [J; J_g]."""
        return "D_q E" if self.n > self.joints else "[J; J_g]"

    @property
    def revolute(self) -> Flags:
        """(n,) which unknowns are angles of joints."""
        units = [c.unit for c in self.strategy.task.robot.coordinates]
        return np.array([unit == "rad" for unit in units] + [False] * (self.n - self.joints))

    @cached_property
    def _separated(self) -> Separated:
        """E and `facing`, for derivatives that are exact."""
        inputs, E, facing = self._symbols
        return Separated.of(inputs, vertcat(E, facing), [*self.angular, *[False] * self.positive])

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
        E, facing = both.output[: self.n], both.output[self.n :]
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

    @cached_property
    def reached(self) -> IntervalFunction:
        """(y, numbers) -> the rows of the tool pose: E is the same where they are."""
        y, numbers = symbol("y", self.d), symbol("numbers", self.family.numbers)
        pose = reached_by(self.strategy.task, *self.family.pose(y, numbers))
        return IntervalFunction("the tool pose", {"y": y, "numbers": numbers}, pose)
