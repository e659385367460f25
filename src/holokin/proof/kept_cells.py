"""The batches of cells that a proof has examined, kept in an SQLite file: a proof that was stopped goes on with them.

A batch is found again by its boxes and by all batches before it, so that a proof that goes on examines the same cells
in the same order, and ends with the same certificate. Whole batches are kept or none, whatever is killed and when. Of
their contents a hash is kept, too; a batch that is not as it was written is examined anew.
"""

from __future__ import annotations

import hashlib
import io
import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import ArgumentError, WriteError
from ..base.types import Flags, Matrix, Value, Vector
from ..version import __version__
from .certificate import Boxes
from .tube import Cells, Findings

FORM = 1
"""Of the file; a later form is another number."""

ANOTHER = "give another file, or delete it"


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
        if file.is_dir():
            raise ArgumentError("the file of cells", str(file), "it is a folder: give a file")
        asked, db = hashlib.sha256(json.dumps(question(), sort_keys=True).encode()).hexdigest(), None
        try:
            with _system(file):
                file.parent.mkdir(parents=True, exist_ok=True)
                db = sqlite3.connect(file, timeout=10.0)
                _check(db, file, asked)
                db.execute("PRAGMA journal_mode = WAL")
                db.execute("PRAGMA synchronous = NORMAL")
            yield cls(file, db)
        except sqlite3.DatabaseError as problem:
            raise ArgumentError("the file of cells", str(file), f"it holds none ({problem}): {ANOTHER}") from None
        finally:
            if db is not None:
                db.close()

    def batch(self, boxes: Boxes) -> Batch | None:
        """That of boxes that come next, where it was kept; the next ones are asked for, or kept, after it."""
        if self._db is None or self._file is None:
            return None
        parts = [np.ascontiguousarray(getattr(boxes, f.name)).tobytes() for f in fields(boxes)]
        self._chain = hashlib.sha256(b"".join([self._chain, *parts])).digest()
        with _system(self._file):
            found = self._db.execute("SELECT hash, data FROM batches WHERE key = ?", (self._chain.hex(),)).fetchone()
        if found is None or hashlib.sha256(found[1]).hexdigest() != found[0]:
            return None
        self.resumed += len(boxes)
        return Batch.unpacked(found[1])

    def keep(self, batch: Batch) -> None:
        """Keep that of the boxes that were asked for last. Raises: WriteError."""
        if self._db is None or self._file is None:
            return
        data = batch.packed()
        row = (self._chain.hex(), len(batch.good), hashlib.sha256(data).hexdigest(), data)
        with _system(self._file), self._db:
            self._db.execute("INSERT OR REPLACE INTO batches VALUES (?, ?, ?, ?)", row)


def count_kept(file: Path) -> int:
    """Cells that a file keeps; 0 where it is none."""
    try:
        db = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)
        try:
            return int(db.execute("SELECT COALESCE(SUM(cells), 0) FROM batches").fetchone()[0])
        finally:
            db.close()
    except sqlite3.DatabaseError:
        return 0


def remove_kept(file: Path) -> None:
    """Delete a file of cells, with what SQLite may have put beside it."""
    for one in (file, *(file.with_name(f"{file.name}-{end}") for end in ("wal", "shm"))):
        one.unlink(missing_ok=True)


def _check(db: sqlite3.Connection, file: Path, asked: str) -> None:
    """Raises: ArgumentError: it is of another question, or of another version."""
    names = {name for (name,) in db.execute("SELECT name FROM sqlite_master")}
    if not names:
        with db:
            db.execute("BEGIN IMMEDIATE")
            db.execute("CREATE TABLE proof (form INTEGER, question TEXT, version TEXT)")
            db.execute("CREATE TABLE batches (key TEXT PRIMARY KEY, cells INTEGER, hash TEXT, data BLOB)")
            db.execute("INSERT INTO proof VALUES (?, ?, ?)", (FORM, asked, __version__))
        return
    if "proof" not in names:
        raise ArgumentError("the file of cells", str(file), f"it is of another program: {ANOTHER}")
    found = db.execute("SELECT form, question, version FROM proof").fetchone()
    if found is None or (found[0], found[2]) != (FORM, __version__):
        raise ArgumentError("the file of cells", str(file), f"it is of another version of holokin: {ANOTHER}")
    if found[1] != asked:
        cure = f"it is of another robot, strategy, start, box, shapes or clearance: {ANOTHER}"
        raise ArgumentError("the file of cells", str(file), cure)


@contextmanager
def _system(file: Path) -> Iterator[None]:
    """What the system refuses becomes a typed error; batches that are written stay."""
    try:
        yield
    except (sqlite3.OperationalError, OSError) as problem:
        raise WriteError(file, OSError(str(problem))) from problem
