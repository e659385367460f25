"""`Plan`: what `follow` and `simulate` run along: the targets and task rates of one cycle of a path."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.errors import ArgumentError, StartError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Indices, Matrix, Vector
from ...path import Path, Samples, locate
from ...path.editing import AnyPath
from ...path.path import rotation_vector
from ...robot import doubtful_unit
from ...strategies.tasks.frame_task import free_directions, leaves_free
from ...strategies.tasks.task import Task, check_representation
from ...symbolic.native import FollowKernel

LOOKS, FEWEST = 64, 3
"""Places of a path at which it is looked how its angular rates change, and of each of its segments besides."""

DOUBT = 1.5
"""Factor on changes that are looked at: between the places they may be steeper."""

BLOCK = 1024
"""Steps whose targets are computed at once, and kept until others are wanted: memory does not grow with the steps."""


@dataclass(frozen=True, eq=False)
class _Block:
    """Some steps of a cycle: targets at their ends, their lengths [s], and task rates at starts, middles and ends."""

    position: Matrix
    rotation: Array
    h: Vector
    rates: tuple[Matrix, Matrix, Matrix]
    margin: Vector


@dataclass(frozen=True, eq=False)
class Plan:
    """One cycle of a path in at least `samples` steps. Arrays over all steps are made when first asked for."""

    path: AnyPath
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
        """Position (3F,) and rotation (3F, 3) of the F frames at the start."""
        sample = self.path.on(np.zeros(1, dtype=int), np.zeros(1))
        return sample.position[0], turned(sample.rotation, self.start_rotation)[0]

    @cached_property
    def h(self) -> Vector:
        """Length of each step [s]."""
        return np.repeat(self.path.durations / self.counts, self.counts)

    @cached_property
    def position(self) -> Matrix:
        """Wanted positions (steps, 3F) at the ends of the steps."""
        return self._ends.position

    @cached_property
    def rotation(self) -> Array:
        """Wanted rotations (steps, 3F, 3) at the ends of the steps."""
        return turned(self._ends.rotation, self.start_rotation)

    @cached_property
    def rates(self) -> tuple[Matrix, Matrix, Matrix]:
        """Task rates x' (steps, m) at the starts, middles and ends of the steps.

        Raises:
            SingularityError: the path turns through a singularity of the task's representation.
        """
        segment, u0, u1 = self._grid
        return tuple(self._rates_at(self.path.on(segment, u)) for u in (u0, (u0 + u1) / 2, u1))  # type: ignore[return-value]

    def target(self, step: int, share: float) -> tuple[Vector, Matrix]:
        """Position (3F,) and rotation (3F, 3) at a share in [0, 1] of a step."""
        if share == 1.0:
            block = self._block(step)
            return block.position[step % BLOCK], block.rotation[step % BLOCK]
        segment, u0, u1 = self._locate(np.array([step]))
        sample = self.path.on(segment, u0 + share * (u1 - u0))
        return sample.position[0], turned(sample.rotation, self.start_rotation)[0]

    def where(self, done: int) -> str:
        """Where the tool is after some steps, all cycles counted, in words."""
        cycle, step = divmod(done, self.steps)
        return f"in cycle {cycle + 1}, {100 * step / self.steps:.1f} % along the path"

    def bends(self, step: int) -> tuple[float, float]:
        """Bounds (of |d^2 p / du^2| [m], of the turn [rad]) of a step, u from 0 to 1 over it."""
        return self._bends[int(np.searchsorted(self._last, step))]

    @cached_property
    def _last(self) -> Indices:
        return np.cumsum(self.counts) - 1

    @cached_property
    def _bends(self) -> list[tuple[float, float]]:
        segments = len(self.counts)
        bounds = np.linalg.norm(self.table[:, -2:].reshape(-1, segments, 2), axis=0)
        return [(bend / k**2, sway / k) for (bend, sway), k in zip(bounds.tolist(), self.counts.tolist(), strict=True)]

    @cached_property
    def table(self) -> Matrix:
        """The path's table, those of all frames in turn; of a task that leaves something free with what it sees of the
        bends and of the turns, so that a path of free motion alone stands still."""
        rows = self.path.table(self.start_rotation)
        if leaves_free(self.task):
            for f, frame in enumerate(rows.reshape(self.task.frames, -1, rows.shape[1])):
                mine = [row - 6 * f for row in self.task.rows if row // 6 == f]
                unseen = [i for i in (0, 1, 2) if i not in mine]
                if unseen:
                    _see_position(frame, unseen)
                self._see_turn(frame, f, sum(row > 2 for row in mine))
        return rows

    def _see_turn(self, rows: Matrix, f: int, angular: int) -> None:
        """Leave out of the turns of a frame's table those that its angular rows, so many, do not see.

        About a free direction d an even turn w has d'' = w x (w x d), as large at all places. Of other turns `DOUBT`
        times the steepest change of the rates x' from place to place is looked at.
        """
        if not angular:
            rows[:, -1] = 0.0
        if not 0 < angular < 3 or not rows[:, 19:31].any():
            return
        direction = free_directions(self.task)[f]
        if direction is not None and not rows[:, 25:31].any():
            axis, of_base = direction
            w, d = rows[:, 22:25], axis[None] if of_base else rows[:, 31:40].reshape(-1, 3, 3) @ axis
            across = w[:, [1, 2, 0]] * d[:, [2, 0, 1]] - w[:, [2, 0, 1]] * d[:, [1, 2, 0]]
            rows[:, -1] = ((w * w).sum(axis=1) * (across * across).sum(axis=1)) ** 0.25
            return
        looks = FEWEST + LOOKS // len(rows)
        of_turn = [i for i, row in enumerate(self.task.rows) if row // 6 == f and self.task._angular[i]]
        changes = np.diff(self._rates_in(looks)[:, :, of_turn], axis=1) * (looks - 1)
        bend = DOUBT * np.linalg.norm(changes, axis=2).max(axis=1)
        less = bend < 2 * rows[:, -1] ** 2  # not where it is not a number
        rows[less, -2] += bend[less]
        rows[less, -1] = 0.0

    def _rates_in(self, looks: int) -> Array:
        """x' by the share of a segment (s, looks, m) at even places of it; NaN where the representation is singular."""
        count = len(self.path.durations)
        samples = self.path.on(np.repeat(np.arange(count), looks), np.tile(np.linspace(0.0, 1.0, looks), count))
        rates, margins = self._task_rates(samples)
        rates[~(margins > TOLERANCES.representation)] = np.nan
        return rates.reshape(count, looks, -1) * self.path.durations[:, None, None]

    def ends(self, step: Indices) -> Vector:
        """Times at the ends of steps [s]."""
        segment, _, u = self._locate(step)
        return self.path.starts[segment] + u * self.path.durations[segment]

    def step_rates(self, step: int) -> tuple[float, Vector, Vector, Vector]:
        """(length [s], task rates x' (m,) at start, middle and end) of a step.

        Raises:
            SingularityError: the path turns through a singularity of the task's representation there.
        """
        block, i = self._block(step), step % BLOCK
        if not block.margin[i] > TOLERANCES.representation:
            self._check(block.margin[i])
        x0, x1, x2 = block.rates
        return float(block.h[i]), x0[i], x1[i], x2[i]

    def _block(self, step: int) -> _Block:
        first = step - step % BLOCK
        if first not in self._memory:
            segment, u0, u1 = self._locate(np.arange(first, min(first + BLOCK, self.steps)))
            samples = [self.path.on(segment, u) for u in (u0, (u0 + u1) / 2, u1)]
            rates, margins = zip(*map(self._task_rates, samples), strict=True)
            end, h = samples[2], self.path.durations[segment] / self.counts[segment]
            self._memory.clear()
            rotation = turned(end.rotation, self.start_rotation)
            self._memory[first] = _Block(end.position, rotation, h, rates, np.min(margins, axis=0))
        return self._memory[first]

    @cached_property
    def _memory(self) -> dict[int, _Block]:
        return {}

    def _locate(self, step: Indices) -> tuple[Indices, Vector, Vector]:
        return locate(self.counts, step)

    def rates_at_ends(self) -> Matrix:
        """x' (steps + 1, m) at the start and at the end of each step. Raises: SingularityError."""
        start = self.path.on(np.zeros(1, dtype=int), np.zeros(1))
        return np.vstack([self._rates_at(start), self._rates_at(self._ends)])

    def _rates_at(self, samples: Samples) -> Matrix:
        rates, margins = self._task_rates(samples)
        self._check(margins.min(initial=np.inf))
        return rates

    def _task_rates(self, samples: Samples) -> tuple[Matrix, Vector]:
        R = turned(samples.rotation, self.start_rotation)
        return self.task._tool_rates(R, samples.velocity, samples.angular)

    def _check(self, margin: float) -> None:
        check_representation(self.task, np.full(self.task.n, np.nan), margin)

    @cached_property
    def _grid(self) -> tuple[Indices, Vector, Vector]:
        return self._locate(np.arange(self.steps))

    @cached_property
    def _ends(self) -> Samples:
        segment, _, u1 = self._grid
        return self.path.on(segment, u1)


def _see_position(rows: Matrix, unseen: list[int]) -> None:
    """Leave out of the bends of a frame's table the coordinates that a task does not see."""
    curve = np.hstack([rows[:, 3:9], rows[:, 10:19]]).reshape(-1, 5, 3)
    if not curve[:, :, unseen].any():
        return
    curve[:, :, unseen] = 0.0
    x, y, _, b, c = np.moveaxis(curve, 1, 0)
    cubic = np.maximum(np.linalg.norm(2 * b, axis=1), np.linalg.norm(2 * b + 6 * c, axis=1))
    rows[:, -2] = rows[:, 9] ** 2 * np.linalg.norm(np.hstack([x, y]), axis=1) + cubic


def turned(rotations: Array, start: Matrix) -> Array:
    """The rotations (k, 3F, 3) of F frames that were turned by a path, from those (3F, 3) at its start."""
    each = rotations.reshape(len(rotations), -1, 3, 3) @ start.reshape(-1, 3, 3)
    return each.reshape(rotations.shape)


def make_plan(task: Task, path: AnyPath, samples: int, start_rotation: Matrix) -> Plan:
    """Plan one run of a path in at least `samples` steps, from the path's own rotations if it has any, or from others.

    Raises:
        ArgumentError.
    """
    paths = (path,) if isinstance(path, Path) else path.paths
    if len(paths) != task.frames:
        several = f"give {task.frames} of them, one a frame of the task, by hk.path.synchronized"
        raise ArgumentError("the number of paths", len(paths), several if task.frames > 1 else "give one")
    begun = start_rotation.reshape(-1, 3, 3)
    own = [R if part.rotation is None else part.rotation for part, R in zip(paths, begun, strict=True)]
    plan = Plan(path, task, samples, np.vstack(own))
    plan.counts  # noqa: B018  so that a bad number of samples is told here
    return plan


def _doubtful_target(task: Task, position: Array) -> str:
    """What to say of target positions (..., 3F) that are all too far away to be in metres; empty of others."""
    return doubtful_unit(task.robot, position.reshape(-1, 3), task.tip) if task._spatial else ""


def check_start(task: Task, q: Vector, p: Vector, R: Matrix) -> None:
    """Raises: StartError unless the tool at a posture is at the start (p, R) of a path, in all rows of its task."""
    off = float(np.abs(task.error(q, p, R)).max())
    if off > TOLERANCES.start:
        position, tools = task._place(q)
        gaps = R.reshape(-1, 3, 3) @ np.swapaxes(tools.reshape(-1, 3, 3), 1, 2)
        angle = float(np.linalg.norm(rotation_vector(gaps), axis=-1).max())
        raise StartError(off, position, p, _doubtful_target(task, p), angle)


class NativeFollower:
    """A kernel on its path along a plan; `x` is its memory, which begins with the posture.

    halted: raises why it did fewer steps than asked, where that is known; else a step in Python tells it.
    """

    def __init__(
        self,
        kernel: FollowKernel,
        plan: Plan,
        x: Vector,
        rules: ctypes.Structure,
        limits: bool,
        halted: Callable[[], None] = lambda: None,
    ) -> None:
        self.halted = halted
        robot, n, slack = plan.task.robot, plan.task.n, TOLERANCES.limit
        p, R = plan.first
        self._kernel, self._x, self._rules = kernel, x, rules
        self._segments = plan.table
        self._counts = np.array([*plan.counts, 0], dtype=np.int64)
        self._home = np.concatenate([p, R.ravel()]) if plan.path.closed else None
        span = np.full(n, np.inf)
        self._limits = (robot.lower - slack, robot.upper + slack) if limits else (-span, span)

    def run(self, q: Vector, first: int, last: int, Q: Matrix) -> int:
        """Steps [first, last) of a cycle from q into the rows of Q; returns how many were done before a halt."""
        self._x[: len(q)] = q
        path = self._segments, self._counts, self._home
        return self._kernel(*path, self._x, (first, last), self._limits, self._rules, Q)
