"""Self-motions: all postures that hold the tool at a pose, where one joint is redundant, as curves.

Where one joint is held at c, an arm of a class of closed forms has at most eight postures, numbered by the signs of the
slopes s_i of three steps. So the postures of a pose are at most eight arcs c -> q(c; signs), which end where an s_i is
0, and there go on as the arc with that sign turned round. Other arms have curves that are traced.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector, kept
from ...robot.closed_form import ArmClass, ClosedInverse, arm_class
from ...robot.closed_form.six_hinges import posture
from ...strategies.tasks.frame_task import FrameTask, asks_whole_pose, free_directions
from ...strategies.tasks.task import Task, TipFrame
from ...symbolic import SX, Function, fmin, symbol, vertcat
from ...symbolic.rotations import rotation_about
from .arcs import Cut, curves_of
from .curve_cuts import curves_by_cuts

TOGETHER = 64
"""Poses whose curves are made together: as many as stay in a processor's memory."""


@dataclass(frozen=True, eq=False)
class SelfMotions(Value):
    """The postures q (N, n) at tool poses p (S, 3), R (S, 3, 3), at that of `pose` (N,), as curves.

    Rows of one curve follow each other in its order, numbered by `curve` (N,); hinges are continuous along it, at some
    whole turn. closed (C,): which curves come back: the last row is the first one, but for whole turns.
    """

    task: Task
    p: Matrix
    R: Array
    q: Matrix
    pose: Indices
    curve: Indices
    closed: Flags

    def of(self, pose: int) -> SelfMotions:
        """Those of one of the poses."""
        first, last = np.searchsorted(self.pose, [pose, pose + 1])
        curves = np.unique(self.curve[first:last])
        which = np.searchsorted(curves, self.curve[first:last])
        at = slice(pose, pose + 1)
        return SelfMotions(self.task, self.p[at], self.R[at], self.q[first:last], which * 0, which, self.closed[curves])


@kept
def cut_class(task: Task) -> ArmClass | None:
    """The class of the arm that is left of a task's robot when one joint is held, of those whose signs tell postures
    apart; None where no joint leaves one."""
    if not asks_whole_pose(task) or task.n != 7:
        return None
    ranged = np.isfinite(task.robot.upper - task.robot.lower)
    for k in reversed(range(task.n)):
        found = arm_class(task.robot, (k,), task.tip)
        if isinstance(found, ArmClass) and found.proven and (task.robot.hinges[k] or ranged[k]):
            return found
    return None


@kept
def _spin_class(task: Task) -> tuple[ArmClass, Vector, bool] | None:
    """The class of an arm of six joints whose task leaves a spin of the tool free, about an axis (3,) that is fixed in
    the tool, or, with True, in the base; None of other tasks, and without a class."""
    five = isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and {0, 1, 2} <= set(task.rows)
    if not five or task.n != 6 or task.m != 5 or (direction := free_directions(task)[0]) is None:
        return None
    found = arm_class(task.robot, (), task.tip)
    return (found, *direction) if isinstance(found, ArmClass) and found.proven else None


@kept
def cut_of(task: Task) -> Cut | None:
    """The cut of a task whose self-motions have a closed form: by a joint that is held, or by the spin of the tool."""
    c, pose, signs = symbol("c", 1), symbol("pose", 4, 4), symbol("signs", 3)
    q, low, high = SX.zeros(task.n, 1), -np.pi, np.pi
    if (found := cut_class(task)) is not None:
        k, held, target = found.held[0], c, pose
        q[k] = c
        if not task.robot.hinges[k]:
            low, high = float(task.robot.lower[k]), float(task.robot.upper[k])
    elif (spin := _spin_class(task)) is not None:
        found, axis, of_base = spin
        R, turn = pose[:3, :3], rotation_about(axis, c)
        held, target = SX(0, 1), SX(pose)
        target[:3, :3] = turn @ R if of_base else R @ turn
    else:
        return None
    inverse = ClosedInverse(found, limits=False)
    chain, own = inverse.numbers(held)
    joints = SX(np.nan_to_num(inverse.joints))
    six, roots, correction = posture(found.form, True, chain, target, own, joints, signs)
    q[inverse.others] = six
    share = reduce(fmin, [root.share for root in roots])
    answer = vertcat(q, *(root.square for root in roots), share, correction)
    branch = Function("branch", {"c": c, "pose": pose, "signs": signs}, {"answer": answer})
    return Cut(task, branch, low, high, high == np.pi)


def self_motions_at(task: Task, p: Matrix, R: Array) -> SelfMotions:
    """All self-motions at tool poses p (S, 3), R (S, 3, 3), whatever the joint limits."""
    cut = cut_of(task)
    if cut is None:
        return SelfMotions(task, p, R, *curves_by_cuts(task, p, R))
    poses = pose_from(p, R)
    if len(poses) <= TOGETHER:
        q, curve, pose, closed = curves_of(cut, poses)
        return SelfMotions(task, p, R, q, pose[curve], curve, closed)
    parts = [curves_of(cut, poses[first : first + TOGETHER]) for first in range(0, len(poses), TOGETHER)]
    counts = np.cumsum([0, *(len(part.pose) for part in parts)])
    pose = np.concatenate([part.pose + k * TOGETHER for k, part in enumerate(parts)])
    curve = np.concatenate([part.curve + k for k, part in zip(counts, parts, strict=False)])
    q, closed = np.concatenate([part.q for part in parts]), np.concatenate([part.closed for part in parts])
    return SelfMotions(task, p, R, q, pose[curve], curve, closed)
