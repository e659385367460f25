"""Logs as they come: several files as one log, and one log as several runs, at clock resets and idle phases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ....base.arguments import typed
from ....base.axis_counts import AxisCounts
from ....base.errors import ArgumentError, RecordingError
from ....base.types import Matrix, Vector, positive
from ....motion.recording import GAP, Recording
from ....robot import Robot
from .joint_columns import Columns
from .log_formats import joined, recorded, samples_of
from .log_samples import Samples

IDLE = 5.0
"""Rest [s] from which on a log is cut there: longer than the dwells of a process, shorter than most pauses between
runs."""

STILL = 1e-3
"""How far [rad or m] joints may move within a fourth of that and still rest: noise, brakes, a servo that hunts."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """A recording whose clock runs on, with the stamp from which its times count."""

    log: Recording
    origin: float

    @property
    def ends(self) -> tuple[float, float]:
        """First and last time of its clock [s]."""
        return self.origin + float(self.log.t[0]), self.origin + float(self.log.t[-1])


@typed
def read_runs(
    paths: Sequence[str | Path], robot: Robot, *, split: bool = False, idle: float = IDLE, degrees: bool | None = None,
    topic: str | None = None, columns: Columns | None = None, time: str | None = None, skip_bad: bool = False,
    counts_turns: bool = False, signs: Mapping[str, int] | None = None, offsets: Mapping[str, float] | None = None,
    scales: Mapping[str, float] | None = None,
) -> tuple[Recording, ...]:  # fmt: skip
    """Read files as one log; with `split` as several runs.

    Files are taken in the order given. Where the stamps of one go on after those of the one before, the time between
    them is kept; where its clock begins anew it is put behind, with a gap in time, so that no cycle spans the join.

    Args:
        split: cut where the clock is set back and where all joints rest for `idle` [s]; each part is a run.
        degrees, topic, columns, time, skip_bad, counts_turns, signs, offsets, scales: as of `read_recording`.

    Raises:
        ArgumentError: no file, a rest that is not positive. RecordingError: as `read_recording`; nothing moves.
    """
    positive("idle", idle, "give a positive number of seconds")
    if not paths:
        raise ArgumentError("the files of a log", list(paths), "give at least one")
    counts = AxisCounts(signs or {}, offsets or {}, scales or {}).known(robot.joint_names)
    pieces: list[_Piece] = []
    for path in map(Path, paths):
        samples = samples_of(path, robot, topic, columns, time, skip_bad)
        for part in _by_clock(samples) if split else [samples]:
            if len(part.t) > 1:
                pieces.append(_Piece(recorded(path, part, robot, degrees, counts), samples.origin))
    if not pieces:
        raise RecordingError(paths[0], "holds no two samples of one clock", "log at least two cycles")
    logs = _joined(pieces, robot, anew=not split, counts_turns=counts_turns)
    if not split:
        return logs
    found = tuple(part for log in logs for part in _without_rests(log, idle))
    if not found:
        raise RecordingError(paths[0], "all joints rest", "log a motion of the arm, or leave out --split")
    return tuple(replace(part, source=f"{part.source}, run {k} of {len(found)}") for k, part in enumerate(found, 1))


def _by_clock(samples: Samples) -> list[Samples]:
    """The samples cut where the time is set back."""
    cuts = [0, *(np.flatnonzero(np.diff(samples.t) < 0) + 1), len(samples.t)]
    return [samples.some(int(a), int(b)) for a, b in pairwise(cuts)]


def _joined(pieces: Sequence[_Piece], robot: Robot, *, anew: bool, counts_turns: bool) -> tuple[Recording, ...]:
    """Pieces put together as long as their clock goes on; with `anew` all, a gap before each whose clock does not."""
    found: list[list[_Piece]] = []
    breaks: list[list[int]] = []  # samples after which the clock begins anew
    notes: list[str] = []
    for piece in pieces:
        before = found[-1][-1] if found else None
        if before is not None and piece.ends[0] > before.ends[1]:
            found[-1].append(piece)
        elif before is not None and anew:
            wait = 2 * GAP / min(piece.log.rate, before.log.rate)
            shift = before.ends[1] + wait - piece.ends[0]
            breaks[-1].append(sum(len(one.log) for one in found[-1]) - 1)
            found[-1].append(_Piece(piece.log, piece.origin + shift))
            notes.append(f"the clock of {Path(piece.log.source).name} begins anew: put behind, with a gap")
        else:
            found.append([piece])
            breaks.append([])
    logs = (_one(group, notes) for group in found)
    return tuple(joined(log, robot, counts_turns, at) for log, at in zip(logs, breaks, strict=True))


def _one(group: Sequence[_Piece], notes: Sequence[str]) -> Recording:
    """One recording of pieces whose times rise."""
    if len(group) == 1:
        return group[0].log
    origin = group[0].origin
    t: Vector = np.concatenate([piece.log.t + (piece.origin - origin) for piece in group])
    q: Matrix = np.vstack([piece.log.q for piece in group])
    names = dict.fromkeys(piece.log.source for piece in group)
    said = [note for piece in group for note in piece.log.notes] + list(notes)
    source = f"{len(names)} files, {Path(next(iter(names))).name} to {Path(next(reversed(names))).name}"
    return Recording(group[0].log.joint_names, t, q, source if len(names) > 1 else next(iter(names)), tuple(said))


def _without_rests(log: Recording, idle: float) -> list[Recording]:
    """The parts of a log between rests of at least `idle` [s]; those too short to move are left out."""
    block = np.floor((log.t - log.t[0]) / (idle / 4)).astype(int)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    low, high = np.minimum.reduceat(log.q, first), np.maximum.reduceat(log.q, first)
    still = ((high - low) <= STILL).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int))).reshape(-1, 2)
    stop = np.append(first, len(log.t))
    rests = [(stop[a], stop[b] - 1) for a, b in edges if log.t[stop[b] - 1] - log.t[stop[a]] >= idle * 3 / 4]
    begins = [0, *(int(b) for _, b in rests)]
    ends = [*(int(a) for a, _ in rests), len(log.t) - 1]
    found = []
    for a, b in zip(begins, ends, strict=True):
        if b > a + 1 and float(np.ptp(log.q[a : b + 1], axis=0).max()) > STILL:
            said = f"from {log.t[a]:.4g} to {log.t[b]:.4g} s"
            found.append(replace(log.part(a, b + 1), notes=(*log.notes, said)))
    return found
