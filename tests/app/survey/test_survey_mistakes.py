"""What users get wrong with surveys: it is said before anything runs, in words, and leaves nothing behind."""

from __future__ import annotations

import shutil
import sqlite3
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, sampled
from holokin.app.job import Job, run_job
from holokin.app.survey import Findings, Store, read_survey, repeat, run_survey, write_survey_report
from holokin.app.survey.cases import Cases
from holokin.app.survey.one_case import Row
from holokin.app.survey.resumable_run import check_laws
from holokin.app.survey.store import NAMES
from holokin.base.errors import ArgumentError, FileError, HolokinError, JobError, MissingExtraError
from survey_laws import CIRCLES, rows_of

ARM = Path(hk.__file__).parent / "robot" / "data" / "planar-3r.toml"


@pytest.fixture(autouse=True)
def _plain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


def survey_file(folder: Path, laws: str, more: str = "") -> Path:
    """A survey of three cases of a robot file that lies beside it."""
    shutil.copy(ARM, folder / "arm.toml")
    text = CIRCLES.replace("planar-3r", "arm.toml").replace("count = 12", "count = 1")
    file = folder / "s.toml"
    file.write_text(text.partition("[laws.")[0] + laws + more)
    return file


def test_a_control_law_is_repeated_in_python_and_its_job_says_that_it_is_not_it(
    holokin: Command, tmp_path: Path
) -> None:
    file = survey_file(tmp_path, '[laws.d]\nkind = "damped"\n[laws.lock]\nkind = "best-lock"\n')
    out = tmp_path / "s.sqlite"
    run_survey(read_survey(file), tmp_path, out, workers=0)
    with Store.opened(out, None) as store:
        rows = list(store.rows())
    for row in rows:
        walk, reason = repeat(out, str(row["id"]))
        assert reason == row["reason"] == ""
        assert float(np.abs(walk.drift()).max()) == pytest.approx(row["drift"], rel=1e-9, abs=1e-13)
    told = holokin("survey", "case", out, "0")
    job = tomllib.loads(told.out)
    assert rows[0]["law"] == "d" and list(job["strategies"]) == ["moore-penrose"]
    for words in (job["about"], told.err):
        assert "do not run control laws" in words and "repeat(" in words
    same = holokin("survey", "case", out, "1")
    assert "about" not in tomllib.loads(same.out) and same.err == ""
    assert tomllib.loads(same.out)["robot"]["name"] == str(tmp_path / "arm.toml")
    result = run_job("case", Job.model_validate(tomllib.loads(same.out)), Path("/nowhere/case.toml")).strategies[0]
    assert result.metrics["drift_mean"] == pytest.approx(rows[1]["drift_mean"], abs=1e-13)


LAW = "import holokin as hk\n\n\ndef mine(task, start):\n    return hk.holonomic(task, hk.lock({joint}))\n"


@pytest.mark.campaign
def test_a_law_of_a_module_beside_the_survey_file_is_found_by_every_process(tmp_path: Path) -> None:
    """Also where a survey in another folder had a module of the same name; the path of Python is as it was."""
    drifts = []
    for joint, workers in ((0, 0), (1, 0), (1, 1)):
        folder = tmp_path / f"{joint}{workers}"
        folder.mkdir()
        (folder / "survey_own_law.py").write_text(LAW.format(joint=joint))
        file = survey_file(folder, '[laws.mine]\nkind = "import"\nfunction = "survey_own_law:mine"\n')
        before = list(sys.path)
        done = run_survey(read_survey(file), folder, folder / "s.sqlite", workers=workers)
        assert done.faults == 0 and sys.path == before
        drifts.append([row["joint_path"] for row in rows_of(folder / "s.sqlite")])
    assert drifts[0] != drifts[1] == drifts[2]


@pytest.mark.parametrize(
    ("laws", "error", "words"),
    [
        ('kind = "import"\nfunction = "survey_laws:pseudo_invrse"', ArgumentError, "cannot be imported"),
        ('kind = "import"\nfunction = "survey_laws:PLANAR"', ArgumentError, "is no function"),
        ('kind = "import"\nfunction = "nowhere_at_all:law"', ArgumentError, "nowhere_at_all"),
        ('kind = "pink"', ArgumentError, "whole poses alone"),
        ('kind = "placo"\n[tasks.pose]\nkind = "pose"', MissingExtraError, "holokin[placo]"),
    ],
)
def test_a_law_that_no_case_could_have_is_refused_before_anything_runs(
    laws: str, error: type[HolokinError], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "placo", None)
    file = survey_file(tmp_path, f"[laws.bad]\n{laws}\n")
    with pytest.raises(error) as told:
        run_survey(read_survey(file), tmp_path, tmp_path / "s.sqlite", workers=0)
    assert words in str(told.value) and not (tmp_path / "s.sqlite").exists()


def test_a_library_is_refused_for_positions_unless_these_are_left_out(tmp_path: Path) -> None:
    both = (
        '[laws.p]\nkind = "pink"\n[laws.d]\nkind = "damped"\n[tasks.at]\nkind = "position"\n[tasks.on]\nkind = "pose"\n'
    )
    check = lambda file: check_laws(Cases(read_survey(file), tmp_path))  # noqa: E731
    with pytest.raises(ArgumentError, match="whole poses"):
        check(survey_file(tmp_path, both))
    check(survey_file(tmp_path, both, '[[without]]\nlaw = "p"\ntask = "at"\n'))


def test_wrong_arguments_leave_no_results_file(tmp_path: Path) -> None:
    table, out = read_survey(survey_file(tmp_path, '[laws.d]\nkind = "damped"\n')), tmp_path / "s.sqlite"
    with pytest.raises(ArgumentError, match="give 0 to"):
        run_survey(table, tmp_path, out, workers=-1)
    with pytest.raises(FileError, match="is a folder"):
        run_survey(table, tmp_path, tmp_path, workers=0, resume=True)
    assert not out.exists()


@pytest.mark.campaign
def test_rows_of_a_robot_file_that_was_another_one_are_counted(holokin: Command, tmp_path: Path) -> None:
    file, out = survey_file(tmp_path, '[laws.lock]\nkind = "best-lock"\n'), tmp_path / "s.sqlite"
    ran = holokin("survey", file, "--out", out, "--workers", "0")
    assert ran.code == 0 and "more rows" not in ran.out
    count = len(rows_of(out))
    arm = tmp_path / "arm.toml"
    arm.write_text(arm.read_text() + "\n# another one\n")
    resumed = holokin("survey", file, "--out", out, "--workers", "0", "--resume")
    assert f"{count} more rows are of cases that the survey no longer has" in resumed.out
    assert len(rows_of(out)) == 2 * count
    again = holokin("survey", file, "--out", tmp_path / "new.sqlite", "--workers", "0")
    assert f"{count} cases, 0 faults" in again.out and "more rows" not in again.out


@pytest.mark.campaign
@sampled(1, "workers", [0, 1])
def test_a_law_whose_file_has_changed_is_run_again(workers: int, tmp_path: Path) -> None:
    """In this process, too, which had imported it before; the report tells of the old rows."""
    own = '[laws.own]\nkind = "import"\nfunction = "mylaw:law"\n'
    file, out, law = survey_file(tmp_path, own), tmp_path / "s.sqlite", tmp_path / "mylaw.py"
    text = "import holokin as hk\ndef law(task, start):\n    return {}\n"
    drifts = []
    for of in ("hk.moore_penrose(task)", "hk.holonomic(task, hk.lock(1))"):
        law.write_text(text.format(of))
        done = run_survey(read_survey(file), tmp_path, out, workers=workers, resume=out.exists())
        assert done.resumed == 0
        drifts.append([row["drift"] for row in rows_of(out) if row["status"] == "complete"])
    assert done.stale == len(drifts[0]) > 0
    assert min(drifts[0]) > 1e-6 and sorted(drifts[1])[: len(drifts[0])] < [1e-9] * len(drifts[0])
    with Store.opened(out, None) as store:
        write_survey_report(store.content(), store.folder(), Findings.of(store.rows()), tmp_path / "r.html")
    assert f"{done.stale} of the rows are of cases that the survey no longer has" in (tmp_path / "r.html").read_text()


def test_rows_of_cases_that_are_asked_no_more_are_counted_once(tmp_path: Path) -> None:
    """A survey of fewer cases leaves rows; two names of one law share a row."""
    text = CIRCLES.partition("[laws.")[0].replace("count = 12", "count = 4") + '[laws.a]\nkind = "moore-penrose"\n'
    file, out = tmp_path / "s.toml", tmp_path / "s.sqlite"
    file.write_text(text)
    assert run_survey(read_survey(file), tmp_path, out, workers=0).stale == 0
    rows = len(rows_of(out))
    file.write_text(f"cases = {rows // 2}\n{text}")
    fewer = run_survey(read_survey(file), tmp_path, out, workers=0, resume=True)
    assert fewer.stale == rows - fewer.total > 0
    twice, both = tmp_path / "twice.toml", tmp_path / "twice.sqlite"
    twice.write_text(text + '[laws.b]\nkind = "moore-penrose"\n')
    for resume in (False, True):
        assert run_survey(read_survey(twice), tmp_path, both, workers=0, resume=resume).stale == 0


def test_the_cases_of_a_robot_of_parts_are_others_when_the_file_of_a_part_is(tmp_path: Path) -> None:
    file = survey_file(tmp_path, '[laws.p]\nkind = "moore-penrose"\n')
    file.write_text(file.read_text().replace('"arm.toml"', '{ parts = [{ name = "arm.toml" }] }'))
    out = [tmp_path / "a.sqlite", tmp_path / "b.sqlite"]
    run_survey(read_survey(file), tmp_path, out[0], workers=0)
    arm = tmp_path / "arm.toml"
    arm.write_text(arm.read_text().replace("a = 1\n", "a = 0.8\n", 1))
    run_survey(read_survey(file), tmp_path, out[1], workers=0)
    before, after = (rows_of(name) for name in out)
    assert not {row["id"] for row in before} & {row["id"] for row in after}
    assert before[0]["drift"] != after[0]["drift"] and before[0]["status"] == after[0]["status"] == "complete"


@pytest.mark.campaign
def test_faults_are_done_again_when_what_caused_them_is_cured(holokin: Command, tmp_path: Path) -> None:
    """Here a robot file that did not load: as a file that was not copied, or a disk that was away."""
    law = '[laws.lock]\nkind = "best-lock"\n'
    file = survey_file(tmp_path, law)
    file.write_text(file.read_text().replace('"arm.toml"', '"arm.toml", "planar-3r"'))
    arm, out = tmp_path / "arm.toml", tmp_path / "s.sqlite"
    whole = arm.read_text()
    arm.unlink()
    ran = holokin("survey", file, "--out", out, "--workers", "0")
    assert ran.code == 0 and "2 of 2 faults: " in ran.out and "no such file" in ran.out and "--again" in ran.out
    resumed = holokin("survey", file, "--out", out, "--workers", "0", "--resume")
    assert "4 cases, 4 of them before, 2 faults" in resumed.out
    arm.write_text(whole)
    with sqlite3.connect(out) as db:  # and one whose robot is as it was
        db.execute("UPDATE cases SET status = 'fault' WHERE robot = 'planar-3r' AND number % 2 = 0")
    done = holokin("survey", file, "--out", out, "--workers", "0", "--again")
    assert "4 cases, 1 of them before, 3 faults done again, 0 faults" in done.out and "--again" not in done.out
    rows = rows_of(out)
    assert [row["number"] for row in rows] == [0, 1, 2, 3] and {row["status"] for row in rows} == {"complete"}
    with Store.opened(out, None) as store:
        names = {name: str(rows[0][name]) for name in NAMES}
        store.add([Row(str(rows[0]["id"]), 0, names, "fault", "late")])
    assert rows_of(out) == rows


def test_files_of_the_other_kind_say_what_runs_them(holokin: Command, tmp_path: Path) -> None:
    survey = survey_file(tmp_path, '[laws.d]\nkind = "damped"\n')
    job = tmp_path / "job.toml"
    assert holokin("new", job).code == 0
    ran, asked = holokin("run", survey, "--out", tmp_path / "out"), holokin("survey", job)
    assert ran.code == asked.code == 2
    assert f"run it: holokin survey {survey}" in ran.err
    assert f"run it: holokin run {job}" in asked.err


def test_a_file_can_neither_name_nor_see_what_only_python_can_give(tmp_path: Path) -> None:
    laws, loop = '[laws.d]\nkind = "damped"\n', '[loops.other]\nkind = "{}"\nkey = "loop:a"\n'
    files = [
        (loop.format("given"), "[loops.other.kind] is 'given'"), (loop.format("circel"), "did you mean 'circle'"),
        ('[laws.x]\nkind = "given"\nkey = "law:a"\n', "[laws.x.kind] is 'given'"),
        ('[laws.x]\nkind = "gven"\n', "[laws.x.kind] is 'gven'"),
    ]  # fmt: skip
    for more, words in files:
        with pytest.raises(JobError) as told:
            read_survey(survey_file(tmp_path, laws, more))
        assert words in str(told.value)
        assert "given" not in str(told.value).partition("known: ")[2]


def test_loops_and_laws_that_python_cannot_mean_are_refused_before_anything_runs() -> None:
    circle, law = {"kind": "circle", "size": 0.1}, hk.moore_penrose
    opened = hk.polyline([[0, 0, 0], [0.1, 0, 0]])
    for loop, words in (("circle", "a closed path"), (opened, "an open path"), ({"kind": "given"}, "object itself")):
        with pytest.raises(ArgumentError, match=words):
            hk.survey(["planar-3r"], {"a": law}, {"l": loop}, workers=0)
    for wrong in ("moore-penrose", {"kind": "given", "key": "law:a"}):
        with pytest.raises(ArgumentError):
            hk.survey(["planar-3r"], {"a": wrong}, {"l": circle}, workers=0)


def test_a_certificate_that_is_not_there_is_said_in_words(holokin: Command, tmp_path: Path) -> None:
    pytest.importorskip("flint")
    ran = holokin("check-certificate", tmp_path / "nothere.json")
    assert ran.code == 2 and "there is no such file" in ran.err and "Errno" not in ran.err


@pytest.mark.parametrize("change", [
    "UPDATE cases SET drift = 'x'", "UPDATE cases SET reason = x'ff'", "UPDATE cases SET number = 'x'",
    "UPDATE survey SET folder = x'ff'", "UPDATE survey SET folder = NULL",
])  # fmt: skip
def test_a_results_file_with_a_value_of_another_kind_is_refused(change: str, tmp_path: Path) -> None:
    """SQLite keeps any value in any column."""
    out = tmp_path / "s.sqlite"
    table = read_survey(survey_file(tmp_path, '[laws.p]\nkind = "moore-penrose"\n'))
    with Store.opened(out, table, tmp_path) as store:
        names: dict[str, str] = dict.fromkeys(NAMES, "x")
        store.add([Row("0a", 0, names, "complete", "")])
    with sqlite3.connect(out) as db:
        db.execute(change)
    with Store.opened(out, None) as store, pytest.raises(FileError):
        store.folder()
        list(store.rows())
