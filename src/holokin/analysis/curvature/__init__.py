"""Questions about strategies: verdicts, curvature, cusps, distance to a repeatable strategy.

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
from .leaf_geometry import (
    Deviation,
    GeneralForm,
    RepeatableDistance,
    ball_postures,
    distance_to_repeatable,
    general_form,
)
from .verdict import Accuracy, Ball, Evidence, Region, Verdict, around, ball, box

__all__ = [
    "MOST_JOINTS",
    "Accuracy",
    "Ball",
    "CuspWitness",
    "Cusps",
    "Deviation",
    "Evidence",
    "GeneralForm",
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
    "general_form",
    "involutivity",
    "involutivity_of",
    "measured_curvature",
    "why_elsewhere",
    "witness_between",
]
