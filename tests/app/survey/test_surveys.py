"""Surveys: a case is one row whatever happens to it, and to those who run it."""

from __future__ import annotations

import multiprocessing.forkserver
import os
import signal
import sqlite3
import threading
import tomllib
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.app.job import Job, run_job
from holokin.app.survey import Findings, Store, repeated, run_survey
from holokin.app.survey.cases import Cases
from holokin.app.survey.engine import TRIES
from holokin.base.errors import FileError, HolokinError, JobError, WriteError
from survey_laws import PLANAR, planar, rows_of

HERE = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("survey") / "planar.sqlite"
    run_survey(planar(), file.parent, file, workers=0)
    return file


def test_every_case_has_one_row_and_the_laws_do_what_they_are_known_for(undisturbed: Path) -> None:
    with Store.opened(undisturbed, None) as store:
        found = Findings.of(store.rows())
    assert len(found) == len(Cases(planar(), Path())) == 2 * (3 + 1) * 2
    assert set(found.columns["id"]) == {case.id for case in Cases(planar(), Path())}
    lock, pinv = found.of_law("lock"), found.of_law("pinv")
    assert lock.known("drift_mean").max() < 1e-12
    circles = pinv.where(pinv.columns["loop"] == "circle").known("drift_mean")
    assert circles.min() > 1e-5
    assert pinv.known("cost") == pytest.approx(1.0, abs=1e-3)
    assert lock.known("cost").min() > 0.999


def test_the_drift_of_a_case_is_that_of_the_job_that_repeats_it(undisturbed: Path) -> None:
    cases = Cases(planar(), undisturbed.parent)
    with Store.opened(undisturbed, None) as store:
        rows = list(store.rows())
    for number in (0, 1, 6):
        job = Job.model_validate(tomllib.loads(repeated(cases, cases.case(number))[0]))
        result = run_job("case", job, undisturbed).strategies[0]
        row = rows[number]
        assert result.metrics["drift_mean"] == pytest.approx(row["drift_mean"], rel=1e-9, abs=1e-13)
        assert result.cycles.tracking_error("m") == pytest.approx(row["tracking"], rel=1e-6, abs=1e-12)


def test_a_case_is_told_by_what_it_is_and_not_by_its_place() -> None:
    first = {case.id: case for case in Cases(planar(), Path())}
    more = planar(loops=PLANAR["loops"] | {"square": {"kind": "square", "size": 0.1}}, title="others", cases=40)
    again = {case.id for case in Cases(more, Path())}
    assert set(first) <= again and len(first) == 16
    assert not set(first) & {case.id for case in Cases(planar(samples=41), Path())}
    assert not set(first) & {case.id for case in Cases(planar(seed=1), Path())}


def test_a_robot_file_that_changed_makes_other_cases(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    text = (Path(hk.__file__).parent / "robot" / "data" / "planar-3r.toml").read_text()
    ids = []
    for written in (text, text + "\n# another\n"):
        file.write_text(written)
        ids.append({case.id for case in Cases(planar(robots=["arm.toml"]), tmp_path)})
    assert not ids[0] & ids[1]


def test_loops_are_closed_begin_at_the_tool_and_have_their_size() -> None:
    loops = {
        kind: {"kind": kind, "size": 0.2, "count": 4}
        for kind in ("circle", "square", "figure-eight", "raster", "smooth")
    }
    table = planar(robots=["panda"], loops=loops, laws={"pinv": {"kind": "moore-penrose"}}, cycles=1, samples=200)
    cases = Cases(table, Path())
    from holokin.app.survey import one_case as running

    sizes: dict[str, list[float]] = {}
    normals, arm = [], hk.load("panda")
    for case in cases:
        if case.start["kind"] == "random":
            continue
        start = running.start_of(case, Path())
        tool = arm.pose(start)[:3, 3]
        path = running._path(case, hk.position(arm), start, Path())
        points = path.at(np.linspace(0, path.duration, 200)).position
        assert path.closed and np.abs(points[0] - tool).max() < 1e-9
        sizes.setdefault(case.names["loop"], []).append(
            float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
        )
        normals.append(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2])
    for kind, found in sizes.items():
        assert found == pytest.approx([0.2] * 4, rel=0.12), kind
    assert np.linalg.matrix_rank(np.array(normals), tol=0.2) == 3


def test_a_robot_that_does_not_load_is_a_reason_in_its_rows(tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<robot")
    out = tmp_path / "r.sqlite"
    table = planar(robots=["bad.urdf", "none.urdf", "planar-3r", {"name": "ur5e", "tip": "nowhere"}])
    run_survey(table, tmp_path, out, workers=0)
    reasons = {str(row["robot"]): str(row["reason"]) for row in rows_of(out)}
    assert reasons["planar-3r"] == ""
    assert (
        "bad.urdf" in reasons["bad.urdf"]
        and "no such file" in reasons["none.urdf"]
        and "nowhere" in reasons["ur5e nowhere"]
    )


def test_resuming_does_only_what_is_missing(undisturbed: Path, tmp_path: Path) -> None:
    out = tmp_path / "part.sqlite"
    out.write_bytes(undisturbed.read_bytes())
    with sqlite3.connect(out) as db:
        db.execute("DELETE FROM cases WHERE number % 3 = 1")
        left = db.execute("SELECT COUNT(*) FROM cases").fetchone()[0]
    with pytest.raises(FileError, match="--resume"):
        run_survey(planar(), tmp_path, out, workers=0)
    done = run_survey(planar(), tmp_path, out, workers=0, resume=True)
    assert (done.resumed, done.done, done.total) == (left, 16, 16)
    assert rows_of(out) == rows_of(undisturbed)


def test_results_of_another_survey_are_refused(undisturbed: Path, tmp_path: Path) -> None:
    for changed in ({"cycles": 3}, {"seed": 5}, {"robots": ["panda"]}):
        with pytest.raises(FileError, match="another survey"):
            run_survey(planar(**changed), tmp_path, undisturbed, workers=0, resume=True)


@pytest.mark.campaign
def test_a_full_disk_stops_the_survey_and_keeps_what_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite says the same where a file may have no more pages as where the disk has no more room."""
    out = tmp_path / "full.sqlite"
    opened = sqlite3.connect

    def small(*args: Any, **kwargs: Any) -> sqlite3.Connection:
        db = opened(*args, **kwargs)
        db.execute("PRAGMA max_page_count = 7")
        return db

    table = planar(loops={"circle": {"kind": "circle", "size": 0.1, "count": 30}}, samples=10, cycles=1)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    monkeypatch.setattr("holokin.base.sqlite_file.sqlite3.connect", small)
    with pytest.raises(WriteError):
        run_survey(table, tmp_path, out, workers=0)
    monkeypatch.setattr("holokin.base.sqlite_file.sqlite3.connect", opened)
    kept = len(rows_of(out))
    assert 0 < kept < 120
    assert run_survey(table, tmp_path, out, workers=0, resume=True).resumed == kept
    assert len(rows_of(out)) == 120


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"laws": {"a": {"kind": "moore-penros"}}}, "[laws.a.kind] is 'moore-penros'; did you mean 'moore-penrose'"),
        ({"laws": {"a": {"kind": "lock", "joint": ["q1"]}}}, "[laws.a.joint] is an unknown key"),
        ({"laws": {"a": {"kind": "closed-loop", "of": "b"}}}, "laws.a.of"),
        ({"loops": {"c": {"kind": "circle"}}}, "neither size nor share says how large it is"),
        ({"loops": {"c": {"kind": "circle", "size": 0.1, "share": 0.1}}}, "size and share both say how large it is"),
        ({"loops": {"c": {"kind": "circle", "size": (0.2, 0.1)}}}, "no range"),
        ({"starts": {"regular": 0}}, "asks for no start posture"),
        ({"samples": 100_000, "cycles": 100}, "give fewer samples or cycles"),
        ({"robots": []}, "at least 1"),
        ({"unknown": 1}, "[unknown] is an unknown key"),
    ],
)
def test_a_survey_that_makes_no_sense_is_refused_in_a_sentence(change: dict[str, Any], words: str) -> None:
    with pytest.raises(JobError) as caught:
        planar(**change)
    assert words in str(caught.value)


def test_a_pattern_that_fits_no_robot_is_refused(tmp_path: Path) -> None:
    for name in ("nothing-*", "nothing/*.urdf"):
        with pytest.raises(HolokinError, match="nothing"):
            run_survey(planar(robots=[name]), tmp_path, tmp_path / "n.sqlite", workers=0)


def test_cases_in_total_are_spread_evenly() -> None:
    table = planar(robots=["planar-3r", "panda", "iiwa14"], cases=120)
    cases = list(Cases(table, Path()))
    assert len(cases) == 120 and len({case.id for case in cases}) == 120
    for name in ("planar-3r", "panda", "iiwa14"):
        assert sum(case.names["robot"] == name for case in cases) == 40
    assert [case.number for case in cases] == list(range(120))


# --- A survey says what it asked: no case twice, the reason of its faults, any file that is none; servers may die.


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
    (tmp_path / "text.sqlite").write_text("no database at all, but long enough to be read as one by mistake " * 20)
    (tmp_path / "empty.sqlite").write_bytes(b"")
    (tmp_path / "folder.sqlite").mkdir()
    for name in ("other", "imitation", "cut", "text", "empty", "folder", "missing"):
        found = holokin("survey", "report", tmp_path / f"{name}.sqlite")
        assert found.code == 2, (name, found)
        assert found.err.startswith("error: ") and found.err.count("\n") <= 1, (name, found.err)
        assert "Traceback" not in found.err
    for name in ("other", "text"):
        with pytest.raises(FileError):
            run_survey(planar(), tmp_path, tmp_path / f"{name}.sqlite", workers=0, resume=True)
