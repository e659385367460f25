"""Certificates: what they say, that an independent checker verifies them, and that no changed one passes."""

from __future__ import annotations

import copy
import json
import math
import shutil
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from conftest import campaign
from forged import VERIFIED, Data, assert_true, changed, outcome, parabola, sealed, shifted
from holokin.app.cli.main import app
from holokin.base.errors import ArgumentError, ExpressionError, FileError, StartError
from holokin.proof import Certificate
from holokin.proof.binding import unlike
from holokin.proof.recheck import recheck
from holokin.robot import Box

checker = pytest.importorskip("holokin.proof.checker")

START = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])


@pytest.fixture(scope="module")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.fixture(scope="module")
def lock(panda: hk.Robot) -> hk.strategies.HolonomicStrategy:
    return hk.holonomic(hk.pose(panda), hk.lock("panda_joint3"))


@pytest.fixture(scope="module")
def triangle(panda: hk.Robot) -> hk.Path:
    tool = panda.pose(START)[:3, 3]
    return hk.polyline([tool, tool + [0.02, 0, 0], tool + [0.02, 0.02, 0]], closed=True)


@pytest.fixture(scope="module")
def proof(lock: hk.strategies.HolonomicStrategy, triangle: hk.Path) -> Certificate:
    return hk.certify(lock, triangle, START)


@pytest.fixture(scope="module")
def data(proof: Certificate, tmp_path_factory: pytest.TempPathFactory) -> Data:
    return json.loads(proof.save(tmp_path_factory.mktemp("proof") / "triangle.json").read_text("utf-8"))


def test_a_loop_that_is_proven_ends_where_it_began_and_an_independent_checker_agrees(
    proof: Certificate, data: Data, lock: Any, triangle: hk.Path, tmp_path: Path
) -> None:
    """Followed postures lie in its hull; so do roots by Newton's method, with determinants as large as is claimed."""
    assert proof.whole and len(proof) < 30 and proof.gap < 1e-12 and not proof.turns.any()
    assert outcome(data, tmp_path / "copy.json") == VERIFIED and proof.determinant > 0
    q = hk.follow(lock, triangle, START).q
    assert (proof.low <= q.min(axis=0)).all() and (q.max(axis=0) <= proof.high).all()
    assert_true(data)


def test_the_checker_needs_no_other_file_of_holokin(data: Data, tmp_path: Path) -> None:
    alone, file = tmp_path / "checker.py", tmp_path / "triangle.json"
    for beside in ("checker.py", "checker_file.py"):
        shutil.copy(Path(checker.__file__).parent / beside, tmp_path / beside)
    file.write_text(json.dumps(data) + "\n", "utf-8")
    found = subprocess.run([sys.executable, alone, file], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert found.returncode == 0 and "VERIFIED" in found.stdout, found.stderr


@pytest.mark.parametrize("beside", ["checker.py", "checker_file.py", "clear_checker.py"])
def test_the_checker_is_small_and_imports_nothing_of_holokin(beside: str) -> None:
    text = (Path(checker.__file__).parent / beside).read_text("utf-8")
    assert len(text.splitlines()) < 400 and max(map(len, text.splitlines())) <= 120
    assert "holokin" not in "".join(line for line in text.splitlines() if line.lstrip().startswith(("import", "from")))


def test_what_cannot_be_proven_is_refused_with_its_cure(lock: Any, panda: hk.Robot, triangle: hk.Path) -> None:
    import casadi

    task = hk.pose(panda)
    with pytest.raises(ArgumentError, match=r"hk\.radial"):
        hk.certify(hk.moore_penrose(task), triangle, START)
    with pytest.raises(ArgumentError, match=r"hk\.strategies\.fitted"):
        hk.certify(hk.radial(hk.moore_penrose(task), START), triangle, START)
    with pytest.raises(StartError):
        hk.certify(lock, triangle.starting_at([0.3, 0.1, 0.5]), START)
    with pytest.raises(ExpressionError, match="erf"):
        hk.certify(hk.holonomic(task, hk.custom(lambda q: casadi.erf(q[2]))), triangle, START)


JOB = """
title = "a line"
[robot]
name = "planar-3r"
[start]
q = [0.3, 0.9, 0.9]
[path]
kind = "polyline"
relative = true
points = [[0.0, 0.0], [-1.2, 0.0]]
[workspace]
kind = "box"
center = [0.8, 2.1]
half = [0.1, 0.1]
[strategies.plain]
kind = "moore-penrose"
[strategies.lock-3]
kind = "lock"
joints = [2]
"""


def test_the_command_line_proves_a_job_and_checks_what_it_wrote(tmp_path: Path) -> None:
    job, out = tmp_path / "small.toml", str(tmp_path)
    job.write_text(JOB, "utf-8")
    call = CliRunner().invoke
    for options in ([], ["--workspace"]):
        found = call(app, ["certify", str(job), "--out", out, *options])
        assert found.exit_code == 0, found.output
        assert "plain: not certified: it has no leaves" in found.output
        assert "the verdict is on the others" in " ".join(found.output.split())
    file = tmp_path / "small-proof" / "lock-3-certificate.json"
    again = call(app, ["check-certificate", str(file)])
    assert again.exit_code == 0 and "VERIFIED" in again.output
    file.write_text(file.read_text("utf-8").replace('"whole": true', '"whole": false'), "utf-8")
    again = call(app, ["check-certificate", str(file)])
    assert again.exit_code == 1 and "REJECTED" in again.output
    assert isinstance(call(app, ["check-certificate", str(job)]).exception, FileError)  # main ends with 2
    assert call(app, ["certify", str(job), "--budget", "1", "--out", out]).exit_code == 1
    (tmp_path / "other" / "small-proof").mkdir(parents=True)
    (tmp_path / "other" / "small-proof" / "mine.txt").write_text("mine", "utf-8")
    foreign = call(app, ["certify", str(job), "--out", str(tmp_path / "other")])
    assert isinstance(foreign.exception, ArgumentError) and "not one of holokin's" in str(foreign.exception)


def test_a_certificate_is_compared_with_a_robot(proof: Certificate, panda: hk.Robot, tmp_path: Path) -> None:
    """Another arm, another tip, a number of the model changed, limits that the robot does not have: each is told."""
    assert not unlike(proof.data, panda)
    assert "other lengths" in unlike(proof.data, hk.load("iiwa14"))
    assert "other lengths" in unlike(proof.data, hk.with_tool(panda, [0.0, 0.0, 1e-9]))
    assert "3 joints" in unlike(proof.data, hk.load("planar-3r"))
    k = len(proof.data["constants"])
    others = [unlike(changed(proof.data, lambda d, i=i: shifted(d["constants"], 1e-12, i)), panda) for i in range(k)]
    assert sum("other lengths" in text for text in others) >= k - 2  # those of the constraint are not compared
    assert "wider" in unlike(changed(proof.data, lambda d: shifted(d["claims"]["joints"][3], 0.1, 2)), panda)
    file, call = proof.save(tmp_path / "triangle.json"), CliRunner().invoke
    bound = call(app, ["check-certificate", str(file), "--robot", "panda"])
    assert bound.exit_code == 0 and "are those of panda" in " ".join(bound.output.split())
    assert call(app, ["check-certificate", str(file), "--robot", "iiwa14"]).exit_code == 1
    assert isinstance(call(app, ["check-certificate", str(file), "--tip", "x"]).exception, ArgumentError)


@pytest.mark.campaign
def test_a_box_of_poses_that_turn_and_other_tasks_are_compared_with_a_robot(panda: hk.Robot) -> None:
    tool = panda.pose(START)[:3, 3]
    G = hk.holonomic(hk.pose(panda), hk.lock("panda_joint3"))
    assert not unlike(hk.certify(G, hk.workspace(box=(tool, [0.003, 0.003, 0.0]), tilt=0.01), START).data, panda)
    planar, q = hk.load("planar-3r"), np.array([0.3, 0.9, 0.9])
    x = planar.pose(q)[:3, 3]
    flat = hk.holonomic(hk.position(planar, rows=[0, 1]), hk.linear([[0, 1, -1]]))
    assert not unlike(hk.certify(flat, hk.line(x, x - [0.1, 0, 0]), q).data, planar)


# --- Certificates of a stranger: any part of a file replaced by any other thing is refused in words, or what is ...


Q0 = np.array([0.3, 0.9, 0.9])
WORDS = ("task", "title", "theorem", "where", "robot", "names")
"""Parts of a file of which the checker says nothing."""

ODD: list[Any] = [
    True, False, None, -1, 0, 1, 7, 2**40, 10**200, -(10**400), -0.0, 0.5, 1e-308, 1e150, 1e308, -1e308, math.inf,
    math.nan, "", "1", "nan", "1e999999999999", "add", "\x1b[31m\ud800", [], {}, [[]], [[[[1.0]]]], [1.0, None],
    [0, 0.5, None, None], {"q0": [1.0]}, [0] * 1000,
]  # fmt: skip
"""What may stand in place of a part: numbers that are none, of other kinds, huge, tiny; texts; lists and tables."""


@pytest.fixture(scope="module")
def arm() -> hk.Robot:
    return hk.load("planar-3r")


@pytest.fixture(scope="module")
def honest(arm: hk.Robot) -> dict[str, Data]:
    """Valid certificates: made by hand, of an open path, of a box, and of a box clear of a wall."""
    G, x = hk.holonomic(hk.position(arm, rows=(0, 1)), hk.linear([[0, 1, -1]])), arm.pose(Q0)[:3, 3]
    wall = hk.obstacle("wall", Box(np.array([0.1, 3.0, 1.0])), (-1.5, 0.0, 0.0))
    small = hk.workspace(box=(x, [0.02, 0.02, 0.0]))
    return {
        "parabola": parabola(),
        "path": hk.certify(G, hk.polyline([x, x - [0.1, 0, 0], x - [0.1, 0.1, 0]]), Q0).data,
        "box": hk.certify(G, small, Q0).data,
        "clear": hk.certify(G, small, Q0, scene=hk.Scene(obstacles=[wall], clearance=0.0, self_collision=False)).data,
    }


def places(part: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where anything stands in a file, lists and tables included."""
    if at:
        yield at
    if isinstance(part, dict | list):
        for key, value in part.items() if isinstance(part, dict) else enumerate(part):
            yield from places(value, (*at, key))


def holder(data: Data, at: tuple[Any, ...]) -> Any:
    part: Any = data
    for key in at[:-1]:
        part = part[key]
    return part


def mutated(data: Data, at: tuple[Any, ...], rng: np.random.Generator) -> None:
    """One part becomes something else, or goes, or comes twice, or changes places with its neighbour."""
    of, key = holder(data, at), at[-1]
    how = rng.choice(["odd", "odd", "odd", "gone", "twice", "swapped", "wrapped"])
    if how == "odd":
        of[key] = copy.deepcopy(ODD[int(rng.integers(len(ODD)))])
    elif how == "gone":
        del of[key]
    elif how == "wrapped":
        of[key] = [of[key]]
    elif isinstance(of, list):
        other = int(rng.integers(len(of)))
        if how == "twice":
            of.insert(other, of[key])
        else:
            of[key], of[other] = of[other], of[key]
    else:
        of[f"{key}s"] = of[key]


def answer(text: str, file: Path, robot: hk.Robot | None = None) -> str:
    """ "rejected", "none" or "verified"; any other error is a failure of the checker."""
    file.write_text(text, "utf-8")
    try:
        rejected, said = recheck(file, seconds=20.0, robot=robot)
    except FileError as problem:
        assert "within 20 s" not in str(problem)
        return "none"
    assert said.isascii() or said.encode("utf-8")
    return "rejected" if rejected else "verified"


def still_true(kind: str, data: Data, given: Data, at: tuple[Any, ...]) -> None:
    """What is verified of a file that somebody changed; keys of no meaning change nothing."""
    data = copy.deepcopy(data)
    if isinstance(of := holder(data, at), dict):
        of.pop(f"{at[-1]}s", None)
    same = {key: value for key, value in data.items() if key not in WORDS and key in given}
    if same == {key: value for key, value in given.items() if key not in WORDS}:
        return
    assert_true(data)
    if kind == "clear":  # held against the robot
        assert data["clear"]["joints"] == given["clear"]["joints"]


@pytest.mark.parametrize("kind", ["parabola", "path", "box", "clear"])
@pytest.mark.parametrize(("first", "count"), [(0, 12), campaign(("first", "count"), (1000, 800))])
def test_any_part_of_a_file_replaced_is_refused_in_words_or_leaves_a_true_statement(
    kind: str, first: int, count: int, honest: dict[str, Data], arm: hk.Robot, tmp_path: Path
) -> None:
    given, robot = honest[kind], None if kind == "parabola" else arm
    where, found = list(places(given)), dict.fromkeys(("rejected", "none", "verified"), 0)
    assert answer(sealed(given), tmp_path / "given.json", robot) == "verified"
    heads = sorted({at[0] for at in where if at[0] not in WORDS[1:]})
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        head = heads[seed % len(heads)]  # each part of the file as often as the large ones
        among = [at for at in where if at[0] == head]
        at = among[int(rng.integers(len(among)))]
        data = copy.deepcopy(given)
        mutated(data, at, rng)
        said = answer(sealed(data), tmp_path / "file.json", robot)
        found[said] += 1
        if said == "verified":
            still_true(kind, data, given, at)
    assert found["rejected"] > count / 4 and found["verified"] > 0, found


def test_whole_turns_that_operations_multiply_take_no_memory(tmp_path: Path) -> None:
    """q 1e100, 1e200, ...: as whole numbers 1,500 of these are 47 MB."""
    data = parabola()
    data["constants"], data["units"], data["outputs"] = [1.0, 1e100], ["rad"], [1504, 2]
    data["operations"] = [*(["mul", 3 + k if k else 0, 3] for k in range(1500)), ["sq", 0], ["sub", 1504, 2]]
    data["outputs"], data["claims"]["turns"] = [1505, 2], [1]
    data["claims"]["joints"] = [[-9.0], [0.9], [1.1], [9.0]]
    data["pieces"][0]["cells"] = {"q0": [1.0], "V": [[0.0]], "Q": [[[0.0]]], "Y": [[0.5]]}
    (tmp_path / "file.json").write_text(sealed(data), "utf-8")
    tracemalloc.start()
    try:
        rejected, said = recheck(tmp_path / "file.json")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert rejected and "whole turns may change" in said
    assert peak < 2e7, peak


def test_the_time_of_a_large_file_is_bounded(tmp_path: Path) -> None:
    """Pieces without end, each of which holds; and turns that grow without end."""
    still = parabola()
    still["operations"], still["outputs"] = [["sq", 0], ["sub", 4, 2]], [5, 3]
    still["claims"]["joints"] = [[-9.0], [0.9], [1.1], [9.0]]
    cell = {"q0": [1.0], "V": [[0.0]], "Q": [[[0.0]]], "Y": [[0.5]]}
    still["pieces"] = [{"numbers": [], "u": [0.0], "q": [1.0], "cells": cell}] * 20_000
    (tmp_path / "file.json").write_text(sealed(still), "utf-8")
    began = time.process_time()
    with pytest.raises(FileError, match="not verified within 0 s"):
        recheck(tmp_path / "file.json", seconds=0.4)
    assert time.process_time() - began < 4.0
    brackets = '{"a": [' + "[], " * 400_000 + "[]]}"
    (tmp_path / "file.json").write_text(brackets, "utf-8")
    with pytest.raises(FileError, match="more lists than numbers"):
        recheck(tmp_path / "file.json")
