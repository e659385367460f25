"""Taylor models: what an expression is along a curve and near it, as a polynomial with a bound of what is left.

Every operation of a CasADi function is applied to models instead of numbers, for all |t| <= 1 and |u_j| <= 1:

    m + a t + b t^2 + c t^3 + sum_j e_j u_j,   give or take r;   give or take r0 where all u_j are 0

The arguments are x = c + t v + t^2 w + t^3 z, each with a width of its own. What is linear in the u_j and cubic in t is
exact: a model serves over pieces ten times as long as an `Enclosure`, which keeps the middle alone. Round-off is not
enclosed, and a copysign takes the sign at the middle, as there.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import casadi as ca

from ..base.errors import NativeError

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
        if any(self._made.instruction_id(k) not in known for k in range(self.instructions)):
            raise NativeError(f"{name} has an operation that has no Taylor model")

    @cached_property
    def c(self) -> str:
        """C99 of `static void NAME(const hk_model *x, hk_model *y)`, for model.c."""
        made, lines = self._made, []
        constant: dict[int, float] = {}
        for k in range(self.instructions):
            op, out, into = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if op == ca.OP_OUTPUT:
                lines.append(_written(f"y + {out[1]}", into[0], constant))
                continue
            if op == ca.OP_CONST:
                constant[out[0]] = made.instruction_constant(k)
                continue
            if op == ca.OP_INPUT:
                code = f"w[{out[0]}] = x[{into[1]}]"
            elif op == ca.OP_COPYSIGN:
                code = _copysign(into, out[0], constant)
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


def _copysign(into: list[int], out: int, constant: Mapping[int, float]) -> str:
    if into[0] not in constant:
        raise NativeError("a copysign of what is no number has no Taylor model")
    sign = f"HK_C({constant[into[1]]!r})" if into[1] in constant else f"w[{into[1]}].m"
    return f"hk_model_constant(HK_COPYSIGN(HK_C({constant[into[0]]!r}), {sign}), w + {out})"


def _written(there: str, register: int, constant: Mapping[int, float]) -> str:
    if register in constant:
        return f"  hk_model_constant(HK_C({constant[register]!r}), {there});"
    return f"  *({there}) = w[{register}];"
