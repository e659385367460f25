"""`Function`: a CasADi expression with named inputs, built once, NumPy in and out.

A plain CasADi call spends 15 to 35 us on wrapping; the buffer interface evaluates the same
expression in place on NumPy memory in about 2 us, so everything here goes through it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from ..base.errors import ExpressionError, NativeError, ShapeError
from ..base.types import Array, ArrayLike, Matrix, numbers, whole
from .linear import System
from .native.emit import Port, Shapes, Transport, body, program
from .native.kernel import (
    LARGEST,
    LARGEST_VECTOR,
    BatchKernel,
    Doubt,
    Evaluator,
    FollowKernel,
    InverseKernel,
    Method,
    follow_code,
    weak,
)
from .native.toolchain import allowed, enabled, tell

PIECE = 100_000
"""Samples that are checked at once, so that only the results grow with their number."""


@dataclass(frozen=True, eq=False)
class CheckedBatch:
    """y (k, *result) of x (k, n): what the single call gives and checks of each row, by `Function.batch`.

    Attributes:
        batch: `Function.batch` of a function of one vector; its first output is given, its last ones are measures.
        size: n. others: the shapes of the outputs but for the first.
        result: the shape of one result.
        convert: (what is given, how to call it) -> (n,). Raises typed errors.
        doubt, bounds: as of `Function.checked`.
    """

    batch: Callable[..., Any]
    size: int
    others: Shapes
    result: tuple[int, ...]
    convert: Callable[..., Array]
    doubt: Doubt
    bounds: Sequence[float]

    def array(self, given: ArrayLike) -> Array:
        """x (n,), checked, or (k, n) as numbers, which are checked by their results. Raises: as `convert`."""
        if hasattr(given, "keys"):  # values by name, of whose order `convert` knows
            return self.convert(given)
        array = numbers("q", given)
        if array.ndim != 2:
            return self.convert(array)
        if array.shape[1] != self.size:
            raise ShapeError("q", f"({self.size},) or (k, {self.size})", array.shape)
        return array

    def __call__(self, Q: Matrix, threads: int | None = None) -> Array:
        """The results at Q (k, n), a row each; see `Function.batch` for threads.

        Raises: what `convert` or `doubt` raises of the first row that is not sound.
        """
        if threads is not None:
            whole("threads", threads)
        results = np.empty((len(Q), *self.result))
        edges = np.linspace(0, len(Q), 1 + max(1, len(Q) // PIECE)).astype(int)
        for first, last in pairwise(edges.tolist()):
            more = [np.empty((last - first, *shape)) for shape in self.others]
            self.batch(Q[first:last], threads=threads, out=[results[first:last], *more])
            measures = [measure.reshape(-1) for measure in more[len(more) - len(self.bounds) :]]
            # Rows are sound that are finite (a sum beyond all floats is not), with measures above their bounds.
            rows = results[first:last].reshape(last - first, int(np.prod(self.result)))
            with np.errstate(all="ignore"):
                sound: Any = np.isfinite(rows @ np.ones(rows.shape[1]))
                for measure, bound in zip(measures, self.bounds, strict=True):
                    sound &= measure > bound
            for i in np.flatnonzero(~sound).tolist():
                q = self.convert(Q[first + i], f"posture {first + i}")
                results[first + i] = self.doubt(q, results[first + i].copy(), *(float(m[i]) for m in measures))
        return results


NATIVE_FROM = 50_000
"""Samples from which a batch is worth a compiler's second, once: about half a second of the virtual machine."""

LOADED_FROM = 2_000
"""Calls in rows from which native code is looked for in the cache: 20 ms of the virtual machine, as its C takes."""

CHUNKS = {256: 128, 16: 12}
"""Samples that one mapped evaluation takes, and from how many on it is worth its idle rest.

The many hide the call and still stay in cache; the few are for batches of some dozen.
"""


class Function:
    """y_1, y_2, ... = F(x_1, x_2, ...) of a CasADi expression. Threads may share it: each has memory of its own.

    Args:
        name: identifier, for messages and generated code.
        inputs: name -> symbol; a column symbol takes a vector (k,), others a matrix (rows, columns).
        outputs: name -> expression; columns come back as vectors, 1x1 as a float.
        system: the linear system whose symbols the outputs hold, if any (see `linear.solution`).
        transport: the loop whose symbols they hold, if any; it takes the input "q".

    Raises:
        ShapeError: an argument of the wrong shape, or the wrong number of arguments.
        ExpressionError: an output holds a symbol that is no input.
    """

    def __init__(
        self,
        name: str,
        inputs: Mapping[str, ca.SX],
        outputs: Mapping[str, ca.SX],
        system: System | None = None,
        transport: Transport | None = None,
    ) -> None:
        self.name = name
        self.input_shapes = {key: _shape(symbol) for key, symbol in inputs.items()}
        self.output_shapes = {key: _shape(value) for key, value in outputs.items()}
        try:
            self.program = program(name, inputs, outputs, system, transport)
        except RuntimeError as problem:
            free = re.search(r"variables \[(.*?)\] are free", str(problem))
            if free is None:
                raise
            fact = f"it holds symbols that are not its arguments: {free[1]}"
            raise ExpressionError(name, fact, "write it of the arguments of your function alone") from None
        self._shapes = list(self.input_shapes.values()), list(self.output_shapes.values())
        self._port = Port(self.program, *self._shapes)
        self._maps: dict[int, Port] = {}  # as a Port is each thread's own, it does not matter which thread makes it
        self._natives: dict[str, Any] = {}  # None where it could not be made, so that it is tried once
        self._absent: set[str] = set()  # of those that the cache did not have
        self._repeats = 0  # calls that `repeated` made
        shown = [() if shape == (1,) else shape for shape in self._shapes[1]]
        self._one = Evaluator(self.program, *self._shapes, self._port, results=shown, convert=weak(self._converted))

    def __repr__(self) -> str:
        return f"Function({self.program.before})"

    def __call__(self, *args: ArrayLike, **named: ArrayLike) -> Any:
        """Evaluate once. Returns one new array (float if 1x1), or a tuple when there are several outputs.

        By native code when it is called often, see `Evaluator`.
        """
        return self._one.call(*args, **named)

    def checked(
        self, result: tuple[int, ...], convert: Callable[..., Array], doubt: Doubt, bounds: Sequence[float] = ()
    ) -> Evaluator:
        """The same for a function of one vector, with checks: its first output, in a shape. It takes (n,) or (k, n).

        Args:
            convert: a method that makes (n,) of what is given, and of how to call it. Raises typed errors.
            doubt: a method, (argument, result, measures) -> result or an error, called where a number is not finite or
                where a measure, one of the other outputs, is not above its bound.

        Neither keeps its object.
        """
        (size,), others = self._shapes[0][0], self._shapes[1][1:]
        many = CheckedBatch(self.batch, size, others, result, weak(convert), weak(doubt), tuple(bounds))
        return Evaluator(
            self.program,
            *self._shapes,
            self._port,
            results=[result],
            bounds=bounds,
            convert=lambda given: (many.array(given),),
            doubt=weak(doubt),
            many=many,
        )

    def batch(
        self,
        *args: ArrayLike,
        threads: int | None = None,
        out: Sequence[Array] | None = None,
        native_from: int | None = None,
        **named: ArrayLike,
    ) -> Any:
        """Evaluate over a leading axis: each argument (k, *shape), or (*shape) to be repeated.

        From `native_from` samples on by native code, if there is a compiler, on `threads` threads (all by default);
        it agrees with the virtual machine to round-off. `out`: C-contiguous arrays (k, *shape) for the results.
        Who calls it in a loop gives a smaller `native_from`.

        Returns one array (k, *shape), or a tuple of them; scalars come back as (k,).
        """
        count, stacked = self._samples(args, named)
        # The results: of native code, which takes many, else of the virtual machine.
        if out is None:
            out = [np.empty((count, *shape)) for shape in self.output_shapes.values()]
        wanted = [(count, *shape) for shape in self.output_shapes.values()]
        results = [_result_array(self.name, array, shape) for array, shape in zip(out, wanted, strict=False)]
        if len(out) != len(wanted):
            raise ShapeError(f"{self.name}.batch: out", f"{len(wanted)} arrays", len(out))
        kernel = self._native() if count >= (NATIVE_FROM if native_from is None else native_from) else None
        if kernel is not None:
            kernel([_rows(v) for v in stacked], results, threads)
        else:
            self._on_machine(stacked, results, count)
        return self._unwrapped(results, count)

    def repeated(self, times: int, fed: int, *args: ArrayLike) -> list[Array]:
        """The results (k, times, *shape) of calls in a row at each of k samples, as native code once that pays.

        The first `fed` arguments of a call are the first results of the call before, of the same shapes; the others
        stay as they are. Arguments as those of `batch`.
        """
        count, stacked = self._samples(args, {})
        results = [np.empty((count, times, *shape)) for shape in self.output_shapes.values()]
        # Native code is looked for once its loading pays, and built once that does.
        kind, kernel, before = f"{fed} fed", None, self._repeats
        self._repeats += count * times
        if count and before >= LOADED_FROM:
            fits, build = self.program.longest <= LARGEST_VECTOR, before >= NATIVE_FROM
            kernel = self._kernel(
                kind, fits, lambda: BatchKernel(self.program, *self._shapes, fed=fed, build=build), build
            )
        if kernel is not None:
            kernel([_rows(v) for v in stacked], results, times=times)
            return results
        for t in range(times):
            once = [np.empty((count, *shape)) for shape in self.output_shapes.values()]
            self._on_machine(stacked, once, count)
            for result, array in zip(results, once, strict=True):
                result[:, t] = array
            stacked[:fed] = once[:fed]
        return results

    def _samples(self, args: tuple[ArrayLike, ...], named: Mapping[str, ArrayLike]) -> tuple[int, list[Array]]:
        """(how many samples, the arguments (k, *shape)). Raises: ShapeError."""
        values = [numbers(f"an argument of {self.name}.batch", value) for value in self._collect(args, named)]
        shapes = list(self.input_shapes.items())
        counts = set()
        for value, (key, shape) in zip(values, shapes, strict=True):
            if value.shape[1:] == shape and value.ndim == len(shape) + 1:
                counts.add(value.shape[0])
            elif value.shape != shape:
                raise ShapeError(f"{self.name}.batch: argument {key!r}", ("k", *shape), value.shape)
        if len(counts) > 1:
            raise ShapeError(f"{self.name}.batch: the batch axis", "one length", sorted(counts))
        count = counts.pop() if counts else 1
        stacked = [
            value if value.ndim == len(shape) + 1 else np.broadcast_to(value, (count, *shape))
            for value, (_, shape) in zip(values, shapes, strict=True)
        ]
        return count, stacked

    def _on_machine(self, stacked: Sequence[Array], results: Sequence[Array], count: int) -> None:
        """Fill results (k, *shape) from arguments (k, *shape) by the virtual machine."""
        done = 0
        for size, fewest in CHUNKS.items():
            while count - done >= fewest:
                rows = slice(done, min(done + size, count))
                self._evaluate_chunk(size, [v[rows] for v in stacked], [r[rows] for r in results])
                done = rows.stop
        for i in range(done, count):  # a few are cheaper one by one
            for slot, value in zip(self._port.arguments, stacked, strict=True):
                slot[...] = value[i]
            self._port.trigger()
            for result, slot in zip(results, self._port.results, strict=True):
                result[i] = slot

    def _unwrapped(self, results: list[Array], count: int) -> Any:
        outs = [r.reshape(count) if s == (1,) else r for r, s in zip(results, self.output_shapes.values(), strict=True)]
        return outs[0] if len(outs) == 1 else tuple(outs)

    def _kernel(self, kind: str, fits: bool, make: Callable[[], Any], build: bool = True) -> Any:
        """Native code of a kind, made when first wanted; None where there can be none."""
        if kind in self._natives and allowed():
            return self._natives[kind]
        if not fits or not enabled() or (not build and kind in self._absent):
            return None
        if kind not in self._natives:
            try:
                self._natives[kind] = make()
            except NativeError as problem:
                if problem.cause == "absent":
                    self._absent.add(kind)
                    return None
                tell(problem)
                self._natives[kind] = None
        return self._natives[kind]

    def _native(self) -> BatchKernel | None:
        """The batch as native code."""
        if self._natives.get("batch") is not None and allowed():
            return self._natives["batch"]
        fits = self.program.longest <= LARGEST_VECTOR
        return self._kernel("batch", fits, lambda: BatchKernel(self.program, *self._shapes))

    @property
    def memory(self) -> Port:
        """This thread's memory, which every call of the function uses: for loops that do not call it meanwhile."""
        return self._port

    def port(self) -> Port:
        """Memory besides the function's own, and each thread's own too, for a loop that others may interrupt."""
        return Port(self.program, *self._shapes)

    def follower(
        self, method: Method, more: Callable[[], str] = str, *, load: bool = True, build: bool = True
    ) -> FollowKernel | None:
        """The loop of following a path by this function, see `FollowKernel`; None where there can be none.

        Args:
            more: makes the C that the loop needs besides this function's.
            load: look for it in the cache of libraries. build: make it if it is not there. Without them, only one
                that this process has already.
        """
        fits = (load or build) and self.program.instructions <= LARGEST
        return self._kernel(
            method, fits, lambda: FollowKernel(self.program, *self._shapes, method, more(), build), build
        )

    def follower_c(self, method: Method, more: str = "") -> str:
        """The C of that loop, for compilers other than the one here. Raises: NativeError, see `c`."""
        return follow_code(self.program, *self._shapes, method, more)

    def inverse(
        self, more: Callable[[], str], stretches: Callable[[], str], drivers: Sequence[str] = ()
    ) -> InverseKernel | None:
        """Inverse kinematics about this function, a Newton step, see `InverseKernel`; None where there can be none.

        Args:
            more, stretches: make the C that it needs besides this function's. drivers: files of C besides.
        """
        fits, kind = self.program.instructions <= LARGEST, " ".join(["inverse", *drivers])
        return self._kernel(
            kind, fits, lambda: InverseKernel(self.program, *self._shapes, more(), stretches(), drivers)
        )

    def c(self, name: str) -> str:
        """C99 of `static void NAME(const hk_t *x, hk_t *y)`: arguments, and results, one after another in rows.

        Raises:
            NativeError: an operation that has no C here.
        """
        return body(self.program, *self._shapes, name)

    def _converted(self, *args: ArrayLike, **named: ArrayLike) -> list[Array]:
        out = []
        for value, (key, shape) in zip(self._collect(args, named), self.input_shapes.items(), strict=True):
            array = numbers(f"{self.name}: argument {key!r}", value)
            if array.shape != shape:
                raise ShapeError(f"{self.name}: argument {key!r}", shape, array.shape)
            out.append(array)
        return out

    def _evaluate_chunk(self, size: int, arguments: list[Array], results: list[Array]) -> None:
        if size not in self._maps:
            # A map lays samples side by side in columns, so the batch axis comes last in its arrays.
            self._maps[size] = Port(self.program, *self._shapes, size)
        port = self._maps[size]
        k = len(results[0])
        for slot, value in zip(port.arguments, arguments, strict=True):
            slot[..., :k] = value.transpose(*range(1, value.ndim), 0)  # `moveaxis` takes longer than the copy
        port.trigger()
        for slot, result in zip(port.results, results, strict=True):
            result[...] = slot[..., :k].transpose(-1, *range(slot.ndim - 1))

    def _collect(self, args: tuple[ArrayLike, ...], named: Mapping[str, ArrayLike]) -> list[ArrayLike]:
        keys = list(self.input_shapes)
        try:
            values = [*args, *(named[key] for key in keys[len(args) :])]
        except KeyError as missing:
            raise ShapeError(f"{self.name}: the arguments", keys, f"none for {missing.args[0]!r}") from None
        if len(values) != len(keys) or len(args) + len(named) != len(keys):
            raise ShapeError(f"{self.name}: the arguments", keys, [*range(len(args)), *named])
        return values


def _result_array(name: str, array: Any, shape: tuple[int, ...]) -> Array:
    """An array for results, as it must be. Raises: ShapeError."""
    fits = isinstance(array, np.ndarray) and array.dtype == np.float64 and array.flags.c_contiguous
    if not fits or array.size != int(np.prod(shape)) or array.shape[:1] != shape[:1]:
        raise ShapeError(f"{name}.batch: out", f"C-contiguous float64 {shape}", getattr(array, "shape", type(array)))
    return array.reshape(shape)


def _rows(value: Array) -> Array:
    """The samples with each one's numbers in a row; a repeated argument keeps its stride of 0."""
    if value.strides[0] == 0:
        return np.broadcast_to(np.ascontiguousarray(value[0]), value.shape)
    return np.ascontiguousarray(value)


def _shape(expression: ca.SX) -> tuple[int, ...]:
    rows, columns = ca.SX(expression).shape
    return (rows,) if columns == 1 else (rows, columns)
