"""Surveys: the same questions asked of many robots, starts, loops and laws; resumable, on one machine or several."""

from .findings import Findings
from .reading import read_survey, survey_of
from .report import repeated, write_survey_report
from .store import Store
from .surveying import Progress, run_survey
from .tables import SurveyTable

__all__ = [
    "Findings",
    "Progress",
    "Store",
    "SurveyTable",
    "read_survey",
    "repeated",
    "run_survey",
    "survey_of",
    "write_survey_report",
]
