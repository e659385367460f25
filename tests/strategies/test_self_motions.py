"""Self-motions: the tool is still at their postures, and between these."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START


def test_between_two_postures_of_a_self_motion_the_tool_is_still(panda: hk.Robot) -> None:
    curve = hk.strategies.self_motion(hk.pose(panda), PANDA_START, step=0.05)
    between = np.array([curve.at(s) for s in (curve.s[1:] + curve.s[:-1]) / 2])
    poses = np.array([panda.pose(q) for q in between])
    assert len(between) > 20 and np.abs(poses - panda.pose(PANDA_START)).max() < 1e-13
    gaps = [np.linalg.norm(between - curve.q[side], axis=1) for side in (slice(None, -1), slice(1, None))]
    assert np.concatenate(gaps) == pytest.approx(0.025, rel=1e-2)
