"""The checker against those who would deceive it: false certificates with the right SHA-256, one number changed."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import sampled
from forged import (
    NONE,
    REJECTED,
    VERIFIED,
    Data,
    assert_true,
    cells,
    changed,
    outcome,
    outcome_of,
    parabola,
    shifted,
    torn,
    triangle,
)
from holokin.proof.certificate import digest


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("checker") / "certificate.json"


@pytest.fixture(scope="module")
def loop() -> Data:
    return triangle()


@pytest.fixture(scope="module")
def box() -> hk.proof.Certificate:
    arm = hk.load("planar-3r")
    q = np.array([0.3, 0.9, 0.9])
    G = hk.holonomic(hk.position(arm, rows=[0, 1]), hk.linear([[0, 1, -1]]))
    return hk.certify(G, hk.workspace(box=(arm.pose(q)[:3, 3], [0.3, 0.3, 0.0])), q)


def test_a_theorem_that_is_true_is_verified_whether_found_or_made_by_hand(loop: Data, box: Any, file: Path) -> None:
    assert outcome(loop, file) == outcome(box.data, file) == outcome(parabola(), file) == VERIFIED
    assert outcome(parabola((-1.0, -1.0)), file) == VERIFIED


def test_two_branches_are_not_glued(file: Path) -> None:
    assert outcome(parabola((1.0, -1.0)), file) == REJECTED


def test_a_root_that_is_double_is_not_certified(file: Path) -> None:
    false = changed(parabola(offset=1e-9), lambda data: data["claims"].update(determinant=0.0))
    assert outcome(false, file) == REJECTED


@pytest.mark.parametrize(("offset", "expected"), [(0.1, VERIFIED), (0.08, VERIFIED), (0.02, REJECTED)])
def test_a_wide_cell_is_verified_part_by_part_but_not_two_roots(offset: float, expected: str, file: Path) -> None:
    """q = sqrt(offset + u) for 0 <= u <= 1 in one cell; the other root is -q."""
    data, q = parabola(offset=offset), math.sqrt(offset + 0.5)
    data["pieces"][0]["cells"] = {"q0": [q], "V": [[0.25 / q]], "Q": [[[-0.0625 / q**3]]], "Y": [[0.5 / q]]}
    data["claims"] |= {"determinant": 0.0, "joints": [[-9.0], [-9.0], [9.0], [9.0]]}
    assert outcome(data, file) == expected


@sampled(1, "change", [40.0, -40.0])
def test_an_unsymmetric_bend_of_the_predictor_is_not_trusted(change: float, box: Any, file: Path) -> None:
    """y Q y is that of the symmetric part, and so are its derivatives."""
    data = copy.deepcopy(box.data)
    for cell in cells(data["pieces"][0]["cells"]):
        for Q in cell["Q"]:
            Q[0][1] += change
    assert outcome(data, file) == REJECTED
    for cell in cells(data["pieces"][0]["cells"]):
        for Q in cell["Q"]:
            Q[1][0] -= change
    assert outcome(data, file) == VERIFIED  # the same polynomial


def test_an_equation_with_a_jump_or_a_kink_is_rejected(file: Path) -> None:
    """q = sign(u - 1/2) and q = |u - 1/2| with cells whose cut is at the kink."""
    for more in ([], [["mul", 4, 5]]):
        data = parabola()
        data["constants"] = [0.5, 1.0]
        data["operations"] = [["sub", 1, 2], ["sign", 4], *more, ["sub", 0, 5 + len(more)]]
        data["outputs"] = [6 + len(more), 3]
        sides = ((1.0, -0.25, -1.0), (2.0, 0.25, 1.0))
        for cell, (_, slope, value) in zip(cells(data["pieces"][0]["cells"]), sides, strict=True):
            cell |= {"q0": [0.25 if more else value], "V": [[slope if more else 0.0]], "Q": [[[0.0]]], "Y": [[1.0]]}
        data["pieces"][0]["q"] = [0.5 if more else -1.0]
        assert outcome(data, file) == REJECTED


def part_of(box: Any, wanted: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Data:
    """A box some of whose cells are taken away; the claim is of a part."""
    data = copy.deepcopy(box.data)
    data["claims"]["whole"] = False

    def keep(tree: Any, low: list[float], high: list[float]) -> Any:
        if isinstance(tree, dict):
            return tree if wanted(np.array(low), np.array(high)) else None
        if tree:
            axis, at = tree[:2]
            tree[2] = keep(tree[2], low, [*high[:axis], at, *high[axis + 1 :]])
            tree[3] = keep(tree[3], [*low[:axis], at, *low[axis + 1 :]], high)
        return tree

    data["pieces"][0]["cells"] = keep(data["pieces"][0]["cells"], [-1.0] * 3, [1.0] * 3)
    return data


def test_cells_of_a_part_of_a_box_must_hang_together_and_hold_the_start(box: Any, file: Path) -> None:
    assert outcome(part_of(box, lambda low, high: low[0] < -0.2), file) == VERIFIED
    assert outcome(part_of(box, lambda low, high: (low[0] < -0.2) | (low[0] > 0.2)), file) == REJECTED
    assert outcome(part_of(box, lambda low, high: low[0] > 0.2), file) == REJECTED
    claimed = changed(part_of(box, lambda low, high: low[0] < -0.2), lambda d: d["claims"].update(whole=True))
    assert outcome(claimed, file) == REJECTED


def first(data: Data) -> Data:
    return next(cells(data["pieces"][0]["cells"]))


FALSE: dict[str, Callable[[Data], Any]] = {
    "a start that is not on the leaf": lambda d: shifted(d["pieces"][0]["q"], 1e-6),
    "a start at the other elbow": lambda d: d["pieces"][0].update(q=[2.1, -0.9, -0.9]),
    "a piece that begins elsewhere": lambda d: shifted(d["pieces"][1]["q"], 1e-6),
    "pieces in another order": lambda d: d["pieces"].reverse(),
    "a piece left out": lambda d: d["pieces"].pop(1),
    "a piece twice": lambda d: d["pieces"].insert(1, d["pieces"][0]),
    "no piece": lambda d: d["pieces"].clear(),
    "no cells": lambda d: d["pieces"][0].update(cells=None),
    "no cells, as an empty one": lambda d: d["pieces"][0].update(cells={}),
    "a half without cells": lambda d: d["pieces"][0]["cells"].__setitem__(2, None),
    "the halves changed over": lambda d: d["pieces"][0].update(
        cells=d["pieces"][0]["cells"][:2] + d["pieces"][0]["cells"][:1:-1]
    ),
    "three parts of a cut": lambda d: d["pieces"][0]["cells"].append(d["pieces"][0]["cells"][3]),
    "a cut outside": lambda d: d["pieces"][0]["cells"].__setitem__(1, 1.5),
    "a cut at an end": lambda d: d["pieces"][0]["cells"].__setitem__(1, 0.0),
    "a cut at no number": lambda d: d["pieces"][0]["cells"].__setitem__(1, math.nan),
    "a cut across what is not there": lambda d: d["pieces"][0]["cells"].__setitem__(0, 1),
    "a cut across a negative axis": lambda d: d["pieces"][0]["cells"].__setitem__(0, -1),
    "a turn that is not": lambda d: d["claims"].update(turns=[1, 0, 0]),
    "half a turn": lambda d: d["claims"].update(turns=[0.5, 0, 0]),
    "turns of two joints": lambda d: d["claims"].update(turns=[0, 0]),
    "a hull that is too small": lambda d: d["claims"]["joints"][1].__setitem__(0, d["claims"]["joints"][1][0] + 0.05),
    "a hull of two joints": lambda d: d["claims"]["joints"][2].pop(),
    "limits within the hull": lambda d: d["claims"]["joints"][3].__setitem__(1, d["claims"]["joints"][2][1] - 1e-9),
    "a larger determinant": lambda d: d["claims"].update(determinant=1e3 * d["claims"]["determinant"]),
    "a smaller gap": lambda d: d["claims"].update(gap=1e-17),
    "a gap that says nothing": lambda d: d["claims"].update(gap=1e300),
    "a gap of a millimetre": lambda d: d["claims"].update(gap=1e-3),
    "a piece shifted by 0.1 mm": lambda d: torn(d, 1e-4),
    "a piece shifted by 10 nm": lambda d: torn(d, 1e-8),
    "limits that are none": lambda d: d["claims"]["joints"][0].__setitem__(0, -1e300),
    "limits the wrong way round": lambda d: d["claims"]["joints"].reverse(),
    "a hull that is none": lambda d: d["claims"]["joints"][2].__setitem__(0, 1e300),
    "degrees": lambda d: d.update(units=["deg", "deg", "deg"]),
    "more units than joints": lambda d: d["units"].append("m"),
    "no units": lambda d: d.update(units=[]),
    "a format of its own": lambda d: d.update(format="mine"),
    "no format": lambda d: d.update(format=None),
    "operations without end": lambda d: d.update(operations=d["operations"] + [["add", 0, 0]] * 300_000),
    "joints without end": lambda d: [piece.update(q=[0.0] * 3000) for piece in d["pieces"]],
    "a negative gap": lambda d: d["claims"].update(gap=-1.0),
    "no gap": lambda d: d["claims"].update(gap=math.nan),
    "an endless gap": lambda d: d["claims"].update(gap=math.inf),
    "another leaf": lambda d: shifted(d["level"], 1e-6),
    "a level of two numbers": lambda d: d["level"].append(0.0),
    "no level": lambda d: d["level"].clear(),
    "no joints": lambda d: [piece.update(q=[]) for piece in d["pieces"]],
    "joints that do not count": lambda d: d.update(outputs=[d["outputs"][-1]] * len(d["outputs"])),
    "a row less": lambda d: d["outputs"].pop(0),
    "a row twice": lambda d: d["outputs"].__setitem__(1, d["outputs"][0]),
    "a tool that faces away": lambda d: d["constants"].__setitem__(-1, -1.0),
    "an unknown operation": lambda d: d["operations"][0].__setitem__(0, "floor"),
    "an operation without arguments": lambda d: d["operations"].__setitem__(0, ["add"]),
    "an operation of what comes later": lambda d: d["operations"].__setitem__(0, ["sin", 10_000]),
    "an operation of half a place": lambda d: d["operations"].__setitem__(0, ["sin", 0.5]),
    "a name for a number": lambda d: first(d)["q0"].__setitem__(0, "one"),
    "no number": lambda d: first(d)["q0"].__setitem__(0, math.nan),
    "a list for a number": lambda d: first(d)["V"].__setitem__(0, [[1.0]]),
    "a predictor of two joints": lambda d: first(d)["q0"].pop(),
    "a matrix Y that is singular": lambda d: first(d).update(Y=[[0.0] * 3] * 3),
    "a cell as a list of lists": lambda d: d["pieces"][0].update(cells=[[[]]]),
    "a file that is a list": lambda d: d.update(claims=[]),
}  # fmt: skip


@sampled(25, "name", FALSE)
def test_a_false_certificate_with_the_right_digest_is_not_verified(name: str, loop: Data, file: Path) -> None:
    assert outcome(changed(loop, FALSE[name]), file) in (REJECTED, NONE)


def test_a_certificate_without_one_of_its_parts_is_rejected(loop: Data, file: Path) -> None:
    words = {"task", "title", "theorem", "where", "robot", "names"}
    for key in set(loop) - words:
        assert outcome(changed(loop, lambda d, key=key: d.pop(key)), file) == (NONE if key == "format" else REJECTED), (
            key
        )
    for key in loop["claims"]:
        assert outcome(changed(loop, lambda d, key=key: d["claims"].pop(key)), file) == REJECTED, key


def test_a_file_that_is_not_byte_for_byte_what_was_written_is_rejected(loop: Data, file: Path) -> None:
    text = json.dumps(loop | {"sha256": digest(loop)}) + "\n"
    assert outcome_of(text, file) == VERIFIED
    assert outcome_of(text.replace('"whole": true', '"whole": false, "whole": true'), file) == REJECTED
    assert outcome_of(text.replace("0.5", "0.50", 1), file) == REJECTED
    assert outcome_of(json.dumps(loop | {"sha256": digest(loop)}, indent=1) + "\n", file) == REJECTED
    number = repr(loop["claims"]["determinant"])
    for other in ("1e999", "-Infinity", "NaN", "1" * 5000):
        assert outcome_of(text.replace(number, other), file) in (REJECTED, NONE)
    for nonsense in ("", "[" * 100_000, "null", "3", "[]", '{"sha256": 1}', "\x00"):
        assert outcome_of(nonsense, file) in (REJECTED, NONE)


def leaves(part: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where numbers are."""
    if isinstance(part, dict | list):
        for key, value in part.items() if isinstance(part, dict) else enumerate(part):
            yield from leaves(value, (*place, key))
    elif isinstance(part, int | float) and not isinstance(part, bool):
        yield place


def with_number(data: Data, place: tuple[Any, ...], value: float) -> Data:
    other = copy.deepcopy(data)
    part: Any = other
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    return other


def number_at(data: Any, place: tuple[Any, ...]) -> float:
    for key in place:
        data = data[key]
    return data


def relevant(data: Data, place: tuple[Any, ...], amount: float) -> float:
    value = number_at(data, place)
    return value + round(10 * amount) if isinstance(value, int) else value + amount * max(1.0, abs(value))


@given(st.data(), st.floats(-1, 1).filter(lambda x: abs(x) > 0.2), st.integers(-12, 0))
def test_a_certificate_with_any_number_changed_is_rejected_or_still_true(
    loop: Data, file: Path, draw: st.DataObject, amount: float, power: int
) -> None:
    """The predictors and Y claim nothing, a claim may be weaker, and a number may not matter; else it is rejected."""
    place = draw.draw(st.sampled_from(list(leaves(loop))))
    other = with_number(loop, place, relevant(loop, place, amount * 10.0**power))
    if other != loop and outcome(other, file) == VERIFIED:
        assert_true(other)


STATED = [("level",), ("pieces", 0, "q"), ("pieces", 1, "q"), ("pieces", 2, "q"), ("claims", "turns")]


@given(st.data(), st.floats(-1, 1).filter(lambda x: abs(x) > 0.2), st.integers(-9, 0))
def test_another_leaf_start_or_turn_is_always_rejected(
    loop: Data, file: Path, draw: st.DataObject, amount: float, power: int
) -> None:
    place = draw.draw(st.sampled_from([p for p in leaves(loop) if any(p[: len(s)] == s for s in STATED)]))
    other = with_number(loop, place, relevant(loop, place, amount * (1 if "turns" in place else 10.0**power)))
    assert outcome(other, file) in (REJECTED, NONE)


@given(st.data(), st.floats(0.2, 1), st.booleans())
def test_a_number_changed_under_the_old_digest_is_always_rejected(
    loop: Data, file: Path, draw: st.DataObject, amount: float, small: bool
) -> None:
    place = draw.draw(st.sampled_from(list(leaves(loop))))
    value = number_at(loop, place)
    other = np.nextafter(value, np.inf) if small and isinstance(value, float) else value + amount
    text = json.dumps(with_number(loop, place, float(other)) | {"sha256": digest(loop)}) + "\n"
    assert outcome_of(text, file) == REJECTED
