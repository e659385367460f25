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
from ...base.types import Array, ArrayLike, Flags, Matrix, Value, Vector, kept
from ...motion.checks import Clearances, Scene
from ...motion.ik.arm_inverse import ArmInverse
from ...motion.ik.arm_map import ArmMap, check_task, classes, digest, map_of_text, map_text, shipped, spin_axis
from ...motion.ik.closed_leaf import DOUBT
from ...motion.ik.held_coordinate import HeldCoordinate, Spin
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
from .held_arm import HeldArm
from .level_fit import Ranges, Values, direction, fitted, polynomial, ranges_of, served_weight

SAMPLES = 3_000
"""Poses of postures, evenly drawn within the limits, to which a rule is fitted; and of those that no sheet serves."""

DRAWN = 40
"""Times as many poses that are drawn at most to find those."""

TRIAL = 2
"""Sheets by which the joint to hold is chosen."""

SHEETS = 16
"""The most of a map: two calls of eight side by side."""

WANTED = 0.997
"""Share of the poses from which no more sheets are looked for."""

MISSED = 0.002
"""Share of the poses whose arcs within the limits may be missed between two values of what is held."""

TRIED = 3
"""Branches for which a rule is fitted, of which one becomes the next sheet: those with most poses to gain."""

SERVED = 0.02
"""Weight of a pose that a sheet before serves: more sheets that serve it let `near` stay longer."""

LOOKS = 64
"""Random postures of a robot of which one at least is to keep clear of a scene, or no pair is to touch at all."""

Progress = Callable[[float, str], None]
"""Hears how far it is, from 0 to 1, and in words."""


def _fitted(arm: HeldArm, f: Matrix, arcs: Ranges, weights: Vector) -> Vector:
    """The rule (w,) whose value lies in an interval of the arcs at most of the poses' weight, from the best of the
    `starts`. f: of all poses (k, m).
    """
    held, m, basis = arm.held, f.shape[1], arm.held.basis
    form = polynomial if held.slides else direction
    limits = held.range if held.slides else None

    def rule(some: Matrix, share: Vector, x: Vector) -> Values:
        at = form(some, share, basis @ x)
        return Values(at.values, lambda slopes: basis.T @ at.gradient(slopes), at.penalty)

    # The start that hits the most.
    of_arcs = f[arcs.pose]
    values = (rule(of_arcs, np.ones(len(of_arcs)), x).values for x in arm.starts)
    hits = [served_weight(np.clip(v, *limits) if limits else v, arcs, weights, arm.off) for v in values]
    size = np.abs(f).max(axis=0)
    scale = np.tile(size, held.width // m)
    # Terms of one pair of those that turn with the tool are scaled alike.
    if held.spin is not None:
        size[1:] = np.tile(np.maximum(*size[1:].reshape(2, -1)), 2)
        scale = np.tile(size, 2)
    x = np.linalg.lstsq(basis, scale * (basis @ arm.starts[int(np.argmax(hits))]), rcond=None)[0]
    x = fitted(rule, x, f / size, arcs, weights, arm.off, limits)
    return np.array([float(f"{number:.6g}") for number in basis @ x / scale])


class _Trial(NamedTuple):
    """Sheets of an arm: their rules and branches; the share of poses that they serve.

    reached: share of poses that have an interval of any arc. complete: False where Ctrl-C ended it.
    """

    arm: HeldArm
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
    arm: HeldArm, samples: int, most: int, report: Progress, begun: ArmMap | _Trial | None = None, stops: bool = False
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
    arm: HeldArm, f: Matrix, poses: Array, arcs: Flags, weights: Vector
) -> tuple[Vector, Vector, Flags] | None:
    """(rule, branch, which poses it serves) of the sheet that serves the most of the weight, of those that could."""
    gains = weights @ arcs.any(axis=1)
    best, gain = None, 0.0
    for i in np.argsort(-gains, kind="stable")[:TRIED].tolist():
        if not gains[i] > 0:
            break
        rule, branch = _fitted(arm, f, ranges_of(arcs[:, :, i], arm.values, arm.held.turning), weights), arm.branches[i]
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
        found = _fit(HeldArm(held, whole), samples, SHEETS, report, begun, stops=True)
        return found.as_map(whole.choices if whole.held.none else whole.rows)
    hand = [HeldCoordinate(arm, 1.0) for arm in arms]
    if hand[0].none:
        return _of_six(arms[0], poses)
    # The joint to hold: a few sheets of each. Then as many as it takes.
    lengths = [float(f"{np.abs(HeldArm(one).terms(poses)[:, 1:4]).max():.6g}") for one in hand]
    every = [HeldArm(HeldCoordinate(one, length)) for one, length in zip(arms, lengths, strict=True)]
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


def _possible(arm: HeldArm, poses: Array, rng: np.random.Generator) -> Flags:
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
    if begun is None and axis is None:
        from .station_maps import station_map  # which loads more than other maps need

        if (stations := station_map(task)) is not None:
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
            asked = self.clearances.limits
            gaps = self.clearances.distances(Q, np.maximum(asked, self.clearances.wanted)) - asked
            if (always := np.flatnonzero((gaps < 0).all(axis=0))).size:
                pair = " and ".join(self.clearances.names[int(always[0])])
                fact = f"{pair} touch, or are too near, at each of {LOOKS} random postures: no pose is clear"
                raise BranchError(fact, "move the obstacle, or leave the pair out: hk.Scene(allowed=[...])")

    def __call__(self, Q: Matrix) -> list[str]:
        return self.clearances.touching(Q)
