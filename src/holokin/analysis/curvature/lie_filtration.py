"""How much of the joint space can loops of the tool reach? De Luca and Oriolo's filtration. [DO97]"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, SingularityError, UndecidedError, posture_text
from ...base.types import Array, ArrayLike, Matrix, NoTruthValue, Vector, kept
from ...strategies import Strategy
from ...symbolic import SX, Function, horzcat, lie_bracket
from .involutive import HIDDEN_ROUNDOFF, is_shown, noise, nudged, spread

Word = Any
"""How a field is made: the number of a column of G, or (number, word) for the bracket of a column with a field."""


class Integrability(NoTruthValue, Enum, ask="`is Integrability.HOLONOMIC`"):
    """What closed tool paths can do to the joints, near a posture."""

    HOLONOMIC = "small closed tool paths bring the joints back to their start"
    PARTLY = "partly non-holonomic: closed tool paths carry the joints over a part of their self-motions"
    COMPLETELY = "completely non-holonomic: closed tool paths can carry the joints along every self-motion"


@dataclass(frozen=True)
class Filtration(NoTruthValue, ask="`.integrability`"):
    """Dimensions near the posture of D_0 = range G, D_1 = D_0 + [D_0, D_0], D_{k+1} = D_k + [D_0, D_k], till it stops.

    It speaks of a small neighbourhood of the posture alone; `involutivity` looks at a region.
    """

    dimensions: tuple[int, ...]
    m: int
    n: int

    @property
    def reached(self) -> int:
        """The dimension at which it stops."""
        return self.dimensions[-1]

    @property
    def integrability(self) -> Integrability:
        """m: holonomic; n: completely non-holonomic; between: partly."""
        if self.reached == self.m:
            return Integrability.HOLONOMIC
        return Integrability.COMPLETELY if self.reached == self.n else Integrability.PARTLY

    def __str__(self) -> str:
        return f"{self.integrability.value}: {' -> '.join(map(str, self.dimensions))} of {self.n}"


@typed
def filtration(strategy: Strategy, q: ArrayLike, *, most: int = 4) -> Filtration:
    """The growth of the strategy's planes under brackets with themselves near q (n,).

    A bracket adds a dimension if its part outside the others is more than 1e-13 of its factors' lengths and stands out
    of its round-off, which is measured at nudged copies of the posture (see `roundoff`). Besides q two postures
    1e-3 away are looked at, and the largest dimensions of the three taken, so that a q at which a bracket happens to
    vanish is not mistaken. Only brackets that add a dimension are bracketed again, so the growth may be slower than
    the true one but stops at the same place.

    Args:
        most: brackets of at most this depth.

    Raises:
        SingularityError: the strategy is singular at q. ArgumentError: it still grew at depth `most`.
        UndecidedError: too near a singularity to be decided: round-off passes 1e-6 of a bracket.
    """
    task = strategy.task
    posture = task.robot.checked(q)
    strategy(posture)
    # The columns of G, at q and beside it
    centres = _centres(strategy, posture)
    columns: list[Word] = list(range(task.m))
    fields = _values(strategy, columns, centres)
    lengths = np.linalg.norm(fields.mean(axis=1), axis=1)  # (c, m)
    growths = [_Growth(fields[c]) for c in range(len(centres))]
    scales: dict[Word, Vector] = {i: lengths[:, i] for i in range(task.m)}
    newest, dimensions = columns, [task.m]
    for _ in range(most):
        if dimensions[-1] == task.n:
            break
        # Brackets of the columns with what was added last; of two columns once, since [a, b] = -[b, a]
        words = [(a, b) for a in columns for b in newest if a != b and (newest is not columns or a < b)]
        fields, added = _values(strategy, words, centres), []
        for k, (a, b) in enumerate(words):
            scales[a, b] = scales[a] * scales[b]
            grown = [growth.takes(fields[c, ..., k], scales[a, b][c]) for c, growth in enumerate(growths)]
            added += [(a, b)] if any(grown) else []
        if not added:
            break
        dimensions.append(max(growth.dimension for growth in growths))
        newest = added
    else:
        if dimensions[-1] < task.n:
            raise ArgumentError("most", most, f"the filtration still grows: {dimensions}; allow more")
    if dimensions[-1] < task.n and growths[0].hidden > HIDDEN_ROUNDOFF:
        raise UndecidedError(
            f"{strategy.name!r} cannot be judged at q = {posture_text(posture)}: "
            f"round-off makes {growths[0].hidden:.1e} of a bracket there, and a real one could hide in it",
            "choose a posture farther from singularities",
            posture,
            growths[0].hidden,
        )
    return Filtration(tuple(dimensions), task.m, task.n)


class _Growth:
    """An orthonormal basis at every copy of a posture, (COPIES, n, d), that takes in what is independent of it.

    `hidden`: the largest share of a bracket's scale that round-off may have hidden among those not taken.
    """

    def __init__(self, fields: Array) -> None:
        self._basis = np.linalg.qr(fields)[0]
        self.hidden = 0.0

    @property
    def dimension(self) -> int:
        """Number of independent fields."""
        return self._basis.shape[2]

    def takes(self, field: Matrix, scale: float) -> bool:
        """Grow by a field (COPIES, n) if it is independent; True if so."""
        if self.dimension == field.shape[1]:
            return False
        rest = field
        for _ in range(2):
            rest = rest - np.einsum("knd,kjd,kj->kn", self._basis, self._basis, rest)
        mean, scatter = (part[0, ..., 0] for part in spread(rest[None, :, :, None]))
        # Rounded constants of a robot, cos(pi / 2) = 6e-17, make errors of up to 1e-13 that no nudge scatters
        size = float(np.linalg.norm(mean))
        if size > 1e-13 * scale and is_shown(size, float(scatter)):
            direction = rest / np.linalg.norm(rest, axis=1)[:, None]
            self._basis = np.concatenate([self._basis, direction[:, :, None]], axis=2)
            return True
        self.hidden = max(self.hidden, float(noise(scatter)) / scale)
        return False


def _centres(strategy: Strategy, posture: Vector) -> Matrix:
    """The posture, and two beside it where the strategy is regular.

    They are 1e-3 joint units away: far enough that a bracket that vanishes at q alone, as the curvature does where
    small loops do not drift, shows there; near enough to be the same place.
    """
    centres = [posture]
    for q in posture + 1e-3 * np.random.default_rng(0).choice([-1.0, 1.0], (2, len(posture))):
        with suppress(SingularityError):
            strategy(q)
            centres.append(q)
    return np.array(centres)


def _values(strategy: Strategy, words: list[Word], centres: Matrix) -> Array:
    """Fields at nudged copies of postures (c, n): (c, COPIES, n, fields)."""
    copies = nudged(centres)
    if not words:
        return np.zeros((*copies.shape, 0))
    fields = _fields(strategy, tuple(words)).batch(copies.reshape(-1, centres.shape[1]))
    return fields.reshape(*copies.shape, len(words))


@kept
def _fields(strategy: Strategy, words: tuple[Word, ...]) -> Function:
    q = strategy.expressions.q
    return Function("fields", {"q": q}, {"B": horzcat(*(_field(strategy, word) for word in words))})


@kept
def _field(strategy: Strategy, word: Word) -> SX:
    if isinstance(word, int):
        return _frame(strategy)[:, word]
    return lie_bracket(_field(strategy, word[0]), _field(strategy, word[1]), strategy.expressions.q)


@kept
def _frame(strategy: Strategy) -> SX:
    return strategy.expressions.rate(SX.eye(strategy.task.m), written_out=True).X
