"""`closest_holonomic`: the repeatable strategy nearest to a given one over a joint region. [RM93], theory 2b, 5.4

A strategy with leaves g(q) = const differs from a given one G by a self-motion (theory 1.5),

    G_g - G = -N (J_g N)^-1 J_g G.

With coordinates (x, phi) of the region, x the tool pose and phi a base constraint, dphi = A dx along G and
-g_phi^-1 g_x dx along the leaves. With Z = dq/dphi at a held tool the distance squared is the mean over the region of

    D(g) = |Z (g_phi^-1 g_x + A)|_F^2,

for any number of redundant joints. D does not change when g is relabelled, g -> psi(g): the gauge is fixed by
g = phi at the middle of the region's tool poses, that is, every term of g - phi has a factor that vanishes there. The
search begins with the least squares of g_x + g_phi A, which is linear in g, and goes on with D itself and a small
-log det g_phi, which keeps det [J; J_g] from zero.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import made, typed
from ...base.errors import ArgumentError, SingularityError, posture_text
from ...base.poses import pose_from
from ...base.types import Array, Matrix, Result, Value, Vector, frozen, whole
from ...motion.ik import ik
from ...path.workspaces import Cylinder, Sphere, sobol
from ...robot import Kinematics
from ...strategies import CurveTracer, HolonomicStrategy, Strategy, holonomic, radial, self_motion_curve
from ...strategies.constraints import Constraint, formulas_of, linear, lock
from ...strategies.right_inverses import monomials, monomials_up_to
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import SX, Function, cos, jacobian, sin, symbol, vertcat
from ...symbolic.linear import null_space
from ..coverage.pose_coordinates import Coordinates, chart_of, coordinates_of
from ..curvature import Ball, Deviation, Region
from ..curvature.leaf_functions import deviation_of, distance_to_repeatable
from .objectives import Objective, length_of
from .section import Cost, TiltedLeaves, descend

# --- Leaves g = phi + a series of the tool pose and phi over a joint region, and their distance from a given strategy.
#
# The strategy of such leaves moves phi by -g_phi^-1 g_x dx, the given one by A dx; with Z = dq/dphi at a held tool the
# squared distance is D = mean |Z (g_phi^-1 g_x + A)|_F^2 (see `closest_strategy`).


@dataclass(frozen=True, eq=False)
class Series(Value):
    """g(x, phi) = phi + C b(u, w) (r,): terms b that vanish at u = 0.

    Without a period, monomials of u and w = (phi - middle) / scale; with one (r = 1), monomials of u times 1, cos(k w),
    sin(k w), w = 2 pi phi / period.
    """

    coordinates: Coordinates
    degree: int
    middle: Vector
    scale: Vector
    period: float | None
    coefficients: Matrix

    def basis(self, u: SX, phi: SX) -> SX:
        """b (t,) as an expression."""
        d = self.coordinates.d
        if self.period is None:
            terms = monomials_up_to(d + len(self.middle), self.degree)
            w = (phi - SX(self.middle)) / SX(self.scale)
            every = monomials(vertcat(u, w), terms)
            return every[[i for i, term in enumerate(terms) if any(v < d for v in term)]]
        w = 2 * np.pi / self.period * phi
        waves = [SX(1), *(f(k * w) for k in range(1, self.degree // 2 + 1) for f in (cos, sin))]
        powers = monomials(u, monomials_up_to(d, self.degree)[1:])
        return vertcat(*(powers * wave for wave in waves))

    def __call__(self, x: SX, phi: SX) -> SX:
        """g (r,) as an expression of the tool pose in the chart and the base constraint."""
        return phi + SX(self.coefficients) @ self.basis(self.coordinates.of(x), phi)


def series_over(
    base_strategy: HolonomicStrategy, coordinates: Coordinates, Q: Matrix, degree: int, period: float | None
) -> Series:
    """The series over postures (k, n) and the base strategy's phi, without coefficients yet."""
    phi = base_strategy.constraint_value.batch(Q).reshape(len(Q), base_strategy.constraint.rows)
    middle, scale = (phi.max(axis=0) + phi.min(axis=0)) / 2, np.ptp(phi, axis=0) / 2
    return Series(coordinates, degree, middle, scale, period, np.zeros((base_strategy.constraint.rows, 0)))


@made
def _along_leaves(task: Task, base: Constraint, series: Series, *, name: str = "nearest") -> HolonomicStrategy:
    """The strategy with the leaves g(x, phi(q)) = const of a series."""

    def expression(bound: Task, k: Kinematics, q: SX) -> SX:
        return series(series.coordinates.chart.value_expression(k), base.expand(bound, k, q))

    constraint = Constraint(name, base.rows, expression, base.angular, base.margin, formulas=formulas_of([base]))
    return holonomic(task, constraint, name=name)


@dataclass(frozen=True, eq=False)
class SampledSeries(Value):
    """Postures of a region, in its coordinates: all that D needs, since they stay while the leaves change.

    J (S, m, n) of the task; X (S, n, d) and G (S, n, d), dq/dx along phi = const and along the given strategy; Z (S, n,
    r); A (S, r, d) = dphi/dx along the given strategy; by_u (S, t, d), by_phi (S, t, r): slopes of the terms; weights
    (d,).
    """

    Q: Matrix
    J: Array
    X: Array
    G: Array
    Z: Array
    A: Array
    by_u: Array
    by_phi: Array
    weights: Vector

    @classmethod
    def of(
        cls, strategy: Strategy, base: HolonomicStrategy, series: Series, weights: Vector, Q: Matrix
    ) -> SampledSeries:
        """Of a given strategy and a base strategy, at postures (S, n).

        Raises:
            SingularityError. ArgumentError: phi folds, where rcond of [J; J_phi] is below 1e-4: it is no coordinate.
        """
        c, r, S = series.coordinates, base.constraint.rows, len(Q)
        section = TiltedLeaves(base, c).slopes(Q, np.zeros((S, r, c.d)))
        if section is None or not section.rcond.min() > 1e-4:
            rcond = base.gain.batch(Q)[1]
            what = f"rcond of the base constraint at q = {posture_text(Q[int(np.argmin(rcond))])}"
            raise ArgumentError(what, float(rcond.min()), "give another base, or a smaller region")
        # The given strategy moves the tool along the coordinates, and phi by A
        J = strategy.task.jacobian_batch(Q)[0]
        G = strategy.batch(Q) @ (J @ section.G)
        ZT = np.swapaxes(section.Z, 1, 2)
        A = np.asarray(np.linalg.solve(ZT @ section.Z, ZT @ (G - section.G)), dtype=float)
        # The slopes of the terms
        u, phi = symbol("u", c.d), symbol("phi", r)
        b = series.basis(u, phi)
        slopes = Function("series", {"u": u, "phi": phi}, {"by_u": jacobian(b, u), "by_phi": jacobian(b, phi)})
        by_u, by_phi = slopes.batch(c.at(Q), base.constraint_value.batch(Q).reshape(S, r))
        t = b.shape[0]
        by_u, by_phi = by_u.reshape(S, t, c.d) / c.scale, by_phi.reshape(S, t, r)
        return cls(Q, J, section.G, G, section.Z, A, by_u, by_phi, weights)

    def of_strategy(self, other: Strategy) -> Array:
        """dq/dx (S, n, d) of another strategy. Raises: SingularityError."""
        return other.batch(self.Q) @ (self.J @ self.X)

    def off(self, C: Matrix) -> tuple[Array, Vector]:
        """(what the strategy of a series adds to the given one (S, n, d), det g_phi (S,))."""
        M, slopes = self._leaves(C)
        return self.Z @ (slopes - self.A), np.linalg.det(M)

    def deviation(self, off: Array) -> Deviation:
        """The deviation of a strategy that adds so much."""
        return deviation_of(self.G * self.weights, off * self.weights)

    def _leaves(self, C: Matrix) -> tuple[Array, Array]:
        """(g_phi (S, r, r), dphi/dx along the leaves (S, r, d))."""
        M = np.eye(len(C)) + np.einsum("rt,stk->srk", C, self.by_phi)
        with np.errstate(all="ignore"):
            return M, -np.linalg.solve(M, np.einsum("rt,std->srd", C, self.by_u))

    @cached_property
    def _metric(self) -> Array:
        """Z^T Z (S, r, r): what a difference of dphi/dx counts in joint motion."""
        return np.swapaxes(self.Z, 1, 2) @ self.Z

    @cached_property
    def _linear(self) -> tuple[Matrix, Vector]:
        """(white (r t, k), x (k,)): coefficients white x make |Z (g_x + g_phi A)| least, whose matrix white makes 1."""
        S, r, d = self.A.shape
        root = np.swapaxes(np.linalg.cholesky(self._metric), 1, 2)
        terms = (self.by_u + self.by_phi @ self.A) * self.weights
        rows = np.einsum("sak,std->sadkt", root, terms).reshape(S * r * d, -1) / np.sqrt(S)
        wanted = -(root @ (self.A * self.weights)).ravel() / np.sqrt(S)
        left, sizes, right = np.linalg.svd(rows, full_matrices=False)
        distinct = sizes > 1e-9 * sizes[0]  # below, terms are not told apart
        return right[distinct].T / sizes[distinct], left.T[distinct] @ wanted

    def coefficients(self, x: Vector) -> Matrix:
        """(r, t) of the numbers x (k,) that the search is over."""
        return (self._linear[0] @ x).reshape(self.A.shape[1], -1)

    def cost(self, barrier: float) -> Cost:
        """D - barrier mean log det g_phi over the numbers of the search; None where g_phi turns."""
        S = len(self.A)

        def cost(x: Vector, _near: None) -> tuple[float, Vector, None] | None:
            M, slopes = self._leaves(self.coefficients(x))
            sign, size = np.linalg.slogdet(M)
            if not (sign > 0).all():
                return None
            difference = slopes - self.A
            weighted = self._metric @ difference * self.weights**2
            # The gradient backwards through slopes = -M^-1 g_u: d slopes = -M^-1 (dM slopes + dg_u), and
            # d log det M = tr(M^-1 dM).
            adjoint = np.linalg.solve(np.swapaxes(M, 1, 2), 2 * weighted)
            by_M = -adjoint @ np.swapaxes(slopes, 1, 2) - barrier * np.swapaxes(np.linalg.inv(M), 1, 2)
            by_C = np.einsum("srk,stk->rt", by_M, self.by_phi) - np.einsum("srd,std->rt", adjoint, self.by_u)
            value = float(np.sum(difference * weighted) - barrier * size.sum()) / S
            return value, by_C.ravel() @ self._linear[0] / S, None

        return cost

    def best(self) -> tuple[Matrix, tuple[float, float]]:
        """(coefficients (r, t) of the least D, rms deviations after the least squares and in the end)."""
        x = self._linear[1]
        while self.cost(0.0)(x, None) is None:
            x = x / 2
        first = self.deviation(self.off(self.coefficients(x))[0]).rms
        # The weight of -log det g_phi, as a share of the least squares' distance: it moves the optimum by less
        barrier = 1e-4 * float(np.sum((first * self.G * self.weights) ** 2) / len(self.G))
        C = self.coefficients(descend(self.cost(barrier), x, None)[0])
        return C, (first, self.deviation(self.off(C)[0]).rms)


WHOLE = 0.9
"""Share of a closed self-motion that a region must hold for g to be written with its period."""

JUDGED = 1024
"""Postures, besides those of the search, that a strategy is judged at: figures are right to about a per cent."""


@dataclass(frozen=True, eq=False)
class ClosestHolonomic(Result, Value):
    """The nearest repeatable strategy that was found, and how near others are.

    strategy: an ordinary one; start (n,): the posture in the middle of the region.
    ours, radial: how far it and the radial strategy about the start are from the given strategy, at other postures of
        the region than those of the search; radial is None where it is singular at one of them. With positions and
        turns, a turn counts as `length` metres a radian.
    bound: for one redundant joint and a ball: every strategy with smooth leaves is at some posture of the circle round
        the ball at least so far from the given one. It bounds `largest`, not `rms` (theory 5.4). None elsewhere.
    least_slope: the least det g_phi at those postures, 1 in the middle; leaves fold where it is 0.
    terms: of the series; 0 where the given strategy is repeatable and `strategy` is radial of it.
    steps: rms at the samples of the search, by least squares and in the end.
    """

    strategy: HolonomicStrategy
    q0: Vector
    ours: Deviation
    radial: Deviation | None
    bound: float | None
    least_slope: float
    length: float
    terms: int
    steps: tuple[float, float]

    def __str__(self) -> str:
        other = "singular in the region" if self.radial is None else str(self.radial)
        lines = [
            "difference from the joint rates of the given strategy, |G' - G| / |G|:",
            f"  the nearest strategy of {self.terms} terms: {self.ours}",
            f"  the radial strategy: {other}",
            *([] if self.bound is None else [f"  every smooth strategy: at least {self.bound:.2%} at some posture"]),
            "the nearest strategy keeps g constant, a function of the tool pose and of the base constraint phi:",
            f"  det dg/dphi is at least {self.least_slope:.2g} at the sampled postures; at 0 the strategy is singular",
        ]
        return "\n".join(lines)


@typed
def closest_holonomic(
    strategy: Strategy,
    region: Region | Ball,
    *,
    base: Constraint | None = None,
    degree: int = 4,
    samples: int = 4096,
    seed: int = 0,
    length: float | None = None,
) -> ClosestHolonomic:
    """The repeatable strategy nearest to a given one over a joint region, in the mean of |G_g - G|_F^2. [RM93]

    Its leaves are g = phi + a series of the tool pose and phi: polynomials up to `degree`, and where the region holds
    whole closed self-motions, round which phi grows, polynomials of the pose times sines and cosines of phi.

    Args:
        region: `around` or `box` in joint space, all directions of the tool counting; or a `ball` of tool positions
            with `along` > 0, orientation kept, where positions alone count.
        base: phi, r rows, one to one along the self-motions of the region; by default the constraint of a strategy that
            has one, so that this strategy itself is found; else the joints' part along the self-motion in the middle,
            or with a whole closed self-motion the hinge that turns round in it.
        samples: postures of the search; others judge it.
        length: metres that a turn of 1 rad counts as; by default the region's spread of positions over that of turns.

    Raises:
        ArgumentError: no redundant joint, a ball without `along`, a base that folds in the region, bad numbers.
        SingularityError: the given strategy is singular in the region.
    """
    # The base strategy, over the region
    task = strategy.task
    of_one_tool(task, "nearest")
    r = task.n - task.m
    if r == 0:
        raise ArgumentError("the number of redundant joints", 0, "each tool pose has its joints already")
    whole("the degree", degree)
    start = task.robot.checked(region.start if isinstance(region, Ball) else region.center, "the middle of the region")
    own = strategy.constraint if isinstance(strategy, HolonomicStrategy) else None
    phi, period = (base or own, None) if r > 1 else _base(task, base or own, start, region)
    base_strategy = holonomic(task, phi or linear(null_space(task.jacobian(start)).T, name="along the self-motion"))
    Q = _postures(base_strategy, region, start, whole("samples", samples) + JUDGED, seed)
    # The nearest series, at some of the postures, and how near it is at the others
    coordinates = coordinates_of(chart_of(task, task.pose(start)[:3, :3]), Q)
    metres = length_of(Objective(1.0, length=length), coordinates.turns, coordinates.spread)
    weights = np.where(coordinates.turns, 1 / metres, 1.0)
    series = series_over(base_strategy, coordinates, Q, degree, period)
    parts = Q[JUDGED:], Q[:JUDGED]
    searched, judged = (SampledSeries.of(strategy, base_strategy, series, weights, part) for part in parts)
    C, steps = searched.best()
    nearest = _along_leaves(task, base_strategy.constraint, replace(series, coefficients=frozen(C)))
    off, fold = judged.off(C)
    ours, least, terms = judged.deviation(off), float(fold.min()), C.shape[1]
    # The bound, which is of the circle: few postures go into the estimates beside it
    bound = None
    if isinstance(region, Ball) and r == 1:
        bound = distance_to_repeatable(strategy, region, samples=16, seed=seed).bound
    # The radial strategy: the given one has leaves if it is that. Steps of radial leave 5e-6 of a strategy with the arm
    # angle of a Panda held, over +-0.15 rad
    straight, near = radial(strategy, start), None
    with suppress(SingularityError):
        near = judged.deviation(judged.of_strategy(straight) - judged.G)
    if near is not None and near.rms < min(1e-4, ours.rms):
        nearest, ours, least, terms = straight, near, 1.0, 0
    return ClosestHolonomic(nearest, start, ours, near, bound, least, metres, terms, steps)


def _base(
    task: Task, base: Constraint | None, q0: Vector, region: Region | Ball
) -> tuple[Constraint | None, float | None]:
    """(base constraint, period), with one redundant joint: a period where the region holds closed self-motions that phi
    grows round.
    """
    circuit = self_motion_curve(task, q0, step=0.05, limits=False)
    if not circuit.closed:
        return base, None
    turned = circuit.q[-1] - circuit.q[0]
    hinges = [j for j in range(task.n) if task.robot.hinges[j] and abs(turned[j]) > np.pi]
    if isinstance(region, Ball):
        holds = 2 * region.along >= WHOLE * (circuit.s[-1] - circuit.s[0])
    else:
        holds = bool(hinges) and bool((region.upper - region.lower)[hinges].min() >= WHOLE * 2 * np.pi)
    if not holds or (base is None and not hinges):
        return base, None
    base = base or lock(hinges[0])
    first, last = holonomic(task, base).constraint_value.batch(circuit.q[[0, -1]]).ravel()
    turn = abs(float(np.round((last - first) / (2 * np.pi)) * 2 * np.pi))
    return base, turn or None


def _postures(base: HolonomicStrategy, region: Region | Ball, q0: Vector, count: int, seed: int) -> Matrix:
    """Postures (k, n) that fill the region evenly: a box in its joints, a ball in tool positions and arc length."""
    if isinstance(region, Region):
        return region.sample(count, seed)
    task, along = base.task, region.along
    if not along > 0:
        ball = "hk.analysis.curvature.ball(start, radius, along=...)"
        raise ArgumentError("`along` of the ball", along, f"give {ball}: a repeatable strategy has leaves side by side")
    # Postures of the base strategy at tool positions of the ball, or of a disc in the plane of a planar robot
    u, pose = sobol(4, count, seed), task.pose(q0)
    center = pose[:3, 3]
    ball = Cylinder(center, region.radius, 0.0) if task.robot.planar else Sphere(center, region.radius)
    poses = pose_from(ball.points(u[:, :3]), pose[:3, :3])
    solutions = ik(base, q0, limits=False).batch(poses)
    arrived = solutions.reached
    Q, p, R = solutions.q[arrived], poses[arrived, :3, 3], poses[arrived, :3, :3]
    # Each moved along its self-motion, once round it at most; two Newton corrections bring a step of 0.2 to round-off
    if task.n - task.m == 1:
        circuit = self_motion_curve(task, q0, step=0.05, limits=False)
        along = min(along, (circuit.s[-1] - circuit.s[0]) / 2) if circuit.closed else along
    v = np.random.default_rng(seed).normal(size=Q.shape)
    Q, sound = CurveTracer(task, p, R).walked(Q, v, (2 * u[arrived, 3] - 1) * along, 0.2)
    if not sound.sum() > JUDGED:
        raise ArgumentError(f"the postures found in the ball, of {count}", int(sound.sum()), "give a smaller ball")
    return Q[sound]
