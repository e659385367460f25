"""A map of sheets is one function of the tool pose, and says what it does not serve and why."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import campaign
from handmade_sheets import LIMIT, disc, planar_task
from holokin.analysis.sheets import PoseRest, Sheet, Sheets, candidate_sheets, cover_by_sheets, write_sheets
from holokin.analysis.sheets.seams import fewest_changes
from holokin.analysis.sheets.set_cover import fewest, labelled
from holokin.base.errors import (
    ArgumentError,
    BranchError,
    FileError,
    JointLimitError,
    NotFiniteError,
    OutOfReachError,
    ShapeError,
)
from holokin.path.workspaces import pose_cloud

STARTS = [[0.0717, -1.9433, -2.0609], [1.7217, 0.9144, 0.474]]


def planar_laws(task: hk.Task) -> list[hk.strategies.HolonomicStrategy]:
    return [hk.holonomic(task, hk.linear([0, 1, -1]))]


@pytest.fixture(scope="module")
def planar() -> Sheets:
    """Two leaves that a search of five seconds finds; here they are given, and no time is left for a search."""
    task = planar_task()
    return hk.sheets(task, disc(), planar_laws(task), q0=STARTS, samples=100, share=0.98, search=False)


def tool_of(q: np.ndarray) -> np.ndarray:
    """The tool of three links of 1 m in a plane, by hand."""
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


def test_each_pose_has_the_sheet_of_its_label_and_a_posture_with_its_tool_there(
    planar: Sheets,
) -> None:
    found = planar.batch(planar.poses)
    np.testing.assert_array_equal(found.sheet, planar.labels)
    assert planar.share >= 0.98
    served = found.served
    np.testing.assert_allclose(tool_of(found.q[served]), planar.poses[served][:, :2, 3], atol=1e-9)
    assert (np.abs(found.q[served]) <= LIMIT + 1e-9).all()


@pytest.mark.campaign
def test_the_arm_has_no_single_leaf_for_the_disc_and_the_program_says_so() -> None:
    """No posture of q2 = q3 + c within +-150 degrees serves the whole disc: the base would have to go round."""
    task = planar_task()
    found = hk.sheets(task, disc(), [hk.holonomic(task, hk.linear([0, 1, -1]))], samples=50, share=0.98)
    assert len(found) == found.least == 2
    assert found.candidates > 10


def test_the_same_pose_has_the_same_joints_whatever_was_asked_before(planar: Sheets) -> None:
    rng = np.random.default_rng(0)
    at = rng.permutation(np.flatnonzero(planar.served))[:40]
    once = [planar(planar.poses[i]) for i in at]
    again = [planar(planar.poses[i]) for i in at[::-1]][::-1]
    many = planar.batch(planar.poses[at])
    for (s, q), (t, p), u, r in zip(once, again, many.sheet, many.q, strict=True):
        assert s == t == u
        np.testing.assert_array_equal(q, p)
        np.testing.assert_allclose(q, r, atol=1e-9)
    assert planar(planar.poses[at[0]][:2, 3])[0] == once[0][0]  # a point will do for a task of positions


def test_a_pose_midway_between_sampled_poses_has_the_same_joints_alone_and_in_company() -> None:
    """On a grid the middles are equally near to two or four sampled poses: rounding must not choose another one."""
    task, at = planar_task(), np.linspace(-2.8, 2.8, 9)
    grid = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) < 2.9]
    given, asked = np.tile(np.eye(4), (len(grid), 1, 1)), np.tile(np.eye(4), (2 * len(grid), 1, 1))
    given[:, :2, 3] = grid
    asked[:, :2, 3] = np.concatenate([grid + [0.35, 0.0], grid + [0.0, 0.35]])
    s = hk.sheets(task, pose_cloud(given), planar_laws(task), q0=STARTS, share=0.95, search=False)
    found = s.batch(asked)
    for pose, sheet, q in zip(asked[found.served], found.sheet[found.served], found.q[found.served], strict=True):
        alone = s(pose)
        assert alone[0] == sheet
        np.testing.assert_allclose(alone[1], q, atol=1e-9)
    assert s.batch(asked[:0]).q.shape == (0, 3)


def test_a_loop_stays_on_its_sheet_while_that_serves(planar: Sheets) -> None:
    """Along a straight path near stays on the sheet that it began on; where it leaves, the other one serves."""
    both = np.isfinite(planar.q).all(axis=(0, 2))
    i = int(np.flatnonzero(both)[0])
    for s in range(len(planar)):
        q, last = planar.q[s, i], s
        assert s in planar.of(q)
        for share in np.linspace(0.0, 1.0, 60):
            pose = planar.poses[i].copy()
            pose[:2, 3] = (1 - share) * pose[:2, 3] + share * np.array([-1.2, 0.9])
            try:
                here, q = planar.near(pose, q)
            except OutOfReachError:  # the loop rests, and goes on from there
                assert planar.batch(pose[None]).sheet[0] == -1
                continue
            np.testing.assert_allclose(tool_of(q), pose[:2, 3], atol=1e-9)
            if here != last:
                assert planar.sheets[last].posture(pose) is None or not np.allclose(
                    planar.sheets[last].posture(pose), q
                )
            last = here


def test_neighbours_without_a_cut_are_joined_by_small_motions(planar: Sheets) -> None:
    cut = {tuple(pair) for pair in planar.cuts.tolist()}
    for i, j in planar.pairs.tolist():
        if (i, j) not in cut and planar.labels[i] >= 0 <= planar.labels[j]:
            s = planar.labels[i]
            assert s == planar.labels[j]
            distance = np.linalg.norm(planar.poses[i][:2, 3] - planar.poses[j][:2, 3])
            radius = min(np.linalg.norm(planar.poses[k][:2, 3]) for k in (i, j))
            if 0.5 < radius < 2.5:  # away from the edge and the middle, where joints are fast
                assert np.abs(planar.q[s, i] - planar.q[s, j]).max() < 12 * distance


def test_bad_poses_are_refused(planar: Sheets) -> None:
    with pytest.raises(NotFiniteError):
        planar(np.full((4, 4), np.nan))
    with pytest.raises((ShapeError, ArgumentError)):
        planar(np.zeros(7))
    with pytest.raises((JointLimitError, ShapeError)):
        planar.near(planar.poses[0], np.zeros(5))


def test_a_saved_map_answers_the_same_to_the_last_bit(planar: Sheets, tmp_path: Path) -> None:
    keys = {"kind": "linear", "matrix": [[0.0, 1.0, -1.0]]}
    s = replace(planar, sheets=tuple(replace(one, keys=keys) for one in planar.sheets))
    write_sheets(s, tmp_path / "map.npz")
    again = hk.read_sheets(tmp_path / "map.npz", planar_task())
    assert str(again) == str(s)
    for i in np.flatnonzero(s.served)[::5]:
        (a, q), (b, p) = s(s.poses[i]), again(s.poses[i])
        assert a == b
        np.testing.assert_array_equal(q, p)


def test_a_saved_map_of_given_poses_has_their_workspace(tmp_path: Path) -> None:
    """Of more poses than samples, too: their middle is where the tool of a path without a rotation begins."""
    task = hk.pose(hk.load("ur5e"))
    given = hk.workspace(box=([0.4, 0.1, 0.3], [0.1, 0.2, 0.1]), tilt=0.2).poses(16, 3)
    for samples in (6, 16):
        s = hk.sheets(task, pose_cloud(given, "taught points"), samples=samples)
        write_sheets(s, tmp_path / "map.npz")
        again = hk.read_sheets(tmp_path / "map.npz", task)
        assert str(again.workspace) == str(s.workspace)
        np.testing.assert_array_equal(again.workspace.center, s.workspace.center)


def test_a_map_of_another_robot_or_of_no_map_is_refused(planar: Sheets, tmp_path: Path) -> None:
    file = tmp_path / "map.npz"
    with pytest.raises(ArgumentError, match="pickle"):  # its strategies were given as values
        write_sheets(planar, file)
    keyed = [replace(one, keys={"kind": "lock", "joints": [1]}) for one in planar.sheets]
    write_sheets(replace(planar, sheets=tuple(keyed)), file)
    with pytest.raises(FileError, match="leaf"):  # another strategy than that of the postures
        hk.read_sheets(file, planar.task)
    write_sheets(replace(planar, sheets=tuple(keyed), labels=planar.labels + 0.5), file)
    with pytest.raises(FileError, match="another kind"):
        hk.read_sheets(file, planar.task)
    write_sheets(replace(planar, sheets=tuple(keyed)), file)
    with pytest.raises(FileError, match="another scene"):
        hk.read_sheets(file, planar.task, scene=hk.Scene())
    with pytest.raises(FileError, match="it is of"):
        hk.read_sheets(file, hk.position(hk.load("ppr")))
    (tmp_path / "no.npz").write_bytes(b"PK\x03\x04 nothing")
    for other in ("no.npz", "missing.npz"):
        with pytest.raises(FileError):
            hk.read_sheets(tmp_path / other, planar.task)


def test_a_sheet_is_one_function_neighbours_lead_to_each_other(planar: Sheets) -> None:
    """Where the straight path from one pose of a sheet reaches a neighbouring one, it comes to the sheet's posture."""
    for s, sheet in enumerate(planar.sheets):
        for i, j in planar.pairs.tolist():
            for a, b in ((i, j), (j, i)):
                if np.isfinite(planar.q[s, [a, b]]).all():
                    q, served = sheet.reached(planar.q[s, [a]], planar.poses[[b]])
                    assert not served[0] or np.abs(q[0] - planar.q[s, b]).max() < 1e-6


def test_a_sheet_serves_what_no_straight_path_from_its_start_reaches(planar: Sheets) -> None:
    """About the base the limits leave a hole: poses behind it are reached round it, on the same leaf."""
    behind = 0
    for s, sheet in enumerate(planar.sheets):
        straight = replace(sheet, stations=np.zeros((0, 3))).postures(planar.poses)[1]
        grown = np.isfinite(planar.q[s]).all(axis=1)
        behind += int((grown & ~straight).sum())
        assert all(sheet.off(q) < 1e-8 for q in planar.q[s][grown])
    assert behind > 5


def test_a_sheet_is_proven_over_a_box_and_has_the_joints_of_the_proof(planar: Sheets) -> None:
    """In the proven part random poses have the sheet's joints, whatever station they are reached from."""
    box = hk.workspace(box=([1.2, 0.9], [0.15, 0.15]))
    served = [s for s in range(len(planar)) if planar.sheets[s].posture(box.center) is not None]
    sheet = planar.sheets[served[0]]
    region = hk.unique_region(sheet.strategy, sheet.nearest_station(box.center), box, budget=4000)
    assert region.share > 0.9
    T = box.poses(50, 3)
    near, alone = region.near(T[:, :3, 3], T[:, :3, :3])
    inside = np.isfinite(near).all(axis=1)
    q, found = planar.sheets[served[0]].postures(T[inside])
    assert inside.sum() > 30
    assert found.all()
    assert (np.linalg.norm(q - near[inside], axis=1) <= alone[inside]).all()


def turning_line(task: hk.Task) -> hk.HolonomicStrategy:
    """The tool is on a line through a point beside the base, which turns 1.25 times as far as joint 1."""

    def g(q: ca.SX) -> ca.SX:
        x, y = (sum(f(ca.sum1(q[: i + 1])) for i in range(3)) for f in (ca.cos, ca.sin))
        return ca.sin(1.25 * q[0]) * (x + 0.45) - ca.cos(1.25 * q[0]) * y

    return hk.holonomic(task, hk.custom(g, rows=1), name="turning line")


@pytest.fixture(scope="module")
def one_leaf() -> Sheets:
    task = planar_task()
    return hk.sheets(task, disc(), [turning_line(task)], q0=[0.0, -0.6, 1.2], share=0.7, samples=400, search=False)


@pytest.mark.parametrize(("name", "told"), [("planar", 0), campaign(("name", "told"), ("one_leaf", 3))])
def test_a_loop_never_leaps_on_its_sheet(name: str, told: int, request: pytest.FixtureRequest) -> None:
    """Round the base in steps of a centimetre: while the index stays, the joints move as far as the tool asks
    for; where they cannot, the loop is told: one leaf alone overlaps itself, and the base does not go round."""
    s = request.getfixturevalue(name)
    for radius in (1.6, 1.8, 2.1):
        q = s([radius, 0.0])[1]
        for angle in np.arange(0.0, 2 * np.pi, 0.01 / radius):
            before = q
            try:
                _, q = s.near([radius * np.cos(angle), radius * np.sin(angle)], q)
            except BranchError:
                told -= 1
                break
            if set(s.of(before)) & set(s.of(q)):
                assert np.abs(q - before).max() < 0.15  # steep where the leaf ends
    assert told == 0


def test_a_posture_of_another_branch_is_on_no_sheet_of_this_one(planar: Sheets) -> None:
    """q2 = q3 + c with both elbows turned over has another sign of det [J; J_g]: the same leaf, another sheet."""
    s = replace(planar, sheets=(Sheet(planar.sheets[0].strategy, np.array([0.2, 0.9, 0.9])),), q=planar.q[:1])
    assert s.of([0.1, 1.0, 1.0]) == (0,)
    assert s.of([0.1, -1.0, -1.0]) == ()
    assert s.of([0.1, 1.0, 1.1]) == ()


@pytest.mark.campaign
def test_one_leaf_round_the_base_overlaps_itself(one_leaf: Sheets) -> None:
    """The base cannot go round, but the self-motion leads the tool the rest of the way: a loop round the base comes to
    other joints on the same leaf, and the map says where."""
    s, task = one_leaf, one_leaf.task
    assert len(s) == 1
    assert s.share > 0.75
    round_ = np.array([[1.8 * np.cos(a), 1.8 * np.sin(a)] for a in np.linspace(0, 2 * np.pi, 200)])
    poses = np.tile(np.eye(4), (200, 1, 1))
    poses[:, :2, 3] = round_
    found = s.batch(poses)
    assert found.served.all()
    jumps = np.abs(np.diff(found.q, axis=0)).max(axis=1) > 0.5
    assert jumps.sum() == 1
    assert all(s.sheets[0].off(q) < 1e-8 for q in found.q)
    assert len(s.cuts) > 5
    with pytest.raises(JointLimitError):
        hk.sheets(task, disc(), [turning_line(task)], q0=[3.0, 0, 0], samples=20)


def test_the_tool_s_turn_does_not_matter_where_only_its_position_does(planar: Sheets) -> None:
    """The same point with another rotation has the same joints to the last bit."""
    rng = np.random.default_rng(5)
    for point in rng.uniform(-2, 2, (40, 2)):
        pose = np.eye(4)
        pose[:2, 3] = point
        turned = pose.copy()
        turned[:3, :3] = np.diag([1.0, -1.0, -1.0])
        if planar.batch(pose[None]).served[0]:
            np.testing.assert_array_equal(planar(pose)[1], planar(turned)[1])


# --- The search for sheets ends where it should: at its share, at Ctrl-C, at bad numbers, and says why poses are left.


def test_what_is_out_of_reach_is_told_from_what_limits_forbid() -> None:
    """Behind the base, near the edge, the limits of q1 leave a notch; outside of 3 m nothing reaches."""
    task = planar_task()
    s = hk.sheets(task, disc(3.5), [hk.holonomic(task, hk.linear([0, 1, -1]))], samples=80, share=0.5)
    radius = np.linalg.norm(s.poses[:, :2, 3], axis=1)
    np.testing.assert_array_equal(s.rest == PoseRest.OUT_OF_REACH, radius > 3)
    behind = s.rest == PoseRest.LIMITS
    assert (radius[behind] > 2.7).all()
    assert (s.poses[behind][:, 0, 3] < 0).all()
    with pytest.raises(OutOfReachError, match="serve"):
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


def interrupted_at(words: str, **options: Any) -> Sheets:
    """The map of a search in which Ctrl-C is pressed when it says some words."""

    def say(text: str) -> None:
        if words in text:
            raise KeyboardInterrupt

    task = planar_task()
    return hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], progress=say, **options)


def test_control_c_keeps_what_was_found() -> None:
    """In the search, and while the sheets are asked; before anything was found it ends the search."""
    s = interrupted_at("leaves serve", samples=60)
    assert s.stopped and len(s) > 0 and "stopped early" in s.sentence
    s = interrupted_at("asking the sheets", samples=40, share=0.3)
    assert s.stopped and s.served.any() and s.batch(s.poses[s.served]).served.all()
    with pytest.raises(KeyboardInterrupt):
        interrupted_at("which levels serve", samples=20)


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


def test_of_many_poses_a_part_is_searched_and_the_map_says_what_all_of_them_get(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The share is that of all of them, by the sheets asked at each."""
    monkeypatch.setattr(cover_by_sheets, "SEARCHED", 60)
    task = planar_task()
    laws = [hk.holonomic(task, hk.linear([0, 1, -1]))]
    s = hk.sheets(task, disc(), laws, samples=160, share=0.5)
    assert not s.stopped and s.share >= 0.5
    assert s.reachable.sum() > 140
    np.testing.assert_array_equal(s.batch(s.poses[s.reachable]).served, s.served[s.reachable])
    for i in np.flatnonzero(s.served)[::20]:
        sheet, q = s(s.poses[i])
        np.testing.assert_allclose(task.robot.pose(q)[:2, 3], s.poses[i][:2, 3], atol=1e-9)
        assert (np.abs(q) <= np.radians(150) + 1e-9).all() and sheet == s.labels[i]


def test_control_c_within_a_candidate_leaves_that_one_out(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted_in(monkeypatch, "served_weight", 400)
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


BAD = [{"share": 0.0}, {"share": 1.5}, {"samples": 0}, {"search": False}, {"strategies": []}, {"rcond": 1.0}]
OTHER = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(0))


@pytest.mark.parametrize("words", [*BAD, {"scene": 0.0}, {"strategies": [OTHER]}])
def test_bad_numbers_are_refused(words: dict) -> None:
    with pytest.raises(ArgumentError):
        hk.sheets(planar_task(), disc(), **words)


def test_a_workspace_out_of_reach_is_refused_with_the_reason() -> None:
    with pytest.raises(OutOfReachError):
        hk.sheets(planar_task(), hk.workspace(box=([9, 9, 0], [1, 1, 0])), samples=20)


@pytest.mark.campaign
def test_laws_without_a_leaf_that_serves_anything_are_named() -> None:
    """No posture of this arm is as regular as is asked: nothing is served, and no map is made."""
    task = planar_task()
    with pytest.raises(ArgumentError, match="no leaf of them serves"):
        hk.sheets(task, disc(), [hk.holonomic(task, hk.lock(0))], samples=20, rcond=0.99)


@pytest.mark.campaign
@pytest.mark.parametrize("share", [0.6, campaign("share", 0.98)])
def test_the_same_search_finds_the_same_map(share: float) -> None:
    task = planar_task()
    first, second = (
        hk.sheets(task, disc(), [hk.holonomic(task, hk.linear([0, 1, -1]))], samples=30, share=share) for _ in range(2)
    )
    np.testing.assert_allclose(first.q, second.q, atol=1e-12)  # native code may come in between
    np.testing.assert_array_equal(first.labels, second.labels)


@pytest.mark.campaign
def test_control_c_while_a_sheet_is_asked_within_the_search_counts_no_pose_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The sheet that was being asked is asked again, so that what the map promises is what its sheets serve."""
    count = interrupted_in(monkeypatch, "one_function", 1)
    law = [turning_line(planar_task())]
    s = hk.sheets(planar_task(), disc(), law, q0=[0.0, -0.6, 1.2], samples=150, share=0.75, seconds=1e-3)
    assert s.stopped and count[0] > 1
    assert s.share >= 0.75


# --- The choice of sheets along a path, held against every choice there is.


def every_choice(steps: np.ndarray, served: np.ndarray, change: np.ndarray, first: int | None) -> tuple:
    """The least (divisions, changes, seconds) of all choices that take a sheet on each step that one serves."""
    choices = [np.flatnonzero(row).tolist() or [-1] for row in served.T]
    found = []
    for labels in product(*choices):
        divisions = changes = 0
        seconds = sum(steps[s, i] for i, s in enumerate(labels) if s >= 0)
        last = -1 if first is None else first
        away = False
        for i, s in enumerate(labels):
            if s < 0:
                away = True
                continue
            if last >= 0 and (away and i and any(x >= 0 for x in labels[:i])):
                divisions += 1
            elif last >= 0 and s != last and not away:
                if np.isfinite(change[i, last, s]):
                    changes += 1
                    seconds += change[i, last, s]
                else:
                    divisions += 1
            last, away = s, False
        found.append((divisions, changes, seconds))
    return min(found)


@given(
    st.integers(1, 3), st.integers(1, 6), st.floats(0.2, 1.0), st.floats(0.0, 1.0), st.booleans(), st.integers(0, 10**6)
)
def test_no_choice_has_fewer_divisions_or_changes_or_less_motion(
    S: int, k: int, fill: float, joined: float, begun: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    served, steps = rng.random((S, k)) < fill, rng.random((S, k))
    change = np.where(rng.random((k, S, S)) < joined, rng.random((k, S, S)), np.inf)
    first = int(rng.integers(S)) if begun else None
    found = fewest_changes(steps, served, change, first)
    divisions, changes, seconds = every_choice(steps, served, change, first)
    assert (found.divisions, found.changes) == (divisions, changes)
    assert found.seconds == pytest.approx(seconds, abs=1e-12)
    taken = found.sheets
    assert ((taken >= 0) == served.any(axis=0)).all()
    assert all(served[s, i] for i, s in enumerate(taken) if s >= 0)


def test_one_sheet_that_serves_all_is_kept_though_another_is_faster() -> None:
    """A change counts more than any motion. Where the slow sheet ends, the change is where it is cheapest."""
    steps = np.array([[9.0] * 6, [1.0] * 6])
    served = np.ones((2, 6), dtype=bool)
    change = np.full((6, 2, 2), 0.1)
    assert fewest_changes(steps, served, change, 0).sheets.tolist() == [0] * 6
    served[0, 4:], served[1, :2] = False, False
    change[:, 0, 1] = [5, 5, 5, 5, 20, 5]
    assert fewest_changes(steps, served, change).sheets.tolist() == [0, 0, 1, 1, 1, 1]
    change[:, 0, 1] = [5, 5, np.inf, 30, 50, 5]
    assert fewest_changes(steps, served, change).sheets.tolist() == [0, 0, 0, 1, 1, 1]


def test_a_change_that_cannot_be_made_divides_the_path_and_a_gap_counts_once() -> None:
    served = np.array([[1, 1, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0]], dtype=bool)
    found = fewest_changes(np.ones((2, 6)), served, np.full((6, 2, 2), np.inf))
    assert found.sheets.tolist() == [0, 0, 1, -1, -1, 0]
    assert (found.divisions, found.changes, found.turnings) == (2, 0, [(2, 0, 1)])
    none = fewest_changes(np.ones((2, 3)), np.zeros((2, 3), dtype=bool), np.full((3, 2, 2), np.inf))
    assert none.sheets.tolist() == [-1, -1, -1]
    assert none.divisions == 0


# --- The integer programs behind a map of sheets, held against every choice there is.


@given(st.integers(1, 7), st.integers(1, 9), st.floats(0.1, 0.9), st.floats(0.3, 1.0), st.integers(0, 10**6))
def test_no_choice_of_fewer_sets_covers_as_much(c: int, k: int, fill: float, share: float, seed: int) -> None:
    """The number is the least of all choices, and the bound says so; of equally many none beats it in both respects."""
    rng = np.random.default_rng(seed)
    sets, costs = rng.random((c, k)) < fill, rng.random(c)
    wanted = int(np.ceil(share * k))
    cover = fewest(sets, wanted, costs, 10.0)
    goal = min(wanted, int(sets.any(axis=0).sum()))
    assert cover.covered == sets[cover.chosen].any(axis=0).sum() >= goal
    sizes = [
        size for size in range(c + 1) for some in combinations(range(c), size)
        if sets[list(some)].any(axis=0).sum() >= goal
    ]  # fmt: skip
    assert len(cover.chosen) == min(sizes) == cover.least
    for some in combinations(range(c), len(cover.chosen)):
        more = sets[list(some)].any(axis=0).sum() > cover.covered
        assert not (more and costs[list(some)].sum() < costs[cover.chosen].sum() - 1e-9)


@given(st.integers(2, 7), st.integers(1, 9), st.floats(0.1, 0.7), st.floats(0.3, 0.8), st.integers(0, 10**6))
def test_what_is_preferred_is_covered_where_no_more_sets_are_needed_for_it(
    c: int, k: int, fill: float, share: float, seed: int
) -> None:
    """However much dearer the sets are; and where it is out of reach, as much as so many sets can cover."""
    rng = np.random.default_rng(seed)
    sets, costs, weights = rng.random((c, k)) < fill, rng.random(c), rng.integers(1, 9, k).astype(float)
    wanted, preferred = share * weights.sum(), min(1.0, share + 0.2) * weights.sum()
    plain, cover = fewest(sets, wanted, costs, 10.0, weights), fewest(sets, wanted, costs, 10.0, weights, preferred)
    size = len(plain.chosen)
    assert len(cover.chosen) == size
    can = max(weights[sets[list(some)].any(axis=0)].sum() for some in combinations(range(c), size))
    assert cover.covered >= min(preferred, can) - 1e-5


@given(st.integers(1, 3), st.integers(2, 6), st.floats(0.2, 0.9), st.integers(0, 10**6))
def test_no_choice_of_sheets_has_fewer_cuts_than_is_said(S: int, k: int, fill: float, seed: int) -> None:
    """The cuts are those of the labels; of two sheets the choice is the best there is, of more the bound holds."""
    rng = np.random.default_rng(seed)
    served = rng.random((S, k)) < fill
    pairs = np.array([pair for pair in combinations(range(k), 2) if rng.random() < 0.7], dtype=int).reshape(-1, 2)
    on = served[:, pairs[:, 0]] & served[:, pairs[:, 1]] & (rng.random((S, len(pairs))) < 0.8)
    found = labelled(served, pairs, on)

    def cuts(of: np.ndarray) -> int:
        return sum(
            of[i] >= 0 and of[j] >= 0 and not (of[i] == of[j] and on[of[i], e]) for e, (i, j) in enumerate(pairs)
        )

    choices = [np.flatnonzero(served[:, p]).tolist() or [-1] for p in range(k)]
    assert all(found.of[p] in choices[p] for p in range(k))
    least = min(cuts(np.array(of)) for of in product(*choices))
    assert found.least <= least <= cuts(found.of) == len(found.cuts)
    if S < 3:
        assert len(found.cuts) == least == found.least
