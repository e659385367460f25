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
import sys
from fractions import Fraction
from itertools import permutations

import flint

FORMAT = "holokin whole-arm certificate 1"
MOST_BYTES, MOST_JOINTS, MOST_DIGITS = 1_000_000, 40, 60


class RejectedError(Exception):
    """What is wrong with a certificate."""


class Ring:
    """Polynomials in the cosine and sine, or the travel, of each joint."""

    def __init__(self, slides: list[bool]) -> None:
        names = [name for i, slide in enumerate(slides) for name in ([f"x{i}"] if slide else [f"c{i}", f"s{i}"])]
        self.context = flint.fmpq_mpoly_ctx.get(names, "degrevlex")
        generators = dict(zip(names, self.context.gens(), strict=True))
        self.motion = [
            (generators[f"x{i}"],) if slide else (generators[f"c{i}"], generators[f"s{i}"])
            for i, slide in enumerate(slides)
        ]
        self.circles = [(m[1], 1 - m[0] * m[0]) for m in self.motion if len(m) == 2]

    def number(self, text: object) -> object:
        """A rational number, written as "3/8"."""
        if not isinstance(text, str) or len(text) > 2 * MOST_DIGITS + 2:
            raise RejectedError(f"no rational number: {str(text)[:40]}")
        try:
            value = Fraction(text)
        except (ValueError, ZeroDivisionError):
            raise RejectedError(f"no rational number: {text[:40]}") from None
        return self.context.constant(flint.fmpq(value.numerator, value.denominator))

    def reduced(self, p: object) -> object:
        """A polynomial with at most the first power of each sine."""
        for sine, square in self.circles:
            while True:
                place = self.context.gens().index(sine)
                high = {m: c for m, c in p.to_dict().items() if m[place] > 1}
                if not high:
                    break
                rest = self.context.from_dict({m: c for m, c in p.to_dict().items() if m[place] <= 1})
                lower = {tuple(e - 2 * (j == place) for j, e in enumerate(m)): c for m, c in high.items()}
                p = rest + self.context.from_dict(lower) * square
        return p


def dot(a: list, b: list) -> object:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: list, b: list) -> list:
    """a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a: list, b: list, factor: object = 1) -> list:
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


def determinant(columns: list, reduce) -> object:
    """Of a square matrix, by Leibniz."""
    n, total = len(columns), 0
    for order in permutations(range(n)):
        term = 1
        for column, row in enumerate(order):
            entry = columns[column][row]
            if entry == 0:
                term = 0
                break
            term = term * entry
        if not (isinstance(term, int) and term == 0):
            inversions = sum(order[i] > order[j] for i in range(n) for j in range(i + 1, n))
            total = total + (-term if inversions % 2 else term)
    return reduce(total)


class Arm:
    """The links of a file: rotation, position and axis of each joint, which are held, in a ring."""

    def __init__(self, data: dict) -> None:
        links = data.get("links")
        if not isinstance(links, list) or not 6 <= len(links) <= MOST_JOINTS:
            raise RejectedError("the links are missing, or too many")
        self.slides = [isinstance(link, dict) and link.get("slides") is True for link in links]
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
        clean = lambda v: [reduce(x) if not isinstance(x, int) else x for x in v]  # noqa: E731
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


def check(file: str) -> list[str]:
    """What is verified, in sentences. Raises: RejectedError; OSError, ValueError: the file cannot be read."""
    with open(file, "rb") as stream:
        raw = stream.read(MOST_BYTES + 1)
    if len(raw) > MOST_BYTES:
        raise RejectedError("the file is too large")
    data = json.loads(raw)
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise RejectedError(f"it does not say {FORMAT!r}")
    arm, form = Arm(data), data.get("form")
    if not isinstance(form, dict) or form.get("family") not in ("pair", "parallel"):
        raise RejectedError("the form is missing")
    backward, inner = form.get("reversed") is True, form.get("inner") is True
    axes, frames = arm.screws()
    order = arm.free[::-1] if backward else arm.free
    h, p = ([axes[i][part] for i in order] for part in (0, 1))
    reduce = arm.ring.reduced

    def vanishes(what: str, values: list) -> None:
        if any(reduce(value) != 0 for value in values):
            raise RejectedError(f"{what}, at some posture")

    def fixed(key: str, place: int) -> tuple[list, list]:
        """A vector that is fixed in a link, seen from the middle, and the link's origin."""
        numbers = data.get(key)
        if not isinstance(numbers, list) or len(numbers) != 3:
            raise RejectedError(f"{key!r} is missing")
        R, origin = frames[place]
        return [reduce(x) for x in times(R, [arm.ring.number(x) for x in numbers])], origin

    # The point in which the last axes meet. It is fixed in the link between the first two of them.
    first_last = 3 if form["family"] == "pair" else 4
    vector, origin = fixed("center", order[first_last + 1] if backward else order[first_last])
    center = [reduce(x) for x in plus(origin, vector)]
    for k in range(first_last, 6):
        vanishes(f"axis {k + 1} of the steps misses the center", cross(plus(center, p[k], -1), h[k]))
    moves = [[reduce(x) for x in cross(h[k], plus(center, p[k], -1))] for k in range(6)]
    if form["family"] == "pair":
        first, second, single = (2, 1, 0) if inner else (0, 1, 2)
        vector, _ = fixed("normal", min(order[first], order[second]))
        square = reduce(dot(vector, vector))
        if square == 0 or square.total_degree() > 0:
            raise RejectedError("the normal is none")
        away, scale = plus(p[first], p[second], -1), 1 / square.leading_coefficient()
        sigma = reduce(dot(cross(h[first], h[second]), vector) * scale)
        tau = reduce(-dot(cross(away, h[first]), vector) * scale)
        vanishes("the pair has another normal", plus(cross(h[first], h[second]), vector, -sigma))
        vanishes("the pair lies in no plane", plus(cross(away, h[first]), vector, tau))
        arm_part = plus(center, p[second], -1)
        lever = plus([sigma * x for x in arm_part], h[second], -tau)
        slopes = [dot(lever, moves[single]), dot(vector, arm_part), dot(h[3], cross(h[4], h[5]))]
        det = determinant(moves[:3], reduce) * determinant(h[3:], reduce)
    else:
        for k in (2, 3):
            vanishes("axes 2, 3, 4 of the steps are not parallel", cross(h[1], h[k]))
        elbow, lever = plus(p[2], p[1], -1), plus(p[3], p[2], -1)
        slopes = [dot(h[1], moves[0]), dot(h[1], cross(h[4], h[5])), dot(h[1], cross(elbow, lever))]
        # Axes 2, 3, 4 may be the same or opposite ways.
        det = determinant([[*move, *axis] for move, axis in zip(moves, h, strict=True)], reduce)
    whole = reduce(reduce(slopes[0] * slopes[1]) * slopes[2])
    det = reduce(det)
    if det == 0:
        raise RejectedError("every posture is singular")
    if reduce(det - whole) != 0 and reduce(det + whole) != 0:
        raise RejectedError("det J is not the product of the slopes")
    terms = len(det.to_dict())
    return [f"the axes meet as it says, and det J, a polynomial of {terms} terms, is the product of the three slopes"]


if __name__ == "__main__":
    try:
        print("VERIFIED:", *check(sys.argv[1]))
    except (RejectedError, OSError, ValueError, IndexError) as problem:
        print(f"REJECTED: {problem}")
        sys.exit(1)
