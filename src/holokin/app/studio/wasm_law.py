"""A strategy as WebAssembly: the C by which `hk.follow` goes along a path, compiled by zig for a browser."""

from __future__ import annotations

import base64
import importlib.util
import subprocess
import sys
import tempfile
import zlib
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ...base.errors import ExportError, MissingExtraError, NativeError
from ...base.tolerances import TOLERANCES
from ...base.types import Matrix, Vector
from ...motion.follow_path import by_leaf
from ...motion.ik.branch import branch_code
from ...motion.ik.leaf import leaf_rules, leaf_step, leaf_value
from ...motion.integrate_velocity import path_rate, velocity_rules
from ...strategies import Strategy, may_jump
from ...symbolic.native import LARGEST
from ...symbolic.native.toolchain import call
from .drawn_arm import DrawnArm

PATIENCE = 300.0
"""Seconds that the compiler may take: at its first call it builds the C library of WebAssembly, some 20 seconds."""

FLAGS = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-O1", "-std=gnu99", "-fno-math-errno", "-ffp-contract=off")
"""As for native code: products and sums are not fused, so that a browser computes what Python does."""

ENDLESS = 1e300
"""A joint limit [joint units] that is none."""


def law_code(strategy: Strategy, arm: DrawnArm, segments: int) -> str:
    """The C of a strategy for a page: `hk_follow` with its functions, and law.c.

    Args:
        segments: of the longest loop.

    Raises:
        ExportError: the strategy is too long, may jump, or has no C.
    """
    leaf = by_leaf(strategy)
    if leaf is not None and (jumps := may_jump(leaf)):
        fact = f"the rule of {strategy.name!r} may jump ({', '.join(jumps)}), which a page does not look for"
        raise ExportError(fact, "choose another rule")
    function = path_rate(strategy) if leaf is None else leaf_step(leaf)
    if (size := function.program.instructions) > LARGEST:
        fact = f"{strategy.name!r} is {size:,} operations long, {LARGEST:,} are the most"
        raise ExportError(fact, "take a shorter law; of one with leaves hk.strategies.fitted makes a polynomial")
    try:
        code = function.follower_c("velocity") if leaf is None else function.follower_c("leaf", branch_code(leaf))
    except NativeError as problem:
        raise ExportError(problem.fact, "write the law without it") from None
    robot, slack = strategy.task.robot, TOLERANCES.limit
    rules = velocity_rules() if leaf is None else leaf_rules(0.0)
    words = {
        "drawn": 3 + 6 * len(arm.parts), "segments": segments,
        "lower": _row(robot.lower - slack), "upper": _row(robot.upper + slack),
        "free_lower": _row(np.full(robot.n, -np.inf)), "free_upper": _row(np.full(robot.n, np.inf)),
        "rules": ", ".join("side" if key == "side" else repr(getattr(rules, key)) for key, *_ in rules._fields_),
    }  # fmt: skip
    driver = Template(files("holokin.app.studio").joinpath("web", "law.c").read_text("utf-8")).substitute(words)
    return code + arm.function.c("hk_drawn_body") + driver


def _row(values: Vector) -> str:
    return ", ".join(repr(float(np.clip(value, -ENDLESS, ENDLESS))) for value in values)


def check_zig() -> None:
    """Raises: MissingExtraError: there is no zig."""
    if importlib.util.find_spec("ziglang") is None:
        raise MissingExtraError("ziglang", "native")


def wasm_of(code: str, name: str) -> bytes:
    """The WebAssembly module of a C source, by zig.

    Raises:
        MissingExtraError: there is no zig. ExportError: it refuses the code, or does not end.
    """
    check_zig()
    with tempfile.TemporaryDirectory() as folder:
        source, module = Path(folder) / "law.c", Path(folder) / "law.wasm"
        source.write_text(code, "utf-8")
        command = (sys.executable, "-m", "ziglang", "cc", *FLAGS, "-Wl,--strip-all", str(source), "-o", str(module))
        try:
            status, said = call(command, PATIENCE, "stderr")
        except (OSError, subprocess.TimeoutExpired) as problem:
            raise ExportError(f"zig did not compile {name!r} ({problem})", "try again, or take a shorter law") from None
        if status != 0 or not module.is_file():
            complaint = next((line for line in said.splitlines() if "error" in line), f"code {status}").strip()
            raise ExportError(f"zig refused the C of {name!r} ({complaint})", "please report it, with the job")
        return module.read_bytes()


def packed(data: bytes) -> str:
    """Bytes for a page: deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def begin_of(strategy: Strategy, q0: Vector, p: Vector, R: Matrix) -> dict[str, Any]:
    """What a run begins with: joints, the state behind them (p, R, c), and the side of det [J; J_g]."""
    leaf, found = by_leaf(strategy), {"q0": q0.tolist(), "state": [], "side": 0.0}
    if leaf is None:
        return found
    c = leaf_value(leaf, q0)
    side = float(leaf_step(leaf)(q0, p, R, c)[3])
    return found | {"state": [*p.tolist(), *R.ravel().tolist(), *c.tolist()], "side": side}
