"""Proofs of stationary postures, two hands, boxes that turn: against the library's own kinematics and constraints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.base.errors import ArgumentError
from holokin.proof import certify, equation
from holokin.proof.box_proof import walked
from holokin.strategies import constraints as C
from roots import near_panda, roots_are_where_they_should_be

HANDS = ("left_flange", "right_flange")
YUMI = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])


@pytest.fixture(scope="module")
def yumi() -> hk.Robot:
    return hk.load("yumi")


@pytest.fixture(scope="module")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.mark.campaign
@sampled(1, "cost", [C.centring_cost(), C.posture_cost(PANDA_START + 0.1)], ids=["centring", "posture"])
@pytest.mark.parametrize("free", [None, (2,)], ids=["unit", "chang"])
def test_stationary_postures_of_a_panda_are_those_of_the_constraint_itself(
    panda: hk.Robot, cost: C.Cost, free: tuple[int, ...] | None
) -> None:
    """The null vector is an unknown of the proof; the constraint, by reflections, is the same along all of it."""
    G = hk.holonomic(hk.pose(panda), hk.stationary(cost, free=free))
    walk = hk.follow(G, near_panda(panda), PANDA_START, samples=20)
    proof = hk.certify(G, near_panda(panda), PANDA_START)
    assert proof.whole and proof.equation.n > proof.equation.joints == 7 and proof.low.shape == (7,)
    level = G.g(PANDA_START)
    assert max(float(np.abs(G.g(q) - level).max()) for q in walk.q) < 1e-12
    assert (proof.low <= walk.q + 1e-12).all() and (walk.q - 1e-12 <= proof.high).all()


def test_a_stationary_constraint_that_is_tilted_is_certified() -> None:
    """Its unknowns go with it; the level is that of the whole."""
    robot, q = hk.load("panda"), PANDA_START
    G = hk.holonomic(hk.pose(robot), C.tilted(hk.stationary(C.centring_cost()), lambda x: 0.1 * x[0]))
    walk = hk.follow(G, near_panda(robot), q, samples=10)
    proof = hk.certify(G, near_panda(robot), q)
    assert proof.whole and max(float(np.abs(G.g(p) - G.g(q)).max()) for p in walk.q) < 1e-12


@pytest.mark.campaign
def test_one_hand_in_the_frame_of_the_other_is_certified_with_all_fourteen_joints(yumi: hk.Robot) -> None:
    """A closed path of the left hand as the right one sees it; the least-motion rows of the start are held."""
    task = hk.strategies.tasks.relative_pose(yumi, *HANDS)
    held = np.linalg.svd(task.jacobian(YUMI))[2][6:]
    G = hk.holonomic(task, hk.linear(held))
    x = task.pose(YUMI)[:3, 3]
    walk = hk.follow(G, hk.circle(x, center=x - [0.03, 0, 0]), YUMI, samples=16, limits=False)
    proof = hk.certify(G, hk.circle(x, center=x - [0.03, 0, 0]), YUMI, limits=False)
    assert proof.whole and proof.gap < 1e-11
    for q, u in zip(walk.q, np.arange(len(walk.q)) / (len(walk.q) - 1), strict=True):
        left, right = (yumi.pose(q, hand) for hand in HANDS)
        seen = np.linalg.inv(right) @ left
        away = np.linalg.norm(seen[:3, 3] - (x - [0.03, 0, 0]))
        assert abs(away - 0.03) < 1e-10 and np.abs(held @ (q - YUMI)).max() < 1e-10, u
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)


@pytest.mark.campaign
def test_two_hands_each_on_a_path_of_its_own_are_certified(yumi: hk.Robot) -> None:
    """One turns while the other goes round a circle; the poses are those of the paths."""
    task = hk.stacked(*(hk.pose(yumi, tip=hand) for hand in HANDS))
    G = hk.holonomic(task, hk.lock(2, 9))
    left, right = task.pose(YUMI)[:, :3, 3]
    away = hk.line(right, right + [0.02, 0, 0], turn=(0, 0, 0.1))
    back = hk.line(away.end, right, turn=(0, 0, -0.1))
    paths = hk.path.synchronized(hk.circle(left, left - [0.02, 0, 0]), away + back)
    walk = hk.follow(G, paths, YUMI, samples=20, limits=False)
    proof = hk.certify(G, paths, YUMI, limits=False)
    assert proof.whole and proof.gap < 1e-11 and proof.equation.positive == 2
    assert (
        "wherever the path comes back to the tools' poses, the joints are the same" in proof.theorem
        and "|det [J; J_g]|" in proof.theorem
    )
    at = paths.at(walk.t)
    assert np.abs(task.value_batch(walk.q)[:, [0, 1, 2, 6, 7, 8]] - at.position).max() < 1e-10
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
    box = hk.workspace(box=(left, (0.01, 0.01, 0.01)))
    with pytest.raises(ArgumentError, match="one tool"):
        certify(G, box, YUMI)


@pytest.mark.campaign
def test_a_box_of_poses_that_turn_is_certified_and_verified(panda: hk.Robot, tmp_path: Path) -> None:
    """Six parameters: at its corners the joints are those of inverse kinematics on the leaf."""
    pose = panda.pose(PANDA_START)
    box = hk.workspace(box=(pose[:3, 3], (0.003, 0.003, 0.003)), rotation=pose[:3, :3], tilt=0.008, spin=0.008)
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    proof = certify(G, box, PANDA_START)
    assert proof.whole and proof.equation.d == 6 and len(proof) <= 16
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
    file = proof.save(tmp_path / "turned.json")
    assert pytest.importorskip("holokin.proof.checker").check(str(file)).whole


@pytest.mark.campaign
def test_cells_examined_one_by_one_are_those_examined_together(
    panda: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory is bounded by portions, which change no number."""
    x = panda.pose(PANDA_START)[:3, 3]
    path = hk.line(x, x - [0.1, 0, 0])
    together = certify(hk.holonomic(hk.pose(panda), hk.lock(2)), path, PANDA_START)
    monkeypatch.setattr(equation, "ROOM", 1)
    alone = certify(hk.holonomic(hk.pose(panda), hk.lock(2)), path, PANDA_START)
    assert together.equation.at_once > 1 == alone.equation.at_once
    assert np.array_equal(together.findings.omega, alone.findings.omega) and len(together) > 1


def test_a_walk_towards_a_singular_posture_ends_after_few_steps() -> None:
    """A planar arm stretched: as far as the leaf goes, to within what a proof can use."""
    robot, q = hk.load("planar-3r"), np.array([0.3, 0.3, 0.3])
    x = robot.pose(q)[:3, 3]
    reach = float(np.linalg.norm(robot.pose(np.zeros(3))[:3, 3]))
    path = hk.line(x, x / np.linalg.norm(x) * (reach + 0.05))
    postures, _, where = walked(hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]])), path, q, 256)
    end = float(np.linalg.norm(robot.pose(postures[-1])[:3, 3]))
    assert where and len(postures) < 257 and end <= reach and reach - end < path.length / 128
