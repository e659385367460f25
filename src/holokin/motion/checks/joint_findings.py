"""Findings at the samples of a motion: limits of the joints, and singularities of the task."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Vector
from ...robot import Robot
from ...strategies.tasks.task import Task
from .check_report import Finding, FindingKind
from .checked_samples import Motion

EXACT = 1e-9
"""Share of a limit by which a rate may exceed it: that of round-off."""


def limit_findings(robot: Robot, motion: Motion, margin: float) -> Iterator[Finding]:
    """Where a joint is nearer than `margin` [joint units] to a limit of its position, or exceeds one of a rate."""
    for i, c in enumerate(robot.coordinates):
        q, lower, upper = motion.q[:, i], c.lower + margin, c.upper - margin
        for past, limit in ((lower - q, lower), (q - upper, upper)):
            for a, b, k in stretches(past > TOLERANCES.limit, past):
                yield _found(FindingKind.POSITION, (c.name,), motion, (a, b, k), float(q[k]), float(limit), c.unit)
        for kind, values, limits, per in motion.rates:
            size, most = np.abs(values[:, i]), float(limits[i])
            for a, b, k in stretches(size > most * (1 + EXACT), size):
                yield _found(kind, (c.name,), motion, (a, b, k), float(size[k]), most, c.unit + per)


def unjudged_speeds(robot: Robot, motion: Motion) -> list[str]:
    """A sentence on the joints whose speeds were not judged, since nothing limits them; none where there are none."""
    limits = [most for kind, _, most, _ in motion.rates if kind is FindingKind.VELOCITY]
    names = [name for most in limits for name, one in zip(robot.joint_names, most, strict=True) if not np.isfinite(one)]
    return [f"cannot tell whether {', '.join(names)} can be so fast: there is no limit of the speed"] if names else []


def singular_findings(task: Task, motion: Motion, J: Array, rcond: float) -> Iterator[Finding]:
    """Where the smallest singular value of the task Jacobian J (k, m, n) is less than `rcond` times the largest."""
    values = np.linalg.svd(J, compute_uv=False)
    found = values[:, -1] / np.maximum(values[:, 0], np.finfo(float).tiny)
    for a, b, k in stretches(found < rcond, -found):
        yield _found(FindingKind.SINGULARITY, (task.name,), motion, (a, b, k), float(found[k]), rcond, "")


def stretches(wrong: Flags, size: Vector) -> Iterator[tuple[int, int, int]]:
    """(first, last, worst) sample of each stretch that is wrong; the worst has the largest size."""
    edges = np.diff(np.concatenate([[0], wrong, [0]]).astype(int))
    for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        yield int(a), int(b) - 1, int(a) + int(np.argmax(size[a:b]))


def _found(
    kind: FindingKind, what: tuple[str, ...], motion: Motion, place: tuple[int, int, int], value: float, limit: float,
    unit: str,
) -> Finding:  # fmt: skip
    a, b, k = place
    t = motion.t
    return Finding(kind, what, float(t[a]), float(t[b]), float(t[k]), k, value, limit, unit)
