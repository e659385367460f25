"""The proof along a path: cells of its pieces one after the other, glued at their ends.

The root at the end of a cell must lie where the next cell's is the only root; so the roots make one smooth curve of
joints. Where a path's pieces meet, and where a closed path ends, its poses agree but for round-off of at most `SEAM`,
which the test carries as a slack.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..path import Path
from ..strategies import HolonomicStrategy
from ..trajectory import Trajectory
from ..types import Array, Flags, Indices, Matrix, Value, Vector, kept
from .certificate import Boxes, Covered, joined
from .equation import Equation
from .search import AIM, TUBE, Domain
from .targets import Stretch
from .tube import Cells, examined

SEAM = 1e-12
"""Metres, and lengths of the columns of rotations, by which the ends of joined pieces may differ."""

OVERLAP = 1 + 1e-9
"""Cells are this much longer than their share, so that neighbours share poses whatever the rounding of their ends."""


@kept
def equation_along(strategy: HolonomicStrategy, turning: bool) -> Equation:
    """The equation of a strategy along paths, made once."""
    return Equation(strategy, Stretch(turning))


@dataclass(frozen=True, eq=False)
class Pathway(Value, Domain):
    """Joints near the leaf c (r,) as a function of a path: splines through a trajectory, one a piece.

    `rows` are those of `Path.table`; `ends` the share of each piece up to which it was followed.
    """

    equation: Equation
    c: Vector
    splines: tuple[Callable[[Array], Matrix], ...]
    rows: Matrix
    ends: Vector
    slack: float = SEAM

    @staticmethod
    def of(strategy: HolonomicStrategy, path: Path, walk: Trajectory, samples: int) -> Pathway:
        """From the postures of `follow`, which may have ended early."""
        from scipy.interpolate import make_interp_spline

        start = walk.q[0]
        rows = path.table(strategy.task.pose(start)[:3, :3])
        splines, ends, first = [], [], 0
        for count in path.counts(samples).tolist():
            got = min(count, len(walk.q) - 1 - first)
            if got < 1:
                break
            splines.append(make_interp_spline(np.arange(got + 1) / count, walk.q[first : first + got + 1], min(3, got)))
            ends.append(got / count)
            first += count
        equation = equation_along(strategy, bool(rows[:, 13:16].any()))
        return Pathway(equation, strategy.g(start), tuple(splines), rows[: len(splines)], np.array(ends))

    def first(self) -> Boxes:
        """Cells in which e is about `AIM`, from omega at sampled postures."""
        piece = np.repeat(np.arange(len(self.splines)), 9)
        u = np.tile(np.linspace(0, 1, 9), len(self.splines)) * np.repeat(self.ends, 9)
        q, n = self._at(piece, u), self.equation.n
        still = np.zeros((len(q), n, 1))
        numbers = np.array([Stretch.of(self.rows[i], x, 0.0) for i, x in zip(piece, u, strict=True)])
        found = examined(self.equation, Cells(q, still, still, numbers, np.full(len(q), 1e-9)), self.c)
        omega = np.minimum(found.omega, 1e6)
        parts = []
        for i, end in enumerate(self.ends.tolist()):
            fine = np.linspace(0, end, 257)
            way = np.linalg.norm(np.diff(self.splines[i](fine), axis=0), axis=1)
            bend = np.interp(fine, u[piece == i], omega[piece == i])
            total = np.concatenate([[0.0], np.cumsum(way * (bend[1:] + bend[:-1]) / 2)])
            count = max(1, int(np.ceil(total[-1] / (2 * AIM))))
            edges = np.interp(np.linspace(0, total[-1], count + 1), total, fine)
            edges[0], edges[-1] = 0.0, end
            rho = TUBE / np.interp((edges[1:] + edges[:-1]) / 2, fine, bend)
            parts.append(Boxes(np.full(count, i), edges[:-1, None], edges[1:, None], rho, np.zeros(count, dtype=bool)))
        return joined(*parts)

    def numbers(self, boxes: Boxes) -> Matrix:
        """Of the family `Stretch`."""
        middle, half = (boxes.low + boxes.high) / 2, (boxes.high - boxes.low) / 2 * OVERLAP
        return np.array(
            [Stretch.of(self.rows[i], m, h) for i, m, h in zip(boxes.piece, middle[:, 0], half[:, 0], strict=True)]
        ).reshape(len(boxes), -1)

    def joints(self, boxes: Boxes) -> Matrix:
        """By the splines."""
        return self._at(boxes.piece, (boxes.low + boxes.high)[:, 0] / 2)

    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """Those behind the first place where the proof failed."""
        piece, (low, *_) = min(stopped)
        return (boxes.piece > piece) | ((boxes.piece == piece) & (boxes.low[:, 0] >= low))

    def arranged(self, found: Covered) -> Covered:
        """In the order of the path, up to where the proof failed."""
        b = found.boxes
        order = np.lexsort((b.low[:, 0], b.piece))
        if found.stopped is not None:
            piece, (low, *_) = found.stopped
            order = order[((b.piece < piece) | ((b.piece == piece) & (b.low[:, 0] < low)))[order]]
        return found.only(order)

    def unglued(self, found: Covered) -> Flags:
        """Those whose root at the end is not shown to be the next one's only root at its beginning, and the next."""
        k = len(found)
        out = np.zeros(k, dtype=bool)
        if k > 1:
            last, first = found.cells.predicted(np.ones((k, 1))), found.cells.predicted(-np.ones((k, 1)))
            apart = np.linalg.norm(last[:-1] - first[1:], axis=1) + found.findings.r[:-1] + 1e-13
            out[:-1] = ~(apart <= found.findings.alone[1:] * (1 - 1e-12))
            out[1:] |= out[:-1]
        return out

    def place(self, found: Covered) -> str:
        """Piece and share."""
        if found.stopped is None:
            return ""
        piece, (low, *_) = found.stopped
        return f"{100 * low:.4g} % of piece {piece + 1} of the path"

    def _at(self, piece: Indices, u: Vector) -> Matrix:
        n = self.equation.n
        return np.array([self.splines[i](x) for i, x in zip(piece, u, strict=True)]).reshape(len(piece), n)


def closing(found: Covered, revolute: Flags) -> tuple[Vector, float]:
    """(whole turns (n,) of the joints, a bound of what is missing besides them); infinite if that is not shown.

    The root at the end must be the only root that the first cell has at its beginning; both poses agree to `SEAM`.
    """
    cells, findings = found.cells, found.findings
    last, first = cells.predicted(np.ones((len(cells), 1)))[-1], cells.predicted(-np.ones((len(cells), 1)))[0]
    turns = np.where(revolute, np.rint((last - first) / (2 * np.pi)), 0.0)
    apart = float(np.linalg.norm(last - 2 * np.pi * turns - first)) + float(findings.r[-1]) + 1e-13
    if not apart <= findings.alone[0] * (1 - 1e-12):
        return turns, np.inf
    size = float(np.linalg.norm(findings.Y[0])) * (1 + 1e-12)
    slope = 1 - float(findings.e[0]) - float(findings.omega[0]) * float(findings.r[0])
    return turns, size * SEAM / slope
