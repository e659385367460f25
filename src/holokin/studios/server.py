"""`Studio`: serves the page of a job or a robot."""

from __future__ import annotations

import errno
import ipaddress
import os
import socket
import threading
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from ..robot import Robot
from .meshes import GHOST, SOLID, looks_of, trimesh_package
from .opening import open_session, session_of_robot
from .page import Page
from .scene import name_tab, silent_viser, viser_package
from .session import Session
from .working import failure

PORT = 8080
"""Where the page is, unless it is in use."""

HERE = "127.0.0.1"
"""This machine alone."""

TRIED = 50
"""Ports that are tried."""

FAREWELL = 1.0
"""Seconds for the last words to reach browsers: the server ends its sending threads without waiting for them."""

ENDED = "Nothing moves any more on this page. Start the studio again, and load the page again."
"""What browsers are told in the end."""

DEFAULT = "panda-circle"
"""The job that is shown when nothing is asked for."""


What = str | Path | Robot | Session | None
"""What can be shown."""


class Studio:
    """A page that is served until `close`. `hk.studio` makes one.

    Attributes:
        url: where the page is. notes: what is to be said of it: another port than asked for, a host that others reach.
    """

    def __init__(self, session: Session, port: int = PORT, host: str = HERE):
        viser = viser_package()
        self._lock, self._over = threading.Lock(), False
        free = free_port(host, port)
        with silent_viser():  # our own sentence says more than its banner
            self.server = viser.ViserServer(host=host, port=free, verbose=False)
        found = self.server.get_port()
        self.url = url_of(host, found)
        self.notes: list[str] = []
        if port and found != port:
            self.notes.append(f"port {port} is in use: the page is at port {found}")
        if not _loopback(host):
            self.notes.append(f"everyone who reaches this machine at {host} can open and move the page")
        self.page = self._shown(session)
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
                self.page = self._shown(session)
            except BaseException:
                session.close()
                self.page = self._shown(before.session)
                raise
            before.session.close()

    def close(self) -> None:
        """End page and server. Browsers that look at it are told."""
        if self._over:
            return
        self._over = True
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

    def _shown(self, session: Session) -> Page:
        self.server.scene.reset()
        self.server.gui.reset()
        page = Page(self.server, session, self._reopen)
        session.start_work()
        page.start()
        name_tab(self.server, f"{session.source or session.title} - holokin studio")
        return page

    def _reopen(self, name: str) -> None:
        """Asked for in the page: what is wrong is said there."""
        try:
            self.open(name)
        except Exception as problem:  # noqa: BLE001  the page that was there stands, and says it
            self.page.say(failure(f"{name} was not opened", problem))


def serve(what: What, port: int, host: str, browser: bool, wait: bool, tell: Callable[[str], Any]) -> Studio:
    """Open a page; as `hk.studio` says."""
    if not 0 <= port <= 65535:
        raise ArgumentError("port", port, "give one from 1024 to 65535, or 0 for any")
    viser_package()
    trimesh_package()
    made = Studio(_session(what), port, host)
    for note in made.notes:
        tell(note)
    tell(f"the studio is at {made.url}{'; press Ctrl-C here, in the terminal, to end it' if wait else ''}")
    if browser:
        webbrowser.open(made.url)
    if wait:
        made.wait()
    return made


def free_port(host: str, port: int) -> int:
    """The first port from one on that is free at an address; 0 stays 0, which is any.

    Raises:
        ArgumentError: the address is none of this machine, or no port is free.
    """
    found = port
    for found in range(port, min(port + TRIED, 65536)):
        try:
            family, kind, _, _, place = socket.getaddrinfo(host, found, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind) as one:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0 if os.name == "nt" else 1)
                one.bind(place)
            return found
        except (socket.gaierror, UnicodeError):
            break
        except OSError as problem:
            if problem.errno not in (errno.EADDRINUSE, errno.EACCES):
                break
    else:
        raise ArgumentError("port", port, f"no port from it to {found} is free: choose another one")
    raise ArgumentError("the host", host, "give an address of this machine, such as 127.0.0.1 or 0.0.0.0")


def url_of(host: str, port: int) -> str:
    """Where a browser finds a page; an IPv6 address stands in brackets (RFC 3986, section 3.2.2)."""
    name = "localhost" if host == HERE else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}"


def _session(what: What) -> Session:
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
