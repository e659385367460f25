"""Why a law is the best, and what keeps it from being better: sentences of an advice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..coverage.coverage_result import Coverage
from .advice import CLOSE, EASY, EQUAL, Law, Part
from .excess import NEAR, Beyond, Excess, Free, Rival

MOST = 3
"""Limits that are named in one sentence."""


def reasons(laws: Sequence[Law], found: Coverage, part: Part | None, excess: Excess | None) -> tuple[str, ...]:
    """The sentences: what the best does and the next does not, why poses are not served, what its speed is due to."""
    best = laws[0]
    if not best.served.any():
        causes = "; ".join(f"{cause}: {count}" for cause, count in found.causes())
        return (f"No law that was tried serves any of the {len(found)} poses. With {best.name!r}, {causes}.",)
    said = [f"Take {best.name!r}: {best.sentence}."]
    if len(laws) > 1:
        said.append(_next(best, laws[1]))
    if not best.served.all():
        said.append(_not_served(found, part, best))
    said += _speed(best, excess)
    return tuple(said)


def _next(best: Law, other: Law) -> str:
    """What speaks against the law after the best."""
    if best.coverage > other.coverage + EQUAL:
        return f"Next comes {other.name!r}, which reaches {other.coverage:.1%}."
    if best.clear > other.clear + EQUAL or best.clear == 1 > other.clear:
        rest = 1 - other.clear / other.coverage
        return f"Next comes {other.name!r}, which covers as much, but keeps well clear at {rest:.1%} less of it."
    if best.easy > other.easy + EASY:
        share = 1 - other.easy / other.coverage
        where = f"{share:.1%} of it near limits or singular postures"
        return f"Next comes {other.name!r}, which covers as much, but {where}."
    more = other.squared_speed / best.squared_speed - 1
    needs = f"it needs {more:.1%} more squared joint speed"
    return f"Next comes {other.name!r}: its coverage and margins are as good, but {needs}."


def _not_served(found: Coverage, part: Part | None, best: Law) -> str:
    """Why the rest is not served, and what is."""
    rest = [f"{cause}: {count}" for cause, count in found.causes() if cause != "reached"]
    said = f"Of {len(found)} poses {best.name!r} does not serve {int((~best.served).sum())} ({'; '.join(rest)})."
    if part is None:
        return f"{said} No box round the centre was found that a law serves from end to end."
    whose = "it serves" if part.law.name == best.name else f"{part.law.name!r} serves"
    sizes = f"its sizes {part.share:.0%} of those of the workspace"
    return f"{said} The largest part round the centre that {whose} is {part.workspace}, {sizes}."


def _speed(best: Law, excess: Excess | None) -> list[str]:
    """What keeps its joint speed above the least."""
    if not np.isfinite(best.speed):
        return ["Its joint speed was not compared."]
    if excess is None:
        least = f"at least {1 / best.speed:.1%} of the mean squared joint speed of {best.name!r}"
        return [f"Lower bound: even a law that took the best of the postures found at each pose would have {least}."]
    said = [_limits(best, excess.free)]
    if excess.free is not None and excess.free.speed <= 1 + CLOSE:
        return said
    if excess.near > 1 + CLOSE:
        said.append(f"The least lies at other postures of the same tool poses: {_near(excess)}.")
    if excess.rival is not None:
        said.append(_rival(excess.rival))
    elif excess.near > 1 + CLOSE:
        said.append("Of the laws that were tried none comes closer, also of those that serve less.")
    if best.speed > excess.near + CLOSE:
        clear = "keeping clear and " if np.isfinite(best.clearance) else ""
        said.append(f"The rest is what {clear}one smooth law for all poses needs, as far as those tried tell.")
    return said


def _near(excess: Excess) -> str:
    """How close to the least a law near the postures of the best may come."""
    which = f"this one's postures ({NEAR:g} rad of self-motion)"
    least = f"to the least than {excess.near - 1:.1%}"
    if excess.traced:
        return f"no law within the joint limits that stays near {which} comes closer {least}"
    return f"a search within the joint limits near {which} came no closer {least}"


def _limits(best: Law, free: Free | None) -> str:
    """What the joint limits near its postures cost."""
    if free is None:
        return "Joint limits near its postures are not the reason: it keeps away from them."
    above, beyond = f"{free.speed - 1:.1%} above the least", _beyond(free.beyond, f" of {free.poses}")
    if free.speed <= 1 + CLOSE:
        return f"Joint limits keep it from the least: the same law designed without limits is {above}, but {beyond}."
    if free.speed < best.speed - CLOSE / 2 and free.beyond:
        return f"Joint limits are part of the reason: the same law designed without limits is {above}, but {beyond}."
    return f"Joint limits near its postures are not the reason: the same law designed without limits is {above}."


def _rival(rival: Rival) -> str:
    """What keeps a law that is closer to the least from being the best."""
    why = [_beyond(rival.beyond)] if rival.beyond else []
    why += [f"its leaf ends before {rival.ends} poses"] if rival.ends else []
    return (
        f"Closer to the least comes {rival.name!r}, {rival.speed - 1:.1%} above it where it serves; but it serves only "
        f"{rival.coverage:.1%}: {' and '.join(why) or 'it comes too near to limits or singular postures'}."
    )


def _beyond(beyond: Beyond, of: str = "") -> str:
    """Which limits are exceeded, and at how many poses; the three that are most often."""
    said = [f"{joint} is beyond its {side} limit at {count}" for joint, side, count in beyond[:MOST]]
    return f"{', '.join(said)}{of} poses" if said else "within its limits all the same"
