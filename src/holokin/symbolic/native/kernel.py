"""Functions as native code: batches, the loop along a path, one call, inverse kinematics, the edge of reach."""

from __future__ import annotations

import ctypes
import os
import sys
import sysconfig
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...base.errors import NativeError
from ...base.types import ROTATION, Array, ArrayLike, Indices, Matrix, Vector, whole
from .emit import LANES, SCALAR, Port, Program, Shapes, body, prelude, source, step_source
from .toolchain import enabled, extension, later, library, tell

LARGEST = 50_000
"""Operations up to which native code is made: beyond, a compiler takes half a minute, and the virtual machine runs."""

LARGEST_VECTOR = 8_000
"""The same for vectors of numbers, in one piece, which take a compiler far longer: ten seconds for 5,300, ninety for
12,800; but five for 8,100 in the pieces of a loop."""

LONG = 3_200
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
    """hk_batch of one function: many samples, several threads, vector registers; the GIL is free meanwhile.

    fed: how many of the first results become the first arguments of the next call, where a sample is for many calls.
    build: False for one whose library is in the cache, or none.
    """

    def __init__(
        self,
        made: Program,
        inputs: Shapes,
        outputs: Shapes,
        driver: str = "batch.c",
        *,
        fed: int = 0,
        build: bool = True,
    ) -> None:
        sizes_in, sizes_out = ([int(np.prod(s)) for s in shapes] for shapes in (inputs, outputs))
        head = (
            f"#define HK_INPUTS {len(sizes_in)}\n#define HK_OUTPUTS {len(sizes_out)}\n"
            f"#define HK_NX {max(1, sum(sizes_in))}\n#define HK_NY {max(1, sum(sizes_out))}\n"
            f"#define HK_SIGNS {sizes_in[-1]}\n#define HK_FED {fed}\n"
            f"static const int hk_in[] = {{{', '.join(map(str, sizes_in))}}};\n"
            f"static const int hk_out[] = {{{', '.join(map(str, sizes_out))}}};\n"
        )
        self._library = library(
            source(LANES, head, body(made, inputs, outputs, "hk_body"), driver),
            fast=True,
            long=made.instructions > LONG,
            needs=("hk_batch",),
            build=build,
        )
        self._run: Any = self._library.hk_batch
        self._run.argtypes = [ctypes.c_longlong, *[ctypes.c_void_p] * 3, ctypes.c_longlong]
        self._run.restype = None
        self._inputs, self._outputs = ctypes.c_void_p * len(sizes_in), ctypes.c_void_p * len(sizes_out)
        self._strides = ctypes.c_longlong * len(sizes_in)

    def __call__(
        self, arguments: Sequence[Array], results: Sequence[Array], threads: int | None = None, times: int = 1
    ) -> None:
        """Fill results (k, ...) from arguments, each C-contiguous (k, ...), with stride 0 along the samples, or of one
        sample (1, ...), which is repeated.

        Of so many calls for each sample the results are (k, times, ...).
        """
        count = len(results[0])
        most = 1 if count * times < 8192 else (os.cpu_count() or 1) if threads is None else whole("threads", threads)
        workers = max(1, min(most, count, count * times // 4096))
        X, strides = [_address(a) for a in arguments], [a.strides[0] if len(a) > 1 else 0 for a in arguments]
        Y, steps = [_address(r) for r in results], [r.strides[0] for r in results]
        lanes = self._strides(*(stride // 8 for stride in strides))

        def part(k: int) -> None:
            start, stop = k * count // workers, (k + 1) * count // workers
            ins = self._inputs(*(x + start * stride for x, stride in zip(X, strides, strict=True)))
            outs = self._outputs(*(y + start * stride for y, stride in zip(Y, steps, strict=True)))
            self._run(stop - start, ins, lanes, outs, times)

        in_parts(part, workers, workers)


def _address(array: Array) -> int:
    return array.__array_interface__["data"][0]


def in_parts(part: Callable[[int], None], count: int, workers: int) -> None:
    """part(0), part(1), ... on some threads."""
    if workers == 1:
        for k in range(count):
            part(k)
        return
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(part, range(count)))


class SignsKernel(BatchKernel):
    """All results (2^k, size) for the signs, 1 or -1, of a function's last argument (k,).

    `call` takes the other arguments, of one sample; the object itself takes those of many, as a `BatchKernel`.
    """

    call: Callable[..., Any]

    def __init__(self, made: Program, inputs: Shapes, outputs: Shapes) -> None:
        super().__init__(made, inputs, outputs, "signs.c")
        shapes, module = (2 ** inputs[-1][0], *outputs[0]), _module()
        self._shapes = inputs[:-1], shapes
        self.call = (
            self._converted
            if module is None
            else _bound(module, self._library.hk_sample, inputs[:-1], [shapes], weak(self._converted), self._library, 0)
        )

    def _converted(self, *arguments: ArrayLike) -> Array:
        """The same of arguments that are no arrays of floats in rows."""
        shapes, shape = self._shapes
        one = zip(arguments, shapes, strict=True)
        arrays = [np.ascontiguousarray(given, dtype=float).reshape(1, *wanted) for given, wanted in one]
        out = np.empty((1, *shape))
        self(arrays, [out], 1)
        return out[0]


def signs_kernel(made: Program, inputs: Shapes, outputs: Shapes) -> SignsKernel | None:
    """A `SignsKernel`, built or loaded if it is not yet there; None where there can be none."""
    if not enabled():
        return None
    try:
        return SignsKernel(made, inputs, outputs)
    except NativeError as problem:
        tell(problem)
        return None


Method = Literal["leaf", "velocity"]
"""How a path is followed: by Newton steps on a leaf, or by Runge-Kutta steps of rates."""


def follow_code(made: Program, inputs: Shapes, outputs: Shapes, method: Method, more: str = "") -> str:
    """The C of hk_follow, see `FollowKernel`."""
    state = sum(int(np.prod(shape)) for shape in inputs)
    head = f"#define HK_N {inputs[0][0]}\n#define HK_FRAMES {inputs[1][0] // 3}\n#define HK_STATE {state}\n"
    drivers = {"leaf": ("hk_leaf_body", "branch.c", "newton.c", "follow.c"), "velocity": ("hk_rate_body", "velocity.c")}
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
        self, made: Program, inputs: Shapes, outputs: Shapes, method: Method, more: str = "", build: bool = True
    ) -> None:
        code = follow_code(made, inputs, outputs, method, more)
        self._library = library(code, long=made.instructions > LONG, needs=("hk_follow",), build=build)
        self._run: Any = self._library.hk_follow
        self._run.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_longlong] * 2 + [ctypes.c_void_p] * 4
        self._run.restype = ctypes.c_longlong

    def __call__(
        self,
        segments: Array,
        counts: Indices,
        closing: Array | None,
        x: Array,
        steps: tuple[int, int],
        limits: tuple[Array, Array],
        rules: ctypes.Structure,
        Q: Array,
    ) -> int:
        """Do the steps [first, last) of a cycle into the rows of Q; returns how many it did.

        x begins with the posture to start from; for "leaf" it is (q, p, R, c, rate, why), where `why` says after fewer
        steps: 1 no piece keeps to the branch, 2 the tries ran out, 3 a limit, 0 a step in Python tells it; q is where.
        """
        return self._run(
            segments.ctypes.data,
            counts.ctypes.data,
            None if closing is None else closing.ctypes.data,
            x.ctypes.data,
            *steps,
            limits[0].ctypes.data,
            limits[1].ctypes.data,
            ctypes.addressof(rules),
            Q.ctypes.data,
        )


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
            alive, point = (self._library, parameters), pose[0] if len(pose) == 1 else 0
            frames = -(-point // 3) if point else pose[0] // 4
            return glue.bind(address, parameters.ctypes.data, joints, point, frames, memory, convert, alive)
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


def _leaf_code(stretches: str, *drivers: str) -> str:
    """C of the ways along a leaf, with that of its stretches, where there is some, and of drivers."""
    models = [prelude("model.c"), stretches, prelude("stretch.c")] if stretches else []
    before, after = ("branch.c", "newton.c", "line.c", "way.c", "fold.c"), ("ray.c", "inverse.c", *drivers)
    return "".join([*map(prelude, before), *models, *map(prelude, after)])


class EdgeKernel:
    """hk_nearest_to of nearest.c: the rules of motion/ik/edge.py and motion/ik/inverse_function.py.

    Args:
        joints, rows: n, m.
        code: C that inverse.c needs, with hk_leaf_body, and hk_edge_body. stretches: C that stretch.c needs, or none.
        constants: of the rules, by their names.
        operations: of the longest function in the code.
    """

    def __init__(
        self, joints: int, rows: int, code: str, stretches: str, constants: Mapping[str, float], operations: int
    ) -> None:
        self._joints, self._rows = joints, rows
        head = f"#define HK_N {joints}\n#define HK_FRAMES 1\n"
        head += "".join(f"#define HK_EDGE_{key} {value!r}\n" for key, value in constants.items())
        whole = source(SCALAR, head, code + _leaf_code(stretches, "edge.c", "nearest.c"))
        self._library = library(whole, long=operations > LONG, interleaved=True, needs=("hk_nearest_to",))
        self._run: Any = self._library.hk_nearest_to
        self._run.argtypes = [ctypes.c_void_p] * 5
        self._run.restype = ctypes.c_int

    def __call__(
        self, context: Vector, goal: Vector, q: Vector | None, step: Vector | None
    ) -> tuple[int, tuple[Array, Array, Array, Array, Array]]:
        """(what became of it, as hk_nearest_to says; q, e, rcond, p and R, the constraints)."""
        n, m = self._joints, self._rows
        out = np.empty(3 * n + m + 14)
        places = (None if array is None else array.ctypes.data for array in (q, step))
        ended = self._run(context.ctypes.data, goal.ctypes.data, *places, out.ctypes.data)
        k = n + m + 1
        return ended, (out[:n], out[n : k - 1], out[k - 1 : k], out[k : k + 12], out[k + 12 :])


# --- A function called one sample at a time from Python: on the virtual machine at first, as native code once it pays.
#
# The virtual machine serves every call until there are HEAVY of them; then a compiler is asked in the background (see
# `later`), and native code takes over when it is ready. Both give the same numbers but for round-off, and the same
# errors: native code hands to the virtual machine whatever it does not take.

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
        self,
        made: Program,
        inputs: Shapes,
        outputs: Shapes,
        port: Port,
        *,
        results: Shapes,
        bounds: Sequence[float] = (),
        convert: Convert,
        doubt: Doubt | None = None,
        many: Callable[..., Array] | None = None,
    ) -> None:
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

        def sound(values: Sequence[float]) -> bool:
            for place, bound in measures:
                if not values[place] > bound:
                    return False
            # A sum beyond all floats counts as not finite, too: `doubt` looks closer. Python's sum does not warn of it.
            return isfinite(sum(values))

        def machine(*arguments: Any, **named: Any) -> Any:
            nonlocal left
            if left > 0:
                left -= 1
                if left <= 0 and (evaluator := myself()) is not None:
                    later(evaluator)
            # Arguments that are arrays of the right shape go straight into memory; others are converted.
            trigger, slots, takes, numbers = memory.all
            given: Sequence[Any] = arguments
            if len(given) != len(slots) or named:
                given = convert(*arguments, **named)
            for value, slot, shape in zip(given, slots, inputs, strict=True):
                if type(value) is not np.ndarray or value.dtype is not double or value.shape != shape:
                    given = convert(*arguments, **named)
                    if many is not None and given[0].ndim > 1:
                        return many(given[0])
                    for array, into in zip(given, slots, strict=True):
                        into[...] = array
                    break
                slot[...] = value
            trigger()
            if doubt is not None and not sound(values := numbers()):
                return doubt(*given, *[take() for take in takes], *[values[place] for place, _ in measures])
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
    function: Any, inputs: Shapes, results: Shapes, other: Callable[..., Any], alive: Any, context: Array
) -> Callable[..., Any] | None:
    """A callable around a C function (in, out, context) -> 1 or 0, as `hk_sample`; None without Python's headers.

    `other` is called where an argument does not fit, or it gives 0. `alive` is what the function belongs to.
    """
    try:
        module = _module()
    except NativeError as problem:
        tell(problem)
        return None
    return None if module is None else _bound(module, function, inputs, results, other, alive, context.ctypes.data)


def _bound(
    module: Any, function: Any, inputs: Shapes, results: Shapes, other: Any, alive: Any, context: int
) -> Callable[..., Any]:
    place = ctypes.cast(function, ctypes.c_void_p).value
    return module.Evaluator(place, tuple(inputs), tuple(results), other, alive, context)


def weak(method: Callable[..., Any]) -> Callable[..., Any]:
    """A bound method that does not keep its object, for the evaluators that the object itself keeps."""
    reference = weakref.WeakMethod(method)
    return lambda *arguments, **named: reference()(*arguments, **named)  # type: ignore[misc]


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


LEAST = 64
"""Poses from which a second thread is worth its start, 50 us: as long as a handful of them takes."""


class InverseKernel:
    """The doors of poses.c, about a Newton step (q, p, R, c) -> (dq, rcond, margin, side).

    more: C of numbers, branches and the constraint; stretches: C of the functions that stretch.c needs, or none.
    drivers: others that go with poses.c.
    """

    def __init__(
        self, made: Program, inputs: Shapes, outputs: Shapes, more: str, stretches: str, drivers: Sequence[str] = ()
    ) -> None:
        frames = inputs[1][0] // 3
        head = f"#define HK_N {inputs[0][0]}\n#define HK_FRAMES {frames}\n#define HK_MATRICES 1\n"
        code = body(made, inputs, outputs, "hk_leaf_body") + more
        whole = source(
            SCALAR, head, code + _leaf_code(stretches, "posed.c", "continuation.c", "reach.c", "poses.c", *drivers)
        )
        long = made.instructions > LONG
        self._library: Any = library(whole, long=long, needs=("hk_call_cold", "hk_call_warm", "hk_poses"))
        self._poses: Any = self._library.hk_poses
        places = [ctypes.c_void_p] * 2
        self._poses.argtypes = [ctypes.c_longlong, *places, ctypes.c_int, ctypes.c_int, *places]
        self._poses.restype = None
        self._joints = inputs[0][0]
        self._pose = (4, 4) if frames == 1 else (frames, 4, 4)

    def calls(
        self, context: Vector, cold: Callable[..., Any], warm: Callable[..., Any]
    ) -> tuple[Callable[..., Any], Callable[..., Any]] | None:
        """(pose) -> q and (pose, q) -> q, which hand to `cold` and `warm` what they do not take; None without headers.

        Args:
            context: what poses.c reads besides.
        """
        n, calls = self._joints, []
        for name, shapes, other in (("cold", (self._pose,), cold), ("warm", (self._pose, (n,)), warm)):
            function = getattr(self._library, f"hk_call_{name}")
            calls.append(bound_call(function, shapes, ((n,),), other, (self._library, context), context))
        return None if None in calls else (calls[0], calls[1])

    def nowhere(self, context: Vector) -> Callable[[Any], float | None] | None:
        """(pose) -> 1.0 where no posture of the arm at all has it, as an array of floats; else None."""
        found, place = self._library.hk_call_nowhere, self._library
        return bound_call(found, (self._pose,), ((),), lambda _pose: None, (place, context), context)

    def station(self, context: Vector, other: Callable[..., Any]) -> Callable[..., Any] | None:
        """(pose, which sheet and from which posture (1 + n,)) -> posture, margin, sheet (n + 2,) of stations.c, which
        must be among the drivers; None without headers."""
        shapes, place = (self._pose, (1 + self._joints,)), (self._library, context)
        return bound_call(self._library.hk_call_station, shapes, ((self._joints + 2,),), other, place, context)

    def __call__(
        self, targets: Matrix, context: Vector, q: Matrix, warm: bool, threads: int | None, shown: bool = False
    ) -> Indices:
        """The statuses of many targets (k, 12F); q (k, n) becomes where their paths ended. The GIL is free.

        warm: paths begin at q. shown: they are gone in pieces alone that are shown to keep to the branch.
        """
        count = len(targets)
        status = np.empty(count, dtype=np.int64)
        most = threads or os.cpu_count() or 1
        workers = max(1, min(most, count // LEAST))
        edges = np.linspace(0, count, 1 + (1 if workers == 1 else 8 * workers)).astype(int)  # some poses take longer

        def part(i: int) -> None:
            first, last = edges[i], edges[i + 1]
            places = [array[first:].ctypes.data for array in (targets, q, status)]
            self._poses(last - first, places[0], context.ctypes.data, int(warm), int(shown), places[1], places[2])

        in_parts(part, len(edges) - 1, workers)
        return status
