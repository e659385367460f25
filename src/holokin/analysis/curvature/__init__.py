"""Questions about strategies: verdicts, curvature, drift, leaf functions, distance to a repeatable strategy.

Uses `motion`. Read first: `curvature_of_planes.py`, `involutive.py`.
"""

from .curvature_of_planes import (
    MOST_JOINTS,
    MeasuredCurvature,
    curvature,
    measured_curvature,
)
from .cuspidal_leaf import Cusps, CuspWitness, cusps, why_elsewhere, witness_between
from .involutive import involutivity, involutivity_of
from .leaf_functions import (
    Deviation,
    GeneralForm,
    LeafFunction,
    RepeatableDistance,
    ball_postures,
    distance_to_repeatable,
    general_form,
    leaf_function,
)
from .lie_filtration import Filtration, Integrability, filtration
from .verdict import Accuracy, Ball, Evidence, Region, Verdict, around, ball, box

__all__ = [
    "MOST_JOINTS",
    "Accuracy",
    "Ball",
    "CuspWitness",
    "Cusps",
    "Deviation",
    "Evidence",
    "Filtration",
    "GeneralForm",
    "Integrability",
    "LeafFunction",
    "MeasuredCurvature",
    "Region",
    "RepeatableDistance",
    "Verdict",
    "around",
    "ball",
    "ball_postures",
    "box",
    "curvature",
    "cusps",
    "distance_to_repeatable",
    "filtration",
    "general_form",
    "involutivity",
    "involutivity_of",
    "leaf_function",
    "measured_curvature",
    "why_elsewhere",
    "witness_between",
]
