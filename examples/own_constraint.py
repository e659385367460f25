"""A constraint of your own, as a CasADi expression: an elbow that opens as the arm turns; checked, then followed.

Two paths to one tool pose end with the same joints, to the last digits.
"""

import casadi as ca

import holokin as hk

robot = hk.load("iiwa14")
q0 = [0.1, 0.6, 0.0, -1.4, 0.0, 0.6, 0.0]
g = hk.custom(lambda q: q[0] - q[2] + 0.2 * ca.sin(q[3]), rows=1)
G = hk.holonomic(hk.pose(robot), g)
print(hk.involutivity(G, hk.around(q0, 0.2)))

start = robot.pose(q0)[:3, 3]
one, other = hk.polyline([start, start + [0, 0.1, 0], start + [0, 0.1, 0.1], start + [0, 0, 0.1]], closed=True).halves()
spread = hk.motion.path_spread(G, one, other, q0)
print(f"two paths, largest joint difference: {spread.largest:.1e} rad")
spread.a.save("iiwa-one-way.csv")
