"""What a case of a survey is spent on: counted, since a clock tells another story on each machine."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.app.survey import one_case as running
from holokin.app.survey import survey_of
from holokin.app.survey.cases import Cases
from holokin.base.errors import BranchError, JointLimitError, LimitReachedError, OutOfReachError
from holokin.motion.ik import leaf
from holokin.symbolic import Function
from holokin.symbolic.native import kernel
from holokin.symbolic.native import toolchain as native

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
