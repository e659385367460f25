"""C from an expression: straight-line code that is read once by a compiler for numbers, and once for vectors of them.

A CasADi function of scalars is a list of operations. Each becomes one line `const hk_t v7 = v3 * v5;`, in C99
without allocation, globals or branches. What `hk_t` and the HK_ macros mean is up to the prelude before it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

import casadi as ca

from ...base.errors import NativeError

_BINARY = {
    ca.OP_ADD: "{} + {}", ca.OP_SUB: "{} - {}", ca.OP_MUL: "{} * {}", ca.OP_DIV: "{} / {}",
    ca.OP_FMIN: "HK_FMIN({}, {})", ca.OP_FMAX: "HK_FMAX({}, {})", ca.OP_COPYSIGN: "HK_COPYSIGN({}, {})",
    ca.OP_ATAN2: "HK_ATAN2({}, {})", ca.OP_POW: "HK_POW({}, {})", ca.OP_CONSTPOW: "HK_POW({}, {})",
    ca.OP_LT: "HK_LT({}, {})", ca.OP_LE: "HK_LE({}, {})", ca.OP_EQ: "HK_EQ({}, {})", ca.OP_NE: "HK_NE({}, {})",
    ca.OP_AND: "HK_AND({}, {})", ca.OP_OR: "HK_OR({}, {})", ca.OP_IF_ELSE_ZERO: "HK_IF({}, {})",
    ca.OP_FMOD: "HK_FMOD({}, {})", ca.OP_HYPOT: "HK_HYPOT({}, {})",
}  # fmt: skip
_UNARY = {
    ca.OP_ASSIGN: "{}", ca.OP_NEG: "-{}", ca.OP_SQ: "{0} * {0}", ca.OP_TWICE: "{0} + {0}", ca.OP_INV: "HK_C(1) / {}",
    ca.OP_SQRT: "HK_SQRT({})", ca.OP_SIN: "HK_SIN({})", ca.OP_COS: "HK_COS({})", ca.OP_TAN: "HK_TAN({})",
    ca.OP_ASIN: "HK_ASIN({})", ca.OP_ACOS: "HK_ACOS({})", ca.OP_ATAN: "HK_ATAN({})", ca.OP_EXP: "HK_EXP({})",
    ca.OP_LOG: "HK_LOG({})", ca.OP_SINH: "HK_SINH({})", ca.OP_COSH: "HK_COSH({})", ca.OP_TANH: "HK_TANH({})",
    ca.OP_FABS: "HK_FABS({})", ca.OP_SIGN: "HK_SIGN({})", ca.OP_NOT: "HK_NOT({})", ca.OP_FLOOR: "HK_FLOOR({})",
    ca.OP_CEIL: "HK_CEIL({})", ca.OP_ASINH: "HK_ASINH({})", ca.OP_ACOSH: "HK_ACOSH({})", ca.OP_ATANH: "HK_ATANH({})",
    ca.OP_ERF: "HK_ERF({})", ca.OP_LOG1P: "HK_LOG1P({})", ca.OP_EXPM1: "HK_EXPM1({})",
}  # fmt: skip

_CONSTANT = {"inf": "HK_INF", "-inf": "(-HK_INF)", "nan": "HK_NAN", "-nan": "HK_NAN"}

SCALAR, LANES = "scalar.h", "lanes.h"
"""The preludes: hk_t is one number, or a few side by side in a vector register."""


def emit(function: ca.Function, name: str, x: Callable[[int, int], str], y: Callable[[int, int], str]) -> str:
    """The body of a function, a C block: reads its inputs, writes its outputs, and nothing else.

    Args:
        name: for messages. x, y: (argument, element in column-major order) -> C expression to read, or to assign to.

    Raises:
        NativeError: an operation that has no C here.
    """
    lines: list[str] = []
    register: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        out = function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            lines.append(f"  {y(out[0], out[1])} = {register[function.instruction_input(k)[0]]};")
            continue
        into = function.instruction_input(k)
        if op == ca.OP_CONST:
            register[out[0]] = _CONSTANT.get(repr(value := function.instruction_constant(k)), f"HK_C({value!r})")
            continue
        if op == ca.OP_INPUT:
            value = x(into[0], into[1])
        elif op in _BINARY:
            value = _BINARY[op].format(*(register[i] for i in into))
        elif op in _UNARY:
            value = _UNARY[op].format(register[into[0]])
        else:
            known = {getattr(ca, key): key for key in dir(ca) if key.startswith("OP_")}
            raise NativeError(f"{name} uses CasADi's {known.get(op, op)}, which has no C here")
        register[out[0]] = f"v{k}"
        lines.append(f"  const hk_t v{k} = {value};")
    return "\n".join(lines)


def prelude(name: str) -> str:
    """The text of a prelude or of the driver."""
    return files("holokin.symbolic.native").joinpath("c", name).read_text("utf-8")
