"""One robot with two tips from one file, its tools, and what `holokin robots` says of a robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused
from holokin.app.job import open_job, robot_of_file, run_job
from holokin.app.job.job_parts import build_robot
from holokin.base.errors import RobotFileError, UnknownNameError


def _link(name: str, length: float) -> str:
    shape = f'<geometry><cylinder radius="0.04" length="{length}"/></geometry>'
    return f'<link name="{name}"><collision><origin xyz="0 0 {length / 2}"/>{shape}</collision></link>'


def _joint(name: str, parent: str, child: str, xyz: str, axis: str) -> str:
    limit = '<limit lower="-2" upper="2" velocity="1" effort="1"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="revolute">{ends}<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'


def two_armed() -> str:
    """A torso with two arms of four hinges, 0.5 m apart; every link is a cylinder."""
    parts = [_link("torso", 0.3)]
    for side, y in (("left", 0.25), ("right", -0.25)):
        above, origin = "torso", f"0 {y} 0.3"
        for k, axis in enumerate(("0 0 1", "0 1 0", "1 0 0", "0 1 0")):
            parts += [_joint(f"{side}_{k}", above, f"{side}_link{k}", origin, axis), _link(f"{side}_link{k}", 0.16)]
            above, origin = f"{side}_link{k}", "0 0 0.2"
        parts.append(f'<link name="{side}_hand"/><joint name="{side}_end" type="fixed"><parent link="{above}"/>')
        parts.append(f'<child link="{side}_hand"/><origin xyz="0 0 0.2"/></joint>')
    return f'<robot name="torso">{"".join(parts)}</robot>'


JOB = """
title = "Two hands"
[robot]
{robot}
[task]
kind = "position"
tip = "{tip}"
[start]
q = [0.4, 0.3, 0.2, 0.3, -0.4, 0.3, -0.2, 0.3]
[path]
kind = "circle"
center = [-0.03, 0, 0]
relative = true
samples = 30
[checks]
clearance = 0.005
[strategies.mp]
kind = "moore-penrose"
"""
ONE = 'name = "torso.urdf"\ntip = ["left_hand", "right_hand"]'
TWICE = "".join(
    f'[[robot.parts]]\nname = "torso.urdf"\ntip = "{tip}"\non = "base"\nprefix = "{prefix}"\n'
    for tip, prefix in (("left_hand", "a_"), ("right_hand", "b_"))
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "torso.urdf").write_text(two_armed())
    return tmp_path


def _job(folder: Path, robot: str, tip: str = "left_hand") -> Path:
    file = folder / "hands.toml"
    file.write_text(JOB.format(robot=robot, tip=tip))
    return file


def test_two_tips_of_one_file_are_one_robot_that_does_not_meet_itself(folder: Path) -> None:
    """Put together of two parts, each with all links of the file, it does: the arm that each part holds still."""
    file = folder / "torso.urdf"
    left, right = (hk.load(file, tip=f"{side}_hand") for side in ("left", "right"))
    twice = hk.compose(hk.robot.Part(left, prefix="a_"), hk.robot.Part(right, on="base", prefix="b_"))
    q = np.array([0.4, 0.3, 0.2, 0.3, -0.4, 0.3, -0.2, 0.3])
    assert not hk.check(np.zeros((1, 8)) + q, hk.Scene(clearance=0.005), robot=twice).passed
    robot = build_robot(*open_job(str(_job(folder, ONE)))[1:])
    assert [tip.name for tip in robot.tips] == ["left_hand", "right_hand"]
    assert len(robot.shapes) == len(left.shapes) == 9
    for tip, arm, mine in (("left_hand", left, q[:4]), ("right_hand", right, q[4:])):
        assert np.abs(robot.pose(q, tip) - arm.pose(mine)).max() < 1e-14
    result = run_job("hands", open_job(str(_job(folder, ONE)))[1], folder / "hands.toml")
    report = result.strategies[0].motion_check
    assert report is not None and report.passed


def test_the_same_file_twice_at_one_place_is_refused_with_what_to_write(folder: Path) -> None:
    job = open_job(str(_job(folder, TWICE, "a_left_hand")))
    with pytest.raises(hk.HolokinError, match=r"twice.*tip = \['left_tip', 'right_tip'\]"):
        build_robot(*job[1:])
    apart = TWICE.replace('prefix = "b_"', 'prefix = "b_"\nxyz = [0, 2, 0]')  # two robots side by side
    assert build_robot(*open_job(str(_job(folder, apart, "a_left_hand")))[1:]).n == 8


def test_each_tip_has_a_tool_of_its_own_and_keeps_its_name(folder: Path) -> None:
    tools = "tools = { left_hand = { xyz = [0, 0, 0.1] }, right_hand = { xyz = [0, 0, 0.2], rpy_deg = [0, 90, 0] } }"
    robot = build_robot(*open_job(str(_job(folder, f"{ONE}\n{tools}")))[1:])
    bare = hk.load(folder / "torso.urdf", tip=["left_hand", "right_hand"])
    assert [tip.name for tip in robot.tips] == ["left_hand", "right_hand"]
    q = np.array([0.4, 0.3, 0.2, 0.3, -0.4, 0.3, -0.2, 0.3])
    for tip, length in (("left_hand", 0.1), ("right_hand", 0.2)):
        flange = bare.pose(q, tip)
        assert np.abs(robot.pose(q, tip)[:3, 3] - flange[:3, 3] - length * flange[:3, 2]).max() < 1e-12
    assert np.abs(robot.pose(q, "right_hand")[:3, 2] - bare.pose(q, "right_hand")[:3, 0]).max() < 1e-12
    with pytest.raises(UnknownNameError, match="left_hand"):
        build_robot(*open_job(str(_job(folder, f"{ONE}\ntools = {{ left_hnd = {{ xyz = [0, 0, 0.1] }} }}")))[1:])
    both = f"{ONE}\ntool = {{ xyz = [0, 0, 0.1] }}\n{tools}"
    with pytest.raises(RobotFileError, match="give one of them"):
        build_robot(*open_job(str(_job(folder, both)))[1:])


def test_a_robot_of_a_file_is_described_with_limits_tool_frames_and_source(holokin: Command, folder: Path) -> None:
    """Referee: what the file says, and degrees by hand."""
    arm = folder / "arm.toml"
    arm.write_text(
        'name = "bench"\nsource = "measured in May"\ntool = { xyz = [0, 0, 0.15], rpy_deg = [0, 30, 0] }\n'
        '[[joints]]\njoint = "swing"\na = 0.4\nlower = -90\nupper = 45\nmax_velocity = 180\ndegrees = true\n'
        '[[joints]]\njoint = "slide"\nkind = "prismatic"\nlower = -0.1\nupper = 0.3\n'
    )
    out = holokin("robots", arm).out
    assert "bench: 2 joints" in out and "source: measured in May" in out
    assert "-1.5708 to 0.7854 rad (-90.0 to 45.0 deg)" in out and "3.1416 rad/s (180.0 deg/s)" in out
    assert "-0.1000 to 0.3000 m" in out and "not known" in out
    assert "tool frame tool: on slide, xyz [0, 0, 0.15] m, rpy [0, 30, 0] deg" in out
    one = holokin("robots", _job(folder, ONE)).out
    assert "tool frame left_hand: on left_3, xyz [0, 0, 0.2] m" in one and "right_hand" in one
    assert one == holokin("robots", folder / "torso.urdf", "--tip", "left_hand", "--tip", "right_hand").out
    assert "panda_joint7" in holokin("robots", "panda").out
    assert "left_hand: 4 moving joints" in holokin("robots", folder / "torso.urdf").out
    assert_refused(holokin("robots", folder / "none.toml"), "none.toml")
    assert_refused(holokin("robots", "pandaa"), "pandaa")
    assert_refused(holokin("robots", _job(folder, ONE), "--tip", "left_hand"), "a job says it itself")
    assert robot_of_file("panda").n == 7
