"""The direction of the elbow over a sphere of tool places: a field of tangent directions, as a leaf makes it."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from ...base.errors import ArgumentError, SingularityError, SingularityKind
from ...base.tolerances import TOLERANCES
from ...base.types import Flags, Indices, Matrix, Vector
from ...motion.ik.leaf import DONE, NEWTONS, leaf_step, leaf_value
from ...motion.ik.newton import newton
from ...strategies import HolonomicStrategy, Strategy, moore_penrose
from ...strategies.constraints import Arm
from ...strategies.self_motions import correction
from ...strategies.tasks.task import Task
from ...symbolic import runge_kutta
from .sphere_index import TangentField, angle_between

NEAR = 0.3
"""Largest joint motion [joint units] of one step: what lies farther is gone to in several."""

CONTRACTION = 0.25
"""Largest ratio of two successive Newton corrections of one step; a larger one means that the step is too long."""

SMALL = 2e-4
"""Way [rad] on the sphere that Newton's method goes without a prediction."""

State = tuple[Vector, Vector]
"""A posture (n,) and the direction (3,) where it is."""

ON_LINE = 1e-6
"""Distance [m] of the elbow from the line shoulder-wrist at which it has no direction."""

FIXED = 1e-9
"""Motion [m] up to which a point counts as fixed."""


@dataclass(frozen=True, eq=False)
class ToolSphere:
    """Tool poses that differ by a shift: a point fixed to the tool runs over the sphere about the shoulder (3,).

    That point is where the wrist is at the start, in the `direction` (3,), at the distance `radius` [m].
    `fixed`: whether it is the wrist at all postures, so that shoulder and wrist are given by the pose.
    """

    shoulder: Vector
    direction: Vector
    radius: float
    pose: Matrix
    fixed: bool

    def position(self, u: Vector) -> Vector:
        """The tool's position (3,) in a direction u (3,)."""
        return self.pose[:3, 3] + self.radius * (u - self.direction)

    def pose_at(self, u: Vector) -> Matrix:
        """The tool's pose (4, 4) in a direction u (3,)."""
        found = np.array(self.pose)
        found[:3, 3] = self.position(u)
        return found


def sphere_of(task: Task, q0: Vector, arm: Arm) -> ToolSphere:
    """The sphere of tool poses about the shoulder, through that of q0.

    Raises:
        ArgumentError: the shoulder moves, or the wrist is in it.
    """
    places = arm.places(task)
    some = np.random.default_rng(0).uniform(-1.5, 1.5, (4, task.n))
    points = places.batch(some).reshape(-1, 3, 3)
    if np.ptp(points[:, 0], axis=0).max() > FIXED:
        raise ArgumentError("the shoulder", arm.shoulder.place, "name joints=(...) with one that no joint moves")
    p, R = task.poses(some)
    held = np.einsum("kji,kj->ki", R, points[:, 2] - p)
    pose, (S, _, W) = task.pose(q0), places(q0)
    radius = float(np.linalg.norm(W - S))
    if not radius > ON_LINE:
        raise ArgumentError("the distance from shoulder to wrist", radius, "choose another start posture")
    return ToolSphere(S, (W - S) / radius, radius, pose, bool(np.ptp(held, axis=0).max() <= FIXED))


class ElbowField(TangentField):
    """u -> the part of the elbow's place, seen from the shoulder, that is perpendicular to u [m].

    The state is (q, u), the posture (n,) and where it is. It is carried by a strategy, dq = G dx, and corrected.
    """

    def __init__(self, strategy: Strategy, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        self.task, self.sphere = strategy.task, sphere
        self.start = q0, sphere.direction
        self._rate, self._places, self._rotation = strategy.rate, arm.places(strategy.task), sphere.pose[:3, :3]

    def step(self, state: State, u: Vector) -> tuple[State, Vector] | None:
        """((q, u), the elbow off the line) at u, from a state nearby."""
        q = self.solve(*state, u)
        e = None if q is None else self.elbow(q, u)
        return None if q is None or e is None else ((q, u), e)

    def elbow(self, q: Vector, u: Vector) -> Vector | None:
        """Where it is at a posture, off the line along u (3,) [m]; None on the line."""
        S, E, _ = self._places(q)
        off = E - S - (u @ (E - S)) * u
        return off if float(np.linalg.norm(off)) > ON_LINE else None

    def solve(self, q: Vector, u: Vector, v: Vector) -> Vector | None:
        """The posture at v, near the one at u; None where Newton's method does not find one."""
        start = q
        try:
            q = self._predicted(q, u, v) if float(np.linalg.norm(v - u)) > SMALL else q
        except SingularityError:
            return None

        def correct(at: Matrix, _: Indices) -> tuple[Matrix, Flags]:
            dq = self.correction(at[0], v)
            found = np.full(at.shape, np.nan) if dq is None else dq[None]
            return found, np.abs(at + found - start).max(axis=1) < NEAR  # NaN is not

        found, arrived = newton(correct, q[None], steps=NEWTONS, exact=DONE, contraction=CONTRACTION)
        return found[0] if arrived[0] else None

    def _predicted(self, q: Vector, u: Vector, v: Vector) -> Vector:
        """Carried by the strategy from u to v, to the fourth order: near a pole the elbow swings far on a short way."""
        ahead = [v - u @ v * u, v - u, u @ v * v - u]  # along the great circle at its start, middle and end
        length = self.sphere.radius * angle_between(u, v)
        rows = [row for row in self.task.rows if row < 3]
        rates = [
            np.append((length / float(np.linalg.norm(x)) * x)[rows], np.zeros(self.task.m - len(rows))) for x in ahead
        ]
        return runge_kutta(self._checked, q, 1.0, *rates)

    def _checked(self, q: Vector, dx: Vector) -> Vector:
        dq, rcond, margin = self._rate(q, dx)
        if not (rcond > TOLERANCES.singular and margin > TOLERANCES.representation):
            raise SingularityError(SingularityKind.ALGORITHMIC, q, "a law on the sphere", float(rcond))
        return dq

    @abstractmethod
    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """Newton's correction (n,) towards u; None where it is singular."""


class LeafField(ElbowField):
    """The elbow's direction as the leaf of a strategy makes it."""

    def __init__(self, strategy: HolonomicStrategy, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        super().__init__(strategy, q0, sphere, arm)
        self._newton, self._leaf = leaf_step(strategy), leaf_value(strategy, q0)
        self._side = self._newton(q0, sphere.pose[:3, 3], self._rotation, self._leaf)[3]

    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """On [f(q) - x; g(q) - c]."""
        dq, rcond, margin, side = self._newton(q, self.sphere.position(u), self._rotation, self._leaf)
        sound = rcond > TOLERANCES.singular and margin > TOLERANCES.representation and side == self._side
        return dq if sound else None


class FreeField(ElbowField):
    """The elbow's direction with the least joint motion: a law along a way, not one over the sphere."""

    def __init__(self, task: Task, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        super().__init__(moore_penrose(task), q0, sphere, arm)

    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """The least joint motion, on f(q) - x."""
        return correction(self.task, q, self.sphere.position(u), self._rotation)
