"""What `follow` and `drive` walk along: the targets and task rates of one cycle, and the record of a walk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..path import Path, Samples
from ..task import Task
from ..trajectory import Measures, Status, Trajectory
from ..types import Array, Indices, Matrix, Vector


@dataclass(frozen=True, eq=False)
class Plan:
    """One cycle of a path in at least `samples` steps. Arrays over the steps are made when first asked for."""

    path: Path
    task: Task
    samples: int
    start_rotation: Matrix

    @cached_property
    def counts(self) -> Indices:
        """Steps of each of the path's segments."""
        return self.path.counts(self.samples)

    @property
    def steps(self) -> int:
        """Steps a cycle."""
        return int(self.counts.sum())

    @cached_property
    def first(self) -> tuple[Vector, Matrix]:
        """Position (3,) and rotation (3, 3) at the start."""
        at = self.path.on(np.zeros(1, dtype=int), np.zeros(1))
        return at.position[0], at.rotation[0] @ self.start_rotation

    @cached_property
    def h(self) -> Vector:
        """Length of each step [s]."""
        return np.repeat(self.path.durations / self.counts, self.counts)

    @cached_property
    def t(self) -> Vector:
        """Time at the end of each step [s]."""
        return self.path.times(self.counts)

    @cached_property
    def position(self) -> Matrix:
        """Wanted positions (steps, 3) at the ends of the steps."""
        return self._ends.position

    @cached_property
    def rotation(self) -> Array:
        """Wanted rotations (steps, 3, 3) at the ends of the steps."""
        return self._ends.rotation @ self.start_rotation

    @cached_property
    def rates(self) -> tuple[Matrix, Matrix, Matrix]:
        """Task rates x' (steps, m) at the starts, middles and ends of the steps.

        Raises:
            SingularityError: the path turns through a singularity of the task's representation.
        """
        segment, u0, u1 = self._grid
        return tuple(self._rates_at(self.path.on(segment, u)) for u in (u0, (u0 + u1) / 2, u1))  # type: ignore[return-value]

    def target(self, step: int, share: float) -> tuple[Vector, Matrix]:
        """Position (3,) and rotation (3, 3) at a share in [0, 1] of a step."""
        if share == 1.0:
            return self.position[step], self.rotation[step]
        segment, u0, u1 = self._grid
        u = u0[step] + share * (u1[step] - u0[step])
        at = self.path.on(segment[step : step + 1], np.array([u]))
        return at.position[0], at.rotation[0] @ self.start_rotation

    def rates_at_ends(self) -> Matrix:
        """x' (steps + 1, m) at the start and at the end of each step. Raises: SingularityError."""
        return np.vstack(
            [self._rates_at(self.path.on(np.zeros(1, dtype=int), np.zeros(1))), self._rates_at(self._ends)]
        )

    def _rates_at(self, at: Samples) -> Matrix:
        return self.task.rates(at.rotation @ self.start_rotation, at.velocity, at.angular)

    @cached_property
    def _grid(self) -> tuple[Indices, Vector, Vector]:
        return self.path.steps(self.samples)

    @cached_property
    def _ends(self) -> Samples:
        segment, _, u1 = self._grid
        return self.path.on(segment, u1)


def make_plan(task: Task, path: Path, samples: int, start_rotation: Matrix) -> Plan:
    """Plan one run of a path in at least `samples` steps. Raises: ArgumentError."""
    plan = Plan(path, task, samples, start_rotation)
    plan.counts  # noqa: B018  so that a bad number of samples is told here
    return plan


def record(
    task: Task,
    plan: Plan,
    q: Matrix,
    dq: Matrix | Callable[[], Matrix],
    cycles: int,
    status: Status,
    residual: Callable[[], Vector] | None = None,
) -> Trajectory:
    """The trajectory of postures q (k + 1, n) at the start and the plan's samples; the rest is measured when asked."""
    robot = task.robot
    count, steps = len(q) - 1, plan.steps
    index = np.arange(count) % steps
    t = np.empty(count + 1)
    t[0] = 0.0
    for lap in range(-(-count // steps)):
        here = slice(1 + lap * steps, 1 + min(count, (lap + 1) * steps))
        t[here] = plan.t[: here.stop - here.start] + lap * plan.path.duration

    def error() -> Matrix:
        p = np.vstack([plan.first[0][None], plan.position[index]])
        R = np.concatenate([plan.first[1][None], plan.rotation[index]])
        return task.error_batch(q, p, R)

    def sigma() -> Vector:
        J, _ = task.jacobian_batch(q)
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)

    measures = Measures(
        dq=dq if callable(dq) else lambda: dq,
        x=lambda: task.value_batch(q),
        error=error,
        sigma=sigma,
        residual=residual or (lambda: np.zeros(len(q))),
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
    )
