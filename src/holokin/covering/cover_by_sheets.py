"""`sheets`: the fewest leaves that serve a workspace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..base.arguments import typed
from ..base.types import Array, ArrayLike, Indices, Matrix, finite, not_negative, positive, whole
from ..checking import Clear
from ..designing.starts import check_that_joints_move
from ..errors import ArgumentError, OutOfReachError
from ..path.workspaces import Workspace
from ..robot import LinkShape, Robot, check_metres
from ..strategies import HolonomicStrategy
from ..tasks.task import Task, of_one_tool
from .candidate_sheets import CandidateSheets, fitting_laws
from .pose_features import neighbours, spread_out, turn_length
from .pose_rest import PoseRest, rests_of
from .set_cover import Cover, fewest
from .sheet import known
from .sheet_labels import continued, labelled, same_postures
from .sheet_map import Sheets
from .surroundings import CLEARANCE, Surroundings, surroundings

SHARE = 0.995
"""Share that is to be served of the poses that the arm reaches: the rest lies next to limits and the edge of reach."""

SAMPLES = 1024
"""Poses of the workspace."""

TARGETS = 4
"""Poses in a round of the search through which new leaves are tried."""

ROUNDS, PATIENCE = 12, 2
"""Rounds at most. As many rounds without gain as there are sheets end the search, two at least: the more sheets there
are, the more there is to gain."""

SECONDS, PROGRAM = 280.0, 60.0
"""Seconds for the search, and for an integer program, at most: rounds and nodes end them before, on most machines."""


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
    clear_of: Sequence[LinkShape] | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
    shapes_of: Robot | None = None,
    rcond: float = 0.0,
    seconds: float = SECONDS,
    say: Callable[[str], None] = lambda _text: None,
) -> Sheets:
    """The fewest leaves that together serve a workspace, and for each pose the one to take.

    Leaves of the laws that fit the task (or of those given) are tried through postures at poses all over the workspace,
    first where no leaf serves yet. With one redundant joint, leaves are tried, too, whose level is a polynomial of the
    pose, fitted by linear programs to the levels that each pose allows. An integer program chooses the fewest leaves
    that serve the share wanted, and of equally many those that serve more, with slower joints, further from their
    limits. A linear program chooses among the sheets of each pose, so that neighbouring poses have one sheet as often
    as can be. All of it is said of sampled poses.

    Args:
        workspace: the tool poses to be served.
        strategies: whose leaves are tried; by default locks, differences of parallel joints, arm angles, the elbow's
            height and stationary costs, as of `hk.advise`.
        q0: postures (s, n), or one (n,), whose leaves are candidates, too, such as taught ones.
        share: to be served, of the poses that some posture reaches, from 0 to 1.
        samples, seed: of the poses, see `Workspace.poses`.
        clear_of, floor, clearance, self_collision, ignore, shapes_of: what postures are to keep clear of, as of
            `hk.certify`; it is looked at at the poses; by default nothing is.
        rcond: the least rcond of [J; J_g] at a posture, from 0 to 1.
        seconds: after which the search for leaves ends. Ctrl-C ends it, too: what was found is kept.
        say: hears what is going on.

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
    count, limit = whole("samples", samples), positive("seconds", seconds)
    around = surroundings(clear_of, floor, clearance, self_collision, ignore, shapes_of)
    clear = None if around is None else around.clear(task.robot)
    T = workspace.poses(min(count, workspace.size or count), seed)
    check_metres(task.robot, T, task.tip)
    say("which poses can be reached")
    rest = rests_of(task, T, clear)
    within = np.flatnonzero(rest <= PoseRest.NOT_COVERED)
    if not len(within):
        raise OutOfReachError(f"of the workspace {workspace} no pose is served: {_why(rest)}", "move or turn it")
    given = _given(task, q0)
    pool, cover, stopped = _search(task, T[within], strategies, given, share, rcond, clear, limit, say)
    return _mapped(task, workspace, T, rest, within, pool, cover, around, stopped)


def _check(task: Task, strategies: Sequence[HolonomicStrategy] | None, share: float, rcond: float) -> None:
    if not 0 < positive("share", share) <= 1:
        raise ArgumentError("share", share, "give a number above 0, at most 1")
    if not_negative("rcond", rcond) >= 1:
        raise ArgumentError("rcond", rcond, "give a number from 0 to 1")
    if strategies is not None and not strategies:
        raise ArgumentError("strategies", [], "give one at least, or leave them out")
    for one in strategies or ():
        if one.task != task:
            raise ArgumentError("a strategy", one, "give strategies of the same task")


def _given(task: Task, q0: ArrayLike | None) -> Matrix:
    """The postures (s, n) that were given. Raises: ShapeError, NotFiniteError, JointLimitError: beyond the limits."""
    if q0 is None:
        return np.zeros((0, task.n))
    rows = finite("the postures of q0", q0)
    found = finite("the postures of q0", np.atleast_2d(rows), ("s", task.n))
    for row in found:
        task.robot.check_limits(row)
    return found


def _why(rest: Indices) -> str:
    counts = [(int((rest == one).sum()), one.text) for one in PoseRest]
    return "; ".join(f"{count}: {text}" for count, text in counts if count)


def _search(
    task: Task, T: Array, strategies: Sequence[HolonomicStrategy] | None, q0: Matrix, share: float, rcond: float,
    clear: Clear | None, seconds: float, say: Callable[[str], None],
) -> tuple[CandidateSheets, Cover, bool]:  # fmt: skip
    """Leaves through postures at poses all over, until the fewest that serve the share get no fewer."""
    end, wanted, rng = time.monotonic() + seconds, int(np.ceil(share * len(T))), np.random.default_rng(0)
    center = T[spread_out(T, np.arange(len(T)), 1, turn_length(task))[0]]
    say("which laws fit")
    pool = CandidateSheets(task, T, fitting_laws(task, T, center, strategies, clear), clear, rcond, strategies is None)
    cover, still = Cover(np.zeros(0, dtype=int), 0, 0), 0
    try:
        for law in pool.laws:
            pool.add(law, q0)
        pool.grow(center, np.arange(0), end, say)
        for round_ in range(ROUNDS):
            before, cover = cover, _cover(pool, wanted)
            while cover.covered >= wanted and pool.exact(cover.chosen):
                cover = _cover(pool, wanted)
            few, met = len(cover.chosen) < len(before.chosen), before.covered >= wanted
            better = few if met else cover.covered > before.covered
            still = 0 if better else still + 1
            enough = len(cover.chosen) == 1 and cover.covered >= wanted
            if enough or still >= max(len(cover.chosen), PATIENCE) or time.monotonic() > end:
                break
            say(f"{len(cover.chosen)} of {pool.tried} leaves serve {cover.covered} of {len(T)} poses")
            left = _left(pool, cover)
            pool.vary(cover.chosen, rng, round_, end)
            for i in _targets(left, len(T), rng):
                pool.grow(T[i], left, end, say)
        stopped = time.monotonic() > end
    except KeyboardInterrupt:
        if not pool.sheets:
            raise
        stopped = True
    if not pool.sheets:
        cure = "give other strategies, a smaller rcond, or a workspace nearer to the arm's middle"
        raise ArgumentError("the strategies", [law.name for law in pool.laws], f"no leaf of them serves a pose: {cure}")
    cover = _cover(pool, wanted)
    try:
        say("asking the sheets")
        while pool.exact(cover.chosen):
            cover = _cover(pool, wanted)
    except KeyboardInterrupt:  # sheets that were not asked serve what is straight from their q0
        stopped = True
    return pool, cover, stopped


def _left(pool: CandidateSheets, cover: Cover) -> Indices:
    """The poses that the widest sheet of a cover does not serve: those that the others are for."""
    if not len(cover.chosen):
        return np.arange(len(pool.T))
    sets = pool.sets[cover.chosen]
    return np.flatnonzero(~sets[int(np.argmax(sets.sum(axis=1)))])


def _targets(left: Indices, count: int, rng: np.random.Generator) -> list[int]:
    """Poses through which leaves are tried next: most of them where the widest sheet fails."""
    some = rng.choice(left, min(TARGETS - 1, len(left)), replace=False) if len(left) else left
    return [*some.tolist(), *rng.choice(count, TARGETS - len(some)).tolist()]


def _cover(pool: CandidateSheets, wanted: int) -> Cover:
    if not pool.sheets:
        return Cover(np.zeros(0, dtype=int), 0, 0)
    costs = np.array(pool.costs)
    return fewest(pool.sets, wanted, costs / costs.max(), PROGRAM)


def _mapped(
    task: Task, workspace: Workspace, T: Array, rest: Indices, within: Indices, pool: CandidateSheets, cover: Cover,
    around: Surroundings | None, stopped: bool,
) -> Sheets:  # fmt: skip
    """The sheets chosen, that of most poses first, with what each sampled pose gets."""
    chosen = [pool.sheets[i] for i in cover.chosen[np.argsort(-pool.sets[cover.chosen].sum(axis=1), kind="stable")]]
    q = np.full((len(chosen), len(T), task.n), np.nan)
    for s, sheet in enumerate(chosen):
        q[s, within] = sheet.postures(T[within], pool.clear)[0]
    there = known(q)
    chosen = [replace(one, stations=q[s, there[s]], places=T[there[s]]) for s, one in enumerate(chosen)]
    pairs = within[neighbours(T[within], turn_length(task))]
    labels = labelled(known(q), pairs, continued(chosen, T, q, pairs), same_postures(q))
    order = np.argsort([-int((labels.of == s).sum()) for s in range(len(chosen))], kind="stable")
    place = np.append(np.argsort(order), -1)
    rest = np.where(labels.of >= 0, int(PoseRest.SERVED), rest)
    return Sheets(
        task, workspace, tuple(chosen[s] for s in order), T, q[order], place[labels.of], rest, pairs, labels.cuts,
        labels.least, cover.least, len(pool.sheets), turn_length(task), around, stopped,
    )  # fmt: skip
