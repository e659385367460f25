"""A job of several paths: a posture for each of them, their order, and the ways through the air between them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise
from pathlib import Path as FilePath

import numpy as np

from ...analysis.coverage.starts import postures_at
from ...base.errors import ArgumentError, BranchError, HolokinError, JobError, PathError, SingularityError
from ...base.poses import pose_from
from ...base.types import Array, Indices, Matrix, Value, Vector
from ...motion import TimedTrajectory, follow
from ...motion.checks import CheckReport, Clearances, check
from ...motion.follow_path import recorded
from ...motion.ik import all_postures
from ...motion.ik.leaf import leaf_value, with_leaves
from ...motion.self_motions.self_motions import self_motions_at
from ...motion.timed_trajectory import with_entry
from ...motion.trajectory import Status, Trajectory
from ...path import Path, line_segment, polyline
from ...path.path import straight
from ...strategies import HolonomicStrategy
from ...strategies.self_motion_curves import joint_gap
from ...strategies.tasks.task import Task
from ..report.job_result import NotRun
from ..report.paths_result import PathRow, PathsResult, RuleResult
from .job_parts import build_begin, build_each, build_robot, build_strategy, build_tasks, naming, reason
from .path_order import Choices, best_sequence, least_pool
from .schema import Job
from .strategy_tables import ConstraintTable
from .tables import AirTable, NamedPathTable, TimingTable

LEVELS = 12
"""Levels of a rule that are tried besides that of the start, where that one does not serve all paths."""

TRIAL_SAMPLES = 100
"""Samples of a path at which a posture to begin with is tried out; the chosen one is followed and checked in full."""

CLEARANCE_SAMPLES = 34
"""Samples of these at which shapes are held apart."""

BRIDGE_SAMPLES = 60
"""Steps of the straight way of the tool by which two postures are found to be on one sheet."""

SAME_POSTURE = 1e-4
"""Difference of joints [rad or m] up to which two postures are one: what following leaves."""

NO_MOTION = 1e-9
"""Way of the joints [rad or m] that is none."""

AIR_STEP = 0.03
"""Step of the fastest joint [rad or m] at which ways through the air are tried out; timed ones are checked in full."""

REPLANS = 60
"""How often a plan is made anew, after a part of it was found to be blocked."""

PATH_ERRORS = (PathError, SingularityError)
"""What one path may meet where the others do not; anything else is a mistake in the job."""

ONE_TOOL = "several paths are for a task of one tool; give a job with one [path]"


@dataclass(frozen=True, eq=False)
class AirMove(Value):
    """The way to the start of a path, or back: how it goes, in timed legs from rest to rest, and what checks find.

    timed: all legs together; None where nothing moves.
    """

    by: str
    legs: tuple[TimedTrajectory, ...]
    timed: TimedTrajectory | None = None
    report: CheckReport | None = None


@dataclass(frozen=True, eq=False)
class PlannedPath(Value):
    """A path that is gone along: its table, the rule and the level, the sheet by its number, the way to it."""

    table: NamedPathTable
    path: Path
    strategy: HolonomicStrategy
    level: Vector
    sheet: int
    air: AirMove
    timed: TimedTrajectory
    report: CheckReport | None = None

    @property
    def name(self) -> str:
        """As it stands in the job."""
        return self.table.name


@dataclass(frozen=True, eq=False)
class PathsPlan(Value):
    """All paths of a job by one rule, in their order, and the way home; and those that cannot be gone along, with why.

    changes: how often the sheet changes from one path to the next. exact: whether no order, of those that were asked
    for, has fewer, or as few and less time in the air. candidates: postures that were found, at so many `levels`;
    `compared` of them for the time, those on the fewest sheets.
    """

    name: str
    paths: tuple[PlannedPath, ...]
    home: AirMove | None
    left_out: dict[str, str]
    changes: int
    exact: bool
    any_order: bool
    candidates: int
    levels: int
    compared: int

    @property
    def stages(self) -> list[tuple[str, TimedTrajectory, CheckReport | None]]:
        """(what is done, its motion, what checks find) one after the other."""
        rows: list[tuple[str, TimedTrajectory, CheckReport | None]] = []
        for each in self.paths:
            rows += [] if each.air.timed is None else [(f"to {each.name}", each.air.timed, each.air.report)]
            rows.append((each.name, each.timed, each.report))
        if self.home is None or self.home.timed is None:
            return rows
        return [*rows, ("home", self.home.timed, self.home.report)]

    @property
    def timed(self) -> TimedTrajectory:
        """The whole motion, with rests between its parts."""
        *before, whole = [timed for _, timed, _ in self.stages]
        for stage in reversed(before):
            whole = replace(with_entry(stage, whole), begin=0)
        return whole

    @property
    def passed(self) -> bool:
        """Whether every path is gone along, and the checks find nothing."""
        return not self.left_out and all(report is None or report.passed for _, _, report in self.stages)

    @property
    def sentence(self) -> str:
        """The changes of sheet, and in which sense they are the fewest."""
        sheets = len({each.sheet for each in self.paths})
        on = "All paths are on one sheet" if sheets == 1 else f"The paths are on {sheets} sheets"
        times = "1 time" if self.changes == 1 else f"{self.changes} times"
        changes = on if self.changes == 0 else f"{on}, and the sheet changes {times}"
        of = f"among {self.candidates} postures at {self.levels} level{'s' * (self.levels != 1)}"
        if not self.exact:
            return f"{changes}; the order was improved by exchanges, {of}: a better one may exist"
        order = "any" if self.any_order else "this"
        which = "of these" if self.compared == self.candidates else f"of {self.compared} of these"
        return f"{changes}, the fewest in {order} order, {of}; then the time in the air is the least {which}"


@dataclass(frozen=True, eq=False)
class _Candidate(Value):
    """A posture at which a path may begin, and the motion that follows from it, at a few samples."""

    path: int
    level: Vector
    level_number: int
    walk: Trajectory


Way = tuple[str, list[Matrix | Trajectory]]
"""How a way through the air goes, in words, and its legs: lines of the joints (2, n), and motions up and down."""


@dataclass(eq=False)
class _Search:
    """The search for a plan of one rule: what is given, and what has been found so far."""

    job: Job
    tables: Sequence[NamedPathTable]
    strategies: Sequence[HolonomicStrategy]
    paths: Sequence[Path]
    start: Vector
    timing: TimingTable
    air: AirTable
    via: Sequence[Vector]
    clear: Clearances | None
    beyond: set[int] = field(default_factory=set)
    candidates: list[_Candidate] = field(default_factory=list)
    labels: Indices = field(default_factory=lambda: np.zeros(0, dtype=int))
    reasons: dict[int, str] = field(default_factory=dict)
    bridges: dict[tuple[int, int], list[Vector]] = field(default_factory=dict)
    lifts: dict[tuple[int, int], Trajectory | None] = field(default_factory=dict)
    air_moves: dict[tuple[int, int, str], AirMove] = field(default_factory=dict)
    motions: dict[int, tuple[TimedTrajectory, CheckReport | None] | None] = field(default_factory=dict)
    ways_found: dict[tuple[int, int], Way] = field(default_factory=dict)
    blocked: set[tuple[int, int, str]] = field(default_factory=set)

    # --- Postures at which the paths may begin.

    def add_level(self, number: int, levels: Sequence[Vector]) -> None:
        """The postures of a level from which whole paths can be followed, within the limits and clear."""
        for i, (strategy, path) in enumerate(zip(self.strategies, self.paths, strict=True)):
            pose = pose_from(path.start, path.rotation if path.rotation is not None else np.eye(3))
            postures = all_postures(strategy, pose, levels[i], near=self.start).q
            if not len(postures):
                where = f"no posture within the limits has the tool at its start, {_typed(path.start)}"
                self.reasons.setdefault(i, where)
            # Where a path ends at a limit, other whole turns may leave more room.
            middle: Matrix | None = None
            for q in sorted(postures, key=lambda q: float(np.abs(q - self.start).max())):
                walk = self._followed(i, q)
                if walk is not None and walk.status is Status.LIMIT:
                    middle = all_postures(strategy, pose, levels[i]).q if middle is None else middle
                    turned = [
                        other
                        for other in middle
                        if np.abs(q - other).max() > SAME_POSTURE and self._gap(q, other) < SAME_POSTURE
                    ]
                    walk = next((w for other in turned if (w := self._followed(i, other)) is not None), None)
                if walk is not None and walk.status is Status.COMPLETE:
                    self.candidates.append(_Candidate(i, levels[i], number, walk))

    def _followed(self, i: int, q: Vector) -> Trajectory | None:
        """The motion along a path from a posture, up to where it ends; None, with the reason kept, where it may not be.

        It may end at a limit of a joint.
        """
        strategy, checks = self.strategies[i], self.job.checks
        if self.clear is not None and not self.clear.clear(q[None])[0]:
            self.reasons.setdefault(i, f"{self.clear.touching(q[None])[0]} are too near at its start")
            return None
        samples = min(TRIAL_SAMPLES, self.tables[i].samples)
        try:
            walk = follow(strategy, self.paths[i], q, samples=samples, native=True)
        except (PathError, SingularityError) as problem:
            self.reasons.setdefault(i, str(problem).rpartition("; ")[0])
            ended = problem.trajectory if isinstance(problem, PathError) else None
            return ended if ended is not None and ended.status is Status.LIMIT else None
        if checks is not None:
            J = strategy.task.jacobian_batch(walk.q)[0]
            values = np.linalg.svd(J, compute_uv=False)
            if (values[:, -1] < checks.rcond * values[:, 0]).any():
                self.reasons.setdefault(i, "it leads through a singular posture")
                return None
        checked = np.unique(np.linspace(0, len(walk) - 1, CLEARANCE_SAMPLES).astype(int))
        if self.clear is not None and not (free := self.clear.clear(walk.q[checked])).all():
            k = int(checked[np.argmin(free)])
            self.reasons.setdefault(
                i, f"{self.clear.touching(walk.q[k : k + 1])[0]} are too near, {walk.t[k]:.3g} s along it"
            )
            return None
        return walk

    def more_levels(self) -> list[Vector]:
        """Levels spread over those of postures at the starts of the paths: of all of them for a rule with one row, else
        of some that are far from each other."""
        rows = self.strategies[0].constraint.rows
        values = []
        for i, (strategy, path) in enumerate(zip(self.strategies, self.paths, strict=True) if rows else ()):
            pose = pose_from(path.start, path.rotation if path.rotation is not None else np.eye(3))
            if rows > 1:
                q = postures_at(strategy.task, pose)
                where = "no posture within the limits was found with the tool at its start"
            else:
                q = self_motions_at(strategy.task, path.start[None], pose[None, :3, :3]).q
                where = f"its start, {_typed(path.start)}, is out of reach"
            if not len(q):
                self.beyond.add(i)
                self.reasons[i] = where
                continue
            q = q[strategy.task.robot.beyond(q).max(axis=1) <= 0]
            values.append(np.reshape(strategy.constraint_value.batch(q), (len(q), rows)) if len(q) else q[:, :rows])
        every = np.vstack([np.zeros((0, rows)), *values])
        if not len(every):
            return []
        if rows == 1:
            return list(np.quantile(every, np.linspace(0.02, 0.98, LEVELS))[:, None])
        # The one nearest to the middle, then each time the one that is farthest from those before.
        scaled = (every - every.mean(axis=0)) / np.maximum(every.std(axis=0), SAME_POSTURE)
        chosen = [int(np.linalg.norm(scaled, axis=1).argmin())]
        while len(chosen) < min(LEVELS, len(every)):
            chosen.append(int(np.min([np.linalg.norm(scaled - scaled[k], axis=1) for k in chosen], axis=0).argmax()))
        return list(every[chosen])

    def sheets(self) -> Indices:
        """A number of the sheet of each candidate (k,).

        Two postures are on one sheet where the rule, on a straight way of the tool from the start of one path to that
        of the other, directly or over the retract height, leads from one to the other.
        """
        if len(self.labels) == len(self.candidates):
            return self.labels
        label = np.arange(len(self.candidates))
        starts = [path.start for path in self.paths]
        pairs = sorted(
            combinations(range(len(starts)), 2), key=lambda ij: np.linalg.norm(starts[ij[0]] - starts[ij[1]])
        )
        for i, j in pairs:
            for a, b in ((i, j), (j, i)):
                for k in [k for k, c in enumerate(self.candidates) if c.path == a]:
                    others = [m for m, c in enumerate(self.candidates) if c.path == b]
                    others = [m for m in others if self.candidates[m].level_number == self.candidates[k].level_number]
                    if not others or any(label[m] == label[k] for m in others):
                        continue
                    if (k, b) not in self.bridges:
                        self.bridges[k, b] = self._bridged(k, b)
                    reached = self.bridges[k, b]
                    for m in others:
                        if any(self._gap(q, self.candidates[m].walk.q[0]) < SAME_POSTURE for q in reached):
                            label[label == label[m]] = label[k]
        self.labels = np.unique(label, return_inverse=True)[1]
        return self.labels

    @property
    def reachable(self) -> int:
        """How many paths have a posture at their start at all, as far as was levels_tried at."""
        return len(self.paths) - len(self.beyond)

    def one_sheet(self, level: int) -> bool:
        """Whether some sheet of a level serves all paths."""
        members = [i for i, c in enumerate(self.candidates) if c.level_number == level]
        sheet, path = self.sheets()[members], np.array([self.candidates[i].path for i in members])
        return any(len(set(path[sheet == number])) == self.reachable for number in set(sheet.tolist()))

    def _gap(self, q: Vector, other: Vector) -> float:
        return float(np.abs(joint_gap(self.strategies[0].task.robot, q, other)).max())

    def _bridged(self, k: int, b: int) -> list[Vector]:
        """Postures at the start of path b to which straight ways of the tool lead from the start of a candidate."""
        candidate = self.candidates[k]
        strategy, goal = self.strategies[candidate.path], self.paths[b]
        if strategy.task.robot is not self.strategies[b].task.robot:
            return []  # another tool: its poses are others
        p, R = _place(strategy.task, candidate.walk.q[0])
        R_goal = goal.rotation if goal.rotation is not None else R
        up = np.array([0.0, 0.0, self.air.height])
        reached = []
        for points in ((p, goal.start), (p, p + up, goal.start + up, goal.start)):
            turn = straight(p, R, goal.start, R_goal).turn
            turns = [turn if i == (len(points) - 1) // 2 else np.zeros(3) for i in range(len(points) - 1)]
            segments = tuple(line_segment(x, y, w) for (x, y), w in zip(pairwise(points), turns, strict=True))
            try:
                walk = follow(
                    strategy,
                    Path(segments, rotation=R),
                    candidate.walk.q[0],
                    samples=BRIDGE_SAMPLES,
                    limits=False,
                    native=True,
                )
            except (PathError, SingularityError):
                continue
            reached.append(walk.q[-1])
            break
        return reached

    # --- Ways through the air.

    def least_seconds(self, A: Matrix, B: Matrix) -> Array:
        """Seconds of straight ways of the joints at their limits of speed and acceleration: no way is faster."""
        way = np.abs(A[:, None] - B[None])
        v = self.timing.velocity if self.timing.velocity is not None else self.strategies[0].task.robot.max_velocity
        a = self.timing.acceleration if self.timing.acceleration is not None else np.inf
        v, a = np.broadcast_to(v, way.shape), np.broadcast_to(a, way.shape)
        ramps = v / a
        short = way <= v * ramps
        return np.where(short, 2 * np.sqrt(way / a), way / v + ramps).max(axis=2)

    def way(self, a: int, b: int) -> Way | None:
        """The first clear way from the end of one candidate to the start of another; -1 is where the job begins."""
        known = self.ways_found.get((a, b))
        if known is not None and (a, b, known[0]) not in self.blocked:
            return known
        for by, legs in self._possible(a, b):
            if (a, b, by) not in self.blocked and self._is_clear(a, b, by, legs):
                self.ways_found[a, b] = by, legs
                return by, legs
        return None

    def _possible(self, a: int, b: int) -> Iterator[Way]:
        """Ways from the simplest on: straight in the joints, over the retract height, by way of postures."""
        first, last = (self.start if k < 0 else self.candidates[k].walk.q[end] for k, end in ((a, -1), (b, 0)))
        yield "straight in the joints", [np.array([first, last])]
        lift, lower = self._lifted(a, -1), self._lifted(b, 0)
        up, down = ([] if leg is None else [leg] for leg in (lift, lower))
        top, above = first if lift is None else lift.q[-1], last if lower is None else lower.q[0]
        if up or down:
            yield f"over a height of {self.air.height:g} m", [*up, np.array([top, above]), *down]
        for number, q in enumerate(self.via, 1):
            yield f"by way of posture {number}", [*up, np.array([top, q]), np.array([q, above]), *down]
        if len(self.via) > 1:
            stops = [top, *self.via, above]
            yield "by way of all postures", [*up, *(np.array(pair) for pair in pairwise(stops)), *down]

    def _lifted(self, k: int, end: int) -> Trajectory | None:
        """From the end of a candidate up (end -1), or down to its start (end 0); None where that does not lead."""
        if k >= 0 and (k, end) not in self.lifts:
            self.lifts[k, end] = self._lift(k, end)
        return self.lifts.get((k, end))

    def _lift(self, k: int, end: int) -> Trajectory | None:
        candidate = self.candidates[k]
        strategy, q = self.strategies[candidate.path], candidate.walk.q[end]
        p, R = _place(strategy.task, q)
        line = replace(polyline([p, p + [0, 0, self.air.height]], speed=self.air.height_speed), rotation=R)
        try:
            walk = follow(strategy, line, q, samples=TRIAL_SAMPLES // 4, native=True)
            if np.abs(walk.q - q).max() < NO_MOTION:  # of a task without height
                return None
            return (
                walk if end else follow(strategy, line.reversed(), walk.q[-1], samples=TRIAL_SAMPLES // 4, native=True)
            )
        except (PathError, SingularityError):
            return None

    def _is_clear(self, a: int, b: int, by: str, legs: Sequence[Matrix | Trajectory]) -> bool:
        """Whether a way is clear at steps of `AIR_STEP`; what was found to be blocked is not asked again."""
        if self.clear is None:
            return True
        Q = []
        for leg in legs:
            q = leg.q if isinstance(leg, Trajectory) else leg
            steps = [max(2, int(np.ceil(np.abs(y - x).max() / AIR_STEP)) + 1) for x, y in pairwise(q)]
            Q += [x + np.linspace(0, 1, n)[:, None] * (y - x) for (x, y), n in zip(pairwise(q), steps, strict=True)]
        if bool(self.clear.clear(np.vstack(Q)).all()):
            return True
        self.blocked.add((a, b, by))
        return False

    def timed_leg(self, leg: Matrix | Trajectory, task: Task) -> TimedTrajectory | None:
        """A leg within the limits; straight ones as fast as these allow. None where nothing moves."""
        table = self.timing.model_copy(update={"endless": False, "speed": 1.0})
        if isinstance(leg, Trajectory):
            return table.timed(leg)
        if np.abs(leg[1] - leg[0]).max() < NO_MOTION:
            return None
        q = leg[0] + np.linspace(0.0, 1.0, 51)[:, None] * (leg[1] - leg[0])
        return table.model_copy(update={"speed": "fastest"}).timed(recorded(task, q, 1.0))

    def seconds(self, way: Way) -> float:
        """What a way takes: of straight legs the bound, of retracts the time at their speed."""
        total = 0.0
        for leg in way[1]:
            total += (
                float(leg.t[-1]) if isinstance(leg, Trajectory) else float(self.least_seconds(leg[:1], leg[1:])[0, 0])
            )
        return total


def _place(task: Task, q: Vector) -> tuple[Vector, Matrix]:
    T = task.pose(q)
    return T[:3, 3], T[:3, :3]


def _typed(point: Vector) -> str:
    return "[" + ", ".join(f"{x:.4g}" for x in point) + "]"


def plan_paths(
    job: Job, file: FilePath, label: str, progress: Callable[[str], None] = lambda _text: None,
    timing: TimingTable | None = None,
) -> PathsPlan:  # fmt: skip
    """The plan of a job of several paths by one of its strategies.

    Args:
        label: the strategy's name in the job. progress: hears what is going on. timing: in place of the job's.

    Raises:
        JobError, ArgumentError: bad input. BranchError: no path can be gone along.
    """
    search = _search_of(job, file, label, timing or job.timing or TimingTable(profile="quintic"))
    table, strategies = job.strategies[label], search.strategies
    start_levels = [leaf_value(s, build_begin(table, s, search.start)[0]) for s in strategies]
    # Postures on the level of the start; on others where it does not serve all paths from one sheet.
    progress(f"{label}: postures of {len(search.paths)} paths")
    search.add_level(0, start_levels)
    given, fixed = search.air.order == "given", isinstance(table, ConstraintTable) and table.level is not None
    levels = iter(()) if fixed else enumerate(search.more_levels(), 1)
    levels_tried = 1

    def next_plan() -> _Order | None:
        """The best plan; while sheets change on it, or paths are missing, more levels are looked at."""
        nonlocal levels_tried
        plan = _best_order(search, given)
        for number, level in levels:
            if plan is not None and plan.changes == 0 and len(plan.order) == search.reachable:
                break
            progress(f"{label}: level {number} of {LEVELS}")
            search.add_level(number, [level] * len(strategies))
            levels_tried += 1
            if search.one_sheet(number) or number == LEVELS:
                plan = _best_order(search, given)
        return plan

    plan = next_plan()
    # The plan in full: timed and checked; what is blocked is left aside, and planned anew.
    for _ in range(REPLANS):
        if plan is None:
            break
        progress(f"{label}: timing and checks, {len(plan.order)} paths")
        timed_plan = _timed_plan(search, plan)
        if timed_plan is not None:
            paths, home = timed_plan
            on = {each.table.name for each in paths}
            left = {t.name: search.reasons.get(i, "no way") for i, t in enumerate(search.tables) if t.name not in on}
            counts = plan.changes, plan.exact, not given, len(search.candidates), levels_tried, plan.compared
            return PathsPlan(label, tuple(paths), home, left, *counts)
        plan = next_plan()
    reasons = "; ".join(f"{search.tables[i].name}: {why}" for i, why in search.reasons.items())
    raise BranchError(f"no path can be gone along ({reasons})", "move the paths, or choose another rule")


def _search_of(job: Job, file: FilePath, label: str, timing: TimingTable) -> _Search:
    """The search with its paths, rules and scene. Raises: as `plan_paths`."""
    robot, start, tasks = build_tasks(job, file)
    timing.check(robot)
    if tasks[0].frames > 1:
        raise ArgumentError("the tools of the task", tasks[0].frames, ONE_TOOL)
    tables, its_tasks, paths = zip(*build_each(job, file, start, tasks[0]), strict=True)
    known: dict[int, HolonomicStrategy] = {}
    with naming(file, "strategies", label):
        for task in its_tasks:
            if id(task) not in known:
                known[id(task)] = with_leaves(build_strategy(job, label, task, start, label))
    strategies, air = [known[id(task)] for task in its_tasks], job.air or AirTable()
    clear = None
    if job.checks is not None and robot.tips:
        with naming(file, "checks"):
            clear = Clearances.of(robot, job.checks.scene)
        if not clear.clear(start[None])[0]:
            fact = f"puts {clear.touching(start[None])[0]} too near to each other"
            raise JobError(file, "start.q", fact, "choose another start posture: from it all ways begin")
    scale = np.where(robot.hinges, np.pi / 180 if job.start.degrees else 1.0, 1.0)
    via = []
    for k, q in enumerate(air.via):
        with naming(file, "air", "via", str(k)):
            posture = robot.checked(np.array(q) * (scale if len(q) == robot.n else 1.0), "the posture")
            robot.check_limits(posture)
            via.append(posture)
    return _Search(job, tables, strategies, paths, start, timing, air, via, clear)


@dataclass(frozen=True, eq=False)
class _Order(Value):
    """Candidates in their order, how often the sheet changes, whether no order is better, the sheets of all (k,)."""

    order: list[int]
    changes: int
    exact: bool
    sheet: Indices
    compared: int


def _best_order(search: _Search, given: bool) -> _Order | None:
    """The best sequence of all candidates that are not blocked; None if there are none.

    Ways are computed only where the best sequence uses them: until then a bound stands for their time, which no way is
    below, so that the sequence at the end is the best of all.
    """
    sheet = search.sheets()
    unblocked = [k for k in range(len(search.candidates)) if (k, k, "path") not in search.blocked]
    path = np.array([c.path for c in search.candidates])
    if not given and unblocked:
        few, count = least_pool(path[unblocked], sheet[unblocked])
        pool = [unblocked[i] for i in few]
        plan = _best_among(search, pool, sheet, given)
        if plan is not None and plan.changes < count:
            return plan
    while unblocked:
        if (plan := _best_among(search, unblocked, sheet, given)) is not None:
            return plan
        # No sequence of all: the path that can be come to from the fewest others is left out.
        ways = {
            p: sum(1 for edge in search.ways_found if any(k >= 0 and path[k] == p for k in edge))
            for p in path[unblocked]
        }
        out = int(min(ways, key=ways.__getitem__))
        search.reasons[out] = "no clear way through the air leads there and on; give [air] a height, or postures in via"
        unblocked = [k for k in unblocked if path[k] != out]
    return None


def _best_among(search: _Search, unblocked: list[int], sheet: Indices, given: bool) -> _Order | None:
    """The best sequence of some candidates, or None where there is none of all their paths; as of `_best_order`."""
    picked = [search.candidates[k] for k in unblocked]
    A, B = np.array([c.walk.q[-1] for c in picked]), np.array([c.walk.q[0] for c in picked])
    home, path = search.start[None], np.array([c.path for c in picked])
    between, first = search.least_seconds(A, B), search.least_seconds(home, B)[0]
    last = search.least_seconds(A, home)[:, 0] * search.air.home
    seen: set[tuple[int, int]] = set()
    while True:
        sequence = best_sequence(Choices(path, sheet[unblocked], first, between, last), given)
        if not np.isfinite(sequence.cost):
            return None
        nodes = [-1, *sequence.chosen, *([-1] if search.air.home else [])]
        new = [edge for edge in pairwise(nodes) if edge not in seen]
        if not new:
            return _Order(
                [unblocked[i] for i in sequence.chosen], sequence.changes, sequence.exact, sheet, len(unblocked)
            )
        for i, j in new:
            seen.add((i, j))
            way = search.way(-1 if i < 0 else unblocked[i], -1 if j < 0 else unblocked[j])
            cost = np.inf if way is None else search.seconds(way)
            if i < 0:
                first[j] = cost
            elif j < 0:
                last[i] = cost
            else:
                between[i, j] = cost


def _timed_plan(search: _Search, plan: _Order) -> tuple[list[PlannedPath], AirMove | None] | None:
    """The timed and checked plan of a sequence; None where something is blocked, which is then blocked."""
    paths, before = [], -1
    sheet_numbers: dict[int, int] = {}
    for k in [*plan.order, *([-1] if search.air.home else [])]:
        way = search.way(before, k)
        if way is None:
            return None
        key = (before, k, way[0])
        if key not in search.air_moves:
            task = search.strategies[search.candidates[k if k >= 0 else before].path].task
            search.air_moves[key] = _air(search, way, task)
        air = search.air_moves[key]
        if air.report is not None and not air.report.passed:
            search.blocked.add(key)
            return None
        if k < 0:
            return paths, air
        if k not in search.motions:
            search.motions[k] = _motion(search, k)
        if (motion := search.motions[k]) is None:
            search.blocked.add((k, k, "path"))
            return None
        i, sheet = search.candidates[k].path, sheet_numbers.setdefault(int(plan.sheet[k]), len(sheet_numbers) + 1)
        of_path = search.tables[i], search.paths[i], search.strategies[i], search.candidates[k].level
        paths.append(PlannedPath(*of_path, sheet, air, *motion))
        before = k
    return paths, None


def _motion(search: _Search, k: int) -> tuple[TimedTrajectory, CheckReport | None] | None:
    """The path of a candidate in full, timed and checked; None, with the reason kept, where it cannot be gone along."""
    candidate, checks = search.candidates[k], search.job.checks
    strategy, i = search.strategies[candidate.path], candidate.path
    try:
        walk = follow(strategy, search.paths[i], candidate.walk.q[0], samples=search.tables[i].samples, native=True)
        timed = search.timing.timed(walk)
        report = None if checks is None else checks.checked(timed, strategy.task)
    except PATH_ERRORS as problem:
        search.reasons[i] = reason(problem)
        return None
    if report is not None and not report.passed:
        search.reasons[i] = report.trouble
        return None
    return timed, report


def _air(search: _Search, way: Way, task: Task) -> AirMove:
    """A way timed and checked; nothing is timed where nothing moves."""
    by, legs = way
    timed = [t for leg in legs if (t := search.timed_leg(leg, task)) is not None]
    if not timed:
        return AirMove("already there", ())
    whole = timed[-1]
    for leg in reversed(timed[:-1]):
        whole = replace(with_entry(leg, whole), begin=0)
    checks, report = search.job.checks, None
    if checks is not None:
        report = check(whole, checks.scene, robot=task.robot, limits=checks.limits, margin=checks.margin)
    return AirMove(by, tuple(timed), whole, report)


def run_paths(name: str, job: Job, file: FilePath, progress: Callable[[str], None] = lambda _text: None) -> PathsResult:
    """Do a job of several paths by each of its strategies. `progress` hears what is going on.

    A path that cannot be gone along is left out, with the reason, and the others are done; a strategy that goes along
    none is in `not_run`.

    Raises:
        HolokinError: bad input; or no strategy goes along any path, for the first one's reason.
    """
    began = time.perf_counter()
    bare = build_robot(job, file)
    robot, start, tasks = build_tasks(job, file, bare)
    rules, not_run, notes = [], [], []
    first: HolokinError | None = None
    for label in job.strategies:
        progress(label)
        try:
            plan = plan_paths(job, file, label, progress)
        except (BranchError, ArgumentError) as problem:
            first = first or problem
            not_run.append(NotRun(label, reason(problem)))
            continue
        rows = [_row(each) for each in plan.paths]
        if plan.home is not None:
            reports = () if plan.home.report is None else (plan.home.report,)
            rows.append(PathRow("home", 0, plan.paths[-1].level, 0.0, plan.home.by, plan.home.timed, None, reports))
        facts = plan.left_out, plan.sentence, plan.changes, plan.exact, plan.timed
        rules.append(RuleResult(label, tuple(rows), *facts))
        notes += [f"{each.name}: {note}." for each in plan.paths for note in each.path.notes]
    if first is not None and not rules:
        raise first
    shown = bare if job.checks is None else job.checks.drawn(bare)
    tip = tasks[0].tip or (robot.tips[0].name if robot.tips else "")
    return PathsResult(
        name, job.title, job.about, robot, shown, tasks[0].name, tip, start, tuple(rules), time.perf_counter() - began,
        job.scene, tuple(not_run), tuple(dict.fromkeys(notes)), job.printed_units,
    )  # fmt: skip


def _row(each: PlannedPath) -> PathRow:
    reports = tuple(report for report in (each.air.report, each.report) if report is not None)
    length = each.path.length
    return PathRow(each.name, each.sheet, each.level, length, each.air.by, each.air.timed, each.timed, reports)
