"""`certify`: the proof that the joints on a leaf are one function over a path, or over a box of tool poses."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import NoProofError
from ..base.types import ArrayLike, Flags, Indices, Matrix, Value, Vector, joined, some, whole
from ..base.units import at_least, share_text
from ..motion.checks import Scene
from ..path.editing import AnyPath
from ..path.workspaces import Workspace
from ..robot import start_posture
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic.intervals import Interval
from .binding import lowered
from .box_proof import PoseRegion, walked
from .cell_search import NOWHERE, Domain, KeptCells, covered, halves
from .certificate import (
    COVERED,
    Anchors,
    Certificate,
    Covered,
    Demands,
    Extent,
    Revisit,
    least_determinant,
    overlapping,
)
from .clear_cells import ClearCells
from .equation import Equation
from .kept_apart import kept_apart
from .path_proof import Pathway
from .region_growth import grown
from .tube import UP, Cells, centred, examined

# --- Postures that the roots of a proof are shown to be near to: the start, and where pieces of a path meet.

NEAR = 1e-6
"""Of the places of a box where its start may be, the first one is taken whose posture is as near to the root."""

ROOM = 4.0
"""Of a distance that is not round-off: for the checker, whose bounds are those of a whole cell."""

NEWTONS = 3
"""Steps to a root from its predictor."""


def _anchored(domain: Domain, found: Covered, q0: Vector, closed: bool) -> Anchors:
    """Of some cells, joined to each other, in the order of a path. `closed`: its end is to be its beginning."""
    d, posture = domain.equation.d, q0
    q0 = domain.equation.completed(posture[None])[0]
    if not len(found):
        return Anchors(np.zeros((1, d)), q0[None], np.inf, np.inf, None)
    places = [(np.zeros(1), q0)] if d == 1 else []
    if isinstance(domain, PoseRegion):
        middle = domain.equation.completed(domain.q[None])[0]
        places = [(domain.place_of(posture), q0), (domain.u0, middle)]
        places.append(((found.boxes.low[0] + found.boxes.high[0]) / 2, found.cells.q0[0]))
    u, q, within = np.zeros(d), q0, np.inf
    for u, q in places:
        within = distance_at(domain, found, _holding(found, 0, u), u, q)
        if within < NEAR:
            break
    if not isinstance(domain, Pathway):
        return Anchors(u[None], q[None], within, 0.0, None)
    pieces, end, begin = int(found.boxes.piece.max()) + 1, np.ones(1), np.zeros(1)
    postures, gap, turns = [q], 0.0, None
    for piece in range(1, pieces):
        one, other = _holding(found, piece - 1, end), _holding(found, piece, begin)
        postures.append(_root_at(domain, found, other, begin))
        gap = max(gap, sum(distance_at(domain, found, i, at, postures[-1]) for i, at in ((one, end), (other, begin))))
    if closed:
        first, last = _holding(found, 0, begin), _holding(found, pieces - 1, end)
        b, a = _root_at(domain, found, first, begin), _root_at(domain, found, last, end)
        whole = np.where(domain.equation.revolute, np.rint((a - b) / (2 * np.pi)), 0.0) + 0.0  # no -0
        size = 2 * np.pi * whole
        apart = distance_at(domain, found, first, begin, b) + distance_at(domain, found, last, end, b + size)
        apart += 1e-15 * float(np.linalg.norm(np.abs(size) + np.abs(b)))
        if np.isfinite(apart) and domain.equation.periodic(whole):
            gap, turns = max(gap, apart), whole
    return Anchors(np.zeros((pieces, 1)), np.array(postures), within, gap, turns)


def at_start(domain: Domain, anchors: Anchors, q0: Vector) -> bool:
    """Whether the roots are q0's: over a box at its pose, if the box holds that, else where it leads to the middle."""
    if not isinstance(domain, PoseRegion):
        return True
    inside = bool((np.abs(domain.place_of(q0)) <= 1).all())
    first = q0 if inside else domain.q
    return anchors.within < NEAR and np.array_equal(anchors.q[0, : len(q0)], first[: len(q0)])


def _holding(found: Covered, piece: int, u: Vector) -> int | None:
    """A cell that holds u."""
    b = found.boxes
    holding = np.flatnonzero((b.piece == piece) & (b.low <= u).all(axis=1) & (u <= b.high).all(axis=1))
    return int(holding[0]) if len(holding) else None


def _still(domain: Domain, found: Covered, i: int, u: Vector, q: Vector) -> Cells:
    """A cell of the one pose at u."""
    n, d = domain.equation.n, domain.equation.d
    numbers = np.concatenate([domain.given(found.boxes.piece[i : i + 1])[0], u, np.zeros(d)])
    Q = np.zeros((1, n, d * (d + 1) // 2))
    return Cells(q[None], np.zeros((1, n, d)), Q, numbers[None], found.cells.rho[i : i + 1] / 4)


def _local(found: Covered, i: int, u: Vector) -> Vector:
    low, high = found.boxes.low[i], found.boxes.high[i]
    predicted = some(found.cells, slice(i, i + 1)).predicted(((2 * u - low - high) / (high - low))[None])
    return predicted[0]


def _root_at(domain: Domain, found: Covered, i: int | None, u: Vector) -> Vector:
    """The root at u of a cell, by Newton's method."""
    if i is None:
        return np.full(domain.equation.n, np.nan)
    guess = _still(domain, found, i, u, _local(found, i, u))
    return centred(domain.equation, guess.q0, guess.numbers, domain.c, guess.rho, newtons=NEWTONS).q0[0]


def distance_at(domain: Domain, found: Covered, i: int | None, u: Vector, q: Vector) -> float:
    """A bound of the distance of the root of a cell at u from q; infinite where that is not shown.

    The cell of the one pose at u has a root within r of q; if it lies where the other cell's is alone, it is that one.
    """
    if i is None or not np.isfinite(q).all():
        return np.inf
    here = examined(domain.equation, _still(domain, found, i, u, q), domain.c)
    off = float(np.linalg.norm(q - _local(found, i, u)) + here.r[0] + found.cells.slip[i])
    if not off < 0.5 * found.findings.alone[i]:
        return np.inf
    return float(here.r[0] + ROOM * np.linalg.norm(q - _root_at(domain, found, i, u)))


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

MOST = 30_000
"""Pairs that are compared at a time, at most."""

MANY = 16
"""Pairs for each cell: where more are left, a path may run along itself with other joints, so that all stay."""

FEW = 24
"""Of too many pairs so many are looked at to the end."""

ONCE = 4
"""Halvings of a cell down to which tool poses are enclosed all at once: neighbours are told to have one root there."""


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
    found: Covered

    def end(self) -> tuple[Extent, Revisit | None]:
        """Why a closed path whose return is not shown is not proven: its joints end elsewhere, if that is shown."""
        zero, last = np.zeros(1), len(self.found) - 1
        moved = self._moved(Parts(np.array([0]), zero, zero), Parts(np.array([last]), zero + 1, zero + 1))
        return (Extent.RETURN, None) if moved is None else (Extent.ELSEWHERE, moved)

    def anywhere(self) -> tuple[Extent, Revisit | None]:
        """WHOLE where the same tool pose has the same joints all along the path, but for whole turns; else why not."""
        boxes, cells = self.found.boxes, np.arange(len(self.found))
        whole = Parts(cells, boxes.low[:, 0], boxes.high[:, 0])
        ones, others = overlapping(*self._levels[0], cells, cells)
        return self._compared(some(whole, ones[ones <= others]), some(whole, others[ones <= others]), MOST, 0)

    def _compared(self, a: Parts, b: Parts, most_pairs: int, level: int) -> tuple[Extent, Revisit | None]:
        """The same of pairs of parts, of so many at a time; where there are more, some of them are dropped.

        The parts are cells halved `level` times.
        """
        lost, many, tries = False, MANY * len(self.found), FEW
        while True:
            left = ~self._one_root(a, b)  # first: it is cheaper than the tool poses, and most pairs are neighbours
            a, b = some(a, left), some(b, left)
            if not len(a):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            below, above = self._poses_at(joined(a, b), level)
            (low, least), (high, most) = np.split(below, 2), np.split(above, 2)
            left = np.all((low <= most) & (least <= high), axis=1)
            apart = np.maximum(high - least, most - low)[left]
            a, b = some(a, left), some(b, left)
            same = np.flatnonzero((apart <= SAME).all(axis=1))  # most often none
            if len(same):
                same = same[self._may_differ(some(a, same), some(b, same))]
            for i in same[:tries].tolist():
                tries -= 1
                moved = self._moved(some(a, slice(i, i + 1)), some(b, slice(i, i + 1)))
                if moved is not None:
                    return Extent.ELSEWHERE, moved
            if len(a) > many and most_pairs > FEW:  # look into some of them first
                extent, moved = self._compared(a, b, FEW, level)
                if moved is not None:
                    return extent, moved
                many = MOST
            wide = np.flatnonzero(np.maximum(a.high - a.low, b.high - b.low) > FINE)
            lost |= len(wide) < len(a) or len(a) > most_pairs
            if not len(wide):
                return (Extent.RETURN if lost else Extent.WHOLE), None
            if lost:
                wide = wide[np.unique(np.linspace(0, len(wide) - 1, FEW).astype(int))]
            a, b, level = some(a, wide), some(b, wide), level + 1
            two = (a.cell != b.cell) | (a.low != b.low)  # of a part with itself one pair of unlike halves is enough
            pairs = [(a.half(i), b.half(i)) for i in (False, True)]
            pairs += [(a.half(False), b.half(True)), (some(a, two).half(True), some(b, two).half(False))]
            a, b = (joined(*(pair[side] for pair in pairs)) for side in (0, 1))

    @cached_property
    def _levels(self) -> list[tuple[Matrix, Matrix]]:
        """Enclosures (cells 2^level, .) of the tool poses of all cells, halved `level` times: hulls of the finest."""
        boxes = self.found.boxes
        parts = Parts(np.arange(len(self.found)), boxes.low[:, 0], boxes.high[:, 0])
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
        low, high = self.found.boxes.low[parts.cell, 0], self.found.boxes.high[parts.cell, 0]
        share = ((parts.low + parts.high) / 2 - low) / (high - low)  # a middle: far from a part's ends
        those = parts.cell * 2**level + np.floor(share * 2**level).astype(int)
        tiny = high - low <= FINE  # halves are rounded there: all of the cell holds them
        (below, above), (least, most) = self._levels[level], self._levels[0]
        those[tiny] = 0
        below, above = below[those], above[those]
        below[tiny], above[tiny] = least[parts.cell[tiny]], most[parts.cell[tiny]]
        return below, above

    def _poses(self, parts: Parts) -> tuple[Matrix, Matrix]:
        """Enclosures (k, .) of the tool poses, wider by what counts as the same."""
        boxes = self.found.boxes
        ends = np.column_stack([(parts.low + parts.high) / 2, (parts.high - parts.low) / 2])
        fixed = np.vstack([self.domain.given(boxes.piece[parts.cell]).T, ends.T])
        one = np.ones((1, len(parts)))
        found = self.domain.equation.reached(np.vstack([-one, fixed]), np.vstack([one, fixed]))
        return found.low.T - SAME / 8, found.high.T + SAME / 8

    def _joints(self, parts: Parts) -> tuple[Matrix, Matrix, Vector]:
        """Predicted unknowns (k, n) in the middles, how far each goes from there at most, the rounding of both (k,)."""
        boxes, cells = self.found.boxes, some(self.found.cells, parts.cell)
        low, high = boxes.low[parts.cell, 0], boxes.high[parts.cell, 0]
        y = (parts.low + parts.high - low - high) / (high - low)
        reach = (np.abs(cells.V[:, :, 0]) + np.abs(cells.Q[:, :, 0])) * ((parts.high - parts.low) / (high - low))[
            :, None
        ]
        return cells.predicted(y[:, None]), reach * UP, cells.slip

    def _turns(self, apart: Matrix) -> Matrix:
        """The whole turns (k, n) in differences of unknowns, where E stays as it is by them."""
        turns = np.where(self.domain.equation.revolute, np.rint(apart / (2 * np.pi)), 0.0)
        for row in np.unique(turns[turns.any(axis=1)], axis=0):
            if not self._periodic(tuple(row.tolist())):
                turns[(turns == row).all(axis=1)] = 0.0
        return turns

    @cached_property
    def _known(self) -> dict[tuple[float, ...], bool]:
        return {}

    def _periodic(self, turns: tuple[float, ...]) -> bool:
        if turns not in self._known:
            self._known[turns] = self.domain.equation.periodic(np.array(turns))
        return self._known[turns]

    def _apart(self, a: Parts, b: Parts) -> tuple[Matrix, Matrix]:
        """By how much the predictors of b are from those of a less whole turns (k, n), and the error of this."""
        (p, of_a, slip), (q, of_b, slips) = self._joints(a), self._joints(b)
        turns = self._turns(q - p)
        error = of_a + of_b + (slip + slips + 1e-14 * np.linalg.norm(turns, axis=1))[:, None]
        return q - p - 2 * np.pi * turns, error

    def _one_root(self, a: Parts, b: Parts) -> Flags:
        """(k,) True where at each common pose both parts have one root."""
        if not len(a):
            return np.zeros(0, dtype=bool)
        findings = self.found.findings
        apart, error = self._apart(a, b)
        off = (np.linalg.norm(apart, axis=1) + np.linalg.norm(error, axis=1)) * UP
        r, alone = findings.r * UP, findings.alone / UP
        return (off + r[b.cell] <= alone[a.cell]) | (off + r[a.cell] <= alone[b.cell])

    def _may_differ(self, a: Parts, b: Parts) -> Flags:
        """(k,) True where the predictors are farther apart than the roots are from them."""
        r = self.found.findings.r
        return np.linalg.norm(self._apart(a, b)[0], axis=1) > r[a.cell] + r[b.cell]

    def _moved(self, a: Parts, b: Parts) -> Revisit | None:
        """How the joints differ in the middles of two parts; None where they are not shown to."""
        places, roots, error, n = [], [], 0.0, self.domain.equation.joints
        for part in (a, b):
            cell, u = int(part.cell[0]), (part.low + part.high) / 2
            roots.append(_root_at(self.domain, self.found, cell, u))
            error += distance_at(self.domain, self.found, cell, u, roots[-1])
            places.append((int(self.found.boxes.piece[cell]), float(u[0])))
        if not np.isfinite(error):
            return None
        apart = roots[1] - roots[0]
        turns = self._turns(apart[None])[0]
        error = (error + 1e-15 * float(np.linalg.norm(np.abs(roots).sum(axis=0)))) * UP
        if not (np.abs(apart - 2 * np.pi * turns) > error)[:n].any():
            return None
        return Revisit(places[0], places[1], (apart - error)[:n], (apart + error)[:n])


SAMPLES = 256
"""Samples of the path that the predictors start from."""

ROUNDS = 12
"""Times that cells which could not be glued are halved."""


@typed
def certify(
    strategy: Strategy,
    where: AnyPath | Workspace,
    q0: ArrayLike,
    *,
    limits: bool = True,
    scene: Scene | None = None,
    budget: int = 20_000,
    keep_in: str | FilePath | None = None,
    progress: Callable[[str], None] = lambda _text: None,
) -> Certificate:
    """Prove that on the leaf through q0 the joints are one function of the tool pose in a box, or the place on a path.

    It is smooth, on a path between corners. Of a path it is shown, besides, that the joints return with the tool: where
    the path closes, and where it crosses or follows itself. If not, `extent` is ELSEWHERE, with the drift in `revisit`,
    or RETURN; `covered` is True.

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
        budget: cells that may be examined.
        keep_in: a file that keeps the cells as they are examined. Where it is there already, of the same question, the
            proof goes on with them, and ends with the same certificate; with another `budget`, as far as they serve.
        progress: hears how far it is.

    Returns:
        A certificate; where something could not be proven its `extent` says why, `where` the place, and what it holds
        was proven up to there.

    Raises:
        NoProofError: a strategy without leaves, or whose leaves a differential equation carries. ArgumentError: no box;
            shapes of which no proof can be; `keep_in` is of another question. WriteError: it cannot be written.
        ExpressionError: an operation without a rule for intervals. StartError, JointLimitError; of a leaf on which not
        even a first step is possible SingularityError, BranchError.
    """
    began, ended = time.perf_counter(), (Extent.WHOLE, "")
    strategy, start = provable(strategy), start_of(strategy, q0, limits)
    budget = whole("budget", budget)
    if isinstance(where, Workspace):
        domain: Domain = PoseRegion.of(strategy, where, start)
    else:
        postures, extent, stop = walked(strategy, where, start, SAMPLES)
        ended = extent, stop
        domain = Pathway.of(strategy, where, postures, SAMPLES)
    clear = kept_apart(strategy, start, scene)
    asked = demands(strategy, limits, clear)
    with KeptCells.opened(keep_in, lambda: question(domain, start, asked)) as kept_cells:
        return certificate(where, domain, start, asked, budget, progress, began, ended, kept_cells)


def question(domain: Domain, start: Vector, asked: Demands) -> dict[str, Any]:
    """All that decides what is proven, but for the budget: the equation, the start, the poses, limits and shapes."""
    equation, first = domain.equation, domain.first()
    n, d, given = equation.n, equation.d, domain.given(np.unique(first.piece))
    inputs = [*range(n + d + given.shape[1]), *[0.0] * d, *[1.0] * d]
    inputs += range(n + d + given.shape[1], n + d + given.shape[1] + len(domain.c))
    limits, clear = asked.limits, asked.clear
    arrays = (start, domain.c, given, first.low, first.high, first.rho, *(limits or ()))
    return {
        "equation": lowered(equation.operations, inputs, [*equation.angular, *[False] * equation.positive]),
        "hashes": [hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest() for a in arrays],
        "clear": None if clear is None else clear.described(), "partial": domain.partial, "slack": domain.slack,
    }  # fmt: skip


def provable(strategy: Strategy) -> HolonomicStrategy:
    """The strategy, of whose leaves something can be proven. Raises: NoProofError."""
    if not isinstance(strategy, HolonomicStrategy):
        raise NoProofError(strategy.name, f"it has no leaves: {HolonomicStrategy.cure}")
    if strategy.constraint.looped is not None:
        cure = "a differential equation carries its leaves: certify the polynomial hk.strategies.fitted(strategy, Q)"
        raise NoProofError(strategy.name, cure)
    return strategy


def start_of(strategy: Strategy, q0: ArrayLike, limits: bool) -> Vector:
    """A start posture (n,). Raises: StartError; JointLimitError: with limits, it is beyond them."""
    return start_posture(strategy.task.robot, q0, limits)


def demands(strategy: HolonomicStrategy, limits: bool, clear: ClearCells | None) -> Demands:
    """What is asked of the joints, and of shapes."""
    robot = strategy.task.robot
    return Demands(Interval(robot.lower, robot.upper) if limits else None, clear)


def certificate(
    where: AnyPath | Workspace, domain: Domain, start: Vector, asked: Demands, budget: int,
    progress: Callable[[str], None], began: float, ended: tuple[Extent, str] = (Extent.WHOLE, ""),
    kept_cells: KeptCells = NOWHERE,
) -> Certificate:  # fmt: skip
    """What can be proven over a domain. ended: why and where the postures of a path ended early."""
    strategy = domain.equation.strategy
    robot = strategy.task.robot
    found = _glued(domain, asked, budget, progress, kept_cells)
    if asked.clear is not None:
        progress(f"{len(found):,} cells proven, the least distances")
        found = replace(found, findings=asked.clear.sharpened(found.cells, found.findings))
    extent, place = found.extent, domain.place(found)
    if extent is Extent.WHOLE and ended[0] is not Extent.WHOLE:
        extent, place = ended
    closed = extent is Extent.WHOLE and not isinstance(where, Workspace) and where.closed
    anchors = _anchored(domain, found, start, closed)
    begun = at_start(domain, anchors, start)
    if extent is Extent.WHOLE and not begun:
        extent, place = Extent.APART, "the start"
    revisit = None
    if extent is Extent.WHOLE and isinstance(domain, Pathway):
        revisits = Revisits(domain, found)
        extent, revisit = revisits.end() if closed and anchors.turns is None else revisits.anywhere()
    turns, gap = (np.zeros(robot.n), np.inf) if anchors.turns is None else (anchors.turns[: robot.n], anchors.gap)
    low, high = _hull(found, start)
    to_limit = np.minimum(low - robot.lower, robot.upper - high)
    determinant = least_determinant(found.findings)
    title, boxes = f"{strategy.name}, {strategy.task.name}", found.boxes
    share = float(domain.shares(boxes.low, boxes.high).sum()) if isinstance(domain, PoseRegion) else 1.0
    pieces = domain.given(np.arange(1 if found.boxes.piece.size == 0 else int(found.boxes.piece.max()) + 1))
    about = f"{strategy.name!r} for the task {strategy.task.name!r}"
    theorem = _theorem(
        about,
        where,
        domain.equation,
        extent,
        place,
        found,
        determinant,
        asked,
        to_limit,
        turns,
        gap,
        revisit,
        share,
        begun,
    )
    return Certificate(
        title, theorem, extent, place, found, low, high, determinant, to_limit, turns, gap,
        time.perf_counter() - began, domain.equation, domain.c, anchors, asked, pieces, revisit, where,
    )  # fmt: skip


def _theorem(
    title: str, where: AnyPath | Workspace, equation: Equation, extent: Extent, place: str, found: Covered,
    determinant: float, asked: Demands, to_limit: Vector, turns: Vector, gap: float, revisit: Revisit | None,
    proven: float, begun: bool,
) -> str:  # fmt: skip
    if not len(found):
        return f"Nothing is proven: at {place or 'the start'} {extent.cause}."
    with_others, q = "", ""
    if equation.n > equation.joints:
        with_others, q = ", taken with the auxiliary unknowns of the constraint,", ", q the joints and these unknowns"
    all_of_it, one = extent in COVERED, equation.strategy.task.frames == 1
    if isinstance(where, Workspace):
        share = f"the cells that are joined, {share_text(proven)} of {where},"
        function, about = "smooth function of the pose", f"every pose of {where if all_of_it else share}"
    else:
        function = "continuous function of the place, smooth between corners of the path"
        about = f"every place {'on the path' if all_of_it else 'of the path up to there'}"
    parts = [
        f"on the leaf of {title} through the start, {about} has exactly one posture{with_others} in the tube of its "
        f"cell ({len(found)} cells); this posture is a {function}, with |det {equation.derivative}| "
        f">= {at_least(determinant, 2)}{q}"
    ]
    if asked.limits is not None and np.isfinite(to_limit).any():
        parts.append(f"every joint stays {at_least(float(to_limit.min()), 2)} or more (rad or m) from its limits")
    turned = f" but for the whole turns {turns.astype(int).tolist()}" if turns.any() else ""
    if asked.clear is not None:
        parts.append(asked.clear.told(found.findings.apart))
    if np.isfinite(gap):
        parts.append(f"at the end of the closed path the joints are those of its beginning{turned}")
    if extent is Extent.WHOLE and not isinstance(where, Workspace):
        pose, poses = ("a tool pose", "the tool pose") if one else ("the tools' poses", "the tools' poses")
        again = "whole turns apart at most" if turned else "the same"
        parts.append(f"wherever the path comes back to {pose}, the joints are {again}: a function of {poses} on it")
    said = "; ".join(parts)
    if extent is Extent.WHOLE:
        return f"{said[0].upper()}{said[1:]}."
    if revisit is not None:
        return f"The joints are no function of the tool pose here: {revisit.told(equation)}; but {said}."
    said += "" if begun else "; the pose of the start is not proven"
    return f"Not all is proven, since {f'at {place} ' if place else ''}{extent.cause}; but {said}."


def _hull(found: Covered, q0: Vector) -> tuple[Vector, Vector]:
    if not len(found):
        return q0, q0
    return found.findings.low.min(axis=0), found.findings.high.max(axis=0)


def _glued(domain: Domain, asked: Demands, budget: int, progress: Callable[[str], None], kept: KeptCells) -> Covered:
    """Cells over all of a domain, halved until neighbours share roots; or those that hang together."""
    before = ""

    def told(count: int, spent: int, share: float) -> None:
        again = f", {kept.resumed:,} of them before" if kept.resumed else ""
        progress(f"{before}{share:.0%} proven by {count:,} cells, {spent:,} of at most {budget:,} examined{again}")

    if isinstance(domain, PoseRegion) and domain.partial:
        return grown(domain, asked, budget, told, kept)
    found = domain.arranged(covered(domain, domain.first(), asked, budget, told, kept))
    for i in range(ROUNDS):
        progress(f"{len(found):,} cells proven, joining them")
        apart = domain.unglued(found)
        if not (domain.goes_on(found.extent) and apart.any()):
            break
        before = f"round {i + 2}, of the {int(apart.sum()):,} cells that are not joined yet: "
        parts = halves(found.boxes, found.cells, found.cells.rho / 2, apart, np.isfinite(found.findings.eta))
        found = domain.arranged(_both(found.only(~apart), covered(domain, parts, asked, budget, told, kept)))
    return domain.connected(found)


def _both(one: Covered, other: Covered) -> Covered:
    """The cells of both, ended where the first of them is."""
    ends = [(c.stopped, c.extent) for c in (one, other) if c.stopped is not None]
    stopped, extent = min(ends, key=lambda end: end[0], default=(None, Extent.WHOLE))
    boxes, cells, findings = (joined(getattr(one, f), getattr(other, f)) for f in ("boxes", "cells", "findings"))
    return Covered(boxes, cells, findings, extent, stopped)
