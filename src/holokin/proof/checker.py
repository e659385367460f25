"""The checker verifies a certificate again, with the balls of Arb [Joh17]. It needs python-flint and this file alone.

A certificate holds E(q, u), n numbers, as a list of operations. E = 0 where the joints q reach the pose u of a path,
0 <= u <= 1, or of a box, -1 <= u_k <= 1, on one leaf. A cell is a box of u, run through by y in [-1, 1]^d; it predicts
the joints p(y) = q0 + V y + 1/2 Q y y, and Y is near the inverse of D_q E at its middle. Let eta >= |Y E(p(y), y)| and
M >= |1 - Y D_q E(p(y) + s, y)|, number by number, for all y and all |s| <= rho. If eta + M r < r < rho, then
s - Y E(p(y) + s, y) maps the box |s| <= r into itself and contracts |s| <= rho: this holds just one root for each
pose, within r of p(y) and smooth in it [Kra69]; |det Y D_q E| >= det(1 - M) [Ost37].
"""

import hashlib
import json
import sys
from itertools import product
from pathlib import Path
from typing import Any

from flint import arb, arb_mat, ctx

ctx.prec, UNIT, NAN, MOST = 64, arb(0, 1), arb("nan"), 64


class RejectedError(Exception):
    """The certificate does not prove what it says; the message tells what fails."""


def need(true: bool, what: str) -> None:
    """Raises: RejectedError."""
    if not true:
        raise RejectedError(what)


def size(*those: Any) -> Any:
    """Upper bounds of |M| for all of those, number by number. None is NaN."""
    rows = zip(*(M.tolist() for M in those), strict=True)
    return arb_mat([[max(abs(x).upper() for x in of) for of in zip(*row, strict=True)] for row in rows])


def below(a: Any, b: Any) -> bool:
    """Whether a < b, number by number."""
    return all(x < y for x, y in zip(a.entries(), b.entries(), strict=True))


RULES: Any = {  # of balls: (value, first derivatives, second derivatives)
    "add": lambda a, b: (a + b, (1, 1), {}),
    "sub": lambda a, b: (a - b, (1, -1), {}),
    "mul": lambda a, b: (a * b, (b, a), {(0, 1): 1, (1, 0): 1}),
    "inv": lambda a: (1 / a, (-1 / a**2,), {(0, 0): 2 / a**3}),
    "sq": lambda a: (a * a, (2 * a,), {(0, 0): 2}),
    "sqrt": lambda a: (a.sqrt(), (a.rsqrt() / 2,), {(0, 0): -(a.rsqrt() ** 3) / 4}),
    "exp": lambda a: (a.exp(), (a.exp(),), {(0, 0): a.exp()}),
    "log": lambda a: (a.log(), (1 / a,), {(0, 0): -1 / a**2}),
    "sin": lambda a: (a.sin(), (a.cos(),), {(0, 0): -a.sin()}),
    "cos": lambda a: (a.cos(), (-a.sin(),), {(0, 0): -a.cos()}),
    "atan": lambda a: (a.atan(), (1 / (1 + a * a),), {(0, 0): -2 * a / (1 + a * a) ** 2}),
    "sign": lambda a: (arb(1) if a > 0 else arb(-1) if a < 0 else NAN, (0,), {}),
}


class Cell:
    """A box of u and a predictor of (q, u). `Checker.prove` finds M, rho and r, `cover` the cells joined to it."""

    def __init__(self, data: Any, box: Any) -> None:
        d, self.sides, self.joined = len(box), box, {self}
        self.Y = self.M = self.eta = self.rho = self.r = arb_mat(data["Y"])
        self.x = arb_mat([[q] for q in data["q0"]] + [[(arb(a) + b) / 2] for a, b in box])
        self.V = arb_mat(data["V"] + [[(arb(b) - a) / 2 * (i == k) for k in range(d)] for i, (a, b) in enumerate(box)])
        self.Q = [(arb_mat(Q) + arb_mat(Q).transpose()) / 2 for Q in data["Q"]] + [arb_mat(d, d)] * d

    def p(self, y: Any) -> Any:
        """(q, u) (n + d, 1) at y (d, 1), and its derivatives (n + d, d)."""
        bend = arb_mat([(Q * y).entries() for Q in self.Q])
        return self.x + self.V * y + bend * y / 2, self.V + bend

    def at(self, u: Any) -> Any:
        """y (d, 1) and p (n, 1) at u."""
        y = arb_mat([[(2 * arb(x) - a - b) / (arb(b) - a)] for x, (a, b) in zip(u, self.sides, strict=True)])
        return y, arb_mat([[x] for x in self.p(y)[0].entries()[: -len(u)]])


class Checker:
    """The data of a certificate."""

    def __init__(self, data: Any, say: Any) -> None:
        self.data, self.claims, self.say = data, data["claims"], say
        n, d = self.n, self.d = len(data["pieces"][0]["q"]), len(data["pieces"][0]["u"])
        self.one, self.all_y = arb_mat([[int(i == j) for j in range(n)] for i in range(n)]), arb_mat([[UNIT]] * d)
        self.by_y, self.by_s = arb_mat([[1]] * d + [[0]] * n), arb_mat([[0] * n] * d + self.one.tolist())

    def enclose(self, cell: Cell, y: Any, s: Any, twice: bool = False) -> Any:
        """E (n, 1) at p(y) + s, and [D] with D = [E_y, E_s] (n, d + n), or [D, D by y_1, ...]; jets are such lists."""
        n, d, orders, rows = self.n, self.d, range(1 + self.d * twice), self.data["outputs"][: self.n]
        x, slope = cell.p(y)
        values = [a + b for a, b in zip(x.entries(), s.entries() + [0] * d, strict=True)] + self.numbers
        given = zip(slope.tolist(), self.one.tolist() + [[0] * n] * d, cell.Q, strict=True)
        jets: list[Any] = [[arb_mat([D + e]), *(arb_mat([row + [0] * n]) for row in Q.tolist())] for D, e, Q in given]
        jets += [None] * len(self.numbers)
        for name, *of in self.data["operations"]:
            those = [jets[i] for i in of]
            value, slopes, bends = RULES[name](*(values[i] for i in of))
            need(all(arb(x).is_finite() for x in (value, *slopes, *bends.values())), "the constraint may have a kink")
            values.append(value)
            sums: list[Any] = [[J[k] * a for J, a in zip(those, slopes, strict=True) if J] for k in orders]
            for k, ((i, j), a) in product(orders[1:], (bends if all(those) else {}).items()):
                sums[k].append(those[j][0] * (those[i][0][0, k - 1] * a))
            jets.append([sum(terms[1:], terms[0]) for terms in sums] if any(those) else None)
        need(all(values[i] > 0 for i in self.data["outputs"][n:]), "the tool may face the other way")
        found = [arb_mat([jets[i][k].entries() if jets[i] else [0] * (d + n) for i in rows]) for k in orders]
        return arb_mat([[values[i]] for i in rows]), found

    def bounds(self, cell: Cell, s: Any, cuts: int) -> Any:
        """(M, eta) for all y, each cut into so many parts, and a box of s; eta is right where s is 0."""
        found, half = [], arb(1) / cuts
        for y in (half * arb_mat([[k] for k in at]) for at in product(range(1 - cuts, cuts, 2), repeat=self.d)):
            (E, [first]), (_, bends) = self.enclose(cell, y, s), self.enclose(cell, y + half * self.all_y, s, True)
            once = size(cell.Y * first - self.by_s.transpose())
            twice = half * sum((size(cell.Y * D) for D in bends[1:]), 0 * once)
            found.append(((once + twice) * self.by_s, size(cell.Y * E) + half * (once + twice / 2) * self.by_y))
        return (size(*parts) for parts in zip(*found, strict=True))

    def prove(self, cell: Cell) -> Cell:
        """The cell with its theorem, and what is claimed of it."""
        for cuts, factor in product([k for k in (1, 2, 4, 8) if k**self.d <= MOST], (3, 2, 1.5)):
            M, cell.eta = self.bounds(cell, arb_mat(self.n, 1), cuts)
            some = arb_mat(self.n, 1, [max(cell.eta.entries()) / 64 + 1e-15] * self.n)
            cell.rho = factor * size((self.one - M).solve(cell.eta + some))
            cell.M, _ = self.bounds(cell, cell.rho * UNIT, cuts)
            cell.r = size((self.one - cell.M).solve(cell.eta + some / 64))
            if below(cell.eta + cell.M * cell.r, cell.r) and below(cell.r, cell.rho):
                break
        need(below(cell.eta + cell.M * cell.r, cell.r) and below(cell.r, cell.rho), "D_q E may be singular")
        self.say()
        need(self.claims["determinant"] <= (self.one - cell.M).det() / abs(cell.Y.det()), "|det D_q E| is less")
        hull = zip(*self.claims["joints"], cell.p(self.all_y)[0].entries()[: self.n], cell.r.entries(), strict=True)
        need(all(a <= b <= q - r and q + r <= c <= d for a, b, c, d, q, r in hull), "a joint may leave hull or limits")
        return cell

    def cover(self, tree: Any, sides: Any) -> list[Cell]:
        """The cells of a box of u: one; or null, none; or [axis, at, below, above], those of the two parts of a cut."""
        if not isinstance(tree, list):
            need(bool(tree) or not self.whole, "the cells leave a gap")
            return [self.prove(Cell(tree, sides))] if tree else []
        axis, at, *halves = tree
        need(sides[axis][0] < at < sides[axis][1], "a cut is outside of its box")
        parts = [[*sides[:axis], end, *sides[axis + 1 :]] for end in ((sides[axis][0], at), (at, sides[axis][1]))]
        lower, upper = (self.cover(half, part) for half, part in zip(halves, parts, strict=True))
        for one, other in product(*([c for c in of if at in c.sides[axis]] for of in (lower, upper))):
            face = [(max(a, c), min(b, d)) for (a, b), (c, d) in zip(one.sides, other.sides, strict=True)]
            if all(a < b or k == axis for k, (a, b) in enumerate(face)):
                p, q = (cell.at([(arb(a) + b) / 2 for a, b in face])[1] for cell in (one, other))
                need(below(size(p - q) + one.r, other.rho) or below(size(p - q) + other.r, one.rho), "it may jump")
                one.joined.update(other.joined)
                for cell in other.joined:
                    cell.joined = one.joined
        return lower + upper

    def away(self, cells: list[Cell], u: Any, q: Any) -> Any:
        """How far the root at u is from the joints q at most. All cells are joined to the one there."""
        holding = [c for c in cells if all(a <= x <= b for x, (a, b) in zip(u, c.sides, strict=True))]
        need(len(holding) > 0 and len(holding[0].joined) == len(cells), f"the cells are not joined to the one at {u}")
        cell, (y, p) = holding[0], holding[0].at(u)
        s = arb_mat([[x] for x in q]) - p
        need(below(size(s), cell.rho), f"the joints at {u} are not near their root")
        return max(size((self.one - cell.M).solve(size(cell.Y * self.enclose(cell, y, s)[0]))).entries())

    def verify(self) -> None:
        """All that is claimed. Raises: RejectedError."""
        data, claims, pieces = self.data, self.claims, self.data["pieces"]
        ends = [[0] * self.n for _ in pieces[1:]] + [claims["turns"]]
        for piece, after, turns in zip(pieces, pieces[1:] + pieces[:1], ends, strict=True):
            self.whole = claims["whole"] or after is not pieces[0]
            self.numbers = [arb(x) for x in piece["numbers"] + data["level"] + data["constants"]]
            cells = self.cover(piece["cells"], [(0, 1) if self.d == 1 else (-1, 1)] * self.d)
            u = [0] if self.d == 1 else piece["u"]
            need(self.away(cells, u, piece["q"]) <= claims["gap"], "the leaf may miss the start")
            if turns:
                q = [x + 2 * arb.pi() * k.__index__() for x, k in zip(after["q"], turns, strict=True)]
                need(self.away(cells, [1], q) <= claims["gap"], "the path may not go on, or not close")


def check(file: str, say: Any = lambda: None) -> Any:
    """The data of a certificate's file, verified. Raises: RejectedError; OSError, ValueError: no certificate."""
    text = Path(file).read_text("utf-8")
    try:
        data = {key: value for key, value in json.loads(text).items() if key != "sha256"}
        sha256 = hashlib.sha256(json.dumps(data, allow_nan=False).encode()).hexdigest()
        need(text == json.dumps(data | {"sha256": sha256}) + "\n", "the file is not as it was written: SHA-256")
        Checker(data, say).verify()
        return data
    except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as problem:
        raise ValueError(f"not a certificate of this format ({problem!r})") from None


if __name__ == "__main__":
    try:
        print("\nVERIFIED:", check(sys.argv[1], lambda: print(".", end="", file=sys.stderr, flush=True))["claims"])
    except (RejectedError, OSError, ValueError, LookupError) as problem:
        print("\nREJECTED:" if isinstance(problem, RejectedError) else "\nnot read:", problem)
        sys.exit(1 if isinstance(problem, RejectedError) else 2)
