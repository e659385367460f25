"""The studio without a page: sliders, two paths to a pose, saved jobs, what a session opens, and its background."""

from __future__ import annotations

import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, campaign, sampled, urdf
from holokin.app.job import Job, packaged_jobs, run_job
from holokin.app.studio import (
    CloudStatus,
    NamedStrategy,
    Origin,
    Phase,
    Session,
    circle_loop,
    eight_loop,
    open_session,
    polygon_loop,
    session_of_robot,
    to_job,
)
from holokin.app.studio.stage import circle_of
from holokin.base.errors import HolokinError
from sessions import PANDA, STRATEGIES, TOOL, panda, run, shifted


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The virtual machine: what a session calls a few times takes a compiler longer than that."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


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
        q = snap.strategy("pseudo-inverse").q
        np.testing.assert_allclose(tool(q), before, atol=1e-9)
        PANDA.check_limits(q)
        assert session.self_motion("pseudo-inverse").value == s
    np.testing.assert_allclose(snap.strategy("pseudo-inverse").q, PANDA_START, atol=1e-12)
    length = np.linalg.norm(session.move_self("pseudo-inverse", 0.01).strategy("pseudo-inverse").q - PANDA_START)
    assert length == pytest.approx(0.01, rel=1e-3)  # arc length
    with pytest.raises(hk.HolokinError, match="give a number from"):
        session.move_self("pseudo-inverse", slider.high + 0.1)


@pytest.mark.campaign
def test_the_level_of_an_arm_angle_is_an_elbow_handle_in_degrees() -> None:
    session = panda()
    slider = session.level_slider("arm angle")
    assert slider.unit == "deg" and slider.low < slider.value < slider.high
    for value in (slider.low + 1.0, slider.high - 1.0):
        snap = session.move_level("arm angle", value)
        state = snap.strategy("arm angle")
        gap = np.rad2deg(state.level[0]) - value
        assert abs((gap + 180) % 360 - 180) < 1e-7
        np.testing.assert_allclose(PANDA.pose(state.q), TOOL, atol=1e-9)
        np.testing.assert_allclose(snap.strategy("lock").q, PANDA_START, atol=1e-12)
        session.drag(shifted(-0.05))
        session.drag(TOOL)
        np.testing.assert_allclose(session.snapshot().strategy("arm angle").q, state.q, atol=1e-9)
    with pytest.raises(hk.HolokinError, match="leaves"):
        session.level_slider("pseudo-inverse")


def test_a_level_beyond_its_slider_changes_nothing() -> None:
    session = panda()
    before = session.snapshot().strategy("lock").q
    slider = session.level_slider("lock")
    with pytest.raises(hk.HolokinError):
        session.move_level("lock", slider.high + 1.0)
    np.testing.assert_array_equal(session.snapshot().strategy("lock").q, before)


@pytest.mark.campaign
def test_two_paths_to_one_pose_spread_as_path_spread_says() -> None:
    session = panda()
    goal = shifted(-0.1, 0.2, 0.1)
    ends = {}
    for strategy in session.strategies:
        both, paths = session.two_paths(strategy.name, goal)
        referee = hk.motion.path_spread(strategy.G, *paths, PANDA_START, samples=200)  # type: ignore[arg-type]
        assert both.largest == referee.largest
        np.testing.assert_allclose(PANDA.pose(both.a.q[-1]), goal, atol=1e-6)
        np.testing.assert_allclose(PANDA.pose(both.b.q[-1]), goal, atol=1e-6)
        ends[strategy.name] = both.largest
    assert ends.pop("pseudo-inverse") > 0.01 and max(ends.values()) < 1e-12
    assert session.snapshot().target == pytest.approx(TOOL[None])


def rerun(session: Session) -> dict[str, np.ndarray]:
    """What `holokin run` of the saved job finds: the drifts of each strategy."""
    table = tomllib.loads(to_job(session)) | {"verdict": {"samples": 1}}
    result = run_job("saved", Job.model_validate(table), Path.cwd() / "saved.toml")
    return {r.name: r.cycles.drift_since_start() for r in result.strategies}


@sampled(1, "kind", ["circle elsewhere, the other way", "clicked polygon", "figure eight", "another leaf"])
def test_a_saved_job_gives_the_numbers_of_the_session(kind: str) -> None:
    other = "arm angle" if kind == "another leaf" else "lock"
    session, p = panda([s for s in STRATEGIES if s.name in ("pseudo-inverse", other)], cycles=2), TOOL[:3, 3]
    if kind.startswith("circle"):
        session.set_loop(circle_loop(p + [-0.1, 0.1, 0.05], 0.08, (0.3, 0.1, 1.0), near=p, samples=40))
        session.set_clockwise(True)
    elif kind == "clicked polygon":
        session.set_loop(polygon_loop(p + np.array([[0, 0, 0], [-0.1, 0.1, 0], [-0.2, -0.1, 0.1]]), samples=40))
    elif kind == "figure eight":
        session.set_loop(eight_loop(p, 0.2, normal=(0, 1, 0), samples=40))
    else:
        session.move_level("arm angle", session.level_slider("arm angle").value - 20.0)
    end, again = run(session, 0.2), rerun(session)
    assert set(again) == {state.name for state in end.strategies}
    for state in end.strategies:
        assert state.following and len(state.drift) == 2
        np.testing.assert_allclose(again[state.name], state.drift_joints, atol=1e-9)
    assert end.strategy("pseudo-inverse").drift[-1] > 1e-3


def test_a_saved_job_of_a_robot_file_lies_in_any_folder(tmp_path: Path) -> None:
    model = tmp_path / "models" / "panda.urdf"
    model.parent.mkdir()
    model.write_text(urdf("panda.urdf").read_text("utf-8"), "utf-8")
    robot = hk.load(str(model), tip="panda_link8")
    task, keys = hk.pose(robot), {"kind": "lock", "joints": ["panda_joint3"]}
    strategy = NamedStrategy("lock", hk.holonomic(task, hk.lock("panda_joint3")), task, None, keys)
    tool = robot.pose(PANDA_START)[:3, 3]
    origin = Origin({"name": str(model), "tip": "panda_link8"}, {"kind": "pose"}, Path.cwd())
    session = Session([strategy], PANDA_START, circle_loop(tool - [0.05, 0, 0], 0.05, near=tool), origin=origin)
    (tmp_path / "saved.toml").write_text(to_job(session), "utf-8")
    again = open_session(str(tmp_path / "saved.toml"))
    assert [strategy.name for strategy in again.strategies] == [strategy.name for strategy in session.strategies]
    np.testing.assert_array_equal(again.home, session.home)


@sampled(3, "name", [campaign("name", job) if job == "orientation" else job for job in packaged_jobs()])
def test_every_packaged_job_opens_or_says_why_not(name: str) -> None:
    session = open_session(name)
    first = session.snapshot()
    assert first.strategies and all(state.following for state in first.strategies)
    begun = session.play()
    assert begun.message == "" and begun.phase is Phase.GATHERING
    for _ in range(12):
        begun = session.advance(0.1)
    assert all(state.following or state.sentence for state in begun.strategies)
    assert len(begun.strategies[0].t) > 1
    again = Job.model_validate(tomllib.loads(to_job(session)))
    assert again.path.samples == session.loop.samples and len(again.strategies) <= len(session.strategies)  # type: ignore[union-attr]
    found = circle_of(session.loop)
    assert (found is not None) == (session.loop.kind == "circle" and session.loop.path.closed)  # type: ignore[union-attr]
    if found is not None:
        center, normal, radius = found
        away = session.loop.points(30)[0] - center  # type: ignore[union-attr]
        assert np.linalg.norm(away, axis=1) == pytest.approx(radius) and away @ normal == pytest.approx(0, abs=1e-12)


def test_a_robot_without_joints_to_spare_is_refused() -> None:
    arm = hk.load("ur5e")
    with pytest.raises(hk.HolokinError, match="joints to spare"):
        session_of_robot(arm, task=hk.pose(arm))


@pytest.mark.campaign
def test_a_session_finds_the_cusps_of_a_leaf_while_its_tool_is_dragged() -> None:
    """The loop that is drawn is that of `hk.cusps` of the same leaf, and closed; strategies follow meanwhile."""
    session, drags = panda(), 0
    strategy, q = STRATEGIES[1].G, session.snapshot().strategy("lock").q
    assert strategy is not None and session.start_cusps("lock").cusps.running  # type: ignore[union-attr]
    end = time.monotonic() + 60
    while session.snapshot().cusps.running and time.monotonic() < end:  # type: ignore[union-attr]
        assert session.drag(shifted(0.0, 0.02 * np.sin(drags / 10), 0.0)).following
        drags += 1
        time.sleep(0.01)
    cusps = session.snapshot().cusps
    assert cusps is not None and not cusps.running and cusps.place is not None and drags > 20
    least = hk.cusps(strategy, q, starts=300).witness
    assert least is not None and f"{least.length:.2g} m long" in cusps.sentence
    assert np.linalg.norm(np.diff(cusps.loop, axis=0), axis=1).sum() == pytest.approx(least.length, rel=0.1)
    assert np.linalg.norm(cusps.loop[0] - cusps.loop[-1]) < 1e-9
    np.testing.assert_array_equal(cusps.level, session.snapshot().strategy("lock").level)
    with pytest.raises(HolokinError):
        session.start_cusps("pseudo-inverse")
    session.start_cusps("lock")
    assert session.cancel_cusps().cusps is None
    session.close()
    assert session.snapshot().cusps is None


@pytest.mark.campaign
def test_in_the_background_strategies_are_judged_and_a_workspace_is_covered() -> None:
    session = panda()
    session.start_work()
    session.start_cloud("lock", samples=64)
    for _ in range(600):
        snap = session.snapshot()
        cloud = snap.cloud
        if all(state.judgement for state in snap.strategies) and cloud is not None and cloud.status is CloudStatus.DONE:
            break
        time.sleep(0.05)
    session.close()
    verdicts = {state.name: state.judgement for state in snap.strategies}
    assert {name: v is not None and v.holonomic for name, v in verdicts.items()} == {
        "pseudo-inverse": False, "lock": True, "arm angle": True,
    }  # fmt: skip
    F = hk.curvature(STRATEGIES[0].G, PANDA_START)  # type: ignore[arg-type]
    assert verdicts["pseudo-inverse"].curvature == pytest.approx(np.linalg.norm(F, axis=0).max())  # type: ignore[union-attr]
    assert cloud is not None and cloud.done == cloud.total == len(cloud.points) == 64
    assert 0 < cloud.reached.sum() < 64
    assert ((cloud.margin >= 0) & (cloud.margin <= 1))[cloud.reached].all() and np.isnan(
        cloud.margin[~cloud.reached]
    ).all()


@pytest.mark.parametrize(("name", "own"), [("irb140-half-square", 1), ("ppr-cycle", 10), ("panda-circle", 3)])
def test_a_job_plays_so_many_cycles_that_its_drift_is_seen_and_never_fewer_than_its_own(name: str, own: int) -> None:
    session = open_session(name)
    cycles, loop = session.snapshot().cycles, session.loop
    assert loop is not None and cycles is not None and cycles >= own
    drifting = [strategy.G for strategy in session.strategies if not strategy.holonomic and strategy.G is not None]
    seen = np.max([hk.drift(one, loop.path, session.home, cycles=5, samples=200).largest for one in drifting], axis=0)
    if cycles > own:  # no more than it takes
        assert seen[cycles - 2] < 0.1 and (seen[cycles - 1] > 0.1 or cycles == 5)
    else:
        assert seen[min(own, 5) - 1] > 0.1


def test_where_no_strategy_drifts_a_job_plays_its_own_cycles() -> None:
    from holokin.app.studio.new_session import visible_cycles

    assert visible_cycles([strategy for strategy in STRATEGIES if strategy.holonomic], panda().loop, PANDA_START) == 1  # type: ignore[arg-type]
    assert visible_cycles(STRATEGIES, panda().loop, PANDA_START) == 1  # 0.16 rad after the first, as the README says
    small = circle_loop(TOOL[:3, 3] - [0.05, 0, 0], 0.05, near=TOOL[:3, 3])
    assert 1 < visible_cycles(STRATEGIES, small, PANDA_START) <= 5
