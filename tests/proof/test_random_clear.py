"""A handful of random arms among obstacles, of `benchmarks.random_clear`, and that it sees what is not so."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("coal")
pytest.importorskip("flint")

from benchmarks import random_clear
from benchmarks.random_arms import random_posture
from benchmarks.random_clear import Examined, drawn, tried
from benchmarks.random_scenes import Chain, Pointing, Scene, random_case, random_scene

from conftest import campaign
from holokin.proof import Certificate, certify


@pytest.fixture(autouse=True)
def virtual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compilers take longer than these robots."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


FEW = (4, 27, 36, 700)
SEEDS = [seed if seed == FEW[0] else campaign("seed", seed) for seed in sorted({*range(30), *FEW})]


@pytest.mark.parametrize("seed", SEEDS)
def test_no_posture_of_a_random_arm_is_nearer_than_is_proven(seed: int) -> None:
    """Nor is an obstacle proven away that is 1 mm too near, nor a limit that is 1e-3 too narrow."""
    found = tried(seed, 60 if seed in FEW else 300)
    assert not found["faults"]
    if seed in FEW:
        counts = found["counts"]
        assert counts["covered"] and counts["distances"] > 500 and counts["cells verified by the checker"]
        assert [key for key in counts if "1 mm too near" in key] and [key for key in counts if "1e-3 too narrow" in key]


@pytest.mark.campaign
def test_forward_kinematics_of_chains_and_of_tools_that_point_are_those_of_holokin() -> None:
    rng, kinds = np.random.default_rng(3), Counter[str]()
    for _ in range(60):
        problem = random_case(rng)
        kinds += Counter([type(problem.arm).__name__, type(problem).__name__])
        q = random_posture(problem, rng, near=False)
        frame = problem.arm.frames(q[None])[:, -1]
        np.testing.assert_allclose(frame[0], problem.arm.robot.pose(q), atol=1e-12)
        if len(problem.law[3]) != problem.arm.n - len(problem.arm.held):  # an arm angle beside five rows: refused
            continue
        level, strategy = problem.level(q), problem.strategy
        np.testing.assert_allclose(level, np.ravel(strategy.g(q)), atol=1e-11)
        if isinstance(problem, Pointing):
            continue
        A = problem.slopes(q[None], frame[:, :3, 3], frame[:, :3, :3], level)[1][0]
        mine = problem.arm.task.jacobian(q)
        np.testing.assert_allclose(A[: len(mine)], mine, atol=1e-9)
    assert min(kinds[Chain.__name__], kinds[Pointing.__name__]) > 5


def proven(seed: int, folder: Path) -> tuple[Scene, Any, np.ndarray, Certificate]:
    """As `tried` makes it."""
    rng = np.random.default_rng([seed, 31])
    problem, start, motion = drawn(rng)
    clearance = float(rng.choice([0.0, 0.001, 0.01, 0.04]))
    scene = random_scene(problem, start, rng, folder, clearance)
    budget = random_clear.BUDGET[motion.kind]
    proof = certify(scene.strategy, motion.where, start, scene=scene.at(clearance), budget=budget)
    return scene, motion, start, proof


def test_each_kind_of_fault_is_seen(tmp_path: Path) -> None:
    """A distance, a pair, a radius, a rate; an obstacle that is elsewhere; a link that is larger."""
    scene, motion, start, proof = proven(4, tmp_path)
    assert proof.whole

    def said(of: Certificate, among: Scene = scene) -> str:
        examined = Examined(among, motion, start, of, 40)
        examined.postures(np.random.default_rng(1))
        examined.rates()
        examined.distances()
        return " ".join(examined.faults)

    def spoiled(**changed: Any) -> Certificate:
        return replace(proof, proven=replace(proof.proven, findings=replace(proof.findings, **changed)))

    f, clear = proof.findings, proof.demands.clear
    assert not said(proof)
    assert "nearer than is proven" in said(spoiled(apart=f.apart + 0.03))
    assert "nearer than was asked" in said(spoiled(apart=f.apart - 10.0))
    assert "not in the tube" in said(spoiled(r=f.r * 1e-9))
    assert "faster than is proven" in said(spoiled(slopes=f.slopes * 0.3))
    thing = clear.pairs[0].names[1]
    fewer = [i for i, pair in enumerate(clear.pairs) if thing not in pair.names]
    less = replace(proof.demands, clear=replace(clear, pairs=tuple(clear.pairs[i] for i in fewer)))
    assert "nobody says anything" in said(replace(spoiled(apart=f.apart[:, fewer]), demands=less))
    by_arm = scene.problem.arm.frames(start[None])[0, -1]
    moved = [replace(part, place=by_arm) for part in scene.things]
    assert "nearer than is proven" in said(proof, replace(scene, things=moved))
