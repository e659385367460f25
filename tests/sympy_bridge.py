"""A CasADi expression as a SymPy one, instruction by instruction: a referee that shares no code with ours."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy as sp

_UNARY = {
    ca.OP_NEG: lambda x: -x,
    ca.OP_SIN: sp.sin,
    ca.OP_COS: sp.cos,
    ca.OP_TAN: sp.tan,
    ca.OP_SQRT: sp.sqrt,
    ca.OP_SQ: lambda x: x**2,
    ca.OP_TWICE: lambda x: 2 * x,
    ca.OP_INV: lambda x: 1 / x,
    ca.OP_EXP: sp.exp,
}
_BINARY = {
    ca.OP_ADD: lambda x, y: x + y,
    ca.OP_SUB: lambda x, y: x - y,
    ca.OP_MUL: lambda x, y: x * y,
    ca.OP_DIV: lambda x, y: x / y,
    ca.OP_POW: lambda x, y: x**y,
    ca.OP_CONSTPOW: lambda x, y: x**y,
}


def to_sympy(expression: ca.SX, q: ca.SX, symbols: Sequence[sp.Symbol]) -> sp.Matrix:
    """The same matrix over SymPy symbols, floats that are whole numbers made exact."""
    function = ca.Function("f", [q], [ca.densify(expression)])
    rows, columns = expression.shape
    out = sp.zeros(rows, columns)
    work: dict[int, sp.Expr] = {}
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            work[target[0]] = sp.nsimplify(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            work[target[0]] = symbols[source[1]]
        elif op == ca.OP_OUTPUT:
            out[target[1] % rows, target[1] // rows] = work[source[0]]
        elif op in _UNARY:
            work[target[0]] = _UNARY[op](work[source[0]])
        else:
            work[target[0]] = _BINARY[op](work[source[0]], work[source[1]])
    return out
