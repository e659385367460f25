"""Whether the operations of a certificate are those of a robot: its task's rows f(q) - x, written down anew.

The rows of both are compared as expressions of the unknowns, the place u and the path's numbers: operation by
operation, constants by their doubles. Those of the constraint are not, nor are the path's numbers: they are in the
file.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.errors import HolokinError
from ..robot import Robot
from ..strategies.tasks.frame_task import FrameTask
from ..strategies.tasks.frames import TipFrame
from ..symbolic import symbol, vertcat
from ..symbolic.interval_function import operation_list
from .equation import Equation
from .lowering import lowered
from .shape_binding import other_shapes
from .targets import Family, PoseBox, Stretch, Stretches
from .task_rows import rows_of


def described(equation: Equation) -> dict[str, Any] | None:
    """What of an equation is needed to write its task's rows down for a robot; None of several tools or frames."""
    task, family = equation.strategy.task, equation.family
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and task.frame.name is None):
        return None
    kinds = [[m.turning, m.curved] for m in family.members] if isinstance(family, Stretches) else None
    return {
        "orientation": task.orientation, "rows": list(task.rows), "reference": np.array(task.reference).tolist(),
        "axis": np.array(task.axis).tolist(), "turning": family.turning, "stretches": kinds,
    }  # fmt: skip


def unlike(data: dict[str, Any], robot: Robot) -> str:
    """In what a certificate's data are not those of a robot; "" where its rows f(q) - x and limits are the robot's."""
    given = data.get("task")
    if given is None:
        return "it is about several tools, or a tool seen from another frame, of which no robot alone tells the rows"
    coordinates = robot.coordinates
    if [c.unit for c in coordinates] != data["units"]:
        return f"{robot.name} has {robot.n} joints, and the certificate {len(data['units'])}, or of other kinds"
    try:
        task = FrameTask(
            robot,
            given["orientation"],
            tuple(given["rows"]),
            np.array(given["reference"]),
            axis=np.array(given["axis"]),
        )
    except HolokinError as problem:
        return f"{robot.name} has no such task: {problem}"
    kinds = given["stretches"]
    family: Family = PoseBox(given["turning"]) if kinds is None else _stretches(given["turning"], kinds)
    q, y, numbers = symbol("q", robot.n), symbol("y", family.dimension), symbol("numbers", family.numbers)
    k, d = task.kinematics(q), family.dimension
    rows, facing = rows_of(task, k.position, k.rotation, *family.pose(y, numbers))
    left = family.numbers - 2 * d
    inputs = [*range(robot.n + d + left), *[0.0] * d, *[1.0] * d]
    listed = operation_list({"q": q, "y": y, "numbers": numbers}, vertcat(rows, facing))
    built = lowered(listed, inputs, [False] * (task.m + facing.shape[0]))
    n, table = len(data["pieces"][0]["q"]), {}
    of_file = _numbered(data, (n, d, left, len(data["level"])), table)
    if _numbered(built, (robot.n, d, left, 0), table) != [*of_file[: task.m], *of_file[n:]]:
        return f"its operations are not those of {robot.name}: other lengths, axes, tip, base or tool"
    least, _, _, most = data["claims"]["joints"]
    for name, low, high, a, b in zip(robot.joint_names, robot.lower, robot.upper, least, most, strict=False):
        if (a is not None and a < low) or (b is not None and b > high):
            return f"its limits of {name} are wider than those of {robot.name}"
    return other_shapes(data["clear"], robot) if "clear" in data else ""


def _numbered(data: dict[str, Any], sizes: tuple[int, ...], table: dict[Any, int]) -> list[int]:
    """Numbers of the outputs of a list of operations: the same number in a table is the same expression."""
    found = [
        table.setdefault((kind, i), len(table)) for kind, size in zip("qunc", sizes, strict=True) for i in range(size)
    ]
    found += [table.setdefault(("constant", float(value)), len(table)) for value in data["constants"]]
    for name, *of in data["operations"]:
        found.append(table.setdefault((name, *(found[i] for i in of)), len(table)))
    return [found[i] for i in data["outputs"]]


def _stretches(turning: bool, kinds: Sequence[Sequence[bool]]) -> Stretches:
    return Stretches(turning, tuple(Stretch(*kind) for kind in kinds))
