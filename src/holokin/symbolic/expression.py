"""Expressions from what people write: nested lists of a lambda, or formulas in a job file."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ..errors import ArgumentError, ExpressionError
from ..types import number

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(ca, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
}
_BINARY = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_CURE = "use numbers, + - * / **, pi, the joints' names or q1, q2, ..., and " + ", ".join(_FUNCTIONS)


def symbol(name: str, rows: int, columns: int = 1) -> ca.SX:
    """A fresh symbol of the given shape."""
    return ca.SX.sym(name, rows, columns)


def as_expression(value: Any) -> ca.SX:
    """An SX matrix of an SX, an array, a number, or (nested) sequences of them. Raises: ArgumentError."""
    if isinstance(value, ca.SX):
        return value
    if isinstance(value, ca.DM) or (isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim < 3):
        return ca.SX(value)
    if not _several(value):
        return ca.SX(number("an expression", value))
    rows: list[ca.SX] = []
    for row in value:
        nested = _several(row)
        if nested and any(map(_several, row)):
            raise ArgumentError("an expression", value, "give rows of numbers or CasADi expressions")
        rows.append(as_expression(row).T if nested else as_expression(row))
    if len({row.shape[1] for row in rows}) > 1:
        raise ArgumentError("the lengths of an expression's rows", [row.shape[1] for row in rows], "let all be alike")
    return ca.vertcat(*rows)


def _several(value: Any) -> bool:
    return isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim > 0)


def as_map(inputs: Sequence[ca.SX], output: ca.SX) -> Callable[..., ca.SX]:
    """The expression as a map of its symbols, to be applied to other expressions of the same shapes."""
    function = ca.Function("map", list(inputs), [output])
    return lambda *values: function(*values)


def parse(text: str | float, names: Mapping[str, ca.SX]) -> ca.SX:
    """The expression that a formula means, for instance "q1 + sin(q3)**2"; nothing is executed.

    Raises:
        ExpressionError: an unknown name or function, or anything that is not arithmetic.
    """
    try:
        tree = ast.parse(str(text).strip(), mode="eval")
    except SyntaxError as problem:
        raise ExpressionError(str(text), problem.msg, _CURE) from None

    def value(node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return float(number)
            case ast.Name(id="pi"):
                return np.pi
            case ast.Name(id=name) if name in names:
                return names[name]
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return -value(inner)
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                return value(inner)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return _BINARY[type(op)](value(left), value(right))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
                try:
                    return _FUNCTIONS[name](*(ca.SX(value(a)) for a in arguments))
                except (TypeError, NotImplementedError):  # the latter is CasADi's word for it
                    raise ExpressionError(str(text), f"{name} takes another number of arguments", _CURE) from None
            case ast.Name(id=name):
                raise ExpressionError(str(text), f"the name {name!r} is unknown", f"known: {', '.join(names)}, pi")
            case _:
                raise ExpressionError(str(text), f"{ast.unparse(node)!r} is not arithmetic", _CURE)

    try:
        return ca.SX(value(tree.body))
    except ArithmeticError as problem:
        raise ExpressionError(str(text), str(problem), _CURE) from None
