"""Certificates: what they say, that an independent checker verifies them, and that no changed one passes."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from holokin.cli import app
from holokin.errors import ArgumentError, CertificateError, ExpressionError, NotCertifiedError, StartError
from holokin.proof import Certificate, Extent, follow_certified
from holokin.proof.certificate import digest

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
def data(proof: Certificate, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return json.loads(proof.save(tmp_path_factory.mktemp("proof") / "triangle.json").read_text("utf-8"))


def planar_box() -> Certificate:
    arm = hk.load("planar-3r")
    G = hk.holonomic(hk.position(arm, rows=[0, 1]), hk.linear([[0, 1, -1]]))
    q = np.array([0.3, 0.9, 0.9])
    return hk.certify(G, hk.workspace(box=(arm.pose(q)[:3, 3], [0.02, 0.02, 0.0])), q)


def verified(data: dict[str, Any], file: Path) -> bool:
    """Whether the checker accepts data, with a digest that fits them."""
    file.write_text(json.dumps(data | {"sha256": digest(data)}), "utf-8")
    try:
        checker.check(str(file))
    except checker.RejectedError:
        return False
    return True


def test_a_loop_that_is_proven_ends_where_it_began_and_an_independent_checker_agrees(
    proof: Certificate, data: dict[str, Any], tmp_path: Path
) -> None:
    assert proof.whole and len(proof) < 30
    assert proof.gap < 1e-12 and not proof.turns.any()
    assert verified(data, tmp_path / "copy.json")


def test_the_checker_needs_no_other_file_of_holokin(data: dict[str, Any], tmp_path: Path) -> None:
    alone, file = tmp_path / "checker.py", tmp_path / "triangle.json"
    alone.write_text(Path(checker.__file__).read_text("utf-8"), "utf-8")
    file.write_text(json.dumps(data), "utf-8")
    found = subprocess.run([sys.executable, alone, file], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert found.returncode == 0 and "VERIFIED" in found.stdout, found.stderr


def test_the_checker_is_small_and_imports_nothing_of_holokin() -> None:
    text = Path(checker.__file__).read_text("utf-8")
    assert sum(bool(line.strip()) for line in text.splitlines()) < 230
    assert "holokin" not in "".join(line for line in text.splitlines() if line.lstrip().startswith(("import", "from")))


def test_followed_postures_lie_in_the_proven_hull(proof: Certificate, lock: Any, triangle: hk.Path) -> None:
    q = hk.follow(lock, triangle, START).q
    assert (proof.low <= q.min(axis=0)).all() and (q.max(axis=0) <= proof.high).all()


def test_the_determinant_bound_is_below_the_determinant_of_followed_postures(
    proof: Certificate, lock: Any, triangle: hk.Path
) -> None:
    equation, cells = proof.equation, proof.cells
    fixed = np.vstack([np.zeros((1, len(proof))), cells.numbers.T, np.repeat(proof.c[:, None], len(proof), axis=1)])
    at = np.vstack([cells.q0.T, fixed])
    A = equation.value(at, at).middle[equation.n :].T.reshape(-1, equation.n, equation.n)
    assert 0 < proof.determinant <= np.abs(np.linalg.det(A)).min()


def test_certified_following_finds_the_postures_of_following_by_leaf(lock: Any, triangle: hk.Path) -> None:
    walk, proof = follow_certified(lock, triangle, START, samples=60, cycles=2)
    other = hk.follow(lock, triangle, START, samples=60, cycles=2)
    assert proof.whole and walk.status is hk.Status.COMPLETE
    np.testing.assert_allclose(walk.q, other.q, atol=1e-11)


def test_a_spent_budget_leaves_what_is_proven(lock: Any, panda: hk.Robot, tmp_path: Path) -> None:
    tool = panda.pose(START)[:3, 3]
    path = hk.circle(tool, center=tool - [0.05, 0, 0])
    whole = hk.certify(lock, path, START)
    part = hk.certify(lock, path, START, budget=24)
    assert part.extent is Extent.BUDGET and not part.whole
    assert 1 < len(part) < len(whole) and "budget" in part.table()
    assert verified(part.data, tmp_path / "part.json")
    assert not verified(part.data | {"cells": part.data["cells"][1:]}, tmp_path / "part.json")
    with pytest.raises(NotCertifiedError) as caught:
        follow_certified(lock, path, START, budget=24)
    assert caught.value.certificate.extent is Extent.BUDGET and len(caught.value.trajectory) >= 1


def test_a_path_into_a_joint_limit_is_proven_up_to_there(lock: Any, panda: hk.Robot) -> None:
    tool = panda.pose(START)[:3, 3]
    path = hk.arc(tool, tool - [0.3, 0, 0], np.pi, (0, 0, 1))
    proof = hk.certify(lock, path, START)
    assert proof.extent is Extent.LIMIT and len(proof)
    assert proof.to_limit.min() >= 0
    assert str(proof).startswith("Not all is proven")


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


def bumped(value: Any) -> Any:
    """Another number."""
    return value * 1.5 + 0.05


CHANGES = {
    "q0": lambda d: d["cells"][1]["q0"].__setitem__(3, d["cells"][1]["q0"][3] + 0.05),
    "V": lambda d: d["cells"][1]["V"][3].__setitem__(0, bumped(d["cells"][1]["V"][3][0])),
    "Q": lambda d: d["cells"][1]["Q"][3][0].__setitem__(0, 5.0),
    "radius": lambda d: d["cells"][1].__setitem__("r", d["cells"][1]["r"] / 2),
    "tube": lambda d: d["cells"][1].__setitem__("rho", 10 * d["cells"][1]["rho"]),
    "low": lambda d: d["cells"][1]["low"].__setitem__(0, d["cells"][1]["low"][0] + 2.0**-20),
    "high": lambda d: d["cells"][1]["high"].__setitem__(0, d["cells"][1]["high"][0] + 2.0**-20),
    "piece": lambda d: d["cells"][0].__setitem__("piece", 2),
    "a cell left out": lambda d: d["cells"].pop(2),
    "a piece's numbers": lambda d: d["pieces"][1]["numbers"].__setitem__(0, d["pieces"][1]["numbers"][0] + 1e-6),
    "a row of the equation": lambda d: d["equation"].__setitem__(-20, ["output", 0]),
    "level": lambda d: d["level"].__setitem__(0, d["level"][0] + 0.1),
    "hull": lambda d: d["claims"]["low"].__setitem__(0, d["claims"]["low"][0] + 1e-3),
    "determinant": lambda d: d["claims"].__setitem__("determinant", 1e3 * d["claims"]["determinant"]),
    "gap": lambda d: d["claims"].__setitem__("gap", -1.0),
    "turns": lambda d: d["claims"]["turns"].__setitem__(0, 1),
    "limits": lambda d: d["limits"][0].__setitem__(0, d["claims"]["low"][0] + 1e-3),
    "slack": lambda d: d.__setitem__("slack", -1.0),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_certificate_with_one_number_changed_is_rejected(change: str, data: dict[str, Any], tmp_path: Path) -> None:
    """Though its digest is made anew: what is claimed does not follow from the changed numbers."""
    other = copy.deepcopy(data)
    CHANGES[change](other)
    assert other != data
    assert not verified(other, tmp_path / "changed.json")


def test_a_changed_constant_of_the_robot_is_rejected(data: dict[str, Any], tmp_path: Path) -> None:
    constants = [i for i, (name, *_) in enumerate(data["equation"]) if name == "const"]
    lengths = [i for i in constants if 0.01 < abs(data["equation"][i][1]) < 1]
    assert lengths
    for i in lengths:
        other = copy.deepcopy(data)
        other["equation"][i][1] *= 1.1
        assert not verified(other, tmp_path / "changed.json"), data["equation"][i]


def test_any_change_without_a_new_digest_is_rejected(data: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "changed.json"
    for key in sorted(set(data) - {"sha256"}):
        file.write_text(json.dumps(data | {key: [data[key]]}), "utf-8")
        with pytest.raises(checker.RejectedError, match="SHA-256"):
            checker.check(str(file))


def test_a_box_of_poses_is_verified_and_cells_that_do_not_fill_it_are_not(tmp_path: Path) -> None:
    proof = planar_box()
    assert proof.whole
    data = proof.data
    assert verified(data, tmp_path / "box.json")
    for k in range(0, len(data["cells"]), 3):
        other = copy.deepcopy(data)
        del other["cells"][k]
        assert not verified(other, tmp_path / "box.json")
    other = copy.deepcopy(data)
    other["cells"].append(copy.deepcopy(other["cells"][0]))
    assert not verified(other, tmp_path / "box.json")


JOB = """
title = "a line"
[robot]
name = "panda"
[start]
q = [0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]
[task]
kind = "pose"
[path]
kind = "polyline"
relative = true
points = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]
[workspace]
kind = "box"
center = [0.36, 0.0, 0.5]
half = [0.004, 0.004, 0.0]
rotation = "start"
[strategies.plain]
kind = "moore-penrose"
[strategies.lock-3]
kind = "lock"
joints = ["panda_joint3"]
"""


def test_the_command_line_proves_a_job_and_checks_what_it_wrote(tmp_path: Path) -> None:
    job, out = tmp_path / "small.toml", str(tmp_path)
    job.write_text(JOB, "utf-8")
    call = CliRunner().invoke
    for options in ([], ["--workspace"]):
        found = call(app, ["certify", str(job), "--out", out, *options])
        assert found.exit_code == 0, found.output
        assert "plain: not certified: it has no leaves" in found.output
    file = tmp_path / "small-proof" / "lock-3-certificate.json"
    again = call(app, ["check-certificate", str(file)])
    assert again.exit_code == 0 and "VERIFIED" in again.output
    file.write_text(file.read_text("utf-8").replace('"whole": true', '"whole": false'), "utf-8")
    again = call(app, ["check-certificate", str(file)])
    assert again.exit_code == 1 and "REJECTED" in again.output
    assert isinstance(call(app, ["check-certificate", str(job)]).exception, CertificateError)  # main ends with 2
    assert call(app, ["certify", str(job), "--budget", "1", "--out", out]).exit_code == 1
    (tmp_path / "other" / "small-proof").mkdir(parents=True)
    (tmp_path / "other" / "small-proof" / "mine.txt").write_text("mine", "utf-8")
    foreign = call(app, ["certify", str(job), "--out", str(tmp_path / "other")])
    assert isinstance(foreign.exception, ArgumentError) and "not one of holokin's" in str(foreign.exception)
