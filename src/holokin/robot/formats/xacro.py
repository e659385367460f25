"""Robots from xacro files, which xacrodoc expands to URDF or MJCF. Extra `xacro`."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...base.errors import MissingExtraError, RobotFileError, UnknownNameError, brief
from ..tree import Tree
from .mjcf import mjcf_text_tree
from .urdf import read_model, urdf_text_tree
from .xacro_expander import PATIENCE

_WAIT = 4 * PATIENCE
"""Seconds that an expansion may take in all: its processor time on a busy machine."""

_CURE = "correct the file, or give what it lacks with args={name: value}"


def xacro_tree(path: str | Path, args: Mapping[str, str | float | bool] | None = None) -> Tree:
    """The tree of a xacro file. Packages that it names, $(find PACKAGE), are looked for in the folders above it.

    Nothing of the file is run as Python: see `xacro_expander`.

    Args:
        args: values of its arguments, <xacro:arg name=...>.

    Raises:
        MissingExtraError: xacrodoc is not installed. RobotFileError: it cannot be expanded, or gives no robot.
        UnknownNameError: it has no such argument.
    """
    read_model(path)  # says what is wrong with the file itself
    if find_spec("xacrodoc") is None:
        raise MissingExtraError("xacrodoc", "xacro")
    given = {name: _word(value) for name, value in (args or {}).items()}
    answer = _expanded(Path(path), given)
    for name in given:
        if name not in answer["known"]:
            raise UnknownNameError(f"argument of {path}", name, answer["known"])
    text, macros = answer["text"], answer["macros"]
    if macros and "<joint" not in text:
        fact = f"has no joints: it only defines macros, {', '.join(macros)}"
        raise RobotFileError(path, fact, f"load a file that includes it and calls one, as <xacro:{macros[-1]} .../>")
    if "<mujoco" in text:
        return mjcf_text_tree(text, str(path))
    return urdf_text_tree(text.encode(), path)


def _expanded(path: Path, args: Mapping[str, str]) -> dict[str, Any]:
    """The text that a process of its own gives, with its macros and arguments. Raises: RobotFileError."""
    program = str(Path(__file__).with_name("xacro_expander.py"))
    asked = json.dumps({"path": str(path.resolve()), "args": dict(args)}).encode()
    try:
        done = subprocess.run([sys.executable, "-P", program], input=asked, capture_output=True, timeout=_WAIT)
    except subprocess.TimeoutExpired:
        raise RobotFileError(path, f"cannot be expanded (it takes longer than {_WAIT} s)", _CURE) from None
    except OSError as problem:
        fact = f"cannot be expanded (Python does not start as {sys.executable!r}: {problem.strerror})"
        raise RobotFileError(path, fact, "expand it with xacro, and give the URDF") from None
    if done.returncode:
        raise RobotFileError(path, f"cannot be expanded ({_end(done)})", _CURE)
    answer = json.loads(done.stdout)
    if "expression" in answer:
        where, expression = Path(answer["file"]).name, brief(answer["expression"], 100)
        fact = f"cannot be expanded (the expression {expression!r} of {where} is not evaluated: {answer['fault']})"
        cure = "write it with numbers, texts, lists, dictionaries and the functions of xacro"
        raise RobotFileError(path, fact, f"{cure}, or expand a file that you trust with xacro, and give the URDF")
    if "package" in answer:
        cure = "put its folder into one above the file, or source the ROS workspace that has it"
        raise RobotFileError(path, f"names the ROS package {answer['package']!r}, which is not found", cure)
    if "not at start of entity" in answer.get("fault", ""):
        fact = f"cannot be expanded ({brief(answer['fault'])})"
        raise RobotFileError(path, fact, "delete what stands before <?xml ...?> in it, or in a file that it includes")
    if "fault" in answer:
        raise RobotFileError(path, f"cannot be expanded ({brief(answer['fault'])})", _CURE)
    return answer


def _end(done: subprocess.CompletedProcess[bytes]) -> str:
    """Why a process ended without an answer."""
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode < 0:
        return f"it takes more than {PATIENCE} s of processor time, or more memory than there is"
    return f"its process failed: {brief(lines[-1] if lines else 'without a word', 200)}"


def _word(value: str | float | bool) -> str:
    """A value as xacro reads it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
