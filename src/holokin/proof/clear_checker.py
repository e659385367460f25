"""The part of the checker that is about shapes: over each cell planes separate the pairs that are to keep apart.

The certificate holds the joints of the robot as a tree, shapes as points with a radius, pairs of shapes with the
distance that is claimed, and for each cell a plane for each pair, as a normal m in the frame of the pair's one shape A;
a half space, as the floor, has a normal of its own.
Seen from A the height w = m . b of a point b of the other shape is a function of the joints, and over a cell, q = p(y)
+ s with |s| <= r, by the mean value theorem

    w >= w(p(0)) - sum_k |grad w . D_k p| - |grad w| . r,   grad w . e_i = m . (z_i x (b - o_i)), or m . z_i,

with grad w over the whole cell as balls. It needs python-flint and the file checker_file.py beside this one.
"""

import hashlib
import json
from itertools import product
from typing import Any

from flint import arb, arb_mat

try:
    from .checker_file import need, text_of
except ImportError:  # it runs alone
    from checker_file import need, text_of  # type: ignore[no-redef]

UNIT, CUTS, DOWN = arb(0, 1), (1, 2, 3), 1 - 5.1e-4  # .4g of a number times DOWN is below it


class Clear:
    """The shapes of a certificate's data; `least` is the smallest distance that was verified of each pair."""

    def __init__(self, data: Any, joints: int, in_time: Any) -> None:
        clear, self.in_time, self.n = data["clear"], in_time, joints
        self.joints, self.shapes, self.pairs = clear["joints"], clear["shapes"], clear["pairs"]
        self.placed = [(arb_mat(j["placement"]), _column(j["origin"])) for j in self.joints]
        for joint, (turn, _) in zip(self.joints, self.placed, strict=True):
            axis = _column(joint["axis"])
            errors = (*(turn.transpose() * turn - _identity()).entries(), (axis.transpose() * axis)[0, 0] - 1)
            need(all(abs(x) < arb(1e-10) for x in errors), "a joint is no rotation, or its axis not of length 1")
        for shape in self.shapes:
            for corner in map(_column, shape["holds"]):
                in_time()
                steps = [(corner - _column(point)).entries() for point in shape["points"]]
                near = any(sum((x * x for x in step), arb(0)).sqrt() <= shape["radius"] for step in steps)
                need(near, "a corner of a mesh is outside of its shape")
        for pair in self.pairs:
            a, b = (self.shapes[i] for i in pair["shapes"])
            need(not b["normal"], "a half space is held against another")
            need(sorted(pair["names"]) == sorted([a["link"], b["link"]]), "names are not those of shapes")
        self.points = [arb_mat(shape["points"]).transpose() for shape in self.shapes]
        self.paths = [self.path(*(self.shapes[i]["joint"] for i in pair["shapes"])) for pair in self.pairs]
        self.least = [arb("inf")] * len(self.pairs)

    def path(self, a: int, b: int) -> list[tuple[int, int]]:
        """(joint, sign) of the joints between two: those on the side of b move its shape, those of a away from it."""
        self.in_time()
        above_a, above_b = self.above(a), self.above(b)
        both = {*above_a} & {*above_b}
        return [(j, -1) for j in above_a if j not in both] + [(j, 1) for j in above_b if j not in both]

    def above(self, joint: int) -> list[int]:
        """A joint and all before it."""
        joints = []
        while joint >= 0:
            joints.append(joint)
            joint = self.joints[joint]["parent"]
        return joints

    def frames(self, q: Any) -> Any:
        """(R, p, axis) of each joint's moving frame, in that of the base, which is the last one."""
        base = _identity(), arb_mat(3, 1)
        frames: list[Any] = []
        for joint, (turn, shift) in zip(self.joints, self.placed, strict=True):
            R, p = frames[joint["parent"]][:2] if joint["parent"] >= 0 else base
            p, R, axis = p + R * shift, R * turn, _column(joint["axis"])
            value = joint["multiplier"] * q[joint["coordinate"]] + joint["offset"]
            if joint["kind"] == "prismatic":
                p = p + R * axis * value
            else:
                R = R * _turned(joint["axis"], value)
            frames.append((R, p, R * axis))
        return [*frames, (*base, None)]

    def verify(self, cell: Any) -> None:
        """All pairs over a cell whose roots are shown to be within r of its predictor, cut where that is too coarse."""
        need(len(cell.planes) == len(self.pairs), "a cell has other planes than pairs")
        open_pairs, d, best = list(range(len(self.pairs))), len(cell.sides), {}
        for cuts in CUTS:
            half, bounds = arb(1) / cuts, dict.fromkeys(open_pairs, arb("inf"))
            for place in product(range(1 - cuts, cuts, 2), repeat=d):
                y = half * arb_mat([[k] for k in place])
                for i, bound in zip(open_pairs, self.part(cell, y, half, open_pairs), strict=True):
                    bounds[i] = min(bounds[i].lower(), bound.lower())
            best |= bounds
            open_pairs = [i for i in open_pairs if not best[i] >= self.pairs[i]["apart"]]
            if not open_pairs:
                break
        names = [" and ".join(map(text_of, self.pairs[i]["names"])) for i in open_pairs]
        need(not open_pairs, f"{', '.join(names[:1])} may be nearer than is claimed")
        self.least = [min(least.lower(), best[i].lower()) for i, least in enumerate(self.least)]

    def part(self, cell: Any, y: Any, half: Any, pairs: Any) -> Any:
        """Lower bounds of distances over the part of a cell within `half` of y."""
        n, middle = self.n, cell.p(y)[0].entries()[: self.n]
        around = y + half * arb_mat([[UNIT]] * len(cell.sides))
        slope = arb_mat(cell.p(around)[1].tolist()[:n]) * half
        whole = [a + r * UNIT for a, r in zip(cell.p(around)[0].entries(), cell.r.entries(), strict=False)][:n]
        still, over = self.frames(middle), self.frames(whole)
        r = [x.upper() for x in cell.r.entries()[:n]]
        return [self.bound(i, cell.planes[i], still, over, slope, r) for i in pairs]

    def bound(self, i: int, normal: Any, still: Any, over: Any, slope: Any, r: Any) -> Any:
        """That of a pair, from the frames at the middle of the part (`still`) and over all of it."""
        # The plane, and the heights of both shapes above it in the middle.
        self.in_time()
        a, b = (self.shapes[k] for k in self.pairs[i]["shapes"])
        points, points_b = (self.points[k] for k in self.pairs[i]["shapes"])
        m = _column(a["normal"] or normal)
        length = sum((x * x for x in m.entries()), arb(0)).sqrt()
        need(length > 0, "a plane has no normal")
        (R, p, _), (S, x, _) = still[a["joint"]], still[b["joint"]]
        behind = max((v.upper() for v in (m.transpose() * points).entries()), default=arb(0))
        heights = ((R * m).transpose() * S * points_b).entries()
        shift = ((R * m).transpose() * (x - p)).entries()[0]
        # grad w of each point of the other shape over the part, joint by joint.
        m_over = over[a["joint"]][0] * m
        S, x, _ = over[b["joint"]]
        placed = S * points_b
        slopes = [[arb(0)] * self.n for _ in heights]
        for index, sign in self.paths[i]:
            joint, (_, o, z) = self.joints[index], over[index]
            gain, c = sign * joint["multiplier"], joint["coordinate"]
            if joint["kind"] == "prismatic":
                rises = [(m_over.transpose() * z).entries()[0]] * len(heights)
            else:
                u = _cross(m_over.entries(), z.entries())
                offset = (u.transpose() * (x - o)).entries()[0]
                rises = [v + offset for v in (u.transpose() * placed).entries()]
            for row, rise in zip(slopes, rises, strict=True):
                row[c] += gain * rise
        # How much lower they may come.
        lows = []
        for height, row, along in zip(heights, slopes, (arb_mat(slopes) * slope).tolist(), strict=True):
            spread = sum(map(abs, along), arb(0)) + sum((abs(v) * s for v, s in zip(row, r, strict=True)), arb(0))
            lows.append((height + shift - spread).lower())
        return (min(lows) - behind) / length - a["radius"] - b["radius"]

    def lines(self) -> list[str]:
        """What was verified, in sentences: the distances, and where the shapes are that do not move."""
        lines, used = [], sorted({i for pair in self.pairs for i in pair["shapes"]})
        for pair, least in zip(self.pairs, self.least, strict=True):
            a, b = map(text_of, pair["names"])
            far = float(least.lower()) * DOWN
            lines.append(f"{a} and {b}: {far:.4g} m apart or more, {pair['apart']:.4g} m claimed")
        for shape in (self.shapes[i] for i in used if self.shapes[i]["joint"] < 0):
            name, points, radius = text_of(shape["link"]), shape["points"], shape["radius"]
            rows = [[point[i] for point in points] for i in range(3)]
            sides = [" to ".join(f"{x:.4g}" for x in (min(row) - radius, max(row) + radius)) for row in rows]
            solid = "all below {} along {}".format(points[0], shape["normal"]) if shape["normal"] else " x ".join(sides)
            lines.append(f"{name} stands still: {solid} m, {len(points)} points, {digest_of(shape)}")
        return lines


def digest_of(shape: Any) -> str:
    """Of a shape the first digits of the SHA-256 of its points, radius and normal."""
    numbers = [[[float(x) for x in p] for p in shape["points"]], float(shape["radius"]), shape["normal"]]
    return f"SHA-256 {hashlib.sha256(json.dumps(numbers).encode()).hexdigest()[:12]}"


def _identity() -> Any:
    return arb_mat([[int(i == j) for j in range(3)] for i in range(3)])


def _column(values: Any) -> Any:
    return arb_mat([[x] for x in values])


def _cross(a: Any, b: Any) -> Any:
    return _column([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _turned(axis: Any, angle: Any) -> Any:
    """The rotation about an axis, by Rodrigues: 1 + sin K + (1 - cos) K^2."""
    x, y, z = axis
    K = arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return _identity() + K * angle.sin() + K * K * (1 - angle.cos())
