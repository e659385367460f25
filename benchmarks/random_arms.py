"""Random arms, constraints and motions, each written down twice: for holokin, and in NumPy, as a referee of its proofs.

The referee knows the rows of Denavit and Hartenberg, the numbers of the constraint and those of the motion, nothing of
holokin: forward kinematics is a product of matrices, derivatives are complex steps, roots are Newton's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk

Array = np.ndarray
Law = tuple[str, hk.Constraint, Callable[[Array, Array], Array], Array]
"""Name, constraint, (q (k, n), frames (k, n + 1, 4, 4)) -> its values, and which of them are angles: sine, cosine."""

STEP = 1e-30
"""Of a complex step: no difference is taken."""


@dataclass(frozen=True, eq=False)
class Arm:
    """Rows (n, 4) of a, alpha, d, theta; which joints slide (n,); limits; the tool of it that is held: rows of six."""

    rows: Array
    slides: Array
    lower: Array
    upper: Array
    held: tuple[int, ...]

    @property
    def n(self) -> int:
        """Joints."""
        return len(self.rows)

    @property
    def turned(self) -> bool:
        """Whether the orientation is held."""
        return max(self.held) > 2

    @property
    def planar(self) -> bool:
        """Whether the tool stays in a plane."""
        return 2 not in self.held

    @cached_property
    def robot(self) -> hk.Robot:
        """For holokin."""
        rows = [
            {
                "a": a,
                "alpha": alpha,
                "d": d,
                "theta": theta,
                "lower": low,
                "upper": high,
                "kind": "prismatic" if slides else "revolute",
            }
            for (a, alpha, d, theta), slides, low, high in zip(
                self.rows.tolist(), self.slides, self.lower.tolist(), self.upper.tolist(), strict=True
            )
        ]
        return hk.from_dh(rows, name="random")

    @property
    def task(self) -> hk.Task:
        """For holokin."""
        return hk.pose(self.robot) if self.turned else hk.position(self.robot)

    def frames(self, q: Array) -> Array:
        """T_0 to T_n (k, n + 1, 4, 4) at q (k, n), which may be complex."""
        a, alpha, d, theta = self.rows.T
        turn, shift = np.where(self.slides, theta, theta + q), np.where(self.slides, d + q, d + 0 * q)
        c, s, ca_, sa = np.cos(turn), np.sin(turn), np.cos(alpha), np.sin(alpha)
        zero = 0 * turn
        each = np.array(
            [
                [c, -s * ca_, s * sa, a * c],
                [s, c * ca_, -c * sa, a * s],
                [zero, zero + sa, zero + ca_, shift],
                [zero, zero, zero, zero + 1],
            ]
        ).transpose(2, 3, 0, 1)
        found = [np.broadcast_to(np.eye(4, dtype=q.dtype), (len(q), 4, 4))]
        for i in range(self.n):
            found.append(found[-1] @ each[:, i])
        return np.stack(found, axis=1)


@dataclass(frozen=True, eq=False)
class Problem:
    """An arm with a constraint; E of it and its roots, in NumPy."""

    arm: Arm
    law: Law

    @cached_property
    def strategy(self) -> hk.strategies.HolonomicStrategy:
        """For holokin."""
        return hk.holonomic(self.arm.task, self.law[1])

    def level(self, q: Array) -> Array:
        """c (r,) of the leaf through q (n,)."""
        values = self.law[2](q[None], self.arm.frames(q[None]))[0]
        return np.where(self.law[3], np.arctan2(values[..., 0].real, values[..., 1].real), values[..., 0].real)

    def residual(self, q: Array, p: Array, R: Array, c: Array) -> Array:
        """E (k, n): the tool's position less p (k, 3), half the skew part of R_d^T R, the constraint less c (r,).

        Of an angle psi, given by something times its sine and cosine, sin(psi - c).
        """
        T = self.arm.frames(q)
        tool = T[:, -1]
        six = [tool[:, :3, 3] - p, 0.5 * np.cross(R, tool[:, :3, :3], axisa=1, axisb=1, axisc=1).sum(axis=2)]
        values = self.law[2](q, T)
        y, x = values[..., 0], values[..., 1]
        angles = (y * np.cos(c) - x * np.sin(c)) / np.sqrt(y * y + x * x)
        return np.hstack([np.hstack(six)[:, list(self.arm.held)], np.where(self.law[3], angles, y - c)])

    def slopes(self, q: Array, p: Array, R: Array, c: Array) -> tuple[Array, Array]:
        """(E (k, n), D_q E (k, n, n))."""
        k, n = q.shape
        moved = (q[:, None] + 1j * STEP * np.eye(n)).reshape(-1, n)
        found = self.residual(moved, np.repeat(p, n, axis=0), np.repeat(R, n, axis=0), c).reshape(k, n, n)
        return found[:, 0].real, np.swapaxes(found.imag / STEP, 1, 2)

    def roots(self, q: Array, p: Array, R: Array, c: Array, most: int = 12) -> tuple[Array, Array, Array]:
        """(Newton's limits from q (k, n), det D_q E there (k,), where it converged (k,))."""
        q, size = q.copy(), np.full(len(q), np.inf)
        for _ in range(most):
            E, A = self.slopes(q, p, R, c)
            good = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(E).all(axis=1)
            good[good] = np.linalg.cond(A[good]) < 1e13
            A = np.where(good[:, None, None], A, np.eye(q.shape[1]))
            step = np.where(good[:, None], np.linalg.solve(A, E[:, :, None])[:, :, 0], np.nan)
            q = q - np.nan_to_num(step)
            size = np.linalg.norm(step, axis=1)
            if (~(size > 1e-13 * (1 + np.linalg.norm(q, axis=1)))).all():
                break
        return q, np.linalg.det(A), size < 1e-11 * (1 + np.linalg.norm(q, axis=1))


@dataclass(frozen=True, eq=False)
class Motion:
    """A path or a box for holokin; its poses in NumPy: (piece (k,), parameters (k, d)) -> p (k, 3), R (k, 3, 3)."""

    kind: str
    where: Any
    poses: Callable[[Array, Array], tuple[Array, Array]]


def random_arm(rng: np.random.Generator) -> Arm:
    """3 to 8 joints, planar or spatial; one in ten shoulder, elbow and wrist; some joints slide; half have limits."""
    kind = rng.choice(["planar", "spatial", "spherical"], p=[0.4, 0.5, 0.1])
    n = 7 if kind == "spherical" else int(rng.integers(3, 9))
    rows, slides = np.zeros((n, 4)), np.zeros(n, dtype=bool)
    if kind == "planar":
        rows[:, 0] = rng.uniform(0.2, 1.0, n)
        i = int(rng.integers(0, n - 1))
        if rng.random() < 0.3:  # a hinge turns the axis into the plane, the slider back
            rows[i] = [0.0, np.pi / 2, 0.0, rng.uniform(-1, 1)]
            rows[i + 1] = [0.0, -np.pi / 2, rng.uniform(0.2, 0.6), rng.choice([0.0, np.pi / 2])]
            slides[i + 1] = True
        held = (0, 1, 5) if rng.random() < 0.4 else (0, 1)
    elif kind == "spatial":
        right = np.pi / 2 * rng.choice([-1, 0, 1], n)
        twist = right if rng.random() < 0.7 else rng.uniform(-np.pi, np.pi, n)
        rows = np.column_stack([rng.uniform(0, 0.6, n), twist, rng.uniform(-0.3, 0.5, n), rng.uniform(-1, 1, n)])
        slides = rng.random(n) < (0.15 if rng.random() < 0.4 else 0.0)
        held = tuple(range(6 if n > 5 and rng.random() < 0.6 else 3))
    else:
        aside, lengths = rng.choice([0.0, rng.uniform(0.02, 0.1)]), rng.uniform(0.2, 0.5, 4)
        rows[:, 0] = [0, 0, aside, -aside, 0, 0, 0]
        rows[:, 1] = np.pi / 2 * np.array([-1, 1, 1, -1, -1, 1, 0])
        rows[[0, 2, 4, 6], 2] = lengths
        held = tuple(range(6))
    limited = rng.random() < 0.5
    low = np.where(slides, -rng.uniform(0.2, 1, n), -rng.uniform(1, 3, n)) if limited else np.full(n, -np.inf)
    high = np.where(slides, rng.uniform(0.2, 1, n), rng.uniform(1, 3, n)) if limited else np.full(n, np.inf)
    return Arm(rows, slides, low, high, held)


def _as_values(plain: Array) -> Array:
    """Values that are no angles, beside ones."""
    return np.stack([plain, np.ones_like(plain)], axis=-1)


def _custom(name: str, r: int, rows: Callable[[Any, Any], list[Any]]) -> Law:
    """Expressions of (q, sin), of CasADi and of NumPy."""
    constraint = hk.custom(lambda q: rows(q, ca.sin), rows=r, name=name)
    return name, constraint, lambda q, _T: _as_values(_columns(rows(q.T, np.sin), q)), np.zeros(r, dtype=bool)


def _columns(rows: list[Array], q: Array) -> Array:
    return np.stack(rows, axis=-1) if rows else np.zeros((len(q), 0), dtype=q.dtype)


def _linear(r: int, n: int, rng: np.random.Generator) -> Law:
    A = rng.normal(size=(r, n))
    return "linear", hk.linear(A), lambda q, _T: _as_values(q @ A.T), np.zeros(r, dtype=bool)


def _lock(r: int, n: int, rng: np.random.Generator) -> Law:
    joints = rng.choice(n, r, replace=False)
    return "lock", hk.lock(*joints.tolist()), lambda q, _T: _as_values(q[:, joints]), np.zeros(r, dtype=bool)


def _polynomial(r: int, n: int, rng: np.random.Generator) -> Law:
    A, B = rng.normal(size=(r, n)), 0.3 * rng.normal(size=(r, n, n))

    def rows(q: Any, _sin: Any) -> list[Any]:
        return [
            sum(A[i, j] * q[j] + sum(B[i, j, k] * q[j] * q[k] for k in range(n)) for j in range(n)) for i in range(r)
        ]

    return _custom("polynomial", r, rows)


def _waves(r: int, n: int, rng: np.random.Generator) -> Law:
    A, B, w = rng.normal(size=(r, n)), rng.normal(size=(r, n)), rng.uniform(0.5, 2, (r, n))
    return _custom(
        "waves",
        r,
        lambda q, sin: [sum(A[i, j] * q[j] + B[i, j] * sin(w[i, j] * q[j]) for j in range(n)) for i in range(r)],
    )


def _tilted(_r: int, n: int, rng: np.random.Generator) -> Law:
    joint, gain = int(rng.integers(n)), float(rng.normal())

    def value(q: Array, T: Array) -> Array:
        p = T[:, -1, :3, 3]
        return _as_values(q[:, [joint]] - gain * p[:, :1] * p[:, 1:2])

    return (
        "tilted",
        hk.strategies.constraints.tilted(hk.lock(joint), lambda x: gain * x[0] * x[1]),
        value,
        np.zeros(1, dtype=bool),
    )


def _height(_r: int, arm: Arm, rng: np.random.Generator) -> Law:
    joint = int(rng.choice(np.flatnonzero(~arm.slides)[1:]))

    def value(_q: Array, T: Array) -> Array:
        return _as_values(T[:, joint, 2:3, 3] + arm.rows[joint, 2] * T[:, joint, 2:3, 2])

    return "height", hk.strategies.constraints.height(joint), value, np.zeros(1, dtype=bool)


def _coupled(_r: int, _arm: Arm, rng: np.random.Generator) -> Law:
    """Angles of the tool's rotation and a multiple of its position."""
    kind, gain = str(rng.choice(["zyz", "rpy"])), rng.normal(size=(3, 3))

    def value(_q: Array, T: Array) -> Array:
        R, p = np.moveaxis(T[:, -1, :3, :3], 0, -1), T[:, -1, :3, 3]
        if kind == "zyz":
            pairs = [(R[1, 2], R[0, 2]), (np.sqrt(R[0, 2] ** 2 + R[1, 2] ** 2), R[2, 2]), (R[2, 1], -R[2, 0])]
        else:
            pairs = [(R[2, 1], R[2, 2]), (-R[2, 0], np.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)), (R[1, 0], R[0, 0])]
        y, x = (np.stack(part, axis=-1) for part in zip(*pairs, strict=True))
        c, s = np.cos(p @ gain.T), np.sin(p @ gain.T)
        return np.stack([y * c + x * s, x * c - y * s], axis=-1)

    return f"coupled ({kind})", hk.coupled(gain, kind), value, np.ones(3, dtype=bool)


def _arm_angle(_r: int, _arm: Arm, rng: np.random.Generator) -> Law:
    """Of shoulder, elbow and wrist in the origins of frames 1, 3 and 5; V = z, R = -x."""
    definition = str(rng.choice(["stereographic", "conventional"]))

    def value(_q: Array, T: Array) -> Array:
        E, W = T[:, 3, :3, 3] - T[:, 1, :3, 3], T[:, 5, :3, 3] - T[:, 1, :3, 3]
        w = W / np.sqrt((W * W).sum(axis=1, keepdims=True))
        away = w + [1, 0, 0] if definition == "stereographic" else w
        reference, normal = np.cross(away, [0, 0, 1]), np.cross(W, E)
        return np.stack([(normal * np.cross(w, reference)).sum(axis=1), (normal * reference).sum(axis=1)], axis=-1)[
            :, None
        ]

    return f"arm angle ({definition})", hk.arm_angle(definition=definition), value, np.ones(1, dtype=bool)


def _stacked(one: Law, other: Law) -> Law:
    return (
        f"{one[0]} over {other[0]}",
        hk.strategies.constraints.stack(one[1], other[1]),
        lambda q, T: np.concatenate([one[2](q, T), other[2](q, T)], axis=1),
        np.concatenate([one[3], other[3]]),
    )


def random_law(arm: Arm, rng: np.random.Generator) -> Law | None:
    """A constraint of the rows that are left; None where more are held than there are joints."""
    n, r = arm.n, arm.n - len(arm.held)
    if r < 0:
        return None
    if r == 0:
        return _custom("none", 0, lambda _q, _sin: [])
    spherical = (
        n == 7
        and not arm.planar
        and not arm.slides.any()
        and (arm.rows[:3, 1] == [-np.pi / 2, np.pi / 2, np.pi / 2]).all()
    )
    if spherical and (arm.rows[[1, 3, 5], 2] == 0).all() and rng.random() < 0.7:
        return _arm_angle(r, arm, rng)
    if r == 3 and not arm.turned and not arm.planar and rng.random() < 0.5:
        return _coupled(r, arm, rng)
    if r == 1 and rng.random() < 0.3:
        return _tilted(r, n, rng) if arm.planar or rng.random() < 0.5 else _height(r, arm, rng)
    makers = [_linear, _lock, _polynomial, _waves]
    if r > 1 and rng.random() < 0.25:
        first = int(rng.integers(1, r))
        one, other = rng.choice(4, 2)
        return _stacked(makers[one](first, n, rng), makers[other](r - first, n, rng))
    return makers[int(rng.integers(4))](r, n, rng)


def random_problem(rng: np.random.Generator) -> Problem:
    """An arm with a constraint."""
    while True:
        arm = random_arm(rng)
        law = random_law(arm, rng)
        if law is not None and arm.robot.planar == arm.planar:
            return Problem(arm, law)


def random_posture(problem: Problem, rng: np.random.Generator, near: bool) -> Array:
    """Within limits; `near` a singular one: between two postures at which det [J; J_g] has opposite signs."""
    arm = problem.arm

    def anywhere() -> Array:
        low, high = np.maximum(arm.lower, -2.0), np.minimum(arm.upper, 2.0)
        return np.where(arm.slides, 0.3, 1.0) * rng.uniform(0.95 * low, 0.95 * high)

    def determinant(q: Array) -> float:
        frame = arm.frames(q[None])[:, -1]
        return float(np.linalg.det(problem.slopes(q[None], frame[:, :3, 3], frame[:, :3, :3], problem.level(q))[1])[0])

    q = anywhere()
    if not near:
        return q
    for _ in range(20):
        other = anywhere()
        if determinant(q) * determinant(other) < 0:
            break
    else:
        return q
    a, b, first = 0.0, 1.0, determinant(q)
    for _ in range(20):
        middle = (a + b) / 2
        a, b = (middle, b) if determinant(q + middle * (other - q)) * first > 0 else (a, middle)
    return q + a * (1 - 10 ** rng.uniform(-3, -0.7)) * (other - q)


def random_motion(kind: str, problem: Problem, q: Array, rng: np.random.Generator) -> Motion:
    """A line, a circle, a closed triangle or a box of 5 mm to 0.25 m (a box 0.06 m) at the tool's pose at q."""
    arm = problem.arm
    flat = np.array([1.0, 1.0, 0.0]) if arm.planar else np.ones(3)
    frame = arm.frames(q[None])[0, -1]
    x, R0 = frame[:3, 3], frame[:3, :3]
    size = 10.0 ** rng.uniform(-2.3, -1.2 if kind == "box" else -0.6)
    way = _unit(rng.normal(size=3) * flat) * size
    if kind == "line":
        turn = rng.normal(size=3) * size if arm.turned else np.zeros(3)
        turn = turn * [0, 0, 1] if arm.planar else turn

        def on_line(_piece: Array, u: Array) -> tuple[Array, Array]:
            return x + u * way, Rotation.from_rotvec(u * turn).as_matrix() @ R0

        return Motion(kind, hk.line(x, x + way, turn=turn), on_line)
    if kind == "circle":
        normal = np.array([0.0, 0.0, 1.0]) if arm.planar else _unit(np.cross(way, rng.normal(size=3)))
        center = x + way
        across = np.cross(normal, x - center)

        def on_circle(_piece: Array, u: Array) -> tuple[Array, Array]:
            return center + np.cos(2 * np.pi * u) * (x - center) + np.sin(2 * np.pi * u) * across, _still(R0, u)

        return Motion(kind, hk.circle(x, center, normal), on_circle)
    if kind == "triangle":
        corners = np.array([x, x + way, x + way + _unit(rng.normal(size=3) * flat) * size, x])

        def on_triangle(piece: Array, u: Array) -> tuple[Array, Array]:
            return corners[piece] + u * (corners[piece + 1] - corners[piece]), _still(R0, u)

        return Motion(kind, hk.polyline(corners[:3], closed=True), on_triangle)
    half = flat * size * rng.uniform(0.2, 1.0, 3)

    def in_box(_piece: Array, u: Array) -> tuple[Array, Array]:
        return x + u * half, _still(R0, u)

    return Motion("box", hk.workspace(box=(x, half), rotation=R0), in_box)


def _still(R: Array, u: Array) -> Array:
    return np.broadcast_to(R, (len(u), 3, 3))


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)
