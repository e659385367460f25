"""A map of sheets in C answers as the map does."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from handmade_sheets import OVERLAPPING_START, overlapping_law, planar_map, planar_task
from holokin.base.errors import ArgumentError, BranchError, ExportError
from holokin.export import export_sheets


@pytest.fixture(scope="module")
def planar() -> hk.analysis.sheets.Sheets:
    return planar_map(64)


@pytest.mark.skipif(subprocess.run(["sh", "-c", "command -v cc"], check=False).returncode != 0, reason="no C compiler")
def test_c_gives_the_sheet_and_the_joints_of_the_map(planar: hk.analysis.sheets.Sheets, tmp_path: Path) -> None:
    """At random poses and at those that nothing serves; and a loop keeps its sheet as `near` does."""
    made = export_sheets(planar, tmp_path / "c", name="arm")
    assert made.name == "arm_sheets"
    sources = ["arm_sheets.c", *(f"sheet_{s}/arm_{s}.c" for s in range(len(planar)))]
    flags = ["-std=c99", "-O0", "-Wall", "-Werror", "-fPIC"]
    subprocess.run(["cc", *flags, "-c", *sources], cwd=tmp_path / "c", check=True, timeout=120)
    objects = [f"{Path(source).stem}.o" for source in sources]
    for target in (["-shared", "-o", "arm.so"], ["arm_sheets_selftest.c", "-o", "selftest"]):
        subprocess.run(["cc", *flags, *objects, *target, "-lm"], cwd=tmp_path / "c", check=True, timeout=120)
    said = subprocess.run([tmp_path / "c" / "selftest"], check=True, capture_output=True, text=True, timeout=60)
    assert "poses have the joints of the map" in said.stdout
    library = ctypes.CDLL(str(tmp_path / "c" / "arm.so"))
    rng, numbers = np.random.default_rng(0), ctypes.POINTER(ctypes.c_double)
    at, last, served = np.zeros(3), -1, 0
    for _ in range(150):
        pose = np.eye(4)
        pose[:2, 3] = rng.uniform(-3.1, 3.1, 2)
        target, q = np.ascontiguousarray(pose), np.zeros(3)
        sheet = library.arm_sheets(target.ctypes.data_as(numbers), q.ctypes.data_as(numbers))
        answer = planar.batch(pose[None])
        assert sheet == answer.sheet[0]
        if sheet >= 0:
            served += 1
            np.testing.assert_allclose(q, answer.q[0], atol=1e-8)
            if last >= 0:
                kept = at.copy()
                near = library.arm_sheets_near(target.ctypes.data_as(numbers), kept.ctypes.data_as(numbers), last)
                wanted, joints = planar.near(pose, at)
                if last in planar.of(at)[:1]:
                    assert near == wanted
                    np.testing.assert_allclose(kept, joints, atol=1e-8)
            at, last = q, sheet
    assert 60 < served < 150


def test_what_c_does_not_look_at_is_refused(planar: hk.analysis.sheets.Sheets, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="C name"):
        export_sheets(planar, tmp_path, name="7 arms")
    rough = replace(planar, sheets=tuple(replace(one, rcond=0.01) for one in planar.sheets))
    for other in (replace(planar, scene=hk.Scene()), rough):
        with pytest.raises(ArgumentError, match="obstacles"):
            export_sheets(other, tmp_path)


@pytest.mark.campaign
def test_branches_of_an_arm_that_is_not_redundant_are_refused(tmp_path: Path) -> None:
    """C has no inverse kinematics of these: what was written did not compile."""
    s = hk.sheets(hk.pose(hk.load("ur5e")), hk.workspace(box=([0.4, 0.1, 0.3], [0.1, 0.2, 0.1])), samples=4)
    with pytest.raises(ExportError, match="redundant"):
        export_sheets(s, tmp_path)
    assert not any(tmp_path.iterdir())


@pytest.mark.campaign
@pytest.mark.skipif(subprocess.run(["sh", "-c", "command -v cc"], check=False).returncode != 0, reason="no C compiler")
def test_more_sheets_than_a_char_counts_keep_their_numbers(planar: hk.analysis.sheets.Sheets, tmp_path: Path) -> None:
    count = 130
    q = np.concatenate([planar.q] * count)[:count]
    last = np.array([max((s for s in range(count) if np.isfinite(q[s, i]).all()), default=-1) for i in range(64)])
    s = replace(planar, sheets=(planar.sheets * count)[:count], q=q, labels=last)
    assert last.max() > 127
    export_sheets(s, tmp_path / "c", name="arm")
    folder = tmp_path / "c"
    flags = ["-std=c99", "-Werror", "-Wconversion", "-Wsign-conversion", "-fsyntax-only"]
    subprocess.run(["cc", *flags, "arm_sheets.c"], cwd=folder, check=True)


@pytest.mark.campaign
@pytest.mark.skipif(subprocess.run(["sh", "-c", "command -v cc"], check=False).returncode != 0, reason="no C compiler")
def test_a_loop_in_c_is_told_where_its_only_sheet_would_leap(tmp_path: Path) -> None:
    """One leaf overlaps itself on the disc: round the base C goes with the map, and ends where that does."""
    task = planar_task()
    disc = hk.workspace(cylinder=([0, 0, 0], 3.0, 0.0))
    one = hk.sheets(task, disc, [overlapping_law()], q0=OVERLAPPING_START, share=0.7, samples=40, search=False)
    assert len(one) == 1
    export_sheets(one, tmp_path / "c", name="arm")
    command = ["cc", "-std=c99", "-O0", "-fPIC", "-shared", "-o", "arm.so", "arm_sheets.c", "sheet_0/arm_0.c", "-lm"]
    subprocess.run(command, cwd=tmp_path / "c", check=True, timeout=120)
    library, numbers = ctypes.CDLL(str(tmp_path / "c" / "arm.so")), ctypes.POINTER(ctypes.c_double)
    q, ended = one([1.8, 0.0])[1].copy(), False
    for angle in np.arange(0.0, 2 * np.pi, 0.03):
        pose, before = np.eye(4), q.copy()
        pose[:2, 3] = 1.8 * np.cos(angle), 1.8 * np.sin(angle)
        sheet = library.arm_sheets_near(pose.ctypes.data_as(numbers), q.ctypes.data_as(numbers), 0)
        try:
            wanted = one.near(pose, before)[1]
        except BranchError:
            ended = True
            assert sheet == -1
            np.testing.assert_array_equal(q, before)
            break
        assert sheet == 0
        np.testing.assert_allclose(q, wanted, atol=1e-8)
    assert ended
