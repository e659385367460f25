"""Killed, stopped, out of space, out of luck: what a command leaves behind, and with what exit code it ends."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from benchmarks import kills
from benchmarks.kills import deadly, hidden, state

import holokin as hk
from conftest import PPR_CENTER, PPR_START, Command, assert_refused, assert_untouched, sampled, write_job
from forked import forked, start
from holokin.app.report.job_result import check_folder, renewed
from holokin.base.errors import WriteError
from holokin.base.files import aside, replacing
from sketches import SKETCHED

pytestmark = pytest.mark.usefixtures("sketched")


def command(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, for what comes at the end of one."""
    setup = f"{SKETCHED}import sys; sys.argv[1:] = {[str(a) for a in arguments]!r}\n"
    code = f"{setup}from holokin.app.cli.main import main; main()"
    return subprocess.run([sys.executable, "-c", code], text=True, timeout=120, check=False, **options)  # type: ignore[call-overload]


# --- the disk refuses ---


def limit(size: int) -> Callable[[], None]:
    """No file may be larger [bytes], for a child of this process; Python would cut off the bytecode that it keeps."""

    def limited() -> None:
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    return limited


def test_a_limit_on_file_sizes_spares_the_old_results_and_the_other_jobs(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    files = [write_job(tmp_path, f"{name}.toml") for name in ("first", "second")]
    assert holokin("run", *files, "--out", out).code == 0
    before = state(out)
    limited = forked("run", *files, "--out", out, before=limit(3_000))
    assert limited.code == 2
    assert "Traceback" not in limited.err
    for name, said in zip(("first", "second"), limited.err.splitlines(), strict=True):
        assert said.startswith(f"error: {name}: {out / name}{os.sep}")
        assert "cannot be written: File too large" in said
    assert state(out) == before


@pytest.mark.campaign
def test_a_full_standard_output_costs_the_table_and_not_the_report(tmp_path: Path, out: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = command("run", write_job(tmp_path), "--out", out, stdout=full, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("error: the standard output cannot be written: No space left on device")
    assert (out / "job" / "result.json").is_file()


@pytest.mark.campaign
def test_a_reader_that_goes_away_is_no_error(tmp_path: Path, out: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    done = command("run", write_job(tmp_path), "--out", out, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")
    assert (out / "job" / "result.json").is_file()


def test_what_is_no_plain_file_in_an_old_folder_moves_to_the_new_one_unread(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    file = write_job(tmp_path)
    assert holokin("run", file, "--out", out).code == 0
    os.mkfifo(out / "job" / "pipe")
    (out / "job" / "locked.txt").write_text("mine")
    (out / "job" / "locked.txt").chmod(0)
    (out / "job" / "nowhere").symlink_to("no/such/file")
    there = {name: (out / "job" / name).lstat().st_ino for name in ("pipe", "locked.txt", "nowhere")}
    assert holokin("run", file, "--out", out).code == 0
    assert {name: (out / "job" / name).lstat().st_ino for name in there} == there
    assert hidden(out) == []


def test_a_move_that_is_refused_leaves_the_old_folder_as_it_was(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write_job(tmp_path)
    assert holokin("run", file, "--out", out).code == 0
    for name in ("a.txt", "b.txt"):
        (out / "job" / name).write_text("mine")
    before, rename = state(out), os.rename

    def refused(source: Path, target: Path) -> None:
        if Path(source).name == "b.txt" and "old" in Path(source).parts:
            raise PermissionError(errno.EACCES, "Permission denied")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refused)
    assert_refused(holokin("run", file, "--out", out), "b.txt", "cannot be written", "Permission denied")
    assert state(out) == before


# --- one file ---


def test_a_file_is_replaced_whole_or_stays(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("old")
    file.chmod(0o640)
    with pytest.raises(KeyError), replacing(file) as part:
        part.write_text("ha")
        raise KeyError
    assert file.read_text() == "old"
    (tmp_path / "link").symlink_to(file)
    with replacing(tmp_path / "link") as part:
        part.write_text("new")
        assert file.read_text() == "old"
    assert (file.read_text(), file.stat().st_mode & 0o777, (tmp_path / "link").is_symlink()) == ("new", 0o640, True)
    with pytest.raises(WriteError, match="File exists"), replacing(file, new=True):
        pass
    with pytest.raises(WriteError, match="Is a directory"), replacing(tmp_path):
        pass
    with replacing("/dev/null") as part:
        assert part == Path("/dev/null")
    assert sorted(os.listdir(tmp_path)) == ["a.txt", "link"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three rounds of a circle."""
    file = tmp_path_factory.mktemp("logs") / "log.csv"
    circle = hk.circle(hk.load("ppr").pose(PPR_START)[:3, 3], PPR_CENTER)
    hk.follow(hk.moore_penrose(hk.position(hk.load("ppr"))), circle, PPR_START, samples=40, cycles=3).save(file)
    return file


@pytest.mark.campaign
@sampled(1,
    ("arguments", "wanted"),
    [(["new", "a.toml"], "a.toml"), (["audit", "log.csv", "--robot", "ppr", "--json", "a.json"], "a.json"),
     (["audit", "log.csv", "--robot", "ppr", "--plot", "a.png"], "a.png")],
)  # fmt: skip
def test_a_file_that_outgrows_the_limit_leaves_nothing(
    log: Path, tmp_path: Path, arguments: list[str], wanted: str
) -> None:
    """Where the old file had lain 2,048 of 2,894 bytes were left, or none."""
    shutil.copy(log, tmp_path)
    done = forked(*arguments, folder=tmp_path, before=limit(512))
    assert done.code == 2, done.err
    assert f"error: {wanted} cannot be written: File too large" in done.err
    assert done.err.count("error: ") == 1
    assert os.listdir(tmp_path) == ["log.csv"]


def test_two_processes_do_not_clear_each_others_unfinished_files(tmp_path: Path) -> None:
    with aside(tmp_path) as mine:
        (mine / "half").write_text("a half")
        subprocess.run(
            [sys.executable, "-c", f"from holokin.base.files import *; clear(Path({str(tmp_path)!r}))"], check=True
        )
        assert (mine / "half").read_text() == "a half"
    assert os.listdir(tmp_path) == []


def test_only_hidden_folders_of_our_own_form_are_cleared(holokin: Command, tmp_path: Path, out: Path) -> None:
    for name in (".holokin-mine", ".holokin-0123456789abcdeg", ".job-abc-old"):
        (out / name).mkdir()
    (out / ".holokin-0123456789abcdef").write_text("a file")
    kept = hidden(out)
    (out / ".holokin-00000000000000ff" / "new").mkdir(parents=True)
    assert holokin("run", write_job(tmp_path), "--out", out).code == 0
    assert hidden(out) == kept


# --- kill -9 at every rename ---


def filled(out: Path, files: dict[str, str]) -> None:
    """What a run does with its folder."""
    with renewed(out, "job") as work:
        for name, text in (files | {"result.json": json.dumps({"files": ["result.json", *files]})}).items():
            with replacing(work / name) as part:
                part.write_text(text)


def dies(out: Path, files: dict[str, str], k: int, after: bool) -> bool:
    """True when a child that does it was killed by itself at its k-th rename, before or after it."""
    child = os.fork()
    if child == 0:
        deadly(k, after)
        try:
            filled(out, files)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -9


@pytest.mark.campaign
@pytest.mark.parametrize("after", [False, True])
@sampled(1, "repair", ["the same job", "another job", "killed, too"])
def test_killed_at_any_rename_nothing_is_lost_and_the_next_run_clears_up(out: Path, after: bool, repair: str) -> None:
    old, new = {"report.html": "old", "old.csv": "old"}, {"report.html": "new", "new.csv": "new"}
    mine = {"notes.txt": "mine", "arm.jpg": "mine too"}
    filled(out, old)
    for name, text in mine.items():
        (out / "job" / name).write_text(text)
    for k in range(1, 30):
        if not dies(out, new, k, after):
            break
        found = {path.name: path.read_text() for path in out.rglob("*") if path.is_file()}
        assert mine.items() <= found.items()
        if (out / "job").exists():
            assert {n: t for n, t in contents(out).items() if n not in (*mine, "result.json")} in (old, new)
        if repair == "killed, too":
            for again in range(1, 4):  # while it brings back what the other left
                dies(out, new, again, after)
        check_folder(out, "job" if repair == "the same job" else "other")
        assert hidden(out) == []
        assert {n: t for n, t in contents(out).items() if n != "result.json"} in (old | mine, new | mine)
        filled(out, old)
        assert {n: t for n, t in contents(out).items() if n != "result.json"} == old | mine
    assert 6 <= k < 29
    assert hidden(out) == []


def contents(out: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in (out / "job").iterdir()}


@pytest.mark.campaign
def test_a_signal_at_a_random_moment_loses_nothing(holokin: Command, tmp_path: Path) -> None:
    """Ctrl-C here, a kill by `benchmarks.kills --quick` in tests/benchmarking, hundreds without --quick."""
    assert holokin("run", kills.job(tmp_path, "first"), "--out", tmp_path / "out").code == 0
    kills.keep(tmp_path / "out" / "job")
    ended, faults = kills.trial(signal.SIGINT, (True, 0.1), tmp_path, 1)
    assert faults == [], ended


def test_a_run_in_the_gap_of_another_keeps_what_is_the_users(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One process has moved the old folder away and waits; another does the same job, and then the first ends."""
    file = write_job(tmp_path)
    assert holokin("run", file, "--out", out).code == 0
    (out / "job" / "notes.txt").write_text("mine")
    gap, go, rename = os.pipe(), os.pipe(), os.rename

    def slow(a: Path, b: Path) -> None:
        rename(a, b)
        if "old" in str(b):
            os.write(gap[1], b"gap")
            os.read(go[0], 1)

    one = start("run", file, "--out", out, before=lambda: setattr(os, "rename", slow))
    os.close(gap[1])  # so that the end of that process would be heard
    assert os.read(gap[0], 3) == b"gap"
    monkeypatch.setattr("holokin.base.files.PATIENCE", 0.2)
    try:
        other = holokin("run", file, "--out", out)
    finally:
        os.write(go[1], b"go " * 3)
        first = one.wait()
    assert first.code == 0
    assert other.code == 2
    assert "another process is putting its results there" in other.err
    for end in (gap[0], *go):
        os.close(end)
    assert (out / "job" / "notes.txt").read_text() == "mine"
    assert hidden(out) == []


# --- exit codes ---


def test_an_unexpected_error_has_its_own_exit_code_and_one_sentence(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import holokin.app.report.job_report as report

    page, calls = report._page, []

    def broken(*arguments: object) -> str:
        calls.append(arguments)
        return str(1 // 0) if len(calls) in (1, 3) else page(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(report, "_page", broken)
    files = [write_job(tmp_path, f"{name}.toml") for name in ("first", "second")]
    outcome = holokin("run", *files, "--out", out)
    assert outcome.code == 3
    assert outcome.err.startswith("error: first: ") and outcome.err.count("\n") == 1
    for word in ("ZeroDivisionError", "--traceback", "authors"):
        assert word in outcome.err
    assert "second" in outcome.out and sorted(os.listdir(out)) == ["mine.txt", "second"]
    told = holokin("run", files[0], "--out", out, "--traceback")
    assert told.code == 3
    assert "Traceback (most recent call last)" in told.err and "in broken" in told.err


@pytest.mark.parametrize("error", [EOFError("e"), RecursionError("r"), BrokenPipeError(32, "b"), OSError(5, "disk")])
def test_no_error_ends_with_the_code_of_a_failed_expectation(
    holokin: Command, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def broken() -> tuple[str, ...]:
        raise error

    monkeypatch.setattr("holokin.app.job.packaged_jobs", broken)
    outcome = holokin("jobs")
    assert outcome.code == (2 if isinstance(error, OSError) and error.errno == 5 else 3)
    assert outcome.err.startswith("error: ") and outcome.err.count("\n") == 1
    assert "Traceback (most" in holokin("--traceback", "jobs").err


def test_bad_input_shows_where_it_was_met_only_when_asked(holokin: Command) -> None:
    assert_refused(holokin("run", "no.toml"), "no such file")
    told = holokin("run", "no.toml", "--traceback")
    assert told.code == 2 and "Traceback (most" in told.err and told.err.splitlines()[-1].startswith("error: no.toml")


def test_a_pipe_as_a_job_is_refused_and_not_waited_for(holokin: Command, tmp_path: Path, out: Path) -> None:
    os.mkfifo(tmp_path / "job.toml")
    assert_refused(holokin("run", tmp_path / "job.toml", "--out", out), "no regular file")
    for name in ("..toml", "...toml"):
        write_job(tmp_path, name)
        assert_refused(holokin("run", tmp_path / name, "--out", out), "has no name")
    assert_untouched(out)


@pytest.mark.parametrize("lost", ["", "raise ImportError", "raise NotImplementedError('Wrong number of arguments')"])
def test_ctrl_c_that_a_library_loses_stops_the_run_all_the_same(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest,
    lost: str,
) -> None:  # fmt: skip
    """A library may drop the KeyboardInterrupt, or make another error of it."""
    import holokin.app.report.job_report as report

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background ignore it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))

    fill = report._fill

    def loses(*arguments: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            exec(lost)
        fill(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(report, "_fill", loses)
    outcome = holokin("run", write_job(tmp_path), "--out", out)
    assert outcome.code == 130
    assert outcome.err.startswith("stopped") and outcome.err.count("\n") == 1
    assert hidden(out) == []


@pytest.mark.parametrize(
    "lost",
    [
        "class Last:\n  def __del__(self): signal.raise_signal(signal.SIGINT)\n Last()",
        "try: signal.raise_signal(signal.SIGINT)\n except KeyboardInterrupt: warnings.warn('no 3D axes')",
        "try: signal.raise_signal(signal.SIGINT)\n except KeyboardInterrupt: sys.excepthook(*sys.exc_info())",
    ],
    ids=["at the end of an object", "made a warning", "printed by compiled code"],
)
def test_ctrl_c_is_one_line_whatever_a_library_makes_of_it(tmp_path: Path, lost: str) -> None:
    """At the end of an object Python prints what it cannot raise; some libraries warn that something is missing."""
    setup = (
        "import signal, sys, warnings\nimport holokin.app.report.job_report as report\nfill = report._fill\n"
        f"def loses(*arguments):\n {lost}\n fill(*arguments)\nreport._fill = loses\n"
    )
    outcome = forked("run", write_job(tmp_path), "--out", tmp_path / "out", before=lambda: exec(setup, {}))
    assert outcome.code == 130
    assert outcome.err.startswith("stopped") and outcome.err.count("\n") == 1


def test_the_command_writes_all_languages_that_there_are() -> None:
    from holokin.app.cli.main import app
    from holokin.export import LANGUAGES

    (group,) = (one.typer_instance for one in app.registered_groups if one.name == "export")
    assert {*LANGUAGES} <= {one.name for one in group.registered_commands}
