"""Who comes in to the studio: requests and handshakes with a wrong host, origin or token, each wrong alone."""

from __future__ import annotations

import itertools
import os
import socket
import stat
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

import holokin as hk
from holokin.app.studio import Motion, record, to_job
from holokin.app.studio.door import LOOPBACK, Door, inner
from holokin.base.errors import MissingExtraError
from sessions import served

viser = pytest.importorskip("viser", reason="the extra `studio` is not installed")

HANDSHAKE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: viser-v{viser.__version__}\r\n"
)


@pytest.fixture(scope="module")
def studio() -> Iterator[Any]:
    with served() as page:
        yield page


def answer(port: int, path: str, lines: str, handshake: bool) -> str:
    """What a server answers to a request that is written by hand: its head, and for a refusal its body."""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\n{lines}{HANDSHAKE if handshake else ''}\r\n".encode())
        heard = b""
        while b"\r\n\r\n" not in heard and (piece := line.recv(65536)):
            heard += piece
        if b" 403 " in heard[:20]:
            while piece := line.recv(65536):
                heard += piece
    return heard.decode("utf-8", "replace")


def status(text: str) -> int:
    return int(text.split(" ")[1])


def place(studio: Any) -> tuple[int, str]:
    """The port of a studio, and the path of its page."""
    url = urlsplit(studio.url)
    return int(url.port or 80), url.path or "/"


def wrong_hosts(port: int) -> list[str]:
    other = [f"evil.example:{port}", f"127.0.0.1.evil.example:{port}", f"localhost.evil.example:{port}"]
    near = [f"127.0.0.1:{port + 1}", "localhost", "127.0.0.1", f"0.0.0.0:{port}", f"127.0.0.2:{port}", f"[::]:{port}"]
    odd = [f"localhost:{port}:{port}", f"localhost:0{port}", f"a@localhost:{port}", f"localhost.:{port}"]
    return other + near + odd + ["", ":", f":{port}"]


@pytest.mark.parametrize("handshake", [False, True], ids=["page", "websocket"])
def test_whoever_calls_the_studio_by_its_own_name_with_its_token_comes_in(studio: Any, handshake: bool) -> None:
    port, path = place(studio)
    for name in sorted(LOOPBACK):
        for origin in ("", f"Origin: http://{name}:{port}\r\n", f"Origin: http://{name.upper()}:{port}\r\n"):
            found = answer(port, path, f"Host: {name}:{port}\r\n{origin}", handshake)
            assert status(found) == (101 if handshake else 200), (name, origin)


@pytest.mark.parametrize("handshake", [False, True], ids=["page", "websocket"])
def test_a_wrong_host_alone_is_refused_so_that_no_name_can_be_pointed_at_the_studio(
    studio: Any, handshake: bool
) -> None:
    port, path = place(studio)
    for host in wrong_hosts(port):
        found = answer(port, path, f"Host: {host}\r\n", handshake)
        assert status(found) == 403 and "not a name of the studio" in found, host
        same = answer(port, path, f"Host: {host}\r\nOrigin: http://{host}\r\n", handshake)
        assert status(same) == 403, host
    twice = answer(port, path, f"Host: localhost:{port}\r\nHost: localhost:{port}\r\n", handshake)
    assert status(twice) == status(answer(port, path, "", handshake)) == 403


@pytest.mark.parametrize("handshake", [False, True], ids=["page", "websocket"])
def test_a_page_of_another_origin_alone_is_refused(studio: Any, handshake: bool) -> None:
    port, path = place(studio)
    others = [
        "http://evil.example", "null", "", "file://", f"https://localhost:{port}", f"http://localhost:{port + 1}",
        f"http://127.0.0.1:{port}", f"http://localhost:{port}.evil.example", f"http://localhost:{port}/", "localhost",
    ]  # fmt: skip
    for origin in others:
        found = answer(port, path, f"Host: localhost:{port}\r\nOrigin: {origin}\r\n", handshake)
        assert status(found) == 403 and "own page" in found, origin
    two = f"Host: localhost:{port}\r\nOrigin: http://localhost:{port}\r\nOrigin: http://evil.example\r\n"
    assert status(answer(port, path, two, handshake)) == 403


@pytest.mark.parametrize("handshake", [False, True], ids=["page", "websocket"])
def test_a_missing_or_wrong_token_alone_is_refused(studio: Any, handshake: bool) -> None:
    port, path = place(studio)
    token = path.strip("/")
    assert len(token) >= 32
    head = f"Host: localhost:{port}\r\nOrigin: http://localhost:{port}\r\n"
    wrong = [
        "/", "//", "/index.html", f"/{token[:-1]}", f"/{token}x", f"/x/{token}", f"//{token}", f"/{token.swapcase()}",
        f"/?token={token}", f"/../{token}", f"/{'x' * len(token)}", "/assets/x.js", f"/%{ord(token[0]):x}{token[1:]}",
        "/" + "y" * 5000,
    ]  # fmt: skip
    for bad in wrong:
        found = answer(port, bad, head, handshake)
        assert status(found) == 403 and "printed when it was started" in found and token not in found, bad
    elsewhere = f"{head}Cookie: token={token}\r\nAuthorization: Bearer {token}\r\n"
    assert status(answer(port, "/", elsewhere, handshake)) == 403


def test_nothing_beside_the_page_is_served_even_to_who_has_the_token(studio: Any) -> None:
    port, path = place(studio)
    for name in ("../../_viser.py", "..%2f..%2f_viser.py", "nothing.js", "%2e%2e/index.html"):
        assert status(answer(port, path + name, f"Host: localhost:{port}\r\n", False)) == 404


def test_all_answers_keep_the_address_secret_and_the_page_out_of_frames(studio: Any) -> None:
    port, path = place(studio)
    for place_, host in itertools.product((path, "/", f"{path}nothing"), (f"localhost:{port}", "evil.example")):
        head = answer(port, place_, f"Host: {host}\r\n", False)
        for line in ("Referrer-Policy: no-referrer", "X-Frame-Options: DENY", "Cache-Control: no-store"):
            assert line in head
    page = answer(port, path, f"Host: localhost:{port}\r\n", False)
    assert f"connect-src 'self' ws://localhost:{port} blob: data:;" in page and "frame-ancestors 'none'" in page


def test_the_browser_is_started_by_a_file_that_only_its_user_reads(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Arguments of programs are seen by all users of a machine: they hold no address of the studio."""
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setenv("HOME", str(tmp_path))
    before = os.umask(0)  # of a user whose new files all others may read and write
    try:
        with served(browser=True) as studio:
            port, path = place(studio)
            (address,) = opened
            file = Path(urlsplit(address).path)
            assert address.startswith("file:///") and str(port) not in address and path.strip("/") not in address
            assert (stat.S_IMODE(file.stat().st_mode), stat.S_IMODE(file.parent.stat().st_mode)) == (0o600, 0o700)
            assert f'content="0; url={studio.url}"' in file.read_text()
            assert status(answer(port, path, f"Host: localhost:{port}\r\n", False)) == 200
    finally:
        os.umask(before)
    assert list(tmp_path.iterdir()) == []


def test_every_studio_has_a_token_of_its_own() -> None:
    assert len({Door("127.0.0.1").token for _ in range(100)}) == 100


@pytest.mark.parametrize(
    ("host", "known", "unknown"),
    [
        ("127.0.0.1", ["localhost:80", "localhost", "127.0.0.1", "[::1]"], ["192.168.1.5", "MACHINE", "127.0.0.9"]),
        ("127.0.0.9", ["127.0.0.9"], ["192.168.1.5"]),
        ("::1", ["[::1]", "[::1]:80"], ["[::2]", "::1"]),
        ("192.168.1.5", ["192.168.1.5", "MACHINE", "MACHINE.local"], ["localhost", "192.168.1.6", "evil.example"]),
        ("lab.example", ["lab.example", "LAB.example:80", "MACHINE"], ["192.168.1.5", "evil.example"]),
        ("0.0.0.0", ["192.168.1.5", "[fd00::1]", "localhost", "MACHINE"], ["evil.example", "0.0.0.0", "1.2.3"]),
        ("::", ["192.168.1.5", "[fd00::1]:80", "MACHINE.local"], ["evil.example", "[::]", "[::1"]),
    ],
)
def test_a_host_is_known_by_its_own_names_alone(host: str, known: list[str], unknown: list[str]) -> None:
    """Numbers may stand for all addresses of a machine: nobody can point a number elsewhere, as a name."""
    door, machine = Door(host), socket.gethostname()
    for name in known:
        assert door.stranger(80, [name.replace("MACHINE", machine)], []) == "", name
        assert door.stranger(81, [name.replace("MACHINE", machine)], []) != "", name
    for name in unknown:
        assert door.stranger(80, [name.replace("MACHINE", machine)], []) != "", name


def test_a_host_that_others_reach_says_what_it_opens_and_prints_an_address_that_opens() -> None:
    said: list[str] = []
    with served(host="0.0.0.0", progress=said.append) as studio:
        port, path = place(studio)
        assert "open to the network at 0.0.0.0" in said[0] and "nothing is encrypted" in said[0]
        assert f"http://{socket.gethostname()}:{port}{path}" in said[0]
        assert said[1].startswith(f"the studio is at http://localhost:{port}{path}")
        for host in ("localhost", socket.gethostname(), "192.168.77.5"):
            assert status(answer(port, path, f"Host: {host}:{port}\r\n", True)) == 101
        for host in ("evil.example", "0.0.0.0"):
            assert status(answer(port, path, f"Host: {host}:{port}\r\n", True)) == 403
        assert status(answer(port, "/", f"Host: 192.168.77.5:{port}\r\n", True)) == 403


def test_a_recording_is_made_behind_a_door_whose_token_nobody_knows() -> None:
    from holokin.app.studio import playback

    server = playback._quiet_server()
    try:
        port = server.get_port()
        for path, handshake in itertools.product(("/", "/index.html"), (False, True)):
            assert status(answer(port, path, f"Host: localhost:{port}\r\n", handshake)) == 403
    finally:
        server.stop()


def test_the_token_is_in_nothing_that_leaves_the_page(studio: Any) -> None:
    session, token = studio.session, studio.door.token
    motion = Motion(np.array([0.0, 0.1]), np.stack([session.home, session.home + 0.1]))
    made = record(session.robot, {"strategy": motion}, seconds=0.1)
    assert token not in made.html() and token not in to_job(session)
    kept = studio.server._websock_server._broadcast_buffer.message_from_id
    assert len(kept) > 50 and not [message for message in kept.values() if token in repr(message)]


def test_a_viser_that_cannot_be_guarded_is_not_served(monkeypatch: pytest.MonkeyPatch) -> None:
    from holokin.app.studio import gate

    monkeypatch.setattr(gate, "_Served", gate.library.serve)  # as if it did not call what is put in
    with pytest.raises(MissingExtraError, match="cannot be guarded"):
        hk.studio("ppr-cycle", port=0, browser=False, wait=False, progress=str)


def test_other_websockets_servers_of_the_program_have_no_door(studio: Any) -> None:
    """The check is put in where viser is started, for its own address alone, and taken out again."""
    from websockets.asyncio import server as library

    from holokin.app.studio import gate

    assert library.serve is not gate._Served
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        assert status(answer(server.get_port(), "/", "Host: elsewhere\r\n", False)) == 200
    finally:
        server.stop()


def test_a_path_is_served_without_its_token() -> None:
    rng = np.random.default_rng(26)
    for _ in range(200):
        parts = ["".join(rng.choice(list("ab./%"), rng.integers(0, 6))).replace("/", "") for _ in range(3)]
        tail = "/".join(parts[1:])
        assert inner(f"/{parts[0]}/{tail}?x=/y") == f"/{tail}?x=/y"
    assert inner("/token") == inner("/token/") == "/"
