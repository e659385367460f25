"""A page to play with: two laws of one robot in one HTML file, that a browser computes itself, without Python.

The file has the laws as WebAssembly, the C that `hk.follow` runs, and draws by WebGL. It asks for nothing from a network.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.files import replacing
from ..base.types import Array, ArrayLike, Matrix, Value, Vector
from ..errors import ArgumentError, OpenPathError
from ..motion.follow_path import by_leaf
from ..output.bodies import Piece, pieces_of
from ..output.palette import law_colors
from ..output.robot_view import best_view
from ..path import Path
from ..path.plan import check_start, make_plan
from ..robot import Box, Capsule, Cylinder, Robot
from ..strategies import HolonomicStrategy, Strategy
from ..tasks.task import Task, of_one_tool
from ..version import __version__
from .wasm_law import drawn_of, law_code, packed, start_of, wasm_of

STEPS = 240
"""Steps of a cycle: as many as make the drift of `hk.drift`, with as many samples, the same."""

CYCLES = 8
"""Cycles that are shown at first."""

MOST_LAWS = 3
"""Laws side by side: more are too narrow."""

SCRIPTS = ("stage.js", "loops.js", "law.js", "charts.js", "play.js")

_HOLE = re.compile(r"\{\{(\w+)\}\}")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")


@dataclass(frozen=True, eq=False)
class PageLoop(Value):
    """A closed path that a page offers: its name, the path, the posture (n,) it begins at, and what there is to see."""

    name: str
    path: Path
    q0: Vector
    text: str = ""


@dataclass(frozen=True, eq=False)
class WebPage(Value):
    """A page, as a file of its own."""

    html: str

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write the page to a file, whole or not at all. Raises: WriteError."""
        with replacing(file) as part:
            part.write_text(self.html, "utf-8")
        return FilePath(file)


@typed
def web_page(
    laws: Mapping[str, Strategy],
    q0: ArrayLike,
    path: Path,
    *,
    title: str | None = None,
    text: str = "",
    loops: Sequence[PageLoop] = (),
) -> WebPage:
    """A page on which a loop of the tool is dragged, and laws of one robot follow it side by side.

    The numbers are those of `hk.follow` with 240 samples a cycle. The circle and the figure eight of the page begin at
    the tool pose of q0.

    Args:
        laws: name -> strategy, one to three of one robot and task; the first is at the left.
        q0: the posture (n,) at which all begin.
        path: a closed path from there: the page shows it first. A circle and a figure eight have its size.
        text: what there is to see, beside what the page says of drift.
        loops: more closed paths, with postures of their own.

    Raises:
        MissingExtraError: zig is not installed. ExportError: a law that cannot be compiled. OpenPathError.
        ArgumentError: too many laws, or of several robots or tasks; several tips. StartError: of a path. JointLimitError.
    """
    names, strategies = list(laws), list(laws.values())
    if not 1 <= len(laws) <= MOST_LAWS:
        raise ArgumentError("the number of laws on a page", len(laws), f"give one to {MOST_LAWS}")
    task = strategies[0].task
    for one in strategies:
        if one.task.robot is not task.robot and one.task.robot != task.robot or one.task.m != task.m:
            raise ArgumentError("the laws of a page", [s.name for s in strategies], "give those of one robot and task")
        of_one_tool(one.task, "a page")
    start = task.robot.checked(q0, "the start posture")
    task.robot.check_limits(start)
    offered = [PageLoop("The path of the job", path, start), *loops]
    drawing = _Drawing.of(task, start)
    longest = max(len(loop.path.segments) for loop in offered)
    shown = [_loop(loop, strategies) for loop in offered]
    data = {
        "title": title or f"{task.robot.name}: drag the loop",
        "robot": task.robot.name,
        "joints": [{"name": joint.name, "unit": joint.unit} for joint in task.robot.coordinates],
        "steps": STEPS,
        "cycles": CYCLES,
        "laws": [
            {
                "name": name,
                "leaf": by_leaf(law) is not None,
                "color": color,
                "module": packed(wasm_of(law_code(law, drawing.drawn, max(2, longest)), law.name)),
            }
            for (name, law), color in zip(laws.items(), _colors(strategies), strict=True)
        ],
        "pieces": drawing.pieces,
        "view": _view(task, drawing, start, path),
        "planar": task.robot.planar,
        "size": _size(path),
        "plane": _plane(path) if not task.robot.planar else 2,
        "turns": bool(task.rotations),
        "loops": shown,
        "names": names,
    }
    return WebPage(_page(data, text))


@dataclass(frozen=True, eq=False)
class _Drawing:
    """What an arm is drawn by: its pieces for the page, and their points."""

    pieces: list[dict[str, Any]]
    drawn: Any
    found: tuple[Piece, ...]

    @staticmethod
    def of(task: Task, q0: Vector) -> _Drawing:
        robot = _bare(task.robot)
        found = pieces_of(robot, q0[None])
        ends = [_ends(piece) for piece in found]
        pieces = [
            {"role": piece.role, "radius": _radius(piece), "flat": not isinstance(piece.part.shape, Capsule)}
            for piece in found
        ]
        return _Drawing(pieces, drawn_of(robot, found, ends, task.tip), found)

    def at(self, robot: Robot, q: Vector) -> Matrix:
        """The points (k, 3) at a posture."""
        return np.asarray(self.drawn.function(robot)(q)).reshape(-1, 3)


def _bare(robot: Robot) -> Robot:
    """The robot without the shapes of its model: a page draws rods."""
    from dataclasses import replace

    return replace(robot, shapes=(), visuals=())


def _half(piece: Piece) -> float:
    shape = piece.part.shape
    return float(shape.sides[2]) / 2 if isinstance(shape, Box) else float(shape.length) / 2  # type: ignore[union-attr]


def _radius(piece: Piece) -> float:
    shape = piece.part.shape
    return float(shape.sides[0]) / 2 if isinstance(shape, Box) else float(shape.radius)  # type: ignore[union-attr]


def _ends(piece: Piece) -> tuple[Vector, Vector]:
    """Both ends of a rod, a disc or a beam, in the frame of its joint."""
    T = piece.part.placement
    step = _half(piece) * T[:3, 2]
    return T[:3, 3] - step, T[:3, 3] + step


def _loop(loop: PageLoop, laws: Sequence[Strategy]) -> dict[str, Any]:
    """A loop for the page: its table, as `hk.follow` has it, and what each law begins with."""
    task = laws[0].task
    start = task.robot.checked(loop.q0, f"the start posture of {loop.name!r}")
    task.robot.check_limits(start)
    if not loop.path.closed:
        raise OpenPathError("a page", loop.path.gap)
    plan = make_plan(task, loop.path, STEPS, task.place(start)[1])
    p, R = plan.first
    check_start(task, start, p, R)
    return {
        "name": loop.name,
        "text": loop.text,
        "q0": start.tolist(),
        "first": [*p.tolist(), *R.ravel().tolist()],
        "rows": loop.path.table(plan.start_rotation).tolist(),
        "counts": plan.counts.tolist(),
        "line": plan.position[:, :3].tolist(),
        "begin": [start_of(law, start, p, R) for law in laws],
    }


def _colors(laws: Sequence[Strategy]) -> tuple[str, ...]:
    return law_colors([isinstance(law, HolonomicStrategy) for law in laws])


def _size(path: Path) -> list[float]:
    """From the start of a path to its farthest point (3,)."""
    points = path.at(np.linspace(0, path.duration, 361)).position
    return (points[np.argmax(np.linalg.norm(points - path.start, axis=1))] - path.start).tolist()


def _plane(path: Path) -> int:
    """The axis, 0 to 2, about which a path winds most."""
    area = np.abs(path.area)
    return int(area.argmax()) if area.max() > 0 else 2


def _view(task: Task, drawing: _Drawing, q0: Vector, path: Path) -> dict[str, Any]:
    """From where the arm is seen: what to look at, how far round it there is something, azimuth and elevation."""
    points = drawing.at(task.robot, q0)
    line = path.at(np.linspace(0, path.duration, 61)).position
    every = np.vstack([points, line])
    low, high = every.min(axis=0), every.max(axis=0)
    view = best_view([points], [line])
    around = float(np.linalg.norm(high - low)) / 2
    return {
        "center": ((low + high) / 2).tolist(),
        "around": around,
        "azimuth": -90.0 if task.robot.planar else view.azimuth,
        "elevation": 89.0 if task.robot.planar else view.elevation,
        "floor": min(0.0, float(low[2])),
    }


def _page(data: dict[str, Any], text: str) -> str:
    """The HTML: what is the user's own is escaped, and the policy lets nothing run but the script by its hash."""
    script = "\n".join(_file(name) for name in SCRIPTS)
    parts = {
        "title": escape(str(data["title"])),
        "text": f"<p>{escape(text)}</p>" if text else "",
        "version": escape(__version__),
        "style": _file("page.css"),
        "script": script,
        "style_hash": _hash(_file("page.css")),
        "script_hash": _hash(script),
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    }
    page = _HOLE.sub(lambda hole: parts[hole[1]], _file("page.html"))
    return _CONTROL.sub("\ufffd", page)


def _file(name: str) -> str:
    return files("holokin.studios").joinpath("web", name).read_text("utf-8")


def _hash(text: str) -> str:
    """As a Content-Security-Policy names a script or a style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
