"""Postures at many tool poses: those of all self-motions, their coordinates, and where lines of them end.

Newton's method leads from many starts to postures of all branches. With one redundant joint they are on curves, and
whole curves are walked, each once. With more, a walk is a line among them, and lines are searched one after another,
each from the best postures before: the least found may then be too high.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.tolerances import TOLERANCES
from ...base.types import Array, Flags, Indices, Matrix, Value, Vector
from ...motion.ik.leaf import leaf_step
from ...motion.ik.posture_search import newton, postures_from, spread
from ...path.path import straight
from ...robot import Robot, is_model, load, model_links, model_root
from ...strategies import HolonomicStrategy
from ...strategies.constraints.constraint import ChartFunction
from ...strategies.right_inverses import Terms, monomials, monomials_up_to
from ...strategies.self_motion_curves import CurveTracer, away
from ...strategies.tasks.frame_task import FrameTask, completing, leaves_free, parts_of
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, jacobian, runge_kutta, symbol

STARTS = 64
"""Starts of Newton's method at each pose. A Panda and an iiwa 14 have 4 to 8 self-motions at a pose, and each of them
draws a tenth of the starts or more: 64 miss one once in a thousand poses."""

STEP = 0.2
"""Arc length between the postures of a self-motion [joint units]."""

Cost = Callable[[Matrix], Vector]
"""Postures (k, n) -> values (k,), inf for those that do not count."""


@dataclass(frozen=True, eq=False)
class PosePostures(Value):
    """Postures q (N, n) found at tool poses p (S, 3), R (S, 3, 3), that at `pose` (N,) of them.

    Where one joint is redundant they are those of whole self-motions, in their order, numbered by `curve` (N,).
    Elsewhere each is a curve of its own.
    """

    task: Task
    p: Matrix
    R: Array
    q: Matrix
    pose: Indices
    curve: Indices

    @property
    def traced(self) -> bool:
        """Whether they are whole self-motions."""
        return self.task.n - self.task.m == 1

    def least(self, cost: Cost, excess_of: Cost) -> Vector:
        """The least (S,) of a cost at each pose, looked for between these postures, too; inf where it is inf at all.

        Args:
            excess_of: what is above 0 where the cost is inf, and falls towards where it is not (k,).
        """
        return (_on_curves if self.traced else _on_lines)(self, cost, excess_of)

    @cached_property
    def motions(self) -> CurveTracer:
        """The self-motions at these poses."""
        return CurveTracer(self.task, self.p, self.R)


def postures_at_poses(task: Task, Q: Matrix, p: Matrix, R: Array, *, starts: int) -> PosePostures:
    """The postures at tool poses p (S, 3), R (S, 3, 3), on the self-motions of Q (S, n) and of those that Newton's
    method finds from so many starts at each pose.
    """
    task = task._geometric_twin  # which has no singular angles on the way
    S = len(Q)
    pose = np.repeat(np.arange(S), starts)
    q, arrived = postures_from(task, spread(task.robot, starts * S), p[pose], R[pose])
    q, pose = np.concatenate([Q, q[arrived]]), np.concatenate([np.arange(S), pose[arrived]])
    if task.n - task.m > 1:
        return PosePostures(task, p, R, q, pose, np.arange(len(q)))
    # Walk the self-motion of one posture at each pose, and leave out the postures that lie on it, until none is left.
    # A walk goes 20 joint units each way; a Panda's self-motions close after 20 or less
    rest, curves, curve_poses = np.arange(len(q)), [], []
    while len(rest):
        poses, first = np.unique(pose[rest], return_index=True)
        first = rest[first]
        motions = CurveTracer(task, p[poses], R[poses])
        lines = [line.q for line in motions.traced(q[first], step=STEP, length=20.0, limits=False)]
        curves, curve_poses = curves + lines, [*curve_poses, *poses]
        others = [rest[(pose[rest] == k) & (rest != i)] for k, i in zip(poses, first, strict=True)]
        far = [away(task, q[i][:, None], line).min(axis=1) > STEP for i, line in zip(others, lines, strict=True)]
        rest = np.concatenate([i[apart] for i, apart in zip(others, far, strict=True)])
    curve = np.repeat(np.arange(len(curves)), [len(line) for line in curves])
    return PosePostures(task, p, R, np.concatenate(curves), np.array(curve_poses)[curve], curve)


def _on_curves(postures: PosePostures, cost: Cost, excess_of: Cost) -> Vector:
    """The least cost (S,) on whole self-motions: at their postures, then ever closer round the best places.

    Between two postures that do not count there may be one that does: such places are looked at, too.
    """
    q, pose, rng = postures.q, postures.pose, np.random.default_rng(0)
    value, excess, best = cost(q), excess_of(q), np.full(len(postures.p), np.inf)
    np.minimum.at(best, pose, value)
    # Places where the cost is no higher than beside them, or where the excess is, and may come down to 0 between them:
    # it is less than it changes to a neighbour.
    lowest, _ = _dips(value, postures.curve)
    dips, change_to_neighbour = _dips(excess, postures.curve)
    hidden = np.isinf(value) & dips & (excess < change_to_neighbour)
    places, step = np.flatnonzero(lowest | hidden), STEP
    value = np.where(hidden, 0.0, value)  # to be looked at before all others
    q, pose, value, excess = q[places], pose[places], value[places], excess[places]
    # Three times with steps shorter by eight: the least is then right to 1e-5, also where a limit cuts the self-motion
    for count, parts in ((8, 8), (3, 8), (1, 8)):
        chosen, step = _lowest(value, excess, pose, count), step / parts
        q, pose = q[chosen], pose[chosen]
        # Of a random direction only the share along the self-motion counts.
        line = line_through(postures.motions, q, rng.normal(size=q.shape), pose, step, parts)
        q, value, excess = best_of(line, cost, excess_of)
        np.minimum.at(best, pose, value)
    return best


def _on_lines(postures: PosePostures, cost: Cost, over: Cost) -> Vector:
    """The least cost (S,) that lines in random directions of the self-motions come down to, from the best postures.

    Twelve lines for each redundant joint, of ten steps each way: a third of them from the six best postures of a pose,
    a third from the two best with steps shorter by five, and a third from the best, shorter again.
    """
    pose, rng, best = postures.pose, np.random.default_rng(0), np.full(len(postures.p), np.inf)
    q, value, excess = best_of(postures.q[None], cost, over)
    for third, count in enumerate((6, 2, 1)):
        chosen, step = _lowest(value, excess, pose, count), STEP / 5**third
        q, pose = q[chosen], pose[chosen]
        for _ in range(4 * (postures.task.n - postures.task.m)):
            line = line_through(postures.motions, q, rng.normal(size=q.shape), pose, step, 10)
            q, value, excess = best_of(line, cost, over)
    np.minimum.at(best, pose, value)
    return best


def line_through(motions: CurveTracer, q: Matrix, v: Matrix, pose: Indices, step: float, count: int) -> Array:
    """Postures (2 count + 1, k, n) on self-motions through some (k, n): these, and so many steps both ways."""
    line = [q]
    for sign in (1.0, -1.0):
        posture, along, _ = motions.step(q, sign * v, pose, np.zeros(len(q)))
        for _ in range(count):
            posture, along, _ = motions.step(posture, along, pose, np.full(len(q), step))
            line.append(posture)
    return np.array(line)


def best_of(line: Array, cost: Cost, over: Cost) -> tuple[Matrix, Vector, Vector]:
    """(the best (k, n) of postures (j, k, n), its cost (k,) and excess (k,)); of those that cost inf the nearest."""
    flat = line.reshape(-1, line.shape[2])
    value, excess = cost(flat).reshape(line.shape[:2]), over(flat).reshape(line.shape[:2])
    every = np.arange(line.shape[1])
    chosen = np.where(np.isfinite(value).any(axis=0), value.argmin(axis=0), excess.argmin(axis=0))
    return line[chosen, every], value[chosen, every], excess[chosen, every]


def _dips(value: Vector, curve: Indices) -> tuple[Flags, Vector]:
    """(where values along curves are finite and not above their neighbours', by how much they differ from these)."""
    same = np.diff(curve) == 0
    after = np.append(np.where(same, value[1:], np.inf), np.inf)
    before = np.append(np.inf, np.where(same, value[:-1], np.inf))
    with np.errstate(invalid="ignore"):
        steps = np.fmax(*(np.where(np.isfinite(v), np.abs(v - value), 0.0) for v in (before, after)))
    return np.isfinite(value) & (value <= np.minimum(before, after)), steps


def _lowest(value: Vector, excess: Vector, pose: Indices, count: int) -> Indices:
    """Which of some places cost the least at their poses, so many of each."""
    order = np.lexsort((excess, value, pose))
    first = np.searchsorted(pose[order], pose[order])
    return order[np.arange(len(order)) - first < count]


# --- The coordinates of a workspace in which polynomials are written: those of the tool pose that vary in it, scaled.

FAR = 3.0
"""Turn [rad] from the middle orientation up to which poses have a rotation vector; at pi it jumps."""


@dataclass(frozen=True, eq=False)
class Coordinates(Value):
    """u = P^T (x - middle) / scale (d,), x (m,) the tool pose in `chart`.

    P (m, d) has orthonormal columns, each of positions or of turns alone; |u| <= 1 over the poses of the workspace, and
    `spread` (d,) [m or rad] is their standard deviation along the columns.
    """

    chart: FrameTask
    P: Matrix
    middle: Vector
    scale: Vector
    spread: Vector

    @property
    def d(self) -> int:
        """Number of directions in which the workspace reaches."""
        return self.P.shape[1]

    @property
    def turns(self) -> Flags:
        """Which of them are turns [rad] (d,)."""
        angular = np.array([unit == "rad" for unit in self.chart.units])
        return np.any(self.P[angular] != 0, axis=0)

    def of(self, x: SX) -> SX:
        """u (d,) of a tool pose in the chart, as an expression."""
        return (SX(self.P.T) @ (x - SX(self.middle))) / SX(self.scale)

    def at(self, Q: Matrix) -> Matrix:
        """u (k, d) of the tool poses at postures (k, n)."""
        return (self.chart.value_batch(Q) - self.middle) @ self.P / self.scale


def chart_of(task: Task, rotation: Matrix) -> FrameTask:
    """The task's rows in coordinates with J = df/dq: a full orientation by the rotation vector about the middle one.

    The direction of an axis counts from the middle orientation, too.
    """
    part = parts_of(task)[0]
    if part.orientation != "axis" and part._turns:
        return replace(part, orientation="rotation-vector", reference=rotation)
    return replace(part, reference=rotation) if part.orientation == "axis" or part.robot.planar else part


def coordinates_of(chart: FrameTask, Q: Matrix) -> Coordinates:
    """The coordinates in which the tool poses at postures (k, n) vary.

    Raises:
        ArgumentError: poses that all are one, or that turn by more than FAR from the middle orientation.
    """
    x, angular = chart.value_batch(Q), np.array([unit == "rad" for unit in chart.units])
    if chart._turns and (turn := float(np.linalg.norm(x[:, angular], axis=1).max())) > FAR:
        what = "the largest turn of the workspace from its middle orientation [rad]"
        raise ArgumentError(what, turn, f"keep it below {FAR:g}, or design two strategies")
    P = np.hstack([_directions(x, np.flatnonzero(rows)) for rows in (~angular, angular)])
    if not P.shape[1]:
        raise ArgumentError("the directions in which the workspace reaches", 0, "give poses that are not all alike")
    w, mean = x @ P, x.mean(axis=0)
    middle = mean - P @ (P.T @ mean) + P @ (w.max(axis=0) + w.min(axis=0)) / 2
    return Coordinates(chart, P, middle, np.ptp(w, axis=0) / 2, w.std(axis=0))


def _directions(x: Matrix, rows: Indices) -> Matrix:
    """Orthonormal directions (m, d) among some rows in which values (k, m) vary; the axes where all do.

    A half width of 1e-6 m or rad is well over round-off.
    """
    values = x[:, rows] - x[:, rows].mean(axis=0)
    axes = np.linalg.svd(values, full_matrices=False)[2] if len(rows) else np.zeros((0, 0))
    axes = axes[np.ptp(values @ axes.T, axis=0) / 2 > 1e-6]
    directions = np.zeros((x.shape[1], len(axes)))
    directions[rows] = np.eye(len(rows)) if len(axes) == len(rows) else axes.T
    return directions


@dataclass(frozen=True, eq=False)
class Polynomial(ChartFunction):
    """zeta(x) (r,), a polynomial of a workspace's coordinates: `coefficients` (r, t) of monomials of u, in order."""

    coordinates: Coordinates
    coefficients: Matrix

    @property
    def chart(self) -> FrameTask:
        """That of the coordinates."""
        return self.coordinates.chart

    @cached_property
    def terms(self) -> Terms:
        """The monomials, the constant first, then by increasing degree."""
        degree = 0
        while len(terms := monomials_up_to(self.coordinates.d, degree)) < self.coefficients.shape[1]:
            degree += 1
        return terms

    def __call__(self, x: SX) -> SX:
        """zeta as an expression of the tool pose in the chart."""
        return SX(self.coefficients) @ monomials(self.coordinates.of(x), self.terms)

    def keys_over(self, keys: Mapping[str, Any]) -> dict[str, Any]:
        """What a job file says of a strategy's constraint less this polynomial, `keys` what it says of the strategy."""
        u = self.coordinates
        return {
            "kind": "designed",
            "base": {key: value for key, value in keys.items() if key != "level"},
            "reference": u.chart.reference.tolist(),
            "directions": u.P.tolist(),
            "middle": u.middle.tolist(),
            "scale": u.scale.tolist(),
            "coefficients": self.coefficients.tolist(),
        }


def values_and_slopes(u: Matrix, terms: Terms) -> tuple[Matrix, Array]:
    """Monomials at points (k, d): their values (k, t) and slopes (k, t, d)."""
    v = symbol("u", u.shape[1])
    powers = monomials(v, terms)
    values, slopes = Function("monomials", {"u": v}, {"values": powers, "slopes": jacobian(powers, v)}).batch(u)
    return values.reshape(len(u), len(terms)), slopes.reshape(len(u), len(terms), u.shape[1])


# --- The chain of a robot that is asked about: of a URDF that to the palm at the end of its longest arm.

ARM = 4
"""Joints that an arm has at least: what branches behind fewer is a trunk, not a hand."""


@dataclass(frozen=True, eq=False)
class Chain(Value):
    """A robot, and of a URDF the link that stands still, its tool, and the links that might have been the tool instead.

    chosen: whether the tool was not given but chosen here.
    """

    robot: Robot
    base: str | None
    tip: str
    others: tuple[str, ...]
    chosen: bool

    def __str__(self) -> str:
        n, names = self.robot.n, self.robot.joint_names
        ends = f", from {self.base} to the tip {self.tip}" if self.base else f", tip {self.tip}"
        others = f" (other tips: {', '.join(self.others)})" if self.others else ""
        return f"{self.robot.name}: {n} joint{'s' * (n > 1)}, {names[0]} to {names[-1]}{ends}{others}"


@typed
def chain_to_tool(
    robot: Robot | str | Path, tip: str | None = None, base: str | None = None, trust_units: bool = False
) -> Chain:
    """A robot, a name of the catalogue or a file as a chain, of a model by default to the tip of its longest arm.

    Raises:
        RobotFileError: no link moves. ArgumentError: a base for a robot that is loaded already. As `load`.
    """
    if isinstance(robot, Robot):
        if base is not None:
            raise ArgumentError("the base", base, "only files of models take one: give the file, or load it so")
        return Chain(robot, None, tip or robot.tips[0].name, (), False)
    if not is_model(robot):
        loaded = load(robot, tip=tip, base=base, trust_units=trust_units)
        return Chain(loaded, None, loaded.tips[0].name, (), False)
    tips = _arm_tips(robot, base)
    chosen = tip if tip is not None else tips[0]
    loaded = load(robot, tip=chosen, base=base, trust_units=trust_units)
    return Chain(loaded, base or model_root(robot), chosen, tuple(t for t in tips if t != chosen), tip is None)


def _arm_tips(path: str | Path, base: str | None = None) -> tuple[str, ...]:
    """The links of a model that may be tools, one for each arm, that of the longest arm first.

    Fingers do not count: a chain ends where the tree branches into them, that is behind at least 4 joints, and into
    chains no longer than the one before; or before a last joint named like a gripper's. Of chains as long as each
    other the first one in the file comes first; of the links that move with its end that one is the tool whose name
    says so ("tcp", "tool", ...), the last one of several.

    Raises:
        RobotFileError: no link moves. As `model_links`.
    """
    chains = model_links(path, base)
    ends = {link: _palm(chain, chains) for link, chain in chains.items()}
    longest = max(map(len, ends.values()), default=0)
    if longest == 0:
        raise RobotFileError(path, "has no joint that moves", "give a model of an arm")
    inner = {chain[:k] for chain in ends.values() for k in range(len(chain))}
    arms = [end for end in dict.fromkeys(ends.values()) if end not in inner and len(end) >= min(ARM, longest)]
    # Parts of names that links for tools have, the plainest first
    words = [
        "tcp",
        "tool_center",
        "grasp",
        "tool",
        "end_effector",
        "effector",
        "eef",
        "ee_",
        "flange",
        "gripper",
        "hand",
    ]

    def rank(link: str) -> int:
        return next((i for i, word in enumerate(words) if word in link.lower()), len(words))

    tips = [[link for link, chain in chains.items() if chain == end] for end in sorted(arms, key=len, reverse=True)]
    return tuple(min(reversed(links), key=rank) for links in tips)


def _palm(chain: tuple[str, ...], chains: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """A chain of joints without those of fingers: a last joint named like a gripper's does not move the tool."""
    while len(chain) > ARM and any(word in chain[-1].lower() for word in ("finger", "jaw", "gripper", "thumb")):
        chain = chain[:-1]
    for k in range(ARM, len(chain)):
        beyond = [other[k:] for other in chains.values() if len(other) > k and other[:k] == chain[:k]]
        if len({other[0] for other in beyond}) > 1 and max(map(len, beyond)) <= k:
            return chain[:k]
    return chain


# --- Many tool poses at once: from start postures along straight lines, all lines side by side in arrays.
#
# It is how strategies and their leaves are compared before a few are looked at closely: a hundred times faster than one
# pose after the other, but a step is judged by Newton's own convergence alone, so that it may, rarely, change branches.


@dataclass(frozen=True, eq=False)
class LineEnds(Value):
    """Postures (s, k, n) at the ends of lines from s starts to k poses; where a line ends early, its last posture."""

    q: Array
    share: Matrix

    @property
    def reached(self) -> Flags:
        """Which lines led to their poses (s, k)."""
        return self.share >= 1.0


def along_leaf(
    strategy: HolonomicStrategy,
    starts: Matrix,
    poses: Array,
    levels: Vector | None = None,
    native_from: int | None = None,
    shortest: float = 1 / 256,
) -> LineEnds:
    """From each start (s, n) to each pose (k, 4, 4), on the start's own leaf, or from it to that of level c (r,).

    native_from: lines side by side from which on native code runs, which takes a second to build; see `Function.batch`.
    shortest: share of a line below which a step is given up: the leaf ends there, or bends too sharply to be of use.
    """
    lines = _Lines.each_to_each(strategy.task, starts, poses)
    q, share = _followed(strategy, lines, levels, native_from, first=0.125, shortest=shortest)
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


def one_by_one(
    strategy: HolonomicStrategy,
    starts: Matrix,
    poses: Array,
    native_from: int | None = None,
    levels: Vector | None = None,
) -> tuple[Matrix, Flags]:
    """(postures (k, n), which lines led to their poses (k,)): from start i (k, n) to pose i (k, 4, 4) nearby, on its
    leaf, or to the leaf of level c (r,). Lines between neighbours are tried in one step first."""
    lines = _Lines(strategy.task, starts, poses)
    q, share = _followed(strategy, lines, levels, native_from, first=1.0, shortest=1 / 16)
    return q, share >= 1.0


def _followed(
    strategy: HolonomicStrategy,
    lines: _Lines,
    levels: Vector | None,
    native_from: int | None,
    *,
    first: float,
    shortest: float,
) -> tuple[Matrix, Vector]:
    """(postures (k, n) to which lines were followed, the share of each that was); steps as shares of the lines."""
    step, count = leaf_step(strategy), len(lines.q)
    from_level = np.reshape(strategy.constraint_value.batch(lines.q), (count, -1))
    gap = np.zeros_like(from_level)
    if levels is not None:
        gap = strategy.constraint.nearest(np.broadcast_to(levels, from_level.shape) - from_level)
    start_side = step.batch(lines.q, *lines.at(np.arange(count), np.zeros(count)), from_level)[3]
    q, share, width, live = lines.q.copy(), np.zeros(count), np.full(count, first), np.arange(count)
    # At most 400 rounds of steps, which grow and shrink with each line: lines of regular leaves take ten
    for _ in range(400):
        if not len(live):
            break
        goal = np.minimum(1.0, share[live] + width[live])
        (p, R), level, side = lines.at(live, goal), from_level[live] + goal[:, None] * gap[live], start_side[live]

        def correct(q: Matrix, i: Indices, p=p, R=R, level=level, side=side) -> tuple[Matrix, Flags]:
            """A posture is good where corrections shrink fast and det [J; J_g] keeps its sign. The first one, at most
            0.35 rad or m, is the motion of the joints in that step."""
            dq, rcond, margin, sign = step.batch(q, p[i], R[i], level[i], native_from=native_from)
            sound = (rcond > TOLERANCES.singular) & (margin > TOLERANCES.representation) & (sign == side[i])
            return dq, sound & (np.abs(dq).max(axis=1) <= 0.35)

        # Five corrections, each at most an eighth of the last one, down to what is right for comparisons
        ends, good = newton(correct, q[live], steps=5, exact=1e-8, contraction=TOLERANCES.contraction)
        q[live[good]], share[live[good]] = ends[good], goal[good]
        width[live] = np.where(good, np.minimum(1.0, 2 * width[live]), 0.4 * width[live])
        live = live[(share[live] < 1.0) & (width[live] > shortest)]
    return q, share


def along_radial(task: Task, starts: Matrix, poses: Array) -> LineEnds:
    """From each start to each pose with least joint speed: the leaf of `radial(moore_penrose(task), start)`."""
    lines = _Lines.each_to_each(task, starts, poses)
    q, count, steps = lines.q.copy(), len(lines.q), 32
    share, live, h = np.zeros(count), np.arange(count), 1.0 / steps
    # Runge-Kutta steps of about 0.05 rad. A line is singular where a joint would make over four full turns along it
    for i in range(steps):

        def rate(q: Matrix, s: float, live: Indices = live) -> Matrix:
            R = lines.at(live, np.full(len(live), s))[1]
            return _least_rate(task, q, task._tool_rates(R, lines.path.move[live], lines.path.turn[live])[0])

        ends = runge_kutta(rate, q[live], h, i * h, (i + 0.5) * h, (i + 1) * h)
        good = np.abs(ends - q[live]).max(axis=1) < 25.0 * h  # NaN is not
        live = live[good]
        q[live], share[live] = ends[good], (i + 1) * h
    # Two corrections take away what the steps' errors have left
    p, R = lines.at(np.arange(count), np.ones(count))
    for _ in range(2):
        q[live] += _least_rate(task, q[live], task.error(q[live], p[live], R[live]))
    exact = np.abs(task.error(q, p, R)).max(axis=1) < 1e-6
    share = np.where(exact, share, np.minimum(share, 1 - h))
    return LineEnds(q.reshape(len(starts), len(poses), -1), share.reshape(len(starts), len(poses)))


def _least_rate(task: Task, Q: Matrix, dx: Matrix) -> Matrix:
    """J^+ dx (k, n) at postures (k, n), not finite where J is singular."""
    J, _ = task.jacobian_batch(Q)
    gram = J @ J.transpose(0, 2, 1)
    gram[np.linalg.det(gram) < 1e-300] = np.nan
    return np.einsum("kij,ki->kj", J, np.linalg.solve(gram, dx[..., None])[..., 0])


class _Lines:
    """Straight lines from the poses at starts (k, n) to poses (k, 4, 4)."""

    def __init__(self, task: Task, starts: Matrix, poses: Array) -> None:
        self.q = starts
        p0, R0 = task._poses(np.asarray(starts))
        p, R = poses[:, :3, 3], poses[:, :3, :3]
        if leaves_free(task):
            p, R = completing(task).batch(p0, R0, p, R)
        self.path = straight(p0, R0, p, R)
        if not any(task._angular):
            self.path = replace(self.path, turn=np.zeros_like(self.path.turn))

    @classmethod
    def each_to_each(cls, task: Task, starts: Matrix, poses: Array) -> _Lines:
        """From each start (s, n) to each pose (k, 4, 4): s k lines, those of a start together."""
        return cls(task, np.repeat(starts, len(poses), axis=0), np.tile(poses, (len(starts), 1, 1)))

    def at(self, which: Indices, share: Vector) -> tuple[Matrix, Array]:
        """Positions and rotations of some lines at their shares."""
        return self.path.at(share, which)
