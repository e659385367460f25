"""From a URDF to programs: a seven-joint arm draws a circle within its limits, for KUKA; a UR5e does so in URScript.

The arm holds its elbow's swivel angle. The six-axis UR5e has a torch that may spin about its axis, and locks joint 6.
"""

from pathlib import Path

import numpy as np

import holokin as hk

arm = hk.load(Path(__file__).parents[1] / "docs" / "arm7.urdf", tip="flange")
ur5e = hk.with_tool(hk.load("ur5e"), [0, 0, 0.15], [0, np.deg2rad(30), 0])
jobs = {
    "kuka": (hk.holonomic(hk.pose(arm), hk.arm_angle()), [-29.5, 36.6, 43.3, 90, -27, 64.3, 20.1]),
    "ur": (hk.holonomic(hk.pose(ur5e, "axis"), hk.lock("wrist_3_joint")), [10, -100, 110, -95, -80, 20]),
}
for name, (law, degrees) in jobs.items():
    q0, robot = np.deg2rad(degrees), law.task.robot
    start = robot.pose(q0)[:3, 3]
    circle = hk.circle(start, start - [0.08, 0, 0], speed=0.25)
    timed = hk.retime(
        hk.follow(law, circle, q0, samples=200), acceleration=8.0, profile="trapezoidal", speed=1.0, dt=0.008
    )
    if name == "kuka":
        program = hk.export.to_krl(timed, name="circle", wiring=hk.export.Wiring(external=["joint_3"]))
    else:
        program = hk.export.to_urscript(timed, name="circle")
    files = [file.name for file in program.save(name)]
    most = 1 + max(timed.excess().values())
    print(f"{robot.name}: {timed.t[-1]:.3f} s, at {most:.0%} of a limit, {program.targets} targets: {files}")
