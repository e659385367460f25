"""Why a posture is no one to begin from: what it is away from the leaf, from its branch and from the joint limits."""

from __future__ import annotations

import numpy as np

from ..errors import ArgumentError, HolokinError, posture_text
from ..tolerances import TOLERANCES
from ..types import Vector
from .edge import Edge
from .leaf import leaf_step, leaf_value

OFF = 1e-6
"""Distance from the leaf that is worth a word: round-off of an answer is a thousandth of it."""

BEGIN = "give the last answer, or leave it out"


def no_beginning(edge: Edge, q: Vector) -> ArgumentError:
    """What is wrong with a posture q (n,) from which no way along the edge was found."""
    facts = [*_off_leaf(edge, q), *_beyond(edge, q)]
    if not facts:
        facts = ["no way from it could be shown to keep to the branch of the leaf"]
    return ArgumentError("the posture to begin from", np.round(q, 6).tolist(), f"{', and '.join(facts)}; {BEGIN}")


def _off_leaf(edge: Edge, q: Vector) -> list[str]:
    """How far it is off the leaf, and whether on another branch; or that there is no leaf."""
    strategy = edge.strategy
    try:
        level = leaf_value(strategy, q)
    except HolokinError as problem:  # a rule that has no value there
        return [str(problem)]
    _, rcond, margin, side = leaf_step(strategy)(q, *edge.tool(q), edge.leaf)
    if not (rcond > TOLERANCES.singular and margin > TOLERANCES.representation):
        return [f"the law is singular there (rcond {float(rcond):.2g})"]
    said, gap = [], np.abs(strategy.constraint.nearest(edge.leaf - level)) if len(level) else np.zeros(1)
    if gap.max() > OFF:
        levels = f"g(q) = {posture_text(level)}, the leaf is {posture_text(edge.leaf)}"
        said.append(f"it is {gap.max():.3g} off the leaf of {strategy.name!r}: {levels}")
    if side != edge.side:
        said.append(f"it is on another branch of {strategy.name!r} than the start")
    return said


def _beyond(edge: Edge, q: Vector) -> list[str]:
    """Joints beyond the limits that the edge keeps to."""
    found = []
    for name, value, lower, upper in zip(edge.strategy.task.robot.joint_names, q, edge.lower, edge.upper, strict=True):
        if value < lower or value > upper:
            side, limit = ("lower", lower) if value < lower else ("upper", upper)
            found.append(f"{name} is {abs(value - limit):.3g} past its {side} limit {limit:.6g}")
    return found
