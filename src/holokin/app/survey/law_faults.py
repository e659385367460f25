"""What would be a fault of every case of a law is said before anything runs."""

from __future__ import annotations

from importlib.util import find_spec

from ...base.errors import ArgumentError, MissingExtraError
from ...motion.control.libraries import LIBRARIES
from .cases import Cases, Stratum
from .store import COLUMNS
from .survey_laws import Library, Own
from .user_functions import imported


def check_laws(cases: Cases, *, here: bool = True) -> None:
    """Check what laws import, and that libraries are asked for whole poses alone.

    Args:
        here: libraries run on this machine, and not on the workers of a cluster.

    Raises:
        ArgumentError: a function that cannot be imported; a metric with the name of a column; a task that is no whole
            pose. MissingExtraError.
    """
    asked = {law for stratum in cases.strata for law in stratum.laws}
    for name, law in cases.table.laws.items():
        if name in asked and isinstance(law, Own):
            imported(law.function, cases.folder)
        if name in asked and isinstance(law, Library) and here and find_spec(law.kind) is None:
            raise MissingExtraError(LIBRARIES[law.kind].package, law.kind)
    for name, metric in cases.table.metrics.items():
        if name in COLUMNS:
            raise ArgumentError("the name of a metric", name, f"take another one than {', '.join(COLUMNS)}")
        if isinstance(metric, str):
            imported(metric, cases.folder)
    for stratum in cases.strata:
        _check_tasks(stratum, cases)


def _check_tasks(stratum: Stratum, cases: Cases) -> None:
    task = cases.table.tasks[stratum.task]
    if task.kind == "pose" and task.orientation == "twist" and task.rows is None:
        return
    for name in stratum.laws:
        if isinstance(cases.table.laws[name], Library):
            cure = f"it follows whole poses alone: leave it out, [[without]] law = {name!r}, task = {stratum.task!r}"
            raise ArgumentError(f"the task of the law {name!r}", stratum.task, cure)
