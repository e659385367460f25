"""What certificates cost: cells, seconds, omega.

    python -m benchmarks.proof                # prints the table of docs/proof.md
    python -m benchmarks.proof --random 1000  # certificates on random robots, each tested by Newton's method

Seconds are of the processor, of the second of two runs: the first one builds the equation.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from casadi import sin

import holokin as hk
from holokin import constraints as C
from holokin.proof import Certificate, certify

PANDA = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
YUMI = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])
IIWA = np.array([0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])

Case = tuple[str, Any, Any, np.ndarray]


def cases() -> Iterator[Case]:
    """(name, strategy, path or box, start)."""
    panda = hk.load("panda")
    task, x = hk.pose(panda), panda.pose(PANDA)[:3, 3]
    small, large = hk.circle(x, center=x - [0.1, 0, 0]), hk.circle(x, center=x - [0.0, 0.2, 0.0])
    locked = hk.holonomic(task, hk.lock(2))
    yield "Panda, joint 3 locked, circle of 0.1 m", locked, small, PANDA
    yield "the same, 0.2 m", locked, large, PANDA
    yield "Panda, arm angle, circle of 0.1 m", hk.holonomic(task, hk.arm_angle()), small, PANDA
    made = hk.design(task, hk.workspace(box=(x, (0.15, 0.15, 0.1))), PANDA, samples=32, degree=2)
    yield "Panda, design of degree 2, circle of 0.1 m", made.strategy, small, PANDA
    iiwa = hk.load("iiwa14")
    x = iiwa.pose(IIWA)[:3, 3]
    yield (
        "iiwa 14, joint 3 locked, circle of 0.1 m",
        hk.holonomic(hk.pose(iiwa), hk.lock(2)),
        hk.circle(x, center=x - [0.1, 0, 0]),
        IIWA,
    )
    yield from every_constraint()
    yield from two_hands()
    arm, q = hk.load("planar-3r"), np.array([0.3, 0.9, 0.9])
    law = hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]]))
    yield "planar 3R, q2 = q3, box of 1 m by 1 m", law, hk.workspace(box=((1.3, 0.0, 0.0), (0.5, 0.5, 0.0))), q
    x = panda.pose(PANDA)[:3, 3]
    R = panda.pose(PANDA)[:3, :3]
    cube = hk.workspace(box=(x, (0.05, 0.05, 0.05)), rotation=R)
    yield "Panda, cube of 0.1 m, one orientation", locked, cube, PANDA


def every_constraint() -> Iterator[Case]:
    """Circles of 0.1 m of a Panda."""
    robot = hk.load("panda")
    task, x = hk.pose(robot), robot.pose(PANDA)[:3, 3]
    loop = hk.circle(x, center=x - [0.1, 0, 0])
    coupled = C.stack(hk.coupled(0.5, "rpy"), hk.lock(2))
    rows = {
        "linear": (task, hk.linear([[1, 0, -1, 0, 0, 0, 0]])),
        "coupled orientation": (hk.position(robot), coupled),
        "conventional arm angle": (task, hk.arm_angle(definition="conventional")),
        "stationary centring": (task, hk.stationary(C.centring_cost())),
        "stationary posture": (task, hk.stationary(C.posture_cost(PANDA))),
        "custom": (task, hk.custom(lambda q: [q[0] * q[2] + sin(q[4])])),
    }
    for name, (of, constraint) in rows.items():
        yield f"Panda, {name}, circle of 0.1 m", hk.holonomic(of, constraint), loop, PANDA
    near = hk.follow(hk.moore_penrose(task), loop, PANDA, samples=60).q
    rng = np.random.default_rng(0)
    Q = np.vstack([near, *(near[::4] + rng.normal(scale=0.02, size=near[::4].shape) for _ in range(6))])
    radial = hk.radial(hk.moore_penrose(task), PANDA)
    fit = hk.strategies.fitted(radial, Q, degree=3, rows=(0, 1, 2))
    yield "Panda, radial fitted, degree 3, circle of 0.1 m", fit, loop, PANDA


def two_hands() -> Iterator[Case]:
    """Both arms of a YuMi, 14 joints: one hand seen from the other, and each on a circle of its own."""
    robot, hands = hk.load("yumi"), ("left_flange", "right_flange")
    task = hk.relative_pose(robot, *hands)
    x = task.pose(YUMI)[:3, 3]
    rows = hk.linear(np.linalg.svd(task.jacobian(YUMI))[2][6:])
    yield (
        "YuMi, hand seen from hand, 8 linear rows, circle of 0.1 m",
        hk.holonomic(task, rows), hk.circle(x, center=x - [0.1, 0, 0]), YUMI,
    )  # fmt: skip
    both = hk.stacked(*(hk.pose(robot, tip=hand) for hand in hands))
    left, right = both.pose(YUMI)[:, :3, 3]
    path = hk.synchronized(hk.circle(left, left - [0.04, 0, 0]), hk.circle(right, right - [0.04, 0, 0]))
    yield "YuMi, both hands, joints 3 locked, circles of 0.04 m", hk.holonomic(both, hk.lock(2, 9)), path, YUMI


def shown(name: str, proof: Certificate, seconds: float) -> str:
    """A row of the table."""
    omega = f"{np.median(proof.findings.omega):.1f}" if len(proof) else ""
    return f"| {name} | {proof.extent.name.lower()} | {len(proof):,} | {seconds:.2f} | {omega} |"


def table(only: str) -> None:
    """Prints it."""
    print("| robot, constraint, motion | proven | cells | seconds | omega |\n| --- | --- | ---: | ---: | ---: |")
    for name, strategy, where, start in cases():
        if only not in name:
            continue
        certify(strategy, where, start, budget=1)
        began = time.process_time()
        proof = certify(strategy, where, start, budget=100_000)
        print(shown(name, proof, time.process_time() - began), flush=True)


def random_robot(rng: np.random.Generator) -> tuple[hk.Strategy, np.ndarray, np.ndarray]:
    """A planar or spatial arm of 3 to 8 joints, a strategy that couples them by a random matrix, that, a posture."""
    n = int(rng.integers(3, 9))
    planar = n < 5 or rng.random() < 0.5
    if planar:
        rows = [{"a": float(rng.uniform(0.2, 1.0))} for _ in range(n)]
    else:
        twists = rng.choice([-np.pi / 2, 0.0, np.pi / 2], n)
        rows = [{"a": float(rng.uniform(0, 0.5)), "d": float(rng.uniform(0, 0.5)), "alpha": float(t)} for t in twists]
    robot = hk.from_dh(rows, name="random")
    task = hk.position(robot)
    r = n - task.m
    if r < 1:
        return random_robot(rng)
    matrix = rng.normal(size=(r, n))
    return hk.holonomic(task, hk.linear(matrix)), matrix, rng.uniform(-2, 2, n)


def tested(proof: Certificate, rng: np.random.Generator) -> int:
    """How many roots, found by Newton at random poses of cells, lie in the tube; all must. Raises: AssertionError."""
    equation, count = proof.equation, 0
    for i in rng.permutation(len(proof))[:8]:
        y = rng.uniform(-1, 1, equation.d)
        middle = q = proof.cells.predicted(np.tile(y, (len(proof), 1)))[i]
        for _ in range(6):
            at = np.concatenate([q, y, proof.cells.numbers[i], proof.c])[:, None]
            found = equation.value(at, at).middle.ravel()
            A = found[equation.n :].reshape(equation.n, equation.n).T
            q = q - np.linalg.solve(A, found[: equation.n])
        off = float(np.linalg.norm(q - middle))
        if not off <= proof.findings.r[i] + 1e-12:
            raise AssertionError(f"a root is {off} from the predictor, not {proof.findings.r[i]}")
        if not abs(np.linalg.det(A)) >= proof.determinant * (1 - 1e-9):
            raise AssertionError("the determinant is smaller than what is proven")
        count += 1
    return count


def random(count: int, seed: int = 0) -> Counter[str]:
    """Certificates on random robots: how many ended how, and how many roots were found in the tubes."""
    rng, ends = np.random.default_rng(seed), Counter[str]()
    for _ in range(count):
        strategy, matrix, q = random_robot(rng)
        x = strategy.task.pose(q)[:3, 3]
        step = rng.normal(size=3) * 10.0 ** rng.uniform(-2, -0.3)
        if strategy.task.m == 2:
            step[2] = 0.0
        try:
            proof = certify(strategy, hk.line(x, x + step), q, limits=False, budget=2000)
        except hk.HolokinError as problem:
            ends[type(problem).__name__] += 1
            continue
        ends[proof.extent.name] += 1
        ends["roots in tubes"] += tested(proof, rng)
        if proof.whole:  # the sign of det [J; J_g] is one along all of it
            walk = hk.follow(strategy, hk.line(x, x + step), q, samples=100, limits=False)
            signs = {bool(np.linalg.det(np.vstack([strategy.task.jacobian(p), matrix])) > 0) for p in walk.q}
            if len(signs) > 1:
                raise AssertionError("a certificate across a sampled singularity")
    return ends


def main() -> int:
    """The table, or random robots; with --quick the first row alone."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--random", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    if asked.random:
        print(dict(random(asked.random)))
    else:
        table(next(cases())[0] if asked.quick else asked.only)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
