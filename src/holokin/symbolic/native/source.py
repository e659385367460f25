"""The C of programs: flat arguments in rows as NumPy has them, and whole files around them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from .emit import SCALAR, emit, prelude
from .program import Program, Shapes

Place = Callable[[int, int], str]
"""(argument, element in column-major order) -> C."""


def body(made: Program, inputs: Shapes, outputs: Shapes, name: str) -> str:
    """C of `static void NAME(const hk_t *x, hk_t *y)`: all inputs after one another in x, rows as NumPy has them.

    A program with a system needs the text of solve.c before it. That of a transport comes with it.
    """
    x, y = _places(inputs), _places(outputs)

    def stage(function: ca.Function, suffix: str, more: dict[str, str], read: Place, write: Place) -> str:
        others = "".join(f", {kind} *restrict {key}" for key, kind in more.items())
        idle = "".join(f"  (void){key};\n" for key in ("x", "y", *more))  # no complaint of what is not used
        code = idle + emit(function, name, read, write)
        return f"static void {name}{suffix}(const hk_t *restrict x, hk_t *restrict y{others}) {{\n{code}\n}}\n"

    def given(a: int, i: int) -> str:
        return f"x[{x(a, i)}]" if a < len(inputs) else f"t[{i}]"

    loop, more, carry, found = "", {}, "", ""
    if made.transport is not None:
        loop, more, found = made.transport.c, {"t": "const hk_t"}, ", t"
        carry = (
            f"  hk_t t[{made.transport.found.shape[0]}];\n"
            f"  hk_transport(x + {x(made.carried, 0)}, t, {int(made.sloping)});\n"
        )
    whole = f"static void {name}(const hk_t *restrict x, hk_t *restrict y) {{\n{carry}"
    if made.after is None:
        if made.transport is None:
            return stage(made.before, "", {}, given, lambda a, i: f"y[{y(a, i)}]")
        before = stage(made.before, "_before", more, given, lambda a, i: f"y[{y(a, i)}]")
        return f"{loop}{before}{whole}  {name}_before(x, y, t);\n}}\n"
    n, k, early = made.order, made.columns, len(made.early)
    known = len(inputs) + (made.transport is not None)
    width = n + k

    def before_writes(a: int, i: int) -> str:
        if a < early:
            return f"y[{y(made.early[a], i)}]"
        return f"s[{i % n * width + i // n + (n if a > early else 0)}]"

    def after_reads(a: int, i: int) -> str:
        if a < known:
            return given(a, i)
        return f"s[{i % n * width + n + i // n}]" if a == known else f"f[{i}]"

    def after_writes(a: int, i: int) -> str:
        return f"y[{y(made.late[a], i)}]"

    before = stage(made.before, "_before", {**more, "s": "hk_t"}, given, before_writes)
    after = stage(made.after, "_after", {**more, "s": "const hk_t", "f": "const hk_t"}, after_reads, after_writes)
    return (
        f"{loop}{before}{after}{whole}"
        f"  hk_t s[{n * width}], w[{width}], f[2];\n  {name}_before(x, y{found}, s);\n"
        f"  hk_solve({n}, {k}, s, w, f);\n  {name}_after(x, y{found}, s, f);\n}}\n"
    )


def source(language: str, head: str, code: str, *drivers: str) -> str:
    """A whole C file: prelude, sizes, generated code with its solver, drivers."""
    solver = prelude("solve.c") if "hk_solve(" in code else ""
    return prelude(language) + head + solver + code + "".join(map(prelude, drivers))


def _places(shapes: Shapes):
    """(argument, element in column-major order) -> place in one flat array of row-major arguments."""
    starts = np.concatenate([[0], np.cumsum([int(np.prod(s)) for s in shapes])]).astype(int)

    def place(argument: int, element: int) -> int:
        shape = shapes[argument]
        if len(shape) == 2:
            element = element % shape[0] * shape[1] + element // shape[0]
        return int(starts[argument]) + element

    return place


def step_source(made: Program, inputs: Shapes, outputs: Shapes, measures: dict[str, float]) -> str:
    """The C of a control step: prelude, sizes, generated body, hk_step."""
    each = [int(np.prod(shape)) for shape in inputs]
    sizes = dict(zip(("N", "POSE", "TWIST", "PARAMETERS"), each, strict=True)) | measures
    head = "".join(f"#define HK_{key} {value}\n" for key, value in sizes.items())
    return source(SCALAR, head, body(made, inputs, outputs, "hk_step_body"), "step.c")
