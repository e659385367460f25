"""Inverse kinematics at loop rate: how long `ik(pose)`, `ik.near(pose, q)` and `ik.batch(poses)` take, and any order.

    python -m benchmarks.inverse                          # the tables of docs/inverse.md, some minutes
    python -m benchmarks.inverse --order 1000000          # a million poses in two orders, besides

Panda, from its ready posture: poses of the box [0.5, 0, 0.3] +- [0.25, 0.4, 0.3] m, tool down, tilted by up to 40
degrees, spun by +-90. Times in us and in C floors: control steps of the arm angle called from C, in the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from benchmarks.calls import Floor, in_turns
from holokin.motion.ik import InverseKinematics, InverseStatus

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
SPACINGS = ((0.00025, 0.0005), (0.001, 0.002), (0.01, 0.02))
"""Steps of a hand [m, rad], whichever is met first: 1 kHz at 0.25 m/s, 250 Hz at that, and 25 Hz."""

Answer = Callable[[np.ndarray, np.ndarray], np.ndarray | None]
"""(pose, the last answer) -> q, or None: what a rival is."""


def poses_of_the_box(count: int, seed: int = 0) -> np.ndarray:
    """(count, 4, 4)."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = [0.5, 0.0, 0.3] + rng.uniform(-1, 1, (count, 3)) * [0.25, 0.4, 0.3]
    axis, lean = rng.uniform(-np.pi, np.pi, count), np.deg2rad(40) * np.sqrt(rng.uniform(size=count))
    tilted = np.stack([lean * np.cos(axis), lean * np.sin(axis), np.zeros(count)], axis=1)
    spun = np.outer(rng.uniform(-np.pi / 2, np.pi / 2, count), [0, 0, 1])
    down = np.diag([1.0, -1.0, -1.0])
    poses[:, :3, :3] = (Rotation.from_rotvec(tilted) * Rotation.from_rotvec(spun)).as_matrix() @ down
    return poses


def way(first: np.ndarray, last: np.ndarray, step: float, turn: float) -> np.ndarray:
    """Poses (k, 4, 4) from one to another in steps of at most so many metres and radians."""
    w = Rotation.from_matrix(last[:3, :3] @ first[:3, :3].T).as_rotvec()
    count = int(max(np.linalg.norm(last[:3, 3] - first[:3, 3]) / step, np.linalg.norm(w) / turn)) + 1
    share = np.arange(1, count + 1) / count
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = first[:3, 3] + share[:, None] * (last[:3, 3] - first[:3, 3])
    poses[:, :3, :3] = Rotation.from_rotvec(share[:, None] * w).as_matrix() @ first[:3, :3]
    return poses


def laws(robot: hk.Robot) -> dict[str, tuple[hk.strategies.HolonomicStrategy, np.ndarray]]:
    """The laws that are timed, and where each starts."""
    task = hk.pose(robot)
    swivel = hk.holonomic(task, hk.arm_angle())
    return {
        "joint 3 locked": (hk.holonomic(task, hk.lock(2)), READY),
        "arm angle, elbow 60 degrees aside": (
            swivel,
            hk.motion.ik.move_to_leaf(swivel, READY, swivel.g(READY) - np.pi / 3),
        ),
        "arm angle, elbow above": (swivel, READY),
        "stationary centring": (hk.holonomic(task, hk.stationary(hk.strategies.constraints.centring_cost())), READY),
        "radial": (hk.radial(hk.moore_penrose(task), READY), READY),
    }


@dataclass(frozen=True)
class Times:
    """Of one law: processor seconds a pose, shares of the poses."""

    name: str
    engine: str
    reached: float
    within: float
    cold: np.ndarray
    batch: float
    refused: float
    near: tuple[float, ...]


def timed(call: Callable[[], object]) -> float:
    """Processor seconds of a call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def measure(name: str, ik: InverseKinematics, count: int, ways: int) -> Times:
    """Each pose alone, all at once on one thread, and along some of the paths there."""
    robot, poses = ik.strategy.task.robot, poses_of_the_box(count)
    found = ik.batch(poses, threads=1)
    reached = poses[found.reached]
    inside = ((found.q >= robot.lower) & (found.q <= robot.upper)).all(axis=1)
    cold = np.array([timed(lambda pose=pose: [ik(pose) for _ in range(3)]) / 3 for pose in reached])
    batch = timed(lambda: ik.batch(reached, threads=1)) / len(reached)
    lost = poses[~found.reached]
    refused = timed(lambda: ik.batch(lost, threads=1)) / max(1, len(lost))
    near = []
    for step, turn in SPACINGS if "native" in ik.engine else SPACINGS[-1:]:
        spent = steps = 0.0
        for pose in reached[:ways]:
            hand, q = way(robot.pose(ik.q0), pose, step, turn), ik.q0
            begin = time.process_time()
            for target in hand:
                q = ik.near(target, q)
            spent, steps = spent + time.process_time() - begin, steps + len(hand)
        near.append(spent / steps)
    return Times(name, ik.engine, found.reached.mean(), inside.mean(), cold, batch, refused, tuple(near))


def any_order(ik: InverseKinematics, count: int) -> tuple[float, float]:
    """(largest difference of the joints between two orders of the poses, seconds): random, and sorted by height."""
    poses = poses_of_the_box(count)
    order = np.argsort(poses[:, 2, 3])
    begin = time.perf_counter()
    one, other = ik.batch(poses), ik.batch(poses[order])
    spent = time.perf_counter() - begin
    if not np.array_equal(one.status[order], other.status):
        return np.inf, spent
    return float(np.nanmax(np.abs(one.q[order] - other.q))), spent


def free_spins(robot: hk.Robot, count: int) -> tuple[float, float, bool]:
    """(time on poses spun about a free axis, over that on the same poses: of `ik(pose)`, of `ik.near` from an answer
    nearby; whether all joints are the same to 1e-9)."""
    ik = hk.ik(hk.holonomic(hk.pose(robot, "axis"), hk.lock(2, 6)), READY)
    poses, rng = poses_of_the_box(count), np.random.default_rng(0)
    poses = poses[ik.batch(poses).reached]
    spun, near = poses.copy(), poses.copy()
    spins = rng.choice([-1, 1], len(poses)) * np.geomspace(1e-6, 1.0, len(poses))[rng.permutation(len(poses))]
    spun[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(np.outer(spins, [0, 0, 1])).as_matrix()
    near[:, :3, 3] += 1e-4
    begin, times, same = ik.batch(near).q, np.zeros((2, 2)), True
    for one, other, q in zip(poses, spun, begin, strict=True):
        for _ in range(3):
            for k, pose in enumerate((one, other)):
                times[0, k] += timed(lambda pose=pose: ik(pose))
                times[1, k] += timed(lambda pose=pose, q=q: [ik.near(pose, q) for _ in range(20)])
        same &= bool(np.abs(ik(one) - ik(other)).max() < 1e-9)
    cold, warm = times[:, 1] / times[:, 0]
    return float(cold), float(warm), same


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few poses")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--order", type=int, default=20_000, help="poses in two orders")
    given = parser.parse_args(arguments)
    robot = hk.load("panda")
    controller = hk.controller(hk.holonomic(hk.pose(robot), hk.arm_angle()), dt=1e-3, q0=READY)
    step = Floor(controller, robot.pose(READY), np.zeros(6))
    floor = in_turns({"floor": step}, 5 if given.quick else 50, 1e-3)["floor"].median
    print(f"C floor: {1e6 * floor:.2f} us\n")
    spaced = " | ".join(f"`near`, {1e3 * a:g} mm" for a, _ in SPACINGS)
    print(f"| law | reached | within limits | `ik(pose)`, median | mean | 90 % | `batch` | refused | {spaced} |")
    print("|---|" + "---:|" * 10)
    for name, (strategy, start) in laws(robot).items():
        if given.quick and name != "joint 3 locked":
            continue
        ik = hk.ik(strategy, start, limits=False)
        native = "native" in ik.engine
        count = (20 if native else 1) if given.quick else given.poses if native else 20
        t = measure(name, ik, count, 1 if given.quick or not native else 12)

        def cell(seconds: float) -> str:
            return f"{1e6 * seconds:.3g} us ({seconds / floor:.3g})"

        times = [np.median(t.cold), t.cold.mean(), np.percentile(t.cold, 90), t.batch, t.refused]
        near = ["-"] * (len(SPACINGS) - len(t.near)) + [cell(seconds) for seconds in t.near]
        shares = f"{t.reached:.1%} | {t.within:.1%}"
        label = name if native else f"{name} ({t.engine})"
        print(f"| {label} | {shares} | " + " | ".join([*map(cell, map(float, times)), *near]) + " |", flush=True)
    ik = hk.ik(*laws(robot)["joint 3 locked"], limits=False)
    count = 200 if given.quick else given.order
    difference, seconds = any_order(ik, count)
    lost = ik.batch(np.full((1, 4, 4), np.nan)).status[0]
    print(f"\n{count:,} poses at random and sorted, joint 3 locked: {difference:.1e} rad apart, {seconds:.1f} s")
    cold, warm, same = free_spins(robot, 20 if given.quick else 300)
    print(
        f"a free spin of 1e-6 to 1 rad: {cold:.2f} times `ik(pose)`, {warm:.2f} times `near`, the same joints: {same}"
    )
    return 0 if same and difference < 1e-12 and lost == InverseStatus.NOT_FINITE else 1


if __name__ == "__main__":
    raise SystemExit(main())
