"""What the writer of a job file is told: the nearest name, the point to type, the switch that was meant."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from conftest import PANDA_START, SOUND, Command, assert_refused, write_job

PANDA = {
    "robot": '[robot]\nname = "panda"\n',
    "start": f"[start]\nq = {PANDA_START.tolist()}\n",
    "path": '[path]\nkind = "circle"\ncenter = [-0.05, 0, 0]\nrelative = true\nsamples = 20\n',
}


def panda(folder: Path, **spoilt: str) -> Path:
    return write_job(folder, **(PANDA | spoilt))


# --- where the path begins ---


def test_an_absolute_polyline_off_the_tool_is_cured_by_what_the_message_says(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    points = "[path]\nkind = 'polyline'\npoints = [{}, [0.35, 0.1, 0.5]]\nsamples = 20\n"
    outcome = holokin("run", panda(tmp_path, path=points.format("[0.3, 0.1, 0.5]")), "--out", out)
    assert_refused(outcome, "job.toml: [path]", "away from the tool", "set relative = true", "the first point")
    assert "starting_at" not in outcome.err
    point = re.search(r"make (\[.*?\]) the first point", outcome.err)
    assert point is not None
    assert holokin("run", panda(tmp_path, path=points.format(point[1])), "--out", out).code == 0


def test_an_absolute_circle_off_the_tools_plane_is_cured_by_what_the_message_says(
    holokin: Command, tmp_path: Path, out: Path, panda_tool: np.ndarray
) -> None:
    center = (panda_tool - [0.05, 0, 0.002]).round(3).tolist()
    circle = "[path]\nkind = 'circle'\ncenter = {}\nsamples = 20\n"
    outcome = holokin("run", panda(tmp_path, path=circle.format(center)), "--out", out)
    assert_refused(outcome, "[path.center]", "off the plane", "set relative = true")
    off = float(re.search(r"is ([-\d.e]+) m off", outcome.err)[1])
    assert off == pytest.approx(abs(panda_tool[2] - center[2]), abs=1e-6)
    inside = re.search(r"center = (\[.*?\])", outcome.err)[1]
    mended = "relative = true\n" + circle.format(inside)
    assert holokin("run", panda(tmp_path, path=mended.replace("relative = true\n[path]", "[path]\nrelative = true")),
                   "--out", out).code == 0  # fmt: skip


@pytest.fixture
def panda_tool() -> np.ndarray:
    import holokin as hk

    return hk.load("panda").pose(PANDA_START)[:3, 3]


def test_degrees_taken_for_radians_are_asked_about(holokin: Command, tmp_path: Path, out: Path) -> None:
    start = "[start]\nq = [10, -20, 10, -110, 20, 100, 30]\n"
    assert_refused(holokin("run", panda(tmp_path, start=start), "--out", out), "[start.q]", "degrees = true")
    assert holokin("run", panda(tmp_path, start=start + "degrees = true\n"), "--out", out).code == 0
    far = "[start]\nq = [1000, -20, 10, -110, 20, 100, 30]\n"  # no posture in degrees either
    outcome = holokin("run", panda(tmp_path, start=far), "--out", out)
    assert_refused(outcome, "[start.q]", "outside its limits")
    assert "degrees = true" not in outcome.err


# --- names ---


def test_a_job_file_without_its_ending_is_recognised(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path, "my-job.toml")
    assert_refused(holokin("run", "my-job", "--out", out), "did you mean the file my-job.toml?")
    write_job(tmp_path, "LOUD.TOML")
    assert_refused(holokin("run", "LOUD", "--out", out), "did you mean the file LOUD.TOML?")
    assert holokin("run", "LOUD.TOML", "--out", out).code == 0
    assert (out / "LOUD" / "report.html").is_file()
    assert holokin("new", "NEW.TOML").code == 0


def test_robots_wants_a_urdf(holokin: Command, tmp_path: Path) -> None:
    file = write_job(tmp_path)
    assert_refused(holokin("robots", file), "job.toml", "a .urdf file", "catalogue")
    assert_refused(holokin("robots", "panda"), "a .urdf file")


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"strategies": '[strategies.a]\nkind = "moore-penros"\n'}, ("did you mean 'moore-penrose'?",)),
        ({"path": SOUND["path"] + "sampels = 3\n"}, ("[path.sampels]", "did you mean 'samples'?")),
        ({"expect": "[expect.moore-penrose]\ndrfit = { below = 1 }\n"}, ("did you mean 'drift'?",)),
        ({"expect": "[expect.moore-penrose]\ndrift = { belw = 1 }\n"}, ("did you mean 'below'?",)),
        ({"task": '[task]\nkind = "positon"\n'}, ("did you mean 'position'?",)),
        ({"task": '[task]\nkind = "pose"\norientation = "twst"\n'}, ("did you mean 'twist'?",)),
        ({"task": '[task]\nkind = "pose"\norientation = ["twist", "twist"]\n'}, ("twice",)),
        ({"path": SOUND["path"] + "speed = 0\n"}, ("is 0: it must be greater than 0", "larger")),
        ({"path": SOUND["path"] + "cycles = 0\n"}, ("it must be at least 1", "larger")),
        ({"path": SOUND["path"] + "cycles = 1.5\n"}, ("is 1.5: it must be a whole number",)),
        ({"path": SOUND["path"] + 'speed = "fast"\n'}, ("is 'fast': it must be a number", "without quotes")),
        ({"path": SOUND["path"] + 'closed = "perhaps"\n'}, ("it must be true or false",)),
        ({"start": "[start]\nq = 3\n"}, ("is 3: it must be a list", "brackets")),
        ({"path": 'path = "circle"\n', "title": ""}, ("[path]", "it must be a table")),
        ({"path": '[path]\nkind = "circle"\ncenter = [1]\n'}, ("[path.center]", "it has 1 entries", "at least 2")),
        ({"title": "title = 3\n"}, ("[title]", "it must be text", "quotes")),
    ],
)
def test_a_fault_is_told_in_plain_words(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], words: tuple[str, ...]
) -> None:
    if spoilt.get("title") == "":
        file = tmp_path / "job.toml"
        file.write_text('title = "x"\npath = "circle"\n' + SOUND["robot"] + SOUND["start"] + SOUND["strategies"])
    else:
        file = write_job(tmp_path, **spoilt)
    outcome = holokin("run", file, "--out", out)
    assert_refused(outcome, "job.toml", *words)
    assert "Input should" not in outcome.err and "change it" not in outcome.err


# --- formulas ---


def test_numbered_names_are_not_offered_where_a_joint_has_one(holokin: Command, tmp_path: Path, out: Path) -> None:
    """On joints q0, q1, q2 a formula's q1 is the second joint; q3 is no joint, not the third."""
    joints = "".join(f'[[joints]]\njoint = "q{i}"\na = 0.5\n' for i in range(3))
    (tmp_path / "arm.toml").write_text('source = "here"\n' + joints)
    spoilt = {
        "robot": '[robot]\nname = "arm.toml"\n',
        "start": "[start]\nq = [0.1, 0.9, 0.9]\n",
        "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 20\n',
    }
    formula = '[strategies.a]\nkind = "custom"\ng = ["{0}"]\nmethod = "velocity"\ninvariant = ["{1}"]\n'
    expect = "[expect.a]\ninvariant = { below = 1e-9 }\n"
    held = write_job(tmp_path, strategies=formula.format("q1", "q1"), expect=expect, **spoilt)
    assert holokin("run", held, "--out", out).code == 0
    walk = np.genfromtxt(out / "job" / "a-cycles.csv", delimiter=",", names=True)
    assert np.ptp(walk["q1"]) < 1e-7 < np.ptp(walk["q0"])
    outcome = holokin("run", write_job(tmp_path, strategies=formula.format("q3", "q1"), **spoilt), "--out", out)
    assert_refused(outcome, "q3", "q0")
