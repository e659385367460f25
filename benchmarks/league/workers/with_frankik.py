"""frankik: the analytical solution of a Franka arm, joint 7 sampled or given."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from frankik import FrankaKinematics, RobotType
from worker_loop import Arm, Setting, Step, placed, serve

EXAMPLE = "README.md of 1.0, from the last answer"

HAND = np.eye(4)
HAND[:2, :2], HAND[2, 3] = np.sqrt(0.5) * np.array([[1, 1], [-1, 1]]), 0.1034
"""Its `FrankaHandTCPOffset`, to the last digit: its own has 0.707 for the square root of 1/2."""


def begin(hold: bool = False, one_seed: bool = False) -> Callable[[Arm], Step]:
    """A run by `inverse`: joint 7 sampled near the seed, or held as it was at the start."""

    def start(arm: Arm) -> Step:
        robot = FrankaKinematics(robot_type=RobotType.PANDA)
        base, tool = placed(arm, robot.forward)
        held = {"q7": float(arm.start[6])} if hold else {}

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            seed = arm.start if one_seed else q
            return robot.inverse(base @ pose @ tool, q0=seed, tcp_offset=HAND, **held)

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its README, from one seed, and with joint 7 held."""
    if arm.name != "panda":
        return
    yield Setting("joint 7 sampled, last answer", begin(), True, EXAMPLE)
    yield Setting("joint 7 sampled, one seed", begin(one_seed=True))
    yield Setting("joint 7 held", begin(hold=True))


if __name__ == "__main__":
    serve(settings, ("frankik",))
