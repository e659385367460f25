"""`ClosedInverse`: all postures of an arm at a tool pose, for given values of the joints that are held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from ...base.types import Array, Flags, Matrix, Value, Vector
from .arm_class import ArmClass, Link, Screw, links_of, screws
from .six_hinges import Family, solver

EXACT = 1e-13
"""Distance [rad, m] up to which a model's numbers are those of the exact one: then answers need no polish."""

DOUBLE = -1e-12
"""Share of a root, (a^2 + b^2 - d^2) / (a^2 + b^2), from which it is real: two roots meet where it is 0."""


SIGNS = np.array(list(product((1.0, -1.0), repeat=3)))
"""The signs (8, 3) of the three slopes."""


def _geometry(arm: ArmClass, links: Sequence[Link], levels: Matrix) -> Matrix:
    """The numbers of `solver` (k, 58) at values (k, len(held)) of the held joints."""
    values, k = {}, len(levels)
    for i, link in enumerate(links):
        if link.coordinate in arm.held:
            level = levels[:, arm.held.index(link.coordinate)]
            value = (link.multiplier * level + link.offset)[:, None, None]
            values[i] = (value,) if link.slides else (np.cos(value), np.sin(value))
    axes, held, (R, p) = screws(links, values)
    axes = [(np.broadcast_to(h, (k, 3)), np.broadcast_to(at, (k, 3))) for h, at in axes]
    held = [np.broadcast_to(h, (k, 3)) for h, _ in held]
    ordered = axes[::-1] if arm.form.reversed else axes
    if arm.form.family is Family.PAIR:
        center = _nearest_point(ordered[3:])
        normal = _normal(*(ordered[1:3] if arm.form.inner else ordered[:2]), held)
    else:
        center = _nearest_point(ordered[4:])
        normal = _square(ordered[1][0])
    home = np.broadcast_to(np.eye(4), (k, 4, 4)).copy()
    home[:, :3, :3], home[:, :3, 3] = R, p
    return np.hstack([*(h for h, _ in axes), *(at for _, at in axes), center, normal, home.reshape(k, 16)])


def _nearest_point(axes: Sequence[Screw]) -> Matrix:
    """The points (k, 3) nearest to some axes, in which they meet."""
    across = [np.eye(3) - h[:, :, None] * h[:, None, :] for h, _ in axes]
    rows = [(P @ p[:, :, None]) for P, (_, p) in zip(across, axes, strict=True)]
    return np.linalg.solve(sum(across), sum(rows))[:, :, 0]


def _normal(first: Screw, second: Screw, held: Sequence[Matrix]) -> Matrix:
    """The normal (k, 3) of the plane of two axes; along a held axis that is square to both, so that its sign stays."""
    for axis in held:
        if max(np.abs(np.sum(axis * h, axis=1)).max() for h in (first[0], second[0])) < 1e-9:
            return axis
    normal = np.cross(first[0], second[0])
    if (np.linalg.norm(normal, axis=1) < 1e-6).all():
        normal = np.cross(second[0], first[1] - second[1])
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def _square(h: Matrix) -> Matrix:
    """Unit vectors (k, 3) square to others."""
    other = np.eye(3)[np.argmin(np.abs(h), axis=1)]
    out = np.cross(h, other)
    return out / np.linalg.norm(out, axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class ClosedInverse(Value):
    """(tool poses, values of the held joints) -> all postures."""

    arm: ArmClass

    @cached_property
    def _given(self) -> list[Link]:
        return links_of(self.arm.robot, self.arm.tip)

    @cached_property
    def _exact(self) -> list[Link]:
        def numbers(link: Link) -> Link:
            from dataclasses import replace

            return replace(
                link,
                rotation=link.rotation.astype(float),
                position=link.position.astype(float),
                axis=link.axis.astype(float),
            )

        return [numbers(link) for link in self.arm.links]

    @cached_property
    def polished(self) -> bool:
        """Whether answers take a step of Newton's method on the given numbers."""
        return max(self.arm.angle, self.arm.distance) > EXACT

    @cached_property
    def _columns(self) -> tuple[list[int], Vector, Vector]:
        """(coordinates, signs, offsets) of the six joints."""
        free = [link for link in self._given if link.coordinate >= 0 and link.coordinate not in self.arm.held]
        signs = np.array([link.multiplier for link in free])
        return [link.coordinate for link in free], signs, np.array([link.offset for link in free])

    def postures(self, poses: Array, levels: Matrix, polish: bool = True) -> tuple[Array, Array, Array]:
        """(postures (k, 8, n), slopes (k, 8, 3), shares (k, 8): below `DOUBLE` there is none) of poses (k, 4, 4)."""
        k = len(poses)
        levels = np.broadcast_to(levels, (k, len(self.arm.held)))
        chain, own = (_geometry(self.arm, links, levels) for links in (self._exact, self._given))
        function = solver(self.arm.form, polish)
        out = function.batch(*(np.repeat(x, 8, axis=0) for x in (chain, poses, own)), np.tile(SIGNS, (k, 1)))
        out = out.reshape(k, 8, 10)
        coordinates, signs, offsets = self._columns
        q = np.zeros((k, 8, self.arm.robot.n))
        angles = (out[:, :, :6] - offsets) * signs
        q[:, :, coordinates] = np.arctan2(np.sin(angles), np.cos(angles))
        q[:, :, list(self.arm.held)] = levels[:, None, :]
        return q, out[:, :, 6:9], out[:, :, 9]
