"""The path down to the nearest pose at the edge of reach as native code."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.types import Array, Vector
from .emit import SCALAR, prelude
from .kernel import LONG
from .native_library import library
from .source import source


class EdgeKernel:
    """hk_nearest_to of nearest.c: the rules of motion/ik/edge.py and motion/ik/nearest_pose.py.

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
        parts = [*map(prelude, ("branch.c", "newton.c", "line.c", "way.c", "fold.c"))]
        if stretches:
            parts += [prelude("model.c"), stretches, prelude("stretch.c")]
        parts += [*map(prelude, ("ray.c", "inverse.c", "edge.c", "nearest.c"))]
        whole = source(SCALAR, head, code + "".join(parts))
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
