"""`radial`: a holonomic strategy near any given one, by transport along straight tool segments (theory 5.3).

From a centre x0 every tool pose x is reached along a straight segment; carrying a posture of the centre's
self-motion along it by the given strategy makes the joints a function of x. These postures are the leaves. The
radial strategy equals the given one along segments and at x0, and near x0 |G_rad - G| <= 1/2 |x - x0| sup |F|, to
first order in |x - x0|: on the PPR arm at 0.7 m it is 12 % more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from ..base.arguments import made, typed
from ..base.errors import ArgumentError, SingularityError, SingularityKind
from ..base.tolerances import TOLERANCES
from ..base.types import MOST, Array, ArrayLike, Flags, Indices, Matrix, Result, Value, Vector, finite, frozen, whole
from ..robot import Robot, start_posture
from ..symbolic import (
    SX,
    Transport,
    as_map,
    atan2,
    cos,
    exp,
    fabs,
    factorise,
    fmax,
    fmin,
    if_else,
    norm_2,
    sin,
    symbol,
    transport,
    vertcat,
    wrapped,
)
from ..symbolic.linear import null_space, null_space_expression, null_vector
from .constraints import Constraint
from .right_inverses import holonomic
from .strategy import HolonomicStrategy, Strategy
from .tasks.task import Task

# --- Self-motions, the postures that hold the tool where it is: walked in steps, at many tool poses side by side.
#
# dq/ds = v, where v is the last direction without its part that moves the tool, v - J^+ J v. With one redundant joint
# that is the self-motion itself, a curve; with several it is a line in it.

ROUGH = 1e-4
"""Last correction [joint units] of a good step, at most: the next one would be of the order of its square."""


class CurveEnd(StrEnum):
    """Why a self-motion is followed no farther."""

    CLOSED = "closed"
    LIMIT = "limit"
    SINGULAR = "singular"
    LENGTH = "length"


@dataclass(frozen=True, eq=False)
class SelfMotion(Result, Value):
    """Postures (k, n) with one tool pose, in order, s (k,) [joint units] their arc length from the given posture.

    `endings`: why it stops at its first and at its last posture; both CLOSED when it comes back to itself.
    """

    task: Task
    q: Matrix
    s: Vector
    endings: tuple[CurveEnd, CurveEnd]

    def __str__(self) -> str:
        ends = "closed" if self.closed else f"open, it ends at a {' and at a '.join(self.endings)}"
        return f"{ends}: {self.s[-1] - self.s[0]:.4g} joint units long, {len(self.q)} postures with one tool pose"

    @property
    def closed(self) -> bool:
        """True when the self-motion leads back to where it began."""
        return self.endings[0] is CurveEnd.CLOSED

    def at(self, s: float) -> Vector:
        """The posture (n,) at an arc length s [joint units] of it, with the tool exactly still.

        Raises: ArgumentError, ShapeError, NotFiniteError.
        """
        s = float(finite("s", s, ()))
        q = np.array([np.interp(s, self.s, joint) for joint in self.q.T])
        for _ in range(3):  # 1e-4 off at first, at round-off after three corrections
            q = q + correction(self.task, q, *self._target)
        return q

    @cached_property
    def _target(self) -> tuple[Vector, Matrix]:
        """Where the tool is at the given posture: position (3,), rotation (3, 3)."""
        p, R = self.task._place(self.q[int(np.argmin(np.abs(self.s)))])
        return frozen(p), frozen(R)


@typed
def self_motion(
    task: Task, q0: ArrayLike, *, step: float = 0.02, length: float = 4 * np.pi, limits: bool = True
) -> SelfMotion:
    """Trace the postures that hold the tool where it is at q0, both ways: dq/ds = n(q), corrected to f(q) = f(q0).

    Args:
        step: arc length between postures [joint units]. length: at most so far each way.
        limits: a curve ends at the joint limits; False goes on beyond them.

    Raises:
        ArgumentError: not one redundant joint, or bad numbers. SingularityError: J is singular at q0.
        JointLimitError: with limits, q0 is beyond them.
    """
    start = start_posture(task.robot, q0, limits)
    if task.n - task.m != 1:
        what = "the number of redundant joints"
        raise ArgumentError(what, task.n - task.m, "give a task that leaves one")
    if not (0 < step < length < np.inf and length / step <= MOST):
        what = "the step and length of a self-motion"
        raise ArgumentError(what, (step, length), f"give 0 < step < length, {MOST:g} steps at most")
    unit_null(task, start, None)
    return SelfMotions.through(task, start[None]).traced(start[None], step=step, length=length, limits=limits)[0]


@dataclass(frozen=True, eq=False)
class SelfMotions(Value):
    """The postures that hold the tool at poses p (S, 3), R (S, 3, 3)."""

    task: Task
    p: Matrix
    R: Array

    @classmethod
    def through(cls, task: Task, Q: Matrix) -> SelfMotions:
        """Those through postures (S, n)."""
        return cls(task, *task._poses(Q))

    def traced(
        self, Q: Matrix, *, step: float, length: float, limits: bool, directions: Matrix | None = None
    ) -> list[SelfMotion]:
        """The curves through postures (S, n), both ways, each round once.

        Args: as `self_motion`; directions (S, n): in which they begin, where several joints are redundant.
        """
        v = directions
        if v is None:
            v = np.array([null_vector(J) for J in self.task.jacobian_batch(Q)[0]]).reshape(Q.shape)
        # Ahead, and back where the curve has not come round.
        ahead, last = self._one_way(Q, v, np.arange(len(Q)), step, length, limits)
        open_curves = np.flatnonzero([end is not CurveEnd.CLOSED for end in last])
        behind = zip(*self._one_way(Q[open_curves], -v[open_curves], open_curves, step, length, limits), strict=True)
        backward = dict(zip(open_curves.tolist(), behind, strict=True))
        # Both halves as one curve, with its arc length from the given posture.
        curves = []
        for i, q in enumerate(Q):
            back, first = backward.get(i, (Q[:0], last[i]))
            curve = np.concatenate([back[::-1], q[None], ahead[i]])
            s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
            curves.append(SelfMotion(self.task, curve, s - s[len(back)], (first, last[i])))
        return curves

    def walked(self, Q: Matrix, v: Matrix, lengths: Vector, step: float) -> tuple[Matrix, Flags]:
        """Postures (S, n) so far [joint units] along the self-motions through Q (S, n), and which walks got there."""
        every, steps = np.arange(len(Q)), int(np.ceil(np.abs(lengths).max() / step))
        postures, along, sound = self.step(Q, v, every, np.zeros(len(Q)))
        for _ in range(steps):
            postures, along, sound_now = self.step(postures, along, every, lengths / steps)
            sound &= sound_now
        return postures, sound

    def step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        """One step of postures (k, n) of the poses i along their directions v (k, n), which need not hold the tool.

        Returns (postures, directions there, which of them are good); those that are not stay where they were.
        """
        postures, along, sound = self._step(q, v, i, length)
        for parts in (4, 16, 64):  # shorter steps where self-motions bend, as close to a singular posture
            bad = np.flatnonzero(~sound & (length != 0))
            if not len(bad):
                break
            posture, way, good = q[bad], v[bad], np.ones(len(bad), dtype=bool)
            for _ in range(parts):
                posture, way, sound_part = self._step(posture, way, i[bad], length[bad] / parts)
                good &= sound_part
            postures[bad], along[bad], sound[bad] = np.where(good[:, None], posture, q[bad]), way, good
        return postures, along, sound

    def _step(self, q: Matrix, v: Matrix, i: Indices, length: Vector) -> tuple[Matrix, Matrix, Flags]:
        # Along the direction in the middle of the step.
        start, size = q, np.inf
        J = self.task.jacobian_batch(q + length[:, None] / 2 * v)[0]
        along = _unit(v - least_motion(J, (J @ v[:, :, None]))[:, :, 0])
        q = q + length[:, None] * along
        # Newton corrections: a step of 0.2 leaves 1e-3, the first one 1e-6 of it, the second one round-off.
        for _ in range(2):
            J = self.task.jacobian_batch(q)[0]
            e = self.task._error_function.batch(q, self.p[i], self.R[i]).reshape(len(q), -1)
            motions = least_motion(J, np.stack([e, np.einsum("kmn,kn->km", J, along)], axis=2))
            q, along = q + motions[:, :, 0], _unit(along - motions[:, :, 1])
            size = np.abs(motions[:, :, 0]).max(axis=1)
        with np.errstate(invalid="ignore"):
            near = np.linalg.norm(q - start, axis=1) < 2 * np.abs(length) + ROUGH
            sound = np.isfinite(q).all(axis=1) & near & (size < ROUGH)
        return np.where(sound[:, None], q, start), along, sound

    def _one_way(
        self, Q: Matrix, v: Matrix, i: Indices, step: float, length: float, limits: bool
    ) -> tuple[list[Matrix], list[CurveEnd]]:
        """The postures behind Q (k, n) in the direction v, and why there are no more."""
        if not len(Q):
            return [], []
        ends, walking = np.full(len(Q), CurveEnd.LENGTH, dtype=object), np.arange(len(Q))
        posture, along, _ = self._step(Q, v, i, np.zeros(len(Q)))
        first, numbers, points = along, [walking[:0]], [Q[:0]]
        for k in range(int(np.ceil(length / step))):
            posture, along, sound = self.step(posture, along, i[walking], np.full(len(walking), step))
            ends[walking[~sound]] = CurveEnd.SINGULAR
            if limits:
                beyond = sound & ~self.task.robot.within(posture)
                ends[walking[beyond]], sound = CurveEnd.LIMIT, sound & ~beyond
            # A curve has come round where it is within half a step of its start, and goes the same way: else it
            # crosses itself.
            round_again = sound & (np.sum(along * first[walking], axis=1) > 0.9) & (k > 2)
            round_again &= away(self.task, posture, Q[walking]) < 0.75 * step
            ends[walking[round_again]] = CurveEnd.CLOSED
            numbers.append(walking[sound])
            points.append(posture[sound])
            left = sound & ~round_again
            walking, posture, along = walking[left], posture[left], along[left]
            if not len(walking):
                break
        # The points of each curve, in the order in which they were reached.
        which, flat = np.concatenate(numbers), np.concatenate(points)
        order = np.argsort(which, kind="stable")
        cuts = np.searchsorted(which[order], np.arange(1, len(Q)))
        return np.split(flat[order], cuts), ends.tolist()


def away(task: Task, q: Matrix, others: Matrix) -> Vector:
    """How far postures (..., n) are from others [joint units], full turns of hinges taken off."""
    return np.linalg.norm(joint_gap(task.robot, q, others), axis=-1)


def joint_gap(robot: Robot, q: Matrix, others: Matrix) -> Matrix:
    """Postures less others (..., n), full turns of hinges taken off."""
    gap = q - others
    return np.where(robot.hinges, wrapped(gap), gap)


def least_motion(J: Array, wanted: Array, weights: Array | float = 1.0) -> Array:
    """The least weighted dq (S, n, k) with J dq = wanted (S, m, k); weights (n,) or (S, n)."""
    T = np.swapaxes(J, 1, 2) / np.asarray(weights)[..., None]
    with np.errstate(all="ignore"):
        try:
            return T @ np.linalg.solve(J @ T, wanted)
        except np.linalg.LinAlgError:  # one of them is singular to the last bit
            return T @ np.linalg.pinv(J @ T) @ wanted


def correction(task: Task, q: Vector, p: Vector, R: Matrix) -> Vector:
    """The least joint motion (n,) that, to first order, takes the tool to a pose: position (3,), rotation (3, 3)."""
    motion = np.linalg.lstsq(task.jacobian(q), task._error_function(q, p, R), rcond=None)[0]
    return np.asarray(motion, dtype=float)


def unit_null(task: Task, q: Vector, before: Vector | None) -> Vector:
    """The unit null vector of J at q, turned as `before`. Raises: SingularityError."""
    J = task.jacobian(q)
    sigma = np.linalg.svd(J, compute_uv=False)
    if sigma[-1] < 1e-6 * sigma[0]:
        what = f"the self-motion of the {task.name}"
        raise SingularityError(SingularityKind.KINEMATIC, q, what, float(sigma[-1]))
    return null_vector(J, before)


def _unit(v: Matrix) -> Matrix:
    with np.errstate(all="ignore"):
        return v / np.linalg.norm(v, axis=1, keepdims=True)


# --- Labels of the postures with one tool pose: what tells the leaves of a `radial` strategy apart.
#
# With one redundant joint these postures are a curve, the self-motion, and the label is arc length along it as an
# angle: it never turns back. With more the label is the projection on the self-motions at the start, which does.

WIDTH = 0.8
"""Width of a node's weight, in spacings: the label's slope then ripples by less than 1 % on a straight curve."""

PRESENT = 0.7
"""Weight of the nodes, as a share of that in the middle of a curve, from which on a posture counts as one of it: it is
3/4 at an open end, and falls to this 0.84 widths beside the curve."""

SLOPES = (0.3, 3.0)
"""The label's slope over that of arc length, least and greatest: it is 1 but at open ends and sharp turns."""


@dataclass(frozen=True)
class Label:
    """value: q (n,) -> (r,); margin: q -> how far the posture is from where the label ends or turns, 0 there."""

    value: Callable[[SX], SX]
    margin: Callable[[SX], SX]
    angular: bool


def _projection(task: Task, q0: Vector) -> Label:
    """Z^T (q - start), Z (n, r) the self-motions at the start; it turns where det(Z^T N) = 0, N (n, r) those at q."""
    Z = null_space(task.jacobian(q0))

    def margin(q: SX) -> SX:
        J = task.jacobian_expression(task.kinematics(q), q)
        R, product = factorise(SX(Z.T) @ null_space_expression(J)).R, SX(1)
        for i in range(R.shape[0]):
            product = product * R[i, i]
        return fabs(product)

    return Label(lambda q: SX(Z.T) @ (q - SX(q0)), margin, angular=False)


def _arc_length(task: Task, q0: Vector) -> Label | None:
    """The weighted mean of the angles of nodes along the self-motion: atan2(sum w_k sin a_k, sum w_k cos a_k).

    a = 2 pi s / S once round a closed one of length S, pi s / S on an open one; w_k = exp(-d_k^2 / 2 width^2), d_k the
    distance to node k with hinges on their circles, so that a full turn of a joint is no way at all. None if no nodes
    are fine enough.
    """
    # The curve, hinges on their circles: a Panda's closes after 13 joint units or less, the planar arm's after 24.
    curve = self_motion(task, q0, step=0.05, length=40.0, limits=False)
    hinges = task.robot.hinges
    E = np.hstack([curve.q[:, ~hinges], np.cos(curve.q[:, hinges]), np.sin(curve.q[:, hinges])])
    turn, length = 2 * np.pi if curve.closed else np.pi, curve.s[-1] - curve.s[0]
    angles = turn * curve.s / length
    # The first spacing of nodes [joint units] that is fine enough is taken.
    for spacing in (0.4, 0.2, 0.1):
        count = max(4, int(np.ceil(length / spacing)))
        s = np.linspace(curve.s[0], curve.s[-1], count, endpoint=not curve.closed)
        nodes, width = np.array([np.interp(s, curve.s, e) for e in E.T]).T, WIDTH * (s[1] - s[0])
        weights = np.exp(-np.sum((E[:, None] - nodes) ** 2, axis=2) / (2 * width**2))
        a = turn * s / length
        mean = np.arctan2(weights @ np.sin(a), weights @ np.cos(a))
        slopes = (np.diff(np.unwrap(mean)) / np.diff(angles))[1:-1]
        present = weights.sum(axis=1) / (np.sqrt(2 * np.pi) * WIDTH) > PRESENT
        slopes = slopes[present[1:-2] & present[2:-1]]
        if len(slopes) and slopes.min() > SLOPES[0] and slopes.max() < SLOPES[1]:
            a = a - mean[np.argmin(np.abs(curve.s))]
            return _weighted(task.robot, nodes, width, a)
    return None


def _weighted(robot: Robot, nodes: Matrix, width: float, angles: Vector) -> Label:
    hinges = robot.hinges
    slide, turn = np.flatnonzero(~hinges).tolist(), np.flatnonzero(hinges).tolist()
    center = nodes.mean(axis=0)
    scaled = (nodes - center) / width**2
    fixed = np.sum((nodes - center) ** 2, axis=1) / (2 * width**2)

    def weights(q: SX) -> SX:
        departure = vertcat(q[slide], cos(q[turn]), sin(q[turn])) - SX(center)
        # |point - node|^2 by its three terms: half the work of the difference itself
        return exp(SX(scaled) @ departure - SX(fixed) - departure.T @ departure / (2 * width**2))

    def value(q: SX) -> SX:
        w = weights(q)
        return atan2(SX(np.sin(angles)).T @ w, SX(np.cos(angles)).T @ w)

    def margin(q: SX) -> SX:
        share = SX(np.ones(len(nodes))).T @ weights(q) / (np.sqrt(2 * np.pi) * WIDTH)
        return (share - PRESENT) / (1 - PRESENT)

    return Label(value, margin, angular=True)


ARRIVED = 0.01
"""How far the integrated transport may miss the centre, as a share of the joints' way. Of 960 random postures of four
arms, up to 2 rad from the start, with 4 steps, 855 miss by less and pass `DIP`: there the whole integration error was
below 1 % of the way on 850, and 7 % at most. Those that miss by more all had an error above 1 %."""

DIP = 0.01
"""rcond that a stage of the transport may fall to, as a share of the lower one of its ends': less is a segment
that passes a singular posture, where a step can jump to anywhere and still arrive."""

LONGEST_WAY = 0.3
"""Way [joint units] beyond which a longer one allows no larger miss: the metres of a slide say nothing of the radians
of the label. PPR arm, 4 steps, 300 random postures at 11 m: with no bound the label was up to 0.057 rad wrong."""

AT_CENTER = 1e-2
"""Way [joint units] added to a posture's own, so that round-off at the centre itself, in single precision 1e-6 of the
joints, is no miss; so short a path has no error of the steps."""

WRONG = 0.01
"""Error of the gain, as a share of it, from which on it is refused; from less where the label's margin is below 1.
It is an estimate. Of six strategies on four arms, with 1, 2, 4 and 8 steps, at random postures up to 12 m from the
centre of the PPR arm and up to 2.5 rad from that of others, 4,682 gains are answered, and 3 of them more than 1 %
wrong: 1.0, 1.4 and, with four redundant joints, 3.9 %. Without it 301 were, by up to 118 %."""

GAPS = 0.3
"""How the gaps of the sweep count in that error. They go with the step to the fourth power, as the error of all steps
does, and are more than it; 0.2 let twice as many wrong ones pass."""

LabelAt = tuple[SX, SX, SX]
"""Label (r,), its gradient (r, n), margin."""


@made
def radial(strategy: Strategy, q0: ArrayLike, *, steps: int = 4, name: str | None = None) -> HolonomicStrategy:
    """The holonomic strategy whose leaves are carried by `strategy` along straight segments from the pose at `q0`.

    Its constraint g labels q_b, where `strategy` leads from q when the tool goes straight back to the centre, in
    position and along log(R R0^T) in orientation. With one redundant joint g is arc length along the self-motion from
    `q0` to q_b, as an angle: a full turn is once round a closed self-motion, half a turn the length of an open one.
    With r > 1, and near a singular posture where the self-motion turns too sharply, it is Z^T (q_b - start), Z (n, r)
    the self-motions at `q0`.  q_b is integrated by `steps` Runge-Kutta steps; any number gives an exactly holonomic
    strategy, more steps one nearer to the ideal one (the error goes with steps^-4).

    It ends, with a SingularityError (REPRESENTATION), where
    - the integrated transport misses the centre by 1 % of the joints' way or 0.003, or comes a hundred times nearer
      to a singularity of `strategy` than its ends are: the segment passes too near one, or is too long for `steps`;
    - the steps do not give the gain to 1 %, as its label's gradient tells (an estimate): a PPR arm has 1 m for a step;
    - q_b is not on the self-motion through `q0`: it is on another branch, or beyond a singular end of this one;
    - g is Z^T (q_b - start) and det(Z^T N(q_b)) = 0, N (n, r) the self-motions at q_b: there this label turns.
    Elsewhere [J; J_g] is regular, up to the error of the steps: an estimate, since what is between steps is not seen.
    Size: about 4 `steps` times the given strategy.

    Args:
        q0: posture (n,) at the centre x0.
        steps: Runge-Kutta steps of one segment.

    Raises:
        ArgumentError: steps < 1.
        SingularityError: `strategy` is singular at `q0`.
    """
    task = strategy.task
    start = frozen(start_posture(task.robot, q0, False))
    whole("steps", steps)
    if task.n == task.m:
        cure = "each tool pose has its joints already: hk.ik(hk.moore_penrose(task), start) finds them"
        raise ArgumentError("the number of redundant joints", 0, cure)
    strategy(start)
    lines = _lines(strategy, start, steps)
    title, r, loop = f"radial strategy of {strategy.name}", task.n - task.m, lines.loop()
    # g, written out; and with its transport left to a loop.
    g = _constraint_by_label(title, r, lines, _with_memory(loop))
    looped = _constraint_by_label(title, r, lines, lambda _q: loop.symbols, loop)
    return holonomic(task, replace(g, looped=looped), name=name)


def _constraint_by_label(
    title: str, r: int, lines: _Lines, label_at: Callable[[SX], LabelAt], loop: Transport | None = None
) -> Constraint:
    """g by its label, gradient and margin at q. Where J is singular the gradient is 0: rcond 0 says so."""
    return Constraint(
        title,
        r,
        lambda _task, _k, q: label_at(q)[0],
        (lines.label.angular,) * r,
        lambda _task, _k, q: label_at(q)[2],
        lambda _task, _k, q: label_at(q)[1],
        transport=loop,
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """Straight lines of the tool to the centre, in the task's coordinates there, and a strategy that leads along them.

    center (n,): the posture there, x0 (m,) its pose, rcond that of the strategy. along: (q, dx) -> (dq, rcond);
    pulled: (q, dx, weight) -> the derivatives of weight . dq by q and by dx.
    """

    chart: Task
    center: Vector
    x0: Vector
    label: Label
    rcond: float
    steps: int
    along: Callable[..., SX]
    pulled: Callable[..., SX]

    def away(self, q: SX) -> SX:
        """How far the tool is from the centre (m,)."""
        return self.chart.value_expression(self.chart.kinematics(q)) - SX(self.x0)

    def rate(self, q: SX, v: SX) -> tuple[SX, SX]:
        """(dq, rcond) of the strategy."""
        rates = self.along(q, v)
        return rates[: self.chart.n], rates[self.chart.n]

    def slope(self, q: SX, v: SX, weight: SX) -> tuple[SX, SX]:
        """The derivatives of weight . dq by q and by v."""
        slopes = self.pulled(q, v, weight)
        return slopes[: self.chart.n], slopes[self.chart.n :]

    def end(self, q: SX, back: SX, left: SX, first: SX, least: SX) -> tuple[SX, SX, SX]:
        """(label, margin, regular) of a transport from q to `back`, which misses the centre by the joint motion `left`;
        rcond was `first` at q, and at least `least` on the way."""
        way = ARRIVED * fmin(norm_2(q - back) + AT_CENTER, LONGEST_WAY)
        arrived = fmax(0, 1 - norm_2(left) / way)
        passed = fmax(0, 1 - DIP * fmin(first, self.rcond) / least)
        regular = first > TOLERANCES.singular
        margin = if_else(regular, fmin(fmin(passed, arrived), fmax(0, self.label.margin(back))), 1)
        return self.label.value(back), margin, regular

    def doubt(self, q: SX, back: SX, v: SX, aside: SX, along: SX, gaps: SX, regular: SX) -> SX:
        """Square of the gain's error over `WRONG`, estimated from the gradient of a row of the label.

        `along` is the gradient by the tool at the given rates: with an exact label it is 0 along v. `gaps` tell of the
        other directions, in which the radial strategy differs from the given one. `aside` is what the row tells of
        self-motions.
        """
        way = norm_2(q - back) + AT_CENTER
        far = v.T @ v / way**2
        error = ((along.T @ v) / way) ** 2 + GAPS**2 * (gaps[0] + far * gaps[1])
        return if_else(regular, error / (WRONG**2 * (aside.T @ aside)), 0)

    def loop(self) -> Transport:
        """The transport to the centre."""
        parts = self.away, self.rate, self.slope, lambda back: -self.away(back), self.end, self.doubt
        return transport(*parts, center=self.center, steps=self.steps)


def _lines(strategy: Strategy, q0: Vector, steps: int) -> _Lines:
    """The lines to the tool pose at q0."""
    task = strategy.task
    chart = task._chart(task._place(q0)[1])
    charted = replace(strategy, task=chart)
    e, dx, w = charted.expressions, symbol("dx", task.m), symbol("w", task.n)
    moved = e.rate(dx, written_out=True)
    along = as_map([e.q, dx], vertcat(moved.X, fmax(0, moved.rcond)))  # fmax makes 0 of what is not a number
    pulled = as_map([e.q, dx, w], vertcat(*e.slope(dx, w)))
    rcond = float(charted.gain(q0)[1])
    # A curve that turns too sharply for arc length, as close to singular postures, is labelled by the projection too.
    label = (_arc_length(task, q0) if task.n - task.m == 1 else None) or _projection(task, q0)
    return _Lines(chart, q0, chart(q0), label, rcond, steps, along, pulled)


def _with_memory(build: Callable[[SX], LabelAt]) -> Callable[[SX], LabelAt]:
    """`build` with its last answer: the label, its gradient and the margin then share one transport."""
    last: list[tuple[SX, LabelAt]] = []

    def label_at(q: SX) -> LabelAt:
        if not last or last[0][0] is not q:
            last[:] = [(q, build(q))]
        return last[0][1]

    return label_at
