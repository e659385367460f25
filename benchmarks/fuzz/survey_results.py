"""Results files of surveys: broken bytes, odd values, lost columns and rows, read as report, case and --resume do."""

from __future__ import annotations

import json
import random
import sqlite3
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.fuzz.jobs import broken
from holokin.app.survey import Findings, Store, repeated, run_survey, write_survey_report
from holokin.app.survey.store import case_of
from holokin.app.survey.survey_file import read_survey
from holokin.base.errors import HolokinError

SURVEY = """title = "Arms"
robots = ["planar-3r"]
cycles = 2
samples = 10
cases = 4
[tasks.position]
kind = "position"
[starts]
regular = 2
[loops.circle]
kind = "circle"
size = 0.1
[laws.p]
kind = "moore-penrose"
[laws.l]
kind = "lock"
joints = ["joint1"]
"""

_VALUES: tuple[Any, ...] = (
    None, "", "x", "planar-3r", "fault", "complete", "<b>", "a\0b", "x" * 5000, "日本", 0, -1, 1, 2**62, 0.5, -0.5,
    1e300, float("inf"), b"", b"\xff\x00", "{}", "[]", "null", "NaN",
)  # fmt: skip


@cache
def _sound() -> bytes:
    """A results file of a few cases, in one process."""
    with tempfile.TemporaryDirectory() as folder:
        file, results = Path(folder) / "arms.toml", Path(folder) / "arms.sqlite"
        file.write_text(SURVEY, "utf-8")
        run_survey(read_survey(file), Path(folder), results, workers=0)
        db = sqlite3.connect(results)
        db.execute("PRAGMA journal_mode = DELETE")  # all of it in the file
        db.close()
        return results.read_bytes()


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed: each way of reading it that is refused leaves the others to be tried."""
    chance, results, survey = random.Random(seed), folder / "arms.sqlite", folder / "arms.toml"
    survey.write_text(SURVEY, "utf-8")
    if chance.random() < 0.35:
        results.write_bytes(broken(_sound(), chance))
    else:
        results.write_bytes(_sound())
        _spoil(results, chance)
    refusals = []
    for read in (
        _reported,
        _repeated,
        lambda file: run_survey(read_survey(survey), folder, file, workers=0, resume=True),
    ):
        try:
            read(results)
        except HolokinError as problem:
            refusals.append(problem)
    if refusals:
        raise refusals[0]


def _spoil(results: Path, chance: random.Random) -> None:
    """One or two changes that SQLite takes: of a value, a column, a row, a table, or the survey in it."""
    db = sqlite3.connect(results)
    for _ in range(chance.choice((1, 1, 2))):
        table = chance.choice(("cases", "cases", "survey"))
        columns = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
        if not columns:
            continue
        column, value, kind = chance.choice(columns), chance.choice(_VALUES), chance.random()
        try:
            if kind < 0.5:
                one = "" if chance.random() < 0.5 else " WHERE number = 1" * (table == "cases")
                db.execute(f"UPDATE {table} SET {column} = ?{one}", (value,))
            elif kind < 0.6:
                db.execute(f"ALTER TABLE {table} DROP COLUMN {column}")
            elif kind < 0.7:
                db.execute(f"ALTER TABLE {table} ADD COLUMN extra")
            elif kind < 0.75:
                db.execute(f"DELETE FROM {table}")
            elif kind < 0.8:
                db.execute(f"DROP TABLE {table}")
            else:
                db.execute("UPDATE survey SET content = ?", (_content(db, chance),))
        except sqlite3.DatabaseError:  # a key that may not be twice, a number that may not be missing
            continue
    db.commit()
    db.close()


def _content(db: sqlite3.Connection, chance: random.Random) -> str:
    """The survey in the file with one value changed."""
    found = json.loads(db.execute("SELECT content FROM survey").fetchone()[0])
    at = found
    while isinstance(at, dict) and at:
        key = chance.choice(list(at))
        if not isinstance(at[key], dict) or chance.random() < 0.3:
            at[key] = chance.choice([value for value in _VALUES if not isinstance(value, bytes)])
            break
        at = at[key]
    return json.dumps(found)


def _reported(results: Path) -> None:
    with Store.opened(results, None) as store:
        survey, folder, found = store.content(), store.folder(), Findings.of(store.rows())
    write_survey_report(survey, folder, found, results.with_suffix(".html"))
    str(found)


def _repeated(results: Path) -> None:
    with Store.opened(results, None) as store:
        cases, found = case_of(store, "1")
    repeated(cases, found)
