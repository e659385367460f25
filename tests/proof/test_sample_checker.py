"""The checker on a sample: what it says was checked, was; a fault in all cells is found, one of few often is not."""

from __future__ import annotations

import copy
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from forged import cells, sealed
from holokin.base.errors import ArgumentError
from holokin.proof import Certificate
from holokin.proof.recheck import recheck

pytest.importorskip("flint")
from holokin.proof import checker, sample_checker

Q0 = np.array([0.3, 0.9, 0.7])


@cache
def proof() -> Certificate:
    """A square of tool positions of a planar arm: some hundred cells of two parameters."""
    arm = hk.load("planar-3r")
    G = hk.holonomic(hk.position(arm), hk.linear([[0.3, 0, 1]]))
    square = hk.workspace(box=(arm.pose(Q0)[:2, 3], [0.25, 0.25]))
    return hk.unique_region(G, Q0, square, limits=False).certificate


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return proof().save(tmp_path / "square.json")


def spoilt(file: Path, which: Any) -> Path:
    """The file with a Y in the chosen cells that is no inverse."""
    data = copy.deepcopy(proof().data)
    rows = list(cells(data["pieces"][0]["cells"]))
    for i in which(len(rows)):
        rows[i]["Y"] = (3 * np.array(rows[i]["Y"])).tolist()
    file.write_text(sealed(data))
    return file


def counted(monkeypatch: pytest.MonkeyPatch) -> tuple[list, list]:
    """The cells that are proven from now on, and the pairs that are joined."""
    proven: list = []
    joined: list = []
    prove, join = checker.Checker.prove, checker.Checker.join
    monkeypatch.setattr(checker.Checker, "prove", lambda self, cell: proven.append(cell) or prove(self, cell))
    monkeypatch.setattr(checker.Checker, "join", lambda self, *of: joined.append(of) or join(self, *of))
    return proven, joined


def test_a_sample_verifies_as_many_cells_as_it_says_and_says_that_it_is_one(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proven, joined = counted(monkeypatch)
    rejected, text = recheck(file, sample=0.1, seed=5)
    assert not rejected and "VERIFIED" not in text and text.startswith("NO FAULT FOUND in a sample")
    total, checked, faces = (
        int(x.replace(",", "")) for x in re.findall(r"of ([\d,]+) cells, ([\d,]+) were .* and ([\d,]+) places", text)[0]
    )
    assert total == len(proof()) and checked == len(proven) and faces == len(joined) > 0
    assert 0.1 * total <= checked <= 0.1 * total + 2 and "NOT checked" in text
    share = float(re.findall(r"probability of ([\d.]+) %", text)[0])
    assert 0 <= 100 * (1 - 0.99**faces) - share <= 0.1
    for one, other, axis in joined:
        assert one.sides[axis][1] == other.sides[axis][0] or one.sides[axis][0] == other.sides[axis][1]


def test_a_seed_draws_the_same_cells_again_and_another_one_others(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    for seed in (5, 5, 6):
        with monkeypatch.context() as patch:
            proven, _ = counted(patch)
            recheck(file, sample=0.05, seed=seed)
            drawn.append({str(cell.sides) for cell in proven})
    assert drawn[0] == drawn[1] != drawn[2]


def test_a_fault_in_all_cells_is_found_by_the_smallest_sample(file: Path) -> None:
    rejected, text = recheck(spoilt(file, range), sample=1e-6)
    assert rejected and text.startswith("REJECTED")


@pytest.mark.campaign
def test_a_fault_in_a_tenth_of_the_cells_is_found_about_as_often_as_is_said(file: Path) -> None:
    """With a tenth of the cells faulty and M checked in pairs, the chance is between rows of M / 2 and of M cells."""
    tenth = np.random.default_rng(0)
    spoilt(file, lambda k: tenth.permutation(k)[: k // 10])
    found = [recheck(file, sample=6 / len(proof()), seed=seed)[0] for seed in range(12)]
    assert 1 - 0.9**3 - 0.35 < np.mean(found) < 1 - 0.9**7 + 0.35


def test_a_gap_is_found_whatever_is_drawn(file: Path) -> None:
    data = copy.deepcopy(proof().data)
    tree = data["pieces"][0]["cells"]
    while not isinstance(tree[2], dict):
        tree = tree[2]
    tree[2] = None
    file.write_text(sealed(data))
    assert proof().whole
    rejected, text = recheck(file, sample=1e-6)
    assert rejected and "gap" in text


def test_neighbours_that_jump_are_rejected_where_they_are_drawn(file: Path) -> None:
    """The cells of one half have their first joint ten turns further, at which g has the third three turns back: each
    cell is sound, and no seam between the halves is."""
    found = sample_checker.check_sample(str(file), sample=0.99, seed=1)
    assert found.lines[0].startswith(f"of {len(proof()):,} cells")
    data = copy.deepcopy(proof().data)
    for cell in cells(data["pieces"][0]["cells"][3]):
        cell["q0"] = [cell["q0"][0] + 20 * np.pi, cell["q0"][1], cell["q0"][2] - 6 * np.pi]
    data["claims"]["joints"][1:3] = [-99.0] * 3, [99.0] * 3
    file.write_text(sealed(data))
    rejected, text = recheck(file, sample=0.99, seed=1)
    assert rejected and "may jump" in text


def test_the_command_says_what_it_checked(file: Path, holokin: Command) -> None:
    found = holokin("check-certificate", file, "--sample", 0.05, "--seed", 3)
    assert found.code == 0 and "seed 3" in found.out and "VERIFIED:" not in found.out
    assert holokin("check-certificate", file, "--sample", 1).out.startswith("VERIFIED")
    for more in (("--sample", 0), ("--sample", 1.5), ("--seed", 3)):
        assert holokin("check-certificate", file, *more).code == 2
    assert holokin("check-certificate", spoilt(file, range), "--sample", 0.05).code == 1


def test_a_sample_that_is_no_share_is_refused(file: Path) -> None:
    for sample in (0.0, -0.1, 1.1, np.nan):
        with pytest.raises(ArgumentError, match="share"):
            recheck(file, sample=sample)
