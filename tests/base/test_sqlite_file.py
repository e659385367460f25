"""Kept SQLite files: what is not ours is refused and stays as it is; two processes make a file once."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, closing
from pathlib import Path
from typing import Any

import pytest

from holokin.base.errors import FileError, WriteError
from holokin.base.sqlite_file import table_file


def make(db: sqlite3.Connection) -> None:
    db.execute("CREATE TABLE head (form INTEGER)")
    db.execute("CREATE TABLE rows (value INTEGER)")
    db.execute("INSERT INTO head VALUES (2)")


def opened(file: Path, **more: Any) -> AbstractContextManager[sqlite3.Connection]:
    return table_file(file, "head", {"form": 2}, lambda fact: FileError(file, fact, "give another"), **more)


@pytest.mark.parametrize(
    ("script", "fact"),
    [
        ("CREATE TABLE songs (title TEXT)", "another program"),
        ("CREATE TABLE head (form INTEGER); INSERT INTO head VALUES (1)", "another version"),
        ("CREATE TABLE head (form INTEGER)", "another version"),
        ("CREATE TABLE head (shape INTEGER)", "no such column"),
        (b"a letter to somebody that is longer than the head of such a file" * 4, "not a database"),
    ],
)
@pytest.mark.parametrize("writing", [False, True])
def test_a_file_of_something_else_is_refused_and_left_alone(
    tmp_path: Path, script: str | bytes, fact: str, writing: bool
) -> None:
    file = tmp_path / "a b?#.sqlite"
    if isinstance(script, bytes):
        file.write_bytes(script)
    else:
        with closing(sqlite3.connect(file)) as db:
            db.executescript(script)
    before = file.read_bytes()
    with pytest.raises(FileError, match=fact), opened(file, make=make if writing else None):
        pass
    assert file.read_bytes() == before and list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("trial", range(10))
def test_one_file_made_by_many_at_once_is_made_once_and_keeps_all_rows(tmp_path: Path, trial: int) -> None:
    file = tmp_path / f"rows{trial}.sqlite"

    def add(value: int) -> None:
        with opened(file, make=make) as db, db:
            db.execute("INSERT INTO rows VALUES (?)", (value,))

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(add, range(12)))
    with opened(file) as db:
        assert sorted(db.execute("SELECT value FROM rows")) == [(k,) for k in range(12)]
        assert db.execute("SELECT COUNT(*) FROM head").fetchone() == (1,)


def test_reading_makes_no_file_and_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WriteError), opened(tmp_path / "none.sqlite"):
        pass
    with pytest.raises(FileError, match="folder"), opened(tmp_path):
        pass
    assert not list(tmp_path.iterdir())
