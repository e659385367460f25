"""The edge of reach on a leaf: how far a posture is from a wanted pose and from what it must keep to.

On a leaf the tool pose is a chart: a motion z of the tool, in metres, moves the joints by S z. What is missing to a
pose (p_d, R_d) is

    e = [p_d - p; length log(R_d R^T)]        (m,) [m],

so that |e| falls fastest along z = e, whatever the posture. What must be kept to are constraints c(q) >= 0: a margin to
singular postures and, when asked for, the joint limits. A are their slopes by z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Flags, Indices, Matrix, Value, Vector, frozen, kept
from ...path.straight_path import StraightPath, rotation_vector
from ...strategies import HolonomicStrategy
from ...strategies.tasks.free_motion import completed
from ...symbolic import SX, Function, dot, gradient, substitute, sumsqr, symbol, vertcat
from .branch import turning
from .leaf import LeafPath, PathEnd, Pose, leaf_step, leaf_value, leaf_walk, newton_on_leaf, straight_path
from .rays import on_ray
from .stretch import along

Goal = Pose
"""A wanted pose of the tool."""

UNMOVED = 1e-9
"""Share of the largest slope of a constraint below which the tool does not move it: round-off, a thousandfold."""

SAME = 1e-7
"""Difference of two postures [joint units] that are the same, found in two ways; branches lie far apart."""

NARROW = 2.0**-16
"""Share of a way below which a glance at it gives up: 0.02 mm of a metre. With 2^-12, 2 % of the ways of arm angles
that lead to their ends were given up, those that pass close by singular postures; with this one, none of 640."""

COARSE = 2.0**-12
"""Share of a way below which a glance that is given up in the end does not move the posture where it got to: a fold is
near there, from which the path down is long."""

LEAP = 0.1
"""Joint motion [joint units] from where a piece of a glance is expected to end to where it does, at most: a larger one
may be a leap to another branch."""

BEGUN = 1e-3
"""Share of a way over which its first rate is taken."""

FEW = 200
"""Pieces of one step of the tool tried at most, after stretches, where there are any. A step is some centimetres long;
where that is not enough, a shorter one is tried."""

MANY = 5_000
"""The same where native code has stretches and there is none: of 400 ways that it shows none took over 3,000."""


@kept
def edge_function(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, length) -> (e, S, rcond^2, its slope, twist, position, rotation).

    e (m,) [m]: what is missing to the pose (p, R); S (n, m): dq = S z; twist (6, m): the tool moves by it [m, rad].
    rcond = m / (|J_l| |S|), of Frobenius norms, J_l the task Jacobian in metres: from 0, singular, to 1; smooth, and
    the same in metres and millimetres. Its slope (n,) is that of log rcond^2 by q.
    """
    e, task = turning(strategy), strategy.task
    geometric = task.geometric_twin
    n, m, k = task.n, task.m, e.kinematics
    p, R, length = symbol("p", 3), symbol("R", 3, 3), symbol("length", 1)
    scale = vertcat(*(length if angular else SX(1) for angular in task.angular))
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
    q0: Vector
    length: float
    margin: float
    lower: Vector
    upper: Vector

    @cached_property
    def leaf(self) -> Vector:
        """The level g(start) (r,)."""
        return frozen(leaf_value(self.strategy, self.q0))

    @cached_property
    def side(self) -> float:
        """The sign of det [J; J_g] on the branch."""
        return float(leaf_step(self.strategy)(self.q0, *self.tool(self.q0), self.leaf)[3])

    @cached_property
    def tries(self) -> int:
        """Pieces of one step of the tool tried at most."""
        return FEW if along(self.strategy) is None else MANY

    @cached_property
    def context(self) -> Vector:
        """All of it in a row, for native code."""
        p, R = self.tool(self.q0)
        parts = self.q0, p, R.ravel(), self.leaf, self.lower, self.upper, [self.side, self.length, self.margin]
        return np.concatenate(parts)

    @cached_property
    def linear(self) -> Flags:
        """Which rows of e are positions (m,)."""
        return ~np.array(self.strategy.task.angular)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What the constraints are called: "rcond", and the joints, for their lower and for their upper limits."""
        return "rcond", *2 * self.strategy.task.robot.joint_names

    @cached_property
    def _given(self) -> Flags:
        return np.concatenate([[True], np.isfinite(self.lower), np.isfinite(self.upper)])

    def tool(self, q: Vector) -> Goal:
        """(position, rotation) of the tool."""
        return self.strategy.task.place(q)

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

    @cached_property
    def ray(self) -> bool:
        """Whether straight paths from the start are rays."""
        return on_ray(self.strategy, self.q0)

    def walk(self, q: Vector, path: LeafPath, tries: int) -> tuple[Vector, bool]:
        """From q along a way, in pieces shown to keep to the branch: how far it got, True where to its end."""
        walk = leaf_walk(self.strategy, q, tries, on_ray(self.strategy, q), folds=True)  # new: it knows where it was
        q, ended = walk(q, path)
        return q, ended is PathEnd.REACHED

    def glance(self, q: Vector, path: LeafPath) -> tuple[Vector, bool]:
        """The same by Newton steps alone: quick, and not shown to keep to the branch."""
        rate, share, width, last = leaf_step(self.strategy)(q, *path.at(BEGUN))[0] / BEGUN, 0.0, 1.0, q
        while width >= NARROW:
            end = min(1.0, share + width)
            begun = q + (end - share) * rate
            found = self.solved(begun, *path.at(end))
            width = (end - share) / 2
            if found is None:
                continue
            off = float(np.abs(found - begun).max())
            width *= min(8.0, max(0.5, (2 * LEAP / max(off, 1e-300)) ** 0.5))  # for a half of the leap, next time
            if off > LEAP:
                continue
            last = found if end - share >= COARSE else last
            rate, q, share = (found - q) / (end - share), found, end
            if end == 1.0:
                return q, True
        return last, False

    def path(self, begin: Goal, v: Vector, turn: Vector, goal: Goal | None) -> LeafPath:
        """From where the tool is along v, turning by `turn`; to a goal to the last bit, where there is one."""
        return self.straight(begin, StraightPath(*begin, v, turn).at(1.0) if goal is None else goal)

    def straight(self, begin: Goal, goal: Goal) -> LeafPath:
        """The straight path of the tool."""
        return straight_path(self.strategy.task, begin, goal, (self.leaf, self.leaf))

    def joined(self, q: Vector, tool: Goal, end: Look) -> bool:
        """True where the straight path of the tool between two postures is shown to lead from one to the other."""
        found, reached = self.walk(q, self.straight(tool, (end.position, end.rotation)), self.tries)
        return reached and float(np.abs(found - end.q).max()) <= SAME

    def moved(self, at: Look, z: Vector | None, share: float, goal: Goal, careful: bool) -> Look | None:
        """The look after a share of a motion z of the tool, or, without z, of the straight path to the goal.

        None where that leads nowhere. careful: only where it is shown to keep to the branch.
        """
        if z is None:
            p, R = completed(self.strategy.task, goal, (at.position, at.rotation))
            twist = np.concatenate([p - at.position, rotation_vector(R @ at.rotation.T)])
        else:
            twist = at.twist @ z
        end = goal if z is None and share == 1.0 else None
        path = self.path((at.position, at.rotation), share * twist[:3], share * twist[3:], end)
        if careful:
            q, reached = self.walk(at.q, path, self.tries)
            return self.look(q, goal) if reached else None
        found = self.solved(at.q + share * (at.S @ (at.e if z is None else z)), *path.at(1.0))
        return None if found is None else self.look(found, goal)

    def onto(self, q: Vector, goal: Goal) -> Look | None:
        """The look at the posture of the leaf nearby that has the tool pose of q; None where there is none."""
        found = self.solved(q, *self.tool(q), self.leaf)
        return None if found is None else self.look(found, goal)

    def solved(self, q: Vector, p: Vector, R: Matrix, c: Vector) -> Vector | None:
        """The posture at a tool pose on a leaf to which Newton contracts from q."""
        found = newton_on_leaf(leaf_step(self.strategy), q, p, R, c, self.side)
        return None if found is None else found[0]
