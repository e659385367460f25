"""Which of many postures keep clear of obstacles, of the floor, and of the robot itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..base.arguments import typed
from ..base.types import Flags, Matrix, not_negative
from ..robot import LinkShape, Robot, with_capsules
from ..robot.numeric import joint_frames
from .motion_checks import CLEARANCE
from .pairs import pairs_of

Clear = Callable[[Matrix], Flags]
"""Which of some postures (k, n) are clear (k,)."""


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
        UnknownNameError: no such link. ArgumentError: a negative clearance; a robot without links.
    """
    robot.check_links()
    wanted = not_negative("clearance", clearance)
    shaped = with_capsules(robot) if all(shape.obstacle for shape in robot.shapes) else robot
    pairs = pairs_of(
        shaped, obstacles, np.zeros((1, robot.n)), clearance=wanted, floor=floor, self_collision=self_collision,
        ignore=ignore,
    )  # fmt: skip

    def clear(Q: Matrix) -> Flags:
        found, every = np.ones(len(Q), dtype=bool), np.arange(len(Q))
        if not len(Q):
            return found
        frames = joint_frames(shaped, Q)
        for gap, limit in zip(pairs.gaps, pairs.limits, strict=True):
            found &= gap.distances(frames, every, wanted) >= limit
        return found

    return clear
