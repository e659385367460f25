"""`GeneralInverse`: all postures, up to sixteen, of six hinges of any kind at a tool pose, by an eigenvalue problem.

The loop R_1 L_1 R_2 L_2 ... R_6 L_6 = 1 is closed by the pose; R_i turns about z by theta_i, and L_6 goes from the last
axis over the tool and the base to the first. The point p of an axis and its direction l, as 15 numbers

    X = (1, p, p.p, l, p.l, p x l, (p.p) l - 2 (p.l) p),

are moved by a rigid motion linearly, X -> S(L) X; a turn about z moves four pairs of them. Raghavan and Roth's fourteen
equations say that X of the last axis, seen from joint c, is the same both ways round:

    R_c S(L_c) R_d S(L_d) R_e S(L_e) X_0 = S(L_b^-1) R_b^-1 S(L_a^-1) R_a^-1 S(L_f^-1) X_0.

The right is Q (14 x 8) times the products of cosines and sines of a and b, and a column. What is orthogonal to Q leaves
six equations in c, d, e; with tan(d / 2) times them, twelve that are linear in the 12 products v of powers of tan(d / 2)
and tan(e / 2):  B v + V R_c H v = 0, where H v (16) are the pairs that R_c turns. With x = tan(c / 2) and H v = (1 - x J)
g, R_c H v = (1 + x J) g, where J is a quarter turn of the pairs. An orthogonal complement of the columns of (B, H) leaves
16 equations in g that are linear in x: sixteen eigenvalues, and none of the eight that are +-i of the usual form. [RR90]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, Value, Vector, frozen
from ..model import Robot
from .arm_classes import Link, NoClass, links_of, no_six_hinges

REAL = 0.1
"""Imaginary part of c [rad] up to which an eigenvalue is polished: what it is, is judged after."""

SURE = 1e-6
"""Imaginary part of c [rad] below which an eigenvalue must come to a posture of its own, or the pose is doubtful."""

SAME = 1e-6
"""Distance [rad] of joints up to which two roots are one: a double root is found to the root of round-off, 1e-8."""

CLOSED = 1e-10
"""Distance [m] and angle [rad] between the tool at a posture and the pose, up to which it is one."""

SINGULAR = 1e-6
"""Smallest over largest singular value of the Jacobian of the six joints below which two roots meet."""

NEAR = 1e-3
"""The same, below which a posture is asked for one that it meets nearby."""

_SEEN = 0.35 + np.arange(3) * np.pi / 3
"""Half angles of c, one of which becomes the infinite one, whatever the roots are: the one farthest from all."""

_CLUSTER = 1e-5
"""Distance [rad] of eigenvalues within which their vectors are taken for mixed."""

_ILL = 1e13
"""Condition of the leading matrix from which no eigenvalue has a digit that counts."""

_PROBES = 16
"""Random postures by which the orders of the loop are compared."""

_FAIR = 1e-4
"""How well a root closes the loop, and finds a posture again [link lengths, rad], without being polished."""

_STEPS = 12
"""Steps of Newton's method, which near a double root halve what is left."""

_LONGEST = 0.3
"""Longest step [rad]: eigenvalues are nearer than that."""

_ASIDE = 0.02
"""How far [rad] a singular posture is moved on, to see whether it is on a curve of them."""

_PAIRS = np.array([0, 4, 8, 11, 1, 5, 9, 12])
"""Rows of X without its 1 that a turn about z moves: the x of p, l, p x l and the last vector, then their y."""

_FIXED = np.array([2, 3, 6, 7, 10, 13])
"""The others."""

_TANGENTS = np.array([[1.0, 0.0, -1.0], [0.0, 2.0, 0.0], [1.0, 0.0, 1.0]])
"""(cos, sin, 1) in the products (C C, C S, S S) of C = cos(angle / 2), S = sin(angle / 2)."""


def _turns(sign: float) -> Array:
    """The factors (3, 15, 15) of cos, sin and 1 of a turn of X about z, or of one the other way."""
    out = np.zeros((3, 15, 15))
    out[2] = np.eye(15)
    for i in (1, 5, 9, 12):
        out[0, [i, i + 1], [i, i + 1]] = 1.0
        out[1, [i, i + 1], [i + 1, i]] = -sign, sign
        out[2, [i, i + 1], [i, i + 1]] = 0.0
    return out


_AHEAD, _BACK = _turns(1.0), _turns(-1.0)
_START = np.eye(15)[0] + np.eye(15)[7]
"""X of the z axis itself."""


def _inverse(T: Array) -> Array:
    """Of poses (..., 4, 4)."""
    out = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = R
    out[..., :3, 3] = -(R @ T[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def _skew(v: Array) -> Array:
    out = np.zeros((*v.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return out - np.swapaxes(out, -1, -2)


def _turn_z(angle: Array) -> Array:
    """Poses (k, 4, 4)."""
    out = np.zeros((*angle.shape, 4, 4))
    out[..., 0, 0] = out[..., 1, 1] = np.cos(angle)
    out[..., 1, 0] = np.sin(angle)
    out[..., 0, 1] = -out[..., 1, 0]
    out[..., 2, 2] = out[..., 3, 3] = 1.0
    return out


def _moved(T: Array) -> Array:
    """S(L) (k, 15, 15) of poses (k, 4, 4): how X changes where a rigid motion takes its axis."""
    R, t = T[:, :3, :3], T[:, :3, 3]
    out = np.zeros((len(T), 15, 15))
    tR = (t[:, None] @ R)[:, 0]
    square, cross = (t * t).sum(axis=1), _skew(t) @ R
    out[:, 0, 0] = out[:, 4, 4] = out[:, 8, 8] = 1.0
    for i in (1, 5, 9, 12):
        out[:, i : i + 3, i : i + 3] = R
    out[:, 1:4, 0], out[:, 4, 0], out[:, 4, 1:4] = t, square, 2 * tR
    out[:, 8, 5:8], out[:, 9:12, 5:8], out[:, 12:, 9:12], out[:, 12:, 8] = tR, cross, -2 * cross, -2 * t
    out[:, 12:, 5:8] = square[:, None, None] * R - 2 * t[:, :, None] * tR[:, None]
    return out


class Order(NamedTuple):
    """Which joints of the loop play a, b, c, d, e, f: from `first` on, and against the chain's order if reversed."""

    first: int
    reversed: bool

    @property
    def joints(self) -> list[int]:
        """The places (6,) of the joints a to f in the chain."""
        step = -1 if self.reversed else 1
        return [(self.first + step * i) % 6 for i in range(6)]

    def links(self, links: Sequence[Array]) -> list[Array]:
        """The links behind a to f, of those (6) behind the joints of the chain."""
        if not self.reversed:
            return [links[i] for i in self.joints]
        return [_inverse(links[i - 1]) for i in self.joints]


ORDERS = tuple(Order(first, back) for back in (False, True) for first in range(6))


class _Roots(NamedTuple):
    """Angles (K, 6) of the joints of the chain, the pose (K,) of each, its imaginary part (K,), rows (k,) in doubt."""

    angles: Matrix
    row: Indices
    imaginary: Vector
    ill: Flags


def _quarter(F: Array) -> Array:
    """F J, of columns (..., 16)."""
    G = F.reshape(*F.shape[:-1], 2, 2, 4)
    return np.stack([G[..., 1, :], -G[..., 0, :]], axis=-2).reshape(F.shape)


def _halves(low: Array, high: Array) -> tuple[Array, Array]:
    """Those of another angle, `_SEEN[0]` further."""
    c, s = np.cos(_SEEN[0]), np.sin(_SEEN[0])
    return c * low + s * high, c * high - s * low


def _angle_of(low: Array, high: Array) -> Array:
    """The angle (k,) whose half has the tangent x: high = x low, arrays (k, ., .)."""
    low, high = _halves(low, high)
    x = (low.conj() * high).sum(axis=(1, 2)) / (low.conj() * low).sum(axis=(1, 2))
    return 2 * (np.arctan(x) + _SEEN[0])


def _separated(q_c: Array, v: Array, row: Indices) -> tuple[Array, Array]:
    """(c (K,), v (K, 4, 3)) with the vectors (K, 12) of roots of one c, which an eigenvalue mixes, told apart.

    All v of some roots span what tan(d / 2) and tan(e / 2) multiply: their eigenvectors are the v of each.
    """
    out = v.reshape(-1, 4, 3).copy()
    order = np.lexsort((q_c.real, row))
    breaks = (np.diff(row[order]) > 0) | (np.diff(q_c.real[order]) > _CLUSTER)
    first = np.concatenate([[0], np.flatnonzero(breaks) + 1, [len(row)]])
    sizes = np.diff(first)
    for m in set(sizes.tolist()) - {0, 1}:
        members = order[first[:-1][sizes == m][:, None] + np.arange(m)]
        some = v[members] / np.linalg.norm(v[members], axis=2)[:, :, None]
        each = some.reshape(-1, m, 4, 3)
        A = np.zeros((len(each), m, m), dtype=complex)
        for weight, low, high in ((1.0, each[:, :, :3], each[:, :, 1:]), (0.6, each[..., :2], each[..., 1:])):
            low, high = (x.reshape(len(each), m, -1).transpose(0, 2, 1) for x in _halves(low, high))
            A += weight * (np.linalg.pinv(low) @ high)
        y = np.linalg.eig(A)[1]
        out[members] = (y.transpose(0, 2, 1) @ some).reshape(-1, m, 4, 3)
        share = np.abs(y) ** 2
        q_c[members] = (q_c[members][:, :, None] * share).sum(axis=1) / share.sum(axis=1)
    return q_c, out


def _loop_roots(links: Sequence[Array], order: Order) -> _Roots:
    """The roots of a loop, links (6) of (k, 4, 4), whose eigenvalues are nearly real."""
    k = len(links[0])
    loop = order.links(links)
    scale = np.max([np.linalg.norm(L[:, :3, 3], axis=1) for L in loop], axis=0)
    for i, L in enumerate(loop):
        loop[i] = L.copy()
        loop[i][:, :3, 3] /= scale[:, None]
    # The fourteen equations: Y (k, 14, 3, 3) of (cos, sin, 1) of d and e, Z (k, 14, 9) of those of b and a.
    a, b, c, d, e, f = loop
    left = _AHEAD @ (_moved(e) @ _START)[:, None, :, None]
    left = _moved(d) @ left[..., 0].transpose(0, 2, 1)
    left = np.einsum("rij,kje->kire", _AHEAD, left).reshape(k, 15, 9)
    Y = (_moved(c) @ left)[:, 1:]
    right = np.einsum("rij,kj->kir", _BACK, _moved(_inverse(f)) @ _START)
    right = np.einsum("rij,kja->kira", _BACK, _moved(_inverse(a)) @ right).reshape(k, 15, 9)
    Z = (_moved(_inverse(b)) @ right)[:, 1:]
    # Six equations without a and b, in the products of the half angles of d and e.
    full, R = np.linalg.qr(Z[:, :, :8], mode="complete")
    across = full[:, :, 8:].transpose(0, 2, 1)
    products = np.kron(_TANGENTS, _TANGENTS)
    turned = Y[:, _PAIRS] @ products
    mean = across[:, :, _FIXED] @ (Y[:, _FIXED] @ products) - across @ Z[:, :, 8:] * products[8]
    # Twelve, and the sixteen numbers that R_c turns.
    BH, V = np.zeros((k, 28, 12)), np.zeros((k, 12, 16))
    for i, shift in enumerate((0, 3)):
        BH[:, 6 * i : 6 * i + 6, shift : shift + 9] = mean
        BH[:, 12 + 8 * i : 20 + 8 * i, shift : shift + 9] = turned
        V[:, 6 * i : 6 * i + 6, 8 * i : 8 * i + 8] = across[:, :, _PAIRS]
    full_BH, R_BH = np.linalg.qr(BH, mode="complete")
    rest = full_BH[:, :, 12:].transpose(0, 2, 1)
    V_rest = rest[:, :, :12] @ V
    F = V_rest - rest[:, :, 12:], _quarter(V_rest + rest[:, :, 12:])
    # (cos(c / 2) F_0 + sin(c / 2) F_1) g = 0, seen from the angle where the determinant, and so the distance to all
    # roots, is the largest.
    c, s = np.cos(_SEEN), np.sin(_SEEN)
    seen = c[:, None, None, None] * F[1] - s[:, None, None, None] * F[0]
    size = np.linalg.slogdet(seen)[1]
    best = np.argmax(size, axis=0)
    leading, trailing = seen[best, np.arange(k)], c[best][:, None, None] * F[0] + s[best][:, None, None] * F[1]
    ill = ~np.isfinite(size.max(axis=0))
    leading[ill], trailing[ill] = np.eye(16), 0.0
    inverse = np.linalg.inv(leading)
    ill |= np.linalg.norm(leading, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2)) > _ILL
    tangent, G = np.linalg.eig(-inverse @ trailing)
    q_c = 2 * (np.arctan(tangent) + _SEEN[best][:, None])
    row, column = np.nonzero(np.abs(q_c.imag) < REAL)
    # c, and from the vectors d and e.
    g, q_c = G[row, :, column], q_c[row, column]
    half = q_c[:, None] / 2
    plain, quarter = np.cos(half) * g, np.sin(half) * _quarter(g)
    known = np.concatenate([-(V[row] @ (plain - quarter)[:, :, None])[:, :, 0], plain + quarter], axis=1)
    v = _least_squares(full_BH[:, :, :12], R_BH[:, :12], row, known)
    q_c, v = _separated(q_c, v, row)
    q_d, q_e = _angle_of(v[:, :3], v[:, 1:]), _angle_of(v[:, :, :2], v[:, :, 1:])
    imaginary = np.max([np.abs(q.imag) for q in (q_c, q_d, q_e)], axis=0)
    chosen = imaginary < REAL
    row, imaginary, q_c, q_d, q_e = row[chosen], imaginary[chosen], *(q.real[chosen] for q in (q_c, q_d, q_e))
    # The products of a and b from the fourteen equations, and f from the loop.
    waves = [np.stack([np.cos(q), np.sin(q), np.ones_like(q)], axis=1) for q in (q_c, q_d, q_e)]
    y = np.einsum("kide,kd,ke->ki", Y.reshape(k, 14, 3, 3)[row], waves[1], waves[2])
    x_part, y_part = y[:, _PAIRS[:4]], y[:, _PAIRS[4:]]
    cos, sin = waves[0][:, :1], waves[0][:, 1:2]
    y[:, _PAIRS] = np.concatenate([cos * x_part - sin * y_part, sin * x_part + cos * y_part], axis=1)
    of_ba = _least_squares(full[:, :, :8], R[:, :8], row, y - Z[row, :, 8])
    q_a, q_b = np.arctan2(of_ba[:, 7], of_ba[:, 6]), np.arctan2(of_ba[:, 5], of_ba[:, 2])
    T = _turn_z(q_a)
    for q, link in zip((q_b, q_c, q_d, q_e), loop, strict=False):
        T = T @ link[row] @ _turn_z(q)
    back = loop[5][row] @ T @ loop[4][row]
    q_f = np.arctan2(back[:, 0, 1] - back[:, 1, 0], back[:, 0, 0] + back[:, 1, 1])
    angles = np.empty((len(row), 6))
    angles[:, order.joints] = np.stack([q_a, q_b, q_c, q_d, q_e, q_f], axis=1) * (-1 if order.reversed else 1)
    return _Roots(angles, row, imaginary, ill)


def _least_squares(Q: Array, R: Array, row: Indices, known: Matrix) -> Matrix:
    """x (K, m) with Q R x = known (K, .), of Q (k, ., m) and R (k, m, m) at the rows."""
    return np.linalg.solve(R[row], (known[:, None] @ Q[row]).transpose(0, 2, 1))[:, :, 0]


class _Some(NamedTuple):
    """Joints (K, 6) of postures, the pose (K,) of each, residual (K,), rcond (K,), and the direction (K, 6) in which the
    tool moves least."""

    q: Matrix
    row: Indices
    residual: Vector
    rcond: Vector
    null: Matrix

    def at(self, chosen: Array) -> _Some:
        return _Some(*(x[chosen] for x in self))

    def joined(self, others: _Some) -> _Some:
        return _Some(*(np.concatenate([x, y]) for x, y in zip(self, others, strict=True)))

    def distinct(self, k: int) -> _Some:
        """Without those that are another of the same of k poses, in the order of these."""
        some = self.at(np.argsort(self.row, kind="stable"))
        row = some.row
        count = np.bincount(row, minlength=k)
        place = np.arange(len(row)) - (np.cumsum(count) - count)[row]
        each = np.full((k, max(1, count.max(initial=0)), 6), np.nan)
        each[row, place] = some.q
        same = (_apart(each[:, :, None], each[:, None]) < SAME) & np.tri(each.shape[1], k=-1, dtype=bool)
        return some.at(~same.any(axis=2)[row, place])


@dataclass(frozen=True, eq=False)
class GeneralPostures(Value):
    """Postures at poses (k, 4, 4).

    q (K, n). row (K,): the pose of each, in increasing order. residual (K,): distance [m] or angle [rad] between the
    tool and the pose. rcond (K,): smallest over largest singular value of the Jacobian of the six joints. doubtful (k,):
    an eigenvalue that is real came to no posture of its own, so one may be missing. curve (k,): some posture is on a
    curve of them, of which those that are told are points.
    """

    q: Matrix
    row: Indices
    residual: Vector
    rcond: Vector
    doubtful: Flags
    curve: Flags

    def at(self, row: int) -> Matrix:
        """Those of one pose, (j, n)."""
        first, last = np.searchsorted(self.row, [row, row + 1])
        return self.q[first:last]


@dataclass(frozen=True, eq=False)
class GeneralInverse(Value):
    """All postures of an arm at a tool pose, up to sixteen, for given values of the joints that are held.

    robot: of any kind. held: coordinates without which six hinges are left on the chain to the tip; `general_inverse`
    says of which this serves.
    """

    robot: Robot
    held: tuple[int, ...]
    tip: str | None = None

    @cached_property
    def _links(self) -> list[Link]:
        return links_of(self.robot, self.tip)

    @cached_property
    def others(self) -> list[int]:
        """The coordinates of the six joints, in their order along the arm."""
        return [link.coordinate for link in self._links if link.coordinate >= 0 and link.coordinate not in self.held]

    @cached_property
    def _joints(self) -> tuple[Vector, Vector, Vector]:
        """(multipliers, offsets, middles of the ranges) of the six joints, (6,) each."""
        free = [link for link in self._links if link.coordinate in self.others]
        low, high = self.robot.lower[self.others], self.robot.upper[self.others]
        with np.errstate(invalid="ignore"):
            middle = np.where(np.isfinite(low + high), (low + high) / 2, 0.0)
        return np.array([x.multiplier for x in free]), np.array([x.offset for x in free]), middle

    def _chain(self, held: Matrix) -> list[Array]:
        """The seven links (k, 4, 4) between base, the z axes of the six hinges, and tip, at held values (k, r)."""
        T, out = np.broadcast_to(np.eye(4), (len(held), 4, 4)), []
        for link in self._links:
            placement = np.eye(4)
            placement[:3, :3], placement[:3, 3] = link.rotation, link.position
            T = T @ placement
            if link.coordinate in self.held:
                value = link.multiplier * held[:, self.held.index(link.coordinate)] + link.offset
                move = np.broadcast_to(np.eye(4), (len(held), 4, 4)).copy()
                if link.slides:
                    move[:, :3, 3] = link.axis * value[:, None]
                else:
                    K = _skew(link.axis)
                    s, c = np.sin(value)[:, None, None], np.cos(value)[:, None, None]
                    move[:, :3, :3] += s * K + (1 - c) * (K @ K)
                T = T @ move
            else:
                upright = _upright(link.axis) if link.coordinate >= 0 else np.eye(4)
                out.append(T @ upright)
                T = np.broadcast_to(upright.T, (len(held), 4, 4))
        return out

    def _loop(self, poses: Array, held: Matrix) -> list[Array]:
        """The six links (k, 4, 4) of the loop that the poses close."""
        chain = self._chain(held)
        return [*chain[1:6], chain[6] @ _inverse(poses) @ chain[0]]

    @cached_property
    def orders(self) -> tuple[Order, ...]:
        """The orders of the loop that find random postures again, the best conditioned first."""
        rng = np.random.default_rng(0)
        q = rng.uniform(-np.pi, np.pi, (_PROBES, self.robot.n))
        slides = ~self.robot.hinges
        low, high = np.clip(self.robot.lower, -1, None), np.clip(self.robot.upper, None, 1)
        q[:, slides] = rng.uniform(low, np.maximum(low, high), (_PROBES, self.robot.n))[:, slides]
        held = q[:, list(self.held)]
        loop = self._loop(self.robot.pose(q, self.tip), held)
        marks = []
        for order in ORDERS:
            with np.errstate(all="ignore"):
                try:
                    roots = _loop_roots(loop, order)
                except np.linalg.LinAlgError:
                    continue
            # How well its roots close the loop, those that are real, and the postures found again.
            T = np.broadcast_to(np.eye(4), (len(roots.row), 4, 4))
            for i in range(6):
                T = T @ _turn_z(roots.angles[:, i]) @ loop[i][roots.row]
            gap = np.abs(T - np.eye(4)).max(axis=(1, 2))
            fair = gap < _FAIR
            multipliers, offsets, _ = self._joints
            away = _apart(roots.angles, (q[:, self.others] * multipliers + offsets)[roots.row])
            again = np.bincount(roots.row[fair & (away < _FAIR)], minlength=_PROBES) > 0
            bad = (~again).sum() + (~fair & (np.abs(roots.imaginary) < 1e-12)).sum()
            marks.append((bad, float(np.log(np.maximum(gap[fair], 1e-16)).mean()) if fair.any() else 0.0, order))
        return tuple(order for bad, _, order in sorted(marks, key=lambda m: m[:2]) if bad <= _PROBES // 4)

    def postures(self, poses: Array, held: ArrayLike) -> GeneralPostures:
        """The postures at tool poses (k, 4, 4) of any floats, with the held joints at values (k, r) or (r,).

        The joints' values are at the turn nearest to the middle of their range; limits are not looked at. Coordinates
        off the chain are 0.
        """
        poses = _rigid(np.asarray(poses, dtype=float))
        k = len(poses)
        held = np.broadcast_to(np.asarray(held, dtype=float), (k, len(self.held)))
        loop = self._loop(poses, held)
        some = _Some(np.zeros((0, 6)), np.zeros(0, dtype=int), np.zeros(0), np.zeros(0), np.zeros((0, 6)))
        doubtful = np.ones(k, dtype=bool)
        for order in self._tried:
            left = np.flatnonzero(doubtful)
            with np.errstate(all="ignore"):
                roots = _loop_roots([L[left] for L in loop], order)
            # Of a pair that is not real, one; polished, with what each meets nearby.
            chosen = np.ones(len(roots.row), bool)
            multipliers, offsets, _ = self._joints
            starts = (roots.angles[chosen] - offsets) / multipliers
            more = self._polished(starts, left[roots.row[chosen]], poses, held)
            more = more.joined(self._partners(more, poses, held)).distinct(k)
            # Each real eigenvalue has a posture of its own, or two have one that is singular.
            real = np.bincount(left[roots.row[np.abs(roots.imaginary) < SURE]], minlength=k)
            doubtful[left] = roots.ill
            doubtful |= real > np.bincount(more.row, weights=1 + (more.rcond < SINGULAR), minlength=k)
            some = some.joined(more).distinct(k)
            if not doubtful.any():
                break
        q = self._postures_of(some.q, some.row, held)
        curve = self._curves(some, poses, held)
        return GeneralPostures(*(frozen(x) for x in (q, some.row, some.residual, some.rcond, doubtful, curve)))

    @cached_property
    def _tried(self) -> list[Order]:
        """The best order, and two for poses that it leaves in doubt, each with another joint for c."""
        out: list[Order] = []
        for order in self.orders:
            if order.joints[2] not in [other.joints[2] for other in out]:
                out.append(order)
        return out[:3]

    def _postures_of(self, q: Matrix, row: Indices, held: Matrix) -> Matrix:
        """Postures (K, n) of joints (K, 6)."""
        out = np.zeros((len(q), self.robot.n))
        out[:, list(self.held)] = held[row]
        out[:, self.others] = q
        return out

    def _polished(self, q: Matrix, row: Indices, poses: Array, held: Matrix) -> _Some:
        """The postures that Newton's method on the robot's model comes to, from joints (K, 6)."""
        q, goal, middle = q.copy(), poses[row], self._joints[2]
        rcond, null = np.zeros(len(q)), np.zeros(q.shape)
        left = np.arange(len(q))
        for _ in range(_STEPS):
            posture = self._postures_of(q[left], row[left], held)
            error = _error(self.robot.pose(posture, self.tip), goal[left])
            U, size, Vt = np.linalg.svd(self.robot.jacobian(posture, self.tip)[:, :, self.others])
            small = np.maximum(size, 1e-14 * size[:, :1])
            step = ((error[:, None] @ U)[:, 0] / small)[:, None] @ Vt
            step = step[:, 0]
            length = np.linalg.norm(step, axis=1)
            q[left] += step * np.minimum(1, _LONGEST / np.maximum(length, 1e-300))[:, None]
            rcond[left], null[left] = size[:, -1] / size[:, 0], Vt[:, -1]
            left = left[length > 1e-8]
            if not len(left):
                break
        q = middle + (q - middle + np.pi) % (2 * np.pi) - np.pi
        error = _error(self.robot.pose(self._postures_of(q, row, held), self.tip), goal)
        residual = np.abs(error).max(axis=1)
        return _Some(q, row, residual, rcond, null).at(residual < CLOSED)

    def _partners(self, some: _Some, poses: Array, held: Matrix) -> _Some:
        """The postures that nearly singular ones meet nearby: where the tool is back after s t + h t^2 = 0."""
        near = some.at(some.rcond < NEAR)
        t = 1e-3
        ends = [
            _error(self.robot.pose(self._postures_of(near.q + x * near.null, near.row, held), self.tip), poses[near.row])
            for x in (t, -t)
        ]
        slope, bend = (ends[0] - ends[1]) / (2 * t), (ends[0] + ends[1]) / (2 * t * t)
        along = -(slope * bend).sum(axis=1) / np.maximum((bend * bend).sum(axis=1), 1e-300)
        along = np.clip(along, -_LONGEST, _LONGEST)
        return self._polished(near.q + along[:, None] * near.null, near.row, poses, held)

    def _curves(self, some: _Some, poses: Array, held: Matrix) -> Flags:
        """At which poses (k,) a singular posture can move on while the tool stays."""
        out = np.zeros(len(poses), dtype=bool)
        singular = some.at(some.rcond < SINGULAR)
        if len(singular.row):
            moved = self._polished(singular.q + _ASIDE * singular.null, singular.row, poses, held)
            for q, row, rcond in zip(moved.q, moved.row, moved.rcond, strict=True):
                away = _apart(q, singular.q[singular.row == row])
                out[row] |= bool(rcond < SINGULAR and away.min() > _ASIDE / 10)
        return out


def general_inverse(robot: Robot, held: Sequence[int], tip: str | None = None) -> GeneralInverse | NoClass:
    """The general inverse of what is left when the coordinates `held` are, or why it has none."""
    links, held = links_of(robot, tip), tuple(held)
    reason = no_six_hinges(links, held)
    if reason is None:
        inverse = GeneralInverse(robot, held, tip)
        if inverse.orders:
            return inverse
        reason = "the equations of the general inverse are singular for its axes"
    return NoClass(held, reason)


def _apart(q: Array, other: Array) -> Array:
    """Largest difference of joints (..., 6), whole turns aside."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def _error(T: Array, goal: Array) -> Matrix:
    """The twists (k, 6) from poses to others, to first order: [m], and the sine of the angle."""
    turn = goal[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
    w = 0.5 * np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1)
    return np.concatenate([goal[:, :3, 3] - T[:, :3, 3], w], axis=1)


def _rigid(poses: Array) -> Array:
    """Poses with the nearest rotations: those of single precision are 1e-7 from one."""
    out = poses.copy()
    for _ in range(2):
        R = out[:, :3, :3]
        out[:, :3, :3] = 1.5 * R - 0.5 * R @ R.transpose(0, 2, 1) @ R
    return out


def _upright(axis: Vector) -> Matrix:
    """A pose without position whose z axis is a unit vector."""
    out = np.eye(4)
    if axis[2] < -0.5:
        out[:3, :3] = _upright(-axis)[:3, :3] @ np.diag([1.0, -1.0, -1.0])
        return out
    K = _skew(np.array([-axis[1], axis[0], 0.0]))
    out[:3, :3] += K + K @ K / (1 + axis[2])
    return out
