"""Advice on strategies: what each does on trial at many poses, which are the same, which is best, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np

from ...base.types import Absent, Array, Flags, Indices, Matrix, NoTruthValue, Value, Vector, number_or_none
from ...motion.checks import Clearances, Scene
from ...motion.checks.check_report import keeps
from ...path.workspaces import Box, PoseRange, Workspace
from ...strategies import HolonomicStrategy, moore_penrose, radial
from ...strategies.radial_strategy import SelfMotions
from ...strategies.tasks.task import Task
from ..coverage.cover_workspace import Coverage
from ..coverage.pose_postures import Chain, Coordinates, LineEnds, along_leaf, along_radial, best_of, line_through
from ..coverage.starts import Candidate, kinds_that_fit
from .designed_strategy import least_slopes
from .nearby_cusps import LevelRange, NearbyCusps
from .objectives import Costs

EQUAL = 0.02
"""Difference of coverage up to which two strategies cover alike: five of 256 poses, which other poses would decide
otherwise."""

EASY = 0.05
"""Difference of the share that is served away from limits and singular postures up to which it counts as alike."""

ROOM = 0.02
"""Share of a joint's range to its limit from which on a posture keeps away from limits: 6 degrees of 300."""

REGULAR = 0.01
"""rcond from which on a posture keeps away from singular ones: joints are then at most a hundred times as fast."""

PROVABLE = 0.01
"""Clearance [m] beyond that asked for from which on a posture keeps well clear: what `certify` proves of a Panda was a
centimetre less than the least at many poses."""

CLOSE = 0.03
"""Excess of mean squared joint speed over the least possible that is called close: 1.5 % of speed."""


class Ranked(Protocol):
    """What strategies are ranked by."""

    @property
    def coverage(self) -> float:
        """Share of the poses that are served."""
        ...

    @property
    def clear(self) -> float:
        """Share of the poses that are served with a clearance that can be proven; 1 where none is asked for."""
        ...

    @property
    def easy(self) -> float:
        """Share of the poses that are served away from limits and singular postures."""
        ...

    @property
    def squared_speed(self) -> float:
        """Mean squared joint speed."""
        ...


Entry = TypeVar("Entry", bound=Ranked)


def ranked(entries: Iterable[Entry]) -> list[Entry]:
    """The best first: by coverage; of those that cover alike, by the share that is served well clear of what stands
    round; of those alike in this, too, by the share that is served away from limits and singular postures; of those
    alike in all this by joint speed.
    """
    found: list[Entry] = []
    for group in _alike(entries, lambda one: one.coverage, EQUAL):
        for clear in _alike(group, _clear, EQUAL):
            for part in _alike(clear, lambda one: one.easy, EASY):
                found += sorted(part, key=lambda one: one.squared_speed)
    return found


def alike(one: Ranked, other: Ranked) -> bool:
    """Whether two cover alike, and serve alike shares well clear, and away from limits and singular postures."""
    same = abs(one.coverage - other.coverage) <= EQUAL and abs(_clear(one) - _clear(other)) <= EQUAL
    return same and abs(one.easy - other.easy) <= EASY


def _clear(one: Ranked) -> float:
    """The share that is well clear, and more where it is all: what is not clear somewhere cannot be proven."""
    return one.clear if one.clear < 1 else 1 + 2 * EQUAL


def _alike(entries: Iterable[Entry], share: Callable[[Entry], float], apart: float) -> Iterator[list[Entry]]:
    """Groups of entries whose shares are nearly those of the best in them, the best first."""
    left = list(entries)
    while left:
        least = max(map(share, left)) - apart
        yield [one for one in left if share(one) >= least]
        left = [one for one in left if share(one) < least]


@dataclass(frozen=True, eq=False)
class RatedStrategy(Value):
    """A strategy on one leaf, and what it does in the workspace.

    same: names of strategies that are this one there: their G is the same at every pose. keys: what a job file says of
    it. q0: the posture that its leaf goes through (n,). coverage: share of the poses that it reaches within the joint
    limits, `served` (k,); easy: of these, those away from limits and singular postures. margin: the least distance to
    a limit over the joint's range, of `joint`; inf without limits. rcond: the least of [J; J_g]; NaN where it was not
    looked at. squared_speed: mean squared joint speed [rad^2/m^2]; speed: that over the least of the postures found
    there. clearance: the least distance of two shapes [m] at the poses that it reaches within the joint limits; inf
    where nothing was asked of it. clear: share of the poses that are served with 0.01 m more of it than was asked for.
    """

    name: str
    same: tuple[str, ...]
    keys: Mapping[str, Any]
    strategy: HolonomicStrategy
    q0: Vector
    coverage: float
    served: Flags
    easy: float
    margin: float
    joint: str
    rcond: float
    squared_speed: float
    speed: float
    clearance: float = np.inf
    clear: float = 1.0

    @property
    def sentence(self) -> str:
        """What it does, in words."""
        said = f"it reaches {self.coverage:.1%} of the workspace within the joint limits"
        if not self.served.any():
            return said
        if np.isfinite(self.margin):
            said += f", the joint nearest to a limit is {self.joint}, at a distance of {self.margin:.1%} of its range"
        if np.isfinite(self.rcond):
            said += f", rcond is {self.rcond:.2g} at least"
        if np.isfinite(self.clearance):
            said += f", shapes come to {self.clearance:.3f} m of each other"
        return f"{said}, and its mean squared joint speed is {self.speed - 1:.1%} above the least found there"


@dataclass(frozen=True, eq=False)
class Part(Value):
    """The largest part of a workspace, round its centre, that one strategy serves: `share` of its sizes."""

    strategy: RatedStrategy
    share: float
    workspace: PoseRange


@dataclass(frozen=True, eq=False)
class Advice(NoTruthValue, Value, ask="`.best.coverage`"):
    """Strategies that fit a robot, compared on a workspace, the best first.

    chain: the robot, its base and its tip. proposed: which of tip, task, start and workspace were not given but chosen.
    floor: the least mean squared joint speed of the postures found at the poses, where the best one serves
    [rad^2/m^2]. coverage: of the best. reasons: sentences on the best. cusps: those found on its leaf, and how near to
    the workspace they are. part: the largest part of the workspace that a strategy
    serves, where none serves the whole. levels: those of the best strategy that serve the workspace, where they were
    asked for and it has one row. scene: what the links are to keep clear of.
    """

    chain: Chain
    task: Task
    workspace: Workspace
    proposed: tuple[str, ...]
    strategies: tuple[RatedStrategy, ...]
    floor: float
    coverage: Coverage
    reasons: tuple[str, ...]
    cusps: NearbyCusps
    part: Part | None
    seconds: float
    levels: LevelRange | None = None
    scene: Scene | None = None

    laws = Absent("laws", "advice.strategies")

    @property
    def best(self) -> RatedStrategy:
        """The strategy to take."""
        return self.strategies[0]

    @property
    def q0(self) -> Vector:
        """The posture (n,) to begin at with the best strategy."""
        return self.best.q0

    def __str__(self) -> str:
        return "\n".join([self.subject, *self.reasons, *filter(None, [self.certify_by])])

    @property
    def certify_by(self) -> str:
        """The call that proves what was looked at here pose by pose, with this as `advice`; empty for `radial`, and
        where no pose is served.
        """
        if self.best.strategy.constraint.looped is not None or not self.best.served.any():
            return ""
        more, space = ", scene=advice.scene" if self.scene else "", self.workspace
        if not isinstance(space, PoseRange) or not isinstance(space.solid, Box):
            return f"Certify it by: hk.unique_region(advice.best.strategy, advice.q0{more})"
        if not self.best.served.all():
            call = f"hk.unique_region(advice.best.strategy, advice.q0, advice.workspace{more})"
            return f"Certify what it serves by: {call}"
        return f"Certify it by: hk.certify(advice.best.strategy, advice.workspace, advice.q0{more})"

    @property
    def subject(self) -> str:
        """What was asked about: the robot and its tip, the task, the workspace."""
        return f"{self.chain}. Task: {self.work}. Workspace: {self.workspace}."

    @property
    def work(self) -> str:
        """The task in words, with the axis about which the tool may spin."""
        axis = getattr(self.task, "axis", None)
        if self.task.orientation != "axis" or axis is None:
            return self.task.name
        names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
        which = names.get(tuple(np.asarray(axis).tolist()))
        said = f"its {which} axis" if which else f"the axis [{', '.join(f'{v:.4g}' for v in axis)}] of its frame"
        return f"{self.task.name}, the tool free to spin about {said}"

    @property
    def offers(self) -> str:
        """Which tasks there are for this robot, in words; empty where the task is the whole pose, or was given."""
        kinds = kinds_that_fit(self.task.robot)
        if "task" not in self.proposed or "pose" in kinds or not kinds:
            return ""
        said = {
            "axis": "'axis' holds the tool's point and the direction of its z axis, as for a torch",
            "position": "'position' holds the tool's point",
        }
        few = f"{self.task.n} joints leave none free for a whole pose ('pose')"
        return f"{few}; of the other tasks {', '.join(said[kind] for kind in kinds)}"

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        return {
            "robot": self.task.robot.name, "base": self.chain.base, "tip": self.chain.tip,
            "other_tips": list(self.chain.others), "task": self.task.name, "workspace": str(self.workspace),
            "cusp_distance": number_or_none(self.cusps.away),
            "levels": None if self.levels is None else [list(ends) for ends in self.levels.intervals],
            "floor": number_or_none(self.floor),
            "proposed": list(self.proposed), "reasons": list(self.reasons),
            "strategies": [
                {
                    "name": rated.name, "same": list(rated.same), "coverage": rated.coverage, "joint": rated.joint,
                    "margin": number_or_none(rated.margin),
                    "rcond": number_or_none(rated.rcond),
                    "squared_speed": number_or_none(rated.squared_speed),
                    "speed": number_or_none(rated.speed), "start": rated.q0.tolist(),
                    "clearance": number_or_none(rated.clearance), "clear": rated.clear,
                }
                for rated in self.strategies
            ],
        }  # fmt: skip


DIFFERENCE = 1e-4
"""Half of the step of a central difference by the tool pose [m or rad]: its error is 1e-8, that of round-off, too."""


@dataclass(frozen=True, eq=False)
class Poses(Value):
    """The tool poses T (k, 4, 4) at which strategies are tried, and the motions of the tool by which speeds are
    counted.

    twists: (k, m, d), what the tool does in the task's rows along each direction in which the workspace reaches, at
    1 m/s, or as many rad/s as its turns are wide; NaN at a pose that no posture reaches. weights: of squared joint
    speeds (n,), see `Objective`. apart: the shapes that are to keep clear of each other; None where nothing is
    asked of them.
    """

    T: Array
    twists: Array
    weights: Vector
    apart: Clearances | None = None

    def __len__(self) -> int:
        return len(self.T)

    def some(self, which: Indices | slice) -> Poses:
        """Some of them."""
        return Poses(self.T[which], self.twists[which], self.weights, self.apart)

    def squared_speed(self, G: Array) -> Array:
        """sum_ij w_i (G twist_j)_i^2 (..., k) of slopes G (..., k, n, m): the cost "squared_speed" of `Objective`."""
        return np.sum(self.weights[:, None] * (G @ self.twists) ** 2, axis=(-2, -1))


def posed(
    task: Task, T: Array, Q: Matrix, coordinates: Coordinates, costs: Costs, apart: Clearances | None = None
) -> Poses:
    """`Poses` at T (k, 4, 4), of postures that reach them, a row of NaN where there are none, Q (k, n)."""
    known = np.isfinite(Q).all(axis=1)
    J, chart = task.jacobian_batch(Q[known])[0], coordinates.chart.jacobian_batch(Q[known])[0]
    twists = np.full((len(T), task.m, coordinates.d), np.nan)
    twists[known] = J @ least_slopes(chart, coordinates.P * costs.columns, np.ones(task.n))
    return Poses(T, twists, costs.joints, apart)


@dataclass(frozen=True, eq=False)
class Trial(Value):
    """A candidate on the leaf through a start, at k poses.

    q: postures (k, n) where its lines end. reached: poses (k,) that they lead to; served: those within the joint
    limits, at clear postures. speed: squared joint speed (k,), NaN where it is not reached. rcond: of [J; J_g] there
    (k,); NaN for radial, whose leaves end only where J is singular. same: names of other strategies that are this one
    on this workspace. clearance: the least distance of two shapes (k,) [m] where the strategy gets within the limits,
    else NaN, and `wanted`, what is asked of it; None where nothing is.
    """

    candidate: Candidate
    q0: Vector
    q: Matrix
    reached: Flags
    served: Flags
    speed: Vector
    rcond: Vector
    same: tuple[str, ...] = ()
    clearance: Vector | None = None
    wanted: float = 0.0

    @property
    def coverage(self) -> float:
        """Share of the poses that are served."""
        return float(np.mean(self.served))

    @property
    def easy(self) -> float:
        """Share of the poses that are served away from limits and singular postures."""
        away = (self.margins.min(axis=1) >= ROOM) & ~(self.rcond < REGULAR)  # of radial it is not known
        return float(np.mean(self.served & away))

    @property
    def clear(self) -> float:
        """Share of the poses that are served with a clearance that can be proven; 1 where none is asked for."""
        return clear_share(self.served, self.clearance, self.wanted)

    @cached_property
    def margins(self) -> Matrix:
        """Distance to the nearer limit over the joint's range (k, n), negative beyond it; inf without limits."""
        robot = self.candidate.task.robot
        spans = robot.upper - robot.lower
        room = np.minimum(self.q - robot.lower, robot.upper - self.q)
        return np.where(np.isfinite(spans), room / np.where(np.isfinite(spans), spans, 1.0), np.inf)

    @property
    def margin(self) -> float:
        """The least of `margins` where it serves; 0 where it does not, inf without limits."""
        return float(self.margins[self.served].min()) if self.served.any() else 0.0

    @property
    def joint(self) -> int:
        """The joint of that margin."""
        return int(np.argmin(self.margins[self.served].min(axis=0))) if self.served.any() else 0

    @property
    def least_rcond(self) -> float:
        """The least rcond where it serves; 0 where it does not, NaN for radial."""
        return float(self.rcond[self.served].min()) if self.served.any() else 0.0

    @property
    def squared_speed(self) -> float:
        """Mean squared joint speed where it serves; infinite where it does not."""
        return float(self.speed[self.served].mean()) if self.served.any() else np.inf


def tried(candidate: Candidate, starts: Matrix, poses: Poses) -> list[Trial]:
    """A trial from each of the starts (s, n) that the strategy can begin at."""
    task = candidate.task
    if candidate.strategy is not None and candidate.level is not None:
        starts = _on_leaf(task, candidate.strategy, starts, candidate.level)
    if not len(starts):
        return []
    if candidate.strategy is None:
        ends = along_radial(task, starts, poses.T)
        speed, rcond = _radial_speeds(task, starts, poses), np.full(ends.share.shape, np.nan)
    else:
        ends = along_leaf(candidate.strategy, starts, poses.T)
        G, rcond, _ = candidate.strategy.gain.batch(ends.q.reshape(-1, task.n))
        speed, rcond = poses.squared_speed(G.reshape(*ends.q.shape, task.m)), rcond.reshape(ends.share.shape)
    return [_trial(candidate, q0, ends, i, speed[i], rcond[i], poses.apart) for i, q0 in enumerate(starts)]


def _trial(
    candidate: Candidate, q0: Vector, ends: LineEnds, i: int, speed: Vector, rcond: Vector, apart: Clearances | None
) -> Trial:
    q, reached = ends.q[i], ends.reached[i]
    served, speed = reached & candidate.task.robot.within(q) & np.isfinite(speed), np.where(reached, speed, np.nan)
    if apart is None:
        return Trial(candidate, q0, q, reached, served, speed, rcond)
    clearance = np.full(len(q), np.nan)
    clearance[served] = apart.least(q[served], apart.wanted)
    return Trial(
        candidate, q0, q, reached, served & keeps(clearance, apart.wanted), speed, rcond, (), clearance, apart.wanted
    )


def clear_share(served: Flags, clearance: Vector | None, wanted: float) -> float:
    """Share of the poses (k,) that are served with `PROVABLE` more clearance than is wanted [m]; 1 without any."""
    return 1.0 if clearance is None else float(np.mean(served & (clearance >= wanted + PROVABLE)))


def _on_leaf(task: Task, strategy: HolonomicStrategy, starts: Matrix, level: float) -> Matrix:
    """Those starts, moved by self-motion to the leaf of a level, that get there within the joint limits."""
    moved = []
    for q in starts:
        ends = along_leaf(strategy, q[None], task.pose(q)[None], np.full(task.n - task.m, level))
        if ends.reached[0, 0] and task.robot.within(ends.q[0, 0]):
            moved.append(ends.q[0, 0])
    return np.array(moved).reshape(-1, task.n)


def _radial_speeds(task: Task, starts: Matrix, poses: Poses) -> Matrix:
    """The squared speed (s, k) by central differences of where the lines end."""
    from scipy.spatial.transform import Rotation

    total = np.zeros((len(starts), len(poses)))
    for j in range(poses.twists.shape[2]):
        six = np.zeros((len(poses), 6))
        six[:, list(task.rows)] = np.nan_to_num(poses.twists[:, :, j])
        ends = []
        for h in (DIFFERENCE, -DIFFERENCE):
            moved = poses.T.copy()
            moved[:, :3, 3] += h * six[:, :3]
            moved[:, :3, :3] = Rotation.from_rotvec(h * six[:, 3:]).as_matrix() @ moved[:, :3, :3]
            ends.append(along_radial(task, starts, moved).q)
        total += np.sum(poses.weights * ((ends[0] - ends[1]) / (2 * DIFFERENCE)) ** 2, axis=2)
    return total


# --- What keeps the best strategy's joint speed above the least: joint limits, or that the least lies elsewhere.

NEAR = 1.0
"""Way along a self-motion [joint units] that is called near: valleys of a Panda's joint speed are 3 apart."""

STEP, FINER = 0.1, 10
"""Step of the walks that look for the least nearby; round the best posture they are shorter by this."""

LINES = 8
"""Lines searched one after another for each redundant joint, where there are several."""

PARTLY = 0.5
"""Share of the workspace that a strategy serves at least which is named beside the best."""

Beyond = tuple[tuple[str, str, int], ...]
"""(joint, "lower" or "upper", poses at which it is beyond that limit), most first."""


@dataclass(frozen=True, eq=False)
class Free(Value):
    """The best strategy designed again without joint limits: its mean squared speed over the least, and what is beyond
    its limits then.
    """

    speed: float
    beyond: Beyond
    poses: int


@dataclass(frozen=True, eq=False)
class Rival(Value):
    """A strategy that comes closer to the least than the best one, where it serves, but serves less: `ends` poses at
    which its leaf ends.
    """

    name: str
    speed: float
    coverage: float
    beyond: Beyond
    ends: int


@dataclass(frozen=True, eq=False)
class Excess(Value):
    """What is known of the reasons. near: the least mean squared speed of postures within the joint limits, near those
    of the strategy, over the least anywhere; from whole walks (traced), or with several redundant joints from a search.
    """

    near: float
    traced: bool
    free: Free | None
    rival: Rival | None


def beyond_limits(trial: Trial, which: Flags) -> Beyond:
    """The limits that a strategy is beyond at some of its poses (k,)."""
    robot, found = trial.candidate.task.robot, []
    for side, over in (("lower", trial.q < robot.lower), ("upper", trial.q > robot.upper)):
        counts = over[which].sum(axis=0)
        found += [(robot.joint_names[j], side, int(counts[j])) for j in np.flatnonzero(counts)]
    return tuple(sorted(found, key=lambda entry: -entry[2]))


def rival_of(best: Trial, trials: Sequence[Trial], floor: Vector, within: Flags) -> Rival | None:
    """The strategy that comes closest to the least where it serves, of those that serve less but more than `PARTLY`.

    Args:
        floor: the least squared speed (k,), NaN where it is not known. within: poses (k,) that any posture within the
            limits reaches.
    """
    found: tuple[float, Trial] | None = None
    nearest = ratio(best, floor) - CLOSE / 2
    for trial in trials:
        less = trial.coverage < best.coverage - EQUAL or trial.easy < best.easy - EASY
        if less and trial.coverage > PARTLY and ratio(trial, floor) < nearest:
            found = (nearest := ratio(trial, floor)), trial
    if found is None:
        return None
    trial = found[1]
    lost = within & ~trial.served
    ends = int((lost & ~trial.reached).sum())
    return Rival(trial.candidate.name, found[0], trial.coverage, beyond_limits(trial, lost & trial.reached), ends)


def ratio(trial: Trial, floor: Vector, *, limits: bool = True) -> float:
    """The mean squared speed of a strategy over the least, where it serves, or, limits aside, where it gets."""
    known = (trial.served if limits else trial.reached) & np.isfinite(trial.speed) & np.isfinite(floor)
    return float(trial.speed[known].mean() / floor[known].mean()) if known.any() else np.nan


def least_near(coordinates: Coordinates, costs: Costs, Q: Matrix, p: Matrix, R: Array) -> Vector:
    """The least squared joint speed (S,) of postures within the joint limits and near those given (S, n), over all
    slopes, at tool poses p (S, 3), R (S, 3, 3).
    """
    task, rng = coordinates.chart, np.random.default_rng(0)
    r = task.n - task.m

    def over(at: Matrix) -> Vector:
        return (np.abs(at - costs.middle) - costs.half).max(axis=1)

    def least(at: Matrix) -> Vector:
        G = least_slopes(task.jacobian_batch(at)[0], coordinates.P, costs.joints)
        found = np.sum(G**2 * costs.joints[:, None] * costs.columns**2, axis=(1, 2))
        return np.where((over(at) > 0) | ~np.isfinite(found), np.inf, found)

    motions, every, best, values = SelfMotions(task, p, R), np.arange(len(Q)), Q.copy(), least(Q)

    def look(step: float, count: int) -> None:
        line = line_through(motions, best, rng.normal(size=Q.shape), every, step, count)
        at, found, _ = best_of(line, least, over)
        better = found < values
        values[better], best[better] = found[better], at[better]

    for k in range(1 if r == 1 else LINES * r):
        look(STEP if k < LINES else STEP / FINER, round(NEAR / STEP))
    if r == 1:
        look(STEP / FINER, FINER)
    return values


# --- Strategies of different names that are one: the same joint rates at every pose of a workspace.

SPEEDS = 1e-5
"""Relative difference of squared joint speeds up to which two strategies are looked at closely: those of `radial` come
from differences, which are right to 1e-8."""

ALIKE = 1e-6
"""Largest difference of the joint rates of two strategies that are one, over the largest rate: round-off, and no
rule."""


def strategy_of(trial: Trial) -> HolonomicStrategy:
    """The strategy of a trial: its own, or `radial` of the pseudo-inverse round where it begins."""
    return trial.candidate.strategy or radial(moore_penrose(trial.candidate.task), trial.q0)


def distinct(trials: Sequence[Trial]) -> list[Trial]:
    """The trials without those whose strategy is that of an earlier one, whose names that one gets as `same`.

    Two strategies are one if they serve the same poses of the workspace, and their G are equal up to round-off at each.
    """
    found: list[Trial] = []
    gains: dict[str, Array] = {}
    for trial in trials:
        place = next((k for k, one in enumerate(found) if _one_law(one, trial, gains)), None)
        if place is None:
            found.append(trial)
        else:
            first = found[place]
            found[place] = replace(first, same=(*first.same, trial.candidate.name))
    return found


def _one_law(one: Trial, other: Trial, gains: dict[str, Array]) -> bool:
    """Whether two trials are of one strategy."""
    if not one.served.any() or not np.array_equal(one.served, other.served):
        return False
    if not np.allclose(one.speed[one.served], other.speed[one.served], rtol=SPEEDS, atol=0.0):
        return False
    A, B = _gains(one, gains), _gains(other, gains)
    return bool(np.abs(A - B).max() <= ALIKE * np.abs(A).max())


def _gains(trial: Trial, gains: dict[str, Array]) -> Array:
    """G (k, n, m) at the postures of a trial's leaf, kept by its name."""
    name = trial.candidate.name
    if name not in gains:
        gains[name] = np.asarray(strategy_of(trial).gain.batch(trial.q[trial.served])[0])
    return gains[name]


MOST = 3
"""Limits that are named in one sentence."""


def reasons(
    strategies: Sequence[RatedStrategy], found: Coverage, part: Part | None, excess: Excess | None
) -> tuple[str, ...]:
    """The sentences: what the best does and the next does not, why poses are not served, what its speed is due to."""
    best = strategies[0]
    if not best.served.any():
        causes = "; ".join(f"{cause}: {count}" for cause, count in found.causes())
        return (f"No strategy that was tried serves any of the {len(found)} poses. With {best.name!r}, {causes}.",)
    said = [f"Take {best.name!r}: {best.sentence}."]
    if len(strategies) > 1:
        said.append(_next(best, strategies[1]))
    if not best.served.all():
        said.append(_not_served(found, part, best))
    said += _speed(best, excess)
    return tuple(said)


def _next(best: RatedStrategy, other: RatedStrategy) -> str:
    """What speaks against the strategy after the best."""
    if best.coverage > other.coverage + EQUAL:
        return f"Next comes {other.name!r}, which reaches {other.coverage:.1%}."
    if best.clear > other.clear + EQUAL or best.clear == 1 > other.clear:
        rest = 1 - other.clear / other.coverage
        return f"Next comes {other.name!r}, which covers as much, but keeps well clear at {rest:.1%} less of it."
    if best.easy > other.easy + EASY:
        share = 1 - other.easy / other.coverage
        where = f"{share:.1%} of it near limits or singular postures"
        return f"Next comes {other.name!r}, which covers as much, but {where}."
    more = other.squared_speed / best.squared_speed - 1
    needs = f"it needs {more:.1%} more squared joint speed"
    return f"Next comes {other.name!r}: its coverage and margins are as good, but {needs}."


def _not_served(found: Coverage, part: Part | None, best: RatedStrategy) -> str:
    """Why the rest is not served, and what is."""
    rest = [f"{cause}: {count}" for cause, count in found.causes() if cause != "reached"]
    said = f"Of {len(found)} poses {best.name!r} does not serve {int((~best.served).sum())} ({'; '.join(rest)})."
    if part is None:
        return f"{said} No box round the centre was found that a strategy serves from end to end."
    whose = "it serves" if part.strategy.name == best.name else f"{part.strategy.name!r} serves"
    sizes = f"its sizes {part.share:.0%} of those of the workspace"
    return f"{said} The largest part round the centre that {whose} is {part.workspace}, {sizes}."


def _speed(best: RatedStrategy, excess: Excess | None) -> list[str]:
    """What keeps its joint speed above the least."""
    if not np.isfinite(best.speed):
        return ["Its joint speed was not compared."]
    if excess is None:
        least = f"at least {1 / best.speed:.1%} of the mean squared joint speed of {best.name!r}"
        any_strategy = "even a strategy that took the best of the postures found at each pose"
        return [f"Lower bound: {any_strategy} would have {least}."]
    said = [_limits(best, excess.free)]
    if excess.free is not None and excess.free.speed <= 1 + CLOSE:
        return said
    if excess.near > 1 + CLOSE:
        said.append(f"The least lies at other postures of the same tool poses: {_near(excess)}.")
    if excess.rival is not None:
        said.append(_rival(excess.rival))
    elif excess.near > 1 + CLOSE:
        said.append("Of the strategies that were tried none comes closer, also of those that serve less.")
    if best.speed > excess.near + CLOSE:
        clear = "keeping clear and " if np.isfinite(best.clearance) else ""
        said.append(f"The rest is what {clear}one smooth strategy for all poses needs, as far as those tried tell.")
    return said


def _near(excess: Excess) -> str:
    """How close to the least a strategy near the postures of the best may come."""
    which = f"this one's postures ({NEAR:g} rad of self-motion)"
    least = f"to the least than {excess.near - 1:.1%}"
    if excess.traced:
        return f"no strategy within the joint limits that stays near {which} comes closer {least}"
    return f"a search within the joint limits near {which} came no closer {least}"


def _limits(best: RatedStrategy, free: Free | None) -> str:
    """What the joint limits near its postures cost."""
    if free is None:
        return "Joint limits near its postures are not the reason: it keeps away from them."
    aside = f"the same strategy designed without limits is {free.speed - 1:.1%} above the least"
    beyond = _beyond(free.beyond, f" of {free.poses}")
    if free.speed <= 1 + CLOSE:
        return f"Joint limits keep it from the least: {aside}, but {beyond}."
    if free.speed < best.speed - CLOSE / 2 and free.beyond:
        return f"Joint limits are part of the reason: {aside}, but {beyond}."
    return f"Joint limits near its postures are not the reason: {aside}."


def _rival(rival: Rival) -> str:
    """What keeps a strategy that is closer to the least from being the best."""
    why = [_beyond(rival.beyond)] if rival.beyond else []
    why += [f"its leaf ends before {rival.ends} poses"] if rival.ends else []
    return (
        f"Closer to the least comes {rival.name!r}, {rival.speed - 1:.1%} above it where it serves; but it serves only "
        f"{rival.coverage:.1%}: {' and '.join(why) or 'it comes too near to limits or singular postures'}."
    )


def _beyond(beyond: Beyond, of: str = "") -> str:
    """Which limits are exceeded, and at how many poses; the three that are most often."""
    said = [f"{joint} is beyond its {side} limit at {count}" for joint, side, count in beyond[:MOST]]
    return f"{', '.join(said)}{of} poses" if said else "within its limits all the same"
