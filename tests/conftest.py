"""What the tests share: robots, start postures, the URDFs of example-robot-data, the command line, a job to spoil."""

from __future__ import annotations

import atexit
import gc
import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

if "PYTEST_XDIST_WORKER" in os.environ:
    atexit.register(os._exit, 0)  # registered first, it runs last: to free a worker's memory bit by bit takes seconds
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: a worker has one core, on which threads only wait

import numpy as np
import pytest
from hypothesis import Phase, settings

import holokin as hk
from holokin.app.cli import main as cli
from holokin.symbolic.native.toolchain import compiler
from sketches import sketches

sys.path.append(str(Path(__file__).parents[1]))  # the benchmarks, of which some tests run a little
for kept in ("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_"):
    os.environ.setdefault(kept, "1000000000")  # glibc: workers keep their memory
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # a hundred tests start Python: with bytecode in half the time
sys.dont_write_bytecode = False
os.environ.setdefault("CFLAGS", "-O0")  # what an export's self-test compares takes a compiler a third of the time so

HERE = Path(__file__).parent
collect_ignore = (
    []
    if find_spec("pinocchio")  # it has no wheels for Windows: what is compared with it is left out there
    else [
        str(f.relative_to(HERE))
        for f in HERE.rglob("test_*.py")
        if re.search(r"^import pinocchio|^from test_growth", f.read_text("utf-8"), re.MULTILINE)
    ]
)


def pytest_configure(config: pytest.Config) -> None:
    """The suite draws few examples, and its native code is quickly built; the campaign draws many, and optimizes."""
    thorough = "not campaign" not in config.option.markexpr
    if not thorough:
        _build_quickly()
    phases = [p for p in Phase if p is not Phase.shrink]  # it takes up to five minutes: no test may
    settings.register_profile("campaign", max_examples=200, deadline=None, phases=phases)
    settings.register_profile("suite", max_examples=8, deadline=None, phases=phases)
    settings.load_profile("campaign" if thorough else "suite")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What draws its examples is of both."""
    if config.option.markexpr == "campaign":
        for item in items:
            if getattr(getattr(item, "function", None), "is_hypothesis_test", False):
                item.add_marker(pytest.mark.campaign)


def pytest_sessionstart() -> None:
    """Each worker reads its share of the files before all collect them: half of those new to pytest take half as long.

    What cannot be imported is told when it is collected.
    """
    worker, workers = os.environ.get("PYTEST_XDIST_WORKER"), os.environ.get("PYTEST_XDIST_WORKER_COUNT")
    if worker is None or workers is None:
        return
    ours = sorted(HERE.rglob("test_*.py"))[int(worker.removeprefix("gw")) % int(workers) :: int(workers)]
    for file in ours:
        sys.path.insert(0, str(file.parent))  # as pytest does
        with suppress(Exception, pytest.skip.Exception):
            import_module(file.stem)


def pytest_xdist_auto_num_workers() -> int:
    """As many as cores: one more costs a third collection of the tests, and waits for the others."""
    return os.cpu_count() or 1


def _build_quickly() -> None:
    """A C compiler that does not optimize, and a folder of its own for what it builds; `pytest -n` hands on both."""
    folder = HERE.parent / ".pytest_cache" / "native"
    command = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if os.name != "posix" or "CC" in os.environ or command is None:
        return
    with suppress(OSError):  # the tree cannot be written: then as users build it
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        made, written = folder / "cc", folder / f"cc.{os.getpid()}"
        written.write_text(f'#!/bin/sh\nexec {command} "$@" -O0\n', "utf-8")
        written.chmod(0o700)
        written.replace(made)
        os.environ |= {"CC": str(made), "HOLOKIN_CACHE": str(folder)}


@pytest.fixture
def optimized(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """Native code as users have it: for what says how fast it is."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path / "optimized"))
    compiler.cache_clear()
    yield
    compiler.cache_clear()


def sampled(count: int, names: str | tuple[str, ...], values: Iterable[Any], **more: Any) -> pytest.MarkDecorator:
    """`parametrize` of which `count` cases, drawn once and not picked, are in the suite, the others in the campaign."""
    cases = list(values)
    few = set(random.Random(2011).sample(range(len(cases)), count))
    return pytest.mark.parametrize(names, [v if i in few else campaign(names, v) for i, v in enumerate(cases)], **more)


def campaign(names: str | tuple[str, ...], case: Any) -> Any:
    """A case of `parametrize` for the campaign alone."""
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, marks=(*case.marks, pytest.mark.campaign), id=case.id)
    return pytest.param(*([case] if isinstance(names, str) else case), marks=pytest.mark.campaign)


def pytest_collection_finish() -> None:
    """Thousands of tests lie in memory until the end: rubbish is not sought among them."""
    gc.collect()
    gc.freeze()


PANDA_START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
R3_START = np.array([0.3, 0.9, 0.7])
IRB_START = np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0])
IIWA_START = np.array([0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])
PPR_START = np.array([0.9022932188134525, -0.3035067811865475, np.pi / 4])
PPR_CENTER = np.array([1.2070, 0.4036, 0.0])
PPR_RADIUS = 0.4024

SOUND = {
    "title": 'title = "a circle"\n',
    "robot": '[robot]\nname = "ppr"\n',
    "task": "",
    "start": f"[start]\nq = {PPR_START.tolist()}\n",
    "path": '[path]\nkind = "circle"\ncenter = [1.2070, 0.4036]\nsamples = 20\n',
    "strategies": '[strategies.moore-penrose]\nkind = "moore-penrose"\n',
    "expect": "",
}
"""A job that runs; the tests spoil one table of it."""


def urdf_files() -> list[Path]:
    """Every URDF of the installed example-robot-data package."""
    listed = files("example-robot-data") or []
    return sorted({Path(str(f.locate())).resolve() for f in listed if f.name.endswith(".urdf")})


def urdf(name: str) -> Path:
    """One URDF of that package by file name."""
    return next(path for path in urdf_files() if path.name == name)


@pytest.fixture(scope="session")
def ppr() -> hk.Robot:
    return hk.load("ppr")


@pytest.fixture(scope="session")
def irb140() -> hk.Robot:
    return hk.load("irb140")


@pytest.fixture(scope="session")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.fixture(scope="session")
def iiwa14() -> hk.Robot:
    return hk.load("iiwa14")


@pytest.fixture(scope="session")
def planar_3r() -> hk.Robot:
    return hk.load("planar-3r")


UNCOMPILED = (
    "test_advise.py", "test_allocation.py", "test_audit_results.py", "test_closed_leaf.py", "test_design.py",
    "test_design_bound.py", "test_design_clear.py", "test_five_joints.py", "test_follows.py", "test_jumps.py",
    "test_motion_results.py", "test_mountings.py", "test_obstruction.py", "test_own_cost.py", "test_poses.py",
    "test_shown.py", "test_timing.py", "test_units.py", "test_unread_shapes.py",
)  # fmt: skip
"""Files whose functions are long and called a few times each: a compiler takes longer than they do (with one
six tests took 54 s of processor time, without 15 s)."""


@pytest.fixture(scope="module", autouse=True)
def uncompiled(request: pytest.FixtureRequest) -> Iterator[None]:
    """The virtual machine for such files."""
    with pytest.MonkeyPatch.context() as patch:
        if request.path.name in UNCOMPILED:
            patch.setenv("HOLOKIN_NATIVE", "0")
        yield


# --- the command line and what it may leave behind ---


@dataclass(frozen=True)
class Outcome:
    """What a command left behind: exit code and the two streams."""

    code: object
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def holokin(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line, in this process."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["holokin", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        streams = capsys.readouterr()
        return Outcome(0 if end.value.code is None else end.value.code, streams.out, streams.err)

    return run


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder for results in which somebody keeps something already."""
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.txt").write_text("keep me")
    return folder


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of this process have sketches for figures."""
    monkeypatch.setattr("holokin.app.report.job_report.figures", sketches)


def shell(*arguments: object) -> Outcome:
    """The command line, in a process of its own."""
    command = [sys.executable, "-m", "holokin.app.cli.main", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)


def write_job(folder: Path, name: str = "job.toml", **spoilt: str) -> Path:
    file = folder / name
    file.write_text("".join((SOUND | spoilt).values()), "utf-8")
    return file


def assert_refused(outcome: Outcome, *words: str) -> None:
    """Exit code 2 and one sentence on stderr that says all the words, and nothing else anywhere."""
    assert "Traceback" not in outcome.err + outcome.out
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1 and outcome.err.endswith("\n")
    for word in words:
        assert word in outcome.err
    assert outcome.out == ""
    assert outcome.code == 2


def assert_untouched(out: Path) -> None:
    """No new entries, hidden ones included, and the old one as it was."""
    assert [entry.name for entry in out.iterdir()] == ["mine.txt"]
    assert (out / "mine.txt").read_text() == "keep me"


def fails(error: type[Exception], words: str, call: Callable[[], Any]) -> None:
    """A call raises an error in whose message these words, a regular expression, stand."""
    with pytest.raises(error, match=words or None):
        call()
