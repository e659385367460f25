"""`closest_holonomic`: the repeatable law nearest to a given one over a joint region. [RM93], theory 2b, 5.4

A law with leaves g(q) = const differs from a given one G by a self-motion (theory 1.5),

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

from dataclasses import dataclass, replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, SingularityError
from ...base.poses import pose_from
from ...base.types import Matrix, Value, Vector, frozen, whole
from ...motion.ik import inverse
from ...path.workspaces import Cylinder, Sphere, sobol
from ...strategies import HolonomicStrategy, SelfMotions, Strategy, holonomic, radial, self_motion
from ...strategies.constraints import Constraint, linear, lock
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic.null_space import null_space
from ..coverage.coordinates import chart_of, coordinates_of
from ..curvature import Ball, Deviation, Region
from ..curvature.repeatable_distance import distance_to_repeatable
from .leaf_series import SampledSeries, along_leaves, series_over
from .objectives import Objective, length_of

WHOLE = 0.9
"""Share of a closed self-motion that a region must hold for g to be written with its period."""

JUDGED = 1024
"""Postures, besides those of the search, that a law is judged at: figures are right to about a per cent."""

STEP = 0.2
"""Arc length of a step along a self-motion [joint units]: two Newton corrections bring it to round-off."""

REPEATABLE = 1e-4
"""rms distance from its own radial strategy up to which a law counts as repeatable. Steps of radial leave 5e-6 of a law
with the arm angle of a Panda held, over +-0.15 rad."""

BOUND = 16
"""Postures of the ball that go into the theorem's estimates; the bound itself is of the circle."""


@dataclass(frozen=True, eq=False)
class ClosestHolonomic(Value):
    """The nearest repeatable law that was found, and how near others are.

    strategy: an ordinary one; start (n,): the posture in the middle of the region.
    ours, radial: how far it and the radial strategy about the start are from the given law, at other postures of the
        region than those of the search; radial is None where it is singular at one of them. With positions and turns,
        a turn counts as `length` metres a radian.
    bound: for one redundant joint and a ball: every law with smooth leaves is at some posture of the circle round the
        ball at least so far from the given one. It bounds `largest`, not `rms` (theory 5.4). None elsewhere.
    least_slope: the least det g_phi at those postures, 1 in the middle; leaves fold where it is 0.
    terms: of the series; 0 where the given law is repeatable and `strategy` is radial of it.
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
            "difference from the joint rates of the given law, |G' - G| / |G|:",
            f"  the nearest law of {self.terms} terms: {self.ours}",
            f"  the radial strategy: {other}",
            *([] if self.bound is None else [f"  every smooth law: at least {self.bound:.2%} at some posture"]),
            "the nearest law keeps g constant, a function of the tool pose and of the base constraint phi:",
            f"  det dg/dphi is at least {self.least_slope:.2g} at the sampled postures; at 0 the law is singular",
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
    """The repeatable law nearest to a given one over a joint region, in the mean of |G_g - G|_F^2. [RM93]

    Its leaves are g = phi + a series of the tool pose and phi: polynomials up to `degree`, and where the region holds
    whole closed self-motions, round which phi grows, polynomials of the pose times sines and cosines of phi.

    Args:
        region: `around` or `box` in joint space, all directions of the tool counting; or a `ball` of tool positions
            with `along` > 0, orientation kept, where positions alone count.
        base: phi, r rows, one to one along the self-motions of the region; by default the constraint of a law that has
            one, so that this law itself is found; else the joints' part along the self-motion in the middle, or with a
            whole closed self-motion the hinge that turns round in it.
        samples: postures of the search; others judge it.
        length: metres that a turn of 1 rad counts as; by default the region's spread of positions over that of turns.

    Raises:
        ArgumentError: no redundant joint, a ball without `along`, a base that folds in the region, bad numbers.
        SingularityError: the given law is singular in the region.
    """
    task = strategy.task
    of_one_tool(task, "nearest")
    r = task.n - task.m
    if r == 0:
        raise ArgumentError("the number of redundant joints", 0, "each tool pose has its joints already")
    whole("the degree", degree)
    start = task.robot.checked(region.start if isinstance(region, Ball) else region.center, "the middle of the region")
    own = strategy.constraint if isinstance(strategy, HolonomicStrategy) else None
    phi, period = (base or own, None) if r > 1 else _base(task, base or own, start, region)
    law = holonomic(task, phi or linear(null_space(task.jacobian(start)).T, name="along the self-motion"))
    Q = _postures(law, region, start, whole("samples", samples) + JUDGED, seed)
    coordinates = coordinates_of(chart_of(task, task.pose(start)[:3, :3]), Q)
    metres = length_of(Objective(1.0, length=length), coordinates.turns, coordinates.spread)
    weights = np.where(coordinates.turns, 1 / metres, 1.0)
    series = series_over(law, coordinates, Q, degree, period)
    searched, judged = (SampledSeries.of(strategy, law, series, weights, part) for part in (Q[JUDGED:], Q[:JUDGED]))
    C, steps = searched.best()
    found = along_leaves(task, law.constraint, replace(series, coefficients=frozen(C)))
    off, fold = judged.off(C)
    ours, least, terms = judged.deviation(off), float(fold.min()), C.shape[1]
    bound = None
    if isinstance(region, Ball) and r == 1:
        bound = distance_to_repeatable(strategy, region, samples=BOUND, seed=seed).bound
    straight = radial(strategy, start)
    try:
        near = judged.deviation(judged.of_law(straight) - judged.G)
    except SingularityError:
        near = None
    if near is not None and near.rms < min(REPEATABLE, ours.rms):  # the given law has leaves: those of radial
        found, ours, least, terms = straight, near, 1.0, 0
    return ClosestHolonomic(found, start, ours, near, bound, least, metres, terms, steps)


def _base(
    task: Task, base: Constraint | None, q0: Vector, region: Region | Ball
) -> tuple[Constraint | None, float | None]:
    """(base constraint, period), with one redundant joint: a period where the region holds closed self-motions that phi
    grows round.
    """
    whole = self_motion(task, q0, step=0.05, limits=False)
    if not whole.closed:
        return base, None
    turned = whole.q[-1] - whole.q[0]
    hinges = [j for j in range(task.n) if task.robot.hinges[j] and abs(turned[j]) > np.pi]
    if isinstance(region, Ball):
        holds = 2 * region.along >= WHOLE * (whole.s[-1] - whole.s[0])
    else:
        holds = bool(hinges) and bool((region.upper - region.lower)[hinges].min() >= WHOLE * 2 * np.pi)
    if not holds:
        return base, None
    base = base or (lock(hinges[0]) if hinges else None)
    if base is None:
        return None, None
    first, last = holonomic(task, base).constraint_value.batch(whole.q[[0, -1]]).ravel()
    turn = abs(float(np.round((last - first) / (2 * np.pi)) * 2 * np.pi))
    return base, turn or None


def _postures(law: HolonomicStrategy, region: Region | Ball, q0: Vector, count: int, seed: int) -> Matrix:
    """Postures (k, n) that fill the region evenly: a box in its joints, a ball in tool positions and arc length."""
    if isinstance(region, Region):
        return region.sample(count, seed)
    task = law.task
    if not region.along > 0:
        cure = "give hk.analysis.curvature.ball(start, radius, along=...): a repeatable law has leaves side by side"
        raise ArgumentError("`along` of the ball", region.along, cure)
    u, pose = sobol(4, count, seed), task.pose(q0)
    poses = pose_from(_positions(pose[:3, 3], region.radius, u, task.robot.planar), pose[:3, :3])
    found = inverse(law, q0, limits=False).batch(poses)
    ok = found.reached
    Q, p, R = found.q[ok], poses[ok, :3, 3], poses[ok, :3, :3]
    along = region.along
    if task.n - task.m == 1:
        whole = self_motion(task, q0, step=0.05, limits=False)
        along = min(along, (whole.s[-1] - whole.s[0]) / 2) if whole.closed else along
    v = np.random.default_rng(seed).normal(size=Q.shape)
    Q, sound = SelfMotions(task, p, R).walked(Q, v, (2 * u[ok, 3] - 1) * along, STEP)
    if not sound.sum() > JUDGED:
        raise ArgumentError(f"the postures found in the ball, of {count}", int(sound.sum()), "give a smaller ball")
    return Q[sound]


def _positions(center: Vector, radius: float, u: Matrix, planar: bool) -> Matrix:
    """Points (k, 3) of a ball, or of a disc in the plane of a planar robot."""
    if planar:
        return Cylinder(center, radius, 0.0).points(u[:, :3])
    return Sphere(center, radius).points(u[:, :3])
