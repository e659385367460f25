"""The pictures of the gallery: `python docs/stills.py [PAGE...]` takes them of the recordings, in headless chromium."""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

sys.path.append(str(Path(__file__).parent))
from recordings import HERE, made_of, pages

from holokin.studios.playback import player

SIZE = {"width": 800, "height": 540}
BAR = 40
"""Height of the player's own bar, which is cut off."""

SHOWN = (640, 400)
COLORS = 240
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


class Quiet(SimpleHTTPRequestHandler):
    """A server that prints nothing."""

    def log_message(self, format: str, *args: object) -> None:
        """Nothing."""


def main(names: list[str]) -> None:
    """Take the picture of each page at the end of its recording."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        Path(folder, "player.html").write_text(player(), "utf-8")
        for name in names:
            for kind in (".viser", ".json"):
                shutil.copy(made_of(pages()[name]).with_suffix(kind), Path(folder, f"{name}{kind}"))
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name in names:
            page = browser.new_page(viewport=SIZE)
            page.set_default_timeout(120_000)  # without a graphics card all takes its time
            page.goto(f"http://127.0.0.1:{server.server_port}/player.html?playbackPath={name}.viser")
            slider = page.locator("[role=slider]")
            slider.wait_for(state="attached", timeout=120_000)
            page.add_style_tag(content=".mantine-Notifications-root { display: none }")
            page.keyboard.press("Space")  # it stands still
            end = float(slider.get_attribute("aria-valuemax")) - 1.5
            page.locator("input").first.fill(f"{end:.1f}")
            page.wait_for_timeout(6000)
            taken = Image.open(io.BytesIO(page.screenshot(timeout=120_000))).convert("RGB")
            whole = taken.crop((0, 0, taken.width, taken.height - BAR)).resize(SHOWN, Image.Resampling.LANCZOS)
            picture = whole.quantize(COLORS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
            file = HERE / "gallery" / f"{name}.png"
            picture.save(file, optimize=True)
            print(f"{file}: {file.stat().st_size / 1000:.0f} kB", flush=True)
            page.close()
        browser.close()
        server.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:] or list(pages()))
