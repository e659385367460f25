"""The column at the right of the page: what runs, the loop, the laws at the posture, and what goes out of the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.printed_units import PrintedUnits
from ..job import packaged_jobs
from .cameras import BOTTOM_SHEET
from .loop_panel import LoopPanel
from .panel_texts import block, gauge, line, named, plain, put, quiet, swatch, table, warning
from .posture_panel import PosturePanel
from .save_panel import SavePanel
from .sheets_panel import SheetsPanel
from .shown_units import FASTEST, SLOWEST, UNITS, USUAL, joint_unit, largest
from .stage import Stage
from .states import LawState, Phase, Snapshot
from .work_panel import WorkPanel

ENDLESS = 0
"""Cycles that mean: for ever."""

ELSEWHERE = 1e-6
"""Joint difference [rad, m] to the start posture at which a law does not stand there."""

ROUND = ("as drawn", "the other way")
"""The ways round a loop: not clockwise, clockwise."""

COLUMNS = (
    "law: the rule that moves the joints. drift: how far the worst joint is from its start after the last cycle. "
    "state: whether the tool is at the target"
)
"""What the columns of the table are."""

_DOING = {
    Phase.IDLE: "Drag the tool, or start the loop.",
    Phase.GATHERING: "The joints go to where the loop begins.",
    Phase.RUNNING: "Cycle {cycle}, {share:.0f} %",
    Phase.PAUSED: "Held in cycle {cycle}, {share:.0f} %",
    Phase.DONE: "Done: {done} cycles. Which robots are back at their start?",
}


class Panels:
    """The main panel of a page."""

    def __init__(self, page: Stage):
        self.page = page
        gui = page.server.gui
        gui.set_panel_label("holokin studio")
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
        gui.main_panel.dock_right()
        gui.main_panel.set_width(350)
        self.head = gui.add_html(f'{BOTTOM_SHEET}<div class="holokin-head">{self._head()}</div>')
        self.doing = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self._run(gui)
        with tabs.add_tab("Loop"):
            self.loop = LoopPanel(page)
        with tabs.add_tab("Posture"):
            self.posture = PosturePanel(page)
        self.sheets: SheetsPanel | None = None
        if page.session.sheets is not None:
            with tabs.add_tab("Sheets"):
                self.sheets = SheetsPanel(page, page.session.sheets)
        with tabs.add_tab("Work"):
            self.work = WorkPanel(page)
        with tabs.add_tab("Save"):
            self.save = SavePanel(page)

    def draw(self, snap: Snapshot) -> None:
        """Bring texts to a snapshot."""
        put(self.doing, self._doing(snap))
        put(self.table, self._table(snap))
        self.posture.draw(snap)
        if self.sheets is not None:
            self.sheets.draw()
        running = snap.phase in (Phase.RUNNING, Phase.GATHERING)
        self.start.label = "Pause" if running else "Go on" if snap.phase is Phase.PAUSED else "Start"

    def rescale(self, before: PrintedUnits) -> None:
        """All numbers in the units of the page, which were others before."""
        self.loop.rescale(before)
        self.posture.refit()

    def _head(self) -> str:
        session = self.page.session
        joints = f"{session.robot.name}: {session.task.n} joints for {session.task.m} coordinates of the tool"
        shared = "All browsers on this page see and move the same robots."
        return block(
            line(session.title, bold=True), line(joints), quiet(shared), *map(warning, self.page.scene.remarks)
        )

    def _run(self, gui: Any) -> None:
        page = self.page
        self.table = gui.add_html("")
        self.start = gui.add_button("Start", color="blue", hint="All laws run round the loop; press again to hold them")
        self.home = gui.add_button(
            "All back to the start posture", color="gray", hint="The loop stops, and its drift is forgotten"
        )
        self.speed = gui.add_slider(
            "Speed",
            min=SLOWEST,
            max=FASTEST,
            step=0.25,
            initial_value=USUAL,
            hint="How many times as fast as its own speed the loop runs; the drift is the same",
        )
        cycles = page.session.snapshot().cycles
        shown = ENDLESS if cycles is None else cycles
        self.cycles = gui.add_number(
            "Cycles", shown, min=0, max=10_000, step=1, hint="The loop ends after so many rounds; 0: never"
        )
        self.way = gui.add_dropdown("Way round", ROUND, hint="The sense in which the loop is run")
        names = tuple(law.name for law in page.session.laws)
        solid = "The law whose robot is drawn solid; the others are ghosts"
        self.solid = gui.add_dropdown("Solid robot", names, initial_value=names[page.lead], hint=solid)
        self.at_start = gui.add_checkbox(
            "Show the start posture, in grey", False, hint="A grey robot where all laws began"
        )
        page.session.set_speed(self.speed.value)

        self.start.on_click(lambda _event: page.ask(self._start_or_pause))
        self.home.on_click(lambda _event: page.ask(self._back))
        self.speed.on_update(lambda _event: page.ask(lambda: page.session.set_speed(self.speed.value), "speed"))
        self.cycles.on_update(
            lambda _event: page.ask(lambda: page.session.set_cycles(int(self.cycles.value) or None), "cycles")
        )
        self.way.on_update(
            lambda _event: page.ask(lambda: page.session.set_clockwise(self.way.value == ROUND[True]), "way")
        )

        @self.solid.on_update
        def _(_event: Any) -> None:
            names = [law.name for law in page.session.laws]
            page.ask(lambda: page.set_lead(names.index(self.solid.value)), "solid")

        self.at_start.on_update(
            lambda _event: page.ask(
                lambda: page.scene.show_start(page.session.home if self.at_start.value else None), "start"
            )
        )

        self.units = gui.add_dropdown(
            "Units",
            tuple(UNITS),
            initial_value=f"{page.units.angle}, {page.units.length}",
            hint="Of the numbers in the page, not of files",
        )
        self.units.on_update(lambda _event: page.ask(lambda: page.set_units(UNITS[self.units.value]), "units"))
        if page.reopen is not None:
            self._jobs(gui, page.reopen)

    def _jobs(self, gui: Any, reopen: Any) -> None:
        jobs = tuple(packaged_jobs())
        chosen = self.page.session.source if self.page.session.source in jobs else jobs[0]
        self.job = gui.add_dropdown("Packaged job", jobs, initial_value=chosen, hint="Examples that come with holokin")
        self.open = gui.add_button("Open this job", color="gray", hint="The page shows it instead, to all browsers")

        self.open.on_click(lambda _event: self.page.alone("open", lambda: reopen(self.job.value)))

    def _back(self) -> None:
        """All laws to the start posture; those that were moved to another leaf stand elsewhere on it, which is said."""
        page, home = self.page, self.page.session.home
        snapshot = page.session.reset()
        page.clear_traces()
        self.posture.take_away()
        away = [law.name for law in snapshot.laws if law.following and np.abs(law.q - home).max() > ELSEWHERE]
        page.say(f"On a leaf that was chosen by its level, not that of the start: {', '.join(away)}." if away else "")

    def _start_or_pause(self) -> None:
        self.page.say("")
        phase = self.page.session.snapshot().phase
        if phase in (Phase.RUNNING, Phase.GATHERING):
            self.page.session.pause()
        else:
            self.page.session.play()

    def _doing(self, snap: Snapshot) -> str:
        text = _DOING[snap.phase].format(cycle=snap.cycle + 1, share=100 * snap.progress, done=snap.cycle)
        faults = [f"{law.name}: {law.sentence}" for law in snap.laws if law.sentence]
        red = self.page.said or snap.message or (faults[0] if faults else snap.loop_fault)
        return block(line(text), gauge(snap.progress), warning(red), warning(snap.fault))

    def _last(self, law: LawState) -> float:
        """The drift of a law after its last cycle, in the units of the page."""
        return float(largest(self.page.units, self.page.session.robot, law.drift_joints[-1]))

    def _table(self, snap: Snapshot) -> str:
        rows = [
            (
                "",
                plain("law", grey=True),
                plain(f"drift [{joint_unit(self.page.units, self.page.session.robot)}]", grey=True, right=True),
                plain("state", grey=True, right=True),
            )
        ]
        for index, (law, color) in enumerate(zip(snap.laws, self.page.colors, strict=False)):
            drift = "" if not len(law.drift) else "stopped" if np.isnan(law.drift[-1]) else f"{self._last(law):.3g}"
            state = "follows" if law.following else law.status.value
            kind = "holonomic" if law.holonomic else "not holonomic"
            rows.append((
                swatch(color, index == self.page.lead), named(law.name, kind),
                plain(drift, right=True), plain(state, red=not law.following, right=True),
            ))  # fmt: skip
        return block(table(rows, [COLUMNS, *(law.sentence for law in snap.laws)]))
