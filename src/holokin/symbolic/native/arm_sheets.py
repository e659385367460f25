"""The sheets of an arm as native code: one call tries them all, eight side by side."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...base.errors import NativeError
from ...base.types import ROTATION, Array, Flags, Matrix, Vector, frozen
from .emit import LANES, Program, Shapes, body, source
from .kernel import LONG, bound_call, in_parts
from .toolchain import enabled, library, tell

BLOCK = 8
"""Rows of a table that stand side by side."""

Call = Callable[..., Any]

_FEW = 256
"""Poses from which a second thread is worth its start."""


class SheetsKernel:
    """The doors of sheets.c, about (pose (4, 4), rule (w,), branch (b,)) -> (posture (n,), real, within, fault).

    Args:
        tool: posture (n,) -> pose (4, 4). joints: lower and upper limits (n,), and which turn (n,).
        rows: of the sheets (S, w + b), rule and branch. choices: branches (K, b). values: of what is held (C,).
        slides: whether a rule is that value, not a vector along an angle. turning: whether the last value's neighbour
            is the first one.
        constants: by their names, of sheets.c.
    """

    def __init__(
        self,
        made: Program,
        inputs: Shapes,
        outputs: Shapes,
        tool: Program,
        joints: tuple[Vector, Vector, Flags],
        rows: Matrix,
        choices: Matrix,
        values: Vector,
        slides: bool,
        turning: bool,
        constants: Mapping[str, float],
    ) -> None:
        n, w, b = outputs[0][0], inputs[1][0], inputs[2][0]
        sizes = {"N": n, "W": w, "B": b, "NX": 16 + w + b, "NY": n + 3, "SHEETS": len(rows)}
        sizes |= {"CHOICES": len(choices), "VALUES": len(values), "SLIDE": int(slides)}
        head = "".join(f"#define HK_{key} {value}\n" for key, value in sizes.items())
        head += "".join(f"#define HK_{key} {value!r}\n" for key, value in constants.items())
        low, high, turn = joints
        for name, kind, numbers in (
            ("low", "double", low),
            ("high", "double", high),
            ("hinge", "int", turn.astype(int)),
        ):
            row = ", ".join(repr(x) if np.isfinite(x) else f"{'-' if x < 0 else ''}HUGE_VAL" for x in numbers.tolist())
            head += f"static const {kind} hk_{name}[] = {{{row}}};\n"
        head += f"#define HK_TURN {2 * np.pi!r}\n"
        head += f"#define HK_TURNS {int(turning)}\n#define HK_OFF {ROTATION!r}\n"
        code = body(made, inputs, outputs, "hk_body") + body(tool, [(n,)], [(4, 4)], "hk_tool")
        self._library: Any = library(
            source(LANES, head, code, "sheets.c"),
            fast=True,
            long=made.instructions > LONG,
            needs=("hk_posture", "hk_stay", "hk_place", "hk_sheets", "hk_batch"),
        )
        blocks = np.zeros((-(-len(rows) // BLOCK) * BLOCK, rows.shape[1]))
        blocks[: len(rows)] = rows
        table = blocks.reshape(-1, BLOCK, rows.shape[1]).swapaxes(1, 2)
        self._context = frozen(np.concatenate([table.ravel(), choices.ravel(), values]))
        self._n, self._sheets = n, len(rows)
        self._run: Any = self._library.hk_batch
        self._run.argtypes, self._run.restype = [ctypes.c_longlong, *[ctypes.c_void_p] * 3], None

    def calls(self, posture: Call, near: Call, place: Call, sheets: Call) -> tuple[Call, Call, Call, Call] | None:
        """(pose) -> posture (n,); (pose, q) -> posture, its sheet, -1 for none, whether joints jump (n + 2,);
        (pose) -> posture, margin, sheet (n + 2,); (pose) -> posture and margin of each sheet (S, n + 1).

        They hand to those given what they do not take. None without Python's headers.
        """
        calls, n = [], self._n
        for name, shape, other in (
            ("posture", (n,), posture),
            ("stay", (n + 2,), near),
            ("place", (n + 2,), place),
            ("sheets", (self._sheets, n + 1), sheets),
        ):
            given = ((4, 4), (n,)) if name == "stay" else ((4, 4),)
            function = getattr(self._library, f"hk_{name}")
            calls.append(bound_call(function, given, (shape,), other, (self._library, self._context), self._context))
        return None if None in calls else (calls[0], calls[1], calls[2], calls[3])

    def __call__(self, poses: Array, threads: int | None = None) -> Matrix:
        """The posture, the margin and the sheet (k, n + 2) of poses (k, 4, 4)."""
        poses, out = np.ascontiguousarray(poses), np.empty((len(poses), self._n + 2))
        workers = max(1, min(threads or os.cpu_count() or 1, len(poses) // _FEW))
        edges = np.linspace(0, len(poses), 1 + (1 if workers == 1 else 8 * workers)).astype(int)

        def part(i: int) -> None:
            first, last = edges[i], edges[i + 1]
            places = poses[first:].ctypes.data, self._context.ctypes.data, out[first:].ctypes.data
            self._run(int(last - first), *places)

        in_parts(part, len(edges) - 1, workers)
        return out


def sheets_kernel(*arguments: Any) -> SheetsKernel | None:
    """A `SheetsKernel`, built or loaded if it is not yet there; None where there can be none."""
    if not enabled():
        return None
    try:
        return SheetsKernel(*arguments)
    except NativeError as problem:
        tell(problem)
        return None
