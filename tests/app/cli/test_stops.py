"""Commands that are stopped at random moments, by Ctrl-C or by SIGTERM: exit code, processes, files."""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmarks.kills import hidden

import holokin as hk
from conftest import sampled, write_job
from forked import start
from holokin.base.files import uninterrupted

SHORT = '[path]\nkind = "polyline"\npoints = [[0, 0], [-0.05, 0.03]]\nrelative = true\nsamples = 20\n'
LAWS = "".join(f'[strategies.law{i}]\nkind = "custom"\ng = ["q3 - {0.05 * i} * q1"]\n' for i in range(6))
KINDS = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM}


def in_session(session: int) -> list[int]:
    """The processes of a session that are there still."""
    found = []
    for folder in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = Path("/proc", folder, "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(folder))
    return found


def stopped(kind: signal.Signals, seconds: float, *arguments: object) -> tuple[object, str]:
    """The exit code of a command that gets a signal, twice, after so many seconds, and what it complains of.

    `timeout` sends SIGTERM so: to the process, and to its group.
    """
    one = start(*arguments, before=os.setsid)
    time.sleep(seconds)
    for _ in range(2 if kind is signal.SIGTERM else 1):
        os.kill(one.process, kind)
    ended = one.wait()
    until = time.monotonic() + 10
    while (left := in_session(one.process)) and time.monotonic() < until:
        time.sleep(0.05)
    assert left == []
    return ended.code, ended.err


CASES = list(itertools.product(("certify", "run", "sheets", "survey"), KINDS, range(4)))


@sampled(2, ("what", "kind", "seed"), CASES)
def test_a_command_that_is_stopped_leaves_whole_files_that_say_so_and_no_process(
    tmp_path: Path, what: str, kind: str, seed: int
) -> None:
    chance, out = random.Random(f"{what} {kind} {seed}"), tmp_path / "out"
    out.mkdir()
    if what == "survey":
        words = ["survey", survey(tmp_path), "--out", out / "s.sqlite", "--workers", 2]
    elif what == "sheets":
        box = ["--box", "1 0.6 0 0.5 0.5 0", "--task", "position"]
        words = ["sheets", "planar-3r", *box, "--out", out / "s.npz"]
    else:
        words = [what, write_job(tmp_path, strategy=LAWS, path=SHORT), "--out", out]
    code, complained = stopped(KINDS[kind], chance.uniform(0.2, 3.0), *words)
    if code == 128 + KINDS[kind]:
        assert complained.splitlines()[-1].startswith("stopped") and "Traceback" not in complained
    else:
        assert code in (0, 1)  # it had ended
    assert hidden(out) == []
    for file in out.rglob("result.json"):
        facts = json.loads(file.read_text())
        assert all((file.parent / name).is_file() for name in facts["files"])
        assert len(facts["strategies"]) == 7 or facts["stopped"]
    for file in out.glob("*.npz"):
        assert hk.read_sheets(file, hk.position(hk.load("planar-3r"))).share > 0


RUNNER = """import os, signal
from holokin.app.cli import jobs
from holokin.app.cli.main import main
jobs.show = lambda _text: exec(f"os.kill(os.getpid(), {KIND})\\nfor _ in range(10**7): pass")
main()
"""


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_signal_within_a_text_that_python_runs_ends_with_its_code(kind: signal.Signals, tmp_path: Path) -> None:
    """As in the making of a dataclass. `python -m` would end by SIGINT, whatever code is asked for."""
    (tmp_path / "runner.py").write_text(RUNNER.replace("KIND", str(int(kind))))
    path = os.pathsep.join([str(tmp_path), *sys.path])
    command = [sys.executable, "-m", "runner", "jobs"]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"PYTHONPATH": path},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (done.returncode, done.stderr.count("\n")) == (128 + kind, 1) and done.stderr.startswith("stopped")


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_signal_that_comes_while_results_are_put_in_place_is_heard_when_they_are(kind: signal.Signals) -> None:
    heard: list[int] = []
    before = signal.signal(kind, lambda number, _frame: heard.append(number))
    try:
        with uninterrupted():
            signal.raise_signal(kind)
            signal.raise_signal(kind)
            assert heard == []
        assert heard == [kind]
        signal.signal(kind, signal.SIG_IGN)  # a process in the background
        with uninterrupted():
            signal.raise_signal(kind)
            assert signal.getsignal(kind) is signal.SIG_IGN
    finally:
        signal.signal(kind, before)


def survey(folder: Path) -> Path:
    """A survey that takes some seconds."""
    file = folder / "s.toml"
    file.write_text(
        'title = "S"\nrobots = ["planar-3r"]\ncases = 4000\n[tasks.p]\nkind = "position"\n[starts]\nregular = 40\n'
        '[loops.c]\nkind = "circle"\nsize = 0.1\n[laws.p]\nkind = "moore-penrose"\n'
    )
    return file
