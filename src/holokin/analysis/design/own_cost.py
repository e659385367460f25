"""`OwnCost`: a cost of a design that the user writes, of an expression of the joints or a function of numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arguments import check
from ...base.errors import ArgumentError, OwnFunctionError, ShapeError
from ...base.own_number import own_number
from ...base.types import Matrix, Value, Vector, kept, positive
from ...symbolic import SX, Function, gradient, symbol, written

STEP = 1e-6
"""Of the differences that give the slope of a function of numbers [joint units]."""


@dataclass(frozen=True, eq=False)
class OwnCost(Value):
    """The mean over the poses of c(q), a number of the joints (n,) that a design makes less.

    Give one of the two: expression: a CasADi expression of q, as for `hk.custom`, with exact derivatives. function: of
    numbers, q (n,) -> a float; its slope takes 2 n calls for each posture.
    """

    name: str
    expression: Callable[[SX], Any] | None = None
    function: Callable[[Vector], Any] | None = None
    weight: float = 1.0

    def __post_init__(self) -> None:
        check("the name of a cost", str, self.name)
        if (self.expression is None) is (self.function is None):
            raise ArgumentError(f"what the cost {self.name!r} is of", None, "give it expression= or function=")
        check("expression", Callable[..., Any] | None, self.expression)
        check("function", Callable[..., Any] | None, self.function)
        positive(f"the weight of {self.name}", self.weight)
        super().__post_init__()

    def values(self, Q: Matrix) -> Vector:
        """c at postures (k, n) -> (k,). Raises: OwnFunctionError: it is no finite number there."""
        if self.function is not None:
            return np.array([self._number(q) for q in Q]).reshape(len(Q))
        return self._sound(Q, np.asarray(_expressed(self, Q.shape[1]).batch(Q)[0]))

    def slopes(self, Q: Matrix) -> Matrix:
        """dc/dq at postures (k, n) -> (k, n). Raises: as `values`."""
        if self.function is None:
            found = np.asarray(_expressed(self, Q.shape[1]).batch(Q)[1]).reshape(Q.shape)
            return self._sound(Q, found)
        steps = STEP * np.eye(Q.shape[1])
        ahead, behind = (np.column_stack([self.values(Q + side * step) for step in steps]) for side in (1.0, -1.0))
        return (ahead - behind) / (2 * STEP)

    def _number(self, q: Vector) -> float:
        found = own_number(f"the cost {self.name!r}", self.function or float, q.copy())
        if found is None:
            raise OwnFunctionError(f"the cost {self.name!r}", f"gives None at q = {q.tolist()}", "give a number")
        return found

    def _sound(self, Q: Matrix, found: Any) -> Any:
        bad = ~np.isfinite(found.reshape(len(Q), -1)).all(axis=1)
        if bad.any():
            at = Q[int(np.argmax(bad))].tolist()
            fact = f"gives a number or a slope that is not finite at q = {at}"
            raise OwnFunctionError(f"the cost {self.name!r}", fact, "look for a division by zero, a log or a sqrt")
        return found


@kept
def _expressed(cost: OwnCost, n: int) -> Function:
    """q -> (c, dc/dq (n,)). Raises: ExpressionError, ShapeError."""
    q, what = symbol("q", n), f"the cost {cost.name!r}"
    c = written(what, cost.expression or abs, q)
    if c.shape != (1, 1):
        raise ShapeError(what, (1, 1), c.shape, "give one number")
    return Function("own_cost", {"q": q}, {"c": c, "slope": gradient(c, q)})
