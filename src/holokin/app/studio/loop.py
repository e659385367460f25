"""The loop of a session as it runs: its clock, and the steps that all strategies make in a time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import HolokinError
from ...base.types import Array, Vector, frozen
from .followers import Loop, Move, Run, Walk, loop_start, poses_at, walk
from .states import Phase, StrategyStatus

GATHER = 0.8  # seconds in which the joints go to where a loop begins
RETRY = 8  # frames after which a strategy that stopped tries to take part again


@dataclass(eq=False)
class Playing:
    """Where a loop is. `ends`: the time at the end of each step of a cycle [s]."""

    phase: Phase = Phase.IDLE
    factor: float = 1.0
    cycles: int | None = None
    time: float = 0.0
    step: int = 0
    cycle: int = 0
    frames: int = 0
    gathered: float = 0.0
    ends: Vector = field(default_factory=lambda: np.zeros(1))

    @property
    def progress(self) -> float:
        """Share of the cycle that is done."""
        return 1.0 if self.phase is Phase.DONE else self.step / len(self.ends)

    def stop(self) -> None:
        """The loop runs no more."""
        self.phase = Phase.IDLE


def begin(playing: Playing, runs: Iterable[Run], loop: Loop, home: Vector, limits: bool) -> str:
    """Get the strategies ready for a loop; one that cannot begin says why. The first one's sentence if none can."""
    plans, first = [], ""
    for run in runs:
        run.forget()
        try:
            start: Vector = frozen(loop_start(run.strategy, loop, home))
            run.q0, run.walk = start, walk(run.strategy, loop, start, limits)
            plans.append(run.walk.plan)
        except HolokinError as problem:
            run.status, run.complete = StrategyStatus.STOPPED, False
            run.sentence = f"It cannot begin the loop: {problem}."
            first = first or run.sentence
    if not plans:
        return first
    playing.ends = np.cumsum(plans[0].h)
    playing.time, playing.step, playing.cycle, playing.gathered = 0.0, 0, 0, 0.0
    playing.phase = Phase.GATHERING
    return ""


def target_of(playing: Playing, runs: Iterable[Run]) -> Array | None:
    """Where the tools are wanted now (F, 4, 4); None where no strategy takes part."""
    plan = next((run.walk.plan for run in runs if run.walk is not None), None)
    if plan is None:
        return None
    return frozen(poses_at(plan, playing.step if playing.step or not playing.cycle else len(playing.ends)))


def gather(playing: Playing, runs: Iterable[Run], dt: float) -> None:
    """The joints go evenly to where each strategy begins the loop; then it runs."""
    before, playing.gathered = playing.gathered, min(GATHER, playing.gathered + dt)
    there = playing.gathered >= GATHER
    share = 1.0 if there else (playing.gathered - before) / (GATHER - before)
    for run in runs:
        if run.walk is not None and run.q0 is not None:
            run.put(Move(run.q0 if there else run.q + share * (run.q0 - run.q), StrategyStatus.FOLLOWING))
            if there:
                run.history.add(np.zeros(1), run.q0[None])
    if there:
        playing.phase = Phase.RUNNING


def go(playing: Playing, runs: Iterable[Run], dt: float, wait: bool) -> None:
    """All strategies go on by a time of the loop [s], in whole steps.

    wait: as of a `Follower`, of strategies that are not compiled.
    """
    # The step that is due by now, at most the last one.
    steps, length = len(playing.ends), float(playing.ends[-1])
    playing.time += dt
    playing.frames += 1
    lap, rest = divmod(playing.time, length)
    due = int(lap) * steps + int(np.searchsorted(playing.ends, rest + 1e-9 * length, side="right"))
    last = np.inf if playing.cycles is None else playing.cycles * steps
    if due >= last:
        due, playing.time = int(last), length * last / steps
    # All strategies up to it, cycle by cycle.
    done = playing.cycle * steps + playing.step
    while done < due:
        first = done % steps
        until = min(steps, first + due - done)
        for run in runs:
            if run.walk is not None:
                _steps(playing, run, run.walk, (first, until), wait)
        done += until - first
        playing.cycle, playing.step = divmod(done, steps)
    if done >= last:
        playing.phase = Phase.DONE


def _steps(playing: Playing, run: Run, walked: Walk, steps: tuple[int, int], wait: bool) -> None:
    """Steps of one strategy in one cycle, and its drift where the cycle ends."""
    first, until = steps
    run.curve, run.level_slider, run.state = None, None, None
    if run.status is StrategyStatus.FOLLOWING:
        rows, (run.status, run.sentence) = walked.run(run.q, first, until)
        if len(rows):
            run.q = frozen(rows[-1])
            run.history.add(playing.cycle * playing.ends[-1] + playing.ends[first : first + len(rows)], rows)
        run.complete &= run.status is StrategyStatus.FOLLOWING
    elif playing.frames % RETRY == 0:
        run.put(run.follow(run.q, poses_at(walked.plan, until), wait or run.ready))
    if until == len(playing.ends) and run.q0 is not None:
        error = run.q - run.q0 if run.complete else np.full(len(run.q), np.nan)
        run.drifts = frozen(np.vstack([run.drifts, error]))
