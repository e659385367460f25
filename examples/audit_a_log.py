"""Does this robot repeat? Ask its log: joint positions over time, as a controller or ROS writes them.

The log here is of a Panda whose controller uses the pseudo-inverse, with the noise of its encoders, in degrees.
"""

import csv

import numpy as np

import holokin as hk

robot = hk.load("panda")
q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
start = robot.pose(q0)[:3, 3]
circle = hk.circle(start, center=start - [0.1, 0, 0])
walk = hk.follow(hk.moore_penrose(hk.pose(robot)), circle, q0, samples=300, cycles=4)
measured = np.rad2deg(walk.q + np.random.default_rng(0).normal(scale=1e-4, size=walk.q.shape))
with open("log.csv", "w", newline="") as file:
    csv.writer(file).writerows([["time", *robot.joint_names], *np.column_stack([walk.t, measured])])

found = hk.audit_recording(hk.read_recording("log.csv", robot, degrees=True), robot)  # holokin audit log.csv --degrees
each = np.abs(found.since_start[0]).max()
answers = f"{found.verdict.name}, {found.trend.name}"
print(f"{answers}: {len(found.cycles)} cycles, {each:.3f} rad in the first, most in {found.worst_joint}")
print(found.sentence())
