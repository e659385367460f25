"""Constraints g(q) that complete a task to r + m = n rows."""

from .base import Constraint, as_gain, custom, linear, lock, stack
from .coupled import coupled

__all__ = ["Constraint", "as_gain", "coupled", "custom", "linear", "lock", "stack"]
