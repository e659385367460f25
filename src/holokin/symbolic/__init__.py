"""The only door to CasADi: expressions, their derivatives, safe rotations, and `Function`."""

from casadi import SX, cos, densify, fmin, horzcat, norm_2, sin, vec, vertcat

from .calculus import directional, hessian, jacobian, lie_bracket, pairwise_brackets
from .expression import as_expression, parse, symbol
from .function import Function
from .linear import Factorisation, factorise, solve

__all__ = [
    "SX",
    "Factorisation",
    "Function",
    "as_expression",
    "cos",
    "densify",
    "directional",
    "factorise",
    "fmin",
    "hessian",
    "horzcat",
    "jacobian",
    "lie_bracket",
    "norm_2",
    "pairwise_brackets",
    "parse",
    "sin",
    "solve",
    "symbol",
    "vec",
    "vertcat",
]
