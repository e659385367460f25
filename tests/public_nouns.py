"""The public classes of the package, for tests about all of them."""

from __future__ import annotations

import inspect
from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType

import holokin as hk


def rooms() -> list[ModuleType]:
    public = [room for name in hk.__all__ if inspect.ismodule(room := getattr(hk, name))]
    names = [m.name for room in public for m in walk_packages(room.__path__, f"{room.__name__}.") if m.ispkg]
    return [hk, *(room for room in (*public, *map(import_module, names)) if hasattr(room, "__all__"))]


def public_classes() -> dict[str, type]:
    """Every class that a room gives out, by room and name, once."""
    found: dict[type, str] = {}
    for room in rooms():
        for name in room.__all__:
            one = getattr(room, name)
            if inspect.isclass(one) and not issubclass(one, Exception):
                found[one] = f"{room.__name__.partition('.')[2]}.{name}".lstrip(".")
    return {name: one for one, name in found.items()}
