"""Functions as native code: the vectorised batch over samples, the loop along a path, the control step."""

from __future__ import annotations

import ctypes
import os
import sysconfig
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import NativeError
from ...base.types import ROTATION, Array, Indices, whole
from .emit import LANES, SCALAR, prelude
from .native_library import extension, library
from .program import Program, Shapes
from .source import body, source, step_source

LARGEST = 50_000
"""Operations up to which native code is made: beyond, a compiler takes half a minute, and the virtual machine runs."""

LARGEST_VECTOR = 8_000
"""The same for vectors of numbers, in one piece, which take a compiler far longer: ten seconds for 5,300, ninety for
12,800; but five for 8,100 in the pieces of a loop."""

LONG = 3_000
"""Operations from which a compiler is told to take it easy: one second instead of seven for 5,700 of them."""


class LeafRules(ctypes.Structure):
    """hk_rules of newton.c and follow.c: when a Newton step is accepted; see the tolerances."""

    _fields_ = (
        *(
            (name, ctypes.c_double)
            for name in ("singular", "representation", "contraction", "almost", "done", "smallest", "creep", "side")
        ),
        ("most", ctypes.c_int),
        ("tries", ctypes.c_int),
    )


class VelocityRules(ctypes.Structure):
    """hk_rules of velocity.c: when a posture is sound, and when the tool has lost the path."""

    _fields_ = (("singular", ctypes.c_double), ("representation", ctypes.c_double), ("tracking", ctypes.c_double))


class BatchKernel:
    """hk_batch of one function: many samples, several threads, vector registers; the GIL is free meanwhile."""

    def __init__(self, made: Program, inputs: Shapes, outputs: Shapes) -> None:
        sizes_in, sizes_out = ([int(np.prod(s)) for s in shapes] for shapes in (inputs, outputs))
        head = (
            f"#define HK_INPUTS {len(sizes_in)}\n#define HK_OUTPUTS {len(sizes_out)}\n"
            f"#define HK_NX {max(1, sum(sizes_in))}\n#define HK_NY {max(1, sum(sizes_out))}\n"
            f"static const int hk_in[] = {{{', '.join(map(str, sizes_in))}}};\n"
            f"static const int hk_out[] = {{{', '.join(map(str, sizes_out))}}};\n"
        )
        self._library = library(
            source(LANES, head, body(made, inputs, outputs, "hk_body"), "batch.c"),
            fast=True,
            long=made.instructions > LONG,
            needs=("hk_batch",),
        )
        self._run: Any = self._library.hk_batch
        self._run.argtypes = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
        self._run.restype = None

    def __call__(self, arguments: Sequence[Array], results: Sequence[Array], threads: int | None = None) -> None:
        """Fill results (k, ...) from arguments, each C-contiguous (k, ...), or with stride 0 along the samples."""
        count = len(results[0])
        most = (os.cpu_count() or 1) if threads is None else whole("threads", threads)
        workers = max(1, min(most, count // 4096))

        def part(k: int) -> None:
            start, stop = k * count // workers, (k + 1) * count // workers
            X = (ctypes.c_void_p * len(arguments))(*(a.ctypes.data + start * a.strides[0] for a in arguments))
            strides = (ctypes.c_longlong * len(arguments))(*(a.strides[0] // 8 for a in arguments))
            Y = (ctypes.c_void_p * len(results))(*(r.ctypes.data + start * r.strides[0] for r in results))
            self._run(stop - start, X, strides, Y)

        if workers == 1:
            part(0)
            return
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(part, range(workers)))


def follow_code(made: Program, inputs: Shapes, outputs: Shapes, method: str, more: str = "") -> str:
    """The C of hk_follow, see `FollowKernel`."""
    state = sum(int(np.prod(shape)) for shape in inputs)
    head = f"#define HK_N {inputs[0][0]}\n#define HK_FRAMES {inputs[1][0] // 3}\n#define HK_STATE {state}\n"
    drivers = {
        "leaf": ("hk_leaf_body", "branch.c", "newton.c", "follow.c"),
        "velocity": ("hk_rate_body", "velocity.c"),
    }
    name, *files = drivers[method]
    return source(SCALAR, head, body(made, inputs, outputs, name) + more, "line.c", "path.c", *files)


class FollowKernel:
    """hk_follow: many steps along a path in one call.

    "leaf": by a Newton step (q, p, R, c) -> (dq, rcond, margin, sign of det).
    "velocity": by Runge-Kutta steps of (q, p, R, v, w) -> (dq, rcond, margin, largest task error).
    more: C that the drivers need besides, of which "leaf" takes the extended Jacobian and its change.
    build: False for one whose library is in the cache, or none.
    """

    def __init__(
        self, made: Program, inputs: Shapes, outputs: Shapes, method: str, more: str = "", build: bool = True
    ) -> None:
        code = follow_code(made, inputs, outputs, method, more)
        self._library = library(code, long=made.instructions > LONG, needs=("hk_follow",), build=build)
        self._run: Any = self._library.hk_follow
        self._run.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_longlong] * 2 + [ctypes.c_void_p] * 4
        self._run.restype = ctypes.c_longlong

    def __call__(
        self, segments: Array, counts: Indices, closing: Array | None, x: Array, steps: tuple[int, int],
        limits: tuple[Array, Array], rules: ctypes.Structure, Q: Array,
    ) -> int:  # fmt: skip
        """Do the steps [first, last) of a cycle into the rows of Q; returns how many it did.

        x begins with the posture to start from; for "leaf" it is (q, p, R, c, rate, why), where `why` says after fewer
        steps: 1 no piece keeps to the branch, 2 the tries ran out, 3 a limit, 0 a step in Python tells it; q is where.
        """
        return self._run(
            segments.ctypes.data, counts.ctypes.data, None if closing is None else closing.ctypes.data, x.ctypes.data,
            *steps, limits[0].ctypes.data, limits[1].ctypes.data, ctypes.addressof(rules), Q.ctypes.data,
        )  # fmt: skip


class StepMemory(threading.local):
    """A thread's own results of a control step: `out` is dq (n,), scale, holding, status.

    latest: one array in a list that all threads share, the results of the thread that steps at present.
    """

    def __init__(self, joints: int, latest: list[Array]) -> None:
        self.out = np.zeros(joints + 3)
        self.place = self.out.ctypes.data
        self.latest, self.stepped = latest, False

    def enter(self) -> int:
        """This thread steps from now on: the address of out."""
        self.latest[0], self.stepped = self.out, True
        return self.place

    @property
    def last(self) -> Array:
        """The results of this thread's last step; of a thread that made none, of the last step of all."""
        return self.out if self.stepped else self.latest[0]


class _Copies(threading.local):
    """A thread's own contiguous arrays for the arguments of a step, and their addresses."""

    def __init__(self, shapes: Shapes) -> None:
        self.arrays = [np.empty(shape) for shape in shapes]
        self.places = [array.ctypes.data for array in self.arrays]


class StepKernel:
    """hk_step of a control step for Python.

    (q, pose, twist, parameters) -> (dq, scale, rcond, margin, room, off, given, holding).
    """

    def __init__(self, made: Program, inputs: Shapes, outputs: Shapes, thresholds: dict[str, float]) -> None:
        code = step_source(made, inputs, outputs, thresholds)
        self._library = library(code, long=made.instructions > LONG, needs=("hk_step",))
        self._run: Any = self._library.hk_step
        self._run.argtypes = [ctypes.c_void_p] * 5
        self._run.restype = ctypes.c_int
        self.shapes = tuple(inputs[:3])

    def bind(
        self, parameters: Array, memory: StepMemory, convert: Callable[..., tuple[Array, ...]]
    ) -> Callable[..., Array]:
        """(q, pose, twist) -> dq, a new array; scale and status are in the memory of the thread that calls.

        Args:
            parameters: contiguous floats, read at each call.
            convert: makes of three arguments float arrays of the right shapes, newly made.
        """
        glue = _glue()
        if glue is not None:
            address, (joints,), pose = ctypes.cast(self._run, ctypes.c_void_p).value, *self.shapes[:2]
            kept, point = (self._library, parameters), pose[0] if len(pose) == 1 else 0
            frames = -(-point // 3) if point else pose[0] // 4
            return glue.bind(address, parameters.ctypes.data, joints, point, frames, memory, convert, kept)
        run, parameters_at, copies = self._run, parameters.ctypes.data, _Copies(self.shapes)

        def step(*arguments: Any) -> Array:
            for copy, value in zip(copies.arrays, convert(*arguments), strict=True):
                copy[...] = value
            out_at = memory.enter()
            memory.out[-1] = run(*copies.places, out_at, parameters_at)
            return memory.out[:-3].copy()

        step.__dict__["kept"] = parameters  # C reads them by their address
        return step


@cache
def _glue() -> Any:
    """The extension module that binds C steps to Python; None where Python's headers are missing, or NumPy's arrays
    are laid out otherwise than it knows."""
    folder = sysconfig.get_paths().get("include", "")
    if not (Path(folder) / "Python.h").is_file():
        return None
    try:
        code = f"#define HK_OFF {ROTATION}\n{prelude('glue.c')}"
        built = library(code, includes=(folder,), needs=("PyInit_holokin_glue",))
    except NativeError:
        return None
    module = extension(built, "holokin_glue")
    sample = np.zeros((3, 5))
    sample.flags.writeable = False
    odd = np.zeros(17, np.uint8)[1:].view(float)  # not aligned
    known = module.know(
        np.ndarray, np.ndarray.__basicsize__, sample.dtype, np.empty, sample, sample.T, odd, sample.ctypes.data
    )
    return module if known else None
