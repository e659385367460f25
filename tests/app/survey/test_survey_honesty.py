"""A survey says what it asked: no case twice, the reason of its faults, any file that is none; servers may die."""

from __future__ import annotations

import multiprocessing.forkserver
import os
import signal
import sqlite3
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.app.survey import Findings, Store, run_survey
from holokin.app.survey.cases import Cases
from holokin.app.survey.engine import TRIES
from holokin.base.errors import SurveyError
from survey_laws import planar, rows_of

CIRCLE = hk.circle([0.2, 0.1, 0.0], center=[0.1, 0.1, 0.0])


def distinct(found: Findings) -> int:
    """Cases that differ in what happened or in what they were asked."""
    return len(set(found.columns["id"].tolist()))


@pytest.mark.parametrize(
    ("asked", "starts", "expected"), [(200, None, 2), (7, {"random": 5}, 8), (40, {"random": 3}, 8)]
)
def test_a_given_loop_is_asked_once_of_each_law_and_start_however_many_cases_are_wanted(
    asked: int, starts: dict | None, expected: int, caplog: pytest.LogCaptureFixture
) -> None:
    found = hk.survey(
        ["planar-3r"], {"pinv": hk.moore_penrose, "lock": {"kind": "best-lock"}}, {"circle": CIRCLE},
        starts=starts, cases=asked, cycles=1, samples=20, workers=0,
    )  # fmt: skip
    assert len(found) == distinct(found) <= expected
    assert (f"only {len(found):,} of {asked} cases differ" in caplog.text) is (len(found) < asked)
    drifts = found.of_law("pinv").known("drift")
    assert len(set(drifts.tolist())) == len(drifts)
    assert found.table()[1][0][9] == "", "a quantile of a few cases"


def test_drawn_and_given_loops_share_the_cases_and_the_given_ones_stay_single() -> None:
    rng = np.random.default_rng(3)
    for asked in rng.integers(1, 400, 12).tolist():
        table = planar(
            laws={"pinv": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"}}, cases=int(asked),
            loops={"mine": {"kind": "given", "key": "x"}, "drawn": {"kind": "circle", "size": (0.05, 0.3)}},
        )  # fmt: skip
        cases = list(Cases(table, Path()))
        assert len({case.id for case in cases}) == len(cases)
        assert asked <= len(cases) <= asked + 2
        assert sum(case.names["loop"] == "mine" for case in cases) <= 2 * len(Cases(table, Path())._starts)
        assert Cases(table, Path()).fewer == ""


def test_a_survey_whose_cases_all_fail_says_why() -> None:
    def broken(task: hk.Task) -> hk.Strategy:
        raise ZeroDivisionError("no law today")

    found = hk.survey(["planar-3r"], {"broken": broken}, {"circle": CIRCLE}, cycles=1, samples=20, workers=0)
    said = "1 of 1 cases are faults; the first, broken on planar-3r: ZeroDivisionError: no law today"
    assert said in str(found)
    assert said in found._repr_html_()


@pytest.mark.campaign
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no fork servers")
def test_a_run_outlives_the_server_that_forks_its_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is killed twice while the cases run, which no case is blamed for; the rows are those of a quiet run."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    table = planar(loops={"circle": {"kind": "circle", "size": (0.05, 0.3), "count": 12}}, samples=60)
    run_survey(table, tmp_path, tmp_path / "quiet.sqlite", workers=0)
    server, over, killed = multiprocessing.forkserver._forkserver, threading.Event(), []  # type: ignore[attr-defined]

    def kill() -> None:
        while not over.wait(0.7):
            if (pid := server._forkserver_pid) is not None and pid not in killed and len(killed) < TRIES - 1:
                killed.append(pid)
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        done = run_survey(table, tmp_path, tmp_path / "killed.sqlite", workers=2)
    finally:
        over.set()
        thread.join()
    assert killed
    assert done.done == done.total
    quiet, found = ([{k: v for k, v in row.items() if k != "seconds"} for row in rows_of(tmp_path / f"{name}.sqlite")]
                    for name in ("quiet", "killed"))  # fmt: skip
    assert [row["id"] for row in found] == [row["id"] for row in quiet]
    assert [row["status"] for row in found] == [row["status"] for row in quiet]


@pytest.mark.skipif(not hasattr(os, "setuid") or os.name == "nt", reason="it reads as another user")
def test_results_where_nobody_can_write_are_read(tmp_path: Path) -> None:
    """By a child that is another user, in a folder and of a file that it may only read."""
    folder = tmp_path / "archive"
    folder.mkdir()
    run_survey(planar(), tmp_path, folder / "rows.sqlite", workers=0)
    for place, mode in ((folder / "rows.sqlite", 0o444), (folder, 0o555)):
        place.chmod(mode)
    above = tmp_path
    while above != above.parent and not above.stat().st_mode & 0o001:
        above.chmod(above.stat().st_mode | 0o055)
        above = above.parent
    count = len(rows_of(folder / "rows.sqlite"))
    assert not list(folder.glob("*-wal")), "a journal stands beside the results"
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.setuid(65534)
            with Store.opened(folder / "rows.sqlite", None) as store:
                os.write(writing, str(len(list(store.rows()))).encode())
        except BaseException as problem:  # noqa: BLE001  it is told
            os.write(writing, repr(problem).encode())
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    os.close(writing)
    folder.chmod(0o755)
    with closing(os.fdopen(reading, "rb")) as pipe:
        assert pipe.read().decode() == str(count)


def test_what_is_no_results_file_is_refused_in_a_sentence(tmp_path: Path, holokin: Command) -> None:
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as db:
        db.execute("CREATE TABLE songs (title TEXT)")
        db.commit()
    imitation = tmp_path / "imitation.sqlite"
    with closing(sqlite3.connect(imitation)) as db:
        db.execute("CREATE TABLE survey (form INTEGER, fingerprint TEXT, version TEXT, folder TEXT, content TEXT)")
        db.execute("INSERT INTO survey VALUES (2, 'x', '0', '.', '{}')")
        db.commit()
    good = tmp_path / "good.sqlite"
    run_survey(planar(), tmp_path, good, workers=0)
    cut = tmp_path / "cut.sqlite"
    cut.write_bytes(good.read_bytes()[:5000])
    (tmp_path / "text.sqlite").write_text("a,b,c\n1,2,3\n")
    (tmp_path / "empty.sqlite").write_bytes(b"")
    (tmp_path / "folder.sqlite").mkdir()
    for name in ("other", "imitation", "cut", "text", "empty", "folder", "missing"):
        found = holokin("survey", "report", tmp_path / f"{name}.sqlite")
        assert found.code == 2, (name, found)
        assert found.err.startswith("error: ") and found.err.count("\n") <= 1, (name, found.err)
        assert "Traceback" not in found.err
    with pytest.raises(SurveyError), Store.opened(other, planar(), resume=True):
        time.sleep(0)
