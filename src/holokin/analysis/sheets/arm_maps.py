"""Maps of whole arms: rules for a joint, fitted to the exact arcs of poses all over the workspace; the verb `ik`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, overload

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, NativeError
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, kept
from ...motion.checks import Clearances, Scene
from ...motion.ik.arm_inverse import ArmInverse
from ...motion.ik.arm_map import LEAST, ArmMap, classes, digest, map_of_text, map_text, monomials, seen, shipped
from ...motion.ik.closed_leaf import DOUBT
from ...motion.ik.inverse_function import InverseKinematics
from ...motion.ik.inverse_function import ik as leaf_ik
from ...motion.ik.solutions import PoseSet
from ...robot import Robot, load
from ...robot.closed_form import ArmClass, ClosedInverse
from ...robot.closed_form.closed_inverse import SIGNS
from ...strategies import Strategy
from ...strategies.tasks import pose
from ...strategies.tasks.task import Task
from ...symbolic.native.toolchain import cache_folder, keep
from ...symbolic.native.toolchain import kept as kept_bytes

SAMPLES = 3_000
"""Poses of postures, evenly drawn within the limits, to which a rule is fitted; and of those that no sheet serves."""

DRAWN = 40
"""Times as many poses that are drawn at most to find those."""

TRIAL = 2
"""Sheets by which the joint to hold is chosen."""

DEGREE = 2
"""Of a rule's monomials, 28. With degree 3, 84, eight sheets of a Panda serve 97.7 % and not 97.3 %."""

SHEETS = 16
"""The most of a map: two calls of eight side by side."""

WANTED = 0.997
"""Share of the poses from which no more sheets are looked for."""

MISSED = 0.002
"""Share of the poses whose arcs within the limits may be missed between two values of the held joint."""

VALUES = 96
"""Values of the held joint at which the arcs of a pose are looked at."""

TRIED = 3
"""Choices of signs for which a rule is fitted, of which one becomes the next sheet: those with most poses to gain."""

SERVED = 0.02
"""Weight of a pose that a sheet before serves: more sheets that serve it let `near` stay longer."""

ROUNDS, FIRST, CLOSER = 7, 1.0, 0.6
"""Rounds of a fit: how far off [rad] an angle stops to count at first, and how that shrinks in each round."""

INSIDE = 0.95
"""Share of an interval of an arc in which a rule's angle is to lie."""


class _Arcs(NamedTuple):
    """The intervals of the held joint in which an arc is within the limits: pose (N,), middle and half of each (N,)."""

    pose: Indices
    middle: Vector
    half: Vector


@dataclass(frozen=True, eq=False)
class _HeldArm(Value):
    """An arm with one joint held; poses are told apart by which arcs serve them where."""

    arm: ArmClass
    length: float

    @cached_property
    def inverse(self) -> ClosedInverse:
        """The closed form."""
        return ClosedInverse(self.arm, limits=True)

    @property
    def limits(self) -> tuple[float, float]:
        """Of the held joint."""
        k, robot = self.arm.held[0], self.arm.robot
        return float(robot.lower[k]), float(robot.upper[k])

    @property
    def turning(self) -> bool:
        """Whether they leave all of a turn."""
        low, high = self.limits
        return high - low >= 2 * np.pi

    @cached_property
    def values(self) -> Vector:
        """Values of the held joint, evenly."""
        ends = (-np.pi, np.pi) if self.turning else self.limits
        return np.linspace(*ends, VALUES, endpoint=not self.turning)

    def monomials(self, poses: Array) -> Matrix:
        """Of poses (k, 4, 4): (k, m)."""
        return np.array(monomials(list(seen(self.arm, poses, self.length).T), DEGREE)).T

    def arcs(self, poses: Array) -> Flags:
        """Whether a posture is within the limits (k, C, 8) at poses, values and signs."""
        held = [self.inverse.at(value) for value in self.values]
        chain, own = (np.array([getattr(one, name) for one in held]) for name in ("chain", "own"))
        serves = np.zeros((len(poses), len(self.values), len(SIGNS)), dtype=bool)
        for first in range(0, len(poses), 500):
            some = poses[first : first + 500]
            each = np.repeat(some, len(self.values), axis=0)
            rows = self.inverse.answers_of(
                *(np.tile(x, (len(some), 1)) for x in (chain, own)), poses=each, threads=None
            )
            rows = rows.reshape(*serves[first : first + 500].shape, -1)
            serves[first : first + 500] = (rows[..., 9] > DOUBT) & (rows[..., 10] >= 0)
        return serves

    def intervals(self, flags: Flags) -> _Arcs:
        """Those in which arcs of one choice of signs serve (k, C)."""
        # A turn begins behind a value that does not serve.
        k, count = flags.shape
        begin = flags.argmin(axis=1) if self.turning else np.zeros(k, dtype=int)
        flags = np.take_along_axis(flags, (begin[:, None] + np.arange(count)) % count, axis=1)
        edge, step = np.zeros((k, 1), dtype=bool), self.values[1] - self.values[0]
        change = np.diff(np.hstack([edge, flags, edge]).astype(int), axis=1)
        (pose_, first), (_, after) = np.nonzero(change == 1), np.nonzero(change == -1)
        middle = self.values[0] + step * (begin[pose_] + 0.5 * (first + after - 1))
        return _Arcs(pose_, middle, 0.5 * step * (after - 1 - first) + 0.2 * step)

    def served(self, f: Matrix, poses: Array, rule: Matrix, sign: int) -> Flags:
        """Whether a sheet serves poses (k,), whose monomials are f (k, m)."""
        low, high = self.limits
        sine, cosine = f @ rule[0], f @ rule[1]
        angle = np.arctan2(sine, cosine)
        angle = angle + 2 * np.pi * np.floor(((low + high) / 2 - angle) / (2 * np.pi) + 0.5)
        rows = self.inverse.answers(poses, angle[:, None])[:, sign]
        return (
            (rows[:, 9] > DOUBT)
            & (rows[:, 10] >= 0)
            & (angle >= low)
            & (angle <= high)
            & (np.hypot(sine, cosine) > LEAST)
        )


def _off(angle: Vector, middle: Vector) -> Vector:
    """From a middle to an angle, the shorter way."""
    return (angle - middle + np.pi) % (2 * np.pi) - np.pi


def _fitted(f: Matrix, arcs: _Arcs, weights: Vector, values: Vector) -> Matrix:
    """The rule a, b (2, m) whose angle atan2(a f, b f) lies in an interval of the arcs at most of the poses' weight.

        min   sum  w  z^2 / (z^2 + d^2),     z: how far the angle is outside the interval that is nearest to it

    with a d that shrinks from round to round, so that what is far outside counts less and less: by L-BFGS, from the
    best constant angle. f: of all poses (k, m).
    """
    from scipy.optimize import minimize

    m = f.shape[1]
    hits = [weights[np.unique(arcs.pose[np.abs(_off(c, arcs.middle)) <= arcs.half])].sum() for c in values]
    c = values[int(np.argmax(hits))]
    scale = np.abs(f).max(axis=0)
    rule, f = np.zeros(2 * m), f / scale
    rule[0], rule[m] = np.sin(c) * scale[0], np.cos(c) * scale[0]
    for round_ in range(ROUNDS):
        angle = np.arctan2(f @ rule[:m], f @ rule[m:])
        outside = np.abs(_off(angle[arcs.pose], arcs.middle)) - arcs.half
        order = np.lexsort((outside, arcs.pose))
        nearest = order[np.unique(arcs.pose[order], return_index=True)[1]]
        some, middle, half = f[arcs.pose[nearest]], arcs.middle[nearest], INSIDE * arcs.half[nearest]
        w, d = weights[arcs.pose[nearest]] / len(nearest), FIRST * CLOSER**round_

        def loss(x: Vector) -> tuple[float, Vector]:
            # Beside the misses: the vector is to have length 1, which no angle tells, and coefficients are to be small.
            sine, cosine = some @ x[:m], some @ x[m:]
            square = sine * sine + cosine * cosine + 1e-12
            off = _off(np.arctan2(sine, cosine), middle)
            z = np.sign(off) * np.maximum(np.abs(off) - half, 0)
            bound = z * z + d * d
            slope, length = w * 2 * z * d * d / bound**2, 4e-3 * (square - 1) / len(w)
            by_sine = slope * cosine / square + length * sine
            by_cosine = -slope * sine / square + length * cosine
            value = (w * z * z / bound).sum() + 1e-3 * ((square - 1) ** 2).mean() + 1e-7 * (x @ x)
            return float(value), np.concatenate([some.T @ by_sine, some.T @ by_cosine]) + 2e-7 * x

        options = {"maxiter": 60, "ftol": 1e-6, "gtol": 1e-7}
        rule = minimize(loss, rule, jac=True, method="L-BFGS-B", options=options).x
    return np.array([float(f"{x:.6g}") for x in (rule.reshape(2, m) / scale).ravel()]).reshape(2, m)


class _Trial(NamedTuple):
    """Sheets of an arm with a joint held: rules and their signs; the share of poses that they serve.

    reached: share of poses that have an interval of any arc.
    """

    held: _HeldArm
    rules: list[Matrix]
    signs: list[int]
    served: float
    reached: float


def _fit(
    held: _HeldArm, draw: Callable[[int], Array], samples: int, most: int, progress: Callable[[str], None]
) -> _Trial:
    """Sheets one after another, each of which serves the most of what those before do not.

    Beside so many poses of all of them, it is fitted to as many that no sheet serves: they are drawn anew for each.
    """
    robot, poses = held.arm.robot, draw(samples)
    f, arcs, left = held.monomials(poses), held.arcs(poses), np.ones(samples, dtype=bool)
    reached = float(arcs.any(axis=(1, 2)).mean())
    rules: list[Matrix] = []
    signs: list[int] = []
    share = 0.0
    while len(rules) < most and share < WANTED:
        progress(f"{robot.name}, joint {robot.joint_names[held.arm.held[0]]}: {len(rules)} sheets serve {share:.1%}")
        # The sheet that serves the most of the weight, of those with the signs that could.
        weights = np.where(left, 1.0, SERVED)
        gains = [float(weights @ arcs[:, :, sign].any(axis=1)) for sign in range(len(SIGNS))]
        best, gain = None, 0.0
        for sign in np.argsort(gains)[::-1][:TRIED].tolist():
            if not gains[sign] > 0:
                break
            rule = _fitted(f, held.intervals(arcs[:, :, sign]), weights, held.values)
            serves = held.served(f, poses, rule, sign)
            if weights @ serves > gain:
                best, gain = (rule, sign, serves), float(weights @ serves)
        if best is None or not (best[2] & left).any():
            break
        rule, sign, serves = best
        rules.append(rule)
        signs.append(sign)
        # Poses that are left, and others that are.
        left &= ~serves
        stay = left.copy()
        stay[:samples] = True
        poses, f, arcs, left = poses[stay], f[stay], arcs[stay], left[stay]
        drawn = missed = 0
        while (few := samples - int(left.sum())) > 0 and drawn < DRAWN * samples:
            more = draw(4 * samples)
            drawn += len(more)
            g = held.monomials(more)
            for one, other in zip(rules, signs, strict=True):
                rest = ~held.served(g, more, one, other)
                more, g = more[rest], g[rest]
            missed += len(more)
            more, g = more[:few], g[:few]
            poses, f = np.concatenate([poses, more]), np.concatenate([f, g])
            arcs, left = np.concatenate([arcs, held.arcs(more)]), np.append(left, np.ones(len(more), dtype=bool))
        share = 1 - missed / drawn if drawn else 1 - float(left[:samples].mean())
    return _Trial(held, rules, signs, share, reached)


def make_arm_map(task: Task, samples: int = SAMPLES, progress: Callable[[str], None] = lambda _text: None) -> ArmMap:
    """The map of an arm, made anew: the same of the same joints and limits.

    Args:
        samples: poses to which each rule is fitted, and as many of those that are left. progress: hears how far it is.

    Raises:
        ArgumentError: an arm without closed forms, or without limits.
    """
    arms, robot, rng = classes(task), task.robot, np.random.default_rng(0)

    def draw(count: int) -> Array:
        return robot.pose(rng.uniform(robot.lower, robot.upper, (count, robot.n)), arms[0].tip)

    poses = draw(samples)
    length = float(f"{np.abs(seen(arms[0], poses, 1.0)[:, :3]).max():.6g}")
    if not arms[0].held:
        return _of_six(arms[0], poses, length)
    # The joint to hold: a few sheets of each. Then as many as it takes.
    trials = [_fit(_HeldArm(arm, length), draw, samples, TRIAL, progress) for arm in arms]
    most = max(trial.reached for trial in trials)
    best = max((trial for trial in trials if trial.reached > most - MISSED), key=lambda trial: trial.served)
    trial = _fit(best.held, draw, samples, SHEETS, progress)
    choices = SIGNS[_possible(best.held, poses, rng)]
    rules, share = np.array(trial.rules), float(f"{trial.served:.4g}")
    return ArmMap(best.held.arm, DEGREE, length, rules, SIGNS[trial.signs], choices, share)


def _possible(held: _HeldArm, poses: Array, rng: np.random.Generator) -> Flags:
    """Which choices of signs (8,) postures within the limits have, at random values of the held joint."""
    values = rng.uniform(*held.limits, (8 * len(poses), 1))
    rows = held.inverse.answers(np.repeat(poses, 8, axis=0), values)
    return np.asarray(((rows[..., 9] > DOUBT) & (rows[..., 10] >= 0)).any(axis=0))


def _of_six(arm: ArmClass, poses: Array, length: float) -> ArmMap:
    """The map of an arm of six joints: its signs, those first which serve the most of what those before do not."""
    rows = ClosedInverse(arm, limits=True).answers(poses, np.zeros((len(poses), 0)))
    serves, signs, left = (rows[..., 9] > DOUBT) & (rows[..., 10] >= 0), [], np.ones(len(poses), dtype=bool)
    while (gains := (serves & left[:, None]).sum(axis=0)).any():
        signs.append(int(gains.argmax()))
        left &= ~serves[:, signs[-1]]
    rest = [s for s in np.flatnonzero(serves.any(axis=0)).tolist() if s not in signs]
    chosen = SIGNS[signs + rest]
    return ArmMap(arm, 0, length, np.zeros((len(chosen), 2, 0)), chosen, chosen, float(1 - left.mean()))


@kept
def _arm_map(robot: Robot, tip: str | None) -> ArmMap:
    """The map of an arm: of the package, or kept from an earlier call, or made and kept."""
    task = pose(robot, tip=tip)
    arms = classes(task)
    found = shipped(arms)
    if found is not None:
        return found
    path = None
    with suppress(NativeError):
        path = cache_folder() / f"map-{digest(arms[0])}.json"
        data = kept_bytes(path)
        found = None if data is None else map_of_text(data.decode("utf-8", "replace"), arms)
    if found is not None:
        return found
    found = make_arm_map(task)
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
    joint leaves with a closed form (Panda, FR3, iiwa, xArm 7, OpenArm), and of six with one. The maps of the
    catalogue's arms are in the package; that of another arm is made at the first call, in seconds, and kept.

    Of a strategy with leaves it is the leaf through `q0`. With `radial(G, start)` this is the straight-line transport
    of G from `q0`, free of drift by construction: theory 5.3's inverse-kinematics form. Where nothing is redundant,
    n = m, any strategy will do, as `moore_penrose(task)`: the pose tells the joints, on the branch of the start.

    Args:
        strategy: or a robot, or its name in the catalogue, or the task of its whole pose, `hk.pose(robot)`.
        q0: start posture (n,), of a strategy alone.
        limits: False answers beyond the joint limits, too; by default such postures are refused.
        region: of `unique_region(strategy, q0)`: poses outside are refused, with the status OUTSIDE.
        scene: of a robot or task: postures that touch something are passed over.

    Raises:
        ArgumentError: a strategy without leaves or start; a region of another strategy or leaf; an arm without closed
        forms or limits; arguments of the other kind.
        SingularityError: the strategy is singular at the start. JointLimitError: with limits, the start is beyond them.
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
    classes(task)
    found = _arm_map(task.robot, task.tip)
    touching = None if scene is None else _Touching(task.robot, scene)
    if touching is not None:
        _ = touching.clearances  # which says what the scene lacks
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

    def __call__(self, Q: Matrix) -> list[str]:
        return self.clearances.touching(Q)
