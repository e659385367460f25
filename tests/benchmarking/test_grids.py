"""The methods that `hk.sheets` is measured beside: the referee on a planar arm, our reruns, answers of other code."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from benchmarks import grid_bounds, grid_resolution, grid_roadmap, sheets

LIMIT = np.radians(150)
LINKS, LIMITS = (1.0, 1.0, 1.0), ((-LIMIT, LIMIT),) * 3


def tool_of(q: np.ndarray) -> np.ndarray:
    """The tool of three links of 1 m in a plane, by hand."""
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


@pytest.fixture(scope="module")
def found() -> grid_resolution.Resolution:
    return grid_resolution.grid_resolution(LINKS, LIMITS, cells=72, proposals=8)


@pytest.mark.campaign
def test_each_posture_is_within_the_limits_and_has_its_tool_at_its_pose(found: grid_resolution.Resolution) -> None:
    np.testing.assert_allclose(tool_of(found.q.astype(float)), found.grid.points, atol=2e-6)
    assert np.abs(found.q).max() <= LIMIT + 1e-6
    assert found.resolved == 1.0


@pytest.mark.campaign
def test_the_poses_are_those_of_the_disc_without_the_lens_behind_the_base(found: grid_resolution.Resolution) -> None:
    """The limit of joint 1 leaves what the two outer links do not reach from the elbow at +-150 degrees."""
    axis = -3 + found.grid.step * (np.arange(72) + 0.5)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    far = np.hypot(x - np.cos(LIMIT), np.abs(y) - np.sin(LIMIT)) > 2
    behind = np.abs(np.arctan2(y, x)) > LIMIT
    reachable = (np.hypot(x, y) <= 3) & ~(behind & far)
    assert len(found.q) == reachable.sum()


@pytest.mark.campaign
def test_the_shortest_possible_cut_is_that_of_the_closed_form() -> None:
    """Closed curves about a zero of w leave the limits at q2 = 150, q3 = 105 degrees; reach ends 2.80 m behind."""
    least = grid_bounds.least_cut(LINKS, LIMITS)
    inner = abs(1 + np.exp(1j * LIMIT) * (1 + np.exp(1j * np.radians(105))))
    outer = -np.cos(LIMIT) + np.sqrt(4 - np.sin(LIMIT) ** 2)
    np.testing.assert_allclose([least.inner, least.outer, least.length], [inner, outer, outer - inner], atol=5e-3)


@pytest.mark.campaign
def test_what_the_search_finds_is_not_shorter_than_the_bound(found: grid_resolution.Resolution) -> None:
    assert found.cut_length > grid_bounds.least_cut(LINKS, LIMITS).length
    assert found.cut_length < 2.5 * grid_bounds.single_jump(LINKS, LIMITS, 72).pairs


@pytest.mark.campaign
def test_an_arm_whose_limits_keep_it_in_front_needs_no_cut() -> None:
    narrow = ((-0.9, 0.9), (-1.5, -0.2), (-1.5, -0.2))
    assert grid_bounds.least_cut(LINKS, narrow).length == 0
    assert grid_resolution.grid_resolution(LINKS, narrow, cells=40, proposals=3).pieces == 0


@pytest.mark.campaign
def test_a_mixture_takes_of_each_answer_the_half_that_is_whole(found: grid_resolution.Resolution) -> None:
    """Two answers, each with random postures in one half of the disc."""
    rng, above = np.random.default_rng(1), found.grid.points[:, 1] > 0
    labels = np.moveaxis(found.grid.labels, 0, -1)
    random = np.stack([row[rng.choice(np.flatnonzero(np.isfinite(row[:, 0])))] for row in labels])
    answers = [np.where(side[:, None], found.q, random) for side in (above, ~above)]
    cut = [int(found.grid.cut(q).sum()) for q in (*answers, grid_resolution.mixed(found.grid, *answers))]
    assert cut[2] < 0.1 * min(cut[:2])


@pytest.mark.campaign
def test_pieces_that_touch_are_one_cut() -> None:
    middles = np.array([[0.0, 0], [0.1, 0], [0.2, 0.1], [1.0, 0], [1.1, 0]])
    assert grid_resolution.cut_pieces(middles, 0.1) == 2
    assert grid_resolution.cut_pieces(middles[:0], 0.1) == 0


@pytest.fixture(scope="module")
def roadmap() -> grid_roadmap.Roadmap:
    return grid_roadmap.grid_roadmap(LINKS, LIMITS, cells=18, count=30)


def test_the_postures_of_a_roadmap_are_at_their_nodes_and_within_the_limits(roadmap: grid_roadmap.Roadmap) -> None:
    known = np.isfinite(roadmap.q[:, 0])
    assert known.sum() > 0.95 * sheets.in_reach(roadmap.points).sum()
    np.testing.assert_allclose(tool_of(roadmap.q[known]), roadmap.points[known], atol=1e-5)
    assert np.abs(roadmap.q[known]).max() <= LIMIT


def test_joined_postures_go_over_into_each_other_with_the_tool_on_the_line(roadmap: grid_roadmap.Roadmap) -> None:
    """From one end, small steps of the tool with the least joint motion towards the other end arrive there."""
    for i, j in roadmap.pairs[roadmap.joined][::24]:
        q = roadmap.q[i].copy()
        for share in np.linspace(0, 1, 41)[1:]:
            wanted = (1 - share) * roadmap.q[i] + share * roadmap.q[j]
            goal = (1 - share) * roadmap.points[i] + share * roadmap.points[j]
            before, q = q, wanted
            for _ in range(8):
                bars = np.stack([-np.sin(np.cumsum(q)), np.cos(np.cumsum(q))])
                jacobian = np.cumsum(bars[:, ::-1], axis=1)[:, ::-1]
                q = q + np.linalg.pinv(jacobian) @ (goal - tool_of(q))
            assert np.abs(tool_of(q) - goal).max() < 1e-6
            assert np.abs(q - before).max() < 0.5
        np.testing.assert_allclose(q, roadmap.q[j], atol=1e-3)


def test_most_pairs_of_a_roadmap_are_joined(roadmap: grid_roadmap.Roadmap) -> None:
    """Of this coarse one nearly nine in ten; of postures chosen at random hardly any."""
    assert roadmap.joined.mean() > 0.8


def test_the_fewest_changes_are_those_of_trying_all_choices() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        layers = [rng.uniform(0, 1, (int(rng.integers(1, 5)), 2)) for _ in range(6)]
        most = np.array([0.35, 0.5])
        best = []
        for choice in itertools.product(*(range(len(layer)) for layer in layers)):
            q = np.array([layer[k] for layer, k in zip(layers, choice, strict=True)])
            joined = (np.abs(np.diff(q, axis=0)) <= most).all(axis=1)
            best.append((int((~joined).sum()), float(np.linalg.norm(np.diff(q, axis=0)[joined], axis=1).sum())))
        found = sheets.fewest_changes(layers, most)
        assert found.changes == min(best)[0]
        assert found.way == pytest.approx(min(best)[1])


def test_the_positions_in_reach_are_the_disc_without_the_lens_behind_the_base() -> None:
    """There the limit of joint 1 holds the elbow at +-150 degrees, and the two outer links reach 2 m from it."""
    points = np.random.default_rng(0).uniform(-3.1, 3.1, (4000, 2))
    x, y = points[:, 0], np.abs(points[:, 1])
    away = np.hypot(x - np.cos(LIMIT), y - np.sin(LIMIT))
    inside = (np.hypot(x, y) <= 3) & ((np.arctan2(y, x) <= LIMIT) | (away <= 2))
    clear = (np.abs(np.hypot(x, y) - 3) > 0.01) & (np.abs(away - 2) > 0.01)
    np.testing.assert_array_equal(sheets.in_reach(points)[clear], inside[clear])


def test_an_answer_of_other_code_is_counted_by_the_rule_of_all(tmp_path: Path) -> None:
    """Four positions in a row, a jump between the second and the third, no posture at the fourth; z is always 0."""
    file = tmp_path / "answer.json"
    x = [1.0, 1.1, 1.2, 1.3]
    answer = {
        "points": [[0.0, a, b] for a, b in zip(x, [0, 0, 0, 0.001], strict=True)],
        "q": [[0, 0, 0], [0.1, 0, 0], [0.1, 2, 0], None],
        "edges": [[0, 1], [1, 2], [2, 3]],
        "connected": [True, True, False],
        "seconds": 1.5,
    }
    file.write_text(json.dumps(answer), encoding="utf-8")
    read = sheets.read_answer("other code", file)
    speed, weight = read.measured(area=0.3)
    np.testing.assert_allclose(speed, [1, 20, np.nan], rtol=1e-3)
    assert weight == pytest.approx(2, rel=1e-3)
    path = np.stack([np.linspace(1, 1.3, 50), np.zeros(50)], 1)
    assert read.changes(path[None]).tolist() == [1]
