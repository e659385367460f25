"""A transport amid a `Function`: a loop that straight-line code would make hundreds of thousands of lines of.

A posture q is carried to y(1) by y' = f(y, v), in Runge-Kutta steps of order 4 with a v of its own; a label of y(1) and
its gradient by q stand in expressions as symbols. The gradient is one sweep back through the steps for each row of the
label, from what each evaluation of f has left behind, so it is that of the steps themselves, to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, reduce
from typing import Any

import casadi as ca

from ...base.types import Vector
from .emit import emit, prelude

SHARES, WEIGHTS = (0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""Runge-Kutta of order 4: where its four rates are taken, and how they count."""

MOST_KEPT = 4096
"""Numbers that C keeps of all rates for the sweep back; a Panda's 4 steps leave 2,240. Of more steps it takes the rates
twice, for half as much time again, and keeps those of one step: threads have little memory for calls."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight-line code of a transport, n joints, m numbers in v, r rows in the label, k numbers left behind.

    begin: q -> v.
    rate: (y, v) -> f(y, v) (n,), rcond, what `pull` needs of this evaluation (k,).
    pull: (what `rate` left, w (n,)) -> gradients of w^T f by y (n,) and by v (m,).
    miss: y(1) -> the v (m,) that is still missing there.
    end: (q, y(1), f of what is missing, rcond at q, least rcond) -> label (r,), margin, its slopes by y(1) (n, r), and
        a factor on the gradient, 0 where it is of no use.
    back: (q, y(1), v, slopes by q as a posture (n,) and by v (m,), the first of them times df/dv (m,), squares of the
        gaps of the sweep, of both slopes (2,), the factor) -> the gradient by q (n,), what its error takes off the
        margin.
    """

    begin: ca.Function
    rate: ca.Function
    pull: ca.Function
    miss: ca.Function
    end: ca.Function
    back: ca.Function

    def each(self) -> dict[str, ca.Function]:
        """By their names."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True, eq=False)
class Transport:
    """The loop over its pieces: q (n,) -> label (r,), its gradient by rows (r n,), margin, one after another.

    `found` are the symbols that stand for these in the expressions of a `Function` of q; h is the size of a step;
    `center` (n,) is the posture over which the label is 0.
    """

    pieces: Pieces
    steps: int
    h: float
    found: ca.SX
    center: Vector

    @property
    def rows(self) -> int:
        """r, the rows of the label."""
        return self.pieces.end.size1_out(0)

    @property
    def joints(self) -> int:
        """n, the numbers of a posture."""
        return self.pieces.begin.size1_in(0)

    @property
    def label(self) -> ca.SX:
        """The symbols of the label (r,)."""
        return self.found[: self.rows]

    @property
    def gradient(self) -> ca.SX:
        """The symbols of the gradient (r, n)."""
        return ca.reshape(self.found[self.rows : -1], self.joints, self.rows).T

    @property
    def margin(self) -> ca.SX:
        """The symbol of the margin."""
        return self.found[-1]

    @property
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """The symbols of the label, the gradient and the margin."""
        return self.label, self.gradient, self.margin

    @property
    def lengths(self) -> dict[str, int]:
        """Operations of the pieces, as many as there are lines of C."""
        return {name: piece.n_instructions() for name, piece in self.pieces.each().items()}

    def operations(self, sloping: bool) -> int:
        """Operations of a call, with the gradient or without."""
        size, rates = self.lengths, 4 * self.steps
        label = size["begin"] + (rates + 1) * size["rate"] + size["miss"] + size["end"]
        again = 0 if rates * self.pieces.pull.size1_in(0) <= MOST_KEPT else rates * size["rate"]
        return label + sloping * self.rows * ((rates + 1) * size["pull"] + again + size["back"])

    @cached_property
    def function(self) -> ca.Function:
        """The loop for the virtual machine."""
        q = ca.MX.sym("q", self.joints)
        label, gradient, margin = self(q)
        return ca.Function("transport", [q], [ca.vertcat(label, ca.vec(gradient.T), margin)])

    def __call__(self, q: Any) -> tuple[Any, Any, Any]:
        """(label (r,), gradient (r, n), margin) at q (n,), of SX written out, of MX as calls of the pieces."""
        p, h, none = self.pieces, self.h, type(q).zeros
        v, y = p.begin(q), q
        left, rconds = [], []
        for _ in range(self.steps):
            total, f = 0, none(self.joints)
            for share, weight in zip(SHARES, WEIGHTS, strict=True):
                f, rcond, behind = p.rate(y + share * h * f, v)
                total, left, rconds = total + weight * f, [*left, behind], [*rconds, rcond]
            y = y + h * total
        label, margin, slopes, factor = p.end(q, y, p.rate(y, p.miss(y))[0], rconds[0], reduce(ca.fmin, rconds))
        gradients = []
        for row in range(self.rows):
            by_y, by_v, gaps, ahead = slopes[:, row], none(v.shape[0]), none(2), None
            for step in reversed(range(self.steps)):
                of_end, found = by_y, (0, 0)
                for stage in reversed(range(4)):
                    into = SHARES[stage + 1] * found[0] if stage < 3 else 0
                    found = p.pull(left[4 * step + stage], h * (WEIGHTS[stage] * of_end + into))
                    if stage == 3 and ahead is not None:
                        gaps = gaps + _gaps(ahead, found)
                    by_y, by_v = by_y + found[0], by_v + found[1]
                ahead = found
            first = p.pull(left[0], h * WEIGHTS[0] * by_y)
            gaps = gaps + _gaps(ahead, first)
            moved, doubt = p.back(q, y, v, by_y, by_v, first[1] / (h * WEIGHTS[0]), gaps, factor)
            gradients, margin = [*gradients, moved.T], ca.fmax(margin - doubt, 0)
        return label, ca.vertcat(*gradients), margin

    @cached_property
    def c(self) -> str:
        """C of `static void hk_transport(const hk_t *q, hk_t *found, int sloping)`; it counts once in a file."""
        sizes = {
            "N": self.joints, "M": self.pieces.begin.size1_out(0), "R": self.rows,
            "K": self.pieces.pull.size1_in(0), "S": self.steps, "H": repr(self.h),
            "MOST": MOST_KEPT,
        }  # fmt: skip
        head = "".join(f"#define HK_TRANSPORT_{key} {value}\n" for key, value in sizes.items())
        pieces = "".join(_piece(name, piece) for name, piece in self.pieces.each().items())
        return f"#ifndef HK_TRANSPORT\n#define HK_TRANSPORT\n{head}{pieces}{prelude('transport.c')}#endif\n"


def _gaps(one: Any, other: Any) -> Any:
    """Squares of the differences (2,) of two pairs of slopes."""
    return ca.vertcat(*(ca.sumsqr(a - b) for a, b in zip(one, other, strict=True)))


def _piece(name: str, piece: ca.Function) -> str:
    """C of a piece: pointers to its inputs, then to its outputs, each in CasADi's order."""
    given = [f"const hk_t *restrict x{i}" for i in range(piece.n_in())]
    found = [f"hk_t *restrict y{i}" for i in range(piece.n_out())]
    idle = "".join(f"  (void)x{i};\n" for i in range(piece.n_in()))
    code = emit(piece, name, lambda a, i: f"x{a}[{i}]", lambda a, i: f"y{a}[{i}]")
    return f"static void hk_transport_{name}({', '.join([*given, *found])}) {{\n{idle}{code}\n}}\n"
