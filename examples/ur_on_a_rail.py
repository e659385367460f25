"""A UR10e on a rail of 3 m paints the rim of a panel of 2 m by 0.5 m: seven joints for a tool pose.

The pseudo-inverse shares the way between rail and arm anew in each round, and the arm creeps. With the pan joint held
the rail carries the arm along, and every round is the same.
"""

import numpy as np

import holokin as hk
from holokin.robot import Box, Capsule, Cylinder

robot = hk.robot.with_shape(hk.load("rail-ur10e"), "spray gun", Cylinder(0.04, 0.12), xyz=[0, 0, 0.04])
robot = hk.robot.with_shape(robot, "nozzle", Capsule(0.016, 0.1), xyz=[0, -0.06, 0.07], rpy=[np.pi / 2, 0, 0])
q0 = np.array([0.4, *np.deg2rad([-90, -70, 100, -120, -90, 0])])
task = hk.pose(robot)
start = robot.pose(q0)[:3, 3]
rim = hk.polyline(start + np.array([[0, 0, 0], [2, 0, 0], [2, 0, 0.5], [0, 0, 0.5]]), closed=True, speed=0.5)
obstacles = [hk.obstacle("panel", Box([2.0, 0.02, 0.5]), xyz=start + [1.0, 0.2, 0.18])]  # in front of the nozzle

laws = {"pseudo-inverse": hk.moore_penrose(task), "pan joint held": hk.holonomic(task, hk.lock("shoulder_pan_joint"))}
motions = {}
for name, law in laws.items():
    found = hk.drift(law, rim, q0, cycles=4, samples=200)
    motions[name] = found.trajectory
    rail = found.trajectory.q[list(found.trajectory.marks), 0]
    print(f"{name}: {found} off after 1, 2, ... rounds; the rail is at {np.round(rail, 3)} m")
