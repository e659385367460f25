"""An exported controller of ros2_control does the steps of hk.controller, and refuses what it cannot do."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START
from control_plugins import BuiltController, Event, Outcome, Ran, event, posed, update_all
from holokin.export import export_ros2_control
from ros_plugins import driver, library

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here"),
]

LAW = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
TASK, ROBOT = LAW.task, LAW.task.robot
START = ROBOT.pose(PANDA_START)
DT = 0.001


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> BuiltController:
    folder = tmp_path_factory.mktemp("built")
    package = export_ros2_control(LAW, folder / "package", q0=PANDA_START, name="panda_law", vectors_count=1)
    built = (library(package, folder), driver("control_driver.cpp", folder))
    return BuiltController(*built, package, ROBOT.joint_names, PANDA_START)


def recorded(cycles: int) -> tuple[list[np.ndarray], np.ndarray]:
    """The wanted poses and the joints of `simulate`, with a controller round circles of 10 s."""
    path = hk.circle(START[:3, 3], center=START[:3, 3] - [0.1, 0, 0], speed=0.1 * 2 * np.pi / 10)
    step, poses = hk.controller(LAW, dt=DT, q0=PANDA_START).step, []

    def law(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, _dt: float) -> np.ndarray:
        poses.append(pose)
        return step(q, pose, twist)

    return poses, hk.simulate(law, TASK, path, PANDA_START, dt=DT, cycles=cycles).q


@pytest.mark.parametrize("commands", ["position", "velocity"])
def test_ten_thousand_updates_have_the_joints_of_simulate(arm: BuiltController, commands: str) -> None:
    """A circle at 1 kHz with ideal drives. An update allocates nothing and locks nothing."""
    poses, q = recorded(1)
    found = update_all(arm, [posed(T) for T in poses], f"command_interface=text:{commands}")
    assert found.exit == 0 and len(poses) == 10_000
    np.testing.assert_allclose(found.states, q[1:], rtol=0, atol=1e-9)
    assert (found.status == Outcome.OK).all() and (found.level == 0).all() and (found.scale == 1).all()
    assert not found.allocations.any() and not found.locks.any()
    np.testing.assert_allclose(found.states[-1], PANDA_START, atol=1e-6)


def between(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """The straight motion (6,) from a pose to another one."""
    return np.concatenate([B[:3, 3] - A[:3, 3], Rotation.from_matrix(B[:3, :3] @ A[:3, :3].T).as_rotvec()])


def moved(T: np.ndarray, motion: np.ndarray) -> np.ndarray:
    then = np.eye(4)
    then[:3, 3] = T[:3, 3] + motion[:3]
    then[:3, :3] = Rotation.from_rotvec(motion[3:]).as_matrix() @ T[:3, :3]
    return then


def in_python(targets: list[np.ndarray], *, every: int, v: float, w: float, last: float) -> np.ndarray:
    """Joints (k, 7) by `controller` whose reference goes straight to a new target each `every` steps, `last` s long."""
    c, q, reference, joints, left = hk.controller(LAW, dt=DT, q0=PANDA_START), PANDA_START, START, [], 0.0
    for k in range(len(targets) * every):
        left = last if k % every == 0 else left
        way = between(reference, targets[k // every])
        share = min(1.0, DT / max(left, DT))
        share = min(share, *(x * DT / max(np.linalg.norm(part), 1e-300) for x, part in ((v, way[:3]), (w, way[3:]))))
        q = q + DT * c.step(q, moved(reference, share * way), share * way / DT)
        reference = moved(reference, c.scale * share * way)
        left = max(0.0, left - DT)
        joints.append(q)
    return np.array(joints)


@pytest.mark.parametrize(
    ("every", "v", "w", "last", "slowed"),
    [(10, 0.25, 1.0, 0.01, False), (10, 0.25, 1.0, 0.0, False), (5, 9.0, 9.0, 0.0, True), (8, 0.02, 0.1, 0.0, False)],
)
def test_the_reference_goes_straight_to_targets_at_bounded_speed(
    arm: BuiltController, every: int, v: float, w: float, last: float, slowed: bool
) -> None:
    """Targets that come less often than updates; the joints slow the way down where it is too fast for them."""
    swings = np.sin(np.linspace(0, 2 * np.pi, 60))
    speed = 20.0 if slowed else 1.0
    targets = [moved(START, speed * s * np.array([0.01, 0.005, -0.01, 0.02, -0.03, 0.02])) for s in swings]
    events = [posed(T) if k == 0 else event(Event.UPDATE) for T in targets for k in range(every)]
    limits = [f"max_linear_velocity=double:{v}", f"max_angular_velocity=double:{w}", f"target_period=double:{last}"]
    found = update_all(arm, events, *limits, "max_angle=double:3.0", "max_distance=double:3.0")
    expected = in_python(targets, every=every, v=v, w=w, last=last)
    assert np.isin(found.status, [Outcome.OK, Outcome.SLOWED]).all() and (found.scale < 0.9).any() == slowed
    np.testing.assert_allclose(found.states, expected, rtol=0, atol=1e-9)
    assert not found.allocations.any() and not found.locks.any()


def test_a_quaternion_and_its_opposite_are_one_orientation(arm: BuiltController) -> None:
    turned = moved(START, np.array([0, 0, 0, 0.1, 0.2, -0.3]))
    events = [posed(turned) for _ in range(500)]
    opposite = [[*row[:6], *(-x for x in row[6:])] for row in events]
    mixed = [(events, opposite)[k % 2][k] for k in range(500)]
    plain = update_all(arm, events)
    for other in (opposite, mixed):
        np.testing.assert_allclose(update_all(arm, other).states, plain.states, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ROBOT.pose(plain.states[-1]), turned, atol=1e-6)


def test_a_twist_moves_the_tool_as_long_as_it_comes(arm: BuiltController) -> None:
    """The tool is where the twist leads in closed form, on the leaf, and stops when the twists do."""
    twist = np.array([0.05, -0.03, 0.04, 0.1, 0.2, -0.1])
    events = [event(Event.TWIST, *twist)] * 1000 + [event(Event.UPDATE)] * 300
    found = update_all(arm, events, "target=text:twist")
    np.testing.assert_allclose(ROBOT.pose(found.states[999]), moved(START, 1.0 * twist), atol=1e-6)
    np.testing.assert_allclose(found.states[:, 2], PANDA_START[2], atol=1e-9)
    assert (found.status[1210:] == Outcome.STALE).all()
    np.testing.assert_array_equal(found.states[1210:], np.tile(found.states[1210], (90, 1)))
    fast = update_all(arm, [event(Event.TWIST, *(100 * twist))] * 100, "target=text:twist")
    share = min(0.25 / np.linalg.norm(twist[:3]), 1.0 / np.linalg.norm(twist[3:]))
    np.testing.assert_allclose(between(START, ROBOT.pose(fast.states[-1])), 0.1 * share * twist, atol=1e-5)


def test_the_order_of_joints_and_interfaces_makes_no_difference(arm: BuiltController) -> None:
    poses, _ = recorded(1)
    events = [posed(T) for T in poses[:300]]
    plain = update_all(arm, events)
    other = update_all(arm, events, "joints=list:" + ",".join(reversed(ROBOT.joint_names)), "order=reverse")
    assert other.words.splitlines()[0].split()[1] == "panda_joint7/position"
    np.testing.assert_array_equal(other.states, plain.states)


NAN, INF = np.nan, np.inf
BAD = [np.array([NAN, 0, 0, 0, 0, 0, 1]), np.array([0, INF, 0, 0, 0, 0, 1]), np.array([0.4, 0.2, 0.5, 0, 0, NAN, 1]),
       np.array([0.4, 0.2, 0.5, 0, 0, 0, 0]), np.array([0.4, 0.2, 0.5, 1, 1, 1, 1])]  # fmt: skip


def still(found: Ran, rows: slice, outcome: Outcome) -> None:
    """The joints do not move in these updates, for a reason that is published as an error or as old."""
    assert found.status[rows].tolist() == [outcome] * len(found.status[rows])
    before = found.states[rows.start - 1]
    np.testing.assert_array_equal(found.states[rows], np.tile(before, (len(found.states[rows]), 1)))
    assert np.isfinite(found.commands).all()


@pytest.mark.parametrize("commands", ["position", "velocity"])
def test_a_target_that_is_none_stops_the_joints_until_the_next_one(arm: BuiltController, commands: str) -> None:
    poses, q = recorded(1)
    for bad in [event(Event.POSE, *numbers) for numbers in BAD] + [posed(poses[50], kind=Event.FRAME)]:
        events = [*(posed(T) for T in poses[:50]), bad, *[event(Event.UPDATE)] * 5, *(posed(T) for T in poses[50:100])]
        found = update_all(arm, events, f"command_interface=text:{commands}")
        assert found.exit == 0
        still(found, slice(50, 56), Outcome.BAD_TARGET)
        assert (found.status[56:] == Outcome.OK).all()
        np.testing.assert_allclose(found.states[-1], q[100], atol=1e-6)
    said = update_all(arm, [event(Event.TWIST, 0, NAN, 0, 0, 0, 0)], "target=text:twist")
    assert said.status[0] == Outcome.BAD_TARGET and "the last target is none" in said.words


def test_a_target_that_jumps_by_a_metre_is_not_followed(arm: BuiltController) -> None:
    """Nor one that turns by a radian, but where larger jumps are allowed: then at the speed of the tool."""
    poses, _ = recorded(1)
    turned = moved(poses[50], np.array([0, 0, 0, 0, 1.0, 0]))
    for jump in (moved(poses[50], np.array([0, 1.0, 0, 0, 0, 0])), turned):
        found = update_all(arm, [*(posed(T) for T in poses[:50]), posed(jump), *(posed(T) for T in poses[50:60])])
        still(found, slice(50, 51), Outcome.FAR)
        assert (found.status[51:] == Outcome.OK).all()
    allowed = update_all(arm, [posed(turned)] * 1200, "max_angle=double:2.0")
    np.testing.assert_allclose(ROBOT.pose(allowed.states[-1]), turned, atol=1e-6)
    poses = [ROBOT.pose(q) for q in allowed.states[:900]]
    speeds = [np.linalg.norm(between(A, B)[3:]) / DT for A, B in pairwise(poses)]
    assert max(speeds) < 1.0 + 1e-3


def test_a_period_of_zero_stops_and_a_long_one_makes_no_jump(arm: BuiltController) -> None:
    """Ten periods in one: the joints go as far as in two."""
    poses, _ = recorded(1)
    target = moved(START, np.array([0.1, 0, 0, 0, 0, 0]))
    events = [posed(T) for T in poses[:50]] + [posed(poses[50], period=0.0)] + [posed(poses[50])]
    found = update_all(arm, events)
    still(found, slice(50, 51), Outcome.BAD_PERIOD)
    assert found.status[51] == Outcome.OK
    backwards = update_all(arm, [posed(target), posed(target, period=-0.001), posed(target)])
    still(backwards, slice(1, 2), Outcome.BAD_PERIOD)
    late = update_all(arm, [posed(target)] * 20 + [posed(target, period=0.01)] + [posed(target)] * 20)
    ways = np.linalg.norm(np.diff(late.states[10:], axis=0), axis=1)
    assert (late.status == Outcome.OK).all() and "long periods: 1" in late.words
    np.testing.assert_allclose(ways[9], 2 * ways[0], rtol=0.02)
    np.testing.assert_allclose(ways[10:15], ways[0], rtol=0.05)


def test_an_old_target_stops_the_joints(arm: BuiltController) -> None:
    """Old by the time since it came, or by its stamp; a timeout of 0 takes all."""
    poses, _ = recorded(1)
    silent = [posed(T) for T in poses[:50]] + [event(Event.UPDATE)] * 300
    found = update_all(arm, silent)
    assert (found.status[:249] == Outcome.OK).all()
    still(found, slice(250, 350), Outcome.STALE)
    assert (update_all(arm, silent, "timeout=double:0.0").status == Outcome.OK).all()
    for age, outcome in ((0.1, Outcome.OK), (0.3, Outcome.STALE), (-0.3, Outcome.STALE)):
        stamped = update_all(arm, [posed(T, age=age) for T in poses[:20]])
        assert (stamped.status == outcome).all() and ("old by its stamp" in stamped.words) == (outcome == Outcome.STALE)


@pytest.mark.parametrize(("commands", "hold"), [("position", True), ("velocity", False)])
def test_a_deactivation_in_motion_stops_the_joints_and_the_next_activation_begins_where_they_are(
    arm: BuiltController, commands: str, hold: bool
) -> None:
    poses, _ = recorded(1)
    off, on, wait = event(Event.DEACTIVATE), event(Event.ACTIVATE), event(Event.UPDATE)
    pushed = [event(Event.STATE, 0, PANDA_START[0] + 0.05)]
    events = [*(posed(T) for T in poses[:50]), off, *pushed, on, wait, *(posed(T) for T in poses[50:60])]
    found = update_all(arm, events, f"command_interface=text:{commands}")
    np.testing.assert_array_equal(found.commands[50], found.commands[49] if hold else 0.0)
    assert found.status[50] == Outcome.INACTIVE and found.status[53] == Outcome.WAITING
    assert (found.status[54:] == Outcome.OK).all()
    jumps = np.abs(np.diff(found.states[52:], axis=0)).max()
    assert jumps < 2.62 * DT


def test_out_of_reach_it_stands_still_and_goes_back_to_the_same_joints(arm: BuiltController) -> None:
    """Three metres away: it goes as far as the arm or its limits allow, and can always go back."""
    for away in ([2.0, 0, 0.5], [0, -2, 0], [0, 0, 3.0]):
        far = moved(START, np.array([*away, 0, 0, 0]))
        events = [posed(far)] * 4000 + [posed(START)] * 6000
        found = update_all(arm, events, "max_distance=double:9.0", "max_linear_velocity=double:0.5")
        assert found.status[3999] in (Outcome.SINGULAR, Outcome.LIMIT), found.status[3999]
        assert np.abs(np.diff(found.states[3900:4000], axis=0)).max() < 1e-6
        lower, upper = ROBOT.ranges(1.0)
        assert ((found.states > lower - 1e-9) & (found.states < upper + 1e-9)).all()
        assert found.status[-1] == Outcome.OK
        np.testing.assert_allclose(found.states[-1], PANDA_START, atol=1e-6)


ROBOT = LAW.task.robot
STEP = [posed(START)]


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
