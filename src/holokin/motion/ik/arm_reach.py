"""Which poses any posture of an arm has at all, on whatever leaf: by its closed inverse, over one joint that is held.

A pose has a posture only where the first step of the inverse has a root, at some value c of the held joint. How real
that root is, is a smooth function of c. Between samples over the whole turn it exceeds them by less than half of the
most that neighbours differ by: a wave A cos(n c) does so, and on four arms 0.15 of it was measured.
"""

from __future__ import annotations

import numpy as np

from ...base.types import kept
from ...robot.closed_form import ArmClass, ClosedInverse, arm_class
from ...strategies import HolonomicStrategy
from ...strategies.tasks.frame_task import FrameTask
from ...strategies.tasks.task import TipFrame

TURN = np.linspace(-np.pi, np.pi, 32, endpoint=False)[:, None]
"""Values (k, 1) of the held joint at which the first step is looked at."""

SURELY = 1e-6
"""How far below 0 the root's reality is at least where there is none: the exact model may be 1e-7 off the arm's."""


@kept
def _arm_inverse(strategy: HolonomicStrategy, limits: bool) -> ClosedInverse | None:
    """The inverse of the arm that one held hinge leaves, the last that does, or none where nothing is redundant; with
    steps of degree two. None without one, and where the task does not ask for the whole pose of a tip."""
    task = strategy.task
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and set(task.rows) == set(range(6))):
        return None
    robot = task.robot
    choices = [(k,) for k in reversed(range(task.n)) if robot.hinges[k]] if task.n == 7 else [()] * (task.n == 6)
    arms = (arm_class(robot, held, task.tip) for held in choices)
    arm = next((arm for arm in arms if isinstance(arm, ArmClass) and arm.proven), None)
    multipliers = [link.multiplier for link in arm.links if link.coordinate in arm.held] if arm is not None else []
    return None if arm is None or any(abs(x) != 1 for x in multipliers) else ClosedInverse(arm, limits)


def reach_code(strategy: HolonomicStrategy) -> str:
    """C that reach.c needs; empty without a closed inverse."""
    inverse = _arm_inverse(strategy, False)
    if inverse is None:
        return ""
    held = inverse.arm.held[0] if inverse.arm.held else -1
    numbers = {"HELD": held, "VALUES": len(TURN) if held >= 0 else 1, "SURELY": SURELY}
    head = "".join(f"#define HK_REACH_{key} {value!r}\n" for key, value in numbers.items())
    return f"#define HK_REACH\n{head}{inverse.first_root.c('hk_first_body')}"
