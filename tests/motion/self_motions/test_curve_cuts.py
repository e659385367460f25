"""All curves of postures of a pose: none is missed, none is told twice, and each holds the tool."""

import numpy as np
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.base.poses import pose_from
from holokin.motion.self_motions.curve_cuts import STEP, curves_by_cuts
from holokin.motion.self_motions.posture_search import postures_from
from holokin.robot.closed_form import ArmClass, ClosedInverse, GeneralInverse, arm_class, general_inverse
from holokin.strategies.tasks.frame_task import Orientation
from holokin.strategies.tasks.task import Task

Curves = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def random_poses(task: Task, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.maximum(task.robot.lower, -3.0), np.minimum(task.robot.upper, 3.0)
    return task._poses(np.random.default_rng(seed).uniform(low, high, (count, task.n)))


def sound_curves(task: Task, p: np.ndarray, R: np.ndarray) -> Curves:
    """The curves; each holds its pose, in steps no longer than they should be, and closed ones come back."""
    q, pose, curve, closed = curves_by_cuts(task, p, R)
    hinges = task.robot.hinges
    assert np.abs(task._geometric_twin.error(q, p[pose], R[pose])).max(initial=0.0) < 1e-7
    same = np.diff(curve) == 0
    assert (np.diff(curve)[~same] == 1).all() and (np.diff(pose) >= 0).all() and (np.diff(pose)[same] == 0).all()
    assert np.linalg.norm(np.diff(q, axis=0)[same], axis=1).max(initial=0.0) < 1.3 * STEP
    first = np.searchsorted(curve, np.arange(len(closed)))
    last = np.searchsorted(curve, np.arange(len(closed)), side="right") - 1
    turns = (q[last] - q[first])[closed] / (2 * np.pi)
    assert np.abs(turns - np.round(turns) * hinges).max(initial=0.0) < 1e-12
    return q, pose, curve, closed


def single(array: np.ndarray) -> np.ndarray:
    """In single precision, as single numbers."""
    return array.astype(np.float32)


def crossings(value: np.ndarray, pose: np.ndarray, curve: np.ndarray, poses: int, turning: bool) -> np.ndarray:
    """How often the curves of each pose come by 0, with `turning` by any whole turn."""
    lap = np.floor(value / (2 * np.pi)) if turning else (value >= 0).astype(float)
    count, same = np.zeros(poses, dtype=int), np.diff(curve) == 0
    np.add.at(count, pose[1:][same], np.abs(np.diff(lap))[same].astype(int))
    return count


@pytest.mark.parametrize(
    ("name", "joint"), [("rail-ur10e", 0), *(campaign(("name", "joint"), (n, 6)) for n in ("panda", "iiwa14"))]
)
def test_at_each_value_of_a_joint_the_curves_have_the_postures_of_the_closed_inverse(name: str, joint: int) -> None:
    robot, rng, k = hk.load(name), np.random.default_rng(1), 6
    task = hk.pose(robot)
    p, R = random_poses(task, k)
    q, pose, curve, closed = sound_curves(task, p, R)
    found = arm_class(robot, (joint,), task.tip)
    assert isinstance(found, ArmClass)
    inverse, turning = ClosedInverse(found, limits=False), bool(robot.hinges[joint])
    low, high = (-np.pi, np.pi) if turning else (robot.lower[joint], robot.upper[joint])
    for c in rng.uniform(low, high, 8):
        postures = (inverse.answers(pose_from(p, R), np.full((k, 1), c))[:, :, 9] > 0).sum(axis=1)
        assert np.array_equal(crossings(q[:, joint] - c, pose, curve, k, turning), postures)
    # A rail's curves close, or end at both ends at its limits.
    ends = [q[curve == i][[0, -1], joint] for i in np.flatnonzero(~closed)]
    assert turning == (not ends)
    for pair in ends:
        assert np.abs(np.subtract.outer(pair, [low, high])).min(axis=1).max() < 1e-9


@sampled(1, "kind", ["axis", "rpy"])
def test_the_spin_of_a_tool_has_the_postures_of_the_closed_inverse(irb140: hk.Robot, kind: Orientation) -> None:
    """An axis of the tool, or roll, pitch and yaw without roll: the tool may turn about z, or x."""
    rows, axis = ([0, 1, 2, 3, 4], 2) if kind == "axis" else ([0, 1, 2, 4, 5], 0)
    task, k = hk.pose(irb140, orientation=kind)[rows], 6
    p, R = random_poses(task, k)
    q, pose, curve, _ = sound_curves(task, p, R)
    found = arm_class(irb140, (), task.tip)
    assert isinstance(found, ArmClass)
    turn = R[pose].swapaxes(1, 2) @ irb140.pose(q)[:, :3, :3]
    i, j = [(axis + 1) % 3, (axis + 2) % 3]
    spin = np.arctan2(turn[:, j, i], turn[:, i, i])
    same = np.append(False, np.diff(curve) == 0)
    steps = np.where(same, (np.diff(spin, prepend=0) + np.pi) % (2 * np.pi) - np.pi, 0)
    first = np.searchsorted(curve, curve)
    spin = spin[first] + np.cumsum(steps) - np.cumsum(steps)[first]  # continuous along each curve
    for c in np.random.default_rng(1).uniform(-np.pi, np.pi, 8):
        about = np.eye(3)
        about[[i, i, j, j], [i, j, i, j]] = np.cos(c), -np.sin(c), np.sin(c), np.cos(c)
        answers = ClosedInverse(found, limits=False).answers(pose_from(p, R @ about), np.zeros((k, 0)))
        assert np.array_equal(crossings(spin - c, pose, curve, k, True), (answers[:, :, 9] > 0).sum(axis=1))


def test_a_planar_arm_has_one_curve_or_two_by_the_rule_of_grashof(planar_3r: hk.Robot) -> None:
    """With the tool's point held it is a linkage of four bars: with s + l <= p + q it has two components."""
    task = hk.position(planar_3r, rows=[0, 1])
    p, R = random_poses(task, 30)
    _, pose, curve, closed = sound_curves(task, p, R)
    bars = np.sort(np.column_stack([np.ones((len(p), 3)), np.linalg.norm(p[:, :2], axis=1)]), axis=1)
    components = np.where(bars[:, 0] + bars[:, 3] < bars[:, 1] + bars[:, 2], 2, 1)
    assert closed.all() and set(components) == {1, 2}
    assert [len(np.unique(curve[pose == s])) for s in range(len(p))] == components.tolist()


GENERAL = ["gen3", "sawyer", "yumi-arm", "rizon4"]
SMALL = [-2.174, -0.142, 0.777, -0.43, 2.166, -0.654, 0.065]
"""A Sawyer's posture at a pose whose smallest curve keeps all joints within 0.2 rad, between the cuts."""


@pytest.mark.parametrize(
    ("name", "count", "starts"),
    [("sawyer", 2, 256), *(campaign(("name", "count", "starts"), (n, 40, 2000)) for n in GENERAL)],
)
def test_every_posture_that_newtons_method_finds_lies_on_one_curve(name: str, count: int, starts: int) -> None:
    task = hk.pose(hk.load(name))
    p, R = random_poses(task, count)
    if name == "sawyer":
        more = task._poses(np.array([SMALL]))
        p, R = np.concatenate([p, more[0]]), np.concatenate([R, more[1]])
    q, pose, curve, closed = sound_curves(task, p, R)
    assert closed.all()
    rng = np.random.default_rng(3)
    for s in range(len(p)):
        begun = rng.uniform(-np.pi, np.pi, (starts, task.n))
        found, arrived = postures_from(
            task, begun, np.repeat(p[s : s + 1], starts, 0), np.repeat(R[s : s + 1], starts, 0)
        )
        assert arrived.mean() > 0.5
        # The nearest place on the polygon of each curve: chords of 0.2 leave it by 0.03, in sharp turns by more.
        some, own = q[pose == s], curve[pose == s]
        a, b = some[:-1][np.diff(own) == 0], some[1:][np.diff(own) == 0]
        gap = (found[arrived][:, None] - a + np.pi) % (2 * np.pi) - np.pi
        along = np.clip(np.einsum("kjn,jn->kj", gap, b - a) / np.sum((b - a) ** 2, axis=1), 0, 1)
        off = np.linalg.norm(gap - along[:, :, None] * (b - a), axis=2)
        assert off.min(axis=1).max() < 0.06
    # No curve twice: postures of others are not on it.
    first = np.searchsorted(curve, np.arange(len(closed)))
    for i, c in zip(first, curve[first], strict=True):
        others = q[(pose == pose[i]) & (curve != c)]
        away = np.linalg.norm((others - q[i] + np.pi) % (2 * np.pi) - np.pi, axis=1)
        assert away.min(initial=np.inf) > 0.01


def test_a_pose_out_of_reach_has_no_curves_and_curves_do_not_hang_on_other_poses() -> None:
    task = hk.pose(hk.load("gen3"))
    p, R = random_poses(task, 3)
    _, pose, curve, closed = curves_by_cuts(task, np.vstack([p[:1], p[:1] + [9.0, 0, 0], p[2:]]), R)
    assert set(pose) == {0, 2}
    _, _, own, closed_alone = curves_by_cuts(task, single(p[2:]), single(R[2:]))
    assert len(closed_alone) == (closed.sum() - curve[pose == 0].max() - 1)
    assert [np.sum(own == c) for c in range(len(closed_alone))] == [
        np.sum(curve == c) for c in np.unique(curve[pose == 2])
    ]
    assert len(curves_by_cuts(task, p[:0], R[:0])[0]) == 0


NEARLY_SINGULAR = [
    "-2.744786424130973 0.2511155601899788 0.2492094331781929 -0.7791142269554958 0.288172609596233 1.310579767368349"
    " -0.711234783609625",
    "-2.740449609981201 -1.184955055440266 0.45853234750793 -1.255403632762411 -0.9107105885676723 0.868444446471428"
    " 0.539387066502493",
]
"""Postures of a YuMi's arm at poses whose curves turn sharply, or pass each other closely, near singular postures."""


@pytest.mark.campaign
def test_near_singular_postures_each_curve_is_told_once() -> None:
    """At values of a joint that is held they have as many postures as the eigenvalue problem has roots."""
    robot, joint = hk.load("yumi-arm"), 2
    task = hk.pose(robot)
    p, R = task._poses(np.array([text.split() for text in NEARLY_SINGULAR], dtype=float))
    q, pose, curve, _ = sound_curves(task, p, R)
    inverse = general_inverse(robot, (joint,), task.tip)
    assert isinstance(inverse, GeneralInverse)
    for c in np.random.default_rng(0).uniform(-np.pi, np.pi, 6):
        postures = inverse.postures(pose_from(p, R), [c])
        count = np.bincount(postures.row, minlength=len(p))
        assert np.array_equal(crossings(q[:, joint] - c, pose, curve, len(p), True), count)
