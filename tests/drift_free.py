"""Postures of a self-motion at which small loops in the first task plane do not drift. [KK89]"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

import holokin as hk
from holokin.strategies import unit_null


def drift_free(strategy: hk.Strategy, q0: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """(posture, slope of kappa along the self-motion): zeros of kappa = n . F_01, where a counter-clockwise loop drifts
    towards those at which kappa falls (theory 2a)."""
    curve = hk.strategies.self_motion_curve(strategy.task, q0)
    normals = [unit_null(strategy.task, curve.q[0], None)]
    for q in curve.q[1:]:
        normals.append(unit_null(strategy.task, q, normals[-1]))

    def kappa(s: float, near: np.ndarray) -> float:
        q = curve.at(s)
        return float(unit_null(strategy.task, q, near) @ hk.curvature(strategy, q)[:, 0, 1])

    values = [kappa(s, n) for s, n in zip(curve.s, normals, strict=True)]
    found = []
    for k in np.flatnonzero(np.array(values[:-1]) * values[1:] < 0):
        low, high = curve.s[k], curve.s[k + 1]
        s = brentq(kappa, low, high, args=(normals[k],), xtol=1e-13 * (high - low))
        found.append((curve.at(s), (values[k + 1] - values[k]) / (high - low)))
    return found
