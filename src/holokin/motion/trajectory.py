"""`Trajectory`: what the joints did along a path. Data only, with residuals that it can show for itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cached_property, partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.files import write_csv
from ..base.printed_units import SI, PrintedUnits
from ..base.types import Indices, Matrix, NoTruthValue, Value, Vector, frozen


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


def _known(values: Matrix, count: int) -> Matrix:
    return values[:count]


@dataclass(frozen=True, eq=False)
class Trajectory(NoTruthValue, Value, ask="`.status`"):
    """Joint motion at k instants.

    t (k,) [s]; q (k, n) [joint units]; marks: indices at which cycles begin, and the last one ends; corners: indices at
    which the tool's direction jumps, the marks among them where a closed path ends in another direction than it starts.
    """

    joint_names: tuple[str, ...]
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
        return (
            f"Trajectory({len(self)} samples, {self.cycles} cycles, {self.status.name}, {', '.join(self.joint_names)})"
        )

    def _shown_rows(self) -> list[Sequence[str]]:
        """How it ended, and from where to where each joint went."""
        rows: list[Sequence[str]] = [("status", self.status.name.lower().replace("_", " "))]
        rows += [("samples", f"{len(self):,}"), ("whole cycles", str(self.cycles)), ("joint", "from", "to", "between")]
        for name, unit, q in zip(self.joint_names, self.joint_units, self.q.T, strict=True):
            if len(q):
                rows.append(
                    (name, f"{q[0]:.4f} {unit}", f"{q[-1]:.4f} {unit}", f"{q.min():.4f} and {q.max():.4f} {unit}")
                )
        return rows

    def __getstate__(self) -> dict[str, Any]:
        """All metrics as plain data, measured now."""
        names = (field.name for field in fields(Measures))
        return super().__getstate__() | {"measures": Measures(**{n: partial(_known, getattr(self, n)) for n in names})}

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
        return replace(
            self, t=self.t[:count], q=self.q[:count],
            marks=tuple(k for k in self.marks if k < count), corners=tuple(k for k in self.corners if k < count),
        )  # fmt: skip

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
        measures = Measures(
            lambda count: self.dq[:count] * joints, lambda count: self.x[:count] * rows,
            lambda count: self.error[:count] * rows, lambda count: self.sigma[:count],
            lambda count: self.residual[:count],
        )  # fmt: skip
        return replace(
            self, joint_units=tuple(map(units.name, self.joint_units)), q=self.q * joints,
            row_units=tuple(map(units.name, self.row_units)), measures=measures,
        )  # fmt: skip

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
