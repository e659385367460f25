"""The controls of the page: what they say and show, and what each of them changes. No browser."""

from __future__ import annotations

import io
import json
import re
import threading
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from html import escape
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.app.report.plots import law_colors, rgb
from holokin.app.studio.stage import circle_of
from holokin.app.studio.states import UNITS, difference, figure
from holokin.base.units import SI
from sessions import panda, served, until
from sessions import run as run_to_the_end

pytest.importorskip("viser", reason="the extra `studio` is not installed")
from holokin.app.studio.page_scene import linear
from holokin.app.studio.side_panels import _back_and_away


@pytest.fixture
def studio() -> Iterator[Any]:
    """A studio with the smallest job."""
    with served() as page:
        yield page


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


@pytest.mark.campaign
def test_in_degrees_and_mm_all_numbers_of_the_page_say_the_same_and_the_loop_stays_where_it_is(studio: Any) -> None:
    """The planar arm has hinges and a slider: a drift in mixed units is that of the joint that went most in them."""
    page, session = studio.page, studio.session
    run_to_the_end(session)
    snap, loop = session.snapshot(), page.panels.loop
    assert {c.unit for c in session.robot.coordinates} == {"rad", "m"}
    before = loop.center.value, loop.radius.value, loop.radius.min, loop.radius.max
    choose(page, page.panels.units, "deg, mm")
    page.close()  # its thread: from here the test draws
    assert loop.center.label == "Centre [mm]" and loop.radius.label == "Radius [mm]"
    assert np.array(loop.center.value) == pytest.approx(1000 * np.array(before[0]), rel=1e-9)
    assert loop.radius.value == pytest.approx(1000 * before[1], rel=1e-9)
    page.charts.draw(snap)
    factors = [180 / np.pi if c.unit == "rad" else 1000 for c in session.robot.coordinates]
    for row, state in enumerate(snap.strategies, 1):
        wanted = max(abs(factor * joint) for factor, joint in zip(factors, state.drift_joints[-1], strict=True))
        assert page.charts.drift.data[row][-1] == pytest.approx(wanted, abs=1e-12)
        shown = "none" if state.drift[-1] < 1e-6 else f"{float(f'{wanted:.3g}'):g}"
        assert f">{shown}<" in page.panels._table(snap)
    assert "deg or mm" in page.charts.title.content
    loop._make()
    assert circle_of(session.loop)[2] == pytest.approx(before[1], rel=1e-9)  # type: ignore[index]
    page.set_units(UNITS["rad, m"])
    now = loop.center.value, loop.radius.value, loop.radius.min, loop.radius.max
    for value, then in zip(now, before, strict=True):
        assert value == pytest.approx(then, rel=1e-9)
    page.charts.draw(snap)
    for row, state in enumerate(snap.strategies, 1):
        assert page.charts.drift.data[row][-1] == pytest.approx(state.drift[-1], abs=1e-12)


@pytest.mark.campaign
def test_a_slider_in_degrees_moves_the_arm_as_far_as_one_in_radians() -> None:
    units = UNITS["deg, mm"]
    with served(panda()) as studio:
        page, panel = studio.page, studio.page.panels.posture
        page.close()  # its thread: the test draws
        page.set_units(units)
        choose_strategy(panel, "lock", studio.session)
        assert panel.self_motion.label == f"Self-motion [{units.angle}]"
        panel.self_motion.value = units.factor("rad") * 0.2
        panel._move("self-motion")
        wanted = panda().move_self("lock", 0.2).strategy("lock").q
        assert np.abs(wanted - PANDA_START).max() > 0.05
        assert studio.session.snapshot().strategy("lock").q == pytest.approx(wanted, abs=1e-9)


def choose_strategy(panel: Any, name: str, session: Any) -> None:
    """Its sliders are those of a strategy; they are drawn when the posture has stood still for two pictures."""
    panel.strategy.value = name
    for _ in range(2):
        panel.draw(session.snapshot())


class Browser:
    """A browser that keeps what it downloads."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}

    def send_file_download(self, name: str, content: bytes, save_immediately: bool) -> None:
        self.files[name] = content


@pytest.fixture(scope="module")
def worked() -> Iterator[Any]:
    """A studio on a Panda with one cycle of its loop to run."""
    with served(panda(cycles=1, title="Bolts & nuts")) as studio:
        studio.page.panels.work.strategy.value = "lock"
        yield studio


def test_the_program_of_a_strategy_begins_and_ends_where_the_strategy_does_on_the_loop(worked: Any) -> None:
    """The program of ROS, and all samples; the third joint, which the strategy locks, stands still."""
    panel, browser = worked.page.panels.work, Browser()
    panel.language.value = "ros"
    panel._work(browser, panel._program)
    assert worked.page.message == ""
    (name, content), *others = browser.files.items()
    assert name == "bolts-nuts-ros.zip" and not others
    with zipfile.ZipFile(io.BytesIO(content)) as box:
        assert len(box.namelist()) == 3  # with the facts beside it
        samples = np.loadtxt(io.StringIO(box.read("joints.csv").decode()), delimiter=",", skiprows=1)
        source = next(box.read(one).decode() for one in box.namelist() if one.endswith(".yaml"))
    joints = samples[:, 1:8]
    assert joints[0] == pytest.approx(PANDA_START, abs=1e-6) and joints[-1] == pytest.approx(PANDA_START, abs=1e-6)
    assert np.ptp(joints[:, 2]) < 1e-9 < np.ptp(joints[:, 0])  # the third joint is locked
    steps = np.diff(joints, n=2, axis=0) / (samples[1, 0] - samples[0, 0]) ** 2
    assert np.abs(steps).max() < 1.02 * panel.acceleration.value
    points = [one.split(",") for one in re.findall(r'positions"?: \[([^]]*)\]', source)]
    for point, wanted in ((points[0], joints[0]), (points[-1], joints[-1])):
        assert [float(one) for one in point] == pytest.approx(wanted, abs=1e-6)


def test_a_strategy_with_leaves_is_certified_from_the_page_and_one_without_is_not_and_says_why(worked: Any) -> None:
    panel, browser = worked.page.panels.work, Browser()
    panel._work(browser, panel._certificate)
    assert "All along the path the joints follow the tool without a jump" in panel.answer.content
    (name, content), *others = browser.files.items()
    assert name == "bolts-nuts-certificate.json" and not others
    assert json.loads(content)
    panel.strategy.value = "pseudo-inverse"
    panel._work(browser, panel._certificate)
    panel.strategy.value = "lock"
    assert "is not certified" in panel.answer.content and "no leaves" in panel.answer.content
    assert len(browser.files) == 1


def test_what_cannot_be_written_is_said_in_the_page_and_nothing_is_downloaded(worked: Any) -> None:
    panel, browser, session = worked.page.panels.work, Browser(), worked.session
    panel.language.value = "rapid"  # which needs to be told what its seventh axis is
    panel._work(browser, panel._program)
    assert "RAPID holds 6 axes" in worked.page.message and "Save the job" in worked.page.message
    assert "/tmp" not in worked.page.message
    loop = session.loop
    session.set_loop(None)
    panel._work(browser, panel._program)
    assert "a job has a path" in worked.page.message and browser.files == {} and panel.answer.content == ""
    session.set_loop(loop)


@pytest.mark.campaign
def test_advice_in_the_page_is_that_of_advise(worked: Any) -> None:
    panel = worked.page.panels.work
    panel._work(Browser(), panel._advice)
    found = hk.advise(hk.pose(worked.session.robot), q0=worked.session.home)
    assert f"The best is {escape(found.best.name)}." in panel.answer.content
    assert all(escape(reason) in panel.answer.content for reason in found.reasons)


def test_the_status_names_who_is_back_who_is_not_and_who_stopped_and_no_number_is_a_power_of_ten() -> None:
    session = panda(cycles=1)
    end = run_to_the_end(session)
    assert _back_and_away(end) == "Back at the start: lock, arm angle. Not back: pseudo-inverse."
    lost = replace(end.strategy("lock"), drift=np.array([np.nan]))
    others = tuple(lost if state.name == "lock" else state for state in end.strategies)
    assert "Back at the start: arm angle. " in _back_and_away(replace(end, strategies=others))
    assert _back_and_away(replace(end, strategies=others)).endswith("Stopped on the way: lock.")
    assert _back_and_away(session.reset()) == ""
    drifts = {state.name: difference(SI, session.robot, state.drift_joints[-1]) for state in end.strategies}
    assert drifts == {
        "pseudo-inverse": f"{end.strategy('pseudo-inverse').drift[-1]:.3g}",
        "lock": "none",
        "arm angle": "none",
    }
    for value in np.logspace(-9, 6, 31) * 1.2345:
        assert "e" not in figure(value) and float(figure(value)) == pytest.approx(value, rel=5e-3)


def test_robots_and_lines_have_the_colours_of_reports_also_where_a_verdict_tells_that_joints_return(
    studio: Any,
) -> None:
    """Of ppr-cycle the strategy `paper` has no leaves that are known, and is holonomic: cool in reports."""
    import trimesh

    page, scene = studio.page, studio.page.scene
    wanted = law_colors([False, True, True])
    assert [strategy.holonomic for strategy in studio.session.strategies] == [False, False, True]
    until(lambda: page.colors == wanted and scene.colors == wanted)
    page_thread_done(page)
    for plot in (page.charts.drift, page.charts.history):
        assert tuple(line["stroke"] for line in plot.series[1:]) == wanted
        assert [bool(line["dash"]) for line in plot.series[1:]] == [True, False, False]
    for ghost in scene._ghosts:
        assert (ghost.batched_colors == linear([rgb(color) for color in wanted])).all()
    until(lambda: 'paper</b> <span style="color:#8A919C">holonomic' in page.panels.table.content)
    # The solid robot has three quarters of its strategy's colour, and that of another strategy when it is chosen.
    for index in (2, 0):
        page.ask(lambda index=index: page.set_lead(index))
        page_thread_done(page)
        for look, part in zip(scene.looks, scene._solid, strict=True):
            (mesh,) = trimesh.load_scene(io.BytesIO(part.glb_data), file_type="glb").geometry.values()
            found = np.unique(np.asarray(mesh.visual.vertex_attributes["color"])[:, :3], axis=0)
            mixed = np.unique(linear(0.75 * np.array(rgb(wanted[index])) + 0.25 * look.colors), axis=0)
            assert (found == mixed).all()


def test_a_narrow_browser_has_the_plots_as_a_bar_once_and_a_wide_one_keeps_them(studio: Any) -> None:
    page, sent = studio.page, []
    page.close()  # its thread: the test draws

    def browser(number: int, wide: int, high: int) -> Any:
        api = SimpleNamespace(
            _panel_lifecycle_lock=threading.RLock(), _layout_run_id="one", _next_layout_counter=lambda: 1
        )
        api._websock_interface = SimpleNamespace(queue_message=lambda message: sent.append((number, message)))
        return SimpleNamespace(gui=api, camera=SimpleNamespace(image_width=wide, image_height=high))

    windows = {0: browser(0, 404, 768), 1: browser(1, 820, 900), 2: browser(2, 1300, 1080)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page.server, "get_clients", lambda: windows)
        for _ in range(3):
            page.charts.draw(studio.session.snapshot())
    assert [(number, message.uuid, message.collapsed) for number, message in sent] == [
        (0, page.charts._panel._placement_uuid, True)
    ]
