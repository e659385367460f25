"""Does inverse kinematics on a leaf ever land on another branch? Against continuation in small steps.

    python -m benchmarks.branches --targets 20000      # a quarter of an hour on two cores

Random tool poses on five robots, reached straight from a start posture: by `hk.ik`, by the exported C, and by a
continuation of its own: 3,000 Euler steps with a Newton correction each, which must be small beside the step, else
the step is halved. Counted: answers that differ, answers where the continuation ends, poses refused that it reaches.
"""

from __future__ import annotations

import argparse
import ctypes
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.base.errors import BranchError, OutOfReachError, SingularityError
from holokin.export import export_c
from holokin.motion.ik.leaf import leaf_step
from holokin.symbolic.native import compiler
from holokin.symbolic.native import toolchain as native

STEPS = 3000
PANDA = np.array([0.0, -0.3, 0.2, -2.0, 0.1, 1.8, 0.7])
IIWA = np.array([0.1, 0.6, 0.2, -1.4, 0.1, 1.1, 0.0])
IRB = np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0])


@dataclass(frozen=True)
class Case:
    """A strategy, its start, how far targets lie from the tool there [m], how far they turn it [rad], its share."""

    strategy: hk.Strategy
    start: np.ndarray
    reach: float
    turn: float
    share: float


def cases() -> list[Case]:
    """Five robots, an equal part of the targets each."""
    ppr, r3 = hk.position(hk.load("ppr")), hk.position(hk.load("planar-3r"))
    irb, panda, iiwa = hk.position(hk.load("irb140")), hk.pose(hk.load("panda")), hk.pose(hk.load("iiwa14"))
    fold = hk.custom(lambda q: q[2] ** 3 - 0.003 * q[2] + q[0] + ca.cos(q[2]), name="q3^3 - 0.003 q3 + x")
    wave = hk.custom(lambda q: q[2] - 0.02 * ca.tanh((q[2] - 0.3) / 0.01) + q[0], name="a narrow step")
    start, bent = np.array([0.3, 0.2, 0.4]), np.array([0.3, 0.8, 0.5])
    return [
        Case(hk.holonomic(ppr, fold), start, 1.0, 0.0, 0.1),
        Case(hk.holonomic(ppr, wave), start, 1.0, 0.0, 0.1),
        Case(hk.holonomic(r3, hk.lock(2)), bent, 2.5, 0.0, 0.1),
        Case(hk.holonomic(r3, hk.linear([1.0, 0, -2.0]), name="q1 - 2 q3"), bent, 2.5, 0.0, 0.05),
        Case(hk.holonomic(r3, hk.linear([1.0, 1, 1]), name="q1 + q2 + q3"), bent, 2.5, 0.0, 0.05),
        Case(hk.holonomic(irb, hk.coupled(1.0)), IRB, 0.4, 0.0, 0.2),
        Case(hk.holonomic(panda, hk.lock(2)), PANDA, 0.5, 0.7, 0.15),
        Case(hk.holonomic(panda, hk.strategies.constraints.height("panda_joint4")), PANDA, 0.3, 0.4, 0.04),
        Case(hk.holonomic(panda, hk.stationary(hk.strategies.constraints.centring_cost())), PANDA, 0.3, 0.4, 0.01),
        Case(hk.holonomic(iiwa, hk.linear([1.0, 0, -1, 0, 0, 0, 0]), name="q1 - q3"), IIWA, 0.5, 0.7, 0.2),
    ]


def targets(case: Case, count: int, seed: int = 0) -> np.ndarray:
    """Poses (count, 4, 4): positions evenly in a ball about the tool, turned about random axes."""
    rng, task = np.random.default_rng(seed), case.strategy.task
    home = task.robot.pose(case.start, task.tip)
    v = rng.normal(size=(count, 3))
    if task.robot.planar:
        v[:, 2] = 0.0
    v *= case.reach * rng.uniform(size=(count, 1)) ** (1 / 2 if task.robot.planar else 1 / 3)
    w = rng.normal(size=(count, 3))
    w *= case.turn * rng.uniform(size=(count, 1)) / np.linalg.norm(w, axis=1, keepdims=True)
    poses = np.tile(home, (count, 1, 1))
    poses[:, :3, 3] += (
        v
        / np.maximum(1e-12, np.linalg.norm(v, axis=1, keepdims=True))
        * np.minimum(np.linalg.norm(v, axis=1, keepdims=True), case.reach)
    )
    poses[:, :3, :3] = Rotation.from_rotvec(w).as_matrix() @ home[:3, :3]
    return poses


class Continuation:
    """The referee: small steps with its own control. `run` gives postures (k, n), NaN where the path ends."""

    def __init__(self, case: Case, poses: np.ndarray) -> None:
        s = case.strategy
        home = s.task.robot.pose(case.start, s.task.tip)
        self.correct, self.c = leaf_step(s), np.atleast_1d(s.constraint_value(case.start))
        self.p0, self.R0, self.p = home[:3, 3], home[:3, :3], poses[:, :3, 3]
        self.turn = Rotation.from_matrix(poses[:, :3, :3] @ self.R0.T).as_rotvec()
        self.q = np.tile(case.start, (len(poses), 1))
        self.side = self.correct(case.start, self.p0, self.R0, self.c)[3]

    def at(self, which: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Targets of some poses at a share of the way."""
        R = Rotation.from_rotvec(share * self.turn[which]).as_matrix() @ self.R0
        return self.p0 + share * (self.p[which] - self.p0), R

    def step(self, which: np.ndarray, share: float) -> np.ndarray:
        """One step of some postures to a share; returns which went well."""
        p, R = self.at(which, share)
        q = self.q[which]
        first, rcond, margin, side = self.correct.batch(q, p, R, self.c)
        q = q + first
        second, rcond2, margin2, side2 = self.correct.batch(q, p, R, self.c)
        third = self.correct.batch(q + second, p, R, self.c)[0]
        size, off = np.abs(first).max(axis=1), np.abs(second).max(axis=1)
        good = (off <= 0.02 * size + 1e-13) & (size < 0.01) & (side == self.side) & (side2 == self.side)
        good &= (np.minimum(rcond, rcond2) > 1e-9) & (np.minimum(margin, margin2) > 1e-6)
        good &= np.isfinite(q + second + third).all(axis=1)
        self.q[which[good]] = (q + second + third)[good]
        return good

    def run(self, steps: int = STEPS) -> np.ndarray:
        """Every posture to its target."""
        alive = np.arange(len(self.q))
        for i in range(steps):
            good = self.step(alive, (i + 1) / steps)
            ended = [k for k in alive[~good] if not self._finely(np.array([k]), i / steps, (i + 1) / steps)]
            if ended:
                self.q[ended] = np.nan
                alive = np.setdiff1d(alive, ended)
        return self.q

    def _finely(self, one: np.ndarray, share: float, goal: float) -> bool:
        width = (goal - share) / 2
        while share < goal:
            there = min(goal, share + width)
            if self.step(one, there)[0]:
                share, width = there, 1.5 * width
            else:
                width /= 2
                if width < 1e-13:
                    return False
        return True


def exported(case: Case) -> Callable[[np.ndarray], np.ndarray | None]:
    """pose -> q by the exported C, None where it refuses."""
    s, home = case.strategy, tempfile.TemporaryDirectory()
    made = export_c(s, Path(home.name), q0=case.start, name="law", limits=False, vectors_count=1)
    source = (Path(home.name) / "law.c").read_text("utf-8")
    loaded: Any = native.library(source, long=True, includes=(home.name,))
    leaf = np.atleast_1d(s.constraint_value(case.start)).astype(float)
    assert made.name == "law"  # noqa: S101

    def ik(pose: np.ndarray) -> np.ndarray | None:
        q = case.start.copy()
        target = np.ascontiguousarray(pose[:3, 3] if s.task.orientation is None else pose)
        at = [ctypes.c_void_p(a.ctypes.data) for a in (q, target, leaf)]
        return q if loaded.law_inverse(*at, 50_000) == 0 else None

    return ik


@dataclass(frozen=True)
class Count:
    """What became of the targets of one case."""

    name: str
    targets: int
    reached: int
    different: int
    refused: int
    by_c: int


def compare(case: Case, count: int, steps: int = STEPS, seed: int = 0) -> Count:
    """Inverse kinematics against the continuation; `by_c`: answers of the exported C that are not Python's."""
    poses = targets(case, count, seed)
    truth = Continuation(case, poses).run(steps)
    ik = hk.ik(case.strategy, case.start, limits=False)
    c_ik = exported(case) if compiler() is not None else None
    different = refused = by_c = 0
    for pose, wanted in zip(poses, truth, strict=True):
        try:
            q: np.ndarray | None = ik(pose)
        except (BranchError, OutOfReachError, SingularityError):
            q = None
        if q is not None:
            different += not np.abs(q - wanted).max() < 1e-6  # NaN, where the path ends, included
        else:
            refused += bool(np.isfinite(wanted).all())
        if c_ik is not None:
            other = c_ik(pose)
            by_c += (other is None) != (q is None) or (q is not None and not np.abs(q - other).max() < 1e-9)
    task = case.strategy.task
    return Count(
        f"{case.strategy.name}, {task.name}", count, int(np.isfinite(truth[:, 0]).sum()), different, refused, by_c
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=20_000)
    parser.add_argument("--only", type=int, nargs="*", default=None)
    parser.add_argument("--quick", action="store_true", help="four targets of two laws, in fewer steps")
    args = parser.parse_args(arguments)
    if args.quick:
        args.targets, args.only = 40, [0, 2]
    print("| law and task | targets | within reach | answered otherwise | refused | exported C otherwise |", flush=True)
    print("|---|---:|---:|---:|---:|---:|", flush=True)
    for k, case in enumerate(cases()):
        if args.only is None or k in args.only:
            c = compare(case, round(case.share * args.targets), 1000 if args.quick else STEPS)
            row = (c.name, c.targets, c.reached, c.different, c.refused, c.by_c)
            print("| " + " | ".join(map(str, row)) + " |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
