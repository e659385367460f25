"""Questions about strategies: verdicts, curvature, drift, leaf functions, distance to a repeatable law.

Uses `motion`. Read first: `curvature_of_planes.py`, `frobenius.py`, `verdict.py`.
"""

from .curvature_of_planes import MOST_JOINTS, curvature
from .cusp_witness import CuspWitness, witness_between
from .cuspidal_leaf import Cusps, cusps
from .drift_prediction import DriftPrediction, predicted_drift
from .ends_elsewhere import why_elsewhere
from .frobenius import involutivity, involutivity_of
from .leaf_functions import LeafFunction, leaf_function
from .lie_filtration import Filtration, Integrability, filtration
from .numeric_curvature import MeasuredCurvature, measured_curvature
from .obstructions import Directions, Obstruction, Witness, obstruction
from .paper_form import GeneralForm, general_form
from .region import Ball, Region, around, ball, box
from .repeatable_distance import Deviation, RepeatableDistance, ball_postures, deviation, distance_to_repeatable
from .verdict import Accuracy, Evidence, Verdict

__all__ = [
    "MOST_JOINTS",
    "Accuracy",
    "Ball",
    "CuspWitness",
    "Cusps",
    "Deviation",
    "Directions",
    "DriftPrediction",
    "Evidence",
    "Filtration",
    "GeneralForm",
    "Integrability",
    "LeafFunction",
    "MeasuredCurvature",
    "Obstruction",
    "Region",
    "RepeatableDistance",
    "Verdict",
    "Witness",
    "around",
    "ball",
    "ball_postures",
    "box",
    "curvature",
    "cusps",
    "deviation",
    "distance_to_repeatable",
    "filtration",
    "general_form",
    "involutivity",
    "involutivity_of",
    "leaf_function",
    "measured_curvature",
    "obstruction",
    "predicted_drift",
    "why_elsewhere",
    "witness_between",
]
