"""Metrics of the user's own: columns of a survey, each a function of what the joints did."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from ...base.errors import OwnFunctionError
from ...base.own_number import own_number
from ...motion.trajectory import Trajectory
from ..job.table_values import Table
from .objects import given
from .user_functions import imported

ColumnName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,39}$")]
"""The name of a column: letters, digits and _."""


class GivenMetric(Table):
    """One that `hk.survey` was given: a function of the trajectory."""

    kind: Literal["given"]
    key: str


OwnMetric = Annotated[str, Field(pattern=r"^[\w.]+:\w+$")] | GivenMetric
"""In a survey file "module:function", of which the module is looked for beside the file first."""


def own_metrics(
    asked: Mapping[str, OwnMetric], walk: Trajectory, folder: Path
) -> tuple[dict[str, float], list[OwnFunctionError]]:
    """(the numbers by name, what went wrong). A metric without a number is left out. Raises: ArgumentError."""
    found: dict[str, float] = {}
    problems: list[OwnFunctionError] = []
    for name, metric in asked.items():
        function = imported(metric, folder) if isinstance(metric, str) else given(metric.key)
        try:
            number = own_number(f"the metric {name!r}", function, walk)
        except OwnFunctionError as problem:
            problems.append(problem)
            continue
        if number is not None:
            found[name] = number
    return found, problems
