"""The paper's planar arm in SymPy and CasADi, [ZR11, (18) to (25)]; exact and free of our code."""

from __future__ import annotations

import casadi as ca
import sympy as sp

Q = sp.symbols("q1 q2 q3", real=True)
S3, C3 = sp.sin(Q[2]), sp.cos(Q[2])
J18 = sp.Matrix([[1, 0, -S3], [0, 1, C3]])
N19 = sp.Matrix([S3, -C3, 1])
NG20 = sp.Matrix([[C3**2, 0], [0, 1], [-S3, 0]])
G22 = sp.Matrix([[C3**2, 0], [S3 * C3, 1], [-S3, 0]])
G23 = sp.Matrix([[1 + S3, S3], [-C3, 1 - C3], [1, 1]])
NG25 = sp.Matrix([[1, 0], [-1, 1 + S3 - C3], [0, 1]])


def paper_frame(q: ca.SX) -> list:
    """(20)"""
    return [[ca.cos(q[2]) ** 2, 0], [0, 1], [-ca.sin(q[2]), 0]]


def de_luca_frame(q: ca.SX) -> list:
    """(25)"""
    return [[1, 0], [-1, 1 + ca.sin(q[2]) - ca.cos(q[2])], [0, 1]]


def de_luca_g(q: ca.SX) -> ca.SX:
    return q[0] + q[1] - q[2] + ca.sin(q[2]) + ca.cos(q[2])
