"""Does a law answer the same call alike, whatever went before? Old calls are asked again, in many pasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...base.types import Matrix, Vector
from ...motion.control import ControlLaw, Step
from ...path import Path
from .questions import ALIKE, Answer, AuditSetup, largest

PLACES = 5
"""Places along the way at which calls are asked again, in every past."""

IN_A_ROW = 8
"""How often one call is asked again at once: a law that alternates call by call does so within this many."""

RUNS = 5
"""Runs of the same way from the same start, so that a law that alternates between runs is seen to."""

AT_ONCE, MIDWAY, NEW_RUN, BEGUN_THERE, SAME_RUN = (
    "immediately after the earlier call", "midway in a run", "in a new run",
    "in a run that begins at the posture of the call",
    "in a repetition of the run",
)  # fmt: skip


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


def ask_history(setup: AuditSetup, path: Path) -> Answer:
    """Old calls asked again: at once, in the middle of a run, in new runs, in runs begun there; and whole runs again.

    Raises:
        ControllerError.
    """
    half = path.part(0.0, 0.5)
    first: list[_Call] = []
    tally = _Tally()
    ends = [setup.run_of(_recorded(setup.law, first), half).q[-1]]
    for _ in range(RUNS - 1):
        ends.append(setup.run_of(_compared(setup.law, first, tally), half).q[-1])
    setup.run_of(_questioned(setup.law, first, tally, setup.q0), half)
    apart = max(largest(end - ends[0]) for end in ends)
    asked, other = sum(tally.asked.values()), sum(tally.other.values())
    metrics = {
        "calls": float(asked), "otherwise": float(other), "rates_apart": tally.rate, "share": tally.share,
        "apart": apart, "could_move": tally.same_start * path.duration,
    }  # fmt: skip
    if not other:
        said = "all got the same answer as before"
        past = ", ".join(f"{count} {past}" for past, count in tally.asked.items())
        return f"no memory found: {asked} calls were repeated, and {said} ({past})", metrics
    where = ", ".join(f"{count} of {tally.asked[past]} {past}" for past, count in tally.other.items())
    size = f"by up to {tally.rate:.1e} (per s), {tally.share:.1%}; {RUNS} runs end {apart:.2g} apart"
    what = "remembers its past, or is random"
    if set(tally.other) == {BEGUN_THERE}:
        what = "remembers where its run began"
    elif tally.returned:
        what = "alternates between answers"
    return f"{what}: repeated calls get other answers ({where}), {size}", metrics


def _recorded(law: ControlLaw, calls: list[_Call]) -> ControlLaw:
    """The law, with its calls and answers written down."""

    def see(_inner: Step, call: _Call, _step: int) -> None:
        calls.append(call)

    return _watched(law, see)


def _compared(law: ControlLaw, first: list[_Call], tally: _Tally) -> ControlLaw:
    """The law in a new run of the same way: its answers compared for as long as it is asked the same."""

    def see(_inner: Step, call: _Call, step: int) -> None:
        if step < len(first) and first[step].alike(call.q, call.pose, call.twist, call.dt):
            tally.note(SAME_RUN, first[step], call.answer)

    return _watched(law, see)


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
