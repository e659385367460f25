"""Questions about strategies and logs: curvature, involutivity, audits."""

from .curvature import curvature
from .involutivity import Verdict, involutivity, involutivity_of
from .log_audit import LogAudit, LogVerdict, audit_recording
from .region import Region, around, box

__all__ = [
    "LogAudit",
    "LogVerdict",
    "Region",
    "Verdict",
    "around",
    "audit_recording",
    "box",
    "curvature",
    "involutivity",
    "involutivity_of",
]
