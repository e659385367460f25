"""pink with one constraint more, the leaf of a holonomic strategy: a Panda draws circles, and two half circles.

Needs: pip install "holokin[pink]". New to a loop of pink are two lines:
`hk.motion.control.pink_task`, and `constraints=[leaf]`.
"""

import numpy as np
import pinocchio as pin
from pink import Configuration, solve_ik
from pink.tasks import FrameTask, PostureTask

import holokin as hk

DT, SPEED, RADIUS = 0.01, 0.1, 0.1  # step [s], speed of the tool [m/s], radius of the circle [m]
Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])

model = pin.buildModelFromXML(hk.robot.to_urdf(hk.load("panda")))  # or yours: pin.buildModelFromUrdf("my.urdf")
robot = hk.robot.from_pinocchio(model)
tool, pose = robot.tips[0].name, robot.pose(Q0)
strategy = hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0]))  # keeps g(q) = q1 - q3


def joints_after(turns: float, posture_cost: float, constraints: list) -> np.ndarray:
    """Where the joints are after some turns round the circle; negative ones go the other way."""
    configuration = Configuration(model, model.createData(), Q0)
    frame = FrameTask(tool, position_cost=1.0, orientation_cost=1.0)
    posture = PostureTask(cost=posture_cost)
    posture.set_target(Q0)
    steps = round(2 * np.pi * RADIUS * abs(turns) / SPEED / DT)
    for angle in np.linspace(0, 2 * np.pi * turns, steps + 1)[1:]:
        offset = RADIUS * np.array([np.cos(angle) - 1, np.sin(angle), 0])
        frame.set_target(pin.SE3(pose[:3, :3], pose[:3, 3] + offset))
        v = solve_ik(configuration, [frame, posture], DT, solver="quadprog", constraints=constraints)
        configuration.integrate_inplace(v, DT)
    return configuration.q


leaf = hk.motion.control.pink_task(strategy, Q0)
for name, cost, constraints in (("no rule", 0.0, []), ("posture task", 1e-3, []), ("our leaf", 0.0, [leaf])):
    drift = np.abs(joints_after(2, cost, constraints) - Q0).max()
    ways = np.abs(joints_after(0.5, cost, constraints) - joints_after(-0.5, cost, constraints)).max()
    print(f"pink, {name}: {drift:.6f} rad off after two circles, two paths {ways:.6f} rad apart")
