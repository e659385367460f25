"""Findings of `check` in motions made to go wrong at a known time; jobs and the command line that tell them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, R3_START, Command, assert_refused, urdf, write_job
from holokin.analysis.audit.logs import Recording
from holokin.base.errors import ArgumentError, MissingExtraError, ShapeError, UnknownNameError
from holokin.motion.checks import FindingKind
from holokin.robot import Box, Capsule, LinkShape

pytestmark = pytest.mark.usefixtures("sketched")  # what is written when is the statement, not what is drawn

LIMITED = [
    {"joint": "a", "a": 1.0, "lower": -1.0, "upper": 2.0, "max_velocity": 1.5},
    {"joint": "b", "a": 1.0, "lower": -3.0, "upper": 3.0, "max_velocity": 1.5},
]


@pytest.fixture(scope="module")
def arm() -> hk.Robot:
    """Two links of 1 m in the plane z = 0."""
    return hk.from_dh(LIMITED, name="two links")


def recorded(robot: hk.Robot, t: np.ndarray, q: np.ndarray) -> Recording:
    return Recording(robot.joint_names, t, q, "made here")


def test_a_joint_beyond_its_limit_is_told_with_its_time_and_value(arm: hk.Robot) -> None:
    """a = t - 2 from 0 to 5 s passes -1 at 1 s and 2 at 4 s; it is worst at the ends."""
    t = np.linspace(0, 5, 501)
    report = hk.check(recorded(arm, t, np.column_stack([t - 2, 0.5 * np.sin(t)])), None, robot=arm)
    low, high = report.findings
    assert [low.kind, high.kind] == [FindingKind.POSITION] * 2 and low.what == high.what == ("a",)
    assert (low.start, low.time, low.value, low.limit) == (0.0, 0.0, -2.0, -1.0)
    assert low.stop == pytest.approx(0.99) and high.start == pytest.approx(4.01)
    assert (high.time, high.value, high.limit, high.index) == (5.0, 3.0, 2.0, 500)
    assert not report.passed
    near = hk.check(recorded(arm, t, np.column_stack([0 * t, 0.5 * np.sin(t)])), None, robot=arm, margin=1.2)
    assert [(f.what, f.limit) for f in near.findings] == [(("a",), pytest.approx(0.2))]  # -1 + 1.2 is above 0


def test_a_joint_that_is_too_fast_is_told_with_its_time_and_speed(arm: hk.Robot) -> None:
    """b = sin(2 t) is faster than 1.5 where 2 |cos 2t| > 1.5: until 0.361 s, and around pi / 2."""
    t = np.linspace(0, 2, 2001)
    report = hk.check(recorded(arm, t, np.column_stack([0 * t, np.sin(2 * t)])), None, robot=arm)
    first, second = report.findings
    assert first.kind is FindingKind.VELOCITY and first.what == ("b",) and first.unit == "rad/s"
    edge = np.arccos(0.75) / 2
    assert first.start == 0 and first.stop == pytest.approx(edge, abs=2e-3)
    assert second.start == pytest.approx(np.pi / 2 - edge, abs=2e-3)
    assert second.time == pytest.approx(np.pi / 2, abs=2e-3)
    assert second.value == pytest.approx(2.0, rel=1e-4) and second.limit == 1.5


@pytest.mark.campaign
def test_a_timed_motion_keeps_its_own_limits_and_breaks_smaller_ones(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r, rows=[0, 1])
    start = planar_3r.pose(R3_START)[:3, 3]
    walk = hk.follow(hk.moore_penrose(task), hk.line(start, start + [0.1, 0, 0]), R3_START, samples=50)
    bounds = {"acceleration": 2.0, "jerk": 40.0, "velocity": 1.0}
    timed = hk.retime(walk, profile="trapezoidal", dt=0.01, **bounds)
    assert hk.check(timed, None, robot=planar_3r, task=task).passed
    half = type(timed.limits)(*(getattr(timed.limits, key) / (2 if key in bounds else 1) for key in vars(timed.limits)))
    report = hk.check(type(timed)(**vars(timed) | {"limits": half}), None, robot=planar_3r)
    told = [f for f in report.findings if f.kind is FindingKind.ACCELERATION]
    assert told and max(f.value for f in told) == pytest.approx(np.abs(timed.ddq).max())


def test_a_stretched_arm_is_told_to_be_near_singular_when_it_is(arm: hk.Robot) -> None:
    """sigma of J vanishes with b = t - 1 at 1 s; rcond = |sin b| / (3 + 2 cos b) to first order, 0.01 at b = 0.05."""
    t = np.linspace(0, 2, 4001)
    task = hk.position(arm, rows=[0, 1])
    motion = recorded(arm, t, np.column_stack([0 * t, t - 1]))
    (found,) = hk.check(motion, None, robot=arm, task=task).findings
    assert found.kind is FindingKind.SINGULARITY and found.time == pytest.approx(1.0, abs=1e-3)
    assert found.value < 1e-9 and found.limit == 0.01
    assert 0.5 * (found.stop - found.start) == pytest.approx(0.05, rel=2e-2)
    assert hk.check(motion, None, robot=arm, task=task, rcond=0.0).passed
    assert any("no task" in text for text in hk.check(motion, None, robot=arm).remarks)


def test_a_capsule_meets_a_ball_when_geometry_says(arm: hk.Robot) -> None:
    """The outer end (2 cos t, 2 sin t) of a stretched arm of radius 0.1 meets a ball of 0.2 at (0, 1.5, 0).

    The arm is a line through the origin, so the distance is 1.5 cos t - 0.3: 0.01 at acos(0.31 / 1.5), 0 at acos(0.2).
    """
    t = np.linspace(0, 1.5, 151)
    ball = hk.obstacle("ball", Capsule(0.2), [0, 1.5, 0])
    robot = hk.robot.with_capsules(arm, 0.1)
    report = hk.check(
        recorded(robot, t, np.column_stack([t, 0 * t])), hk.Scene(obstacles=[ball]), robot=robot, limits=False
    )
    (found,) = report.findings
    assert found.kind is FindingKind.COLLISION and found.what == ("b", "ball")
    assert found.start == pytest.approx(np.arccos(0.31 / 1.5), abs=0.011) and found.stop == 1.5
    assert found.value == pytest.approx(1.5 * np.cos(1.5) - 0.3, abs=1e-9) and found.limit == 0.01
    brief = hk.check(
        recorded(robot, t[:130], np.column_stack([t, 0 * t])[:130]),
        hk.Scene(obstacles=[ball]),
        robot=robot,
        limits=False,
    )
    assert brief.passed and brief.bound >= 0.01 and brief.clearance == pytest.approx(1.5 * np.cos(1.29) - 0.3, abs=1e-9)


def test_a_collision_between_two_samples_is_found(arm: hk.Robot) -> None:
    """Two samples, on either side of a ball: neither touches it, the straight motion between them does."""
    robot = hk.robot.with_capsules(arm, 0.05)
    ball = hk.obstacle("ball", Capsule(0.1), [1.8, 0, 0])
    motion = np.array([[-0.8, 0.0], [0.8, 0.0]])
    report = hk.check(motion, hk.Scene(obstacles=[ball]), robot=robot, limits=False)
    (found,) = report.findings
    assert found.what == ("b", "ball") and found.kind is FindingKind.COLLISION
    assert found.start < found.time < found.stop and found.time == pytest.approx(0.5, abs=0.05)
    assert found.value <= -0.14
    for row in motion:
        assert hk.check(row[None], hk.Scene(obstacles=[ball]), robot=robot, limits=False).passed


def test_a_tool_below_the_floor_is_told_with_its_depth() -> None:
    """A bar of 0.1 m radius goes down from 0.5 m to -0.5 m: its lowest point is 0.1 m below its middle line."""
    flat = hk.robot.with_capsules(hk.from_dh([{"joint": "s", "kind": "prismatic", "a": 0.5}]), 0.1)
    t = np.linspace(0, 1, 11)
    report = hk.check(recorded(flat, t, 0.5 - t[:, None]), hk.Scene(floor=0.0), robot=flat)
    (found,) = report.findings
    assert found.what == ("s", "floor") and found.value == pytest.approx(-0.6) and found.time == 1.0
    assert found.start == pytest.approx(0.4)
    assert hk.check(recorded(flat, t, 0.5 - 0.3 * t[:, None]), hk.Scene(floor=0.0), robot=flat).passed


def test_pairs_that_are_left_out_are_named_with_the_reason(panda: hk.Robot) -> None:
    report = hk.check(PANDA_START[None], robot=panda)
    reasons = {one.pair: one.reason for one in report.left_out}
    assert "parent and child" in reasons["base", "panda_joint2"]
    assert "random postures" in reasons["panda_joint2", "panda_joint4"]
    assert any("0.071 m" in text for text in report.remarks)
    looked = {one.pair for one in report.pairs}
    assert ("base", "panda_joint7") in looked and not looked & set(reasons)
    less = hk.check(PANDA_START[None], hk.Scene(allowed=[("panda_joint7", "base")]), robot=panda)
    assert ("base", "panda_joint7") not in {one.pair for one in less.pairs}
    assert {one.reason for one in less.left_out if one.pair == ("base", "panda_joint7")} == {"allowed to touch"}
    assert hk.check(PANDA_START[None], None, robot=panda).pairs == ()


def test_a_tool_is_looked_at_where_it_is_carried(arm: hk.Robot) -> None:
    """A pin of 0.2 m beyond the tip of a stretched arm of 2 m meets a ball at 2.3 m, which the arm does not."""
    ball = hk.obstacle("ball", Capsule(0.05), [2.3, 0, 0])
    pin = hk.robot.with_shape(
        hk.robot.with_capsules(arm, 0.05), "pin", Capsule(0.01, 0.2), [0.1, 0, 0], [0, np.pi / 2, 0]
    )
    report = hk.check(np.zeros((1, 2)), hk.Scene(obstacles=[ball]), robot=pin)
    assert report.passed and report.pairs[0].pair == ("pin", "ball")
    assert report.clearance == pytest.approx(2.3 - 2.2 - 0.01 - 0.05)
    assert (
        hk.check(np.zeros((1, 2)), hk.Scene(floor=-1.0), robot=hk.robot.with_shape(arm, "pin", Capsule(0.01))).unseen
        == ()
    )
    with pytest.raises(UnknownNameError):
        hk.robot.with_shape(arm, "pin", Capsule(0.01), tip="nose")


def test_a_missing_mesh_costs_its_link_and_nothing_else(tmp_path: Path) -> None:
    text = urdf("panda.urdf").read_text("utf-8")
    (tmp_path / "panda.urdf").write_text(text, "utf-8")
    robot = hk.load(tmp_path / "panda.urdf", tip="panda_hand", locked={"panda_finger_joint1": 0.0})
    whole = hk.load(urdf("panda.urdf"), tip="panda_hand", locked={"panda_finger_joint1": 0.0})
    assert np.array_equal(robot.pose(PANDA_START), whole.pose(PANDA_START))
    report = hk.check(PANDA_START[None], robot=robot)
    assert {"panda_link0", "panda_hand"} <= {one.link for one in report.unseen}
    assert all("link" in one.reason or "hand" in one.reason for one in report.unseen if "mesh" in one.reason)
    assert "not looked at: panda_link5: there is no such mesh" in report.table()
    assert hk.check(PANDA_START[None], robot=whole).unseen == ()


def test_a_broken_collision_element_does_not_hinder_the_kinematics(tmp_path: Path) -> None:
    text = urdf("panda.urdf").read_text("utf-8").replace('<box size="', '<box side="')
    assert "<box side=" in text
    (tmp_path / "broken.urdf").write_text(text, "utf-8")
    robot = hk.load(tmp_path / "broken.urdf", tip="panda_hand", locked={"panda_finger_joint1": 0.0})
    assert robot.pose(PANDA_START)[2, 3] > 0
    assert {one.reason for one in hk.check(PANDA_START[None], robot=robot).unseen} >= {
        "its <collision> elements cannot be read"
    }


def test_shapes_stay_on_their_links_when_robots_are_put_together() -> None:
    """The same arm turned round on a rail: distances between its links stay, its floor moves with it."""
    arm = hk.load(urdf("ur5_robot.urdf"), tip="ee_link")
    cell = hk.compose(hk.load("rail"), hk.robot.Part(arm, pose=[0, 0, 0.4], rpy=[0, 0, 1.0], prefix="r_"))
    q = np.array([0.3, -1.2, 1.4, -1.0, -1.5, 0.2])
    alone, both = (
        hk.check(q[None], hk.Scene(floor=-1.0), robot=arm),
        hk.check(np.array([[0.0, *q]]), hk.Scene(floor=-0.6), robot=cell),
    )
    wanted = {one.pair: one.least for one in alone.pairs}
    found = {tuple(name.removeprefix("r_") for name in one.pair): one.least for one in both.pairs}
    assert {pair: pytest.approx(found[pair], abs=1e-6) for pair in wanted} == wanted


def test_bad_questions_are_refused(panda: hk.Robot, arm: hk.Robot) -> None:
    Q = PANDA_START[None]
    for wrong in ({"clearance": -1.0}, {"floor": np.nan}, {"allowed": [("base",)]}, {"obstacles": [panda]}):
        with pytest.raises(ArgumentError):
            hk.Scene(**wrong)
    for wrong in ({"margin": np.inf}, {"rcond": -1.0}, {"task": "pose"}, {"scene": 0.1}):
        with pytest.raises(ArgumentError):
            hk.check(Q, robot=panda, task=hk.pose(panda), **wrong) if "task" not in wrong else hk.check(
                Q, robot=panda, **wrong
            )
    with pytest.raises(ShapeError):
        hk.check(Q, robot=arm)
    with pytest.raises(ArgumentError, match="moves a, b"):
        hk.check(recorded(arm, np.zeros(1), np.zeros((1, 2))), robot=panda)
    with pytest.raises(UnknownNameError, match="panda_joint9"):
        hk.check(Q, hk.Scene(allowed=[("panda_joint9", "base")]), robot=panda)
    with pytest.raises(ArgumentError, match="at least one"):
        hk.check(np.zeros((0, 7)), robot=panda)
    with pytest.raises(UnknownNameError):
        hk.robot.with_capsules(panda, {"no link": 0.1})
    with pytest.raises(ArgumentError):
        Box([0.1, -0.1, 0.1])


def test_without_coal_capsules_are_looked_at_and_boxes_ask_for_it(
    panda: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "coal", None)
    assert hk.check(PANDA_START[None], hk.Scene(floor=0.0), robot=panda).passed
    table = hk.obstacle("table", Box([1, 1, 0.1]), [0.5, 0, 0])
    with pytest.raises(MissingExtraError, match=r"holokin\[collision\]"):
        hk.check(PANDA_START[None], hk.Scene(obstacles=[table]), robot=panda)


# --- jobs and the command line ---

PANDA = {
    "robot": '[robot]\nname = "panda"\n',
    "task": '[task]\nkind = "pose"\n',
    "start": f"[start]\nq = {PANDA_START.tolist()}\n",
    "path": '[path]\nkind = "polyline"\npoints = [[0, 0, 0], [0, 0, -0.2]]\nrelative = true\nsamples = 20\n',
}
CHECKS = "[checks]\nfloor = 0.35\nradius = { panda_joint7 = 0.04 }\n"
BALL = '[[checks.obstacles]]\nname = "ball"\nkind = "sphere"\nradius = 0.05\nxyz = [0.45, 0.1, 0.3]\n'


def test_a_job_tells_what_its_checks_find_and_fails(holokin: Command, tmp_path: Path, out: Path) -> None:
    """The tool goes down 0.2 m, to 0.02 m above the floor; a capsule of 0.04 m round it is 0.02 m deep in the floor."""
    tool = hk.load("panda").pose(PANDA_START)[2, 3] - 0.2
    floor = CHECKS.replace("0.35", str(float(tool - 0.02)))
    file = write_job(tmp_path, **PANDA, checks=floor, expect="[expect.moore-penrose]\nclearance = { above = 0.0 }\n")
    outcome = holokin("run", file, "--out", out)
    assert outcome.code == 1
    told = " ".join(outcome.out.split())
    assert "collision: panda_joint7 and floor" in told and "expected clearance > 0" in told and "clear." in told
    page = (out / "job" / "report.html").read_text("utf-8")
    assert "Checks of the motion" in page and "panda_joint7 and floor" in page
    facts = json.loads((out / "job" / "result.json").read_text("utf-8"))["strategies"][0]
    (found,) = [one for one in facts["motion_check"]["findings"] if one["what"] == ["panda_joint7", "floor"]]
    assert found["kind"] == "collision" and found["value"] == pytest.approx(-0.02, abs=2e-3)
    assert facts["metrics"]["clearance"] == facts["motion_check"]["clearance"] <= found["value"]
    assert facts["passed"] is False


@pytest.mark.usefixtures("sketched")
def test_a_job_whose_motion_is_clear_passes(holokin: Command, tmp_path: Path, out: Path) -> None:
    file = write_job(tmp_path, **PANDA, checks="[checks]\nfloor = 0.0\n" + BALL.replace("0.1, 0.3", "0.6, 0.3"))
    outcome = holokin("run", file, "--out", out)
    assert outcome.code == 0 and "nothing found" in outcome.out
    torch = BALL.replace('"ball"', '"torch"\non = "panda_hand_tcp"').replace("0.45, 0.1, 0.3", "0, 0, 0.35")
    torch = "[checks]\nfloor = 0.0\n" + torch
    low = holokin("run", write_job(tmp_path, "low.toml", **PANDA, checks=torch), "--out", out)
    assert low.code == 1 and "torch and floor" in low.out
    hit = write_job(tmp_path, "hit.toml", **PANDA, checks="[checks]\n" + BALL)
    assert holokin("run", hit, "--out", out).code == 1


@pytest.mark.parametrize(
    ("checks", "words"),
    [
        ("[checks]\nflor = 0.0\n", ("checks.flor", "floor")),
        ('[checks]\nallowed = [["base"]]\n', ("checks.allowed.0", "at least 2")),
        ('[checks]\nallowed = [["base", "nose"]]\n', ("nose", "[checks]")),
        ("[checks]\nradius = { nose = 0.1 }\n", ("nose", "[checks]")),
        (BALL.replace("radius", "sides"), ("checks.obstacles.0",)),
        (BALL.replace("sphere", "spere"), ("checks.obstacles.0.kind", "sphere")),
    ],
)
def test_a_mistake_in_checks_is_named(
    holokin: Command, tmp_path: Path, out: Path, checks: str, words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, **PANDA, checks=checks), "--out", out), *words)


def test_the_command_looks_at_a_log(holokin: Command, tmp_path: Path, panda: hk.Robot) -> None:
    """0.1 rad beyond the limit of joint 4 in the middle of the log; without that sample there is nothing to find."""
    t = np.linspace(0, 10, 101)
    q = np.repeat(PANDA_START[None], 101, axis=0)
    q[:, 3] = PANDA_START[3] + (panda.upper[3] + 0.1 - PANDA_START[3]) * np.sin(np.pi * t / 10)
    log, facts = tmp_path / "log.csv", tmp_path / "found.json"
    header = ",".join(["t", *panda.joint_names])
    np.savetxt(log, np.column_stack([t, q]), delimiter=",", header=header, comments="")
    outcome = holokin("check", log, "--robot", "panda", "--json", facts)
    assert outcome.code == 1 and "joint limit: panda_joint4" in outcome.out
    (found,) = [f for f in json.loads(facts.read_text("utf-8"))["findings"] if f["kind"] == "position"]
    assert found["time"] == pytest.approx(5.0) and found["value"] == pytest.approx(panda.upper[3] + 0.1)
    np.savetxt(log, np.column_stack([t, np.repeat(PANDA_START[None], 101, axis=0)]), delimiter=",", header=header,
               comments="")  # fmt: skip
    quiet = holokin("check", log, "--robot", "panda", "--floor", "0", "--allowed", "base,panda_joint7")
    assert quiet.code == 0 and "nothing found" in quiet.out and "allowed to touch: base and panda_joint7" in quiet.out
    assert_refused(holokin("check", log, "--robot", "panda", "--allowed", "base"), "--allowed", "comma")
    other = log.read_text("utf-8").replace("panda_joint", "actual_q_").replace("t,", "clock,", 1)
    log.write_text(other, "utf-8")
    named = holokin("check", log, "--robot", "panda", "--columns", "actual_q_%d", "--time", "clock")
    assert named.code == 0 and "nothing found" in named.out


def test_a_shape_is_a_value(tmp_path: Path) -> None:
    """Reports and robots with shapes can be pickled, and a copy says the same."""
    import pickle

    robot = hk.load(urdf("ur5_robot.urdf"), tip="ee_link")
    report = hk.check(np.zeros((1, 6)), robot=robot)
    again = pickle.loads(pickle.dumps(robot))
    assert isinstance(again.shapes[0], LinkShape)
    assert hk.check(np.zeros((1, 6)), robot=again).pairs == report.pairs
    assert pickle.loads(pickle.dumps(report)) == report
