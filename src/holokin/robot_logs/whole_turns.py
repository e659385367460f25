"""Whole turns of hinges: many drivers write an angle modulo a turn, and a joint may pass a turn between two samples.

One rule for logs and datasets. From one sample to the next a hinge moves by the least change, modulo a turn, that leads
from one value to the other. This is sure where its speed limit allows no other change. Where it is not, and between the
episodes of a dataset, the joint limits may still tell the turn, since the values must lie within them. Otherwise the
turn is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..base.given_files import listed
from ..base.types import Array, Flags, Indices, Matrix, Vector
from ..motion.recording import Recording
from ..robot import Robot

TURN = 2 * np.pi

SLACK = 0.5
"""How far [rad or m] beyond its limits a joint may be logged before the unit is doubted: calibration never errs so."""

OVERSPEED = 1.2
"""Times its speed limit that a joint may move: controllers overshoot, and stamps are not exact."""

NOISE = 0.05
"""Change [rad] that the noise of two samples may add, and distance from joint limits at which values may lie."""

FASTEST_HINGE = 4 * np.pi
"""Speed [rad/s] of a hinge without a speed limit: the wrists of industrial arms reach 8 rad/s."""


def joined_turns(log: Recording, robot: Robot, *, counted: bool = False, breaks: Sequence[int] = ()) -> Recording:
    """A log whose hinges run on where it cuts them by whole turns, and lie within their limits where these tell a turn.

    Its `unknown_turns` are the steps in which a joint may have made whole turns that the log does not show.

    Args:
        counted: the values count whole turns, so they stay as they are.
        breaks: samples after which the time that passed is not known.
    """
    q, unknown, cut, moved = log.q, [], [], []
    steps = np.diff(log.t)
    steps[list(breaks)] = np.inf
    for i in np.flatnonzero(robot.hinges) if not counted else ():
        turns, open_ = _least_turns(log.q[:, i], _reach(robot, steps, i))
        low, high = log.q[:, i].min(), log.q[:, i].max()
        most, cuts = max(-low, high), turns[~open_].any()
        if most > 2 * TURN or (not cuts and (high - low > TURN + 2 * NOISE or most > TURN + NOISE)):
            continue  # no turn that drivers use holds the values: they count turns
        whole = np.concatenate([[0.0], np.cumsum(turns)])
        places = np.flatnonzero(open_)
        shift, sure = _into_limits(log.q[:, i] + TURN * whole, places + 1, robot.lower[i], robot.upper[i])
        unknown += [(k, i) for k in places[~(sure[:-1] & sure[1:])]]
        shift = np.repeat(shift, np.diff([0, *(places + 1), len(log.t)]))
        if not (whole.any() or shift.any()):
            continue
        q = q.copy() if q is log.q else q
        q[:, i] += TURN * (whole + shift)
        (cut if whole.any() else moved).append(robot.joint_names[i])
    notes = list(log.notes)
    if cut:
        notes.append(f"turns of {', '.join(cut)} joined, which the log cuts")
    if moved:
        notes.append(f"values of {', '.join(moved)} moved by whole turns into their limits")
    places = np.array(sorted(unknown), dtype=np.intp).reshape(-1, 2)
    return replace(log, q=q, notes=tuple(notes), unknown_turns=places)


def _reach(robot: Robot, steps: Vector | float, joint: int | slice) -> Array:
    """How far [rad] a hinge may move within times [s]."""
    speed = np.where(np.isfinite(robot.max_velocity), robot.max_velocity, FASTEST_HINGE)[joint]
    return OVERSPEED * speed * steps + NOISE


def _least_turns(values: Array, reach: Array) -> tuple[Array, Flags]:
    """(whole turns that make each change least, changes that may be others) along the first axis.

    A change may be another where the speed limit allows that too, or not even the least one, if that is over a quarter
    turn.
    """
    change = np.diff(values, axis=0)
    turns = -np.round(change / TURN)
    least = np.abs(change + TURN * turns)
    return turns, (TURN - least <= reach) | ((least > reach) & (least > np.pi / 2))


def _into_limits(values: Vector, begins: Indices, lower: float, upper: float) -> tuple[Vector, Flags]:
    """(whole turns (r,) by which each run of the values must move to lie within limits, whether these leave no other).

    Args:
        begins: where runs begin, but the first.
    """
    first = np.concatenate([[0], begins])
    if not np.isfinite([lower, upper]).any():
        return np.zeros(len(first)), np.zeros(len(first), bool)
    low, high = np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)
    least, most = np.ceil((lower - NOISE - low) / TURN), np.floor((upper + NOISE - high) / TURN)
    narrow = upper - lower < TURN - 2 * NOISE
    shift, sure, now = np.zeros(len(first)), least == most, 0.0
    for r in range(len(first)):
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
    turn = ((low >= -np.pi - NOISE) & (high <= np.pi + NOISE)) | ((low >= -NOISE) & (high <= TURN + NOISE))
    moves = np.where(robot.hinges & turn, TURN, 0.0) * np.array([[-1], [0], [1]])
    over = np.maximum(lower - low - moves, high + moves - upper).min(axis=0)
    return np.where(robot.hinges & turn & (high - low >= np.pi), np.minimum(over, 0.0), over)


def less_turns(change: Array, which: Flags) -> Array:
    """Changes (..., n) of joints, those of some less their whole turns."""
    return np.where(which, change - TURN * np.round(change / TURN), change)


class EpisodeTurns:
    """The joints of a dataset, a batch after the other, whose hinges run on within each episode.

    A hinge whose limits leave no other turn begins each episode there; others begin as they are stored. `low`, `high`
    (n,) are the extremes as stored, `cut` (n,) whether the values are surely modulo a turn, `loose` (n,) whether a turn
    may have passed between two frames.
    """

    def __init__(self, robot: Robot, fps: object) -> None:
        rate = float(fps) if isinstance(fps, int | float) and 0 < fps < 1e6 else np.inf
        self.robot, self.reach = robot, _reach(robot, 1 / rate, slice(None))
        self.narrow = robot.hinges & (robot.upper - robot.lower < TURN - 2 * NOISE)
        self.middle = np.where(self.narrow, robot.lower + robot.upper, 0.0) / 2
        self.low, self.high = np.full(robot.n, np.inf), np.full(robot.n, -np.inf)
        self.cut, self.loose = np.zeros(robot.n, bool), np.zeros(robot.n, bool)
        self.last: tuple[int, Vector, Vector] | None = None

    @property
    def unknown(self) -> Flags:
        """Hinges (n,) whose turns are not known from one episode to the next."""
        counts = (self.high - self.low > TURN + 2 * NOISE) & ~self.cut
        return self.robot.hinges & ~self.narrow & ~counts

    def joined(self, q: Matrix, episode: Indices) -> Matrix:
        """Postures (k, n) of the next rows."""
        before = self.last or (-1, q[0], np.zeros(self.robot.n))
        begins = np.flatnonzero(np.diff(episode, prepend=before[0]))
        turns, open_ = _least_turns(np.vstack([before[1], q]), self.reach)
        for part in (turns, open_):
            part[:, ~self.robot.hinges] = part[begins] = 0
        self.low, self.high = np.minimum(self.low, q.min(axis=0)), np.maximum(self.high, q.max(axis=0))
        self.loose |= open_.any(axis=0)
        self.cut |= ((turns != 0) & ~open_).any(axis=0)
        whole = np.cumsum(turns, axis=0)
        own = np.where(self.narrow, np.round((self.middle - q[begins]) / TURN), 0.0)
        base = np.vstack([before[2], own - whole[begins]])
        whole += base[np.searchsorted(begins, np.arange(len(q)), side="right")]
        self.last = int(episode[-1]), q[-1], whole[-1]
        return q + TURN * whole if whole.any() else q
