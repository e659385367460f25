"""Why a closed path on a regular leaf ends elsewhere: round a cusp, or round a hole of the workspace. Theory 7.3"""

from __future__ import annotations

import numpy as np

from ...base.arguments import typed
from ...motion.drift_cause import NO_DRIFT
from ...motion.ik.leaf import leaf_value
from ...motion.trajectory import Status, Trajectory, whole_turns
from ...strategies import HolonomicStrategy
from .cuspidal_leaf import cusps_from, tool_away

PLACES = 100
"""Postures of the path from which cusps are looked for, and their distance is taken."""

CLOSE = 0.1
"""Distance [m] from the path, a turn of one radian counted as 0.1 m, from which on a cusp is called near it."""


@typed
def why_elsewhere(strategy: HolonomicStrategy, walk: Trajectory) -> str:
    """A sentence on a closed path whose joints, followed on a regular leaf, do not come back; empty where they do.

    Curvature is zero on a leaf: small loops return. So the path cannot be shrunk to a point on the leaf: it goes round
    a cusp or a hole, or turns the tool once. Cusps are looked for by Newton's method from the path's postures, and the
    nearest one is named.

    Args:
        walk: of `follow`, whose path was closed.
    """
    drift = walk.drift()
    if walk.status is not Status.COMPLETE or not len(drift) or np.abs(drift[0]).max() <= NO_DRIFT:
        return ""
    i = int(np.abs(drift[0]).argmax())
    name, unit, away = walk.joint_names[i], walk.joint_units[i], drift[0][i]
    said = (
        f"after a cycle {name} is {away:.3g} {unit} from its start, though the leaf is regular along the path: it "
        "cannot be shrunk to a point on the leaf"
    )
    rest = drift[0] - 2 * np.pi * whole_turns(drift[0], walk.joint_units)
    if np.abs(rest).max() <= NO_DRIFT:
        return f"{said}, and the joints are whole turns further"
    along = walk.q[np.linspace(0, len(walk.q) - 1, PLACES).astype(int)]
    poses = cusps_from(strategy, leaf_value(strategy, walk.q[0]), along, limits=False)
    far = tool_away(strategy.task, poses, np.array([strategy.task.pose(q) for q in along]))
    if len(far) and far.min() <= CLOSE:
        at = ", ".join(f"{x:.3g}" for x in poses[int(far.argmin()), :3, 3])
        return f"{said}; a cusp of the leaf lies {far.min():.2g} m from the path, at the tool position [{at}] m"
    return f"{said}; no cusp was found near the path, from {PLACES} of its postures"
