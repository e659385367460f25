"""Derivatives of expressions: Jacobian, gradient, Hessian, Lie bracket."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..base.errors import ArgumentError


def jacobian(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d expression / d q; (k,), (n,) -> (k, n). A matrix is taken column by column. Raises: ArgumentError."""
    if not q.is_valid_input():
        raise ArgumentError("what to differentiate by", q, "give a symbol of casadi, as casadi.SX.sym('q', n)")
    return ca.densify(ca.jacobian(ca.vec(expression), q))


def gradient(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d expression / d q of a scalar, (n,) -> (1, n), by one sweep back that shares what the expression computes."""
    return ca.densify(ca.gradient(expression, q)).T


def hessian(expression: ca.SX, q: ca.SX) -> ca.SX:
    """d^2 expression / d q^2 of a scalar; (n,) -> (n, n)."""
    return ca.densify(ca.hessian(expression, q)[0])


def directional(expression: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """(d expression / d q) v, of the shape of the expression; no Jacobian is formed."""
    return ca.reshape(ca.jtimes(ca.vec(expression), q, v), *expression.shape)


def lie_bracket(A: ca.SX, B: ca.SX, q: ca.SX) -> ca.SX:
    """[A, B] = (dB/dq) A - (dA/dq) B of two vector fields; (n,), (n,), (n,) -> (n,). [ZR11, (5)]"""
    return directional(B, q, A) - directional(A, q, B)  # (5)


def pairwise_brackets(fields: ca.SX, q: ca.SX) -> dict[tuple[int, int], ca.SX]:
    """[B_a, B_b] for all columns a < b of a matrix of vector fields (n, k)."""
    k = fields.shape[1]
    along = [directional(fields, q, fields[:, a]) for a in range(k)]  # along[a][:, b] = (dB_b) B_a
    # (36): the brackets [N_i, N_j] in it, of any fields: of a null-space basis N, J [N_a, N_b] = 0
    return {(a, b): along[a][:, b] - along[b][:, a] for a in range(k) for b in range(a + 1, k)}


def staged(outputs: ca.SX, early: ca.SX, late: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """(outputs, symbols, values): outputs (k,) of early and late symbols, in two stages.

    What an output that needs late symbols takes from early ones alone stands in it as one of the new symbols, with its
    value, an expression of the early ones. Equal expressions are one.
    """
    made = ca.Function("outputs", [early, late], ca.cse([ca.densify(outputs)]))
    registers: dict[int, _Register] = {}
    found, symbols, values = ca.SX(*outputs.shape), [], []

    def operand(one: _Register) -> ca.SX:
        if one.late or one.value.is_constant():
            return one.value
        if one.stands is None:
            one.stands = ca.SX.sym(f"early{len(symbols)}")
            symbols.append(one.stands)
            values.append(one.value)
        return one.stands

    for k in range(made.n_instructions()):
        op, into, out = made.instruction_id(k), made.instruction_input(k), made.instruction_output(k)
        if op == ca.OP_OUTPUT:
            found[out[1]] = registers[into[0]].value
        elif op == ca.OP_INPUT:
            registers[out[0]] = _Register((early, late)[into[0]][into[1]], bool(into[0]))
        elif op == ca.OP_CONST:
            registers[out[0]] = _Register(ca.SX(made.instruction_constant(k)), False)
        else:
            given = [registers[i] for i in into]
            needs = any(one.late for one in given)
            parts = [operand(one) if needs else one.value for one in given]
            value = ca.SX.unary(op, *parts) if len(parts) == 1 else ca.SX.binary(op, *parts)
            registers[out[0]] = _Register(value, needs)
    return found, ca.vertcat(ca.SX(0, 1), *symbols), ca.vertcat(ca.SX(0, 1), *values)


@dataclass(eq=False)
class _Register:
    """A number on its way: its expression, whether it needs late symbols, and the symbol that stands for it in them."""

    value: ca.SX
    late: bool
    stands: ca.SX | None = None
