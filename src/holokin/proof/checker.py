"""The checker verifies a certificate again, with the balls of Arb [Joh17]. It needs python-flint, the file
checker_file.py, and of a certificate about shapes the file clear_checker.py.

A certificate holds E(q, u), n numbers, as a list of operations. E = 0 where the joints q reach the pose u of a path,
0 <= u <= 1, or of a box, -1 <= u_k <= 1, on one leaf. A cell is a box of u, run through by y in [-1, 1]^d; it predicts
the joints p(y) = q0 + V y + 1/2 Q y y, and Y is near the inverse of D_q E at its middle. Let eta >= |Y E(p(y), y)| and
M >= |1 - Y D_q E(p(y) + s, y)|, number by number, for all y and all |s| <= rho. If eta + M r < r < rho, then
s - Y E(p(y) + s, y) maps the box |s| <= r into itself and contracts |s| <= rho: this holds just one root for each
pose, within r of p(y) and smooth in it [Kra69]; |det Y D_q E| >= det(1 - M) [Ost37].

What is said in the end is computed here from E and the cells; of the file's words nothing is verified.
"""

import math
import sys
import time
from itertools import pairwise, product
from typing import Any, NamedTuple

from flint import arb, arb_mat, ctx

try:
    from .checker_file import FAR, RejectedError, need, read, text_of
except ImportError:  # it runs alone
    from checker_file import FAR, RejectedError, need, read, text_of  # type: ignore[no-redef]

ctx.prec, UNIT, NAN, MOST, DOWN = 64, arb(0, 1), arb("nan"), 64, 1 - 5.1e-4

TORN, GAP = 1e-9, 1e-6
"""Poses farther apart [m, 1] than TORN are two. A gap [rad, m] over GAP says nothing."""


def solved(A: Any, b: Any) -> Any:
    """x with A x = b. Raises: RejectedError."""
    try:
        return A.solve(b)
    except ZeroDivisionError:
        raise RejectedError("a posture may be singular") from None


def size(*matrices: Any) -> Any:
    """Upper bounds of |M| for all of the matrices, number by number. None is NaN."""
    rows = zip(*(M.tolist() for M in matrices), strict=True)
    return arb_mat([[max(abs(x).upper() for x in entry) for entry in zip(*row, strict=True)] for row in rows])


def below(a: Any, b: Any) -> bool:
    """Whether a < b, number by number."""
    return all(x < y for x, y in zip(a.entries(), b.entries(), strict=True))


RULES: Any = {  # of balls: (value, first derivatives, second derivatives)
    "add": lambda a, b: (a + b, (1, 1), {}),
    "sub": lambda a, b: (a - b, (1, -1), {}),
    "mul": lambda a, b: (a * b, (b, a), {(0, 1): 1, (1, 0): 1}),
    "inv": lambda a: (v := 1 / a, (-v * v,), {(0, 0): 2 * v * v * v}),
    "sq": lambda a: (a * a, (2 * a,), {(0, 0): 2}),
    "sqrt": lambda a: (a.sqrt(), ((v := a.rsqrt()) / 2,), {(0, 0): -(v**3) / 4}),
    "exp": lambda a: (v := a.exp(), (v,), {(0, 0): v}),
    "log": lambda a: (a.log(), (v := 1 / a,), {(0, 0): -v * v}),
    "sin": lambda a: (a.sin(), (a.cos(),), {(0, 0): -a.sin()}),
    "cos": lambda a: (a.cos(), (-a.sin(),), {(0, 0): -a.cos()}),
    "atan": lambda a: (a.atan(), (v := 1 / (1 + a * a),), {(0, 0): -2 * a * v * v}),
    "atan2": lambda y, x: (  # no number where x + i y may lie on the cut
        arb.atan2(y, x) if x > 0 or y > 0 or y < 0 else NAN,
        (x * (v := 1 / (x * x + y * y)), -y * v),
        {(0, 0): (w := -2 * x * y * v * v), (0, 1): (m := (y * y - x * x) * v * v), (1, 0): m, (1, 1): -w},
    ),
    "sign": lambda a: (arb(1) if a > 0 else arb(-1) if a < 0 else NAN, (0,), {}),
}


class Cell:
    """A box of u and a predictor of (q, u). `Checker.prove` finds M, rho and r, `cover` the cells joined to it."""

    def __init__(self, data: Any, box: Any) -> None:
        d, self.sides, self.joined, self.planes = len(box), box, {self}, data.get("planes", [])
        self.Y = self.M = self.eta = self.rho = self.r = arb_mat(data["Y"])
        self.x = arb_mat([[q] for q in data["q0"]] + [[(arb(a) + b) / 2] for a, b in box])
        self.V = arb_mat(data["V"] + [[(arb(b) - a) / 2 * (i == k) for k in range(d)] for i, (a, b) in enumerate(box)])
        self.Q = [(arb_mat(Q) + arb_mat(Q).transpose()) / 2 for Q in data["Q"]] + [arb_mat(d, d)] * d

    def p(self, y: Any) -> Any:
        """(q, u) (n + d, 1) at y (d, 1), and its derivatives (n + d, d)."""
        bend = arb_mat([(Q * y).entries() for Q in self.Q])
        return self.x + self.V * y + bend * y / 2, self.V + bend

    def place(self, u: Any) -> Any:
        """y (d, 1) and p (n, 1) at u."""
        y = arb_mat([[(2 * arb(x) - a - b) / (arb(b) - a)] for x, (a, b) in zip(u, self.sides, strict=True)])
        return y, arb_mat([[x] for x in self.p(y)[0].entries()[: -len(u)]])


class Verified(NamedTuple):
    """What was found: all of a path or box, and a closed path returns (`whole`); in sentences; the file's own words."""

    whole: bool
    lines: list[str]
    words: str
    data: Any


def shapes_of(data: Any, joints: int, in_time: Any) -> Any:
    """The shapes that are to keep apart, whose checker is in the file beside this one."""
    try:
        from .clear_checker import Clear
    except ImportError:
        from clear_checker import Clear  # type: ignore[no-redef]
    return Clear(data, joints, in_time)


class Checker:
    """Verifies the data of a certificate."""

    def __init__(self, data: Any, say: Any, seconds: float, total: int) -> None:
        self.data, self.claims, self.say, self.until = data, data["claims"], say, time.monotonic() + seconds
        n, d = self.n, self.d = len(data["pieces"][0]["q"]), len(data["pieces"][0]["u"])
        self.joints = len(data["units"])
        need(d == 1 or len(data["pieces"]) == 1, "a box of poses has several pieces")
        need(0 <= self.claims["gap"] <= GAP, f"its gap is no number from 0 to {GAP:g}")
        signed = zip((-math.inf, -math.inf, math.inf, math.inf), self.claims["joints"], strict=True)
        bounds = [[(far if x is None else x) for x in row] for far, row in signed]
        need(all(a < b for a, b in zip(bounds[0], bounds[3], strict=True)), "limits are no limits")
        self.limits, self.least, self.hull = bounds, math.inf, [[math.inf] * n, [-math.inf] * n]
        self.share, self.count, self.moved, self.total = 0.0, 0, [0.0] * n, total
        self.clear = shapes_of(data, self.joints, self.in_time) if "clear" in data else None
        self.one, self.all_y = arb_mat([[int(i == j) for j in range(n)] for i in range(n)]), arb_mat([[UNIT]] * d)
        self.by_y, self.by_s = arb_mat([[1]] * d + [[0]] * n), arb_mat([[0] * n] * d + self.one.tolist())

    def in_time(self) -> None:
        """Raises: TimeoutError."""
        if time.monotonic() > self.until:
            raise TimeoutError("it takes longer than was allowed")

    def value(self, numbers: Any, q: Any, u: Any) -> list[Any]:
        """E (n,) at a posture and a place u."""
        self.in_time()
        values = [arb(x) for x in (*q, *u)] + numbers
        for name, *of in self.data["operations"]:
            values.append(RULES[name](*(values[i] for i in of))[0])
        return [values[i] for i in self.data["outputs"][: self.n]]

    def apart(self, numbers: Any, u: Any, others: Any, v: Any, q: Any) -> list[Any]:
        """By how much E (n,) differs at two places, for one posture q: by how much the tool's poses do."""
        return [a - b for a, b in zip(self.value(numbers, q, u), self.value(others, q, v), strict=True)]

    def periodic(self, turns: Any) -> bool:
        """Whether E stays as it is when the unknowns go on by whole turns (n,): followed through the operations."""
        constants = self.data["constants"]
        known = dict(enumerate(constants, self.n + self.d + len(self.numbers) - len(constants)))
        shifts: list[Any] = [*turns, *[0] * (self.d + len(self.numbers))]
        for name, *of in self.data["operations"]:
            given, shift = [shifts[i] for i in of], None
            if not any(s is None or s for s in given):
                shift = 0
            elif None in given:
                shift = None
            elif name in ("add", "sub"):
                shift = given[0] + given[1] if name == "add" else given[0] - given[1]
            elif name == "mul" and (of[0] in known or of[1] in known):
                factor, turn = (known[of[0]], given[1]) if of[0] in known else (known[of[1]], given[0])
                shift = int(factor) * turn if factor % 1 == 0 else None
            elif name in ("sin", "cos"):
                shift = 0
            shifts.append(None if shift is None or abs(shift) > FAR else shift)
        return all(shifts[i] == 0 for i in self.data["outputs"])

    def enclose(self, cell: Cell, y: Any, s: Any, twice: bool = False) -> Any:
        """E (n, 1) at p(y) + s, and [D] with D = [E_y, E_s] (n, d + n), or [D, D by y_1, ...]; jets are such lists."""
        n, d, orders, rows = self.n, self.d, range(1 + self.d * twice), self.data["outputs"][: self.n]
        self.in_time()
        x, slope = cell.p(y)
        values = [a + b for a, b in zip(x.entries(), s.entries() + [0] * d, strict=True)] + self.numbers
        given = zip(slope.tolist(), self.one.tolist() + [[0] * n] * d, cell.Q, strict=True)
        jets: list[Any] = [[arb_mat([D + e]), *(arb_mat([row + [0] * n]) for row in Q.tolist())] for D, e, Q in given]
        jets += [None] * len(self.numbers)
        for name, *of in self.data["operations"]:
            operands = [jets[i] for i in of]
            value, slopes, bends = RULES[name](*(values[i] for i in of))
            need(all(arb(x).is_finite() for x in (value, *slopes, *bends.values())), "the constraint may have a kink")
            values.append(value)
            sums: list[Any] = [[J[k] * a for J, a in zip(operands, slopes, strict=True) if J] for k in orders]
            for k, ((i, j), a) in product(orders[1:], list(bends.items())):
                if operands[i] and operands[j]:
                    sums[k].append(operands[j][0] * (operands[i][0][0, k - 1] * a))
            jets.append([sum(terms[1:], terms[0]) for terms in sums] if any(operands) else None)
        need(all(values[i] > 0 for i in self.data["outputs"][n:]), "the tool may face the other way")
        D = [arb_mat([jets[i][k].entries() if jets[i] else [0] * (d + n) for i in rows]) for k in orders]
        return arb_mat([[values[i]] for i in rows]), D

    def bounds(self, cell: Cell, s: Any, cuts: int) -> Any:
        """(M, eta) for all y, each cut into so many parts, and a box of s; eta is right where s is 0."""
        parts, half = [], arb(1) / cuts
        for y in (half * arb_mat([[k] for k in place]) for place in product(range(1 - cuts, cuts, 2), repeat=self.d)):
            (E, [first]), (_, bends) = self.enclose(cell, y, s), self.enclose(cell, y + half * self.all_y, s, True)
            once = size(cell.Y * first - self.by_s.transpose())
            twice = half * sum((size(cell.Y * D) for D in bends[1:]), 0 * once)
            parts.append(((once + twice) * self.by_s, size(cell.Y * E) + half * (once + twice / 2) * self.by_y))
        return (size(*bounds) for bounds in zip(*parts, strict=True))

    def prove(self, cell: Cell) -> Cell:
        """The cell with its theorem, and what is claimed of it: with as many parts as that needs."""
        fault = RejectedError("D_q E may be singular")
        for cuts, factor in product([k for k in (1, 2, 4, 8) if k**self.d <= MOST], (3, 2, 1.5)):
            try:
                self.attempt(cell, cuts, factor)
                break
            except RejectedError as problem:
                fault = problem
        else:
            raise fault
        if self.clear is not None:
            self.clear.verify(cell)
        self.say(self.total)
        self.count, self.share = self.count + 1, self.share + math.prod(float(b - a) for a, b in cell.sides)
        return cell

    def attempt(self, cell: Cell, cuts: int, factor: float) -> None:
        """One of them. Raises: RejectedError."""
        M, cell.eta = self.bounds(cell, arb_mat(self.n, 1), cuts)
        margin = arb_mat(self.n, 1, [max(cell.eta.entries()) / 64 + 1e-15] * self.n)
        cell.rho = factor * size(solved(self.one - M, cell.eta + margin))
        cell.M, _ = self.bounds(cell, cell.rho * UNIT, cuts)
        cell.r = size(solved(self.one - cell.M, cell.eta + margin / 64))
        need(below(cell.eta + cell.M * cell.r, cell.r) and below(cell.r, cell.rho), "a posture may be singular")
        determinant = (self.one - cell.M).det() / abs(cell.Y.det())
        need(self.claims["determinant"] <= determinant, "a determinant is less than is claimed")
        around = list(zip(cell.p(self.all_y)[0].entries()[: self.n], cell.r.entries(), strict=True))
        inside = (a <= b <= q - r and q + r <= c <= d for a, b, c, d, (q, r) in zip(*self.limits, around, strict=True))
        need(all(inside), "a joint may leave its limits, or its range")
        self.least = min(self.least, float(determinant.lower()))
        self.hull[0] = [min(a, float((q - r).lower())) for a, (q, r) in zip(self.hull[0], around, strict=True)]
        self.hull[1] = [max(a, float((q + r).upper())) for a, (q, r) in zip(self.hull[1], around, strict=True)]

    def cover(self, tree: Any, sides: Any) -> list[Cell]:
        """The cells of a box of u: one; or null, none; or [axis, at, below, above], those of the two parts of a cut."""
        if not isinstance(tree, list):
            need(bool(tree) or not self.whole, "the cells leave a gap")
            return [self.leaf(tree, sides)] if tree else []
        axis, cut, *halves = tree
        need(sides[axis][0] < cut < sides[axis][1], "a cut is outside of its box")
        parts = [[*sides[:axis], end, *sides[axis + 1 :]] for end in ((sides[axis][0], cut), (cut, sides[axis][1]))]
        lower, upper = (self.cover(half, part) for half, part in zip(halves, parts, strict=True))
        self.meet(lower, upper, axis, cut)
        return lower + upper

    def leaf(self, data: Any, sides: Any) -> Cell:
        """A proven cell."""
        return self.prove(Cell(data, sides))

    def meet(self, lower: list[Cell], upper: list[Cell], axis: int, cut: float) -> None:
        """Join the cells on both sides of a cut."""
        for a, b in product(*([cell for cell in cells if cut in cell.sides[axis]] for cells in (lower, upper))):
            self.join(a, b, axis)

    def join(self, a: Cell, b: Cell, axis: int) -> None:
        """Where two cells meet across an axis, they have one root. Raises: RejectedError."""
        self.in_time()
        pairs = zip(a.sides, b.sides, strict=True)
        face = [(max(low, low_b), min(high, high_b)) for (low, high), (low_b, high_b) in pairs]
        if all(low < high or k == axis for k, (low, high) in enumerate(face)):
            u = [(arb(low) + high) / 2 for low, high in face]
            p, q = (cell.place(u)[1] for cell in (a, b))
            near = below(size(p - q) + a.r, b.rho) or below(size(p - q) + b.r, a.rho)
            need(near or below(size(self.root(a, u) - q), b.rho), "the joints may jump")
            if a.joined is not b.joined:
                fewer, more = sorted((a.joined, b.joined), key=len)
                more.update(fewer)
                for cell in fewer:
                    cell.joined = more

    def away(self, cells: list[Cell], u: Any, q: Any) -> Any:
        """How far the root at u is from the joints q at most. All cells are joined to the one there."""
        holding = [c for c in cells if all(a <= x <= b for x, (a, b) in zip(u, c.sides, strict=True))]
        need(len(holding) > 0 and len(holding[0].joined) == len(cells), f"not all cells are joined to the one at {u}")
        return self.off(holding[0], u, q)

    def off(self, cell: Cell, u: Any, q: Any) -> Any:
        """How far a cell's root at u is from the joints q at most."""
        y, p = cell.place(u)
        s = arb_mat([[x] for x in q]) - p
        need(below(size(s), cell.rho), f"the joints at {u} are not those that reach it")
        return max(size(solved(self.one - cell.M, size(cell.Y * self.enclose(cell, y, s)[0]))).entries())

    def root(self, cell: Cell, u: Any) -> Any:
        """Balls (n, 1) of a cell's root at u."""
        y, p = cell.place(u)
        s = arb_mat(self.n, 1)
        for _ in range(3):
            s = arb_mat([[x.mid()] for x in (s - cell.Y * self.enclose(cell, y, s)[0]).entries()])
        q = [x.mid() for x in (p + s).entries()]
        off = self.off(cell, u, q)
        return arb_mat([[x + off * UNIT] for x in q])

    def verify(self) -> Verified:
        """All that is claimed, and what is found. Raises: RejectedError."""
        data, claims, pieces = self.data, self.claims, self.data["pieces"]
        after, start, turns = [*pieces[1:], pieces[0]], pieces[0]["q"], claims["turns"]
        closed, moved, last, fixed = False, None, [], data["level"] + data["constants"]
        for k, (piece, follower) in enumerate(zip(pieces, after, strict=True)):
            # The cells of a piece, and the posture at its beginning.
            self.whole, is_last = claims["whole"] or k + 1 < len(pieces), k + 1 == len(pieces)
            self.numbers, following = ([arb(x) for x in of["numbers"] + fixed] for of in (piece, follower))
            cells = self.cover(piece["cells"], [(0, 1) if self.d == 1 else (-1, 1)] * self.d)
            u = [0] if self.d == 1 else piece["u"]
            need(self.away(cells, u, piece["q"]) <= claims["gap"], "the start may be no posture of it")
            if self.d == 1:
                # How far the tool goes, and that path and joints go on to the next piece.
                most = max(c.sides[0][1] for c in cells)
                steps = [self.value(self.numbers, piece["q"], [arb(k) / 4 * most]) for k in range(5)]
                for step in pairwise(steps):
                    self.moved = [x + float(abs(a - b).upper()) for x, a, b in zip(self.moved, *step, strict=True)]
                meet = all(abs(x) <= TORN for x in self.apart(self.numbers, [1], following, [0], follower["q"]))
                need(is_last or meet, "the path is torn where pieces meet")
                if not is_last:
                    need(self.away(cells, [1], follower["q"]) <= claims["gap"], "the joints may jump where pieces meet")
                closed, last = meet and claims["whole"], cells
        # The end of a closed path.
        if turns is not None:
            need(closed, "the path is not closed, or not all of it is covered")
            kinds = [*data["units"], *[""] * (self.n - self.joints)]
            need(all(k == 0 or kind == "rad" for k, kind in zip(turns, kinds, strict=True)), "a slider makes turns")
            need(self.periodic(turns), "whole turns may change the tool's pose or the rule")
            q = [x + 2 * arb.pi() * k for x, k in zip(start, turns, strict=True)]
            need(self.away(last, [1], q) <= claims["gap"], "the joints may not return")
        elif closed:
            end = self.root(last[-1], [1]).entries()
            moved = [b - x - claims["gap"] * UNIT for x, b in zip(start, end, strict=True)]
        whole = claims["whole"] and (turns is not None or not closed)
        return Verified(whole, self.lines(closed, turns, moved), self.words(), data)

    def words(self) -> str:
        """Those of the file, which nothing here speaks for."""
        return f"{text_of(self.data.get('title', ''))}; robot {text_of(self.data.get('robot', ''))}"

    def lines(self, closed: bool, turns: Any, moved: Any) -> list[str]:
        """What was verified, in sentences."""
        # The equation.
        n, r, claims, pieces = self.n, len(self.data["level"]), self.claims, self.data["pieces"]
        lines = [
            f"equations: {len(self.data['operations'])} operations for {n} unknowns, {self.joints} of them joints; "
            f"the rule is held at {self.data['level']}",
        ]
        # How large the box is, or how long the path, and how it ends.
        part = 100 * self.share / (2**self.d if self.d > 1 else len(pieces))
        what = "all" if claims["whole"] else f"{part:.3g} %{' of the parameters' * (self.d > 3)}"
        if self.d > 1:
            corners = [[-1 if i == k else 0 for i in range(self.d)] for k in range(self.d)]
            steps = [self.apart(self.numbers, u, self.numbers, [-x for x in u], pieces[0]["q"]) for u in corners]
            wide = ", ".join(f"{float(max(abs(x) for x in step).upper()):.3g}" for step in steps)
            lines.append(f"{what} of a box of poses, whose sides are {wide} in rows of its task: {self.count} cells")
        else:
            rows = ", ".join(f"{x:.4g}" for x in self.moved[: self.joints - r])
            count = "1 piece" if len(pieces) == 1 else f"{len(pieces)} pieces"
            lines.append(
                f"{what} of a path of {count}, in {self.count} cells, on which the tool goes by {rows} "
                "at least, by rows of its task"
            )
            end = "the end was not reached"
            if turns is not None:
                more = f" after the whole turns {turns}" if any(turns) else ""
                end = f"closed: the joints return within {claims['gap']:.2g}{more}"
            elif closed and any(not x.contains(0) for x in moved):
                by = ", ".join(f"{float(x.mid()):.6g}" for x in moved[: self.joints])
                end = f"closed, and the joints do NOT return: they are {by} from where they began"
            elif closed:
                end = "closed, and the joints are not shown to return"
            elif claims["whole"]:
                end = "open"
            lines.append(f"the path is {end}" if claims["whole"] else end)
        # The joints.
        lines.append(f"at each place one posture, no other near, none singular: |det D_q E| >= {DOWN * self.least:.4g}")
        names = self.data.get("names", [])
        for i, low, high in zip(range(self.joints), self.limits[0], self.limits[3], strict=False):
            limits = "no limits" if math.isinf(low) and math.isinf(high) else f"limits {low:.6g} to {high:.6g}"
            name = text_of(names[i]) if isinstance(names, list) and i < len(names) else ""
            hull = f"{self.hull[0][i]:.6g} to {self.hull[1][i]:.6g} {self.data['units'][i]}"
            lines.append(f"joint {i + 1} ({name}): {hull}, {limits}")
        return lines + (self.clear.lines() if self.clear else [])


def check(file: str, say: Any = lambda _cells: None, seconds: float = math.inf, kind: Any = None) -> Verified:
    """What a certificate's file proves. Raises: RejectedError; OSError, ValueError: no certificate; TimeoutError."""
    until = time.monotonic() + seconds
    data, total = read(file, {name: rule.__code__.co_argcount for name, rule in RULES.items()})
    try:
        return (kind or Checker)(data, say, until - time.monotonic(), total).verify()
    except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError, MemoryError) as problem:
        raise RejectedError(f"it is not of its form ({text_of(repr(problem))})") from None


if __name__ == "__main__":
    try:
        allowed = float(sys.argv[2]) if len(sys.argv) > 2 else 3600.0
        verified = check(sys.argv[1], lambda _cells: print(".", end="", file=sys.stderr, flush=True), allowed)
        print("\nVERIFIED:", *verified.lines, f"The file's own words: {verified.words}", sep="\n  ")
    except (RejectedError, OSError, ValueError, LookupError) as problem:
        print("\nREJECTED:" if isinstance(problem, RejectedError) else "\nnot read:", problem)
        sys.exit(1 if isinstance(problem, RejectedError) else 2)
