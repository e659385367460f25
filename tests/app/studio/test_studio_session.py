"""The studio without a page: what a session's strategies do when their tool is dragged, or runs round a loop."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.app.studio import (
    NamedStrategy,
    Phase,
    Session,
    Snapshot,
    StrategyStatus,
    circle_loop,
    polygon_loop,
    reversed_loop,
    to_job,
)
from sessions import FRAME, PANDA, STRATEGIES, TASK, TOOL, panda, run, shifted


def test_the_ghost_of_the_pseudo_inverse_creeps_as_drift_says_and_the_holonomic_one_returns() -> None:
    session = panda(cycles=2)
    end = run(session, 0.0501)
    loop = session.loop
    assert loop is not None and end.cycle == 2 and end.progress == 1.0
    for strategy, state in zip(session.strategies, end.strategies, strict=True):
        assert strategy.G is not None
        referee = hk.drift(strategy.G, loop.path, PANDA_START, cycles=2, samples=100)
        np.testing.assert_allclose(state.drift_joints, referee.since_start, atol=1e-12)
        np.testing.assert_allclose(state.drift, referee.largest, atol=1e-12)
        np.testing.assert_allclose(state.history, referee.trajectory.q, atol=1e-12)
        np.testing.assert_allclose(state.t, referee.trajectory.t, atol=1e-9)
    assert end.strategy("pseudo-inverse").drift[-1] > 0.3  # 0.1635, 0.3207 of the README
    assert end.strategy("lock").drift[-1] < 1e-12 and end.strategy("arm angle").drift[-1] < 1e-12


def test_a_corner_clicked_twice_is_left_out_of_the_loop_and_the_session_says_so() -> None:
    session, at = panda(), TOOL[:3, 3]
    corners = at + np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 1e-9, 0], [0.05, 0.05, 0]])
    shown = session.set_loop(polygon_loop(corners))
    assert session.loop is not None and len(session.loop.path.durations) == 3
    assert shown.message == "1 repeated point left out, within 1e-07 m of the one before."
    assert session.set_loop(polygon_loop(corners[[0, 1, 3]])).message == ""


def test_frames_of_any_length_and_any_speed_lead_to_the_same_joints() -> None:
    ends = []
    for dt, factor in ((0.013, 1.0), (0.4, 3.0), (50.0, 1.0)):
        session = panda(STRATEGIES[:1], cycles=2)
        session.set_speed(factor)
        ends.append(run(session, dt).strategy("pseudo-inverse").q)
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_the_other_way_round_drifts_as_the_reversed_path_does() -> None:
    session = panda(STRATEGIES[:1], cycles=1)
    session.set_clockwise(True)
    end, loop = run(session), session.loop
    assert loop is not None and loop.clockwise and end.clockwise
    assert loop.path.counter_clockwise is not panda().loop.path.counter_clockwise  # type: ignore[union-attr]
    referee = hk.drift(STRATEGIES[0].G, loop.path, PANDA_START, samples=100)  # type: ignore[arg-type]
    np.testing.assert_allclose(end.strategy("pseudo-inverse").drift, referee.largest, atol=1e-12)


def test_a_paused_loop_holds_still_and_goes_on_where_it_was() -> None:
    session = panda(cycles=1)
    session.play()
    for _ in range(60):
        session.advance(FRAME)
    before = session.pause()
    assert session.advance(1.0) is session.snapshot()
    for a, b in zip(before.strategies, session.snapshot().strategies, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
    session.play()
    while session.advance(FRAME).phase is not Phase.DONE:
        pass
    np.testing.assert_allclose(
        session.snapshot().strategy("pseudo-inverse").drift, run(panda(STRATEGIES[:1], cycles=1)).strategies[0].drift
    )


def test_before_a_loop_begins_the_joints_go_there_without_a_jump() -> None:
    session = panda(cycles=1)
    session.drag(shifted(-0.15, 0.2, 0.1))
    before = session.play()
    assert before.phase is Phase.GATHERING
    far = max(float(np.abs(state.q - PANDA_START).max()) for state in before.strategies)
    while before.phase is Phase.GATHERING:
        after = session.advance(FRAME)
        for a, b in zip(before.strategies, after.strategies, strict=True):
            assert np.abs(a.q - b.q).max() <= 1.01 * far * FRAME / 0.8
        before = after
    for state in before.strategies:
        np.testing.assert_allclose(state.q, PANDA_START, atol=1e-12)


def drag_along(session: Session, points: np.ndarray) -> Iterator[tuple[Snapshot, Snapshot]]:
    """Snapshots before and after each drag to a place of the tool, its rotation as at the start."""
    before = session.snapshot()
    for point in points:
        pose = TOOL.copy()
        pose[:3, 3] = point
        after = session.drag(pose)
        yield before, after
        before = after


@pytest.mark.campaign
def test_a_drag_out_of_reach_and_back_loses_nothing_and_jumps_nowhere() -> None:
    session = panda()
    out = np.linspace(TOOL[:3, 3], TOOL[:3, 3] + [0.4, 0.0, 0.12], 240)  # by 1.7 mm
    seen: dict[str, set[StrategyStatus]] = {state.name: set() for state in session.snapshot().strategies}
    for before, after in drag_along(session, np.vstack([out, out[::-1]])):
        for a, b in zip(before.strategies, after.strategies, strict=True):
            assert np.abs(a.q - b.q).max() < 0.2
            seen[b.name].add(b.status)
            PANDA.check_limits(b.q)
            if b.following:
                assert np.abs(TASK.error(b.q, after.target[0, :3, 3], after.target[0, :3, :3])).max() < 1e-8
            else:
                np.testing.assert_array_equal(a.q, b.q)  # it stays where it was
                assert b.sentence.endswith(".") and ";" in b.sentence
    for state in session.snapshot().strategies:
        assert seen[state.name] - {StrategyStatus.FOLLOWING}, f"{state.name} was never out of reach"
        assert StrategyStatus.SINGULAR not in seen[state.name], "it is the arm that is stretched, not the strategy"
        assert state.following and state.sentence == ""
        if state.holonomic:
            np.testing.assert_allclose(state.q, PANDA_START, atol=1e-9)


def test_a_holonomic_strategy_has_the_same_joints_at_a_pose_whatever_way_the_hand_took() -> None:
    session, goal = panda(), TOOL[:3, 3] + np.array([-0.1, 0.15, 0.1])
    ends = []
    for corner in ([0.1, 0.2, 0.0], [-0.2, -0.1, 0.2]):
        session.reset()
        way = np.vstack(
            [np.linspace(TOOL[:3, 3], TOOL[:3, 3] + corner, 30), np.linspace(TOOL[:3, 3] + corner, goal, 30)]
        )
        for _, after in drag_along(session, way):
            assert after.following
        ends.append(session.snapshot())
    a, b = ends
    for name in ("lock", "arm angle"):
        np.testing.assert_allclose(a.strategy(name).q, b.strategy(name).q, atol=1e-12)
    assert np.abs(a.strategy("pseudo-inverse").q - b.strategy("pseudo-inverse").q).max() > 0.005


def test_a_joint_at_its_limit_is_named() -> None:
    session = panda()
    turned = TOOL.copy()
    sentence = ""
    for angle in np.linspace(0.0, 3.0, 60):
        c, s = np.cos(angle), np.sin(angle)
        turned[:3, :3] = TOOL[:3, :3] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        state = session.drag(turned).strategy("lock")
        if state.status is StrategyStatus.LIMIT:
            sentence = state.sentence
            break
    assert sentence.startswith("panda_joint7 would pass its limit of 2.89")


def test_two_hands_at_once_leave_a_consistent_state() -> None:
    session, stop, problems = panda(), threading.Event(), []
    goals = [shifted(-0.1, 0.1), shifted(-0.05, -0.15, 0.1)]

    def hand(goal: np.ndarray) -> None:
        try:
            for k in range(60):
                pose = goal.copy()
                pose[2, 3] += 0.0005 * k
                session.drag(pose)
        except BaseException as problem:  # noqa: BLE001
            problems.append(problem)

    def eye() -> None:
        while not stop.is_set():
            snap = session.snapshot()
            for state in snap.strategies:
                off = np.abs(TASK.error(state.q, snap.target[0, :3, 3], snap.target[0, :3, :3])).max()
                if not (state.following and off < 1e-8):
                    problems.append(AssertionError(f"{state.name}: {off}"))

    watcher = threading.Thread(target=eye)
    hands = [threading.Thread(target=hand, args=(goal,)) for goal in goals]
    watcher.start()
    for one in hands:
        one.start()
    for one in hands:
        one.join()
    stop.set()
    watcher.join()
    assert not problems
    assert session.snapshot().number >= 120


def test_a_snapshot_never_changes() -> None:
    session = panda(cycles=2)
    session.play()
    for _ in range(40):
        old = session.advance(FRAME)
    kept = [(state.q.copy(), state.t.copy(), state.history.copy()) for state in old.strategies]
    run(session)
    for state, (q, t, history) in zip(old.strategies, kept, strict=True):
        np.testing.assert_array_equal(state.q, q)
        np.testing.assert_array_equal(state.t, t)
        np.testing.assert_array_equal(state.history, history)
        for array in (state.q, state.t, state.history, state.drift):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0


def test_a_long_run_keeps_its_history_in_bounded_memory() -> None:
    from holokin.app.studio.states import History

    history = History(2, rows=64)
    t = np.arange(5000.0)
    for first in range(0, 5000, 7):
        history.add(t[first : first + 7], np.column_stack([t, -t])[first : first + 7])
    seen, q = history.view()
    assert 30 <= len(seen) <= 64 and seen[0] == 0.0 and seen[-1] > 4800
    assert len(set(np.diff(seen))) == 1  # evenly
    np.testing.assert_array_equal(q, np.column_stack([seen, -seen]))


def test_a_control_law_of_ones_own_runs_as_simulate_runs_it() -> None:
    rule = hk.controller(hk.moore_penrose(TASK), dt=0.05, gain=2.0)
    session = Session([NamedStrategy("mine", rule, TASK)], PANDA_START, panda().loop, cycles=2)
    end, loop = run(session), session.loop
    assert loop is not None
    referee = hk.simulate(rule, TASK, loop.path, PANDA_START, dt=loop.path.duration / 100, cycles=2)
    np.testing.assert_allclose(end.strategies[0].q, referee.q[-1], atol=1e-12)
    assert session.drag(shifted(-0.05, 0.05)).strategies[0].following
    with pytest.raises(hk.HolokinError, match="a job names"):
        to_job(session)


@pytest.mark.campaign
def test_a_strategy_that_meets_its_end_on_a_loop_stops_there_and_the_others_go_on() -> None:
    session = panda(cycles=1)
    session.set_loop(circle_loop(TOOL[:3, 3] + [0.25, 0, 0], 0.25, near=TOOL[:3, 3], samples=100))
    session.play()
    told: set[str] = set()
    while (snap := session.advance(FRAME)).phase is not Phase.DONE:
        told |= {state.name for state in snap.strategies if state.sentence}
    for state in snap.strategies:  # it comes back within their reach, and they go on
        assert state.name in told and state.following and np.isnan(state.drift).all()
    session.set_loop(reversed_loop(reversed_loop(panda().loop)))  # type: ignore[arg-type]
    assert run(session).following
