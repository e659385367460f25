"""A proof that was stopped goes on with the cells that it kept, and ends with the certificate of one that was not."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, sampled
from holokin.base.errors import ArgumentError
from holokin.proof.cell_search import count_kept
from holokin.proof.certificate import Certificate, digest
from holokin.robot import Box

pytest.importorskip("coal")

Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
JOB = """
title = "a box above a table"
robot.name = "panda"
task = { kind = "pose", orientation = "twist" }
start.q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
path = { kind = "circle", center = [-0.1, 0, 0], relative = true }
workspace = { kind = "box", center = [0.41, 0.2, 0.53], half = [0.01, 0.01, 0.01], rotation = "start" }
strategies.lock = { kind = "lock", joints = ["panda_joint3"] }

[checks]
clearance = 0.02
self_collision = false
obstacles = [{ name = "table", kind = "box", sides = [1.0, 1.0, 0.05], xyz = [0.6, 0.0, -0.1] }]
"""


@cache
def G(joint: int = 2) -> hk.HolonomicStrategy:
    return hk.holonomic(hk.pose(hk.load("panda")), hk.lock(joint))


def proof(
    file: Path | None = None,
    z: float = -0.1,
    clearance: float = 0.02,
    joint: int = 2,
    half: float = 0.03,
    **more: object,
) -> Certificate:
    """Over a cube above a table: some batches of cells."""
    T = G().task.pose(Q0)
    space = hk.workspace(box=(T[:3, 3], [half] * 3), rotation=T[:3, :3])
    table = hk.obstacle("table", Box(np.array([1.0, 1.0, 0.05])), (0.6, 0.0, z))
    return hk.certify(
        G(joint),
        space,
        Q0,
        scene=hk.Scene(obstacles=[table], clearance=clearance, self_collision=False),
        keep_in=file,
        **more,
    )


@cache
def at_once() -> str:
    return digest(proof().data)


class Stop(Exception):
    """What a user's Ctrl-C is to the proof."""


def stopped(file: Path, **more: object) -> int:
    """A proof that is stopped after its first batch; how many cells it kept."""

    def say(text: str) -> None:
        if "examined" in text:
            raise Stop

    with pytest.raises(Stop):
        proof(file, progress=say, **more)
    return count_kept(file)


def test_a_proof_that_was_stopped_ends_with_the_same_certificate(tmp_path: Path) -> None:
    kept, said = stopped(tmp_path / "box.cells"), []
    found = proof(tmp_path / "box.cells", progress=said.append)
    assert found.whole and digest(found.data) == at_once()
    assert 0 < kept < count_kept(tmp_path / "box.cells") and any(f"{kept:,} of them before" in text for text in said)


def test_one_that_is_done_goes_on_from_its_end_and_examines_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proof(tmp_path / "box.cells")
    monkeypatch.setattr("holokin.proof.cell_search.centred", lambda *_: pytest.fail("it examines a cell again"))
    assert digest(proof(tmp_path / "box.cells").data) == at_once()


KILLED = """
import os, signal, sys
sys.path.insert(0, {folder!r})
import test_kept_cells as here
here.proof({file!r}, progress=lambda text: "examined" in text and os.kill(os.getpid(), signal.SIGKILL))
"""


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_one_that_was_killed_ends_with_the_same_certificate(tmp_path: Path) -> None:
    file = tmp_path / "box.cells"
    text = KILLED.format(folder=str(Path(__file__).parent), file=str(file))
    ended = subprocess.run([sys.executable, "-c", text], timeout=120, check=False, cwd=Path(__file__).parent.parent)
    assert ended.returncode == -9 and count_kept(file) > 0
    assert digest(proof(file).data) == at_once()


def test_a_region_is_kept_too(tmp_path: Path) -> None:
    strategy, T = G(), G().task.pose(Q0)
    space = hk.workspace(box=(T[:3, 3], [0.02] * 3), rotation=T[:3, :3])

    def say(_text: str) -> None:
        raise Stop

    with pytest.raises(Stop):
        hk.unique_region(strategy, Q0, space, keep_in=tmp_path / "part.cells", progress=say)
    found = hk.unique_region(strategy, Q0, space, keep_in=tmp_path / "part.cells")
    assert digest(found.certificate.data) == digest(hk.unique_region(strategy, Q0, space).certificate.data)
    with pytest.raises(ArgumentError, match="give the workspace"):
        hk.unique_region(strategy, Q0, keep_in=tmp_path / "part.cells")


OTHERS = {
    "z": {"z": -0.101}, "clearance": {"clearance": 0.021}, "joint": {"joint": 6, "half": 0.004},
    "half": {"half": 0.031}, "limits": {"limits": False},
}  # fmt: skip


@sampled(1, "other", OTHERS)
def test_a_file_of_another_question_is_refused(tmp_path: Path, other: str) -> None:
    kept = stopped(tmp_path / "box.cells")
    with pytest.raises(ArgumentError, match="of another robot, strategy"):
        proof(tmp_path / "box.cells", **OTHERS[other])
    assert count_kept(tmp_path / "box.cells") == kept


@pytest.mark.campaign
def test_with_a_larger_budget_it_goes_on(tmp_path: Path) -> None:
    few = proof(tmp_path / "box.cells", budget=100)
    assert not few.whole
    assert digest(proof(tmp_path / "box.cells").data) == at_once()


def test_a_batch_that_was_damaged_is_examined_again(tmp_path: Path) -> None:
    file = tmp_path / "box.cells"
    stopped(file)
    with sqlite3.connect(file) as db:
        key, data = db.execute("SELECT key, data FROM batches").fetchone()
        db.execute("UPDATE batches SET data = ? WHERE key = ?", (data[:-9000] + b"\1" + data[-8999:], key))
    db.close()
    said: list[str] = []
    assert digest(proof(file, progress=said.append).data) == at_once()
    assert not any("before" in text for text in said)


def test_what_is_no_file_of_cells_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "text.cells").write_text(
        "a letter to somebody, which is longer than the head of an SQLite file is\n" * 4
    )
    with sqlite3.connect(tmp_path / "other.cells") as db:
        db.execute("CREATE TABLE sums (x REAL)")
    db.close()
    for name, words in (("text.cells", "not a database"), ("other.cells", "another program"), ("", "a folder")):
        before = (tmp_path / name).read_bytes() if name else b""
        with pytest.raises(ArgumentError, match=words):
            proof(tmp_path / name)
        assert not name or (tmp_path / name).read_bytes() == before


@pytest.mark.campaign
def test_the_command_goes_on_where_it_was_stopped_and_leaves_certificates_alone(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job, out = tmp_path / "table.toml", tmp_path / "out"
    job.write_text(JOB)
    cells = out / "table-proof-lock.cells"
    plain = holokin("certify", job, "--workspace", "--out", out, "--check", 0)
    assert plain.code == 0 and not cells.exists()
    shutil.move(out / "table-proof", tmp_path / "plain")

    from holokin.proof import cell_search

    batches = []
    looked_up = cell_search.looked_up

    def once(*given: object) -> object:
        batches.append(looked_up(*given))
        if len(batches) == 1:
            raise KeyboardInterrupt
        return batches[-1]

    monkeypatch.setattr(cell_search, "looked_up", once)
    halted = holokin("certify", job, "--workspace", "--out", out, "--check", 0)
    assert halted.code == 130 and "cells are kept" in halted.out and "--resume" in halted.out and cells.exists()
    again = holokin("certify", job, "--workspace", "--out", out, "--check", 0)
    assert again.code == 2 and "--resume" in again.err and cells.exists()
    done = holokin("certify", job, "--workspace", "--out", out, "--check", 0, "--resume")
    assert done.code == 0 and sorted(p.name for p in out.iterdir()) == ["table-proof"]
    name = "lock-certificate.json"
    assert (out / "table-proof" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
    assert holokin("certify", job, "--resume", "--out", out).code == 2
    part = holokin("certify", job, "--workspace", "--part", "--out", out, "--check", 0)
    assert part.code == 0 and not cells.exists()
