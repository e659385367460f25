"""What the planes of a strategy tell: leaf functions, the form of the paper, the distance to a repeatable strategy.

`radial` carries along the same segments, as an expression. The 32 steps that a comparison of two paths asks for would
be 3.4 million operations for twelve joints, ten seconds to build: so numbers are carried here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, NotHolonomicError
from ...base.types import ArrayLike, Matrix, Result, Value, Vector, frozen, positive, whole
from ...robot import Robot
from ...strategies import HolonomicStrategy, Strategy, check_solved, radial, self_motion_curve
from ...symbolic import Function, jacobian, runge_kutta, symbol
from ...symbolic.linear import null_space
from .curvature_of_planes import TRANSPORT_STEPS, curvature, curvature_function, pairs, straight_postures, transport
from .involutive import involutivity, involutivity_at
from .verdict import Ball, Verdict, around


@dataclass(frozen=True, eq=False)
class LeafFunction(Value):
    """g(q) (r,) = Z^T (q_b - q_ref), zero on the leaf of the reference; q_b is where the strategy leads from q when
    the tool goes straight back to the reference pose, Z (n, r) spans the self-motions there."""

    strategy: Strategy
    reference: Vector

    def __call__(self, q: ArrayLike) -> Vector:
        """g(q) (r,) [joint units]. Raises: SingularityError on the way back; ShapeError, NotFiniteError."""
        q = self.strategy.task.robot.checked(q)
        return self._Z.T @ (transport(self.strategy, q, self._back(q)) - self.reference)

    def gradient(self, q: ArrayLike) -> Matrix:
        """J_g (r, n), carried along with the posture by the derivative of the flow.

        Raises:
            SingularityError on the way back; ShapeError, NotFiniteError.
        """
        q = self.strategy.task.robot.checked(q)
        v, task, n = self._back(q), self.strategy.task, len(q)
        V = np.reshape(task._error_and_slope(q, *task.target(self._pose))[1], (task.m, n))

        def slope(y: Matrix, v: Vector) -> Matrix:
            dq, dD, rcond, margin = self._flow(y[:, 0], v, y[:, 1:], V)
            check_solved(self.strategy, y[:, 0], rcond, margin)
            return np.column_stack([dq, np.reshape(dD, (n, n))])

        y = np.column_stack([q, np.eye(n)])
        for _ in range(TRANSPORT_STEPS):
            y = runge_kutta(slope, y, 1.0 / TRANSPORT_STEPS, v, v, v)
        return self._Z.T @ y[:, 1:]

    def disagreement(self, q: ArrayLike, by: ArrayLike) -> float:
        """How far apart [joint units] two paths back to the reference end: straight, and by the tool pose of `by`."""
        robot, task = self.strategy.task.robot, self.strategy.task
        q, corner = robot.checked(q), robot.checked(by)
        direct = transport(self.strategy, q, self._back(q))
        there = transport(self.strategy, q, task.error(q, *task._place(corner)))
        return float(np.abs(transport(self.strategy, there, self._back(there)) - direct).max())

    def _back(self, q: Vector) -> Vector:
        """The straight path (m,) from the tool pose at q to the reference, in task rates."""
        task = self.strategy.task
        return task.error(q, *task.target(self._pose))

    @cached_property
    def _pose(self) -> Matrix:
        return frozen(self.strategy.task.pose(self.reference))

    @cached_property
    def _Z(self) -> Matrix:
        return frozen(null_space(self.strategy.task.jacobian(self.reference)))

    @cached_property
    def _flow(self) -> Function:
        """(q, v, D, V) -> (G v, (G v)' D + G V, rcond, margin)."""
        e, task = self.strategy.expressions, self.strategy.task
        v, D, V = symbol("v", task.m), symbol("D", task.n, task.n), symbol("V", task.m, task.n)
        rate = e.rate(v, written_out=True)
        dD = jacobian(rate.X, e.q) @ D + e.rate(V, written_out=True).X
        outputs = {"dq": rate.X, "dD": dD, "rcond": rate.rcond, "margin": self.strategy._margin_expression}
        return Function("flow", {"q": e.q, "v": v, "D": D, "V": V}, outputs)

    def check(self, q: ArrayLike) -> None:
        """Look at the curvature at q and at 32 postures of its path back, where g and its gradient come from.

        Raises:
            NotHolonomicError, SingularityError, UndecidedError; ShapeError, NotFiniteError.
        """
        q = self.strategy.task.robot.checked(q)
        postures = straight_postures(self.strategy, q, self._back(q))
        _refuse_curved(self.strategy, involutivity_at(self.strategy, postures))


@typed
def leaf_function(
    strategy: Strategy, reference: ArrayLike, *, radius: float = 0.1, samples: int = 8, seed: int = 0
) -> LeafFunction:
    """g of an involutive strategy, given by N_G or G alone, near a reference posture (n,).

    Before it is returned, `samples` postures within `radius` [joint units] of the reference are carried back straight
    and by a detour, and must end within 1e-6 of each other; and the strategy must be holonomic by `involutivity` at 64
    postures of that box, which sees a curvature too weak, or loops too symmetric, for the detours to show it.
    Farther out nothing was looked at: `check(q)` does so for one posture.

    Raises:
        NotHolonomicError: two transports disagree, or there is curvature; it holds the witness.
        SingularityError: on the way. UndecidedError: round-off hides all curvature. ShapeError, NotFiniteError.
    """
    robot: Robot = strategy.task.robot
    start = robot.checked(reference, "the reference posture")
    strategy(start)
    g, rng = LeafFunction(strategy, start), np.random.default_rng(whole("seed", seed, 0))
    whole("samples", samples)
    positive("radius", radius)
    # Detours: a hundred times the error of two transports is no agreement
    pairs_of_postures = [start + rng.uniform(-radius, radius, (2, robot.n)) for _ in range(samples)]
    gaps = [g.disagreement(q, corner) for q, corner in pairs_of_postures]
    worst = int(np.argmax(np.nan_to_num(gaps)))
    if gaps[worst] > 1e-6:
        raise NotHolonomicError(strategy.name, pairs_of_postures[worst][0], gaps[worst])
    # Curvature
    _refuse_curved(strategy, involutivity(strategy, around(start, radius), seed=seed))
    return g


def _refuse_curved(strategy: Strategy, verdict: Verdict) -> None:
    if not verdict.holonomic:
        raise NotHolonomicError(strategy.name, verdict.witness, curvature=verdict.relative)


# --- Theorem III.2 as a call: a holonomic G in, the paper's J_G, N_G, H out, with (7) to (14) checked. [ZR11]


@dataclass(frozen=True, eq=False)
class GeneralForm(Result, Value):
    """The paper's general form of a holonomic strategy at q: G = H H^T J^T (J H H^T J^T)^-1, H = [N_G N].

    J (m, n), G (n, m); J_G (r, n) the gradient of its g; N_G (n, m) an orthonormal basis of ker J_G, N (n, r) a basis
    of ker J.
    """

    q: Vector
    J: Matrix
    G: Matrix
    J_G: Matrix
    N_G: Matrix
    N: Matrix

    @property
    def H(self) -> Matrix:
        """H = [N_G N] (n, n)."""
        return np.hstack([self.N_G, self.N])

    @property
    def J_A(self) -> Matrix:
        """(11): the extended Jacobian [J; J_G] (n, n)."""
        return np.vstack([self.J, self.J_G])  # (11)

    def residuals(self) -> dict[str, float]:
        """How far (7), (8), (10), (13), (14) are from holding, and how safely (9), (11), (12) and "H" hold.

        The margins are smallest singular values, of J N_G (9), J_A (11) and H, which Theorem III.2 asks to be
        nonsingular; and for (12), Null(J) and Null(J_G) meet in 0 alone, the sine of the smallest angle between them.
        """

        def largest(A: Matrix) -> float:
            return float(np.abs(A).max(initial=0.0))

        def least(A: Matrix) -> float:
            return float(np.linalg.svd(A, compute_uv=False).min(initial=np.inf))

        m, W = len(self.J), self.H @ self.H.T
        G = W @ self.J.T @ np.linalg.inv(self.J @ W @ self.J.T)
        kernel = np.linalg.qr(self.N)[0]
        blocks = self.J_A @ self.H
        identity = np.vstack([np.eye(m), np.zeros((len(self.J_G), m))])
        return {
            "(7)": largest(G - self.G),  # (7)
            "(8)": largest(W @ self.J.T - self.N_G @ (self.J @ self.N_G).T),  # (8)
            "(9)": least(self.J @ self.N_G),  # (9)
            "(10)": largest(self.J_G @ self.G),  # (10)
            "(11)": least(self.J_A),
            "(12)": min(1.0, least(kernel - self.N_G @ (self.N_G.T @ kernel))),  # (12)
            "(13)": max(largest(blocks[:m, m:]), largest(blocks[m:, :m])),  # (13)
            "(14)": largest(self.J_A @ G - identity),  # (14): what J_A G is
            "H": least(self.H),
        }

    def __str__(self) -> str:
        values = "; ".join(f"{name} {value:.1e}" for name, value in self.residuals().items())
        return f"what is 0 in the general form, and the margins (9), (11), (12) and H, which are above 0: {values}"


@typed
def general_form(strategy: Strategy, q: ArrayLike, reference: ArrayLike | None = None) -> GeneralForm:
    """Theorem III.2, 1 => 2: the general form of a holonomic strategy at q (n,). [ZR11]

    J_G is the gradient of the strategy's constraint, or, if it has none, of the `leaf_function` recovered from G about
    the reference (q itself by default), whose curvature must vanish near the reference and on the way to it from q.
    The other direction, 2 => 1, is `null_basis` with `involutivity`.

    Raises:
        NotHolonomicError: there is no g, with a witness. SingularityError: J or H is singular at q.
    """
    task = strategy.task
    posture = task.robot.checked(q)
    G, J = strategy(posture), task.jacobian(posture)
    if isinstance(strategy, HolonomicStrategy):
        J_G = strategy.rows(posture)
    else:
        g = leaf_function(strategy, posture if reference is None else reference)
        g.check(posture)
        J_G = g.gradient(posture)
    N_G = null_space(J_G) if len(J_G) else np.eye(task.n)  # (25): an orthonormal basis of its span, for the g of (24)
    # Theorem III.2: 1 => 2
    return GeneralForm(posture, J, G, J_G, N_G, task.null_space(posture))


# --- The distance to a repeatable strategy: how close can a holonomic strategy be to a given one? (theory 5.4)


@dataclass(frozen=True)
class Deviation(Result):
    """How far one strategy is from another over some postures, relative to the first.

    rms: sqrt(mean |G' - G|^2 / mean |G|^2); largest: max |G' - G| / |G|; extra_speed: mean |G'|^2 / mean |G|^2 - 1,
    the share by which squared joint speed grows, over all directions of the tool. Frobenius norms.
    """

    rms: float
    largest: float
    extra_speed: float

    def __str__(self) -> str:
        return f"{self.rms:.2%} rms, {self.largest:.2%} at most, squared joint speed {self.extra_speed:+.2%}"


def _deviation(given: Strategy, other: Strategy, Q: Matrix, columns: int) -> Deviation:
    """That of `other` from `given` over postures Q (k, n), in the first task directions.

    Raises:
        ArgumentError: strategies of different tasks' sizes. SingularityError: one is singular at one of Q.
    """
    if (given.task.n, given.task.m) != (other.task.n, other.task.m):
        raise ArgumentError("the task of the other strategy", other.task.name, f"it must be that of {given.name!r}")
    G, new = (strategy.batch(Q)[:, :, :columns] for strategy in (given, other))
    away, size = np.sum((new - G) ** 2, axis=(1, 2)), np.sum(G**2, axis=(1, 2))
    rms, largest = np.sqrt(away.sum() / size.sum()), np.sqrt((away / size).max())
    return Deviation(float(rms), float(largest), float(np.sum(new**2) / size.sum() - 1))


@dataclass(frozen=True)
class RepeatableDistance(Result, Value):
    """What repeatability costs near a posture. All deviations are relative to the given strategy, as in `Deviation`.

    bound: every holonomic strategy g = const whose g is smooth, of one value and regular on the circle is at least so
        far from the given one at some posture of it. It bounds `largest`, never `rms`: no least rms is known. It is a
        theorem (theory 5.4); its figure is the least of `points` samples of the circle.
    first_order: rms deviation of the radial strategy over the ball to first order in the radius, an estimate from the
        curvature at the samples. To that order no strategy has less whose slope is the same all along a self-motion;
        others may: a strategy with a cut has.
    radial, ours: the radial strategy and the strategy asked about. rms and extra_speed over `samples` postures of the
        ball, largest over these and the circle's: sampled, so the true largest may be greater.
    circle: postures (k, n) of the circle of the ball's radius about its centre, in the plane of the greatest curvature
        there, on the radial leaf of the start; with `along` on up to five leaves, and the bound is the greatest of
        theirs.
    """

    bound: float
    first_order: float
    radial: Deviation
    ours: Deviation | None
    samples: int
    points: int
    circle: Matrix

    def __str__(self) -> str:
        lines = [
            "difference from the joint rates of the given strategy, |G' - G| / |G|:",
            "  any strategy g = const with a g that is smooth, regular and single-valued on a circle around the start: "
            f"at least {self.bound:.2%} at one or more postures of the circle (by a theorem; the least of "
            f"{self.points} sampled points)",
            f"  the radial strategy: {self.radial}",
            *([] if self.ours is None else [f"  yours: {self.ours}"]),
            f"rms and speed are those of {self.samples} sampled postures of the ball; 'at most' is the largest value "
            "at these postures and on the circle",
        ]
        return "\n".join(lines)


@typed
def distance_to_repeatable(
    strategy: Strategy, region: Ball, ours: Strategy | None = None, *, samples: int = 200, seed: int = 0
) -> RepeatableDistance:
    """How close a repeatable strategy can come to a strategy with one redundant joint, and how close some do.

    Bound: on a closed curve in joint space g has a greatest value, and there the strategy moves the joints along the
    curve. On a curve of the radial leaf that is the radial strategy's own motion, so |G' - G| >= min |(G_rad - G) e|,
    e the direction of the curve (theory 5.4). First order: 1/2 |F| R / sqrt(d + 2) in a ball of R^d.

    Args:
        region: a `ball` of tool positions, orientation kept. ours: another holonomic strategy of the same task.
        samples: tool positions.

    Raises:
        ArgumentError: not one redundant joint, or without position rows. SingularityError: inside the region.
    """
    task = strategy.task
    start = task.robot.checked(region.start, "the start of the region")
    d = sum(row < 3 for row in task.rows)
    if task.n - task.m != 1 or d < 2 or list(task.rows[:d]) != list(range(d)):
        facts, cure = (task.n - task.m, d), "the bound is for one, and at least two rows"
        raise ArgumentError("the (redundant joints, position rows)", facts, cure)
    # To first order, by the curvature at postures of the ball
    region = Ball(start, region.radius, region.along)
    Q, near = ball_postures(strategy, region, samples, seed), radial(strategy, start)
    G = strategy.batch(Q)[:, :, :d]
    F = curvature_function(strategy).batch(Q)[0].reshape(len(Q), task.n, -1)
    inner = [k for k, (i, j) in enumerate(pairs(task.m)) if j < d]
    strength = np.sqrt(2 * np.mean(np.sum(F[:, :, inner] ** 2, axis=(1, 2))) / np.mean(np.sum(G**2, axis=(1, 2))))
    # The bound, on circles of up to five leaves; the least over 120 samples of a circle is right to a thousandth of its
    # variation
    leaves = _starts(strategy, region)
    leaves = leaves[:: max(1, -(-len(leaves) // 5))]
    circles = [_circle(strategy, posture, region.radius, d, points=120) for posture in leaves]
    rim = np.vstack([postures for postures, _ in circles])

    # How far the radial strategy, and the one asked about, are from the given one

    def judged(other: Strategy) -> Deviation:
        inside, edge = (_deviation(strategy, other, postures, d) for postures in (Q, rim))
        return replace(inside, largest=max(inside.largest, edge.largest))

    return RepeatableDistance(
        bound=max(_least_on_circle(strategy, near, postures, along, d) for postures, along in circles),
        first_order=float(strength * region.radius / 2 / np.sqrt(d + 2)),
        radial=judged(near),
        ours=None if ours is None else judged(ours),
        samples=len(Q),
        points=len(circles[0][0]),
        circle=rim,
    )


@typed
def ball_postures(strategy: Strategy, region: Ball, samples: int, seed: int = 0) -> Matrix:
    """Postures (samples, n) whose tool positions fill a ball evenly, reached from its start straight by the strategy.

    With `along`, from postures spread over the self-motion. Raises: SingularityError.
    """
    whole("samples", samples)
    task, rng = strategy.task, np.random.default_rng(whole("seed", seed, 0))
    d = sum(row < 3 for row in task.rows)
    starts = _starts(strategy, region)

    def in_ball(radius: float, size: int) -> Vector:
        v = rng.normal(size=size)
        return radius * rng.uniform() ** (1 / size) / np.linalg.norm(v) * v

    postures = np.empty((samples, task.n))
    for k in range(samples):
        dx = np.concatenate([in_ball(region.radius, d), np.zeros(task.m - d)])
        if region.turn > 0 and task.m > d:
            dx[d:] = in_ball(region.turn, task.m - d)
        postures[k] = transport(strategy, starts[rng.integers(len(starts))], dx, steps=8)
    return postures


def _starts(strategy: Strategy, region: Ball) -> Matrix:
    """The postures (k, n) over the centre of a ball: its start, and with `along` the self-motion so far each way."""
    if not region.along > 0:
        return np.array([region.start])
    step = min(0.02, region.along / 2)
    return self_motion_curve(strategy.task, region.start, length=region.along, step=step, limits=False).q


def _circle(strategy: Strategy, start: Vector, radius: float, d: int, points: int) -> tuple[Matrix, Matrix]:
    """(postures (points, n), directions (points, m)) of a circle of the tool about the start, on the radial leaf of it.

    In the plane (u, v) of the greatest curvature, the first singular vectors of n . F_ij.
    """
    task = strategy.task
    F = np.einsum("a,aij->ij", null_space(task.jacobian(start))[:, 0], curvature(strategy, start))[:d, :d]
    u, v = np.pad(np.linalg.svd(F)[0][:, :2].T, ((0, 0), (0, task.m - d)))
    angles = 2 * np.pi * np.arange(points) / points
    spokes = np.outer(np.cos(angles), u) + np.outer(np.sin(angles), v)
    along = np.outer(np.cos(angles), v) - np.outer(np.sin(angles), u)
    return np.array([transport(strategy, start, radius * spoke, steps=8) for spoke in spokes]), along


def _least_on_circle(strategy: Strategy, near: Strategy, Q: Matrix, along: Matrix, d: int) -> float:
    """min over a closed curve of a leaf of |(G_rad - G) e| / |G|; 0 where it changes sign on the way."""
    G, N = strategy.batch(Q), null_space(strategy.task.jacobian_batch(Q)[0])[:, :, 0]
    apart = np.einsum("kai,ki->ka", near.batch(Q) - G, along) / np.linalg.norm(G[:, :, :d], axis=(1, 2))[:, None]
    for k in range(1, len(N)):
        N[k] *= np.sign(N[k] @ N[k - 1])
    signed = np.sum(apart * N, axis=1)
    return float(max(0.0, signed.min(), -signed.max()))
