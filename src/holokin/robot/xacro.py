"""Robots from xacro files, which xacrodoc expands to URDF or MJCF. Extra `xacro`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path

from ..errors import MissingExtraError, RobotFileError, brief
from .mjcf import mjcf_text_tree
from .tree import Tree
from .urdf import urdf_text_tree
from .urdf_xml import read_model


def xacro_tree(path: str | Path, args: Mapping[str, str | float | bool] | None = None) -> Tree:
    """The tree of a xacro file. Packages that it names, $(find PACKAGE), are looked for in the folders above it.

    Args:
        args: values of its arguments, <xacro:arg name=...>.

    Raises:
        MissingExtraError: xacrodoc is not installed. RobotFileError: it cannot be expanded, or gives no robot.
    """
    read_model(path)  # says what is wrong with the file itself
    try:
        from xacrodoc import XacroDoc
    except ImportError:
        raise MissingExtraError("xacrodoc", "xacro") from None
    given = {name: _word(value) for name, value in (args or {}).items()}
    try:
        with chdir(Path(path).parent):  # from where xacro looks for files that are named without a package
            text = XacroDoc.from_file(Path(path).name, subargs=given, resolve_packages=False).dom.toxml()
    except Exception as problem:
        said = brief(str(problem).strip() or type(problem).__name__)
        cure = "correct the file, or give what it lacks with args={name: value}"
        raise RobotFileError(path, f"cannot be expanded ({said})", cure) from problem
    if "<mujoco" in text:
        return mjcf_text_tree(text, str(path))
    return urdf_text_tree(text.encode(), path)


def _word(value: str | float | bool) -> str:
    """A value as xacro reads it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
