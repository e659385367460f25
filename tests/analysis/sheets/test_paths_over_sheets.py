"""Paths over several sheets: held against every choice of sheets, Pinocchio, `check`, and a writer of programs."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from handmade_sheets import LIMIT, map_of, panda_map, planar_map, planar_task
from holokin.analysis.coverage.starts import Candidate
from holokin.analysis.sheets import Sheet, Sheets, self_motion_between
from holokin.analysis.sheets.candidate_sheets import CandidateSheets
from holokin.analysis.sheets.sheet import known, nearby
from holokin.analysis.sheets.sheet_growth import LevelTable, SearchedPoses, level_table, side_by_side
from holokin.app.job.runner import _strategy
from holokin.base.errors import ArgumentError, HolokinError, PathError, StartError


@pytest.fixture(scope="module")
def planar() -> Sheets:
    return planar_map()


@pytest.fixture(scope="module")
def panda() -> Sheets:
    return panda_map()


def random_path(space: hk.Workspace, seed: int, length: float = 2.0) -> hk.Path:
    """Straight lines between random points of a workspace, cut at a length [m]."""
    points = space.poses(64)[np.random.default_rng(seed).permutation(64), :3, 3]
    path = hk.polyline(points[:20])
    return path.part(0.0, min(1.0, length / path.length))


def least(s: Sheets, path: hk.Path, samples: int) -> tuple[int, int]:
    """(divisions, changes) of the best of all sequences: each pair of sheets at each sample is tried for a self-motion,
    one by one, and of each sheet at each sample all numbers of divisions and changes are kept."""
    segment, _, u = path.steps(samples)
    t = np.concatenate([[0.0], path.starts[segment] + u * path.durations[segment]])
    at = path.at(np.clip(t, 0, path.duration))
    poses = np.repeat(s.workspace.center[None], len(t), axis=0)
    poses[:, :3, 3], poses[:, :3, :3] = at.position, at.rotation @ s.workspace.center[:3, :3]
    q = s.postures(poses)

    def goes_on(a: int, i: int) -> bool:
        try:
            return bool(np.abs(s.sheets[a].ik.near(poses[i + 1], q[a, i]) - q[a, i + 1]).max() < 1e-6)
        except HolokinError:
            return False

    open_to = [
        [a for a in range(len(s)) if np.isfinite(q[a, i : i + 2]).all() and goes_on(a, i)] for i in range(len(t) - 1)
    ]
    every, gaps, served = {(): (0, 0)}, 0, False
    states: dict[int, set[tuple[int, int]]] = {}
    for i, sheets in enumerate(open_to):
        if not sheets:
            gaps += served and any(open_to[i + 1 :])
            if states:
                every = {(): min(cost for costs in states.values() for cost in costs)}
            states = {}
            served = False
            continue
        after: dict[int, set[tuple[int, int]]] = {a: set() for a in sheets}
        for a in sheets:
            if not states:
                after[a].add(every[()])
            for b, costs in states.items():
                join = b == a or self_motion_between(s.task, q[b, i], q[a, i], s.clear).hindrance is None
                for d, c in costs:
                    after[a].add((d, c) if b == a else (d, c + 1) if join else (d + 1, c))
        states, served = after, True
    best = min([cost for costs in states.values() for cost in costs] or [every[()]])
    return best[0] + gaps, best[1]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(1, 12))])
def test_no_sequence_of_sheets_has_fewer_divisions_or_changes(planar: Sheets, seed: int) -> None:
    """Each sheet serves a half of the disc only, so that paths need changes; all sequences are looked at."""
    path, rng = random_path(planar.workspace, seed, 4.0), np.random.default_rng(seed)
    halves = [(np.cos(a), np.sin(a)) for a in rng.uniform(0, 2 * np.pi, len(planar))]
    cut = [Shortened.of(one, lambda T, n=n: T[:2, 3] @ n > -0.4) for one, n in zip(planar.sheets, halves, strict=True)]
    s = map_of(planar.task, planar.workspace, cut, 1)
    found = s.follow(path, samples=10)
    assert (found.cuts, found.changes) == least(s, path, 10)


def tool_of(q: np.ndarray) -> np.ndarray:
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


@pytest.mark.parametrize("seed", range(4))
def test_the_tool_is_on_the_path_and_the_joints_keep_their_limits(planar: Sheets, seed: int) -> None:
    path = random_path(planar.workspace, seed)
    found = planar.follow(path, samples=100)
    assert len(found.parts) == 1 + found.cuts
    for piece in found.pieces:
        walk = piece.trajectory
        assert walk.tracking_error() < 1e-9
        assert (np.abs(walk.q) <= LIMIT + 1e-9).all()
        assert walk.residual.max() < 1e-9
        np.testing.assert_allclose(tool_of(walk.q[0]), path.at(piece.start * path.duration).position[0, :2], atol=1e-9)
        np.testing.assert_allclose(tool_of(walk.q[-1]), path.at(piece.stop * path.duration).position[0, :2], atol=1e-9)
    for part in found.parts:
        assert np.diff(part.t).min() > 0
        assert np.abs(np.diff(part.q, axis=0)).max() < 0.5  # nothing jumps
        assert (np.abs(part.dq) <= planar.task.robot.max_velocity * (1 + 1e-9)).all()
    assert pickle.loads(pickle.dumps(found)).sentence == found.sentence


def test_a_panda_changes_its_elbow_where_it_is_allowed_and_a_controller_can_play_it(panda: Sheets) -> None:
    """It changes at the stop at 40 %, the tool still at each millisecond, and is on the path before and after."""
    task, space = panda.task, panda.workspace
    path = hk.line(space.center[:3, 3] - [0.1, 0.2, 0.0], space.center[:3, 3] + [0.1, 0.2, 0.0])
    one = Shortened.of(panda.sheets[0], lambda T: T[1, 3] < 0.02)
    other = Shortened.of(panda.sheets[1], lambda T: T[1, 3] > -0.08)
    s = map_of(task, space, [one, other], 24)
    found = s.follow(path, stops=[0.2, 0.4, 0.9], samples=60)
    assert found.complete
    assert found.changes == 1
    assert [(one.sheet, round(one.start, 9), round(one.stop, 9)) for one in found.pieces] == [(0, 0, 0.4), (1, 0.4, 1)]
    walk = found.trajectory
    timed = hk.retime(walk, acceleration=10.0, profile="trapezoidal", dt=0.001)
    for motion in (walk, timed):
        report = hk.check(motion, None, robot=task.robot, task=task)
        assert report.passed and [text[:13] for text in report.observations] == ["a self-motion"]
    first = len(found.pieces[0].trajectory) - 1
    begin, end = walk.q[first], walk.q[first + len(found.seams[0].q) - 1]
    a, b = (int(np.argmin(np.abs(timed.q - q).max(axis=1))) for q in (begin, end))
    assert {a, b} <= set(timed.stops)
    model = pin.buildModelFromXML(hk.robot.to_urdf(task.robot))
    data, poses = model.createData(), []
    for q in timed.q[a : b + 1]:
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[model.nframes - 1].homogeneous)
    assert np.abs(np.array(poses) - poses[0]).max() < 1e-9
    program = hk.export.to_rapid(timed, wiring=hk.export.Wiring(external=("panda_joint3",)))
    text = "".join(program.files.values())
    assert text.count(",fine,") >= 4  # start, both ends of the change, end
    with pytest.raises(PathError, match="no change is allowed there"):
        _ = s.follow(path, stops=[], samples=60).trajectory


class Shortened(Sheet):
    """A sheet that serves only the poses at which a function is true."""

    @classmethod
    def of(cls, sheet: Sheet, serves: object) -> Shortened:
        made = cls(sheet.strategy, sheet.q0, sheet.rcond, sheet.keys)
        object.__setattr__(made, "serves", serves)
        return made

    def postures(self, poses: np.ndarray, clear: object = None, threads: int | None = None) -> tuple:
        q, served = super().postures(poses, clear, threads)
        served &= np.array([self.serves(T) for T in poses])
        return np.where(served[:, None], q, np.nan), served


def test_the_sheet_of_the_start_posture_is_kept_or_left_at_once(planar: Sheets) -> None:
    start = planar.poses[np.flatnonzero(np.isfinite(planar.q).all(axis=(0, 2)))[0]]
    path = hk.line(start[:3, 3], start[:3, 3] * 0.95)
    for s in range(3):
        q0 = planar.sheets[s].posture(start)
        found = planar.follow(path, q0, samples=20)
        np.testing.assert_allclose(found.parts[0].q[0], q0, atol=1e-9)
        assert found.changes == len(found.divisions) == 0
        assert found.pieces[0].sheet == s
    with pytest.raises(ArgumentError, match="posture of no sheet"):
        planar.follow(path, _off_sheets(planar, start))
    with pytest.raises(StartError):
        planar.follow(path, q0 + 0.1)


def _off_sheets(s: Sheets, pose: np.ndarray) -> np.ndarray:
    """A posture of the pose on no sheet."""
    curve = hk.strategies.self_motion_curve(s.task, s.sheets[0].posture(pose))
    return curve.at(curve.s[0] / 2)


def test_two_sheets_of_one_leaf_are_followed_as_one() -> None:
    """Where both have the same postures rounding does not go to and fro between them, and the arm does not rest."""
    task, space, q0 = planar_task(), hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0)), np.array([0.2, 0.9, 0.9])
    whole = Sheet(hk.holonomic(task, hk.linear([0, 1, -1])), q0)
    path = hk.line([1.6, 0.9, 0], [-0.9, 1.2, 0])
    alone = map_of(task, space, [whole], 60)
    served, x = np.isfinite(alone.q[0]).all(axis=1), alone.poses[:, 0, 3]
    both = [
        Sheet(whole.strategy, q0, stations=alone.q[0][served & side], places=alone.poses[served & side])
        for side in (x > -0.3, x < 0.3)
    ]
    halves = [Shortened.of(whole, lambda T: T[0, 3] > 0.2), Shortened.of(whole, lambda T: T[0, 3] < 0.6)]
    one = alone.follow(path, samples=60)
    for sheets, many in ((both, 1), (halves, 2)):
        for stops in (None, []):
            found = map_of(task, space, sheets, 1).follow(path, stops=stops, samples=60)
            assert (len(found.pieces), found.changes, found.cuts) == (many, 0, 0)
            assert found.trajectory.corners == one.trajectory.corners
            np.testing.assert_allclose(found.trajectory.q, one.trajectory.q, atol=1e-8)
            np.testing.assert_allclose(found.trajectory.dq, one.trajectory.dq, atol=1e-6)


def test_what_no_sheet_serves_is_left_out_and_named(planar: Sheets) -> None:
    """A path that leaves the disc and comes back: two parts, one cut, and where it lies."""
    path = hk.polyline([[2.0, 0.5, 0], [3.4, 0.9, 0], [2.0, 1.3, 0]])
    found = planar.follow(path, samples=200)
    assert not found.complete
    assert len(found.left_out) == 1
    out = found.left_out[0]
    radius = [np.linalg.norm(path.at(x * path.duration).position[0]) for x in (out.start, out.stop)]
    np.testing.assert_allclose(radius, 3.0, atol=0.03)
    assert np.linalg.norm(out.pose[:3, 3]) > 3
    assert "out of reach" in planar.why(out.pose).text
    assert found.cuts == 1
    assert "left out" in str(found)
    with pytest.raises(PathError) as problem:
        _ = found.trajectory
    assert problem.value.trajectory is found.parts[0]
    nowhere = planar.follow(hk.line([4, 0, 0], [5, 0, 0]), samples=10)
    assert nowhere.parts == ()
    assert nowhere.left_out[0].stop == 1.0


@pytest.mark.parametrize("stops", [[-0.1], [1.2], [np.nan], [[0.1, 0.2]], "half", lambda _pose: 3])
def test_bad_stops_are_refused(planar: Sheets, stops: object) -> None:
    with pytest.raises(HolokinError):
        planar.follow(hk.line([1.5, 0, 0], [1.4, 0, 0]), stops=stops, samples=10)


# --- Laws whose level is a polynomial of the pose: what levels a pose has, and that a fitted leaf serves more of them.


STEP = 0.25
START = np.array([0.0, 0.9, 0.8])


def positions(count: int = 80, radius: float = 2.6) -> np.ndarray:
    """Poses (k, 4, 4) in front of the base."""
    rng = np.random.default_rng(2)
    far, turn = radius * np.sqrt(rng.uniform(0.1, 1, count)), rng.uniform(-2.0, 2.5, count)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 3], T[:, 1, 3] = far * np.cos(turn), far * np.sin(turn)
    return T


def pool_of(T: np.ndarray) -> CandidateSheets:
    return CandidateSheets(planar_task(), SearchedPoses.of(T, 0.0), [], None, 0.0, True)


@pytest.fixture(scope="module")
def table() -> LevelTable:
    """Of joint 1 locked: a level is an angle of joint 1."""
    task, T = planar_task(), positions()
    strategy = hk.holonomic(task, hk.lock(0), name="lock q1")
    law = Candidate("lock q1", {"kind": "lock", "joints": ["q1"]}, task, strategy)
    go = side_by_side(strategy, T, None, 0.0, None)
    return level_table(law, strategy, START, STEP, T, nearby(T, 0.0), go, None)


def elbow_up(point: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Which angles of joint 1 leave the two outer links a posture with q3 >= 0 within the limits, by a triangle."""
    away = point - np.stack([np.cos(q1), np.sin(q1)], -1)
    far = np.linalg.norm(away, axis=-1)
    q3 = np.arccos(np.clip((far**2 - 2) / 2, -1, 1))
    q2 = (np.arctan2(away[:, 1], away[:, 0]) - q3 / 2 - q1 + np.pi) % (2 * np.pi) - np.pi
    return (far <= 2) & (q3 <= LIMIT) & (np.abs(q2) <= LIMIT) & (np.abs(q1) <= LIMIT)


def test_the_postures_of_a_table_are_at_their_poses_and_levels_within_the_limits(table: LevelTable) -> None:
    there = known(table.q)
    assert there.sum() > 200
    for level, row, flags in zip(table.levels, table.q, there, strict=True):
        reached = np.array([planar_task().robot.pose(q)[:2, 3] for q in row[flags]]).reshape(-1, 2)
        np.testing.assert_allclose(reached, table.T[flags][:, :2, 3], atol=1e-6)
        np.testing.assert_allclose(row[flags][:, 0], level, atol=1e-6)
        assert (np.abs(row[flags]) <= LIMIT + 1e-9).all()


def test_a_table_has_the_levels_that_a_triangle_allows(table: LevelTable) -> None:
    """Joint 1 locked, the elbow up: the closed form says for each pose which angles of joint 1 are within the limits.
    The table has no other level, and of those that hang together with it all but at the very end of a self-motion."""
    found = known(table.q)
    for k, T in enumerate(table.T):
        allowed = elbow_up(T[:2, 3], table.levels)
        assert not (found[:, k] & ~allowed).any()
    share = sum(found[:, k].sum() for k in range(len(table.T)))
    total = sum(elbow_up(T[:2, 3], table.levels).sum() for T in table.T)
    assert share > 0.9 * total


@pytest.mark.campaign
def test_a_fitted_leaf_serves_more_than_each_leaf_of_one_level(table: LevelTable) -> None:
    laws = table.fitted(np.ones(len(table.T)))
    assert len(laws) == 3
    best = known(table.q).sum(axis=1).max()
    counts = []
    for law, q0, _ in laws:
        pool = pool_of(table.T)
        pool.add(law, q0[None])
        pool.exact(np.array([0]))
        counts.append(int(pool.found[0].served.sum()))
    assert max(counts) > best
    assert max(counts) >= 0.95 * table.allowed.sum()


def test_a_fit_goes_where_the_weights_are(table: LevelTable) -> None:
    """With nearly all weight on the poses on one side, that side is served at least as well as without."""
    left = table.T[:, 1, 3] > 0
    counts = []
    for weights in (np.where(left, 1.0, 1e-3), np.where(left, 1e-3, 1.0)):
        law, q0, _ = table.fitted(weights)[0]
        pool = pool_of(table.T)
        pool.add(law, q0[None])
        counts.append((int(pool.found[0].served[left].sum()), int(pool.found[0].served[~left].sum())))
    assert counts[0][0] > counts[1][0]
    assert counts[1][1] > counts[0][1]


def test_what_a_job_says_of_a_fitted_law_is_that_law(table: LevelTable) -> None:
    """The keys of the law, read as a job reads them, give the same g, within the digits that are kept."""
    for law, q0, _ in table.fitted(np.ones(len(table.T))):
        assert law.strategy is not None
        again = _strategy(law.keys, law.task, q0, law.name)
        Q = q0 + np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
        np.testing.assert_allclose(
            again.constraint_value.batch(Q), law.strategy.constraint_value.batch(Q), rtol=0, atol=1e-12
        )
        assert np.abs(law.strategy.constraint_value.batch(q0[None])).max() < 1e-8


def test_poses_that_all_are_one_have_no_polynomial() -> None:
    T = np.tile(planar_task().robot.pose(START), (5, 1, 1))
    task = planar_task()
    strategy = hk.holonomic(task, hk.lock(0), name="lock q1")
    law = Candidate("lock q1", {"kind": "lock", "joints": ["q1"]}, task, strategy)
    go = side_by_side(strategy, T, None, 0.0, None)
    found = level_table(law, strategy, START, STEP, T, nearby(T, 0.0), go, None)
    assert found.fitted(np.ones(5)) == []


def test_over_a_fitted_law_no_other_one_is_fitted(table: LevelTable) -> None:
    """A job has no polynomial over a polynomial: the file of such a sheet could not be read."""
    law, q0, _ = table.fitted(np.ones(len(table.T)))[0]
    pool = pool_of(table.T)
    pool.add(law, q0[None])
    assert pool._table(pool.found[0]) is None


def test_the_levels_of_a_fitted_law_serve_the_poses_that_it_serves(table: LevelTable) -> None:
    """A search follows the shorter law from level to level, in place of the polynomial: at most one pose in twenty is
    served by one of them alone."""
    task = planar_task()
    strategy = hk.holonomic(task, hk.lock(0), name="lock q1")
    parent = Candidate("lock q1", {"kind": "lock", "joints": ["q1"]}, task, strategy)
    pool = pool_of(table.T)
    pool.add(parent, START[None])
    for law, q0, levels in table.fitted(np.ones(len(table.T))):
        pool.add(law, q0[None])
        pool.add(law, q0[None], True, pool.found[0], levels)
        own, by_levels = pool.found[-2].served, pool.found[-1].served
        assert by_levels.sum() > 0.75 * table.allowed.sum()
        assert (own != by_levels).mean() <= 0.05


def test_poses_that_are_left_out_are_searched_more_closely_and_counted_as_often_as_they_are() -> None:
    """Whatever is searched, the weights of the poses sum up to the share that a leaf serves of all poses."""
    T = positions(3000)
    served = T[:, 0, 3] > -1.5
    poses = SearchedPoses.of(T, 0.0)
    assert len(poses.T) == 400 and not poses.complete
    closer = poses.without(served)
    left = (~served)[closer.which]
    assert left.sum() == min(400, (~served).sum())
    assert closer.weights[left].sum() == pytest.approx((~served).sum())
    assert closer.weights[~left].sum() == pytest.approx(served.sum())
    assert closer.all.complete and (closer.all.weights == 1).all()
