"""Any control law put to the test: do closed tool paths give closed joint paths, and if not, by how much, and why?

The law is a black box: it is only run, through `simulate`, on loops, ways, speeds and starts, and judged by where the
joints end. Every question is asked on its own: one that the law cannot answer is reported and the rest goes on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ControllerError, HolokinError, OpenPathError, SingularityError, StartError
from ...base.types import ArrayLike, Matrix, NoTruthValue, Vector, own_number, positive
from ...motion.control import ControlLaw, Step, as_control_law
from ...motion.self_motions.posture_search import spread
from ...motion.trajectory import Trajectory
from ...path import Path, circle, polyline
from ...robot import Robot
from ...strategies import Strategy
from ...strategies.tasks.task import Task, of_one_tool
from ..coverage.starts import first_start
from ..curvature.curvature_of_planes import pairs
from .questions import (
    ALIKE,
    Answer,
    AuditSetup,
    PlaneDrift,
    Repeatability,
    ask_cycles,
    ask_plane,
    ask_small_loops,
    ask_speed,
    ask_start,
    ask_two_paths,
    by_reason,
    largest,
    looked_at,
    of_cycles,
    plane_name,
    step_alone,
    tell_planes,
    widest,
    worst_plane,
)

# --- Does a law answer the same call alike, whatever went before? Old calls are asked again, in many pasts.

PLACES = 5  # places along the way at which calls are asked again, in every past
IN_A_ROW = 8  # how often one call is asked again at once: a law that alternates call by call does so within this many
RUNS = 5  # runs of the same way from the same start, so that a law that alternates between runs is seen to

AT_ONCE, MIDWAY, NEW_RUN, BEGUN_THERE, SAME_RUN = (
    "immediately after the earlier call",
    "midway in a run",
    "in a new run",
    "in a run that begins at the posture of the call",
    "in a repetition of the run",
)


@dataclass(frozen=True, eq=False)
class _Call:
    """One call of a law and its answer."""

    q: Vector
    pose: Matrix
    twist: Vector
    dt: float
    answer: Vector

    def again(self, law: Step) -> Vector:
        """The law's answer now."""
        return np.asarray(law(self.q.copy(), self.pose.copy(), self.twist.copy(), self.dt), dtype=float)

    def alike(self, q: Vector, pose: Matrix, twist: Vector, dt: float) -> bool:
        """Whether another call is the same one."""
        same = np.array_equal(self.q, q) and np.array_equal(self.pose, pose) and np.array_equal(self.twist, twist)
        return same and self.dt == dt


@dataclass(eq=False)
class _Tally:
    """Answers compared, those that differed, and by how much at most, for each past.

    same_start: by how much, of runs that began at one posture. `returned`: to one call, in one kind of past, another
    answer was followed by the first one again.
    """

    asked: dict[str, int] = field(default_factory=dict)
    other: dict[str, int] = field(default_factory=dict)
    rate: float = 0.0
    share: float = 0.0
    same_start: float = 0.0
    returned: bool = False
    strayed: set[tuple[str, int]] = field(default_factory=set)

    def note(self, past: str, call: _Call, answer: Vector) -> None:
        """Compare an answer with the one the call got first."""
        off = largest(answer - call.answer) if answer.shape == call.answer.shape else float("inf")
        size = max(largest(call.answer), 1e-12)
        self.asked[past] = self.asked.get(past, 0) + 1
        if not off <= ALIKE * size:
            self.other[past] = self.other.get(past, 0) + 1
            self.rate, self.share = max(self.rate, off), max(self.share, off / size)
            if past != BEGUN_THERE:  # a law may hold the leaf that its run begins on
                self.same_start = max(self.same_start, off)
            self.strayed.add((past, id(call)))
        elif past != MIDWAY and (past, id(call)) in self.strayed:
            self.returned = True


def _ask_history(setup: AuditSetup, path: Path) -> Answer:
    """Old calls asked again: at once, in the middle of a run, in new runs, in runs begun there; and whole runs again.
    Raises: ControllerError."""
    half = path.part(0.0, 0.5)
    first: list[_Call] = []
    tally = _Tally()

    def record(_inner: Step, call: _Call, _step: int) -> None:
        first.append(call)

    def compare(_inner: Step, call: _Call, step: int) -> None:
        """Answers are compared for as long as the law is asked the same."""
        if step < len(first) and first[step].alike(call.q, call.pose, call.twist, call.dt):
            tally.note(SAME_RUN, first[step], call.answer)

    # One run whose calls are written down, others that are compared with it, and one in which old calls are repeated.
    ends = [setup.run(half, law=_watched(setup.law, record)).q[-1]]
    ends += [setup.run(half, law=_watched(setup.law, compare)).q[-1] for _ in range(RUNS - 1)]
    setup.run(half, law=_questioned(setup.law, first, tally, setup.q0))
    # What differed, and by how much.
    apart = max(largest(end - ends[0]) for end in ends)
    asked, other = sum(tally.asked.values()), sum(tally.other.values())
    metrics = {"calls": float(asked), "otherwise": float(other), "rates_apart": tally.rate, "share": tally.share}
    metrics |= {"apart": apart, "could_move": tally.same_start * path.duration}
    if not other:
        past = ", ".join(f"{count} {past}" for past, count in tally.asked.items())
        return f"no memory found: {asked} calls were repeated, and all got the same answer as before ({past})", metrics
    where = ", ".join(f"{count} of {tally.asked[past]} {past}" for past, count in tally.other.items())
    size = f"by up to {tally.rate:.1e} (per s), {tally.share:.1%}; {RUNS} runs end {apart:.2g} apart"
    what = "remembers its past, or is random"
    if set(tally.other) == {BEGUN_THERE}:
        what = "remembers where its run began"
    elif tally.returned:
        what = "alternates between answers"
    return f"{what}: repeated calls get other answers ({where}), {size}", metrics


def _questioned(law: ControlLaw, first: list[_Call], tally: _Tally, q0: Vector) -> ControlLaw:
    """The law in a run that is interrupted at some places, to ask old calls again."""
    places = np.unique(np.linspace(0, len(first) - 1, PLACES).astype(int)).tolist()
    questions: dict[int, list[int]] = {}
    for step in places:
        for k, old in enumerate(places):  # one a step: all at once would look like a call that does not return
            questions.setdefault(min(step + k, len(first) - 1), []).append(old)

    def see(inner: Step, call: _Call, step: int) -> None:
        if step in places:
            for _ in range(IN_A_ROW):
                tally.note(AT_ONCE, call, call.again(inner))
        for place in questions.get(step, ()):
            old = first[place]
            tally.note(MIDWAY, old, old.again(inner))
            tally.note(NEW_RUN, old, old.again(law.begin(q0.copy())))
            tally.note(BEGUN_THERE, old, old.again(law.begin(old.q.copy())))

    return _watched(law, see)


def _watched(law: ControlLaw, see: Callable[[Step, _Call, int], None]) -> ControlLaw:
    """The law, with somebody who sees each call of a run, and may ask more."""

    def begin(q0: Vector) -> Step:
        inner = law.begin(q0)
        step = -1

        def answered(q: Vector, pose: Matrix, twist: Vector, dt: float) -> Vector:
            nonlocal step
            step += 1
            answer = inner(q.copy(), pose.copy(), twist.copy(), dt)
            try:
                numbers = np.asarray(answer, dtype=float).copy()
            except (TypeError, ValueError):
                return answer  # `simulate` says what is wrong with it
            see(inner, _Call(q, pose, twist, dt, numbers), step)
            return answer

        return answered

    return ControlLaw(law.name, begin)


# Joint difference [joint units] that counts: well over the round-off and step error of a sound loop, and about what
# shows on a robot, 1 mm at the end of 1 m.
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Finding(NoTruthValue, ask="`.fault`"):
    """One question's answer. `metrics` by name [joint units unless the name says else]; `fault` if the law failed."""

    question: str
    sentence: str
    metrics: dict[str, float]
    fault: str = ""

    def __str__(self) -> str:
        return f"{self.question}: {'; '.join(filter(None, (self.sentence, self.fault)))}"


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
        sentence = f"{self.law}: {self.verdict.value}"
        if self.untested and self.verdict is not Repeatability.UNKNOWN:
            sentence += f"; NOT tested: loops in {', '.join(self.untested)}"
        asked_again = self["history"].metrics
        if asked_again.get("could_move", 0.0) > 0.0:
            sentence += (
                f"; asked the same again it answered otherwise, by up to {asked_again['rates_apart']:.1e} (per s), "
                f"which over one loop may come to {asked_again['could_move']:.1e}"
            )
        small = self["small loops"].metrics
        if self.verdict is Repeatability.DRIFTS and small.get("drift") == 0.0:
            sentence += "; small loops at the start do not drift: the loops wind round a place where the law is not "
            sentence += "defined, or meet curvature elsewhere"
        return sentence

    def __getitem__(self, question: str) -> Finding:
        """A finding by its question. Raises: ArgumentError."""
        for finding in self.findings:
            if finding.question == question:
                return finding
        raise ArgumentError("the question", question, f"it asked: {', '.join(f.question for f in self.findings)}")

    def __str__(self) -> str:
        return "\n".join([self.sentence, *(f"  {finding}" for finding in self.findings)])

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        findings = [
            {"question": f.question, "sentence": f.sentence, "fault": f.fault} | f.metrics for f in self.findings
        ]
        facts = {"law": self.law, "verdict": self.verdict.name.lower()}
        return facts | {"untested": list(self.untested), "findings": findings}


@typed
def audit(
    control_law: object,
    task: Task | None = None,
    path: Path | Sequence[Path] | None = None,
    q0: ArrayLike | None = None,
    *,
    dt: float = 0.01,
    cycles: int = 6,
    tolerance: float = TOLERANCE,
    patience: float = 2.0,
    metrics: Mapping[str, Callable[[Trajectory], Any]] | None = None,
    seconds: float = 300.0,
    progress: Callable[[str], None] = lambda _text: None,
) -> Audit:
    """Put any control law to the test.

    A loop sees only the curvature of the planes in which it encloses area. By default the law is run round one more
    loop in every plane of two task rows, of 0.1 m or 0.2 rad a side; the worst of them, if it drifts, for all cycles.

    Args:
        control_law: a function (q, pose, twist, dt) -> dq, see `motion.control.Step`; a `ControlLaw`, such as
            a compiled `controller`; or a `Strategy`.
        task: what the tool must do; of a strategy by default its own.
        path: a closed path that begins at the tool pose of `q0`, or several; by default a circle and a square of 0.1 m,
            and a loop in every plane. Of your own paths the verdict names the planes in which none encloses area.
        q0: posture (n,); by default one in the middle of the joint limits that is far from singular.
        dt: the loop's step [s]. cycles: how often to go round.
        tolerance: joint difference that counts as one [joint units].
        patience: seconds after which a call that does not return is given up.
        metrics: name -> a function of your own of the trajectory of all cycles round the first loop, which gives a
            number, or None. Each is a finding "metric NAME", apart from the verdict.
        seconds: that it may take; what is not asked by then is said.
        progress: hears how long a step of the law takes, and what is asked.

    Raises:
        ArgumentError, ShapeError, NotFiniteError: bad arguments, as a strategy of another robot; not a bad law, but one
            whose steps are so slow that the audit would take longer than it may.
        OpenPathError: a path is not closed.
        StartError: a path does not begin at the tool. SingularityError: the task has orientation rows alone, and their
            representation is singular at the start.
    """
    # The task, the start posture and the loops.
    strategy = getattr(control_law, "strategy", control_law)
    if task is None:
        if not isinstance(strategy, Strategy):
            raise ArgumentError("task", task, "say what the tool must do, as hk.pose(robot)")
        task = strategy.task
    of_one_tool(task, "an audit")
    if isinstance(strategy, Strategy):
        _check_robot(strategy, task.robot)
    q0 = first_start(task) if q0 is None else task.robot.checked(q0, "the start posture")
    if cycles < 3 or not tolerance > 0 or not patience > 0:
        raise ArgumentError("the (cycles, tolerance, patience)", (cycles, tolerance, patience), "3 or more, positive")
    setup = AuditSetup(as_control_law(control_law), task, q0, dt, cycles, patience, tolerance)
    paths = _default_loops(setup) if path is None else [path] if isinstance(path, Path) else list(path)
    if not paths:
        raise ArgumentError("path", path, "give at least one, or None for the usual loops")
    for loop in paths:
        if not loop.closed:
            raise OpenPathError("an audit", loop.gap)
    # How long it will take; a law may be too slow.
    positive("the seconds of an audit", seconds)
    positive("dt", dt)
    steps = (ROUNDS * paths[0].duration + (cycles + 2) * sum(loop.duration for loop in paths[1:])) / dt
    each = _seconds_of_a_step(setup)
    about = f"a step of the law takes {1e3 * each:.2g} ms, so that an audit of {steps:,.0f} steps takes"
    if each * steps > seconds:
        raise ArgumentError(
            f"the seconds of the audit of {setup.law.name!r}",
            seconds,
            f"{about} about {each * steps / 60:,.0f} min: {FASTER}",
        )
    progress(f"{about} about {each * steps:,.0f} s")
    late = f"not asked within the {seconds:g} s of the audit; {FASTER}"
    setup = replace(setup, until=time.monotonic() + seconds, late=late)

    def asked(question: str, ask: Callable[[], Answer]) -> Finding:
        progress(question)
        return _answered(question, ask)

    # Each question on its own: the cycles of each loop and of the worst plane, then what the cycles leave open.
    suffixes = [f", loop {i + 1}" if len(paths) > 1 else "" for i in range(len(paths))]
    findings = [
        asked(f"cycles{word}", lambda loop=loop: ask_cycles(setup, loop))
        for word, loop in zip(suffixes, paths, strict=True)
    ]
    progress("loops in every plane")
    planes = _planes(setup, paths, given=path is not None)
    findings += _of_planes(setup, paths[0], planes, findings)
    others = {"paths": ask_two_paths, "speed": ask_speed, "history": _ask_history, "start": ask_start}
    findings += [asked(name, lambda ask=ask: ask(setup, paths[0])) for name, ask in others.items()]
    findings += [asked("small loops", lambda: ask_small_loops(setup, widest(setup, planes)))]
    # The user's own metrics do not change the verdict.
    verdict = _verdict(setup, findings, planes)
    findings += [
        asked(f"metric {name}", lambda name=name, f=f: _own_metric(setup, paths[0], name, f))
        for name, f in (metrics or {}).items()
    ]
    return Audit(setup.law.name, verdict, tuple(findings), tolerance, tuple(planes))


def _check_robot(strategy: Strategy, robot: Robot) -> None:
    """Raises: ArgumentError: the strategy is for a robot with other kinematics."""
    if strategy.task.robot == robot:
        return
    theirs, Q = strategy.task.robot, spread(robot, 3)
    alike = theirs.n == robot.n and robot.tips and robot.tips[0].name in (tip.name for tip in theirs.tips)
    if not alike or any(
        not np.allclose(a, b, rtol=0.0, atol=ALIKE)
        for a, b in zip(theirs.pose_batch(Q, robot.tips[0].name), robot.pose_batch(Q), strict=True)
    ):
        cure = f"it is of another robot, {theirs.name!r}, than the one audited, {robot.name!r}: give its own"
        raise ArgumentError("the control law", strategy.name, cure)


def _default_loops(setup: AuditSetup) -> list[Path]:
    """A circle and a square of 0.1 m in planes that the task has; loops in other planes where it has no such ones."""
    point, rows = setup.tool[:3, 3], setup.task.rows
    inward = np.diag(np.where(point > 0, -0.1, 0.1))
    loops: list[Path] = []
    if {0, 1} <= set(rows):
        loops.append(circle(point, point + inward[0]))
    upright = next((k for k in ((0, 2), (1, 2), (0, 1)) if set(k) <= set(rows)), None)
    if upright is not None:
        a, b = (inward[k] for k in upright)
        loops.append(polyline([point, point + a, point + a + b, point + b], closed=True))
    planes = pairs(setup.task.m) or [(0, 0)]
    return loops or [setup.loop(plane) for plane in dict.fromkeys((planes[0], planes[-1]))]


ROUNDS = 50
"""Rounds of its first loop that an audit takes, as long as those of all other runs together: 30 to 59 were met."""

FASTER = (
    "build tasks, strategies and CasADi functions once, before the first step, and not in each; or give a longer dt, "
    "fewer cycles, a shorter path, or more seconds"
)

TRIAL = 10
"""Steps of the short runs by which the law is timed."""


def _seconds_of_a_step(setup: AuditSetup) -> float:
    """Of a step of the law, in the second of two short runs: the first may build something. 0 if it does not run."""
    point, taken = setup.tool[:3, 3], 0.0
    way = polyline([point, point + [0.0, 0.0, 0.1 * TRIAL * setup.dt]])
    for _ in range(2):
        began = time.perf_counter()
        try:
            setup.run(way)
        except HolokinError:  # each question says it
            return 0.0
        taken = (time.perf_counter() - began) / TRIAL
    return taken


def _answered(question: str, ask: Callable[[], Answer]) -> Finding:
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
    number = own_number(f"the metric {name!r}", function, setup.run(path, cycles=setup.cycles))
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
        PlaneDrift(plane, names[plane], size=areas[plane] ** 0.5)
        if plane in areas
        else PlaneDrift(plane, names[plane], untested=why)
        for plane in every
    ]


def _of_planes(setup: AuditSetup, first: Path, planes: list[PlaneDrift], before: list[Finding]) -> list[Finding]:
    """The finding on all planes; and on the worst of them for all cycles, unless the law is known to drift anyway."""
    sentence, metrics = tell_planes(setup, planes)
    fault = "; ".join(by_reason([p for p in planes if p.failed]))
    findings = [Finding("planes", sentence, metrics, fault)]
    worst = worst_plane(planes)
    known = Repeatability.DRIFTS in _seen(before, setup)
    if worst is None or known or worst.as_run <= setup.tolerance or _by_step(setup, worst):
        return findings
    loop = setup.loop(worst.plane, worst.size)
    slower = min(1.0, loop.duration / first.duration)  # what converges needs time: as long a cycle as the others have
    loop = loop.at_speed(loop.speed * slower, loop.angular_speed * slower)
    return [*findings, _answered(f"cycles in {worst.name}", lambda: ask_cycles(setup, loop))]


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
