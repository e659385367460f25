"""Boxes of tool poses proven by signs: the closed inverse and sampled poses are the referees."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.base.types import Array
from holokin.proof import Certificate, Extent, SignedBox
from holokin.robot import Robot
from holokin.symbolic.taylor_function import Taylor, TaylorFunction, pairs
from robot.test_closed_form import KINDS, random_arm

READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
REAL = 9
"""The column of an answer that says how real it is."""


def holding(robot: Robot, *joints: int) -> hk.strategies.HolonomicStrategy:
    constraint = hk.lock(*joints) if joints else hk.custom(lambda _q: [], rows=0)
    return hk.holonomic(hk.pose(robot), constraint)


def box_about(robot: Robot, q0: Array, half: float, tilt: float = 0.0, spin: float = 0.0, away: Array | float = 0.0):
    T = robot.pose(q0)
    return hk.workspace(box=(T[:3, 3] + away, [half] * 3), rotation=T[:3, :3], tilt=tilt, spin=spin)


def postures(proof: SignedBox, poses: Array) -> tuple[Array, Array]:
    """(postures (k, n) with the start's signs, how real they are (k,)) by the closed inverse alone."""
    leaf = proof.branch.leaf
    answers = leaf.answers(poses)
    start = leaf.postures(leaf.one(proof.strategy.task.robot.pose(proof.q0)))
    gap = np.abs((start - proof.q0 + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    row = int(np.nanargmin(gap))
    assert gap[row] < 1e-6
    return leaf.postures(answers[:, row]), answers[:, row, REAL]


def referee(proof: SignedBox | Certificate, count: int) -> None:
    """What a proof says of sampled poses, and of the place where it ended, is so."""
    assert isinstance(proof, SignedBox)
    robot = proof.strategy.task.robot
    others = proof.branch.leaf.inverse.others
    poses = proof.asked.poses(count)
    region = hk.proof.UniqueRegion(proof.strategy, proof.q0, proof.asked, proof, proof.region)
    inside = region.contains(poses)
    assert inside.all() if proof.whole else abs(inside.mean() - proof.share) < 4 / np.sqrt(count)
    q, real = postures(proof, poses[inside])
    assert (real > 0).all()
    assert np.abs(robot.pose(q) - poses[inside]).max(initial=0) < 1e-9
    if proof.limits is not None and inside.any():
        near = region.near(poses[inside, :3, 3], poses[inside, :3, :3])[0]
        turned = q + 2 * np.pi * np.round((near - q) / (2 * np.pi))
        assert (robot.beyond(turned) <= 1e-9).all()
        assert (turned[:, others] >= proof.low_joints[others] - 1e-6).all()
        assert (turned[:, others] <= proof.high_joints[others] + 1e-6).all()
    if proof.place is not None and proof.extent in (Extent.END, Extent.LIMIT):
        q, real = postures(proof, proof.region.poses_at(proof.place[None]))
        if proof.extent is Extent.END:
            assert real[0] < 0
        else:
            k = robot.joint_names.index(proof.joint)
            low, high = robot.lower[k], robot.upper[k]
            assert real[0] > 0 and (high - low >= 2 * np.pi or (q[0, k] - low) % (2 * np.pi) > high - low)
    else:
        assert proof.extent in (Extent.WHOLE, Extent.BUDGET)


def test_a_panda_with_its_last_joint_held_is_proven_on_a_box_of_8_cm_in_which_the_tool_leans():
    panda = hk.load("panda")
    proof = hk.certify(holding(panda, 6), box_about(panda, READY, 0.04, 0.15), READY)
    assert proof.whole and isinstance(proof, SignedBox) and proof.share == 1 and proof.sampled() == 1
    assert "panda_joint7 held" in proof.theorem and "as they are" in proof.model and "checker" in proof.unsaid
    referee(proof, 2000)


@pytest.mark.campaign
@pytest.mark.parametrize("limits", [False, True])
def test_a_panda_is_proven_on_20_cm_and_all_leans_of_20_degrees(limits):
    panda = hk.load("panda")
    proof = hk.certify(holding(panda, 6), box_about(panda, READY, 0.1, 0.35), READY, limits=limits)
    assert isinstance(proof, SignedBox) and proof.whole and proof.sampled() == 1
    assert limits or proof.seconds < 10
    referee(proof, 20_000)


def limited(robot: Robot, q0: Array, width: float) -> Robot:
    """The robot with limits about a posture."""
    coordinates = (replace(c, lower=x - width, upper=x + width) for c, x in zip(robot.coordinates, q0, strict=True))
    return replace(robot, coordinates=tuple(coordinates))


def check_random_arms(count: int, seed: int, budget: int) -> dict[Extent, int]:
    """Boxes of random arms, of random size: how many ended how."""
    rng, ended = np.random.default_rng(seed), dict.fromkeys(Extent, 0)
    for i in range(count):
        robot = random_arm(rng, KINDS[i // 2 % 4])
        q0 = rng.uniform(-3, 3, 6)
        if i % 2:
            robot = limited(robot, q0, 10 ** rng.uniform(-3, 0.4))
        half, tilt, spin = 10 ** rng.uniform(-4, -1.5), rng.choice([0.0, 0.01, 0.1]), rng.choice([0.0, 0.02])
        away = rng.uniform(-0.4, 0.4, 3) * rng.choice([0.0, 0.0, 0.01, 1.0])
        proof = hk.certify(
            holding(robot), box_about(robot, q0, half, tilt, spin, away), q0, limits=bool(i % 2), budget=budget
        )
        assert isinstance(proof, SignedBox)
        referee(proof, 300)
        ended[proof.extent] += 1
    return ended


@pytest.mark.campaign
def test_boxes_of_random_arms_hold_what_is_proven_of_them_and_where_a_proof_ends_there_is_no_posture():
    ended = check_random_arms(16, 1, 10)
    assert min(ended[k] for k in (Extent.WHOLE, Extent.END, Extent.LIMIT)) >= 1, ended


@pytest.mark.campaign
def test_boxes_of_many_random_arms_hold_what_is_proven_of_them():
    ended = check_random_arms(200, 2, 15)
    assert min(ended[k] for k in (Extent.WHOLE, Extent.END, Extent.LIMIT)) >= 10, ended


UR5E = (0.2, -1.2, 1.4, -1.3, -1.4, 0.5)
OTHERS = [
    ("ur5e", (), 0.04, UR5E),
    ("iiwa14", (2,), 0.04, (0.1, 0.6, 0.2, -1.4, 0.3, 0.9, 0.4)),
    ("iiwa14", (1,), 0.002, (0.1, -1.2, 0.2, -1.4, 0.3, 0.9, 0.4)),  # the other side of the plane of two axes
    ("panda", (5,), 0.01, (0.1, -0.4, 0.2, -2.2, 0.3, 1.2, 0.4)),
]


@sampled(2, ("name", "held", "half", "q0"), OTHERS)
def test_other_arms_whose_joints_have_more_turns_than_one_or_axes_in_parallel_are_proven(name, held, half, q0):
    robot = hk.load(name)
    proof = hk.certify(holding(robot, *held), box_about(robot, np.array(q0), half, 2.5 * half), q0, budget=300)
    assert proof.whole
    referee(proof, 500)


def test_a_box_over_a_fold_is_never_whole_and_beside_it_it_is():
    panda = hk.load("panda")
    stretched = np.array([0.0, 0.3, 0.0, -0.7, 0.0, 1.571, 0.785])
    G = holding(panda, 6)
    over = hk.certify(G, box_about(panda, stretched, 0.01), stretched, limits=False, budget=1000)
    assert (
        isinstance(over, SignedBox)
        and not over.whole
        and over.extent is Extent.END
        and "no posture has the three signs" in over.theorem
    )
    assert 0 < over.share < over.sampled() + 0.02 and over.share > over.sampled() - 0.15
    referee(over, 1000)
    assert hk.certify(G, box_about(panda, stretched, 0.002), stretched, limits=False).whole


def test_inverse_kinematics_in_a_region_that_signs_prove_answer_with_the_function_of_the_region():
    robot, q0 = hk.load("ur5e"), np.array(UR5E) + [0, 0, 0, 0, 0, 4.0]
    G = holding(robot)
    region = hk.unique_region(G, q0, box_about(robot, q0, 0.03, 0.1, 1.0), limits=True)
    assert region.whole and region.holds_start and isinstance(region.certificate, SignedBox)
    ik, poses = hk.ik(G, q0, region=region), region.workspace.poses(200)
    found = ik.batch(poses)
    assert found.reached.all() and np.abs(robot.pose(found.q) - poses).max() < 1e-9
    assert np.ptp(found.q[:, 5]) < 4 and np.abs(found.q[:, 5] - q0[5]).max() < 2


def test_with_a_scene_or_a_file_of_cells_the_proof_is_that_of_cells_of_joints(tmp_path):
    panda = hk.load("panda")
    box = box_about(panda, READY, 0.005)
    proof = hk.certify(holding(panda, 6), box, READY, keep_in=tmp_path / "box.cells")
    assert proof.whole and isinstance(proof, Certificate)


@pytest.mark.parametrize(
    "rule",
    [campaign("rule", hk.lock(4)), hk.lock(6, follows=lambda p, _R: 0.3 * p[0])],
    ids=["degree four", "a joint that follows"],
)
def test_where_signs_alone_do_not_tell_the_posture_the_proof_is_that_of_cells_of_joints(rule, monkeypatch):
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    panda = hk.load("panda")
    G, q0 = hk.holonomic(hk.pose(panda), rule), READY + [0.1, 0, 0.2, 0, 0.3, 0, 0]
    proof = hk.certify(G, box_about(panda, q0, 1e-3), q0, budget=200)
    assert isinstance(proof, Certificate) and proof.whole
    assert isinstance(hk.unique_region(G, q0, box_about(panda, q0, 1e-3), budget=200).certificate, Certificate)


def test_taylor_models_hold_the_numbers_of_their_boxes_and_are_off_by_the_third_power_of_the_size():
    rng = np.random.default_rng(3)
    x = ca.SX.sym("x", 3)
    a, b = 2 + ca.sumsqr(x), x[0] * x[1] - 3
    y = ca.vertcat(a / b, ca.sqrt(a * a + b * b), 1 / (a * x[2] + 9), (a - b) * (a + b), ca.fmin(a, b), ca.fabs(b))
    function, numbers = TaylorFunction("y", {"x": x}, y), ca.Function("y", [x], [y])
    off = []
    for size in (0.2, 0.02):
        c, d = rng.uniform(-1, 1, (3, 50)), 3
        L = np.zeros((3, d, 50))
        L[np.arange(3), np.arange(3)] = size
        i, j, _ = pairs(d)
        model = function(Taylor(c, L, np.zeros((3, len(i), 50)), np.zeros((3, 50))))
        low, high = model.bounds
        assert (high - low < 200 * size).all()
        for _ in range(40):
            u = rng.uniform(-1, 1, (d, 50)) if rng.uniform() < 0.5 else rng.choice([-1.0, 1.0], (d, 50))
            exact = np.array(numbers(c + size * u))
            near = model.c + np.einsum("idk,dk->ik", model.L, u) + np.einsum("ipk,pk->ik", model.Q, u[i] * u[j])
            assert (np.abs(exact - near) <= model.r).all()
            assert ((low <= exact) & (exact <= high)).all()
        off.append(model.r.max(axis=1))
    assert ((off[1] < off[0] / 500) | (off[1] < 1e-12)).all()
