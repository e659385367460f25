"""Every benchmark runs, and the floor of the speed benchmark is the step that it says it is."""

from __future__ import annotations

import importlib
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks.speed import Floor, in_turns, repeated

import holokin as hk
from conftest import PANDA_START, campaign
from forked import child
from holokin.symbolic.native import toolchain as native
from holokin.symbolic.native.kernel import HEAVY
from holokin.symbolic.native.toolchain import idle

ROOT = Path(__file__).parents[2]
FILES = [
    f for f in sorted((ROOT / "benchmarks").rglob("*.py"))
    if f.parent.name != "workers" and '__name__ == "__main__"' in f.read_text("utf-8")
]  # fmt: skip
MODULES = [".".join(f.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__") for f in FILES]
STARTING = tuple(f"benchmarks.{name}" for name in ("fuzz", "kills", "speed"))
"""These start processes or compilers; the others run in this one."""
FORKED = STARTING if hasattr(os, "fork") else ()
OF_ITS_OWN = (
    tuple(f"benchmarks.{name}" for name in ("league", "random_cusps", "sheets", "startup"))
    + STARTING[len(FORKED) :]
)
"""These measure what a process imports and keeps, or need native code: they are begun as a user begins them."""
QUICK = ("benchmarks.selftests",)
"""This takes a second; the others are of the campaign."""
ELSEWHERE = {
    "benchmarks.drift": "tests/house/test_docs.py",
    "benchmarks.logs": "tests/analysis/audit/test_log_campaign.py",
}
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


def test_the_benchmarks_are_those_that_the_pages_name() -> None:
    """Each page that says `python -m benchmarks.X` names one that is run below."""
    pages = "".join(page.read_text("utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    named = {words.split("`")[0].split()[0].rstrip(".,;)") for words in pages.split("python -m ")[1:]}
    assert {name for name in named if name.startswith("benchmarks.")} <= set(MODULES)
    assert len(MODULES) == 17


@pytest.mark.parametrize(
    "module",
    [
        name if name in QUICK else campaign("module", name)
        for name in MODULES
        if name not in (*OF_ITS_OWN, *FORKED, *ELSEWHERE)
    ],
)
def test_it_runs_with_quick_in_this_process(
    module: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [module, "--quick"])
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # they take less time than a compiler
    assert not importlib.import_module(module).main()
    assert capsys.readouterr().out


@pytest.mark.parametrize(("module", "file"), ELSEWHERE.items())
def test_what_is_not_run_here_is_run_elsewhere(module: str, file: str) -> None:
    text = (ROOT / file).read_text("utf-8")
    assert f"from benchmarks import {module.rpartition('.')[2]}" in text and '"--quick"' in text


@pytest.mark.campaign
@pytest.mark.parametrize("module", OF_ITS_OWN)
def test_it_runs_with_quick_in_a_process_of_its_own(module: str, tmp_path: Path) -> None:
    more = ["--out", str(tmp_path)] if module in ("benchmarks.league", "benchmarks.speed") else []
    command = [sys.executable, "-m", module, "--quick", *more]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr[-2000:]
    assert done.stdout


@pytest.mark.campaign
@pytest.mark.parametrize("module", FORKED)
def test_it_runs_with_quick_in_a_child_of_this_process(module: str, tmp_path: Path) -> None:
    more = ["--out", str(tmp_path)] if module == "benchmarks.speed" else []
    package = module == "benchmarks.fuzz"
    main = importlib.import_module(f"{module}.__main__" if package else module).main
    done = child(module, "--quick", *more, work=main, folder=ROOT).wait()
    assert (done.code, "Traceback" in done.err) == (0, False), done.err[-2000:]
    assert done.out
    if more:
        page = (tmp_path / "speed.md").read_text("utf-8")
        assert "nan" not in page
        rows = {cells[1].strip(): cells for line in page.splitlines() if len(cells := line.split("|")) > 5}
        assert float(rows["radial of the pseudo-inverse, called from C"][4]) < 40
        assert float(rows["radial, virtual machine"][4]) > 60
        for library in ("pink", "mink", "placo"):
            if importlib.util.find_spec(library) is None:
                assert f"{library} ({library} is not installed)" in page


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize("constraint", [hk.arm_angle(), None])
def test_the_c_floor_is_the_step_that_python_gets(constraint: hk.Constraint | None) -> None:
    """The same joint rates: it reads the leaf, the step and both gains, as many as the step has."""
    task = hk.pose(hk.load("panda"))
    strategy = hk.moore_penrose(task) if constraint is None else hk.holonomic(task, constraint)
    controller = hk.controller(strategy, dt=1e-3, q0=PANDA_START)
    pose, dx = task.robot.pose(PANDA_START), np.array([0.1, 0.0, 0.05, 0.0, 0.0, 0.0])
    pose[0, 3] += 1e-4
    floor = Floor(controller, pose, dx)
    assert floor(3) == 0
    assert floor.first == pytest.approx(controller.step(PANDA_START, pose, dx), rel=1e-13)
    with pytest.raises(ValueError, match="reads arrays of shapes"):
        Floor(controller, pose[:3, 3], dx)


def test_calls_that_are_timed_in_turns_keep_their_order() -> None:
    times = in_turns({"little": repeated(lambda: None), "more": repeated(lambda: sum(range(3000)))}, 5, 1e-3)
    assert 10 * times["little"].median < times["more"].median <= times["more"].p99


@pytest.mark.campaign
@compiled
@pytest.mark.usefixtures("optimized")
def test_a_call_from_python_costs_a_few_steps_in_c() -> None:
    """By the processor's time, which other work on the machine changes little: measured 1.7, 48 without native code."""
    task = hk.pose(hk.load("panda"))
    strategy = hk.holonomic(task, hk.arm_angle())
    controller = hk.controller(strategy, dt=1e-3, q0=PANDA_START)
    pose, dx = task.robot.pose(PANDA_START), np.zeros(6)
    repeated(lambda: strategy(PANDA_START))(HEAVY)
    assert idle(120.0)
    calls = {"floor": Floor(controller, pose, dx), "G": repeated(lambda: strategy(PANDA_START))}
    times = in_turns(calls, 50, 1e-3)
    assert times["G"].median < 5 * times["floor"].median


@pytest.mark.campaign
@compiled
@pytest.mark.usefixtures("optimized")
def test_a_step_of_a_radial_law_takes_at_most_25_c_floors() -> None:
    """By the processor's time: measured 20; written out it was 88 floors' worth of operations, and too long for C."""
    task = hk.pose(hk.load("panda"))
    pose, dx = task.robot.pose(PANDA_START), np.array([0.1, 0.0, 0.05, 0.0, 0.0, 0.0])
    laws = {"floor": hk.holonomic(task, hk.arm_angle()), "radial": hk.radial(hk.moore_penrose(task), PANDA_START)}
    steps = {name: Floor(hk.controller(law, dt=1e-3, q0=PANDA_START), pose, dx) for name, law in laws.items()}
    times = in_turns(steps, 50, 1e-3)
    assert times["radial"].median < 25 * times["floor"].median
