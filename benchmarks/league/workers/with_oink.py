"""roboplan's OInK: a frame task, a configuration task and limits in a quadratic programme each step."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescription
from roboplan.optimal_ik import (
    ConfigurationTask,
    ConfigurationTaskOptions,
    FrameTask,
    FrameTaskOptions,
    Oink,
    OinkSettings,
    PositionLimit,
    VelocityLimit,
)
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "roboplan_examples/python/example_oink.py at 0ae8e64, without its filter of the marker"


def begin(
    weight: float, gain: float = 1.0, orientation: float = 1.0, lm: float = 0.0, regularization: float = 1e-12,
    rounds: int = 1, tolerance: float | None = None,
) -> Callable[[Arm], Step]:  # fmt: skip
    """A run with a configuration task of this weight and gain, `rounds` solutions a sample, to a tolerance."""

    def start(arm: Arm) -> Step:
        scene = Scene("league", loadUrdfSceneDescription(arm.urdf))
        solver = OinkSettings()
        if tolerance:
            solver.eps_abs = tolerance
        oink = Oink(scene, solver)
        scene.setJointPositions(arm.start)
        limits = [PositionLimit(oink, gain=1.0), VelocityLimit(oink, float(arm.runs["circle"]["h"][0]), arm.speed)]
        goal = CartesianConfiguration(
            arm.base, arm.frame, np.asfortranarray(scene.forwardKinematics(arm.start, arm.frame))
        )
        options = FrameTaskOptions(position_cost=1.0, orientation_cost=orientation, task_gain=1.0, lm_damping=lm)
        tool = FrameTask(oink, scene, goal, options)
        tasks = [tool]
        if weight:
            options = ConfigurationTaskOptions(task_gain=gain, lm_damping=0.0)
            tasks.append(ConfigurationTask(oink, arm.start, np.full(len(arm.joints), weight), options))
        moved = np.zeros(len(arm.joints))

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.setTargetFrameTransform(np.asfortranarray(pose))
            for _ in range(rounds):
                scene.setJointPositions(q)
                scene.forwardKinematics(q, arm.frame)
                oink.solveIk(scene, tasks, limits, moved, regularization)
                q = scene.integrate(q, moved)
            return q

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example, and a sweep over the configuration task and the solutions a sample."""
    as_shown = begin(0.05, 0.1, orientation=0.1, lm=0.01, regularization=1e-6)
    yield Setting("configuration 0.05, gain 0.1", as_shown, True, EXAMPLE)
    yield Setting("no configuration task", begin(0.0))
    for weight, gain in ((1e-5, 1.0), (1e-4, 0.1), (1e-4, 1.0)):
        yield Setting(f"configuration {weight:g}, gain {gain:g}", begin(weight, gain))
    for rounds in (1, 5, 8):
        name = f"configuration 1e-05, tolerance 1e-12, {rounds} a sample"
        yield Setting(name, begin(1e-5, rounds=rounds, tolerance=1e-12))


if __name__ == "__main__":
    serve(settings, ("roboplan-oink", "roboplan-core", "pin"))
