"""What a session does in the background: compiling, judging, looking round its loop, and the cloud of a workspace.

A thread reads what it needs under the session's lock, works without it, and tells under it again. What it raises is
told, too: no thread ends in silence.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from ...base.errors import HolokinError, brief
from ...base.types import Vector
from ...path.workspaces import Workspace
from ...strategies import HolonomicStrategy
from .clouds import covered, failed_cloud
from .law_judgement import judged, largest_curvature
from .leaf_cusps import leaf_cusps
from .loop_follower import compiled, loop_fault
from .runs import Run
from .session_loops import Loop
from .states import Cloud, LeafCusps

REST = 0.3
"""Seconds between two looks at the postures: no number on a page need change faster than one can read it."""

LONGEST = 200
"""Characters of a foreign error's own words."""


@dataclass(frozen=True, eq=False)
class Shared:
    """What the threads of a session share: its lock, and under the lock its laws, home and loop, and how to tell.

    changed: of a change. failed: of what failed, in a sentence. unseen: the loop, with its number, that nobody has
    looked round yet. looked_at: what was found on the loop of a number. limits: whether joint limits stop laws.
    """

    lock: threading.RLock
    runs: Callable[[], list[Run]]
    home: Callable[[], Vector]
    changed: Callable[[], object]
    failed: Callable[[str], None]
    unseen: Callable[[], tuple[int, Loop] | None]
    looked_at: Callable[[int, str], None]
    limits: bool

    def tell_failure(self, what: str, problem: Exception) -> None:
        """Something was not done, and why."""
        with self.lock:
            self.failed(failure(what, problem))
            self.changed()


def failure(what: str, problem: Exception) -> str:
    """The sentence of an error: that of holokin's own says what helps, another one is a fault of holokin."""
    if isinstance(problem, HolokinError):
        return f"{what}: {problem}"
    return f"{what}: holokin failed where it should not, {type(problem).__name__}: {brief(problem, LONGEST)}"


class Worker:
    """A thread of a session, until it is closed; a program that ends does not wait for it."""

    def __init__(self, name: str, work: Callable[[threading.Event], None], failed: Callable[[Exception], None]) -> None:
        def run() -> None:
            try:
                work(self._closed)
            except Exception as problem:  # noqa: BLE001  a thread has nobody who could catch it
                failed(problem)

        self._closed = threading.Event()
        self._thread = threading.Thread(target=run, name=name, daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True while it works."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """Have it end, and do not wait."""
        self._closed.set()

    def close(self, patience: float = 10.0) -> None:
        """Have it end, and wait for that."""
        self.cancel()
        if threading.current_thread() is not self._thread:
            self._thread.join(patience)


def look_after(shared: Shared) -> Worker:
    """Compile the laws of a session, judge them, and keep the curvature at their postures, until it is closed.

    Between these it looks round each new loop: which law does not get round it?
    """

    def work(closed: threading.Event) -> None:
        while not closed.is_set():
            with shared.lock:
                loop, home, runs = shared.unseen(), shared.home(), shared.runs()
                waiting = [run for run in runs if not run.ready or run.due]
                run = min(waiting, key=lambda run: (run.ready, run.judgement is not None), default=None)
                q = home if run is None else run.q
            if loop is not None:
                _look_round(shared, loop, runs, home)
            elif run is None:
                closed.wait(REST)
            else:
                again = run.judgement is not None
                _look_at(shared, run, q, home)
                if again:  # while laws move there is always one that is due: leave time for what draws them
                    closed.wait(REST / len(runs))

    return Worker("holokin-studio", work, lambda problem: shared.tell_failure("The background work ended", problem))


def _look_round(shared: Shared, unseen: tuple[int, Loop], runs: list[Run], home: Vector) -> None:
    """Tell of the first law that does not get round a loop."""
    number, loop = unseen
    try:
        found = next(filter(None, (loop_fault(run.law, loop, home, shared.limits) for run in runs)), "")
    except Exception as problem:  # noqa: BLE001  its thread goes on
        found = failure("The loop could not be tried", problem)
    with shared.lock:
        shared.looked_at(number, found)
        shared.changed()


def _look_at(shared: Shared, run: Run, q: Vector, home: Vector) -> None:
    """Compile a law, or judge it at a posture (n,)."""
    if not run.ready:
        try:
            compiled(run.law, home)
        except Exception as problem:  # noqa: BLE001  its thread goes on, with the other laws
            shared.tell_failure(f"{run.law.name} could not be compiled, and follows more slowly", problem)
    strategy, known = run.law.strategy, run.judgement
    if not run.ready or strategy is None:  # compile all laws first: the loop is smooth then
        found = known
    elif known is None:
        found = judged(strategy, home, q)
    else:
        found = replace(known, curvature=largest_curvature(strategy, q), q=q)
    with shared.lock:
        if found is not known:
            run.judgement, run.state = found, None
        run.ready = True
        shared.changed()


def cover(
    shared: Shared, law: str, strategy: HolonomicStrategy, q: Vector, region: Workspace, samples: int, limits: bool,
    keep: Callable[[Cloud], None],
) -> Worker:  # fmt: skip
    """Fill the cloud of a workspace by the leaf through a posture (n,); `keep` takes what is known, under the lock.

    Once the worker is cancelled nothing is kept any more.
    """

    def work(closed: threading.Event) -> None:
        def tell(cloud: Cloud) -> bool:
            with shared.lock:
                if not closed.is_set():
                    keep(cloud)
                    shared.changed()
                return not closed.is_set()

        covered(strategy, law, q, region, samples, limits, tell)

    def failed(problem: Exception) -> None:
        with shared.lock:
            keep(failed_cloud(law, failure("The coverage was not found", problem)))
            shared.changed()

    return Worker("holokin-studio-cloud", work, failed)


def look_for_cusps(
    shared: Shared, law: str, strategy: HolonomicStrategy, q: Vector, keep: Callable[[LeafCusps | None], None]
) -> Worker:
    """Look for cusps of the leaf through a posture (n,); `keep` takes them, under the lock, unless it is cancelled."""

    def work(closed: threading.Event) -> None:
        found = leaf_cusps(law, strategy, q)
        with shared.lock:
            if not closed.is_set():
                keep(found)
                shared.changed()

    def failed(problem: Exception) -> None:
        with shared.lock:
            keep(None)
        shared.tell_failure("The cusps were not found", problem)

    return Worker("holokin-studio-cusps", work, failed)
