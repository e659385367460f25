"""A function as native code: its C, flat and in rows as NumPy has it, and the vectorised batch over samples."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import casadi as ca
import numpy as np

from ..types import Array, Indices
from .emit import LANES, SCALAR, emit, prelude
from .native import library

Shapes = Sequence[tuple[int, ...]]

LARGEST = 25_000
"""Operations up to which native code is made: beyond, a compiler takes minutes, and the virtual machine serves."""


def body(function: ca.Function, inputs: Shapes, outputs: Shapes, name: str = "hk_body") -> str:
    """C of `static void NAME(const hk_t *x, hk_t *y)`: all inputs after one another in x, rows as NumPy has them."""
    x, y = _places(inputs), _places(outputs)
    code = emit(function, name, lambda a, i: f"x[{x(a, i)}]", lambda a, i: f"y[{y(a, i)}]")
    return f"static void {name}(const hk_t *restrict x, hk_t *restrict y) {{\n{code}\n}}\n"


def _places(shapes: Shapes):
    """(argument, element in column-major order) -> place in one flat array of row-major arguments."""
    starts = np.concatenate([[0], np.cumsum([int(np.prod(s)) for s in shapes])]).astype(int)

    def place(argument: int, element: int) -> int:
        shape = shapes[argument]
        if len(shape) == 2:
            element = element % shape[0] * shape[1] + element // shape[0]
        return int(starts[argument]) + element

    return place


class FollowRules(ctypes.Structure):
    """hk_rules: when a Newton step is accepted; see the tolerances."""

    _fields_ = (
        ("singular", ctypes.c_double),
        ("representation", ctypes.c_double),
        ("contraction", ctypes.c_double),
        ("almost", ctypes.c_double),
        ("smallest", ctypes.c_double),
        ("sign", ctypes.c_double),
        ("most", ctypes.c_int),
    )


class BatchKernel:
    """hk_batch of one function: many samples, several threads, vector registers; the GIL is free meanwhile."""

    def __init__(self, function: ca.Function, inputs: Shapes, outputs: Shapes) -> None:
        sizes_in, sizes_out = ([max(1, int(np.prod(s))) for s in shapes] for shapes in (inputs, outputs))
        head = (
            f"#define HK_INPUTS {len(sizes_in)}\n#define HK_OUTPUTS {len(sizes_out)}\n"
            f"#define HK_NX {sum(sizes_in)}\n#define HK_NY {sum(sizes_out)}\n"
            f"static const int hk_in[] = {{{', '.join(map(str, sizes_in))}}};\n"
            f"static const int hk_out[] = {{{', '.join(map(str, sizes_out))}}};\n"
        )
        code = prelude(LANES) + head + body(function, inputs, outputs) + prelude("batch.c")
        self._library = library(code, fast=True)
        self._run: Any = self._library.hk_batch
        self._run.argtypes = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None

    def __call__(self, arguments: Sequence[Array], results: Sequence[Array], threads: int | None = None) -> None:
        """Fill results (k, ...) from arguments, each C-contiguous (k, ...), or with stride 0 along the samples."""
        count = len(results[0])
        workers = max(1, min(threads or os.cpu_count() or 1, count // 4096))
        edges = np.linspace(0, count, workers + 1).astype(int)

        def part(k: int) -> None:
            start, stop = int(edges[k]), int(edges[k + 1])
            X = (ctypes.c_void_p * len(arguments))(*(a.ctypes.data + start * a.strides[0] for a in arguments))
            strides = (ctypes.c_longlong * len(arguments))(*(a.strides[0] // 8 for a in arguments))
            Y = (ctypes.c_void_p * len(results))(*(r.ctypes.data + start * r.strides[0] for r in results))
            self._run(stop - start, X, strides, Y)

        if workers == 1:
            part(0)
            return
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(part, range(workers)))


class FollowKernel:
    """hk_follow of a Newton step (q, p, R, c) -> (dq, conditioning, margin, det): a path on a leaf, in one call."""

    def __init__(self, function: ca.Function, inputs: Shapes, outputs: Shapes) -> None:
        n = inputs[0][0]
        nx, ny = (sum(int(np.prod(s)) for s in shapes) for shapes in (inputs, outputs))
        head = f"#define HK_N {n}\n#define HK_NX {nx}\n#define HK_NY {ny}\n"
        self._library = library(prelude(SCALAR) + head + body(function, inputs, outputs) + prelude("follow.c"))
        self._run: Any = self._library.hk_follow
        self._run.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_longlong] * 2 + [ctypes.c_void_p] * 4
        self._run.restype = ctypes.c_longlong

    def __call__(
        self, segments: Array, counts: Indices, home: Array | None, x: Array, steps: tuple[int, int],
        limits: tuple[Array, Array], rules: FollowRules, Q: Array,
    ) -> int:  # fmt: skip
        """Do the steps [first, last) of a cycle into the rows of Q, from the posture in x; returns how many it did."""
        return self._run(
            segments.ctypes.data, counts.ctypes.data, None if home is None else home.ctypes.data, x.ctypes.data,
            *steps, limits[0].ctypes.data, limits[1].ctypes.data, ctypes.addressof(rules), Q.ctypes.data,
        )  # fmt: skip
