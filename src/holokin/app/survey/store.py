"""The rows of a survey in an SQLite file: whole rows or none, each once, whatever is killed and when.

SQLite of the standard library, and not Parquet: a row that is committed survives `kill -9`, a case has one row by its
key, one file holds it all while it grows, and pandas reads it.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from ...base.arguments import typed
from ...base.errors import ArgumentError, FileError
from ...base.sqlite_file import table_file, writing_rows
from ...motion.trajectory import Trajectory
from ...version import __version__
from .cases import Case, Cases
from .one_case import METRICS, Row, repeat_case
from .survey_file import SurveyTable

NAMES = ("robot", "task", "loop", "law")
COLUMNS = ("id", "number", *NAMES, "status", "reason", "seconds", *METRICS)
FORM = 2
"""Of the file; a later form is another number."""

KINDS: dict[str, tuple[type, ...]] = {"number": (int,), **dict.fromkeys(("id", *NAMES, "status", "reason"), (str,))}
"""Of the values of columns; the others hold numbers, or nothing."""


def fingerprint(table: SurveyTable) -> str:
    """A hash of what a survey asks; not of its title, of how many cases, or of how long one may take."""
    aside = {"title", "about", "cases", "time_limit"} | (set() if table.metrics else {"metrics"})
    content = table.model_dump(mode="json", exclude=aside)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


class Store:
    """An open results file. Only the process that opened it writes."""

    def __init__(self, file: Path, connection: sqlite3.Connection) -> None:
        self.file = file
        self._db = connection

    @classmethod
    @contextmanager
    def opened(
        cls, file: Path, table: SurveyTable | None, folder: Path = Path(), *, resume: bool = False
    ) -> Iterator[Store]:
        """A results file, made for a survey where it is not there; for reading alone without a table.

        Raises:
            FileError: it is there already and resume is False; it is of another survey, or no results file.
            WriteError: the system refuses it.
        """
        # Whether the file is what is asked for.
        new = not file.exists()
        if table is None and new:
            raise FileError(file, "there is no such file", "run the survey first")
        if table is not None and not new and not file.is_dir() and not resume:
            cure = "say --resume, in Python resume=True, to go on, or delete it"
            raise FileError(file, "holds results already", cure)

        def broken(fact: str) -> FileError:
            cure = "give another file, as out/arms.sqlite, or run the survey anew"
            return FileError(file, f"is no results file of a survey ({fact})", cure)

        make = None if table is None else lambda db: _make(db, table, folder)
        with table_file(file, "survey", {"form": FORM}, broken, make) as db:
            if table is not None and db.execute("SELECT fingerprint FROM survey").fetchone() != (fingerprint(table),):
                cure = "give another file with --out, in Python out="
                raise FileError(file, "holds the results of another survey", cure)
            yield cls(file, db)

    @cached_property
    def _own(self) -> tuple[str, ...]:
        """The metrics of the user's own, which have a column each."""
        return tuple(self.content().metrics)

    @property
    def _columns(self) -> tuple[str, ...]:
        return (*COLUMNS, *self._own)

    def add(self, rows: Sequence[Row], faults: Mapping[int, str] = MappingProxyType({})) -> None:
        """Keep rows: all of them or none. One that is there stays as it is, unless it is a fault.

        Args:
            faults: number of a case -> id of the row that its row takes the place of, though the id is another one now.

        Raises:
            WriteError.
        """
        columns = self._columns
        marks = ", ".join("?" * len(columns))
        new = ", ".join(f"{_quoted(name)} = excluded.{_quoted(name)}" for name in columns[1:])
        values = []
        for row in rows:
            facts = [row.id, row.number, *(row.names[name] for name in NAMES), row.status, row.reason, row.seconds]
            values.append([*facts, *(row.metrics.get(metric) for metric in (*METRICS, *self._own))])
        gone = [(faults[row.number],) for row in rows if row.number in faults]
        with writing_rows(self.file), self._db:
            self._db.executemany("DELETE FROM cases WHERE id = ? AND status = 'fault'", gone)
            self._db.executemany(
                f"INSERT INTO cases VALUES ({marks}) ON CONFLICT (id) DO UPDATE SET {new} WHERE status = 'fault'",
                values,
            )

    def done(self, *, faults: bool = True) -> set[str]:
        """The ids of the cases that have a row, with or without those that are faults."""
        which = "" if faults else " WHERE status <> 'fault'"
        return {case for (case,) in self._db.execute(f"SELECT id FROM cases{which}")}

    def faults(self) -> dict[int, str]:
        """Number -> id of the cases that are faults."""
        return dict(self._db.execute("SELECT number, id FROM cases WHERE status = 'fault'"))

    def most_frequent_fault(self) -> tuple[str, int, int]:
        """(its reason, how many have it, how many faults there are in all)."""
        asked = "SELECT reason, COUNT(*) FROM cases WHERE status = 'fault' GROUP BY reason ORDER BY 2 DESC, 1"
        reasons = self._db.execute(asked).fetchall()
        return (*reasons[0], sum(count for _, count in reasons)) if reasons else ("", 0, 0)

    def __len__(self) -> int:
        return int(self._db.execute("SELECT COUNT(*) FROM cases").fetchone()[0])

    def rows(self) -> Iterator[dict[str, object]]:
        """All rows, by the number of the case: column -> value."""
        cursor = self._db.execute(f"SELECT {', '.join(map(_quoted, self._columns))} FROM cases ORDER BY number")
        for values in cursor:
            yield self._row(values)

    def _row(self, values: Sequence[object]) -> dict[str, object]:
        """Column -> value, each of its kind: SQLite keeps any value in any column. Raises: FileError."""
        row = dict(zip(self._columns, values, strict=True))
        for name, value in row.items():
            kinds = KINDS.get(name, (float, int, type(None)))
            if not isinstance(value, kinds):
                fact = f"has a row whose {name} is {str(value)[:40]!r}, which no survey writes"
                raise FileError(self.file, fact, "run the survey anew")
        return row

    def row_of(self, case: str) -> dict[str, object]:
        """The row of a case by its id, or by its number. Raises: ArgumentError: there is none."""
        columns = ", ".join(map(_quoted, self._columns))
        values = self._db.execute(f"SELECT {columns} FROM cases WHERE id = ?", (case,)).fetchone()
        # Of a number that SQLite does not hold.
        if values is None and case.isdecimal() and len(case) < 19:
            values = self._db.execute(f"SELECT {columns} FROM cases WHERE number = ?", (int(case),)).fetchone()
        if values is None:
            cure = f"give the id of one of the {len(self):,} rows, or its number, from 0"
            raise ArgumentError("the case", case, cure)
        return self._row(values)

    def folder(self) -> Path:
        """From which files of robots counted."""
        (name,) = self._db.execute("SELECT folder FROM survey").fetchone()
        if not isinstance(name, str) or "\0" in name:
            raise FileError(self.file, "names no folder that its robots are in", "run the survey anew")
        return Path(name)

    def content(self) -> SurveyTable:
        """The survey that the results are of."""
        (text,) = self._db.execute("SELECT content FROM survey").fetchone()
        try:
            return SurveyTable.model_validate_json(text)
        except ValueError:
            fact = "is no results file of this version: the survey in it cannot be read"
            raise FileError(self.file, fact, "run the survey anew") from None


def _make(db: sqlite3.Connection, table: SurveyTable, folder: Path) -> None:
    """Create the tables of a survey."""
    kinds = {"id": "TEXT PRIMARY KEY", "number": "INTEGER NOT NULL"}
    kinds |= dict.fromkeys((*NAMES, "status", "reason"), "TEXT NOT NULL")
    columns = ", ".join(f"{name} {kinds.get(name, 'REAL')}" for name in (*COLUMNS, *map(_quoted, table.metrics)))
    db.execute("CREATE TABLE survey (form INTEGER, fingerprint TEXT, version TEXT, folder TEXT, content TEXT)")
    db.execute(f"CREATE TABLE cases ({columns}) WITHOUT ROWID")
    content = json.dumps(table.model_dump(mode="json", exclude_unset=True))
    facts = (FORM, fingerprint(table), __version__, str(folder), content)
    db.execute("INSERT INTO survey VALUES (?, ?, ?, ?, ?)", facts)


def _quoted(name: str) -> str:
    """A column as SQLite reads it; no name of a column has a quotation mark."""
    return f'"{name}"'


# --- One case of a results file again, with its own law: what a job cannot do.


@typed
def repeat(results: str | Path, case: str | int) -> tuple[Trajectory, str]:
    """Run a case of a survey again, in this process: control laws, too.

    Args:
        results: the .sqlite file of a survey. case: the id of a case, or its number.

    Returns:
        (what the joints did, why it stopped; empty where it went round all cycles).

    Raises:
        FileError: no results file. ArgumentError: no such case, or it is of objects of a survey in Python.
        HolokinError: what the row of the case gives as its reason.
    """
    with Store.opened(Path(results), None) as store:
        cases, chosen = case_of(store, str(case))
    return repeat_case(chosen, cases)


def case_of(store: Store, case: str) -> tuple[Cases, Case]:
    """(the cases of a survey, the one of an id or a number). Raises: ArgumentError: there is none."""
    cases, row = Cases(store.content(), store.folder()), store.row_of(case)
    chosen = cases.of_row(row)
    if chosen is None:
        raise ArgumentError("the case", case, "the survey asks it no more: take another one, or run the survey anew")
    return cases, chosen
