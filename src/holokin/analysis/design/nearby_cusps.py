"""Cusps of a law near a workspace: round one a closed path of the tool does not bring the joints back. Theory 7.3"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import HolokinError
from ...base.shown import Shown
from ...base.types import Matrix, Value, Vector
from ...motion.ik import inverse
from ...path.workspaces import Workspace
from ...strategies import Strategy
from ..curvature import Cusps, cusps
from ..curvature.cuspidal_leaf import cusps_from, tool_away

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
    """The cusps found on a law's leaf, and their least distance [m] from a workspace, infinite where none was found.

    found: None where they cannot be looked for, `reason` says why; the distance is NaN then. pose: of the tool at the
    nearest (4, 4), None where there is none.
    """

    found: Cusps | None
    away: float
    reason: str = ""
    pose: Matrix | None = None

    @property
    def near(self) -> bool:
        """Whether one is at the workspace, or nearly."""
        return self.away <= NEAR

    @property
    def clear(self) -> bool:
        """Whether they were looked for, and none is at the workspace."""
        return self.away > NEAR

    @property
    def sentence(self) -> str:
        """What was found; a search is no proof."""
        if self.found is None:
            return f"cusps of its leaf were not looked for: {self.reason}"
        if self.found.excluded:
            return f"its leaf has no cusp: {self.found.excluded}"
        searched = f"a search from {self.found.starts:,} starts and from the workspace, no proof"
        if not np.isfinite(self.away):
            return f"no cusp was found on its leaf within the joint limits ({searched})"
        if self.near:
            return (
                f"a cusp of its leaf lies in the workspace, or within {NEAR:g} m of it: round a cusp a closed path of "
                "the tool may not bring the joints back"
            )
        return f"the nearest cusp of its leaf that was found is {self.away:.2g} m from the workspace ({searched})"

    @property
    def loop(self) -> str:
        """The smallest tool loop found that does not bring the joints back; empty where none was found."""
        least = None if self.found is None else self.found.witness
        if least is None:
            return ""
        turns = f" and turns by {least.turn:.2g} rad" if least.turn else ""
        return (
            f"the smallest tool loop found on its leaf that does not bring the joints back is {least.length:.2g} m long"
            f"{turns}; after it a joint is {least.apart:.2g} (rad or m) from where it was"
        )


def cusps_near(strategy: Strategy, q0: Vector, space: Workspace) -> NearbyCusps:
    """Those of the leaf through q0, and how far they are from a workspace; or why they cannot be looked for."""
    constraint = getattr(strategy, "constraint", None)
    if constraint is None or constraint.looped is not None:
        return NearbyCusps(None, np.nan, "its formulas are too long")
    try:
        found = cusps(strategy, q0, starts=STARTS)
    except HolokinError as problem:  # such as a posture beyond the joint limits, where a design could not keep them
        return NearbyCusps(None, np.nan, str(problem))
    if found.excluded:
        return NearbyCusps(found, np.inf)
    poses = space.poses(POSES)
    ends = inverse(strategy, q0, limits=False).batch(space.poses(STARTS))
    near = cusps_from(found.strategy, found.level, ends.last[np.isfinite(ends.last).all(axis=1)], limits=True)
    all_of_them = np.concatenate([found.poses, near])
    away = tool_away(strategy.task, all_of_them, poses)
    if not len(away):
        return NearbyCusps(found, np.inf)
    return NearbyCusps(found, float(away.min()), pose=all_of_them[away.argmin()])


def _capital(sentence: str) -> str:
    """A sentence with its first letter large."""
    return sentence[:1].upper() + sentence[1:]


def said_of(chosen: str, first: str, looked_at: Mapping[str, NearbyCusps], more: float) -> Sequence[str]:
    """Sentences on the law that was chosen, and on the first one, which has `more` squared joint speed less."""
    found = looked_at[chosen]
    if chosen != first:
        return [
            f"{first!r}, which needs {more:.1%} less squared joint speed, has a cusp in the workspace, or within "
            f"{NEAR:g} m of it: round a cusp a closed path of the tool may not bring the joints back.",
            f"Of the law to take {found.sentence}.",
        ]
    others = [repr(name) for name, other in looked_at.items() if name != chosen and other.near]
    rest = f"; so has {', '.join(others)}, whose coverage and margins are as good" if found.near and others else ""
    return [f"{_capital(found.sentence)}{rest}."]


@dataclass(frozen=True)
class DegreeTried(Shown):
    """A design with polynomials of one degree: its objective, and the cusps of its leaf."""

    degree: int
    cost: float
    cusps: NearbyCusps


def said_of_degrees(chosen: int, looked_at: Sequence[DegreeTried], found: NearbyCusps) -> str:
    """Lines on the cusps of the design that was chosen, by its degree, of those looked at, the best first."""
    loop = f"{_capital(found.loop)}." if found.loop else ""
    others = [one for one in looked_at if one.degree != chosen]
    many = ", ".join(str(one.degree) for one in others)
    if others and found.clear:
        best, own = looked_at[0].cost, looked_at[-1].cost
        said = [
            f"Degree {chosen} was taken, which costs {own / best - 1:.1%} more than the best: with degree {many} a "
            f"cusp lies in the workspace, or within {NEAR:g} m of it.",
            f"Of degree {chosen} {found.sentence}.",
        ]
    else:
        rest = f"; so does one with degree {many}, whose coverage and margins are as good" if others else ""
        said = [f"{_capital(found.sentence)}{rest}."]
    return "\n".join([*said, loop] if loop else said)
