"""The functions that the checker encloses, and honest certificates that it verifies: angles beside their cut, roots."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import holokin as hk
from forged import REJECTED, VERIFIED, Data, cells, checker, outcome, parabola


def equation(operations: list[Any], constants: list[float], outputs: list[int], roots: list[Any]) -> Data:
    """Made by hand: E over one cell, whose roots are straight in u, from the first to the second of `roots`."""
    n, ends = len(roots[0]), np.array(roots)
    cell = {
        "q0": ends.mean(axis=0).tolist(), "V": ((ends[1] - ends[0]) / 2)[:, None].tolist(),
        "Q": [[[0.0]]] * n, "Y": np.eye(n).tolist(),
    }  # fmt: skip
    claims = {"whole": True, "joints": [[side] * n for side in (-9.0, -9.0, 9.0, 9.0)], "gap": 1e-9, "turns": None}
    return parabola() | {
        "units": ["m"] * n, "constants": constants, "operations": operations, "outputs": outputs,
        "claims": claims | {"determinant": 0.0},
        "pieces": [{"numbers": [], "u": [0.0], "q": ends[0].tolist(), "cells": cell}],
    }  # fmt: skip


@pytest.mark.parametrize("fixed", [None, 0, 1])
@pytest.mark.parametrize("name", sorted(checker.RULES))
def test_derivatives_are_those_of_the_value(name: str, fixed: int | None) -> None:
    """First and second ones along y, of every operation, and with one of two arguments constant."""
    binary = name in ("add", "sub", "mul", "atan2")
    if fixed is not None and not binary:
        return
    rng = np.random.default_rng(5)
    for _ in range(5):
        constants = [rng.uniform(0.3, 2.0), 1.0]
        bent = [["sq", 0], ["add", 4, 0]]  # 4, 5: q^2 + q
        data = equation([*bent, [name, *((2, 5)[::-1] if fixed else (2, 5))] if fixed is not None else
                        [name, *([5, 0] if binary else [5])]], constants, [6, 3], [[0.5], [0.9]])  # fmt: skip
        made = checker.Checker(data, lambda _: None, 99.0, 1)
        made.numbers = [checker.arb(x) for x in constants]
        cell = checker.Cell(data["pieces"][0]["cells"], [(0, 1)])
        zero = checker.arb_mat(1, 1)

        def at(y: float, made: Any = made, cell: Any = cell, zero: Any = zero) -> Any:
            return made.enclose(cell, checker.arb_mat([[y]]), zero, True)

        y, h = rng.uniform(-0.9, 0.9), 1e-5
        (before, (D_before, _)), (_, (D, bend)), (after, (D_after, _)) = at(y - h), at(y), at(y + h)
        slope = float((after[0, 0] - before[0, 0]).mid()) / (2 * h)
        assert float(D[0, 0].mid()) == pytest.approx(slope, abs=1e-8)
        second = (D_after - D_before) / (2 * h)
        for k in range(2):
            assert float(bend[0, k].mid()) == pytest.approx(float(second[0, k].mid()), abs=1e-7)


@pytest.mark.parametrize(("x", "at", "expected"), [
    (1.0, 0.5, VERIFIED), (1.0, 0.0, VERIFIED), (-1.0, -0.1, VERIFIED), (-1.0, 1.1, VERIFIED),
    (-1.0, 0.5, REJECTED), (-1.0, 0.3, REJECTED), (-1.0, 0.0, REJECTED), (-1.0, 1.0, REJECTED),
])  # fmt: skip
def test_an_angle_is_verified_but_for_its_cut(x: float, at: float, expected: str, tmp_path: Path) -> None:
    """q = atan2(u - at, x); beyond the cut the predictor goes on as if there were none."""
    ends = [[(0.0 if x > 0 else math.copysign(math.pi, 0.5 - at)) + math.atan((u - at) / x)] for u in (0.0, 1.0)]
    data = equation([["sub", 1, 2], ["atan2", 5, 3], ["sub", 0, 6]], [at, x, 1.0], [7, 4], ends)
    data["pieces"][0]["q"] = [math.atan2(-at, x)] if at else ends[0]
    assert outcome(data, tmp_path / "cut.json") == expected


def test_cells_whose_predictors_are_off_to_both_sides_share_their_root() -> None:
    """On one branch cells that are proven never seem to jump, however they are off; on two branches they share none."""
    rng, proven = np.random.default_rng(4), 0
    for _ in range(20):
        offset, off = rng.uniform(0.2, 1.0), rng.uniform(0.02, 0.12)
        for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):
            data = parabola(signs, offset)
            data["claims"] |= {"determinant": 0.0, "joints": [[-9.0], [-8.0], [8.0], [9.0]]}
            for cell, side in zip(cells(data["pieces"][0]["cells"]), (off, -off), strict=True):
                cell["q0"][0] += side
            try:
                checker.Checker(data, lambda _: None, 99.0, 2).verify()
                assert signs[0] == signs[1]
                proven += 1
            except checker.RejectedError as problem:
                assert signs[0] != signs[1] or "jump" not in str(problem)
    assert proven > 10


def test_branches_that_come_near_are_not_glued(tmp_path: Path) -> None:
    """The roots q and -q, ever nearer, of predictors that are off towards each other."""
    for offset in np.geomspace(1e-6, 0.5, 6):
        for share in (0.0, 0.3, 0.9):
            data = parabola((1.0, -1.0), float(offset))
            data["claims"] |= {"determinant": 0.0, "joints": [[-9.0], [-8.0], [8.0], [9.0]]}
            for cell in cells(data["pieces"][0]["cells"]):
                cell["q0"][0] *= 1 - share
            assert outcome(data, tmp_path / "near.json") == REJECTED


def test_a_path_whose_ends_cannot_be_compared_is_not_called_closed(tmp_path: Path) -> None:
    """q1 = 1, q2 = u - sqrt(q2 + 0.3 - u / 2) / 100: where it ends, E of the joints of its start is no number."""
    rows = [["sub", 0, 6], ["mul", 2, 3], ["sub", 1, 8], ["add", 9, 4], ["sqrt", 10]]  # 7 to 11
    rows += [["mul", 11, 5], ["sub", 1, 2], ["add", 13, 12]]  # 12 to 14
    start = end = 0.0
    for _ in range(60):
        start, end = -0.01 * math.sqrt(start + 0.3), 1 - 0.01 * math.sqrt(max(end - 0.2, 0.0))
    data = equation(rows, [0.5, 0.3, 0.01, 1.0], [7, 14, 6], [[1.0, start], [1.0, end]])
    assert outcome(data, tmp_path / "ends.json") == VERIFIED
    assert "the path is open" in checker.check(str(tmp_path / "ends.json")).lines


@pytest.mark.campaign
def test_honest_certificates_of_angles_that_end_at_their_cut_are_verified(tmp_path: Path) -> None:
    """q3 = k atan2 about a centre, on lines towards its cut, where it jumps by no whole turn: cells ever smaller."""
    rng, robot = np.random.default_rng(5), hk.load("ppr")
    for _ in range(2):
        q = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-2, 2)])
        direction, k = rng.uniform(-0.8, 0.8), rng.choice([-0.5, 0.3, 0.5])
        center = q[:2] + rng.uniform(0.15, 0.6) * np.array([np.cos(direction), np.sin(direction)])

        def g(v: casadi.SX, center: np.ndarray = center, k: float = k) -> casadi.SX:
            return v[2] - k * casadi.atan2(v[1] - center[1], v[0] - center[0])

        x, way = robot.pose(q)[:3, 3], np.array([rng.uniform(-0.1, 0.1), -np.sign(q[1] - center[1]), 0.0])
        path = hk.line(x, x + rng.uniform(0.3, 0.6) * way)
        proof = hk.certify(
            hk.holonomic(hk.position(robot), hk.custom(g, angular=True)), path, q, limits=False, budget=150
        )
        assert len(proof) and checker.check(str(proof.save(tmp_path / "angle.json"))).lines
