"""Packages that an extra of holokin installs, loaded when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from .errors import MissingExtraError


def extra_module(module: str, extra: str, package: str = "") -> Any:
    """A module of such a package, by default one of its name. Raises: MissingExtraError: it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package or module, extra) from None
