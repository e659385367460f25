"""The distance to a repeatable law: how close can a holonomic law be to a given one? (theory 5.4)"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.shown import Shown
from ...base.types import ArrayLike, Matrix, Value, Vector, whole
from ...strategies import Strategy, radial, self_motion
from ...symbolic.null_space import null_space
from .curvature_of_planes import curvature, curvature_function, pairs
from .region import Ball
from .straight_transport import transport

POINTS = 120
"""Samples of a circle: the least of a smooth function over it is then right to a thousandth of its variation."""


@dataclass(frozen=True)
class Deviation(Shown):
    """How far one strategy is from another over some postures, relative to the first.

    rms: sqrt(mean |G' - G|^2 / mean |G|^2); largest: max |G' - G| / |G|; extra_speed: mean |G'|^2 / mean |G|^2 - 1,
    the share by which squared joint speed grows, over all directions of the tool. Frobenius norms.
    """

    rms: float
    largest: float
    extra_speed: float

    def __str__(self) -> str:
        return f"{self.rms:.2%} rms, {self.largest:.2%} at most, squared joint speed {self.extra_speed:+.2%}"


@typed
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
class RepeatableDistance(Value):
    """What repeatability costs near a posture. All deviations are relative to the given law, as in `Deviation`.

    bound: every holonomic law g = const whose g is smooth, of one value and regular on the circle is at least so far
        from the given one at some posture of it. It bounds `largest`, never `rms`: no least rms is known. It is a
        theorem (theory 5.4); its figure is the least of `points` samples of the circle.
    first_order: rms deviation of the radial strategy over the ball to first order in the radius, an estimate from the
        curvature at the samples. To that order no law has less whose slope is the same all along a self-motion; others
        may: a law with a cut has.
    radial, ours: the radial strategy and the law asked about. rms and extra_speed over `samples` postures of the ball,
        largest over these and the circle's: sampled, so the true largest may be greater.
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
            "difference from the joint rates of the given law, |G' - G| / |G|:",
            f"  any law g = const with a g that is smooth, regular and single-valued on a circle around the start: at "
            f"least {self.bound:.2%} at one or more postures of the circle (by a theorem; the least of {self.points} "
            "sampled points)",
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
    """How close a repeatable law can come to a strategy with one redundant joint, and how close some do.

    Bound: on a closed curve in joint space g has a greatest value, and there the law moves the joints along the curve.
    On a curve of the radial leaf that is the radial strategy's own motion, so |G' - G| >= min |(G_rad - G) e|,
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
        facts = (task.n - task.m, d)
        raise ArgumentError(
            "the (redundant joints, position rows)", facts, "the bound is for one, and at least two rows"
        )
    Q = ball_postures(strategy, Ball(start, region.radius, region.along), samples, seed)
    near = radial(strategy, start)
    G = strategy.batch(Q)[:, :, :d]
    F = curvature_function(strategy).batch(Q)[0].reshape(len(Q), task.n, -1)
    inner = [k for k, (i, j) in enumerate(pairs(task.m)) if j < d]
    strength = np.sqrt(2 * np.mean(np.sum(F[:, :, inner] ** 2, axis=(1, 2))) / np.mean(np.sum(G**2, axis=(1, 2))))
    leaves = _starts(strategy, Ball(start, region.radius, region.along))
    circles = [_circle(strategy, posture, region.radius, d) for posture in leaves[:: max(1, -(-len(leaves) // 5))]]
    rim = np.vstack([postures for postures, _ in circles])

    def judged(law: Strategy) -> Deviation:
        inside, edge = (deviation(strategy, law, postures, columns=d) for postures in (Q, rim))
        return replace(inside, largest=max(inside.largest, edge.largest))

    return RepeatableDistance(
        bound=max(_least_on_circle(strategy, near, *one, d) for one in circles),
        first_order=float(strength * region.radius / 2 / np.sqrt(d + 2)),
        radial=judged(near),
        ours=None if ours is None else judged(ours),
        samples=len(Q),
        points=POINTS,
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
    out = np.empty((samples, task.n))
    for k in range(samples):
        v = rng.normal(size=d)
        v *= region.radius * rng.uniform() ** (1 / d) / np.linalg.norm(v)
        dx = np.concatenate([v, np.zeros(task.m - d)])
        if region.turn > 0 and task.m > d:
            w = rng.normal(size=task.m - d)
            dx[d:] = region.turn * rng.uniform() ** (1 / len(w)) / np.linalg.norm(w) * w
        out[k] = transport(strategy, starts[rng.integers(len(starts))], dx, steps=8)
    return out


def _starts(strategy: Strategy, region: Ball) -> Matrix:
    """The postures (k, n) over the centre of a ball: its start, and with `along` the self-motion so far each way."""
    if not region.along > 0:
        return np.array([region.start])
    return self_motion(
        strategy.task, region.start, length=region.along, step=min(0.02, region.along / 2), limits=False
    ).q


def _circle(strategy: Strategy, start: Vector, radius: float, d: int) -> tuple[Matrix, Matrix]:
    """(postures (POINTS, n), directions (POINTS, m)) of a circle of the tool about the start, on the radial leaf of it.

    In the plane (u, v) of the greatest curvature, the first singular vectors of n . F_ij.
    """
    task = strategy.task
    F = np.einsum("a,aij->ij", null_space(task.jacobian(start))[:, 0], curvature(strategy, start))[:d, :d]
    u, v = np.pad(np.linalg.svd(F)[0][:, :2].T, ((0, 0), (0, task.m - d)))
    angles = 2 * np.pi * np.arange(POINTS) / POINTS
    out = np.outer(np.cos(angles), u) + np.outer(np.sin(angles), v)
    along = np.outer(np.cos(angles), v) - np.outer(np.sin(angles), u)
    return np.array([transport(strategy, start, radius * x, steps=8) for x in out]), along


def _least_on_circle(strategy: Strategy, near: Strategy, Q: Matrix, along: Matrix, d: int) -> float:
    """min over a closed curve of a leaf of |(G_rad - G) e| / |G|; 0 where it changes sign on the way."""
    G, N = strategy.batch(Q), null_space(strategy.task.jacobian_batch(Q)[0])[:, :, 0]
    apart = np.einsum("kai,ki->ka", near.batch(Q) - G, along) / np.linalg.norm(G[:, :, :d], axis=(1, 2))[:, None]
    for k in range(1, len(N)):
        N[k] *= np.sign(N[k] @ N[k - 1])
    signed = np.sum(apart * N, axis=1)
    return float(max(0.0, signed.min(), -signed.max()))
