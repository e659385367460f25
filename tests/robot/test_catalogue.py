"""The catalogue against others' numbers: every robot's poses, its limits, and the table of docs/robots.md."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, urdf
from holokin.robot import reach
from referees import PUBLISHED, Referee, referees

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


@pytest.mark.parametrize("referee", referees(), ids=lambda r: f"{r.robot}-{r.tip}")
def test_the_pose_is_the_referees(referee: Referee) -> None:
    """To 1e-12, or to the rounding of the source where that is coarser."""
    position, rotation = referee.differences()
    assert position < referee.within
    assert rotation < referee.turned


def test_every_robot_of_the_catalogue_has_a_referee() -> None:
    assert {r.robot for r in referees()} == set(hk.robot.catalogue())


@pytest.mark.campaign
def test_the_page_says_reach_referee_and_difference_of_every_robot() -> None:
    """Rewritten on request only: HOLOKIN_GOLDEN=write pytest tests/robot/test_catalogue.py"""
    rows = ["| Robot | n | Reach [m] | Compared with | Largest difference [m] |", "|---|---|---|---|---|"]
    for name in hk.robot.catalogue():
        robot, mine = hk.load(name), [r for r in referees() if r.robot == name]
        apart = max(r.differences()[0] for r in mine)
        shown = f"{apart:.0e}" if apart > 1e-10 else "below 1e-12" if apart < 1e-12 else "below 1e-11"
        rows.append(f"| `{name}` | {robot.n} | {reach(robot):.3f} | {mine[0].words} | {shown} |")
    text = PAGE.read_text("utf-8")
    begin = text.index("| Robot | n |")
    end = text.index("\n\n", begin)
    if os.environ.get("HOLOKIN_GOLDEN") == "write":
        PAGE.write_text(text[:begin] + "\n".join(rows) + text[end:], "utf-8")
        return
    assert text[begin:end] == "\n".join(rows)


@pytest.mark.parametrize("entry", PUBLISHED["limits"], ids=lambda e: e["robot"])
def test_the_ranges_and_speeds_are_the_published_ones(entry: dict) -> None:
    robot, unit = hk.load(entry["robot"]), np.pi / 180 if entry.get("degrees") else 1
    for mine, key in ((robot.lower, "lower"), (robot.upper, "upper"), (robot.max_velocity, "max_velocity")):
        published = unit * np.array(entry[key])
        assert mine == pytest.approx(published, abs=entry.get("within", 1e-9), rel=0), (key, entry["source"])


def test_every_arm_that_a_maker_sells_has_published_limits() -> None:
    elsewhere = {"panda", "irb140"}  # tests/robot/test_robot.py
    made_of = {
        "rail-ur10e",
        "mobile-ur5e",
        "yumi-arm",
        "openarm-left",
        "openarm-right",
        "rail",
        "planar-base",
        "ppr",
        "planar-3r",
    }  # parts; chosen
    assert {e["robot"] for e in PUBLISHED["limits"]} | elsewhere | made_of == set(hk.robot.catalogue())


def test_the_xarm7_is_the_urdf_of_example_robot_data() -> None:
    ours, theirs = hk.load("xarm7"), hk.from_urdf(urdf("xarm7.urdf"))
    assert ours.joint_names == theirs.joint_names
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 7)):
        assert np.abs(ours.pose(q) - theirs.pose(q)).max() < 2e-5  # the URDF's right angles are 1.5708
    assert ours.lower == pytest.approx(theirs.lower, abs=1e-5)  # the URDF rounds them to five digits
    assert ours.upper == pytest.approx(theirs.upper, abs=1e-5)
    assert ours.max_velocity == pytest.approx(theirs.max_velocity, abs=1e-12)


@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
def test_the_ur_arms_are_those_of_their_analytic_kinematics(name: str) -> None:
    arm = getattr(pytest.importorskip("ur_analytic_ik"), name)
    robot = hk.load(name)
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 6)):
        assert np.abs(robot.pose(q) - arm.forward_kinematics(*q)).max() < 1e-12


def test_the_rizon4_has_the_jacobian_that_its_maker_computed_in_matlab() -> None:
    """flexiv_rdk dca9a15, test/test_dynamics_engine.cpp: the flange at "PLAN-Home", with another wrist.

    It has joint 7 elsewhere, 3 mm and 40 mm away, as src/holokin/robot/data/rizon4.toml says, and with it the flange.
    """
    published = [
        [0.110000000000000, 0.078420538028673, 0.034471999940354, -0.368152340866938, -0.064278760968654, 0.136],
        [0.687004857483100, 0.0, 0.576684003660457, 0.0, 0.033475407198662, 0.0],
        [0.0, 0.687004857483100, -0.028925442435894, -0.417782862794537, -0.076604444311898, 0.11],
        [0.0, 0.0, 0.642787609686539, 0.0, 0.766044443118978, 0.0],
        [0.0, -1.0, 0.0, 1.0, 0.0, -1.0],
        [1.0, 0.0, 0.766044443118978, 0.0, -0.642787609686539, 0.0],
    ]
    robot = hk.load("rizon4")
    home = np.deg2rad([0, -40, 0, 90, 0, 40, 0])
    earlier = hk.with_tool(robot, [0, 0.003, 0.040])  # in the flange's own frame, at q7 = 0
    assert np.abs(earlier.jacobian(home)[:, :6] - published).max() < 1e-12
    assert np.abs(robot.jacobian(home)[3:, 6] - [0, 0, -1]).max() < 1e-12


def test_the_reach_is_never_exceeded_and_is_the_known_one_of_straight_arms() -> None:
    assert reach(hk.load("planar-3r")) == pytest.approx(3.0, abs=1e-9)
    assert reach(hk.load("iiwa7")) == pytest.approx(0.34 + 0.4 + 0.4 + 0.126, abs=1e-9)  # upright and straight
    assert reach(hk.load("rail")) == 3.0
    assert reach(hk.from_dh([{"a": 1.0}, {"kind": "prismatic"}])) == np.inf
    ur5e = hk.load("ur5e")
    far = reach(ur5e)
    points = ur5e.pose_batch(np.random.default_rng(5).uniform(ur5e.lower, ur5e.upper, (20_000, 6)))[0]
    assert far - 0.05 < np.linalg.norm(points, axis=1).max() <= far
    yumi = hk.load("yumi")
    assert reach(yumi, "left_flange") == pytest.approx(reach(yumi, "right_flange"), abs=1e-4)


@pytest.mark.campaign
def test_the_list_of_robots_has_joints_reach_and_source(holokin: Command) -> None:
    lines = holokin("robots").out.splitlines()
    assert [line.split()[0] for line in lines] == list(hk.robot.catalogue())
    (ur5e,) = [line for line in lines if line.startswith("ur5e")]
    assert ur5e.split()[1:6] == ["6", "joints", "reach", "1.130", "m"]
    assert "Universal Robots" in ur5e
