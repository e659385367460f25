"""Laws in plain NumPy that the audit has not seen, for the tests."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk


def pull(robot: hk.Robot, q: np.ndarray, pose: np.ndarray, dt: float) -> np.ndarray:
    """Twist (6,) that reaches the wanted pose at the end of the step."""
    here = robot.pose(q)
    turn = Rotation.from_matrix(pose[:3, :3] @ here[:3, :3].T).as_rotvec()
    return np.concatenate([pose[:3, 3] - here[:3, 3], turn]) / dt


def locked(robot: hk.Robot, joint: int):
    def law(q, pose, twist, dt):
        row = np.eye(7)[joint]
        return np.linalg.solve(np.vstack([robot.jacobian(q), row]), np.append(pull(robot, q, pose, dt), 0.0))

    return law
