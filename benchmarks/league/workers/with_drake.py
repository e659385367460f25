"""Drake: differential inverse kinematics by a quadratic programme with joint centring."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/manipulation_station/end_effector_teleop_sliders.py"


def begin(centring: float, rounds: int = 1) -> Callable[[Arm], Step]:
    """A run with this gain of joint centring [1/s], at the start as the nominal posture."""

    def start(arm: Arm) -> Step:
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(arm.urdf)
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base))
        plant.Finalize()
        context, n = plant.CreateDefaultContext(), len(arm.joints)
        parameters = DifferentialInverseKinematicsParameters(n, n)
        parameters.set_nominal_joint_position(arm.start)
        parameters.set_joint_velocity_limits((-arm.speed, arm.speed))
        parameters.set_joint_position_limits((arm.lower, arm.upper))
        if centring:
            parameters.set_joint_centering_gain(centring * np.eye(n))
        tool = plant.GetFrameByName(arm.frame)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            parameters.set_time_step(h)
            wanted = RigidTransform(pose)
            for _ in range(rounds):
                plant.SetPositions(context, q)
                found = DoDifferentialInverseKinematics(plant, context, wanted, tool, parameters)
                if found.status == DifferentialInverseKinematicsStatus.kNoSolutionFound:
                    return None
                q = q + h * found.joint_velocities
            return q

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its example, and a sweep over the gain of joint centring."""
    yield Setting("no centring", begin(0.0), True, EXAMPLE)
    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    for centring in (1.0, 10.0, whole):
        yield Setting(f"centring {centring:.3g}/s", begin(centring))
    for rounds in (3, 8):
        yield Setting(f"centring 1/dt, {rounds} steps a sample", begin(whole, rounds))


if __name__ == "__main__":
    serve(settings, ("drake",))
