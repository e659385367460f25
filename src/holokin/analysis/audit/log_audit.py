"""Does a recorded robot repeat? What its joints do at equal poses of the tool, over the cycles of a log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.types import Array, ArrayLike, Indices, Matrix, NoTruthValue, Value, Vector
from ...robot import Robot
from ...strategies.tasks.frame_task import parts_of
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import Axis, pose, position
from .arcs import FREE, WHOLE, encoder_levels, rounding_of
from .cycles import LENGTH_SCALE, Cycles, crossings, find_cycles
from .logs import Recording, joined_turns
from .logs.log_formats import less_turns
from .questions import Distance, LogVerdict, first_limit, to_pose
from .trend import (
    CONFIDENCE,
    FEWEST,
    LEAF_SLOPE,
    SHIFT,
    DriftTrend,
    Trend,
    Visits,
    encoder_noise,
    judge,
    quantile,
    spare_axes,
)

# --- Words for what the audit of a log measured.


def _rate_words(value: float) -> str:
    return f"{value:.2g} rad or m a cycle"


def _trend_words(trend: DriftTrend, phase: Vector) -> str:
    """A trend, the factor it rests on, and the phase (0 to 1) of the cycle that shows it best."""
    if np.isnan(trend.ratio):
        return trend.trend.value
    low, high = trend.ratio_range
    return (
        f"{trend.trend.value}: each of the last {trend.latest} changes from one cycle to the next is about "
        f"{trend.ratio:.3g} times ({low:.3g} to {high:.3g}) the one before; at {100 * phase[trend.phase]:.0f} % of the "
        "cycle the change stands out most from the noise"
    )


def _ranged(values: Vector) -> str:
    """The least and the greatest of values, or one where they agree."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if high - low < 5e-3 * high else f"{low:.3g} to {high:.3g}"


def _listed(values: Vector, most: int = 4) -> str:
    """Values, of many the first and the last."""
    shown = [f"{v:.3g}" for v in values]
    return ", ".join(shown if len(shown) <= 2 * most else [*shown[:most], "...", *shown[-most:]])


def _distance_words(distance: Distance | None, otherwise: str) -> str:
    """Whether joints differ or agree, by how much and where; `otherwise` where the log does not test it."""
    if distance is None:
        return otherwise
    word = "differ" if distance.beyond else "agree"
    return f"{word}: {distance.value:.2g} ({distance.joint}, at {100 * distance.phase:.0f} % of the cycle)"


def _turns_words(log: Recording, places: Indices) -> str:
    """The first step in which a joint may have made a whole turn unseen, how many there are, and the cure."""
    i, steps = places[0, 0], len(np.unique(places[:, 0]))
    joints = ", ".join(log.joint_names[joint] for joint in places[places[:, 0] == i, 1])
    first = f"from {log.t[i]:.6g} to {log.t[i + 1]:.6g} s (samples {i} and {i + 1}) {joints}"
    more = f", and so in {steps - 1} more step{'s' if steps > 2 else ''}" if steps > 1 else ""
    return (
        f"{first} may have made a whole turn that the log does not show, at its largest speed{more}; log more often "
        "and without gaps, give speed limits to a robot that has none, or say --counts-turns (counts_turns=True) if "
        "the values of the joints count whole turns"
    )


def _winding_words(change: Vector, robot: Robot, cycles: int, allowed: float) -> list[str]:
    """The hinges whose change over the log (n,) is whole turns, up to a distance that is allowed."""
    turns = np.round(change / (2 * np.pi)) * robot.hinges
    wound = np.flatnonzero((turns != 0) & (np.abs(change - 2 * np.pi * turns) <= allowed))
    words = {i: f"{abs(turns[i]):.0f} turn{'s' if abs(turns[i]) > 1 else ''}" for i in wound}
    return [f"{robot.joint_names[i]} winds up: it has made {turn} in {cycles} cycles" for i, turn in words.items()]


# --- What the audit of a log found: metrics, and words that say how sure they are and what the log does not test.

_SURE = f"{100 * CONFIDENCE:.0f} %"


# Cycles after the log, for each cycle in it, within which a limit is predicted: rates change as the posture does.
MOST_AHEAD = 2.0

_GRAVITY = (Trend.NONE, Trend.FADES, Trend.ALTERNATES, Trend.CANNOT_TELL, Trend.GOES_ON)


@dataclass(frozen=True, eq=False)
class LogAudit(NoTruthValue, Value, ask="`.verdict`"):
    """Findings of `audit_recording`; `str` prints them, `to_dict` gives them as plain data.

    verdict: whether the joints repeated in this log; `trend`: how their change goes on. visits (c, P + 1, n): postures
    at equal tool poses, moved there through the pseudo-inverse from where the tool was; floor (P + 1,): joint move that
    this took, plus what encoder noise explains, per pose; drift (c, n) of each cycle; trends of the cycles of one
    direction and speed, judged at every pose; closing: of the drifts of single cycles where some run back and may undo
    the others'; between: cycles of one direction; by_way: forward and backward passes; by_speed: fast and slow cycles;
    at_crossings: passes of a point where the path meets itself; None where the log does not test it; unknown_turns
    (p, 2): rows of the recording's that lie from the first cycle to the last; turns of these joints are not counted.
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
    between: Distance
    by_way: Distance | None
    by_speed: Distance | None
    at_crossings: Distance | None
    verdict: LogVerdict
    unknown_turns: Indices

    @property
    def exit_code(self) -> int:
        """0: the joints repeated in every comparison that the log allows; 1: they did not; 2: noise may hide it."""
        return self.verdict.exit_code

    @property
    def trend(self) -> Trend:
        """How the change of the joints goes on, by the gravest finding of all directions and speeds."""
        kinds = {self.closing, *(t.trend for t in self.trends.values())}
        if kinds == {Trend.NONE} and (len(self.unknown_turns) or self.between.beyond):
            # A turn that the log does not show, or scatter without a trend.
            return Trend.CANNOT_TELL
        return max(kinds, key=_GRAVITY.index)

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
        forward = (self.cycles.direction > 0)[:, None]
        ends = np.where(forward, self.visits[:, -1], self.visits[:, 0])
        return ends - (self.visits[0, 0] if forward[0] else self.visits[0, -1])

    @property
    def one_way(self) -> bool:
        """Whether all cycles run in one direction."""
        return bool((self.cycles.direction == self.cycles.direction[0]).all())

    @property
    def leading(self) -> DriftTrend:
        """The trend with the gravest finding; of several, the one that changes most."""
        return max(self.trends.values(), key=lambda t: (_GRAVITY.index(t.trend), t.change, t.detectable))

    @property
    def detectable(self) -> float:
        """Drift [rad or m a cycle] that the log would surely show, at every phase and in cycles of each kind."""
        return max(t.detectable for t in self.trends.values())

    @property
    def limit(self) -> tuple[str, float] | None:
        """(joint, cycles from the end of the log) of the first limit that a lasting drift reaches, or None."""
        return None if self._limit is None else self._limit[:2]

    @property
    def limit_range(self) -> tuple[float, float] | None:
        """Fewest and most cycles to the limit, by the interval of the drift."""
        return None if self._limit is None else self._limit[2:]

    @cached_property
    def _limit(self) -> tuple[str, float, float, float] | None:
        """Only where all cycles drift on, what runs both ways, alternates or fades is not extrapolated; and only what
        they reach within twice as many cycles as the log has, fading as fast as the last differences allow."""
        if not self.one_way or any(trend.trend is not Trend.GOES_ON for trend in self.trends.values()):
            return None
        trend = self.leading
        errors = trend.errors + trend.bends
        rates = np.where(np.abs(trend.rates) > errors, trend.rates, 0.0)
        lower, upper, q = self.robot.lower, self.robot.upper, self.visits[-1, : len(rates)]
        nearest = first_limit(lower, upper, q, rates)
        if nearest is None:
            return None
        joint, cycles = nearest
        soonest = first_limit(lower, upper, q, rates + np.sign(rates) * errors)
        latest = first_limit(lower, upper, q, rates - np.sign(rates) * errors)
        few = cycles if soonest is None else min(soonest[1], cycles)
        most = cycles if latest is None else max(latest[1], cycles)
        fading = 1 - min(trend.ratio_range[0], 1.0)
        if most * fading >= 1 or cycles > MOST_AHEAD * len(self.cycles):
            return None
        most = -np.log1p(-most * fading) / -np.log1p(-fading) if fading > 0 else most
        return self.robot.joint_names[joint], cycles, few, float(most)

    def __str__(self) -> str:
        return "\n".join([self.sentence(), *(f"  {name}: {value}" for name, value in self.rows())])

    def sentence(self) -> str:
        """The two answers, what they rest on, and what was not tested."""
        words = {LogVerdict.REPEATS: _same, LogVerdict.DIFFERS: _differs, LogVerdict.UNDECIDED: _undecided}
        trend = _trend_said(self)
        return f"{words[self.verdict](self)}. {trend}{'. ' if trend else ''}Not tested: {'; '.join(not_tested(self))}"

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        c, last = self.cycles, self.since_start[-1]
        forward = int((c.direction > 0).sum())
        joint = int(np.argmax(np.abs(last)))
        share = c.residual.max() / max(c.sampling, 1e-300)
        by_sampling = f"; its samples alone may make {c.sampling:.2g} m of it" if 0.05 < share < 3 else ""
        left_out = f", {c.left_out} that span gaps left out" if c.left_out else ""
        rows = [
            ("joints repeated", self.verdict.value),
            ("trend", self.trend.value),
            ("log", f"{self.recording.source}, {len(self.recording)} samples in {self.recording.duration:.4g} s"),
            ("task", self.task.name),
            ("cycles", f"{forward} forward, {len(c) - forward} backward, {c.length:.3g} m each{left_out}"),
            ("duration of a cycle", f"{_ranged(c.duration)} s, {_ranged(c.moving)} s of it moving"),
            ("tool path repeats to", f"{c.residual.max():.2g} m{by_sampling}"),
            ("drift of each cycle", f"{_listed(self.largest)} ({self.worst_joint})"),
            (f"drift after {len(c)} cycles", f"{abs(last[joint]):.4g} ({self.robot.joint_names[joint]})"),
            ("noise floor", f"{self.noise_floor:.2g}, tolerance {self.tolerance:g} on top"),
            ("smallest detectable drift", f"{_rate_words(self.detectable)} ({_SURE} confidence)"),
            *((f"trend {group}", _trend_words(trend, c.phase)) for group, trend in self.trends.items()),
            ("equal poses, between cycles", _distance_words(self.between, "")),
            ("equal poses, forward and back", _distance_words(self.by_way, "not tested: all cycles run one way")),
            ("equal poses, fast and slow", _distance_words(self.by_speed, "not tested: all cycles at one speed")),
            (
                "equal poses, at crossings",
                _distance_words(self.at_crossings, "not tested: the path does not cross itself"),
            ),
        ]
        return rows + [("note", note) for note in self.recording.notes]

    def to_dict(self) -> dict[str, Any]:
        """Everything found, as plain data for JSON (no NaN, no infinity)."""
        # The cycles and the trends, one row each.
        c, names, limit = self.cycles, list(self.robot.joint_names), self.limit
        keys = ("start_sample", "stop_sample", "direction", "duration_s", "moving_s", "drift")
        columns = [x.tolist() for x in (c.start, c.stop, c.direction, c.duration, c.moving, self.drift)]
        return {
            "verdict": self.verdict.name,
            "trend": self.trend.name,
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
            "tool_path_residual_by_sampling_m": c.sampling,
            "cycles_left_out": c.left_out,
            "cycles": [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)],
            "drift_since_start": self.since_start.tolist(),
            "worst_joint": self.worst_joint,
            "unknown_turns": [
                {"sample": int(i), "time_s": float(self.recording.t[i]), "joint": names[j]}
                for i, j in self.unknown_turns
            ],
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
                    "differences_judged": t.latest,
                    "change": t.change,
                    "change_range": list(t.change_range),
                    "detectable_drift_per_cycle": t.detectable,
                    "of_it_by_shifts_of_the_tool": t.creep,
                    "cycles_needed": t.cycles_needed,
                }
                for name, t in self.trends.items()
            },
            "between_cycles": vars(self.between),
            "forward_and_back": self.by_way and vars(self.by_way),
            "fast_and_slow": self.by_speed and vars(self.by_speed),
            "at_crossings": self.at_crossings and vars(self.at_crossings),
            "limit": None if limit is None else {"joint": limit[0], "cycles": limit[1], "range": self.limit_range},
        }


def not_tested(audit: LogAudit) -> list[str]:
    """What the log leaves open, in words."""
    open_ = []
    if audit.by_way is None:
        open_.append("the path back (all cycles run one way)")
    if audit.by_speed is None:
        open_.append("other speeds (all cycles at one speed)")
    if audit.at_crossings is None and audit.cycles.mirror is None:
        open_.append("other paths to a pose within a cycle (the path does not cross itself)")
    return [*open_, "paths that are not in the log"]


def _same(audit: LogAudit) -> str:
    """The claim holds for the cycles of the log: what these do not vary, it does not cover, and says so."""
    values = [d.value for d in (audit.between, audit.by_way, audit.by_speed, audit.at_crossings) if d is not None]
    count = len(audit.cycles)
    tested = [word for word, d in (("both ways", audit.by_way), ("at all logged speeds", audit.by_speed)) if d]
    tested += ["where the path crosses itself"] if audit.at_crossings is not None else []
    alike = [word for word, d in (("in one direction", audit.by_way), ("at one speed", audit.by_speed)) if d is None]
    among = "".join(f", {' and '.join(words)}" for words in (tested, alike) if words)
    shown = max((t.change for t in audit.trends.values()), default=0.0)
    below = f"; below the tolerance a change of {shown:.2g} over the log did show" if shown > 0 else ""
    return (
        f"repeats: the joints were the same at equal tool poses in all {count} cycles{among}, within "
        f"{max(values):.2g} rad or m{below}; a drift of {_rate_words(audit.detectable)} would have been found ({_SURE} "
        "confidence)"
    )


def _differs(audit: LogAudit) -> str:
    """By how much, in all and of late."""
    parts = []
    if audit.between.beyond or any(t.beyond for t in audit.trends.values()):
        gap = audit.between
        size = max(gap.value, *(t.change for t in audit.trends.values())) if not gap.beyond else gap.value
        place = f" ({gap.joint}, at {100 * gap.phase:.0f} % of the cycle)" if gap.beyond else ""
        parts.append(
            f"at equal tool poses they are up to {size:.3g} rad or m apart between cycles{place}{_of_late(audit)}"
        )
        parts += _winding_words(
            audit.since_start[-1], audit.robot, len(audit.cycles), audit.tolerance + audit.noise_floor
        )
    elif audit.closing is not Trend.NONE:
        size = f"{audit.largest.max():.3g} in a cycle ({audit.worst_joint})"
        parts.append(f"cycles of one direction leave them elsewhere, by {size}, and those back undo it")
    asked = {"way": audit.by_way, "speed": audit.by_speed, "pass of a crossing": audit.at_crossings}
    differ = [f"the {word} (by up to {d.value:.2g}, {d.joint})" for word, d in asked.items() if d and d.beyond]
    parts += [f"the joints at a pose depend on {' and '.join(differ)}"] if differ else []
    return f"differs: the joints did not repeat; {'; '.join(parts)}"


def _of_late(audit: LogAudit) -> str:
    """By how much a cycle: the drift of the last third, or the last two cycles' difference where there is none."""
    t, names, phase = audit.leading, audit.robot.joint_names, audit.cycles.phase
    if t.trend is Trend.ALTERNATES or np.isnan(t.ratio):
        alike = audit.visits[(audit.cycles.direction == audit.cycles.direction[-1])]
        gap = np.abs(alike[-1] - alike[-2]) if len(alike) > 1 else np.abs(audit.drift[-1:])
        p, joint = np.unravel_index(int(np.argmax(gap)), gap.shape)
        where = f"{names[joint]}, at {100 * phase[p]:.0f} % of the cycle"
        return f"; in the last two cycles they are {gap[p, joint]:.3g} apart ({where})"
    joint = int(np.argmax(np.abs(t.rate)))
    rate, error = abs(float(t.rate[joint])), float(t.rate_error[joint])
    if rate <= error:
        return (
            f"; in the last third of the cycles they move by less than {rate + error:.2g} a cycle ({_SURE} confidence)"
        )
    where = f"{names[joint]}, at {100 * phase[t.phase]:.0f} % of the cycle"
    move = f"{rate:.3g} +- {error:.1g} a cycle ({where}; {_SURE} confidence)"
    return f"; in the last third of the cycles they move by {move}"


def _undecided(audit: LogAudit) -> str:
    if len(audit.unknown_turns):
        return f"cannot tell: {_turns_words(audit.recording, audit.unknown_turns)}"
    widest = max(audit.trends.values(), key=lambda t: t.change_range[1])
    if widest.change_range[1] > audit.tolerance:
        fewest, most = widest.change_range
        return (
            f"cannot tell: over the cycles the joints change by about {widest.change:.2g} rad or m, which may be "
            f"{fewest:.2g} to {most:.2g} ({_SURE} confidence), and the tolerance is {audit.tolerance:g}: log about "
            f"{widest.cycles_needed} cycles, or with less noise"
        )
    trend = max(audit.trends.values(), key=lambda t: t.detectable)
    hidden = f"a drift of up to {_rate_words(audit.detectable)} may hide"
    if trend.creep > 0.5 * trend.detectable:
        text = f"the tool's own path shifts from cycle to cycle, and {hidden} in the joint motion that goes with it"
    else:
        text = f"{hidden} in the noise of this log ({_SURE} confidence), and {_rate_words(audit.tolerance)} counts: "
        text += f"log about {trend.cycles_needed} cycles, or with less noise"
    return f"cannot tell: {text}"


def _trend_said(audit: LogAudit) -> str:
    """How the change goes on, and by what; nothing where there is none to speak of."""
    # The words for the gravest trend, and by which factor the change goes on.
    t, kind = audit.leading, audit.trend
    low, high = t.ratio_range
    last = f"the last {t.latest} changes from one cycle to the next"
    factor = f"(each is about {t.ratio:.3g} times the one before, {low:.3g} to {high:.3g}; {_SURE} confidence)"
    if kind is Trend.NONE or (kind is Trend.CANNOT_TELL and audit.verdict is LogVerdict.UNDECIDED):
        return ""
    if t.trend is not kind:  # of single cycles, or scatter
        words = {
            Trend.GOES_ON: "goes on: each of the last cycles leaves the joints elsewhere",
            Trend.FADES: "fades: the first cycles leave the joints elsewhere, the last do not",
        }
        return f"Trend: {words.get(kind, 'cannot tell: the joints scatter, with no trend over the cycles')}"
    ahead = _ahead(audit) if kind is Trend.GOES_ON else ""
    fading = f"go on fading {factor}" if np.isfinite(t.ratio) else "show no change beyond tolerance and noise"
    words = {
        Trend.GOES_ON: f"goes on: {last} are not zero and do not fade {factor}{ahead}",
        Trend.ALTERNATES: f"alternates: {last} change sign and do not fade {factor}; the joints come back every second "
        "cycle only",
        Trend.FADES: f"fades: {last} {fading}",
    }
    if kind in words:
        return f"Trend: {words[kind]}"
    if t.latest == 0 or not np.isfinite(t.ratio):
        why = f"{len(audit.cycles)} cycles do not show whether the change goes on, fades, alternates or is scatter"
    else:
        why = f"{last} change {factor}: this neither goes on nor surely fades"
    return f"Trend: cannot tell: {why}; log about {t.cycles_needed} cycles"


def _ahead(audit: LogAudit) -> str:
    """When a small drift leaves the tolerance, and the first limit."""
    text, t = "", audit.leading
    if audit.verdict is LogVerdict.REPEATS:
        text += f"; {_rate_words(float(np.abs(t.rate).max()))} leaves the tolerance after about "
        text += f"{audit.tolerance / float(np.abs(t.rate).max()):.0f} cycles"
    if audit.limit is not None and audit.limit_range is not None:
        (joint, cycles), (few, most) = audit.limit, audit.limit_range
        more = f"{cycles:.0f} more cycle{'' if round(cycles) == 1 else 's'}"
        text += f"; at this rate {joint} is at its limit after {more} ({few:.0f} to {most:.0f})"
    return text


# Default distance [rad or m] of joints that counts as equal, on top of the noise floor: a millimetre at a metre's
# reach, below which the backlash of usual gears hides everything. A drift of as much per cycle must be excluded
# before the joints are called the same; a smaller change that is seen is named.
TOLERANCE = 1e-3

SPEEDS = 1.2  # cycles whose moving times differ by more than this factor count as fast and slow


@typed
def audit_recording(
    recording: Recording,
    robot: Robot,
    *,
    tip: str | None = None,
    orientation: bool | None = None,
    axis: Axis | ArrayLike | None = None,
    tolerance: float = TOLERANCE,
    length_scale: float = LENGTH_SCALE,
) -> LogAudit:
    """Judge the joints of a recording at equal poses of the tool.

    Two answers: `verdict`, whether the joints repeated in this log, `LogVerdict.UNDECIDED` where noise or shifts of the
    tool's path may hide it; and `trend`, how their change goes on, by the last third of the cycles. Each is given at
    `scatter.CONFIDENCE`.

    Args:
        orientation: whether the tool's orientation belongs to its task; by default where the robot has joints to
            spare with it.
        axis: about which the tool may spin, "x", "y" or "z" of the tool or a direction (3,) in its frame: then its
            point and the direction of this axis are its task.
        tolerance: joint distance [rad or m], on top of the noise floor, that counts as equal, and drift [rad or m a
            cycle] that must be excluded before the joints are called the same.
        length_scale: [m/rad] of the distance of two poses, see `find_cycles`.

    Raises:
        FileError: fewer than two cycles. ArgumentError, ShapeError: a bad argument. UnknownNameError: no such tip.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ArgumentError("tolerance", tolerance, "give a positive number [rad or m]")
    if not (np.isfinite(length_scale) and length_scale > 0):
        raise ArgumentError("length_scale", length_scale, "give a positive number [m/rad]")
    if recording.q.shape[1] != robot.n:
        raise ShapeError("q of the recording", ("k", robot.n), recording.q.shape, "read it with the same robot")
    if recording.unknown_turns is None:
        recording = joined_turns(recording, robot)
    # The cycles. Joints whose turns the log does not show are compared modulo a turn.
    task, axes = task_of_tool(robot, tip, orientation, axis, recording.q[0])
    cycles = find_cycles(recording, robot, tip=tip, axes=axes, length_scale=length_scale)
    unknown, within = _unknown_turns(recording, cycles)
    turning = np.isin(np.arange(robot.n), unknown[:, 1])
    if turning.any():
        cycles = replace(cycles, q=cycles.q[0] + less_turns(cycles.q - cycles.q[0], turning))
    # The visits: postures moved to the poses of the first cycle, by how much, and what encoder noise makes of them.
    count, poses, n = cycles.q.shape
    place, turn = robot.pose_batch(cycles.q[0], tip)
    place[-1], turn[-1] = place[0], turn[0]
    visits, moved = np.empty_like(cycles.q), np.empty((count, poses))
    for i in range(count):  # a cycle at a time: the Jacobians of all take more memory than the log
        visits[i], moved[i] = to_pose(task, cycles.q[i], place, turn)
    ways = [way for way in (1, -1) if (cycles.direction == way).any()]
    jacobian, _ = task.jacobian_batch(visits.mean(axis=0))
    axes = spare_axes(jacobian)
    weights = np.array([1.0 if unit == "m" else length_scale**2 for unit in task.units])
    noise, of_joints, of_moves = encoder_noise(
        jacobian, axes, np.gradient(cycles.q.mean(axis=0), axis=0), weights, encoder_levels(recording.q)
    )
    # The floor: the joint distance that moves of the tool and encoder noise explain.
    pairs = max(count * (count - 1) // 2, 1)
    widest = quantile((1 - CONFIDENCE) / (pairs * poses * axes.shape[2]), np.inf) * np.sqrt(2)
    between_moves = np.linalg.norm(
        np.ptp(visits - cycles.q, axis=0), axis=1
    )  # shifts of the tool, which spare joints follow
    by_shifts = np.sqrt(np.maximum(between_moves**2 - 2 * (SHIFT * of_moves) ** 2, 0.0))
    floor = np.maximum(moved.max(axis=0), LEAF_SLOPE * by_shifts) + widest * of_joints.max(axis=1)
    floor[[0, -1]] = floor[[0, -1]].max()
    drift = less_turns(visits[:, -1] - visits[:, 0], turning) * cycles.direction[:, None]
    # The trend of the cycles of each direction and speed.
    groups, digits = _groups(cycles), rounding_of(recording.q)

    def judged(members: Indices) -> DriftTrend:
        joints, poses_used = visits[members, :-1], slice(0, -1)
        moves, when = joints - cycles.q[members, :-1], members
        if len(members) < FEWEST and members[-1] - members[0] < len(members):  # at the start there is one visit more
            closed = np.vstack([np.zeros(n), np.cumsum(drift[members], axis=0)])
            joints, poses_used = (visits[members[0], 0] + closed)[:, None], slice(0, 1)
            moves, when = np.zeros_like(joints), np.arange(len(members) + 1)
        scatter = noise[poses_used], of_moves[poses_used]
        kind = Visits(joints, axes[poses_used], when.astype(float), moves, *scatter)
        return judge(kind, tolerance, floor=float(floor[poses_used].max()), share=1 / len(groups), rounding=digits)

    trends = {name: judged(members) for name, members in groups.items()}
    if len(ways) == 1 and len(trends) > 1 and any(t.trend is Trend.CANNOT_TELL for t in trends.values()):
        together = judged(np.arange(count))  # a drift at all speeds shows in all cycles together
        trends = {"at all speeds": together} if together.trend is Trend.GOES_ON else trends
    # The distances of postures at equal poses: between cycles, by direction, by speed, at crossings of the path.
    allowed = tolerance + floor

    def distance(gap: Matrix, allowed: Vector = allowed, phase: Vector = cycles.phase) -> Distance:
        over = np.abs(gap).max(axis=1) - allowed
        p = int(np.argmax(over if over.max() > 0 else np.abs(gap).max(axis=1)))
        joint = int(np.argmax(np.abs(gap[p])))
        return Distance(float(abs(gap[p, joint])), robot.joint_names[joint], float(phase[p]), bool(over.max() > 0))

    between = distance(np.max([np.ptp(visits[cycles.direction == way], axis=0) for way in ways], axis=0))
    by_way = by_speed = None
    if len(ways) == 2:
        by_way = distance(visits[cycles.direction > 0][-1] - visits[cycles.direction < 0][-1])
    elif cycles.mirror is not None:
        back = np.array([np.interp((2 * cycles.mirror - cycles.phase) % 1, cycles.phase, v) for v in cycles.q[-1].T]).T
        there, more = to_pose(task, back, place, turn)
        by_way = distance(less_turns(there - visits[-1], turning), allowed + more)
    speeds = {"fast": _speed(cycles) > 0, "slow": _speed(cycles) < 0}
    for way in ways:
        pair = [np.flatnonzero(fits & (cycles.direction == way)) for fits in speeds.values()]
        if all(len(members) for members in pair):
            apart = distance(visits[pair[0][-1]] - visits[pair[1][-1]])
            by_speed = apart if by_speed is None or apart.value > by_speed.value else by_speed
    at_crossings = None
    first, second = crossings(cycles)
    if len(first):
        q_first, q_second = cycles.path.posture(first), cycles.path.posture(second)
        moved_there, more = to_pose(task, q_second, *robot.pose_batch(q_first, tip))
        way = 1 if cycles.s[-1, -1] > cycles.s[-1, 0] else -1
        phase = np.interp(first, cycles.s[-1, ::way], cycles.phase[::way])
        at_crossings = distance(
            less_turns(moved_there - q_first, turning), tolerance + more + widest * of_joints.max(), phase
        )
    # The verdict.
    closing = _closing(drift, cycles, tolerance + float(floor[0])) if len(ways) == 2 else Trend.NONE
    distances = (between, by_way, by_speed, at_crossings)
    differs = closing is not Trend.NONE or any(d is not None and d.beyond for d in distances)
    if within:  # a posture between two samples may be a whole turn off
        verdict = LogVerdict.UNDECIDED
    elif differs or any(t.beyond for t in trends.values()):
        verdict = LogVerdict.DIFFERS
    elif len(unknown) or any(max(t.detectable, t.change_range[1]) > tolerance for t in trends.values()):
        verdict = LogVerdict.UNDECIDED
    else:
        verdict = LogVerdict.REPEATS
    measured = (visits, floor, drift, trends, closing)
    return LogAudit(robot, recording, task, cycles, tolerance, *measured, *distances, verdict, unknown)


def _unknown_turns(recording: Recording, cycles: Cycles) -> tuple[Indices, bool]:
    """(steps (p, 2) from the first cycle to the last in which a joint may have made whole turns that the log does not
    show, whether one lies within a cycle)."""
    places = recording.unknown_turns
    if places is None or not len(places):
        return np.empty((0, 2), np.intp), False
    after, before = places[:, 0] + 1 > cycles.start.min(), places[:, 0] < cycles.stop.max()
    unknown = places[after & before]
    step = unknown[:, :1]
    return unknown, bool(((step + 1 > cycles.start) & (step < cycles.stop)).any())


def task_of_tool(
    robot: Robot, tip: str | None, orientation: bool | None, axis: Axis | ArrayLike | None, q: Vector
) -> tuple[Task, Matrix]:
    """(what the tool of a log does, the axes (3, a) whose directions belong to it), as `audit_recording` says them.

    Raises: ArgumentError: an axis beside an orientation.
    """
    if axis is not None:
        if orientation is not None:
            raise ArgumentError("axis beside orientation", axis, "give one of them")
        # The tool may spin about the axis, whose direction counts from that at q.
        task = pose(robot, "axis", reference=robot.pose(q, tip)[:3, :3], axis=axis, tip=tip)
        return task, parts_of(task)[0].axis[:, None]
    whole = robot.n > (3 if robot.planar else 6) if orientation is None else orientation
    return (pose(robot, tip=tip), WHOLE) if whole else (position(robot, tip), FREE)


def _speed(cycles: Cycles) -> Vector:
    """1 for fast cycles, -1 for slow ones, by moving time; 0 for all when they differ by no more than `SPEEDS`."""
    time = cycles.moving
    if time.max() <= SPEEDS * time.min():
        return np.zeros(len(time))
    return np.where(time < np.sqrt(time.max() * time.min()), 1.0, -1.0)


def _closing(drift: Matrix, cycles: Cycles, allowed: float) -> Trend:
    """Whether cycles of one direction leave the joints elsewhere, each by itself: still at the end, or no more."""
    trend = Trend.NONE
    for way in (1, -1):
        drifts = drift[cycles.direction == way]
        if np.abs(drifts[len(drifts) // 2 :].mean(axis=0)).max() > allowed:
            return Trend.GOES_ON
        if np.abs(drifts).max() > allowed:
            trend = Trend.FADES
    return trend


def _groups(cycles: Cycles) -> dict[str, Indices]:
    """Cycles of one direction and speed, whose drifts may go on alike; groups of one cycle only if all are so."""
    groups = {}
    for way, name in ((1, "forward"), (-1, "backward")):
        same_way = cycles.direction == way
        parts = {
            f"{name}{tail}": np.flatnonzero(same_way & (_speed(cycles) == speed))
            for speed, tail in ((0, ""), (1, ", fast"), (-1, ", slow"))
        }
        several = {key: members for key, members in parts.items() if len(members) > 1}
        if several:
            groups |= several
        elif same_way.any():
            groups[name] = np.flatnonzero(same_way)
    return groups
