"""What an expression is made of: only sums, products, quotients, sines and cosines, or more."""

from __future__ import annotations

import casadi as ca

_PLAIN = (
    "INPUT", "OUTPUT", "CONST", "PARAMETER", "ASSIGN", "ADD", "SUB", "MUL", "DIV", "INV", "NEG", "TWICE", "SQ", "SIN",
    "COS", "TAN",
)  # fmt: skip
_NAMES = {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}
_WORDS = {"IF_ELSE_ZERO": "if_else", "LT": "if_else", "LE": "if_else", "NOT": "if_else", "CONSTPOW": "pow"}


def other_operations(expression: ca.SX, q: ca.SX) -> tuple[str, ...]:
    """Names of the operations in an expression of q beyond + - * / sin cos tan; () if there are none.

    Roots, angles (asin, atan2), if_else, fabs, ... have places where they are not analytic; exp, tanh, ... make bumps
    easily. Whole powers are products; a power with any other exponent counts as one of them.
    """
    made = ca.Function("made", [q], [expression])
    names = {_NAMES[made.instruction_id(i)] for i in range(made.n_instructions())} - set(_PLAIN)
    return tuple(sorted({_WORDS.get(name, name.lower()) for name in names}))
