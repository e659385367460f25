"""`studio`: opens the page of a job or a robot in the browser."""

from __future__ import annotations

import contextlib
import io
import ipaddress
import threading
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..arguments import typed
from ..errors import ArgumentError, HolokinError
from ..robot import Robot
from .opening import open_session, session_of_robot
from .page import Page
from .scene import viser_package
from .session import Session

PORT = 8080
"""Where the page is, unless it is in use."""

HERE = "127.0.0.1"
"""This machine alone."""

DEFAULT = "panda-circle"
"""The job that is shown when nothing is asked for."""


class Studio:
    """A page that is served until `close`. `hk.studio` makes one.

    Attributes:
        url: where the page is. notes: what is to be said of it: another port than asked for, a host that others reach.
    """

    def __init__(self, session: Session, port: int = PORT, host: str = HERE):
        viser = viser_package()
        self._lock = threading.Lock()
        with contextlib.redirect_stdout(io.StringIO()):  # viser's own banner; ours says more
            try:
                self.server = viser.ViserServer(host=host, port=port, verbose=False)
            except OSError as problem:
                raise ArgumentError("the host", host, f"name one of this machine ({problem})") from None
        found = self.server.get_port()
        self.url = f"http://{'localhost' if host == HERE else host}:{found}"
        self.notes: list[str] = []
        if found != port:
            self.notes.append(f"port {port} is in use: the page is at port {found}")
        if not _loopback(host):
            self.notes.append(f"everyone who reaches this machine at {host} can open and move the page")
        self.page = self._shown(session)

    @property
    def session(self) -> Session:
        """What the page shows now."""
        return self.page.session

    def open(self, name: str) -> None:
        """Show another job or robot instead. Raises: what `open_session` raises, and the page stays as it is."""
        session = open_session(name)
        with self._lock:
            before = self.page
            before.close()
            before.session.close()
            self.server.scene.reset()
            self.server.gui.reset()
            self.page = self._shown(session)

    def close(self) -> None:
        """End page and server."""
        self.page.close()
        self.page.session.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def wait(self) -> None:
        """Until Ctrl-C, which ends the page."""
        try:
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def _shown(self, session: Session) -> Page:
        page = Page(self.server, session, self._reopen)
        session.start_work()
        page.start()
        return page

    def _reopen(self, name: str) -> None:
        """Asked for in the page: what is wrong is said there."""
        try:
            self.open(name)
        except HolokinError as problem:
            self.page.say(str(problem))


@typed
def studio(
    what: str | Path | Robot | Session | None = None,
    *,
    port: int = PORT,
    host: str = HERE,
    browser: bool = True,
    wait: bool = True,
    tell: Callable[[str], Any] = print,
) -> Studio:
    """Open a page in the browser: the robot, a loop to drag, and control laws side by side.

    All browsers that open the page share one state. See docs/studio.md.

    Args:
        what: a job (packaged, or a file), a robot (of the catalogue, a file, or a Robot), or a `studios.Session`; by
            default the job panda-circle.
        port: where the page is served; the next free one if it is in use.
        host: "127.0.0.1" is this machine alone; with another address others can open the page, too.
        browser: False opens none.
        wait: serve until Ctrl-C; False returns at once, and `close()` ends it.
        tell: hears where the page is, a sentence at a time.

    Returns:
        The studio, with `url` and `close()`.

    Raises:
        MissingExtraError: viser or trimesh is not installed. ArgumentError: a port or host that cannot be; a robot
            without a joint to spare. HolokinError: what reading the job or robot raises.
    """
    if not 0 <= port <= 65535:
        raise ArgumentError("port", port, "give one from 1024 to 65535, or 0 for any")
    viser_package()
    made = Studio(_session(what), port, host)
    for note in made.notes:
        tell(note)
    tell(f"the studio is at {made.url}; Ctrl-C ends it" if wait else f"the studio is at {made.url}")
    if browser:
        webbrowser.open(made.url)
    if wait:
        made.wait()
    return made


def _session(what: str | Path | Robot | Session | None) -> Session:
    if isinstance(what, Session):
        return what
    if isinstance(what, Robot):
        return session_of_robot(what, source=what.name)
    return open_session(str(what or DEFAULT))


def _loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
