"""The referee of `hk.sheets` on a planar arm: its postures, its cuts, and the shortest possible cut in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import grid_bounds, grid_resolution

pytestmark = pytest.mark.campaign
LIMIT = np.radians(150)
LINKS, LIMITS = (1.0, 1.0, 1.0), ((-LIMIT, LIMIT),) * 3


@pytest.fixture(scope="module")
def found() -> grid_resolution.Resolution:
    return grid_resolution.grid_resolution(LINKS, LIMITS, cells=72, proposals=8)


def test_each_posture_is_within_the_limits_and_has_its_tool_at_its_pose(found: grid_resolution.Resolution) -> None:
    q = found.q.astype(float)
    turned = np.cumsum(q, axis=1)
    tool = np.stack([np.cos(turned).sum(axis=1), np.sin(turned).sum(axis=1)], axis=1)
    np.testing.assert_allclose(tool, found.grid.points, atol=2e-6)
    assert np.abs(q).max() <= LIMIT + 1e-6
    assert found.resolved == 1.0


def test_the_poses_are_those_of_the_disc_without_the_lens_behind_the_base(found: grid_resolution.Resolution) -> None:
    """The limit of joint 1 leaves what the two outer links do not reach from the elbow at +-150 degrees."""
    axis = -3 + found.grid.step * (np.arange(72) + 0.5)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    far = np.hypot(x - np.cos(LIMIT), np.abs(y) - np.sin(LIMIT)) > 2
    behind = np.abs(np.arctan2(y, x)) > LIMIT
    reachable = (np.hypot(x, y) <= 3) & ~(behind & far)
    assert len(found.q) == reachable.sum()


def test_the_shortest_possible_cut_is_that_of_the_closed_form() -> None:
    """Closed curves about a zero of w leave the limits at q2 = 150, q3 = 105 degrees; reach ends 2.80 m behind."""
    least = grid_bounds.least_cut(LINKS, LIMITS)
    inner = abs(1 + np.exp(1j * LIMIT) * (1 + np.exp(1j * np.radians(105))))
    outer = -np.cos(LIMIT) + np.sqrt(4 - np.sin(LIMIT) ** 2)
    np.testing.assert_allclose([least.inner, least.outer, least.length], [inner, outer, outer - inner], atol=5e-3)


def test_what_the_search_finds_is_not_shorter_than_the_bound(found: grid_resolution.Resolution) -> None:
    assert found.cut_length > grid_bounds.least_cut(LINKS, LIMITS).length
    assert found.cut_length < 2.5 * grid_bounds.single_jump(LINKS, LIMITS, 72).pairs


def test_an_arm_whose_limits_keep_it_in_front_needs_no_cut() -> None:
    narrow = ((-0.9, 0.9), (-1.5, -0.2), (-1.5, -0.2))
    assert grid_bounds.least_cut(LINKS, narrow).length == 0
    assert grid_resolution.grid_resolution(LINKS, narrow, cells=40, proposals=3).pieces == 0


def test_a_mixture_takes_of_each_answer_the_half_that_is_whole(found: grid_resolution.Resolution) -> None:
    """Two answers, each with random postures in one half of the disc."""
    rng, above = np.random.default_rng(1), found.grid.points[:, 1] > 0
    labels = np.moveaxis(found.grid.labels, 0, -1)
    random = np.stack([row[rng.choice(np.flatnonzero(np.isfinite(row[:, 0])))] for row in labels])
    answers = [np.where(side[:, None], found.q, random) for side in (above, ~above)]
    cut = [int(found.grid.cut(q).sum()) for q in (*answers, grid_resolution.mixed(found.grid, *answers))]
    assert cut[2] < 0.1 * min(cut[:2])


def test_pieces_that_touch_are_one_cut() -> None:
    middles = np.array([[0.0, 0], [0.1, 0], [0.2, 0.1], [1.0, 0], [1.1, 0]])
    assert grid_resolution.cut_pieces(middles, 0.1) == 2
    assert grid_resolution.cut_pieces(middles[:0], 0.1) == 0
