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
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import ArgumentError
from ..base.files import writing
from ..base.sqlite_file import sqlite_file, table_file, writing_rows
from ..base.types import Array, Flags, Indices, Matrix, Value, Vector, joined, some
from ..version import __version__
from .certificate import Boxes, Covered, Demands, Extent
from .equation import Equation
from .tube import Cells, Findings, centred, examined

# --- The batches of cells that a proof has examined, kept in an SQLite file: a proof that was stopped goes on with
# them.
#
# A batch is found again by its boxes and by all batches before it, so that a proof that goes on examines the same cells
# in the same order, and ends with the same certificate. Whole batches are kept or none, whatever is killed and when. Of
# their contents a hash is kept, too; a batch that is not as it was written is examined anew.

FORM = 1
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


SHORTEST = 1e-7
"""Joint motion [joint units] of a cell below which it is not halved: the leaf is singular there."""

LONE = 3.3
"""A root is looked for where it is the only one within this many times the bound of its distance from the predictor, so
that cells can be glued: the predictors of neighbours are apart by the sum of their bounds at most."""

SPREAD = 10.0
"""The radius of a tube, over eta, that a root alone in it needs: about `LONE` times 2 eta, and room."""

TUBE = 0.25
"""The radius of a tube at first, times omega."""

AIM = 0.33
"""What e, the change of [J; J_g] within a cell, is to be: the test ends at 1, and cells far below it are many."""

GRID = 2.0**-50
"""Bounds of boxes are whole multiples of it, and at most 1: their sums, differences and middles are exact."""

BATCH = 1024
"""Cells examined at once: 100 MB of intervals."""


FEW = 32
"""Cells examined at once where none was proven before: a place where the proof fails is then found soon."""


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

    @abstractmethod
    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """(k,) True for boxes that are of no use once the proof has failed at some places (piece, low)."""

    def order(self, boxes: Boxes, scarce: bool) -> Indices:
        """In which order they are tried: the smallest first, where it may fail; where they are too many, in theirs."""
        if scarce:
            return np.lexsort((boxes.low[:, 0], boxes.piece))
        return np.argsort(np.prod(boxes.high - boxes.low, axis=1), kind="stable")

    def learned(self) -> list[tuple[Vector, Vector]]:
        """Places and postures of the leaf that were found, of which the next ones are continued; here none."""
        return []

    @abstractmethod
    def goes_on(self, extent: Extent) -> bool:
        """Whether cells are of use where the proof of others ended so."""

    @abstractmethod
    def arranged(self, found: Covered) -> Covered:
        """The proven cells in order, those that count where the proof failed."""

    @abstractmethod
    def unglued(self, found: Covered) -> Flags:
        """(k,) True for cells whose root is not shown to be that of a neighbour where they meet."""

    @abstractmethod
    def connected(self, found: Covered) -> Covered:
        """All cells, or, where they are not all proven or glued, those that hang together with the first ones."""

    @abstractmethod
    def place(self, found: Covered) -> str:
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
    spent, proven_so_far, filled, batch, all_of_it = 0, 0, 0.0, BATCH, float(domain.shares(boxes.low, boxes.high).sum())
    left = boxes
    while len(left):
        if spent >= budget:
            stopped += _places(left)
            reasons += [Extent.BUDGET] * len(left)
            break
        scarce = budget - spent < len(left)
        if scarce:
            batch = min(batch, max(FEW, (budget - spent) // 8))  # so that what fails among them is halved in time
        order = domain.order(left, scarce)
        chosen = np.sort(order[: min(batch, budget - spent)])
        rest = np.ones(len(left), dtype=bool)
        rest[chosen] = False
        here, waiting = some(left, chosen), some(left, rest)
        spent += len(here)
        found = looked_up(domain, here, demands, kept_cells, lambda here=here: domain.joints(here))
        cells, kept = found.cells, found.kept
        done.append((some(here, kept), some(cells, kept), found.findings))
        proven_so_far += int(kept.sum())
        filled += float(domain.shares(here.low[kept], here.high[kept]).sum())
        batch = min(BATCH, FEW + 8 * int(kept.sum()))
        progress(proven_so_far, spent, filled / all_of_it)
        final = ~kept & (too_small(here, cells) | found.final)
        stopped += _places(some(here, final))
        reasons += reasons_of(found, final)
        _, again, _, parts = smaller(here, found, ~kept & ~final)
        left = joined(waiting, again, parts)
        if stopped:
            left = some(left, ~domain.beyond(left, stopped))
    all_boxes, all_cells, all_findings = (joined(*parts) for parts in zip(*done, strict=True))
    if not stopped:
        return Covered(all_boxes, all_cells, all_findings)
    first = min(range(len(stopped)), key=lambda i: stopped[i])
    return Covered(all_boxes, all_cells, all_findings, reasons[first], stopped[first])


def too_small(boxes: Boxes, cells: Cells) -> Flags:
    """(k,) which boxes are not halved any more: the joints hardly move over them."""
    finest = np.min(boxes.high - boxes.low, axis=1) < 8 * GRID
    return ~(np.linalg.norm(cells.reach, axis=1) > SHORTEST) | finest


def smaller(
    boxes: Boxes, found: Batch, failed: Flags, sides: Vector | None = None
) -> tuple[Indices, Boxes, Indices, Boxes]:
    """Of failed boxes: (those that are tried again, with narrower tubes; those that are halved, the lower and then the
    upper halves). sides: as of `halves`."""
    cells, d = found.cells, boxes.low.shape[1]
    shrink = 8.0 ** (-1 / d)  # eta is of third order, and one of d sides is halved
    need = np.where(found.rooted, SPREAD * found.eta, 0.0)
    usual = np.where(np.isfinite(found.omega), TUBE / np.clip(found.omega, 1e-3, 1e9), boxes.rho / 4)
    narrow = np.maximum(np.minimum(boxes.rho / 4, usual), need)
    half = np.clip(shrink * need, boxes.rho / 2, np.maximum(boxes.rho, usual))
    retried = failed & found.rooted & ~found.good & ~boxes.again & (narrow < 0.9 * boxes.rho)
    tried = Boxes(boxes.piece, boxes.low, boxes.high, narrow, np.ones(len(boxes), dtype=bool), cells.q0)
    rest = failed & ~retried
    return (
        np.flatnonzero(retried), some(tried, retried),
        np.flatnonzero(rest), halves(boxes, cells, half, rest, found.rooted, sides),
    )  # fmt: skip


def looked_up(
    domain: Domain, boxes: Boxes, demands: Demands, kept_cells: KeptCells, joints: Callable[[], Matrix]
) -> Batch:
    """The test of the cells of boxes, from joints (k, n) near their roots: as it was kept, or made now, and kept."""
    found = kept_cells.batch(boxes)
    if found is not None:
        domain.learned().extend(zip(found.places, found.joints, strict=True))
        return found
    before = len(domain.learned())
    cells = centred(domain.equation, joints(), domain.numbers(boxes), domain.c, boxes.rho)
    tested = examined(domain.equation, cells, domain.c, domain.slack)
    good = proven(tested)
    judged = demands.judged(cells, tested, good)
    new, d, n = domain.learned()[before:], domain.equation.d, domain.equation.n
    places = np.array([u for u, _ in new]).reshape(-1, d) if new else np.zeros((0, d))
    postures = np.array([q for _, q in new]) if new else np.zeros((0, n))
    kept = some(judged.findings, judged.good)
    found = Batch(cells, tested.omega, tested.eta, good, judged.good, judged.final, judged.near, kept, places, postures)
    kept_cells.keep(found)
    return found


def reasons_of(found: Batch, chosen: Flags) -> list[Extent]:
    """Why some cells are not as asked."""
    both = zip(found.good[chosen], found.near[chosen], strict=True)
    return [Extent.NEAR if near else Extent.LIMIT if good else Extent.SINGULAR for good, near in both]


def proven(found: Findings) -> Flags:
    """(k,) True where the test holds, with room for gluing."""
    return found.passed & (LONE * found.r <= found.alone)


def _places(boxes: Boxes) -> list[tuple[int, tuple[float, ...]]]:
    return [(int(p), tuple(low)) for p, low in zip(boxes.piece, boxes.low.tolist(), strict=True)]


def on_grid(values: Array) -> Array:
    """Bounds of boxes in [-1, 1], moved to multiples of 2^-24: 26 halvings lead from there to `GRID`."""
    return np.rint(np.asarray(values) * 2.0**24) * 2.0**-24


def halves(boxes: Boxes, cells: Cells, rho: Vector, chosen: Flags, sound: Flags, sides: Vector | None = None) -> Boxes:
    """Both halves of some boxes, cut across the parameter that moves the joints most; `sound` ones predict theirs.

    sides: (d,) those of a cell of the grid, by which a box without a root is cut.
    """
    k, wide = int(chosen.sum()), boxes.high[chosen] - boxes.low[chosen]
    moved = np.linalg.norm(cells.V[chosen], axis=1)
    known = np.isfinite(moved).all(axis=1, keepdims=True) & moved.any(axis=1, keepdims=True)
    axis = np.argmax(np.where(known, moved, wide if sides is None else wide / sides), axis=1)
    low, high = boxes.low[chosen], boxes.high[chosen]
    rows = np.arange(k)
    middle = (low[rows, axis] + high[rows, axis]) / 2
    upper, lower = low.copy(), high.copy()
    upper[rows, axis] = lower[rows, axis] = middle
    y = np.zeros_like(low)
    y[rows, axis] = 0.5
    of, known = some(cells, chosen), sound[chosen, None]
    return Boxes(
        np.tile(boxes.piece[chosen], 2), np.concatenate([low, upper]), np.concatenate([lower, high]),
        np.tile(rho[chosen], 2), np.zeros(2 * k, dtype=bool),
        np.concatenate([np.where(known, of.predicted(side), np.nan) for side in (-y, y)]),
    )  # fmt: skip
