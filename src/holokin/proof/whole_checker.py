"""Verifies a certificate of a whole arm from its file alone. It shares no code with holokin; it needs python-flint.

    python whole_checker.py FILE

The file holds the arm as rational numbers, which joints are held, and the form of the other six. Here c_i and s_i are
the cosine and sine of joint i, and everything is a polynomial in them with c_i^2 + s_i^2 = 1.

Theorem. Say axes 4, 5, 6 meet in a point C, and axes 1 and 2 lie in a plane: h_1 x h_2 = sigma n and
(p_1 - a) x h_1 = -tau n with a on axis 2 and n fixed in the link between them. Turns about both keep
sigma |x - a|^2 / 2 - tau h_2 . (x - a) of a point x. So the place of C tells a sinusoid of joint 3, whose slope is
s_1 = (sigma (C - a) - tau h_2) . (h_3 x (C - p_3)); then one of joint 2, with the slope s_2 = n . (C - a); and the
rotation tells one of joint 5, with the slope s_3 = det [h_4, h_5, h_6]. A sinusoid takes a value at most twice in a
turn, with slopes of both signs: so pose and signs of s_1, s_2, s_3 tell these joints, and then the others are angles
about axes on which nothing lies while J is regular. Where det J = +- s_1 s_2 s_3, no sign changes while J is regular.
For three parallel axes 2, 3, 4 and axes 5, 6 that meet, likewise with the slopes of joints 1, 5 and 3.

What is verified: that the axes meet, or are parallel, at all postures; and that det J is the product.
"""

from __future__ import annotations

import json
import re
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import flint

FORMAT = "holokin whole-arm certificate 1"
MOST_BYTES, MOST_JOINTS, MOST_DIGITS, MOST_TERMS = 1_000_000, 12, 1000, 1000
"""Of a file, of its joints, of the digits of a number, of the terms of a polynomial: more take too long."""

RATIONAL = re.compile(rf"(-?[0-9]{{1,{MOST_DIGITS}}})(?:/([0-9]{{1,{MOST_DIGITS}}}))?")


class RejectedError(Exception):
    """What is wrong with a certificate."""


def text_of(value: object) -> str:
    """A word of the file, without what a terminal obeys."""
    return "".join(c if c.isprintable() else "?" for c in value[:100]) if isinstance(value, str) else "no text"


class Ring:
    """Polynomials in the cosine and sine, or the travel, of each joint."""

    def __init__(self, slides: list[bool]) -> None:
        names = [name for i, slide in enumerate(slides) for name in ([f"x{i}"] if slide else [f"c{i}", f"s{i}"])]
        self.context = flint.fmpq_mpoly_ctx.get(names, "degrevlex")
        generators = dict(zip(names, self.context.gens(), strict=True))
        self.motion: list[Any] = [
            (generators[f"x{i}"],) if slide else (generators[f"c{i}"], generators[f"s{i}"])
            for i, slide in enumerate(slides)
        ]
        self.circles = [(names.index(str(m[1])), 1 - m[0] * m[0]) for m in self.motion if len(m) == 2]

    def number(self, text: object) -> Any:
        """A rational number, written as "3/8"."""
        parts = RATIONAL.fullmatch(text) if isinstance(text, str) else None
        over = 1 if parts is None or parts[2] is None else int(parts[2])
        if parts is None or over == 0:
            raise RejectedError("a number is no short fraction of whole numbers")
        return self.context.constant(flint.fmpq(int(parts[1]), over))

    def reduced(self, p: Any) -> Any:
        """A polynomial with at most the first power of each sine. Raises: RejectedError: it is too long."""
        for place, square in self.circles:
            while len(p) <= MOST_TERMS and p.degrees()[place] > 1:
                terms = p.to_dict()
                high = {m: c for m, c in terms.items() if m[place] > 1}
                rest = self.context.from_dict({m: c for m, c in terms.items() if m[place] <= 1})
                lower = {tuple(e - 2 * (j == place) for j, e in enumerate(m)): c for m, c in high.items()}
                p = rest + self.context.from_dict(lower) * square
        if len(p) > MOST_TERMS:
            raise RejectedError(f"a polynomial of it has more than {MOST_TERMS} terms, which is too long to examine")
        return p


def dot(a: Any, b: Any) -> Any:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: list, b: list) -> list:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a: list, b: list, factor: Any = 1) -> list:
    """a + factor b."""
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def times(A: list, b: list) -> list:
    """A b of a matrix in rows."""
    return [dot(row, b) for row in A]


def product(A: list, B: list) -> list:
    """A B of matrices in rows."""
    columns = list(zip(*B, strict=True))
    return [[dot(row, column) for column in columns] for row in A]


def transposed(A: list) -> list:
    """A^T."""
    return [list(column) for column in zip(*A, strict=True)]


def determinant(columns: list, reduce: Any) -> Any:
    """Of a square matrix, by the minors of its first columns."""
    minors: dict[tuple[int, ...], Any] = {(): 1}
    for k, column in enumerate(columns):
        larger = {}
        for rows in combinations(range(len(columns)), k + 1):
            terms = [
                (-1) ** (k + i) * column[row] * minors[rows[:i] + rows[i + 1 :]]
                for i, row in enumerate(rows)
                if column[row] != 0
            ]
            larger[rows] = reduce(sum(terms)) if terms else 0
        minors = larger
    return minors[tuple(range(len(columns)))]


class Arm:
    """The links of a file: rotation, position and axis of each joint, which are held, in a ring."""

    def __init__(self, data: dict) -> None:
        links = data.get("links")
        if not isinstance(links, list) or not 6 <= len(links) <= MOST_JOINTS:
            raise RejectedError("the links are missing, or too many")
        if not all(isinstance(link, dict) and type(link.get("slides")) is bool for link in links):
            raise RejectedError("a link does not say whether it slides")
        self.slides = [link["slides"] for link in links]
        self.ring = Ring(self.slides)
        number = self.ring.number
        self.rotation, self.position, self.axis = [], [], []
        for i, link in enumerate(links):
            try:
                R = [[number(x) for x in row] for row in link["rotation"]]
                p, axis = [number(x) for x in link["position"]], [number(x) for x in link["axis"]]
            except (KeyError, TypeError):
                raise RejectedError(f"link {i} is incomplete") from None
            if [len(p), len(axis), len(R), *map(len, R)] != [3] * 6:
                raise RejectedError(f"link {i} has not three rows and columns")
            one = product(R, transposed(R))
            if any(one[r][c] != (r == c) for r in range(3) for c in range(3)) or dot(R[0], cross(R[1], R[2])) != 1:
                raise RejectedError(f"the rotation of link {i} is none")
            if dot(axis, axis) != 1:
                raise RejectedError(f"the axis of link {i} has not length 1")
            self.rotation.append(R)
            self.position.append(p)
            self.axis.append(axis)
        held = data.get("held")
        if not isinstance(held, list) or not all(type(k) is int and 0 <= k < len(links) for k in held):
            raise RejectedError("the held joints are missing")
        self.free = [i for i in range(len(links)) if i not in held]
        self.held = [i for i in range(len(links)) if i in held]
        if len(self.free) != 6 or any(self.slides[i] for i in self.free):
            raise RejectedError("what is left are not six hinges")

    def turn(self, i: int, back: bool = False) -> list:
        """The rotation of joint i by Rodrigues' formula."""
        c, s = self.ring.motion[i]
        x, y, z = self.axis[i]
        s = -s if back else s
        K = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        return [
            [c * int(r == k) + s * K[r][k] + (1 - c) * self.axis[i][r] * self.axis[i][k] for k in range(3)]
            for r in range(3)
        ]

    def screws(self) -> tuple[dict[int, tuple[list, list]], dict[int, tuple[list, list]]]:
        """(axes: direction and point; moving frames: rotation and origin) of all joints at any posture, seen from the
        link behind the third free joint."""
        reduce, middle = self.ring.reduced, self.free[2]
        clean = lambda v: [reduce(x) for x in v]  # noqa: E731
        one = [[self.ring.number(str(int(r == c))) for c in range(3)] for r in range(3)]
        axes, frames = {}, {}
        R, p = one, [self.ring.number("0")] * 3
        for i in range(middle, -1, -1):  # towards the base: R, p is the moving frame of joint i
            frames[i] = R, p
            axes[i] = clean(times(R, self.axis[i])), p
            if self.slides[i]:
                p = plus(p, times(R, self.axis[i]), -self.ring.motion[i][0])
            else:
                R = [clean(row) for row in product(R, self.turn(i, back=True))]
            R = [clean(row) for row in product(R, transposed(self.rotation[i]))]
            p = clean(plus(p, times(R, self.position[i]), -1))
        R, p = frames[middle]
        for i in range(middle + 1, len(self.axis)):  # towards the tool
            p = clean(plus(p, times(R, self.position[i])))
            R = [clean(row) for row in product(R, self.rotation[i])]
            axes[i] = clean(times(R, self.axis[i])), p
            if self.slides[i]:
                p = clean(plus(p, axes[i][0], self.ring.motion[i][0]))
            else:
                R = [clean(row) for row in product(R, self.turn(i))]
            frames[i] = R, p
        return axes, frames


def is_whole_arm(file: str) -> bool:
    """Whether a file says that it is a certificate of a whole arm. Raises: OSError, ValueError: it is none at all."""
    return Path(file).is_file() and Path(file).stat().st_size <= MOST_BYTES and _read(file)[1] == FORMAT


def _read(file: str) -> tuple[dict, object]:
    """(data, format) of a file."""
    try:
        if not Path(file).is_file() or Path(file).stat().st_size > MOST_BYTES:
            raise ValueError(f"not a file of at most {MOST_BYTES:,} bytes")
        data = json.loads(Path(file).read_text("utf-8"))
    except (RecursionError, MemoryError):
        raise ValueError("it is nested too deep") from None
    return (data, data.get("format")) if isinstance(data, dict) else ({}, None)


class Steps:
    """The three steps of an arm's inverse, in the form that its file names."""

    def __init__(self, data: dict) -> None:
        self.data, self.arm, form = data, Arm(data), data.get("form")
        if not isinstance(form, dict) or form.get("family") not in ("pair", "parallel"):
            raise RejectedError("the form is missing")
        if not all(type(form.get(key)) is bool for key in ("reversed", "inner")):
            raise RejectedError("the form does not say its direction")
        self.pair, self.inner = form["family"] == "pair", form["inner"]
        axes, self.frames = self.arm.screws()
        order = self.arm.free[::-1] if form["reversed"] else self.arm.free
        self.h, self.p = ([axes[i][part] for i in order] for part in (0, 1))
        self.reduce = self.arm.ring.reduced

    def clean(self, values: list) -> list:
        """A vector, reduced."""
        return [self.reduce(value) for value in values]

    def vanishes(self, what: str, values: list) -> None:
        """Raises: RejectedError: some of the values are not 0 at all postures."""
        if any(value != 0 for value in self.clean(values)):
            raise RejectedError(f"{what}, at some posture")

    def fixed(self, key: str) -> tuple[list, list]:
        """(a vector that is fixed in a link, seen from the middle; the origin of that link)."""
        given = self.data.get(key)
        given = given if isinstance(given, dict) else {}
        numbers, link = given.get("vector"), given.get("link")
        if not isinstance(numbers, list) or len(numbers) != 3 or type(link) is not int or link not in self.frames:
            raise RejectedError(f"{key!r} is missing")
        R, origin = self.frames[link]
        return self.clean(times(R, [self.arm.ring.number(x) for x in numbers])), origin

    def moves(self) -> list:
        """How each joint moves the point in which the last axes meet, which lies on all of them at all postures."""
        vector, origin = self.fixed("center")
        self.center = self.clean(plus(origin, vector))
        for k in range(3 if self.pair else 4, 6):
            across = cross(plus(self.center, self.p[k], -1), self.h[k])
            self.vanishes(f"axis {k + 1} of the steps misses the center", across)
        return [self.clean(cross(self.h[k], plus(self.center, self.p[k], -1))) for k in range(6)]

    def slopes_of_pair(self, moves: list) -> list:
        """s_1, s_2, s_3 where two axes lie in one plane."""
        first, second, single = (2, 1, 0) if self.inner else (0, 1, 2)
        h, p, reduce = self.h, self.p, self.reduce
        away, across = plus(p[first], p[second], -1), self.clean(cross(h[first], h[second]))
        if any(value != 0 for value in across):
            normal, _ = self.fixed("normal")
            square = reduce(dot(normal, normal))
            if square == 0:
                raise RejectedError("the normal is none")
            sigma = reduce(dot(across, normal) / square.leading_coefficient())
            tau = reduce(-dot(cross(away, h[first]), normal) / square.leading_coefficient())
        else:  # parallel: the plane, and so the normal, may depend on what is held between
            normal, sigma, tau = self.clean(cross(h[second], away)), 0, reduce(dot(h[first], h[second]))
        self.vanishes("the pair has another normal", plus(across, normal, -sigma))
        self.vanishes("the pair lies in no plane", plus(self.clean(cross(away, h[first])), normal, tau))
        arm = plus(self.center, p[second], -1)
        lever = self.clean(plus([sigma * x for x in arm], h[second], -tau))
        return [dot(lever, moves[single]), dot(normal, arm), dot(h[3], self.clean(cross(h[4], h[5])))]

    def slopes_of_parallel(self, moves: list) -> list:
        """s_1, s_2, s_3 where three axes are parallel, the same or opposite ways."""
        h, p = self.h, self.p
        for k in (2, 3):
            self.vanishes("axes 2, 3, 4 of the steps are not parallel", cross(h[1], h[k]))
        bend = self.clean(cross(plus(p[2], p[1], -1), plus(p[3], p[2], -1)))
        return [dot(h[1], moves[0]), dot(h[1], self.clean(cross(h[4], h[5]))), dot(h[1], bend)]

    def terms(self) -> int:
        """Those of det J, which is plus or minus the product of the slopes. Raises: RejectedError: it is not."""
        moves, h, reduce = self.moves(), self.h, self.reduce
        slopes = self.clean((self.slopes_of_pair if self.pair else self.slopes_of_parallel)(moves))
        if self.pair:  # the last three axes do not move the center
            det = reduce(determinant(moves[:3], reduce) * determinant(h[3:], reduce))
        else:
            det = determinant([[*move, *axis] for move, axis in zip(moves, h, strict=True)], reduce)
        if det == 0:
            raise RejectedError("every posture is singular")
        whole = reduce(reduce(slopes[0] * slopes[1]) * slopes[2])
        if reduce(det - whole) != 0 and reduce(det + whole) != 0:
            raise RejectedError("det J is not the product of the slopes")
        return len(det)


def check(file: str) -> tuple[list[str], dict]:
    """(what is verified, in sentences; the data). Raises: RejectedError; OSError, ValueError: it is no certificate."""
    data, written = _read(file)
    if written != FORMAT:
        raise ValueError(f"its format is not {FORMAT!r}")
    steps = Steps(data)
    terms, held, count = steps.terms(), steps.arm.held, len(steps.arm.axis)
    some = " and ".join(f"joint {i + 1}" for i in held)
    holding = f"with {some} of {count} joints held, at any value" if held else f"of its {count} joints none is held"
    kind = "three axes meet and two lie in one plane" if steps.pair else "three axes are parallel and two meet"
    return [
        f"on the whole arm, {holding}: when the tool comes back to a pose, and no posture on the way was singular, the "
        "joints are back, too, but for whole turns",
        f"{kind}, at all postures; det J, of {terms} terms, is the product of three slopes, whose signs tell postures "
        "apart",
    ], data


if __name__ == "__main__":
    try:
        print("VERIFIED:", *check(sys.argv[1])[0], sep="\n  ")
    except (RejectedError, OSError, ValueError, LookupError) as problem:
        print("REJECTED:" if isinstance(problem, RejectedError) else "not read:", problem)
        sys.exit(1 if isinstance(problem, RejectedError) else 2)
