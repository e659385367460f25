"""The three kinds of strategies: planes from a frame, from rows, from a constraint. Every strategy is one of them."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, final

import numpy as np

from ..base.arguments import typed
from ..base.errors import NotFiniteError, SingularityError, SingularityKind
from ..base.tolerances import TOLERANCES
from ..base.types import ArrayLike, Matrix, Vector
from ..symbolic import SX, Evaluator, Function, Transport, fmin, vertcat
from .constraints import Constraint
from .gain_expressions import FrameExpressions, RowExpressions
from .strategy import FORMULA, Field, Strategy


@final
@dataclass(frozen=True, eq=False, repr=False)
class FrameStrategy(Strategy):
    """Planes spanned by a frame B(q) (n, m): G = B (J B)^-1.

    `constant_inverse_weight`: W (n, n) where B = W J^T with a constant W, whose curvature the Hessians of the arm give.
    """

    frame: Field
    constant_inverse_weight: Matrix | None = None

    @cached_property
    def expressions(self) -> FrameExpressions:
        """The expressions over one symbol q; `planes` is B."""
        return FrameExpressions(*self._written("the frame N_G", self.frame, (self.task.n, self.task.m)))

    def distribution(self, q: ArrayLike) -> Matrix:
        """N_G = B (n, m) as it was given."""
        return self._planes_at(q)


@dataclass(frozen=True, eq=False, repr=False)
class KernelStrategy(Strategy):
    """Planes that rows A(q) (r, n) annul: G = [J; A]^-1 [1; 0]. Abstract: the rows are given, or a gradient."""

    @abstractmethod
    def field(self) -> Field:
        """The field of the rows A."""

    @cached_property
    def expressions(self) -> RowExpressions:
        """The expressions over one symbol q; `planes` is A."""
        shape = (self.task.n - self.task.m, self.task.n)
        return RowExpressions(*self._written("the constraint rows", self.field(), shape))

    def distribution(self, q: ArrayLike) -> Matrix:
        """G (n, m), the canonical frame (theory 1.4)."""
        return self(self.task.robot.checked(q))

    def rows(self, q: ArrayLike) -> Matrix:
        """A (r, n) at q (n,); at many postures (k, n) -> (k, r, n). Raises: ShapeError, NotFiniteError."""
        return self._rows_at.call(q)

    @cached_property
    def _rows_at(self) -> Evaluator:
        shape = (self.task.n - self.task.m, self.task.n)
        return self._planes.checked(shape, self.task.robot.checked, self._doubtful_rows)

    def _doubtful_rows(self, q: Vector, A: Matrix) -> Matrix:
        self.task.robot.checked(q)
        if not np.isfinite(A).all():
            raise NotFiniteError(f"the constraint rows of {self.name!r} at q = {q.tolist()}", A.tolist(), FORMULA)
        return A


@final
@dataclass(frozen=True, eq=False, repr=False)
class RowStrategy(KernelStrategy):
    """Planes that given rows annul, gradients or not."""

    annulling: Field

    def field(self) -> Field:
        """The field of the rows, as given."""
        return self.annulling


@final
@dataclass(frozen=True, eq=False, repr=False)
class HolonomicStrategy(KernelStrategy):
    """Planes tangent to the leaves g(q) = c of a constraint: the rows are J_g = dg/dq."""

    constraint: Constraint

    cure: ClassVar[str] = (
        "give a strategy with leaves: hk.holonomic(task, g) makes one of a constraint, hk.radial(G, q0) one of any G"
    )

    def field(self) -> Field:
        """J_g of the constraint."""
        return self.constraint.slopes

    @property
    def looped(self) -> HolonomicStrategy:
        """The strategy for what is evaluated, not differentiated: a transport in its constraint is left to a loop."""
        return self if self.constraint.looped is None else self._looped

    @cached_property
    def _looped(self) -> HolonomicStrategy:
        return replace(self, constraint=self.constraint.looped or self.constraint)

    @property
    def transport(self) -> Transport | None:
        """The loop whose symbols its expressions hold: a `Function` of them must be told of it."""
        return self.constraint.transport

    def g(self, q: ArrayLike) -> Vector:
        """g(q), (n,) -> (r,): constant along all that the strategy does. At many postures (k, n) it is (k, r).

        Raises:
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._constraint_at.call(q)

    @property
    def margin_expression(self) -> SX:
        """How far the posture is from where a representation, the task's or the constraint's, is singular."""
        e, margin = self.expressions, super().margin_expression
        if self.constraint.margin is not None:
            margin = fmin(margin, self.constraint.margin(self.task, e.kinematics, e.q))
        return margin

    def _check(self, q: Vector, rcond: float, margin: float, least: float) -> None:
        """Says of a constraint that names its places, too, where it is singular."""
        if not margin > TOLERANCES.representation and self.constraint.places:
            for (place, _), distance in zip(self.constraint.places, np.ravel(self._places(q)).tolist(), strict=True):
                if not distance > TOLERANCES.representation:
                    what = f"{self.name} ({self.task.name}), {place},"
                    raise SingularityError(SingularityKind.REPRESENTATION, q, what, distance)
        super()._check(q, rcond, margin, least)

    @cached_property
    def _places(self) -> Function:
        """q -> the distances that the constraint's margin is the least of."""
        e = self.expressions
        distances = vertcat(*(place(self.task, e.kinematics, e.q) for _, place in self.constraint.places))
        return Function("places", {"q": e.q}, {"distances": distances})

    @property
    def constraint_expression(self) -> SX:
        """g(q) (r,)."""
        return self.constraint.bind(self.task, self.expressions.kinematics, self.expressions.q)

    @cached_property
    def constraint_value(self) -> Function:
        """q -> g(q) (r,)."""
        s = self.looped
        return Function("constraint", {"q": s.expressions.q}, {"g": s.constraint_expression}, None, s.transport)

    @typed
    def leaf_gap(self, c: SX) -> SX:
        """c - g(q) (r,) as an expression, its angles in (-pi, pi]."""
        return self.constraint.nearest(c - self.constraint_expression)

    @cached_property
    def _constraint_at(self) -> Evaluator:
        return self.constraint_value.checked((self.constraint.rows,), self.task.robot.checked, self._doubtful_value)

    def _doubtful_value(self, q: Vector, g: Vector) -> Vector:
        self.task.robot.checked(q)
        if not np.isfinite(g).all():
            raise NotFiniteError(f"g(q) of {self.name!r} at q = {q.tolist()}", g.tolist())
        return g
