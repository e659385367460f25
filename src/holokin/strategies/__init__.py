"""Strategies: right inverses G of the task Jacobian, from a frame, from rows, or from a constraint.

Uses `robot`. Read first: `strategy.py`, `right_inverses.py`.
"""

from .jumps import Jump
from .jumps import first_jump as first_jump
from .jumps import jump_near as jump_near
from .jumps import jumps_of as jumps_of
from .jumps import may_jump as may_jump
from .radial_strategy import radial
from .right_inverses import (
    NumericStrategy,
    coupled_twist,
    fitted,
    from_transport,
    geometric_stiffness,
    gradient_and_stiffness,
    holonomic,
    impedance,
    inertia_weighted,
    moore_penrose,
    null_basis,
    numeric,
    pfaffian,
    right_inverse,
    weighted,
)
from .right_inverses import check_exact as check_exact
from .self_motion_curves import CurveTracer as CurveTracer
from .self_motion_curves import SelfMotionCurve, self_motion_curve
from .self_motion_curves import correction as correction
from .self_motion_curves import unit_null as unit_null
from .strategy import Brackets as Brackets
from .strategy import Expressions as Expressions
from .strategy import Field, FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy, Strategy
from .strategy import FrameExpressions as FrameExpressions
from .strategy import RowExpressions as RowExpressions
from .strategy import check_regular as check_regular
from .strategy import check_solved as check_solved
from .strategy import checked_rate as checked_rate

__all__ = [
    "Field",
    "FrameStrategy",
    "HolonomicStrategy",
    "Jump",
    "KernelStrategy",
    "NumericStrategy",
    "RowStrategy",
    "SelfMotionCurve",
    "Strategy",
    "coupled_twist",
    "fitted",
    "from_transport",
    "geometric_stiffness",
    "gradient_and_stiffness",
    "holonomic",
    "impedance",
    "inertia_weighted",
    "moore_penrose",
    "null_basis",
    "numeric",
    "pfaffian",
    "radial",
    "right_inverse",
    "self_motion_curve",
    "weighted",
]
