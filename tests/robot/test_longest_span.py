"""A span that no posture exceeds, by the lengths of the links alone, and the poses that it rules out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import sampled, urdf
from holokin.analysis.coverage.starts import reached
from holokin.motion.self_motions.least_squares import nearest_postures, surely_beyond
from holokin.robot.chains import longest_span

ARMS = ("panda", "iiwa14", "ur5e", "sawyer", "xarm7", "yumi-arm", "irb140", "planar-3r", "ppr", "rail-ur10e")


def ends(robot: hk.Robot, count: int, seed: int, turned: bool, tip: str | None = None) -> tuple[np.ndarray, float]:
    """How far the end of the span is from its start at random postures, whole turns of the hinges, and the span."""
    lower, upper = robot.lower.copy(), robot.upper.copy()
    lower[robot.hinges], upper[robot.hinges] = -np.pi, np.pi
    Q = np.random.default_rng(seed).uniform(lower, upper, (count, robot.n))
    span = longest_span(robot, tip, turned=turned)
    position, rotation = robot.pose_batch(Q, tip)
    assert not span.beyond(position, rotation).any()
    return np.linalg.norm(position + rotation @ span.end - span.start, axis=1), span.length


@given(name=st.sampled_from(ARMS), turned=st.booleans(), seed=st.integers(0, 2**20))
def test_no_posture_brings_the_end_of_a_span_beyond_its_length(name: str, turned: bool, seed: int) -> None:
    """Of hinges with axes that meet or not, of parallel ones, of slides, and of an arm on a rail."""
    far, length = ends(hk.load(name), 50, seed, turned)
    assert far.max() <= length + 1e-9


@pytest.mark.parametrize("name", ["panda", "iiwa14", "irb140", "sawyer"])
def test_the_span_of_an_arm_is_nearly_its_reach(name: str) -> None:
    """Where shoulder and wrist are points it is: the arm stretched. Then 0.82 m of an iiwa 14, 0.42 + 0.4 [m]."""
    far, length = ends(hk.load(name), 50_000, 0, True)
    assert far.max() > 0.99 * length
    if name == "iiwa14":
        assert length == pytest.approx(0.82, abs=1e-6)


def test_a_tip_of_several_has_a_span_of_its_own() -> None:
    robot = hk.from_urdf(urdf("tiago.urdf"), tip="arm_7_link")
    far, length = ends(robot, 200, 1, True)
    assert 0.5 * length < far.max() <= length + 1e-9


@sampled(1, "task", [hk.pose(hk.load("panda")), hk.position(hk.load("ur5e")), hk.pose(hk.load("ur5e"), "axis")])
def test_what_a_span_rules_out_no_search_reaches(task: hk.Task) -> None:
    """And it rules out most of what is out of reach, so that few searches are in vain."""
    T = hk.workspace(box=([0.6, 0, 0.5], [0.9, 0.9, 0.8]), tilt=0.5).poses(96)
    p, R = T[:, :3, 3], T[:, :3, :3]
    ruled = surely_beyond(task, p, R)
    near = np.zeros((int(ruled.sum()), task.n)) + 0.3
    assert not nearest_postures(task, p[ruled], R[ruled], near, limits=False).reached.any()
    assert ruled.sum() > 0.7 * (~reached(task, T, None).anyhow).sum()


def test_a_slide_without_limits_rules_nothing_out() -> None:
    ppr = hk.load("ppr")
    free = replace(ppr, coordinates=(replace(ppr.coordinates[0], lower=-np.inf, upper=np.inf), *ppr.coordinates[1:]))
    span = longest_span(free, turned=False)
    assert span.length == np.inf and np.isfinite(span.start).all()
    assert not span.beyond(np.full((1, 3), 1e9), np.eye(3)[None]).any()


def test_of_a_task_that_leaves_a_position_free_nothing_is_ruled_out() -> None:
    robot = hk.load("panda")
    far = np.full((1, 3), 100.0)
    for task in (hk.position(robot)[[0, 1]], hk.pose(robot)[[0, 2]]):
        assert not surely_beyond(task, far, np.eye(3)[None]).any()
    assert surely_beyond(hk.position(robot), far, np.eye(3)[None]).all()
