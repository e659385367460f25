"""The checker on a random sample: some cells of a certificate are verified, in pairs that share a root where they meet.

A certificate of a large box takes hours to verify as a whole. A fault in a share p of its cells is found by M draws at
random with a probability of 1 - (1 - p)^M or more. Each cell that is drawn is verified, and so is a neighbour, drawn,
too, which counts for nothing in M. That the cells leave no gap is verified of all of them. It needs python-flint.
"""

import math
import random
from typing import Any

from flint import arb

from .checker import Cell, Checker, Verified, check
from .checker_file import need

RARE = 0.01
"""A share of faulty cells, of which it is said how probably it is found."""


class SampleChecker(Checker):
    """Verifies a share of the cells of a certificate, drawn from the numbers that a seed begins."""

    def __init__(self, data: Any, say: Any, seconds: float, total: int, sample: float, seed: int) -> None:
        super().__init__(data, say, seconds, total)
        self.sample, self.seed, self.drawn = sample, seed, random.Random(seed)
        self.cells, self.draws, self.faces = 0, 0, 0

    def leaf(self, data: Any, sides: Any) -> Any:
        """A cell that is not proven yet."""
        return data, sides

    def meet(self, lower: list[Any], upper: list[Any], axis: int, cut: float) -> None:
        """Of cells that are not proven nothing is asked."""

    def verify(self) -> Verified:
        """Of each piece the cell of its posture, and cells with a neighbour each, until there are enough."""
        # That the cells leave no gap.
        pieces, level = self.data["pieces"], self.data["level"] + self.data["constants"]
        box = [(0, 1) if self.d == 1 else (-1, 1)] * self.d
        covers = []
        for k, piece in enumerate(pieces):
            self.whole = self.claims["whole"] or k + 1 < len(pieces)
            covers.append(self.cover(piece["cells"], box))
        self.cells, total = sum(map(len, covers)), math.prod(b - a for a, b in box) * len(pieces)
        filled = sum(math.prod(float(b - a) for a, b in sides) for cover in covers for _, sides in cover) / total
        # The sample.
        self.total = sum(max(1, math.ceil(self.sample * len(cover))) for cover in covers)
        for piece, cover in zip(pieces, covers, strict=True):
            self.numbers = [arb(x) for x in piece["numbers"] + level]
            self.draw(piece, cover)
        return Verified(False, self.sentences(filled), self.words(), self.data)

    def draw(self, piece: Any, cover: list[Any]) -> None:
        """The sample of a piece. Raises: RejectedError."""
        proven: dict[int, Cell] = {}

        def cell(i: int) -> Cell:
            if i not in proven:
                proven[i] = self.prove(Cell(*cover[i]))
            return proven[i]

        # The cell of the posture.
        u = [0] if self.d == 1 else piece["u"]
        inside = [all(a <= x <= b for x, (a, b) in zip(u, box, strict=True)) for _, box in cover]
        need(any(inside), f"no cell is at {u}, where the posture is")
        need(
            self.off(cell(inside.index(True)), u, piece["q"]) <= self.claims["gap"], "the start may be no posture of it"
        )
        # (axis, place) -> cells that begin there, and that end there.
        ends: Any = [{}, {}]
        for i, (_, box) in enumerate(cover):
            for axis, side in enumerate(box):
                for which in (0, 1):
                    ends[which].setdefault((axis, side[which]), []).append(i)
        # Cells that are drawn, each with a neighbour.
        count = max(1, math.ceil(self.sample * len(cover)))
        for i in self.drawn.sample(range(len(cover)), len(cover)):
            if len(proven) >= count:
                return
            self.draws += 1
            cell(i)
            beside = [
                (j, axis)
                for axis, side in enumerate(cover[i][1])
                for which in (0, 1)
                for j in ends[1 - which].get((axis, side[which]), [])
                if _meet(cover[i][1], cover[j][1], axis)
            ]
            if beside:
                j, axis = self.drawn.choice(beside)
                self.join(cell(i), cell(j), axis)
                self.faces += 1

    def sentences(self, filled: float) -> list[str]:
        """What was verified, in sentences, and what was not."""
        joints = zip(range(self.joints), self.data["units"], strict=True)
        hull = ", ".join(f"{self.hull[0][i]:.6g} to {self.hull[1][i]:.6g} {unit}" for i, unit in joints)
        percent = math.floor(1000 * (1 - (1 - RARE) ** self.draws)) / 10
        return [
            f"of {self.cells:,} cells, {self.count:,} were checked, drawn at random (seed {self.seed}), and "
            f"{self.faces:,} places where two cells meet: they have one posture there",
            f"the others were NOT checked; if {RARE:.0%} of the cells were faulty, such a sample would find one with a "
            f"probability of {percent:g} % or more",
            f"all cells together fill {'all' if self.claims['whole'] else f'{100 * filled:.3g} %'} of what was asked",
            "in those that were checked: at each place one posture, no other near, none singular: |det D_q E| "
            f">= {self.least:.3g}; joints {hull}",
            "that a path closes or comes back to a tool pose was not looked at",
            *(self.clear.lines() if self.clear else []),
        ]


def _meet(box: Any, other: Any, across: int) -> bool:
    """Whether two boxes that touch across an axis have a part of that face in common."""
    sides = enumerate(zip(box, other, strict=True))
    return all(axis == across or max(a, c) < min(b, d) for axis, ((a, b), (c, d)) in sides)


def check_sample(
    file: str, say: Any = lambda _cells: None, seconds: float = math.inf, sample: float = RARE, seed: int = 0
) -> Verified:
    """What a sample of the cells of a certificate's file proves. Raises: as `check`."""

    def begun(data: Any, say: Any, seconds: float, total: int) -> SampleChecker:
        return SampleChecker(data, say, seconds, total, sample, seed)

    return check(file, say, seconds, begun)
