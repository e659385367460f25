"""Which postures lie on one branch of a leaf: tubes in which no two postures have the same tool pose and level.

E(q; x) = 0 is [f(q) - x; g(q) - c] = 0, A(q) its Jacobian, Y = A(center)^-1. In a tube about a straight piece of joint
motion, center + t half with |t| <= 1 and everything within `radius` of it, let

    ||1 - Y A(q)|| <= change < 1      (the mean value of the second derivative, enclosed over the tube).

A step from a to b in the tube keeps to the branch when a ball about each point of the chord holds exactly one solution:
by the contraction principle, when |Y E| on the chord, eta, is at most (1 - change) times what the tube leaves for the
ball [Deu04, section 2.1]. eta <= 1/8 sup |d^2 (Y E) / dt^2|, as E = 0 at both ends. Then A is regular along the way, no
fold lies between, and b is what continuous motion reaches from a.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.errors import NativeError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Matrix, Vector, kept
from ...strategies import HolonomicStrategy, RowExpressions
from ...symbolic import SX, Enclosure, Function, jacobian, short, vertcat

# --- Rays of a radial strategy: straight paths of the tool from its center, on whose leaf each pose has one posture.
#
# The transport leads a posture back along the ray to one over the center. Where arc length labels those, two with one
# label differ by full turns of joints alone, and the transport, which can be gone both ways, keeps that difference. So
# of an exact transport the postures of one pose on the leaf, within the margins of the label, are q + 2 pi k, k whole
# numbers for the joints, and no folds are looked for on the way there, as `follow` does. What is left to tell is k. In
# a piece of the way in which each joint is found to move by less than half a turn, not far from where it was looked
# for, it is taken to be 0: wrong only where a joint really makes more than half a turn in that piece.
#
# Two things are not shown: that last one, and that the transport of a few steps leads different postures to different
# ones, as the exact transport does. Both were tested: against the given strategy, integrated along rays of hundreds of
# poses.

HALF_TURN = 3.14
"""Joint motion [joint unit] in a piece of a ray from which on a full turn may be missed or made up."""

ASIDE = 1.0
"""Farthest that the answer to a piece may lie from where Newton's method began [joint unit]: as its corrections fall to
an eighth each, the first was no more than 7/6 of this, and such a one leads no joint round."""


SHORTEST = 2.0**-16
"""Share of a ray below which it is given up: where the strategy ends is then nearer than some 1e-5 m. Poses of a Panda
beyond are refused in half the time that 2^-48 takes, and the same are reached."""


def keeps_turns(q: Vector, begun: Vector, posture: Vector) -> bool:
    """True where a piece of a ray from q to a posture that was found, begun somewhere, cannot miss a joint's turn."""
    return bool((np.abs(posture - q) < HALF_TURN).all() and (np.abs(posture - begun) <= ASIDE).all())


def rays_from(strategy: HolonomicStrategy) -> Vector | None:
    """The center (n,) of a radial strategy whose leaves have one posture for each pose; None of other strategies.

    That is where its label is arc length, and straight paths of the tool are those of its transport.
    """
    transport, task = strategy.looped.transport, strategy.task
    straight = task._turns or task.robot.planar or not any(task._angular)
    return transport.center if transport is not None and straight and all(strategy.constraint.angular) else None


def on_ray(strategy: HolonomicStrategy, q: Vector) -> bool:
    """True where straight paths from q on its leaf are rays."""
    center = rays_from(strategy)
    return center is not None and np.array_equal(q, center)


def rays_code(strategy: HolonomicStrategy) -> str:
    """C that ray.c needs; empty without rays."""
    center = rays_from(strategy)
    if center is None:
        return ""
    values = ", ".join(f"HK_C({value!r})" for value in center.tolist())
    rows = ", ".join(map(str, strategy.task.rows))
    # Joint motion [joint unit] to an answer near by that Newton's method finds in one go: 0.1.
    return (
        f"#define HK_RAYS\n#define HK_LEAP 0.1\n#define HK_HALF_TURN {HALF_TURN}\n#define HK_ASIDE {ASIDE}\n"
        f"#define HK_SHORTEST_RAY {SHORTEST!r}\nstatic const hk_t hk_center[] = {{{values}}};\n"
        f"static const int hk_ray_rows[] = {{{rows}}};\n"
    )


# --- Folds: where a leaf ends, and the path with it; the same rules as fold.c.
#
# Ahead of one the joints go like the square root of the share of the path that is left, so that 1 / |q'|^2 falls
# evenly, and is 0 there: two rates tell where. Of a path that passes close by one, the place moves on by a quarter of
# what has been gone (or by half, past a posture about which joints spin).
#
# A path is given up where the place stands still until 4^-4 of the share is left; the posture is then led on while
# Newton's method converges, to 4^-7 at least. It is a judgement, no proof: it refuses poses, and answers none.

STANDS = 0.25
"""By what share of the way gone the place may move on between pieces; close by 0.1."""

Solve = Callable[[Vector, float], Vector | None]
"""(where to begin, share of the path) -> the posture there, None where Newton's method does not contract."""


def _slack(rate: Vector) -> float:
    """1 / |q'|^2, which falls evenly to 0 ahead of a fold; infinite where the joints stand still."""
    square = float(rate @ rate)
    return 1.0 / square if square > 0.0 else float("inf")


class Fold:
    """The place of a fold ahead on a path, as far as the joints' rates tell it."""

    def __init__(self) -> None:
        self.share, self.slack, self.at, self.first, self.agreed = 0.0, 0.0, 0.0, 0.0, 0

    def agrees(self, share: float, rate: Vector, most: float) -> bool:
        """Take in the joints' rate at a share: whether the fold that it shows has moved by at most so much of what was
        gone."""
        slack = _slack(rate)
        gone, fall = share - self.share, self.slack - slack
        place = share + gone * (slack / fall) if fall != 0.0 else float("inf")
        agrees = fall > 0.0 and place > share and abs(place - self.at) <= most * gone
        self.share, self.slack, self.at = share, slack, place
        return agrees

    def ahead(
        self, q: Vector, share: float, middle: float, rate: Vector, solve: Solve, rate_at: Callable[..., Vector]
    ) -> Vector | None:
        """A posture close to a fold before the path's end; None where none is found.

        Args:
            q: the posture at a share of the path. middle, rate: of the piece that led there.
            rate_at: (posture, a share a little further on) -> the joint motion to there, to first order.
        """
        agrees = self.agrees(middle, rate, STANDS)
        self.agreed = self.agreed + 1 if agrees else 0
        if not agrees:
            self.first = self.slack
        if self.agreed < 2 or self.slack > 0.5 * self.first:
            return None
        if not (self.at > share and 2 * self.at - share < 1.0):
            return None
        near = copy(self)
        self.first = self.slack  # the next look, if any, where this has halved again
        for k in range(8):  # to q at first, then to a quarter of the share left, by half of the motion
            left = near.at - share if k else 0.0
            share += 0.75 * left
            posture = solve(q + left * rate if k else q, share)
            if posture is None:
                return q if k > 4 else None
            q, ahead = posture, 0.001 * (near.at - share)
            rate = rate_at(q, share + ahead) / ahead
            if k and not near.agrees(share, rate, 0.1 if k > 1 else STANDS):
                return None
            near.share, near.slack = share, _slack(rate)
        return q


THICKNESS = 0.125
"""Radius of a tube over half its length: thick enough for the bend of usual paths, thin enough to enclose little."""

DOUBT = 1.5
"""Factor on changes that are sampled and not enclosed: the second derivative may be larger between the samples."""

SWITCH = 1e-3
"""Half length of a tube up to which it is sampled where it has no enclosure: formulas that switch, fmax or a power of
1.5 at 0, have none there, and are regular all the same."""

DIRECTIONS = 8
"""Directions across a tube in which a change is sampled, at most; of more joints than that a share is looked at."""

RESTS = 1e-12
"""Curve of a target's way [m or rad] that is none: what does not move the joints then rests."""

LAID = 8
"""Tubes tried for one step, shorter and shorter, before the step itself is called too long."""

LONGEST = 0.1
"""Half length [joint units] of a tube to begin with."""

SHORT = 40_000
"""Operations, equal ones counted apart, up to which the derivative of the extended Jacobian is enclosed; it takes less
to sample longer ones."""


def turning(strategy: HolonomicStrategy) -> RowExpressions:
    """The expressions with the geometric rows of a full orientation, which turn whatever its representation does."""
    e, task = strategy.expressions, strategy.task
    return replace(e, J=task._turning_expression(e.kinematics, e.J)) if task._rotations else e


@kept
def extended_jacobian(strategy: HolonomicStrategy) -> Function:
    """q -> (A, A^-1) of the extended Jacobian A = [J; J_g] (n, n), unchecked.

    A full orientation turns with its geometric rows, whatever its representation: the postures are the same.
    """
    strategy = strategy.looped
    e, m, identity = turning(strategy), strategy.task.m, SX.eye(strategy.task.n)
    solution = e.rate(identity[:m, :], identity[m:, :])
    outputs = {"A": vertcat(e.J, e.planes), "inverse": solution.X}
    return Function("extended", {"q": e.q}, outputs, solution.system, strategy.transport)


@kept
def enclosed_change(strategy: HolonomicStrategy) -> Enclosure | None:
    """q -> dA/dq_k of the extended Jacobian, (n n n,), k slowest, then columns, enclosed over boxes of q.

    None where an enclosure would be too long, or too wide to be of use: factorisations, which copysign tells,
    widen it without end, and so do the steps of a loop.
    """
    if strategy.looped is not strategy:
        return None
    e, n = turning(strategy), strategy.task.n
    A = vertcat(e.J, e.planes)
    if not short(A, e.q, SHORT // n):
        return None
    slopes = jacobian(A, e.q)
    try:
        return Enclosure("hk_change_body", {"q": e.q}, slopes) if short(slopes, e.q, SHORT) else None
    except NativeError:
        return None


@dataclass(frozen=True, eq=False)
class Tube:
    """center, half (n,), radius [joint units]; change; bend >= |Y D^2E [half, half]| over it; inverse: size of the
    columns of Y for the task rows."""

    center: Vector
    half: Vector
    radius: float
    change: float
    bend: float
    inverse: float

    @cached_property
    def _along(self) -> Vector:
        return self.half / (self.half @ self.half)

    def place(self, q: Vector) -> tuple[float, Vector]:
        """(share t from -1 to 1 along the tube, offset (n,) from its axis there) of a posture."""
        offset = q - self.center
        t = min(1.0, max(-1.0, float(self._along @ offset)))
        return t, offset - t * self.half

    def links(self, a: tuple[float, Vector], b: tuple[float, Vector], curve: float) -> bool:
        """True when a posture at the place b is on the branch of one at the place a.

        curve: |d^2 x / dt^2| of the tool on the way, t from 0 to 1.
        """
        (s, u), (t, v) = a, b
        off, apart, along = max(float(u @ u), float(v @ v)), v - u, abs(t - s)
        if not (self.change <= TOLERANCES.change and off < self.radius * self.radius):
            return False
        away = float(apart @ apart) ** 0.5
        second = along * along * self.bend + (2 * along + away / self.radius) * self.change * away
        return off**0.5 + (second + self.inverse * curve) / 8 / (1 - self.change) <= self.radius


def lay_tube(strategy: HolonomicStrategy, center: Vector, half: Vector) -> Tube:
    """The tube about center +- half (n,), its change enclosed, or, where the strategy has no enclosure, sampled."""
    n, radius = len(center), THICKNESS * _length(half)
    A, Y = extended_jacobian(strategy)(center)
    change = bend = np.inf
    enclosure = enclosed_change(strategy)
    if enclosure is not None:
        change, bend = _enclosed(enclosure, center, half, radius, Y)
    if enclosure is None or (not np.isfinite(change) and radius <= THICKNESS * SWITCH):
        change, bend = _sampled(strategy, center, half, radius, A, Y)
    # The rotation vector of the error turns its axes, by at most 0.6 of its length.
    for first in strategy.task._rotations:
        rows = slice(first, first + 3)
        change += 1.2 * radius * n**0.5 * _length(Y[:, rows]) * _length(A[rows])
    return Tube(center, half, radius, change, bend, _length(Y[:, : strategy.task.m]))


def _enclosed(enclosure: Enclosure, center: Vector, half: Vector, radius: float, Y: Matrix) -> tuple[float, float]:
    """(change, bend) from enclosures of dA/dq_k over the box around the tube; infinite where they are."""
    n, far, size = len(center), np.abs(half), np.abs(Y)
    mid, rad = (values.reshape(n, n * n) for values in enclosure.function(center, far + radius))
    if not np.isfinite(rad.sum() + mid.sum()):
        return np.inf, np.inf
    # rows of mid and rad are dA/dq_k by columns, so A^T stands in each
    near = (far @ rad).reshape(n, n) @ size.T
    middle = (half @ mid).reshape(n, n) @ Y.T
    across = np.abs(mid.reshape(-1, n) @ Y.T) + rad.reshape(-1, n) @ size.T
    return _length(np.abs(middle) + near) + radius * _length(across), _length(np.abs(half @ middle) + far @ near)


def _length(values: Array) -> float:
    """The Frobenius norm."""
    return float(np.vdot(values, values)) ** 0.5


def _sampled(
    strategy: HolonomicStrategy, center: Vector, half: Vector, radius: float, A: Matrix, Y: Matrix
) -> tuple[float, float]:
    """(change, bend) from A at the tube's ends and quarters and off its middle in a few perpendicular directions."""
    n, shares = len(center), np.array([-1.0, -0.5, 0.5, 1.0])
    count = min(n, DIRECTIONS)
    waves = np.cos(np.pi / n * np.outer(np.arange(count), np.arange(n) + 0.5)) * (2 / n) ** 0.5
    waves[0] /= 2**0.5
    points = center + np.vstack([shares[:, None] * half, radius * waves])
    changes = Y @ (extended_jacobian(strategy).batch(points)[0].reshape(-1, n, n) - A)
    sizes = np.sum(changes**2, axis=(1, 2))
    change = DOUBT * (sizes[:4].max() ** 0.5 + (n / count * sizes[4:].sum()) ** 0.5)
    return float(change), DOUBT * max(_length(changes[i] @ half) for i in (0, 3))


def branch_code(strategy: HolonomicStrategy) -> str:
    """C that branch.c needs: numbers, the extended Jacobian and, where there is one, the enclosure of its change."""
    task, change = strategy.task, enclosed_change(strategy)
    names = ("THICKNESS", "DOUBT", "LAID", "RESTS", "LONGEST", "DIRECTIONS", "SWITCH")
    numbers = {"CHANGE": TOLERANCES.change} | {name: globals()[name] for name in names}
    numbers |= {"TURNS": len(task._rotations), "ANGLES": int(task._by_angles), "ROWS": task.m}
    head = "".join(f"#define HK_{key} {value}\n" for key, value in numbers.items())
    head += f"static const int hk_turns[] = {{{', '.join(map(str, task._rotations or (0,)))}}};\n"
    enclosed = "" if change is None else f"#define HK_ENCLOSED\n{change.c}"
    return head + extended_jacobian(strategy).c("hk_extended_body") + enclosed


class Branch:
    """The branch on which a walk is: the tube where it has got to, and how long a tube may be there."""

    def __init__(self, strategy: HolonomicStrategy) -> None:
        self._strategy = strategy
        self._tube: Tube | None = None
        self._place: tuple[float, Vector] = (0.0, np.zeros(0))
        self._length = LONGEST

    def step(self, a: Vector, b: Vector, curve: float) -> float:
        """How long the next step may be, as a share of this one.

        1 to 2 when b is on the branch of a, where the last step led; below 1 when this one is too long to tell.
        """
        if self._tube is not None:
            end = self._tube.place(b)
            if self._tube.links(self._place, end, curve):
                self._place = end
                return 2.0
        move = b - a
        size = float(np.linalg.norm(move))
        if size == 0.0:  # the target rests, or it comes back within the step
            return 2.0 if curve <= RESTS else 0.5
        change = np.inf
        for _ in range(LAID):
            length = max(self._length, size / 2)
            half = move * (length / size)
            tube = lay_tube(self._strategy, a + half, half)
            change, end = tube.change, tube.place(b)
            if tube.links(tube.place(a), end, curve):
                self._tube, self._place = tube, end
                change = max(change, 1e-300)  # an arm of slides alone has the same Jacobian everywhere
                self._length = length * min(1.5, (0.7 * TOLERANCES.change / change) ** 0.5)
                return min(2.0, max(1.0, 2 * self._length / size))
            if length <= size / 2:
                break
            self._length = length * _shrink(change)
        self._tube = None
        return _shrink(change)


def _shrink(change: float) -> float:
    """By how much to shorten a tube: its change grows with the length at least in proportion."""
    if not np.isfinite(change):
        return 1 / 64
    return 0.5 if change <= TOLERANCES.change else max(1 / 64, min(0.9, 0.8 * TOLERANCES.change / change))
