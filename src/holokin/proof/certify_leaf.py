"""`certify`: the proof that the joints on a leaf are one function over a path, or over a box of tool poses.

Along a path the cells of its pieces follow each other and are glued at their ends: the root at the end of a cell must
lie where the next cell's is the only root; so the roots make one smooth curve of joints. Where pieces of a path meet,
and where a closed path ends, its poses agree but for round-off, which is enclosed and may be `SEAM` at most: there the
joints jump by as little as `Anchors` says.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, overload

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, BranchError, NoProofError, SingularityError, TrackingError
from ..base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, joined, some, whole
from ..motion.checks import Scene
from ..motion.ik.leaf import leaf_step, leaf_stepper, leaf_value, newton_on_leaf, with_leaves
from ..motion.ik.plan import Plan, check_start, make_plan, turned
from ..path.editing import AnyPath
from ..path.path import rotation_vector
from ..path.workspaces import PoseRange, Workspace
from ..robot import start_posture
from ..strategies import HolonomicStrategy, Strategy
from ..strategies.strategy import hardest_motion
from ..strategies.tasks.frame_task import completing, leaves_free
from ..symbolic.intervals import Interval
from .binding import lowered_equation
from .box_proof import PIECES, PoseRegion
from .cell_search import (
    AIM,
    NOWHERE,
    TUBE,
    Boxes,
    Covered,
    Demands,
    Domain,
    Extent,
    KeptCells,
    covered,
    halves,
    on_grid,
    one_root,
    overlapping,
)
from .certificate import START, Anchors, Certificate, Revisit
from .equation import Equation, Stretches, equation_of
from .kept_apart import kept_apart, least_room
from .region_growth import grown
from .signed_box import SignedBox, signed_box, signed_branch
from .tube import UP, Cells, centred, examined, least_determinant, norm
from .whole_arm import WholeArm, whole_arm

# --- The cells along a path.

SEAM = 1e-12
"""What E may change by [m, 1] where pieces of a path meet: a path of some metres in doubles is off by 1e-15."""

PARTS = 256
"""Parts of a piece for which the motion of the joints is computed."""


Ended = tuple[Extent, str, str]
"""Why postures along a path end, where, and what was said of that."""


def walked(strategy: HolonomicStrategy, plan: Plan, q0: Vector) -> tuple[Matrix, Ended]:
    """(postures (k, n) at the start and the samples, how they end) along a path, limits ignored.

    Raises:
        StartError: the tool at the start is not where the path begins.
        SingularityError, BranchError, TrackingError: not even a first step is possible.
    """
    strategy(q0)
    check_start(plan.task, q0, *plan.first)
    c, correct = leaf_value(strategy, q0), leaf_step(strategy)
    step_by_pieces: Callable[[Vector, int], Vector] | None = None
    side = float(correct(q0, *plan.first, c)[3])
    postures = [q0]
    for step in range(plan.steps):
        try:  # a posture on another branch would leave cells that do not join
            solution = newton_on_leaf(correct, postures[-1], *plan.target(step, 1.0), c, side)
            if solution is not None:
                postures.append(solution[0])
                continue
            step_by_pieces = step_by_pieces or leaf_stepper(strategy, plan, q0, PIECES)
            postures.append(step_by_pieces(postures[-1], step))
        except (SingularityError, BranchError, TrackingError) as problem:
            if not step:
                raise
            why = Extent.SINGULAR if isinstance(problem, SingularityError) else Extent.END
            return np.array(postures), (
                why,
                plan.where(step).removeprefix("in cycle 1, "),
                str(problem).rpartition("; ")[0],
            )
    return np.array(postures), (Extent.WHOLE, "", "")


@dataclass(frozen=True, eq=False)
class Pathway(Value, Domain):
    """Joints near the leaf c (r,) as a function of a path: splines through a trajectory, one a piece.

    `begun` (pieces, .) are the numbers of the family but for u0 and h; `ends` the share of each piece up to which it
    was followed; `spins` (pieces, 256) their free turns [rad], which move no joint, in parts.
    """

    equation: Equation
    c: Vector
    splines: tuple[Callable[[Array], Matrix], ...]
    begun: Matrix
    ends: Vector
    spins: Matrix
    slack: float = SEAM

    @staticmethod
    def of(strategy: HolonomicStrategy, plan: Plan, postures: Matrix) -> Pathway:
        """From postures (k, joints) at the samples of a plan, which may end early."""
        from scipy.interpolate import make_interp_spline

        splines, ends, first = [], [], 0
        for count in plan.counts.tolist():
            steps = min(count, len(postures) - 1 - first)
            if steps < 1:
                break
            shares = np.arange(steps + 1) / count
            splines.append(make_interp_spline(shares, postures[first : first + steps + 1], min(3, steps)))
            ends.append(float(on_grid(steps / count)))
            first += count
        rows = plan.path.table(plan.start_rotation).reshape(plan.task.frames, len(plan.counts), -1)
        family = Stretches.along(rows)
        equation = equation_of(strategy, family)
        numbers = np.array([family.of(rows[:, i]) for i in range(len(splines))]).reshape(len(splines), -1)
        spins = _free_turns(plan, ends)
        return Pathway(equation, np.atleast_1d(strategy.g(postures[0])), tuple(splines), numbers, np.array(ends), spins)

    def first(self) -> Boxes:
        """Cells in which e is about `AIM`, from omega at sampled postures."""
        # omega at nine places of each piece.
        piece = np.repeat(np.arange(len(self.splines)), 9)
        u = np.tile(np.linspace(0, 1, 9), len(self.splines)) * np.repeat(self.ends, 9)
        q, n = self._at(piece, u), self.equation.n
        still = np.zeros((len(q), n, 1))
        numbers = np.hstack([self.given(piece), u[:, None], np.zeros((len(u), 1))])
        cells = Cells(q, still, still, numbers, np.full(len(q), 1e-9))
        omega = np.minimum(examined(self.equation, cells, self.c).omega, 1e6)
        pieces = []
        for i, end in enumerate(self.ends.tolist()):
            # How much e grows along the piece: by omega times the motion of the joints; or the free turn, since the
            # equation turns with it, though no joint may move: a cell has at most 0.05 rad of it.
            places = np.linspace(0, end, PARTS + 1)
            motion = np.linalg.norm(np.diff(self._at(np.full(len(places), i), places), axis=0), axis=1)
            omega_there = np.interp(places, u[piece == i], omega[piece == i])
            growth = np.maximum(motion * (omega_there[1:] + omega_there[:-1]) / 2, 2 * AIM / 0.05 * self.spins[i])
            total = np.concatenate([[0.0], np.cumsum(growth)])
            # Cuts at even shares of that, not the millions that omega asks for near a singular posture.
            count = int(np.clip(np.ceil(total[-1] / (2 * AIM)), 1, 4096))
            edges = np.unique(on_grid(np.interp(np.linspace(0, total[-1], count + 1), total, places)))
            count = len(edges) - 1
            rho = TUBE / np.interp((edges[1:] + edges[:-1]) / 2, places, omega_there)
            unknown, new = np.full((count, n), np.nan), np.zeros(count, dtype=bool)
            pieces.append(Boxes(np.full(count, i), edges[:-1, None], edges[1:, None], rho, new, unknown))
        return joined(*pieces)

    def given(self, piece: Indices) -> Matrix:
        """Of the family `Stretches`."""
        return self.begun[piece]

    def joints(self, boxes: Boxes) -> Matrix:
        """By the splines, and the other unknowns there."""
        return self._at(boxes.piece, (boxes.low + boxes.high)[:, 0] / 2)

    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """Those behind the first place where the proof failed."""
        piece, (low, *_) = min(stopped)
        return (boxes.piece > piece) | ((boxes.piece == piece) & (boxes.low[:, 0] >= low))

    def goes_on(self, extent: Extent) -> bool:
        """Whatever ended the others, but the budget."""
        return extent is not Extent.BUDGET

    def arranged(self, proven: Covered) -> Covered:
        """In the order of the path, up to where the proof failed."""
        boxes = proven.boxes
        order = np.lexsort((boxes.low[:, 0], boxes.piece))
        if proven.stopped is not None:
            order = order[~self.beyond(boxes, [proven.stopped])[order]]
        return proven.only(order)

    def unglued(self, proven: Covered) -> Flags:
        """Those whose root at the end is not shown to be the next one's only root at its beginning, and the next."""
        k, cells = len(proven), proven.cells
        unglued = np.zeros(k, dtype=bool)
        if k > 1:
            # The root at the end of each cell lies where the next one's is alone.
            one = np.ones((k, 1))
            gap = np.linalg.norm(cells.predicted(one)[:-1] - cells.predicted(-one)[1:], axis=1)
            off = (gap + proven.findings.r[:-1] + cells.slip[:-1] + cells.slip[1:]) * UP
            unglued[:-1] = ~(off <= proven.findings.alone[1:] / UP)
            # Where pieces meet, E changes by no more than the cells allow for.
            for i in np.flatnonzero(np.diff(proven.boxes.piece)):
                numbers = np.concatenate(cells.numbers[i : i + 2])[:, None]
                jump = Interval(*(side[None] for side in self.equation.seam(numbers, numbers)))
                unglued[i] |= not norm(jump)[0] <= self.slack
            unglued[1:] |= unglued[:-1]
        return unglued

    def connected(self, proven: Covered) -> Covered:
        """Up to the first place where the next cell is not glued."""
        apart = self.unglued(proven)
        if not apart.any():
            return proven
        k = int(np.argmax(apart)) + 1
        return replace(proven.only(slice(0, k)), extent=Extent.APART, stopped=proven.boxes.places()[k])

    def place(self, proven: Covered) -> str:
        """Piece and share."""
        if proven.stopped is None:
            return ""
        piece, (low, *_) = proven.stopped
        return f"{100 * low:.4g} % of piece {piece + 1} of the path"

    def _at(self, piece: Indices, u: Vector) -> Matrix:
        n = self.equation.joints
        q = np.array([self.splines[i](share) for i, share in zip(piece, u, strict=True)]).reshape(len(piece), n)
        return self.equation.completed(q)


def _free_turns(plan: Plan, ends: list[float]) -> Matrix:
    """How far the frames turn freely in the parts of each piece up to its end (pieces, `PARTS`) [rad]."""
    spins, task = np.zeros((len(ends), PARTS)), plan.task
    turning = sorted({row // 6 for row, angular in zip(task.rows, task._angular, strict=True) if angular})
    if not leaves_free(task) or not turning:
        return spins
    for i, end in enumerate(ends):
        samples = plan.path.on(np.full(PARTS + 1, i), np.linspace(0, end, PARTS + 1))
        p, R = samples.position, turned(samples.rotation, plan.start_rotation)
        seen = completing(task).batch(p[:-1], R[:-1], p[1:], R[1:])[1].reshape(-1, 3, 3)
        free = rotation_vector(R[1:].reshape(-1, 3, 3) @ np.swapaxes(seen, 1, 2)).reshape(PARTS, -1, 3)
        spins[i] = np.linalg.norm(free[:, turning], axis=(1, 2))
    return spins


# --- Postures that the roots of a proof are shown to be near to: the start, and where pieces of a path meet.

NEAR = 1e-6
"""Of the places of a box where its start may be, the first one is taken whose posture is as near to the root."""


def _anchored(domain: Domain, proven: Covered, q0: Vector, closed: bool) -> Anchors:
    """Of some cells, joined to each other, in the order of a path. `closed`: its end is to be its beginning."""
    d, start, on_path = domain.equation.d, domain.equation.completed(q0[None])[0], isinstance(domain, Pathway)
    if not len(proven):
        return Anchors(np.zeros((1, d)), start[None], np.inf, np.inf, None, on_path)
    # The start. Over a box it is at its pose, where the leaf was continued to, or in the first cell.
    places, first = [(np.zeros(1), start)] if d == 1 else [], q0
    if isinstance(domain, PoseRegion):
        u0 = domain.place_of(q0)
        first = q0 if (np.abs(u0) <= 1).all() else domain.q
        places = [(u0, start), (domain.u0, domain.equation.completed(domain.q[None])[0])]
        places.append(((proven.boxes.low[0] + proven.boxes.high[0]) / 2, proven.cells.q0[0]))
    u, q, within = np.zeros(d), start, np.inf
    for u, q in places:
        within = _distance_at(domain, proven, _cell_at(proven, 0, u), u, q)
        if within < NEAR:
            break
    begun = on_path or (within < NEAR and np.array_equal(q[: len(q0)], first[: len(q0)]))
    if not on_path:
        return Anchors(u[None], q[None], within, 0.0, None, begun)
    # Where pieces meet: the root at the beginning of each, from which that at the end of the one before is near.
    pieces, end, begin = int(proven.boxes.piece.max()) + 1, np.ones(1), np.zeros(1)
    postures, gap, turns = [q], 0.0, None
    for piece in range(1, pieces):
        before, after = _cell_at(proven, piece - 1, end), _cell_at(proven, piece, begin)
        root = _root_at(domain, proven, after, begin)
        apart = _distance_at(domain, proven, before, end, root) + _distance_at(domain, proven, after, begin, root)
        postures.append(root)
        gap = max(gap, apart)
    # The end of a closed path, and the whole turns of the joints there.
    if closed:
        before, after = _cell_at(proven, pieces - 1, end), _cell_at(proven, 0, begin)
        b, a = _root_at(domain, proven, after, begin), _root_at(domain, proven, before, end)
        whole_turns = np.where(domain.equation.revolute, np.rint((a - b) / (2 * np.pi)), 0.0) + 0.0  # no -0
        angles = 2 * np.pi * whole_turns
        apart = _distance_at(domain, proven, after, begin, b) + _distance_at(domain, proven, before, end, b + angles)
        apart += 1e-15 * float(np.linalg.norm(np.abs(angles) + np.abs(b)))
        if np.isfinite(apart) and domain.equation.periodic(tuple(whole_turns.tolist())):
            gap, turns = max(gap, apart), whole_turns
    return Anchors(np.zeros((pieces, 1)), np.array(postures), within, gap, turns, begun)


def _cell_at(proven: Covered, piece: int, u: Vector) -> int | None:
    """A cell that holds u."""
    b = proven.boxes
    holding = np.flatnonzero((b.piece == piece) & (b.low <= u).all(axis=1) & (u <= b.high).all(axis=1))
    return int(holding[0]) if len(holding) else None


def _cell_of_one_pose(domain: Domain, proven: Covered, i: int, u: Vector, q: Vector) -> Cells:
    """The cell of the one pose at u, predicted to be at q; i is the cell that holds it."""
    n, d = domain.equation.n, domain.equation.d
    numbers = np.concatenate([domain.given(proven.boxes.piece[i : i + 1])[0], u, np.zeros(d)])
    Q = np.zeros((1, n, d * (d + 1) // 2))
    return Cells(q[None], np.zeros((1, n, d)), Q, numbers[None], proven.cells.rho[i : i + 1] / 4)


def _predicted_at(proven: Covered, i: int, u: Vector) -> Vector:
    cell = slice(i, i + 1)
    return some(proven.boxes, cell).predicted(some(proven.cells, cell), u[None])[0]


def _root_at(domain: Domain, proven: Covered, i: int | None, u: Vector) -> Vector:
    """The root at u of a cell, by Newton's method."""
    if i is None:
        return np.full(domain.equation.n, np.nan)
    guess = _cell_of_one_pose(domain, proven, i, u, _predicted_at(proven, i, u))
    return centred(domain.equation, guess.q0, guess.numbers, domain.c, guess.rho, newtons=3).q0[0]


def _distance_at(domain: Domain, proven: Covered, i: int | None, u: Vector, q: Vector) -> float:
    """A bound of the distance of the root of a cell at u from q; infinite where that is not shown.

    The cell of the one pose at u has a root within r of q; if it lies where the other cell's is alone, it is that one.
    """
    if i is None or not np.isfinite(q).all():
        return np.inf
    r = examined(domain.equation, _cell_of_one_pose(domain, proven, i, u, q), domain.c).r[0]
    off = float(np.linalg.norm(q - _predicted_at(proven, i, u)) + r + proven.cells.slip[i])
    if not off < 0.5 * proven.findings.alone[i]:
        return np.inf
    # What is not round-off four times: for the checker, whose bounds are those of a whole cell.
    return float(r + 4 * np.linalg.norm(q - _root_at(domain, proven, i, u)))


# --- Where a path passes a tool pose twice: the joints are shown to be the same there, or to be others.
#
# All pairs of parts of cells are compared, those of one cell with each other, too. A pair is done where the boxes of
# its tool poses are apart, or where the roots of one part, but for whole turns, lie where the other's are the only
# ones: at a common pose they are one root. Else both parts are halved, until their tool poses are the same to `SAME`:
# there the boxes of the joints are disjoint, or nothing is known.

SAME = 1e-9
"""Tool poses that are as near [m, 1] count as one: as the ends of a closed path do."""

FINE = 2.0**-46
"""Parts [share of a piece] that are not halved any more: a metre is then 1e-14 m long."""

MOST_PAIRS = 30_000
"""Pairs that are compared at a time, at most."""

FEW = 24
"""Of too many pairs so many are looked at to the end."""

ONCE = 4
"""Halvings of a cell down to which tool poses are enclosed all at once: most pairs are done before that."""


@dataclass(frozen=True, eq=False)
class Parts(Value):
    """Parts low <= u <= high (k,) [share of a piece] of cells (k,)."""

    cell: Indices
    low: Vector
    high: Vector

    def __len__(self) -> int:
        return len(self.cell)

    def half(self, upper: bool) -> Parts:
        """One half of each."""
        middle = (self.low + self.high) / 2
        return Parts(self.cell, middle if upper else self.low, self.high if upper else middle)


@dataclass(frozen=True, eq=False)
class Revisits(Value):
    """The comparison of the cells that cover a path with each other."""

    domain: Pathway
    proven: Covered

    def end(self) -> tuple[Extent, Revisit | None]:
        """Why a closed path whose return is not shown is not proven: its joints end elsewhere, if that is shown."""
        zero, last = np.zeros(1), len(self.proven) - 1
        moved = self._moved(Parts(np.array([0]), zero, zero), Parts(np.array([last]), zero + 1, zero + 1))
        return (Extent.RETURN, None) if moved is None else (Extent.ELSEWHERE, moved)

    def anywhere(self) -> tuple[Extent, Revisit | None]:
        """WHOLE where the same tool pose has the same joints all along the path, but for whole turns; else why not."""
        boxes, cells = self.proven.boxes, np.arange(len(self.proven))
        parts = Parts(cells, boxes.low[:, 0], boxes.high[:, 0])
        ones, others = overlapping(*self._levels[0], cells, cells)
        return self._compared(some(parts, ones[ones <= others]), some(parts, others[ones <= others]), MOST_PAIRS, 0)

    def _compared(self, a: Parts, b: Parts, most_pairs: int, level: int) -> tuple[Extent, Revisit | None]:
        """The same of pairs of parts, of so many at a time; where there are more, some of them are dropped.

        The parts are cells halved `level` times.
        """
        lost, many, tries = False, 16 * len(self.proven), FEW
        while True:
            # Leave out pairs that have one root: this is cheaper than the tool poses, and most pairs are neighbours.
            left = ~self._one_root(a, b)
            a, b = some(a, left), some(b, left)
            if not len(a):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            # Leave out those whose tool poses are apart.
            below, above = self._poses_at(joined(a, b), level)
            (low_a, low_b), (high_a, high_b) = np.split(below, 2), np.split(above, 2)
            left = np.all((low_a <= high_b) & (low_b <= high_a), axis=1)
            widths = np.maximum(high_a - low_b, high_b - low_a)[left]
            a, b = some(a, left), some(b, left)
            # Where the tool poses are the same, the joints differ if predictors are farther apart than roots from them.
            same = np.flatnonzero((widths <= SAME).all(axis=1))  # most often none
            if len(same):
                r, gaps = self.proven.findings.r, self._apart(some(a, same), some(b, same))[0]
                same = same[np.linalg.norm(gaps, axis=1) > r[a.cell[same]] + r[b.cell[same]]]
            for i in same[:tries].tolist():
                tries -= 1
                moved = self._moved(some(a, slice(i, i + 1)), some(b, slice(i, i + 1)))
                if moved is not None:
                    return Extent.ELSEWHERE, moved
            # Of very many pairs a few are looked into first: the path may run along itself with other joints.
            if len(a) > many and most_pairs > FEW:
                extent, moved = self._compared(a, b, FEW, level)
                if moved is not None:
                    return extent, moved
                many = MOST_PAIRS
            wide = np.flatnonzero(np.maximum(a.high - a.low, b.high - b.low) > FINE)
            lost |= len(wide) < len(a) or len(a) > most_pairs
            if not len(wide):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            if lost:
                wide = wide[np.unique(np.linspace(0, len(wide) - 1, FEW).astype(int))]
            # Halve the others; of a part with itself one pair of unlike halves is enough.
            a, b, level = some(a, wide), some(b, wide), level + 1
            unlike = (a.cell != b.cell) | (a.low != b.low)
            pairs = [(a.half(i), b.half(i)) for i in (False, True)]
            pairs += [(a.half(False), b.half(True)), (some(a, unlike).half(True), some(b, unlike).half(False))]
            a, b = (joined(*(pair[side] for pair in pairs)) for side in (0, 1))

    @cached_property
    def _levels(self) -> list[tuple[Matrix, Matrix]]:
        """Enclosures (cells 2^level, .) of the tool poses of all cells, halved `level` times: hulls of the finest."""
        boxes = self.proven.boxes
        parts = Parts(np.arange(len(self.proven)), boxes.low[:, 0], boxes.high[:, 0])
        for _ in range(ONCE):
            order = np.arange(2 * len(parts)).reshape(2, -1).T.ravel()  # halves of a part follow each other
            parts = some(joined(parts.half(False), parts.half(True)), order)
        levels = [self._poses(parts)]
        for _ in range(ONCE):
            low, high = levels[0]
            levels.insert(0, (np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])))
        return levels

    def _poses_at(self, parts: Parts, level: int) -> tuple[Matrix, Matrix]:
        """`_poses` of cells halved `level` times."""
        if level > ONCE:
            return self._poses(parts)
        low, high = self.proven.boxes.low[parts.cell, 0], self.proven.boxes.high[parts.cell, 0]
        share = ((parts.low + parts.high) / 2 - low) / (high - low)  # a middle: far from a part's ends
        rows = parts.cell * 2**level + np.floor(share * 2**level).astype(int)
        (below, above), (whole_below, whole_above) = self._levels[level], self._levels[0]
        tiny = high - low <= FINE  # halves are rounded there: all of the cell holds them
        rows[tiny] = 0
        below, above = below[rows], above[rows]
        below[tiny], above[tiny] = whole_below[parts.cell[tiny]], whole_above[parts.cell[tiny]]
        return below, above

    def _poses(self, parts: Parts) -> tuple[Matrix, Matrix]:
        """Enclosures (k, .) of the tool poses, wider by what counts as the same."""
        ends = np.column_stack([(parts.low + parts.high) / 2, (parts.high - parts.low) / 2])
        fixed = np.vstack([self.domain.given(self.proven.boxes.piece[parts.cell]).T, ends.T])
        one = np.ones((1, len(parts)))
        poses = self.domain.equation.reached(np.vstack([-one, fixed]), np.vstack([one, fixed]))
        return poses.low.T - SAME / 8, poses.high.T + SAME / 8

    def _joints(self, parts: Parts) -> tuple[Matrix, Matrix, Vector]:
        """Predicted unknowns (k, n) in the middles, how far each goes from there at most, the rounding of both (k,)."""
        boxes, cells = self.proven.boxes, some(self.proven.cells, parts.cell)
        low, high = boxes.low[parts.cell, 0], boxes.high[parts.cell, 0]
        y = (parts.low + parts.high - low - high) / (high - low)
        share = (parts.high - parts.low) / (high - low)
        reach = (np.abs(cells.V[:, :, 0]) + np.abs(cells.Q[:, :, 0])) * share[:, None]
        return cells.predicted(y[:, None]), reach * UP, cells.slip

    def _turns(self, apart: Matrix) -> Matrix:
        """The whole turns (k, n) in differences of unknowns, where E stays as it is by them."""
        turns = np.rint(apart / (2 * np.pi))
        if turns.any():
            turns = np.where(self.domain.equation.revolute, turns, 0.0)
        for row in np.unique(turns[turns.any(axis=1)], axis=0):
            if not self.domain.equation.periodic(tuple(row.tolist())):
                turns[(turns == row).all(axis=1)] = 0.0
        return turns

    def _apart(self, a: Parts, b: Parts) -> tuple[Matrix, Matrix]:
        """By how much the predictors of b are from those of a less whole turns (k, n), and the error of this."""
        (q_a, reach_a, slip_a), (q_b, reach_b, slip_b) = self._joints(a), self._joints(b)
        turns = self._turns(q_b - q_a)
        error = reach_a + reach_b + (slip_a + slip_b + 1e-14 * np.linalg.norm(turns, axis=1))[:, None]
        return q_b - q_a - 2 * np.pi * turns, error

    def _one_root(self, a: Parts, b: Parts) -> Flags:
        """(k,) True where at each common pose both parts have one root."""
        if not len(a):
            return np.zeros(0, dtype=bool)
        apart, error = self._apart(a, b)
        off = (np.linalg.norm(apart, axis=1) + np.linalg.norm(error, axis=1)) * UP
        r, alone = self.proven.findings.r * UP, self.proven.findings.alone
        return one_root(off, r[a.cell], alone[a.cell], r[b.cell], alone[b.cell])

    def _moved(self, a: Parts, b: Parts) -> Revisit | None:
        """How the joints differ in the middles of two parts; None where they are not shown to."""
        places, roots, error, n = [], [], 0.0, self.domain.equation.joints
        for part in (a, b):
            cell, u = int(part.cell[0]), (part.low + part.high) / 2
            roots.append(_root_at(self.domain, self.proven, cell, u))
            error += _distance_at(self.domain, self.proven, cell, u, roots[-1])
            places.append((int(self.proven.boxes.piece[cell]), float(u[0])))
        if not np.isfinite(error):
            return None
        apart = roots[1] - roots[0]
        turns = self._turns(apart[None])[0]
        error = (error + 1e-15 * float(np.linalg.norm(np.abs(roots).sum(axis=0)))) * UP
        if not (np.abs(apart - 2 * np.pi * turns) > error)[:n].any():
            return None
        return Revisit(places[0], places[1], (apart - error)[:n], (apart + error)[:n])


# --- The proof.

NO_LEAVES = "it has no leaves: the joints may drift while the tool repeats its path"
"""Why nothing is proven of a strategy that is not holonomic."""


@overload
def certify(strategy: Strategy) -> WholeArm: ...


@overload
def certify(
    strategy: Strategy,
    where: AnyPath | Workspace,
    q0: ArrayLike,
    *,
    limits: bool = True,
    scene: Scene | None = None,
    budget: int = 20_000,
    keep_in: str | FilePath | None = None,
    progress: Callable[[str], None] = ...,
) -> Certificate | SignedBox: ...


@typed
def certify(
    strategy: Strategy,
    where: AnyPath | Workspace | None = None,
    q0: ArrayLike | None = None,
    *,
    limits: bool = True,
    scene: Scene | None = None,
    budget: int = 20_000,
    keep_in: str | FilePath | None = None,
    progress: Callable[[str], None] = lambda _text: None,
) -> Certificate | SignedBox | WholeArm:
    """Prove that on the leaf through q0 the joints are one function of the tool pose in a box, or the place on a path.

    With neither place nor start the proof is about the whole arm, every start and every level, see `WholeArm`.

    It is smooth, on a path between corners. Of a path it is shown, besides, that the joints return with the tool: where
    the path closes, and where it crosses or follows itself. If not, `extent` is ELSEWHERE, with the drift in `revisit`,
    or RETURN; `covered` is True.

    Of a box of a strategy whose held joints leave a closed inverse (`whole_arm` names the classes) it is proven by the
    signs of three slopes, which with the pose tell the posture, see `SignedBox`: it is about one posture with the signs
    of the start's. With a scene, or `keep_in`, the proof is that of any other strategy:

    E(q, x) = [f(q) - x; g(q) - c] = 0 has, for every pose x, exactly one root in a tube about predicted joints,
    [J; J_g] is regular there, and no joint leaves its limits: by the theorem of Newton and Kantorovich on cells that
    cover all poses, in interval arithmetic whose bounds hold all rounding. The theorem is about the model: the robot's
    constants as doubles. Of a constraint with auxiliary unknowns, as `stationary`, q holds these, too.

    Args:
        where: a path, which begins at the tool's pose at q0; or a workspace that is a box (`workspace(box=...)`), with
            its tilt and spin: of turns a box is covered that holds them. What the task leaves free of the box, as a
            spin, is taken from q0.
        limits: prove, too, that the joints stay within their limits.
        scene: prove, too, that the links keep their clearance from what is in it, and from each other. The pairs are
            those of `check`. Of meshes it is said of their convex hulls, and of a robot without shapes of
            `with_capsules`.
        budget: cells that may be examined; of poses alone, by the signs, ten times as many.
        keep_in: a file that keeps the cells as they are examined. Where it is there already, of the same question, the
            proof goes on with them, and ends with the same certificate; with another `budget`, as far as they serve.
        progress: hears how far it is.

    Returns:
        A certificate; where something could not be proven its `extent` says why, `where` the place, and what it holds
        was proven up to there.

    Raises:
        NoProofError: a strategy without leaves, or whose leaves a differential equation carries; on the whole arm, one
            that holds no single joints, or leaves an arm of no class, with the distance. ArgumentError: no box;
            shapes of which no proof can be; `keep_in` is of another question. WriteError: it cannot be written.
        ExpressionError: an operation without a rule for intervals. StartError, JointLimitError; of a leaf on which not
        even a first step is possible SingularityError, BranchError.
    """
    if where is None and q0 is None:
        return whole_arm(provable(strategy))
    if where is None or q0 is None:
        given, missing = ("q0", "where") if where is None else ("where", "q0")
        raise ArgumentError(missing, None, f"give it beside {given}, or neither: then the proof is about the whole arm")
    strategy, start = provable(strategy), start_posture(strategy.task.robot, q0, limits)
    budget = whole("budget", budget)
    if isinstance(where, PoseRange) and scene is None and keep_in is None:
        branch = signed_branch(strategy, start, limits)
        if branch is not None:
            return signed_box(
                strategy, where, start, branch, demands(strategy, start, limits, None).limits, budget, progress
            )
    return certify_cells(strategy, where, start, limits, scene, budget, keep_in, progress)


def certify_cells(
    strategy: Strategy, where: AnyPath | Workspace, q0: ArrayLike, limits: bool = True, scene: Scene | None = None,
    budget: int = 20_000, keep_in: str | FilePath | None = None, progress: Callable[[str], None] = lambda _text: None,
) -> Certificate:  # fmt: skip
    """The same by cells of joints, whatever the strategy: its certificate can be saved, and verified."""
    began, ended = time.perf_counter(), (Extent.WHOLE, "", "")
    strategy, start = provable(strategy), start_posture(strategy.task.robot, q0, limits)
    if isinstance(where, Workspace):
        domain: Domain = PoseRegion.of(strategy, where, start)
    else:
        rotations = strategy.task.pose(start).reshape(-1, 4, 4)[:, :3, :3]
        plan = make_plan(strategy.task, where, 256, rotations.reshape(-1, 3))
        postures, ended = walked(strategy, plan, start)
        domain = Pathway.of(strategy, plan, postures)
    asked = demands(strategy, start, limits, scene)
    with KeptCells.opened(keep_in, lambda: question(domain, start, asked)) as kept_cells:
        return certificate(where, domain, start, asked, budget, progress, began, ended, kept_cells)


def provable(strategy: Strategy) -> HolonomicStrategy:
    """The strategy, of whose leaves something can be proven. Raises: NoProofError."""
    if strategy.task.n == strategy.task.m:
        strategy = with_leaves(strategy)
    if not isinstance(strategy, HolonomicStrategy):
        raise NoProofError(strategy.name, f"{NO_LEAVES}; {HolonomicStrategy.cure}")
    if strategy.constraint.looped is not None:
        cure = (
            "its joints come out of a computation along the path, of which no proof is made: certify the polynomial "
            "that hk.strategies.fitted(strategy, Q) makes of it"
        )
        raise NoProofError(strategy.name, cure)
    return strategy


def demands(strategy: HolonomicStrategy, q0: Vector, limits: bool, scene: Scene | None) -> Demands:
    """What is asked of the joints, and of shapes. Raises: as `kept_apart`."""
    robot = strategy.task.robot
    clear = None if scene is None else kept_apart(strategy, q0, scene)
    return Demands(Interval(robot.lower, robot.upper) if limits else None, clear)


def question(domain: Domain, start: Vector, asked: Demands) -> dict[str, Any]:
    """All that decides what is proven, but for the budget: the equation, the start, the poses, limits and shapes."""
    equation, first = domain.equation, domain.first()
    given = domain.given(np.unique(first.piece))
    arrays = (start, domain.c, given, first.low, first.high, first.rho, *(asked.limits or ()))
    return {
        "equation": lowered_equation(equation),
        "hashes": [hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest() for a in arrays],
        "clear": None if asked.clear is None else asked.clear.described(),
        "partial": domain.partial,
        "slack": domain.slack,
    }


def certificate(
    where: AnyPath | Workspace, domain: Domain, start: Vector, asked: Demands, budget: int,
    progress: Callable[[str], None], began: float, ended: Ended = (Extent.WHOLE, "", ""),
    kept_cells: KeptCells = NOWHERE,
) -> Certificate:  # fmt: skip
    """What can be proven over a domain. ended: how the postures of a path ended early."""
    robot = domain.equation.strategy.task.robot
    # The cells, and how far apart the shapes are at least over them.
    proven = _glued(domain, asked, budget, progress, kept_cells)
    if asked.clear is not None:
        progress(f"{len(proven):,} cells proven, the least distances")
        proven = replace(proven, findings=asked.clear.sharpened(proven.cells, proven.findings))
    # How far the proof came, and whether the joints return with the tool.
    extent, place, reason = proven.extent, domain.place(proven), _reason(domain.equation.strategy, proven)
    if extent is Extent.WHOLE and ended[0] is not Extent.WHOLE:
        extent, place, reason = ended
    closed = extent is Extent.WHOLE and not isinstance(where, Workspace) and where.closed
    anchors, revisit = _anchored(domain, proven, start, closed), None
    if extent is Extent.WHOLE and not anchors.begun:
        extent, place = Extent.APART, START
    if extent is Extent.WHOLE and isinstance(domain, Pathway):
        revisits = Revisits(domain, proven)
        extent, revisit = revisits.end() if closed and anchors.turns is None else revisits.anywhere()
    near = None
    if asked.clear is not None and extent is Extent.NEAR and proven.posture is not None:
        near = least_room(asked.clear, domain.equation.strategy.task, proven.posture[: robot.n])
    # What the cells say of the joints.
    boxes, findings = proven.boxes, proven.findings
    low, high = (findings.low.min(axis=0), findings.high.max(axis=0)) if len(proven) else (start, start)
    turns, gap = (np.zeros(robot.n), np.inf) if anchors.turns is None else (anchors.turns[: robot.n], anchors.gap)
    count = 1 if isinstance(where, Workspace) else len(where.durations)
    return Certificate(
        extent=extent,
        where=place,
        proven=proven,
        share=float(domain.shares(boxes.low, boxes.high).sum()) / count,
        low=low,
        high=high,
        determinant=least_determinant(findings),
        to_limit=np.minimum(low - robot.lower, robot.upper - high),
        turns=turns,
        gap=gap,
        seconds=time.perf_counter() - began,
        equation=domain.equation,
        c=domain.c,
        anchors=anchors,
        demands=asked,
        pieces=domain.given(np.arange(int(boxes.piece.max(initial=0)) + 1)),
        revisit=revisit,
        near=near,
        reason=reason,
        asked=where,
    )


def _reason(strategy: HolonomicStrategy, proven: Covered) -> str:
    """Which joint ends a proof at its limit, or which motion of the tool is hard there; "" where that is not known."""
    robot, q = strategy.task.robot, proven.posture
    if q is None or not np.isfinite(q).all():
        return ""
    q = q[: robot.n]
    if proven.extent is Extent.LIMIT:
        i = int(np.argmin(np.minimum(q - robot.lower, robot.upper - q)))
        return f"{robot.joint_names[i]} is at its limit or beyond it"
    return hardest_motion(strategy, q) if proven.extent is Extent.SINGULAR else ""


def _glued(
    domain: Domain, asked: Demands, budget: int, progress: Callable[[str], None], kept_cells: KeptCells
) -> Covered:
    """Cells over all of a domain, halved until neighbours share roots; or those that hang together."""
    before = ""

    def report(count: int, spent: int, share: float) -> None:
        again = f", {kept_cells.resumed:,} of them before" if kept_cells.resumed else ""
        progress(f"{before}{share:.0%} proven by {count:,} cells, {spent:,} of at most {budget:,} examined{again}")

    if isinstance(domain, PoseRegion) and domain.partial:
        return grown(domain, asked, budget, report, kept_cells)
    proven = domain.arranged(covered(domain, domain.first(), asked, budget, report, kept_cells))
    for i in range(12):
        # Find the cells that are not glued to their neighbours.
        progress(f"{len(proven):,} cells proven, joining them")
        apart = domain.unglued(proven)
        if not (domain.goes_on(proven.extent) and apart.any()):
            break
        # Prove their halves in their place.
        before = f"round {i + 2}, of the {int(apart.sum()):,} cells that are not joined yet: "
        parts = halves(proven.boxes, proven.cells, proven.cells.rho / 2, apart, np.isfinite(proven.findings.eta))
        parts = covered(domain, parts, asked, budget, report, kept_cells)
        proven = domain.arranged(_both(proven.only(~apart), parts))
    return domain.connected(proven)


def _both(one: Covered, other: Covered) -> Covered:
    """The cells of both, ended where the first of them is."""
    ended = [part for part in (one, other) if part.stopped is not None]
    first = min(ended, key=lambda part: part.stopped or (0, ()), default=one)
    rows = {name: joined(getattr(one, name), getattr(other, name)) for name in ("boxes", "cells", "findings")}
    return replace(first, **rows)
