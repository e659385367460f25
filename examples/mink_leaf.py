"""mink with one constraint more, the leaf of a holonomic strategy: a Panda draws circles, and two half circles.

Needs: pip install "holokin[mink]". New to a loop of mink are two lines:
`hk.motion.control.mink_task`, and `constraints=[leaf]`.
"""

import mujoco
import numpy as np
from mink import SE3, Configuration, FrameTask, PostureTask, solve_ik

import holokin as hk

DT, SPEED, RADIUS = 0.01, 0.1, 0.1  # step [s], speed of the tool [m/s], radius of the circle [m]
Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])

model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(hk.load("panda")))  # or yours: from_xml_path("scene.xml")
tool = model.site(0).name
robot = hk.robot.from_mjcf(model, tip=tool)
pose = robot.pose(Q0)
strategy = hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0]))  # keeps g(q) = q1 - q3


def joints_after(turns: float, posture_cost: float, constraints: list) -> np.ndarray:
    """Where the joints are after some turns round the circle; negative ones go the other way."""
    configuration = Configuration(model, Q0)
    frame = FrameTask(tool, "site", position_cost=1.0, orientation_cost=1.0)
    posture = PostureTask(model, cost=posture_cost)
    posture.set_target(Q0)
    steps = round(2 * np.pi * RADIUS * abs(turns) / SPEED / DT)
    for angle in np.linspace(0, 2 * np.pi * turns, steps + 1)[1:]:
        goal = pose.copy()
        goal[:3, 3] += RADIUS * np.array([np.cos(angle) - 1, np.sin(angle), 0])
        frame.set_target(SE3.from_matrix(goal))
        v = solve_ik(configuration, [frame, posture], DT, solver="daqp", constraints=constraints)
        configuration.integrate_inplace(v, DT)
    return configuration.q


leaf = hk.motion.control.mink_task(strategy, Q0)
for name, cost, constraints in (("no rule", 0.0, []), ("posture task", 1e-3, []), ("our leaf", 0.0, [leaf])):
    drift = np.abs(joints_after(2, cost, constraints) - Q0).max()
    ways = np.abs(joints_after(0.5, cost, constraints) - joints_after(-0.5, cost, constraints)).max()
    print(f"mink, {name}: {drift:.6f} rad off after two circles, two paths {ways:.6f} rad apart")
