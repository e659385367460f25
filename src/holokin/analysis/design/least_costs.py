"""The least costs at tool poses, over all postures there and over all slopes: what no strategy can have less of.

A section has at the pose x some posture and some right inverse; at best the cheapest of both. No integrability is
asked, so the mean of these least costs is a lower bound of every strategy with these postures, repeatable or not.

With one redundant joint the postures of a pose are curves, and the least is looked for along whole ones. With several
it is looked for along lines among them, from many starts, one after another from the best postures before: the least
found may then be too high.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.self_motions.posture_search import postures_from, spread
from ...motion.self_motions.self_motions import SelfMotions, self_motions_at
from ...motion.self_motions.stretches import Stretches
from ...strategies.self_motion_curves import CurveTracer, joint_gap, least_motion
from ...strategies.tasks.task import Task
from ...symbolic import wrapped
from ..coverage.pose_coordinates import Coordinates
from .objectives import POWER, Costs

STARTS = 64
"""Starts of Newton's method at each pose where several joints are redundant."""

STEP = 0.2
"""Arc length between the postures of a self-motion that is traced [joint units]."""

CLOSER = (1, 12), (2, 4), (1, 1)
"""How often the stretches of a pose are cut down to an eighth, and how many of them are left then: at the end they are
less than a thousandth of the first distance long."""

UNCOUNTED = 1e100
"""What postures rank at whose cost is inf."""

Cost = Callable[[Matrix], Vector]
"""Postures (k, n) -> values (k,), inf for those that do not count."""


def one_redundant(task: Task) -> bool:
    """Whether one joint is redundant, so that the postures of a pose are curves."""
    return task.n - task.m == 1


def _traced_through(
    task: Task, Q: Matrix, p: Matrix, R: Array, *, step: float = STEP, length: float = 20.0
) -> SelfMotions:
    """The self-motions through postures Q (S, n) at tool poses p (S, 3), R (S, 3, 3), so far each way [joint units].

    Those of a Panda close after 20 or less.
    """
    lines = CurveTracer(task._geometric_twin, p, R).traced(Q, step=step, length=length, limits=False)
    rows = [np.vstack([line.q, line.q[:1]]) if line.closed else line.q for line in lines]
    curve = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    return SelfMotions(task, p, R, np.concatenate(rows), curve, curve, np.array([line.closed for line in lines]))


def _least_on_curves(motions: SelfMotions, cost: Cost, excess_of: Cost) -> Vector:
    """The least (S,) of a cost at each pose: at the postures of the curves, then ever closer round the best places.

    Between two postures that do not count there may be one that does: such places are looked at, too.

    Args:
        excess_of: what is above 0 where the cost is inf, and falls towards where it is not (k,).
    """
    pose, best = motions.pose, np.full(len(motions.p), np.inf)
    value, excess = cost(motions.q), excess_of(motions.q)
    np.minimum.at(best, pose, value)
    # Stretches beside rows where the cost is no higher than beside them, or where the excess is, and may come down to 0
    # between them: it is less than it changes to a neighbour.
    lowest, _ = _dips(value, motions.curve)
    dips, change_to_neighbour = _dips(excess, motions.curve)
    places = lowest | (np.isinf(value) & dips & (excess < change_to_neighbour))
    begin = np.flatnonzero((places[1:] | places[:-1]) & (np.diff(motions.curve) == 0))
    a, pose = motions.q[begin], pose[begin]
    b = a + joint_gap(motions.task.robot, motions.q[begin + 1], a)
    stretches = Stretches.between(motions.task, motions.p[pose], motions.R[pose], a, b)

    def ranked(q: Matrix, _: Indices) -> Vector:
        """The cost; of postures that do not count, which are worse than all others, their excess."""
        value = cost(q)
        return np.where(np.isfinite(value), value, UNCOUNTED * (1 + np.maximum(excess_of(q), 0.0)))

    # Ever shorter parts of them, and fewer and fewer.
    for times, count in CLOSER:
        low, high, value = stretches.bracket(ranked, times)
        chosen = _lowest(value, value, pose, count)
        pose, stretches = pose[chosen], stretches.some(chosen).part(low[chosen], high[chosen])
    q = np.concatenate([stretches.a, stretches.a + stretches.move])
    np.minimum.at(best, np.tile(pose, 2), cost(q))
    return best


def _postures_found(task: Task, Q: Matrix, p: Matrix, R: Array, starts: int) -> SelfMotions:
    """Postures at tool poses p (S, 3), R (S, 3, 3), each a curve of its own: Q (S, n), and those that Newton's method
    finds from so many starts at each pose."""
    task = task._geometric_twin  # which has no singular angles on the way
    pose = np.repeat(np.arange(len(p)), starts)
    q, arrived = postures_from(task, spread(task.robot, starts * len(p)), p[pose], R[pose])
    q, pose = np.concatenate([Q, q[arrived]]), np.concatenate([np.arange(len(p)), pose[arrived]])
    return SelfMotions(task, p, R, q, pose, np.arange(len(q)), np.zeros(len(q), dtype=bool))


def _least_on_lines(postures: SelfMotions, cost: Cost, over: Cost, *, step: float = STEP) -> Vector:
    """The least cost (S,) that lines in random directions of the self-motions come down to, from the best postures.

    Twelve lines for each redundant joint, of ten steps each way: a third of them from the six best postures of a pose,
    a third from the two best with steps shorter by five, and a third from the best, shorter again.
    """
    tracer = CurveTracer(postures.task, postures.p, postures.R)
    pose, rng, best = postures.pose, np.random.default_rng(0), np.full(len(postures.p), np.inf)
    q, value, excess = postures.q, cost(postures.q), over(postures.q)
    for third, count in enumerate((6, 2, 1)):
        chosen = _lowest(value, excess, pose, count)
        q, pose = q[chosen], pose[chosen]
        for _ in range(4 * (postures.task.n - postures.task.m)):
            line = _line_through(tracer, q, rng.normal(size=q.shape), pose, step / 5**third, 10)
            at, value, excess = _best_of(line, cost, over)
            q = line[at, np.arange(len(q))]
    np.minimum.at(best, pose, value)
    return best


def _line_through(motions: CurveTracer, q: Matrix, v: Matrix, pose: Indices, step: float, count: int) -> Array:
    """Postures (2 count + 1, k, n) on self-motions through some (k, n): these, and so many steps both ways."""
    line = [q]
    for sign in (1.0, -1.0):
        posture, along, _ = motions.step(q, sign * v, pose, np.zeros(len(q)))
        for _ in range(count):
            posture, along, _ = motions.step(posture, along, pose, np.full(len(q), step))
            line.append(posture)
    return np.array(line)


def _best_of(line: Array, cost: Cost, over: Cost) -> tuple[Indices, Vector, Vector]:
    """(which of the j postures (j, k, n) is the best (k,), its cost (k,) and excess (k,)); of those that cost inf the
    nearest, of equal ones that nearest to the middle one."""
    j, k, n = line.shape
    order, every = np.argsort(np.abs(np.arange(j) - j // 2), kind="stable"), np.arange(k)
    flat = line[order].reshape(-1, n)
    value, excess = cost(flat).reshape(j, k), over(flat).reshape(j, k)
    best = np.where(np.isfinite(value).any(axis=0), value.argmin(axis=0), excess.argmin(axis=0))
    return order[best], value[best, every], excess[best, every]


def _dips(value: Vector, curve: Indices) -> tuple[Flags, Vector]:
    """(where values along curves are finite and not above their neighbours', by how much they differ from these)."""
    same = np.diff(curve) == 0
    after = np.append(np.where(same, value[1:], np.inf), np.inf)
    before = np.append(np.inf, np.where(same, value[:-1], np.inf))
    with np.errstate(invalid="ignore"):
        steps = np.fmax(*(np.where(np.isfinite(v), np.abs(v - value), 0.0) for v in (before, after)))
    return np.isfinite(value) & (value <= np.minimum(before, after)), steps


def _lowest(value: Vector, excess: Vector, pose: Indices, count: int) -> Indices:
    """Which of some places cost the least at their poses, so many of each."""
    order = np.lexsort((excess, value, pose))
    first = np.searchsorted(pose[order], pose[order])
    return order[np.arange(len(order)) - first < count]


@dataclass(frozen=True, eq=False)
class LeastCosts(Value):
    """The least costs (S,) at each tool pose over postures there, those between them included.

    allowed: |q - middle| over half the range (n,) up to which postures count, full turns of hinges taken off; inf for
        all. Costs are inf where no posture is within.
    """

    postures: SelfMotions
    coordinates: Coordinates
    costs: Costs
    allowed: Vector

    @cached_property
    def squared_speed(self) -> Vector:
        """The least |G|^2, as in `Costs`."""

        def cost(q: Matrix) -> Vector:
            G = least_slopes(self._J(q), self.coordinates.P, self.costs.joints)
            return np.sum(G**2 * self.costs.joints[:, None] * self.costs.columns**2, axis=(1, 2))

        return self._least(cost)

    @cached_property
    def joint_limits(self) -> Vector:
        """The least distance of the farthest joint from its middle, over half its range."""
        return self._least(lambda q: self._off(q).max(axis=1))

    @cached_property
    def beyond(self) -> Vector:
        """How far a posture is beyond the allowed limits at least, 0 where one is within."""
        if np.isinf(self.allowed).all():
            return np.zeros(len(self.postures.p))
        return np.maximum(self._over_postures(self._over), 0.0)

    def _least(self, cost: Cost) -> Vector:
        """The least of a cost over the postures that count."""

        def allowed_cost(q: Matrix) -> Vector:
            values, within = np.full(len(q), np.inf), self._over(q) <= TOLERANCES.limit
            values[within] = cost(q[within])
            return np.where(np.isfinite(values), values, np.inf)

        return self._over_postures(allowed_cost)

    def _over_postures(self, cost: Cost) -> Vector:
        least = _least_on_curves if one_redundant(self.postures.task) else _least_on_lines
        return least(self.postures, cost, self._over)

    def _J(self, q: Matrix) -> Array:
        return self.coordinates.chart.jacobian_batch(q)[0]

    def _off(self, q: Matrix) -> Matrix:
        gap, turning = q - self.costs.middle, self.coordinates.chart.robot.hinges & np.isfinite(self.costs.half)
        return np.abs(np.where(turning, wrapped(gap), gap)) / self.costs.half

    def _over(self, q: Matrix) -> Vector:
        return (self._off(q) - self.allowed).max(axis=1)


@dataclass(frozen=True, eq=False)
class Floor(Value):
    """What no strategy at tool poses p (S, 3), R (S, 3, 3) can have less of.

    Q: a strategy's postures (S, n). weights: of the costs, by name. allowed: as in `LeastCosts`.
    """

    coordinates: Coordinates
    costs: Costs
    weights: dict[str, float]
    allowed: Vector
    Q: Matrix
    p: Matrix
    R: Array

    @cached_property
    def here(self) -> LeastCosts:
        """The least costs over the self-motions of the strategy's postures."""
        task, curves = self.coordinates.chart, one_redundant(self.coordinates.chart)
        through = _traced_through if curves else partial(_postures_found, starts=0)
        return self._over(through(task, self.Q, self.p, self.R))

    @cached_property
    def anywhere(self) -> LeastCosts:
        """The least costs over all postures, of several redundant joints over those found.

        Hinges stand at the turns nearest to the strategy's postures.
        """
        task = self.coordinates.chart
        if one_redundant(task):
            motions = self_motions_at(task, self.p, self.R)
            near = self.Q[motions.pose]
            return self._over(replace(motions, q=near + joint_gap(task.robot, motions.q, near)))
        return self._over(_postures_found(task, self.Q, self.p, self.R, STARTS))

    def _over(self, postures: SelfMotions) -> LeastCosts:
        return LeastCosts(postures, self.coordinates, self.costs, self.allowed)

    def of(self, least: LeastCosts) -> float:
        """The weighted costs of these least ones: no strategy has less, since each of the costs is at its least there.

        Where the strategy's own self-motions leave the allowed limits, limits do not count.
        """
        if self.here.beyond.any():
            least = replace(least, allowed=np.full_like(self.allowed, np.inf))
        floors = {
            "squared_speed": lambda: float(np.mean(least.squared_speed)),
            "joint_limits": lambda: float(np.mean(least.joint_limits**POWER) ** (1 / POWER)),
        }
        return sum(weight * floors[name]() for name, weight in self.weights.items())


def least_slopes(J: Array, P: Matrix, weights: Array) -> Array:
    """G P (S, n, d) of the right inverse with the least weighted squared joint speed: W^-1 J^T (J W^-1 J^T)^-1 P.

    weights: (n,), or one for each sample (S, n).
    """
    return least_motion(J, np.broadcast_to(P, (len(J), *P.shape)), weights)
