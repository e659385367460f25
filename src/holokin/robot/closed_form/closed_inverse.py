"""`ClosedInverse`: all postures of an arm at a tool pose, for given values of the joints that are held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations, product

import numpy as np

from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Indices, Matrix, Value, Vector, frozen
from ...symbolic import SX, Function, cross, densify, dot, horzcat, norm_2, substitute, symbol, vec, vertcat, vertsplit
from ...symbolic.native import SignsKernel, allowed, signs_kernel
from ...symbolic.rotations import rotation_about
from .arm_classes import ArmClass, Link, links_of
from .six_hinges import COLUMNS, GEOMETRY, Family, Form, solver, steps

SIGNS = np.array(list(product((1.0, -1.0), repeat=3)))
"""The signs (8, 3) of the three slopes."""

DOUBT = 1e-10
"""How real an answer is, see `solver`: nearer to 0 two postures meet, and the path to them decides."""

_PROBE = np.array([0.4, 0.7, -1.1, 1.3, 0.8, -0.5])
"""Angles [rad] of no special posture."""

Axis = tuple[SX, SX]
"""Direction and point (3,) of an axis."""


def _geometry(arm: ArmClass, links: Sequence[Link], held: SX) -> SX:
    """The numbers of `solver` (58,) as expressions of the values (r,) of the held joints."""
    # The axes with the six joints at 0.
    R, p = SX.eye(3), SX.zeros(3, 1)
    axes: list[Axis] = []
    between: list[Axis] = []  # held axes between the pair
    lower = 2 if arm.form.inner else 1  # free axes below the upper one of the pair
    lower = 6 - lower if arm.form.reversed else lower
    for link in links:
        p, R = p + R @ SX(link.position), R @ SX(link.rotation)
        axis = R @ SX(link.axis)
        if link.coordinate not in arm.held:
            axes += [(axis, p)] if link.coordinate >= 0 else []
            continue
        between += [(axis, p)] if len(axes) == lower else []
        value = link.multiplier * held[arm.held.index(link.coordinate)] + link.offset
        p, R = (p + axis * value, R) if link.slides else (p, R @ rotation_about(link.axis, value))
    # The point in which some meet, and a normal.
    ordered = axes[::-1] if arm.form.reversed else axes
    if arm.form.family is not Family.PARALLEL:
        center = _meeting_point(ordered[3:], held)
        first, second, third = ordered[:3]
        pair = (second, third) if arm.form.inner else (first, second)
        normal = _normal(pair[0], pair[1], between, held)
    else:
        center = _meeting_point(ordered[4:], held)
        (along, first), (_, second) = ordered[1:3]
        normal = second - first - along * dot(along, second - first)
    home = vertcat(horzcat(R, p), SX([[0, 0, 0, 1]]))
    every = [*(h for h, _ in axes), *(at for _, at in axes), center, normal / norm_2(normal), vec(home.T)]
    return densify(vertcat(*every))


def _vanishes(expression: SX, held: SX) -> bool:
    """Whether an expression of the held joints is 0, at two places."""
    places = (SX(start + np.arange(held.numel())) for start in (0.7, -1.3))
    return max(abs(float(x)) for place in places for x in vertsplit(substitute(expression, held, place))) < 1e-9


def _meeting_point(axes: Sequence[Axis], held: SX) -> SX:
    """The point (3,) in which axes meet: of the first two that are not parallel."""
    for (h, p), (k, o) in combinations(axes, 2):
        normal = cross(h, k)
        if not _vanishes(normal, held):
            return p + h * (dot(cross(o - p, k), normal) / dot(normal, normal))
    raise ValueError("the class tells that they meet")


def _normal(first: Axis, second: Axis, between: Sequence[Axis], held: SX) -> SX:
    """A normal (3,) of the plane of two axes: along a held axis between them that is square to both, or of them."""
    for axis, _ in between:
        if _vanishes(vertcat(dot(axis, first[0]), dot(axis, second[0])), held):
            return axis
    normal = cross(first[0], second[0])
    return cross(second[0], first[1] - second[1]) if _vanishes(normal, held) else normal


@dataclass(frozen=True, eq=False)
class ClosedInverse(Value):
    """All postures of an arm at a tool pose, at values of the joints that are held.

    limits: whether the joints' values are taken at the turn nearest to the middle of their range; else nearest to 0.
    """

    arm: ArmClass
    limits: bool = True

    @cached_property
    def others(self) -> list[int]:
        """The coordinates of the six joints, in their order along the arm."""
        chain, held = self._given, self.arm.held
        return [link.coordinate for link in chain if link.coordinate >= 0 and link.coordinate not in held]

    @cached_property
    def _given(self) -> list[Link]:
        return links_of(self.arm.robot, self.arm.tip)

    @cached_property
    def _exact(self) -> list[Link]:
        names = ("rotation", "position", "axis")
        return [replace(link, **{name: getattr(link, name).astype(float) for name in names}) for link in self.arm.links]

    @cached_property
    def joints(self) -> Matrix:
        """The rows (5, 6) of `solver`, of the six joints."""
        robot, columns = self.arm.robot, self.others
        free = {link.coordinate: link for link in self._given}
        low, high = (robot.lower[columns], robot.upper[columns]) if self.limits else np.array([[-np.inf], [np.inf]])
        rows = [
            [free[c].multiplier for c in columns],
            [free[c].offset for c in columns],
            robot.middle[columns] if self.limits else 0.0,
            np.broadcast_to(low - TOLERANCES.limit, (6,)),
            np.broadcast_to(high + TOLERANCES.limit, (6,)),
        ]
        return frozen(np.array([np.broadcast_to(row, (6,)) for row in rows]))

    @property
    def kernel(self) -> SignsKernel | None:
        """Native code, the same for all arms of the form; None without a compiler."""
        return _kernel(self.arm.form) if allowed() else None

    def at(self, held: ArrayLike) -> Held:
        """The inverse at one value (r,) of the held joints; the last one is kept."""
        values = np.asarray(held, dtype=float).reshape(1, len(self.arm.held))
        if self._last and np.array_equal(self._last[0].values, values[0]):
            return self._last[0]
        chain, own = self._chains(values[0])
        self._last[:] = [Held(self, frozen(values[0]), frozen(chain), frozen(own))]
        return self._last[0]

    @cached_property
    def _last(self) -> list[Held]:
        return []

    def answers(self, poses: Array, held: Matrix, threads: int | None = None) -> Array:
        """The answers (k, 8, 12) of `solver` at poses (k, 4, 4) and values (k, r) of the held joints."""
        values = np.broadcast_to(held, (len(poses), len(self.arm.held)))
        chain, own = self._chains.batch(values)
        return self.answers_of(chain, own, poses, threads)

    def answers_of(self, chain: Array, own: Array, poses: Array, threads: int | None) -> Array:
        """The answers at poses (k, 4, 4); chain, own: the numbers (58,) for all, or (k, 58)."""
        k = len(poses)
        poses = np.ascontiguousarray(poses, dtype=float)
        if self.kernel is not None:
            out = np.empty((k, len(SIGNS), COLUMNS))
            every = [np.ascontiguousarray(chain), poses, np.ascontiguousarray(own), self.joints]
            shapes = [(k, GEOMETRY), (k, 4, 4), (k, GEOMETRY), (k, 5, 6)]
            self.kernel([np.broadcast_to(x, shape) for x, shape in zip(every, shapes, strict=True)], [out], threads)
            return out
        chains = [np.repeat(x, len(SIGNS), axis=0) if x.ndim == 2 else x for x in (chain, own)]
        rows = solver(self.arm.form, True).batch(
            chains[0], np.repeat(poses, len(SIGNS), axis=0), chains[1], self.joints, np.tile(SIGNS, (k, 1))
        )
        return rows.reshape(k, len(SIGNS), COLUMNS)

    @cached_property
    def first_root(self) -> Function:
        """(values (r,) of the held joints, pose (4, 4)) -> how real the root of the first step is: below 0 no posture
        has the pose at these values. Of steps of degree two alone: signs change nothing then."""
        held, pose = symbol("held", len(self.arm.held)), symbol("pose", 4, 4)
        roots = steps(self.arm.form, self.numbers(held)[0], pose[:3, :3], pose[:3, 3], [SX(1)] * 3)[1]
        return Function("first_root", {"held": held, "pose": pose}, {"share": roots[0].share})

    @cached_property
    def _chains(self) -> Function:
        """Values (r,) of the held joints -> numbers of the exact chain and of the given one (58,)."""
        held = symbol("held", len(self.arm.held))
        chain, own = self.numbers(held)
        return Function("chains", {"held": held}, {"chain": chain, "own": own})

    def numbers(self, held: SX) -> tuple[SX, SX]:
        """The numbers of the exact chain and of the given one (58,), as expressions of the held joints' values (r,)."""
        values = symbol("held", len(self.arm.held))
        chains = [_geometry(self.arm, links, values) for links in (self._exact, self._given)]
        chain, own = (densify(substitute(chain, values, held)) for chain in chains)
        return chain, own


@cache
def _kernel(form: Form) -> SignsKernel | None:
    function = solver(form, True)
    shapes = list(function.input_shapes.values()), list(function.output_shapes.values())
    return signs_kernel(function.program, *shapes)


@dataclass(frozen=True, eq=False)
class Held(Value):
    """A `ClosedInverse` at one value (r,) of its held joints, with the numbers of the chain there."""

    inverse: ClosedInverse
    values: Vector
    chain: Vector
    own: Vector

    def answers(self, poses: Array, threads: int | None = None) -> Array:
        """The answers (k, 8, 12) of `solver` at poses (k, 4, 4)."""
        return self.inverse.answers_of(self.chain, self.own, poses, threads)

    def one(self, pose: Array) -> Matrix:
        """The same at one pose, an array (4, 4) of floats: (8, 12)."""
        kernel, joints = self._call
        return self.answers(pose[None])[0] if kernel is None else kernel.call(self.chain, pose, self.own, joints)

    @cached_property
    def _call(self) -> tuple[SignsKernel | None, Matrix]:
        return self.inverse.kernel, self.inverse.joints

    @cached_property
    def sound(self) -> bool:
        """Whether a posture is found again from its pose: not where every posture is singular at this value, and where
        two axes meet, or are parallel, that are not elsewhere."""
        arm, others = self.inverse.arm, self.inverse.others
        q = np.zeros(arm.robot.n)
        q[list(arm.held)], q[others] = self.values, _PROBE
        answers = self.one(arm.robot.pose(q, arm.tip))
        gap = np.abs((answers[:, :6] - _PROBE + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
        return bool(((gap < 1e-9) & (answers[:, 9] > 0)).any())

    def postures(self, answers: Array) -> Array:
        """The postures (..., n) of answers (..., 12); other coordinates than those of the arm are 0."""
        columns, others, values = self._coordinates
        q = answers.take(columns, axis=-1)
        q[..., others] = values
        return q

    @cached_property
    def _coordinates(self) -> tuple[Indices, Indices | slice, Vector]:
        """(columns of an answer that are a posture (n,), where others than the six joints are in it, their values)."""
        robot, joints = self.inverse.arm.robot, self.inverse.others
        columns, values = np.zeros(robot.n, dtype=np.intp), np.zeros(robot.n)
        columns[joints] = np.arange(6)
        values[list(self.inverse.arm.held)] = self.values
        others = np.setdiff1d(np.arange(robot.n), joints)
        # One place alone is written as a slice, which NumPy assigns to in half the time.
        places = slice(int(others[0]), int(others[0]) + 1) if len(others) == 1 else others
        return columns, places, frozen(values[others])
