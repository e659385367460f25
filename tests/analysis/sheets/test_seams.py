"""Seams: the fastest change between two sheets, where it may lie, and why there is none."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from benchmarks.disc_law import disc_law, disc_starts
from benchmarks.grids import cut_pieces, grid_resolution, planar_grid
from benchmarks.sheets import LIMIT, LINKS, grid_workspace, limits_of, poses_of
from benchmarks.sheets import planar_task as grid_task
from scipy.spatial import KDTree

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
            assert seams.between(first, second).seconds == pytest.approx(min(every), rel=1e-9)
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
    none = free.seams(at=lambda _pose: False)
    assert none.missing[0].reason == Hindrance.NO_POSE.text
    with pytest.raises(PathError, match="served by both"):
        none.between(0, 1)


def test_branches_of_an_arm_of_six_joints_have_no_seam() -> None:
    """Nothing is redundant: the elbow cannot change with the tool still."""
    task = hk.pose(hk.load("ur5e"))
    q = np.array([0.3, -1.4, 1.6, -1.7, -1.5, 0.2])
    space = hk.workspace(box=(task.robot.pose(q)[:3, 3], [0.02, 0.02, 0.02]), rotation=task.robot.pose(q)[:3, :3])
    branch = hk.ik(hk.moore_penrose(task), q).strategy
    found = hk.motion.ik.all_postures(branch, task.robot.pose(q), limits=True, starts=64).q
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


CELLS = 200
"""Of the grid over the disc, a side."""


@pytest.mark.campaign
def test_one_leaf_has_a_cut_of_the_disc_as_short_as_the_best_of_the_grid() -> None:
    """With postures of q3 >= 0 alone the random search of the grid finds fewer pairs; seed 12 is among the best
    of 42. The leaf leaves out some positions of the rim, and is cut along one line only. Where they get the posture of
    their nearest neighbour, too, no pair is added.
    """
    grid = planar_grid(LINKS, limits_of(LIMIT), CELLS)
    s = hk.sheets(
        grid_task(), grid_workspace(CELLS), [disc_law(grid_task())], q0=disc_starts()[[0, 2]], share=0.9975,
        samples=CELLS**2, search=False,
    )  # fmt: skip
    q = s.batch(poses_of(grid.points)).q.copy()
    there = np.isfinite(q[:, 0])
    assert there.mean() > 0.9997
    assert np.hypot(*grid.points[~there].T).min() > 2.8
    turned = np.cumsum(q[there], axis=1)
    tool = np.stack([np.cos(turned).sum(axis=1), np.sin(turned).sum(axis=1)], axis=1)
    np.testing.assert_allclose(tool, grid.points[there], atol=1e-9)
    assert np.abs(q[there]).max() <= LIMIT + 1e-9
    q[~there] = q[there][KDTree(grid.points[there]).query(grid.points[~there])[1]]
    cut = np.abs(q[grid.pairs[:, 0]] - q[grid.pairs[:, 1]]).max(axis=1) > 10.0 * grid.step
    assert cut_pieces(grid.points[grid.pairs[cut]].mean(axis=1), grid.step) == 1
    best = grid_resolution(LINKS, limits_of(LIMIT), CELLS, seed=12, free=lambda q: q[:, 2] >= 0)
    assert best.resolved == 1.0
    np.testing.assert_array_equal(best.grid.points, grid.points)
    assert cut.sum() <= best.grid.cut(best.q).sum() == 142
