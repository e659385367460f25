"""Strategies: right inverses of the task Jacobian."""

from .base import Expressions, Field, Form, Strategy, check_regular
from .build import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, right_inverse, weighted
from .family import from_transport
from .fibre import SelfMotion, correction, self_motion, unit_null
from .integrate import checked_rate, runge_kutta
from .physical import geometric_stiffness, gradient_and_stiffness, impedance, inertia_weighted, null_basis_expression
from .polynomial import fitted
from .straight_lines import radial

__all__ = [
    "Expressions",
    "Field",
    "Form",
    "SelfMotion",
    "Strategy",
    "check_regular",
    "checked_rate",
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
    "runge_kutta",
    "self_motion",
    "unit_null",
    "weighted",
]
