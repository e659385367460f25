"""Maps of whole arms: rules for what is held, fitted to the exact arcs of poses all over the arm; the verb `ik`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, cast, overload

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, BranchError, NativeError
from ...base.progress import progress
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, kept
from ...motion.checks import Clearances, Scene
from ...motion.ik.arm_inverse import ArmInverse
from ...motion.ik.arm_map import ArmMap, check_task, classes, digest, map_of_text, map_text, shipped, spin_axis
from ...motion.ik.closed_leaf import DOUBT
from ...motion.ik.held_coordinate import LEAST, HeldCoordinate, Spin
from ...motion.ik.inverse_function import InverseKinematics
from ...motion.ik.inverse_function import ik as leaf_ik
from ...motion.ik.solutions import PoseSet
from ...motion.ik.stations import StationMap
from ...robot import Robot, load
from ...robot.closed_form import ArmClass, ClosedInverse
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies import Strategy
from ...strategies.tasks import pose
from ...strategies.tasks.task import Task
from ...symbolic.native.toolchain import cache_folder, keep
from ...symbolic.native.toolchain import kept as kept_bytes
from .station_maps import station_map

SAMPLES = 3_000
"""Poses of postures, evenly drawn within the limits, to which a rule is fitted; and of those that no sheet serves."""

DRAWN = 40
"""Times as many poses that are drawn at most to find those."""

TRIAL = 2
"""Sheets by which the joint to hold is chosen."""

BELOW = 4
"""Sheets of an arm of seven joints, of those that its map has, with which a free spin is combined."""

SHEETS = 16
"""The most of a map: two calls of eight side by side."""

WANTED = 0.997
"""Share of the poses from which no more sheets are looked for."""

MISSED = 0.002
"""Share of the poses whose arcs within the limits may be missed between two values of what is held."""

VALUES = 96
"""Values of what is held at which the arcs of a pose are looked at."""

TRIED = 3
"""Branches for which a rule is fitted, of which one becomes the next sheet: those with most poses to gain."""

SERVED = 0.02
"""Weight of a pose that a sheet before serves: more sheets that serve it let `near` stay longer."""

ROUNDS, FIRST, CLOSER = 7, 1.0, 0.6
"""Rounds of a fit: how far off [rad or m] a value stops to count at first, and how that shrinks in each round."""

STEPS, GAIN = 60, 1e-5
"""The most steps of a round, and the share of the loss that a step gains at which it ends."""

SEARCHED = 20
"""The most lengths that are tried for a step."""

INSIDE = 0.95
"""Share of an interval of an arc in which a rule's value is to lie."""

LOOKS = 64
"""Random postures of a robot of which one at least is to keep clear of a scene, or no pair is to touch at all."""

STARTS = 24
"""Angles at which each of the first terms of a rule that turns with the tool is tried, to begin with."""

NATIVE_FROM = 2_000
"""Poses from which native code tells what a rule sees of them: it is built once and asked hundreds of times."""

Progress = Callable[[float, str], None]
"""Hears how far it is, from 0 to 1, and in words."""


class _Arcs(NamedTuple):
    """The intervals of what is held in which an arc is within the limits: pose (N,), middle and half of each (N,)."""

    pose: Indices
    middle: Vector
    half: Vector


@dataclass(frozen=True, eq=False)
class _HeldArm(Value):
    """An arm with a joint held, or the spin of its tool; poses are told apart by which arcs serve them where.

    whole: its map for whole poses, where the spin is held.
    """

    held: HeldCoordinate
    whole: ArmMap | None = None

    @cached_property
    def inverse(self) -> ClosedInverse:
        """The closed form."""
        return ClosedInverse(self.held.arm, limits=True)

    @cached_property
    def below(self) -> _HeldArm | None:
        """That of whole poses, where the spin is held."""
        return None if self.whole is None else _HeldArm(self.whole.held)

    @cached_property
    def values(self) -> Vector:
        """Values of what is held, evenly."""
        return self.held.values(VALUES)

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

    def arcs(self, poses: Array) -> Flags:
        """Whether a posture is within the limits (k, C, B) at poses, values and branches."""
        serves = np.zeros((len(poses), len(self.values), len(self.branches)), dtype=bool)
        for first in range(0, len(poses), 500):
            some = poses[first : first + 500]
            each, values = np.repeat(some, len(self.values), axis=0), np.tile(self.values, len(some))
            flags = (
                self._real(self._at(each, len(some))) if self.below is None else self._below(self.below, each, values)
            )
            serves[first : first + 500] = flags.reshape(serves[first : first + 500].shape)
        return serves

    def _at(self, poses: Array, count: int) -> Array:
        """The answers (k, 8, 12) of the closed form at poses, each of `count` at all values of the joint."""
        every = [self.inverse.at(value) for value in self.values]
        chain, own = (np.array([getattr(one, name) for one in every]) for name in ("chain", "own"))
        return self.inverse.answers_of(*(np.tile(x, (count, 1)) for x in (chain, own)), poses=poses, threads=None)

    def _below(self, below: _HeldArm, poses: Array, spins: Vector) -> Flags:
        """Which branches (k, B) of the arm for whole poses serve poses with the tool turned."""
        poses = self._turned(poses, spins)
        if below.held.none:
            return self._real(below.inverse.answers(poses, np.zeros((len(poses), 0))))
        f, w = below.terms(poses), below.held.width
        return np.column_stack([below.served(f, poses, row[:w], row[w:]) for row in self.branches])

    def intervals(self, flags: Flags) -> _Arcs:
        """Those in which arcs of one branch serve (k, C)."""
        # A turn begins behind a value that does not serve.
        k, count = flags.shape
        begin = flags.argmin(axis=1) if self.held.turning else np.zeros(k, dtype=int)
        flags = np.take_along_axis(flags, (begin[:, None] + np.arange(count)) % count, axis=1)
        edge, step = np.zeros((k, 1), dtype=bool), self.values[1] - self.values[0]
        change = np.diff(np.hstack([edge, flags, edge]).astype(int), axis=1)
        (pose_, first), (_, after) = np.nonzero(change == 1), np.nonzero(change == -1)
        middle = self.values[0] + step * (begin[pose_] + 0.5 * (first + after - 1))
        return _Arcs(pose_, middle, 0.5 * step * (after - 1 - first) + 0.2 * step)

    def off(self, value: Array, middle: Array) -> Array:
        """From a middle to a value, of an angle the shorter way."""
        gap = value - middle
        return gap if self.held.slides else (gap + np.pi) % (2 * np.pi) - np.pi

    def served(self, f: Matrix, poses: Array, rule: Vector, branch: Vector) -> Flags:
        """Whether a sheet serves poses (k,), whose monomials are f (k, m)."""
        low, high = self.held.range
        if self.held.slides:
            value, sound = np.clip(_times(f, rule), low, high), np.ones(len(f), dtype=bool)
        else:
            sine, cosine = _times(f, rule[: self.held.terms]), _times(f, rule[self.held.terms :])
            value, sound = np.arctan2(sine, cosine), np.hypot(sine, cosine) > LEAST
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


def _fitted(arm: _HeldArm, f: Matrix, arcs: _Arcs, weights: Vector) -> Vector:
    """The rule (w,) whose value lies in an interval of the arcs at most of the poses' weight.

        min   sum  w  z^2 / (z^2 + d^2),     z: how far the value is outside the interval that is nearest to it

    with a d that shrinks from round to round, so that what is far outside counts less and less: by L-BFGS, from the
    best of the `starts`. f: of all poses (k, m).
    """
    held, m, basis = arm.held, f.shape[1], arm.held.basis
    low, high = held.range

    def value_of(some: Matrix, rule: Vector) -> Vector:
        return _times(some, rule) if held.slides else np.arctan2(_times(some, rule[:m]), _times(some, rule[m:]))

    # The start that hits the most.
    hits = []
    for x in arm.starts:
        value = value_of(f[arcs.pose], basis @ x)
        value = np.clip(value, low, high) if held.slides else value
        hits.append(weights[np.unique(arcs.pose[np.abs(arm.off(value, arcs.middle)) <= arcs.half])].sum())
    size = np.abs(f).max(axis=0)
    scale = np.tile(size, held.width // m)
    # Terms of one pair of those that turn with the tool are scaled alike.
    if held.spin is not None:
        size[1:] = np.tile(np.maximum(*size[1:].reshape(2, -1)), 2)
        scale = np.tile(size, 2)
    x = np.linalg.lstsq(basis, scale * (basis @ arm.starts[int(np.argmax(hits))]), rcond=None)[0]
    f = f / size
    for round_ in range(ROUNDS):
        value = value_of(f, basis @ x)
        value = np.clip(value, low, high) if held.slides else value
        outside = np.abs(arm.off(value[arcs.pose], arcs.middle)) - arcs.half
        order = np.lexsort((outside, arcs.pose))
        nearest = order[np.unique(arcs.pose[order], return_index=True)[1]]
        some, middle, half = f[arcs.pose[nearest]], arcs.middle[nearest], INSIDE * arcs.half[nearest]
        w, d = weights[arcs.pose[nearest]] / len(nearest), FIRST * CLOSER**round_
        share = w / w.sum()
        # A slide may be asked to go on beyond its limits where an arc is served at these.
        ends = [held.slides & (np.abs(end - middle) <= arcs.half[nearest]) for end in (low, high)]

        def lost(off: Vector) -> tuple[Vector, Vector]:
            z = np.sign(off) * np.maximum(np.abs(off) - half, 0)
            z[(ends[0] & (off < 0)) | (ends[1] & (off > 0))] = 0.0
            bound = z * z + d * d
            return w * z * z / bound, w * 2 * z * d * d / bound**2

        def loss(x: Vector) -> tuple[float, Vector]:
            rule = basis @ x
            if held.slides:
                values, slope = lost(_times(some, rule) - middle)
                return float(values.sum() + 1e-7 * (x @ x)), _onto(some, slope) + 2e-7 * x
            # Beside the misses: the vector is to have length 1, which no angle tells, and coefficients are to be small.
            sine, cosine = _times(some, rule[:m]), _times(some, rule[m:])
            square = sine * sine + cosine * cosine + 1e-12
            values, slope = lost(arm.off(np.arctan2(sine, cosine), middle))
            length = 4e-3 * share * (square - 1)
            by_sine = slope * cosine / square + length * sine
            by_cosine = -slope * sine / square + length * cosine
            value = values.sum() + 1e-3 * float(share @ (square - 1) ** 2) + 1e-7 * (x @ x)
            return float(value), basis.T @ np.concatenate([_onto(some, by_sine), _onto(some, by_cosine)]) + 2e-7 * x

        x = _lowest(loss, x)
    return np.array([float(f"{number:.6g}") for number in basis @ x / scale])


def _times(f: Matrix, rule: Vector) -> Vector:
    """f rule, in the same order of sums however many cores there are: a fit follows the last bit."""
    return np.einsum("ij,j->i", f, rule)


def _onto(f: Matrix, slope: Vector) -> Vector:
    """f^T slope, likewise."""
    return np.einsum("ij,i->j", f, slope)


def _lowest(loss: Callable[[Vector], tuple[float, Vector]], x: Vector) -> Vector:
    """Where a loss is lowest near x, by L-BFGS: as SciPy's, but on one core, and the same on each number of them."""
    value, slope = loss(x)
    pairs: list[tuple[Vector, Vector, float]] = []
    for _ in range(STEPS):
        # The direction, by the last steps and how slopes changed over them.
        direction, shares = -slope, []
        for move, change, product in reversed(pairs):
            shares.append(float(move @ direction) / product)
            direction = direction - shares[-1] * change
        if pairs:
            move, change, product = pairs[-1]
            direction = direction * product / float(change @ change)
        else:
            direction = direction * min(1.0, 1 / max(float(np.abs(slope).sum()), 1e-12))
        for (move, change, product), share in zip(pairs, reversed(shares), strict=True):
            direction = direction + (share - float(change @ direction) / product) * move
        # A step that leads down enough, and over which the slope rises enough.
        descent, low, high, step = float(slope @ direction), 0.0, np.inf, 1.0
        reached, ahead = loss(x + direction)
        for _ in range(SEARCHED):
            if not reached <= value + 1e-4 * step * descent:
                high = step
            elif float(ahead @ direction) < 0.9 * descent:
                low = step
            else:
                break
            step = 0.5 * (low + high) if np.isfinite(high) else 2 * step
            reached, ahead = loss(x + step * direction)
        if not reached < value:
            break
        move, change = step * direction, ahead - slope
        if (product := float(move @ change)) > 0:
            pairs = [*pairs[-9:], (move, change, product)]
        x, slope, gain, value = x + move, ahead, value - reached, reached
        if gain < GAIN * value:
            break
    return x


class _Trial(NamedTuple):
    """Sheets of an arm: their rules and branches; the share of poses that they serve.

    reached: share of poses that have an interval of any arc. complete: False where Ctrl-C ended it.
    """

    arm: _HeldArm
    rules: list[Vector]
    branches: list[Vector]
    served: float
    reached: float
    complete: bool = True

    def as_map(self, choices: Matrix) -> ArmMap:
        """The map of them. Raises: ArgumentError: there are none."""
        if not self.rules:
            cure = "give wider ones: hk.with_limits(robot, lower=..., upper=...)"
            raise ArgumentError(
                "the joint limits", f"so narrow that no sheet of {self.arm.held.robot.name!r} was found", cure
            )
        share = float(f"{self.served:.4g}")
        rules, branches = np.array(self.rules), np.array(self.branches)
        return ArmMap(self.arm.held, rules, branches, choices, share, self.complete, self.arm.whole)


def _fit(
    arm: _HeldArm, samples: int, most: int, report: Progress, begun: ArmMap | _Trial | None = None, stops: bool = False
) -> _Trial:
    """Sheets one after another, each of which serves the most of what those before do not.

    Beside so many poses of all of them, it is fitted to as many that no sheet serves: they are drawn anew for each.
    begun: sheets that are known already. stops: Ctrl-C ends it, and what is found stays.
    """
    robot, rng, tip = arm.held.robot, np.random.default_rng(0), arm.held.arm.tip

    def draw(count: int) -> Array:
        return robot.pose(rng.uniform(robot.lower, robot.upper, (count, robot.n)), tip)

    poses = draw(samples)
    f, arcs, left = arm.terms(poses), arm.arcs(poses), np.ones(samples, dtype=bool)
    found = _Trial(arm, [], [], 0.0, float(arcs.any(axis=(1, 2)).mean()))
    while len(found.rules) < most and found.served < WANTED:
        k, share = len(found.rules), found.served
        try:
            report(k / most, f"{k} sheets serve {share:.1%}")
            if begun is not None and k < len(begun.rules):
                rule, branch = begun.rules[k], begun.branches[k]
                best = (rule, branch, arm.served(f, poses, rule, branch))
            else:
                best = _next_sheet(arm, f, poses, arcs, np.where(left, 1.0, SERVED))
            if best is None or not (best[2] & left).any():
                break
            rule, branch, serves = best
            # Poses that are left, and others that are.
            left &= ~serves
            stay = left.copy()
            stay[:samples] = True
            poses, f, arcs, left = poses[stay], f[stay], arcs[stay], left[stay]
            sheets = [*zip(found.rules, found.branches, strict=True), (rule, branch)]
            drawn = missed = 0
            while (few := samples - int(left.sum())) > 0 and drawn < DRAWN * samples:
                more = draw(4 * samples)
                drawn += len(more)
                g = arm.terms(more)
                for one, other in sheets:
                    rest = ~arm.served(g, more, one, other)
                    more, g = more[rest], g[rest]
                missed += len(more)
                more, g = more[:few], g[:few]
                poses, f = np.concatenate([poses, more]), np.concatenate([f, g])
                arcs, left = np.concatenate([arcs, arm.arcs(more)]), np.append(left, np.ones(len(more), dtype=bool))
        except KeyboardInterrupt:
            if not (stops and found.rules):
                raise
            return found._replace(complete=False)
        share = 1 - missed / drawn if drawn else 1 - float(left[:samples].mean())
        found = found._replace(rules=[*found.rules, rule], branches=[*found.branches, branch], served=share)
    return found


def _next_sheet(
    arm: _HeldArm, f: Matrix, poses: Array, arcs: Flags, weights: Vector
) -> tuple[Vector, Vector, Flags] | None:
    """(rule, branch, which poses it serves) of the sheet that serves the most of the weight, of those that could."""
    gains = weights @ arcs.any(axis=1)
    best, gain = None, 0.0
    for i in np.argsort(-gains, kind="stable")[:TRIED].tolist():
        if not gains[i] > 0:
            break
        rule, branch = _fitted(arm, f, arm.intervals(arcs[:, :, i]), weights), arm.branches[i]
        serves = arm.served(f, poses, rule, branch)
        if weights @ serves > gain:
            best, gain = (rule, branch, serves), float(weights @ serves)
    return best


def make_arm_map(
    task: Task,
    samples: int | None = None,
    report: Progress = lambda _share, _words: None,
    begun: ArmMap | None = None,
) -> ArmMap:
    """The map of an arm, made anew: the same of the same joints and limits.

    Args:
        samples: poses to which each rule is fitted, SAMPLES by default, and as many of those that are left.
        report: hears how far it is.
        begun: one that Ctrl-C stopped, which is completed.

    Raises:
        ArgumentError: an arm without closed forms, or without limits.
    """
    check_task(task)
    arms, robot, axis = classes(task), task.robot, spin_axis(task)
    rng, samples = np.random.default_rng(1), samples or SAMPLES
    poses = robot.pose(rng.uniform(robot.lower, robot.upper, (samples, robot.n)), arms[0].tip)
    if axis is not None:
        whole = cast(ArmMap, _arm_map(robot, task.tip))  # since there are classes
        if not whole.complete:
            raise KeyboardInterrupt  # which that call heard, and kept what it had
        held = HeldCoordinate(whole.arm, whole.held.length, Spin.of(robot, task.tip, axis), whole.held)
        found = _fit(_HeldArm(held, whole), samples, SHEETS, report, begun, stops=True)
        return found.as_map(whole.choices if whole.held.none else whole.rows)
    hand = [HeldCoordinate(arm, 1.0) for arm in arms]
    if hand[0].none:
        return _of_six(arms[0], poses)
    # The joint to hold: a few sheets of each. Then as many as it takes.
    lengths = [float(f"{np.abs(_HeldArm(one).terms(poses)[:, 1:4]).max():.6g}") for one in hand]
    every = [_HeldArm(HeldCoordinate(one, length)) for one, length in zip(arms, lengths, strict=True)]
    if begun is None:
        trials = []
        for i, arm in enumerate(every):
            words = f"whether to hold {robot.joint_names[arm.held.arm.held[0]]}: "
            share = 0.3 * i / len(every)
            trials.append(_fit(arm, samples, TRIAL, lambda _share, more: report(share, words + more)))
        most = max(trial.reached for trial in trials)
        trial = max((trial for trial in trials if trial.reached > most - MISSED), key=lambda trial: trial.served)
        arm, known = trial.arm, trial
    else:
        arm, known = next(arm for arm in every if arm.held.joint == begun.held.joint), begun
    found = _fit(arm, samples, SHEETS, lambda share, words: report(0.3 + 0.7 * share, words), known, stops=True)
    return found.as_map(SIGNS[_possible(arm, poses, rng)])


def _possible(arm: _HeldArm, poses: Array, rng: np.random.Generator) -> Flags:
    """Which choices of signs (8,) postures within the limits have, at random values of the held joint."""
    rows = arm.inverse.answers(np.repeat(poses, 8, axis=0), rng.uniform(*arm.held.range, (8 * len(poses), 1)))
    return np.asarray(((rows[..., 9] > DOUBT) & (rows[..., 10] >= 0)).any(axis=0))


def _of_six(arm: ArmClass, poses: Array) -> ArmMap:
    """The map of an arm of six joints: its signs, those first which serve the most of what those before do not."""
    rows = ClosedInverse(arm, limits=True).answers(poses, np.zeros((len(poses), 0)))
    serves, signs, left = (rows[..., 9] > DOUBT) & (rows[..., 10] >= 0), [], np.ones(len(poses), dtype=bool)
    while (gains := (serves & left[:, None]).sum(axis=0)).any():
        signs.append(int(gains.argmax()))
        left &= ~serves[:, signs[-1]]
    rest = [s for s in np.flatnonzero(serves.any(axis=0)).tolist() if s not in signs]
    chosen = SIGNS[signs + rest]
    length = float(f"{np.linalg.norm(poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0), axis=1).max():.6g}")
    return ArmMap(HeldCoordinate(arm, length), np.zeros((len(chosen), 0)), chosen, chosen, float(1 - left.mean()))


def _arm_map(robot: Robot, tip: str | None, axis: tuple[float, ...] | None = None) -> ArmMap | StationMap:
    """The map of an arm, with an axis (3,) of the tool about which it may spin: of the package, or kept from an earlier
    call, or made and kept. What Ctrl-C leaves is kept, too, and completed by the next call."""
    known = _known(robot)
    if (tip, axis) not in known:
        found = _kept_or_made(robot, tip, axis)
        if isinstance(found, ArmMap) and not found.complete:
            return found
        known[tip, axis] = found
    return known[tip, axis]


@kept
def _known(_robot: Robot) -> dict[tuple[str | None, tuple[float, ...] | None], ArmMap | StationMap]:
    return {}


def _kept_or_made(robot: Robot, tip: str | None, axis: tuple[float, ...] | None) -> ArmMap | StationMap:
    spin = None if axis is None else Spin.of(robot, tip, np.array(axis))
    found = shipped(robot, tip) if spin is None else None
    if found is not None:
        return found
    path = begun = None
    with suppress(NativeError):
        path = cache_folder() / f"map-{digest(robot, tip, spin)}.json"
        data = kept_bytes(path)
        begun = None if data is None else map_of_text(data.decode("utf-8", "replace"), robot, tip, spin)
    if begun is not None and begun.complete:
        return begun
    task = pose(robot, tip=tip) if axis is None else pose(robot, "axis", tip=tip, axis=axis)
    if begun is None and axis is None and (stations := station_map(task)) is not None:
        return stations
    with progress(f"map of {robot.name}", 1.0, words=True) as report:
        found = make_arm_map(task, report=report, begun=begun)
    if path is not None:
        with suppress(NativeError):
            keep(path, map_text(found).encode())
    return found


@overload
def ik(
    strategy: Strategy, q0: ArrayLike, limits: bool = True, *, region: PoseSet | None = None
) -> InverseKinematics: ...


@overload
def ik(strategy: Robot | Task | str, *, limits: bool = True, scene: Scene | None = None) -> ArmInverse: ...


@typed
def ik(
    strategy: Strategy | Robot | Task | str,
    q0: ArrayLike | None = None,
    limits: bool = True,
    *,
    region: PoseSet | None = None,
    scene: Scene | None = None,
) -> InverseKinematics | ArmInverse:
    """Inverse kinematics of a robot, over the whole arm and without a start; or q(x) of a strategy through `q0`.

    Of a robot the arm's own map answers: few sheets in a fixed order, on each of which a joint follows the tool's pose
    so that the same pose has the same joints wherever the tool was before. It takes arms of seven joints that a held
    joint leaves with a closed form (Panda, FR3, iiwa, xArm 7, OpenArm, a UR on a rail), and of six with one, and tasks
    of an axis of the tool, `hk.pose(robot, "axis")`: there the spin of the pose that is given does not matter. Other
    arms of seven hinges (Gen3, Sawyer, YuMi, Rizon 4) are led to the pose from stations of a sheet, of which nothing is
    proven. The maps of the catalogue's arms are in the package; that of another arm is made at the first call, in
    seconds, and kept. With a closed form Ctrl-C ends that: what is found answers, the inverse says so, and the next
    call of `hk.ik` completes it.

    Of a strategy with leaves it is the leaf through `q0`. With `radial(G, start)` this is the straight-line transport
    of G from `q0`, free of drift by construction: theory 5.3's inverse-kinematics form. Where nothing is redundant,
    n = m, any strategy will do, as `moore_penrose(task)`: the pose tells the joints, on the branch of the start.

    Args:
        strategy: or a robot, or its name in the catalogue, or the task of its whole pose, or of an axis of it.
        q0: start posture (n,), of a strategy alone.
        limits: False answers beyond the joint limits, too; by default such postures are refused.
        region: of `unique_region(strategy, q0)`: poses outside are refused, with the status OUTSIDE.
        scene: of a robot or task: postures that touch something are passed over.

    Raises:
        ArgumentError: a strategy without leaves or start; a region of another strategy or leaf; an arm without closed
        forms or limits; arguments of the other kind.
        SingularityError: the strategy is singular at the start. JointLimitError: with limits, the start is beyond them.
        BranchError: a scene that one pair of bodies fills at all postures.
    """
    if isinstance(strategy, Strategy):
        if q0 is None:
            cure = "give the posture whose leaf is meant, or ask for the whole arm: hk.ik(robot)"
            raise ArgumentError("the start q0 of a strategy", None, cure)
        if scene is not None:
            cure = "it is of hk.ik(robot): for a strategy ask hk.check or hk.certify"
            raise ArgumentError("scene", str(scene), cure)
        return leaf_ik(strategy, q0, limits, region=region)
    if q0 is not None and isinstance(strategy, Task):
        return leaf_ik(strategy, q0, limits, region=region)  # type: ignore[arg-type]  it says how to make a strategy
    robot = load(strategy) if isinstance(strategy, str) else strategy
    task = pose(robot) if isinstance(robot, Robot) else robot
    for what, value in (("q0", q0), ("region", region)):
        if value is not None:
            cure = "it is of a strategy: hk.ik(strategy, q0); hk.ik(robot) needs none, and its ik.near(pose, q) takes q"
            raise ArgumentError(what, "given", cure)
    check_task(task)
    axis = spin_axis(task)
    found = _arm_map(task.robot, task.tip, None if axis is None else tuple(axis.tolist()))
    touching = None if scene is None else _Touching(task.robot, scene)
    if touching is not None:
        touching.look()
    return ArmInverse(task, found, limits, touching)


@dataclass(frozen=True, eq=False)
class _Touching(Value):
    """Of postures (k, n): what each touches, or is nearer to than is asked; "" for nothing."""

    robot: Robot
    scene: Scene

    @cached_property
    def clearances(self) -> Clearances:
        """Of the robot in the scene."""
        return Clearances.of(self.robot, self.scene)

    def look(self) -> None:
        """Raises: ArgumentError: the scene lacks something. BranchError: one pair touches at all random postures."""
        robot, rng = self.robot, np.random.default_rng(0)
        Q = rng.uniform(*robot.ranges(np.pi), (LOOKS, robot.n))
        if not self.clearances.clear(Q).any():
            gaps = self.clearances.distances(Q, self.clearances.wanted) - self.clearances.limits
            if (always := np.flatnonzero((gaps < 0).all(axis=0))).size:
                pair = " and ".join(self.clearances.names[int(always[0])])
                fact = f"{pair} touch, or are too near, at each of {LOOKS} random postures: no pose is clear"
                raise BranchError(fact, "move the obstacle, or leave the pair out: hk.Scene(allowed=[...])")

    def __call__(self, Q: Matrix) -> list[str]:
        words, clear = [""] * len(Q), self.clearances.clear(Q)
        blocked = np.flatnonzero(~clear)
        gaps = self.clearances.distances(Q[blocked], self.clearances.wanted) - self.clearances.limits
        for i, row in zip(blocked, gaps, strict=True):
            words[i] = " and ".join(self.clearances.names[int(np.nanargmin(row))])
        return words
