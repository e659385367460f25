"""A function called one sample at a time from Python: on the virtual machine at first, as native code once it pays.

The virtual machine serves every call until there are HEAVY of them; then a compiler is asked in the background (see
`later`), and native code takes over when it is ready. Both give the same numbers but for round-off, and the same
errors: native code hands to the virtual machine whatever it does not take.
"""

from __future__ import annotations

import ctypes
import sys
import sysconfig
import threading
import weakref
from collections.abc import Callable, Sequence
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import NativeError
from ...base.types import Array
from .background import later
from .emit import SCALAR, prelude
from .kernel import LARGEST, LONG
from .native_library import enabled, extension, library, tell
from .program import Port, Program, Shapes
from .source import body, source

HEAVY = 10_000
"""Calls from which on a compiler is asked: a tenth of a second of the virtual machine. Who calls so often calls on."""

MOST = 8
"""Arguments, and results, that native code takes: HK_MOST of evaluator.c."""

Convert = Callable[..., Sequence[Array]]
"""(arguments as they were given) -> arrays of the right shapes. Raises typed errors."""

Doubt = Callable[..., Any]
"""(arguments, then results, then measures) -> what the call gives, where something is not finite or not sound."""


class Evaluator:
    """y = F(x), one sample a call: `call(*arguments)` gives new arrays, floats for shape (). Threads may share it.

    Args:
        made, inputs, outputs: the program and its shapes.
        port: the memory on which the virtual machine runs.
        results: the shapes in which the first outputs are given; those beyond are measures, single numbers.
        bounds: above which a measure is sound.
        convert: makes arrays of arguments that are none of the right kind and shape.
        doubt: what to do where something is not finite or a measure is not sound: it raises, or gives a result. Without
            it everything is given as it is.
        many: what gives the results of many samples (k, n), where the only argument is a vector (n,).
    """

    call: Callable[..., Any]

    def __init__(
        self, made: Program, inputs: Shapes, outputs: Shapes, port: Port, *, results: Shapes,
        bounds: Sequence[float] = (), convert: Convert, doubt: Doubt | None = None,
        many: Callable[..., Array] | None = None,
    ) -> None:  # fmt: skip
        self._made, self._inputs, self._outputs = made, tuple(inputs), tuple(outputs)
        self._results, self._bounds, self._checks = tuple(results), tuple(bounds), doubt is not None
        self.many: Any = many
        self.machine, self._restart = self._on_machine(port, convert, doubt)
        self.call = self.machine

    @property
    def native(self) -> bool:
        """True when native code has taken over."""
        return self.call is not self.machine

    def work(self) -> None:
        """Build the native code, or load it, and let it take over; without it all stays as it is."""
        sizes = [int(np.prod(shape)) for shape in self._results]
        fits = max(len(self._inputs), len(sizes)) <= MOST and self._made.instructions <= LARGEST
        if self.native or not fits or not enabled():
            return
        code = _sample_source(self._made, self._inputs, self._outputs, sizes, self._bounds, self._checks)
        try:
            module = _module()
            if module is None:
                return
            built = library(code, long=self._made.instructions > LONG, interleaved=True, needs=("hk_sample",))
        except NativeError as problem:
            tell(problem)
            return
        self.call = _bound(module, built.hk_sample, self._inputs, self._results, self.machine, built, 0)

    def again(self) -> None:
        """The next call of the virtual machine asks a compiler."""
        self._restart()

    def _on_machine(self, port: Port, convert: Convert, doubt: Doubt | None) -> tuple[Callable[..., Any], Any]:
        memory, many = _Memory(port, self._results), self.many
        inputs, several, double = self._inputs, len(self._results) != 1, np.dtype(float)
        measures = [*zip(range(-len(self._bounds), 0), self._bounds, strict=True)]  # the last of all numbers
        myself, left = weakref.ref(self), HEAVY

        def sound(found: Sequence[float]) -> bool:
            for place, bound in measures:
                if not found[place] > bound:
                    return False
            # A sum beyond all floats counts as not finite, too: `doubt` looks closer. Python's sum does not warn of it.
            return isfinite(sum(found))

        def machine(*arguments: Any, **named: Any) -> Any:
            nonlocal left
            if left > 0:
                left -= 1
                if left <= 0 and (evaluator := myself()) is not None:
                    later(evaluator)
            trigger, slots, takes, numbers = memory.all
            given: Sequence[Any] = arguments
            if len(given) != len(slots) or named:
                given = convert(*arguments, **named)
            for value, slot, shape in zip(given, slots, inputs, strict=True):
                if type(value) is not np.ndarray or value.dtype is not double or value.shape != shape:
                    given = convert(*arguments, **named)
                    if many is not None and given[0].ndim > 1:
                        return many(given[0])
                    for one, into in zip(given, slots, strict=True):
                        into[...] = one
                    break
                slot[...] = value
            trigger()
            if doubt is not None and not sound(found := numbers()):
                return doubt(*given, *[take() for take in takes], *[found[place] for place, _ in measures])
            return tuple([take() for take in takes]) if several else takes[0]()

        def restart() -> None:
            nonlocal left
            left = 1

        return machine, restart


class _Memory(threading.local):
    """A thread's views of its memory: (trigger, arguments, ways to take results, way to take all numbers)."""

    def __init__(self, port: Port, shapes: Shapes) -> None:
        results = [array.reshape(shape) for array, shape in zip(port.results, shapes, strict=False)]
        takes = [view.copy if view.ndim else view.item for view in results]
        self.all = (port.trigger, port.arguments, takes, port.numbers.tolist)


def bound_call(
    function: Any, inputs: Shapes, results: Shapes, other: Callable[..., Any], kept: Any, context: Array
) -> Callable[..., Any] | None:
    """A callable around a C function (in, out, context) -> 1 or 0, as `hk_sample`; None without Python's headers.

    `other` is called where an argument does not fit, or it gives 0. `kept` is what the function belongs to.
    """
    try:
        module = _module()
    except NativeError as problem:
        tell(problem)
        return None
    return None if module is None else _bound(module, function, inputs, results, other, kept, context.ctypes.data)


def _bound(
    module: Any, function: Any, inputs: Shapes, results: Shapes, other: Any, kept: Any, context: int
) -> Callable[..., Any]:
    place = ctypes.cast(function, ctypes.c_void_p).value
    return module.Evaluator(place, tuple(inputs), tuple(results), other, kept, context)


def weak(method: Callable[..., Any]) -> Callable[..., Any]:
    """A bound method that does not keep its object, for the evaluators that the object itself keeps."""
    found = weakref.WeakMethod(method)
    return lambda *arguments, **named: found()(*arguments, **named)  # type: ignore[misc]


def _sample_source(
    made: Program, inputs: Shapes, outputs: Shapes, results: Sequence[int], bounds: Sequence[float], finite: bool
) -> str:
    """The C of hk_sample: prelude, sizes, generated body, sample.c. `results`: the sizes of those that are given."""
    sizes = [int(np.prod(shape)) for shape in inputs]
    every = sum(int(np.prod(shape)) for shape in outputs)

    def row(values: Sequence[float]) -> str:
        return "{" + ", ".join(map(repr, values or [0])) + "}"

    head = (
        f"#define HK_INPUTS {len(sizes)}\n#define HK_RESULTS {len(results)}\n#define HK_FIGURES {len(bounds)}\n"
        f"#define HK_NX {max(1, sum(sizes))}\n#define HK_NY {max(1, every)}\n#define HK_FINITE {int(finite)}\n"
        f"static const int hk_in[] = {row(sizes)}, hk_out[] = {row(results)};\n"
        f"static const double hk_bounds[] = {row(list(bounds))};\n"
    )
    return source(SCALAR, head, body(made, inputs, outputs, "hk_body"), "sample.c")


@cache
def _module() -> Any:
    """The extension module of evaluator.c; None without Python's or NumPy's headers, or with others than it needs.

    Raises:
        NativeError: it cannot be built.
    """
    folders = sysconfig.get_paths().get("include", ""), np.get_include()
    if not ((Path(folders[0]) / "Python.h").is_file() and (Path(folders[1]) / "numpy" / "arrayobject.h").is_file()):
        return None
    versions = f"/* Python {' '.join(sys.version.split())}, NumPy {np.__version__} */\n"  # so that they enter the hash
    built = library(versions + prelude("evaluator.c"), includes=folders, needs=("PyInit_holokin_evaluator",))
    try:
        return extension(built, "holokin_evaluator")
    except ImportError:
        return None
