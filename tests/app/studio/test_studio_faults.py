"""The studio where something is unusual: two hands, a strategy that comes later, work in the background that fails."""

from __future__ import annotations

import contextlib
import io
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.app.studio import CloudStatus, NamedStrategy, Phase, Session, circle_loop, reversed_loop
from sessions import TOOL, panda, run, served, until

YUMI_START = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])


def test_each_of_two_hands_is_dragged_alone_and_both_go_round_a_loop_drawn_once() -> None:
    robot = hk.load("yumi")
    task = hk.stacked(*(hk.pose(robot, tip=tip.name) for tip in robot.tips))
    session = Session([NamedStrategy("pseudo-inverse", hk.moore_penrose(task), task)], YUMI_START)
    poses = np.array(session.snapshot().target)
    poses[1, :3, 3] += [0.02, -0.03, 0.01]
    state = session.drag(poses).strategies[0]
    moved = np.abs(state.q - YUMI_START) > 1e-9
    assert state.following and [name for name, m in zip(robot.joint_names, moved, strict=True) if m] == list(
        robot.joint_names[7:]  # those of the right arm alone
    )
    for tip, pose in zip(robot.tips, poses, strict=True):
        assert robot.pose(state.q, tip=tip.name) == pytest.approx(pose, abs=1e-8)
    grips = [robot.pose(YUMI_START, tip=tip.name)[:3, 3] for tip in robot.tips]
    session.reset()
    session.set_loop(circle_loop(grips[0] + [0.5, 0.0, 0.0], 0.03, near=grips[0], samples=20))  # drawn elsewhere
    curves = session.loop.points(9)  # type: ignore[union-attr]
    assert curves[:, 0] == pytest.approx(np.array(grips)) and curves[0] - curves[1] == pytest.approx(
        np.tile(grips[0] - grips[1], (9, 1))  # a tray would stay as it is
    )
    session.set_cycles(1)
    session.set_clockwise(True)
    assert run(session, 1.0).strategies[0].following
    again = reversed_loop(reversed_loop(session.loop))  # type: ignore[arg-type]
    assert again.keys["others"][0]["center"] == session.loop.keys["others"][0]["center"]  # type: ignore[union-attr]


@pytest.mark.campaign
def test_a_loop_out_of_reach_is_told_before_it_is_started() -> None:
    session = panda()
    session.start_work()
    session.set_loop(circle_loop(TOOL[:3, 3] + [0.25, 0, 0], 0.25, near=TOOL[:3, 3], samples=100))
    said = until(lambda: session.snapshot().loop_fault)
    session.set_loop(panda().loop)
    assert session.snapshot().loop_fault == ""
    session.close()
    assert "pseudo-inverse gets round" in said and "stretched" in said


@pytest.mark.campaign
def test_work_in_the_background_does_not_fail_in_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    from holokin.app.studio import session as working
    from holokin.app.studio import states

    def broken(*_arguments: object, **_named: object) -> None:
        raise KeyError("nobody expects this")

    monkeypatch.setattr(working, "compiled", broken)
    monkeypatch.setattr(states, "coverage", broken)
    session = panda()
    session.start_work()
    session.start_cloud("lock", samples=8)
    assert "could not be compiled" in until(lambda: session.snapshot().fault)
    assert "nobody expects this" in until(lambda: (c := session.snapshot().cloud) and c.sentence)
    until(lambda: all(state.judgement for state in session.snapshot().strategies))  # and the thread goes on
    monkeypatch.setattr(working, "judged", broken)
    session.add_strategy(replace(session.strategies[0], name="late"))
    until(lambda: "background work ended" in session.snapshot().fault)
    session.close()


@pytest.mark.campaign
def test_a_cancelled_cloud_holds_nobody_up_and_grows_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    from holokin.app.studio import states

    found = states.coverage

    def slow(*arguments: Any, **named: Any) -> Any:
        time.sleep(1.0)
        return found(*arguments, **named)

    monkeypatch.setattr(states, "coverage", slow)
    session = panda()
    session.start_cloud("lock", samples=512)
    until(lambda: session.snapshot().cloud)
    began = time.thread_time(), time.perf_counter()
    assert session.cancel_cloud().cloud.status is CloudStatus.CANCELLED  # type: ignore[union-attr]
    assert time.perf_counter() - began[1] < 0.5
    seen = session.snapshot().cloud
    time.sleep(1.2)  # the piece that was looked at is known by now, and wanted by nobody
    assert session.snapshot().cloud is seen
    session.close()


@pytest.fixture(scope="module")
def studio() -> Iterator[Any]:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    with served() as page:
        yield page


@pytest.mark.campaign
def test_a_strategy_that_comes_later_gets_a_robot_and_a_line(studio: Any) -> None:
    session, page = studio.session, studio.page
    session.add_strategy(replace(session.strategies[0], name="late"))
    until(lambda: page.scene.names[-1] == "late" and "late" in page.panels.table.content)
    session.set_speed(1000.0)
    session.play()
    until(lambda: session.snapshot().phase is Phase.DONE)
    until(lambda: page.drawn == session.snapshot().number)
    assert page.message == ""


@pytest.mark.campaign
def test_a_page_that_cannot_be_drawn_leaves_the_one_before(studio: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from holokin.app.studio import stage as pages

    made, calls = pages.Handles, []

    def once(*arguments: Any) -> Any:
        calls.append(1)
        if len(calls) == 1:
            raise KeyError("no such handle")
        return made(*arguments)

    monkeypatch.setattr(pages, "Handles", once)
    studio._reopen("orientation")
    assert studio.session.source == "ppr-cycle" and "no such handle" in studio.page.message
    before = studio.session.snapshot()
    pose = np.array(before.target)
    pose[0, 0, 3] -= 0.05
    studio.page.ask(lambda: studio.session.drag(pose))
    until(lambda: studio.page.drawn > before.number)  # it lives


def test_viser_is_silent_and_nobody_else_is() -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    import rich

    from holokin.app.studio.page_scene import silent_viser

    heard = io.StringIO()
    with contextlib.redirect_stdout(heard), silent_viser():
        print("a program's own line")
        rich.print("viser's banner")
    assert heard.getvalue() == "a program's own line\n"


@pytest.mark.parametrize(("host", "url"), [("::1", "http://[::1]:8080"), ("127.0.0.1", "http://localhost:8080")])
def test_an_address_with_colons_stands_in_brackets(host: str, url: str) -> None:
    pytest.importorskip("viser", reason="the extra `studio` is not installed")
    from holokin.app.studio.server import url_of

    assert url_of(host, 8080) == url


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["panda_joint1", "panda_joint2"], ["joint1", "joint2"]),
        (["iiwa_joint_1", "iiwa_joint_2"], ["joint_1", "joint_2"]),
        (["shoulder_pan_joint", "elbow_joint"], ["shoulder_pan", "elbow"]),
        (["a_very_long_name_of_a_joint", "q2"], ["a_very_long_n\u2026", "q2"]),
        (["q1"], ["q1"]),
    ],
)
def test_joints_are_told_apart_by_what_is_left_of_their_names(names: list[str], short: list[str]) -> None:
    from holokin.app.studio.panel_html import short_names

    assert short_names(names) == short
