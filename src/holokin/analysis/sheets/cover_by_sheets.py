"""`sheets`: the fewest leaves that serve a workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OutOfReachError
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, finite, not_negative, positive, whole
from ...motion.checks import Clear, Clearances, Scene
from ...motion.self_motions.pose_reach import Reach
from ...motion.self_motions.self_motions import self_motions_at
from ...path.workspaces import Workspace
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.pose_coordinates import task_poses
from ..coverage.starts import Candidate, check_that_joints_move
from .branch import Branch, branches_by_signs
from .candidate_sheets import CandidateSheets
from .level_ranges import branches_by_curves
from .set_cover import Cover, continued, fewest, labelled, same_postures
from .sheet import Sheet, known, nearby, neighbours, postures_of_sheets, spread_out, turn_length
from .sheet_growth import fitting_candidates
from .sheet_map import PoseRest, Sheets, in_the_way, rests_of

SHARE = 0.995
"""Of the poses that the arm reaches, to be served: the rest lies next to limits and the edge of reach."""

SAMPLES = 4096
"""Poses of the workspace."""

SEARCHED = 1600
"""Poses in reach by which a choice is looked for first; then it is looked at what it leaves out of all."""

LINES = 600
"""The same where leaves are followed by paths, or curves of general arms are looked for."""

LEFT_OUT = 400
"""Poses that join the search at most where a choice leaves them out."""

ROUNDS, PATIENCE = 30, 2
"""Rounds of the search at most, and rounds without gain that end it."""

TRIED = 5
"""Branches to which a rule is fitted in place of a sheet: those with most poses to gain."""

SECONDS, PROGRAM = 250.0, 20.0
"""For the search, and for an integer program, at most: rounds and nodes end them before, on most machines."""

NOTHING = Cover(np.zeros(0, dtype=int), 0, 0.0)


@typed
def sheets(
    task: Task,
    workspace: Workspace,
    strategies: Sequence[HolonomicStrategy] | None = None,
    *,
    q0: ArrayLike | None = None,
    share: float = SHARE,
    samples: int = SAMPLES,
    seed: int = 0,
    scene: Scene | None = None,
    rcond: float = 0.0,
    search: bool = True,
    seconds: float = SECONDS,
    progress: Callable[[str], None] = lambda _text: None,
) -> Sheets:
    """The fewest leaves that together serve a workspace, and for each pose the one to take.

    With one redundant joint all postures of a pose are known as self-motions. So each strategy that fits the task has,
    at each pose and on each branch, ranges of levels within the joint limits and clear of the scene: exactly for a held
    joint that leaves a closed form. Polynomials of the pose are fitted to these ranges, first for all poses, then for
    those that other sheets do not serve; of given strategies constant levels alone. With several redundant joints, and
    of six-joint arms, leaves through postures at poses all over the workspace are tried. An integer program chooses the
    fewest leaves that serve the share wanted, and of equally many those that serve more, with slower joints, further
    from their limits. A linear program chooses among the sheets of each pose, so that neighbouring poses have one sheet
    as often as can be. All of it is said of sampled poses.

    Args:
        workspace: the tool poses to be served.
        strategies: whose leaves are tried; by default held joints where these leave a closed form, else locks,
            differences of parallel joints, arm angles, the elbow's height and stationary costs, as of `hk.advise`.
        q0: postures (s, n), or one (n,), whose leaves are candidates, too, such as taught ones.
        share: to be served, of the poses that some posture reaches, from 0 to 1.
        samples, seed: of the poses, see `Workspace.poses`.
        scene: what postures are to keep clear of, as of `hk.certify`; it is looked at at the poses; by default nothing
            is.
        rcond: the least rcond of [J; J_g] at a posture, from 0 to 1.
        search: whether leaves are searched for; if not, those through q0 alone are compared.
        seconds: after which the search for leaves ends. Ctrl-C ends it, too: what was found is kept.
        progress: hears how far it is.

    Returns:
        The sheets; `print` says what they serve, and why the other poses are not served.

    Raises:
        OutOfReachError: no pose of the workspace is reached within the joint limits and clear of what was named.
        ArgumentError: a task of several frames, strategies of another task, or none of whose leaves serves a pose; bad
        numbers. UnknownNameError: no such link. JointLimitError: a q0 beyond them. ShapeError, NotFiniteError.
    """
    of_one_tool(task, "sheets")
    check_that_joints_move(task.robot)
    _check(task, strategies, share, rcond)
    if not search and q0 is None:
        raise ArgumentError("search", search, "give postures q0, whose leaves are compared, or let it search")
    count, limit = whole("samples", samples), positive("seconds", seconds)
    apart = None if scene is None else Clearances.of(task.robot, scene)
    clear = None if apart is None else apart.clear
    T = task_poses(task, workspace, min(count, workspace.size or count), seed)
    progress("which poses can be reached")
    rest, reach = rests_of(task, T, clear)
    within = np.flatnonzero(rest <= PoseRest.NOT_COVERED)
    if not len(within):
        blocked = T[rest == PoseRest.BLOCKED]
        pair = in_the_way(task, blocked[0], apart) if len(blocked) else None
        example = f" (for instance, at the best posture of one, {pair})" if pair else ""
        fact = f"of the workspace {workspace} no pose is served: {_why(rest, reach)}{example}"
        raise OutOfReachError(fact, "move or turn it")
    # The fewest of many leaves that serve the share.
    end = time.monotonic() + limit
    leaves = _Leaves(task, T[within], reach.q[within], strategies, clear, rcond, share, search)
    chosen, count, fewest_needed, stopped = leaves.cover(_given(task, q0), end, progress)
    # Their postures at all the poses, and which sheet is taken at each, that of most poses first.
    q = np.full((len(chosen), len(T), task.n), np.nan)
    q[:, within] = postures_of_sheets(chosen, T[within], clear, task.n)
    there = known(q)
    chosen = [replace(sheet, stations=q[s, there[s]], places=T[there[s]]) for s, sheet in enumerate(chosen)]
    pairs = within[neighbours(T[within], turn_length(task))]
    labels = labelled(there, pairs, continued(chosen, T, q, pairs), same_postures(q))
    order = np.argsort([-int((labels.of == s).sum()) for s in range(len(chosen))], kind="stable")
    place = np.append(np.argsort(order), -1)
    rest = np.where(labels.of >= 0, int(PoseRest.SERVED), rest)
    return Sheets(
        task, workspace, tuple(chosen[s] for s in order), T, q[order], place[labels.of], rest, pairs, labels.cuts,
        labels.least, fewest_needed, count, turn_length(task), scene, stopped,
    )  # fmt: skip


def _check(task: Task, strategies: Sequence[HolonomicStrategy] | None, share: float, rcond: float) -> None:
    if not 0 < positive("share", share) <= 1:
        raise ArgumentError("share", share, "give a number above 0, at most 1")
    if not_negative("rcond", rcond) >= 1:
        raise ArgumentError("rcond", rcond, "give a number from 0 to 1")
    if strategies is not None and not strategies:
        raise ArgumentError("strategies", [], "give one at least, or leave them out")
    for strategy in strategies or ():
        if strategy.task != task:
            raise ArgumentError("a strategy", strategy, "give strategies of the same task")


def _given(task: Task, q0: ArrayLike | None) -> Matrix:
    """The postures (s, n) that were given. Raises: ShapeError, NotFiniteError, JointLimitError: beyond the limits."""
    if q0 is None:
        return np.zeros((0, task.n))
    rows = finite("the postures of q0", q0)
    postures = finite("the postures of q0", np.atleast_2d(rows), ("s", task.n))
    for row in postures:
        task.robot.check_limits(row)
    return postures


def _why(rest: Indices, reach: Reach) -> str:
    """Why poses are not served, the joints named whose limits are in the way."""
    blocked = int((rest == PoseRest.BLOCKED).sum())
    counts = [(PoseRest.BLOCKED.text, blocked)] if blocked else []
    counts += reach.obstacles(np.flatnonzero(rest >= PoseRest.LIMITS))
    return "; ".join(f"{count}: {text}" for text, count in counts)


@dataclass(frozen=True, eq=False)
class _Leaves(Value):
    """What a cover is looked for: a share of poses T (K, 4, 4) in reach, with a posture (K, n) of each."""

    task: Task
    T: Array
    q: Matrix
    strategies: Sequence[HolonomicStrategy] | None
    clear: Clear | None
    rcond: float
    share: float
    search: bool

    def cover(self, q0: Matrix, end: float, progress: Callable[[str], None]) -> tuple[list[Sheet], int, int, bool]:
        """(the fewest sheets, of how many; how many are needed at least; whether the search was stopped early).

        A part of the poses is searched. The choice is then asked about all of them: those that it leaves out are
        searched, too.

        Args:
            q0: postures (s, n) whose leaves are candidates, too. end: time of the clock [s] after which no more leaves
                are looked for.
        """
        order, pool, cover, stopped = np.random.default_rng(0).permutation(len(self.T)), None, NOTHING, False
        left_out = order[:0]
        try:
            while True:
                pool = self._pool(order, left_out, len(q0) > 0, progress)
                for candidate in pool.candidates if len(q0) else ():
                    pool.add(candidate, q0)
                if self.search:
                    self._try_rounds(pool, end, progress)
                progress("asking the sheets")
                cover = _asked(pool)
                stopped = time.monotonic() > end
                if stopped or not self.search:
                    break
                left = self._left_out(pool, cover)
                new = left[~np.isin(left, pool.of)][:LEFT_OUT]
                if len(left) <= (1 - self.share) * len(self.T) or not len(new):
                    break
                left_out = np.concatenate([left_out, new])
        except KeyboardInterrupt:
            if pool is None or not pool.found:
                raise
            cover, stopped = _cover(pool), True
        if not pool.found:
            names = [candidate.name for candidate in pool.candidates]
            cure = "give other strategies, a smaller rcond, or a workspace nearer to the arm's middle"
            raise ArgumentError("the strategies", names, f"no leaf of them serves a pose: {cure}")
        return [pool.found[i].sheet for i in cover.chosen], len(pool.found), cover.least, stopped

    def _pool(self, order: Indices, left_out: Indices, given: bool, progress: Callable[[str], None]) -> CandidateSheets:
        """The candidates over some poses, a random part and those that were left out; none of them yet.

        given: whether postures were, through which leaves go.
        """
        task, one_redundant = self.task, self.task.n - self.task.m == 1
        others, branches, candidates = order[~np.isin(order, left_out)][:SEARCHED], list[Branch](), list[Candidate]()
        of = np.concatenate([others, left_out])
        T, q = self.T[of], self.q[of]
        progress("which levels serve")
        if self.search and one_redundant and self.strategies is None:
            branches = branches_by_signs(task, T, self.clear)
        if not branches and self.search:
            # Leaves by paths: of fewer poses.
            others = others[:LINES]
            of = np.concatenate([others, left_out])
            T, q = self.T[of], self.q[of]
        if not branches or given:
            progress("which strategies fit")
            center = T[spread_out(T, np.arange(len(T)), 1, turn_length(task))[0]]
            candidates = fitting_candidates(task, T, center, self.strategies, self.clear)
        if self.search and one_redundant and not branches:
            curves, near = self_motions_at(task, T[:, :3, 3], T[:, :3, :3]), nearby(T, turn_length(task))
            for candidate in candidates:
                progress(f"which levels of {candidate.name} serve")
                linked = branches_by_curves(candidate, T, near, self.clear, curves, 0.0)
                branches += [Branch(candidate, branch.ranges, branch.postures) for branch in linked]
        each = (len(self.T) - len(left_out)) / max(1, len(others))
        weights = np.repeat([each, 1.0], [len(others), len(left_out)])
        own = self.strategies is None
        return CandidateSheets(task, T, q, of, weights, candidates, branches, self.clear, self.rcond, self.share, own)

    def _left_out(self, pool: CandidateSheets, cover: Cover) -> Indices:
        """The poses that the sheets of a choice do not serve."""
        left = np.arange(len(self.T))
        for i in cover.chosen:
            left = left[~pool.found[i].sheet.postures(self.T[left], self.clear)[1]]
        return left

    def _try_rounds(self, pool: CandidateSheets, end: float, progress: Callable[[str], None]) -> None:
        """Adds sheets as long as a choice of them gets better."""
        # One level for all poses first, then polynomials of the pose, the simplest that will do.
        for degree in pool.degrees if pool.branches else ():
            pool.fit(np.ones(len(pool.T), dtype=bool), degree, TRIED)
            if (pool.sets @ pool.weights).max(initial=0.0) >= pool.preferred:
                return
        # Sheets for what is not served yet, one after another; then in place of each that is chosen.
        rng, chosen, still = np.random.default_rng(0), list[int](), 0
        for _ in range(ROUNDS):
            covered = pool.covered(chosen)
            progress(f"{len(chosen)} of {pool.tried} leaves serve {covered / len(self.T):.1%} of {len(pool.T)} poses")
            if time.monotonic() > end or still >= PATIENCE or (len(chosen) == 1 and covered >= pool.wanted):
                break
            for i in [None, *chosen] if covered >= pool.wanted else [None]:
                served: Flags = np.asarray(pool.sets[[j for j in chosen if j != i]].any(axis=0))
                if pool.branches:
                    pool.fit(~served, pool.degrees[-1], TRIED)
                elif not served.all():
                    pool.grow(pool.T[rng.choice(np.flatnonzero(~served))], pool.weights * ~served)
            better = pool.improved(chosen)
            fewer, wider = len(better) < len(chosen), covered < min(pool.preferred, pool.covered(better) - 0.5)
            still = 0 if fewer or wider else still + 1
            chosen = better
        pool.keep_useful(chosen)


def _asked(pool: CandidateSheets) -> Cover:
    """The cover of sheets that were asked themselves, the widest first."""
    cover = _cover(pool)
    while pool.exact(cover.chosen):
        cover = _cover(pool)
    return cover


def _cover(pool: CandidateSheets) -> Cover:
    """The fewest sheets, the widest first."""
    if not pool.found:
        return NOTHING
    cover = fewest(pool.sets, pool.wanted, pool.costs, PROGRAM, pool.weights, pool.preferred)
    widest = np.argsort(-(pool.sets[cover.chosen] @ pool.weights), kind="stable")
    return replace(cover, chosen=cover.chosen[widest])
