"""A Kinova Gen3 drills a grid of nine holes; how the drill is turned about its own axis does not matter.

So the task has five rows (point and axis) and the arm two joints to spare. The pseudo-inverse leaves each plate with
other joints; by inverse kinematics with joints 3 and 7 held, a hole has the same joints in every plate.
"""

import numpy as np

import holokin as hk
from holokin.studios import Motion

robot = hk.with_tool(hk.load("gen3"), xyz=[0, 0, 0.18])
q0 = np.deg2rad([0, 35, 0, 80, 0, 65, 0])  # the drill points down
task = hk.pose(robot, "axis")
start = robot.pose(q0)
PLATES = 6

points = [start[:3, 3]]
for row, x in enumerate((0.0, 0.07, 0.14)):
    for y in (-0.2, 0.0, 0.2) if row % 2 == 0 else (0.2, 0.0, -0.2):
        above = start[:3, 3] + [x, y, 0]
        points += [above, above - [0, 0, 0.06], above]  # down and up again
holes = hk.polyline([a for a, b in zip(points, points[1:], strict=False) if np.any(a != b)] + points[-1:], closed=True)

drift = hk.drift(hk.moore_penrose(task), holes, q0, cycles=PLATES, samples=300)
ik = hk.inverse(hk.holonomic(task, hk.lock("joint_3", "joint_7")), q0)
t, q, wanted = drift.trajectory.t, [q0], start.copy()
for position in holes.at(t[1:] % holes.duration).position:
    wanted[:3, 3] = position
    q.append(ik.near(wanted, q[-1]))
motions = {
    "pseudo-inverse": drift.trajectory,
    "joints 3 and 7 held": Motion(t, np.array(q), drift.trajectory.marks),
}
print(f"pseudo-inverse: {drift} rad off after 1, 2, ... plates")
print(f"joints 3 and 7 held: {motions['joints 3 and 7 held'].errors.max():.0e} rad off")
