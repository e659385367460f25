"""Who does the cases of a survey: processes that may be killed, hang, or never come."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.app.survey import one_case as running
from holokin.app.survey import resumable_run as surveying
from holokin.app.survey import run_survey, survey_of
from holokin.app.survey.cases import Cases
from holokin.app.survey.engine import MOST, Guarded, Pool, batches
from holokin.app.survey.one_case import Row, run_case
from holokin.base.errors import (
    BranchError,
    FileError,
    JointLimitError,
    LimitReachedError,
    OutOfReachError,
    UnknownNameError,
)
from holokin.motion.ik import leaf
from holokin.symbolic import Function
from holokin.symbolic.native import kernel
from holokin.symbolic.native import toolchain as native
from survey_kills import alive, children, count_of
from survey_laws import CIRCLES, planar, rows_of

HERE = Path(__file__).parents[2]


FAULTS = {
    "throws": ("fault", "ZeroDivisionError"),
    "hangs": ("fault", "took longer than 1.5 s"),
    "sleeps_in_c": ("fault", "hung in native code"),
    "dies": ("fault", "its process died 3 times (exit code 7)"),
    "crashes": ("fault", "its process died 3 times (SIGSEGV)"),
    "exits": ("fault", "SystemExit: 0"),
    "interrupts": ("fault", "KeyboardInterrupt"),
}


@pytest.mark.campaign
def test_a_case_that_throws_hangs_or_dies_costs_one_row_and_never_its_neighbours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", f"{HERE}:{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # a compiler may take longer than a case has here
    bad = {name: {"kind": "import", "function": f"survey_laws:{name}"} for name in FAULTS}
    table = planar(
        laws={"pinv": {"kind": "moore-penrose"}, **bad, "lock": {"kind": "best-lock"}}, starts={"regular": 1},
        loops={"circle": {"kind": "circle", "size": 0.1}}, time_limit=1.5, samples=10,
    )  # fmt: skip
    out = tmp_path / "bad.sqlite"
    done = run_survey(table, tmp_path, out, workers=2)
    rows = {str(row["law"]): row for row in rows_of(out)}
    assert done.done == done.total == len(rows) == 2 + len(FAULTS) and done.faults == len(FAULTS), {
        k: r["reason"] for k, r in rows.items()
    }
    assert rows["pinv"]["status"] == rows["lock"]["status"] == "complete"
    for law, (status, reason) in FAULTS.items():
        assert rows[law]["status"] == status and reason in str(rows[law]["reason"]), rows[law]


@pytest.mark.campaign
def test_a_case_that_kills_its_process_is_a_fault_and_a_batch_that_is_none_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    law = {"kind": "import", "function": "survey_laws:dies"}
    table = planar(laws={"dies": law, "pinv": {"kind": "moore-penrose"}}, time_limit=6.0, samples=10)
    guarded = Guarded()
    try:
        text = table.model_dump_json(exclude_unset=True)
        found = [row for rows in guarded.rows(text, str(HERE), (0, 1)) for row in rows]
        assert [row.reason for row in found] == ["its process died 3 times (exit code 7)", ""]
        with pytest.raises(FileError, match="fail beside its cases"):
            list(guarded.rows("no survey", str(HERE), (0,)))
    finally:
        guarded.close()


@pytest.mark.campaign
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="it looks for processes where Linux shows them")
def test_fifty_kills_of_coordinators_and_workers_lose_no_row_double_none_and_change_none(tmp_path: Path) -> None:
    """They are forked, so that a life costs milliseconds. At the end the rows are those of a quiet run.

    HOLOKIN_KILLS=500 kills more of them.
    """
    kills = os.environ.get("HOLOKIN_KILLS", "50")
    command = [sys.executable, str(HERE / "survey_kills.py"), kills, str(tmp_path)]
    quiet = os.environ | {"HOLOKIN_NATIVE": "0", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=quiet, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    found = json.loads(done.stdout)
    assert sum(found["killed"].values()) >= int(kills) and min(found["killed"].values()) > int(kills) // 4
    assert found["wrong"] == [] and found["compared"] >= 1


def _running(file: Path, out: Path) -> tuple[subprocess.Popen[str], list[int]]:
    """A survey of the command line that has kept a row; its processes."""
    command = [sys.executable, "-m", "holokin", "survey", str(file), "--out", str(out), "--workers", "2", "--resume"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"HOLOKIN_NATIVE": "0"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    before = count_of(out)
    while process.poll() is None and count_of(out) == before:
        time.sleep(0.05)
    below = children(process.pid)
    return process, below + [pid for server in below for pid in children(server)]


@pytest.mark.campaign
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="it looks for processes where Linux shows them")
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM], ids=lambda kind: kind.name)
def test_a_survey_that_is_stopped_says_how_to_go_on_and_leaves_no_process(kind: signal.Signals, tmp_path: Path) -> None:
    file, out = tmp_path / "c.toml", tmp_path / "c.sqlite"
    file.write_text(CIRCLES.replace("count = 12", "count = 300"))
    stopped, below = _running(file, out)
    assert len(below) >= 3  # a server and two workers
    stopped.send_signal(kind)
    said, complaint = stopped.communicate(timeout=60)
    assert stopped.returncode == 128 + kind and "of 600 cases are in" in said and "--resume" in said
    assert "Traceback" not in complaint
    kept = len(rows_of(out))
    killed, more = _running(file, out)
    killed.kill()
    killed.communicate()
    until = time.monotonic() + 20.0
    while any(map(alive, below + more)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(alive, below + more))
    assert len(rows_of(out)) > kept > 0


@pytest.mark.campaign
def test_batches_and_pool_give_rows_in_any_order_but_all(tmp_path: Path) -> None:
    table = planar(starts={"regular": 1})
    cases = Cases(table, tmp_path)
    rows = [row for rows in Pool(table, tmp_path, 2).run(range(len(cases))) for row in rows]
    assert sorted(row.number for row in rows) == list(range(len(cases)))
    alone = run_case(cases.case(2), cases)
    (same,) = [row for row in rows if row.number == 2]
    assert same.metrics == pytest.approx(alone.metrics, nan_ok=True)


def test_batches_are_of_whole_loops_and_the_last_ones_small() -> None:
    """One of 4 workers does not work on long after the others."""
    found = list(batches(range(3001), 4, 4))
    sizes = [len(batch) for batch in found]
    assert [number for batch in found for number in batch] == list(range(3001))
    assert max(sizes) == MOST and sizes[-1] == 1 and sum(sizes[-8:]) < 3000 / 100
    assert all(size % 4 == 0 for size in sizes if size > 4)
    assert list(batches([], 4, 4)) == []


def test_the_remaining_time_is_by_the_rows_of_the_last_minute_and_never_by_those_of_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """900 of 1,000 cases were there; one case in 2 s, after 30 s of loading, leaves 200 s less what came."""
    now = [0.0]
    monkeypatch.setattr(surveying.time, "monotonic", lambda: now[0])
    clock = surveying._Clock(1000, 900)
    row = Row("", 0, {}, "complete", "")
    found = clock.after(())
    assert np.isnan(found.remaining) and str(found) == "900 of 1,000 cases, 900 of them before"
    for now[0] in (30.0, 32.0, 34.0, 36.0):
        found = clock.after([row])
    assert found.remaining == pytest.approx(96 * 2)
    assert str(found) == "904 of 1,000 cases, 900 of them before, 0.5 cases/s, about 0:03:12 left"
    for now[0] in np.arange(40.0, 125.0, 5.0):
        found = clock.after([row])
    assert found.remaining == pytest.approx((1000 - found.done) * 5)


def test_a_misspelt_robot_is_said_before_anything_runs(tmp_path: Path) -> None:
    """A file that does not load is a reason in its rows: see test_surveys.py."""
    for robots in (["planar-3r", "pandda"], [{"name": "pandda", "tip": "tool"}]):
        with pytest.raises(UnknownNameError, match=r"unknown robot 'pandda'.*panda"):
            run_survey(planar(robots=robots), tmp_path, tmp_path / "m.sqlite", workers=0)
    assert not (tmp_path / "m.sqlite").exists()


@pytest.mark.campaign
def test_a_script_without_a_main_guard_runs_a_survey_of_its_own_law(tmp_path: Path) -> None:
    """Its processes do not run the script again, in which the survey would begin anew."""
    (tmp_path / "mine.py").write_text(
        "import holokin as hk\n"
        "print('begun')\n"
        "def mine(task):\n    return hk.moore_penrose(task)\n"
        "circle = {'kind': 'circle', 'size': 0.1, 'count': 2}\n"
        "for law in (mine, {'kind': 'moore-penrose'}):\n"
        "    found = hk.survey(['planar-3r'], {'mine': law}, {'c': circle}, cycles=1, samples=10, workers=2)\n"
        "    print(found.columns['status'].tolist())\n"
    )
    done = subprocess.run(
        [sys.executable, str(tmp_path / "mine.py")], capture_output=True, text=True, check=False, timeout=120,
        env=os.environ | {"HOLOKIN_NATIVE": "0"},
    )  # fmt: skip
    assert done.stdout.splitlines() == ["begun", *2 * [str(2 * ["complete"])]], done.stderr[-2000:]


# --- What a case of a survey is spent on: counted, since a clock tells another story on each machine.


compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")
CIRCLE = {"circle": {"kind": "circle", "size": 0.2}}


def cases(**changes: Any) -> Cases:
    content = {"title": "cost", "robots": ["planar-3r"], "loops": CIRCLE, "cycles": 5, "samples": 40} | changes
    return Cases(survey_of({"laws": {"lock": {"kind": "best-lock"}}} | content, "cost.toml"), Path())


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often functions were made, and Newton's method was begun in Python."""
    count: Counter[str] = Counter()
    made, newton = Function.__init__, leaf.newton_on_leaf

    def making(self: Function, name: str, *arguments: Any) -> None:
        count["made"] += 1
        made(self, name, *arguments)

    def solving(*arguments: Any) -> Any:
        count["newton"] += 1
        return newton(*arguments)

    monkeypatch.setattr(Function, "__init__", making)
    monkeypatch.setattr(leaf, "newton_on_leaf", solving)
    return count


def outward(arm: hk.Robot, q0: np.ndarray, far: float) -> hk.Path:
    tool = arm.pose(q0)[:3, 3]
    return hk.polyline([tool, tool + far * tool / np.linalg.norm(tool)])


@compiled
def test_where_native_code_has_tried_all_pieces_python_does_not_try_them_again(
    calls: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The arm is stretched out on its leaf; its 120 pieces up to there are tried as if they were too many."""
    arm, q0 = hk.load("planar-3r"), np.array([0.3, 0.5, 0.3])
    law = hk.holonomic(hk.position(arm), hk.lock(0))
    stops = []
    for tries in (leaf.TRIES, 40):
        calls.clear()
        monkeypatch.setattr(leaf, "TRIES", tries)
        with pytest.raises(OutOfReachError) as told:
            hk.follow(law, outward(arm, q0, 3.0), q0, samples=30, limits=False, native=True)
        assert isinstance(told.value.__context__, BranchError) and told.value.trajectory is not None
        stops.append(told.value.trajectory.q)
        assert (calls["newton"] > 40) == (tries > 40)
    np.testing.assert_array_equal(*stops)


@compiled
def test_a_limit_that_native_code_meets_needs_no_step_in_python(calls: Counter[str]) -> None:
    """The tool goes to the locked joint's end of the first link, where the last hinge would have to fold by pi."""
    arm, q0 = hk.load("planar-3r"), np.array([0.3, 0.5, 0.3])
    law, tool = hk.holonomic(hk.position(arm), hk.lock(0)), arm.pose(q0)[:3, 3]
    path = hk.polyline([tool, [np.cos(q0[0]), np.sin(q0[0]), 0.0]])
    with pytest.raises(LimitReachedError) as fast:
        hk.follow(law, path, q0, samples=30, native=True)
    assert isinstance(fast.value.__context__, JointLimitError) and calls["newton"] == 0
    with pytest.MonkeyPatch.context() as patch, pytest.raises(LimitReachedError) as slow:
        patch.setenv("HOLOKIN_NATIVE", "0")
        hk.follow(law, path, q0, samples=30)
    assert calls["newton"] > 0
    assert str(fast.value) == str(slow.value)
    np.testing.assert_allclose(fast.value.trajectory.q, slow.value.trajectory.q, atol=1e-12)  # type: ignore[union-attr]


def test_no_more_of_a_run_is_measured_than_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = hk.load("planar-3r")
    q0 = np.array([0.3, 0.5, 0.3])
    law, tool = hk.moore_penrose(hk.position(arm)), arm.pose(q0)[:3, 3]
    walk = hk.follow(law, hk.circle(center=tool - [0.1, 0, 0], start=tool), q0, samples=40, cycles=5)
    counts, batch = [], Function.batch

    def counted(self: Function, *arguments: Any, **named: Any) -> Any:
        counts.append(len(arguments[0]))
        return batch(self, *arguments, **named)

    once = walk.until(41)
    with monkeypatch.context() as patch:
        patch.setattr(Function, "batch", counted)
        measured = [once.dq, once.x, once.error, once.sigma, once.residual]
    assert counts and max(counts) == 41
    whole = [walk.dq, walk.x, walk.error, walk.sigma, walk.residual]
    for part, of in zip(measured, whole, strict=True):
        np.testing.assert_array_equal(part, of[:41])


@compiled
@sampled(1, "kind", ["moore-penrose", "best-lock"])
def test_what_a_case_shares_with_later_ones_is_built_before_its_time_begins(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    libraries: Counter[str] = Counter()
    library = kernel.library

    def loading(source: str, **how: Any) -> Any:
        libraries["asked"] += 1
        return library(source, **how)

    monkeypatch.setattr(kernel, "library", loading)
    running.forget_built()
    survey = cases(laws={"law": {"kind": kind}})
    case = next(iter(survey))
    running.prepare(case, survey)
    assert libraries["asked"] == 1
    row = running.run_case(case, survey)
    assert row.status == "complete" and libraries["asked"] == 1


@pytest.mark.campaign
def test_what_is_built_does_not_count_into_a_case_s_time() -> None:
    def slow_to_build(task: hk.Task) -> hk.Strategy:
        time.sleep(1.5)
        return hk.moore_penrose(task)

    def slow_to_run(_task: hk.Task) -> Any:
        return lambda *_asked: time.sleep(0.1) or np.zeros(3)

    how: dict[str, Any] = {"cycles": 1, "samples": 10, "workers": 0, "time_limit": 1.0}
    found = hk.survey(["planar-3r"], {"build": slow_to_build, "run": slow_to_run}, CIRCLE, **how)
    assert found.columns["status"].tolist() == ["complete", "fault"]
    assert found.columns["reason"].tolist() == ["", "took longer than 1 s"]
    assert found.columns["seconds"].max() < 1.5


def test_a_case_that_cannot_be_prepared_says_so_in_its_row() -> None:
    survey = cases(laws={"law": {"kind": "lock", "joints": ["elbow-that-is-not"]}})
    case = next(iter(survey))
    running.prepare(case, survey)
    assert running.run_case(case, survey).status == "fault"


def test_a_law_of_the_task_alone_is_built_once_for_all_starts() -> None:
    built: list[str] = []

    def of_the_task(task: hk.Task) -> hk.Strategy:
        built.append("task")
        return hk.moore_penrose(task)

    def of_the_start(task: hk.Task, start: np.ndarray) -> hk.Strategy:
        built.append("start")
        return hk.moore_penrose(task)

    laws = {"task": of_the_task, "start": of_the_start}
    hk.survey(["planar-3r"], laws, CIRCLE, starts={"regular": 2, "random": 1}, cycles=1, samples=10, workers=0)
    assert Counter(built) == {"task": 1, "start": 3}


@pytest.mark.campaign
def test_a_law_of_an_earlier_survey_is_not_taken_for_another_of_its_name() -> None:
    def lock(task: hk.Task) -> hk.Strategy:
        return hk.holonomic(task, hk.lock(0))

    how: dict[str, Any] = {"cycles": 1, "samples": 40, "workers": 0}
    drifts = [
        hk.survey(["planar-3r"], {"law": law}, CIRCLE, **how).known("drift").max()
        for law in (hk.moore_penrose, lock, hk.moore_penrose)
    ]
    assert drifts[0] == drifts[2] > 1e-4 and drifts[1] < 1e-12
