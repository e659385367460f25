"""Does a recorded robot come home? What its joints do at equal poses of the tool, over the cycles of a log."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import ArgumentError, ShapeError
from ..recording import Recording
from ..robot import Robot
from ..task import Task, pose, position
from ..types import Array, Indices, Matrix, Vector
from .crossings import crossings
from .cycles import LENGTH_SCALE, Cycles, find_cycles
from .judge import Homecoming, first_limit, spread, to_pose
from .log_words import audit_rows, audit_sentence, not_tested
from .period import encoder_levels
from .trend import CONFIDENCE, FEWEST, DriftTrend, Trend, judge, quantile
from .visits import Visits, encoder_noise, spare_axes

TOLERANCE = 1e-3
"""Default distance [rad or m] of joints that counts as equal, on top of the noise floor: a millimetre at a metre's
reach, below which the backlash of usual gears hides everything. A drift of as much per cycle must be excluded before
the joints are called the same; a smaller one that is seen is a drift still, since it adds up."""

SPEEDS = 1.2
"""Cycles whose moving times differ by more than this factor count as fast and slow."""


@dataclass(frozen=True)
class Distance:
    """Largest joint distance at equal tool poses: `value` [rad or m] of `joint` at `phase` of the cycle (0 to 1),
    and how far it is over what is allowed there; `beyond` when it is."""

    value: float
    joint: str
    phase: float
    beyond: bool


@dataclass(frozen=True, eq=False)
class LogAudit:
    """Findings of `audit_recording`; `str` prints them, `summary` gives them as plain data.

    visits (c, P + 1, n): postures at equal tool poses, moved there through the pseudo-inverse from where the tool
    was; floor (P + 1,): joint move that this took, plus what encoder noise explains, per pose; drift (c, n) of each
    cycle; trends of the cycles of one direction and speed, judged at every pose; closing: of the drifts
    of single cycles where some run back and may undo the others'; scatters: joints differ between
    cycles by more than noise and tolerance, in no way that a trend explains; between: cycles of one direction; by_way:
    forward and backward passes; by_speed: fast and slow cycles; at_crossings: passes of a point where the path meets
    itself; None where the log does not test it.
    """

    robot: Robot
    recording: Recording
    task: Task
    cycles: Cycles
    tolerance: float
    visits: Array
    floor: Vector
    drift: Matrix
    trends: dict[str, DriftTrend]
    closing: Trend
    scatters: bool
    between: Distance
    by_way: Distance | None
    by_speed: Distance | None
    at_crossings: Distance | None
    verdict: Homecoming

    @property
    def exit_code(self) -> int:
        """0: comes home in all that the log tests; 1: it does not; 2: the log does not decide."""
        return {Homecoming.COMES_HOME: 0, Homecoming.UNDECIDED: 2}.get(self.verdict, 1)

    @property
    def noise_floor(self) -> float:
        """Joint distance at the cycles' ends that gaps of the tool and encoder noise explain [rad or m]."""
        return float(max(self.floor[0], self.floor[-1]))

    @property
    def largest(self) -> Vector:
        """Largest joint's drift of each cycle (c,) [rad or m]."""
        return np.abs(self.drift).max(axis=1)

    @property
    def worst_joint(self) -> str:
        """The joint with the largest drift of a cycle."""
        return self.robot.joint_names[int(np.unravel_index(np.argmax(np.abs(self.drift)), self.drift.shape)[1])]

    @property
    def since_start(self) -> Matrix:
        """Where the joints stand after each cycle, less where they stood before the first (c, n)."""
        ends = np.where((self.cycles.direction > 0)[:, None], self.visits[:, -1], self.visits[:, 0])
        begins = np.where((self.cycles.direction > 0)[:, None], self.visits[:, 0], self.visits[:, -1])
        return ends - begins[0]

    @property
    def one_way(self) -> bool:
        """Whether all cycles run in one direction."""
        return bool((self.cycles.direction == self.cycles.direction[0]).all())

    @property
    def leading(self) -> DriftTrend:
        """The trend that the verdict rests on: of those with the gravest finding, the one that changes most."""
        order = [Trend.ZERO, Trend.DECAYS, Trend.ALTERNATES, Trend.UNDECIDED, Trend.CONSTANT]
        return max(self.trends.values(), key=lambda t: (order.index(t.trend), t.change, t.detectable))

    @property
    def detectable(self) -> float:
        """Drift [rad or m a cycle] that the log would surely show, at every phase and in cycles of each kind."""
        return max(t.detectable for t in self.trends.values())

    @property
    def limit(self) -> tuple[str, float] | None:
        """(joint, cycles from the end of the log) of the first limit that a lasting drift reaches, or None."""
        found = self._limit
        return None if found is None else (found[0], found[1])

    @property
    def limit_range(self) -> tuple[float, float] | None:
        """Fewest and most cycles to the limit, by the interval of the drift."""
        found = self._limit
        return None if found is None else (found[2], found[3])

    @cached_property
    def _limit(self) -> tuple[str, float, float, float] | None:
        """Only where all cycles drift on: what runs both ways, alternates or fades is not extrapolated."""
        if not self.one_way:
            return None
        lasting = [trend for trend in self.trends.values() if trend.trend is Trend.CONSTANT]
        if not lasting or len(lasting) < len(self.trends):
            return None
        trend = lasting[0]
        rates = np.where(np.abs(trend.rates) > trend.errors, trend.rates, 0.0)
        lower, upper, q = self.robot.lower, self.robot.upper, self.visits[-1, : len(rates)]
        found = first_limit(lower, upper, q, rates)
        if found is None:
            return None
        joint, cycles = found
        soonest = first_limit(lower, upper, q, rates + np.sign(rates) * trend.errors)
        latest = first_limit(lower, upper, q, rates - np.sign(rates) * trend.errors)
        few = cycles if soonest is None else min(soonest[1], cycles)
        return self.robot.joint_names[joint], cycles, few, cycles if latest is None else max(latest[1], cycles)

    def __str__(self) -> str:
        return "\n".join([*(f"{name}: {value}" for name, value in self.rows()), self.sentence()])

    def sentence(self) -> str:
        """The verdict, what it rests on, and what the log does not test."""
        return audit_sentence(self)

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        return audit_rows(self)

    def summary(self) -> dict[str, Any]:
        """Everything found, as plain data for JSON (no NaN, no infinity)."""
        c, names, limit = self.cycles, list(self.robot.joint_names), self.limit
        return {
            "verdict": self.verdict.name,
            "sentence": self.sentence(),
            "log": self.recording.source,
            "notes": list(self.recording.notes),
            "robot": self.robot.name,
            "task": self.task.name,
            "joint_names": names,
            "tolerance": self.tolerance,
            "noise_floor": self.noise_floor,
            "tool_path_length_m": c.length,
            "tool_path_residual_m": c.residual.tolist(),
            "cycles_left_out": c.left_out,
            "cycles": [
                {"start_sample": float(a), "stop_sample": float(b), "direction": int(d), "duration_s": float(s),
                 "moving_s": float(m), "drift": drift.tolist()}
                for a, b, d, s, m, drift in zip(
                    c.start, c.stop, c.direction, c.duration, c.moving, self.drift, strict=True)
            ],
            "drift_since_start": self.since_start.tolist(),
            "worst_joint": self.worst_joint,
            "confidence": CONFIDENCE,
            "detectable_drift_per_cycle": self.detectable,
            "not_tested": not_tested(self),
            "trends": {
                name: {
                    "trend": t.trend.name,
                    "ratio": None if np.isnan(t.ratio) else t.ratio,
                    "ratio_range": None if np.isnan(t.ratio) else list(t.ratio_range),
                    "phase": float(c.phase[t.phase]),
                    "rate": t.rate.tolist(),
                    "rate_error": t.rate_error.tolist(),
                    "change": t.change,
                    "detectable_drift_per_cycle": t.detectable,
                    "of_it_by_shifts_of_the_tool": t.creep,
                    "cycles_needed": t.cycles_needed,
                    "remaining": [float(v) if np.isfinite(v) else None for v in t.remaining],
                }
                for name, t in self.trends.items()
            },
            "between_cycles": vars(self.between),
            "forward_and_back": None if self.by_way is None else vars(self.by_way),
            "fast_and_slow": None if self.by_speed is None else vars(self.by_speed),
            "at_crossings": None if self.at_crossings is None else vars(self.at_crossings),
            "limit": None if limit is None else {"joint": limit[0], "cycles": limit[1], "range": self.limit_range},
        }  # fmt: skip


def audit_recording(
    recording: Recording,
    robot: Robot,
    *,
    tip: str | None = None,
    orientation: bool | None = None,
    tolerance: float = TOLERANCE,
    length_scale: float = LENGTH_SCALE,
) -> LogAudit:
    """Judge the joints of a recording at equal poses of the tool.

    A verdict is given only where the log decides it at `trend.CONFIDENCE`, and is `Homecoming.UNDECIDED` elsewhere.

    Args:
        orientation: whether the tool's orientation belongs to its task; by default where the robot has joints to
            spare with it.
        tolerance: joint distance [rad or m], on top of the noise floor, that counts as equal, and drift [rad or m a
            cycle] that must be excluded before the joints are called the same.
        length_scale: [m/rad] of the distance of two poses, see `find_cycles`.

    Raises:
        RecordingError: fewer than two cycles. ArgumentError, ShapeError: a bad argument. UnknownNameError: no such tip.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ArgumentError("tolerance", tolerance, "give a positive number [rad or m]")
    if not (np.isfinite(length_scale) and length_scale > 0):
        raise ArgumentError("length_scale", length_scale, "give a positive number [m/rad]")
    if recording.q.shape[1] != robot.n:
        raise ShapeError("q of the recording", ("k", robot.n), recording.q.shape, "read it with the same robot")
    whole = robot.n > (3 if robot.planar else 6) if orientation is None else orientation
    task = pose(robot, tip=tip) if whole else position(robot, tip)
    cycles = find_cycles(recording, robot, tip=tip, orientation=whole, length_scale=length_scale)
    count, poses, n = cycles.q.shape
    place, turn = robot.pose_batch(cycles.q[0], tip)
    place[-1], turn[-1] = place[0], turn[0]
    flat, moved = to_pose(task, cycles.q.reshape(-1, n), np.tile(place, (count, 1)), np.tile(turn, (count, 1, 1)))
    visits = flat.reshape(count, poses, n)
    ways = [way for way in (1, -1) if (cycles.direction == way).any()]
    jacobian, _ = task.jacobian_batch(visits.mean(axis=0))
    axes = spare_axes(jacobian)
    weights = np.array([1.0 if unit == "m" else length_scale**2 for unit in task.units])
    noise, of_joints, of_moves = encoder_noise(
        jacobian, axes, np.gradient(cycles.q.mean(axis=0), axis=0), weights, encoder_levels(recording.q)
    )
    pairs = max(count * (count - 1) // 2, 1)
    widest = quantile((1 - CONFIDENCE) / (pairs * poses * axes.shape[2]), np.inf) * np.sqrt(2)
    floor = moved.reshape(count, poses).max(axis=0) + widest * of_joints.max(axis=1)
    floor[[0, -1]] = floor[[0, -1]].max()
    drift = (visits[:, -1] - visits[:, 0]) * cycles.direction[:, None]
    groups = _groups(cycles)

    def judged(members: Indices) -> DriftTrend:
        joints, at = visits[members, :-1], slice(0, -1)
        moves, when = joints - cycles.q[members, :-1], members
        if len(members) < FEWEST and members[-1] - members[0] < len(members):  # at home there is one visit more
            closed = np.vstack([np.zeros(n), np.cumsum(drift[members], axis=0)])
            joints, at = (visits[members[0], 0] + closed)[:, None], slice(0, 1)
            moves, when = np.zeros_like(joints), np.arange(len(members) + 1)
        kind = Visits(joints, axes[at], when.astype(float), moves, noise[at], of_moves[at])
        return judge(kind, tolerance, floor=float(floor[at].max()), share=1 / len(groups))

    trends = {name: judged(members) for name, members in groups.items()}
    if len(ways) == 1 and len(trends) > 1 and any(t.trend is Trend.UNDECIDED for t in trends.values()):
        together = judged(np.arange(count))  # a drift at all speeds shows in all cycles together
        trends = {"at all speeds": together} if together.trend is Trend.CONSTANT else trends
    allowed = tolerance + floor

    def distance(gap: Matrix, allowed: Vector = allowed, phase: Vector = cycles.phase) -> Distance:
        over = np.abs(gap).max(axis=1) - allowed
        at = int(np.argmax(over)) if over.max() > 0 else int(np.argmax(np.abs(gap).max(axis=1)))
        joint = int(np.argmax(np.abs(gap[at])))
        return Distance(float(abs(gap[at, joint])), robot.joint_names[joint], float(phase[at]), bool(over.max() > 0))

    between = distance(np.max([spread(visits[cycles.direction == way]) for way in ways], axis=0))
    by_way = by_speed = None
    if len(ways) == 2:
        by_way = distance(visits[cycles.direction > 0][-1] - visits[cycles.direction < 0][-1])
    elif cycles.mirror is not None:
        back = np.array([np.interp((2 * cycles.mirror - cycles.phase) % 1, cycles.phase, v) for v in cycles.q[-1].T]).T
        there, more = to_pose(task, back, place, turn)
        by_way = distance(there - visits[-1], allowed + more)
    speeds = {"fast": _speed(cycles) > 0, "slow": _speed(cycles) < 0}
    for way in ways:
        pair = [np.flatnonzero(fits & (cycles.direction == way)) for fits in speeds.values()]
        if all(len(members) for members in pair):
            found = distance(visits[pair[0][-1]] - visits[pair[1][-1]])
            by_speed = found if by_speed is None or found.value > by_speed.value else by_speed
    at_crossings = None
    first, second = crossings(cycles)
    if len(first):
        here, there = cycles.path.posture(first), cycles.path.posture(second)
        met, more = to_pose(task, there, *robot.pose_batch(here, tip))
        phase = np.interp(first, *_rising(cycles.s[-1], cycles.phase))
        at_crossings = distance(met - here, tolerance + more + widest * of_joints.max(), phase)
    closing = _closing(drift, cycles, tolerance + float(floor[0])) if len(ways) == 2 else Trend.ZERO
    kinds = {closing, *(trend.trend for trend in trends.values())}
    scatters = between.beyond and kinds == {Trend.ZERO}
    if Trend.CONSTANT in kinds:
        verdict = Homecoming.DRIFTS
    elif Trend.UNDECIDED in kinds or scatters:
        verdict = Homecoming.UNDECIDED
    elif Trend.ALTERNATES in kinds:
        verdict = Homecoming.ALTERNATES
    elif Trend.DECAYS in kinds or any(d is not None and d.beyond for d in (by_way, by_speed, at_crossings)):
        verdict = Homecoming.CONVERGES
    else:
        verdict = Homecoming.COMES_HOME
    return LogAudit(
        robot,
        recording,
        task,
        cycles,
        tolerance,
        visits,
        floor,
        drift,
        trends,
        closing,
        scatters,
        between,
        by_way,
        by_speed,
        at_crossings,
        verdict,
    )


def _rising(x: Vector, y: Vector) -> tuple[Vector, Vector]:
    return (x, y) if x[-1] > x[0] else (x[::-1], y[::-1])


def _speed(cycles: Cycles) -> Vector:
    """1 for fast cycles, -1 for slow ones, by moving time; 0 for all when they differ by no more than `SPEEDS`."""
    time = cycles.moving
    if time.max() <= SPEEDS * time.min():
        return np.zeros(len(time))
    return np.where(time < np.sqrt(time.max() * time.min()), 1.0, -1.0)


def _closing(drift: Matrix, cycles: Cycles, allowed: float) -> Trend:
    """Whether cycles of one direction leave the joints elsewhere, each by itself: still at the end, or no more."""
    found = Trend.ZERO
    for way in (1, -1):
        mine = drift[cycles.direction == way]
        if np.abs(mine[len(mine) // 2 :].mean(axis=0)).max() > allowed:
            return Trend.CONSTANT
        if np.abs(mine).max() > allowed:
            found = Trend.DECAYS
    return found


def _groups(cycles: Cycles) -> dict[str, Indices]:
    """Cycles of one direction and speed, whose drifts can follow one law; groups of one cycle only if all are so."""
    groups = {}
    for way, name in ((1, "forward"), (-1, "backward")):
        mine = cycles.direction == way
        parts = {f"{name}{tail}": np.flatnonzero(mine & (_speed(cycles) == speed))
                 for speed, tail in ((0, ""), (1, ", fast"), (-1, ", slow"))}  # fmt: skip
        several = {key: members for key, members in parts.items() if len(members) > 1}
        if several:
            groups |= several
        elif mine.any():
            groups[name] = np.flatnonzero(mine)
    return groups
