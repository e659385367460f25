"""`Certificate`: a theorem about a leaf, the cells that it was computed from, and what can be read off them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import posture_text
from ..base.files import write_text
from ..base.types import Indices, Matrix, NoTruthValue, Value, Vector, number_or_none, some
from ..base.units import at_least, share_text
from ..motion.checks import PairDistance
from ..path.editing import AnyPath
from ..path.workspaces import Workspace
from ..symbolic import jacobian, symbol
from ..symbolic.interval_function import IntervalFunction
from ..symbolic.intervals import Interval
from .binding import described, lowered_equation
from .cell_search import COVERED, Boxes, Covered, Demands, Extent
from .equation import Equation, PoseBox
from .tube import UP, Cells, Findings

# --- Boxes that fill a part of a box, as the tree of cuts that the checker reads.


def partition(low: Matrix, high: Matrix, sides: Sequence[tuple[float, float]], leaf: Callable[[int], Any]) -> Any:
    """A tree of boxes low <= u <= high (k, d) within a box: [axis, at, below, above], leaf(i) for box i, None for none.

    The boxes are what is left of a box that was cut across, and its parts again: so a cut that meets none is found.
    """

    def tree(rows: Indices, sides: list[tuple[float, float]]) -> Any:
        if not len(rows):
            return None
        a, b = np.array(sides).T
        if len(rows) == 1 and (low[rows[0]] == a).all() and (high[rows[0]] == b).all():
            return leaf(int(rows[0]))
        # Of the cuts that meet no box, the one with the most equal numbers of boxes on both sides.
        cuts = []
        for axis in range(len(sides)):
            ends = np.sort(high[rows, axis])
            places = clear_cuts(low[rows, axis], ends)
            places = places[(a[axis] < places) & (places < b[axis])]
            counts = np.searchsorted(ends, places, side="right")
            uneven = np.abs(2 * counts - len(rows)).tolist()
            cuts += [(u, axis, place) for u, place in zip(uneven, places.tolist(), strict=True)]
        _, axis, cut = min(cuts)
        is_below, (below, above) = high[rows, axis] <= cut, _cut_sides(sides, axis, cut)
        return [axis, cut, tree(rows[is_below], below), tree(rows[~is_below], above)]

    return tree(np.arange(len(low)), list(sides))


def _cut_sides(sides: list[tuple[float, float]], axis: int, cut: float) -> list[list[tuple[float, float]]]:
    """The sides of the two parts of a box."""
    ends = (sides[axis][0], cut), (cut, sides[axis][1])
    return [[*sides[:axis], end, *sides[axis + 1 :]] for end in ends]


def clear_cuts(low: Vector, high: Vector) -> Vector:
    """Where stretches low <= u <= high (k,) begin or end, and none is cut."""
    places = np.unique(np.concatenate([low, high]))
    ended = np.searchsorted(np.sort(high), places, side="right")
    begun = np.searchsorted(np.sort(low), places, side="left")
    return places[ended >= begun]


def left_open(tree: Any, sides: Sequence[tuple[float, float]]) -> tuple[Matrix, Matrix]:
    """(low, high) (k, d) of the parts of a tree of `partition` in which no box is."""
    empty, waiting = [], [(tree, list(sides))]
    while waiting:
        part, box = waiting.pop()
        if isinstance(part, list):
            axis, cut, below, above = part
            lower, upper = _cut_sides(box, axis, cut)
            waiting += [(above, upper), (below, lower)]
        elif part is None:
            empty.append(box)
    ends = np.array(empty).reshape(-1, len(sides), 2)
    return ends[:, :, 0], ends[:, :, 1]


# --- The certificate.

FORMAT = "holokin certificate 3"

START = "the start"
"""Where a proof ends that does not hold its start."""

PART = "This is proven:"
"""What comes after it holds, where not all is proven."""


@dataclass(frozen=True, eq=False)
class Anchors(Value):
    """Postures q (k, n) that the roots of k pieces at the parameters u (k, d) are shown to be near to.

    The first one is the start; its root is at most `within` [joint unit] away. Where a piece of a path begins, its root
    and that at the end of the piece before are at most `gap` apart. Of a path that is shown to close, its end and its
    beginning are, but for the whole `turns` (n,) of the joints. `begun`: the start is shown to be on the proven leaf.
    """

    u: Matrix
    q: Matrix
    within: float
    gap: float
    turns: Vector | None
    begun: bool


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

    def words(self, equation: Equation) -> str:
        """The places, and the joints that are shown to differ."""
        moved = []
        for joint, low, high in zip(equation.strategy.task.robot.coordinates, self.low, self.high, strict=True):
            if low > 0 or high < 0:
                half = max((high - low) / 2, 0.0) * 1.01 + 1e-8 * max(abs(low), abs(high))
                moved.append(f"{joint.name} by {(low + high) / 2:.9g} +- {half:.1e} {joint.unit}")
        (i, u), (k, v) = self.first, self.second
        first = "at its start" if i == u == 0 else f"at {100 * u:.4g} % of piece {i + 1}"
        second = "at the end" if v == 1 else f"at {100 * v:.4g} % of piece {k + 1}"
        return f"{second} of the path the tool is where it was {first}, and the joints are others, {', '.join(moved)}"


@dataclass(frozen=True, eq=False)
class Certificate(NoTruthValue, Value, ask="`.whole`"):
    """What was proven of a holonomic strategy on the leaf g(q) = c through a posture, over a path or a box of poses.

    `theorem` is it in words; `extent` says how far the proof came, `where` at which place it ended. `proven` are
    the cells, in the order of a path; they fill the `share` of the box, of positions by volume and of turns by the Haar
    measure, or of the pieces of the path. low, high (n,) are a hull of the joints over them [joint unit],
    `determinant` a lower bound of |det [J; J_g]|, or of |det D_q E| where the constraint has auxiliary unknowns, which
    q then holds, too; `to_limit` (n,) the least distance to each joint's limits. Of a closed path `turns` (n,) are the
    whole turns of the joints round it, and `gap` [joint unit] bounds how far else they end from where they began: not
    0, since the path itself is given in doubles; else it is infinite. Of a path that comes back to a tool pose with
    other joints `revisit` holds two such places and the difference of the joints, which is proven, too; a closed path
    drifts by it. Where shapes end the proof `near` holds the pair, the distance and the posture, in the middle of the
    cell that could not be proven; of other ends `reason` says more, where it is known. `asked` is the path or the box
    that the proof was to be about.
    """

    extent: Extent
    where: str
    proven: Covered
    share: float
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
    near: PairDistance | None
    reason: str
    asked: AnyPath | Workspace

    def __len__(self) -> int:
        return len(self.proven)

    def __repr__(self) -> str:
        return f"Certificate({self.title!r}, {self.extent.name}, {len(self)} cells)"

    def __str__(self) -> str:
        return self.theorem

    @property
    def title(self) -> str:
        """The names of the strategy and the task."""
        return f"{self.equation.strategy.name}, {self.equation.strategy.task.name}"

    @cached_property
    def theorem(self) -> str:
        """What is proven, in a few sentences.

        On the leaf g(q) = c through the start every place has exactly one posture in the tube of its cell: a continuous
        function of the place, smooth over a box and between the corners of a path, on which [J; J_g] is regular.
        """
        if not len(self):
            return f"Nothing is proven: {self.cause}{'' if self.near else f', at {self.where or START}'}."
        sentences, box = self._claims, isinstance(self.asked, Workspace)
        if self.whole:
            return " ".join(sentences)
        if self.revisit is not None:
            return f"The joints do not return with the tool: {self.revisit.words(self.equation)}. {PART} {sentences[0]}"
        if not self.anchors.begun:
            sentences.append("The pose of the start is not proven.")
        place = f": at {self.where}," if self.where else ":"
        if not box and self.where != START:
            place = f", only up to {self.where}:"
        elif self.near is not None:  # it tells the place itself
            place = ":"
        return f"Not all is proven{place} {self.cause}. {PART} {' '.join(sentences)}"

    @property
    def _claims(self) -> list[str]:
        """The sentences that hold, what matters most first."""
        equation, strategy, box = self.equation, self.equation.strategy, isinstance(self.asked, Workspace)
        sentences = []
        # Whether the joints return with the tool.
        turned = f", but for the whole turns {self.turns.astype(int).tolist()}" if self.turns.any() else ""
        if np.isfinite(self.gap):
            sentences.append(f"At the end of the closed path the joints are those of its beginning{turned}.")
        if self.whole and not box:
            pose = "a tool pose" if strategy.task.frames == 1 else "the tools' poses"
            same = "whole turns apart at most" if turned else "the same"
            sentences.append(f"Wherever the path comes back to {pose}, the joints are {same}.")
        # One posture for each place.
        if box:
            part = (
                f"Everywhere in {self.asked}"
                if self.covered
                else f"In one part, {share_text(self.share)} of {self.asked},"
            )
            sentences.append(
                f"{part} the tool's pose alone decides the joints: every loop of the tool there returns them."
            )
        else:
            part = "All along the path" if self.covered else "Up to there"
            sentences.append(f"{part} the joints follow the tool without a jump.")
        with_others, q = "", ""
        if equation.n > equation.joints:
            with_others = " (taken with the auxiliary unknowns of the constraint)"
            q = ", q the joints and these unknowns"
        sentences.append(
            f"Moved by {strategy.name!r} from the start, for the task {strategy.task.name!r}, the robot has one posture"
            f"{with_others} at each {'pose' if box else 'place'} and no other near it, and none of them is singular "
            f"(|det {equation.derivative}| >= {at_least(self.determinant, 2)}{q}; {len(self)} cells)."
        )
        # Limits and distances.
        if self.limits is not None and np.isfinite(self.to_limit).any():
            room = at_least(float(self.to_limit.min()), 2)
            sentences.append(f"Every joint stays {room} or more (rad or m) from its limits.")
        if self.demands.clear is not None:
            words = self.demands.clear.words(self.findings.apart)
            sentences.append(f"{words[0].upper()}{words[1:]}.")
        return sentences

    @property
    def cause(self) -> str:
        """Why not all is proven: the pair, the joint or the motion of the tool, where it is known."""
        if self.near is not None:
            little = (
                "" if self.near.too_near else ": too little room for a proof, with convex shapes in place of bodies"
            )
            return f"{self.near}, the joints at {posture_text(np.round(self.near.q, 4))}{little}"
        return self.reason or self.extent.cause

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, ready for JSON: arrays are lists, statuses and nouns their names, NaN is null."""
        return {"title": self.title, "theorem": self.theorem, **super().to_dict()}

    def table(self) -> str:
        """The numbers of the theorem, as lines of text."""
        lines = [f"proven: {self.extent.value}"] + ([f"up to: {self.where}"] if self.where else [])
        lines.append(f"cells: {len(self)}, after {self.seconds:.2g} s")
        if not len(self):
            return "\n".join(lines)
        # The test of the cells.
        f, robot = self.findings, self.equation.strategy.task.robot
        for name, values in (("omega", f.omega), ("eta", f.eta), ("radius", f.r), ("alone within", f.alone)):
            lines.append(f"{name:12} {values.min():9.2e} to {values.max():9.2e}")
        lines.append(f"|det {self.equation.derivative}| >= {at_least(self.determinant)}")
        if np.isfinite(self.gap):
            turns = f", after the whole turns {self.turns.astype(int).tolist()}" if self.turns.any() else ""
            lines.append(f"closed: the joints end within {self.gap:.1e} of where they began{turns}")
        # How the joints differ where the tool comes back, and their hull.
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
    def nearest_pair(self) -> tuple[tuple[str, str], float] | None:
        """The two bodies that are proven to be as near to each other as no others, and the distance [m] that they keep
        at least; None where nothing was asked about distances."""
        return None if self.demands.clear is None else self.demands.clear.nearest(self.findings.apart)

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
        return self.revisit.words(self.equation) if self.revisit is not None else self.cause

    @property
    def boxes(self) -> Boxes:
        """Those of the cells."""
        return self.proven.boxes

    def _near(self, cell: Indices, u: Matrix) -> tuple[Matrix, Vector]:
        """(postures (k, n) near those at parameters u (k, d) in some cells (k,), how far about them there are none but
        these)."""
        q = some(self.boxes, cell).predicted(some(self.cells, cell), u)
        return q[:, : self.equation.joints], self.findings.alone[cell]

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
        # The arrays of the cells; Q as symmetric matrices.
        n, d, robot = equation.n, equation.d, equation.strategy.task.robot
        pair = np.zeros((d, d), dtype=int)
        pair[np.triu_indices(d)] = np.arange(cells.Q.shape[2])
        arrays = {"q0": cells.q0, "V": cells.V, "Q": cells.Q[:, :, np.maximum(pair, pair.T)], "Y": self.findings.Y}
        clear = {}
        if self.demands.clear is not None:
            arrays["planes"], clear = self.findings.planes, {"clear": self.demands.clear.described()}
        # The pieces, each with a tree of its cells.
        pieces, sides = [], [(0.0 if d == 1 else -1.0, 1.0)] * d
        for k, (numbers, u, q) in enumerate(zip(self.pieces, anchors.u, anchors.q, strict=True)):
            rows = np.flatnonzero(boxes.piece == k)

            def leaf(i: int, rows: Indices = rows) -> dict[str, Any]:
                return {key: values[rows[i]].tolist() for key, values in arrays.items()}

            tree = partition(boxes.low[rows], boxes.high[rows], sides, leaf)
            pieces.append({"numbers": numbers.tolist(), "u": u.tolist(), "q": q.tolist(), "cells": tree})
        # Limits and hull of the joints; None where there is none, and for the other unknowns.
        limits = self.limits or Interval(np.full(robot.n, -np.inf), np.full(robot.n, np.inf))
        bounds = (limits.low, self.low, self.high, limits.high)
        claims = {
            "whole": self.covered,
            "joints": [[*(number_or_none(float(x)) for x in side), *[None] * (n - len(side))] for side in bounds],
            "determinant": self.determinant,
            "gap": float(np.nan_to_num(anchors.within + anchors.gap)),
            "turns": None if anchors.turns is None else anchors.turns.astype(int).tolist(),
        }
        return {
            "format": FORMAT,
            "title": self.title,
            "theorem": self.theorem,
            "where": self.where,
            "task": described(equation),
            "robot": robot.name,
            "names": list(robot.joint_names),
            "units": [joint.unit for joint in robot.coordinates],
            **lowered_equation(equation),
            **clear,
            "level": self.c.tolist(),
            "claims": claims,
            "pieces": pieces,
        }

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write it as JSON, for `holokin check-certificate`. Raises: WriteError."""
        data = self.data | {"sha256": digest(self.data)}
        write_text(file, json.dumps(data, allow_nan=False) + "\n")
        return FilePath(file)


def digest(data: dict[str, Any]) -> str:
    """SHA-256 of all but itself."""
    text = json.dumps({key: value for key, value in data.items() if key != "sha256"}, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


# --- `joint_rates`: how fast each joint is at most, over the speed of the tool, anywhere in what is proven.
#
# Along the predictor p(y) of a cell E(p(y), y) changes by F', and at the roots q(y) the derivative is q' = p' - A^-1
# (F' + ...), so that |q' - p'| is at most (|Y F'| + (|Y D_q D_y E| + omega |p'|) r) / (1 - e - omega r). The sizes of
# q' by y are `Findings.slopes`; here they are taken over the tool's motion per y.


@dataclass(frozen=True, eq=False)
class JointRates(Value):
    """Upper bounds of joint speeds, in joint units a second: `per_speed` (n,) where the tool moves by 1 m/s, `per_turn`
    (n,) where it turns by 1 rad/s. Joint i is no faster than per_speed[i] |v| + per_turn[i] |w|.

    Of a path the two stand for each other: the tool turns as the path says, and `per_turn` is 0. Of several tools
    |v| is the speed of the fastest.
    """

    per_speed: Vector
    per_turn: Vector
    limits: Vector
    """The speed limits (n,) of the joints."""

    @property
    def tool_speed(self) -> float:
        """The speed of the tool [m/s] at which no joint is faster than its limit, where it does not turn besides.

        NaN where a joint has no limit.
        """
        if not np.isfinite(self.limits).all():
            return np.nan
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(self.limits / self.per_speed, nan=np.inf, posinf=np.inf).min(initial=np.inf))


@typed
def joint_rates(certificate: Certificate) -> JointRates:
    """How fast each joint is at most over what a certificate proves, for any motion of the tool in it.

    Infinite for a path on which the tool stands still while it turns.
    """
    slopes, boxes, equation = certificate.findings.slopes, certificate.proven.boxes, certificate.equation
    limits, n = equation.strategy.task.robot.max_velocity, equation.joints
    if not len(certificate):
        return JointRates(np.zeros(n), np.zeros(n), limits)
    if not isinstance(equation.family, PoseBox):
        steps = _steps(certificate)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(slopes[:, :, 0] > 0, slopes[:, :, 0] / steps[:, None], 0.0)
        return JointRates(rates.max(axis=0) * UP, np.zeros(n), limits)
    sides = certificate.pieces[0, 12 : 12 + equation.d]
    h = (boxes.high - boxes.low) / 2 * sides
    slopes = slopes / np.where(h > 0, h, np.inf)[:, None, :]
    linear, angular = (np.linalg.norm(part, axis=2).max(axis=0, initial=0.0) for part in np.split(slopes, [3], axis=2))
    bend = 1 + float(np.sum(np.square(sides[3:]))) / 4  # |dw| <= (1 + |w|^2 / 4) |turn| of the Cayley parameters
    return JointRates(linear * UP, angular * UP * bend * UP, limits)


def _steps(certificate: Certificate) -> Vector:
    """(k,) what the tool, of several the fastest, moves by, at least, per y over each cell of a path [m]."""
    family, numbers = certificate.equation.family, certificate.cells.numbers
    y, given = symbol("y", 1), symbol("numbers", family.numbers)
    moved = IntervalFunction("the tool's motion", {"y": y, "numbers": given}, jacobian(family.pose(y, given)[0], y))
    ones = np.ones((1, len(numbers)))
    low, high = moved(np.vstack([-ones, numbers.T]), np.vstack([ones, numbers.T]))
    least = np.maximum(np.maximum(low, -high), 0.0)
    return np.linalg.norm(least.reshape(-1, 3, len(numbers)), axis=1).max(axis=0) / UP
