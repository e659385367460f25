"""The paper's general form (7) on its planar arm: N_G of (20), H, its determinant, and G of (22)."""

import casadi as ca
import numpy as np

import holokin as hk

task = hk.position(hk.load("ppr"))
G = hk.null_basis(task, lambda q: [[ca.cos(q[2]) ** 2, 0], [0, 1], [-ca.sin(q[2]), 0]])
q = np.array([0.4, -0.2, 0.9])
print("det H =", round(np.linalg.det(G.H(q)), 12))
W, J = G.inverse_weight(q), task.jacobian(q)
print("(7) and N_G (J N_G)^-1 differ by", np.abs(W @ J.T @ np.linalg.inv(J @ W @ J.T) - G(q)).max())
print(hk.involutivity(G, hk.around(q, 0.5)))
