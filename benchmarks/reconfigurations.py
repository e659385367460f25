"""How often must an arm change its posture along a known path? The problem of IKLink, by our rerun of its method.

    python -m benchmarks.reconfigurations PATH.csv --urdf ARM.urdf --tip panda_hand
    python -m benchmarks.reconfigurations --quick      # a path of our own

IKLink (Wang, Sifferman, Gleicher 2024) takes some hundred postures at each sample of the path: those of the last
sample continued, one for each group of equal ones, and others from random starts. Two postures of following samples
are joined when each joint keeps its largest speed. Dynamic programming finds the fewest changes among these postures,
and of these the least joint motion. Its code is public (Rust, MIT licence), with one path: a CSV table of the columns
time, x, y, z and the quaternion x, y, z, w. Give that file and its robot; this package contains neither. This is not
their code. The postures are found with the kinematics of holokin, the fewest changes without it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk

EQUAL = 0.01
"""Postures nearer to each other than about this are one [rad], as in the published code."""
EXACT = 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """A choice of postures along a path."""

    changes: int
    chosen: np.ndarray
    """(m,) which posture of each sample"""
    way: float
    """The joint motion between changes [rad]"""


def fewest_changes(layers: Sequence[np.ndarray], most: np.ndarray) -> Motion:
    """The fewest changes along a path, then the least joint motion, over all choices of one posture a sample.

    Args:
        layers: postures (k_i, n) at each of m samples.
        most: how far each joint may go from one sample to the next, (n,) or (m - 1, n) [rad].
    """
    most = np.broadcast_to(most, (len(layers) - 1, layers[0].shape[1]))
    changes, way = np.zeros(len(layers[0]), int), np.zeros(len(layers[0]))
    before: list[np.ndarray] = []
    for last, here, reach in zip(layers, layers[1:], most, strict=False):
        step = np.abs(here[:, None] - last[None])
        joined = (step <= reach + 1e-12).all(-1)
        far = np.sqrt((step**2).sum(-1))
        count = changes[None] + ~joined
        length = way[None] + np.where(joined, far, 0)
        best = np.lexsort((length, count), axis=1)[:, 0]
        row = np.arange(len(here))
        changes, way = count[row, best], length[row, best]
        before.append(best)
    at = int(np.lexsort((way, changes))[0])
    total, length = int(changes[at]), float(way[at])
    chosen = [at]
    for best in reversed(before):
        chosen.append(int(best[chosen[-1]]))
    return Motion(total, np.array(chosen[::-1]), length)


def _solved(task: hk.Task, pose: np.ndarray, q: np.ndarray, rounds: int) -> np.ndarray:
    """The postures (k, n) that a search from each of q reaches within the limits, by damped least squares."""
    robot, p, R = task.robot, pose[:3, 3], pose[:3, :3]
    for _ in range(rounds):
        e = task.error(q, p, R)
        J = task.jacobian_batch(q)[0]
        damping = 1e-3 * (e**2).sum(-1)[:, None, None] * np.eye(task.m) + 1e-12 * np.eye(task.m)
        move = np.swapaxes(J, 1, 2) @ np.linalg.solve(J @ np.swapaxes(J, 1, 2) + damping, e[..., None])
        q = np.clip(q + np.clip(move[..., 0], -0.5, 0.5), robot.lower, robot.upper)
    return q[np.abs(task.error(q, p, R)).max(-1) < EXACT]


def path_postures(task: hk.Task, poses: np.ndarray, count: int = 200, seed: int = 0) -> list[np.ndarray]:
    """At least `count` postures at each pose (m, 4, 4): those of the last one continued, others from random starts.

    A pose at which a hundred rounds of random starts find nothing has no posture, and an empty table.
    """
    rng, robot = np.random.default_rng(seed), task.robot
    layers, last = [], np.zeros((0, task.n))
    for pose in poses:
        q = _solved(task, pose, last, 6) if len(last) else last
        _, first = np.unique(np.rint(q / EQUAL), axis=0, return_index=True)
        q = q[np.sort(first)]
        for _ in range(100):
            if len(q) >= count:
                break
            q = np.concatenate([q, _solved(task, pose, rng.uniform(robot.lower, robot.upper, (count, task.n)), 30)])
        last = q[: max(count, 1)]
        layers.append(last)
    return layers


def read_path(file: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Times (m,) and poses (m, 4, 4) of a table time, x, y, z, quaternion x, y, z, w with one line of names."""
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, 3] = rows[:, 1:4]
    poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:8]).as_matrix()
    return rows[:, 0], poses


def main(arguments: list[str] | None = None) -> int:
    """Print the fewest changes along a path."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", nargs="?", help="a CSV table of poses; without it, a circle of our own")
    parser.add_argument("--urdf", help="the robot; by default the Panda of the catalogue")
    parser.add_argument("--tip", help="its tool link")
    parser.add_argument("--count", type=int, default=200, help="postures at each sample")
    parser.add_argument("--quick", action="store_true", help="20 postures, every 40th sample of a path of our own")
    asked = parser.parse_args(arguments)
    robot = hk.from_urdf(asked.urdf, tip=asked.tip) if asked.urdf else hk.load("panda")
    task = hk.pose(robot)
    if asked.path:
        times, poses = read_path(asked.path)
    else:
        poses = _circle(robot)[:: 40 if asked.quick else 1]
        times = np.linspace(0, 20, len(poses))
    began = time.process_time()
    layers = path_postures(task, poses, 20 if asked.quick else asked.count)
    lost = sum(not len(layer) for layer in layers)
    print(
        f"{len(poses)} samples, {len(layers[0])} postures each, {lost} without one, {time.process_time() - began:.0f} s"
    )
    kept = [k for k, layer in enumerate(layers) if len(layer)]
    most = np.diff(times[kept])[:, None] * robot.max_velocity
    motion = fewest_changes([layers[k] for k in kept], most)
    print(f"fewest changes: {motion.changes}; joint motion between them {motion.way:.2f} rad")
    return 0


def _circle(robot: hk.Robot) -> np.ndarray:
    """A circle before a Panda, the tool down."""
    turn = np.linspace(0, 2 * np.pi, 201)
    ready = robot.pose([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
    poses = np.tile(ready, (len(turn), 1, 1))
    poses[:, :3, 3] += 0.15 * np.stack([np.cos(turn) - 1, np.sin(turn), 0 * turn], 1)
    return poses


if __name__ == "__main__":
    raise SystemExit(main())
