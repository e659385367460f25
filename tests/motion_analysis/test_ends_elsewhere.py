"""A closed path on a regular leaf that ends elsewhere: the cusp that it goes round is named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import holokin as hk
from holokin.job import open_job, run_job
from holokin.motion_analysis import why_elsewhere

PANDA = np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])


def test_the_cusp_round_which_a_panda_went_is_named() -> None:
    """The loop is about a cusp by construction; the one that is named lies within its size of it."""
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    found = hk.cusps(strategy, PANDA, starts=60).witness
    assert found is not None
    said = why_elsewhere(strategy, hk.follow(strategy, found.path, found.first, samples=300))
    away, *at = (float(x) for x in re.search(r"lies (\S+) m .* \[(.*)\]", said).expand(r"\1, \2").split(", "))
    tool = strategy.task.pose(found.first)[:3, 3]
    assert away < found.size + 0.02 and np.linalg.norm(at - tool) < found.length + 0.02
    assert f"is {found.apart:.3g} rad" in said or f"is {-found.apart:.3g} rad" in said


def test_nothing_is_said_where_the_joints_come_back_or_the_path_was_not_gone() -> None:
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    tool = strategy.task.pose(PANDA)[:3, 3]
    assert why_elsewhere(strategy, hk.follow(strategy, hk.circle(tool, tool - [0.05, 0, 0]), PANDA, samples=100)) == ""


def test_a_job_says_why_a_loop_round_the_base_does_not_bring_the_joints_back(tmp_path: Path) -> None:
    """A locked joint, two links: joint 1 has turned once. The pseudo-inverse has no leaf, and gets no such sentence."""
    file = tmp_path / "round.toml"
    file.write_text("""
title = "Round the base"
[robot]
name = "planar-3r"
lower = [-9, -9, -9]
upper = [9, 9, 9]
[task]
kind = "position"
[start]
q = [0.3, 0.9, 0.7]
[path]
kind = "circle"
center = [0.0, 0.0]
relative = false
samples = 200
cycles = 1
[strategies.lock]
kind = "lock"
joints = ["q2"]
[strategies.plain]
kind = "moore-penrose"
""")
    lock, plain = run_job(*open_job(str(file))).strategies
    assert "whole turns further" in lock.trouble and "6.28 rad" in lock.trouble and plain.trouble == ""
