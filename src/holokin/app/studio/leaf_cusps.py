"""How far a law's leaf is one function of the tool pose: the cusps that are found on it, as a page shows them."""

from __future__ import annotations

import numpy as np

from ...analysis.design.nearby_cusps import NearbyCusps, cusps_near
from ...base.types import Vector
from ...motion.ik.leaf import leaf_value
from ...path.workspaces import pose_cloud
from ...strategies import HolonomicStrategy
from .states import LeafCusps

POINTS = 120
"""Points of the line of a loop."""


def leaf_cusps(name: str, strategy: HolonomicStrategy, q: Vector) -> LeafCusps:
    """Those of the leaf through a posture (n,), and how far they are from the tool there."""
    found = cusps_near(strategy, q, pose_cloud(strategy.task.pose(q)[None]))
    place = None if found.pose is None else found.pose[:3, 3]
    least = None if found.found is None else found.found.witness
    loop = np.zeros((0, 3)) if least is None else least.path.at(np.linspace(0, least.path.duration, POINTS)).position
    return LeafCusps(name, leaf_value(strategy, q), False, _sentence(name, found), place, loop)


def _sentence(name: str, found: NearbyCusps) -> str:
    """What was found, in a line or two."""
    if found.found is None:
        return f"{name}: cusps were not looked for: {found.reason}"
    if found.found.excluded:
        return f"{name}: its leaf has no cusp: {found.found.excluded}."
    if found.pose is None:
        return (
            f"{name}: no cusp was found within the joint limits from {found.found.starts:,} starts, which is no proof."
        )
    said = f"{name}: the nearest cusp found within the joint limits is {found.away:.2g} m away."
    least = found.found.witness
    if least is None:
        return f"{said} No tool loop round a cusp was found."
    return (
        f"{said} The smallest tool loop found is {least.length:.2g} m long; after it a joint is {least.apart:.2g} (rad "
        "or m) from where it was."
    )
