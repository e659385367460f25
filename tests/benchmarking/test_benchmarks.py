"""Every benchmark runs, and the floor of the speed benchmark is the step that it says it is."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks import page
from benchmarks.page import PARTS, RAN, SECTION, Given
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
Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


def test_the_benchmarks_that_the_pages_name_are_there() -> None:
    pages = "".join(page.read_text("utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    named = {words.split("`")[0].split()[0].rstrip(".,;)") for words in pages.split("python -m ")[1:]}
    assert {name for name in named if name.startswith("benchmarks.")} <= set(MODULES)
    for words in pages.split("python -m benchmarks ")[1:]:
        parts = words.split("`")[0].split("\n")[0].split()
        assert set(itertools.takewhile(str.isalpha, parts)) <= {*PARTS, "PART"}, parts


def test_the_page_has_a_section_of_every_part_and_says_what_each_was_run_with() -> None:
    """A version that the page names is the one that it is part of: no row is of an older one."""
    page = (ROOT / "docs" / "measured.md").read_text("utf-8")
    sections, ran = dict(SECTION.findall(page)), dict(RAN.findall(page))
    assert list(sections) == list(ran) == list(PARTS)
    for name, text in sections.items():
        assert text.startswith(f"## {name.title()}\n")
        assert f"holokin {hk.__version__}, " in ran[name]
        assert not re.search(r"\bnan\b", text)
    for picture in re.findall(r"\]\(([\w/-]+\.png)\)", page):
        assert (ROOT / "docs" / picture).is_file()


def test_a_section_is_written_in_its_place_and_the_others_stay(tmp_path: Path, monkeypatch: Patch) -> None:
    for number, name in enumerate(("survey", "speed", "speed")):
        part = SimpleNamespace(section=lambda _given, number=number: (["## Title", f"number {number}"], "holokin 9"))
        monkeypatch.setattr(page.importlib, "import_module", lambda _name, part=part: part)
        page.run(name, Given(tmp_path))
    text = (tmp_path / "measured.md").read_text("utf-8")
    assert dict(SECTION.findall(text)) == {"speed": "## Title\n\nnumber 2", "survey": "## Title\n\nnumber 0"}
    assert list(dict(RAN.findall(text))) == ["speed", "survey"]


@pytest.mark.parametrize("module", [name for name in MODULES if name not in ("benchmarks", "benchmarks.arm_maps")])
@pytest.mark.campaign
def test_it_runs_with_quick(module: str) -> None:
    command = [sys.executable, "-m", module, "--quick"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr[-2000:]
    assert done.stdout


@pytest.mark.campaign
@pytest.mark.parametrize("part", PARTS)
def test_a_part_of_the_page_runs_with_quick(part: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks", part, "--quick", "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr[-2000:]
    text = dict(SECTION.findall((tmp_path / "measured.md").read_text("utf-8")))[part]
    assert text.startswith(f"## {part.title()}\n")
    assert not re.search(r"\bnan\b", text)
    rows = {cells[1].strip(): cells[2:] for line in text.splitlines() if len(cells := line.split("|")) > 5}
    if part == "speed":
        assert float(rows["`radial`, called from C"][2]) < 40
        assert float(rows["`radial`, without a compiler"][2]) > 60
    if part == "drift":
        assert float(rows["Moore-Penrose"][1]) > 0.05
        assert float(rows["locked joint 3"][1]) < 1e-3
        assert float(rows["locked joint 3"][3]) < 0.2 * float(rows["gradient projection, 1/s"][3])
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
