"""The referee that `hk.sheets` is measured beside: the postures of a grid, its cuts, and the rule that counts them."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import grids
from benchmarks.grids import LIMIT, Grid


def tool_of(q: np.ndarray) -> np.ndarray:
    """The tool of three links of 1 m in a plane, by hand."""
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


@pytest.fixture(scope="module")
def least() -> tuple[Grid, np.ndarray]:
    return grids.minimum_cuts(cells=72, proposals=8)


@pytest.mark.campaign
def test_each_posture_is_within_the_limits_and_has_its_tool_at_its_position(least: tuple[Grid, np.ndarray]) -> None:
    grid, q = least
    np.testing.assert_allclose(tool_of(q.astype(float)), grid.points, atol=2e-6)
    assert np.abs(q).max() <= LIMIT + 1e-6


def test_the_positions_in_reach_are_the_disc_without_the_lens_behind_the_base() -> None:
    """There the limit of joint 1 holds the elbow at +-150 degrees, and the two outer links reach 2 m from it."""
    points = np.random.default_rng(0).uniform(-3.1, 3.1, (4000, 2))
    x, y = points[:, 0], np.abs(points[:, 1])
    away = np.hypot(x - np.cos(LIMIT), y - np.sin(LIMIT))
    inside = (np.hypot(x, y) <= 3) & ((np.arctan2(y, x) <= LIMIT) | (away <= 2))
    clear = (np.abs(np.hypot(x, y) - 3) > 0.01) & (np.abs(away - 2) > 0.01)
    np.testing.assert_array_equal(grids.in_reach(points)[clear], inside[clear])


@pytest.mark.campaign
def test_the_cuts_found_are_longer_than_the_radii_that_every_function_must_cut(least: tuple[Grid, np.ndarray]) -> None:
    """Closed curves of postures about the base leave the limits at q2 = 150, q3 = 105 degrees; behind the base, reach
    ends at 2.80 m. Cut pairs count a diagonal 1.41 times."""
    grid, q = least
    inner = abs(1 + np.exp(1j * LIMIT) * (1 + np.exp(1j * np.radians(105))))
    outer = -np.cos(LIMIT) + np.sqrt(4 - np.sin(LIMIT) ** 2)
    assert outer - inner < grid.cut(q).sum() * grid.step < 5.0


@pytest.mark.campaign
def test_a_mixture_takes_of_each_answer_the_half_that_is_whole(least: tuple[Grid, np.ndarray]) -> None:
    """Two answers, each with random postures in one half of the disc."""
    grid, q = least
    rng, above = np.random.default_rng(1), grid.points[:, 1] > 0
    labels = np.moveaxis(grid.labels, 0, -1)
    random = np.stack([row[rng.choice(np.flatnonzero(np.isfinite(row[:, 0])))] for row in labels])
    answers = [np.where(side[:, None], q, random) for side in (above, ~above)]
    cut = [int(grid.cut(answer).sum()) for answer in (*answers, grids.mixed(grid, *answers))]
    assert cut[2] < 0.1 * min(cut[:2])


def test_pieces_that_touch_are_one_cut_and_jumps_along_a_path_are_counted() -> None:
    """Four positions in a row, a jump between the second and the third, no posture at the fourth."""
    middles = np.array([[0.0, 0], [0.1, 0], [0.2, 0.1], [1.0, 0], [1.1, 0]])
    assert (grids.cut_pieces(middles, 0.1), grids.cut_pieces(middles[:0], 0.1)) == (2, 0)
    points = np.array([[1.0, 0], [1.1, 0], [1.2, 0], [1.3, 0]])
    beside = np.array([[-1, 1, -1, -1], [0, 2, -1, -1], [1, 3, -1, -1], [2, -1, -1, -1]])
    grid = Grid(points, np.zeros((3, 4, 1)), beside, 0.1)
    q = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 2, 0], [np.nan] * 3])
    np.testing.assert_array_equal(grid.cut(q), [False, True, False])
    path = np.stack([np.linspace(1, 1.3, 50), np.zeros(50)], 1)
    assert grids.changes(grid, q, path[None]).tolist() == [1]
