"""With a compiler and without one the answers are the same: status, what holds the tool, and joints to 1e-6."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, campaign
from holokin.motion.ik import InverseKinematics, InverseStatus, Nearest

T = TypeVar("T")
READY = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
IIWA = np.array([0.3, 0.5, 0.2, -1.4, 0.1, 0.9, 0.2])
PLANAR = np.array([0.3, 0.9, -0.7])
FOUR = np.eye(7)[[2, 4, 5, 6]]

CASES: dict[str, tuple[str, Callable[[hk.Robot], hk.Strategy], np.ndarray]] = {
    "planar, lock": ("planar-3r", lambda robot: hk.holonomic(hk.position(robot), hk.lock(2)), PLANAR),
    "planar, sum": ("planar-3r", lambda robot: hk.holonomic(hk.position(robot), hk.linear([0.2, -0.1, 1.0])), PLANAR),
    "planar, radial": ("planar-3r", lambda robot: hk.radial(hk.moore_penrose(hk.position(robot)), PLANAR), PLANAR),
    "six axes": ("irb140", lambda robot: hk.moore_penrose(hk.pose(robot)), np.deg2rad([10, 40, 10, 20, 50, 30])),
    "lock": ("panda", lambda robot: hk.holonomic(hk.pose(robot), hk.lock(2)), PANDA_START),
    "sum": ("panda", lambda robot: hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0])), PANDA_START),
    "position": ("panda", lambda robot: hk.holonomic(hk.position(robot), hk.linear(FOUR)), PANDA_START),
    "arm angle": ("panda", lambda robot: hk.holonomic(hk.pose(robot), hk.arm_angle()), PANDA_START),
    "arm angle, ready": ("panda", lambda robot: hk.holonomic(hk.pose(robot), hk.arm_angle()), READY),
    "iiwa, lock": ("iiwa14", lambda robot: hk.holonomic(hk.pose(robot), hk.lock(2)), IIWA),
    "iiwa, arm angle": ("iiwa14", lambda robot: hk.holonomic(hk.pose(robot), hk.arm_angle()), IIWA),
}
SUITE = {"planar, lock": 4, "lock": 3}
"""Cases of the suite, and of how many poses."""


class Twins:
    """A strategy with native code and the same one without."""

    def __init__(self, case: str, limits: bool, patch: pytest.MonkeyPatch) -> None:
        name, make, self.q0 = CASES[case]
        self.robot, self.limits, self.patch = hk.load(name), limits, patch
        self.laws = make(self.robot), make(self.robot)

    @cached_property
    def ik(self) -> tuple[InverseKinematics, InverseKinematics]:
        native, machine = self.both(lambda law: hk.ik(law, self.q0, limits=self.limits), self.laws)
        assert self.both(lambda ik: "virtual machine" in ik.engine, (native, machine)) == (False, True)
        return native, machine

    def both(self, ask: Callable[..., T], made: tuple | None = None) -> tuple[T, T]:
        """What both answer; a strategy's engine is chosen when it is first asked."""
        found = []
        for flag, one in zip("10", made or self.ik, strict=True):
            self.patch.setenv("HOLOKIN_NATIVE", flag)
            found.append(ask(one))
        return found[0], found[1]

    def agree(self, *arguments: object, **named: object) -> Nearest:
        """The answer of both to `nearest`."""
        a, b = self.both(lambda ik: ik.nearest(*arguments, **named))
        assert (a.status, a.held, a.moving) == (b.status, b.held, b.moving), (arguments, a, b)
        assert np.abs(a.q - b.q).max() < 1e-6 and abs(a.distance - b.distance) < 1e-7, (arguments, a, b)
        return a

    def drawn(self, count: int, seed: int) -> np.ndarray:
        """Poses about the start's, many of them out of reach."""
        rng, poses = np.random.default_rng(seed), np.tile(self.robot.pose(self.q0), (count, 1, 1))
        if self.robot.planar:
            poses[:, :2, 3] += rng.uniform(-2.0, 2.0, (count, 2))
            return poses
        poses[:, :3, 3] += rng.uniform(-0.5, 0.5, (count, 3))
        turns = rng.choice([0, 0.2, 0.6], (count, 1)) * rng.normal(size=(count, 3))
        poses[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix() @ poses[:, :3, :3]
        return poses


@pytest.mark.parametrize("limits", [True, campaign("limits", False)])
@pytest.mark.parametrize("case", [case if case in SUITE else campaign("case", case) for case in CASES])
def test_poses_within_reach_at_its_edge_and_beyond_have_one_answer(
    case: str, limits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By `batch`, `near` and `nearest`: cold, from the last answer, in steps, and where the edge is crossed."""
    pair = Twins(case, limits, monkeypatch)
    poses, rng = pair.drawn(SUITE.get(case, 3 if "angle" in case else 6), len(case)), np.random.default_rng(0)
    native, machine = pair.both(lambda ik: ik.batch(poses))
    assert np.array_equal(native.status, machine.status) and not native.reached.all()
    assert np.abs(native.q - machine.q)[native.reached].max(initial=0.0) < 1e-9
    for q, pose in zip(native.q[native.reached], poses[native.reached], strict=True):
        a, b = pair.both(partial(lambda pose, q, ik: ik.near(pose, q), pose, q + 0.01))
        assert np.abs(a - b).max() < 1e-9
    last = np.repeat(pair.q0, 2)[::2]  # not one number beside another in memory
    for pose in poses:
        found = pair.agree(pose)
        pair.agree(pose, last)
        pair.agree(pose, pair.q0 + rng.uniform(-0.02, 0.02, len(pair.q0)), step=0.3)
        last = found.q
        if found.status is InverseStatus.CLAMPED:  # in and out over the edge, where the tool is held
            way = pose[:3, 3] - found.pose[:3, 3]
            for off in (-1e-3, -1e-5, 1e-5, 1e-3):
                there = found.pose.copy()
                there[:3, 3] += off * way / np.linalg.norm(way)
                pair.agree(there, found.q)


@pytest.mark.campaign
def test_a_panda_finds_a_nearest_pose_to_which_the_way_takes_hundreds_of_pieces(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With its arm angle: without native code a way of over 200 pieces was not gone, and a farther place was found."""
    pair = Twins("arm angle", False, monkeypatch)
    pose = pair.robot.pose(pair.q0)
    pose[:3, 3] += np.random.default_rng(0).uniform(-0.5, 0.5, (16, 3))[6]
    assert pair.agree(pose).distance == pytest.approx(0.012210, abs=1e-6)


@pytest.mark.parametrize("case", [case if case == "planar, lock" else campaign("case", case) for case in CASES])
def test_steps_and_paths_are_the_same(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of steps status, scale and which joints hold them, too: many begin with joints at their limits."""
    pair, rng, held = Twins(case, True, monkeypatch), np.random.default_rng(1), set()
    robot, q0 = pair.robot, pair.q0
    low, high = robot.ranges(np.pi)
    robot = hk.with_limits(robot, lower=low, upper=high)
    laws = CASES[case][1](robot), CASES[case][1](robot)
    native, machine = pair.both(lambda law: hk.controller(law, dt=0.01, q0=q0), laws)
    for _ in range(60):
        q = np.clip(q0 + rng.uniform(-1, 1, robot.n), low, high)
        q = np.where(rng.random(robot.n) < 0.2, np.where(rng.random(robot.n) < 0.5, low, high), q)
        pose, twist = robot.pose(q + rng.uniform(-0.005, 0.005, robot.n)), rng.uniform(-0.3, 0.3, 6)
        a, b = native.step(q, pose, twist), machine.step(q, pose, twist)
        assert np.abs(a - b).max() < 1e-9 * max(1.0, np.abs(a).max())
        assert (native.status, native.holding) == (machine.status, machine.holding)
        assert native.scale == pytest.approx(machine.scale, abs=1e-12)
        held.add(native.holding)
    assert len(held) > 2
    at = robot.pose(q0)[:3, 3]
    loop = hk.circle(at, center=at - [0.03, 0.0, 0.0])
    a, b = pair.both(lambda law: hk.follow(law, loop, q0, samples=40, native=law is laws[0]).q, laws)
    assert np.abs(a - b).max() < 1e-9
