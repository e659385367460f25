"""Certificates to deceive the checker with: made by hand, or one that `certify` made and somebody changed."""

from __future__ import annotations

import copy
import json
import math
import operator
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.proof.certificate import digest

checker = pytest.importorskip("holokin.proof.checker")

Data = dict[str, Any]
VERIFIED, REJECTED, NONE = "verified", "rejected", "no certificate"


def sealed(data: Data) -> str:
    """The file of data, with the digest that fits them."""
    try:
        return json.dumps(data | {"sha256": digest(data)}) + "\n"
    except ValueError:  # NaN or infinity, which holokin does not write
        return json.dumps(data | {"sha256": "0"}) + "\n"


def outcome(data: Data, file: Path) -> str:
    """Of data with a digest that fits them. Any other error is a failure of the checker."""
    return outcome_of(sealed(data), file)


def outcome_of(text: str, file: Path) -> str:
    file.write_text(text, "utf-8")
    try:
        checker.check(str(file))
    except checker.RejectedError:
        return REJECTED
    except ValueError:
        return NONE
    return VERIFIED


def parabola(signs: tuple[float, float] = (1.0, 1.0), offset: float = 1.0) -> Data:
    """Made by hand: q^2 = offset + u for 0 <= u <= 1, in two cells on branches of these signs."""

    def cell(low: float, high: float, sign: float) -> Data:
        q, h = sign * math.sqrt(offset + (low + high) / 2), (high - low) / 2
        return {"q0": [q], "V": [[h / (2 * q)]], "Q": [[[-(h**2) / (4 * q**3)]]], "Y": [[1 / (2 * q)]]}

    most = math.sqrt(offset + 1) + 0.01
    return {
        "format": "holokin certificate 3", "units": ["m"],
        "constants": [offset, 1.0], "operations": [["sq", 0], ["add", 2, 1], ["sub", 4, 5]], "outputs": [6, 3],
        "level": [], "claims": {
            "whole": True, "joints": [[-9.0], [-most], [most], [9.0]], "determinant": 1.0, "gap": 1e-9, "turns": None,
        }, "pieces": [{
            "numbers": [], "u": [0.0], "q": [signs[0] * math.sqrt(offset)],
            "cells": [0, 0.5, cell(0.0, 0.5, signs[0]), cell(0.5, 1.0, signs[1])],
        }],
    }  # fmt: skip


def changed(data: Data, change: Callable[[Data], Any]) -> Data:
    other = copy.deepcopy(data)
    change(other)
    return other


def cells(tree: Any) -> Iterator[Data]:
    """Those of a tree, in order."""
    if isinstance(tree, dict):
        yield tree
    elif tree:
        yield from cells(tree[2])
        yield from cells(tree[3])


def shifted(values: list[float], by: float, at: int = 0) -> None:
    values[at] += by


def torn(data: Data, by: float) -> None:
    """A path with a gap that the file allows: a piece is moved, with its start and its cells."""
    data["claims"]["gap"] = 1e-6
    piece = data["pieces"][1]
    for at in range(len(piece["numbers"])):  # the number that moves the tool along x at the piece's start
        moved = copy.deepcopy(piece)
        moved["numbers"][at] += by
        change = residual(data, moved, np.array(piece["q"]), 0.0) - residual(data, piece, np.array(piece["q"]), 0.0)
        if abs(abs(change[0]) - by) < 1e-3 * by and np.abs(change[1:]).max() < 1e-3 * by:
            break
    else:
        raise AssertionError("no number moves the piece")
    q = np.array(piece["q"])
    off = np.linalg.solve(derivative(data, piece, q, 0.0), change)
    piece["numbers"][at] += by
    piece["q"] = (q - off).tolist()
    for cell in cells(piece["cells"]):
        cell["q0"] = (np.array(cell["q0"]) - off).tolist()


def residual(data: Data, piece: Data, q: np.ndarray, u: float | np.ndarray) -> np.ndarray:
    """E in doubles, by another reading of the operations."""
    rules: Any = {
        "add": operator.add, "sub": operator.sub, "mul": operator.mul, "sq": lambda a: a * a, "inv": lambda a: 1 / a,
        "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "atan2": math.atan2,
    }  # fmt: skip
    values = [*q.tolist(), *np.atleast_1d(u).tolist(), *piece["numbers"], *data["level"], *data["constants"]]
    for name, *of in data["operations"]:
        values.append(rules[name](*(values[i] for i in of)))
    return np.array([values[i] for i in data["outputs"][: len(q)]])


def derivative(data: Data, piece: Data, q: np.ndarray, u: float | np.ndarray) -> np.ndarray:
    steps = 1e-6 * np.eye(len(q))
    return np.array([residual(data, piece, q + s, u) - residual(data, piece, q - s, u) for s in steps]).T / 2e-6


def assert_true(data: Data) -> None:
    """What is claimed, at some poses, by Newton's method from the start: hull, limits, determinant, start, end."""
    claims, gap = data["claims"], data["claims"]["gap"] + 1e-9
    least, low, high, most = (
        np.array([far if x is None else x for x in row])
        for far, row in zip((-np.inf, -np.inf, np.inf, np.inf), claims["joints"], strict=True)
    )
    for k, piece in enumerate(data["pieces"]):
        d = len(piece["u"])
        start = np.array(piece["u"]) if d > 1 else np.zeros(1)
        ends = np.random.default_rng(0).uniform(-1, 1, (5, d)) if d > 1 else np.ones((1, 1))
        q = np.array(piece["q"])
        for end in ends if claims["whole"] else [start]:
            q = np.array(piece["q"])
            for share in np.linspace(0, 1, 9):
                u = start + share * (end - start)
                for _ in range(3):
                    A = derivative(data, piece, q, u)
                    q = q - np.linalg.solve(A, residual(data, piece, q, u))
                assert share or np.abs(q - piece["q"]).max() <= gap
                assert (least <= low).all() and (low - 1e-9 <= q).all() and (q <= high + 1e-9).all()
                assert (high <= most).all()
                assert abs(np.linalg.det(A)) >= claims["determinant"] - 1e-6
        last, after = k + 1 == len(data["pieces"]), data["pieces"][(k + 1) % len(data["pieces"])]["q"]
        turns = claims["turns"] if last else [0] * len(q)
        if d == 1 and claims["whole"]:
            assert turns is None or np.abs(q - after - 2 * np.pi * np.array(turns)).max() <= gap


def triangle() -> Data:
    """A triangle of a planar arm, from `certify`."""
    arm = hk.load("planar-3r")
    q = np.array([0.3, 0.9, 0.9])
    x = arm.pose(q)[:3, 3]
    path = hk.polyline([x, x - [0.3, 0, 0], x - [0.3, 0.3, 0]], closed=True)
    return hk.certify(hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]])), path, q).data
