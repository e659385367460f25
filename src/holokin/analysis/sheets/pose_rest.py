"""`PoseRest`: what becomes of the poses of a workspace, and why some are not served."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from ...base.types import Array, Indices, NoTruthValue
from ...motion.checks import Clear
from ...strategies.tasks.task import Task
from ..coverage.proposed_workspace import reached
from ..coverage.starts import postures_at

BLOCKED_LOOKS = 200
"""Poses for which clear postures are searched for at most, to tell why they are not served."""


class PoseRest(NoTruthValue, IntEnum, ask="`is PoseRest.SERVED`"):
    """What becomes of a pose of the workspace; `text` says it in words."""

    SERVED = 0
    NOT_COVERED = 1
    BLOCKED = 2
    LIMITS = 3
    OUT_OF_REACH = 4

    @property
    def text(self) -> str:
        """The cause in words."""
        return _TEXTS[self]


_TEXTS = {
    PoseRest.SERVED: "served by a sheet",
    PoseRest.NOT_COVERED: "the arm reaches it, but with the joints of no sheet",
    PoseRest.BLOCKED: "every posture found is too near to an obstacle, the floor or another link",
    PoseRest.LIMITS: "every posture found is beyond the joint limits",
    PoseRest.OUT_OF_REACH: "out of reach: no posture was found",
}


def rests_of(task: Task, T: Array, clear: Clear | None) -> Indices:
    """A `PoseRest` for each pose (k,), NOT_COVERED where a posture reaches it."""
    Q, reach = reached(task, T, None)
    rest = np.full(len(T), int(PoseRest.NOT_COVERED))
    rest[~reach.within] = PoseRest.LIMITS
    rest[~reach.anyhow] = PoseRest.OUT_OF_REACH
    if clear is not None and reach.within.any():
        blocked = np.flatnonzero(reach.within)
        rest[blocked[~clear(Q[blocked])]] = PoseRest.BLOCKED
        for i in np.flatnonzero(rest == PoseRest.BLOCKED)[:BLOCKED_LOOKS]:
            found = postures_at(task, T[i])
            if len(found) and clear(found).any():
                rest[i] = PoseRest.NOT_COVERED
    return rest
