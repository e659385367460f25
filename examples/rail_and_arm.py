"""An ABB IRB 140 on a rail of 3 m deburrs a bar of 1.6 m; the rail is the external axis of the RAPID program.

The cell has seven joints for a tool pose. The rule: joint 1 of the arm stands still, so the rail carries the arm along.
"""

import numpy as np

import holokin as hk

cell = hk.compose(
    hk.load("rail"), hk.robot.Part(hk.load("irb140"), pose=[0, 0, 0.4], rpy=[0, 0, np.pi / 2]), name="cell"
)
q0 = [0.4, *np.deg2rad([0, 20, 10, 0, 60, 0])]
task = hk.pose(cell)
carried = hk.holonomic(task, hk.lock(cell.joint_names[1]))

start = cell.pose(q0)[:3, 3]
corners = [start, start + [1.6, 0, 0], start + [1.6, 0, 0.1], start + [0, 0, 0.1]]
bar = hk.polyline(corners, closed=True, speed=0.5)
print(f"pseudo-inverse: {hk.drift(hk.moore_penrose(task), bar, q0).largest[0]:.3f} rad off after a round")
walk = hk.follow(carried, bar, q0, samples=200)
print(f"rule: {np.abs(walk.drift()).max():.0e} rad; the rail travels {np.ptp(walk.q[:, 0]):.2f} m")

timed = hk.retime(walk, acceleration=[2.0] + [10.0] * 6, profile="trapezoidal", dt=0.01)
program = hk.export.to_rapid(timed, name="deburr", wiring=hk.export.Wiring(external=["rail_joint"]))
program.save("program")
print(f"{timed.t[-1]:.2f} s, {program.targets} targets; the first, in degrees, and the rail in mm:")
first = program.text.index("CONST jointtarget")
print(program.text[first : program.text.index(";", first) + 1])
