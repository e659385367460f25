"""The studio without a page: what a session's laws do when their tool is dragged, or runs round a loop."""

from __future__ import annotations

import threading
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_START, urdf
from holokin.job import Job, packaged_jobs, run_job
from holokin.studios import (
    Law,
    LawStatus,
    Origin,
    Phase,
    Session,
    Snapshot,
    circle_loop,
    eight_loop,
    open_session,
    polygon_loop,
    reversed_loop,
    session_of_robot,
    to_job,
    write_job,
)

PANDA = hk.load("panda")
TASK = hk.pose(PANDA)
FRAME = 1 / 30
ROBOT = {"name": "panda"}


def panda_laws() -> list[Law]:
    """The pseudo-inverse, a joint locked and the arm angle: compiled once for all tests."""
    kinds = {
        "pseudo-inverse": (hk.moore_penrose(TASK), {"kind": "moore-penrose"}),
        "lock": (hk.holonomic(TASK, hk.lock("panda_joint3")), {"kind": "lock", "joints": ["panda_joint3"]}),
        "arm angle": (hk.holonomic(TASK, hk.arm_angle()), {"kind": "arm-angle"}),
    }
    return [Law(name, i, rule, TASK, None, keys) for i, (name, (rule, keys)) in enumerate(kinds.items())]


LAWS = panda_laws()
TOOL = PANDA.pose(PANDA_START)


def panda(**more: object) -> Session:
    """A session of three laws on a circle of 0.1 m that begins at the tool."""
    loop = circle_loop(TOOL[:3, 3] - [0.1, 0, 0], 0.1, near=TOOL[:3, 3], samples=100)
    origin = Origin(ROBOT, {"kind": "pose", "orientation": "twist"}, Path.cwd())
    return Session(LAWS, PANDA_START, loop, origin=origin, **more)  # type: ignore[arg-type]


def run(session: Session, dt: float = FRAME, most: int = 5000) -> Snapshot:
    """The loop to its end."""
    found = session.play()
    for _ in range(most):
        found = session.advance(dt)
        if found.phase is Phase.DONE:
            return found
    raise AssertionError("the loop did not end")


def shifted(dx: float, dy: float = 0.0, dz: float = 0.0) -> np.ndarray:
    """The tool pose at the start, moved."""
    pose = TOOL.copy()
    pose[:3, 3] += [dx, dy, dz]
    return pose


def test_the_ghost_of_the_pseudo_inverse_creeps_as_drift_says_and_the_holonomic_one_returns() -> None:
    session = panda(cycles=3)
    end = run(session, 0.0501)
    loop = session.loop
    assert loop is not None and end.cycle == 3 and end.progress == 1.0
    for law, state in zip(session.laws, end.laws, strict=True):
        assert law.strategy is not None
        referee = hk.drift(law.strategy, loop.path, PANDA_START, cycles=3, samples=100)
        np.testing.assert_allclose(state.drift_joints, referee.since_start, atol=1e-12)
        np.testing.assert_allclose(state.drift, referee.largest, atol=1e-12)
        np.testing.assert_allclose(state.history, referee.trajectory.q, atol=1e-12)
        np.testing.assert_allclose(state.t, referee.trajectory.t, atol=1e-9)
    assert end.law("pseudo-inverse").drift[-1] > 0.4  # 0.1635, 0.3207, 0.4756 of the README
    assert end.law("lock").drift[-1] < 1e-12 and end.law("arm angle").drift[-1] < 1e-12


def test_frames_of_any_length_and_any_speed_lead_to_the_same_joints() -> None:
    ends = []
    for dt, factor in ((0.013, 1.0), (0.4, 3.0), (50.0, 1.0)):
        session = panda(cycles=2)
        session.set_speed(factor)
        ends.append(run(session, dt).law("pseudo-inverse").q)
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_the_other_way_round_drifts_as_the_reversed_path_does() -> None:
    session = panda(cycles=1)
    session.set_clockwise(True)
    end, loop = run(session), session.loop
    assert loop is not None and loop.clockwise and end.clockwise
    assert loop.path.counter_clockwise is not panda().loop.path.counter_clockwise  # type: ignore[union-attr]
    referee = hk.drift(LAWS[0].strategy, loop.path, PANDA_START, samples=100)  # type: ignore[arg-type]
    np.testing.assert_allclose(end.law("pseudo-inverse").drift, referee.largest, atol=1e-12)


def test_a_paused_loop_holds_still_and_goes_on_where_it_was() -> None:
    session = panda(cycles=1)
    session.play()
    for _ in range(60):
        session.advance(FRAME)
    before = session.pause()
    assert session.advance(1.0) is session.snapshot()
    for a, b in zip(before.laws, session.snapshot().laws, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
    session.play()
    while session.advance(FRAME).phase is not Phase.DONE:
        pass
    np.testing.assert_allclose(session.snapshot().law("pseudo-inverse").drift, run(panda(cycles=1)).laws[0].drift)


def test_before_a_loop_begins_the_joints_go_there_without_a_jump() -> None:
    session = panda(cycles=1)
    session.drag(shifted(-0.15, 0.2, 0.1))
    before = session.play()
    assert before.phase is Phase.GATHERING
    far = max(float(np.abs(state.q - PANDA_START).max()) for state in before.laws)
    while before.phase is Phase.GATHERING:
        after = session.advance(FRAME)
        for a, b in zip(before.laws, after.laws, strict=True):
            assert np.abs(a.q - b.q).max() <= 1.01 * far * FRAME / 0.8
        before = after
    for state in before.laws:
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


def test_a_drag_out_of_reach_and_back_loses_nothing_and_jumps_nowhere() -> None:
    session = panda()
    out = np.linspace(TOOL[:3, 3], TOOL[:3, 3] + [0.4, 0.0, 0.12], 240)  # by 1.7 mm
    seen: dict[str, set[LawStatus]] = {state.name: set() for state in session.snapshot().laws}
    for before, after in drag_along(session, np.vstack([out, out[::-1]])):
        for a, b in zip(before.laws, after.laws, strict=True):
            assert np.abs(a.q - b.q).max() < 0.2
            seen[b.name].add(b.status)
            PANDA.check_limits(b.q)
            if b.following:
                assert np.abs(TASK.error(b.q, after.target[0, :3, 3], after.target[0, :3, :3])).max() < 1e-8
            else:
                np.testing.assert_array_equal(a.q, b.q)  # it stays where it was
                assert b.sentence.endswith(".") and ";" in b.sentence
    for state in session.snapshot().laws:
        assert seen[state.name] - {LawStatus.FOLLOWING}, f"{state.name} was never out of reach"
        assert LawStatus.SINGULAR not in seen[state.name], "it is the arm that is stretched, not the law"
        assert state.following and state.sentence == ""
        if state.holonomic:
            np.testing.assert_allclose(state.q, PANDA_START, atol=1e-9)


def test_a_holonomic_law_has_the_same_joints_at_a_pose_whatever_way_the_hand_took() -> None:
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
        np.testing.assert_allclose(a.law(name).q, b.law(name).q, atol=1e-12)
    assert np.abs(a.law("pseudo-inverse").q - b.law("pseudo-inverse").q).max() > 0.005


def test_a_joint_at_its_limit_is_named() -> None:
    session = panda()
    turned = TOOL.copy()
    sentence = ""
    for angle in np.linspace(0.0, 3.0, 60):
        c, s = np.cos(angle), np.sin(angle)
        turned[:3, :3] = TOOL[:3, :3] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        state = session.drag(turned).law("lock")
        if state.status is LawStatus.LIMIT:
            sentence = state.sentence
            break
    assert sentence.startswith("panda_joint7 would pass its limit of 2.89")


def test_self_motion_holds_the_tool_and_pinocchio_agrees() -> None:
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(urdf("panda.urdf")))
    data = model.createData()

    def tool(q: np.ndarray) -> np.ndarray:
        pinocchio.framesForwardKinematics(model, data, np.concatenate([q, np.zeros(model.nq - 7)]))
        return data.oMf[model.getFrameId("panda_link8")].homogeneous.copy()

    session = panda()
    slider = session.self_motion("pseudo-inverse")
    assert slider.low < 0.0 < slider.high and slider.unit == "rad" and slider.value == 0.0
    before = tool(PANDA_START)
    for s in (*np.linspace(slider.low, slider.high, 9), 0.0):
        snap = session.move_self("pseudo-inverse", float(s))
        q = snap.law("pseudo-inverse").q
        np.testing.assert_allclose(tool(q), before, atol=1e-9)
        PANDA.check_limits(q)
        assert session.self_motion("pseudo-inverse").value == s
    np.testing.assert_allclose(snap.law("pseudo-inverse").q, PANDA_START, atol=1e-12)
    length = np.linalg.norm(session.move_self("pseudo-inverse", 0.01).law("pseudo-inverse").q - PANDA_START)
    assert length == pytest.approx(0.01, rel=1e-3)  # arc length
    with pytest.raises(hk.HolokinError, match="give a number from"):
        session.move_self("pseudo-inverse", slider.high + 0.1)


def test_the_level_of_an_arm_angle_is_an_elbow_handle_in_degrees() -> None:
    session = panda()
    slider = session.level_slider("arm angle")
    assert slider.unit == "deg" and slider.low < slider.value < slider.high
    for value in (slider.low + 1.0, slider.high - 1.0):
        snap = session.move_level("arm angle", value)
        state = snap.law("arm angle")
        gap = np.rad2deg(state.level[0]) - value
        assert abs((gap + 180) % 360 - 180) < 1e-7
        np.testing.assert_allclose(PANDA.pose(state.q), TOOL, atol=1e-9)
        np.testing.assert_allclose(snap.law("lock").q, PANDA_START, atol=1e-12)
        session.drag(shifted(-0.05))
        session.drag(TOOL)
        np.testing.assert_allclose(session.snapshot().law("arm angle").q, state.q, atol=1e-9)
    with pytest.raises(hk.HolokinError, match="leaves"):
        session.level_slider("pseudo-inverse")


def test_a_level_beyond_its_slider_changes_nothing() -> None:
    session = panda()
    before = session.snapshot().law("lock").q
    slider = session.level_slider("lock")
    with pytest.raises(hk.HolokinError):
        session.set_level("lock", slider.high + 1.0)
    np.testing.assert_array_equal(session.snapshot().law("lock").q, before)


def test_two_ways_to_one_pose_spread_as_path_spread_says() -> None:
    session = panda()
    goal = shifted(-0.1, 0.2, 0.1)
    found = session.two_ways(goal, samples=100)
    assert found.points.shape == (2, 100, 3)
    for law, ways in zip(session.laws, found.ways, strict=True):
        referee = hk.path_spread(law.strategy, *found.paths, PANDA_START, samples=100)  # type: ignore[arg-type]
        assert ways.spread == referee.largest and ways.sentence == ""
        np.testing.assert_allclose(PANDA.pose(ways.a[-1]), goal, atol=1e-6)
        np.testing.assert_allclose(PANDA.pose(ways.b[-1]), goal, atol=1e-6)
    assert found.ways[0].spread > 0.01 and max(ways.spread for ways in found.ways[1:]) < 1e-12
    assert session.snapshot().target == pytest.approx(TOOL[None])


def rerun(session: Session) -> dict[str, np.ndarray]:
    """What `holokin run` of the saved job finds: the drifts of each strategy."""
    table = tomllib.loads(to_job(session)) | {"verdict": {"samples": 1}}
    result = run_job("saved", Job.model_validate(table), Path.cwd() / "saved.toml")
    return {r.name: r.cycles.drift_since_start() for r in result.strategies}


@pytest.mark.parametrize("kind", ["circle elsewhere, the other way", "clicked polygon", "figure eight", "another leaf"])
def test_a_saved_job_gives_the_numbers_of_the_session(kind: str) -> None:
    session, p = panda(cycles=2), TOOL[:3, 3]
    if kind.startswith("circle"):
        session.set_loop(circle_loop(p + [-0.1, 0.1, 0.05], 0.08, (0.3, 0.1, 1.0), near=p, samples=40))
        session.set_clockwise(True)
    elif kind == "clicked polygon":
        session.set_loop(polygon_loop(p + np.array([[0, 0, 0], [-0.1, 0.1, 0], [-0.2, -0.1, 0.1]]), samples=40))
    elif kind == "figure eight":
        session.set_loop(eight_loop(p, 0.2, normal=(0, 1, 0), samples=40))
    else:
        session.move_level("arm angle", session.level_slider("arm angle").value - 20.0)
    session.remove_law("lock" if kind == "another leaf" else "arm angle")
    end, again = run(session, 0.2), rerun(session)
    assert set(again) == {state.name for state in end.laws}
    for state in end.laws:
        assert state.following and len(state.drift) == 2
        np.testing.assert_allclose(again[state.name], state.drift_joints, atol=1e-9)
    assert end.law("pseudo-inverse").drift[-1] > 1e-3


def test_a_saved_job_of_a_robot_file_lies_in_any_folder(tmp_path: Path) -> None:
    model = tmp_path / "models" / "panda.urdf"
    model.parent.mkdir()
    model.write_text(urdf("panda.urdf").read_text("utf-8"), "utf-8")
    robot = hk.load(str(model), tip="panda_link8")
    task, keys = hk.pose(robot), {"kind": "lock", "joints": ["panda_joint3"]}
    law = Law("lock", 0, hk.holonomic(task, hk.lock("panda_joint3")), task, None, keys)
    tool = robot.pose(PANDA_START)[:3, 3]
    origin = Origin({"name": str(model), "tip": "panda_link8"}, {"kind": "pose"}, Path.cwd())
    session = Session([law], PANDA_START, circle_loop(tool - [0.05, 0, 0], 0.05, near=tool), origin=origin)
    write_job(session, tmp_path / "saved.toml")
    assert 'name = "models/panda.urdf"' in (tmp_path / "saved.toml").read_text("utf-8")
    again = open_session(str(tmp_path / "saved.toml"))
    assert [law.name for law in again.laws] == [law.name for law in session.laws]
    np.testing.assert_array_equal(again.home, session.home)
    with pytest.raises(hk.HolokinError, match="exists already"):
        write_job(session, tmp_path / "saved.toml")


@pytest.mark.parametrize("name", packaged_jobs())
def test_every_packaged_job_opens_or_says_why_not(name: str) -> None:
    session = open_session(name)
    first = session.snapshot()
    assert first.laws and all(state.following for state in first.laws)
    begun = session.play()
    assert begun.message == "" and begun.phase is Phase.GATHERING
    for _ in range(12):
        begun = session.advance(0.1)
    assert all(state.following or state.sentence for state in begun.laws)
    assert len(begun.laws[0].t) > 1


def test_a_robot_without_joints_to_spare_is_refused() -> None:
    arm = hk.load("ur5e")
    with pytest.raises(hk.HolokinError, match=r"joints to spare .* 0; the studio shows redundant joints"):
        session_of_robot(arm, task=hk.pose(arm))


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
            for state in snap.laws:
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
    kept = [(state.q.copy(), state.t.copy(), state.history.copy()) for state in old.laws]
    run(session)
    for state, (q, t, history) in zip(old.laws, kept, strict=True):
        np.testing.assert_array_equal(state.q, q)
        np.testing.assert_array_equal(state.t, t)
        np.testing.assert_array_equal(state.history, history)
        for array in (state.q, state.t, state.history, state.drift):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0


def test_a_long_run_keeps_its_history_in_bounded_memory() -> None:
    from holokin.studios.history import History

    history = History(2, rows=64)
    t = np.arange(5000.0)
    for first in range(0, 5000, 7):
        history.add(t[first : first + 7], np.column_stack([t, -t])[first : first + 7])
    seen, q = history.view()
    assert 30 <= len(seen) <= 64 and seen[0] == 0.0 and seen[-1] > 4800
    assert len(set(np.diff(seen))) == 1  # evenly
    np.testing.assert_array_equal(q, np.column_stack([seen, -seen]))


def test_in_the_background_laws_are_judged_and_a_workspace_is_covered() -> None:
    session = panda()
    session.start_work()
    session.start_cloud("lock", samples=64)
    for _ in range(600):
        snap = session.snapshot()
        cloud = snap.cloud
        if all(state.judgement for state in snap.laws) and cloud is not None and cloud.state == "done":
            break
        time.sleep(0.05)
    session.close()
    verdicts = {state.name: state.judgement for state in snap.laws}
    assert {name: v is not None and v.holonomic for name, v in verdicts.items()} == {
        "pseudo-inverse": False, "lock": True, "arm angle": True,
    }  # fmt: skip
    F = hk.curvature(LAWS[0].strategy, PANDA_START)  # type: ignore[arg-type]
    assert verdicts["pseudo-inverse"].curvature == pytest.approx(np.linalg.norm(F, axis=0).max())  # type: ignore[union-attr]
    assert cloud is not None and cloud.done == cloud.total == len(cloud.points) == 64
    assert 0 < cloud.reached.sum() < 64
    assert ((cloud.margin >= 0) & (cloud.margin <= 1))[cloud.reached].all() and np.isnan(
        cloud.margin[~cloud.reached]
    ).all()


def test_a_control_law_of_ones_own_runs_as_simulate_runs_it() -> None:
    rule = hk.controller(hk.moore_penrose(TASK), dt=0.05, gain=2.0)
    session = Session([Law("mine", 0, rule, TASK)], PANDA_START, panda().loop, cycles=2)
    end, loop = run(session), session.loop
    assert loop is not None
    referee = hk.simulate(rule, TASK, loop.path, PANDA_START, dt=loop.path.duration / 100, cycles=2)
    np.testing.assert_allclose(end.laws[0].q, referee.q[-1], atol=1e-12)
    assert session.drag(shifted(-0.05, 0.05)).laws[0].following
    with pytest.raises(hk.HolokinError, match="a job names"):
        to_job(session)


def test_another_home_makes_radial_laws_anew() -> None:
    robot = hk.load("ppr")
    session = session_of_robot(robot, start=PPR_START)
    q = session.move_self("pseudo-inverse", 0.3).law("pseudo-inverse").q
    radial = session.laws[-1]
    snap = session.set_home(q)
    assert session.laws[-1].rule is not radial.rule
    for state in snap.laws:
        np.testing.assert_allclose(state.q, q, atol=1e-12)
    assert run_ppr(session).law("radial").drift[0] < 1e-9


def run_ppr(session: Session) -> Snapshot:
    session.set_cycles(1)
    return run(session)


def test_a_law_that_meets_its_end_on_a_loop_stops_there_and_the_others_go_on() -> None:
    session = panda(cycles=1)
    session.set_loop(circle_loop(TOOL[:3, 3] + [0.25, 0, 0], 0.25, near=TOOL[:3, 3], samples=100))
    session.play()
    told: set[str] = set()
    while (snap := session.advance(FRAME)).phase is not Phase.DONE:
        told |= {state.name for state in snap.laws if state.sentence}
    for state in snap.laws:  # it comes back within their reach, and they go on
        assert state.name in told and state.following and np.isnan(state.drift).all()
    session.set_loop(reversed_loop(reversed_loop(panda().loop)))  # type: ignore[arg-type]
    assert run(session).following
