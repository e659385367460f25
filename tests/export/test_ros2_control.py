"""The controller for ros2_control in motion: the joints of Python, step by step, and where it stands still."""

from __future__ import annotations

import shutil
from itertools import pairwise

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
