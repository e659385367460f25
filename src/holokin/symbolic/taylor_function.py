"""Expressions over boxes of their arguments by Taylor models of degree two. [Makino and Berz 2003]

A model is c + L . y + sum_i<=j Q_ij y_i y_j + e with |y_i| <= 1 and |e| <= r. What two models have in common cancels up
to second order as it does in numbers: a bound is too wide by what is of third order in the size of the box. So a chain
of many rotations is enclosed well, where intervals of its derivatives grow from each factor to the next.

All rounding is in r: in each operation it is below `_ROUND` times the size of what goes in.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np

from ..base.types import Array, Flags, Indices
from .interval_function import LayeredFunction
from .intervals import Interval

_ROUND, _UP, _TINY = 2.0**-47, 1 + 2.0**-45, 1e-290
"""Of less than 60 roundings of 2^-53 each; as many more, as a factor; what underflow loses."""


@cache
def pairs(d: int) -> tuple[Indices, Indices, Flags]:
    """(i, j) of the pairs i <= j of d variables, and which of them are squares."""
    i, j = np.triu_indices(d)
    return i, j, i == j


class Taylor(NamedTuple):
    """All numbers c + L . y + Q : y y + e: c and r (..., k), L (..., d, k), Q (..., d (d + 1) / 2, k)."""

    c: Array
    L: Array
    Q: Array
    r: Array

    @property
    def bent(self) -> Array:
        """The size of what is of second order and more."""
        return np.abs(self.Q).sum(axis=-2) + self.r

    @property
    def bounds(self) -> Interval:
        """The least interval around them, but for what products of two variables have in common with the others."""
        square = pairs(self.L.shape[-2])[2]
        mixed = np.abs(self.Q[..., ~square, :]).sum(axis=-2) + self.r
        Q, L = self.Q[..., square, :], np.abs(self.L)
        with np.errstate(all="ignore"):  # the ends of L y + Q y^2, and its extreme between them
            between = -L * L / (4 * Q)
            low = np.where(2 * Q > L, between, Q - L).sum(axis=-2)
            high = np.where(2 * Q < -L, between, Q + L).sum(axis=-2)
        off = mixed * _UP + (np.abs(self.c) + L.sum(axis=-2) + self.bent) * _ROUND
        low, high = self.c + low - off, self.c + high + off
        lost = ~(np.isfinite(low) & np.isfinite(high))
        return Interval(np.where(lost, -np.inf, low), np.where(lost, np.inf, high))


def _row(x: Any) -> Any:
    return x[..., None, :]


def _product(L: Array, M: Array) -> Array:
    """Q of (L . y) (M . y)."""
    i, j, square = pairs(L.shape[-2])
    both = L[..., i, :] * M[..., j, :]
    both += L[..., j, :] * M[..., i, :]
    return both * np.where(square, 0.5, 1.0)[:, None]


def _add(a: Taylor, b: Taylor, sign: float = 1.0) -> Taylor:
    size = np.abs(a.c) + np.abs(b.c) + np.abs(a.L).sum(axis=-2) + np.abs(b.L).sum(axis=-2) + a.bent + b.bent
    r = (a.r + b.r + size * _ROUND) * _UP + _TINY
    return Taylor(a.c + sign * b.c, a.L + sign * b.L, a.Q + sign * b.Q, r)


def _subtract(a: Taylor, b: Taylor) -> Taylor:
    return _add(a, b, -1.0)


def _multiply(a: Taylor, b: Taylor) -> Taylor:
    p, q, A, B, bent = np.abs(a.c), np.abs(b.c), np.abs(a.L).sum(axis=-2), np.abs(b.L).sum(axis=-2), b.bent
    r = p * b.r + q * a.r + A * bent + a.bent * (B + bent) + (p + A + a.bent) * (q + B + bent) * _ROUND
    Q = _row(a.c) * b.Q + _row(b.c) * a.Q + _product(a.L, b.L)
    return Taylor(a.c * b.c, _row(a.c) * b.L + _row(b.c) * a.L, Q, r * _UP + _TINY)


def _composed(a: Taylor, f: tuple[Array, Array, Array], rest: Array) -> Taylor:
    """f_0 + f_1 x + f_2 x^2 with what else there may be, x = a - a.c."""
    A, bent = np.abs(a.L).sum(axis=-2), a.bent
    radius = A + bent
    size = np.abs(f[0]) + np.abs(f[1]) * radius + np.abs(f[2]) * radius * radius
    r = np.abs(f[1]) * a.r + np.abs(f[2]) * bent * (A + radius) + rest + size * _ROUND
    Q = _row(f[1]) * a.Q + _row(f[2]) * _product(a.L, a.L)
    return Taylor(f[0], _row(f[1]) * a.L, Q, r * _UP + _TINY)


def _square(a: Taylor) -> Taylor:
    return _composed(a, (a.c * a.c, 2 * a.c, np.ones_like(a.c)), np.zeros_like(a.c))


def _radius(a: Taylor) -> Array:
    return (np.abs(a.L).sum(axis=-2) + a.bent) * _UP


def _invert(a: Taylor) -> Taylor:
    """1 / (c + x) = 1 / c - x / c^2 + x^2 / c^3 - x^3 / (c^3 (c + x)): unbounded where it may vanish."""
    radius, c = _radius(a), 1 / a.c
    near = (np.abs(a.c) - radius) * (1 - _ROUND)
    rest = np.where(near > 0, np.abs(radius * c) ** 3 / near, np.inf)
    return _composed(a, (c, -c * c, c**3), rest)


def _root(a: Taylor) -> Taylor:
    """sqrt(c + x), whose third derivative is at most 3 / 8 near^-5/2: unbounded where c + x may reach to 0."""
    radius, c = _radius(a), np.sqrt(a.c)
    near = (a.c - radius) * (1 - _ROUND)
    rest = np.where(near > 0, radius**3 / 16 * np.where(near > 0, near, 1.0) ** -2.5, np.inf)
    return _composed(a, (c, 0.5 / c, -0.125 / c**3), rest)


def _chosen(smaller: bool) -> Callable[[Taylor, Taylor], Taylor]:
    """The smaller, or larger, of two, where it is the same one all over the box; else unbounded."""

    def apply(a: Taylor, b: Taylor) -> Taylor:
        low, high = _subtract(a, b).bounds
        first, second = (high <= 0, low >= 0) if smaller else (low >= 0, high <= 0)
        r = np.where(first, a.r, np.where(second, b.r, np.inf))
        L, Q = (np.where(_row(first), x, y) for x, y in ((a.L, b.L), (a.Q, b.Q)))
        return Taylor(np.where(first, a.c, b.c), L, Q, r)

    return apply


def _absolute(a: Taylor) -> Taylor:
    """|c + x|, where it keeps its sign; else unbounded."""
    low, high = a.bounds
    sign = np.where(low >= 0, 1.0, -1.0)
    return Taylor(sign * a.c, _row(sign) * a.L, _row(sign) * a.Q, np.where((low >= 0) | (high <= 0), a.r, np.inf))


class TaylorFunction(LayeredFunction):
    """y (k,) of symbols x (all in a row) as Taylor models, from those of x.

    Raises:
        ExpressionError: an operation that has no rule for them.
    """

    rules: ClassVar[Mapping[int, Callable[..., Any]]] = {
        ca.OP_ASSIGN: lambda a: a,
        ca.OP_ADD: _add,
        ca.OP_SUB: _subtract,
        ca.OP_MUL: _multiply,
        ca.OP_DIV: lambda a, b: _multiply(a, _invert(b)),
        ca.OP_NEG: lambda a: Taylor(-a.c, -a.L, -a.Q, a.r),
        ca.OP_TWICE: lambda a: Taylor(2 * a.c, 2 * a.L, 2 * a.Q, 2 * a.r),
        ca.OP_SQ: _square,
        ca.OP_INV: _invert,
        ca.OP_SQRT: _root,
        ca.OP_FABS: _absolute,
        ca.OP_FMIN: _chosen(True),
        ca.OP_FMAX: _chosen(False),
    }

    def __call__(self, x: Taylor) -> Taylor:
        """The models of y, from those of x."""
        d, boxes = x.L.shape[1:]
        shapes = (boxes,), (d, boxes), (d * (d + 1) // 2, boxes), (boxes,)
        every = Taylor(*(np.zeros((self.operations, *shape)) for shape in shapes))
        places, values = self.constants
        every.c[places] = values
        places, columns = self.arguments
        for part, given in zip(every, x, strict=True):
            part[places] = given[columns]
        with np.errstate(all="ignore"):
            for rule, out, *into in self.steps:
                made = rule(*(Taylor(*(part[i] for part in every)) for i in into))
                for part, new in zip(every, made, strict=True):
                    part[out] = new
        y = Taylor(*(np.zeros((self.rows, *shape)) for shape in shapes))
        rows, places = self.results
        for part, made in zip(y, every, strict=True):
            part[rows] = made[places]
        return y
