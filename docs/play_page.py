"""The page docs/play/index.html: `python docs/play_page.py` makes it again. It needs zig, of `holokin[native]`.

The page is kept beside its sources, so that the site can be built without a compiler. A test compares the two.
`python docs/play_page.py --picture` takes the gallery's picture of it, in headless chromium.
"""

from __future__ import annotations

import sys
from pathlib import Path

import holokin as hk
from holokin.app.studio import PageLoop, WebPage, cusp_loop, web_page

FILE = Path(__file__).parent / "play" / "index.html"
PICTURE = Path(__file__).parent / "pictures" / "play.png"

Q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
"""The start of the README's Panda."""

CUSP = (
    [-2.170729372113713, 1.3690924229288275, -2.070729372113713, -1.7642936736380397, -1.506071491481258,
     3.6717294994354273, -0.1929596234190993],
    [-1.9377003726986681, 1.025413296762297, -1.8377003726986685, -2.0607874349768878, -0.6818148684113225,
     3.3351065585361486, -1.3422306109761204],
)  # fmt: skip
"""Two postures of the leaf of Q0 with one tool pose: the README's loop of 5 cm leads from one to the other."""

TITLE = "Drag the loop: which arm comes to rest where it began?"

TEXT = (
    "Both arms are a Franka Panda, drawn as rods. The orange arm uses the pseudo-inverse, the usual strategy. The "
    "blue arm keeps the difference of its joints 1 and 3 constant. Drag the green ball to change the loop, or try the "
    "loop round a cusp, where the blue arm does not return."
)


def strategies() -> dict[str, hk.Strategy]:
    """The two strategies of the page."""
    task = hk.pose(hk.load("panda"))
    held = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))
    return {"pseudo-inverse": hk.moore_penrose(task), "q1 - q3 held": held}


def cusp() -> PageLoop:
    """The loop round a cusp."""
    witness = hk.analysis.curvature.witness_between(strategies()["q1 - q3 held"], *CUSP)
    if witness is None:
        raise SystemExit("no loop leads from one posture to the other")
    return cusp_loop(witness, "q1 - q3")


def made() -> WebPage:
    """The page."""
    start = hk.load("panda").pose(Q0)[:3, 3]
    circle = hk.circle(start, center=start - [0.1, 0, 0])
    return web_page(strategies(), Q0, circle, title=TITLE, text=TEXT, loops=[cusp()])


def take_picture() -> None:
    """The arms of the page in the eighth round, as docs/pictures/play.png."""
    import io
    import shutil

    from PIL import Image
    from playwright.sync_api import sync_playwright

    flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1180, "height": 900}, offline=True, reduced_motion="reduce")
        page.goto(FILE.as_uri())
        page.locator("#story span", has_text="8 rounds").first.wait_for(timeout=60_000)
        page.evaluate("holokin.time = 7.45 * 6.78; holokin.fresh = true")
        page.wait_for_timeout(3000)
        taken = Image.open(io.BytesIO(page.locator(".stage").screenshot())).convert("RGB")
        browser.close()
    taken.quantize(240, method=Image.Quantize.MEDIANCUT).save(PICTURE, optimize=True)
    print(f"wrote {PICTURE}: {PICTURE.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    if "--picture" in sys.argv[1:]:
        take_picture()
        raise SystemExit
    FILE.parent.mkdir(exist_ok=True)
    print(f"wrote {made().save(FILE)}: {FILE.stat().st_size / 1000:.0f} kB")
