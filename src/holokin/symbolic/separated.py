"""`Separated`: an expression whose derivatives are exact, and where it is smooth.

CasADi multiplies constants while it differentiates, (0.3 (0.7 x))' = fl(0.3 0.7), and that product is rounded. Here
each constant is a symbol, so that no number is computed before the intervals do it. Only 0, +-1/2, +-1 and +-2 stay,
whose sums and products are exact, and the exponents of powers.

A derivative says nothing of a jump: |x|' = sign x is bounded across 0. Each operation that has a kink or a jump leaves
a guard, an expression that vanishes there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..base.types import Vector

_KEPT = (0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0)
_COMPARED = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX)
_TRUTHS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR)
_LOGICAL = (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO)
_SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE, ca.OP_ASSIGN)


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
        work: dict[int, ca.SX] = {}
        constant: dict[int, float] = {}  # register: its number, where it has one
        cuts: dict[int, frozenset[int]] = {}  # register: the guards of the cuts that it may jump at
        truths: set[int] = set()
        roots: set[int] = set()
        symbols, values, guards = [], [], []
        needed: dict[int, None] = {}
        rows = [ca.SX(0)] * made.size1_out(0)

        def guard(expression: ca.SX) -> int:
            guards.append(expression)
            return len(guards) - 1

        for k in range(made.n_instructions()):
            op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if op == ca.OP_OUTPUT:
                rows[out[1]] = work[into[0]]
                if not angular[out[1]]:
                    needed |= dict.fromkeys(cuts[into[0]])
                continue
            if op in (ca.OP_INPUT, ca.OP_CONST):
                register, number = out[0], made.instruction_constant(k) if op == ca.OP_CONST else None
                cuts[register] = frozenset()
                truths.discard(register)
                roots.discard(register)
                constant.pop(register, None)
                if number is None:
                    work[register] = given[into[1]]
                else:
                    constant[register] = number
                    work[register] = ca.SX(number) if number in _KEPT else ca.SX.sym(f"constant_{len(values)}")
                    if number not in _KEPT:
                        symbols.append(work[register])
                        values.append(number)
                continue
            arguments = [work[i] for i in into]
            jumps = frozenset[int]().union(*(cuts[i] for i in into))
            multiple = op == ca.OP_MUL and any(constant.get(i, 0.5) % 1 == 0 for i in into)
            if op in (ca.OP_POW, ca.OP_CONSTPOW) and constant.get(into[1], 0.5) % 1 == 0:
                arguments[1] = ca.SX(constant[into[1]])
            if op not in _SUMS and not multiple and jumps:
                if op not in (ca.OP_SIN, ca.OP_COS):
                    needed |= dict.fromkeys(jumps)
                jumps = frozenset()
            if op == ca.OP_ATAN2:
                y, x = arguments
                jumps = frozenset({guard(ca.sqrt(x * x + y * y) + x)})
            elif op in _COMPARED:
                needed[guard(arguments[0] - arguments[1])] = None
            elif op in (ca.OP_FABS, ca.OP_SIGN, ca.OP_COPYSIGN):
                positive = (
                    op == ca.OP_COPYSIGN and into[0] in roots
                )  # where a root vanishes its derivative is unbounded
                needed |= dict.fromkeys(guard(a) for a in arguments[positive:])
            elif op in _LOGICAL:
                asked = into[:1] if op == ca.OP_IF_ELSE_ZERO else into
                needed |= dict.fromkeys(guard(work[i]) for i in asked if i not in truths)
            made_of = ca.SX.unary(op, *arguments) if len(arguments) == 1 else ca.SX.binary(op, *arguments)
            register = out[0]
            work[register], cuts[register] = made_of, jumps
            constant.pop(register, None)
            (truths.add if op in _TRUTHS else truths.discard)(register)
            (roots.add if op == ca.OP_SQRT else roots.discard)(register)
        return Separated(
            ca.vertcat(*rows), ca.vertcat(*symbols), np.array(values), ca.vertcat(*(guards[i] for i in needed))
        )
