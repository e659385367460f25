"""The planes of a strategy as expressions: the span of a frame, or the kernel of rows (theory 1.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

from ..robot import Kinematics
from ..symbolic import (
    SX,
    Solution,
    directional,
    dot,
    factorise,
    fmin,
    least_norm,
    norm_2,
    pairwise_brackets,
    same,
    solution,
    vertcat,
)
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
        A, B = [self.J], [dx]  # (11): J_A = [J; A], with rows of A scaled to length 1 below
        for i in range(self.planes.shape[0]):  # to length 1: the scale of a constraint is no matter of its leaves
            size = norm_2(self.planes[i, :])
            A, B = [*A, self.planes[i, :] / size], [*B, wanted[i, :] / size]
        return solution(vertcat(*A), vertcat(*B), written_out=written_out)  # (14)

    def brackets(self, G: SX, of_frame: Brackets | None = None) -> tuple[SX, list[SX]]:
        """A_k [G_i, G_j] = -(DA_k[G_i] G_j - DA_k[G_j] G_i): only A is differentiated."""
        # (31), (32): DA[G_i] G_j = -A DG_j[G_i], from A G = 0
        along = [directional(self.planes, self.q, G[:, i]) @ G for i in range(G.shape[1])]
        values = [vertcat(*(turn[k, :] for turn in along)) for k in range(self.planes.shape[0])]
        return self.planes, [T.T - T for T in values]  # (33), (34), (35): the terms in dA, which cancel for a gradient
