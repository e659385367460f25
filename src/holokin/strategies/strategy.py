"""`Strategy`: a right inverse G(q) of the task Jacobian, J G = 1, dq = G dx, and its kinds.

A strategy is its planes range G, m-dimensional and transversal to the self-motions ker J. With planes spanned by a
frame B (n, m), G = B (J B)^-1. With B = N_G this is the paper's (7), N_G (J N_G)^-1 = H H^T J^T (J H H^T J^T)^-1,
without squaring its condition number (theory 1.3). With planes that rows A (r, n) annul, G = [J; A]^-1 [1; 0].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, final

import numpy as np

from ..base.arguments import Made, typed
from ..base.errors import NotFiniteError, ShapeError, SingularityError, SingularityKind
from ..base.tolerances import TOLERANCES
from ..base.types import Array, ArrayLike, ByValue, Flags, Matrix, Vector
from ..robot import Kinematics
from ..symbolic import (
    SX,
    Evaluator,
    Function,
    Solution,
    Transport,
    as_expression,
    as_map,
    directional,
    dot,
    factorise,
    fmin,
    gradient,
    least_norm,
    norm_2,
    pairwise_brackets,
    same,
    solution,
    symbol,
    vertcat,
)
from ..symbolic.linear import back_substitute, null_space_expression
from .constraints import Constraint
from .tasks.task import Field as Field
from .tasks.task import Task

# --- The planes of a strategy as expressions: the span of a frame, or the kernel of rows (theory 1.3).

Brackets = dict[tuple[int, int], SX]
"""[B_a, B_b] (n,) of the columns a < b of a frame."""


@dataclass(frozen=True)
class Expressions(ABC):
    """The expressions of a strategy over its symbol q (n,): kinematics, task Jacobian J (m, n), and its planes."""

    q: SX
    kinematics: Kinematics
    J: SX
    planes: SX

    @abstractmethod
    def rate(self, dx: SX, *, written_out: bool = False) -> Solution:
        """G dx, (m, k) -> (n, k), with its rcond, by orthogonal factorisations only.

        Args:
            written_out: for those who differentiate it: no system is left to numbers, however large.
        """

    @abstractmethod
    def slope(self, dx: SX, weight: SX) -> tuple[SX, SX]:
        """The gradients of weight^T G(q) dx by q, (n,), and by dx, (m,), by the same factorisations as `rate`.

        No factorisation is differentiated: of A x = b, by q, w^T dx = -(A^-T w)^T (dA x - db).

        Args:
            dx: (m,). weight: (n,).
        """

    @abstractmethod
    def brackets(self, G: SX, of_frame: Brackets | None = None) -> tuple[SX, list[SX]]:
        """Rows A (r, n) that annul the planes, and A_k [G_i, G_j] as (m, m) for each row k (theory 5.1).

        Args:
            of_frame: the brackets of the frame, where they are known in closed form.
        """


@final
@dataclass(frozen=True)
class FrameExpressions(Expressions):
    """Planes spanned by a frame B (n, m): G = B (J B)^-1."""

    def rate(self, dx: SX, *, written_out: bool = False) -> Solution:
        """G dx by B = Q R: Q (J Q)^-1 dx; with B = J^T the same is Q R^-T dx."""
        if same(self.planes, self.J.T):
            return least_norm(self.J, dx)
        frame = factorise(self.planes)
        # (7): Q (J Q)^-1 = H H^T J^T (J H H^T J^T)^-1, whatever the basis
        Q = frame.thin_q()
        inner = factorise(self.J @ Q)  # (9): regular where H is
        return Solution(Q @ inner.solve(dx), fmin(frame.rcond(), inner.rcond()))

    def slope(self, dx: SX, weight: SX) -> tuple[SX, SX]:
        """Of x = B c, J B c = dx, with y = (J B)^-T B^T w: w^T dx = (w - J^T y)^T dB c - y^T dJ x."""
        if same(self.planes, self.J.T):  # y = R^-1 Q^T w, c = R^-1 R^-T dx
            frame = factorise(self.planes)
            m, rotated = self.J.shape[0], frame.transpose_times(weight)
            x, y = frame.solve_transposed(dx), back_substitute(frame.R, rotated[:m])
            left = frame.complement_times(rotated[m:])  # w - J^T y, without its round-off
        else:
            frame = factorise(self.planes)
            Q = frame.thin_q()
            inner = factorise(self.J @ Q)
            x, y = Q @ inner.solve(dx), inner.solve_transposed(Q.T @ weight)
            left = weight - self.J.T @ y
        c = frame.solve(x)

        def form(y: SX, left: SX, c: SX, x: SX) -> SX:
            return left.T @ self.planes @ c - y.T @ self.J @ x

        return _slope_of(form, self.q, y, left, c, x), y

    def brackets(self, G: SX, of_frame: Brackets | None = None) -> tuple[SX, list[SX]]:
        """G = B M: A [G_i, G_j] = sum_ab M_ai M_bj A [B_a, B_b], so only B is differentiated."""
        B, m = self.planes, self.J.shape[0]
        A = null_space_expression(B.T).T
        M = factorise(self.J @ B).solve(SX.eye(m))  # Proposition 1
        brackets = of_frame or pairwise_brackets(B, self.q)
        curvatures = []
        for k in range(A.shape[0]):
            K = SX.zeros(m, m)  # antisymmetric
            for (a, b), value in brackets.items():
                K[a, b] = dot(A[k, :].T, value)
                K[b, a] = -K[a, b]
            curvatures.append(M.T @ K @ M)
        return A, curvatures


@final
@dataclass(frozen=True)
class RowExpressions(Expressions):
    """Planes that rows A (r, n) annul: G = [J; A]^-1 [1; 0]."""

    def rate(self, dx: SX, along: SX | None = None, *, written_out: bool = False) -> Solution:
        """The dq with J dq = dx and A dq = along.

        Args:
            along: wanted of the rows (r, k); zero by default, for G dx.
        """
        wanted = SX.zeros(self.planes.shape[0], dx.shape[1]) if along is None else along
        extended, sizes = self._extended()
        scaled = (wanted[i, :] / size for i, size in enumerate(sizes))
        return solution(extended, vertcat(dx, *scaled), written_out=written_out)  # (14)

    def slope(self, dx: SX, weight: SX) -> tuple[SX, SX]:
        """Of [J; A] x = [dx; 0], with y = [J; A]^-T w: w^T dx = -y^T d[J; A] x."""
        extended, sizes = self._extended()
        m, factors = self.J.shape[0], factorise(extended)
        x = factors.solve(vertcat(dx, SX.zeros(len(sizes), 1)))
        y = factors.solve_transposed(weight)
        scaled = vertcat(SX(0, 1), *(y[m + i] / size for i, size in enumerate(sizes)))

        def form(y: SX, scaled: SX, x: SX) -> SX:
            return -y.T @ self.J @ x - scaled.T @ self.planes @ x

        return _slope_of(form, self.q, y[:m], scaled, x), y[:m]

    def _extended(self) -> tuple[SX, list[SX]]:
        """[J; A], rows of A scaled to length 1, and their lengths: a constraint's scale is no matter of its leaves."""
        rows = [self.planes[i, :] for i in range(self.planes.shape[0])]
        sizes = [norm_2(row) for row in rows]
        # (11): J_A = [J; A]
        return vertcat(self.J, *(row / size for row, size in zip(rows, sizes, strict=True))), sizes

    def brackets(self, G: SX, of_frame: Brackets | None = None) -> tuple[SX, list[SX]]:
        """A_k [G_i, G_j] = -(DA_k[G_i] G_j - DA_k[G_j] G_i): only A is differentiated."""
        # (31), (32): DA[G_i] G_j = -A DG_j[G_i], from A G = 0
        along = [directional(self.planes, self.q, G[:, i]) @ G for i in range(G.shape[1])]
        values = [vertcat(*(turn[k, :] for turn in along)) for k in range(self.planes.shape[0])]
        return self.planes, [T.T - T for T in values]  # (33), (34), (35): the terms in dA, which cancel for a gradient


def _slope_of(form: Callable[..., SX], q: SX, *values: SX) -> SX:
    """The gradient (n,) by q of a scalar form(*values) in which the values, expressions of q, count as constants."""
    fixed = [symbol(f"fixed{i}", *value.shape) for i, value in enumerate(values)]
    return as_map([q, *fixed], gradient(form(*fixed), q).T)(q, *values)


FORMULA = "look in N_G, the rows or the constraint for a division by zero, a log or a sqrt at that posture"
"""What may be wrong where a strategy is not finite at a finite posture."""


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
        check_regular(self.task, self.name, q, rcond, margin, least, self._allowed)

    def _allowed(self, q: Vector) -> tuple[Matrix, Flags] | None:
        """(joint motions (n, m) that the strategy allows at q, which joints (n,) it holds); None if that is not known.

        At a singular posture G is not defined, but these are.
        """
        return None

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
    def _margin_expression(self) -> SX:
        """How far the posture is from where a representation, the task's or the constraint's, is singular."""
        return self.task._margin_expression(self.expressions.kinematics.rotation)

    @cached_property
    def gain(self) -> Function:
        """q -> (G, rcond, representation margin), unchecked."""
        s = self.looped
        solution = s.expressions.rate(SX.eye(s.task.m))
        outputs = {"G": solution.X, "rcond": solution.rcond, "margin": s._margin_expression}
        return Function("gain", {"q": s.expressions.q}, outputs, solution.system, s.transport)

    @cached_property
    def rate(self) -> Function:
        """(q, dx) -> (dq = G dx, rcond, margin), unchecked: one solve instead of m. [ZR11, (3)]"""
        s, dx = self.looped, symbol("dx", self.task.m)
        solution = s.expressions.rate(dx)  # (3)
        outputs = {"dq": solution.X, "rcond": solution.rcond, "margin": s._margin_expression}
        return Function("rate", {"q": s.expressions.q, "dx": dx}, outputs, solution.system, s.transport)

    def _written(self, what: str, planes: Field, shape: tuple[int, int]) -> tuple[SX, Kinematics, SX, SX]:
        """(q, kinematics, J, planes) over a new symbol. Raises: ShapeError unless the planes have the shape."""
        q = symbol("q", self.task.n)
        k = self.task.kinematics(q)
        expression = as_expression(planes(self.task, k, q))
        if expression.shape != shape:
            cure = "it must fit n joints and m task rows"
            raise ShapeError(f"{what} of {self.name!r}", shape, expression.shape, cure)
        return q, k, self.task.jacobian_expression(k, q), expression

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

    def _doubtful(self, q: Vector, result: Array, rcond: float, margin: float) -> Array:
        """The result at q, unless the strategy is singular there."""
        check_solved(self, self.task.robot.checked(q), rcond, margin)
        return result

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
    task: Task,
    name: str,
    q: Vector,
    rcond: float,
    margin: float,
    least: float = TOLERANCES.singular,
    allowed: Callable[[Vector], tuple[Matrix, Flags] | None] = lambda _q: None,
) -> None:
    """Raises: SingularityError of a strategy at q, saying of which kind, unless rcond > least and margin suffices.

    Args:
        allowed: what the strategy allows at a posture, as of `Strategy._allowed`.
    """
    if not margin > TOLERANCES.representation:
        raise SingularityError(SingularityKind.REPRESENTATION, q, f"{name} ({task.name})", margin)
    if rcond > least:
        return
    J = task.jacobian(q)
    s = np.linalg.svd(J, compute_uv=False)
    kinematic = s[-1] <= max(TOLERANCES.rank, least) * s[0]
    kind = SingularityKind.KINEMATIC if kinematic else SingularityKind.ALGORITHMIC
    known = None if kinematic else allowed(q)
    why = "" if known is None else _impossible(task, J, *known)
    raise SingularityError(kind, q, f"{name} ({task.name})", s[-1] if kinematic else rcond, why)


HELD = 1e-9
"""Largest rate of a joint that a strategy holds, in motions of length 1."""

HARD = 100.0
"""A motion of the tool is hard where the joints move as many times as much for it as for the easiest one."""

ALONG = 0.99
"""Share of a direction of the tool that is along one axis, to be called so."""


def hardest_motion(strategy: Strategy, q: Vector) -> str:
    """Which motion of the tool a strategy can hardly make at a posture (n,), in words; "" where it makes all with ease.

    It is hard where the joints move `HARD` times as much for it as for the easiest one.
    """
    J = strategy.task.jacobian(q)
    N, held = strategy._allowed(q) or (np.zeros((strategy.task.n, 0)), np.zeros(strategy.task.n, dtype=bool))
    whole = np.eye(strategy.task.n)
    for motions, still in ((whole, np.zeros_like(held)), (N, held)):
        sigma = np.linalg.svd(J @ np.linalg.qr(motions)[0], compute_uv=False)
        if len(sigma) == strategy.task.m and HARD * sigma[-1] < sigma[0]:
            return _impossible(strategy.task, J, motions, still, "all joints together" if motions is whole else "")
    return ""


def _impossible(task: Task, J: Matrix, N: Matrix, held: Flags, who: str = "") -> str:
    """How the joint motions N (n, .) of a strategy cannot, or hardly, move the tool, in words of who sees the machine.

    who: what moves it, by default the joints that are not held.
    """
    names = [name for name, still in zip(task.robot.joint_names, held, strict=True) if still]
    who = who or (f"with {' and '.join(names)} held, the other joints" if names else "by this strategy the joints")
    U, sigma, _ = np.linalg.svd(J @ np.linalg.qr(N)[0])
    lost = np.flatnonzero(sigma <= 10 * TOLERANCES.rank * sigma[0])
    who += " cannot" if len(lost) else " can hardly"
    i = int(np.argmax(np.abs(U[:, -1])))
    row = task.row_names[i]
    if len(lost) > 1:
        return f"{who} move the tool in {len(lost)} of its {task.m} directions"
    if not abs(U[i, -1]) >= ALONG:
        parts = [(share * np.sign(U[i, -1]), name) for name, share in zip(task.row_names, U[:, -1], strict=True)]
        direction = ", ".join(f"{share:.2g} {name}" for share, name in parts if abs(share) > 1 - ALONG)
        return f"{who} move the tool in the direction {direction}"
    if row in ("x", "y", "z"):
        return f"{who} move the tool along {row}"
    return f"{who} turn the tool about {row[1:]}" if row[1:] in ("x", "y", "z") else f"{who} change {row}"


def checked_rate(strategy: Strategy) -> Callable[[Vector, Vector], Vector]:
    """(q, dx) -> dq = G(q) dx, for all who integrate it. Raises (when called): SingularityError."""

    def rate(q: Vector, dx: Vector) -> Vector:
        dq, rcond, margin = strategy.rate(q, dx)
        check_solved(strategy, q, rcond, margin)
        return dq

    return rate


# --- The three kinds of strategies: planes from a frame, from rows, from a constraint. Every strategy is one of them.


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

    def _allowed(self, q: Vector) -> tuple[Matrix, Flags] | None:
        B = self.distribution(q)
        return B, np.abs(B).max(axis=1) == 0.0

    def distribution(self, q: ArrayLike) -> Matrix:
        """N_G = B (n, m) as it was given."""
        return np.reshape(self._planes(self.task.robot.checked(q)), (self.task.n, self.task.m))


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

    def _allowed(self, q: Vector) -> tuple[Matrix, Flags] | None:
        A = np.reshape(self._planes(q), (self.task.n - self.task.m, self.task.n))
        _, sigma, V = np.linalg.svd(A)
        if not len(sigma) or not sigma[-1] > TOLERANCES.rank * sigma[0]:
            return None
        N = V[len(A) :].T
        return N, np.abs(N).max(axis=1) < HELD

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
    def _margin_expression(self) -> SX:
        """How far the posture is from where a representation, the task's or the constraint's, is singular."""
        e, margin = self.expressions, super()._margin_expression
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
