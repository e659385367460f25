"""A link opens the state that it was made of, and a stranger's link opens no file and changes nothing."""

from __future__ import annotations

import base64
import json
import shutil
import socket
import time
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

import holokin as hk
from holokin.errors import HolokinError
from holokin.studios import View, open_session, session_of_state, state_text
from holokin.studios.state_link import LONGEST, MARK, UNPACKED, is_link
from sessions import panda, shifted

ARM = Path(hk.__file__).parent / "robot" / "data" / "planar-3r.toml"


def packed(data: Any) -> str:
    text = data if isinstance(data, bytes) else json.dumps(data).encode()
    return MARK + base64.urlsafe_b64encode(zlib.compress(text, 9)).decode().rstrip("=")


def unpacked(text: str) -> Any:
    body = text.removeprefix(MARK)
    return json.loads(zlib.decompress(base64.urlsafe_b64decode(body + "=" * (-len(body) % 4))))


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A session that was dragged, with a law on another leaf, and its state."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    session = panda()
    session.set_level("lock", [0.35])
    session.drag(shifted(-0.05, 0.1, 0.02))
    session.set_cycles(None)
    return session


def same(one: Any, other: Any) -> None:
    """Both stand, and go on, alike."""
    a, b = one.snapshot(), other.snapshot()
    assert (a.cycles, a.clockwise) == (b.cycles, b.clockwise)
    assert np.array_equal(a.target, b.target) and np.array_equal(one.home, other.home)
    assert one.loop.keys["at"] == other.loop.keys["at"] and one.loop.samples == other.loop.samples
    assert [law.name for law in one.laws] == [law.name for law in other.laws]
    for left, right in zip(a.laws, b.laws, strict=True):
        assert left.status is right.status
        assert np.abs(left.q - right.q).max() < 1e-9
        assert np.abs(left.level - right.level).max(initial=0.0) < 1e-12


def test_a_link_opens_robot_loop_laws_levels_and_postures_as_they_were(own: Any) -> None:
    view = View("deg, mm", "pseudo-inverse", 3.5)
    text = state_text(own, view)
    assert len(text) < 1500
    found = session_of_state(f"http://localhost:8080/some-token/?state={text}")
    same(own, found)
    assert found.view == view and is_link(text) and not is_link("panda-circle")
    away = own.drag(shifted(3.0))
    assert not away.following
    same(own, session_of_state(state_text(own)))


@pytest.mark.campaign
def test_the_loop_of_a_link_gives_the_drifts_of_the_session(own: Any) -> None:
    own.set_cycles(1)
    found = session_of_state(state_text(own))
    for session in (own, found):
        session.play()
        while session.advance(5.0).phase.value != "done":
            pass
    for left, right in zip(own.snapshot().laws, found.snapshot().laws, strict=True):
        assert right.drift == pytest.approx(left.drift, abs=1e-9)
    assert own.snapshot().law("pseudo-inverse").drift[-1] > 0.1


@pytest.mark.campaign
def test_a_file_is_in_a_link_by_its_digest_and_opens_beside_the_same_bytes_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    here, there = tmp_path / "here" / "mine.toml", tmp_path / "there" / "same.toml"
    for file in (here, there):
        shutil.copy(ARM, file)
    session = open_session(str(here))
    text = state_text(session)
    assert "mine" not in json.dumps(unpacked(text)["job"]["robot"]) and str(tmp_path) not in json.dumps(unpacked(text))
    found = session_of_state(text, open_session(str(there)))
    assert np.array_equal(found.home, session.home)
    same(found, session_of_state(state_text(found), found))
    for served in (None, open_session("ppr-cycle")):
        with pytest.raises(HolokinError, match="name the same file"):
            session_of_state(text, served)
    there.write_text(there.read_text("utf-8") + "# one byte more\n", "utf-8")
    with pytest.raises(HolokinError, match="name the same file"):
        session_of_state(text, open_session(str(there)))


def attacks(good: Any, file: str) -> dict[str, str]:
    """States of strangers."""

    def changed(*keys: str, value: Any) -> str:
        data = json.loads(json.dumps(good))
        inner = data
        for key in keys[:-1]:
            inner = inner.setdefault(key, {})
        inner[keys[-1]] = value
        return packed(data)

    law = next(iter(good["postures"]))
    robots = [file, "../../secret.urdf", "panda_description", "https://evil.example/a.urdf", "sha256:" + "0" * 64, ""]
    found = {f"robot {name}": changed("job", "robot", value={"name": name}) for name in robots}
    found |= {
        "part": changed("job", "robot", value={"parts": [{"name": "panda"}, {"name": file, "on": "panda"}]}),
        "args": changed("job", "robot", "args", value={"mesh": file}),
        "points": changed("job", "path", value={"kind": "waypoints", "file": file}),
        "drawing": changed("job", "path", value={"kind": "svg", "file": file, "width": 0.1}),
        "others": changed("job", "path", "others", value=[{"kind": "waypoints", "file": file}]),
        "program": changed("job", "program", value={"language": "rapid"}),
        "workspace": changed("job", "workspace", value={"kind": "poses", "file": file}),
        "key": changed("job", "surprise", value=1),
        "beside": changed("run", value="rm"),
        "code": changed("job", "strategies", value={"x": {"kind": "custom", "g": ["__import__('os').getpid()"]}}),
        "posture": changed("postures", law, value=[100.0] * 7),
        "too few": changed("postures", law, value=[0.1]),
        "speed": changed("speed", value=1e9),
        "cycles": changed("cycles", value=10**9),
        "target": changed("target", value=[[[1.0]], [[2.0], []]]),
        "list": packed([1, 2]),
        "deep": packed(b"[" * 5000),
        "bomb": packed(b" " * (UNPACKED + 1)),
        "large bomb": MARK + base64.urlsafe_b64encode(zlib.compress(b"0" * 3_000_000, 9)).decode()[:LONGEST],
        "long": MARK + "A" * LONGEST,
        "cut": packed(good)[:-9],
        "no base64": f"{MARK}%%%",
        "empty": MARK,
        "twice": f"http://localhost/?state={packed(good)}&state={packed(good)}",
        "none": "http://localhost/?state=",
        "NaN": packed(json.dumps(good).replace('"speed": 2.0', '"speed": NaN').encode()),
    }
    return found


def test_a_strangers_link_is_refused_with_a_sentence_and_no_file_is_opened(own: Any, tmp_path: Path) -> None:
    secret = tmp_path / "secret.toml"
    shutil.copy(ARM, secret)
    good = unpacked(state_text(own))
    opened: list[str] = []
    real = Path.open, Path.read_text, Path.read_bytes
    with pytest.MonkeyPatch.context() as patch:
        for method in real:

            def noted(self: Path, *given: Any, method: Any = method, **named: Any) -> Any:
                opened.append(str(self))
                return method(self, *given, **named)

            patch.setattr(Path, method.__name__, noted)
        for what, text in attacks(good, str(secret)).items():
            with pytest.raises(HolokinError) as refused:
                session_of_state(text, own)
            assert len(str(refused.value)) < 1000, what
    package = str(Path(hk.__file__).parent)
    assert [name for name in opened if not name.startswith(package)] == []


def test_the_studio_opens_a_link_of_its_own_once_and_none_without_the_token(
    own: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = state_text(own, View("deg, mm", "lock", 4.0))
    studio = hk.studio("ppr-cycle", port=0, browser=False, wait=False, tell=str)
    try:
        url, before = urlsplit(studio.url), studio.session
        head = f"Host: localhost:{url.port}\r\n"

        def asked(path: str, more: str = "") -> str:
            with socket.create_connection(("127.0.0.1", url.port or 80), timeout=10) as line:
                line.sendall(f"GET {path} HTTP/1.1\r\n{head}{more}\r\n".encode())
                return line.recv(65536).decode("utf-8", "replace")

        assert " 403 " in asked(f"/?state={text}") and " 403 " in asked(f"/{'x' * 32}/?state={text}")
        assert " 403 " in asked(f"{url.path}?state={text}", "Origin: http://evil.example\r\n")
        assert " 302 " in asked(f"{url.path}?state={packed({'job': {}})}")
        until(lambda: "The link was not opened" in studio.page.said)
        assert studio.session is before
        answer = asked(f"{url.path}?state={text}")
        assert " 302 " in answer and f"Location: {url.path}\r\n" in answer
        until(lambda: studio.session is not before)
        same(own, studio.session)
        until(lambda: studio.page.units.name == "deg, mm")
        page = studio.page
        assert page.session.laws[page.lead].name == "lock" and page.session.snapshot().factor == 4.0
        again = page.panels.save
        again._link()
        assert f"?state={MARK}" in again.made.content and studio.door.token not in again.made.content
    finally:
        studio.close()


def test_a_longer_request_than_a_link_has_is_refused_by_the_server() -> None:
    """The longest state fits into what the server reads of a line: 8192 bytes."""
    assert len(f"GET /{'t' * 32}/?state={'x' * LONGEST} HTTP/1.1\r\n") < 8192


def until(true: Any, seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)
