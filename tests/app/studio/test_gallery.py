"""Recordings: what is in one, that a browser plays it from a file, and that the gallery plays them."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.app.studio import Motion, open_session, record, record_session

ROOT = Path(__file__).parents[3]
SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-dev-shm-usage"]
Q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]


@pytest.fixture(scope="module")
def motions() -> dict[str, hk.Trajectory]:
    """Three circles of a Panda by the pseudo-inverse and by a holonomic strategy."""
    task = hk.pose(hk.load("panda"))
    start = task.robot.pose(Q0)[:3, 3]
    circle = hk.circle(start, center=start - [0.1, 0, 0])
    tied = hk.holonomic(task, hk.linear([1, 0, -1] + [0] * 4))
    strategies = {"pseudo-inverse": hk.moore_penrose(task), "<b>q1 - q3</b>": tied}
    return {name: hk.follow(strategy, circle, Q0, cycles=3, samples=40) for name, strategy in strategies.items()}


@pytest.mark.campaign
def test_the_caption_has_the_drift_of_each_cycle_when_it_ends(motions: dict[str, hk.Trajectory]) -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    caption = record(hk.load("panda"), motions, title="Circles", seconds=3.0).caption
    for strategy, (name, motion) in zip(caption["strategies"], motions.items(), strict=True):
        assert strategy["name"] == name
        times, errors = np.array(strategy["errors"]).T
        assert errors == pytest.approx(np.abs(motion.drift_since_start()).max(axis=1), abs=0)
        assert times == pytest.approx([1, 2, 3], abs=0.03)
    assert [strategy["solid"] for strategy in caption["strategies"]] == [False, True]


@pytest.mark.campaign
@sampled(1, "title", ["a <!-- b", "<!--<script>", "</script><script>x</script>", "</SCRIPT >"])
def test_no_title_ends_the_script_of_a_recording_or_hides_its_end(motions, title: str) -> None:
    """After "<!--<script" a browser looks for two ends of a script: the page would stay empty."""
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    plain, page = (record(hk.load("panda"), motions, title=t, seconds=0.1).html() for t in ("x", title))
    for mark in ("<!--", "<script", "</script"):
        assert page.lower().count(mark) == plain.lower().count(mark)
    caption = page[page.index("HOLOKIN_CAPTION=") + len("HOLOKIN_CAPTION=") :]
    assert json.JSONDecoder().raw_decode(caption)[0]["title"] == title


@pytest.mark.campaign
def test_a_browser_plays_a_recording_from_a_file_without_network(motions, tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        pytest.skip("there is no chromium here: install one, as with `apt-get install chromium`")
    from PIL import Image

    text = "</script>what to see"
    record(hk.load("panda"), motions, tmp_path / "circles.html", title="Circles", text=text, seconds=4.0)
    problems: list[str] = []
    asked: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 640, "height": 440}, offline=True)
        page.set_default_timeout(60_000)
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto((tmp_path / "circles.html").as_uri() + "?fixedDpr=0.5")
        page.locator("#holokin").wait_for()
        page.keyboard.press("Space")

        def seen(time: float) -> np.ndarray:
            """The robots, right of the caption, as they are then."""
            page.locator("input").first.fill(str(time))
            page.wait_for_function(f"Math.abs(document.querySelector('[role=slider]').ariaValueNow - {time}) < 0.05")
            page.wait_for_timeout(1000)
            picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
            return np.asarray(picture.crop((250, 0, 640, 390)), dtype=int)

        first, last = seen(0.6), seen(4.5)
        said = page.locator("#holokin").inner_text()
        browser.close()
    assert not problems
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    assert first.std() > 5 and (np.abs(first - last).max(axis=2) > 40).mean() > 0.002
    orange = (last[..., 0] > 150) & (last[..., 0] - last[..., 2] > 70)  # the ghost, where it has left the robot
    assert orange.mean() > 0.002
    for part in ("Circles", text, "<b>q1 - q3</b>", "0.476", "none"):
        assert part in said, part


@pytest.mark.campaign
def test_a_session_is_recorded_as_it_ran(tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    session = open_session("panda-circle")
    with pytest.raises(hk.HolokinError, match="press Start first"):
        record_session(session)
    session.set_cycles(2)
    session.play()
    while session.advance(5.0).phase.value in ("gathering", "running"):
        pass
    caption = record_session(session, tmp_path / "session.html").caption
    drifts = {strategy.name: strategy.drift for strategy in session.snapshot().strategies}
    for strategy in caption["strategies"]:
        assert [error for _, error in strategy["errors"]] == pytest.approx(drifts[strategy["name"]], abs=1e-12)
    assert (tmp_path / "session.html").stat().st_size < 2_000_000


def test_a_motion_is_refused_with_its_fault() -> None:
    with pytest.raises(hk.HolokinError, match="give a row for each time"):
        Motion(np.arange(3.0), np.zeros((2, 7)))
    with pytest.raises(hk.HolokinError, match="let it rise"):
        Motion(np.array([0.0, 2.0, 1.0]), np.zeros((3, 7)))
    with pytest.raises(hk.HolokinError, match="a mark of a motion"):
        Motion(np.arange(3.0), np.zeros((3, 7)), marks=(0, 3))
    good = Motion(np.arange(3.0), np.zeros((3, 6)), marks=(0, 2))
    with pytest.raises(hk.HolokinError, match="panda_joint1"):
        record(hk.load("panda"), {"strategy": good})
    with pytest.raises(hk.HolokinError, match="give one of strategy"):
        record(hk.load("irb140"), {"strategy": good}, lead="other")


def test_every_recording_of_the_gallery_has_caption_picture_and_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import recordings

    page = recordings.PAGE.read_text("utf-8")
    shown = recordings.sections()
    assert {f"{name}.png" for name in shown} == {picture.name for picture in (ROOT / "docs" / "gallery").iterdir()}
    for name, (title, caption, example) in shown.items():
        assert f"\n- `{example.name}`" in page, title
        assert len(caption) < 220, title
        assert 5_000 < (ROOT / "docs" / "gallery" / f"{name}.png").stat().st_size < 90_000, name


def test_the_site_plays_a_recording_where_there_is_one_and_else_shows_the_picture(monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import recordings

    name = "paper-ppr"
    markdown = recordings.PAGE.read_text("utf-8")
    for known in (True, False):
        files = type("Files", (), {"get_file_from_path": lambda self, path, k=known: (k and name in path) or None})()
        file = type("File", (), {"src_uri": "gallery.md", "use_directory_urls": True})()
        shown = recordings.on_page_markdown(markdown, page=type("Page", (), {"file": file})(), files=files)
        assert (f"playbackPath={name}.viser" in shown) == known == ("<figure" in shown)
        assert (f"](gallery/{name}.png)" in shown) != known and "](gallery/panda-circle.png)" in shown
        assert '--8<-- "examples/paper_ppr.py"' in shown and "](../examples" not in shown  # the code, not a link


def test_what_a_recording_is_made_of_gives_it_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import recordings

    before = recordings.made_of("paper-ppr")
    other = tmp_path / "gallery.md"
    other.write_text(recordings.PAGE.read_text("utf-8").replace("(Fig. 6)", "(Fig. 7)"), "utf-8")
    monkeypatch.setattr(recordings, "PAGE", other)
    assert recordings.made_of("paper-ppr") != before
    assert recordings.made_of("elbow-up").name.startswith("elbow-up-")
