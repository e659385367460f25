"""A list of operations in the few words that the checker knows: sums, products, reciprocals and nine functions.

Every change is one of real numbers. A comparison is made of signs, which are no number where they are not known: the
checker refuses what lies across a kink. A row that counts up to whole turns, a sum of angles, becomes the angle of the
product of the complex numbers e^(i angle).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

POWERS = 64
"""Whole exponents up to this are products."""

MULTIPLES = 16
"""Whole multiples up to this are sums, so that a multiple of an angle goes on by whole turns."""


class Place(NamedTuple):
    """Where a value is: number `at` of the inputs, of the constants, or of the operations."""

    kind: str
    at: int


class Lowered:
    """Operations that are made one by one, each once."""

    def __init__(self) -> None:
        self.constants: dict[float, int] = {}
        self.rows: dict[tuple[Any, ...], int] = {}
        self.truths: set[Place] = set()
        self.angles: dict[Place, tuple[Place, Place]] = {}

    def number(self, value: float) -> Place:
        """A constant."""
        return Place("constant", self.constants.setdefault(float(value), len(self.constants)))

    def do(self, name: str, *of: Place) -> Place:
        """An operation of the checker."""
        zero, one = self.number(0), self.number(1)
        if name in ("add", "sub") and of[1] == zero:
            return of[0]
        if name == "add" and of[0] == zero:
            return of[1]
        if name == "mul" and one in of:
            return of[of[0] == one]
        return Place("operation", self.rows.setdefault((name, *of), len(self.rows)))

    def times(self, a: Place, b: Place) -> Place:
        """A product; of a small whole number a sum."""
        values = {place: value for value, place in self.constants.items()}
        for factor, other in ((a, b), (b, a)):
            value = values.get(factor.at, 0.5) if factor.kind == "constant" else 0.5
            if (value % 1 == 0 and 1 < abs(value) <= MULTIPLES) or value == -1:
                found = other
                for _ in range(int(abs(value)) - 1):
                    found = self.do("add", found, other)
                return found if value > 0 else self.do("sub", self.number(0), found)
        return self.do("mul", a, b)

    def power(self, a: Place, b: Place) -> Place:
        """a^b: products for a small whole b, else exp(b log a)."""
        values = {place: value for value, place in self.constants.items()}
        value = values.get(b.at, 0.5) if b.kind == "constant" else 0.5
        if value % 1 or abs(value) > POWERS:
            return self.do("exp", self.do("mul", b, self.do("log", a)))
        found, base, left = self.number(1), a, int(abs(value))
        while left:
            found = self.do("mul", found, base) if left % 2 else found
            base, left = (self.do("sq", base) if left > 1 else base), left // 2
        return self.do("inv", found) if value < 0 else found

    def angle(self, y: Place, x: Place) -> Place:
        """atan2(y, x)."""
        found = self.do("atan2", y, x)
        self.angles[found] = y, x
        return found

    def turned(self, a: Place) -> tuple[Place, Place]:
        """(y, x), whose angle is a but for whole turns."""
        name, *of = list(self.rows)[a.at] if a.kind == "operation" else ("", a)
        if a in self.angles:
            return self.angles[a]
        if name not in ("add", "sub"):
            return self.do("sin", a), self.do("cos", a)
        (b, a), (d, c) = self.turned(of[0]), self.turned(of[1])
        signs = ("add", "sub") if name == "add" else ("sub", "add")
        y = self.do(signs[0], self.do("mul", b, c), self.do("mul", a, d))
        return y, self.do(signs[1], self.do("mul", a, c), self.do("mul", b, d))

    def truth(self, a: Place) -> Place:
        """1 where a is not 0, else 0."""
        return a if a in self.truths else self.is_true(self.do("sq", self.do("sign", a)))

    def is_true(self, a: Place) -> Place:
        """A value that is 0 or 1."""
        self.truths.add(a)
        return a

    def less(self, a: Place, b: Place) -> Place:
        """1 where a < b, 0 where a > b."""
        half = self.number(0.5)
        return self.is_true(self.do("add", half, self.do("mul", half, self.do("sign", self.do("sub", b, a)))))

    def choice(self, c: Place, a: Place, b: Place) -> Place:
        """a where c is true, else b."""
        return self.do("add", self.do("mul", c, a), self.do("mul", self.do("sub", self.number(1), c), b))

    def of(self, name: str, *a: Place) -> Place:
        """An operation of CasADi, by its name; one that is not known stays as it is, and the checker refuses it."""
        do, one, zero, half = self.do, self.number(1), self.number(0), self.number(0.5)

        def root(low: Place, high: Place) -> Place:
            return do("sqrt", do("mul", low, high))

        def exponentials(x: Place) -> tuple[Place, Place]:
            return do("exp", x), do("exp", do("sub", zero, x))

        rules: Mapping[str, Callable[..., Place]] = {
            "assign": lambda x: x,
            "neg": lambda x: do("sub", zero, x),
            "twice": lambda x: do("add", x, x),
            "mul": self.times,
            "div": lambda x, y: do("mul", x, do("inv", y)),
            "pow": self.power,
            "constpow": self.power,
            "tan": lambda x: do("mul", do("sin", x), do("inv", do("cos", x))),
            "atan2": self.angle,
            "asin": lambda x: do("atan", do("mul", x, do("inv", root(do("sub", one, x), do("add", one, x))))),
            "acos": lambda x: self.angle(root(do("sub", one, x), do("add", one, x)), x),
            "sinh": lambda x: do("mul", half, do("sub", *exponentials(x))),
            "cosh": lambda x: do("mul", half, do("add", *exponentials(x))),
            "tanh": lambda x: do(
                "sub", one, do("mul", self.number(2), do("inv", do("add", do("exp", do("add", x, x)), one)))
            ),
            "asinh": lambda x: do("log", do("add", x, do("sqrt", do("add", do("sq", x), one)))),
            "acosh": lambda x: do("log", do("add", x, root(do("sub", x, one), do("add", x, one)))),
            "atanh": lambda x: do("mul", half, do("log", do("mul", do("add", one, x), do("inv", do("sub", one, x))))),
            "expm1": lambda x: do("sub", do("exp", x), one),
            "log1p": lambda x: do("log", do("add", one, x)),
            "hypot": lambda x, y: do("sqrt", do("add", do("sq", x), do("sq", y))),
            "fabs": lambda x: do("mul", x, do("sign", x)),
            "copysign": lambda x, y: do("mul", do("mul", x, do("sign", x)), do("sign", y)),
            "fmin": lambda x, y: self.choice(self.less(x, y), x, y),
            "fmax": lambda x, y: self.choice(self.less(x, y), y, x),
            "lt": self.less,
            "le": self.less,
            "ne": lambda x, y: self.truth(do("sub", x, y)),
            "eq": lambda x, y: self.is_true(do("sub", one, self.truth(do("sub", x, y)))),
            "not": lambda x: self.is_true(do("sub", one, self.truth(x))),
            "and": lambda x, y: self.is_true(do("mul", self.truth(x), self.truth(y))),
            "or": lambda x, y: self.choice(self.truth(x), one, self.truth(y)),
            "if_else_zero": lambda c, x: do("mul", self.truth(c), x),
        }
        return rules[name](*a) if name in rules else do(name, *a)


def lowered(
    operations: Sequence[Sequence[Any]], inputs: Sequence[int | float], angular: Sequence[bool]
) -> dict[str, Any]:
    """A list of `interval_function.operation_list` in words of the checker, as far as its first outputs need it.

    Args:
        inputs: of each of its inputs the place among those of the checker, a whole number, or what it is, a float.
        angular: of each of these outputs whether it counts up to whole turns.
    """
    made = Lowered()
    places: list[Place] = []
    results: list[Place] = []
    for name, *of in operations:
        if name == "output":
            results.append(places[of[0]])
        elif name == "const":
            places.append(made.number(of[0]))
        elif name == "input":
            given = inputs[of[0]]
            places.append(Place("input", given) if isinstance(given, int) else made.number(given))
        else:
            places.append(made.of(name, *(places[i] for i in of)))
    results = [
        made.angle(*made.turned(place)) if angle else place for place, angle in zip(results, angular, strict=False)
    ]
    rows, needed = list(made.rows), set[Place](results)
    for at in reversed(range(len(rows))):
        if Place("operation", at) in needed:
            needed.update(rows[at][1:])
    first = 1 + max(i for i in inputs if isinstance(i, int))
    kept: dict[Place, int] = {Place("input", i): i for i in range(first)}
    constants = [value for value, at in made.constants.items() if Place("constant", at) in needed]
    for value in constants:
        kept[made.number(value)] = len(kept)
    found: list[list[Any]] = []
    for at, (name, *of) in enumerate(rows):
        if Place("operation", at) in needed:
            found.append([name, *(kept[place] for place in of)])
            kept[Place("operation", at)] = len(kept)
    return {"constants": constants, "operations": found, "outputs": [kept[place] for place in results]}
