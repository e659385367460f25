"""Does a recorded robot come home? What its joints do at equal poses of the tool, over the cycles of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ArgumentError, ShapeError
from ..recording import Recording
from ..robot import Robot
from ..task import Task, pose, position
from ..types import Array, Indices, Matrix, Vector
from .crossings import crossings
from .cycles import LENGTH_SCALE, Cycles, find_cycles
from .judge import DriftTrend, Homecoming, Trend, drift_trend, first_limit, spread, to_pose
from .period import noise_level

TOLERANCE = 1e-3
"""Default distance [rad or m] of joints that counts as equal, on top of the noise floor: a millimetre at a metre's
reach, below which the backlash of usual gears hides everything."""

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
    was; floor (P + 1,): joint move that this took, plus four levels of encoder noise, per pose; drift (c, n) of each
    cycle; trends of the cycles of one direction and speed; between: cycles of one direction; by_way: forward and
    backward passes; by_speed: fast and slow cycles; at_crossings: passes of a point where the path meets itself;
    None where the log does not test it.
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
    between: Distance
    by_way: Distance | None
    by_speed: Distance | None
    at_crossings: Distance | None
    verdict: Homecoming

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
    def limit(self) -> tuple[str, float] | None:
        """(joint, cycles from the end of the log) of the first limit that a lasting drift reaches, or None."""
        groups = _groups(self.cycles)
        for name, trend in self.trends.items():
            members = groups[name]
            if trend.trend is Trend.CONSTANT and len(members) > 1:
                last, earlier = members[-1], members[-1 - max(1, len(members) // 4)]
                rate = (self.visits[last] - self.visits[earlier]) / (last - earlier)
                seen = np.where(np.abs(rate) > (self.tolerance + self.noise_floor) / (last - earlier), rate, 0.0)
                found = first_limit(self.robot.lower, self.robot.upper, self.visits[-1], seen)
                if found is not None:
                    return self.robot.joint_names[found[0]], found[1]
        return None

    def __str__(self) -> str:
        return "\n".join([*(f"{name}: {value}" for name, value in self.rows()), self.sentence()])

    def sentence(self) -> str:
        """The verdict with its reason, in one sentence."""
        settled = [t for t in self.trends.values() if t.trend is Trend.DECAYS]
        if self.verdict is Homecoming.COMES_HOME:
            tail = f" ({self.between.value:.2g} rad or m apart in {len(self.cycles)} cycles)"
        elif self.verdict is Homecoming.DRIFTS:
            limit = self.limit
            tail = f", by {self.largest.max():.3g} in a cycle ({self.worst_joint})"
            if limit is not None:
                tail += f"; at this rate {limit[0]} is at its limit after {limit[1]:.0f} more"
        elif settled:
            tail = f"; each cycle drifts {settled[0].ratio:.2g} times as far as the one before"
        else:
            found = [
                d for d in (self.between, self.by_way, self.by_speed, self.at_crossings) if d is not None and d.beyond
            ]
            worst = max(found, key=lambda d: d.value)
            tail = f", by up to {worst.value:.3g} ({worst.joint})"
        return self.verdict.value + tail

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        c, last = self.cycles, self.since_start[-1]
        forward = int((c.direction > 0).sum())
        joint = int(np.argmax(np.abs(last)))
        rows = [
            ("log", f"{self.recording.source}, {len(self.recording)} samples in {self.recording.duration:.4g} s"),
            ("task", self.task.name),
            ("cycles", f"{forward} forward, {len(c) - forward} backward, {c.length:.3g} m each"
             + (f", {c.left_out} that span gaps left out" if c.left_out else "")),
            ("duration of a cycle", f"{_range(c.duration)} s, {_range(c.moving)} s of it moving"),
            ("tool path repeats to", f"{c.residual.max():.2g} m"),
            ("drift of each cycle", f"{_listed(self.largest)} ({self.worst_joint})"),
            (f"drift after {len(c)} cycles", f"{abs(last[joint]):.4g} ({self.robot.joint_names[joint]})"),
            ("noise floor", f"{self.noise_floor:.2g}, tolerance {self.tolerance:g} on top"),
        ]  # fmt: skip
        for group, trend in self.trends.items():
            name = "trend" if len(self.trends) == 1 else f"trend {group}"
            tail = "" if np.isnan(trend.ratio) else f", from cycle to cycle by the factor {trend.ratio:.3g}"
            rows.append((name, trend.trend.value + tail))
        rows += [
            ("equal poses, between cycles", _said(self.between, "")),
            ("equal poses, forward and back", _said(self.by_way, "not tested: all cycles run one way")),
            ("equal poses, fast and slow", _said(self.by_speed, "not tested: all cycles at one speed")),
            ("equal poses, at crossings", _said(self.at_crossings, "not tested: the path does not cross itself")),
        ]
        return rows + [("note", note) for note in self.recording.notes]

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
            "trends": {
                name: {
                    "trend": t.trend.name,
                    "ratio": None if np.isnan(t.ratio) else t.ratio,
                    "rate": t.rate.tolist(),
                    "remaining": [float(v) if np.isfinite(v) else None for v in t.remaining],
                }
                for name, t in self.trends.items()
            },
            "between_cycles": vars(self.between),
            "forward_and_back": None if self.by_way is None else vars(self.by_way),
            "fast_and_slow": None if self.by_speed is None else vars(self.by_speed),
            "at_crossings": None if self.at_crossings is None else vars(self.at_crossings),
            "limit": None if limit is None else {"joint": limit[0], "cycles": limit[1]},
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

    Args:
        orientation: whether the tool's orientation belongs to its task; by default where the robot has joints to
            spare with it.
        tolerance: joint distance [rad or m], on top of the noise floor, that counts as equal.
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
    noise = max((noise_level(column[:, None]) for column in recording.q.T), default=0.0)
    floor = moved.reshape(count, poses).max(axis=0) + 4 * np.sqrt(2) * noise
    floor[[0, -1]] = floor[[0, -1]].max()
    drift = (visits[:, -1] - visits[:, 0]) * cycles.direction[:, None]
    ways = [way for way in (1, -1) if (cycles.direction == way).any()]
    groups = _groups(cycles)
    trends = {name: drift_trend(drift[members], tolerance + floor[0]) for name, members in groups.items()}
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
        at_crossings = distance(met - here, tolerance + more + 4 * np.sqrt(2) * noise, phase)
    tested = (between, by_way, by_speed, at_crossings)
    kinds = {trend.trend for trend in trends.values()}
    strays = bool(np.abs(drift).max() > tolerance + floor[0])  # else cycles there and back may undo each other
    if Trend.CONSTANT in kinds and (between.beyond or strays):
        verdict = Homecoming.DRIFTS
    elif kinds != {Trend.ZERO} or any(d is not None and d.beyond for d in tested):
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


def _range(values: Vector) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if high - low < 5e-3 * high else f"{low:.3g} to {high:.3g}"


def _listed(values: Vector, most: int = 4) -> str:
    shown = [f"{v:.3g}" for v in values]
    return ", ".join(shown if len(shown) <= 2 * most else [*shown[:most], "...", *shown[-most:]])


def _said(distance: Distance | None, otherwise: str) -> str:
    if distance is None:
        return otherwise
    word = "differ" if distance.beyond else "agree"
    return f"{word}: {distance.value:.2g} ({distance.joint}, at {100 * distance.phase:.0f} % of the cycle)"
