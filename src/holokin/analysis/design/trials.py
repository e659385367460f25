"""Advice on strategies: what each does on trial at many poses, which are the same, which is best, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, TypeVar

import numpy as np

from ...base.types import Absent, Array, Flags, Indices, Matrix, NoTruthValue, Result, Value, Vector, plain_data
from ...motion.checks import Clearances, PairDistance, Scene
from ...motion.checks.check_report import keeps
from ...motion.ik.closed_leaf import leaf_class
from ...path.workspaces import Box, PoseRange, Workspace
from ...robot.closed_form import ArmClass
from ...strategies import HolonomicStrategy, moore_penrose, radial
from ...strategies.tasks.task import Task
from ..coverage.cover_workspace import Coverage
from ..coverage.leaf_lines import along_leaf, along_radial
from ..coverage.pose_coordinates import Coordinates
from ..coverage.starts import Candidate, kinds_that_fit
from ..coverage.tool_chain import Chain
from .least_costs import least_slopes
from .nearby_cusps import LevelRange, NearbyCusps
from .objectives import Costs
from .served_curves import EASY, EQUAL, ROOM, Leaf

PROVABLE = 0.01
"""Clearance [m] beyond that asked for from which on a posture keeps well clear: what `certify` proves of a Panda was a
centimetre less than the least at many poses."""

DEARER = 1.3
"""Mean squared joint speed, over that of the fastest of strategies alike, up to which one that is proven on the whole
arm, or of which something can be proven, comes first: 14 % of speed."""


Entry = TypeVar("Entry", "Leaf", "Trial", "RatedStrategy")


def ranked(entries: Iterable[Entry]) -> list[Entry]:
    """The best first: by coverage; of those that cover alike, by the share that is served well clear of what stands
    round; of those alike in this, too, by the share that is served away from limits and singular postures; of those
    alike in all this by joint speed, but first those that are proven on the whole arm and not much slower, then those
    of which a region or a path can be proven.
    """
    groups = [list(entries)]
    for share, tolerance in _SHARES:
        groups = [part for group in groups for part in _alike(group, share, tolerance)]
    return [entry for group in groups for entry in _by_speed(group)]


def _by_speed(entries: list[Entry]) -> list[Entry]:
    """The fastest first, but before it those that are proven, or can be, and not much slower."""
    least = min(entry.squared_speed for entry in entries)

    def rank(entry: Entry) -> tuple[bool, bool, float]:
        slow = entry.squared_speed > DEARER * least
        return slow or not is_proven(entry), slow or not _is_provable(entry), entry.squared_speed

    return sorted(entries, key=rank)


def is_proven(entry: Leaf | Trial | RatedStrategy) -> bool:
    """Whether a strategy is one function of the tool pose on the whole arm, proven by the signs of its closed form."""
    strategy = _strategy(entry)
    found = None if strategy is None else leaf_class(strategy)
    return isinstance(found, ArmClass) and found.proven


def _is_provable(entry: Leaf | Trial | RatedStrategy) -> bool:
    """Whether a region or a path can be proven of a strategy: its constraint is a formula, not a computation."""
    strategy = _strategy(entry)
    return strategy is not None and strategy.constraint.looped is None


def _strategy(entry: Leaf | Trial | RatedStrategy) -> HolonomicStrategy | None:
    return entry.strategy if isinstance(entry, RatedStrategy) else entry.candidate.strategy


def alike(a: Trial | RatedStrategy, b: Trial | RatedStrategy) -> bool:
    """Whether two cover alike, and serve alike shares well clear, and away from limits and singular postures."""
    return all(abs(share(a) - share(b)) <= tolerance for share, tolerance in _SHARES)


def _clear(entry: Trial | RatedStrategy) -> float:
    """The share that is well clear, and more where it is all: what is not clear somewhere cannot be proven."""
    return entry.clear if entry.clear < 1 else 1 + 2 * EQUAL


_SHARES: tuple[tuple[Callable[[Any], float], float], ...] = (
    (lambda entry: entry.coverage, EQUAL),
    (_clear, EQUAL),
    (lambda entry: entry.easy, EASY),
)
"""What strategies are ranked by before joint speed, and the difference up to which they are alike in it."""


def _alike(entries: list[Entry], share: Callable[[Entry], float], tolerance: float) -> Iterator[list[Entry]]:
    """Groups of entries whose shares are nearly those of the best in them, the best first."""
    while entries:
        least = max(map(share, entries)) - tolerance
        yield [entry for entry in entries if share(entry) >= least]
        entries = [entry for entry in entries if share(entry) < least]


def more_speed(ratio: float) -> str:
    """A ratio of joint speeds in words: "14% more joint speed than"."""
    if abs(ratio - 1) < 0.005:
        return "no more joint speed than"
    if ratio > 2:
        return f"{ratio:.1f} times as much joint speed as"
    return f"{abs(ratio - 1):.0%} {'more' if ratio > 1 else 'less'} joint speed than"


@dataclass(frozen=True, eq=False)
class RatedStrategy(Result, Value):
    """A strategy on one leaf, and what it does in the workspace.

    same: names of strategies that are this one there: their G is the same at every pose. keys: what a job file says of
    it. q0: the posture that its leaf goes through (n,). coverage: share of the poses that it reaches within the joint
    limits, `served` (k,); easy: of these, those away from limits and singular postures. margin: the least distance to
    a limit over the joint's range, of `joint`; inf without limits. rcond: the least of [J; J_g]; NaN where it was not
    looked at. squared_speed: mean squared joint speed [rad^2/m^2]; speed: the root of that over the least of the
    postures found there, within the limits. clearance: the least distance of two shapes [m] at the poses that it
    serves, less what links are padded; inf where nothing was asked of it; closest: the two shapes, and where that is.
    clear: share of the poses that are served with 0.01 m more of it than was asked for.
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
    closest: PairDistance | None = None
    clear: float = 1.0

    @property
    def sentence(self) -> str:
        """What it does, in words."""
        facts = [f"it serves {self.coverage:.1%} of the workspace within the joint limits"]
        if not self.served.any():
            return facts[0]
        if np.isfinite(self.margin):
            facts.append(f"{self.joint} is the joint nearest to a limit, with {self.margin:.1%} of its range left")
        if self.closest is not None:
            facts.append(f"{self.closest} at its nearest")
        if np.isfinite(self.speed):
            facts.append(f"it needs {more_speed(self.speed)} the least possible there")
        return ", ".join([*facts[:-1], f"and {facts[-1]}"]) if len(facts) > 1 else facts[0]

    def __str__(self) -> str:
        return f"{self.name}: {self.sentence}"


@dataclass(frozen=True, eq=False)
class Part(Result, Value):
    """The largest part of a workspace, round its centre, that one strategy serves: `share` of its sizes."""

    strategy: RatedStrategy
    share: float
    workspace: PoseRange

    def __str__(self) -> str:
        return f"{self.strategy.name!r} serves {self.workspace}, its sizes {self.share:.0%} of those of the workspace"


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
        return "\n".join([*self.reasons, *filter(None, [self.certify_by]), self.subject])

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
        name = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}.get(tuple(np.asarray(axis).tolist()))
        about = f"its {name} axis" if name else f"the axis [{', '.join(f'{v:.4g}' for v in axis)}] of its frame"
        return f"{self.task.name}, the tool free to spin about {about}"

    @property
    def offers(self) -> str:
        """Which tasks there are for this robot, in words; empty where the task is the whole pose, or was given."""
        kinds = kinds_that_fit(self.task.robot)
        if "task" not in self.proposed or "pose" in kinds or not kinds:
            return ""
        meanings = {
            "axis": "'axis' holds the tool's point and the direction of its z axis, as for a torch",
            "position": "'position' holds the tool's point",
        }
        few = f"{self.task.n} joints leave none free for a whole pose ('pose')"
        return f"{few}; of the other tasks {', '.join(meanings[kind] for kind in kinds)}"

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        names = "name same coverage joint margin rcond squared_speed speed clearance clear"
        strategies = [
            {name: getattr(rated, name) for name in names.split()} | {"start": rated.q0} for rated in self.strategies
        ]
        facts = {
            "robot": self.task.robot.name,
            "base": self.chain.base,
            "tip": self.chain.tip,
            "other_tips": self.chain.others,
            "task": self.task.name,
            "workspace": str(self.workspace),
            "cusp_distance": self.cusps.away,
            "levels": None if self.levels is None else self.levels.intervals,
            "floor": self.floor,
            "proposed": self.proposed,
            "reasons": self.reasons,
            "strategies": strategies,
        }
        return plain_data(facts)


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
        # Where rcond is 0.01 joints are a hundred times as fast; of radial it is not known
        away = (self.margins.min(axis=1) >= ROOM) & ~(self.rcond < 0.01)
        return float(np.mean(self.served & away))

    @property
    def clear(self) -> float:
        """Share of the poses that are served with a clearance that can be proven; 1 where none is asked for."""
        return clear_share(self.served, self.clearance, self.wanted)

    @cached_property
    def margins(self) -> Matrix:
        """Distance to the nearer limit over the joint's range (k, n), negative beyond it; inf without limits."""
        robot = self.candidate.task.robot
        margins, spans = np.minimum(self.q - robot.lower, robot.upper - self.q), robot.upper - robot.lower
        return np.divide(margins, spans, out=np.full_like(margins, np.inf), where=np.isfinite(spans))

    @property
    def squared_speed(self) -> float:
        """Mean squared joint speed where it serves; infinite where it does not."""
        return float(self.speed[self.served].mean()) if self.served.any() else np.inf


def tried(candidate: Candidate, starts: Matrix, poses: Poses) -> list[Trial]:
    """A trial from each of the starts (s, n) that the strategy can begin at."""
    task, strategy, apart = candidate.task, candidate.strategy, poses.apart
    if strategy is not None and candidate.level is not None:
        starts = _on_leaf(task, strategy, starts, candidate.level)
    if not len(starts):
        return []
    # Lines from each start to each pose, with the squared joint speed and the rcond at their ends
    if strategy is None:
        ends = along_radial(task, starts, poses.T)
        speeds, rcond = _radial_speeds(task, starts, poses), np.full(ends.share.shape, np.nan)
    else:
        ends = along_leaf(strategy, starts, poses.T, first=0.5)
        G, rcond, _ = strategy.gain.batch(ends.q.reshape(-1, task.n))
        speeds, rcond = poses.squared_speed(G.reshape(*ends.q.shape, task.m)), rcond.reshape(ends.share.shape)
    # Which poses are served: within the joint limits, and, where it is asked for, with the clearance
    served = ends.reached & task.robot.within(ends.q.reshape(-1, task.n)).reshape(rcond.shape) & np.isfinite(speeds)
    speeds, trials = np.where(ends.reached, speeds, np.nan), []
    for q0, q, reached, serves, speed, sound in zip(starts, ends.q, ends.reached, served, speeds, rcond, strict=True):
        clearance, wanted = None, 0.0
        if apart is not None:
            clearance, wanted = np.full(len(q), np.nan), apart.wanted
            clearance[serves] = apart.least(q[serves], wanted)
            serves = serves & keeps(clearance, wanted)
        trials.append(Trial(candidate, q0, q, reached, serves, speed, sound, (), clearance, wanted))
    return trials


def clear_share(served: Flags, clearance: Vector | None, wanted: float) -> float:
    """Share of the poses (k,) that are served with `PROVABLE` more clearance than is wanted [m]; 1 without any."""
    return 1.0 if clearance is None else float(np.mean(served & (clearance >= wanted + PROVABLE)))


def _on_leaf(task: Task, strategy: HolonomicStrategy, starts: Matrix, level: float) -> Matrix:
    """Those starts, moved by self-motion to the leaf of a level, that get there within the joint limits."""
    levels = np.full(task.n - task.m, level)
    ends = [along_leaf(strategy, q[None], task.pose(q)[None], levels) for q in starts]
    Q = np.array([end.q[0, 0] for end in ends if end.reached[0, 0]]).reshape(-1, task.n)
    return Q[task.robot.within(Q)]


def _radial_speeds(task: Task, starts: Matrix, poses: Poses) -> Matrix:
    """The squared speed (s, k) by central differences of where the lines end.

    Half of a step is 1e-4 m or rad: its error is 1e-8, that of round-off, too.
    """
    from scipy.spatial.transform import Rotation

    speeds, h = np.zeros((len(starts), len(poses))), 1e-4
    for j in range(poses.twists.shape[2]):
        twists = np.zeros((len(poses), 6))
        twists[:, list(task.rows)] = np.nan_to_num(poses.twists[:, :, j])
        ends = []
        for step in (h, -h):
            moved = poses.T.copy()
            moved[:, :3, 3] += step * twists[:, :3]
            moved[:, :3, :3] = Rotation.from_rotvec(step * twists[:, 3:]).as_matrix() @ moved[:, :3, :3]
            ends.append(along_radial(task, starts, moved).q)
        speeds += np.sum(poses.weights * ((ends[0] - ends[1]) / (2 * h)) ** 2, axis=2)
    return speeds


# --- Strategies of different names that are one: the same joint rates at every pose of a workspace.


def strategy_of(trial: Trial) -> HolonomicStrategy:
    """The strategy of a trial: its own, or `radial` of the pseudo-inverse round where it begins."""
    return trial.candidate.strategy or radial(moore_penrose(trial.candidate.task), trial.q0)


def distinct(trials: Sequence[Trial]) -> list[Trial]:
    """The trials without those whose strategy is that of an earlier one, whose names that one gets as `same`.

    Two strategies are one if they serve the same poses of the workspace, and their G are equal up to round-off at each.
    """

    @cache
    def gains(i: int) -> Array:
        """G (k, n, m) at the postures that a trial serves."""
        return np.asarray(strategy_of(trials[i]).gain.batch(trials[i].q[trials[i].served])[0])

    def same(i: int, j: int) -> bool:
        a, b = trials[i], trials[j]
        if not a.served.any() or not np.array_equal(a.served, b.served):
            return False
        # Speeds of `radial` come from differences, which are right to 1e-8; gains that are equal differ by round-off
        if not np.allclose(a.speed[a.served], b.speed[a.served], rtol=1e-5, atol=0.0):
            return False
        return bool(np.abs(gains(i) - gains(j)).max() <= 1e-6 * np.abs(gains(i)).max())

    first: dict[int, list[str]] = {}
    for j, trial in enumerate(trials):
        names = next((names for i, names in first.items() if same(i, j)), None)
        if names is None:
            first[j] = []
        else:
            names.append(trial.candidate.name)
    return [replace(trials[i], same=(*trials[i].same, *names)) for i, names in first.items()]


def ratio(trial: Trial, floor: Vector) -> float:
    """The root mean square joint speed of a strategy over that of the least squares (k,), where it serves."""
    known = trial.served & np.isfinite(trial.speed) & np.isfinite(floor)
    return float(np.sqrt(trial.speed[known].mean() / floor[known].mean())) if known.any() else np.nan
