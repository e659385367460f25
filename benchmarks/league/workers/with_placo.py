"""placo: a frame task and a joints task in its kinematics solver."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator

import numpy as np
from worker_loop import Arm, Setting, Step, serve

with contextlib.redirect_stdout(io.StringIO()):
    import placo

EXAMPLE = "kinematics/6axis_targets.py of placo-examples, December 2025"


def begin(weight: float, rounds: int = 1) -> Callable[[Arm], Step]:
    """A run with a joints task of this weight, and `rounds` solutions a sample."""

    def start(arm: Arm) -> Step:
        robot = placo.RobotWrapper(arm.urdf, placo.Flags.ignore_collisions)
        robot.state.q[7:] = arm.start
        robot.update_kinematics()
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        solver.enable_velocity_limits(True)
        tool = solver.add_frame_task(arm.frame, robot.get_T_world_frame(arm.frame))
        tool.configure("tool", "soft", 1.0, 1.0)
        if weight:
            rest = solver.add_joints_task()
            rest.set_joints(dict(zip(arm.joints, arm.start.tolist(), strict=True)))
            rest.configure("rest", "soft", weight)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            solver.dt = h
            tool.T_world_frame = pose
            for _ in range(rounds):
                solver.solve(True)
                robot.update_kinematics()
            return robot.state.q[7:]

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its examples of an arm, and a sweep over the weight of a joints task and the solutions a sample."""
    yield Setting("no posture", begin(0.0), True, EXAMPLE)
    for weight in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4):
        shown = "kinematics/6axis_regularization.py --posture" if weight == 1e-6 else ""
        yield Setting(f"joints task {weight:g}", begin(weight), source=shown)
    for rounds in (2, 5):
        yield Setting(f"joints task 1e-06, {rounds} solutions a sample", begin(1e-6, rounds))


if __name__ == "__main__":
    serve(settings, ("placo", "pin"))
