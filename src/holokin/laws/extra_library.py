"""Optional libraries, by the extra that has them."""

from __future__ import annotations

import contextlib
import importlib
import os
from pathlib import Path
from typing import Any

from ..errors import MissingExtraError


def extra(module: str, package: str, name: str) -> Any:
    """An optional library, by the extra that has it. Raises: MissingExtraError."""
    try:
        with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):  # some print when imported
            return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package, name) from None
