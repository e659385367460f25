"""Black boxes and logs: do the joints return with the tool?

Uses `analysis/curvature` and `logs/`. Read first: `black_box.py`, `log_audit.py`.
"""

from .black_box import Audit, Finding, audit
from .dataset_audit import DatasetAudit, EqualPoses, audit_dataset
from .log_audit import LogAudit, audit_recording
from .questions import LogVerdict, Repeatability
from .trend import Trend

__all__ = [
    "Audit",
    "DatasetAudit",
    "EqualPoses",
    "Finding",
    "LogAudit",
    "LogVerdict",
    "Repeatability",
    "Trend",
    "audit",
    "audit_dataset",
    "audit_recording",
]
