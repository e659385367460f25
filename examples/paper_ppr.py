"""The paper's planar arm, two sliders and a hinge, goes round a circle ten times (Fig. 6), by three laws.

With the pseudo-inverse the arm is a Prytz planimeter: its hinge turns on by 0.13 rad a round on the average, for ever.
Both laws of the paper, by (22) and by (23), bring it back.
"""

import casadi as ca
import numpy as np

import holokin as hk

robot = hk.load("ppr")
q0 = np.array([1.6094 - np.sqrt(0.5), 0.4036 - np.sqrt(0.5), np.pi / 4])
task = hk.position(robot)
circle = hk.circle(robot.pose(q0)[:2, 3], center=[1.2070, 0.4036])

laws = {
    "pseudo-inverse": hk.moore_penrose(task),
    "the paper's, (22)": hk.null_basis(task, lambda q: [[ca.cos(q[2]) ** 2, 0], [0, 1], [-ca.sin(q[2]), 0]]),
    "another leaf, (23)": hk.holonomic(task, hk.custom(lambda q: q[0] + q[1] - q[2] + ca.sin(q[2]) + ca.cos(q[2]))),
}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, circle, q0, cycles=10, samples=200)
    motions[name] = found.trajectory
    print(f"{name}: {found.largest[0]:.4f} off after one round, {found.largest[-1]:.4f} after ten [m or rad]")

radius = np.linalg.norm(circle.start[:2] - [1.2070, 0.4036])
print(f"the closed form says {20 * np.pi * (1 - np.sqrt(1 - radius**2 / 4)):.4f} on the average")
