"""The Newton-Kantorovich test of many cells at once, and its bounds. [KA82, XVIII] [Deu04, 2.1]

A cell is a member of a family of tool poses x(y), y in [-1, 1]^d, with a predictor q(y) = q0 + V y + 1/2 Q y y of the
joints and a matrix Y near [D_q E(q0, 0)]^-1. Over its tube, all q within rho of the predictor,

    omega >= |Y D_q^2 E|,   e >= |1 - Y D_q E(q(y), y)|,   eta >= |Y E(q(y), y)|   for all y.

If e < 1 and 2 omega eta <= (1 - e)^2, then for every y there is exactly one root within
r = 2 eta / (1 - e + sqrt((1 - e)^2 - 2 omega eta)) of q(y), and it is the only one within min(rho, 2 (1 - e) / omega -
r). Where 2 omega eta < (1 - e)^2, which is asked, D_q E is regular there: the roots are a smooth function of y. E must
be smooth in the tube: that no guard of `symbolic.separated` vanishes there is asked too.

The box q0 +- (reach + rho) holds all balls of radius rho about the predictor, and so the way (q(ty), ty), 0 <= t <= 1,
along which D_q E changes by (D_q^2 E D_k q + D_k D_q E) y_k, summed over the parameters, with D_k = d/dy_k: hence
e <= |1 - Y D_q E(q0, 0)| + sum_k |Y (D_q^2 E D_k q + D_k D_q E)|.
The 2-norm of second derivatives laid side by side bounds that of the bilinear map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.types import Array, Matrix, Value, Vector, joined, some
from ..symbolic.intervals import PI, Interval, absolute, add, divide, multiply, outward, point, subtract
from .equation import Equation

# --- Matrices and norms to the last rounding: products of doubles with intervals, upper bounds of 2-norms.

UNIT = 2.0**-53
"""The relative error of a rounding."""

UP = 1 + 1e-13
"""Carries a bound of positive terms over the roundings that made it, of `UNIT` each: up to 900 one after the other."""


def product(Y: Array | Interval, a: Interval) -> Interval:
    """Y a for matrices Y (k, m, n), exact or intervals, and intervals a (k, n, j).

    With Y = M +- R and a = mid +- rad, |Y a - fl(M mid)| <= |M| rad + R (|mid| + rad) + gamma |M| |mid| with
    gamma = n u / (1 - n u), for sums in any order [Hig02, 3.5]; (n + 2) u is more, and 1e-300 more than what is lost by
    underflow.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        mid, rad = _ball(a)
        M, R = _ball(Y) if isinstance(Y, Interval) else (Y, None)
        center = M @ mid
        bound = np.abs(M) @ (rad + (M.shape[2] + 2) * UNIT * np.abs(mid))
        if R is not None:
            bound = bound + R @ (np.abs(mid) + rad)
        bound = bound * UP + 1e-300
        low, high = center - bound, center + bound
    broken = ~(np.isfinite(low) & np.isfinite(high))
    low, high = np.where(broken, -np.inf, low), np.where(broken, np.inf, high)
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def norm(a: Interval) -> Vector:
    """An upper bound (k,) of the 2-norm of all matrices (k, n, j) in an interval: |mid| + |rad|_F."""
    with np.errstate(invalid="ignore", over="ignore"):
        mid, rad = _ball(a)
        bound = matrix_norm(mid) + _frobenius(rad)
    return np.where(np.isfinite(bound), bound * UP, np.inf)


def matrix_norm(M: Array) -> Vector:
    """An upper bound (k,) of the 2-norm of matrices (k, n, j): t^(1/2) |S^4|_F^(1/8), S = M M^T / t, t its trace.

    At most n^(1/8) too large. |S|_F <= 1, and so S, S^2 and S^4 are off by at most (j + 2) u, 2 (j + 2) u + n u and
    4 (j + 2) u + 3 n u in that norm [Hig02, 3.5], with squares of u left out: less than the `off` that is added.
    """
    off = 10 * (M.shape[1] + M.shape[2] + 2) * UNIT
    with np.errstate(invalid="ignore", over="ignore"):
        trace = np.square(_frobenius(M)) * UP
        safe = np.where((trace > 1e-290) & np.isfinite(trace), trace, 1.0)
        S = M @ np.swapaxes(M, 1, 2) / safe[:, None, None]
        S = np.where(np.isfinite(S), S, 0.0)
        S = S @ S
        bound = np.sqrt(safe) * np.sqrt(np.sqrt(np.sqrt(_frobenius(S @ S) + off))) * UP
        bound = np.minimum(bound, np.sqrt(trace) * UP)
    return np.where(np.isfinite(trace), bound, np.inf)


def _frobenius(M: Array) -> Vector:
    """The Frobenius norm, an upper bound: a sum of N squares is off by at most N u, however it is ordered."""
    up = UP + M.shape[1] * M.shape[2] * UNIT
    with np.errstate(over="ignore"):
        return np.sqrt(np.sum(np.square(M), axis=(1, 2))) * up + 1e-150


def _ball(a: Interval) -> tuple[Array, Array]:
    """(mid, rad) with a within mid +- rad."""
    mid = a.low / 2 + a.high / 2
    return mid, np.maximum(a.high - mid, mid - a.low) * UP


MARGIN = 1.25
"""Of r and of the radius within which a root is alone, over what the test asks: room for the checker's own bounds."""


def pair_weights(d: int) -> Vector:
    """Of the pairs i <= j in 1/2 Q y y, written without doubles: 1/2 for i = j, else 1."""
    i, j = np.triu_indices(d)
    return np.where(i == j, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class Cells(Value):
    """k cells: q0 (k, n), V (k, n, d), Q (k, n, d (d + 1) / 2), numbers (k, .) of the family, rho (k,)."""

    q0: Matrix
    V: Array
    Q: Array
    numbers: Matrix
    rho: Vector

    def __len__(self) -> int:
        return len(self.q0)

    @property
    def reach(self) -> Matrix:
        """How far the predictor goes from q0 at most, joint by joint (k, n)."""
        d = self.V.shape[2]
        return (np.abs(self.V).sum(axis=2) + np.abs(self.Q) @ pair_weights(d)) * UP

    @property
    def slope(self) -> Interval:
        """The derivatives of the predictor (k, n, d) for all y."""
        d = self.V.shape[2]
        bend = np.zeros_like(self.V)
        for pair, (i, j) in enumerate(zip(*np.triu_indices(d), strict=True)):
            size = np.abs(self.Q[:, :, pair])
            bend[:, :, i] += size
            bend[:, :, j] += size if i != j else 0.0
        return outward(self.V - bend * UP, self.V + bend * UP)

    def predicted(self, y: Matrix) -> Matrix:
        """q(y) (k, n) at y (k, d), within `slip` of it."""
        i, j = np.triu_indices(self.V.shape[2])
        products = y[:, i] * y[:, j] * pair_weights(self.V.shape[2])
        return self.q0 + np.einsum("knd,kd->kn", self.V, y) + np.einsum("knp,kp->kn", self.Q, products)

    @property
    def slip(self) -> Vector:
        """How far `predicted` is off (k,) at most, where y is within 8 u of what is meant, |y| <= 1.

        The sum has up to 1 + d + d (d + 1) / 2 <= 28 terms of three factors: (28 + 3 + 2 x 8) u < 1e-14 of their sizes.
        """
        return 1e-14 * np.linalg.norm(np.abs(self.q0) + self.reach, axis=1) + 1e-300


@dataclass(frozen=True, eq=False)
class Findings(Value):
    """Of k cells: Y (k, n, n); omega, e, eta; r, the root is within it, infinite where the test fails; alone, within
    that it is the only one; low, high (k, joints) of the joints at the roots; slopes (k, joints, d), the largest size
    of the derivatives of the joints at the roots by y. Of P pairs of shapes, where some are asked about: apart (k, P),
    how far they are apart at least [m], and the planes (k, P, 3) between them."""

    Y: Array
    omega: Vector
    e: Vector
    eta: Vector
    r: Vector
    alone: Vector
    low: Matrix
    high: Matrix
    slopes: Array
    apart: Matrix
    planes: Array


def centred(equation: Equation, q: Matrix, numbers: Matrix, c: Vector, rho: Vector, newtons: int = 1) -> Cells:
    """Cells about the roots near q (k, n), with the predictors of the second order there: V = -Y E_y, Q = -Y F_yy."""
    n, d, k = equation.n, equation.d, len(q)
    fixed = np.vstack([numbers.T, np.repeat(c[:, None], k, axis=1)])
    still = np.zeros((d, k))
    Y = np.zeros((k, n, n))
    for _ in range(newtons):
        E, A = _value(equation, np.vstack([q.T, still, fixed]))
        Y = inverses(A.middle)
        step = np.einsum("kij,kj->ki", Y, _wrapped(equation, E).middle[:, :, 0])
        q = q - np.where(np.isfinite(step) & (np.abs(step) < 1.0), step, 0.0)
    pairs = d * (d + 1) // 2
    zero = np.zeros((n * (d + pairs), k))
    first = _along(equation, np.vstack([still, q.T, zero, fixed]))[0].middle
    V = -Y @ first
    flat = np.swapaxes(V, 1, 2).reshape(k, -1).T
    second = _along(equation, np.vstack([still, q.T, flat, zero[: n * pairs], fixed]))[1].middle
    return Cells(q, V, -Y @ second, numbers, rho)


def examined(equation: Equation, cells: Cells, c: Vector, slack: float = 0.0) -> Findings:
    """The test of all cells. `slack`: tool poses may be off by this much, for joints between pieces of a path [m]."""
    at_once = equation.at_once
    parts = [some(cells, slice(i, i + at_once)) for i in range(0, max(len(cells), 1), at_once)]
    return joined(*(_examined(equation, part, c, slack) for part in parts))


def _examined(equation: Equation, cells: Cells, c: Vector, slack: float) -> Findings:
    # E and D_q E at the middles, and Y.
    n, d, k = equation.n, equation.d, len(cells)
    fixed = np.vstack([cells.numbers.T, np.repeat(c[:, None], k, axis=1)])
    still, one = np.zeros((d, k)), np.ones((d, k))
    E, A = _value(equation, np.vstack([cells.q0.T, still, fixed]))
    Y = inverses(A.middle)
    off = subtract(point(np.eye(n)), product(Y, A))

    # Second derivatives over the box that holds the tube: omega, and how D_q E changes along each parameter.
    reach, slope = cells.reach, cells.slope
    wide = (reach + cells.rho[:, None]) * UP
    low = np.vstack([np.nextafter(cells.q0 - wide, -np.inf).T, -one, fixed])
    high = np.vstack([np.nextafter(cells.q0 + wide, np.inf).T, one, fixed])
    first = equation.positive + equation.guards
    cuts = equation.positive, first, first + n * n * (n + 1) // 2
    enclosed = equation.curvature(low, high)
    facing, guards, bends, mixed = (
        Interval(*ends) for ends in zip(*(np.split(x, cuts) for x in enclosed), strict=True)
    )
    H = product(Y, Interval(_symmetric(bends.low, n), _symmetric(bends.high, n)))
    omega = norm(H)
    change = product(Interval(*(x.reshape(k, n * n, n) for x in H)), slope)
    turned = np.zeros((k, n))
    if equation.family.turning:
        by_turn = product(Y, _columns(mixed, n))
        change = add(change, Interval(*(x.reshape(k, n * n, d) for x in by_turn)))
        turned = np.linalg.norm(by_turn.magnitude, axis=2)
    along_y = [Interval(*(x[:, :, m].reshape(k, n, n) for x in change)) for m in range(d)]
    e = (norm(off) + sum(norm(part) for part in along_y)) * UP

    # E along the predictor, to the second order: eta.
    flat = [np.swapaxes(part, 1, 2).reshape(k, -1).T for part in (cells.V, cells.Q)]
    rest = np.vstack([cells.q0.T, *flat, fixed])
    first_by_y = product(Y, _along(equation, np.vstack([still, rest]))[0])
    second_by_y = product(Y, _along(equation, np.vstack([-one, rest]), np.vstack([one, rest]))[1])
    eta = norm(product(Y, _wrapped(equation, E)))
    eta = eta + _column_sum(first_by_y, np.ones(d)) + _column_sum(second_by_y, pair_weights(d))
    eta = (eta + slack * norm(Interval(Y, Y))) * UP

    # The test, and the radii about the predictor: the root is within r, and alone within `alone`.
    apart = np.maximum(guards.low, -guards.high).min(axis=0, initial=np.inf)
    clear = np.minimum(facing.low.min(axis=0), apart)
    with np.errstate(invalid="ignore", over="ignore"):
        gap = (1 - e) ** 2 / UP - 2 * omega * eta * UP - 1e-300
        good = (e < 1) & (gap >= 0) & (clear > 0)
        least = 2 * eta / (1 - e + np.sqrt(np.where(good, gap, 0.0))) * UP
        most = np.minimum(cells.rho, 2 * (1 - e) / np.maximum(omega, 1e-300) / UP - least)
        r = least * MARGIN
        good &= (r * MARGIN <= most) & (omega * r * MARGIN < 1 - e)
        alone = np.where(good, most / MARGIN, 0.0)
    r = np.where(good, r, np.inf)

    # The joints at the roots, with room for the checker's own r, and their derivatives.
    size = (np.where(good, 3 * r, 0.0)[:, None] + reach) * (1 + 1e-6)
    low, high = np.nextafter(cells.q0 - size * UP, -np.inf), np.nextafter(cells.q0 + size * UP, np.inf)
    varied = (off.magnitude + sum(part.magnitude for part in along_y)) * UP
    curved = np.linalg.norm(H.magnitude, axis=2)
    missed = first_by_y.magnitude + _paired(second_by_y.magnitude, d)
    slopes = _slopes(slope.magnitude, missed, varied, curved, turned, r)
    joints = slice(0, equation.joints)
    low, high, slopes = low[:, joints], high[:, joints], slopes[:, joints]
    return Findings(Y, omega, e, eta, r, alone, low, high, slopes, np.zeros((k, 0)), np.zeros((k, 0, 3)))


def _slopes(steep: Array, missed: Array, varied: Array, curved: Matrix, turned: Matrix, r: Vector) -> Array:
    """Upper bounds (k, n, d) of |q'| at the roots by y, number by number; infinite where there is no root.

    A q' = -E_y at the root q, and F' = A p' + E_y at the predictor p, which is at most r away, so that
    Y A (q' - p') = v, |v| <= `missed` + (`turned` + `curved` |p'|) r row by row. With |1 - Y A| <= C = `varied` +
    `curved` r and s < 1 its norm, |q' - p'| <= |v| + C |v| + |C_i| |C v| / (1 - s).
    """
    r = r[:, None]
    with np.errstate(invalid="ignore", over="ignore"):
        v = missed + (turned * r)[:, :, None] + (curved * r)[:, :, None] * np.linalg.norm(steep, axis=1, keepdims=True)
        C = varied + (curved * r)[:, :, None]
        first = C @ v
        left = (1 - matrix_norm(np.where(np.isfinite(C), C, np.inf)))[:, None, None]
        rest = np.linalg.norm(C, axis=2)[:, :, None] * np.linalg.norm(first, axis=1, keepdims=True) / left
        slopes = (steep + v + first + rest) * UP
    return np.where(np.isfinite(slopes) & (left > 0), slopes, np.inf)


def _paired(second: Array, d: int) -> Array:
    """(k, n, d) the sums over j of the second derivatives by y_m and y_j, of sizes (k, n, d (d + 1) / 2)."""
    pairs = [(i, j) for i in range(d) for j in range(i, d)]
    return np.stack([second[:, :, [p for p, of in enumerate(pairs) if m in of]].sum(axis=2) for m in range(d)], axis=2)


def inverses(A: Array) -> Array:
    """Matrices near the inverses (k, n, n); zeros where there is none, which fail the test."""
    Y = np.zeros_like(A)
    good = np.isfinite(A).all(axis=(1, 2))
    try:
        Y[good] = np.linalg.inv(A[good])
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        for i in np.flatnonzero(good):
            if np.linalg.matrix_rank(A[i]) == A.shape[1]:
                Y[i] = np.linalg.inv(A[i])
    return np.where(np.isfinite(Y), Y, 0.0)


def _value(equation: Equation, points: Matrix) -> tuple[Interval, Interval]:
    """(E (k, n, 1), D_q E (k, n, n)) at points."""
    n = equation.n
    low, high = equation.value(points, points)
    return _columns(Interval(low[:n], high[:n]), n), _columns(Interval(low[n:], high[n:]), n)


def _along(equation: Equation, low: Matrix, high: Matrix | None = None) -> tuple[Interval, Interval]:
    """First (k, n, d) and second (k, n, d (d + 1) / 2) derivatives along the predictor."""
    n, first = equation.n, equation.n * equation.d
    low, high = equation.along(low, low if high is None else high)
    return _columns(Interval(low[:first], high[:first]), n), _columns(Interval(low[first:], high[first:]), n)


def _wrapped(equation: Equation, E: Interval) -> Interval:
    """E with the rows of g that are angles less whole turns."""
    turns = np.rint(E.middle / (2 * np.pi)) * np.array(equation.angular)[:, None]
    if not turns.any():
        return E
    return subtract(E, multiply(point(turns), Interval(np.array(2 * PI[0]), np.array(2 * PI[1]))))


def _columns(a: Interval, rows: int) -> Interval:
    """Matrices (k, rows, .) of enclosures written column by column (rows ., k)."""
    low, high = (np.swapaxes(np.moveaxis(x, -1, 0).reshape(x.shape[-1], -1, rows), 1, 2) for x in a)
    return Interval(low, high)


def _column_sum(a: Interval, weights: Vector) -> Vector:
    """sum_j weights_j |a_j| (k,) of the columns."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.sqrt(np.sum(np.square(a.magnitude), axis=1)) @ weights * (UP + len(weights) * UNIT) + 1e-150
    return np.where(np.isfinite(size), size, np.inf)


def _symmetric(bends: Array, n: int) -> Array:
    """(k, n, n * n) of columns j <= l (n n (n + 1) / 2, k) of second derivatives."""
    columns = np.moveaxis(bends, -1, 0).reshape(bends.shape[-1], -1, n)
    place = np.zeros((n, n), dtype=int)
    for i, pair in enumerate((j, k) for j in range(n) for k in range(j, n)):
        place[pair] = place[pair[::-1]] = i
    return np.swapaxes(columns[:, place.ravel()], 1, 2)


def least_determinant(findings: Findings) -> float:
    """A lower bound of |det D_q E| at all roots: |det Y A| >= (1 - s)^n, s = e + omega r; over |det Y| that of A.

    Half of it: room for the checker's own, which is another one.
    """
    if not len(findings.r):
        return 0.0
    shrink = np.maximum(1 - (findings.e + findings.omega * findings.r), 0.0)
    with np.errstate(divide="ignore"):
        bounds = 0.5 * shrink ** findings.Y.shape[1] / _determinants(findings.Y).high
    return float(bounds.min())


def _determinants(A: Array) -> Interval:
    """Enclosures (k,) of |det A| of matrices (k, n, n), by elimination, the rows in the order of rounded numbers."""
    from scipy.linalg import lu

    k, n, _ = A.shape
    order = np.array([lu(matrix, p_indices=True)[0] for matrix in A], dtype=int).reshape(k, n).argsort(axis=1)
    M = np.take_along_axis(A, order[:, :, None], axis=1)
    rows = [point(M[:, i, :].T.copy()) for i in range(n)]  # (n, k) each
    total = point(np.ones(k))
    for j in range(n):
        pivot = Interval(rows[j].low[j], rows[j].high[j])
        total = multiply(total, absolute(pivot))
        for i in range(j + 1, n):
            factor = divide(Interval(rows[i].low[j], rows[i].high[j]), pivot)
            rows[i] = subtract(rows[i], multiply(factor, rows[j]))
    return total
