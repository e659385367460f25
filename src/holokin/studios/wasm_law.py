"""A strategy as WebAssembly: the C by which `hk.follow` goes along a path, compiled by zig for a browser."""

from __future__ import annotations

import base64
import importlib.util
import subprocess
import sys
import tempfile
import zlib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..base.tolerances import TOLERANCES
from ..base.types import Matrix, Vector
from ..codegen import LARGEST
from ..codegen.toolchain import call
from ..errors import ExportError, MissingExtraError, NativeError
from ..inverse_kinematics.branch import branch_code
from ..inverse_kinematics.leaf import leaf_rules, leaf_step
from ..motion.follow_path import by_leaf
from ..motion.velocity_steps import path_rate, velocity_rules
from ..output.bodies import Piece
from ..robot import Robot
from ..strategies import Strategy, may_jump
from ..symbolic import SX, Function, symbol, vertcat

PATIENCE = 300.0
"""Seconds that the compiler may take: at its first call it builds the C library of WebAssembly, some 20 seconds."""

FLAGS = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-O1", "-std=gnu99", "-fno-math-errno", "-ffp-contract=off")
"""As for native code: products and sums are not fused, so that a browser computes what Python does."""

ENDLESS = 1e300
"""A joint limit [joint units] that is none."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """Points (k, 3) that a page draws an arm by, each in the frame of a joint, -1 for the base."""

    joints: tuple[int, ...]
    points: Matrix

    def function(self, robot: Robot) -> Function:
        """q -> the points in the base's frame (3 k,)."""
        q = symbol("q", robot.n)
        frames = {j: robot.kinematics_at(q, j, np.eye(4)) for j in sorted(set(self.joints) - {-1})}
        rows = [
            SX(point) if j < 0 else frames[j].position + frames[j].rotation @ SX(point)
            for j, point in zip(self.joints, self.points, strict=True)
        ]
        return Function("drawn", {"q": q}, {"points": vertcat(*rows)})


def drawn_of(robot: Robot, pieces: tuple[Piece, ...], ends: list[tuple[Vector, Vector]], tip: str | None) -> Drawn:
    """The tool's point of a tip, then both ends of each piece, given in the frames of their joints."""
    tool = robot.tip(tip)
    joints = [tool.joint, *(piece.joint for piece in pieces for _ in range(2))]
    return Drawn(tuple(joints), np.vstack([tool.placement[:3, 3], *(end for pair in ends for end in pair)]))


def law_code(strategy: Strategy, drawn: Drawn, segments: int) -> str:
    """The C of a strategy for a page: `hk_follow` with its functions, and law.c.

    Args:
        segments: of the longest loop.

    Raises:
        ExportError: the strategy is too long, may jump, or has no C.
    """
    if jumps := may_jump(strategy):
        fact = f"the rule of {strategy.name!r} may jump ({', '.join(jumps)}), which a page does not look for"
        raise ExportError(fact, "choose another rule")
    leaf = by_leaf(strategy)
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
        "drawn": drawn.points.size, "segments": segments,
        "lower": _row(robot.lower - slack), "upper": _row(robot.upper + slack),
        "free_lower": _row(np.full(robot.n, -np.inf)), "free_upper": _row(np.full(robot.n, np.inf)),
        "rules": ", ".join("side" if key == "side" else repr(getattr(rules, key)) for key, *_ in rules._fields_),
    }  # fmt: skip
    driver = Template(files("holokin.studios").joinpath("web", "law.c").read_text("utf-8")).substitute(words)
    return code + drawn.function(robot).c("hk_drawn_body") + driver


def _row(values: Vector) -> str:
    return ", ".join(repr(float(np.clip(value, -ENDLESS, ENDLESS))) for value in values)


def wasm_of(code: str, name: str) -> bytes:
    """The WebAssembly module of a C source, by zig.

    Raises:
        MissingExtraError: there is no zig. ExportError: it refuses the code, or does not end.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise MissingExtraError("ziglang", "native")
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


def packed(module: bytes) -> str:
    """A module for a page: deflated, in base64."""
    return base64.b64encode(zlib.compress(module, 9)).decode("ascii")


def start_of(strategy: Strategy, q0: Vector, p: Vector, R: Matrix) -> dict[str, Any]:
    """What a run begins with: the state behind the joints (p, R, c), and the side of det [J; J_g]."""
    leaf = by_leaf(strategy)
    if leaf is None:
        return {"state": [], "side": 0.0}
    from ..inverse_kinematics.leaf import leaf_value

    c = leaf_value(leaf, q0)
    side = float(leaf_step(leaf)(q0, p, R, c)[3])
    return {"state": [*p.tolist(), *R.ravel().tolist(), *c.tolist()], "side": side}
