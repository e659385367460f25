"""Functions that a survey file names: their module is looked for beside the file first, then where Python looks."""

from __future__ import annotations

import importlib
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...base.errors import ArgumentError

_importing = threading.Lock()
"""The path of Python's modules is of all threads."""

_folders: dict[str, Path] = {}
"""Where a survey found a module: the next survey may have one of the same name in another folder."""


def imported(name: str, folder: Path) -> Callable[..., Any]:
    """The function "module:name". Raises: ArgumentError: it cannot be imported."""
    module, _, function = name.partition(":")
    try:
        with _importing, _first(folder):
            _forget(module.partition(".")[0], folder)
            found = getattr(importlib.import_module(module), function)
            if folder.absolute() in Path(getattr(sys.modules[module], "__file__", None) or "/").parents:
                _folders[module.partition(".")[0]] = folder
    except Exception as problem:  # noqa: BLE001  a module may raise anything
        fact = problem if isinstance(problem, ImportError | AttributeError) else repr(problem)
        raise ArgumentError("the law", name, f"it cannot be imported ({fact}); see to it in {folder}") from None
    if not callable(found):
        raise ArgumentError("the law", name, "it is no function: name one of (task, start posture)")
    return found


def source_of(name: str, folder: Path) -> Path | None:
    """The file of a function "module:name" that lies beside the survey file; else None."""
    place = folder.joinpath(*name.partition(":")[0].split("."))
    return next((file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()), None)


def forget_imported() -> bool:
    """Import anew what was found beside survey files: it may have changed. Whether there was any."""
    with _importing:
        found = list(_folders)
        for top in found:
            _drop(top)
    return bool(found)


def _forget(top: str, folder: Path) -> None:
    """What a survey in another folder imported from there by this name."""
    if _folders.get(top, folder) != folder:
        _drop(top)


def _drop(top: str) -> None:
    del _folders[top]
    for module in [known for known in sys.modules if known == top or known.startswith(f"{top}.")]:
        del sys.modules[module]


@contextmanager
def _first(folder: Path) -> Iterator[None]:
    before = str(folder.absolute())
    importlib.invalidate_caches()  # the file may have been written a moment ago
    sys.path.insert(0, before)
    try:
        yield
    finally:
        sys.path.remove(before)
