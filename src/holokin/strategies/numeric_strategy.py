"""A strategy given as a Python function q -> G without a formula: any code that computes a right inverse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from ..base.arguments import made
from ..base.errors import ArgumentError, FunctionError, HolokinError, NotFiniteError, ShapeError, SingularityError
from ..base.types import Array, ArrayLike, Matrix, Vector, number, numbers
from .gain_expressions import Expressions
from .right_inverses import check_postures
from .strategy import Strategy
from .tasks.task import Task

AGAIN = 1e-6
"""Difference of G [joint unit / task unit] between two calls at one posture that is no noise: as large as what J G may
be away from 1. A smaller one counts as noise, which the curvature is measured with."""


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
            FunctionError: the function raised. ShapeError, NotFiniteError: what it returned, or q.
            ArgumentError: J G is not 1 there.
        """
        at = self.task.robot.checked(q)
        G = self.value(at)
        if not np.isfinite(G).all():
            raise NotFiniteError(f"G of {self.name!r} at q = {at.tolist()}", G.tolist(), "it must be finite there")
        J = self.task.jacobian(at)
        off = float(np.abs(J @ G - np.eye(self.task.m)).max())
        if not off < self.accuracy * max(1.0, float(np.linalg.norm(J, 2) * np.linalg.norm(G, 2))):
            cure = "give a right inverse, without damping, or its accuracy: numeric(task, G, accuracy=...)"
            raise ArgumentError(f"|J G - 1| of {self.name!r} at q = {np.array2string(at, precision=3)}", off, cure)
        return G

    def value(self, q: Vector) -> Matrix:
        """What the function returns at q (n,), in its shape (n, m), not checked for NaN.

        Raises:
            FunctionError, ShapeError, ArgumentError.
        """
        try:
            found = self.function(q.copy())
        except HolokinError:
            raise
        except Exception as problem:
            raise FunctionError(self.name, q, problem) from problem
        G = np.array(numbers(f"G of {self.name!r}", found))
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
        found = [self(q, *(one[i] for one in more)) for i, q in enumerate(Q)]
        made = tuple(np.array([row[k] for row in found]) for k in range(3))
        for place, value in zip(out or (), made, strict=False):
            place[...] = value.reshape(place.shape)
        return made


@made
def numeric(
    task: Task, G: Callable[[Vector], Any], *, q0: ArrayLike | None = None, name: str = "given function",
    accuracy: float = 1e-6,
) -> NumericStrategy:  # fmt: skip
    """A right inverse as a Python function of NumPy: your own code, or a library's, judged as holokin's own laws are.

    `curvature`, `involutivity`, `follow`, `drift`, `path_spread`, `simulate` and `audit` take it. Derivatives are
    differences of its values, and the verdict says how accurate they are. The function must be a function of q: it is
    called twice at some postures, in another order.

    Args:
        G: q (n,) -> (n, m) with J G = 1, an array or nested lists.
        q0: a posture (n,) about which it is defined, where it is tried; by default about zero, within the limits.
        accuracy: how far J G may be from 1, as a share of |J| |G|. Of code in single precision it is 1e-4.

    Raises:
        FunctionError: G raises at all of eight postures, as a law that is defined elsewhere: give q0. ShapeError,
            NotFiniteError: G returns something else. ArgumentError: J G is not 1, with the number and the posture; G
            answers otherwise when it is called again, with the number.
    """
    if not 0 < number("accuracy", accuracy) < 1:
        raise ArgumentError("accuracy", accuracy, "give a number between 0 and 1")
    strategy = NumericStrategy(name, task, G, float(accuracy))
    postures = check_postures(task) if q0 is None else _about(task.robot.checked(q0, "the posture q0"))
    first: dict[int, Matrix] = {}
    refused: HolokinError | None = None
    for i, q in enumerate(postures):
        try:
            first[i] = strategy(q)
        except (FunctionError, NotFiniteError, SingularityError) as problem:  # as at a singular posture
            refused = problem
    if refused is not None and not first:
        raise refused
    for i in reversed(first):
        off = float(np.abs(strategy(postures[i]) - first[i]).max())
        if off > AGAIN:
            cure = "give a function of q alone, without a random number, a memory or a warm start"
            raise ArgumentError(f"the change of G of {name!r} when it is called at one posture again", off, cure)
    return strategy


def _about(q0: Vector) -> Matrix:
    """q0, and seven random postures within 0.05 of it."""
    moves = np.random.default_rng(0).uniform(-0.05, 0.05, (8, len(q0)))
    moves[0] = 0.0
    return q0 + moves
