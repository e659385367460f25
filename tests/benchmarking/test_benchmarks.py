"""Every benchmark runs, and the floor of the speed benchmark is the step that it says it is."""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks import drift
from benchmarks.speed import Floor, in_turns, repeated

import holokin as hk
from conftest import PANDA_START
from holokin.symbolic.native import toolchain as native
from holokin.symbolic.native.kernel import HEAVY
from holokin.symbolic.native.toolchain import idle

ROOT = Path(__file__).parents[2]
FILES = [
    f
    for f in sorted((ROOT / "benchmarks").rglob("*.py"))
    if f.parent.name != "workers" and '__name__ == "__main__"' in f.read_text("utf-8")
]
MODULES = [".".join(f.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__") for f in FILES]
WRITING = ("benchmarks.league", "benchmarks.rivals", "benchmarks.speed")
"""These write pages."""
ELSEWHERE = ("benchmarks.drift", "benchmarks.selftests")
"""These are run below."""
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


def test_the_benchmarks_that_the_pages_name_are_there() -> None:
    pages = "".join(page.read_text("utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    named = {words.split("`")[0].split()[0].rstrip(".,;)") for words in pages.split("python -m ")[1:]}
    assert {name for name in named if name.startswith("benchmarks.")} <= set(MODULES)


def test_the_self_tests_run_with_quick(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks.selftests", "--quick"])
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # it takes less time than a compiler
    assert not importlib.import_module("benchmarks.selftests").main()
    assert capsys.readouterr().out


@pytest.mark.campaign
@pytest.mark.parametrize("module", [name for name in MODULES if name not in ELSEWHERE])
def test_it_runs_with_quick(module: str, tmp_path: Path) -> None:
    more = ["--out", str(tmp_path)] if module in WRITING else []
    command = [sys.executable, "-m", module, "--quick", *more]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr[-2000:]
    assert done.stdout
    if module == "benchmarks.speed":
        page = (tmp_path / "speed.md").read_text("utf-8")
        assert "nan" not in page
        rows = {cells[1].strip(): cells for line in page.splitlines() if len(cells := line.split("|")) > 5}
        assert float(rows["radial of the pseudo-inverse, called from C"][4]) < 40
        assert float(rows["radial, virtual machine"][4]) > 60
        for library in ("pink", "mink", "placo"):
            if importlib.util.find_spec(library) is None:
                assert f"{library} ({library} is not installed)" in page


@pytest.mark.campaign
def test_the_drift_benchmark_runs_and_says_what_it_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drift, "DT", 0.05)
    monkeypatch.setattr(drift, "GAIN", 10.0)
    assert drift.main(["--quick", "--out", str(tmp_path)]) == 0
    page = (tmp_path / "drift.md").read_text("utf-8")
    assert "nan" not in page
    rows = {line.split("|")[1].strip(): line.split("|")[3:7] for line in page.splitlines() if line.startswith("| ")}
    assert float(rows["Moore-Penrose"][0]) > 0.05
    assert float(rows["locked joint 3"][0]) < 1e-3
    assert float(rows["locked joint 3"][2]) < 0.2 * float(rows["gradient projection, 1/s"][2])
    assert (tmp_path / "drift.png").stat().st_size > 20_000


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
