"""A strategy that cannot be run costs its own row and the exit code; the others of its job are reported."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import PANDA_START, Command, assert_refused, assert_untouched, sampled, write_job

pytestmark = pytest.mark.usefixtures("sketched")  # what is written when is the statement, not what is drawn

LINE = '[path]\nkind = "polyline"\npoints = [[0, 0, 0], [0.03, 0, 0]]\nrelative = true\nsamples = 20\n'
PANDA = {
    "robot": '[robot]\nname = "panda"\n',
    "task": '[task]\nkind = "pose"\n',
    "start": f"[start]\nq = {PANDA_START.tolist()}\n",
    "path": LINE,
}
SOUND_LAW = '[strategies.moore-penrose]\nkind = "moore-penrose"\n'
UNSETTLED = '[strategies.far]\nkind = "lock"\njoints = ["panda_joint3"]\nlevel = 2.5\n'
SINGULAR = '[strategies.flat]\nkind = "custom"\ng = ["1"]\n'


@sampled(
    1,
    ("law", "name", "words"),
    [(UNSETTLED, "far", ("moving to the leaf failed", "level 2.5")), (SINGULAR, "flat", ("algorithmic singularity",))],
)
def test_a_strategy_that_cannot_be_run_leaves_the_others_their_table(
    holokin: Command, tmp_path: Path, out: Path, law: str, name: str, words: tuple[str, ...]
) -> None:
    file = write_job(tmp_path, **PANDA, strategies=law + SOUND_LAW)
    outcome = holokin("run", file, "--out", out)
    assert (outcome.code, outcome.err) == (2, "")
    rows = {line.split("\u2502")[1].strip(): line for line in outcome.out.splitlines() if line.startswith("\u2502")}
    assert "NOT run" in rows[name] and "FAILED" in rows[name]
    assert "NOT holonomic" in rows["moore-penrose"]
    told = " ".join(outcome.out.split())
    page = (out / "job" / "report.html").read_text("utf-8")
    facts = json.loads((out / "job" / "result.json").read_text("utf-8"))
    for word in (f"{name}: not run: ", *words):
        assert word in told
    for word in words:
        assert word in page
        assert word in facts["not_run"][0]["reason"]
    assert (facts["passed"], [s["name"] for s in facts["strategies"]]) == (False, ["moore-penrose"])
    assert (out / "job" / "moore-penrose-cycles.csv").is_file()


def test_a_job_of_which_no_strategy_can_be_run_is_refused_with_the_reason(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    outcome = holokin("run", write_job(tmp_path, **PANDA, strategies=UNSETTLED + SINGULAR), "--out", out)
    assert_refused(outcome, "moving to the leaf failed", "level 2.5")
    assert_untouched(out)


def test_a_mistake_in_one_strategy_still_stops_its_job_before_it_writes(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    wrong = '[strategies.wrong]\nkind = "lock"\njoints = ["panda_joint9"]\n'
    outcome = holokin("run", write_job(tmp_path, **PANDA, strategies=SOUND_LAW + wrong), "--out", out)
    assert outcome.code == 2
    assert "[strategies.wrong] unknown joint 'panda_joint9'" in outcome.err
    assert not (out / "job").exists()
