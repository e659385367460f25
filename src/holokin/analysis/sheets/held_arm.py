"""An arm with a joint held, or the spin of its tool: the values of what is held at which poses have postures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.types import Array, Flags, Matrix, Value, Vector
from ...motion.checks import Clear
from ...motion.ik.arm_map import ArmMap
from ...motion.ik.closed_leaf import DOUBT
from ...motion.ik.held_coordinate import LEAST as SOUND
from ...motion.ik.held_coordinate import HeldCoordinate
from ...robot.closed_form import ClosedInverse
from ...robot.closed_form.closed_inverse import SIGNS
from .level_fit import times

VALUES = 96
"""Values of what is held at which the arcs of a pose are looked at."""

BELOW = 4
"""Sheets of an arm of seven joints, of those that its map has, with which a free spin is combined."""

TOGETHER = 500
"""Poses whose postures are looked at together."""

STARTS = 24
"""Angles at which each of the first terms of a rule that turns with the tool is tried, to begin with."""

NATIVE_FROM = 2_000
"""Poses from which native code tells what a rule sees of them: it is built once and asked hundreds of times."""


@dataclass(frozen=True, eq=False)
class HeldArm(Value):
    """An arm with a joint held, or the spin of its tool; poses are told apart by which arcs serve them where.

    whole: its map for whole poses, where the spin is held. count: of the values of what is held.
    """

    held: HeldCoordinate
    whole: ArmMap | None = None
    count: int = VALUES

    @cached_property
    def inverse(self) -> ClosedInverse:
        """The closed form."""
        return ClosedInverse(self.held.arm, limits=True)

    @cached_property
    def below(self) -> HeldArm | None:
        """That of whole poses, where the spin is held."""
        return None if self.whole is None else HeldArm(self.whole.held)

    @cached_property
    def values(self) -> Vector:
        """Values of what is held, evenly."""
        return self.held.values(self.count)

    @cached_property
    def branches(self) -> Matrix:
        """What may choose a posture (B, b): all signs, or sheets of the map for whole poses."""
        return SIGNS if self.whole is None or self.whole.held.none else self.whole.rows[:BELOW]

    def terms(self, poses: Array) -> Matrix:
        """The monomials (k, m) of poses (k, 4, 4)."""
        return np.asarray(self.held.seen.batch(poses, native_from=NATIVE_FROM)[0]).reshape(len(poses), -1)

    def _turned(self, poses: Array, spins: Vector) -> Array:
        return np.asarray(self.held.turned.batch(poses, spins[:, None], native_from=NATIVE_FROM))

    def _real(self, rows: Array) -> Flags:
        """Which answers (..., 12) of the closed form are postures within the limits."""
        return (rows[..., 9] > DOUBT) & (rows[..., 10] >= 0)

    def arcs(self, poses: Array, clear: Clear | None = None) -> Flags:
        """Whether a posture is within the limits (k, C, B) at poses, values and branches, and where the arm is asked
        for whole poses clear of something."""
        serves = np.zeros((len(poses), len(self.values), len(self.branches)), dtype=bool)
        for first in range(0, len(poses), TOGETHER):
            some = poses[first : first + TOGETHER]
            each, values = np.repeat(some, len(self.values), axis=0), np.tile(self.values, len(some))
            if self.below is not None:
                flags = self._below(self.below, each, values)
            else:
                rows = self._at(each, len(some))
                flags = self._real(rows)
                if clear is not None and flags.any():
                    flags[flags] = clear(self._postures(rows[flags], values[np.nonzero(flags)[0], None]))
            serves[first : first + TOGETHER] = flags.reshape(serves[first : first + TOGETHER].shape)
        return serves

    def _at(self, poses: Array, count: int) -> Array:
        """The answers (k, 8, 12) of the closed form at poses, each of `count` at all values of the joint."""
        every = [self.inverse.at(value) for value in self.values]
        chain, own = (np.array([getattr(one, name) for one in every]) for name in ("chain", "own"))
        return self.inverse.answers_of(*(np.tile(x, (count, 1)) for x in (chain, own)), poses=poses, threads=None)

    def _below(self, below: HeldArm, poses: Array, spins: Vector) -> Flags:
        """Which branches (k, B) of the arm for whole poses serve poses with the tool turned."""
        poses = self._turned(poses, spins)
        if below.held.none:
            return self._real(below.inverse.answers(poses, np.zeros((len(poses), 0))))
        f, w = below.terms(poses), below.held.width
        return np.column_stack([below.served(f, poses, row[:w], row[w:]) for row in self.branches])

    def _postures(self, rows: Array, values: Matrix) -> Matrix:
        """The postures (k, n) of answers (k, 12) at values (k, 1) of the joint."""
        q = np.zeros((len(rows), self.held.robot.n))
        q[:, self.inverse.others], q[:, list(self.held.arm.held)] = rows[:, :6], values
        return q

    def postures(self, poses: Array, values: Vector, sign: int, clear: Clear | None) -> Matrix:
        """The postures (k, n) of a choice of signs at poses (k, 4, 4) and values (k,); NaN where none is allowed."""
        low, high = self.held.range
        if self.held.turning:
            values = values + 2 * np.pi * np.floor(((low + high) / 2 - values) / (2 * np.pi) + 0.5)
        rows = self.inverse.answers(poses, values[:, None])[:, sign]
        q = self._postures(rows, values[:, None])
        allowed = self._real(rows) & (values >= low) & (values <= high)
        if clear is not None and allowed.any():
            allowed[allowed] = clear(q[allowed])
        q[~allowed] = np.nan
        return q

    def off(self, value: Array, middle: Array) -> Array:
        """From a middle to a value, of an angle the shorter way."""
        gap = value - middle
        return gap if self.held.slides else (gap + np.pi) % (2 * np.pi) - np.pi

    def served(self, f: Matrix, poses: Array, rule: Vector, branch: Vector) -> Flags:
        """Whether a sheet serves poses (k,), whose monomials are f (k, m)."""
        low, high = self.held.range
        if self.held.slides:
            value, sound = np.clip(times(f, rule), low, high), np.ones(len(f), dtype=bool)
        else:
            sine, cosine = times(f, rule[: self.held.terms]), times(f, rule[self.held.terms :])
            value, sound = np.arctan2(sine, cosine), np.hypot(sine, cosine) > SOUND
            value = value + 2 * np.pi * np.floor(((low + high) / 2 - value) / (2 * np.pi) + 0.5)
            sound &= (value >= low) & (value <= high)
        sign = int(np.flatnonzero((branch[-3:] == SIGNS).all(axis=1))[0])
        if self.below is None:
            return sound & self._real(self.inverse.answers(poses, value[:, None])[:, sign])
        poses, below, w = self._turned(poses, value), self.below, self.below.held.width
        if below.held.none:
            return sound & self._real(below.inverse.answers(poses, np.zeros((len(poses), 0)))[:, sign])
        return sound & below.served(below.terms(poses), poses, branch[:w], branch[w:])

    @cached_property
    def starts(self) -> Matrix:
        """Numbers (j, p) of rules with which a fit may begin: constants; the first terms that turn with the tool, each
        turned by some angles; of a slide also its place and constants."""
        held, count = self.held, self.held.basis.shape[1]
        if held.spin is not None:
            c, starts = np.linspace(-np.pi, np.pi, STARTS, endpoint=False), []
            for term in (0, count // 4):
                some = np.zeros((STARTS, count))
                some[:, term], some[:, count // 2 + term] = np.cos(c), np.sin(c)
                starts.append(some)
            return np.vstack(starts)
        if not held.slides:
            return held.constant(self.values)
        beside = held.constant(np.linspace(-held.length, held.length, 49))
        beside[:, -1] = held.length
        return np.vstack([held.constant(self.values), beside])
