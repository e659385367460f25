"""`SignedBox`: the proof over a box of tool poses that one posture with the start's signs exists on all of it.

Where the joints that a strategy holds leave an inverse of three steps, each a root of a cos q + b sin q = d, a pose and
the signs of the three slopes tell the posture. So it is enough that each step has two roots, (a^2 + b^2 - d^2) /
(a^2 + b^2) > 0: the posture is then a smooth function of the pose. The steps are enclosed over cells of poses alone, by
Taylor models of degree two, which hold all rounding. A cell in which a step may have no root is halved.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from ..base.types import Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector
from ..base.units import at_least, share_text
from ..motion.ik import InverseStatus
from ..motion.ik.closed_leaf import ClosedBranch, closed_leaf
from ..motion.ik.leaf import leaf_value
from ..path.workspaces import PoseRange
from ..robot.closed_form import ArmClass, Held
from ..robot.closed_form.arm_classes import screws
from ..robot.closed_form.closed_inverse import SIGNS
from ..robot.closed_form.six_hinges import Family, steps
from ..strategies import HolonomicStrategy
from ..symbolic import SX, symbol, vertcat
from ..symbolic import intervals as iv
from ..symbolic.intervals import Interval
from ..symbolic.taylor_function import Taylor, TaylorFunction
from .box_proof import PoseRegion, faces
from .cell_search import Boxes, Demands, Extent
from .certificate import PART, START
from .equation import PoseBox
from .whole_arm import WholeArm, meeting_point

# --- The exact arm at the held joints' values, as numbers with what they are off by.

OFF = 2.0**-50
"""By how much a fraction is off as a double, of itself, and some more."""


def _on_circle(angle: float) -> tuple[Fraction, Fraction]:
    """Cosine and sine of an angle as fractions on the unit circle, right to 1e-15."""
    t = Fraction(float(np.tan(np.remainder(angle + np.pi, 2 * np.pi) / 4 - np.pi / 4)))
    c, s = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    return c * c - s * s, 2 * c * s


def _exact_chain(arm: ArmClass, values: Vector, near: Vector) -> tuple[list[Fraction | float], Vector]:
    """(the numbers of `steps` (58,), by how much each is off as a double) of the exact arm at held values (r,).

    near: the same (58,) in doubles, which tells the side of the normal.
    """
    # The axes at the held values, the point in which some meet, the normal.
    held = {}
    for i, link in enumerate(arm.links):
        if link.coordinate in arm.held:
            value = link.multiplier * float(values[arm.held.index(link.coordinate)]) + link.offset
            held[i] = (Fraction(value),) if link.slides else _on_circle(value)
    axes, _, (R, p) = screws(arm.links, held)
    ordered = axes[::-1] if arm.form.reversed else axes
    pair = arm.form.family is Family.PAIR
    center = meeting_point(ordered[3:] if pair else ordered[4:])
    (h, at), (k, other) = ordered[1:3] if not pair or arm.form.inner else ordered[:2]
    normal = np.cross(h, k)
    if not pair:
        normal = other - at - h * (h @ (other - at))
    elif not any(normal):
        normal = np.cross(k, at - other)
    square = normal @ normal
    side = 1 if float(normal @ near[39:42]) > 0 else -1
    unit = [side * (Fraction(0) if not x else Fraction(1 if x > 0 else -1) if x * x == square else x) for x in normal]
    # The numbers; of the normal those that are no fractions.
    length = float(np.sqrt(float(square)))
    exact = [*(x for h, _ in axes for x in h), *(x for _, at in axes for x in at), *center]
    exact += [x if x in (0, 1, -1) else float(x) / length for x in unit]
    exact += [x for row, t in zip(R, p, strict=True) for x in (*row, t)] + [Fraction(x) for x in (0, 0, 0, 1)]
    off = np.array([0.0 if x in (0, 1, -1) else abs(float(x)) * OFF for x in exact])
    return exact, off


def _angles(cosine: Taylor, sine: Taylor) -> Interval:
    """Angles (6, k) by their cosines and sines: from that in the middle of a cell, and by how much it changes."""
    middle = np.arctan2(sine.c, cosine.c)
    cosines, sines = np.cos(middle), np.sin(middle)  # another angle would do: these are off by less than `wide`
    wide = 2.0**-45

    def turned(a: Taylor, b: Taylor, p: Array, q: Array) -> Interval:
        """p a + q b."""
        c, L, Q = (_times(p, x) + _times(q, y) for x, y in zip(a[:3], b[:3], strict=True))
        both = Taylor(c, L, Q, a.r + b.r)
        size = np.abs(a.c) + np.abs(b.c) + np.abs(a.L).sum(axis=1) + np.abs(b.L).sum(axis=1) + a.bent + b.bent
        low, high = both.bounds
        return Interval(low - size * wide, high + size * wide)

    change = iv.arctan2(turned(sine, cosine, cosines, -sines), turned(cosine, sine, cosines, sines))
    return iv.add(iv.point(middle), Interval(change.low - wide, change.high + wide))


def _times(p: Array, x: Array) -> Array:
    return (p if x.ndim == 2 else p[:, None]) * x


@dataclass(frozen=True, eq=False)
class _Steps(Value):
    """The three steps of the exact arm over cells of a box of poses, low <= u <= high (k, d).

    region: the box. limits: of the six joints, infinite for none.
    """

    branch: ClosedBranch
    region: PoseRegion
    limits: Interval

    @cached_property
    def free(self) -> Indices:
        """The parameters of the box that vary."""
        return np.flatnonzero(self.region.half > 0)

    @cached_property
    def single(self) -> Flags:
        """(6,) which joints have one turn at most within their limits."""
        low, high = self.limits
        return high - low < 2 * np.pi

    @cached_property
    def _ranges(self) -> tuple[Vector, Vector]:
        """Of the turns (6,) the middle of what limits allow, and half of its width; 0 for no limits."""
        low, high = (np.where(self.single, side, 0.0) for side in self.limits)
        multiplier, offset = self.branch.leaf.inverse.joints[:2]
        return offset + multiplier * (low + high) / 2, (high - low) / 2

    @cached_property
    def _given(self) -> tuple[tuple[SX, SX], SX, Vector, Vector]:
        """(shares; how far within limits, cosines and sines), the symbols, numbers of all but u, their errors."""
        arm, leaf, region = self.branch.leaf.inverse.arm, self.branch.leaf, self.region
        # Numbers that are 0, 1 or -1 are put in as such, so that products with them go.
        if not isinstance(leaf, Held):  # as `signed_branch` makes none
            raise ValueError("a joint follows the tool's pose")
        exact, off = _exact_chain(arm, leaf.values, leaf.chain)
        known = off == 0
        some = np.flatnonzero(~known)
        chain, rest = SX([float(x) for x in exact]), symbol("chain", len(some))
        for place, i in enumerate(some.tolist()):
            chain[i] = rest[place]
        # The pose, with a rotation that is one.
        d = len(region.half)
        u, p0, R0, half = symbol("u", len(self.free)), symbol("p0", 3), symbol("R0", 9), symbol("half", d)
        at, sides = SX(d, 1), SX(d, 1)
        for place, i in enumerate(self.free.tolist()):
            at[i], sides[i] = u[place], half[i]
        family = PoseBox(region.equation.family.turning)
        p, R = family.pose(at, vertcat(p0, R0, sides, SX.zeros(d), SX.ones(d)))
        signs = [SX(x) for x in SIGNS[self.branch.row].tolist()]
        turns, roots = steps(arm.form, chain, R, p, signs)
        shares, each = vertcat(*(root.share for root in roots)), [turn.cos for turn in turns]
        within = []
        for turn, middle, half_range in zip(turns, *self._ranges, strict=True):
            x, y, length = turn.scaled
            within.append(x * np.cos(middle) + y * np.sin(middle) - length * (np.cos(half_range) + 1e-15))
        outputs = shares, vertcat(*within, *each, *(turn.sin for turn in turns))
        numbers = np.concatenate([[float(exact[i]) for i in some], region.p0, region.R0.ravel(), region.half])
        skew = float(np.abs(region.R0.T @ region.R0 - np.eye(3)).max())
        errors = np.concatenate([off[some], np.zeros(3), np.full(9, 2 * skew + 1e-15), np.zeros(d)])
        return outputs, vertcat(u, rest, p0, R0, half), numbers, errors

    @cached_property
    def _functions(self) -> tuple[TaylorFunction, TaylorFunction]:
        (shares, turns), symbols, _, _ = self._given
        return TaylorFunction("shares", {"x": symbols}, shares), TaylorFunction("turns", {"x": symbols}, turns)

    def _over(self, function: TaylorFunction, low: Matrix, high: Matrix) -> Taylor:
        _, _, numbers, errors = self._given
        d, k = len(self.free), len(low)
        c, L, Q, r = (np.zeros((d + len(numbers), *s)) for s in ((k,), (d, k), (d * (d + 1) // 2, k), (k,)))
        c[:d], c[d:], r[d:] = ((low + high) / 2).T[self.free], numbers[:, None], errors[:, None]
        L[np.arange(d), np.arange(d)] = ((high - low) / 2).T[self.free]
        return function(Taylor(c, L, Q, r))

    def shares(self, low: Matrix, high: Matrix) -> Interval:
        """How real the roots of the three steps are (3, k): each holds where those before are above 0."""
        return self._over(self._functions[0], low, high).bounds

    def joints(self, low: Matrix, high: Matrix) -> tuple[Interval, Interval]:
        """Where the three roots are real: (above 0 where a joint is within its limits, below where beyond, (6, k), of
        those that have one turn there; the six joints (6, k), whole turns aside)."""
        every = self._over(self._functions[1], low, high)
        within, *turns = (Taylor(*(part[rows] for part in every)) for rows in (slice(6), slice(6, 12), slice(12, 18)))
        angles = _angles(*turns)
        multiplier, offset = (
            iv.point(np.broadcast_to(row[:, None], angles.low.shape)) for row in self.branch.leaf.inverse.joints[:2]
        )
        return within.bounds, iv.multiply(multiplier, iv.subtract(angles, offset))


# --- The search: cells of one size after the other, halved where something is not decided.

PORTION = 512
"""Cells that are enclosed at once: 100 MB."""

MANY = 10
"""Cells of poses alone for one of joints, which takes as long: by this a budget allows more of them."""

REST = 0.005
"""Share of the box that may be left undecided where a part of it is refuted."""

LEVER = 0.35
"""Motion [m] that counts as much as a turn by 1 rad: cells are halved where they are widest by this."""

NO_POSTURE = -1
"""Why a cell is refuted, where it is no joint."""


@dataclass(eq=False)
class _Search:
    """What is known of a box: proven cells (low, high (k, d), least and largest joints (k, 6)); of refuted cells the
    middle, and which of the six joints is beyond its limits; what is left undecided."""

    steps: _Steps
    bounded: bool
    budget: int
    progress: Callable[[int, int, float], None]
    proven: list[tuple[Matrix, Matrix, Matrix, Matrix]] = field(default_factory=list)
    refuted: list[tuple[Vector, int]] = field(default_factory=list)
    undecided: Matrix | None = None
    spent: int = 0
    share: float = 0.0

    def run(self) -> None:
        """Decide cells, until all are, or the budget is spent."""
        half = self.steps.region.half
        d, weights = len(half), half * np.where(np.arange(len(half)) < 3, 1.0, LEVER)
        low, high, real = -np.ones((1, d)), np.ones((1, d)), np.zeros(1, dtype=bool)
        while len(low):
            failed = []
            for first in range(0, len(low), PORTION):
                left = np.concatenate([*failed, np.arange(first, len(low))]).astype(int)
                if self.spent >= self.budget or self._enough(low[left], high[left]):
                    self.undecided = (low[left] + high[left]) / 2
                    return
                part = slice(first, first + PORTION)
                failed.append(first + np.flatnonzero(self._decide(low[part], high[part], real[part])))
                self.spent += len(low[part])
                self.progress(sum(len(cells[0]) for cells in self.proven), self.spent, self.share)
            # Halves across the widest side.
            rows = np.concatenate(failed)
            low, high, real = low[rows], high[rows], np.tile(real[rows], 2)
            place = np.arange(len(rows)), np.argmax((high - low) * weights, axis=1)
            upper, lower = low.copy(), high.copy()
            upper[place] = lower[place] = (low[place] + high[place]) / 2
            low, high = np.concatenate([low, upper]), np.concatenate([lower, high])
            inside = self._meets(low, high)
            low, high, real = low[inside], high[inside], real[inside]

    def _enough(self, low: Matrix, high: Matrix) -> bool:
        """Whether a part is refuted, and little else is left, in cells."""
        return bool(self.refuted) and float(self.steps.region.shares(low, high).sum()) < REST

    def _meets(self, low: Matrix, high: Matrix) -> Flags:
        """(k,) which cells hold poses of the workspace: its leans are a disc in the box of parameters."""
        half = self.steps.region.half
        if len(half) == 3 or not half[3]:
            return np.ones(len(low), dtype=bool)
        near = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(np.abs(low), np.abs(high)))[:, 3:5]
        spin = np.maximum(np.abs(low), np.abs(high))[:, 5] * half[5] / 2
        edge = (half[3] / 2) ** 2 / (1 + (half[5] / 2) ** 2)
        return ((near * half[3:5] / 2) ** 2).sum(axis=1) <= edge * (1 + spin**2) * (1 + 1e-9)

    def _decide(self, low: Matrix, high: Matrix, real: Flags) -> Flags:
        """(k,) which cells are to be halved. real: which are known to have the three roots; more become so."""
        # Which have the three roots, and which surely lack one.
        middles, none, new = (low + high) / 2, np.zeros(len(low), dtype=bool), np.flatnonzero(~real)
        if len(new):
            sound, lacking = np.ones(len(new), dtype=bool), np.zeros(len(new), dtype=bool)
            for least, largest in zip(*self.steps.shares(low[new], high[new]), strict=True):
                lacking |= sound & (largest < 0)
                sound &= least > 0
            real[new], none[new] = sound, lacking
        self.refuted += [(u, NO_POSTURE) for u in middles[none]]
        rows, failed = np.flatnonzero(real), ~(real | none)
        if not self.bounded or not len(rows):
            unknown = np.full((len(rows), 6), np.inf)
            self._keep(low[rows], high[rows], -unknown, unknown)
            return failed
        # In which of these the joints stay within their limits, and in which one does not.
        within, angles = self.steps.joints(low[rows], high[rows])
        single = self.steps.single[:, None]
        good = np.where(single, within.low > 0, angles.high - angles.low < np.pi)
        beyond = np.logical_and(single, within.high < 0)
        kept, lost = np.asarray(good).all(axis=0), np.asarray(beyond).any(axis=0)
        self.refuted += list(zip(middles[rows[lost]], beyond[:, lost].argmax(axis=0).tolist(), strict=True))
        joints = self._placed(Interval(angles.low[:, kept], angles.high[:, kept]))
        self._keep(low[rows[kept]], high[rows[kept]], joints.low.T, joints.high.T)
        failed[rows[~(kept | lost)]] = True
        return failed

    def _placed(self, angles: Interval) -> Interval:
        """Angles (6, k) at the turn within limits, and no wider than these, of joints that have one turn there."""
        single = self.steps.single[:, None]
        lower, upper = (np.where(single, side[:, None], 0.0) for side in self.steps.limits)
        middle = (angles.low + angles.high) / 2
        turns = np.where(single & np.isfinite(middle), np.rint(((lower + upper) / 2 - middle) / (2 * np.pi)), 0.0)
        placed = _turned(angles, np.nan_to_num(turns))
        alone = (placed.low > upper - 6.28) & (placed.high < lower + 6.28)  # no other turn of them is within limits
        low = np.where(single, np.where(alone, np.maximum(placed.low, lower), lower), placed.low)
        return Interval(low, np.where(single, np.where(alone, np.minimum(placed.high, upper), upper), placed.high))

    def _keep(self, low: Matrix, high: Matrix, least: Matrix, largest: Matrix) -> None:
        self.proven.append((low, high, least, largest))
        self.share += float(self.steps.region.shares(low, high).sum())


def _turned(angles: Interval, turns: Array) -> Interval:
    """Angles and whole turns."""
    turn = Interval(np.array(2 * iv.PI[0]), np.array(2 * iv.PI[1]))
    shift = iv.multiply(iv.point(np.asarray(turns, dtype=float)), turn)
    return Interval(*(np.where(turns == 0, x, y) for x, y in zip(angles, iv.add(angles, shift), strict=True)))


# --- What hangs together, and at which turn joints are that have more than one.


def _joined(low: Matrix, high: Matrix, start: Vector) -> Flags:
    """(k,) the cells that hang together with that at `start`, or, where none is there, the most that do."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    k, pairs = len(low), [(i, j) for _, _, i, j in faces(low, high)]
    i, j = (np.concatenate(side) for side in zip(*pairs, strict=True))
    part = connected_components(coo_matrix((np.ones(len(i)), (i, j)), (k, k)), directed=False)[1]
    here = np.flatnonzero(((low <= start) & (start <= high)).all(axis=1))
    return part == (part[here[0]] if len(here) else np.argmax(np.bincount(part)))


def _lifted(low: Matrix, high: Matrix, angles: Interval, q: Vector, start: Vector) -> Array:
    """The whole turns (k, .) by which angles (k, .) of cells that hang together go on from those q (.,) at `start`.

    A neighbour's are those that have most in common: ranges are narrower than half a turn, so there is one choice.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order

    k, pairs = len(low), [(i, j) for _, _, i, j in faces(low, high)]
    i, j = (np.concatenate(side) for side in zip(*pairs, strict=True))
    graph = coo_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), (k, k)).tocsr()
    middle = (angles.low + angles.high) / 2
    first = int(np.argmin(np.abs((low + high) / 2 - start).max(axis=1)))
    turns = np.zeros_like(middle)
    turns[first] = np.rint((q - middle[first]) / (2 * np.pi))
    order, before = breadth_first_order(graph, first, directed=False)
    for cell in order[1:].tolist():
        at = before[cell]
        turns[cell] = np.rint((middle[at] - middle[cell]) / (2 * np.pi) + turns[at])
    return turns


@dataclass(frozen=True, eq=False)
class SignedBox(NoTruthValue, Value, ask="`.whole`"):
    """The theorem that over a box of tool poses, or cells of it, one posture has the signs of the start's.

    The cells are low <= u <= high (k, d) of the parameters of `region`; least, largest (k, 6) bound the six joints over
    them, where limits were asked for. `extent` says how far the proof came, and why no farther: `place` (d,) is where,
    and `joint` the one that is at its limit there. `spent` cells were examined.
    """

    strategy: HolonomicStrategy
    q0: Vector
    asked: PoseRange
    branch: ClosedBranch
    region: PoseRegion
    low: Matrix
    high: Matrix
    least: Matrix
    largest: Matrix
    extent: Extent
    place: Vector | None
    joint: str
    limits: Interval | None
    spent: int
    seconds: float

    def __len__(self) -> int:
        return len(self.low)

    def __repr__(self) -> str:
        return f"SignedBox({self.title!r}, {self.extent.name}, {len(self)} cells)"

    def __str__(self) -> str:
        return f"{self.theorem}\n{self.model}\n{self.unsaid}"

    @property
    def title(self) -> str:
        """The names of the strategy and the task."""
        return f"{self.strategy.name}, {self.strategy.task.name}"

    @property
    def whole(self) -> bool:
        """True where all that was asked is proven."""
        return self.extent is Extent.WHOLE

    @cached_property
    def share(self) -> float:
        """The proven share of the box, 0 to 1: of positions by volume, of turns by the Haar measure."""
        return 1.0 if self.whole else min(1.0, float(self.region.shares(self.low, self.high).sum()))

    def sampled(self, count: int = 2000) -> float:
        """The share of some poses of the box at which a posture has the signs of the start's, and is as asked."""
        poses = self.asked.poses(count)
        status = self.branch.postures(poses[:, :3, 3], poses[:, :3, :3])[1]
        return float((status == InverseStatus.REACHED).mean())

    @property
    def signs(self) -> Vector:
        """Those (3,) of the slopes of the three steps."""
        return SIGNS[self.branch.row]

    @property
    def low_joints(self) -> Vector:
        """The least value (n,) of each joint over the cells [joint unit]; -inf where limits were not asked for."""
        return self._hull(self.least, np.min, -np.inf)

    @property
    def high_joints(self) -> Vector:
        """The largest."""
        return self._hull(self.largest, np.max, np.inf)

    def _hull(self, joints: Matrix, end: Callable[..., Vector], none: float) -> Vector:
        q = self.q0.copy()
        if len(self):
            q[self.branch.leaf.inverse.others] = end(joints, axis=0) if self.limits is not None else none
        return q

    @property
    def to_limit(self) -> Vector:
        """The least distance (n,) of each joint from its limits [joint unit]."""
        robot = self.strategy.task.robot
        return np.minimum(self.low_joints - robot.lower, robot.upper - self.high_joints)

    @property
    def holds_start(self) -> bool:
        """Whether the tool's pose at the start is in one of the cells."""
        u = self.region.u0
        return bool(((self.low <= u) & (u <= self.high)).all(axis=1).any())

    @property
    def stop(self) -> Vector | None:
        """The position (3,) at which the proof ended; None where it did not."""
        return None if self.place is None else self.region.p0 + self.place[:3] * self.region.half[:3]

    @property
    def where(self) -> str:
        """The pose there."""
        return "" if self.stop is None else f"the pose at {np.round(self.stop, 6).tolist()}"

    @property
    def cause(self) -> str:
        """Why not all is proven."""
        if self.extent is Extent.END:
            return "no posture has the three signs of the start's (as elbow up or down)"
        return f"{self.joint} is at its limit or beyond it" if self.extent is Extent.LIMIT else self.extent.cause

    @cached_property
    def theorem(self) -> str:
        """What is proven, in a few sentences.

        Every pose of the cells has exactly one posture whose three steps have the signs of the start's: a smooth
        function of the pose, on which [J; J_g] is regular.
        """
        if not len(self):
            return f"Nothing is proven: {self.cause}, at {self.where or START}."
        arm = self.branch.leaf.inverse.arm
        held = " and ".join(arm.robot.joint_names[k] for k in arm.held)
        part = (
            f"Everywhere in {self.asked}" if self.whole else f"In one part, {share_text(self.share)} of {self.asked},"
        )
        sentences = [
            f"{part} the tool's pose alone decides the joints: every loop of the tool there returns them, but for "
            "whole turns.",
            f"{f'With {held} held, the' if held else 'The'} robot has at each pose exactly one posture with the "
            f"three signs of the start's (as elbow up or down), and none of them is singular ({len(self):,} cells).",
        ]
        if self.holds_start:
            sentences.append("The start is one of these postures.")
        if self.limits is not None and np.isfinite(self.to_limit).any():
            room = float(self.to_limit.min())
            far = f"{at_least(room, 2)} or more (rad or m) from" if room >= 1e-3 else "within"
            sentences.append(f"Every joint stays {far} its limits.")
        if self.whole:
            return " ".join(sentences)
        return f"Not all is proven: at {self.where}, {self.cause}. {PART} {' '.join(sentences)}"

    @property
    def model(self) -> str:
        """What the theorem is about, and how far it is from the robot's own numbers."""
        return WholeArm(self.strategy, self.branch.leaf.inverse.arm, 0.0).model

    unsaid = (
        "No independent checker has verified it. With keep_in=FILE the proof is by cells of joints, whose certificate "
        "one can verify."
    )
    """What the theorem leaves open."""

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, ready for JSON."""
        keys = ("title", "theorem", "model", "unsaid", "whole", "share", "where", "joint", "spent", "seconds")
        return {key: getattr(self, key) for key in keys} | {
            "extent": self.extent.name,
            "cells": len(self),
            "signs": self.signs.tolist(),
        }

    # What a region of poses asks of its certificate.

    @property
    def demands(self) -> Demands:
        """The limits."""
        return Demands(self.limits)

    @cached_property
    def boxes(self) -> Boxes:
        """Those of the cells."""
        k, none = len(self), np.zeros(len(self))
        unknown = np.full((k, self.strategy.task.n), np.nan)
        return Boxes(none.astype(int), self.low, self.high, none, none.astype(bool), unknown)

    def _near(self, cell: Indices, u: Matrix) -> tuple[Matrix, Vector]:
        """(postures (k, n) at parameters u (k, d) in some cells (k,), how far about them there are none but these)."""
        q, turn = self._at(u), 2 * np.pi * self.strategy.task.robot.hinges
        if not (self.limits is not None and self.branch.single):  # else the limits tell the turns
            q = q + turn * np.rint((self._middles[cell] - q) / (2 * np.pi))
        return q, np.full(len(q), ALONE)

    def _at(self, u: Matrix) -> Matrix:
        poses = self.region.poses_at(u)
        return self.branch.postures(poses[:, :3, 3], poses[:, :3, :3])[0]

    @cached_property
    def _middles(self) -> Matrix:
        """Postures (k, n) in the middles of the cells, whole turns as they go on from the start."""
        q = self._at((self.low + self.high) / 2)
        hinges = self.strategy.task.robot.hinges
        turns = _lifted(self.low, self.high, Interval(q, q), self.q0, self.region.u0)
        return q + 2 * np.pi * hinges * turns


ALONE = 1e-5
"""Joints [rad] that differ less are the posture that has the signs: another one has other signs of the slopes."""


def signed_branch(strategy: HolonomicStrategy, q0: Vector, limits: bool) -> ClosedBranch | None:
    """The postures with the start's signs, where the held joints leave a closed inverse and the start is regular.

    Not where they follow the tool's pose, or after a step of degree four.
    """
    leaf = closed_leaf(strategy, leaf_value(strategy, q0), limits)
    return ClosedBranch.of(leaf, q0) if isinstance(leaf, Held) else None


def signed_box(
    strategy: HolonomicStrategy, space: PoseRange, q0: Vector, branch: ClosedBranch, limits: Interval | None,
    budget: int, progress: Callable[[str], None],
) -> SignedBox:  # fmt: skip
    """What can be proven of a box by the signs. Raises: ArgumentError: no box."""
    began, others, robot = time.perf_counter(), branch.leaf.inverse.others, strategy.task.robot
    region = PoseRegion.over(strategy, space, q0, partial=True)
    at = region.place_of(q0)
    region = replace(region, u0=np.clip(np.nan_to_num(at, posinf=1.0, neginf=-1.0), -1, 1))

    def report(count: int, spent: int, share: float) -> None:
        progress(f"{share:.0%} proven by {count:,} cells, {spent:,} of at most {MANY * budget:,} examined")

    infinite = np.full(6, np.inf)
    six = Interval(-infinite, infinite) if limits is None else Interval(limits.low[others], limits.high[others])
    search = _Search(_Steps(branch, region, six), limits is not None, MANY * budget, report)
    search.run()
    low, high, least, largest = (np.concatenate(parts) for parts in zip(*search.proven, strict=True))
    refuted = search.refuted
    # Those that hang together, with joints of more than one turn within their limits at the turn that goes on.
    alone = limits is None or search.steps.single.all()
    while len(low) and not (alone and not refuted and search.undecided is None):
        kept = _joined(low, high, region.u0)
        low, high, least, largest = (part[kept] for part in (low, high, least, largest))
        if alone:
            break
        wide = ~search.steps.single
        angles = Interval(least[:, wide], largest[:, wide])
        turned = _turned(angles, _lifted(low, high, angles, q0[others][wide], region.u0))
        least[:, wide], largest[:, wide] = turned
        beyond = (least < six.low) | (largest > six.high)
        beyond[_torn(low, high, turned), np.flatnonzero(wide)[0]] = True
        lost = beyond.any(axis=1)
        if not lost.any():
            break
        middles = (low + high)[lost] / 2
        refuted += list(zip(middles, beyond[lost].argmax(axis=1).tolist(), strict=True))
        low, high, least, largest = (part[~lost] for part in (low, high, least, largest))
    # Why no more: the nearest place that is refuted, or the budget.
    extent, place, joint = Extent.WHOLE, None, ""
    if refuted:
        place, which = min(refuted, key=lambda found: float(np.linalg.norm(found[0] - region.u0)))
        extent, joint = (Extent.END, "") if which < 0 else (Extent.LIMIT, robot.joint_names[others[which]])
    elif search.undecided is not None:
        extent, left = Extent.BUDGET, search.undecided
        place = left[int(np.argmin(np.linalg.norm(left - region.u0, axis=1)))]
    return SignedBox(
        strategy, q0, space, branch, region, low, high, least, largest, extent, place, joint, limits, search.spent,
        time.perf_counter() - began,
    )  # fmt: skip


def _torn(low: Matrix, high: Matrix, angles: Interval) -> Indices:
    """Cells next to which, round a hole, angles (k, .) go on at another turn."""
    middle = (angles.low + angles.high) / 2
    torn = [i[(np.abs(middle[i] - middle[j]) > np.pi).any(axis=1)] for _, _, i, j in faces(low, high)]
    return np.concatenate(torn)
