"""Where a formula may jump: the places at which an if_else, a floor, a sign, ... of it turns over."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

_NAMES = {getattr(ca, key): key.removeprefix("OP_").lower() for key in dir(ca) if key.startswith("OP_")}
_CONDITIONS = {ca.OP_LT: "if_else", ca.OP_LE: "if_else"}
_JUMPS = {
    ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_SIGN: "sign", ca.OP_COPYSIGN: "copysign", ca.OP_FMOD: "fmod",
    ca.OP_REMAINDER: "remainder", ca.OP_ATAN2: "atan2", **_CONDITIONS,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Switches:
    """The switches of an expression of q, by the operations in `words`.

    gap (k,): a function of q for each that vanishes where it turns over. state (k,): its place, a whole number that is
    another one on the other side.
    """

    words: tuple[str, ...]
    gap: ca.SX
    state: ca.SX


@dataclass(frozen=True, eq=False)
class Formula:
    """An expression (k,) of variables (m,) of its own, which are `at` (m,), an expression of q. angular: of which rows
    the values are angles."""

    expression: ca.SX
    variables: ca.SX
    at: ca.SX
    angular: tuple[bool, ...]


def switches_of(formula: Formula) -> list[Switches]:
    """The switches of a formula's rows, as expressions of q."""
    found = []
    for i, flag in enumerate(formula.angular):
        one = switches(formula.expression[i], formula.variables, angle=flag)
        if one.words:
            gap, state = ca.substitute([one.gap, one.state], [formula.variables], [formula.at])
            one = Switches(one.words, gap, state)
        found.append(one)
    return found


def switches(expression: ca.SX, q: ca.SX, *, angle: bool = False, reflected: bool = False) -> Switches:
    """The switches of an expression of q. What is a kink at most, as of fabs, fmin and fmax, is none.

    angle: the expression is an angle, to which the cut of an atan2 does nothing. reflected: it may hold factorisations
    of matrices, whose reflections choose a sign by copysign, and span the same planes with either.
    """
    flat = ca.densify(ca.vec(expression))
    made = ca.Function("made", [q], [flat])
    harmless = ({ca.OP_ATAN2} if angle else set()) | ({ca.OP_COPYSIGN} if reflected else set())
    if not ({made.instruction_id(i) for i in range(made.n_instructions())} & set(_JUMPS)) - harmless:
        return Switches((), ca.SX(0, 1), ca.SX(0, 1))
    made = ca.Function("made", [q], [ca.cse([flat])[0]])
    work: dict[int, ca.SX] = {}
    found: list[tuple[str, ca.SX, ca.SX]] = []
    for i in range(made.n_instructions()):
        op, out, into = made.instruction_id(i), made.instruction_output(i), made.instruction_input(i)
        if op == ca.OP_OUTPUT:
            continue
        if op == ca.OP_CONST:
            work[out[0]] = ca.SX(made.instruction_constant(i))
        elif op == ca.OP_INPUT:
            work[out[0]] = q[into[1]]
        else:
            parts = [work[j] for j in into]
            if op in _JUMPS and op not in harmless and not all(part.is_constant() for part in parts):
                found.append((_JUMPS[op], *_turning(op, parts)))
            work[out[0]] = ca.SX.unary(op, parts[0]) if len(parts) == 1 else ca.SX.binary(op, *parts)
    words, gaps, states = zip(*found, strict=True) if found else ((), (), ())
    return Switches(tuple(words), ca.vertcat(ca.SX(0, 1), *gaps), ca.vertcat(ca.SX(0, 1), *states))


def _turning(op: int, parts: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """(gap, state) of one operation."""
    a = parts[0]
    if op in _CONDITIONS:
        return a - parts[1], a > parts[1]
    if op in (ca.OP_FLOOR, ca.OP_CEIL):
        return a - ca.floor(a + 0.5), ca.floor(a)
    if op == ca.OP_SIGN:
        return a, a > 0
    if op == ca.OP_COPYSIGN:
        return parts[1], parts[1] > 0
    if op == ca.OP_ATAN2:  # only where the second argument is negative
        return a, ca.if_else(parts[1] < 0, a > 0, 2)
    ratio = a / parts[1] + (0.5 if op == ca.OP_REMAINDER else 0.0)
    return ratio - ca.floor(ratio + 0.5), ca.floor(ratio)
