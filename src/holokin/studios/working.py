"""What a session does in the background: compiling, judging, and the cloud of a workspace.

A thread reads what it needs under the session's lock, works without it, and tells under it again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from ..strategies import HolonomicStrategy
from ..types import Vector
from ..workspaces import Workspace
from .clouds import covered
from .judging import judged, largest_curvature
from .runs import Run
from .states import Cloud
from .walking import compiled

REST = 0.3
"""Seconds between two looks at the postures: no number on a page need change faster than one can read it."""


@dataclass(frozen=True, eq=False)
class Shared:
    """What the threads of a session share: its lock, its laws and home under the lock, and how to tell of a change."""

    lock: threading.RLock
    runs: Callable[[], list[Run]]
    home: Callable[[], Vector]
    changed: Callable[[], object]


class Worker:
    """A thread of a session, until it is closed; a program that ends does not wait for it."""

    def __init__(self, name: str, work: Callable[[threading.Event], None]) -> None:
        self._closed = threading.Event()
        self._thread = threading.Thread(target=work, args=(self._closed,), name=name, daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True while it works."""
        return self._thread.is_alive()

    def close(self, patience: float = 10.0) -> None:
        """Have it end, and wait for that."""
        self._closed.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(patience)


def look_after(shared: Shared) -> Worker:
    """Compile the laws of a session, judge them, and keep the curvature at their postures, until it is closed."""

    def work(closed: threading.Event) -> None:
        while not closed.is_set():
            with shared.lock:
                waiting = [run for run in shared.runs() if not run.ready or run.due]
                run = min(waiting, key=lambda run: (run.ready, run.judgement is not None), default=None)
                q, home = (None, None) if run is None else (run.q, shared.home())
            if run is None or q is None or home is None:
                closed.wait(REST)
                continue
            if not run.ready:
                compiled(run.law, home)
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

    return Worker("holokin-studio", work)


def cover(
    shared: Shared, law: str, strategy: HolonomicStrategy, q: Vector, region: Workspace, samples: int, limits: bool,
    keep: Callable[[Cloud], None],
) -> Worker:  # fmt: skip
    """Fill the cloud of a workspace by the leaf through a posture (n,); `keep` takes what is known, under the lock."""

    def work(closed: threading.Event) -> None:
        def tell(cloud: Cloud) -> bool:
            with shared.lock:
                going = not closed.is_set()
                keep(cloud if going or cloud.state != "running" else replace(cloud, state="cancelled"))
                shared.changed()
            return going

        covered(strategy, law, q, region, samples, limits, tell)

    return Worker("holokin-studio-cloud", work)
