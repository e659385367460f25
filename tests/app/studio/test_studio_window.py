"""The robot in the window: all of it is seen beside the panels."""

from __future__ import annotations

import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

import holokin as hk
from browsers import BROWSER, PATIENCE, SOFTWARE, playwright
from conftest import campaign

pytest.importorskip("viser", reason="the extra `studio` is not installed")
from holokin.app.studio.page_scene import FOV, Scene


def pictured(points: Any, place: Any, at: Any, aspect: float) -> Any:
    """Where points (k, 3) are in the picture of an upright pinhole camera, (k, 2): its edges are at -1 and 1."""
    ahead = (at - place) / np.linalg.norm(at - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(right, ahead), ahead]) @ (np.asarray(points) - place).T
    assert (depth > 0).all()
    return np.stack([x / aspect, y], axis=1) / (depth * np.tan(FOV / 2))[:, None]


@pytest.mark.parametrize("name", ["panda", "ppr", "mobile-ur5e"])
def test_the_camera_begins_where_it_sees_the_whole_arm_and_more_points(name: str) -> None:
    """In a picture that is at least as wide as high."""
    robot, rng = hk.load(name), np.random.default_rng(0)
    more = rng.normal(size=(12, 3)) * [0.4, 0.3, 0.8] + [0.2, -0.3, 0.5]
    server = MagicMock()
    server.get_clients.return_value = {}
    scene = Scene(server, robot, np.zeros(robot.n))
    scene.look_at_all(more)
    camera = server.initial_camera
    for points in (more, scene.drawn()):
        assert np.abs(pictured(points, camera.position, camera.look_at, 1.0)).max() <= 1.0


@pytest.fixture(scope="module")
def shown() -> Iterator[Any]:
    """A Panda in the studio, and one browser on it."""
    with pytest.MonkeyPatch.context() as patch, playwright.sync_playwright() as driver:
        patch.setenv("HOLOKIN_NATIVE", "0")
        studio = hk.studio("panda-circle", browser=False, wait=False, port=0, tell=lambda _text: None)
        browser = driver.chromium.launch(executable_path=BROWSER, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(PATIENCE)
        page.goto(f"{studio.url}?fixedDpr=0.3")
        page.get_by_role("button", name="Start", exact=True).wait_for()
        yield SimpleNamespace(studio=studio, page=page)
        browser.close()
        studio.close()


def until(true: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait for it."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.1)


def camera_of(shown: Any) -> Any:
    """Of the one browser, when it has told where it looks from."""
    until(lambda: bool(shown.studio.server.get_clients()))
    return next(iter(shown.studio.server.get_clients().values())).camera


def robot_on_screen(shown: Any) -> Any:
    """Pixels (k, 2) of the page at which the arm's joints, its tool and the loop are."""
    session, camera = shown.studio.session, camera_of(shown)
    points = np.vstack([*session.robot.skeleton(session.home), *session.loop.points(20)])
    box = shown.page.locator("canvas").first.bounding_box()
    seen = pictured(points, camera.position, camera.look_at, box["width"] / box["height"])
    return np.array([box["x"], box["y"]]) + (seen * [1, -1] + 1) / 2 * [box["width"], box["height"]]


@pytest.mark.parametrize(("wide", "high"), [(1440, 900), campaign(("wide", "high"), (1920, 1080))])
def test_no_panel_lies_over_the_robot(shown: Any, wide: int, high: int) -> None:
    page = shown.page
    page.set_viewport_size({"width": wide, "height": high})
    canvas = page.locator("canvas").first

    def inside() -> bool:
        spots, box = robot_on_screen(shown), canvas.bounding_box()
        low, size = np.array([box["x"], box["y"]]), np.array([box["width"], box["height"]])
        return bool((spots > low).all() and (spots < low + size).all() and (np.ptp(spots, axis=0) > 0.4 * size).any())

    until(inside)
    start = page.get_by_role("button", name="Start", exact=True)
    start.scroll_into_view_if_needed()
    for x, y in robot_on_screen(shown):
        assert page.evaluate(
            "([x, y]) => document.elementFromPoint(x, y)?.closest('.mantine-Paper-root') === null", [x, y]
        )
    box = start.bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= wide and box["y"] + box["height"] <= high


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
