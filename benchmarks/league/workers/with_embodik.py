"""embodik: a frame task above a posture task, in its stepping solver."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import embodik
import numpy as np
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/01_basic_ik_simple.py of the wheel"
ANSWERS = ("SUCCESS", "INFEASIBLE", "NUMERICAL_ERROR", "NO_PROGRESS")
"""Its example goes on with these."""


def begin(weight: float, gain: float, rounds: int = 1, as_shown: bool = False) -> Callable[[Arm], Step]:
    """A run with a posture task of this weight, this gain of the tool's error, and `rounds` steps of it a sample."""

    def start(arm: Arm) -> Step:
        robot = embodik.RobotModel(arm.urdf, floating_base=False)
        solver = embodik.KinematicsSolver(robot)
        solver.dt = float(arm.runs["circle"]["h"][0])
        policy = solver.runtime_config()
        policy.enable_auto_task_layout = policy.weighted_fallback_enabled = True
        solver.configure_runtime(policy)
        tool = solver.add_frame_task("ee_task", arm.frame)
        tool.priority, tool.weight = 0, 1.0
        tool.solve_mode = embodik.TaskSolveMode.SCALE_ELASTIC
        tool.allow_min_error_fallback = False
        rest = solver.add_posture_task("posture_bias")
        rest.priority, rest.weight = 1, weight
        rest.solve_mode = embodik.TaskSolveMode.MIN_ERROR
        rest.allow_min_error_fallback = False
        rest.set_target_configuration(arm.start)
        robot.update_configuration(arm.start)
        options = embodik.PositionStepOptions()
        options.position_gain = options.orientation_gain = gain
        options.max_steps = rounds
        if as_shown:
            options.adaptive_dt, options.adaptive_dt_max_scale = True, 10.0
            options.adaptive_dt_reference_distance = 0.02

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            solver.dt = h
            found = solver.solve_position_step(q, np.asfortranarray(pose), "ee_task", options)
            if found.status.name not in ANSWERS:
                return None
            q = np.asarray(found.q_solution, dtype=float)
            robot.update_configuration(q)
            return q

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example, and a sweep over the posture task, the tool's gain and the steps a sample."""
    yield Setting("posture 1e-2, gain 10", begin(1e-2, 10.0, as_shown=True), True, EXAMPLE)
    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    for weight in (0.0, 1e-2, 1.0, 10.0, 100.0):
        yield Setting(f"posture {weight:g}, gain 1/dt", begin(weight, whole))
    for rounds in (2, 5):
        yield Setting(f"posture 100, gain 1/dt, {rounds} steps a sample", begin(100.0, whole, rounds))


if __name__ == "__main__":
    serve(settings, ("embodik",))
