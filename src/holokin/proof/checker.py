"""The checker: verifies a certificate again with Arb's balls [Joh17], sharing no code with the search that found it.

It needs python-flint and this file alone: `python checker.py FILE`. It reads E(q, y) as a list of operations, encloses
it with its derivatives, repeats the Newton-Kantorovich test of every cell, and looks at how cells join: docs/proof.md.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

from flint import arb, arb_mat, ctx

ctx.prec = 80
UNIT, NAN = arb(0, 1), arb("nan")
Jet = tuple[Any, Any, Any]
"""A ball, its gradient (1, N) and its second derivatives (N, N)."""


class RejectedError(Exception):
    """The certificate does not prove what it says; the message tells what fails."""


def need(true: bool, what: str) -> None:
    """Raises: RejectedError."""
    if not true:
        raise RejectedError(what)


def sign(a: Any) -> Any:
    """1 or -1; no number where that is not known, so that no test passes."""
    return arb(1) if a > 0 else arb(-1) if a < 0 else NAN


def unary(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The rule of a function of one number from (f, f', f'')."""
    return lambda a: ((found := f(a))[0], (found[1],), {(0, 0): found[2]})


def arctan2(y: Any, x: Any) -> Any:
    """Across its cut the value is no number; the derivatives are."""
    r = 1 / (abs(x) ** 2 + abs(y) ** 2)
    bends = {(0, 0): -2 * x * y * r * r, (0, 1): (y * y - x * x) * r * r, (1, 1): 2 * x * y * r * r}
    return arb.atan2(y, x) if x > 0 or y > 0 or y < 0 else NAN, (x * r, -y * r), bends


RULES: dict[str, Callable[..., Any]] = {  # of balls: (value, slopes, second derivatives)
    "add": lambda a, b: (a + b, (1, 1), {}), "sub": lambda a, b: (a - b, (1, -1), {}), "atan2": arctan2,
    "mul": lambda a, b: (a * b, (b, a), {(0, 1): 1}), "sq": unary(lambda a: (abs(a) ** 2, 2 * a, 2)),
    "div": lambda a, b: (a / b, (1 / b, -a / b**2), {(0, 1): -1 / b**2, (1, 1): 2 * a / b**3}),
    "neg": unary(lambda a: (-a, -1, 0)), "twice": unary(lambda a: (2 * a, 2, 0)), "assign": unary(lambda a: (a, 1, 0)),
    "inv": unary(lambda a: (1 / a, -1 / a**2, 2 / a**3)), "log": unary(lambda a: (a.log(), 1 / a, -1 / a**2)),
    "sqrt": unary(lambda a: (a.sqrt(), a.rsqrt() / 2, -(a.rsqrt() ** 3) / 4)), "exp": unary(lambda a: [a.exp()] * 3),
    "sin": unary(lambda a: (a.sin(), a.cos(), -a.sin())), "cos": unary(lambda a: (a.cos(), -a.sin(), -a.cos())),
    "tan": unary(lambda a: (t := a.tan(), s := 1 + t * t, 2 * t * s)),
    "fabs": unary(lambda a: (a * (s := sign(a)), s, 0)),
    "atan": unary(lambda a: (a.atan(), r := 1 / (1 + abs(a) ** 2), -2 * a * r * r)),
    "asin": unary(lambda a: (a.asin(), r := (1 - a * a).rsqrt(), a * r**3)),
    "acos": unary(lambda a: (a.acos(), -(r := (1 - a * a).rsqrt()), -a * r**3)),
    "copysign": lambda a, b: (a * (s := sign(a) * sign(b)), (s, 0), {}), "constpow": lambda a, b: RULES["pow"](a, b),
    "pow": lambda a, b: (a**b, (b * a ** (b - 1), 0 if b.is_exact() else NAN), {(0, 0): b * (b - 1) * a ** (b - 2)}),
}  # fmt: skip


def operate(name: str, args: list[Jet]) -> Jet:
    """An operation of jets, by the chain rule."""
    need(name in RULES, f"the operation {name!r} has no rule")
    value, slopes, bends = RULES[name](*(a[0] for a in args))
    slope = sum((a[1] * s for a, s in zip(args[1:], slopes[1:], strict=True)), args[0][1] * slopes[0])
    bend = sum((a[2] * s for a, s in zip(args[1:], slopes[1:], strict=True)), args[0][2] * slopes[0])
    for (i, j), b in bends.items():
        outer = args[i][1].transpose() * args[j][1] * b
        bend = bend + outer if i == j else bend + outer + outer.transpose()
    return value, slope, bend


def jet(v: Any, N: int, at: int | None = None) -> Jet:
    """A variable, number `at` of N, or a constant."""
    return arb(v), arb_mat(1, N, [int(i == at) for i in range(N)]), arb_mat(N, N)


def norm(M: Any) -> Any:
    """An upper bound of the 2-norm: |(M M^T)^4|_F^(1/8)."""
    S = M * M.transpose()
    S = S * S
    total = sum((x * x for x in (S * S).entries()), arb(0)).upper()
    return total if total == 0 else total.root(16).upper()


class Checker:
    """A certificate, as read from its file."""

    def __init__(self, data: dict[str, Any]) -> None:
        text = json.dumps({key: value for key, value in data.items() if key != "sha256"}, sort_keys=True)
        need(hashlib.sha256(text.encode()).hexdigest() == data["sha256"], "the file is not as written: SHA-256")
        self.data, self.n, self.d, self.slack = data, data["joints"], data["parameters"], arb(data["slack"])

    def predicted(self, cell: dict[str, Any], y: list[Any]) -> list[Jet]:
        """q(y) = q0 + V y + 1/2 Q y y, and its derivatives."""
        t, found = arb_mat([[x] for x in y]), []
        for q, V, Q in zip(cell["q0"], cell["V"], cell["Q"], strict=True):
            V, Q = arb_mat([V]), arb_mat(Q)
            found.append(((V * t)[0, 0] + (t.transpose() * Q * t)[0, 0] / 2 + q, V + (Q * t).transpose(), Q))
        return found

    def outputs(self, cell: dict[str, Any], q: list[Jet], y: list[Jet]) -> list[Jet]:
        """E (n,), what must be positive, and what of the tool pose enters E."""
        sides = [(arb(a), arb(b)) for a, b in zip(cell["low"], cell["high"], strict=True)]
        rest = [*self.data["pieces"][cell["piece"]]["numbers"], *((a + b) / 2 for a, b in sides)]
        rest += [*((b - a) / 2 for a, b in sides), *self.data["level"]]
        N, values = q[0][1].ncols(), []
        inputs = [*q, *y, *(jet(x, N) for x in rest)]
        for name, *of in self.data["equation"]:
            if name in ("const", "input", "output"):
                values.append(jet(of[0], N) if name == "const" else (inputs if name == "input" else values)[of[0]])
            else:
                values.append(operate(name, [values[i] for i in of]))
        return values[-sum(name == "output" for name, *_ in self.data["equation"]) :]

    def cell(self, cell: dict[str, Any]) -> tuple[list[Any], Any, Any]:
        """The theorem of a cell: (hull of its joints, a bound of |det D_q E|, how far a root moves with the pose)."""
        n, d, r, rho, flags = self.n, self.d, arb(cell["r"]), arb(cell["rho"]), self.data["angular"]
        y = [jet(UNIT, n + d, n + i) for i in range(d)]
        start = [jet(x, n + d, i) for i, x in enumerate(cell["q0"])]
        here = self.outputs(cell, start, [(arb(0), *t[1:]) for t in y])[:n]
        turn = [
            2 * arb.pi() * round(float(E[0].mid()) / math.tau) if a else 0 for E, a in zip(here, flags, strict=True)
        ]
        E = [E[0] - whole for E, whole in zip(here, turn, strict=True)]
        A, B = (arb_mat([[E[1][0, j] for j in of] for E in here]) for of in (range(n), range(n, n + d)))
        Y, V = A.mid().inv().mid(), arb_mat(cell["V"])
        along = self.predicted(cell, [UNIT] * d)
        bent = self.outputs(cell, along, [jet(UNIT, d, i) for i in range(d)])[:n]
        *wide, facing = self.outputs(cell, [jet(p[0] + UNIT * rho, n + d, i) for i, p in enumerate(along)], y)[: n + 1]
        need(facing[0] > 0, "the tool may face the other way")
        need(all(a or E[0].is_finite() for E, a in zip(wide, flags, strict=True)), "the constraint may jump")
        omega = norm(Y * arb_mat([[E[2][j, k] for j in range(n) for k in range(n)] for E in wide]))
        mixed = norm(Y * arb_mat([[E[2][j, k] for j in range(n) for k in range(n, n + d)] for E in wide]))
        way = max(norm(V * arb_mat([[s] for s in (1, *signs)])) for signs in product((-1, 1), repeat=d - 1))
        eta = norm(Y * arb_mat([[x] for x in E])) + norm(Y) * self.slack
        eta += sum(norm(Y * (A * V + B) * arb_mat([[int(i == j)] for j in range(d)])) for i in range(d))
        for i, j in product(range(d), repeat=2):
            way += norm(arb_mat([[p[2][i, j] / 2] for p in along]))
            eta += norm(Y * arb_mat([[E[2][i, j] / 2] for E in bent]))
        off = Y * A - arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
        e = norm(off) + omega * way + mixed * arb(d).sqrt()
        test = [eta - (1 - e) * x + omega * x * x / 2 for x in (r, rho)]
        need(test[0] <= 0 and test[1] < 0 and 0 < r < rho, "the Newton-Kantorovich test fails")
        left = (1 - e - omega * r).lower()
        need(left > 0, "[J; J_g] may be singular")
        return [p[0] + UNIT * r for p in along], left**n / abs(Y.det()), norm(Y) / left

    def glued(self, one: Any, other: Any, ends: tuple[Any, Any], turns: list[int]) -> None:
        """The root of one cell at its end is the only root of the other at its own, but for whole turns."""
        q = []
        for c, x in ((one, ends[0]), (other, ends[1])):
            sides = zip(x, c["low"], c["high"], strict=True)
            q.append(self.predicted(c, [(2 * arb(t) - a - b) / (arb(b) - a) if a < b else 0 for t, a, b in sides]))
        apart = norm(arb_mat([[a[0] - b[0] - 2 * arb.pi() * k] for a, b, k in zip(*q, turns, strict=True)]))
        need(apart + one["r"] <= other["rho"], "the joints may jump between two cells")

    def seam(self, one: Any, other: Any, turns: list[int]) -> Any:
        """Where pieces of a path meet their poses agree within the slack, the roots but for whole turns. Their gap."""
        self.glued(one, other, (one["high"], other["low"]), turns)
        ends = ((c, [jet(x, 1) for x in c["q0"]], [jet(y, 1)]) for c, y in ((one, 1), (other, -1)))
        poses = [self.outputs(*end)[self.n + 1 :] for end in ends]
        gap = norm(arb_mat([[a[0] - b[0]] for a, b in zip(*poses, strict=True)]))
        need(gap <= self.slack, "pieces of the path do not meet")
        moved: list[Any] = []  # whether a value changes with the turns, by whole turns
        rows = [*self.data["angular"], *[False] * (1 + len(poses[0]))]
        for name, *of in self.data["equation"]:
            given = name in ("const", "input")
            turned = name == "input" and of[0] < self.n and turns[of[0]] != 0
            moved.append(turned or (not given and name not in ("sin", "cos") and any(moved[i] for i in of)))
            angle = name == "output" and rows.pop(0)
            need(not moved[-1] or angle or name in ("input", "add", "sub", "neg"), "whole turns change the equation")
        return gap

    def piece(self, low: list[float], high: list[float], cells: list[Any]) -> None:
        """Cells lie beside each other, share roots where they touch, and fill it; but for a part of a box of poses."""
        axes = range(self.d)
        left = math.prod(Fraction(high[a]) - Fraction(low[a]) for a in axes)
        cells.sort(key=lambda c: c["low"])
        for k, one in enumerate(cells):
            sides = zip(low, one["low"], one["high"], high, strict=True)
            need(all(first <= a < b <= last for first, a, b, last in sides), "a cell reaches too far")
            left -= math.prod(Fraction(one["high"][a]) - Fraction(one["low"][a]) for a in axes)
            for other in cells[k + 1 :]:
                if other["low"][0] > one["high"][0]:
                    break
                common = [(max(one["low"][a], other["low"][a]), min(one["high"][a], other["high"][a])) for a in axes]
                apart = [b - a for a, b in common if b <= a]
                need(len(apart) > 0, "cells overlap")
                if apart == [0]:
                    middle = [(arb(a) + b) / 2 for a, b in common]
                    self.glued(one, other, (middle, middle), [0] * self.n)
        need(left == 0 or (self.d > 1 and not self.data["whole"]), "the cells leave a gap")

    def verify(self, say: Callable[[int], None] = lambda _done: None) -> None:
        """All that is claimed. Raises: RejectedError; others where the data are no certificate."""
        data, claims = self.data, self.data["claims"]
        need(data["slack"] >= 0, "the slack is negative")
        bounds = data["limits"] or [[None] * self.n] * 2
        for a, low, high, b in zip(bounds[0], claims["low"], claims["high"], bounds[1], strict=True):
            need((a is None or a <= low) and (b is None or high <= b), "a joint may leave its limits")
        for k, cell in enumerate(data["cells"]):
            try:
                hull, determinant, _ = self.cell(cell)
            except (RejectedError, ZeroDivisionError) as problem:
                raise RejectedError(f"cell {k + 1}: {problem}") from None
            within = (a <= q and q <= b for a, q, b in zip(claims["low"], hull, claims["high"], strict=True))
            need(all(within), f"cell {k + 1}: a joint may leave the hull")
            need(claims["determinant"] <= determinant, f"cell {k + 1}: the determinant may be smaller")
            say(k + 1)
        pieces = [[c for c in data["cells"] if c["piece"] == k] for k in range(len(data["pieces"]))]
        for k, (piece, cells) in enumerate(zip(data["pieces"], pieces, strict=True)):
            part = self.d == 1 and not data["whole"] and k == len(pieces) - 1  # of a path: up to its last cell
            self.piece(
                piece["low"], max((c["high"] for c in cells), default=piece["low"]) if part else piece["high"], cells
            )
        for one, other in pairwise(pieces):
            self.seam(one[-1], other[0], [0] * self.n)
        if "turns" in claims:
            gap = self.cell(pieces[0][0])[2] * self.seam(pieces[-1][-1], pieces[0][0], claims["turns"])
            need(data["whole"] and gap <= claims["gap"], "the joints may end farther from where they began")


def check(file: str, say: Callable[[int, int], None] = lambda _done, _all: None) -> dict[str, Any]:
    """The content of a certificate, verified. Raises: RejectedError; OSError, ValueError: no certificate."""
    with open(file, encoding="utf-8") as stream:
        data = json.load(stream)
    try:
        Checker(data).verify(lambda done: say(done, len(data["cells"])))
    except (LookupError, TypeError, AttributeError) as problem:
        raise ValueError(f"not a certificate of this format ({problem!r})") from None
    return data


if __name__ == "__main__":
    try:
        found = check(sys.argv[1], lambda done, of: print(f"\r{done} of {of} cells", end="", file=sys.stderr))
        sys.exit(
            print(f"\rVERIFIED: {len(found['cells'])} cells, {'all' if found['whole'] else 'a part'} of what was asked")
        )
    except RejectedError as problem:
        print(f"\rREJECTED: {problem}")
        sys.exit(1)
    except (OSError, ValueError, LookupError) as problem:
        print(f"\rnot read: {problem}")
        sys.exit(2)
