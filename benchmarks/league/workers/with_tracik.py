"""TRAC-IK by pytracik: a pose and a seed in, joints out; asked in a loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from trac_ik import TracIK
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "README.md of 0.0.3, from the last answer; its 5 ms are of the clock, also where others have the processor"


def begin(aim: str, epsilon: float = 1e-5, one_seed: bool = False, timeout: float = 0.005) -> Callable[[Arm], Step]:
    """A run that asks from the last answer, or from the start each time."""

    def start(arm: Arm) -> Step:
        solver = TracIK(arm.base, arm.frame, arm.urdf, timeout=timeout, epsilon=epsilon, solver_type=aim)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            return solver.ik(pose[:3, 3], pose[:3, :3], seed_jnt_values=arm.start if one_seed else q)

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its README, and from one seed. Its aim "Distance" uses all the time that it has, 5 ms a call: left out."""
    yield Setting("Speed, last answer, 5 ms at most", begin("Speed"), True, EXAMPLE)
    yield Setting("Speed, one seed, 5 ms at most", begin("Speed", one_seed=True))
    yield Setting("Speed, one seed, 50 ms at most", begin("Speed", one_seed=True, timeout=0.05))


if __name__ == "__main__":
    serve(settings, ("pytracik",))
