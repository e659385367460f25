"""A hand leads a Panda at 100 Hz: it reaches too far, lets go, takes hold elsewhere, and returns by another way.

`ik` alone decides the joints: `follower` is what goes into a loop of LeRobot, robosuite or Isaac Lab.
"""

from collections.abc import Callable, Iterator

import numpy as np

import holokin as hk
from holokin.app.studio import Motion

RATE, robot = 100.0, hk.load("panda")  # poses of the hand a second
ready = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
task = hk.pose(robot)
ik = hk.ik(hk.holonomic(task, hk.lock("panda_joint3")), ready)
Joints = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (tool pose wanted, joints now) -> joints


def ours(pose: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The joints of the pose on the leaf, or of the nearest pose in reach; none moves faster than it can."""
    return ik.nearest(pose, q, step=robot.max_velocity / RATE).q


def damped(pose: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Differential inverse kinematics as in many teleoperation loops: damped least squares, one step a pose."""
    J, error = task.jacobian(q), task.error(q, pose[:3, 3], pose[:3, :3])
    dq = J.T @ np.linalg.solve(J @ J.T + 1e-3 * np.eye(6), error)
    return q + np.clip(dq, -robot.max_velocity / RATE, robot.max_velocity / RATE)


def follower(joints: Joints, start: np.ndarray) -> Callable[[np.ndarray, bool], np.ndarray]:
    """(pose of the hand, clutch closed) -> joints. While the clutch is closed, the tool moves as the hand does."""
    q, held = start, None

    def follow(hand: np.ndarray, closed: bool) -> np.ndarray:
        nonlocal q, held
        if not closed:
            held = None
            return q
        hand0, tool0 = held = held or (hand.copy(), robot.pose(q))
        pose = np.eye(4)
        pose[:3, 3] = tool0[:3, 3] + hand[:3, 3] - hand0[:3, 3]
        pose[:3, :3] = hand[:3, :3] @ hand0[:3, :3].T @ tool0[:3, :3]
        q = joints(pose, q)
        return q

    return follow


def hand_stream() -> Iterator[tuple[np.ndarray, bool, str]]:
    """(pose, clutch closed, mark) at 100 Hz: places of the hand [m], its turn about z [rad], seconds to there."""
    ways = [
        ([0.1, 0.2, 0.1], 0.5, 2.0, True, "before"), ([0.7, 0.3, 0.3], 0.0, 2.0, True, "too far"),
        ([0.0, 0.3, 0.0], 0.3, 2.0, True, ""), ([0.4, -0.1, 0.2], -0.2, 1.0, False, "let go"),
        ([0.4, -0.4, 0.4], -0.9, 2.0, True, ""), ([0.5, -0.5, 0.1], -0.5, 2.0, True, ""),
        ([0.5, -0.2, 0.3], 0.0, 2.0, True, "after"),
    ]  # fmt: skip
    place, turn = np.zeros(3), 0.0
    for goal, angle, seconds, closed, mark in ways:
        for share in np.append(np.linspace(0, 1, round(seconds * RATE)), np.ones(round(RATE))):  # rests there for 1 s
            pose, a = np.eye(4), turn + share * (angle - turn)
            pose[:2, :2] = [[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]
            pose[:3, 3] = place + share * (np.array(goal) - place)
            yield pose, closed, ""
        place, turn = np.array(goal), angle
        yield pose, closed, mark


motions = {}
for name, joints in (("damped least squares", damped), ("ours", ours)):
    follow, q, at = follower(joints, ready), [], {}
    for hand, closed, mark in hand_stream():
        q.append(follow(hand, closed))
        at[mark] = len(q) - 1
    motions[name] = Motion(np.arange(len(q)) / RATE, np.array(q), marks=(at["before"], at["after"]))
    tool = np.abs(robot.pose(q[at["after"]]) - robot.pose(q[at["before"]])).max()
    apart = motions[name].errors[0]
    print(f"{name}: tool {tool:.6f} m, joints {apart:.6f} rad apart, below 1e-12: {apart < 1e-12}")
