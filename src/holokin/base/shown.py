"""How values are shown: one short line in a console, a small table in a notebook, with every text escaped."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import wraps
from html import escape
from inspect import getattr_static
from typing import Any

import numpy as np

from .errors import FORMS, NoAttributeError

LONGEST = 200
"""Characters of a value's line."""

_EACH = 60
"""Characters of one of its parts."""

_ROWS = 40
"""Rows of a table."""

_SHORT = 9
"""Numbers of an array that are shown one by one."""

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""Control characters, and those that turn the direction of what is written after them."""

_CELL = "text-align:left;padding:.15rem .6rem;vertical-align:top"


class Shown:
    """The parent of dataclasses that show themselves: `repr` is one line, at most 200 characters.

    In a notebook it is what `str` says, or its fields, as a table. Texts are escaped there, whoever wrote them.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if not issubclass(cls, Enum):  # else `dataclass` writes one with every number in it
            line: Any = _bounded(cls.__repr__) if "__repr__" in vars(cls) else cls.__repr__
            cls.__repr__ = line

    def __repr__(self) -> str:
        name, parts = type(self).__name__, []
        for field in fields(self) if is_dataclass(self) else ():
            value = getattr(self, field.name)
            if field.name.startswith("_") or value is None or (callable(value) and not isinstance(value, Shown)):
                continue
            parts.append(f"{field.name}={_part(value)}")
            if len(name) + 5 + sum(len(part) + 2 for part in parts) > LONGEST:
                parts[-1] = "..."
                break
        return f"{name}({', '.join(parts)})"

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if not isinstance(getattr_static(type(self), name, None), _Absent)]

    def _repr_html_(self) -> str:
        return _table(type(self).__name__, self._shown_rows())

    def _shown_rows(self) -> list[Sequence[str]]:
        """The rows of the table: what a line of `str` says before and after its colon, or a field and its value."""
        if type(self).__str__ is object.__str__:
            found = fields(self) if is_dataclass(self) else ()
            return [(f.name.replace("_", " "), _part(getattr(self, f.name), LONGEST)) for f in found]
        return [_split(line) for line in str(self).splitlines() if line.strip()]


class _Absent:
    """A name that a noun does not have, under which people look for something else: reading it says what to write.

    A class with `__getattr__` would do this for all names, but then reading any takes longer.
    """

    def __init__(self, name: str, form: str) -> None:
        self.name, self.form = name, form

    def __get__(self, noun: object, kind: type) -> Any:
        owner = f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"
        raise NoAttributeError(owner, self.name, (), self.form)


for _form, _names in FORMS.items():
    for _name in _names.split():
        setattr(Shown, _name, _Absent(_name, _form))


def _bounded(written: Callable[[Any], str]) -> Any:
    @wraps(written)
    def called(self: Any) -> str:
        return one_line(written(self))

    return called


def _table(title: str, rows: Sequence[Sequence[str]]) -> str:
    """A table of plain texts as HTML: all of them are escaped here."""
    left = len(rows) - _ROWS
    lines = [_row(row) for row in rows[:_ROWS]]
    more = f"<p>{_safe(f'and {left:,} more')}</p>" if left > 0 else ""
    return f"<div><b>{_safe(title)}</b><table>{''.join(lines)}</table>{more}</div>"


def one_line(text: str, most: int = LONGEST) -> str:
    """A text without control characters, cut where it is too long."""
    plain = _CONTROL.sub(" ", text)
    return plain if len(plain) <= most else f"{plain[: most - 3]}..."


def _row(cells: Sequence[str]) -> str:
    found = ""
    for k, cell in enumerate(cells):
        wrap = "overflow-wrap:anywhere" if k or len(cell) > _EACH else "white-space:nowrap"
        found += f'<td style="{_CELL};{wrap}">{_safe(cell)}</td>'
    return f"<tr>{found}</tr>"


def _safe(text: str) -> str:
    return escape(_CONTROL.sub("\ufffd", text), quote=True)


def _split(line: str) -> Sequence[str]:
    before, colon, after = line.strip().partition(": ")
    return (before, after) if colon and len(before) <= _EACH else ("", line.strip())


def _part(value: Any, most: int = _EACH) -> str:
    """A field in few characters: small numbers as they are, arrays and lists by their size, nouns by their names."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, bool | int | np.bool_ | np.integer | type(None)):
        return one_line(str(value), most)
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if isinstance(value, str):
        return one_line(repr(value), most)
    if isinstance(value, np.ndarray):
        return _array(value, most)
    if isinstance(value, Mapping | Sequence) or (isinstance(value, Sized) and isinstance(value, Iterable)):
        return _several(value, most)
    name = getattr(value, "name", None)
    return f"{type(value).__name__}" + (f"({one_line(repr(name), most)})" if isinstance(name, str) else "")


def _array(value: np.ndarray, most: int) -> str:
    if value.ndim <= 1 and value.size <= _SHORT and value.dtype.kind in "biuf":
        text = str([float(f"{v:.4g}") for v in value.ravel()] if value.ndim else float(value))
        if len(text) <= most:
            return text
    return f"array{value.shape}"


def _several(value: Any, most: int) -> str:
    if isinstance(value, list | tuple) and all(isinstance(v, str | int | float) for v in value):
        text = one_line(str(value), LONGEST)
        if len(text) <= most:
            return text
    return f"{len(value):,} {'entry' if len(value) == 1 else 'entries'}"
