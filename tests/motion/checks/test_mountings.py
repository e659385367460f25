"""A mounting moves the shapes of a robot and changes nothing else; a tool leaves the arm that carries it as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import sampled, urdf
from holokin.motion.checks import Clearances
from holokin.robot import Box, Capsule, Robot, chain_length

ARMS = ["ur5e", "mobile-ur5e", "yumi", "two on the ground", "DH table", "a leg beside three", "an arm with a torch"]


def arm_of(name: str, rng: np.random.Generator) -> Robot:
    if name == "two on the ground":
        ur = hk.load("ur5e")
        return hk.compose(
            hk.robot.Part(ur, pose=[0, -0.5, 0], prefix="a_"), hk.robot.Part(ur, on="base", pose=[0, 0.6, 0.1])
        )
    if name == "DH table":
        rows = [
            dict(zip(("a", "d", "alpha"), [*rng.uniform(0.1, 0.4, 2), rng.choice([0, 1.5, -1.5])], strict=True))
            for _ in range(5)
        ]
        return hk.from_dh(rows, base=pose(rng))
    if name == "a leg beside three":
        return hk.load(urdf("a1.urdf"), tip="FR_foot")
    if name == "an arm with a torch":
        return hk.robot.with_shape(
            hk.with_tool(hk.load("ur5e"), [0.1, 0, 0.2]), "torch", Capsule(0.02, 0.2), [0, 0, -0.1]
        )
    return hk.load(name)


def pose(rng: np.random.Generator) -> np.ndarray:
    """A pose up to 5 m away, turned anyhow."""
    return hk.with_base_pose(hk.load("planar-3r"), rng.uniform(-5, 5, 3), rng.uniform(-3, 3, 3)).joints[0].placement


def mounted(robot: Robot, rng: np.random.Generator) -> Robot:
    return hk.with_base_pose(robot, rng.uniform(-5, 5, 3), rng.uniform(-3, 3, 3))


def apart(robot: Robot, Q: np.ndarray) -> tuple[dict[tuple[str, str], np.ndarray], list[Any]]:
    """Pair -> its distances at postures; what is left out, and why."""
    found = Clearances.of(robot, hk.Scene())
    left = [(one.pair, one.reason) for one in found.pairs.left_out]
    return dict(zip(found.names, found.distances(Q).T, strict=True)), left


@sampled(1, "seed", range(30))
@pytest.mark.parametrize("name", ARMS)
def test_wherever_a_robot_is_mounted_its_links_are_as_far_apart(name: str, seed: int) -> None:
    """At random postures, as `check` finds, and with the same pairs left out; so is the chain's length."""
    rng = np.random.default_rng(seed)
    robot = arm_of(name, rng)
    there = mounted(robot, rng)
    Q = rng.uniform(*robot.ranges(1.0), (4, robot.n))
    exact = name != "a leg beside three"  # coal's iteration ends at 1e-6
    (here, left), (moved, left_there) = apart(robot, Q), apart(there, Q)
    assert left == left_there and here.keys() == moved.keys()
    for pair, distances in here.items():
        assert moved[pair] == pytest.approx(distances, rel=1e-12, abs=1e-12 if exact else 1e-6)
    assert chain_length(there) == pytest.approx(chain_length(robot), rel=1e-12)
    if exact:
        reports = [hk.check(Q[:1], hk.Scene(clearance=0.01), robot=one) for one in (robot, there)]
        assert len({(r.passed, len(r.findings), r.remarks) for r in reports}) == 1


def test_the_base_of_a_hung_arm_is_as_long_as_on_the_floor_and_a_pedestal_is_an_obstacle() -> None:
    """The UR5e's base is 0.1625 m high: so a ball halfway up to the ceiling is free, and a named column is hit."""
    arm = hk.load("ur5e")
    hung = hk.robot.with_capsules(hk.with_base_pose(arm, [0, 0, 2.6], [np.pi, 0, 0]))
    (base,) = [shape for shape in hung.shapes if shape.link == "base"]
    assert isinstance(base.shape, Capsule) and base.shape.length == pytest.approx(0.1625)
    assert base.placement[:3, 3] == pytest.approx([0, 0, 2.6 - 0.1625 / 2])
    q = np.array([[0, -1.2, 1.3, -1.6, -1.5, 0]])
    column = hk.obstacle("column", Box([0.2, 0.2, 2.6]), [0.0, 0.0, 1.3])
    assert hk.check(q, robot=hung).passed and "column" in str(
        hk.check(q, hk.Scene(obstacles=[column]), robot=hung).findings
    )
    assert hk.robot.reach(hung) == pytest.approx(hk.robot.reach(arm))
    assert hung.skeleton(q[0])[0][0] == pytest.approx([0, 0, 2.6])


def test_nothing_is_between_two_arms_that_stand_apart() -> None:
    """A ball on the ground between them is free; each has a base of its own, which the other one may hit."""
    ur = hk.load("ur5e")
    both = hk.compose(
        hk.robot.Part(ur, pose=[0, -0.35, 0], prefix="a_"), hk.robot.Part(ur, on="base", pose=[0, 0.35, 0], prefix="b_")
    )
    up = np.tile([0, -np.pi / 2, 0, -np.pi / 2, 0, 0], 2)
    ball = hk.obstacle("ball", Capsule(0.05), [0, 0.1, 0.05])
    assert hk.check(up[None], hk.Scene(obstacles=[ball]), robot=both).passed
    low = up.copy()
    low[:6] = [-1.67, 0.71, -0.9, 1.36, 1.62, 0.1]  # the wrist of one arm is in the foot of the other
    found = [one.what for one in hk.check(low[None], robot=both).findings]
    assert found and all("base of b_shoulder_pan_joint" in pair for pair in found)


def test_a_world_that_carries_a_robot_by_a_fixed_joint_is_a_mounting(tmp_path: Path) -> None:
    """As it is written by `to_urdf` and `to_mjcf`, and in a URDF whose root is "world"."""
    arm = hk.load("ur5e")
    there = hk.with_base_pose(arm, [1, 2, 3], [0.3, 0.2, 0.1])
    (tmp_path / "arm.urdf").write_text(hk.robot.to_urdf(there), "utf-8")
    pytest.importorskip("mujoco")
    Q = np.random.default_rng(0).uniform(-2, 2, (4, 6))
    here = apart(arm, Q)[0]
    for back in (hk.load(tmp_path / "arm.urdf"), hk.robot.from_mjcf(hk.robot.to_mjcf(there), tip="tool0")):
        assert back.pose(Q) == pytest.approx(there.pose(Q), abs=1e-12)
        again = apart(back, Q)[0]
        assert all(again[pair] == pytest.approx(of, rel=1e-12, abs=1e-12) for pair, of in here.items())


@sampled(3, "seed", range(20))
def test_a_tool_leaves_the_links_before_it_as_they_are(seed: int) -> None:
    """Radii count without it, and what was covered stays so: the last link gets what the tool needs, beside its own."""
    rng = np.random.default_rng(seed)
    arm = hk.load(["ur5e", "panda", "yumi-arm"][seed % 3])
    torch = hk.with_tool(mounted(arm, rng), rng.uniform(-0.3, 0.3, 3), rng.uniform(-3, 3, 3))
    torch = hk.with_tool(torch, rng.uniform(-0.3, 0.3, 3), name="tip of the torch")
    Q = rng.uniform(*arm.ranges(1.0), (20, arm.n))
    before, after = apart(arm, Q)[0], apart(torch, Q)[0]
    last = arm.joints[arm.tips[0].joint].name
    for pair in before.keys() & after.keys():
        same = last not in pair
        assert np.all(np.abs(after[pair] - before[pair]) < 1e-12 if same else after[pair] < before[pair] + 1e-12)
    assert {pair for pair in before if last not in pair} == {pair for pair in after if last not in pair}
    assert chain_length(torch) == pytest.approx(chain_length(arm), rel=1e-12)
    assert sum(b.mass for b in hk.robot.weighed(arm).bodies if b.joint < torch.tips[0].joint) == pytest.approx(
        sum(b.mass for b in hk.robot.weighed(torch).bodies if b.joint < torch.tips[0].joint)
    )


BARS = {"a": 0.5, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0}


def on_the_spot_and_away() -> list[tuple[Robot, hk.Task, Any, np.ndarray]]:
    """Three bars in a plane as they are and mounted elsewhere; a task, a box that is the same seen from the base."""
    bars, q0 = hk.from_dh([{**BARS, "d": 0.1}, BARS, BARS], name="three bars"), np.array([0.3, 0.9, 0.9])
    found = []
    for robot in (bars, hk.with_base_pose(bars, [3.0, -2.0, 4.0], [0, 0, np.pi / 2])):
        space = hk.workspace(box=(robot.pose(q0)[:3, 3], [0.02, 0.02, 0.0]), rotation=np.eye(3))
        found.append((robot, hk.position(robot, rows=[0, 1]), space, q0))
    return found


def test_a_proof_does_not_depend_on_the_mounting() -> None:
    proofs = [
        hk.certify(hk.holonomic(task, hk.linear([[0, 1, -1]])), space, q0, scene=hk.Scene(clearance=0.01))
        for _, task, space, q0 in on_the_spot_and_away()
    ]
    near, far = (proof.demands.clear for proof in proofs)
    assert near.looked_at.left_out and near.looked_at.left_out == far.looked_at.left_out
    assert [pair.names for pair in near.pairs] == [pair.names for pair in far.pairs]
    assert proofs[0].whole and proofs[1].whole
    assert proofs[1].findings.apart.min() == pytest.approx(proofs[0].findings.apart.min(), abs=1e-3)


@pytest.mark.campaign
def test_designs_and_advice_do_not_depend_on_the_mounting() -> None:
    said = []
    for _robot, task, space, q0 in on_the_spot_and_away():
        made = hk.design(task, space, q0, scene=hk.Scene(clearance=0.01), degree=1, samples=16)
        advice = hk.advise(task, space, scene=hk.Scene(clearance=0.01))
        said.append((made.holds, made.checked.closest.names, made.checked.clearance, advice.best.coverage))
    assert said[0][:2] == said[1][:2] and said[0][2:] == pytest.approx(said[1][2:], abs=5e-3)
