"""The Runge-Kutta step of order 4, for numbers and for expressions, and many of them as a loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from ..base.types import Vector
from .calculus import gradient, staged
from .native.transport import Pieces, Transport


def runge_kutta(rate: Callable[[Any, Any], Any], y: Any, h: float, start: Any, middle: Any, end: Any) -> Any:
    r"""y after a step h of y' = rate(y, u), u the input at its start, middle and end.

    $y + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4)$. y, u and the rates are NumPy arrays of any shape, or expressions.
    """
    k1 = rate(y, start)
    k2 = rate(y + h / 2 * k1, middle)
    k3 = rate(y + h / 2 * k2, middle)
    k4 = rate(y + h * k3, end)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def transport(
    begin: Callable[[ca.SX], ca.SX],
    rate: Callable[[ca.SX, ca.SX], tuple[ca.SX, ca.SX]],
    slope: Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]],
    miss: Callable[[ca.SX], ca.SX],
    end: Callable[..., tuple[ca.SX, ca.SX, ca.SX]],
    doubt: Callable[..., ca.SX],
    *,
    center: Vector,
    steps: int,
) -> Transport:
    """The loop of `steps` Runge-Kutta steps from share 0 to -1, of maps of expressions: see `Pieces` for what they are.

    Args:
        rate: (y, v) -> its first two results. slope: (y, v, w) -> what `pull` gives. end: without its slopes.
        doubt: (q, y, v, the gradient beside the planes of f (n,), and along them (m,), gaps, factor) -> what `back`
            gives besides.
        center: the posture (n,) over which the label is 0.
    """
    q, y, f, w = (ca.SX.sym(name, len(center)) for name in "qyfw")
    first, least = ca.SX.sym("first"), ca.SX.sym("least")
    began = begin(q)
    v = ca.SX.sym("v", *began.shape)
    (moved, rcond), (by_y, by_v), (label, margin, factor) = rate(y, v), slope(y, v, w), end(q, y, f, first, least)
    slopes = ca.horzcat(*(gradient(label[i], y).T for i in range(label.shape[0])))
    b, c, gaps, kept = ca.SX.sym("b", *v.shape), ca.SX.sym("c", *v.shape), ca.SX.sym("gaps", 2), ca.SX.sym("kept")

    def by_q(by_v: ca.SX) -> ca.SX:
        """The slopes w by y and those by v as slopes by q: v moves with it."""
        return w + gradient(by_v.T @ began, q).T

    n = len(center)
    found, left, values = staged(ca.vertcat(moved, rcond, by_y, by_v), ca.vertcat(y, v), w)
    pieces = Pieces(
        begin=_function("begin", [q], began),
        rate=_function("rate", [y, v], found[:n], found[n], values),
        pull=_function("pull", [left, w], found[n + 1 : 2 * n + 1], found[2 * n + 1 :]),
        miss=_function("miss", [y], miss(y)),
        end=_function("end", [q, y, f, first, least], label, margin, slopes, factor),
        back=_function(
            "back", [q, y, v, w, b, c, gaps, kept], kept * by_q(b), doubt(q, y, v, by_q(-c), b + c, gaps, kept)
        ),
    )
    size = label.shape[0] * (1 + n) + 1
    return Transport(pieces, steps, -1.0 / steps, ca.SX.sym("found", size), center)


def _function(name: str, inputs: list[ca.SX], *outputs: ca.SX) -> ca.Function:
    return ca.Function(name, inputs, ca.cse([ca.densify(output) for output in outputs]))
