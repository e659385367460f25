"""`Scene`: what a robot is to keep clear of, and by how much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import Value, not_negative, number
from ...robot import LinkShape


@typed
@dataclass(frozen=True, eq=False)
class Scene(Value):
    """What a robot is to keep clear of: obstacles, a floor and its own links, and by how much.

    The shapes of links belong to the robot: its file gives them, or `with_capsules` and `with_shape` do.

    Args:
        obstacles: shapes that stand still, see `obstacle`.
        floor: height of the floor z [m] in the frame of the base; None for no floor. What does not move stands on it.
        clearance: the least distance wanted [m].
        self_collision: whether links are held against each other.
        allowed: pairs of names that may touch: of two links, of a link and an obstacle, or of a link and "floor"; "*"
            stands for all others.

    Raises:
        ArgumentError: a floor without a finite height, a negative clearance.
    """

    obstacles: Sequence[LinkShape] = ()
    floor: float | None = None
    clearance: float = 0.01
    self_collision: bool = True
    allowed: Sequence[tuple[str, str]] = ()

    def __post_init__(self) -> None:
        floor = None if self.floor is None else number("floor", self.floor)
        if floor is not None and not np.isfinite(floor):
            raise ArgumentError("floor", floor, "give its height in m, or None")
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "floor", floor)
        object.__setattr__(self, "clearance", not_negative("clearance", self.clearance))
        object.__setattr__(self, "allowed", tuple((a, b) for a, b in self.allowed))
        super().__post_init__()

    @property
    def empty(self) -> bool:
        """Whether there is nothing to keep clear of."""
        return not (self.obstacles or self.self_collision or self.floor is not None)
