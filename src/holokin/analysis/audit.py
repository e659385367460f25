"""Any controller put to the test: does it come home, and if not, how far does it stray, and why?

The law is a black box: it is only run, through `drive`, on loops, ways, speeds, starts and small circles, and
judged by where the joints end. Every question is asked on its own: one that the law cannot answer is reported
and the rest goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..control import Controller, as_controller, drive
from ..errors import ArgumentError, ControllerError, HolokinError, OpenPathError, StartError
from ..path import Path, circle, polyline
from ..robot import Robot
from ..task import Task, pose
from ..trajectory import Trajectory
from ..types import ArrayLike, Vector
from .fibre import self_motion
from .judge import Homecoming

TOLERANCE = 1e-3
"""Joint difference [joint units] that counts: well over the round-off and step error of a sound loop, and about what
shows on a robot, 1 mm at the end of 1 m."""

NO_DRIFT = 1e-5
"""Drift [joint units] of a circle of 0.04 m in radius that is none: a curvature of 0.002 per square metre."""


@dataclass(frozen=True)
class Finding:
    """One question's answer. `figures` by name [joint units unless the name says else]; `fault` if the law failed."""

    question: str
    sentence: str
    figures: dict[str, float]
    fault: str = ""


@dataclass(frozen=True)
class Audit:
    """What `audit` found: the verdict, and each question apart from the others."""

    controller: str
    verdict: Homecoming
    findings: tuple[Finding, ...]
    tolerance: float

    @property
    def exit_code(self) -> int:
        """0: comes home; 1: it does not; 2: it could not be judged."""
        return {Homecoming.COMES_HOME: 0, Homecoming.UNKNOWN: 2}.get(self.verdict, 1)

    def __getitem__(self, question: str) -> Finding:
        """A finding by its question. Raises: ArgumentError."""
        for finding in self.findings:
            if finding.question == question:
                return finding
        raise ArgumentError("the question", question, f"it asked: {', '.join(f.question for f in self.findings)}")

    def __str__(self) -> str:
        lines = [f"{self.controller}: {self.verdict.value}"]
        lines += [f"  {f.question}: {f.fault or f.sentence}" for f in self.findings]
        return "\n".join(lines)

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        findings = [
            {"question": f.question, "sentence": f.sentence, "fault": f.fault} | f.figures for f in self.findings
        ]
        return {"controller": self.controller, "verdict": self.verdict.name.lower(), "findings": findings}


@dataclass(frozen=True, eq=False)
class _Bench:
    """What every question needs."""

    law: Controller
    task: Task
    start: Vector
    dt: float
    cycles: int
    patience: float
    tolerance: float

    def run(self, path: Path, start: Vector | None = None, *, cycles: int = 1, dt: float | None = None) -> Trajectory:
        """One run of the law. Raises: ControllerError."""
        begin = self.start if start is None else start
        return drive(self.law, self.task, path, begin, dt=dt or self.dt, cycles=cycles, patience=self.patience)


def audit(
    controller: object,
    robot: Robot,
    task: Task | None = None,
    loops: Sequence[Path] | None = None,
    *,
    start: ArrayLike,
    dt: float = 0.01,
    cycles: int = 6,
    tolerance: float = TOLERANCE,
    patience: float = 2.0,
) -> Audit:
    """Put any controller to the test.

    Args:
        controller: a function (q, pose, twist, dt) -> dq, see `control.Law`; a `Controller`; or a `Strategy`.
        task: what the tool must do; its full pose by default.
        loops: closed paths that begin at the tool pose of `start`; a circle and a square of 0.1 m by default.
        start: posture (n,). dt: the loop's step [s]. cycles: how often to go round.
        tolerance: joint difference that counts as one [joint units].
        patience: seconds after which a call that does not return is given up.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad arguments, not a bad law. OpenPathError: a loop is not closed.
        StartError: a loop does not begin at the tool.
    """
    chosen = task if task is not None else pose(robot)
    if chosen.robot is not robot:
        raise ArgumentError("the task", chosen.name, f"it must be one of the robot audited, {robot.name!r}")
    q0 = robot.checked(start, "the start posture")
    if cycles < 3 or not tolerance > 0 or not patience > 0:
        raise ArgumentError("the (cycles, tolerance, patience)", (cycles, tolerance, patience), "3 or more, positive")
    point = robot.pose(q0, chosen.tip)[:3, 3]
    paths = list(loops) if loops is not None else _default_loops(point, robot.planar)
    for path in paths:
        if not path.closed:
            raise OpenPathError("an audit", path.gap)
    bench = _Bench(as_controller(controller), chosen, q0, dt, cycles, patience, tolerance)
    findings = [_asked("cycles", lambda path=path: _cycles(bench, path), i, len(paths)) for i, path in enumerate(paths)]
    findings += [_asked("ways", lambda: _ways(bench, paths[0]))]
    findings += [_asked("speed", lambda: _speed(bench, paths[0]))]
    findings += [_asked("history", lambda: _history(bench, paths[0]))]
    findings += [_asked("start", lambda: _start(bench, paths[0]))]
    findings += [_asked("small loops", lambda: _small_loops(bench))]
    return Audit(bench.law.name, _verdict(findings, tolerance, cycles), tuple(findings), tolerance)


def _default_loops(point: Vector, planar: bool) -> list[Path]:
    side = 0.1 * np.array([[0, 0, 0], [-1, 0, 0], [-1, -1, 0], [0, -1, 0]]) if planar else 0.1 * np.array(
        [[0, 0, 0], [-1, 0, 0], [-1, 0, -1], [0, 0, -1]]
    )  # fmt: skip
    return [circle(point, point - [0.1, 0, 0]), polyline(point + side, closed=True)]


def _asked(question: str, ask: Callable[[], tuple[str, dict[str, float]]], number: int = 0, of: int = 1) -> Finding:
    """The answer, or why there is none: a law's fault ends its question, not the audit."""
    name = question if of == 1 else f"{question}, loop {number + 1}"
    try:
        sentence, figures = ask()
    except ControllerError as problem:
        return Finding(name, "", {}, problem.fact)
    except HolokinError as problem:
        if isinstance(problem, ArgumentError | OpenPathError | StartError):
            raise
        return Finding(name, "", {}, str(problem))
    return Finding(name, sentence, figures)


def _largest(difference: Vector) -> float:
    return float(np.abs(difference).max())


def _cycles(bench: _Bench, path: Path) -> tuple[str, dict[str, float]]:
    """Drift per cycle and after all, how it goes on, and the worst tracking."""
    walk = bench.run(path, cycles=bench.cycles)
    fine = bench.run(path, dt=bench.dt / 2)
    each = np.abs(walk.drift()).max(axis=1)
    total = _largest(walk.drift_since_start()[-1])
    finer = fine.drift()[0]
    law = _largest(2 * finer - walk.drift()[0])  # the step's share falls with the step: this is what is left of it
    figures = {
        "first": float(each[0]), "last": float(each[-1]), "after_all": total, "first_without_step": law,
        "tracking_m": walk.tracking_error(), "tracking_rad": walk.tracking_error("rad"),
    }  # fmt: skip
    track = f"tracks to {1e3 * figures['tracking_m']:.3g} mm"
    if walk.tracking_error("rad") > 0:
        track += f", {figures['tracking_rad']:.2g} rad"
    sentences = {
        Homecoming.COMES_HOME: f"home to {max(float(each.max()), total):.1e} after {bench.cycles} cycles",
        Homecoming.BUT_FOR_THE_STEP: f"drifts {each[0]:.2g} a cycle, by its step of {bench.dt:g} s alone",
        Homecoming.CONVERGES: f"strays {each[0]:.3g} in the first cycle, {each[-1]:.2g} in the last: settles",
        Homecoming.DRIFTS: f"drifts {each[0]:.3g} in the first cycle, {each[-1]:.3g} in cycle {bench.cycles}, "
        f"{total:.3g} in all",
    }
    return f"{sentences[_of_cycles(figures, bench.tolerance, bench.cycles)]}; {track}", figures


def _of_cycles(figures: dict[str, float], tolerance: float, cycles: int) -> Homecoming:
    """What the cycles of one loop say."""
    first, last = figures["first"], figures["last"]
    if max(first, figures["after_all"]) <= tolerance:
        return Homecoming.COMES_HOME
    if figures["first_without_step"] <= min(tolerance, 0.1 * first) and figures["after_all"] <= 1.5 * cycles * first:
        return Homecoming.BUT_FOR_THE_STEP
    if last <= 0.5 * first or (last <= tolerance < first):
        return Homecoming.CONVERGES
    return Homecoming.DRIFTS


def _ways(bench: _Bench, path: Path) -> tuple[str, dict[str, float]]:
    """Two ways to one tool pose, once from the start and once after it has settled."""
    a, b = path.ways()
    fresh = _largest(bench.run(a).q[-1] - bench.run(b).q[-1])
    finer = _largest(bench.run(a, dt=bench.dt / 2).q[-1] - bench.run(b, dt=bench.dt / 2).q[-1])
    figures = {"apart": fresh, "of_the_step": 2 * abs(fresh - finer)}
    same = fresh <= bench.tolerance + figures["of_the_step"]
    return f"{'the same' if same else 'not the same'} joints by two ways to one pose: {fresh:.2g} apart", figures


def _speed(bench: _Bench, path: Path) -> tuple[str, dict[str, float]]:
    """The same half loop at half and at twice the speed; the step is scaled along, so its error is not counted."""
    half = path.part(0.0, 0.5)
    ends = [bench.run(half.at_speed(path.speed * k, path.angular_speed * k)).q[-1] for k in (0.5, 1.0, 2.0)]
    scaled = bench.run(half.at_speed(path.speed * 2, path.angular_speed * 2), dt=bench.dt / 2).q[-1]
    apart = max(_largest(ends[0] - ends[1]), _largest(ends[2] - ends[1]))
    step = 2 * _largest(ends[2] - scaled)
    same = apart <= bench.tolerance + step
    figures = {"apart": apart, "of_the_step": step}
    return f"{'does not depend' if same else 'depends'} on speed: {apart:.2g} between half and twice", figures


def _history(bench: _Bench, path: Path) -> tuple[str, dict[str, float]]:
    """The same call after different pasts: in a new run, and in one that has gone round."""
    half = path.part(0.0, 0.5)
    seen = _Recorder(bench.law)
    drive(seen.controller, bench.task, half, bench.start, dt=bench.dt, patience=bench.patience)
    q, target, twist, dt, answer = seen.last
    again = np.asarray(bench.law.begin(q.copy())(q.copy(), target.copy(), twist.copy(), dt), dtype=float)
    rate = _largest(again - answer)
    size = max(_largest(answer), 1e-12)
    figures = {"rates_apart": rate, "share": rate / size}
    said = "has no memory" if rate <= 1e-6 * size else "remembers its past"
    return f"{said}: asked anew at one place it answers {rate:.1e} (per s) apart, {rate / size:.1%}", figures


class _Recorder:
    """A law's last call and answer."""

    def __init__(self, law: Controller) -> None:
        self.last: tuple[Vector, Any, Vector, float, Vector] = (np.zeros(0), np.eye(4), np.zeros(6), 0.0, np.zeros(0))

        def begin(q0: Vector):
            inner = law.begin(q0)

            def step(q: Vector, target, twist: Vector, dt: float) -> Vector:
                answer = inner(q.copy(), target.copy(), twist.copy(), dt)
                self.last = (q, target, twist, dt, np.asarray(answer, dtype=float))
                return answer

            return step

        self.controller = Controller(law.name, begin)


def _start(bench: _Bench, path: Path) -> tuple[str, dict[str, float]]:
    """From another posture with the same tool pose: does the difference stay, or does the law forget it?"""
    if bench.task.n - bench.task.m != 1:
        return "not asked: only the self-motions of one redundant joint are curves", {}
    curve = self_motion(bench.task, bench.start, step=0.02, length=0.1)
    other = curve.q[int(np.argmax(np.abs(curve.s)))]
    before = _largest(other - bench.start)
    ends = [bench.run(path, q, cycles=bench.cycles).q[-1] for q in (bench.start, other)]
    after = _largest(ends[1] - ends[0])
    figures = {"before": before, "after": after}
    said = "forgets" if after < 0.5 * before else "keeps"
    return f"{said} its start: {before:.2g} apart at first, {after:.2g} after {bench.cycles} cycles", figures


def _small_loops(bench: _Bench) -> tuple[str, dict[str, float]]:
    """A local strategy dq = G(q) x' drifts by area times curvature: as the radius squared, and back if reversed."""
    point = bench.task.robot.pose(bench.start, bench.task.tip)[:3, 3]
    drifts, shares = [], []
    for radius, clockwise, seconds in ((0.04, False, 4.0), (0.02, False, 4.0), (0.02, True, 4.0), (0.02, False, 8.0)):
        loop = circle(point, point - [radius, 0, 0], clockwise=clockwise).at_speed(2 * np.pi * radius / seconds)
        d, finer = (bench.run(loop, dt=dt).drift()[0] for dt in (bench.dt, bench.dt / 2))
        drifts.append(2 * finer - d)  # the step's share falls with the step
        shares.append(_largest(finer - d))
    big, small, back, slow = drifts
    size = max(_largest(small), 1e-15)
    figures = {
        "ratio": _largest(big) / size, "turned": _largest(small + back) / size,
        "hurried": _largest(small - slow) / size, "drift_per_m2": size / (np.pi * 0.02**2),
    }  # fmt: skip
    if _largest(big) <= max(NO_DRIFT, 0.1 * shares[0]):
        return f"none drifts: {_largest(big):.1e} for a radius of 0.04 m", figures
    facts = (
        f"ratio {figures['ratio']:.2f} for twice the radius, changed by {figures['turned']:.0%} backwards and by "
        f"{figures['hurried']:.0%} at half the speed"
    )
    if 2.8 < figures["ratio"] < 5.6 and figures["turned"] < 0.5 and figures["hurried"] < 0.05:
        return f"obey the area law ({facts}): a local strategy, {figures['drift_per_m2']:.3g} per square metre", figures
    return f"obey no area law ({facts}): not of the form dq = G(q) x'", figures


def _verdict(findings: list[Finding], tolerance: float, cycles: int) -> Homecoming:
    loops = [f for f in findings if f.question.startswith("cycles")]
    if not any(f.figures for f in loops):
        return Homecoming.UNKNOWN
    seen = {_of_cycles(f.figures, tolerance, cycles) for f in loops if f.figures}
    if Homecoming.DRIFTS not in seen and any(f.fault for f in findings):
        return Homecoming.UNKNOWN
    others = [f.figures for f in findings if f.question in ("ways", "speed")]
    sound = all(f and f["apart"] <= tolerance + f["of_the_step"] for f in others)
    if seen <= {Homecoming.COMES_HOME, Homecoming.BUT_FOR_THE_STEP} and not sound:
        return Homecoming.CONVERGES
    order = (Homecoming.DRIFTS, Homecoming.CONVERGES, Homecoming.BUT_FOR_THE_STEP, Homecoming.COMES_HOME)
    return next(word for word in order if word in seen)
