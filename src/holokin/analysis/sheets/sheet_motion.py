"""`SheetMotion`: joints along a path over several sheets, with the changes between them."""

from __future__ import annotations

from dataclasses import dataclass

from ...base.errors import DividedPathError
from ...base.types import Matrix, NoTruthValue, Value
from ...motion.trajectory import Trajectory
from ...path import Path
from .seams import Seam


@dataclass(frozen=True, eq=False)
class SheetPiece(Value):
    """A part of a path on one sheet: from `start` to `stop`, as shares of the path's duration; its joints alone."""

    sheet: int
    start: float
    stop: float
    trajectory: Trajectory

    def __str__(self) -> str:
        return f"{_percent(self.start)} to {_percent(self.stop)} of the path: sheet {self.sheet}"


@dataclass(frozen=True, eq=False)
class Division(Value):
    """Where on a path, as a share of its duration, the arm must leave the tool's pose to go on, and why."""

    at: float
    first: int
    second: int
    pose: Matrix
    reason: str

    def __str__(self) -> str:
        return (
            f"divided at {_percent(self.at)} of the path, from sheet {self.first} to sheet {self.second}: {self.reason}"
        )


@dataclass(frozen=True, eq=False)
class UnservedPart(Value):
    """A part of a path that no sheet serves, from `start` to `stop` as shares of its duration, a pose of it, why."""

    start: float
    stop: float
    pose: Matrix
    reason: str

    def __str__(self) -> str:
        return f"{_percent(self.start)} to {_percent(self.stop)} of the path are left out: {self.reason}"


@dataclass(frozen=True, eq=False)
class SheetMotion(NoTruthValue, Value, ask="`.complete`"):
    """Joints along a path over several sheets; `s.follow(path)` makes one.

    Of all choices of sheets along the path, at its samples, this one has the fewest divisions, of these the fewest
    changes, of these the least seconds of joint motion.

    pieces: each on one sheet. seams: the changes between them, with the tool at rest. divisions: where the arm must
    leave the pose. left_out: what no sheet serves. parts: motions without a division, seams included.
    """

    path: Path
    pieces: tuple[SheetPiece, ...]
    seams: tuple[Seam, ...]
    divisions: tuple[Division, ...]
    left_out: tuple[UnservedPart, ...]
    parts: tuple[Trajectory, ...]

    @property
    def complete(self) -> bool:
        """Whether the whole path is served without a division."""
        return not self.divisions and not self.left_out

    @property
    def changes(self) -> int:
        """How often the sheet changes with the tool at rest."""
        return len(self.seams)

    @property
    def cuts(self) -> int:
        """How often the motion is interrupted: by a division, or by what is left out between two pieces."""
        return max(0, len(self.parts) - 1)

    @property
    def trajectory(self) -> Trajectory:
        """The motion along the whole path, seams included, for `hk.check`, `hk.retime` and robot programs.

        It has the path's own times, longer where a joint would exceed its speed limit; the tool rests at seams.

        Raises:
            DividedPathError: the path is divided, or not served as a whole.
        """
        if self.complete:
            return self.parts[0]
        why = str((*self.left_out, *self.divisions)[0])
        cure = "take `.parts`, the motions without a division, or change the path, the sheets or the stops"
        first = self.parts[0] if self.parts else None
        raise DividedPathError(f"the path is not followed as a whole: {why}", cure, first)

    @property
    def sentence(self) -> str:
        """How it came out, in words."""
        used = len({one.sheet for one in self.pieces})
        parts = [_count(used, "sheet"), _count(self.changes, "change"), _count(len(self.divisions), "division")]
        lost = sum(one.stop - one.start for one in self.left_out)
        said = f"{parts[0]}, {parts[1]}, {parts[2]}; {_percent(1 - lost)} of the path served"
        return f"{said}; at these samples no choice among the sheets has fewer divisions, or as few and fewer changes"

    def __str__(self) -> str:
        rows = [(one.start, f"  {one}") for one in (*self.pieces, *self.left_out)]
        rows += [(one.at, f"  {one}") for one in self.divisions]
        lines = [text for _, text in sorted(rows, key=lambda row: row[0])]
        return "\n".join([self.sentence, *lines, *(f"  change: {one}" for one in self.seams)])


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _count(many: int, word: str) -> str:
    return f"{many} {word}{'' if many == 1 else 's'}"
