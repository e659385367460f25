"""Inverse kinematics, a section of docs/measured.md: without a start, and on a leaf."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

import holokin as hk
from benchmarks.page import Given, table, us, versions, wrapped
from holokin.analysis.coverage import PoseStatus
from holokin.motion.ik import move_to_leaf
from holokin.strategies import constraints

MAPPED = (
    *("panda", "fr3", "iiwa14", "xarm7", "openarm-left", "ur5e", "irb140", "rail-ur10e", "panda:axis"),
    *("rail-ur10e:axis", "gen3", "rizon4", "sawyer", "yumi-arm"),
)
"""Arms that are asked without a start, some with a tool that is free to spin."""

BOX = hk.workspace(box=([0.5, 0.0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.radians(90))
READY = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
NEAR = 1e-3
"""How far a hand is led between two calls [m]."""


def least(call: Callable[[], object], tries: int = 3) -> float:
    """The least of some times of a call [s]."""
    times = []
    for _ in range(tries):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def maps(count: int, names: tuple[str, ...]) -> Iterator[list[str]]:
    """Rows: of poses of postures drawn within the limits how many are reached, how many by a sheet, and the times."""
    for name in names:
        robot, rng = hk.load(name.removesuffix(":axis")), np.random.default_rng(20)
        ik = hk.ik(hk.pose(robot, "axis" if name.endswith(":axis") else "twist"))
        poses = robot.pose(rng.uniform(*robot.ranges(np.pi), (count, robot.n)))
        found = ik.batch(poses)
        times = [least(lambda pose=pose: ik(pose)) for pose in poses[found.reached]]
        label = name.replace(":axis", ", free to spin")
        shares = [f"{int(found.reached.sum()):,}", str(len(ik.map)), f"{(found.sheet >= 0).mean():.2%}"]
        print(f"{label}: {', '.join(shares)}", flush=True)
        yield [label, *shares, us(np.median(times)), us(np.percentile(times, 99))]


def laws(task: hk.Task) -> Iterator[tuple[str, hk.HolonomicStrategy, np.ndarray]]:
    """(name, strategy, start) of those that serve a box."""
    angle, sixty = hk.holonomic(task, hk.arm_angle()), np.radians(60)
    aside = move_to_leaf(angle, READY, angle.constraint_value(READY) + sixty)
    yield "joint 3 locked", hk.holonomic(task, hk.lock(2)), READY
    yield "q1 - q3 kept", hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0])), READY
    yield "arm angle, elbow 60 degrees aside", angle, aside
    yield "arm angle, elbow above", angle, READY
    yield "stationary centring", hk.holonomic(task, hk.stationary(constraints.centring_cost())), READY
    yield "radial", hk.radial(hk.moore_penrose(task), READY), READY


def leaves(count: int) -> Iterator[list[str]]:
    """Rows: what becomes of poses of the box on the leaf of a start, and what a call takes where it answers."""
    task, rng = hk.pose(hk.load("panda")), np.random.default_rng(3)
    for name, strategy, start in laws(task):
        covered = hk.coverage(strategy, BOX, start, samples=count)
        ends = {s: int((covered.status == s).sum()) for s in (PoseStatus.REACHED, PoseStatus.LIMIT)}
        far = int(np.isin(covered.status, [PoseStatus.OUT_OF_REACH, PoseStatus.BEYOND_LIMITS]).sum())
        cells = [ends[PoseStatus.REACHED], ends[PoseStatus.LIMIT], count - sum(ends.values()) - far, far]
        ik, asked, led = hk.ik(strategy, start), [], []
        for pose, q in zip(covered.poses[covered.reached], covered.q[covered.reached], strict=True):
            step, moved = rng.normal(size=3), pose.copy()
            moved[:3, 3] += NEAR * step / np.linalg.norm(step)
            asked.append(least(lambda pose=pose: ik(pose)))
            led.append(least(lambda pose=moved, q=q: ik.near(pose, q)))
        print(f"{name}: {cells}", flush=True)
        yield [name, *map(str, cells), us(np.median(asked)), us(np.percentile(asked, 99)), us(np.median(led))]


def section(given: Given) -> tuple[list[str], str]:
    """Measure; the blocks of docs/measured.md, and the versions."""
    count, names, poses = (40, ("panda", "gen3"), 40) if given.quick else (2000, MAPPED, 400)
    mapped = table(("arm", "reached", "sheets", "by a sheet", "a call [us]", "99 % under [us]"), maps(count, names))
    head = (
        "law",
        "reached",
        "joint limit",
        "leaf ends",
        "beyond the arm",
        "`ik(pose)` [us]",
        "99 % under",
        "`near` [us]",
    )
    return [
        "## Inverse",
        wrapped(
            f"""How many poses does `ik = hk.ik(robot)` answer [without a start](inverse.md#without-a-start), and in
            what time? It is asked for the tool poses of {count:,} postures that are drawn evenly within the joint
            limits; each is called three times from Python, and the least counts. A pose that no sheet serves is
            searched for; where these are more than one in a hundred, the last column has their time. The last four
            arms have no closed form with a joint held, and take long there."""
        ),
        mapped,
        wrapped(
            f"""On the leaf of a start, not every pose of the arm is on the leaf. {poses} poses of a box of 0.5 x 0.8 x
            0.6 m are asked of a Panda in its ready posture, the tool down, tilted by up to 40 and spun by up to 90
            degrees. `near` goes on from a posture {1e3 * NEAR:g} mm away, as a hand does that leads the arm."""
        ),
        table(head, leaves(poses)),
    ], versions("casadi", "numpy")
