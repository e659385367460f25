"""Calculus of expressions: derivatives, Lie brackets, Taylor models, switches, integration along a line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from ..base.errors import ArgumentError, NativeError
from ..base.types import Vector
from .native.emit import Pieces, Transport, applied, operations, walk


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


def _staged(outputs: ca.SX, early: ca.SX, late: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """(outputs, symbols, values): outputs (k,) of early and late symbols, in two stages.

    What an output that needs late symbols takes from early ones alone stands in it as one of the new symbols, with its
    value, an expression of the early ones. Equal expressions are one.
    """
    made = ca.Function("outputs", [early, late], ca.cse([ca.densify(outputs)]))
    symbols, values = [], []

    def operand(part: _Register) -> ca.SX:
        if part.late or part.value.is_constant():
            return part.value
        if part.stands is None:
            part.stands = ca.SX.sym(f"early{len(symbols)}")
            symbols.append(part.stands)
            values.append(part.value)
        return part.stands

    def apply(op: int, parts: list[_Register]) -> _Register:
        late = any(part.late for part in parts)
        return _Register(applied(op, [operand(part) if late else part.value for part in parts]), late)

    rows = walk(
        made,
        lambda argument, i: _Register((early, late)[argument][i], bool(argument)),
        lambda number: _Register(ca.SX(number), False),
        apply,
    )
    stages = ca.SX(*outputs.shape)
    for row, part in rows.items():
        stages[row] = part.value
    return stages, ca.vertcat(ca.SX(0, 1), *symbols), ca.vertcat(ca.SX(0, 1), *values)


@dataclass(eq=False)
class _Register:
    """A number on its way: its expression, whether it needs late symbols, and the symbol that stands for it in them."""

    value: ca.SX
    late: bool
    stands: ca.SX | None = None


# --- Taylor models: what an expression is along a curve and near it, as a polynomial with a bound of what is left.
#
# Every operation of a CasADi function is applied to models instead of numbers, for all |t| <= 1 and |u_j| <= 1:
#
#     m + a t + b t^2 + c t^3 + sum_j e_j u_j,   give or take r;   give or take r0 where all u_j are 0
#
# The arguments are x = c + t v + t^2 w + t^3 z, each with a width of its own. What is linear in the u_j and cubic in t
# is exact: a model serves over pieces ten times as long as an `Enclosure`, which keeps the middle alone. Round-off is
# not enclosed, and a copysign takes the sign at the middle, as there.

_UNARY = {
    ca.OP_NEG: "hk_model_scale({0}, HK_C(-1), {1})",
    ca.OP_TWICE: "hk_model_scale({0}, HK_C(2), {1})",
    ca.OP_SQ: "hk_model_times({0}, {0}, {1})",
    ca.OP_INV: "hk_model_inverse({0}, {1})",
    ca.OP_SQRT: "hk_model_sqrt({0}, {1})",
    ca.OP_SIN: "hk_model_sin({0}, {1})",
    ca.OP_COS: "hk_model_cos({0}, {1})",
}
_BINARY = {
    ca.OP_ADD: "hk_model_plus({0}, {1}, HK_C(1), {2})",
    ca.OP_SUB: "hk_model_plus({0}, {1}, HK_C(-1), {2})",
    ca.OP_MUL: "hk_model_times({0}, {1}, {2})",
    ca.OP_DIV: "hk_model_over({0}, {1}, {2})",
}


class TaylorModel:
    """The models of an expression y (k,), all of it in a row, along curves of its symbols x (all in a row).

    Raises:
        NativeError: an operation that has no model here.
    """

    def __init__(self, name: str, inputs: Mapping[str, ca.SX], output: ca.SX) -> None:
        self.name = name
        self._made = ca.Function(name, [ca.vertcat(*inputs.values())], ca.cse([ca.densify(ca.vec(output))]))
        self.instructions: int = self._made.n_instructions()
        known = {*_UNARY, *_BINARY, ca.OP_COPYSIGN, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        if operations(self._made) - known:
            raise NativeError(f"{name} has an operation that has no Taylor model")

    @cached_property
    def c(self) -> str:
        """C99 of `static void NAME(const hk_model *x, hk_model *y)`, for model.c."""
        made, lines = self._made, []
        constant: dict[int, float] = {}
        for k in range(self.instructions):
            op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if op == ca.OP_OUTPUT:
                number = constant.get(into[0])
                copy = f"*(y + {out[1]}) = w[{into[0]}]"
                fixed = f"hk_model_constant(HK_C({number!r}), y + {out[1]})"
                lines.append(f"  {copy if number is None else fixed};")
                continue
            if op == ca.OP_CONST:
                constant[out[0]] = made.instruction_constant(k)
                continue
            if op == ca.OP_INPUT:
                code = f"w[{out[0]}] = x[{into[1]}]"
            elif op == ca.OP_COPYSIGN:
                if into[0] not in constant:
                    raise NativeError("a copysign of what is no number has no Taylor model")
                sign = f"HK_C({constant[into[1]]!r})" if into[1] in constant else f"w[{into[1]}].m"
                code = f"hk_model_constant(HK_COPYSIGN(HK_C({constant[into[0]]!r}), {sign}), w + {out[0]})"
            else:
                code = _operation(op, into, out[0], constant)
            constant.pop(out[0], None)
            lines.append(f"  {code};")
        body = "\n".join(lines)
        return (
            f"static void {self.name}(const hk_model *restrict x, hk_model *restrict y) {{\n"
            f"  hk_model w[{made.sz_w()}];\n{body}\n}}\n"
        )


def _operation(op: int, into: list[int], out: int, constant: Mapping[int, float]) -> str:
    there = f"w + {out}"
    given = [i for i in into if i in constant]
    if len(given) == 1 and len(into) == 2:  # a number and a model, which is quicker
        number, first = f"HK_C({constant[given[0]]!r})", into[0] in constant
        other = f"w + {into[1] if first else into[0]}"
        if op == ca.OP_MUL:
            return f"hk_model_scale({other}, {number}, {there})"
        if op == ca.OP_DIV and not first:
            return f"hk_model_scale({other}, HK_C(1) / {number}, {there})"
        if op in (ca.OP_ADD, ca.OP_SUB):
            sign = "HK_C(-1)" if op == ca.OP_SUB and first else "HK_C(1)"
            shift = f"-{number}" if op == ca.OP_SUB and not first else number
            return f"hk_model_scale({other}, {sign}, {there}), w[{out}].m += {shift}"
    made = "".join(f"hk_model_constant(HK_C({constant[i]!r}), w + {i}), " for i in dict.fromkeys(given))
    places = [f"w + {i}" for i in into[: 2 if op in _BINARY else 1]]
    return made + (_BINARY if op in _BINARY else _UNARY)[op].format(*places, there)


# --- Where a formula may jump: the places at which an if_else, a floor, a sign, ... of it turns over.

_CONDITIONS = {ca.OP_LT: "if_else", ca.OP_LE: "if_else"}
_JUMPS = {
    **{
        getattr(ca, f"OP_{name.upper()}"): name
        for name in ["floor", "ceil", "sign", "copysign", "fmod", "remainder", "atan2"]
    },
    **_CONDITIONS,
}


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


_LINEAR, _PRODUCTS = {ca.OP_ADD, ca.OP_SUB, ca.OP_NEG}, {ca.OP_MUL, ca.OP_SQ, ca.OP_TWICE}


def bends_widely(formula: Formula) -> bool:
    """Whether a formula is a polynomial of its variables, and of sines and cosines of single ones: of whole turns, and
    not of parts of them."""

    def apply(op: int, kinds: list[str]) -> str:
        if op == ca.OP_ASSIGN or set(kinds) == {"constant"}:
            return kinds[0]
        if op in _LINEAR and sorted(kinds) in (["variable"], ["constant", "variable"]):
            return "variable"
        divided = op == ca.OP_DIV and kinds[1] == "constant"
        if "other" not in kinds and (op in _LINEAR | _PRODUCTS or divided):
            return "polynomial"
        return "polynomial" if op in (ca.OP_SIN, ca.OP_COS) and kinds == ["variable"] else "other"

    made = ca.Function("made", [formula.variables], [formula.expression])
    return "other" not in walk(made, lambda _, i: "variable", lambda _: "constant", apply).values()


def switches_of(formula: Formula) -> list[Switches]:
    """The switches of a formula's rows, as expressions of q."""
    switches_by_row = []
    for i, flag in enumerate(formula.angular):
        row = switches(formula.expression[i], formula.variables, angle=flag)
        if row.words:
            gap, state = ca.substitute([row.gap, row.state], [formula.variables], [formula.at])
            row = Switches(row.words, gap, state)
        switches_by_row.append(row)
    return switches_by_row


def switches(expression: ca.SX, q: ca.SX, *, angle: bool = False, reflected: bool = False) -> Switches:
    """The switches of an expression of q. What is a kink at most, as of fabs, fmin and fmax, is none.

    angle: the expression is an angle, to which the cut of an atan2 does nothing. reflected: it may hold factorisations
    of matrices, whose reflections choose a sign by copysign, and span the same planes with either.
    """
    flat = ca.densify(ca.vec(expression))
    made = ca.Function("made", [q], [flat])
    harmless = ({ca.OP_ATAN2} if angle else set()) | ({ca.OP_COPYSIGN} if reflected else set())
    if not (operations(made) & set(_JUMPS)) - harmless:
        return Switches((), ca.SX(0, 1), ca.SX(0, 1))
    made = ca.Function("made", [q], [ca.cse([flat])[0]])
    turning: list[tuple[str, ca.SX, ca.SX]] = []

    def apply(op: int, parts: list[ca.SX]) -> ca.SX:
        if op in _JUMPS and op not in harmless and not all(part.is_constant() for part in parts):
            turning.append((_JUMPS[op], *_turning(op, parts)))
        return applied(op, parts)

    walk(made, lambda _, i: q[i], ca.SX, apply)
    words, gaps, states = zip(*turning, strict=True) if turning else ((), (), ())
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


# --- The Runge-Kutta step of order 4, for numbers and for expressions, and many of them as a loop.


def runge_kutta(rate: Callable[[Any, Any], Any], y: Any, h: float, start: Any, middle: Any, end: Any) -> Any:
    r"""y after a step h of y' = rate(y, u), u the input at its start, middle and end.

    $y + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4)$. y, u and the rates are NumPy arrays of any shape, or expressions.
    """
    k1 = rate(y, start)
    k2 = rate(y + h / 2 * k1, middle)
    k3 = rate(y + h / 2 * k2, middle)
    k4 = rate(y + h * k3, end)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def transport(
    begin: Callable[[ca.SX], ca.SX],
    rate: Callable[[ca.SX, ca.SX], tuple[ca.SX, ca.SX]],
    slope: Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]],
    miss: Callable[[ca.SX], ca.SX],
    end: Callable[..., tuple[ca.SX, ca.SX, ca.SX]],
    doubt: Callable[..., ca.SX],
    *,
    center: Vector,
    steps: int,
) -> Transport:
    """The loop of `steps` Runge-Kutta steps from share 0 to -1, of maps of expressions: see `Pieces` for what they are.

    Args:
        rate: (y, v) -> its first two results. slope: (y, v, w) -> what `pull` gives. end: without its slopes.
        doubt: (q, y, v, the gradient beside the planes of f (n,), and along them (m,), gaps, factor) -> what `back`
            gives besides.
        center: the posture (n,) over which the label is 0.
    """
    # The maps, each of symbols of its own.
    q, y, f, w = (ca.SX.sym(name, len(center)) for name in "qyfw")
    rcond_start, rcond_least = ca.SX.sym("first"), ca.SX.sym("least")
    began = begin(q)
    v = ca.SX.sym("v", *began.shape)
    (moved, rcond), (by_y, by_v) = rate(y, v), slope(y, v, w)
    label, margin, factor = end(q, y, f, rcond_start, rcond_least)
    slopes = ca.horzcat(*(gradient(label[i], y).T for i in range(label.shape[0])))
    b, c, gaps, kept_share = ca.SX.sym("b", *v.shape), ca.SX.sym("c", *v.shape), ca.SX.sym("gaps", 2), ca.SX.sym("kept")

    def by_q(by_v: ca.SX) -> ca.SX:
        """The slopes w by y and those by v as slopes by q: v moves with it."""
        return w + gradient(by_v.T @ began, q).T

    # The pieces of the loop: what one stage needs of another stands in it as a symbol.
    n = len(center)
    expressions, left, values = _staged(ca.vertcat(moved, rcond, by_y, by_v), ca.vertcat(y, v), w)
    pieces = Pieces(
        begin=_function("begin", [q], began),
        rate=_function("rate", [y, v], expressions[:n], expressions[n], values),
        pull=_function("pull", [left, w], expressions[n + 1 : 2 * n + 1], expressions[2 * n + 1 :]),
        miss=_function("miss", [y], miss(y)),
        end=_function("end", [q, y, f, rcond_start, rcond_least], label, margin, slopes, factor),
        back=_function(
            "back",
            [q, y, v, w, b, c, gaps, kept_share],
            kept_share * by_q(b),
            doubt(q, y, v, by_q(-c), b + c, gaps, kept_share),
        ),
    )
    size = label.shape[0] * (1 + n) + 1
    return Transport(pieces, steps, -1.0 / steps, ca.SX.sym("found", size), center)


def _function(name: str, inputs: list[ca.SX], *outputs: ca.SX) -> ca.Function:
    return ca.Function(name, inputs, ca.cse([ca.densify(output) for output in outputs]))
