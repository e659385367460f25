"""Theorem III.2 as a call: a holonomic G in, the paper's J_G, N_G, H out, with (7) to (14) checked. [ZR11]"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.types import ArrayLike, Matrix, Value, Vector
from ...strategies import HolonomicStrategy, Strategy
from ...symbolic.null_space import null_space
from .leaf_functions import leaf_function


@dataclass(frozen=True, eq=False)
class GeneralForm(Value):
    """The paper's general form of a holonomic strategy at q: G = H H^T J^T (J H H^T J^T)^-1, H = [N_G N].

    J (m, n), G (n, m); J_G (r, n) the gradient of its g; N_G (n, m) an orthonormal basis of ker J_G, N (n, r) a basis
    of ker J.
    """

    q: Vector
    J: Matrix
    G: Matrix
    J_G: Matrix
    N_G: Matrix
    N: Matrix

    @property
    def H(self) -> Matrix:
        """H = [N_G N] (n, n)."""
        return np.hstack([self.N_G, self.N])

    @property
    def J_A(self) -> Matrix:
        """(11): the extended Jacobian [J; J_G] (n, n)."""
        return np.vstack([self.J, self.J_G])  # (11)

    def residuals(self) -> dict[str, float]:
        """How far (7), (8), (10), (13), (14) are from holding, and how safely (9), (11), (12) and "H" hold.

        The margins are smallest singular values, of J N_G (9), J_A (11) and H, which Theorem III.2 asks to be
        nonsingular; and for (12), Null(J) and Null(J_G) meet in 0 alone, the sine of the smallest angle between them.
        """
        m = len(self.J)
        W = self.H @ self.H.T
        seven = W @ self.J.T @ np.linalg.inv(self.J @ W @ self.J.T)  # (7)
        eight = W @ self.J.T - self.N_G @ (self.J @ self.N_G).T  # (8)
        kernel = np.linalg.qr(self.N)[0]
        sines = np.linalg.svd(kernel - self.N_G @ (self.N_G.T @ kernel), compute_uv=False)  # (12)
        blocks = self.J_A @ self.H  # (13)
        off = max(np.abs(blocks[:m, m:]).max(initial=0.0), np.abs(blocks[m:, :m]).max(initial=0.0))
        identity = np.vstack([np.eye(m), np.zeros((len(self.J_G), m))])  # (14): what J_A G is
        return {
            "(7)": float(np.abs(seven - self.G).max()),
            "(8)": float(np.abs(eight).max()),
            "(9)": float(np.linalg.svd(self.J @ self.N_G, compute_uv=False)[-1]),  # (9)
            "(10)": float(np.abs(self.J_G @ self.G).max(initial=0.0)),  # (10)
            "(11)": float(np.linalg.svd(self.J_A, compute_uv=False)[-1]),
            "(12)": float(sines.min(initial=1.0)),
            "(13)": float(off),
            "(14)": float(np.abs(self.J_A @ seven - identity).max()),
            "H": float(np.linalg.svd(self.H, compute_uv=False)[-1]),
        }


@typed
def general_form(strategy: Strategy, q: ArrayLike, reference: ArrayLike | None = None) -> GeneralForm:
    """Theorem III.2, 1 => 2: the general form of a holonomic strategy at q (n,). [ZR11]

    J_G is the gradient of the strategy's constraint, or, if it has none, of the `leaf_function` recovered from G about
    the reference (q itself by default), whose curvature must vanish near the reference and on the way to it from q.
    The other direction, 2 => 1, is `null_basis` with `involutivity`.

    Raises:
        NotHolonomicError: there is no g, with a witness. SingularityError: J or H is singular at q.
    """
    task = strategy.task
    posture = task.robot.checked(q)
    G, J = strategy(posture), task.jacobian(posture)
    if isinstance(strategy, HolonomicStrategy):
        J_G = strategy.rows(posture)
    else:
        g = leaf_function(strategy, posture if reference is None else reference)
        g.check(posture)
        J_G = g.gradient(posture)
    N_G = null_space(J_G) if len(J_G) else np.eye(task.n)  # (25): an orthonormal basis of its span, for the g of (24)
    # Theorem III.2: 1 => 2
    return GeneralForm(posture, J, G, J_G, N_G, task.null_space(posture))
