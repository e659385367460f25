"""Recovering g from nothing but an involutive N_G or G: carry the posture to a reference pose (theory 5.5).

`radial` carries along the same segments, as an expression. The 32 steps that a comparison of two paths asks for would
be 3.4 million operations for twelve joints, ten seconds to build: so numbers are carried here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import NotHolonomicError
from ...base.types import ArrayLike, Matrix, Value, Vector, frozen, positive, whole
from ...robot import Robot
from ...strategies import Strategy, check_solved
from ...symbolic import Function, jacobian, runge_kutta, symbol
from ...symbolic.null_space import null_space
from .frobenius import involutivity, involutivity_at
from .region import around
from .straight_transport import STEPS, straight_postures, transport
from .verdict import Verdict

AGREE = 1e-6
"""Difference [joint units] of two transports above which there is no leaf function: a hundred times their error."""


@dataclass(frozen=True, eq=False)
class LeafFunction(Value):
    """g(q) (r,) = Z^T (q_b - q_ref), zero on the leaf of the reference; q_b is where the strategy leads from q when
    the tool goes straight back to the reference pose, Z (n, r) spans the self-motions there."""

    strategy: Strategy
    reference: Vector

    def __call__(self, q: ArrayLike) -> Vector:
        """g(q) (r,) [joint units]. Raises: SingularityError on the way back; ShapeError, NotFiniteError."""
        q = self.strategy.task.robot.checked(q)
        return self._Z.T @ (transport(self.strategy, q, self._back(q)) - self.reference)

    def gradient(self, q: ArrayLike) -> Matrix:
        """J_g (r, n), carried along with the posture by the derivative of the flow.

        Raises:
            SingularityError on the way back; ShapeError, NotFiniteError.
        """
        q = self.strategy.task.robot.checked(q)
        v, task, n = self._back(q), self.strategy.task, len(q)
        V = np.reshape(task.error_and_slope(q, *task.target(self._pose))[1], (task.m, n))

        def slope(y: Matrix, v: Vector) -> Matrix:
            dq, dD, rcond, margin = self._flow(y[:, 0], v, y[:, 1:], V)
            check_solved(self.strategy, y[:, 0], rcond, margin)
            return np.column_stack([dq, np.reshape(dD, (n, n))])

        y = np.column_stack([q, np.eye(n)])
        for _ in range(STEPS):
            y = runge_kutta(slope, y, 1.0 / STEPS, v, v, v)
        return self._Z.T @ y[:, 1:]

    def disagreement(self, q: ArrayLike, by: ArrayLike) -> float:
        """How far apart [joint units] two paths back to the reference end: straight, and by the tool pose of `by`."""
        robot, task = self.strategy.task.robot, self.strategy.task
        q, corner = robot.checked(q), robot.checked(by)
        direct = transport(self.strategy, q, self._back(q))
        there = transport(self.strategy, q, task.error(q, *task.place(corner)))
        return float(np.abs(transport(self.strategy, there, self._back(there)) - direct).max())

    def _back(self, q: Vector) -> Vector:
        """The straight path (m,) from the tool pose at q to the reference, in task rates."""
        task = self.strategy.task
        return task.error(q, *task.target(self._pose))

    @cached_property
    def _pose(self) -> Matrix:
        return frozen(self.strategy.task.pose(self.reference))

    @cached_property
    def _Z(self) -> Matrix:
        return frozen(null_space(self.strategy.task.jacobian(self.reference)))

    @cached_property
    def _flow(self) -> Function:
        """(q, v, D, V) -> (G v, (G v)' D + G V, rcond, margin)."""
        e, task = self.strategy.expressions, self.strategy.task
        v, D, V = symbol("v", task.m), symbol("D", task.n, task.n), symbol("V", task.m, task.n)
        found = e.rate(v, written_out=True)
        dD = jacobian(found.X, e.q) @ D + e.rate(V, written_out=True).X
        outputs = {
            "dq": found.X,
            "dD": dD,
            "rcond": found.rcond,
            "margin": self.strategy.margin_expression,
        }
        return Function("flow", {"q": e.q, "v": v, "D": D, "V": V}, outputs)

    def check(self, q: ArrayLike) -> None:
        """Look at the curvature at q and at 32 postures of its path back, where g and its gradient come from.

        Raises:
            NotHolonomicError, SingularityError, EmptyRegionError; ShapeError, NotFiniteError.
        """
        q = self.strategy.task.robot.checked(q)
        postures = straight_postures(self.strategy, q, self._back(q))
        _refuse_curved(self.strategy, involutivity_at(self.strategy, postures))


@typed
def leaf_function(
    strategy: Strategy, reference: ArrayLike, *, radius: float = 0.1, samples: int = 8, seed: int = 0
) -> LeafFunction:
    """g of an involutive strategy, given by N_G or G alone, near a reference posture (n,).

    Before it is returned, `samples` postures within `radius` [joint units] of the reference are carried back straight
    and by a detour, and must end within 1e-6 of each other; and the strategy must be holonomic by `involutivity` at 64
    postures of that box, which sees a curvature too weak, or loops too symmetric, for the detours to show it.
    Farther out nothing was looked at: `check(q)` does so for one posture.

    Raises:
        NotHolonomicError: two transports disagree, or there is curvature; it holds the witness.
        SingularityError: on the way. EmptyRegionError: round-off hides all curvature. ShapeError, NotFiniteError.
    """
    robot: Robot = strategy.task.robot
    start = robot.checked(reference, "the reference posture")
    strategy(start)
    g = LeafFunction(strategy, start)
    whole("samples", samples)
    positive("radius", radius)
    rng = np.random.default_rng(whole("seed", seed, 0))
    worst, witness = 0.0, start
    for _ in range(samples):
        q, corner = start + rng.uniform(-radius, radius, (2, robot.n))
        gap = g.disagreement(q, corner)
        if gap > worst:
            worst, witness = gap, q
    if worst > AGREE:
        raise NotHolonomicError(strategy.name, witness, worst)
    _refuse_curved(strategy, involutivity(strategy, around(start, radius), seed=seed))
    return g


def _refuse_curved(strategy: Strategy, verdict: Verdict) -> None:
    if not verdict.holonomic:
        raise NotHolonomicError(strategy.name, verdict.witness, curvature=verdict.relative)
