"""What an expression is made of: only sums, products, roots and trigonometric functions, or more."""

from __future__ import annotations

import casadi as ca

_PLAIN = (
    "INPUT", "OUTPUT", "CONST", "PARAMETER", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "INV", "NEG", "TWICE", "SQ", "SQRT",
    "HYPOT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2",
    "COPYSIGN",  # the side that a Householder reflection takes: its factor of 1 or -1 cancels in what is solved
)  # fmt: skip
_NAMES = {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}
_WORDS = {"IF_ELSE_ZERO": "if_else", "LT": "if_else", "LE": "if_else", "NOT": "if_else", "CONSTPOW": "pow"}


def other_operations(expression: ca.SX, q: ca.SX) -> tuple[str, ...]:
    """Names of the operations in an expression of q that are neither algebraic nor trigonometric; () if there are none.

    exp, tanh, if_else, fabs, ... can make a function that differs from zero, as far as numbers show, in a small
    place only. Whole powers are products; a power with any other exponent counts as one of them.
    """
    made = ca.Function("made", [q], [expression])
    names = {_NAMES[made.instruction_id(i)] for i in range(made.n_instructions())} - set(_PLAIN)
    return tuple(sorted({_WORDS.get(name, name.lower()) for name in names}))
