"""`holokin new --robot`: a job for another robot than the packaged ones', that runs as it is written."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, campaign, urdf
from holokin.app.job import open_job, run_job
from holokin.app.report.job_result import JobResult


def done(file: Path) -> JobResult:
    """The job, with its verdicts shortened."""
    name, job, path = open_job(str(file))
    return run_job(name, job.model_copy(update={"verdict": job.verdict.model_copy(update={"samples": 4})}), path)


def assert_fits(result: JobResult, robot: hk.Robot) -> None:
    assert result.passed
    assert result.title.startswith(robot.name)
    laws = {s.name: s for s in result.strategies}
    assert {name: s.verdict.holonomic for name, s in laws.items()} == {
        "moore-penrose": False, "lock": True, "radial": True,
    }  # fmt: skip
    assert all(not s.checks for s in laws.values())  # nothing is expected that nobody measured
    assert all(s.status is hk.motion.Status.COMPLETE for s in laws.values())
    assert laws["lock"].metrics["drift_total"] < 1e-9 < laws["moore-penrose"].metrics["drift_total"]
    walls = np.minimum(result.q0 - robot.lower, robot.upper - result.q0)
    ranges = robot.upper - robot.lower
    assert (walls[np.isfinite(ranges)] > 0.2 * ranges[np.isfinite(ranges)]).all()
    assert min(s.metrics["sigma"] for s in laws.values()) > 0.05


MORE = ("planar-3r", "irb140", "so101", "openarm", "openarm-right", "rizon4s")


@pytest.mark.parametrize("name", ["ppr", *(campaign("name", name) for name in MORE)])
def test_a_new_job_for_a_robot_of_the_catalogue_runs_as_it_is(holokin: Command, tmp_path: Path, name: str) -> None:
    file = tmp_path / "mine.toml"
    outcome = holokin("new", file, "--robot", name)
    assert (outcome.code, outcome.err) == (0, "")
    assert "panda" not in file.read_text("utf-8").lower()
    assert_fits(done(file), hk.load(name))


@pytest.mark.campaign
def test_a_new_job_for_a_urdf_beside_it_can_be_moved_with_it(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").mkdir()
    shutil.copy(urdf("panda.urdf"), tmp_path / "old" / "arm.urdf")
    monkeypatch.chdir(tmp_path / "old")
    assert holokin("new", "mine.toml", "--robot", "arm.urdf", "--tip", "panda_hand_tcp").code == 0
    monkeypatch.chdir("/")
    (tmp_path / "old").rename(tmp_path / "new")
    file = tmp_path / "new" / "mine.toml"
    assert_fits(done(file), hk.from_urdf(tmp_path / "new" / "arm.urdf", tip="panda_hand_tcp"))


def test_a_new_job_says_what_it_needs(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert_refused(holokin("new", file, "--robot", "pandaa"), "unknown robot 'pandaa'", "did you mean 'panda'")
    assert_refused(holokin("new", file, "--robot", "ppr", "--from", "orientation"), "give one of them")
    assert_refused(holokin("new", file, "--tip", "hand"), "give the robot, too")
    assert_refused(holokin("new", file, "--robot", str(urdf("g1_29dof_rev_1_0.urdf"))), "tip")
    bar = tmp_path / "bar.toml"
    bar.write_text('name = "bar"\nsource = "a test"\njoints = [{ a = 1.0 }]\n')
    assert_refused(holokin("new", file, "--robot", bar), "'bar' is 1", "two")
    assert not file.exists()
    file.write_text("mine")
    assert_refused(holokin("new", file, "--robot", "ppr"), "exists already")
    assert file.read_text() == "mine"
