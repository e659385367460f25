"""Intervals against Arb's balls at 300 bits, and interval functions against CasADi and Arb."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import flint
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from conftest import sampled as some_of
from holokin.base.errors import ExpressionError
from holokin.symbolic import intervals as iv
from holokin.symbolic.expression import Separated
from holokin.symbolic.interval_function import _RULES, IntervalFunction, operation_list
from holokin.symbolic.intervals import Interval
from holokin.symbolic.native.emit import OPERATION_NAMES

arb = flint.arb
FINITE = st.floats(-1e6, 1e6) | st.sampled_from(
    [
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        2.2e-308,
        1e-150,
        1e150,
        -1e300,
        1.7e308,
        1.0,
        -1.0,
        math.pi,
        math.pi / 2,
        -3 * math.pi / 2,
    ]
)
BOXES = st.tuples(FINITE, FINITE).map(sorted)
SHARE = st.floats(0, 1)
QUICK = settings(suppress_health_check=list(HealthCheck))

ONE: dict[str, tuple[Callable[[Interval], Interval], Callable[[arb], arb]]] = {
    "square": (iv.square, lambda x: x * x),
    "invert": (iv.invert, lambda x: 1 / x),
    "root": (iv.root, lambda x: x.sqrt()),
    "absolute": (iv.absolute, abs),
    "negate": (iv.negate, lambda x: -x),
    "sine": (iv.sine, lambda x: x.sin()),
    "cosine": (iv.cosine, lambda x: x.cos()),
    "tangent": (iv.tangent, lambda x: x.tan()),
    "arctan": (iv.arctan, lambda x: x.atan()),
    "exponential": (iv.exponential, lambda x: x.exp()),
    "logarithm": (iv.logarithm, lambda x: x.log()),
    "asin": (_RULES[ca.OP_ASIN], lambda x: x.asin()),
    "acos": (_RULES[ca.OP_ACOS], lambda x: x.acos()),
    "sinh": (_RULES[ca.OP_SINH], lambda x: x.sinh()),
    "cosh": (_RULES[ca.OP_COSH], lambda x: x.cosh()),
    "tanh": (_RULES[ca.OP_TANH], lambda x: x.tanh()),
    "asinh": (_RULES[ca.OP_ASINH], lambda x: x.asinh()),
    "acosh": (_RULES[ca.OP_ACOSH], lambda x: x.acosh()),
    "atanh": (_RULES[ca.OP_ATANH], lambda x: x.atanh()),
    "expm1": (_RULES[ca.OP_EXPM1], lambda x: x.expm1()),
    "log1p": (_RULES[ca.OP_LOG1P], lambda x: x.log1p()),
}
TWO: dict[str, tuple[Callable[[Interval, Interval], Interval], Callable[[arb, arb], arb]]] = {
    "add": (iv.add, lambda x, y: x + y),
    "subtract": (iv.subtract, lambda x, y: x - y),
    "multiply": (iv.multiply, lambda x, y: x * y),
    "divide": (iv.divide, lambda x, y: x / y),
    "arctan2": (iv.arctan2, arb.atan2),
    "hypotenuse": (iv.hypotenuse, lambda x, y: (x * x + y * y).sqrt()),
    "smaller": (iv.smaller, lambda x, y: x.min(y)),
    "larger": (iv.larger, lambda x, y: x.max(y)),
}


def box(low: float, high: float) -> Interval:
    return Interval(np.array([low]), np.array([high]))


def inside(low: float, high: float, share: float) -> float:
    return min(max(low + share * (high - low) if high - low < np.inf else low, low), high)


def holds(found: Interval, value: arb) -> bool:
    """Whether the true value, where there is one, lies in the interval."""
    if not value.is_finite():
        return True
    return not (value < arb(float(found.low[0])) or value > arb(float(found.high[0])))


def wider(a: Interval, b: Interval) -> bool:
    return bool((a.low <= b.low).all() and (a.high >= b.high).all())


def rounded(a: Interval) -> Interval:
    """A few doubles wider: ends next to each other are enclosed one by one, each as its round-off comes."""
    low, high = a.low, a.high
    for _ in range(16):
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
    return Interval(low, high)


@pytest.fixture(autouse=True)
def _precise() -> None:
    flint.ctx.prec = 400


@some_of(10, "name", ONE)
@QUICK
@given(ends=BOXES, share=SHARE, other=SHARE)
@example(ends=[1e-200, 1e-200], share=0.0, other=0.0)
@example(ends=[709.0, 711.0], share=0.7, other=0.2)
@example(ends=[-746.0, -700.0], share=0.3, other=0.2)
@example(ends=[1.5707963267948966, 1.5707963267948968], share=0.0, other=1.0)
@example(ends=[-1.0, 1.0], share=1.0, other=0.5)
@example(ends=[-607692.83984375, 0.0], share=1.0, other=1e-14)
def test_an_interval_of_a_function_holds_its_true_values(
    name: str, ends: list[float], share: float, other: float
) -> None:
    """Of a number inside; and smaller intervals give smaller ones."""
    rule, truth = ONE[name]
    x, y = sorted(inside(*ends, s) for s in (share, other))
    with np.errstate(all="ignore"):
        found, part, one = rule(box(*ends)), rule(box(x, y)), rule(box(x, x))
    assert wider(rounded(found), part) and wider(rounded(part), one)
    assert holds(one, truth(arb(x)))
    if name in ("sine", "cosine") and abs(x) < 1e3:
        assert one.high[0] - one.low[0] < 3e-14 + 1e-15 * abs(x)
    elif name in ("exponential", "arctan") and abs(x) < 600:
        assert one.high[0] - one.low[0] <= 1e-11 * abs(one.low[0]) + 1e-300


@pytest.mark.parametrize("name", TWO)
@QUICK
@given(a=BOXES, b=BOXES, share=SHARE, other=SHARE)
@example(a=[-1.0, 1.0], b=[-1.0, -1.0], share=0.5, other=0.5)
@example(a=[0.0, 0.0], b=[-2.0, 3.0], share=0.5, other=0.1)
@example(a=[1e300, 1.7e308], b=[1e300, 1.7e308], share=1.0, other=1.0)
@example(a=[-5e-324, 5e-324], b=[0.5, 0.5], share=1.0, other=0.0)
@example(a=[523062.2889975556, 1e6], b=[0.0, 2.22e-16], share=0.3630242484776381, other=0.22301642749642575)
def test_an_interval_of_two_numbers_holds_the_true_result(
    name: str, a: list[float], b: list[float], share: float, other: float
) -> None:
    """As above."""
    rule, truth = TWO[name]
    x, y = inside(*a, share), inside(*b, other)
    with np.errstate(all="ignore"):
        found, one = rule(box(*a), box(*b)), rule(box(x, x), box(y, y))
    assert wider(rounded(found), one)
    if name != "arctan2" or (x, y) != (0.0, 0.0):
        assert holds(one, truth(arb(x), arb(y)))


@QUICK
@given(
    x=FINITE,
    share=SHARE,
    wide=st.floats(0, 10),
    power=st.sampled_from([-3.0, -2.0, 0.0, 1.0, 2.0, 3.0, 7.0, 65.0, 0.5, 1.5, -0.3]),
)
@example(x=-2.0, share=0.5, wide=0.0, power=65.0)
def test_powers_hold_the_true_power_of_negative_numbers_too(x: float, share: float, wide: float, power: float) -> None:
    """(-2)^65 is no logarithm's."""
    y = inside(x, x + wide, share)
    with np.errstate(all="ignore"):
        found = _RULES[ca.OP_POW](box(x, x + wide), box(power, power))
    assert holds(found, arb(y) ** int(power) if power % 1 == 0 else arb(y) ** arb(power))


def test_what_is_no_number_becomes_unbounded() -> None:
    """At infinities, at NaN, across poles: nothing is claimed."""
    x = ca.SX.sym("x")
    for expression in (1 / x, ca.log(x), ca.sqrt(x), ca.tan(x), x * x, ca.acos(x), ca.exp(x) - ca.exp(x) * x):
        f = IntervalFunction("f", {"x": x}, expression)
        for low, high in ((np.nan, np.nan), (-np.inf, np.inf), (np.nan, 1.0)):
            found = f(np.array([[low]]), np.array([[high]]))
            assert found.high[0, 0] == np.inf
    assert IntervalFunction("f", {"x": x}, x * x)(np.zeros((1, 0)), np.zeros((1, 0))).low.shape == (1, 0)


def sampled(op: int) -> tuple[ca.SX, list[ca.SX]]:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    return (ca.SX.binary(op, a, b), [a, b]) if OPERATION_NAMES[op].lower() in BINARY else (ca.SX.unary(op, a), [a])


BINARY = {
    "add", "sub", "mul", "div", "atan2", "fmin", "fmax", "copysign", "pow", "constpow", "lt", "le", "eq", "ne", "and",
    "or", "if_else_zero", "hypot",
}  # fmt: skip


@pytest.mark.parametrize("op", [op for op in _RULES if op != ca.OP_ASSIGN], ids=lambda op: OPERATION_NAMES[op].lower())
def test_every_rule_agrees_with_casadi_in_random_boxes(op: int) -> None:
    """CasADi's value at random points of random boxes is inside, but for its own rounding."""
    rng = np.random.default_rng(op)
    expression, symbols = sampled(op)
    k, n = 400, len(symbols)
    middle, half = rng.normal(0, 2, (n, k)).round(rng.integers(0, 3)), rng.uniform(0, 1, (n, k)) ** 4
    points = middle + half * rng.uniform(-1, 1, (n, k))
    value = np.array(ca.Function("f", [ca.vertcat(*symbols)], [expression]).map(k)(points)).ravel()
    found = IntervalFunction("f", {"x": ca.vertcat(*symbols)}, expression)(middle - half, middle + half)
    known = np.isfinite(value)
    slack = 1e-11 * (1 + np.abs(value))
    assert ((found.low[0] - slack <= value) & (value <= found.high[0] + slack))[known].all()
    assert known.any()


def test_an_operation_without_a_rule_is_refused_by_its_name() -> None:
    """erf."""
    x = ca.SX.sym("x")
    with pytest.raises(ExpressionError, match="erf has no rule"):
        IntervalFunction("f", {"x": x}, ca.erf(x))


def test_the_list_of_operations_is_the_expression() -> None:
    """Each place names an earlier one, where CasADi writes over an argument too; the values are the same."""
    x = ca.SX.sym("x", 3)
    y = ca.vertcat(ca.sin(x[0] * 3.5) + x[1], ca.cos(ca.sin(x[2]) - x[0]) ** 2 / (2 + x[1]), x[0])
    listed, at = operation_list({"x": x}, y), np.array([0.3, -0.7, 1.9])
    values: list[float] = []
    rules = {"sin": math.sin, "cos": math.cos, "sq": lambda a: a * a, "neg": lambda a: -a}
    rules |= {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
    }
    results = []
    for name, *of in listed:
        if name == "output":
            results.append(values[of[0]])
        elif name in ("const", "input"):
            values.append(of[0] if name == "const" else at[of[0]])
        else:
            assert all(i < len(values) for i in of)
            values.append(rules[name](*(values[i] for i in of)))
    assert results == pytest.approx(np.array(ca.Function("f", [x], [y])(at)).ravel(), rel=1e-14)


def test_derivatives_hold_what_a_rounded_product_of_constants_misses() -> None:
    """(0.1 (0.7 sin x))' = 0.07 cos x: CasADi's own constant is another number; that of the separated one is held."""
    x = ca.SX.sym("x")
    y = 0.1 * ca.sin(0.7 * x)
    exact = arb(0.1) * arb(0.7)
    rounded = IntervalFunction("f", {"x": x}, ca.jacobian(y, x))(np.zeros((1, 1)), np.zeros((1, 1)))
    apart = Separated.of({"x": x}, y, [False])
    f = IntervalFunction("f", {"x": x}, ca.jacobian(apart.output, x), (apart.symbols, apart.values))
    found = f(np.zeros((1, 1)), np.zeros((1, 1)))
    assert holds(Interval(found.low[0], found.high[0]), exact)
    assert found.high[0, 0] - found.low[0, 0] < 1e-15 and rounded.high[0, 0] - rounded.low[0, 0] < 1e-13


@pytest.mark.parametrize(
    ("kink", "angular", "guarded"),
    [
        (lambda x: ca.fabs(x), False, 1),
        (lambda x: ca.fmax(x, 0.3), False, 1),
        (lambda x: ca.if_else(x > 0.2, x, 2 * x), False, 1),
        (lambda x: ca.copysign(x, x + 1), False, 2),
        (lambda x: ca.atan2(x, x - 3), True, 0),
        (lambda x: 3 * ca.atan2(x, x - 3) - x, True, 0),
        (lambda x: ca.sin(ca.atan2(x, x - 3) + x), False, 0),
        (lambda x: ca.atan2(x, x - 3), False, 1),
        (lambda x: 0.5 * ca.atan2(x, x - 3), True, 1),
        (lambda x: ca.sqrt(1 + x * x) * ca.sin(x), False, 0),
    ],
)
def test_a_kink_or_a_jump_has_a_guard_that_vanishes_there(
    kink: Callable[[ca.SX], ca.SX], angular: bool, guarded: int
) -> None:
    """Derivatives are bounded across it, and so they alone would not tell; an angle's whole turns do not matter."""
    x = ca.SX.sym("x")
    apart = Separated.of({"x": x}, kink(x), [angular])
    assert apart.guards.shape[0] == guarded
    f = IntervalFunction("f", {"x": x}, ca.vertcat(apart.guards, apart.output), (apart.symbols, apart.values))
    found = f(np.array([[-1.5]]), np.array([[1.5]]))
    assert (found.low[:-1] <= 0).all() and (found.high[:-1] >= 0).all()
