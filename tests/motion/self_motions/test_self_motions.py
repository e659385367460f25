"""Self-motions of poses: every posture is on a curve, the tool is still along it, limits and levels are exact."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError
from holokin.base.poses import pose_from
from holokin.motion.ik import EndKind, SelfMotion, self_motion
from holokin.motion.self_motions.self_motions import cut_class, self_motions_at
from holokin.motion.self_motions.stretches import onto

ARMS = ("panda", "fr3", "iiwa7", "iiwa14", "xarm7", "openarm-left", "openarm-right")

STILL = 1e-9
"""What the tool moves along a curve [m, rad]: round-off."""


def mounted(name: str) -> hk.Robot:
    """An arm that hangs somewhere at a slant, with a tool that is bent."""
    base, tool = np.eye(4), np.eye(4)
    base[:3, :3], base[:3, 3] = turned([0.3, -0.7, 0.6], 2.1), [0.4, -0.2, 1.1]
    tool[:3, :3], tool[:3, 3] = turned([0.5, 0.1, 0.8], 0.9), [0.05, 0.02, 0.16]
    return hk.robot.with_tool(hk.robot.with_base_pose(hk.load(name), base), tool)


def turned(axis: list[float], angle: float) -> np.ndarray:
    """A rotation, by Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def wrapped(robot: hk.Robot, gap: np.ndarray) -> np.ndarray:
    return np.where(robot.hinges, (gap + np.pi) % (2 * np.pi) - np.pi, gap)


def distance(task: hk.Task, pose: np.ndarray, curve: np.ndarray, q: np.ndarray) -> float:
    """From a posture to a curve, turns aside: to its chords, then to those of twenty postures between the nearest."""
    away = np.inf
    for _ in range(3):
        step, gap = wrapped(task.robot, np.diff(curve, axis=0)), wrapped(task.robot, curve[:-1] - q)
        t = np.clip(-(gap * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300), 0, 1)
        every = np.linalg.norm(gap + t[:, None] * step, axis=1)
        k, away = int(every.argmin()), float(every.min())
        if away > 0.5:
            break
        near = slice(max(0, k - 1), k + 2)
        between = (curve[near][:, None] + np.linspace(0, 1, 21)[:, None] * step[near][:, None]).reshape(-1, len(q))
        poses = np.broadcast_to(pose, (len(between), 4, 4))
        curve = onto(task, poses[:, :3, 3], poses[:, :3, :3], between)
    return away


def lost(task: hk.Task, Q: np.ndarray) -> list[int]:
    """Which postures are on no curve of their pose; the tool is still along all of these, and their steps are small."""
    p, R = task._poses(Q)
    motions = self_motions_at(task, p, R)
    error = task._geometric_twin._error_function.batch(motions.q, p[motions.pose], R[motions.pose])
    assert np.abs(error).max() < STILL
    steps = np.abs(np.diff(motions.q, axis=0))[np.diff(motions.curve) == 0]
    assert steps.max() <= 0.3 + 1e-9
    out = []
    for i, q in enumerate(Q):
        own, pose = motions.of(i), pose_from(p[i : i + 1], R[i : i + 1])[0]
        curves = [own.q[own.curve == k] for k in range(len(own.closed))]
        if min((distance(task, pose, curve, q) for curve in curves), default=np.inf) > 1e-3:
            out.append(i)
    return out


@sampled(1, "name", ARMS)
def test_every_posture_is_on_a_curve_of_its_pose(name: str) -> None:
    robot = mounted(name)
    found, rng = cut_class(hk.pose(robot)), np.random.default_rng(52)
    assert found is not None and found.held == (6,)  # by closed forms, and not by a search
    within = rng.uniform(robot.lower, robot.upper, (8, robot.n))
    assert lost(hk.pose(robot), np.vstack([within, rng.uniform(-3.1, 3.1, (8, robot.n))])) == []


@pytest.mark.campaign
@pytest.mark.parametrize("name", ARMS)
def test_of_two_thousand_postures_none_is_lost(name: str) -> None:
    robot, rng = hk.load(name), np.random.default_rng(7)
    within = rng.uniform(robot.lower, robot.upper, (1000, robot.n))
    assert lost(hk.pose(robot), np.vstack([within, rng.uniform(-3.1, 3.1, (1000, robot.n))])) == []


FREE: dict[str, Callable[[], hk.Task]] = {
    "a free spin, spherical wrist": lambda: hk.pose(hk.load("irb140"), "axis"),
    "a free spin, parallel axes": lambda: hk.pose(hk.load("ur5e"), "axis"),
    "a rail": lambda: hk.pose(hk.load("rail-ur10e")),
}


@sampled(1, "case", FREE)
def test_with_a_free_spin_or_on_a_rail_every_posture_is_on_a_curve(case: str) -> None:
    task = FREE[case]()
    assert lost(task, np.random.default_rng(3).uniform(task.robot.lower, task.robot.upper, (8, task.n))) == []


@cache
def random_motion(name: str, seed: int) -> SelfMotion:
    task = hk.pose(hk.load(name))
    return self_motion(task, task.robot.pose(np.random.default_rng(seed).uniform(task.robot.lower, task.robot.upper)))


@sampled(1, "name", ARMS)
def test_the_tracer_goes_round_the_same_curves(name: str) -> None:
    """From a posture of each curve, by steps of 0.1: round it once, and along no other one."""
    motion = random_motion(name, 4)
    task, pose = motion.task, motion.pose
    for curve in motion.curves[::3]:
        traced = hk.strategies.self_motion_curve(task, curve.q[len(curve.q) // 3], step=0.1, length=40.0, limits=False)
        assert traced.closed
        assert abs((traced.s[-1] - traced.s[0]) - curve.length) < 0.02 * curve.length
        whole = np.vstack([traced.q, traced.q[:1]])
        near = [distance(task, pose, whole, other.q[len(other.q) // 2]) < 1e-3 for other in motion.curves]
        assert sum(near) == 1 and near[motion.curves.index(curve)]


@sampled(2, "name", ARMS)
def test_arcs_end_exactly_where_a_joint_is_at_its_limit_and_leave_nothing_out(name: str) -> None:
    motion = random_motion(name, 5)
    task, robot = motion.task, motion.task.robot
    assert motion.arcs
    for arc in motion.arcs:
        assert np.all((arc.q >= robot.lower - 1e-12) & (arc.q <= robot.upper + 1e-12))
        assert np.abs([robot.pose(q) - motion.pose for q in arc.q]).max() < STILL
        for end, last, before in ((arc.ends[0], arc.q[0], arc.q[1]), (arc.ends[1], arc.q[-1], arc.q[-2])):
            if end.kind is EndKind.LIMIT:
                j = robot.joint_names.index(end.joint)
                limit = robot.upper[j] if end.upper else robot.lower[j]
                assert abs(last[j] - limit) < 1e-9
                # A little farther along the self-motion the joint is beyond it.
                ahead = last + 1e-4 * (last - before) / np.linalg.norm(last - before)
                beyond = onto(task, motion.pose[None, :3, 3], motion.pose[None, :3, :3], ahead[None])
                assert (beyond[0, j] - limit) * (1 if end.upper else -1) > 0
    # What is within the limits, at some turn, is on an arc.
    for curve in motion.curves:
        for q in curve.at(np.random.default_rng(1).uniform(0, curve.length, 60)):
            turns = 2 * np.pi * np.ceil((robot.lower - q) / (2 * np.pi))
            if np.all(q + turns <= robot.upper - 1e-6):
                assert min(arc.place_of(q)[1] for arc in motion.arcs) < 0.05


def test_self_motions_that_touch_something_everywhere_have_no_arc() -> None:
    task = hk.pose(hk.load("panda"))
    pose = task.robot.pose([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    found = self_motion(task, pose, clear=lambda Q: np.zeros(len(Q), dtype=bool))
    assert found.arcs == ()
    assert found.components == self_motion(task, pose).components > 0


def test_a_contact_ends_an_arc_to_round_off() -> None:
    task = hk.pose(hk.load("panda"))
    q = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    elbow = lambda Q: np.array([task.robot.skeleton(q)[0][3][1] for q in Q])  # noqa: E731
    free, cut = (self_motion(task, task.robot.pose(q), clear=c) for c in (None, lambda Q: elbow(Q) < 0.05))
    assert cut.components == free.components
    touching = [
        (arc.q[i], arc.q[k])
        for arc in cut.arcs
        for i, k, end in ((0, 1, arc.ends[0]), (-1, -2, arc.ends[1]))
        if end.kind is EndKind.CONTACT
    ]
    assert touching
    assert all(abs(elbow(last[None])[0] - 0.05) < STILL for last, _ in touching)
    assert all((elbow(arc.q) < 0.05 + STILL).all() for arc in cut.arcs)


def test_at_a_singular_pose_curves_end_at_the_singular_posture() -> None:
    """A shoulder that is stretched along its axis, the elbow square to it: J has rank 5."""
    task = hk.pose(hk.load("iiwa14"))
    q = np.array([0.3, 0.5, 0.2, -1.2, np.pi / 2, 0.0, 0.4])
    assert np.linalg.svd(task.jacobian(q))[1][-1] < 1e-15
    motion = self_motion(task, task.robot.pose(q), limits=False)
    ends = [end for arc in motion.arcs for end in (arc.q[0], arc.q[-1]) if arc.ends[0].kind is EndKind.SINGULAR]
    assert min(np.abs(wrapped(task.robot, end - q)).max() for end in ends) < 0.02


def test_out_of_reach_there_is_no_curve_and_what_is_wrong_is_said() -> None:
    task = hk.pose(hk.load("panda"))
    far = np.eye(4)
    far[0, 3] = 3.0
    motion = self_motion(task, far)
    assert motion.components == 0 and not motion.arcs
    with pytest.raises(ArgumentError):
        self_motion(hk.position(task.robot), far)


def test_an_arc_is_walked_by_its_length_and_postures_are_found_on_it() -> None:
    motion = random_motion("panda", 6)
    arc = motion.arcs[0]
    s = np.linspace(0, arc.length, 50)
    Q = arc.at(s)
    assert np.abs([motion.task.robot.pose(q) - motion.pose for q in Q]).max() < STILL
    steps = np.linalg.norm(np.diff(Q, axis=0), axis=1)
    assert steps.max() < 1.2 * arc.length / 49
    found, place = motion.place_of(Q[20])
    assert found is arc and abs(place - s[20]) < 0.05
    with pytest.raises(ArgumentError):
        arc.at(arc.length + 0.1)
    with pytest.raises(ArgumentError):
        motion.place_of(Q[20] + 0.5)


def test_without_a_compiler_the_curves_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    task = hk.pose(hk.load("panda"))
    p, R = task._poses(np.random.default_rng(8).uniform(task.robot.lower, task.robot.upper, (1, 7)))
    native = self_motions_at(task, p, R)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    assert np.abs(self_motions_at(task, p, R).q - native.q).max() < 1e-9
