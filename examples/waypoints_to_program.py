"""Waypoints of a CSV file in a workpiece's frame: rounded, in three passes, timed, written as a robot program."""

from pathlib import Path

import numpy as np

import holokin as hk

CSV = """x_mm, y_mm, z_mm, roll_deg, pitch_deg, yaw_deg
0, 0, 0, 180, 0, 0
120, 0, 0, 180, 8, 0
120, 80, 0, 180, 8, 15
60, 110, 10, 175, 0, 15
0, 80, 0, 180, 0, 0
"""
Path("waypoints.csv").write_text(CSV)  # as a drawing program or a colleague gives it to you

robot = hk.load("panda")
here = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])  # wherever the robot happens to stand
law = hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0]))  # joints 1 and 3 keep their difference

waypoints = hk.read_paths("waypoints.csv").paths[0]
print(f"{len(waypoints)} waypoints, notes: {waypoints.notes or 'none'}")
contour = hk.path.blended(hk.polyline(waypoints), 0.004)  # 4 mm at most from each corner
layers = hk.path.passes(contour, 3, offset=[0, 0, -0.002])  # 2 mm deeper each time, to and fro
path = hk.path.with_leads(layers, 0.01, retract=0.05).in_frame([0.42, 0.1, 0.4, 0, 0, np.deg2rad(20)])

entry = hk.motion.approach(law, path, here)  # from any posture to the path's first one, joint by joint
start = entry.q[-1]
walk = hk.follow(law, path, start, samples=600)
timed = hk.retime(walk, acceleration=8.0, profile="trapezoidal", dt=0.01)
wiring = hk.export.Wiring(external=("panda_joint3",))  # of seven axes a KUKA controller has one as external
program = hk.export.to_krl(timed, name="contour", about="q1 - q3 is kept", wiring=wiring)
program.save("program")

print(f"{path.length:.3f} m of path, {len(path.corners)} corners where the robot rests")
print(f"entry {entry.t[-1]:.2f} s, three passes {timed.duration:.2f} s, {program.targets} targets in the program")
