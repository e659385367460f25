"""What the checker says of a file, and which files it does not read."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import casadi
import numpy as np
import pytest

import holokin as hk
from forged import (
    NONE,
    REJECTED,
    VERIFIED,
    Data,
    changed,
    checker,
    derivative,
    outcome,
    outcome_of,
    residual,
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
    file.write_text(json.dumps(forged | {"sha256": digest(forged)}) + "\n", "utf-8")
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
    file.write_text(json.dumps(loop | {"sha256": digest(loop)}) + "\n", "utf-8")
    with pytest.raises(TimeoutError):
        checker.check(str(file), seconds=0.0)
    with pytest.raises(hk.base.errors.CertificateError, match="--seconds"):
        recheck(file, seconds=0.0)


def test_the_checker_alone_ends_with_0_1_or_2(loop: Data, file: Path) -> None:
    def run(text: str) -> tuple[int, str]:
        file.write_text(text, "utf-8")
        found = subprocess.run([sys.executable, checker.__file__, file], capture_output=True, text=True, check=False)
        assert "Traceback" not in found.stderr
        return found.returncode, found.stdout + found.stderr

    code, said = run(json.dumps(loop | {"sha256": digest(loop)}) + "\n")
    assert code == 0 and "VERIFIED" in said and "..." in said
    assert run(json.dumps(loop) + "\n")[0] == 1
    assert run("no JSON")[0] == 2
    assert subprocess.run([sys.executable, checker.__file__], capture_output=True, check=False).returncode == 2


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_ends_the_checking_of_the_command_line_without_a_traceback(loop: Data, file: Path) -> None:
    file.write_text(json.dumps(loop | {"sha256": digest(loop)}) + "\n", "utf-8")
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "  # a background job ignores it
        "from holokin.app.cli import main; from holokin.proof import checker; "
        "checker.below = lambda *_: signal.raise_signal(signal.SIGINT); "
        f"sys.argv = ['holokin', 'check-certificate', {str(file)!r}]; main.main()"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 128 + signal.SIGINT and "Traceback" not in found.stderr, found.stderr


@pytest.mark.campaign
def test_honest_certificates_of_functions_with_a_pole_near_by_are_verified(tmp_path: Path) -> None:
    """c / d^4 about a centre that is 0.15 to 0.6 m from where a PPR arm begins to move: large cells next to a pole."""
    rng, robot = np.random.default_rng(7), hk.load("ppr")
    for _ in range(4):
        q = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-2, 2)])
        direction = rng.uniform(-np.pi, np.pi)
        center = q[:2] + rng.uniform(0.15, 0.6) * np.array([np.cos(direction), np.sin(direction)])
        c = rng.uniform(-0.3, 0.3) * 10 ** rng.uniform(-5, -3)

        def g(v: casadi.SX, center: np.ndarray = center, c: float = c) -> casadi.SX:
            return v[2] + c / ((v[0] - center[0]) ** 2 + (v[1] - center[1]) ** 2) ** 2

        x, way = robot.pose(q)[:3, 3], rng.normal(size=2)
        path = hk.line(x, x + [*(rng.uniform(0.05, 0.5) * way / np.linalg.norm(way)), 0.0])
        proof = hk.certify(hk.holonomic(hk.position(robot), hk.custom(g)), path, q, limits=False)
        assert len(proof) and checker.check(str(proof.save(tmp_path / "pole.json"))).lines
