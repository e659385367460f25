"""Something bad in place of something good."""

from __future__ import annotations

import datetime
import decimal
import fractions
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk

from .nouns import kit, raises


def _looped() -> list[Any]:
    loop: list[Any] = []
    loop.append(loop)
    return loop


def _nonsense(rng: random.Random) -> Any:
    """A callable that answers with something bad."""
    value = _bad(rng, callables=False)
    return lambda *_: value


BAD: list[Callable[[], Any]] = [
    lambda: None, lambda: "", lambda: "abc", lambda: "3", lambda: b"x", lambda: "a\0b", lambda: "q" * 10_000,
    lambda: ["a", "b", "c"], lambda: ["1", "2", "3"], lambda: [1, [2, 3]], lambda: [[1, 2], [3]], lambda: [None] * 3,
    lambda: float("nan"), lambda: float("inf"), lambda: -float("inf"), lambda: [float("nan")] * 3,
    lambda: [float("inf")] * 3, lambda: 1j, lambda: [1j, 0, 0], lambda: np.array([1j, 0, 0]), lambda: True,
    lambda: False, lambda: 10**400, lambda: -(10**400), lambda: [10**400] * 3, lambda: 10**5000, lambda: 2**63,
    lambda: 2**40, lambda: -1, lambda: 0, lambda: 3, lambda: 0.5, lambda: -0.5, lambda: 2.0, lambda: [0.5],
    lambda: [0, 0.5], lambda: (1.5, 0), lambda: [-1], lambda: [7], lambda: [0, 0], lambda: 1e308, lambda: -1e308,
    lambda: 1e-320, lambda: [1e308] * 3, lambda: [1e200] * 3, list, lambda: (), dict, lambda: {"a": 1},
    lambda: {1, 2}, lambda: np.zeros(0), lambda: np.zeros(1), lambda: np.zeros(3), lambda: np.zeros((3, 3)),
    lambda: np.zeros((0, 3)), lambda: np.zeros((4, 4)), lambda: np.zeros((2, 2, 2)), lambda: np.full(3, None),
    lambda: np.array([1, "a", None], object), lambda: np.array(1.0), lambda: np.array(1), lambda: np.array("x"),
    lambda: np.array(["a", "b", "c"]), lambda: np.array([10**400] * 3, object), lambda: np.float64(0.5),
    lambda: np.int8(-1), lambda: np.bool_(True), lambda: np.datetime64("2020-01-01"), lambda: np.zeros(3, "i4,f8"),
    lambda: (i for i in range(3)), lambda: range(3), lambda: slice(None), lambda: object(),
    lambda: Ellipsis, lambda: NotImplemented, lambda: datetime.date(2020, 1, 1), lambda: fractions.Fraction(1, 3),
    lambda: decimal.Decimal("0.1"), lambda: decimal.Decimal("sNaN"), lambda: Path("no"), lambda: Path(),
    lambda: bytearray(b"abc"), lambda: memoryview(b"abc"), lambda: np.ma.masked, _looped, lambda: raises,
    lambda: (lambda *_: None), lambda: (lambda: 0), lambda: hk, lambda: Exception("x"),
]  # fmt: skip
"""Makers of values, fresh each time."""


def _bad(rng: random.Random, *, callables: bool = True) -> Any:
    kind = rng.random()
    if kind < 0.12:
        return rng.choice([v for key, v in kit().items() if key not in ("q", "Q", "start", "pose", "weight")])
    if kind < 0.2 and callables:
        return _nonsense(rng)
    return rng.choice(BAD)()


def spoilt(rng: random.Random, good: Any) -> Any:
    """Something bad in place of a good value; of one that has parts, sometimes in place of one of them."""
    if rng.random() < 0.3 and isinstance(good, list | tuple | dict | np.ndarray) and len(good):
        if isinstance(good, dict):
            return {**good, rng.choice(list(good)): _bad(rng)}
        parts = list(good)
        i = rng.randrange(len(parts))
        parts[i] = spoilt(rng, parts[i])
        return tuple(parts) if isinstance(good, tuple) else parts
    return _nonsense(rng) if callable(good) and rng.random() < 0.5 else _bad(rng)
