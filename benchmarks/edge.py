"""At the edge of reach: how fast the joints move when a hand leaves a Panda's reach and comes back elsewhere.

    python -m benchmarks.edge            # prints the table of docs/inverse.md; needs: pip install -e ".[rivals]"

The hand goes out of reach along the tool's x axis, moves there by half a metre and comes back, at 0.5 m/s; each law is
asked every millisecond for the pose of the hand. pink and mink run as in `benchmarks.speed`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from itertools import pairwise

import numpy as np

import holokin as hk
from benchmarks.rivals import rivals

DT, SPEED = 1e-3, 0.5
READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
CORNERS = np.array([[0, 0, 0], [0.55, 0, 0.1], [0.45, 0.45, 0.1], [0.2, 0.35, 0], [0, 0, 0]])

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(q, pose (4, 4)) -> q of the next millisecond"""


def hand(robot: hk.Robot, spacing: float = DT * SPEED) -> np.ndarray:
    """The poses (k, 4, 4) of the hand, which holds its orientation."""
    counts = [int(np.ceil(np.linalg.norm(b - a) / spacing)) for a, b in pairwise(CORNERS)]
    legs = zip(pairwise(CORNERS), counts, strict=True)
    shifts = np.vstack([*(np.linspace(*leg, k, endpoint=False) for leg, k in legs), CORNERS[-1:]])
    poses = np.tile(robot.pose(READY), (len(shifts), 1, 1))
    poses[:, :3, 3] += shifts
    return poses


def damped(robot: hk.Robot, damping: float) -> Law:
    """dq = J^T (J J^T + damping^2)^-1 e, the whole error in one step."""

    def step(q: np.ndarray, pose: np.ndarray) -> np.ndarray:
        J, here = robot.jacobian(q), robot.pose(q)
        turn = np.cross(here[:3, :3].T, pose[:3, :3].T).sum(axis=0) / 2
        e = np.concatenate([pose[:3, 3] - here[:3, 3], turn])
        return q + J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(6), e)

    return step


def laws(robot: hk.Robot, poses: np.ndarray) -> dict[str, Law]:
    """Ours, what is usual, and the libraries that are installed."""
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock(2)), READY)
    found = ik.batch(poses)
    known = {pose.tobytes(): q for pose, q, reached in zip(poses, found.q, found.reached, strict=True) if reached}
    fastest = robot.max_velocity * DT
    every: dict[str, Law] = {
        "`ik.nearest`": lambda q, pose: ik.nearest(pose, q, limits=True).q,
        "`ik.nearest`, step of the speed limits": lambda q, pose: ik.nearest(pose, q, limits=True, step=fastest).q,
        "`ik`, waits where the pose is out of reach": lambda q, pose: known.get(pose.tobytes(), q),
        "damped least squares, 0.1": damped(robot, 0.1),
        "damped least squares, 0.05": damped(robot, 0.05),
    }
    for name, step in rivals(robot, READY, DT)[0]:
        if "daqp" in name:
            every[name] = lambda q, pose, step=step: q + DT * np.asarray(step(q, pose, np.zeros(6)))
    return every


def main(arguments: list[str] | None = None) -> int:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ten times as fast a hand")
    robot = hk.load("panda")
    poses = hand(robot, DT * SPEED * (10 if parser.parse_args(arguments).quick else 1))
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    columns = (
        "largest joint step [rad]", "joint step over hand step [rad/m]", "standing still [s]",
        "joint error at the end [rad]",
    )  # fmt: skip
    print("| each millisecond |", " | ".join(columns), "|")
    print("|---|---:|---:|---:|---:|")
    for name, law in laws(robot, poses).items():
        Q = [READY]
        try:
            for pose in poses[1:]:
                Q.append(law(Q[-1], pose))
        except Exception as problem:  # noqa: BLE001  what a library raises where its limits are broken
            print(f"| {name} | stops: {type(problem).__name__} | | | |")
            continue
        steps = np.abs(np.diff(Q, axis=0)).max(axis=1)
        rest, end = DT * (steps < 1e-9).sum(), np.abs(Q[-1] - READY).max()
        print(f"| {name} | {steps.max():.2g} | {(steps / moved).max():.3g} | {rest:.2g} | {end:.1g} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
