"""Control allocation: the thrusters of a supply vessel follow a wanted force that goes round a loop, and come back.

Two bow tunnel thrusters and two stern azimuth thrusters, as of osv.m of the MSS toolbox by T. I. Fossen, "Handbook of
Marine Craft Hydrodynamics and Motion Control", section 11.2: tau = T(alpha) K u, three forces of six inputs.
"""

import casadi as ca
import numpy as np

import holokin as hk

K = [3.0, 3.0, 4.2, 6.55]  # largest thrusts [100 kN]: bow, bow, stern, stern
AT_X, AT_Y = [37.0, 35.0, -41.5, -41.5], [0.0, 0.0, 7.0, -7.0]  # [m]
MOST, LENGTH = 1.5, 41.5  # largest azimuth angle [rad]; what a yaw moment is divided by [m]

names = ["bow 1", "bow 2", "stern 1", "stern 2", "azimuth 1", "azimuth 2"]
ship = hk.robot.coordinates(
    names,
    lower=[-1, -1, -1, -1, -MOST, -MOST],
    upper=[1, 1, 1, 1, MOST, MOST],
    max_velocity=[0.2, 0.2, 0.1, 0.1, 0.1, 0.1],
    units=["1", "1", "1", "1", "rad", "rad"],
    name="supply vessel",
)


def force(u):
    """Surge, sway, and yaw over 41.5 m, all in 100 kN."""
    thrust = [K[i] * u[i] for i in range(4)]
    angle = [np.pi / 2, np.pi / 2, u[4], u[5]]
    x = [thrust[i] * ca.cos(angle[i]) if i > 1 else 0 for i in range(4)]
    y = [thrust[i] * (ca.sin(angle[i]) if i > 1 else 1) for i in range(4)]
    yaw = [AT_X[i] * y[i] - AT_Y[i] * x[i] for i in range(4)]
    return ca.vertcat(sum(x), sum(y), sum(yaw) / LENGTH)


task = hk.custom_task(ship, force, units=("100 kN",) * 3, names=("surge", "sway", "yaw"), name="force")
u0 = np.array([0.3, 0.3, 0.4, 0.4, 0.5, 0.5])
at = task(u0)
loop = hk.circle(at, center=at - [0, 1.0, 0], normal=[1, 0, -1], speed=0.2)  # the wind turns once
stack = hk.strategies.constraints.stack
together = stack(*(hk.linear(row) for row in ([1, -1, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0], [0, 0, 0, 0, 1, -1])))
laws = {"pseudo-inverse": hk.moore_penrose(task), "pairs alike": hk.holonomic(task, together)}
for name, law in laws.items():
    print(f"{name:14s}: {hk.drift(law, loop, u0, cycles=3)} off after 1, 2 and 3 loops")
ik = hk.ik(laws["pairs alike"], u0)
print(dict(zip(names, ik(at + [0.5, -0.3, 0.2]).round(4), strict=True)))
