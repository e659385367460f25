"""Every example runs, gives the number that the gallery shows, and is short."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from conftest import campaign
from holokin.app.job import open_job

ROOT = Path(__file__).parents[2]

EXAMPLES = {
    "panda_circle.py": "0.1635, 0.3207, 0.4756",
    "own_constraint.py": "'custom', pose (twist) of iiwa14, is holonomic",
    "papers_form.py": "det H = 1.0",
    "pink_leaf.py": "our leaf: 0.000003 rad off after two circles, two paths 0.000000 rad apart",
    "mink_leaf.py": "our leaf: 0.000003 rad off after two circles, two paths 0.000000 rad apart",
    "teleoperation.py": "ours: tool 0.000000 m, joints 0.000000 rad apart, below 1e-12: True",
    "two_arms_mujoco.py": "our step: joints 0.0000 rad off, tool within 1.4 mm",
    "mujoco_loop.py": "q1 - q3 held: joints 0.0000 rad from where they rested",
    "check_motion.py": "rim at 0.35 m: panda_joint7 and rim are 0.007 m apart",
    "waypoints_to_program.py": "1.102 m of path, 8 corners",
    "two_hands.py": "pseudo-inverse: 0.03074, 0.06097, 0.0907",
    "allocation.py": "pseudo-inverse: 0.03966, 0.07726, 0.1243 off",
    "weld_seam.py": "irb140: pseudo-inverse 0.09617, 0.1894, 0.2778 rad off",
    "timed_program.py": "arm7: 2.096 s",
    "elbow_up.py": "the elbow ends up to 114 mm aside",
    "ur_on_a_rail.py": "the rail is at [0.4   0.77  1.007 1.121 1.168] m",
    "drill_with_free_spin.py": "joints 3 and 7 held: [0. 0. 0. 0. 0. 0.] rad off",
    "paper_irb140.py": "coupled, twist: 0.08157, 0.1617, 0.2406",
    "paper_ppr.py": "pseudo-inverse: 0.1136 off after one round, 1.2679 after ten",
    "humanoid_arm.py": "leans 29.7 degrees aside: stopped at a joint limit",
    "rail_and_arm.py": "pseudo-inverse: 0.060 rad off",
    "audit_a_log.py": "DIFFERS, CANNOT_TELL: 4 cycles, 0.164 rad in the first",
}


LONG = ("teleoperation.py",)  # Examples that compute for longer than a compiler takes

SLOW = (
    "check_motion.py", "drill_with_free_spin.py", "elbow_up.py", "humanoid_arm.py", "mink_leaf.py", "mujoco_loop.py",
    "paper_irb140.py", "pink_leaf.py", "rail_and_arm.py", "teleoperation.py", "timed_program.py", "two_arms_mujoco.py",
    "two_hands.py", "waypoints_to_program.py", "weld_seam.py",
)  # fmt: skip
"""Examples that take longer than a second: of the campaign."""


def test_every_example_is_tested() -> None:
    assert {p.name for p in (ROOT / "examples").glob("*.py")} == set(EXAMPLES)


def test_every_example_is_short_and_in_the_gallery_with_its_number() -> None:
    gallery = (ROOT / "docs" / "gallery.md").read_text("utf-8")
    rows = dict(re.findall(r"^- `([^`]+)`(.+)$", gallery, re.MULTILINE))
    files = {p.name: p for kind in ("*.py", "*.toml") for p in (ROOT / "examples").glob(kind)}
    assert set(rows) == set(files)
    for name, number in EXAMPLES.items():
        assert number in rows[name], name
        assert len(files[name].read_text("utf-8").splitlines()) < 80, name


@pytest.mark.parametrize("name", [campaign("name", name) if name in SLOW else name for name in EXAMPLES])
def test_an_example_runs_and_gives_its_number(name: str, tmp_path, monkeypatch, capsys) -> None:
    """On the virtual machine, which gives the same numbers, where a compiler would take longer than the example."""
    monkeypatch.chdir(tmp_path)
    if name not in LONG:
        monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    if name == "pink_leaf.py":
        pytest.importorskip("pinocchio", reason="it has no wheels for Windows")
    runpy.run_path(str(ROOT / "examples" / name))
    assert EXAMPLES[name] in capsys.readouterr().out


def test_the_jobs_of_panda_say_what_is_expected_of_them() -> None:
    for job in (ROOT / "examples").glob("panda-*.toml"):
        assert open_job(str(job))[1].expect
