"""Enclosures: what an expression can be over a box of its arguments, as pairs (mid, rad) with |y - mid| <= rad. [Rum99]

Every operation of a CasADi function is applied to pairs instead of numbers. The middle is the expression's own value
at the centre of the box, so an enclosure shrinks to it with the box. Round-off is not enclosed: a bound holds up to
about 1e-13 of itself. Two things are left out on purpose: a copysign takes the sign at the centre (it picks one of two
equal formulas in Householder reflections), and a jump of a derivative (fabs, if_else, fmin) is no part of it, so that
expressions must be smooth. Where an `if_else` may fall either way both branches are enclosed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import NativeError
from .function import Function
from .native.emit import emit

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


def _cosh(a: Pair) -> Pair:
    return ca.cosh(a[0]), ca.cosh(ca.fabs(a[0]) + a[1]) - ca.cosh(a[0])


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


def _power(a: Pair, b: Pair) -> Pair:
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
    ca.OP_COSH: _cosh,
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
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
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
    count = made.n_instructions()
    return count <= most and all(made.instruction_id(k) != ca.OP_COPYSIGN for k in range(count))


class Enclosure:
    """The pairs of an expression y (k,) over a box of its symbols x (all in a row).

    Raises:
        NativeError: an operation that has no enclosure here.
    """

    def __init__(self, name: str, inputs: Mapping[str, ca.SX], output: ca.SX) -> None:
        made = ca.Function(name, [ca.vertcat(*inputs.values())], ca.cse([ca.densify(ca.vec(output))]))
        for k in range(made.n_instructions()):
            if made.instruction_id(k) not in {*_OPERATIONS, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}:
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
    y: list[Any] = [None] * made.size1_out(0)
    register: dict[int, Pair] = {}
    for k in range(made.n_instructions()):
        op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
        if op == ca.OP_OUTPUT:
            y[out[1]] = register[into[0]]
        elif op == ca.OP_CONST:
            register[out[0]] = (ca.SX(made.instruction_constant(k)), zero)
        elif op == ca.OP_INPUT:
            register[out[0]] = (mid[into[1]], rad[into[1]])
        else:
            register[out[0]] = _OPERATIONS[op](*(register[i] for i in into))
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
