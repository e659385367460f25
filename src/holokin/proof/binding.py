"""Whether the operations of a certificate are those of a robot: its task's rows f(q) - x, written down anew.

The rows of both are compared as expressions of the unknowns, the place u and the path's numbers: operation by
operation, constants by their doubles. Those of the constraint are not, nor are the path's numbers: they are in the
file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, combinations, product
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import HolokinError, brief
from ..motion.checks.clearance import FLOOR
from ..robot import Robot, with_capsules
from ..strategies.tasks.frame_task import FrameTask
from ..strategies.tasks.task import TipFrame
from ..symbolic import symbol, vertcat
from ..symbolic.interval_function import operation_list
from .clear_cells import convex, joints_of, shape_of
from .equation import Equation, Family, PoseBox, Stretch, Stretches, rows_of

# --- A list of operations in the few words that the checker knows: sums, products, reciprocals and nine functions.
#
# Every change is one of real numbers. A comparison is made of signs, which are no number where they are not known: the
# checker refuses what lies across a kink. A row that counts up to whole turns, a sum of angles, becomes the angle of
# the product of the complex numbers e^(i angle).


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

    def value(self, place: Place) -> float:
        """That of a constant; of all else 1/2, which is no whole number."""
        return list(self.constants)[place.at] if place.kind == "constant" else 0.5

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
        """A product; of a small whole number a sum, so that a multiple of an angle goes on by whole turns."""
        for factor, other in ((a, b), (b, a)):
            value = self.value(factor)
            if (value % 1 == 0 and 1 < abs(value) <= 16) or value == -1:
                total = other
                for _ in range(int(abs(value)) - 1):
                    total = self.do("add", total, other)
                return total if value > 0 else self.do("sub", self.number(0), total)
        return self.do("mul", a, b)

    def power(self, a: Place, b: Place) -> Place:
        """a^b: products for a small whole b, else exp(b log a)."""
        value = self.value(b)
        if value % 1 or abs(value) > 64:
            return self.do("exp", self.do("mul", b, self.do("log", a)))
        result, base, left = self.number(1), a, int(abs(value))
        while left:
            result = self.do("mul", result, base) if left % 2 else result
            base, left = (self.do("sq", base) if left > 1 else base), left // 2
        return self.do("inv", result) if value < 0 else result

    def angle(self, y: Place, x: Place) -> Place:
        """atan2(y, x)."""
        angle = self.do("atan2", y, x)
        self.angles[angle] = y, x
        return angle

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
            # arithmetic
            "assign": lambda x: x,
            "neg": lambda x: do("sub", zero, x),
            "twice": lambda x: do("add", x, x),
            "mul": self.times,
            "div": lambda x, y: do("mul", x, do("inv", y)),
            "pow": self.power,
            "constpow": self.power,
            # functions
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
            # signs, comparisons and truth values
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


def _lowered(
    operations: Sequence[Sequence[Any]], inputs: Sequence[int | float], angular: Sequence[bool]
) -> dict[str, Any]:
    """A list of `interval_function.operation_list` in words of the checker, as far as its first outputs need it.

    Args:
        inputs: of each of its inputs the place among those of the checker, a whole number, or what it is, a float.
        angular: of each of these outputs whether it counts up to whole turns.
    """
    # All operations in words of the checker.
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
    pairs = zip(results, angular, strict=False)
    results = [made.angle(*made.turned(place)) if angle else place for place, angle in pairs]
    # Those that the results need.
    rows, needed = list(made.rows), set(results)
    for i in reversed(range(len(rows))):
        if Place("operation", i) in needed:
            needed.update(rows[i][1:])
    # Their places: the inputs, the constants, the operations.
    count = 1 + max(i for i in inputs if isinstance(i, int))
    numbers: dict[Place, int] = {Place("input", i): i for i in range(count)}
    constants = [value for value, i in made.constants.items() if Place("constant", i) in needed]
    for value in constants:
        numbers[made.number(value)] = len(numbers)
    listed: list[list[Any]] = []
    for i, (name, *of) in enumerate(rows):
        if Place("operation", i) in needed:
            listed.append([name, *(numbers[place] for place in of)])
            numbers[Place("operation", i)] = len(numbers)
    return {"constants": constants, "operations": listed, "outputs": [numbers[place] for place in results]}


def lowered_equation(equation: Equation) -> dict[str, Any]:
    """E and `facing` of an equation in words of the checker, of q, u, the numbers of a piece and the level."""
    n, d = equation.n, equation.d
    level = n + equation.family.numbers - d
    # u = u0 + h y with u0 = 0 and h = 1
    inputs = [*range(level), *[0.0] * d, *[1.0] * d, *range(level, level + equation.strategy.constraint.rows)]
    return _lowered(equation.operations, inputs, [*equation.angular, *[False] * equation.positive])


# --- Whether the shapes of a certificate are those of a robot, and of which pairs of them it says nothing.

Body = tuple[str, int, bool]
"""A link or an obstacle: its name, the joint that moves it (-1: none), whether it is a half space."""

MOST_LETTERS = 400
"""Letters of a list of pairs or links, at most."""


def _other_shapes(clear: dict[str, Any], robot: Robot) -> str:
    """In what the shapes of links in a certificate are not those of a robot; "" where they are.

    Pairs may be left out, see `unsaid`, but not shapes of a link in a pair. Shapes of other names, which stand around
    the robot or which it carries, are the certificate's own.
    """
    own = _own(robot)
    if clear["joints"] != joints_of(robot):
        return f"its shapes hang on other joints than those of {robot.name}"
    # Every shape of a link is one of the robot's.
    links, texts = {name for name, _, _ in own}, [json.dumps(shape) for shape in clear["shapes"]]
    shapes: dict[Body, set[str]] = {body: set(of) for body, of in own.items()}
    for shape, text in zip(clear["shapes"], texts, strict=True):
        body, floor = _body(shape), bool(shape["normal"]) and shape["link"] == FLOOR
        if shape["link"] in links and not floor and text not in own.get(body, ()):
            return f"the shape of {shape['link']} is not that of {robot.name}"
        shapes.setdefault(body, set()).add(text)
    # Of two bodies all pairs of their shapes are held against each other.
    for bodies, tested in _tested(clear, texts).items():
        a, b = sorted(bodies) if len(bodies) == 2 else list(bodies) * 2
        if not {frozenset(pair) for pair in product(shapes[a], shapes[b])} <= tested:
            return f"of {a[0]} and {b[0]} some shapes are left out"
    return ""


def unsaid(data: dict[str, Any], robot: Robot) -> str:
    """In words what a certificate about shapes says nothing of, and which of them are no link's of the robot."""
    if "clear" not in data:
        return ""
    from .clear_checker import digest_of  # which needs python-flint

    # Links and what they carry, which move, and things that stand around.
    own, clear = _own(robot), data["clear"]
    tested, links = set(_tested(clear, [""] * len(clear["shapes"]))), {name for name, _, _ in own}
    carried = {body for body in map(_body, clear["shapes"]) if body[1] >= 0 and body[0] not in links}
    around = {body for body in map(_body, clear["shapes"]) if body[1] < 0 and (body[0] not in links or body[2])}
    things = {(s.link, s.joint, False) for s in robot.shapes if s.obstacle and not s.shape.fault} | around
    parts = sorted((set(own) - things) | carried)
    # Pairs of them that are not held against each other.
    moving = (of for of in combinations(parts, 2) if of[0][1] != of[1][1])
    pairs = chain(moving, (of for of in product(parts, sorted(things)) if of[0][1] >= 0))
    left, more = [], 0  # a stranger's file may have millions
    for pair in (of for of in map(frozenset, pairs) if of not in tested):
        if len(left) < MOST_LETTERS:
            left.append(" and ".join(sorted(name for name, _, _ in pair)))
        else:
            more += 1
    words = [f"\n  the shapes of its links are those of {robot.name}"]
    if mine := sorted(f"{s['link']} ({digest_of(s)})" for s in clear["shapes"] if _body(s) in carried):
        words.append(f"; its own is {brief(', '.join(mine), MOST_LETTERS)}")
    if left:
        words.append(f"\n  it says nothing of {len(left) + more} pairs: {brief('; '.join(left), MOST_LETTERS)}")
    if bare := sorted({s.link for s in robot.shapes if s.shape.fault}):
        words.append(f"\n  it says nothing of {brief(', '.join(bare), MOST_LETTERS)}, which cannot be read")
    return "".join(words)


def _own(robot: Robot) -> dict[Body, set[str]]:
    """The shapes of a robot as a certificate has them; of one without shapes those of `with_capsules`."""
    shapes: dict[Body, set[str]] = {}
    bare = all(shape.obstacle for shape in robot.shapes)
    for shape in (with_capsules(robot) if bare else robot).shapes:
        if not shape.shape.fault:
            shapes.setdefault((shape.link, shape.joint, False), set()).add(json.dumps(shape_of(convex(shape))))
    return shapes


def _body(shape: dict[str, Any]) -> Body:
    return shape["link"], shape["joint"], bool(shape["normal"])


def _tested(clear: dict[str, Any], texts: list[str]) -> dict[frozenset[Body], set[frozenset[str]]]:
    """Of each pair of bodies the pairs of their shapes that are held against each other."""
    tested: dict[frozenset[Body], set[frozenset[str]]] = {}
    for i, j in (pair["shapes"] for pair in clear["pairs"]):
        bodies = frozenset((_body(clear["shapes"][i]), _body(clear["shapes"][j])))
        tested.setdefault(bodies, set()).add(frozenset((texts[i], texts[j])))
    return tested


def described(equation: Equation) -> dict[str, Any] | None:
    """What of an equation is needed to write its task's rows down for a robot; None of several tools or frames."""
    task, family = equation.strategy.task, equation.family
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame) and task.frame.name is None):
        return None
    return {
        "orientation": task.orientation,
        "rows": list(task.rows),
        "reference": np.array(task.reference).tolist(),
        "axis": np.array(task.axis).tolist(),
        "turning": family.turning,
        "stretches": [[m.turning, m.curved] for m in family.members] if isinstance(family, Stretches) else None,
    }


def unlike(data: dict[str, Any], robot: Robot) -> str:
    """In what a certificate's data are not those of a robot; "" where its rows f(q) - x and limits are the robot's."""
    # The robot's task, over the family of the certificate.
    given = data.get("task")
    if given is None:
        return "it is about several tools, or a tool seen from another frame, of which no robot alone tells the rows"
    if [joint.unit for joint in robot.coordinates] != data["units"]:
        return f"{robot.name} has {robot.n} joints, and the certificate {len(data['units'])}, or of other kinds"
    reference, axis = np.array(given["reference"]), np.array(given["axis"])
    try:
        task = FrameTask(robot, given["orientation"], tuple(given["rows"]), reference, axis=axis)
    except HolokinError as problem:
        return f"{robot.name} has no such task: {problem}"
    family: Family = PoseBox(given["turning"])
    if given["stretches"] is not None:
        family = Stretches(given["turning"], tuple(Stretch(*kind) for kind in given["stretches"]))
    # Its rows in words of the checker, and those of the file.
    n, d, left = robot.n, family.dimension, family.numbers - 2 * family.dimension
    q, y, numbers = symbol("q", n), symbol("y", d), symbol("numbers", family.numbers)
    k = task.kinematics(q)
    rows, facing = rows_of(task, k.position, k.rotation, *family.pose(y, numbers))
    listed = operation_list({"q": q, "y": y, "numbers": numbers}, vertcat(rows, facing))
    inputs = [*range(n + d + left), *[0.0] * d, *[1.0] * d]
    built = _lowered(listed, inputs, [False] * (task.m + facing.shape[0]))
    unknowns, expressions = len(data["pieces"][0]["q"]), {}
    of_file = _numbered(data, (unknowns, d, left, len(data["level"])), expressions)
    if _numbered(built, (n, d, left, 0), expressions) != [*of_file[: task.m], *of_file[unknowns:]]:
        return f"its operations are not those of {robot.name}: other lengths, axes, tip, base or tool"
    # The limits, and the shapes.
    lower, _, _, upper = data["claims"]["joints"]
    for name, low, high, a, b in zip(robot.joint_names, robot.lower, robot.upper, lower, upper, strict=False):
        if (a is not None and a < low) or (b is not None and b > high):
            return f"its limits of {name} are wider than those of {robot.name}"
    return _other_shapes(data["clear"], robot) if "clear" in data else ""


def _numbered(data: dict[str, Any], sizes: tuple[int, ...], expressions: dict[Any, int]) -> list[int]:
    """Numbers of the outputs of a list of operations: the same number in a table is the same expression."""

    def number(expression: tuple[Any, ...]) -> int:
        return expressions.setdefault(expression, len(expressions))

    numbers = [number((kind, i)) for kind, size in zip("qunc", sizes, strict=True) for i in range(size)]
    numbers += [number(("constant", float(value))) for value in data["constants"]]
    for name, *of in data["operations"]:
        numbers.append(number((name, *(numbers[i] for i in of))))
    return [numbers[i] for i in data["outputs"]]
