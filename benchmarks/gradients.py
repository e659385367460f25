"""Inverse kinematics inside torch: what the tensors and the derivatives cost beside `ik.batch`.

    python -m benchmarks.gradients          # the numbers of docs/learning.md, half a minute
    python -m benchmarks.gradients --quick

Panda, full pose, arm angle: poses of postures within 0.2 rad of the start. Each round times all three in turns, in
processor time, so that what else the machine does counts little; torch has one thread. Shares are medians over rounds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

import holokin as hk

START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


def timed(call: Callable[[], Any]) -> float:
    """Seconds of the processor for one call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def main() -> int:
    """Print the times and the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    if find_spec("torch") is None:
        print("torch is not installed: pip install 'holokin[interop]'")
        return 0
    import torch

    torch.set_num_threads(1)

    count, rounds = (20, 1) if quick else (10_000, 12)
    robot = hk.load("panda")
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.arm_angle()), START)
    joints = hk.learning.torch.inverse(ik)
    Q = START + np.random.default_rng(0).uniform(-0.2, 0.2, (count, robot.n))
    poses = np.stack([robot.pose(q) for q in Q])
    tensor, learnt = torch.tensor(poses), torch.tensor(poses, requires_grad=True)
    found: list[Any] = []

    def both() -> None:
        joints(learnt).q.nansum().backward()

    calls = {
        "ik.batch(poses)": lambda: found.append(ik.batch(poses)),
        "the same in torch": lambda: found.append(joints(tensor)),
        "in torch, and backward": both,
    }
    for call in calls.values():  # native code is built
        call()
    times = np.array([[timed(call) for call in calls.values()] for _ in range(rounds)])
    first, second = found[0], found[1]
    apart = np.nanmax(np.abs(second.q.numpy() - first.q))
    print(f"{count} poses, {100 * first.reached.mean():.1f} % reached; joints differ by {apart:.0e}")
    for name, row in zip(calls, times.T, strict=True):
        share, each = np.median(row / times[:, 0]), 1e6 * np.median(row) / count
        print(f"{name:25} {each:6.2f} us a pose  {share:5.2f} times ik.batch")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
