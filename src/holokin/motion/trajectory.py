"""`Trajectory`: what the joints did along a path. Data only, with residuals that it can show for itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cached_property, partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import check, typed
from ..base.errors import ArgumentError, NotFiniteError, ShapeError
from ..base.files import write_csv
from ..base.types import Indices, Matrix, NoTruthValue, Result, Value, Vector, frozen, numbers
from ..base.units import SI, PrintedUnits
from ..robot import Robot
from ..strategies.tasks.task import Task
from .ik.plan import BLOCK, Plan


def whole_turns(difference: Matrix | Vector, units: tuple[str, ...], tolerance: float = 1e-6) -> Indices:
    """Whole turns k of each hinge in joint differences (..., n) within the tolerance [rad] of 2 pi k; else 0."""
    turns = np.round(difference / (2 * np.pi))
    whole = (np.abs(difference - 2 * np.pi * turns) <= tolerance) & (np.array(units) == "rad")
    return np.where(whole, turns, 0.0).astype(int)


class Status(NoTruthValue, Enum, ask="`is Status.COMPLETE`"):
    """How a trajectory ended; the text names cause and cure."""

    COMPLETE = "followed to the end"
    LIMIT = "stopped at a joint limit; choose another start, path or strategy"
    OUT_OF_REACH = "stopped: the path leaves the workspace; move or shrink it"
    SINGULAR = "stopped at a singularity of the strategy; choose another constraint, leaf or path"
    BRANCH = "stopped where the leaf folds back; choose another constraint or leaf"
    JUMP = "stopped where g jumps; choose a constraint whose formula does not jump there, or mark angles as angular"
    FAULT = "stopped: the controller threw, blocked or returned no finite rates; correct the controller"
    LOST = "stopped: integration lost the path; use more samples"

    @property
    def cause(self) -> str:
        """The text without its cure."""
        return self.value.partition(";")[0]


@dataclass(frozen=True, eq=False)
class Measures:
    """How the metrics of the first samples of a trajectory are found: each is asked for when somebody wants it."""

    dq: Callable[[int], Matrix]
    x: Callable[[int], Matrix]
    error: Callable[[int], Matrix]
    sigma: Callable[[int], Vector]
    residual: Callable[[int], Vector]


def _first_rows(values: Matrix, count: int) -> Matrix:
    return values[:count]


@dataclass(frozen=True, eq=False)
class Trajectory(NoTruthValue, Value, ask="`.status`"):
    """Joint motion of a robot at k instants.

    t (k,) [s]; q (k, n) [joint units]; marks: indices at which cycles begin, and the last one ends; corners: indices at
    which the tool's direction jumps, the marks among them where a closed path ends in another direction than it starts.
    """

    robot: Robot
    joint_units: tuple[str, ...]
    row_names: tuple[str, ...]
    row_units: tuple[str, ...]
    t: Vector
    q: Matrix
    marks: tuple[int, ...]
    status: Status
    measures: Measures
    corners: tuple[int, ...] = ()

    def __repr__(self) -> str:
        joints = ", ".join(self.joint_names)
        return f"Trajectory({len(self)} samples, {self.cycles} cycles, {self.status.name}, {joints})"

    def __str__(self) -> str:
        seconds = float(self.t[-1]) if len(self) else 0.0
        cycles = f"{self.cycles} cycle{'s' * (self.cycles != 1)}"
        return f"{self.status.cause}: {len(self):,} samples, {cycles} in {seconds:.6g} s"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return self.robot.joint_names

    def _shown_rows(self) -> list[Sequence[str]]:
        """How it ended, and from where to where each joint went."""
        rows: list[Sequence[str]] = [("status", self.status.name.lower().replace("_", " "))]
        rows += [("samples", f"{len(self):,}"), ("whole cycles", str(self.cycles)), ("joint", "from", "to", "between")]
        for name, unit, q in zip(self.joint_names, self.joint_units, self.q.T if len(self) else (), strict=False):
            rows.append((name, f"{q[0]:.4f} {unit}", f"{q[-1]:.4f} {unit}", f"{q.min():.4f} and {q.max():.4f} {unit}"))
        return rows

    def __getstate__(self) -> dict[str, Any]:
        """All metrics as plain data, measured now."""
        names = (field.name for field in fields(Measures))
        return super().__getstate__() | {
            "measures": Measures(**{n: partial(_first_rows, getattr(self, n)) for n in names})
        }

    @cached_property
    def dq(self) -> Matrix:
        """Joint rates (k, n) [joint units per s]."""
        return frozen(self.measures.dq(len(self)))

    @cached_property
    def x(self) -> Matrix:
        """Task values (k, m)."""
        return frozen(self.measures.x(len(self)))

    @cached_property
    def error(self) -> Matrix:
        """Wanted minus reached (k, m) [m, rad]."""
        return frozen(self.measures.error(len(self)))

    @cached_property
    def sigma(self) -> Vector:
        """Smallest singular value of J (k,)."""
        return frozen(self.measures.sigma(len(self)))

    @cached_property
    def residual(self) -> Vector:
        """Largest |g - c| (k,); zero for a strategy without constraint."""
        return frozen(self.measures.residual(len(self)))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def cycles(self) -> int:
        """Number of complete cycles."""
        return len(self.marks) - 1

    def drift(self) -> Matrix:
        """Joint drift of each complete cycle (cycles, n): q at its end minus q at its start."""
        return np.diff(self.q[list(self.marks)], axis=0)

    def drift_since_start(self) -> Matrix:
        """Joint drift after 1, 2, ... cycles (cycles, n): q at the end of each minus the start posture."""
        return self.q[list(self.marks[1:])] - self.q[0]

    @typed
    def until(self, count: int) -> Trajectory:
        """The first samples of it, and the cycles that end among them; no more than these are measured."""
        marks, corners = (tuple(k for k in indices if k < count) for indices in (self.marks, self.corners))
        return replace(self, t=self.t[:count], q=self.q[:count], marks=marks, corners=corners)

    def turns(self) -> Indices:
        """Whole turns of each hinge after 1, 2, ... cycles (cycles, n): what `whole_turns` of the drift says."""
        return whole_turns(self.drift_since_start(), self.joint_units)

    @typed
    def tracking_error(self, unit: str = "m") -> float:
        """Largest task error over all samples: norm of the rows in "m", or of those in "rad", or in a unit of your own.

        Raises:
            ArgumentError: another unit.
        """
        known = tuple(dict.fromkeys(("m", "rad", *self.row_units)))
        if unit not in known:
            raise ArgumentError("unit", unit, f"use {' or '.join(map(repr, known))}")
        rows = [i for i, u in enumerate(self.row_units) if u == unit]
        return float(np.linalg.norm(self.error[:, rows], axis=1).max()) if rows and len(self) else 0.0

    @typed
    def printed(self, units: PrintedUnits) -> Trajectory:
        """The same motion with its values in other units, to be printed."""
        joints, rows = units.factors(self.joint_units), units.factors(self.row_units)
        measures = replace(
            self.measures,
            dq=lambda count: self.dq[:count] * joints,
            x=lambda count: self.x[:count] * rows,
            error=lambda count: self.error[:count] * rows,
        )
        joint_units, row_units = (tuple(map(units.name, of)) for of in (self.joint_units, self.row_units))
        return replace(self, joint_units=joint_units, row_units=row_units, q=self.q * joints, measures=measures)

    @typed
    def save(self, path: str | FilePath, units: PrintedUnits = SI) -> None:
        """Write CSV: t, the joints (names as in the robot), their rates as d_NAME, the task rows as x_NAME.

        Full precision, one line a sample, complete or not at all. In units other than rad and m the header names them:
        "NAME [deg]".

        Raises:
            WriteError: the system refuses the file.
        """
        header = ["t", *self.joint_names, *(f"d_{name}" for name in self.joint_names)]
        header += [f"x_{name}" for name in self.row_names]
        if units.plain:
            write_csv(path, header, np.column_stack([self.t, self.q, self.dq, self.x]).tolist())
            return
        seen = self.printed(units)
        named = ["s", *seen.joint_units, *(f"{unit}/s" for unit in seen.joint_units), *seen.row_units]
        header = [f"{name} [{unit}]" for name, unit in zip(header, named, strict=True)]
        write_csv(path, header, np.column_stack([seen.t, seen.q, seen.dq, seen.x]).tolist())


def trajectory_of(
    task: Task,
    t: Vector,
    q: Matrix,
    dq: Callable[[int], Matrix],
    *,
    marks: tuple[int, ...],
    status: Status = Status.COMPLETE,
    error: Callable[[int], Matrix] | None = None,
    residual: Callable[[int], Vector] | None = None,
    corners: tuple[int, ...] = (),
) -> Trajectory:
    """The trajectory of postures q (k, n) at times t (k,) of a robot with a task; metrics are measured when asked."""

    def sigma(samples: int) -> Vector:
        J, _ = task.jacobian_batch(q[:samples])
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)

    measures = Measures(
        dq=dq,
        x=lambda samples: task.value_batch(q[:samples]),
        error=error or (lambda samples: np.zeros((samples, task.m))),
        sigma=sigma,
        residual=residual or np.zeros,
    )
    names = task.joint_units, task.row_names, task.units
    return Trajectory(task.robot, *names, t, q, marks, status, measures, corners)


def record(
    task: Task,
    plan: Plan,
    q: Matrix,
    dq: Callable[[int], Matrix],
    cycles: int,
    status: Status,
    residual: Callable[[int], Vector] | None = None,
) -> Trajectory:
    """The trajectory of postures q (k + 1, n) at the start and the plan's samples; the rest is measured when asked."""
    count, steps = len(q) - 1, plan.steps
    # The times of the samples, a block at a time.
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

    # The samples at the corners of the path, in every cycle.
    first = np.concatenate([[0], np.cumsum(plan.counts)])[list(plan.path.corners)]
    corners = np.add.outer(steps * np.arange(count // steps + 1), first).ravel().tolist()
    marks = tuple(range(0, min(cycles * steps, count) + 1, steps))
    corners = tuple(k for k in corners if k <= count)
    return trajectory_of(task, t, q, dq, marks=marks, status=status, error=error, residual=residual, corners=corners)


GAP = 10.0
"""A step longer than this many median steps is a gap: something is missing there."""


@dataclass(frozen=True, eq=False)
class Recording(Result, Value):
    """Joint positions as logged: t (k,) [s], rising; q (k, n) [rad or m] in the order of `joint_names`.

    `notes` says what was changed or left out in reading. unknown_turns (p, 2): rows (i, joint), where from sample i to
    the next that joint may have made whole turns that its values do not show; None where nobody looked for them.
    """

    joint_names: tuple[str, ...]
    t: Vector
    q: Matrix
    source: str
    notes: tuple[str, ...] = ()
    unknown_turns: Indices | None = None

    def __post_init__(self) -> None:
        for name in ("t", "q"):
            object.__setattr__(self, name, numbers(f"{name} of a recording", getattr(self, name)))
        check("joint_names", tuple[str, ...], self.joint_names)
        super().__post_init__()
        if self.t.ndim != 1:
            raise ShapeError("t of a recording", ("k",), self.t.shape)
        if self.q.shape != (len(self.t), len(self.joint_names)):
            raise ShapeError("q of a recording", (len(self.t), len(self.joint_names)), self.q.shape)
        for what, values in (("t of a recording", self.t), ("q of a recording", self.q)):
            if not np.isfinite(values).all():
                raise NotFiniteError(what, values[~np.isfinite(values)][:3].tolist())
        if len(self.t) > 1 and not (np.diff(self.t) > 0).all():
            raise ArgumentError("a step of t", float(np.diff(self.t).min()), "give rising times in seconds")

    def __str__(self) -> str:
        samples = f"{len(self):,} samples of {', '.join(self.joint_names)} from {self.source}"
        return "; ".join([samples, *self.notes])

    def __len__(self) -> int:
        return len(self.t)

    @typed
    def part(self, first: int, last: int) -> Recording:
        """The samples from one to before another."""
        places = self.unknown_turns
        if places is not None:
            inside = (places[:, 0] >= first) & (places[:, 0] < last - 1)
            places = places[inside] - np.array([first, 0])
        return replace(self, t=self.t[first:last], q=self.q[first:last], unknown_turns=places)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def rate(self) -> float:
        """Samples a second, of the median step [Hz]."""
        return float(1 / np.median(np.diff(self.t)))

    @cached_property
    def gaps(self) -> Indices:
        """Indices i at which the step from sample i to i + 1 is over `GAP` median steps."""
        steps = np.diff(self.t)
        return frozen(np.flatnonzero(steps > GAP * np.median(steps)))


def over_least_speed(task: Task, walk: Trajectory) -> float:
    """Joint speed (rms) over that of the pseudo-inverse at the same postures; NaN where the tool does not move."""
    J, _ = task.jacobian_batch(walk.q)
    minimum_norm = np.linalg.pinv(J) @ (J @ walk.dq[:, :, None])
    size = float(np.linalg.norm(minimum_norm))
    return float(np.linalg.norm(walk.dq)) / size if size > 0 else np.nan
