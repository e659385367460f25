"""The league: what it measures of motions that are known in closed form, and what it does with a library that fails."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks import drift
from benchmarks.league.courses import panda_file, write_course
from benchmarks.league.league_page import league_text
from benchmarks.league.played import ENTRIES, WORKERS, Entry, NoEnvironment, play, python_of, reason_of, runs_of
from benchmarks.league.scores import Score, best_of, score

import holokin as hk

pytestmark = pytest.mark.campaign
START = drift.STARTS["iiwa14"]
ROBOT = hk.load("iiwa14")
TIED = hk.ik(hk.holonomic(hk.pose(ROBOT), hk.linear([1, 0, -1, 0, 0, 0, 0])), START)
TOLD = {
    "name": "a",
    "example": True,
    "arm": "iiwa14",
    "fault": "",
    "missing": 0,
    "call_us": 1.0,
    "source": "here",
}


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("league") / "course"
    write_course(folder, ("iiwa14",), cycles=2, dt=0.1, tours=1)
    return folder


@pytest.fixture(scope="module")
def runs(course: Path) -> dict[str, dict[str, np.ndarray]]:
    return runs_of(course, "iiwa14")


@pytest.fixture(scope="module")
def tied(runs: dict[str, dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The joints of our leaf on every run."""
    found = {}
    for name, run in runs.items():
        walk = [START]
        for pose in run["poses"]:
            walk.append(TIED.near(pose, walk[-1]))
        found[name] = np.array(walk)
    return found


def test_a_leaf_returns_on_every_path_and_tour_and_its_tool_is_where_it_shall_be(
    runs: dict[str, dict[str, np.ndarray]], tied: dict[str, np.ndarray]
) -> None:
    found = score(TOLD, "ours", ROBOT, runs, tied)
    assert max(found.later, found.ways, found.turn) < 1e-9
    assert found.tracking < 1e-6
    assert (found.tours, found.whole, found.again, found.unfair) == (1, 1, 1, "")


def test_what_turns_the_last_joint_in_each_cycle_drifts_by_that_and_turns_the_tool_as_far(
    runs: dict[str, dict[str, np.ndarray]], tied: dict[str, np.ndarray]
) -> None:
    """The axis of joint 7 goes through the tool: its place stays, its turn is the angle of joint 7."""
    wound = {}
    for name, q in tied.items():
        rounds = 2 if name in ("circle", "figure eight", "square") or name.startswith("tour") else 1
        done = rounds * np.arange(len(q)) / (len(q) - 1)
        turned = 0.125 * done * (done + 1)  # 0.25 rad in the first cycle, 0.5 rad in the second
        still = name.startswith(("there", "round")) and name != "there at 0.05"  # one of the six halves turns
        wound[name] = q if still else q + turned[:, None] * np.eye(7)[6]
    found = score(TOLD, "wound", ROBOT, runs, wound)
    assert (found.later, found.ways) == pytest.approx((0.5, 0.25), abs=1e-8)
    assert (found.turn, found.tracking) == pytest.approx((0.75, 0.0), abs=1e-6)
    assert (found.whole, found.again, found.unfair) == (0, 0, "off the path")


def test_a_jump_is_faster_than_a_joint_can_be(
    runs: dict[str, dict[str, np.ndarray]], tied: dict[str, np.ndarray]
) -> None:
    """Another leaf from the middle of the circle on: the tool is on its path, the joints are not there in time."""
    other = hk.ik(
        TIED.strategy, hk.motion.ik.move_to_leaf(TIED.strategy, START, TIED.strategy.constraint_value(START) + 0.5)
    )
    half = len(tied["circle"]) // 2
    jumped = tied["circle"].copy()
    jumped[half:] = [other(pose) for pose in runs["circle"]["poses"][half - 1 :]]
    found = score(TOLD, "jumps", ROBOT, runs, tied | {"circle": jumped})
    assert found.tracking < 1e-6
    assert found.hurry > 1
    assert found.unfair == "jumps"


def test_the_best_setting_is_the_fastest_that_returns_and_keeps_to_the_path() -> None:
    good = Score(
        "a", "good", False, "b", ways=1e-9, later=0.0, tracking=0.1, turn=0.0, within=True, hurry=0.5, call_us=9.0
    )
    fast, soft = (
        replace(good, name="fast", ways=9e-7, call_us=5.0),
        replace(good, name="soft", tracking=26.0, call_us=1.0),
    )
    far, held = replace(good, name="far", ways=1e-3, call_us=1.0), replace(good, name="held", missing=1, call_us=1.0)
    assert best_of([far, soft, good, fast, held]) == fast
    assert best_of([soft, far]) == far
    assert best_of([soft, held, replace(good, fault="it threw")]) is None


STILL = """
from worker_loop import Setting, serve

def settings(arm):
    yield Setting("still", lambda arm: lambda q, pose, twist, h: q, True, "nowhere")
    yield Setting("silent", lambda arm: lambda q, pose, twist, h: None)
    yield Setting("broken", lambda arm: 1 / 0)
    if END:
        raise SystemExit("error: it ended")

serve(settings, ("numpy",))
"""


@pytest.mark.parametrize("ends", [False, True])
def test_a_worker_runs_without_holokin_and_its_faults_are_told(
    ends: bool, course: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tool that stands still is as far from a circle of 0.1 m as its diameter."""
    script = tmp_path / "with_nothing.py"
    script.write_text(STILL.replace("END", str(ends)), "utf-8")
    monkeypatch.setenv("PYTHONPATH", str(WORKERS))
    played = play(Entry("still", (), script), course, tmp_path, tmp_path / "answers")
    still, silent, broken = played.scores
    assert still.tracking == pytest.approx(200, abs=0.1)
    assert (still.later, still.ways, still.missing, still.whole, still.again) == (0, 0, 0, 0, 0)
    assert silent.missing == sum(len(r["h"]) + 1 for n, r in runs_of(course, "iiwa14").items() if "tour" not in n)
    assert broken.fault == "ZeroDivisionError: division by zero"
    assert played.left_out == ("error: it ended" if ends else "")
    page = "\n".join(league_text([played]))
    assert "|still|0e+00|2e+02 mm" in page
    assert ("Not played, or not to the end: still (error: it ended)." in page) == ends
    again = play(Entry("still", ("nobody-asks-pip",), script), course, tmp_path, tmp_path / "answers")
    assert again.scores == played.scores  # what is there is not asked for again


def test_what_pip_or_a_script_says_last_is_the_reason_and_a_strangers_folder_is_left_alone(tmp_path: Path) -> None:
    said = "Looking\nERROR: Could not find a version\nERROR: No matching distribution found for x\n[notice] a new pip\n"
    assert reason_of(said) == "No matching distribution found for x"
    assert reason_of("Traceback\n  line\nImportError: no libfoo\n") == "ImportError: no libfoo"
    mine = tmp_path / "placo" / "thesis.tex"
    mine.parent.mkdir()
    mine.write_text("years of work", "utf-8")
    with pytest.raises(NoEnvironment, match="--environments"):
        python_of(Entry("placo", ("placo",)), tmp_path)
    assert mine.read_text("utf-8") == "years of work"


def test_every_library_takes_part_once_and_the_workers_import_no_holokin() -> None:
    """But for the function that asks holokin itself."""
    assert len({entry.name for entry in ENTRIES}) == len(ENTRIES)
    trees = {script.name: ast.parse(script.read_text("utf-8")) for script in WORKERS.glob("*.py")}
    (table,) = (node.value for node in trees["libraries.py"].body if isinstance(node, ast.Assign))
    assert isinstance(table, ast.Dict)
    assert [ast.literal_eval(key) for key in table.keys if key] == [entry.name for entry in ENTRIES]
    for tree in trees.values():
        inside = [n for n in tree.body if not (isinstance(n, ast.FunctionDef) and n.name == "holokin")]
        nodes = [n for part in inside for n in ast.walk(part)]
        names = [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
        names += [a.name for n in nodes if isinstance(n, ast.Import) for a in n.names]
        assert not {"holokin", "benchmarks"} & {name.split(".")[0] for name in names}


def test_the_panda_that_all_get_is_that_of_its_file(tmp_path: Path) -> None:
    """By Pinocchio, which reads the file of the package example-robot-data and the one that the workers get."""
    pin = pytest.importorskip("pinocchio", reason="it has no wheels for Windows")
    write_course(tmp_path, ("panda",), cycles=1, dt=0.5, tours=0)
    whole, chain = pin.buildModelFromUrdf(str(panda_file())), pin.buildModelFromUrdf(str(tmp_path / "panda.urdf"))
    for q in np.random.default_rng(0).uniform(chain.lowerPositionLimit, chain.upperPositionLimit, (5, 7)):
        found = []
        for model in (whole, chain):
            data = model.createData()
            pin.framesForwardKinematics(model, data, np.concatenate([q, np.zeros(model.nq - 7)]))
            found.append(data.oMf[model.getFrameId("panda_hand_tcp")].homogeneous)
        assert np.abs(found[0] - found[1]).max() < 1e-9


def test_a_library_in_an_environment_of_its_own_answers(tmp_path: Path) -> None:
    """placo without a posture task drifts, and its joints task leads back; both follow the path."""
    write_course(tmp_path / "course", ("iiwa14",), cycles=2, dt=0.05, tours=0)
    (placo,) = (entry for entry in ENTRIES if entry.name == "placo")
    played = play(placo, tmp_path / "course", tmp_path / "environments", tmp_path / "answers")
    if played.left_out.startswith("it cannot be installed"):
        pytest.skip(played.left_out)
    assert not played.left_out
    assert (tmp_path / "environments" / "placo" / "pyvenv.cfg").exists()
    by_name = {s.name: s for s in played.scores}
    free, held = by_name["no posture"], by_name["joints task 1e-06, 5 solutions a sample"]
    assert max(free.tracking, held.tracking) < 1
    assert free.later > 0.03 > 100 * held.later
    assert free.ways > 0.03 > 100 * held.ways
