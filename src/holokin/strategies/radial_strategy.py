"""`radial`: a holonomic strategy near any given one, by transport along straight tool segments (theory 5.3).

From a centre x0 every tool pose x is reached along a straight segment; carrying a posture of the centre's
self-motion along it by the given strategy makes the joints a function of x. These postures are the leaves. The
radial strategy equals the given one along segments and at x0, and near x0 |G_rad - G| <= 1/2 |x - x0| sup |F|, to
first order in |x - x0|: on the PPR arm at 0.7 m it is 12 % more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.arguments import made
from ..base.errors import ArgumentError
from ..base.tolerances import TOLERANCES
from ..base.types import ArrayLike, Matrix, Vector, frozen, whole
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
)
from ..symbolic.linear import null_space, null_space_expression
from .constraints import Constraint
from .right_inverses import holonomic
from .self_motion_curves import self_motion_curve
from .strategy import HolonomicStrategy, Strategy
from .tasks.task import Task

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
    curve = self_motion_curve(task, q0, step=0.05, length=40.0, limits=False)
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
