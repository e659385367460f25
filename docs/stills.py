"""Pictures in headless chromium: `python docs/stills.py [NAME...]` takes those of the gallery, of its recordings.

`python docs/stills.py studio` takes that of the studio's own page.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

sys.path.append(str(Path(__file__).parent))
from recordings import HERE, made_of, sections

from holokin.app.studio.playback import player

SIZE = (800, 500)
BAR = 40
"""Height of the player's own bar, which is cut off."""

SHOWN = (640, 400)

PAGE = {"width": 1200, "height": 740}
"""Of the studio, whose letters are then large enough on a page."""

JOB = """
title = "A Panda draws circles"
[robot]
name = "example-robot-data:panda"
tip = "panda_hand_tcp"
locked = { panda_finger_joint1 = 0.02, panda_finger_joint2 = 0.02 }
[task]
kind = "pose"
[start]
q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
[path]
kind = "circle"
center = [-0.1, 0, 0]
normal = [0, 0, 1]
relative = true
speed = 0.1
cycles = 3
[strategies.pseudo-inverse]
kind = "moore-penrose"
[strategies."joint 3 locked"]
kind = "lock"
joints = ["panda_joint3"]
[strategies."arm angle held"]
kind = "arm-angle"
"""
"""What the studio shows in its picture."""

SILENT = ".mantine-Notifications-root { display: none }"
"""No message that there is no graphics card."""

COLORS = 240
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


class Quiet(SimpleHTTPRequestHandler):
    """A server that prints nothing."""

    def log_message(self, format: str, *args: object) -> None:
        """Nothing."""


def main(names: list[str]) -> None:
    """Take the picture of each recording at its end."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "player.html").write_text(player(), "utf-8")
        for name in names:
            for kind in (".viser", ".json"):
                shutil.copy(made_of(name).with_suffix(kind), Path(folder, f"{name}{kind}"))
        files = {name: f"player.html?playbackPath={name}.viser" for name in names}
        for name, picture in stills(folder, files):
            save(picture.resize(SHOWN, Image.Resampling.LANCZOS), HERE / "gallery" / f"{name}.png")


def studio() -> None:
    """The studio's own page after three circles of a Panda with the meshes of its maker."""
    import holokin as hk

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        Path(folder, "panda.toml").write_text(JOB, "utf-8")
        shown = hk.studio(f"{folder}/panda.toml", browser=False, wait=False, port=0, progress=lambda _text: None)
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport=PAGE, device_scale_factor=1.4)
        page.set_default_timeout(120_000)
        page.goto(shown.url)
        page.add_style_tag(content=SILENT)
        page.get_by_role("button", name="Start", exact=True).click()
        page.get_by_text("Done: 3 cycles").wait_for()
        page.wait_for_timeout(8000)
        taken = Image.open(io.BytesIO(page.screenshot(timeout=120_000))).convert("RGB")
        browser.close()
        shown.close()
    save(taken, HERE / "pictures" / "studio.png")


def save(picture: Image.Image, file: Path) -> None:
    """As a PNG of few colours."""
    few = picture.quantize(COLORS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(file, optimize=True)
    print(f"{file}: {file.stat().st_size / 1000:.0f} kB", flush=True)


def stills(folder: str, files: dict[str, str]) -> Iterator[tuple[str, Image.Image]]:
    """(name, picture) of the end of each recording, a page of a folder."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name, file in files.items():
            window = {"width": SIZE[0], "height": SIZE[1] + BAR}
            page = browser.new_page(viewport=window)
            page.set_default_timeout(120_000)  # without a graphics card all takes its time
            page.goto(f"http://127.0.0.1:{server.server_port}/{file}")
            slider = page.locator("[role=slider]")
            slider.wait_for(state="attached", timeout=120_000)
            page.add_style_tag(content=SILENT)
            page.keyboard.press("Space")  # it stands still
            end = float(slider.get_attribute("aria-valuemax")) - 1.5
            page.locator("input").first.fill(f"{end:.1f}")
            page.wait_for_timeout(6000)
            taken = Image.open(io.BytesIO(page.screenshot(timeout=120_000))).convert("RGB")
            yield name, taken.crop((0, 0, taken.width, SIZE[1]))
            page.close()
        browser.close()
    server.shutdown()


if __name__ == "__main__":
    if sys.argv[1:] == ["studio"]:
        studio()
    else:
        main(sys.argv[1:] or list(sections()))
