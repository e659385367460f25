"""How much of the joint space can loops of the tool reach? De Luca and Oriolo's filtration. [DO97]"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..errors import ArgumentError
from ..strategy import Strategy
from ..symbolic import SX, Function, horzcat, lie_bracket
from ..types import ArrayLike, Vector

RANK = 1e-9
"""Share of a unit field below which a bracket is called dependent: far above round-off, far below any real defect."""


class Holonomy(Enum):
    """What closed tool paths can do to the joints."""

    HOLONOMIC = "closed tool paths bring the joints home"
    PARTLY = "partly non-holonomic: closed tool paths carry the joints over a part of their self-motions"
    COMPLETELY = "completely non-holonomic: closed tool paths can carry the joints to any posture of the tool pose"


@dataclass(frozen=True)
class Filtration:
    """Dimensions at the posture of D_0 = range G, D_1 = D_0 + [D_0, D_0], D_{k+1} = D_k + [D_0, D_k], till it stops."""

    dimensions: tuple[int, ...]
    m: int
    n: int

    @property
    def reached(self) -> int:
        """The dimension at which it stops."""
        return self.dimensions[-1]

    @property
    def holonomy(self) -> Holonomy:
        """m: holonomic; n: completely non-holonomic; between: partly."""
        if self.reached == self.m:
            return Holonomy.HOLONOMIC
        return Holonomy.COMPLETELY if self.reached == self.n else Holonomy.PARTLY

    def __str__(self) -> str:
        return f"{' -> '.join(map(str, self.dimensions))} of {self.n}: {self.holonomy.value}"


def filtration(strategy: Strategy, q: ArrayLike, *, most: int = 4) -> Filtration:
    """The growth of the strategy's planes under brackets with themselves, at q (n,); regular points are meant.

    Only brackets that add a dimension are bracketed again, so the growth may be slower than the true one but
    stops at the same place.

    Args:
        most: brackets of at most this depth.

    Raises:
        SingularityError: the strategy is singular at q. ArgumentError: it still grew at depth `most`.
    """
    task = strategy.task
    posture = task.robot.checked(q)
    strategy(posture)
    e = strategy.expressions
    G = e.rate(SX.eye(task.m), written_out=True).X
    fields = [G[:, i] for i in range(task.m)]
    basis = _orthonormal([], _values(e.q, fields, posture))
    newest, dimensions = fields, [len(basis)]
    for _ in range(most):
        if len(basis) == task.n:
            break
        candidates = [lie_bracket(a, b, e.q) for a in fields for b in newest if a is not b]
        if newest is fields:  # [a, b] = -[b, a]
            candidates = [lie_bracket(fields[i], fields[j], e.q) for i in range(task.m) for j in range(i + 1, task.m)]
        kept: list[SX] = []
        for field, value in zip(candidates, _values(e.q, candidates, posture), strict=True):
            grown = _orthonormal(basis, [value])
            if len(grown) > len(basis):
                basis = grown
                kept.append(field)
        if not kept:
            break
        dimensions.append(len(basis))
        newest = kept
    else:
        if len(basis) < task.n:
            raise ArgumentError("most", most, f"the filtration still grows: {dimensions}; allow more")
    return Filtration(tuple(dimensions), task.m, task.n)


def _values(q: SX, fields: list[SX], posture: Vector) -> list[Vector]:
    if not fields:
        return []
    values = np.asarray(Function("fields", {"q": q}, {"B": horzcat(*fields)})(posture)).reshape(len(posture), -1)
    return list(values.T)


def _orthonormal(basis: list[Vector], more: list[Vector]) -> list[Vector]:
    """A basis grown by what of `more` is independent of it."""
    out = list(basis)
    for v in more:
        size = np.linalg.norm(v)
        rest = v / size if size > RANK else np.zeros_like(v)
        for _ in range(2):
            for b in out:
                rest = rest - (b @ rest) * b
        if np.linalg.norm(rest) > RANK:
            out.append(rest / np.linalg.norm(rest))
    return out
