"""Curvature of a strategy: how far a small loop of the tool carries the joints; drift along long ones. [SY88]

F_ij = vertical part of [G_i, G_j], always in ker J; the drift of one small counter-clockwise loop of area
a in the task plane (i, j) is a F_ij. A strategy is holonomic exactly when F = 0. For a geometric Jacobian
the brackets themselves do not vanish, their vertical part does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ...base.arguments import typed
from ...base.errors import (
    ArgumentError,
    NotFiniteError,
    OwnFunctionError,
    SingularityError,
)
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Matrix, Result, Value, Vector, kept
from ...strategies import FrameStrategy, NumericStrategy, Strategy, checked_rate
from ...symbolic import SX, Evaluator, Function, as_expression, densify, factorise, horzcat, runge_kutta, vertcat
from ...symbolic.linear import null_space_expression

# --- Derivatives of a function that is known by its values alone, with an error for each: differences, extrapolated.
#
# Central differences over steps h, h/2, h/4, ... are extrapolated to 0 [Rid82]. Long steps leave a remainder, short
# ones enlarge the noise of the values. Of all extrapolations the one is taken whose remainder, estimated by its
# neighbours, and noise are least together. The noise is what a polynomial leaves of values near the posture.

Values = Callable[[Vector], Array]
"""A function of postures (n,) whose values have any one shape."""


@dataclass(frozen=True, eq=False)
class Slope:
    """A derivative along a direction; `error`, what its columns may be away from the true one, and the `step` used."""

    value: Array
    error: Vector
    step: float


def noise_of(f: Values, q: Vector, direction: Vector) -> float:
    """The standard deviation of the noise of f about q, at least its last digit; infinite where f is not finite."""
    # Values at 16 uneven distances, so that no periodic noise looks smooth. They lie within 4e-3 joint units: that is
    # longer than the digits of single precision, and a sine that turns once in 1 rad is a polynomial there to 6e-18
    count, degree, reach = 16, 5, 4e-3
    places = np.linspace(-1.0, 1.0, count) + np.random.default_rng(0).uniform(-0.4, 0.4, count) * 2 / count
    values = np.array([f(q + reach * place * direction).ravel() for place in places])
    if not np.isfinite(values).all():
        return np.inf
    # Noise is what the polynomial of least squares leaves, and at least the last digit of the largest value
    basis, _ = np.linalg.qr(np.polynomial.chebyshev.chebvander(places, degree))
    residual = values - basis @ (basis.T @ values)
    deviation = float(np.sqrt((residual**2).sum(axis=0).max() / (count - degree - 1)))
    return max(deviation, 2.0**-52 * float(np.abs(values).max()))


def slope(f: Values, q: Vector, direction: Vector, noise: float) -> Slope:
    """The derivative of f (n, m) at q along a unit direction (n,).

    Steps at which f is not finite are left out. The errors are infinite where too few are left.
    """
    best = Slope(np.full(f(q).shape, np.nan), np.full(f(q).shape[1], np.inf), np.nan)
    row: list[tuple[Array, float]] = []  # (extrapolation, its factor of the noise)
    # From about the size of the regions that are judged down to 8e-4: of 16 digits the fourth or fifth step is the best
    for h in 0.1 * 0.5 ** np.arange(8):
        central = (f(q + h * direction) - f(q - h * direction)) / (2 * h)
        if not np.isfinite(central).all():
            row = []
            continue
        # Extrapolate with all steps before, and keep the value with the least remainder and noise
        new = [(central, 1.0 / (np.sqrt(2.0) * h))]
        for k, (before, gain) in enumerate(row):
            better, c = new[-1], 4.0 ** (k + 1)
            new.append(((c * better[0] - before) / (c - 1), (c * better[1] + gain) / (c - 1)))
            gaps = (np.linalg.norm(new[-1][0] - other, axis=0) for other in (better[0], before))
            error = np.maximum(*gaps) + new[-1][1] * noise * np.sqrt(len(central))
            if error.max() < best.error.max():
                best = Slope(new[-1][0], error, float(h))
        row = new
    return best


# --- Curvature of a strategy that is a Python function, from differences of its values, with what it may be wrong by.

OUTSIDE = (OwnFunctionError, NotFiniteError, SingularityError)
"""What a function may raise, or return, where it is not defined."""


@dataclass(frozen=True, eq=False)
class MeasuredCurvature(Result, Value):
    """F (n, m, m) at a posture, as `hk.curvature`, with `error` (m, m): how long what is wrong of F_ij may be.

    noise: standard deviation of the values of G [their units]. step: the shortest one that was used [joint units].
    """

    F: Array
    error: Matrix
    noise: float
    step: float

    @property
    def sizes(self) -> Matrix:
        """|F_ij| (m, m)."""
        return np.linalg.norm(self.F, axis=0)

    def __str__(self) -> str:
        i, j = np.unravel_index(int(self.sizes.argmax()), self.sizes.shape)
        return (
            f"the largest curvature is {self.sizes[i, j]:.3g} +- {self.error[i, j]:.1e}, of the task rows {i} and {j}; "
            f"by differences of values with a noise of {self.noise:.0e}, over steps down to {self.step:.0e}"
        )


@typed
def measured_curvature(strategy: NumericStrategy, q: ArrayLike) -> MeasuredCurvature:
    """F_ij = (1 - G J) (DG_j[G_i] - DG_i[G_j]) at q (n,), with the derivatives of `differences`.

    1 - G J projects on the self-motions along range G, so that F is the vertical part of the brackets (theory 1.1).

    Raises:
        OwnFunctionError, NotFiniteError, ShapeError, ArgumentError: as a call of the strategy at q.
    """
    q = strategy.task.robot.checked(q)
    G = strategy(q)
    lengths = np.linalg.norm(G, axis=0)

    def value(q: Vector) -> Array:
        try:
            return strategy.value(q)
        except OUTSIDE:
            return np.full(G.shape, np.nan)

    directions = np.ascontiguousarray((G / lengths).T)
    noise = max(noise_of(value, q, direction) for direction in directions)
    slopes = [slope(value, q, direction, noise) for direction in directions]
    vertical = np.eye(len(G)) - G @ strategy.task.jacobian(q)
    along = np.stack([d.value * length for d, length in zip(slopes, lengths, strict=True)])  # (i, n, j): DG_j[G_i]
    errors = np.stack([d.error * length for d, length in zip(slopes, lengths, strict=True)])
    brackets = along.transpose(1, 0, 2) - along.transpose(1, 2, 0)
    error = float(np.linalg.norm(vertical, 2)) * (errors + errors.T)
    np.fill_diagonal(error, 0.0)
    return MeasuredCurvature(np.einsum("ab,bij->aij", vertical, brackets), error, noise, min(d.step for d in slopes))


Method = Literal["auto", "hessian", "ad"]
"""How derivatives are made: by forward-kinematics Hessians, by automatic differentiation, or as the strategy allows."""

MOST_JOINTS = 100
"""Joints of a robot whose strategies are judged. Time and memory to write the curvature out grow with the third power
of their number, for a position on one core: 60 joints 2.4 s and 0.1 GB, 100 joints 7.7 s and 0.5 GB, 140 joints 17 s
and 1.3 GB."""


@typed
def curvature(strategy: Strategy, q: ArrayLike, *, method: Method = "auto") -> Array:
    """F (n, m, m) at q (n,): F[:, i, j] = F_ij = -F_ji [joint unit / (task unit i * task unit j)].

    At many postures (k, n) it is (k, n, m, m).

    Args:
        strategy: of a Python function the derivatives are differences; `analysis.measured_curvature` says how accurate.
        method: "hessian" takes F from the Hessians of the forward kinematics alone (theory 2a), for a constant weight
            and a position or twist task; "ad" differentiates the planes; "auto" takes the first where it can.

    Raises:
        SingularityError: the strategy is not defined at q, of many at the first such posture. ArgumentError: no
            Hessian form of this strategy. ShapeError, NotFiniteError: q is not n finite numbers.
    """
    if not isinstance(strategy, NumericStrategy):
        return _evaluator(strategy, _by_hessians(strategy, method)).call(q)
    if method != "auto":
        cure = f"{strategy.name!r} is a Python function without a formula: use 'auto'"
        raise ArgumentError("method", method, cure)
    if np.ndim(q) == 2:
        return np.array([measured_curvature(strategy, posture).F for posture in np.asarray(q)])
    return measured_curvature(strategy, q).F


def curvature_function(strategy: Strategy, method: Method = "auto") -> Function:
    """q -> (F_ij for i < j as columns (n, m(m-1)/2), G, rcond, margin), built once a strategy and method."""
    return _columns(strategy, _by_hessians(strategy, method))


def _by_hessians(strategy: Strategy, method: Method) -> bool:
    """Whether the Hessians of the arm give the curvature. Raises: ArgumentError."""
    if method not in get_args(Method):
        raise ArgumentError("method", method, "use 'auto', 'hessian' or 'ad'")
    weight = _constant_inverse_weight(strategy)
    if method == "hessian" and weight is None:
        cure = f"{strategy.name!r} needs a constant weight and a position or twist task for it: use 'ad'"
        raise ArgumentError("method", method, cure)
    return weight is not None and method != "ad"


def _constant_inverse_weight(strategy: Strategy) -> Matrix | None:
    """W (n, n) where the planes are spanned by W J^T, W constant, J geometric: the Hessians then give the brackets."""
    if not (isinstance(strategy, FrameStrategy) and strategy.task._geometric and strategy.task._has_hessians):
        return None
    return strategy.constant_inverse_weight


def curvature_unit(strategy: Strategy, i: int, j: int) -> str:
    """The unit of |F_ij|."""
    kinds = {c.unit for c in strategy.task.robot.coordinates}
    joint = kinds.pop() if len(kinds) == 1 else "joint unit"
    a, b = strategy.task.units[i], strategy.task.units[j]
    return f"{joint}/{a}^2" if a == b else f"{joint}/({a} {b})"


def pairs(m: int) -> list[tuple[int, int]]:
    """The planes (i, j), i < j, in the order of the columns."""
    return [(i, j) for i in range(m) for j in range(i + 1, m)]


@kept
def _evaluator(strategy: Strategy, by_hessians: bool) -> Evaluator:
    """(n,) -> F (n, m, m), or (k, n) -> (k, n, m, m), where the strategy is regular."""
    (q, outputs), m = _written(strategy, by_hessians), strategy.task.m
    signed = {(i, j): outputs["F"][:, k] for k, (i, j) in enumerate(pairs(m))}
    signed |= {(j, i): -F for (i, j), F in signed.items()} | {(i, i): SX.zeros(strategy.task.n, 1) for i in range(m)}
    full = horzcat(*(signed[i, j] for i in range(m) for j in range(m)))
    measures = {name: outputs[name] for name in ("rcond", "margin")}
    bounds = (TOLERANCES.singular, TOLERANCES.representation)
    function = Function("curvature_tensor", {"q": q}, {"F": densify(full), **measures})
    return function.checked((strategy.task.n, m, m), strategy.task.robot.checked, strategy._doubtful, bounds)


@kept
def _columns(strategy: Strategy, by_hessians: bool) -> Function:
    q, outputs = _written(strategy, by_hessians)
    return Function("curvature", {"q": q}, outputs)


@kept
def _written(strategy: Strategy, by_hessians: bool) -> tuple[SX, dict[str, SX]]:
    """q, and the outputs of `curvature_function` as expressions of it."""
    task, m = strategy.task, strategy.task.m
    if task.n > MOST_JOINTS:
        cure = f"its curvature is written out for at most {MOST_JOINTS}: lock some joints, or take a part of the arm"
        raise ArgumentError(f"the number of joints of {task.robot.name!r}", task.n, cure)
    e = strategy.expressions
    G, closed = e.rate(SX.eye(m), written_out=True), None
    if by_hessians:  # [W J_a^T, W J_b^T] = W (H_b W J_a^T - H_a W J_b^T), with the Hessians in closed form (theory 2a)
        H, W = task._hessians(e.q), as_expression(_constant_inverse_weight(strategy))
        closed = {(a, b): W @ (H[b] @ e.planes[:, a] - H[a] @ e.planes[:, b]) for a, b in pairs(m)}
    A, brackets = e.brackets(G.X, closed)
    N = null_space_expression(e.J)  # (30)
    along = factorise(A @ N)  # F_ij = N (A N)^-1 A [G_i, G_j]: the vertical part
    # (4): what of [G_i, G_j] lies outside range G
    columns = [N @ along.solve(vertcat(*(K[i, j] for K in brackets))) for i, j in pairs(m)]
    packed = horzcat(*columns) if columns and brackets else SX.zeros(task.n, max(1, len(columns)))
    return e.q, {"F": packed, "G": G.X, "rcond": G.rcond, "margin": strategy._margin_expression}


# --- Carrying a posture along a straight line in task coordinates by a strategy: dq = G(q) dx.

TRANSPORT_STEPS = 32
"""Runge-Kutta steps of one transport: on segments of 0.5 m and 0.5 rad the error is about 1e-8 rad."""


def transport(strategy: Strategy, q: Vector, dx: Vector, steps: int = TRANSPORT_STEPS) -> Vector:
    """The posture (n,) that the strategy leads to from q (n,) while x moves by dx (m,) at constant rates.

    Raises:
        SingularityError: on the way.
    """
    return straight_postures(strategy, q, dx, steps)[-1]


def straight_postures(strategy: Strategy, q: Vector, dx: Vector, steps: int = TRANSPORT_STEPS) -> Matrix:
    """The postures (steps + 1, n) of `transport`, from q to where it leads. Raises: SingularityError."""
    rate, postures = checked_rate(strategy), [q]
    for _ in range(steps):
        postures.append(runge_kutta(rate, postures[-1], 1.0 / steps, dx, dx, dx))
    return np.array(postures)
