"""ssik: analytical solutions; its tracker, and its seeded solution in a loop, on the arms that it ships."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import ssik
from worker_loop import Arm, Setting, Step, placed, serve

NAMES = {"panda": "franka_panda", "iiwa14": "iiwa14"}
EXAMPLE = "README.md of 8.2, Streaming IK, without a limit of speed"


def tracked(arm: Arm) -> Step:
    """A run by its tracker."""
    robot = ssik.Manipulator.from_prebuilt(NAMES[arm.name])
    base, tool = placed(arm, robot.fk)
    tracker = robot.tracker(arm.start)

    def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
        found = tracker.update(base @ pose @ tool)
        return found.q if found.status.name == "OK" else None

    return step


def nearest(one_seed: bool) -> Callable[[Arm], Step]:
    """A run by the solution nearest to a seed: the last answer, or the start each time."""

    def start(arm: Arm) -> Step:
        robot = ssik.Manipulator.from_prebuilt(NAMES[arm.name])
        base, tool = placed(arm, robot.fk)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            seed = arm.start if one_seed else q
            found = robot.solve(base @ pose @ tool, q_seed=seed, max_solutions=1)
            return found[0].q if found else None

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """Its tracker, and the solution from a seed."""
    yield Setting("its tracker", lambda arm: tracked(arm), True, EXAMPLE)
    yield Setting(
        "one solution, last answer", nearest(False), source="README.md of 8.2, the IK closest to where the robot is"
    )
    yield Setting("one solution, one seed", nearest(True))


if __name__ == "__main__":
    serve(settings, ("ssik",))
