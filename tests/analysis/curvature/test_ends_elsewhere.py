"""A closed path on a regular leaf that ends elsewhere, by a cusp, a hole or a turn; and leaves with many postures."""

from __future__ import annotations

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from holokin.analysis.curvature import why_elsewhere
from holokin.app.job import open_job, run_job

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


def test_the_leaf_of_a_held_joint_has_many_postures_of_one_tool_pose_and_small_loops_return_to_each() -> None:
    """A Panda, joint 3 held: ten without the joint limits. Pinocchio sees the tool at one pose."""
    q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    G = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    T = G.task.robot.pose(q0)
    Q = hk.motion.ik.all_postures(G, T, G.constraint_value(q0), limits=False).q
    assert len(Q) >= 10 and np.abs(Q[:, 2] - q0[2]).max() < 1e-9
    gap = np.abs((Q[:, None] - Q + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    assert (gap + 9 * np.eye(len(Q)) > 0.1).all()
    assert np.abs(poses_by_pinocchio(G.task.robot, Q) - T).max() < 1e-9
    loop = hk.circle(T[:3, 3], T[:3, 3] - [0.001, 0, 0])
    assert max(np.abs(hk.drift(G, loop, q, limits=False).since_start[0]).max() for q in Q) < 1e-9


def poses_by_pinocchio(robot: hk.Robot, Q: np.ndarray) -> np.ndarray:
    """Tool poses (k, 4, 4) of postures (k, n)."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame, poses = model.createData(), model.getFrameId(robot.tip), []
    for q in Q:
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[frame].homogeneous.copy())
    return np.array(poses)


def test_a_loop_round_a_hole_ends_elsewhere_though_no_posture_is_singular() -> None:
    """PPR, k q3 - s atan2(y, x) held, (x, y) the tool: |det [J; J_g]| = k everywhere, so there is no cusp. A round of
    the origin turns joint 3 by 2 pi s / k, a loop beside it by nothing. The verdict promises small loops alone.
    """
    rng, ppr = np.random.default_rng(9), hk.load("ppr")
    for k, s in [(2, 1), *rng.integers(1, 6, (4, 2))]:
        q0 = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-np.pi, np.pi)])
        g = hk.custom(lambda q, k=int(k), s=int(s): k * q[2] - s * ca.atan2(q[1] + ca.sin(q[2]), q[0] + ca.cos(q[2])),
                      angular=True)  # fmt: skip
        G = hk.holonomic(hk.position(ppr), g)
        tool = ppr.pose(q0)[:3, 3]
        walk = hk.follow(G, hk.circle(tool, [0, 0, 0]), q0, limits=False)
        E = np.concatenate([G.task.jacobian(walk.q), G.rows(walk.q)], axis=1)
        assert np.abs(np.linalg.det(E)) == pytest.approx(k)
        assert walk.drift()[0][2] == pytest.approx(2 * np.pi * s / k, abs=1e-8)
        said = why_elsewhere(G, walk)
        assert "cannot be shrunk to a point" in said and ("no cusp was found" in said) == (s % k != 0)
        beside = hk.circle(tool, tool + 0.4 * tool / np.linalg.norm(tool))
        assert np.abs(hk.drift(G, beside, q0, limits=False).since_start[0]).max() < 1e-8
        assert not len(hk.cusps(G, q0, starts=20, limits=False))
        assert "small closed paths" in hk.involutivity(G, hk.around(q0, 0.01)).sentence


def test_a_whole_turn_of_the_tool_is_a_loop_that_turns_the_last_joint() -> None:
    """The tool of a Panda turns once about the axis of joint 7, which alone moves, by one turn: no hole, and no cusp.
    So a box of poses with that turn is not proven; one with almost a turn is."""
    G = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    T, c, s = G.task.robot.pose(PANDA), np.cos, np.sin
    turn = [[[c(a), -s(a), 0, 0], [s(a), c(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] for a in np.arange(4) * np.pi / 2]
    walk = hk.follow(G, hk.polyline(T @ np.array(turn), closed=True), PANDA, limits=False)
    assert walk.drift()[0] == pytest.approx([0, 0, 0, 0, 0, 0, 2 * np.pi], abs=1e-8)
    assert "whole turns further" in why_elsewhere(G, walk)
    for spin, proven in ((np.pi, False), (2.8, True)):
        box = hk.workspace(box=(T[:3, 3], [1e-5] * 3), rotation=T[:3, :3], spin=spin)
        assert hk.certify(G, box, PANDA, limits=False, budget=400).whole is proven


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
