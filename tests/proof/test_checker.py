"""The checker verifies what is proven, rejects what is changed, and says why; which files it does not read."""

from __future__ import annotations

import copy
import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import casadi
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
    checker,
    derivative,
    outcome,
    outcome_of,
    parabola,
    residual,
    sealed,
    shifted,
    torn,
    triangle,
)
from holokin.proof.certificate import digest
from holokin.proof.checker_file import BYTES
from holokin.proof.recheck import recheck


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


def comb(depth: int) -> Any:
    """Cells cut within each other."""
    return [0, 0.5, None, comb(depth - 1)] if depth else None


FALSE: dict[str, Callable[[Data], Any]] = {  # parts that are of another kind or missing: test_certificate.py
    "a start that is not on the leaf": lambda d: shifted(d["pieces"][0]["q"], 1e-6),
    "a start at the other elbow": lambda d: d["pieces"][0].update(q=[2.1, -0.9, -0.9]),
    "a piece that begins elsewhere": lambda d: shifted(d["pieces"][1]["q"], 1e-6),
    "the halves changed over": lambda d: d["pieces"][0].update(
        cells=d["pieces"][0]["cells"][:2] + d["pieces"][0]["cells"][:1:-1]
    ),
    "a cut outside": lambda d: d["pieces"][0]["cells"].__setitem__(1, 1.5),
    "a cut at an end": lambda d: d["pieces"][0]["cells"].__setitem__(1, 0.0),
    "a cut across a negative axis": lambda d: d["pieces"][0]["cells"].__setitem__(0, -1),
    "a turn that is not": lambda d: d["claims"].update(turns=[1, 0, 0]),
    "half a turn": lambda d: d["claims"].update(turns=[0.5, 0, 0]),
    "a hull that is too small": lambda d: d["claims"]["joints"][1].__setitem__(0, d["claims"]["joints"][1][0] + 0.05),
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
    "operations without end": lambda d: d.update(operations=d["operations"] + [["add", 0, 0]] * 300_000),
    "joints without end": lambda d: [piece.update(q=[0.0] * 3000) for piece in d["pieces"]],
    "another leaf": lambda d: shifted(d["level"], 1e-6),
    "joints that do not count": lambda d: d.update(outputs=[d["outputs"][-1]] * len(d["outputs"])),
    "a tool that faces away": lambda d: d["constants"].__setitem__(-1, -1.0),
    "an operation of what comes later": lambda d: d["operations"].__setitem__(0, ["sin", 10_000]),
    "a matrix Y that is singular": lambda d: first(d).update(Y=[[0.0] * 3] * 3),
    "an operand before the first": lambda d: d["operations"].__setitem__(2, ["sub", -1, 5]),
    "an output before the first": lambda d: d["outputs"].__setitem__(0, -1),
    "an equation that is singular": lambda d: d["operations"].__setitem__(0, ["sub", 0, 0]),
    "cells cut without end": lambda d: d["pieces"][0].update(cells=comb(300)),
    "turns without end": lambda d: d["claims"].update(turns=[10**300, 0, 0]),
}  # fmt: skip


@sampled(25, "name", FALSE)
def test_a_false_certificate_with_the_right_digest_is_not_verified(name: str, loop: Data, file: Path) -> None:
    assert outcome(changed(loop, FALSE[name]), file) in (REJECTED, NONE)


def test_a_file_that_is_not_byte_for_byte_what_was_written_is_rejected(loop: Data, file: Path) -> None:
    text = sealed(loop)
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


def test_a_piece_that_is_moved_is_proven_by_itself_so_that_only_the_tear_rejects_it(loop: Data, file: Path) -> None:
    alone = changed(loop, lambda d: torn(d, 1e-4))
    alone["pieces"] = alone["pieces"][1:2]
    alone["claims"] |= {"turns": None}
    assert outcome(alone, file) == VERIFIED
    file.write_text(json.dumps(changed(loop, lambda d: torn(d, 1e-4)) | {"sha256": "0"}), "utf-8")
    with pytest.raises(checker.RejectedError, match="torn"):
        checker.Checker(changed(loop, lambda d: torn(d, 1e-4)), lambda _: None, 99.0, 1).verify()


def test_what_is_said_is_computed_and_the_words_of_the_file_are_named_as_such(loop: Data, file: Path) -> None:
    """A title that colours the terminal, a robot that it is not, a theorem that nobody proved."""
    forged = changed(
        loop, lambda d: d.update(title="\x1b[31mred\x1b]0;x\x07", robot="panda\n\x9b2J", theorem="all robots")
    )
    forged["names"] = ["\x1b[2J", "\u202egnirts", 3]
    file.write_text(sealed(forged), "utf-8")
    found = checker.check(str(file))
    text = "".join([*found.lines, found.words])
    assert text.isprintable() and "all robots" not in text and "panda" not in "".join(found.lines)
    assert found.whole and "closed: the joints return within" in text and "all of a path of 3 pieces" in text
    low, high = (
        float(x) for x in next(x for x in found.lines if "joint 2" in x).split(": ")[1].split(" rad")[0].split(" to ")
    )
    followed = [residual_root(forged, piece)[1] for piece in forged["pieces"]]
    assert all(low <= q <= high for q in followed)


def residual_root(data: Data, piece: Data) -> np.ndarray:
    """The joints in the middle of a piece, by Newton's method."""
    q = np.array(piece["q"])
    for u in np.linspace(0, 0.5, 20):
        for _ in range(3):
            q = q - np.linalg.solve(derivative(data, piece, q, u), residual(data, piece, q, u))
    return q


@pytest.mark.campaign
def test_whole_turns_that_change_the_equation_are_rejected(file: Path) -> None:
    """q = u + 2 pi k, of a joint that counts itself: sin q would forget the turn, q does not."""
    arm, q = hk.load("planar-3r"), np.array([-3.0, 0.9, 0.9])
    x = arm.pose(q)[:3, 3]
    path = hk.circle(x, center=(0.0, 0.0, x[2]))
    turned = hk.certify(hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]])), path, q, limits=False).data
    assert turned["claims"]["turns"] == [1, 0, 0] and outcome(turned, file) == VERIFIED
    assert outcome(changed(turned, lambda d: d.update(units=["m", "rad", "rad"])), file) == REJECTED
    drifts = hk.certify(hk.holonomic(hk.position(arm), hk.linear([[0.02, 0, 1]])), path, q, limits=False).data
    assert outcome(drifts, file) == VERIFIED
    assert any("do NOT return: they are 6.2315" in line for line in checker.check(str(file)).lines)
    assert outcome(changed(drifts, lambda d: d["claims"].update(turns=[1, 0, 0])), file) == REJECTED


def test_files_that_are_none_are_not_read(file: Path, tmp_path: Path) -> None:
    for data in ({}, {"a": 1}, {"format": "holokin certificate 2"}, [1], "text"):
        assert outcome_of(json.dumps(data), file) == NONE
    for odd in (Path(os.devnull), Path("/dev/zero"), tmp_path):
        if odd.exists():
            with pytest.raises(ValueError, match="not a file"):
                checker.check(str(odd))
    huge = tmp_path / "huge.json"
    with huge.open("wb") as sparse:
        sparse.truncate(10 * BYTES)
    with pytest.raises(ValueError, match="not a file"):
        checker.check(str(huge))


def test_the_time_is_limited(loop: Data, file: Path) -> None:
    file.write_text(sealed(loop), "utf-8")
    with pytest.raises(TimeoutError):
        checker.check(str(file), seconds=0.0)
    with pytest.raises(hk.base.errors.FileError, match="--seconds"):
        recheck(file, seconds=0.0)


def test_the_checker_alone_ends_with_0_1_or_2(loop: Data, file: Path) -> None:
    def run(text: str) -> tuple[int, str]:
        file.write_text(text, "utf-8")
        found = subprocess.run([sys.executable, checker.__file__, file], capture_output=True, text=True, check=False)
        assert "Traceback" not in found.stderr
        return found.returncode, found.stdout + found.stderr

    code, said = run(sealed(loop))
    assert code == 0 and "VERIFIED" in said and "..." in said
    assert run(json.dumps(loop) + "\n")[0] == 1
    assert run("no JSON")[0] == 2
    assert subprocess.run([sys.executable, checker.__file__], capture_output=True, check=False).returncode == 2


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_ends_the_checking_of_the_command_line_without_a_traceback(loop: Data, file: Path) -> None:
    file.write_text(sealed(loop), "utf-8")
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a background job ignores it
        "from holokin.app.cli import main; from holokin.proof import checker; "
        "checker.below = lambda *_: signal.raise_signal(signal.SIGINT); "
        f"sys.argv = ['holokin', 'check-certificate', {str(file)!r}]; main.main()"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 128 + signal.SIGINT and "Traceback" not in found.stderr, found.stderr


# --- The functions that the checker encloses, and honest certificates that it verifies: angles beside their cut, roots.


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
@pytest.mark.parametrize("kind", ["pole", "angle"])
def test_honest_certificates_of_functions_with_a_pole_near_by_and_of_angles_that_end_at_their_cut_are_verified(
    kind: str, tmp_path: Path
) -> None:
    """q3 + c / d^4, and q3 - k atan2, about a centre that is 0.15 to 0.6 m from where a PPR arm begins to move: large
    cells next to a pole; lines towards the cut, where q3 jumps by no whole turn, in cells ever smaller."""
    rng, robot, proven = np.random.default_rng(7), hk.load("ppr"), 0
    for _ in range(4):
        q = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-2, 2)])
        direction = rng.uniform(-np.pi, np.pi) if kind == "pole" else rng.uniform(-0.8, 0.8)
        center = q[:2] + rng.uniform(0.15, 0.6) * np.array([np.cos(direction), np.sin(direction)])
        c, k = rng.uniform(-0.3, 0.3) * 10 ** rng.uniform(-5, -3), rng.choice([-0.5, 0.3, 0.5])

        def g(v: casadi.SX, center: np.ndarray = center, c: float = c, k: float = k) -> casadi.SX:
            x, y = v[0] - center[0], v[1] - center[1]
            return v[2] + c / (x**2 + y**2) ** 2 if kind == "pole" else v[2] - k * casadi.atan2(y, x)

        x, way = robot.pose(q)[:3, 3], np.append(rng.normal(size=2), 0.0)
        if kind == "angle":
            way = np.array([rng.uniform(-0.1, 0.1), -np.sign(q[1] - center[1]), 0.0])
        path = hk.line(x, x + rng.uniform(0.3, 0.5) * way / np.linalg.norm(way))
        G = hk.holonomic(hk.position(robot), hk.custom(g, angular=kind == "angle"))
        proof = hk.certify(G, path, q, limits=False, budget=20_000 if kind == "pole" else 150)
        if len(proof):  # a path may end at the cut before the first cell
            proven += 1
            assert checker.check(str(proof.save(tmp_path / "honest.json"))).lines
    assert proven >= 2
