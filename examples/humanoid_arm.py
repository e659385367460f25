"""A Unitree G1 wipes a disc before it with its left hand: waist and arm are ten joints for the six of the hand's pose.

The pseudo-inverse moves the waist along, and leans further with every circle, until the waist is at its stop. With the
waist upright and the upper arm's roll held the robot stands after each circle as before.
The model is that of the package example-robot-data (pip install example-robot-data).
"""

from importlib.metadata import files

import numpy as np

import holokin as hk

urdf = next(file.locate() for file in files("example-robot-data") if file.name == "g1_29dof_rev_1_0.urdf")
robot = hk.with_base_pose(hk.from_urdf(str(urdf), tip="left_rubber_hand", base="pelvis"), [0, 0, 0.79])
q0 = np.array([0, 0, 0.1, 0.2, 0.4, 0, -0.2, 0, 0, 0])
task = hk.pose(robot)
hand = robot.pose(q0)[:3, 3]
disc = hk.circle(hand, center=hand - [0, 0.06, 0], normal=[1, 0, 0])

held = hk.lock("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint", "left_shoulder_yaw_joint")
laws = {"pseudo-inverse": hk.moore_penrose(task), "waist upright": hk.holonomic(task, held)}
motions = {}
for name, law in laws.items():
    try:
        motions[name] = hk.follow(law, disc, q0, cycles=6, samples=120)
    except hk.base.errors.PathError as stopped:
        motions[name] = stopped.trajectory
    motion = motions[name]
    after = np.abs(motion.drift_since_start()).max(axis=1).round(3)
    lean = np.rad2deg(abs(motion.q[-1, 1]))
    print(f"{name}: {motion.cycles} circles, {after} rad off; leans {lean:.1f} degrees aside: {motion.status.cause}")
