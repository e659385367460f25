"""The trajectory of a run: its postures along a plan, and what is measured of them when somebody asks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.types import Matrix, Vector
from ..strategies.tasks.task import Task
from .ik.plan import BLOCK, Plan
from .trajectory import Measures, Status, Trajectory


def record(
    task: Task,
    plan: Plan,
    q: Matrix,
    dq: Matrix | Callable[[int], Matrix],
    cycles: int,
    status: Status,
    residual: Callable[[int], Vector] | None = None,
) -> Trajectory:
    """The trajectory of postures q (k + 1, n) at the start and the plan's samples; the rest is measured when asked."""
    robot = task.robot
    count, steps = len(q) - 1, plan.steps
    t = np.empty(count + 1)
    t[0] = 0.0
    for first in range(0, count, BLOCK):
        lap, step = np.divmod(np.arange(first, min(first + BLOCK, count)), steps)
        t[1 + first : 1 + first + len(step)] = plan.ends(step) + lap * plan.path.duration
    t.flags.writeable = False  # the trajectory keeps it as it is

    def error(samples: int) -> Matrix:
        index = np.arange(samples - 1) % steps
        p = np.vstack([plan.first[0][None], plan.position[index]])[:samples]
        R = np.concatenate([plan.first[1][None], plan.rotation[index]])[:samples]
        return task.error(q[:samples], p, R)

    def sigma(samples: int) -> Vector:
        J, _ = task.jacobian_batch(q[:samples])
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)

    first = np.concatenate([[0], np.cumsum(plan.counts)])[list(plan.path.corners)]
    corners = np.add.outer(steps * np.arange(count // steps + 1), first).ravel().tolist()
    measures = Measures(
        dq=dq if callable(dq) else lambda samples: dq[:samples],
        x=lambda samples: task.value_batch(q[:samples]),
        error=error,
        sigma=sigma,
        residual=residual or np.zeros,
    )
    return Trajectory(
        joint_names=robot.joint_names,
        joint_units=tuple(c.unit for c in robot.coordinates),
        row_names=task.row_names,
        row_units=task.units,
        t=t,
        q=q,
        marks=tuple(range(0, min(cycles * steps, count) + 1, steps)),
        status=status,
        measures=measures,
        corners=tuple(k for k in corners if k <= count),
    )
