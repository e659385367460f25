"""The self-test of exported C on random arms, tasks and constraints, in double and in single precision.

python -m benchmarks.selftests --count 200
"""

from __future__ import annotations

import argparse
import sys
import tempfile

import numpy as np

import holokin as hk
from benchmarks.random_arms import random_posture, random_problem
from holokin.base.errors import ExportError, HolokinError
from holokin.export import check

SMALL = 34
"""The seed of an arm of three joints: larger ones keep a compiler busy for seconds."""


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
        problem = random_problem(rng)
        start = random_posture(problem, rng, near=False)
        with tempfile.TemporaryDirectory() as folder:
            try:
                check(hk.export.export_c(problem.strategy, folder, q0=start, name="law", vectors_count=32))
                passed += 1
            except ExportError as problem_found:
                failed += 1
                print(f"seed {seed}: {problem_found}", flush=True)
            except HolokinError:  # singular at this start
                refused += 1
        seed += 1
    print(f"{passed} self-tests passed, {failed} failed; {refused} laws or starts were refused as singular or unfit")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
