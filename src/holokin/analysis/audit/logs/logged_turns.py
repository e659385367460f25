"""Whole turns of hinges: many drivers write an angle modulo a turn, and a joint may pass a turn between two samples.

One rule for logs and datasets. From one sample to the next a hinge moves by the least change, modulo a turn, that leads
from one value to the other. This is sure where its speed limit allows no other change. Where it is not, and between the
episodes of a dataset, the joint limits may still tell the turn, since the values must lie within them. Otherwise the
turn is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.types import Array, Flags, Indices, Vector
from ....motion.recording import Recording
from ....robot import Robot

TURN = 2 * np.pi

Rows = NDArray[np.integer[Any]]
Numbers = NDArray[np.floating[Any]]
"""In any precision: datasets are long."""

SLACK = 0.5
"""How far [rad or m] beyond its limits a joint may be logged before the unit is doubted: calibration never errs so."""

OVERSPEED = 1.2
"""Times its speed limit that a joint may move: controllers overshoot, and stamps are not exact."""

NOISE = 0.05
"""Change [rad] that the noise of two samples may add, and distance from joint limits at which values may lie."""

BLOCK = 50_000
"""Samples whose changes are in memory at one time."""

FASTEST_HINGE = 4 * np.pi
"""Speed [rad/s] of a hinge without a speed limit: the wrists of industrial arms reach 8 rad/s."""


@dataclass(frozen=True, eq=False)
class HingeTurns:
    """Whole turns of one hinge: `turns` (k,) [rad] to add to its values, which then run on; None where there are none.

    begins (r,): runs of samples in which no turn is missed; known (r,): whether its limits, or values that count turns,
    leave no other turn of the run; cut: whether the values are cut, and not only moved into the limits.
    """

    turns: Numbers | None
    begins: Indices
    known: Flags
    cut: bool

    def runs_apart(self, first: Rows, second: Rows) -> Flags:
        """Whether two samples (p,), (p,) are of different runs."""
        return np.not_equal(*(np.searchsorted(self.begins, rows, side="right") for rows in (first, second)))

    def apart(self, first: Rows, second: Rows) -> Flags:
        """Whether the joint may have made unknown turns between two samples (p,), (p,)."""
        known = [self.known[np.searchsorted(self.begins, rows, side="right") - 1] for rows in (first, second)]
        return self.runs_apart(first, second) & ~(known[0] & known[1])


def hinge_turns(values: Numbers, steps: Numbers, robot: Robot, joint: int) -> HingeTurns:
    """Whole turns of the hinge `joint` with values (k,), whose samples are `steps` (k - 1,) [s] apart; inf: unknown."""
    speed = robot.max_velocity[joint] if np.isfinite(robot.max_velocity[joint]) else FASTEST_HINGE
    low, high = float(values.min()), float(values.max())
    turns, other = _least_turns(values, steps, speed)
    begins = np.concatenate([[0], np.flatnonzero(other) + 1])
    cut, most = bool(turns[~other].any()), max(-low, high)
    if most > 2 * TURN or (not cut and (high - low > TURN + 2 * NOISE or most > TURN + NOISE)):
        # no interval of a turn that drivers use holds the values: they count turns
        return HingeTurns(None, begins, np.ones(len(begins), bool), False)
    whole, joined = np.zeros(0, values.dtype), values
    if cut or turns.any():
        whole = np.zeros_like(values)
        np.cumsum(turns, out=whole[1:])
        whole *= TURN
        joined = values + whole
    least, greatest = np.minimum.reduceat(joined, begins), np.maximum.reduceat(joined, begins)
    moves, known = _into_limits(least, greatest, robot.lower[joint], robot.upper[joint])
    if moves.any():
        whole = whole if len(whole) else np.zeros_like(values)
        for first, last, move in zip(begins, [*begins[1:], len(values)], TURN * moves, strict=True):
            whole[first:last] += move
    return HingeTurns(whole if len(whole) else None, begins, known, bool(turns.any()))


def _least_turns(values: Numbers, steps: Numbers, speed: float) -> tuple[Rows, Flags]:
    """(whole turns (k - 1,) that make each change of the values (k,) least, whether it may be another one).

    It may where the speed limit allows that, or does not even allow the least, if that is over a quarter turn.
    """
    turns, other = np.zeros(len(steps), np.int32), np.zeros(len(steps), bool)
    for i in range(0, len(steps), BLOCK):  # a dataset has a million
        change = np.diff(values[i : i + BLOCK + 1])
        reach = OVERSPEED * speed * steps[i : i + BLOCK] + NOISE
        least = np.abs(change)
        if least.max() > np.pi:
            turn = np.round(change / -TURN)
            turns[i : i + BLOCK] = turn
            least = np.abs(change + TURN * turn)
        other[i : i + BLOCK] = (TURN - least <= reach) | ((least > reach) & (least > np.pi / 2))
    return turns, other


def joined_turns(log: Recording, robot: Robot, *, counted: bool = False, breaks: Sequence[int] = ()) -> Recording:
    """A log whose hinges run on where it cuts them by whole turns, and lie within their limits where these tell a turn.

    Its `unknown_turns` are the steps in which a joint may have made whole turns that the log does not show.

    Args:
        counted: the values count whole turns, so they stay as they are.
        breaks: samples after which the time that passed is not known.
    """
    q, unknown = log.q, []
    cut: list[str] = []
    moved: list[str] = []
    steps = np.diff(log.t)
    steps[list(breaks)] = np.inf
    for i in np.flatnonzero(robot.hinges).tolist() if not counted else ():
        found = hinge_turns(log.q[:, i], steps, robot, i)
        before = found.begins[1:] - 1
        unknown += [(k, i) for k in before[found.apart(before, before + 1)]]
        if found.turns is not None:
            q = q.copy() if q is log.q else q
            q[:, i] += found.turns
            (cut if found.cut else moved).append(robot.joint_names[i])
    notes = (*log.notes, *turns_notes(cut, moved, "log"))
    return replace(log, q=q, notes=notes, unknown_turns=np.array(sorted(unknown), dtype=np.intp).reshape(-1, 2))


def turns_notes(cut: Sequence[str], moved: Sequence[str], what: str) -> list[str]:
    """What was done to the joints that are cut, and to those that were only moved."""
    notes = [f"turns of {', '.join(cut)} joined, which the {what} cuts"] if cut else []
    return notes + ([f"values of {', '.join(moved)} moved by whole turns into their limits"] if moved else [])


def _into_limits(low: Numbers, high: Numbers, lower: float, upper: float) -> tuple[Vector, Flags]:
    """(whole turns (r,) by which runs of values from `low` to `high` (r,) must move to lie within limits, whether these
    leave no other)."""
    if not np.isfinite([lower, upper]).any():
        return np.zeros(len(low)), np.zeros(len(low), bool)
    least, most = np.ceil((lower - NOISE - low) / TURN), np.floor((upper + NOISE - high) / TURN)
    narrow = upper - lower < TURN - 2 * NOISE
    shift, sure, now = np.zeros(len(low)), least == most, 0.0
    for r in range(len(low)):
        if least[r] <= most[r]:
            now = float(np.clip(now, least[r], most[r]))
        else:  # it lies beyond them whatever the turn
            middle = np.round((lower + upper - low[r] - high[r]) / 2 / TURN)
            over = [max(lower - low[r] - TURN * c, high[r] + TURN * c - upper) for c in (middle, now)]
            now = float(middle) if over[0] < min(over[1] - NOISE, SLACK) else now
            sure[r] = narrow
        shift[r] = now
    return shift, sure


def outside(robot: Robot, low: Vector, high: Vector) -> Vector:
    """How far [rad or m] joints (n,) between `low` and `high` are over `SLACK` beyond their limits.

    Values of a hinge that lie within one turn may be modulo a turn: they are looked at in the turn that fits best, and
    those that fill half a turn or more, which may be cut, fit always.
    """
    lower = np.where(np.isfinite(robot.lower), robot.lower, -4 * np.pi) - SLACK
    upper = np.where(np.isfinite(robot.upper), robot.upper, 4 * np.pi) + SLACK
    turn = (high - low <= TURN + NOISE) & (np.maximum(-low, high) <= TURN + NOISE)
    moves = np.where(robot.hinges & turn, TURN, 0.0) * np.array([[-1], [0], [1]])
    over = np.maximum(lower - low - moves, high + moves - upper).min(axis=0)
    return np.where(robot.hinges & turn & (high - low >= np.pi), np.minimum(over, 0.0), over)


def less_turns(change: Array, which: Flags) -> Array:
    """Changes (..., n) of joints, those of some less their whole turns."""
    return np.where(which, change - TURN * np.round(change / TURN), change)
