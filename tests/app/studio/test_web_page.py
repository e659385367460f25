"""The page that a browser computes itself: its numbers are those of Python, and nothing leaves it or gets into it."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from browsers import BROWSER, PATIENCE, SOFTWARE, playwright
from holokin.app.studio import open_session, page_plan, web_page
from holokin.app.studio.standalone_page import DrawnArm, digest, page_text, strategy_code
from holokin.base.errors import ArgumentError, ExportError, MissingExtraError, OpenPathError, PathError
from web_pages import HOSTILE, PAGE, SCRIPT, data_of, joints

AGAIN = "python docs/play_page.py makes it again"


def test_the_page_of_the_site_is_made_of_its_sources() -> None:
    """Of the HTML, style and script of the package, and of the C of its strategies; only the compiler is not asked."""
    html = PAGE.read_text("utf-8")
    data = data_of(html)
    assert page_text(SCRIPT.TITLE, SCRIPT.TEXT, data) == html, AGAIN
    arm = DrawnArm.of(next(iter(SCRIPT.strategies().values())).task, np.array([SCRIPT.Q0]))
    segments = max(len(loop["counts"]) for loop in data["loops"])
    for strategy, its in zip(SCRIPT.strategies().values(), data["strategies"], strict=True):
        assert its["code"] == digest(strategy_code(strategy, arm, segments)), AGAIN
    assert len(html.encode()) < 200_000


@pytest.fixture(scope="module")
def shown() -> Iterator[Any]:
    """The page of the site in a browser without a network, from its file."""
    problems: list[str] = []
    asked: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 420, "height": 360}, offline=True, reduced_motion="reduce")
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(PAGE.as_uri())
        page.locator("#story span").first.wait_for()
        yield SimpleNamespace(page=page, problems=problems, asked=asked)
        browser.close()


def paths() -> dict[str, tuple[str, hk.Path, int]]:
    """Name -> (what the page is told, the same path of Python, rounds)."""
    start = hk.load("panda").pose(SCRIPT.Q0)[:3, 3]
    size = np.array([0.05, -0.12, 0.0])
    around = hk.circle(start, start + size / 2)
    other = hk.circle(start, start - size / 2, clockwise=True)
    upright = np.array([0.0, 0.09, -0.04])
    return {
        "the circle of the README": ("", hk.circle(start, start - [0.1, 0, 0]), 2),
        "a dragged circle": (f"holokin.drag({size.tolist()})", around, 1),
        "a figure eight": (f"holokin.kind = 'eight'; holokin.drag({size.tolist()})", around + other, 1),
        "an upright circle": (
            f"holokin.kind = 'circle'; holokin.plane = 0; holokin.drag({upright.tolist()})",
            hk.circle(start, start + upright / 2, normal=[1, 0, 0]), 1,
        ),
    }  # fmt: skip


def test_the_page_computes_the_joints_of_follow(shown: Any) -> None:
    for name, (told, path, rounds) in paths().items():
        shown.page.evaluate(told or "0")
        for found, strategy in zip(joints(shown.page, rounds), SCRIPT.strategies().values(), strict=True):
            wanted = hk.follow(strategy, path, SCRIPT.Q0, samples=240, cycles=rounds).q
            assert np.abs(found[: len(wanted)] - wanted).max() < 1e-9, name


def test_the_page_says_the_drift_of_drift(shown: Any) -> None:
    shown.page.evaluate("holokin.kind = 'circle'; holokin.plane = 2; holokin.drag([-0.2, 0, 0])")
    shown.page.locator("#story span", has_text="8 rounds").first.wait_for()
    _, path, _ = paths()["the circle of the README"]
    strategy = SCRIPT.strategies()["pseudo-inverse"]
    wanted = hk.drift(strategy, path, SCRIPT.Q0, cycles=8, samples=240).largest
    shown.page.locator("summary").click()
    cells = shown.page.locator("#table td").all_inner_texts()
    assert [float(cell.split()[0]) for cell in cells[::2]] == pytest.approx(wanted, abs=6e-4)
    assert shown.page.locator(".value").all_inner_texts()[0] == f"{wanted[-1]:.3f} rad"
    assert "every joint is where it began" in shown.page.inner_text("#story")


def test_the_loop_round_a_cusp_ends_at_the_other_posture_and_the_page_says_so(shown: Any) -> None:
    shown.page.get_by_label("A loop round a cusp").check()
    first, second = np.array(SCRIPT.CUSP)
    held = joints(shown.page, 1)[1]
    assert np.abs(held[0] - first).max() == 0
    assert np.abs(held[-1] - second).max() < 1e-9
    shown.page.locator("#story span", has_text="cusp").first.wait_for()
    said = shown.page.inner_text("#story")
    assert "1.149 rad from where it began" in said
    assert "4.7 cm" in said
    assert "every joint is where it began" not in said


def test_nothing_is_asked_of_a_network_and_nothing_fails(shown: Any) -> None:
    assert shown.asked == [PAGE.as_uri()]
    assert shown.problems == []


def test_every_control_has_a_name_for_who_does_not_see_it(shown: Any) -> None:
    for control in shown.page.locator("input, select, button, canvas").all():
        told = control.evaluate("e => e.ariaLabel || e.innerText || (e.labels && e.labels[0] && e.labels[0].innerText)")
        assert told.strip(), control
    assert all(
        "round 1" in label for label in shown.page.locator("svg").evaluate_all("all => all.map(e => e.ariaLabel)")
    )


def test_a_strangers_names_are_text_and_no_code() -> None:
    """In the title, the text, names of joints, strategies and loops; and none fills a hole of the page."""
    data = {"joints": [{"name": HOSTILE, "unit": "rad"}], "loops": [{"text": HOSTILE}]}
    data["strategies"] = [{"name": HOSTILE}]
    html = page_text(HOSTILE, HOSTILE, data)
    assert html.count("<script") == html.count("</script") == 2
    assert "<img" not in html
    assert "<!--" not in html
    assert data_of(html) == data
    assert unescape(re.findall("<title>(.*)</title>", html)[0]) == HOSTILE


def test_the_policy_lets_only_the_pages_own_script_run() -> None:
    policy = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]+)"', PAGE.read_text("utf-8"))[0]
    assert "default-src 'none'" in policy
    assert "unsafe-inline" not in policy
    assert "'unsafe-eval'" not in policy
    assert "http" not in policy


def test_without_zig_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else known(name))
    task = hk.position(hk.load("planar-3r"))
    with pytest.raises(MissingExtraError, match=r"holokin\[native\]"):
        web_page({"pseudo-inverse": hk.moore_penrose(task)}, [0.3, 0.6, 0.6])


def test_what_a_page_cannot_show_is_refused_by_name() -> None:
    robot, q0 = hk.load("planar-3r"), [0.3, 0.6, 0.6]
    task = hk.position(robot)
    strategy = hk.moore_penrose(task)
    start = robot.pose(q0)[:3, 3]
    with pytest.raises(OpenPathError):
        web_page({"a": strategy}, q0, hk.line(start, start + [0.1, 0, 0]))
    with pytest.raises(ArgumentError, match="one to 3"):
        web_page(dict.fromkeys("abcd", strategy), q0)
    with pytest.raises(ArgumentError, match="one robot"):
        web_page({"a": strategy, "b": hk.moore_penrose(hk.position(hk.load("ppr")))}, q0)
    with pytest.raises(ArgumentError, match="one tool"):
        hands = hk.load("yumi")
        web_page({"a": hk.moore_penrose(hk.stacked(*(hk.position(hands, tip=t.name) for t in hands.tips)))}, q0)
    import casadi as ca

    jumping = hk.holonomic(task, hk.custom(lambda q: q[0] + ca.floor(q[1])))
    with pytest.raises(ExportError, match="may jump"):
        strategy_code(jumping, DrawnArm.of(task, np.array([q0])), 2)


def test_a_strategy_stops_where_it_stops_in_python_and_the_page_says_why(shown: Any) -> None:
    start = hk.load("panda").pose(SCRIPT.Q0)[:3, 3]
    for size, why in (([-0.6, 0.0, 0.0], "a joint limit"), ([0.3, 0.0, 0.0], "edge of its reach")):
        shown.page.evaluate(f"holokin.kind = 'circle'; holokin.plane = 2; holokin.drag({size})")
        found = joints(shown.page, 1)
        ends = shown.page.evaluate("holokin.strategies.map(strategy => strategy.ended)")
        for strategy, rows, end in zip(SCRIPT.strategies().values(), found, ends, strict=True):
            with pytest.raises(PathError) as stopped:
                hk.follow(strategy, hk.circle(start, start + np.array(size) / 2), SCRIPT.Q0, samples=240)
            assert why in end
            assert np.abs(rows - stopped.value.trajectory.q).max() < 1e-9
        shown.page.locator("#story span", has_text="stops in round 1").first.wait_for()


def test_a_strategy_that_does_not_get_round_is_not_written_and_the_exit_code_is_1(holokin, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    done = holokin("export", "web", "examples/panda-strategies.toml", "--strategy", "lock-3", "--out", page)
    assert done.code == 1
    assert "lock-3: stopped in cycle 1" in done.out
    assert "--anyway" in done.out
    assert not page.exists()


def test_a_strategy_that_the_job_lacks_is_named_with_those_that_it_has(holokin, tmp_path: Path) -> None:
    done = holokin("export", "web", "panda-circle", "--strategy", "lock-8", "--out", tmp_path / "page.html")
    assert done.code == 2
    assert "lock-3" in done.err


def test_a_page_shows_a_strategy_without_leaves_beside_one_with_them() -> None:
    session = open_session("panda-circle")
    names = [strategy.name for strategy in session.strategies]
    for name in (None, *names):
        plan = page_plan(session, name)
        assert [isinstance(G, hk.strategies.HolonomicStrategy) for G in plan.strategies.values()] == [False, True], name
        assert name is None or name in plan.strategies
