"""Robots by the names of other packages: robot_descriptions, which fetches files, and example-robot-data."""

from __future__ import annotations

import importlib
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules

from ...base.errors import MissingExtraError, RobotFileError, UnknownNameError, brief

PREFIX = "robot_descriptions:"
"""What its names begin with, as in "robot_descriptions:panda_description"."""

EXAMPLES = "example-robot-data:"
"""What names of that package begin with, as in "example-robot-data:talos_full_v2"."""


def is_packaged(name: str) -> bool:
    """Whether the name of a robot is one of another package."""
    return name.startswith((PREFIX, EXAMPLES))


def packaged_file(name: str) -> Path:
    """The file of a robot of another package. Raises: as `_description_file` and `_example_file`."""
    return _example_file(name) if name.startswith(EXAMPLES) else _description_file(name)


def _example_file(name: str) -> Path:
    """The URDF of a robot of the installed package example-robot-data, by its file's name without ".urdf".

    Of two files of one name that of the first folder counts.

    Raises:
        MissingExtraError: the package is not installed. UnknownNameError: it has no such robot.
    """
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        raise MissingExtraError("example-robot-data", "descriptions") from None
    known = {file.name.removesuffix(".urdf"): file for file in sorted(listed, reverse=True) if file.suffix == ".urdf"}
    word = name.removeprefix(EXAMPLES).removesuffix(".urdf")
    if word not in known:
        raise UnknownNameError("robot of example-robot-data", word, sorted(known))
    return Path(str(known[word].locate()))


def _description_file(name: str) -> Path:
    """The file (URDF, MJCF or xacro) of a robot by its name there, after `PREFIX`; "_description" may be left out.

    Raises:
        MissingExtraError: the package is not installed. UnknownNameError: it has no such robot.
        RobotFileError: its files cannot be fetched.
    """
    if find_spec("robot_descriptions") is None:
        raise MissingExtraError("robot_descriptions", "descriptions")
    package = importlib.import_module("robot_descriptions")
    word = name.removeprefix(PREFIX)
    known = sorted(m.name for m in iter_modules(package.__path__) if m.name.endswith("_description"))
    found = next((full for full in (word, f"{word}_description") if full in known), None)
    if found is None:
        raise UnknownNameError("robot of robot_descriptions", word, known)
    try:
        module = importlib.import_module(f"robot_descriptions.{found}")
    except Exception as problem:
        said = str(problem).strip() or type(problem).__name__
        cure = "check the network: robot_descriptions clones the files of a robot when it is asked for the first time"
        raise RobotFileError(name, f"its files could not be fetched ({brief(said, 200)})", cure) from problem
    for kind in ("URDF_PATH", "MJCF_PATH", "XACRO_PATH"):
        if hasattr(module, kind):
            return Path(getattr(module, kind))
    raise RobotFileError(name, "has no URDF, xacro or MJCF file", "choose another description")
