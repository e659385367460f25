"""What certificates cost: cells, seconds, omega.

    python -m benchmarks.proof    # prints the table of docs/proof.md

Seconds are of the processor, of the second of two runs: the first one builds the equation.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import holokin as hk
from holokin.proof import Certificate, certify

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
IIWA = np.array([0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])

Case = tuple[str, Any, Any, np.ndarray]


def cases() -> Iterator[Case]:
    """(name, strategy, path or box, start)."""
    panda = hk.load("panda")
    task, x = hk.pose(panda), panda.pose(PANDA)[:3, 3]
    small, large = hk.circle(x, center=x - [0.1, 0, 0]), hk.circle(x, center=x - [0.0, 0.2, 0.0])
    locked = hk.holonomic(task, hk.lock(2))
    yield "Panda, joint 3 locked, circle of 0.1 m", locked, small, PANDA
    yield "the same, 0.2 m", locked, large, PANDA
    yield "Panda, arm angle, circle of 0.1 m", hk.holonomic(task, hk.arm_angle()), small, PANDA
    made = hk.design(task, hk.workspace(box=(x, (0.15, 0.15, 0.1))), PANDA, samples=32, degree=2)
    yield "Panda, design of degree 2, circle of 0.1 m", made.strategy, small, PANDA
    iiwa = hk.load("iiwa14")
    x = iiwa.pose(IIWA)[:3, 3]
    yield (
        "iiwa 14, joint 3 locked, circle of 0.1 m",
        hk.holonomic(hk.pose(iiwa), hk.lock(2)),
        hk.circle(x, center=x - [0.1, 0, 0]),
        IIWA,
    )
    arm, q = hk.load("planar-3r"), np.array([0.3, 0.9, 0.9])
    law = hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]]))
    yield "planar 3R, q2 = q3, box of 1 m by 1 m", law, hk.workspace(box=((1.3, 0.0, 0.0), (0.5, 0.5, 0.0))), q
    x = panda.pose(PANDA)[:3, 3]
    R = panda.pose(PANDA)[:3, :3]
    cube = hk.workspace(box=(x, (0.05, 0.05, 0.05)), rotation=R)
    yield "Panda, cube of 0.1 m, one orientation", locked, cube, PANDA


def shown(name: str, proof: Certificate, seconds: float) -> str:
    """A row of the table."""
    omega = f"{np.median(proof.findings.omega):.1f}" if len(proof) else ""
    return f"| {name} | {proof.extent.name.lower()} | {len(proof):,} | {seconds:.2f} | {omega} |"


def table(only: str) -> None:
    """Prints it."""
    print("| robot, constraint, motion | proven | cells | seconds | omega |\n| --- | --- | ---: | ---: | ---: |")
    for name, strategy, where, start in cases():
        if only not in name:
            continue
        certify(strategy, where, start, budget=1)
        began = time.process_time()
        proof = certify(strategy, where, start, budget=100_000)
        print(shown(name, proof, time.process_time() - began), flush=True)


def main() -> int:
    """The table; with --quick the first row alone."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="")
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    table(next(cases())[0] if asked.quick else asked.only)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
