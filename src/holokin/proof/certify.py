"""`certify`: the proof that a leaf is one smooth function over a path, or over a box of tool poses."""

from __future__ import annotations

import time

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, PathError
from ..motion import follow
from ..path import Path
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic.intervals import Interval
from ..types import ArrayLike, Flags, whole
from ..workspaces import Workspace
from .certificate import Certificate, Proven, hull_of, least_determinant
from .pathway import Pathway, closing, in_order, unglued
from .posebox import PoseRegion, unglued_faces
from .search import Boxes, Covered, Domain, _halves, covered

SAMPLES = 256
"""Samples of the path that the predictors start from."""

ROUNDS = 12
"""Times that cells which could not be glued are halved."""


@typed
def certify(
    strategy: Strategy, where: Path | Workspace, q0: ArrayLike, *, limits: bool = True, budget: int = 20_000
) -> Certificate:
    """Prove that the leaf through q0 is one smooth function over a path or a box of tool poses."""
    if not isinstance(strategy, HolonomicStrategy):
        raise ArgumentError("the strategy to certify", strategy.name, HolonomicStrategy.cure)
    began = time.perf_counter()
    robot = strategy.task.robot
    start = robot.checked(q0, "the start posture")
    whole("budget", budget)
    ended = ""
    if isinstance(where, Path):
        try:
            walk = follow(strategy, where, start, samples=SAMPLES, method="leaf", limits=limits)
        except PathError as problem:
            if problem.trajectory is None or len(problem.trajectory) < 2:
                raise
            walk, ended = problem.trajectory, problem.fact
        domain: Domain = Pathway.of(strategy, where, walk, SAMPLES)
    else:
        domain = PoseRegion.of(strategy, where, start)
    bounds = Interval(robot.lower, robot.upper) if limits else None
    found = _glued(domain, bounds, budget)
    status, place = found.status, ""
    if status is Proven.WHOLE and ended:
        status, place = Proven.END, ended
    turns, gap = np.zeros(robot.n), np.inf
    if status is Proven.WHOLE and isinstance(where, Path) and where.closed:
        turns, gap = closing(found, np.array([c.unit == "rad" for c in robot.coordinates]))
    low, high = hull_of(found.findings)
    return Certificate(
        f"{strategy.name}, {strategy.task.name}", "", status, place, found.cells, found.findings, found.boxes.piece,
        domain.c, low, high, np.minimum(low - robot.lower, robot.upper - high), least_determinant(found.findings),
        turns, gap, time.perf_counter() - began,
    )  # fmt: skip


def _glued(domain: Domain, limits: Interval | None, budget: int) -> Covered:
    """Cells over all of a domain, halved until neighbours share roots."""
    boxes = domain.first()
    found: Covered | None = None
    for _ in range(ROUNDS):
        new = covered(domain, boxes, limits, budget, lambda _n: None)
        found = new if found is None else _both(found, new)
        if isinstance(domain, Pathway):
            found = in_order(found)
        if found.status is not Proven.WHOLE:
            return found
        apart = unglued(found) if isinstance(domain, Pathway) else unglued_faces(found)
        if not apart.any():
            return found
        boxes = _halves(found.boxes, found.cells, found.cells.rho / 2, apart)
        found = found.only(~apart)
    return Covered(found.boxes, found.cells, found.findings, Proven.APART, None)


def _both(a: Covered, b: Covered) -> Covered:
    from dataclasses import fields

    join = lambda x, y: type(x)(*(np.concatenate([getattr(x, f.name), getattr(y, f.name)]) for f in fields(x)))
    return Covered(
        Boxes.joined(a.boxes, b.boxes), join(a.cells, b.cells), join(a.findings, b.findings), b.status, b.stopped
    )
