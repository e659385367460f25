"""`SectionMetrics`: what a law with leaves does over a workspace, by the costs that designs are judged by."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...base.errors import OutOfReachError
from ...base.types import Array, Matrix, Value, Vector
from ...motion.checks.check_report import counted
from ...motion.checks.keeping_clear import Clearances
from ...motion.ik import inverse
from ...motion.ik.solutions import InverseStatus
from ...strategies import HolonomicStrategy
from ..coverage.coordinates import Coordinates
from .objectives import Costs
from .section import TiltedLeaves


@dataclass(frozen=True, eq=False)
class SectionMetrics(Value):
    """What a law does over a workspace, on one leaf.

    poses: how many tool poses were asked for; reached: how many of them the leaf reaches; within_limits: how many of
    these with all joints within their limits. The rest is of those reached: squared_speed, mean |G|_F^2 [rad^2/m^2];
    worst_speed, the greatest share of a joint's speed limit at 1 m/s of the tool [s/m], NaN where a joint has none;
    joint_limits, the greatest |q - middle| over half a joint's range, 1 at the limit, and worst_joint, whose it is;
    rcond, the least of [J; J_g]; travel, the mean squared distance of the joints between two poses [rad^2]; own, the
    mean of each cost of your own; clearance, the least distance of two shapes [m], infinite where none was looked at,
    and closest, the names of these two. See `Objective`.
    """

    poses: int
    reached: int
    within_limits: int
    squared_speed: float
    worst_speed: float
    joint_limits: float
    worst_joint: str
    rcond: float
    travel: float
    own: dict[str, float] = field(default_factory=dict)
    clearance: float = np.inf
    closest: tuple[str, str] | None = None

    def __str__(self) -> str:
        own = "".join(f"; {name} {value:.5g}" for name, value in self.own.items())
        if self.closest is not None:
            own += f"; the least distance is {self.clearance:.3g} m, between {' and '.join(self.closest)}"
        known = f"; at a tool speed of 1 m/s the fastest joint has {self.worst_speed:.3g} times its speed limit"
        fastest = known if np.isfinite(self.worst_speed) else ""
        return (
            f"the leaf reaches {self.reached} of {self.poses} poses, {self.within_limits} within the joint limits\n"
            f"  the mean squared joint speed is {self.squared_speed:.5g} rad^2/m^2{fastest}\n"
            f"  nearest to a limit: {self.worst_joint}, at {self.joint_limits:.0%} of the way from the middle of its "
            "range to a limit\n"
            f"  from one pose to another the joints differ by {np.sqrt(self.travel):.3g} rad (rms); rcond is at least "
            f"{self.rcond:.2g}{own}"
        )


def reached(strategy: HolonomicStrategy, q0: Vector, poses: Array) -> tuple[Matrix, Array]:
    """The postures (k, n) of those of the poses (S, 4, 4) that the leaf through a posture reaches, and these poses.

    Raises:
        OutOfReachError: none is.
    """
    found = inverse(strategy, q0, limits=False).batch(poses)
    if not found.reached.any():
        causes = ", ".join(sorted({InverseStatus(s).name.lower().replace("_", " ") for s in found.status}))
        fact = f"none of {len(poses)} poses of the workspace is reached by the leaf of {strategy.name!r} ({causes})"
        raise OutOfReachError(fact, "move or shrink the workspace, or give another start or base constraint")
    return found.q[found.reached], poses[found.reached]


def measured(
    strategy: HolonomicStrategy, coordinates: Coordinates, costs: Costs, Q: Matrix, poses: int, apart: Clearances | None
) -> SectionMetrics:
    """The metrics of a law at postures (k, n) that it reaches, of so many poses. apart: the shapes to look at."""
    robot = strategy.task.robot
    at = TiltedLeaves(strategy, coordinates).through(Q, np.zeros((len(Q), strategy.constraint.rows, coordinates.d)))
    off = np.abs(Q - costs.middle) / costs.half
    k, joint = np.unravel_index(int(np.argmax(off)), off.shape)
    near = np.full((1, 1), np.inf) if apart is None else counted(apart.distances(Q), apart.limits, apart.wanted)
    closest = int(near.min(axis=0).argmin())
    used = np.sqrt(np.sum((at.G * costs.columns) ** 2, axis=2)) * costs.speeds
    return SectionMetrics(
        poses=poses,
        reached=len(Q),
        within_limits=int(np.sum((np.clip(Q, robot.lower, robot.upper) == Q).all(axis=1))),
        squared_speed=costs.squared_speed(Q, at.G, at.rcond).value,
        worst_speed=float(used.max()) if (costs.speeds > 0).all() else np.nan,
        joint_limits=float(off[k, joint]),
        worst_joint=robot.joint_names[joint],
        rcond=float(strategy.gain.batch(Q)[1].min()),
        travel=costs.travel(Q, at.G, at.rcond).value,
        own={cost.name: float(np.mean(cost.values(Q))) for cost in costs.own},
        clearance=float(near.min()),
        closest=None if apart is None or not np.isfinite(near).any() else apart.names[closest],
    )
