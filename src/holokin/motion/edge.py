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
from ..types import Matrix, Vector, kept
from .branch import _turning
from .leaf import Way, WayEnd, leaf_value, leaf_walk


TRUST = 0.1
"""First step of the tool [m]; steps that succeed double it."""

DONE = 1e-10
"""Step of the tool [m] below which the way down has ended: round-off of a few metres is a ten thousandth of it."""

WITHIN = 1e-10
"""Overshoot of a constraint, in metres of the tool, that counts as none."""

HELD = 1e-7
"""Distance to a constraint, in metres of the tool, at which it holds."""

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

CONTRACTION, FAST = 0.5, 0.1
"""Ratios of two successive steps: up to the first a step is good whatever the distance says, which round-off blurs;
up to the second the curvature need not be looked at again."""

TIGHT = 0.01
"""Distance of a constraint [m] within which curvatures tell of the edge."""

SPREAD = 1e-6
"""Motion of the tool [m] over which slopes are differenced for curvatures, which need but a few digits."""

CURVED = 0.05
"""Least curvature of the model: behind a hollow edge that of the distance may be negative."""

PIECES = 200
"""Pieces of one step of the tool, at most: near a fold they are short."""


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


@dataclass
class Look:
    """What the edge function says of a posture q, with the constraints c (k,) [m] and their slopes A (k, m) by z."""

    q: Vector
    e: Vector
    S: Matrix
    rcond: float
    twist: Matrix
    position: Vector
    rotation: Matrix
    c: Vector
    A: Matrix
    sizes: Vector
    which: np.ndarray

    def merit(self, weight: float) -> float:
        return float(self.e @ self.e) / 2 + weight * self.excess

    @property
    def excess(self) -> float:
        """How far outside the constraints q is [m]."""
        return max(0.0, -float(self.c.min(initial=0.0)))

    @property
    def distance(self) -> float:
        """|e| [m]."""
        return float(self.e @ self.e) ** 0.5


def projection(M: Matrix, e: Vector, A: Matrix, c: Vector) -> tuple[Vector, Vector]:
    """The z with the least 1/2 z^T M^-1 z - e^T z and A z >= -c; with its multipliers, (m,), (k,).

    By Lawson and Hanson's active sets: constraints enter one at a time, the most violated first. [LH95, chapter 23]
    """
    free = M @ e
    MA = M @ A.T
    H, b = A @ MA, A @ free + c
    H[np.diag_indices(len(c))] *= 1 + 1e-12  # constraints that depend on each other share their multipliers
    held: list[int] = []
    multipliers = np.zeros(len(c))
    for _ in range(3 * len(c) + 3):
        slack = H @ multipliers + b
        slack[held] = 0.0
        worst = int(np.argmin(slack)) if len(c) else 0
        if not len(c) or slack[worst] >= -1e-14 * (1 + abs(b[worst])):
            break
        held.append(worst)
        while held:
            wanted = np.linalg.solve(H[np.ix_(held, held)], -b[held])
            if wanted.min() > 0:
                multipliers[held] = wanted
                break
            now = multipliers[held]
            shares = [(now[i] / (now[i] - wanted[i]), i) for i in range(len(held)) if wanted[i] <= 0]
            share, first = min(shares)
            multipliers[held] = now + share * (wanted - now)
            multipliers[held[first]] = 0.0
            del held[first]
    return free + MA @ multipliers, multipliers


class Edge:
    """The postures of one leaf that keep the constraints, and the way down to the one nearest to a pose."""

    def __init__(
        self, strategy: HolonomicStrategy, start: Vector, length: float, margin: float, lower: Vector, upper: Vector
    ) -> None:
        self.strategy, self.start, self.length = strategy, start, length
        self.leaf = leaf_value(strategy, start)
        self._length, self._margin = np.array([length]), margin
        self._function = edge_function(strategy)
        self._lower, self._upper = lower, upper
        self._low, self._high = np.isfinite(lower), np.isfinite(upper)
        self._walk = leaf_walk(strategy, start, PIECES)

    def tool(self, q: Vector) -> tuple[Vector, Matrix]:
        """(position, rotation) of the tool."""
        pose = self.strategy.task.robot.pose(q, self.strategy.task.tip)
        return pose[:3, 3], pose[:3, :3]

    def held(self, at: Look) -> tuple[str, ...]:
        """What stops the tool: "rcond", or joints at their limits."""
        names = np.array(self.strategy.task.robot.joint_names)
        every = np.array(["rcond", *names[self._low], *names[self._high]])[at.which]
        return tuple(every[at.c <= HELD].tolist()) if at.distance > 0 else ()

    def look(self, q: Vector, p: Vector, R: Matrix, scaled: Look | None = None) -> Look:
        """At a posture, with the pose (p, R) wanted."""
        e, S, rcond2, slope, twist, position, rotation = self._function(q, p, R, self._length)
        e, S = np.atleast_1d(e), np.reshape(S, (len(q), -1))
        square = rcond2 / self._margin**2
        A = np.vstack([square * np.reshape(slope, -1) @ S, S[self._low], -S[self._high]])
        c = np.concatenate([[square - 1], (q - self._lower)[self._low], (self._upper - q)[self._high]])
        if scaled is None:
            sizes = np.linalg.norm(A, axis=1)
            moved = sizes > 1e-9 * sizes.max()  # others the tool does not move
            sizes = sizes[moved]
        else:
            sizes, moved = scaled.sizes, scaled.which
        A, c = A[moved] / sizes[:, None], c[moved] / sizes
        return Look(q, e, S, float(rcond2) ** 0.5, np.reshape(twist, (6, -1)), position, rotation, c, A, sizes, moved)

    def moved(self, at: Look, z: Vector, p: Vector, R: Matrix) -> Look | None:
        """The look after a motion z of the tool; None where it does not keep to the branch."""
        from scipy.spatial.transform import Rotation

        twist = at.twist @ z
        levels, turn = self.leaf, twist[3:]

        def way(share: float) -> tuple[Vector, Matrix, Vector]:
            rotation = Rotation.from_rotvec(share * turn).as_matrix() @ at.rotation
            return at.position + share * twist[:3], rotation, levels

        q, ended = self._walk(at.q, Way(way, turn=float(np.linalg.norm(turn))))
        return self.look(q, p, R) if ended is WayEnd.REACHED else None

    def inside(self, at: Look, p: Vector, R: Matrix) -> Look | None:
        """The nearest posture within the constraints, if a few steps lead to it."""
        for _ in range(RETURNS):
            if at.excess <= WITHIN:
                return at
            z, _ = projection(np.eye(len(at.e)), np.zeros(len(at.e)), at.A, at.c)
            there = self.moved(at, z * min(1.0, TRUST / max(np.linalg.norm(z), 1e-300)), p, R)
            if there is None:
                return None
            at = there
        return at if at.excess <= WITHIN else None

    def descend(self, at: Look, p: Vector, R: Matrix, step: Vector | None = None) -> tuple[Look, Look | None]:
        """The end of the way down from a posture within the constraints; and the place on it up to which no joint moves
        by more than a step (n,), None where that is its end."""
        begin, cut = at.q, None
        M, trust = np.eye(len(at.e)), TRUST
        z, multipliers = projection(M, at.e, at.A, at.c)
        fresh = False
        for _ in range(STEPS):
            size = float(np.linalg.norm(z))
            if not fresh:
                held = multipliers > 0
                near = held.any() and at.c[held].max() <= TIGHT
                M, fresh = (self.stiffness(at, multipliers, p, R) if near else np.eye(len(at.e))), near
                z, multipliers = projection(M, at.e, at.A, at.c)
                size = float(np.linalg.norm(z))
            if size <= DONE:
                break
            weight = 2 * multipliers.sum()
            share = min(1.0, trust / size)
            while share * size > DONE:
                there = self.moved(at, share * z, p, R)
                if there is not None and there.excess > NEAR:
                    there = self.inside(there, p, R)
                if there is not None:
                    further, forces = projection(M, there.e, there.A, there.c)
                    ratio = float(np.linalg.norm(further)) / size
                    hoped = DESCENT * share * float(at.e @ z)
                    gain = at.merit(weight) - there.merit(weight)
                    if gain >= hoped or (share == 1.0 and ratio <= CONTRACTION):
                        break
                share /= 2
            else:
                break
            if step is not None and cut is None and not (np.abs(there.q - begin) <= step).all():
                cut = self.part(at, share * z, p, R, begin, step)
            at, z, multipliers, fresh = there, further, forces, fresh and ratio <= FAST and share == 1.0
            trust = 2 * max(share * size, TRUST / 4)
        return at, cut

    def part(self, at: Look, z: Vector, p: Vector, R: Matrix, begin: Vector, step: Vector) -> Look:
        """Along a motion z of the tool as far as no joint goes farther from its beginning than a step."""
        share = 1.0
        for _ in range(HALVINGS):
            there = self.moved(at, share * z, p, R)
            there = there and self.inside(there, p, R)
            room = 0.0 if there is None else float(np.min(step / np.maximum(np.abs(there.q - begin), 1e-300)))
            if there is not None and room >= 1.0:
                return there
            share *= min(0.5, 0.99 * room) if room > 0 else 0.5
        return at

    def stiffness(self, at: Look, multipliers: Vector, p: Vector, R: Matrix) -> Matrix:
        """The inverse of the second derivative by z of |e|^2 / 2 - multipliers c, made positive definite."""
        m, sizes = len(at.e), at.sizes
        pull = at.e + at.A.T @ multipliers
        H = np.empty((m, m))
        for k in range(m):
            there = self.look(at.q + SPREAD * at.S[:, k], p, R, at)
            H[:, k] = (pull - there.e - there.A.T @ multipliers) / SPREAD
        H = (H + H.T) / 2
        held = at.A[multipliers > 0]
        H += 10 * np.linalg.norm(H) * held.T @ held  # changes nothing while they are held
        values, vectors = np.linalg.eigh(H)
        return vectors @ np.diag(1 / np.maximum(values, CURVED)) @ vectors.T
