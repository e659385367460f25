"""Questions about strategies: verdicts, curvature, drift, leaf functions, distance to a repeatable strategy.

Uses `motion`. Read first: `curvature_of_planes.py`, `involutive.py`.
"""

from .curvature_of_planes import (
    MOST_JOINTS,
    DriftPrediction,
    MeasuredCurvature,
    curvature,
    measured_curvature,
    predicted_drift,
)
from .cuspidal_leaf import Cusps, CuspWitness, cusps, why_elsewhere, witness_between
from .involutive import involutivity, involutivity_of
from .leaf_functions import (
    Deviation,
    GeneralForm,
    LeafFunction,
    RepeatableDistance,
    ball_postures,
    deviation,
    distance_to_repeatable,
    general_form,
    leaf_function,
)
from .lie_filtration import Filtration, Integrability, filtration
from .obstructions import Directions, Obstruction, Witness, obstruction
from .verdict import Accuracy, Ball, Evidence, Region, Verdict, around, ball, box

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
