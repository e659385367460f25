"""`Strategy`: a right inverse G(q) of the task Jacobian, J G = 1, dq = G dx.

A strategy is its planes range G, m-dimensional and transversal to the self-motions ker J. They are given
either as the span of a frame B(q) (n, m), then G = B (J B)^-1, or as the kernel of rows A(q) (r, n), then
G = [J; A]^-1 [1; 0]. With B = N_G the first is the paper's (7), N_G (J N_G)^-1 = H H^T J^T (J H H^T J^T)^-1,
without squaring its condition number (theory 1.3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from ..arguments import Made
from ..constraints import Constraint
from ..errors import ArgumentError, NativeError, NotFiniteError, ShapeError, SingularityError, SingularityKind
from ..robot import Kinematics
from ..symbolic import (
    SX,
    Enclosure,
    Function,
    Solution,
    as_expression,
    fabs,
    factorise,
    fmax,
    fmin,
    jacobian,
    norm_2,
    short,
    solution,
    symbol,
    vertcat,
)
from ..symbolic.geometry import wrapped
from ..task import Task
from ..tolerances import TOLERANCES
from ..types import Array, ArrayLike, Matrix, Value, Vector, whole

Field = Callable[[Task, Kinematics, SX], SX]
"""An expression of the posture: (task, kinematics, q) -> matrix."""


SHORT = 40_000
"""Operations, equal ones counted apart, up to which the derivative of the extended Jacobian is enclosed; it takes less
to sample longer ones."""

PIECE = 100_000
"""Postures of a batch that are checked at once."""

Form = Literal["span", "kernel"]
"""How planes are given: as the span of a frame B (n, m), or as the kernel of rows A (r, n)."""


@dataclass(frozen=True)
class Expressions:
    """The expressions of a strategy over its symbol q; `planes` is B or A, as `form` says."""

    q: SX
    kinematics: Kinematics
    J: SX
    form: Form
    planes: SX

    def rate(self, dx: SX, along: SX | None = None, *, written_out: bool = False) -> Solution:
        """G dx, (m, k) -> (n, k), with its conditioning, by orthogonal factorisations only.

        Args:
            along: A dq (r, k) wanted of the rows A; zero by default. Only for planes given by rows.
            written_out: for those who differentiate it: no system is left to numbers, however large.
        """
        if self.form == "kernel":
            wanted = SX.zeros(self.planes.shape[0], dx.shape[1]) if along is None else along
            A, B = [self.J], [dx]  # (11)
            for i in range(self.planes.shape[0]):  # to length 1: the scale of a constraint is no matter of its leaves
                size = norm_2(self.planes[i, :])
                A, B = [*A, self.planes[i, :] / size], [*B, wanted[i, :] / size]
            return solution(vertcat(*A), vertcat(*B), written_out=written_out)  # (14)
        if along is not None:
            raise ArgumentError("the form of the planes", self.form, "only planes given by rows have a rate along them")
        frame = factorise(self.planes)
        # (7): Q (J Q)^-1 has the planes of H H^T J^T (J H H^T J^T)^-1
        Q = frame.thin_q()
        inner = factorise(self.J @ Q)  # (9): regular where H is
        return Solution(Q @ inner.solve(dx), fmin(frame.conditioning(), inner.conditioning()))


@dataclass(frozen=True, eq=False)
class Strategy(Made, Value):
    """A right inverse of a task. Make one with `moore_penrose`, `weighted`, `null_basis`, `holonomic`, ...

    `planes` is the field of frames or rows, as `form` says. A strategy from a constraint keeps it in `constraint`,
    one with a constant weight, B = W J^T, has that in `constant_weight`.
    """

    name: str
    task: Task
    form: Form
    planes: Field
    constraint: Constraint | None = None
    constant_weight: Matrix | None = None

    def __repr__(self) -> str:
        return f"Strategy({self.name!r}, {self.task.name}, m={self.task.m}, n={self.task.n})"

    def __call__(self, q: ArrayLike) -> Matrix:
        """G(q), (n,) -> (n, m) [joint unit / task unit].

        Raises:
            SingularityError: J, H or [J; J_g] is singular at q, or the representation is; `.kind` says which.
            ShapeError, NotFiniteError: q is not n finite numbers.
        """
        q = self.task.robot.checked(q)
        G, conditioning, margin = self.gain(q)
        self.check(q, conditioning, margin)
        if not np.isfinite(G).all():
            self._check_finite(q)
        return np.reshape(G, (self.task.n, self.task.m))

    def batch(self, Q: ArrayLike, *, threads: int | None = None) -> Array:
        """G at many postures, (k, n) -> (k, n, m); see `Function.batch` for threads.

        Raises: SingularityError naming the first singular one.
        """
        Q = self.task.robot.postures(Q)
        if threads is not None:
            whole("threads", threads)
        G = np.empty((len(Q), self.task.n, self.task.m))
        edges = np.linspace(0, len(Q), 1 + max(1, len(Q) // PIECE)).astype(int)
        for first, last in pairwise(edges):  # in pieces, so that only G grows
            figures = np.empty((2, last - first))
            self.gain.batch(Q[first:last], threads=threads, out=[G[first:last], *figures])
            conditioning, margin = figures
            bad = ~((conditioning > TOLERANCES.singular) & (margin > TOLERANCES.representation))
            if bad.any():
                i = int(np.argmax(bad))
                self.check(self.task.robot.checked(Q[first + i], f"posture {first + i}"), conditioning[i], margin[i])
            broken = ~np.isfinite(G[first:last]).all(axis=(1, 2))
            if broken.any():
                i = first + int(np.argmax(broken))
                self._check_finite(self.task.robot.checked(Q[i], f"posture {i}"))
        return G

    def distribution(self, q: ArrayLike) -> Matrix:
        """N_G (n, m): the frame that the strategy was given by, or its canonical one, G itself (theory 1.4)."""
        if self.form == "kernel":
            return self(q)
        return np.reshape(self._frame(self.task.robot.checked(q)), (self.task.n, self.task.m))

    def rows(self, q: ArrayLike) -> Matrix:
        """A (r, n): the rows that annul range G, as the strategy was given by them, J_g for one from a constraint.

        Raises: ArgumentError for a strategy given by a frame.
        """
        if self.form != "kernel":
            raise ArgumentError("the form of the strategy", self.form, "only strategies given by rows have them")
        return np.reshape(self._frame(self.task.robot.checked(q)), (self.task.n - self.task.m, self.task.n))

    def H(self, q: ArrayLike) -> Matrix:
        """H = [N_G N], (n,) -> (n, n), with N = `task.null_space(q)`. [ZR11, Theorem III.2]"""
        return np.hstack([self.distribution(q), self.task.null_space(q)])  # (21): its determinant is 1 for (20)

    def weight(self, q: ArrayLike) -> Matrix:
        """W = H H^T (n, n): the weight with which G is a weighted pseudo-inverse (6). [ZR11, (7)]"""
        H = self.H(q)
        return H @ H.T

    def check(self, q: Vector, conditioning: float, margin: float) -> None:
        """Raises: SingularityError, saying of which kind, unless the figures, of `gain` for instance, are sound."""
        if margin > TOLERANCES.representation and not np.isfinite(conditioning):
            self._check_finite(q)
        check_regular(self.task, self.name, q, conditioning, margin)

    # --- expressions and the functions built from them, once --------------------------------------------------

    @cached_property
    def expressions(self) -> Expressions:
        """The expressions over one symbol q."""
        task = self.task
        q = symbol("q", task.n)
        k = task.robot.kinematics(q, task.tip)
        J = task.jacobian_expression(k, q)
        planes = as_expression(self.planes(task, k, q))
        shape = (task.n, task.m) if self.form == "span" else (task.n - task.m, task.n)
        if planes.shape != shape:
            what = "the frame N_G" if self.form == "span" else "the constraint rows"
            cure = "it must fit n joints and m task rows"
            raise ShapeError(f"{what} of {self.name!r}", shape, planes.shape, cure)
        return Expressions(q, k, J, self.form, planes)

    @property
    def margin_expression(self) -> SX:
        """How far the posture is from where a representation, the task's or the constraint's, is singular."""
        e = self.expressions
        margin = self.task.margin_expression(e.kinematics.rotation)
        if self.constraint is not None and self.constraint.margin is not None:
            margin = fmin(margin, self.constraint.margin(self.task, e.kinematics, e.q))
        return margin

    @cached_property
    def gain(self) -> Function:
        """q -> (G, conditioning, representation margin), unchecked."""
        e = self.expressions
        found = e.rate(SX.eye(self.task.m))
        outputs = {"G": found.X, "conditioning": found.conditioning, "margin": self.margin_expression}
        return Function("gain", {"q": e.q}, outputs, found.system)

    @cached_property
    def rate(self) -> Function:
        """(q, dx) -> (dq = G dx, conditioning, margin), unchecked: one solve instead of m. [ZR11, (3)]"""
        e = self.expressions
        dx = symbol("dx", self.task.m)
        found = e.rate(dx)  # (3)
        outputs = {"dq": found.X, "conditioning": found.conditioning, "margin": self.margin_expression}
        return Function("rate", {"q": e.q, "dx": dx}, outputs, found.system)

    @cached_property
    def path_rate(self) -> Function:
        """(q, p, R, v, w) -> (dq, conditioning, margin, largest task error): G x' for a tool pose and how it moves.

        x' are the task rates of the pose (p, R) that moves with v and turns with w; the error is that from q to it.
        """
        e, task = self.expressions, self.task
        p, R, v, w = symbol("p", 3), symbol("R", 3, 3), symbol("v", 3), symbol("w", 3)
        found = e.rate(task.rates_expression(R, v, w))
        error, off = task.error_expression(e.kinematics, p, R), SX(0)
        for i in range(task.m):
            off = fmax(off, fabs(error[i]))
        margin = fmin(self.margin_expression, task.margin_expression(R))
        outputs = {"dq": found.X, "conditioning": found.conditioning, "margin": margin, "off": off}
        return Function("path_rate", {"q": e.q, "p": p, "R": R, "v": v, "w": w}, outputs, found.system)

    @cached_property
    def constraint_value(self) -> Function:
        """q -> g(q) (r,) of a strategy from a constraint."""
        return Function("constraint", {"q": self.expressions.q}, {"g": self.constraint_expression})

    @property
    def constraint_expression(self) -> SX:
        """g(q) (r,) of a strategy from a constraint."""
        e = self.expressions
        return self._constraint().bind(self.task, e.kinematics, e.q)

    @cached_property
    def leaf_step(self) -> Function:
        """(q, p, R, c) -> (Newton correction, conditioning, margin, sign of det [J; J_g]).

        One Newton step on [f(q) - x; g(q) - c] towards the tool pose (p, R) on the leaf c.
        """
        e = self.expressions
        p, R, c = symbol("p", 3), symbol("R", 3, 3), symbol("c", self.task.n - self.task.m)
        found = e.rate(self.task.error_expression(e.kinematics, p, R), self.leaf_gap(c))
        outputs = {
            "dq": found.X,
            "conditioning": found.conditioning,
            "margin": self.margin_expression,
            "side": found.orientation,
        }
        return Function("leaf_step", {"q": e.q, "p": p, "R": R, "c": c}, outputs, found.system)

    @cached_property
    def extended(self) -> Function:
        """q -> (A, A^-1) of the extended Jacobian A = [J; rows] (n, n) of a strategy given by rows, unchecked.

        A full orientation turns with its geometric rows, whatever its representation: the postures are the same.
        """
        n, m = self.task.n, self.task.m
        e = replace(self.expressions, J=self._turning_jacobian)
        one = SX.eye(n)
        found = e.rate(one[:m, :], one[m:, :])
        return Function("extended", {"q": e.q}, {"A": vertcat(e.J, e.planes), "inverse": found.X}, found.system)

    @cached_property
    def change(self) -> Enclosure | None:
        """q -> dA/dq_k of the extended Jacobian, (n n n,), k slowest, then columns, enclosed over boxes of q.

        None where an enclosure would be too long, or too wide to be of use: factorisations, which copysign tells,
        widen it without end.
        """
        e = self.expressions
        A = vertcat(self._turning_jacobian, e.planes)
        if not short(A, e.q, SHORT // self.task.n):
            return None
        slopes = jacobian(A, e.q)
        try:
            return Enclosure("hk_change_body", {"q": e.q}, slopes) if short(slopes, e.q, SHORT) else None
        except NativeError:
            return None

    @property
    def _turning_jacobian(self) -> SX:
        return self.expressions.kinematics.jacobian[list(self.task.rows), :] if self.task.turns else self.expressions.J

    def leaf_gap(self, c: SX) -> SX:
        """c - g(q) (r,) as an expression, angles in (-pi, pi], of a strategy from a constraint."""
        if self.task.n == self.task.m:
            return SX(0, 1)
        gap, angular = c - self.constraint_expression, self._constraint().angular
        return vertcat(*(wrapped(gap[i]) if flag else gap[i] for i, flag in enumerate(angular)))

    @cached_property
    def _frame(self) -> Function:
        e = self.expressions
        return Function("frame", {"q": e.q}, {"N_G": e.planes})

    def _check_finite(self, q: Vector) -> None:
        """Raises: NotFiniteError when what the user wrote, frame, rows or constraint, is not finite at a sound q."""
        J, margin = self.task.jacobian_batch(q[None])
        s = np.linalg.svd(J[0], compute_uv=False)
        values = np.asarray(self._frame(q))
        if margin[0] > TOLERANCES.representation and s[-1] > 1e-9 * s[0] and not np.isfinite(values).all():
            raise NotFiniteError(f"what defines {self.name!r} at q = {q.tolist()}", values.tolist())

    def _constraint(self) -> Constraint:
        if self.constraint is None:
            raise ShapeError(f"{self.name!r}", "a strategy from a constraint", "none", "use hk.holonomic(task, g)")
        return self.constraint


def gradient_rows(constraint: Constraint) -> Field:
    """J_g = dg/dq of a constraint, as a field of rows (r, n)."""
    return lambda task, k, q: jacobian(constraint.bind(task, k, q), q)  # (10)


def check_regular(task: Task, name: str, q: Vector, conditioning: float, margin: float) -> None:
    """Raises: SingularityError of a law at q, saying of which kind, unless its figures are sound."""
    what = f"{name} ({task.name})"
    if not margin > TOLERANCES.representation:
        raise SingularityError(SingularityKind.REPRESENTATION, q, what, margin)
    if conditioning > TOLERANCES.singular:
        return
    s = np.linalg.svd(task.jacobian(q), compute_uv=False)
    kinematic = s[-1] <= np.sqrt(TOLERANCES.singular) * s[0] * 1e-3
    kind = SingularityKind.KINEMATIC if kinematic else SingularityKind.ALGORITHMIC
    raise SingularityError(kind, q, what, s[-1] if kinematic else conditioning)
