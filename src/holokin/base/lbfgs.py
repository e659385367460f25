"""L-BFGS on one core: SciPy's takes as many as there are, waits for them longer than it computes, and its last bits,
and so what it finds, depend on their number."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .types import Vector

STEPS, GAIN = 60, 1e-5
"""The most steps, and the share of the loss that a step gains at which they end."""

SEARCHED = 20
"""The most lengths that are tried for a step."""


def minimizer(loss: Callable[[Vector], tuple[float, Vector]], x: Vector, gain: float = GAIN) -> Vector:
    """Where a loss is lowest near x (t,), which is given with its gradient: by L-BFGS [NW06, section 7.2].

    Args:
        gain: share of the loss below which what a step gains ends the search.
    """
    value, slope = loss(x)
    pairs: list[tuple[Vector, Vector, float]] = []
    for _ in range(STEPS):
        # The direction, by the last steps and how slopes changed over them.
        direction, shares = -slope, []
        for move, change, product in reversed(pairs):
            shares.append(float(move @ direction) / product)
            direction = direction - shares[-1] * change
        if pairs:
            move, change, product = pairs[-1]
            direction = direction * product / float(change @ change)
        else:
            direction = direction * min(1.0, 1 / max(float(np.abs(slope).sum()), 1e-12))
        for (move, change, product), share in zip(pairs, reversed(shares), strict=True):
            direction = direction + (share - float(change @ direction) / product) * move
        # A step that leads down enough, and over which the slope rises enough.
        descent, low, high, step = float(slope @ direction), 0.0, np.inf, 1.0
        reached, ahead = loss(x + direction)
        for _ in range(SEARCHED):
            if not reached <= value + 1e-4 * step * descent:
                high = step
            elif float(ahead @ direction) < 0.9 * descent:
                low = step
            else:
                break
            step = 0.5 * (low + high) if np.isfinite(high) else 2 * step
            reached, ahead = loss(x + step * direction)
        if not reached < value:
            break
        move, change = step * direction, ahead - slope
        if (product := float(move @ change)) > 0:
            pairs = [*pairs[-9:], (move, change, product)]
        x, slope, gained, value = x + move, ahead, value - reached, reached
        if gained < gain * abs(value):
            break
    return x
