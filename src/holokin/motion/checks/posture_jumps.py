"""Jumps of posture inside a motion: joint steps in whose middle the tool is off its way; and self-motions.

On a step from q to q + d, the joints going straight, the tool is near the middle of its way at q + d/2: it is off by
(1/8) d^T H d, H the second derivative of the pose, which is of second order in its step. A step to another posture of
nearly the same tool pose takes the tool off by as much, but leads it nowhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Indices, Matrix, Vector
from ...robot import Robot, chain_length
from ...strategies.tasks.task import Task
from .check_report import MOST_TOLD, Finding, FindingKind
from .checked_samples import Motion
from .joint_findings import stretches

SHARE = 0.25
"""Share of the tool's step by which its middle may be off, beside `TOLERANCES.tracking`: a circle of six samples is off
by an eighth, joints that go 1 rad in any direction by a ninth as a rule."""

LARGE, MANY = 0.3, 20.0
"""A joint step [rad or m] that is told in any case, and how many times the median it is then."""

AT_REST = 0.01
"""How far the tool goes, over how far points at the arm's length would go, up to which it is called at rest."""

LOOKED_AT = 64
"""Samples of a self-motion at which it is looked at whether the tool is where it was."""


def jump_findings(task: Task, motion: Motion) -> Iterator[Finding]:
    """Where a joint step takes the tool off the straight way between its two poses, by more than is allowed.

    The middle may be off by `TOLERANCES.tracking` [m, rad] and `SHARE` of how far the step leads the tool, where a turn
    counts as the arm's length times it. Of a joint without limits a step is what is left without whole turns.
    """
    robot, Q, task = task.robot, motion.samples, task if task.geometric else task.geometric_twin
    step = _steps(robot, Q)
    at = np.flatnonzero(_off_at_most(robot, Q, step) > TOLERANCES.tracking)
    if not len(at):
        return
    # How far the tool is off in the middle of each step, and how far the step leads it.
    p, R = task.poses(Q[at])
    middle, end = Q[at] + step[at] / 2, Q[at] + step[at]
    back, on = task.error(middle, p, R), task.error(middle, *task.poses(end))
    whole = task.error(Q[at], *task.poses(end))
    far, turn = _sizes(task, whole)
    off = [
        np.maximum(np.linalg.norm(a + b, axis=1), sum(np.linalg.norm(x, axis=1) for x in (a, b)) - size) / 2
        for a, b, size in zip(_parts(task, back), _parts(task, on), (far, turn), strict=True)
    ]
    length = _length(robot)
    allowed = [
        TOLERANCES.tracking + SHARE * (far + length * turn), TOLERANCES.tracking + SHARE * (turn + far / length)
    ]  # fmt: skip
    worst = np.zeros(len(step))
    worst[at] = np.maximum(off[0] / allowed[0], off[1] / allowed[1])
    for a, b, k in stretches(worst > 1, worst):
        i = int(np.searchsorted(at, k))
        part = int(off[1][i] / allowed[1][i] > off[0][i] / allowed[0][i])
        joint = robot.joint_names[int(np.argmax(np.abs(step[k])))]
        times = motion.time(a), motion.time(b + 1), (motion.time(k) + motion.time(k + 1)) / 2
        value, limit, unit = float(off[part][i]), float(allowed[part][i]), ("m", "rad")[part]
        yield Finding(FindingKind.JUMP, (joint,), *times, motion.index(k), value, limit, unit)


def large_steps(robot: Robot, motion: Motion, known: Sequence[Finding] | None) -> list[str]:
    """A note on the largest joint step, where it is larger than the others by far.

    Args:
        known: the jumps that were found by a task; None where there was none.
    """
    step = np.abs(_steps(robot, motion.samples))
    size = step.max(axis=1, initial=0.0)
    usual = float(np.median(size[size > 0])) if (size > 0).any() else 0.0
    wrong = (size > LARGE) & (size > MANY * usual)
    for k in np.flatnonzero(wrong).tolist():
        wrong[k] = not any(one.start <= motion.time(k) < one.stop for one in known or ())
    if not wrong.any():
        return []
    k = int(np.argmax(np.where(wrong, size, 0.0)))
    joint, more = robot.coordinates[int(np.argmax(step[k]))], int(wrong.sum()) - 1
    untold = "whether it is a jump of posture cannot be told without the task of a tool"
    often = f"{size[k] / usual:.0f} times the median step{f', and there are {more} more' * (more > 0)}"
    return [
        f"a large step: {joint.name} goes {size[k]:.3g} {joint.unit} from one sample to the next at "
        f"{motion.time(k):.3f} s, {often}; {untold if known is None else 'the tool stays near its straight line'}"
    ]


def self_motions(task: Task, motion: Motion, J: Array) -> list[str]:
    """Notes on where joints move, by `LARGE` at least, and the tool rests. J (k, m, n): along the motion."""
    robot, q = task.robot, motion.q
    step = _steps(robot, q)
    joints = np.abs(step).sum(axis=1)
    far, turn = _sizes(task, np.einsum("kmn,kn->km", (J[1:] + J[:-1]) / 2, step))
    length, found = _length(robot), []
    rests = (far <= AT_REST * length * joints) & (turn <= AT_REST * joints)
    for a, b, _ in stretches(rests, joints):
        gone = np.abs(np.cumsum(step[a : b + 1], axis=0)).max(axis=0)
        joint = robot.coordinates[int(np.argmax(gone))]
        some = np.unique(np.linspace(a, b + 1, LOOKED_AT).astype(int))
        if gone.max() <= LARGE or _strays(task, q, some):
            continue
        when, far_gone = f"{motion.t[a]:.3f} to {motion.t[b + 1]:.3f} s", f"{gone.max():.3g} {joint.unit}"
        found.append(f"a self-motion: from {when} the tool rests while {joint.name} moves by {far_gone}")
    return found if len(found) <= MOST_TOLD else [*found[:MOST_TOLD], f"and {len(found) - MOST_TOLD} more self-motions"]


def _length(robot: Robot) -> float:
    """Of the arm [m], by which turns are compared with distances; that of sliders alone may be 0."""
    return max(chain_length(robot), TOLERANCES.tracking)


def _strays(task: Task, q: Matrix, some: Indices) -> bool:
    """Whether the tool leaves its place by more than `TOLERANCES.tracking`."""
    p, R = task.poses(q[some[:1]])
    return bool(max(size.max() for size in _sizes(task, task.error(q[some], p[0], R[0]))) > TOLERANCES.tracking)


def _steps(robot: Robot, Q: Matrix) -> Matrix:
    """Joint steps (k - 1, n); of joints without limits those that are left without whole turns."""
    step = np.diff(Q, axis=0)
    endless = robot.hinges & np.isinf(robot.lower) & np.isinf(robot.upper)
    return step - 2 * np.pi * np.where(endless, np.round(step / (2 * np.pi)), 0.0)


def _off_at_most(robot: Robot, Q: Matrix, step: Matrix) -> Vector:
    """How far off the tool can be in the middle of a step at most [m], and how far turned [rad]: roughly, for a choice.

    With |d^2 x / dq_i dq_j| <= arm of two hinges, 1 of a hinge and a slider, 0 of two sliders; 2 of rotations.
    """
    turns, slides = np.zeros(len(step)), np.zeros(len(step))
    arm = max((float(np.linalg.norm(tip.placement[:3, 3])) for tip in robot.tips), default=0.0)
    for joint in robot.joints:
        size = abs(joint.multiplier) * np.abs(step[:, joint.coordinate])
        arm += float(np.linalg.norm(joint.placement[:3, 3]))
        if joint.kind == "prismatic":
            slides += size
            arm += float(np.abs(joint.multiplier * Q[:, joint.coordinate] + joint.offset).max(initial=0.0))
        else:
            turns += size
    return turns * (max(2.0, arm) * turns + 2 * slides) / 8


def _parts(task: Task, rows: Matrix) -> tuple[Matrix, Matrix]:
    """The rows in metres, and those in radians, of (k, m)."""
    turning = np.array([unit == "rad" for unit in task.units])
    return rows[:, ~turning], rows[:, turning]


def _sizes(task: Task, rows: Matrix) -> tuple[Vector, Vector]:
    far, turn = (np.linalg.norm(part, axis=1) for part in _parts(task, rows))
    return far, turn
