"""`Case`: a task and a workspace for which strategies are tried, and what is found out of them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, OutOfReachError
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Vector
from ...motion.checks import Clearances, Scene
from ...motion.checks.check_report import counted, keeps
from ...motion.self_motions.pose_reach import Reach, all_known, reach_of
from ...motion.self_motions.self_motions import self_motions_at
from ...path.workspaces import PoseRange, Workspace, pose_cloud
from ...proof.kept_apart import clearances_of
from ...strategies import holonomic
from ...strategies.constraints import tilted
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.cover_workspace import Coverage, PoseStatus, coverage, largest_part
from ..coverage.pose_coordinates import chart_of, coordinates_of, task_poses
from ..coverage.starts import (
    SPREAD,
    Candidate,
    candidates,
    check_redundant,
    check_that_joints_move,
    first_start,
    postures_at,
    postures_within_limits,
    proposed_workspace,
    reached,
)
from ..coverage.tool_chain import Chain
from .advice_words import lines
from .designed_strategy import Design, design
from .least_costs import Floor, one_redundant
from .nearby_cusps import MORE_SPEED, LevelRange, NearbyCusps, cusps_near, level_range
from .objectives import Objective, costs_of
from .obstructions import Obstructions, obstructions
from .served_curves import (
    EQUAL,
    ROOM,
    Leaf,
    ServedCurves,
    Within,
    best_branch,
    best_leaf,
    designed_on,
    leaf_through,
    pieces_of,
    served_curves,
    within_limits,
)
from .trials import (
    PROVABLE,
    Advice,
    Part,
    Poses,
    RatedStrategy,
    Trial,
    alike,
    clear_share,
    distinct,
    is_proven,
    posed,
    ranked,
    ratio,
    strategy_of,
    tried,
)

POSES = 256
"""Poses by which strategies are compared: of even points, 256 tell a share to 2 %."""

DESIGNED = 128
"""Poses that strategies are designed for by a search."""

TRIED = 2
"""Strategies whose leaves are followed to all poses, besides the best proven one and those designed."""

DESIGNS = 4
"""Joints held over which strategies are designed at most: how well one serves by itself does not tell which is best."""

MOST = 3
"""Strategies whose cusps are looked for at most."""

PARTLY = 0.5
"""Share of the workspace from which on the largest part that is served from end to end is looked for."""

CHEAPER = 0.3
"""Difference of what designs cost, see `designed_on`, from which on one that is not proven is tried, too: the
logarithm of 1.3 times the squared joint speed, or 1.5 % of the poses."""

SEARCHED = 16
"""Poses at which it is looked what is in the way, where postures are searched for."""


class Case:
    """A task and a workspace, with what is found out of them on the way to an advice."""

    def __init__(
        self, task: Task, workspace: Workspace, q0: Vector | None, scene: Scene | None, progress: Callable[[str], None]
    ) -> None:
        self.task, self.workspace, self.q0, self.scene, self.progress = task, workspace, q0, scene, progress
        self.apart = clearances_of(task.robot, scene)
        if q0 is not None and self.apart is not None:
            _check_clear(task, self.apart, q0)
        T = task_poses(task, workspace, POSES)
        # The postures of the poses: all, as curves, or those that a search finds
        progress("which poses can be reached")
        within = _all_within(task, T) if one_redundant(task) and all_known(task) else None
        self.reach = reached(task, T, q0) if within is None else _reach(task, T, within)
        if not self.reach.within.any():
            raise _nothing(task, workspace, self.reach)
        progress("what is in the way")
        some = within or _some_within(task, T, self.reach)
        self.blocked, clear = obstructions(task, self.apart, some.q, some.pose, len(T))
        looked_at = self.blocked.postures > 0
        if self.blocked.impossible[looked_at].all():
            raise _blocked(task, workspace, self.blocked, looked_at)
        # The tool's motions by which speeds are counted, and the poses
        self.coordinates = coordinates_of(chart_of(task, workspace.center[:3, :3]), self.reach.q[self.reach.anyhow])
        self.costs = costs_of(task.robot, Objective(squared_speed=1.0), self.coordinates.turns, self.coordinates.spread)
        self.poses = posed(task, T, self.reach.q, self.coordinates, self.costs, self.apart)
        self.curves = None
        if within is not None:
            twists = self.poses.twists
            self.curves = served_curves(within, clear, task, T, twists, self.costs, self.coordinates)
        self.starts = q0[None] if q0 is not None else self._starts(T, some.q[clear], some.pose[clear])
        self.trials: dict[str, Trial] = {}
        self.checked: dict[str, Coverage] = {}
        self.cusps: dict[str, NearbyCusps] = {}
        self.interrupted = False

    def _starts(self, T: Array, Q: Matrix, pose: Indices) -> Matrix:
        """Start postures at the centre, or at the pose nearest to it that has clear postures."""
        center = self.workspace.center
        near = np.argsort(np.linalg.norm(T[:, :3, 3] - center[:3, 3], axis=1), kind="stable")
        if self.curves is not None:
            own = Q[pose == near[np.isin(near, pose)][0]]
            return own[np.unique(np.linspace(0, len(own) - 1, SPREAD).astype(int))]
        for there in [center, *T[near[self.reach.within[near]]]]:
            postures = postures_at(self.task, there)
            clear = postures if self.apart is None else postures[self.apart.clear(postures)]
            if len(clear):
                return clear
        return self.reach.q[self.reach.within][:1]

    def ranked(self) -> tuple[RatedStrategy, ...]:
        """The best strategies on their best leaves, the best one looked at closely."""
        trials = self._searched() if self.curves is None else self._read_off(self.curves)
        if not trials:
            raise ArgumentError(
                "the strategies that fit", 0, "give another start posture: all are singular at this one"
            )
        trials = distinct(ranked(trials))
        self.trials = {trial.candidate.name: trial for trial in trials}
        self.floor = self._floor(trials)
        # The best is looked at pose by pose, and if it falls behind the next one
        strategies = ranked([self._rated(trial) for trial in trials])
        while strategies[0].name not in self.checked:
            self.progress(f"{strategies[0].name}, pose by pose")
            strategies = ranked([self._looked_at(strategies[0]), *strategies[1:]])
        return tuple(self._without_cusps(strategies))

    # Where all postures are known as curves.

    def _read_off(self, curves: ServedCurves) -> list[Trial]:
        """The leaves that serve most, read off the curves; the best of these, and designs over them, on trial."""
        every = [c for c in candidates(self.task, self.starts) if c.strategy is not None]
        leaves, trials = [], []
        with self._to_be_kept(trials):
            for candidate, g in zip(every, curves.levels(every).T, strict=True):
                self.progress(candidate.name)
                pieces = pieces_of(curves, candidate, g)
                leaf = best_leaf(curves, pieces) if self.q0 is None else leaf_through(curves, pieces, self.q0)
                if leaf is not None:
                    leaves.append(leaf)
            leaves = ranked(leaves)
            proven = [leaf for leaf in leaves if is_proven(leaf)]
            others = [leaf for leaf in leaves if not is_proven(leaf) and leaf.candidate.kind != "stationary"]
            # The design over a joint held, which is proven, of the least cost; and another one that costs less by far
            designs = list(filter(None, (self._designed_on(curves, leaf) for leaf in proven[:DESIGNS])))
            designs = sorted(designs, key=lambda made: made[2])[:1]
            for other in filter(None, (self._designed_on(curves, leaf) for leaf in others[:1])):
                designs += [other] if not designs or other[2] < designs[0][2] - CHEAPER else []
            for leaf in dict.fromkeys([*leaves[:TRIED], *proven[:1]]):
                self.progress(f"{leaf.candidate.name}, on its leaf")
                trials += tried(leaf.candidate, leaf.q[None], self.poses)
            for candidate, q, _ in designs:
                self.progress(f"{candidate.name}, on its leaf")
                trials += tried(candidate, q[None], self.poses)
        return trials

    def _designed_on(self, curves: ServedCurves, leaf: Leaf) -> tuple[Candidate, Vector, float] | None:
        """A strategy whose level is a polynomial of the pose, on the branch of a leaf; where to begin, and the cost."""
        base = leaf.candidate.strategy
        name = f"designed from {leaf.candidate.name}"
        self.progress(name)
        if self.q0 is None and (branch := best_branch(curves, leaf.pieces)) is not None:
            leaf = branch
        made = designed_on(curves, leaf, degree=2)
        if base is None or made is None:
            return None
        h, cost = made
        strategy = holonomic(self.task, tilted(base.constraint, h, chart=h.chart), name=name)
        return Candidate(name, h.keys_over(leaf.candidate.keys), self.task, strategy, level=0.0), leaf.q, cost

    @contextmanager
    def _to_be_kept(self, found: Sequence[Trial]) -> Iterator[None]:
        """Ctrl-C ends the comparison, and what was found until then stays."""
        try:
            yield
        except KeyboardInterrupt:
            if not found:
                raise
            self.interrupted = True

    # Where postures are searched for.

    def _searched(self) -> list[Trial]:
        """Each strategy from all starts at some of the poses, then its best leaf at all of them; and designs."""
        rough = self.poses.some(slice(None, None, 4))
        trials: list[Trial] = []
        with self._to_be_kept(trials):
            for candidate in candidates(self.task, self.starts):
                self.progress(candidate.name)
                screened = tried(candidate, self.starts, rough)
                if screened:  # its start is on its leaf already
                    trials += tried(replace(candidate, level=None), ranked(screened)[0].q0[None], self.poses)
            # Derivatives of a cost's gradient make designs over stationary strategies three times as slow
            ordered = distinct(ranked(trials)) if trials else []
            plain = [t for t in ordered if t.candidate.strategy is not None and t.candidate.kind != "stationary"]
            if plain and plain[0].served.any():
                trials += self._designed_over(plain[0])
        return trials

    def _designed_over(self, trial: Trial) -> list[Trial]:
        """Strategies designed from one, on its leaf, until one covers as much.

        The goal is the least joint speed within the joint limits, which keeps what `easy` asks of the joint with the
        least range; where that covers less than the base does, a compromise between joint speed and distance to limits.
        """
        base, designed = trial.candidate, []
        room = ROOM * float(np.min(2 * self.costs.half[np.isfinite(self.costs.half)], initial=1.0))
        goals: dict[str, dict[str, Any]] = {
            "": {"objective": Objective(squared_speed=1.0), "limits": True, "margin": room},
            ", off limits": {"objective": Objective(squared_speed=1.0, joint_limits=1.0), "limits": False},
        }
        for words, goal in goals.items():
            name = f"designed from {base.name}{words}"
            self.progress(name)
            try:
                made = self._design(trial, **goal)
            except HolokinError:  # no strategy where there is none: the others stay
                continue
            candidate = Candidate(name, made.polynomial.keys_over(base.keys), self.task, made.strategy)
            designed += tried(candidate, made.q0[None], self.poses)
            if designed[-1].coverage >= trial.coverage - EQUAL:
                break
        return designed

    def _design(self, trial: Trial, **goal: Any) -> Design:
        """A design over a strategy, for the poses that it serves; where these are few, for all that any posture
        reaches."""
        if self.scene is not None:
            goal["scene"] = replace(self.scene, clearance=self.scene.clearance + PROVABLE)
        base = None if trial.candidate.strategy is None else trial.candidate.strategy.constraint
        within = self.reach.within
        which = within if trial.coverage < within.mean() - EQUAL else trial.served
        space = self.workspace if which.all() else pose_cloud(self.poses.T[which])
        return design(self.task, space, trial.q0, base=base, degree=2, samples=DESIGNED, **goal)

    # What is known of the strategies.

    def _without_cusps(self, strategies: list[RatedStrategy]) -> list[RatedStrategy]:
        """Other things equal, a strategy without a cusp near the workspace comes first; three are looked at at most."""
        best = strategies[0]
        most = MORE_SPEED * best.squared_speed
        equal = [rated for rated in strategies[1:] if alike(rated, best) and rated.squared_speed <= most]
        for rated in [best, *equal][:MOST]:
            self.progress(f"{rated.name}, its cusps")
            self.cusps[rated.name] = cusps_near(rated.strategy, rated.q0, self.workspace)
            if self.cusps[rated.name].clear:
                rated = rated if rated.name in self.checked else self._looked_at(rated)
                if alike(rated, best):
                    return [rated, *(other for other in strategies if other.name != rated.name)]
        return strategies

    def levels(self, rated: RatedStrategy) -> tuple[LevelRange | None, str]:
        """The levels of a strategy that serve the workspace; and what is said of them."""
        self.progress(f"{rated.name}, its levels")
        try:
            levels = level_range(rated.strategy, self.workspace, rated.q0, progress=self.progress)
        except HolokinError as problem:  # of several rows
            return None, f"Levels were not looked for: {problem}."
        blind = "" if self.apart is None else " Collisions were not looked at for them."
        return levels, f"Of {rated.name!r}, {levels.served}.{blind}"

    def _floor(self, trials: list[Trial]) -> Vector:
        """The least squared joint speed (k,) of the postures within the limits, and clear where all are known, at the
        poses that the best strategy serves, else NaN."""
        if self.curves is not None:
            return self.curves.floor
        best, floor = ranked(trials)[0], np.full(len(self.poses), np.nan)
        if best.served.any():
            q, T = best.q[best.served], self.poses.T[best.served]
            p, R = (np.ascontiguousarray(part) for part in (T[:, :3, 3], T[:, :3, :3]))
            limits = np.ones(self.task.n)  # in halves of the joints' ranges
            floor[best.served] = Floor(self.coordinates, self.costs, {}, limits, q, p, R).anywhere.squared_speed
        return floor

    def _rated(self, trial: Trial) -> RatedStrategy:
        """What is known of a strategy after its trial: where it serves nothing, no margin and no rcond."""
        c, served, margins, rcond, joint = trial.candidate, trial.served, np.zeros(self.task.n), 0.0, 0
        closest, clearance = None, trial.clearance
        if self.apart is not None and clearance is not None and served.any():
            nearest = trial.q[served][[int(np.argmin(clearance[served]))]]
            closest = self.apart.closest(self.task, nearest)
        if served.any():
            margins, rcond = trial.margins[served].min(axis=0), float(trial.rcond[served].min())
            joint = int(np.argmin(margins))
        return RatedStrategy(
            name=c.name, same=trial.same, keys=c.keys, strategy=strategy_of(trial), q0=trial.q0,
            coverage=trial.coverage, served=served, easy=trial.easy, margin=float(margins[joint]),
            joint=self.task.robot.joint_names[joint], rcond=rcond, squared_speed=trial.squared_speed,
            speed=ratio(trial, self.floor), clearance=_least(clearance, served), closest=closest,
            clear=trial.clear,
        )  # fmt: skip

    def _looked_at(self, rated: RatedStrategy) -> RatedStrategy:
        """A strategy with its coverage as `coverage` finds it, pose by pose."""
        covered = coverage(rated.strategy, self.workspace, rated.q0, samples=POSES, reach=self.reach)
        clearance, wanted, closest = None, 0.0, None
        if self.apart is not None and covered.reached.any():
            clearance, wanted = np.full(len(covered), np.nan), self.apart.wanted
            q = covered.q[covered.reached]
            distances = self.apart.distances(q, np.maximum(self.apart.limits, wanted))
            least = counted(distances, self.apart.limits, wanted).min(axis=1, initial=np.inf)
            clearance[covered.reached], served = least, keeps(least, wanted)
            covered = covered.blocked(lambda _: served)
            closest = self.apart.closest(self.task, q[served], distances[served]) if served.any() else None
        self.checked[rated.name] = covered
        served = covered.reached
        return replace(
            rated,
            coverage=covered.share,
            served=served,
            easy=rated.easy + covered.share - rated.coverage,
            rcond=float(covered.rcond[served].min()) if served.any() else 0.0,
            clearance=_least(clearance, served),
            closest=closest,
            clear=clear_share(served, clearance, wanted),
        )

    def not_served(self, rated: RatedStrategy) -> list[tuple[str, int]]:
        """(why, at how many poses) of those that a strategy which was looked at does not serve."""
        covered = self.checked[rated.name]
        causes = [
            cause for cause in covered.causes() if cause[0] not in (PoseStatus.REACHED.text, PoseStatus.BLOCKED.text)
        ]
        blocked = covered.status == PoseStatus.BLOCKED
        if self.apart is not None and blocked.any():
            causes += self.blocked.causes(blocked & self.blocked.impossible)
            elsewhere = covered.q[blocked & ~self.blocked.impossible]
            distances = self.apart.distances(elsewhere, np.maximum(self.apart.limits, self.apart.wanted))
            short = self.apart.limits - distances
            pairs = short.argmax(axis=1)
            for p, k in Counter(pairs.tolist()).most_common():
                i = np.flatnonzero(pairs == p)[int(np.argmax(short[pairs == p, p]))]
                causes.append(
                    (f"at worst, {self.apart.pair_at(self.task, elsewhere[i], p, float(distances[i, p]))}", k)
                )
        return sorted(causes, key=lambda cause: -cause[1])

    def floor_of(self, rated: RatedStrategy) -> float:
        """The mean of the floor where a strategy serves; NaN where it serves nothing."""
        known = self.floor[rated.served & np.isfinite(self.floor)]
        return float(known.mean()) if len(known) else np.nan

    def part(self, rated: RatedStrategy) -> Part | None:
        """The largest part of the workspace that a strategy serves."""
        if not isinstance(self.workspace, PoseRange) or rated.coverage < PARTLY:
            return None
        self.progress(f"the part of the workspace that {rated.name} serves")
        strategy = None if rated.keys["kind"] == "radial" else rated.strategy
        candidate = Candidate(rated.name, rated.keys, self.task, strategy)

        def serves(T: Array) -> bool:
            still = np.zeros((len(T), self.task.m, 0))
            (trial,) = tried(candidate, rated.q0[None], Poses(T, still, self.costs.joints))
            return bool(trial.served.all()) and (self.apart is None or bool(self.apart.clear(trial.q).all()))

        part = largest_part(self.workspace, self.poses.T, rated.served, serves)
        return None if part is None else Part(rated, *part)


def _check_clear(task: Task, apart: Clearances, q0: Vector) -> None:
    """Raises: ArgumentError: two shapes are too near at the start posture."""
    nearest = apart.closest(task, q0[None])
    if nearest is not None and not keeps(nearest.distance, nearest.wanted):
        cure = f"{nearest}: give another start, move what stands there, or allow the pair"
        raise ArgumentError("q0", np.round(q0, 4).tolist(), cure)


def _all_within(task: Task, T: Array) -> Within:
    """The postures of poses (k, 4, 4) within the joint limits."""
    p, R = (np.ascontiguousarray(part) for part in (T[:, :3, 3], T[:, :3, :3]))
    return within_limits(self_motions_at(task, p, R))


def _reach(task: Task, T: Array, within: Within) -> Reach:
    """By which posture each pose is reached: one far from the limits, where there are any within them."""
    robot, q = task.robot, np.full((len(T), task.n), np.nan)
    order = np.lexsort((robot.beyond(within.q).max(axis=1), within.pose))
    known, first = np.unique(within.pose[order], return_index=True)
    q[known] = within.q[order[first]]
    rest = np.setdiff1d(np.arange(len(T)), known)
    if len(rest):
        middle = np.tile(np.mean(robot.ranges(1.0), axis=0), (len(rest), 1))
        p, R = (np.ascontiguousarray(part) for part in (T[rest, :3, 3], T[rest, :3, :3]))
        q[rest] = reach_of(task, p, R, middle).q
    return Reach(robot, q, complete=True)


def _some_within(task: Task, T: Array, reach: Reach) -> Within:
    """Postures within the joint limits that a search finds at some of the poses."""
    which = np.flatnonzero(reach.within)[:: max(1, int(reach.within.sum()) // SEARCHED)]
    found = [postures_within_limits(task, T[i]) for i in which]
    pose = np.repeat(which, [len(Q) for Q in found])
    return Within(np.concatenate(found), pose, np.zeros(len(pose), dtype=bool))


def _least(clearance: Vector | None, served: Flags) -> float:
    """The least of clearances (k,) at the poses that are served; infinite where there are none."""
    return np.inf if clearance is None else float(np.min(clearance[served], initial=np.inf))


def _nothing(task: Task, workspace: Workspace, reach: Reach) -> OutOfReachError:
    """Why no pose of a workspace is served."""
    name = f"the workspace of {task.robot.name!r}, {workspace},"
    if reach.anyhow.any():
        obstacles = "; ".join(f"{obstacle}: {k}" for obstacle, k in reach.obstacles(np.arange(len(reach.q))))
        return OutOfReachError(
            f"{name} has no pose that is reached within the joint limits ({obstacles})", "move or turn it"
        )
    cure = "move it nearer to the base; lengths are in metres, angles in degrees on the command line and rad in Python"
    none = "no posture has any of its poses" if reach.complete else "no posture was found at any of its poses"
    return OutOfReachError(f"{name} is out of reach altogether: {none}", cure)


def _blocked(task: Task, workspace: Workspace, blocked: Obstructions, which: Flags) -> OutOfReachError:
    """Why no pose of a workspace has a posture that is clear."""
    few = "" if which.all() else " that were looked at"
    causes = "; ".join(f"{cause}: {k}" for cause, k in blocked.causes(which))
    fact = f"no strategy can serve the workspace of {task.robot.name!r}, {workspace}: of {int(which.sum())} poses{few}"
    cure = (
        "move what is in the way, or the workspace, or ask for less clearance; pairs of a coarse model can be allowed"
    )
    return OutOfReachError(f"{fact} none has a posture within the joint limits that is clear ({causes})", cure)


@typed
def advise(
    task: Task,
    workspace: Workspace | None = None,
    *,
    q0: ArrayLike | None = None,
    scene: Scene | None = None,
    levels: bool = False,
    progress: Callable[[str], None] = lambda _text: None,
) -> Advice:
    """The strategies that fit a task, each on its best leaf, compared on a workspace, and why the best is the best.

    Locked joints, differences of parallel joints, arm angles, the elbow's height, stationary costs, and strategies
    designed over the best of these; where postures are searched for, `radial` of the pseudo-inverse, too. They are
    ranked by the share of the workspace that they serve within the joint limits, and with the clearance where one is
    asked for; of strategies that cover alike those are first that keep well clear, by 0.01 m more than asked for; of
    these those that keep away from limits and singular postures; of these the one with the least joint speed, but first
    one that is proven on the whole arm, for up to 14 % more joint speed. If the first is not proven, one without a cusp
    near the workspace is preferred to one with, for up to a tenth more squared joint speed. The best is looked at pose
    by pose; `certify_by` of the advice is the call that proves it. Ctrl-C ends the comparison: what is found stays.

    Args:
        task: what the tool does: `hk.pose(robot)`, `hk.pose(robot, "axis")` if it may spin, `hk.position(robot)`.
        workspace: by default a box round the tool at the start, with moderate turns.
        q0: the posture (n,) that the leaf is to go through; by default each strategy gets the best of several.
        scene: a pose is served only where the links keep their clearance from what is in it, and from each other; by
            default nothing is looked at. The pairs are those of `certify`; meshes are their convex hulls, and where
            these are nearer, themselves.
        levels: which levels of the best strategy serve the workspace, as `level_range` finds them; it takes seconds.
        progress: hears how far it is.

    Raises:
        ArgumentError: the robot is not redundant for the task; a workspace of one pose; shapes that are too near at q0.
        OutOfReachError: no pose of the workspace is reached within the joint limits, or by a posture that is clear.
        JointLimitError: the start is beyond them. ShapeError, NotFiniteError.
    """
    of_one_tool(task, "advice")
    check_redundant(task)
    chain = Chain(task.robot, None, task.tip or task.robot.tips[0].name, (), False)
    chosen = tuple(word for word, value in {"q0": q0, "workspace": workspace}.items() if value is None)
    return advise_chain(chain, task, workspace, q0, chosen=chosen, scene=scene, levels=levels, progress=progress)


def advise_chain(
    chain: Chain,
    task: Task,
    workspace: Workspace | None,
    q0: ArrayLike | None,
    *,
    chosen: Sequence[str],
    scene: Scene | None,
    progress: Callable[[str], None],
    levels: bool = False,
) -> Advice:
    """The advice for a chain and its task, as of `advise`.

    Args:
        chosen: what nobody gave.
    """
    # The start and the workspace, chosen if they are not given
    began, robot = time.perf_counter(), chain.robot
    of_one_tool(task, "advice")
    check_that_joints_move(robot)
    start = None if q0 is None else robot.checked(q0, "the start posture")
    if start is not None:
        robot.check_limits(start)
    if workspace is None:
        workspace = proposed_workspace(task, first_start(task) if start is None else start)
    # The strategies, and what is said of the best
    case = Case(task, workspace, start, scene, progress)
    strategies = case.ranked()
    best = strategies[0]
    progress("the reasons")
    part = None if best.served.all() else case.part(best)
    sentences = list(lines(strategies, case.cusps, case.not_served(best), part))
    if case.interrupted:
        sentences.append("It was interrupted: strategies that were not looked at yet may be better.")
    level_interval = None
    if levels:
        level_interval, sentence = case.levels(best)
        sentences.append(sentence)
    return Advice(
        chain=chain, task=task, workspace=workspace, proposed=tuple(chosen), strategies=strategies,
        floor=case.floor_of(best), coverage=case.checked[best.name], reasons=tuple(sentences),
        cusps=case.cusps[best.name], part=part, seconds=time.perf_counter() - began, levels=level_interval, scene=scene,
    )  # fmt: skip
