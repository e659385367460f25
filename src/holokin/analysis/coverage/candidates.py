"""The laws that fit a robot and its task: what `advise` compares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ...base.errors import NoArmError, NotFiniteError
from ...base.types import Matrix, Value, Vector
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import (
    Constraint,
    arm_angle,
    centring_cost,
    find_arm,
    gravity_cost,
    height,
    linear,
    lock,
    manipulability_cost,
    stack,
    stationary,
)
from ...strategies.tasks.task import Task
from .starts import locked_joints

TURNED = 1e-3
"""Angle [rad] from which two axes are not parallel."""

TRANSVERSAL = 0.03
"""Least singular value of A N, rows of A and basis N orthonormal, from which a law is tried: below it the tool must
hardly move before the law's joints do."""

MOST_LOCKS, MOST_PAIRS = 10, 4
"""Sets of joints to lock, and linear laws, that are tried: those that fix the self-motion best. All seven joints of a
7R arm fit in; of the 84 sets of an arm of nine joints the others are worse at the start already."""

LEVEL_OF_COST = 0.0
"""The level of a stationary constraint at which its cost is stationary."""


@dataclass(frozen=True, eq=False)
class Candidate(Value):
    """A law to try: a name, what a job file says of it, and its constraint, None for `radial` of the pseudo-inverse.

    `level`: the leaf that it asks for, None where any will do.
    """

    name: str
    keys: Mapping[str, Any]
    task: Task
    strategy: HolonomicStrategy | None = None
    level: float | None = None

    @property
    def kind(self) -> str:
        """Its kind, as job files call it."""
        return str(self.keys["kind"])


def candidates(task: Task, starts: Matrix) -> list[Candidate]:
    """The laws that fit: each has r = n - m rows and fixes the self-motion at one of the starts (k, n) at least.

    One redundant joint: each joint locked, differences or sums of parallel joints, the arm angle (both definitions),
    the elbow's height, stationary costs, radial. Several: sets of joints locked; the trunk locked (all joints before
    those of an arm of seven) over each law of the arm; stationary costs by Chang's basis; radial.
    """
    r = task.n - task.m
    bases = [_basis(task, q) for q in starts]
    found = list(_locks(task, bases))
    trunk = _trunk(task)
    inner = [] if len(trunk) != r - 1 else [*_pairs(task, starts, trunk), *_arms(task)]
    for name, keys, constraint in inner:
        if trunk:
            names = [task.robot.joint_names[i] for i in trunk]
            name = f"lock {', '.join(names)} over {name}"
            keys = {"kind": "stack", "constraints": [{"kind": "lock", "joints": names}, dict(keys)]}
            constraint = stack(lock(*names), constraint)
        found.append(_candidate(task, name, keys, constraint))
    found += _stationary(task, starts)
    return [c for c in found if _fixes(c, starts, bases)] + [Candidate("radial", {"kind": "radial"}, task)]


Named = tuple[str, Mapping[str, Any], Constraint]


def _candidate(
    task: Task, name: str, keys: Mapping[str, Any], constraint: Constraint, level: float | None = None
) -> Candidate:
    return Candidate(name, keys, task, holonomic(task, constraint, name=name), level)


def _locks(task: Task, bases: list[Matrix]) -> Iterator[Candidate]:
    """Sets of r joints to lock, those that fix the self-motion best first."""
    names = task.robot.joint_names
    sets = list(combinations(range(task.n), task.n - task.m))
    sizes = [max(_least(N[list(joints)]) for N in bases) for joints in sets]
    for i in np.argsort(-np.array(sizes), kind="stable")[:MOST_LOCKS]:
        joints = [names[j] for j in sets[i]]
        yield _candidate(task, f"lock {', '.join(joints)}", {"kind": "lock", "joints": joints}, lock(*joints))


def _pairs(task: Task, starts: Matrix, trunk: list[int]) -> Iterator[Named]:
    """Differences or sums of two parallel hinges, whichever fixes the self-motion better."""
    names, n = task.robot.joint_names, task.n
    free = [i for i in range(n) if i not in trunk]
    rows: list[tuple[float, Vector]] = []
    N = [_basis(task, q) for q in starts]
    for i, j in _parallel(task, free):
        best = max(((_size_of(row, N), row) for row in (_row(n, i, j, -1.0), _row(n, i, j, 1.0))), key=lambda e: e[0])
        rows.append(best)
    rows.sort(key=lambda entry: -entry[0])
    for _, row in rows[:MOST_PAIRS]:
        i, j = np.flatnonzero(row)
        name = f"{names[i]} {'-' if row[j] < 0 else '+'} {names[j]}"
        yield name, {"kind": "linear", "matrix": [row.tolist()]}, linear(row, name=name)


def _row(n: int, i: int, j: int, sign: float) -> Vector:
    row = np.zeros(n)
    row[i], row[j] = 1.0, sign
    return row


def _size_of(row: Vector, bases: Iterable[Matrix]) -> float:
    return max(float(np.linalg.norm(row @ N)) / 2**0.5 for N in bases)


def _parallel(task: Task, among: list[int]) -> Iterator[tuple[int, int]]:
    """Pairs of hinges whose axes are parallel where all joints stand at zero."""
    robot = task.robot
    axes = robot.jacobian(np.zeros(task.n), task.tip)[3:]
    for i, j in combinations(among, 2):
        both = robot.hinges[i] and robot.hinges[j] and axes[:, i].any() and axes[:, j].any()
        if both and np.linalg.norm(np.cross(axes[:, i], axes[:, j])) < TURNED:
            yield i, j


def _arms(task: Task) -> Iterator[Named]:
    """The arm angle by both definitions, and the height of the elbow."""
    try:
        elbow = find_arm(task).elbow
    except NoArmError:
        return
    for kind in ("stereographic", "conventional"):
        yield f"arm angle ({kind})", {"kind": "arm-angle", "definition": kind}, arm_angle(definition=kind)
    name = task.robot.joints[elbow.joint].name
    yield f"height of {name}", {"kind": "height", "joints": [name]}, height(name)


def _trunk(task: Task) -> list[int]:
    """The joints that come before those of an arm of as many joints as the task has rows, and one more."""
    order = sorted({joint.coordinate for joint in task.robot.joints})
    return order[: task.n - task.m - 1]


def _stationary(task: Task, starts: Matrix) -> Iterator[Candidate]:
    """Costs that are stationary under self-motions: joint centring, manipulability, gravity."""
    r, robot = task.n - task.m, task.robot
    free = None if r == 1 else tuple(robot.joint_names[i] for i in locked_joints(task, starts[0]))
    more = {} if free is None else {"free": list(free)}
    costs = {"centring": centring_cost(), "manipulability": manipulability_cost(), "gravity": gravity_cost()}
    if not (np.isfinite(robot.lower) & np.isfinite(robot.upper)).any():
        del costs["centring"]
    if not robot.bodies or robot.planar:
        del costs["gravity"]
    for word, cost in costs.items():
        keys = {"kind": "stationary", "cost": word, **more, "level": LEVEL_OF_COST}
        yield _candidate(task, f"stationary {word}", keys, stationary(cost, free=free), LEVEL_OF_COST)


def _basis(task: Task, q: Vector) -> Matrix:
    """An orthonormal basis (n, r) of the self-motions at q."""
    return np.linalg.qr(task.null_space(q))[0]


def _least(rows: Matrix) -> float:
    """The least singular value."""
    return float(np.linalg.svd(rows, compute_uv=False)[-1])


def _fixes(candidate: Candidate, starts: Matrix, bases: list[Matrix]) -> bool:
    """Whether at some start the rows of its constraint, made unit, tell every self-motion."""
    if candidate.strategy is None:
        return True
    for q, N in zip(starts, bases, strict=True):
        try:
            A = candidate.strategy.rows(q)
        except NotFiniteError:
            continue
        sizes = np.linalg.norm(A, axis=1, keepdims=True)
        if (sizes > 0).all() and _least(A / sizes @ N) > TRANSVERSAL:
            return True
    return False
