"""The strategies: Moore-Penrose, weighted, physical, polynomial, as Python functions, and the whole family."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, Literal, final

import numpy as np

from ..base.arguments import made, typed
from ..base.errors import (
    ArgumentError,
    HolokinError,
    NotFiniteError,
    OwnFunctionError,
    ShapeError,
    SingularityError,
    UnknownNameError,
    brief,
    posture_text,
)
from ..base.types import Array, ArrayLike, Matrix, Vector, finite, frozen, number, numbers, whole
from ..robot import Kinematics, mass_matrix_expression
from ..symbolic import (
    SX,
    Function,
    as_expression,
    as_map,
    factorise,
    hessian,
    jacobian,
    solve,
    symbol,
    vertcat,
    written,
)
from ..symbolic.linear import null_space, null_space_expression
from .constraints import Constraint, Cost, as_gain, nothing_jumps
from .strategy import Expressions, Field, FrameStrategy, HolonomicStrategy, RowStrategy, Strategy
from .tasks.task import Task


@made
def moore_penrose(task: Task, *, name: str = "Moore-Penrose") -> FrameStrategy:
    """G = J^T (J J^T)^-1, the pseudo-inverse: least joint speed, and in general not holonomic. [KH83]"""
    frame = lambda task, k, q: task.jacobian_expression(k, q).T  # noqa: E731
    return FrameStrategy(name, task, frame, constant_inverse_weight=np.eye(task.n))


@made
def weighted(task: Task, weight: ArrayLike | Callable[[SX], Any], *, name: str = "weighted") -> FrameStrategy:
    """G = W J^T (J W J^T)^-1 with W = weight^-1: least dq^T weight dq. A joint that weighs more moves less.

    Args:
        weight: symmetric positive definite (n, n), constant, or a function q -> CasADi expression (n, n). It is the
            inverse of the W in [ZR11, (6)].

    Raises:
        ArgumentError: not symmetric positive definite (a function: at one of eight postures within the limits).
        ShapeError, NotFiniteError.
    """
    if callable(weight):
        q = symbol("q", task.n)
        value = written("the weight", weight, q)
        if value.shape != (task.n, task.n):
            raise ShapeError("the weight", (task.n, task.n), value.shape)
        function = Function("weight", {"q": q}, {"weight": value})
        for posture in _check_postures(task):
            place = np.array2string(posture, precision=3)
            _positive_definite(f"the weight at q = {place}", np.reshape(function(posture), (task.n, task.n)))
        # (6): the frame of G_W
        frame = lambda task, k, q: solve(written("the weight", weight, q), task.jacobian_expression(k, q).T)  # noqa: E731
        return FrameStrategy(name, task, frame)
    given = finite("the weight", weight, (task.n, task.n))
    _positive_definite("the weight", given)
    inverse = np.linalg.inv(given)
    W = frozen((inverse + inverse.T) / 2)
    # (6): the frame of G_W
    frame = lambda task, k, q: SX(W) @ task.jacobian_expression(k, q).T  # noqa: E731
    return FrameStrategy(name, task, frame, constant_inverse_weight=W)


def _positive_definite(what: str, W: np.ndarray) -> None:
    if not np.isfinite(W).all():
        raise NotFiniteError(what, W.tolist())
    if not np.allclose(W, W.T, rtol=1e-9, atol=1e-12 * np.abs(W).max()) or np.linalg.eigvalsh(W)[0] <= 0:
        raise ArgumentError(what, W.tolist(), "give a symmetric positive definite matrix")


def _check_postures(task: Task) -> np.ndarray:
    """Eight random postures within the limits and 1 of the allowed one nearest zero: they show a wrong formula."""
    lower, upper = task.robot.lower, task.robot.upper
    center = np.clip(0.0, lower, upper)
    low, high = np.maximum(center - 1.0, lower), np.minimum(center + 1.0, upper)
    return np.random.default_rng(0).uniform(low, high, (8, task.n))


@made
def null_basis(task: Task, N_G: Callable[[SX], Any], *, name: str = "null-basis") -> FrameStrategy:
    """The paper's general form (7): G = H H^T J^T (J H H^T J^T)^-1 with H = [N_G N], computed as N_G (J N_G)^-1.

    Holonomic exactly when N_G spans an involutive distribution; `involutivity` tells. [ZR11, Theorem III.2]

    Args:
        N_G: q -> CasADi expression (n, m), or nested lists of them.

    Raises:
        ShapeError (when first used): N_G is not (n, m).
    """
    # Theorem III.2: 2 => 1
    # Theorem III.3: N_G does not know how the task writes the orientation
    return FrameStrategy(name, task, lambda _task, _k, q: written(name, N_G, q))


@made
def holonomic(task: Task, g: Constraint, *, name: str | None = None) -> HolonomicStrategy:
    """The extended Jacobian of a constraint: G = [J; J_g]^-1 [1; 0], holonomic by construction. [Bai85]

    Raises:
        RowsError: g has not r = n - m rows.
    """
    strategy = HolonomicStrategy(name or g.name, task, g)
    strategy.looped.expressions  # noqa: B018  built now, so that a constraint that does not fit is refused here
    return strategy


@made
def pfaffian(task: Task, A: Callable[[SX], Any], *, name: str = "pfaffian") -> RowStrategy:
    """G = [J; A]^-1 [1; 0] for rows A(q) dq = 0 that need not be integrable; `involutivity` tells whether they are.

    Args:
        A: q -> CasADi expression (r, n), r = n - m.
    """
    return RowStrategy(name, task, lambda _task, _k, q: written(name, A, q))


@made
def right_inverse(task: Task, G: Callable[[SX], Any], *, name: str = "given") -> FrameStrategy:
    """Any right inverse that is given as a matrix: q -> G (n, m) with J G = 1.

    Unlike `null_basis`, which takes any frame of the planes and makes J G = 1 true, this one checks it.

    Raises:
        ShapeError: G is not (n, m). ArgumentError: J G is not 1, with the posture that shows it.
    """
    strategy = null_basis(task, G, name=name)
    for q in _check_postures(task):
        off = np.abs(task.jacobian(q) @ strategy.distribution(q) - np.eye(task.m)).max()
        if not off < 1e-6:
            place = np.array2string(q, precision=3)
            raise ArgumentError(
                f"|J G - 1| of {name!r} at q = {place}", float(off), "give a right inverse, or null_basis"
            )
    return strategy


@made
def coupled_twist(task: Task, gain: ArrayLike, *, name: str = "coupled (geometric)") -> RowStrategy:
    """w + Lambda v = 0: the paper's (28) with the geometric J_o in place of Euler angle rates.

    Not holonomic for Lambda != 0: (J_w + lambda J_p)[G_i, G_j] = -lambda^2 eps_ijk e_k (theory E3).

    Args:
        gain: Lambda in rad/m, a number or (3, 3).
    """
    L = as_gain(gain, (3, 3))
    return RowStrategy(name, task, lambda _t, k, _q: k.jacobian[3:, :] + SX(L) @ k.jacobian[:3, :])


# --- A strategy given as a Python function q -> G without a formula: any code that computes a right inverse.


@final
@dataclass(frozen=True, eq=False, repr=False)
class NumericStrategy(Strategy):
    """A strategy whose G is a Python function. Make one with `numeric`.

    Its derivatives are differences of its values. What needs a formula, as a proof, a compiled controller or C, raises
    an `ArgumentError`.
    """

    function: Callable[[Vector], Any]
    accuracy: float

    def __call__(self, q: ArrayLike) -> Matrix:
        """G(q), (n,) -> (n, m), as the function returns it.

        Raises:
            OwnFunctionError: the function raised. ShapeError, NotFiniteError: what it returned, or q.
            ArgumentError: J G is not 1 there.
        """
        posture = self.task.robot.checked(q)
        G = self.value(posture)
        if not np.isfinite(G).all():
            raise NotFiniteError(f"G of {self.name!r} at q = {posture.tolist()}", G.tolist(), "it must be finite there")
        J = self.task.jacobian(posture)
        off = float(np.abs(J @ G - np.eye(self.task.m)).max())
        if not off < self.accuracy * max(1.0, float(np.linalg.norm(J, 2) * np.linalg.norm(G, 2))):
            cure = "give a right inverse, without damping, or its accuracy: numeric(task, G, accuracy=...)"
            raise ArgumentError(f"|J G - 1| of {self.name!r} at q = {np.array2string(posture, precision=3)}", off, cure)
        return G

    def value(self, q: Vector) -> Matrix:
        """What the function returns at q (n,), in its shape (n, m), not checked for NaN.

        Raises:
            OwnFunctionError, ShapeError, NotFiniteError, ArgumentError.
        """
        q = self.task.robot.checked(q)
        try:
            answer = self.function(q.copy())
        except HolokinError:
            raise
        except Exception as problem:
            raise OwnFunctionError(
                repr(self.name),
                f"raised {type(problem).__name__}: {brief(problem)} at q = {posture_text(q)}",
                "correct it, or keep away from this posture",
                q,
                problem,
            ) from problem
        G = np.array(numbers(f"G of {self.name!r}", answer))
        if G.shape != (self.task.n, self.task.m):
            raise ShapeError(f"G of {self.name!r}", (self.task.n, self.task.m), G.shape, "rows are joints")
        return G

    def batch(self, Q: ArrayLike, *, threads: int | None = None) -> Array:
        """G at many postures, (k, n) -> (k, n, m), one after the other. Raises: as a call."""
        Q = self.task.robot.postures(Q)
        return np.array([self(q) for q in Q]).reshape(len(Q), self.task.n, self.task.m)

    def distribution(self, q: ArrayLike) -> Matrix:
        """G (n, m), the canonical frame (theory 1.4)."""
        return self(q)

    @cached_property
    def expressions(self) -> Expressions:
        """There are none. Raises: ArgumentError."""
        cure = "this needs its formula: give hk.strategies.right_inverse(task, G) with G in CasADi"
        raise ArgumentError("the strategy", f"{self.name!r}, a Python function", cure)

    def _check_finite(self, q: Vector) -> None:
        """A call has looked."""

    @cached_property
    def gain(self) -> Any:
        """q -> (G, rcond, representation margin)."""
        return _Calls(self, lambda q, G: G)

    @cached_property
    def rate(self) -> Any:
        """(q, dx) -> (dq = G dx, rcond, margin)."""
        return _Calls(self, lambda q, G, dx: G @ dx)


@dataclass(frozen=True)
class _Calls:
    """What a `Function` is to other strategies: a call, and the same over many postures."""

    strategy: NumericStrategy
    result: Callable[..., Array]

    def __call__(self, q: Vector, *more: Array) -> tuple[Array, float, float]:
        """(result, rcond 1 / (|J| |G|), 1)."""
        G = self.strategy(q)
        rcond = 1.0 / float(np.linalg.norm(self.strategy.task.jacobian(q), 2) * np.linalg.norm(G, 2))
        return self.result(q, G, *more), rcond, 1.0

    def batch(
        self, Q: Matrix, *more: Array, threads: int | None = None, out: Sequence[Array] | None = None, **_: Any
    ) -> tuple[Array, ...]:
        """The same over a leading axis."""
        answers = [self(q, *(array[i] for array in more)) for i, q in enumerate(Q)]
        made = tuple(np.array([row[k] for row in answers]) for k in range(3))
        for place, value in zip(out or (), made, strict=False):
            place[...] = value.reshape(place.shape)
        return made


@made
def numeric(
    task: Task,
    G: Callable[[Vector], Any],
    *,
    q0: ArrayLike | None = None,
    name: str = "given function",
    accuracy: float = 1e-6,
) -> NumericStrategy:
    """A right inverse as a Python function of NumPy: your own code, or a library's, judged as holokin's own strategies
    are.

    `curvature`, `involutivity`, `follow`, `drift`, `path_spread`, `simulate` and `audit` take it. Derivatives are
    differences of its values, and the verdict says how accurate they are. The function must be a function of q: it is
    called twice at some postures, in another order.

    Args:
        G: q (n,) -> (n, m) with J G = 1, an array or nested lists.
        q0: a posture (n,) about which it is defined, where it is tried; by default about zero, within the limits.
        accuracy: how far J G may be from 1, as a share of |J| |G|. Of code in single precision it is 1e-4.

    Raises:
        OwnFunctionError: G raises at all of eight postures, as a strategy that is defined elsewhere: give q0.
        ShapeError, NotFiniteError: G returns something else.
        ArgumentError: J G is not 1, with the number and the posture; G answers otherwise when it is called again, with
            the number.
    """
    if not 0 < number("accuracy", accuracy) < 1:
        raise ArgumentError("accuracy", accuracy, "give a number between 0 and 1")
    strategy = NumericStrategy(name, task, G, float(accuracy))
    if q0 is None:
        postures = _check_postures(task)
    else:  # it, and seven random postures within 0.05 of it
        moves = np.random.default_rng(0).uniform(-0.05, 0.05, (8, task.n))
        moves[0] = 0.0
        postures = task.robot.checked(q0, "the posture q0") + moves
    # At a few postures, then at the same in another order: it may raise at some, as at a singular one.
    first: dict[int, Matrix] = {}
    refused: HolokinError | None = None
    for i, q in enumerate(postures):
        try:
            first[i] = strategy(q)
        except (OwnFunctionError, NotFiniteError, SingularityError) as problem:
            refused = problem
    if refused is not None and not first:
        raise refused
    for i in reversed(first):
        off = float(np.abs(strategy(postures[i]) - first[i]).max())
        if off > 1e-6:  # less is noise, which the curvature is measured with
            cure = "give a function of q alone, without a random number, a memory or a warm start"
            raise ArgumentError(f"the change of G of {name!r} when it is called at one posture again", off, cure)
    return strategy


# --- Strategies with a physical reading: least kinetic energy, and an arm on springs.
#
# Both are weighted pseudo-inverses G = W J^T (J W J^T)^-1. They are written by the rows that annul range G, N^T W^-1 dq
# = 0, so W itself, the inverse of what is given, is never formed.

Force = Literal["pseudo-inverse", "stiffness"]
"""How the force at the tool is found from the joint torques: by J^+, or by the inverse that the stiffness weights."""


@made
def inertia_weighted(task: Task, *, name: str = "inertia-weighted") -> RowStrategy:
    """G = M^-1 J^T (J M^-1 J^T)^-1: least kinetic energy, the dynamically consistent inverse. [Kha87]

    M(q) is the mass matrix of the URDF's inertials. In general not holonomic.

    Raises:
        RobotFileError: the robot's description has no masses.
    """
    robot = task.robot
    mass_matrix_expression(robot, symbol("q", robot.n))  # so that missing masses are told here

    def rows(task: Task, k: Kinematics, q: SX) -> SX:
        return null_space_expression(task.jacobian_expression(k, q)).T @ mass_matrix_expression(task.robot, q)

    return RowStrategy(name, task, rows)


@made
def impedance(task: Task, potential: Cost, *, force: Force = "pseudo-inverse", name: str = "impedance") -> RowStrategy:
    """G = W J^T (J W J^T)^-1 with W = (K - Gamma)^-1: the arm on springs, pulled along at its tool. [MIH91]

    K = Hess U is the joint stiffness of the potential U, Gamma = sum_k F_k Hess f_k what the force F at the tool
    adds to it. F balances the springs as well as it can: F = (J^+)^T grad U ("pseudo-inverse"), or weighted by
    the stiffness, F = (J K^-1 J^T)^-1 J K^-1 grad U ("stiffness").

    Three variants stand in the literature under one name (theory 2d), and differ off equilibrium:
    (i) held at equilibrium, N^T grad U = 0, it is `holonomic(task, stationary(U))`;
    (ii) this one, with F from q: the same on that leaf; with one redundant joint it is holonomic everywhere, with
    g = n^T grad U / |n| (by "stiffness", K constant: / sqrt(n^T K n)), with more joints it is not;
    (iii) with F as a state: `impedance_with_memory`.

    Singular (ALGORITHMIC) where N^T (K - Gamma) N is: the arm buckles.

    Raises:
        ArgumentError: a task whose J is not df/dq (a twist). UnknownNameError: another `force`.
        ShapeError: U is not a scalar.
    """
    if force not in ("pseudo-inverse", "stiffness"):
        raise UnknownNameError("force of an impedance", force, ("pseudo-inverse", "stiffness"))
    check_exact(task)

    def rows(task: Task, k: Kinematics, q: SX) -> SX:
        slope, K = gradient_and_stiffness(task, k, q, potential)
        J = task.jacobian_expression(k, q)
        if force == "pseudo-inverse":
            F = factorise(J.T).solve(slope)  # least squares: (J^+)^T grad U
        else:
            compliance = factorise(K)
            F = factorise(J @ compliance.solve(J.T)).solve(J @ compliance.solve(slope))
        return null_space_expression(J).T @ (K - geometric_stiffness(task, k, q)(q, F))

    return RowStrategy(name, task, rows)


@typed
def gradient_and_stiffness(task: Task, k: Kinematics, q: SX, potential: Cost) -> tuple[SX, SX]:
    """grad U (n,) and K = Hess U (n, n). Raises: ShapeError."""
    U = potential.expression(task, k, q)
    if U.shape != (1, 1):
        raise ShapeError(f"the potential {potential.name!r}", (1, 1), U.shape, "give a scalar")
    return jacobian(U, q).T, hessian(U, q)


@typed
def geometric_stiffness(task: Task, k: Kinematics, q: SX) -> Callable[..., SX]:
    """The map (q, F) -> Gamma = sum_k F_k Hess f_k (n, n), the change of J^T F with F held."""
    F = symbol("F", task.m)
    return as_map([q, F], jacobian(task.jacobian_expression(k, q).T @ F, q))


def check_exact(task: Task) -> None:
    """Raises: ArgumentError: J of the task is not df/dq."""
    if not task._exact:
        raise ArgumentError(
            "the task of an impedance", task.name, "it needs coordinates: a position, 'rpy', 'zyz', 'rotation-vector'"
        )


# --- `fitted`: a holonomic strategy's leaves as polynomials, for use in a fast loop.
#
# A radial strategy integrates a ray at every call. Near a start its constraint is a smooth function of the tool pose x
# and one linear coordinate phi = Z^T q per redundant joint, so a polynomial in (x, phi) of low degree stands for it.
# Whatever the fit, the result is the gradient of a function: it is exactly holonomic, and only as near to the given
# strategy as the fit is good.

Terms = tuple[tuple[int, ...], ...]
"""For each monomial the variables that it multiplies; () is the constant."""


@made
def fitted(
    strategy: HolonomicStrategy,
    Q: ArrayLike,
    *,
    degree: int = 4,
    rows: tuple[int, ...] | None = None,
    name: str | None = None,
) -> HolonomicStrategy:
    """The holonomic strategy whose constraint is the polynomial in (x, phi) nearest to the given one's over Q.

    g_fit(q) = phi(q) + sum_a c_a u^a, u = (x - mean, phi - mean) / spread; the c_a are fitted by least squares to
    the values and the gradients of g at the postures, both at once. phi = Z^T (q - q_0), Z (n, r) the self-motions at
    the middle posture. Use it only where Q was.

    Args:
        strategy: one with leaves, for instance a `radial` strategy.
        Q: postures (k, n) of the region of use; a few hundred.
        degree: total degree of the polynomial; 4 has 70 terms in 4 variables, 330 in 7.
        rows: task rows it depends on, all by default; for constant orientation the position rows alone.

    Raises:
        ArgumentError: a strategy without leaves, a degree < 1, or too few postures to determine the terms. ShapeError.
    """
    task = strategy.task
    postures = frozen(finite("the postures", Q, ("k", task.n)))
    whole("degree", degree)
    chosen = list(range(task.m) if rows is None else rows)
    if not chosen or len(set(chosen)) != len(chosen) or not set(chosen) <= set(range(task.m)):
        raise ArgumentError("rows", rows, f"name some of the {task.m} task rows, from 0, each once")
    if not len(postures):
        raise ArgumentError("the number of postures", 0, "give a few hundred")
    # Coordinates (x, phi) of the postures about the middle one, scaled to -1 to 1.
    q0 = postures[np.argmin(np.linalg.norm(postures - postures.mean(axis=0), axis=1))]
    Z = null_space(task.jacobian(q0))
    chart = task._counted_from(task._place(q0)[1])  # rotation vectors jump half a turn from their reference
    x = chart.value_batch(postures)[:, chosen]
    u = np.hstack([x, (postures - q0) @ Z])
    middle, spread = u.mean(axis=0), np.maximum(np.abs(u - u.mean(axis=0)).max(axis=0), 1e-6)
    # Enough postures for the terms?
    exponents = monomials_up_to(u.shape[1], degree)[1:]  # without the constant, of which a leaf knows nothing
    if len(exponents) > len(postures) * (1 + len(chosen)):
        cure = f"give at least {len(exponents) // (1 + len(chosen)) + 1} postures, or a lower degree"
        raise ArgumentError(f"the number of postures for {len(exponents)} terms", len(postures), cure)

    def variables(_task: Task, k: Kinematics, q: SX) -> SX:
        phi = SX(Z.T) @ (q - SX(q0))
        return (vertcat(chart.value_expression(k)[chosen], phi) - SX(middle)) / SX(spread)

    # The coefficients by least squares, and the constraint that they make.
    others = [i for i in range(task.m) if i not in chosen]
    coefficients = _least_squares(strategy, postures, Z, q0, variables, exponents, others)

    def expression(task: Task, k: Kinematics, q: SX) -> SX:
        terms = monomials(variables(task, k, q), exponents)
        return SX(Z.T) @ (q - SX(q0)) + SX(coefficients.T) @ terms

    r, title = task.n - task.m, name or f"fitted {strategy.name}"
    return holonomic(task, Constraint(title, r, expression, (False,) * r, formulas=nothing_jumps))


def monomials_up_to(variables: int, degree: int) -> Terms:
    """All monomials of so many variables up to a degree, by increasing degree; the first is the constant."""
    return tuple(c for d in range(degree + 1) for c in combinations_with_replacement(range(variables), d))


def monomials(u: SX, terms: Terms) -> SX:
    """Monomials (t,) of u, each one product more than one of lower degree."""
    known: dict[tuple[int, ...], SX] = {(): SX(1)}
    for factors in terms:
        if factors:
            known[factors] = known[factors[:-1]] * u[factors[-1]]
    return vertcat(*(known[factors] for factors in terms))


def _least_squares(
    strategy: HolonomicStrategy, Q: Matrix, Z: Matrix, q0: Matrix, variables: Field, exponents: Terms, others: list[int]
) -> Matrix:
    """Coefficients (terms, r) from the values of g - phi, measured from their mean, and from its gradients.

    Gradients count in the directions that leave the task rows `others` alone, which the polynomial cannot follow.
    """
    # The monomials T (k, terms) and their slopes S at the postures; the values of g - phi and their slopes.
    task = strategy.task
    r = task.n - task.m
    q = symbol("q", task.n)
    terms = monomials(variables(task, task.kinematics(q), q), exponents)
    basis = Function("monomials", {"q": q}, {"terms": terms, "slopes": as_expression(jacobian(terms, q))})
    T, S = basis.batch(Q)
    g = strategy.constraint_value.batch(Q).reshape(len(Q), r)
    g = strategy.constraint.nearest(g - np.atleast_1d(strategy.constraint_value(q0)))  # angles count from the middle
    g = g - (Q - q0) @ Z
    slopes = strategy.rows(Q) - Z.T
    # One least-squares problem of both.
    span = float(np.abs(Q - q0).max()) or 1.0  # gradients count as the changes they make across the region
    J = task.jacobian_batch(Q)[0][:, others]
    free = span * np.swapaxes(null_space(J), 1, 2) if others else span * np.tile(np.eye(task.n), (len(Q), 1, 1))
    S = np.einsum("kdi,kti->kdt", free, S.reshape(len(Q), len(exponents), task.n))
    A = np.vstack([T - T.mean(axis=0), S.reshape(-1, len(exponents))])
    b = np.vstack([g - g.mean(axis=0), np.einsum("kdi,kri->kdr", free, slopes).reshape(-1, r)])
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-12)[0], dtype=float)


# --- All holonomic strategies: the paper's open question, answered by a parametrised inverse and a transport (theory
# 1.6).
#
# With an inverse K(x, z), f(K(x, z)) = x, over a contractible set of tool poses x, the complete holonomic strategies
# are exactly the maps Phi(x, .) of the redundancy coordinates z with Phi(x0, .) = identity: a leaf is q = K(x, Phi(x,
# z0)), z0 its label, and G = K_x + K_z dPhi/dx. Nothing is redundant in this description.


@made
def from_transport(
    task: Task,
    K: Callable[[SX, SX], Any],
    Phi: Callable[[SX, SX], Any],
    z: Callable[[SX], Any],
    *,
    around: ArrayLike,
    inverse: Callable[[SX, SX], Any] | None = None,
    center: ArrayLike | None = None,
    steps: int = 4,
    name: str = "from transport",
) -> HolonomicStrategy:
    """The holonomic strategy whose leaves are q = K(x, Phi(x, z0)): G = K_x + K_z dPhi/dx at z0 = Phi(x, .)^-1(z).

    Its constraint is the label z0(q), so it can be followed by leaf like every other.

    Args:
        K: (x (m,), z (r,)) -> q (n,), an inverse of the task with the redundancy coordinates z left open.
        Phi: (x, z0) -> z (r,), one to one in z0 for every x, the identity at `center`.
        z: q -> (r,), the redundancy coordinates of a posture: z(K(x, z)) = z.
        around: a posture (n,) near which all this is checked.
        inverse: (x, z) -> z0 with Phi(x, z0) = z in closed form. Without it z0 is continued by Newton's method
            from the center in `steps` steps, which asks for a Phi that turns little in each.
        center: x0 (m,); zero by default.

    Raises:
        ArgumentError: K does not invert the task, z does not invert K, Phi is not the identity at the center or
            its inverse is wrong; says by how much. ShapeError.
    """
    r = task.n - task.m
    x0 = np.zeros(task.m) if center is None else frozen(finite("the center", center, (task.m,)))
    whole("steps", steps)
    x, z0 = symbol("x", task.m), symbol("z0", r)
    phi = _sized("Phi", Phi(x, z0), (r, 1))
    transport = as_map([x, z0], phi)
    slope = as_map([x, z0], jacobian(phi, z0))

    def label(pose_value: SX, value: SX) -> SX:
        if inverse is not None:
            return _sized("the inverse of Phi", inverse(pose_value, value), (r, 1))
        coordinates = value  # at the center Phi is the identity
        last = [1.0] * 4  # Newton steps at the end: quadratic, so four reach round-off
        for share in [*((k + 1) / steps for k in range(steps - 1)), *last]:
            place = SX(x0) + share * (pose_value - SX(x0))
            gap = value - transport(place, coordinates)
            coordinates = coordinates + factorise(slope(place, coordinates)).solve(gap)
        return coordinates

    def expression(bound: Task, k: Kinematics, q: SX) -> SX:
        return label(bound.value_expression(k), _sized("z", z(q), (r, 1)))

    # The maps must fit each other: K, z and Phi at a few places near a posture.
    reached, near = _sized("K", K(x, z0), (task.n, 1)), task.robot.checked(around, "the posture to check around")
    gaps = {
        "f(K(x, z)) - x": task.value_expression(task.kinematics(reached)) - x,
        "z(K(x, z)) - z": as_expression(z(reached)) - z0,
        "Phi(x0, z) - z": transport(SX(x0), z0) - z0,
        "Phi(x, label(x, z)) - z": transport(x, label(x, z0)) - z0,
    }
    _check_maps(task, z, x, z0, gaps, near)
    # Further research: section VI of the paper, all holonomic strategies
    return holonomic(task, Constraint(name, r, expression, (False,) * r), name=name)


def _check_maps(task: Task, z: Callable[[SX], Any], x: SX, zs: SX, gaps: dict[str, SX], around: np.ndarray) -> None:
    """Raises: ArgumentError when the given maps do not fit each other at a few places near a posture.

    Args:
        gaps: what must be 0 everywhere, by its formula, as expressions of x (m,) and z (r,).
    """
    q, errors = symbol("q", task.n), Function("check", {"x": x, "z": zs}, gaps)
    coordinates = Function("z", {"q": q}, {"z": _sized("z", z(q), zs.shape)})
    for posture in around + 0.1 * np.random.default_rng(0).uniform(-1, 1, (4, task.n)):
        for what, error in zip(gaps, errors(task(posture), np.atleast_1d(coordinates(posture))), strict=True):
            if not np.abs(error).max() < 1e-8:  # m, rad
                place = np.array2string(posture, precision=3)
                raise ArgumentError(f"|{what}| near q = {place}", float(np.abs(error).max()), "it must be 0 everywhere")


def _sized(what: str, value: Any, shape: tuple[int, int]) -> SX:
    expression = as_expression(value)
    if expression.shape != shape:
        raise ShapeError(what, shape, expression.shape)
    return expression
