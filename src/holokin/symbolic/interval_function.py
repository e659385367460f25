"""Expressions over boxes of their arguments, for many boxes at once: by intervals, and by middle and slopes.

The list of operations that CasADi keeps of an expression is sorted into layers: an operation's layer is one above those
of its arguments. All operations of one kind in a layer are done by one call of `intervals`, over all boxes, so that
Python's own time does not count. An operation without a rule is refused by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property, lru_cache
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from ..base.errors import ExpressionError, NativeError
from ..base.types import Array, Flags, Indices, Vector
from . import intervals as iv
from .function import Function
from .intervals import Interval
from .native.emit import OPERATION_NAMES, emit, operations, walk


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


def _equal(a: Interval, b: Interval) -> Interval:
    same = (a.low == a.high) & (b.low == b.high) & (a.low == b.low)
    return _truth(same, (a.low <= b.high) & (b.low <= a.high))


def _copysign(a: Interval, b: Interval) -> Interval:
    size = iv.absolute(a)
    low = np.where(b.low > 0, size.low, -size.high)
    return Interval(low, np.where(b.high < 0, -size.low, size.high))


def _power(a: Interval, b: Interval) -> Interval:
    """a^b: by repeated squares for one small whole b, else exp(b log a): unbounded where a reaches to 0 or below."""
    whole = b.low.flat[0] if b.low.size else np.nan
    if not ((b.low == whole) & (b.high == whole)).all() or whole not in range(-64, 65):
        power = iv.exponential(iv.multiply(b, iv.logarithm(a)))
        lost = ~(a.low > 0)  # a negative a has powers too, of whole b
        return Interval(np.where(lost, -np.inf, power.low), np.where(lost, np.inf, power.high))
    power, base, left = iv.point(np.ones_like(a.low)), a, int(abs(whole))
    while left:
        power = iv.multiply(power, base) if left % 2 else power
        base, left = iv.square(base), left // 2
    if whole > 0 and whole % 2 == 0:
        power = Interval(np.maximum(power.low, 0.0), power.high)
    return iv.invert(power) if whole < 0 else power


def _hyperbolic(sign: float, over: bool) -> Callable[[Interval], Interval]:
    """(exp x + sign exp -x) / 2, or tanh x."""

    def apply(a: Interval) -> Interval:
        up, down = iv.exponential(a), iv.exponential(iv.negate(a))
        if over:  # tanh x = 1 - 2 / (exp 2x + 1), which rises
            two = iv.point(np.full_like(a.low, 2.0))
            tangent = iv.subtract(_one(a), iv.divide(two, iv.add(iv.square(up), _one(a))))
            return iv.within(tangent, -1.0, 1.0)
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
        positive = iv.logarithm(iv.add(size, iv.hypotenuse(size, _one(size))))
        return Interval(np.where(x < 0, -positive.high, positive.low), np.where(x < 0, -positive.low, positive.high))

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
    ca.OP_SIGN: lambda a: Interval(np.sign(a.low), np.sign(a.high)),
    ca.OP_FMIN: iv.smaller,
    ca.OP_FMAX: iv.larger,
    ca.OP_COPYSIGN: _copysign,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_LT: lambda a, b: _truth(a.high < b.low, a.low < b.high),
    ca.OP_LE: lambda a, b: _truth(a.high <= b.low, a.low <= b.high),
    ca.OP_EQ: _equal,
    ca.OP_NE: lambda a, b: _not(_equal(a, b)),
    ca.OP_NOT: _not,
    ca.OP_AND: lambda a, b: iv.smaller(_true(a), _true(b)),
    ca.OP_OR: lambda a, b: iv.larger(_true(a), _true(b)),
    ca.OP_IF_ELSE_ZERO: _conditional,
}


class LayeredFunction:
    """y (k,) of symbols x (all in a row) as layers of operations; `constants` are further symbols and their numbers.

    Raises:
        ExpressionError: an operation that has no rule.
    """

    rules: ClassVar[Mapping[int, Callable[..., Any]]]

    def __init__(
        self,
        name: str,
        inputs: Mapping[str, ca.SX],
        output: ca.SX,
        constants: tuple[ca.SX, Vector] = (ca.SX(0, 1), np.zeros(0)),
    ) -> None:
        symbols, values = constants
        # The operations as places in a table, each with its layer.
        given = ca.veccat(*inputs.values(), symbols)
        made = ca.Function("enclosed", [given], ca.cse([ca.densify(ca.vec(output))]))
        self.name, self.rows, self.columns = name, made.size1_out(0), made.size1_in(0) - len(values)
        fixed: dict[int, float] = {}  # place: its number
        arguments: dict[int, int] = {}  # place: the symbol that it is
        layer: list[int] = []  # of each place
        groups: dict[tuple[int, int, int, float], list[tuple[int, ...]]] = {}

        def constant(value: float) -> int:
            fixed[len(layer)] = value
            layer.append(0)
            return len(layer) - 1

        def read(_: int, i: int) -> int:
            if i >= self.columns:
                return constant(float(values[i - self.columns]))
            arguments[len(layer)] = i
            layer.append(0)
            return len(layer) - 1

        def apply(op: int, places: list[int]) -> int:
            if op not in self.rules:
                cure = "write it with + - * /, roots, sines, arc tangents, exp and log"
                fact = f"the operation {OPERATION_NAMES.get(op, str(op)).lower()} has no rule for intervals"
                raise ExpressionError(name, fact, cure)
            place = len(layer)
            layer.append(1 + max(layer[i] for i in places))
            power = fixed.get(places[1], np.nan) if op in (ca.OP_POW, ca.OP_CONSTPOW) else 0.0
            groups.setdefault((layer[place], op, len(places), power), []).append((place, *places))
            return place

        # Sort the operations by layer and kind, so that one call does all of a kind.
        results = walk(made, read, constant, apply)
        self.operations = len(layer)
        self.constants = _indices(fixed), np.array(list(fixed.values()))[:, None]
        self.arguments = _indices(arguments), _indices(arguments.values())
        self.results = _indices(results), _indices(results.values())
        self.steps = [
            (self.rules[key[1]], *(np.array(column) for column in zip(*rows, strict=True)))
            for key, rows in sorted(groups.items(), key=lambda item: item[0][0])
        ]


class IntervalFunction(LayeredFunction):
    """y (k,) of symbols x (all in a row), over boxes; `constants` are further symbols and their numbers.

    Raises:
        ExpressionError: an operation that has no rule for intervals.
    """

    rules: ClassVar[Mapping[int, Callable[..., Any]]] = _RULES

    def __call__(self, low: Array, high: Array) -> Interval:
        """Enclosures (k, boxes) of y over boxes [low, high], each (symbols, boxes)."""
        boxes, lost = low.shape[1], np.isnan(low) | np.isnan(high)
        if lost.any():  # no number: anything
            low, high = np.where(lost, -np.inf, low), np.where(lost, np.inf, high)
        below, above = np.empty((self.operations, boxes)), np.empty((self.operations, boxes))
        places, values = self.constants
        below[places] = above[places] = values
        places, columns = self.arguments
        below[places], above[places] = low[columns], high[columns]
        with np.errstate(all="ignore"):
            for rule, out, *into in self.steps:
                bounds: Any = rule(*(Interval(below[i], above[i]) for i in into))
                below[out], above[out] = bounds
        y = Interval(np.zeros((self.rows, boxes)), np.zeros((self.rows, boxes)))
        rows, places = self.results
        y.low[rows], y.high[rows] = below[places], above[places]
        return y


def _indices(places: Iterable[int]) -> Indices:
    return np.array(list(places), int)


def operation_list(inputs: Mapping[str, ca.SX], output: ca.SX) -> list[list[Any]]:
    """An expression as text would have it: ["const", x], ["input", i], [name, place, ...], ["output", place].

    Places count the operations; the outputs come last, in order.
    """
    made = ca.Function("listed", [ca.veccat(*inputs.values())], ca.cse([ca.densify(ca.vec(output))]))
    listed: list[list[Any]] = []

    def place_of(operation: list[Any]) -> int:
        listed.append(operation)
        return len(listed) - 1

    results = walk(
        made,
        lambda _, i: place_of(["input", i]),
        lambda value: place_of(["const", value]),
        lambda op, places: place_of([OPERATION_NAMES[op].lower(), *places]),
    )
    return listed + [["output", results[row]] for row in range(made.size1_out(0))]


# --- Enclosures: what an expression can be over a box of its arguments, as pairs (mid, rad) with |y - mid| <= rad.
# [Rum99]
#
# Every operation of a CasADi function is applied to pairs instead of numbers. The middle is the expression's own value
# at the centre of the box, so an enclosure shrinks to it with the box. Round-off is not enclosed: a bound holds up to
# about 1e-13 of itself. Two things are left out on purpose: a copysign takes the sign at the centre (it picks one of
# two equal formulas in Householder reflections), and a jump of a derivative (fabs, if_else, fmin) is no part of it, so
# that expressions must be smooth. Where an `if_else` may fall either way both branches are enclosed.

Pair = tuple[ca.SX, ca.SX]
"""(mid, rad >= 0)."""

_NUMBERS, _POSITIVE, _UNIT = (-np.inf, np.inf), (0.0, np.inf), (-1.0, 1.0)


def _times(a: Pair, b: Pair) -> Pair:
    return a[0] * b[0], ca.fabs(a[0]) * b[1] + a[1] * (ca.fabs(b[0]) + b[1])


def _inverse(a: Pair) -> Pair:
    size = ca.fabs(a[0])
    return 1 / a[0], _bounded(size > a[1], a[1] / (size * (size - a[1])))


def _bounded(sound: ca.SX, rad: ca.SX) -> ca.SX:
    return ca.if_else(sound, rad, np.inf)


def _larger(a: ca.SX, b: ca.SX) -> ca.SX:
    """The larger of two radii, infinite where one is not a number, which fmax would drop."""
    return _bounded(a + b < np.inf, ca.fmax(a, b))


def _rising(f: Callable[[ca.SX], ca.SX], domain: tuple[float, float] = _NUMBERS) -> Callable[[Pair], Pair]:
    """A monotone function: its extremes are at the ends."""

    def apply(a: Pair) -> Pair:
        mid, low, high = f(a[0]), a[0] - a[1], a[0] + a[1]
        rad = _larger(ca.fabs(f(high) - mid), ca.fabs(mid - f(low)))
        inside = ca.logic_and(low > domain[0], high < domain[1])
        return mid, rad if domain == _NUMBERS else _bounded(inside, rad)

    return apply


def _curved(f: Callable[[ca.SX], ca.SX], slope: Callable[[ca.SX], ca.SX]) -> Callable[[Pair], Pair]:
    """sin, cos: |f(m + d) - f(m)| <= |f'(m)| |d| + d^2 / 2, and at most 2."""
    return lambda a: (f(a[0]), ca.fmin(ca.fabs(slope(a[0])) * a[1] + a[1] * a[1] / 2, 2))


def _tan(a: Pair) -> Pair:
    return _times((ca.sin(a[0]), _curved(ca.sin, ca.cos)(a)[1]), _inverse(_curved(ca.cos, ca.sin)(a)))


def _step(f: Callable[[ca.SX], ca.SX]) -> Callable[[Pair], Pair]:
    """A function that rises by jumps: sign, floor, ceil."""
    return lambda a: (f(a[0]), _larger(f(a[0] + a[1]) - f(a[0]), f(a[0]) - f(a[0] - a[1])))


def _compared(f: Callable[[ca.SX, ca.SX], ca.SX]) -> Callable[[Pair, Pair], Pair]:
    """A condition, 0 or 1: with radius 1 where it may fall either way, or is one of what is not a number."""
    return lambda a, b: (f(a[0], b[0]), ca.logic_not(ca.fabs(a[0] - b[0]) > a[1] + b[1]))


def _any(a: Pair, b: Pair) -> ca.SX:
    return ca.fmax(a[1], b[1])


def _if(c: Pair, a: Pair) -> Pair:
    """a where c, else 0; where c may fall either way both."""
    mid = ca.if_else(c[0], a[0], 0)
    both = ca.fabs(a[0]) + a[1]
    return mid, ca.if_else(c[1] > 0, both, ca.if_else(c[0], a[1], 0))


def _power_enclosure(a: Pair, b: Pair) -> Pair:
    """a^b: a constant b by its largest slope, whole ones off 0 and those from 1 on everywhere; else exp(b log a)."""
    near, far = ca.fabs(a[0]) - a[1], ca.fabs(a[0]) + a[1]
    rises, whole = ca.power(far, b[0] - 1), ca.floor(b[0]) == b[0]
    steepest = ca.if_else(near > 0, ca.fmax(rises, ca.power(ca.fmax(near, 1e-300), b[0] - 1)), rises)
    sound = ca.logic_or(b[0] >= 1, ca.logic_and(near > 0, ca.logic_or(whole, a[0] > 0)))
    slope = _bounded(sound, ca.fabs(b[0]) * steepest * a[1])
    other = _rising(ca.exp)(_times(b, _rising(ca.log, _POSITIVE)(a)))
    return ca.power(a[0], b[0]), ca.if_else(b[1] > 0, other[1], slope)


def _atan2(y: Pair, x: Pair) -> Pair:
    """The gradient of atan2 is 1 / |(x, y)| in size; it jumps across the negative x axis."""
    width = ca.sqrt(y[1] * y[1] + x[1] * x[1])
    near = ca.sqrt(y[0] * y[0] + x[0] * x[0]) - width
    across = ca.logic_and(ca.fabs(y[0]) <= y[1], x[0] - x[1] < 0)
    return ca.atan2(y[0], x[0]), _bounded(ca.logic_and(near > 0, ca.logic_not(across)), width / near)


def _extreme(f: Callable[[ca.SX, ca.SX], ca.SX]) -> Callable[[Pair, Pair], Pair]:
    """fmin, fmax: no argument moves them by more than itself."""
    return lambda a, b: (f(a[0], b[0]), _larger(a[1], b[1]))


_OPERATIONS: dict[int, Callable[..., Pair]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: lambda a, b: (a[0] + b[0], a[1] + b[1]),
    ca.OP_SUB: lambda a, b: (a[0] - b[0], a[1] + b[1]),
    ca.OP_MUL: _times,
    ca.OP_DIV: lambda a, b: _times(a, _inverse(b)),
    ca.OP_NEG: lambda a: (-a[0], a[1]),
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_SQ: lambda a: (a[0] * a[0], a[1] * (2 * ca.fabs(a[0]) + a[1])),
    ca.OP_INV: _inverse,
    ca.OP_SQRT: _rising(ca.sqrt, _POSITIVE),
    ca.OP_SIN: _curved(ca.sin, ca.cos),
    ca.OP_COS: _curved(ca.cos, ca.sin),
    ca.OP_TAN: _tan,
    ca.OP_ASIN: _rising(ca.asin, _UNIT),
    ca.OP_ACOS: _rising(ca.acos, _UNIT),
    ca.OP_ATAN: _rising(ca.atan),
    ca.OP_SINH: _rising(ca.sinh),
    ca.OP_COSH: lambda a: (ca.cosh(a[0]), ca.cosh(ca.fabs(a[0]) + a[1]) - ca.cosh(a[0])),
    ca.OP_TANH: _rising(ca.tanh),
    ca.OP_ASINH: _rising(ca.asinh),
    ca.OP_ACOSH: _rising(ca.acosh, (1.0, np.inf)),
    ca.OP_ATANH: _rising(ca.atanh, _UNIT),
    ca.OP_EXP: _rising(ca.exp),
    ca.OP_EXPM1: _rising(ca.expm1),
    ca.OP_LOG: _rising(ca.log, _POSITIVE),
    ca.OP_LOG1P: _rising(ca.log1p, (-1.0, np.inf)),
    ca.OP_ERF: _rising(ca.erf),
    ca.OP_FABS: lambda a: (ca.fabs(a[0]), a[1]),
    ca.OP_SIGN: _step(ca.sign),
    ca.OP_FLOOR: _step(ca.floor),
    ca.OP_CEIL: _step(ca.ceil),
    ca.OP_ATAN2: _atan2,
    ca.OP_POW: _power_enclosure,
    ca.OP_CONSTPOW: _power_enclosure,
    ca.OP_FMIN: _extreme(ca.fmin),
    ca.OP_FMAX: _extreme(ca.fmax),
    ca.OP_COPYSIGN: lambda a, b: (ca.copysign(a[0], b[0]), a[1]),
    ca.OP_LT: _compared(lambda a, b: a < b),
    ca.OP_LE: _compared(lambda a, b: a <= b),
    ca.OP_EQ: _compared(lambda a, b: a == b),
    ca.OP_NE: _compared(lambda a, b: a != b),
    ca.OP_NOT: lambda a: (ca.logic_not(a[0]), a[1]),
    ca.OP_AND: lambda a, b: (ca.logic_and(a[0], b[0]), _any(a, b)),
    ca.OP_OR: lambda a, b: (ca.logic_or(a[0], b[0]), _any(a, b)),
    ca.OP_IF_ELSE_ZERO: _if,
    ca.OP_HYPOT: lambda a, b: (ca.hypot(a[0], b[0]), a[1] + b[1]),
}


def short(expression: ca.SX, symbols: ca.SX, most: int) -> bool:
    """True for an expression of at most `most` operations and no factorisation, whose enclosures are of use."""
    made = ca.Function("length", [symbols], [expression])
    return made.n_instructions() <= most and ca.OP_COPYSIGN not in operations(made)


class Enclosure:
    """The pairs of an expression y (k,) over a box of its symbols x (all in a row).

    Raises:
        NativeError: an operation that has no enclosure here.
    """

    def __init__(self, name: str, inputs: Mapping[str, ca.SX], output: ca.SX) -> None:
        made = ca.Function(name, [ca.vertcat(*inputs.values())], ca.cse([ca.densify(ca.vec(output))]))
        if operations(made) - {*_OPERATIONS, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}:
            raise NativeError(f"{name} has an operation that has no enclosure")
        self.name, self.made = name, made

    @cached_property
    def function(self) -> Function:
        """(mid (n,), rad (n,)) of x -> (mid (k,), rad (k,)) of y."""
        return _of_pairs(self.made.serialize())

    @cached_property
    def c(self) -> str:
        """C99 of `static void NAME(const hk_t *x, hk_t *y)`: x is mid, rad of all symbols, y mid, rad of the results.

        Each operation is a call, so that compilers are quick and the code is small.
        """
        made, lines, used, zero = self.made, [], set(), set()
        width, height = made.size1_in(0), made.size1_out(0)
        for k in range(made.n_instructions()):
            op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if op == ca.OP_OUTPUT:
                if into[0] not in zero:
                    lines.append(f"  y[{out[1]}] = w[{2 * into[0]}], y[{height + out[1]}] = w[{2 * into[0] + 1}];")
                continue
            zero.discard(out[0])
            if op == ca.OP_CONST:
                value = made.instruction_constant(k)
                lines.append(f"  w[{2 * out[0]}] = HK_C({value!r}), w[{2 * out[0] + 1}] = HK_C(0);")
                zero |= {out[0]} if value == 0 else set()
            elif op == ca.OP_INPUT:
                lines.append(f"  w[{2 * out[0]}] = x[{into[1]}], w[{2 * out[0] + 1}] = x[{width + into[1]}];")
            else:
                used.add((op, len(into)))
                lines.append(f"  hk_pair_{op}({', '.join(f'w + {2 * i}' for i in (*into, out[0]))});")
        calls = "".join(_call(op, count) for op, count in sorted(used))
        body = "\n".join(lines)
        start = f"  hk_t w[{2 * made.sz_w()}];\n  for (int i = 0; i < {2 * height}; i++) y[i] = HK_C(0);\n"
        return f"{calls}static void {self.name}(const hk_t *x, hk_t *y) {{\n{start}{body}\n}}\n"


@lru_cache(maxsize=32)
def _of_pairs(text: str) -> Function:
    """(mid, rad) of x -> (mid, rad) of y. Of a serialized function, so that equal ones share half a second's work."""
    made, zero = ca.Function.deserialize(text), ca.SX(0)
    mid, rad = ca.SX.sym("mid", made.size1_in(0)), ca.SX.sym("rad", made.size1_in(0))
    pairs = walk(
        made, lambda _, i: (mid[i], rad[i]), lambda value: (ca.SX(value), zero), lambda op, a: _OPERATIONS[op](*a)
    )
    y = [pairs[row] for row in range(made.size1_out(0))]
    outputs = {"mid": ca.vertcat(*(p[0] for p in y)), "rad": ca.vertcat(*(p[1] for p in y))}
    return Function(made.name(), {"mid": mid, "rad": rad}, outputs)


@cache
def _call(op: int, count: int) -> str:
    """C of one operation on pairs, from its expression above."""
    symbols = [(ca.SX.sym("m"), ca.SX.sym("r")) for _ in range(count)]
    made = ca.Function("pair", [x for pair in symbols for x in pair], ca.cse(list(_OPERATIONS[op](*symbols))))
    names = "ab"[:count]
    code = emit(made, "pair", lambda argument, _: f"{names[argument // 2]}{argument % 2}", lambda i, _: f"z{i}")
    given = "".join(f"  const hk_t {n}0 = {n}[0], {n}1 = {n}[1];\n" for n in names)
    idle = "".join(f"  (void){n}1;\n" for n in names)
    arguments = ", ".join(f"const hk_t *{n}" for n in names)
    return (
        f"HK_CALL static void hk_pair_{op}({arguments}, hk_t *y) {{\n{given}{idle}  hk_t z0, z1;\n{code}\n"
        "  y[0] = z0, y[1] = z1;\n}\n"
    )
