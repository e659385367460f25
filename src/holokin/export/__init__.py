"""`export_c`: a strategy as plain C for a controller, with a self-test."""

from .building import check
from .folder import Exported, c_name, export_c

__all__ = [
    "Exported",
    "c_name",
    "check",
    "export_c",
]
