"""Black boxes and logs: do the joints return with the tool?"""

from .black_box import Audit, Finding, audit
from .judge import Repeatability
from .log_audit import audit_recording
from .log_findings import LogAudit

__all__ = [
    "Audit",
    "Finding",
    "LogAudit",
    "Repeatability",
    "audit",
    "audit_recording",
]
