"""One case of a results file again, with its own law: what a job cannot do."""

from __future__ import annotations

from pathlib import Path

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...motion.trajectory import Trajectory
from .cases import Case, Cases
from .one_case import repeat_case
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
        cases, found = case_of(store, str(case))
    return repeat_case(found, cases)


def case_of(store: Store, case: str) -> tuple[Cases, Case]:
    """(the cases of a survey, the one of an id or a number). Raises: ArgumentError: there is none."""
    cases, row = Cases(store.content(), store.folder()), store.row_of(case)
    found = cases.of_row(row)
    if found is None:
        raise ArgumentError("the case", case, "the survey asks it no more: take another one, or run the survey anew")
    return cases, found
