"""`Page`: a session and its scene, panels and handles on a server; one thread does all that changes them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ...base.types import Matrix
from ...base.units import SI, PrintedUnits
from ..report.plots import BAD, LOOP, law_colors, thin
from .page_scene import Scene
from .session import Session
from .side_panels import Panels
from .stage import Charts, Handles
from .states import Phase, Snapshot

RATE = 30.0  # pictures a second
SLOW = 0.2  # seconds between two updates of texts, plots and traces, which nobody reads faster
TRACED = 150  # points of the lines that elbows leave behind
MANY = 8  # strategies above which no traces are drawn

Action = Callable[[], Any]


class Page:
    """What all browsers see of a session. One state is shared: whoever drags, drags for all.

    Args:
        server: a viser.ViserServer.
        session: what is shown.
        reopen: called with the name of a job or robot that the page is asked to show instead.
        units: of what is shown.

    Raises:
        MissingExtraError: trimesh is not installed.
    """

    def __init__(
        self, server: Any, session: Session, reopen: Callable[[str], None] | None = None, units: PrintedUnits = SI
    ):
        self.server, self.session, self.reopen = server, session, reopen
        self.units = units
        self.lead = next((i for i, strategy in enumerate(session.strategies) if strategy.holonomic), 0)
        self.paused_drawing = False
        self.drawn = -1
        self._loop_drawn: tuple[int, str] | None = None
        self._slow_at, self._turn = 0.0, 0
        self._waiting: dict[object, Action] = {}
        self._busy: set[object] = set()
        self._wake = threading.Condition()
        self._over = False
        self.said = ""
        self.scene = Scene(server, session.robot, session.home)
        self.handles = Handles(self)
        self._arrange()
        self.scene.look_at_all(self._seen())
        snap = session.snapshot()
        self.draw(snap)
        for draw in self._slow:
            draw(snap)
        self._thread = threading.Thread(target=self._run, name="holokin studio", daemon=True)

    def _arrange(self) -> None:
        """A robot, a line in each plot and a place in each list for every strategy that there is."""
        strategies = self.session.strategies
        self.lead = min(self.lead, len(strategies) - 1)
        self.colors = law_colors([strategy.holonomic for strategy in strategies])
        self.scene.set_strategies([strategy.name for strategy in strategies], self.colors, self.lead)
        self.charts = Charts(self)
        self.panels = Panels(self)

    def start(self) -> None:
        """Begin to move."""
        self._thread.start()

    def ask(self, action: Action, key: object = None) -> None:
        """Have something done by the page's thread, soon; of several with one key only the last is done.

        What it raises is said in the page.
        """
        with self._wake:
            self._waiting.pop(key, None)
            self._waiting[key if key is not None else object()] = action
            self._wake.notify()

    def say(self, sentence: str) -> None:
        """A sentence for everyone, until the next; an empty one takes it away."""
        self.said = sentence

    def set_units(self, units: PrintedUnits) -> None:
        """In what numbers are shown; what they mean stays the same."""
        before, self.units = self.units, units
        self.charts.forget()
        self.panels.rescale(before)

    def set_lead(self, index: int) -> None:
        """Whose robot is drawn solid."""
        self.lead = self.scene.lead = index
        self.drawn = -1

    def close(self) -> None:
        """End the thread; the server stays."""
        with self._wake:
            self._over = True
            self._wake.notify()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    @property
    def _slow(self) -> tuple[Callable[[Snapshot], None], ...]:
        """What draws texts, plots and traces: less often than robots."""
        return self.panels.draw, self.charts.draw, self._draw_traces

    def draw(self, snap: Snapshot) -> None:
        """Bring robots, handles and the loop to a snapshot."""
        if tuple(strategy.name for strategy in snap.strategies) != self.scene.names:  # a program added or removed one
            self.server.gui.reset()
            self._arrange()
            self.drawn, self._loop_drawn = -1, None
        if snap.number != self.drawn and not self.paused_drawing:
            self.drawn = snap.number
            self.scene.show(np.array([strategy.q for strategy in snap.strategies]))
            self.handles.draw(snap)
        if (snap.loop, snap.loop_fault) != self._loop_drawn:
            moved = self._loop_drawn is None or self._loop_drawn[0] != snap.loop
            self._loop_drawn = snap.loop, snap.loop_fault
            self._draw_loop(moved, bool(snap.loop_fault))

    def _picture(self, now: float) -> None:
        """All that moves; and what is drawn less often by turns, since all of it at once would hold the robots up."""
        snap = self.session.snapshot()
        self.draw(snap)
        if now - self._slow_at >= SLOW / len(self._slow):
            self._slow_at, self._turn = now, (self._turn + 1) % len(self._slow)
            self._slow[self._turn](snap)

    @contextmanager
    def own_drawing(self) -> Iterator[None]:
        """The page's thread leaves the robots alone, for a while in which somebody else moves them."""
        self.paused_drawing = True
        try:
            yield
        finally:
            self.paused_drawing, self.drawn = False, -1

    def _run(self) -> None:
        before = time.perf_counter()
        due = before + 1 / RATE
        while True:
            with self._wake:  # it may wake a moment early: a picture then would put the next one off
                while not self._waiting and not self._over and (left := due - time.perf_counter()) > 0:
                    self._wake.wait(left)
                if self._over:
                    return
                actions, self._waiting = list(self._waiting.values()), {}
            for action in actions:
                self.attempt(action)
            now = time.perf_counter()
            if now >= due:
                self.attempt(lambda dt=now - before: self.session.advance(min(dt, 0.2)))
                before, due = now, max(due + 1 / RATE, now)
            self.attempt(lambda now=now: self._picture(now))

    def attempt(self, action: Action) -> None:
        """Do it in the thread of the caller. What it raises is said in the page, which goes on whatever happens."""
        try:
            action()
        except HolokinError as problem:
            self.say(str(problem))
        except Exception as problem:  # noqa: BLE001  one fault must not end the page of everybody
            if not self._over:
                self.say(f"holokin failed where it should not: {type(problem).__name__}: {problem}")

    def alone(self, key: object, action: Action) -> None:
        """As `attempt`, and not while it is being done: threads of clicks are few, and all browsers share them."""
        with self._wake:
            if key in self._busy:
                return
            self._busy.add(key)
        try:
            self.attempt(action)
        finally:
            with self._wake:
                self._busy.discard(key)

    def _seen(self) -> Matrix:
        """Points (k, 3) [m] that shall be seen besides the robot: the loop, and the handles of the tools."""
        loop, size = self.session.loop, self.handles.size
        line: Matrix = np.zeros((0, 3)) if loop is None else loop.points(50).reshape(-1, 3)
        tools = self.session.snapshot().target
        grips = [pose[:3, 3] + sign * size * pose[:3, :3].T for pose in tools for sign in (-1, 1)]
        return np.vstack([line, *grips])

    def _draw_loop(self, moved: bool, red: bool) -> None:
        """The line of the loop, red where a strategy does not get round it; what elbows drew belongs to the loop before."""
        loop = self.session.loop
        curves = () if loop is None else loop.points(240)
        for index in range(self.session.task.frames):
            self.scene.path(curves[index] if len(curves) else [], f"loop{index or ''}", BAD if red else LOOP)
        if moved:
            self.handles.place_loop(loop)
            self.clear_traces()

    def clear_traces(self) -> None:
        """Take the lines away that elbows drew."""
        for strategy in range(len(self.scene.names)):
            self.scene.trace(strategy, np.zeros((0, 3)), "elbow")

    def _draw_traces(self, snap: Snapshot) -> None:
        if snap.phase not in (Phase.RUNNING, Phase.DONE) or len(snap.strategies) > MANY:
            return
        for index, strategy in enumerate(snap.strategies):
            if len(strategy.history) > 1:
                rows = thin(len(strategy.history), TRACED)
                self.scene.trace(index, self.scene.points_of(strategy.history[rows])[1], "elbow")
