"""Does a recorded robot repeat? What its joints do at equal poses of the tool, over the cycles of a log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.types import ArrayLike, Indices, Matrix, Vector
from ...robot import Robot
from ...strategies.tasks.frame_task import parts_of
from ...strategies.tasks.task import Task
from ...strategies.tasks.task_kinds import pose, position
from .arcs import FREE, WHOLE, encoder_levels, rounding_of
from .crossings import crossings
from .cycles import LENGTH_SCALE, Cycles, find_cycles
from .equal_poses import Distance, LogVerdict, spread, to_pose
from .log_findings import LogAudit
from .logs import Recording, joined_turns
from .logs.logged_turns import less_turns
from .scatter import CONFIDENCE, FEWEST, LEAF_SLOPE, SHIFT, quantile
from .trend import DriftTrend, Trend, judge
from .visits import Visits, encoder_noise, spare_axes

TOLERANCE = 1e-3
"""Default distance [rad or m] of joints that counts as equal, on top of the noise floor: a millimetre at a metre's
reach, below which the backlash of usual gears hides everything. A drift of as much per cycle must be excluded before
the joints are called the same; a smaller change that is seen is named."""

SPEEDS = 1.2
"""Cycles whose moving times differ by more than this factor count as fast and slow."""


@typed
def audit_recording(
    recording: Recording,
    robot: Robot,
    *,
    tip: str | None = None,
    orientation: bool | None = None,
    axis: str | ArrayLike | None = None,
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
        RecordingError: fewer than two cycles. ArgumentError, ShapeError: a bad argument. UnknownNameError: no such tip.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ArgumentError("tolerance", tolerance, "give a positive number [rad or m]")
    if not (np.isfinite(length_scale) and length_scale > 0):
        raise ArgumentError("length_scale", length_scale, "give a positive number [m/rad]")
    if recording.q.shape[1] != robot.n:
        raise ShapeError("q of the recording", ("k", robot.n), recording.q.shape, "read it with the same robot")
    if recording.unknown_turns is None:
        recording = joined_turns(recording, robot)
    task, axes = task_of_tool(robot, tip, orientation, axis, recording.q[0])
    cycles = find_cycles(recording, robot, tip=tip, axes=axes, length_scale=length_scale)
    unknown, within = _unknown_turns(recording, cycles)
    turning = np.isin(np.arange(robot.n), unknown[:, 1])  # of these joints, whole turns are not counted
    if turning.any():
        cycles = replace(cycles, q=cycles.q[0] + less_turns(cycles.q - cycles.q[0], turning))
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
    pairs = max(count * (count - 1) // 2, 1)
    widest = quantile((1 - CONFIDENCE) / (pairs * poses * axes.shape[2]), np.inf) * np.sqrt(2)
    between_moves = np.linalg.norm(spread(visits - cycles.q), axis=1)  # shifts of the tool, which spare joints follow
    by_shifts = np.sqrt(np.maximum(between_moves**2 - 2 * (SHIFT * of_moves) ** 2, 0.0))
    floor = np.maximum(moved.max(axis=0), LEAF_SLOPE * by_shifts) + widest * of_joints.max(axis=1)
    floor[[0, -1]] = floor[[0, -1]].max()
    drift = less_turns(visits[:, -1] - visits[:, 0], turning) * cycles.direction[:, None]
    groups = _groups(cycles)

    digits = rounding_of(recording.q)

    def judged(members: Indices) -> DriftTrend:
        joints, at = visits[members, :-1], slice(0, -1)
        moves, when = joints - cycles.q[members, :-1], members
        if len(members) < FEWEST and members[-1] - members[0] < len(members):  # at the start there is one visit more
            closed = np.vstack([np.zeros(n), np.cumsum(drift[members], axis=0)])
            joints, at = (visits[members[0], 0] + closed)[:, None], slice(0, 1)
            moves, when = np.zeros_like(joints), np.arange(len(members) + 1)
        kind = Visits(joints, axes[at], when.astype(float), moves, noise[at], of_moves[at])
        return judge(kind, tolerance, floor=float(floor[at].max()), share=1 / len(groups), rounding=digits)

    trends = {name: judged(members) for name, members in groups.items()}
    if len(ways) == 1 and len(trends) > 1 and any(t.trend is Trend.CANNOT_TELL for t in trends.values()):
        together = judged(np.arange(count))  # a drift at all speeds shows in all cycles together
        trends = {"at all speeds": together} if together.trend is Trend.GOES_ON else trends
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
        by_way = distance(less_turns(there - visits[-1], turning), allowed + more)
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
        at_crossings = distance(less_turns(met - here, turning), tolerance + more + widest * of_joints.max(), phase)
    closing = _closing(drift, cycles, tolerance + float(floor[0])) if len(ways) == 2 else Trend.NONE
    apart = (between, by_way, by_speed, at_crossings)
    differs = closing is not Trend.NONE or any(d is not None and d.beyond for d in apart)
    if within:  # a posture between two samples may be a whole turn off
        verdict = LogVerdict.UNDECIDED
    elif differs or any(t.beyond for t in trends.values()):
        verdict = LogVerdict.DIFFERS
    elif len(unknown) or any(max(t.detectable, t.change_range[1]) > tolerance for t in trends.values()):
        verdict = LogVerdict.UNDECIDED
    else:
        verdict = LogVerdict.REPEATS
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
        between,
        by_way,
        by_speed,
        at_crossings,
        verdict,
        unknown,
    )


def _unknown_turns(recording: Recording, cycles: Cycles) -> tuple[Indices, bool]:
    """(steps (p, 2) from the first cycle to the last in which a joint may have made whole turns that the log does not
    show, whether one lies within a cycle)."""
    places = recording.unknown_turns
    if places is None or not len(places):
        return np.empty((0, 2), np.intp), False
    after, before = places[:, 0] + 1 > cycles.q0.min(), places[:, 0] < cycles.stop.max()
    found = places[after & before]
    step = found[:, :1]
    return found, bool(((step + 1 > cycles.q0) & (step < cycles.stop)).any())


def task_of_tool(
    robot: Robot, tip: str | None, orientation: bool | None, axis: str | ArrayLike | None, q: Vector
) -> tuple[Task, Matrix]:  # fmt: skip
    """(what the tool of a log does, the axes (3, a) whose directions belong to it), as `audit_recording` says them.

    Raises: ArgumentError: an axis beside an orientation.
    """
    if axis is not None:
        if orientation is not None:
            raise ArgumentError("axis beside orientation", axis, "give one of them")
        return _about(robot, tip, axis, q)
    whole = robot.n > (3 if robot.planar else 6) if orientation is None else orientation
    return (pose(robot, tip=tip), WHOLE) if whole else (position(robot, tip), FREE)


def _about(robot: Robot, tip: str | None, axis: str | ArrayLike, q: Vector) -> tuple[Task, Matrix]:
    """(the task of a tool that may spin about an axis, the axis (3, 1)); its direction counts from that at q."""
    task = pose(robot, "axis", reference=robot.pose(q, tip)[:3, :3], axis=axis, tip=tip)
    return task, parts_of(task)[0].axis[:, None]


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
    found = Trend.NONE
    for way in (1, -1):
        mine = drift[cycles.direction == way]
        if np.abs(mine[len(mine) // 2 :].mean(axis=0)).max() > allowed:
            return Trend.GOES_ON
        if np.abs(mine).max() > allowed:
            found = Trend.FADES
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
