"""How many laws the studio moves at 30 frames a second, and how soon a dragged tool is answered: a Panda, in memory.

python -m benchmarks.studio [--quick] [--browser]

A session of the studio without its page: on a loop every law makes its steps, and a snapshot of all that is drawn is
made, for each frame; on a drag every law follows the tool by 2 mm, and out of reach none can. Processor time of the
thread, so that what else the machine does counts little; medians, and the worst.

With --browser the page is served, eight laws run with their plots, and what arrives is counted: postures a second at a
headless chromium that draws them without a graphics card, and at 1, 3 and 8 clients that only listen.
"""

from __future__ import annotations

import argparse
import shutil
import threading
import time
from collections.abc import Callable

import numpy as np

import holokin as hk
from holokin.app.studio import Law, Phase, Session, circle_loop, default_laws

START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
RATE = 30.0
"""Frames a second."""

STEP = 0.002
"""The tool's way from one drag to the next [m]: 0.12 m/s with a mouse that tells 60 times a second."""


def session(count: int) -> Session:
    """So many laws of a Panda, the default ones again and again, on a circle of 0.1 m."""
    robot = hk.load("panda")
    task, tool = hk.pose(robot), robot.pose(START)[:3, 3]
    kinds = default_laws(task, START)
    laws = [Law(f"{kinds[i % len(kinds)].name} {i}", i, kinds[i % len(kinds)].rule, task) for i in range(count)]
    return Session(laws, START, circle_loop(tool - [0.1, 0, 0], 0.1, near=tool))


def milliseconds(call: Callable[[], object]) -> float:
    """Processor time of a call."""
    began = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - began)


def frames(subject: Session, count: int) -> list[float]:
    """Milliseconds of each frame of a loop that runs, once all laws are compiled."""
    while subject.play().phase is Phase.GATHERING:
        subject.advance(1 / RATE)
    return [milliseconds(lambda: subject.advance(1 / RATE)) for _ in range(count)]


def drags(subject: Session, count: int, *, out: bool = False) -> list[float]:
    """Milliseconds of drags round a circle of the tool; or out of reach, each a little farther than the last."""
    pose = subject.reset().target[0].copy()
    found = []
    for k in range(count):
        if out:
            pose[0, 3] += 0.5 if k == 0 else STEP
        else:
            pose[:2, 3] += STEP * np.array([np.cos(k / 20), np.sin(k / 20)])
        found.append(milliseconds(lambda: subject.drag(pose)))
    return found


GHOSTS = b"/ghosts/"
"""What a message of the server that moves the robots has in it: the name of what it moves."""

HEADER = 16
"""Bytes before the compressed part of a message of viser: its size, and its compressed size, as 64 bits each."""

EIGHT, SECONDS, WARM = 8, 10.0, 5.0
"""Laws of the page; how long it is counted [s], once it has run for so long."""


def moves(message: bytes | str) -> bool:
    """Whether a message of the server moves the robots."""
    import zstandard

    if not isinstance(message, bytes):
        return False
    size = int.from_bytes(message[8:HEADER], "little")
    return GHOSTS in zstandard.ZstdDecompressor().decompress(message[HEADER : HEADER + size])


def listen(url: str, counts: list[int], index: int, ended: threading.Event) -> None:
    """A client that draws nothing, and counts."""
    import viser
    from websockets.sync.client import connect

    with connect(url.replace("http", "ws"), subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as line:  # type: ignore[list-item]
        while not ended.is_set():
            try:
                counts[index] += moves(line.recv(timeout=1.0))
            except TimeoutError:
                continue


def counted(counts: list[int], seconds: float) -> tuple[list[float], float]:
    """How many a second come to each, and the share of a core that this process takes."""
    before, clock, busy = list(counts), time.perf_counter(), time.process_time()
    time.sleep(seconds)
    lasted = time.perf_counter() - clock
    return [(now - then) / lasted for now, then in zip(counts, before, strict=True)], (
        time.process_time() - busy
    ) / lasted


def listeners(studio: hk.app.studio.Studio, clients: int, seconds: float) -> tuple[list[float], float]:
    """What comes to so many clients that listen, a second, and the share of a core."""
    ended, counts = threading.Event(), [0] * clients
    hands = [threading.Thread(target=listen, args=(studio.url, counts, i, ended), daemon=True) for i in range(clients)]
    for hand in hands:
        hand.start()
    time.sleep(min(WARM, seconds))
    found = counted(counts, seconds)
    ended.set()
    for hand in hands:
        hand.join(5.0)
    return found


def chromium(studio: hk.app.studio.Studio, seconds: float) -> tuple[list[float], float]:
    """The same of a headless chromium that draws the page by software."""
    from playwright.sync_api import sync_playwright

    counts = [0]
    flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-dev-shm-usage"]

    def heard(payload: bytes | str) -> None:
        counts[0] += moves(payload)

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1120, "height": 560})
        page.on("websocket", lambda line: line.on("framereceived", heard))
        page.goto(f"{studio.url}?fixedDpr=0.5")
        page.get_by_role("button", name="Pause", exact=True).wait_for(timeout=120_000)
        page.wait_for_timeout(1e3 * WARM)
        before, clock, busy = counts[0], time.perf_counter(), time.process_time()
        page.wait_for_timeout(1e3 * seconds)  # playwright hears while it waits
        lasted = time.perf_counter() - clock
        found = [(counts[0] - before) / lasted], (time.process_time() - busy) / lasted
        browser.close()
    return found


def browsers(seconds: float) -> None:
    """Print what arrives at browsers on a page of eight laws that run."""
    subject = session(EIGHT)
    subject.set_cycles(None)
    studio = hk.studio(subject, port=0, browser=False, wait=False, tell=lambda _text: None)
    while not all(state.judgement for state in subject.snapshot().laws):
        time.sleep(0.2)
    subject.play()
    print(f"\n{EIGHT} laws with plots, {RATE:.0f} pictures a second wanted; what arrives a second; share of a core")
    for name, measure in (
        ("chromium, drawn by software", lambda: chromium(studio, seconds)),
        *((f"{n} listening", lambda n=n: listeners(studio, n, seconds)) for n in (1, 3, 8)),
    ):
        rates, share = measure()
        print(f"{name:30}{min(rates):6.1f} to {max(rates):5.1f}{share:8.2f}", flush=True)
    studio.close()


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few laws, frames and drags")
    parser.add_argument("--browser", action="store_true", help="what arrives at browsers, too (playwright, chromium)")
    chosen = parser.parse_args(arguments)
    quick = chosen.quick
    sizes, count = ((4,), 4) if quick else ((1, 4, 8, 60), 300)
    print(f"{'':6}{'a frame of the loop [ms]':>28}{'updates':>10}{'a drag [ms]':>18}{'out of reach [ms]':>20}")
    print(f"{'laws':6}{'median':>14}{'worst':>14}{'a second':>10}{'median':>9}{'worst':>9}{'median':>10}{'worst':>10}")
    for size in sizes:
        subject = session(size)
        subject.start_work()
        while not quick and not all(state.judgement for state in subject.snapshot().laws):
            time.sleep(0.1)  # all are compiled
        subject.close()
        loop, drag = frames(subject, count), drags(subject, count)
        away = drags(subject, 2 if quick else 30, out=True)
        numbers = f"{np.median(loop):14.2f}{max(loop):14.2f}{1e3 / np.median(loop):10.0f}"
        print(f"{size:<6}{numbers}{np.median(drag):9.2f}{max(drag):9.2f}{np.median(away):10.1f}{max(away):10.1f}")
    print("\nprocessor time of one thread; a drag moves the tool by 2 mm")
    if chosen.browser:
        browsers(1.0 if quick else SECONDS)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
