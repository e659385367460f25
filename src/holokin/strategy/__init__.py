"""Strategies: right inverses of the task Jacobian."""

from .base import Expressions, Field, Form, Strategy, check_regular
from .build import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, right_inverse, weighted
from .family import from_transport
from .fibre import SelfMotion, correction, self_motion, unit_null
from .fitted import fitted
from .physical import geometric_stiffness, gradient_and_stiffness, impedance, inertia_weighted, null_basis_expression
from .radial import radial

__all__ = [
    "Expressions",
    "Field",
    "Form",
    "SelfMotion",
    "Strategy",
    "check_regular",
    "correction",
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
    "null_basis_expression",
    "pfaffian",
    "radial",
    "right_inverse",
    "self_motion",
    "unit_null",
    "weighted",
]
