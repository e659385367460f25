"""A KUKA iiwa goes round a window frame, upright before it: the elbow stays up, or sinks.

The pseudo-inverse lets the elbow swing aside a little more in each round. The swivel angle of the arm, held by a
holonomic law, keeps it where the fixture beside the robot needs it.
"""

import numpy as np

import holokin as hk

robot = hk.load("iiwa14")
q0 = np.deg2rad([0, 35, 0, -85, 0, 60, 0])  # elbow up
task = hk.pose(robot)
top = robot.pose(q0)[:3, 3]
frame = hk.circle(top, center=top - [0, 0.25, 0], normal=[1, 0, 0])

swivel = hk.arm_angle()
laws = {"pseudo-inverse": hk.moore_penrose(task), "elbow up": hk.holonomic(task, swivel)}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, frame, q0, cycles=6, samples=150)
    motions[name] = found.trajectory
    elbow = np.array([robot.skeleton(q)[0][4] for q in found.trajectory.q[list(found.trajectory.marks)]])
    aside = np.linalg.norm(elbow - elbow[0], axis=1).max()
    print(f"{name}: {found} rad off after 1, 2, ... rounds; the elbow ends up to {1000 * aside:.0f} mm aside")
