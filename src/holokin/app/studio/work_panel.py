"""The panel of what a session is worked on with: a robot program of a law, its certificate, and advice on laws."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

from ...analysis.design import advise
from ...base.errors import ArgumentError, JobError
from ...export import LANGUAGES
from ...proof import Certificate
from ..job import Job, certify_job, open_one_job, program_of_job
from .panel_texts import block, file_name, line, put
from .session import Session
from .session_job import to_job
from .stage import Stage

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
        told = tuple(law.name for law in laws if law.keys is not None and page.session.origin is not None)
        off = not told
        self.law = gui.add_dropdown("Law", told or ("none",), hint="Of the program and of the certificate")
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
            (self.program, self._program), (self.certify, self._certificate), (self.advise, self._advice),
        ):  # fmt: skip
            button.on_click(lambda event, work=work: self._work(event.client, work))

    def _work(self, client: Any, work: Any) -> None:
        """One piece of work at a time, in the thread of the click; its file goes to the browser that asked."""

        def whole() -> None:
            self.page.say("")
            self._tell("It is being worked on.")
            try:
                found = work()
            except JobError as problem:  # of a file that is there no more
                self._tell("")
                self.page.say(f"{problem.key}: {problem.fact}; {problem.cure}. {CURE}")
                return
            except BaseException:
                self._tell("")
                raise
            if found is not None and client is not None:
                client.send_file_download(*found, save_immediately=True)

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
                for one in sorted((file.parent / "program").iterdir()):
                    box.write(one, one.name)
        said = f"{program.targets} targets, {timed.duration:.3g} s, {timed.profile}."
        self._tell(said, *program.notes)
        return f"{name}-{language}.zip", packed.getvalue()

    def _certificate(self) -> tuple[str, bytes] | None:
        label = self._label()
        with _saved_job(self.page.session) as (name, job, file):
            chosen = job.model_copy(update={"strategies": {label: job.strategies[label]}})
            found = next(one for title, one in certify_job(chosen, file) if title in (label, self.law.value))
            if not isinstance(found, Certificate):
                self._tell(f"{self.law.value} is not certified: {found}")
                return None
            self._tell(found.theorem)
            return f"{name}-certificate.json", found.save(file.parent / "certificate.json").read_bytes()

    def _advice(self) -> None:
        session = self.page.session
        if session.task.frames > 1:
            raise ArgumentError("advice", session.task.name, "it is given for robots with one tool")
        task = "position" if session.task.orientation is None else "pose"
        found = advise(session.robot, task=task, q0=session.home, say=self._tell)
        self._tell(f"The best is {found.best.name}.", *found.reasons)

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
