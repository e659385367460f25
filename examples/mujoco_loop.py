"""A control loop at 1 kHz on MuJoCo: a Panda with position servos draws circles, gets a shove, and comes back.

The law is told the commanded joints, as position servos want it; docs/programs.md says why, and what to do with others.
"""

import mujoco
import numpy as np

import holokin as hk

DT, CYCLES, RAMP, REST = 0.001, 3, 0.5, 0.5  # [s]; the tool rests at the end of each circle

robot = hk.load("panda")
q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
task, start = hk.pose(robot), robot.pose(q0)
circle = hk.circle(start[:3, 3], center=start[:3, 3] - [0.05, 0, 0])

servo = hk.robot.servo(robot, "position", q0)
model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot, servo=servo))
model.opt.timestep, model.opt.integrator = DT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
drives = [model.actuator(joint).id for joint in robot.joint_names]
elbow = model.body("panda_joint4_link").id

t = np.arange(0, circle.duration + RAMP + REST, DT)  # from rest to rest: the speed rises and falls evenly
speed = np.clip(np.minimum(t, circle.duration + RAMP - t) / RAMP, 0, 1)
way = np.minimum(np.cumsum(speed) * DT, circle.duration)
points = circle.at(way).position
twists = np.hstack([np.diff(points, axis=0), np.zeros((len(t) - 1, 3))]) / DT

for name, law in (
    ("pseudo-inverse", hk.moore_penrose(task)),
    ("q1 - q3 held", hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))),
):
    data = mujoco.MjData(model)
    data.qpos[:] = data.ctrl[drives] = q0
    mujoco.mj_step(model, data, 2000)  # the arm sags into its servos
    first = data.qpos.copy()
    step = hk.controller(law, dt=DT, q0=q0, gain=10, constraint_gain=10)
    watch = hk.motion.LoopWatch(DT)  # warns if the arm does not follow
    command, pose = q0.copy(), start.copy()
    for _ in range(CYCLES):
        for k, twist in enumerate(twists):
            pose[:3, 3] = points[k + 1]
            dq = step.step(command, pose, twist)  # command, not data.qpos
            watch.see(data.qpos, dq)
            command += DT * dq
            data.ctrl[drives] = command
            data.xfrc_applied[elbow, 1] = 200.0 if 1.0 < k * DT < 1.2 else 0.0  # a shove of 200 N
            mujoco.mj_step(model, data)
    off = np.abs(data.qpos - first).max()
    print(f"{name}: joints {off:.4f} rad from where they rested; {watch.sentence}")
