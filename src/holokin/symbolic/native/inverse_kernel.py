"""Inverse kinematics as native code: one pose called from Python, many in threads."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ...base.types import Indices, Matrix, Vector
from .emit import SCALAR, prelude
from .evaluator import bound_call
from .kernel import LONG
from .native_library import library
from .program import Program, Shapes
from .source import body, source

LEAST = 64
"""Poses from which a second thread is worth its start, 50 us: as long as a handful of them takes."""


class InverseKernel:
    """The doors of poses.c, about a Newton step (q, p, R, c) -> (dq, rcond, margin, side).

    more: C of numbers, branches and the constraint; stretches: C of the functions that stretch.c needs, or none.
    """

    def __init__(self, made: Program, inputs: Shapes, outputs: Shapes, more: str, stretches: str) -> None:
        frames = inputs[1][0] // 3
        head = f"#define HK_N {inputs[0][0]}\n#define HK_FRAMES {frames}\n#define HK_MATRICES 1\n"
        code = body(made, inputs, outputs, "hk_leaf_body") + more
        parts = [*map(prelude, ("branch.c", "newton.c", "line.c", "way.c", "fold.c"))]
        if stretches:
            parts += [prelude("model.c"), stretches, prelude("stretch.c")]
        parts += [*map(prelude, ("ray.c", "inverse.c", "posed.c", "poses.c"))]
        whole = source(SCALAR, head, code + "".join(parts))
        long = made.instructions > LONG
        self._library: Any = library(whole, long=long, needs=("hk_call_cold", "hk_call_warm", "hk_poses"))
        self._poses: Any = self._library.hk_poses
        places = [ctypes.c_void_p] * 2
        self._poses.argtypes = [ctypes.c_longlong, *places, ctypes.c_int, *places]
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
        n, found = self._joints, []
        for name, shapes, other in (("cold", (self._pose,), cold), ("warm", (self._pose, (n,)), warm)):
            function = getattr(self._library, f"hk_call_{name}")
            found.append(bound_call(function, shapes, ((n,),), other, (self._library, context), context))
        return None if None in found else (found[0], found[1])

    def __call__(self, targets: Matrix, context: Vector, q: Matrix, warm: bool, threads: int | None) -> Indices:
        """The statuses of many targets (k, 12F); q (k, n) becomes where their paths ended. The GIL is free."""
        count = len(targets)
        status = np.empty(count, dtype=np.int64)
        most = threads or os.cpu_count() or 1
        workers = max(1, min(most, count // LEAST))
        edges = np.linspace(0, count, 1 + (1 if workers == 1 else 8 * workers)).astype(int)  # some poses take longer

        def part(i: int) -> None:
            first, last = edges[i], edges[i + 1]
            places = [array[first:].ctypes.data for array in (targets, q, status)]
            self._poses(last - first, places[0], context.ctypes.data, int(warm), places[1], places[2])

        if workers == 1:
            part(0)
        else:
            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(part, range(len(edges) - 1)))
        return status
