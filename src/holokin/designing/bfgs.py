"""Least cost over a few dozen numbers: BFGS with halved steps. [NW06]

A cost may end: where a posture is not found, it says None, and the step is halved. Library routines have no such
answer; their line searches make of an infinite cost steps that are no numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base.types import Matrix, Vector

FIRST = 0.1
"""Length of the first step."""

STEPS = 200
"""Steps at most; the designs of our tests take 10 to 60."""

HALVINGS = 25
"""Times that a step is halved before there is none: 2^-25 is the root of round-off."""

ENOUGH = 1e-9
"""Relative decrease below which two steps one after another are the last."""

Cost = Callable[[Vector, Any], "tuple[float, Vector, Any] | None"]
"""(x, state of a point nearby) -> (value, slope, state), or None where it is not defined."""


def descend(cost: Cost, x: Vector, state: Any) -> tuple[Vector, float, Any]:
    """(x, value, state) of a local least cost near x. The cost must be defined at x."""
    found = cost(x, state)
    if found is None:
        return x, np.inf, state
    value, slope, state = found
    inverse: Matrix = np.eye(len(x))
    fresh, small = True, 0
    for _ in range(STEPS):
        way: Vector = -inverse @ slope
        length = min(1.0, FIRST / float(np.linalg.norm(way) or 1.0)) if fresh else 1.0
        new = None
        for _ in range(HALVINGS):
            new = cost(x + length * way, state)
            if new is not None and new[0] <= value + 1e-4 * length * float(slope @ way):
                break
            length, new = length / 2, None
        if new is None:
            if fresh:
                break
            inverse, fresh = np.eye(len(x)), True
            continue
        move, turn = length * way, new[1] - slope
        small = small + 1 if value - new[0] <= ENOUGH * abs(value) else 0
        x, (value, slope, state) = x + move, new
        along = float(move @ turn)
        if along > 1e-10 * float(np.linalg.norm(move) * np.linalg.norm(turn)):
            if fresh:
                inverse = np.eye(len(x)) * along / float(turn @ turn)
            half: Matrix = np.eye(len(x)) - np.outer(move, turn) / along
            inverse, fresh = half @ inverse @ half.T + np.outer(move, move) / along, False
        if small >= 2:
            break
    return x, value, state
