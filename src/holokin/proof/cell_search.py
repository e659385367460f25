"""The search for a proof: boxes of parameters, halved where the test of their cells fails.

A box is low <= u <= high, d numbers, of a piece: of a path's piece the share, of a workspace the parameters of its
poses.
"""

from __future__ import annotations

import hashlib
import io
import json
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import ArgumentError
from ..base.files import writing
from ..base.sqlite_file import sqlite_file, table_file, writing_rows
from ..base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector, joined, some
from ..symbolic.intervals import Interval
from ..version import __version__
from .clear_cells import ClearCells
from .equation import Equation
from .tube import UP, Cells, Findings, centred, examined

# --- The batches of cells that a proof has examined, kept in an SQLite file: a proof that was stopped goes on with
# them.
#
# A batch is found again by its boxes and by all batches before it, so that a proof that goes on examines the same cells
# in the same order, and ends with the same certificate. Whole batches are kept or none, whatever is killed and when. Of
# their contents a hash is kept, too; a batch that is not as it was written is examined anew.

FORM = 2
"""Of the file; a later form is another number."""


@dataclass(frozen=True, eq=False)
class Batch(Value):
    """Of k cells: their predictors; omega, eta (k,); which have a root of their own (`good`), which are as asked
    (`kept`), which cannot be if halved (`final`), where shapes are the reason (`near`). Findings of the kept ones; and
    what was learned of the leaf by the way: places (l, d), joints (l, n)."""

    cells: Cells
    omega: Vector
    eta: Vector
    good: Flags
    kept: Flags
    final: Flags
    near: Flags
    findings: Findings
    places: Matrix
    joints: Matrix

    @property
    def rooted(self) -> Flags:
        """(k,) where a root was found at all."""
        return np.isfinite(self.eta)

    def packed(self) -> bytes:
        """The same as bytes."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("cells", "findings")}
        for kind, part in (("cells", self.cells), ("findings", self.findings)):
            arrays |= {f"{kind}.{f.name}": getattr(part, f.name) for f in fields(part)}
        stream = io.BytesIO()
        np.savez(stream, **arrays)
        return stream.getvalue()

    @staticmethod
    def unpacked(data: bytes) -> Batch:
        """What was packed."""
        with np.load(io.BytesIO(data), allow_pickle=False) as found:
            arrays = {name: np.array(found[name]) for name in found.files}

        def part(kind: Any) -> Any:
            return kind(**{f.name: arrays.pop(f"{kind.__name__.lower()}.{f.name}") for f in fields(kind)})

        return Batch(cells=part(Cells), findings=part(Findings), **arrays)


class KeptCells:
    """What keeps batches, or, without a connection, keeps none. `resumed`: cells of a run before that were taken."""

    def __init__(self, file: Path | None = None, connection: sqlite3.Connection | None = None) -> None:
        self._file, self._db, self._chain, self.resumed = file, connection, b"", 0

    @classmethod
    @contextmanager
    def opened(cls, file: str | Path | None, question: Callable[[], dict[str, Any]]) -> Iterator[KeptCells]:
        """A file of a question: made where it is not there; None for no file.

        Raises:
            ArgumentError: it is of another question, or no such file. WriteError: the system refuses it.
        """
        if file is None:
            yield cls()
            return
        file = Path(file)
        asked = hashlib.sha256(json.dumps(question(), sort_keys=True).encode()).hexdigest()

        def broken(fact: str) -> ArgumentError:
            cure = f"it is no file of cells ({fact}): give another file, or delete it"
            return ArgumentError("the file of cells", str(file), cure)

        def make(db: sqlite3.Connection) -> None:
            db.execute("CREATE TABLE proof (form INTEGER, question TEXT, version TEXT)")
            db.execute("CREATE TABLE batches (key TEXT PRIMARY KEY, cells INTEGER, hash TEXT, data BLOB)")
            db.execute("INSERT INTO proof VALUES (?, ?, ?)", (FORM, asked, __version__))

        with writing(file):
            file.parent.mkdir(parents=True, exist_ok=True)
        with table_file(file, "proof", {"form": FORM, "version": __version__}, broken, make) as db:
            if db.execute("SELECT question FROM proof").fetchone() != (asked,):
                raise broken("it is of another robot, strategy, start, box, shapes or clearance")
            db.execute("PRAGMA synchronous = NORMAL")
            yield cls(file, db)

    def batch(self, boxes: Boxes) -> Batch | None:
        """That of boxes that come next, where it was kept; the next ones are asked for, or kept, after it."""
        if self._db is None or self._file is None:
            return None
        parts = [np.ascontiguousarray(getattr(boxes, f.name)).tobytes() for f in fields(boxes)]
        self._chain = hashlib.sha256(b"".join([self._chain, *parts])).digest()
        with writing_rows(self._file):
            row = self._db.execute("SELECT hash, data FROM batches WHERE key = ?", (self._chain.hex(),)).fetchone()
        if row is None or hashlib.sha256(row[1]).hexdigest() != row[0]:
            return None
        self.resumed += len(boxes)
        return Batch.unpacked(row[1])

    def keep(self, batch: Batch) -> None:
        """Keep that of the boxes that were asked for last. Raises: WriteError."""
        if self._db is None or self._file is None:
            return
        data = batch.packed()
        row = (self._chain.hex(), len(batch.good), hashlib.sha256(data).hexdigest(), data)
        with writing_rows(self._file), self._db:
            self._db.execute("INSERT OR REPLACE INTO batches VALUES (?, ?, ?, ?)", row)


def count_kept(file: Path) -> int:
    """Cells that a file keeps; 0 where it is none."""
    try:
        with sqlite_file(file, "read") as db:
            return int(db.execute("SELECT COALESCE(SUM(cells), 0) FROM batches").fetchone()[0])
    except sqlite3.DatabaseError:
        return 0


def remove_kept(file: Path) -> None:
    """Delete a file of cells, with what SQLite may have put beside it."""
    for one in (file, *(file.with_name(f"{file.name}-{end}") for end in ("wal", "shm"))):
        one.unlink(missing_ok=True)


# --- Boxes of parameters, and what is asked of their cells besides one root each: joints within limits, shapes apart.


class Extent(NoTruthValue, Enum, ask="`is Extent.WHOLE`"):
    """How far a proof came, and why no farther; the text names cause and cure."""

    WHOLE = "all that was asked is proven"
    SINGULAR = (
        "the robot comes to a singular posture, or too near to one for a proof; choose another constraint or start"
    )
    LIMIT = "a joint is at its limit or beyond it; choose another start posture, or ask with limits=False"
    NEAR = (
        "two bodies are nearer than was asked, or too near to that for a proof; choose another start, or ask for less"
    )
    BUDGET = "the parts that may be examined are all examined; allow more with budget="
    END = "the strategy could not be followed any farther; choose another start posture, path or constraint"
    APART = (
        "where two parts meet, they could not be shown to have the same joints; allow smaller ones with more budget="
    )
    ELSEWHERE = "the path comes back to a tool pose with other joints; choose another constraint, start or path"
    RETURN = (
        "the path comes back to a tool pose, and the joints could not be shown to; choose another constraint or start"
    )

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

    def places(self) -> list[tuple[int, tuple[float, ...]]]:
        """(piece, low) of each."""
        return [(int(piece), tuple(low)) for piece, low in zip(self.piece, self.low.tolist(), strict=True)]

    def predicted(self, cells: Cells, u: Matrix) -> Matrix:
        """The unknowns (k, n) that the cells of these boxes predict at places u (k, d) in them."""
        half = (self.high - self.low) / 2
        return cells.predicted((u - (self.low + self.high) / 2) / np.where(half > 0, half, 1.0))


@dataclass(frozen=True, eq=False)
class Covered(Value):
    """Boxes that were proven, with their cells and findings; why no more were, and at which box (piece, low), with the
    predicted joints (n,) in its middle: None where it was not looked at."""

    boxes: Boxes
    cells: Cells
    findings: Findings
    extent: Extent = Extent.WHOLE
    stopped: tuple[int, tuple[float, ...]] | None = None
    posture: Vector | None = None

    def __len__(self) -> int:
        return len(self.boxes)

    def only(self, chosen: Any) -> Covered:
        """Some of them."""
        boxes, cells, findings = (some(part, chosen) for part in (self.boxes, self.cells, self.findings))
        return replace(self, boxes=boxes, cells=cells, findings=findings)


COMPARED = 4096
"""Pairs of boxes that are compared without a further cut."""


def overlapping(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> tuple[Indices, Indices]:
    """All pairs (one, other) whose boxes low <= u <= high (k, d) have an inside in common, cut until few are left."""
    pairs, waiting = [np.zeros((0, 2), dtype=int)], [(ones, others)]
    while waiting:
        ones, others = waiting.pop()
        parts = _cut(low, high, ones, others) if len(ones) * len(others) > COMPARED else None
        if parts is not None:
            waiting += parts
        elif len(ones) and len(others):
            for part in np.array_split(ones, -(-len(ones) * len(others) // (16 * COMPARED))):
                start, end = np.maximum(low[part][:, None], low[others]), np.minimum(high[part][:, None], high[others])
                i, j = np.nonzero((start < end).all(axis=2))
                pairs.append(np.column_stack([part[i], others[j]]))
    first, second = np.unique(np.concatenate(pairs), axis=0).T  # of a pair that a cut goes through both sides have one
    return first, second


def _cut(low: Matrix, high: Matrix, ones: Indices, others: Indices) -> list[tuple[Indices, Indices]] | None:
    """The boxes below and above the cut that leaves the fewest pairs; None where none leaves much fewer."""
    fewest, parts = 0.75 * len(ones) * len(others), None
    for axis in range(low.shape[1]):
        for cut in (np.median(low[ones, axis]), np.median(high[ones, axis])):
            below = ones[low[ones, axis] < cut], others[low[others, axis] < cut]
            above = ones[high[ones, axis] > cut], others[high[others, axis] > cut]
            count = len(below[0]) * len(below[1]) + len(above[0]) * len(above[1])
            if count < fewest:
                fewest, parts = count, [below, above]
    return parts


ROUNDING = 1e-12
"""Motion [joint units] that is round-off, and distance from a limit: no bound of a root comes below it."""


@dataclass(frozen=True, eq=False)
class Demands(Value):
    """The limits of the joints, and shapes that are to keep apart; None where they are not asked about."""

    limits: Interval | None
    clear: ClearCells | None = None

    def judged(self, cells: Cells, findings: Findings, good: Flags) -> tuple[Findings, Flags, Flags, Flags]:
        """(findings with distances; which cells are as asked; which cannot be if halved; of which shapes are the
        reason) of cells that have a root of their own (`good`), (k,) each."""
        # Joints: beyond a limit over all of the cell, or held at it, so that no part of the cell keeps off.
        kept, final, near = good.copy(), np.zeros(len(good), dtype=bool), np.zeros(len(good), dtype=bool)
        if self.limits is not None:
            low, high = self.limits
            kept &= ((findings.low >= low) & (findings.high <= high)).all(axis=1)
            q, motion = (part[:, : len(low)] for part in (cells.q0, cells.reach))
            held = (motion <= ROUNDING) & ((q >= high - ROUNDING) | (q <= low + ROUNDING))
            final |= good & (held | (findings.low > high) | (findings.high < low)).any(axis=1)
        if self.clear is None:
            return findings, kept, final, near
        # Shapes: nearer than asked in the middle already, or over a cell that moves less than 1 mm.
        rows, count = np.flatnonzero(kept), len(self.clear.pairs)
        bounds = self.clear.over(some(cells, rows), findings.r[rows])
        apart, planes = np.full((len(good), count), -np.inf), np.zeros((len(good), count, 3))
        apart[rows], planes[rows] = bounds.least, bounds.planes
        short = ~(bounds.least >= self.clear.wanted)
        near[rows] = short.any(axis=1)
        final[rows] |= (short & ((bounds.motion < 1e-3) | (bounds.middle < self.clear.wanted))).any(axis=1)
        return replace(findings, apart=apart, planes=planes), kept & ~near, final, near


# --- The search.

SHORTEST = 1e-7
"""Joint motion [joint units] of a cell below which it is not halved: the leaf is singular there."""

LONE = 3.3
"""A root is looked for where it is the only one within this many times the bound of its distance from the predictor, so
that cells can be glued: the predictors of neighbours are apart by the sum of their bounds at most."""

TUBE = 0.25
"""The radius of a tube at first, times omega."""

AIM = 0.33
"""What e, the change of [J; J_g] within a cell, is to be: the test ends at 1, and cells far below it are many."""

GRID = 2.0**-50
"""Bounds of boxes are whole multiples of it, and at most 1: their sums, differences and middles are exact."""

BATCH, FEW = 1024, 32
"""Cells examined at once: 100 MB of intervals; where none was proven before, so that a failure is found soon."""

NOWHERE = KeptCells()
"""Keeps no cells."""


class Domain(ABC):
    """What a proof is about: the tool poses of boxes of parameters, and joints near their roots."""

    equation: Equation
    c: Vector
    slack: float
    partial: bool = False

    @abstractmethod
    def first(self) -> Boxes:
        """Boxes that cover it."""

    @abstractmethod
    def given(self, piece: Indices) -> Matrix:
        """The numbers (k, .) of the family of some pieces, without the last ones, u0 and h."""

    def numbers(self, boxes: Boxes) -> Matrix:
        """The numbers (k, .) of the family over boxes: u0 and h are exact."""
        middle, half = (boxes.low + boxes.high) / 2, (boxes.high - boxes.low) / 2
        return np.hstack([self.given(boxes.piece), middle, half])

    def shares(self, low: Matrix, high: Matrix) -> Vector:
        """(k,) the sizes of boxes of parameters."""
        return np.prod(high - low, axis=1)

    @abstractmethod
    def joints(self, boxes: Boxes) -> Matrix:
        """Joints (k, n) near the roots at their middles."""

    def learned(self) -> list[tuple[Vector, Vector]]:
        """Places and postures of the leaf that were found, of which the next ones are continued; here none."""
        return []

    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """(k,) True for boxes that are of no use once the proof has failed at some places (piece, low); here all."""
        return np.ones(len(boxes), dtype=bool)

    def goes_on(self, extent: Extent) -> bool:
        """Whether cells are of use where the proof of others ended so; here where it has not ended."""
        return extent is Extent.WHOLE

    def arranged(self, proven: Covered) -> Covered:
        """The proven cells in order, those that count where the proof failed; here all as they are."""
        return proven

    @abstractmethod
    def unglued(self, proven: Covered) -> Flags:
        """(k,) True for cells whose root is not shown to be that of a neighbour where they meet."""

    @abstractmethod
    def connected(self, proven: Covered) -> Covered:
        """All cells, or, where they are not all proven or glued, those that hang together with the first ones."""

    @abstractmethod
    def place(self, proven: Covered) -> str:
        """In words where the proof failed; nothing where it did not."""


def covered(
    domain: Domain, boxes: Boxes, demands: Demands, budget: int, progress: Callable[[int, int, float], None],
    kept_cells: KeptCells = NOWHERE,
) -> Covered:  # fmt: skip
    """The boxes, halved where they must be, that are proven of some boxes, and why no more of them are.

    progress: hears how many are proven, how many were examined, and which share of the boxes is proven, 0 to 1.
    """
    done: list[tuple[Boxes, Cells, Findings]] = []
    stopped: list[tuple[int, tuple[float, ...]]] = []
    reasons: list[Extent] = []
    postures: list[Vector | None] = []
    spent, count, filled, size = 0, 0, 0.0, BATCH
    left, total = boxes, float(domain.shares(boxes.low, boxes.high).sum())
    while len(left):
        if spent >= budget:
            stopped += left.places()
            reasons += [Extent.BUDGET] * len(left)
            postures += [None] * len(left)
            break
        # The next batch: the smallest boxes, where the proof may fail; in their order, if the budget is not for all.
        if budget - spent < len(left):
            size = min(size, max(FEW, (budget - spent) // 8))  # so that what fails among them is halved in time
            order = np.lexsort((left.low[:, 0], left.piece))
        else:
            order = np.argsort(np.prod(left.high - left.low, axis=1), kind="stable")
        chosen = np.zeros(len(left), dtype=bool)
        chosen[order[: min(size, budget - spent)]] = True
        tried, waiting = some(left, chosen), some(left, ~chosen)
        spent += len(tried)
        # Keep those that are as asked.
        batch = looked_up(domain, tried, demands, kept_cells, lambda tried=tried: domain.joints(tried))
        done.append((some(tried, batch.kept), some(batch.cells, batch.kept), batch.findings))
        count += len(batch.findings.r)
        filled += float(domain.shares(tried.low[batch.kept], tried.high[batch.kept]).sum())
        size = min(BATCH, FEW + 8 * len(batch.findings.r))
        progress(count, spent, filled / total)
        # Give up those that are too small; try the others again, or their halves.
        final = ~batch.kept & (too_small(tried, batch.cells) | batch.final)
        stopped += some(tried, final).places()
        reasons += reasons_of(batch, final)
        postures += list(batch.cells.q0[final])
        _, again, _, parts = smaller(tried, batch, ~batch.kept & ~final)
        left = joined(waiting, again, parts)
        if stopped:
            left = some(left, ~domain.beyond(left, stopped))
    proven = Covered(*(joined(*parts) for parts in zip(*done, strict=True)))
    if not stopped:
        return proven
    first = min(range(len(stopped)), key=lambda i: stopped[i])
    return replace(proven, extent=reasons[first], stopped=stopped[first], posture=postures[first])


def too_small(boxes: Boxes, cells: Cells) -> Flags:
    """(k,) which boxes are not halved any more: the joints hardly move over them, the leaf is singular there."""
    finest = np.min(boxes.high - boxes.low, axis=1) < 8 * GRID
    return ~(np.linalg.norm(cells.reach, axis=1) > 1e-7) | finest


def smaller(
    boxes: Boxes, batch: Batch, failed: Flags, sides: Vector | None = None
) -> tuple[Indices, Boxes, Indices, Boxes]:
    """Of failed boxes: (those that are tried again, with narrower tubes; those that are halved, the lower and then the
    upper halves). sides: as of `halves`."""
    # The radius that a root alone in a tube needs, about `LONE` times 2 eta, and room; and that of a first cell.
    d = boxes.low.shape[1]
    need = np.where(batch.rooted, 10 * batch.eta, 0.0)
    usual = np.where(np.isfinite(batch.omega), TUBE / np.clip(batch.omega, 1e-3, 1e9), boxes.rho / 4)
    # Once more with a narrower tube, where there is a root and the radius becomes much less; else halves.
    narrow = np.maximum(np.minimum(boxes.rho / 4, usual), need)
    retried = failed & batch.rooted & ~batch.good & ~boxes.again & (narrow < 0.9 * boxes.rho)
    again = Boxes(boxes.piece, boxes.low, boxes.high, narrow, np.ones(len(boxes), dtype=bool), batch.cells.q0)
    shrink = 8.0 ** (-1 / d)  # eta is of third order, and one of d sides is halved
    rho = np.clip(shrink * need, boxes.rho / 2, np.maximum(boxes.rho, usual))
    cut = failed & ~retried
    parts = halves(boxes, batch.cells, rho, cut, batch.rooted, sides)
    return np.flatnonzero(retried), some(again, retried), np.flatnonzero(cut), parts


def looked_up(
    domain: Domain, boxes: Boxes, demands: Demands, kept_cells: KeptCells, joints: Callable[[], Matrix]
) -> Batch:
    """The test of the cells of boxes, from joints (k, n) near their roots: as it was kept, or made now, and kept."""
    batch = kept_cells.batch(boxes)
    if batch is not None:
        domain.learned().extend(zip(batch.places, batch.joints, strict=True))
        return batch
    # The test, and what is asked besides.
    equation, before = domain.equation, len(domain.learned())
    cells = centred(equation, joints(), domain.numbers(boxes), domain.c, boxes.rho)
    findings = examined(equation, cells, domain.c, domain.slack)
    good = joinable(findings)
    judged, kept, final, near = demands.judged(cells, findings, good)
    # What was learned of the leaf by the way.
    new = domain.learned()[before:]
    places = np.array([u for u, _ in new]).reshape(len(new), equation.d)
    postures = np.array([q for _, q in new]).reshape(len(new), -1 if new else equation.n)
    batch = Batch(cells, findings.omega, findings.eta, good, kept, final, near, some(judged, kept), places, postures)
    kept_cells.keep(batch)
    return batch


def reasons_of(batch: Batch, chosen: Flags) -> list[Extent]:
    """Why some cells are not as asked."""
    both = zip(batch.good[chosen], batch.near[chosen], strict=True)
    return [Extent.NEAR if near else Extent.LIMIT if good else Extent.SINGULAR for good, near in both]


def joinable(findings: Findings) -> Flags:
    """(k,) True where the test holds, with room for gluing."""
    return np.isfinite(findings.r) & (LONE * findings.r <= findings.alone)


def one_root(off: Vector, r: Vector, alone: Vector, other_r: Vector, other_alone: Vector) -> Flags:
    """(k,) where two cells surely have one root at a place, their predictors being `off` apart there: the root of the
    one is where that of the other is alone.

    Where they have one, off <= r + r'. For r' <= r then off + r' <= 3 r, which is less than `alone`, `LONE` times r: so
    it is shown of all that have one.
    """
    return (off + r <= other_alone / UP) | (off + other_r <= alone / UP)


def on_grid(values: Array) -> Array:
    """Bounds of boxes in [-1, 1], moved to multiples of 2^-24: 26 halvings lead from there to `GRID`."""
    return np.rint(np.asarray(values) * 2.0**24) * 2.0**-24


def halves(boxes: Boxes, cells: Cells, rho: Vector, chosen: Flags, sound: Flags, sides: Vector | None = None) -> Boxes:
    """Both halves of some boxes, cut across the parameter that moves the joints most; `sound` ones predict theirs.

    sides: (d,) those of a cell of the grid, by which a box without a root is cut.
    """
    # The parameter that is cut: where the motion is not known the widest one.
    k, low, high = int(chosen.sum()), boxes.low[chosen], boxes.high[chosen]
    motion, wide = np.linalg.norm(cells.V[chosen], axis=1), high - low
    known = np.isfinite(motion).all(axis=1, keepdims=True) & motion.any(axis=1, keepdims=True)
    axis = np.argmax(np.where(known, motion, wide if sides is None else wide / sides), axis=1)
    # The halves, and what their cell predicts in their middles.
    rows = np.arange(k)
    upper, lower, y = low.copy(), high.copy(), np.zeros_like(low)
    upper[rows, axis] = lower[rows, axis] = (low[rows, axis] + high[rows, axis]) / 2
    y[rows, axis] = 0.5
    whole = some(cells, chosen)
    near = [np.where(sound[chosen, None], whole.predicted(side), np.nan) for side in (-y, y)]
    ends = np.concatenate([low, upper]), np.concatenate([lower, high])
    return Boxes(
        np.tile(boxes.piece[chosen], 2),
        *ends,
        np.tile(rho[chosen], 2),
        np.zeros(2 * k, dtype=bool),
        np.concatenate(near),
    )
