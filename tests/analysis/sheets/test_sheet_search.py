"""The search for sheets ends where it should: at its share, at Ctrl-C, at bad numbers, and says why poses are left."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.disc_law import disc_law, disc_starts

import holokin as hk
from conftest import campaign
from handmade_sheets import disc, planar_task
from holokin.analysis.coverage.starts import Candidate
from holokin.analysis.sheets import PoseRest, candidate_sheets
from holokin.analysis.sheets.sheet_growth import SearchedPoses
from holokin.base.errors import ArgumentError, NoSheetError, OutOfReachError


def test_what_is_out_of_reach_is_told_from_what_limits_forbid() -> None:
    """Behind the base, near the edge, the limits of q1 leave a notch; outside of 3 m nothing reaches."""
    task = planar_task()
    s = hk.sheets(task, disc(3.5), [hk.holonomic(task, hk.linear([0, 1, -1]))], samples=80, share=0.5)
    radius = np.linalg.norm(s.poses[:, :2, 3], axis=1)
    np.testing.assert_array_equal(s.rest == PoseRest.OUT_OF_REACH, radius > 3)
    behind = s.rest == PoseRest.LIMITS
    assert (radius[behind] > 2.7).all()
    assert (s.poses[behind][:, 0, 3] < 0).all()
    with pytest.raises(NoSheetError, match="serve"):
        s([3.4, 0.0])


def test_an_arm_of_six_joints_has_its_branches_as_sheets() -> None:
    """Nothing is redundant: the sheets are branches, and each pose of the box has the joints of one."""
    arm = hk.load("ur5e")
    s = hk.sheets(hk.pose(arm), hk.workspace(box=([0.4, 0.1, 0.3], [0.1, 0.2, 0.1]), tilt=0.2), samples=12)
    assert s.share == 1.0
    for i in np.flatnonzero(s.served)[:10]:
        np.testing.assert_allclose(arm.pose(s(s.poses[i])[1]), s.poses[i], atol=1e-9)


def test_an_obstacle_takes_poses_away_and_is_named() -> None:
    task = planar_task()
    wall = hk.obstacle("wall", hk.robot.Box((0.2, 4.0, 1.0)), (1.6, 0.0, 0.0))
    law = [hk.holonomic(task, hk.linear([0, 1, -1]))]
    s = hk.sheets(
        task, disc(), law, samples=24, share=0.5, scene=hk.Scene(obstacles=[wall], clearance=0.05, self_collision=False)
    )
    beyond = s.poses[:, 0, 3] > 2.2
    assert (s.rest[beyond] >= PoseRest.NOT_COVERED).all()
    assert PoseRest.BLOCKED in s.rest
    everywhere = hk.obstacle("block", hk.robot.Box((9.0, 9.0, 1.0)), (0, 0, 0))
    with pytest.raises(OutOfReachError, match="obstacle"):
        hk.sheets(task, disc(), law, samples=8, scene=hk.Scene(obstacles=[everywhere]))


def test_control_c_keeps_what_was_found() -> None:
    task, said = planar_task(), []

    def say(words: str) -> None:
        said.append(words)
        if "leaves serve" in words:
            raise KeyboardInterrupt

    s = hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=60, progress=say)
    assert s.stopped
    assert len(s) > 0
    assert "stopped early" in s.sentence


def test_control_c_while_the_sheets_are_asked_keeps_what_was_found() -> None:
    task = planar_task()

    def say(words: str) -> None:
        if words == "asking the sheets":
            raise KeyboardInterrupt

    s = hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=40, share=0.3, progress=say)
    assert s.stopped
    assert s.served.any()
    assert s.batch(s.poses[s.served]).served.all()


def interrupted_in(monkeypatch: pytest.MonkeyPatch, name: str, at: int) -> list[int]:
    """Ctrl-C in a call of a function of the search, the `at`-th one; the count of its calls."""
    count, honest = [0], getattr(candidate_sheets, name)

    def interrupted(*words: Any) -> Any:
        count[0] += 1
        if count[0] == at:
            raise KeyboardInterrupt
        return honest(*words)

    monkeypatch.setattr(candidate_sheets, name, interrupted)
    return count


def test_of_many_poses_a_part_is_searched_and_the_map_says_what_all_of_them_get() -> None:
    """500 poses are more than are searched: the share is that of all of them, by the sheets asked at each."""
    task = planar_task()
    laws = [hk.holonomic(task, hk.linear([0, 1, -1]))]
    s = hk.sheets(task, disc(), laws, samples=500, share=0.5)
    assert not s.stopped and s.share >= 0.5
    assert s.reachable.sum() > 450
    np.testing.assert_array_equal(s.batch(s.poses[s.reachable]).served, s.served[s.reachable])
    for i in np.flatnonzero(s.served)[::60]:
        sheet, q = s(s.poses[i])
        np.testing.assert_allclose(task.robot.pose(q)[:2, 3], s.poses[i][:2, 3], atol=1e-9)
        assert (np.abs(q) <= np.radians(150) + 1e-9).all() and sheet == s.labels[i]


def test_control_c_while_other_poses_are_looked_at_leaves_the_candidates_as_they_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = planar_task()
    T = hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], q0=[0.2, 0.9, 0.8], samples=60, share=0.1,
                  search=False).poses  # fmt: skip
    law = Candidate("lock q1", {}, task, hk.holonomic(task, hk.lock(0)))
    pool = candidate_sheets.CandidateSheets(task, SearchedPoses.of(T, 0.0), [law], None, 0.0, False)
    pool.add(law, np.array([[0.2, 0.9, 0.8]]))
    before = pool.sets.copy()
    interrupted_in(monkeypatch, "cost_of", 1)
    with pytest.raises(KeyboardInterrupt):
        pool.look_at(SearchedPoses.of(T[:30], 0.0), np.array([0]))
    assert len(pool.T) == 60
    np.testing.assert_array_equal(pool.sets, before)
    pool.look_at(SearchedPoses.of(T[:30], 0.0), np.array([0]))
    assert pool.sets.shape == (1, 30)
    assert (pool.sets[0] <= before[0, :30]).all()  # fewer poses are fewer stepping stones


def test_of_many_poses_a_first_part_is_in_question_and_then_all() -> None:
    """What was left out of the first part stays so; of the rest nothing is known yet. Each pose counts once."""
    T = np.tile(np.eye(4), (3000, 1, 1))
    T[:, 0, 3] = np.linspace(0, 1, 3000)
    first = SearchedPoses.of(T, 0.0, 1000).without(np.arange(1000) >= 10)
    assert len(first.reach) == 1000 and set(range(10)) <= set(first.which.tolist())
    assert first.weights.sum() == pytest.approx(1000)
    wider = first.more()
    assert wider.left_out.sum() == 10 and wider.left_out[:10].all() and wider.more() is wider
    assert len(wider.reach) == len(wider.all.which) == len(first.all.which) == 3000
    assert wider.without(np.arange(3000) < 2900).weights.sum() == pytest.approx(3000)
    few = SearchedPoses.of(T[:30], 0.0, 1000)
    assert few.complete and few.more() is few


def test_control_c_within_a_candidate_leaves_that_one_out(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted_in(monkeypatch, "cost_of", 4)
    task = planar_task()
    s = hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=40)
    assert s.stopped
    assert s.served.any()


def test_without_a_search_the_leaves_of_the_given_postures_alone_are_compared() -> None:
    task = planar_task()
    laws = [hk.holonomic(task, hk.lock(0)), hk.holonomic(task, hk.linear([0, 1, -1]))]
    q0 = [[0.3, 0.8, 0.5], [0.3, -0.8, -0.5]]
    s = hk.sheets(task, disc(), laws, q0=q0, samples=60, share=0.5, search=False)
    assert not s.stopped and s.candidates <= 4
    assert all(min(np.abs(one.q0 - q).max() for q in np.array(q0)) == 0.0 for one in s.sheets)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"share": 0.0}, ArgumentError), ({"share": 1.5}, ArgumentError), ({"samples": 0}, ArgumentError),
        ({"search": False}, ArgumentError), ({"strategies": []}, ArgumentError), ({"rcond": 1.0}, ArgumentError),
        ({"scene": 0.0}, ArgumentError),
        ({"strategies": [hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(0))]}, ArgumentError),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused(words: dict, error: type[Exception]) -> None:
    with pytest.raises(error):
        hk.sheets(planar_task(), disc(), **words)


def test_a_workspace_out_of_reach_is_refused_with_the_reason() -> None:
    with pytest.raises(OutOfReachError, match="out of reach"):
        hk.sheets(planar_task(), hk.workspace(box=([9, 9, 0], [1, 1, 0])), samples=20)


@pytest.mark.campaign
def test_laws_without_a_leaf_that_serves_anything_are_named() -> None:
    """No posture of this arm is as regular as is asked: nothing is served, and no map is made."""
    task = planar_task()
    with pytest.raises(ArgumentError, match="no leaf of them serves"):
        hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=20, rcond=0.99)


def test_control_c_before_anything_was_found_ends_it() -> None:
    def say(words: str) -> None:
        if "leaves so far" in words:
            raise KeyboardInterrupt

    task = planar_task()
    with pytest.raises(KeyboardInterrupt):
        hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=20, progress=say)


@pytest.mark.parametrize("share", [0.6, campaign("share", 0.98)])
def test_the_same_search_finds_the_same_map(share: float) -> None:
    task = planar_task()
    first, second = (
        hk.sheets(task, disc(), [hk.holonomic(task, hk.linear([0, 1, -1]))], samples=30, share=share) for _ in range(2)
    )
    np.testing.assert_array_equal(first.q, second.q)
    np.testing.assert_array_equal(first.labels, second.labels)


@pytest.mark.campaign
def test_control_c_while_a_sheet_is_asked_within_the_search_counts_no_pose_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The sheet that was being asked is asked again, so that what the map promises is what its sheets serve."""
    count = interrupted_in(monkeypatch, "one_function", 1)
    law, q0 = [disc_law(planar_task())], disc_starts()[2]
    s = hk.sheets(planar_task(), disc(), law, q0=q0, samples=150, share=0.9, seconds=1e-3)
    assert s.stopped and count[0] > 1
    assert s.share >= 0.9
