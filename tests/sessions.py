"""Sessions and pages of the studio for its tests: three strategies of a Panda on a circle, and a served page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
    return [NamedStrategy(name, rule, TASK, None, keys) for name, (rule, keys) in kinds.items()]


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


def until(true: Callable[[], Any], seconds: float = 30.0, rest: float = 0.02) -> Any:
    """Wait for something that is true; its value."""
    end = time.monotonic() + seconds
    while not (value := true()):
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(rest)
    return value


@contextmanager
def served(what: Any = "ppr-cycle", **arguments: Any) -> Iterator[Any]:
    """A studio on the virtual machine, which shows the same and needs no compiler; closed in the end."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOLOKIN_NATIVE", "0")
        studio = hk.studio(what, **{"port": 0, "browser": False, "wait": False, "progress": str} | arguments)
        try:
            yield studio
        finally:
            studio.close()
