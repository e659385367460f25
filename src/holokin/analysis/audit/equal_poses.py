"""Judging joint postures at equal tool poses: the verdicts, distances, the first limit, moves to a pose close by."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ...base.types import Array, Matrix, NoTruthValue, Vector
from ...strategies.tasks.task import Task


@dataclass(frozen=True)
class Distance:
    """Largest joint distance at equal tool poses: `value` [rad or m] of `joint` at `phase` of the cycle (0 to 1),
    and how far it is over what is allowed there; `beyond` when it is."""

    value: float
    joint: str
    phase: float
    beyond: bool


class LogVerdict(NoTruthValue, Enum, ask="`is LogVerdict.REPEATS`"):
    """Whether the joints repeated in a log; the text says what it means."""

    REPEATS = "repeats: the joints were the same at equal tool poses, in every comparison that the log allows"
    DIFFERS = "differs: the joints were not the same at equal tool poses"
    UNDECIDED = (
        "cannot tell: noise, a shift of the tool's own path, or a turn between two samples may hide that the joints "
        "differ"
    )


class Repeatability(NoTruthValue, Enum, ask="`is Repeatability.REPEATS`"):
    """What the audit of a control law found; the text says what it means."""

    REPEATS = "repeats: the joints are the same at equal tool poses, in all that was tested"
    BUT_FOR_THE_STEP = "repeats but for the error of the step: take a shorter step, or feedback to the leaf"
    CONVERGES = (
        "converges: cycles repeat in the end, but the joints at a pose depend on the path, the speed or the past"
    )
    DRIFTS = "drifts: every cycle leaves the joints elsewhere"
    UNKNOWN = "cannot be judged: the law failed, as told below"


def first_limit(lower: Vector, upper: Vector, q: Matrix, rate: Matrix) -> tuple[int, float] | None:
    """(joint, cycles) of the first joint at a limit when the postures q (P, n) of a cycle go on at their rates (P, n)
    [joint units a cycle]; None when none moves towards one."""
    room = np.where(rate > 0, upper - q, q - lower)
    cycles = np.full(q.shape, np.inf)
    np.divide(np.maximum(room, 0.0), np.abs(rate), out=cycles, where=rate != 0)
    _, joint = np.unravel_index(int(np.argmin(cycles)), cycles.shape)
    return (int(joint), float(cycles.min())) if np.isfinite(cycles.min()) else None


def to_pose(task: Task, q: Matrix, position: Matrix, rotation: Array) -> tuple[Matrix, Vector]:
    """Postures (k, n) moved to tool poses (k, 3), (k, 3, 3) close by, dq = J^+ e, and the largest joint's move (k,).

    What remains between two visits so moved is motion of the joints that the gap of the tool does not explain.
    """
    error = task.error(q, position, rotation)
    jacobian, _ = task.jacobian_batch(q)
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    trace = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    weights = np.linalg.solve(gram + 1e-9 * trace * np.eye(task.m), error[:, :, None])
    move = (jacobian.transpose(0, 2, 1) @ weights)[:, :, 0]
    return q + move, np.abs(move).max(axis=1)


def spread(visits: Array) -> Matrix:
    """Largest distance of each joint between visits (c, P, n) of the same poses -> (P, n)."""
    return visits.max(axis=0) - visits.min(axis=0)
