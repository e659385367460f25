"""C from an expression: straight-line code that is read once by a compiler for numbers, and once for vectors of them.

A CasADi function of scalars is a list of operations. Each becomes one line `const hk_t v7 = v3 * v5;`, in C99
without allocation, globals or branches. What `hk_t` and the HK_ macros mean is up to the prelude before it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, reduce
from importlib.resources import files
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from ...base.errors import NativeError
from ...base.types import Array, Vector

_OF_ONE = (
    "SQRT SIN COS TAN ASIN ACOS ATAN EXP LOG SINH COSH TANH FABS SIGN NOT FLOOR CEIL ASINH ACOSH ATANH ERF LOG1P EXPM1"
)
_OF_TWO = "FMIN FMAX COPYSIGN ATAN2 POW LT LE EQ NE AND OR FMOD HYPOT"
_BINARY = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_CONSTPOW: "HK_POW({}, {})",
    ca.OP_IF_ELSE_ZERO: "HK_IF({}, {})",
    **{getattr(ca, f"OP_{name}"): f"HK_{name}({{}}, {{}})" for name in _OF_TWO.split()},
}
_UNARY = {
    ca.OP_ASSIGN: "{}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "HK_C(1) / {}",
    **{getattr(ca, f"OP_{name}"): f"HK_{name}({{}})" for name in _OF_ONE.split()},
}
"""CasADi's operations -> their C, of two arguments and of one."""

_CONSTANT = {"inf": "HK_INF", "-inf": "(-HK_INF)", "nan": "HK_NAN", "-nan": "HK_NAN"}

SCALAR, LANES = "scalar.h", "lanes.h"
"""The preludes: hk_t is one number, or a few side by side in a vector register."""


OPERATION_NAMES: dict[int, str] = {
    getattr(ca, key): key.removeprefix("OP_") for key in dir(ca) if key.startswith("OP_")
}
"""CasADi's names of its operations, as "SQRT"."""

T = TypeVar("T")


def walk(
    function: ca.Function,
    read: Callable[[int, int], T],
    constant: Callable[[float], T],
    apply: Callable[[int, list[T]], T],
) -> dict[int, T]:
    """What a function gives where values of any kind stand for its numbers: element of its outputs -> value.

    Its instructions are gone through in order, so an operation is applied when its arguments are known.

    Args:
        read: (argument, element in column-major order) -> value. constant: number -> value. apply: (operation,
            values of its arguments) -> value.
    """
    registers: dict[int, T] = {}
    outputs: dict[int, T] = {}
    for k in range(function.n_instructions()):
        op, out, into = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            outputs[out[1]] = registers[into[0]]
        elif op == ca.OP_CONST:
            registers[out[0]] = constant(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            registers[out[0]] = read(into[0], into[1])
        else:
            registers[out[0]] = apply(op, [registers[i] for i in into])
    return outputs


def operations(function: ca.Function) -> set[int]:
    """The kinds of operations of a function, reading and writing among them."""
    return {function.instruction_id(k) for k in range(function.n_instructions())}


def applied(op: int, arguments: Sequence[ca.SX]) -> ca.SX:
    """An operation of one argument or two, applied to expressions."""
    return ca.SX.unary(op, *arguments) if len(arguments) == 1 else ca.SX.binary(op, *arguments)


def emit(function: ca.Function, name: str, x: Callable[[int, int], str], y: Callable[[int, int], str]) -> str:
    """The body of a function, a C block: reads its inputs, writes its outputs, and nothing else.

    Args:
        name: for messages. x, y: (argument, element in column-major order) -> C expression to read, or to assign to.

    Raises:
        NativeError: an operation that has no C here.
    """
    lines: list[str] = []
    register: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        out = function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            lines.append(f"  {y(out[0], out[1])} = {register[function.instruction_input(k)[0]]};")
            continue
        into = function.instruction_input(k)
        if op == ca.OP_CONST:
            register[out[0]] = _CONSTANT.get(repr(value := function.instruction_constant(k)), f"HK_C({value!r})")
            continue
        if op == ca.OP_INPUT:
            value = x(into[0], into[1])
        elif op in _BINARY:
            value = _BINARY[op].format(*(register[i] for i in into))
        elif op in _UNARY:
            value = _UNARY[op].format(register[into[0]])
        else:
            raise NativeError(f"{name} uses CasADi's OP_{OPERATION_NAMES.get(op, op)}, which has no C here")
        register[out[0]] = f"v{k}"
        lines.append(f"  const hk_t v{k} = {value};")
    return "\n".join(lines)


def prelude(name: str) -> str:
    """The text of a prelude or of the driver."""
    return files("holokin.symbolic.native").joinpath("c", name).read_text("utf-8")


# --- A transport amid a `Function`: a loop that straight-line code would make hundreds of thousands of lines of.
#
# A posture q is carried to y(1) by y' = f(y, v), in Runge-Kutta steps of order 4 with a v of its own; a label of y(1)
# and its gradient by q stand in expressions as symbols. The gradient is one sweep back through the steps for each row
# of the label, from what each evaluation of f has left behind, so it is that of the steps themselves, to round-off.

SHARES, WEIGHTS = (0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""Runge-Kutta of order 4: where its four rates are taken, and how they count."""

MOST_KEPT = 4096
"""Numbers that C keeps of all rates for the sweep back; a Panda's 4 steps leave 2,240. Of more steps it takes the rates
twice, for half as much time again, and keeps those of one step: threads have little memory for calls."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight-line code of a transport, n joints, m numbers in v, r rows in the label, k numbers left behind.

    begin: q -> v.
    rate: (y, v) -> f(y, v) (n,), rcond, what `pull` needs of this evaluation (k,).
    pull: (what `rate` left, w (n,)) -> gradients of w^T f by y (n,) and by v (m,).
    miss: y(1) -> the v (m,) that is still missing there.
    end: (q, y(1), f of what is missing, rcond at q, least rcond) -> label (r,), margin, its slopes by y(1) (n, r), and
        a factor on the gradient, 0 where it is of no use.
    back: (q, y(1), v, slopes by q as a posture (n,) and by v (m,), the first of them times df/dv (m,), squares of the
        gaps of the sweep, of both slopes (2,), the factor) -> the gradient by q (n,), what its error takes off the
        margin.
    """

    begin: ca.Function
    rate: ca.Function
    pull: ca.Function
    miss: ca.Function
    end: ca.Function
    back: ca.Function

    def each(self) -> dict[str, ca.Function]:
        """By their names."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True, eq=False)
class Transport:
    """The loop over its pieces: q (n,) -> label (r,), its gradient by rows (r n,), margin, one after another.

    `found` are the symbols that stand for these in the expressions of a `Function` of q; h is the size of a step;
    `center` (n,) is the posture over which the label is 0.
    """

    pieces: Pieces
    steps: int
    h: float
    found: ca.SX
    center: Vector

    @property
    def rows(self) -> int:
        """r, the rows of the label."""
        return self.pieces.end.size1_out(0)

    @property
    def joints(self) -> int:
        """n, the numbers of a posture."""
        return self.pieces.begin.size1_in(0)

    @property
    def label(self) -> ca.SX:
        """The symbols of the label (r,)."""
        return self.found[: self.rows]

    @property
    def gradient(self) -> ca.SX:
        """The symbols of the gradient (r, n)."""
        return ca.reshape(self.found[self.rows : -1], self.joints, self.rows).T

    @property
    def margin(self) -> ca.SX:
        """The symbol of the margin."""
        return self.found[-1]

    @property
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """The symbols of the label, the gradient and the margin."""
        return self.label, self.gradient, self.margin

    @property
    def lengths(self) -> dict[str, int]:
        """Operations of the pieces, as many as there are lines of C."""
        return {name: piece.n_instructions() for name, piece in self.pieces.each().items()}

    def operations(self, sloping: bool) -> int:
        """Operations of a call, with the gradient or without."""
        size, rates = self.lengths, 4 * self.steps
        label = size["begin"] + (rates + 1) * size["rate"] + size["miss"] + size["end"]
        again = 0 if rates * self.pieces.pull.size1_in(0) <= MOST_KEPT else rates * size["rate"]
        return label + sloping * self.rows * ((rates + 1) * size["pull"] + again + size["back"])

    @cached_property
    def function(self) -> ca.Function:
        """The loop for the virtual machine."""
        q = ca.MX.sym("q", self.joints)
        label, gradient, margin = self(q)
        return ca.Function("transport", [q], [ca.vertcat(label, ca.vec(gradient.T), margin)])

    def __call__(self, q: Any) -> tuple[Any, Any, Any]:
        """(label (r,), gradient (r, n), margin) at q (n,), of SX written out, of MX as calls of the pieces."""
        p, h, none = self.pieces, self.h, type(q).zeros
        v, y = p.begin(q), q
        left, rconds = [], []
        for _ in range(self.steps):
            total, f = 0, none(self.joints)
            for share, weight in zip(SHARES, WEIGHTS, strict=True):
                f, rcond, behind = p.rate(y + share * h * f, v)
                total, left, rconds = total + weight * f, [*left, behind], [*rconds, rcond]
            y = y + h * total
        label, margin, slopes, factor = p.end(q, y, p.rate(y, p.miss(y))[0], rconds[0], reduce(ca.fmin, rconds))
        gradients = []
        for row in range(self.rows):
            by_y, by_v, gaps, ahead = slopes[:, row], none(v.shape[0]), none(2), None
            for step in reversed(range(self.steps)):
                of_end, position = by_y, (0, 0)
                for stage in reversed(range(4)):
                    into = SHARES[stage + 1] * position[0] if stage < 3 else 0
                    position = p.pull(left[4 * step + stage], h * (WEIGHTS[stage] * of_end + into))
                    if stage == 3 and ahead is not None:
                        gaps = gaps + _gaps(ahead, position)
                    by_y, by_v = by_y + position[0], by_v + position[1]
                ahead = position
            first = p.pull(left[0], h * WEIGHTS[0] * by_y)
            gaps = gaps + _gaps(ahead, first)
            moved, doubt = p.back(q, y, v, by_y, by_v, first[1] / (h * WEIGHTS[0]), gaps, factor)
            gradients, margin = [*gradients, moved.T], ca.fmax(margin - doubt, 0)
        return label, ca.vertcat(*gradients), margin

    @cached_property
    def c(self) -> str:
        """C of `static void hk_transport(const hk_t *q, hk_t *found, int sloping)`; it counts once in a file."""
        sizes = {
            "N": self.joints,
            "M": self.pieces.begin.size1_out(0),
            "R": self.rows,
            "K": self.pieces.pull.size1_in(0),
            "S": self.steps,
            "H": repr(self.h),
            "MOST": MOST_KEPT,
        }
        head = "".join(f"#define HK_TRANSPORT_{key} {value}\n" for key, value in sizes.items())
        pieces = "".join(_piece(name, piece) for name, piece in self.pieces.each().items())
        return f"#ifndef HK_TRANSPORT\n#define HK_TRANSPORT\n{head}{pieces}{prelude('transport.c')}#endif\n"


def _gaps(first: Any, second: Any) -> Any:
    """Squares of the differences (2,) of two pairs of slopes."""
    return ca.vertcat(*(ca.sumsqr(a - b) for a, b in zip(first, second, strict=True)))


def _piece(name: str, piece: ca.Function) -> str:
    """C of a piece: pointers to its inputs, then to its outputs, each in CasADi's order."""
    given = [f"const hk_t *restrict x{i}" for i in range(piece.n_in())]
    pointers = [f"hk_t *restrict y{i}" for i in range(piece.n_out())]
    idle = "".join(f"  (void)x{i};\n" for i in range(piece.n_in()))
    code = emit(piece, name, lambda a, i: f"x{a}[{i}]", lambda a, i: f"y{a}[{i}]")
    return f"static void hk_transport_{name}({', '.join([*given, *pointers])}) {{\n{idle}{code}\n}}\n"


# --- What a `Function` runs: straight-line code, or such code around a loop, and around a square system, by numbers.
#
#     t = transport(q);   before: (x, t) -> A, B, and the outputs that need no more;   X = A^-1 B by Householder;
#     after: (x, t, X) -> the rest
#
# Written out, an n x n solve takes about 2 n^3 operations: the fastest code there is for an arm, and, for sixty joints,
# half a million lines that no compiler can finish.

Shapes = Sequence[tuple[int, ...]]

SHARED = 20_000
"""Operations up to which common ones are looked for: it saves up to a fifth, and takes 5 us for each."""


@dataclass(frozen=True, eq=False)
class System:
    """A X = B, to be solved by numbers amid a `Function`: the symbols stand for what will be found."""

    A: ca.SX
    B: ca.SX
    X: ca.SX
    measures: ca.SX
    """(2,): rcond, orientation."""


@dataclass(frozen=True)
class Program:
    """The stages of a function. `early` are the outputs that `before` gives, `late` those of `after`.

    Without a system there is no `after`, and `order` and `columns`, the shape of B, are 0. With a transport all stages
    take what it finds from the input numbered `carried` as one input more.
    """

    before: ca.Function
    after: ca.Function | None
    early: tuple[int, ...]
    late: tuple[int, ...]
    order: int = 0
    columns: int = 0
    transport: Transport | None = None
    carried: int = 0

    @property
    def instructions(self) -> int:
        """Operations as they are written down, those of a loop once."""
        return sum(self._lengths)

    @property
    def longest(self) -> int:
        """Operations of the longest piece without a branch: what a compiler's time hangs on."""
        return max(self._lengths)

    @property
    def operations(self) -> int:
        """Operations of one call, those of a loop as often as it runs."""
        if self.transport is None:
            return self.instructions
        return self.instructions - sum(self.transport.lengths.values()) + self.transport.operations(self.sloping)

    @property
    def _lengths(self) -> list[int]:
        stages = [stage.n_instructions() for stage in (self.before, self.after) if stage is not None]
        return stages + ([] if self.transport is None else list(self.transport.lengths.values()))

    @property
    def sloping(self) -> bool:
        """True when the gradient of the transport's label is needed."""
        if self.transport is None:
            return False
        place = self.before.n_in() - 1, self.transport.rows, self.transport.found.shape[0] - 1
        return any(_reads(stage, *place) for stage in (self.before, self.after) if stage is not None)


def program(
    name: str,
    inputs: Mapping[str, ca.SX],
    outputs: Mapping[str, ca.SX],
    system: System | None,
    transport: Transport | None = None,
) -> Program:
    """The stages that compute outputs, which may hold the symbols of a system, and those of a transport of q."""
    symbols = list(inputs.values())
    values = [ca.densify(ca.SX(value)) for value in outputs.values()]
    if transport is not None:
        return replace(
            program(name, {**inputs, "found": transport.found}, outputs, system),
            transport=transport,
            carried=list(inputs).index("q"),
        )
    if system is None:
        return Program(_shared(name, symbols, values), None, tuple(range(len(values))), ())
    unknowns = [system.X, system.measures]
    unknown = ca.vertcat(ca.vec(system.X), system.measures)
    late = tuple(i for i, value in enumerate(values) if ca.depends_on(value, unknown))
    early = tuple(i for i in range(len(values)) if i not in late)
    before = _shared(name, symbols, [*(values[i] for i in early), ca.densify(system.A), ca.densify(system.B)])
    after = _shared(f"{name}_after", [*symbols, *unknowns], [values[i] for i in late])
    return Program(before, after, early, late, *system.B.shape)


def _shared(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    function = ca.Function(name, inputs, outputs)
    return _with_common_operations(function.serialize()) if function.n_instructions() <= SHARED else function


@lru_cache(maxsize=128)
def _with_common_operations(text: str) -> ca.Function:
    """The same with each operation done once. Of a serialized function: what is made again has it at once."""
    function = ca.Function.deserialize(text)
    inputs = function.sx_in()
    return ca.Function(function.name(), inputs, ca.cse(function.call(inputs)))


def _reads(function: ca.Function, argument: int, first: int, last: int) -> bool:
    """True when a function reads one of the elements from first to before last of an argument."""
    places = (
        function.instruction_input(k)
        for k in range(function.n_instructions())
        if function.instruction_id(k) == ca.OP_INPUT
    )
    return any(place[0] == argument and first <= place[1] < last for place in places)


class Port(threading.local):
    """One thread's evaluation memory: write `arguments`, call `trigger()`, read `results`.

    All of them lie in `numbers`, one after the other. With a count, that many samples at once, side by side along the
    last axis.
    """

    trigger: Callable[[], None]

    def __init__(self, made: Program, inputs: Shapes, outputs: Shapes, count: int | None = None):
        # Arguments and results, views of one array.
        extra = () if count is None else (count,)
        shapes = [(*shape, *extra) for shape in (*inputs, *outputs)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes]).tolist()
        self.numbers = np.zeros(ends[-1] if ends else 0)
        parts = np.split(self.numbers, ends[:-1])
        arrays = [_columns(part, shape) for part, shape in zip(parts, shapes, strict=False)]
        self.arguments, self.results = arrays[: len(inputs)], arrays[len(inputs) :]
        # What a transport finds is one argument more.
        early = [self.results[i] for i in made.early]
        given, carry = self.arguments, None
        if made.transport is not None:
            memory = _memory((made.transport.found.shape[0], *extra))
            given = [*given, memory]
            self._carrying, carry = _bind(
                [made.transport.function], [[self.arguments[made.carried]]], [[memory]], count
            )
        if made.after is None:
            self._buffers, first = _bind([made.before], [given], [early], count)
            self.trigger = first if carry is None else _both(carry, first)
            return
        # With a system: the stage before it, the solution, the stage after it.
        n, k = made.order, made.columns
        A, B, X = (_memory((*shape, *extra)) for shape in ((n, n), (n, k), (n, k)))
        measures = _memory((2, *extra))
        late = [self.results[i] for i in made.late]
        self._buffers, first, last = _bind(
            [made.before, made.after], [given, [*given, X, measures]], [[*early, A, B], late], count
        )
        first = first if carry is None else _both(carry, first)

        def trigger() -> None:
            first()
            solve_numbers(A, B, X, measures)
            last()

        self.trigger = trigger


def _both(first: Callable[[], None], second: Callable[[], None]) -> Callable[[], None]:
    def trigger() -> None:
        first()
        second()

    return trigger


def solve_numbers(A: Array, B: Array, X: Array, measures: Array) -> None:
    """X = A^-1 B, measures = (min |R_kk| / max |R_kk| of A = Q R, sign of det A); not a number where A is singular.

    Arrays of several systems hold them side by side along the last axis.
    """
    from scipy.linalg import lapack  # half a dozen microseconds a call, a tenth of NumPy's wrappers

    if A.ndim == 3:
        for i in range(A.shape[2]):
            solve_numbers(A[..., i], B[..., i], X[..., i], measures[..., i])
        return
    reflections, tau, _, _ = lapack.dgeqrf(A)  # type: ignore[attr-defined]
    diagonal = reflections.diagonal()
    sizes = np.abs(diagonal).tolist()
    most = max(sizes)
    measures[0] = min(sizes) / most if most > 0 else np.nan
    turns = len(tau) - tau.tolist().count(0.0) + np.signbit(diagonal).sum()  # a reflection turns the sign
    measures[1] = -1.0 if turns % 2 else 1.0
    turned, _, _ = lapack.dormqr("L", "T", reflections, tau, B, 64 * B.shape[1])  # type: ignore[attr-defined]
    for k in range(B.shape[1]):  # one by one: from two on OpenBLAS starts threads, which takes milliseconds
        column, info = lapack.dtrtrs(reflections, turned[:, k])  # type: ignore[attr-defined]
        X[:, k] = column if info == 0 else np.nan


def _memory(shape: tuple[int, ...]) -> Array:
    return _columns(np.zeros(int(np.prod(shape))), shape)


def _columns(numbers: Array, shape: tuple[int, ...]) -> Array:
    # CasADi is column-major: a (rows, columns) matrix is the transpose of a C array (columns, rows).
    return numbers.reshape(shape[::-1]).T


def _bind(
    functions: list[ca.Function], arguments: list[list[Array]], results: list[list[Array]], count: int | None
) -> tuple[Any, ...]:
    """(buffers to keep, trigger of each function) on the given memory."""
    buffers, triggers = [], []
    for function, reads, writes in zip(functions, arguments, results, strict=True):
        buffer: Any  # CasADi's stub of FunctionBuffer asks for arguments that it does not take
        buffer, trigger = (function if count is None else function.map(count)).buffer()
        for i, array in enumerate(reads):
            if array.size:
                buffer.set_arg(i, array.T.data)
        for i, array in enumerate(writes):
            if array.size:
                buffer.set_res(i, array.T.data)
        buffers.append((buffer, reads, writes))
        triggers.append(trigger)
    return buffers, *triggers


# --- The C of programs: flat arguments in rows as NumPy has them, and whole files around them.

Place = Callable[[int, int], str]
"""(argument, element in column-major order) -> C."""


def body(made: Program, inputs: Shapes, outputs: Shapes, name: str) -> str:
    """C of `static void NAME(const hk_t *x, hk_t *y)`: all inputs after one another in x, rows as NumPy has them.

    A program with a system needs the text of solve.c before it. That of a transport comes with it.
    """
    x, y = _places(inputs), _places(outputs)

    def stage(function: ca.Function, suffix: str, more: dict[str, str], read: Place, write: Place) -> str:
        others = "".join(f", {kind} *restrict {key}" for key, kind in more.items())
        idle = "".join(f"  (void){key};\n" for key in ("x", "y", *more))  # no complaint of what is not used
        code = idle + emit(function, name, read, write)
        return f"static void {name}{suffix}(const hk_t *restrict x, hk_t *restrict y{others}) {{\n{code}\n}}\n"

    def given(a: int, i: int) -> str:
        return f"x[{x(a, i)}]" if a < len(inputs) else f"t[{i}]"

    # The transport first, whose results t the stages read.
    loop, more, carry, declared = "", {}, "", ""
    if made.transport is not None:
        loop, more, declared = made.transport.c, {"t": "const hk_t"}, ", t"
        carry = (
            f"  hk_t t[{made.transport.found.shape[0]}];\n"
            f"  hk_transport(x + {x(made.carried, 0)}, t, {int(made.sloping)});\n"
        )
    whole = f"static void {name}(const hk_t *restrict x, hk_t *restrict y) {{\n{carry}"
    if made.after is None:
        if made.transport is None:
            return stage(made.before, "", {}, given, lambda a, i: f"y[{y(a, i)}]")
        before = stage(made.before, "_before", more, given, lambda a, i: f"y[{y(a, i)}]")
        return f"{loop}{before}{whole}  {name}_before(x, y, t);\n}}\n"
    # With a system: the stage before it fills A and B in s, hk_solve leaves X there, the stage after reads it.
    n, k, early = made.order, made.columns, len(made.early)
    known = len(inputs) + (made.transport is not None)
    width = n + k

    def before_writes(a: int, i: int) -> str:
        if a < early:
            return f"y[{y(made.early[a], i)}]"
        return f"s[{i % n * width + i // n + (n if a > early else 0)}]"

    def after_reads(a: int, i: int) -> str:
        if a < known:
            return given(a, i)
        return f"s[{i % n * width + n + i // n}]" if a == known else f"f[{i}]"

    def after_writes(a: int, i: int) -> str:
        return f"y[{y(made.late[a], i)}]"

    before = stage(made.before, "_before", {**more, "s": "hk_t"}, given, before_writes)
    after = stage(made.after, "_after", {**more, "s": "const hk_t", "f": "const hk_t"}, after_reads, after_writes)
    return (
        f"{loop}{before}{after}{whole}"
        f"  hk_t s[{n * width}], w[{width}], f[2];\n  {name}_before(x, y{declared}, s);\n"
        f"  hk_solve({n}, {k}, s, w, f);\n  {name}_after(x, y{declared}, s, f);\n}}\n"
    )


def source(language: str, head: str, code: str, *drivers: str) -> str:
    """A whole C file: prelude, sizes, generated code with its solver, drivers."""
    solver = prelude("solve.c") if "hk_solve(" in code else ""
    return prelude(language) + head + solver + code + "".join(map(prelude, drivers))


def _places(shapes: Shapes):
    """(argument, element in column-major order) -> place in one flat array of row-major arguments."""
    starts = np.concatenate([[0], np.cumsum([int(np.prod(s)) for s in shapes])]).astype(int)

    def place(argument: int, element: int) -> int:
        shape = shapes[argument]
        if len(shape) == 2:
            element = element % shape[0] * shape[1] + element // shape[0]
        return int(starts[argument]) + element

    return place


def step_source(made: Program, inputs: Shapes, outputs: Shapes, measures: dict[str, float]) -> str:
    """The C of a control step: prelude, sizes, generated body, hk_step."""
    each = [int(np.prod(shape)) for shape in inputs]
    sizes = dict(zip(("N", "POSE", "TWIST", "PARAMETERS"), each, strict=True)) | measures
    head = "".join(f"#define HK_{key} {value}\n" for key, value in sizes.items())
    return source(SCALAR, head, body(made, inputs, outputs, "hk_step_body"), "step.c")
