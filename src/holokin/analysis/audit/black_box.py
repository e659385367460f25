"""Any control law put to the test: do closed tool paths give closed joint paths, and if not, by how much, and why?

The law is a black box: it is only run, through `simulate`, on loops, ways, speeds and starts, and judged by where the
joints end. Every question is asked on its own: one that the law cannot answer is reported and the rest goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ControllerError, HolokinError, OpenPathError, SingularityError, StartError
from ...base.own_number import own_number
from ...base.types import ArrayLike, NoTruthValue
from ...motion.control import as_control_law
from ...motion.ik.posture_search import spread
from ...motion.trajectory import Trajectory
from ...path import Path, circle, polyline
from ...robot import Robot
from ...strategies import Strategy
from ...strategies.tasks.task import Task, of_one_tool
from ...strategies.tasks.task_kinds import pose
from ..curvature.curvature_of_planes import pairs
from .equal_poses import Repeatability
from .past_calls import ask_history
from .planes import looked_at, plane_name
from .questions import (
    ALIKE,
    Answer,
    AuditSetup,
    PlaneDrift,
    ask_cycles,
    ask_plane,
    ask_small_loops,
    ask_speed,
    ask_start,
    ask_two_paths,
    by_reason,
    of_cycles,
    step_alone,
    tell_planes,
    widest,
    worst_plane,
)

TOLERANCE = 1e-3
"""Joint difference [joint units] that counts: well over the round-off and step error of a sound loop, and about what
shows on a robot, 1 mm at the end of 1 m."""


@dataclass(frozen=True)
class Finding(NoTruthValue, ask="`.fault`"):
    """One question's answer. `metrics` by name [joint units unless the name says else]; `fault` if the law failed."""

    question: str
    sentence: str
    metrics: dict[str, float]
    fault: str = ""


@dataclass(frozen=True)
class Audit(NoTruthValue, ask="`.verdict`"):
    """What `audit` found: the verdict, each question apart from the others, and the planes of the task."""

    law: str
    verdict: Repeatability
    findings: tuple[Finding, ...]
    tolerance: float
    planes: tuple[PlaneDrift, ...]

    @property
    def exit_code(self) -> int:
        """0: repeats in all that was tested; 1: it does not; 2: it could not be judged."""
        return {Repeatability.REPEATS: 0, Repeatability.UNKNOWN: 2}.get(self.verdict, 1)

    @property
    def untested(self) -> tuple[str, ...]:
        """The planes of two task rows in which no loop encloses area, or could be followed: nothing is said of them."""
        return tuple(p.name for p in self.planes if not p.tested)

    @property
    def sentence(self) -> str:
        """The verdict, with what it does not cover."""
        said = f"{self.law}: {self.verdict.value}"
        if self.untested and self.verdict is not Repeatability.UNKNOWN:
            said += f"; NOT tested: loops in {', '.join(self.untested)}"
        asked_again = self["history"].metrics
        if asked_again.get("could_move", 0.0) > 0.0:
            said += (
                f"; asked the same again it answered otherwise, by up to {asked_again['rates_apart']:.1e} (per s), "
                f"which over one loop may come to {asked_again['could_move']:.1e}"
            )
        small = self["small loops"].metrics
        if self.verdict is Repeatability.DRIFTS and small.get("drift") == 0.0:
            said += (
                "; small loops at the start do not drift: the loops wind round a place where the law is not defined, "
            )
            said += "or meet curvature elsewhere"
        return said

    def __getitem__(self, question: str) -> Finding:
        """A finding by its question. Raises: ArgumentError."""
        for finding in self.findings:
            if finding.question == question:
                return finding
        raise ArgumentError("the question", question, f"it asked: {', '.join(f.question for f in self.findings)}")

    def __str__(self) -> str:
        lines = [self.sentence]
        lines += [f"  {f.question}: {'; '.join(filter(None, (f.sentence, f.fault)))}" for f in self.findings]
        return "\n".join(lines)

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        findings = [
            {"question": f.question, "sentence": f.sentence, "fault": f.fault} | f.metrics for f in self.findings
        ]
        verdict = self.verdict.name.lower()
        return {
            "law": self.law, "verdict": verdict, "untested": list(self.untested), "findings": findings,
        }  # fmt: skip


@typed
def audit(
    law: object,
    robot: Robot,
    task: Task | None = None,
    loops: Sequence[Path] | None = None,
    *,
    q0: ArrayLike,
    dt: float = 0.01,
    cycles: int = 6,
    tolerance: float = TOLERANCE,
    patience: float = 2.0,
    metrics: Mapping[str, Callable[[Trajectory], Any]] | None = None,
) -> Audit:
    """Put any control law to the test.

    A loop sees only the curvature of the planes in which it encloses area. By default the law is run round one more
    loop in every plane of two task rows, of 0.1 m or 0.2 rad a side; the worst of them, if it drifts, for all cycles.

    Args:
        law: a function (q, pose, twist, dt) -> dq, see `control_laws.Step`; a `ControlLaw`, such as
            a compiled `controller`; or a `Strategy`.
        task: what the tool must do; its full pose by default.
        loops: closed paths that begin at the tool pose of `q0`; a circle and a square of 0.1 m, and a loop in every
            plane, by default. Of your own loops the verdict names the planes in which none of them encloses area.
        q0: posture (n,). dt: the loop's step [s]. cycles: how often to go round.
        tolerance: joint difference that counts as one [joint units].
        patience: seconds after which a call that does not return is given up.
        metrics: name -> a function of your own of the trajectory of all cycles round the first loop, which gives a
            number, or None. Each is a finding "metric NAME", apart from the verdict.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad arguments, as a strategy of another robot; not a bad law.
        OpenPathError: a loop is not closed.
        StartError: a loop does not begin at the tool. SingularityError: the task has orientation rows alone, and their
            representation is singular at the start.
    """
    chosen = task if task is not None else pose(robot)
    of_one_tool(chosen, "an audit")
    _of_this_robot(law, robot)
    if chosen.robot != robot:
        raise ArgumentError("the task", chosen.name, f"it must be one of the robot audited, {robot.name!r}")
    q0 = robot.checked(q0, "the start posture")
    if cycles < 3 or not tolerance > 0 or not patience > 0:
        raise ArgumentError("the (cycles, tolerance, patience)", (cycles, tolerance, patience), "3 or more, positive")
    setup = AuditSetup(as_control_law(law), chosen, q0, dt, cycles, patience, tolerance)
    paths = list(loops) if loops is not None else _default_loops(setup)
    if not paths:
        raise ArgumentError("the loops", loops, "give at least one, or None for the usual ones")
    for path in paths:
        if not path.closed:
            raise OpenPathError("an audit", path.gap)
    of = [f", loop {i + 1}" if len(paths) > 1 else "" for i in range(len(paths))]
    findings = [
        _asked(f"cycles{word}", lambda path=path: ask_cycles(setup, path)) for word, path in zip(of, paths, strict=True)
    ]
    planes = _planes(setup, paths, given=loops is not None)
    findings += _of_planes(setup, paths[0], planes, findings)
    findings += [_asked("paths", lambda: ask_two_paths(setup, paths[0]))]
    findings += [_asked("speed", lambda: ask_speed(setup, paths[0]))]
    findings += [_asked("history", lambda: ask_history(setup, paths[0]))]
    findings += [_asked("start", lambda: ask_start(setup, paths[0]))]
    findings += [_asked("small loops", lambda: ask_small_loops(setup, widest(setup, planes)))]
    verdict = _verdict(setup, findings, planes)
    findings += [
        _asked(f"metric {name}", lambda name=name, f=f: _own_metric(setup, paths[0], name, f))
        for name, f in (metrics or {}).items()
    ]
    return Audit(setup.law.name, verdict, tuple(findings), tolerance, tuple(planes))


def _of_this_robot(law: object, robot: Robot) -> None:
    """Raises: ArgumentError: the law is a strategy, or a controller of one, for a robot with other kinematics."""
    strategy = getattr(law, "strategy", law)
    if not isinstance(strategy, Strategy) or strategy.task.robot == robot:
        return
    theirs, Q = strategy.task.robot, spread(robot, 3)
    alike = theirs.n == robot.n and robot.tips and robot.tips[0].name in (tip.name for tip in theirs.tips)
    if not alike or any(
        not np.allclose(a, b, rtol=0.0, atol=ALIKE)
        for a, b in zip(theirs.pose_batch(Q, robot.tips[0].name), robot.pose_batch(Q), strict=True)
    ):
        cure = f"it is of another robot, {theirs.name!r}, than the one audited, {robot.name!r}: give its own"
        raise ArgumentError("the law", strategy.name, cure)


def _default_loops(setup: AuditSetup) -> list[Path]:
    """A circle and a square of 0.1 m in planes that the task has; loops in other planes where it has no such ones."""
    point, rows = setup.tool[:3, 3], setup.task.rows
    inward = np.diag(np.where(point > 0, -0.1, 0.1))
    found: list[Path] = []
    if {0, 1} <= set(rows):
        found.append(circle(point, point + inward[0]))
    upright = next((k for k in ((0, 2), (1, 2), (0, 1)) if set(k) <= set(rows)), None)
    if upright is not None:
        a, b = (inward[k] for k in upright)
        found.append(polyline([point, point + a, point + a + b, point + b], closed=True))
    planes = pairs(setup.task.m) or [(0, 0)]
    return found or [setup.loop(plane) for plane in dict.fromkeys((planes[0], planes[-1]))]


def _asked(question: str, ask: Callable[[], Answer]) -> Finding:
    """The answer, or why there is none: a law's fault ends its question, not the audit."""
    try:
        sentence, metrics = ask()
    except ControllerError as problem:
        return Finding(question, "", {}, problem.fact)
    except HolokinError as problem:
        if isinstance(problem, ArgumentError | OpenPathError | StartError):
            raise
        return Finding(question, "", {}, str(problem))
    return Finding(question, sentence, metrics)


def _own_metric(setup: AuditSetup, path: Path, name: str, function: Callable[[Trajectory], Any]) -> Answer:
    """A number of the user's own. Raises: OwnFunctionError, ControllerError."""
    number = own_number(f"the metric {name!r}", function, setup.first_walk(path))
    return ("it gives no number", {}) if number is None else (f"{number:.6g}", {"value": number})


def _planes(setup: AuditSetup, paths: list[Path], given: bool) -> list[PlaneDrift]:
    """All planes of two task rows: the drift of a loop in each; of loops that are given, whether one encloses area."""
    every = pairs(setup.task.m)
    if not given:
        return [ask_plane(setup, plane) for plane in every]
    names = {plane: plane_name(setup.task, *plane) for plane in every}
    try:
        areas = looked_at(setup.task, paths, setup.tool[:3, :3]) if every else {}
    except SingularityError as problem:
        return [PlaneDrift(plane, names[plane], untested=str(problem), failed=True) for plane in every]
    why = "no loop of yours encloses area there"
    return [
        PlaneDrift(plane, names[plane], size=areas[plane] ** 0.5) if plane in areas
        else PlaneDrift(plane, names[plane], untested=why) for plane in every
    ]  # fmt: skip


def _of_planes(setup: AuditSetup, first: Path, planes: list[PlaneDrift], before: list[Finding]) -> list[Finding]:
    """The finding on all planes; and on the worst of them for all cycles, unless the law is known to drift anyway."""
    sentence, metrics = tell_planes(setup, planes)
    fault = "; ".join(by_reason([p for p in planes if p.failed]))
    found = [Finding("planes", sentence, metrics, fault)]
    worst = worst_plane(planes)
    known = Repeatability.DRIFTS in _seen(before, setup)
    if worst is None or known or worst.as_run <= setup.tolerance or _by_step(setup, worst):
        return found
    loop = setup.loop(worst.plane, worst.size)
    slower = min(1.0, loop.duration / first.duration)  # what converges needs time: as long a cycle as the others have
    loop = loop.at_speed(loop.speed * slower, loop.angular_speed * slower)
    return [*found, _asked(f"cycles in {worst.name}", lambda: ask_cycles(setup, loop))]


def _by_step(setup: AuditSetup, plane: PlaneDrift) -> bool:
    """Whether a plane's loop drifts by the error of the step alone."""
    return plane.as_run > setup.tolerance and step_alone(plane.as_run, plane.drift, setup.tolerance)


def _seen(findings: list[Finding], setup: AuditSetup) -> set[Repeatability]:
    """What the cycles of each loop say."""
    loops = [f.metrics for f in findings if f.question.startswith("cycles") and f.metrics]
    return {of_cycles(metrics, setup.tolerance, setup.cycles) for metrics in loops}


def _verdict(setup: AuditSetup, findings: list[Finding], planes: list[PlaneDrift]) -> Repeatability:
    seen = _seen(findings, setup)
    if not seen or (Repeatability.DRIFTS not in seen and any(f.fault for f in findings)):
        return Repeatability.UNKNOWN
    strayed = [p for p in planes if p.tested and p.as_run > setup.tolerance]
    if any(_by_step(setup, p) for p in strayed):
        seen.add(Repeatability.BUT_FOR_THE_STEP)
    if not all(_by_step(setup, p) for p in strayed) and Repeatability.DRIFTS not in seen:
        seen.add(Repeatability.CONVERGES)  # whatever the slower cycles in the worst plane say
    others = [f.metrics for f in findings if f.question in ("paths", "speed", "history")]
    sound = all(
        f and f["apart"] <= setup.tolerance + f.get("of_the_step", 0.0) and f.get("could_move", 0.0) <= setup.tolerance
        for f in others
    )
    if seen <= {Repeatability.REPEATS, Repeatability.BUT_FOR_THE_STEP} and not sound:
        return Repeatability.CONVERGES
    order = (Repeatability.DRIFTS, Repeatability.CONVERGES, Repeatability.BUT_FOR_THE_STEP, Repeatability.REPEATS)
    return next(word for word in order if word in seen)
