"""A session of the studio on a Panda, for its tests: three strategies on a circle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import holokin as hk
from conftest import PANDA_START
from holokin.app.studio import NamedStrategy, Origin, Phase, Session, Snapshot, circle_loop

PANDA = hk.load("panda")
TASK = hk.pose(PANDA)
FRAME = 1 / 30
ROBOT = {"name": "panda"}


def panda_strategies() -> list[NamedStrategy]:
    """The pseudo-inverse, a joint locked and the arm angle: compiled once for all tests."""
    kinds = {
        "pseudo-inverse": (hk.moore_penrose(TASK), {"kind": "moore-penrose"}),
        "lock": (hk.holonomic(TASK, hk.lock("panda_joint3")), {"kind": "lock", "joints": ["panda_joint3"]}),
        "arm angle": (hk.holonomic(TASK, hk.arm_angle()), {"kind": "arm-angle"}),
    }
    return [NamedStrategy(name, i, rule, TASK, None, keys) for i, (name, (rule, keys)) in enumerate(kinds.items())]


STRATEGIES = panda_strategies()
TOOL = PANDA.pose(PANDA_START)


def panda(strategies: Sequence[NamedStrategy] = STRATEGIES, **more: object) -> Session:
    """A session of strategies on a circle of 0.1 m that begins at the tool."""
    loop = circle_loop(TOOL[:3, 3] - [0.1, 0, 0], 0.1, near=TOOL[:3, 3], samples=100)
    origin = Origin(ROBOT, {"kind": "pose", "orientation": "twist"}, Path.cwd())
    return Session(strategies, PANDA_START, loop, origin=origin, **more)  # type: ignore[arg-type]


def run(session: Session, dt: float = FRAME, most: int = 5000) -> Snapshot:
    """The loop to its end."""
    found = session.play()
    for _ in range(most):
        found = session.advance(dt)
        if found.phase is Phase.DONE:
            return found
    raise AssertionError("the loop did not end")


def shifted(dx: float, dy: float = 0.0, dz: float = 0.0) -> np.ndarray:
    """The tool pose at the start, moved."""
    pose = TOOL.copy()
    pose[:3, 3] += [dx, dy, dz]
    return pose
