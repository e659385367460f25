"""Where a strategy serves a workspace: cusps of its leaves near it, and the levels that serve it. Theory 7.3"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError
from ...base.types import Array, ArrayLike, Matrix, NoTruthValue, Result, Value, Vector, positive
from ...motion.ik import ik, move_to_leaf
from ...motion.ik.inverse_function import level_margins
from ...path.workspaces import Workspace
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import of_one_tool
from ..curvature import Cusps, cusps
from ..curvature.cuspidal_leaf import cusps_from, tool_away

NEAR = 0.1
"""Distance [m] of a cusp from the nearest of many poses of a workspace, a turn of one radian counted as 0.1 m, up to
which it counts: these poses are about so far apart."""

STARTS = 300
"""Starts of the search for them."""

MORE_SPEED = 1.1
"""Mean squared joint speed, over that of the best strategy, at which a strategy without cusps nearby is preferred at
most."""


@dataclass(frozen=True, eq=False)
class NearbyCusps(Result, Value):
    """The cusps found on a strategy's leaf, and their least distance [m] from a workspace, infinite where none was
    found.

    found: None where they cannot be looked for, `reason` says why; the distance is NaN then. pose: of the tool at the
    nearest (4, 4), None where there is none.
    """

    found: Cusps | None
    away: float
    reason: str = ""
    pose: Matrix | None = None

    @property
    def near(self) -> bool:
        """Whether one is at the workspace, or nearly."""
        return self.away <= NEAR

    @property
    def clear(self) -> bool:
        """Whether they were looked for, and none is at the workspace."""
        return self.away > NEAR

    @property
    def sentence(self) -> str:
        """What was found; a search is no proof."""
        if self.found is None:
            return f"cusps of its leaf were not looked for: {self.reason}"
        if self.found.excluded:
            return f"its leaf has no cusp: {self.found.excluded}"
        searched = f"a search from {self.found.starts:,} starts and from the workspace, no proof"
        if not np.isfinite(self.away):
            return f"no cusp was found on its leaf within the joint limits ({searched})"
        if self.near:
            return (
                f"a cusp of its leaf lies in the workspace, or within {NEAR:g} m of it: round a cusp a closed path of "
                "the tool may not bring the joints back"
            )
        return f"the nearest cusp of its leaf that was found is {self.away:.2g} m from the workspace ({searched})"

    @property
    def loop(self) -> str:
        """The smallest tool loop found that does not bring the joints back; empty where none was found."""
        least = None if self.found is None else self.found.witness
        if least is None:
            return ""
        turns = f" and turns by {least.turn:.2g} rad" if least.turn else ""
        return (
            f"the smallest tool loop found on its leaf that does not bring the joints back is {least.length:.2g} m long"
            f"{turns}; after it a joint is {least.apart:.2g} (rad or m) from where it was"
        )

    @property
    def lines(self) -> str:
        """Sentence and loop, each a line that begins with a large letter."""
        return "\n".join(f"{text[:1].upper()}{text[1:]}." for text in (self.sentence, self.loop) if text)

    def __str__(self) -> str:
        return self.sentence


def cusps_near(strategy: Strategy, q0: Vector, space: Workspace) -> NearbyCusps:
    """Those of the leaf through q0, and how far they are from a workspace; or why they cannot be looked for."""
    constraint = getattr(strategy, "constraint", None)
    if constraint is None or constraint.looped is not None:
        return NearbyCusps(None, np.nan, "its formulas are too long")
    try:
        leaf_cusps = cusps(strategy, q0, starts=STARTS)
    except HolokinError as problem:  # such as a posture beyond the joint limits, where a design could not keep them
        return NearbyCusps(None, np.nan, str(problem))
    if leaf_cusps.excluded:
        return NearbyCusps(leaf_cusps, np.inf)
    # Those of the search, and those that Newton's method finds from the workspace
    poses = space.poses(16_384)
    ends = ik(strategy, q0, limits=False).batch(space.poses(STARTS)).last
    near = cusps_from(leaf_cusps.strategy, leaf_cusps.level, ends[np.isfinite(ends).all(axis=1)], limits=True)
    tool_poses = np.concatenate([leaf_cusps.poses, near])
    if not len(tool_poses):
        return NearbyCusps(leaf_cusps, np.inf)
    away = tool_away(strategy.task, tool_poses, poses)
    return NearbyCusps(leaf_cusps, float(away.min()), pose=tool_poses[away.argmin()])


# --- The levels of a strategy whose leaves serve a whole workspace: how far the elbow may go while the tool works.

LEVEL_POSES = 256
"""Poses of the workspace by which levels are tried."""


@dataclass(frozen=True, eq=False)
class LevelRange(NoTruthValue, Value, ask="`.intervals`"):
    """What the leaves g(q) = c serve of a workspace, for levels c about that of a start.

    levels (k,), rising; shares (k,): of the poses that `ik(pose, level=c)` reaches, within the joint limits where these
    were asked for. intervals: the ranges of levels that serve all poses. best: the middle of the longest interval, or
    the level that serves most; q0 (n,): a posture on its leaf, with the tool pose of the start. cusps: those near the
    workspace on that leaf.
    """

    strategy: HolonomicStrategy
    workspace: Workspace
    level: float
    levels: Vector
    shares: Vector
    intervals: tuple[tuple[float, float], ...]
    best: float
    q0: Vector
    cusps: NearbyCusps

    @property
    def served(self) -> str:
        """Which levels serve it."""
        tried = f"of {len(self.levels)} levels tried, {LEVEL_POSES} poses each"
        if self.intervals:
            parts = " and ".join(f"{low:.3g} to {high:.3g}" for low, high in self.intervals)
            return f"levels of {parts} serve all of the workspace ({tried}); {self.best:.3g} is in the middle"
        return f"no level serves all of the workspace ({tried}); {self.best:.3g} serves {self.shares.max():.1%}"

    @property
    def sentence(self) -> str:
        """Which levels serve it, and what was found of the best one."""
        return f"{self.served}; at this level {self.cusps.sentence}"

    def __str__(self) -> str:
        return self.sentence


@typed
def level_range(
    strategy: HolonomicStrategy,
    workspace: Workspace,
    q0: ArrayLike,
    *,
    step: float = 0.05,
    limits: bool = True,
    progress: Callable[[str], None] = lambda _text: None,
) -> LevelRange:
    """The levels c of a constraint of one row whose leaves serve a whole workspace.

    `ik(pose, level=c)` is asked for the poses, at levels from that of q0 outwards, until none is served, or an angle
    has gone half round. The ends of the intervals are then halved, to a thousandth of the step. Where a closed form
    gives the postures, to 1e-7, and gaps between levels are looked for, too. A level in between may fail at poses
    between those asked; `unique_region(strategy, found.q0, workspace)` proves one.

    Args:
        q0: posture (n,) that the straight paths to the poses begin at.
        step: between the levels that are tried [rad, m, or the constraint's unit].
        limits: within the joint limits.
        progress: hears how far it is.

    Raises:
        ArgumentError: a constraint of several rows, a task of several frames. SingularityError: it is singular at q0.
        JointLimitError: with limits, q0 is beyond them.
    """
    of_one_tool(strategy.task, "a range of levels")
    rows = strategy.task.n - strategy.task.m
    if rows != 1:
        cure = "ask of a strategy with one redundant joint, or lock the others"
        raise ArgumentError("the number of rows of the constraint", rows, cure)
    positive("step", step)
    start = start_posture(strategy.task.robot, q0, limits)
    solver, poses = ik(strategy, start, limits), workspace.poses(LEVEL_POSES)
    level = float(np.ravel(strategy.constraint_value(start))[0])

    def share(c: float) -> float:
        try:
            return float(solver.batch(poses, level=c).reached.mean())
        except ArgumentError:  # no joints take this level
            return 0.0

    # Levels to both sides, 400 at most, until none is served or an angle has gone half round
    known, far = {level: share(level)}, 400
    if strategy.constraint.angular[0]:
        far = min(far, int(np.pi / step))
    for sign in (-1.0, 1.0):
        for k in range(1, far + 1):
            c = level + sign * k * step
            progress(f"level {c:.3g}")
            known[c] = share(c)
            if known[c] == 0.0:
                break
    levels = np.array(sorted(known))
    shares = np.array([known[c] for c in levels])
    # The intervals that serve all, and the middle of the longest; a closed form tells of gaps between two levels, too
    every, exact = known.copy(), 1e-3 * step
    if (margins := level_margins(solver)) is not None:
        every |= {c: share(c) for c in _dips(margins, poses, levels[shares == 1.0], step)}
        exact = 1e-7
    tried = np.array(sorted(every))
    intervals = _intervals(tried, np.array([every[c] for c in tried]), share, exact)
    longest = max(intervals, key=lambda ends: ends[1] - ends[0], default=None)
    best = float(levels[np.argmax(shares)]) if longest is None else (longest[0] + longest[1]) / 2
    q = move_to_leaf(strategy, start, best, limits=False)
    near = cusps_near(strategy, q, workspace)
    return LevelRange(strategy, workspace, level, levels, shares, intervals, best, q, near)


def _dips(margins: Callable[[Array, Vector], Vector], poses: Array, levels: Vector, step: float) -> Sequence[float]:
    """Levels between some that serve all poses (k, 4, 4) at which a pose is not served: where its margin is least."""
    if len(levels) < 3:
        return ()
    k, count = len(poses), len(levels)
    M = margins(np.repeat(poses, count, axis=0), np.tile(levels, k)).reshape(k, count)
    lowest = (M[:, 1:-1] <= M[:, :-2]) & (M[:, 1:-1] <= M[:, 2:]) & (levels[2:] - levels[:-2] < 2.5 * step)
    pose, place = np.nonzero(lowest)
    low, high, some = levels[place], levels[place + 2], poses[pose]
    for _ in range(40):  # thirds of an interval: to 1e-7 of a step
        a, b = low + (high - low) / 3, high - (high - low) / 3
        falls = margins(some, a) > margins(some, b)
        low, high = np.where(falls, a, low), np.where(falls, high, b)
    least = (low + high) / 2
    return np.unique(least[margins(some, least) < 0].round(9)).tolist()


def _intervals(
    levels: Vector, shares: Vector, share: Callable[[float], float], exact: float
) -> tuple[tuple[float, float], ...]:
    """The ranges in which all poses are served, their ends halved towards the levels beside them."""

    def end(i: int, beside: int) -> float:
        inside = float(levels[i])
        if not 0 <= beside < len(levels):
            return inside
        outside = float(levels[beside])
        while abs(outside - inside) > exact:
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if share(middle) == 1.0 else (inside, middle)
        return inside

    edges = np.diff(np.concatenate([[False], shares == 1.0, [False]]).astype(int))
    first, last = np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist()
    return tuple((end(i, i - 1), end(j, j + 1)) for i, j in zip(first, last, strict=True))
