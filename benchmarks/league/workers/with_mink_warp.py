"""mink-warp on the processor: mink's tasks, solved by Warp, one world."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mink_warp
import mujoco
import numpy as np
import warp
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/01_panda_ik.py of 0.1"


def quaternion_and_place(pose: np.ndarray) -> np.ndarray:
    """A pose as (7,): w x y z of the rotation, then the position."""
    found = np.empty(4)
    mujoco.mju_mat2Quat(found, pose[:3, :3].flatten())
    return np.concatenate([found, pose[:3, 3]])


def begin(cost: float, gain: float, lm: float, damping: float, limits: bool, rounds: int = 1) -> Callable[[Arm], Step]:
    """A run with a posture task of this cost, this gain of the tool, and `rounds` steps a sample."""

    def start(arm: Arm) -> Step:
        model = mujoco.MjModel.from_xml_path(arm.mjcf)
        configuration = mink_warp.Configuration(model, nworld=1, device="cpu")
        configuration.update(q=arm.start[None].astype(np.float32))
        tool = mink_warp.FrameTask(arm.frame, "site", position_cost=1.0, orientation_cost=1.0, gain=gain, lm_damping=lm)
        rest = mink_warp.PostureTask(model, cost=cost)
        tasks = [tool, rest, mink_warp.JointLimitTask(model, cost=1.0)] if limits else [tool, rest]
        tool.set_target_from_configuration(configuration)
        rest.set_target_from_configuration(configuration)
        solver = mink_warp.IKSolver(configuration)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            wanted = quaternion_and_place(pose)[None].astype(np.float32)
            tool.set_target(wanted, configuration=configuration)
            solver.solve_and_integrate(tasks, h, damping=damping, iterations=rounds)
            return configuration.q.numpy()[0].astype(float)

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example of a Panda, and a sweep over the posture task and the steps a sample."""
    yield Setting("posture 1e-2, gain 0.8, LM 1", begin(1e-2, 0.8, 1.0, 1e-3, True), True, EXAMPLE)
    for cost in (1e-2, 3e-2):
        yield Setting(f"posture {cost:g}, gain 1", begin(cost, 1.0, 0.0, 1e-9, False))
    yield Setting("posture 0.01, gain 1, 3 steps a sample", begin(1e-2, 1.0, 0.0, 1e-9, False, 3))


if __name__ == "__main__":
    warp.config.quiet = True
    serve(settings, ("mink-warp", "warp-lang", "mujoco"))
