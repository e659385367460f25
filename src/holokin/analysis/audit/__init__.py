"""Black boxes and logs: do the joints return with the tool?

Uses `motion_analysis` and `robot_logs`. Read first: `black_box.py`, `log_audit.py`.
"""

from .black_box import Audit, Finding, audit
from .dataset_audit import audit_dataset
from .dataset_findings import DatasetAudit, EqualPoses
from .equal_poses import LogVerdict, Repeatability
from .log_audit import audit_recording
from .log_findings import LogAudit
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
