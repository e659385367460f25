"""Why a law is the best, and what keeps it from being better: sentences of an advice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .advice import CLOSE, EASY, EQUAL, Law, Part
from .covered import Coverage


def reasons(
    laws: Sequence[Law], found: Coverage, part: Part | None, limits: tuple[float, str, float] | None
) -> tuple[str, ...]:
    """The sentences: what the best does and the next does not, why poses are not served, what its speed is due to."""
    best = laws[0]
    said = [f"Take {best.name}: {best.sentence}."]
    if len(laws) > 1:
        said.append(_next(best, laws[1]))
    if not best.served.all():
        said.append(_not_served(found, part, best))
    said.append(_speed(best, limits))
    return tuple(said)


def _next(best: Law, other: Law) -> str:
    """What speaks against the law after the best."""
    if best.coverage > other.coverage + EQUAL:
        return f"Next comes {other.name}, which reaches {other.coverage:.1%}."
    if best.easy > other.easy + EASY:
        share = 1 - other.easy / other.coverage
        return f"Next comes {other.name}, which covers as much, but {share:.1%} of it near limits or singular postures."
    more = other.squared_speed / best.squared_speed - 1
    return f"Next comes {other.name}, which serves as much with {more:.1%} more squared joint speed."


def _not_served(found: Coverage, part: Part | None, best: Law) -> str:
    """Why the rest is not served, and what is."""
    rest = [f"{cause}: {count}" for cause, count in found.causes() if cause != "reached"]
    said = f"Of {len(found)} poses it does not serve {int((~best.served).sum())} ({'; '.join(rest)})."
    if part is None:
        return f"{said} No box round the centre was found that a law serves from end to end."
    whose = "it serves" if part.law.name == best.name else f"{part.law.name} serves"
    sizes = f"its sizes {part.share:.0%} of those of the workspace"
    return f"{said} The largest part round the centre that {whose} is {part.workspace}, {sizes}."


def _speed(best: Law, limits: tuple[float, str, float] | None) -> str:
    """What keeps its joint speed above the least."""
    if not np.isfinite(best.speed):
        return "Its joint speed was not compared."
    if best.speed <= 1 + CLOSE:
        return f"No law on its self-motions can have less than {1 / best.speed:.1%} of its mean squared joint speed."
    rest = "the rest is what one law for all poses needs, as far as those tried tell"
    if limits is not None:
        whole, joint, freed = limits
        said = f"On these self-motions no law within the joint limits comes closer to the least than {whole - 1:.1%}"
        return f"{said}; without those of {joint} it would be {freed - 1:.1%}; {rest}."
    return f"No joint limit costs it speed: the {best.speed - 1:.1%} are {rest.removeprefix('the rest is ')}."
