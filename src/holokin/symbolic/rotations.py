"""Rotations in expressions: right in value and derivative at the identity and near a half turn.

Where a formula is 0/0 the branch not taken is fed a harmless argument, so that no NaN reaches a
derivative. Rotation vectors are axis times angle [rad]; quaternions are (w, x, y, z). [SLA21]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Literal, TypeVar

import casadi as ca
import numpy as np

from ..base.types import Array, Matrix, Vector

Angles = TypeVar("Angles", ca.SX, Array)

_SMALL = 1e-4
"""Squared angle below which series are used; their first dropped term is then below 1e-17."""

_one_formula = ContextVar("one_formula", default=False)


@contextmanager
def one_formula() -> Iterator[None]:
    """Within it `log_so3` and `log_s2` are written down without a switch between formulas: for proofs.

    They are the same functions, to 1e-16 as far as 2 rad and to 1e-15 as far as 3 rad, and smooth but at half a turn,
    beside which the formulas with switches keep more digits.
    """
    token = _one_formula.set(True)
    try:
        yield
    finally:
        _one_formula.reset(token)


def skew(w: ca.SX) -> ca.SX:
    """[w]x with [w]x v = w x v; (3,) -> (3, 3)."""
    return ca.skew(w)


def exact_rotation(axis: Literal["x", "y", "z"], angle: float) -> Matrix:
    """The numeric rotation about "x", "y" or "z" by an angle [rad]; right angles give exact 0 and 1."""
    c, s = _snapped(np.cos(angle)), _snapped(np.sin(angle))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def _snapped(value: float) -> float:
    nearest = float(np.round(value))
    return nearest if abs(value - nearest) < 1e-15 else float(value)


def rotation_from_rpy(rpy: Sequence[float]) -> Matrix:
    """R = Rz(yaw) Ry(pitch) Rx(roll), the URDF convention; (3,) -> (3, 3)."""
    roll, pitch, yaw = rpy
    return exact_rotation("z", yaw) @ exact_rotation("y", pitch) @ exact_rotation("x", roll)


def rotation_about(axis: np.ndarray, angle: ca.SX) -> ca.SX:
    """R = c I + s [a]x + (1 - c) a a^T for a constant unit axis a (3,) and an angle [rad] -> (3, 3)."""
    c, s = ca.cos(angle), ca.sin(angle)
    K = ca.SX(ca.skew(ca.DM(axis)))
    R = ca.densify(c * ca.SX.eye(3) + s * K + (1 - c) * ca.SX(np.outer(axis, axis)))
    for i in range(3):
        if abs(axis[i]) == 1.0:
            R[i, i] = 1  # c + (1 - c), which the expression graph does not simplify
    return R


def quaternion_wxyz(R: ca.SX) -> ca.SX:
    """Unit quaternion (4,) of a rotation, w >= 0: of Shepperd's four forms the best conditioned one."""
    r = [[R[i, j] for j in range(3)] for i in range(3)]
    trace = r[0][0] + r[1][1] + r[2][2]
    a, b, c = r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]
    d, e, f = r[1][0] + r[0][1], r[0][2] + r[2][0], r[2][1] + r[1][2]
    squares = [1 + trace, *(1 + 2 * r[i][i] - trace for i in range(3))]
    rows = [[squares[0], a, b, c], [a, squares[1], d, e], [b, d, squares[2], f], [c, e, f, squares[3]]]
    best, largest = ca.SX(4, 1), ca.SX(-1)
    for i, row in enumerate(rows):  # the rows of 4 q q^T: the one chosen has a diagonal of at least 1
        candidate = ca.vertcat(*row) / (2 * ca.sqrt(ca.fmax(squares[i], 0.5)))
        best = ca.if_else(squares[i] > largest, candidate, best)
        largest = ca.fmax(squares[i], largest)
    return best * ca.copysign(1, best[0])


def log_so3(R: ca.SX) -> ca.SX:
    """Rotation vector (3,) of a rotation, angle in [0, pi]; the inverse of exp.

    Through the quaternion: 2 atan2(|v|, w) v / |v|, smooth at a half turn, where the sign of the axis is
    chosen by w >= 0, and a series in |v|^2 at the identity.
    """
    if _one_formula.get():
        w = ca.sqrt(1 + R[0, 0] + R[1, 1] + R[2, 2]) / 2
        v = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / (4 * w)
        return 2 * v * _angle_over_sine(ca.dot(v, v), w)
    quaternion = quaternion_wxyz(R)
    w, v = quaternion[0], quaternion[1:]
    v2 = ca.dot(v, v)
    small = v2 < _SMALL
    norm = ca.sqrt(ca.if_else(small, 1, v2))
    safe_w = ca.if_else(small, w, 1)
    z = v2 / (safe_w * safe_w)
    series = 2 / safe_w * (1 - z / 3 * (1 - z * 3 / 5 * (1 - z * 5 / 7 * (1 - z * 7 / 9))))
    return v * ca.if_else(small, series, 2 * ca.atan2(norm, w) / norm)


def exp_so3(w: ca.SX) -> ca.SX:
    """The rotation (3, 3) of a rotation vector (3,): 1 + sin t / t [w]x + (1 - cos t) / t^2 [w]x^2. Of values alone."""
    t, K = ca.fmax(ca.norm_2(w), _SMALLEST), skew(w)
    half = ca.sin(t / 2) / t  # 1 - cos t = 2 sin^2(t / 2), without cancellation
    return ca.SX.eye(3) + ca.sin(t) / t * K + 2 * half * half * (K @ K)


def shortest_turn(a: ca.SX, b: ca.SX) -> ca.SX:
    """The rotation (3, 3) by the smallest angle that takes the direction of a (3,) to that of b (3,).

    cos 1 + [v]x + k v v^T with v = a x b, k = (1 - cos) / |v|^2; of opposite directions some half turn, the same for
    the same a. Of values alone.
    """
    a, b = a / ca.norm_2(a), b / ca.norm_2(b)
    c, v = ca.dot(a, b), ca.cross(a, b)
    v = v - ca.dot(v, a) * a  # round-off along a is large beside a small v
    square = ca.dot(v, v)
    aside = ca.cross(a, ca.if_else(ca.fabs(a[0]) < 0.6, ca.SX([1, 0, 0]), ca.SX([0, 1, 0])))
    half = 2 * aside @ aside.T / ca.dot(aside, aside) - ca.SX.eye(3)
    k = ca.if_else(c > 0, 1 / (1 + ca.fmax(c, 0)), (1 - c) / ca.fmax(square, _SMALLEST**2))
    turn = c * ca.SX.eye(3) + skew(v) + k * (v @ v.T)
    return ca.if_else(ca.logic_and(c < 0, square < _SMALLEST**2), half, turn)


_SMALLEST = 1e-12
"""Angle [rad], or what it has left to half a turn, that counts as none."""


def log_s2(d: ca.SX) -> ca.SX:
    """(ax, ay) of a direction d (3,): the turn about a line across z, of at most pi, that takes z to d.

    theta (-d_y, d_x) / sin theta with cos theta = d_z, and a series in sin^2 theta near z; singular at -z.
    """
    across = d[0] * d[0] + d[1] * d[1]
    if _one_formula.get():
        return ca.vertcat(-d[1], d[0]) * _angle_over_sine(across, d[2])
    small = ca.logic_and(across < _SMALL, d[2] > 0)
    sine = ca.sqrt(ca.if_else(small, 1, across))
    series = 1 + across * (1 / 6 + across * (3 / 40 + across * (15 / 336 + across * (105 / 3456))))
    return ca.vertcat(-d[1], d[0]) * ca.if_else(small, series, ca.atan2(sine, d[2]) / sine)


def _angle_over_sine(square: ca.SX, c: ca.SX) -> ca.SX:
    """atan2(s, c) / s as a smooth function of s^2 >= 0 and of c, across s = 0; singular at s = 0 > c.

    It is 2 A(t^2) / (|(s, c)| + c), t = tan of half the angle, A(z) = atan(sqrt z) / sqrt z = sum (-z)^k / (2k + 1).
    A(z) = 2 A(y) / (1 + r), y = z / (1 + r)^2, r = sqrt(1 + z), halves the angle: thrice, so that z < 0.04 up to half a
    turn, and what the series leaves out is below 1e-18.
    """
    reach = ca.sqrt(square + c * c) + c
    z, factor = square / (reach * reach), 2 / reach
    for _ in range(_HALVINGS):
        over = 1 + ca.sqrt(1 + z)
        z, factor = z / (over * over), 2 * factor / over
    series = ca.SX(0)
    for k in reversed(range(_TERMS)):
        series = series * -z + 1 / (2 * k + 1)
    return factor * series


_HALVINGS, _TERMS = 3, 12


def frame_about(axis: Vector) -> Matrix:
    """A right-handed frame (3, 3) whose last column is a unit vector (3,); the identity about z."""
    first = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first), axis], dtype=float).T


def zyz_angles(R: ca.SX) -> ca.SX:
    """(phi, theta, psi) with R = Rz(phi) Ry(theta) Rz(psi), theta in [0, pi]; singular at sin theta = 0."""
    return ca.vertcat(
        ca.atan2(R[1, 2], R[0, 2]), ca.atan2(ca.sqrt(R[0, 2] ** 2 + R[1, 2] ** 2), R[2, 2]), ca.atan2(R[2, 1], -R[2, 0])
    )


def rpy_angles(R: ca.SX) -> ca.SX:
    """(roll, pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll); singular at cos pitch = 0."""
    return ca.vertcat(
        ca.atan2(R[2, 1], R[2, 2]), ca.atan2(-R[2, 0], ca.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)), ca.atan2(R[1, 0], R[0, 0])
    )


def wrapped(angle: Angles) -> Angles:
    """The same angles [rad], numbers or an expression, in (-pi, pi]; the derivative stays 1. Exactly 0 for 0."""
    if isinstance(angle, ca.SX):
        return ca.atan2(ca.sin(angle), ca.cos(angle))
    return np.arctan2(np.sin(angle), np.cos(angle))
