"""Robots, laws and paths that a survey in Python is given as objects: its tables name them by keys."""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Callable, Mapping
from typing import Any

from ...base.errors import ArgumentError
from ...base.poses import pose_from
from ...base.types import Matrix
from ...path import Path

OBJECT = "given:"
"""Before the name of a robot that is an object."""

_objects: dict[str, Any] = {}
_forgetting: list[Callable[[], None]] = []


def keep(objects: Mapping[str, Any]) -> None:
    """Those of the survey that this process does now; what was built of others with the same keys is forgotten."""
    if any(_objects.get(key, thing) is not thing for key, thing in objects.items()):
        for forget in _forgetting:
            forget()
    _objects.update(objects)


def when_replaced(forget: Callable[[], None]) -> Callable[[], None]:
    """Have something done when a key gets another object: whoever keeps what is built of objects forgets it."""
    _forgetting.append(forget)
    return forget


def given(key: str) -> Any:
    """The object of a key. Raises: ArgumentError."""
    if key not in _objects:
        raise ArgumentError("key", key, "it is of a survey in Python: a survey file cannot name it")
    return _objects[key]


def given_path(key: str, tool: Matrix) -> Path:
    """A path that begins at the tool pose (4, 4): one that is moved there, or that a function makes of the pose."""
    found = given(key)
    if not isinstance(found, Path):
        return found(tool)
    return found.in_frame(pose_from(tool[:3, 3] - found.start))


def sendable(objects: Mapping[str, Any]) -> bool:
    """Whether other processes can be sent them; what a script or notebook defines itself they do not find."""
    try:
        return b"__main__" not in pickle.dumps(dict(objects))
    except Exception:  # noqa: BLE001  pickle raises what the objects raise
        return False


def forks() -> bool:
    """Whether a process can have them without being sent them."""
    return "fork" in multiprocessing.get_all_start_methods()
