"""The only door to CasADi: expressions, their derivatives, safe rotations, and `Function`."""

from casadi import (
    SX,
    atan2,
    copysign,
    cos,
    cross,
    densify,
    dot,
    fmax,
    fmin,
    horzcat,
    if_else,
    log,
    norm_2,
    sin,
    sumsqr,
    vec,
    vertcat,
)

from .calculus import directional, hessian, jacobian, lie_bracket, pairwise_brackets
from .expression import as_expression, as_map, parse, symbol
from .function import Function
from .geometry import wrapped
from .kernel import FollowKernel, FollowRules
from .linear import Factorisation, factorise, solve
from .qp import NearestPoint

__all__ = [
    "SX",
    "Factorisation",
    "FollowKernel",
    "FollowRules",
    "Function",
    "NearestPoint",
    "as_expression",
    "as_map",
    "atan2",
    "copysign",
    "cos",
    "cross",
    "densify",
    "directional",
    "dot",
    "factorise",
    "fmax",
    "fmin",
    "hessian",
    "horzcat",
    "if_else",
    "jacobian",
    "lie_bracket",
    "log",
    "norm_2",
    "pairwise_brackets",
    "parse",
    "sin",
    "solve",
    "sumsqr",
    "symbol",
    "vec",
    "vertcat",
    "wrapped",
]
