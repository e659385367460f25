"""Control laws, also those that are not dq = G dx: textbook laws, laws with memory, pink, mink and placo.

Uses `motion/ik`. Read first: `control_law.py`, `libraries.py`.
"""

from .control_law import (
    ControlLaw,
    Step,
    as_control_law,
    asymptotically_cyclic,
    closed_loop,
    damped,
    gradient_projection,
    impedance_with_memory,
    open_loop,
    repetitive_motion,
)
from .libraries import PostureTask, mink_law, mink_task, pink_law, pink_task, placo_law

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
