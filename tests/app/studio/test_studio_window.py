"""The robot in the window: in each browser all of it is seen beside the panels, on a telephone, too."""

from __future__ import annotations

import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from browsers import BROWSER, PATIENCE, SOFTWARE, playwright

pytest.importorskip("viser", reason="the extra `studio` is not installed")
from holokin.app.studio.page_scene import FOV
from holokin.app.studio.stage import FILLED, fitted


def pictured(points: Any, place: Any, at: Any, aspect: float) -> Any:
    """Where points (k, 3) are in the picture of an upright pinhole camera, (k, 2): its edges are at -1 and 1."""
    ahead = (at - place) / np.linalg.norm(at - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(right, ahead), ahead]) @ (np.asarray(points) - place).T
    assert (depth > 0).all()
    return np.stack([x / aspect, y], axis=1) / (depth * np.tan(FOV / 2))[:, None]


@given(
    seed=st.integers(0, 2**32 - 1), aspect=st.floats(0.2, 4.0), turn=st.floats(-3.1, 3.1), up=st.floats(-1.4, 1.4),
)  # fmt: skip
def test_a_camera_that_is_fitted_sees_every_point_and_stands_no_farther_than_it_must(
    seed: int, aspect: float, turn: float, up: float
) -> None:
    points = np.random.default_rng(seed).normal(size=(12, 3)) * [0.4, 0.3, 0.8] + [0.2, -0.3, 0.5]
    away = np.array([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)])
    place, at = fitted(points, away, aspect)
    assert (place - at) / np.linalg.norm(place - at) == pytest.approx(away, abs=1e-9)
    seen = pictured(points, place, at, aspect)
    assert np.abs(seen).max() <= FILLED + 1e-9
    filled = [np.isclose([side.min(), side.max()], [-FILLED, FILLED], atol=1e-9).all() for side in seen.T]
    assert any(filled)  # from edge to edge, across or upright


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


def told(shown: Any) -> bool:
    """Whether the studio knows the size of the picture."""
    box = shown.page.locator("canvas").first.bounding_box()
    return bool(box["width"]) and abs(camera_of(shown).aspect * box["height"] / box["width"] - 1) < 0.02


@pytest.mark.parametrize(("wide", "high"), [(1440, 900), (1024, 768), (390, 844)])
def test_no_panel_lies_over_the_robot(shown: Any, wide: int, high: int) -> None:
    page = shown.page
    page.set_viewport_size({"width": wide, "height": high})
    canvas = page.locator("canvas").first

    until(lambda: told(shown))

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


def test_a_camera_that_somebody_moved_stays_when_the_window_changes(shown: Any) -> None:
    page = shown.page
    page.set_viewport_size({"width": 1024, "height": 768})
    until(lambda: told(shown))
    time.sleep(0.5)
    camera = camera_of(shown)
    box = page.locator("canvas").first.bounding_box()
    before, shape = camera.position, camera.aspect
    page.mouse.move(box["x"] + 40, box["y"] + 0.9 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 240, box["y"] + 0.8 * box["height"], steps=4)
    page.mouse.up()
    until(lambda: bool(np.linalg.norm(camera.position - before) > 0.1))
    time.sleep(0.5)
    moved = camera.position
    page.set_viewport_size({"width": 1300, "height": 768})
    until(lambda: told(shown) and camera.aspect > 1.2 * shape)
    time.sleep(0.5)
    assert camera.position == pytest.approx(moved, abs=1e-3)


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
