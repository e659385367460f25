"""pink: a frame task, a posture task and a quadratic programme each step."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import DampingTask, FrameTask, PostureTask
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/arm_panda.py of 4.3"


def begin(
    cost: float, gain: float = 1.0, lm: float = 0.0, damping: float = 0.0, rounds: int = 1
) -> Callable[[Arm], Step]:
    """A run with a posture task of this cost, `damping` that of a damping task, `rounds` steps of it a sample."""

    def start(arm: Arm) -> Step:
        model = pin.buildModelFromUrdf(arm.urdf)
        configuration = pink.Configuration(model, model.createData(), arm.start.copy())
        tool = FrameTask(arm.frame, position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        tasks = [tool]
        if cost:
            tasks.append(PostureTask(cost=cost, gain=gain))
            tasks[-1].set_target_from_configuration(configuration)
        if damping:
            tasks.append(DampingTask(cost=damping))

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
            for _ in range(rounds):
                velocity = pink.solve_ik(configuration, tasks, h, solver="daqp")
                configuration.integrate_inplace(velocity, h)
            return configuration.q

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example of a Panda, and a sweep over the posture task and the steps a sample."""
    yield Setting("posture 1e-3, damping 1e-3, LM 1", begin(1e-3, lm=1.0, damping=1e-3), True, EXAMPLE)
    yield Setting("no posture task", begin(0.0))
    for cost, gain in ((1e-4, 1.0), (1e-3, 0.1), (1e-3, 1.0), (1e-2, 1.0)):
        yield Setting(f"posture {cost:g}, gain {gain:g}", begin(cost, gain))
    for rounds in (2, 5, 8):
        yield Setting(f"posture 0.001, {rounds} steps a sample", begin(1e-3, rounds=rounds))


if __name__ == "__main__":
    serve(settings, ("pin-pink", "pin", "daqp"))
