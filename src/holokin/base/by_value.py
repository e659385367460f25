"""Equality by value: robots, tasks, constraints and strategies are equal when they are made of equal parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property, partial
from hashlib import blake2b
from inspect import signature
from numbers import Real
from pathlib import PurePath
from types import MethodType
from typing import Any, ClassVar

import numpy as np

from .types import Value


class ByValue(Value):
    """The parent of values that are equal by what they are made of, and may be keys.

    What was made by a call of the library is equal to what an equal call made; what was made by hand, by its fields. A
    function of the user's own, and what else cannot be looked into, is equal to itself alone. The parts are read once,
    when two values are first compared or one is first a key; 32 bytes of them are kept.
    """

    aside: ClassVar[tuple[str, ...]] = ()
    """Fields that do not count."""

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return self.digest == other.digest  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return self._number

    @cached_property
    def digest(self) -> bytes:
        """32 bytes that stand for the parts, in this process."""
        return blake2b(b"".join(_parts(self)), digest_size=32).digest()

    @cached_property
    def _number(self) -> int:
        return int.from_bytes(self.digest[:7], "big")


def _parts(value: ByValue) -> list[bytes]:
    recipe = vars(value).get("_recipe")
    if recipe is not None:
        return [_written(type(value)), _call(*recipe)]
    return [_written(type(value)), *_fields(value, value.aside)]


def _call(function: Callable[..., Any], arguments: tuple[Any, ...], named: Mapping[str, Any]) -> bytes:
    """A call of the library, by the names of its arguments, with its defaults."""
    bound = signature(function).bind(*arguments, **named)
    bound.apply_defaults()
    return _written(function) + _written(dict(bound.arguments))


def _fields(value: Any, aside: tuple[str, ...] = ()) -> list[bytes]:
    return [_written(getattr(value, field.name)) for field in fields(value) if field.name not in aside]


def _written(value: Any) -> bytes:
    """A value as bytes: equal ones of equal values, numbers by their size and not by their type."""
    kind, body = _body(value)
    return f"{kind} {len(body)} ".encode() + body


def _body(value: Any) -> tuple[str, bytes]:
    if isinstance(value, ByValue):
        return "value", value.digest
    if value is None or isinstance(value, bool | np.bool_ | str | bytes | Enum | PurePath):
        return type(value).__name__, repr(value).encode(errors="surrogatepass")
    if isinstance(value, Real | np.ndarray | list | tuple) and (numbers := _numbers(value)) is not None:
        return f"numbers {numbers.shape}", numbers.tobytes()
    if isinstance(value, list | tuple):
        return "list", b"".join(map(_written, value))
    if isinstance(value, Mapping):
        return "mapping", b"".join(_written(key) + _written(one) for key, one in value.items())
    if isinstance(value, partial):
        return "partial", _written([value.func, value.args, value.keywords])
    if isinstance(value, MethodType):
        return "method", _written([value.__func__, value.__self__])
    if is_dataclass(value) and not isinstance(value, type):
        recipe = vars(value).get("_recipe")
        return type(value).__qualname__, _call(*recipe) if recipe is not None else b"".join(_fields(value))
    return "object", str(id(value)).encode()  # it lives as long as what holds it


def _numbers(value: Any) -> np.ndarray | None:
    """The numbers of a value as floats, without the sign of zero; None of what has others in it."""
    try:
        found = np.asarray(value)
    except (ValueError, OverflowError):  # ragged
        return None
    return found.astype(float) + 0.0 if found.dtype.kind in "iuf" and found.size else None
