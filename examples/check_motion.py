"""Look at a motion before the robot does it: a Panda goes down behind the rim of a box, once too near to it."""

import numpy as np

import holokin as hk

robot = hk.robot.with_capsules(hk.load("panda"), {"panda_joint7": 0.05})  # a hand of 5 cm about the tool's axis
q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
task = hk.pose(robot)
law = hk.holonomic(task, hk.arm_angle())
start = robot.pose(q0)[:3, 3]
stroke = hk.polyline([start, start - [0, 0, 0.1], start + [0, 0.15, -0.1], start + [0, 0.15, 0]], closed=True)
walk = hk.follow(law, stroke, q0, samples=200)
timed = hk.retime(walk, acceleration=5.0, profile="trapezoidal", dt=0.004)

for height in (0.25, 0.35):
    rim = hk.obstacle("rim", hk.robot.Capsule(0.02, 0.6), [start[0], start[1], height], [np.pi / 2, 0, 0])
    report = hk.check(timed, hk.Scene(obstacles=[rim], floor=0.0, clearance=0.02), task=task)
    nearest = report.pairs[0]
    print(f"rim at {height} m: {' and '.join(nearest.pair)} are {nearest.least:.3f} m apart at {nearest.time:.2f} s")
    for finding in report.findings:
        print(" ", finding)
