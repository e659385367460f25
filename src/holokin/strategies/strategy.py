"""`Strategy`: a right inverse G(q) of the task Jacobian, J G = 1, dq = G dx. Its kinds are in `strategy_kinds`.

A strategy is its planes range G, m-dimensional and transversal to the self-motions ker J. With planes spanned by a
frame B (n, m), G = B (J B)^-1. With B = N_G this is the paper's (7), N_G (J N_G)^-1 = H H^T J^T (J H H^T J^T)^-1,
without squaring its condition number (theory 1.3). With planes that rows A (r, n) annul, G = [J; A]^-1 [1; 0].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arguments import Made
from ..base.by_value import ByValue
from ..base.errors import NotFiniteError, ShapeError, SingularityError, SingularityKind
from ..base.tolerances import TOLERANCES
from ..base.types import Array, ArrayLike, Matrix, Vector
from ..robot import Kinematics
from ..symbolic import SX, Evaluator, Function, Transport, as_expression, symbol
from .gain_expressions import Expressions
from .tasks.task import Task

Field = Callable[[Task, Kinematics, SX], SX]
"""An expression of the posture: (task, kinematics, q) -> matrix."""

FORMULA = "look in N_G, the rows or the constraint for a division by zero, a log or a sqrt at that posture"
"""What may be wrong where a law is not finite at a finite posture."""


@dataclass(frozen=True, eq=False, repr=False)
class Strategy(Made, ByValue, ABC):
    """A right inverse of a task: a `FrameStrategy`, a `RowStrategy` or a `HolonomicStrategy`.

    Make one with `moore_penrose`, `weighted`, `null_basis`, `holonomic`, ...
    """

    name: str
    task: Task

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.task.name}, m={self.task.m}, n={self.task.n})"

    def __call__(self, q: ArrayLike) -> Matrix:
        """G(q), (n,) -> (n, m) [joint unit / task unit]; at many postures (k, n) -> (k, n, m).

        Raises:
            SingularityError: J, H or [J; J_g] is singular at q, or the representation is; `.kind` says which. Of many
                postures the first one is told.
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        return self._gain_at.call(q)

    def batch(self, Q: ArrayLike, *, threads: int | None = None) -> Array:
        """`G(Q)` at many postures, (k, n) -> (k, n, m), on `threads` threads; all processors by default.

        Raises:
            SingularityError naming the first singular one.
        """
        return self._gain_at.many(self.task.robot.postures(Q), threads)

    @abstractmethod
    def distribution(self, q: ArrayLike) -> Matrix:
        """N_G (n, m): the frame that the strategy was given by, or its canonical one, G itself (theory 1.4)."""

    def H(self, q: ArrayLike) -> Matrix:
        """H = [N_G N], (n,) -> (n, n), with N = `task.null_space(q)`. [ZR11, Theorem III.2]"""
        return np.hstack([self.distribution(q), self.task.null_space(q)])  # (21): its determinant is 1 for (20)

    def inverse_weight(self, q: ArrayLike) -> Matrix:
        """W = H H^T (n, n): `weighted` with the weight W^-1 gives G at q. W is not unique. [ZR11, (6), (7)]"""
        H = self.H(q)
        return H @ H.T

    def _check(self, q: Vector, rcond: float, margin: float, least: float) -> None:
        """As `check_solved`, which calls it."""
        if margin > TOLERANCES.representation and not rcond > TOLERANCES.singular:
            self._check_finite(q)
        check_regular(self.task, self.name, q, rcond, margin, least)

    # --- expressions and the functions built from them, once --------------------------------------------------

    @cached_property
    @abstractmethod
    def expressions(self) -> Expressions:
        """The expressions over one symbol q."""

    @property
    def looped(self) -> Strategy:
        """The same strategy for what is evaluated and not differentiated: see `HolonomicStrategy.looped`."""
        return self

    @property
    def transport(self) -> Transport | None:
        """The loop whose symbols its expressions hold, if any."""
        return None

    @property
    def margin_expression(self) -> SX:
        """How far the posture is from where a representation, the task's or the constraint's, is singular."""
        return self.task.margin_expression(self.expressions.kinematics.rotation)

    @cached_property
    def gain(self) -> Function:
        """q -> (G, rcond, representation margin), unchecked."""
        s = self.looped
        found = s.expressions.rate(SX.eye(s.task.m))
        outputs = {"G": found.X, "rcond": found.rcond, "margin": s.margin_expression}
        return Function("gain", {"q": s.expressions.q}, outputs, found.system, s.transport)

    @cached_property
    def rate(self) -> Function:
        """(q, dx) -> (dq = G dx, rcond, margin), unchecked: one solve instead of m. [ZR11, (3)]"""
        s, dx = self.looped, symbol("dx", self.task.m)
        found = s.expressions.rate(dx)  # (3)
        outputs = {"dq": found.X, "rcond": found.rcond, "margin": s.margin_expression}
        return Function("rate", {"q": s.expressions.q, "dx": dx}, outputs, found.system, s.transport)

    def _written(self, what: str, planes: Field, shape: tuple[int, int]) -> tuple[SX, Kinematics, SX, SX]:
        """(q, kinematics, J, planes) over a new symbol. Raises: ShapeError unless the planes have the shape."""
        q = symbol("q", self.task.n)
        k = self.task.kinematics(q)
        found = as_expression(planes(self.task, k, q))
        if found.shape != shape:
            cure = "it must fit n joints and m task rows"
            raise ShapeError(f"{what} of {self.name!r}", shape, found.shape, cure)
        return q, k, self.task.jacobian_expression(k, q), found

    def _planes_at(self, q: ArrayLike) -> Matrix:
        return np.reshape(self._planes(self.task.robot.checked(q)), self.looped.expressions.planes.shape)

    @cached_property
    def _planes(self) -> Function:
        e = self.looped.expressions
        return Function("planes", {"q": e.q}, {"planes": e.planes}, None, self.looped.transport)

    @cached_property
    def _gain_at(self) -> Evaluator:
        shape, bounds = (self.task.n, self.task.m), (TOLERANCES.singular, TOLERANCES.representation)
        return self.gain.checked(shape, self.task.robot.checked, self._doubtful_gain, bounds)

    def _doubtful_gain(self, q: Vector, G: Matrix, rcond: float, margin: float) -> Matrix:
        check_solved(self, self.task.robot.checked(q), rcond, margin)
        if not np.isfinite(G).all():
            self._check_finite(q)
            raise NotFiniteError(f"G of {self.name!r} at q = {q.tolist()}", G.tolist(), FORMULA)
        return G

    def _doubtful(self, q: Vector, found: Array, rcond: float, margin: float) -> Array:
        """What was found at q, unless the strategy is singular there."""
        check_solved(self, self.task.robot.checked(q), rcond, margin)
        return found

    def _check_finite(self, q: Vector) -> None:
        """Raises: NotFiniteError when what the user wrote, frame, rows or constraint, is not finite at a sound q."""
        J, margin = self.task.jacobian_batch(q[None])
        s = np.linalg.svd(J[0], compute_uv=False)
        values = np.asarray(self._planes(q))
        if margin[0] > TOLERANCES.representation and s[-1] > TOLERANCES.rank * s[0] and not np.isfinite(values).all():
            raise NotFiniteError(f"what defines {self.name!r} at q = {q.tolist()}", values.tolist(), FORMULA)


def check_solved(
    strategy: Strategy, q: Vector, rcond: float, margin: float, least: float = TOLERANCES.singular
) -> None:
    """Raises: SingularityError, of which kind it says, unless rcond > least and margin (as of `gain`) suffices."""
    strategy._check(q, rcond, margin, least)


def check_regular(
    task: Task, name: str, q: Vector, rcond: float, margin: float, least: float = TOLERANCES.singular
) -> None:
    """Raises: SingularityError of a law at q, saying of which kind, unless rcond > least and margin suffices."""
    what = f"{name} ({task.name})"
    if not margin > TOLERANCES.representation:
        raise SingularityError(SingularityKind.REPRESENTATION, q, what, margin)
    if rcond > least:
        return
    s = np.linalg.svd(task.jacobian(q), compute_uv=False)
    kinematic = s[-1] <= max(TOLERANCES.rank, least) * s[0]
    kind = SingularityKind.KINEMATIC if kinematic else SingularityKind.ALGORITHMIC
    raise SingularityError(kind, q, what, s[-1] if kinematic else rcond)


def checked_rate(strategy: Strategy) -> Callable[[Vector, Vector], Vector]:
    """(q, dx) -> dq = G(q) dx, for all who integrate it. Raises (when called): SingularityError."""

    def rate(q: Vector, dx: Vector) -> Vector:
        dq, rcond, margin = strategy.rate(q, dx)
        check_solved(strategy, q, rcond, margin)
        return dq

    return rate
