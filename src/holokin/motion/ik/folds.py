"""Folds: where a leaf ends, and the path with it; the same rules as fold.c.

Ahead of one the joints go like the square root of the share of the path that is left, so that 1 / |q'|^2 falls evenly,
and is 0 there: two rates tell where. Of a path that passes close by one, the place moves on by a quarter of what has
been gone (or by half, past a posture about which joints spin).

A path is given up where the place stands still until 4^-SURE of the share is left; the posture is then led on while
Newton's method converges, to 4^-CLOSER at least. It is a judgement, no proof: it refuses poses, and answers none.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

from ...base.types import Vector

SURE, CLOSER = 4, 7
STANDS, STILL = 0.25, 0.1
"""By what share of the way gone the place may move on, between pieces and close by."""

Solve = Callable[[Vector, float], Vector | None]
"""(where to begin, share of the path) -> the posture there, None where Newton's method does not contract."""


class Fold:
    """The place of a fold ahead on a path, as far as the joints' rates tell it."""

    def __init__(self) -> None:
        self.share, self.slack, self.at, self.first, self.agreed = 0.0, 0.0, 0.0, 0.0, 0

    def agrees(self, share: float, rate: Vector, most: float) -> bool:
        """Take in the joints' rate at a share: whether the fold that it shows has moved by at most so much of what was
        gone."""
        square = float(rate @ rate)
        slack = 1.0 / square if square > 0.0 else float("inf")
        gone, fall = share - self.share, self.slack - slack
        at = share + gone * (slack / fall) if fall != 0.0 else float("inf")
        agrees = fall > 0.0 and at > share and abs(at - self.at) <= most * gone
        self.share, self.slack, self.at = share, slack, at
        return agrees

    def ahead(
        self, q: Vector, share: float, middle: float, rate: Vector, solve: Solve, rate_at: Callable[..., Vector]
    ) -> Vector | None:
        """A posture close to a fold before the path's end; None where none is found.

        Args:
            q: the posture at a share of the path. middle, rate: of the piece that led there.
            rate_at: (posture, a share a little further on) -> the joint motion to there, to first order.
        """
        agrees = self.agrees(middle, rate, STANDS)
        self.agreed = self.agreed + 1 if agrees else 0
        if not agrees:
            self.first = self.slack
        if self.agreed < 2 or self.slack > 0.5 * self.first:
            return None
        if not (self.at > share and 2 * self.at - share < 1.0):
            return None
        near = copy(self)
        self.first = self.slack  # the next look, if any, where this has halved again
        for k in range(CLOSER + 1):  # to q at first, then to a quarter of the share left, by half of the motion
            left = near.at - share if k else 0.0
            share += 0.75 * left
            found = solve(q + left * rate if k else q, share)
            if found is None:
                return q if k > SURE else None
            q, ahead = found, 0.001 * (near.at - share)
            rate = rate_at(q, share + ahead) / ahead
            if k and not near.agrees(share, rate, STILL if k > 1 else STANDS):
                return None
            near.share, near.slack = share, 1.0 / float(rate @ rate)
        return q
