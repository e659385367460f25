"""The column at the right of the page: what runs, the loop, the laws at the posture, and what goes out of the page."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...analysis.coverage.starts import task_of_kind
from ...analysis.design import advise
from ...analysis.sheets.still_motion import SAME
from ...base.errors import ArgumentError, HolokinError, JobError
from ...base.units import SI, PrintedUnits
from ...export import LANGUAGES
from ...proof import Certificate
from ..job import Job, certify_job, open_one_job, packaged_jobs, program_of_job
from ..report.plots import CLOCKWISE, COUNTER_CLOCKWISE
from ..report.sheets_plots import sheet_color
from .followers import circle_loop, eight_loop
from .laws import LawPaths
from .posture_panel import PosturePanel
from .session import Session, to_job
from .stage import (
    FAR,
    LEAST,
    Stage,
    block,
    circle_of,
    file_name,
    gauge,
    line,
    named,
    plain,
    put,
    quiet,
    swatch,
    table,
    warning,
)
from .states import FASTEST, SLOWEST, UNITS, USUAL, LawState, Phase, Snapshot, joint_unit, largest
from .work import SheetFollower, SheetState

SHOWN = 3.0
"""Seconds in which two paths are shown."""

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
                value, low, high = (_scaled(ratio, number) for number in (handle.value, handle.min, handle.max))
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
            compared = page.session.two_paths(wanted)
        except HolokinError as problem:
            page.session.drag(wanted)
            page.say(str(problem))
            return
        path = next(path for path in compared.by_law if path.name == self.law.value)
        for index, color in enumerate((CLOCKWISE, COUNTER_CLOCKWISE)):
            page.scene.path(compared.points[index], f"path{index}", color)
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


def _scaled(ratio: float, value: Any) -> Any:
    """A number, or each of several, times a ratio; to twelve digits, so that there and back is what it was."""
    if isinstance(value, tuple | list | np.ndarray):
        return tuple(_scaled(ratio, number) for number in value)
    return float(f"{ratio * float(value):.12g}")


ACCELERATION = 2.0
"""Of a program's joints [rad/s^2, m/s^2], until somebody gives another one."""

WRITTEN = tuple(name for name, language in LANGUAGES.items() if not language.needs)
"""Languages that a job of the studio can be written in: the others need facts of a controller, which a file gives."""


CURE = "Save the job, add what is missing to its file, and use `holokin export` or `holokin certify` on the file."
"""What helps where a job needs more than a session tells."""


class WorkPanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Stage):
        self.page = page
        gui, laws = page.server.gui, page.session.laws
        in_job = tuple(law.name for law in laws if law.keys is not None and page.session.origin is not None)
        off = not in_job
        self.law = gui.add_dropdown("Law", in_job or ("none",), hint="Of the program and of the certificate")
        gui.add_markdown(
            "A **robot program** of the loop with its cycles, timed within the speed limits of the joints."
        )
        self.language = gui.add_dropdown("Language", WRITTEN, hint="Of the robot's controller, as of `holokin export`")
        self.acceleration = gui.add_number(
            "Acceleration", ACCELERATION, min=0.01, max=100.0, step=0.1, hint="Largest of any joint [rad/s^2, m/s^2]"
        )
        self.program = gui.add_button(
            "Write the program", color="blue", disabled=off, hint="A ZIP with the program and all samples"
        )
        gui.add_markdown("A **certificate** proves that the joints on the loop are one function of the tool pose.")
        self.certify = gui.add_button(
            "Certify the law", color="gray", disabled=off, hint="On the loop; it takes seconds to a minute"
        )
        gui.add_markdown("**Advice**: the laws that fit this robot near its start, compared.")
        self.advise = gui.add_button("Ask for advice", color="gray", hint="It takes about a minute, and slows the page")
        self.answer = gui.add_html("")
        for button, work in (
            (self.program, self._program),
            (self.certify, self._certificate),
            (self.advise, self._advice),
        ):
            button.on_click(lambda event, work=work: self._work(event.client, work))

    def _work(self, client: Any, work: Any) -> None:
        """One piece of work at a time, in the thread of the click; its file goes to the browser that asked."""

        def whole() -> None:
            self.page.say("")
            self._tell("It is being worked on.")
            try:
                file = work()
            except JobError as problem:  # of a file that is there no more
                self._tell("")
                self.page.say(f"{problem.key}: {problem.fact}; {problem.cure}. {CURE}")
                return
            except BaseException:
                self._tell("")
                raise
            if file is not None and client is not None:
                client.send_file_download(*file, save_immediately=True)

        self.page.alone("work", whole)

    def _tell(self, *sentences: str) -> None:
        put(self.answer, block(*map(line, sentences)) if any(sentences) else "")

    def _program(self) -> tuple[str, bytes]:
        language, changes = self.language.value, {"acceleration": float(self.acceleration.value)}
        with _saved_job(self.page.session) as (name, job, file):
            program, timed, _ = program_of_job(name, job, file, language, self._label(), changes=changes)
            program.save(file.parent / "program")
            timed.save(file.parent / "program" / "joints.csv")
            packed = io.BytesIO()
            with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as box:
                for part in sorted((file.parent / "program").iterdir()):
                    box.write(part, part.name)
        sentence = f"{program.targets} targets, {timed.duration:.3g} s, {timed.profile}."
        self._tell(sentence, *program.notes)
        return f"{name}-{language}.zip", packed.getvalue()

    def _certificate(self) -> tuple[str, bytes] | None:
        label = self._label()
        with _saved_job(self.page.session) as (name, job, file):
            chosen = job.model_copy(update={"strategies": {label: job.strategies[label]}})
            certificate = next(
                answer for title, answer in certify_job(chosen, file) if title in (label, self.law.value)
            )
            if not isinstance(certificate, Certificate):
                self._tell(f"{self.law.value} is not certified: {certificate}")
                return None
            self._tell(certificate.theorem)
            return f"{name}-certificate.json", certificate.save(file.parent / "certificate.json").read_bytes()

    def _advice(self) -> None:
        session = self.page.session
        if session.task.frames > 1:
            raise ArgumentError("advice", session.task.name, "it is given for robots with one tool")
        task = task_of_kind(session.robot, None, "position" if session.task.orientation is None else "pose")
        advice = advise(task, q0=session.home, progress=self._tell)
        self._tell(f"The best is {advice.best.name}.", *advice.reasons)

    def _label(self) -> str:
        """The name in a job of the law that is chosen."""
        law = next(law for law in self.page.session.laws if law.name == self.law.value)
        return law.label or law.name


@contextmanager
def _saved_job(session: Session) -> Iterator[tuple[str, Job, FilePath]]:
    """(name, job, file) of a session as a job, in a folder that is there meanwhile. Raises: as `to_job`."""
    with TemporaryDirectory() as folder:
        name = file_name(session.title)
        file = FilePath(folder, f"{name}.toml")
        file.write_text(to_job(session), "utf-8")
        yield open_one_job(str(file))


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
        (swatch(sheet_color(s), s == state.sheet), plain(f"sheet {s}{': serves the tool' if s == state.sheet else ''}"))
        for s in range(state.count)
    ]
    who = quiet(f"{state.law} follows the sheets." if state.law else "No arm follows the sheets.")
    sentence = line(state.sentence) if state.sheet >= 0 else warning(state.sentence)
    return block(table(rows), sentence, warning(state.why), who, quiet(f"{state.about}."))


# --- What goes out of the page: a job file, a picture, a GIF, a recording. All of it is downloaded by the browser.

PICTURES, PAUSE = 60, 0.1
"""Pictures of a GIF at most, and the time between two [s]."""

WIDE = 720
"""Width of a GIF [pixels]."""

TALL = 3.0
"""Height of a GIF over its width, at most: a telephone's page has 2.2."""

PATIENCE = 30.0
"""Seconds to wait for a picture of a browser."""


class SavePanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Stage):
        self.page = page
        gui = page.server.gui
        self.name = gui.add_text("Name", file_name(page.session.title), hint="Of the files, and the title of the job")
        gui.add_markdown("A **job** runs to the same numbers: `holokin run NAME.toml`.")
        self.job = gui.add_button("Save as job", hint="A TOML file with robot, task, start, loop and laws")
        self.picture = gui.add_button("Screenshot", color="gray", hint="A PNG of the scene as this browser sees it")
        gui.add_markdown("A **GIF** shows a cycle from now on, as this browser sees it.")
        self.film = gui.add_button("Make a GIF", color="gray", hint="At most 60 pictures, ten a second")
        gui.add_markdown("A **recording** is a page of its own: one HTML file, without a server.")
        self.recording = gui.add_button(
            "Record to HTML", color="gray", hint="Of the loop that has run; press Start first"
        )
        self._connect()

    def _connect(self) -> None:
        page = self.page
        for button, make in (
            (self.job, self._job),
            (self.picture, self._picture),
            (self.film, self._film),
            (self.recording, self._recording),
        ):

            @button.on_click
            def _(event: Any, make: Any = make) -> None:
                if event.client is not None:
                    page.alone(("save", event.client_id), lambda: self._download(event.client, make))

    def _download(self, client: Any, make: Any) -> None:
        try:
            name, content = make(client)
        except (TimeoutError, RuntimeError) as problem:
            self.page.say(f"The browser gave no picture ({problem}): keep its window in sight and try again.")
        else:
            client.send_file_download(f"{file_name(self.name.value)}{name}", content, save_immediately=True)

    def _job(self, _client: Any) -> tuple[str, bytes]:
        name, title = self.name.value, self.page.session.title
        return ".toml", to_job(self.page.session, title if name in ("", file_name(title)) else name).encode()

    def _picture(self, client: Any) -> tuple[str, bytes]:
        from PIL import Image

        pixels = client.get_render(client.camera.image_height, client.camera.image_width, timeout=PATIENCE)
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "PNG", optimize=True)
        return ".png", file.getvalue()

    def _film(self, client: Any) -> tuple[str, bytes]:
        from PIL import Image

        page, frames = self.page, []
        if page.session.snapshot().phase not in (Phase.RUNNING, Phase.GATHERING):
            page.session.play()
        first = page.session.snapshot().cycle
        shape = client.camera.image_height / max(client.camera.image_width, 1)
        height = int(WIDE * min(shape, TALL))
        while len(frames) < PICTURES:
            began = time.perf_counter()
            frames.append(client.get_render(height, WIDE, timeout=PATIENCE))
            snap = page.session.snapshot()
            if snap.cycle > first or snap.phase in (Phase.DONE, Phase.IDLE):
                break
            time.sleep(max(0.0, PAUSE - (time.perf_counter() - began)))
        images = [Image.fromarray(frame).quantize(64) for frame in frames]
        file = io.BytesIO()
        images[0].save(
            file, "GIF", save_all=True, append_images=images[1:], duration=int(1000 * PAUSE), loop=0, optimize=True
        )
        return ".gif", file.getvalue()

    def _recording(self, _client: Any) -> tuple[str, bytes]:
        from .playback import record_session

        return ".html", record_session(self.page.session, text=self.page.session.title).html().encode()


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
        self.head = gui.add_html(self._head())
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
