"""`Studio`: serves the page of a job or a robot."""

from __future__ import annotations

import atexit
import errno
import os
import socket
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...base.arguments import typed
from ...base.errors import ArgumentError, UnknownNameError
from ...base.units import SI, PrintedUnits
from ...robot import Robot
from ..job import packaged_jobs
from .door import HERE, Door, loopback, wildcard
from .new_session import open_session, session_of_robot
from .page_scene import GHOST, SOLID, looks_of, name_tab, silent_viser, trimesh_package, viser_package
from .session import Session
from .side_panels import Panels
from .stage import Page
from .work import failure

PORT = 8080  # where the page is, unless it is in use
TRIED = 50  # ports that are tried
# seconds for the last words to reach browsers: the server ends its sending threads without waiting for them
FAREWELL = 1.0
# what browsers are told in the end
ENDED = "Nothing moves any more on this page. Start the studio again: it prints a new address."

OPEN = (
    "the page is open to the network at {host}, and nothing is encrypted: whoever knows its address, {url}, can move "
    "the robots of the page, open packaged jobs in it, and download what it shows; whoever listens on the way reads "
    "it all, the token, too"
)
"""What is said of a host that other machines reach."""

# the file with which the browser is started
LEADS_ON = '<!DOCTYPE html><meta http-equiv="refresh" content="0; url={url}"><a href="{url}">The studio</a>'
DEFAULT = "panda-circle"
"""The job that is shown when nothing is asked for."""


class Studio:
    """A page that is served until `close`. `hk.studio` makes one.

    Attributes:
        url: where the page is, with its token: who has it can open the page.
        notes: what is to be said of it: another port than asked for, a host that others reach.

    Raises:
        MissingExtraError: viser is not installed, or is one that cannot be guarded.
    """

    def __init__(self, session: Session, port: int = PORT, host: str = HERE):
        viser_package()
        from .gate import Incoming, open_server

        self._lock, self._over = threading.Lock(), False
        self._opening: tempfile.TemporaryDirectory[str] | None = None
        self.door = Door(host)
        self.server = open_server(host, _free_port(host, port), self.door, Incoming())
        free = self.server.get_port()
        self.url = f"{url_of(host, free)}/{self.door.token}/"
        self.notes: list[str] = []
        if port and free != port:
            self.notes.append(f"port {port} is in use: the page is at port {free}")
        if not loopback(host):
            self.notes.append(OPEN.format(host=host, url=f"{url_of(_host_name(host), free)}/{self.door.token}/"))
        self.page = self._shown(session)
        atexit.register(self.close)  # native code of its threads must not run while Python goes down
        self.server.on_client_connect(lambda _client: self._forget_file())
        self.server.on_client_disconnect(lambda _client: self.page.handles.let_go())

    @property
    def session(self) -> Session:
        """What the page shows now."""
        return self.page.session

    def open(self, name: str) -> None:
        """Show another job or robot instead. Raises: what `open_session` raises, and the page stays as it is."""
        session = open_session(name)
        for triangles in (SOLID, GHOST):  # what takes time, and may fail, while the page before stands
            looks_of(session.robot, triangles)
        with self._lock:
            before = self.page
            before.close()
            try:
                self.page = self._shown(session, before.units)
            except BaseException:
                session.close()
                self.page = self._shown(before.session, before.units)
                raise
            before.session.close()

    def close(self) -> None:
        """End page and server. Browsers that look at it are told."""
        if self._over:
            return
        self._over = True
        atexit.unregister(self.close)
        self._forget_file()
        clients = self.server.get_clients().values()
        for client in clients:
            client.add_notification("The studio was ended", ENDED, color="red", with_close_button=False)
            client.flush()
        self.page.close()
        self.page.session.close()
        time.sleep(FAREWELL if clients else 0.0)
        with silent_viser():
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

    def _shown(self, session: Session, units: PrintedUnits = SI) -> Page:
        self.server.scene.reset()
        self.server.gui.reset()
        page = Page(self.server, session, Panels, self._reopen, units)
        session.start_work()
        page.start()
        name_tab(self.server, f"{session.source or session.title} - holokin studio")
        return page

    def browse(self) -> None:
        """Open a browser of this machine, by a file that leads to the page and that no other user can read.

        All users of a machine see the arguments of its programs, so no address may be among them. The file is in the
        home folder and not hidden, since browsers in a sandbox (snap) read no other place.
        """
        home = os.path.expanduser("~")
        place = home if os.access(home, os.W_OK) else None
        with suppress(OSError, ValueError):  # a full disk, a BROWSER that is no command: the address is printed, too
            self._opening = tempfile.TemporaryDirectory(prefix="holokin-studio-", dir=place, ignore_cleanup_errors=True)
            page = Path(self._opening.name, "open.html")
            page.touch(0o600)
            page.write_text(LEADS_ON.format(url=self.url), "utf-8")
            webbrowser.open(page.as_uri())

    def _forget_file(self) -> None:
        if self._opening is not None:
            self._opening.cleanup()

    def _reopen(self, name: str) -> None:
        """Asked for in the page, which may name packaged jobs only; what is wrong is said there."""
        try:
            if name not in packaged_jobs():
                raise UnknownNameError("job of the page", name, packaged_jobs())
            self.open(name)
        except Exception as problem:  # noqa: BLE001  the page that was there stands, and says it
            self.page.say(failure(f"{name} was not opened", problem))


def _free_port(host: str, port: int) -> int:
    """The first port from one on that is free at an address; 0 stays 0, which is any.

    Raises:
        ArgumentError: the address is none of this machine, or no port is free.
    """
    candidate = port
    for candidate in range(port, min(port + TRIED, 65536)):
        try:
            family, kind, _, _, place = socket.getaddrinfo(host, candidate, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0 if os.name == "nt" else 1)
                probe.bind(place)
            return candidate
        except (socket.gaierror, UnicodeError):
            break
        except OSError as problem:
            if problem.errno not in (errno.EADDRINUSE, errno.EACCES):
                break
    else:
        raise ArgumentError("port", port, f"no port from it to {candidate} is free: choose another one")
    raise ArgumentError("the host", host, "give an address of this machine, such as 127.0.0.1 or 0.0.0.0")


def url_of(host: str, port: int) -> str:
    """Where a browser of this machine finds a server; an IPv6 address stands in brackets (RFC 3986, section 3.2.2)."""
    name = "localhost" if host == HERE or wildcard(host) else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}"


def _host_name(host: str) -> str:
    """By which name other machines find a host."""
    return socket.gethostname() or host if wildcard(host) else host


@typed
def studio(
    what: Any = None,
    *,
    port: int = 8080,
    host: str = "127.0.0.1",
    browser: bool = True,
    wait: bool = True,
    progress: Callable[[str], Any] = print,
) -> Studio:
    """Open a page in the browser: the robot, a loop to drag, and control laws side by side. Extra `studio`.

    All browsers that open the page share one state. See docs/start.md, The studio.

    Args:
        what: a job (packaged, or a file), a robot (of the catalogue, a file, or a Robot), or a `studios.Session`; by
            default the job panda-circle.
        port: where the page is served; the next free one if it is in use, 0 for any.
        host: "127.0.0.1" is this machine alone; another address of it opens the page to the network, unencrypted, for
            all who know its address.
        browser: False opens none.
        wait: serve until Ctrl-C; False returns at once, and `close()` ends it.
        progress: hears where the page is, and what else is to be known of it, a sentence at a time. The address has a
            token in it: who has it can open the page.

    Returns:
        The studio: `url`, `session`, `open(name)`, `close()`.

    Raises:
        MissingExtraError: viser or trimesh is not installed, or a viser that cannot be guarded.
        ArgumentError: a port or host that cannot be; a robot without a joint to spare.
        HolokinError: what reading the job or robot raises.
    """
    if not callable(progress):
        raise ArgumentError("progress", progress, "give a function of one text")
    if not 0 <= port <= 65535:
        raise ArgumentError("port", port, "give one from 1024 to 65535, or 0 for any")
    viser_package()
    trimesh_package()
    # What is shown.
    if isinstance(what, Session):
        session = what
    elif isinstance(what, Robot):
        session = session_of_robot(what, source=what.name)
    elif what is None or isinstance(what, str | Path):
        session = open_session(str(what or DEFAULT))
    else:
        raise ArgumentError("what the studio shows", what, "give a job, a robot, a file of one, or a studios.Session")
    # The page, and where it is.
    served = Studio(session, port, host)
    for note in served.notes:
        progress(note)
    progress(f"the studio is at {served.url}{'; press Ctrl-C here, in the terminal, to end it' if wait else ''}")
    if browser:
        served.browse()
    if wait:
        served.wait()
    return served
