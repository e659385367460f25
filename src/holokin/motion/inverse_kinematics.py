"""Inverse kinematics as a function: on a leaf g(q) = c the joints belong to the tool pose alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, ShapeError
from ..strategies import HolonomicStrategy
from ..types import ArrayLike, Value, Vector, finite, frozen
from .leaf import leaf_follower, leaf_value, straight_way

ROTATION = 1e-5
"""How far R R^T of a wanted pose may be from 1: rotations in single precision are right to 1e-7."""


@dataclass(frozen=True, eq=False)
class InverseKinematics(Value):
    """pose -> q on one leaf of a strategy. Make one with `inverse`."""

    strategy: HolonomicStrategy
    start: Vector

    def __call__(self, pose: ArrayLike) -> Vector:
        """q (n,) of a tool pose (4, 4), or of a position (3,) or (2,) with the orientation of the start.

        Reached from the start along the straight line to it (turning evenly about one axis), so it is a
        function of the pose: the same pose gives the same joints to the last bit. Joint limits are not looked at:
        `robot.check_limits(q)` does.

        Raises:
            SingularityError, BranchError: the leaf does not reach so far on a straight line.
            ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        wanted = finite("a tool pose", pose)
        p0, R0 = self._pose[:3, 3], self._pose[:3, :3]
        if wanted.shape == (4, 4):
            p, R = wanted[:3, 3], wanted[:3, :3]
            if not (np.abs(R @ R.T - np.eye(3)).max() < ROTATION and np.linalg.det(R) > 0):
                raise ArgumentError("the rotation of a tool pose", R.tolist(), "give a right-handed rotation matrix")
        elif wanted.shape in ((2,), (3,)):
            p, R = np.append(wanted, p0[len(wanted) :]), R0
        else:
            raise ShapeError("a tool pose", "(4, 4), (3,) or (2,)", wanted.shape)
        way = straight_way(self.strategy.task, self.start, p, R, (self._leaf, self._leaf))
        return leaf_follower(self.strategy, self.start)(self.start, way)

    @cached_property
    def _pose(self):
        return frozen(self.strategy.task.robot.pose(self.start, self.strategy.task.tip))

    @cached_property
    def _leaf(self) -> Vector:
        return frozen(leaf_value(self.strategy, self.start))


@typed
def inverse(strategy: HolonomicStrategy, start: ArrayLike) -> InverseKinematics:
    """Inverse kinematics q(x) of a strategy with leaves, on the one through `start`.

    With `radial(G, start)` this is the straight-line transport of G from `start`, free of drift by construction:
    theory 5.3's inverse-kinematics form.

    Raises:
        ArgumentError: a strategy without leaves, where the pose alone does not tell the joints.
        SingularityError: it is singular at the start.
    """
    q0 = strategy.task.robot.checked(start, "the start posture")
    strategy(q0)
    return InverseKinematics(strategy, q0)
