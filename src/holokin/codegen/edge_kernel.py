"""The way down to the nearest pose at the edge of reach as native code."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..types import Array
from .emit import SCALAR
from .kernel import LONG, LeafRules
from .native import library
from .source import source


class EdgeKernel:
    """hk_nearest_to of one strategy: the rules of motion/edge.py and motion/nearest_pose.py.

    Args:
        joints, rows, code: n, m, and the C that the drivers need: hk_leaf_body, hk_edge_body and that of branch.c.
        constants: of the rules, by their names.
        operations: of the longest function in the code.
    """

    def __init__(self, joints: int, rows: int, code: str, constants: Mapping[str, float], operations: int) -> None:
        self._joints, self._rows = joints, rows
        state = 2 * joints - rows + 12
        sizes = {"N": joints, "STATE": state, **constants}
        head = "".join(f"#define HK_{key} {value!r}\n" for key, value in sizes.items())
        self._library = library(
            source(SCALAR, head, code, "path.c", "branch.c", "newton.c", "nearest.c"),
            long=operations > LONG, interleaved=True, needs=("hk_nearest_to",),
        )  # fmt: skip
        self._run: Any = self._library.hk_nearest_to
        self._run.argtypes = [ctypes.c_void_p] * 5
        self._run.restype = ctypes.c_int

    def numbers(
        self, start: Array, tool: Array, lower: Array, upper: Array, length: float, margin: float, level: Array,
        leaf: LeafRules,
    ) -> ctypes.Structure:  # fmt: skip
        """The hk_edge of a leaf and its edge."""
        n = self._joints
        one, kinds = ctypes.c_double, {"start": n, "tool": 12, "lower": n, "upper": n, "length": 1, "margin": 1}
        fields = [*((name, one * size) for name, size in kinds.items()), ("level", one * (n - self._rows + 1))]
        made = type("Edge", (ctypes.Structure,), {"_fields_": [*fields, ("leaf", LeafRules)]})
        values = start, tool, lower, upper, [length], [margin], [*level, 0.0]
        return made(*((one * len(list(v)))(*map(float, v)) for v in values), leaf)

    def __call__(
        self, edge: ctypes.Structure, goal: Array, q: Array | None, step: Array | None
    ) -> tuple[int, Array, Array, float, Array, Array]:
        """(1 where a step cut the way short, -1 where q leads nowhere; q, e, rcond, p and R, the constraints)."""
        n, m = self._joints, self._rows
        out = np.empty(n + m + 1 + 12 + 2 * n + 1)
        places = (None if array is None else array.ctypes.data for array in (q, step))
        moving = self._run(ctypes.addressof(edge), goal.ctypes.data, *places, out.ctypes.data)
        return moving, out[:n], out[n : n + m], float(out[n + m]), out[n + m + 1 : n + m + 13], out[n + m + 13 :]
