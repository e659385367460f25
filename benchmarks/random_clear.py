"""Is a distance that was proven ever not there? Random arms with shapes among random obstacles, each examined by Coal.

    python -m benchmarks.random_clear --count 1000 --out clear.jsonl   # goes on where it was stopped

For a seed: an arm, shapes on its links, obstacles and a floor of `random_scenes`, a clearance from 0 to 4 cm, and a box
or a path at a random posture. `hk.certify` proves what it can. The referee, which shares nothing with holokin, then has
postures on the leaf, at random poses of random cells, by Newton's method in small steps from the start; `batch` of
holokin finds the first of them too, and they must agree. At each of them no two shapes are nearer than was proven of
the posture's cell, and of all; every pair of links and obstacles is in the proof, or is said to be left out.

Then, of what is proven: an obstacle is put so near to a posture inside that a link is 1 mm nearer than was asked; a
joint's limit is put 1 mm or mrad inside of where it goes. Neither may be proven. The checker verifies some cells of
each certificate, a hundredth of them at least, and whole files of small ones; of certificates that are not whole it may
refuse one, as near singular postures. Whatever else is not so is a fault.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.campaigns import campaign, options, summary
from benchmarks.random_arms import Array, Motion, Problem, random_motion, random_posture, turned_motion
from benchmarks.random_scenes import (
    KINDS,
    Part,
    Scene,
    distance,
    least_distances,
    lowest,
    placed,
    random_case,
    random_place,
    random_scene,
    random_solid,
)
from holokin.base.errors import HolokinError
from holokin.proof import Certificate, certify, joint_rates
from holokin.proof.certificate import digest

BUDGET = {"box": 120, "turned": 240, "line": 160, "circle": 160}
"""Cells that a certificate may examine."""

ASKED, BOTH, STEPS, ROUND, NEARER = 1200, 200, 4, 1e-9, 1e-3
"""Postures of a certificate, and how many of them `batch` finds, too; steps of Newton's continuation to a pose
of a box, or for each cell of a path; Coal's round-off [m]; how much too near an obstacle is, too narrow a limit."""

SMALL, SHARE, WHOLE = 12, 0.01, 20
"""Files of so many cells are verified whole, of every `WHOLE`th seed; of the others that share of the cells."""


def drawn(rng: np.random.Generator) -> tuple[Problem, Array, Motion]:
    """An arm, a start, and a box or a path at it; a box may stand aside of it."""
    problem = random_case(rng)
    q = random_posture(problem, rng, near=False)
    kind = str(rng.choice(["box", "turned", "line", "circle"], p=[0.6, 0.15, 0.15, 0.1]))
    arm = problem.arm
    if kind == "turned" and len(arm.held) == 6 and not arm.planar:
        return problem, q, replace(turned_motion("box", problem, q, rng), kind="turned")
    if kind in ("line", "circle"):
        return problem, q, random_motion(kind, problem, q, rng)
    flat = np.array([1.0, 1.0, 0.0]) if arm.planar else np.ones(3)
    frame = arm.frames(q[None])[0, -1]
    half = flat * 10.0 ** rng.uniform(-2.8, -1.6) * rng.uniform(0.2, 1.0, 3)
    middle, R = frame[:3, 3] + half * rng.uniform(-0.9, 0.9, 3), frame[:3, :3]

    def in_box(_piece: Array, u: Array) -> tuple[Array, Array]:
        return middle + u * half, np.broadcast_to(R, (len(u), 3, 3))

    return problem, q, Motion("box", hk.workspace(box=(middle, half), rotation=R), in_box)


class Examined:
    """A certificate about distances, examined."""

    def __init__(self, scene: Scene, motion: Motion, start: Array, proof: Certificate, count: int) -> None:
        self.scene, self.motion, self.start, self.proof = scene, motion, start, proof
        self.problem, self.count, self.boxed = scene.problem, count, motion.kind in ("box", "turned")
        self.counts: Counter[str] = Counter()
        self.faults: list[str] = []
        self.q = np.zeros((0, self.problem.arm.n))

    def need(self, true: Any, what: str) -> None:
        """A fault where something is not so."""
        if not np.all(true):
            self.faults.append(what)

    def postures(self, rng: np.random.Generator) -> None:
        """At random places of random cells, one in four at a corner of its cell."""
        boxes = self.proof.proven.boxes
        cell = rng.integers(0, len(boxes), self.count)
        y = rng.uniform(-1, 1, (self.count, boxes.low.shape[1]))
        y[::4] = np.sign(y[::4])
        u = (boxes.low[cell] + boxes.high[cell]) / 2 + (boxes.high[cell] - boxes.low[cell]) / 2 * y
        self.cell = cell
        p, R = self.motion.poses(boxes.piece[cell], u)
        self.p, self.R = p, R
        level = self.problem.level(self.start)
        cells = self.proof.cells
        i, j = np.triu_indices(y.shape[1])
        squares = y[:, i] * y[:, j] * np.where(i == j, 0.5, 1.0)
        bend = np.einsum("knd,kd->kn", cells.V[cell], y) + np.einsum("knp,kp->kn", cells.Q[cell], squares)
        near = (cells.q0[cell] + bend)[:, : self.problem.arm.n]
        if self.boxed and not self.proof.whole:  # on a straight way from the start to a part the leaf may fold
            q, _, found = self.problem.roots(near, p, R, level)
        elif self.boxed:
            first = self.problem.arm.frames(self.start[None])[0, -1, :3, 3]
            q = np.tile(self.start, (self.count, 1))
            for share in np.arange(1, STEPS + 1) / STEPS:
                q, _, found = self.problem.roots(q, first + share * (p - first), R, level, most=2 if share < 1 else 12)
        else:
            q, found = self._along(level, u[:, 0])
        self.need(found, "Newton's method does not get to a pose")
        self.q = q
        self.counts["postures by Newton's method"] += self.count
        off = np.linalg.norm(q - near, axis=1)
        self.need(off <= self.proof.findings.r[cell] + 1e-10, "a posture is not in the tube of its cell")

    def _along(self, level: Array, u: Array) -> tuple[Array, Array]:
        """Along a path from its start: postures at the shares u (k,) of its only piece."""
        ends = np.linspace(0.0, u.max(), STEPS * len(self.proof) + 1)[1:]
        q, marks = self.start[None], [self.start]
        zero = np.zeros(1, dtype=int)
        for end in ends:
            q = self.problem.roots(q, *self.motion.poses(zero, np.array([[end]])), level, most=4)[0]
            marks.append(q[0])
        near = np.array(marks)[np.abs(u[:, None] - np.r_[0.0, ends]).argmin(axis=1)]
        found = self.problem.roots(near, self.p, self.R, level)
        return found[0], found[2]

    def by_batch(self) -> None:
        """Holokin's own inverse kinematics finds the same."""
        if not (self.boxed and self.proof.whole):
            return
        T = np.tile(np.eye(4), (min(BOTH, self.count), 1, 1))
        k = len(T)
        T[:, :3, :3], T[:, :3, 3] = self.R[:k], self.p[:k]
        found = hk.ik(self.problem.strategy, self.start, limits=False).batch(T)
        self.need(found.reached, "`batch` does not reach a pose")
        self.need(np.abs(found.q - self.q[:k])[found.reached] < 1e-7, "`batch` finds another posture")
        self.counts["of them by batch, too"] += k

    def rates(self) -> None:
        """No joint is faster than is proven, by the inverse of the derivative of E."""
        if not self.boxed or self.proof.equation.n > self.problem.arm.n:
            return
        rates, held, k = joint_rates(self.proof), self.problem.arm.held, min(self.count, 200)
        A = self.problem.slopes(self.q[:k], self.p[:k], self.R[:k], self.problem.level(self.start))[1]
        G = np.linalg.inv(A)
        wide = [i for i, row in enumerate(held) if row < 3]
        speed = np.linalg.norm(G[:, :, wide], axis=2).max(axis=0)
        self.need(speed <= rates.per_speed * (1 + 1e-9) + 1e-12, "a joint is faster than is proven")
        self.counts["rates of joints"] += k
        if self.motion.kind == "turned":
            turn = np.linalg.norm(G[:, :, 3:6], axis=2).max(axis=0)
            self.need(turn <= rates.per_turn * (1 + 1e-9) + 1e-12, "a joint turns faster than is proven")

    def distances(self) -> None:
        """None is below what is claimed of its cell."""
        scene, f = self.scene, self.proof.findings
        clear = self.proof.demands.clear
        if clear is None:
            return
        pairs = clear.pairs
        frames = scene.problem.arm.frames(self.q)
        claims: dict[tuple[str, str], Array] = {}
        for i, pair in enumerate(pairs):
            known = claims.get(pair.names)
            claims[pair.names] = f.apart[:, i] if known is None else np.minimum(known, f.apart[:, i])
            self.need(f.apart[:, i] >= pair.wanted, f"{pair.names} are proven to be nearer than was asked")
        parts = [*scene.links, *scene.things]
        where = dict(zip(parts, placed(parts, frames), strict=True))
        for (one, other), claim in claims.items():
            said = claim[self.cell]
            if other == "floor" or one == "floor":
                part = next(name for name in (one, other) if name != "floor")
                seen = np.min([lowest(p, where[p]) for p in scene.parts(part)], axis=0) - scene.floor
            else:
                seen = np.min(
                    [
                        least_distances(a.solid, where[a], b.solid, where[b], said + 0.02)
                        for a in scene.parts(one)
                        for b in scene.parts(other)
                    ],
                    axis=0,
                )
            self.counts["distances"] += len(seen)
            short = np.max(said - seen)
            self.need(short <= ROUND, f"{one} and {other} are {short:.3g} m nearer than is proven")
            self.counts[f"within {10 ** np.ceil(np.log10(max(-short, 1e-6))):g} m of what is proven"] += 1
        left = {frozenset(one.pair) for one in clear.looked_at.left_out}
        there = {frozenset(names) for names in claims} | left
        moving = {part.name for part in scene.links if part.frame > 0}
        wanted = {frozenset((link, thing.name)) for link in moving for thing in scene.things}
        wanted |= {frozenset((link, "floor")) for link in moving if scene.floor is not None}
        names = {part.name for part in scene.links}
        wanted |= {frozenset((a, b)) for a in names for b in names if a != b}
        self.need(wanted <= there, f"nobody says anything of {[sorted(pair) for pair in wanted - there][:1]}")

    def too_near(self, rng: np.random.Generator, clearance: float, folder: Path, budget: int) -> None:
        """An obstacle 1 mm nearer than was asked to a posture inside, away from the start, is never proven away."""
        moving = [part for part in self.scene.links if part.frame > 0]
        part = moving[int(rng.integers(len(moving)))]
        k = int(np.argmax(np.linalg.norm(self.q[:300] - self.start, axis=1)))
        T = placed([part], self.problem.arm.frames(self.q[k : k + 1]))[0][0]
        T0 = placed([part], self.problem.arm.frames(self.start[None]))[0][0]
        way = (T - T0)[:3, 3] + (T - T0)[:3, :3] @ part.solid.middle
        way = way if np.linalg.norm(way) > 1e-9 else rng.normal(size=3)
        way = way / np.linalg.norm(way)
        solid = random_solid(rng, float(rng.uniform(0.05, 0.4)), folder, str(rng.choice(KINDS)))
        place = random_place(rng, T[:3, 3] + T[:3, :3] @ part.solid.middle + way * (part.solid.radius + 0.5))
        place[:3, 3] += way * solid.radius
        gap, normal = distance(part.solid, T, solid, place)
        place[:3, 3] -= normal * (gap - clearance + NEARER)
        seen = distance(part.solid, T, solid, place)[0]
        if not seen <= clearance - 0.9 * NEARER:
            self.counts["obstacles that Coal puts elsewhere"] += 1
            return
        near = replace(self.scene, things=[Part("the obstacle", 0, place, solid)]).obstacles
        try:
            proof = certify(
                self.scene.strategy, self.motion.where, self.start, budget=budget,
                scene=hk.Scene(near, clearance=clearance, self_collision=False),
            )  # fmt: skip
        except HolokinError as refused:
            self.counts[f"1 mm too near: refused, {type(refused).__name__}"] += 1
            return
        self.need(not proof.covered, f"an obstacle is {seen:.4g} m from {part.name}, and is proven away")
        self.counts[f"1 mm too near: ended, {proof.extent.name}"] += 1

    def too_narrow(self, budget: int) -> None:
        """A limit 1 mrad or mm inside of where a joint goes is never proven."""
        arm, q = self.problem.arm, self.q
        room = np.maximum(q.max(axis=0) - self.start, self.start - q.min(axis=0))
        j = int(np.argmax(room))
        if room[j] < 2 * NEARER:
            self.counts["joints that hardly move"] += 1
            return
        lower, upper = arm.lower.copy(), arm.upper.copy()
        lower[j], upper[j] = max(lower[j], -50.0), min(upper[j], 50.0)
        if q[:, j].max() - self.start[j] == room[j]:
            upper[j] = q[:, j].max() - NEARER
        else:
            lower[j] = q[:, j].min() + NEARER
        tight = replace(self.problem, arm=replace(arm, lower=lower, upper=upper))
        try:
            proof = certify(tight.strategy, self.motion.where, self.start, budget=budget)
        except HolokinError as refused:
            self.counts[f"1e-3 too narrow: refused, {type(refused).__name__}"] += 1
            return
        self.need(not proof.covered, f"joint {j} is proven to stay in limits that it leaves by 1e-3")
        self.counts[f"1e-3 too narrow: ended, {proof.extent.name}"] += 1

    def checked(self, rng: np.random.Generator, whole: bool) -> None:
        """Cells of it by the checker; of a small one the file, with the robot's shapes."""
        from flint import arb

        from holokin.proof.checker import Cell, Checker, RejectedError
        from holokin.proof.recheck import recheck

        data = json.loads(json.dumps(self.proof.data))
        if whole and len(self.proof) <= SMALL:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "certificate.json"
                file.write_text(json.dumps(data | {"sha256": digest(data)}) + "\n", "utf-8")
                rejected, text = recheck(file, robot=self.scene.robot)
            self.need(not rejected, f"the checker: {text[:200]}")
            self.counts["files verified by the checker"] += 1
            self.counts["cells verified by the checker"] += len(self.proof)
            return
        if not data["claims"]["gap"] <= 1e-6:  # a part that does not hold the start: the checker takes no such file
            self.need(not self.proof.whole, "the start of a whole box is not tied to it")
            self.counts["parts that do not hold the start"] += 1
            return
        checker = Checker(data, lambda _cells: None, 600.0, 1)
        found = list(_cells(data["pieces"][0]["cells"], [(0, 1) if checker.d == 1 else (-1, 1)] * checker.d))
        given = data["pieces"][0]["numbers"] + data["level"] + data["constants"]
        checker.numbers = [arb(x) for x in given]
        for i in rng.choice(len(found), 1 + int(SHARE * len(found)), replace=False):
            try:
                checker.prove(Cell(*found[i]))
                self.counts["cells verified by the checker"] += 1
            except RejectedError as problem:
                self.need(not self.proof.covered, f"the checker: {problem}")
                self.counts["cells of parts that the checker does not verify"] += 1


def _cells(tree: Any, sides: Any) -> Iterator[tuple[Any, Any]]:
    """(data, sides) of the cells of a tree."""
    if isinstance(tree, dict):
        yield tree, sides
    elif tree:
        axis, at, *halves = tree
        for half, end in zip(halves, ((sides[axis][0], at), (at, sides[axis][1])), strict=True):
            yield from _cells(half, [*sides[:axis], end, *sides[axis + 1 :]])


def tried(seed: int, count: int = ASKED) -> dict[str, Any]:
    """What became of a seed: counts, faults, seconds."""
    rng, began = np.random.default_rng([seed, 31]), time.process_time()
    counts, faults = Counter[str](), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        problem, start, motion = drawn(rng)
        clearance = float(rng.choice([0.0, 0.001, 0.01, 0.04]))
        scene = random_scene(problem, start, rng, folder, clearance)
        counts["arms"] += 1
        budget = BUDGET[motion.kind]
        try:
            proof = certify(scene.strategy, motion.where, start, scene=scene.at(clearance), budget=budget)
        except HolokinError as refused:
            counts[f"refused: {type(refused).__name__}"] += 1
            return {"seed": seed, "counts": counts, "faults": [], "seconds": time.process_time() - began}
        counts += Counter([f"ended: {proof.extent.name}", f"{motion.kind}: {proof.extent.name}"])
        counts += Counter([type(problem.arm).__name__, *["with an axis"] * (len(problem.arm.held) == 5)])
        if len(proof):
            counts["cells"] += len(proof)
            counts["pairs of shapes"] += proof.findings.apart.shape[1]
            examined = Examined(scene, motion, start, proof, count)
            examined.postures(rng)
            examined.by_batch()
            examined.rates()
            examined.distances()
            if proof.covered:
                counts["covered"] += 1
                examined.too_near(rng, clearance, folder, budget)
                examined.too_narrow(budget)
            examined.checked(rng, seed % WHOLE == 0)
            counts += examined.counts
            faults += [f"seed {seed}: {fault}" for fault in examined.faults]
    return {"seed": seed, "counts": counts, "faults": faults, "seconds": time.process_time() - began}


def main() -> int:
    """Prints the faults as they are found, and a summary; 1 where there is one."""
    parser = options("random_clear", __doc__, "Arms.")
    parser.add_argument("--postures", type=int, default=ASKED, help="Of each certificate.")
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + (1 if asked.quick else asked.count))
    rows = campaign(partial(tried, count=50 if asked.quick else asked.postures), seeds, asked.workers, asked.out)
    print(summary(rows)[1])
    faults = sum(len(row["faults"]) for row in rows)
    print(f"{len(rows):,} arms, {faults} faults; {sum(row['seconds'] for row in rows):.0f} s")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
