"""Models by name: URDF, xacro and MJCF files, told apart by their endings and contents; of other packages."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ..tree import Tree, above_of, links_of, root_of, tips_of
from .mjcf import mjcf_tree
from .packaged_models import is_packaged, packaged_file
from .urdf import urdf_text_tree, urdf_tree
from .urdf_xml import read_model
from .xacro import xacro_tree

MODELS = (".urdf", ".xacro", ".xml", ".mjcf")
"""Endings of files that hold a tree of links and joints."""

Arguments = Mapping[str, str | float | bool]
"""Names and values of a xacro file's arguments."""


def is_model(name: str | Path) -> bool:
    """Whether a robot's name is that of a tree of links and joints, of which `tip`, `base` and `locked` choose."""
    return is_packaged(str(name)) or Path(name).suffix.lower() in MODELS


def read_tree(name: str | Path, args: Arguments | None = None) -> Tree:
    """The tree of a model. Raises: RobotFileError, MissingExtraError; ArgumentError: args for what is no xacro file."""
    path = packaged_file(str(name)) if is_packaged(str(name)) else Path(name)
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        return xacro_tree(path, args)
    if args:
        raise ArgumentError(f"args of {str(path)!r}", dict(args), "only xacro files take them")
    if suffix in (".xml", ".mjcf"):
        text = read_model(path)
        return urdf_text_tree(text, path) if re.search(rb"<robot[\s>]", text) else mjcf_tree(path)
    return urdf_tree(path)


@typed
def model_tips(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link (of MJCF: body or site) at which the tree of a file ends -> the moving joints from the base to it.

    Mimic joints are included. Raises: RobotFileError, MissingExtraError, UnknownNameError.
    """
    return tips_of(read_tree(path), base)


@typed
def model_links(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link that hangs on the base -> the moving joints from the base to it, as of `model_tips`."""
    return links_of(read_tree(path), base)


def model_root(path: str | Path) -> str:
    """The link that the tree of a file hangs on. Raises: RobotFileError: there are several, or none."""
    tree = read_tree(path)
    return root_of(tree, above_of(tree))
