"""Two arms and a cube in one MuJoCo scene, a loop at 500 Hz: qpos in, qpos out, found by the joints' names.

The right arm draws circles, led by our control step, by mink with our leaf as a constraint, and by mink alone. MuJoCo
moves the arms, with servos and weight. Needs: pip install "holokin[mink]".
"""

import time

import mujoco
import numpy as np
from mink import SE3, Configuration, FrameTask, solve_ik

import holokin as hk

DT, CYCLES, RADIUS, SIDE = 0.002, 2, 0.05, "right/"
Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])

panda = hk.load("panda")
scene = mujoco.MjSpec()  # yours: mujoco.MjModel.from_xml_path("scene.xml")
cube = scene.worldbody.add_body(pos=[0.6, 0, 0.05])
cube.add_freejoint(name="cube")
cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 0.05])
scene.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1])
for side, y in (("left/", 0.5), ("right/", -0.5)):
    arm = mujoco.MjSpec.from_string(hk.robot.to_mjcf(panda, servo=hk.robot.servo(panda, "position", Q0)))
    scene.attach(arm, prefix=side, frame=scene.worldbody.add_frame(pos=[0, y, 0]))
model = scene.compile()
model.opt.timestep, model.opt.integrator = DT / 2, mujoco.mjtIntegrator.mjINT_IMPLICITFAST

robot = hk.with_base_pose(panda, [0, -0.5, 0], [0, 0, 0])  # the right arm: its poses are in the world
tool = f"{SIDE}panda_hand_tcp"
drives = {side: [model.actuator(side + joint).id for joint in robot.joint_names] for side in ("left/", "right/")}
strategy = hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0]))  # keeps g(q) = q1 - q3
start, quaternion = robot.pose(Q0), np.zeros(4)
mujoco.mju_mat2Quat(quaternion, start[:3, :3].ravel())  # MuJoCo's order: w, x, y, z
circle = hk.circle(start[:3, 3], center=start[:3, 3] - [RADIUS, 0, 0])
points = circle.at(np.linspace(0, circle.duration, round(circle.duration / DT) + 1)).position
goals = hk.pose_of(points, np.tile(quaternion, (len(points), 1)), order="wxyz")
twists = np.hstack([np.diff(points, axis=0) / DT, np.zeros((len(points) - 1, 3))])


def our_step():
    """Joints that are commanded, and k, the number of the step -> those of the next step."""
    step = hk.controller(strategy, dt=DT, q0=Q0)
    return lambda q, k: q + DT * step.step(q, goals[k + 1], twists[k])


def mink_step(constraints):
    """The same by mink, which has a configuration of the whole scene."""
    configuration = Configuration(model)
    frame = FrameTask(tool, "site", position_cost=1.0, orientation_cost=1.0)

    def step(q, k):
        configuration.update(robot.put(model, configuration.q, q, prefix=SIDE))
        frame.set_target(SE3.from_matrix(goals[k + 1]))
        v = solve_ik(configuration, [frame], DT, "daqp", constraints=constraints)
        return q + DT * robot.rates_of(model, v, prefix=SIDE)

    return step


leaf = hk.motion.control.mink_task(strategy, Q0, prefix=SIDE)
for name, step in (("our step", our_step()), ("mink, leaf", mink_step([leaf])), ("mink alone", mink_step([]))):
    data = mujoco.MjData(model)
    for side in drives:
        panda.put(model, data.qpos, Q0, prefix=side)
        data.ctrl[drives[side]] = Q0
    mujoco.mj_step(model, data, 2000)  # the arms sag into their servos
    rested, q, off, began = robot.q_of(model, data.qpos, prefix=SIDE), Q0, 0.0, time.process_time()
    for k in CYCLES * list(range(len(twists))):
        q = step(q, k)
        data.ctrl[drives[SIDE]] = q
        mujoco.mj_step(model, data, 2)
        off = max(off, np.abs(data.site(tool).xpos - points[k]).max())
    rate = CYCLES * len(twists) / (time.process_time() - began)
    mujoco.mj_step(model, data, 500)  # and rest
    drift = np.abs(robot.q_of(model, data.qpos, prefix=SIDE) - rested).max()
    print(f"{name}: joints {drift:.4f} rad off, tool within {1e3 * off:.1f} mm; {rate:.0f} steps in 1 s of processor")
