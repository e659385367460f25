"""Questions about strategies: verdicts, curvature, drift, leaf functions, distance to a repeatable law."""

from .brackets import MOST_JOINTS, curvature
from .drift_forecast import Forecast, forecast
from .drift_free_sets import DriftFree, drift_free
from .frobenius import involutivity, involutivity_of
from .leaf_functions import LeafFunction, leaf_function
from .lie_filtration import Filtration, Holonomy, filtration
from .paper_form import GeneralForm, general_form
from .region import Ball, Region, around, ball, box
from .repeatable_distance import Deviation, Price, ball_postures, deviation, price
from .verdict import Grounds, Verdict

__all__ = [
    "MOST_JOINTS",
    "Ball",
    "Deviation",
    "DriftFree",
    "Filtration",
    "Forecast",
    "GeneralForm",
    "Grounds",
    "Holonomy",
    "LeafFunction",
    "Price",
    "Region",
    "Verdict",
    "around",
    "ball",
    "ball_postures",
    "box",
    "curvature",
    "deviation",
    "drift_free",
    "filtration",
    "forecast",
    "general_form",
    "involutivity",
    "involutivity_of",
    "leaf_function",
    "price",
]
