"""Control laws, also those that are not dq = G dx: textbook laws, laws with memory, pink, mink and placo.

Uses `inverse_kinematics`. Read first: `control_law.py`, `feedback_laws.py`, `libraries.py`.
"""

from .control_law import ControlLaw, Step, as_control_law, open_loop
from .feedback_laws import asymptotically_cyclic, closed_loop, damped, gradient_projection, repetitive_motion
from .leaf_tasks import mink_task, pink_task
from .libraries import PostureTask, mink_law, pink_law, placo_law
from .memory import impedance_with_memory

__all__ = [
    "ControlLaw",
    "PostureTask",
    "Step",
    "as_control_law",
    "asymptotically_cyclic",
    "closed_loop",
    "damped",
    "gradient_projection",
    "impedance_with_memory",
    "mink_law",
    "mink_task",
    "open_loop",
    "pink_law",
    "pink_task",
    "placo_law",
    "repetitive_motion",
]
