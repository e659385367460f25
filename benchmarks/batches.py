"""Many postures in one call: what each costs, beside `G.batch`, and one call of one posture.

    python -m benchmarks.batches          # needs a C compiler

Panda, pose task, arm angle, on one thread, in turns and in processor time. `over its loop` is the cost over that of the
same generated code called by `Function.batch`, without checks of what comes out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.calls import in_turns, repeated
from benchmarks.growth import START
from holokin.analysis.curvature.curvature_of_planes import curvature_function

COUNT = 200_000
"""Postures of a call, of which each takes 0.02 to 3 us."""


@dataclass(frozen=True)
class Door:
    """A function of one posture or many, and what it gives without checks."""

    name: str
    checked: Callable[[np.ndarray], Any]
    bare: Callable[[np.ndarray], Any]


def doors(robot: hk.Robot) -> list[Door]:
    """What takes (n,) or (k, n), made anew, `G.batch` first."""
    task = hk.pose(robot)
    held, weighted = hk.holonomic(task, hk.arm_angle()), hk.moore_penrose(task)
    tip = robot.tips[0].name
    position = robot._numeric(tip)

    def alone(function: Any) -> Callable[[np.ndarray], Any]:
        return lambda Q: function.batch(Q, threads=1)

    return [
        Door("G.batch(Q)", lambda Q: held.batch(Q, threads=1), alone(held.gain)),
        Door("G(Q)", held, alone(held.gain)),
        Door("G.g(Q)", held.g, alone(held.constraint_value)),
        Door("robot.pose(Q)", robot.pose, alone(position)),
        Door("robot.jacobian(Q)", robot.jacobian, alone(task._jacobian)),
        Door("task(Q)", task, alone(task._value)),
        Door("task.jacobian(Q)", task.jacobian, alone(task._jacobian)),
        Door("hk.curvature(G, Q)", lambda Q: hk.curvature(weighted, Q), alone(curvature_function(weighted))),
    ]


def each(run: Callable[[np.ndarray], Any], Q: np.ndarray, rounds: int = 5) -> float:
    """Seconds of the processor for one posture, the least of some rounds."""
    run(Q)
    found = []
    for _ in range(rounds):
        begin = time.process_time()
        run(Q)
        found.append((time.process_time() - begin) / len(Q))
    return min(found)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few postures, for a look")
    quick = parser.parse_args().quick
    robot = hk.load("panda")
    Q = START + np.random.default_rng(0).uniform(-0.2, 0.2, (1_000 if quick else COUNT, robot.n))
    all_doors = doors(robot)
    costs = {door.name: (each(door.checked, Q), each(door.bare, Q)) for door in all_doors}
    reference = costs["G.batch(Q)"][0]
    singles = {door.name: repeated(lambda call=door.checked: call(START)) for door in all_doors[1:]}
    one = in_turns(singles, 2 if quick else 15, 0.001 if quick else 0.05)
    print("| call | one of many | over `G.batch` | over its loop | one call of one |\n|---|---:|---:|---:|---:|")
    for name, (checked, bare) in costs.items():
        single = f"{1e6 * one[name].median:.2f} us" if name in one else ""
        print(f"| `{name}` | {1e9 * checked:.0f} ns | {checked / reference:.2f} | {checked / bare:.2f} | {single} |")


if __name__ == "__main__":
    main()
