"""The price of repeatability: how close can a law that comes home be to a given one? (theory 5.4)"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..control import checked_rate, make_plan, runge_kutta
from ..errors import ArgumentError
from ..path import circle
from ..strategy import Strategy, radial
from ..symbolic import SX, Function, directional, factorise, norm_2
from ..types import ArrayLike, Matrix, Vector
from .curvature import curvature_function, pairs
from .fibre import self_motion
from .region import Ball
from .transport import transport


@dataclass(frozen=True)
class Deviation:
    """How far one strategy is from another over some postures, relative to the first.

    rms: sqrt(mean |G' - G|^2 / mean |G|^2); largest: max |G' - G| / |G|; extra_speed: mean |G'|^2 / mean |G|^2 - 1,
    the share by which squared joint speed grows, over all directions of the tool. Frobenius norms.
    """

    rms: float
    largest: float
    extra_speed: float

    def __str__(self) -> str:
        return f"{self.rms:.2%} rms, {self.largest:.2%} at most, squared joint speed {self.extra_speed:+.2%}"


def deviation(given: Strategy, other: Strategy, Q: ArrayLike, *, columns: int | None = None) -> Deviation:
    """The deviation of `other` from `given` over postures Q (k, n).

    Args:
        columns: the first task directions only, for instance 3 for positions at constant orientation.

    Raises:
        ArgumentError: strategies of different tasks' sizes. SingularityError: one is singular at one of Q. ShapeError.
    """
    if (given.task.n, given.task.m) != (other.task.n, other.task.m):
        raise ArgumentError("the task of the other strategy", other.task.name, f"it must be that of {given.name!r}")
    a, b = given.batch(Q)[:, :, :columns], other.batch(Q)[:, :, :columns]
    away, size = np.sum((a - b) ** 2, axis=(1, 2)), np.sum(a**2, axis=(1, 2))
    rms, most = np.sqrt(away.sum() / size.sum()), np.sqrt((away / size).max())
    return Deviation(float(rms), float(most), float(np.sum(b**2) / size.sum() - 1))


@dataclass(frozen=True)
class Price:
    """What repeatability costs near a posture, relative to the given law.

    bound: no repeatable law stays nearer than this everywhere in the region (largest deviation). It holds up to
    sampling: the largest fibre slope met stands for the true one.
    forecast: rms deviation of the best repeatable law, and of the radial twin, to first order in the radius.
    radial, ours: what the radial twin, and the law asked about, really are.
    """

    bound: float
    forecast: float
    radial: Deviation
    ours: Deviation | None
    samples: int

    def __str__(self) -> str:
        text = (
            f"no repeatable law stays within {self.bound:.2%} of it everywhere here; the best is about "
            f"{self.forecast:.2%} away (rms, first order); the radial twin is {self.radial}"
        )
        return text if self.ours is None else f"{text}; yours is {self.ours}"


def price(
    strategy: Strategy, region: Ball, ours: Strategy | None = None, *, samples: int = 200, seed: int = 0
) -> Price:
    """How close any repeatable law can come to a strategy with one redundant joint, how close the radial twin and ours.

    Lower bound: a law that comes home has no drift on a loop of length l on which the given one drifts by D in the
    fibre coordinate z, so sup |A - A'| >= L |D| / (e^{L l} - 1), L = sup |dA/dz|, A = J_z G. Forecast: the part of
    the curvature that no closed form removes, 1/2 |F| R / sqrt(d + 2) in a ball of R^d (theory 5.4).

    Args:
        region: a `ball` of tool positions, orientation kept. ours: another holonomic strategy of the same task.
        samples: tool positions.

    Raises:
        ArgumentError: not one redundant joint, or a task without position rows. SingularityError: inside the region.
    """
    task = strategy.task
    start = task.robot.checked(region.start, "the start of the region")
    d = sum(row < 3 for row in task.rows)
    if task.n - task.m != 1 or d < 2 or list(task.rows[:d]) != list(range(d)):
        facts = (task.n - task.m, d)
        raise ArgumentError(
            "the (redundant joints, position rows)", facts, "the bound is for one, and at least two rows"
        )
    Q = ball_postures(strategy, Ball(start, region.radius, region.along), samples, seed)
    twin = deviation(strategy, radial(strategy, start), Q, columns=d)
    G = strategy.batch(Q)[:, :, :d]
    F = curvature_function(strategy).batch(Q)[0].reshape(len(Q), task.n, -1)
    inner = [k for k, (i, j) in enumerate(pairs(task.m)) if j < d]
    strength = np.sqrt(2 * np.mean(np.sum(F[:, :, inner] ** 2, axis=(1, 2))) / np.mean(np.sum(G**2, axis=(1, 2))))
    return Price(
        bound=_lower_bound(strategy, region, start, Q, d),
        forecast=float(strength * region.radius / 2 / np.sqrt(d + 2)),
        radial=twin,
        ours=None if ours is None else deviation(strategy, ours, Q, columns=d),
        samples=len(Q),
    )


def ball_postures(strategy: Strategy, region: Ball, samples: int, seed: int = 0) -> Matrix:
    """Postures (samples, n) whose tool positions fill a ball evenly, reached from its start straight by the strategy.

    With `along`, from postures spread over the self-motion. Raises: SingularityError.
    """
    task, rng = strategy.task, np.random.default_rng(seed)
    d = sum(row < 3 for row in task.rows)
    starts = np.array([region.start])
    if region.along > 0:
        curve = self_motion(task, region.start, length=region.along, step=min(0.02, region.along / 2), limits=False)
        starts = curve.q
    out = np.empty((samples, task.n))
    for k in range(samples):
        v = rng.normal(size=d)
        v *= region.radius * rng.uniform() ** (1 / d) / np.linalg.norm(v)
        dx = np.concatenate([v, np.zeros(task.m - d)])
        out[k] = transport(strategy, starts[rng.integers(len(starts))], dx, steps=8)
    return out


def _lower_bound(strategy: Strategy, region: Ball, start: Vector, Q: Matrix, d: int) -> float:
    """The bound over circles about the centre in every coordinate plane, both ways, from the rim postures."""
    Z = _fibre_coordinate(strategy, start, Q)
    slopes, speed = (values.reshape(len(Q), -1) for values in _fibre_function(strategy, Z).batch(Q)[:2])
    steepest = float(np.linalg.norm(slopes[:, :d], axis=1).max())
    scale = float(np.abs(speed).min()) / float(np.sqrt(np.max(np.sum(strategy.batch(Q)[:, :, :d] ** 2, axis=(1, 2)))))
    best = 0.0
    for radius in (region.radius / 2, region.radius):
        length = 2 * np.pi * radius
        growth = steepest / np.expm1(steepest * length) if steepest > 1e-12 else 1 / length
        for i, j in pairs(d):
            for drift in _circle_drifts(strategy, region, start, (i, j), radius, Z):
                best = max(best, abs(drift) * growth * scale)
    return best


def _fibre_coordinate(strategy: Strategy, start: Vector, Q: Matrix) -> Vector:
    """Z (n,): z = Z q runs along the self-motions at every posture; one joint, or the self-motion at the start."""
    candidates = np.vstack([np.linalg.svd(strategy.task.jacobian(start))[2][-1], np.eye(strategy.task.n)])
    normals = np.linalg.svd(strategy.task.jacobian_batch(Q)[0])[2][:, -1]
    return candidates[np.argmax(np.abs(candidates @ normals.T).min(axis=1))]


def _circle_drifts(
    strategy: Strategy, region: Ball, start: Vector, plane: tuple[int, int], radius: float, Z: Vector
) -> list[float]:
    """Drift in z = Z q of circles about the centre, from four points of the rim and the postures `along`."""
    task = strategy.task
    starts = [start]
    if region.along > 0:
        curve = self_motion(task, start, length=region.along, step=min(0.02, region.along / 2), limits=False)
        starts = list(curve.q[:: max(1, len(curve.q) // 8)])
    normal = np.zeros(3)
    normal[3 - sum(plane)] = 1.0
    found = []
    for angle in np.arange(4) * np.pi / 2:
        v = np.zeros(task.m)
        v[plane[0]], v[plane[1]] = radius * np.cos(angle), radius * np.sin(angle)
        for posture in starts:
            rim = transport(strategy, posture, v, steps=8)
            pose = task.robot.pose(rim, task.tip)
            center = pose[:3, 3] - np.pad(v[:3], (0, max(0, 3 - task.m)))
            plan = make_plan(task, circle(pose[:3, 3], center, normal), 60, pose[:3, :3])
            rate, q = checked_rate(strategy), rim
            for k in range(plan.steps):
                q = runge_kutta(rate, q, plan.h[k], plan.rates[0][k], plan.rates[1][k], plan.rates[2][k])
            found.append(float(Z @ (q - rim)))
    return found


def _fibre_function(strategy: Strategy, Z: Vector) -> Function:
    """q -> (dA/dz (m,), |n| per unit z): A = Z^T G along the fibre, z = Z^T q."""
    e, task = strategy.expressions, strategy.task
    G = e.rate(SX.eye(task.m), written_out=True).X
    n = factorise(e.J.T).complement()
    per_z = n / (SX(Z).T @ n)
    A = SX(Z).T @ G
    return Function("fibre", {"q": e.q}, {"slope": directional(A, e.q, per_z).T, "speed": norm_2(per_z)})
