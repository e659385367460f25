"""The studio in a real browser: Debian's chromium without a window, driven by its mouse and keyboard."""

from __future__ import annotations

import io
import time
import webbrowser
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

import holokin as hk
from browsers import BROWSER, PATIENCE, SOFTWARE, playwright
from conftest import campaign
from holokin.app.job import open_job, run_job
from holokin.app.report.plots import HOLONOMIC, NONHOLONOMIC, rgb
from sessions import served
from sessions import until as wait_until

pytest.importorskip("viser", reason="the extra `studio` is not installed")
from holokin.app.studio.page_scene import Scene

VIEW: Any = {"width": 1120, "height": 560}
until = partial(wait_until, rest=0.2)  # seldom: a picture of the page costs a core a second


@pytest.fixture(scope="module")
def shown() -> Iterator[Any]:
    """The job panda-circle in the studio, and the page of one browser on it."""
    from PIL import Image

    problems: list[str] = []
    with served("panda-circle") as studio, playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=SOFTWARE)
        page = browser.new_page(viewport=VIEW, accept_downloads=True)
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"{studio.url}?fixedDpr=0.5")
        page.get_by_role("button", name="Start", exact=True).wait_for()

        def picture() -> Any:
            """Red, green and blue of the three-dimensional part as it is on the screen (h, w, 3)."""
            box = page.locator("canvas").first.bounding_box()
            image = Image.open(io.BytesIO(page.screenshot(timeout=PATIENCE))).convert("RGB")
            area = (int(box["x"]) + 5, 200, int(box["x"] + box["width"]) - 5, int(box["height"]) - 5)
            return np.asarray(image.crop(area), dtype=int)

        yield SimpleNamespace(studio=studio, page=page, problems=problems, picture=picture, session=studio.session)
        browser.close()


def settled(session: Any) -> Any:
    """What a session shows when nothing has moved for a second."""
    known, since = session.snapshot(), time.monotonic()
    while time.monotonic() < since + 1.0:
        time.sleep(0.1)
        found = session.snapshot()
        if not all(np.array_equal(a.q, b.q) for a, b in zip(found.strategies, known.strategies, strict=True)):
            known, since = found, time.monotonic()
    return known


def hued(picture: Any, color: str) -> float:
    """The share of pixels that have the hue of a colour."""
    low, middle, high = np.argsort(rgb(color))
    least, between, most = np.sort(rgb(color))
    above = picture[..., high] - picture[..., low]
    share = (picture[..., middle] - picture[..., low]) / np.maximum(above, 1)
    return float(((above > 60) & (np.abs(share - (between - least) / (most - least)) < 0.12)).mean())


def pictured(points: Any, camera: Any, aspect: float) -> Any:
    """Where points (k, 3) are in the picture of an upright pinhole camera, (k, 2): its edges are at -1 and 1."""
    ahead = (camera.look_at - camera.position) / np.linalg.norm(camera.look_at - camera.position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(right, ahead), ahead]) @ (np.asarray(points) - camera.position).T
    assert (depth > 0).all()
    return np.stack([x / aspect, y], axis=1) / (depth * np.tan(camera.fov / 2))[:, None]


def on_screen(shown: Any, points: Any) -> Any:
    """Where points (k, 3) of the scene are on the screen (k, 2) [pixels]."""
    clients = until(lambda: shown.studio.server.get_clients())
    box = shown.page.locator("canvas").first.bounding_box()
    place = pictured(points, next(iter(clients.values())).camera, box["width"] / box["height"])
    return np.array([box["x"], box["y"]]) + (place * [1, -1] + 1) / 2 * [box["width"], box["height"]]


@pytest.mark.parametrize("name", ["panda", "ppr", "mobile-ur5e"])
def test_the_camera_begins_where_it_sees_the_whole_arm_and_more_points(name: str) -> None:
    """In a picture that is at least as wide as high."""
    robot, rng = hk.load(name), np.random.default_rng(0)
    more = rng.normal(size=(12, 3)) * [0.4, 0.3, 0.8] + [0.2, -0.3, 0.5]
    server = MagicMock()
    server.get_clients.return_value = {}
    scene = Scene(server, robot, np.zeros(robot.n))
    scene.look_at_all(more)
    for points in (more, scene.drawn()):
        assert np.abs(pictured(points, server.initial_camera, 1.0)).max() <= 1.0


@pytest.mark.parametrize(
    ("wide", "high"),
    [(1024, 768), campaign(("wide", "high"), (1440, 900)), campaign(("wide", "high"), (1920, 1080))],
)
def test_more_than_half_of_the_window_is_the_scene_and_no_panel_lies_over_the_robot(
    shown: Any, wide: int, high: int
) -> None:
    page, session = shown.page, shown.session
    page.set_viewport_size({"width": wide, "height": high})
    canvas, start = page.locator("canvas").first, page.get_by_role("button", name="Start", exact=True)
    robot = np.vstack([*session.robot.skeleton(session.home), *session.loop.points(20)])

    def inside() -> bool:
        spots, box = on_screen(shown, robot), canvas.bounding_box()
        low, size = np.array([box["x"], box["y"]]), np.array([box["width"], box["height"]])
        return bool((spots > low).all() and (spots < low + size).all() and (np.ptp(spots, axis=0) > 0.4 * size).any())

    until(inside)
    until(lambda: canvas.bounding_box()["width"] > (0.6 if wide == 1024 else 0.55) * wide)
    until(inside)
    start.scroll_into_view_if_needed()
    over = "([x, y]) => document.elementFromPoint(x, y)?.closest('.mantine-Paper-root') === null"
    for x, y in on_screen(shown, robot):
        assert page.evaluate(over, [x, y])
    box = start.bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= wide and box["y"] + box["height"] <= high
    page.set_viewport_size(VIEW)


def test_the_page_opens_without_an_error_and_its_canvas_shows_the_robot(shown: Any) -> None:
    until(lambda: shown.studio.server.get_clients())
    assert until(lambda: share if (share := hued(shown.picture(), HOLONOMIC)) > 0.02 else 0) < 0.6
    assert shown.problems == []
    assert shown.page.get_by_text("All browsers on this page see and move the same robots.").is_visible()


@pytest.mark.campaign
def test_a_drag_by_the_mouse_moves_the_joints_of_all_strategies_and_their_tools_with_it(shown: Any) -> None:
    session, handles = shown.session, shown.studio.page.handles
    until(lambda: shown.studio.server.get_clients())
    until(lambda: hued(shown.picture(), HOLONOMIC) > 0.02)  # the robot is there
    before = session.snapshot()
    pose = before.target[0]
    ends = [pose[:3, 3] + far * pose[:3, 0] for far in (0.8 * handles.size, 0.8 * handles.size - 0.08)]
    grip, goal = on_screen(shown, ends)
    mouse = shown.page.mouse
    mouse.move(*grip)
    time.sleep(0.5)
    mouse.down()
    for share in np.linspace(0.2, 1.0, 5):  # a browser that draws slowly sees a quick mouse in a few places only
        mouse.move(*(grip + share * (goal - grip)))
        time.sleep(0.1)
    until(lambda: not np.array_equal(session.snapshot().target, before.target))
    settled(session)
    mouse.up()
    after = settled(session)
    moved = after.target[0][:3, 3] - pose[:3, 3]
    assert 0.03 < np.linalg.norm(moved) < 0.15
    assert abs(float(moved @ pose[:3, 0])) > 0.99 * np.linalg.norm(moved)  # along the arrow that was held
    for strategy in after.strategies:
        assert np.abs(strategy.q - before.strategy(strategy.name).q).max() > 0.01
        assert np.abs(session.task.pose(strategy.q) - after.target[0]).max() < 1e-7


@pytest.mark.campaign
def test_after_a_loop_the_pseudo_inverses_robot_stands_elsewhere_by_what_drift_says(shown: Any) -> None:
    session, page = shown.session, shown.page
    page.get_by_role("button", name="All back to the start posture").click()
    until(lambda: np.allclose(session.snapshot().strategies[0].q, session.home))
    until(lambda: hued(shown.picture(), NONHOLONOMIC) < 0.002)
    session.set_speed(8.0)
    page.get_by_role("button", name="Start", exact=True).click()
    snap = until(lambda: snap if (snap := session.snapshot()).phase.value == "done" else None)
    for strategy, known in zip(session.strategies, snap.strategies, strict=True):
        said = hk.drift(strategy.rule, session.loop.path, session.home, cycles=3, samples=session.loop.samples)
        assert known.drift == pytest.approx(said.largest, abs=1e-12)
    pseudo, tied = snap.strategies[0], snap.strategies[1]
    assert pseudo.drift[-1] > 0.4
    assert tied.drift.max() < 1e-12
    page.get_by_text(f"{pseudo.drift[-1]:.3g}", exact=True).wait_for()
    assert until(lambda: share if (share := hued(shown.picture(), NONHOLONOMIC)) > 0.01 else 0) < 0.5


@pytest.mark.campaign
def test_a_saved_job_runs_to_the_numbers_of_the_page(shown: Any, tmp_path: Any) -> None:
    page, snap = shown.page, shown.session.snapshot()
    page.get_by_role("tab", name="Save").click()
    with page.expect_download() as found:
        page.get_by_role("button", name="Save as job").click()
    file = tmp_path / "saved.toml"
    found.value.save_as(file)
    result = run_job(*open_job(str(file)))
    drifts = {one.name: np.abs(one.cycles.drift_since_start()).max(axis=1) for one in result.drawn}
    assert set(drifts) == {strategy.name for strategy in snap.strategies}
    for strategy in snap.strategies:
        assert drifts[strategy.name] == pytest.approx(strategy.drift, abs=1e-12)


@pytest.mark.campaign
def test_the_slider_of_the_self_motion_moves_the_joints_and_leaves_the_tool_where_it_is(shown: Any) -> None:
    page, session = shown.page, shown.session
    page.get_by_role("tab", name="Posture").click()
    name = shown.studio.page.panels.posture.strategy.value
    before = session.snapshot().strategy(name)
    thumb = page.locator('[role="slider"]:visible').first
    thumb.focus()
    for _ in range(40):
        page.keyboard.press("ArrowRight")
    settled(session)
    after = session.snapshot().strategy(name)
    assert np.abs(after.q - before.q).max() > 0.02
    assert np.abs(session.task.pose(after.q) - session.task.pose(before.q)).max() < 1e-9


def test_a_target_out_of_reach_makes_the_handle_red_with_one_sentence_and_nothing_jumps(shown: Any) -> None:
    session, page = shown.session, shown.page
    before = session.reset()
    pose = np.array(before.target[0])
    pose[:3, 3] += [2.0, 0.0, 0.0]
    after = session.drag(pose)
    assert not after.following
    page.get_by_text(after.strategies[0].sentence).first.wait_for()
    ball = shown.studio.page.handles._balls[0]
    assert until(lambda: ball.color[0] > 2 * ball.color[1])
    for strategy in after.strategies:
        assert np.isfinite(strategy.q).all()
    session.drag(before.target)
    until(lambda: ball.color[1] > 2 * ball.color[0])
    assert np.abs(session.snapshot().strategies[1].q - before.strategies[1].q).max() < 1e-6


@pytest.mark.campaign
def test_a_browser_that_comes_back_finds_everything_as_it_was(shown: Any) -> None:
    page, session = shown.page, shown.session
    session.set_speed(8.0)
    session.play()
    done = until(lambda: snap if (snap := session.snapshot()).phase.value == "done" else None)
    page.reload()
    page.get_by_text(f"{done.strategies[0].drift[-1]:.3g}", exact=True).wait_for()
    for strategy in session.snapshot().strategies:
        assert np.array_equal(strategy.q, done.strategy(strategy.name).q)
    assert [text for text in shown.problems if "WebSocket" not in text] == []


@pytest.mark.campaign
def test_the_file_with_which_a_browser_is_started_leads_to_the_page_and_is_deleted_there(
    shown: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setenv("HOME", str(tmp_path))
    shown.studio.browse()
    page = shown.page.context.browser.new_page()
    page.goto(opened[0])
    page.get_by_role("button", name="Start", exact=True).wait_for()
    assert page.url == shown.studio.url
    until(lambda: list(tmp_path.iterdir()) == [])
    page.close()


@pytest.mark.campaign
def test_the_tab_has_the_name_of_the_job_and_whoever_looks_on_is_told_that_the_studio_ended(shown: Any) -> None:
    assert shown.page.title() == "panda-circle - holokin studio"
    shown.studio.close()
    shown.page.get_by_text("The studio was ended").wait_for()
