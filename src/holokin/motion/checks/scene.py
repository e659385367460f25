"""`Scene`: what a robot is to keep clear of, and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.types import Value, not_negative, number
from ...robot import LinkShape
from ...robot.formats.urdf import essentials


@dataclass(frozen=True, eq=False)
class DisabledPairs(Value):
    """The pairs of links of which an SRDF says that they need not be looked at, for the robot that it names."""

    file: str
    robot: str
    pairs: tuple[tuple[str, str], ...]

    @staticmethod
    def of(file: str | Path) -> DisabledPairs:
        """The <disable_collisions> of a file, and its <disable_default_collisions> but for <enable_collisions>.

        Raises:
            RobotFileError: it cannot be read, is no SRDF, or an element lacks a link.
        """
        path = Path(file)
        try:
            root = essentials(path.read_bytes(), path)
        except OSError as problem:
            raise RobotFileError(path, f"cannot be read ({problem.strerror})", "check the path") from None
        if root.tag != "robot" or root.findall("joint") or not root.get("name"):
            raise RobotFileError(path, "is no SRDF", "give the file that MoveIt's setup assistant wrote")

        def links(tag: str, *keys: str) -> list[tuple[str, ...]]:
            found = [tuple(element.get(key, "") for key in keys) for element in root.iter(tag)]
            if any("" in names for names in found):
                raise RobotFileError(path, f"has a <{tag}> without {' or '.join(keys)}", "write the names of its links")
            return found

        pairs = {frozenset(names) for names in links("disable_collisions", "link1", "link2")}
        named = {name for pair in pairs for name in pair}
        quiet = {name for (name,) in links("disable_default_collisions", "link")}
        pairs |= {frozenset(two) for two in combinations(sorted(named | quiet), 2) if quiet & set(two)}
        pairs -= {frozenset(names) for names in links("enable_collisions", "link1", "link2")}
        listed = sorted(tuple(sorted(pair)) for pair in pairs if len(pair) == 2)
        return DisabledPairs(path.name, str(root.get("name")), tuple((a, b) for a, b in listed))


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
        padding: by how much more some links are to keep away from everything else, by name [m]: for hoses and cables
            round them. A pair of two such links keeps both.
        disabled: pairs of an SRDF, see `from_srdf`.

    Raises:
        ArgumentError: a floor without a finite height, a negative clearance or padding.
    """

    obstacles: Sequence[LinkShape] = ()
    floor: float | None = None
    clearance: float = 0.01
    self_collision: bool = True
    allowed: Sequence[tuple[str, str]] = ()
    padding: Mapping[str, float] = field(default_factory=dict)
    disabled: DisabledPairs | None = None

    def __post_init__(self) -> None:
        floor = None if self.floor is None else number("floor", self.floor)
        if floor is not None and not np.isfinite(floor):
            raise ArgumentError("floor", floor, "give its height in m, or None")
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "floor", floor)
        object.__setattr__(self, "clearance", not_negative("clearance", self.clearance))
        object.__setattr__(self, "allowed", tuple((a, b) for a, b in self.allowed))
        padded = {name: not_negative(f"the padding of {name}", value) for name, value in self.padding.items()}
        object.__setattr__(self, "padding", padded)
        super().__post_init__()

    @classmethod
    @typed
    def from_srdf(cls, file: str | Path, **more: Any) -> Self:
        """The scene in which the pairs of links that an SRDF disables may touch, as in MoveIt.

        Links without shapes among them are passed over. Where the file is of another robot, the check says so.

        Args:
            file: the SRDF. more: of the scene, as `obstacles` and `floor`.

        Raises:
            RobotFileError: it cannot be read. ArgumentError: as of the scene.
        """
        return cls(**more, disabled=DisabledPairs.of(file))

    @typed
    def asked(self, *names: str) -> float:
        """The distance that is wanted between two things [m]: the clearance, and what is padded."""
        return self.clearance + sum(self.padding.get(name, 0.0) for name in names)

    @property
    def empty(self) -> bool:
        """Whether there is nothing to keep clear of."""
        return not (self.obstacles or self.self_collision or self.floor is not None)
