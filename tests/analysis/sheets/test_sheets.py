"""A map of sheets is one function of the tool pose, and says what it does not serve and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.disc_law import disc_law, disc_starts

import holokin as hk
from conftest import campaign
from handmade_sheets import LIMIT, disc, planar_task
from holokin.analysis.sheets import Sheet, Sheets
from holokin.base.errors import (
    ArgumentError,
    BranchError,
    JointLimitError,
    NoSheetError,
    NotFiniteError,
    ShapeError,
    SheetsFileError,
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


def test_each_posture_has_its_tool_at_the_pose_and_is_within_the_limits(planar: Sheets) -> None:
    found = planar.batch(planar.poses)
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


def test_the_sheet_is_that_of_the_labels_at_the_sampled_poses(planar: Sheets) -> None:
    np.testing.assert_array_equal(planar.batch(planar.poses).sheet, planar.labels)


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
            except NoSheetError:  # the loop rests, and goes on from there
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
    hk.analysis.sheets.write_sheets(s, tmp_path / "map.npz")
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
        hk.analysis.sheets.write_sheets(s, tmp_path / "map.npz")
        again = hk.read_sheets(tmp_path / "map.npz", task)
        assert str(again.workspace) == str(s.workspace)
        np.testing.assert_array_equal(again.workspace.center, s.workspace.center)


def test_a_map_of_another_robot_or_of_no_map_is_refused(planar: Sheets, tmp_path: Path) -> None:
    file = tmp_path / "map.npz"
    with pytest.raises(ArgumentError, match="pickle"):  # its strategies were given as values
        hk.analysis.sheets.write_sheets(planar, file)
    keyed = [replace(one, keys={"kind": "lock", "joints": [1]}) for one in planar.sheets]
    hk.analysis.sheets.write_sheets(replace(planar, sheets=tuple(keyed)), file)
    with pytest.raises(SheetsFileError, match="leaf"):  # another strategy than that of the postures
        hk.read_sheets(file, planar.task)
    hk.analysis.sheets.write_sheets(replace(planar, sheets=tuple(keyed), labels=planar.labels + 0.5), file)
    with pytest.raises(SheetsFileError, match="another kind"):
        hk.read_sheets(file, planar.task)
    hk.analysis.sheets.write_sheets(replace(planar, sheets=tuple(keyed)), file)
    with pytest.raises(SheetsFileError, match="another scene"):
        hk.read_sheets(file, planar.task, scene=hk.Scene())
    with pytest.raises(SheetsFileError, match="it is of"):
        hk.read_sheets(file, hk.position(hk.load("ppr")))
    (tmp_path / "no.npz").write_bytes(b"PK\x03\x04 nothing")
    for other in ("no.npz", "missing.npz"):
        with pytest.raises(SheetsFileError):
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
    region = planar.certified(served[0], box, budget=4000)
    assert region.share > 0.9
    T = box.poses(50, 3)
    near, alone = region.near(T[:, :3, 3], T[:, :3, :3])
    inside = np.isfinite(near).all(axis=1)
    q, found = planar.sheets[served[0]].postures(T[inside])
    assert inside.sum() > 30
    assert found.all()
    assert (np.linalg.norm(q - near[inside], axis=1) <= alone[inside]).all()
    with pytest.raises(ArgumentError, match="index"):
        planar.certified(9)
    with pytest.raises(ArgumentError, match="box"):
        planar.certified(0)  # the disc


@pytest.fixture(scope="module")
def one_leaf() -> Sheets:
    task = planar_task()
    return hk.sheets(task, disc(), [disc_law(task)], q0=disc_starts()[2], share=0.9, samples=400, search=False)


@pytest.mark.parametrize(("name", "told"), [("planar", 0), campaign(("name", "told"), ("one_leaf", 3))])
def test_a_loop_never_leaps_on_its_sheet(name: str, told: int, request: pytest.FixtureRequest) -> None:
    """Round the base in steps of a centimetre: while the index stays, the joints move as far as the tool asks
    for; where they cannot, the loop is told: one leaf alone overlaps itself, and the base does not go round."""
    s = request.getfixturevalue(name)
    for radius in (0.9, 1.8, 2.1):
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


@pytest.mark.campaign
def test_inside_the_end_of_its_cut_the_leaf_comes_home(one_leaf: Sheets) -> None:
    """Round the base at 0.3 m: the cut of this leaf ends farther out. At 1.8 m it is crossed, and no law comes home."""
    ik = one_leaf.sheets[0].ik
    walk = [ik([0.3, 0.0])]
    for angle in np.linspace(0.0, 2 * np.pi, 200):
        walk.append(ik.near([0.3 * np.cos(angle), 0.3 * np.sin(angle)], walk[-1]))
    np.testing.assert_allclose(walk[-1], walk[0], atol=1e-9)
    assert np.ptp(walk, axis=0).max() > 0.5  # and the joints did move
    assert np.abs(np.diff(walk, axis=0)).max() < 0.2  # without a leap


def test_a_posture_of_another_branch_is_on_no_sheet_of_this_one(planar: Sheets) -> None:
    """q2 = q3 + c with both elbows turned over has another sign of det [J; J_g]: the same leaf, another sheet."""
    s = replace(planar, sheets=(Sheet(planar.sheets[0].strategy, np.array([0.2, 0.9, 0.9])),), q=planar.q[:1])
    assert s.of([0.1, 1.0, 1.0]) == (0,)
    assert s.of([0.1, -1.0, -1.0]) == ()
    assert s.of([0.1, 1.0, 1.1]) == ()


@pytest.mark.campaign
def test_one_leaf_serves_nearly_the_whole_disc_and_overlaps_itself(one_leaf: Sheets) -> None:
    """The base cannot go round, but the self-motion leads the tool the rest of the way: a loop round the base comes to
    other joints on the same leaf, and the map says where."""
    s, task = one_leaf, one_leaf.task
    assert len(s) == 1
    assert s.share > 0.95
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
        hk.sheets(task, disc(), [disc_law(task)], q0=[3.0, 0, 0], samples=20)


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
