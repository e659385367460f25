"""`Surroundings`: what a robot is to keep clear of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Value
from ...motion.checks import Clear, clear_postures
from ...proof.kept_apart import CLEARANCE
from ...robot import LinkShape, Robot


@dataclass(frozen=True, eq=False)
class Surroundings(Value):
    """Obstacles and a floor, and by how much [m] the robot keeps clear of them and of itself, as of `check`."""

    obstacles: tuple[LinkShape, ...] = ()
    floor: float | None = None
    clearance: float = CLEARANCE
    self_collision: bool = True
    ignore: tuple[tuple[str, str], ...] = ()
    shapes_of: Robot | None = None

    def clear(self, robot: Robot) -> Clear:
        """Which of some postures (k, n) of the robot keep clear. Raises: UnknownNameError, ArgumentError."""
        return clear_postures(
            self.shapes_of or robot, obstacles=self.obstacles, floor=self.floor, clearance=self.clearance,
            self_collision=self.self_collision, ignore=self.ignore,
        )  # fmt: skip

    @property
    def digest(self) -> str:
        """A short text that differs where what is to be kept clear of differs: SHA-256 of all numbers and names."""
        shapes = [
            [one.link, one.joint, one.placement.tolist(), repr(one.shape), *_size(one)]
            for one in (*self.obstacles, *(() if self.shapes_of is None else self.shapes_of.shapes))
        ]  # fmt: skip
        rest = [self.floor, self.clearance, self.self_collision, sorted(map(list, self.ignore))]
        return hashlib.sha256(json.dumps([shapes, rest]).encode()).hexdigest()[:16]


def _size(one: LinkShape) -> list[float]:
    """The ball that holds a shape; nothing of one that could not be read, and may touch what it likes."""
    return [] if one.shape.fault else np.hstack(one.shape.ball).tolist()


def surroundings(
    clear_of: Sequence[LinkShape] | None, floor: float | None, clearance: float, self_collision: bool,
    ignore: Sequence[tuple[str, str]], shapes_of: Robot | None,
) -> Surroundings | None:  # fmt: skip
    """Those that are named; None where nothing is to be looked at. Raises: ArgumentError: a floor alone."""
    if clear_of is None:
        if floor is not None:
            raise ArgumentError("floor", floor, "give clear_of, too: [] for the floor and the links alone")
        return None
    return Surroundings(tuple(clear_of), floor, clearance, self_collision, tuple(ignore), shapes_of)
