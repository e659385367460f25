"""Seams: the fastest change between two sheets, where it may lie, and why there is none."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import holokin as hk
from handmade_sheets import map_of, panda_map, planar_map, planar_task
from holokin.analysis.sheets import Hindrance, Sheet, Sheets, self_motion_between
from holokin.base.errors import ArgumentError, NotFiniteError, PathError, ShapeError


@pytest.fixture(scope="module")
def planar() -> Sheets:
    return planar_map(9)


def test_no_other_sampled_pose_has_a_faster_change(planar: Sheets) -> None:
    """Every pose that both serve is tried, one by one."""
    seams = planar.seams()
    np.testing.assert_array_less(0, [seam.seconds for seam in seams])
    assert len(seams) + len(seams.missing) == 3
    assert len(seams) >= 2
    for first, second in ((0, 1), (0, 2), (1, 2)):
        every = [
            self_motion_between(planar.task, a, b).seconds
            for a, b in zip(planar.q[first], planar.q[second], strict=True) if np.isfinite([a, b]).all()
        ]  # fmt: skip
        if min(every) < np.inf:
            assert seams.between(first, second).seconds == pytest.approx(min(every), rel=1e-6)
        else:
            assert (first, second) in [(none.first, none.second) for none in seams.missing]


def test_a_seam_leads_from_one_sheet_to_the_other_at_its_pose(planar: Sheets) -> None:
    seams = planar.seams(at=lambda pose: pose[0, 3] > 0)
    for seam in seams:
        for q, s in ((seam.q[0], seam.first), (seam.q[-1], seam.second)):
            np.testing.assert_allclose(q, planar.sheets[s].posture(seam.pose), atol=1e-9)
        back = seams.between(seam.second, seam.first)
        np.testing.assert_array_equal(back.q, seam.q[::-1])
        assert back.seconds == pytest.approx(seam.seconds)
        assert np.diff(back.motion.t).min() > 0
        assert str(seam) in str(seams)


def test_a_seam_of_a_panda_keeps_the_limits_of_speed_and_the_pose() -> None:
    seams = panda_map().seams()
    assert len(seams) == 1
    seam = seams[0]
    task, q = seam.task, seam.q
    walk = seam.trajectory
    assert walk.tracking_error("m") < 1e-9
    assert walk.tracking_error("rad") < 1e-9
    assert hk.check(walk, None, robot=task.robot).passed
    share = (np.abs(np.diff(q, axis=0)) / np.diff(seam.motion.t)[:, None] / task.robot.max_velocity).max()
    assert 0.98 < share <= 1 + 1e-9  # the fastest joint takes its limit
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(seams))[0].q, seam.q)


def test_seams_lie_where_the_user_wants_them(planar: Sheets) -> None:
    """At a fixture, on a line where the arm may change, on one side of a plane."""
    fixture = planar.seams(at=[1.4, 0.6])
    np.testing.assert_allclose([seam.pose[:2, 3] for seam in fixture], [[1.4, 0.6]] * len(fixture))
    assert len(fixture) > 0
    again = planar.seams(at=fixture[0].pose)
    assert [one.seconds for one in again] == [one.seconds for one in fixture]
    line = hk.workspace(box=([1.2, 0.0, 0.0], [0.0, 1.0, 0.0]))
    assert {round(float(seam.pose[0, 3]), 9) for seam in planar.seams(at=line)} == {1.2}
    behind = planar.seams(at=lambda pose: pose[0, 3] < 0)
    assert all(seam.pose[0, 3] < 0 for seam in behind)
    anywhere = planar.seams()
    for seam in behind:
        assert seam.seconds >= anywhere.between(seam.first, seam.second).seconds


def test_pairs_without_a_seam_say_why() -> None:
    task = planar_task()
    law = hk.holonomic(task, hk.linear([0, 1, -1]))
    up, down = Sheet(law, np.array([0.2, 0.9, 0.9])), Sheet(law, np.array([0.4, -0.9, -0.9]))
    space = hk.workspace(box=([1.5, 0.2, 0], [0.2, 0.2, 0]))
    free = map_of(task, space, [up, down], 6)
    assert len(free.seams()) == 1
    seam = free.seams()[0]
    angles = np.cumsum(seam.q[len(seam.q) // 2])
    middle = [np.cos(angles[0]), np.sin(angles[0])]  # the first elbow, half way
    post = hk.obstacle("post", hk.robot.Box((0.3, 0.3, 1.0)), (*middle, 0.0))
    scene = hk.Scene([post], self_collision=False)
    blocked = map_of(task, space, [up, down], 6, scene)
    for one in blocked.seams():
        report = hk.check(one.trajectory, scene, robot=task.robot)
        assert report.passed, report
    there = blocked.seams(at=seam.pose)
    assert there.missing[0].both == 1
    assert "q1 and post, 1 times" in there.missing[0].reason
    none = free.seams(at=lambda _pose: False)
    assert none.missing[0].reason == Hindrance.NO_POSE.text
    with pytest.raises(PathError, match="served by both"):
        none.between(0, 1)


@pytest.mark.campaign
def test_branches_of_an_arm_of_six_joints_have_no_seam() -> None:
    """Nothing is redundant: the elbow cannot change with the tool still."""
    task = hk.pose(hk.load("ur5e"))
    q = np.array([0.3, -1.4, 1.6, -1.7, -1.5, 0.2])
    space = hk.workspace(box=(task.robot.pose(q)[:3, 3], [0.02, 0.02, 0.02]), rotation=task.robot.pose(q)[:3, :3])
    branch = hk.ik(hk.moore_penrose(task), q).strategy
    found = hk.motion.ik.all_postures(branch, task.robot.pose(q), limits=True).q
    flipped = [p for p in found if np.abs(p - q).max() > 0.5]
    s = map_of(task, space, [Sheet(branch, q), Sheet(branch, flipped[0])], 5)
    seams = s.seams()
    assert len(seams) == 0
    assert "no joint is redundant" in seams.missing[0].reason


@pytest.mark.parametrize(
    ("at", "error"),
    [
        (np.full((4, 4), np.nan), NotFiniteError), (np.zeros(7), (ShapeError, ArgumentError)),
        (lambda _pose: "yes", ArgumentError), (np.zeros((4, 4)), ArgumentError),
    ],
)  # fmt: skip
def test_bad_places_are_refused(planar: Sheets, at: object, error: type[Exception]) -> None:
    with pytest.raises(error):
        planar.seams(at=at)
    with pytest.raises(ArgumentError):
        planar.seams(at=lambda _pose: False).between(0, 7)
