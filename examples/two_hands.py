"""Two hands of a YuMi carry a tray round a loop: forward, turned about its middle, back, turned back.

Both hands have a path of their own, run through in the same time; twelve rows of fourteen joints. The pseudo-inverse
leaves both elbows elsewhere after each loop; with both arm angles held they return, and the tray never bends.
"""

import numpy as np

import holokin as hk

robot = hk.load("yumi")
hands = [tip.name for tip in robot.tips]
q0 = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])
task = hk.stacked(*(hk.pose(robot, tip=hand) for hand in hands))
obstacles = [hk.obstacle("plinth", hk.robot.Box((0.2, 0.26, 0.4)), (0.0, 0.0, 0.2))]  # on which its shoulders stand
grips = task.pose(q0)[:, :3, 3]  # where the hands hold the tray
forward, turn, up = np.array([0.1, 0.0, 0.06]), 0.4, np.array([0.0, 0.0, 1.0])
middle = grips.mean(axis=0)


def carried(grip: np.ndarray) -> hk.Path:
    """The way of one hand: it goes with the tray, and turns with it."""
    center = np.append(middle[:2], grip[2])  # about the upright line through the middle of the tray
    there = hk.line(grip, grip + forward) + hk.path.arc(grip + forward, center + forward, turn, up, turn=turn * up)
    back = hk.line(there.end, there.end - forward)
    return there + back + hk.path.arc(back.end, center, -turn, up, turn=-turn * up)


loop = hk.path.synchronized(*map(carried, grips))
angles = hk.strategies.constraints.stack(*(hk.arm_angle(tip=hand) for hand in hands))
laws = {"pseudo-inverse": hk.moore_penrose(task), "both arm angles held": hk.holonomic(task, angles)}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, loop, q0, cycles=8, samples=100)
    motions[name] = found.trajectory
    left, right = (task.value_batch(found.trajectory.q)[:, i : i + 3] for i in (0, 6))
    bent = np.ptp(np.linalg.norm(left - right, axis=1))
    print(f"{name}: {found} rad off after 1, 2, ... loops; the hands' distance changes by {bent:.0e} m")

ik = hk.ik(laws["both arm angles held"], q0)
poses = task.pose(q0)
poses[:, :3, 3] += forward
print("joints with the tray forward:", np.round(ik(poses), 3))
