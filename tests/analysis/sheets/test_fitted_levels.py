"""Laws whose level is a polynomial of the pose: what levels a pose has, and that a fitted leaf serves more of them."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from handmade_sheets import LIMIT, planar_task
from holokin.analysis.coverage.starts import Candidate
from holokin.analysis.sheets.candidate_sheets import CandidateSheets
from holokin.analysis.sheets.sheet import known, nearby
from holokin.analysis.sheets.sheet_growth import LevelTable, SearchedPoses, level_table, side_by_side
from holokin.app.job.runner import _strategy

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
