"""The panel of sheets: which one serves the dragged tool, and the switch by which an arm follows them."""

from __future__ import annotations

from typing import Any

from ..report.sheets_plot import color_of
from .panel_texts import block, line, plain, put, quiet, swatch, table, warning
from .sheet_follower import SheetFollower, SheetState
from .stage import Stage


class SheetsPanel:
    """Its controls; built inside a tab of a page whose session has sheets."""

    def __init__(self, page: Stage, follower: SheetFollower):
        self.page, self.follower = page, follower
        gui = page.server.gui
        gui.add_markdown("A **sheet** is a leaf with the tool poses that it serves. A few together serve a workspace.")
        self.find = gui.add_button(
            "Find the sheets", color="gray", hint="Read from the job's file, or searched for: that may take minutes"
        )
        self.on = gui.add_checkbox(
            "Follow sheets", False, hint="The solid arm takes their joints while you drag its tool"
        )
        self.told = gui.add_html("")
        self.find.on_click(lambda _event: page.ask(page.session.find_sheets))

        @self.on.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._switch, "sheets")

    def _switch(self) -> None:
        session = self.page.session
        self.page.say("")
        session.follow_sheets(session.laws[self.page.lead].name if self.on.value else None)

    def draw(self) -> None:
        """Bring switch and texts to what there is."""
        state = self.follower.state
        there = state.count > 0
        for handle, off in ((self.find, there), (self.on, not there)):
            if handle.disabled != off:
                handle.disabled = off
        if self.on.value != bool(state.law):
            self.on.value = bool(state.law)
        put(self.told, _told(state))


def _told(state: SheetState) -> str:
    """What is known, in the colours of the map's picture."""
    if not state.count:
        return block(line(state.searching)) if state.searching else ""
    rows = [
        (swatch(color_of(s), s == state.sheet), plain(f"sheet {s}{': serves the tool' if s == state.sheet else ''}"))
        for s in range(state.count)
    ]
    who = quiet(f"{state.law} follows the sheets." if state.law else "No arm follows the sheets.")
    said = line(state.sentence) if state.sheet >= 0 else warning(state.sentence)
    return block(table(rows), said, warning(state.why), who, quiet(f"{state.about}."))
