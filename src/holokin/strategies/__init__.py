"""Strategies: right inverses of the task Jacobian."""

from .base import Field, Strategy
from .base import check_regular as check_regular
from .base import checked_rate as checked_rate
from .build import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, right_inverse, weighted
from .expressions import Brackets, Expressions, FrameExpressions, RowExpressions
from .family import from_transport
from .jumps import Jump
from .jumps import first_jump as first_jump
from .jumps import jump_near as jump_near
from .jumps import jumps_of as jumps_of
from .jumps import may_jump as may_jump
from .kinds import FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy
from .physical import check_exact as check_exact
from .physical import geometric_stiffness, gradient_and_stiffness, impedance, inertia_weighted
from .polynomial import fitted
from .self_motions import SelfMotion, SelfMotions, self_motion
from .self_motions import correction as correction
from .self_motions import unit_null as unit_null
from .straight_lines import radial

__all__ = [
    "Brackets",
    "Expressions",
    "Field",
    "FrameExpressions",
    "FrameStrategy",
    "HolonomicStrategy",
    "Jump",
    "KernelStrategy",
    "RowExpressions",
    "RowStrategy",
    "SelfMotion",
    "SelfMotions",
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
    "pfaffian",
    "radial",
    "right_inverse",
    "self_motion",
    "weighted",
]
