"""`Certificate`: a theorem about a leaf, the cells that it was computed from, and what can be read off them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.files import write_text
from ..base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector, number_or_none, some
from ..base.units import at_least
from ..path.editing import AnyPath
from ..path.workspaces import Workspace
from ..symbolic import intervals as iv
from ..symbolic.intervals import Interval
from .binding import described, lowered
from .clear_cells import ClearCells
from .equation import Equation
from .tube import Cells, Findings

# --- Boxes that fill a part of a box, as the tree of cuts that the checker reads.

COMPARED = 4096
"""Pairs of boxes that are compared without a further cut."""


def partition(low: Matrix, high: Matrix, sides: Sequence[tuple[float, float]], leaf: Callable[[int], Any]) -> Any:
    """A tree of boxes low <= u <= high (k, d) within a box: [axis, at, below, above], leaf(i) for box i, None for none.

    The boxes are what is left of a box that was cut across, and its parts again: so a cut that meets none is found.
    """
    return _tree(low, high, np.arange(len(low)), list(sides), leaf)


def _tree(low: Matrix, high: Matrix, those: Indices, sides: list[Any], leaf: Callable[[int], Any]) -> Any:
    if not len(those):
        return None
    a, b = np.array(sides).T
    if len(those) == 1 and (low[those[0]] == a).all() and (high[those[0]] == b).all():
        return leaf(int(those[0]))
    cuts = []
    for axis in range(len(sides)):
        ends = np.sort(high[those, axis])
        at = clear_cuts(low[those, axis], ends)
        at = at[(a[axis] < at) & (at < b[axis])]
        under = np.searchsorted(ends, at, side="right")
        cuts += [(abs(2 * int(i) - len(those)), axis, float(c)) for i, c in zip(under, at, strict=True)]
    _, axis, at = min(cuts)
    is_below = high[those, axis] <= at
    lower, upper = sides.copy(), sides.copy()
    lower[axis], upper[axis] = (sides[axis][0], at), (at, sides[axis][1])
    below = _tree(low, high, those[is_below], lower, leaf)
    return [axis, at, below, _tree(low, high, those[~is_below], upper, leaf)]


def clear_cuts(low: Vector, high: Vector) -> Vector:
    """Where stretches low <= u <= high (k,) begin or end, and none is cut."""
    at = np.unique(np.concatenate([low, high]))
    under, over = np.searchsorted(np.sort(high), at, side="right"), np.searchsorted(np.sort(low), at, side="left")
    return at[under >= over]


def left_open(tree: Any, sides: Sequence[tuple[float, float]]) -> tuple[Matrix, Matrix]:
    """(low, high) (k, d) of the parts of a tree of `partition` in which no box is."""
    found, waiting = [], [(tree, list(sides))]
    while waiting:
        part, box = waiting.pop()
        if isinstance(part, list):
            axis, at, below, above = part
            lower, upper = box.copy(), box.copy()
            lower[axis], upper[axis] = (box[axis][0], at), (at, box[axis][1])
            waiting += [(above, upper), (below, lower)]
        elif part is None:
            found.append(box)
    ends = np.array(found).reshape(-1, len(sides), 2)
    return ends[:, :, 0], ends[:, :, 1]


def overlapping(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> tuple[Indices, Indices]:
    """All pairs (one, other) whose boxes low <= u <= high (k, d) have an inside in common, cut until few are left."""
    found, waiting = [np.zeros((0, 2), dtype=int)], [(ones, others)]
    while waiting:
        ones, others = waiting.pop()
        parts = _cut(low, high, ones, others) if len(ones) * len(others) > COMPARED else None
        if parts is not None:
            waiting += parts
        elif len(ones) and len(others):
            for some in np.array_split(ones, -(-len(ones) * len(others) // (16 * COMPARED))):
                start, end = np.maximum(low[some][:, None], low[others]), np.minimum(high[some][:, None], high[others])
                i, j = np.nonzero((start < end).all(axis=2))
                found.append(np.column_stack([some[i], others[j]]))
    pairs = np.unique(np.concatenate(found), axis=0)  # a pair that a cut goes through was found on both sides
    return pairs[:, 0], pairs[:, 1]


def _cut(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> list[tuple[Indices, Indices]] | None:
    """The boxes below and above the cut that leaves the fewest pairs; None where none leaves much fewer."""
    best, parts = 0.75 * len(ones) * len(others), None
    for axis in range(low.shape[1]):
        for cut in (np.median(low[ones, axis]), np.median(high[ones, axis])):
            below = ones[low[ones, axis] < cut], others[low[others, axis] < cut]
            above = ones[high[ones, axis] > cut], others[high[others, axis] > cut]
            pairs = len(below[0]) * len(below[1]) + len(above[0]) * len(above[1])
            if pairs < best:
                best, parts = pairs, [below, above]
    return parts


# --- What is asked of a cell besides its one root: joints within their limits, shapes apart.

FINEST = 1e-3
"""Motion [m] of a cell below which it is not halved for a distance: where this decides, nobody should drive."""


AT = 1e-12
"""Motion [joint units] that is round-off, and distance from a limit: no bound of a root comes below it."""


@dataclass(frozen=True, eq=False)
class Judged(Value):
    """Of k cells: the findings with distances; which are as asked; which cannot be if halved; why not, by row."""

    findings: Findings
    good: Flags
    final: Flags
    near: Flags


@dataclass(frozen=True, eq=False)
class Demands(Value):
    """The limits of the joints, and shapes that are to keep apart; None where they are not asked about."""

    limits: Interval | None
    clear: ClearCells | None = None

    def judged(self, cells: Cells, found: Findings, good: Flags) -> Judged:
        """Cells with a root of their own (`good`), held against what is asked."""
        inside, none = good.copy(), np.zeros(len(good), dtype=bool)
        beyond = none
        if self.limits is not None:
            inside &= ((found.low >= self.limits.low) & (found.high <= self.limits.high)).all(axis=1)
            beyond = good & _beyond(self.limits, cells, found)
        if self.clear is None:
            return Judged(found, inside, beyond, none)
        here: Indices = np.flatnonzero(inside)
        apart = self.clear.over(some(cells, here), found.r[here])
        k, P = len(good), len(self.clear.pairs)
        least, planes = np.full((k, P), -np.inf), np.zeros((k, P, 3))
        least[here], planes[here] = apart.least, apart.planes
        short = ~(apart.least >= self.clear.wanted)
        near, final = none.copy(), beyond.copy()
        near[here] = short.any(axis=1)
        final[here] |= (short & ((apart.motion < FINEST) | (apart.middle < self.clear.wanted))).any(axis=1)
        return Judged(replace(found, apart=least, planes=planes), inside & ~near, final, near)


def _beyond(limits: Interval, cells: Cells, found: Findings) -> Flags:
    """Cells (k,) over all of which a joint is beyond its limit; or is held at it, so that no part of them keeps off."""
    q, moves = (part[:, : found.low.shape[1]] for part in (cells.q0, cells.reach))
    held = (moves <= AT) & ((q >= limits.high - AT) | (q <= limits.low + AT))
    return np.asarray((held | (found.low > limits.high) | (found.high < limits.low)).any(axis=1))


FORMAT = "holokin certificate 3"

DETERMINANT = 0.5
"""Of the bound of the determinant: room for the checker's own, which is another one."""


class Extent(NoTruthValue, Enum, ask="`is Extent.WHOLE`"):
    """How far a proof came, and why no farther; the text names cause and cure."""

    WHOLE = "all that was asked is proven"
    SINGULAR = "[J; J_g] is singular, or so nearly that no cell passes the test; choose another constraint or leaf"
    LIMIT = "a joint is at its limit or beyond it; choose another leaf, or ask with limits=False"
    NEAR = "shapes are not shown to be as far apart as was asked; choose a leaf that keeps away, or ask for less"
    BUDGET = "the cells that were allowed are spent; allow more with budget="
    END = "the leaf could not be followed any farther; choose another leaf, path or constraint"
    APART = "neighbouring cells could not be shown to share a root; allow smaller ones with a larger budget="
    ELSEWHERE = "the path comes back to a tool pose with other joints; choose another constraint, leaf or path"
    RETURN = "the path comes back to a tool pose, and the joints are not shown to; choose another constraint or leaf"

    @property
    def cause(self) -> str:
        """The text without its cure."""
        return self.value.rpartition("; ")[0]

    @property
    def cure(self) -> str:
        """The other part."""
        return self.value.rpartition("; ")[2]


COVERED = (Extent.WHOLE, Extent.ELSEWHERE, Extent.RETURN)
"""Of these cells cover all that was asked; what may be missing is that the joints return with the tool."""


@dataclass(frozen=True, eq=False)
class Boxes(Value):
    """k boxes of parameters: piece (k,), low, high (k, d); rho (k,) of their tubes; again (k,): tried before.

    near (k, n) are unknowns near the root in the middle, by the cell that was halved; NaN where there is none.
    Of a path's piece the parameter is the share of it; of a box of poses they count from -1 to 1 across it.
    """

    piece: Indices
    low: Matrix
    high: Matrix
    rho: Vector
    again: Flags
    near: Matrix

    def __len__(self) -> int:
        return len(self.piece)


@dataclass(frozen=True, eq=False)
class Covered(Value):
    """Boxes that were proven, with their cells and findings; why no more were, and at which box (piece, low)."""

    boxes: Boxes
    cells: Cells
    findings: Findings
    extent: Extent = Extent.WHOLE
    stopped: tuple[int, tuple[float, ...]] | None = None

    def __len__(self) -> int:
        return len(self.boxes)

    def only(self, chosen: Any) -> Covered:
        """Some of them."""
        boxes, cells, findings = (some(part, chosen) for part in (self.boxes, self.cells, self.findings))
        return Covered(boxes, cells, findings, self.extent, self.stopped)


@dataclass(frozen=True, eq=False)
class Anchors(Value):
    """Postures q (k, n) that the roots of k pieces at the parameters u (k, d) are shown to be near to.

    The first one is the start; its root is at most `within` [joint unit] away. Where a piece of a path begins, its root
    and that at the end of the piece before are at most `gap` apart. Of a path that is shown to close, its end and its
    beginning are, but for the whole `turns` (n,) of the joints.
    """

    u: Matrix
    q: Matrix
    within: float
    gap: float
    turns: Vector | None


@dataclass(frozen=True, eq=False)
class Revisit(Value):
    """Two places of a path at which the tool has one pose and the joints are shown to be others.

    `first` and `second` are (piece, share of it); the joints at the second less those at the first are between `low`
    and `high` (n,) [joint unit].
    """

    first: tuple[int, float]
    second: tuple[int, float]
    low: Vector
    high: Vector

    def told(self, equation: Equation) -> str:
        """The places, and the joints that are shown to differ."""
        joints = zip(equation.strategy.task.robot.coordinates, self.low, self.high, strict=True)
        moved = [f"{c.name} by {_between(low, high)} {c.unit}" for c, low, high in joints if low > 0 or high < 0]
        (i, u), (k, v) = self.first, self.second
        first = "at its start" if i == u == 0 else f"at {100 * u:.4g} % of piece {i + 1}"
        second = "at the end" if v == 1 else f"at {100 * v:.4g} % of piece {k + 1}"
        return f"{second} of the path the tool is where it was {first}, and the joints are others, {', '.join(moved)}"


@dataclass(frozen=True, eq=False)
class Certificate(NoTruthValue, Value, ask="`.whole`"):
    """What was proven of a holonomic strategy on the leaf g(q) = c through a posture, over a path or a box of poses.

    `theorem` is it in one sentence; `extent` says how far the proof came, `where` at which place it ended. `proven` are
    the cells, in the order of a path. low, high (n,) are a hull of the joints over them [joint unit], `determinant` a
    lower bound of |det [J; J_g]|, or of |det D_q E| where the constraint has auxiliary unknowns, which q then holds,
    too; `to_limit` (n,) the least distance to each joint's limits. Of a closed path `turns` (n,) are the whole turns of
    the joints round it, and `gap` [joint unit] bounds how far else they end from where they began: not 0, since the
    path itself is given in doubles; else it is infinite. Of a path that comes back to a tool pose with other joints
    `revisit` holds two such places and the difference of the joints, which is proven, too; a closed path drifts by it.
    `asked` is the path or the box that the proof was to be about.
    """

    title: str
    theorem: str
    extent: Extent
    where: str
    proven: Covered
    low: Vector
    high: Vector
    determinant: float
    to_limit: Vector
    turns: Vector
    gap: float
    seconds: float
    equation: Equation
    c: Vector
    anchors: Anchors
    demands: Demands
    pieces: Matrix
    revisit: Revisit | None
    asked: AnyPath | Workspace

    def __len__(self) -> int:
        return len(self.proven)

    def __repr__(self) -> str:
        return f"Certificate({self.title!r}, {self.extent.name}, {len(self)} cells)"

    def __str__(self) -> str:
        return self.theorem

    def table(self) -> str:
        """The numbers of the theorem, as lines of text."""
        lines = [f"proven: {self.extent.value}"] + ([f"up to: {self.where}"] if self.where else [])
        lines.append(f"cells: {len(self)}, after {self.seconds:.2g} s")
        if not len(self):
            return "\n".join(lines)
        f, robot = self.findings, self.equation.strategy.task.robot
        for name, values in (("omega", f.omega), ("eta", f.eta), ("radius", f.r), ("alone within", f.alone)):
            lines.append(f"{name:12} {values.min():9.2e} to {values.max():9.2e}")
        lines.append(f"|det {self.equation.derivative}| >= {at_least(self.determinant)}")
        if np.isfinite(self.gap):
            turns = f", after the whole turns {self.turns.astype(int).tolist()}" if self.turns.any() else ""
            lines.append(f"closed: the joints end within {self.gap:.1e} of where they began{turns}")
        width = max(len("joint"), *map(len, robot.joint_names))
        if self.revisit is not None:
            lines.append(f"{'joint':{width}}  {'moved from':>12} {'to':>12}")
            for joint, low, high in zip(robot.coordinates, self.revisit.low, self.revisit.high, strict=True):
                lines.append(f"{joint.name:{width}}  {low:12.6f} {high:12.6f} {joint.unit}")
        lines.append(f"{'joint':{width}}  {'from':>9} {'to':>9} {'to a limit':>11}")
        for joint, low, high, left in zip(robot.coordinates, self.low, self.high, self.to_limit, strict=True):
            lines.append(f"{joint.name:{width}}  {low:9.4f} {high:9.4f} {left:11.4f} {joint.unit}")
        return "\n".join(lines)

    @property
    def limits(self) -> Interval | None:
        """The limits that the joints are proven to keep; None where they were not asked about."""
        return self.demands.limits

    @property
    def whole(self) -> bool:
        """True where all that was asked is proven: of a path, too, that the same tool pose has the same joints."""
        return self.extent is Extent.WHOLE

    @property
    def covered(self) -> bool:
        """True where cells cover all that was asked: the joints are a continuous function of the place on the path."""
        return self.extent in COVERED

    @property
    def returning(self) -> str:
        """Why the joints are not said to return with the tool; "" where they are."""
        if self.whole:
            return ""
        return self.revisit.told(self.equation) if self.revisit is not None else self.extent.cause

    @property
    def cells(self) -> Cells:
        """Those that passed the test."""
        return self.proven.cells

    @property
    def findings(self) -> Findings:
        """omega, e, eta and the radii of each cell."""
        return self.proven.findings

    @cached_property
    def data(self) -> dict[str, Any]:
        """What the checker reads: the equation as a list of operations, the cells, and what is claimed of them.

        The places of the equation are q, u, a piece's numbers, the level, the constants, the operations.
        """
        equation, boxes, cells, anchors = self.equation, self.proven.boxes, self.proven.cells, self.anchors
        n, d, least = equation.n, equation.d, 0.0 if equation.d == 1 else -1.0
        given = self.pieces.shape[1]
        level = range(n + d + given, n + d + given + len(self.c))
        inputs = [*range(n + d + given), *[0.0] * d, *[1.0] * d, *level]  # u = 0 + 1 y
        place = np.zeros((d, d), dtype=int)
        place[np.triu_indices(d)] = np.arange(cells.Q.shape[2])
        named = {"q0": cells.q0, "V": cells.V, "Q": cells.Q[:, :, np.maximum(place, place.T)], "Y": self.findings.Y}
        clear = {}
        if self.demands.clear is not None:
            named["planes"], clear = self.findings.planes, {"clear": self.demands.clear.described()}

        def tree(piece: int) -> Any:
            here = np.flatnonzero(boxes.piece == piece)

            def leaf(i: int) -> dict[str, Any]:
                return {key: values[here[i]].tolist() for key, values in named.items()}

            return partition(boxes.low[here], boxes.high[here], [(least, 1.0)] * d, leaf)

        robot, finite = equation.strategy.task.robot, np.nan_to_num
        bounds = self.limits or Interval(np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
        joints = (bounds.low, self.low, self.high, bounds.high)
        return {
            "format": FORMAT, "title": self.title, "theorem": self.theorem, "where": self.where,
            "task": described(equation),
            "robot": robot.name, "names": list(robot.joint_names), "units": [c.unit for c in robot.coordinates],
            **lowered(equation.operations, inputs, [*equation.angular, *[False] * equation.positive]),
            **clear, "level": self.c.tolist(),
            "claims": {
                "whole": self.covered,
                "joints": [_bounded(x, n) for x in joints],
                "determinant": self.determinant, "gap": float(finite(anchors.within + anchors.gap)),
                "turns": None if anchors.turns is None else anchors.turns.astype(int).tolist(),
            },
            "pieces": [
                {"numbers": row.tolist(), "u": u.tolist(), "q": q.tolist(), "cells": tree(k)}
                for k, (row, u, q) in enumerate(zip(self.pieces, anchors.u, anchors.q, strict=True))
            ],
        }  # fmt: skip

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write it as JSON, for `holokin check-certificate`. Raises: WriteError."""
        data = self.data
        data = data | {"sha256": digest(data)}
        write_text(file, json.dumps(data, allow_nan=False) + "\n")
        return FilePath(file)


def _bounded(values: Vector, n: int) -> list[float | None]:
    """Bounds of the joints, and of n unknowns in all; None where there is none."""
    return [number_or_none(float(x)) for x in values] + [None] * (n - len(values))


def _between(low: float, high: float) -> str:
    """An interval as text: its middle, and by how much more or less."""
    middle, most = (low + high) / 2, max(abs(low), abs(high))
    return f"{middle:.9g} +- {max((high - low) / 2, 0.0) * 1.01 + 1e-8 * most:.1e}"


def digest(data: dict[str, Any]) -> str:
    """SHA-256 of all but itself."""
    text = json.dumps({key: value for key, value in data.items() if key != "sha256"}, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def least_determinant(found: Findings) -> float:
    """A lower bound of |det D_q E| at all roots: |det Y A| >= (1 - s)^n, s = e + omega r; over |det Y| that of A."""
    if not len(found.r):
        return 0.0
    shrink = np.maximum(1 - (found.e + found.omega * found.r), 0.0)
    with np.errstate(divide="ignore"):
        each = DETERMINANT * shrink ** found.Y.shape[1] / determinants(found.Y).high
    return float(each.min())


def determinants(A: Array) -> Interval:
    """Enclosures (k,) of |det A| of matrices (k, n, n), by elimination, the rows in the order of rounded numbers."""
    from scipy.linalg import lu

    k, n, _ = A.shape
    order = np.array([lu(matrix, p_indices=True)[0] for matrix in A], dtype=int).reshape(k, n).argsort(axis=1)
    M = np.take_along_axis(A, order[:, :, None], axis=1)
    rows = [iv.point(M[:, i, :].T.copy()) for i in range(n)]  # (n, k) each
    total = iv.point(np.ones(k))
    for j in range(n):
        pivot = Interval(rows[j].low[j], rows[j].high[j])
        total = iv.multiply(total, iv.absolute(pivot))
        for i in range(j + 1, n):
            factor = iv.divide(Interval(rows[i].low[j], rows[i].high[j]), pivot)
            rows[i] = iv.subtract(rows[i], iv.multiply(factor, rows[j]))
    return total
