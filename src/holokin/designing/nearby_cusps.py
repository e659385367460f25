"""Cusps of a law near a workspace: round one a closed path of the tool does not bring the joints back. Theory 7.3"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..analysis import Cusps, cusps
from ..analysis.cuspidal_leaf import cusps_from, tool_away
from ..base.types import Value, Vector
from ..inverse_kinematics import inverse
from ..path.workspaces import Workspace
from ..strategies import Strategy

NEAR = 0.1
"""Distance [m] of a cusp from the nearest of many poses of a workspace, a turn of one radian counted as 0.1 m, up to
which it counts: these poses are about so far apart."""

POSES = 16_384
"""Poses of a workspace, from which the distance is taken."""

STARTS = 300
"""Starts of the search for them."""

MORE_SPEED = 1.1
"""Mean squared joint speed, over that of the best law, at which a law without cusps nearby is preferred at most."""


@dataclass(frozen=True, eq=False)
class NearbyCusps(Value):
    """The cusps found on a law's leaf, and their least distance [m] from a workspace, infinite where none was found."""

    found: Cusps
    away: float

    @property
    def near(self) -> bool:
        """Whether one is at the workspace, or nearly."""
        return self.away <= NEAR

    @property
    def sentence(self) -> str:
        """What was found; a search is no proof."""
        searched = f"a search from {self.found.starts:,} starts and from the workspace, no proof"
        if not np.isfinite(self.away):
            return f"no cusp was found on its leaf within the joint limits ({searched})"
        if self.near:
            return (
                f"a cusp of its leaf lies in the workspace, or within {NEAR:g} m of it: round a cusp a closed path of "
                "the tool may not bring the joints back"
            )
        return f"the nearest cusp of its leaf that was found is {self.away:.2g} m from the workspace ({searched})"


def cusps_near(strategy: Strategy, q0: Vector, space: Workspace) -> NearbyCusps | None:
    """Those of the leaf through q0, and how far they are from a workspace; None where formulas are too long."""
    constraint = getattr(strategy, "constraint", None)
    if constraint is None or constraint.looped is not None:
        return None
    found, poses = cusps(strategy, q0, starts=STARTS), space.poses(POSES)
    ends = inverse(strategy, q0).batch(space.poses(STARTS))
    near = cusps_from(found.strategy, found.level, ends.last[np.isfinite(ends.last).all(axis=1)], limits=True)
    away = np.append(found.tool_away_from(poses), tool_away(strategy.task, near, poses))
    return NearbyCusps(found, float(away.min(initial=np.inf)))


def said_of(chosen: str, first: str, looked_at: Mapping[str, NearbyCusps | None], more: float) -> Sequence[str]:
    """Sentences on the law that was chosen, and on the first one, which has `more` squared joint speed less."""
    found = looked_at.get(chosen)
    if found is None:
        return ["Cusps of its leaf were not looked for: its formulas are too long."]
    if chosen != first:
        return [
            f"{first}, which needs {more:.1%} less squared joint speed, has a cusp in the workspace, or within "
            f"{NEAR:g} m of it: round a cusp a closed path of the tool may not bring the joints back.",
            f"Of the law to take {found.sentence}.",
        ]
    others = [name for name, other in looked_at.items() if name != chosen and other is not None and other.near]
    rest = f"; so has {', '.join(others)}, which serves as much" if found.near and others else ""
    return [f"{found.sentence[0].upper()}{found.sentence[1:]}{rest}."]
