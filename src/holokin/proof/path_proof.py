"""The proof along a path: cells of its pieces one after the other, glued at their ends.

The root at the end of a cell must lie where the next cell's is the only root; so the roots make one smooth curve of
joints. Where a path's pieces meet, and where a closed path ends, its poses agree but for round-off, which is enclosed
and may be `SEAM` at most: there the joints jump by as little as `anchors` tells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arguments import typed
from ..base.types import Array, Flags, Indices, Matrix, Value, Vector, joined, kept
from ..motion.ik.plan import Plan, make_plan, turned
from ..path.editing import AnyPath
from ..path.path import rotation_vector
from ..strategies import HolonomicStrategy
from ..strategies.tasks.frame_task import completing, leaves_free
from ..symbolic import jacobian, symbol
from ..symbolic.interval_function import IntervalFunction
from ..symbolic.intervals import Interval
from .cell_search import AIM, TUBE, Domain, on_grid
from .certificate import Boxes, Certificate, Covered, Extent
from .equation import Equation, PoseBox, Stretch, Stretches
from .tube import UP, Cells, examined, norm

SEAM = 1e-12
"""What E may change by [m, 1] where pieces of a path meet: a path of some metres in doubles is off by 1e-15."""

FINE = 256
"""Parts of a piece in which it is looked how far the joints go."""

SPUN = 0.05
"""Free turn [rad] of a cell at first: its equation turns with it, though no joint may move."""

MOST = 4096
"""Cells of a piece at first, at most: near a singular posture omega asks for millions."""


@kept
def _equation_along(strategy: HolonomicStrategy, *kinds: tuple[bool, bool]) -> Equation:
    """The equation of a strategy along paths, one of each frame, (turning, curved): made once."""
    return Equation(strategy, Stretches(any(turning for turning, _ in kinds), tuple(Stretch(*kind) for kind in kinds)))


@dataclass(frozen=True, eq=False)
class Pathway(Value, Domain):
    """Joints near the leaf c (r,) as a function of a path: splines through a trajectory, one a piece.

    `begun` (pieces, .) are those of the family but for u0 and h; `ends` the share of each piece up to which it
    was followed; `spins` (pieces, 256) their free turns [rad], which move no joint, in parts.
    """

    equation: Equation
    c: Vector
    splines: tuple[Callable[[Array], Matrix], ...]
    begun: Matrix
    ends: Vector
    spins: Matrix
    slack: float = SEAM

    @staticmethod
    def of(strategy: HolonomicStrategy, path: AnyPath, postures: Matrix, samples: int) -> Pathway:
        """From postures (k, joints) at the samples, which may end early."""
        from scipy.interpolate import make_interp_spline

        start, task = postures[0], strategy.task
        plan = make_plan(task, path, samples, task._place(start)[1])
        rows = path.table(plan.start_rotation).reshape(task.frames, len(path.durations), -1)
        splines, ends, first = [], [], 0
        for count in path.counts(samples).tolist():
            got = min(count, len(postures) - 1 - first)
            if got < 1:
                break
            splines.append(
                make_interp_spline(np.arange(got + 1) / count, postures[first : first + got + 1], min(3, got))
            )
            ends.append(float(on_grid(got / count)))
            first += count
        family = Stretches.along(rows)
        equation = _equation_along(strategy, *((m.turning, m.curved) for m in family.members))
        numbers = np.array([family.of(rows[:, i]) for i in range(len(splines))]).reshape(len(splines), -1)
        c = equation.level(start)
        return Pathway(equation, c, tuple(splines), numbers, np.array(ends), _free_turns(plan, np.array(ends)))

    def first(self) -> Boxes:
        """Cells in which e is about `AIM`, from omega at sampled postures."""
        piece = np.repeat(np.arange(len(self.splines)), 9)
        u = np.tile(np.linspace(0, 1, 9), len(self.splines)) * np.repeat(self.ends, 9)
        q, n = self._at(piece, u), self.equation.n
        still = np.zeros((len(q), n, 1))
        numbers = np.hstack([self.given(piece), u[:, None], np.zeros((len(u), 1))])
        found = examined(self.equation, Cells(q, still, still, numbers, np.full(len(q), 1e-9)), self.c)
        omega = np.minimum(found.omega, 1e6)
        parts = []
        for i, end in enumerate(self.ends.tolist()):
            fine = np.linspace(0, end, FINE + 1)
            way = np.linalg.norm(np.diff(self._at(np.full(len(fine), i), fine), axis=0), axis=1)
            bend = np.interp(fine, u[piece == i], omega[piece == i])
            change = np.maximum(way * (bend[1:] + bend[:-1]) / 2, 2 * AIM / SPUN * self.spins[i])
            total = np.concatenate([[0.0], np.cumsum(change)])
            count = int(np.clip(np.ceil(total[-1] / (2 * AIM)), 1, MOST))
            edges = np.unique(on_grid(np.interp(np.linspace(0, total[-1], count + 1), total, fine)))
            count = len(edges) - 1
            rho = TUBE / np.interp((edges[1:] + edges[:-1]) / 2, fine, bend)
            low, high, unknown = edges[:-1, None], edges[1:, None], np.full((count, n), np.nan)
            parts.append(Boxes(np.full(count, i), low, high, rho, np.zeros(count, dtype=bool), unknown))
        return joined(*parts)

    def given(self, piece: Indices) -> Matrix:
        """Of the family `Stretches`."""
        return self.begun[piece]

    def joints(self, boxes: Boxes) -> Matrix:
        """By the splines, and the other unknowns there."""
        return self._at(boxes.piece, (boxes.low + boxes.high)[:, 0] / 2)

    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """Those behind the first place where the proof failed."""
        piece, (low, *_) = min(stopped)
        return (boxes.piece > piece) | ((boxes.piece == piece) & (boxes.low[:, 0] >= low))

    def goes_on(self, extent: Extent) -> bool:
        """Whatever ended the others, but the budget."""
        return extent is not Extent.BUDGET

    def arranged(self, found: Covered) -> Covered:
        """In the order of the path, up to where the proof failed."""
        b = found.boxes
        order = np.lexsort((b.low[:, 0], b.piece))
        if found.stopped is not None:
            piece, (low, *_) = found.stopped
            order = order[((b.piece < piece) | ((b.piece == piece) & (b.low[:, 0] < low)))[order]]
        return found.only(order)

    def unglued(self, found: Covered) -> Flags:
        """Those whose root at the end is not shown to be the next one's only root at its beginning, and the next."""
        k = len(found)
        out = np.zeros(k, dtype=bool)
        if k > 1:
            first, second = np.arange(k - 1), np.arange(1, k)
            apart = distances(found, first, second, np.zeros(self.equation.n))
            out[:-1] = ~(apart <= found.findings.alone[1:] / UP)
            for i in np.flatnonzero(np.diff(found.boxes.piece)):
                out[i] |= not self.jump(found, int(i), int(i) + 1) <= self.slack
            out[1:] |= out[:-1]
        return out

    def connected(self, found: Covered) -> Covered:
        """Up to the first place where the next cell is not glued."""
        apart = self.unglued(found)
        if not apart.any():
            return found
        k = int(np.argmax(apart)) + 1
        kept = found.only(slice(0, k))
        stopped = int(found.boxes.piece[k]), tuple(found.boxes.low[k].tolist())
        return Covered(kept.boxes, kept.cells, kept.findings, Extent.APART, stopped)

    def jump(self, found: Covered, one: int, other: int) -> float:
        """A bound of what E changes from the end of one cell to the beginning of another."""
        at = np.concatenate([found.cells.numbers[one], found.cells.numbers[other]])[:, None]
        return float(norm(Interval(*(x[None] for x in self.equation.seam(at, at))))[0])

    def place(self, found: Covered) -> str:
        """Piece and share."""
        if found.stopped is None:
            return ""
        piece, (low, *_) = found.stopped
        return f"{100 * low:.4g} % of piece {piece + 1} of the path"

    def _at(self, piece: Indices, u: Vector) -> Matrix:
        n = self.equation.joints
        q = np.array([self.splines[i](x) for i, x in zip(piece, u, strict=True)]).reshape(len(piece), n)
        return self.equation.completed(q)


def _free_turns(plan: Plan, ends: Vector) -> Matrix:
    """How far the frames turn freely in the parts of each piece up to its end (pieces, `FINE`) [rad]."""
    spins, task = np.zeros((len(ends), FINE)), plan.task
    turning = sorted({row // 6 for row, angular in zip(task.rows, task._angular, strict=True) if angular})
    if not leaves_free(task) or not turning:
        return spins
    for i, end in enumerate(ends.tolist()):
        at = plan.path.on(np.full(FINE + 1, i), np.linspace(0, end, FINE + 1))
        p, R = at.position, turned(at.rotation, plan.start_rotation)
        seen = completing(task).batch(p[:-1], R[:-1], p[1:], R[1:])[1].reshape(-1, 3, 3)
        free = rotation_vector(R[1:].reshape(-1, 3, 3) @ np.swapaxes(seen, 1, 2)).reshape(FINE, -1, 3)
        spins[i] = np.linalg.norm(free[:, turning], axis=(1, 2))
    return spins


def distances(found: Covered, ones: Indices, others: Indices, turns: Vector) -> Vector:
    """How far at most (k,) roots at the ends of some cells, less whole turns, are from others' predictors at y = -1."""
    cells, one = found.cells, np.ones((len(found), 1))
    gap = cells.predicted(one)[ones] - 2 * np.pi * turns - cells.predicted(-one)[others]
    slip = cells.slip[ones] + cells.slip[others] + 1e-14 * np.linalg.norm(turns)
    return (np.linalg.norm(gap, axis=1) + found.findings.r[ones] + slip) * UP


# --- `joint_rates`: how fast each joint is at most, over the speed of the tool, wherever the tool goes in what is
# proven.
#
# Along the predictor p(y) of a cell E(p(y), y) changes by F', and at the roots q(y) the derivative is q' = p' - A^-1
# (F' + ...), so that |q' - p'| is at most (|Y F'| + (|Y D_q D_y E| + omega |p'|) r) / (1 - e - omega r). The sizes of
# q' by y are `Findings.slopes`; here they are taken over the tool's motion per y.


@dataclass(frozen=True, eq=False)
class JointRates(Value):
    """Upper bounds of joint speeds, in joint units a second: `per_speed` (n,) where the tool moves by 1 m/s, `per_turn`
    (n,) where it turns by 1 rad/s. Joint i is no faster than per_speed[i] |v| + per_turn[i] |w|.

    Of a path the two stand for each other: the tool turns as the path says, and `per_turn` is 0. Of several tools
    |v| is the speed of the fastest.
    """

    per_speed: Vector
    per_turn: Vector
    limits: Vector
    """The speed limits (n,) of the joints."""

    @property
    def tool_speed(self) -> float:
        """The speed of the tool [m/s] at which no joint is faster than its limit, where it does not turn besides.

        NaN where a joint has no limit.
        """
        if not np.isfinite(self.limits).all():
            return np.nan
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(self.limits / self.per_speed, nan=np.inf, posinf=np.inf).min(initial=np.inf))


@typed
def joint_rates(certificate: Certificate) -> JointRates:
    """How fast each joint is at most over what a certificate proves, for any motion of the tool in it.

    Infinite for a path on which the tool stands still while it turns.
    """
    found, equation = certificate.findings, certificate.equation
    limits, n = equation.strategy.task.robot.max_velocity, equation.joints
    if not len(certificate):
        return JointRates(np.zeros(n), np.zeros(n), limits)
    if not isinstance(equation.family, PoseBox):
        steps = _steps(certificate)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(found.slopes[:, :, 0] > 0, found.slopes[:, :, 0] / steps[:, None], 0.0)
        return JointRates(rates.max(axis=0) * UP, np.zeros(n), limits)
    boxes, d = certificate.proven.boxes, equation.d
    sides = certificate.pieces[0, 12 : 12 + d]
    h = (boxes.high - boxes.low) / 2 * sides
    each = found.slopes / np.where(h > 0, h, np.inf)[:, None, :]
    bend = 1 + float(np.sum(np.square(sides[3:]))) / 4  # |dw| <= (1 + |w|^2 / 4) |turn| of the Cayley parameters
    return JointRates(_largest(each[:, :, :3]), _largest(each[:, :, 3:]) * bend * UP, limits)


def _largest(columns: Matrix) -> Vector:
    return np.linalg.norm(columns, axis=2).max(axis=0, initial=0.0) * UP


def _steps(certificate: Certificate) -> Vector:
    """(k,) what the tool, of several the fastest, moves by, at least, per y over each cell of a path [m]."""
    family, numbers = certificate.equation.family, certificate.cells.numbers
    y, given = symbol("y", 1), symbol("numbers", family.numbers)
    moved = IntervalFunction("the tool's motion", {"y": y, "numbers": given}, jacobian(family.pose(y, given)[0], y))
    ones = np.ones((1, len(numbers)))
    found = moved(np.vstack([-ones, numbers.T]), np.vstack([ones, numbers.T]))
    least = np.maximum(np.maximum(found.low, -found.high), 0.0)
    return np.linalg.norm(least.reshape(-1, 3, len(numbers)), axis=1).max(axis=0) / UP
