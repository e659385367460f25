"""A Kinova Gen3 drills a grid of nine holes; how the drill is turned about its own axis does not matter.

So the task has five rows (point and axis) and the arm two joints to spare. The pseudo-inverse comes back from each
plate with other joints; with joints 3 and 7 held the tenth plate is drilled as the first.
"""

import numpy as np

import holokin as hk

robot = hk.with_tool(hk.load("gen3"), xyz=[0, 0, 0.18])
q0 = np.deg2rad([0, 35, 0, 80, 0, 65, 0])  # the drill points down
task = hk.pose(robot, "axis")
plate = robot.pose(q0)[:3, 3]

points = [plate]
for row, x in enumerate((0.0, 0.07, 0.14)):
    for y in (-0.2, 0.0, 0.2) if row % 2 == 0 else (0.2, 0.0, -0.2):
        above = plate + [x, y, 0]
        points += [above, above - [0, 0, 0.06], above]  # down and up again
stops = [points[0], *(b for a, b in zip(points, points[1:], strict=False) if np.any(a != b))]
holes = hk.polyline(stops, closed=True)

laws = {"pseudo-inverse": hk.moore_penrose(task), "joints 3 and 7 held": hk.holonomic(task, hk.lock("joint_3", "joint_7"))}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, holes, q0, cycles=4, samples=200)
    motions[name] = found.trajectory
    print(f"{name}: {found} rad off after 1, 2, ... plates")
