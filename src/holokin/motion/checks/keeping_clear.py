"""How far apart links, obstacles and the floor are at many postures, and which of these keep clear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import RobotFileError
from ...base.types import Array, Flags, Matrix, Value, Vector, not_negative
from ...robot import LinkShape, Robot, joints_above, with_capsules
from ...robot.numeric import Frames, joint_frames
from .check_report import UNREAD_CURE, counted, keeps
from .motion_checks import CLEARANCE
from .pairs import Pairs, pairs_of

Clear = Callable[[Matrix], Flags]
"""Which of some postures (k, n) are clear (k,)."""


@dataclass(frozen=True, eq=False)
class Clearances(Value):
    """What tells at single postures how far apart P pairs are: two links, a link and an obstacle, a link and the floor.

    pairs: as of `check`, of the shapes of the robot; of a pair that is always nearer than is wanted it is only asked
    that it does not touch.
    """

    robot: Robot
    pairs: Pairs

    @property
    def wanted(self) -> float:
        """The distance asked for [m]."""
        return self.pairs.wanted

    @cached_property
    def limits(self) -> Vector:
        """The distance asked of each pair (P,) [m]."""
        return np.array(self.pairs.limits)

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Of the pairs."""
        return tuple(gap.names for gap in self.pairs.gaps)

    @property
    def free(self) -> Clearances:
        """Those of the pairs that are not always nearer than is wanted."""
        kept = [(gap, limit) for gap, limit in zip(self.pairs.gaps, self.limits, strict=True) if limit >= self.wanted]
        gaps, limits = tuple(gap for gap, _ in kept), tuple(float(limit) for _, limit in kept)
        return replace(self, pairs=replace(self.pairs, gaps=gaps, limits=limits))

    def distances(self, Q: Matrix, near: float = -np.inf) -> Matrix:
        """Of each pair at postures (k, n) -> (k, P) [m]; negative where they overlap.

        Of meshes those of their convex hulls, and where these are below `near`, their own.
        """
        frames, every = joint_frames(self.robot, Q), np.arange(len(Q))
        found = [gap.distances(frames, every, near) for gap in self.pairs.gaps if len(Q)]
        return np.column_stack(found) if found else np.zeros((len(Q), len(self.pairs.gaps)))

    def least(self, Q: Matrix, near: float = -np.inf) -> Vector:
        """The least distance at postures (k, n) -> (k,) [m]; of pairs that are always near only where they touch."""
        return counted(self.distances(Q, near), self.limits, self.wanted).min(axis=1, initial=np.inf)

    def clear(self, Q: Matrix) -> Flags:
        """Which postures (k, n) keep all pairs as far apart as is asked of them (k,)."""
        return np.all(keeps(self.distances(Q, self.wanted), self.limits), axis=1)

    def slopes(self, Q: Matrix, near: float) -> tuple[Matrix, Array]:
        """The distances of pairs that are nearer than `near` (k, P), infinite for others, and their slopes (k, P, n).

        Of points a and b of the two shapes where they are nearest, and n the unit vector from b to a,

            d distance / dq = n . (J_a - J_b)
        """
        frames, robot = joint_frames(self.robot, Q), self.robot
        found, slopes = np.empty((len(Q), len(self.limits))), np.zeros((len(Q), len(self.limits), robot.n))
        turn, shift = _screws(robot, frames)
        for p, gap in enumerate(self.pairs.gaps):
            at = gap.nearest(frames, near)
            found[:, p] = at.distance
            rows = np.isfinite(at.distance)
            if not rows.any():
                continue
            above = [joints_above(robot.joints, joint) for joint in gap.joints]
            for sign, own, other, point in ((1.0, *above, at.on_one), (-1.0, *above[::-1], at.on_other)):
                moving = [i for i in own if i not in other]
                n = at.away[rows]
                each = np.einsum("kij,kj->ki", turn[rows][:, moving], np.cross(point[rows], n))
                each += np.einsum("kij,kj->ki", shift[rows][:, moving], n)
                for column, i in enumerate(moving):
                    joint = robot.joints[i]
                    slopes[rows, p, joint.coordinate] += sign * joint.multiplier * each[:, column]
        return found, slopes


def _screws(robot: Robot, frames: Frames) -> tuple[Array, Array]:
    """z and v (k, joints, 3): a joint moves a point x of what it carries by z x x + v per joint unit."""
    turn, shift = np.zeros((len(frames[0][0]), len(frames), 3)), np.zeros((len(frames[0][0]), len(frames), 3))
    for i, (p, R) in enumerate(frames):
        axis = R @ robot.joints[i].axis
        if robot.joints[i].kind == "prismatic":
            shift[:, i] = axis
        else:
            turn[:, i], shift[:, i] = axis, np.cross(p, axis)
    return turn, shift


@typed
def clear_postures(
    robot: Robot,
    *,
    obstacles: Sequence[LinkShape] = (),
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
) -> Clear:
    """What tells of postures (k, n) whether every pair of links, obstacles and floor is at least `clearance` apart.

    The pairs and shapes are those of `check`; what happens between the postures is not looked at.

    Args:
        obstacles, floor, clearance, self_collision, ignore: as of `check`.

    Raises:
        UnknownNameError: no such link. ArgumentError: a negative clearance; a robot without links. RobotFileError:
        the shape of a link could not be read, and no clearance can be told.
    """
    return posture_clearances(robot, obstacles, floor, clearance, self_collision, ignore).clear


def posture_clearances(
    robot: Robot, obstacles: Sequence[LinkShape], floor: float | None, clearance: float, self_collision: bool,
    ignore: Sequence[tuple[str, str]],
) -> Clearances:  # fmt: skip
    """What tells of postures how far apart they are. Raises: as `clear_postures`; RobotFileError: unread shapes."""
    robot.check_links()
    wanted, still = not_negative("clearance", clearance), np.zeros((1, robot.n))
    shaped = with_capsules(robot) if all(shape.obstacle for shape in robot.shapes) else robot
    pairs = pairs_of(
        shaped, obstacles, still, clearance=wanted, floor=floor, self_collision=self_collision, ignore=ignore
    )
    if pairs.unread:
        raise RobotFileError(robot.name, pairs.unread, UNREAD_CURE)
    return Clearances(shaped, pairs)
