"""The column at the right of the page: what runs, the loop, the strategies at the posture, and what leaves the page."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...analysis.coverage.starts import task_of_kind
from ...analysis.design import advise
from ...base.errors import ArgumentError, JobError
from ...base.units import SI, PrintedUnits
from ...export import LANGUAGES
from ...motion.drift_and_spread import NO_DRIFT
from ...proof import Certificate
from ..job import Job, certify_job, open_one_job, packaged_jobs, program_of_job
from ..report.plots import CLOCKWISE, COUNTER_CLOCKWISE
from ..report.sheets_plots import sheet_color
from .followers import circle_loop, eight_loop
from .panel_html import block, file_name, gauge, line, named, plain, put, quiet, swatch, table, verdict, warning
from .playback import record_session
from .posture_panel import PosturePanel
from .session import Session, to_job
from .stage import FAR, LEAST, Page, circle_of
from .states import FASTEST, SLOWEST, UNITS, USUAL, Phase, Snapshot, difference, figure, joint_unit
from .work import SheetFollower

# --- The loop: its size and place, corners by clicks, and two paths to one pose.

SHOWN = 3.0  # seconds in which two paths are shown


class LoopPanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Page):
        self.page = page
        gui, loop = page.server.gui, page.session.loop
        gray = partial(gui.add_button, color="gray")
        center, normal, radius = circle_of(loop) or (self._tool(), np.array([0.0, 0.0, 1.0]), 0.1)
        # A loop by numbers.
        gui.add_markdown("A closed path of the tool. Strategies that are not holonomic usually drift on it.")
        dragged = gui.add_checkbox("Drag centre, plane and radius in the scene", False, hint="Handles on the circle")
        self.shape = gui.add_dropdown("Shape", ("circle", "figure eight"), hint="Of the loop that is taken below")
        bounds: dict[str, Any] = {"min": (-FAR,) * 3, "max": (FAR,) * 3, "step": 0.01}
        hint = "Of the circle, or where the eight crosses itself: x, y, z in the frame of the robot's base"
        self.center = gui.add_vector3("Centre [m]", tuple(np.round(center, 4).tolist()), hint=hint, **bounds)
        hint = "Of the circle; an eight is twice as wide"
        self.radius = gui.add_number("Radius [m]", float(radius), min=LEAST, max=10.0, step=0.005, hint=hint)
        hint = "A direction at right angles to the loop; 0, 0, 1 is a level loop"
        self.normal = gui.add_vector3("Normal of the plane", tuple(np.round(normal, 4).tolist()), step=0.05, hint=hint)
        self.at_tool = gray("Begin at the tool", hint="The loop then starts where the tool is now")
        self.make = gui.add_button("Take this loop", hint="All strategies follow it from now on")
        # By clicks.
        gui.add_divider()
        gui.add_markdown("**By clicks**: corners on the level of the tool. Look from above.")
        self.clicks = gray("Begin to click", hint="Each click in the scene is a corner")
        self.close = gray("Close the polygon", disabled=True, hint="The loop through the corners")
        # Two paths.
        gui.add_divider()
        gui.add_markdown(
            "**Two paths to one pose**: drag the tool somewhere, then see a strategy go there from the start by two "
            "paths."
        )
        names = tuple(strategy.name for strategy in page.session.strategies)
        self.strategy = gui.add_dropdown("Strategy", names, hint="Whose joints are compared at the end of both paths")
        self.two_paths = gray("Go two paths to the tool's place", hint="From the start, by a corner to each side")
        self.answer = gui.add_markdown("")
        self.rescale(SI)

        dragged.on_update(lambda _event: page.ask(lambda: page.handles.show_loop_handles(dragged.value)))
        self.make.on_click(lambda _event: page.ask(self._make))
        self.two_paths.on_click(lambda _event: page.alone("two paths", self._two_paths))

        @self.at_tool.on_click
        def _(_event: Any) -> None:
            tool = self._tool() * page.units.factor("m")
            self.center.value = tuple((tool - [self.radius.value, 0.0, 0.0]).tolist())

        @self.clicks.on_click
        def _(_event: Any) -> None:
            self.close.disabled = False
            page.ask(page.handles.start_corners)

        @self.close.on_click
        def _(_event: Any) -> None:
            self.close.disabled = True
            page.ask(page.handles.close_corners)

    def rescale(self, before: PrintedUnits) -> None:
        """Centre and radius in the units of the page, from those before."""
        units, ratio = self.page.units, self.page.units.factor("m") / before.factor("m")
        if ratio == 1:
            return

        def scaled(value: Any) -> Any:
            """A number, or each of several, to twelve digits, so that there and back is what it was."""
            if np.ndim(value):
                return tuple(map(scaled, value))
            return float(f"{ratio * float(value):.12g}")

        with self.page.server.atomic():
            for handle, name in ((self.center, "Centre"), (self.radius, "Radius")):
                handle.label = f"{name} [{units.length}]"
                handle.step, handle.precision = handle.step * ratio, 1 if units.length == "mm" else 4
                value, low, high = map(scaled, (handle.value, handle.min, handle.max))
                handle.min, handle.max, handle.value = low, high, value

    @property
    def _joint_unit(self) -> str:
        return joint_unit(self.page.units, self.page.session.robot)

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
            both, paths = page.session.two_paths(self.strategy.value, wanted)
            same = both.largest < NO_DRIFT
            apart = difference(page.units, page.session.robot, both.a.q[-1] - both.b.q[-1])
            joints = "the same joints**" if same else f"other joints**: {apart} {self._joint_unit} apart"
            self.answer.content = f"Both paths end at one pose, with **{joints}."
            # Each path with a robot in its colour; then the tool is where it was dragged.
            colors = (CLOCKWISE, COUNTER_CLOCKWISE)
            with page.own_drawing(colors):
                for index, (path, color) in enumerate(zip(paths, colors, strict=True)):
                    points = path.at(np.linspace(0.0, path.duration, 100)).position
                    page.scene.path(points, f"path{index}", color)
                for row in np.linspace(0, len(both.a.q) - 1, int(SHOWN * 25)).astype(int):
                    page.scene.show([both.a.q[row], both.b.q[row]])
                    time.sleep(SHOWN / 75)
                time.sleep(SHOWN / 2)
        finally:
            page.session.drag(wanted)


# --- Work with a strategy: its robot program, its certificate, advice on others.

ACCELERATION = 2.0  # of a program's joints [rad/s^2, m/s^2], until somebody gives another one
# languages that a job of the studio can be written in: the others need facts of a controller, which a file gives
WRITTEN = tuple(name for name, language in LANGUAGES.items() if not language.needs)
# what helps where a job needs more than a session tells
CURE = "Save the job, add what is missing to its file, and use `holokin export` or `holokin certify` on the file."


class WorkPanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Page):
        self.page = page
        gui, strategies = page.server.gui, page.session.strategies
        in_job = tuple(s.name for s in strategies if s.keys is not None and page.session.origin is not None)
        off = not in_job
        hint = "Of the program and of the certificate"
        self.strategy = gui.add_dropdown("Strategy", in_job or ("none",), hint=hint)
        gui.add_markdown(
            "A **robot program** of the loop with its cycles, timed within the speed limits of the joints."
        )
        self.language = gui.add_dropdown("Language", WRITTEN, hint="Of the robot's controller, as of `holokin export`")
        hint = "Largest of any joint [rad/s^2, m/s^2]"
        self.acceleration = gui.add_number("Acceleration", ACCELERATION, min=0.01, max=100.0, step=0.1, hint=hint)
        hint = "A ZIP with the program and all samples"
        self.program = gui.add_button("Write the program", color="blue", disabled=off, hint=hint)
        gui.add_markdown("A **certificate** proves that the joints on the loop are one function of the tool pose.")
        hint = "On the loop; it takes seconds to a minute"
        self.certify = gui.add_button("Certify the strategy", color="gray", disabled=off, hint=hint)
        gui.add_markdown("**Advice**: the strategies that fit this robot near its start, compared.")
        self.advise = gui.add_button("Ask for advice", color="gray", hint="It takes some seconds, and slows the page")
        self.answer = gui.add_html("")
        self.program.on_click(lambda event: self._work(event.client, self._program))
        self.certify.on_click(lambda event: self._work(event.client, self._certificate))
        self.advise.on_click(lambda event: self._work(event.client, self._advice))

    def _work(self, client: Any, work: Any) -> None:
        """One piece of work at a time, in the thread of the click; its file goes to the browser that asked."""

        def whole() -> None:
            self.page.say("")
            self._answer("It is being worked on.")
            try:
                file = work()
            except JobError as problem:  # of a file that is there no more
                self._answer("")
                self.page.say(f"{problem.key}: {problem.fact}; {problem.cure}. {CURE}")
                return
            except BaseException:
                self._answer("")
                raise
            if file is not None and client is not None:
                client.send_file_download(*file, save_immediately=True)

        self.page.alone("work", whole)

    def _answer(self, *sentences: str) -> None:
        put(self.answer, block(*(line(self.page.worded(s)) for s in sentences)) if any(sentences) else "")

    def _program(self) -> tuple[str, bytes]:
        language, changes = self.language.value, {"acceleration": float(self.acceleration.value)}
        with _saved_job(self.page.session) as (name, job, file):
            program, timed, _ = program_of_job(name, job, file, language, self._label(), changes=changes)
            program.save(file.parent / "program")
            timed.save(file.parent / "program" / "joints.csv")
            packed = io.BytesIO()
            with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
                for part in sorted((file.parent / "program").iterdir()):
                    archive.write(part, part.name)
        facts = f"{program.targets} targets, {figure(timed.duration)} s, {timed.profile}."
        self._answer(facts, *program.notes)
        return f"{name}-{language}.zip", packed.getvalue()

    def _certificate(self) -> tuple[str, bytes] | None:
        label = self._label()
        with _saved_job(self.page.session) as (name, job, file):
            chosen = job.model_copy(update={"strategies": {label: job.strategies[label]}})
            titles = (label, self.strategy.value)
            certificate = next(answer for title, answer in certify_job(chosen, file) if title in titles)
            if not isinstance(certificate, Certificate):
                self._answer(f"{self.strategy.value} is not certified: {certificate}")
                return None
            self._answer(certificate.theorem)
            return f"{name}-certificate.json", certificate.save(file.parent / "certificate.json").read_bytes()

    def _advice(self) -> None:
        session = self.page.session
        if session.task.frames > 1:
            raise ArgumentError("advice", session.task.name, "it is given for robots with one tool")
        task = task_of_kind(session.robot, None, "position" if session.task.orientation is None else "pose")
        advice = advise(task, q0=session.home, progress=self._answer)
        self._answer(f"The best is {advice.best.name}.", *advice.reasons)

    def _label(self) -> str:
        """The name in a job of the strategy that is chosen."""
        strategy = next(s for s in self.page.session.strategies if s.name == self.strategy.value)
        return strategy.label or strategy.name


@contextmanager
def _saved_job(session: Session) -> Iterator[tuple[str, Job, FilePath]]:
    """(name, job, file) of a session as a job, in a folder that is there meanwhile. Raises: as `to_job`."""
    with TemporaryDirectory() as folder:
        file = FilePath(folder, f"{file_name(session.title)}.toml")
        file.write_text(to_job(session), "utf-8")
        yield open_one_job(str(file))


# --- The sheets of a job.


class SheetsPanel:
    """Its controls; built inside a tab of a page whose session has sheets."""

    def __init__(self, page: Page, follower: SheetFollower):
        self.page, self.follower = page, follower
        gui = page.server.gui
        gui.add_markdown("A **sheet** is a leaf with the tool poses that it serves. A few together serve a workspace.")
        hint = "Read from the job's file, or searched for: that may take minutes"
        self.find = gui.add_button("Find the sheets", color="gray", hint=hint)
        hint = "The solid arm takes their joints while you drag its tool"
        self.on = gui.add_checkbox("Follow sheets", False, hint=hint)
        self.status = gui.add_html("")
        self.find.on_click(lambda _event: page.ask(page.session.find_sheets))

        @self.on.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._switch, "sheets")

    def _switch(self) -> None:
        session = self.page.session
        self.page.say("")
        session.follow_sheets(session.strategies[self.page.lead].name if self.on.value else None)

    def draw(self) -> None:
        """Bring switch and texts to what there is, in the colours of the map's picture."""
        state = self.follower.state
        there = state.count > 0
        for handle, off in ((self.find, there), (self.on, not there)):
            if handle.disabled != off:
                handle.disabled = off
        if self.on.value != bool(state.strategy):
            self.on.value = bool(state.strategy)
        if not there:
            put(self.status, block(line(state.searching)) if state.searching else "")
            return
        rows = []
        for sheet in range(state.count):
            serves = sheet == state.sheet
            cell = plain(f"sheet {sheet}{': serves the tool' if serves else ''}")
            rows.append((swatch(sheet_color(sheet), serves), cell))
        who = f"{state.strategy} follows the sheets." if state.strategy else "No arm follows the sheets."
        sentence, why, about = map(self.page.worded, (state.sentence, state.why, f"{state.about}."))
        sentence = line(sentence) if state.sheet >= 0 else warning(sentence)
        put(self.status, block(table(rows), sentence, warning(why), quiet(who), quiet(about)))


# --- What leaves the page: a job file, a recording. The browser downloads it.


class SavePanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Page):
        self.page = page
        gui = page.server.gui
        self.name = gui.add_text("Name", file_name(page.session.title), hint="Of the files, and the title of the job")
        gui.add_markdown("A **job** runs to the same numbers: `holokin run NAME.toml`.")
        self.job = gui.add_button("Save as job", hint="A TOML file with robot, task, start, loop and strategies")
        gui.add_markdown("A **recording** is a page of its own: one HTML file, without a server.")
        hint = "Of the loop that has run; press Start first"
        self.recording = gui.add_button("Record to HTML", color="gray", hint=hint)
        self.job.on_click(lambda event: self._save(event, self._job))
        self.recording.on_click(lambda event: self._save(event, self._recording))

    def _save(self, event: Any, make: Any) -> None:
        """Make a file in the thread of the click, and send it to the browser that asked."""

        def download() -> None:
            ending, text = make()
            name = f"{file_name(self.name.value)}{ending}"
            event.client.send_file_download(name, text.encode(), save_immediately=True)

        if event.client is not None:
            self.page.alone(("save", event.client_id), download)

    def _job(self) -> tuple[str, str]:
        name, title = self.name.value, self.page.session.title
        return ".toml", to_job(self.page.session, title if name in ("", file_name(title)) else name)

    def _recording(self) -> tuple[str, str]:
        return ".html", record_session(self.page.session, text=self.page.session.title).html()


# --- The panel with all of these, and what runs.

WIDTH = 320  # of the panel [pixels]
ENDLESS = 0  # cycles that mean: for ever
ROUND = ("as drawn", "the other way")  # the ways round a loop: not clockwise, clockwise
# what the columns of the table are
COLUMNS = (
    "strategy: the rule that moves the joints. drift: how far the worst joint is from its start after the last cycle, "
    "none below a millionth. state: whether the tool is at the target"
)
_DOING = {
    Phase.IDLE: "Drag the tool, or start the loop.",
    Phase.GATHERING: "The joints go to where the loop begins.",
    Phase.RUNNING: "Cycle {cycle}, {share:.0f} %",
    Phase.PAUSED: "Held in cycle {cycle}, {share:.0f} %",
    Phase.DONE: "Done: {done}. {who}",
}


def _back_and_away(snap: Snapshot) -> str:
    """Which strategies are back at the start after their cycles, which are not, and which have stopped on the way."""
    ends = {state.name: state.drift[-1] for state in snap.strategies if len(state.drift)}
    groups = {
        "Back at the start": [name for name, drift in ends.items() if drift < NO_DRIFT],
        "Not back": [name for name, drift in ends.items() if drift >= NO_DRIFT],
        "Stopped on the way": [name for name, drift in ends.items() if np.isnan(drift)],
    }
    return " ".join(f"{group}: {', '.join(names)}." for group, names in groups.items() if names)


class Panels:
    """The main panel of a page."""

    def __init__(self, page: Page):
        self.page, session = page, page.session
        gui = page.server.gui
        gui.set_panel_label("holokin studio")
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178))
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        joints = f"{session.robot.name}: {session.task.n} joints for {session.task.m} coordinates of the tool"
        shared = "All browsers on this page see and move the same robots."
        remarks = map(warning, page.scene.remarks)
        gui.add_html(block(line(session.title, bold=True), line(joints), quiet(shared), *remarks))
        self.doing = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self._run(gui)
        with tabs.add_tab("Loop"):
            self.loop = LoopPanel(page)
        with tabs.add_tab("Posture"):
            self.posture = PosturePanel(page)
        self.sheets: SheetsPanel | None = None
        if session.sheets is not None:
            with tabs.add_tab("Sheets"):
                self.sheets = SheetsPanel(page, session.sheets)
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

    def _run(self, gui: Any) -> None:
        """The tab with which the loop is run."""
        page, session = self.page, self.page.session
        # Start and speed.
        self.table = gui.add_html("")
        hint = "All strategies run round the loop; press again to hold them"
        self.start = gui.add_button("Start", color="blue", hint=hint)
        hint = "The loop stops, and its drift is forgotten"
        self.home = gui.add_button("All back to the start posture", color="gray", hint=hint)
        hint = "How many times as fast as its own speed the loop runs; the drift is the same"
        self.speed = gui.add_slider("Speed", min=SLOWEST, max=FASTEST, step=0.25, initial_value=USUAL, hint=hint)
        session.set_speed(self.speed.value)
        # How long, and which way round.
        cycles, hint = session.snapshot().cycles, "The loop ends after so many rounds; 0: never"
        self.cycles = gui.add_number(
            "Cycles", ENDLESS if cycles is None else cycles, min=0, max=10_000, step=1, hint=hint
        )
        self.way = gui.add_dropdown("Way round", ROUND, hint="The sense in which the loop is run")
        # What is drawn, and in which units.
        names = tuple(strategy.name for strategy in session.strategies)
        hint = "The strategy whose robot is drawn solid; the others are seen where they differ from it"
        self.solid = gui.add_dropdown("Solid robot", names, initial_value=names[page.lead], hint=hint)
        hint = "A pale pink robot where all strategies began"
        self.at_start = gui.add_checkbox("Show the start posture, in pink", False, hint=hint)
        shown, hint = f"{page.units.angle}, {page.units.length}", "Of the numbers in the page, not of files"
        self.units = gui.add_dropdown("Units", tuple(UNITS), initial_value=shown, hint=hint)

        def on_update(handle: Any, action: Any, key: str) -> None:
            handle.on_update(lambda _event: page.ask(lambda: action(handle.value), key))

        self.start.on_click(lambda _event: page.ask(self._start_or_pause))
        self.home.on_click(lambda _event: page.ask(self._back))
        on_update(self.speed, session.set_speed, "speed")
        on_update(self.cycles, lambda value: session.set_cycles(int(value) or None), "cycles")
        on_update(self.way, lambda value: session.set_clockwise(value == ROUND[True]), "way")
        on_update(self.solid, lambda value: page.set_lead(names.index(value)), "solid")
        on_update(self.at_start, lambda value: page.scene.show_start(session.home if value else None), "start")
        on_update(self.units, lambda value: page.set_units(UNITS[value]), "units")
        # Another job.
        reopen = page.reopen
        if reopen is not None:
            jobs = packaged_jobs()
            chosen = session.source if session.source in jobs else jobs[0]
            self.job = gui.add_dropdown(
                "Packaged job", jobs, initial_value=chosen, hint="Examples that come with holokin"
            )
            hint = "The page shows it instead, to all browsers"
            self.open = gui.add_button("Open this job", color="gray", hint=hint)
            self.open.on_click(lambda _event: page.alone("open", lambda: reopen(self.job.value)))

    def _back(self) -> None:
        """All to the start posture; strategies that were moved to another leaf stand elsewhere on it, which is said."""
        page, home = self.page, self.page.session.home
        snapshot = page.session.reset()
        page.clear_traces()
        self.posture.take_away()
        away = [s.name for s in snapshot.strategies if s.following and np.abs(s.q - home).max() > NO_DRIFT]
        page.say(f"On a leaf that was chosen by its level, not that of the start: {', '.join(away)}." if away else "")

    def _start_or_pause(self) -> None:
        self.page.say("")
        if self.page.session.snapshot().phase in (Phase.RUNNING, Phase.GATHERING):
            self.page.session.pause()
        else:
            self.page.session.play()

    def _doing(self, snap: Snapshot) -> str:
        share, who = 100 * snap.progress, _back_and_away(snap)
        done = "1 cycle" if snap.cycle == 1 else f"{snap.cycle} cycles"
        text = _DOING[snap.phase].format(cycle=snap.cycle + 1, share=share, done=done, who=who)
        faults = [f"{state.name}: {state.sentence}" for state in snap.strategies if state.sentence]
        red = self.page.message or snap.message or (faults[0] if faults else snap.loop_fault)
        return block(line(text), gauge(snap.progress), *(warning(self.page.worded(s)) for s in (red, snap.fault)))

    def _table(self, snap: Snapshot) -> str:
        """Each strategy with its drift after the last cycle and its state."""
        units, robot = self.page.units, self.page.session.robot
        drift, status = f"drift [{joint_unit(units, robot)}]", "state"
        rows = [("", plain("strategy", grey=True), *(plain(w, grey=True, right=True) for w in (drift, status)))]
        for index, (state, color) in enumerate(zip(snap.strategies, self.page.colors, strict=False)):
            drift = ""
            if len(state.drift):
                stopped = np.isnan(state.drift[-1])
                drift = "stopped" if stopped else difference(units, robot, state.drift_joints[-1])
            name = named(state.name, verdict(state.repeatable))
            status = plain("follows" if state.following else state.status.value, red=not state.following, right=True)
            rows.append((swatch(color, index == self.page.lead), name, plain(drift, right=True), status))
        return block(table(rows, [COLUMNS, *(self.page.worded(state.sentence) for state in snap.strategies)]))
