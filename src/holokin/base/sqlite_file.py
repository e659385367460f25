"""SQLite files that grow while something runs: what is committed survives a kill, others may read meanwhile."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Literal

from .errors import HolokinError, WriteError

BUSY = 10.0
"""Seconds to wait for another process that writes to the same file: a write takes milliseconds."""

PAUSE = 0.005
"""Seconds between two tries of what SQLite does not wait for."""


@contextmanager
def sqlite_file(file: Path, mode: Literal["write", "read", "frozen"]) -> Iterator[sqlite3.Connection]:
    """The connection to an SQLite file, closed at the end.

    Args:
        mode: "write" makes the file where there is none. "read" needs one; on media that cannot be written it is read
            as it lies there. "frozen" reads it so at once, and makes no file beside it.

    Raises:
        sqlite3.DatabaseError: it is none, or the system refuses it.
    """
    place, frozen = file.absolute().as_uri(), mode == "frozen"
    if mode == "read":
        try:
            with closing(sqlite3.connect(f"{place}?mode=rw", timeout=BUSY, uri=True)) as db:
                db.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            frozen = True
    options = "mode=ro&immutable=1" if frozen else "mode=rwc" if mode == "write" else "mode=rw"
    with closing(sqlite3.connect(f"{place}?{options}", timeout=BUSY, uri=True)) as db:
        yield db


@contextmanager
def table_file(
    file: Path,
    head: str,
    version: Mapping[str, object],
    broken: Callable[[str], HolokinError],
    make: Callable[[sqlite3.Connection], None] | None = None,
) -> Iterator[sqlite3.Connection]:
    """The connection to a file of this library, which says its version in the only row of a table.

    Args:
        head: that table.
        version: its columns of this version of the library, with their values.
        broken: the error for a file that is something else, made of the fact.
        make: creates the tables where the file is new or empty; without it the file is read alone.

    Raises:
        WriteError: the system refuses the file. HolokinError: what `broken` makes.
    """
    if file.is_dir():
        raise broken("it is a folder")
    with ExitStack() as opened:
        try:
            with writing_rows(file):
                db = opened.enter_context(sqlite_file(file, "write" if make else "read"))
                if make and not _tables(db):
                    with db:
                        db.execute("BEGIN IMMEDIATE")
                        if not _tables(db):  # no other process was quicker
                            make(db)
            tables = _tables(db)
            if head not in tables:
                raise broken("it is of another program" if tables else "it is empty")
            row = db.execute(f"SELECT {', '.join(version)} FROM {head}").fetchone()
            if row != tuple(version.values()):
                raise broken("it is of another version of holokin")
            if make:
                with writing_rows(file):
                    _let_others_read(db)
            yield db
        except sqlite3.DatabaseError as problem:
            raise broken(str(problem)) from None


def _let_others_read(db: sqlite3.Connection) -> None:
    """Keep the rows that are written apart until they are whole (WAL). SQLite itself does not wait here for others."""
    until = time.monotonic() + BUSY
    while True:
        try:
            db.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as problem:
            if problem.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                raise
            time.sleep(PAUSE)
        else:
            return


def _tables(db: sqlite3.Connection) -> set[str]:
    return {name for (name,) in db.execute("SELECT name FROM sqlite_master")}


@contextmanager
def writing_rows(file: Path) -> Iterator[None]:
    """What the system refuses becomes a `WriteError`; rows that are written stay."""
    try:
        yield
    except (sqlite3.OperationalError, OSError) as problem:
        raise WriteError(file, OSError(str(problem))) from problem
