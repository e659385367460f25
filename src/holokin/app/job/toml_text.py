"""Writing job files: TOML values, robot files as a job names them, and files that must be new."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import JobError
from ...base.files import aside, write_text, writing


def toml(value: Any) -> str:
    """A value as TOML writes it on one line: text, numbers, lists, tables."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml(one)}" for key, one in value.items()) + " }"
    values: Sequence[Any] = value
    return "[" + ", ".join(map(toml, values)) + "]"


def toml_key(key: str) -> str:
    """A key as TOML writes it: in quotes where it is no plain word."""
    return key if key.replace("-", "").replace("_", "").isalnum() and key.isascii() else toml(key)


def table(name: str, keys: Mapping[str, Any]) -> str:
    """A table of a job file, a key on each line."""
    return "\n".join([f"[{name}]", *(f"{toml_key(key)} = {toml(value)}" for key, value in keys.items())]) + "\n"


def robot_name(robot: str, path: FilePath) -> str:
    """A robot file as a job in another folder names it: relative where it lies near, so that both can be moved."""
    try:
        near = FilePath(os.path.relpath(robot, path.parent))
    except ValueError:  # another drive
        near = FilePath(robot).absolute()
    return (near if near.parts.count("..") < 2 else FilePath(robot).absolute()).as_posix()


def check_new(path: FilePath) -> None:
    """Raises: JobError unless a job file may be written there: it ends in .toml and does not exist. WriteError: its
    folder does not exist, or nothing can be written in it.
    """
    if path.suffix.lower() != ".toml":
        raise JobError(path, "file", "does not end in .toml", "name it like my-job.toml")
    if os.path.lexists(path):
        raise JobError(path, "file", "exists already", "choose another name, or delete it first")
    with writing(path), aside(path.parent):  # a hidden folder there for a moment is the surest test
        pass


def write_new(path: FilePath, text: str) -> None:
    """Write a new file. Raises: JobError: it exists. WriteError."""
    check_new(path)
    write_text(path, text, new=True)
