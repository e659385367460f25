"""A Kinova Gen3 drills a grid of nine holes; how the drill is turned about its own axis does not matter.

So the task has five rows (point and axis) and the arm two joints to spare. The pseudo-inverse leaves each plate with
other joints; with joints 3 and 7 held a hole has the same joints in every plate.
"""

from itertools import pairwise

import numpy as np

import holokin as hk

robot = hk.with_tool(hk.load("gen3"), [0, 0, 0.18])
q0 = np.deg2rad([0, 35, 0, 80, 0, 65, 0])  # the drill points down
task = hk.pose(robot, "axis")
start = robot.pose(q0)
PLATES = 6

points = [start[:3, 3]]
for row, x in enumerate((0.0, 0.07, 0.14)):
    for y in (-0.15, 0.0, 0.15) if row % 2 == 0 else (0.15, 0.0, -0.15):
        above = start[:3, 3] + [x, y, 0]
        points += [above, above - [0, 0, 0.06], above]  # down and up again
holes = hk.polyline([a for a, b in pairwise(points) if np.any(a != b)] + points[-1:], closed=True)

laws = {
    "pseudo-inverse": hk.moore_penrose(task),
    "joints 3 and 7 held": hk.holonomic(task, hk.lock("joint_3", "joint_7")),
}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, holes, q0, cycles=PLATES, samples=600, method="velocity")
    motions[name] = found.trajectory
    print(f"{name}: {found.largest.round(5)} rad off after 1, 2, ... plates")
