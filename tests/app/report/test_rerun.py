"""Several jobs in one command, and a folder of results that is written again: nothing of anybody's is lost."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from conftest import SOUND, Command, assert_refused, assert_untouched, write_job
from sketches import Sketch

pytestmark = pytest.mark.usefixtures("sketched")  # what is written when is the statement, not what is drawn

SINGULAR = {
    "robot": '[robot]\nname = "planar-3r"\n',
    "start": "[start]\nq = [0.0, 0.0, 0.0]\n",
    "path": '[path]\nkind = "polyline"\npoints = [[0, 0], [-1, 0]]\nrelative = true\nsamples = 20\n',
}
"""A job that is sound to read and singular where it starts."""


def test_jobs_of_one_name_are_refused_before_anything_runs(holokin: Command, tmp_path: Path, out: Path) -> None:
    files = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        files.append(write_job(tmp_path / name, "j.toml"))
    assert_refused(holokin("run", *files, "--out", out), str(files[0]), str(files[1]), "one folder")
    assert_untouched(out)
    loud = write_job(tmp_path, "J.toml")
    assert_refused(holokin("run", files[0], loud, "--out", out), "one folder")  # one folder where J is j


def test_one_job_named_twice_runs_once(holokin: Command, tmp_path: Path, out: Path) -> None:
    file = write_job(tmp_path)
    outcome = holokin("run", file, file, "--out", out)
    assert (outcome.code, outcome.out.count("a circle")) == (0, 1)


def test_a_job_that_cannot_start_does_not_stop_the_others(holokin: Command, tmp_path: Path, out: Path) -> None:
    files = [write_job(tmp_path, "first.toml", **SINGULAR), write_job(tmp_path, "second.toml")]
    outcome = holokin("run", *files, "--out", out)
    assert outcome.code == 2
    assert outcome.err.startswith("error: first: ") and outcome.err.count("\n") == 1
    assert "singular" in outcome.err
    assert "second" in outcome.out
    assert sorted(entry.name for entry in out.iterdir()) == ["mine.txt", "second"]


def test_a_failed_expectation_beside_a_failed_job_is_bad_input(holokin: Command, tmp_path: Path, out: Path) -> None:
    expect = {"expect": "[expect.moore-penrose]\nholonomic = true\n"}
    files = [write_job(tmp_path, "first.toml", **expect), write_job(tmp_path, "second.toml", **SINGULAR)]
    assert holokin("run", *files, "--out", out).code == 2
    assert holokin("run", files[0], "--out", out).code == 1


def test_a_folder_that_cannot_be_used_is_refused_before_computing(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def computed(*_arguments: object) -> None:
        raise AssertionError("it computed first")

    monkeypatch.setattr("holokin.app.job.run_job", computed)
    first, second = write_job(tmp_path, "first.toml"), write_job(tmp_path, "second.toml")
    (out / "second").mkdir()
    (out / "second" / "result.json").write_text('{"mine": true}')  # a file of that name is not enough
    assert_refused(holokin("run", first, second, "--out", out), "second", "not one of holokin's")
    assert_refused(holokin("run", first, "--out", out / "mine.txt"), "mine.txt", "not a folder", "--out")
    assert_refused(holokin("run", first, "--out", out / "mine.txt" / "deeper"), "mine.txt", "not a folder")
    assert not (out / "first").exists()
    (out / "first").symlink_to(tmp_path)
    assert_refused(holokin("run", first, "--out", out), "first", "not one of holokin's")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_refused_before_computing(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    out.chmod(0o555)
    assert_refused(holokin("run", write_job(tmp_path), "--out", out), "may not be written")
    out.chmod(0o755)


@pytest.mark.campaign
def test_a_rerun_keeps_what_others_have_put_into_its_folder(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write_job(tmp_path)
    assert holokin("run", file, "--out", out, "--animate").code == 0
    folder = out / "job"
    assert (folder / "paths.mp4").is_file()
    (folder / "notes.txt").write_text("keep me")
    (folder / "photos").mkdir()
    (folder / "photos" / "arm.jpg").write_text("keep me too")
    (folder / "report.html").write_text("an old report")
    cycles = SOUND["path"] + "cycles = 2\n"
    monkeypatch.setattr("holokin.app.report.job_report.figures", lambda _result: [("cycles", "a sketch", Sketch())])
    (folder / "cycles.png").write_text("mine, under a name that holokin needs next")
    assert holokin("run", write_job(tmp_path, path=cycles), "--out", out).code == 0
    assert (folder / "notes.txt").read_text() == "keep me"
    assert (folder / "photos" / "arm.jpg").read_text() == "keep me too"
    assert (folder / "cycles.png.kept").read_text().startswith("mine")
    assert (folder / "cycles.png").read_bytes() == b"a sketch"
    assert "an old report" not in (folder / "report.html").read_text("utf-8")
    assert not (folder / "paths.mp4").exists()  # of the run before, and holokin's own
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]


def test_ctrl_c_in_the_middle_of_a_swap_leaves_the_folder_whole(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the two renames: the old report stands where it stood, with what others put there."""
    file = write_job(tmp_path)
    assert holokin("run", file, "--out", out).code == 0
    (out / "job" / "notes.txt").write_text("keep me")
    before = (out / "job" / "report.html").read_bytes()
    rename = os.rename

    def interrupted(source: Path, target: Path) -> None:
        rename(source, target)
        if Path(target).parent.name == "old":
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "rename", interrupted)
    assert holokin("run", file, "--out", out).code == 130
    assert (out / "job" / "notes.txt").read_text() == "keep me"
    assert (out / "job" / "report.html").read_bytes() == before
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]


def test_an_orientation_named_twice_is_refused(holokin: Command, tmp_path: Path, out: Path) -> None:
    task = '[task]\nkind = "pose"\norientation = ["rpy", "rpy"]\n'
    assert_refused(holokin("run", write_job(tmp_path, task=task), "--out", out), "names one twice")
    assert_untouched(out)
