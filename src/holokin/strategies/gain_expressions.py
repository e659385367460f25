"""The planes of a strategy as expressions: the span of a frame, or the kernel of rows (theory 1.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ..robot import Kinematics
from ..symbolic import (
    SX,
    Solution,
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
from ..symbolic.linear import back_substitute
from ..symbolic.null_space import null_space_expression

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
            m, turned = self.J.shape[0], frame.transpose_times(weight)
            x, y = frame.solve_transposed(dx), back_substitute(frame.R, turned[:m])
            left = frame.complement_times(turned[m:])  # w - J^T y, without its round-off
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
        found = of_frame or pairwise_brackets(B, self.q)
        turned = []
        for k in range(A.shape[0]):
            K = SX.zeros(m, m)  # antisymmetric
            for (a, b), value in found.items():
                K[a, b] = dot(A[k, :].T, value)
                K[b, a] = -K[a, b]
            turned.append(M.T @ K @ M)
        return A, turned


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
        m, found = self.J.shape[0], factorise(extended)
        x = found.solve(vertcat(dx, SX.zeros(len(sizes), 1)))
        y = found.solve_transposed(weight)
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
