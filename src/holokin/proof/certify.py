"""`certify`: the proof that a leaf is one smooth function over a path."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, PathError
from ..motion import follow
from ..path import Path
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic.intervals import Interval
from ..types import ArrayLike, whole
from .certificate import Certificate, Proven, least_determinant, hull_of
from .pathway import Guess, closing, covered, glued

SAMPLES = 256
"""Samples of the path that the predictors start from."""


@typed
def certify(
    strategy: Strategy, path: Path, q0: ArrayLike, *, limits: bool = True, budget: int = 20_000
) -> Certificate:
    """Prove that the leaf through q0 is one smooth function over a path."""
    if not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("the strategy to certify", strategy.name, HolonomicStrategy.cure)
    began = time.perf_counter()
    robot = strategy.task.robot
    start = robot.checked(q0, "the start posture")
    whole("budget", budget)
    ended = ""
    try:
        walk = follow(strategy, path, start, samples=SAMPLES, method="leaf", limits=limits)
    except PathError as problem:
        if problem.trajectory is None or len(problem.trajectory) < 2:
            raise
        walk, ended = problem.trajectory, problem.fact
    guess = Guess.of(path, walk, SAMPLES, strategy.task.pose(start)[:3, :3])
    c = strategy.g(start)
    bounds = Interval(robot.lower, robot.upper) if limits else None
    equation, found = covered(strategy, guess, c, bounds, budget)
    status, where = found.status, ""
    joined = glued(found)
    if status is Proven.WHOLE and not joined.all():
        status = Proven.APART
    if status is Proven.WHOLE and ended:
        status, where = Proven.END, ended
    turns, gap = np.zeros(robot.n), np.inf
    if status is Proven.WHOLE and path.closed:
        turns, gap = closing(found, np.array([c.unit == "rad" for c in robot.coordinates]))
    low, high = hull_of(found.findings)
    return Certificate(
        f"{strategy.name}, {strategy.task.name}", "", status, where, found.cells, found.findings, found.piece, c,
        low, high, np.minimum(low - robot.lower, robot.upper - high), least_determinant(found.findings), turns, gap,
        time.perf_counter() - began,
    )  # fmt: skip
