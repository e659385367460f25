"""What browsers say to the studio: hostile messages change nothing that a control does not allow, and end no page."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from sessions import served, until

viser = pytest.importorskip("viser", reason="the extra `studio` is not installed")

import msgspec  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402
from websockets.sync.client import ClientConnection, connect  # noqa: E402

# A new one each time, to see that what was said before it has been heard
SPEEDS = itertools.cycle(0.25 * k for k in range(2, 33))

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 3], "fov": 0.7, "near": 0.01, "far": 1000,
    "image_height": 300, "image_width": 400, "look_at": [0, 0, 0], "up_direction": [0, 0, 1],
}  # fmt: skip
HANDLE = {"type": "TransformControlsUpdateMessage", "name": "/handles/tool", "wxyz": [1, 0, 0, 0], "owner": ""}
NUMBERS = [1e308, -1e308, math.nan, math.inf, -math.inf, 2**63 - 1, -(2**63), 1e-320]
NONSENSE: list[Any] = [
    "", "x", "../../etc/passwd", "1e308", [], [1.0], [math.nan] * 3, [1e308] * 3, [0.0] * 500, {}, None, b"",
    {"a": [1]}, [[1, 2, 3]] * 3, "\x00", "x" * 5000,
]  # fmt: skip


def joined(studio: Any) -> ClientConnection:
    """A client that has the address of the page, and has looked at it, as a browser does first."""
    url = urlsplit(studio.url)
    protocol: Any = f"viser-v{viser.__version__}"
    line = connect(f"ws://localhost:{url.port}{url.path}", subprotocols=[protocol], max_size=None, close_timeout=1)
    say(line, CAMERA)
    return line


def say(line: Any, message: Any) -> None:
    line.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))


def new(control: Any, value: Any) -> dict[str, Any]:
    """The message of a control that has a new value."""
    return {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": {"value": value}}


@pytest.fixture(scope="module")
def shown() -> Iterator[Any]:
    """A studio, a client that attacks it and one that looks on."""
    with served() as studio, joined(studio) as attacker, joined(studio) as witness:
        until(lambda: len(studio.server.get_clients()) == 2)
        yield SimpleNamespace(studio=studio, attacker=attacker, witness=witness)


def heard(shown: Any) -> None:
    """Wait until all that the attacker said has been heard: the speed that it says last is set."""
    panels = shown.studio.page.panels
    wanted = next(SPEEDS)
    say(shown.attacker, new(panels.speed, wanted))
    until(lambda: panels.speed.value == wanted)
    time.sleep(0.02)


def lives(shown: Any) -> None:
    """The page goes on for all: who looks on hears news, and who comes now finds everything."""
    for line in (shown.witness, shown.attacker):
        while True:  # what has come before
            try:
                line.recv(timeout=0.0)
            except TimeoutError:
                break
    shown.studio.page.panels.doing.content += " "
    assert shown.witness.recv(timeout=5.0)
    with joined(shown.studio) as late:
        assert sum(len(late.recv(timeout=5.0)) for _ in range(1)) > 1000


def controls(studio: Any) -> list[Any]:
    return list(studio.server.gui._gui_input_handle_from_uuid.values())


def sound(control: Any) -> bool:
    """Whether the value of a control is one that the page itself could set."""
    value = control.value
    if isinstance(control, viser.GuiDropdownHandle):
        return value in control.options
    if isinstance(control, viser.GuiNumberHandle | viser.GuiSliderHandle):
        return math.isfinite(value) and control.min <= value <= control.max and type(value) in (int, float)
    if isinstance(control, viser.GuiVector3Handle):
        return len(value) == 3 and all(-1e3 <= one <= 1e3 for one in value)
    if isinstance(control, viser.GuiTextHandle):
        return isinstance(value, str) and len(value) <= 200 and "\x00" not in value
    return isinstance(value, bool)


@pytest.mark.campaign
def test_no_value_of_any_control_is_taken_that_the_page_could_not_set(shown: Any) -> None:
    """Of all controls: a choice is one of its options, a number finite and within its bounds, a text short."""
    found = controls(shown.studio)
    kinds = {"Button", "Checkbox", "Dropdown", "Number", "Slider", "Text", "Vector3"}
    assert {type(one).__name__ for one in found} == {f"Gui{kind}Handle" for kind in kinds}
    spared = {"Open this job", "Record to HTML", "Go two paths to the tool's place"}
    for control in found:
        if control.label in spared:  # they do what they do, whatever value is sent
            continue
        for value in NUMBERS + NONSENSE:
            say(shown.attacker, new(control, value))
        heard(shown)
        assert sound(control), (control.label, control.value)
    shown.studio.session.stop()
    lives(shown)


@pytest.mark.parametrize("value", [-1.0, 0.5, 2.0])
def test_a_number_between_ends_of_numpy_can_be_sent_on(value: float) -> None:
    """A slider of a joint has its limits as ends, and an array's numbers are no message."""
    from holokin.app.studio.gate import between

    found = between(value, np.float64(0.0), np.float64(1.0))
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(found)) == min(max(value, 0.0), 1.0)


@pytest.mark.parametrize(("sent", "kept"), [(1e308, 10_000), (-7, 0), (2.6, 3), (12, 12), (2**63 - 1, 10_000)])
def test_a_number_of_cycles_is_clamped_before_anyone_else_hears_of_it(shown: Any, sent: float, kept: int) -> None:
    cycles = shown.studio.page.panels.cycles
    cycles.value = 5
    say(shown.attacker, new(cycles, sent))
    until(lambda: cycles.value == kept)
    until(lambda: shown.studio.session.snapshot().cycles == (kept or None))
    lives(shown)


def test_a_path_instead_of_a_packaged_job_opens_nothing_and_runs_nothing(shown: Any, tmp_path: Path) -> None:
    """Nor does it tell whether there is such a file."""
    proof = tmp_path / "ran"
    bad = tmp_path / "bad.xacro"
    bad.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="a"/>'
        f"<xacro:property name='x' value='${{(lambda: open({str(proof)!r}, \"w\"))()}}'/></robot>"
    )
    studio = shown.studio
    panels, source = studio.page.panels, studio.session.source
    for path in (str(bad), str(tmp_path / "none.xacro"), "../ppr-cycle", "ppr-cycle\x00", "/etc/passwd", "panda", ""):
        before = studio.page.message
        say(shown.attacker, new(panels.job, path))
        heard(shown)
        assert panels.job.value in panels.job.options
        assert studio.session.source == source and studio.page.message == before
    for path in (str(bad), str(tmp_path / "none.xacro")):  # and were the choice another, it would still not be opened
        studio._reopen(path)
        assert studio.session.source == source and not proof.exists()
        assert "unknown job of the page" in studio.page.message
    studio.page.say("")
    lives(shown)


@pytest.mark.parametrize(
    "updates",
    [
        {"max": 1e308}, {"label": "<script>alert(1)</script>"}, {"update_cb": []}, {"sync_cb": None}, {"removed": True},
        {"props": None}, {"uuid": "x"}, {"value": 3, "removed": True}, {"options": ["/etc/passwd"]}, {},
        {"is_button": True},
    ],
    ids=str,
)  # fmt: skip
def test_nothing_but_the_value_of_a_control_is_changed(shown: Any, updates: dict[str, Any]) -> None:
    panels = shown.studio.page.panels
    for control in (panels.cycles, panels.job, panels.start):
        state = control._impl
        before = (dict(vars(state)), control.label)
        say(shown.attacker, {"type": "GuiUpdateMessage", "uuid": state.uuid, "updates": updates})
        heard(shown)
        assert (dict(vars(state)), control.label) == before
    lives(shown)


def test_what_cannot_be_pressed_is_not_pressed(shown: Any) -> None:
    loop, session = shown.studio.page.panels.loop, shown.studio.session
    loop.close.disabled = True
    number = session.snapshot().loop
    shown.studio.page.say("")
    say(shown.attacker, new(loop.close, True))
    heard(shown)
    assert session.snapshot().loop == number and shown.studio.page.message == ""


def test_a_handle_is_dragged_to_no_place_that_is_none(shown: Any) -> None:
    session = shown.studio.session
    session.reset()
    before = session.snapshot().target
    nowhere: list[Any] = [[math.nan, 0, 0], [1e308, 0, 0], [math.inf, 0, 0], [0, 0], ["x", 0, 0], [0, 0, 0, 0]]
    for position in [*nowhere, 2000.0, [2000, 0, 0]]:
        say(shown.attacker, HANDLE | {"position": position})
    for wxyz in ([0, 0, 0, 0], [2, 0, 0, 0], [math.nan] * 4, [1, 0, 0], [1e308] * 4, None):
        say(shown.attacker, HANDLE | {"position": [0.1, 0.1, 0], "wxyz": wxyz})
    for name in ("/handles/none", "/robot", "x" * 5000, None):
        say(shown.attacker, HANDLE | {"position": [0.1, 0.1, 0], "name": name})
    heard(shown)
    time.sleep(0.1)
    assert np.array_equal(session.snapshot().target, before)
    start = {"type": "TransformControlsDragStartMessage", "name": "/handles/tool", "owner": ""}
    say(shown.attacker, start)
    say(shown.attacker, HANDLE | {"position": [1000, -1000, 0]})  # far, and told so: the strategies stay in reach
    until(lambda: not np.array_equal(session.snapshot().target, before))
    say(shown.attacker, start | {"type": "TransformControlsDragEndMessage"})
    heard(shown)
    assert all(np.isfinite(strategy.q).all() for strategy in session.snapshot().strategies)
    session.drag(before)
    session.reset()
    lives(shown)


def test_a_camera_is_one(shown: Any) -> None:
    clients = shown.studio.server.get_clients()
    client = clients[min(clients)]
    bad: dict[str, list[Any]] = {
        "wxyz": [[math.nan, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0], "x"], "position": [[1e308, 0, 0], [0, 0], None],
        "fov": [math.nan, 0, -1, 4, 1e308], "near": [0, -1, math.inf], "image_height": [-1, 2**40, 1.5, "9"],
        "image_width": [2**63, math.nan], "look_at": [[math.nan] * 3], "up_direction": [[math.inf, 0, 0]], "extra": [],
    }  # fmt: skip
    for key, values in bad.items():
        for value in values:
            say(shown.attacker, CAMERA | {key: value})
        say(shown.attacker, {k: v for k, v in CAMERA.items() if k != key} | ({"type": "?"} if key == "extra" else {}))
    heard(shown)
    state = client.camera._state
    assert (state.fov, state.image_height, state.image_width) == (0.7, 300, 400)
    assert np.isfinite([*state.wxyz, *state.position, *state.look_at, *state.up_direction]).all()
    lives(shown)


def test_messages_of_viser_that_the_page_never_sends_do_nothing(shown: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Above all none opens a tunnel from the internet to the studio."""
    asked: list[str] = []
    server = shown.studio.server
    monkeypatch.setattr(server, "request_share_url", lambda *_a, **_n: asked.append("share"))
    monkeypatch.setattr(server, "disconnect_share_url", lambda *_a, **_n: asked.append("share"))
    name = shown.studio.page.panels.cycles._impl.uuid
    upload = {"source_component_uuid": name, "transfer_uuid": "t"}
    said: list[dict[str, Any]] = [
        {"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}, {"type": "GuiFormDirtyMessage", "uuid": name},
        {"type": "GuiFormSubmitMessage", "uuid": name}, {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "ResetGuiMessage"}, {"type": "GuiRemoveMessage", "uuid": name},
        {"type": "CommandTriggerMessage", "uuid": name}, {"type": "SceneNodeClickMessage", "name": "/robot"},
        {"type": "GuiButtonHoldMessage", "uuid": name, "frequency": 1e9},
        {"type": "FileTransferStartUpload", **upload, "filename": "../x", "mime_type": "", "part_count": 10**9,
         "size_bytes": 10**12},
        {"type": "FileTransferPart", **upload, "part_index": 0, "content": b"x"},
        {"type": "ScenePointerMessage", "event_type": "click", "ray_origin": None, "ray_direction": None,
         "screen_pos": [], "modifier": None},
        {"type": "Message"}, {"type": "object"}, {"type": 1}, {},
    ]  # fmt: skip
    for message in said:
        say(shown.attacker, message)
    heard(shown)
    assert asked == [] and server.gui._current_file_upload_states == {}
    lives(shown)


def test_garbage_does_nothing(shown: Any) -> None:
    rng = np.random.default_rng(3)
    good = msgspec.msgpack.encode(new(shown.studio.page.panels.cycles, 7))
    endless = [kind + b"\xff" * 4 for kind in (b"\xdd", b"\xdf", b"\xc6")]  # a list, a map, bytes of 2^32
    for raw in (b"", b"\xc1", b"\x91" * 4000, b"\x81" * 4000, *endless):
        say(shown.attacker, raw)
    for _ in range(150):
        mutant = bytearray(good)
        for at in rng.integers(0, len(mutant), rng.integers(1, 6)):
            mutant[at] = rng.integers(0, 256)
        say(shown.attacker, bytes(mutant))
        say(shown.attacker, rng.bytes(int(rng.integers(0, 300))))
    say(shown.attacker, "a text, where bytes are due")
    say(shown.attacker, "{" * 10_000)
    say(shown.attacker, b"\x00" * 100_000)
    heard(shown)
    assert all(sound(control) for control in controls(shown.studio))
    lives(shown)


def test_a_huge_message_ends_the_connection_of_its_sender_alone(shown: Any) -> None:
    with joined(shown.studio) as other:
        say(other, b"\x00" * (17 * 2**20))
        with pytest.raises(ConnectionClosed):
            while True:
                other.recv(timeout=10.0)
    lives(shown)


@pytest.mark.campaign
def test_a_flood_of_messages_waits_for_the_others(shown: Any) -> None:
    """Of 800 messages at once 400 are heard in a second; meanwhile another browser's button works."""
    panels, clients = shown.studio.page.panels, shown.studio.server.get_clients()
    camera = clients[min(clients)].camera
    for k in range(800):
        say(shown.attacker, CAMERA | {"image_width": 401 + k})
    checked = not panels.at_start.value
    say(shown.witness, new(panels.at_start, checked))
    until(lambda: panels.at_start.value is checked)
    assert camera.image_width < 401 + 799
    until(lambda: camera.image_width == 401 + 799)
    say(shown.attacker, CAMERA)
    heard(shown)


def test_many_presses_of_what_takes_long_are_one(shown: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """There are 32 threads for the clicks of all browsers; a button pressed 60 times leaves them to the others."""
    panels, calls, release = shown.studio.page.panels, [], threading.Event()

    def slow() -> None:
        calls.append(release.wait(30.0))

    monkeypatch.setattr(panels.loop, "_two_paths", slow)
    for _ in range(60):
        say(shown.attacker, new(panels.loop.two_paths, True))
    heard(shown)
    say(shown.witness, new(panels.cycles, 17))
    until(lambda: shown.studio.session.snapshot().cycles == 17)
    assert not calls  # it is still at it
    release.set()
    until(lambda: calls)
    time.sleep(0.1)
    assert calls == [True]


def test_corners_are_near_and_not_many(shown: Any) -> None:
    handles, page = shown.studio.page.handles, shown.studio.page
    down, flat = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, -1e-6])
    handles.start_corners()
    handles.add_corner(np.array([0.0, 0.0, 2.0]), flat)
    assert handles.corners == [] and "within 100 m" in page.message
    for k in range(55):
        handles.add_corner(np.array([0.001 * k, 0.0, 2.0]), down)
    assert len(handles.corners) == 50
    handles.stop_corners()
    page.say("")
