"""`open_server`: a viser server behind a `Door`, whose browsers are heard through `Incoming`. Loaded with viser.

viser serves by the library websockets, and hands it no check of requests or messages, though that library has a place
for both. So they are put in there, where viser calls it; a viser that does not call it so is not served at all.
"""

from __future__ import annotations

import asyncio
import http
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import viser
import websockets.asyncio.server as library
from websockets.http11 import Request, Response

from ...base.errors import MissingExtraError
from .door import PAGE, TOKEN, Door, inner, policy
from .incoming import LARGEST, Incoming
from .page_scene import silent_viser

RATE = 400
"""Messages of a browser that are heard in a second: a drag sends 60. The others wait, for all share one thread."""

_replacing = threading.Lock()


class Host(str):
    """An address that a server is bound to, by which its door is known where viser passes only the address on."""

    door: Door
    incoming: Incoming
    taken: bool


def open_server(host: str, port: int, door: Door, incoming: Incoming) -> Any:
    """A viser.ViserServer at an address that lets in whom the door lets in.

    Raises:
        MissingExtraError: this viser serves in another way, so that nobody would be at the door.
    """
    place = Host(host)
    place.door, place.incoming, place.taken = door, incoming, False
    with _doors(), silent_viser():  # our own sentence says more than its banner
        server = viser.ViserServer(host=place, port=port, verbose=False)
    if not place.taken:
        with silent_viser():
            server.stop()
        raise MissingExtraError(f"another viser than {viser.__version__}, which cannot be guarded", "studio")
    incoming.server = server
    return server


class _Served(library.serve):
    """websockets' own `serve`, with a door where the address has one."""

    def __init__(self, handler: Any, host: Any = None, port: Any = None, **given: Any) -> None:
        if isinstance(host, Host):
            host.taken = True
            given |= {
                "process_request": _guarded(host.door, given.get("process_request")),
                "create_connection": _listening(host.incoming),
                "max_size": LARGEST,
                "server_header": None,
            }
        super().__init__(handler, host, port, **given)


@contextmanager
def _doors() -> Iterator[None]:
    with _replacing:
        before, library.serve = library.serve, _Served
        try:
            yield
        finally:
            library.serve = before


def _guarded(door: Door, answer: Any) -> Any:
    """The check of a request, then what viser answers."""

    def process(connection: library.ServerConnection, request: Request) -> Response | None:
        hosts, port = request.headers.get_all("Host"), connection.local_address[1]
        refused = door.stranger(port, hosts, request.headers.get_all("Origin"))
        if refused or not door.knows(request.path):
            found = connection.respond(http.HTTPStatus.FORBIDDEN, f"{refused or TOKEN}\n")
        else:
            found = answer(connection, replace(request, path=inner(request.path)))
            if found is not None:
                found.headers["Content-Security-Policy"] = policy(hosts[0])
        if found is not None:
            for name, value in PAGE:
                found.headers[name] = value
        return found

    return process


def _listening(incoming: Incoming) -> Any:
    """A maker of connections that hear only what passes."""

    class Listening(library.ServerConnection):
        heard, second = 0, 0.0

        async def recv(self, *given: Any, **named: Any) -> Any:
            while True:
                said = await super().recv(*given, **named)
                await self._paced()
                found = incoming.passed(said)
                if found is not None:
                    return found

        async def _paced(self) -> None:
            now = time.monotonic()
            if now - self.second >= 1.0:
                self.heard, self.second = 0, now
            self.heard += 1
            if self.heard > RATE:
                await asyncio.sleep(self.second + 1.0 - now)

    return Listening
