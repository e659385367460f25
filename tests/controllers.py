"""What a controller does with a program, by the rules of its language: a referee that knows no code of the library.

A joint move turns all axes evenly, in its time. A linear move leads the tool's point straight and turns it evenly
about one axis; a circular move leads the point round the circle through three points. Where a move has a speed, the
point has it from end to end; ramps are left out. The joints of these moves are those of the controller's own
inverse, which goes on from where the robot is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from grammars import Parsed

Pose = Callable[[np.ndarray], np.ndarray]
"""Of axes (n,) [rad] the tool's pose (4, 4)."""


@dataclass
class Played:
    """A move as it was made: joints (k, n), tool points (k, 3), rotations, the speed of the point (k - 1,) [m/s]."""

    kind: str
    q: np.ndarray
    p: np.ndarray
    R: Rotation
    speed: np.ndarray
    seconds: float


def play(program: Parsed, pose: Pose, count: int = 40, degrees: bool = True) -> list[Played]:
    """Every move of a program but the first, looked at `count` times. The first six axes are the robot's."""
    axes = np.deg2rad(program.axes) if degrees else program.axes
    made = []
    q = axes[0]
    for i, kind in enumerate(program.kinds):
        share = np.linspace(0.0, 1.0, count + 1)
        end = axes[i + 1]
        if kind == "joint":
            Q = q + share[:, None] * (end - q)
            T = np.array([pose(x) for x in Q])
            p, R = T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3])
        else:
            via = program.via.get(i)
            middle = None if via is None else pose(np.deg2rad(via) if degrees else np.array(via))
            p, R = _tool(pose(q), middle, pose(end), share)
            Q = _joints(pose, q + share[:, None] * (end - q), p, R)
        length = np.linalg.norm(np.diff(p, axis=0), axis=1)
        seconds = program.seconds[i] if np.isfinite(program.seconds[i]) else length.sum() / program.speeds[i]
        made.append(Played(kind, Q, p, R, length * count / seconds, seconds))
        q = Q[-1]
    return made


def _tool(start: np.ndarray, via: np.ndarray | None, end: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, Rotation]:
    R = Slerp([0.0, 1.0], Rotation.from_matrix([start[:3, :3], end[:3, :3]]))(share)
    a, c = start[:3, 3], end[:3, 3]
    if via is None:
        return a + share[:, None] * (c - a), R
    b = via[:3, 3]
    x, y, z = (np.linalg.norm(v) for v in (b - c, a - c, a - b))  # barycentric coordinates of the circumcenter
    weights = np.array([x**2 * (y**2 + z**2 - x**2), y**2 * (z**2 + x**2 - y**2), z**2 * (x**2 + y**2 - z**2)])
    center = weights @ np.array([a, b, c]) / weights.sum()
    axis = np.cross(b - a, c - b)
    axis /= np.linalg.norm(axis)
    u = a - center
    v = np.cross(axis, u)
    angle = np.arctan2((c - center) @ v, (c - center) @ u) % (2 * np.pi)
    return center + np.cos(share * angle)[:, None] * u + np.sin(share * angle)[:, None] * v, R


def _joints(pose: Pose, even: np.ndarray, p: np.ndarray, R: Rotation) -> np.ndarray:
    """The joints along a path of the tool, by Newton's method with differences: six axes go on from the posture before,
    external ones move evenly."""
    found = [even[0]]
    for point, turn, straight in zip(p[1:], R[1:], even[1:], strict=True):
        x = np.concatenate([found[-1][:6], straight[6:]])
        for _ in range(8):
            here = pose(x)
            error = _error(here, point, turn)
            if np.abs(error).max() < 1e-11:
                break
            h = 1e-6
            moved = [_error(pose(x + h * e), point, turn) for e in np.eye(len(x))[:6]]
            J = np.column_stack([(error - after) / h for after in moved])
            x[:6] += np.linalg.solve(J, error)
        found.append(x)
    return np.array(found)


def _error(here: np.ndarray, point: np.ndarray, turn: Rotation) -> np.ndarray:
    return np.concatenate([point - here[:3, 3], (turn * Rotation.from_matrix(here[:3, :3]).inv()).as_rotvec()])
