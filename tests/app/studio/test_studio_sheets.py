"""The sheets of a session: an arm that follows them, its changes with the tool at rest, and poses of no sheet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import write_job
from handmade_sheets import planar_map
from holokin.analysis.sheets import PoseRest, Sheets
from holokin.app.studio import Session, open_session
from holokin.app.studio.strategies import NamedStrategy
from holokin.app.studio.work import SheetFollower
from holokin.base.errors import ArgumentError
from sessions import until

HOME = np.array([0.2, 0.9, 0.9])


@pytest.fixture
def session() -> Iterator[tuple[Session, SheetFollower, Sheets]]:
    """A planar arm with its pseudo-inverse, and a map of three sheets that is known at once."""
    found = planar_map()
    strategies = [
        NamedStrategy("pinv", hk.moore_penrose(found.task), found.task),
        NamedStrategy("other", found.sheets[2].strategy, found.task),
    ]
    one = Session(strategies, HOME).with_sheets(lambda _say: found)
    one.find_sheets()
    assert one.sheets is not None
    until(lambda: one.sheets is not None and one.sheets.state.count == 3)
    yield one, one.sheets, found
    one.close()


def at(x: float, y: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, 3] = x, y
    return pose


def test_the_panel_knows_which_sheet_serves_the_tool_also_where_no_arm_follows(session: tuple) -> None:
    one, sheets, found = session
    for x, y in ((1.2, 0.4), (-0.3, 1.9), (0.5, -2.0)):
        one.drag(at(x, y))
        assert sheets.state.sheet == found([x, y])[0]
        assert sheets.state.strategy == ""


def test_an_arm_that_follows_has_the_joints_of_its_sheet_and_the_others_their_own(session: tuple) -> None:
    one, sheets, found = session
    one.follow_sheets("pinv")
    assert sheets.state.strategy == "pinv" and sheets.state.sheet == 0
    q = one.snapshot().strategy("pinv").q
    for angle in np.linspace(0.0, 1.0, 12):
        x, y = 1.6 * np.cos(angle), 1.6 * np.sin(angle)
        one.drag(at(x, y))
        sheet, q = found.near([x, y], q)
        assert sheet == sheets.state.sheet == 0
        np.testing.assert_allclose(one.snapshot().strategy("pinv").q, q, atol=1e-9)
    assert np.abs(one.snapshot().strategy("other").q - q).max() > 1e-3


def test_a_change_is_a_self_motion_with_the_tool_at_rest_and_then_the_arm_goes_on(session: tuple) -> None:
    one, sheets, found = session
    one.follow_sheets("pinv")
    changed = 0
    there = np.linspace(0.0, np.pi, 90)
    for angle in np.concatenate([there, there[::-1], -there]):  # the hand goes, it does not leap
        target = at(1.2 * np.cos(angle), 1.2 * np.sin(angle))
        before = one.snapshot().strategy("pinv").q
        one.drag(target)
        strategy = one.snapshot().strategy("pinv")
        if not sheets.state.sentence.startswith("Changes"):
            continue
        changed += 1
        rest = found.task.pose(before)[:2, 3]
        for _ in range(200):
            one.advance(0.1)
            strategy = one.snapshot().strategy("pinv")
            if strategy.following:
                break
            np.testing.assert_allclose(found.task.pose(strategy.q)[:2, 3], rest, atol=1e-3)
            assert found.task.robot.within(strategy.q[None]).all()
        assert strategy.following
        np.testing.assert_allclose(found.task.pose(strategy.q)[:2, 3], target[:2, 3], atol=1e-9)
        assert sheets.state.sheet in found.of(strategy.q)
    assert changed >= 1


def test_where_no_self_motion_leads_on_the_arm_rests_and_says_why(session: tuple) -> None:
    one, sheets, found = session
    alone = replace(found, sheets=found.sheets[:2], q=found.q[:2], labels=np.where(found.labels > 1, 0, found.labels))
    sheets.sheet_map = alone
    one.follow_sheets("pinv")
    rests = []
    for angle in np.linspace(0.0, -2.6, 120):
        before = one.snapshot().strategy("pinv").q
        one.drag(at(1.2 * np.cos(angle), 1.2 * np.sin(angle)))
        strategy = one.snapshot().strategy("pinv")
        if not strategy.following and not sheets.state.sentence.startswith(("Changes", "No sheet")):
            np.testing.assert_array_equal(strategy.q, before)
            rests.append(sheets.state.sentence)
    assert rests
    assert all("no self-motion leads there" in said for said in rests)


def test_a_pose_that_no_sheet_serves_leaves_the_arm_at_rest_and_the_reason_is_found_in_a_thread(session: tuple) -> None:
    one, sheets, _ = session
    one.follow_sheets("pinv")
    before = one.snapshot().strategy("pinv").q
    one.drag(at(3.4, 0.0))
    strategy = one.snapshot().strategy("pinv")
    assert not strategy.following and sheets.state.sheet == -1
    np.testing.assert_array_equal(strategy.q, before)
    reason = PoseRest.OUT_OF_REACH.text
    until(lambda: reason[1:] in sheets.state.why)


def test_an_arm_that_follows_no_more_keeps_its_posture_and_has_its_strategy_again(session: tuple) -> None:
    one, sheets, _ = session
    one.follow_sheets("other")
    for _ in range(40):
        one.advance(0.1)
    q = one.snapshot().strategy("other").q
    one.follow_sheets(None)
    assert sheets.state.strategy == ""
    np.testing.assert_array_equal(one.snapshot().strategy("other").q, q)
    one.drag(at(1.4, 1.1))
    strategy = one.snapshot().strategy("other")
    assert strategy.following
    assert strategy.q[1] == pytest.approx(q[1], abs=1e-9)  # its lock, on the leaf where it stood


def test_a_job_with_sheets_has_them_in_its_session_and_another_has_none(tmp_path: Path) -> None:
    plain = open_session("ppr-cycle")
    assert plain.sheets is None
    with pytest.raises(ArgumentError, match="a table"):
        plain.find_sheets()
    parts = {
        "robot": '[robot]\nname = "planar-3r"\n', "start": "[start]\nq = [0.3, 0.9, 0.7]\n",
        "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 20\n',
        "strategies": '[strategies.lock]\nkind = "lock"\njoints = [2]\n[sheets]\nfile = "none.npz"\n',
    }  # fmt: skip
    one = open_session(str(write_job(tmp_path, **parts)))
    try:
        assert one.sheets is not None
        one.find_sheets()
        until(lambda: one.sheets is not None and "none.npz" in one.sheets.state.searching)
    finally:
        one.close()


def test_a_hand_that_leaps_does_not_make_the_joints_leap(session: tuple) -> None:
    """From any place to any other: the arm goes where the leaf leads straight from its posture, changes, or rests."""
    one, sheets, found = session
    one.follow_sheets("pinv")
    rng, went = np.random.default_rng(1), 0
    for radius, angle in zip(rng.uniform(0.5, 2.5, 40), rng.uniform(-np.pi, np.pi, 40), strict=True):
        before, target = one.snapshot().strategy("pinv").q, at(radius * np.cos(angle), radius * np.sin(angle))
        one.drag(target)
        strategy = one.snapshot().strategy("pinv")
        if strategy.following:
            went += 1
            on = found.sheets[sheets.state.sheet].reached(before[None], target[None])[0][0]
            np.testing.assert_allclose(strategy.q, on, atol=1e-6)
        else:
            np.testing.assert_array_equal(strategy.q, before)
    assert 5 < went < 40
