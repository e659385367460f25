"""A small survey, and laws that surveys import in the tests: ones that throw, hang, or take their process with them."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin.app.survey import Store, SurveyTable, survey_of
from holokin.motion.control import ControlLaw


def _acting(act: Any) -> Any:
    def made(task: hk.Task, _start: np.ndarray) -> ControlLaw:
        def begin(_q0: np.ndarray) -> Any:
            def step(q: np.ndarray, _pose: Any, _twist: Any, _dt: float) -> np.ndarray:
                act()
                return np.zeros(task.n)

            return step

        return ControlLaw("own", begin)

    return made


def _throw() -> None:
    raise ZeroDivisionError("no")


def _spin() -> None:
    while True:
        pass


def _interrupt() -> None:
    raise KeyboardInterrupt


def _crash() -> None:
    ctypes.string_at(0)


throws = _acting(_throw)
hangs = _acting(_spin)
sleeps_in_c = _acting(lambda: ctypes.CDLL(None).sleep(1000))
dies = _acting(lambda: os._exit(7))
crashes = _acting(_crash)
exits = _acting(lambda: sys.exit(0))
interrupts = _acting(_interrupt)
slow = _acting(lambda: time.sleep(0.02))


def pseudo_inverse(task: hk.Task, _start: np.ndarray) -> hk.Strategy:
    """As the survey's own kind."""
    return hk.moore_penrose(task)


PLANAR: dict[str, Any] = {
    "title": "planar arms",
    "robots": ["planar-3r"],
    "starts": {"regular": 1, "random": 1},
    "loops": {
        "circle": {"kind": "circle", "size": (0.05, 0.3), "count": 3}, "eight": {"kind": "figure-eight", "size": 0.2},
    },
    "laws": {"pinv": {"kind": "moore-penrose"}, "lock": {"kind": "best-lock"}},
    "cycles": 2,
    "samples": 40,
}  # fmt: skip


def planar(**changes: Any) -> SurveyTable:
    return survey_of(PLANAR | changes, "planar.toml")


def rows_of(file: Path) -> list[dict[str, object]]:
    """All rows but for the seconds they took."""
    with Store.opened(file, None) as store:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in store.rows()]


CIRCLES = """
title = "circles"
robots = ["planar-3r"]
cycles = 1
samples = 20
[starts]
regular = 2
[loops.circle]
kind = "circle"
size = [0.05, 0.2]
count = 12
[laws.pinv]
kind = "moore-penrose"
"""
"""A survey file of 24 cases."""
