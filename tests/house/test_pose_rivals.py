"""What the comparison of inverse kinematics counts: all poses, true jumps, and answers within the joint limits."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest
from benchmarks import pose_rivals, trackers

import holokin as hk

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
ROBOT = hk.load("panda")
READY_Z = float(ROBOT.pose(READY)[2, 3])
LOCKED = hk.ik(hk.holonomic(hk.pose(ROBOT), hk.lock(2)), READY)
OTHER = hk.ik(hk.holonomic(hk.pose(ROBOT), hk.lock(2)), hk.motion.ik.move_to_leaf(LOCKED.strategy, READY, 0.6))


def moved(**by: float) -> np.ndarray:
    pose = ROBOT.pose(READY)
    pose[:3, 3] += [by.get(axis, 0.0) for axis in "xyz"]
    return pose


def test_two_leaves_that_meet_at_a_plane_jump_on_the_legs_that_cross_it_and_on_no_other() -> None:
    def begin(_q: np.ndarray) -> pose_rivals.Solve:
        return lambda pose: (LOCKED if pose[1, 3] < 0.013 else OTHER)(pose)

    poses = np.array([moved(y=-0.1), moved(y=0.1), moved(y=0.1, z=-0.1), moved(y=-0.1, x=-0.05)])
    found = pose_rivals.compared("two leaves", begin, ROBOT, READY, poses, 3, 5)
    assert found.found.all()
    assert found.jumps.tolist() == [False, True, False, True]
    assert found.whole.tolist() == [True, False, True, False]
    assert found.spread == pytest.approx(0, abs=1e-12)  # a function of the pose, jumps or not


def test_a_fast_motion_is_no_jump() -> None:
    """Joint 7 turns with the tool by 1.5 rad in one step, and evenly on a finer one."""
    turned = moved()
    turned[:3, :3] = turned[:3, :3] @ np.array(
        [[np.cos(1.5), -np.sin(1.5), 0], [np.sin(1.5), np.cos(1.5), 0], [0, 0, 1]]
    )
    ends = (moved(), turned)
    assert np.abs(LOCKED(turned) - LOCKED(moved())).max() > pose_rivals.JUMP
    assert pose_rivals.jumps_of(lambda _q: LOCKED, ROBOT, READY, ends, 1) == (False, True)
    assert pose_rivals.jumps_of(lambda _q: LOCKED, ROBOT, READY, ends, 1, finer=0) == (True, False)


def test_a_leg_with_an_answer_past_the_limits_or_with_none_is_not_whole() -> None:
    """A full turn of a joint past its limits is a jump, too: nothing hides behind a limit."""
    ends = (moved(), moved(z=-0.1))
    for turn, jumps in ((None, False), (2 * np.pi, True)):

        def begin(_q: np.ndarray, turn=turn) -> pose_rivals.Solve:
            def solve(pose: np.ndarray) -> np.ndarray | None:
                inside = not 0.04 < READY_Z - pose[2, 3] < 0.06
                return LOCKED(pose) if inside else None if turn is None else LOCKED(pose) + turn * np.eye(7)[6]

            return solve

        assert pose_rivals.jumps_of(begin, ROBOT, READY, ends, 20) == (jumps, False)


def test_every_pose_of_the_box_counts_also_those_that_no_law_reaches(monkeypatch: pytest.MonkeyPatch) -> None:
    def locked(pose: np.ndarray) -> np.ndarray | None:
        return pose_rivals._or_none(lambda: LOCKED(pose))

    monkeypatch.setattr(pose_rivals, "ours", lambda *_: [("locked", lambda _q: locked)])
    monkeypatch.setattr(pose_rivals, "rivals", lambda *_: ([("none", lambda _q: lambda pose: None)], []))
    lines = pose_rivals.poses_page(ROBOT, READY, 1e-6, quick=True)
    text = "\n".join(lines)
    assert "to 4 poses drawn" in text
    reached = int(text.partition("All poses count: ")[2].split()[0])
    assert 0 < reached < 4  # some are out of reach or limits: they are counted, not left out
    rows = {cells[1].strip(): [cell.strip() for cell in cells] for line in lines if len(cells := line.split("|")) > 8}
    assert rows["locked"][4] == f"{reached / 4:.0%}"
    assert rows["none"][4] == rows["none"][8] == "0%"


def test_a_library_is_asked_from_its_last_answer_and_from_one_seed() -> None:
    seeds = []
    (label, last), (name, one) = pose_rivals._both("a", lambda pose, seed: seeds.append(seed[0]) or seed + 1, READY)
    assert (label, name) == ("a", "a, from one seed")
    for begin in (last, one):
        solve = begin(READY)
        solve(moved())
        solve(moved())
    assert seeds == [0.0, 1.0, 0.0, 0.0]


class Tracker:
    """It drifts by 0.25 rad in joint 1 a circle where it is told to, and holds beyond a reach."""

    def __init__(self, q: np.ndarray, drifts: bool) -> None:
        self.q, self.drifts = q, drifts

    def update(self, pose: np.ndarray) -> types.SimpleNamespace:
        held = self.q[1] > 0.5
        step = np.eye(len(self.q))[0] * 0.25 / trackers.SAMPLES * self.drifts
        self.q = self.q + step
        return types.SimpleNamespace(
            q=self.q,
            status=types.SimpleNamespace(name="HELD" if held else "OK"),
            reason="unreachable" if held else None,
        )


def test_the_drift_of_a_tracker_is_measured_at_every_start_and_refused_circles_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def from_prebuilt(name: str) -> types.SimpleNamespace:
        return types.SimpleNamespace(
            joint_limits=[(-1.0, 1.0), None, (-1.0, 2.0)], solver_name="a", fk=lambda q: np.eye(4),
            tracker=lambda q: Tracker(q, name == "iiwa14"),
        )  # fmt: skip

    ssik = types.SimpleNamespace(Manipulator=types.SimpleNamespace(from_prebuilt=from_prebuilt))
    monkeypatch.setitem(sys.modules, "ssik", ssik)
    found = trackers.tracked("iiwa14", 12)
    assert len(found.drift) + found.held["unreachable"] == 12
    assert 0 < found.held["unreachable"] < 12
    assert found.drift == pytest.approx(0.25)
    monkeypatch.setattr(trackers, "version", lambda name: "0.0")
    rows = {cells[1].strip(): cells for line in trackers.tracker_page(True) if len(cells := line.split("|")) > 8}
    assert (rows["iiwa14"][5].strip(), rows["iiwa14"][8].strip()) == ("0", "2.5e-01")
    assert rows["Panda"][3].strip() == rows["Panda"][5].strip()


def test_without_ssik_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ssik", None)
    assert "Left out: ssik" in "\n".join(trackers.tracker_page(True))
