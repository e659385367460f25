"""`simulate`: runs a control law round a path, step by step, as the loop of a robot would, on ideal kinematics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, ControllerError, HolokinError, OpenPathError
from ..base.poses import pose_from
from ..base.progress import progress
from ..base.types import MOST, Array, ArrayLike, Matrix, Vector, positive, whole
from ..path.editing import AnyPath
from ..path.path import turn_between
from ..strategies.tasks.task import Task
from .control.control_law import ControlLaw, as_control_law
from .ik.plan import Plan, check_start, make_plan
from .trajectory import Status, Trajectory, record


@typed
def simulate(
    control_law: object,
    task: Task,
    path: AnyPath,
    q0: ArrayLike,
    *,
    dt: float = 0.01,
    cycles: int = 1,
    patience: float | None = None,
) -> Trajectory:
    """Run a control law along a path: q <- q + dt step(q, pose, twist, dt), one step after the other.

    The joints do exactly as they are told. The path goes on at its own speed, also where a law slows down, and joint
    limits stop nothing: a law must know them itself.

    Args:
        control_law: a `ControlLaw`, such as a compiled `controller`; a `Strategy`, which is run without feedback; or a
            function (q, pose, twist, dt) -> dq. `Step` says what these are.
        task: what the tool must do; the record's error and singular values are of it.
        path: of the tool.
        q0: start posture (n,), with the tool at the start of the path.
        dt: longest step [s]; steps are made even so that they end at the corners of the path.
        cycles: runs of a closed path.
        patience: seconds after which a call that has not returned is given up; None waits for ever.

    Returns:
        What the joints did.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad arguments.
        StartError: the tool at q0 is not at the start of the path. OpenPathError: several cycles of an open path.
        ControllerError: the law threw, blocked, or returned something that is not n finite numbers; `.trajectory`
            holds what was computed.
    """
    chosen = as_control_law(control_law)
    start = task.robot.checked(q0, "the start posture")
    positive("dt", dt, "give a positive step in seconds")
    if patience is not None:
        positive("patience", patience, "give positive seconds, or None")
    if whole("cycles", cycles) > 1 and not path.closed:
        raise OpenPathError(f"simulating {cycles} cycles", path.gap)
    tool = task._place(start)
    steps = np.ceil(path.duration / dt - 1e-9)
    if not steps * cycles <= MOST:
        raise ArgumentError("the number of steps", float(steps * cycles), f"give a larger dt, for at most {MOST:g}")
    plan = make_plan(task, path, int(steps), tool[1])
    check_start(task, start, *plan.first)
    return _Run(chosen, task, plan, start, cycles).go(patience)


@dataclass(eq=False)
class _Run:
    """One run: the postures so far, and the pulse by which a watcher sees whether the law still answers."""

    law: ControlLaw
    task: Task
    plan: Plan
    q0: Vector
    cycles: int

    def __post_init__(self) -> None:
        total = self.cycles * self.plan.steps
        self.q = np.empty((total + 1, self.task.n))
        self.dq = np.zeros((total + 1, self.task.n))
        self.q[0] = self.q0
        self.done = 0
        self.stopped = False
        self.fault: tuple[str, BaseException | None] | None = None
        self.pulse = time.monotonic()

    def go(self, patience: float | None) -> Trajectory:
        """Run to the end, or to the law's first fault. Raises: ControllerError."""
        total = len(self.q) - 1
        with progress(f"simulating {self.law.name}", total) as report:
            if patience is None:
                self._loop(report)
            else:
                self._watched(patience, report)
        status = Status.COMPLETE if self.fault is None else Status.FAULT
        k = self.done + 1
        self.dq[k - 1] = self.dq[max(k - 2, 0)]  # rates are of the steps; the last sample repeats the last one
        rates = self.dq[:k].copy()
        walk = record(self.task, self.plan, self.q[:k].copy(), lambda count: rates[:count], self.cycles, status)
        if self.fault is None:
            return walk
        fact, cause = self.fault
        raise ControllerError(self.law.name, f"{self.plan.where(self.done)}: {fact}", walk) from cause

    def _watched(self, patience: float, report: Callable[[int], None]) -> None:
        """The loop in a thread of its own, left behind if a call does not come back."""
        worker = threading.Thread(target=self._loop, args=(lambda _done: None,), daemon=True)
        worker.start()
        try:
            while worker.is_alive():
                worker.join(0.02)
                report(self.done)
                if worker.is_alive() and time.monotonic() - self.pulse > patience:
                    self.stopped = True
                    self.fault = (f"it did not return within {patience:g} s", None)
                    return
        except KeyboardInterrupt:
            self.stopped = True
            raise

    def _loop(self, report: Callable[[int], None]) -> None:
        """Step after step, until the law's answer is no n finite numbers, or somebody stops it."""
        plan, n = self.plan, self.task.n
        self.pulse = time.monotonic()
        q = self.q0.copy()
        try:
            step = control_step(self.law, plan, self.q0)
            for k in range(len(self.q) - 1):
                i = k % plan.steps
                self.pulse = time.monotonic()
                answer = step(q, i)
                if self.stopped:
                    return
                fault = _flaw(answer, n)
                if fault:
                    self.fault = (fault, None)
                    return
                self.dq[k] = np.asarray(answer, dtype=float)
                q = q + plan.h[i] * self.dq[k]
                self.q[k + 1] = q
                self.done = k + 1
                report(self.done)
        except HolokinError as problem:
            self.fault = (str(problem), problem)
        except Exception as problem:  # noqa: BLE001  a black box may throw anything
            self.fault = (f"it threw {type(problem).__name__}: {problem}", problem)


def _flaw(answer: object, n: int) -> str:
    """What is wrong with a law's answer; empty if nothing is."""
    try:
        dq = np.asarray(answer, dtype=float)
    except (TypeError, ValueError):
        return f"it returned {type(answer).__name__}, not {n} numbers"
    if dq.shape != (n,):
        return f"it returned shape {dq.shape}, expected ({n},)"
    if not np.isfinite(dq).all():
        return f"it returned NaN or infinite rates: {dq.tolist()}"
    return ""


def control_step(law: ControlLaw, plan: Plan, q0: Vector) -> Callable[[Vector, int], object]:
    """(q, step of the plan) -> what a control law answers there, in a run from q0 (n,). Raises: what the law raises."""
    poses, twists = step_targets(plan)
    step = law.begin(q0.copy())
    return lambda q, i: step(q.copy(), poses[i].copy(), twists[i].copy(), float(plan.h[i]))


def step_targets(plan: Plan) -> tuple[Array, Matrix]:
    """Wanted poses (k, 4, 4) at the ends of the steps, and the constant twists (k, 6) that lead there.

    Of F > 1 frames (k, F, 4, 4) and (k, F, 6).
    """
    frames = plan.task.frames
    p = np.vstack([plan.first[0][None], plan.position]).reshape(-1, frames, 3)
    R = np.concatenate([plan.first[1][None], plan.rotation]).reshape(-1, frames, 3, 3)
    poses, twists = steps_between(p, R, plan.h)
    return (poses[1:], twists) if frames > 1 else (poses[1:, 0], twists[:, 0])


def steps_between(p: Array, R: Array, h: Vector) -> tuple[Array, Array]:
    """Poses (k + 1, F, 4, 4) of positions (k + 1, F, 3) and rotations, and the constant twists (k, F, 6) between them.

    h (k,): how long each step takes [s].
    """
    turned = turn_between(R[:-1].reshape(-1, 3, 3), R[1:].reshape(-1, 3, 3)).reshape(-1, *p.shape[1:])
    return pose_from(p, R), np.concatenate([np.diff(p, axis=0), turned], axis=-1) / h[:, None, None]
