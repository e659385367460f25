"""Expressions from what people write: nested lists of a lambda, or formulas in a job file."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import ArgumentError, ExpressionError, HolokinError, ShapeError, brief, closest
from ..base.types import Vector, number
from .native.emit import OPERATION_NAMES, applied, operations, walk

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
LONGEST_FORMULA = 10_000
"""Characters of a formula: a page and a half. Python's own parser fails on some sums that are longer."""

_CURE = "use numbers, + - * / **, pi, the joints' names or q1, q2, ..., and " + ", ".join(_FUNCTIONS)


def symbol(name: str, rows: int, columns: int = 1) -> ca.SX:
    """A fresh symbol of the given shape."""
    return ca.SX.sym(name, rows, columns)


def check_length(what: str, expression: ca.SX, entries: int) -> None:
    """Raises: ShapeError unless an expression has so many entries."""
    if expression.numel() != entries:
        raise ShapeError(what, (entries,), expression.shape)


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


_CURES = {
    "truth value": "write a condition as casadi.if_else(condition, yes, no), and max and min as casadi.fmax and fmin",
    "Matrix product": "the shapes of a matrix product do not fit: q is (n, 1), and q.T @ q a product of two of them",
    "Implicit conversion": "use casadi's functions, as casadi.sin, and lists of expressions in place of NumPy arrays",
    "not iterable": "take entries by their index, q[0], and give several as a list",
    "argument": "give a function of one argument, such as lambda q: q[0] + q[2]",
    "Slice": "take entries that there are: indices count from 0",
}


def written(what: str, function: Callable[..., Any], *symbols: ca.SX) -> ca.SX:
    """What a user's function writes, of copies of the symbols. Raises: ExpressionError; ArgumentError."""
    try:
        return as_expression(function(*(ca.SX(symbol) for symbol in symbols)))
    except HolokinError:
        raise
    except Exception as problem:  # noqa: BLE001  a function may raise anything; CasADi before 3.8.2 raises a bare Exception
        message = " ".join(str(problem).split())
        _place, _, words = message.rpartition(": ") if message.startswith(".../casadi") else ("", "", message)
        cure = next((cure for key, cure in _CURES.items() if key in message), "")
        fact = f"called with symbols it raised {type(problem).__name__}: {brief(words, 160)}"
        raise ExpressionError(what, fact, cure or "write it with casadi's functions, + - * / and if_else") from None


def _several(value: Any) -> bool:
    return isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim > 0)


def as_map(inputs: Sequence[ca.SX], *outputs: ca.SX) -> Callable[..., Any]:
    """Expressions as a map of their symbols, to be applied to others of the same shapes: far quicker than anew.

    Of one expression it returns one, of several a tuple.
    """
    function = ca.Function("map", list(inputs), list(outputs))
    return lambda *values: function(*values)


def parse(text: str | float, names: Mapping[str, ca.SX]) -> ca.SX:
    """The expression that a formula means, for instance "q1 + sin(q3)**2"; nothing is executed.

    Raises:
        ExpressionError: an unknown name or function, anything that is not arithmetic, a part that is no finite real
            number whatever the joints, as (-8)**0.5 and 1/0, or a formula that is too long or nested too deep.
    """
    formula = str(text).strip()
    if len(formula) > LONGEST_FORMULA:
        fact = f"it has {len(formula):,} characters"
        raise ExpressionError(formula, fact, f"give at most {LONGEST_FORMULA:,}; several rows may share the work")
    try:
        tree = ast.parse(formula, mode="eval")
    except SyntaxError as problem:
        raise ExpressionError(formula, problem.msg, _CURE) from None
    except (MemoryError, RecursionError, ValueError):  # how Python's parser says so
        raise ExpressionError(formula, "it is nested too deep", "write it in shorter parts") from None
    values: dict[ast.expr, ca.SX] = {}
    for node, name, parts in reversed(_outside_in(tree.body, formula)):  # no recursion: long sums are deep trees
        try:
            meaning = _apply(node, name, [values.pop(part) for part in parts], names, formula)
            finite = not meaning.is_constant() or bool(np.isfinite(float(meaning)))
        except ArithmeticError as problem:
            raise ExpressionError(formula, str(problem), _CURE) from None
        if not finite:
            raise ExpressionError(
                formula, f"{_node_text(node)} is no finite real number", "leave it out, or rewrite it"
            )
        values[node] = meaning
    return values[tree.body]


def _outside_in(root: ast.expr, formula: str) -> list[tuple[ast.expr, str, list[ast.expr]]]:
    """(node, name of what it calls or means, operands) of all parts of a formula, none before what it is part of."""
    ordered: list[tuple[ast.expr, str, list[ast.expr]]] = []
    waiting = [root]
    while waiting:
        node, name, parts = waiting.pop(), "", []
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                pass
            case ast.Name(id=name):
                pass
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=inner):
                parts = [inner]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                parts = [left, right]
            case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in _FUNCTIONS:
                pass
            case _:
                raise ExpressionError(formula, f"{_node_text(node)} is not arithmetic", _CURE)
        ordered.append((node, name, parts))
        waiting += parts
    return ordered


def _apply(node: ast.expr, name: str, parts: list[ca.SX], names: Mapping[str, ca.SX], formula: str) -> ca.SX:
    """The value of a part of a formula, of those of its operands."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return ca.SX(float(number))
        case ast.Name(id="pi"):
            return ca.SX(np.pi)
        case ast.Name():
            if name not in names:
                raise ExpressionError(formula, f"the name {brief(name, 60)!r} is unknown", closest("", [*names, "pi"]))
            return names[name]
        case ast.UnaryOp(op=op):
            return -parts[0] if isinstance(op, ast.USub) else parts[0]
        case ast.BinOp(op=ast.Div()) if parts[1].is_zero():
            raise ZeroDivisionError("division by zero")
        case ast.BinOp(op=op):
            return _BINARY[type(op)](*parts)
    try:
        return _FUNCTIONS[name](*parts)
    except (TypeError, NotImplementedError):  # the latter is CasADi's word for it
        raise ExpressionError(formula, f"{name} takes another number of arguments", _CURE) from None


def _node_text(node: ast.expr) -> str:
    """A part of a formula as text; not of one so deep that Python does not write it."""
    try:
        return repr(brief(ast.unparse(node), 100))
    except RecursionError:
        return "a part of it"


# --- `Separated`: an expression whose derivatives are exact, and where it is smooth.
#
# CasADi multiplies constants while it differentiates, (0.3 (0.7 x))' = fl(0.3 0.7), and that product is rounded. Here
# each constant is a symbol, so that no number is computed before the intervals do it. Only 0, +-1/2, +-1 and +-2 stay,
# whose sums and products are exact, and the exponents of powers.
#
# A derivative says nothing of a jump: |x|' = sign x is bounded across 0. Each operation that has a kink or a jump
# leaves a guard, an expression that vanishes there.

_KEPT = (0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0)
_COMPARED = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX)
_TRUTHS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR)
_LOGICAL = (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO)
_SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE, ca.OP_ASSIGN)


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of an expression: its number where it is a constant, the guards of the cuts that it may jump at, whether
    it is a condition, whether it is a root."""

    expression: ca.SX
    number: float = 0.5
    cuts: frozenset[int] = frozenset()
    truth: bool = False
    root: bool = False


@dataclass(frozen=True, eq=False)
class Separated:
    """An expression of inputs and of symbols (k,) that stand for its constants, `values` (k,).

    It is smooth where no guard vanishes, and its derivatives are bounded.
    """

    output: ca.SX
    symbols: ca.SX
    values: Vector
    guards: ca.SX

    @staticmethod
    def of(inputs: Mapping[str, ca.SX], output: ca.SX, angular: Sequence[bool]) -> Separated:
        """Of an expression (k,), where the rows `angular` (k,) count up to whole turns.

        An arc tangent of two arguments jumps by a turn across its cut. Sums of such, and whole multiples, do not matter
        to an angular row, to a sine and to a cosine; elsewhere the cut has a guard.
        """
        given = ca.veccat(*inputs.values())
        made = ca.Function("separated", [given], ca.cse([ca.densify(ca.vec(output))]))
        symbols, values, guards = [], [], []
        needed: dict[int, None] = {}

        def guard(expression: ca.SX) -> int:
            guards.append(expression)
            return len(guards) - 1

        def constant(number: float) -> _Part:
            if number in _KEPT:
                return _Part(ca.SX(number), number=number)
            symbols.append(ca.SX.sym(f"constant_{len(values)}"))
            values.append(number)
            return _Part(symbols[-1], number=number)

        def apply(op: int, parts: list[_Part]) -> _Part:
            arguments = [part.expression for part in parts]
            whole = [part.number % 1 == 0 for part in parts]
            jumps = frozenset[int]().union(*(part.cuts for part in parts))
            if op in (ca.OP_POW, ca.OP_CONSTPOW) and whole[1]:
                arguments[1] = ca.SX(parts[1].number)
            # A sum of angles jumps as they do, and so does a whole multiple; a sine and a cosine do not.
            if op not in _SUMS and not (op == ca.OP_MUL and any(whole)) and jumps:
                if op not in (ca.OP_SIN, ca.OP_COS):
                    needed.update(dict.fromkeys(jumps))
                jumps = frozenset()
            # The guards of the operation's own kinks and jumps.
            if op == ca.OP_ATAN2:
                y, x = arguments
                jumps = frozenset({guard(ca.sqrt(x * x + y * y) + x)})
            elif op in _COMPARED:
                needed[guard(arguments[0] - arguments[1])] = None
            elif op in (ca.OP_FABS, ca.OP_SIGN, ca.OP_COPYSIGN):
                positive = op == ca.OP_COPYSIGN and parts[0].root  # where a root vanishes its derivative is unbounded
                needed.update(dict.fromkeys(guard(a) for a in arguments[positive:]))
            elif op in _LOGICAL:
                asked = parts[:1] if op == ca.OP_IF_ELSE_ZERO else parts
                needed.update(dict.fromkeys(guard(part.expression) for part in asked if not part.truth))
            return _Part(applied(op, arguments), cuts=jumps, truth=op in _TRUTHS, root=op == ca.OP_SQRT)

        rows = walk(made, lambda _, i: _Part(given[i]), constant, apply)
        for row, part in rows.items():
            if not angular[row]:
                needed.update(dict.fromkeys(part.cuts))
        return Separated(
            ca.vertcat(*(rows[row].expression for row in range(made.size1_out(0)))),
            ca.vertcat(*symbols),
            np.array(values),
            ca.vertcat(*(guards[i] for i in needed)),
        )


_PLAIN = "INPUT OUTPUT CONST PARAMETER ASSIGN ADD SUB MUL DIV INV NEG TWICE SQ SIN COS TAN"
_WORDS = {"IF_ELSE_ZERO": "if_else", "LT": "if_else", "LE": "if_else", "NOT": "if_else", "CONSTPOW": "pow"}


def other_operations(expression: ca.SX, q: ca.SX) -> tuple[str, ...]:
    """Names of the operations in an expression of q beyond + - * / sin cos tan; () if there are none.

    Roots, angles (asin, atan2), if_else, fabs, ... have places where they are not analytic; exp, tanh, ... make bumps
    easily. Whole powers are products; a power with any other exponent counts as one of them.
    """
    made = ca.Function("made", [q], [expression])
    names = {OPERATION_NAMES[op] for op in operations(made)} - set(_PLAIN.split())
    return tuple(sorted({_WORDS.get(name, name.lower()) for name in names}))
