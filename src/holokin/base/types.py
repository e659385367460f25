"""Array aliases, checks of numbers, and what all values of the library have in common.

Units are SI and radians; twist rows are linear first, in the base frame. The shapes stand in the names' docstrings,
since NumPy's types do not carry them: `Vector` is (k,), `Matrix` is (rows, columns), `Array` is any shape. A batch axis
comes first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property, partial, wraps
from hashlib import blake2b
from html import escape
from inspect import getattr_static, signature
from numbers import Real
from pathlib import PurePath
from types import MethodType
from typing import Any, ClassVar, Concatenate, NoReturn, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import (
    FORMS,
    ArgumentError,
    CallError,
    NoAttributeError,
    NotFiniteError,
    OwnFunctionError,
    ShapeError,
)

# --- How values are shown: one short line in a console, a small table in a notebook, with every text escaped.

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
        return [name for name in super().__dir__() if not isinstance(getattr_static(type(self), name, None), Absent)]

    def _repr_html_(self) -> str:
        return _table(type(self).__name__, self._shown_rows())

    def _shown_rows(self) -> list[Sequence[str]]:
        """The rows of the table: what a line of `str` says before and after its colon, or a field and its value."""
        if type(self).__str__ is object.__str__:
            shown = fields(self) if is_dataclass(self) else ()
            return [(f.name.replace("_", " "), _part(getattr(self, f.name), LONGEST)) for f in shown]
        rows: list[Sequence[str]] = []
        for line in filter(None, map(str.strip, str(self).splitlines())):
            before, colon, after = line.partition(": ")
            rows.append((before, after) if colon and len(before) <= _EACH else ("", line))
        return rows


class Absent:
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
        setattr(Shown, _name, Absent(_name, _form))


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
    row = ""
    for k, cell in enumerate(cells):
        wrap = "overflow-wrap:anywhere" if k or len(cell) > _EACH else "white-space:nowrap"
        row += f'<td style="{_CELL};{wrap}">{_safe(cell)}</td>'
    return f"<tr>{row}</tr>"


def _safe(text: str) -> str:
    return escape(_CONTROL.sub("\ufffd", text), quote=True)


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
        if value.ndim <= 1 and value.size <= _SHORT and value.dtype.kind in "biuf":
            text = str([float(f"{v:.4g}") for v in value.ravel()] if value.ndim else float(value))
            if len(text) <= most:
                return text
        return f"array{value.shape}"
    if isinstance(value, Mapping | Sequence) or (isinstance(value, Sized) and isinstance(value, Iterable)):
        return _several(value, most)
    name = getattr(value, "name", None)
    return f"{type(value).__name__}" + (f"({one_line(repr(name), most)})" if isinstance(name, str) else "")


def _several(value: Any, most: int) -> str:
    if isinstance(value, list | tuple) and all(isinstance(v, str | int | float) for v in value):
        text = one_line(str(value), LONGEST)
        if len(text) <= most:
            return text
    return f"{len(value):,} {'entry' if len(value) == 1 else 'entries'}"


Array = NDArray[np.float64]
"""A float64 array of any shape."""

Vector = NDArray[np.float64]
"""A float64 array of shape (k,)."""

Matrix = NDArray[np.float64]
"""A float64 array of shape (rows, columns)."""

Indices = NDArray[np.intp]
"""An integer array of any shape."""

Flags = NDArray[np.bool_]
"""An array of yes and no, of any shape."""

ArrayLike = NDArray[Any] | Sequence[Any] | float
"""What a caller may pass where an array is wanted."""

MOST = 10**9
"""Largest count: a thousand times what takes minutes, so that a larger one is a mistake."""


HUGE = 1e150
"""Largest length, time, speed, ...: the squares of larger numbers are beyond all floats."""


def whole(what: str, value: Any, least: int = 1) -> int:
    """A whole number from `least` to 1e9. Raises: ArgumentError for anything else, True and 2.0 included."""
    fits = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not fits or not least <= value <= MOST:
        raise ArgumentError(what, value, f"give a whole number, at least {least}, at most {MOST:g}")
    return int(value)


def number(what: str, value: Any) -> float:
    """A number as a float. Raises: ArgumentError for anything else, True and what no float can hold included."""
    try:
        if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
            return float(value)
    except OverflowError:  # a whole number beyond all floats
        raise ArgumentError(what, value, "give a number below 1e308") from None
    raise ArgumentError(what, value, "give a number")


def positive(what: str, value: Any, cure: str = "give a positive number") -> float:
    """A finite number above 0. Raises: ArgumentError."""
    checked = number(what, value)
    if not 0 < checked < np.inf:
        raise ArgumentError(what, checked, cure)
    return _below_huge(what, checked)


def not_negative(what: str, value: Any) -> float:
    """A finite number, 0 or above. Raises: ArgumentError."""
    checked = number(what, value)
    if not 0 <= checked < np.inf:
        raise ArgumentError(what, checked, "give a finite number that is not negative")
    return _below_huge(what, checked)


def _below_huge(what: str, value: float) -> float:
    if value > HUGE:
        raise ArgumentError(what, value, f"give at most {HUGE:g}")
    return value


def in_order(what: str, value: Any, names: Sequence[str]) -> Any:
    """Values by name, as a dict or a row of pandas has them, in the order of the names; others as they are.

    Raises:
        ArgumentError: a name is missing; nobody knows the order, for there are no `names`.
    """
    keys = list(value.keys()) if hasattr(value, "keys") else []
    if not any(isinstance(key, str) for key in keys):
        return value
    missing = [name for name in names if name not in keys]
    if missing or not names:
        cure = f"it lacks {', '.join(missing)}" if names else "robot.checked(q) or robot.postures(Q) has them in order"
        raise ArgumentError(what, f"values by the names {', '.join(map(str, keys))}", cure)
    return np.stack([np.asarray(value[name]) for name in names], axis=-1)


def numbers(what: str, value: Any, names: Sequence[str] = ()) -> Array:
    """An array of floats; of values by name in the order of `names`, as `in_order`.

    Raises:
        ArgumentError: no array of numbers, but text, ragged lists, None.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return np.asarray(value)
    if type(value) is not list and hasattr(value, "keys"):
        value = in_order(what, value, names)
    try:
        given = np.asarray(value)
        if given.dtype.kind == "O":  # whole numbers beyond 64 bits, fractions, or no numbers at all
            given = np.array([number(what, v) for v in given.ravel()]).reshape(given.shape)
        if given.dtype.kind in "iuf":
            return given.astype(float)
    except (ArgumentError, TypeError, ValueError, OverflowError, RecursionError):
        pass
    raise ArgumentError(what, value, "give numbers, in rows of one length")


def one_or_each(what: str, value: Any, count: int) -> Array:
    """Numbers (count,), given one by one or as one for all; read only. Raises: ArgumentError, ShapeError."""
    given = numbers(what, value)
    if given.shape not in ((), (count,)):
        raise ShapeError(what, f"() or ({count},)", given.shape)
    return np.broadcast_to(given, (count,))


def finite(what: str, value: Any, shape: tuple[int | str, ...] | None = None, cure: str = "") -> Array:
    """An array of finite floats, of a shape if one is given; a name in it ("k") stands for any length.

    Raises:
        ArgumentError, ShapeError, NotFiniteError.
    """
    array = numbers(what, value)
    if shape is not None and not (
        array.ndim == len(shape)
        and all(isinstance(n, str) or n == length for n, length in zip(shape, array.shape, strict=True))
    ):
        raise ShapeError(what, shape, array.shape, cure)
    if not np.isfinite(array).all():
        raise NotFiniteError(what, array.tolist())
    return array


ROTATION = 1e-5
"""How far R R^T of a wanted rotation may be from 1: rotations in single precision are right to 1e-7."""


ROUNDED = 0.05
"""The same of a rotation that was written with few digits: two leave 0.03."""


def rotation_gap(rotations: Array) -> Array:
    """How far matrices (..., 3, 3) are from rotations: the largest entry of |R R^T - 1|; 2 or more for a reflection."""
    with np.errstate(invalid="ignore", over="ignore"):
        gap = np.abs(rotations @ np.swapaxes(rotations, -1, -2) - np.eye(3)).max(axis=(-2, -1))
        return np.where(np.linalg.det(rotations) > 0, gap, np.maximum(gap, 2.0))


def rotation_cure(R: Array) -> str:
    """What to say of a matrix (3, 3) that is no rotation: how far it is from one, and how to get the nearest."""
    if np.linalg.det(R) < 0:
        off = float(rotation_gap(-R))
        return f"it is left-handed, a reflection, and R R^T {off:.2g} away from 1: give a right-handed rotation matrix"
    gap = float(rotation_gap(R))
    cure = f"R R^T is {gap:.2g} away from 1, {ROTATION:g} is allowed: give a right-handed rotation matrix"
    rounded = ", with all its digits; of a rounded one Rotation.from_matrix(R).as_matrix() of SciPy is the nearest"
    return cure + (rounded if gap < ROUNDED else "")


def check_rotation(what: str, R: Array) -> None:
    """Raises: ArgumentError unless a matrix (3, 3) is a rotation."""
    if not rotation_gap(R) < ROTATION:
        raise ArgumentError(what, R.tolist(), rotation_cure(R))


def last_row_gap(poses: Array) -> Array:
    """How far the last rows of matrices (..., 4, 4) are from 0, 0, 0, 1: the largest entry."""
    return np.abs(poses[..., 3, :] - [0.0, 0.0, 0.0, 1.0]).max(axis=-1)


def right_last_row(what: str, pose: Matrix) -> None:
    """Raises: ArgumentError: the last row of a matrix (4, 4) is not 0, 0, 0, 1."""
    if not last_row_gap(pose) < ROTATION:
        cure = "give 0, 0, 0, 1 there, and rotation and position above; is the matrix transposed?"
        raise ArgumentError(f"the last row of {what}", pose[3].tolist(), cure)


def tool_pose(what: str, pose: Matrix) -> Matrix:
    """The same matrix (4, 4), if it is a right-handed rotation and a position above a last row 0, 0, 0, 1.

    Raises:
        ArgumentError: it is none.
    """
    right_last_row(what, pose)
    check_rotation(f"the rotation of {what}", pose[:3, :3])
    return pose


def number_or_none(value: float) -> float | None:
    """A number as JSON has it: None for one that is not finite."""
    return value if np.isfinite(value) else None


def frozen(array: Any) -> Any:
    """The array, if nobody can write to it, else a copy to which nobody can."""
    if isinstance(array, np.ndarray):
        owner = array if array.base is None else array.base
        if not array.flags.writeable and isinstance(owner, np.ndarray) and not owner.flags.writeable:
            return array
    copy = np.array(array)
    copy.flags.writeable = False
    return copy


Noun = TypeVar("Noun")
Made = TypeVar("Made")
More = ParamSpec("More")


def kept(build: Callable[Concatenate[Noun, More], Made]) -> Callable[Concatenate[Noun, More], Made]:
    """`cached_property` for a function: what it builds of an object and of plain arguments is kept in the object.

    It lives as long as the object, and is neither pickled nor copied with a `Value`.
    """

    @wraps(build)
    def called(noun: Noun, *more: More.args, **named: More.kwargs) -> Made:
        results = vars(noun).setdefault("_kept", {})
        key = (build, *more, *named.items())
        if key not in results:
            results[key] = build(noun, *more, **named)
        return results[key]

    return called


class Value(Shown):
    """The parent of frozen dataclasses: they keep copies of arrays, which nobody can write to.

    They are pickled as their fields; what was computed from these is computed again.
    """

    def __post_init__(self) -> None:
        values = vars(self)  # a path has a hundred thousand segments: dataclasses.fields takes twice as long
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                values[name] = frozen(value)

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, frozen(value) if isinstance(value, np.ndarray) else value)


class Result(Shown):
    """The parent of what functions find: it can be written as JSON."""

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, ready for JSON: arrays are lists, statuses and nouns their names, NaN is null."""
        return _plain_fields(self)


class NoTruthValue(Result):
    """The parent of results and statuses that may say no: `bool` of one raises `CallError`.

    `ask` says what to ask instead.
    """

    ask: ClassVar[str]

    def __init_subclass__(cls, ask: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        if ask:
            cls.ask = ask

    def __bool__(self) -> NoReturn:
        raise CallError(
            f"{type(self).__name__} is neither True nor False, for that would say nothing of what was found",
            f"ask {self.ask}",
        )


def _plain_fields(value: Any) -> dict[str, Any]:
    """The fields of a dataclass as plain data, without functions."""
    parts = {f.name: getattr(value, f.name) for f in fields(value)} if is_dataclass(value) else {}
    return {
        name: plain_data(part)
        for name, part in parts.items()
        if not name.startswith("_") and (not callable(part) or isinstance(part, Shown))
    }


def plain_data(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, float | np.floating):
        return number_or_none(float(value))
    if isinstance(value, bool | int | str | np.generic | type(None)):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, np.ndarray):
        return plain_data(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain_data(part) for key, part in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain_data(part) for part in value]
    if isinstance(name := getattr(value, "name", None), str):  # a robot, a task, a strategy
        return name
    return _plain_fields(value) if is_dataclass(value) else str(value)


def runs(flags: Flags) -> Indices:
    """The first index, and that after the last, (r, 2) of each run of True among flags (k,)."""
    return np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int))).reshape(-1, 2)


def some(part: Any, chosen: Any) -> Any:
    """Some of the rows of a value whose fields are arrays of a row each."""
    return type(part)(*(getattr(part, f.name)[chosen] for f in fields(part)))


def joined(*parts: Any) -> Any:
    """The rows of several values of one type, one after the other."""
    return type(parts[0])(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(parts[0])))


class ByValue(Value):
    """The parent of values that are equal by what they are made of, and may be keys.

    What was made by a call of the library is equal to what an equal call made; what was made by hand, by its fields. A
    function of the user's own, and what else cannot be looked into, is equal to itself alone. The parts are read once,
    when two values are first compared or one is first a key; 32 bytes of them are kept.
    """

    _aside: ClassVar[tuple[str, ...]] = ()
    """Fields that do not count."""

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return self._digest == other._digest  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return self._number

    @cached_property
    def _digest(self) -> bytes:
        """32 bytes that stand for the parts, in this process."""
        return blake2b(b"".join(_parts(self)), digest_size=32).digest()

    @cached_property
    def _number(self) -> int:
        return int.from_bytes(self._digest[:7], "big")


def _parts(value: ByValue) -> list[bytes]:
    recipe = vars(value).get("_recipe")
    if recipe is not None:
        return [_written(type(value)), _call(*recipe)]
    return [_written(type(value)), *_fields(value, value._aside)]


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
        return "value", value._digest
    if value is None or isinstance(value, bool | np.bool_ | str | bytes | Enum | PurePath):
        return type(value).__name__, repr(value).encode(errors="surrogatepass")
    if isinstance(value, Real | np.ndarray | list | tuple) and (numbers := _numbers(value)) is not None:
        return f"numbers {numbers.shape}", numbers.tobytes()
    if isinstance(value, list | tuple):
        return "list", b"".join(map(_written, value))
    if isinstance(value, Mapping):
        return "mapping", b"".join(_written(key) + _written(part) for key, part in value.items())
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
        array = np.asarray(value)
    except (ValueError, OverflowError):  # ragged
        return None
    return array.astype(float) + 0.0 if array.dtype.kind in "iuf" and array.size else None


def own_number(what: str, function: Callable[..., Any], *given: Any) -> float | None:
    """What the function gives, as a float; None where it says None.

    Raises:
        OwnFunctionError: it raises, or gives no single finite number.
    """
    try:
        answer = function(*given)
    except Exception as problem:  # a function of the user's may raise anything
        kind = type(problem).__name__
        raise OwnFunctionError(what, f"raises {kind}: {problem}", "see to it, or leave it out") from problem
    if answer is None:
        return None
    try:
        numbers = np.asarray(answer, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise OwnFunctionError(what, f"gives {answer!r}", "give one number, or None for none") from None
    if numbers.size != 1:
        raise OwnFunctionError(what, f"gives an array of shape {numbers.shape}", "give one number, or None for none")
    if not np.isfinite(numbers).all():
        raise OwnFunctionError(what, f"gives {float(numbers.ravel()[0])}", "give a finite number, or None for none")
    return float(numbers.ravel()[0])
