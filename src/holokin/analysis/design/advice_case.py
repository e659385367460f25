"""`Case`: a task and a workspace for which strategies are tried, and what is found out of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, OutOfReachError
from ...base.types import Array, ArrayLike, Flags, Matrix, Vector
from ...motion.checks import Scene
from ...motion.checks.check_report import keeps
from ...path.workspaces import PoseRange, Workspace, pose_cloud
from ...proof.kept_apart import clearances_of
from ...robot import check_metres
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.cover_workspace import Coverage, Reach, coverage, largest_part
from ..coverage.pose_coordinates import chart_of, coordinates_of
from ..coverage.starts import (
    Candidate,
    candidates,
    check_redundant,
    check_that_joints_move,
    first_start,
    postures_at,
    proposed_workspace,
    reached,
)
from ..coverage.tool_chain import Chain
from .designed_strategy import Design, design
from .least_costs import Floor
from .nearby_cusps import MORE_SPEED, LevelRange, NearbyCusps, cusps_near, level_range, said_of
from .objectives import Objective, costs_of
from .trials import (
    CLOSE,
    EQUAL,
    PARTLY,
    PROVABLE,
    ROOM,
    Advice,
    Excess,
    Free,
    Part,
    Poses,
    RatedStrategy,
    Trial,
    alike,
    beyond_limits,
    clear_share,
    distinct,
    least_near,
    posed,
    ranked,
    ratio,
    reasons,
    rival_of,
    strategy_of,
    tried,
)

POSES = 256
"""Poses by which strategies are compared: of even points, 256 tell a share to 2 %."""

DESIGNED = 128
"""Poses that strategies are designed for."""


class Case:
    """A task and a workspace, with what is found out of them on the way to an advice."""

    def __init__(
        self, task: Task, workspace: Workspace, q0: Vector | None, scene: Scene | None, progress: Callable[[str], None]
    ) -> None:
        self.task, self.workspace, self.scene, self.progress = task, workspace, scene, progress
        self.apart = apart = clearances_of(task.robot, scene)
        T = workspace.poses(POSES)
        check_metres(task.robot, T, task.tip)
        progress("which poses can be reached")
        self.reach = reached(task, T, q0)
        if not self.reach.within.any():
            raise _nothing(task, workspace, self.reach)
        self.starts = q0[None] if q0 is not None else self._starts(T)
        self.coordinates = coordinates_of(chart_of(task, workspace.center[:3, :3]), self.reach.q[self.reach.anyhow])
        self.costs = costs_of(task.robot, Objective(squared_speed=1.0), self.coordinates.turns, self.coordinates.spread)
        self.poses = posed(task, T, self.reach.q, self.coordinates, self.costs, apart)
        self.trials: dict[str, Trial] = {}
        self.made: dict[str, Design] = {}
        self.checked: dict[str, Coverage] = {}
        self.cusps: dict[str, NearbyCusps] = {}
        self.passed_over: RatedStrategy | None = None

    def _starts(self, T: Array) -> Matrix:
        """Start postures at the centre, or at the pose nearest to it that is reached."""
        center = self.workspace.center
        order = np.argsort(np.linalg.norm(T[:, :3, 3] - center[:3, 3], axis=1), kind="stable")
        for pose in [center, *T[order[self.reach.within[order]]]]:
            postures = postures_at(self.task, pose)
            clear = postures if self.apart is None else postures[self.apart.clear(postures)]
            if len(clear):
                return clear
        return self.reach.q[self.reach.within][:1]

    def ranked(self) -> tuple[RatedStrategy, ...]:
        """All strategies, on their best leaves, the best one looked at closely."""
        # Each strategy from all starts at some of the poses, then its best leaf at all of them
        rough = self.poses.some(slice(None, None, 4))
        trials: list[Trial] = []
        for candidate in candidates(self.task, self.starts):
            self.progress(candidate.name)
            screened = tried(candidate, self.starts, rough)
            if screened:  # its start is on its leaf already
                trials += tried(replace(candidate, level=None), ranked(screened)[0].q0[None], self.poses)
        if not trials:
            raise ArgumentError(
                "the strategies that fit", 0, "give another start posture: all are singular at this one"
            )
        trials = distinct(ranked(trials))
        trials += self._designed(trials)
        self.trials = {trial.candidate.name: trial for trial in trials}
        self.floor = self._floor(trials)
        # The best is looked at pose by pose, and if it falls behind the next one
        strategies = ranked([self._rated(trial) for trial in trials])
        while strategies[0].name not in self.checked:
            self.progress(f"{strategies[0].name}, pose by pose")
            strategies = ranked([self._looked_at(strategies[0]), *strategies[1:]])
        return tuple(self._without_cusps(strategies))

    def _without_cusps(self, strategies: list[RatedStrategy]) -> list[RatedStrategy]:
        """Other things equal, a strategy without a cusp near the workspace comes first; three are looked at at most."""
        best = strategies[0]
        most = MORE_SPEED * best.squared_speed
        equal = [rated for rated in strategies[1:] if alike(rated, best) and rated.squared_speed <= most]
        for rated in [best, *equal][:3]:
            self.progress(f"{rated.name}, its cusps")
            self.cusps[rated.name] = cusps_near(rated.strategy, rated.q0, self.workspace)
            if self.cusps[rated.name].clear:
                rated = rated if rated.name in self.checked else self._looked_at(rated)
                if alike(rated, best):
                    self.passed_over = None if rated.name == best.name else best
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

    def _designed(self, trials: list[Trial]) -> list[Trial]:
        """Strategies designed from the best of the others, and over the one that is faster from elsewhere."""
        # derivatives of a cost's gradient make designs over stationary strategies three times as slow
        plain = [t for t in trials if t.candidate.strategy is not None and t.candidate.kind != "stationary"]
        plain = [t for t in plain if t.coverage > PARTLY] or plain[:1]
        if not plain or not plain[0].served.any():
            return []
        designed = self._designed_over(plain[0])
        best = ranked(designed or plain[:1])[0]

        def gain(trial: Trial) -> float:
            """Its mean squared joint speed over that of the best one, where both serve; infinite where they do not."""
            both = trial.served & best.served
            return float(trial.speed[both].mean() / best.speed[both].mean()) if both.any() else np.inf

        # Designs over two strategies from one start came out alike to 0.1 %, so another one must be faster by 5 %
        fastest = min(plain[1:], key=gain, default=None)
        if fastest is not None and gain(fastest) < 0.95:
            designed += self._designed_over(fastest)
        return designed

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
            self.made[name] = made
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

    def _floor(self, trials: list[Trial]) -> Vector:
        """The least squared joint speed (k,) of the postures found at the poses that the best strategy reaches, else
        NaN."""
        best, floor = ranked(trials)[0], np.full(len(self.poses), np.nan)
        if best.reached.any():
            free = np.full(self.task.n, 1e9)  # no joint gets there, in halves of its range
            q, (p, R) = best.q[best.reached], self._targets(best.reached)
            floor[best.reached] = Floor(self.coordinates, self.costs, {}, free, q, p, R).anywhere.squared_speed
        return floor

    def _targets(self, which: Flags) -> tuple[Matrix, Array]:
        T = self.poses.T[which]
        return np.ascontiguousarray(T[:, :3, 3]), np.ascontiguousarray(T[:, :3, :3])

    def _rated(self, trial: Trial) -> RatedStrategy:
        """What is known of a strategy after its trial: where it serves nothing, no margin and no rcond."""
        c, served, margins, rcond, joint = trial.candidate, trial.served, np.zeros(self.task.n), 0.0, 0
        if served.any():
            margins, rcond = trial.margins[served].min(axis=0), float(trial.rcond[served].min())
            joint = int(np.argmin(margins))
        return RatedStrategy(
            name=c.name, same=trial.same, keys=c.keys, strategy=strategy_of(trial), q0=trial.q0,
            coverage=trial.coverage, served=served, easy=trial.easy, margin=float(margins[joint]),
            joint=self.task.robot.joint_names[joint], rcond=rcond, squared_speed=trial.squared_speed,
            speed=ratio(trial, self.floor), clearance=_least(trial.clearance), clear=trial.clear,
        )  # fmt: skip

    def _looked_at(self, rated: RatedStrategy) -> RatedStrategy:
        """A strategy with its coverage as `coverage` finds it, pose by pose."""
        covered = coverage(rated.strategy, self.workspace, rated.q0, samples=POSES, reach=self.reach)
        clearance, wanted = None, 0.0
        if self.apart is not None:
            clearance, wanted = np.full(len(covered), np.nan), self.apart.wanted
            clearance[covered.reached] = distances = self.apart.least(covered.q[covered.reached], wanted)
            covered = covered.blocked(lambda _: keeps(distances, wanted))
        self.checked[rated.name] = covered
        served = covered.reached
        return replace(
            rated,
            coverage=covered.share,
            served=served,
            easy=rated.easy + covered.share - rated.coverage,
            rcond=float(covered.rcond[served].min()) if served.any() else 0.0,
            clearance=_least(clearance),
            clear=clear_share(served, clearance, wanted),
        )

    def floor_of(self, rated: RatedStrategy) -> float:
        """The mean of the floor where a strategy serves; NaN where it serves nothing."""
        known = self.floor[rated.served & np.isfinite(self.floor)]
        return float(known.mean()) if len(known) else np.nan

    def excess(self, strategies: tuple[RatedStrategy, ...]) -> Excess | None:
        """Why the best strategy is above the least joint speed; None where it is close to it."""
        best = self.trials[strategies[0].name]
        which = best.served & np.isfinite(self.floor)
        if not which.any() or strategies[0].speed <= 1 + CLOSE:
            return None
        near = least_near(self.coordinates, self.costs, best.q[which], *self._targets(which))
        near = float(np.minimum(near, best.speed[which]).mean() / self.floor[which].mean())
        others = [trial for name, trial in self.trials.items() if name != strategies[0].name]
        rival = rival_of(best, others, self.floor, self.reach.within)
        return Excess(near, self.task.n - self.task.m == 1, self._free(strategies[0]), rival)

    def _free(self, rated: RatedStrategy) -> Free | None:
        """The best strategy designed without the limits; None where it keeps away from them, or none is found."""
        made = self.made.get(rated.name)
        # Limits have not held a design with over twice the margin that it was to keep at least
        if made is not None and rated.margin > 2.0 * ROOM:
            return None
        self.progress(f"{rated.name}, joint limits aside")
        trial = self.trials[rated.name]
        if made is not None:
            trial = replace(trial, candidate=replace(trial.candidate, strategy=made.base))
        elif trial.candidate.kind == "stationary":  # over these a design is slow
            return None
        try:
            made = self._design(trial, limits=False)
        except HolokinError:
            return None
        candidate = Candidate(rated.name, {"kind": "designed"}, self.task, made.strategy)
        (free,) = tried(candidate, made.q0[None], self.poses)
        which = free.reached & np.isfinite(self.floor)
        return Free(ratio(free, self.floor, limits=False), beyond_limits(free, which), int(which.sum()))

    def part(self, strategies: tuple[RatedStrategy, ...]) -> Part | None:
        """The largest part of the workspace that one of the three best strategies serves."""
        if not isinstance(self.workspace, PoseRange):
            return None
        best: Part | None = None
        for rated in strategies[:3]:
            self.progress(f"the part of the workspace that {rated.name} serves")
            strategy = None if rated.keys["kind"] == "radial" else rated.strategy
            candidate = Candidate(rated.name, rated.keys, self.task, strategy)

            def serves(T: Array, q0: Vector = rated.q0, candidate: Candidate = candidate) -> bool:
                still = np.zeros((len(T), self.task.m, 0))
                poses = Poses(T, still, self.costs.joints, self.apart)
                return bool(tried(candidate, q0[None], poses)[0].served.all())

            part = largest_part(self.workspace, serves)
            if part is not None and (best is None or part[0] > best.share):
                best = Part(rated, *part)
        return best


def _least(clearance: Vector | None) -> float:
    """The least of clearances (k,), those not looked at left out; infinite where there are none."""
    return np.inf if clearance is None else float(np.min(clearance[~np.isnan(clearance)], initial=np.inf))


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

    Locked joints, differences of parallel joints, arm angles, the elbow's height, stationary costs, `radial` of the
    pseudo-inverse, and strategies designed from the best of these: each from several postures at the workspace's
    centre. They are ranked by the share of the workspace that they reach within the joint limits, and with the
    clearance where one is asked for; of strategies that cover alike those are first that keep well clear, by 0.01 m
    more than asked for; of these those that keep away from limits and singular postures; of these the one with the
    least joint speed. A strategy without a cusp near the workspace is preferred to one with, for up to a tenth more
    squared joint speed. All this is looked at pose by pose; `certify_by` of the advice is the call that proves it.

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
        ArgumentError: the robot is not redundant for the task; a workspace of one pose. OutOfReachError: no pose of
        the workspace is reached within the joint limits. JointLimitError: the start is beyond them. ShapeError,
        NotFiniteError.
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
    # The strategies, and the reasons why the best is the best
    case = Case(task, workspace, start, scene, progress)
    strategies = case.ranked()
    best = strategies[0]
    progress("the reasons")
    part = None if best.served.all() else case.part(strategies)
    sentences = list(reasons(strategies, case.checked[best.name], part, case.excess(strategies)))
    first = case.passed_over or best
    sentences += said_of(best.name, first.name, case.cusps, best.squared_speed / first.squared_speed - 1)
    level_interval = None
    if levels:
        level_interval, sentence = case.levels(best)
        sentences.append(sentence)
    return Advice(
        chain=chain, task=task, workspace=workspace, proposed=tuple(chosen), strategies=strategies,
        floor=case.floor_of(best), coverage=case.checked[best.name], reasons=tuple(sentences),
        cusps=case.cusps[best.name], part=part, seconds=time.perf_counter() - began, levels=level_interval, scene=scene,
    )  # fmt: skip
