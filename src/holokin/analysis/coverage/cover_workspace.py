"""`coverage`: how much of a workspace one leaf reaches, how well, and why the rest is not reached."""

from __future__ import annotations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ShapeError
from ...base.progress import progress
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Indices, Matrix, Vector
from ...motion.ik import InverseStatus, inverse, leaf_value
from ...motion.ik.leaf import leaf_step
from ...motion.ik.reach import nearest_postures
from ...path.segments import turn_between
from ...path.workspaces import PoseRange, Workspace
from ...robot import check_metres, start_posture
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task, of_one_tool
from .coverage_result import Coverage, PoseStatus, Reach

SAMPLES = 1024
"""Poses by default: shares of two known sets were then right to 0.3 % in a plane and 0.6 % in six dimensions (rms over
200 seeds), where random poses have 1.4 %."""

BEHIND = 1e-6
"""How far behind the end of a way [joint units] a change of sign is looked for: ways end nearer to a singularity."""

PIECE = 256
"""Poses between two reports of progress."""

KINEMATIC = 1e-3
"""Smallest over largest singular value of J, in m and rad as they come, below which an arm that stops is singular: in a
Panda's box it was 5e-4 at most where the arm is stretched, and 4e-3 at least where a law alone is singular."""


@typed
def coverage(
    strategy: HolonomicStrategy,
    workspace: Workspace,
    q0: ArrayLike,
    *,
    samples: int | None = None,
    seed: int = 0,
    limits: bool = True,
    explain: bool = True,
    reach: Reach | None = None,
) -> Coverage:
    """How much of a workspace the leaf through a posture reaches, and why the rest is not reached.

    Each pose is gone to on the straight path from the tool pose at q0, as `inverse` does. Where the leaf does not get
    there within the limits, other postures of the arm are searched for, by least squares from random postures: so it
    shows whether the law fails there or no law can serve. A workspace that is out of reach altogether has the share 0.

    A task of positions looks at the positions of the poses alone.

    Args:
        samples: poses; by default 1024, or all those of a cloud.
        seed: of the poses, see `Workspace.poses`.
        limits: False leaves joint limits aside.
        explain: False does not search for other postures: faster, and no pose is called out of reach.
        reach: of the same poses, as `posture_reach` found it, to spare the search.

    Raises:
        JointLimitError: q0 is beyond its limits, unless limits is False. SingularityError: the law is singular there.
        ArgumentError: a strategy without leaves; rotations out of the plane for the pose task of a planar robot.
        ShapeError, NotFiniteError.
    """
    task, robot = strategy.task, strategy.task.robot
    of_one_tool(task, "coverage")
    start = start_posture(robot, q0, limits)
    count = samples if samples is not None else workspace.size or SAMPLES
    poses = workspace.poses(count, seed)
    check_metres(robot, poses, task.tip)
    if reach is not None and len(reach.within) != len(poses):
        raise ShapeError("the reach", (len(poses),), reach.within.shape, "give that of the same poses")
    _check_planar(task, start, poses)
    q, last, found = _gone_to(strategy, start, poses)
    on_leaf = found == InverseStatus.REACHED
    rcond, margins = np.full(len(poses), np.nan), np.full(q.shape, np.nan)
    if on_leaf.any():
        rcond[on_leaf] = strategy.gain.batch(q[on_leaf])[1]
        margins[on_leaf] = np.minimum(q[on_leaf] - robot.lower, robot.upper - q[on_leaf])
    status = np.where(on_leaf, PoseStatus.REACHED, PoseStatus.STOPPED).astype(int)
    if limits:
        status[on_leaf & (margins < -TOLERANCES.limit).any(axis=1)] = PoseStatus.LIMIT
    ended = np.flatnonzero(~on_leaf)
    status[ended] = _endings(strategy, poses[ended], last[ended], found[ended])
    if explain:
        rest = np.flatnonzero(status != PoseStatus.REACHED)
        if reach is None:
            known = _search(task, poses[rest], np.where(np.isfinite(last[rest]), last[rest], start), limits)
        else:
            known = Reach(reach.anyhow[rest], reach.within[rest])
        status[rest[~(known.within if limits else known.anyhow)]] = PoseStatus.BEYOND_LIMITS
        status[rest[~known.anyhow & ~on_leaf[rest]]] = PoseStatus.OUT_OF_REACH
    tool, units = task.pose(start), tuple("rad" if hinge else "m" for hinge in robot.hinges)
    return Coverage(
        strategy.name, workspace, robot.joint_names, units, robot.lower, robot.upper, start, tool,
        _turn(task, tool, workspace), poses, status, q, last, rcond, margins, limits, explain,
    )  # fmt: skip


def _gone_to(strategy: HolonomicStrategy, q0: Vector, poses: Array) -> tuple[Matrix, Matrix, Indices]:
    """Where the leaf through a posture leads at poses (k, 4, 4): its postures, where its paths end (k, n), statuses."""
    ik, n = inverse(strategy, q0, limits=False), strategy.task.n
    q, last, found = np.empty((len(poses), n)), np.empty((len(poses), n)), np.empty(len(poses), dtype=int)
    with progress(f"coverage: {strategy.name}", len(poses)) as report:
        for first in range(0, len(poses), PIECE):
            some = slice(first, first + PIECE)
            solutions = ik.batch(poses[some])
            q[some], last[some], found[some] = solutions.q, solutions.last, solutions.status
            report(first + len(solutions.status))
    return q, last, found


def _turn(task: Task, tool: Matrix, workspace: Workspace) -> float:
    """From a tool pose to the middle orientation [rad]; 0 for given poses, and where the task leaves it free."""
    if not isinstance(workspace, PoseRange) or all(row < 3 for row in task.rows):
        return 0.0
    return float(np.linalg.norm(turn_between(tool[:3, :3], workspace.rotation)))


@typed
def posture_reach(task: Task, workspace: Workspace, near: ArrayLike, *, samples: int = SAMPLES, seed: int = 0) -> Reach:
    """Which poses of a workspace the arm reaches by any posture: for several calls of `coverage` with the same poses.

    By least squares from a posture and from 64 random ones a pose; a pose that none of these leads to may still be
    reachable.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    poses = workspace.poses(samples, seed)
    of_one_tool(task, "coverage")
    check_metres(task.robot, poses, task.tip)
    begin = task.robot.checked(near, "the posture to begin from")
    return _search(task, poses, np.tile(begin, (len(poses), 1)), True)


def _search(task: Task, poses: Array, near: Matrix, limits: bool) -> Reach:
    p, R = poses[:, :3, 3], poses[:, :3, :3]
    anyhow = nearest_postures(task, p, R, near, limits=False).reached
    within = anyhow.copy()
    if limits and anyhow.any():
        within[anyhow] = nearest_postures(task, p[anyhow], R[anyhow], near[anyhow], limits=True).reached
    return Reach(anyhow, within)


def _endings(strategy: HolonomicStrategy, poses: Array, last: Matrix, found: Indices) -> Indices:
    """Why the paths to some poses ended at some postures."""
    status = np.full(len(last), int(PoseStatus.STOPPED))
    known = np.flatnonzero(np.isfinite(last).all(axis=1))
    if not len(known):
        return status
    s = np.linalg.svd(strategy.task.jacobian_batch(last[known])[0], compute_uv=False)
    margin = strategy.gain.batch(last[known])[2]
    kind = np.where(s[:, -1] > KINEMATIC * s[:, 0], PoseStatus.ALGORITHMIC, PoseStatus.KINEMATIC)
    undefined = margin < 2 * TOLERANCES.representation
    kind = np.where(undefined, PoseStatus.REPRESENTATION, kind)
    ends = undefined | np.isin(found[known], (InverseStatus.LEAF_ENDS, InverseStatus.SINGULAR))
    for i in np.flatnonzero(~ends):
        ends[i] = _folds(strategy, poses[known[i]], last[known[i]])
    status[known[ends]] = kind[ends]
    return status


def _folds(strategy: HolonomicStrategy, pose: Matrix, q: Vector) -> bool:
    """Whether det [J; J_g] changes its sign just behind a posture, on the way to a pose: [J; J_g] is singular there.

    It may be regular beside that place, where two sheets of a leaf cross.
    """
    gain, step, c = strategy.gain(q)[0], leaf_step(strategy), leaf_value(strategy, q)
    dq = np.reshape(gain, (len(q), -1)) @ strategy.task.error(q, pose[:3, 3], pose[:3, :3])
    size = float(np.abs(dq).max())
    if not 0 < size < np.inf:
        return False
    sides = [step(p, pose[:3, 3], pose[:3, :3], c)[3] for p in (q, q + BEHIND / size * dq)]
    return bool(sides[0] * sides[1] < 0)


def _check_planar(task: Task, q0: Vector, poses: Array) -> None:
    """Raises: ArgumentError where the tool of a planar robot would have to leave its plane."""
    if not task.robot.planar or all(row < 3 for row in task.rows):
        return
    R = task.pose(q0)[:3, :3]
    if np.abs(poses[:, :3, :3] @ R.T - np.eye(3))[:, 2, 2].max() > 1e-6:
        cure = "the tool of a planar robot turns in its plane: give rotation=np.eye(3) (or the tool's own) and no tilt"
        raise ArgumentError("the rotation of a pose of the workspace", poses[0, :3, :3].tolist(), cure)
