"""Laws in plain NumPy that the audit has not seen, for the tests."""

from __future__ import annotations

import numpy as np

import holokin as hk


def turn(R: np.ndarray) -> np.ndarray:
    """The rotation vector (3,) of a turn by less than pi: SciPy's takes longer than all the rest of a step."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = np.sqrt(axis @ axis)
    return axis * (np.arctan2(sine, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2) / sine) if sine > 1e-12 else axis


def pull(robot: hk.Robot, q: np.ndarray, pose: np.ndarray, dt: float) -> np.ndarray:
    """Twist (6,) that reaches the wanted pose at the end of the step."""
    here = robot.pose(q)
    return np.concatenate([pose[:3, 3] - here[:3, 3], turn(pose[:3, :3] @ here[:3, :3].T)]) / dt


def locked(robot: hk.Robot, joint: int):
    def law(q, pose, twist, dt):
        row = np.eye(7)[joint]
        return np.linalg.solve(np.vstack([robot.jacobian(q), row]), np.append(pull(robot, q, pose, dt), 0.0))

    return law
