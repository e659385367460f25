"""The part of the checker that is about shapes: over each cell planes separate the pairs that are to keep apart.

The certificate holds the joints of the robot as a tree, shapes as points with a radius, pairs of shapes with the
distance that is claimed, and for each cell a plane for each pair, as a normal m in the frame of the pair's one shape A;
a half space, as the floor, has a normal of its own.
Seen from A the height w = m . b of a point b of the other shape is a function of the joints, and over a cell, q = p(y)
+ s with |s| <= r, by the mean value theorem

    w >= w(p(0)) - sum_k |grad w . D_k p| - |grad w| . r,   grad w . e_i = m . (z_i x (b - o_i)), or m . z_i,

with grad w over the whole cell as balls. It needs python-flint and the file checker.py beside this one.
"""

import hashlib
import json
from itertools import product
from typing import Any

from flint import arb, arb_mat

UNIT, CUTS, DOWN = arb(0, 1), (1, 2, 3), 1 - 5.1e-4  # .4g of a number times DOWN is below it


EVEN = arb(1e-10)
"""By how much a rotation may be none."""


class Clear:
    """The shapes of a certificate's data; `least` is the smallest distance that was verified of each pair."""

    def __init__(self, data: Any, joints: int, need: Any, in_time: Any) -> None:
        clear, self.need, self.in_time, self.n = data["clear"], need, in_time, joints
        self.joints, self.shapes, self.pairs = clear["joints"], clear["shapes"], clear["pairs"]
        for joint in self.joints:
            turn, axis = _matrix(joint["placement"]), _column(joint["axis"])
            near = (*(turn.transpose() * turn - _one()).entries(), (axis.transpose() * axis)[0, 0] - 1)
            need(all(abs(x) < EVEN for x in near), "a joint is no rotation, or its axis not of length 1")
        for shape in self.shapes:
            for corner in shape["holds"]:
                in_time()
                away = (
                    sum(((arb(a) - b) ** 2 for a, b in zip(corner, p, strict=True)), arb(0)) for p in shape["points"]
                )
                need(any(d.sqrt() <= shape["radius"] for d in away), "a corner of a mesh is outside of its shape")
        for pair in self.pairs:
            one, other = (self.shapes[i] for i in pair["shapes"])
            need(not other["normal"], "a half space is held against another")
            need(sorted(pair["names"]) == sorted([one["link"], other["link"]]), "names are not those of shapes")
        self.placed = [(_matrix(j["placement"]), _column(j["origin"])) for j in self.joints]
        self.points = [arb_mat(shape["points"]).transpose() for shape in self.shapes]
        self.paths = [self.path(*(self.shapes[i]["joint"] for i in pair["shapes"])) for pair in self.pairs]
        self.least = [arb("inf")] * len(self.pairs)

    def path(self, one: int, other: int) -> list[tuple[int, int]]:
        """(joint, sign) of the joints between two: those of the other side push it, those of the one side away."""
        self.in_time()
        a, b = self.above(one), self.above(other)
        both = {*a} & {*b}
        return [(j, -1) for j in a if j not in both] + [(j, 1) for j in b if j not in both]

    def above(self, joint: int) -> list[int]:
        """A joint and all before it."""
        found = []
        while joint >= 0:
            found.append(joint)
            joint = self.joints[joint]["parent"]
        return found

    def frames(self, q: Any) -> Any:
        """(R, p, axis) of each joint's moving frame, in that of the base, which is the last one."""
        base = _one(), arb_mat(3, 1)
        found: list[Any] = []
        for joint, (turn, shift) in zip(self.joints, self.placed, strict=True):
            R, p = found[joint["parent"]][:2] if joint["parent"] >= 0 else base
            p, R, axis = p + R * shift, R * turn, _column(joint["axis"])
            value = joint["multiplier"] * q[joint["coordinate"]] + joint["offset"]
            if joint["kind"] == "prismatic":
                p = p + R * axis * value
            else:
                R = R * _turned(joint["axis"], value)
            found.append((R, p, R * axis))
        return [*found, (*base, None)]

    def verify(self, cell: Any) -> None:
        """All pairs over a cell whose roots are shown to be within r of its predictor, cut where that is too coarse."""
        self.need(len(cell.planes) == len(self.pairs), "a cell has other planes than pairs")
        open_pairs, d, best = list(range(len(self.pairs))), len(cell.sides), {}
        for cuts in CUTS:
            half, found = arb(1) / cuts, dict.fromkeys(open_pairs, arb("inf"))
            for at in product(range(1 - cuts, cuts, 2), repeat=d):
                y = half * arb_mat([[k] for k in at])
                for i, low in zip(open_pairs, self.part(cell, y, half, open_pairs), strict=True):
                    found[i] = _smaller(found[i], low)
            best |= found
            open_pairs = [i for i in open_pairs if not best[i] >= self.pairs[i]["apart"]]
            if not open_pairs:
                break
        names = [" and ".join(map(_printable, self.pairs[i]["names"])) for i in open_pairs]
        self.need(not open_pairs, f"{', '.join(names[:1])} may be nearer than is claimed")
        self.least = [_smaller(a, best[i]) for i, a in enumerate(self.least)]

    def part(self, cell: Any, y: Any, half: Any, pairs: Any) -> Any:
        """Lower bounds of distances over the part of a cell within `half` of y."""
        n, middle = self.n, cell.p(y)[0].entries()[: self.n]
        around = y + half * arb_mat([[UNIT]] * len(cell.sides))
        slope = arb_mat(cell.p(around)[1].tolist()[:n]) * half
        whole = [a + r * UNIT for a, r in zip(cell.p(around)[0].entries(), cell.r.entries(), strict=False)][:n]
        here, over = self.frames(middle), self.frames(whole)
        r = [x.upper() for x in cell.r.entries()[:n]]
        return [self.bound(i, cell.planes[i], here, over, slope, r) for i in pairs]

    def bound(self, i: int, normal: Any, here: Any, over: Any, slope: Any, r: Any) -> Any:
        """That of a pair."""
        self.in_time()
        one, other = (self.shapes[k] for k in self.pairs[i]["shapes"])
        points = [self.points[k] for k in self.pairs[i]["shapes"]]
        m = _column(one["normal"] or normal)
        length = sum((x * x for x in m.entries()), arb(0)).sqrt()
        self.need(length > 0, "a plane has no normal")
        (R, p, _), (S, x, _) = here[one["joint"]], here[other["joint"]]
        fixed = (m.transpose() * points[0]).entries()
        seen = ((R * m).transpose() * S * points[1]).entries()
        shift = ((R * m).transpose() * (x - p)).entries()[0]
        m_over = over[one["joint"]][0] * m
        S, x, _ = over[other["joint"]]
        placed = S * points[1]
        slopes = [[arb(0)] * self.n for _ in seen]
        for index, sign in self.paths[i]:
            joint, (_, o, z) = self.joints[index], over[index]
            gain, c = sign * joint["multiplier"], joint["coordinate"]
            if joint["kind"] == "prismatic":
                rises = [(m_over.transpose() * z).entries()[0]] * len(seen)
            else:
                u = _cross(m_over.entries(), z.entries())
                offset = (u.transpose() * (x - o)).entries()[0]
                rises = [v + offset for v in (u.transpose() * placed).entries()]
            for row, rise in zip(slopes, rises, strict=True):
                row[c] += gain * rise
        moved = (arb_mat(slopes) * slope).tolist()
        lows = []
        for at, row, along in zip(seen, slopes, moved, strict=True):
            spread = sum((abs(v) for v in along), arb(0)) + sum(
                (abs(v) * s for v, s in zip(row, r, strict=True)), arb(0)
            )
            lows.append(at + shift - spread)
        behind = max((v.upper() for v in fixed), default=arb(0))
        return (min(v.lower() for v in lows) - behind) / length - one["radius"] - other["radius"]

    def lines(self) -> list[str]:
        """What was verified, in sentences."""
        found = []
        for pair, least in zip(self.pairs, self.least, strict=True):
            one, other = (_printable(name) for name in pair["names"])
            far = float(least.lower()) * DOWN
            found.append(f"{one} and {other}: {far:.4g} m apart or more, {pair['apart']:.4g} claimed")
        return found + self.still()

    def still(self) -> list[str]:
        """Where the shapes of these pairs are that do not move."""
        found, used = [], sorted({i for pair in self.pairs for i in pair["shapes"]})
        for shape in (self.shapes[i] for i in used if self.shapes[i]["joint"] < 0):
            name, points, radius = _printable(shape["link"]), shape["points"], shape["radius"]
            rows = [[point[i] for point in points] for i in range(3)]
            sides = [" to ".join(f"{x:.4g}" for x in (min(row) - radius, max(row) + radius)) for row in rows]
            solid = "all below {} along {}".format(points[0], shape["normal"]) if shape["normal"] else " x ".join(sides)
            found.append(f"{name} stands still: {solid} m, {len(points)} points, {digest_of(shape)}")
        return found


def digest_of(shape: Any) -> str:
    """Of a shape the first digits of the SHA-256 of its points, radius and normal."""
    numbers = [[[float(x) for x in p] for p in shape["points"]], float(shape["radius"]), shape["normal"]]
    return f"SHA-256 {hashlib.sha256(json.dumps(numbers).encode()).hexdigest()[:12]}"


def _smaller(a: Any, b: Any) -> Any:
    return min(a.lower(), b.lower())


def _printable(name: Any) -> str:
    return "".join(c if c.isprintable() else "?" for c in str(name)[:60])


def _one() -> Any:
    return arb_mat([[int(i == j) for j in range(3)] for i in range(3)])


def _matrix(rows: Any) -> Any:
    return arb_mat(rows)


def _column(values: Any) -> Any:
    return arb_mat([[x] for x in values])


def _cross(a: Any, b: Any) -> Any:
    return _column([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _turned(axis: Any, angle: Any) -> Any:
    """The rotation about an axis, by Rodrigues: 1 + sin K + (1 - cos) K^2."""
    x, y, z = axis
    K = arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return _one() + K * angle.sin() + K * K * (1 - angle.cos())
