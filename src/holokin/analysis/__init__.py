"""Questions about strategies, controllers and logs: curvature, leaves, drift, price, audits."""

from ..strategy import SelfMotion, self_motion
from .audit import Audit, Finding, audit
from .curvature import MOST_JOINTS, curvature
from .fibre import DriftFree, drift_free
from .filtration import Filtration, Holonomy, filtration
from .forecast import Forecast, forecast
from .general_form import GeneralForm, general_form
from .involutivity import involutivity, involutivity_of
from .judge import Homecoming
from .leaf_function import LeafFunction, leaf_function
from .log_audit import audit_recording
from .log_findings import LogAudit
from .price import Deviation, Price, ball_postures, deviation, price
from .region import Ball, Region, around, ball, box
from .verdict import Grounds, Verdict

__all__ = [
    "MOST_JOINTS",
    "Audit",
    "Ball",
    "Deviation",
    "DriftFree",
    "Filtration",
    "Finding",
    "Forecast",
    "GeneralForm",
    "Grounds",
    "Holonomy",
    "Homecoming",
    "LeafFunction",
    "LogAudit",
    "Price",
    "Region",
    "SelfMotion",
    "Verdict",
    "around",
    "audit",
    "audit_recording",
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
    "self_motion",
]
