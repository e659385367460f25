"""An SO-101: five joints, two too many for the tool's position."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import HolokinError

ARM = hk.load("so101")
HELD = hk.strategies.constraints.stack(hk.lock("wrist_roll"), hk.linear([0, 1, 1, 1, 0]))
START = np.array([0.2, -0.6, 0.6, 0.4, 0.1])


def test_three_parallel_hinges_whose_sum_is_held_keep_the_pitch_of_the_jaws() -> None:
    """With the roll held, too, the joints belong to the tool's position: a loop brings them back."""
    law = hk.holonomic(hk.position(ARM), HELD)
    p = ARM.pose(START)[:3, 3]
    loop = hk.polyline([p, p + [0.03, 0, 0], p + [0.03, 0.05, 0.02], p + [0, 0.04, 0]], closed=True)
    walk = hk.follow(law, loop, START, samples=40)
    directions = np.array([ARM.pose(q)[:3, 2] for q in walk.q])
    assert np.ptp(directions[:, 2]) < 1e-9
    assert np.ptp(np.arctan2(directions[:, 1], directions[:, 0])) > 0.05  # the jaws turn with the shoulder only
    assert np.abs(walk.q[-1] - walk.q[0]).max() < 1e-9
    ik = hk.ik(law, START)
    assert np.abs(ik(loop.at([0.7 * loop.duration]).position[0])[4] - START[4]) < 1e-12
    pseudo_inverse = hk.moore_penrose(hk.position(ARM))
    assert hk.drift(pseudo_inverse, loop, START).largest[0] > 1e-3


def test_position_and_axis_leave_nothing_redundant_and_a_whole_pose_is_refused() -> None:
    ik = hk.ik(hk.moore_penrose(hk.pose(ARM, "axis")), START)
    near = START + [0.05, -0.04, 0.03, 0.02, 0.0]
    found = ik(ARM.pose(near))
    assert np.abs(ARM.pose(found)[:3, 3] - ARM.pose(near)[:3, 3]).max() < 1e-9
    assert np.abs(ARM.pose(found)[:3, 2] - ARM.pose(near)[:3, 2]).max() < 1e-9
    with pytest.raises(HolokinError, match="n = 5 joints"):
        hk.pose(ARM)
