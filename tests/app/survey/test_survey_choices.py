"""What a survey asks and what it leaves out; the public survey of every arm, and its page."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from benchmarks.survey import text
from casadi import if_else

import holokin as hk
from holokin.app.job.tables import Table
from holokin.app.survey import Findings, Store, SurveyTable, read_survey, run_survey, survey_of
from holokin.app.survey.cases import Cases
from holokin.app.survey.one_case import METRICS, CaseStatus, _robot, run_case
from holokin.app.survey.store import COLUMNS
from holokin.app.survey.survey_file import (
    LOOPS,
    OWN_KINDS,
    Given,
    GradientProjection,
    LoopTable,
    StartsTable,
    WithoutTable,
)
from holokin.base.errors import JobError

ROOT = Path(__file__).parents[3]
PUBLIC = ROOT / "benchmarks" / "survey.toml"


def survey(**changes: object) -> SurveyTable:
    return survey_of(
        {
            "title": "planar", "robots": ["planar-3r", "ppr"], "cycles": 1, "samples": 20,
            "loops": {"round": {"kind": "circle", "size": 0.1}, "eight": {"kind": "figure-eight", "size": 0.1}},
            "laws": {"pinv": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"}, "damped": {"kind": "damped"}},
        } | changes,
        "planar.toml",
    )  # fmt: skip


def test_what_is_left_out_is_asked_of_no_case_and_the_others_stay_what_they_are() -> None:
    whole = {case.id: case.names for case in Cases(survey(), Path())}
    rules = [
        {"robot": "p*r", "law": ["lock", "damp*"], "loop": "eight"},
        {"robot": "ppr", "task": "position", "law": "pinv"},
    ]
    fewer = {case.id: case.names for case in Cases(survey(without=rules), Path())}
    assert len(whole) == 12 and fewer.items() < whole.items()
    out = [names for case, names in whole.items() if case not in fewer]
    assert {(n["robot"], n["loop"], n["law"]) for n in out} == {
        ("planar-3r", "eight", "lock"), ("planar-3r", "eight", "damped"), ("ppr", "eight", "lock"),
        ("ppr", "eight", "damped"), ("ppr", "eight", "pinv"), ("ppr", "round", "pinv"),
    }  # fmt: skip


@pytest.mark.parametrize("asked", [1, 7, 50, 1000])
def test_so_many_cases_are_asked_whatever_is_left_out(asked: int) -> None:
    cases = Cases(survey(without=[{"robot": "ppr", "law": "lock"}], cases=asked), Path())
    assert asked <= len(cases) <= asked + 2
    assert len({case.id for case in cases}) == len(cases)


@pytest.mark.parametrize("asked", [8, 20, 46, 97, 150])
def test_few_cases_are_even_over_robots_and_then_over_tasks_loops_and_starts(asked: int) -> None:
    """Of 20 cases of two laws four robots once had 6, 6, 8 and 0. Counts differ by one loop, of starts by two."""
    table = survey(
        robots=["panda", "iiwa14", "fr3", "gen3"], cases=asked, starts={"regular": 1, "random": 5},
        tasks={"position": {"kind": "position"}, "pose": {"kind": "pose"}},
        laws={"pinv": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"}},
    )  # fmt: skip
    cases = list(Cases(table, Path()))
    counts = {"robot": 4, "task": 2, "loop": 2, "start": 6}
    for what, many in counts.items():
        told = [str(case.start) if what == "start" else case.names[what] for case in cases]
        found = Counter(told).values()
        least = min(found) if len(found) == many else 0
        assert max(found) - least <= 2 * (1 + (what == "start")), (what, Counter(told))


def test_with_more_cases_the_fewer_remain() -> None:
    fewer, more = ({case.id for case in Cases(survey(cases=n), Path())} for n in (40, 70))
    assert fewer < more


def test_leaving_out_everything_or_nothing_is_refused() -> None:
    with pytest.raises(JobError, match="without"):
        survey(without=[{}])
    with pytest.raises(Exception, match="leave some of them in"):
        len(Cases(survey(without=[{"law": "*"}]), Path()))


def test_a_control_law_that_loses_the_path_ends_there() -> None:
    """A circle wider than twice the reach leaves it wherever it begins; feedback would run on for ever."""
    table = survey(
        loops={"large": {"kind": "circle", "size": 7.0}},
        laws={"d": {"kind": "damped"}},
        robots=["planar-3r"],
        limits=False,
    )
    row = run_case(Cases(table, Path()).case(0), Cases(table, Path()))
    assert row.status == "lost" and "0.05 m" in row.reason
    assert row.metrics["tracking"] <= 0.05


@pytest.mark.campaign
def test_the_public_survey_asks_five_thousand_cases_of_redundant_arms() -> None:
    table = read_survey(PUBLIC)
    cases = Cases(table, PUBLIC.parent)
    assert 5_000 <= len(cases) <= 5_011
    arms = {
        label: _robot(json.dumps(robot, sort_keys=True), cases.folder)
        for label, robot in zip(cases.labels, cases.robots, strict=True)
    }
    for stratum in cases.strata:
        arm = arms[cases.labels[stratum.robot]]
        rows = {"position": 3, "pose": 6}[stratum.task] if not arm.planar else 2
        one = {"centred", "arm-angle"} & set(stratum.laws)
        assert arm.n > rows and (not one or arm.n == rows + 1), (arm.name, stratum)
    asked = Counter(case.names["law"] for case in map(cases.case, range(0, len(cases), 7)))
    assert min(asked.values()) > 20


@pytest.mark.campaign
def test_the_page_of_the_public_survey_says_what_its_results_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    laws = {
        "pseudo-inverse": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"},
        "pseudo-inverse, feedback": {"kind": "closed-loop", "of": "pseudo-inverse"},
    }  # fmt: skip
    table = survey(laws=laws, loops={"round": {"kind": "circle", "share": [0.02, 0.1]}}, robots=["planar-3r"], cycles=2)
    run_survey(table, tmp_path, tmp_path / "s.sqlite", workers=0)
    with Store.opened(tmp_path / "s.sqlite", None) as store:
        blocks = text(table, Cases(table, tmp_path), Findings.of(store.rows()))
    page = " ".join("\n".join(blocks).split())
    assert "Of 3 cases 0 have no answer." in page and "|lock|1|100.0%|100.0%|" in page
    assert "Of the 1 loops that every law was asked these shares are covered: pseudo-inverse 100.0%;" in page
    assert "{" not in page


# --- examples/survey.toml shows every key of a survey file, docs/audit.md every column and status of a row.

EXAMPLE = (ROOT / "examples" / "survey.toml").read_text("utf-8")
LINE = re.compile(r"^(?:# )?(\w+) = (.+?)(?:\s+# (.+))?$")


def shown(*tables: str) -> dict[str, tuple[object, str]]:
    """Key -> (value, what is said of it), of the tables whose headers begin so; "" is the top of the file."""
    found, here = {}, "" in tables
    for line in EXAMPLE.splitlines():
        if header := re.match(r"(?:# )?\[+([\w.]+)", line):
            here = any(table and header[1].startswith(table) for table in tables)
        elif here and (match := LINE.match(line)):
            found.setdefault(match[1], (tomllib.loads(f"x = {match[2]}")["x"], match[3] or ""))
    return found


@pytest.mark.parametrize(
    ("table", "model", "others"),
    [
        ("", SurveyTable, {"tasks", "starts", "loops", "laws", "metrics", "without"}), ("starts", StartsTable, set()),
        ("loops", LoopTable, {"key", "share"}), ("without", WithoutTable, set()),
    ],
)  # fmt: skip
def test_the_survey_to_start_from_shows_every_key_with_its_default(
    table: str, model: type[Table], others: set[str]
) -> None:
    found = shown(table)
    assert set(found) == set(model.model_fields) - others
    assert all(re.search(rf"^(?:# )?\[+{name}", EXAMPLE, re.MULTILINE) for name in others - {"key", "share"})
    assert table != "loops" or "or share: " in EXAMPLE
    for key, (value, meaning) in found.items():
        field = model.model_fields[key]
        if isinstance(field.default, int | float) and value != field.default:
            assert meaning.endswith(f"default {json.dumps(field.default)}"), key
        elif isinstance(field.default, str) and field.default and table != "without":
            assert value == field.default, key
        for words in re.findall(r"Literal\[(.*?)\]", str(field.annotation)):
            assert all(word == value or f'"{word}"' in meaning for word in re.findall(r"'([a-z-]+)'", words)), key
    assert table != "loops" or all(kind == found["kind"][0] or f'"{kind}"' in found["kind"][1] for kind in LOOPS)


def test_the_survey_to_start_from_shows_every_kind_of_law_with_its_defaults() -> None:
    whole = tomllib.loads(re.sub(r"^# (?=\[|\w+ = )", "", EXAMPLE, flags=re.MULTILINE))
    laws = survey_of(whole, "survey.toml").laws.values()
    tables = {type(law): table for law, table in zip(laws, whole["laws"].values(), strict=True)}
    own = set(OWN_KINDS) - {Given}
    assert own < set(tables)
    kinds = {kind for model in own for kind in get_args(model.model_fields["kind"].annotation)}
    assert all(f'"{kind}"' in EXAMPLE for kind in kinds)
    for model in own:
        assert set(tables[model]) == set(model.model_fields), model
        for key, field in model.model_fields.items():
            if not field.is_required() and field.default is not None:
                assert tables[model][key] == field.default, (model, key)
    costs = get_args(GradientProjection.model_fields["cost"].annotation)
    assert all(f'"{cost}"' in EXAMPLE for cost in costs)


def test_the_page_on_audits_has_every_column_and_status_of_a_row() -> None:
    text = (ROOT / "docs" / "audit.md").read_text("utf-8").split("\n### What a row says\n")[1]
    first = [re.findall(r"`([^`]+)`", line.split("|")[1]) for line in text.splitlines() if line.startswith("| `")]
    names = [name for names in first for name in names]
    assert names == [*CaseStatus, *METRICS]
    assert all(f"`{column}`" in text for column in COLUMNS)


def test_every_end_of_a_motion_is_a_status_of_a_row_and_a_strategy_that_jumps_is_no_fault() -> None:
    def jumping(task: hk.Task, q0: np.ndarray) -> hk.Strategy:
        return hk.holonomic(task, hk.custom(lambda q: q[2] + if_else(q[0] > q0[0] + 0.01, 0.3, 0.0)))

    assert set(CaseStatus.__members__) == set(hk.motion.Status.__members__)
    loops = {"c": {"kind": "circle", "share": 0.3}}
    rows = hk.survey(["planar-3r"], {"jump": jumping}, loops, workers=0, cycles=1, samples=40, limits=False).rows()
    assert [row["status"] for row in rows] == ["jump"] and "its g jumps" in rows[0]["reason"]
