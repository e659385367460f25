"""The levels of a law whose leaves serve a whole workspace: how far the elbow may go while the tool works."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.types import ArrayLike, NoTruthValue, Value, Vector, positive
from ...motion.ik import inverse, move_to_leaf
from ...path.workspaces import Workspace
from ...robot import start_posture
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import of_one_tool
from .nearby_cusps import NearbyCusps, cusps_near

STEP, POSES = 0.05, 256
"""Difference of the levels that are tried [rad, m, or the constraint's unit]; poses of the workspace."""

MOST = 400
"""Levels that are tried to either side of the start's."""

EXACT = 1e-3
"""Share of a step to which the ends of an interval are halved."""


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
        tried = f"of {len(self.levels)} levels tried, {POSES} poses each"
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
    step: float = STEP,
    limits: bool = True,
    say: Callable[[str], None] = lambda _text: None,
) -> LevelRange:
    """The levels c of a constraint of one row whose leaves serve a whole workspace.

    `ik(pose, level=c)` is asked for the poses, at levels from that of q0 outwards, until none is served, or an angle
    has gone half round. The ends of the intervals are then halved. A level in between may fail at poses between those
    asked; `unique_region(strategy, found.q0, workspace)` proves one.

    Args:
        q0: posture (n,) that the straight paths to the poses begin at.
        step: between the levels that are tried.
        limits: within the joint limits.
        say: hears of the progress.

    Raises:
        ArgumentError: a constraint of several rows, a task of several frames. SingularityError: it is singular at q0.
        JointLimitError: with limits, q0 is beyond them.
    """
    of_one_tool(strategy.task, "a range of levels")
    rows = strategy.task.n - strategy.task.m
    if rows != 1:
        cure = "ask of a law with one redundant joint, or lock the others"
        raise ArgumentError("the number of rows of the constraint", rows, cure)
    positive("step", step)
    begin = start_posture(strategy.task.robot, q0, limits)
    ik, poses = inverse(strategy, begin, limits), workspace.poses(POSES)
    at = float(np.ravel(strategy.constraint_value(begin))[0])
    far = int(np.pi / step) if strategy.constraint.angular[0] else MOST

    def share(c: float) -> float:
        try:
            return float(ik.batch(poses, level=c).reached.mean())
        except ArgumentError:  # no joints take this level
            return 0.0

    known = {at: share(at)}
    for sign in (-1.0, 1.0):
        for k in range(1, min(far, MOST) + 1):
            c = at + sign * k * step
            say(f"level {c:.3g}")
            known[c] = share(c)
            if known[c] == 0.0:
                break
    levels = np.array(sorted(known))
    shares = np.array([known[c] for c in levels])
    intervals = _intervals(levels, shares, share, EXACT * step)
    best = max(intervals, key=lambda ends: ends[1] - ends[0], default=None)
    middle = float(levels[np.argmax(shares)]) if best is None else (best[0] + best[1]) / 2
    there = move_to_leaf(strategy, begin, middle, limits=False)
    return LevelRange(
        strategy, workspace, at, levels, shares, intervals, middle, there, cusps_near(strategy, there, workspace)
    )


def _intervals(
    levels: Vector, shares: Vector, share: Callable[[float], float], exact: float
) -> tuple[tuple[float, float], ...]:
    """The ranges in which all poses are served, their ends halved towards the levels beside them."""

    def end(inside: float, outside: float) -> float:
        while abs(outside - inside) > exact:
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if share(middle) == 1.0 else (inside, middle)
        return inside

    full = np.concatenate([[False], shares == 1.0, [False]]).astype(int)
    first, last = np.flatnonzero(np.diff(full) == 1), np.flatnonzero(np.diff(full) == -1) - 1
    return tuple(
        (
            end(levels[i], levels[i - 1]) if i else float(levels[i]),
            end(levels[j], levels[j + 1]) if j + 1 < len(levels) else float(levels[j]),
        )
        for i, j in zip(first, last, strict=True)
    )
