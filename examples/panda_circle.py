"""A Panda draws a circle: the pseudo-inverse drifts, a linear coupling of panda_joint1 and panda_joint3 does not.

With your own robot: robot = hk.from_urdf("my.urdf", tip="tool0").
"""

import holokin as hk

robot = hk.load("panda")
q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
task = hk.pose(robot)
start = robot.pose(q0)[:3, 3]
circle = hk.circle(start, center=start - [0.1, 0, 0])

pseudo_inverse = hk.moore_penrose(task)
coupled = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))  # g(q) = q1 - q3
motions = {}
for name, G in {"pseudo-inverse": pseudo_inverse, "q1 - q3 held": coupled}.items():
    verdict = hk.involutivity(G, hk.around(q0, 0.2))
    found = hk.drift(G, circle, q0, cycles=6, samples=200)
    print(f"{name}: holonomic: {verdict.holonomic}; joint drift after 1, 2, ... cycles [rad]: {found}")
    motions[name] = found.trajectory
