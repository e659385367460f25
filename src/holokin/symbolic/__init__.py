"""The only door to CasADi: expressions, their derivatives, safe rotations, and `Function`.

Uses `native_kernels`. Read first: `function.py`, `calculus.py`, `rotations.py`.
"""

from casadi import (
    SX,
    atan2,
    copysign,
    cos,
    cross,
    densify,
    dot,
    exp,
    fabs,
    fmax,
    fmin,
    horzcat,
    horzsplit,
    if_else,
    log,
    n_nodes,
    norm_2,
    sin,
    sparsify,
    substitute,
    sumsqr,
    vec,
    vertcat,
)

from .calculus import directional, gradient, hessian, jacobian, lie_bracket, pairwise_brackets
from .enclosure import Enclosure, short
from .expression import as_expression, as_map, parse, symbol, written
from .expression import check_length as check_length
from .function import Evaluator, Function
from .integrate import Transport, runge_kutta, transport
from .linear import Factorisation, Solution, factorise, least_norm, same, solution, solve
from .nature import other_operations
from .qp import NearestPoint
from .rotations import wrapped
from .switching import Formula, switches, switches_of
from .taylor import TaylorModel

__all__ = [
    "SX",
    "Enclosure",
    "Evaluator",
    "Factorisation",
    "Formula",
    "Function",
    "NearestPoint",
    "Solution",
    "TaylorModel",
    "Transport",
    "as_expression",
    "as_map",
    "atan2",
    "copysign",
    "cos",
    "cross",
    "densify",
    "directional",
    "dot",
    "exp",
    "fabs",
    "factorise",
    "fmax",
    "fmin",
    "gradient",
    "hessian",
    "horzcat",
    "horzsplit",
    "if_else",
    "jacobian",
    "least_norm",
    "lie_bracket",
    "log",
    "n_nodes",
    "norm_2",
    "other_operations",
    "pairwise_brackets",
    "parse",
    "runge_kutta",
    "same",
    "short",
    "sin",
    "solution",
    "solve",
    "sparsify",
    "substitute",
    "sumsqr",
    "switches",
    "switches_of",
    "symbol",
    "transport",
    "vec",
    "vertcat",
    "wrapped",
    "written",
]
