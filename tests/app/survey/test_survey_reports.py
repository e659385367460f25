"""What is read from the rows of a survey: survival, the cases that stopped, the page, the command line."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.app.survey import Findings, Store, coverage_figure, read_survey, run_survey, survey_of, survival_figure
from holokin.app.survey.cases import Cases
from holokin.app.survey.findings import robot_labels
from holokin.app.survey.one_case import METRICS
from survey_laws import CIRCLES


def test_the_survival_of_arms_is_the_estimate_of_kaplan_and_meier() -> None:
    """Freireich's trial of 6-MP, 1963, as in Kaplan-Meier lessons: 21 patients, 9 relapses."""
    weeks = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
    relapse = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
    found = Findings({
        "cycles": np.array(weeks, dtype=float),
        "status": np.array(["limit" if r else "complete" for r in relapse], dtype=object),
    })  # fmt: skip
    k, share, count = found.survival()
    at = dict(zip(k.tolist(), share.tolist(), strict=True))
    assert count == 21
    published = {7: 0.857, 8: 0.807, 11: 0.753, 14: 0.690, 17: 0.627, 23: 0.538, 24: 0.448}
    for week, value in published.items():
        assert at[week] == pytest.approx(value, abs=6e-4)


def test_of_the_cases_that_stopped_one_stands_for_all_of_its_law_and_reason() -> None:
    """Reasons that differ in the names of robots and joints, and in numbers, are one; the rarest is first."""
    rows = [  # robot, law, status, cycles, reason
        ("panda", "a", "limit", 3, "went beyond a limit of 'panda_joint4', which nothing stopped"),
        ("lib:arm_x tool0", "a", "limit", 1, "went beyond a limit of 'wrist_3', which nothing stopped"),
        ("panda", "a", "fault", None, "panda has 1 such start postures"),
        ("lib:arm_x tool0", "a", "fault", None, "arm_x has 12 such start postures"),
        ("gen3", "a", "fault", None, "gen3 has 4 such start postures"),
        ("gen3", "a", "fault", None, "pink is not installed"),
        ("panda", "b", "complete", 9, ""),
        ("panda", "b", "singular", 0, "stopped"),
    ]  # fmt: skip
    keys = ("robot", "law", "status", "cycles", "reason")
    shown = Findings.of(dict(zip(keys, row, strict=True)) for row in rows).stopped()
    assert [(many, row["law"], row["status"], row["robot"]) for many, row in shown] == [
        (1, "a", "fault", "gen3"), (1, "b", "singular", "panda"), (2, "a", "limit", "lib:arm_x tool0"),
        (3, "a", "fault", "panda"),
    ]  # fmt: skip


def test_a_survey_without_rows_is_said_and_not_reported(holokin: Command, tmp_path: Path) -> None:
    with Store.opened(tmp_path / "s.sqlite", survey_of(tomllib.loads(CIRCLES), "s.toml"), tmp_path):
        pass
    told = holokin("survey", "report", tmp_path / "s.sqlite")
    assert told.code == 2 and "none of its 24 cases has a row yet" in told.err and "--resume" in told.err
    assert not (tmp_path / "s.html").exists()


@pytest.mark.campaign
def test_the_survey_to_start_from_runs_and_says_which_law_returns(tmp_path: Path) -> None:
    """It is docs/gallery.md that says so: with locked joints all return, with the pseudo-inverse none."""
    file = Path(__file__).parents[3] / "examples" / "survey.toml"
    run_survey(read_survey(file), file.parent, tmp_path / "s.sqlite", workers=0)
    with Store.opened(tmp_path / "s.sqlite", None) as store:
        found = Findings.of(store.rows())
    assert len(found) == 24
    head, rows = found.table()
    returns = {row[0]: row[head.index("returns")] for row in rows}
    assert returns == {"pseudo-inverse": "0.0%", "pseudo-inverse, feedback": "0.0%", "lock": "100.0%"}


def test_a_law_of_which_nothing_is_known_is_no_law_that_covers_nothing(tmp_path: Path) -> None:
    """Never asked: empty. All faults: said. Some faults: they count as not gone round."""
    rows = [
        ("a", "x", "complete"), ("a", "x", "fault"), ("a", "y", "fault"), ("b", "x", "limit"),
    ]  # fmt: skip
    keys = ("robot", "law", "status")
    numbers = dict.fromkeys(METRICS, 0.0)
    found = Findings.of(numbers | dict(zip(keys, row, strict=True)) for row in rows)
    _, _, share = found.coverage()
    assert share[0, 0] == 0.5 and share[1, 0] == 0.0 and np.isnan(share[:, 1]).all()
    assert found.faults() == {("a", "x"): 1, ("a", "y"): 1}
    written = [text.get_text() for text in coverage_figure(found).axes[0].texts]
    assert sorted(written) == ["0", "50", "faults"]


def test_shares_of_survivors_are_labelled_up_to_a_hundred_percent() -> None:
    status = np.array(["limit"] + 9 * ["complete"], dtype=object)
    nothing = np.full(10, np.nan)
    found = Findings({
        "law": np.array(10 * ["x"], dtype=object), "status": status, "cycles": np.arange(10.0), "drift_last": nothing,
    })  # fmt: skip
    (axes,) = survival_figure(found).axes
    assert max(axes.get_yticks()) == pytest.approx(1.0) and axes.get_ylim()[1] < 1.02


def test_the_case_of_a_row_is_found_by_its_id_when_its_number_is_of_a_larger_survey() -> None:
    fewer, more = (
        Cases(survey_of(tomllib.loads(CIRCLES) | {"cases": n}, "s.toml"), Path()) for n in (12, 60)
    )  # fmt: skip
    moved = 0
    for case in more:
        found = fewer.of_row({"number": case.number, "id": case.id} | case.names)
        assert found is not None and found.id == case.id
        moved += case.number < len(fewer) and fewer.case(case.number).id != case.id
    assert moved
    assert fewer.of_row({"number": 0, "id": "?"} | more.case(0).names) is None


def test_a_loop_is_covered_when_it_was_gone_round_with_the_tool_on_the_path() -> None:
    rows = [  # robot, law, status, tool error [m]
        ("a", "x", "complete", 1e-4), ("a", "x", "complete", 0.02), ("a", "y", "limit", 1e-4),
        ("b", "x", "complete", 0.0), ("b", "x", "fault", None),
    ]  # fmt: skip
    keys = ("robot", "law", "status", "tracking")
    robots, laws, share = (found := Findings.of(dict(zip(keys, row, strict=True)) for row in rows)).coverage()
    assert (robots, laws) == (["a", "b"], ["x", "y"])
    assert share[0].tolist() == [0.5, 0.0] and share[1, 0] == 0.5 and np.isnan(share[1, 1])
    assert found.covered.tolist() == [True, False, False, True, False]


def test_the_share_that_met_a_limit_by_a_cycle_is_what_survival_leaves() -> None:
    found = Findings({
        "cycles": np.array([0.0, 3.0, 4.0, 20.0]), "status": np.array(["limit", "limit", "singular", "complete"]),
    })  # fmt: skip
    assert [found.met_a_limit(k) for k in (0, 1, 3, 5, 20)] == pytest.approx([0.0, 0.25, 0.25, 0.5, 0.5])


def test_robots_are_called_by_their_name_where_it_tells() -> None:
    labels = ["panda", "example-robot-data:talos torso-hand", "example-robot-data:talos hand", "models/arm.urdf tool"]
    assert robot_labels(labels) == ["panda", "talos torso-hand", "talos hand", "arm.urdf"]


@pytest.mark.usefixtures("sketched")
def test_the_command_line_runs_reports_and_repeats(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    file, out = tmp_path / "s.toml", tmp_path / "s.sqlite"
    file.write_text(CIRCLES)
    ran = holokin("survey", file, "--out", out, "--workers", "0")
    assert ran.code == 0 and "24 cases" in ran.out
    again = holokin("survey", file, "--out", out, "--workers", "0")
    assert again.code == 2 and "--resume" in again.err
    told = holokin("survey", "report", out)
    assert told.code == 0 and "pinv" in told.out
    page = out.with_suffix(".html").read_text()
    assert (
        page.count("<figure>") == 4
        and page.count("<details>") == 10
        and "All were complete" in page
        and "circles" in page
    )
    with Store.opened(out, None) as store:
        row = next(iter(store.rows()))
    case = holokin("survey", "case", out, row["id"])
    (tmp_path / "case.toml").write_text(case.out)
    run = holokin("run", tmp_path / "case.toml", "--out", tmp_path / "out")
    assert run.code == 0, run.err
    for unknown in ("nothing", "9" * 30):
        assert holokin("survey", "case", out, unknown).code == 2
    assert holokin("survey", file, "--out", "/dev/null/folder/x.sqlite").code == 2


# --- Metrics of a user's own in surveys and audits: columns and findings, and what is said of broken ones.


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


@pytest.mark.campaign
def test_ten_laws_are_compared_from_a_script_in_eight_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    laws = {"pseudo-inverse": hk.moore_penrose, "damped": hk.motion.control.damped, "locked": {"kind": "best-lock"}}
    pulled, stationary = ("start", "centring", "manipulability"), ("centring", "manipulability")
    laws |= {f"pulled to {cost}": {"kind": "gradient-projection", "cost": cost} for cost in pulled}
    laws |= {f"stationary {cost}": {"kind": "stationary", "cost": cost} for cost in stationary}
    laws |= {"arm angle": {"kind": "arm-angle"}, "locked, feedback": {"kind": "closed-loop", "of": "locked"}}
    circles = {"kind": "circle", "share": [0.02, 0.15], "speed": 0.25, "count": 1}
    found = hk.survey(["panda"], laws, {"circle": circles}, tasks="pose", samples=12, cycles=2, workers=0)
    assert len(found) == 10 and len(found.laws) == 10
    assert set(found.columns["status"]) <= {"complete", "limit"}
