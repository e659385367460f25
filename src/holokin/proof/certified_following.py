"""`follow_certified`: a path followed within the tubes of a certificate, so that no step can go to another branch."""

from __future__ import annotations

import numpy as np

from ..base.arguments import typed
from ..base.types import ArrayLike, Indices, Matrix, Vector, some, whole
from ..errors import NotCertifiedError, OpenPathError
from ..inverse_kinematics.plan import make_plan
from ..motion.follow_path import joint_rates
from ..motion.recorded_trajectory import record
from ..motion.trajectory import Status, Trajectory
from ..path.synchronized_paths import AnyPath
from ..strategies import Strategy
from .certificate import Certificate, Extent
from .certify_leaf import certify
from .tube import centred

STATUS = {Extent.LIMIT: Status.LIMIT, Extent.SINGULAR: Status.SINGULAR, Extent.APART: Status.BRANCH}
"""How a trajectory ends whose certificate does; else it is lost."""

NEWTONS = 3
"""Steps from a predictor, whose tube they converge in."""


@typed
def follow_certified(
    strategy: Strategy, path: AnyPath, q0: ArrayLike, *, samples: int = 500, cycles: int = 1, limits: bool = True,
    budget: int = 20_000,
) -> tuple[Trajectory, Certificate]:  # fmt: skip
    """Follow a path as `follow` does, with a proof that no sample is on another branch: the cells control the steps.

    Every sample is the root near the predictor of the proven cell that it falls into, to a few roundings; that it lies
    in the cell's tube is checked, so it is the one root of the theorem.

    Args:
        samples: steps a cycle, at least. cycles: of a closed path. limits, budget: as of `certify`.

    Returns:
        (trajectory, certificate). Of a path that comes back to a tool pose with other joints the trajectory is whole,
        and the certificate is not: its `extent` and `revisit` say so.

    Raises:
        NotCertifiedError: cells do not cover all of the path; `.trajectory` and `.certificate` hold what is.
        OpenPathError: several cycles of an open path, or of one whose end is not shown to be its beginning.
        What `certify` raises.
    """
    if whole("cycles", cycles) > 1 and not path.closed:
        raise OpenPathError(f"following {cycles} cycles", path.gap)
    proof = certify(strategy, path, q0, limits=limits, budget=budget)
    if cycles > 1 and proof.covered and not np.isfinite(proof.gap):
        raise OpenPathError(f"following {cycles} cycles", path.gap, proof.returning)
    task = strategy.task
    start = task.robot.checked(q0, "the start posture")
    plan = make_plan(task, path, whole("samples", samples), task.place(start)[1])
    piece = np.repeat(np.arange(len(plan.counts)), plan.counts)
    share = np.concatenate([np.arange(1, k + 1) / k for k in plan.counts.tolist()])
    once = np.vstack([start, roots(proof, piece, share)])
    q = once
    if proof.covered and cycles > 1:
        turns = 2 * np.pi * proof.turns
        q = np.vstack([once, *(once[1:] + k * turns for k in range(1, cycles))])
    status = Status.COMPLETE if proof.covered else STATUS.get(proof.extent, Status.LOST)

    def rates(samples: int) -> Matrix:
        return joint_rates(strategy, plan, q[:samples])

    def residual(samples: int) -> Vector:
        leaf = proof.equation.strategy
        values = leaf.constraint_value.batch(q[:samples]).reshape(samples, -1)
        return np.abs(leaf.constraint.nearest(values - proof.c)).max(axis=1, initial=0.0)

    walk = record(task, plan, q, rates, cycles, status, residual)
    if not proof.covered:
        raise NotCertifiedError(str(proof).rstrip("."), proof.extent.cure, walk, proof)
    return walk, proof


def roots(proof: Certificate, piece: Indices, share: Vector) -> Matrix:
    """The joints (k, n) at shares of pieces of a path, as many of the first as are proven."""
    boxes = proof.proven.boxes
    key, ends = piece + share, boxes.piece + boxes.high[:, 0]
    cell = np.searchsorted(ends, key)
    known = cell < len(ends)
    known[known] &= (boxes.piece + boxes.low[:, 0])[cell[known]] <= key[known]
    count = int(np.argmin(known)) if not known.all() else len(known)
    cell = cell[:count]
    if not count:
        return np.empty((0, proof.equation.joints))
    cells, low, high = some(proof.cells, cell), boxes.low[cell], boxes.high[cell]
    y = (2 * share[:count, None] - low - high) / (high - low)
    guess = cells.predicted(y)
    numbers = cells.numbers.copy()
    numbers[:, -2], numbers[:, -1] = share[:count], 0.0
    found = centred(proof.equation, guess, numbers, proof.c, np.ones(count), newtons=NEWTONS).q0
    off = np.linalg.norm(found - guess, axis=1) <= proof.findings.alone[cell]
    return found[: count if off.all() else int(np.argmin(off)), : proof.equation.joints]
