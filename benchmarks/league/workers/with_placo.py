"""placo: a frame task and a joints task in its kinematics solver."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator

import numpy as np
from worker_loop import Arm, Setting, Step, serve

with contextlib.redirect_stdout(io.StringIO()):
    import placo


def begin(weight: float, regularization: float = 0.0, limits: bool = False):
    """A run with a joints task of this weight, and a regularization task of this magnitude."""

    def start(arm: Arm) -> Step:
        robot = placo.RobotWrapper(arm.urdf, placo.Flags.ignore_collisions)
        robot.state.q[7:] = arm.start
        robot.update_kinematics()
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        if limits:
            solver.enable_velocity_limits(True)
        tool = solver.add_frame_task(arm.frame, robot.get_T_world_frame(arm.frame))
        tool.configure("tool", "soft", 1.0, 1.0)
        if weight:
            rest = solver.add_joints_task()
            rest.set_joints(dict(zip(arm.joints, arm.start.tolist(), strict=True)))
            rest.configure("rest", "soft", weight)
        if regularization:
            solver.add_regularization_task(regularization)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            solver.dt = h
            tool.T_world_frame = pose
            solver.solve(True)
            robot.update_kinematics()
            return robot.state.q[7:]

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its examples of an arm, and a sweep over the weight of a joints task."""
    yield Setting("no posture", begin(0.0), example=True, source="kinematics/6axis_basic.py of placo-examples")
    yield Setting("regularization 1e-4", begin(0.0, 1e-4), source="kinematics/6axis_regularization.py")
    for weight in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-2):
        yield Setting(f"joints task {weight:g}", begin(weight))


if __name__ == "__main__":
    serve(settings, ("placo", "pin"))
