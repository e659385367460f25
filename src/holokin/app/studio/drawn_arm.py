"""An arm as a page draws it: rods, discs and beams, each between two points of a link."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.types import Matrix, Vector
from ...path import Path
from ...robot import Box, Capsule, Cylinder
from ...strategies.tasks.task import Task
from ...symbolic import SX, Function, symbol, vertcat
from ..report.bodies import Piece, pieces_of
from ..report.robot_view import best_view


@dataclass(frozen=True, eq=False)
class DrawnArm:
    """The pieces of a task's robot: rods, whatever shapes its model has."""

    task: Task
    parts: tuple[Piece, ...]

    @staticmethod
    def of(task: Task, Q: Matrix) -> DrawnArm:
        """The arm, whose rails are long enough for postures (k, n)."""
        bare = replace(task.robot, shapes=(), visuals=())
        return DrawnArm(task, pieces_of(bare, Q))

    @property
    def pieces(self) -> list[dict[str, Any]]:
        """What the page draws between the two points of each piece."""
        return [
            {"role": part.role, "radius": _size(part)[0], "flat": not isinstance(part.part.shape, Capsule)}
            for part in self.parts
        ]

    @cached_property
    def function(self) -> Function:
        """q -> points in the base's frame (3 k,): the tool's, then both ends of each piece."""
        robot = self.task.robot
        q, tip = symbol("q", robot.n), robot.tip(self.task.tip)
        joints = sorted({part.joint for part in self.parts} - {-1})
        frames = {j: robot.kinematics_at(q, j, np.eye(4)) for j in joints}
        rows = [robot.kinematics(q, tip.name).position]
        for part in self.parts:
            for end in _ends(part):
                moved = frames.get(part.joint)
                rows.append(SX(end) if moved is None else moved.position + moved.rotation @ SX(end))
        return Function("drawn", {"q": q}, {"points": vertcat(*rows)})

    def at(self, q: Vector) -> Matrix:
        """The points (k, 3) at a posture (n,)."""
        return np.asarray(self.function(q)).reshape(-1, 3)

    def size(self, q: Vector) -> float:
        """How large the arm is at a posture [m]: the diagonal of a box about it."""
        return float(np.linalg.norm(np.ptp(self.at(q), axis=0)))

    def view(self, Q: Matrix, path: Path) -> dict[str, Any]:
        """From where the arm at postures (k, n) and a path are seen.

        Returns:
            The middle, half the size and the floor [m], azimuth and elevation [degrees].
        """
        line = path.at(np.linspace(0, path.duration, 61)).position
        eight = 2 * path.start - line  # the other half of a figure eight
        every = np.vstack([line, eight, *(self.at(q) for q in Q)])
        low, high = every.min(axis=0), every.max(axis=0)
        seen = best_view([self.at(Q[0])], [line])
        planar = self.task.robot.planar
        return {
            "center": ((low + high) / 2).tolist(),
            "around": float(np.linalg.norm(high - low)) / 2,
            "azimuth": -90.0 if planar else seen.azimuth,
            "elevation": 89.0 if planar else seen.elevation,
            "floor": min(0.0, float(low[2])),
        }


def _size(piece: Piece) -> tuple[float, float]:
    """(radius, half length) of a rod, a disc or a beam [m]."""
    shape = piece.part.shape
    if isinstance(shape, Box):
        return float(shape.sides[0]) / 2, float(shape.sides[2]) / 2
    if isinstance(shape, Capsule | Cylinder):
        return float(shape.radius), float(shape.length) / 2
    raise TypeError(f"a robot without shapes has no {shape!r}")


def _ends(piece: Piece) -> tuple[Vector, Vector]:
    """Both ends of a piece, in the frame of its joint."""
    T, half = piece.part.placement, _size(piece)[1]
    return T[:3, 3] - half * T[:3, 2], T[:3, 3] + half * T[:3, 2]
