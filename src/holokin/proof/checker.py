"""The checker verifies a certificate again, with the balls of Arb [Joh17]. It needs python-flint and this file alone.

A certificate holds E(q, u), n numbers, as a list of operations. E = 0 where the joints q reach the pose u of a path,
0 <= u <= 1, or of a box, -1 <= u_k <= 1, on one leaf. A cell is a box of u, run through by y in [-1, 1]^d; it predicts
the joints p(y) = q0 + V y + 1/2 Q y y, and Y is near the inverse of D_q E at its middle. Let, number by number,

    eta >= |Y E(p(y), y)|,   M >= |1 - Y D_q E(p(y) + s, y)|   for all y and all |s| <= rho.

If eta + M rho < rho, then s - Y E(p(y) + s, y) maps the box |s| <= rho into itself and contracts it. So for each pose it
holds exactly one root, which is within r = (1 - M)^-1 eta of p(y) and smooth in the pose; D_q E is regular. [Kra69]
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from itertools import pairwise, product
from typing import Any

from flint import arb, arb_mat, ctx

ctx.prec = 64
UNIT, NAN, TURN = arb(0, 1), arb("nan"), 2 * arb.pi()


class RejectedError(Exception):
    """The certificate does not prove what it says; the message tells what fails."""


def need(true: bool, what: str) -> None:
    """Raises: RejectedError."""
    if not true:
        raise RejectedError(what)


def size(M: Any) -> Any:
    """Upper bounds of |M|, number by number."""
    return arb_mat(M.nrows(), M.ncols(), [abs(x).upper() for x in M.entries()])


def below(a: Any, b: Any) -> bool:
    """Whether a < b, number by number."""
    return all(x < y for x, y in zip(a.entries(), b.entries(), strict=True))


def arctan2(y: Any, x: Any) -> Any:
    """Across its cut the value is no number; the derivatives are."""
    s = 1 / (abs(x) ** 2 + abs(y) ** 2)
    bend, mixed = 2 * x * y * s * s, (y * y - x * x) * s * s
    value = arb.atan2(y, x) if x > 0 or y > 0 or y < 0 else NAN
    return value, (x * s, -y * s), {(0, 0): -bend, (0, 1): mixed, (1, 0): mixed, (1, 1): bend}


RULES: Any = {  # of balls: (value, first derivatives, second derivatives)
    "add": lambda a, b: (a + b, (1, 1), {}),
    "sub": lambda a, b: (a - b, (1, -1), {}),
    "mul": lambda a, b: (a * b, (b, a), {(0, 1): 1, (1, 0): 1}),
    "inv": lambda a: (1 / a, (-1 / a**2,), {(0, 0): 2 / a**3}),
    "sq": lambda a: (abs(a) ** 2, (2 * a,), {(0, 0): 2}),
    "sqrt": lambda a: (a.sqrt(), (a.rsqrt() / 2,), {(0, 0): -(a.rsqrt() ** 3) / 4}),
    "exp": lambda a: (a.exp(), (a.exp(),), {(0, 0): a.exp()}),
    "log": lambda a: (a.log(), (1 / a,), {(0, 0): -1 / a**2}),
    "sin": lambda a: (a.sin(), (a.cos(),), {(0, 0): -a.sin()}),
    "cos": lambda a: (a.cos(), (-a.sin(),), {(0, 0): -a.cos()}),
    "sign": lambda a: (arb(1), (0,), {}) if a > 0 else (arb(-1), (0,), {}) if a < 0 else (NAN, (NAN,), {}),
    "atan2": arctan2,
}


class Cell:
    """A box of u with its predictor of x = (q, u). `Checker.prove` adds M, rho, r and the neighbours."""

    def __init__(self, given: Any, numbers: Any, sides: Any) -> None:
        d, self.numbers, self.sides, self.Y = len(sides), numbers, sides, arb_mat(given["Y"])
        half = [[(arb(b) - a) / 2 if i == k else 0 for k in range(d)] for i, (a, b) in enumerate(sides)]
        self.x = arb_mat([[x] for x in given["q0"]] + [[(arb(a) + b) / 2] for a, b in sides])
        self.V = arb_mat(given["V"] + half)
        self.Q = [(arb_mat(Q) + arb_mat(Q).transpose()) / 2 for Q in given["Q"]] + [arb_mat(d, d)] * d
        self.neighbors: list[Cell] = []

    def predicted(self, y: Any) -> Any:
        """x (n + d, 1) at y (d, 1), and its derivatives (n + d, d)."""
        bend = arb_mat([(Q * y).entries() for Q in self.Q])
        return self.x + self.V * y + bend * y / 2, self.V + bend

    def y(self, u: Any) -> Any:
        """y (d, 1) at u."""
        return arb_mat([[(2 * arb(x) - a - b) / (arb(b) - a)] for x, (a, b) in zip(u, self.sides, strict=True)])


class Checker:
    """The data of a certificate, verified."""

    def __init__(self, data: Any, say: Any) -> None:
        self.data, self.say, self.claims, self.count = data, say, data["claims"], 0
        n, d = self.n, self.d = len(data["start"]["q"]), len(data["start"]["u"])
        self.angular = [False] * (n - len(data["level"])) + data["angular"]
        self.one = arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
        self.middle, self.all_y, self.still = arb_mat(d, 1), arb_mat(d, 1, [UNIT] * d), arb_mat(n, 1)

    def enclose(self, cell: Cell, y: Any, s: Any, second: bool = False) -> Any:
        """Values of E and `facing` at p(y) + s; [E_s, E_y] and, if `second`, its derivatives by each y_k (n, n + d).

        A value goes with the matrix [[0, D], [D_y^T, D_y D]] of its derivatives D by (s, y); a constant with None.
        """
        n, d, rows = self.n, self.d, 1 + self.d * second
        x, slope = cell.predicted(y)
        values = [a + b for a, b in zip(x.entries(), s.entries() + [0] * d, strict=True)]
        values += map(arb, cell.numbers + self.data["level"] + self.data["constants"])
        parts: list[Any] = [None] * len(values)
        for i, (D, Q) in enumerate(zip(slope.tolist(), cell.Q, strict=True)):
            by_y = [[D[k], *[0] * n, *Q.tolist()[k]] for k in range(d)]
            parts[i] = arb_mat([[0, *(int(i == j) for j in range(n)), *D], *by_y][:rows])
        left, top = arb_mat(1 + n + d, 1, [1] + [0] * (n + d)), arb_mat(1, rows, [1] + [0] * (rows - 1))
        for name, *of in self.data["operations"]:
            args, those = [values[i] for i in of], [parts[i] for i in of]
            need(name in ("add", "sub") or all(a.is_finite() for a in args), "the constraint may be undefined")
            value, slopes, bends = RULES[name](*args)
            terms = [D * a for D, a in zip(those, slopes, strict=True) if D is not None]
            for (i, j), a in bends.items() if second else ():
                if those[i] is not None and those[j] is not None:
                    terms.append((those[i] * left) * (top * those[j] * a))
            values.append(value)
            parts.append(sum(terms[1:], terms[0]) if terms else None)
        zero = arb_mat(rows, 1 + n + d)
        found = [(zero if parts[i] is None else parts[i]).tolist() for i in self.data["outputs"][:n]]
        return [values[i] for i in self.data["outputs"]], [arb_mat([D[k][1:] for D in found]) for k in range(rows)]

    def residual(self, values: Any) -> Any:
        """E (n, 1), its angles less whole turns."""
        need(all(x.is_finite() for x in values), "the constraint may be undefined")
        rows = zip(values[:-1], self.angular, strict=True)
        return arb_mat([[x - TURN * round(float(x.mid()) / math.tau) if angle else x] for x, angle in rows])

    def bounds(self, cell: Cell, s: Any) -> Any:
        """M of all y and s; eta, where s = 0."""
        E, (D,) = self.enclose(cell, self.middle, s)
        (*wide, facing), (_, *bent) = self.enclose(cell, self.all_y, s, second=True)
        need(facing > 0, "the tool may face the other way")
        need(all(a or x.is_finite() for x, a in zip(wide, self.angular, strict=True)), "the constraint may jump")
        M, eta = arb_mat(self.n, self.n), size(cell.Y * self.residual(E))
        for k, rows in enumerate((cell.Y * F).tolist() for F in [D, *bent]):
            by_s, by_y = arb_mat([row[: self.n] for row in rows]), arb_mat([row[self.n :] for row in rows])
            M += size(by_s if k else self.one - by_s)
            eta += size(by_y) * arb_mat(self.d, 1, [1] * self.d) / (2 if k else 1)
        return M, eta

    def prove(self, cell: Cell) -> None:
        """The theorem of a cell, and what is claimed of it."""
        M, eta = self.bounds(cell, self.still)
        guess = size((self.one - M).solve(eta))
        cell.rho = 3 * guess + arb_mat(self.n, 1, [max(guess.entries()) / 8 + 1e-15] * self.n)
        cell.M, _ = self.bounds(cell, arb_mat(self.n, 1, [UNIT * x for x in cell.rho.entries()]))
        need(below(eta + cell.M * cell.rho, cell.rho), "[J; J_g] may be singular")
        cell.r = size((self.one - cell.M).solve(eta))
        between = self.one + arb_mat(self.n, self.n, [UNIT * x for x in cell.M.entries()])
        need(self.claims["determinant"] <= abs(between.det() / cell.Y.det()), "the determinant may be smaller")
        low, high, x = self.claims["low"], self.claims["high"], cell.predicted(self.all_y)[0].entries()[: self.n]
        hull = zip(low, x, cell.r.entries(), high, strict=True)
        need(all(a <= p - r and p + r <= b for a, p, r, b in hull), "a joint may leave the hull")

    def cover(self, tree: Any, numbers: Any, sides: Any) -> list[Cell]:
        """The cells of a box of u: a cell; or null, none; or [axis, at, below, above], those of both sides of a cut."""
        if tree is None:
            return []
        if isinstance(tree, dict):
            self.count += 1
            self.say(self.count, self.claims["cells"])
            cell = Cell(tree, numbers, sides)
            try:
                self.prove(cell)
            except (RejectedError, ZeroDivisionError) as problem:
                raise RejectedError(f"cell {self.count}: {problem}") from None
            return [cell]
        axis, at, *halves = tree
        a, b = sides[axis]
        need(a < at < b, "a cut does not cut")
        ends = zip(halves, ((a, at), (at, b)), strict=True)
        below_it, above = (self.cover(half, numbers, [*sides[:axis], end, *sides[axis + 1 :]]) for half, end in ends)
        touching = product((c for c in below_it if c.sides[axis][1] == at), (c for c in above if c.sides[axis][0] == at))
        for one, other in touching:
            common = [(max(a, c), min(b, d)) for (a, b), (c, d) in zip(one.sides, other.sides, strict=True)]
            if all(a < b or k == axis for k, (a, b) in enumerate(common)):
                u = [(arb(a) + b) / 2 for a, b in common]
                p, q = (arb_mat(self.n, 1, c.predicted(c.y(u))[0].entries()[: self.n]) for c in (one, other))
                shared = below(size(p - q) + one.r, other.rho) or below(size(p - q) + other.r, one.rho)
                need(shared, "the joints may jump between two cells")
                one.neighbors.append(other)
                other.neighbors.append(one)
        return below_it + above

    def holes(self, tree: Any) -> bool:
        """Whether a part of a box has no cell."""
        return tree is None or (isinstance(tree, list) and any(map(self.holes, tree[2:])))

    def away(self, cells: list[Cell], u: Any, q: Any) -> Any:
        """How far the root at u is from the joints q, which are in its box, at most; all cells are joined to its cell."""
        holding = [c for c in cells if all(a <= x <= b for x, (a, b) in zip(u, c.sides, strict=True))]
        need(len(holding) > 0, f"no cell holds {u}")
        cell, reached, new = holding[0], set[Cell](), {holding[0]}
        while new:
            reached |= new
            new = {other for one in new for other in one.neighbors} - reached
        need(len(reached) == len(cells), "the cells are not joined")
        s = arb_mat(self.n, 1, [a - b for a, b in zip(q, cell.predicted(cell.y(u))[0].entries(), strict=False)])
        need(below(size(s), cell.rho), f"the joints at {u} are not near their root")
        E = self.residual(self.enclose(cell, cell.y(u), s)[0])
        return max(size((self.one - cell.M).solve(size(cell.Y * E))).entries())

    def verify(self) -> str:
        """What is proven, in words. Raises: RejectedError."""
        data, claims, start = self.data, self.claims, self.data["start"]
        low, high = data["limits"] or (claims["low"], claims["high"])
        inside = zip(low, claims["low"], claims["high"], high, strict=True)
        need(all(a <= b and c <= d for a, b, c, d in inside), "a joint may leave its limits")
        sides = [(0, 1) if self.d == 1 else (-1, 1)] * self.d
        pieces = [self.cover(piece["cells"], piece["numbers"], sides) for piece in data["pieces"]]
        need(self.count == claims["cells"], "cells are missing")
        need(self.d > 1 or start["u"] == [0], "a path starts elsewhere")
        need(self.away(pieces[0], start["u"], start["q"]) <= claims["within"], "the leaf may miss the start")
        ends = [(one, other, 0) for one, other in pairwise(pieces)]
        ends += [(pieces[-1], pieces[0], TURN)] if claims["turns"] else []
        for (one, other, turn), q in zip(ends, data["seams"], strict=True):
            turned = [x + turn * k for x, k in zip(q, claims["turns"] or [0] * self.n, strict=True)]
            gap = self.away(one, [1], turned) + self.away(other, [0], q)
            need(gap <= claims["gap"], "pieces of the path do not meet")
        holes = [self.holes(piece["cells"]) for piece in data["pieces"]]
        need(not any(holes[:-1]) and not (holes[-1] and claims["whole"]), "the cells leave a gap")
        return f"{self.count} cells"


def check(file: str, say: Any = lambda _done, _all: None) -> tuple[Any, str]:
    """(data, what is proven) of a certificate's file. Raises: RejectedError; OSError, ValueError: no certificate."""

    def number(text: str) -> float:
        if not math.isfinite(float(text)):
            raise ValueError(f"{text} is no finite number")
        return float(text)

    def mapping(pairs: Any) -> Any:
        if len(dict(pairs)) < len(pairs):
            raise ValueError("a name is given twice")
        return dict(pairs)

    with open(file, encoding="utf-8") as stream:
        data = json.load(stream, parse_float=number, parse_constant=number, object_pairs_hook=mapping)
    try:
        text = json.dumps({key: value for key, value in data.items() if key != "sha256"}, sort_keys=True)
        need(hashlib.sha256(text.encode()).hexdigest() == data["sha256"], "the file is not as written: SHA-256")
        return data, Checker(data, say).verify()
    except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as problem:
        raise ValueError(f"not a certificate of this format ({problem!r})") from None


if __name__ == "__main__":
    try:
        print(f"\rVERIFIED: {check(sys.argv[1], lambda k, n: print(f'{k} of {n}', end=chr(13), file=sys.stderr))[1]}")
    except RejectedError as problem:
        sys.exit(print(f"\rREJECTED: {problem}") or 1)
    except (OSError, ValueError, LookupError) as problem:
        sys.exit(print(f"\rnot read: {problem}") or 2)
