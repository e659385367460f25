"""At the edge of reach: how far a posture of a leaf is from a wanted pose, and the way down to the nearest one.

On a leaf the tool pose is a chart: a motion z of the tool, in metres, moves the joints by S z. With the error

    e = [p_d - p; l log(R_d R^T)]        (m,) [m],

the distance |e| falls fastest along z = e, whatever the posture. The constraints c(q) >= 0 are a margin to singular
postures and, when asked for, the joint limits; their slopes by z are A. Each step solves

    min  1/2 z^T B z - e^T z   with   A z >= -c,

B from changes of the gradient (BFGS), [NW06, section 18], moves the tool by it in pieces that keep to the branch, and
goes back onto the edge, which is curved. So every posture on the way is within the constraints, each is nearer than the
one before, and at the end e = -A^T lambda, lambda >= 0: what is missing is normal to the edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..strategies import HolonomicStrategy
from ..symbolic import SX, Function, dot, gradient, substitute, sumsqr, symbol, vertcat
from ..tolerances import TOLERANCES
from ..types import Indices, Matrix, Vector, kept
from .branch import _turning
from .leaf import ALMOST, NEWTONS, Way, WayEnd, leaf_step, leaf_value, leaf_walk
from .leaf import DONE as DONE_Q
from .stretch import TRIES

Goal = tuple[Vector, Matrix]
"""A pose of the tool: position (3,), rotation (3, 3)."""

TRUST = 0.1
"""First step of the tool [m]; steps that succeed double it."""

DONE = 1e-10
"""Step of the tool [m] below which the way down has ended: round-off of a few metres is a ten thousandth of it."""

WITHIN = 1e-10
"""Overshoot of a constraint, in metres of the tool, that counts as none."""

NEAR = 1e-4
"""Overshoot of a constraint [m] with which a step goes on; the next one takes it back. From a larger one the tool goes
back at once, since beyond the margin, some millimetres away, there is a singular posture."""

STEPS = 60
"""Steps of the tool on one way down, at most; some five are usual."""

HALVINGS = 30
"""Times that one step is halved before there is none."""

RETURNS = 8
"""Steps back to the edge after one step along it, at most; two are usual."""

DESCENT = 1e-4
"""Share of the expected decrease that a step must bring. [NW06, section 3.1]"""

SMALL, CONTRACTION = 1e-5, 0.5
"""A step of the tool [m] that is good where the next one is shorter by this ratio, whatever round-off makes of the
distance."""

FAST = 0.1
"""Ratio of two successive steps up to which the curvature need not be looked at again."""

TIGHT = 0.01
"""Distance of a constraint [m] within which curvatures tell of the edge."""

DEPENDENT = 1e-12
"""What keeps constraints that depend on each other apart, as a share: together they share their multipliers."""

UNMOVED = 1e-9
"""Share of the largest slope of a constraint below which the tool does not move it: round-off, a thousandfold."""

SPREAD = 1e-6
"""Motion of the tool [m] over which slopes are differenced for curvatures, which need but a few digits."""

CURVED = 0.05
"""Least curvature of the model: behind a hollow edge that of the distance may be negative."""

SAME = 1e-7
"""Difference of two postures [joint units] that are the same, found in two ways; branches lie far apart."""

NARROW = 2.0**-12
"""Share of a way below which a glance at it gives up: 0.2 mm of a metre."""

_NAMES = (
    "TRUST DONE WITHIN NEAR STEPS HALVINGS RETURNS DESCENT SMALL CONTRACTION FAST TIGHT DEPENDENT UNMOVED SPREAD CURVED "
    "SAME NARROW"
)
CONSTANTS = {name: globals()[name] for name in _NAMES.split()}
"""All of them, for native code."""


@kept
def edge_function(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, length) -> (e, S, rcond^2, its slope, twist, position, rotation).

    e (m,) [m]: what is missing to the pose (p, R); S (n, m): dq = S z; twist (6, m): the tool moves by it [m, rad].
    rcond = m / (|J_l| |S|), of Frobenius norms, J_l the task Jacobian in metres: from 0, singular, to 1; smooth, and
    the same in metres and millimetres. Its slope (n,) is that of log rcond^2 by q.
    """
    e, task = _turning(strategy), strategy.task
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
        return max(0.0, -float(self.c.min()))

    @property
    def distance(self) -> float:
        """|e| [m]."""
        return float(self.e @ self.e) ** 0.5

    def merit(self, weight: float) -> float:
        """What a step must lessen: |e|^2 / 2, and the excess with a weight."""
        return float(self.e @ self.e) / 2 + weight * self.excess


def projection(at: Look, e: Vector, M: Matrix | None) -> tuple[Vector, Vector]:
    """The z (m,) with the least z^T M^-1 z / 2 - e^T z and A z >= -c, M = 1 by default; its multipliers (k,).

    By active sets: constraints enter one at a time, the most violated first. [LH95, section 23.3]
    """
    A, c = at.A, at.c
    free, MA = (e, A.T) if M is None else (M @ e, M @ A.T)
    H, b = A @ MA, A @ free + c
    H[np.diag_indices(len(c))] *= 1 + DEPENDENT
    held: list[int] = []
    forces = np.zeros(len(c))
    for _ in range(3 * len(c) + 3):
        slack = H @ forces + b
        slack[held] = np.inf
        worst = int(np.argmin(slack))
        if not slack[worst] < -1e-14 * (1 + abs(b[worst])):
            break
        held.append(worst)
        while held:
            now, wanted = forces[held], np.linalg.solve(H[np.ix_(held, held)], -b[held])
            if (wanted > 0).all():
                forces[held] = wanted
                break
            shares = np.where(wanted > 0, np.inf, now / np.maximum(now - wanted, 1e-300))
            first = int(np.argmin(shares))
            forces[held] = now + shares[first] * (wanted - now)
            forces[held[first]] = 0.0
            del held[first]
    return free + MA @ forces, forces


class Edge:
    """The postures of the leaf through a start that keep the constraints, and the way down to a pose's nearest one."""

    def __init__(
        self, strategy: HolonomicStrategy, start: Vector, length: float, margin: float, lower: Vector, upper: Vector
    ) -> None:
        self.strategy, self.start, self.length, self.margin = strategy, start, length, margin
        self.lower, self.upper, self.leaf = lower, upper, leaf_value(strategy, start)
        self._function = edge_function(strategy)
        self._step = leaf_step(strategy)
        self.side = float(self._step(start, *self.tool(start), self.leaf)[3])
        place = [*self.tool(start)[0], *self.tool(start)[1].ravel()]
        self.context = np.array([*start, *place, *self.leaf, *lower, *upper, self.side, length, margin])
        self._given = np.concatenate([[True], np.isfinite(lower), np.isfinite(upper)])

    def _newton(self, q: Vector, p: Vector, R: Matrix, c: Vector) -> Vector | None:
        """The posture at a target to which Newton contracts from q; None where it does not."""
        before = np.inf
        for _ in range(NEWTONS):
            dq, rcond, margin, side = self._step(q, p, R, c)
            size = float(np.abs(dq).max())
            if not (rcond > TOLERANCES.singular and margin > TOLERANCES.representation and side == self.side):
                return None
            last = before <= ALMOST
            if last and not size <= before:
                return q
            if not (last or size <= max(TOLERANCES.contraction * before, DONE_Q)):
                return None
            q = q + dq
            if last or size <= DONE_Q:
                return q
            before = size
        return None

    def tool(self, q: Vector) -> Goal:
        """(position, rotation) of the tool."""
        pose = self.strategy.task.robot.pose(q, self.strategy.task.tip)
        return pose[:3, 3], pose[:3, :3]

    def look(self, q: Vector, goal: Goal, scaled: Look | None = None) -> Look:
        """At a posture; `scaled`: a look whose choice of constraints and whose sizes are kept."""
        e, S, rcond2, slope, twist, p, R = self._function(q, *goal, np.array([self.length]))
        S, square = np.reshape(S, (len(q), -1)), float(rcond2) / self.margin**2
        A = np.vstack([square * np.reshape(slope, -1) @ S, S, -S])
        c = np.concatenate([[square - 1], q - self.lower, self.upper - q])
        if scaled is None:
            sizes = np.where(self._given, np.linalg.norm(A, axis=1), 0.0)
            which = np.flatnonzero(sizes > UNMOVED * sizes.max())
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
            found = self._newton(q + (end - share) * rate, *way.at(end))
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
        found = self._newton(at.q + share * (at.S @ (at.e if z is None else z)), *way.at(1.0))
        return None if found is None else self.look(found, goal)

    def inside(self, at: Look | None, goal: Goal, careful: bool) -> Look | None:
        """The nearest posture within the constraints, if a few steps lead to it."""
        for _ in range(RETURNS):
            if at is None or at.excess <= WITHIN:
                return at
            z, _ = projection(at, np.zeros(len(at.e)), None)
            at = self.moved(at, z, min(1.0, TRUST / max(float(np.linalg.norm(z)), 1e-300)), goal, careful)
        return at if at is not None and at.excess <= WITHIN else None

    def descend(
        self, at: Look, goal: Goal, careful: bool, begin: Vector, step: Vector | None = None
    ) -> tuple[Look, Look | None]:
        """The end of the way down from a posture within the constraints; and the place on it up to which no joint moves
        by more than a step (n,) from its beginning, None where that is its end."""
        cut, trust, M, fresh = None, TRUST, None, False
        z, forces = projection(at, at.e, None)
        for _ in range(STEPS):
            if not fresh:
                held = at.c[forces > 0]
                fresh = bool(held.size) and held.max() <= TIGHT
                M = self.compliance(at, forces, goal) if fresh else None
                z, forces = projection(at, at.e, M)
            size, weight = float(np.linalg.norm(z)), 2 * float(forces.sum())
            if not size > DONE:
                break
            along, share = z if weight > 0 else None, min(1.0, trust / size)
            while share * size > DONE:
                there, hoped = self.moved(at, along, share, goal, careful), DESCENT * share * float(at.e @ z)
                if there is not None and (there.excess > NEAR or at.merit(weight) - there.merit(weight) < hoped):
                    small = size <= SMALL and there.excess <= NEAR
                    there = there if small else self.inside(there, goal, careful)
                if there is not None:
                    further, forces = projection(there, there.e, M)
                    ratio = float(np.linalg.norm(further)) / size
                    lower = at.merit(weight) - there.merit(weight) >= hoped
                    if lower or (size <= SMALL and share == 1.0 and ratio <= CONTRACTION):
                        break
                share /= 2
            else:
                break
            if step is not None and cut is None and least_ratio(there.q, begin, step) < 1.0:
                cut = self.part(at, along, share, goal, careful, begin, step)
            at, z, fresh = there, further, fresh and ratio <= FAST and share == 1.0
            trust = 2 * max(share * size, TRUST / 4)
        return at, cut

    def part(
        self, at: Look, z: Vector | None, share: float, goal: Goal, careful: bool, begin: Vector, step: Vector
    ) -> Look:
        """Along a motion of the tool as far as no joint goes farther from its beginning than a step."""
        for _ in range(HALVINGS):
            there = self.inside(self.moved(at, z, share, goal, careful), goal, careful)
            ratio = 0.0 if there is None else least_ratio(there.q, begin, step)
            if there is not None and ratio >= 1.0:
                return there
            share *= min(0.5, 0.99 * ratio) if ratio > 0 else 0.5
        return at

    def compliance(self, at: Look, forces: Vector, goal: Goal) -> Matrix:
        """The inverse of the second derivative by z of |e|^2 / 2 - forces c, made positive definite."""
        pull = at.e + at.A.T @ forces
        H = np.empty((len(pull), len(pull)))
        for k in range(len(pull)):
            there = self.look(at.q + SPREAD * at.S[:, k], goal, at)
            H[:, k] = (pull - there.e - there.A.T @ forces) / SPREAD
        H = (H + H.T) / 2
        held = at.A[forces > 0]
        H += 10 * np.linalg.norm(H) * held.T @ held  # which changes nothing while they are held
        values, vectors = np.linalg.eigh(H)
        return vectors / np.maximum(values, CURVED) @ vectors.T


def least_ratio(q: Vector, begin: Vector, step: Vector) -> float:
    """The least ratio of a step to how far its joint is from its beginning: below 1 one is farther than a step."""
    return float(np.min(step / np.maximum(np.abs(q - begin), 1e-300)))


def rotation_vector(R: Matrix) -> Vector:
    """The axis of a rotation times its angle [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def rotation_matrix(turn: Vector) -> Matrix:
    """The rotation of a rotation vector."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(turn).as_matrix()
