"""`read_sheets`: a map of sheets that was saved, with its strategies built from the keys of jobs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...analysis.sheets import Sheets
from ...analysis.sheets.sheets_file import sheets_of_file
from ...analysis.sheets.surroundings import CLEARANCE, surroundings
from ...base.arguments import typed
from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import Vector
from ...robot import LinkShape, Robot
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import custom
from ...strategies.tasks.task import Task
from .strategy_tables import KINDS, Fitted
from .table_values import filled


@typed
def read_sheets(
    path: str | Path,
    task: Task,
    *,
    clear_of: Sequence[LinkShape] | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
    shapes_of: Robot | None = None,
) -> Sheets:
    """The map of sheets that `Sheets.save` or `holokin sheets` wrote, for the task that it was made for.

    Nothing in the file is run. The postures in it are held against the model: their tools are at the poses, they lie on
    their leaves and within the limits.

    Args:
        path: the file.
        task: of the robot for which the map was made.
        clear_of, floor, clearance, self_collision, ignore, shapes_of: as they were given to `hk.sheets`.

    Returns:
        The map, as it was saved.

    Raises:
        SheetsFileError: it cannot be read, is of another robot, task or surroundings, or holds what makes no sense.
        ArgumentError: a floor without clear_of.
    """
    around = surroundings(clear_of, floor, clearance, self_collision, ignore, shapes_of)
    return sheets_of_file(path, task, around, _strategy)


def _strategy(keys: Mapping[str, Any], task: Task, q0: Vector, name: str) -> HolonomicStrategy:
    if task.n == task.m:
        return holonomic(task, custom(lambda _q: [], rows=0), name=name)
    kind = str(keys.get("kind"))
    known = {name: model for name, model in KINDS.items() if model is not Fitted}
    if kind not in known:
        raise UnknownNameError("kind of strategy", kind, known)
    found = filled(known[kind], "strategy", dict(keys)).build(task, q0, name)
    if not isinstance(found, HolonomicStrategy):
        raise ArgumentError("the strategy of a sheet", kind, "it has no leaves: give a file that a map of sheets saved")
    return found
