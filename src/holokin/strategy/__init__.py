"""Strategies: right inverses of the task Jacobian."""

from .base import Expressions, Field, Form, Strategy
from .build import coupled_twist, holonomic, moore_penrose, null_basis, pfaffian, weighted
from .radial import radial

__all__ = [
    "Expressions",
    "Field",
    "Form",
    "Strategy",
    "coupled_twist",
    "holonomic",
    "moore_penrose",
    "null_basis",
    "pfaffian",
    "radial",
    "weighted",
]
