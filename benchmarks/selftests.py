"""The self-test of exported C on random arms, tasks and constraints, in double and in single precision."""

from __future__ import annotations

import tempfile

import numpy as np

import holokin as hk
from benchmarks.random_arms import random_posture, random_problem
from holokin.base.errors import ExportError, HolokinError
from holokin.export import check

SMALL = 34
"""The seed of an arm of three joints: larger ones keep a compiler busy for seconds."""


def run(count: int, first: int) -> tuple[int, int, int]:
    """(passed, failed, refused as singular or unfit), from a seed on; what failed is printed."""
    passed = refused = failed = 0
    seed = first
    while passed + failed < count:
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
    return passed, failed, refused
