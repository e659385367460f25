"""What a strategy is worth: `curvature/` tells whether it is holonomic and where its leaves have cusps, `coverage/`
how much of a workspace a leaf serves, `design/` which one serves best, `sheets/` how few serve all, `audit/` how far
any control law or log drifts.

Uses `motion` and `proof`. Read first: `curvature/`, then `audit/`.
"""

from typing import TYPE_CHECKING

from ..base.extra_module import loads

if TYPE_CHECKING:
    from . import audit as audit
    from . import coverage as coverage
    from . import curvature as curvature
    from . import design as design
    from . import sheets as sheets
else:
    __getattr__ = loads(__name__, "audit", "coverage", "curvature", "design", "sheets")
