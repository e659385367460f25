"""All ways to close a loop of six hinges, up to sixteen, by one eigenvalue problem. [RR90], [MC94]

A loop is R_1 L_1 R_2 L_2 ... R_6 L_6 = 1: R_i turns about z by an angle, the links L_i are given. Its joints, from any
of them on and either way round, are a, b, c, d, e, f.

An axis of direction l through a point p, as X = (1, p, p.p, l, p.l, p x l, (p.p) l - 2 (p.l) p), is moved linearly by a
rigid motion, X -> S(L) X (15 x 15). A turn about z turns four pairs of its numbers and keeps the others. The axis f,
seen from joint c, is the same both ways round the loop (the fourteen equations of Raghavan and Roth):

    R_c S(L_c) R_d S(L_d) R_e S(L_e) X_0 = S(L_b^-1) R_b^-1 S(L_a^-1) R_a^-1 S(L_f^-1) X_0.

1. On the right is Q (14 x 8) times the products of cosines and sines of a and b, and a column. The complement of Q
   leaves six equations in c, d, e. With them times tan(d / 2), twelve are linear in the twelve products v of powers of
   tan(d / 2), up to the third, and of tan(e / 2), up to the second.
2. They are M v + V R_c H v = 0: H v are sixteen numbers in eight pairs, each of which R_c turns. J being a quarter turn
   of all pairs, let H v = (cos(c / 2) - sin(c / 2) J) g, so that R_c H v = (cos(c / 2) + sin(c / 2) J) g. The
   complement of the columns of (M, H) leaves (cos(c / 2) F_0 + sin(c / 2) F_1) g = 0, of size sixteen. The usual form
   has size 24, and eight eigenvalues more, +-i.
3. The eigenvalues are tan(c / 2), seen from the best of some angles, so that none is near infinity; v gives d and e,
   the fourteen equations a and b, the loop f. Where roots have the same c, v is a mixture: see `_separated`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.types import Array, Flags, Indices, Matrix, Vector

Complex = NDArray[np.complexfloating[Any, Any]]
"""Complex numbers, in an array of any shape."""

REAL = 0.1
"""Imaginary part of an angle [rad] up to which a root is told. What it is, real or not, is for its polishing to say."""

ILL = 1e13
"""Condition of a matrix from which nothing that it tells has a digit that counts."""

_CLUSTER = 1e-5
"""Distance [rad] of angles c within which the vectors v are taken for mixed."""

_SPAN = 1e-6
"""How far vectors v of length 1 may be from spanning what tan(d / 2) times them spans; else they are of a curve."""

_SEEN = 0.35 + np.arange(3) * np.pi / 3
"""Half angles of c from one of which it is seen: of no special arm."""

_PAIRS = np.array([0, 4, 8, 11, 1, 5, 9, 12])
"""Rows of X without its 1 that a turn about z turns: the x of p, l, p x l and the last vector, then their y."""

_FIXED = np.array([2, 3, 6, 7, 10, 13])
"""The others."""

_TANGENTS = np.array([[1.0, 0.0, -1.0], [0.0, 2.0, 0.0], [1.0, 0.0, 1.0]])
"""(cos, sin, 1) of an angle in the products (c c, c s, s s) of cosine and sine of its half."""

_PRODUCTS = np.kron(_TANGENTS, _TANGENTS)
"""The same of two angles."""


def _turn(sign: float) -> Matrix:
    """The factors of cos, sin and 1 of a turn of X about z, (45, 15); of one the other way."""
    out = np.zeros((3, 15, 15))
    out[2] = np.eye(15)
    for i in (1, 5, 9, 12):
        out[0, [i, i + 1], [i, i + 1]] = 1.0
        out[1, [i, i + 1], [i + 1, i]] = -sign, sign
        out[2, [i, i + 1], [i, i + 1]] = 0.0
    return out.reshape(45, 15)


_AHEAD, _BACK = _turn(1.0), _turn(-1.0)


class Order(NamedTuple):
    """Which joints of the loop are a to f: from `first` on, and against the loop's order if reversed."""

    first: int
    reversed: bool

    @property
    def joints(self) -> list[int]:
        """The places (6,) of a to f in the loop."""
        step = -1 if self.reversed else 1
        return [(self.first + step * i) % 6 for i in range(6)]

    def links(self, links: Sequence[Array]) -> list[Array]:
        """The links behind a to f, of those (6) of the loop."""
        if not self.reversed:
            return [links[i] for i in self.joints]
        return [inverse_poses(links[i - 1]) for i in self.joints]


ORDERS = tuple(Order(first, back) for back in (False, True) for first in range(6))
"""All of them."""


class LoopRoots(NamedTuple):
    """Angles (K, 6) that close k loops, the loop (K,) of each, in increasing order, and its imaginary part (K,) [rad].

    ill (k,): of these loops nothing is said: the equations are singular.
    """

    angles: Matrix
    row: Indices
    imaginary: Vector
    ill: Flags


def loop_roots(links: Sequence[Array], order: Order) -> LoopRoots:
    """The roots whose angles are nearly real, of loops with links (6), each (k, 4, 4), not yet polished."""
    with np.errstate(all="ignore"):
        loop = np.array(order.links(links))
        loop[:, :, :3, 3] /= np.linalg.norm(loop[:, :, :3, 3], axis=2).max(axis=0)[:, None]
        equations = _equations(loop)
        every, G, ill = _eigenvalues(equations.F)
        row, c, d, e, imaginary, lost = _three_angles(equations, every, G)
        a, b, more = _two_angles(equations, row, c, d, e)
    T = loop[5][row] @ turn_z(a)
    for angle, link in zip((b, c, d, e), loop, strict=False):
        T = T @ link[row] @ turn_z(angle)
    T = T @ loop[4][row]
    f = np.arctan2(T[:, 0, 1] - T[:, 1, 0], T[:, 0, 0] + T[:, 1, 1])
    angles = np.empty((len(row), 6))
    angles[:, order.joints] = np.stack([a, b, c, d, e, f], axis=1) * (-1 if order.reversed else 1)
    return LoopRoots(angles, row, imaginary, ill | lost | more)


class _Equations(NamedTuple):
    """Y (k, 14, 9) times (cos, sin, 1) of d and e, turned by c, is Z (k, 14, 9) times those of b and a.

    Q_ab (k, 14, 8), R_ab (k, 8, 8): of Z without its column of 1. F, two of (k, 28, 16): (cos(c / 2) F_0 + sin(c / 2)
    F_1) g is -R_v v in its first twelve rows, R_v (k, 12, 12), and 0 in the others.
    """

    Y: Array
    Z: Array
    Q_ab: Array
    R_ab: Array
    F: tuple[Array, Array]
    R_v: Array


def _equations(loop: Array) -> _Equations:
    """Those of links a to f, (6, k, 4, 4)."""
    k = loop.shape[1]
    back = inverse_poses(loop[[0, 1, 5]])
    of_c, of_d, of_a, of_b = _moving(np.stack([loop[2], loop[3], back[0], back[1]]))
    start = _axes(np.stack([loop[4], back[2]]))
    Y = (of_c @ _turned(_AHEAD, of_d @ _turned(_AHEAD, start[0])))[:, 1:]
    Z = (of_b @ _turned(_BACK, of_a @ _turned(_BACK, start[1])))[:, 1:]
    # Six equations without a and b, of which the means are not turned by c and the pairs are.
    Q_ab, R_ab = np.linalg.qr(Z[:, :, :8], mode="complete")
    left = Q_ab[:, :, 8:].transpose(0, 2, 1)
    in_v = Y @ _PRODUCTS
    mean = left[:, :, _FIXED] @ in_v[:, _FIXED] - (left @ Z[:, :, 8:]) * _PRODUCTS[8]
    # Twelve in v; sixteen in g.
    twelve, V = np.zeros((k, 28, 12)), np.zeros((k, 12, 16))
    for i in range(2):
        twelve[:, 6 * i : 6 * i + 6, 3 * i : 3 * i + 9] = mean
        twelve[:, 12 + 8 * i : 20 + 8 * i, 3 * i : 3 * i + 9] = in_v[:, _PAIRS]
        V[:, 6 * i : 6 * i + 6, 8 * i : 8 * i + 8] = left[:, :, _PAIRS]
    Q_v, R_v = np.linalg.qr(twelve, mode="complete")
    across = Q_v.transpose(0, 2, 1)
    top, below = across[:, :, :12] @ V, across[:, :, 12:]
    return _Equations(Y, Z, Q_ab[:, :, :8], R_ab[:, :8], (top - below, _quarter(top + below)), R_v[:, :12])


def _eigenvalues(F: tuple[Array, Array]) -> tuple[Complex, Complex, Flags]:
    """(c (k, 16), g (k, 16, 16) in columns, ill (k,)), of the equations F."""
    # c is seen from the angle at which the determinant is largest: it is the product of the distances from all roots.
    k, F_0, F_1 = len(F[0]), F[0][:, 12:], F[1][:, 12:]
    cos, sin = np.cos(_SEEN)[:, None, None, None], np.sin(_SEEN)[:, None, None, None]
    ahead = cos * F_1 - sin * F_0
    size = np.linalg.slogdet(ahead)[1]
    best = np.argmax(size, axis=0)
    ahead, level = ahead[best, np.arange(k)], cos[best, 0] * F_0 + sin[best, 0] * F_1
    ill = ~np.isfinite(size.max(axis=0))
    ahead[ill] = np.eye(16)
    inverse = np.linalg.inv(ahead)
    system = -inverse @ level
    ill |= ~np.isfinite(system).all(axis=(1, 2))
    system[ill] = 0.0
    pairs: Any = np.linalg.eig(system)
    tangent, G = pairs.eigenvalues.astype(complex), pairs.eigenvectors.astype(complex)
    ill |= np.linalg.norm(ahead, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2)) > ILL
    return 2 * (np.arctan(tangent) + _SEEN[best][:, None]), G, ill


def _three_angles(
    equations: _Equations, every: Complex, G: Complex
) -> tuple[Indices, Vector, Vector, Vector, Vector, Flags]:
    """(row (K,), c, d, e, imaginary part (K,), ill (k,)) of the roots that are nearly real."""
    R_v, ill = _sound(equations.R_v)
    F_0, F_1 = (F[:, :12] for F in equations.F)
    half = every[:, None] / 2
    solved = np.linalg.solve(R_v, np.cos(half) * (F_0 @ G) + np.sin(half) * (F_1 @ G))
    size = np.abs(solved).max(axis=1)
    row, column = np.nonzero((np.abs(every.imag) < REAL) & np.isfinite(size) & (size > 0))
    c, v = _separated(every[row, column], solved[row, :, column], row)
    d, e = _angle_of(v[:, :3], v[:, 1:]), _angle_of(v[:, :, :2], v[:, :, 1:])
    angles: Any = np.array([c, d, e])
    imaginary = np.abs(angles.imag).max(axis=0)
    near = np.flatnonzero(imaginary < REAL)
    return row[near], *angles.real[:, near], imaginary[near], ill


def _two_angles(equations: _Equations, row: Indices, c: Vector, d: Vector, e: Vector) -> tuple[Vector, Vector, Flags]:
    """(a (K,), b (K,), ill (k,)) of the roots, from the fourteen equations."""
    R_ab, ill = _sound(equations.R_ab)
    of_d, of_e = (np.stack([np.cos(q), np.sin(q), np.ones_like(q)], axis=1) for q in (d, e))
    y = (equations.Y[row] @ (of_d[:, :, None] * of_e[:, None]).reshape(-1, 9, 1))[:, :, 0]
    x_part, y_part, cos, sin = y[:, _PAIRS[:4]], y[:, _PAIRS[4:]], np.cos(c)[:, None], np.sin(c)[:, None]
    y[:, _PAIRS] = np.concatenate([cos * x_part - sin * y_part, sin * x_part + cos * y_part], axis=1)
    solver = np.linalg.solve(R_ab, equations.Q_ab.transpose(0, 2, 1))
    of_ab = (solver[row] @ (y - equations.Z[row, :, 8])[:, :, None])[:, :, 0]
    return np.arctan2(of_ab[:, 7], of_ab[:, 6]), np.arctan2(of_ab[:, 5], of_ab[:, 2]), ill


def _separated(c: Complex, v: Complex, row: Indices) -> tuple[Complex, Complex]:
    """(c (K,), v (K, 4, 3)) with the vectors (K, 12) of roots of the same c, which are mixed, told apart.

    They span what tan(d / 2) times them spans, and tan(e / 2) too: these are matrices X, Y of a size of their number,
    with high = low X for the rows of higher powers and of lower ones, whose common eigenvectors are the v of each root.
    Where they do not span it, there is a curve of roots, and mixed vectors are points near it like any other.
    """
    out = v.reshape(-1, 4, 3).copy()
    order = np.lexsort((c.real, row))
    breaks = (np.diff(row[order]) > 0) | (np.diff(c.real[order]) > _CLUSTER)
    first = np.concatenate([[0], np.flatnonzero(breaks) + 1, [len(row)]])
    sizes = np.diff(first)
    for m in set(sizes.tolist()) - {0, 1}:
        members = order[first[:-1][sizes == m][:, None] + np.arange(m)]
        some = v[members] / np.linalg.norm(v[members], axis=2)[:, :, None]
        each = some.reshape(-1, m, 4, 3)
        both, curve = np.zeros((len(each), m, m), dtype=complex), np.zeros(len(each), dtype=bool)
        for weight, low, high in ((1.0, each[:, :, :3], each[:, :, 1:]), (0.6, each[..., :2], each[..., 1:])):
            low, high = (x.reshape(len(each), m, -1).transpose(0, 2, 1) for x in _seen_aside(low, high))
            X = np.linalg.pinv(low) @ high
            both += weight * X
            curve |= np.linalg.norm(high - low @ X, axis=(1, 2)) > _SPAN
        y = np.linalg.eig(both)[1]
        y[curve] = np.eye(m)
        out[members] = (y.transpose(0, 2, 1) @ some).reshape(-1, m, 4, 3)
        out[members[curve]] = out[members[curve]].real
        share = np.abs(y) ** 2
        c[members] = (c[members][:, :, None] * share).sum(axis=1) / share.sum(axis=1)
    return c, out


def _seen_aside(low: Complex, high: Complex) -> tuple[Complex, Complex]:
    """Those whose quotient is the tangent of the half angle, less `_SEEN[0]`."""
    c, s = np.cos(_SEEN[0]), np.sin(_SEEN[0])
    return c * low + s * high, c * high - s * low


def _angle_of(low: Complex, high: Complex) -> Complex:
    """The angle (K,) whose half has the tangent x, high = x low, arrays (K, ., .)."""
    low, high = _seen_aside(low, high)
    x = (low.conj() * high).sum(axis=(1, 2)) / (low.conj() * low).sum(axis=(1, 2))
    return 2 * (np.arctan(x) + _SEEN[0])


def _sound(R: Array) -> tuple[Array, Flags]:
    """Triangular matrices (k, m, m) that can be divided by, and which (k,) were singular but for round-off."""
    R, some = R.copy(), np.arange(R.shape[1])
    diagonal = np.abs(R[:, some, some])
    least = np.maximum(diagonal.max(axis=1, keepdims=True), 1) / ILL
    R[:, some, some] = np.where(diagonal < least, least, R[:, some, some])
    return R, (diagonal < least).any(axis=1)


def _quarter(F: Array) -> Array:
    """F J, of columns (..., 16): twice the x of four pairs, then their y."""
    G = F.reshape(*F.shape[:-1], 2, 2, 4)
    return np.stack([G[..., 1, :], -G[..., 0, :]], axis=-2).reshape(F.shape)


def _turned(turn: Matrix, X: Array) -> Array:
    """Columns X (k, 15, m) times (cos, sin, 1) of an angle: (k, 15, 3 m)."""
    k, _, m = X.shape
    return (turn @ X).reshape(k, 3, 15, m).transpose(0, 2, 1, 3).reshape(k, 15, 3 * m)


def _moving(T: Array) -> Array:
    """S(L) (..., 15, 15) of poses (..., 4, 4)."""
    R, t = T[..., :3, :3], T[..., :3, 3]
    out = np.zeros((*T.shape[:-2], 15, 15))
    tR, square, cross = (t[..., None, :] @ R)[..., 0, :], (t * t).sum(axis=-1), _skew(t) @ R
    out[..., 0, 0] = out[..., 4, 4] = out[..., 8, 8] = 1.0
    for i in (1, 5, 9, 12):
        out[..., i : i + 3, i : i + 3] = R
    out[..., 1:4, 0], out[..., 4, 0], out[..., 4, 1:4] = t, square, 2 * tR
    out[..., 8, 5:8], out[..., 9:12, 5:8] = tR, cross
    out[..., 12:, 9:12], out[..., 12:, 8] = -2 * cross, -2 * t
    out[..., 12:, 5:8] = square[..., None, None] * R - 2 * t[..., :, None] * tR[..., None, :]
    return out


def _axes(T: Array) -> Array:
    """X (..., 15, 1) of the z axes of poses (..., 4, 4)."""
    p, h = T[..., :3, 3], T[..., :3, 2]
    square, along = (p * p).sum(axis=-1)[..., None], (p * h).sum(axis=-1)[..., None]
    every = [np.ones_like(square), p, square, h, along, np.cross(p, h), square * h - 2 * along * p]
    return np.concatenate(every, axis=-1)[..., None]


def _skew(v: Array) -> Array:
    """[v]x of vectors (..., 3)."""
    out = np.zeros((*v.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return out - np.swapaxes(out, -1, -2)


def turn_z(angle: Array) -> Array:
    """Poses (..., 4, 4) without position that turn about z."""
    out = np.zeros((*angle.shape, 4, 4))
    out[..., 0, 0] = out[..., 1, 1] = np.cos(angle)
    out[..., 1, 0] = np.sin(angle)
    out[..., 0, 1] = -out[..., 1, 0]
    out[..., 2, 2] = out[..., 3, 3] = 1.0
    return out


def inverse_poses(T: Array) -> Array:
    """Those of poses (..., 4, 4)."""
    out = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = R
    out[..., :3, 3] = -(R @ T[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out
