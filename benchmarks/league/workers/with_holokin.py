"""holokin, in the environment of the league itself: control steps, and a pose in and joints out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from worker_loop import Arm, Setting, Step, serve

import holokin as hk


def stepped(make):
    """A run of `hk.controller`, as a control loop calls it."""

    def start(arm: Arm) -> Step:
        task = hk.pose(hk.from_urdf(Path(arm.urdf), tip=arm.frame))
        loop: list[hk.Controller] = []

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            if not loop:
                loop.append(hk.controller(make(task, arm), dt=h, q0=arm.start))
            return q + h * loop[0].step(q, pose, twist)

        return step

    return start


def solved(make):
    """A run of `hk.ik`: the joints are asked for at each pose, from the last answer."""

    def start(arm: Arm) -> Step:
        ik = hk.ik(make(hk.pose(hk.from_urdf(Path(arm.urdf), tip=arm.frame)), arm), arm.start, limits=False)
        return lambda q, pose, twist, h: ik.near(pose, q)

    return start


def tied(task: hk.Task, arm: Arm) -> hk.Strategy:
    """q1 - q3 stays constant."""
    return hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))


def locked(task: hk.Task, arm: Arm) -> hk.Strategy:
    """Joint 3 stays where it is."""
    return hk.holonomic(task, hk.lock(2))


def radial(task: hk.Task, arm: Arm) -> hk.Strategy:
    """The holonomic strategy near the pseudo-inverse."""
    return hk.radial(hk.moore_penrose(task), arm.start)


def resting(task: hk.Task, arm: Arm) -> hk.Strategy:
    """The posture of least distance from the start: what a posture task strives for."""
    return hk.holonomic(task, hk.stationary(hk.strategies.constraints.posture_cost(arm.start)))


def settings(arm: Arm) -> Iterator[Setting]:
    """As the README and docs/start.md use it, and other strategies."""
    yield Setting("q1 - q3, control step", stepped(tied), example=True, source="docs/start.md, a control loop")
    yield Setting("pseudo-inverse, control step", stepped(lambda task, arm: hk.moore_penrose(task)))
    yield Setting("joint 3 locked, control step", stepped(locked))
    yield Setting("radial, control step", stepped(radial))
    yield Setting("stationary posture, control step", stepped(resting))
    yield Setting("stationary posture, pose to joints", solved(resting))
    yield Setting("q1 - q3, pose to joints", solved(tied))
    yield Setting("radial, pose to joints", solved(radial))


if __name__ == "__main__":
    serve(settings, ("holokin", "numpy", "casadi"))
