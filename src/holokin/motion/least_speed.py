"""The joint speed of a motion over the least that any law could have."""

from __future__ import annotations

import numpy as np

from ..strategies.tasks.task import Task
from .trajectory import Trajectory


def over_least_speed(task: Task, walk: Trajectory) -> float:
    """Joint speed (rms) over that of the pseudo-inverse at the same postures; NaN where the tool does not move."""
    J, _ = task.jacobian_batch(walk.q)
    least = np.linalg.pinv(J) @ (J @ walk.dq[:, :, None])
    size = float(np.linalg.norm(least))
    return float(np.linalg.norm(walk.dq)) / size if size > 0 else np.nan
