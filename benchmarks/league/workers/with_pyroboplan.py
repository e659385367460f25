"""pyroboplan: damped steps with components in the null space, iterated to a pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from pyroboplan.ik.differential_ik import DifferentialIk, DifferentialIkOptions
from pyroboplan.ik.nullspace_components import joint_limit_nullspace_component
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/differential_ik.py at 4c35cb7, without its obstacles, from the last answer"


def begin(options: dict[str, Any], posture: float = 0.0, one_seed: bool = False) -> Callable[[Arm], Step]:
    """A run with these options, and a pull to the start, or from joint limits, in the null space."""

    def start(arm: Arm) -> Step:
        model = pin.buildModelFromUrdf(arm.urdf)
        solver = DifferentialIk(model, options=DifferentialIkOptions(**options))

        def pull(model: pin.Model, q: np.ndarray) -> np.ndarray:
            return posture * (arm.start - q)

        def from_limits(model: pin.Model, q: np.ndarray) -> np.ndarray:
            return joint_limit_nullspace_component(model, q, gain=0.1, padding=0.025)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            wanted, seed = pin.SE3(pose[:3, :3], pose[:3, 3]), arm.start if one_seed else q
            components = [pull if posture else from_limits]
            return solver.solve(arm.frame, wanted, init_state=seed.copy(), nullspace_components=components)

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example, and to a nearer pose in full steps, with a pull to the start or from one seed."""
    shown = {"damping": 1e-4, "min_step_size": 0.025, "max_step_size": 0.1, "rng_seed": None}
    full = {"damping": 1e-9, "min_step_size": 1.0, "max_step_size": 1.0, "rng_seed": 0}
    near = full | {"max_translation_error": 1e-8, "max_rotation_error": 1e-8}
    yield Setting("from joint limits, steps of 0.1", begin(shown), True, EXAMPLE)
    yield Setting("from joint limits, full steps to 1e-8", begin(near))
    yield Setting("pull of 1 to the start, full steps to 1e-8", begin(near, 1.0))
    yield Setting("full steps to 1e-8, one seed", begin(near, one_seed=True))


if __name__ == "__main__":
    serve(settings, ("pyroboplan", "pin"))
