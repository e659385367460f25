"""`sheets`: the fewest leaves that serve a workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OutOfReachError
from ...base.types import ArrayLike, Flags, Indices, Matrix, finite, not_negative, positive, whole
from ...motion.checks import Clearances, Scene
from ...motion.self_motions.pose_reach import Reach
from ...path.workspaces import Workspace
from ...robot import check_metres
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.starts import check_that_joints_move
from .candidate_sheets import CandidateSheets, fitting_candidates
from .set_cover import Cover, continued, fewest, labelled, same_postures
from .sheet import known, neighbours, postures_of_sheets, spread_out, turn_length
from .sheet_growth import SearchedPoses
from .sheet_map import PoseRest, Sheets, rests_of

# Share that is to be served of the poses that the arm reaches: the rest lies next to limits and the edge of reach.
SHARE = 0.995

SAMPLES = 4096  # poses of the workspace
FIRST = 2000  # poses in reach for which a choice is looked for first; then it is looked at what it leaves out of all
TARGETS = 4  # poses in a round of the search through which new leaves are tried

NOTHING = Cover(np.zeros(0, dtype=int), 0, 0.0)

# Rounds at most. As many rounds without gain as there are sheets end the search, two at least: the more sheets there
# are, the more there is to gain.
ROUNDS, PATIENCE = 30, 2

# Seconds for the search, and for an integer program, at most: rounds and nodes end them before, on most machines.
SECONDS, PROGRAM = 250.0, 60.0


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

    Leaves of the strategies that fit the task (or of those given) are tried through postures at poses all over the
    workspace, first where no leaf serves yet. With one redundant joint, leaves are tried, too, whose level is a
    polynomial of the pose, fitted by linear programs to the levels that each pose allows. An integer program chooses
    the fewest leaves that serve the share wanted, and of equally many those that serve more, with slower joints,
    further from their limits. A linear program chooses among the sheets of each pose, so that neighbouring poses have
    one sheet as often as can be. All of it is said of sampled poses.

    Args:
        workspace: the tool poses to be served.
        strategies: whose leaves are tried; by default locks, differences of parallel joints, arm angles, the elbow's
            height and stationary costs, as of `hk.advise`.
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
    clear = None if scene is None else Clearances.of(task.robot, scene).clear
    T = workspace.poses(min(count, workspace.size or count), seed)
    check_metres(task.robot, T, task.tip)
    progress("which poses can be reached")
    rest, reach = rests_of(task, T, clear)
    within = np.flatnonzero(rest <= PoseRest.NOT_COVERED)
    if not len(within):
        raise OutOfReachError(f"of the workspace {workspace} no pose is served: {_why(rest, reach)}", "move or turn it")
    # The fewest of many leaves that serve the share.
    given, end = _given(task, q0), time.monotonic() + limit
    poses = SearchedPoses.of(T[within], turn_length(task), FIRST)
    center = T[within][spread_out(T[within], np.arange(len(within)), 1, turn_length(task))[0]]
    progress("which strategies fit")
    candidates = fitting_candidates(task, poses.T, center, strategies, clear)
    pool = CandidateSheets(
        task, poses if search else poses.all, candidates, clear, rcond, own=strategies is None, share=share
    )
    cover, stopped = _search(pool, given, center if search else None, end, progress)
    # Their postures at all the poses, and which sheet is taken at each, that of most poses first.
    chosen = [pool.found[i].sheet for i in cover.chosen]
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
        labels.least, cover.least, len(pool.found), turn_length(task), scene, stopped,
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


def _search(
    pool: CandidateSheets, q0: Matrix, center: Matrix | None, end: float, progress: Callable[[str], None]
) -> tuple[Cover, bool]:
    """(the fewest leaves that serve the share, whether the search was stopped early).

    Leaves through postures at poses all over are tried, until their number gets no fewer. A part of the poses is
    searched. When the choice gets no better, it is asked about more of them, at last about all: those that it leaves
    out are searched, too.

    Args:
        q0: postures (s, n) whose leaves are candidates, too. center: the pose that is tried first; None for no search.
        end: time of the clock [s] after which no more leaves are looked for.
    """
    try:
        for candidate in pool.candidates:
            pool.add(candidate, q0)
        if center is not None:
            pool.grow(center, np.arange(0), end, progress)
            _try_rounds(pool, end, progress)
        stopped = time.monotonic() > end
    except KeyboardInterrupt:
        if not pool.found:
            raise
        stopped = True
    if not pool.found:
        names = [candidate.name for candidate in pool.candidates]
        cure = "give other strategies, a smaller rcond, or a workspace nearer to the arm's middle"
        raise ArgumentError("the strategies", names, f"no leaf of them serves a pose: {cure}")
    try:
        progress("asking the sheets")
        return _asked(pool), stopped
    except KeyboardInterrupt:  # sheets that were not asked serve what is straight from their q0
        return _cover(pool), True


def _try_rounds(pool: CandidateSheets, end: float, progress: Callable[[str], None]) -> None:
    """Adds leaves, round after round, as long as the choice gets better."""
    rng, still, cover = np.random.default_rng(0), 0, _asked(pool)
    if not pool.poses.complete:
        cover = _looked_closer(pool, pool.poses, cover, _served(pool, pool.poses, cover.chosen[:1]))
        pool.add_candidates(_left(pool, cover))
    for round_ in range(ROUNDS):
        enough = len(cover.chosen) == 1 and cover.covered >= pool.wanted.least
        if enough or still >= max(len(cover.chosen), PATIENCE):
            more = pool.poses.more()
            if more is pool.poses and more.complete:
                return
            served = _served(pool, more, cover.chosen)
            if more is pool.poses and served.sum() >= pool.wanted.least:
                return
            cover, still = _looked_closer(pool, more, cover, served), 0
        if time.monotonic() > end:
            return
        count = len(pool.poses.reach)
        progress(f"{len(cover.chosen)} of {pool.tried} leaves serve {cover.covered / count:.1%} of {count} poses")
        left = _left(pool, cover)
        pool.vary(cover.chosen, rng, round_, end)
        for i in _targets(left, len(pool.T), rng):
            pool.grow(pool.T[i], left, end, progress)
        before, cover = cover, _asked(pool)
        fewer = before.covered >= pool.wanted.least and len(cover.chosen) < len(before.chosen)
        wider = before.covered < min(pool.wanted.preferred, cover.covered - 0.5)
        still = 0 if fewer or wider else still + 1


def _looked_closer(pool: CandidateSheets, poses: SearchedPoses, cover: Cover, served: Flags) -> Cover:
    """The choice after those poses that are not served have joined those that are searched."""
    pool.look_at(poses.without(served), pool.worth(cover.chosen))
    return _asked(pool)


def _served(pool: CandidateSheets, poses: SearchedPoses, which: Indices) -> Flags:
    """Which of all the poses in reach (K,) some sheets serve."""
    T = poses.reach
    served = np.zeros(len(T), dtype=bool)
    for i in which:
        left = np.flatnonzero(~served)
        served[left] = pool.found[i].sheet.postures(T[left], pool.clear)[1]
    return served


def _asked(pool: CandidateSheets) -> Cover:
    """The cover of sheets that were asked themselves, the widest first."""
    cover = _cover(pool)
    while pool.exact(cover.chosen):
        cover = _cover(pool)
    return cover


def _left(pool: CandidateSheets, cover: Cover) -> Indices:
    """The poses that the widest sheet of a cover does not serve: those that the others are for."""
    if not len(cover.chosen):
        return np.arange(len(pool.T))
    return np.flatnonzero(~pool.found[cover.chosen[0]].served)


def _targets(left: Indices, count: int, rng: np.random.Generator) -> list[int]:
    """Poses through which leaves are tried next: most of them where the widest sheet fails."""
    some = rng.choice(left, min(TARGETS - 1, len(left)), replace=False) if len(left) else left
    return [*some.tolist(), *rng.choice(count, TARGETS - len(some)).tolist()]


def _cover(pool: CandidateSheets) -> Cover:
    """The fewest sheets, the widest first."""
    if not pool.found:
        return NOTHING
    weights = pool.poses.weights
    cover = fewest(pool.sets, pool.wanted.least, pool.costs, PROGRAM, weights, pool.wanted.preferred)
    widest = np.argsort(-(pool.sets[cover.chosen] @ weights), kind="stable")
    return replace(cover, chosen=cover.chosen[widest])
