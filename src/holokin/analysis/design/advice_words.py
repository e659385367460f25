"""The advice in at most eight lines: what to take, what it serves, what is close, what it costs, and what else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .nearby_cusps import NearbyCusps
from .served_curves import EASY, EQUAL
from .trials import Part, RatedStrategy, alike, is_proven, more_speed

SLOWER = 0.02
"""Share of mean squared joint speed up to which two strategies are as fast."""

CAUSES = 4
"""Reasons why poses are not served that are told one by one, those of most poses."""


def lines(
    strategies: Sequence[RatedStrategy],
    cusps: Mapping[str, NearbyCusps],
    causes: Sequence[tuple[str, int]],
    part: Part | None,
) -> tuple[str, ...]:
    """What an engineer is told of the best of some strategies, the best first: a sentence or two a line, eight at most.

    Args:
        cusps: of those that were looked at. causes: why poses are not served by the best, and how many.
    """
    best, many = strategies[0], len(strategies[0].served)
    why = "; ".join(f"{cause}: {count}" for cause, count in causes[:CAUSES])
    if len(causes) > CAUSES:
        why += f"; other reasons: {sum(count for _, count in causes[CAUSES:])}"
    if not best.served.any():
        return (f"No strategy that was tried serves any of the {many} poses. With {best.name!r}, {why}.",)
    told = [f"Take {best.name!r}: {_code(best)}", _served(best), _nearest(best), _whole(best, cusps), _speed(best)]
    told.append(_alternative(strategies, cusps))
    if not best.served.all():
        told += [f"It does not serve {int((~best.served).sum())} of {many} poses ({why}).", _part(part)]
    return tuple(filter(None, told))


def _code(best: RatedStrategy) -> str:
    """The line of code that makes it."""
    keys, job = best.keys, "in a job it is [strategies.advised], in Python"
    rule = {"lock": "hk.lock({})", "linear": "hk.linear({})"}.get(keys["kind"])
    if rule is None:
        return f"{job} advice.best.strategy, from the posture advice.q0."
    given = ", ".join(f'"{name}"' for name in keys["joints"]) if keys["kind"] == "lock" else str(keys["matrix"])
    return f"{job} hk.holonomic(task, {rule.format(given)}), from the posture advice.q0."


def _served(best: RatedStrategy) -> str:
    """What it serves of the workspace."""
    clear = ", and clear of what stands round and of itself" if np.isfinite(best.clearance) else ""
    poses = f"{int(best.served.sum())} of {len(best.served)} poses"
    return f"It serves {best.coverage:.1%} of the workspace within the joint limits{clear} ({poses})."


def _nearest(best: RatedStrategy) -> str:
    """Which joint and which two shapes are the closest, and how near it is to singular."""
    told = []
    if np.isfinite(best.margin):
        told.append(
            f"The joint nearest to a limit is {best.joint}, with {max(best.margin, 0.0):.1%} of its range left."
        )
    if best.closest is not None:
        told.append(f"At its nearest to anything, {best.closest}.")
    return " ".join(told)


def _whole(best: RatedStrategy, cusps: Mapping[str, NearbyCusps]) -> str:
    """Whether it is one function of the pose on the whole arm, or where the nearest cusp is."""
    if is_proven(best):
        return "Equal tool poses have equal joints on the whole arm: proven by the signs of its closed form."
    return f"It is not proven on the whole arm: {cusps[best.name].sentence}."


def _speed(best: RatedStrategy) -> str:
    """What it costs in joint speed against the least, in words."""
    if not np.isfinite(best.speed):
        return ""
    return f"It needs {more_speed(best.speed)} the least possible there (root mean square over the poses)."


def _alternative(strategies: Sequence[RatedStrategy], cusps: Mapping[str, NearbyCusps]) -> str:
    """What else could be taken, and when."""
    best, others = strategies[0], [s for s in strategies[1:] if s.served.any()]
    if not others:
        return ""
    proven = [s for s in others if is_proven(s)]
    faster = [s for s in others if alike(s, best) and s.squared_speed < (1 - SLOWER) * best.squared_speed]
    plain = [s for s in others if alike(s, best) and s.keys["kind"] != "designed"]
    if is_proven(best) and faster:
        other = min(faster, key=lambda s: s.squared_speed)
        when = "joint speed counts more than that proof"
    elif not is_proven(best) and proven:
        other, when = proven[0], "it has to be one function on the whole arm, which is proven of it"
    elif best.keys["kind"] == "designed" and plain:
        other, when = plain[0], "you prefer a rule without a polynomial"
    else:
        other, when = others[0], "the first does not suit you"
    facts = [f"serves {other.coverage:.1%}"]
    if best.clear > other.clear + EQUAL or best.clear == 1 > other.clear:
        nearest = "" if other.closest is None else f" ({other.closest} at its nearest)"
        facts.append(f"keeps well clear at {1 - other.clear / other.coverage:.0%} less of that{nearest}")
    elif best.easy > other.easy + EASY:
        facts.append(f"is near limits or singular postures at {1 - other.easy / other.coverage:.0%} of that")
    facts.append(f"needs {more_speed(float(np.sqrt(other.squared_speed / best.squared_speed)))} the first")
    return f"The alternative is {other.name!r}, if {when}: it {', '.join(facts[:-1])} and {facts[-1]}."


def _part(part: Part | None) -> str:
    """The largest part that it serves."""
    if part is None:
        return "No part round the centre was found that it serves from end to end."
    return f"Round the centre it serves all of a part of {part.share:.0%} of the sizes: {part.workspace.solid}."
