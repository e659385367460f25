"""The panel of the loop: its shape, centre, radius and plane, corners by clicks, and two paths to one pose."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ...base.printed_units import SI, PrintedUnits
from ..report.palette import CLOCKWISE, COUNTER_CLOCKWISE
from .handles import FAR, LEAST, circle_of
from .session_loops import circle_loop, eight_loop
from .shown_units import joint_unit, largest
from .stage import Stage
from .two_paths import LawPaths

SHOWN = 3.0
"""Seconds in which two paths are shown."""

SAME = 1e-6
"""Joint difference [rad or m] below which two postures are one: round-off is far below it."""


_CENTER = "Of the circle, or where the eight crosses itself: x, y, z in the frame of the robot's base"
_RADIUS = "Of the circle; an eight is twice as wide"
_NORMAL = "A direction at right angles to the loop; 0, 0, 1 is a level loop"


class LoopPanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Stage):
        self.page = page
        gui, loop = page.server.gui, page.session.loop
        center, normal, radius = circle_of(loop) or (self._tool(), np.array([0.0, 0.0, 1.0]), 0.1)
        gui.add_markdown("A closed path of the tool. Laws that are not holonomic usually drift on it.")
        self.dragged = gui.add_checkbox(
            "Drag centre, plane and radius in the scene", False, hint="Handles on the circle"
        )
        self.shape = gui.add_dropdown("Shape", ("circle", "figure eight"), hint="Of the loop that is taken below")
        self.center = gui.add_vector3(
            "Centre [m]",
            tuple(float(v) for v in np.round(center, 4)),
            min=(-FAR,) * 3,
            max=(FAR,) * 3,
            step=0.01,
            hint=_CENTER,
        )
        self.radius = gui.add_number("Radius [m]", float(radius), min=LEAST, max=10.0, step=0.005, hint=_RADIUS)
        self.normal = gui.add_vector3(
            "Normal of the plane", tuple(float(v) for v in np.round(normal, 4)), step=0.05, hint=_NORMAL
        )
        self.here = gui.add_button("Begin at the tool", color="gray", hint="The loop then starts where the tool is now")
        self.make = gui.add_button("Take this loop", hint="All laws follow it from now on")
        gui.add_divider()
        gui.add_markdown("**By clicks**: corners on the level of the tool. Look from above.")
        self.clicks = gui.add_button("Begin to click", color="gray", hint="Each click in the scene is a corner")
        self.close = gui.add_button(
            "Close the polygon", color="gray", disabled=True, hint="The loop through the corners"
        )
        gui.add_divider()
        gui.add_markdown(
            "**Two paths to one pose**: drag the tool somewhere, then see a law go there from the start by two paths."
        )
        names = tuple(law.name for law in page.session.laws)
        self.law = gui.add_dropdown("Law", names, hint="Whose joints are compared at the end of both paths")
        self.two_paths = gui.add_button(
            "Go two paths to the tool's place", color="gray", hint="From the start, by a corner to each side"
        )
        self.answer = gui.add_markdown("")
        self.rescale(SI)
        self._connect()

    def _connect(self) -> None:
        page = self.page

        self.dragged.on_update(lambda _event: page.ask(lambda: page.handles.show_loop_handles(self.dragged.value)))

        @self.here.on_click
        def _(_event: Any) -> None:
            tool = self._tool() * self.page.units.factor("m")
            self.center.value = tuple(float(v) for v in tool - [self.radius.value, 0.0, 0.0])

        self.make.on_click(lambda _event: page.ask(self._make))

        @self.clicks.on_click
        def _(_event: Any) -> None:
            self.close.disabled = False
            page.ask(page.handles.start_corners)

        @self.close.on_click
        def _(_event: Any) -> None:
            self.close.disabled = True
            page.ask(page.handles.close_corners)

        self.two_paths.on_click(lambda _event: page.alone("two paths", self._two_paths))

    def rescale(self, before: PrintedUnits) -> None:
        """Centre and radius in the units of the page, from those before."""
        units, ratio = self.page.units, self.page.units.factor("m") / before.factor("m")
        if ratio == 1:
            return
        with self.page.server.atomic():
            for handle, name in ((self.center, "Centre"), (self.radius, "Radius")):
                handle.label = f"{name} [{units.length}]"
                handle.step, handle.precision = handle.step * ratio, 1 if units.length == "mm" else 4
                value, low, high = (_times(ratio, one) for one in (handle.value, handle.min, handle.max))
                handle.min, handle.max, handle.value = low, high, value

    def _tool(self) -> Any:
        return self.page.session.snapshot().target[0][:3, 3]

    def _make(self) -> None:
        metre, normal = self.page.units.factor("m"), np.array(self.normal.value)
        center, size = np.array(self.center.value) / metre, float(self.radius.value) / metre
        if self.shape.value == "circle":
            loop = circle_loop(center, size, normal, near=self._tool())
        else:
            loop = eight_loop(center, 2 * size, None, normal)
        self.page.say("")
        self.page.session.set_loop(loop)

    def _two_paths(self) -> None:
        """Runs in the thread of the click: the page's own thread goes on, and leaves the robots alone."""
        page, wanted = self.page, self.page.session.snapshot().target
        if np.allclose(wanted, page.session.reset().target):
            page.say("The tool is at its start: drag it somewhere, and two paths lead there from the start.")
            return
        try:
            found = page.session.two_paths(wanted)
        except HolokinError as problem:
            page.session.drag(wanted)
            page.say(str(problem))
            return
        path = next(path for path in found.by_law if path.name == self.law.value)
        for index, color in enumerate((CLOCKWISE, COUNTER_CLOCKWISE)):
            page.scene.path(found.points[index], f"path{index}", color)
        if path.sentence:
            self.answer.content = path.sentence
        else:
            same = "the same joints" if path.spread < SAME else "other joints"
            units, robot = page.units, page.session.robot
            apart = f"{float(largest(units, robot, path.a[-1] - path.b[-1])):.3g} {joint_unit(units, robot)}"
            self.answer.content = f"Both paths end at one pose, with **{same}**: {apart} apart."
        with page.own_drawing():
            self._show(path, [law.name for law in page.session.laws].index(path.name))
        for index in range(2):
            page.scene.path([], f"path{index}")
        page.session.drag(wanted)

    def _show(self, path: LawPaths, law: int) -> None:
        """One path by the solid robot, the other by a ghost, in the law's colour where there is another law."""
        page, steps = self.page, min(len(path.a), len(path.b))
        count, lead = len(page.session.laws), page.lead
        ghost = law if law != lead else (lead + 1) % count
        for row in np.linspace(0, steps - 1, int(SHOWN * 25)).astype(int) if steps else ():
            Q = np.tile(path.a[row], (count, 1))
            Q[ghost] = path.b[row]
            page.scene.show(Q)
            time.sleep(SHOWN / 75)
        time.sleep(SHOWN / 2)


def _times(ratio: float, value: Any) -> Any:
    """A number, or each of several, times a ratio; to twelve digits, so that there and back is what it was."""
    if isinstance(value, tuple | list | np.ndarray):
        return tuple(_times(ratio, one) for one in value)
    return float(f"{ratio * float(value):.12g}")
