"""`holokin sheets`: a map of a robot's or a job's workspace, written and read again."""

from __future__ import annotations

from pathlib import Path

import pytest

import holokin as hk
from conftest import Command

JOB = """
title = "a plane"
[robot]
name = "planar-3r"
lower = -2.6
upper = 2.6
[start]
q = [0.3, 0.9, 0.7]
[path]
kind = "circle"
center = [0.1, 0, 0]
relative = true
[workspace]
kind = "box"
center = [1.2, 0.3]
half = [0.3, 0.3, 0]
[sheets]
samples = 32
share = 0.9
[strategies.lock]
kind = "lock"
joints = [1]
"""


def test_the_sheets_of_a_job_are_written_and_answer_when_read(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plane.toml").write_text(JOB, "utf-8")
    run = holokin("sheets", "plane.toml", "--seconds", "5")
    assert run.code == 0, run.err
    assert "serve" in run.out
    assert "the job's path: 1 sheet, 0 changes, 0 divisions" in run.out
    assert (tmp_path / "sheets-plane.png").stat().st_size > 10_000
    arm = hk.with_limits(hk.load("planar-3r"), lower=-2.6, upper=2.6)
    s = hk.read_sheets(tmp_path / "sheets-plane.npz", hk.position(arm))
    assert s.share >= 0.9
    assert abs(arm.pose(s([1.2, 0.3])[1])[:2, 3] - [1.2, 0.3]).max() < 1e-9
    again = holokin("sheets", "plane.toml")
    assert again.code == 2
    assert "exists already" in again.err


def test_what_cannot_be_is_refused_before_the_work(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["panda", "--out", "map.csv"], ["panda", "--share", "2"], ["pandaa"]):
        run = holokin("sheets", *words)
        assert run.code == 2
        assert "Traceback" not in run.err
