"""Packages that an extra of holokin installs, and folders of holokin itself, loaded when they are needed."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from .errors import MissingExtraError, NoAttributeError


def extra_module(module: str, extra: str, package: str = "") -> Any:
    """A module of such a package, by default one of its name. Raises: MissingExtraError: it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package or module, extra) from None


def loads(package: str, *parts: str, **files: str) -> Callable[[str], Any]:
    """The `__getattr__` of a folder: a folder in it is loaded when it is first asked for, and a file, file="NAME NAME",
    when one of its names is.

    Raises (when called): NoAttributeError: another name.
    """
    homes = {name: file for file, names in files.items() for name in names.split()}

    def part(name: str) -> Any:
        if name in homes:
            return getattr(importlib.import_module(f"{package}.{homes[name]}"), name)
        if name not in parts:
            raise NoAttributeError(package, name, (*parts, *homes))
        return importlib.import_module(f"{package}.{name}")

    return part
