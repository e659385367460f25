"""What certificates cost: cells, seconds, omega.

    python -m benchmarks.proof    # prints the table of docs/proof.md

Seconds are of the processor, of the second of two runs: the first one builds the equation.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np
from casadi import sin

import holokin as hk
from holokin.proof import Certificate, certify
from holokin.strategies import constraints as C

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
YUMI = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])
IIWA = np.array([0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])

Case = tuple[str, Any, Any, np.ndarray]


def cases() -> Iterator[Case]:
    """(name, strategy, path or box, start)."""
    panda = hk.load("panda")
    task, x = hk.pose(panda), panda.pose(PANDA)[:3, 3]
    small, large = hk.circle(x, center=x - [0.1, 0, 0]), hk.circle(x, center=x - [0.0, 0.2, 0.0])
    locked = hk.holonomic(task, hk.lock(2))
    yield "Panda, joint 3 locked, circle of 0.1 m", locked, small, PANDA
    yield "Panda, joint 3 locked, circle of 0.2 m", locked, large, PANDA
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
    yield from every_constraint()
    yield from two_hands()
    arm, q = hk.load("planar-3r"), np.array([0.3, 0.9, 0.9])
    law = hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]]))
    yield "planar 3R, q2 = q3, box of 1 m by 1 m", law, hk.workspace(box=((1.3, 0.0, 0.0), (0.5, 0.5, 0.0))), q
    x = panda.pose(PANDA)[:3, 3]
    R = panda.pose(PANDA)[:3, :3]
    cube = hk.workspace(box=(x, (0.05, 0.05, 0.05)), rotation=R)
    yield "Panda, cube of 0.1 m, one orientation", locked, cube, PANDA


def every_constraint() -> Iterator[Case]:
    """Circles of 0.1 m of a Panda."""
    robot = hk.load("panda")
    task, x = hk.pose(robot), robot.pose(PANDA)[:3, 3]
    loop = hk.circle(x, center=x - [0.1, 0, 0])
    coupled = C.stack(hk.coupled(0.5, "rpy"), hk.lock(2))
    rows = {
        "linear": (task, hk.linear([[1, 0, -1, 0, 0, 0, 0]])),
        "coupled orientation": (hk.position(robot), coupled),
        "conventional arm angle": (task, hk.arm_angle(definition="conventional")),
        "stationary centring": (task, hk.stationary(C.centring_cost())),
        "stationary posture": (task, hk.stationary(C.posture_cost(PANDA))),
        "custom": (task, hk.custom(lambda q: [q[0] * q[2] + sin(q[4])])),
    }
    for name, (of, constraint) in rows.items():
        yield f"Panda, {name}, circle of 0.1 m", hk.holonomic(of, constraint), loop, PANDA
    near = hk.follow(hk.moore_penrose(task), loop, PANDA, samples=60).q
    rng = np.random.default_rng(0)
    Q = np.vstack([near, *(near[::4] + rng.normal(scale=0.02, size=near[::4].shape) for _ in range(6))])
    radial = hk.radial(hk.moore_penrose(task), PANDA)
    fit = hk.strategies.fitted(radial, Q, degree=3, rows=(0, 1, 2))
    yield "Panda, radial fitted, degree 3, circle of 0.1 m", fit, loop, PANDA
    other = hk.circle(x, center=x + [0.1, 0, 0])  # across the first circle this leaf has a fold
    volume = hk.holonomic(task, hk.stationary(C.manipulability_cost()))
    yield "Panda, stationary manipulability, another circle of 0.1 m", volume, other, PANDA
    yield from with_masses()
    yield from where_the_tool_turns(task, x)


def with_masses() -> Iterator[Case]:
    """The Panda of the package example-robot-data, if it is there (the extra `test`)."""
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        return
    for file in (f for f in listed if f.name == "panda.urdf"):
        heavy = hk.from_urdf(str(file.locate()), tip="panda_hand_tcp")
        x, law = heavy.pose(PANDA)[:3, 3], hk.holonomic(hk.pose(heavy), hk.stationary(C.gravity_cost()))
        yield "Panda, stationary gravity, circle of 0.1 m", law, hk.circle(x, center=x - [0.1, 0, 0]), PANDA


def where_the_tool_turns(task: hk.Task, x: np.ndarray) -> Iterator[Case]:
    """Along 0.05 m and back while the tool turns by 0.08 rad, from the rotation that rotation vectors count from."""
    turn = np.array([0.04, 0.06, -0.03])
    there = hk.line(x, x - [0.05, 0, 0], turn=turn)
    loop = there + hk.line(x - [0.05, 0, 0], x, turn=-turn)
    chart = hk.pose(task.robot)._counted_from(task.pose(PANDA)[:3, :3])
    tilt = C.tilted(hk.lock(2), lambda x: 0.3 * x[3] * x[4] + 0.2 * x[0] * x[5], chart=chart)
    what = "Panda, joint 3 a function of the tool's pose, line of 0.05 m with a turn of 0.08 rad, and back"
    yield what, hk.holonomic(task, tilt), loop, PANDA
    near, rng = hk.follow(hk.moore_penrose(task), there, PANDA, samples=60).q, np.random.default_rng(0)
    Q = np.vstack([near, *(near[::2] + rng.normal(scale=0.03, size=near[::2].shape) for _ in range(6))])
    fit = hk.strategies.fitted(hk.radial(hk.moore_penrose(task), PANDA), Q, degree=2)
    yield "Panda, radial fitted to position and orientation, degree 2, the same line and back", fit, loop, PANDA


def two_hands() -> Iterator[Case]:
    """Both arms of a YuMi, 14 joints: one hand seen from the other, and each on a circle of its own."""
    robot, hands = hk.load("yumi"), ("left_flange", "right_flange")
    task = hk.strategies.tasks.relative_pose(robot, *hands)
    x = task.pose(YUMI)[:3, 3]
    rows = hk.linear(np.linalg.svd(task.jacobian(YUMI))[2][6:])
    yield (
        "YuMi, hand seen from hand, 8 linear rows, circle of 0.1 m",
        hk.holonomic(task, rows), hk.circle(x, center=x - [0.1, 0, 0]), YUMI,
    )  # fmt: skip
    both = hk.stacked(*(hk.pose(robot, tip=hand) for hand in hands))
    left, right = both.pose(YUMI)[:, :3, 3]
    path = hk.path.synchronized(hk.circle(left, left - [0.04, 0, 0]), hk.circle(right, right - [0.04, 0, 0]))
    yield "YuMi, both hands, joints 3 locked, circles of 0.04 m", hk.holonomic(both, hk.lock(2, 9)), path, YUMI


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
