"""Control: laws that run in a loop, and the loop."""

from .adapters import PostureTask, mink_controller, pink_controller, placo_controller
from .controller import Controller, Law, as_controller, open_loop
from .drive import drive
from .integrate import checked_rate, runge_kutta
from .memory import impedance_with_memory
from .plan import Plan, make_plan, record
from .progress import progress
from .textbook import asymptotically_cyclic, closed_loop, damped, gradient_projection, repetitive_motion

__all__ = [
    "Controller",
    "Law",
    "Plan",
    "PostureTask",
    "as_controller",
    "asymptotically_cyclic",
    "checked_rate",
    "closed_loop",
    "damped",
    "drive",
    "gradient_projection",
    "impedance_with_memory",
    "make_plan",
    "mink_controller",
    "open_loop",
    "pink_controller",
    "placo_controller",
    "progress",
    "record",
    "repetitive_motion",
    "runge_kutta",
]
