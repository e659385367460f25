"""The checker: re-verifies a certificate with Arb's balls, sharing no code with the search that found it.

Run by itself, `python -m holokin.proof.checker FILE`, it needs python-flint and this file. It reads the equation E(q, y) as
a list of operations, evaluates it with second derivatives in ball arithmetic [Joh17], repeats the Newton-Kantorovich test of
every cell, and looks at how the cells join. See docs/proof.md for the theorem.
"""

from __future__ import annotations

from itertools import product
from typing import Any

try:
    from flint import arb, arb_mat, ctx
except ImportError:
    arb = None


class Jet:
    """A ball, its first derivatives {i: ball}, its second {(i, j): ball}, i <= j; what is missing is zero."""

    __slots__ = ("d", "h", "v")

    def __init__(self, v: Any, d: dict[int, Any] | None = None, h: dict[tuple[int, int], Any] | None = None) -> None:
        self.v, self.d, self.h = v, d or {}, h or {}

    def of(self, value: Any, slope: Any, bend: Any) -> Jet:
        """f of this, with f' and f''."""
        d = {i: slope * x for i, x in self.d.items()}
        h = {ij: slope * x for ij, x in self.h.items()}
        keys = sorted(self.d)
        for a, i in enumerate(keys):
            for j in keys[a:]:
                h[i, j] = h.get((i, j), 0) + bend * self.d[i] * self.d[j]
        return Jet(value, d, h)

    def plus(self, other: Jet, sign: int = 1) -> Jet:
        """The sum, or the difference."""
        d, h = dict(self.d), dict(self.h)
        for i, x in other.d.items():
            d[i] = d[i] + sign * x if i in d else sign * x
        for ij, x in other.h.items():
            h[ij] = h[ij] + sign * x if ij in h else sign * x
        return Jet(self.v + sign * other.v, d, h)

    def times(self, other: Jet) -> Jet:
        """The product."""
        d = {i: x * other.v for i, x in self.d.items()}
        for i, x in other.d.items():
            d[i] = d[i] + self.v * x if i in d else self.v * x
        h = {ij: x * other.v for ij, x in self.h.items()}
        for ij, x in other.h.items():
            h[ij] = h[ij] + self.v * x if ij in h else self.v * x
        for i, x in self.d.items():
            for j, y in other.d.items():
                ij, term = (i, j) if i <= j else (j, i), x * y if i != j else 2 * x * y
                h[ij] = h[ij] + term if ij in h else term
        return Jet(self.v * other.v, d, h)


def square(a: Jet) -> Jet:
    """a^2."""
    return a.of(a.v * a.v if a.v.abs_lower() > 0 else abs(a.v) ** 2, 2 * a.v, arb(2))


def inverse(a: Jet) -> Jet:
    """1 / a."""
    r = 1 / a.v
    return a.of(r, -r * r, 2 * r * r * r)


def arctan2(y: Jet, x: Jet) -> Jet:
    """atan2(y, x)."""
    r = inverse(square(x).plus(square(y)))
    value = arb.atan2(y.v, x.v)
    d = {i: r.v * (x.v * y.d.get(i, 0) - y.v * x.d.get(i, 0)) for i in {*x.d, *y.d}}
    u, w = Jet(x.v, x.d).times(r), Jet(y.v, y.d).times(r)
    out = Jet(value, d)
    keys = {*x.d, *y.d, *(i for ij in {*x.h, *y.h} for i in ij)}
    for i, j in product(sorted(keys), repeat=2):
        if i <= j:
            bend = u.v * y.h.get((i, j), 0) - w.v * x.h.get((i, j), 0)
            out.h[i, j] = bend + u.d.get(j, 0) * y.d.get(i, 0) - w.d.get(j, 0) * x.d.get(i, 0)
    return out


UNARY = {
    "neg": lambda a: Jet(-a.v, {i: -x for i, x in a.d.items()}, {ij: -x for ij, x in a.h.items()}),
    "twice": lambda a: a.plus(a), "sq": square, "inv": inverse, "assign": lambda a: a,
    "sin": lambda a: a.of(a.v.sin(), a.v.cos(), -a.v.sin()), "cos": lambda a: a.of(a.v.cos(), -a.v.sin(), -a.v.cos()),
    "exp": lambda a: a.of(a.v.exp(), a.v.exp(), a.v.exp()), "log": lambda a: a.of(a.v.log(), 1 / a.v, -1 / (a.v * a.v)),
    "sqrt": lambda a: a.of(a.v.sqrt(), 1 / (2 * a.v.sqrt()), -1 / (4 * a.v * a.v.sqrt())),
    "atan": lambda a: a.of(a.v.atan(), 1 / (1 + a.v * a.v), -2 * a.v / (1 + a.v * a.v) ** 2),
}  # fmt: skip
BINARY = {
    "add": lambda a, b: a.plus(b), "sub": lambda a, b: a.plus(b, -1), "mul": lambda a, b: a.times(b),
    "div": lambda a, b: a.times(inverse(b)), "atan2": arctan2,
}  # fmt: skip


def evaluated(operations: list[list[Any]], inputs: list[Jet]) -> list[Jet]:
    """The results of a list of operations: ["const", x], ["input", i], [name, place, ...], ["output", place]."""
    values: list[Jet] = []
    results = []
    for name, *of in operations:
        if name == "output":
            results.append(values[of[0]])
        elif name == "const":
            values.append(Jet(arb(of[0])))
        elif name == "input":
            values.append(inputs[of[0]])
        else:
            values.append({**UNARY, **BINARY}[name](*(values[i] for i in of)))
    return results


def ball(low: Any, high: Any) -> Any:
    """The ball around two numbers or balls."""
    return arb(low).union(arb(high))


def norm(M: Any) -> Any:
    """An upper bound of the 2-norm: |(M M^T)^4|_F^(1/8)."""
    S = M * M.transpose()
    S = S * S
    S = S * S
    total = sum((x * x for x in S.entries()), arb(0)).upper()
    return total.root(16).upper() if total > 0 else arb(0)


class Checker:
    """The cells of a certificate, one by one."""

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.n, self.d = data["joints"], data["parameters"]
        self.operations, self.c = data["equation"], [arb(x) for x in data["level"]]
        self.weights = {(i, j): 0.5 if i == j else 1 for i in range(self.d) for j in range(i, self.d)}

    def predicted(self, cell: dict[str, Any], y: list[Any]) -> list[Any]:
        """q(y) = q0 + V y + 1/2 Q y y."""
        pairs = list(self.weights.items())
        return [
            arb(q) + sum((arb(v) * t for v, t in zip(row, y, strict=True)), arb(0))
            + sum((arb(b) * w * y[i] * y[j] for b, ((i, j), w) in zip(bend, pairs, strict=True)), arb(0))
            for q, row, bend in zip(cell["q0"], cell["V"], cell["Q"], strict=True)
        ]  # fmt: skip

    def jets(self, q: list[Any], y: list[Any], cell: dict[str, Any], order: bool) -> tuple[Any, Any, Any, Any]:
        """(E, D_q E, second derivatives by q, D_y D_q E) as matrices; facing is checked."""
        n, d = self.n, self.d
        first = [Jet(x, {i: arb(1)}) for i, x in enumerate([*q, *y])]
        rest = [Jet(arb(x)) for x in cell["numbers"]] + [Jet(x) for x in self.c]
        *E, facing = evaluated(self.operations, first + rest)
        if order and not facing.v > 0:
            raise ArithmeticError("the tool may face the other way")
        A = arb_mat([[e.d.get(j, arb(0)) for j in range(n)] for e in E])
        H = arb_mat([[e.h.get((min(j, k), max(j, k)), arb(0)) for j in range(n) for k in range(n)] for e in E])
        M = arb_mat([[e.h.get((j, n + k), arb(0)) for j in range(n) for k in range(d)] for e in E])
        return arb_mat([[self.wrapped(e.v, i)] for i, e in enumerate(E)]), A, H, M

    def wrapped(self, value: Any, row: int) -> Any:
        """A row of g that is an angle, less whole turns."""
        if not self.data["angular"][row]:
            return value
        return value - 2 * arb.pi() * round(float(value.mid()) / 6.283185307179586)

    def cell(self, cell: dict[str, Any]) -> tuple[Any, Any, list[Any]]:
        """(r, how far its root is alone, hull of the joints), as `ArithmeticError` where the theorem does not hold."""
        n, d, rho = self.n, self.d, arb(cell["rho"])
        zero, box = [arb(0)] * d, [arb(0, 1)] * d
        center = [arb(x) for x in cell["q0"]]
        E, A, _, _ = self.jets(center, zero, cell, False)
        Y = A.mid().inv().mid()
        along = self.predicted(cell, box)
        reach = [
            sum((abs(arb(v)) for v in row), arb(0))
            + sum((abs(arb(b)) * w for b, w in zip(bend, self.weights.values(), strict=True)), arb(0))
            for row, bend in zip(cell["V"], cell["Q"], strict=True)
        ]
        hull = [q + arb(0, 1) * (s.upper()) for q, s in zip(center, reach, strict=True)]
        _, _, H, M = self.jets([q + arb(0, 1) * rho for q in hull], box, cell, True)
        omega = norm(Y * H)
        e = norm(Y * A - arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)]))
        e += omega * sum((s * s for s in reach), arb(0)).sqrt().upper() + norm(Y * M) * arb(d).sqrt()
        eta = norm(Y * E) + norm(Y) * arb(self.data["slack"])
        first, second = self.derivatives(cell, zero, center, A), self.derivatives(cell, box, along, None)
        for i in range(d):
            eta += norm(Y * first[i])
        for ij, weight in self.weights.items():
            eta += norm(Y * second[ij]) * weight
        e, eta = e.upper(), eta.upper()
        gap = (1 - e) ** 2 - 2 * omega * eta
        if not (e < 1 and gap >= 0):
            raise ArithmeticError(f"the test fails: e {float(e):.3g}, omega {float(omega):.3g}, eta {float(eta):.3g}")
        r = (2 * eta / (1 - e + gap.sqrt())).upper()
        other = (2 * (1 - e) / omega - r).lower()
        if not r <= rho:
            raise ArithmeticError("the root may lie outside the tube")
        return r, rho if rho < other else other, [q + arb(0, 1) * r for q in hull]

    def derivatives(self, cell: dict[str, Any], y: list[Any], q: list[Any], _: Any) -> dict[Any, Any]:
        """First (by i) and second (by (i, j)) derivatives of E(q(y), y) by y, columns (n, 1)."""
        d = self.d
        inputs = []
        for k, value in enumerate(q):
            bend = {}
            slope = {i: arb(cell["V"][k][i]) for i in range(d)}
            for p, (i, j) in enumerate(self.weights):
                b = arb(cell["Q"][k][p])
                bend[i, j] = b
                slope[i] += b * y[j]
                if i != j:
                    slope[j] += b * y[i]
            inputs.append(Jet(value, slope, bend))
        inputs += [Jet(t, {i: arb(1)}) for i, t in enumerate(y)]
        inputs += [Jet(arb(x)) for x in cell["numbers"]] + [Jet(x) for x in self.c]
        *E, _facing = evaluated(self.operations, inputs)
        found: dict[Any, Any] = {i: arb_mat([[e.d.get(i, arb(0))] for e in E]) for i in range(d)}
        return found | {ij: arb_mat([[e.h.get(ij, arb(0))] for e in E]) for ij in self.weights}
