"""`hk.ik(robot)` of arms without a closed form: sheets that are gone from stations."""

import json
from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.analysis.sheets.station_maps import make_station_map, map_bytes, read_map, station_map
from holokin.base.errors import OutOfReachError
from holokin.motion.ik import all_postures
from holokin.motion.ik.arm_inverse import ArmInverse
from holokin.motion.ik.arm_map import digest
from holokin.motion.ik.leaf import leaf_step
from holokin.motion.ik.stations import FIRST, Hand, StationCalls, strategy_of, takes_stations
from holokin.motion.self_motions.self_motions import self_motions_at

ARMS = ("gen3", "sawyer", "yumi-arm", "rizon4")


def poses_within(robot, count, seed=5):
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    return robot.pose(np.random.default_rng(seed).uniform(low, high, (count, robot.n)))


def gap(q, other):
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max()


@pytest.fixture(scope="module")
def ik():
    """A Gen3, whose first joint turns freely."""
    return hk.ik("gen3")


def test_each_pose_of_random_postures_has_one_answer_with_that_pose_within_the_limits(ik):
    """The referee is the chain of the joints. An answer is the same whatever was asked before, off the map to
    round-off."""
    robot, poses = ik.task.robot, poses_within(ik.task.robot, 20)
    answers = [ik(T) for T in poses]
    for T, q in zip(poses, answers, strict=True):
        assert np.abs(robot.pose(q) - T).max() < 1e-9
        assert robot.within(q)
    found = ik.batch(poses)
    for i in np.random.default_rng(0).permutation(len(poses)):
        assert np.array_equal(ik(poses[i]), answers[i]) or found.sheet[i] < 0
        assert np.abs(ik(poses[i]) - answers[i]).max() < 1e-6  # off the map: at a flat maximum of the margin
    assert np.abs(found.q - answers).max(axis=1)[found.sheet >= 0].max() < 1e-9
    assert np.abs(found.q - answers).max() < 1e-6
    assert np.mean(found.sheet >= 0) > 0.85
    assert [ik.sheet(T) for T in poses] == [s if s >= 0 else None for s in found.sheet.tolist()]


def test_what_turns_with_the_first_axis_has_the_same_answer_but_for_that_turn(ik):
    """A Gen3 turns freely about the z axis of its base."""
    robot = ik.task.robot
    for T in poses_within(robot, 12):
        if ik.sheet(T) is None:
            continue
        turned = T.copy()
        turned[:3] = np.array([[np.cos(2), -np.sin(2), 0], [np.sin(2), np.cos(2), 0], [0, 0, 1]]) @ T[:3]
        q, other = ik(T), ik(turned)
        assert gap(other[1:], q[1:]) < 1e-9
        assert min(gap(other[0] - q[0], 2.0), gap(other[0] - q[0], -2.0)) < 1e-9


@pytest.mark.campaign
def test_without_native_code_sheets_have_the_same_postures(ik):
    """In Python a path is gone in pieces that are shown, so that it may come to a few more."""
    calls, both = ik.map.kernel(True), 0
    assert isinstance(calls, StationCalls)
    for T in poses_within(ik.task.robot, 2):
        for sheet in range(3):
            which = np.append(float(sheet), FIRST[1:])
            native, slow = calls._call(T, which), calls._slow(T, which)
            if native is not None and slow is not None:
                assert np.abs(native - slow).max() < 1e-7
                both += 1
    assert both >= 3


def test_a_leg_out_and_back_on_one_sheet_comes_home(ik):
    legs = 0
    for T in poses_within(ik.task.robot, 20):
        poses = np.repeat(T[None], 9, axis=0)
        poses[:, 0, 3] += np.r_[1:6, 4:0:-1] / 1000
        if ik.sheet(T) is None or not ik.batch(poses).reached.all():
            continue
        begin = q = ik(T)
        changes = []
        for pose in [*poses, T]:
            last, (q, _, changed) = q, ik.near(pose, q)
            changes.append(changed)
            assert changed or gap(q, last) < 0.3
        if not any(changes):
            legs += 1
            assert np.abs(q - begin).max() < 1e-12
    assert legs >= 3


def test_where_two_stations_disagree_the_jump_between_them_is_a_change(ik):
    """A sheet of two stations 3 cm apart, on the same level, but with other postures: the second one by eigenvalues."""
    task, found, hand = ik.task, ik.map, Hand(ik.task)
    strategy, sheet = strategy_of(task, found.joint), 0
    for first in found.stations[sheet][np.isfinite(found.stations[sheet]).all(axis=1)]:
        T, there = np.repeat(task.robot.pose(first)[None], 2, axis=0)
        there[2, 3] += 0.03
        level = float(found.rules[sheet] @ hand.terms(hand.arrows(there[None]))[0])
        led = all_postures(strategy, there, level, near=first).q
        sides = [leaf_step(strategy)(q, there[:3, 3], there[:3, :3], np.array([level]))[3] for q in led]
        others = [q for q, s in zip(led, sides, strict=True) if s == found.sides[sheet] and 1 < gap(q, first) < 3]
        if not others:
            continue
        few = replace(found, rules=found.rules[:1], sides=found.sides[:1], stations=np.array([[first, others[0]]]))
        two = ArmInverse(task, few)
        if two.sheet(T) == two.sheet(there) == 0 and gap(two(there), two(T)) > 0.5:
            assert two.near(there, two(T)).changed
            assert not two.near(there, two(there)).changed
            return
    raise AssertionError("no such stations")


def test_off_the_map_it_is_the_posture_farthest_within_the_limits_of_the_whole_self_motion(ik):
    robot, seen = ik.task.robot, 0
    for T in poses_within(robot, 30):
        if ik.sheet(T) is None:
            every = self_motions_at(ik.task, T[None, :3, 3], T[None, :3, :3]).q
            best = max(-robot.beyond((q + np.pi) % (2 * np.pi) - np.pi).max() for q in every)
            assert -robot.beyond(ik(T)).max() >= best - 1e-9
            assert ik.why(T).startswith("off the map")
            seen += 1
    assert seen


def test_poses_without_an_answer_say_why(ik):
    T = poses_within(ik.task.robot, 1)[0]
    T[0, 3] += 3
    with pytest.raises(OutOfReachError):
        ik(T)
    assert ik.why(T) == "out of reach"
    assert ik.batch(T[None]).reached.tolist() == [False]
    assert "out of reach" not in str(ik)


def test_a_scene_is_kept_clear_of(ik):
    def touches(Q):
        return ["wall" if q[3] > 0 else "" for q in Q]

    clear = ArmInverse(ik.task, ik.map, touches=touches)
    for T in poses_within(ik.task.robot, 4):
        if "wall" not in clear.why(T):
            assert clear(T)[3] <= 0


@pytest.mark.campaign
def test_a_scene_of_shapes_is_looked_at_though_joints_have_no_limits(ik):
    floor = hk.ik("gen3", scene=hk.Scene(floor=0.0))
    for T in poses_within(ik.task.robot, 4):
        assert (ik.why(T) == floor.why(T)) == np.allclose(ik(T), floor.batch(T[None]).q[0], atol=1e-9)


def test_a_map_is_read_as_it_was_written_and_nothing_else_is(ik):
    data, own = map_bytes(ik.map), digest(ik.task.robot, None)
    found = read_map(ik.task, own, data)
    assert found is not None
    for T in poses_within(ik.task.robot, 5):
        assert np.array_equal(ArmInverse(ik.task, found)(T), ik(T))
    assert read_map(ik.task, own, data[:-200]) is None
    assert read_map(ik.task, own, json.dumps({"format": 1}).encode()) is None
    assert read_map(ik.task, digest(hk.load("sawyer"), None), data) is None


def test_what_a_hand_sees_does_not_change_with_the_first_joint():
    robot = hk.load("yumi-arm")
    hand, q = Hand(hk.pose(robot)), np.repeat(np.linspace(-0.5, 0.5, 7)[None], 2, axis=0)
    q[1, 0] = 1.2
    one, other = hand.terms(hand.arrows(robot.pose(q)))
    assert np.abs(one - other).max() < 1e-12


def test_arms_with_a_closed_form_or_other_joints_have_no_stations():
    assert [takes_stations(hk.pose(hk.load(name))) for name in ("panda", "ur5e", "rail-ur10e")] == [False] * 3
    assert not takes_stations(hk.position(hk.load("gen3")))
    assert takes_stations(hk.pose(hk.load("gen3")))


@pytest.mark.parametrize("name", [campaign("arm", name) for name in ARMS])
def test_of_400_poses_all_are_found_and_nearly_all_by_a_sheet(name):
    ik = hk.ik(name)
    poses = poses_within(ik.task.robot, 400, seed=9)
    found = ik.batch(poses)
    assert found.reached.sum() >= 398
    assert np.abs(ik.task.robot.pose(found.q[found.reached]) - poses[found.reached]).max() < 1e-9
    assert np.mean(found.sheet >= 0) > 0.93
    assert abs(ik.map.share - np.mean(found.sheet >= 0)) < 0.04


@pytest.mark.parametrize("name", [campaign("arm", name) for name in ARMS])
def test_a_map_of_the_package_is_like_the_one_that_is_made(name):
    """Round-off of another build decides where a fit ends: the later a sheet the more so."""
    task = hk.pose(hk.load(name))
    found, made = station_map(task), make_station_map(task)
    assert found is not None
    assert (found.joint, len(found)) == (made.joint, len(made))
    assert np.array_equal(found.sides, made.sides)
    assert np.allclose(found.rules[0], made.rules[0], rtol=0.05, atol=0.05)
    assert abs(found.share - made.share) < 0.02
