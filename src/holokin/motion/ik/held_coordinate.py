"""What the rules of an arm's map give a value to: a joint that is held, or the spin of a tool that is free to turn.

    q_k  = atan2(a . f(pose), b . f(pose))     a hinge
    q_k  = a . f(pose), within its limits      a slide
    spin = atan2(a . f(pose), b . f(pose))     of a tool that is free to turn about an axis

f are the monomials of six numbers: where a point is, and how an axis lies, as a frame sees them. They are chosen so
that f does not change under a motion by which the arm's postures do not change, either: for a hinge and a spin the
shoulder and the first axis as seen from the hand, which does not see the turn about that axis, where the arm stands,
or what it carries; for a slide below an arm the hand and the last axis as seen from the slide.

A spin is counted from the pose that is given, and the answer is to depend on the axis alone. So f are those monomials
that turn with the tool: (x + i y) times what a turn about z does not change. A rule of them turns with it, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from ...base.types import Matrix, Value, Vector, kept
from ...robot import Robot
from ...robot.closed_form import ArmClass, ClosedInverse
from ...robot.closed_form.arm_classes import links_of, miss_of_point, screws
from ...robot.closed_form.six_hinges import answer
from ...symbolic import (
    SX,
    Function,
    atan2,
    cos,
    densify,
    dot,
    fabs,
    floor,
    fmax,
    fmin,
    horzcat,
    if_else,
    sin,
    sqrt,
    symbol,
    vertcat,
)
from ...symbolic.rotations import frame_about
from .closed_leaf import BOUNDLESS

DEGREE = 2
"""Of a joint's monomials, 28. With degree 3, 84, eight sheets of a Panda serve 97.7 % and not 97.3 %."""

LEAST = 0.1
"""Length of the vector (b . f, a . f) from which on a rule serves: it is fitted to 1, and at 0 its angle jumps."""

STEEP = 0.9
"""Cosine of the angle between the tool's axis and the arm's first one from which on spins are counted from another
direction than that of the first one: round-off must not tell where a spin begins."""


class Spin(NamedTuple):
    """The line about which the tool may turn, in the tool's frame: a direction (3,), and its point (3,) that is nearest
    to the last joint's origin."""

    axis: tuple[float, float, float]
    point: tuple[float, float, float]

    @staticmethod
    def of(robot: Robot, tip: str | None, axis: Vector) -> Spin:
        """The line through the origin of a tip along an axis (3,)."""
        tool = links_of(robot, tip)[-1]
        joint = -tool.rotation.T @ tool.position
        direction, point = ([float(f"{x:.9g}") + 0.0 for x in v] for v in (axis, axis * (axis @ joint)))
        return Spin((direction[0], direction[1], direction[2]), (point[0], point[1], point[2]))


@dataclass(frozen=True, eq=False)
class HeldCoordinate(Value):
    """What a rule gives a value to: the held joint of an arm; of an arm of six joints none, or the spin of the tool.

    arm: the six hinges that are left. length: in which places are measured [m]. spin: the axis that is free; then
    `below` is what the arm holds for whole poses, by which a turned pose is answered.
    """

    arm: ArmClass
    length: float
    spin: Spin | None = None
    below: HeldCoordinate | None = None

    @property
    def robot(self) -> Robot:
        """The arm's."""
        return self.arm.robot

    @property
    def joint(self) -> int | None:
        """The coordinate of the held joint; None of a spin and of six joints."""
        return self.arm.held[0] if self.arm.held and self.spin is None else None

    @cached_property
    def axes(self) -> Matrix:
        """A frame (3, 3) in the tool whose last axis is that of the spin."""
        return np.eye(3) if self.spin is None else frame_about(np.array(self.spin.axis))

    @property
    def none(self) -> bool:
        """Whether nothing is held."""
        return self.joint is None and self.spin is None

    @property
    def slides(self) -> bool:
        """Whether it is a length, not an angle."""
        return self.joint is not None and not self.robot.hinges[self.joint]

    @property
    def range(self) -> tuple[float, float]:
        """Its limits."""
        k = self.joint
        return (-np.pi, np.pi) if k is None else (float(self.robot.lower[k]), float(self.robot.upper[k]))

    @property
    def turning(self) -> bool:
        """Whether its limits leave all of a turn."""
        low, high = self.range
        return not self.slides and not self.none and high - low >= 2 * np.pi

    def values(self, count: int) -> Vector:
        """Values (count,) all over its range, or over a turn."""
        if self.none:
            return np.zeros(1)
        ends = (-np.pi, np.pi) if self.turning else self.range
        return np.linspace(*ends, count, endpoint=not self.turning)

    @cached_property
    def terms(self) -> int:
        """How many monomials it has, m; the first is 1."""
        return 0 if self.none else int(self.seen.output_shapes["terms"][0])

    @property
    def width(self) -> int:
        """How many numbers a rule has: a of a slide, else a and b."""
        return self.terms if self.slides else 2 * self.terms

    @property
    def branch(self) -> int:
        """How many numbers choose a posture once the value is known: three signs, or a row of a map of whole poses."""
        return 3 if self.below is None else self.below.width + self.below.branch

    def constant(self, values: Vector) -> Matrix:
        """The rules (k, width) that give values (k,) whatever the pose; of a spin, from where it is counted."""
        rules = np.zeros((len(values), self.width))
        if self.slides:
            rules[:, 0] = values
        elif not self.none:
            rules[:, 0], rules[:, self.terms] = np.sin(values), np.cos(values)
        return rules

    @cached_property
    def basis(self) -> Matrix:
        """The rules (width, p) of which rules are sums: all, or those that turn with the tool."""
        if self.spin is None:
            return np.eye(self.width)
        # (c + i d) (x + i y) has the sine c y + d x and the cosine c x - d y.
        m, count = self.terms, (self.terms - 1) // 2
        x, y = 1 + np.arange(count), 1 + count + np.arange(count)
        basis, c, d = np.zeros((2 * m, 2 * count)), np.arange(count), count + np.arange(count)
        basis[y, c] = basis[x, d] = basis[m + x, c] = 1.0
        basis[m + y, d] = -1.0
        return basis

    @cached_property
    def seen(self) -> Function:
        """pose (4, 4) -> (monomials (m,), the frame (3, 3) from which a spin is counted)."""
        T = symbol("pose", 4, 4)
        terms, frame = _terms(self, T)
        return Function("seen", {"pose": T}, {"terms": densify(terms), "frame": densify(frame)})

    @cached_property
    def turned(self) -> Function:
        """(pose (4, 4), spin) -> the pose with the tool so far from where a spin is counted."""
        T, c = symbol("pose", 4, 4), symbol("spin", 1)
        return Function("turned", {"pose": T, "spin": c}, {"pose": densify(_turned(self, T, _terms(self, T)[1], c))})

    def answer(self, T: SX, rule: SX, branch: SX, limits: bool) -> tuple[SX, SX, SX, SX]:
        """(posture (n,), how real it is, how far within the limits, fault) of a pose, a rule and what chooses one."""
        value, within, length = SX(0, 1), SX(BOUNDLESS), SX(1)
        if self.none:
            return self._closed(T, value, within, length, branch, limits)
        terms, frame = _terms(self, T)
        if self.slides:
            value = dot(rule, terms)
            value = fmin(fmax(value, self.range[0]), self.range[1]) if limits else value
            return self._closed(T, value, within, length, branch, limits)
        sine, cosine = dot(rule[: self.terms], terms), dot(rule[self.terms :], terms)
        value, length = atan2(sine, cosine), sqrt(sine * sine + cosine * cosine)
        if self.below is not None:
            w, T = self.below.width, _turned(self, T, frame, value)
            q, share, within, fault = self.below.answer(T, branch[:w], branch[w:], limits)
            return q, fmin(share, length - LEAST), within, fault
        low, high = self.range
        if limits and np.isfinite(low + high):
            value = value + 2 * np.pi * floor(((low + high) / 2 - value) / (2 * np.pi) + 0.5)
            within = fmin(value - low, high - value)
        return self._closed(T, value, within, length, branch, limits)

    def _closed(self, T: SX, value: SX, within: SX, length: SX, signs: SX, limits: bool) -> tuple[SX, SX, SX, SX]:
        inverse = ClosedInverse(self.arm, limits)
        chain, own = inverse.numbers(value)
        joints = SX(np.clip(inverse.joints, -BOUNDLESS, BOUNDLESS))
        x = answer(self.arm.form, True, chain, T, own, joints, signs)
        q = SX.zeros(self.robot.n, 1)
        q[inverse.others] = x[:6]
        if self.joint is not None:
            q[self.joint] = value
        return q, fmin(x[9], length - LEAST), fmin(x[10], within), x[11]


# --- What is seen of a pose.


class _Ends(NamedTuple):
    """Of an arm: the first axis, by its direction, one square to it that is fixed beneath it, and the point of it that
    is nearest to the shoulder; and the frame of the last joint in that of the tool."""

    along: Vector
    across: Vector
    point: Vector
    hand: Matrix
    origin: Vector


@kept
def _ends(arm: ArmClass) -> _Ends:
    links = links_of(arm.robot, arm.tip)
    axes = [(np.asarray(h, dtype=float), np.asarray(p, dtype=float)) for h, p in screws(links, {})[0]]
    meeting = miss_of_point(axes[:3])
    along, at = axes[0]
    point = at if meeting is None else meeting[1]
    tool = links[-1]
    across = links[0].rotation @ frame_about(links[0].axis)[:, 0]
    return _Ends(
        along, across, at + along * float((point - at) @ along), tool.rotation.T, -tool.rotation.T @ tool.position
    )


def _terms(held: HeldCoordinate, T: SX) -> tuple[SX, SX]:
    """(the monomials of a pose, the frame from which a spin is counted)."""
    ends, R, p = _ends(held.arm), T[:3, :3], T[:3, 3]
    hand, origin = R @ SX(ends.hand), p + R @ SX(ends.origin)
    links = links_of(held.robot, held.arm.tip)
    if held.slides and links[0].coordinate == held.joint:
        # From the slide: the hand's place along it alone, beside all products of the others.
        base, last = links[0].rotation @ frame_about(links[0].axis), links[-2].axis
        x, y, z, *axis = _view(held, SX(base), SX(links[0].position), origin, hand @ SX(last))
        return vertcat(*_monomials([x, y, *axis], DEGREE), z), hand
    if held.spin is None:
        return vertcat(*_monomials(_view(held, hand, origin, SX(ends.point), SX(ends.along)), DEGREE)), hand
    # A frame along the axis that is turned so that it has the first axis in its plane x, z; or where they are nearly
    # parallel, a direction that is square to the first axis.
    frame = R @ SX(held.axes)
    steep = fabs(dot(frame[:, 2], SX(ends.along))) > STEEP
    from_ = frame.T @ if_else(steep, SX(ends.across), SX(ends.along))
    frame = _about_z(frame, atan2(from_[1], from_[0]))
    foot = p + R @ SX(np.array(held.spin.point))
    x, y, z, u, v, w = _view(held, frame, foot, SX(ends.point), SX(ends.along))
    still = [*_monomials([z, w], 2), x * x + y * y]
    first = [(x * a, y * a) for a in still] + [(u * a, v * a) for a in still]
    # The others of degree three: (x + i y)^2 (u - i v) and (u + i v)^2 (x - i y).
    square, other = (x * x - y * y, 2 * x * y), (u * u - v * v, 2 * u * v)
    first += [(square[0] * u + square[1] * v, square[1] * u - square[0] * v)]
    first += [(other[0] * x + other[1] * y, other[1] * x - other[0] * y)]
    return vertcat(SX(1), *(a for a, _ in first), *(b for _, b in first)), frame


def _view(held: HeldCoordinate, frame: SX, origin: SX, place: SX, direction: SX) -> list[SX]:
    """A place in lengths and a direction as a frame sees them: six numbers."""
    seen, axis = frame.T @ (place - origin) / held.length, frame.T @ direction
    return [*(seen[i] for i in range(3)), *(axis[i] for i in range(3))]


def _about_z(frame: SX, angle: SX) -> SX:
    """A frame (3, 3) that is turned about its z axis."""
    c, s = cos(angle), sin(angle)
    return horzcat(c * frame[:, 0] + s * frame[:, 1], c * frame[:, 1] - s * frame[:, 0], frame[:, 2])


def _turned(held: HeldCoordinate, T: SX, frame: SX, spin: SX) -> SX:
    """The pose of a tool whose axis has a frame, turned so far from that."""
    T = SX(T)
    T[:3, :3] = _about_z(frame, spin) @ SX(held.axes.T)
    return T


def _monomials(x: Sequence[SX], degree: int) -> list[SX]:
    """The products of up to so many of some numbers; first comes 1."""
    return [
        reduce(lambda a, b: a * b, which, SX(1))
        for count in range(degree + 1)
        for which in combinations_with_replacement(x, count)
    ]
