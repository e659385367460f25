"""The self-test of exported C tells round-off from a wrong digit, also far from the origin and in ZYZ angles."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.export import check
from holokin.symbolic.native import compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="needs a C compiler")


def far_away(meters: float) -> hk.Robot:
    """Three links of 0.4 m, and a base so far from the world's origin."""
    base = np.eye(4)
    base[0, 3] = meters
    return hk.from_dh([{"a": 0.4}] * 3, base=base, name="gantry arm")


@pytest.mark.campaign
def test_feedback_may_multiply_the_last_digit_of_a_far_position(tmp_path: Path) -> None:
    robot = far_away(100.0)
    law = hk.holonomic(hk.position(robot), hk.linear([1.0, 0.0, -1.0]))
    said = check(hk.export.export_c(law, tmp_path, q0=[0.3, 0.9, -0.7], name="law", vectors_count=16))
    off = float(re.search(r"step (\S+),", said[1]).group(1))  # type: ignore[union-attr]
    assert off > 1e-4  # gain 100/s times 4e-6 m, the last digit of 100 m in single precision
    assert off < 5e-2


@pytest.mark.campaign
def test_an_inverse_to_zyz_angles_ends_at_the_very_pose_that_was_wanted(tmp_path: Path) -> None:
    robot = hk.from_dh([{"a": 0.3, "alpha": alpha} for alpha in (1.2, -0.9, 1.0, 0.4)])
    law = hk.holonomic(hk.pose(robot, "zyz", rows=[3, 4, 5]), hk.lock(0))
    exported = hk.export.export_c(law, tmp_path, q0=[0.2, 0.5, 0.7, -0.4], name="law", vectors_count=8)
    assert all("passed" in said for said in check(exported))


@pytest.mark.campaign
@sampled(1, ("old", "new"), [("0.4", "0.4004"), ("100.0", "100.05")])
def test_a_wrong_digit_fails_in_single_precision(tmp_path: Path, old: str, new: str) -> None:
    law = hk.holonomic(hk.position(far_away(100.0)), hk.linear([1.0, 0.0, -1.0]))
    hk.export.export_c(law, tmp_path, q0=[0.3, 0.9, -0.7], name="law", vectors_count=16)
    assert "passed" in in_float(tmp_path)
    file = tmp_path / "law.c"
    spoilt, count = re.subn(rf"HK_C\({re.escape(old)}\)", f"HK_C({new})", file.read_text("utf-8"))
    assert count > 0
    file.write_text(spoilt, "utf-8")
    assert "FAILED" in in_float(tmp_path)


def in_float(folder: Path) -> str:
    """What the self-test says in single precision."""
    chosen = compiler()
    assert chosen is not None
    sources = [str(folder / "law.c"), str(folder / "law_selftest.c")]
    command = [*chosen.command, "-std=c99", "-DLAW_FLOAT", *sources, "-o", str(folder / "t"), "-lm"]
    subprocess.run(command, check=True, timeout=60)
    return subprocess.run([str(folder / "t")], capture_output=True, text=True, check=False, timeout=60).stdout
