"""Referee of proofs: Newton's method in doubles, from anywhere in the tubes."""

from __future__ import annotations

import numpy as np

import holokin as hk
from conftest import PANDA_START
from holokin.proof.certificate import Certificate


def start(robot: hk.Robot, q: np.ndarray) -> np.ndarray:
    return robot.pose(q)[:3, 3]


def newton(proof: Certificate, cell: int, y: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """A root of E(., y) of a cell, in doubles, from q; nothing where Newton's method does not converge."""
    equation, n = proof.equation, proof.equation.n
    for _ in range(30):
        at = np.concatenate([q, y, proof.cells.numbers[cell], proof.c])[:, None]
        found = equation.value(at, at).middle.ravel()
        E, A = found[:n], found[n:].reshape(n, n).T
        E[[*np.zeros(equation.strategy.task.m, bool), *equation.strategy.constraint.angular]] %= 2 * np.pi
        E = np.where(np.pi < E, E - 2 * np.pi * (np.abs(E - 2 * np.pi) < 1), E)
        if not np.isfinite(A).all() or np.linalg.cond(A) > 1e12:
            return None
        step = np.linalg.solve(A, E)
        q = q - step
        if np.linalg.norm(step) < 1e-13:
            return q
    return None


def roots_are_where_they_should_be(proof: Certificate, rng: np.random.Generator, each: int = 2) -> None:
    """At random poses of each cell Newton finds the root within r, and from random starts in the tube no other."""
    cells, f = proof.cells, proof.findings
    for i in rng.permutation(len(cells))[:40]:
        for _ in range(each):
            y = rng.uniform(-1, 1, proof.equation.d)
            middle = cells.predicted(np.tile(y, (len(cells), 1)))[i]
            root = newton(proof, i, y, middle)
            assert root is not None
            assert np.linalg.norm(root - middle) <= f.r[i] + 1e-12
            assert (f.low[i] <= root + 1e-12).all() and (root - 1e-12 <= f.high[i]).all()
            away = rng.normal(size=len(root))
            other = newton(proof, i, y, middle + 0.9 * f.alone[i] * away / np.linalg.norm(away))
            if other is not None and np.linalg.norm(other - middle) < f.alone[i]:
                assert np.allclose(other, root, atol=1e-10)


def near_panda(robot: hk.Robot, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> hk.Path:
    x = start(robot, PANDA_START)
    return hk.line(x, x + [0.02, 0.01, -0.01], turn=turn)
