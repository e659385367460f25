"""All postures of six hinges at a tool pose, in steps of degree two or four, and the signs that number them.

The chain is T = E_1(q_1) ... E_6(q_6) M with E_i the turn about axis i, which has direction h_i and holds point p_i at
q = 0, and M the tool's pose there. Each step gives a root of a cos q + b sin q = d. Its slope s = -a sin q + b cos q
has s^2 = a^2 + b^2 - d^2, so the sign of s tells the two roots apart. And det J = +- s_1 s_2 s_3: steps and angles are
coordinates of the pose, as of a point |x|^2 / 2, height and azimuth are, whose volume is d(|x|^2 / 2) dz dphi.

Three axes that meet, and no two others in one plane, leave a step of degree four. Then det J = +- G' s_3, G' the slope
of that step, and of its four roots two have the same sign of G': signs number the postures, and tell nothing more.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cache, reduce
from typing import NamedTuple

import numpy as np

from ...symbolic import (
    SX,
    Function,
    atan2,
    copysign,
    cos,
    cross,
    dot,
    exp,
    fabs,
    floor,
    fmax,
    fmin,
    horzcat,
    horzsplit,
    if_else,
    log,
    sin,
    sqrt,
    symbol,
    vec,
    vertcat,
    vertsplit,
)


class Family(Enum):
    """Six hinges whose inverse is closed, by what is special in them; the text is for messages."""

    PAIR = "three axes that meet in a point, and two others, next to each other, in one plane"
    PARALLEL = "three parallel axes, and the two at their end meet"
    SPHERE = "three axes that meet in a point"

    @property
    def quadratic(self) -> bool:
        """Whether every step is of degree two: then the signs of its slopes tell postures of one pose apart."""
        return self is not Family.SPHERE


@dataclass(frozen=True)
class Form:
    """The order of the steps.

    reversed: the point where three axes meet is at the base's end (or the parallel axes are 3, 4, 5): the chain is
    solved from the tool. inner: the pair are axes 2 and 3 of such a chain, not 1 and 2.
    """

    family: Family
    reversed: bool
    inner: bool = False


class Turn(NamedTuple):
    """An angle by its cosine and sine; and by a vector in its direction of some length, where these are quotients."""

    cos: SX
    sin: SX
    vector: tuple[SX, SX, SX] | None = None

    @staticmethod
    def along(x: SX, y: SX, length: SX) -> Turn:
        """That of a vector (x, y)."""
        return Turn(x / length, y / length, (x, y, length))

    @property
    def scaled(self) -> tuple[SX, SX, SX]:
        """(x, y, length) of a vector in its direction."""
        return self.vector or (self.cos, self.sin, SX(1))

    @property
    def angle(self) -> SX:
        """In (-pi, pi]."""
        return atan2(self.sin, self.cos)

    @property
    def back(self) -> Turn:
        """The turn the other way."""
        return Turn(self.cos, -self.sin)

    def about(self, h: SX, v: SX, back: bool = False) -> SX:
        """R_h(q) v, or R_h(-q) v, by Rodrigues' formula."""
        s = -self.sin if back else self.sin
        return self.cos * v + s * cross(h, v) + (1 - self.cos) * dot(h, v) * h


class Root(NamedTuple):
    """A root, the slope s there, how real it is, s^2 / (a^2 + b^2), and s^2 = a^2 + b^2 - d^2, which may be below 0."""

    turn: Turn
    slope: SX
    share: SX
    square: SX


def _root(a: SX, b: SX, d: SX, sign: SX) -> Root:
    """The root of a cos q + b sin q = d whose slope has a sign, 1 or -1; where there is none, the q nearest to one."""
    square = a * a + b * b
    share, inside = 1 - d * d / square, square - d * d
    size = sqrt(fmax(inside, 0))
    d = fmin(fmax(d, -sqrt(square)), sqrt(square))
    s = sign * size
    return Root(Turn.along(a * d + b * s, b * d - a * s, square), s, share, inside)


class Wave(NamedTuple):
    """mean + a cos q + b sin q."""

    mean: SX
    a: SX
    b: SX

    def at(self, turn: Turn) -> SX:
        """Its value."""
        return self.mean + self.a * turn.cos + self.b * turn.sin

    def slope(self, turn: Turn) -> SX:
        """Its derivative by q."""
        return self.b * turn.cos - self.a * turn.sin

    def mapped(self, shift: SX, factor: SX) -> Wave:
        """factor (shift - its value)."""
        return Wave(factor * (shift - self.mean), -factor * self.a, -factor * self.b)


def _projection(u: SX, h: SX, v: SX) -> Wave:
    """u . R_h(q) v."""
    along = dot(u, h) * dot(h, v)
    return Wave(along, dot(u, v) - along, dot(u, cross(h, v)))


def _projected(u: SX, h: SX, v: SX, d: SX, sign: SX) -> Root:
    """The root of u . R_h(q) v = d."""
    mean, a, b = _projection(u, h, v)
    return _root(a, b, d - mean, sign)


def _between(h: SX, v: SX, w: SX, bounded: bool = False) -> Turn:
    """The turn about h that brings v to w, which is as far from h, or as near to it as a turn does.

    bounded: its cosine and sine are quotients by the square of that distance, whose bounds over sets of poses are
    tighter; where it is small, they are none of an angle to round-off.
    """
    x, y = dot(v, w) - dot(h, v) * dot(h, w), dot(h, cross(v, w))
    if bounded:
        return Turn.along(x, y, dot(w, w) - dot(h, w) ** 2)
    size = sqrt(x * x + y * y)
    return Turn(x / size, y / size)


Posture = tuple[list[Turn], list[Root]]
"""The turns of joints, and the roots that were chosen on the way."""


class Plane(NamedTuple):
    """Two axes of one plane: its normal n, a point a on the second axis, the part of the first one's point.

    h_1 x h_2 = sine n. The foot of a on the first axis is a + along h_2 + across (h_2 x n); moment = along sine -
    across cosine is zero where the axes meet in a.
    """

    normal: SX
    point: SX
    foot: SX
    sine: SX
    cosine: SX
    along: SX
    across: SX
    moment: SX


def _plane_of(h1: SX, p1: SX, h2: SX, p2: SX, normal: SX) -> Plane:
    """That of two axes, given its normal."""
    foot = p1 + dot(p2 - p1, h1) * h1
    sine, cosine = dot(cross(h1, h2), normal), dot(h1, h2)
    along, across = dot(foot - p2, h2), dot(foot - p2, cross(h2, normal))
    return Plane(normal, p2, foot, sine, cosine, along, across, along * sine - across * cosine)


def _to_point(h: list[SX], p: list[SX], plane: Plane, start: SX, goal: SX, signs: list[SX], bounded: bool) -> Posture:
    """The turns of joints 1, 2, 3 with E_1 E_2 E_3 start = goal, and the roots of joints 3 and 2.

    Axes 1 and 2 lie in a plane. Step 1, joint 3: turns about both keep sine |x - a|^2 / 2 - moment h_2 . (x - a) of a
    point x: where the axes meet in A, it is sine |x - A|^2 / 2 + const; where they are parallel, -moment h_2 . x.
    Step 2, joint 2: x - a is turned about h_2 until its part in the plane across h_2 suits the goal, which is told by
    its height along h_1 and by its distance from axis 1. Step 3: joint 1 brings it to the goal.
    """
    n, a = plane.normal, plane.point
    across, lever = cross(h[1], n), start - p[2]
    # Step 1: joint 3.
    fixed = plane.sine * (dot(p[2] - a, p[2] - a) + dot(lever, lever)) / 2 - plane.moment * dot(h[1], p[2] - a)
    wanted = plane.sine * dot(goal - a, goal - a) / 2 - plane.moment * dot(h[1], goal - a)
    third = _projected(plane.sine * (p[2] - a) - plane.moment * h[1], h[2], lever, wanted - fixed, signs[0])
    x = p[2] + third.turn.about(h[2], lever) - a
    # Step 2: joint 2. The part of x across h_2 in the plane is x_n sin q_2 + x_t cos q_2.
    height = dot(h[0], goal - a) - plane.cosine * dot(h[1], x)
    to_foot, from_foot = plane.foot - a, goal - plane.foot
    distance = (dot(x, x) + dot(to_foot, to_foot) - dot(from_foot, from_foot)) / 2 - plane.along * dot(h[1], x)
    wanted = (plane.sine * height + plane.across * distance) / (plane.sine**2 + plane.across**2)
    second = _root(dot(across, x), dot(n, x), wanted, signs[1])
    # Step 3: joint 1.
    first = _between(h[0], a + second.turn.about(h[1], x) - plane.foot, goal - plane.foot, bounded)
    return [first, second.turn, third.turn], [third, second]


def _to_point_in_space(h: list[SX], p: list[SX], normal: SX, start: SX, goal: SX, signs: list[SX]) -> Posture:
    """The turns of joints 1, 2, 3 with E_1 E_2 E_3 start = goal, of axes 1 and 2 that pass each other; one root.

    Step 1, joint 3: x, from the foot on axis 2 to the point that joint 3 turned, and v, from that on axis 1 to the
    goal, have R_1 (d n + R_2 x) = v, d n the common perpendicular. So |v|^2 and h_1 . v tell the parts y, z of R_2 x
    along n and h_2 x n, and y^2 + z^2 + (h_2 . x)^2 = |x|^2 is a polynomial of degree two in cos q_3 and sin q_3.
    Then joint 2 turns x there, and joint 1 brings it to the goal.
    """
    # The feet of the common perpendicular.
    across, gap = cross(h[1], normal), p[1] - p[0]
    sine, cosine, d = dot(cross(h[0], h[1]), normal), dot(h[0], h[1]), dot(gap, normal)
    first_foot = p[0] + h[0] * (dot(gap, across) / sine)
    second_foot = p[1] + h[1] * (dot(gap, cross(h[0], normal)) / sine)
    # Step 1: joint 3.
    base, lever, v = p[2] - second_foot, start - p[2], goal - first_foot
    square = _projection(2 * base, h[2], lever)
    square = square._replace(mean=square.mean + dot(base, base) + dot(lever, lever))
    along = _projection(h[1], h[2], lever)
    along = along._replace(mean=along.mean + dot(h[1], base))
    y = square.mapped(dot(v, v) - d * d, 1 / (2 * d))
    z = Wave(dot(h[0], v) - cosine * along.mean, -cosine * along.a, -cosine * along.b)
    z = Wave(*(number / sine for number in z))
    third = _root_of_degree_four([y, z, along], square, signs)
    # Joints 2 and 1.
    x = base + third.turn.about(h[2], lever)
    second = _between(h[1], x, y.at(third.turn) * normal + z.at(third.turn) * across)
    first = _between(h[0], d * normal + second.about(h[1], x), v)
    third = third._replace(slope=d * sine * third.slope)
    return [first, second, third.turn], [third, Root(second, SX(1), SX(1), SX(1))]


def _root_of_degree_four(squared: list[Wave], less: Wave, signs: list[SX]) -> Root:
    """The root of (sum of squares of waves - a wave) / 2 = 0 of two signs, with its slope.

    In the plane of (cos q, sin q) this is a conic; some pair of straight lines goes through the four points that it has
    with the circle, and a line is a step of degree two. Signs: which of two lines, which of its points.
    """
    # The conic x^2 - y^2 + 2 g x + 2 f y + e = 0, in turned coordinates in which it has no product x y. Where it is a
    # circle it is taken for a conic nearby.
    every = [[w.a for w in squared], [w.b for w in squared], [w.mean for w in squared]]
    cc, ss, square = (_sum_of_products(row, row) for row in every)
    cs, c, s = (_sum_of_products(every[i], every[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    size = sqrt((cc - ss) ** 2 / 4 + cs * cs + (1e-9 * (cc + ss)) ** 2)
    half = atan2(2 * cs, cc - ss) / 2
    turned = Turn(cos(half), sin(half))
    c, s = c - less.a / 2, s - less.b / 2
    g, f = (turned.cos * c + turned.sin * s) / size, (turned.cos * s - turned.sin * c) / size
    e = (square - less.mean + (cc + ss) / 2) / size
    # With t of the circle it is a pair of lines: (1 + t) x^2 - (1 - t) y^2 + ... = (r x + u)^2 - (s y - v)^2 = 0.
    t = _cubic_root_within(-e, f * f + g * g - 1, e + f * f - g * g)
    r, s, rest = sqrt(1 + t), sqrt(1 - t), e - t
    u, v = g / fmax(r, 0.01), f / fmax(s, 0.01)
    u, v = (
        if_else(r > 0.01, u, copysign(sqrt(fmax(v * v + rest, 0)), g)),
        if_else(s > 0.01, v, copysign(sqrt(fmax(u * u - rest, 0)), f)),
    )
    # One of u + v and u - v may be what is left of large numbers: their product is not.
    larger = u + copysign(v, u)
    shift = if_else(signs[0] * u * v >= 0, larger, rest / larger)
    point = _root(r, -signs[0] * s, -shift, signs[1])
    # Newton's method on the polynomial itself.
    turn = _plus(point.turn, turned)
    for _ in range(2):
        here = [w.at(turn) for w in squared]
        value = (_sum_of_products(here, here) - less.at(turn)) / 2
        slope = _slope(squared, less, turn)
        more = -value * slope / (slope * slope + 1e-16 * size * size)
        more = if_else(fabs(more) < 0.01, more, 0)
        turn = _plus(turn, Turn(1 - more * more / 2, more))
    return Root(turn, _slope(squared, less, turn), point.share, point.square)


def _slope(squared: list[Wave], less: Wave, turn: Turn) -> SX:
    """The derivative by q of (sum of squares of waves - a wave) / 2."""
    return _sum_of_products([w.at(turn) for w in squared], [w.slope(turn) for w in squared]) - less.slope(turn) / 2


def _sum_of_products(u: list[SX], v: list[SX]) -> SX:
    return sum((a * b for a, b in zip(u, v, strict=True)), SX(0))


def _cubic_root_within(b: SX, c: SX, d: SX) -> SX:
    """A root in [-1, 1] of t^3 + b t^2 + c t + d, which has an odd number there; of three the most apart."""
    p, q = c - b * b / 3, 2 * b**3 / 27 - b * c / 3 + d
    square = q * q / 4 + p**3 / 27
    # One real root: Cardano's formula.
    cube = fabs(q) / 2 + sqrt(fmax(square, 0))
    w = -copysign(exp(log(fmax(cube, 1e-300)) / 3), q)
    single = w - p / (3 * w) - b / 3
    # Three: the largest and the least of them, of which the others may be outside.
    radius, angle = 2 * sqrt(fmax(-p, 0) / 3), atan2(sqrt(fmax(-square, 0)), -q / 2) / 3
    largest, least = radius * cos(angle) - b / 3, -radius * cos(np.pi / 3 - angle) - b / 3
    over, under = (fmax(fabs(x) - 1 - 1e-9, 0) for x in (largest, least))
    extreme = if_else(over - under + copysign(1e-12, q) < 0, largest, least)
    t = if_else(square > 0, single, extreme)
    for _ in range(2):
        slope = (3 * t + 2 * b) * t + c
        t = t - if_else(slope == 0, 0, (((t + b) * t + c) * t + d) / slope)
    return fmin(fmax(t, -1), 1)


def _wrist(h: list[SX], to_last: SX, from_first: SX, sign: SX, bounded: bool) -> Posture:
    """The turns with R_4 R_5 R_6 = W, given W h_6 and W^T h_4, and the root of joint 5."""
    fifth = _projected(h[3], h[4], h[5], dot(h[3], to_last), sign)
    fourth = _between(h[3], fifth.turn.about(h[4], h[5]), to_last, bounded)
    sixth = _between(h[5], from_first, fifth.turn.about(h[4], h[3], back=True), bounded)
    return [fourth, fifth.turn, sixth], [fifth]


class Chain(NamedTuple):
    """Six axes h_i through p_i, the point (3,) where the wrist's axes meet and the plane's normal, and T M^-1."""

    h: list[SX]
    p: list[SX]
    center: SX
    normal: SX
    rotation: SX
    shift: SX
    bounded: bool = False

    def backward(self) -> Chain:
        """The same chain seen from the tool: E_6^-1 ... E_1^-1 = (T M^-1)^-1, with the axes the other way."""
        inverse = self.rotation.T
        h, p = [-axis for axis in self.h[::-1]], self.p[::-1]
        return Chain(h, p, self.center, self.normal, inverse, -(inverse @ self.shift), self.bounded)


def _arm_and_wrist(chain: Chain, form: Form, signs: list[SX]) -> Posture:
    """Axes 4, 5, 6 meet in the center: joints 1, 2, 3 bring that to its place, the others turn the tool."""
    h, p = chain.h, chain.p
    goal = chain.rotation @ chain.center + chain.shift
    arm, points, start = (h[:3], p[:3], chain.center)
    if form.inner:  # E_3^-1 E_2^-1 E_1^-1 goal = center
        arm, points, start, goal = [-axis for axis in arm[::-1]], points[::-1], goal, start
    if form.family is Family.PAIR:
        plane = _plane_of(arm[0], points[0], arm[1], points[1], chain.normal)
        turns, steps = _to_point(arm, points, plane, start, goal, signs, chain.bounded)
    else:
        turns, steps = _to_point_in_space(arm, points, chain.normal, start, goal, signs)
    first = turns[::-1] if form.inner else turns
    to_last, from_first = chain.rotation @ h[5], h[3]
    for turn, axis in zip(first, h, strict=False):
        to_last = turn.about(axis, to_last, back=True)
    for turn, axis in zip(first[::-1], h[2::-1], strict=True):
        from_first = turn.about(axis, from_first)
    last, fifth = _wrist(h, to_last, chain.rotation.T @ from_first, signs[2], chain.bounded)
    return first + last, steps + fifth


def _parallel_axes(chain: Chain, signs: list[SX]) -> Posture:
    """Axes 2, 3, 4 are parallel, 5 and 6 meet in the center: its height along them tells joint 1, axis 6 joint 5."""
    h, p, along = chain.h, chain.p, chain.h[1]
    # Joints 1 and 5.
    goal = chain.rotation @ chain.center + chain.shift
    first = _projected(along, -h[0], goal - p[0], dot(along, chain.center - p[0]), signs[0])

    def behind_first(v: SX) -> SX:
        return first.turn.about(h[0], v, back=True)

    fifth = _projected(along, h[4], h[5], dot(along, behind_first(chain.rotation @ h[5])), signs[1])
    # Joint 6 brings W^T h_2 to R_5^T h_2; then the turn of joints 2, 3, 4 together is known.
    from_first = chain.rotation.T @ first.turn.about(h[0], along)
    sixth = _between(h[5], from_first, fifth.turn.about(h[4], along, back=True), chain.bounded)

    def before_fifth(v: SX) -> SX:
        return sixth.about(h[5], fifth.turn.about(h[4], v, back=True), back=True)

    turned = behind_first(chain.rotation @ before_fifth(chain.normal))
    together = _between(along, chain.normal, turned, chain.bounded)
    # Joints 2 and 3 bring a point of axis 4 to its place, in the plane square to the axes.
    on_axis = chain.center + before_fifth(p[3] - chain.center)
    away = p[0] + behind_first(chain.rotation @ on_axis + chain.shift - p[0]) - p[1]
    elbow, lever, away = (v - dot(along, v) * along for v in (p[2] - p[1], p[3] - p[2], away))
    wanted = (dot(away, away) - dot(elbow, elbow) - dot(lever, lever)) / 2
    third = _projected(elbow, along, lever, wanted, signs[2])
    second = _between(along, elbow + third.turn.about(along, lever), away, chain.bounded)
    fourth = _plus(together, _plus(second, third.turn).back)
    turns = [first.turn, second, third.turn, fourth, fifth.turn, sixth]
    return turns, [first, fifth, third]


def _plus(turn: Turn, other: Turn) -> Turn:
    """A turn and another one about the same axis."""
    return Turn(turn.cos * other.cos - turn.sin * other.sin, turn.sin * other.cos + turn.cos * other.sin)


GEOMETRY = 58
"""Numbers of a chain: 18 of the axes, 18 of their points, 3 of the center, 3 of the normal, 16 of M."""


def _chain(form: Form, x: SX, R: SX, t: SX, bounded: bool = False) -> Chain:
    """That of its numbers and a tool pose, in the order of the steps."""
    h = [x[3 * i : 3 * i + 3] for i in range(6)]
    p = [x[18 + 3 * i : 21 + 3 * i] for i in range(6)]
    home, home_at = _frame(x[42:58].reshape((4, 4)).T)
    rotation = R @ home.T
    chain = Chain(h, p, x[36:39], x[39:42], rotation, t - rotation @ home_at, bounded)
    return chain.backward() if form.reversed else chain


def _solved(form: Form, chain: Chain, signs: list[SX]) -> Posture:
    return _parallel_axes(chain, signs) if form.family is Family.PARALLEL else _arm_and_wrist(chain, form, signs)


def steps(form: Form, numbers: SX, rotation: SX, position: SX, signs: list[SX]) -> Posture:
    """The turns of the six joints, in their order along the arm, and the roots of the three steps, to be bounded.

    Args:
        numbers: of the chain (58,). rotation, position: the tool's, (3, 3) and (3,). signs: of the three slopes.
    """
    turns, roots = _solved(form, _chain(form, numbers, rotation, position, bounded=True), signs)
    return turns[::-1] if form.reversed else turns, roots


def _frame(T: SX) -> tuple[SX, SX]:
    """Rotation and position of a pose (4, 4)."""
    return T[:3, :3], T[:3, 3]


def _corrections(family: Family, chain: Chain, turns: list[Turn]) -> list[SX]:
    """What a step of Newton's method adds to six angles, with the exact model's zeros in the Jacobian.

    Of axes that meet in the center nothing moves it: so the other three joints alone are corrected by its place, and
    those of the wrist by what is then left of the rotation.
    """
    R, t = SX.eye(3), SX.zeros(3, 1)
    axes, points = [], []
    for h, p, turn in zip(chain.h, chain.p, turns, strict=True):
        axes.append(R @ h)
        points.append(t + R @ p)
        R = horzcat(*(R @ turn.about(h, e) for e in horzsplit(SX.eye(3))))
        t = points[-1] - R @ p
    E = chain.rotation @ R.T
    turn = vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]) / 2
    place = R @ chain.center + t
    shift = chain.rotation @ chain.center + chain.shift - place
    moves = [cross(axis, place - point) for axis, point in zip(axes, points, strict=True)]
    if family is not Family.PARALLEL:
        first = _combined(moves[0], moves[1], moves[2], shift)
        left = turn - horzcat(*axes[:3]) @ vertcat(*first)
        return first + _combined(axes[3], axes[4], axes[5], left)
    along = axes[1]
    d1 = dot(along, shift) / dot(along, moves[0])
    together, d5, d6 = _combined(along, axes[4], axes[5], turn - d1 * axes[0])
    d2, d3, _ = _combined(moves[1] - moves[3], moves[2] - moves[3], along, shift - d1 * moves[0] - together * moves[3])
    return [d1, d2, d3, together - d2 - d3, d5, d6]


def _combined(a: SX, b: SX, c: SX, v: SX) -> list[SX]:
    """The numbers x, y, z with a x + b y + c z = v, by Cramer's rule."""
    volume = dot(a, cross(b, c))
    return [dot(v, cross(b, c)) / volume, dot(v, cross(c, a)) / volume, dot(v, cross(a, b)) / volume]


COLUMNS = 12
"""Numbers of an answer: six joints, three slopes, how real it is, how far within the limits, the pose's fault."""


@cache
def solver(form: Form, polish: bool) -> Function:
    """(chain (58,), pose (4, 4), own chain (58,), joints (5, 6), signs (3,)) -> answer (12,).

    An answer holds the six joints; the three slopes; how real it is, the least share of its roots, below 0 where there
    is none; the least distance to a joint limit; and by how much the pose is none. Where answers are to be polished
    they take two steps of Newton's method on the chain's own numbers, from those of the exact model.

    joints: rows of what makes joint values of angles, sign (angle - offset) at the turn nearest to a middle, and of the
    lower and upper limits.
    """
    numbers, pose, own_numbers = symbol("chain", GEOMETRY), symbol("pose", 4, 4), symbol("own", GEOMETRY)
    joints, signs = symbol("joints", 5, 6), symbol("signs", 3)
    inputs = {"chain": numbers, "pose": pose, "own": own_numbers, "joints": joints, "signs": signs}
    return Function("six_hinges", inputs, {"answer": answer(form, polish, *inputs.values())})


def answer(form: Form, polish: bool, numbers: SX, pose: SX, own_numbers: SX, joints: SX, signs: SX) -> SX:
    """The answer (12,) of `solver` as an expression of its arguments."""
    q, roots, _ = posture(form, polish, numbers, pose, own_numbers, joints, signs)
    within = reduce(fmin, [x for i in range(6) for x in (q[i] - joints[3, i], joints[4, i] - q[i])])
    share = reduce(fmin, [root.share for root in roots])
    return vertcat(q, *(root.slope for root in roots), share, within, _fault(pose))


def posture(
    form: Form, polish: bool, numbers: SX, pose: SX, own_numbers: SX, joints: SX, signs: SX
) -> tuple[SX, list[Root], SX]:
    """(six joints (6,), roots of the three steps, largest last correction) as expressions of `solver`'s arguments."""
    chain, own = (_chain(form, x, *_frame(pose)) for x in (numbers, own_numbers))
    turns, roots = _solved(form, chain, [signs[i] for i in range(3)])
    last = [SX(0)] * 6
    if polish:
        first = _corrections(form.family, own, turns)
        turns = [_plus(turn, Turn(1 - more * more / 2, more)) for turn, more in zip(turns, first, strict=True)]
    angles = [turn.angle for turn in turns]
    if polish:
        last = _corrections(form.family, own, turns)
        angles = [a + more for a, more in zip(angles, last, strict=True)]
    q = joints[0, :].T * (vertcat(*(angles[::-1] if form.reversed else angles)) - joints[1, :].T)
    q = q + 2 * np.pi * floor((joints[2, :].T - q) / (2 * np.pi) + 0.5)
    return q, roots, reduce(fmax, [fabs(more) for more in last])


def _fault(pose: SX) -> SX:
    """By how much a pose (4, 4) is none: of R^T R from 1, of det R from 1, of the last row from (0, 0, 0, 1)."""
    R = pose[:3, :3]
    gaps = [*vertsplit(vec(R.T @ R - SX.eye(3))), dot(R[:, 0], cross(R[:, 1], R[:, 2])) - 1]
    return reduce(fmax, [fabs(gap) for gap in (*gaps, *vertsplit(vec(pose[3, :] - SX([[0, 0, 0, 1]]))))])
