"""One law round the loop of a session: the steps of `hk.follow`, as many at a time as a frame of the page asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import HolokinError, JointLimitError
from ...base.poses import pose_from
from ...base.types import Array, Matrix, Vector
from ...motion import approach
from ...motion.control import ControlLaw
from ...motion.follow_path import build_native
from ...motion.ik import inverse, move_to_leaf
from ...motion.ik.leaf import LeafPath, leaf_follower, leaf_value, native_leaf
from ...motion.ik.native_follower import NativeFollower
from ...motion.ik.plan import Plan, check_start, make_plan
from ...motion.integrate_velocity import native_velocity, velocity_stepper
from ...motion.simulation import step_targets
from ...path import Path
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy, moore_penrose
from .drag_follower import limit_sentence, stopped
from .session_laws import Law
from .session_loops import Loop
from .states import LawStatus

PIECES = 200
"""Pieces of one step in Python. A step takes one or two; where a leaf ends, native code has tried them all before."""

LOOK = 60
"""Steps of a cycle with which it is tried whether a law gets round a loop: 30 ms in Python."""

Stepper = Callable[[Vector, int], Vector]
"""(posture, step of the plan) -> the posture after it."""


@dataclass(frozen=True, eq=False)
class Walk:
    """A law on its way round a loop: its plan, where it begins (n,), and what makes its steps."""

    law: Law
    plan: Plan
    q0: Vector
    limits: bool
    native: NativeFollower | None
    stepper: Stepper

    def run(self, q: Vector, first: int, last: int) -> tuple[Matrix, tuple[LawStatus, str]]:
        """Steps [first, last) of a cycle from a posture: the postures (k, n) after each, fewer where it stops; why."""
        rows = np.empty((last - first, len(q)))
        done = self.native.run(q, first, last, rows) if self.native is not None else 0
        at = rows[done - 1] if done else q
        robot = self.law.task.robot
        try:
            for i in range(first + done, last):
                at = self.stepper(at, i)
                if self.limits:
                    robot.check_limits(at)
                rows[done] = at
                done += 1
        except JointLimitError:
            return rows[:done], (LawStatus.LIMIT, limit_sentence(self.law.task, at))
        except HolokinError as problem:
            if self.law.strategy is None:
                return rows[:done], (LawStatus.STOPPED, str(problem))
            return rows[:done], stopped(self.law.task, self.law.name, rows[done - 1] if done else q)
        return rows, (LawStatus.FOLLOWING, "")


def leaf_start(law: Law, home: Vector) -> Vector:
    """The posture (n,) with the tool of `home`, on the leaf that a law asks for; `home` where it asks for none.

    Raises:
        SingularityError, BranchError: the self-motion does not lead there.
    """
    if law.level is None or not isinstance(law.rule, HolonomicStrategy):
        return home
    return move_to_leaf(law.rule, home, law.level, limits=False)


def loop_start(law: Law, loop: Loop, home: Vector) -> Vector:
    """The posture (n,) at which a law begins a loop: that of its leaf, led to the loop's start as a job's entry does.

    Raises:
        HolokinError: the law does not lead there.
    """
    begin = leaf_start(law, home)
    if not isinstance(loop.path, Path) or loop.keys.get("entry") is None:
        return begin
    leading = law.strategy or moore_penrose(law.task)
    return approach(leading, loop.path, begin, by=loop.keys["entry"]).q[-1]


def walk(law: Law, loop: Loop, q0: Vector, limits: bool, *, build: bool = False) -> Walk:
    """A law that begins a loop at a posture (n,) with the tool at its start.

    Args:
        build: compile native steps if there are none yet, which takes a second; else they are made in Python.

    Raises:
        HolokinError: the tool is elsewhere, the law is not defined there, or the posture is beyond the limits.
    """
    task = law.task
    start_posture(task.robot, q0, limits)
    if law.strategy is not None:
        law.strategy(q0)
    plan = make_plan(task, loop.path, loop.samples, task.place(q0)[1])
    check_start(task, q0, *plan.first)
    native: NativeFollower | None = None
    if isinstance(law.rule, HolonomicStrategy):
        native = native_leaf(law.rule, plan, q0, limits, load=True, build=build)
        stepper = _leaf_stepper(law.rule, plan, q0)
    elif isinstance(law.rule, Strategy):
        native = native_velocity(law.rule, plan, q0, limits, load=True, build=build)
        stepper = velocity_stepper(law.rule, plan)
    else:
        stepper = _control_stepper(law.rule, plan, q0)
    return Walk(law, plan, q0, limits, native, stepper)


def _leaf_stepper(strategy: HolonomicStrategy, plan: Plan, q0: Vector) -> Stepper:
    """The steps of `follow`; but no step has more than PIECES, so that a loop is never held up for long."""
    follow, c = leaf_follower(strategy, q0, PIECES), leaf_value(strategy, q0)
    return lambda q, i: follow(q, LeafPath(lambda share: (*plan.target(i, share), c), *plan.bends(i)))


def _control_stepper(rule: ControlLaw, plan: Plan, q0: Vector) -> Stepper:
    """The steps of `simulate`."""
    poses, twists = step_targets(plan)
    step = rule.begin(q0.copy())

    def stepper(q: Vector, i: int) -> Vector:
        rates = np.asarray(step(q.copy(), poses[i].copy(), twists[i].copy(), float(plan.h[i])), dtype=float)
        return q + plan.h[i] * rates

    return stepper


def poses_at(plan: Plan, step: int) -> Array:
    """Where the tools are wanted after some steps of a cycle (F, 4, 4)."""
    p, R = plan.first if step == 0 else plan.target(step - 1, 1.0)
    return pose_from(p.reshape(-1, 3), R.reshape(-1, 3, 3))


def compiled(law: Law, q0: Vector) -> None:
    """Build, or load, the native code with which a law follows drags and loops; without a compiler nothing happens."""
    try:
        if isinstance(law.rule, HolonomicStrategy):
            _ = inverse(law.rule, q0, limits=False).engine
        if law.strategy is not None:
            build_native(law.strategy)
    except HolokinError:  # told when the law is asked to follow
        return


def loop_fault(law: Law, loop: Loop, home: Vector, limits: bool) -> str:
    """Why a law does not get round a loop that begins at a posture (n,), and where; empty where it does.

    A few coarse steps; of control laws, which have memory, nothing is known.
    """
    if law.strategy is None:
        return ""
    try:
        begin = loop_start(law, loop, home)
        walked = walk(law, replace(loop, samples=LOOK), begin, limits)
    except HolokinError as problem:
        return f"{law.name} cannot begin this loop: {problem}."
    steps = len(walked.plan.h)
    rows, (status, sentence) = walked.run(begin, 0, steps)
    if status is LawStatus.FOLLOWING:
        return ""
    return f"{law.name} gets round {100 * len(rows) / steps:.0f} % of this loop only. {sentence}"
