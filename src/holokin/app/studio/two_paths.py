"""Two paths to one pose: how far the joints of each law are apart where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import ArgumentError, HolokinError
from ...base.types import Array, Matrix, Value, Vector
from ...motion import path_spread
from ...path import Path, polyline
from ...strategies.tasks.task import of_one_tool
from .session_laws import Law
from .states import LawStatus

WIDTH = 0.1
"""How far the two paths go apart in their middle, each from the straight line [m]."""


@dataclass(frozen=True, eq=False)
class LawPaths(Value):
    """One law on both paths: joints a (k, n), b (k, n), and the largest joint's difference at their ends.

    Where it does not get there both ways, a and b are empty, `spread` is NaN and `sentence` says why.
    """

    name: str
    colour: int
    a: Matrix
    b: Matrix
    spread: float
    sentence: str


@dataclass(frozen=True, eq=False)
class TwoPaths:
    """Two paths of the tool to one pose, points (2, k, 3) to draw, and what each law's joints do on them."""

    points: Array
    paths: tuple[Path, Path]
    by_law: tuple[LawPaths, ...]


def two_paths(
    laws: Sequence[tuple[Law, Vector, LawStatus]], pose: Matrix, width: float, samples: int, limits: bool
) -> TwoPaths:
    """The tool goes from where it is to a pose (4, 4) by a corner to the left, and by one to the right.

    laws: each with the posture (n,) where it stands, and whether it follows.

    Raises:
        ArgumentError: a task of several tools; the pose is where the tool is.
    """
    of_one_tool(laws[0][0].task, "two paths to one pose")
    law, q, _ = next((one for one in laws if one[2] is LawStatus.FOLLOWING), laws[0])
    paths = _pair(law.task.pose(q), pose, width)
    found = []
    for law, q, _ in laws:
        a, b, spread, sentence = np.zeros((0, len(q))), np.zeros((0, len(q))), np.nan, ""
        try:
            if law.strategy is None:
                raise ArgumentError("the law", law.name, "two paths are followed by strategies, not by control laws")
            both = path_spread(law.strategy, *paths, q, samples=samples, limits=limits)
            a, b, spread = both.a.q, both.b.q, both.largest
        except HolokinError as problem:
            sentence = str(problem)
        found.append(LawPaths(law.name, law.colour, a, b, spread, sentence))
    points = np.array([path.at(np.linspace(0.0, path.duration, 100)).position for path in paths])
    return TwoPaths(points, paths, tuple(found))


def _pair(begin: Matrix, end: Matrix, width: float) -> tuple[Path, Path]:
    """Polylines of poses with a corner on either side of the straight line, upright where the line is not."""
    line = end[:3, 3] - begin[:3, 3]
    up = np.array([0.0, 0.0, 1.0]) if abs(line[2]) < 0.9 * np.linalg.norm(line) else np.array([1.0, 0.0, 0.0])
    side = np.cross(up, line) if np.linalg.norm(line) > 1e-6 else np.array([1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)
    paths = []
    for sign in (1.0, -1.0):
        corner = end.copy()
        corner[:3, 3] = (begin[:3, 3] + end[:3, 3]) / 2 + sign * width * side
        paths.append(polyline(np.array([begin, corner, end])))
    return paths[0], paths[1]
