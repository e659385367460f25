"""Optional libraries, by the extra that has them."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any

from ...base.extra_module import extra_module


def extra(module: str, package: str, name: str) -> Any:
    """An optional library, by the extra that has it. Raises: MissingExtraError."""
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):  # some print when imported
        return extra_module(module, name, package)
