"""`ik.nearest` in a loop: where joints end after a hand has gone through and out of reach, and how long they take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_START, R3_START, campaign, sampled
from holokin.motion.ik import InverseStatus
from holokin.motion.ik.inverse_function import LEAST

REACHED, CLAMPED = InverseStatus.REACHED, InverseStatus.CLAMPED


@dataclass(frozen=True)
class Case:
    """An arm, its law, and how far the hand goes [m]."""

    ik: hk.motion.ik.InverseKinematics
    far: np.ndarray

    @property
    def robot(self) -> hk.Robot:
        return self.ik.strategy.task.robot

    @property
    def step(self) -> np.ndarray:
        """What the joints move in 20 ms."""
        fastest = self.robot.max_velocity
        return 0.02 * np.where(np.isfinite(fastest), fastest, 2.0)

    def pose(self, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The tool pose at the start, moved and turned; a point of a planar arm."""
        pose = self.robot.pose(self.ik.q0)
        pose[:3, 3] += shift
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(turn).as_matrix()
        return pose if self.ik.strategy.task._turns else pose[:2, 3]

    def tours(self, seed: int, legs: int, samples: int = 60):
        """Ways of a hand, each along straight legs between random poses: lists of poses, the last where it rests."""
        rng = np.random.default_rng(seed)
        here, turned = np.zeros(3), np.zeros(3)
        for leg in range(legs):
            there = self.far * (0.4 if leg % 2 else 1.0) * rng.uniform(-1, 1, 3)
            turn = 0.4 * rng.normal(size=3)
            shares = np.linspace(0, 1, samples)
            yield [self.pose((1 - s) * here + s * there, (1 - s) * turned + s * turn) for s in shares]
            here, turned = there, turn


WIDE, FLAT = np.array([0.9, 0.9, 0.5]), np.array([2.5, 2.5, 0.0])


def case(name: str, seven: dict[str, tuple[hk.Robot, np.ndarray]], planar: hk.Robot) -> Case:
    """A case by the name of its robot and its law."""
    robot, law = name.split()
    constraints = {"lock": lambda: hk.lock(2), "arm": hk.arm_angle}
    if robot == "planar":
        return Case(hk.ik(hk.holonomic(hk.position(planar), constraints[law]()), R3_START), FLAT)
    arm, start = seven[robot]
    return Case(hk.ik(hk.holonomic(hk.pose(arm), constraints[law]()), start), WIDE)


@pytest.fixture(scope="module")
def seven(panda: hk.Robot, iiwa14: hk.Robot) -> dict[str, tuple[hk.Robot, np.ndarray]]:
    return {"panda": (panda, PANDA_START), "iiwa": (iiwa14, IIWA_START)}


def rested(case: Case, pose: np.ndarray, q: np.ndarray, limits: bool, most: int) -> tuple[np.ndarray, int]:
    """The joints at which a resting hand leaves the robot, and after how many calls; each keeps to its step."""
    robot, step = case.robot, case.step
    for call in range(1, most + 1):
        found = case.ik.nearest(pose, q, limits=limits, step=step)
        assert (np.abs(found.q - q) <= step * (1 + 1e-9)).all()
        assert not limits or ((found.q >= robot.lower - 1e-8) & (found.q <= robot.upper + 1e-8)).all()
        assert not found.moving or (np.abs(found.q - q) >= 0.49 * step).any()
        q = found.q
        if not found.moving:
            return q, call
    raise AssertionError(f"still moving after {most} calls, at {q.tolist()}")


@pytest.mark.parametrize(
    ("name", "limits", "seed"),
    [
        ("panda lock", True, 11), ("planar lock", False, 7),
        campaign(("name", "limits", "seed"), ("iiwa arm", False, 7)),
        campaign(("name", "limits", "seed"), ("iiwa arm", True, 11)),
    ],
)  # fmt: skip
def test_a_hand_that_rests_within_reach_is_reached_in_a_known_number_of_calls(
    seven, planar_3r: hk.Robot, name: str, limits: bool, seed: int
) -> None:
    one = case(name, seven, planar_3r)
    q, seen = one.ik.q0, 0
    for tour in one.tours(seed, 12):
        for pose in tour:
            q = one.ik.nearest(pose, q, limits=limits, step=one.step).q
        pose = tour[-1]
        cold = one.ik.nearest(pose, limits=limits)
        way = (np.abs(cold.q - q) / one.step).max()
        if cold.status is REACHED and one.ik.batch(pose[None]).reached[0]:
            seen += 1
            q, _ = rested(one, pose, q, limits, int(way / LEAST) + 3)
            assert q == pytest.approx(one.ik(pose), abs=1e-9)
        else:
            q, _ = rested(one, pose, q, limits, 5000)  # wherever that is, it ends
        again = one.ik.nearest(pose, q, limits=limits, step=one.step)
        assert not again.moving
        assert again.q == pytest.approx(q, abs=1e-7)
    assert 2 < seen < 12


@pytest.mark.campaign
@sampled(1, "start", [[0, 0.5, 0, -1.4, 0, 1.2, 0], [0.3, 0.7, 0.2, -1.5, 0.1, 1.0, 0.4]])
def test_a_hand_once_round_the_base_ends_at_the_joints_that_it_began_with(iiwa14: hk.Robot, start: list[float]) -> None:
    """Joint 1 has made a full turn by then, or the tool is held on the far side: the joints go back."""
    one = Case(hk.ik(hk.holonomic(hk.pose(iiwa14), hk.arm_angle()), start), WIDE)
    pose, q = iiwa14.pose(start), np.array(start)
    x, y = pose[:2, 3]
    for angle in np.linspace(0, 2 * np.pi, 300):
        pose[:2, 3] = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
        q = one.ik.nearest(pose, q, step=one.step).q
    q, _ = rested(one, pose, q, False, 800)
    assert q == pytest.approx(start, abs=1e-9)


def test_a_wound_up_arm_has_the_joints_of_its_start_in_one_call_or_a_step_at_a_time(planar_3r: hk.Robot) -> None:
    one = Case(hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), R3_START), FLAT)
    x, y = planar_3r.pose(R3_START)[:2, 3]
    wound = R3_START + [2 * np.pi, 0, 0]
    assert one.ik.nearest([x, y], wound).q == pytest.approx(R3_START, abs=1e-12)
    q, calls = rested(one, np.array([x, y]), wound, False, 700)
    assert q == pytest.approx(R3_START, abs=1e-12)
    assert calls <= 2 * np.pi / one.step[0] / LEAST + 1


@pytest.mark.campaign
@sampled(1, "name", ["iiwa arm", "panda lock"])
def test_what_inverse_kinematics_reaches_within_the_bounds_is_reached_from_anywhere(
    seven, planar_3r: hk.Robot, name: str
) -> None:
    one = case(name, seven, planar_3r)
    rng, q, seen = np.random.default_rng(5), one.ik.q0, 0
    poses = np.array([one.pose(WIDE * rng.uniform(-1, 1, 3), 0.5 * rng.normal(size=3)) for _ in range(300)])
    known = one.ik.batch(poses)
    for pose, wanted, reached in zip(poses, known.q, known.reached, strict=True):
        found = one.ik.nearest(pose, q)
        if reached and rcond(one, wanted) > 0.1:
            seen += 1
            assert found.status is REACHED
            assert found.q == pytest.approx(wanted, abs=1e-9)
        q = found.q
    assert seen > 50


def rcond(one: Case, q: np.ndarray) -> float:
    """m / (|J| |G|), with angles in units of 0.3 m, from the public functions."""
    task = one.ik.strategy.task
    scale = np.array([1.0 if unit == "m" else 0.3 for unit in task.units])
    return float(
        task.m / np.linalg.norm(scale[:, None] * task.jacobian(q)) / np.linalg.norm(one.ik.strategy(q) / scale)
    )


@sampled(1, "name", ["panda lock", "planar lock", "ppr radial"])
def test_native_code_and_the_virtual_machine_lead_a_robot_alike(
    monkeypatch: pytest.MonkeyPatch, seven, planar_3r: hk.Robot, ppr: hk.Robot, name: str
) -> None:
    """In and out of reach, wound up, on no leaf, and on another branch."""

    def made() -> Case:
        if name != "ppr radial":
            return case(name, seven, planar_3r)
        law = hk.radial(hk.moore_penrose(hk.position(ppr)), PPR_START, steps=1)
        return Case(hk.ik(law, PPR_START), 0.2 * FLAT)

    one = made()
    start, rng = one.ik.q0, np.random.default_rng(2)
    begun = [start, start + 2 * np.pi * np.eye(len(start))[0], start + 0.3 * rng.normal(size=len(start)), -start]
    tour = [pose for tour in one.tours(4, 4, 4) for pose in tour]
    asked = [(pose, begun[i % 4], step) for i, pose in enumerate(tour) for step in (None, 10 * one.step)]
    native = [one.ik.nearest(pose, q, step=step) for pose, q, step in asked]
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    other = made()
    for a, (pose, q, step) in zip(native, asked, strict=True):
        b = other.ik.nearest(pose, q, step=step)
        assert (a.status, a.moving, a.held) == (b.status, b.moving, b.held)
        assert a.q == pytest.approx(b.q, abs=1e-8)
    assert {a.status for a in native} == {REACHED, CLAMPED}
    assert {a.moving for a in native} == {True, False}
