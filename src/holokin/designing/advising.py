"""`advise`: the law for a robot and its work, of all that fit, and why."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, JointLimitError
from ..motion import inverse
from ..robot import Robot, load
from ..strategies import HolonomicStrategy, moore_penrose, radial
from ..task import Task, position
from ..types import Array, ArrayLike, Flags, Matrix, Value, Vector
from ..workspaces import PoseRange, Workspace, workspace as pose_range
from .candidates import Candidate, candidates
from .rays import along_leaf
from .starts import comfort, fitting_task, inside, postures_at, regular_starts
from .tips import choose_tip
from .trials import Motions, Trial, least_speed, tried

SCREENED, LOOKED_AT = 64, 256
"""Poses by which leaves and laws are chosen, and by which the chosen ones are compared."""

EQUAL = 0.01
"""Difference of coverage up to which two laws cover alike: a few of the poses, which others would decide otherwise."""

ROOM, REGULAR = 0.02, 0.01
"""Share of a joint's range to its limit, and rcond, from which on a law keeps away from limits and singularities."""

PROPOSED = 0.15
"""Half side of a workspace that is proposed, over the length of the arm."""


@dataclass(frozen=True, eq=False)
class Law(Value):
    """A law and its leaf, with what it does in the workspace.

    keys: what a job file says of it. start: the posture that its leaf goes through. coverage: share of the poses that
    it reaches within the joint limits. margin: least distance to a limit over the joint's range, of `joint`. rcond: the
    least. speed: mean squared joint speed over the least possible. why: causes of poses that are not served -> share.
    """

    name: str
    keys: dict[str, object]
    strategy: HolonomicStrategy
    start: Vector
    coverage: float
    margin: float
    joint: str
    rcond: float
    speed: float
    served: Flags


@dataclass(frozen=True, eq=False)
class Advice(Value):
    """Laws for a robot and a workspace, the best first.

    proposed: which of "tip", "start", "workspace" were not given but chosen here.
    """

    task: Task
    workspace: Workspace
    start: Vector
    proposed: tuple[str, ...]
    laws: tuple[Law, ...]
    poses: Array
    floor: float
    seconds: float

    @property
    def best(self) -> Law:
        """The law to take."""
        return self.laws[0]


@typed
def advise(
    robot: Robot | str | Path,
    workspace: Workspace | None = None,
    *,
    tip: str | None = None,
    start: ArrayLike | None = None,
    position_only: bool = False,
    say: Callable[[str], None] = lambda _text: None,
) -> Advice:
    """The laws that fit a robot, compared on a workspace, the best first."""
    began = time.perf_counter()
    arm, chosen_tip = (robot, None) if isinstance(robot, Robot) else _loaded(robot, tip)
    task = position(arm, tip) if position_only else fitting_task(arm, tip if isinstance(robot, Robot) else None)
    say("start postures")
    starts, given = _starts(task, workspace, start)
    space = _proposed(task, starts[0]) if workspace is None else workspace
    names = ("tip", "start", "workspace")
    proposed = tuple(n for n, v in zip(names, (chosen_tip is None, start is not None, workspace is not None)) if not v)
    rough, fine = space.poses(SCREENED), space.poses(LOOKED_AT)
    motions = motions_of(task, fine)
    laws: list[Trial] = []
    fits = candidates(task, starts)
    for candidate in fits:
        say(candidate.name)
        trials = tried(candidate, starts, rough, motions)
        if trials:
            laws.append(min(trials, key=lambda t: _order(t.coverage, t.margin, t.least_rcond, float(np.nanmean(t.speed)) if t.served.any() else np.inf)))
    laws = [t for law in laws for t in tried(replace(law.candidate, level=None), law.start[None], fine, motions)]
    floor = np.nanmin([np.where(t.served, least_speed(task, t.q, motions), np.nan) for t in laws], axis=0)
    ranked = [_law(t, floor) for t in laws]
    ranked.sort(key=lambda law: _order(law.coverage, law.margin, law.rcond, law.speed))
    return Advice(task, space, starts[0], proposed, tuple(ranked), fine, float(np.nanmean(floor)), time.perf_counter() - began)


def _loaded(name: str | Path, tip: str | None) -> tuple[Robot, str | None]:
    """The robot, and its tip where that was chosen here."""
    if Path(name).suffix.lower() != ".urdf" or tip is not None:
        return load(name, tip=tip), None
    chosen = choose_tip(name)
    return load(name, tip=chosen), chosen


def _order(coverage: float, margin: float, rcond: float, speed: float) -> tuple[float, bool, float]:
    """Before which law another stands: by coverage, then the ones that keep away from limits, then by speed."""
    return -round(coverage / EQUAL), not (margin > ROOM and rcond > REGULAR), speed


def _law(trial: Trial, floor: Vector) -> Law:
    candidate, task = trial.candidate, trial.candidate.task
    strategy = candidate.strategy or radial(moore_penrose(task), trial.start)
    rows = trial.margins[trial.served]
    joint = task.robot.joint_names[int(np.argmin(rows.min(axis=0)))] if len(rows) else ""
    return Law(candidate.name, dict(candidate.keys), strategy, trial.start, trial.coverage, trial.margin, joint, trial.least_rcond, trial.ratio(floor), trial.served)


def motions_of(task: Task, poses: Array) -> Motions:
    """The directions in which poses (k, 4, 4) vary."""
    from scipy.spatial.transform import Rotation

    p, R = poses[:, :3, 3], poses[:, :3, :3]
    turns = Rotation.from_matrix(R @ R[0].T).as_rotvec()
    x = np.hstack([p, turns])[:, list(task.rows)]
    rows = np.array(task.rows)
    spread = []
    blocks = []
    for block in (rows < 3, rows > 2):
        values = x[:, block] - x[:, block].mean(axis=0)
        if not block.any():
            continue
        _, s, axes = np.linalg.svd(values, full_matrices=False)
        size = s / len(x) ** 0.5
        keep = size > 1e-6
        out = np.zeros((task.m, int(keep.sum())))
        out[block] = axes[keep].T
        blocks.append(out)
        spread.append(float(np.sqrt(np.mean(size[keep] ** 2))) if keep.any() else 0.0)
    if len(blocks) == 2 and min(spread) > 0:
        blocks[1] = blocks[1] * spread[1] / spread[0]
    return Motions(np.hstack(blocks), np.ones(task.n))


def _starts(task: Task, space: Workspace | None, start: ArrayLike | None) -> tuple[Matrix, bool]:
    if start is not None:
        q0 = task.robot.checked(start, "the start posture")
        task.robot.check_limits(q0)
        return q0[None], True
    if space is None:
        found = regular_starts(task)
        q0 = found[int(np.argmax([comfort(task, q) for q in found]))]
        return np.vstack([q0, postures_at(task, task.robot.pose(q0, task.tip))]), False
    for pose in [space.center, *space.poses(16)]:
        found = postures_at(task, pose)
        if len(found):
            return found, False
    raise ArgumentError("the workspace", str(space), "no posture within the joint limits has the tool there: move it nearer to the base")


def _proposed(task: Task, start: Vector) -> PoseRange:
    """A box round the tool at a start posture, with its orientation and a little about it."""
    robot = task.robot
    pose = robot.pose(start, task.tip)
    reach = sum(float(np.linalg.norm(joint.placement[:3, 3])) for joint in robot.joints)
    half = PROPOSED * reach * np.array([1.0, 1.0, 0.0 if robot.planar else 1.0])
    return pose_range(box=(pose[:3, 3], half), rotation=pose[:3, :3], tilt=0.0 if robot.planar else 0.3, spin=0.5)
