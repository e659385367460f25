"""Can the tool get there at all? Asked only after following has failed."""

from __future__ import annotations

import numpy as np

from ..task import Task
from ..types import Matrix, Vector


def distance_to_reach(task: Task, q: Vector, position: Vector, rotation: Matrix) -> float:
    """Smallest largest task error [m or rad] found by least squares within the joint limits, from q."""
    from scipy.optimize import least_squares

    robot = task.robot
    inside = np.clip(q, robot.lower, robot.upper)

    def error(posture: Vector) -> Vector:
        return task.error(posture, position, rotation)

    bounds = (np.where(robot.lower < robot.upper, robot.lower, -np.inf), robot.upper)
    found = least_squares(error, inside, bounds=bounds, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return float(np.abs(found.fun).max())
