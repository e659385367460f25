"""Which joints of an arm, held, leave six hinges whose inverse is closed: told from the axes, in exact arithmetic.

Axes of files meet to 1e-5 (an xArm's URDF writes 1.5708 for a right angle). So the file's numbers are rounded to an
exact model, of rational numbers, in which the axes meet or do not. How far it is from the file is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations, product

import numpy as np

from ...base.types import Array, Matrix, Value, Vector, kept
from ..joints import joints_above
from ..model import Robot
from .six_hinges import Family, Form

DIGITS = (9, 8, 7, 6, 5, 4)
"""Decimals to which lengths are rounded, one after another, until axes meet: an exact model is at most 0.05 mm away."""

SNAP = 1e-4
"""Angle [rad] below which a rotation is that of right angles, and lengths [m] up to which axes may miss."""

Screw = tuple[Array, Array]
"""Direction and point of an axis, at the zero posture of the free joints; numbers or fractions."""


def _exact_point(v: Vector, digits: int) -> Array:
    """A vector as fractions, of so many decimals."""
    return np.array([Fraction(str(round(float(x), digits))) for x in v], dtype=object)


def _exact_rotation(R: Matrix) -> Array:
    """The rotation of right angles within `SNAP`; else one of a quaternion of fractions, within 1e-11."""
    right = np.round(R)
    if abs(np.abs(right).sum() - 3) < 0.5 and np.abs(R - right).max() < SNAP:
        return np.array([[Fraction(int(x)) for x in row] for row in right], dtype=object)
    # The quaternion, but for its length: the row of 4 q q^T whose square is the greatest.
    (a, b, c), (d, e, f), (g, h, i) = R
    outer = [
        [1 + a - e - i, b + d, c + g, h - f],
        [b + d, 1 - a + e - i, f + h, c - g],
        [c + g, f + h, 1 - a - e + i, d - b],
        [h - f, c - g, d - b, 1 + a + e + i],
    ]
    quaternion = outer[int(np.argmax(np.diagonal(outer)))]
    x, y, z, w = (Fraction(float(v) / 4).limit_denominator(10**12) for v in quaternion)
    square = x * x + y * y + z * z + w * w
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows, dtype=object) / square


def _exact_direction(v: Vector) -> Array:
    """A unit vector of fractions: along an axis of the frame within `SNAP`, else by stereographic projection."""
    right = np.round(v)
    if np.abs(v - right).max() < SNAP:
        return np.array([Fraction(int(x)) for x in right], dtype=object)
    largest = int(np.argmax(np.abs(v)))
    first, second = (i for i in range(3) if i != largest)
    sign = 1 if v[largest] > 0 else -1
    s, t = (Fraction(float(v[i] / (1 + abs(v[largest])))).limit_denominator(10**12) for i in (first, second))
    square = s * s + t * t
    out = np.empty(3, dtype=object)
    out[first], out[second], out[largest] = (
        2 * s / (1 + square),
        2 * t / (1 + square),
        sign * (1 - square) / (1 + square),
    )
    return out


@dataclass(frozen=True)
class Link:
    """A joint of the chain: where its frame stands in the one before, its axis, what moves it. Numbers or fractions."""

    rotation: Array
    position: Array
    axis: Array
    slides: bool
    coordinate: int
    multiplier: float
    offset: float


def links_of(robot: Robot, tip: str | None) -> list[Link]:
    """The joints of the chain to a tip, and the tip itself as the last link, of no coordinate (-1)."""
    chosen = robot._find_tip(tip)
    joints = [robot.joints[i] for i in reversed(joints_above(robot.joints, chosen.joint))]
    links = [
        Link(
            j.placement[:3, :3], j.placement[:3, 3], j.axis, j.kind == "prismatic", j.coordinate, j.multiplier, j.offset
        )
        for j in joints
    ]
    return [*links, Link(chosen.placement[:3, :3], chosen.placement[:3, 3], np.zeros(3), False, -1, 1.0, 0.0)]


def _exact_links(links: Sequence[Link], digits: int, along: Sequence[Fraction]) -> list[Link]:
    """The links as fractions. What is rounded is where a place on each axis, so far along, is from the one before."""
    out: list[Link] = []
    none: Array = np.array([Fraction(0)] * 3)
    back, before = none, np.zeros(3)
    for link, t in zip(links, along, strict=True):
        axis: Array = _exact_direction(link.axis) if link.coordinate >= 0 else link.axis
        R, ahead = _exact_rotation(link.rotation), link.rotation @ link.axis * float(t)
        position = _exact_point(link.position + ahead - before, digits) + back
        shift: Array = np.array([x * t for x in axis]) if t else none
        out.append(replace(link, rotation=R, position=position - R @ shift, axis=axis))
        back, before = shift, link.axis * float(t)
    return out


def _places_to_meet(links: Sequence[Link], place: dict[int, tuple], form: Form) -> list[Fraction]:
    """How far along each axis [m] it meets the others of its form, with held joints at a place; else 0."""
    axes = screws(links, place)[0]
    free = [i for i, link in enumerate(links) if link.coordinate >= 0 and i not in place]
    order = list(range(6))[:: -1 if form.reversed else 1]
    groups = [order[3:], order[1:3] if form.inner else order[:2]] if form.family is Family.PAIR else [order[4:]]
    along = [Fraction(0)] * len(links)
    for group in groups:
        some = [axes[k] for k in group]
        if (meeting := miss_of_point([*some, some[0]][:3])) is not None:
            for k, (h, p) in zip(group, some, strict=True):
                along[free[k]] = Fraction(str(round(float((meeting[1] - p) @ h), 12)))
    return along


def _turn_about(axis: Array, c, s) -> Array:
    """The rotation about a unit axis by an angle of cosine c and sine s."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=axis.dtype)
    return np.eye(3, dtype=axis.dtype) + s * K + (1 - c) * (K @ K)


def screws(links: Sequence[Link], held: dict[int, tuple]) -> tuple[list[Screw], list[Screw], Screw]:
    """(free axes, axes of held joints, (rotation, position) of the tip) with the free joints at 0.

    Args:
        held: place in the chain -> (cosine, sine) of a hinge's angle, or (travel,) of a slide.
    """
    kind = links[0].position.dtype
    R, p = np.eye(3, dtype=kind), np.zeros(3, dtype=kind)
    free: list[Screw] = []
    others: list[Screw] = []
    for i, link in enumerate(links):
        p, R = p + R @ link.position, R @ link.rotation
        axis = R @ link.axis
        if link.coordinate < 0:
            continue
        if i in held:
            others.append((axis, p))
            value = held[i]
            if link.slides:
                p = p + axis * value[0]
            else:
                R = R @ _turn_about(link.axis, *value)
        else:
            free.append((axis, p))
    return free, others, (R, p)


def _miss_of_plane(a: Screw, b: Screw):
    """How far two axes are from lying in one plane: the volume (p_b - p_a) . (h_a x h_b) [m]."""
    return np.dot(b[1] - a[1], np.cross(a[0], b[0]))


def miss_of_point(three: Sequence[Screw]):
    """How far three axes are from meeting in a point, as vectors that vanish then, and the point; None if parallel."""
    pairs = [(i, j) for i, j in combinations(range(3), 2)]
    sizes = [float(np.dot(n, n)) for n in (np.cross(three[i][0], three[j][0]) for i, j in pairs)]
    i, j = pairs[int(np.argmax(sizes))]
    if max(sizes) < 1e-8:
        return None
    n = np.cross(three[i][0], three[j][0])
    along = np.dot(np.cross(three[j][1] - three[i][1], three[j][0]), n) / np.dot(n, n)
    point = three[i][1] + along * three[i][0]
    return [np.cross(point - p, h) for h, p in three], point


def _miss_of_parallel(three: Sequence[Screw]):
    """How far three axes are from being parallel, as vectors that vanish then."""
    return [np.cross(three[0][0], h) for h, _ in three[1:]]


FORMS = (
    *(Form(Family.PAIR, backward, inner) for backward in (False, True) for inner in (False, True)),
    *(Form(Family.PARALLEL, backward) for backward in (False, True)),
    *(Form(Family.SPHERE, backward) for backward in (False, True)),
)
"""In the order in which they are looked for."""


def _zeros(form: Form, axes: Sequence[Screw]) -> list | None:
    """The numbers that vanish where six axes have a form; None where they cannot have it."""
    a = axes[::-1] if form.reversed else axes
    if form.family is not Family.PARALLEL:
        meeting = miss_of_point(a[3:])
        pair = [] if form.family is Family.SPHERE else [_miss_of_plane(*(a[1:3] if form.inner else a[:2]))]
        return None if meeting is None else [*np.concatenate(meeting[0]), *pair]
    across = np.cross(a[4][0], a[5][0])
    if not np.dot(across, across) > SNAP * SNAP:
        return None
    return [*np.concatenate(_miss_of_parallel(a[1:4])), _miss_of_plane(a[4], a[5])]


def _samples(slide: bool, count: int) -> list[tuple]:
    """Values of a held joint: points of the circle as fractions, or lengths."""
    shares = [Fraction(k, count) for k in range(1, count + 1)]
    if slide:
        return [(t,) for t in shares]
    signed = [sign * t for t in shares for sign in (1, -1)][:count]
    return [((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)) for t in signed]


DEGREE = 13
"""Values of a held joint at which a polynomial of its cosine and sine is 0 that is 0 always: of degree up to six."""


@dataclass(frozen=True, eq=False)
class ArmClass(Value):
    """Joints of an arm which, held, leave six hinges whose inverse is closed.

    held: their coordinates. links: the exact model. angle [rad], distance [m]: how far it is from the given numbers, of
    the joint that is farthest; where the arm stands and what it carries do not count.
    """

    robot: Robot
    tip: str
    held: tuple[int, ...]
    form: Form
    links: tuple[Link, ...]
    angle: float
    distance: float

    @property
    def proven(self) -> bool:
        """Whether pose and signs tell the posture, on the whole arm: not after a step of degree four."""
        return self.form.family.quadratic

    @property
    def exact(self) -> bool:
        """Whether the exact model is the robot, but for round-off."""
        return max(self.angle, self.distance) < 1e-13


@dataclass(frozen=True, eq=False)
class NoClass(Value):
    """Why joints of an arm, held, leave no closed inverse; `miss` is how far the nearest class is, in m or rad.

    singular: every posture of what is left is.
    """

    held: tuple[int, ...]
    reason: str
    miss: float = np.inf
    singular: bool = False


def no_six_hinges(links: Sequence[Link], held: Sequence[int]) -> str | None:
    """Why links with the coordinates `held` at a value are not six hinges that turn one by one; else None."""
    moving = [link for link in links if link.coordinate >= 0 and link.coordinate not in held]
    if len(moving) != 6:
        return f"{len(moving)} joints are left, and six are needed"
    if any(link.slides for link in moving):
        return "a slide is left among the six"
    if len({link.coordinate for link in moving}) < 6 or any(abs(link.multiplier) != 1 for link in moving):
        return "one of the six follows another through a gear"
    return None


@kept
def arm_class(robot: Robot, held: tuple[int, ...], tip: str | None = None) -> ArmClass | NoClass:
    """The class of what is left when the coordinates `held` are."""
    links = links_of(robot, tip)
    if reason := no_six_hinges(links, held):
        return NoClass(held, reason)
    fixed = [i for i, link in enumerate(links) if link.coordinate in held]
    # Candidates by numbers at one place of the held joints, then in exact arithmetic at as many as a polynomial needs.
    place = {i: (0.3,) if links[i].slides else (0.8, 0.6) for i in fixed}
    near: dict[bool, list[Form]] = {True: [], False: []}
    best = np.inf
    axes = screws(links, place)[0]
    for form in FORMS:
        if (zeros := _zeros(form, axes)) is None:
            continue
        miss = float(np.abs(np.asarray(zeros, dtype=float)).max())
        best = min(best, miss)
        if miss < SNAP:
            near[form.family.quadratic].append(form)
    # The frames as they are; then seen from where axes meet, which no short numbers may tell.
    origins = [Fraction(0)] * len(links)
    tries = []
    for forms in near.values():
        tries += [(forms, origins, digits) for digits in DIGITS if forms]
        tries += [([form], _places_to_meet(links, place, form), digits) for form in forms for digits in (12, *DIGITS)]
    for forms, along, digits in tries:
        exact = _exact_links(links, digits, along)
        choices = [_samples(links[i].slides, DEGREE if len(fixed) == 1 else 7) for i in fixed]
        left = list(forms)
        for values in product(*choices):
            axes = screws(exact, dict(zip(fixed, values, strict=True)))[0]
            left = [form for form in left if _holds(form, axes)]
            if not left:
                break
        if left:
            if _always_singular(links, place):
                return NoClass(
                    held, "the other joints cannot move the tool in all directions, at any posture", best, singular=True
                )
            angle, distance = frames_apart(_arm_alone(links), _arm_alone(exact))
            return ArmClass(robot, robot._find_tip(tip).name, held, left[0], tuple(exact), angle, distance)
    if any(near.values()):
        return NoClass(held, "axes of the other joints meet, or are parallel, only nearly", best)
    return NoClass(
        held, "of the other joints no three axes meet in a point, nor are three parallel beside two that meet", best
    )


def _holds(form: Form, axes: Sequence[Screw]) -> bool:
    zeros = _zeros(form, axes)
    return zeros is not None and all(z == 0 for z in zeros)


def _always_singular(links: Sequence[Link], place: dict[int, tuple]) -> bool:
    """Whether the Jacobian of the free joints has no inverse at any of some postures."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        spot = {i: (float(np.cos(a)), float(np.sin(a))) for i, a in enumerate(rng.uniform(-3, 3, len(links)))}
        everything = {i: place.get(i, spot[i]) for i, link in enumerate(links) if link.coordinate >= 0}
        _, axes, (_, end) = screws(links, everything)
        rows = [
            np.concatenate([np.cross(h, end - p), h])
            for i, (h, p) in zip(everything, axes, strict=True)
            if i not in place
        ]
        if np.linalg.cond(np.array(rows)) < 1e8:
            return False
    return True


def _arm_alone(links: Sequence[Link]) -> list[Link]:
    """The links without where the arm stands and what it carries, which move no axis against another."""
    first = replace(links[0], rotation=np.eye(3), position=np.zeros(3))
    return [first, *links[1:-1]]


def frames_apart(links: Sequence[Link], exact: Sequence[Link]) -> tuple[float, float]:
    """Largest angle [rad] and distance [m] between the frames of two models, each in the one before."""
    angle = distance = 0.0
    for given, rounded in zip(links, exact, strict=True):
        R = rounded.rotation.astype(float)
        turn = np.linalg.norm(given.rotation - R) / np.sqrt(2)
        tilt = np.linalg.norm(given.axis - rounded.axis.astype(float)) if given.coordinate >= 0 else 0.0
        angle = max(angle, float(turn), float(tilt))
        distance = max(distance, float(np.linalg.norm(given.position - rounded.position.astype(float))))
    return angle, distance
