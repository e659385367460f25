"""The self-test of exported C on random arms, tasks and constraints, in double and in single precision.

python -m benchmarks.selftests --count 200
"""

from __future__ import annotations

import argparse
import sys
import tempfile

import numpy as np

import holokin as hk
from holokin.base.errors import ExportError, HolokinError
from holokin.export import check

SMALL = 11
"""The seed of an arm of three joints: larger ones keep a compiler busy for seconds."""


def arm(rng: np.random.Generator) -> hk.Robot:
    """3 to 8 joints by random Denavit-Hartenberg rows, up to 3 m from the world's origin; one joint in six slides."""
    rows = []
    for _ in range(int(rng.integers(3, 9))):
        twist = rng.choice([0.0, np.pi / 2, -np.pi / 2, rng.uniform(-np.pi, np.pi)])
        row = {"a": rng.uniform(0, 0.6), "d": rng.uniform(-0.3, 0.5), "alpha": twist, "theta": rng.uniform(-1, 1)}
        slides = rng.random() < 1 / 6
        rows.append(row | ({"kind": "prismatic", "lower": -1.0, "upper": 1.0} if slides else {}))
    base = np.eye(4)
    base[:3, 3] = rng.uniform(-3, 3, 3)
    return hk.from_dh(rows, base=base, name="random arm")


def law(robot: hk.Robot, rng: np.random.Generator) -> hk.Strategy:
    """A task of random rows, with a constraint of what is left: a lock or a linear one."""
    kind = rng.choice(["position", "twist", "zyz", "rpy", "rotation-vector"])
    if kind == "position" or robot.n < 4:
        rows = sorted(rng.choice(3, min(robot.n - 1, int(rng.integers(1, 4))), replace=False).tolist())
        task = hk.position(robot, rows=rows)
    else:
        most = min(robot.n - 1, 6)
        rows = list(range(most)) if kind != "twist" or most == 6 else list(range(3))
        task = hk.pose(robot, kind, rows=rows)
    left = task.n - task.m
    joints = rng.choice(task.n, left, replace=False).tolist()
    return hk.holonomic(task, hk.lock(*joints) if rng.random() < 0.5 else hk.linear(rng.normal(size=(left, task.n))))


def main() -> int:
    """Print what failed, and how many passed; exit 1 where one failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.selftests", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="One arm, a small one.")
    args = parser.parse_args()
    passed = refused = failed = 0
    seed = SMALL if args.quick else args.first
    while passed + failed < (1 if args.quick else args.count):
        rng = np.random.default_rng(seed)
        with tempfile.TemporaryDirectory() as folder:
            try:
                strategy = law(arm(rng), rng)
                start = rng.uniform(-1, 1, strategy.task.n)
                check(hk.export.export_c(strategy, folder, q0=start, name="law", vectors_count=32))
                passed += 1
            except ExportError as problem:
                failed += 1
                print(f"seed {seed}: {problem}", flush=True)
            except HolokinError:  # singular at this start, or an arm that cannot do this task
                refused += 1
        seed += 1
    print(f"{passed} self-tests passed, {failed} failed; {refused} laws or starts were refused as singular or unfit")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
