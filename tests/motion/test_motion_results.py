"""Results: `str` says the verdict first, and `to_dict` is JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import IRB_START, PPR_CENTER, PPR_START
from holokin.base.errors import LimitReachedError
from holokin.export import ToolTolerance, to_rapid
from holokin.motion.ik import all_postures
from holokin.motion.trajectory import Recording
from holokin.strategies import jumps_of
from holokin.symbolic import if_else

START = np.array([0.3, 0.9, 0.7])
PPR = hk.moore_penrose(hk.position(hk.load("ppr")))
LOOP = hk.circle([1.6094, 0.4036], PPR_CENTER)
ARM = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([0.0, 1.0, -1.0]))
IRB = hk.load("irb140")


def walk(strategy: hk.Strategy = PPR) -> hk.Trajectory:
    return hk.follow(strategy, LOOP, PPR_START, samples=40)


def stopped() -> hk.Trajectory:
    tight = hk.with_limits(ARM.task.robot, lower=[-0.5, 0.2, 0.2], upper=[0.5, 1.0, 1.0])
    strategy = hk.holonomic(hk.position(tight), hk.linear([0.0, 1.0, -1.0]))
    point = tight.pose(START)[:3, 3]
    with pytest.raises(LimitReachedError) as caught:
        hk.follow(strategy, hk.line(point, 0.3 * point), START)
    return caught.value.trajectory


def jump() -> hk.strategies.Jump:
    g = hk.custom(lambda q: if_else(q[0] > 0, q[0] + 1.0, q[0]))
    strategy = hk.holonomic(hk.position(hk.load("ppr")), g)
    low, high = np.full(3, -0.5), np.full(3, 0.5)
    return jumps_of(strategy, np.random.default_rng(0).uniform(low, high, (16, 3)), low, high)[0]


def controller() -> hk.motion.Controller:
    c = hk.controller(ARM, dt=1e-3, q0=START)
    c.step(START, ARM.task.robot.pose(START), np.zeros(6))
    return c


def watch() -> hk.motion.LoopWatch:
    loop = hk.motion.LoopWatch(0.01, log=False)
    for _ in range(100):
        loop.see(START, np.ones(3))
    return loop


def program(tolerance: Any = 2e-3) -> hk.export.Program:
    point = IRB.pose(IRB_START)[:3, 3]
    strategy = hk.holonomic(hk.position(IRB), hk.lock(3, 4, 5))
    motion = hk.follow(strategy, hk.line(point, point + [0.05, 0, 0]), IRB_START, samples=40)
    return to_rapid(hk.retime(motion, velocity=1.0, acceleration=5.0, dt=0.008), tolerance=tolerance)


RESULTS: dict[str, tuple[Callable[[], Any], str]] = {
    "a trajectory": (walk, "followed to the end: 41 samples, 1 cycle in 25"),
    "one that stopped": (stopped, "stopped at a joint limit: "),
    "drift": (lambda: hk.drift(PPR, LOOP, PPR_START, samples=40), r"0\.1\d+$"),
    "spread": (lambda: hk.motion.path_spread(PPR, *LOOP.halves(), PPR_START, samples=40), r"-?0\.1\d+ rad apart at q3"),
    "a timed trajectory": (lambda: hk.retime(walk(), acceleration=5.0, velocity=2.0, dt=0.05), r"time-optimal, \d"),
    "a check": (lambda: hk.check(walk(), None), "nothing found\n"),
    "a check with findings": (lambda: hk.check(walk(), None, margin=1e3), "joint limit: "),
    "a recording": (
        lambda: Recording(("a",), np.arange(3.0), np.zeros((3, 1)), "a file"),
        "3 samples of a from a file",
    ),
    "a pose within reach": (lambda: hk.ik(ARM, START).nearest([1.2, 1.2]), "reached, rcond "),
    "a pose out of reach": (
        lambda: hk.ik(ARM, START).nearest([4.0, 1.2]),
        r"clamped: \S+ m and 0 rad are missing, held by ",
    ),
    "many poses": (lambda: hk.ik(ARM, START).batch([[1.2, 1.2], [9.0, 0.0]]), "1 of 2 poses reached; 1 "),
    "all postures": (
        lambda: all_postures(ARM, ARM.task.robot.pose(START), ARM.g(START)),
        r"\d postures? at this tool pose on this leaf",
    ),
    "a self-motion": (lambda: hk.strategies.self_motion_curve(ARM.task, START, limits=False), r"closed: \d"),
    "a jump": (jump, r"g jumps by 1 \(if_else\) at q = "),
    "a control step": (controller, "the last step: ok, at 100% of the wanted speed"),
    "a loop": (watch, "the joints make 0% of the motion"),
    "a program": (program, "joints within "),
    "a program near the tool's path": (lambda: program(ToolTolerance(hk.position(IRB))), "within what was asked for; "),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_says_its_verdict_first_and_its_facts_are_json(name: str) -> None:
    make, verdict = RESULTS[name]
    result = make()
    assert re.match(verdict, str(result)), str(result)
    facts = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert facts and all(isinstance(key, str) for key in facts)
