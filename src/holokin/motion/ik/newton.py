"""Newton's method from many postures at once; on one leaf, from one posture: `newton_on_leaf` of `leaf`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.types import Flags, Indices, Matrix

Correct = Callable[[Matrix, Indices], tuple[Matrix, Flags]]
"""(postures (k, n), which of the first ones they are (k,)) -> (corrections (k, n), which of these are sound (k,))."""


def newton(
    correct: Correct, q: Matrix, *, steps: int, exact: float, longest: float = np.inf, contraction: float = np.inf
) -> tuple[Matrix, Flags]:
    """(postures (k, n), whether Newton's method got there (k,)) from others (k, n).

    Each goes on by itself, until its correction is sound and at most `exact` [joint units], or until one is not sound.

    Args:
        longest: joint motion of one step; a longer one is shortened, since slopes mean nothing so far away.
        contraction: a correction above this share of the last one, and above `exact`, is not sound: a step that must
            stay on its branch begins where Newton's method contracts.
    """
    q, arrived, going = q.copy(), np.zeros(len(q), dtype=bool), np.arange(len(q))
    last = np.full(len(q), np.inf)
    for _ in range(steps):
        if not len(going):
            break
        dq, sound = correct(q[going], going)
        size = np.abs(dq).max(axis=1)
        sound = sound & np.isfinite(size) & (size <= np.maximum(contraction * last[going], exact))
        going, dq, size = going[sound], dq[sound], size[sound]
        last[going] = size
        q[going] += np.minimum(1.0, longest / np.maximum(size, 1e-300))[:, None] * dq
        arrived[going] = size <= exact
        going = going[size > exact]
    return q, arrived
