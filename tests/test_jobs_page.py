"""docs/jobs.md: its example runs, and no key, kind or figure of a job file is left out."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from conftest import Command
from holokin.job import kinds_of_path, kinds_of_strategy, open_job, packaged_jobs, read_job, run_job
from holokin.job.schema import (
    Bound,
    ExpectTable,
    Job,
    PathTable,
    RobotTable,
    StartTable,
    StrategyTable,
    TaskTable,
    VerdictTable,
)

PAGE = (Path(__file__).parents[1] / "docs" / "jobs.md").read_text("utf-8")


def rows(section: str) -> dict[str, str]:
    """First cell -> rest, of the tables of a section."""
    text = PAGE.split(f"## {section}")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| (`.+?) \| (.*) \|$", text, re.MULTILINE))


def words(text: str) -> set[str]:
    return set(re.findall(r"`([\w.-]+)`", text))


def test_the_example_runs_and_is_as_expected(tmp_path: Path) -> None:
    file = tmp_path / "example.toml"
    file.write_text(re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1], "utf-8")
    result = run_job(*open_job(str(file)))
    assert result.passed, [c for s in result.strategies for c in s.checks if not c.passed]
    assert {s.verdict.holonomic for s in result.strategies} == {True, False}


@pytest.mark.parametrize(
    ("section", "tables"),
    [
        ("[robot], [task]", {"robot": RobotTable, "task": TaskTable, "start": StartTable, "verdict": VerdictTable}),
        ("[path]", {"": PathTable}),
    ],
)
def test_every_key_of_a_table_is_described(section: str, tables: dict) -> None:
    described = words(" ".join(rows(section)))
    keys = {f"{name}.{key}".lstrip(".") for name, table in tables.items() for key in table.model_fields}
    if "[robot]" in section:
        keys |= set(Job.model_fields) - {"robot", "task", "start", "verdict", "path", "strategies", "expect"}
    assert described == keys


def test_every_kind_of_strategy_is_described_with_its_keys() -> None:
    described = rows("[strategies.NAME]")
    kinds = kinds_of_strategy()
    assert {cell.strip("`") for cell in described} - {"kind"} == set(kinds)
    for kind, (needed, optional) in kinds.items():
        assert words(described[f"`{kind}`"].split("|")[0]) == {*needed, *optional}, kind
    text = PAGE.split("## [strategies.NAME]")[1].split("\n## ")[0]
    assert set(StrategyTable.model_fields) <= words(text)


def test_every_figure_that_may_be_expected_is_described() -> None:
    described = words(" ".join(rows("[expect.NAME]")))
    assert described | {"holonomic", "completes"} == set(ExpectTable.model_fields)
    text = PAGE.split("## [expect.NAME]")[1]
    assert all(re.search(rf"\b{key} = ", text) for key in [*Bound.model_fields, "holonomic", "completes"])


def test_the_kinds_can_be_listed(holokin: Command) -> None:
    outcome = holokin("jobs", "--kinds")
    assert outcome.code == 0
    for kind in [*kinds_of_path(), *kinds_of_strategy()]:
        assert re.search(rf"^(path|strategy) +{kind}\b", outcome.out, re.MULTILINE), kind
    assert "needs center, angle_deg" in outcome.out
    assert "panda-circle" not in outcome.out


@pytest.mark.parametrize("template", packaged_jobs())
def test_a_copied_job_says_that_its_numbers_are_not_of_another_robot(
    holokin: Command, tmp_path: Path, template: str
) -> None:
    file = tmp_path / "mine.toml"
    assert holokin("new", file, "--from", template).code == 0
    lines = file.read_text("utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("[expect."))
    assert lines[first - 1].startswith("#") and "robot, start and path" in lines[first - 1]
    assert read_job(file) == open_job(template)[1]
