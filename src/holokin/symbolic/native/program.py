"""What a `Function` runs: straight-line code, or such code around a loop, and around a square system, by numbers.

    t = transport(q);   before: (x, t) -> A, B, and the outputs that need no more;   X = A^-1 B by Householder;
    after: (x, t, X) -> the rest

Written out, an n x n solve takes about 2 n^3 operations: the fastest code there is for an arm, and, for sixty joints,
half a million lines that no compiler can finish.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ...base.types import Array
from .transport import Transport

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
    found = [system.X, system.measures]
    unknown = ca.vertcat(ca.vec(system.X), system.measures)
    late = tuple(i for i, value in enumerate(values) if ca.depends_on(value, unknown))
    early = tuple(i for i in range(len(values)) if i not in late)
    before = _shared(name, symbols, [*(values[i] for i in early), ca.densify(system.A), ca.densify(system.B)])
    after = _shared(f"{name}_after", [*symbols, *found], [values[i] for i in late])
    return Program(before, after, early, late, *system.B.shape)


def _shared(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    function = ca.Function(name, inputs, outputs)
    return _with_common_ones(function.serialize()) if function.n_instructions() <= SHARED else function


@lru_cache(maxsize=128)
def _with_common_ones(text: str) -> ca.Function:
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
        extra = () if count is None else (count,)
        shapes = [(*shape, *extra) for shape in (*inputs, *outputs)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes]).tolist()
        self.numbers = np.zeros(ends[-1] if ends else 0)
        parts = np.split(self.numbers, ends[:-1])
        arrays = [_columns(part, shape) for part, shape in zip(parts, shapes, strict=False)]
        self.arguments, self.results = arrays[: len(inputs)], arrays[len(inputs) :]
        early = [self.results[i] for i in made.early]
        given, carry = self.arguments, None
        if made.transport is not None:
            found = _memory((made.transport.found.shape[0], *extra))
            given = [*given, found]
            self._carrying, carry = _bind([made.transport.function], [[self.arguments[made.carried]]], [[found]], count)
        if made.after is None:
            self._buffers, first = _bind([made.before], [given], [early], count)
            self.trigger = first if carry is None else _both(carry, first)
            return
        n, k = made.order, made.columns
        A, B, X = (_memory((*shape, *extra)) for shape in ((n, n), (n, k), (n, k)))
        measures = _memory((2, *extra))
        late = [self.results[i] for i in made.late]
        self._buffers, first, last = _bind(
            [made.before, made.after],
            [given, [*given, X, measures]],
            [[*early, A, B], late],
            count,
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
        found, info = lapack.dtrtrs(reflections, turned[:, k])  # type: ignore[attr-defined]
        X[:, k] = found if info == 0 else np.nan


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
