"""A handful of random certificates examined in NumPy, and that the examination sees what is not so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from benchmarks import certificates
from benchmarks.certificates import Examined
from benchmarks.random_arms import Motion, Problem, random_motion, random_posture, random_problem

import holokin as hk
from conftest import sampled
from holokin.proof import Certificate, certify


@pytest.fixture(autouse=True)
def virtual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compilers take longer than these robots."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


def proven(seed: int, kind: str) -> tuple[Problem, Motion, np.ndarray, Certificate]:
    """A certificate of the seed's robot."""
    problem, rng = random_problem(np.random.default_rng([seed, 99])), np.random.default_rng([seed, 7])
    start = random_posture(problem, rng, near=False)
    motion = random_motion(kind, problem, start, rng)
    return problem, motion, start, certify(problem.strategy, motion.where, start, budget=60)


def faults(problem: Problem, motion: Motion, start: np.ndarray, proof: Certificate) -> list[str]:
    examined = Examined(problem, motion, start, proof)
    examined.roots(np.random.default_rng(1))
    examined.continued(np.random.default_rng(2))
    assert examined.counts["roots"] == certificates.EACH * len(proof)
    return examined.faults


@pytest.mark.campaign
def test_forward_kinematics_and_constraints_in_numpy_are_those_of_holokin() -> None:
    """Of thirty random arms: the pose, |det [J; J_g]|, the level."""
    rng = np.random.default_rng(3)
    for _ in range(30):
        problem = random_problem(rng)
        q = random_posture(problem, rng, near=False)
        frame = problem.arm.frames(q[None])[:, -1]
        np.testing.assert_allclose(frame[0], problem.arm.robot.pose(q), atol=1e-12)
        level = problem.level(q)
        strategy = problem.strategy
        np.testing.assert_allclose(level, np.ravel(strategy.g(q)), atol=1e-11)
        A = problem.slopes(q[None], frame[:, :3, 3], frame[:, :3, :3], level)[1][0]
        steps = 1e-5 * np.eye(problem.arm.n)
        slopes = [strategy.constraint.nearest(np.ravel(strategy.g(q + h)) - np.ravel(strategy.g(q - h))) for h in steps]
        mine = np.vstack([problem.arm.task.jacobian(q), np.array(slopes).T / 2e-5])
        assert abs(np.linalg.det(A)) == pytest.approx(abs(np.linalg.det(mine)), rel=1e-5, abs=1e-8)


@sampled(1, ("seed", "kind"), [(26, "line"), (35, "circle"), (36, "triangle"), (28, "box")])
def test_a_random_certificate_holds_by_newton_and_by_continuation(seed: int, kind: str) -> None:
    """The circle is proven in part."""
    certificate = proven(seed, kind)
    assert len(certificate[-1]) and not faults(*certificate)


def spoiled(proof: Certificate, part: str, **changed: Any) -> Certificate:
    return replace(proof, proven=replace(proof.proven, **{part: replace(getattr(proof.proven, part), **changed)}))


@pytest.mark.campaign
def test_each_kind_of_fault_is_seen() -> None:
    """A radius, a hull, a determinant, a limit, a predictor, and a robot that is another one."""
    problem, motion, start, proof = proven(28, "circle")
    f, n = proof.findings, len(proof)

    def said(of: Certificate, arm: Problem = problem) -> str:
        return " ".join(faults(arm, motion, start, of))

    assert not said(proof)
    assert "r from its predictor" in said(spoiled(proof, "findings", r=f.r * 1e-9))
    assert "outside the hull of its cell" in said(spoiled(proof, "findings", high=f.low))
    assert "above the hull" in said(replace(proof, high=proof.low))
    assert "|det| is" in said(replace(proof, determinant=1e3))
    assert "two roots" in said(spoiled(proof, "findings", alone=np.full(n, 50.0)))
    assert "no cell holds" in said(replace(proof, proven=proof.proven.only(np.arange(n) != 1)))
    assert "r from its predictor" in said(spoiled(proof, "cells", q0=proof.cells.q0 + 1e-3))
    rows = problem.arm.rows.copy()
    rows[1, 0] += 1e-3
    assert "r from its predictor" in said(proof, replace(problem, arm=replace(problem.arm, rows=rows)))
    tight = replace(
        problem.arm, lower=np.full(problem.arm.n, start - 1e-6).ravel()[: problem.arm.n], upper=start + 1e-6
    )
    limits = hk.symbolic.intervals.Interval(tight.lower, tight.upper)
    bounded = replace(proof, demands=replace(proof.demands, limits=limits))
    assert "beyond a joint limit" in said(bounded, replace(problem, arm=tight))
    assert "ends" in said(replace(proof, turns=proof.turns + 1.0))


def test_a_continuation_does_not_get_through_a_fold() -> None:
    """A line that is said to be proven although it leaves the workspace of the arm."""
    problem, motion, start, proof = proven(20, "line")
    far = Motion("line", motion.where, lambda piece, u: motion.poses(piece, 400 * u))
    assert any("does not get through" in fault for fault in faults(problem, far, start, proof))


def test_the_campaign_goes_on_where_it_was_stopped(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seeds that are in the file are not done again; a fault ends it with 1."""
    done: list[int] = []

    def tried(seed: int) -> dict[str, Any]:
        done.append(seed)
        counts = {"certificates": 8, "with cells": 8, "ended: WHOLE": 8, "cells": 9, "roots": 27}
        return {"seed": seed, "counts": counts, "faults": ["seed 5: a fault"] * (seed == 5), "seconds": 1.0}

    monkeypatch.setattr(certificates, "tried", tried)
    file = str(tmp_path / "rows.jsonl")
    for count, expected, code in ((16, [0, 1], 0), (40, [2, 3, 4], 0), (48, [5], 1), (48, [], 1)):
        done.clear()
        monkeypatch.setattr("sys.argv", ["certificates", "--count", str(count), "--out", file])
        assert (certificates.main(), done) == (code, expected)
