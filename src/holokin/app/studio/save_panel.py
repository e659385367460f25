"""What goes out of the page: a job file, a picture, a GIF, a recording. All of it is downloaded by the browser."""

from __future__ import annotations

import io
import time
from typing import Any

from .panel_texts import file_name
from .session_job import to_job
from .stage import Stage
from .states import Phase

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
            (self.job, self._job), (self.picture, self._picture), (self.film, self._film),
            (self.recording, self._recording),
        ):  # fmt: skip

            @button.on_click
            def _(event: Any, make: Any = make) -> None:
                if event.client is not None:
                    page.alone(("save", event.client_id), lambda: self._out(event.client, make))

    def _out(self, client: Any, make: Any) -> None:
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
