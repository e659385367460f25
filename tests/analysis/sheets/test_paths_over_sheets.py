"""Paths over several sheets: held against every choice of sheets, Pinocchio, `check`, and a writer of programs."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from handmade_sheets import LIMIT, map_of, panda_map, planar_map, planar_task
from holokin.analysis.coverage.starts import Candidate, reached
from holokin.analysis.sheets import Sheet, Sheets, self_motion_between
from holokin.analysis.sheets.branch import Branch, branches_by_signs
from holokin.analysis.sheets.candidate_sheets import CandidateSheets
from holokin.analysis.sheets.level_ranges import branches_by_curves
from holokin.analysis.sheets.sheet import known, nearby
from holokin.app.job.runner import _strategy
from holokin.base.errors import ArgumentError, HolokinError, PathError, StartError
from holokin.motion.self_motions.self_motions import self_motions_at


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


def pool_of(task: hk.Task, T: np.ndarray, q: np.ndarray, branches: list[Branch]) -> CandidateSheets:
    return CandidateSheets(task, T, q, np.arange(len(T)), np.ones(len(T)), [], branches, None, 0.0, 0.995, True)


@pytest.fixture(scope="module")
def planar_pool() -> CandidateSheets:
    """Of joint 1 locked: a level is an angle of joint 1."""
    task, T = planar_task(), positions()
    candidate = Candidate(
        "lock q1", {"kind": "lock", "joints": ["q1"]}, task, hk.holonomic(task, hk.lock(0), name="lock q1")
    )
    curves = self_motions_at(task, T[:, :3, 3], T[:, :3, :3])
    linked = branches_by_curves(candidate, T, nearby(T, 0.0), None, curves)
    q = reached(task, T, None).q
    return pool_of(task, T, q, [Branch(candidate, branch.ranges, branch.postures) for branch in linked])


@pytest.fixture(scope="module")
def panda_pool() -> CandidateSheets:
    task = hk.pose(hk.load("panda"))
    T = hk.workspace(box=([0.5, 0.0, 0.4], [0.2, 0.2, 0.2]), tilt=0.3).poses(200)
    reach = reached(task, T, None)
    T, q = T[reach.within], reach.q[reach.within]
    return pool_of(task, T, q, branches_by_signs(task, T, None))


def best(pool: CandidateSheets, degree: int, left: np.ndarray) -> np.ndarray:
    """Which poses that sheet serves, fitted to some poses, which serves most of them."""
    pool.found.clear()
    pool.fit(left, degree, 4)
    return pool.sets[np.argmax(pool.sets @ left)]


def elbow_up(point: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Which angles of joint 1 leave the two outer links a posture with q3 >= 0 within the limits, by a triangle."""
    away = point - np.stack([np.cos(q1), np.sin(q1)], -1)
    far = np.linalg.norm(away, axis=-1)
    q3 = np.arccos(np.clip((far**2 - 2) / 2, -1, 1))
    q2 = (np.arctan2(away[:, 1], away[:, 0]) - q3 / 2 - q1 + np.pi) % (2 * np.pi) - np.pi
    return (far <= 2) & (q3 <= LIMIT) & (np.abs(q2) <= LIMIT) & (np.abs(q1) <= LIMIT)


def test_ranges_have_the_levels_that_a_triangle_allows(planar_pool: CandidateSheets) -> None:
    """Joint 1 locked, the elbow up: the closed form says which angles of joint 1 are within the limits at a pose."""
    q1 = np.linspace(-LIMIT, LIMIT, 181)
    total = there = 0
    for k, T in enumerate(planar_pool.T):
        wanted, own = elbow_up(T[:2, 3], q1), np.zeros(181, dtype=bool)
        for branch in planar_pool.branches:
            q = branch.postures(np.full(181, k), q1)
            own |= known(q) & (q[:, 2] >= 0)
        assert not (own & ~wanted).any()
        total, there = total + wanted.sum(), there + own.sum()
    assert there > 0.9 * total


def test_ranges_of_a_held_joint_end_where_its_postures_do(panda_pool: CandidateSheets) -> None:
    """In a range there is a posture within the limits, at its pose, of its level; a step beyond it there is none, but
    for ranges that are narrower than a step."""
    robot = panda_pool.task.robot
    assert len(panda_pool.branches) > 6
    for branch in panda_pool.branches:
        pose, middle, half = branch.ranges
        k = robot.joint_index(branch.candidate.keys["joints"][0])
        q = branch.postures(pose, middle)
        there = known(q)  # not where a gap in a range is narrower than a step
        q, pose, middle, half = q[there], pose[there], middle[there], half[there]
        assert there.mean() > 0.95 and robot.within(q).all()
        np.testing.assert_allclose(robot.pose(q), panda_pool.T[pose], atol=1e-7)
        np.testing.assert_allclose(q[:, k], middle, atol=1e-12)
        single = np.bincount(pose, minlength=len(panda_pool.T))[pose] == 1
        step = (robot.upper[k] - robot.lower[k]) / 60
        for side in (-1, 1):
            beyond = branch.postures(pose[single], (middle + side * (half + step))[single])
            assert known(beyond).mean() < 0.05


@pytest.mark.parametrize("name", ["planar_pool", "panda_pool"])
def test_a_fitted_leaf_serves_more_than_each_leaf_of_one_level(name: str, request: pytest.FixtureRequest) -> None:
    pool = request.getfixturevalue(name)
    constant, curved = (best(pool, degree, np.ones(len(pool.T), dtype=bool)).mean() for degree in (0, 3))
    assert curved > constant + 0.05


def test_a_fit_goes_where_the_poses_are_that_are_left(planar_pool: CandidateSheets) -> None:
    """Fitted to the poses on one side, a sheet serves that side better than one that is fitted to the other."""
    left = planar_pool.T[:, 1, 3] > 0
    first, second = (best(planar_pool, 1, side) for side in (left, ~left))
    assert first[left].sum() > second[left].sum()
    assert second[~left].sum() > first[~left].sum()


def test_what_a_job_says_of_a_fitted_strategy_is_that_strategy(planar_pool: CandidateSheets) -> None:
    """The keys of the strategy, read as a job reads them, give the same g, within the digits that are kept."""
    planar_pool.found.clear()
    planar_pool.fit(np.ones(len(planar_pool.T), dtype=bool), 2, 2)
    for entry in planar_pool.found:
        sheet = entry.sheet
        again = _strategy(sheet.keys, planar_pool.task, sheet.q0, sheet.name)
        Q = sheet.q0 + np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
        values = sheet.strategy.constraint_value.batch(Q)
        np.testing.assert_allclose(again.constraint_value.batch(Q), values, rtol=0, atol=1e-12)
        assert np.abs(sheet.level).max() < 1e-4


def test_poses_that_all_are_one_have_no_polynomial(planar_pool: CandidateSheets) -> None:
    T = np.tile(planar_task().robot.pose(START), (5, 1, 1))
    assert pool_of(planar_task(), T, np.tile(START, (5, 1)), []).degrees == [0]
    assert planar_pool.degrees == [0, 1, 2, 3]


def test_a_sheet_of_a_held_joint_answers_by_its_closed_form_alone(
    panda_pool: CandidateSheets, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever pose was asked before, and from wherever: the posture of the branch, or none."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    panda_pool.found.clear()
    panda_pool.fit(np.ones(len(panda_pool.T), dtype=bool), 2, 3)
    for entry in panda_pool.found:
        sheet = entry.sheet
        assert sheet.single
        q, served = sheet.postures(panda_pool.T)
        np.testing.assert_array_equal(served, entry.served)
        for i in range(0, len(panda_pool.T), 20):
            alone = sheet.posture(panda_pool.T[i])
            assert (alone is not None) == served[i]
            if alone is not None:
                np.testing.assert_allclose(alone, q[i], atol=1e-12)
                np.testing.assert_allclose(panda_pool.task.robot.pose(alone), panda_pool.T[i], atol=1e-9)
