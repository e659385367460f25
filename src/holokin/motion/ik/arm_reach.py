"""Which poses any posture of an arm has at all, on whatever leaf: by its closed inverse, over one joint that is held.

A pose has a posture only where the first step of the inverse has a root, at some value c of the held joint. How real
that root is, is a smooth function of c. Between samples over the whole turn it exceeds them by less than half of the
most that neighbours differ by: a wave A cos(n c) does so, and on four arms 0.15 of it was measured.
"""

from __future__ import annotations

import numpy as np

from ...robot.closed_form import ArmClass, ClosedInverse, arm_class
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frame_task import asks_whole_pose
from ..self_motions.self_motions import cut_class

TURN = np.linspace(-np.pi, np.pi, 32, endpoint=False)[:, None]
"""Values (k, 1) of the held joint at which the first step is looked at."""

SURELY = 1e-6
"""How far below 0 the root's reality is at least where there is none: the exact model may be 1e-7 off the arm's."""


def _first_step(strategy: HolonomicStrategy) -> ClosedInverse | None:
    """The closed inverse, with steps of degree two, of the arm that a held hinge leaves, or of six joints as they are;
    None without one."""
    task = strategy.task
    arm = cut_class(task) if task.n == 7 else arm_class(task.robot, (), task.tip) if asks_whole_pose(task) else None
    if not isinstance(arm, ArmClass) or not arm.proven or not task.robot.hinges[list(arm.held)].all():
        return None
    multipliers = [link.multiplier for link in arm.links if link.coordinate in arm.held]
    return None if any(abs(x) != 1 for x in multipliers) else ClosedInverse(arm, limits=False)


def reach_code(strategy: HolonomicStrategy) -> str:
    """C that reach.c needs; empty without a closed inverse."""
    inverse = _first_step(strategy)
    if inverse is None:
        return ""
    held = inverse.arm.held[0] if inverse.arm.held else -1
    numbers = {"HELD": held, "VALUES": len(TURN) if held >= 0 else 1, "SURELY": SURELY}
    head = "".join(f"#define HK_REACH_{key} {value!r}\n" for key, value in numbers.items())
    return f"#define HK_REACH\n{head}{inverse.first_root.c('hk_first_body')}"
