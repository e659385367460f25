"""Maps of sheets that are put together by hand, in no time: the sheets are given, nothing is searched for."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

import holokin as hk
from holokin.analysis.sheets import PoseRest, Sheet, Sheets
from holokin.analysis.sheets.sheet import known, turn_length
from holokin.motion.checks import Clearances

LIMIT = np.radians(150)


def planar_task() -> hk.Task:
    return hk.position(hk.with_limits(hk.load("planar-3r"), lower=-LIMIT, upper=LIMIT))


def disc(radius: float = 3.0) -> hk.Workspace:
    return hk.workspace(cylinder=([0, 0, 0], radius, 0.0))


def map_of(
    task: hk.Task, space: hk.Workspace, sheets: Sequence[Sheet], samples: int, scene: hk.Scene | None = None
) -> Sheets:
    """The map of some sheets: each pose has the first one that serves it."""
    T = space.poses(samples)
    clear = None if scene is None else Clearances.of(task.robot, scene).clear
    q = np.array([sheet.postures(T, clear)[0] for sheet in sheets])
    served = known(q)
    labels = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
    rest = np.where(labels >= 0, int(PoseRest.SERVED), int(PoseRest.NOT_COVERED))
    none = np.zeros((0, 2), dtype=int)
    return Sheets(
        task,
        space,
        tuple(sheets),
        T,
        q,
        labels,
        rest,
        none,
        none,
        0,
        len(sheets),
        len(sheets),
        turn_length(task),
        scene,
    )


def planar_map(samples: int = 40) -> Sheets:
    """Three links of 1 m: two elbows up, one down, within +-150 degrees, over the disc that they reach."""
    task = planar_task()
    equal, lock = hk.holonomic(task, hk.linear([0, 1, -1])), hk.holonomic(task, hk.lock(1))
    starts = [[0.2, 0.9, 0.9], [0.4, -0.9, -0.9], [-0.5, 1.3, 0.3]]
    sheets = [Sheet(law, np.array(q)) for law, q in zip((equal, equal, lock), starts, strict=True)]
    return map_of(task, hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0)), sheets, samples)


def panda_map(samples: int = 24) -> Sheets:
    """A Panda with its elbow locked to one side and to the other, the tool down in a box before it."""
    task = hk.pose(hk.load("panda"))
    law = hk.holonomic(task, hk.lock("panda_joint3"))
    left = np.array([0.3, -0.5, -0.5, -2.2, -0.2, 1.7, 0.6])
    starts = [left, left * [-1, 1, -1, 1, -1, 1, 1]]
    sheets = [Sheet(law, q) for q in starts]
    return map_of(task, hk.workspace(box=([0.45, 0, 0.4], [0.15, 0.3, 0.2]), tilt=0.3), sheets, samples)


def overlapping_law() -> hk.HolonomicStrategy:
    """The tool on a line through the base that turns 1.3 times as fast as joint 1: its leaf overlaps itself."""

    def g(q: ca.SX) -> ca.SX:
        x = ca.cos(q[0]) + ca.cos(q[0] + q[1]) + ca.cos(q[0] + q[1] + q[2])
        y = ca.sin(q[0]) + ca.sin(q[0] + q[1]) + ca.sin(q[0] + q[1] + q[2])
        return ca.sin(1.3 * q[0]) * x - ca.cos(1.3 * q[0]) * y

    return hk.holonomic(planar_task(), hk.custom(g, rows=1))


OVERLAPPING_START = np.array([0.0, -np.arccos(0.5), 2 * np.arccos(0.5)])
"""A posture of this leaf, with the tool at (2, 0)."""
