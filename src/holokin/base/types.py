"""Array aliases, checks of numbers, and what all values of the library have in common.

Units are SI and radians; twist rows are linear first, in the base frame. The shapes stand in the names' docstrings,
since NumPy's types do not carry them: `Vector` is (k,), `Matrix` is (rows, columns), `Array` is any shape. A batch axis
comes first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import wraps
from typing import Any, ClassVar, Concatenate, NoReturn, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import AmbiguousTruthError, ArgumentError, NotFiniteError, ShapeError
from .shown import Shown

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
    found = number(what, value)
    if not 0 < found < np.inf:
        raise ArgumentError(what, found, cure)
    return _below_huge(what, found)


def not_negative(what: str, value: Any) -> float:
    """A finite number, 0 or above. Raises: ArgumentError."""
    found = number(what, value)
    if not 0 <= found < np.inf:
        raise ArgumentError(what, found, "give a finite number that is not negative")
    return _below_huge(what, found)


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
        and all(isinstance(n, str) or n == found for n, found in zip(shape, array.shape, strict=True))
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
    said = f"R R^T is {gap:.2g} away from 1, {ROTATION:g} is allowed: give a right-handed rotation matrix"
    rounded = ", with all its digits; of a rounded one Rotation.from_matrix(R).as_matrix() of SciPy is the nearest"
    return said + (rounded if gap < ROUNDED else "")


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
Result = TypeVar("Result")
More = ParamSpec("More")


def kept(build: Callable[Concatenate[Noun, More], Result]) -> Callable[Concatenate[Noun, More], Result]:
    """`cached_property` for a function: what it builds of an object and of plain arguments is kept in the object.

    It lives as long as the object, and is neither pickled nor copied with a `Value`.
    """

    @wraps(build)
    def called(noun: Noun, *more: More.args, **named: More.kwargs) -> Result:
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
        for field in fields(self):  # type: ignore[arg-type]  children are dataclasses
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                object.__setattr__(self, field.name, frozen(value))

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, frozen(value) if isinstance(value, np.ndarray) else value)


class NoTruthValue(Shown):
    """The parent of results and statuses that may say no: `bool` of one raises `AmbiguousTruthError`.

    `ask` says what to ask instead.
    """

    ask: ClassVar[str]

    def __init_subclass__(cls, ask: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        if ask:
            cls.ask = ask

    def __bool__(self) -> NoReturn:
        raise AmbiguousTruthError(type(self).__name__, self.ask)


def some(part: Any, chosen: Any) -> Any:
    """Some of the rows of a value whose fields are arrays of a row each."""
    return type(part)(*(getattr(part, f.name)[chosen] for f in fields(part)))


def joined(*parts: Any) -> Any:
    """The rows of several values of one type, one after the other."""
    return type(parts[0])(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(parts[0])))
