"""What `follow` and `drive` walk along: the targets and task rates of one cycle, and the record of a walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..path import Path, Samples
from ..task import Task
from ..trajectory import Status, Trajectory
from ..types import Array, Indices, Matrix, Vector


@dataclass(frozen=True, eq=False)
class Plan:
    """One cycle in k steps: targets at their ends, task rates x' (k, m) at their starts, middles and ends."""

    path: Path
    task: Task
    start_rotation: Matrix
    segment: Indices
    u_start: Vector
    u_stop: Vector
    h: Vector
    t: Vector
    position: Matrix
    rotation: Array
    first: tuple[Vector, Matrix]
    rates: tuple[Matrix, Matrix, Matrix]

    @property
    def steps(self) -> int:
        """Steps a cycle."""
        return len(self.h)

    def target(self, step: int, share: float) -> tuple[Vector, Matrix]:
        """Position (3,) and rotation (3, 3) at a share in [0, 1] of a step."""
        if share == 1.0:
            return self.position[step], self.rotation[step]
        u = self.u_start[step] + share * (self.u_stop[step] - self.u_start[step])
        at = self.path.on(self.segment[step : step + 1], np.array([u]))
        return at.position[0], at.rotation[0] @ self.start_rotation


def make_plan(task: Task, path: Path, samples: int, start_rotation: Matrix) -> Plan:
    """Plan one run of a path in at least `samples` steps.

    Raises:
        SingularityError: the path turns through a singularity of the task's representation.
    """
    segment, u0, u1 = path.steps(samples)
    starts, middles, ends = (path.on(segment, u) for u in (u0, (u0 + u1) / 2, u1))

    def rates(at: Samples) -> Matrix:
        return task.rates(at.rotation @ start_rotation, at.velocity, at.angular)

    return Plan(
        path=path,
        task=task,
        start_rotation=start_rotation,
        segment=segment,
        u_start=u0,
        u_stop=u1,
        h=ends.t - starts.t,
        t=ends.t,
        position=ends.position,
        rotation=ends.rotation @ start_rotation,
        first=(starts.position[0], starts.rotation[0] @ start_rotation),
        rates=(rates(starts), rates(middles), rates(ends)),
    )


def record(
    task: Task, plan: Plan, q: Matrix, dq: Matrix, cycles: int, status: Status, residual: Vector | None = None
) -> Trajectory:
    """The trajectory of postures q (k + 1, n) and rates dq (k + 1, n) at the start and the plan's samples."""
    robot = task.robot
    count, steps = len(q) - 1, plan.steps
    index = np.arange(count) % steps
    lap = np.arange(count) // steps
    t = np.concatenate([[0.0], plan.t[index] + lap * plan.path.duration])
    p = np.vstack([plan.first[0][None], plan.position[index]])
    R = np.concatenate([plan.first[1][None], plan.rotation[index]])
    J, _ = task.jacobian_batch(q)
    return Trajectory(
        joint_names=robot.joint_names,
        joint_units=tuple(c.unit for c in robot.coordinates),
        row_names=task.row_names,
        row_units=task.units,
        t=t,
        q=q,
        dq=dq,
        x=task.value_batch(q),
        error=task.error_batch(q, p, R),
        sigma=np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float),
        residual=np.zeros(len(q)) if residual is None else residual,
        marks=tuple(range(0, min(cycles * steps, count) + 1, steps)),
        status=status,
    )
