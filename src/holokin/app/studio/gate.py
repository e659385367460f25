"""`open_server`: a viser server behind a `Door`, whose browsers are heard through `Incoming`. Loaded with viser.

viser serves by the library websockets, and hands it no check of requests or messages, though that library has a place
for both. So they are put in there, where viser calls it; a viser that does not call it so is not served at all.
"""

from __future__ import annotations

import asyncio
import http
import math
import threading
import time
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Any, Literal

import msgspec
import viser
import websockets.asyncio.server as library
from msgspec import Meta, Struct
from websockets.http11 import Request, Response

from ...base.errors import MissingExtraError
from ...base.poses import UNIT
from .door import PAGE, TOKEN, Door, inner, policy
from .page_scene import silent_viser

# --- `Incoming`: what browsers say to the studio, looked at before viser hears it. Loaded with viser, not before.
#
# viser takes a client's word for everything: it sets any property of a control to any value, tells it to all browsers,
# and opens a tunnel to the internet when it is asked to. So of its messages only those pass that the page of the studio
# needs, with just their known fields; numbers are finite and within the bounds of their control, a choice is one of its
# options. What does not fit is dropped, and nobody else notices.

LONGEST = 200  # characters of a text that is typed into the page, and of names in messages
SMALL = 8192  # bytes of a message that is heard: the longest, of the camera, has 400
LARGEST = 2**20  # bytes of a message after which its sender is no page of ours
PIXELS = 16_384  # width and height of a window at most
# largest number [m, or any unit] of a control without bounds of its own, and of a handle's place: no robot is larger
FAR = 1e3
AWAY = 1e6  # largest coordinate of a camera [m], which zooms out far beyond what it sees

_Name = Annotated[str, Meta(max_length=LONGEST)]
_Near = Annotated[float, Meta(ge=-FAR, le=FAR)]
_Away = Annotated[float, Meta(ge=-AWAY, le=AWAY)]
_Positive = Annotated[float, Meta(gt=0.0, le=AWAY)]
_Pixels = Annotated[int, Meta(ge=0, le=PIXELS)]
_Turn = tuple[_Away, _Away, _Away, _Away]
_Place = tuple[_Near, _Near, _Near]
_Spot = tuple[_Away, _Away, _Away]


class _New(Struct, forbid_unknown_fields=True):
    value: bool | int | float | Annotated[str, Meta(max_length=SMALL)] | Annotated[list[float], Meta(max_length=4)]


class GuiUpdateMessage(Struct, tag_field="type"):
    """A control has a new value, or a button was pressed."""

    uuid: _Name
    updates: _New


class ViewerCameraMessage(Struct, tag_field="type"):
    """From where a browser looks."""

    wxyz: _Turn
    position: _Spot
    fov: Annotated[float, Meta(gt=0.0, lt=math.pi)]
    near: _Positive
    far: _Positive
    image_height: _Pixels
    image_width: _Pixels
    look_at: _Spot
    up_direction: _Spot


class ScenePointerMessage(Struct, tag_field="type"):
    """A click into the scene."""

    event_type: Literal["click"]
    ray_origin: _Spot
    ray_direction: _Place
    screen_pos: Annotated[list[tuple[_Away, _Away]], Meta(min_length=1, max_length=2)]
    modifier: _Name | None


class TransformControlsUpdateMessage(Struct, tag_field="type"):
    """A handle is dragged."""

    name: _Name
    wxyz: _Turn
    position: _Place
    owner: _Name = ""


class TransformControlsDragStartMessage(Struct, tag_field="type"):
    """A handle is guarded."""

    name: _Name
    owner: _Name = ""


class TransformControlsDragEndMessage(TransformControlsDragStartMessage, tag_field="type"):
    """A handle is let go."""


_DECODER = msgspec.msgpack.Decoder(
    GuiUpdateMessage
    | ViewerCameraMessage
    | ScenePointerMessage
    | TransformControlsUpdateMessage
    | TransformControlsDragStartMessage
    | TransformControlsDragEndMessage
)


class Refused(Exception):
    """What does not pass; nobody is told."""


class Incoming:
    """Looks at what the browsers of one server say.

    Attributes:
        server: a viser.ViserServer, which has the controls that values are meant for. Until there is one, none passes.
    """

    def __init__(self) -> None:
        self.server: Any = None

    def passed(self, sent: bytes | str) -> bytes | None:
        """What viser shall hear of a message: the same, a number in its bounds and no field more, or nothing."""
        if not isinstance(sent, bytes) or len(sent) > SMALL:
            return None
        try:
            message = _DECODER.decode(sent)
            if isinstance(message, GuiUpdateMessage):
                message.updates.value = fitted(self._control(message.uuid), message.updates.value)
            elif isinstance(message, TransformControlsUpdateMessage | ViewerCameraMessage):
                _check_turn(message.wxyz)
        except (msgspec.MsgspecError, ValueError, RecursionError, Refused):
            return None
        return msgspec.msgpack.encode(message)

    def _control(self, uuid: str) -> Any:
        """A control of the page that can be used now, by the name that viser gave it."""
        known = {} if self.server is None else self.server.gui._gui_input_handle_from_uuid
        control = known.get(uuid)
        if control is None or control.disabled or not control.visible:
            raise Refused
        return control


def fitted(control: Any, value: Any) -> Any:
    """A value as a control of the page may have it. Raises: Refused: it is no value of such a control."""
    match control:
        case viser.GuiButtonHandle():
            return True
        case viser.GuiCheckboxHandle() if isinstance(value, bool):
            return value
        case viser.GuiDropdownHandle() if isinstance(value, str) and value in control.options:
            return value
        case viser.GuiTextHandle() if isinstance(value, str):
            return "".join(c for c in value if unicodedata.category(c)[0] != "C")[:LONGEST]
        case viser.GuiNumberHandle() | viser.GuiSliderHandle():
            number = between(value, control.min, control.max)
            return round(number) if isinstance(control.value, int) else number
        case viser.GuiVector3Handle() if isinstance(value, list) and len(value) == 3:
            low, high = control.min or (None,) * 3, control.max or (None,) * 3
            return [between(number, *ends) for number, *ends in zip(value, low, high, strict=True)]
    raise Refused


def between(value: Any, low: float | None, high: float | None) -> float:
    """A number within bounds, FAR where there are none. Raises: Refused: it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise Refused
    return float(min(max(float(value), -FAR if low is None else low), FAR if high is None else high))  # NumPy ends, too


def _check_turn(wxyz: _Turn) -> None:
    """Raises: Refused: a quaternion is no rotation."""
    if abs(math.hypot(*wxyz) - 1.0) > UNIT:
        raise Refused


# --- The server: viser behind a door.

# messages of a browser that are heard in a second: a drag sends 60. The others wait, for all share one thread
RATE = 400

_replacing = threading.Lock()


class Host(str):
    """An address that a server is bound to, by which its door is known where viser passes only the address on."""

    door: Door
    incoming: Incoming
    guarded: bool


def open_server(host: str, port: int, door: Door, incoming: Incoming) -> Any:
    """A viser.ViserServer at an address that lets in whom the door lets in.

    Raises:
        MissingExtraError: this viser serves in another way, so that nobody would be at the door.
    """
    place = Host(host)
    place.door, place.incoming, place.guarded = door, incoming, False
    with _doors(), silent_viser():  # our own sentence says more than its banner
        server = viser.ViserServer(host=place, port=port, verbose=False)
    if not place.guarded:
        with silent_viser():
            server.stop()
        raise MissingExtraError(f"another viser than {viser.__version__}, which cannot be guarded", "studio")
    incoming.server = server
    return server


class _Served(library.serve):
    """websockets' own `serve`, with a door where the address has one."""

    def __init__(self, handler: Any, host: Any = None, port: Any = None, **given: Any) -> None:
        if isinstance(host, Host):
            host.guarded = True
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
            response = connection.respond(http.HTTPStatus.FORBIDDEN, f"{refused or TOKEN}\n")
        else:
            response = answer(connection, replace(request, path=inner(request.path)))
            if response is not None:
                response.headers["Content-Security-Policy"] = policy(hosts[0])
        if response is not None:
            for name, value in PAGE:
                response.headers[name] = value
        return response

    return process


def _listening(incoming: Incoming) -> Any:
    """A maker of connections that hear only what passes."""

    class Listening(library.ServerConnection):
        heard, second = 0, 0.0

        async def recv(self, *given: Any, **named: Any) -> Any:
            while True:
                received = await super().recv(*given, **named)
                await self._paced()
                message = incoming.passed(received)
                if message is not None:
                    return message

        async def _paced(self) -> None:
            now = time.monotonic()
            if now - self.second >= 1.0:
                self.heard, self.second = 0, now
            self.heard += 1
            if self.heard > RATE:
                await asyncio.sleep(self.second + 1.0 - now)

    return Listening
