"""Robots by the names of the package robot_descriptions, which fetches their files from the network."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from pkgutil import iter_modules

from ..errors import MissingExtraError, RobotFileError, UnknownNameError, brief
from .reading import Arguments, read_tree
from .tree import Tree

PREFIX = "robot_descriptions:"
"""What such names begin with, as in "robot_descriptions:panda_description"."""


def description_tree(name: str, args: Arguments | None = None) -> Tree:
    """The tree of a robot by its name there, after `PREFIX`; "_description" may be left out.

    Raises:
        MissingExtraError: the package is not installed. UnknownNameError: it has no such robot.
        RobotFileError: its files cannot be fetched, or are not read.
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
        said = brief(str(problem).strip().splitlines()[-1] if str(problem).strip() else type(problem).__name__, 200)
        cure = "check the network: robot_descriptions clones the files of a robot when it is asked for the first time"
        raise RobotFileError(name, f"its files could not be fetched ({said})", cure) from problem
    for kind in ("URDF_PATH", "MJCF_PATH", "XACRO_PATH"):
        path = getattr(module, kind, None)
        if path is not None:
            return read_tree(path, args)
    raise RobotFileError(name, "has no URDF, xacro or MJCF file", "choose another description")
