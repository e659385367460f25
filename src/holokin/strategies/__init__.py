"""Strategies: right inverses of the task Jacobian."""

from .base import Field, Strategy, check_regular, checked_rate
from .build import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, right_inverse, weighted
from .expressions import Brackets, Expressions, FrameExpressions, RowExpressions
from .family import from_transport
from .jumps import Jump, first_jump, jump_near, jumps_of, may_jump
from .kinds import FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy
from .physical import check_exact, geometric_stiffness, gradient_and_stiffness, impedance, inertia_weighted
from .polynomial import fitted
from .self_motions import SelfMotion, SelfMotions, correction, self_motion, unit_null
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
    "check_exact",
    "check_regular",
    "checked_rate",
    "correction",
    "coupled_twist",
    "first_jump",
    "fitted",
    "from_transport",
    "geometric_stiffness",
    "gradient_and_stiffness",
    "holonomic",
    "impedance",
    "inertia_weighted",
    "jump_near",
    "jumps_of",
    "may_jump",
    "moore_penrose",
    "null_basis",
    "pfaffian",
    "radial",
    "right_inverse",
    "self_motion",
    "unit_null",
    "weighted",
]
