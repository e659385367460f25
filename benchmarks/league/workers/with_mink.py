"""mink: the same tasks as pink's, on a MuJoCo model."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mink
import mujoco
import numpy as np
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/arm_iiwa.py at cf1a302"
THRESHOLD = 1e-4
"""Its examples stop their steps where position [m] and orientation [rad] are nearer."""


def begin(
    cost: float, gain: float = 1.0, lm: float = 0.0, damping: float = 1e-12, rounds: int = 1, stop: float = 0.0
) -> Callable[[Arm], Step]:
    """A run with a posture task of this cost, and up to `rounds` steps of it a sample, until the tool is near."""

    def start(arm: Arm) -> Step:
        model = mujoco.MjModel.from_xml_path(arm.mjcf)
        configuration = mink.Configuration(model, q=arm.start.copy())
        tool = mink.FrameTask(arm.frame, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        tasks = [tool]
        if cost:
            tasks.append(mink.PostureTask(model, cost=cost, gain=gain))
            tasks[-1].set_target_from_configuration(configuration)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.set_target(mink.SE3.from_matrix(pose))
            for _ in range(rounds):
                velocity = mink.solve_ik(configuration, tasks, h, "daqp", damping=damping)
                configuration.integrate_inplace(velocity, h)
                if (
                    stop
                    and max(np.linalg.norm(part) for part in np.split(tool.compute_error(configuration), 2)) <= stop
                ):
                    break
            return configuration.q

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example of an iiwa14, and a sweep over the posture task and the steps a sample."""
    as_shown = begin(1e-2, lm=1.0, damping=1e-3, rounds=20, stop=THRESHOLD)
    yield Setting("posture 1e-2, LM 1, up to 20 steps", as_shown, True, EXAMPLE)
    yield Setting("no posture task", begin(0.0))
    for cost, gain in ((1e-4, 1.0), (1e-3, 0.1), (1e-3, 1.0), (1e-2, 1.0)):
        yield Setting(f"posture {cost:g}, gain {gain:g}", begin(cost, gain))
    for rounds in (2, 5, 8):
        yield Setting(f"posture 0.001, {rounds} steps a sample", begin(1e-3, rounds=rounds))


if __name__ == "__main__":
    serve(settings, ("mink", "mujoco", "daqp"))
