"""`export_c`: a strategy as a folder of C for a controller."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.files import write_texts
from ...base.types import ArrayLike, Result, number, whole
from ...motion.ik.branch import enclosed_change, extended_jacobian
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy
from ...symbolic.native import compiler
from ...symbolic.native.toolchain import PATIENCE
from ...version import __version__
from .c_text import Source, header, library, line, text, wrapper
from .test_vectors import selftest, vectors, vectors_header

MARK = re.compile(r"ritten by holokin \d")
"""What every file written here says in its first lines; others are never overwritten."""

STAMP = "0123456789abcdef"
"""Stands in the texts where the number of the whole export goes."""


@dataclass(frozen=True)
class Exported(Result):
    """What was written: the folder, its files, the operations of each function."""

    folder: Path
    name: str
    files: tuple[str, ...]
    operations: dict[str, int]

    def __str__(self) -> str:
        return f"written: {len(self.files)} files of {self.name} in {self.folder}"


@typed
def export_c(
    strategy: Strategy,
    folder: str | Path,
    *,
    q0: ArrayLike,
    dt: float = 0.001,
    name: str | None = None,
    limits: bool = True,
    vectors_count: int = 64,
    origin: str = "Python",
) -> Exported:
    """Write a strategy as C99 for a controller: library, headers of C and C++, self-test with its vectors, README.

    The library has the tool's pose, G, dq = G dx, the control step of `controller` and, for a strategy with a
    constraint, g, the Newton step on its leaf and inverse kinematics. It allocates nothing and keeps nothing, takes
    the same time at every posture (inverse kinematics a bounded one), and returns a status. With NAME_FLOAT defined
    it computes in single precision.

    Args:
        folder: made if need be; files there that holokin did not write are left alone, or refused if in the way.
        q0: posture (n,) whose leaf is held by default, and around which the test vectors lie.
        dt: the loop's step [s], a default that the controller may change.
        name: C name, the prefix of all symbols; by default robot and strategy.
        limits: keep joint speeds and positions by slowing along the path, and refuse joints beyond their limits.
        vectors_count: postures of the self-test.
        origin: what it was exported from, for the readme.

    Raises:
        ArgumentError: a name that is no C name, a bad dt, files in the way, a start near a singularity.
        ExportError: the strategy is too large, or has no C. SingularityError: of the start.
        JointLimitError: with limits, the start is beyond them.
    """
    source, texts = c_texts(strategy, q0, dt, name, limits, vectors_count, origin)
    write_export(Path(folder), texts, f"project({source.name} C)")
    return Exported(Path(folder), source.name, tuple(texts), operations_of(source))


def c_texts(
    strategy: Strategy, q0: ArrayLike, dt: float, name: str | None, limits: bool, vectors_count: int, origin: str
) -> tuple[Source, dict[str, str]]:
    """What is exported, and the texts of its files. Arguments and errors as of `export_c`."""
    robot = strategy.task.robot
    q0 = start_posture(robot, q0, limits)
    strategy(q0)
    count = whole("vectors_count", vectors_count)
    short = c_name(f"{robot.name}_{strategy.name}") if name is None else str(name)
    source = Source(strategy, q0, number("dt", dt), short, limits)
    test_vectors = vectors(source, count)
    words = source.words | {"version": __version__, "origin": line(origin), "count": len(test_vectors)}
    words |= _tables(source, operations_of(source))
    texts = {
        f"{short}.h": header(source, words),
        f"{short}.hpp": wrapper(source, words),
        f"{short}.c": library(source, words),
        f"{short}_vectors.h": vectors_header(source, test_vectors, words),
        f"{short}_selftest.c": selftest(source, words),
        "CMakeLists.txt": text("CMakeLists.txt", words),
        "README.md": text("README.md", words),
    }
    return source, _stamped(texts)


def operations_of(source: Source) -> dict[str, int]:
    """Operations of each function of an export."""
    return {key: function.program.operations for key, function in source.functions.items()}


def c_name(words: str) -> str:
    """A C name of words: lower-case letters, digits, underscores."""
    letters = "".join(c if c.isascii() and c.isalnum() else "_" for c in words.lower())
    name = "_".join(part for part in letters.split("_") if part)
    name = name if name[:1].isalpha() and not name.startswith("hk") else f"strategy_{name}"
    return name[:40].rstrip("_")


def _tables(source: Source, operations: dict[str, int]) -> dict[str, str]:
    robot, name, r = source.strategy.task.robot, source.name, len(source.leaf)
    joints = ["| | joint | unit | lower | upper | start |", "|---:|---|---|---:|---:|---:|"]
    for i, (joint, value) in enumerate(zip(robot.coordinates, source.q0, strict=True)):
        bounds = " | ".join(f"{b:.6g}" if np.isfinite(b) else "none" for b in (joint.lower, joint.upper))
        joints.append(f"| {i} | {line(joint.name).replace('|', '/')} | {joint.unit} | {bounds} | {value:.6g} |")
    n, m = source.strategy.task.n, source.strategy.task.m
    rows = [
        ("pose", f"{name}_pose(q, T)", "the tool's pose T (4x4) at q"),
        ("gain", f"{name}_gain(q, G)", f"G ({n}x{m})"),
        ("rate", f"{name}_rate(q, dx, dq)", "dq = G dx"),
        ("step", f"{name}_step(q, target, twist, &parameters, dq, &scale)", "one control step with feedback"),
    ]
    if source.holonomic:
        rows += [
            ("constraint", f"{name}_constraint(q, g)", f"g(q), {r} number{'s' if r > 1 else ''}"),
            ("leaf", f"{name}_leaf_step(q, target, c, dq)", "one Newton step to the wanted pose on the leaf c"),
        ]
    functions = [f"| `{call}` | {gives} | {operations[key]} |" for key, call, gives in rows]
    if source.holonomic:
        functions.append(
            f"| `{name}_inverse(q, target, c, most)` | inverse kinematics on the leaf c, in at most `most` pieces | "
            f"{operations['leaf']} a Newton step, {_look(source.holonomic)} for a look at a piece |"
        )
        at_once = "; by the closed form, and only else by a path" if source.branch else ""
        functions.append(
            f"| `{name}_solve(q, target, most)` | the same from the start, on its leaf{at_once} | as many |"
        )
    if source.closed:
        call = f"{name}_postures(target, {'c, ' if r else ''}q, signs)"
        functions.append(
            f"| `{call}` | all postures{' on the leaf c' if r else ''}, by a closed form: how many | "
            f"{operations['posture']} for each of 8 signs |"
        )
    dense = [f.program.order for f in source.functions.values() if f.program.after is not None]
    note = f"; a system of order {dense[0]} is solved besides, by loops of fixed length" if dense else ""
    return {"joint_table": "\n".join(joints), "function_table": "\n".join(functions), "dense_note": note}


def _look(strategy: HolonomicStrategy) -> int:
    """Operations that it takes to see whether a piece keeps to its branch, besides some n^4 of products."""
    once, change = extended_jacobian(strategy).program.operations, enclosed_change(strategy)
    return once + (change.function.program.instructions if change is not None else once * (4 + strategy.task.n))


def _stamped(texts: dict[str, str]) -> dict[str, str]:
    """With one number of all texts in the header, which each C file compares: files of two exports do not compile."""
    digest = hashlib.sha256("\0".join(texts.values()).encode()).hexdigest()[:16]
    return {file: content.replace(STAMP, digest) for file, content in texts.items()}


def write_export(folder: Path, texts: dict[str, str], project: str) -> None:
    """All files or, where the system refuses one, none.

    Args:
        texts: by file; a file may lie in a folder of the folder.
        project: the line of its CMakeLists.txt that says which export the folder holds.

    Raises:
        ArgumentError, WriteError.
    """
    try:
        for file in texts:
            path = folder / file
            if path.exists() and not (path.is_file() and MARK.search(path.read_text("utf-8", "replace")[:600])):
                raise ArgumentError("the output folder", str(folder), f"its {file} is not holokin's: choose another")
        build = folder / "CMakeLists.txt"
        if build.exists() and project not in build.read_text("utf-8", "replace"):
            raise ArgumentError("the output folder", str(folder), "it holds another export: give each its own")
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        why = problem.strerror if isinstance(problem, OSError) else str(problem)
        raise ArgumentError("the output folder", str(folder), f"cannot be written: {why}") from None
    write_texts(folder, texts)


WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")


def check(exported: Exported) -> list[str]:
    """Build and run the self-test in double and in single precision; returns what each says.

    Flags for the compiler in CFLAGS of the environment come last, as with make.

    Raises:
        ExportError: no compiler, it refuses the code, or a test fails.
    """
    chosen = compiler()
    if chosen is None:
        raise ExportError("no C compiler was found, so the self-test was not run", "build it where there is one")
    answers = []
    sources = [str(exported.folder / f"{exported.name}.c"), str(exported.folder / f"{exported.name}_selftest.c")]
    with tempfile.TemporaryDirectory() as folder:
        for precision, defined in (("double", ()), ("float", (f"-D{exported.name.upper()}_FLOAT",))):
            test = str(Path(folder) / f"selftest-{precision}{'.exe' if sys.platform == 'win32' else ''}")
            flags = ["-std=c99", "-O1", *WARNINGS, *os.environ.get("CFLAGS", "").split()]
            command = [*chosen.command, *flags, *defined, *sources, "-o", test, "-lm"]
            _run(command, f"{chosen.version} refused the exported code in {precision}")
            answers.append(_run([test], f"the self-test in {precision} failed").strip())
    return answers


def _run(command: list[str], fault: str) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", timeout=PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise ExportError(f"{fault} ({problem})", "please report it") from problem
    if done.returncode != 0:
        lines = (done.stderr + done.stdout).strip().splitlines()
        complaint = next((line for line in lines if "error" in line), lines[0] if lines else f"code {done.returncode}")
        raise ExportError(f"{fault} ({complaint.strip()})", "do not use it; please report it, with the job")
    return done.stdout
