"""Nouns that bad calls are made with, and on: small ones, built once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import holokin as hk
from holokin.analysis import curvature
from holokin.motion import control
from holokin.strategies import constraints


class MineError(Exception):
    """What a callable of the user's raises."""


def raises(*_: Any) -> Any:
    """A callable of the user's that raises `MineError`."""
    raise MineError


@cache
def kit() -> dict[str, Any]:
    """Nouns to call with, and on."""
    robot, other = hk.load("planar-3r"), hk.load("ppr")
    q = np.array([0.3, 0.7, -0.5])
    task = hk.position(robot)
    start = robot.pose(q)[:3, 3]
    law, held = hk.moore_penrose(task), hk.holonomic(task, hk.lock(0))
    loop = hk.circle(start, start + [0.02, 0, 0])
    walk = hk.follow(held, loop, q, samples=8)
    space = hk.workspace(box=(start[:2], [0.2, 0.1]))
    rng = np.random.default_rng(0)
    return {
        "robot": robot, "other": other, "q": q, "task": task, "law": law, "held": held, "loop": loop, "walk": walk,
        "two": replace(robot, tips=(*robot.tips, hk.robot.Tip("elbow", 0, np.eye(4)))),
        "elbow": hk.position(robot, rows=[0]),
        "Q": q + 0.01 * rng.normal(size=(40, 3)), "pose": robot.pose(q), "start": start,
        "turn": hk.pose(robot), "region": hk.around(q, 0.1), "ball": curvature.ball(q, 0.05), "g": hk.lock(0),
        "cost": constraints.posture_cost(q), "weight": np.diag([1.0, 2.0, 3.0]), "ik": hk.ik(held, q),
        "servo": hk.controller(held, dt=0.01, q0=q), "closed": control.closed_loop(law),
        "leaf": curvature.leaf_function(held, q, samples=1), "line": hk.line(start, start + [0.02, 0, 0]),
        "timed": hk.retime(walk, acceleration=1.0, velocity=1.0, profile="trapezoidal", dt=0.01),
        "wiring": hk.export.Wiring(axes=(*robot.joint_names, 0.0, 0.0, 0.0)),
        "space": space, "covered": hk.coverage(held, space, q, samples=4),
        "sheets": hk.sheets(task, space, q0=[q], samples=8, share=0.5, search=False),
    }  # fmt: skip
