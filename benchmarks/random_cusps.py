"""Cusps and regions of random arms, each against a referee: `python -m benchmarks.random_cusps [--count 200]`.

Where `hk.cusps` claims a loop, the referee of `random_arms` goes it in small Newton steps. Where `hk.unique_region`
proves a box, it goes random closed polygons in the box. It knows the rows of Denavit and Hartenberg and the numbers of
the constraint, nothing of holokin.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

import holokin as hk
from benchmarks.random_arms import Array, Problem, random_posture, random_problem
from holokin.base.errors import HolokinError

STARTS, BUDGET = 200, 1500
"""Starts of each search for cusps, cells of each box."""

CORNERS = 5
"""Of a polygon."""


def main(arguments: list[str] | None = None) -> None:
    """Ask, and let the referee go the loops."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="arms")
    parser.add_argument("--steps", type=int, default=10_000, help="Newton steps round a loop of a cusp")
    parser.add_argument("--loops", type=int, default=50, help="polygons in a box, of 2,000 steps each")
    parser.add_argument("--first", type=int, default=0, help="seed of the first arm")
    parser.add_argument("--quick", action="store_true", help="one arm, few steps, few starts and cells")
    given = parser.parse_args(arguments)
    sizes = (40, 60, 200, 2) if given.quick else (STARTS, BUDGET, given.steps, given.loops)
    count = 1 if given.quick else given.count
    total: Counter[str] = Counter()
    began = time.perf_counter()
    for seed in range(given.first, given.first + count):
        found = Counter(asked(seed, *sizes))
        total += found
        print(f"arm {seed}: {', '.join(f'{n} {what}' for what, n in found.items())}", flush=True)
    print(f"{count} arms, {time.perf_counter() - began:.0f} s")
    for what, n in total.most_common():
        print(f"{n:7,} {what}")


def asked(seed: int, starts: int, budget: int, steps: int, loops: int) -> Iterator[str]:
    """What was claimed of an arm, and what the referee says of it."""
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    q0 = random_posture(problem, rng, near=False)
    try:
        strategy = problem.strategy
        found = hk.cusps(strategy, q0, starts=starts, limits=False)
    except HolokinError as error:
        yield f"no search: {type(error).__name__}"
        return
    yield "with cusps" if len(found) else "without a cusp found"
    for one in found.witnesses:
        ends = continued(problem, one.first, *poses(one.path, strategy.task.pose(one.first), steps))
        yield "loops confirmed" if np.abs(ends - one.second).max() < 1e-6 else f"LOOPS NOT CONFIRMED (seed {seed})"
    try:
        region = hk.unique_region(strategy, q0, limits=False, budget=budget)
    except HolokinError as error:
        yield f"no region: {type(error).__name__}"
        return
    if not region.whole:
        yield "boxes that were not proven"
        return
    yield "boxes proven"
    for ends in polygons(problem, region, q0, rng, loops, steps // 5):
        yield "polygons that return" if np.abs(ends - q0).max() < 1e-10 else f"POLYGONS THAT DO NOT (seed {seed})"


def poses(path: hk.Path, T: Array, steps: int) -> tuple[Array, Array]:
    """Positions (steps, 3) and rotations (steps, 3, 3) along a path that begins at the tool pose T (4, 4)."""
    at = path.at(np.linspace(0.0, path.duration, steps + 1)[1:])
    return at.position, at.rotation @ (T[:3, :3] if path.rotation is None else path.rotation)


def continued(problem: Problem, q: Array, p: Array, R: Array) -> Array:
    """The posture (n,) that small Newton steps lead to."""
    c = problem.level(q)
    for place, turned in zip(p, R, strict=True):
        q = problem.roots(q[None], place[None], turned[None], c, most=2)[0][0]
    return problem.roots(q[None], p[-1:], R[-1:], c)[0][0]


def polygons(
    problem: Problem, region: hk.proof.UniqueRegion, q0: Array, rng: np.random.Generator, count: int, steps: int
) -> Array:
    """The postures (count, n) at which random closed polygons in a box end, all begun at the tool pose of q0."""
    solid, T = region.workspace.solid, region.strategy.task.pose(q0)
    inner = solid.center + 0.98 * solid.half * rng.uniform(-1, 1, (CORNERS, count, 3))
    corners = np.concatenate([np.tile(T[:3, 3], (1, count, 1)), inner, np.tile(T[:3, 3], (1, count, 1))])
    q, c, R = np.tile(q0, (count, 1)), problem.level(q0), np.tile(T[:3, :3], (count, 1, 1))
    for begin, end in pairwise(corners):
        for share in np.linspace(0, 1, steps // (CORNERS + 1) + 1)[1:]:
            q = problem.roots(q, begin + share * (end - begin), R, c, most=2)[0]
    return problem.roots(q, np.tile(T[:3, 3], (count, 1)), R, c)[0]


if __name__ == "__main__":
    main()
