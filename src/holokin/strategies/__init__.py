"""Strategies: right inverses G of the task Jacobian, from a frame, from rows, or from a constraint.

Uses `constraints`. Read first: `strategy.py`, `strategy_kinds.py`, `right_inverses.py`.
"""

from .family import from_transport
from .gain_expressions import Brackets as Brackets
from .gain_expressions import Expressions as Expressions
from .gain_expressions import FrameExpressions as FrameExpressions
from .gain_expressions import RowExpressions as RowExpressions
from .jumps import Jump
from .jumps import first_jump as first_jump
from .jumps import jump_near as jump_near
from .jumps import jumps_of as jumps_of
from .jumps import may_jump as may_jump
from .numeric_strategy import NumericStrategy, numeric
from .physical import check_exact as check_exact
from .physical import geometric_stiffness, gradient_and_stiffness, impedance, inertia_weighted
from .polynomial import fitted
from .radial_strategy import radial
from .right_inverses import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, right_inverse, weighted
from .self_motions import SelfMotion, self_motion
from .self_motions import SelfMotions as SelfMotions
from .self_motions import correction as correction
from .self_motions import unit_null as unit_null
from .strategy import Field, Strategy
from .strategy import check_regular as check_regular
from .strategy import check_solved as check_solved
from .strategy import checked_rate as checked_rate
from .strategy_kinds import FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy

__all__ = [
    "Field",
    "FrameStrategy",
    "HolonomicStrategy",
    "Jump",
    "KernelStrategy",
    "NumericStrategy",
    "RowStrategy",
    "SelfMotion",
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
    "self_motion",
    "weighted",
]
