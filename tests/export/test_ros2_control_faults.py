"""The controller for ros2_control against bad parameters, other robots, missing interfaces and bad drives."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from control_plugins import BuiltController, Event, Outcome, event, posed, update_all
from holokin.export import export_ros2_control
from ros_plugins import driver, library

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here"),
]

LAW = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
ROBOT = LAW.task.robot
START = ROBOT.pose(PANDA_START)
STEP = [posed(START)]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> BuiltController:
    folder = tmp_path_factory.mktemp("built")
    package = export_ros2_control(LAW, folder / "package", q0=PANDA_START, name="panda_law", vectors_count=1)
    built = (library(package, folder), driver("control_driver.cpp", folder))
    return BuiltController(*built, package, ROBOT.joint_names, PANDA_START)


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("joints=list:panda_joint1,elbow", "the joints 'elbow' of `joints`"),
        ("joints=list:" + ",".join(ROBOT.joint_names[:6]), "lacks the joints 'panda_joint7'"),
        ("joints=list:" + ",".join([*ROBOT.joint_names, "panda_joint1"]), "or not twice, the joints 'panda_joint1'"),
        ("prefix=text:left_", "has no joints 'left_panda_joint1', .*'left_panda_joint7'"),
        ("command_interface=text:effort", "give position or velocity"),
        ("target=text:joints", "give pose or twist"),
        ("max_linear_velocity=double:0", "max_linear_velocity is not above 0"),
        ("max_distance=double:nan", "max_distance is not above 0"),
        ("max_lag=double:-1", "max_lag is not above 0"),
        ("most_error=double:inf", "most_error is not above 0, or infinite"),
        ("timeout=double:-0.1", "timeout is negative or infinite"),
        ("target_period=double:nan", "target_period is negative or infinite"),
        ("period=double:inf", "period is negative or infinite"),
        ("tool_correction=double:1.0", "tool_correction is not from 0 to below 1"),
        ("leaf_correction=double:-0.1", "leaf_correction is not from 0 to below 1"),
        ("least_rcond=double:nan", "least_rcond is not from 0 to below 1"),
        ("status_rate=double:0", "status_rate is not from 0.01 to 1000"),
        ("level=numbers:0.2,0.3", "level is not 1 finite numbers"),
        ("level=numbers:nan", "level is not 1 finite numbers"),
        ("tip=text:nowhere", "has no link 'nowhere'"),
        ("base=text:panda_joint7_link", "m and .* rad from where|is not a part of"),
        ("tip=text:panda_joint5_link", "m and .* rad from where the export has its tip 'panda_hand_tcp'"),
    ],
)
def test_what_does_not_fit_the_export_is_refused_when_it_is_configured(
    arm: BuiltController, parameter: str, words: str
) -> None:
    found = update_all(arm, STEP, parameter)
    assert found.exit == 3
    assert re.search(words, found.words), found.words


def test_a_parameter_of_another_type_is_refused_at_once(arm: BuiltController) -> None:
    found = update_all(arm, STEP, "timeout=int:1")
    assert found.exit == 2 and "write 1.0, not 1" in found.words


def test_an_unknown_update_rate_wants_a_period(arm: BuiltController) -> None:
    found = update_all(arm, STEP, rate=0)
    assert found.exit == 3 and "give `period`" in found.words
    assert update_all(arm, STEP, "period=double:0.001", rate=0).exit == 0


def changed(arm: BuiltController, folder: Path, change: Callable[[str], str]) -> Path:
    text = arm.robot.read_text("utf-8")
    other = folder / "other.urdf"
    other.write_text(change(text), "utf-8")
    assert other.read_text("utf-8") != text
    return other


def limit(text: str, joint: str, key: str, value: str) -> str:
    """The URDF with another limit of a joint."""
    begin = text.index(f'<joint name="{joint}"')
    end = text.index("</joint>", begin)
    return text[:begin] + re.sub(rf'{key}="[^"]*"', f'{key}="{value}"', text[begin:end]) + text[end:]


RAIL = (
    '  <link name="world"/><joint name="rail" type="prismatic"><parent link="world"/><child link="base"/>'
    '<limit lower="0" upper="1" effort="1" velocity="1"/></joint>\n  <link name="base">'
)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("0.333", "0.334"), "is 0.001 m and .* rad from where the export has its tip"),
        (lambda text: text.replace('name="panda_joint3"', 'name="elbow"'), "has no joints 'panda_joint3'"),
        (lambda text: limit(text, "panda_joint2", "upper", "1.5"), "joint 'panda_joint2': the export's upper limit"),
        (lambda text: limit(text, "panda_joint2", "lower", "-1.5"), "joint 'panda_joint2': the export's lower limit"),
        (lambda text: limit(text, "panda_joint4", "velocity", "2.0"), "joint 'panda_joint4': the export's speed"),
        (lambda _text: "", "there is no robot description"),
        (lambda _text: "no xml", "is no URDF"),
    ],
)
def test_a_robot_of_another_description_is_refused(
    arm: BuiltController, tmp_path: Path, change: Callable[[str], str], words: str
) -> None:
    found = update_all(arm, STEP, robot=changed(arm, tmp_path, change))
    assert found.exit == 3
    assert re.search(words, found.words), found.words
    assert update_all(arm, STEP, "check_robot=bool:false", robot=tmp_path / "other.urdf").exit == 0


def test_wider_limits_a_rail_below_and_a_prefix_are_taken(arm: BuiltController, tmp_path: Path) -> None:
    """A rail below the base changes nothing, a rail within the chain is told."""
    wide = changed(arm, tmp_path, lambda text: limit(text, "panda_joint2", "upper", "3.0"))
    assert update_all(arm, STEP, robot=wide).exit == 0
    railed = changed(arm, tmp_path, lambda text: text.replace('  <link name="base">', RAIL))
    assert update_all(arm, STEP, robot=railed).exit == 0
    whole = update_all(arm, STEP, "base=text:world", robot=railed)
    assert whole.exit == 3 and "does not move the joint 'rail' between base and tip" in whole.words
    named = changed(
        arm, tmp_path, lambda text: re.sub(r'(<link name|<joint name|parent link|child link)="', r'\1="left_', text)
    )
    found = update_all(arm, STEP, "prefix=text:left_", robot=named, prefix="left_")
    assert found.exit == 0 and "left_panda_joint1/position" in found.words
    assert update_all(arm, STEP, robot=named).exit == 3


def test_a_description_as_a_parameter_serves_where_the_manager_has_none(arm: BuiltController, tmp_path: Path) -> None:
    empty = changed(arm, tmp_path, lambda _text: "")
    given = f"robot_description=text:{arm.robot.read_text('utf-8')}"
    assert update_all(arm, STEP, given, robot=empty).exit == 0


@pytest.mark.parametrize(
    ("commands", "drop", "words"),
    [
        ("position", "panda_joint4/position", "no interfaces 'command panda_joint4/position'"),
        ("velocity", "panda_joint4/velocity", "no interfaces 'command panda_joint4/velocity'"),
        ("position", "panda_joint4/position state", "no interfaces 'state panda_joint4/position'"),
    ],
)
def test_a_missing_interface_is_told_at_the_activation(
    arm: BuiltController, commands: str, drop: str, words: str
) -> None:
    found = update_all(arm, STEP, f"command_interface=text:{commands}", f"drop={drop}")
    assert found.exit == 4 and words in found.words, found.words


def test_an_arm_off_the_leaf_is_not_activated_but_where_its_own_leaf_is_to_be_kept(arm: BuiltController) -> None:
    away = PANDA_START + np.array([0, 0, 0.3, 0, 0, 0, 0])
    refused = update_all(arm, STEP, start=away)
    assert refused.exit == 4 and "0.300000 from the level 0.200000" in refused.words
    target = ROBOT.pose(away)
    target[:3, 3] += [0.05, 0.02, -0.03]
    for chosen in ("level_at_activation=bool:true", "level=numbers:0.5"):
        found = update_all(arm, [posed(target)] * 2000, chosen, start=away)
        np.testing.assert_allclose(found.states[:, 2], 0.5, atol=1e-9)
        np.testing.assert_allclose(ROBOT.pose(found.states[-1]), target, atol=1e-9)
    near = PANDA_START + np.array([0, 0, 0.05, 0, 0, 0, 0])
    led = update_all(arm, [posed(ROBOT.pose(near))] * 2000, "max_level_error=double:0.1", start=near)
    np.testing.assert_allclose(led.states[-1, 2], PANDA_START[2], atol=1e-9)


def test_a_singular_arm_is_not_activated(arm: BuiltController) -> None:
    straight = np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0])
    found = update_all(arm, STEP, "check_robot=bool:false", start=straight)
    assert found.exit == 4 and "singular posture" in found.words


def test_drives_that_do_not_follow_stop_the_joints_until_the_next_activation(arm: BuiltController) -> None:
    """The arm is held, as by a brake, while its target goes on; the command stays within max_lag of it."""
    away = START.copy()
    away[:3, 3] += [0.15, 0.1, 0.0]
    held = [event(Event.STUCK)] * 600
    again = [event(Event.DEACTIVATE), event(Event.ACTIVATE)]
    events = [*[posed(away)] * 20, *held, *[posed(away)] * 20, *again, *[posed(START)] * 3000]
    found = update_all(arm, events, "timeout=double:0.0", "max_lag=double:0.05")
    lags = np.abs(found.commands[20:640] - found.states[19])
    assert (found.status[600:640] == Outcome.NOT_FOLLOWING).all() and lags.max() < 0.051
    np.testing.assert_array_equal(found.commands[620:640], np.tile(found.commands[619], (20, 1)))
    assert found.status[-1] == Outcome.OK
    np.testing.assert_allclose(found.states[-1], PANDA_START, atol=1e-9)


def test_a_tool_that_was_pushed_away_stops_a_velocity_loop(arm: BuiltController) -> None:
    poses = [posed(START)]
    pushed = [event(Event.STATE, 0, PANDA_START[0] + 0.5)]
    found = update_all(arm, poses * 20 + pushed + poses * 20, "command_interface=text:velocity")
    assert (found.status[:20] == Outcome.OK).all() and (found.status[20:] == Outcome.LOST).all()
    assert (found.commands[20:] == 0).all()
    assert "until it is activated again" in found.words


def test_an_arm_that_was_pushed_while_it_stood_goes_on_at_the_speed_of_the_tool(arm: BuiltController) -> None:
    """From where the tool is, not from where it stood before."""
    silence, pushed = [event(Event.UPDATE)] * 300, [event(Event.STATE, 0, PANDA_START[0] + 0.1)]
    velocity = ("command_interface=text:velocity", "max_linear_velocity=double:0.1")
    found = update_all(arm, [posed(START)] * 20 + silence + pushed + [posed(START)] * 1500, *velocity)
    places = np.array([ROBOT.pose(q)[:3, 3] for q in found.states[320:]])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.001
    assert 0.09 < speeds.max() < 0.101 and found.status[-1] == Outcome.OK
    np.testing.assert_allclose(found.states[-1], PANDA_START, atol=1e-9)


def test_a_joint_that_is_not_known_stops_the_joints(arm: BuiltController) -> None:
    """NaN at once; a value that another thread holds, after ten updates in a row."""
    poses = [posed(START)]
    bad = [event(Event.STATE, 3, np.nan)]
    found = update_all(arm, poses * 5 + bad + poses * 5)
    assert found.status.tolist() == [Outcome.OK] * 5 + [Outcome.NO_STATE] + [Outcome.OK] * 5
    assert np.isfinite(found.commands).all()
    held = update_all(arm, poses * 5 + [event(Event.HELD, 2, 1)] * 13 + poses * 2)
    assert held.status.tolist() == [Outcome.OK] * 15 + [Outcome.NO_STATE] * 3 + [Outcome.OK] * 2
    refused = update_all(arm, poses, start=np.array([np.nan, *PANDA_START[1:]]))
    assert refused.exit == 4 and "position of a joint is not known" in refused.words


def test_it_waits_for_targets_and_takes_none_from_before_the_activation(arm: BuiltController) -> None:
    away = START.copy()
    away[:3, 3] += [0.05, 0.0, 0.0]
    wait = [event(Event.UPDATE)] * 5
    off, on = event(Event.DEACTIVATE), event(Event.ACTIVATE)
    found = update_all(arm, [*wait, *[posed(away)] * 10, off, on, *wait, event(Event.CLEAN_UP), on, *wait])
    assert found.exit == 0 and (found.status[:5] == Outcome.WAITING).all() and found.level[0] == 1
    assert (found.status[17:22] == Outcome.WAITING).all() and (found.status[24:] == Outcome.WAITING).all()
    np.testing.assert_array_equal(found.states[17:], np.tile(found.states[16], (12, 1)))
