"""The paper's experiment: an ABB IRB 140 positions its tool, orientation free, on a square, here of 0.3 m.

Two laws tie the orientation to the position by the same formula: one with Euler angles, (27) and (28) of the paper,
one with the geometric Jacobian in their place. They look alike; the first is holonomic, the second drifts.
"""

import numpy as np

import holokin as hk

robot = hk.load("irb140")
q0 = np.deg2rad([10, 70, 10, 20, 50, 30])
task = hk.position(robot)
corner = robot.pose(q0)[:3, 3]
square = hk.polyline(corner + 0.3 * np.array([[0, 0, 0], [0, 1, 0], [0, 1, -1], [0, 0, -1]]), closed=True)

laws = {
    "pseudo-inverse": hk.moore_penrose(task),
    "coupled, twist": hk.strategies.coupled_twist(task, 1.0),
    "coupled, Euler angles": hk.holonomic(task, hk.coupled(1.0)),
}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, square, q0, cycles=6, samples=100)
    motions[name] = found.trajectory
    print(f"{name}: {found} rad off after 1, 2, ... rounds")
