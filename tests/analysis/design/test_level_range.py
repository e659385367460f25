"""Levels that serve a workspace: closed forms of a planar arm, inverse kinematics of a Panda."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from holokin.analysis.design import level_range
from holokin.app.report.plots import level_figure
from holokin.base.errors import ArgumentError


def test_the_last_links_of_a_planar_arm_must_reach_the_farthest_corner() -> None:
    """Links of a metre, q3 = c: the last two are one of 2 cos(c / 2), so the tool reaches to 1 + 2 cos(c / 2)."""
    law = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))
    q0, space = np.array([0.3, 0.9, 0.7]), hk.workspace(box=([1.0, 2.0], [0.2, 0.2]))
    found = level_range(law, space, q0, limits=False, step=0.2)
    far = np.linalg.norm(space.poses(256)[:, :2, 3], axis=1).max()
    (interval,) = [ends for ends in found.intervals if ends[0] < 0.7 < ends[1]]
    assert interval[1] == pytest.approx(2 * np.arccos((far - 1) / 2), abs=2e-4)
    assert found.shares[np.abs(found.levels - 0.7).argmin()] == 1.0 and found.shares.min() < 1.0
    assert hk.coverage(law, space, found.q0, samples=256, limits=False).share == 1.0
    assert found.best == pytest.approx(law.constraint_value(found.q0)) and "serve all" in found.sentence
    low, high = level_figure(found).axes[0].get_xlim()
    assert low < interval[0] < interval[1] < high


@pytest.mark.campaign
def test_a_panda_s_elbow_may_go_so_far_while_its_tool_works_in_a_box() -> None:
    """Referee: the leaf's own inverse kinematics, begun at postures that self-motion leads to."""
    robot, q0 = hk.load("panda"), np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    tool, law = robot.pose(q0), hk.holonomic(hk.pose(robot), hk.lock(2))
    space = hk.workspace(box=(tool[:3, 3], [0.1, 0.1, 0.1]), rotation=tool[:3, :3], tilt=0.1)
    found = level_range(law, space, q0, step=0.1)
    ((low, high),) = found.intervals
    assert low < found.level < high and found.cusps is not None
    for level, all_of_it in ((low + 0.02, True), (found.best, True), (high - 0.02, True), (high + 0.1, False)):
        moved = hk.motion.ik.move_to_leaf(law, q0, level)
        reached = hk.ik(law, moved, limits=True).batch(space.poses(256)).reached
        assert reached.all() == all_of_it


@pytest.mark.campaign
def test_an_advice_tells_the_levels_of_its_best_law_if_it_is_asked() -> None:
    """Referee: inverse kinematics of that law, within the limits, begun on leaves inside and outside the interval."""
    bars = [{"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0} for _ in range(3)]
    space = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    advice = hk.advise(hk.position(hk.from_dh(bars, name="planar")), space, levels=True)
    found, law = advice.levels, advice.best
    assert found is not None and f"{found.served}." in advice.reasons[-1]
    assert advice.to_dict()["levels"] == [list(ends) for ends in found.intervals]
    low, high = next(ends for ends in found.intervals if ends[0] <= found.best <= ends[1])
    for level, all_of_it in ((low + 0.02, True), (found.best, True), (high - 0.02, True), (high + 0.05, False)):
        moved = hk.motion.ik.move_to_leaf(law.strategy, law.q0, level)
        assert hk.ik(law.strategy, moved, limits=True).batch(space.poses(256)).reached.all() == all_of_it


def test_a_law_of_several_rows_is_refused_and_where_no_level_serves_all_the_best_is_told() -> None:
    arm = hk.load("planar-3r")
    with pytest.raises(ArgumentError, match="rows of the constraint"):
        level_range(hk.holonomic(hk.position(arm, rows=[0]), hk.lock(1, 2)), hk.workspace(box=([1, 1], [0.1, 0.1])),
                    [0.3, 0.9, 0.7])  # fmt: skip
    law = hk.holonomic(hk.position(arm), hk.lock(2))
    found = level_range(law, hk.workspace(box=([2.5, 2.5], [1.5, 1.5])), [0.3, 0.9, 0.7], limits=False, step=0.6)
    assert found.intervals == () and "no level serves all" in found.sentence and 0 < found.shares.max() < 1
