"""Checks of arguments by the kinds that a signature names, and values that are pickled as the call that made them."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache, wraps
from inspect import Parameter, isfunction, signature
from pathlib import Path
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from .errors import ArgumentError, CallError, ExportError, UnknownNameError, brief
from .types import Array, Flags, Shown, Value, Vector, frozen, number

AGAIN = "pickle what you made it from, and make it again"

F = TypeVar("F", bound=Callable[..., Any])


def typed(function: F) -> F:
    """A function whose arguments must be of the kinds that its signature names.

    Arrays are left to the function, which knows their shapes. Of a class these are the arguments that make one. Raises
    (when called): ArgumentError; CallError: there are too many, too few, or some of other names.
    """
    if isinstance(function, type):
        function.__init__ = typed(function.__init__)
        return function  # type: ignore[return-value]
    known = list(signature(function).parameters.values())
    names = [p.name for p in known if p.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.POSITIONAL_ONLY)]
    rest = next((p.name for p in known if p.kind is Parameter.VAR_POSITIONAL), "")
    prepared: tuple[dict[str, Any], dict[str, Test], list[tuple[str, Test | None]]] | None = None

    def prepare() -> tuple[dict[str, Any], dict[str, Test], list[tuple[str, Test | None]]]:
        arguments = {name: kind for name, kind in function.__annotations__.items() if name != "return"}
        wanted = get_type_hints(SimpleNamespace(__annotations__=arguments), function.__globals__)
        tests = {name: test for name, kind in wanted.items() if (test := _test(kind)) is not None}
        return wanted, tests, [(name, tests.get(name)) for name in names]

    @wraps(function)
    def called(*arguments: Any, **named: Any) -> Any:
        nonlocal prepared
        # The kinds that the signature names, found when first called: modules are complete then.
        if prepared is None:
            prepared = prepare()
        wanted, tests, in_order = prepared
        # Each argument is of its kind, or the error names another one that takes it.
        for value, (name, test) in zip(arguments, in_order, strict=False):
            if test is not None and not test(value):
                others = [other for other, takes in tests.items() if isinstance(value, Shown) and takes(value)]
                check(name, wanted[name], value, f"; {others[0]}= takes it" if others else "")
        if rest in tests:
            for value in arguments[len(names) :]:
                check(rest, wanted[rest], value)
        for name, value in named.items():
            if name in tests and not tests[name](value):
                check(name, wanted[name], value)
        # The call itself; a TypeError of how it was called says how to call it.
        try:
            return function(*arguments, **named)
        except TypeError as problem:
            if isinstance(problem, CallError) or _bound(function, arguments, named):
                raise
            missing = {name: kind for name, kind in list(wanted.items())[len(arguments) :] if name not in named}
            raise CallError(
                str(problem), f"call it as {_form(function, wanted, named) + _made_as(function, missing)}"
            ) from None

    return called  # type: ignore[return-value]


def _bound(function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> bool:
    """Whether a function takes these arguments, whatever they are."""
    try:
        signature(function).bind(*arguments, **named)
    except TypeError:
        return False
    return True


def _form(function: Callable[..., Any], kinds: Mapping[str, Any], named: Mapping[str, Any]) -> str:
    """How a function is called: its name, its arguments, and what they are by default.

    Where a noun among the arguments has what was given by name, as `hk.Scene` has obstacles, it is written out.
    """
    marks, parts = {Parameter.VAR_POSITIONAL: "*", Parameter.VAR_KEYWORD: "**"}, []
    known = signature(function).parameters
    given = {name: value for name, value in named.items() if name not in known}
    for name, parameter in known.items():
        value = "..." if parameter.kind is Parameter.KEYWORD_ONLY else ""
        if parameter.default is not Parameter.empty:
            value = "..." if callable(parameter.default) else brief(repr(parameter.default), 40)
        kind = kinds.get(name)
        value = next((form for noun in (kind, *get_args(kind)) if (form := _noun(noun, given))), value)
        if name != "self":
            parts.append(f"{marks.get(parameter.kind, '')}{name}{'=' * bool(value)}{value}")
    return f"{function.__qualname__.removesuffix('.__init__')}({', '.join(parts)})"


def _noun(kind: Any, given: Mapping[str, Any]) -> str:
    """How a noun is made with those of the arguments given that its class takes; empty where it takes none."""
    takes = getattr(kind, "__dataclass_fields__", {}) if hasattr(getattr(kind, "__init__", None), "__wrapped__") else {}
    fields = [f"{name}={'[...]' if _is_sequence(v) else '...'}" for name, v in given.items() if name in takes]
    return f"hk.{kind.__name__}({', '.join(fields)})" if fields else ""


def _made_as(function: Callable[..., Any], missing: Mapping[str, Any]) -> str:
    """What makes the arguments that a call lacks and must have, as far as that is known."""
    words = ""
    for name, kind in missing.items():
        makers = [MAKERS[k.__name__] for k in (kind, *get_args(kind)) if getattr(k, "__name__", "") in MAKERS]
        parameter = signature(function).parameters[name]
        may_be_left_out = parameter.default is not None or parameter.kind is Parameter.KEYWORD_ONLY
        if makers and (parameter.default is Parameter.empty or not may_be_left_out):
            words += f", {name} as {' or '.join(makers)} makes it"
    return words


def type_methods(kind: type) -> None:
    """Makes all public methods that a class defines `typed`: for the parents of families, in `__init_subclass__`."""
    for name, method in list(vars(kind).items()):
        if isfunction(method) and not name.startswith("_"):
            setattr(kind, name, typed(method))


def check(what: str, kind: Any, value: Any, more: str = "") -> None:
    """Raises: ArgumentError unless a value is of a kind, as annotations name them; its cure ends with `more`."""
    test = _test(kind)
    if test is not None and not test(value):
        if hasattr(kind, "cure"):  # a kind of ours that says how to make one
            raise ArgumentError(what, value, kind.cure)
        raise ArgumentError(what, value, f"give {_words(kind)}{_advice(test, kind, value)}{more}")


MAKERS = {
    "Robot": "hk.load(name)",
    "Task": "hk.pose(robot)",
    "Constraint": "hk.lock(joint)",
    "Strategy": "hk.holonomic(task, constraint)",
    "Path": "hk.circle(start, center)",
    "Region": "hk.around(q, 0.2)",
    "Workspace": "hk.workspace(box=(center, half))",
    "Trajectory": "hk.follow(strategy, path, q0)",
    "TimedTrajectory": "hk.retime(trajectory, acceleration=5.0)",
    "InverseKinematics": "hk.ik(strategy, q0)",
}
"""The kinds that callers mix up -> a call that makes one."""


def _advice(test: Test, kind: Any, value: Any) -> str:
    """How to make of a value what is wanted, as far as that shows."""
    if isinstance(value, str | Path) and "\0" in str(value):
        return " without a NUL character"
    made_of = getattr(value, "__annotations__", {}).get("return") if isfunction(value) else None
    if made_of and made_of in [getattr(k, "__name__", None) for k in (kind, *get_args(kind))]:
        return f": call the function, {value.__name__}(...)"  # type: ignore[union-attr]
    for name in ("robot", "task", "strategy"):
        if (part := getattr(value, name, None)) is not None and test(part):
            return f": its .{name} is one"
    name = getattr(kind, "__name__", "")
    if name == "Strategy" and getattr(value, "m", None) == getattr(value, "n", 0):
        return ", as hk.moore_penrose(task) makes it: nothing is redundant here"
    maker = MAKERS.get(name)
    return f", as {maker} makes it" if maker else ""


Test = Callable[[Any], bool]


@cache
def _test(kind: Any) -> Test | None:
    """Whether a value is of a kind; None where every value is, or where others look. Made once: it runs in loops."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind in (Any, object) or origin is np.ndarray:
        return None
    if origin in (Union, UnionType):
        return _any_of(inner)
    if kind in (None, NoneType):
        return lambda value: value is None
    if kind is bool:
        return lambda value: isinstance(value, bool | np.bool_)
    if kind is int:
        return lambda value: isinstance(value, int | np.integer) and not isinstance(value, bool) and _writable(value)
    if kind is float:
        return _is_number
    if kind is Callable or origin is _CALLABLE:
        return _takes(len(inner[0])) if inner and isinstance(inner[0], list) else callable
    if origin is Literal:
        return lambda value: isinstance(value, str)
    if origin in (tuple, _SEQUENCE):
        return lambda value: _is_sequence(value) and _each(inner, list(value))
    if origin is _MAPPING:  # values have better messages
        key = _test(inner[0]) or _anything
        return lambda value: isinstance(value, Mapping) and all(map(key, value))
    if origin is dict:
        return lambda value: isinstance(value, dict)
    if kind in (str, Path):
        return lambda value: isinstance(value, kind) and "\0" not in str(value)
    return (lambda value: isinstance(value, kind)) if isinstance(kind, type) else None


def _any_of(kinds: tuple[Any, ...]) -> Test | None:
    tests = [_test(kind) for kind in kinds]
    known = [test for test in tests if test is not None]
    functions = [test for kind, test in zip(kinds, tests, strict=True) if test and get_origin(kind) is _CALLABLE]

    def test(value: Any) -> bool:
        if len(known) < len(tests) and not callable(value):  # an array, at which others look
            return True
        for fits in known:  # noqa: SIM110  a generator costs as much as the tests
            if fits(value):
                return True
        return False

    return test if len(known) == len(tests) or functions else None


def _anything(_value: Any) -> bool:
    return True


def _is_sequence(value: Any) -> bool:
    return isinstance(value, list | tuple | range) or (isinstance(value, np.ndarray) and value.ndim == 1)


_CALLABLE, _SEQUENCE = get_origin(Callable[..., Any]), get_origin(Sequence[Any])
_MAPPING = get_origin(Mapping[Any, Any])


def _each(kinds: tuple[Any, ...], values: list[Any]) -> bool:
    if len(kinds) == 1 or kinds[-1] is Ellipsis:
        return all(map(_test(kinds[0]) or _anything, values))
    tests = [_test(kind) or _anything for kind in kinds]
    return len(values) == len(kinds) and all(test(value) for test, value in zip(tests, values, strict=True))


def _takes(count: int) -> Test:
    """Whether a value can be called with so many arguments, as far as it says what it takes."""

    def test(value: Any) -> bool:
        if not callable(value):
            return False
        try:
            known = signature(value)
        except (TypeError, ValueError):  # compiled code need not say
            return True
        try:
            known.bind(*range(count))
        except TypeError:
            return False
        return True

    return test


def _is_number(value: Any) -> bool:
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        return False
    return not isinstance(value, int) or _writable(value)


def _writable(value: Any) -> bool:
    """Whether a whole number is a float's, and short enough that Python writes it down."""
    return abs(value) < 10**300


_WORDS = {NoneType: "None", bool: "True or False", int: "a whole number", float: "a number", str: "text"}


def _words(kind: Any) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_words(k) for k in inner))
    if origin in (tuple, _SEQUENCE):
        if inner[:1] in ((), (Any,)) and inner[1:] in ((), (Ellipsis,)):
            return "a list"
        alike = len(inner) < 2 or inner[-1] is Ellipsis
        return f"a list of {_words(next(iter(inner), Any))} each" if alike else f"a list of {len(inner)}"
    if origin is Literal:
        return " or ".join(map(repr, inner))
    if origin is np.ndarray:
        return "an array"
    if kind is None or kind in _WORDS:
        return _WORDS[kind or NoneType]
    if kind is Callable or origin is _CALLABLE:
        count = len(inner[0]) if inner and isinstance(inner[0], list) else None
        return "a function" + {None: "", 1: " of one argument"}.get(count, f" of {count} arguments")
    if origin is _MAPPING:
        return "a mapping of names"
    name = getattr(kind, "__name__", str(kind))
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


class Made:
    """The parent of values that hold functions: pickled as the call that made them, see `made`; copied as themselves.

    One that was made with a function of the user's own, or by hand, cannot be pickled and says so.
    """

    def __copy__(self) -> Any:
        return self

    def __deepcopy__(self, _memo: Any) -> Any:
        return self

    def __reduce__(self) -> Any:
        recipe = self.__dict__.get("_recipe")
        what = f"{type(self).__name__} {getattr(self, 'name', '')!r}"
        if recipe is None:
            raise ExportError(
                f"{what} cannot be pickled: " + brief("it was not made by a function of holokin alone"), AGAIN
            )
        try:
            pickle.dumps(recipe)
        except ExportError:
            raise
        except (pickle.PicklingError, AttributeError, TypeError) as problem:
            raise ExportError(
                f"{what} cannot be pickled: " + brief(f"it was made with what cannot be pickled ({problem})"), AGAIN
            ) from problem
        return _remade, recipe


def made(function: F) -> F:
    """`typed`, for a function that makes a `Made`: the value remembers the call."""
    inner = typed(function)

    @wraps(function)
    def called(*arguments: Any, **named: Any) -> Any:
        value = inner(*arguments, **named)
        recipe_arguments = tuple(map(_snapshot, arguments)), {name: _snapshot(v) for name, v in named.items()}
        vars(value)["_recipe"] = (called, *recipe_arguments)
        return value

    return called  # type: ignore[return-value]


def _snapshot(value: Any) -> Any:
    """An argument as it is now, whatever the caller makes of it later."""
    return frozen(value) if isinstance(value, np.ndarray) else deepcopy(value) if isinstance(value, list) else value


def _remade(function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    return function(*arguments, **named)


# --- How axes count joints: an axis may turn the other way round, begin elsewhere, or have a unit of its own.


def check_counts(signs: Mapping[str, int], offsets: Mapping[str, float], scales: Mapping[str, float]) -> None:
    """Raises: ArgumentError: a sign that is not 1 or -1, an offset that is not finite, a scale that is not positive."""
    for what, given in (("signs", signs), ("offsets", offsets), ("scales", scales)):
        check(what, Mapping[str, float], given)
        for name, value in given.items():
            sound = np.isfinite(number(f"{what}[{name!r}]", value))
            if not sound or (what == "signs" and value not in (-1, 1)) or (what == "scales" and not value > 0):
                cure = {"signs": "give 1 or -1", "scales": "give a positive number"}.get(what, "give a finite number")
                raise ArgumentError(f"{what}[{name!r}]", value, cure)


@dataclass(frozen=True, eq=False)
class AxisCounts(Value):
    """How the axes of a file count joints: scale * value = sign * joint + offset [rad or m], as in `export.Wiring`.

    Attributes:
        signs: -1 for the joints that the file counts the other way round, by name.
        offsets: the file's value, in rad or m, where the joint is at 0, by name.
        scales: rad or m of one unit of the file, by name, as 2 pi / 4096 of an encoder; other joints are in rad, or in
            degrees, and m.
    """

    signs: Mapping[str, int] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_counts(self.signs, self.offsets, self.scales)

    def known(self, names: Sequence[str]) -> AxisCounts:
        """The same, of a robot with these joints. Raises: UnknownNameError."""
        for name in (*self.signs, *self.offsets, *self.scales):
            if name not in names:
                raise UnknownNameError("joint of signs, offsets or scales", name, names)
        return self

    def scaled(self, names: Sequence[str]) -> Flags:
        """Joints with a scale of their own (n,)."""
        return np.array([name in self.scales for name in names], dtype=bool)

    def joints(self, names: Sequence[str], values: Array, turn: Vector) -> Array:
        """Joints (..., n) [rad or m] of a file's values; turn (n,): rad of its unit, where there is no scale."""
        scale, sign, offset = self._numbers(names, turn)
        return sign * (scale * values - offset)

    def values(self, names: Sequence[str], joints: Array, turn: Vector) -> Array:
        """The file's values (..., n) of joints."""
        scale, sign, offset = self._numbers(names, turn)
        return (sign * joints + offset) / scale

    def _numbers(self, names: Sequence[str], turn: Vector) -> tuple[Vector, Vector, Vector]:
        scale = np.array([self.scales.get(name, rad) for name, rad in zip(names, turn, strict=True)])
        sign, offset = ([of.get(name, none) for name in names] for of, none in ((self.signs, 1), (self.offsets, 0.0)))
        return scale, np.array(sign, dtype=float), np.array(offset, dtype=float)
