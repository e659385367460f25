"""Metrics of a user's own in surveys and audits: columns and findings, and what is said of broken ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.app.survey import Store, run_survey, survey_of

ROBOT = hk.load("planar-3r")
LAWS = {"mp": hk.moore_penrose, "lock": {"kind": "lock", "joints": [2]}}
LOOPS = {"circle": {"kind": "circle", "size": 0.1}}


def highest(walk: hk.Trajectory) -> float:
    """The largest angle of the second joint."""
    return float(walk.q[:, 1].max())


def nothing(_walk: hk.Trajectory) -> None:
    """No number."""


def broken(_walk: hk.Trajectory) -> float:
    raise ValueError("no sensor")


BROKEN: dict[str, tuple[Callable[[Any], Any], str]] = {
    "raises": (broken, "raises ValueError: no sensor"),
    "not a number": (lambda walk: np.nan, "gives nan"),
    "many": (lambda walk: walk.q[0], "gives an array of shape (3,)"),
    "text": (lambda walk: "high", "gives 'high'"),
}


def asked(**metrics: Callable[[Any], Any]) -> Any:
    return hk.survey(["planar-3r"], LAWS, LOOPS, cycles=2, samples=50, workers=0, metrics=metrics)


def test_a_metric_is_a_column_of_what_the_joints_did() -> None:
    found = asked(highest=highest, nothing=nothing)
    plain = hk.survey(["planar-3r"], LAWS, LOOPS, cycles=2, samples=50, workers=0)
    assert set(found.columns) == {*plain.columns, "highest", "nothing"}
    assert np.isfinite(found.columns["highest"]).all()
    assert np.isnan(found.columns["nothing"].astype(float)).all()
    assert found.columns["status"].tolist() == ["complete", "complete"]
    assert found.columns["drift"].tolist() == plain.columns["drift"].tolist()  # it changes nothing else
    assert "highest" in found.frame().columns


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_metric_is_a_fault_that_names_it_and_keeps_the_other_numbers(name: str) -> None:
    function, words = BROKEN[name]
    found = asked(highest=highest, mine=function)
    assert found.columns["status"].tolist() == ["fault", "fault"]
    assert all("the metric 'mine'" in reason and words in reason for reason in found.columns["reason"])
    assert np.isfinite(found.columns["highest"]).all()
    assert words in str(found)


FILE = {
    "title": "own", "robots": ["planar-3r"], "loops": LOOPS, "laws": {"mp": {"kind": "moore-penrose"}}, "samples": 50,
    "cycles": 2, "metrics": {"mine": "mine_of_file:value"},
}  # fmt: skip


def test_a_survey_file_names_a_function_beside_it_and_its_results_keep_the_column(tmp_path: Path) -> None:
    (tmp_path / "mine_of_file.py").write_text("def value(walk):\n    return 1 / 0\n", "utf-8")
    results = tmp_path / "found.sqlite"
    run_survey(survey_of(FILE, "survey"), tmp_path, results, workers=0)

    def rows() -> list[dict[str, Any]]:
        with Store.opened(results, None) as store:
            return list(store.rows())

    (row,) = rows()
    assert row["status"] == "fault"
    assert "mine" in row["reason"] and row["mine"] is None and row["drift"] is not None
    (tmp_path / "mine_of_file.py").write_text("def value(walk):\n    return 7.5\n", "utf-8")
    run_survey(survey_of(FILE, "survey"), tmp_path, results, workers=0, resume=True, again=True)
    (row,) = rows()
    assert (row["status"], row["mine"]) == ("complete", 7.5)
    assert json.loads(json.dumps(row))["mine"] == 7.5


@pytest.mark.parametrize("name", ["drift", "id", "a b", 'a"b', "a; DROP TABLE cases", ""])
def test_a_column_has_a_plain_name_that_no_other_has(name: str) -> None:
    with pytest.raises(hk.HolokinError):
        asked(**{name: highest})


def test_an_audit_has_a_finding_for_each_metric_apart_from_its_verdict() -> None:
    task, q0 = hk.position(ROBOT), [0.3, 0.6, 0.5]
    law = hk.holonomic(task, hk.lock(2))
    plain = hk.audit(law, task, q0=q0, dt=0.05, cycles=3)
    metrics = {"highest": highest, "nothing": nothing} | {name: f for name, (f, _) in BROKEN.items()}
    found = hk.audit(law, task, q0=q0, dt=0.05, cycles=3, metrics=metrics)
    assert found.verdict is plain.verdict
    assert 0.5 < found["metric highest"].metrics["value"] < 1.5
    assert found["metric nothing"].metrics == {}
    for name, (_, words) in BROKEN.items():
        assert words in found[f"metric {name}"].fault
        assert words in json.dumps(found.to_dict())
