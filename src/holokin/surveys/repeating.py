"""One case of a results file again, with its own law: what a job cannot do."""

from __future__ import annotations

from pathlib import Path

from ..arguments import typed
from ..trajectory import Trajectory
from .cases import Cases
from .running import repeat_case
from .store import Store


@typed
def repeat(results: str | Path, case: str | int) -> tuple[Trajectory, str]:
    """Run a case of a survey again, in this process: control laws, too.

    Args:
        results: the .sqlite file of a survey. case: the id of a case, or its number.

    Returns:
        (what the joints did, why it stopped; empty where it went round all cycles).

    Raises:
        SurveyError: no results file. ArgumentError: no such case, or it is of objects of a survey in Python.
        HolokinError: what the row of the case gives as its reason.
    """
    with Store.opened(Path(results), None) as store:
        cases, number = Cases(store.content(), store.folder()), store.number_of(str(case))
    return repeat_case(cases.case(number), cases)
