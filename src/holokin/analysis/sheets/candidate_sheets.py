"""The sheets that a cover is chosen from: rules fitted to the ranges of levels that poses allow, and leaves through
postures all over the workspace."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Array, Flags, Indices, Matrix, Vector
from ...motion.checks import Clear
from ...strategies import holonomic
from ...strategies.constraints import tilted
from ...strategies.right_inverses import monomials_up_to
from ...strategies.tasks.task import Task
from ..coverage.pose_coordinates import Coordinates, Polynomial, chart_of, coordinates_of, values_and_slopes
from ..coverage.starts import FREE, Candidate, postures_at
from .branch import CONSTANTS, Branch
from .level_fit import Ranges, fitted, polynomial, served_weight
from .set_cover import ROUND
from .sheet import Sheet, known, nearby, neighbours, turn_length
from .sheet_growth import STARTS, grown, lines_served, one_function, side_by_side

BEST = 2
"""Leaves of a strategy through postures at one pose that become candidates, those that serve most."""

SMOOTH = 1e-4
"""What the square of a coefficient costs against a pose that is missed: other poses are served the better for it."""

OTHERS = 0.2
"""Weight of all poses that other sheets of a choice serve, beside that of those which they do not."""

USEFUL = 8
"""Sheets that are compared for each place of a choice in the end."""

POSES_A_TERM = 2
"""Poses for each coefficient of a polynomial at least: fewer would be served by chance."""

FITTED = 1600
"""Poses to which a polynomial is fitted at most: those that are left, and others."""

CLOSEST = 4
"""Neighbours from which a leaf tries to reach a pose; a sheet that is chosen tries all."""

COMPARED = 200
"""Postures by which the joint speeds of a sheet are judged."""

SPARE = 1.0
"""Standard errors of a sampled share by which it is to exceed what is wanted, where no more sheets are needed for it:
else of other poses about every second choice serves less."""

MARGIN = 0.1
"""Share of a joint's range next to a limit that counts as near it."""

DEGREES = (1, 2, 3)
"""Of the polynomials that are tried."""

DIGITS = 7
"""Of the coefficients of a polynomial: numbers that a job can be read with."""


@dataclass(eq=False)
class CandidateSheet:
    """A sheet that a cover may have.

    served: which of the searched poses (k,) it serves, by lines side by side, which may be wrong at a few poses, until
    it was asked. cost: see `CandidateSheets.cost_of`. make: its leaf, which is built only for a sheet that is chosen.
    other: whether it is another posture of a leaf, which brings no more of them.
    """

    served: Flags
    cost: float
    make: Callable[[], Sheet]
    asked: bool = False
    other: bool = False

    @cached_property
    def sheet(self) -> Sheet:
        """The leaf; with stations once it was asked."""
        return self.make()


@dataclass(eq=False)
class CandidateSheets:
    """Sheets, with the poses that each serves; they grow while a cover is looked for.

    T: the poses (k, 4, 4) that are searched. q: a posture at each (k, n). of: their places among those in reach (k,).
    weights: how many of these each stands for (k,). candidates: strategies whose leaves are tried. branches: to whose
    ranges of levels rules are fitted. share: of the poses, that is wanted. own: whether the level of a strategy may
    follow the pose. tried: leaves so far.
    """

    task: Task
    T: Array
    q: Matrix
    of: Indices
    weights: Vector
    candidates: list[Candidate]
    branches: list[Branch]
    clear: Clear | None
    rcond: float
    share: float
    own: bool
    found: list[CandidateSheet] = field(default_factory=list)
    tried: int = 0

    @property
    def wanted(self) -> float:
        """Weight that is to be served."""
        return self.share * float(self.weights.sum()) - ROUND

    @property
    def preferred(self) -> float:
        """Weight that is preferred where no more sheets are needed for it."""
        count = float(self.weights.sum())
        return float(self.wanted + SPARE * np.sqrt(self.share * (1 - self.share) * count))

    def covered(self, chosen: list[int]) -> float:
        """Weight that some sheets serve."""
        return float(self.weights @ self.sets[chosen].any(axis=0))

    def improved(self, chosen: list[int]) -> list[int]:
        """A choice that serves more than some sheets, or with fewer what is wanted, by exchanges one at a time.

        While they serve too little there is one more of them.
        """
        sets = self.sets

        def exchanged(some: list[int]) -> list[int]:
            while True:
                before = self.covered(some)
                for place in range(len(some)):
                    others = [*some[:place], *some[place + 1 :]]
                    gains = (sets & ~sets[others].any(axis=0)) @ self.weights
                    some = [*others[:place], int(np.argmax(gains)), *others[place:]]
                if self.covered(some) <= before:
                    return some

        if self.covered(chosen) < self.wanted:
            left = ~sets[chosen].any(axis=0)
            chosen = [*chosen, int(np.argmax((sets & left) @ self.weights))]
        chosen = exchanged(chosen)
        for place in range(len(chosen) if len(chosen) > 1 else 0):
            fewer = exchanged([*chosen[:place], *chosen[place + 1 :]])
            if self.covered(fewer) >= self.wanted:
                return fewer
        return chosen

    @property
    def costs(self) -> Vector:
        """Of each sheet (c,), from 0 for the cheapest one to 1."""
        costs = np.array([sheet.cost for sheet in self.found])
        return np.asarray(1.0 - costs.min(initial=np.inf) / costs)

    @property
    def sets(self) -> Flags:
        """Which sheet serves which pose (c, k)."""
        return np.array([sheet.served for sheet in self.found], dtype=bool).reshape(-1, len(self.T))

    @cached_property
    def near(self) -> Indices:
        """Of each pose its neighbours (k, m)."""
        return nearby(self.T, turn_length(self.task))

    @cached_property
    def pairs(self) -> Indices:
        """Pairs (e, 2) of neighbours."""
        return neighbours(self.T, turn_length(self.task))

    @cached_property
    def coordinates(self) -> Coordinates | None:
        """Those of polynomials; None where the poses are all alike, or full orientations turn too far."""
        R = self.T[:, :3, :3]
        middle = int(np.argmax(np.einsum("aij,bij->ab", R, R).min(axis=1).round(9)))  # least turn to the farthest
        try:
            return coordinates_of(chart_of(self.task, R[middle]), self.q)
        except ArgumentError:
            return None

    @cached_property
    def degrees(self) -> list[int]:
        """Of the polynomials that may be tried and that the poses can tell; that of degree 0 is a constant level."""
        if (c := self.coordinates) is None or not self.own:
            return [0]
        return [0, *(d for d in DEGREES if POSES_A_TERM * len(monomials_up_to(c.d, d)) <= len(self.T))]

    def keep_useful(self, chosen: list[int]) -> None:
        """Leaves away all sheets but some of a choice, and those that could best take the place of one of them."""
        stay = set(chosen)
        for place in range(len(chosen)):
            others = [*chosen[:place], *chosen[place + 1 :]]
            gains = (self.sets & ~self.sets[others].any(axis=0)) @ self.weights
            stay.update(np.argsort(-gains, kind="stable")[:USEFUL].tolist())
        self.found = [self.found[i] for i in sorted(stay)]

    def monomials(self, degree: int) -> tuple[Matrix, Array]:
        """Of the poses: their values (k, t) and slopes (k, t, d) by the coordinates."""
        if (c := self.coordinates) is None or degree == 0:
            return np.ones((len(self.T), 1)), np.zeros((len(self.T), 1, 0))
        if degree not in self._monomials:
            self._monomials[degree] = values_and_slopes(c.at(self.q), monomials_up_to(c.d, degree))
        return self._monomials[degree]

    @cached_property
    def _monomials(self) -> dict[int, tuple[Matrix, Array]]:
        return {}

    # --- Rules fitted to ranges of levels.

    def fit(self, left: Flags, degree: int, most: int) -> None:
        """Adds sheets whose level is a polynomial of the pose, fitted to poses that are left (k,), and a little to
        others: of so many branches, those with most weight to gain. degree: at most, as the poses left can tell."""
        weights = self._weights(left)
        told = int((left & (weights > 0)).sum()) // POSES_A_TERM
        degree = max(d for d in self.degrees if d <= degree and (d == 0 or self.monomials(d)[0].shape[1] <= told))
        (f, slopes), gains = self.monomials(degree), np.array([(weights * left)[b.poses].sum() for b in self.branches])
        for i in np.argsort(-gains, kind="stable")[:most].tolist():
            if gains[i] > 0:
                self._fit(self.branches[i], weights, f, slopes, degree)

    def _weights(self, left: Flags) -> Vector:
        """Of the poses (k,) in a fit, 0 for most where there are many: of those that are left, and of others."""
        weights = np.zeros(len(self.T))
        first, others = np.flatnonzero(left)[:FITTED], np.flatnonzero(~left)
        others = others[: max(FITTED - len(first), FITTED // 4)]
        weights[first] = self.weights[first]
        each = OTHERS * weights.sum() / max(1.0, float(self.weights[others].sum()))
        weights[others] = min(each, 1.0) * self.weights[others]
        return weights

    def _fit(self, branch: Branch, weights: Vector, f: Matrix, slopes: Array, degree: int) -> None:
        x, some = np.zeros(f.shape[1]), weights[branch.ranges.pose] > 0
        pose, middle, half = branch.ranges
        ranges = Ranges(pose[some], middle[some], half[some])
        heaviest = np.argsort(-weights[ranges.pose], kind="stable")[:CONSTANTS]
        levels = np.concatenate([branch.constants, ranges.middle[heaviest]])
        hits = [served_weight(np.full(some.sum(), c), ranges, weights, branch.off) for c in levels]
        x[0] = levels[int(np.argmax(hits))]
        if degree and some.any():
            x = fitted(polynomial, x, f, ranges, weights, branch.off, small=SMOOTH)
        self.tried += 1
        x = np.array([float(f"{value:.{DIGITS}g}") for value in x])
        levels = f @ x
        q = branch.postures(np.arange(len(self.T)), levels)
        served = known(q)
        if self.rcond and served.any():
            served[served] = self._jacobians(branch, q[served], slopes[served], x)[1] >= self.rcond
        if served.any():
            some = np.flatnonzero(served)[:: max(1, int(served.sum()) // COMPARED)]
            G, _ = self._jacobians(branch, q[some], slopes[some], x)
            make = partial(self._make, branch, degree, x, q[served], self.T[served])
            self.found.append(CandidateSheet(served, self.cost_of(q[some], G), make))

    def _jacobians(self, branch: Branch, Q: Matrix, slopes: Array, x: Vector) -> tuple[Array, Vector]:
        """(G (k, n, m), rcond (k,) of [J; J_g]) of a branch's strategy whose level has coefficients x, at Q (k, n)."""
        J, Jg = self.task.jacobian_batch(Q)[0], branch.strategy.rows(Q)
        if (c := self.coordinates) is not None and slopes.shape[2]:
            Jx = np.einsum("dm,kmn->kdn", c.P.T / c.scale[:, None], c.chart.jacobian_batch(Q)[0])
            Jg = Jg - np.einsum("ktd,t,kdn->kn", slopes, x, Jx)[:, None]
        M = np.concatenate([J, Jg], axis=1)
        values = np.linalg.svd(M, compute_uv=False)
        return np.asarray(np.linalg.pinv(M)[:, :, : self.task.m], dtype=float), values[:, -1] / values[:, 0]

    def cost_of(self, Q: Matrix, G: Array) -> float:
        """Of postures (k, n): the root mean square of |G|, over what it is at the least, of the share of joints near a
        limit."""
        robot = self.task.robot
        span = robot.upper - robot.lower
        room = np.minimum(Q - robot.lower, robot.upper - Q)
        near = float(np.mean(room < MARGIN * np.where(np.isfinite(span), span, 0.0))) if len(Q) else 0.0
        return float(np.sqrt(np.mean(np.sum(G**2, axis=(1, 2))))) * (1 + near) if len(Q) else np.inf

    def _make(self, branch: Branch, degree: int, x: Vector, q: Matrix, poses: Array) -> Sheet:
        """The leaf of a rule, with stations q (h, n) at the poses (h, 4, 4) that it serves."""
        candidate, strategy, c = branch.candidate, branch.strategy, self.coordinates
        keys = {key: value for key, value in candidate.keys.items() if key != "level"}
        if degree and c is not None:
            zeta = Polynomial(c, x[None])
            name = f"{candidate.name}, following the tool's pose (degree {degree})"
            strategy = holonomic(self.task, tilted(strategy.constraint, zeta, chart=zeta.chart, name=name), name=name)
            keys = zeta.keys_over(candidate.keys)
        return Sheet(strategy, _roomiest(self.task, q), self.rcond, keys, q, poses)

    # --- Leaves through postures, where no ranges of levels are known.

    def grow(self, pose: Matrix, weights: Vector) -> None:
        """Adds leaves of all strategies through postures at a tool pose (4, 4): of each those that serve most."""
        starts = postures_at(self.task, pose, STARTS)
        if self.clear is not None and len(starts):
            starts = starts[self.clear(starts)]
        for candidate in self.candidates if len(starts) else ():
            flags, _ = lines_served(candidate, starts, self.T, self.clear, self.rcond)
            fresh = np.array([not (row <= self.sets).all(axis=1).any() for row in flags])
            gains = np.where(fresh, flags @ weights, 0.0)
            self.tried += len(starts)
            self.add(candidate, starts[[i for i in np.argsort(-gains, kind="stable")[:BEST] if gains[i] > 0]])

    def add(self, candidate: Candidate, starts: Matrix, other: bool = False) -> None:
        """The sheets of a strategy through postures (s, n)."""
        if candidate.strategy is None or not len(starts):
            return
        keys = {key: value for key, value in candidate.keys.items() if key != "level"}
        served, straight = lines_served(candidate, starts, self.T, self.clear, self.rcond)
        go = side_by_side(candidate.strategy, self.T, self.clear, self.rcond)
        for q0, flags, postures in zip(starts, served, straight, strict=True):
            if flags.any():
                q, _ = grown(np.where(flags[:, None], postures, np.nan), self.near[:, :CLOSEST], go)
                there = known(q)
                G = candidate.strategy.gain.batch(q[there])[0]
                make = partial(Sheet, candidate.strategy, q0, self.rcond, keys)
                self.found.append(CandidateSheet(there, self.cost_of(q[there], G), make, other=other))

    # --- What sheets serve, asked of themselves.

    def exact(self, which: Iterable[int]) -> bool:
        """Asks some sheets themselves which poses they serve, as one function; returns whether that changed anything.

        Where a leaf comes to one pose with two postures, the sheet of the other one becomes a candidate.
        """
        changed = False
        for entry in [self.found[i] for i in which]:
            if entry.asked:
                continue
            sheet, others = entry.sheet, np.zeros((0, self.task.n))
            q = sheet.postures(self.T, self.clear)[0]
            if not sheet.single:

                def go(begin: Matrix, poses: Indices, sheet: Sheet = sheet) -> tuple[Matrix, Flags]:
                    return sheet.reached(begin, self.T[poses], self.clear)

                q, wave = grown(q, self.near, go)
                q, others = one_function(q, wave, self.pairs, go)
            there = known(q)
            changed |= not np.array_equal(there, entry.served)
            entry.sheet, entry.served = replace(sheet, stations=q[there], places=self.T[there]), there
            entry.asked = True  # not before: Ctrl-C leaves it to be asked again
            if len(others) and not entry.other:
                self.add(Candidate(sheet.name, sheet.keys, self.task, sheet.strategy), others[[len(others) // 2]], True)
                changed = True
        return changed


def _roomiest(task: Task, Q: Matrix) -> Vector:
    """Of postures (k, n) the one that is farthest from the joint limits, as a share of their ranges."""
    robot = task.robot
    lower, upper = robot.ranges(FREE)
    return Q[np.argmax((np.minimum(Q - lower, upper - Q) / (upper - lower)).min(axis=1))]
