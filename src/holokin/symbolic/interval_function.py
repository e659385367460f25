"""`IntervalFunction`: an expression over boxes of its arguments, rigorous to the last rounding, for many boxes at once.

The list of operations that CasADi keeps of an expression is sorted into layers: an operation's layer is one above those
of its arguments. All operations of one kind in a layer are done by one call of `intervals`, over all boxes, so that
Python's own time does not count. An operation without a rule is refused by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import ExpressionError
from ..base.types import Array, Flags, Indices, Vector
from . import intervals as iv
from .intervals import Interval


def _truth(always: Flags, possible: Flags) -> Interval:
    return Interval(always.astype(float), possible.astype(float))


def _true(a: Interval) -> Interval:
    """Whether a is other than 0: what CasADi takes for true."""
    return _truth((a.low > 0) | (a.high < 0), (a.low != 0) | (a.high != 0))


def _not(a: Interval) -> Interval:
    true = _true(a)
    return Interval(1.0 - true.high, 1.0 - true.low)


def _conditional(c: Interval, a: Interval) -> Interval:
    """a where c is true, 0 where it is false, both where it may be either."""
    true, zero = _true(c), np.zeros_like(a.low)
    low = np.where(true.low > 0, a.low, np.where(true.high > 0, np.minimum(a.low, zero), zero))
    return Interval(low, np.where(true.low > 0, a.high, np.where(true.high > 0, np.maximum(a.high, zero), zero)))


def _less(a: Interval, b: Interval) -> Interval:
    return _truth(a.high < b.low, a.low < b.high)


def _at_most(a: Interval, b: Interval) -> Interval:
    return _truth(a.high <= b.low, a.low <= b.high)


def _equal(a: Interval, b: Interval) -> Interval:
    same = (a.low == a.high) & (b.low == b.high) & (a.low == b.low)
    return _truth(same, (a.low <= b.high) & (b.low <= a.high))


def _sign(a: Interval) -> Interval:
    return Interval(np.sign(a.low), np.sign(a.high))


def _copysign(a: Interval, b: Interval) -> Interval:
    size = iv.absolute(a)
    low = np.where(b.low > 0, size.low, -size.high)
    return Interval(low, np.where(b.high < 0, -size.low, size.high))


def _power(a: Interval, b: Interval) -> Interval:
    """a^b: by repeated squares for one small whole b, else exp(b log a): unbounded where a reaches to 0 or below."""
    whole = b.low.flat[0] if b.low.size else np.nan
    if not ((b.low == whole) & (b.high == whole)).all() or whole not in range(-64, 65):
        found = iv.exponential(iv.multiply(b, iv.logarithm(a)))
        lost = ~(a.low > 0)  # a negative a has powers too, of whole b
        return Interval(np.where(lost, -np.inf, found.low), np.where(lost, np.inf, found.high))
    found, base, left = iv.point(np.ones_like(a.low)), a, int(abs(whole))
    while left:
        found = iv.multiply(found, base) if left % 2 else found
        base, left = iv.square(base), left // 2
    if whole > 0 and whole % 2 == 0:
        found = Interval(np.maximum(found.low, 0.0), found.high)
    return iv.invert(found) if whole < 0 else found


def _hyperbolic(sign: float, over: bool) -> Callable[[Interval], Interval]:
    """(exp x + sign exp -x) / 2, or tanh x."""

    def apply(a: Interval) -> Interval:
        up, down = iv.exponential(a), iv.exponential(iv.negate(a))
        if over:  # tanh x = 1 - 2 / (exp 2x + 1), which rises
            two = iv.point(np.full_like(a.low, 2.0))
            found = iv.subtract(_one(a), iv.divide(two, iv.add(iv.square(up), _one(a))))
            return iv.within(found, -1.0, 1.0)
        return iv.multiply(iv.point(np.full_like(a.low, 0.5)), iv.add(up, down) if sign > 0 else iv.subtract(up, down))

    return apply


def _arcsine(a: Interval) -> Interval:
    """asin x = atan2(x, sqrt((1 - x)(1 + x))): unbounded where a leaves [-1, 1]."""

    def at(x: Array) -> Interval:
        y, one = iv.point(x), iv.point(np.ones_like(x))
        return iv.arctan2(y, iv.root(iv.within(iv.multiply(iv.subtract(one, y), iv.add(one, y)), 0.0, 1.0)))

    inside = (a.low >= -1) & (a.high <= 1)
    clipped = iv.within(a, -1.0, 1.0)
    low, high = at(clipped.low).low, at(clipped.high).high
    return Interval(np.where(inside, low, -np.inf), np.where(inside, high, np.inf))


def _arccosine(a: Interval) -> Interval:
    """acos x = pi / 2 - asin x."""
    return iv.subtract(Interval(np.full_like(a.low, iv.PI[0] / 2), np.full_like(a.low, iv.PI[1] / 2)), _arcsine(a))


def _one(a: Interval) -> Interval:
    return iv.point(np.ones_like(a.low))


def _area_sine(a: Interval) -> Interval:
    """asinh x = sign(x) log(|x| + sqrt(x^2 + 1)), which rises."""

    def at(x: Array) -> Interval:
        size = iv.point(np.abs(x))
        found = iv.logarithm(iv.add(size, iv.hypotenuse(size, _one(size))))
        return Interval(np.where(x < 0, -found.high, found.low), np.where(x < 0, -found.low, found.high))

    return Interval(at(a.low).low, at(a.high).high)


def _area_cosine(a: Interval) -> Interval:
    """acosh x = log(x + sqrt((x - 1)(x + 1))): unbounded where a reaches below 1."""
    return iv.logarithm(iv.add(a, iv.root(iv.multiply(iv.subtract(a, _one(a)), iv.add(a, _one(a))))))


def _area_tangent(a: Interval) -> Interval:
    """atanh x = log((1 + x) / (1 - x)) / 2: unbounded where a leaves (-1, 1)."""
    inside = (a.low > -1) & (a.high < 1)

    def at(x: Array) -> Interval:
        y, one = iv.point(x), iv.point(np.ones_like(x))
        twice = iv.logarithm(iv.divide(iv.add(one, y), iv.subtract(one, y)))
        return iv.multiply(iv.point(np.full_like(x, 0.5)), twice)

    return Interval(np.where(inside, at(a.low).low, -np.inf), np.where(inside, at(a.high).high, np.inf))


_RULES: dict[int, Callable[..., Interval]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: iv.add,
    ca.OP_SUB: iv.subtract,
    ca.OP_MUL: iv.multiply,
    ca.OP_DIV: iv.divide,
    ca.OP_NEG: iv.negate,
    ca.OP_TWICE: lambda a: iv.add(a, a),
    ca.OP_SQ: iv.square,
    ca.OP_INV: iv.invert,
    ca.OP_SQRT: iv.root,
    ca.OP_SIN: iv.sine,
    ca.OP_COS: iv.cosine,
    ca.OP_TAN: iv.tangent,
    ca.OP_ATAN: iv.arctan,
    ca.OP_ATAN2: iv.arctan2,
    ca.OP_ASIN: _arcsine,
    ca.OP_ACOS: _arccosine,
    ca.OP_EXP: iv.exponential,
    ca.OP_LOG: iv.logarithm,
    ca.OP_SINH: _hyperbolic(-1.0, False),
    ca.OP_COSH: _hyperbolic(1.0, False),
    ca.OP_TANH: _hyperbolic(1.0, True),
    ca.OP_ASINH: _area_sine,
    ca.OP_ACOSH: _area_cosine,
    ca.OP_ATANH: _area_tangent,
    ca.OP_EXPM1: lambda a: iv.subtract(iv.exponential(a), _one(a)),
    ca.OP_LOG1P: lambda a: iv.logarithm(iv.add(_one(a), a)),
    ca.OP_HYPOT: iv.hypotenuse,
    ca.OP_FABS: iv.absolute,
    ca.OP_SIGN: _sign,
    ca.OP_FMIN: iv.smaller,
    ca.OP_FMAX: iv.larger,
    ca.OP_COPYSIGN: _copysign,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_LT: _less,
    ca.OP_LE: _at_most,
    ca.OP_EQ: _equal,
    ca.OP_NE: lambda a, b: _not(_equal(a, b)),
    ca.OP_NOT: _not,
    ca.OP_AND: lambda a, b: iv.smaller(_true(a), _true(b)),
    ca.OP_OR: lambda a, b: iv.larger(_true(a), _true(b)),
    ca.OP_IF_ELSE_ZERO: _conditional,
}

_NAMES = {getattr(ca, key): key.removeprefix("OP_").lower() for key in dir(ca) if key.startswith("OP_")}


class IntervalFunction:
    """y (k,) of symbols x (all in a row), over boxes; `constants` are further symbols and their numbers.

    Raises:
        ExpressionError: an operation that has no rule for intervals.
    """

    def __init__(
        self,
        name: str,
        inputs: Mapping[str, ca.SX],
        output: ca.SX,
        constants: tuple[ca.SX, Vector] = (ca.SX(0, 1), np.zeros(0)),
    ) -> None:
        symbols, values = constants
        given = ca.veccat(*inputs.values(), symbols)
        made = ca.Function("enclosed", [given], ca.cse([ca.densify(ca.vec(output))]))
        self.name, self.rows, self.columns = name, made.size1_out(0), made.size1_in(0) - len(values)
        fixed: dict[int, float] = {}
        arguments: dict[int, int] = {}
        results: dict[int, int] = {}
        layer: list[int] = []
        register: dict[int, int] = {}
        groups: dict[tuple[int, int, int, float], list[tuple[int, ...]]] = {}
        for k in range(made.n_instructions()):
            op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if op == ca.OP_OUTPUT:
                results[out[1]] = register[into[0]]
                continue
            place = len(layer)
            if op == ca.OP_CONST:
                fixed[place] = made.instruction_constant(k)
                layer.append(0)
            elif op == ca.OP_INPUT:
                if into[1] < self.columns:
                    arguments[place] = into[1]
                else:
                    fixed[place] = float(values[into[1] - self.columns])
                layer.append(0)
            elif op not in _RULES:
                cure = "write it with + - * /, roots, sines, arc tangents, exp and log"
                raise ExpressionError(name, f"the operation {_NAMES.get(op, op)} has no rule for intervals", cure)
            else:
                places = tuple(register[i] for i in into)
                layer.append(1 + max(layer[i] for i in places))
                power = fixed.get(places[1], np.nan) if op in (ca.OP_POW, ca.OP_CONSTPOW) else 0.0
                groups.setdefault((layer[place], op, len(places), power), []).append((place, *places))
            register[out[0]] = place
        self.operations = len(layer)
        self._constants = _indices(fixed), np.array(list(fixed.values()))[:, None]
        self._arguments = _indices(arguments), _indices(arguments.values())
        self._results = _indices(results), _indices(results.values())
        self._steps = [
            (_RULES[key[1]], *(np.array(column) for column in zip(*rows, strict=True)))
            for key, rows in sorted(groups.items(), key=lambda item: item[0][0])
        ]

    def __call__(self, low: Array, high: Array) -> Interval:
        """Enclosures (k, boxes) of y over boxes [low, high], each (symbols, boxes)."""
        boxes, lost = low.shape[1], np.isnan(low) | np.isnan(high)
        if lost.any():  # no number: anything
            low, high = np.where(lost, -np.inf, low), np.where(lost, np.inf, high)
        below, above = np.empty((self.operations, boxes)), np.empty((self.operations, boxes))
        places, values = self._constants
        below[places] = above[places] = values
        places, columns = self._arguments
        below[places], above[places] = low[columns], high[columns]
        with np.errstate(all="ignore"):
            for rule, out, *into in self._steps:
                found: Any = rule(*(Interval(below[i], above[i]) for i in into))
                below[out], above[out] = found
        y = Interval(np.zeros((self.rows, boxes)), np.zeros((self.rows, boxes)))
        rows, places = self._results
        y.low[rows], y.high[rows] = below[places], above[places]
        return y


def _indices(places: Iterable[int]) -> Indices:
    return np.array(list(places), int)


def operation_list(inputs: Mapping[str, ca.SX], output: ca.SX) -> list[list[Any]]:
    """An expression as text would have it: ["const", x], ["input", i], [name, place, ...], ["output", place].

    Places count the operations; the outputs come last, in order.
    """
    made = ca.Function("listed", [ca.veccat(*inputs.values())], ca.cse([ca.densify(ca.vec(output))]))
    found: list[list[Any]] = []
    register: dict[int, int] = {}
    results: dict[int, int] = {}
    for k in range(made.n_instructions()):
        op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
        if op == ca.OP_OUTPUT:
            results[out[1]] = register[into[0]]
            continue
        if op == ca.OP_CONST:
            found.append(["const", made.instruction_constant(k)])
        elif op == ca.OP_INPUT:
            found.append(["input", into[1]])
        else:
            found.append([_NAMES[op], *(register[i] for i in into)])
        register[out[0]] = len(found) - 1  # last: an operation may write over its argument
    return found + [["output", results[row]] for row in range(made.size1_out(0))]
