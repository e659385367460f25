"""Where results go: no file is overwritten, and what fails or is stopped leaves nothing half-written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import Command, assert_refused, assert_untouched, write_job
from holokin.app.job import read_job

pytestmark = pytest.mark.usefixtures("sketched")  # what is written when is the statement, not what is drawn


def test_results_are_not_written_into_a_file(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "out"
    file.write_text("keep me")
    assert_refused(holokin("run", write_job(tmp_path), "--out", file), "the output folder", "cannot be made")
    assert file.read_text() == "keep me"


def test_a_folder_of_somebody_else_is_left_alone(holokin: Command, tmp_path: Path, out: Path) -> None:
    foreign = out / "job"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("years of work")
    assert_refused(holokin("run", write_job(tmp_path), "--out", out), str(foreign), "not one of holokin's", "--out")
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]
    assert [entry.name for entry in foreign.iterdir()] == ["thesis.tex"]


def test_a_new_job_never_overwrites_a_file(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("keep me")
    assert_refused(holokin("new", file), "mine.toml", "exists already")
    assert file.read_text() == "keep me"
    assert_refused(holokin("new", tmp_path / "job.txt"), "job.txt", ".toml")
    assert_refused(holokin("new", tmp_path / "no" / "job.toml"), "job.toml", "cannot be written")
    assert_refused(holokin("new", tmp_path / "job.toml", "--from", "panda-circel"), "did you mean 'panda-circle'")
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.toml"]
    outcome = holokin("new", tmp_path / "job.toml")
    assert (outcome.code, outcome.err) == (0, "")
    assert read_job(tmp_path / "job.toml").robot.name == "panda"


def test_an_expectation_that_fails_exits_1_with_the_report_whole(holokin: Command, tmp_path: Path, out: Path) -> None:
    expect = "[expect.moore-penrose]\nholonomic = true\ntracking = { below = 1e-3 }\n"
    outcome = holokin("run", write_job(tmp_path, expect=expect), "--out", out)
    assert (outcome.code, outcome.err) == (1, "")
    assert "FAILED" in outcome.out
    assert "expected holonomic true, found false" in outcome.out
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]
    facts = json.loads((out / "job" / "result.json").read_text())
    assert facts["passed"] is False
    checks = {check["metric"]: check["passed"] for check in facts["strategies"][0]["checks"]}
    assert checks == {"completes": True, "holonomic": False, "tracking": True}
    assert "FAILED" in (out / "job" / "report.html").read_text().rpartition("</html>")[0]
    assert len(list((out / "job").glob("*.csv"))) == 3


@pytest.mark.parametrize(
    "moment",
    ["holokin.app.job.runner.involutivity", "holokin.app.job.runner.follow", "holokin.app.report.job_report._page"],
)
def test_ctrl_c_exits_130_and_leaves_nothing_half_written(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    def interrupted(*_arguments: object, **_named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(moment, interrupted)
    outcome = holokin("run", write_job(tmp_path), "--out", out)
    assert outcome.code == 130
    assert "Traceback" not in outcome.err + outcome.out
    assert outcome.err.startswith("stopped") and outcome.err.count("\n") == 1
    assert_untouched(out)


def test_ctrl_c_in_the_second_job_leaves_the_first_report_whole(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import holokin.app.report.job_report as report

    write_page, pages = report._page, []

    def interrupted(*arguments: object) -> str:
        pages.append(arguments)
        if len(pages) > 1:
            raise KeyboardInterrupt
        return write_page(*arguments)

    monkeypatch.setattr(report, "_page", interrupted)
    files = [write_job(tmp_path, f"{name}.toml") for name in ("first", "second")]
    outcome = holokin("run", *files, "--out", out)
    assert outcome.code == 130
    assert str(out / "first") in outcome.out.replace("\n", "")
    assert sorted(entry.name for entry in out.iterdir()) == ["first", "mine.txt"]
    before = {entry.name: entry.read_bytes() for entry in (out / "first").iterdir()}
    assert {"report.html", "result.json"} <= set(before)
    assert holokin("run", files[0], "--out", out).code == 130  # the old report outlives a new one that is stopped
    assert {entry.name: entry.read_bytes() for entry in (out / "first").iterdir()} == before
