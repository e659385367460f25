"""The edge of reach on a leaf: how far a posture is from a wanted pose and from what it must keep to.

On a leaf the tool pose is a chart: a motion z of the tool, in metres, moves the joints by S z. What is missing to a
pose (p_d, R_d) is

    e = [p_d - p; length log(R_d R^T)]        (m,) [m],

so that |e| falls fastest along z = e, whatever the posture. What must be kept to are constraints c(q) >= 0: a margin to
singular postures and, when asked for, the joint limits. A are their slopes by z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..strategies import HolonomicStrategy
from ..symbolic import SX, Function, dot, gradient, substitute, sumsqr, symbol, vertcat
from ..types import Flags, Indices, Matrix, Value, Vector, frozen, kept
from .branch import turning
from .leaf import Way, WayEnd, leaf_step, leaf_value, leaf_walk, newton
from .stretch import TRIES

Goal = tuple[Vector, Matrix]
"""A pose of the tool: position (3,), rotation (3, 3)."""

UNMOVED = 1e-9
"""Share of the largest slope of a constraint below which the tool does not move it: round-off, a thousandfold."""

SAME = 1e-7
"""Difference of two postures [joint units] that are the same, found in two ways; branches lie far apart."""

NARROW = 2.0**-12
"""Share of a way below which a glance at it gives up: 0.2 mm of a metre."""


@kept
def edge_function(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, length) -> (e, S, rcond^2, its slope, twist, position, rotation).

    e (m,) [m]: what is missing to the pose (p, R); S (n, m): dq = S z; twist (6, m): the tool moves by it [m, rad].
    rcond = m / (|J_l| |S|), of Frobenius norms, J_l the task Jacobian in metres: from 0, singular, to 1; smooth, and
    the same in metres and millimetres. Its slope (n,) is that of log rcond^2 by q.
    """
    e, task = turning(strategy), strategy.task
    geometric = replace(task, orientation="twist") if task.turns else task
    n, m, k = task.n, task.m, e.kinematics
    p, R, length = symbol("p", 3), symbol("R", 3, 3), symbol("length", 1)
    scale = vertcat(*(length if row > 2 else SX(1) for row in task.rows))
    one = SX.eye(n)
    found = e.rate(one[:m, :], one[m:, :])
    Y = found.X / (SX.ones(n, 1) @ vertcat(scale, SX.ones(n - m, 1)).T)  # the inverse of the extended Jacobian A
    S, J = Y[:, :m], e.J * (scale @ SX.ones(1, n))
    large, fast = sumsqr(J), sumsqr(S)
    # d |S|^2 = -2 <Y^T S S^T, dA>: no solve is differentiated
    weights = 2 * (Y.T @ (S @ S.T)) / fast
    weights[:m, :] = weights[:m, :] - 2 * J / large
    held = symbol("weights", n, n)
    slope = gradient(dot(held, vertcat(J, e.planes)), e.q)
    outputs = {
        "e": geometric.error_expression(k, p, R) * scale,
        "S": S,
        "rcond2": m * m / (large * fast),
        "slope": substitute(slope, held, weights).T,
        "twist": k.jacobian @ S,
        "p": k.position,
        "R": k.rotation,
    }
    return Function("edge", {"q": e.q, "p": p, "R": R, "length": length}, outputs, found.system)


@dataclass(frozen=True, eq=False)
class Look:
    """What the edge function says of a posture q on the way to a goal, with the constraints.

    Of k constraints, `which` tells their numbers: 0 is rcond, then all lower limits, then all upper ones. c (k,) [m] is
    how far the tool may move until they hold, A (k, m) their slopes by z, of length 1; sizes (k,) those before.
    """

    q: Vector
    e: Vector
    S: Matrix
    rcond: float
    twist: Matrix
    position: Vector
    rotation: Matrix
    which: Indices
    c: Vector
    A: Matrix
    sizes: Vector

    @property
    def numbers(self) -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """(q, e, rcond, position and rotation, the distance from each constraint), as native code gives them."""
        slack = np.full(2 * len(self.q) + 1, np.inf)
        slack[self.which] = self.c
        return self.q, self.e, np.array([self.rcond]), np.concatenate([self.position, self.rotation.ravel()]), slack

    @property
    def excess(self) -> float:
        """How far outside the constraints q is [m]."""
        return max(0.0, -float(self.c.min(initial=0.0)))

    @property
    def distance(self) -> float:
        """|e| [m]."""
        return float(self.e @ self.e) ** 0.5

    def merit(self, weight: float) -> float:
        """What a step must lessen: |e|^2 / 2, and the excess with a weight."""
        return float(self.e @ self.e) / 2 + weight * self.excess


@dataclass(frozen=True, eq=False)
class Edge(Value):
    """What the tool can reach on the leaf through a start, and how to move there.

    length [m]: what a radian counts; margin: rcond to keep; lower, upper (n,): limits, infinite where there is none.
    """

    strategy: HolonomicStrategy
    start: Vector
    length: float
    margin: float
    lower: Vector
    upper: Vector

    @cached_property
    def leaf(self) -> Vector:
        """The level g(start) (r,)."""
        return frozen(leaf_value(self.strategy, self.start))

    @cached_property
    def side(self) -> float:
        """The sign of det [J; J_g] on the branch."""
        return float(leaf_step(self.strategy)(self.start, *self.tool(self.start), self.leaf)[3])

    @cached_property
    def context(self) -> Vector:
        """All of it in a row, for native code."""
        p, R = self.tool(self.start)
        parts = self.start, p, R.ravel(), self.leaf, self.lower, self.upper, [self.side, self.length, self.margin]
        return np.concatenate(parts)

    @cached_property
    def linear(self) -> Flags:
        """Which rows of e are positions (m,)."""
        return np.array([row < 3 for row in self.strategy.task.rows])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What the constraints are called: "rcond", and the joints, for their lower and for their upper limits."""
        return "rcond", *2 * self.strategy.task.robot.joint_names

    @cached_property
    def _given(self) -> Flags:
        return np.concatenate([[True], np.isfinite(self.lower), np.isfinite(self.upper)])

    def tool(self, q: Vector) -> Goal:
        """(position, rotation) of the tool."""
        pose = self.strategy.task.pose(q)
        return pose[:3, 3], pose[:3, :3]

    def look(self, q: Vector, goal: Goal, scaled: Look | None = None) -> Look:
        """At a posture; `scaled`: a look whose choice of constraints and whose sizes are kept."""
        e, S, rcond2, slope, twist, p, R = edge_function(self.strategy)(q, *goal, np.array([self.length]))
        S, square = np.reshape(S, (len(q), -1)), float(rcond2) / self.margin**2
        A = np.vstack([square * np.reshape(slope, -1) @ S, S, -S])
        c = np.concatenate([[square - 1], q - self.lower, self.upper - q])
        if scaled is None:
            sizes = np.where(self._given, np.linalg.norm(A, axis=1), 0.0)
            which = np.flatnonzero(sizes > UNMOVED * sizes.max(initial=0.0))
            sizes = sizes[which]
        else:
            which, sizes = scaled.which, scaled.sizes
        return Look(
            q, np.atleast_1d(e), S, float(rcond2) ** 0.5, np.reshape(twist, (6, -1)), p, R,
            which, c[which] / sizes, A[which] / sizes[:, None], sizes,
        )  # fmt: skip

    def walk(self, q: Vector, way: Way, tries: int) -> tuple[Vector, bool]:
        """From q along a way, in pieces shown to keep to the branch: how far it got, True where to its end."""
        q, ended = leaf_walk(self.strategy, q, tries)(
            q, way
        )  # a new one: what it knows of the branch is of where it was
        return q, ended is WayEnd.REACHED

    def glance(self, q: Vector, way: Way) -> tuple[Vector, bool]:
        """The same by Newton steps alone: quick, and not shown to keep to the branch."""
        rate, share, width = np.zeros(len(q)), 0.0, 1.0
        while width >= NARROW:
            end = min(1.0, share + width)
            found = self.solved(q + (end - share) * rate, *way.at(end))
            if found is None:
                width = (end - share) / 2
                continue
            rate, q = (found - q) / (end - share), found
            if end == 1.0:
                return q, True
            share, width = end, 2 * (end - share)
        return q, False

    def way(self, begin: Goal, v: Vector, turn: Vector, goal: Goal | None) -> Way:
        """From where the tool is along v, turning by `turn`; to a goal to the last bit, where there is one."""

        def at(share: float) -> tuple[Vector, Matrix, Vector]:
            if share == 1.0 and goal is not None:
                return *goal, self.leaf
            return begin[0] + share * v, rotation_matrix(share * turn) @ begin[1], self.leaf

        return Way(at, turn=float(np.linalg.norm(turn)))

    def straight(self, begin: Goal, goal: Goal) -> Way:
        """The straight way of the tool."""
        return self.way(begin, goal[0] - begin[0], rotation_vector(goal[1] @ begin[1].T), goal)

    def joined(self, q: Vector, tool: Goal, end: Look) -> bool:
        """True where the straight way of the tool between two postures is shown to lead from one to the other."""
        found, reached = self.walk(q, self.straight(tool, (end.position, end.rotation)), TRIES)
        return reached and float(np.abs(found - end.q).max()) <= SAME

    def moved(self, at: Look, z: Vector | None, share: float, goal: Goal, careful: bool) -> Look | None:
        """The look after a share of a motion z of the tool, or, without z, of the straight way to the goal.

        None where that leads nowhere. careful: only where it is shown to keep to the branch.
        """
        if z is None:
            twist = np.concatenate([goal[0] - at.position, rotation_vector(goal[1] @ at.rotation.T)])
        else:
            twist = at.twist @ z
        end = goal if z is None and share == 1.0 else None
        way = self.way((at.position, at.rotation), share * twist[:3], share * twist[3:], end)
        if careful:
            q, reached = self.walk(at.q, way, TRIES)
            return self.look(q, goal) if reached else None
        found = self.solved(at.q + share * (at.S @ (at.e if z is None else z)), *way.at(1.0))
        return None if found is None else self.look(found, goal)

    def solved(self, q: Vector, p: Vector, R: Matrix, c: Vector) -> Vector | None:
        """The posture at a tool pose on a leaf to which Newton contracts from q."""
        found = newton(leaf_step(self.strategy), q, p, R, c, self.side)
        return None if found is None else found[0]


def rotation_vector(R: Matrix) -> Vector:
    """The axis of a rotation times its angle [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def rotation_matrix(turn: Vector) -> Matrix:
    """The rotation of a rotation vector."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(turn).as_matrix()
