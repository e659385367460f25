"""The controls of the page: what they say and show, and what each of them changes. No browser."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.studios import circle_loop
from holokin.studios.handles import circle_of
from holokin.studios.shown_units import UNITS
from sessions import TOOL, panda, shifted
from sessions import run as run_to_the_end

pytest.importorskip("viser", reason="the extra `studio` is not installed")


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the virtual machine, which shows the same and needs no compiler."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


@pytest.fixture
def studio() -> Iterator[Any]:
    """A studio with the smallest job."""
    made = hk.studio("ppr-cycle", port=0, browser=False, wait=False, tell=str)
    yield made
    made.close()


def test_every_control_of_the_page_says_what_it_does_where_the_mouse_rests_on_it(studio: Any) -> None:
    controls = studio.server.gui._gui_input_handle_from_uuid.values()
    assert len(controls) > 30 and [control.label for control in controls if not control.hint] == []
    assert [control.label for control in controls if control.hint.lower() == control.label.lower()] == []


def page_thread_done(page: Any) -> None:
    """Wait until the page's thread has done all that it was asked for."""
    done = threading.Event()
    page.ask(done.set)
    assert done.wait(10)


def choose(page: Any, control: Any, value: Any) -> None:
    """What a browser does: a control has another value, and what hangs on it is done."""
    control.value = value
    page_thread_done(page)


def test_in_degrees_and_mm_all_numbers_of_the_page_say_the_same_and_the_loop_stays_where_it_is() -> None:
    """The planar arm has hinges and a slider: a drift in mixed units is that of the joint that went most in them."""
    studio = hk.studio("ppr-cycle", port=0, browser=False, wait=False, tell=str)
    try:
        page, session = studio.page, studio.session
        run_to_the_end(session)
        snap, loop = session.snapshot(), page.panels.loop
        known = {c.unit for c in session.robot.coordinates}
        assert known == {"rad", "m"}
        before = loop.center.value, loop.radius.value, loop.radius.min, loop.radius.max
        choose(page, page.panels.units, "deg, mm")
        page.close()  # its thread: from here the test draws
        assert loop.center.label == "Centre [mm]" and loop.radius.label == "Radius [mm]"
        assert np.array(loop.center.value) == pytest.approx(1000 * np.array(before[0]), rel=1e-9)
        assert loop.radius.value == pytest.approx(1000 * before[1], rel=1e-9)
        page.charts.draw(snap)
        factors = [180 / np.pi if c.unit == "rad" else 1000 for c in session.robot.coordinates]
        for row, law in enumerate(snap.laws, 1):
            wanted = max(abs(factor * joint) for factor, joint in zip(factors, law.drift_joints[-1], strict=True))
            assert page.charts.drift.data[row][-1] == pytest.approx(wanted, abs=1e-12)
            assert f">{wanted:.3g}<" in page.panels._table(snap)
        assert "deg or mm" in page.charts.title.content
        loop._make()
        assert circle_of(session.loop)[2] == pytest.approx(before[1], rel=1e-9)  # type: ignore[index]
        page.set_units(UNITS["rad, m"])
        for now, then in zip(
            (loop.center.value, loop.radius.value, loop.radius.min, loop.radius.max), before, strict=True
        ):
            assert now == pytest.approx(then, rel=1e-9)
        page.charts.draw(snap)
        for row, law in enumerate(snap.laws, 1):
            assert page.charts.drift.data[row][-1] == pytest.approx(law.drift[-1], abs=1e-12)
    finally:
        studio.close()


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_a_slider_in_degrees_moves_the_arm_as_far_as_one_in_radians(units: Any) -> None:
    studio = hk.studio(panda(), port=0, browser=False, wait=False, tell=str)
    try:
        page, panel = studio.page, studio.page.panels.posture
        page.close()  # its thread: the test draws
        page.set_units(units)
        choose_law(panel, "lock", studio.session)
        assert panel.self_motion.label == f"Self-motion [{units.angle}]"
        panel.self_motion.value = units.per_radian * 0.2
        panel._slide()
        wanted = panda().move_self("lock", 0.2).law("lock").q
        assert np.abs(wanted - PANDA_START).max() > 0.05
        assert studio.session.snapshot().law("lock").q == pytest.approx(wanted, abs=1e-9)
    finally:
        studio.close()


def choose_law(panel: Any, name: str, session: Any) -> None:
    """Its sliders are those of a law; they are drawn when the posture has stood still for two pictures."""
    panel.law.value = name
    for _ in range(2):
        panel.draw(session.snapshot())


def stood(session: Any) -> tuple[Any, ...]:
    """All that people change in a session, as numbers."""
    snap, loop = session.snapshot(), session.loop
    points = None if loop is None else loop.points(7).tolist()
    laws = [(law.name, law.q.tolist(), law.level.tolist()) for law in snap.laws]
    return laws, snap.target.tolist(), points, snap.cycles, snap.factor, snap.clockwise


def test_what_people_change_is_undone_step_by_step_and_redone_to_the_last_bit() -> None:
    studio = hk.studio(panda(), port=0, browser=False, wait=False, tell=str)
    try:
        page, session = studio.page, studio.session
        changes = (
            lambda: session.drag(shifted(-0.05, 0.08)),
            lambda: session.move_self("arm angle", 0.1),
            lambda: session.set_loop(circle_loop(TOOL[:3, 3] - [0, 0.05, 0], 0.05, near=TOOL[:3, 3])),
            lambda: session.set_clockwise(True),
            lambda: session.set_cycles(7),
            lambda: session.remove_law("pseudo-inverse"),
            lambda: session.reset(),
        )
        states = [stood(session)]
        for change in changes:
            page.ask(change)
            page_thread_done(page)
            states.append(stood(session))
        assert all(a != b for a, b in pairwise(states))
        for wanted in states[-2::-1]:
            page.ask(page.undo_last)
            page_thread_done(page)
            assert stood(session) == wanted
        assert page.panels.cycles.value == (session.snapshot().cycles or 0)
        page.ask(page.undo_last)  # there is nothing before
        page_thread_done(page)
        assert stood(session) == states[0] and page.undo.steps == (False, True)
        for wanted in states[1:]:
            page.ask(page.redo_next)
            page_thread_done(page)
            assert stood(session) == wanted
        page.ask(page.undo_last)
        page.ask(lambda: session.set_cycles(9))  # after a change nothing is left to be redone
        page_thread_done(page)
        assert page.undo.steps == (True, False)
    finally:
        studio.close()


def test_a_drag_of_many_small_moves_is_undone_as_one_and_a_law_is_undone_to_its_leaf() -> None:
    studio = hk.studio(panda(), port=0, browser=False, wait=False, tell=str)
    try:
        page, session = studio.page, studio.session
        first = stood(session)
        for k in range(1, 6):
            page.ask(lambda k=k: session.drag(shifted(-0.01 * k, 0.0)), "tool0")
            page_thread_done(page)
        page.ask(page.undo_last)
        page_thread_done(page)
        assert stood(session) == first
        after = session.drag(shifted(0.0, 0.05))  # laws go on from their leaves
        assert after.following
        wanted = panda().drag(shifted(0.0, 0.05)).law("lock").q
        assert after.law("lock").q == pytest.approx(wanted, abs=1e-9)
    finally:
        studio.close()
