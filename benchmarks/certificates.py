"""Does a certificate ever say what is not so? Random certificates on random robots, each examined in NumPy.

    python -m benchmarks.certificates --count 10000 --out certificates.jsonl   # goes on where it was stopped

For a seed: a random arm of 3 to 8 joints with a random constraint, and eight motions from eight postures of it: lines,
circles, closed triangles, boxes. One path in twelve starts near a singular posture. What is examined, by `random_arms`,
which shares nothing with holokin:

- roots found by Newton's method at random poses of every cell lie in its tube, within the hull and the limits, where
  |det [J; J_g]| is not smaller than proven, and of one sign;
- from elsewhere in the tube Newton's method finds no other root in it;
- a continuation from the start, along the path or out to random poses of a box, gets through all that is proven and
  lies in the tubes; the determinant keeps its sign; a closed path ends where the certificate says.

Whatever is not so is a fault. One certificate of every tenth seed is written and verified by the checker.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.campaigns import campaign, options, summary
from benchmarks.random_arms import Motion, Problem, random_motion, random_posture, random_problem
from holokin.proof import Certificate, certify

Array = np.ndarray
KINDS = ("line", "circle", "triangle", "box")
AGAIN = 2
"""Motions of each kind for a robot."""

BUDGET = {"line": 160, "circle": 160, "triangle": 160, "box": 60}
"""Cells that a certificate may examine."""

NEAR = 1 / 12
"""Share of the paths that start near a singular posture."""

EACH = 3
"""Roots looked for in each cell, the first at a corner."""

WAYS = 8
"""Random poses of a box that are gone to from its middle, in so many parts."""

STEPS = 90
"""Parts of a path in a continuation, and more where joints turn by more than `LONGEST`."""

LONGEST = 0.1
"""Joint motion [rad, m] of a step of a continuation."""

TINY = 1e-10
"""Round-off of roots found in doubles."""

CHECKED = 10
"""Of every so many seeds one certificate is verified by the checker, if it has at most `SMALL` cells."""

SMALL = 40


class Examined:
    """A certificate, examined: the roots that were tried, the steps of continuations, the faults in words."""

    def __init__(self, problem: Problem, motion: Motion, start: Array, proof: Certificate) -> None:
        self.problem, self.motion, self.start, self.proof = problem, motion, start, proof
        self.boxes, self.cells, self.findings = proof.proven.boxes, proof.cells, proof.findings
        self.level = problem.level(start)
        self.counts: Counter[str] = Counter()
        self.faults: list[str] = []

    def need(self, true: Any, what: str) -> None:
        """A fault where something is not so."""
        if not np.all(true):
            self.faults.append(what)

    def predicted(self, cell: Array, y: Array) -> Array:
        """q0 + V y + 1/2 Q y y (k, n) of cells (k,) at y (k, d)."""
        i, j = np.triu_indices(y.shape[1])
        squares = y[:, i] * y[:, j] * np.where(i == j, 0.5, 1.0)
        bend = np.einsum("knp,kp->kn", self.cells.Q[cell], squares)
        return self.cells.q0[cell] + np.einsum("knd,kd->kn", self.cells.V[cell], y) + bend

    def roots(self, rng: np.random.Generator) -> None:
        """Of every cell."""
        proof, boxes, f = self.proof, self.boxes, self.findings
        cell, d = np.repeat(np.arange(len(boxes)), EACH), boxes.low.shape[1]
        y = rng.uniform(-1, 1, (len(cell), d))
        y[::EACH] = np.sign(y[::EACH])
        u = (boxes.low[cell] + boxes.high[cell]) / 2 + (boxes.high[cell] - boxes.low[cell]) / 2 * y
        p, R = self.motion.poses(boxes.piece[cell], u)
        guess = self.predicted(cell, y)
        q, det, found = self.problem.roots(guess, p, R, self.level)
        off = np.linalg.norm(q - guess, axis=1)
        self.need(found, "Newton's method finds no root in a cell")
        self.need(off <= f.r[cell] + TINY, f"a root is {np.max(off / f.r[cell]):.3g} r from its predictor")
        self.need(proof.low - TINY <= q, "a root is below the hull")
        self.need(q <= proof.high + TINY, "a root is above the hull")
        self.need((f.low[cell] - TINY <= q) & (q <= f.high[cell] + TINY), "a root is outside the hull of its cell")
        if proof.limits is not None:
            arm = self.problem.arm
            self.need((arm.lower - TINY <= q) & (q <= arm.upper + TINY), "a root is beyond a joint limit")
        least = np.abs(det).min()
        self.need(least >= proof.determinant * (1 - 1e-9), f"|det| is {least:.3g}, not {proof.determinant:.3g}")
        self.need(np.abs(np.sign(det).sum()) == len(det), "the determinant has both signs")
        self.counts["roots"] += len(cell)
        self.sign = float(np.sign(det[0]))
        away = rng.normal(size=q.shape)
        away *= (0.95 * f.alone[cell] / np.linalg.norm(away, axis=1))[:, None]
        other, _, again = self.problem.roots(guess + away, p, R, self.level)
        inside = again & (np.linalg.norm(other - guess, axis=1) < f.alone[cell] * (1 - 1e-9))
        apart = np.linalg.norm(other - q, axis=1)[inside]
        self.need(apart < 1e-7, f"two roots in a tube, {apart.max(initial=0.0):.3g} apart")
        self.counts["starts elsewhere that led to it"] += int(inside.sum())

    def in_tube(self, q: Array, piece: int, u: Array, what: str) -> None:
        """A posture at a pose lies in the tubes of all cells that hold it."""
        b = self.boxes
        held = (b.piece == piece) & (b.low <= u).all(axis=1) & (u <= b.high).all(axis=1)
        cell = np.flatnonzero(held)
        half = (b.high - b.low)[cell] / 2
        y = (u - (b.high + b.low)[cell] / 2) / np.where(half > 0, half, 1.0)
        off = np.linalg.norm(q - self.predicted(cell, y), axis=1)
        self.need(len(cell) > 0, f"no cell holds a pose of {what}")
        self.need(off <= self.findings.r[cell] + TINY, f"{what} leaves the tubes")

    def along(self, q: Array, piece: int, a: Array, b: Array, what: str) -> Array | None:
        """Continued from q at parameters a (d,) to b: halved until Newton's steps shrink and joints move little."""
        u, step, last = 0.0, 1.0, np.array([piece])
        while u < 1:
            step = min(step, 1 - u)
            p, R = self.motion.poses(last, (a + (u + step) * (b - a))[None])
            near, _, _ = self.problem.roots(q[None], p, R, self.level, most=1)
            first = np.linalg.norm(near - q)
            here = self.problem.roots(near, p, R, self.level, most=1)[0] if first <= LONGEST else near
            if first <= LONGEST and np.linalg.norm(here - near) <= 0.25 * first + TINY:
                end, det, found = self.problem.roots(here, p, R, self.level)
                if found[0]:
                    q, u, step = end[0], u + step, 2 * step
                    self.counts["steps of a continuation"] += 1
                    if np.sign(det[0]) != self.sign:
                        self.faults.append(f"the determinant changes its sign on {what}")
                    continue
            step /= 2
            if step < 1e-9:
                self.faults.append(f"a continuation along {what} does not get through")
                return None
        self.in_tube(q, piece, b, what)
        return q

    def continued(self, rng: np.random.Generator) -> None:
        """From the start through all that is proven."""
        b, q = self.boxes, self.start
        if self.motion.kind == "box":
            for _ in range(WAYS if self.proof.whole else 0):
                end = rng.uniform(-1, 1, self.proof.equation.d)
                at: Array | None = q
                for k in range(WAYS):
                    at = self.along(at, 0, k / WAYS * end, (k + 1) / WAYS * end, "a way through the box")
                    if at is None:
                        return
            return
        pieces = int(b.piece.max()) + 1
        for piece in range(pieces):
            marks = np.linspace(0, b.high[b.piece == piece].max(), STEPS // pieces + 1)[:, None]
            for one, other in pairwise(marks):
                found = self.along(q, piece, one, other, "the path")
                if found is None:
                    return
                q = found
        if self.proof.whole and self.motion.kind != "line":
            off = np.linalg.norm(q - self.start - 2 * np.pi * self.proof.turns)
            closed = np.isfinite(self.proof.gap)
            self.need(not closed or off <= self.proof.gap + 1e-9, f"a loop ends {off:.3g} from where it began")
            self.counts["closed paths that are shown to close" if closed else "closed paths that are not"] += 1
            self.counts["of them after whole turns"] += int(closed and self.proof.turns.any())


def tried(seed: int) -> dict[str, Any]:
    """The certificates of a seed: how many ended how, what was examined, the faults."""
    rng, began = np.random.default_rng([seed, 14]), time.process_time()
    problem = random_problem(rng)
    n, kind = problem.arm.n, "planar" if problem.arm.planar else "spatial"
    counts, faults = Counter[str](), []
    for motion_kind in KINDS * AGAIN:
        start = random_posture(problem, rng, near=motion_kind != "box" and rng.random() < NEAR)
        motion = random_motion(motion_kind, problem, start, rng)
        counts["certificates"] += 1
        try:
            proof = certify(problem.strategy, motion.where, start, budget=BUDGET[motion_kind])
        except hk.HolokinError as problem_found:
            counts[f"refused: {type(problem_found).__name__}"] += 1
            continue
        except (ArithmeticError, ValueError, LookupError, TypeError, np.linalg.LinAlgError) as problem_found:
            faults.append(f"seed {seed}, {motion_kind}: {problem_found!r}")
            continue
        counts += Counter([f"ended: {proof.extent.name}", f"{motion_kind}: {proof.extent.name}"])
        if not len(proof):
            counts["without a cell"] += 1
            continue
        made = ["with cells", f"{kind}, {n} joints", f"constraint: {problem.law[0]}"]
        made += ["with an orientation"] * problem.arm.turned + ["with a slider"] * bool(problem.arm.slides.any())
        counts += Counter([*made, *["within limits"] * bool(np.isfinite(problem.arm.lower).any())])
        counts["cells"] += len(proof)
        examined = Examined(problem, motion, start, proof)
        examined.roots(rng)
        examined.continued(rng)
        counts += examined.counts
        faults += [f"seed {seed}, {motion_kind}: {fault}" for fault in examined.faults]
        if seed % CHECKED == 0 and len(proof) <= SMALL:
            fault = rejected(proof)
            counts["verified by the checker" if fault is None else "rejected by the checker"] += 1
            faults += [] if fault is None else [f"seed {seed}, {motion_kind}: the checker: {fault}"]
    return {"seed": seed, "counts": counts, "faults": faults, "seconds": time.process_time() - began}


def rejected(proof: Certificate) -> str | None:
    """What the checker says against the file of a certificate; nothing where it verifies it."""
    from holokin.proof import checker

    with tempfile.TemporaryDirectory() as folder:
        file = proof.save(Path(folder) / "certificate.json")
        try:
            checker.check(str(file))
        except checker.RejectedError as problem:
            return str(problem)
    return None


def main() -> int:
    """Prints the faults as they are found, and a summary; 1 where there is one."""
    asked = options("certificates", __doc__, "Certificates to try, eight a seed.").parse_args()
    count = 1 if asked.quick else -(-asked.count // (AGAIN * len(KINDS)))
    first = 2 if asked.quick else asked.seed  # that robot takes little time
    rows = campaign(tried, range(first, first + count), asked.workers, asked.out)
    total, lines = summary(rows)
    faults = [fault for row in rows for fault in row["faults"]]
    print("\n".join([lines, *faults]))
    said = f"{total['certificates']:,} certificates tried on {len(rows):,} robots, {total['with cells']:,} with cells, "
    said += f"{total['ended: WHOLE']:,} whole; {total['cells']:,} cells, {total['roots']:,} roots, {len(faults)} faults"
    print(f"{said}; {sum(row['seconds'] for row in rows):.0f} s")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
