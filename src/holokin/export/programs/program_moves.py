"""Which samples of a timed motion become targets of a program, and by which moves the controller goes between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.types import Indices
from ...motion import TimedTrajectory
from .controller_moves import KINDS, Kind, ToolDeviation, ToolMotion, ToolTolerance
from .finer_motion import FINER

LOOKS = 33
"""Instants of a move that are looked at while it is made longer; all are, before it is taken."""

TRIED: tuple[Kind, ...] = ("linear", "circular", "joint")
"""Of moves that lead equally far the first of these is taken."""

SHORTEST = 1e-4
"""Way of a tool [m] below which no linear move is made of it: it turns in place, and has no speed in m/s."""


@dataclass(frozen=True)
class Move:
    """From sample a to sample b; a circular one by way of sample `via`.

    `length` [m] is the tool's way, and `speed` [m/s] its speed on linear and circular moves: NaN where nobody asked.
    """

    kind: Kind
    a: int
    b: int
    via: int = -1
    speed: float = float("nan")
    length: float = float("nan")


def farthest(fits: Callable[[int], bool], here: int, end: int) -> int:
    """The last sample up to `end` that fits, by doubling and halving; the next one always does."""
    good, bad, step = here + 1, end + 1, 1
    while good + step < bad:
        if fits(good + step):
            good, step = good + step, 2 * step
        else:
            bad = good + step
            break
    while good < end and bad - good > 1:
        middle = min((good + bad) // 2, end)
        good, bad = (middle, bad) if fits(middle) else (good, middle)
    return good


def fixed_samples(timed: TimedTrajectory, more: Indices | tuple[int, ...] = ()) -> list[int]:
    """Samples that are targets in any case: the start, the end, corners, and where cycles begin."""
    return sorted({0, *timed.marks, *timed.stops, *map(int, more), len(timed) - 1})


def tool_moves(
    timed: TimedTrajectory,
    tolerance: ToolTolerance,
    own: Indices,
    more: tuple[int, ...] = (),
    kinds: tuple[Kind, ...] = KINDS,
) -> tuple[list[Move], ToolDeviation]:
    """The moves that keep a tool within its tolerance, each as long as may be, and how far they are from the motion.

    Args:
        own: the joints (a,) that the controller's own inverse moves.
        more: samples that must be targets too.
        kinds: the moves that the language has.

    Where two samples that follow each other are not within the tolerance, the move between them is a joint move all
    the same: there is none shorter.
    """
    motion = ToolMotion.of(timed, tolerance, own)
    tried: list[Kind] = [kind for kind in TRIED if kind == "joint" or (tolerance.linear and kind in kinds)]
    moves: list[Move] = []
    largest = ToolDeviation()
    for end in fixed_samples(timed, more)[1:]:
        while (here := moves[-1].b if moves else 0) < end:
            allowed = tried if here >= timed.begin else tried[-1:]  # an entry is the joints' own way
            ends = {kind: _end(motion, tolerance, kind, here, end) for kind in allowed}
            kind = max(allowed, key=ends.__getitem__)  # of equal ones the first
            kind = kind if ends[kind] > here + 1 else "joint"
            moves.append(_move(motion, kind, here, ends[kind]))
            largest |= measured(motion, kind, here, ends[kind])
    share = float(motion.has_speed.mean())
    return moves, replace(largest, compared=share, kept=largest.within(tolerance))


def _move(motion: ToolMotion, kind: Kind, a: int, b: int) -> Move:
    first, last = FINER * a, FINER * b
    length = float(motion.way[last] - motion.way[first])
    if kind == "joint":
        return Move(kind, a, b, length=length)
    via = motion.middle(first, last) // FINER if kind == "circular" else -1
    return Move(kind, a, b, via, motion.steady(first, last), length)


def measured(motion: ToolMotion, kind: Kind, a: int, b: int, looks: int | None = None) -> ToolDeviation:
    """How far a move from sample a to sample b is from the motion, with its joints, at some instants or all."""
    first, last, rows = _instants(a, b, looks)
    found = motion.deviation(kind, first, last, rows)
    return found | ToolDeviation(joints=motion.joint_deviation(kind, first, last, rows))


def _instants(a: int, b: int, looks: int | None) -> tuple[int, int, Indices]:
    """The instants of sample a and of sample b, and some of those from one to the other, or all."""
    first, last = FINER * a, FINER * b
    return first, last, np.unique(np.linspace(first, last, looks or last - first + 1).astype(int))


def _end(motion: ToolMotion, tolerance: ToolTolerance, kind: Kind, here: int, end: int) -> int:
    """The last sample to which one move of a kind keeps the tolerance; the next one if none does."""

    def kept(b: int, looks: int | None = None) -> bool:
        first, last, rows = _instants(here, b, looks)
        if not motion.deviation(kind, first, last, rows).within(tolerance):
            return False
        if motion.load(kind, first, last, rows) > 1.0 + tolerance.speed:
            return False
        return motion.joint_deviation(kind, first, last, rows) <= tolerance.joints

    found = farthest(lambda b: kept(b, LOOKS), here, end)
    while found > here + 1 and not kept(found):
        found = here + max(1, (found - here) * 7 // 8)
    moved = np.ptp(motion.p[FINER * here : FINER * found + 1], axis=0).max()
    return found if kind == "joint" or moved > SHORTEST else here + 1
