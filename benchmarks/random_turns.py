"""More of `random_arms`: boxes of poses that turn, and stationary constraints, from a random stream of their own.

The referee's stationary constraint is N^T grad U with the unit null vector N by the signed minors of J, and of the
manipulability the derivative of J along N by the velocities of the joints' axes; complex steps do the rest.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from benchmarks.random_arms import Arm, Array, Law, Motion, Problem, random_arm, random_law, random_motion

STATIONARY = 0.7
"""Share of the problems with one redundant joint whose constraint is stationary."""


def _columns(arm: Arm, T: Array) -> tuple[Array, Array, Array]:
    """(J (k, 6, n), axes (k, n, 3), origins (k, n, 3)) of frames T (k, n + 1, 4, 4)."""
    axes, origins = T[:, :-1, :3, 2], T[:, :-1, :3, 3]
    slides = arm.slides[:, None]
    linear = np.where(slides, axes, np.cross(axes, T[:, -1:, :3, 3] - origins))
    return np.concatenate([linear, np.where(slides, 0 * axes, axes)], axis=2).swapaxes(1, 2), axes, origins


def _null(J: Array) -> Array:
    """Signed minors (k, n) of J (k, n - 1, n) over their length: det [J; N] > 0."""
    n = J.shape[2]
    columns = [(-1) ** (n - 1 + i) * np.linalg.det(np.delete(J, i, axis=2)) for i in range(n)]
    found = np.stack(columns, axis=1)
    return found / np.sqrt((found * found).sum(axis=1, keepdims=True))


def _change(arm: Arm, T: Array, rate: Array) -> Array:
    """dJ/dt (k, 6, n) where the joints move at rates (k, n)."""
    J, axes, origins = _columns(arm, T)
    k, n = rate.shape
    v, w, found = np.zeros((k, 3), rate.dtype), np.zeros((k, 3), rate.dtype), []
    v_tool = np.einsum("kin,kn->ki", J[:, :3], rate)
    for i in range(n):
        v = v + (np.cross(w, origins[:, i] - origins[:, i - 1]) if i else 0)  # of this joint's origin
        turn, away = np.cross(w, axes[:, i]), T[:, -1, :3, 3] - origins[:, i]
        if arm.slides[i]:
            found.append(np.concatenate([turn, 0 * turn], axis=1))
            v = v + rate[:, i : i + 1] * axes[:, i]
        else:
            found.append(np.concatenate([np.cross(turn, away) + np.cross(axes[:, i], v_tool - v), turn], axis=1))
            w = w + rate[:, i : i + 1] * axes[:, i]
    return np.stack(found, axis=2)


def stationary_law(arm: Arm, rng: np.random.Generator) -> Law:
    """Of the manipulability or of a preferred posture."""
    held = list(arm.held)
    if rng.random() < 0.5:
        preferred, k = rng.normal(size=arm.n), rng.uniform(0.5, 2, arm.n)

        def of_posture(q: Array, T: Array) -> Array:
            value = (_null(_columns(arm, T)[0][:, held]) * k * (q - preferred)).sum(axis=1)
            return np.stack([value, np.ones_like(value)], axis=-1)[:, None]

        cost = hk.strategies.constraints.posture_cost(preferred, k)
        return "stationary posture", hk.stationary(cost), of_posture, np.zeros(1, dtype=bool)

    def of_volume(_q: Array, T: Array) -> Array:
        J = _columns(arm, T)[0][:, held]
        change = _change(arm, T, _null(J))[:, held]
        value = -np.trace(np.linalg.solve(J @ J.swapaxes(1, 2), change @ J.swapaxes(1, 2)), axis1=1, axis2=2)
        return np.stack([value, np.ones_like(value)], axis=-1)[:, None]

    cost = hk.strategies.constraints.manipulability_cost()
    return "stationary manipulability", hk.stationary(cost), of_volume, np.zeros(1, dtype=bool)


def turned_problem(rng: np.random.Generator) -> Problem:
    """An arm that holds its orientation, or has one redundant joint, with a constraint."""
    while True:
        arm = random_arm(rng)
        single = arm.n == len(arm.held) + 1
        if not (arm.turned or single) or arm.robot.planar != arm.planar:
            continue
        law = stationary_law(arm, rng) if single and rng.random() < STATIONARY else random_law(arm, rng)
        if law is not None:
            return Problem(arm, law)


def turned_motion(kind: str, problem: Problem, q: Array, rng: np.random.Generator) -> Motion:
    """As `random_motion`; a box of 0.3 to 5 mm turns by 0.3 to 5 mrad where the orientation is held."""
    arm = problem.arm
    if kind != "box" or not arm.turned:
        return random_motion(kind, problem, q, rng)
    frame = arm.frames(q[None])[0, -1]
    x, R0 = frame[:3, 3], frame[:3, :3]
    half = 10.0 ** rng.uniform(-3.5, -2.3) * np.array([1.0, 1.0, 0.0 if arm.planar else 1.0])
    tilt, spin = (0.0 if arm.planar else 10.0 ** rng.uniform(-3.5, -2.3)), 10.0 ** rng.uniform(-3.5, -2.3)
    turn = 2 * np.array([np.tan(tilt / 2) / np.cos(spin / 2)] * 2 + [np.tan(spin / 2)])  # Cayley's parameters

    def in_box(_piece: Array, u: Array) -> tuple[Array, Array]:
        w = np.column_stack([u[:, 3:] * turn / 2, np.ones(len(u))])
        return x + u[:, :3] * half, R0 @ Rotation.from_quat(w).as_matrix()

    return Motion(kind, hk.workspace(box=(x, half), rotation=R0, tilt=tilt, spin=spin), in_box)
