"""Loops of the tool in the plane of two task rows, and the area that a loop encloses in each such plane.

The drift of a small loop is the sum over the planes (i, j) of enclosed area times curvature F_ij (theory 1.1): a loop
sees only the curvature of the planes in which it encloses area.
"""

from __future__ import annotations

import numpy as np

from ...base.types import Array, Matrix, Vector
from ...path import Path, polyline
from ...path.straight_path import rotation_vector
from ...strategies.tasks.task import Task, check_representation
from ..curvature.curvature_of_planes import pairs

SIDES = {"m": 0.1, "rad": 0.2}
"""Sides of a loop: 0.1 m like the other loops of an audit; 0.2 rad is a like motion for an arm's joints, and small
enough that turns about different axes commute up to a tenth."""

ENCLOSED = 0.1
"""Area, as a share of the largest that one of the loops encloses in any plane, from which a plane counts as looked at:
there a tolerance on the drift allows ten times the curvature."""

LEAST = 1e-4
"""Area, as a share of that of `SIDES`, below which a loop encloses nothing: 1 mm by 1 mm."""


def plane_name(task: Task, i: int, j: int) -> str:
    """For instance "x-wz"."""
    return f"{task.row_names[i]}-{task.row_names[j]}"


def sides(task: Task, i: int, j: int, size: float = 1.0) -> tuple[float, float]:
    """Sides of a loop in the plane (i, j) [m or rad]."""
    return size * SIDES[task.units[i]], size * SIDES[task.units[j]]


def area_unit(task: Task, i: int, j: int) -> str:
    """ "m^2", "m rad" or "rad^2"."""
    a, b = task.units[i], task.units[j]
    return f"{a}^2" if a == b else f"{a} {b}"


def _steps(task: Task, position: Vector, rotation: Matrix, rows: tuple[int, int], size: float) -> list[Vector]:
    """The least twists (6,) of a tool at a pose that change one of two task rows each, by the sides of a loop.

    Raises:
        SingularityError where the representation is singular.
    """
    twists = np.asarray(np.linalg.pinv(_rates(task, rotation)).T, dtype=float)
    return [size * _signed(task, k, position) * twists[k] for k in rows]


def plane_loop(task: Task, position: Vector, rotation: Matrix, i: int, j: int, size: float = 1.0) -> Path:
    """A loop of four sides from a tool pose: row i, row j, row i back, and the path back.

    Position rows move towards the robot's base first. With turns the last side is the shortest turn that closes the
    loop; it differs from that of a rectangle by the product of the sides, so that the area in other planes is smaller
    by the size of the loop. One row alone (i = j) gives the path there and back.

    Raises:
        SingularityError where the representation is singular.
    """
    from scipy.spatial.transform import Rotation

    a, b = _steps(task, position, rotation, (i, j), size)
    if i == j:
        return polyline([position, position + a[:3]], turns=[a[3:], -a[3:]], closed=True)
    turned = Rotation.from_rotvec(-a[3:]) * Rotation.from_rotvec(b[3:]) * Rotation.from_rotvec(a[3:])
    corners = [position, position + a[:3], position + a[:3] + b[:3], position + b[:3]]
    turns = [a[3:], b[3:], -a[3:], turned.inv().as_rotvec()]
    return polyline(corners, turns=turns, closed=True)


def plane_path(task: Task, position: Vector, rotation: Matrix, i: int, j: int, size: float, stairs: int) -> Path:
    """From a corner of `plane_loop` to the opposite one: in so many stairs along rows i and j, straight for none.

    Raises:
        SingularityError where the representation is singular.
    """
    a, b = _steps(task, position, rotation, (i, j), size)
    steps = np.tile([a, b], (stairs, 1)) / stairs if stairs else np.array([a + b])
    corners = position + np.vstack([np.zeros(3), np.cumsum(steps[:, :3], axis=0)])
    return polyline(list(corners), turns=list(steps[:, 3:]))


def enclosed(task: Task, path: Path, start_rotation: Matrix) -> Matrix:
    """Area (m, m) that a closed path encloses in each plane of task rows, as a share of that of `plane_loop`.

    A_ij = 1/2 of the integral of x_i dx_j - x_j dx_i, x the tool's way from its start in the task rows, to first
    order in the turns.
    """
    at = path.at(np.linspace(0.0, path.duration, 2001))
    x = np.hstack([at.position - path.start, rotation_vector(at.rotation)]) @ _rates(task, start_rotation).T
    x /= [SIDES[unit] for unit in task.units]
    after = np.roll(x, -1, axis=0)
    return (x.T @ after - after.T @ x) / 2


def looked_at(task: Task, paths: list[Path], start_rotation: Matrix) -> dict[tuple[int, int], float]:
    """The planes in which one of the paths encloses area, with the largest share of `enclosed`."""
    areas = np.max([np.abs(enclosed(task, path, start_rotation)) for path in paths], axis=0)
    least = max(ENCLOSED * float(areas.max()), LEAST)
    return {(i, j): float(areas[i, j]) for i, j in pairs(task.m) if areas[i, j] >= least}


def _signed(task: Task, k: int, position: Vector) -> float:
    row = task.rows[k]
    towards_base = -1.0 if row < 3 and position[row] > 0 else 1.0
    return towards_base * SIDES[task.units[k]]


def _rates(task: Task, rotation: Matrix) -> Array:
    """The map (m, 6) from the twist of a tool turned by R (3, 3) to the rates of the task rows."""
    unit = np.eye(6)
    rates, margins = task.rates(np.tile(rotation, (6, 1, 1)), unit[:, :3], unit[:, 3:])
    check_representation(task, np.full(task.n, np.nan), margins[0])
    return rates.T
