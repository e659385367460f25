"""The only door to CasADi: expressions, their derivatives, safe rotations, and `Function`."""

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
    if_else,
    log,
    norm_2,
    sin,
    sumsqr,
    vec,
    vertcat,
)

from .calculus import directional, gradient, hessian, jacobian, lie_bracket, pairwise_brackets
from .emit import prelude as code_file
from .enclosure import Enclosure, short
from .expression import as_expression, as_map, parse, symbol
from .function import Function
from .geometry import wrapped
from .kernel import LARGEST, FollowKernel, LeafRules, StepKernel, StepMemory, VelocityRules
from .linear import Factorisation, Solution, factorise, solution, solve
from .native import compiler, enabled, engine, tell
from .nature import other_operations
from .program import Port
from .qp import NearestPoint

__all__ = [
    "LARGEST",
    "SX",
    "Enclosure",
    "Factorisation",
    "FollowKernel",
    "Function",
    "LeafRules",
    "NearestPoint",
    "Port",
    "Solution",
    "StepKernel",
    "StepMemory",
    "VelocityRules",
    "as_expression",
    "as_map",
    "atan2",
    "code_file",
    "compiler",
    "copysign",
    "cos",
    "cross",
    "densify",
    "directional",
    "dot",
    "enabled",
    "engine",
    "exp",
    "fabs",
    "factorise",
    "fmax",
    "fmin",
    "gradient",
    "hessian",
    "horzcat",
    "if_else",
    "jacobian",
    "lie_bracket",
    "log",
    "norm_2",
    "other_operations",
    "pairwise_brackets",
    "parse",
    "short",
    "sin",
    "solution",
    "solve",
    "sumsqr",
    "symbol",
    "tell",
    "vec",
    "vertcat",
    "wrapped",
]
